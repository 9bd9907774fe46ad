"""What the tests share."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from kumite import mocap as mocap_files
from kumite.graph import Library, build_library, builtin_library


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
def library() -> Library:
    """The built-in performer's library."""
    return builtin_library(None)


@pytest.fixture(scope="session")
def whole() -> Library:
    """The built-in performer's library of whole actions."""
    return builtin_library(None, level="actions")


@pytest.fixture(scope="session")
def boxer(mocap: Path) -> Library:
    """The real boxer's library."""
    return build_library(mocap_files.load(mocap / "boxer").clip_set())


@pytest.fixture(scope="session")
def fighters() -> Library:
    """The built-in performer's library of whole actions, as it boxes."""
    return builtin_library(None, style="boxing", level="actions")
