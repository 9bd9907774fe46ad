"""Clips out as BVH, which every animation tool reads.

Joints turn by the same three channels each, in one order; the root has its position besides.
End Sites are the skeleton's tips. Angles have six decimals of a degree and lengths six of a unit,
so that reading back gives the same poses within a micrometre and writing again the same bytes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kumite import rotation
from kumite.checks import instance
from kumite.clip import Clip, Skeleton
from kumite.errors import KumiteError
from kumite.files import writing

ORDERS = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")
_ROWS = 4096  # formatted at a time, so that a long clip does not double in memory


def write_bvh(
    path: Path | str, clip: Clip, *, metres_per_unit: float = 0.01, order: str = "ZYX"
) -> None:
    """Write a clip; centimetres by default, which is what most tools expect.

    ``order`` is the order of the rotation channels; each turns in the axes that the ones before it
    left. The file appears whole or not at all.

    Errors: an unknown order, a scale that is not a positive number, a joint name that BVH cannot
    hold.
    """
    order = order.upper()
    if order not in ORDERS:
        raise KumiteError(f"rotation order {order!r}; expected one of {', '.join(ORDERS)}")
    if not (np.isfinite(metres_per_unit) and metres_per_unit > 0):
        raise KumiteError(f"{metres_per_unit} metres per unit; expected a number more than 0")
    instance(clip, Clip, "write_bvh")
    header, joints = _hierarchy(clip.skeleton, metres_per_unit, order)
    angles = rotation.to_euler(order, clip.wxyz[:, joints], degrees=True)
    values = np.concatenate(
        [clip.root_position / metres_per_unit, angles.reshape(len(clip), -1)], axis=1
    )
    # -0 and -180 are 0 and 180: one spelling for one pose.
    values = np.round(values, 6) + 0.0
    turns = values[:, 3:]
    turns[turns == -180.0] = 180.0
    with writing(path) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as file:
        file.write("\n".join(header))
        file.write(f"\nMOTION\nFrames: {len(clip)}\nFrame Time: {1 / clip.fps:.10f}\n")
        row = " ".join(["%.6f"] * values.shape[1]) + "\n"
        for start in range(0, len(values), _ROWS):
            block = values[start : start + _ROWS]
            file.write((row * len(block)) % tuple(block.ravel().tolist()))


def _hierarchy(
    skeleton: Skeleton, metres_per_unit: float, order: str
) -> tuple[list[str], list[int]]:
    """The lines of the HIERARCHY, and the joints in the order of its channels: depth first."""
    children: list[list[int]] = [[] for _ in skeleton.names]
    for j in range(1, len(skeleton)):
        children[int(skeleton.parents[j])].append(j)
    tips: list[list[np.ndarray]] = [[] for _ in skeleton.names]
    for j, offset in zip(skeleton.tip_parents.tolist(), skeleton.tip_offsets):
        tips[j].append(offset)
    turns = " ".join(f"{axis}rotation" for axis in order)
    lines = ["HIERARCHY"]
    joints: list[int] = []
    # A joint to open with its depth, or a depth at which to close one.
    stack: list[tuple[int | None, int]] = [(0, 0)]
    while stack:
        j, depth = stack.pop()
        pad = "  " * depth
        if j is None:
            lines.append(f"{pad}}}")
            continue
        joints.append(j)
        name = skeleton.names[j]
        if not name.strip() or name != name.strip() or any(c in name for c in "{}\n\r"):
            raise KumiteError(f"joint name {name!r} cannot stand in a BVH file; rename it")
        offset = np.zeros(3) if j == 0 else skeleton.offsets[j]
        position = "6 Xposition Yposition Zposition" if j == 0 else "3"
        lines += [
            f"{pad}{'JOINT' if j else 'ROOT'} {name}",
            f"{pad}{{",
            f"{pad}  OFFSET {_lengths(offset, metres_per_unit)}",
            f"{pad}  CHANNELS {position} {turns}",
        ]
        ends = tips[j]
        if not ends and not children[j]:
            # Tools need an end to draw a bone: the same half bone that Skeleton.tip takes.
            ends = [0.5 * offset]
        for end in ends:
            lines += [
                f"{pad}  End Site",
                f"{pad}  {{",
                f"{pad}    OFFSET {_lengths(end, metres_per_unit)}",
                f"{pad}  }}",
            ]
        stack.append((None, depth))
        stack.extend((c, depth + 1) for c in reversed(children[j]))
    return lines, joints


def _lengths(offset: np.ndarray, metres_per_unit: float) -> str:
    return " ".join(f"{v:.6f}" for v in np.round(offset / metres_per_unit, 6) + 0.0)
