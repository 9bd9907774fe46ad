"""Public functions say in one sentence what they were handed, and what they expected."""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Callable
from dataclasses import is_dataclass
from typing import Any

import numpy as np
import pytest

import kumite
from kumite.annotate import find_actions, find_contacts
from kumite.body import palettes
from kumite.control import Route, strike_grid
from kumite.errors import KumiteError
from kumite.export.bvh import write_bvh
from kumite.export.gltf import write_glb
from kumite.scene.doors import a_place
from kumite.scene.recording import Recording
from kumite.synthesis import smooth_levels
from tests import toys
from tests.telling import event

JUNK = (None, "sparring", 3, 1.5, [], {}, np.zeros(3), object())
TAKES = {
    "World": lambda x: kumite.World(x, None),  # type: ignore[arg-type]
    "PrepareScene": lambda x: kumite.PrepareScene(x, None),  # type: ignore[arg-type]
    "library of a scene": lambda x: kumite.World(kumite.load_scene("sparring"), x),
    "measure": kumite.measure,
    "save_recording": lambda x: kumite.save_recording("x.rec", x),
    "save_library": lambda x: kumite.save_library("x.kumite", x),
    "Playback": kumite.Playback,
    "mirror": kumite.mirror,
    "resample": lambda x: kumite.resample(x, 30.0),
    "concatenate": kumite.concatenate,
    "find_contacts": kumite.find_contacts,
    "find_strikes": kumite.find_strikes,
    "build_frames": kumite.build_frames,
    "build_actions": kumite.build_actions,
    "build_avoidance": kumite.build_avoidance,
    "solve": lambda x: kumite.solve(x, kumite.approach()),
    "strike": kumite.strike,
    "AvoidanceSearch": kumite.AvoidanceSearch,
    "write_glb": lambda x: write_glb("x.glb", x),
    "write_bvh": lambda x: write_bvh("x.bvh", x),
}


@pytest.mark.parametrize("name", TAKES)
def test_what_is_of_another_type_is_refused_in_a_sentence(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for junk in JUNK:
        with pytest.raises(KumiteError) as said:
            TAKES[name](junk)
        assert "\n" not in str(said.value) and len(str(said.value)) < 200
        assert re.search("expected|no clips", str(said.value))
    assert list(tmp_path.iterdir()) == []


PACKAGES = ("", ".mocap", ".performer", ".annotate", ".body", ".graph", ".synthesis", ".control")
PACKAGES += (".scene",)
# Models of pydantic, with errors of its own; what takes long to make clips or a library of nothing.
APART = {"SceneSettings", "builtin_library", "perform", "performed"}


def _public() -> list[tuple[str, Callable]]:
    """Every public function or class that has to be handed something."""
    found = {}
    for package in PACKAGES:
        module = importlib.import_module(f"kumite{package}")
        for name in module.__all__:
            value = getattr(module, name)
            if inspect.isfunction(value) or isinstance(value, type):
                found[name] = value
    return [(n, v) for n, v in sorted(found.items()) if n not in APART and _wanted(v)]


def _wanted(of: Callable) -> tuple[list[str], list[str]] | None:
    """What it has to be handed, by place and by name; None: nothing, or Python's own."""
    if (isinstance(of, type) and not of.__module__.startswith("kumite")) or of is KumiteError:
        return None
    given = [p for p in inspect.signature(of).parameters.values() if p.default is p.empty]
    plain = [p.name for p in given if p.kind is p.POSITIONAL_OR_KEYWORD]
    named = [p.name for p in given if p.kind is p.KEYWORD_ONLY]
    return (plain, named) if plain or named else None


@pytest.mark.parametrize(("name", "of"), _public(), ids=lambda v: v if isinstance(v, str) else "")
def test_whatever_is_handed_over_nothing_breaks_inside(name, of, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    wanted = _wanted(of)
    assert wanted is not None
    refused = 0
    for junk in (*JUNK, float("nan"), np.full((2, 4), np.nan)):
        try:
            of(*[junk] * len(wanted[0]), **dict.fromkeys(wanted[1], junk))
        except KumiteError as error:
            refused += 1
            assert len(str(error)) < 300, error
    assert refused or is_dataclass(of) or name in ("cache_folder", "put")


THREE: Any = 3
TEXT: Any = "fast"
NOTHING: Any = None
PLACES: Any = ("here", "there")
THING: Any = object()
WRONG = {  # of arguments that fit but for one
    "find_actions": (lambda c: find_actions(c, find_contacts(c), THREE),
                     "find_actions: strikes: 3; expected a Strikes"),
    "resample": (lambda c: kumite.resample(c.clip(0), np.nan), "nan"),
    "smooth_levels": (lambda c: smooth_levels(np.zeros(5), TEXT),
                      "smooth_levels: fps: 'fast'; expected a number"),
    "record": (lambda c: kumite.record(THING, 3.0), "record: scene: an object"),
    "load_library": (lambda c: kumite.load_library(NOTHING),
                     "load_library: path: None; expected a path or text"),
    "strike_grid": (lambda c: strike_grid(np.zeros((3, 2))),
                    "effective hitting points is [3, 2], expected [P, 3]"),
    "route": (lambda c: Route(PLACES),
              "Route: points: a tuple; expected several, each a CheckPoint"),
    "palettes": (lambda c: palettes(TEXT), "palettes: names: 'fast'; expected several, each text"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_named(name):
    call, said = WRONG[name]
    with pytest.raises(KumiteError, match=re.escape(said)):
        call(kumite.concatenate([toys.still(5)]))


def test_a_place_is_three_finite_numbers():
    assert np.array_equal(a_place([1, 2.5, 3], "ball"), [1, 2.5, 3])
    for place in ([np.nan, 0, 0], [0, np.inf, 0], [0, 0], "xyz", None, [1e300, 0, 0], [[1, 2, 3]]):
        with pytest.raises(KumiteError, match="the place of 'ball'"):
            a_place(place, "ball")


def test_a_recording_in_memory_is_checked():
    clip = toys.still(5)
    good = {
        "scene": "x", "fps": 30.0, "skeleton": clip.skeleton, "names": ("red",),
        "root_position": clip.root_position[:, None], "wxyz": clip.wxyz[:, None],
        "contacts": np.ones((5, 1, 2), bool), "library_frame": np.zeros((5, 1), int),
    }  # fmt: skip
    Recording(**good)
    for change, said in (
        ({"fps": 0}, "fps: 0; expected a number more than 0"),
        ({"names": ()}, "expected at least 1"),
        ({"names": ("a", "b")}, "expected [F, 2, 3]"),
        ({"wxyz": np.zeros((5, 1, 18, 4))}, "expected unit quaternions"),
        ({"library_frame": np.full((5, 1), 0.5)}, "expected whole numbers"),
        ({"library_frame": np.full((5, 1), -2)}, "NO_FRAME"),
        ({"events": (event(9, "done", "red"),)}, "an event in frame 9; expected 0 to 5"),
        ({"events": (event(1, "done", "blue"),)}, "unknown character of an event 'blue'"),
        ({"events": (event(1, "passed", "red"),)}, "event 'passed': 'beam' is none of the objects"),
        ({"settings": {"aims_at": ["red"]}}, "aims_at: a list; expected a mapping"),
        ({"settings": {"object_radius": {"a": "big"}}}, "object_radius of 'a': 'big'"),
    ):
        with pytest.raises(KumiteError, match=re.escape(said)):
            Recording(**{**good, **change})
