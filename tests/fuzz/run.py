"""Run cases of a target, each from a seed of its own, each within a limit of time."""

from __future__ import annotations

import contextlib
import signal
import tempfile
import time
import traceback
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from kumite.errors import KumiteError
from tests.fuzz.targets import TARGETS, prepare

LONGEST = 10_000  # characters of an error: more floods a terminal
MOST_FINDS = 20


class TooLong(BaseException):
    """A case went on beyond its limit."""


@dataclass
class Result:
    """What came of the cases of a target."""

    target: str
    cases: int = 0
    read: int = 0  # that gave a result
    refused: int = 0  # with a KumiteError
    seconds: float = 0.0
    slowest: float = 0.0  # s
    finds: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        return (
            f"{self.target}: {self.cases} cases, {self.read} read, {self.refused} refused, "
            f"{len(self.finds)} finds; {1e3 * self.seconds / max(self.cases, 1):.1f} ms a case, "
            f"the slowest {self.slowest:.2f} s"
        )


def run(
    target: str,
    cases: int,
    seed: int = 0,
    *,
    limit: float = 5.0,
    folder: Path | None = None,
    deep: bool = True,
) -> Result:
    """Cases ``seed`` … ``seed + cases - 1`` of a target. The same seed makes the same case.

    deep: of some files that can be read, run scenes and write exports, too.
    """
    result = Result(target)
    prepare(target, deep)
    with contextlib.ExitStack() as stack:
        if folder is None:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        stack.enter_context(np.errstate(all="ignore"))
        for number in range(seed, seed + cases):
            _one(result, target, number, limit, folder)
            if len(result.finds) >= MOST_FINDS:
                break
    return result


def _one(result: Result, target: str, number: int, limit: float, folder: Path) -> None:
    rng = np.random.default_rng([number, zlib.crc32(target.encode())])
    begin = time.process_time()
    found = None
    try:
        with _at_most(limit if result.cases else 120.0):  # the first makes what all begin with
            TARGETS[target](rng, folder)
        result.read += 1
    except KumiteError as error:
        result.refused += 1
        if len(str(error)) > LONGEST or "\x1b" in str(error):
            found = f"an error of {len(str(error))} characters: {str(error)[:200]!r}"
    except TooLong:
        found = f"more than {limit:g} s\n{traceback.format_exc(limit=-4)}"
    except (Exception, SystemExit):
        found = traceback.format_exc(limit=-5)
    took = time.process_time() - begin
    result.seconds += took
    if result.cases:
        result.slowest = max(result.slowest, took)
    result.cases += 1
    if found is not None:
        result.finds.append(f"{target}, seed {number}: {found}")


@contextlib.contextmanager
def _at_most(seconds: float) -> Iterator[None]:
    """Raise :class:`TooLong` in what takes longer (of its own time, not of its neighbours')."""
    if not hasattr(signal, "setitimer"):  # Windows
        yield
        return

    def end(*_: object) -> None:
        raise TooLong

    before = signal.signal(signal.SIGVTALRM, end)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, before)
