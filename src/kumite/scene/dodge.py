"""A scene in which people avoid what is thrown at them (Oshita & Masaoka 2011)."""

from __future__ import annotations

import numpy as np

from kumite.body import lay_body
from kumite.control.attack import thrown
from kumite.control.avoidance import AvoidanceSearch, Outcome
from kumite.errors import KumiteError
from kumite.graph import Layer, Library
from kumite.scene.balls import Balls, aimed, capsules_of, velocity_to
from kumite.scene.controls import SearchControl, search_controls
from kumite.scene.dodgers import Dodgers, background, volume_of
from kumite.scene.doors import check_scene
from kumite.scene.events import Avoided, Event, Missed, Searched, Struck, Throw, place
from kumite.scene.memory import refuse_too_many
from kumite.scene.settings_dodge import BallsSettings, DodgeSettings
from kumite.scene.stage import SceneObject

AIM_SPREAD = 0.03  # m by which throws miss the middle of what they are aimed at
TRUE = 0.10  # m from a body as it stands: a ball that passes no farther off was aimed well
RECOIL = 0.01  # m that a struck segment gives way per m/s of the ball


class DodgeScene:
    """Dodgers under fire, one frame at a step. The same seed gives the same frames.

    Follows the :class:`~kumite.scene.stage.Stage` protocol, so the studio can show it.
    """

    def __init__(self, settings, library: Library | Layer, *, seed: int = 0) -> None:
        """Errors: nobody in it; a library without avoidance parts; too many characters."""
        library = check_scene(settings, library, seed, "avoidance")
        if not settings.dodging:
            raise KumiteError(f"{settings.title!r} has nobody who avoids; expected [[dodger]]s")
        self.settings, self.library, self.title = settings, library, settings.title
        self.fps, self.skeleton = library.clips.fps, library.clips.skeleton
        refuse_too_many(len(settings.dodging), len(self.skeleton))
        self.names = tuple(d.name for d in settings.dodging)
        self.dodge = settings.dodge or DodgeSettings()
        self.balls_settings = settings.balls or BallsSettings()
        volume = volume_of(self.dodge, library.clips.skeleton)
        self.search = AvoidanceSearch(library, self.dodge.search(), spheres=volume)
        _ = self.search.masks, self.search.index  # made now, not at the first throw
        self._streams: bool | None = None  # None: as many throws as the settings say
        self.body = lay_body(self.skeleton)
        self.reset(seed)
        background().submit(self._search_once).result()

    def _search_once(self) -> None:
        """What first searches would compile or load must not hold up a picture."""
        goal, yaw = self.root_position[0], self.cast.facing[0, 2]
        before = np.array([np.sin(yaw), 0.0, np.cos(yaw)])
        attack = thrown(goal + 4.0 * before, -8.0 * before, 0.1, gravity=0.0, seconds=1.0)
        standing, parts = self.dodgers.standing(0), self.search.graph.part_of
        for attacks in ([attack], [attack, attack]):  # arrays of other kinds
            self.search.search(standing, attacks, 0.0)
        edge = int(np.flatnonzero(np.diff(parts))[0])
        self.search.timed(standing, (edge,), int(parts[edge]), 1.0, 0.0)

    def reset(self, seed: int) -> None:
        """Start again from the beginning, with a seed."""
        self.seed = int(seed)
        self.frame = 0
        self.events: list[Event] = []
        homes = np.array([[*d.position, np.radians(d.yaw_deg)] for d in self.settings.dodging])
        rng = np.random.default_rng(self.seed)
        self.dodgers = Dodgers(
            self.search, self.names, homes, rng, self._tell, latency=self.dodge.latency
        )
        # What is thrown does not depend on how it is avoided: searches can be compared.
        self._thrower, self._by_seed = np.random.default_rng([self.seed, 1]), 0
        self._by_hand = np.random.default_rng([self.seed, 2])
        self.balls = Balls(self.balls_settings, self.body, self.fps)
        self._number: dict[int, tuple[int, int]] = {}  # ball -> number of the throw, whom at
        self._minded: set[int] = set()  # throws that would have met somebody
        self._capsules = self._pose()

    @property
    def cast(self):
        return self.dodgers.cast

    @property
    def root_position(self) -> np.ndarray:
        return self.cast.root_position

    @property
    def wxyz(self) -> np.ndarray:
        return self.cast.wxyz

    @property
    def objects(self) -> list[SceneObject]:
        return self.balls.objects

    def move_object(self, name: str, position: np.ndarray) -> None:
        """Balls are thrown, not carried."""

    @property
    def controls(self) -> list[SearchControl]:
        """What of the search may be tuned while it runs."""
        return search_controls(self)

    def tune(self, **rules: object) -> None:
        """Other rules for the next searches; those under way keep theirs. Errors: values that are
        not allowed, or rules that cannot change.
        """
        self.search = self.search.tuned(**rules)
        self.dodgers.search = self.search

    @property
    def streams(self) -> bool:
        """Whether balls come by themselves."""
        return (
            self._by_seed < self.balls_settings.throws if self._streams is None else self._streams
        )

    @streams.setter
    def streams(self, on: bool) -> None:
        self._streams = on

    def throw(
        self,
        position: np.ndarray,
        goal: np.ndarray,
        speed: float,
        at: int = 0,
        radius: float | None = None,
    ) -> None:
        """Throw a ball from a place [3] so that it comes by a goal [3]; speed [m/s] is the mean.

        at: the dodger who is to mind it. radius [m]: the settings' by default. Errors: a throw that
        makes no sense.
        """
        gravity = self.balls_settings.gravity
        velocity = velocity_to(np.asarray(position, float), np.asarray(goal, float), speed, gravity)
        self._throw(np.asarray(position, dtype=float), velocity, at, radius)

    def throw_one(self, speed: float | None = None, radius: float | None = None) -> None:
        """Throw a ball as those that come by themselves, at another speed [m/s] or of another
        radius [m]; they stay as they are.
        """
        s = self.balls_settings
        s = s if speed is None else s.model_copy(update={"speed": (speed, speed)})
        self._throw_at_someone(self._by_hand, s, radius)

    def _throw(
        self, position: np.ndarray, velocity: np.ndarray, at: int, radius: float | None = None
    ) -> None:
        n = self.balls.throw(position, velocity, self.frame / self.fps, radius)
        number = self.balls.thrown
        if n in self._number:
            self._over(n)
        attack = self.balls.attack[n]
        assert attack is not None
        self._number[n] = (number, at)
        cast, spheres = self.cast, self.search.spheres
        body = spheres.at(cast.position[at], cast.world_wxyz[at])
        if attack.nearest(body, spheres.radius) < TRUE:
            self._minded.add(number)
        ball = self.balls.objects[n].name
        self._tell(
            Throw(
                self.frame,
                self.names[at],
                attack=number,
                ball=ball,
                speed=float(np.linalg.norm(velocity)),
                place=place(position),
            )
        )
        for k in range(len(self.names)):
            if self.dodge.searches and (k == at or self._comes_near(attack, k)):
                self.dodgers.menace(k, attack, number, ball=ball)

    def _comes_near(self, attack, k: int) -> bool:
        off = attack.centre[:, 0, [0, 2]] - self.root_position[k, [0, 2]]
        return bool(np.any(np.hypot(off[:, 0], off[:, 1]) < 2.0))

    def step(self) -> bool:
        """One frame: throws that are due, searches and edges, balls and what they meet."""
        s, now = self.balls_settings, self.frame / self.fps
        while now >= s.first + self._by_seed * s.every - 1e-9:
            if self.streams:
                self._throw_at_someone(self._thrower, s)
            self._by_seed += 1
        self.dodgers.step(self.frame)
        before, self._capsules = self._capsules, self._pose()
        self.frame += 1
        hits = self.balls.step(self.root_position, np.stack([before, self._capsules]))
        for n, k, part, velocity in hits:
            number, at = self._number[n]
            joint, where = int(self.body.joint[part]), self.balls.position[n]
            self._tell(
                Struck(
                    self.frame,
                    self.names[k],
                    attack=number,
                    ball=self.balls.objects[n].name,
                    part=self.body.parts[part],
                    meant=at == k,
                    speed=float(np.linalg.norm(velocity)),
                    place=place(where),
                )
            )
            self.dodgers.forget(number)
            self.cast.strike(k, joint, where, RECOIL * velocity)
            del self._number[n]
        for n in [n for n in self._number if self.balls.attack[n] is None]:
            self._over(n)
        return True

    def _over(self, n: int) -> None:
        """A ball has come down without having met anybody: avoided, if it would have met whom it
        was thrown at or somebody has found a way out, else only missed."""
        number, at = self._number.pop(n)
        how = Avoided if number in self._minded else Missed
        ball = self.balls.objects[n].name
        self._tell(how(self.frame, self.names[at], attack=number, ball=ball))
        self._minded.discard(number)
        self.dodgers.forget(number)

    def _throw_at_someone(
        self, rng: np.random.Generator, settings: BallsSettings, radius: float | None = None
    ) -> None:
        cast = self.cast
        at = int(rng.integers(len(self.names)))
        spheres = self.search.spheres
        goal = spheres.at(cast.position[at], cast.world_wxyz[at])[rng.integers(len(spheres))]
        goal = goal + rng.normal(0.0, AIM_SPREAD, 3)
        self._throw(*aimed(rng, settings, cast.facing[at], goal), at, radius)

    def _pose(self) -> np.ndarray:
        return capsules_of(self.body, self.cast.position, self.cast.world_wxyz)

    def _tell(self, event: Event) -> None:
        if isinstance(event, Searched) and event.outcome == Outcome.FOUND:
            self._minded.add(event.attack)
        self.events.append(event)
