"""Controllers in order on one character, and the layers of one library that they plan on."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from kumite import caches
from kumite.control.protocol import PASS, View
from kumite.errors import KumiteError
from kumite.graph import Layer, Library, builtin_library, pose_features
from kumite.graph.distance import squared_distances
from kumite.graph.spans import NO_STATE, Spans, entries, nearest
from kumite.scene import World, load_scene
from kumite.scene.events import Avoided, Decision, Hit, Reaction, Struck

LAYERS = ("actions", "avoidance")


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
