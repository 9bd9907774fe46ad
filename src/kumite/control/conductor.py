"""The loop in which controllers decide for the characters of a scene, frame by frame.

Whoever watches sees the frame, and may break off what its character does. Where an action has
ended, the character's controllers are asked in order, and the first that has something to say is
heard. What is chosen is played at the rate that its controller asks for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from kumite.control.protocol import PASS, Controller, View
from kumite.errors import KumiteError
from kumite.graph.spans import Spans
from kumite.synthesis import Cast
from kumite.synthesis.rates import FASTEST, SLOWEST

MOST_AT_ONCE = 8  # spans that one may begin in one frame


class Conductor:
    """Lets the controllers of K characters decide.

    ``controllers`` [K] may be changed between two frames; :attr:`charge` [K] is the number of the
    one that chose what its character does.
    """

    def __init__(
        self,
        cast: Cast,
        spans: Spans,
        names: Sequence[str],
        opponent: np.ndarray,
        controllers: list[list[Controller]],
        *,
        begin: Callable[[int, int, Controller], None],
        free: Callable[[int], bool],
        chooses: Callable[[int], bool] = lambda k: True,
    ) -> None:
        """spans: what may be chosen. names [K]; opponent [K]: whom each minds.

        begin(k, span, controller): character k is to begin a span now, which the controller chose.
        free(k): whether it may break off what it does. chooses(k): whether it chooses anything at
        the end of an action; else it stays there.
        """
        self.cast, self.spans, self.names = cast, spans, tuple(names)
        self.opponent, self.controllers = opponent, controllers
        self.fps = cast.library.clips.fps
        self.frame = 0  # of the scene, now
        self.charge = [0] * len(self.names)
        self._begin, self._free, self._chooses = begin, free, chooses

    def start(self) -> None:
        """A scene begins, or begins again: everybody has been placed."""
        self.frame = 0
        self.charge = [0] * len(self.names)
        for controllers in self.controllers:
            for controller in controllers:
                controller.start()

    def view(self, k: int) -> View:
        """What the controllers of character k may know now."""
        return View(
            k, self.frame, self.fps, self.names, self.opponent, self.cast, self.spans, self._free(k)
        )

    def step(self, frame: int) -> None:
        """Controllers see a frame of the scene and choose where an action ends, before anybody
        moves. Errors: nobody chooses anything for a character.
        """
        self.frame, cast = frame, self.cast
        for k, controllers in enumerate(self.controllers):
            if any(getattr(c, "watches", True) for c in controllers):
                self._watch(k, controllers)
        for _ in range(MOST_AT_ONCE):  # again where a span is shorter than a quick frame
            waiting = [k for k in cast.waiting.tolist() if self._chooses(k)]
            if not waiting:
                break
            for k in waiting:
                n, span = self._chosen(k)
                self.charge[k] = n
                self._begin(k, span, self.controllers[k][n])
                self._set_rate(k, self.view(k))
        for k in cast.waiting.tolist():
            cast.wait(k)

    def interrupt(self, k: int) -> None:
        """What character k did has been cut short; the last of its controllers goes on."""
        view = self.view(k)
        for controller in self.controllers[k]:
            controller.interrupted(view)
        self.charge[k] = len(self.controllers[k]) - 1
        self._set_rate(k, view)

    def _watch(self, k: int, controllers: Sequence[Controller]) -> None:
        view = self.view(k)
        for n, controller in enumerate(controllers):
            leave = controller.watch(view)
            # Whoever comes after the one that is heard now has to wait for the action's end.
            if leave is not None and n <= self.charge[k]:
                self.cast.stop[k], self.charge[k] = leave, n
                break
        self._set_rate(k, view)

    def _set_rate(self, k: int, view: View) -> None:
        rate = self.controllers[k][self.charge[k]].rate(view)
        self.cast.set_rate(k, min(max(rate, SLOWEST), FASTEST))

    def _chosen(self, k: int) -> tuple[int, int]:
        """Which controller of character k is heard, and the span it chooses."""
        view = self.view(k)
        for n, controller in enumerate(self.controllers[k]):
            span = controller.choose(view)
            if span != PASS:
                return n, int(span)
        raise KumiteError(f"{self.names[k]}: no controller has chosen an action; expected one")
