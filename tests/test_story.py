"""What happens at a moment of a scene: cues change what they name, vehicles run people over."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from kumite.control import STYLES, CheckPoint, Progress, Route
from kumite.errors import KumiteError
from kumite.export.gltf import write_glb
from kumite.export.sheet import recording_sheet
from kumite.graph import Layer
from kumite.scene import (
    Playback,
    SceneSettings,
    World,
    load_recording,
    load_scene,
    record,
    save_recording,
)
from kumite.scene.events import Cue, Decision, Hit, Reaction, RunOver, Strike
from kumite.scene.look import car
from kumite.scene.settings_fight import CueSettings, VehicleSettings
from kumite.scene.story import BRAKE, CLEAR, Story, Vehicle
from tests.shared import builtin

FPS = 60.0


class Walkers:
    """Who may be met: roots that are dragged, and a note of all that was asked for."""

    def __init__(self, places, names: tuple[str, ...] = ("red", "blue", "green")) -> None:
        self.names = names
        self.root_position = np.array([[x, 0.9, z] for x, z in places], dtype=float)
        self.progress: list[Progress | None] = [None] * len(places)
        self.cues: list[CueSettings] = []
        self.struck: list[tuple[int, str, float]] = []

    def take_cue(self, cue: CueSettings) -> None:
        self.cues.append(cue)

    def run_over(self, k: int, by: str, speed: float) -> None:
        self.struck.append((k, by, speed))

    def drag(self, k: int, way: np.ndarray) -> None:
        self.root_position[k, [0, 2]] += way


def _vehicle(**changes) -> VehicleSettings:
    given = {"name": "car", "at": 1.0, "start": (-10.0, 2.0), "end": (10.0, 2.0), "speed": 8.0}
    return VehicleSettings.model_validate({**given, **changes})


# Vehicles ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("end", [(10.0, 2.0), (-10.0, -9.0), (-2.0, 8.0)])
def test_a_vehicle_drives_at_its_speed_from_its_moment_to_its_end(end: tuple[float, float]):
    settings = _vehicle(end=end)
    story, far = Story((), (settings,), FPS), Walkers([(500.0, 500.0)])
    start, way = np.array(settings.start), np.subtract(end, settings.start)
    length = np.linalg.norm(way)
    for f in range(300):
        story.step(far, f / FPS)
        driven = min(8.0 * max(f / FPS - 1.0 + 1.0 / FPS, 0.0), length)
        (body,) = story.objects
        assert np.allclose(body.position[[0, 2]], start + driven * way / length)
        assert body.position[1] == 0.5 * settings.size[1] and body.size == settings.size
        assert np.allclose([np.sin(body.yaw), np.cos(body.yaw)], way / length)
    assert not far.struck


def test_those_in_its_way_are_run_over_once_and_nobody_else():
    width = 0.5 * _vehicle().size[0] + CLEAR
    in_way, beside = (0.0, 2.0 + width - 0.01), (0.0, 2.0 - width - 0.01)
    met = Walkers([in_way, beside, (30.0, 2.0)])
    vehicle = Vehicle(_vehicle())
    for _ in range(300):
        vehicle.step(met, 1.0 / FPS)
    assert [(k, by) for k, by, _ in met.struck] == [(0, "car")]
    assert met.struck[0][2] == pytest.approx(8.0)
    assert np.allclose(met.root_position[1:, [0, 2]], [beside, (30.0, 2.0)])


def test_it_brakes_and_carries_whom_it_has_met_before_it():
    met = Walkers([(0.0, 2.3)])
    vehicle = Vehicle(_vehicle(end=(50.0, 2.0)))
    front = 0.5 * vehicle.settings.size[2] + CLEAR
    at, places = [], []
    for _ in range(300):
        vehicle.step(met, 1.0 / FPS)
        at.append(vehicle.body.position[0])
        places.append(met.root_position[0, [0, 2]].copy())
    stopped = 0.0 - front + 8.0**2 / (2.0 * BRAKE)
    assert at[-1] == at[-60] == pytest.approx(stopped, abs=2.0 * 8.0 / FPS)
    speed = np.diff(at) * FPS
    assert np.all(np.diff(speed) < 1e-6) and np.diff(speed).min() == pytest.approx(-BRAKE / FPS)
    assert np.allclose(np.diff(np.array(places)[:, 1]), 0.0)  # straight on, not aside
    assert places[-1][0] == pytest.approx(at[-1] + front, abs=8.0 / FPS)


def test_one_that_stands_runs_nobody_over():
    inside = Walkers([(-10.0, 2.0)])
    story = Story((), (_vehicle(at=5.0),), FPS)
    for f in range(200):
        story.step(inside, f / FPS)
    assert not inside.struck
    vehicle = Vehicle(_vehicle())
    for _ in range(300):
        vehicle.step(Walkers([(500.0, 0.0)]), 1.0 / FPS)
    arrived = Walkers([(10.0, 2.0)])
    vehicle.step(arrived, 1.0 / FPS)
    assert not arrived.struck


def test_who_is_above_it_is_not_met():
    above = Walkers([(0.0, 2.0)])
    above.root_position[0, 1] = 1.6
    vehicle = Vehicle(_vehicle())
    for _ in range(300):
        vehicle.step(above, 1.0 / FPS)
    assert not above.struck


@pytest.mark.parametrize("size", [(1.8, 1.5, 4.2), (2.5, 3.0, 7.0)])
def test_a_car_fills_its_box_and_is_closed(size: tuple[float, float, float]):
    parts = car(size)
    low = np.min([p.vertices.min(axis=0) for p in parts], axis=0)
    high = np.max([p.vertices.max(axis=0) for p in parts], axis=0)
    assert np.allclose(high, 0.5 * np.array(size), atol=0.02)
    assert np.allclose(low, -0.5 * np.array(size), atol=0.02)
    for part in parts:
        corners = part.vertices[part.faces]
        outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert np.all(np.sum(outward * part.normals[part.faces[:, 0]], axis=1) > 0)
        assert np.allclose(outward.sum(axis=0), 0.0, atol=1e-4)  # no side is missing
        assert np.sum(outward * corners[:, 0]) > 0  # six times what it holds, if not inside out


# Cues --------------------------------------------------------------------------------------------


def _cue(**told) -> CueSettings:
    return CueSettings.model_validate({"who": "red", "depth": 1, **told})


def test_a_cue_comes_once_at_its_time():
    walkers, story = Walkers([(0.0, 0.0)]), Story((_cue(at=0.5),), (), FPS)
    for f in range(60):
        story.step(walkers, f / FPS)
        assert len(walkers.cues) == (f / FPS >= 0.5)


def test_a_cue_comes_when_all_whom_it_waits_for_are_there():
    walkers = Walkers([(0.0, 0.0), (0.0, 0.0)])
    points = tuple(CheckPoint((0.0, z), time=2.0 * z + 1.0) for z in (0.0, 2.0, 4.0))
    progress = [Progress(Route(points)) for _ in range(2)]
    walkers.progress = [*progress]
    one, both = _cue(after="blue", check_point=1), _cue(after=("red", "blue"), depth=2)
    story = Story((one, both), (), FPS)

    def there(k: int, z: float, seconds: float) -> list[CueSettings]:
        progress[k].update((0.0, z), seconds)
        story.step(walkers, seconds)
        return walkers.cues

    assert there(1, 0.0, 1.0) == []
    assert there(1, 1.9, 1.5) == [one]  # there, though it is to wait until its time
    assert there(1, 2.0, 5.0) == [one]
    assert there(1, 4.0, 9.0) == [one]
    for z, seconds in ((0.0, 10.0), (2.0, 10.5)):
        assert there(0, z, seconds) == [one]
    assert there(0, 4.0, 11.0) == [one, both]
    assert there(0, 4.0, 12.0) == [one, both]


@pytest.fixture(scope="module")
def actions() -> Layer:
    return builtin(level="actions")


def _settings(**more) -> dict[str, Any]:
    settings = load_scene("boxing").model_dump(exclude_none=True)
    third = {"name": "green", "position": (3.0, 0.0), "against": "red", "only": ("idle",)}
    settings["fighter"] = [*settings["fighter"], third]
    return {**settings, **more}


def _scene(actions: Layer, **more) -> World:
    return World(SceneSettings.model_validate(_settings(**more)), actions, seed=1)


CHANGED = {
    "style": ({"style": "infighter"}, STYLES["infighter"]),
    "depth": ({"depth": 2}, 2),
    "wanted": ({"wanted": ["attack"]}, ("attack",)),
    "unwanted": ({"unwanted": ["attack"]}, ("attack",)),
    "only": ({"only": ["idle"]}, ("idle",)),
}


@pytest.mark.parametrize("field", CHANGED)
def test_a_cue_changes_what_it_names_and_a_restart_takes_it_back(actions: Layer, field: str):
    told, expected = CHANGED[field]
    scene = _scene(actions, cue=[{"who": "red", "at": 0.05, **told}])
    before = copy.deepcopy(scene.players)
    opponents = scene.floor.opponent.copy()
    for _ in range(6):
        scene.step()
    for k, (was, now) in enumerate(zip(before, scene.players)):
        for name, value in vars(was).items():
            changed = k == 0 and name == field
            assert getattr(now, name) == (expected if changed else value)
    assert np.array_equal(scene.floor.opponent, opponents)
    (event,) = [e for e in scene.events if isinstance(e, Cue)]
    frame, _, who, said = event.to_json()
    assert (frame, who, set(said)) == (3, "red", {field})
    scene.reset(1)
    assert scene.players == before


def test_a_cue_gives_another_opponent_and_another_route(actions: Layer):
    point = {"place": (2.0, 1.0), "radius": 0.3}
    cue = {"who": "blue", "at": 0.05, "against": "green", "point": [point]}
    scene = _scene(actions, cue=[cue])
    for _ in range(6):
        scene.step()
    assert scene.floor.opponent.tolist() == [1, 2, 0]
    progress = scene.progress[1]
    assert progress is not None and progress.route.points == (CheckPoint((2.0, 1.0), radius=0.3),)
    scene.reset(1)
    assert scene.floor.opponent.tolist() == [1, 0, 0] and scene.progress[1] is None


def test_who_is_run_over_falls_and_lies_and_the_other_only_idles(actions: Layer):
    settings = _settings(
        vehicle=[{"name": "car", "at": 0.2, "start": (-9.0, 1.2), "end": (9.0, 1.2), "speed": 14.0}]
    )
    settings["fighter"][0]["position"] = (0.0, -0.6)
    settings["fighter"][1].update(stays_down=True, position=(0.0, 1.2))
    scene = World(SceneSettings.model_validate(settings), actions, seed=0)
    for _ in range(8 * round(scene.fps)):
        scene.step()
    (over,) = [e for e in scene.events if isinstance(e, RunOver)]
    assert over.character == "blue" and over.vehicle == "car"
    assert over.speed == pytest.approx(14.0)
    assert scene.root_position[1, 1] < 0.4  # it lies
    later = [e for e in scene.events if e.frame > over.frame + 2 * scene.fps]
    assert not [e for e in later if isinstance(e, Decision) and e.character == "blue"]
    chosen = [e.stretch for e in later if isinstance(e, Decision) and e.character == "red"]
    assert chosen and {scene.tree.kinds[s] for s in chosen} == {"idle"}
    assert not [e for e in later if e.kind in ("strike", "hit")]


def test_a_recording_shows_the_vehicle_wherever_objects_are_shown(actions: Layer, tmp_path):
    vehicle = {"name": "car", "at": 0.1, "start": (5.0, -6.0), "end": (5.0, 9.0), "size": (2, 1, 4)}
    scene = _scene(actions, vehicle=[vehicle])
    save_recording(tmp_path / "v.rec", record(scene, 1.0))
    recording = load_recording(tmp_path / "v.rec")
    play = Playback(recording)
    (thing,) = play.objects
    assert (thing.name, thing.size, thing.draggable) == ("car", (2.0, 1.0, 4.0), False)
    assert thing.wheels and recording.settings["object_wheels"] == ["car"]
    assert thing.yaw == pytest.approx(0.0)
    assert np.allclose(thing.position, [5.0, 0.5, -6.0], atol=1e-5)
    play.seek(len(recording) - 1)
    assert thing.position[2] > -1.0
    write_glb(tmp_path / "v.glb", recording)
    recording_sheet(tmp_path / "v.png", recording, [0, 30], size=(64, 48))
    assert b"car paint" in (tmp_path / "v.glb").read_bytes()


# What is refused ---------------------------------------------------------------------------------

ROUTE = [{"place": (0.0, z)} for z in (0.0, 1.0, 2.0)]
WRONG = {
    "somebody unknown": ("cue", {"who": "ann", "at": 1.0, "depth": 2}, "for 'ann'"),
    "an unknown opponent": ("cue", {"who": "red", "at": 1.0, "against": "ann"}, "against 'ann'"),
    "against oneself": ("cue", {"who": "red", "at": 1.0, "against": "red"}, "against 'red'"),
    "nothing": ("cue", {"who": "red", "at": 1.0}, "changes nothing; expected one of against"),
    "no moment": ("cue", {"who": "red", "depth": 2}, 'expected "at"'),
    "two moments": ("cue", {"who": "red", "at": 1.0, "after": "red", "depth": 2}, 'expected "at"'),
    "nobody to wait for": ("cue", {"who": "red", "after": [], "depth": 2}, "after"),
    "an unknown style": ("cue", {"who": "red", "at": 1.0, "style": "wrestler"}, "wrestler"),
    "too deep": ("cue", {"who": "red", "at": 1.0, "depth": 99}, "depth"),
    "after a stranger": ("cue", {"who": "red", "after": "ann", "depth": 2}, "after 'ann'"),
    "no route": ("cue", {"who": "red", "after": "blue", "depth": 2}, "after 'blue' at check point"),
    "one of two without a route": (
        "cue",
        {"who": "red", "after": ["red", "blue"], "depth": 2},
        "after 'blue'",
    ),
    "no such check point": (
        "vehicle",
        {"name": "car", "after": "red", "check_point": 3, "start": (0.0, 0.0), "end": (1.0, 0.0)},
        "after 'red' at check point 3",
    ),
    "no way": (
        "vehicle",
        {"name": "car", "at": 1.0, "start": (1.0, 2.0), "end": (1.0, 2.0)},
        "start and end are the same",
    ),
    "a name used twice": (
        "vehicle",
        {"name": "red", "at": 1.0, "start": (0.0, 0.0), "end": (1.0, 0.0)},
        "used twice: red",
    ),
    "no speed": (
        "vehicle",
        {"name": "car", "at": 1.0, "start": (0.0, 0.0), "end": (1.0, 0.0), "speed": 0.0},
        "speed",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_bad_settings_are_refused_and_said(what: str):
    part, told, said = WRONG[what]
    settings = _settings(**{part: [told]})
    settings["fighter"][0]["point"] = ROUTE
    with pytest.raises(ValidationError, match=said):
        SceneSettings.model_validate(settings)


@pytest.mark.parametrize("check_point", [-3, 0, 2])
def test_check_points_count_from_either_end(check_point: int):
    settings = _settings(
        cue=[{"who": "red", "after": "red", "check_point": check_point, "depth": 2}]
    )
    settings["fighter"][0]["point"] = ROUTE
    assert SceneSettings.model_validate(settings).cue[0].check_point == check_point


@pytest.mark.parametrize("orders", [{"wanted": ["dance"]}, {"only": ["dance"]}, {"only": ["fall"]}])
def test_cues_of_unknown_actions_are_refused(actions: Layer, orders: dict):
    with pytest.raises(KumiteError, match="cue of red"):
        _scene(actions, cue=[{"who": "red", "at": 1.0, **orders}])


# The built-in scenes -----------------------------------------------------------------------------


def _run(name: str, seconds: float, seed: int) -> World:
    settings = load_scene(name)
    assert settings.bout is not None
    library = builtin(settings.bout.library, "actions")
    scene = World(settings, library, seed=seed)
    for _ in range(round(seconds * scene.fps)):
        scene.step()
    return scene


def _hits_on(scene: World, name: str) -> int:
    return sum(isinstance(e, Hit) and e.victim == name and not e.blocked for e in scene.events)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_the_strong_enemy_is_run_over_and_the_hero_is_not(seed: int):
    scene = _run("car", 26.0, seed)
    over = [e for e in scene.events if isinstance(e, RunOver)]
    assert [e.character for e in over] == ["blue"]
    assert _hits_on(scene, "red") > _hits_on(scene, "blue")
    assert scene.root_position[1, 1] < 0.4 and scene.root_position[0, 1] > 0.6
    assert scene.root_position[0, 2] > 3.8  # over the street


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_the_friend_steps_in_and_knocks_the_enemy_down(seed: int):
    scene = _run("alley", 30.0, seed)
    (fall,) = [e for e in scene.events if isinstance(e, Reaction) and e.size == "fall"]
    assert fall.character == "blue"
    blow = [e for e in scene.events if isinstance(e, Hit) and e.frame == fall.frame]
    assert [e.character for e in blow if not e.blocked] == ["green"]
    cues = [e.frame for e in scene.events if isinstance(e, Cue)]
    assert max(cues) < fall.frame
    assert scene.root_position[1, 1] < 0.5
    later = [e for e in scene.events if e.frame > fall.frame + 2 * scene.fps]
    assert not [e for e in later if isinstance(e, Strike)]
