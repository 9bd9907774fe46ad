"""Controllers in order on one character, and the layers of one library that they plan on."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from kumite import caches
from kumite.control.conductor import ControllerError
from kumite.control.protocol import PASS, Plain, View
from kumite.errors import KumiteError
from kumite.graph import Layer, Library, builtin_library, pose_features
from kumite.graph.distance import squared_distances
from kumite.graph.spans import NO_STATE, Spans, entries, nearest
from kumite.scene import SceneSettings, World, load_scene, record
from kumite.scene.events import Avoided, Decision, Done, Hit, Launch, Reaction, Struck

LAYERS = ("actions", "avoidance", "preparation")


@pytest.fixture(scope="module")
def everything() -> Library:
    return builtin_library(caches.cache_folder(None), style="all", layers=LAYERS)


def ran(scene: World, seconds: float) -> World:
    for _ in range(round(seconds * scene.fps)):
        scene.step()
    return scene


def test_spans_number_the_stretches_of_all_layers(everything: Library):
    spans = Spans.of(everything, LAYERS)
    for name in LAYERS:
        table = everything.layer(name).table
        for stretch in (0, len(table.first) // 2, len(table.first) - 1):
            span = spans.span(name, stretch)
            assert spans.stretch(span) == (name, stretch)
            assert (spans.first[span], spans.last[span]) == (
                table.first[stretch],
                table.last[stretch],
            )


def test_a_capture_comes_past_states_of_its_clip(everything: Library):
    layer = everything.layer("avoidance")
    clips, states = layer.clips, set(layer.table.state_frame.tolist())
    found = entries(layer)
    for frame in range(0, len(clips), 97):
        end = clips.clip_start[clips.clip_of_frame[frame] + 1]
        ahead = [f for f in range(frame, end) if f in states]
        assert found[frame] == (ahead[0] if ahead else NO_STATE)


def test_the_nearest_end_is_the_nearest(everything: Library):
    layer = everything.layer("actions")
    only = np.arange(0, len(layer.table.last), 3)
    stretch, far = nearest(layer, only)
    features = pose_features(layer.clips)
    rows = np.arange(5, len(layer.clips), 1501)
    d = np.sqrt(np.maximum(squared_distances(features, rows, layer.table.last[only]), 0.0))
    assert np.allclose(far[rows], d.min(axis=1), atol=1e-5)
    assert np.isin(stretch, only).all()


def test_who_avoids_first_is_struck_less_and_still_fights(everything: Library):
    """Of balls that are thrown at two who fight. Other seeds: 55 to 75 % are avoided, without
    avoiding 0 to 10 %; a third to two thirds as many blows land."""
    scene = World(load_scene("under-fire"), everything)
    struck: dict[bool, int] = {}
    landed: dict[bool, int] = {}
    for avoids in (True, False):
        struck[avoids] = landed[avoids] = 0
        if not avoids:
            for controllers in scene.controllers:
                del controllers[0]
        for seed in (11, 12):
            scene.reset(seed)
            ran(scene, 40.0)
            events = scene.events
            struck[avoids] += sum(isinstance(e, Struck) for e in events)
            landed[avoids] += sum(isinstance(e, Hit) and not e.blocked for e in events)
            if avoids:
                assert sum(isinstance(e, Avoided) for e in events) >= 5
                by = {e.by for e in events if isinstance(e, Decision)}
                assert by == {"avoid", "tree"}
    assert struck[True] <= 0.55 * struck[False]
    assert landed[True] >= 0.15 * landed[False] > 0


def test_the_same_seed_gives_the_same_frames(everything: Library):
    scene = ran(World(load_scene("under-fire"), everything, seed=5), 8.0)
    first = scene.wxyz.copy(), scene.root_position.copy(), list(scene.events)
    assert any(e.by == "avoid" for e in scene.events if isinstance(e, Decision))
    scene.reset(6)
    ran(scene, 3.0)
    scene.reset(5)
    ran(scene, 8.0)
    assert np.array_equal(scene.wxyz, first[0]) and np.array_equal(scene.root_position, first[1])
    assert scene.events == first[2]


@dataclass
class Stubborn:
    """Chooses one span for a while, and writes down what it is asked."""

    span: int
    until: float
    name: str = "stubborn"
    asked: list[int] = field(default_factory=list)
    cut: int = 0

    def start(self) -> None:
        self.asked, self.cut = [], 0

    def watch(self, view: View) -> int | None:
        return None

    def choose(self, view: View) -> int:
        self.asked.append(view.frame)
        return self.span if view.seconds < self.until else PASS

    def rate(self, view: View) -> float:
        return 1.0

    def interrupted(self, view: View) -> None:
        self.cut += 1


def test_a_controller_of_ones_own_is_heard_first(fighters: Layer):
    scene = World(load_scene("boxing"), fighters, seed=2)
    idle = scene.tree.kinds.index("idle")
    mine = Stubborn(scene.spans.span("actions", idle), until=3.0)
    scene.controllers[0].insert(0, mine)
    ran(scene, 12.0)
    red = [e for e in scene.events if e.character == "red"]
    early = [e for e in red if isinstance(e, Decision) and e.frame < 3.0 * scene.fps]
    assert {e.stretch for e in early if e.by == "stubborn"} == {idle}
    assert not [e for e in early if e.by != "stubborn"]
    late = [e for e in red if isinstance(e, Decision) and e.frame >= 3.0 * scene.fps]
    assert late and all(e.by == "tree" for e in late)
    assert len(mine.asked) == len(early) + len(late)
    assert mine.cut == sum(isinstance(e, Reaction) for e in red)


def test_who_must_avoid_needs_both_layers(everything: Library, fighters: Layer):
    settings = load_scene("under-fire")
    with pytest.raises(KumiteError, match="needs the layers actions and avoidance"):
        World(settings, fighters)
    with pytest.raises(KumiteError, match="no layer 'avoidance'"):
        World(settings, Library.of(fighters))
    with pytest.raises(ValueError, match="expected another behind"):
        settings.fighter[0].__class__.model_validate(
            {**settings.fighter[0].model_dump(), "controllers": ("fight", "avoid")}
        )


# Controllers of all papers together ---------------------------------------------------------------


def test_one_prepares_avoids_and_fights(everything: Library):
    """The gauntlet: the motion at the bar is done, balls are avoided and blows thrown by one
    character, who never jumps from one place or pose to another."""
    cache = caches.cache_folder(None)
    world = World(load_scene("gauntlet"), everything, seed=1, cache=cache)
    run = record(world, 30.0)
    red = [e for e in run.events if e.character == "red"]
    assert {e.by for e in red if isinstance(e, Decision)} == {"prepare", "avoid", "tree"}
    assert any(isinstance(e, Launch) for e in red) and any(isinstance(e, Done) for e in red)
    assert any(isinstance(e, Avoided) for e in red)
    assert any(isinstance(e, Hit) for e in run.events)
    goes = np.linalg.norm(np.diff(run.root_position[:, 0], axis=0), axis=1) * run.fps
    assert goes.max() < 6.0
    turns = 2.0 * np.arccos(np.clip(np.abs(np.sum(run.wxyz[1:] * run.wxyz[:-1], -1)), 0, 1))
    assert turns[:, 0].max() * run.fps < 60.0  # rad/s: in captured punches up to 48


def test_two_teams_of_mixed_controllers_strike_only_each_other(everything: Library):
    world = ran(World(load_scene("melee"), everything, seed=4, cache=caches.cache_folder(None)), 20)
    team = {p.name: p.team for p in world.settings.people}
    hits = [e for e in world.events if isinstance(e, Hit)]
    assert len(hits) >= 5 and all(team[e.character] != team[e.victim] for e in hits)
    decided = {(e.character, e.by) for e in world.events if isinstance(e, Decision)}
    assert {("red 3", "policy"), ("blue 1", "tree"), ("blue 2", "policy")} <= decided


# From without ------------------------------------------------------------------------------------


def _led(library: Layer, *controllers: str) -> World:
    """Red is led from without; blue fights it."""
    red = {"name": "red", "position": (0, -0.7), "controllers": controllers}
    blue = {"name": "blue", "position": (0, 0.7), "yaw_deg": 180, "against": "red"}
    blue["fight"] = {"by": "tree"}
    settings = {"title": "led", "character": [red, blue]}
    return World(SceneSettings.model_validate(settings), library, seed=3)


def test_a_character_is_led_a_step_at_a_time(fighters: Layer):
    world = _led(fighters, "external")
    draw, chosen = np.random.default_rng(0), []
    for _ in range(600):
        choices = {}
        if "red" in world.waiting:
            options = world.options("red")
            assert len(options) and np.all(options < len(world.spans.first))
            choices["red"] = int(draw.choice(options))
            chosen.append(choices["red"])
        world.step(choices)
    told = [e for e in world.events if isinstance(e, Decision) and e.character == "red"]
    assert len(chosen) > 5 and all(e.by == "external" for e in told)
    assert [world.spans.span("actions", e.stretch) for e in told] == chosen


def test_without_a_choice_it_stands(fighters: Layer):
    world = _led(fighters, "external")
    while "red" not in world.waiting:
        world.step()
    for _ in range(5):
        world.step()
    frame = int(world.cast.frame[0])
    for _ in range(20):
        if not any(isinstance(e, Reaction) for e in world.events):
            world.step()
            assert int(world.cast.frame[0]) == frame and "red" in world.waiting


def test_choices_for_who_does_not_wait_are_refused(fighters: Layer):
    world = _led(fighters, "external")
    with pytest.raises(KumiteError, match=r"unknown character 'rde'.*red"):
        world.step({"rde": 0})
    while "red" not in world.waiting:
        world.step()
    with pytest.raises(KumiteError, match="chose span -3; expected PASS or a number from 0"):
        world.step({"red": -3})
    world.step({"red": int(world.options("red")[0])})
    with pytest.raises(KumiteError, match="a choice for red, who is in an action"):
        world.step({"red": 0})
    with pytest.raises(KumiteError, match="red is in an action"):
        world.options("red")


def test_a_function_is_a_controller(fighters: Layer):
    world = World(load_scene("boxing"), fighters, seed=2)
    idle = world.spans.span("actions", world.tree.kinds.index("idle"))

    def rest(view: View) -> int:
        return idle if view.seconds < 2.0 else PASS

    world.character("red").controllers.insert(0, rest)  # type: ignore[arg-type]
    ran(world, 8.0)
    red = [e for e in world.events if isinstance(e, Decision) and e.character == "red"]
    assert {e.by for e in red if e.frame < 2.0 * world.fps} == {"rest"}
    assert {e.by for e in red if e.frame >= 2.0 * world.fps} == {"tree"}


class Wrong(Plain):
    """Chooses what there is not, or fails, from its second choice on."""

    name = "wrong"

    def __init__(self, what: object, layer: str | None = None) -> None:
        self.what, self.layer, self.times = what, layer, 0

    def start(self) -> None:
        self.times = 0

    def choose(self, view: View) -> int:
        self.times += 1
        if self.times < 2:
            return PASS
        if isinstance(self.what, Exception):
            raise self.what
        return self.what  # type: ignore[return-value]


@pytest.mark.parametrize(
    ("what", "layer", "said"),
    [
        (ZeroDivisionError("by nothing"), None, "'wrong' of red failed in choose: by nothing"),
        (10**9, None, "'wrong' of red chose span 1000000000; expected PASS or a number from 0"),
        ("jab", None, "'wrong' of red chose span 'jab'"),
        (None, None, "'wrong' of red chose span None"),
        (0, "avoidance", "chose span 0 of layer 'actions'; expected one of its own, 'avoidance'"),
    ],
)
def test_a_controller_that_fails_stops_the_world_and_loses_nothing(
    everything: Library, what: object, layer: str | None, said: str
):
    world = World(load_scene("under-fire"), everything, seed=1)
    world.character("red").controllers.insert(0, Wrong(what, layer))
    with pytest.raises(ControllerError, match=said) as failed:
        record(world, 20.0)
    kept = failed.value.recording
    assert f"frame {world.frame}:" in str(failed.value)
    assert len(kept) == world.frame + 1 and len(kept.events) == len(world.events)
    with pytest.raises(ControllerError, match=said):  # it goes no further …
        world.step()
    world.character("red").controllers.pop(0)
    world.reset(1)  # … until it begins again
    assert world.step()
