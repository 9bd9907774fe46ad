"""Avoidance parts: how they are found, kept in the file of actions, and kept whole in a graph."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from kumite.annotate import (
    AvoidanceParts,
    find_avoidance,
    find_contacts,
    no_avoidance,
)
from kumite.annotate.action_score import score_avoidance, true_avoidance
from kumite.clip import Clip, ClipSet, Skeleton, concatenate, mirror, resample
from kumite.errors import KumiteError
from kumite.performer import perform
from kumite.rotation import from_axis_angle, multiply
from tests import toys

FPS = 60.0


def found_in(clips: ClipSet) -> AvoidanceParts:
    return find_avoidance(clips, find_contacts(clips))


# How well ----------------------------------------------------------------------------------------


def test_the_performers_parts_are_found():
    made = perform("avoidance", seed=100)  # thresholds were set on seeds 0 to 2; both hands
    clips = concatenate(made.clips)
    parts = found_in(clips)
    score = score_avoidance(clips, parts, made.truth)
    assert score.precision >= 0.95 and score.recall >= 0.92, score
    assert np.percentile(np.abs(score.start_off), 95) < 0.1
    strict = score_avoidance(clips, parts, made.truth, common=0.7)
    assert strict.precision >= 0.85 and strict.recall >= 0.8, strict


def test_a_boxers_defences_are_found():
    made = perform("boxing", seed=100, mirrored=False)
    clips = concatenate(made.clips)
    score = score_avoidance(clips, found_in(clips), made.truth)
    assert score.recall >= 0.85, score
    assert score.found - score.right < 4 * clips.seconds / 60  # quick steps back, most of them


def test_a_walker_hardly_avoids():
    made = perform("locomotion", seed=100, mirrored=False)
    clips = concatenate(made.clips)
    score = score_avoidance(clips, found_in(clips), made.truth)
    assert score.recall >= 0.9  # leaps aside
    assert score.found - score.right < clips.seconds / 60


@pytest.mark.parametrize("fps", [30.0, 120.0])
def test_any_rate_will_do(fps: float):
    made = perform("avoidance", seed=3, mirrored=False)
    first = found_in(concatenate(made.clips))
    clips = concatenate(made.clips, fps)
    other = found_in(clips)
    assert abs(len(other) - len(first)) <= 0.05 * len(first)
    share = fps / made.clips[0].fps
    near = np.abs(first.centre[:, None] * share - other.centre).min(axis=1)
    assert np.mean(near < 0.1 * fps) > 0.9


@pytest.mark.slow
@pytest.mark.parametrize(
    ("files", "least", "most"),
    [
        (["boxer/ducking.bvh"], 16, 19),  # 17 ducks
        (["woody/3_pass_duck.amc"], 4, 4),
        (["woody/3_pass_jump.amc"], 4, 4),
        (["woody/1_walk_jump_walk.amc"], 4, 4),
        (["woody/3_avoid.amc"], 4, 6),
        ([f"woody/1_jump{end}.amc" for end in ("", "_1", "_2", "_high", "_high_1")], 5, 5),
        ([f"boxer/{blow}.bvh" for blow in ("jab_left", "onetwo", "hook_left_near")], 0, 1),
        (["woody/1_walk_straight.amc", "woody/1_run_straight.amc", "woody/3_walk.amc"], 0, 1),
        (["woody/3_beat.amc", "woody/1_punch.amc", "woody/1_slap.amc"], 0, 2),
    ],
)
def test_real_takes(mocap: Path, files: list[str], least: int, most: int):
    from kumite import mocap as mocap_files

    loaded = mocap_files.load([str(mocap / f) for f in files])
    assert least <= len(found_in(loaded.clip_set())) <= most


# Toys, whose every movement is known --------------------------------------------------------------


def bump(frames: int, begin: int, there: int, back: int, end: int) -> np.ndarray:
    """0 to 1 and back [frames], smoothly."""
    at = np.arange(frames)
    up = np.clip((at - begin) / (there - begin), 0, 1)
    down = np.clip((at - back) / (end - back), 0, 1)
    return up**2 * (3 - 2 * up) - down**2 * (3 - 2 * down)


def toy(
    frames: int = 240,
    *,
    bow: float = 0.0,
    lean: float = 0.0,
    rise: float = 0.0,
    times: tuple[int, int, int, int] = (100, 118, 124, 145),
    skeleton: Skeleton | None = None,
) -> ClipSet:
    """Stands for 4 s at 60 Hz, but between these frames bows, leans [rad] or is aloft [m]."""
    way = bump(frames, *times)
    still = toys.still(frames, fps=FPS)
    root, wxyz, s = still.root_position.copy(), still.wxyz.copy(), still.skeleton
    root[:, 1] += rise * way
    spine = s.names.index("spine")
    wxyz[:, spine] = multiply(
        from_axis_angle([1.0, 0.0, 0.0], bow * way), from_axis_angle([0.0, 0.0, 1.0], lean * way)
    )
    return concatenate([Clip("toy", s, FPS, root, wxyz)])


@pytest.mark.parametrize("way", [{"bow": 1.3}, {"lean": 0.9}, {"lean": -0.9}])
def test_out_and_back_is_one_part(way: dict):
    parts = found_in(toy(**way))
    assert len(parts) == 1
    # Out of where it was: later than it begins, sooner than it is over, and all that lies between.
    assert 102 < parts.start[0] < 118 and 124 < parts.stop[0] < 143


def test_a_jump_is_what_is_aloft():
    parts = found_in(toy(rise=0.3, times=(100, 115, 116, 131)))
    assert len(parts) == 1
    assert 100 < parts.start[0] < 110 and 121 < parts.stop[0] < 132


@pytest.mark.parametrize(
    "way",
    [
        {},
        {"bow": 0.2},  # too little
        {"lean": 0.9, "times": (20, 120, 125, 225)},  # too slow
        {"bow": 1.3, "times": (100, 118, 300, 320)},  # it does not come back
    ],
)
def test_what_is_no_avoidance(way: dict):
    assert len(found_in(toy(**way))) == 0


def test_a_clip_is_as_good_in_the_mirror_and_at_another_rate():
    (clip,) = toy(lean=0.9)
    (seen,) = [found_in(concatenate([mirror(clip)]))]
    here = found_in(toy(lean=0.9))
    assert np.array_equal(here.start, seen.start) and np.array_equal(here.stop, seen.stop)
    slow = found_in(concatenate([resample(clip, 25.0)]))
    assert abs(slow.centre[0] / 25 - here.centre[0] / FPS) < 0.05


def test_parts_lie_each_in_one_clip():
    (clip,) = toy(bow=1.3)
    both = concatenate([clip, Clip("again", clip.skeleton, FPS, clip.root_position, clip.wxyz)])
    parts = found_in(both)
    assert parts.clip.tolist() == [0, 1]
    assert parts.start[1] - parts.start[0] == len(clip)


def test_notes_of_other_clips_are_refused():
    clips = toy()
    with pytest.raises(KumiteError, match="contacts are of other clips"):
        find_avoidance(clips, find_contacts(toys.clip_set([30])))


# The table ---------------------------------------------------------------------------------------


def some(start: list[int], stop: list[int], clips: list[int] | None = None) -> AvoidanceParts:
    return AvoidanceParts(np.array(start), np.array(stop), np.array(clips or [0, 50, 100]))


@pytest.mark.parametrize(
    ("start", "stop", "message"),
    [
        ([5], [5], "must stop after"),
        ([5, 8], [9, 20], "overlap"),
        ([30, 8], [40, 20], "overlap, or are not in order"),
        ([90], [101], "outside the 100 frames"),
        ([-1], [4], "outside"),
        ([40], [51], "into the next"),
        ([4], [5, 6], "stop is"),
    ],
)
def test_parts_that_make_no_sense_are_refused(start: list[int], stop: list[int], message: str):
    with pytest.raises(KumiteError, match=message):
        some(start, stop)


def test_centres_and_inner_frames():
    parts = some([10, 60], [15, 61])
    assert parts.centre.tolist() == [12.0, 60.0] and len(parts) == 2
    assert np.flatnonzero(parts.inner).tolist() == [11, 12, 13, 14]
    assert len(no_avoidance(np.array([0, 9]))) == 0


def test_parts_within_ranges_of_frames():
    parts = some([10, 20, 60], [15, 26, 66])
    first = np.array([10, 11, 0, 20, 60, 70])
    last = np.array([14, 40, 24, 25, 64, 90])
    begin, part = parts.within(first, last)
    held = [part[a:b].tolist() for a, b in zip(begin[:-1], begin[1:])]
    assert held == [[0], [1], [0], [1], [], []]
    slow = [
        [p for p in range(3) if a <= parts.start[p] and parts.stop[p] - 1 <= b]
        for a, b in zip(first, last)
    ]
    assert held == slow


def test_scores_are_counted_one_to_one():
    made = perform("avoidance", seed=0, mirrored=False)
    clips = concatenate(made.clips)
    true = true_avoidance(clips, made.truth)
    perfect = score_avoidance(clips, true, made.truth)
    assert perfect.precision == perfect.recall == 1.0
    assert not perfect.start_off.any() and not perfect.stop_off.any()
    half = AvoidanceParts(true.start[::2], true.stop[::2] + 1, clips.clip_start)
    score = score_avoidance(clips, half, made.truth)
    assert score.precision == 1.0 and score.recall == pytest.approx(0.5, abs=0.01)
    assert np.allclose(score.stop_off, 1 / clips.fps)
    none = score_avoidance(clips, no_avoidance(clips.clip_start), made.truth)
    assert none.right == 0 and none.recall == 0.0
