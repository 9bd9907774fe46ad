"""What a library is approached with: cores, steered ones, and the command that learns from them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from kumite.cli.train import _some
from kumite.control import PreparationSettings, approach_motions, gradual, trained_approach
from kumite.control import preparation as learning
from kumite.control.preparation import build_process
from kumite.errors import KumiteError
from kumite.graph import Layer, save_library
from kumite.graph.preparing import Preparing
from kumite.rotation import planar_compose, planar_inverse
from tests.shared import builtin

QUICK = gradual(places=16, batch=1)


def prepared(library: Layer) -> Preparing:
    assert library.preparing is not None
    return library.preparing


@pytest.fixture(scope="module")
def library() -> Layer:
    return builtin("targets", "preparation")


def test_every_core_that_moves_is_steered(library: Layer):
    approach = approach_motions(library, steer=(0.0, 0.5, -0.5), gaits=("run", "walk"))
    cores = prepared(library).hierarchy.cores
    stand, walk = cores.label.index("stand"), cores.label.index("walk")
    assert stand not in approach.core  # nobody gets anywhere by standing
    assert set(approach_motions(library).core) == {walk}
    assert approach.steer[approach.core == walk].tolist() == [0.0, 0.5, -0.5]
    assert "walk left 28.6°" in approach.motions.names
    assert approach.motions.displacement.shape == (6, 5, 3)
    np.testing.assert_allclose(approach.motions.duration, cores.seconds[approach.core])
    links = prepared(library).hierarchy.links
    for r, a in enumerate(approach.core):
        for c, b in enumerate(approach.core):
            assert approach.motions.follows[r, c] == links[a, b]


def test_gaits_say_which_cores_are_taken(library: Layer):
    cores = prepared(library).hierarchy.cores
    for gaits in (["walk"], ["run"], ["run", "walk"]):
        approach = approach_motions(library, gaits=gaits)
        assert {cores.label[c] for c in approach.core.tolist()} == set(gaits)
        assert len(approach.core) == 5 * len(gaits)  # each with every steer
    slow, fast = (approach_motions(library, steer=(0.0,), gaits=[g]) for g in ("walk", "run"))
    slow, fast = (
        np.hypot(*a.motions.displacement[0, 0, :2]) / a.motions.duration[0] for a in (slow, fast)
    )
    assert fast > 1.5 * slow  # m/s


def test_a_steered_walk_is_the_walk_turned_frame_by_frame(library: Layer):
    approach = approach_motions(library, steer=(0.0, 0.6))
    cores, clips = prepared(library).hierarchy.cores, library.clips
    walk = cores.label.index("walk")
    start, stop = int(cores.start[walk]), int(cores.stop[walk])
    plain, steered = np.flatnonzero(approach.core == walk)
    moved = approach.motions.displacement
    whole = planar_compose(planar_inverse(clips.facing[start]), clips.facing[stop])
    np.testing.assert_allclose(moved[plain, 0], whole, atol=1e-9)
    # Complex numbers for the ground: x along the imaginary axis, so that a turn to the left adds.
    for a, level in enumerate(gradual().chosen):
        at, yaw, share = 0j, 0.0, 1.0 - level
        for f in range(start, stop):
            x, z, turn = planar_compose(planar_inverse(clips.facing[f]), clips.facing[f + 1])
            at += share * (z + 1j * x) * np.exp(1j * yaw)
            yaw += share * (turn + 0.6 / (stop - start))
        expected = (at.imag, at.real, yaw)
        np.testing.assert_allclose(moved[steered, a], expected, atol=1e-9)
    assert moved[steered, 0, 2] - moved[plain, 0, 2] == pytest.approx(0.6, abs=1e-6)


def test_without_steering_goals_behind_are_out_of_reach(library: Layer):
    with pytest.raises(KumiteError, match="the goal cannot be reached from 16 of 32 cells"):
        build_process(approach_motions(library, steer=(0.0,)).motions, gradual())
    build_process(approach_motions(library).motions, gradual())


def test_motions_that_cannot_be(library: Layer, fighters: Layer):
    with pytest.raises(KumiteError, match=r"unknown gait 'stand'.*run, walk"):
        approach_motions(library, gaits=("stand",))
    with pytest.raises(KumiteError, match="holds no target motions; expected one for preparation"):
        approach_motions(fighters)
    with pytest.raises(KumiteError, match="expected several, each a number, none of them NaN"):
        approach_motions(library, steer=(float("nan"),))
    for wrong in ((), (2.0,)):
        with pytest.raises(KumiteError, match=r"expected extra turns of at most 1\.6 rad"):
            approach_motions(library, steer=wrong)
    with pytest.raises(KumiteError, match="expected each turn once"):
        approach_motions(library, steer=(0.0, 0.3, 0.3))


def test_what_is_learned_is_kept_and_taken_up_again(library: Layer, tmp_path: Path):
    approach, whole = trained_approach(library, tmp_path / "a", QUICK, seed=3, most_batches=6)

    def stop(batch: int, changed: float) -> None:
        if batch == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        trained_approach(library, tmp_path / "b", QUICK, seed=3, most_batches=6, progress=stop)
    assert list((tmp_path / "b").glob("*.learning"))
    batches: list[int] = []
    again = trained_approach(
        library,
        tmp_path / "b",
        QUICK,
        seed=3,
        most_batches=6,
        progress=lambda batch, changed: batches.append(batch),
    )[1]
    assert batches[0] == 3 and not list((tmp_path / "b").glob("*.learning"))
    assert again.best.tobytes() == whole.best.tobytes()
    kept = trained_approach(
        library,
        tmp_path / "b",
        QUICK,
        seed=3,
        most_batches=6,
        progress=lambda batch, changed: pytest.fail("it is kept"),
    )[1]
    assert kept.best.tobytes() == whole.best.tobytes()
    assert whole.best.max() < len(approach.motions.names) * QUICK.levels


# The command --------------------------------------------------------------------------------------


def test_train_learns_keeps_and_goes_on(run, library, tmp_path: Path, monkeypatch):
    monkeypatch.setattr("kumite.cli.progress.INTERVALS", (0.0,))  # every batch is told
    path = tmp_path / "p.kumite"
    save_library(path, library)
    code, text, err = run("train", path, "--most-batches", 3, "--seed", 201)
    assert code == 0, err
    assert "5 motions: walk, walk left 22.9°" in text
    assert "stopped unsettled after 3 batches" in text and "batch 2" in err
    assert "--most-batches" in err
    code, text, _ = run("train", path, "--most-batches", 3, "--seed", 201, "--json")
    told = json.loads(text)
    assert code == 0 and told["batches"] == 3 and not told["converged"]
    assert len(told["motions"]) == 5 and told["folder"] == f"{path}.cache"
    assert 0 < told["curve"]["changed"][2] < told["curve"]["changed"][0] <= 1

    batch = learning.Learning.batch

    def interrupted(self):
        if self.batches == 2:
            raise KeyboardInterrupt
        return batch(self)

    monkeypatch.setattr(learning.Learning, "batch", interrupted)
    code, text, err = run("train", path, "--most-batches", 4, "--seed", 202)
    assert code == 130 and "interrupted after batch 2" in err and "goes on from there" in err
    monkeypatch.setattr(learning.Learning, "batch", batch)
    code, text, err = run("train", path, "--most-batches", 4, "--seed", 202)
    assert code == 0 and "batch 3" in err and "batch 2," not in err


def test_train_is_refused(run, fighters, library, tmp_path: Path):
    save_library(tmp_path / "f.kumite", fighters)
    save_library(tmp_path / "p.kumite", library)
    for arguments, text in (
        (("f.kumite",), "the library has no layer 'preparation'"),
        (("none.kumite",), "none.kumite"),
        (("p.kumite", "--steer", 0), "the goal cannot be reached from"),
        (("p.kumite", "--steer", 200), "at most 1.6 rad"),
    ):
        code, _, err = run("train", tmp_path / arguments[0], *arguments[1:])
        assert code == 2 and text in err


def test_rows_of_a_curve():
    assert _some(1) == [0]
    assert _some(10) == [0, 1, 3, 7, 9]
    assert PreparationSettings().levels == 5
