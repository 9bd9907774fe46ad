"""The loop in which controllers decide for the characters of a scene, frame by frame.

Whoever watches sees the frame, and may break off what its character does. Where an action has
ended, the character's controllers are asked in order, and the first that has something to say is
heard. What is chosen is played at the rate that its controller asks for.

A character's list may hold functions of a :class:`~kumite.control.protocol.View`, too: each becomes
a controller when it is first asked.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from kumite.control.protocol import NO_SPAN, PASS, SELF, Called, Controller, External, View
from kumite.errors import KumiteError, unknown
from kumite.graph import Layer
from kumite.graph.spans import Spans
from kumite.synthesis import Cast
from kumite.synthesis.rates import FASTEST, SLOWEST

MOST_AT_ONCE = 8  # spans that one may begin in one frame
DRAWS = 7  # names the streams of random numbers of controllers among all of a seed


class ControllerError(KumiteError):
    """A controller has failed: which, whose and when. The scene goes no further."""

    recording: Any = None
    """What ran until then, where :func:`kumite.scene.record` ran it."""


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
        begin_many: Callable[[np.ndarray, np.ndarray, Controller], None] | None = None,
    ) -> None:
        """spans: what may be chosen. names [K]; opponent [K]: whom each minds.

        begin(k, span, controller): character k is to begin a span now, which the controller chose.
        free(k): whether it may break off what it does. chooses(k): whether it chooses anything at
        the end of an action; else it stays there. begin_many(who, spans, controller): the same as
        ``begin`` of characters who [W], spans [K]; None: controllers are asked for each by itself.
        """
        self.cast, self.spans, self.names = cast, spans, tuple(names)
        self.opponent, self.controllers = opponent, controllers
        self.fps = cast.library.clips.fps
        self.frame = 0  # of the scene, now
        self._begin, self._free, self._chooses = begin, free, chooses
        self._begin_many = begin_many

    def start(self, seed: int = 0, spans: Sequence[int] | None = None) -> None:
        """A scene begins, or begins again, with a seed: everybody has been placed.

        spans [K]: at whose ends; None: of none.
        """
        count = len(self.names)
        self.frame = 0
        self.charge = [0] * count
        self.span = np.full(count, NO_SPAN)  # that each plays …
        if spans is not None:
            self.span[:] = spans
        self.begun = np.zeros(count, dtype=np.int64)  # … and the frame in which it was begun
        self._seed = seed
        self._rng: dict[int, np.random.Generator] = {}  # of those who have looked
        for controllers in self.controllers:
            for controller in controllers:
                if not callable(controller):
                    controller.start()

    @property
    def waiting(self) -> tuple[str, ...]:
        """Who chooses in the next step: their actions have ended."""
        return tuple(self.names[k] for k in self.cast.waiting.tolist() if self._chooses(k))

    def options(self, name: str, layers: Mapping[str, Layer]) -> np.ndarray:
        """The spans [N] that graphs let a character who waits begin, of every layer in a state of
        which it is. Errors: nobody is called so; it does not wait."""
        k, found = self._number(name), []
        if name not in (waiting := self.waiting):
            raise KumiteError(
                f"{name} is in an action; expected one of those who wait: "
                f"{', '.join(waiting) or 'nobody'}"
            )
        frame = int(self.cast.reached[k])
        for layer, first in zip(self.spans.layers, self.spans.begins[:-1].tolist()):
            table = layers[layer].table
            state = int(np.searchsorted(table.state_frame, frame))
            if state < len(table.state_frame) and table.state_frame[state] == frame:
                at = slice(table.action_start[state], table.action_start[state + 1])
                found.append(first + table.stretch[at].astype(np.int64))
        return np.concatenate(found) if found else np.zeros(0, dtype=np.int64)

    def view(self, k: int) -> View:
        """What the controllers of character k may know now."""
        if k not in self._rng:
            self._rng[k] = np.random.default_rng([self._seed, k, DRAWS])
        return View(
            k, self.frame, self.fps, self.names, self.opponent, self.cast, self.spans,
            self._free(k), int(self.span[k]), int(self.begun[k]), self._rng[k],
        )  # fmt: skip

    def step(self, frame: int, choices: Mapping[str, int] | None = None) -> None:
        """Controllers see a frame of the scene and choose where an action ends, before anybody
        moves.

        choices: spans by name, of some who wait; they come before those of all controllers.

        Errors: a controller fails, or chooses what there is not; nobody chooses anything for a
        character; a choice for somebody who does not wait.
        """
        self.frame, cast = frame, self.cast
        given = self._given(choices) if choices else {}
        for k, controllers in enumerate(self.controllers):
            for controller in controllers:
                if getattr(controller, "watches", True):
                    self._watch(k, controllers)
                    break
        for _ in range(MOST_AT_ONCE):  # again where a span is shorter than a quick frame
            waiting = cast.waiting
            if len(waiting) == 0 or not self._choose(waiting, given):
                break
            given = {}
        for k in cast.waiting.tolist():
            cast.wait(k)

    def _choose(self, waiting: np.ndarray, given: Mapping[int, int]) -> bool:
        """Those whose actions have ended begin what is chosen for them; whether any does."""
        together: dict[int, list[int]] = {}  # by the one controller that they share
        begun = False
        for k in waiting.tolist():
            if not self._chooses(k):
                continue
            controllers = self.controllers[k]
            alone = controllers[0] if len(controllers) == 1 and k not in given else None
            if self._begin_many is not None and hasattr(alone, "choose_many"):
                together.setdefault(id(alone), []).append(k)
                continue
            n, span = (0, given[k]) if k in given else self._chosen(k)
            if span == PASS:
                continue
            begun = True
            self.charge[k] = n
            self._begin(k, span, _GIVEN if k in given else controllers[n])
            self.span[k], self.begun[k] = NO_SPAN if span == SELF else span, self.frame
            if controllers:
                self._set_rate(k, self.view(k))
        for many in together.values():
            assert self._begin_many is not None
            controller, who = self.controllers[many[0]][0], np.array(many)
            spans = controller.choose_many(who)  # pyright: ignore[reportAttributeAccessIssue]
            self._begin_many(who, spans, controller)
            self.span[who], self.begun[who] = spans[who], self.frame
            begun = True
        return begun

    def _given(self, choices: Mapping[str, int]) -> dict[int, int]:
        """Choices from without, checked."""
        waiting, out = self.waiting, {}
        for name, span in choices.items():
            k = self._number(name)
            if name not in waiting:
                raise KumiteError(
                    f"a choice for {name}, who is in an action; expected one of those who wait: "
                    f"{', '.join(waiting) or 'nobody'}"
                )
            try:
                out[k] = self._checked(k, span, _GIVEN)
            except ControllerError as error:  # whoever chose it may choose again
                raise KumiteError(str(error)) from None
        return out

    def _number(self, name: str) -> int:
        if name not in self.names:
            raise unknown("character", name, self.names)
        return self.names.index(name)

    def interrupt(self, k: int) -> None:
        """What character k did has been cut short; the last of its controllers goes on."""
        view = self.view(k)
        for n in range(len(self.controllers[k])):
            self._ask(k, n, "interrupted", view)
        self.charge[k] = max(len(self.controllers[k]) - 1, 0)
        self.span[k], self.begun[k] = NO_SPAN, self.frame
        self._set_rate(k, view)

    def _watch(self, k: int, controllers: Sequence[Controller]) -> None:
        view = self.view(k)
        for n in range(len(controllers)):
            leave = self._ask(k, n, "watch", view)
            # Whoever comes after the one that is heard now has to wait for the action's end.
            if leave is not None and n <= self.charge[k]:
                self.cast.stop[k], self.charge[k] = leave, n
                break
        self._set_rate(k, view)

    def _set_rate(self, k: int, view: View) -> None:
        n = min(self.charge[k], len(self.controllers[k]) - 1)  # the list may have become shorter
        rate = self._ask(k, n, "rate", view) if n >= 0 else 1.0
        self.cast.set_rate(k, min(max(rate, SLOWEST), FASTEST))

    def _chosen(self, k: int) -> tuple[int, int]:
        """Which controller of character k is heard, and the span it chooses; PASS where somebody
        outside is to say it."""
        view, controllers = self.view(k), self.controllers[k]
        for n in range(len(controllers)):
            span = self._ask(k, n, "choose", view)
            if not (isinstance(span, int | np.integer) and span == PASS):
                return n, self._checked(k, span, controllers[n])
        if not controllers or isinstance(controllers[-1], External):
            return 0, PASS
        raise ControllerError(
            f"frame {self.frame}: no controller of {self.names[k]} "
            f"({', '.join(c.name for c in controllers)}) has chosen an action; expected one"
        )

    def _ask(self, k: int, n: int, what: str, view: View) -> Any:
        """Call a controller of a character. Errors: it fails."""
        controller = self.controllers[k][n]
        if callable(controller):
            self.controllers[k][n] = controller = Called(controller)
        try:
            return getattr(controller, what)(view)
        except Exception as error:
            said = str(error) or type(error).__name__
            name = getattr(controller, "name", type(controller).__name__)
            raise ControllerError(
                f"frame {self.frame}: controller {name!r} of {self.names[k]} failed in {what}: "
                f"{said}"
            ) from error

    def _checked(self, k: int, span: Any, controller: Controller) -> int:
        """A span that was chosen. Errors: there is none such, or it is of another layer than the
        controller's."""
        if isinstance(span, int) and span == SELF and getattr(controller, "poses", False):
            return SELF
        count = len(self.spans.first)
        told = f"frame {self.frame}: {controller.name!r} of {self.names[k]}"
        whole = isinstance(span, int | np.integer) and not isinstance(span, bool)
        if not whole or not 0 <= int(span) < count:
            raise ControllerError(
                f"{told} chose span {span!r}; expected PASS or a number from 0 to {count - 1}"
            )
        layer = getattr(controller, "layer", None)
        found, _ = self.spans.stretch(int(span))
        if layer in self.spans.layers and found != layer:
            raise ControllerError(
                f"{told} chose span {span} of layer {found!r}; expected one of its own, {layer!r}"
            )
        return int(span)


_GIVEN = External()
"""Stands for whoever gives choices to :meth:`Conductor.step`."""
