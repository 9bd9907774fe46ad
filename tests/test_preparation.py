"""Preparation: blend weights, the trajectory, feet, levels over time; on the performer."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation, Slerp

from kumite.annotate import find_contacts, find_cycles, find_reference
from kumite.clip import SIDES, ClipSet, concatenate, facing_frame, forward_kinematics
from kumite.errors import KumiteError
from kumite.graph import authored_targets
from kumite.kernels import preparation as kernels
from kumite.performer import perform
from kumite.rotation import angle, planar_compose, planar_inverse, rotate
from kumite.synthesis import (
    LevelFilter,
    Preparation,
    curves,
    level_displacements,
    prepare_clip,
    references,
    repeat_cycle,
    smooth_levels,
)
from kumite.synthesis.preparation import weights


class Walker:
    """A walk of six cycles, what it is from, and what it prepares for: duck under, punch."""

    def __init__(self) -> None:
        made = perform("targets", mirrored=False)
        self.clips: ClipSet = concatenate(list(made.clips))
        self.contacts = find_contacts(self.clips)
        self.cycles = find_cycles(self.clips, self.contacts)
        targets = authored_targets(self.clips, made.truth, 60.0)
        chosen = [targets.label.index(n) for n in ("duck_under", "punch")]
        self.found = [
            find_reference(self.clips, self.contacts, targets.start[t], targets.mark[t])
            for t in chosen
        ]
        self.postures = references(self.clips, [r.frame for r in self.found])
        walk = self.cycles.label.index("walk")
        self.clip, self.ground = repeat_cycle(self.clips, self.contacts, self.cycles, walk, 6)

    def at(self, level, reference=0, **more):
        return prepare_clip(
            self.clip, self.ground, self.postures, level, reference=reference, **more
        )


@pytest.fixture(scope="module")
def walker() -> Walker:
    return Walker()


def joints_of(clip):
    return forward_kinematics(clip.skeleton, clip.root_position, clip.wxyz)[0]


def sliding(clip, on_ground):
    """Speeds [n] m/s along the ground of supporting feet: of the slower of ankle and toes."""
    position, out = joints_of(clip), []
    for s, side in enumerate(SIDES):
        parts = [clip.skeleton.joint(f"{side}_{p}") for p in ("foot", "toe")]
        step = np.diff(position[:, parts][..., [0, 2]], axis=0)
        held = on_ground[1:, s] & on_ground[:-1, s]
        out.append(np.linalg.norm(step, axis=2).min(axis=1)[held] * clip.fps)
    return np.concatenate(out)


# The weight ---------------------------------------------------------------------------------------


def test_weights_in_closed_form():
    a = np.linspace(0, 1, 41)
    w = weights(a, np.array([1.0, 0.5, 2.0]))
    np.testing.assert_allclose(w[:, 0], a, atol=1e-15)  # linear
    # C = 0.5 is the quarter circle round (1, 0), C = 2 its square-root sibling.
    np.testing.assert_allclose((1 - a) ** 2 + w[:, 1] ** 2, 1.0, atol=1e-12)
    np.testing.assert_allclose(np.sqrt(w[:, 2]) + np.sqrt(1 - a), 1.0, atol=1e-12)
    assert np.all(w[1:-1, 1] > w[1:-1, 0]), "the upper body leads"


@pytest.mark.jit_off
@given(st.floats(0, 1), st.floats(0.05, 8))
@settings(max_examples=100, deadline=None)
def test_weights_of_any_curve(level: float, curve: float):
    w = kernels.blend_weight(level, curve)
    assert 0.0 <= w <= 1.0
    assert kernels.blend_weight(0.0, curve) == 0.0 and kernels.blend_weight(1.0, curve) == 1.0
    assert kernels.blend_weight(min(level + 0.01, 1.0), curve) >= w - 1e-12
    assert w == pytest.approx(float(weights(np.array(level), np.array([curve]))[0]), abs=1e-9)


@pytest.mark.jit_off
@given(st.integers(0, 2**32 - 1), st.floats(0, 1))
@settings(max_examples=60, deadline=None)
def test_arcs_are_scipys(seed: int, part: float):
    q = Rotation.random(2, random_state=seed)
    a, b = q.as_quat(scalar_first=True)
    ours = kernels.arc(*a, *b, part)
    theirs = Slerp([0, 1], q)(part).as_quat(scalar_first=True)
    assert angle(np.array(ours), theirs) < 1e-6
    assert np.linalg.norm(ours) == pytest.approx(1.0, abs=1e-12)


def test_curves_of_joints_and_what_is_wrong_with_them(walker: Walker):
    skeleton = walker.clips.skeleton
    c = curves(skeleton)
    assert c[0] == c[skeleton.joint("left_shin")] == c[skeleton.joint("right_toe")] == 1.0
    assert c[skeleton.joint("chest")] == c[skeleton.joint("left_hand")] == 0.5
    c = curves(skeleton, {"legs": 2.0, "head": 0.25, skeleton.names[1]: 3.0})
    assert (c[0], c[skeleton.joint("head")], c[1]) == (2.0, 0.25, 3.0)
    for wrong in (0.0, -1.0, np.nan):
        with pytest.raises(KumiteError, match=r"C of 'head' is .* more than 0"):
            curves(skeleton, {"head": wrong})
    with pytest.raises(KumiteError, match="unknown joint, role or group 'haed'"):
        curves(skeleton, {"haed": 1.0})
    for level in (-0.1, 1.1, np.nan):
        with pytest.raises(KumiteError, match="a level of"):
            walker.at(level)


# Poses --------------------------------------------------------------------------------------------


def test_unprepared_is_the_locomotion_to_the_bit(walker: Walker):
    shown = walker.at(0.0)
    assert shown.root_position.tobytes() == walker.clip.root_position.tobytes()
    assert shown.wxyz.tobytes() == walker.clip.wxyz.tobytes()


@pytest.mark.parametrize("reference", [0, 1])
def test_all_prepared_is_the_posture_on_the_spot(walker: Walker, reference: int):
    shown = walker.at(1.0, reference)
    frame = walker.found[reference].frame
    assert angle(shown.wxyz[:, 1:], walker.clips.wxyz[frame, 1:]).max() < 1e-6
    assert np.ptp(shown.root_position, axis=0).max() < 1e-9
    height = walker.clips.root_position[frame, 1]
    assert shown.root_position[0, 1] == pytest.approx(height, abs=1e-6)
    # Where it looks is where the walk looked; how it leans is the posture's.
    tilt = [rotate(q, [0.0, 1.0, 0.0])[1] for q in (shown.wxyz[0, 0], walker.clips.wxyz[frame, 0])]
    assert tilt[0] == pytest.approx(tilt[1], abs=1e-9)


def test_poses_are_continuous_in_the_level(walker: Walker):
    levels = [0.0, 1e-7, 1e-4, 0.3, 0.3 + 1e-4, 0.999, 1.0 - 1e-7, 1.0]
    shown = {a: joints_of(walker.at(a)) for a in levels}

    def apart(a, b):
        return np.abs(shown[a] - shown[b]).max()

    assert apart(0.0, 1e-7) < 2e-3  # the quarter circle leaves 0 upright: √(2 · 1e-7) = 4e-4 rad
    assert apart(0.3, 0.3 + 1e-4) < 1e-2
    assert apart(1.0 - 1e-7, 1.0) < 1e-3
    finer = [joints_of(walker.at(0.0 + d, curve=curves(walker.clips.skeleton, {"upper": 1.0})))
             for d in (1e-4, 1e-6)]  # fmt: skip
    assert np.abs(finer[0] - shown[0.0]).max() < 5e-3
    assert np.abs(finer[1] - shown[0.0]).max() < 5e-5


@pytest.mark.parametrize("reference", [0, 1])
@pytest.mark.parametrize("level", [0.2, 0.5, 0.8, 1.0])
def test_feet_that_support_do_not_slide(walker: Walker, level: float, reference: int):
    captured = sliding(walker.clip, walker.ground)
    shown = sliding(walker.at(level, reference), walker.ground)
    assert shown.mean() < captured.mean() + 0.01
    assert shown.max() < captured.max() + 0.02
    if level < 1.0:  # the blend alone, with no foot held, slides
        none = np.zeros_like(walker.ground)
        raw = prepare_clip(walker.clip, none, walker.postures, level, reference=reference)
        assert sliding(raw, walker.ground).mean() > 2 * shown.mean()


def test_feet_do_not_sink_into_the_ground(walker: Walker):
    toes = [walker.clip.skeleton.joint(f"{side}_toe") for side in SIDES]
    lowest = joints_of(walker.clip)[:, toes, 1].min()
    for level in np.linspace(0, 1, 6):
        assert joints_of(walker.at(level))[:, toes, 1].min() > lowest - 0.005


def test_the_root_goes_the_shorter_way_and_lower(walker: Walker):
    whole = np.linalg.norm(np.ptp(walker.clip.root_position[:, [0, 2]], axis=0))
    heights = []
    for level in (0.0, 0.25, 0.5, 1.0):
        shown = walker.at(level)
        way = np.linalg.norm((shown.root_position[-1] - shown.root_position[0])[[0, 2]])
        assert way == pytest.approx((1 - level) * whole, rel=0.01, abs=1e-6)
        heights.append(shown.root_position[:, 1].mean())
    assert np.all(np.diff(heights) < 0), "who prepares to duck goes down"


def test_a_level_that_changes_moves_without_jumps(walker: Walker):
    frames = len(walker.clip)
    level = smooth_levels(np.where(np.arange(frames) % 120 < 60, 0.0, 1.0), 60.0)
    shown = joints_of(walker.at(level))
    speed = np.linalg.norm(np.diff(shown, axis=0), axis=2) * 60.0
    plain = np.linalg.norm(np.diff(joints_of(walker.clip), axis=0), axis=2) * 60.0
    assert speed.max() < plain.max() + 3.0  # m/s; a jump of 10 cm would be 6
    slide = sliding(walker.at(level), walker.ground)
    assert slide.mean() < 0.01 and slide.max() < 0.12


# Many at once -------------------------------------------------------------------------------------


def stepped(walker: Walker, work: Preparation, f: int, count: int, level, reference=0):
    clip = walker.clip
    position = joints_of(clip)[f]
    facing = facing_frame(clip.skeleton, clip.root_position, clip.wxyz)[f]
    feet = [clip.skeleton.joint(f"{side}_foot") for side in SIDES]
    args = (clip.root_position[f], clip.wxyz[f], facing, position[feet], walker.ground[f])
    work.show(*(np.repeat(x[None], count, axis=0) for x in args), level, reference)


def test_many_characters_are_each_as_one(walker: Walker):
    level, reference = np.array([0.0, 0.4, 1.0]), np.array([0, 1, 0])
    work = Preparation(walker.clip.skeleton, 60.0, walker.postures, 3)
    for f in range(80):
        stepped(walker, work, f, 3, level, reference)
    for k in range(3):
        alone = walker.at(level[k], int(reference[k]))
        np.testing.assert_allclose(work.root_position[k], alone.root_position[79], atol=1e-12)
        assert angle(work.wxyz[k], alone.wxyz[79]).max() < 1e-7
    with pytest.raises(KumiteError, match="expected 0 … 1"):
        stepped(walker, work, 0, 3, level, 2)
    with pytest.raises(KumiteError, match=r"\[2, 3\], expected \[3, 3\]"):
        stepped(walker, work, 0, 2, 0.5)


def test_a_character_may_be_placed(walker: Walker):
    work = Preparation(walker.clip.skeleton, 60.0, walker.postures, 1)
    here = facing_frame(walker.clip.skeleton, walker.clip.root_position[:1], walker.clip.wxyz[:1])
    there = np.array([3.0, -2.0, 1.0])
    work.place(0, here[0], there)
    stepped(walker, work, 0, 1, 0.0)
    np.testing.assert_allclose(work.facing[0], there, atol=1e-12)
    np.testing.assert_allclose(work.root_position[0, [0, 2]], there[:2], atol=1e-6)


@pytest.mark.slow
def test_a_character_frame_is_fast(walker: Walker):
    count = 100
    work = Preparation(walker.clip.skeleton, 60.0, walker.postures, count)
    best = np.inf
    for f in range(30):
        begin = time.perf_counter()
        stepped(walker, work, f, count, 0.5)
        best = min(best, time.perf_counter() - begin)
    assert best / count < 100e-6  # 3 µs when nothing else runs, and the twin that repeats poses


# What a controller plans on -----------------------------------------------------------------------


def test_displacements_by_level(walker: Walker):
    levels = np.linspace(0, 1, 6)
    moved, seconds = level_displacements(walker.clips, walker.cycles, levels)
    assert moved.shape == (len(walker.cycles), 6, 3)
    np.testing.assert_allclose(moved[:, 0], walker.cycles.displacement, atol=1e-9)
    np.testing.assert_allclose(moved[:, -1], 0.0, atol=1e-12)
    np.testing.assert_allclose(seconds, walker.cycles.seconds)
    # What a character shows is what was planned: two cycles apart, past the first steps.
    walk = walker.cycles.label.index("walk")
    span = walker.cycles.stop[walk] - walker.cycles.start[walk]
    for a, level in enumerate(levels):
        work = Preparation(walker.clip.skeleton, 60.0, walker.postures, 1)
        stepped(walker, work, 0, 1, level)
        before = work.facing[0].copy()
        for f in range(1, span + 1):
            stepped(walker, work, f, 1, level)
        went = planar_compose(planar_inverse(before), work.facing[0])
        np.testing.assert_allclose(went, moved[walk, a], atol=0.01)


# Levels over time ---------------------------------------------------------------------------------


@given(st.lists(st.floats(0, 1), min_size=1, max_size=60), st.floats(0, 0.4))
@settings(max_examples=50, deadline=None)
def test_smooth_levels_stay_levels(level: list[float], sigma: float):
    out = smooth_levels(np.array(level), 30.0, sigma=sigma)
    assert out.min() >= min(level) - 1e-12 and out.max() <= max(level) + 1e-12
    if sigma == 0:
        np.testing.assert_array_equal(out, level)


def test_the_filter_that_runs_is_the_one_that_looks_back():
    rng = np.random.default_rng(0)
    level = np.repeat(rng.random((12, 2)), 20, axis=0)
    live = LevelFilter(2, 60.0, sigma=0.1)
    late = np.array([live.push(row) for row in level])
    delay = round(live.delay * 60)
    whole = smooth_levels(level, 60.0, sigma=0.1)
    np.testing.assert_allclose(late[delay:], whole[: len(level) - delay], atol=1e-12)
    theirs = gaussian_filter1d(level, 6.0, axis=0, mode="nearest", truncate=2.0)
    np.testing.assert_allclose(whole, theirs, atol=1e-12)
    with pytest.raises(KumiteError, match="sigma"):
        smooth_levels(level, 60.0, sigma=-1.0)
