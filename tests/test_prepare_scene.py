"""Scenes of people who prepare: what they show, what they write, what is refused."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from kumite.errors import KumiteError
from kumite.graph import Layer, save_library
from kumite.rotation import angle
from kumite.scene import PrepareScene, load_scene, record, with_count
from kumite.scene.events import Hit, Launch, MovedGoal, Passed, Touched
from kumite.scene.settings import SceneSettings
from kumite.scene.walkers import NOTHING, OFF, ON_THE_WAY, STEEPEST
from tests.shared import builtin

TARGETS = [
    {"name": "ball", "kind": "kick", "position": (0.5, 3.0)},
    {"name": "bar", "kind": "duck_under", "position": (4.0, 0.0), "yaw_deg": 90.0},
]


@pytest.fixture(scope="module")
def targets() -> Layer:
    return builtin("targets", "preparation")


@pytest.fixture(scope="module")
def learned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("learned")


@pytest.fixture(scope="module")
def built(targets: Layer, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A library file, in a folder of its own."""
    path = tmp_path_factory.mktemp("built") / "targets.kumite"
    save_library(path, targets)
    return path


def settings(**given) -> SceneSettings:
    new = {"title": "t", "about": "a", "walker": [{"name": "anna", "position": (0.0, 0.0)}]}
    return SceneSettings.model_validate({**new, "target": TARGETS, **given})


def scene_of(library: Layer, learned: Path, seed: int = 0, **given) -> PrepareScene:
    return PrepareScene(settings(**given), library, seed=seed, cache=learned)


# What is shown -----------------------------------------------------------------------------------


@pytest.mark.parametrize("preparation", ["ours", "linear", "none"])
def test_things_are_done_without_jumps(targets: Layer, learned: Path, preparation: str):
    scene = scene_of(targets, learned, prepare={"preparation": preparation})
    w, fps = scene.walkers, scene.fps
    before = w.shown.position.copy(), w.shown.wxyz.copy(), 0.0, True
    turned = []
    for _ in range(round(25 * fps)):
        scene.step()
        position, wxyz, alpha = w.shown.position, w.shown.wxyz, float(w.alpha[0])
        moved = np.linalg.norm(position - before[0], axis=-1).max() * fps
        assert moved < 13.0  # m/s: a foot that kicks
        turned.append(float(angle(before[1], wxyz).max()) * fps)
        on_the_way = bool(w.doing[0] == ON_THE_WAY)
        assert 0.0 <= alpha <= 1.0 and 0.0 <= w.level[0] <= 1.0
        if on_the_way and before[3]:
            assert abs(alpha - before[2]) < STEEPEST / fps + 1e-9
        before = position.copy(), wxyz.copy(), alpha, on_the_way
    assert max(turned) < 30.0  # rad/s
    launches = [e for e in scene.events if isinstance(e, Launch)]
    assert {e.motion for e in launches} == {"kick_ball", "duck_under"}
    assert all(e.bent is not None and e.bent <= OFF for e in launches)
    hits = [e for e in scene.events if isinstance(e, Hit)]
    assert hits and all(e.part == "ball" for e in hits)
    assert all(e.clearance > 0 for e in scene.events if isinstance(e, Passed))
    assert any(isinstance(e, Passed) for e in scene.events)
    assert not any(isinstance(e, Touched) for e in scene.events)
    for event in launches:
        # The pose shown is taken over: what jumps at a launch is at most what a frame turns.
        at = turned[event.frame - 1 : event.frame + 3]
        assert max(at) < 12.0, event


def test_who_prepares_begins_nearer_to_the_posture(targets: Layer, learned: Path):
    apart = {}
    for preparation in ("ours", "none"):
        scene = scene_of(targets, learned, prepare={"preparation": preparation})
        for _ in range(round(20 * scene.fps)):
            scene.step()
        found = [e.apart_deg for e in scene.events if isinstance(e, Launch)]
        apart[preparation] = float(np.mean(found))
    assert apart["ours"] < 0.4 * apart["none"]


def _between_beams(targets: Layer, learned: Path, apart: float) -> tuple[float, float]:
    """Mean level and least height of the pelvis between two crawls, the beams so far apart [m]."""
    beams = [
        {"name": f"beam {n}", "kind": "crawl_under", "position": (0.0, 3.0 + n * apart)}
        for n in range(2)
    ]
    walker = {"name": "anna", "position": (0.0, -1.0), "goes_to": ("beam 0", "beam 1")}
    scene = scene_of(targets, learned, target=beams, walker=[walker])
    pelvis = targets.clips.skeleton.joint("pelvis")
    levels, heights, launches = [], [], 0
    for _ in range(round(40 * scene.fps)):
        known = len(scene.events)
        scene.step()
        launches += sum(isinstance(e, Launch) for e in scene.events[known:])
        if launches == 2:
            break
        if launches == 1 and scene.walkers.doing[0] == ON_THE_WAY:
            levels.append(float(scene.walkers.alpha[0]))
            heights.append(float(scene.walkers.shown.position[0, pelvis, 1]))
    assert launches == 2
    return float(np.mean(levels)), float(np.max(heights))


def test_between_close_beams_the_style_is_kept_up(targets: Layer, learned: Path):
    """Section 7: two obstacles in sequence. Far apart one stands up in between."""
    near, far = (_between_beams(targets, learned, apart) for apart in (2.2, 6.0))
    assert near[0] > far[0] + 0.2
    assert near[1] < far[1] - 0.03


@pytest.mark.parametrize("preparation", ["ours", "none"])
def test_who_has_passed_an_obstacle_turns_round_and_comes_back(
    targets: Layer, learned: Path, preparation: str
):
    """Three alone with an obstacle each: nobody lingers before it, nobody touches it."""
    motions = ("duck_under", "crawl_under", "jump_over")
    things = [{"name": m, "kind": m, "position": (30.0 * n, 3.0)} for n, m in enumerate(motions)]
    walkers = [
        {"name": f"to {m}", "position": (30.0 * n, -1.0), "goes_to": (m,)}
        for n, m in enumerate(motions)
    ]
    scene = scene_of(
        targets, learned, target=things, walker=walkers, prepare={"preparation": preparation}
    )
    for _ in range(round(40 * scene.fps)):
        scene.step()
    for m in motions:
        begun = [e.frame for e in scene.events if isinstance(e, Launch) and e.motion == m]
        gaps = np.diff([0, *begun, scene.frame]) / scene.fps
        assert len(begun) >= 4 and gaps.max() < 11.0, (m, gaps)
    passed = [e.clearance for e in scene.events if isinstance(e, Passed)]
    assert len(passed) >= 9 and min(passed) > 0
    assert not any(isinstance(e, Touched) for e in scene.events)


# What is told by hand ----------------------------------------------------------------------------


def test_led_by_hand(targets: Layer, learned: Path):
    scene = scene_of(targets, learned, prepare={"automatic": False})
    np.testing.assert_array_equal(scene.go(0, np.array([1.0, 1.0])), [1.0, 1.0])
    assert not scene.events
    # Into the bar: to the nearer side of it.
    for x, expected in ((4.1, 4.6), (3.9, 3.4)):
        place = scene.go(0, np.array([x, 0.2]))
        np.testing.assert_allclose(place, [expected, 0.2], atol=1e-9)
        told = scene.events[-1]
        assert isinstance(told, MovedGoal) and told.thing == "bar"
    with pytest.raises(KumiteError, match="goal: expected two finite numbers"):
        scene.go(0, np.array([np.nan, 0.0]))
    with pytest.raises(KumiteError, match="thing"):
        scene.go_to(0, "sofa")
    with pytest.raises(KumiteError, match="target motion"):
        scene.trigger(0, "fly")
    assert scene.trigger(0, "punch") and scene.walkers.doing[0] != ON_THE_WAY
    assert not scene.trigger(0, "kick_ball")  # busy
    for _ in range(round(5 * scene.fps)):
        scene.step()
    assert scene.walkers.doing[0] == ON_THE_WAY and scene.trigger(0, "kick_ball")


@pytest.mark.parametrize("made_for", [0, 1])
def test_what_somebody_makes_for_is_told_by_its_heading(
    targets: Layer, learned: Path, made_for: int
):
    aside = [
        {"name": "ball", "kind": "kick", "position": (1.5, 3.0)},
        {"name": "pad", "kind": "punch", "position": (-1.5, 3.0)},
    ]
    scene = scene_of(targets, learned, target=aside, prepare={"automatic": False})
    w = scene.walkers
    scene.go(0, np.array(aside[made_for]["position"]))
    scene.step()
    np.testing.assert_allclose(scene.belief[0], 0.5, atol=1e-3)  # it stands between them
    motions = scene.things.motion
    like, half = w.like, np.eye(len(w.like))[motions].sum(axis=0) / 2
    np.testing.assert_allclose(w.mix[0], half, atol=1e-3)
    # What is prepared for is in between, before anybody sees it.
    both = angle(like.wxyz[motions[0]], like.wxyz[motions[1]])
    joint = int(np.argmax(both))
    for m in motions:
        off = angle(w.shown.postures.wxyz[0, joint], like.wxyz[m, joint])
        assert off == pytest.approx(0.5 * both[joint], abs=0.03)
    sure = []
    for _ in range(round(2 * scene.fps)):
        scene.step()
        assert w.mix[0].sum() == pytest.approx(1.0, abs=1e-12)
        assert w.mix[0, motions[made_for]] == scene.belief[0, made_for]
        sure.append(float(scene.belief[0, made_for]))
    assert sure[-1] > 0.9 and np.argmax(sure) > scene.fps
    assert w.wants[0] == motions[made_for]
    np.testing.assert_allclose(w.source[0], aside[made_for]["position"])
    # With nothing ahead there is nothing to prepare for.
    scene.go(0, np.array([0.0, -20.0]))
    for _ in range(round(5 * scene.fps)):
        scene.step()
    assert np.all(scene.belief[0] == 0.0) and np.all(w.mix[0] == 0.0) and w.wants[0] == NOTHING


# The same again ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["ball-kick", "brawl", "drill"])
def test_same_seed_same_frames(targets: Layer, learned: Path, name: str):
    scene = PrepareScene(load_scene(name), targets, seed=3, cache=learned)
    first = record(scene, 6.0)
    scene.reset(3)
    again = record(scene, 6.0)
    other = record(PrepareScene(load_scene(name), targets, seed=3, cache=learned), 6.0)
    for one in (again, other):
        for field in ("root_position", "wxyz", "contacts", "library_frame", "object_position"):
            assert getattr(first, field).tobytes() == getattr(one, field).tobytes(), field
        assert first.events == one.events


@pytest.mark.slow
def test_threads_do_not_change_a_drill(built: Path, tmp_path: Path):
    written = []
    for threads in ("1", "2"):
        path = tmp_path / f"{threads}.rec"
        subprocess.run(
            [sys.executable, "-m", "kumite", "run", "drill", "-l", str(built), "--count", "300",
             "--seconds", "2", "-o", str(path)],
            env={**os.environ, "NUMBA_NUM_THREADS": threads}, check=True, capture_output=True,
        )  # fmt: skip
        written.append(path.read_bytes())
    assert written[0] == written[1]


def test_a_walker_is_the_same_among_many(targets: Layer, learned: Path):
    """Arrays over all against one alone: the first of a drill, far from the others."""
    alone = PrepareScene(with_count(load_scene("drill"), 1), targets, cache=learned)
    many = PrepareScene(with_count(load_scene("drill"), 5), targets, cache=learned)
    home = [s.walkers.shown.root_position[0].copy() for s in (alone, many)]
    for _ in range(round(8 * alone.fps)):
        alone.step()
        many.step()
        a, b = (s.walkers.shown.root_position[0] - h for s, h in zip((alone, many), home))
        np.testing.assert_allclose(a, b, atol=1e-6)
    assert [e.kind for e in alone.events] == [
        e.kind for e in many.events if e.character == "walker 1"
    ]


# What is refused ---------------------------------------------------------------------------------


def _toml(**parts: str) -> str:
    head = 'title = "t"\nabout = "a"\n'
    walker = parts.get("walker", '[[walker]]\nname = "anna"\nposition = [0, 0]\n')
    target = '[[target]]\nname = "bar"\nmotion = "duck_under"\nposition = [0, 3]\n'
    return head + walker + parts.get("target", target) + parts.get("more", "")


WRONG = [
    ({"target": '[[target]]\nname = "x"\nmotion = "fly"\nposition = [0, 3]\n'}, "fly"),
    (
        {"walker": '[[walker]]\nname = "anna"\nposition = [0, 0]\ngoes_to = ["sofa"]\n'},
        "anna goes to 'sofa'",
    ),
    ({"walker": '[[walker]]\nname = "anna"\nposition = [0, 3.1]\n'}, "it begins in bar"),
    (
        {
            "target": '[[target]]\nname = "x"\nmotion = "duck_under"\n'
            "position = [0, 3]\nheight = 1\n"
        },
        "height of x: 1 m",
    ),
    ({"more": "[prepare.curve]\nhead = 0.0\n"}, "curve"),
    ({"more": '[prepare]\npreparation = "none"\ncurve = { head = 0.5 }\n'}, "say nothing"),
    ({"more": "[prepare.curves.fly]\nhead = 0.5\n"}, "fly"),
    ({"more": '[prepare]\ngaits = ["fly"]\n'}, "fly"),
    ({"more": "[opponents]\ncount = 2\n"}, "expected one of them"),
    ({"target": "", "more": '[opponents]\nmotions = ["jump_over"]\n'}, "jump_over is none"),
    ({"target": '[[target]]\nname = "anna"\nmotion = "punch"\nposition = [0, 3]\n'}, "twice"),
]


@pytest.fixture
def run(run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return run


@pytest.mark.parametrize(("parts", "said"), WRONG, ids=[said for _, said in WRONG])
def test_scenes_that_cannot_be(run, built: Path, tmp_path: Path, parts: dict, said: str):
    (tmp_path / "s.toml").write_text(_toml(**parts), "utf-8")
    status, _, error = run("run", "s.toml", "-l", built, "--seconds", "0.1", "-o", "s.rec")
    assert status == 2 and said in error and error.count("error:") == 1
    assert "Traceback" not in error and not (tmp_path / "s.rec").exists()


def test_another_kind_of_library_is_refused(library: Layer):
    with pytest.raises(KumiteError, match="about preparation; expected a library built with"):
        PrepareScene(load_scene("ball-kick"), library)


# What is written ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["ball-kick", "brawl", "obstacle-course", "drill"])
def test_scenes_leave_as_files(run, built: Path, tmp_path: Path, name: str):
    endings = ["rec", "glb", "png"]
    if len(load_scene(name).names) == 1:  # a BVH file holds one character
        endings.append("bvh")
    out = [f"{name}.{ending}" for ending in endings]
    args = [x for path in out for x in ("-o", path)]
    status, _, error = run("run", name, "-l", built, "--seconds", "3", *args)
    assert status == 0, error
    written = sorted(tmp_path.rglob("*.*"))
    for ending in endings:
        assert any(p.suffix == f".{ending}" and p.stat().st_size > 1000 for p in written), ending
    assert run("metrics", f"{name}.rec")[0] == 0
    folder = os.environ.get("KUMITE_GLTF_VALIDATOR")
    if folder:
        from tests.test_gltf import test_the_khronos_validator_finds_nothing

        test_the_khronos_validator_finds_nothing(tmp_path / f"{name}.glb")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ball-kick", "obstacle-course"])
def test_scenes_are_done(targets: Layer, learned: Path, name: str):
    scene = PrepareScene(load_scene(name), targets, seed=201, cache=learned)
    for _ in range(round(60 * scene.fps)):
        scene.step()
    kinds = [e.kind for e in scene.events]
    assert kinds.count("launch") >= 5
    assert kinds.count("hit" if name == "ball-kick" else "passed") >= 4
    assert kinds.count("touched") == 0
