"""A scene in which people avoid what is thrown at them (Oshita & Masaoka 2011)."""

from __future__ import annotations

import numpy as np

from kumite.body import lay_body
from kumite.control.attack import Attack, thrown
from kumite.control.avoidance import AvoidanceSearch, Outcome
from kumite.control.avoider import standing
from kumite.control.protocol import Controller
from kumite.control.tuning import Tunable, find
from kumite.errors import KumiteError
from kumite.graph import Layer, Library
from kumite.scene.avoiding import Avoiders, search_of
from kumite.scene.balls import Balls
from kumite.scene.controls import reaction_tunables, search_tunables
from kumite.scene.doors import check_scene
from kumite.scene.events import Event, Searched
from kumite.scene.memory import refuse_too_many
from kumite.scene.settings_dodge import BallsSettings, DodgeSettings
from kumite.scene.stage import Offers, SceneObject
from kumite.scene.throwing import ByHand, Throwing
from kumite.scene.volumes import Volumes
from kumite.synthesis import Cast


class DodgeScene:
    """People under fire, one frame at a step. The same seed gives the same frames.

    ``controllers`` [K] are those of each character, in order (:mod:`kumite.control.protocol`).

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
        search = search_of(library, self.dodge)
        self.side = Avoiders(search, settings.dodging, self._tell)
        self._streams: bool | None = None  # None: as many throws as the settings say
        self.body = lay_body(self.skeleton)
        self.reset(seed)
        self._search_once()

    def _search_once(self) -> None:
        """What first searches would compile or load must not hold up a picture."""
        goal, yaw = self.root_position[0], self.cast.facing[0, 2]
        before = np.array([np.sin(yaw), 0.0, np.cos(yaw)])
        attack = thrown(goal + 4.0 * before, -8.0 * before, 0.1, gravity=0.0, seconds=1.0)
        cast, parts = self.cast, self.search.graph.part_of
        here = standing(cast, 0, int(cast.stop[0]), self.side.conductor.span[0])
        for attacks in ([attack], [attack, attack]):  # arrays of other kinds
            self.search.search(here, attacks, 0.0)
        edge = int(np.flatnonzero(np.diff(parts))[0])
        self.search.timed(here, (edge,), int(parts[edge]), 1.0, 0.0)

    def reset(self, seed: int) -> None:
        """Start again from the beginning, with a seed."""
        self.seed = int(seed)
        self.frame = 0
        self.events: list[Event] = []
        self.side.start(self.seed)
        self.throwing = Throwing(
            self.balls_settings,
            self.cast,
            self.body,
            self.search.spheres,
            self.seed,
            list(range(len(self.names))),
            self.names,
            self._mind,
            self.side.forget,
            self._tell,
        )
        if self._streams is not None:
            self.throwing.streams = self._streams

    @property
    def cast(self) -> Cast:
        return self.side.cast

    @property
    def search(self) -> AvoidanceSearch:
        """What all who avoid search with."""
        return self.side.search

    @property
    def controllers(self) -> list[list[Controller]]:
        return self.side.controllers

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
    def tunables(self) -> list[Tunable]:
        """What may be tuned while it runs; searches under way keep their rules."""
        side = self.side
        return [
            *reaction_tunables(self.names, side.avoiders),
            *search_tunables(lambda: side.search, self.tune),
        ]

    def tunable(self, name: str) -> Tunable:
        """One of them by name. Errors: there is none such."""
        return find(self.tunables, name)

    @property
    def offers(self) -> Offers:
        """What may be done with it while it runs."""
        return Offers(
            throwing=_ByHand(self),
            avoiding=Volumes(dict(enumerate(self.side.avoiders)), lambda: self.cast),
            tunables=tuple(self.tunables),
            counts=("balls",),
            seen="before",
            yaw=float(self.cast.facing[0, 2]),
        )

    def tune(self, **rules: object) -> None:
        """Other rules for the next searches; those under way keep theirs. Errors: values that are
        not allowed, or rules that cannot change.
        """
        self.side.tune(**rules)

    @property
    def balls(self) -> Balls:
        """What is thrown."""
        return self.throwing.balls

    @property
    def streams(self) -> bool:
        """Whether balls come by themselves."""
        return self.throwing.streams

    @streams.setter
    def streams(self, on: bool) -> None:
        self._streams = on
        self.throwing.streams = on

    def throw(
        self,
        position: np.ndarray,
        goal: np.ndarray,
        speed: float,
        at: int = 0,
        radius: float | None = None,
    ) -> None:
        """Throw a ball (:meth:`Throwing.throw`). at: who is to mind it."""
        self.throwing.throw(self.frame, position, goal, speed, at, radius)

    def throw_one(self, speed: float | None = None, radius: float | None = None) -> None:
        """Throw a ball as those that come by themselves (:meth:`Throwing.throw_one`)."""
        self.throwing.throw_one(self.frame, speed, radius)

    def step(self) -> bool:
        """One frame: throws that are due, controllers decide, all move, balls and what they
        meet."""
        self.throwing.due(self.frame)
        self.side.conductor.step(self.frame)
        self.cast.advance()
        self.frame += 1
        self.throwing.step(self.frame)
        return True

    def _mind(self, k: int, attack: Attack, number: int, ball: str) -> None:
        if self.dodge.searches:
            self.side.avoiders[k].mind(attack, number, self.frame / self.fps, ball=ball)

    def _tell(self, event: Event) -> None:
        if isinstance(event, Searched) and event.outcome == Outcome.FOUND:
            self.throwing.found(event.attack)
        self.events.append(event)


class _ByHand(ByHand):
    """A stream that is switched stays so when the scene begins again."""

    def __init__(self, scene: DodgeScene) -> None:
        super().__init__(lambda: scene.throwing, lambda: scene.frame)
        self._scene = scene

    @property
    def streams(self) -> bool:
        return self._scene.streams

    @streams.setter
    def streams(self, on: bool) -> None:
        self._scene.streams = on
