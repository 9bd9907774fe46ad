"""One take as its file tells it, and the step from there to a clip in our conventions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kumite import rotation
from kumite.clip import Clip, Skeleton
from kumite.errors import KumiteError

UP_AXES = ("Y", "Z")
# A quarter turn about X carries +Z to +Y, and a character that faces -Y to +Z.
_Y_FROM_Z = rotation.from_axis_angle([1.0, 0.0, 0.0], -0.5 * np.pi)


@dataclass(frozen=True)
class RawMotion:
    """What a motion capture file holds, in the file's own length unit and axes."""

    source: Path
    skeleton: Skeleton  # lengths in file units; no roles
    fps: float
    fps_stated: bool  # by the file; otherwise the format's usual rate
    root_position: np.ndarray  # [F, 3] file units
    wxyz: np.ndarray  # [F, J, 4]
    metres_per_unit: float | None = None  # what the file's own header says, if anything
    skeleton_source: Path | None = None  # the ASF of an AMC
    notes: tuple[str, ...] = ()  # what was repaired or left out on the way in

    def __len__(self) -> int:
        return len(self.root_position)


def to_y_up(raw: RawMotion, up_axis: str) -> RawMotion:
    """The same motion with +Y up. Rest pose, root and every joint's axes turn together.

    Errors: an axis that is neither Y nor Z.
    """
    if up_axis not in UP_AXES:
        raise KumiteError(f"{raw.source}: up axis {up_axis!r}; expected one of Y, Z")
    if up_axis == "Y":
        return raw
    turn = _Y_FROM_Z
    skeleton = replace(
        raw.skeleton,
        offsets=rotation.rotate(turn, raw.skeleton.offsets),
        tip_offsets=rotation.rotate(turn, raw.skeleton.tip_offsets),
    )
    # Conjugation of a quaternion turns its vector part and leaves its angle.
    wxyz = raw.wxyz.copy()
    wxyz[..., 1:] = rotation.rotate(turn, wxyz[..., 1:])
    root = rotation.rotate(turn, raw.root_position)
    return replace(raw, skeleton=skeleton, root_position=root, wxyz=wxyz)


def to_clip(
    raw: RawMotion,
    name: str,
    *,
    metres_per_unit: float,
    up_axis: str = "Y",
    ground_height: float = 0.0,
    roles: Mapping[str, int] | None = None,
) -> Clip:
    """A clip in metres, Y up, with the ground at y = 0.

    ``ground_height`` [m] is where the file has its floor, after scale and axes are ours.
    Errors: a scale that is not a positive number; an axis that is neither Y nor Z.
    """
    if not (np.isfinite(metres_per_unit) and metres_per_unit > 0):
        raise KumiteError(f"{raw.source}: {metres_per_unit} metres per unit; expected more than 0")
    if not np.isfinite(ground_height):
        raise KumiteError(f"{raw.source}: ground height {ground_height}; expected a number [m]")
    upright = to_y_up(raw, up_axis)
    skeleton = replace(
        upright.skeleton,
        offsets=upright.skeleton.offsets * metres_per_unit,
        tip_offsets=upright.skeleton.tip_offsets * metres_per_unit,
        roles=dict(roles or {}),
    )
    root = upright.root_position * metres_per_unit - np.array([0.0, ground_height, 0.0])
    return Clip(name, skeleton, raw.fps, root, upright.wxyz, raw.notes)
