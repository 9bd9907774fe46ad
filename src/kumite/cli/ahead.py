"""Preparing a scene in other processes, while the studio shows a recorded fight.

What a first start costs is compiling, a minute of it. It is done beside the studio, once for all:
the code, the built-in library and the policies are kept on disk, and the studio finds them there.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from kumite.cli.app import out
from kumite.cli.progress import progress
from kumite.errors import KumiteError

if TYPE_CHECKING:
    from kumite.studio import Coming

WORTH_SHOWING = 6.0  # s of compiling ahead from which on a recorded fight is shown
OF_COMPILING = 0.9  # share of all work
REHEARSED = 2.0  # s of a scene that are run, so that all that it calls is compiled
_COMPILING = re.compile(r"([\d.]+) (compiling \d+ of \d+)")  # share of it, and what to say


class Wanted(NamedTuple):
    """A scene as it is asked for on the command line."""

    scene: str
    library: Path | None
    count: int | None
    throws: int | None
    seed: int


def is_cold(wanted: Wanted) -> bool:
    """Whether so much of what a scene needs is not compiled yet that it takes a while."""
    from kumite.cli.scenes import settings_of
    from kumite.warm import missing, needs_of

    needs = needs_of(settings_of(wanted), wanted.library is None)
    return sum(row.seconds for row in missing(needs)) > WORTH_SHOWING


def prepare(wanted: Wanted, coming: Coming) -> Any:
    """The scene, when all that it needs is compiled and kept. Errors: what is wrong with it."""
    from kumite.cli.scenes import live_scene

    with progress() as bars:
        number = bars.add("preparing, only this once", 1.0)

        def tell(doing: str, share: float) -> None:
            coming.tell(doing, share)
            bars.update(number, share, note=doing)

        _follow(wanted, coming, tell)
    coming.tell("almost there", 1.0)
    live = live_scene(wanted)
    _rehearse(live, wanted.seed)
    out.print(f"live: {coming.name}", markup=False, highlight=False)
    return live


def _follow(wanted: Wanted, coming: Coming, tell: Callable[[str, float], None]) -> None:
    """Have another process prepare everything on disk, and say how far it is."""
    paths = [str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")]
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "kumite.cli.ahead", json.dumps(wanted, default=str)],
        stdin=subprocess.PIPE,  # it ends when this is closed, however we end
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        encoding="utf-8",
        errors="replace",
        env={**os.environ, "PYTHONPATH": os.pathsep.join(p for p in paths if p)},
        start_new_session=True,
    )
    coming.own(process)
    said, share = "", 0.0
    with process:
        assert process.stdout is not None
        for line in process.stdout:
            said = line.strip() or said
            found = _COMPILING.fullmatch(said)
            if found:
                share, said = OF_COMPILING * float(found[1]), found[2]
            tell(said, share)
    if process.returncode == 2:
        raise KumiteError(said.removeprefix("error: "))
    # Of any other end nothing is lost: what is missing is compiled when it is called.


def _rehearse(live: Any, seed: int) -> None:
    """Run a scene for a while and start it again: no picture of it waits for a compiler."""
    for _ in range(round(REHEARSED * live.fps)):
        live.step()
    live.reset(seed)


def _end_with_parent() -> None:
    sys.stdin.read()
    os._exit(1)


def main() -> None:
    """``python -m kumite.cli.ahead WANTED``: prepare, and say on standard output what is done."""
    from kumite.cli.scenes import live_scene, settings_of
    from kumite.warm import warm

    threading.Thread(target=_end_with_parent, daemon=True).start()
    scene, library, *rest = json.loads(sys.argv[1])
    wanted = Wanted(scene, None if library is None else Path(library), *rest)
    try:
        warm(
            [settings_of(wanted)],
            lambda done, total, share: print(
                f"{share:.3f} compiling {done} of {total}", flush=True
            ),
            building=wanted.library is None,
        )
        _rehearse(live_scene(wanted), wanted.seed)
    except KumiteError as error:
        print(f"error: {error}", flush=True)
        sys.exit(2)


if __name__ == "__main__":
    main()
