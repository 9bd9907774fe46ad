"""Arenas: nobody goes beyond the edge; who is pushed beyond it comes back."""

from __future__ import annotations

from pathlib import Path

import numba
import numpy as np
import pytest
from pydantic import ValidationError

from kumite import toml
from kumite.control.game_tree import Rules
from kumite.errors import KumiteError
from kumite.export.gltf import write_glb
from kumite.export.sheet import recording_sheet
from kumite.graph import Layer
from kumite.scene import Playback, SceneSettings, World, load_scene, record
from kumite.scene.events import Decision, Reaction
from tests.shared import builtin

SLACK = 0.1  # m: bodies sway and joins blend about where the actions lead


@pytest.fixture(scope="module")
def boxing() -> Layer:
    return builtin(level="actions")


@pytest.fixture(scope="module")
def running() -> Layer:
    return builtin("locomotion", "actions")


def _settings(name: str, **bout) -> SceneSettings:
    told = load_scene(name).model_dump(exclude_none=True)
    told["bout"].update(bout)
    return SceneSettings.model_validate(told)


def _off(scene: World, seconds: float) -> np.ndarray:
    """How far [F, K] everyone is from the middle while it runs."""
    out = []
    for _ in range(round(seconds * scene.fps)):
        scene.step()
        out.append(np.hypot(scene.root_position[:, 0], scene.root_position[:, 2]))
    return np.array(out)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_chase_stays_inside_and_nobody_had_to_break_the_rule(running: Layer, seed: int):
    scene = World(load_scene("chase"), running, seed=seed)
    scene.players[0].depth = 2
    arena = scene.tree.rules.arena
    assert arena > 0.0
    off = _off(scene, 30.0)
    assert off.max() < arena + SLACK
    assert off.max() > arena - 1.0  # the edge was met
    assert not [f for d in scene.decisions for f in d.flaws if "arena" in f]


def test_boxers_stay_in_a_ring_however_hard_they_are_hit(boxing: Layer):
    scene = World(_settings("boxing", arena=1.0, fall_from=7.0), boxing, seed=3)
    off = _off(scene, 30.0)
    assert any(isinstance(e, Reaction) for e in scene.events)
    assert np.isfinite(off).all()
    assert (off < 1.0 + SLACK).mean() > 0.6  # who is knocked out of it comes back
    assert off.max() < 2.5


@pytest.mark.parametrize("way", [(0.0, 6.0), (-5.0, -3.0)])
def test_who_is_carried_outside_comes_back(running: Layer, way: tuple[float, float]):
    scene = World(_settings("chase", scatter=0.0), running, seed=0)
    scene.players[0].depth = 2
    _off(scene, 1.0)
    scene.drag(0, np.array(way))
    begun = scene.frame
    off = _off(scene, 20.0)[:, 0]
    arena = scene.tree.rules.arena
    assert off[0] > arena + 0.5
    assert off[-1] < arena + SLACK
    back = int(np.flatnonzero(off < arena)[0])
    assert np.all(off[back:] < arena + SLACK)
    decided = next(
        e.frame
        for e in scene.events
        if isinstance(e, Decision) and e.character == scene.names[0] and e.frame > begun
    )
    # Hardly farther than what it did then: a step on which it turns round.
    assert off.max() < off[: decided - begun + 1].max() + 1.5


def test_an_arena_out_of_reach_makes_no_difference(boxing: Layer):
    free = World(_settings("boxing"), boxing, seed=2)
    wide = World(_settings("boxing", arena=900.0), boxing, seed=2)
    for _ in range(300):
        free.step()
        wide.step()
    assert free.wxyz.tobytes() == wide.wxyz.tobytes() and free.events == wide.events
    assert free.objects == [] and len(wide.objects) == 1


def test_any_number_of_threads_gives_the_same_chase(running: Layer):
    def chased(threads: int) -> tuple[bytes, list]:
        numba.set_num_threads(threads)
        scene = World(load_scene("chase"), running, seed=5)
        _off(scene, 4.0)
        return scene.wxyz.tobytes(), scene.events

    most = numba.get_num_threads()
    try:
        assert chased(1) == chased(most)
    finally:
        numba.set_num_threads(most)


def test_its_edge_is_a_line_wherever_objects_are_shown(boxing: Layer, tmp_path: Path):
    recording = record(World(_settings("boxing", arena=3.0), boxing), 0.5)
    (edge,) = Playback(recording).objects
    assert (edge.name, edge.line, edge.radius, edge.draggable) == ("arena", True, 3.0, False)
    assert np.allclose(edge.position, 0.0)
    write_glb(tmp_path / "a.glb", recording)
    assert b"arena line" in (tmp_path / "a.glb").read_bytes()
    recording_sheet(tmp_path / "a.png", recording, [0], size=(64, 48))


@pytest.mark.parametrize("radius", ["0", "-2.0", "nan", "inf", "1001.0", '"wide"'])
def test_a_radius_that_is_none_is_said_with_its_key_and_line(radius: str):
    text = f'title = "Ring"\n[bout]\narena = {radius}\n' + FIGHTERS
    with pytest.raises(KumiteError, match=r"ring\.toml:3: bout\.arena: ") as told:
        toml.parse(text, "ring.toml", SceneSettings)
    assert len(str(told.value).splitlines()) == 1


FIGHTERS = """
[[fighter]]
name = "red"
position = [0.0, -0.7]
against = "blue"
[[fighter]]
name = "blue"
position = [0.0, 0.7]
yaw_deg = 180
against = "red"
"""


def test_who_begins_outside_is_named():
    with pytest.raises(ValidationError, match=r"position of red: 0\.7 m .*bout\.arena is 0\.5 m"):
        _settings("boxing", arena=0.5)
    _settings("boxing", arena=0.7)
    with pytest.raises(ValidationError, match=r"with scatter, but bout\.arena is 0\.8 m"):
        _settings("boxing", arena=0.8, scatter=0.3)
    told = load_scene("boxing").model_dump(exclude_none=True)
    told["bout"]["arena"] = 3.0
    told["fighter"][0]["name"] = told["fighter"][1]["against"] = "arena"
    with pytest.raises(ValidationError, match="used twice: arena"):
        SceneSettings.model_validate(told)
    with pytest.raises(KumiteError, match="rules: arena"):
        Rules(arena=-1.0)


def test_a_check_point_outside_is_refused():
    fighter = '[[fighter]]\nname = "a"\nposition = [0, 1]\nagainst = "b"\n'
    other = '[[fighter]]\nname = "b"\nposition = [0, -1]\nagainst = "a"\n'
    point = "[[fighter.point]]\nplace = [0, 4]\n"
    with pytest.raises(KumiteError, match=r"check point 0 of b: 4 m from the middle.*3 m"):
        text = f'title = "t"\n{fighter}{other}{point}[bout]\narena = 3\n'
        toml.parse(text, "t.toml", SceneSettings)
