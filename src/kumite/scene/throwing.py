"""Throwing balls at those of a scene who avoid, by a seed or by hand, and what becomes of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from kumite.body import Body, Spheres
from kumite.control.attack import Attack
from kumite.scene.balls import Balls, aimed, capsules_of, velocity_to
from kumite.scene.events import Avoided, Event, Missed, Struck, Throw, place
from kumite.scene.settings_dodge import BallsSettings
from kumite.synthesis import Cast
from kumite.synthesis.recoil import RECOIL

AIM_SPREAD = 0.03  # m by which throws miss the middle of what they are aimed at
TRUE = 0.10  # m from a body as it stands: a ball that passes no farther off was aimed well
NEAR = 2.0  # m from a character: so near a ball menaces it, whoever it is thrown at


class Throwing:
    """Balls in flight at a cast of K characters."""

    def __init__(
        self,
        settings: BallsSettings,
        cast: Cast,
        body: Body,
        spheres: Spheres,
        seed: int,
        at: list[int],
        names: Sequence[str],
        mind: Callable[[int, Attack, int, str], None],
        forget: Callable[[int], None],
        tell: Callable[[Event], None],
    ) -> None:
        """spheres: the volume of a body that throws are aimed at. at: numbers of those who may be
        thrown at. names: of all [K]. mind(k, attack, number, ball): character k sees a throw
        coming; forget(number): it is over. tell: the log.
        """
        self.settings, self.cast, self.body, self.spheres = settings, cast, body, spheres
        self.at, self.names, self.mind, self.forget, self.tell = at, names, mind, forget, tell
        self.fps = cast.library.clips.fps
        # What is thrown does not depend on how it is avoided: searches can be compared.
        self._thrower, self._by_seed = np.random.default_rng([seed, 1]), 0
        self._by_hand = np.random.default_rng([seed, 2])
        self._streams: bool | None = None  # None: as many throws as the settings say
        self.balls = Balls(settings, body, self.fps)
        self._number: dict[int, tuple[int, int]] = {}  # ball -> number of the throw, whom at
        self._minded: set[int] = set()  # throws that would have met somebody
        self._capsules = self._pose()

    @property
    def streams(self) -> bool:
        """Whether balls come by themselves."""
        return self._by_seed < self.settings.throws if self._streams is None else self._streams

    @streams.setter
    def streams(self, on: bool) -> None:
        self._streams = on

    def found(self, number: int) -> None:
        """Somebody has found a way out of a throw's way: if it meets nobody, it was avoided."""
        self._minded.add(number)

    def throw(
        self,
        frame: int,
        position: np.ndarray,
        goal: np.ndarray,
        speed: float,
        at: int,
        radius: float | None = None,
    ) -> None:
        """Throw a ball from a place [3] so that it comes by a goal [3]; speed [m/s] is the mean.

        at: who is to mind it. radius [m]: the settings' by default. Errors: a throw that makes no
        sense.
        """
        begin = np.asarray(position, dtype=float)
        velocity = velocity_to(begin, np.asarray(goal, float), speed, self.settings.gravity)
        self._throw(frame, begin, velocity, at, radius)

    def throw_one(
        self, frame: int, speed: float | None = None, radius: float | None = None
    ) -> None:
        """Throw a ball as those that come by themselves, at another speed [m/s] or of another
        radius [m]; they stay as they are."""
        s = self.settings
        s = s if speed is None else s.model_copy(update={"speed": (speed, speed)})
        self._throw_at_someone(frame, self._by_hand, s, radius)

    def due(self, frame: int) -> None:
        """Throw what is due, before anybody moves."""
        s, now = self.settings, frame / self.fps
        while now >= s.first + self._by_seed * s.every - 1e-9:
            if self.streams:
                self._throw_at_someone(frame, self._thrower, s)
            self._by_seed += 1

    def step(self, frame: int) -> None:
        """Everybody has moved on to a frame: the balls do, and meet whom they meet."""
        before, self._capsules = self._capsules, self._pose()
        cast = self.cast
        hits = self.balls.step(cast.root_position, np.stack([before, self._capsules]))
        for n, k, part, velocity in hits:
            number, at = self._number.pop(n)
            self.tell(
                Struck(
                    frame,
                    self.names[k],
                    attack=number,
                    ball=self.balls.objects[n].name,
                    part=self.body.parts[part],
                    meant=at == k,
                    speed=float(np.linalg.norm(velocity)),
                    place=place(self.balls.position[n]),
                )
            )
            self._minded.discard(number)
            self.forget(number)
            if not cast.held[k]:
                joint, where = int(self.body.joint[part]), self.balls.position[n]
                cast.strike(k, joint, where, RECOIL * velocity)
        for n in [n for n in self._number if self.balls.attack[n] is None]:
            self._over(frame, n)

    def _throw_at_someone(
        self,
        frame: int,
        rng: np.random.Generator,
        settings: BallsSettings,
        radius: float | None = None,
    ) -> None:
        cast, spheres = self.cast, self.spheres
        at = self.at[int(rng.integers(len(self.at)))]
        goal = spheres.at(cast.position[at], cast.world_wxyz[at])[rng.integers(len(spheres))]
        goal = goal + rng.normal(0.0, AIM_SPREAD, 3)
        self._throw(frame, *aimed(rng, settings, cast.facing[at], goal), at, radius)

    def _throw(
        self,
        frame: int,
        position: np.ndarray,
        velocity: np.ndarray,
        at: int,
        radius: float | None = None,
    ) -> None:
        n = self.balls.throw(position, velocity, frame / self.fps, radius)
        number = self.balls.thrown
        if n in self._number:
            self._over(frame, n)
        attack = self.balls.attack[n]
        assert attack is not None
        self._number[n] = (number, at)
        cast, spheres = self.cast, self.spheres
        body = spheres.at(cast.position[at], cast.world_wxyz[at])
        if attack.nearest(body, spheres.radius) < TRUE:
            self._minded.add(number)
        ball = self.balls.objects[n].name
        self.tell(
            Throw(
                frame,
                self.names[at],
                attack=number,
                ball=ball,
                speed=float(np.linalg.norm(velocity)),
                place=place(position),
            )
        )
        for k in self.at:
            if k == at or self._comes_near(attack, k):
                self.mind(k, attack, number, ball)

    def _comes_near(self, attack: Attack, k: int) -> bool:
        off = attack.centre[:, 0, [0, 2]] - self.cast.root_position[k, [0, 2]]
        return bool(np.any(np.hypot(off[:, 0], off[:, 1]) < NEAR))

    def _over(self, frame: int, n: int) -> None:
        """A ball has come down without having met anybody: avoided, if it would have met whom it
        was thrown at or somebody has found a way out, else only missed."""
        number, at = self._number.pop(n)
        how = Avoided if number in self._minded else Missed
        self.tell(how(frame, self.names[at], attack=number, ball=self.balls.objects[n].name))
        self._minded.discard(number)
        self.forget(number)

    def _pose(self) -> np.ndarray:
        return capsules_of(self.body, self.cast.position, self.cast.world_wxyz)
