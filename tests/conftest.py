"""What the tests share."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from kumite import caches, cli
from kumite import mocap as mocap_files
from kumite.graph import Layer, build_frames
from tests.shared import builtin

# Tests that make libraries and policies anew, in a cache folder of their own, share compiled code.
os.environ.setdefault("NUMBA_CACHE_DIR", str(caches.compiled() or ""))


@pytest.fixture(scope="session")
def mocap() -> Path:
    """The folder of real motion capture; skips without it, fails without it on CI."""
    where = os.environ.get("KUMITE_MOCAP")
    if where and Path(where).is_dir():
        return Path(where).resolve()  # some tests work in a folder of their own
    if os.environ.get("CI"):
        pytest.fail("KUMITE_MOCAP must name the folder of motion capture on CI")
    pytest.skip("KUMITE_MOCAP does not name a folder of motion capture")


@pytest.fixture(scope="session")
def library() -> Layer:
    """The built-in performer's library."""
    return builtin()


@pytest.fixture(scope="session")
def whole() -> Layer:
    """The built-in performer's library of whole actions."""
    return builtin(level="actions")


@pytest.fixture(scope="session")
def boxer(mocap: Path) -> Layer:
    """The real boxer's library."""
    return build_frames(mocap_files.load(mocap / "boxer").clip_set())


@pytest.fixture(scope="session")
def fighters() -> Layer:
    """The built-in performer's library of whole actions, as it boxes."""
    return builtin("boxing", "actions")


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path):
    """Run a command line in a folder of its own: (status, stdout, stderr)."""
    monkeypatch.chdir(tmp_path)

    def run(*args: str | Path | float) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["kumite", *map(str, args)])
        status = 0
        try:
            cli.main()
        except SystemExit as end:
            status = int(end.code or 0)
        captured = capsys.readouterr()
        return status, captured.out, captured.err

    return run
