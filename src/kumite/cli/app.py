"""What all commands share: the application, its two consoles, progress and options."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Motion capture of one person at a time, turned into characters that spar.",
    epilog="Start with: kumite studio sparring (the built-in performer, no download).",
)
# Lines are never broken, so that what is piped on can be searched; nor are tables squeezed there.
_WIDTH = None if (sys.stdout and sys.stdout.isatty()) or "COLUMNS" in os.environ else 200
out = Console(soft_wrap=True, width=_WIDTH)
err = Console(stderr=True, soft_wrap=True)

JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for scripts.")]


@app.callback(invoke_without_command=True)
def _root(
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        from kumite import __version__

        print(f"kumite {__version__}")
        raise typer.Exit


@contextmanager
def progress() -> Iterator[Progress]:
    """Bars on stderr, gone when done; a line a stage where stderr is no terminal."""
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[note]}"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as bars:
        yield bars


def log_line(line: str) -> None:
    """A line instead of a bar, where stderr is a file."""
    if not err.is_terminal:
        err.print(line, markup=False, highlight=False)


class Stages:
    """Named stages on one spinner."""

    def __init__(self, bars: Progress) -> None:
        self._bars = bars
        self._task = bars.add_task("starting", total=None, note="")

    def __call__(self, stage: str) -> None:
        self._bars.update(self._task, description=stage)
        log_line(stage)


class Training:
    """A bar a policy: how far the residual has come, in powers of ten."""

    def __init__(self, bars: Progress) -> None:
        self._bars = bars
        self._tasks: dict[str, Any] = {}

    def __call__(self, name: str, sweep: int, residual: float) -> None:
        from math import log10

        if name not in self._tasks:
            self._tasks[name] = self._bars.add_task(f"training: {name}", total=4.0, note="")
            log_line(f"training: {name}")
        done = min(4.0, max(0.0, -log10(max(residual, 1e-4))))
        self._bars.update(
            self._tasks[name], completed=done, note=f"sweep {sweep}, residual {residual:.1e}"
        )


def print_json(value: Any) -> None:
    print(json.dumps(value, indent=2))
