"""Balls thrown from the page, the volumes of an avoidance, and what is said of it."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from kumite.control.attack import thrown
from kumite.control.avoidance import AvoidanceRules
from kumite.control.avoider import standing
from kumite.errors import KumiteError
from kumite.graph import Layer
from kumite.rotation import planar_apply
from kumite.scene import (
    Playback,
    SceneSettings,
    World,
    load_recording,
    load_scene,
    record,
    save_recording,
    with_count,
    with_throws,
)
from kumite.scene.events import Struck, Throw
from kumite.scene.stage import in_sight
from kumite.scene.volumes import attack_volume, avoidance_volume, body_volume
from kumite.scene.wording import describe
from kumite.studio import Studio
from kumite.studio.props import TARGET_COLOUR
from kumite.studio.throwing import BELOW, NEAR, aim_along
from kumite.studio.wording import EventLog, score_html, struck
from tests import browser
from tests.browser import viewer_of
from tests.shared import builtin
from tests.telling import event
from tests.test_studio import wait


@pytest.fixture(scope="module")
def avoiders() -> Layer:
    """The built-in performer's library of avoidance."""
    return builtin("avoidance", "avoidance")


def dodgeball(library: Layer, throws: int = 0, count: int | None = None) -> World:
    settings: SceneSettings = load_scene("dodgeball" if count is None else "barrage")
    settings = settings if count is None else with_count(settings, count)
    return World(with_throws(settings, throws), library, seed=1)


def kinds(stage: World) -> list[str]:
    return [e.kind for e in stage.events]


def step_and_draw(studio: Studio) -> None:
    studio._tick()
    studio._draw(studio._look(), 1 / 60)


# Throwing ----------------------------------------------------------------------------------------

EYE = np.array([0.0, 1.5, 6.0])
TWO = np.array([[[0.0, 1.0, 0.0], [0.0, 1.6, 0.0]], [[1.5, 1.0, -4.0], [1.5, 1.6, -4.0]]])
RADII = np.array([0.2, 0.15])


def test_a_ray_means_the_body_that_it_comes_near_to():
    at_head = aim_along(EYE, np.array([0.0, 1.6, 0.0]) - EYE, TWO, RADII, 0.1)
    assert at_head.who == 0 and at_head.off < 0
    assert np.allclose(at_head.goal, [0.0, 1.6, 0.0])
    beside = np.array([0.6, 1.0, 0.0]) - EYE
    near = aim_along(EYE, beside, TWO[:1], RADII, 0.1)
    t = beside / np.linalg.norm(beside)
    best = min(np.linalg.norm(np.cross(c - EYE, t)) - r for c, r in zip(TWO[0], RADII))
    assert near.off == pytest.approx(best) and 0 < near.off < NEAR
    assert abs((near.goal - TWO[0, 0]) @ t) < 1e-9  # the point of the ray nearest to it
    behind = aim_along(EYE, TWO[1, 1] - EYE, TWO, RADII, 0.1)  # though the other is near, too
    assert behind.who == 1


def test_a_ray_that_passes_everybody_goes_as_far_as_they_are():
    aim = aim_along(EYE, np.array([5.0, 1.3, 0.0]) - EYE, TWO[:1], RADII, 0.1)
    assert aim.off > NEAR
    way = (aim.goal - EYE) / np.linalg.norm(aim.goal - EYE)
    assert (TWO[0].mean(axis=0) - aim.goal) @ way == pytest.approx(0.0, abs=1e-9)
    floor = aim_along(EYE, np.array([3.0, -3.0, 3.0]) - EYE, TWO[:1], RADII, 0.1)
    assert floor.goal[1] == pytest.approx(0.1)
    away = aim_along(EYE, np.array([0.0, 0.0, 1.0]), TWO, RADII, 0.1)
    assert away.goal[2] > EYE[2] and np.isfinite(away.goal).all()


def test_clicks_wait_for_the_thread_that_steps_and_keep_their_order(avoiders: Layer):
    stage = dodgeball(avoiders)
    studio = Studio(stage, port=0)
    try:
        viewer = viewer_of(studio)
        throws = viewer.own.throws
        assert throws is not None
        throws.speed, throws.radius = 12.0, 0.2
        step_and_draw(studio)
        ways = [stage.root_position[0] + [0.3 * k, 0.1 * k, 0.0] - EYE for k in range(8)]
        for way in ways:  # quicker than pictures are drawn
            viewer.click(viewer.seen_at(EYE), way)
        assert "throw" not in kinds(stage)
        studio._tick()
        told = [e for e in stage.events if isinstance(e, Throw)]
        assert len(told) == 8 and stage.objects[0].radius == stage.objects[7].radius == 0.2
        for e, way in zip(told, ways):
            assert np.cross(np.array(e.place) - EYE + [0, BELOW, 0], way) == pytest.approx(
                0, abs=0.1
            )
        assert told[0].speed == pytest.approx(12.0, rel=0.05)
    finally:
        studio.close()


def test_a_click_means_the_picture_in_which_it_was_made(avoiders: Layer):
    """The page lags: since then everybody has moved, and the ground with them."""
    stage = dodgeball(avoiders)
    studio = Studio(stage, port=0)
    try:
        viewer = viewer_of(studio)
        step_and_draw(studio)
        seen = viewer.seen
        assert seen is not None and seen.bodies is not None
        before = seen.bodies[0][0].mean(axis=0)
        eye = EYE - [seen.centre[0], 0.0, seen.centre[1]]
        stage.cast.anchor[0, :2] += [1.5, 0.5]
        stage.cast.show(0.0)
        viewer.own.follow.jump(np.array([1.5, 0.5]))
        viewer.click(eye, before - EYE)
        assert np.allclose(viewer._clicks[0].eye, EYE)  # not where that is by now
        studio._tick()
        assert "throw" in kinds(stage)
        ball = stage.fire.balls.attack[0]
        assert ball is not None
        off = np.linalg.norm(ball.centre[:, 0] - before, axis=1).min()
        assert off < 0.3 < np.linalg.norm([1.5, 0.5])
    finally:
        studio.close()


def test_throws_by_hand_leave_the_stream_as_it_is(avoiders: Layer):
    by_itself, helped = dodgeball(avoiders, throws=3), dodgeball(avoiders, throws=3)
    helped.fire.throw_one(20.0, 0.3)
    for _ in range(240):
        by_itself.step()
        helped.step()
    first = next(e for e in by_itself.events if isinstance(e, Throw))
    second = [e for e in helped.events if isinstance(e, Throw)][1]
    assert first.frame == second.frame == 60
    # Who is aimed at may stand otherwise by now; where from is drawn from the same numbers.
    assert first.place[1] == second.place[1]
    assert helped.objects[0].radius == 0.3 and helped.objects[1].radius == 0.11


def test_the_stream_is_switched_on_and_off(avoiders: Layer):
    stage = dodgeball(avoiders)
    assert not stage.fire.streams
    for _ in range(330):
        stage.step()
    assert "throw" not in kinds(stage)
    stage.fire.streams = True
    for _ in range(330):
        stage.step()
    count = kinds(stage).count("throw")
    assert count in (2, 3)  # every 2.5 s, and none made up for
    stage.fire.streams = False
    for _ in range(200):
        stage.step()
    assert kinds(stage).count("throw") == count


# Tuning ------------------------------------------------------------------------------------------


def test_controls_act_on_the_next_search_and_no_other(avoiders: Layer):
    stage = dodgeball(avoiders)
    before = stage.fire.search
    controls = {c.field: c for c in stage.tunables}
    assert {"avoidance", "body", "timescale", "window", "clearance"} < set(controls)
    for field, value in (("body", 3.0), ("window", 2.0), ("clearance", 0.1)):
        controls[field].set(value)
        assert controls[field].value == value
    assert stage.fire.search.settings.weights == (1.0, 3.0, 1.0)
    assert stage.fire.search.settings.window == 2.0 and stage.fire.search.weighing.clearance == 0.1
    assert (
        all(a.search is stage.fire.search for a in stage.fire.avoiders.values())
        and before.settings.window == 1.0
    )
    assert before.weighing.clearance == 0.02
    assert stage.fire.search.index is before.index and stage.fire.search.masks is before.masks
    stage.reset(2)
    assert stage.fire.avoiders[0].search.settings.window == 2.0
    with pytest.raises(KumiteError, match="clearance"):
        controls["clearance"].set(-1.0)
    with pytest.raises(KumiteError, match="horizon"):
        stage.fire.tune(horizon=2.0)
    assert stage.fire.search.settings.window == 2.0


def test_searches_under_way_keep_their_rules(avoiders: Layer):
    stage = dodgeball(avoiders)
    goal, here = stage.root_position[0], standing(stage.cast, 0, int(stage.cast.stop[0]))
    attacks = [
        thrown(goal + np.array([x, 0.2, 5.0]), [-x * 1.6, 0.5, -8.0], 0.1, gravity=2.0)
        for x in np.linspace(-1.0, 1.0, 40)
    ]

    def all_of(search) -> list:
        found = [search.search(here, [a], 0.0) for a in attacks]
        return [(f.outcome, f.path, f.part, f.counts) for f in found]

    search, alone = stage.fire.search, all_of(stage.fire.search)
    with ThreadPoolExecutor(1) as pool:
        under_way = pool.submit(all_of, search)
        for window in np.linspace(0.1, 3.0, 200):
            stage.fire.tune(window=float(window), weights=(float(window), 0.0, 1.0))
        assert under_way.result() == alone
    rules = AvoidanceRules(window=0.2, clearance=0.3)
    tuned = search.tuned(window=0.2, clearance=0.3)
    assert tuned.settings.window == rules.window and all_of(tuned) != alone
    assert all_of(search) == alone


# Volumes -----------------------------------------------------------------------------------------


def test_switches_add_and_remove_volumes(avoiders: Layer):
    stage = dodgeball(avoiders, throws=40)
    studio = Studio(stage, port=0)
    try:
        volumes = viewer_of(studio).own.volumes
        assert volumes is not None
        nodes = studio.server.scene._handle_from_node_name

        def shown() -> set[str]:
            return {n.split("/volume/")[1].split()[0] for n in nodes if "/volume/" in n}

        seen: set[str] = set()
        for frame in range(1500):
            stage.step()
            if frame == 0:
                step_and_draw(studio)
                assert shown() == set()
                volumes.shown.body = volumes.shown.attacks = volumes.shown.left = True
            studio._draw(studio._look(), 1 / 60)
            seen |= shown()
            if seen == {"body", "attack", "left"} and shown() == seen:
                break
        else:
            pytest.fail(f"only {seen} were seen")
        body = volumes._body
        assert body is not None
        centre = body_volume(stage.cast, 0, stage.fire.search.spheres).centre
        assert np.allclose(body.batched_positions, centre, atol=1e-5)
        for field in ("body", "attacks", "left"):
            setattr(volumes.shown, field, False)
            studio._draw(studio._look(), 1 / 60)
        assert shown() == set()
    finally:
        studio.close()


def test_the_avoidance_volume_is_where_the_body_comes_by(avoiders: Layer):
    stage = dodgeball(avoiders, throws=40)
    near, plan, left = [], None, None
    for _ in range(2400):
        stage.step()
        avoider, cast = stage.fire.avoiders[0], stage.cast
        if avoider.plan is None:
            continue
        if avoider.plan is not plan:
            plan, left = avoider.plan, avoidance_volume(cast, 0, avoider)
            assert len(left.radius) and left.centre[:, 1].min() > -0.1
        begins = int(stage.fire.search.graph.begins[avoider.plan.part])
        there = cast.frame[0] + cast.fraction[0]
        if not avoider.rest and abs(there - begins) < 0.5:
            assert left is not None
            # As captured: what is shown is still being smoothed after a join.
            place = stage.fire.search.spheres.of_frames(avoiders.clips)[begins].T
            now = planar_apply(cast.anchor[0], place)
            off = np.linalg.norm(now[:, None] - left.centre, axis=2).min(axis=0)
            near.append(float(off.max()))
    assert len(near) >= 3
    assert max(near) < 0.01, near


def test_an_attack_is_shown_along_its_way():
    attack = thrown([0.0, 1.0, 5.0], [0.0, 2.0, -10.0], 0.1)
    volume = attack_volume(attack)
    assert len(volume.radius) == len(volume.centre) <= 60 and set(volume.radius) == {0.1}
    assert np.allclose(volume.centre[[0, -1]], attack.centre[[0, -1], 0])


# What is said ------------------------------------------------------------------------------------


def test_what_is_said_of_a_throw_and_a_search():
    def said(kind: str, **data) -> str:
        ball = {} if kind in ("throw", "decision") else {"ball": "ball 1"}
        return describe(event(1, kind, "dodger", {**ball, **data}))

    assert said("throw", attack=3, speed=9.96, ball="ball 1") == "ball 3 is thrown, 10.0 m/s"
    assert said("avoided", attack=3) == "ball 3 is avoided"
    assert said("avoided", attack=3, ball=None, attacker="red") == "red's blow is avoided"
    assert said("missed", attack=4) == "ball 4 comes near nobody"
    assert said("struck", attack=3, part="left_shin", speed=9.0, meant=True) == (
        "ball 3 → left shin, 9.0 m/s"
    )
    assert said("struck", attack=3, part="head", meant=False).endswith(", meant for another")
    assert said("stale", attack=3, dropped=1) == "ball 3: 1 path too late"
    found = said(
        "avoidance", attack=3, outcome="found", aim=0.48, candidates=57, valid=3, indexed=True,
        cost=1.443, costs=[0.92, 0.24, 0.28], distance=0.132, part=4,
    )  # fmt: skip
    assert found == (
        "ball 3: avoids it, in 0.48 s; 3 of 57 candidates, from the index; "
        "cost 1.44: avoidance 0.92, body 0.24, timescale 0.28; 13 cm away"
    )
    none = said("avoidance", attack=3, outcome="hit", aim=0.5, candidates=9, stiff=7, too_fast=2)
    assert none == "ball 3: no way out, in 0.50 s; of 9 candidates 7 stiff, 2 too fast"
    assert said("avoidance", attack=3, outcome="wide") == "ball 3: lets it pass"
    assert "stretch 7" in said("decision", stretch=7, jump=False, frames=12)


def test_throws_are_counted(avoiders: Layer):
    stage = dodgeball(avoiders, throws=8)
    log = EventLog(stage.names, ("balls",))
    for _ in range(1300):
        stage.step()
    log.update(stage.events, stage.frame)
    assert log.thrown["dodger"] == 8 == log.avoided["dodger"] + log.struck["dodger"]
    html = score_html(log)
    assert "avoided" in html and "strikes" not in html
    met = [e for e in stage.events if isinstance(e, Struck)]
    for ball in met:
        assert struck(ball) == "dodger"
        assert np.linalg.norm(np.array(ball.place) - [0, ball.place[1], 0]) < 2.5


# Many, and recordings ----------------------------------------------------------------------------


def test_many_dodge_and_unseen_balls_are_hidden(avoiders: Layer):
    stage = dodgeball(avoiders, throws=100, count=30)
    studio = Studio(stage, port=0)
    try:
        assert len(stage.names) == 30
        camera = np.array(studio.server.initial_camera.position)
        assert 6.0 < np.linalg.norm(camera[[0, 2]]) < 21.0
        assert not any(t.visible for t in studio._targets._shown)
        for _ in range(120):
            stage.step()
        studio._draw(studio._look(), 1 / 60)
        seen = [t.visible for t in studio._targets._shown]
        there = in_sight(np.array([o.position for o in stage.objects]))
        assert 0 < sum(seen) < len(seen) and seen == there.tolist()
    finally:
        studio.close()


def test_a_recording_of_dodging_shows_the_balls(avoiders: Layer, tmp_path):
    save_recording(tmp_path / "d.rec", record(dodgeball(avoiders, throws=4), 5.0))
    play = Playback(load_recording(tmp_path / "d.rec"))
    assert all(o.thrown for o in play.objects)
    studio = Studio(play, port=0)
    try:
        assert viewer_of(studio).own.throws is None and studio._log.counts == ("balls",)
        assert not any(t.visible for t in studio._targets._shown)
        studio.seek(75)
        studio._draw(studio._look(), 1 / 60)
        ball = studio._targets._shown[0]
        assert ball.visible and np.allclose(ball.position, play.objects[0].position, atol=1e-5)
        assert not studio._targets._shown[1].visible
        # The picture stays with the dodger, not with what flies about.
        assert np.allclose(studio._midpoint(studio._look()), play.root_position[0, [0, 2]])
    finally:
        studio.close()


# In the browser ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_click_throws_a_ball_and_switches_show_volumes(avoiders: Layer):
    stage = dodgeball(avoiders)
    studio = Studio(stage, port=0)
    studio.set_follow(False)
    studio.toggle()
    with browser.watching(studio) as (page, client):
        chest = stage.cast.position[0, stage.skeleton.joint("chest")].copy()
        eye = viewer_of(studio).on_stage(client.camera.position)
        page.mouse.click(*browser.project(viewer_of(studio).seen_at(chest), client.camera, page))
        assert wait(lambda: "throw" in kinds(stage))
        event = next(e for e in stage.events if isinstance(e, Throw))
        assert np.linalg.norm(np.array(event.place) - eye) < 0.8
        thrower, attack = stage.fire.balls, stage.fire.balls.attack[0]
        assert attack is not None and thrower.thrown == 1
        gap = np.linalg.norm(attack.centre[:, 0] - chest, axis=1).min()
        assert gap < 0.3, "the ball does not come by where was clicked"

        def yellow() -> int:
            here = viewer_of(studio).seen_at(stage.objects[0].position)
            spot = browser.project(here, client.camera, page)
            patch = browser.around(browser.picture(page), spot, 25).astype(int)
            r, g, b = patch[..., 0], patch[..., 1], patch[..., 2]
            return int(((r > 120) & (g > 0.55 * r) & (b < 0.6 * g)).sum())

        assert TARGET_COLOUR[2] < TARGET_COLOUR[1] / 2
        for _ in range(12):
            studio.step_once()
            page.wait_for_timeout(50)
        browser.wait_until(page, lambda: yellow() > 30, "the ball to be seen")

        volumes = viewer_of(studio).own.volumes
        assert volumes is not None
        page.get_by_text("Volumes", exact=True).click()
        for label, field in (
            ("Body volume", "body"),
            ("Attack volume", "attacks"),
            ("Avoidance volume", "left"),
        ):
            page.get_by_label(label, exact=True).click()
            assert wait(lambda field=field: getattr(volumes.shown, field))
        assert wait(lambda: volumes._body is not None and len(volumes._attacks) == 1)
        page.get_by_label("Body volume", exact=True).click()
        assert wait(lambda: volumes._body is None)
        page.get_by_role("button", name="Throw one by itself").click()
        assert wait(lambda: kinds(stage).count("throw") == 2)
        page.get_by_label("Stream", exact=True).click()
        assert wait(lambda: stage.fire.streams)
        studio.toggle()
        browser.wait_until(
            page, lambda: {"avoided", "struck"} & set(kinds(stage)) != set(), "the ball's end"
        )
        browser.wait_until(page, lambda: "is thrown" in page.inner_text("body"), "a line of it")
