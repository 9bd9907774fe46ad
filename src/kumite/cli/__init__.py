"""The command line: ``kumite --help``."""

from __future__ import annotations

import os
import signal
import threading

INTERRUPTED = 130  # the status of a process that Ctrl-C has ended

TYPE_CHECKING = False  # typing itself would have to be imported first
if TYPE_CHECKING:
    from typing import Any


def main() -> None:
    """Run the command line; bad input ends with one line on stderr and status 2."""
    before = signal.getsignal(signal.SIGINT)
    in_main = threading.current_thread() is threading.main_thread()
    ours = in_main and before is signal.default_int_handler  # else ignored, or another's
    if ours:
        signal.signal(signal.SIGINT, _end_at_once)
    try:
        from kumite.cli.start import start

        start()
    except SystemExit as end:
        if end.code == INTERRUPTED:
            exec("")  # where Ctrl-C came within an exec, Python would end by a signal all the same
        raise
    finally:
        if ours:
            signal.signal(signal.SIGINT, before)


def begin() -> None:
    """From now on there is work, which Ctrl-C interrupts; until now it ended the process at once.

    While the command line itself is imported there is nothing to be kept, and an interrupt would be
    a traceback, or be taken for a package that is broken.
    """
    if signal.getsignal(signal.SIGINT) is _end_at_once:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _end_at_once(number: int, frame: Any) -> None:
    os.write(2, b"interrupted\n")
    os._exit(INTERRUPTED)
