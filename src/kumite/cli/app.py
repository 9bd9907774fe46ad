"""What all commands share: the application, its two consoles and options."""

from __future__ import annotations

import functools
import inspect
import json
import os
import sys
from collections.abc import Callable
from typing import Annotated, Any

import typer
from rich.console import Console

from kumite.cli import INTERRUPTED, begin


class App(typer.Typer):
    """An application whose every command has --quiet, and ends with one line on Ctrl-C."""

    def command(self, *args: Any, **options: Any) -> Callable[[Callable], Callable]:
        register = super().command(*args, **options)

        def add(function: Callable) -> Callable:
            register(_shared(function))
            return function

        return add


def _shared(function: Callable) -> Callable:
    """A command with what all commands have."""
    own = inspect.signature(function, eval_str=True).parameters
    quiet = inspect.Parameter(
        "quiet", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=QuietOption
    )

    @functools.wraps(function)
    def run(*args: Any, quiet: bool, **given: Any) -> None:
        settings.quiet = settings.quiet or quiet
        try:
            begin()
            function(*args, **given)
        except KeyboardInterrupt:
            err.print("interrupted", highlight=False)
            raise typer.Exit(INTERRUPTED) from None

    shown = [*own.values(), quiet]
    run.__annotations__ = {p.name: p.annotation for p in shown}
    run.__signature__ = inspect.Signature(shown)  # pyright: ignore[reportAttributeAccessIssue]
    del run.__wrapped__
    return run


class _Settings:
    quiet = False


QuietOption = Annotated[
    bool,
    typer.Option("--quiet", "-q", help="No progress: only results, warnings and errors."),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for scripts.")]

settings = _Settings()
app = App(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # Rich would take "[m/s]" in a help text for markup
    help="Motion capture of one person at a time, turned into characters that spar.",
    epilog="Start with: kumite studio sparring (the built-in performer, no download).",
)
# Lines are never broken, so that what is piped on can be searched; nor are tables squeezed there.
_WIDTH = None if (sys.stdout and sys.stdout.isatty()) or "COLUMNS" in os.environ else 200
out = Console(soft_wrap=True, width=_WIDTH)
err = Console(stderr=True, soft_wrap=True)


@app.callback(invoke_without_command=True)
def _root(
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
    quiet: QuietOption = False,
) -> None:
    settings.quiet = quiet
    if version:
        from kumite import __version__

        print(f"kumite {__version__}")
        raise typer.Exit


def print_json(value: Any) -> None:
    print(json.dumps(value, indent=2))
