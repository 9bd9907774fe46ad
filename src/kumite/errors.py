"""The one exception that a user of Kumite can meet."""

from __future__ import annotations

import contextlib
import difflib
from collections.abc import Iterable, Iterator
from pathlib import Path


class KumiteError(Exception):
    """Bad input, said once: where, what, and what was expected. The command line exits with 2."""


def at(path: Path | str, line: int | None, what: str) -> KumiteError:
    """An error at a place in a file: ``walk.bvh:17: unknown channel 'Wrotation'; expected …``."""
    where = f"{path}:{line}" if line is not None else f"{path}"
    return KumiteError(f"{where}: {what}")


def short(path: Path | str) -> str:
    """A path as an error repeats it: not longer than a file system allows."""
    text = str(path)
    return text if len(text) <= 200 else text[:200] + "…"


@contextlib.contextmanager
def told_of(path: Path | str) -> Iterator[None]:
    """What is refused within is told as a fault of a file."""
    try:
        yield
    except KumiteError as error:
        raise at(path, None, str(error)) from None


def unknown(kind: str, name: str, valid: Iterable[str]) -> KumiteError:
    """An unknown name, with near names first and every valid choice after."""
    choices = sorted(valid)
    near = difflib.get_close_matches(name, choices, n=2, cutoff=0.5)
    hint = f"; did you mean {' or '.join(repr(n) for n in near)}?" if near else ""
    return KumiteError(f"unknown {kind} {name!r}{hint} (expected one of {', '.join(choices)})")
