"""Compile ahead what a scene needs, in as many processes as there are cores.

Numba compiles a kernel when it is first called, one at a time, and keeps the code on disk. Here
those of :mod:`kumite.kernels.known` that are not there yet are shared out among processes: no two
compile the same one, so no two write the same file.

    python -m kumite.warm sparring        (scenes by name; none: all built-in scenes)
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from kumite.kernels.known import Known
    from kumite.kernels.within import Kernel
    from kumite.scene import SceneSettings

WORK = "--work"  # asks a process of ours for a share of the work
WORTH_IT = 1.0  # s of compiling from which starting processes pays
PLUGGED = "kumite.control.game_tree"  # the module that makes kernels of templates and plugs


def warm(
    scenes: Iterable[SceneSettings] | None = None,
    progress: Callable[[int, int, float], None] = lambda done, total, share: None,
    *,
    building: bool = True,
    processes: int | None = None,
) -> int:
    """Compile what scenes need and is not compiled yet; how many kernels that were.

    scenes: of which kinds; None: all there are. building: with what it takes to build the built-in
    libraries. progress is told (0, total, 0.0), then after each kernel, from any thread, how many
    are done and which share of the time that is; nothing where all is there already, which takes
    some 20 ms. processes: as many as there are cores. What fails to compile here is compiled, or
    fails, when it is called.
    """
    needs = None if scenes is None else set[str]().union(*(needs_of(s, building) for s in scenes))
    rows = missing(needs)
    if not rows:
        return 0
    total, done, lock = len(rows), 0, threading.Lock()
    spent, seconds = 0.0, sum(row.seconds for row in rows)
    progress(0, total, 0.0)

    def one_more(row: Known) -> None:
        nonlocal done, spent
        with lock:
            done, spent = done + 1, spent + row.seconds
            progress(done, total, spent / seconds)

    count = processes or _cores()
    if count == 1 or seconds < WORTH_IT:
        for row in rows:
            compile_one(row.name, row.types)
            one_more(row)
        return total
    parts = shares(rows, count)
    workers = [_start(part) for part in parts]
    followers = [
        threading.Thread(target=_follow, args=(worker, part, one_more))
        for worker, part in zip(workers, parts)
    ]
    try:
        for follower in followers:
            follower.start()
        for follower in followers:
            follower.join()
    finally:
        for worker in workers:
            worker.kill()  # where this process is interrupted
            worker.wait()
    return total


def needs_of(settings: SceneSettings, building: bool = True) -> set[str]:
    """What a scene needs, in the words of the table of known kernels."""
    from kumite.kernels.character import MANY
    from kumite.scene.needs import needs

    of = needs(settings)
    kind = "crowd" if len(settings.names) >= MANY else "policies"
    for name, who in (
        ("evasion", settings.attacker),
        ("walk", settings.walking),
        ("dodge", settings.dodging),
        ("bout", settings.fighters),
    ):
        if who:
            kind = name
            break
    kinds = {kind, "dodge"} if kind == "bout" and settings.avoiding else {kind}
    levels = {*of.layers, "frames"} if settings.attacker else {*of.layers}
    return kinds | levels if building else kinds


def missing(needs: set[str] | None = None) -> list[Known]:
    """The known kernels that are needed and whose code is not on disk; None: of all."""
    from numba.core import config

    from kumite.kernels.known import known, read_types

    if config.DISABLE_JIT:  # pyright: ignore[reportAttributeAccessIssue]
        return []
    rows = [row for row in known() if needs is None or needs.intersection(row.needs)]
    return [row for row in rows if not kernel_of(row.name).is_kept(read_types(row.types))]


def kernel_of(name: str) -> Kernel:
    """The kernel of a name in the table."""
    from kumite.kernels.within import KERNELS

    for module in (name.rpartition(".")[0], PLUGGED):
        if name not in KERNELS:
            importlib.import_module(module)
    return KERNELS[name]


def shares(rows: list[Known], count: int) -> list[list[Known]]:
    """Rows shared out so that all take about as long; those of one module rather go together, as
    they call the same kernels."""
    found: list[list[Known]] = [[] for _ in range(min(count, len(rows)))]
    load = [0.0] * len(found)
    for row in sorted(rows, key=lambda r: -r.seconds):
        module = row.name.rsplit(".", 1)[0]
        costs = [
            row.seconds * (0.5 if any(r.name.startswith(f"{module}.") for r in share) else 1.0)
            for share in found
        ]
        at = min(range(len(found)), key=lambda i: load[i] + costs[i])
        found[at].append(row)
        load[at] += costs[at]
    return found


def compile_one(name: str, types: str) -> None:
    """Compile a kernel for types spelt as in the table, and keep it."""
    from kumite.kernels.known import read_types

    kernel_of(name).compile(read_types(types))


def _cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _start(share: list[Known]) -> subprocess.Popen[str]:
    """A process that compiles a share of the kernels, and writes a line after each."""
    paths = [str(Path(__file__).parent.parent), os.environ.get("PYTHONPATH", "")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in paths if p)}
    process = subprocess.Popen(
        [sys.executable, "-m", "kumite.warm", WORK],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=environment,
    )
    assert process.stdin is not None
    with contextlib.suppress(OSError):  # it has ended: its share is compiled when it is called
        process.stdin.write("".join(f"{row.name} {row.types}\n" for row in share))
        process.stdin.close()
    return process


def _follow(
    process: subprocess.Popen[str], rows: list[Known], one_more: Callable[[Known], None]
) -> None:
    assert process.stdout is not None
    for _, row in zip(process.stdout, rows):
        one_more(row)
    process.stdout.close()


def _work() -> None:
    """Compile what is asked for on standard input, and answer each with a line."""
    gc.disable()  # a compiler makes millions of objects and little garbage: a tenth of the time
    for name, types in [line.split() for line in sys.stdin]:
        try:
            compile_one(name, types)
        finally:
            print(name, flush=True)


def main() -> None:
    """``python -m kumite.warm [SCENE…]``"""
    if sys.argv[1:] == [WORK]:
        _work()
        return
    from kumite.scene import load_scene

    scenes = [load_scene(name) for name in sys.argv[1:]] or None

    def tell(done: int, total: int, share: float) -> None:
        print(f"compiling: {done} of {total}, {share:.0%}", flush=True)

    count = warm(scenes, tell)
    print(f"{count} kernels compiled")


if __name__ == "__main__":
    main()
