"""Forged files at the command line: every command that reads a kind of file, in this process."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from kumite import cli, files
from kumite.errors import KumiteError

Rng = np.random.Generator

ENDS = (0, 3)  # statuses of a result; 3: of info, where some of the files cannot be read
SCENES = {"frames": "sparring", "actions": "boxing", "preparation": "ball-kick"}
BRIEF = ("--seconds", "0.3")


def command(*args: str | Path) -> str:
    """What a command line prints. Errors: as it says them; AssertionError for any other end."""
    said, wrong = io.StringIO(), io.StringIO()
    status: Any = 0
    with (
        mock.patch.object(sys, "argv", ["kumite", *map(str, args)]),
        mock.patch("kumite.studio.serve", _watch),
        contextlib.redirect_stdout(said),
        contextlib.redirect_stderr(wrong),
    ):
        try:
            cli.main()
        except SystemExit as end:
            status = end.code or 0
    told = wrong.getvalue()
    assert "Traceback" not in told, told
    if status == 2:
        lines = [line for line in told.splitlines() if line.startswith("error: ")]
        assert len(lines) == 1, told
        raise KumiteError(told)
    assert status in ENDS, (status, told)
    return said.getvalue()


def _watch(stage: Any, **_: Any) -> None:
    """What the studio does with a stage, but for the browser."""
    for _frame in range(10):
        stage.step()
    stage.reset(2)


def on_library(rng: Rng, folder: Path, path: Path, level: str) -> None:
    """A library of a level; now and then for a scene that asks for another."""
    fits = SCENES[level] if rng.random() < 0.7 else str(rng.choice([*SCENES.values(), "slip"]))
    ways: list[tuple[str | Path, ...]] = [
        ("info", path),
        ("info", path, "--json"),
        ("run", fits, "--library", path, *BRIEF),
        ("run", fits, "-l", path, *BRIEF, "--out", folder / "x.rec", "--out", folder / "x.png"),
        ("studio", fits, "--library", path),
        ("studio", path),
        ("spheres", path, "-o", folder / "x.toml"),
    ]
    if level == "preparation":
        ways.append(("train", path, "--most-batches", "1", "--json"))
    command(*ways[rng.integers(len(ways))])


def on_recording(rng: Rng, folder: Path, path: Path) -> None:
    ways: list[tuple[str | Path, ...]] = [
        ("info", path),
        ("info", path, "--json"),
        ("metrics", path),
        ("metrics", path, "--json"),
        ("studio", path),
        ("export", path, "-o", folder / "x.glb"),
        ("export", path, "-o", folder / "x.bvh", "--character", "red"),
        *(("export", path, "-o", folder / "x.png", "--at", at) for at in ("hits", "evenly")),
    ]
    command(*ways[rng.integers(len(ways))])


def on_policy(rng: Rng, library: Path) -> None:
    """A library beside which a policy lies that is solved again where it is damaged."""
    way = (("run", "sparring", *BRIEF), ("studio", "sparring"))[rng.integers(2)]
    command(*way, "--library", library)


def on_performance(rng: Rng, folder: Path, path: Path) -> str:
    """Clips of the built-in performer: in the cache folder a library is made of them."""
    if rng.random() < 0.5:
        ways = [("info", path), ("studio", path), ("run", "sparring", "--library", path)]
        return command(*ways[rng.integers(len(ways))])
    key = files.code_digest("performer", "body", "clip", "rotation")
    cache = folder / "cache"
    cache.mkdir(exist_ok=True)
    for made in cache.glob("performer-*.kumite"):
        made.unlink()
    path.replace(cache / f"performance-boxing-0-one-{key}.kumite")
    with mock.patch.dict(os.environ, {"KUMITE_CACHE": str(cache)}):
        return command("run", "sparring", *BRIEF)
