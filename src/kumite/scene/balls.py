"""Balls that are thrown at people: by hand, or by a seed."""

from __future__ import annotations

import numpy as np

from kumite.body import Body
from kumite.control.attack import Attack, thrown
from kumite.errors import KumiteError
from kumite.kernels import ball as kernels
from kumite.kernels.blow import NO_HIT
from kumite.rotation import rotate
from kumite.scene.settings_dodge import BallsSettings
from kumite.scene.stage import OUT_OF_SIGHT, SceneObject

BOUNCE = 0.55  # share of its speed that a ball keeps when it bounces off the floor …
OFF_A_BODY = 0.25  # … and off somebody
ROLLING = 0.6  # 1/s, the rate at which a ball that lies comes to rest
REST = 0.3  # m/s: slower downwards it bounces no more


class Balls:
    """A pool of balls in flight, bouncing and lying about."""

    def __init__(self, settings: BallsSettings, body: Body, fps: float) -> None:
        self.settings, self.body, self.fps = settings, body, fps
        self.objects = [
            SceneObject(f"ball {n + 1}", OUT_OF_SIGHT.copy(), settings.radius, thrown=True)
            for n in range(settings.pool)
        ]
        count = settings.pool
        self.position = np.tile(OUT_OF_SIGHT, (count, 1))
        self.velocity = np.zeros((count, 3))
        self.radius = np.full(count, settings.radius)
        self.used = np.zeros(count, dtype=bool)
        self.attack: list[Attack | None] = [None] * count  # while it has met nothing
        self.thrown = 0
        self._who = np.zeros(count, dtype=np.int64)
        self._part = np.zeros(count, dtype=np.int64)
        self._when = np.zeros(count)

    def throw(
        self, position: np.ndarray, velocity: np.ndarray, now: float, radius: float | None = None
    ) -> int:
        """Throw the ball that has lain longest, of its settings' radius [m] or another; its number.

        Errors: a throw that makes no sense.
        """
        n = self.thrown % len(self.objects)
        s = self.settings
        name = f"throw {self.thrown + 1}"
        radius = s.radius if radius is None else float(radius)
        attack = thrown(position, velocity, radius, when=now, gravity=s.gravity, name=name)
        self.attack[n], self.radius[n], self.objects[n].radius = attack, radius, radius
        self.position[n], self.velocity[n], self.used[n] = position, velocity, True
        self.thrown += 1
        return n

    def step(
        self, roots: np.ndarray, capsules: np.ndarray
    ) -> list[tuple[int, int, int, np.ndarray]]:
        """One frame; hits: (ball, character, part, its velocity [3] m/s).

        capsules [2, 2, K, P, 3]: ends a and b of everybody's parts, before and now.
        """
        dt, s = 1.0 / self.fps, self.settings
        fly = np.flatnonzero(self.used)
        if len(fly) == 0:
            return []
        before = self.position[fly].copy()
        # Free fall is exact, so that a ball is where its attack says.
        self.position[fly] += self.velocity[fly] * dt - [0.0, 0.5 * s.gravity * dt * dt, 0.0]
        self.velocity[fly, 1] -= s.gravity * dt
        # Who lands on the way flies no farther: the rest of its way would be under the ground.
        fallen = before[:, 1] - self.position[fly, 1]
        lands = (before[:, 1] - self.radius[fly]) / np.maximum(fallen, 1e-12)
        lands = np.where(self.position[fly, 1] < self.radius[fly], lands, 1.0)
        hits = []
        who, part, when = self._who[: len(fly)], self._part[: len(fly)], self._when[: len(fly)]
        radius = self.radius[fly]
        kernels.first_met(
            before, self.position[fly], radius, capsules[0, 0], capsules[1, 0], capsules[0, 1],
            capsules[1, 1], self.body.radius_start, self.body.radius_end, roots,
            np.full(len(fly), NO_HIT), who, part, when,
        )  # fmt: skip
        for i, n in enumerate(fly.tolist()):
            if who[i] != NO_HIT:
                if self.attack[n] is not None and when[i] <= lands[i]:
                    hits.append((n, int(who[i]), int(part[i]), self.velocity[n].copy()))
                self._bounce_off(n, before[i], capsules[1, :, who[i], part[i]], float(when[i]))
            self._fall(n, dt)
            self.objects[n].position = self.position[n].copy()
        return hits

    def _bounce_off(self, n: int, before: np.ndarray, capsule: np.ndarray, share: float) -> None:
        a, b = capsule
        p = before + share * (self.position[n] - before)
        along = np.clip((p - a) @ (b - a) / max((b - a) @ (b - a), 1e-9), 0.0, 1.0)
        out = p - (a + along * (b - a))
        out /= max(np.linalg.norm(out), 1e-9)
        into = self.velocity[n] @ out
        if into < 0:
            self.velocity[n] -= (1.0 + OFF_A_BODY) * into * out
        self.position[n] = p
        self.attack[n] = None

    def _fall(self, n: int, dt: float) -> None:
        r = self.radius[n]
        if self.position[n, 1] >= r:
            return
        self.attack[n] = None
        self.position[n, 1] = r
        if self.velocity[n, 1] < -REST:
            self.velocity[n] *= [0.8, -BOUNCE, 0.8]
        else:
            self.velocity[n] *= np.exp(-ROLLING * dt)
            self.velocity[n, 1] = 0.0


def capsules_of(body: Body, position: np.ndarray, world_wxyz: np.ndarray) -> np.ndarray:
    """Ends [2, K, P, 3] of everybody's parts, from joints [K, J, 3] and their turns [K, J, 4]."""
    at, turn = position[:, body.joint], world_wxyz[:, body.joint]
    return np.stack([at + rotate(turn, body.start), at + rotate(turn, body.end)])


def aimed(
    rng: np.random.Generator, settings: BallsSettings, facing: np.ndarray, goal: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Place and velocity of a throw at a point [3], from before someone at a facing frame [3]."""
    s = settings
    bearing = facing[2] + np.radians(rng.uniform(-s.bearing_deg, s.bearing_deg))
    far = rng.uniform(*s.distance)
    place = np.array(
        [
            facing[0] + far * np.sin(bearing),
            rng.uniform(*s.height),
            facing[1] + far * np.cos(bearing),
        ]
    )
    return place, velocity_to(place, goal, rng.uniform(*s.speed), s.gravity)


def velocity_to(place: np.ndarray, goal: np.ndarray, speed: float, gravity: float) -> np.ndarray:
    """The velocity with which a ball goes from a place to a goal; ``speed`` [m/s] is the mean.

    Errors: place and goal are the same.
    """
    way = goal - place
    far = float(np.linalg.norm(way))
    if far < 1e-6:
        raise KumiteError("throw: it begins where it is aimed at; expected a place farther away")
    seconds = far / speed
    velocity = way / seconds
    velocity[1] += 0.5 * gravity * seconds
    return velocity
