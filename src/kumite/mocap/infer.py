"""What mocap files do not say: the length unit, the axis that is up, the height of the floor.

Each is read off the body. Bones have a person's size in one known unit only; heads are above feet;
feet come down to the floor. Clips of one skeleton in one folder are one session with one scale,
one up axis and one floor, so that a clip that crawls or jumps does not settle these alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from kumite import rotation
from kumite.clip import SIDES, Skeleton, forward_kinematics
from kumite.errors import KumiteError
from kumite.mocap.raw import UP_AXES, RawMotion, to_y_up

METRES_PER_UNIT = {
    "metres": 1.0,
    "centimetres": 0.01,
    "inches": 0.0254,
    "millimetres": 0.001,
    "CMU's 0.45-inch units": 0.0254 / 0.45,
}
USUAL_LEG = 0.86  # m, hip to ankle along the bones; adults have 0.75 to 1.0
LEG_RANGE = (0.55, 1.3)  # m; children and giants; no two known units both land in here
TOE_HEIGHT = 0.03  # m; a toe or foot tip of a body model when its sole is on the floor
ANKLE_HEIGHT = 0.08  # m; for skeletons that end at the ankle
NEAR_FLOOR = 0.08  # m; feet that come down this near to where they should keep the file's own floor
_LOW = 5.0  # percentile of the lowest foot point's height: low, but not one bad frame
_CLEAR = 0.2  # how much more upright a body must be about one axis than about the other
_MOST_FRAMES = 2000  # of a clip that are looked at


T = TypeVar("T")


@dataclass(frozen=True)
class Inferred(Generic[T]):
    """A value and the sentence that explains it."""

    value: T
    why: str
    stated: bool = False  # by the file itself


def leg_length(skeleton: Skeleton, roles: Mapping[str, int]) -> float:
    """Hip to ankle along the bones, the mean of both legs, in the skeleton's units."""
    lengths = np.linalg.norm(skeleton.offsets, axis=1)
    chains = [skeleton.chain(roles[f"{s}_thigh"], roles[f"{s}_foot"]) for s in SIDES]
    return float(np.mean([lengths[c].sum() for c in chains]))


def metres_per_unit(raw: RawMotion, roles: Mapping[str, int]) -> Inferred[float]:
    """The unit in which the legs are a person's; the header's own, if that is plausible.

    Errors: no known unit fits.
    """
    leg = leg_length(raw.skeleton, roles)
    low, high = LEG_RANGE
    stated = raw.metres_per_unit
    if stated is not None and low <= leg * stated <= high:
        return Inferred(stated, f"the header's units; legs of {leg * stated:.2f} m", stated=True)
    if leg > 0:
        fits = {n: abs(np.log(leg * u / USUAL_LEG)) for n, u in METRES_PER_UNIT.items()}
        name = min(fits, key=lambda n: fits[n])
        size = leg * METRES_PER_UNIT[name]
        if low <= size <= high:
            return Inferred(METRES_PER_UNIT[name], f"{name}; legs of {size:.2f} m")
    sizes = ", ".join(f"{leg * u:.3g} m in {n}" for n, u in METRES_PER_UNIT.items())
    raise KumiteError(
        f"{raw.source}: the legs fit a person in no known unit ({sizes}); expected a given "
        "metres_per_unit"
    )


def up_axis(clips: Sequence[RawMotion], roles: Mapping[str, int]) -> Inferred[str]:
    """The axis along which heads are above feet: in the motion, or else in the rest pose."""
    upright = np.zeros(3)
    frames = 0
    for raw in clips:
        position, _ = forward_kinematics(raw.skeleton, *_some_frames(raw))
        upright += _body_axis(position, roles).sum(axis=0)
        frames += len(position)
    upright /= max(frames, 1)
    why = "heads are above feet in the motion"
    y, z = float(upright[1]), float(upright[2])
    if abs(y - z) < _CLEAR:
        rest = _body_axis(clips[0].skeleton.rest_positions[None], roles)[0]
        y, z = float(rest[1]), float(rest[2])
        why = "the head is above the feet in the rest pose"
        if abs(y - z) < _CLEAR:
            return Inferred(UP_AXES[0], "usual; neither motion nor rest pose tells")
    return Inferred("Y" if y > z else "Z", why)


def ground_height(
    clips: Sequence[RawMotion],
    roles: Mapping[str, int],
    metres_per_unit: float,
    up_axis: str,
) -> Inferred[float]:
    """The floor [m] of a session, in its own frame once that is Y up.

    It is the file's own zero wherever the feet come down near it, since mocap rooms are measured
    and body models are not: their toes float by some centimetres. Otherwise it is put under the
    feet.
    """
    points = _foot_points(clips[0].skeleton, roles)
    has_toes = any(np.any(offset) or j not in _ankles(roles) for j, offset in points)
    above = TOE_HEIGHT if has_toes else ANKLE_HEIGHT
    lows = []
    for raw in clips:
        raw = to_y_up(raw, up_axis)
        position, world = forward_kinematics(raw.skeleton, *_some_frames(raw))
        ends = _foot_points(raw.skeleton, roles)
        heights = [
            (position[:, j] + rotation.rotate(world[:, j], offset))[:, 1] for j, offset in ends
        ]
        lows.append(float(np.percentile(np.min(heights, axis=0), _LOW)) * metres_per_unit)
    low = float(np.median(lows))
    if abs(low - above) <= NEAR_FLOOR:
        return Inferred(0.0, f"the file's own zero; feet come down to {low:+.3f} m")
    return Inferred(low - above, f"feet come down to {low:+.3f} m and stand {above:.2f} m high")


def _some_frames(raw: RawMotion) -> tuple[np.ndarray, np.ndarray]:
    step = -(-len(raw) // _MOST_FRAMES)
    return raw.root_position[::step], raw.wxyz[::step]


def _body_axis(position: np.ndarray, roles: Mapping[str, int]) -> np.ndarray:
    """Unit vectors [F, 3] from between the feet to the head."""
    axis = position[:, roles["head"]] - 0.5 * sum(position[:, roles[f"{s}_foot"]] for s in SIDES)
    return axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-12)


def _ankles(roles: Mapping[str, int]) -> tuple[int, ...]:
    return tuple(roles[f"{s}_foot"] for s in SIDES)


def _foot_points(skeleton: Skeleton, roles: Mapping[str, int]) -> list[tuple[int, np.ndarray]]:
    """What may touch the floor, (joint, offset [3]): ankles, and joints and tips below them."""
    below = set(_ankles(roles))
    for j in range(1, len(skeleton)):
        if int(skeleton.parents[j]) in below:
            below.add(j)
    points = [(j, np.zeros(3)) for j in sorted(below)]
    tips = zip(skeleton.tip_parents.tolist(), skeleton.tip_offsets)
    return points + [(j, offset) for j, offset in tips if j in below]
