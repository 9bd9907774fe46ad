"""Preparation: blend weights, the trajectory, feet, levels over time; on the performer."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation, Slerp

from kumite.annotate import find_contacts, find_cycles, find_reference, find_strikes
from kumite.clip import SIDES, ClipSet, concatenate, facing_frame, forward_kinematics
from kumite.errors import KumiteError
from kumite.graph import Layer, authored_targets, build_hierarchy, hierarchy_table
from kumite.kernels import preparation as kernels
from kumite.rotation import angle, planar_compose, planar_inverse, rotate
from kumite.synthesis import (
    Cast,
    LevelFilter,
    Preparation,
    References,
    curves,
    level_displacements,
    prepare_clip,
    references,
    repeat_cycle,
    smooth_levels,
)
from kumite.synthesis.preparation import blended, weights
from tests.shared import performed


class Walker:
    """A walk of six cycles, what it is from, and what it prepares for: duck under, punch."""

    def __init__(self) -> None:
        made = performed("targets")
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
    q = Rotation.from_quat(np.random.default_rng(seed).normal(size=(2, 4)))
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
        with pytest.raises(KumiteError, match=r"a level of|level: nan; expected .* NaN"):
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


# Postures in between -----------------------------------------------------------------------------


def test_all_of_one_posture_is_that_posture(walker: Walker):
    some = walker.postures
    mixed = blended(some, np.array([[0.0, 3.0], [0.25, 0.0], [0.0, 1.0]]))
    for n, r in enumerate((1, 0, 1)):
        # Unit quaternions are normalised again, which may turn a last bit.
        np.testing.assert_allclose(mixed.wxyz[n], some.wxyz[r], rtol=0, atol=1e-15)
        assert mixed.root[n].tobytes() == some.root[r].tobytes()
        assert mixed.ankle[n].tobytes() == some.ankle[r].tobytes()


def test_half_of_two_postures_is_the_middle_of_the_arc(walker: Walker):
    some = walker.postures
    turned = some.wxyz.copy()
    turned[1, ::2] *= -1.0  # the same rotations, written with the other sign
    for wxyz in (some.wxyz, turned):
        mixed = blended(References(wxyz, some.root, some.ankle), np.array([[0.5, 0.5]]))
        for j in range(wxyz.shape[1]):
            arc = Slerp([0, 1], Rotation.from_quat(some.wxyz[:, j], scalar_first=True))
            theirs = Rotation.from_quat(mixed.wxyz[0, j], scalar_first=True).inv() * arc(0.5)
            assert theirs.magnitude() < 1e-7, j
        np.testing.assert_allclose(mixed.root[0], some.root.mean(axis=0), atol=1e-15)
        np.testing.assert_allclose(mixed.ankle[0], some.ankle.mean(axis=0), atol=1e-15)
    assert angle(some.wxyz[0], some.wxyz[1]).max() > 0.5  # rad: there is something in between


@pytest.mark.parametrize(
    "wrong",
    [[[1.0]], [[0.0, 0.0]], [[1.0, -0.1]], [[np.nan, 1.0]], [1.0, 0.0], [[1.0, 0.0, 0.0]]],
    ids=str,
)
def test_weights_that_mix_nothing(walker: Walker, wrong):
    with pytest.raises(KumiteError, match="expected 2 in each row, none below 0, not all 0"):
        blended(walker.postures, np.array(wrong))


def test_postures_are_led_to_others_by_shares(walker: Walker):
    some = walker.postures
    count = np.zeros(3, dtype=np.int64)
    mine = References(some.wxyz[count], some.root[count], some.ankle[count])
    work = Preparation(walker.clip.skeleton, 60.0, mine, 3)
    rows, which = np.array([0, 2]), np.array([1, 1])
    left = work.lead(rows, some, which, np.array([1.0, 0.5]))
    assert left[0] < 1e-15 and left[1] > 0.01
    now = work.postures
    same = angle(now.wxyz[0], some.wxyz[1])
    assert same.max() < 1e-7
    np.testing.assert_allclose(now.root[0], some.root[1], atol=1e-15)
    np.testing.assert_allclose(now.ankle[0], some.ankle[1], atol=1e-15)
    np.testing.assert_array_equal(now.wxyz[1], some.wxyz[0])  # who is not led keeps his
    # Half and half again leaves a quarter, of rotations as nearly as a chord is its arc.
    again = work.lead(rows[1:], some, which[1:], 0.5)
    np.testing.assert_allclose(
        now.root[2] - some.root[1], 0.25 * (some.root[0] - some.root[1]), atol=1e-15
    )
    np.testing.assert_allclose(
        now.ankle[2] - some.ankle[1], 0.25 * (some.ankle[0] - some.ankle[1]), atol=1e-15
    )
    whole, rest = angle(some.wxyz[0], some.wxyz[1]), angle(now.wxyz[2], some.wxyz[1])
    turned = whole > 1e-3
    np.testing.assert_allclose(rest[turned] / whole[turned], 0.25, atol=0.02)
    assert again[0] < 0.6 * left[1]
    np.testing.assert_allclose(np.linalg.norm(now.wxyz, axis=-1), 1.0, atol=1e-12)


# What they go and turn besides -------------------------------------------------------------------


@pytest.mark.parametrize("level", [0.0, 0.5])
def test_a_steady_turn_is_a_circle_and_feet_stay(walker: Walker, level: float):
    """On a walk that goes straight, turned by 40° a second."""
    rate, frames = np.radians(40.0), len(walker.clip)
    skeleton, clip = walker.clip.skeleton, walker.clip
    work = Preparation(skeleton, 60.0, walker.postures, 1)
    feet = [skeleton.joint(f"{side}_foot") for side in SIDES]
    shift = np.array([[0.0, 0.0, rate / 60.0]])
    at, ankles = [], []
    for f in range(frames):
        stepped(walker, work, f, 1, level, shift=shift)
        at.append(work.facing[0].copy())
        ankles.append(work.position[0, feet][:, [0, 2]].copy())
    at, ankles = np.array(at), np.array(ankles)
    # Speed over rate of turning; the walk itself sways by 5 cm.
    facing = facing_frame(skeleton, clip.root_position, clip.wxyz)
    way = (1.0 - level) * np.hypot(*np.diff(facing[[0, -1], :2], axis=0)[0])
    radius = way / ((frames - 1) / 60.0) / rate
    flat = np.column_stack([2.0 * at[:, :2], np.ones(frames)])
    x, z, c = np.linalg.lstsq(flat, np.sum(at[:, :2] ** 2, axis=1), rcond=None)[0]
    assert np.sqrt(c + x * x + z * z) == pytest.approx(radius, rel=0.02)
    off = np.hypot(at[:, 0] - x, at[:, 1] - z)
    assert np.abs(off - radius).max() < 0.06
    went = np.unwrap(at[:, 2])
    assert went[-1] - went[0] == pytest.approx(rate * (frames - 1) / 60.0, abs=0.01)
    # A foot that stands goes as far as the walk's own does (its heel is raised), and no farther.
    own = joints_of(clip)[:, feet][..., [0, 2]]
    for f in range(2):
        held = walker.ground[1:, f] & walker.ground[:-1, f]
        edges = np.flatnonzero(np.diff(np.concatenate([[0], held.astype(int), [0]])))
        for start, stop in edges.reshape(-1, 2).tolist():
            goes, may = (
                float(np.hypot(*np.diff(x[start : stop + 1, f], axis=0).T).sum())
                for x in (ankles, own)
            )
            assert goes < (1.0 - level) * may + 1e-3, (f, start)


# Many at once -------------------------------------------------------------------------------------


def stepped(
    walker: Walker, work: Preparation, f: int, count: int, level, reference: Any = 0, shift=None
):
    clip = walker.clip
    position = joints_of(clip)[f]
    facing = facing_frame(clip.skeleton, clip.root_position, clip.wxyz)[f]
    feet = [clip.skeleton.joint(f"{side}_foot") for side in SIDES]
    parts = (clip.root_position[f], clip.wxyz[f], facing, position[feet], walker.ground[f])
    a, b, c, d, e = (np.repeat(x[None], count, axis=0) for x in parts)
    work.show(a, b, c, d, e, level, reference, shift)


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


def test_who_plays_the_graph_prepares_without_jumps(walker: Walker):
    """Thirty seconds of random ways through cores, links and targets, prepared now and then."""
    clips, contacts = walker.clips, walker.contacts
    made = performed("targets")
    targets = authored_targets(clips, made.truth, 60.0)
    table, _ = hierarchy_table(clips, build_hierarchy(clips, walker.cycles, targets))
    cast = Cast(Layer(clips, contacts, find_strikes(clips), table), 1)
    cast.place(0, 0, np.zeros(3))
    work = Preparation(clips.skeleton, 60.0, walker.postures, 1)
    smooth, rng, before = LevelFilter(1, 60.0), np.random.default_rng(0), None
    fastest = {"plain": 0.0, "prepared": 0.0}
    for f in range(1800):
        if len(cast.waiting):
            state = int(np.searchsorted(table.state_frame, cast.stop[0]))
            action = rng.integers(*table.action_start[state : state + 2])
            cast.begin(np.array([0]), table.stretch[[action]])
        cast.advance()
        work.show_cast(cast, smooth.push(0.6 if (f // 200) % 2 else 0.0))
        shown = {"plain": cast.position[0].copy(), "prepared": work.position[0].copy()}
        for name, position in shown.items():
            if before is not None:
                step = np.linalg.norm(position - before[name], axis=1).max() * 60
                fastest[name] = max(fastest[name], float(step))
        before = shown
    assert fastest["prepared"] < fastest["plain"] + 1.0
