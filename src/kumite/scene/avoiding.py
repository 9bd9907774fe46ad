"""Those of a scene who avoid: how they search, their cast, and what is told of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from kumite.body import Spheres, load_spheres
from kumite.clip import Skeleton
from kumite.control.avoidance import Avoidance, AvoidanceSearch, Outcome
from kumite.control.avoider import Avoider, Threat
from kumite.control.conductor import Conductor
from kumite.control.protocol import Controller
from kumite.control.roamer import Roamer
from kumite.graph import Layer, Library
from kumite.graph.spans import Spans
from kumite.kernels.blow import NOBODY
from kumite.scene.events import Decision, Event, Searched
from kumite.scene.settings_dodge import DodgerSettings, DodgeSettings
from kumite.scene.starts import draw_starts, stream
from kumite.synthesis import Cast


def volume_of(dodge: DodgeSettings, skeleton: Skeleton) -> Spheres | None:
    """The body's volume, if a file says what it is. Errors: of the file."""
    return None if dodge.spheres is None else load_spheres(dodge.spheres, skeleton)


def search_of(layer: Layer, dodge: DodgeSettings) -> AvoidanceSearch:
    """What the avoiders of a scene search with, all made now, not at the first attack."""
    volume = volume_of(dodge, layer.clips.skeleton)
    search = AvoidanceSearch(layer, dodge.search(), spheres=volume)
    _ = search.masks, search.index
    return search


class Avoiders:
    """K characters who avoid, as a cast of their own library: each has ``controllers``."""

    def __init__(
        self,
        search: AvoidanceSearch,
        who: Sequence[DodgerSettings],
        tell: Callable[[Event], None],
        *,
        watched: Callable[[int], np.ndarray | None] = lambda k: None,
        distance: float | None = None,
    ) -> None:
        """tell: the log. watched, distance: as :class:`Roamer` takes them."""
        self.search, self.library, self.tell = search, search.library, tell
        self.names = tuple(w.name for w in who)
        self.avoiders = [
            Avoider(
                search, lambda found, threat, k=k: self._tell_search(k, found, threat),
                reaction=w.reaction,
            )
            for k, w in enumerate(who)
        ]  # fmt: skip
        homes = np.array([[*w.position, np.radians(w.yaw_deg)] for w in who])
        self.roamer = Roamer(self.library, homes, watched=watched, distance=distance)
        self.controllers: list[list[Controller]] = [[a, self.roamer] for a in self.avoiders]
        self.spans = Spans.of(Library.of(self.library), (self.library.name,))

    def start(self, seed: int) -> None:
        """Begin, or begin again, with a seed."""
        self.cast = cast = Cast(self.library, len(self.names))
        streams = [stream(seed, k) for k in range(len(self.names))]
        begun, frame = draw_starts(self.library, self.roamer.restful(), streams)
        states = self.library.table.target[begun].tolist()
        for k, home in enumerate(self.roamer.homes):
            cast.place(k, states[k], home, frame=int(frame[k]))
        cast.show(0.0)
        self.conductor = Conductor(
            cast,
            self.spans,
            self.names,
            np.full(len(self.names), NOBODY),
            self.controllers,
            begin=self._begin,
            free=lambda k: True,
        )
        self.conductor.start(seed, begun.tolist())

    def tune(self, **rules: object) -> None:
        """Other rules for the next searches. Errors: values that are not allowed, or rules that
        cannot change.
        """
        self.search = self.search.tuned(**rules)
        for avoider in self.avoiders:
            avoider.search = self.search

    def forget(self, number: int) -> None:
        """An attack is over for everyone."""
        for avoider in self.avoiders:
            avoider.forget(number)

    def _begin(self, k: int, span: int, controller: Controller) -> None:
        """Character k begins a span that one of its controllers has chosen."""
        self.cast.begin(np.array([k]), np.full(self.cast.count, span))
        _, stretch = self.spans.stretch(span)
        jump = bool(self.cast.jump[k])
        self.tell(
            Decision(
                self.conductor.frame, self.names[k], by=controller.name, stretch=stretch, jump=jump
            )
        )

    def _tell_search(self, k: int, found: Avoidance, threat: Threat) -> None:
        self.tell(searched(self.conductor.frame, self.names[k], found, threat))


def searched(frame: int, name: str, found: Avoidance, threat: Threat) -> Searched:
    """What the log says of a search by ``name`` for a way out."""
    names = ("valid", "hit", "culled", "stiff", "too_fast", "too_long")
    said: dict[str, Any] = dict(zip(names, found.counts))
    if found.counts:
        said["candidates"] = found.candidates
    if np.isfinite(found.aim):
        said["aim"] = found.aim
    if found.outcome == Outcome.FOUND:
        best = ("path", "part", "indexed", "scale", "cost", "costs", "distance", "before")
        said |= {field: getattr(found, field) for field in best}
    return Searched(
        frame,
        name,
        attack=threat.number,
        ball=threat.ball,
        attacker=threat.attacker,
        outcome=found.outcome,
        **said,
    )
