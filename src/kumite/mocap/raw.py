"""One take as its file tells it, and the step from there to a clip in our conventions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from kumite import rotation
from kumite.clip import Clip, Skeleton
from kumite.errors import KumiteError
from kumite.mocap.sources import UP_AXES

MOST_JOINTS = 2000  # of a skeleton: a person with fingers and face has some 300
MOST_CHARACTERS = 200  # of a joint's name
MOST_POSES = 100_000_000  # frames times joints of a take, 3 GB: four hours of 60 joints at 120 Hz
_X, _Z, _QUARTER = [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], 0.5 * np.pi
# The turn that carries each axis to +Y. About X, so that left stays left; a character that faces
# -Y where Z is up faces +Z then.
_TO_Y = {
    "Y": rotation.IDENTITY_WXYZ,
    "Z": rotation.from_axis_angle(_X, -_QUARTER),
    "X": rotation.from_axis_angle(_Z, _QUARTER),
    "-Y": rotation.from_axis_angle(_X, 2 * _QUARTER),
    "-Z": rotation.from_axis_angle(_X, _QUARTER),
    "-X": rotation.from_axis_angle(_Z, -_QUARTER),
}


SAY_RATE = "--file-fps, or file_fps in kumite.toml"


def check_size(path: Path, frames: int, joints: int) -> None:
    """Errors: more poses than :data:`MOST_POSES`."""
    if frames * joints > MOST_POSES:
        raise KumiteError(
            f"{path}: {frames} frames of {joints} joints; expected at most {MOST_POSES} together: "
            "cut the file in parts"
        )


@dataclass(frozen=True)
class Stretch:
    """How far bones of one length take joints from where the file has them, at most."""

    joint: str  # whose position changes most
    distance: float  # file units


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
    # joint below the root -> [F, 3] where its position channels put it, in its parent's axes;
    # only of joints that these move from their offset, until bones have one length (rigid.py)
    positions: Mapping[int, np.ndarray] = field(default_factory=dict)
    stretch: Stretch | None = None  # what bones of one length cost, if anything

    def __len__(self) -> int:
        return len(self.root_position)


def to_y_up(raw: RawMotion, up_axis: str) -> RawMotion:
    """The same motion with +Y up. Rest pose, root and every joint's axes turn together.

    Errors: an axis that is none of the six.
    """
    if up_axis not in UP_AXES:
        axes = ", ".join(UP_AXES)
        raise KumiteError(f"{raw.source}: up axis {up_axis!r}; expected one of {axes}")
    if up_axis == "Y":
        return raw
    turn = _TO_Y[up_axis]
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
    Errors: a scale that is not a positive number; an unknown axis.
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
