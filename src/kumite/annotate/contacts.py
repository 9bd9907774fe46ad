"""Foot contacts (Lee & Lee 2004, section 6, data annotation).

A foot is on the ground where its ankle or its toe is near the ground and slow. "Near" is measured
from the height at which that joint rests when the foot stands, estimated from the clips, because a
joint's centre lies some way above the sole.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kumite.brief import brief
from kumite.checks import freeze, instance
from kumite.clip import SIDES, ClipSet, runs
from kumite.errors import KumiteError

STANDING_PERCENTILE = 5.0  # of a joint's heights: low, but above the outliers


@brief
@dataclass(frozen=True)
class Contacts:
    """When each foot supports the body."""

    on_ground: np.ndarray  # [F, 2] bool, left and right
    resting_height: np.ndarray  # [2, 2] m, of the ankle and the toe of the left and right foot

    def __post_init__(self) -> None:
        freeze(self, "contacts", on_ground=(np.bool_, ("F", 2)), resting_height=(float, (2, 2)))

    def lift_off(self, clip_start: np.ndarray) -> np.ndarray:
        """Last frame of contact before a foot leaves the ground [F, 2] bool, within a clip."""
        out = np.zeros_like(self.on_ground)
        out[:-1] = self.on_ground[:-1] & ~self.on_ground[1:]
        out[clip_start[1:] - 1] = False
        return out


def find_contacts(
    clips: ClipSet,
    *,
    height: float = 0.05,
    speed: float = 0.4,
    shortest: float = 0.07,
    resting_height: np.ndarray | None = None,
) -> Contacts:
    """Contacts of every frame.

    height: how far above its resting height a joint may be [m]. speed: how fast it may move [m/s].
    shortest: contacts and gaps shorter than this are noise and are closed [s]. resting_height
    [2, 2] m: see :class:`Contacts`, where it is known; else it is measured, of all clips together.
    """
    instance(clips, ClipSet, "find_contacts")
    if height <= 0 or speed <= 0 or shortest < 0:
        raise KumiteError("contacts: height and speed must be above 0, shortest not below 0")
    position, _ = clips.world
    on_ground = np.zeros((len(clips), 2), dtype=bool)
    resting = np.zeros((2, 2))
    for s, side in enumerate(SIDES):
        for r, part in enumerate(("foot", "toe")):
            role = f"{side}_{part}"
            if role not in clips.skeleton.roles:
                role = f"{side}_foot"  # no toe joint: the ankle alone decides
            p = position[:, clips.skeleton.joint(role)]
            if resting_height is None:
                resting[s, r] = np.percentile(p[:, 1], STANDING_PERCENTILE)
            else:
                resting[s, r] = resting_height[s, r]
            slow = np.linalg.norm(velocity(p, clips), axis=1) < speed
            on_ground[:, s] |= slow & (p[:, 1] < resting[s, r] + height)
    frames = round(shortest * clips.fps)
    for s in range(2):
        for value in (False, True):
            _flip_short_runs(on_ground[:, s], clips.clip_start, frames, value=value)
    return Contacts(on_ground, resting)


def velocity(position: np.ndarray, clips: ClipSet) -> np.ndarray:
    """Velocities [F, 3] of a point [F, 3] by central differences, one-sided at clip ends [m/s]."""
    v = np.zeros_like(position)
    for start, stop in zip(clips.clip_start[:-1], clips.clip_start[1:]):
        if stop - start > 1:
            v[start:stop] = np.gradient(position[start:stop], axis=0) * clips.fps
    return v


def _flip_short_runs(
    mask: np.ndarray, clip_start: np.ndarray, shortest: int, *, value: bool
) -> None:
    """Runs of ``value`` in mask [F] shorter than ``shortest`` frames are flipped in place, but not
    those at a clip's ends."""
    found = runs(mask == value, clip_start)
    short = (found[:, 1] - found[:, 0] < shortest) & ~np.isin(found, clip_start).any(axis=1)
    for a, b in found[short].tolist():
        mask[a:b] = not value
