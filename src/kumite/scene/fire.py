"""What is thrown in a world, by the seed and by hand, and those of its characters who avoid it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from kumite.control.attack import Attack, thrown
from kumite.control.avoidance import Avoidance, AvoidanceSearch, Outcome
from kumite.control.avoider import Avoider, Threat, standing
from kumite.control.tuning import Tunable
from kumite.scene.avoiding import searched
from kumite.scene.balls import Balls
from kumite.scene.controls import reaction_tunables, search_tunables
from kumite.scene.events import Event
from kumite.scene.floor import Floor
from kumite.scene.settings_dodge import BallsSettings
from kumite.scene.throwing import Throwing
from kumite.scene.volumes import Volumes


class Fire:
    """The balls of a world, and its avoiders. Follows :class:`~kumite.scene.stage.Throwable`."""

    def __init__(
        self,
        names: Sequence[str],
        reactions: Mapping[int, float],
        search: AvoidanceSearch,
        settings: BallsSettings,
        *,
        away: np.ndarray | None = None,
        searches: bool = True,
    ) -> None:
        """names [K]: of all. reactions: of those who avoid, by number, s until each knows of a
        throw. search: what they search with. away: as :class:`Avoider` takes it. searches: False:
        nobody looks out."""
        self.names, self.search, self.settings, self.searches = names, search, settings, searches
        self.who = sorted(reactions)
        self.avoiders = {
            k: Avoider(
                search,
                lambda found, threat, k=k: self._tell_search(k, found, threat),
                reaction=reactions[k],
                away=away,
            )
            for k in self.who
        }
        self._streams: bool | None = None  # None: as many throws as the settings say

    def begin(self, floor: Floor, seed: int, tell: Callable[[Event], None]) -> None:
        """A world begins, or begins again: all stand on its floor."""
        self._floor, self._tell, self.frame = floor, tell, 0
        self.throwing = Throwing(
            self.settings,
            floor.cast,
            floor.body,
            self.search.spheres,
            seed,
            self.who,
            self.names,
            self._mind,
            self._forget,
            tell,
        )
        if self._streams is not None:
            self.throwing.streams = self._streams

    def search_once(self) -> None:
        """What first searches would compile or load must not hold up a picture."""
        k, cast = self.who[0], self._floor.cast
        goal, yaw = cast.root_position[k], cast.facing[k, 2]
        before = np.array([np.sin(yaw), 0.0, np.cos(yaw)])
        attack = thrown(goal + 4.0 * before, -8.0 * before, 0.1, gravity=0.0, seconds=1.0)
        frame = int(self.search.library.table.state_frame[0])
        here, parts = standing(cast, k, frame), self.search.graph.part_of
        for attacks in ([attack], [attack, attack]):  # arrays of other kinds
            self.search.search(here, attacks, 0.0)
        edge = int(np.flatnonzero(np.diff(parts))[0])
        self.search.timed(here, (edge,), int(parts[edge]), 1.0, 0.0)

    # A frame -------------------------------------------------------------------------------------

    def due(self, frame: int) -> None:
        """Throw what is due, before anybody moves."""
        self.frame = frame
        self.throwing.due(frame)

    def step(self, frame: int) -> None:
        """Everybody has moved on to a frame: the balls do, and meet whom they meet."""
        self.frame = frame
        self.throwing.step(frame)

    def _mind(self, k: int, attack: Attack, number: int, ball: str) -> None:
        if self.searches:
            now = self.frame / self.throwing.fps
            self.avoiders[k].mind(attack, number, now, ball=ball)

    def _forget(self, number: int) -> None:
        for avoider in self.avoiders.values():
            avoider.forget(number)

    def _tell_search(self, k: int, found: Avoidance, threat: Threat) -> None:
        if found.outcome == Outcome.FOUND:
            self.throwing.found(threat.number)
        self._tell(searched(self.frame, self.names[k], found, threat))

    # By hand -------------------------------------------------------------------------------------

    @property
    def balls(self) -> Balls:
        """What is thrown."""
        return self.throwing.balls

    @property
    def thrown_at(self) -> tuple[int, ...]:
        """Whom balls are thrown at: those who avoid."""
        return tuple(self.who)

    @property
    def ball_radius(self) -> float:
        """Of those that come by themselves [m]."""
        return float(self.settings.radius)

    @property
    def streams(self) -> bool:
        """Whether balls come by themselves; what is switched stays when a world begins again."""
        return self.throwing.streams

    @streams.setter
    def streams(self, on: bool) -> None:
        self._streams = on
        self.throwing.streams = on

    def bodies(self) -> tuple[np.ndarray, np.ndarray]:
        """Of whom they are thrown at, as spheres: centres [n, B, 3] and radii [B], m."""
        cast, spheres = self._floor.cast, self.search.spheres
        return spheres.at(cast.position[self.who], cast.world_wxyz[self.who]), spheres.radius

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

    def tune(self, **rules: object) -> None:
        """Other rules for the next searches; those under way keep theirs. Errors: values that are
        not allowed, or rules that cannot change.
        """
        self.search = self.search.tuned(**rules)
        for avoider in self.avoiders.values():
            avoider.search = self.search

    @property
    def tunables(self) -> list[Tunable]:
        """What may be tuned while it runs."""
        names = [self.names[k] for k in self.who]
        reactions = reaction_tunables(names, [self.avoiders[k] for k in self.who])
        return [*reactions, *search_tunables(lambda: self.search, self.tune)]

    @property
    def volumes(self) -> Volumes:
        """What avoiders reckon with, to be looked at."""
        return Volumes(self.avoiders, lambda: self._floor.cast)
