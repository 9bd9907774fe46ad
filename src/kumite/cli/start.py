"""The command line runs here: all commands, and how they end."""

from __future__ import annotations

import contextlib
import os
import sys
from io import BufferedWriter, FileIO, TextIOWrapper
from typing import Any

from kumite.cli import motion, scenes, segment, train  # noqa: F401 - they add their commands
from kumite.cli.app import app, err
from kumite.errors import KumiteError

OUTPUT = "standard output"


def start() -> None:
    """Run the command line; bad input ends with one line on stderr and status 2."""
    _name_output()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):  # a terminal without "→" gets "?"
            stream.reconfigure(errors="replace")
    try:
        try:
            app()
        finally:
            if sys.stdout is not None:
                sys.stdout.flush()  # what fails at the end of Python is a traceback
    except KumiteError as error:
        reason = str(error)
    except MemoryError:
        reason = "not enough memory; fewer files, a lower rate or a shorter time takes less"
    except BrokenPipeError:  # nobody reads on: "kumite scenes | head -1"
        _close_output()
        sys.exit(1)
    except OSError as error:
        what = error.strerror or str(error)
        if error.filename == OUTPUT:
            reason = f"cannot write to {OUTPUT} ({what})"
            _close_output()
        else:
            reason = what if error.filename is None else f"{error.filename}: {what}"
    else:
        return
    with contextlib.suppress(OSError):
        err.print(f"error: {reason}", markup=False, highlight=False)
    sys.exit(2)


class _Output(FileIO):
    def write(self, data: Any) -> int | None:
        try:
            return super().write(data)
        except OSError as error:
            error.filename = OUTPUT
            raise


def _name_output() -> None:
    """From now on errors of standard output say that it is what fails."""
    plain = sys.stdout
    if type(plain) is not TextIOWrapper:  # none, or a test's
        return
    if type(getattr(plain.buffer, "raw", plain.buffer)) is FileIO:  # no console of Windows
        output = BufferedWriter(_Output(plain.fileno(), "wb", closefd=False))
        sys.stdout = TextIOWrapper(
            output,
            plain.encoding,
            line_buffering=plain.line_buffering,
            write_through=plain.write_through,
        )


def _close_output() -> None:
    """Send what is left nowhere, or Python would fail on it once more as it ends."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
