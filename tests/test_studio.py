"""The studio: what it listens on, how it keeps time, and what a browser sees of it."""

from __future__ import annotations

import itertools
import time

import numpy as np
import psutil
import pytest

from kumite.clip import forward_kinematics
from kumite.errors import KumiteError
from kumite.graph import Layer
from kumite.scene import Playback, World, load_scene, record
from kumite.scene.events import Hit
from kumite.studio import Studio, serve, wording
from kumite.studio.pace import Pace
from tests import browser
from tests.browser import viewer_of
from tests.stranger import running, wait


def live(library: Layer, scene: str, seed: int = 1) -> World:
    return World(load_scene(scene), library, seed=seed)


def test_nothing_listens_beyond_this_machine(library: Layer):
    with running(Studio(live(library, "sparring"), port=0)):
        mine = psutil.Process().net_connections(kind="inet")
        listening = {c.laddr.ip for c in mine if c.status == psutil.CONN_LISTEN}
        assert listening == {"127.0.0.1"}


def test_a_hit_is_shown_where_it_landed(library: Layer):
    hits = [e for e in record(live(library, "sparring"), 20.0).events if isinstance(e, Hit)]
    assert hits
    assert all(wording.struck(e) == e.victim for e in hits)


def test_it_ends_by_itself_and_says_where_it_is(library: Layer):
    said: list[str] = []
    serve(live(library, "sparring"), port=0, open_browser=False, seconds=1.0, announce=said.append)
    assert any("http://127.0.0.1:" in line for line in said)


def test_a_taken_port_moves_on_or_is_an_error(library: Layer):
    stage = live(library, "sparring")
    with running(Studio(stage, port=0)) as first:
        port = first.server.get_port()
        said: list[str] = []
        serve(stage, port=port, open_browser=False, seconds=0.2, announce=said.append)
        assert any(f"port {port} is taken" in line for line in said)
        with pytest.raises(KumiteError, match=str(port)):
            serve(stage, port=port, strict_port=True, open_browser=False, seconds=0.2)


def test_a_host_that_is_not_ours_is_refused(library: Layer):
    with pytest.raises(KumiteError):
        Studio(live(library, "sparring"), host="203.0.113.1", port=0)


def test_it_keeps_time_pauses_steps_and_restarts(library: Layer):
    stage = live(library, "sparring")
    with running(Studio(stage, port=0)) as studio:
        begin, frame = time.perf_counter(), stage.frame
        time.sleep(2.0)
        rate = (stage.frame - frame) / (time.perf_counter() - begin)
        assert rate == pytest.approx(stage.fps, rel=0.25)
        studio.set_speed(2.0)
        begin, frame = time.perf_counter(), stage.frame
        time.sleep(1.5)
        assert (stage.frame - frame) / (time.perf_counter() - begin) > 1.5 * stage.fps
        studio.toggle()
        time.sleep(0.3)
        at = stage.frame
        time.sleep(0.3)
        assert stage.frame == at and not studio.playing
        studio.step_once()
        assert wait(lambda: stage.frame == at + 1)
        studio.restart(9)
        assert wait(lambda: stage.seed == 9 and stage.frame < at)


def test_time_that_was_missed_is_not_made_up_for_ever():
    pace = Pace(30.0)
    pace.restart()
    time.sleep(0.5)
    assert pace.take() <= 30


def test_a_recording_plays_to_its_end_and_can_be_sought(library: Layer):
    play = Playback(record(live(library, "sparring"), 1.0))
    with running(Studio(play, port=0)) as studio:
        assert wait(lambda: play.frame == len(play.recording) - 1)
        studio.seek(5)
        assert play.frame == 5


def _look_side_on(client, studio: Studio) -> None:
    """Put the camera where neither fighter hides the other."""
    a, b = (viewer_of(studio).seen_at(r) for r in studio.stage.root_position)
    along = (b - a) / np.linalg.norm(b - a)
    across = np.array([along[2], 0.0, -along[0]])
    middle = 0.5 * (a + b)
    client.camera.position = middle + 3.5 * across + np.array([0.0, 0.4, 0.0])
    client.camera.look_at = middle


@pytest.mark.slow
def test_both_bodies_are_seen_to_move(library: Layer):
    stage = live(library, "sparring")
    studio = Studio(stage, port=0)
    with browser.watching(studio) as (page, client):

        def differs() -> bool:
            """Around both pelvises, where they were, the picture has changed."""
            before, roots = browser.picture(page), stage.root_position.copy()
            places = [
                browser.project(viewer_of(studio).seen_at(r), client.camera, page) for r in roots
            ]
            page.wait_for_timeout(700)
            after = browser.picture(page)
            changed = [
                np.abs(
                    browser.around(after, p, 40).astype(int)
                    - browser.around(before, p, 40).astype(int)
                ).mean()
                for p in places
            ]
            return min(changed) > 2.0

        browser.wait_until(page, differs, "both bodies to move", 60)
        # The red corner is red, the blue one blue, where the server says that they are.
        studio.set_follow(False)
        studio.toggle()
        _look_side_on(client, studio)
        browser.wait_until(page, lambda: not studio._redraw, "the last picture to be sent")
        browser.let_draw(page)
        position, _ = forward_kinematics(stage.skeleton, stage.root_position, stage.wxyz)
        image = browser.picture(page).astype(int)
        shares = []
        for k in range(2):
            chest = position[k, stage.skeleton.joint("chest")]
            patch = browser.around(
                image, browser.project(viewer_of(studio).seen_at(chest), client.camera, page), 45
            )
            warm = patch[..., 0] - patch[..., 2]
            shares.append(((warm > 40).mean(), (warm < -40).mean()))
        (red_in_red, blue_in_red), (red_in_blue, blue_in_blue) = shares
        assert red_in_red > 0.3 and blue_in_blue > 0.2, shares
        assert red_in_red > red_in_blue and blue_in_blue > blue_in_red, shares


@pytest.mark.slow
def test_the_target_is_dragged_and_the_boxer_goes_for_it(library: Layer):
    stage = live(library, "target", seed=0)
    studio = Studio(stage, port=0)
    studio.set_follow(False)
    studio.toggle()  # hold still, so that the handle stays where it is aimed at
    with browser.watching(studio) as (page, client):
        thing = stage.objects[0]
        home = thing.position.copy()
        moved = False
        # The gizmo's arrows reach out from the target along the ground: try each, near to far.
        for axis, reach in itertools.product(np.eye(3)[[2, 0]], (0.22, 0.25, 0.19, 0.16, 0.3)):
            here = viewer_of(studio).seen_at(thing.position)
            start = browser.project(here + reach * axis, client.camera, page)
            end = browser.project(here + (reach + 0.9) * axis, client.camera, page)
            browser.drag(page, start, end)
            moved = bool(np.linalg.norm(stage.hanging._home[0] - home) > 0.2)
            if moved:
                break
        assert moved, "no arrow of the gizmo could be dragged"
        goal = stage.hanging._home[0].copy()
        studio.set_speed(4.0)
        studio.toggle()
        reach = 1.1

        def arrived() -> bool:
            gap = stage.root_position[0, [0, 2]] - goal[[0, 2]]
            return bool(np.hypot(*gap) < reach)

        browser.wait_until(page, arrived, "the boxer to come to the target", 60)
        hits = sum(isinstance(e, Hit) for e in stage.events)
        browser.wait_until(
            page, lambda: sum(isinstance(e, Hit) for e in stage.events) > hits, "a hit", 60
        )
