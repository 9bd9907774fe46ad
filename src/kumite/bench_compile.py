"""The figures of compiling: how long a first start takes, and which kernels it is spent on."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

WORST = 10  # functions told of one by one
SCENES = ("sparring", "dodgeball", "boxing", "ball-kick", "slip", "brawl")

# Own seconds and number of signatures of every function, most expensive first.
_EACH = """
import json, time
from collections import defaultdict
from numba.core import event
from kumite.warm import compile_one, missing

class Clock(event.Listener):
    def __init__(self):
        self.open, self.rows = [], defaultdict(lambda: [0.0, 0])
    def on_start(self, event):
        self.open.append([time.process_time(), 0.0])
    def on_end(self, event):
        begun, inner = self.open.pop()
        took = time.process_time() - begun
        if self.open:
            self.open[-1][1] += took
        made = event.data["dispatcher"].py_func
        row = self.rows[f"{made.__module__.rsplit('.', 1)[-1]}.{made.__qualname__}"]
        row[0] += took - inner
        row[1] += 1

rows, clock = missing(), Clock()
event.register("numba:compile", clock)
for row in rows:
    compile_one(row.name, row.types)
print(json.dumps(sorted(((n, *r) for n, r in clock.rows.items()), key=lambda r: -r[1])))
"""


Value = float | dict[str, float]


def compile_figures() -> dict[str, tuple[Callable[[Path], Value], str, float | None]]:
    """Figures by name: what works them out of a folder (all here do without), unit and limit."""
    figures: dict[str, tuple[Callable[[Path], Value], str, float | None]] = {
        "compiling all kernels, CPU": (lambda folder: _each(), "s", None),
        "compiling all kernels, a process a core": (
            lambda folder: _timed(["-m", "kumite.warm"])[0], "s", 60.0,
        ),
    }  # fmt: skip
    for scene in SCENES:
        figures[f"first start of {scene}, nothing compiled"] = (
            lambda folder, scene=scene: _timed(
                ["-m", "kumite", "run", scene, "--seconds", "1"]
            )[0], "s", 25.0,
        )  # fmt: skip
    return figures


def _timed(command: list[str]) -> tuple[float, str]:
    """Seconds that a command takes with nothing compiled or cached, and what it says."""
    with tempfile.TemporaryDirectory() as scratch:
        environment = {**os.environ, "KUMITE_CACHE": scratch}
        environment.pop("NUMBA_CACHE_DIR", None)
        begin = time.perf_counter()
        done = subprocess.run(
            [sys.executable, *command], env=environment, check=True, capture_output=True, text=True
        )
        return time.perf_counter() - begin, done.stdout


def _each() -> dict[str, float]:
    """Seconds of all, and of the dearest functions each without those it calls."""
    rows = json.loads(_timed(["-c", _EACH])[1])
    title = f"{len(rows)} functions, {sum(n for *_, n in rows)} signatures"
    found = {title: float(sum(seconds for _, seconds, _ in rows))}
    return found | {f"{name}, {n} signatures": float(s) for name, s, n in rows[:WORST]}
