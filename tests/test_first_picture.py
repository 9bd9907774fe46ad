"""What the studio shows first: a recorded fight, while the scene asked for is being prepared."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import psutil
import pytest

from kumite.clip import forward_kinematics, tip_positions
from kumite.errors import KumiteError
from kumite.graph import Layer
from kumite.scene import World, load_scene, measure
from kumite.scene.events import Hit
from kumite.studio import Coming, Interlude, Studio
from kumite.studio.bodies import pose_uncompiled
from kumite.studio.coming import RECORDING
from tests.browser import viewer_of
from tests.stranger import CAMERA, control, join, plays_and_is_steered, running, say, setting, wait


def test_the_recorded_fight_is_a_fight():
    recording = Interlude().recording
    assert RECORDING.stat().st_size <= 800_000
    assert 15.0 <= recording.seconds <= 20.0 and recording.scene == "Sparring"
    metrics = measure(recording)
    assert all(c.landed >= 3 and (c.facing_share or 0.0) > 0.8 for c in metrics.characters)
    assert all(c.join_jump_m_s < 0.3 for c in metrics.characters)
    assert min(e.frame for e in recording.events if isinstance(e, Hit)) < 3.0 * recording.fps
    for k in range(2):
        root, wxyz = recording.root_position[:, k], recording.wxyz[:, k]
        position, world = forward_kinematics(recording.skeleton, root, wxyz)
        feet = [
            tip_positions(recording.skeleton, f"{side}_foot", position, world)[:, 1]
            for side in ("left", "right")
        ]
        lowest = np.minimum(*feet)
        assert lowest.min() > -0.03 and np.median(np.abs(lowest)) < 0.03
        plain = pose_uncompiled(recording.skeleton, root.astype(float), wxyz.astype(float))
        np.testing.assert_allclose(plain[0], position, atol=1e-9)
        np.testing.assert_allclose(plain[1], world, atol=1e-9)


def test_it_plays_over_and_over():
    stage = Interlude()
    stage.seek(len(stage.recording) - 1)
    assert stage.step() and stage.frame == 0


@contextlib.contextmanager
def preparing(stage: World, go: threading.Event) -> Iterator[tuple[Studio, Coming]]:
    """A studio that shows the recorded fight till ``go``."""

    def make(coming: Coming) -> World:
        coming.tell("compiling 34 of 133", 0.25)
        go.wait(60)
        return stage

    coming = Coming(stage.title, make)
    studio = Studio(Interlude(), port=0, coming=coming)
    coming.start()
    with running(studio):
        yield studio, coming


def test_the_live_scene_follows_in_the_same_page(library: Layer):
    stage, go = World(load_scene("target"), library, seed=3), threading.Event()
    with preparing(stage, go) as (studio, _), join(studio) as page:
        say(page, CAMERA)
        plays_and_is_steered(studio)
        assert wait(lambda: "34 of 133" in viewer_of(studio).panel._banner._text.content)  # type: ignore
        old = setting(studio, "Speed", 2.0)
        go.set()
        assert wait(lambda: studio.stage is stage and stage.frame > 0)
        assert control(studio, "Seed").value == 3
        labels = {h.label for h in studio.server.gui._gui_input_handle_from_uuid.values()}
        assert "Time" not in labels and any(
            (label or "").startswith("approach") for label in labels
        )
        say(page, old)  # of a control that was there a moment ago
        say(page, setting(studio, "Speed", 3.0))
        assert wait(lambda: studio._pace.speed == 3.0)
        plays_and_is_steered(studio)


def test_time_counts_from_the_live_scene_on(library: Layer):
    stage, go = World(load_scene("target"), library, seed=3), threading.Event()
    coming = Coming(stage.title, lambda coming: (go.wait(60), stage)[1])
    studio = Studio(Interlude(), port=0, coming=coming)
    coming.start()
    thread = threading.Thread(target=studio.run, args=(0.5,), daemon=True)
    thread.start()
    time.sleep(1.0)
    assert thread.is_alive()
    go.set()
    thread.join(30)
    studio.close()
    assert not thread.is_alive() and studio.stage is stage and stage.frame > 0


def test_what_cannot_be_prepared_ends_the_studio_with_its_reason():
    def make(coming: Coming) -> World:
        raise KumiteError("no such library")

    coming = Coming("Target", make)
    studio = Studio(Interlude(), port=0, coming=coming)
    coming.start()
    with pytest.raises(KumiteError, match="no such library"):
        studio.run(30.0)
    studio.close()


def test_it_says_how_much_time_is_left():
    coming = Coming("Target", lambda coming: Interlude())
    coming.tell("compiling 2 of 8", 0.25)
    assert coming.line() == "compiling 2 of 8"  # too soon to tell
    coming._begun -= 10.0
    assert coming.line() == "compiling 2 of 8, some 30 s left"


def test_nothing_that_works_for_it_is_left_behind():
    started = threading.Event()
    code = "import subprocess, sys; subprocess.run([sys.executable, '-c', 'input()'])"
    found: list[subprocess.Popen[bytes]] = []

    def make(coming: Coming) -> Interlude:
        process = subprocess.Popen(
            [sys.executable, "-c", code], stdin=subprocess.PIPE, start_new_session=True
        )
        found.append(process)
        coming.own(process)
        started.set()
        process.wait()
        return Interlude()

    coming = Coming("Target", make)
    coming.start()
    assert started.wait(10)
    parent = psutil.Process(found[0].pid)
    assert wait(lambda: len(parent.children()) == 1)
    (child,) = parent.children()
    coming.stop()
    assert wait(lambda: not child.is_running() or child.status() == psutil.STATUS_ZOMBIE)
    assert found[0].poll() is not None


@pytest.mark.slow
def test_a_first_start_shows_the_recorded_fight_and_ends_cleanly(tmp_path: Path):
    environment = {**os.environ, "KUMITE_CACHE": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path)}
    studio = subprocess.Popen(
        [sys.executable, "-u", "-m", "kumite", "studio", "target", "--port", "0", "--no-browser"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=environment,
        start_new_session=True,
        # Whatever starts the tests may ignore Ctrl-C, as background jobs of a shell do.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert studio.stdout is not None
    said = [studio.stdout.readline(), studio.stdout.readline()]
    url = said[0].split()[1]
    assert "recorded fight" in said[1] and "Target" in said[1] and "only this once" in said[1]
    with urllib.request.urlopen(url, timeout=30) as page:
        assert b"<html" in page.read(2000).lower()
    parent = psutil.Process(studio.pid)
    assert wait(lambda: parent.children(recursive=True), 30)
    time.sleep(1.0)
    working = parent.children(recursive=True)
    studio.send_signal(signal.SIGINT)
    rest = studio.communicate(timeout=60)[0]
    assert studio.returncode == 0 and "studio closed" in rest and "Traceback" not in rest
    _, alive = psutil.wait_procs(working, timeout=10)
    assert not alive
