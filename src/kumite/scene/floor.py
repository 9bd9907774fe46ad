"""The bodies of a scene: characters played from a library, kept apart, their blows tested."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kumite.body import ARMS, lay_body
from kumite.clip import LIMBS
from kumite.graph import Layer
from kumite.kernels import crowd as kernels
from kumite.kernels import near
from kumite.kernels.blow import NO_BLOW, NO_HIT, NO_LIMB, NOBODY
from kumite.kernels.character import MANY
from kumite.synthesis import Cast

TARGET_PARTS = ("head", "neck", "chest", "waist", *ARMS)
CLOSEST = 0.40  # m between two pelvises under which bodies are pushed apart, whatever they do
PUSH_SPEED = 0.5  # m/s, at most, of that push: slow enough not to be seen as a jump


@dataclass(frozen=True)
class Landing:
    """A blow that has met something in the last frame."""

    who: int
    limb: int  # index into clip.LIMBS
    victim: int
    part: int  # of the body
    blow: int
    velocity: np.ndarray  # [3] m/s, of the limb with respect to what it struck
    place: np.ndarray  # [3] m
    share: float  # of the frame, 0..1


class Floor:
    """K characters as arrays, and who aims at whom."""

    def __init__(
        self, library: Layer, count: int, spans: tuple[np.ndarray, np.ndarray] | None = None
    ) -> None:
        """spans: see :class:`~kumite.synthesis.Cast`."""
        self.library = library
        self.fps = library.clips.fps
        self.body = lay_body(library.clips.skeleton)
        self.shapes = self._lay_shapes()
        self.cast = Cast(library, count, spans)
        self.opponent = np.full(count, NOBODY, dtype=np.int64)
        buckets = 1 << max(3, int(2 * count - 1).bit_length())
        self.grid = near.Hash(
            np.zeros(buckets + 1, dtype=np.int32),
            np.zeros(count, dtype=np.int32),
            np.zeros((count, 2), dtype=np.int32),
        )
        self.pushed = np.zeros((count, 2))  # m in a frame by which bodies carry each away
        parts, limbs = len(self.body), len(LIMBS)
        self.room = kernels.Room(CLOSEST, PUSH_SPEED / self.fps, np.zeros((count, 2)))
        self.blows = kernels.Blows(
            np.zeros((2, count, limbs, 3)),
            np.zeros((2, count, parts, 3)),
            np.zeros((2, count, parts, 3)),
            np.full((count, limbs), NO_BLOW, dtype=np.int32),
            np.full((count, limbs), NO_BLOW, dtype=np.int32),
            np.zeros((count, limbs), dtype=bool),
            np.zeros(count, dtype=bool),
            np.full((count, limbs), NO_HIT, dtype=np.int64),
            np.zeros((count, limbs)),
        )

    def _lay_shapes(self) -> kernels.Shapes:
        """Where blows land on a body, and with what limbs strike."""
        body, skeleton = self.body, self.library.clips.skeleton
        joints, offsets, radii = [], [], []
        for limb in LIMBS:
            joint, offset = skeleton.tip(limb)
            radius = float(body.radius_end[body.part(limb)])
            length = float(np.linalg.norm(offset))
            joints.append(joint)
            # The sphere's front is the limb's tip.
            offsets.append(offset * (1.0 - min(radius / max(length, 1e-6), 1.0)))
            radii.append(radius)
        return kernels.Shapes(
            body.joint.astype(np.int64),
            body.start,
            body.end,
            body.radius_start,
            body.radius_end,
            np.array([p in TARGET_PARTS for p in body.parts]),
            np.array([p in ARMS for p in body.parts]),
            np.array([LIMBS.index(p) if p in LIMBS else NO_LIMB for p in body.parts]),
            np.array(joints),
            np.array(offsets),
            np.array(radii),
        )

    def start(self) -> None:
        """Everyone has been placed: poses are shown, and what the first frame needs is measured."""
        self.cast.show(0.0)
        kernels.start_blows(self.cast.played, self.grid, self.shapes, self.blows)

    def advance(self) -> bool:
        """Everyone one frame on along the action begun; whether a blow has begun or landed."""
        run = kernels.advance_many if self.cast.count >= MANY else kernels.advance
        dt, cast = 1.0 / self.fps, self.cast
        return bool(
            run(dt, cast.played, self.grid, self.opponent, self.room, self.shapes, self.blows)
        )

    @property
    def thrown(self) -> list[tuple[int, int, int]]:
        """Blows begun in the last frame: who, limb, blow."""
        return [
            (k, s, int(self.blows.thrown[k, s])) for k, s in np.argwhere(self.blows.begun).tolist()
        ]

    @property
    def landings(self) -> list[Landing]:
        """Blows that have met something in the last frame; each lands once."""
        blows, out = self.blows, []
        for k, s in np.argwhere(blows.part != NO_HIT).tolist():
            victim, struck = int(self.opponent[k]), int(blows.part[k, s])
            t = float(blows.when[k, s])
            before, now = blows.tip[:, k, s]
            a, b = blows.a[:, victim, struck], blows.b[:, victim, struck]
            middle_before, middle = 0.5 * (a + b)
            velocity = ((now - before) - (middle - middle_before)) * self.fps
            blow = int(blows.thrown[k, s])
            blows.landed[k, s] = blow
            place = before + t * (now - before)
            out.append(Landing(k, s, victim, struck, blow, velocity, place, t))
        return out
