"""How far a join jumps: what a viewer sees where one captured motion goes on as another.

A join is shown faded over some tenths of a second, so that nothing jumps on the screen; but what
must be faded shows. Three numbers say how much it is: how far the pelvis is raised or lowered, how
far the joint that differs most turns, and by how much the pelvis' velocity changes. The clips' own
motion from frame to frame is told by the same three, so that joins can be held against it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from kumite.brief import brief
from kumite.checked import checked
from kumite.clip import ClipSet
from kumite.errors import KumiteError
from kumite.graph.distance import joint_weights
from kumite.graph.transitions import Transitions
from kumite.rotation import from_yaw, multiply, planar_apply

_PIECE = 65536  # joins that are measured at once


@brief
@dataclass(frozen=True)
class Jumps:
    """How far X joins jump."""

    height: np.ndarray  # [X] m, of the pelvis
    angle: np.ndarray  # [X] rad, of the joint that turns most
    speed: np.ndarray  # [X] m/s, of the pelvis' velocity

    def __len__(self) -> int:
        return len(self.height)


@dataclass(frozen=True)
class JoinBound:
    """The farthest that a join may jump. A graph whose clips fit each other loses next to none:
    of a boxer's joins at lift-offs the farthest jumps 0.10 m, 0.91 rad and 1.2 m/s.
    """

    height: float = 0.15  # m
    angle: float = 1.5  # rad
    speed: float = 3.0  # m/s: between a walk and a run

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            if not value > 0:  # NaN is not, either
                raise KumiteError(f"join bound: {f.name} {value}; expected more than 0")

    def within(self, jumps: Jumps) -> np.ndarray:
        """Which joins [X] bool keep to it."""
        within = [getattr(jumps, f.name) <= getattr(self, f.name) for f in fields(self)]
        return np.logical_and.reduce(within)


@checked
class JoinMeter:
    """Measures joins of a set of clips."""

    def __init__(self, clips: ClipSet) -> None:
        """Errors: roles that are missing."""
        skeleton, facing = clips.skeleton, clips.facing
        pelvis = skeleton.joint("pelvis")
        position, world = clips.world
        local = clips.wxyz.copy()
        # The pelvis as it stands in the world, but for the way it faces.
        local[:, pelvis] = multiply(from_yaw(-facing[:, 2]), world[:, pelvis])
        self._pose = local[:, joint_weights(clips) > 0].astype(np.float32)  # [F, J, 4]
        self._height = position[:, pelvis, 1]
        self._velocity = np.zeros((len(clips), 3))  # as it comes to a frame, facing frame
        turn = np.zeros((len(clips), 3))
        turn[:, 2] = -facing[:, 2]
        for a, b in zip(clips.clip_start[:-1].tolist(), clips.clip_start[1:].tolist()):
            if b - a > 1:
                moved = np.diff(position[a:b, pelvis], axis=0) * clips.fps
                self._velocity[a + 1 : b] = planar_apply(turn[a + 1 : b], moved)
                self._velocity[a] = self._velocity[a + 1]
        self._follows = np.flatnonzero(np.diff(clips.clip_of_frame) == 0)

    def joins(self, source: np.ndarray, target: np.ndarray) -> Jumps:
        """Of joins by which frame ``target`` [X] is shown after ``source`` [X]: ``target - 1`` is
        what it came after in its clip.
        """
        return self._between(np.asarray(source), np.asarray(target) - 1)

    def own(self) -> Jumps:
        """Of the clips themselves, from each frame to the next."""
        return self._between(self._follows, self._follows + 1)

    def _between(self, a: np.ndarray, b: np.ndarray) -> Jumps:
        angle = np.zeros(len(a))
        for first in range(0, len(a), _PIECE):
            piece = slice(first, first + _PIECE)
            dot = np.abs(np.einsum("xjc,xjc->xj", self._pose[a[piece]], self._pose[b[piece]]))
            least = dot.min(axis=1, initial=1.0).astype(np.float64)
            angle[piece] = 2.0 * np.arccos(np.clip(least, 0.0, 1.0))
        speed = np.linalg.norm(self._velocity[a] - self._velocity[b], axis=1)
        return Jumps(np.abs(self._height[a] - self._height[b]), angle, speed)


def bounded(clips: ClipSet, transitions: Transitions, bound: JoinBound) -> Transitions:
    """The transitions that keep to a bound. Errors: none does."""
    jumps = JoinMeter(clips).joins(transitions.source, transitions.target)
    keep = bound.within(jumps)
    if len(keep) and not keep.any():
        raise KumiteError(
            f"none of {len(keep)} joins keeps to the bound: the best of them jumps "
            f"{jumps.height.min():.2f} m, {jumps.angle.min():.2f} rad or {jumps.speed.min():.1f} "
            f"m/s at least; expected at most {bound.height:g} m (--join-height), {bound.angle:g} "
            f"rad (--join-angle) and {bound.speed:g} m/s (--join-speed)"
        )
    kept = {name: getattr(transitions, name)[keep] for name in ("source", "target", "cost")}
    return replace(transitions, **kept)
