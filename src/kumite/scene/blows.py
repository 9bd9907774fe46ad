"""Blows of one cast: which limbs throw them, where fists and blades are, and what they meet.

A fist meets head, trunk and arms, as in a live scene (a glove that strikes itself is passed by, an
arm is met squarely or not at all); a blade meets every part of a body.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kumite.body import ARMS, Spheres, lay_body, limb_spheres, strikes_with
from kumite.clip import LIMBS
from kumite.kernels.blow import NO_BLOW, SQUARELY, squareness, swept_contact
from kumite.scene.balls import capsules_of
from kumite.scene.floor import TARGET_PARTS
from kumite.synthesis import Cast

BEFORE, NOW = 0, 1


@dataclass(frozen=True)
class Contact:
    """A blow that has met somebody in the last frame."""

    part: int  # of the body
    velocity: np.ndarray  # [3] m/s, of what strikes with respect to what it struck
    place: np.ndarray  # [3] m
    share: float  # of the frame, 0..1


class Blows:
    """What a cast of K strikes with, and its bodies, now and a frame before."""

    def __init__(self, cast: Cast) -> None:
        self.cast = cast
        self.skeleton = skeleton = cast.library.clips.skeleton
        self.body = lay_body(skeleton)
        self.armed = np.array([strikes_with(skeleton, limb) not in LIMBS for limb in LIMBS])
        self.spheres = [self._front(limb) for limb in LIMBS]
        self.thrown = np.full((cast.count, len(LIMBS)), NO_BLOW, dtype=np.int64)
        self.landed = self.thrown.copy()
        self.capsules = np.stack([self._bodies()] * 2)  # [2, 2, K, P, 3]
        self.tips = [np.stack([at] * 2) for at in self._at()]  # of each limb [2, K, I, 3]

    def _front(self, limb: str) -> Spheres:
        """What lands: the front of a fist or foot, or the blade."""
        if strikes_with(self.skeleton, limb) not in LIMBS:
            return limb_spheres(self.skeleton, strikes_with(self.skeleton, limb))
        joint, offset = self.skeleton.tip(limb)
        radius = float(self.body.radius_end[self.body.part(limb)])
        length = max(float(np.linalg.norm(offset)), 1e-6)
        centre = offset * (1.0 - min(radius / length, 1.0))
        return Spheres(np.array([joint]), centre[None], np.array([radius]))

    def _bodies(self) -> np.ndarray:
        return capsules_of(self.body, self.cast.position, self.cast.world_wxyz)

    def _at(self) -> list[np.ndarray]:
        return [s.at(self.cast.position, self.cast.world_wxyz) for s in self.spheres]

    def step(self) -> list[tuple[int, int, int]]:
        """The cast has moved on a frame; blows begun: who, limb, blow."""
        self.capsules = np.stack([self.capsules[NOW], self._bodies()])
        self.tips = [np.stack([old[NOW], new]) for old, new in zip(self.tips, self._at())]
        thrown = self.cast.played.blow_of_frame[self.cast.frame]
        begun = (thrown != NO_BLOW) & (thrown != self.thrown)
        self.thrown = thrown.astype(np.int64)
        self.landed[thrown == NO_BLOW] = NO_BLOW
        return [(k, s, int(thrown[k, s])) for k, s in np.argwhere(begun).tolist()]

    @property
    def flying(self) -> list[tuple[int, int]]:
        """Who is throwing a blow that has not landed, and with which limb."""
        fly = (self.thrown != NO_BLOW) & (self.thrown != self.landed)
        return [(k, s) for k, s in np.argwhere(fly).tolist()]

    def meets(self, k: int, s: int, other: Blows, victim: int) -> Contact | None:
        """What character k's limb s has met first of somebody of another cast."""
        fps = self.cast.library.clips.fps
        body, first = other.body, None
        a, b = other.capsules[:, 0, victim], other.capsules[:, 1, victim]  # [2, P, 3]
        for i, radius in enumerate(self.spheres[s].radius.tolist()):
            p0, p1 = self.tips[s][:, k, i]
            for p, name in enumerate(body.parts):
                if not self.armed[s] and not other._stops(victim, name):
                    continue
                t = swept_contact(
                    p0, p1, a[BEFORE, p], a[NOW, p], b[BEFORE, p], b[NOW, p],
                    body.radius_start[p], body.radius_end[p], radius,
                )  # fmt: skip
                if t < 0.0 or (first is not None and t >= first.share):
                    continue
                ends = (p0, p1, a[BEFORE, p], a[NOW, p], b[BEFORE, p], b[NOW, p])
                if not self.armed[s] and name in ARMS and squareness(t, *ends) < SQUARELY:
                    continue
                middle = 0.5 * (a[NOW, p] + b[NOW, p] - a[BEFORE, p] - b[BEFORE, p])
                first = Contact(p, (p1 - p0 - middle) * fps, p0 + t * (p1 - p0), t)
        return first

    def _stops(self, k: int, part: str) -> bool:
        """Whether a fist lands on a part: not on legs, nor on a glove that strikes itself."""
        if part not in TARGET_PARTS:
            return False
        return part not in LIMBS or self.thrown[k, LIMBS.index(part)] == NO_BLOW
