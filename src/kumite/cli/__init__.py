"""The command line: ``kumite --help``."""

from __future__ import annotations

import sys
from io import TextIOWrapper

from kumite.cli import motion, scenes, segment, train  # noqa: F401 - they add their commands
from kumite.cli.app import app, err
from kumite.errors import KumiteError


def main() -> None:
    """Run the command line; bad input ends with one line on stderr and status 2."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):  # a terminal without "→" gets "?"
            stream.reconfigure(errors="replace")
    try:
        app()
    except KumiteError as error:
        reason = str(error)
    except MemoryError:
        reason = "not enough memory; fewer files, a lower rate or a shorter time takes less"
    except OSError as error:  # of files, all are KumiteErrors: this is our own output (disk full)
        reason = f"cannot write to standard output ({error.strerror or error})"
    else:
        return
    err.print(f"error: {reason}", markup=False, highlight=False)
    sys.exit(2)
