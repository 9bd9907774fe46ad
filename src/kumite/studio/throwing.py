"""Throwing by hand: a click into the picture throws a ball from the viewer's eye.

A ball goes for the body that the clicked ray comes near to, at the point of the ray that is nearest
to it; if the ray passes everybody, for the ray's point as far away as they are. Bodies are where
they were in the picture that was clicked.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kumite.errors import KumiteError
from kumite.scene.stage import Throwable
from kumite.studio.doors import within

SLOWEST, FASTEST = 4.0, 40.0  # m/s
SMALLEST, LARGEST = 0.03, 0.4  # m
SPEED = 9.0  # m/s, at first
NEAR = 1.0  # m from a body to a ray that means it
BEFORE, BELOW = 0.5, 0.25  # m before and below the eye that a ball leaves the hand
LONGEST_FLIGHT = 2.5  # s: what would be under way for longer is thrown faster


class Aim(NamedTuple):
    """Whom a ray means, and where a ball is to come by."""

    goal: np.ndarray  # [3] m
    who: int
    off: float  # m between ray and body; below 0 through it


def aim_along(
    eye: np.ndarray, way: np.ndarray, centre: np.ndarray, radius: np.ndarray, floor: float
) -> Aim:
    """What a ray from an eye [3] along a way [3] means, among bodies of spheres [K, B, 3], [B].

    floor [m]: no goal is lower.
    """
    way = way / np.linalg.norm(way)
    t = np.maximum((centre - eye) @ way, 0.0)  # [K, B]
    off = np.linalg.norm(centre - eye - t[..., None] * way, axis=2)
    gap = off - radius
    met = gap <= 0.0
    if met.any():  # of those that the ray goes through the first
        who = int(np.unravel_index(np.where(met, t, np.inf).argmin(), t.shape)[0])
    else:
        who = int(np.unravel_index(gap.argmin(), gap.shape)[0])
    nearest = int(gap[who].argmin())
    far = t[who, nearest]
    if gap[who, nearest] > NEAR or far == 0.0:
        who, far = _passing(eye, way, centre.mean(axis=1))
    goal = eye + far * way
    if goal[1] < floor and way[1] < 0.0 and eye[1] > floor:
        goal = eye + (eye[1] - floor) / -way[1] * way
    return Aim(goal, who, float(gap[who].min()))


def _passing(eye: np.ndarray, way: np.ndarray, middle: np.ndarray) -> tuple[int, float]:
    """Whose middle [K, 3] a ray comes by nearest before the eye, and how far along [m]."""
    ahead = (middle - eye) @ way
    off = np.linalg.norm(middle - eye - ahead[:, None] * way, axis=1)
    who = int(np.where((ahead > 0.0) == np.any(ahead > 0.0), off, np.inf).argmin())
    return who, max(float(ahead[who]), 4.0 * BEFORE)


@dataclass
class Throws:
    """What a page throws by hand, and how."""

    at: Throwable
    speed: float = SPEED  # m/s
    radius: float = 0.11  # m; the scene's at first

    def __post_init__(self) -> None:
        self.radius = float(np.clip(self.at.ball_radius, SMALLEST, LARGEST))

    def set_speed(self, speed: float) -> None:
        self.speed = within("ball speed", speed, SLOWEST, FASTEST)

    def set_radius(self, radius: float) -> None:
        self.radius = within("ball radius", radius, SMALLEST, LARGEST)

    def one(self) -> None:
        """A ball comes as by itself. The scene stands still."""
        self.at.throw_one(self.speed, self.radius)

    def along(
        self,
        eye: np.ndarray,
        way: np.ndarray,
        bodies: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> None:
        """Throw along a ray [3], [3]. bodies: where whom it may mean were seen, as
        :meth:`Throwable.bodies`. The scene stands still. A throw that makes no sense is none."""
        centre, radius = self.at.bodies() if bodies is None else bodies
        aim = aim_along(eye, way, centre, radius, self.radius)
        place = eye + BEFORE * way / np.linalg.norm(way) - [0.0, BELOW, 0.0]
        place[1] = max(place[1], self.radius)
        speed = max(self.speed, float(np.linalg.norm(aim.goal - place)) / LONGEST_FLIGHT)
        with contextlib.suppress(KumiteError):
            self.at.throw(place, aim.goal, speed, self.at.thrown_at[aim.who], self.radius)
