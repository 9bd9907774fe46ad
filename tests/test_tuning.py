"""Numbers that may be changed while a scene runs: bounds, names, and that they count."""

from __future__ import annotations

import ast
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from kumite import studio
from kumite.cli.scenes import _live_scene, _settings
from kumite.control.tuning import Tunable, find
from kumite.errors import KumiteError

HELD = {"x": 3.0}
ONE = Tunable(
    "red",
    "tree",
    "given_short",
    "m",
    0.0,
    10.0,
    "linear",
    "a help",
    "style.given_short",
    lambda: HELD["x"],
    lambda value: HELD.update(x=value),
)


def test_a_tunable_keeps_its_bounds_and_says_what_is_wrong():
    assert ONE.name == "red: tree: given short" and ONE.value == 3.0
    ONE.set(4)
    assert ONE.value == 4.0
    for bad in (-0.1, 10.1, float("nan"), float("inf"), "3", True, None):
        with pytest.raises(KumiteError, match=r"red: tree: given short: .*; expected 0 to 10 m"):
            ONE.set(bad)  # type: ignore[arg-type]
    assert ONE.value == 4.0
    assert find([ONE], ONE.name) is ONE
    with pytest.raises(KumiteError, match="did you mean 'red: tree: given short'"):
        find([ONE], "red: tree: given shrt")
    with pytest.raises(KumiteError, match="expected a range"):
        replace(ONE, minimum=10.0)
    with pytest.raises(KumiteError, match="log from -1"):
        replace(ONE, minimum=-1.0, scale="log")


def test_sliders_of_decades_are_logarithmic():
    log = replace(ONE, scale="log", maximum=1e6)
    assert log.at(0.0) == 0.0 and log.at(1.0) == 1e6
    assert log.at(0.5) == pytest.approx(1e3) and log.share(1e3) == pytest.approx(0.5)
    assert log.share(0.0) == 0.0 and log.share(1e6) == pytest.approx(1.0)
    assert ONE.at(0.25) == 2.5 and ONE.share(2.5) == 0.25
    assert replace(ONE, whole=True).at(0.33) == 3.0


@cache
def scene(name: str):
    return _live_scene(_settings(name, None, None), None, 2)


@pytest.mark.parametrize("name", ["boxing", "under-fire", "sparring", "slip", "dodgeball", "brawl"])
def test_all_go_to_both_bounds_and_back_while_a_scene_runs(name: str):
    stage = scene(name)
    every = stage.tunables
    assert len({t.name for t in every}) == len(every) > 0 and every[0].help and every[0].key
    for t in every:
        before = t.value
        for value in (t.minimum, t.maximum):
            t.set(value)
            assert stage.tunable(t.name).value == pytest.approx(value, rel=1e-6)
        stage.step()
        t.set(before)
        assert t.value == pytest.approx(before, rel=1e-6)


def test_every_number_has_its_key_in_the_scene_file():
    for name in ("boxing", "slip", "dodgeball", "brawl"):
        stage = scene(name)
        known = {key for s in _keys(stage.settings) for key in s}
        for t in stage.tunables:
            assert t.key.rsplit(".", 1)[-1] in known | {"approach", "strike"}, t.name


def _keys(settings) -> list[list[str]]:
    from kumite.control.styles import NAMES
    from kumite.scene.settings_dodge import AttackerSettings, DodgerSettings, DodgeSettings
    from kumite.scene.settings_fight import BoutSettings, FighterSettings
    from kumite.scene.settings_prepare import OpponentsSettings

    models = (AttackerSettings, DodgerSettings, DodgeSettings, BoutSettings, FighterSettings)
    return [
        list(NAMES),
        ["legs", "upper"],
        *(list(m.model_fields) for m in (*models, OpponentsSettings)),
    ]


def test_each_kind_changes_what_happens():
    """The same seed twice, once with a number set: what follows differs."""
    for name, field, value in (
        ("boxing", "red: tree: taken", 0.0),
        ("boxing", "tree: attack range", 0.2),
        ("boxing", "world: stagger from", 0.5),
        ("sparring", "red: policy: strike", 0.0),
        ("dodgeball", "avoid: clearance", 0.3),
        ("dodgeball", "dodger: avoid: reaction", 1.0),
        ("ball-kick", "prepare: upper", 0.05),
    ):
        stage, found = scene(name), []
        tunable = stage.tunable(field)
        before = tunable.value
        for now in (before, value):
            tunable.set(now)
            stage.reset(5)
            if name == "dodgeball":
                stage.streams = True
            shown = np.zeros_like(stage.wxyz)
            for _ in range(round(8.0 * stage.fps)):
                stage.step()
                shown = shown + stage.wxyz
            found.append(shown.tobytes())
        tunable.set(before)
        assert found[0] != found[1], field


def test_the_studio_does_not_ask_which_scene_it_shows():
    scenes = {"World", "EvasionScene", "PrepareScene"}
    for path in Path(studio.__file__).parent.glob("*.py"):
        tree = ast.parse(path.read_text())
        imported = {
            alias.name
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom)
            for alias in node.names
        }
        assert not imported & scenes, path.name
