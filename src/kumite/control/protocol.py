"""What decides for a character: controllers, in order of priority.

A character has a list of controllers. Each sees every frame (:meth:`Controller.watch`), and may ask
that the action that is played be broken off. Where an action ends they are asked in order, and the
first that has something to say is heard (:meth:`Controller.choose`). No controller knows of the
others.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from kumite.graph.spans import Spans
from kumite.synthesis import Cast

PASS = -1  # chosen by a controller that leaves it to the next
SELF = -2  # chosen by a controller that poses its character itself, until another breaks that off
NO_SPAN = -1  # where a character plays nothing that a controller chose


@dataclass(frozen=True)
class View:
    """What the controllers of one character may know in a frame. Arrays are read only."""

    me: int  # which character it is
    frame: int  # since the start
    fps: float
    names: tuple[str, ...]  # of all K characters
    opponent: np.ndarray  # [K] whom each minds
    cast: Cast  # who is where, and what each plays
    spans: Spans  # what may be chosen
    free: bool  # neither moved by physics nor in a reaction: it may break off what it does
    span: int  # that it plays, NO_SPAN after its place or what it does was given it otherwise …
    begun: int  # … and the frame in which it began it
    rng: np.random.Generator  # its own: what it draws changes nobody else's luck

    @property
    def seconds(self) -> float:
        """Since the start."""
        return self.frame / self.fps

    @property
    def place(self) -> np.ndarray:
        """Where all are on the floor [K, 2] m."""
        return self.cast.root_position[:, [0, 2]]


class Controller(Protocol):
    """Something that decides for a character.

    It may have an attribute ``watches``: False while it has nothing to see. A character none of
    whose controllers watches costs nothing until its action ends.
    """

    name: str

    def start(self) -> None:
        """A scene begins, or begins again."""
        ...

    def watch(self, view: View) -> int | None:
        """See a frame, before anybody moves. The library frame, ahead in what is played, at which
        it is to be broken off, for this controller to choose; None: it may go on. At its end: this
        controller chooses there, and until then how fast it is played."""
        ...

    def choose(self, view: View) -> int:
        """The span of :attr:`View.spans` to begin where an action has ended, or PASS."""
        ...

    def rate(self, view: View) -> float:
        """Library frames for each shown frame while what it chose is played, or until it is broken
        off for it."""
        ...

    def interrupted(self, view: View) -> None:
        """What it chose has been cut short: the character was struck."""
        ...


class Plain:
    """A base for controllers of one's own: it leaves everything to the next, breaks nothing off and
    plays at the captured speed."""

    name = "plain"
    watches = False  # whether it wants to see every frame; set by what a class overrides

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if "watches" not in cls.__dict__:
            cls.watches = cls.watch is not Plain.watch or cls.rate is not Plain.rate

    def start(self) -> None:
        """A scene begins, or begins again."""

    def watch(self, view: View) -> int | None:
        """See :meth:`Controller.watch`."""
        return None

    def choose(self, view: View) -> int:
        """See :meth:`Controller.choose`."""
        return PASS

    def rate(self, view: View) -> float:
        """See :meth:`Controller.rate`."""
        return 1.0

    def interrupted(self, view: View) -> None:
        """See :meth:`Controller.interrupted`."""


class External(Plain):
    """Leaves its character to whoever runs the world: see ``World.step(choices)``. Without a choice
    it stands where its action has ended."""

    name = "external"


class Called(Plain):
    """A function as a controller: it is called with a view and returns a span or PASS."""

    def __init__(self, function: Callable[[View], int]) -> None:
        self._function = function
        self.name = getattr(function, "__name__", type(function).__name__)

    def choose(self, view: View) -> int:
        return self._function(view)
