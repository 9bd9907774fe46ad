"""People who prepare in the studio: clicks and keys that lead them, and what is seen of it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from kumite.annotate import find_balance
from kumite.body import skin_vertices
from kumite.graph import Layer
from kumite.rotation import from_yaw, rotate
from kumite.scene import (
    Playback,
    PrepareScene,
    SceneObject,
    load_recording,
    load_scene,
    record,
    save_recording,
)
from kumite.scene import prepare as scenes
from kumite.scene.events import Decision, Done, Hit, Launch, Passed
from kumite.scene.leading import Walks
from kumite.scene.wording import describe
from kumite.studio import Studio
from kumite.studio.leading import DOWN, LEFT, NEAR, RIGHT, STEP, UP, Leader, meant, way_seen
from kumite.studio.wording import EventLog, lines_html, score_html
from tests import browser
from tests.browser import viewer_of
from tests.shared import builtin
from tests.telling import event
from tests.test_studio import wait

Make = Callable[..., PrepareScene]


@pytest.fixture(scope="module")
def targets() -> Layer:
    """The built-in performer's library for preparation."""
    return builtin("targets", "preparation")


@pytest.fixture(scope="module")
def make(targets: Layer, tmp_path_factory) -> Make:
    """Scenes that share what was learned."""
    folder: Path = tmp_path_factory.mktemp("learned")

    def scene(name: str, seed: int = 1, automatic: bool = True) -> PrepareScene:
        told = load_scene(name)
        assert told.prepare is not None
        at_home = told.prepare.model_copy(update={"scatter": 0.0, "scatter_deg": 0.0})
        told = told.model_copy(update={"prepare": at_home})
        out = PrepareScene(told, targets, seed=seed, cache=folder)
        out.automatic = automatic
        return out

    return scene


def steps(stage: PrepareScene, until: Callable[[], bool], most: int) -> bool:
    for _ in range(most):
        if until():
            return True
        stage.step()
    return until()


def away(stage: PrepareScene, place: np.ndarray) -> float:
    return float(np.hypot(*(stage.walkers.facing[0, :2] - place)))


# What clicks and keys mean -----------------------------------------------------------------------

EYE = np.array([0.0, 2.5, -8.0])


def test_a_ray_means_the_thing_that_it_comes_near_to_or_the_floor():
    ball = SceneObject("ball", np.array([0.5, 0.11, 1.0]), 0.11)
    bar = SceneObject("bar", np.array([-2.0, 1.2, 0.0]), 0.06, size=(2.0, 0.06, 0.06), yaw=0.6)
    post = SceneObject("bar, left", np.array([3.0, 0.6, 2.0]), 0.06, size=(0.06, 1.2, 0.06))
    other = SceneObject("nobody's", np.array([0.0, 1.0, -4.0]), 0.3)
    things = [ball, bar, post, other]
    u = np.linspace(-1.0, 1.0, 100)[:, None]
    lines = {
        "ball": (ball.position[None], 0.11),
        "bar": (bar.position + u * [np.cos(0.6), 0.0, -np.sin(0.6)], 0.03),
        "post": (post.position + u * [0.0, 0.6, 0.0], 0.03),
    }
    rng = np.random.default_rng(5)
    said: list[str] = []
    for _ in range(200):
        at = np.array([rng.uniform(-4, 4), 0.0, rng.uniform(-3, 4)])
        ray = EYE + np.linspace(0.5, 1.0, 500)[:, None] * (at - EYE)
        gaps = {
            name: np.linalg.norm(ray[:, None] - line, axis=2).min() - radius
            for name, (line, radius) in lines.items()
        }
        nearest = min(gaps, key=lambda n: gaps[n])
        if abs(gaps[nearest] - NEAR) < 0.02 or np.ptp(sorted(gaps.values())[:2]) < 0.02:
            continue  # too close to call
        found = meant(EYE, at - EYE, things, ("ball", "bar"))
        if gaps[nearest] > NEAR:
            assert found == pytest.approx((at[0], at[2]))
            said.append("floor")
        else:
            assert found == nearest.replace("post", "bar")
            said.append(nearest)
    assert {"ball", "bar", "post", "floor"} <= set(said)
    assert meant(EYE, np.array([0.0, 0.2, 1.0]), [ball], ("ball",)) is None


def test_arrows_point_as_the_picture_shows_them():
    rng = np.random.default_rng(6)
    up = np.array([0.0, 1.0, 0.0])
    for _ in range(20):
        eye = np.array([*rng.uniform(-5, 5, 1), rng.uniform(1, 5), *rng.uniform(-5, 5, 1)])
        at = rng.uniform(-1, 1, 3) * [1, 0, 1]
        forward = (at - eye) / np.linalg.norm(at - eye)
        across = np.cross(forward, up)  # to the right in the picture
        picture_up = np.cross(across, forward)
        for key, axis, sign in ((UP, picture_up, 1), (DOWN, picture_up, -1),
                                (RIGHT, across, 1), (LEFT, across, -1)):  # fmt: skip
            x, z = way_seen(eye, at, up, key)
            assert np.hypot(x, z) == pytest.approx(1.0)
            assert sign * np.array([x, 0.0, z]) @ axis > 0
            aside = across if axis is picture_up else forward * [1, 0, 1]
            assert np.array([x, 0.0, z]) @ aside == pytest.approx(0.0, abs=1e-9)
    down = way_seen(np.array([0.0, 5.0, 0.0]), np.zeros(3), np.array([1.0, 0.0, 0.0]), UP)
    assert np.allclose(down, [1.0, 0.0])


def test_a_click_sends_a_walker_to_a_place_or_to_a_ball(make: Make):
    stage = make("ball-kick", automatic=False)
    leader = Leader(Walks(stage, range(stage.users)), stage.names)
    for _ in range(30):
        stage.step()
    assert away(stage, np.zeros(2)) < 0.1, "nobody goes unasked"
    place = np.array([-2.0, -2.5])
    eye = np.array([0.0, 3.0, -9.0])
    leader.point(eye, np.array([place[0], 0.0, place[1]]) - eye, stage.objects)
    assert np.allclose(stage.told[0], place)
    assert steps(stage, lambda: away(stage, place) < 0.8, 600)
    leader.point(eye, stage.things.position[0] - eye, stage.objects)
    assert stage.thing[0] == 0 and np.isnan(stage.told[0]).all()
    assert steps(stage, lambda: stage.walkers.alpha[0] > 0.7, 1200), "it does not prepare"
    for _ in range(120):
        stage.step()
    decided = all(isinstance(e, Decision) for e in stage.events)
    assert decided, "the motion is not begun by itself"
    assert leader.trigger("kick_ball") is None
    assert leader.trigger("punch") == "kick_ball"
    assert steps(stage, lambda: any(isinstance(e, Hit) for e in stage.events), 120)


def test_an_arrow_sends_a_walker_a_few_steps(make: Make):
    stage = make("ball-kick", automatic=False)
    leader = Leader(Walks(stage, range(stage.users)), stage.names)
    leader.press(EYE, np.array([0.0, 1.0, 0.0]), np.array([0.0, 1.0, 0.0]), LEFT)
    assert np.allclose(stage.told[0], [STEP, 0.0])  # who looks along +Z has +X on the left
    assert steps(stage, lambda: away(stage, np.array([STEP, 0.0])) < 0.8, 400)


def test_who_is_sent_to_places_near_by_does_not_go_round_and_round_them(make: Make):
    stage = make("ball-kick", automatic=False)
    rng = np.random.default_rng(7)
    for _ in range(25):
        bearing, far = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.9, 3.0)
        place = stage.walkers.facing[0, :2] + far * np.array([np.sin(bearing), np.cos(bearing)])
        stage.go(0, place)
        assert steps(stage, lambda place=place: away(stage, place) < 0.8, 900), (bearing, far)
        for _ in range(int(rng.integers(0, 90))):
            stage.step()


# The hand and what goes by itself ----------------------------------------------------------------


def test_who_goes_by_itself_first_goes_where_it_is_sent(make: Make, monkeypatch):
    stage = make("ball-kick")
    stage.step()
    place = np.array([0.0, -4.0])
    stage.go(0, place)
    assert steps(stage, lambda: bool(np.isnan(stage.told[0, 0])), 900)
    assert away(stage, place) < 0.85 and all(isinstance(e, Decision) for e in stage.events)
    assert steps(stage, lambda: any(isinstance(e, Hit) for e in stage.events), 1200)
    # Where nobody ever arrives it gives up 5 s after it has got as near as it does.
    monkeypatch.setattr(scenes, "ARRIVED", -1.0)
    stage = make("ball-kick")
    stage.go(0, place)
    nearest, last = np.inf, 0
    while np.isfinite(stage.told[0, 0]):
        stage.step()
        if away(stage, place) < nearest - 0.05:
            nearest, last = away(stage, place), stage.frame
        assert stage.frame < 1800
    assert nearest < 1.0
    assert stage.frame - last == pytest.approx(scenes.PATIENCE * stage.fps, abs=0.5 * stage.fps)


def test_a_thing_that_was_chosen_takes_nobodys_turn(make: Make):
    stage = make("obstacle-course")
    stage.go_to(0, "bar")
    assert steps(stage, lambda: any(isinstance(e, Passed) for e in stage.events), 2400)
    assert next(e for e in stage.events if isinstance(e, Passed)).thing == "bar"
    stage.step()
    assert steps(stage, lambda: stage.thing[0] >= 0, 600)
    assert stage.things.names[stage.thing[0]] == "beam"


def test_who_is_led_through_a_brawl_prepares_for_the_nearest_opponent(make: Make):
    stage = make("brawl")
    stage.step()
    stage.go(0, np.array([0.0, 9.0]))
    for _ in range(200):
        stage.step()
        off = np.hypot(*(stage.walkers.facing[1:, :2] - stage.walkers.facing[0, :2]).T)
        assert stage.walkers.wants[0] >= 0
        source = stage.walkers.source[0]
        chosen = np.hypot(*(stage.walkers.facing[1:, :2] - source).T)
        assert chosen.min() < 0.1 and off[chosen.argmin()] < off.min() + 0.6
        assert np.allclose(stage.walkers.goal[0, :2], [0.0, 9.0])
    assert not any(isinstance(e, Launch) for e in stage.events), "it is led"


# What is seen ------------------------------------------------------------------------------------


def test_the_posture_is_in_balance_as_it_was_found(make: Make, targets: Layer):
    stage = make("ball-kick")
    studio = Studio(stage, port=0)
    try:
        prepared, preparing = viewer_of(studio).own.prepared, targets.preparing
        assert prepared is not None and preparing is not None
        balance = find_balance(targets.clips, targets.contacts)
        for t, label in enumerate(stage.motions):
            posture, frame = prepared.walk.reference(label), int(preparing.reference[t])
            a, b = posture.hull, np.roll(posture.hull, -1, axis=0)
            edge = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
            off = np.cross(np.insert(edge, 2, 0, 1), np.insert(posture.centre - a, 2, 0, 1))[:, 2]
            assert np.ptp(np.sign(off)) == 0, "the centre of mass is not over the support"
            assert np.abs(off).min() == pytest.approx(-balance.distance[frame], abs=1e-9)
            assert abs(prepared.skin(label)[:, 1].min()) < 0.03
            said = posture.about
            before = int(preparing.hierarchy.targets.mark[t]) - frame
            assert f"frame {frame}" in said and f"{before} before the mark" in said
    finally:
        studio.close()


@pytest.mark.parametrize("name", ["ball-kick", "obstacle-course"])
def test_motions_are_begun_where_and_as_the_posture_is_shown(make: Make, name: str):
    stage = make(name)
    studio = Studio(stage, port=0)
    try:
        prepared = viewer_of(studio).own.prepared
        assert prepared is not None
        prepared.asked.posture = prepared.asked.support = True
        shown, there, mine = prepared.look(), np.zeros(3), np.zeros(3)
        while not any(isinstance(e, Launch) for e in stage.events):
            shown = prepared.look()
            if shown.motion is None:  # it has not yet looked where it goes
                stage.step()
                continue
            ghost = prepared.skin(shown.motion)
            x, z, yaw = shown.begins
            there = rotate(from_yaw(yaw), ghost) + np.array([x, 0.0, z])
            w = stage.walkers.shown
            mine, _ = skin_vertices(prepared.mesh, stage.skeleton, w.position[0], w.world_wxyz[0])
            assert stage.frame < 1500
            stage.step()
        assert stage.motions[stage.walkers.doing[0]] == shown.motion
        off = np.linalg.norm(there - mine, axis=1)
        assert off.mean() < 0.2 and np.linalg.norm((there - mine).mean(axis=0)) < 0.2
        assert prepared.look().motion is None, "it is shown on"
    finally:
        studio.close()


def test_switches_show_and_hide(make: Make):
    stage = make("ball-kick")
    studio = Studio(stage, port=0)
    try:
        prepared = viewer_of(studio).own.prepared
        assert prepared is not None
        for _ in range(5):
            stage.step()
        nodes = studio.server.scene._handle_from_node_name

        def seen() -> set[str]:
            studio._draw(studio._look(), 1 / 60)
            names = [n for n in nodes if n.startswith("/stage/prepared/") or n == "/stage/goal"]
            return {n.split("/")[-2] for n in names if nodes[n].visible and n.count("/") == 4} | (
                {"goal"} if nodes["/stage/goal"].visible else set()
            )

        assert seen() == {"goal"}
        goal = stage.walkers.goal[0]
        assert np.allclose(prepared._ring.position, [goal[0], 0.0, goal[1]])
        prepared.asked.posture = True
        assert seen() == {"goal", "body"}
        assert np.allclose(prepared._frame.position, [goal[0], 0.0, goal[1]])
        assert np.allclose(prepared._frame.wxyz, from_yaw(goal[2]))
        prepared.asked.posture, prepared.asked.support = False, True
        assert seen() == {"goal", "support"}
        prepared.asked.support = prepared.asked.goal = False
        assert seen() == set()
        prepared.asked.goal = True
        stage.automatic = False
        stage.let_go(0)
        stage.step()
        assert seen() == set(), "it goes nowhere"
    finally:
        studio.close()


def test_the_picture_stays_with_who_walks(make: Make):
    for name in ("ball-kick", "brawl", "drill"):
        stage = make(name)
        studio = Studio(stage, port=0)
        try:
            middle = stage.root_position[: stage.users, [0, 2]].mean(axis=0)
            assert np.allclose(studio._midpoint(studio._look()), middle)
            eye = np.array(studio.server.initial_camera.position)
            ahead = np.array(
                [np.sin(stage.walkers.facing[0, 2]), np.cos(stage.walkers.facing[0, 2])]
            )
            assert eye[[0, 2]] @ ahead < -5.0 and np.linalg.norm(eye) < 12.0, "not behind it"
        finally:
            studio.close()


def test_a_ball_is_dragged_along_the_floor(make: Make):
    stage = make("ball-kick")
    studio = Studio(stage, port=0)
    try:
        viewer = viewer_of(studio)
        viewer.own.follow.jump(np.array([1.0, -2.0]))
        viewer._pictures = []
        place = np.array([2.0, 0.11, 1.5])
        eye = viewer.seen_at(EYE)
        studio._drag_object(
            viewer_of(studio).id, "ball 2", eye, viewer_of(studio).seen_at(place) - eye
        )
        assert np.allclose(stage.things.position[1], place)
        studio._drag_object(viewer.id, "ball 2", eye, np.array([0.0, 1.0, 1.0]))
        assert np.allclose(stage.things.position[1], place)
        assert studio._targets._gizmos == {}
    finally:
        studio.close()


# What is said ------------------------------------------------------------------------------------


def test_what_is_said_of_preparing():
    def said(kind: str, **data) -> str:
        return describe(event(1, kind, "anna", data))

    launch = {"motion": "kick_ball", "level": 0.831, "apart_deg": 1.92, "to_contact": 0.6}
    begins = "kick ball, prepared to 0.83, 1.9° from its posture; contact in 0.60 s"
    assert said("launch", **launch, bent=None) == begins
    assert said("launch", **launch, bent=0.096) == begins + ", bent by 10 cm"
    assert said("launch", **launch, bent=0.9) == begins + ", 0.9 m off: not bent"
    assert said("done", motion="duck_under") == "duck under is done"
    assert said("passed", thing="beam", clearance=0.021) == "beam is passed, 2 cm clear"
    assert said("passed", thing="beam", clearance=-0.034) == "beam is passed, 3 cm too near"
    assert said("touched", thing="beam", part="left_shin") == "left shin touches beam"
    assert said("moved goal", thing="beam") == "cannot stand in beam: goes beside it"
    assert said("hit", limb="right_foot", victim="ball 1", part="ball 1", speed=6.52) == (
        "right foot → ball 1, 6.5 m/s"
    )


def test_a_recording_is_shown_and_counted(make: Make, tmp_path: Path):
    stage = make("ball-kick", seed=201)
    recording = record(stage, 15.0)
    done = sum(isinstance(e, Done) for e in recording.events)
    hits = sum(isinstance(e, Hit) for e in recording.events)
    assert done >= 1 and hits >= 1
    save_recording(tmp_path / "k.rec", recording)
    studio = Studio(Playback(load_recording(tmp_path / "k.rec")), port=0)
    try:
        assert viewer_of(studio).own.prepared is None and studio._log.counts == ("errands",)
        studio.seek(len(recording) - 1)
        assert studio._log.done["anna"] == done and studio._log.landed["anna"] == hits
        assert "touched" in score_html(studio._log) and "strikes" not in score_html(studio._log)
        lines = lines_html(studio._log, recording.fps)
        assert "prepared to" in lines and "is done" in lines
    finally:
        studio.close()
    assert "strikes" in score_html(EventLog(("anna",)))


def test_bars_have_no_wheels(make: Make, tmp_path: Path):
    save_recording(tmp_path / "o.rec", record(make("obstacle-course"), 0.1))
    play = Playback(load_recording(tmp_path / "o.rec"))
    assert len(play.objects) == 15 and not any(o.wheels for o in play.objects)
    studio = Studio(play, port=0)
    try:
        nodes = studio.server.scene._handle_from_node_name
        parts = {n.split("/")[-1] for n in nodes if n.startswith("/stage/object/0/")}
        assert parts == {"wood"}
    finally:
        studio.close()


# In the browser ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_clicks_and_keys_lead_a_walker(make: Make):
    stage = make("ball-kick", automatic=False)
    studio = Studio(stage, port=0)
    studio.toggle()
    with browser.watching(studio) as (page, client):

        def spot(point: np.ndarray) -> tuple[float, float]:
            return browser.project(viewer_of(studio).seen_at(point), client.camera, page)

        ball = stage.things.position[0]
        page.mouse.click(*spot(ball))
        assert wait(lambda: stage.thing[0] == 0)
        place = np.array([1.5, 0.0, -1.0])

        def drawn() -> np.ndarray:
            return browser.around(browser.picture(page), spot(place), 12)

        bare = drawn()
        page.mouse.click(*spot(place))
        assert wait(lambda: np.isfinite(stage.told[0, 0]))
        assert np.allclose(stage.told[0], place[[0, 2]], atol=0.05)
        browser.wait_until(page, lambda: bool(np.any(drawn() != bare)), "the goal to be drawn")
        page.get_by_label("Goal", exact=True).click()
        browser.wait_until(page, lambda: bool(np.all(drawn() == bare)), "the goal to be hidden")
        page.get_by_label("Goal", exact=True).click()

        studio.toggle()
        browser.wait_until(page, lambda: away(stage, place[[0, 2]]) < 0.8, "anna to come there")
        eye = np.array(client.camera.position)
        page.keyboard.press("ArrowLeft", delay=200)
        assert wait(lambda: bool(np.hypot(*(stage.told[0] - place[[0, 2]])) > 1.0))
        way = stage.told[0] - stage.walkers.facing[0, :2]
        ahead = -eye[[0, 2]]
        assert way @ [ahead[1], -ahead[0]] > 0.9 * np.hypot(*way) * np.hypot(*ahead)
        page.wait_for_timeout(500)
        assert np.allclose(client.camera.position, eye, atol=1e-3), "the camera turned as well"
        page.keyboard.press("i")
        assert wait(lambda: bool((stage.told[0] - stage.walkers.facing[0, :2]) @ ahead > 1.0))

        page.keyboard.press("6")
        assert wait(lambda: any(getattr(e, "motion", None) == "punch" for e in stage.events))
        studio.step_once()  # it waits in its punch, however slow the page is
        browser.wait_until(page, lambda: "punch, prepared to" in page.inner_text("body"), "a line")
        page.get_by_role("button", name="5 front kick").click()
        browser.wait_until(page, lambda: "Busy" in page.inner_text("body"), "busy")
        assert "anna does punch" in page.inner_text("body")
        assert sum(isinstance(e, Launch) for e in stage.events) == 1
        studio.toggle()
        browser.wait_until(page, lambda: "is done" in page.inner_text("body"), "the end of it")
        page.get_by_label("By itself", exact=True).click()
        assert wait(lambda: stage.automatic)
        page.keyboard.press("b")
        assert wait(lambda: not stage.automatic), "the box keeps the keys to itself"
