"""Failing and dying at every file operation of a write: the old file or the new, whole, and no
other that the next write does not clear."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from kumite import files
from kumite.errors import KumiteError

SYSTEM = {  # by module and name: all that files.writing and its callers ask of the file system
    (os, "open"), (os, "fsync"), (os, "close"), (os, "replace"), (os, "rename"), (os, "unlink"),
    (os, "mkdir"), (os, "scandir"), (Path, "touch"), (Path, "open"), (Path, "replace"),
    (Path, "write_bytes"), (Path, "unlink"), (Path, "mkdir"),
}  # fmt: skip

CHILD = """
import os, sys
from pathlib import Path
from tests.test_exits import failing_at, write
def die():
    os.kill(os.getpid(), 9)
with failing_at(int(sys.argv[2]), die):
    write(Path(sys.argv[1]), 2.0)
"""


class failing_at:
    """Within it the n-th file operation does something else; counts them."""

    def __init__(self, n: int, instead) -> None:
        self.n, self.instead, self.count = n, instead, 0

    def __enter__(self) -> failing_at:
        self._before = [
            (where, name, getattr(where, name)) for where, name in sorted(SYSTEM, key=str)
        ]
        for where, name, real in self._before:
            setattr(where, name, self._counted(real))
        return self

    def __exit__(self, *_: object) -> None:
        for where, name, real in self._before:
            setattr(where, name, real)

    def _counted(self, real):
        def call(*args, **kwargs):
            self.count += 1
            if self.count == self.n:
                self.instead()
            return real(*args, **kwargs)

        return call


def write(path: Path, value: float) -> None:
    files.save(path, "thing", 1, {"value": value}, {"a": np.full(1000, value)})


def value(path: Path) -> float:
    header, arrays = files.load(path, "thing", 1)
    assert np.all(arrays["a"] == header["value"])
    return header["value"]


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_an_error_at_any_file_operation_leaves_old_or_new(tmp_path, error):
    def fail() -> None:
        raise error

    path, n, ended = tmp_path / "x.kumite", 0, False
    while not ended:
        n += 1
        write(path, 1.0)
        files._clear_abandoned.cache_clear()
        with failing_at(n, fail) as operations:
            try:
                write(path, 2.0)
            except (KumiteError, KeyboardInterrupt) as raised:
                assert isinstance(raised, KumiteError) == isinstance(error, OSError)
            ended = operations.count < n
        assert value(path) in (1.0, 2.0)
        left = [p.name for p in tmp_path.iterdir() if p != path]
        # Only where removing it is what failed.
        assert len(left) <= 1 and all(name.startswith(".kumite-part.") for name in left)
        for name in left:
            (tmp_path / name).unlink()
    assert n > 8


@pytest.mark.skipif(os.name != "posix", reason="kills")
def test_who_is_killed_leaves_old_or_new_and_what_the_next_write_clears(tmp_path):
    path = tmp_path / "x.kumite"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    outcomes = set()
    for n in (1, 3, 5, 6, 8, 10, 99):
        write(path, 1.0)
        made = [sys.executable, "-c", CHILD, str(path), str(n)]
        status = subprocess.run(made, env=environment, capture_output=True, check=False).returncode
        outcomes.add((status, value(path)))
        files._clear_abandoned.cache_clear()
        write(tmp_path / "other.kumite", 3.0)
        assert {p.name for p in tmp_path.iterdir()} == {"x.kumite", "other.kumite"}
    assert (-9, 1.0) in outcomes and (0, 2.0) in outcomes


def test_only_what_is_surely_ours_and_dead_is_cleared(tmp_path):
    mine = f".kumite-part.{files._here()}.{os.getpid()}.0123abcd.glb"  # being written
    others = [mine, ".kumite-part.glb", ".x.bvh", ".kumite-part.00000000.1.0123abcd.glb"]
    old = ".kumite-part.00000001.1.0123abcd"
    for name in (*others, old):
        (tmp_path / name).touch()
    two_days_ago = time.time() - 2 * 86_400
    os.utime(tmp_path / old, (two_days_ago, two_days_ago))
    write(tmp_path / "x.kumite", 1.0)
    assert {p.name for p in tmp_path.iterdir()} == {*others, "x.kumite"}
