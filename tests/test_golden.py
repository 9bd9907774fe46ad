"""The script that says whether scenes still show the same sees every kind of difference."""

from __future__ import annotations

import importlib.util
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

SCRIPT = Path(__file__).parent.parent / "benchmarks" / "golden.py"


@pytest.fixture(scope="module")
def golden():
    spec = importlib.util.spec_from_file_location("golden", SCRIPT)
    assert spec is not None and spec.loader is not None
    module = sys.modules["golden"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def shown(golden):
    """25 frames at 10 a second of two characters and a ball."""
    rng = np.random.default_rng(0)
    return golden.Golden(
        10.0,
        ("red", "blue"),
        ("ball",),
        {
            "root_position": rng.normal(size=(25, 2, 3)).astype(np.float32),
            "wxyz": rng.normal(size=(25, 2, 5, 4)).astype(np.float32),
            "contacts": rng.random((25, 2, 2)) < 0.5,
            "library_frame": rng.integers(0, 9, (25, 2)).astype(np.int32),
            "rate": np.ones((25, 2), np.float32),
            "object_position": rng.normal(size=(25, 1, 3)).astype(np.float32),
        },
        [[3, "strike", "red", {"blow": 1}], [25, "hit", "red", {"speed": 4.0}]],
    )


def changed(shown, name, at, value):
    array = shown.arrays[name].copy()
    array[at] = value
    return replace(shown, arrays={**shown.arrays, name: array})


@pytest.mark.parametrize(
    ("name", "at", "value", "said"),
    [
        ("root_position", (12, 1, 0), 7.0, "root_position: first in frame 12 (1.20 s), blue"),
        ("wxyz", (24, 0, 4, 3), 7.0, "wxyz: first in frame 24 (2.40 s), red"),
        ("contacts", (0, 1, 0), None, "contacts: first in frame 0 (0.00 s), blue"),
        ("library_frame", (5, 0), 11, "library_frame: first in frame 5 (0.50 s), red"),
        ("rate", (20, 1), 2.0, "rate: first in frame 20 (2.00 s), blue"),
        ("object_position", (9, 0, 2), -0.0, "object_position: first in frame 9 (0.90 s), ball"),
    ],
)
def test_the_first_difference_is_named(golden, shown, tmp_path, name, at, value, said):
    if name == "object_position":
        shown = changed(shown, name, at, 0.0)  # of which the other is the negative: not the same
    if value is None:
        value = ~shown.arrays[name][at]
    path = tmp_path / "golden.json"
    golden.write(path, 2.5, 1, {"boxing": shown})
    before = json.loads(path.read_text())["scenes"]["boxing"]
    arrays = np.load(path.with_suffix(".npz"))
    assert golden.differences("boxing", shown, before, arrays) == []
    other = changed(shown, name, at, value)
    lines = golden.differences("boxing", other, before, arrays)
    assert len(lines) == 1 and lines[0].startswith(said)
    kind = "things" if name == "object_position" else "poses"
    digests = other.digests()
    assert digests["digest"] != before["digest"]
    second = at[0] // 10
    for other_kind in ("poses", "things", "events"):
        for s in range(3):
            same = digests[other_kind][s] == before[other_kind][s]
            assert same == ((other_kind, s) != (kind, second))


def test_events_that_differ_are_named(golden, shown, tmp_path):
    path = tmp_path / "golden.json"
    golden.write(path, 2.5, 1, {"boxing": shown})
    before = json.loads(path.read_text())["scenes"]["boxing"]
    arrays = np.load(path.with_suffix(".npz"))
    strike, hit = shown.events
    for events, said in (
        ([strike], "events: first number 2: nothing; before: frame 25 (2.50 s) hit of red"),
        ([strike, [25, "hit", "red", {"speed": 4.5}]], "events: speed of hit differs in 1: first"),
        ([[3, "strike", "red", {"blow": 1, "limb": "x"}], hit], "events: limb of strike is new"),
        ([[3, "strike", "red", {}], hit], "events: blow of strike is gone in 1"),
    ):
        other = replace(shown, events=events)
        assert said in golden.differences("boxing", other, before, arrays)[0]
        assert other.digests()["digest"] != before["digest"]
    # Less of it is compared as far as it has run.
    part = replace(
        shown,
        arrays={n: a[:12] for n, a in shown.arrays.items()},
        events=[strike, [12, "x", "", {}]],
    )
    assert golden.differences("boxing", part, before, arrays) == []
