"""Numbers that may be changed while a scene runs: each counts from the next decision on.

A controller, and the world, offer theirs as a list of :class:`Tunable`; the studio makes a slider
of each, grouped by whose it is and which controller goes by it. Each is a setting of the scene file
as well: :attr:`Tunable.key` says which.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import isfinite, log
from typing import Literal

from kumite.errors import KumiteError, unknown

Scale = Literal["linear", "log"]
DECADES = 6.0  # below its maximum that a logarithmic scale goes before 0


@dataclass(frozen=True)
class Tunable:
    """A number that may be changed while a scene runs."""

    who: str  # the character whose it is; empty: all, or the world
    controller: str  # that goes by it: tree, policy, avoid, prepare; or world
    field: str  # what it is called in a scene file
    unit: str  # empty: none
    minimum: float
    maximum: float
    scale: Scale  # how a slider is laid out; log where the range spans decades
    help: str  # one line
    key: str  # where it stands in a scene file
    get: Callable[[], float]
    put: Callable[[float], None]
    whole: bool = False  # only whole numbers

    def __post_init__(self) -> None:
        low, high = self.minimum, self.maximum
        if not (isfinite(low) and isfinite(high) and low < high):
            raise KumiteError(f"tunable {self.name}: from {low:g} to {high:g}; expected a range")
        if self.scale == "log" and low < 0:
            raise KumiteError(f"tunable {self.name}: log from {low:g}; expected 0 or more")

    @property
    def label(self) -> str:
        """What it is called in a list of one controller's."""
        name = self.field.removesuffix("_deg").replace("_", " ")
        return f"{name} limit" if self.field.endswith("_deg") else name

    @property
    def name(self) -> str:
        """``red: tree: given short``; without who where it is everybody's."""
        return ": ".join(part for part in (self.who, self.controller, self.label) if part)

    @property
    def value(self) -> float:
        """As it is now."""
        return float(self.get())

    def set(self, value: float) -> None:
        """Go by another value from the next decision on. Errors: it is no number, or out of bounds;
        the scene cannot go by it, as things stand. Then all stays.
        """
        number = not isinstance(value, bool) and isinstance(value, int | float) and isfinite(value)
        if not (number and self.minimum <= value <= self.maximum):
            unit = f" {self.unit}" if self.unit else ""
            raise KumiteError(
                f"{self.name}: {value!r}; expected {self.minimum:g} to {self.maximum:g}{unit}"
            )
        self.put(round(value) if self.whole else float(value))

    # Where a slider is, 0 to 1 --------------------------------------------------------------------

    @property
    def _least(self) -> float:
        """The smallest value above 0 of a logarithmic scale."""
        return self.minimum or self.maximum / 10.0**DECADES

    def share(self, value: float) -> float:
        """How far along its slider [0 to 1] a value is."""
        if self.scale == "linear":
            return (value - self.minimum) / (self.maximum - self.minimum)
        if value < self._least:
            return 0.0
        return log(value / self._least) / log(self.maximum / self._least)

    def at(self, share: float) -> float:
        """The value at a share [0 to 1] of its slider: rounded to what can be read."""
        if share <= 0.0 or share >= 1.0:
            return self.minimum if share <= 0.0 else self.maximum
        if self.scale == "linear":
            value = self.minimum + share * (self.maximum - self.minimum)
            return float(round(value)) if self.whole else _rounded(value, 3)
        value = self._least * (self.maximum / self._least) ** share
        return _rounded(value, 2)


def _rounded(value: float, digits: int) -> float:
    return float(f"{value:.{digits}g}")


def find(tunables: Iterable[Tunable], name: str) -> Tunable:
    """One of tunables by name. Errors: there is none such; near names first."""
    every = {t.name: t for t in tunables}
    if name not in every:
        raise unknown("tunable", name, every)
    return every[name]
