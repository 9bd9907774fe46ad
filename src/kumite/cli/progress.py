"""How far a command is: bars on a terminal, lines at intervals elsewhere, nothing if --quiet."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import log10
from time import monotonic
from typing import Protocol

from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
)
from rich.text import Text

from kumite.cli.app import err, settings

INTERVALS = (5.0, 10.0, 20.0, 30.0)  # s between lines of one stage; the last goes on
FINEST = 1e-4  # residual at which a policy counts as trained


class Bars(Protocol):
    """What progress is told to."""

    def add(self, stage: str, total: float | None = None) -> int:
        """Begin a stage; its number. total: None where nobody knows how long it takes."""
        ...

    def update(
        self, number: int, completed: float | None = None, *, stage: str = "", note: str = ""
    ) -> None:
        """How far a stage has come, of its total; or another name for it."""
        ...


@contextmanager
def progress() -> Iterator[Bars]:
    """Bars on stderr, gone when done; lines where stderr is no terminal."""
    if settings.quiet:
        yield _Nothing()
    elif not err.is_terminal:
        yield Lines()
    else:
        columns = (
            SpinnerColumn(),
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TextColumn("{task.fields[note]}", markup=False),
            TimeElapsedColumn(),
            _Left(),
        )
        with Progress(*columns, console=err, transient=True) as bars:
            yield _Rich(bars)


def say(line: str) -> None:
    """A line of progress on stderr."""
    if not settings.quiet:
        err.print(line, markup=False, highlight=False)


class _Left(ProgressColumn):
    """The time that is left, where it is known."""

    def render(self, task: Task) -> Text:
        left = None if task.total is None or task.finished else task.time_remaining
        return Text("" if left is None else f"{clock(left)} left", style="progress.remaining")


class _Rich:
    def __init__(self, bars: Progress) -> None:
        self._bars = bars

    def add(self, stage: str, total: float | None = None) -> int:
        return self._bars.add_task(stage, total=total, note="")

    def update(
        self, number: int, completed: float | None = None, *, stage: str = "", note: str = ""
    ) -> None:
        more = {"description": stage} if stage else {}
        self._bars.update(number, completed=completed, note=note, **more)  # pyright: ignore[reportArgumentType]


@dataclass
class _Stage:
    name: str
    total: float | None
    begun: float  # s
    told: float  # s, when it was last spoken of
    lines: int = 0


class Lines:
    """A line when a stage begins; while it lasts, how far it is and how long it will take."""

    def __init__(self) -> None:
        self._stages: list[_Stage] = []

    def add(self, stage: str, total: float | None = None) -> int:
        now = monotonic()
        self._stages.append(_Stage(stage, total, now, now))
        say(stage)
        return len(self._stages) - 1

    def update(
        self, number: int, completed: float | None = None, *, stage: str = "", note: str = ""
    ) -> None:
        of, now = self._stages[number], monotonic()
        if stage and stage.partition(":")[0] != of.name.partition(":")[0]:
            self._stages[number] = _Stage(stage, of.total, now, now)
            say(stage)
            return
        of.name = stage or of.name
        if now - of.told < INTERVALS[min(of.lines, len(INTERVALS) - 1)]:
            return
        of.told, of.lines = now, of.lines + 1
        said = of.name
        if of.total and completed:
            share = min(completed / of.total, 1.0)
            left = (now - of.begun) * (1.0 - share) / share
            said += f": {share:.0%}, {clock(left)} left"
        say(f"{said} ({note})" if note else said)


class _Nothing:
    def add(self, stage: str, total: float | None = None) -> int:
        return 0

    def update(
        self, number: int, completed: float | None = None, *, stage: str = "", note: str = ""
    ) -> None:
        pass


def clock(seconds: float) -> str:
    """12 s, 3:05 min or 1:02:03 h."""
    whole = round(seconds)
    if whole < 100:
        return f"{whole} s"
    minutes, s = divmod(whole, 60)
    hours, m = divmod(minutes, 60)
    return f"{hours}:{m:02}:{s:02} h" if hours else f"{m}:{s:02} min"


class Stages:
    """Named stages, one after the other; nobody knows how long each takes."""

    def __init__(self, bars: Bars) -> None:
        self._bars = bars
        self._number: int | None = None

    def __call__(self, stage: str) -> None:
        if self._number is None:
            self._number = self._bars.add(stage)
        else:
            self._bars.update(self._number, stage=stage)


class Compiling:
    """A bar of what is compiled, where something is."""

    def __init__(self, bars: Bars) -> None:
        self._bars = bars
        self._number: int | None = None

    def __call__(self, done: int, total: int, share: float) -> None:
        if self._number is None:
            self._number = self._bars.add("compiling, only this once", total=1.0)
        self._bars.update(self._number, share, note=f"{done} of {total}")


class Training:
    """A bar a policy: how far the residual has come, in powers of ten."""

    def __init__(self, bars: Bars) -> None:
        self._bars = bars
        self._numbers: dict[str, int] = {}

    def __call__(self, name: str, sweep: int, residual: float) -> None:
        if name not in self._numbers:
            self._numbers[name] = self._bars.add(f"training: {name}", total=-log10(FINEST))
        done = -log10(min(max(residual, FINEST), 1.0))
        note = f"sweep {sweep}, residual {residual:.1e}"
        self._bars.update(self._numbers[name], done, note=note)
