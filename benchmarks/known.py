"""Write src/kumite/kernels/known.txt anew: which kernels the built-in scenes call, how.

Runs every built-in scene for some seconds, and builds every built-in library. Seconds are those of
kernels that are compiled meanwhile; set NUMBA_CACHE_DIR to an empty folder to have all of them.
"""

from __future__ import annotations

import sys
import time
from collections import defaultdict
from pathlib import Path

from numba.core import event

from kumite import caches
from kumite.cli.scenes import _live_scene
from kumite.graph import builtin_layer
from kumite.kernels.character import MANY
from kumite.kernels.known import TABLE, called, forget, known
from kumite.kernels.within import Kernel
from kumite.scene import builtin_scenes, record, with_count
from kumite.warm import needs_of

SECONDS = 3.0


class Clock(event.Listener):
    """Seconds of compiling, by kernel: with those it calls, where they are compiled first."""

    def __init__(self) -> None:
        self.begun: list[float] = []
        self.seconds: dict[str, float] = {}

    def on_start(self, event) -> None:
        self.begun.append(time.process_time())

    def on_end(self, event) -> None:
        took, made = time.process_time() - self.begun.pop(), event.data["dispatcher"]
        if isinstance(made, Kernel):
            self.seconds[f"{made.py_func.__module__}.{made.py_func.__qualname__}"] = took


def main() -> None:
    clock = Clock()
    event.register("numba:compile", clock)
    needs: dict[tuple[str, str], set[str]] = defaultdict(set)

    def note(need: str) -> None:
        for found in called():
            needs[found].add(need)
        forget()

    forget()
    before = {(row.name, row.types): row for row in known()} if TABLE.exists() else {}
    chosen = sys.argv[1:]
    for level, style in (
        ("frames", "boxing"),
        ("frames", "avoidance"),
        ("actions", "boxing"),
        ("avoidance", "boxing"),
        ("avoidance", "avoidance"),
        ("preparation", "targets"),
    ):
        builtin_layer(None, style=style, level=level)
        note(level)
        print(level, style, flush=True)
    scenes = builtin_scenes()
    scenes["many"] = with_count(scenes["crowd"], MANY)
    for name, settings in scenes.items():
        if chosen and name not in chosen:
            continue
        (kind,) = needs_of(settings, building=False)
        _live_scene(settings, None, 0)  # its library is made
        for path in (caches.root() or Path()).iterdir():
            if path.is_file() and path.suffix != ".kumite":  # what is learned is learned anew
                path.unlink()
        forget()
        record(_live_scene(settings, None, 0), SECONDS)
        note(kind)
        print(name, kind, flush=True)
    if chosen:  # the others as they were
        for key, row in before.items():
            needs[key].update(row.needs)
    lines = []
    for (name, types), which in sorted(needs.items()):
        old = before.get((name, types))
        seconds = clock.seconds.get(name, old.seconds if old else 0.0)
        lines.append(f"{','.join(sorted(which))} {seconds:.1f} {name} {types}\n")
    TABLE.write_text("".join(lines), "utf-8")


if __name__ == "__main__":
    main()
