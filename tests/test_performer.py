"""The built-in performer: what it promises of its clips, checked on the clips themselves."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from kumite import performer
from kumite.annotate import find_contacts, find_strikes, measure_likeness
from kumite.annotate.balance import find_balance
from kumite.annotate.likeness import body_ends
from kumite.body import lay_body
from kumite.clip import (
    LEG_ROLES,
    LIMBS,
    SIDES,
    ClipSet,
    check,
    concatenate,
    forward_kinematics,
    tip_positions,
)
from kumite.errors import KumiteError
from kumite.mocap import load
from kumite.performer import (
    BOXING,
    SWORD,
    Blow,
    Move,
    Performance,
    Step,
    Style,
    aim,
    as_written,
    perform_take,
    truth_to_json,
)
from kumite.rotation import angle, conjugate, log, multiply

FPS = 60.0


@pytest.fixture(scope="module", params=list(performer.STYLES))
def style(request) -> Style:
    return performer.STYLES[request.param]


@pytest.fixture(scope="module")
def performance(style: Style) -> Performance:
    return performer.perform(style.name)


@pytest.fixture(scope="module")
def boxing() -> Performance:
    return performer.perform()


@pytest.fixture(scope="module")
def worlds(performance: Performance):
    return [forward_kinematics(c.skeleton, c.root_position, c.wxyz) for c in performance.clips]


def test_eight_minutes_at_60_hz_in_all():
    seconds = sum(
        c.seconds
        for style in performer.STYLES
        for c in performer.perform(style, mirrored=False).clips
    )
    assert seconds >= 8 * 60


def test_every_move_is_shown_and_every_take_mirrored(style: Style, performance: Performance):
    assert all(c.fps == FPS for c in performance.clips)
    takes = len(style.takes)
    assert [c.name for c in performance.clips[takes:]] == [f"{n}_mirrored" for n in style.takes]
    done = {a.label for t in performance.truth[:takes] for a in t.actions}
    assert done == {m.label for m in style.moves}
    for clip, truth in zip(performance.clips, performance.truth):
        assert check(clip) == []
        assert len(truth.on_ground) == len(clip)
        stops = [0, *(a.stop for a in truth.actions)]
        assert all(a.start >= s for a, s in zip(truth.actions, stops))
        for s in truth.strikes:  # of mirrored clips too: the truth is that of the clip itself
            pose = clip.root_position[s.frame : s.frame + 1], clip.wxyz[s.frame : s.frame + 1]
            tip = tip_positions(clip.skeleton, s.limb, *forward_kinematics(clip.skeleton, *pose))
            assert np.allclose(tip[0], s.tip)


def test_the_same_seed_gives_the_same_bytes(boxing: Performance):
    again, other = performer.perform(seed=0), performer.perform(seed=1)
    assert all(np.array_equal(a.wxyz, b.wxyz) for a, b in zip(boxing.clips, again.clips))
    assert not np.array_equal(boxing.clips[-1].wxyz[:500], other.clips[-1].wxyz[:500])


def test_planted_feet_stay_planted(performance: Performance, worlds):
    """The ball of a planted foot does not move at all: at most 1 cm/s."""
    for truth, (position, _), clip in zip(performance.truth, worlds, performance.clips):
        for s, side in enumerate(SIDES):
            ball = position[:, clip.skeleton.joint(f"{side}_toe")]
            speed = np.linalg.norm(np.diff(ball, axis=0), axis=1) * FPS
            planted = truth.on_ground[1:, s] & truth.on_ground[:-1, s]
            assert speed[planted].max() < 0.01, (clip.name, side)
            assert np.abs(ball[truth.on_ground[:, s], 1] - 0.026).max() < 0.002
            assert ball[:, 1].min() > 0.024  # never through the floor


def test_contacts_found_are_those_authored(performance: Performance):
    clips = _one_skeleton(performance)
    truth = np.concatenate([t.on_ground for t in performance.truth[: len(clips.names)]])
    found = find_contacts(clips).on_ground
    hit = (found & truth).sum()
    precision, recall = hit / found.sum(), hit / truth.sum()
    print(f"contacts: precision {precision:.3f}, recall {recall:.3f}")
    assert precision >= 0.95 and recall >= 0.95


def _one_skeleton(performance: Performance) -> ClipSet:
    """The clips on the first one's skeleton: a mirrored sword is on another."""
    first = performance.clips[0].skeleton
    return concatenate([c for c in performance.clips if c.skeleton.same_as(first)])


def _matched(performance: Performance) -> tuple[float, float, int]:
    """Precision, recall and number of blows: found within 2 frames of an effective frame."""
    clips = _one_skeleton(performance)
    strikes = find_strikes(clips)
    authored = [
        (int(clips.clip_start[c]) + s.frame, LIMBS.index(s.limb))
        for c, t in enumerate(performance.truth[: len(clips.names)])
        for s in t.strikes
    ]
    found = list(zip(strikes.start.tolist(), strikes.stop.tolist(), strikes.limb.tolist()))
    matched = [any(a - 2 <= f < b + 2 and k == limb for a, b, k in found) for f, limb in authored]
    true = [any(a - 2 <= f < b + 2 and k == limb for f, limb in authored) for a, b, k in found]
    return float(np.mean(true)), float(np.mean(matched)), len(authored)


def test_blows_found_are_those_authored(boxing: Performance):
    precision, recall, count = _matched(boxing)
    print(f"blows of fists: precision {precision:.3f}, recall {recall:.3f} of {count}")
    assert recall >= 0.95 and precision >= 0.95 and count > 300


def test_cuts_and_thrusts_found_are_those_authored():
    precision, recall, count = _matched(performer.perform("sword"))
    print(f"cuts and thrusts: precision {precision:.3f}, recall {recall:.3f} of {count}")
    assert recall >= 0.95 and precision >= 0.85 and count > 50


def test_kicks_found_are_those_authored():
    """Feet only: arms that swing in a run are another matter."""
    targets = performer.perform("targets", mirrored=False)
    kept = [k for k, c in enumerate(targets.clips) if c.name in ("kick_ball", "front_kick")]
    _, recall, count = _matched(
        Performance(tuple(targets.clips[k] for k in kept), tuple(targets.truth[k] for k in kept))
    )
    print(f"kicks: recall {recall:.3f} of {count}")
    assert recall >= 0.95 and count >= 4


def test_blows_land_where_they_are_aimed():
    for label in ("jab", "cross", "left_hook", "right_hook"):
        move = BOXING.find(label)
        clip, truth = perform_take(label, [as_written(move)], BOXING, rng=np.random.default_rng(0))
        (strike,) = truth.strikes
        degrees, distance, height = move.blows[0].target
        # The stance has by then come forward by what the move travels.
        goal = np.array(
            [
                distance * np.sin(np.radians(degrees)),
                height,
                distance * np.cos(np.radians(degrees)) + move.travel[1],
            ]
        )
        assert np.linalg.norm(strike.tip - goal) < 0.10, label
        position, world = forward_kinematics(clip.skeleton, clip.root_position, clip.wxyz)
        tip = tip_positions(clip.skeleton, strike.limb, position, world)
        assert np.allclose(tip[strike.frame], strike.tip)
        slope = (tip[strike.frame + 1] - tip[strike.frame - 1]) * FPS / 2
        assert np.allclose(slope, strike.velocity)


def test_bodies_do_what_bodies_can(style: Style, performance: Performance):
    """Joints within human limits, no part 2 cm inside another, feet still, balance."""
    found = measure_likeness(_one_skeleton(performance))
    print(style.name, found.rows())
    assert found.outside() == []
    assert found.overlap <= 0.02, found.overlap_worst
    assert found.skate[2] <= 0.01
    assert found.off_balance <= 0.05


def test_bodies_do_not_sink_into_the_floor(performance: Performance):
    """Flesh gives by up to 6 cm where a body lies; feet are tested joint by joint."""
    clips = _one_skeleton(performance)
    body = lay_body(clips.skeleton)
    start, end = body_ends(clips, body)
    rows = [k for k, part in enumerate(body.parts) if "foot" not in part]
    low = np.minimum(start[..., 1] - body.radius_start, end[..., 1] - body.radius_end)[:, rows]
    assert low.min() > -0.06


def test_fists_are_as_fast_as_fists(boxing: Performance):
    found = measure_likeness(concatenate(boxing.clips))
    assert found.fist_speed[0] >= 4.8 and 5.5 < found.fist_speed[1] < 8 and found.fist_speed[2] < 10
    for truth, clip in zip(boxing.truth, boxing.clips):
        pose = forward_kinematics(clip.skeleton, clip.root_position, clip.wxyz)
        for s in truth.strikes:
            tip = tip_positions(clip.skeleton, s.limb, *pose)
            speed = np.linalg.norm(np.gradient(tip, axis=0), axis=1) * FPS
            peak = speed[s.frame - 10 : s.frame + 6].max()
            # Where a blow lands it is still fast: fists strike through, they do not stop there.
            assert 4.0 < peak < 12.5 and np.linalg.norm(s.velocity) > 0.35 * peak


def test_moves_as_far_and_as_long_as_the_real_boxer(boxing: Performance, mocap: Path):
    """Medians within the real boxer's 5th to 95th percentile, extremes near them."""
    real = measure_likeness(load(mocap / "boxer").clip_set())
    ours = measure_likeness(concatenate(boxing.clips))
    for what in ("fist_speed", "fist_path", "blow_time", "step_length", "step_time"):
        a, b = getattr(real, what), getattr(ours, what)
        assert a[0] <= b[1] <= a[2], what
        assert b[0] >= 0.75 * a[0] and b[2] <= 1.1 * a[2], what
    for joint, most in real.acceleration.items():
        assert np.all(ours.acceleration[joint][1:] <= 1.6 * most[1:]), joint


def test_elbows_and_knees_bend_one_way(performance: Performance, worlds):
    for (position, _), clip in zip(worlds, performance.clips):
        s = clip.skeleton
        for side in SIDES:
            for upper, middle, end in (
                ("thigh", "shin", "foot"),
                ("upper_arm", "forearm", "hand"),
            ):
                a, b, c = (position[:, s.joint(f"{side}_{p}")] for p in (upper, middle, end))
                u, v = b - a, c - b
                cosine = np.sum(u * v, axis=1) / np.prod(
                    [np.linalg.norm(x, axis=1) for x in (u, v)], axis=0
                )
                bend = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
                assert bend.max() < 165, (clip.name, side, middle)
            # A hinge: the middle joint turns about one axis of the upper bone only.
            for part, axis in (("shin", 0), ("forearm", 1)):
                turn = log(clip.wxyz[:, s.joint(f"{side}_{part}")])
                others = [k for k in range(3) if k != axis]
                assert np.abs(turn[:, others]).max() < 1e-6, (clip.name, side, part)
                sign = 1.0 if part == "shin" else (-1.0 if side == "left" else 1.0)
                assert (sign * turn[:, axis]).min() > -1e-6, (clip.name, side, part)


def test_motion_is_continuous(performance: Performance):
    """No joint jumps: a frame differs from the next by what a fast arm turns in a 60th (the real
    boxer's elbow opens at up to 3100 degrees a second, a sword's wrist rolls faster still).
    """
    for clip in performance.clips:
        step = angle(clip.wxyz[:-1], clip.wxyz[1:])
        assert step.max() < np.radians(65 if "sword" in clip.skeleton.roles else 50), clip.name
        spin = log(multiply(conjugate(clip.wxyz[:-1]), clip.wxyz[1:])) * FPS
        change = np.linalg.norm(np.diff(spin, axis=0), axis=-1)
        assert np.quantile(change, 0.999) < 25.0, clip.name  # rad/s from frame to frame
        root = np.linalg.norm(np.diff(clip.root_position, 2, axis=0), axis=1) * FPS**2
        assert root.max() < 50.0, clip.name  # m/s²: a leap pushes off with four times its weight


def test_enough_lift_offs_to_join_at(boxing: Performance):
    clips = concatenate(boxing.clips)
    lift = find_contacts(clips).lift_off(clips.clip_start)
    assert lift[:, 0].sum() > 150


def test_a_users_own_move():
    """The authoring layer is public: a long right in a few lines."""
    long_right = Move(
        "long_right",
        "attack",
        1.0,
        {
            "right_hand": ((0.2, (-0.05, 1.44, 0.18)), (0.38, aim()), (0.7, (-0.03, 1.45, 0.24))),
            "chest_turn": ((0.2, (-10, 0, 0)), (0.38, (62, 6, 0))),
        },
        (Step("left", 0.05, 0.25),),
        (0.0, 0.1, 0.0),
        (Blow("right_hand", 0.38, (0, 0.9, 1.5)),),
    )
    clip, truth = perform_take(
        "mine", [as_written(long_right)] * 2, BOXING, rng=np.random.default_rng(0)
    )
    assert len(truth.strikes) == 2 and len(truth.actions) == 2
    assert len(find_strikes(concatenate([clip]))) >= 2


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"keys": {"tail": ((0.1, (0.0,)),)}}, "unknown channel of mine 'tail'"),
        ({"keys": {"pelvis": ((1.5, (0.0, 0.0, 0.0)),)}}, "has a key at 1.5 s"),
        ({"keys": {"left_hand": ((0.5, aim()),)}}, "strikes no blow"),
        ({"travel": (0.0, 0.5, 0.0)}, "travels without a step"),
    ],
)
def test_moves_that_make_no_sense_are_refused(changes, message):
    move = Move("mine", "attack", 1.0, **changes)
    with pytest.raises(KumiteError, match=message):
        perform_take("take", [as_written(move)], BOXING, rng=np.random.default_rng(0))


def test_unknown_moves_and_empty_takes():
    with pytest.raises(KumiteError, match="unknown move 'jabb'; did you mean 'jab'"):
        BOXING.find("jabb")
    with pytest.raises(KumiteError, match="at least one move"):
        perform_take("empty", [], BOXING, rng=np.random.default_rng(0))


def test_gaits_go_at_the_pace_they_state():
    """A walk's cycles carry the body as far as their row says, at an even speed."""
    performance = performer.perform("locomotion")
    for clip, truth in zip(performance.clips, performance.truth):
        cycles = [a for a in truth.actions if a.label in ("walk", "walk_back", "run")]
        for a in cycles[1:-1]:
            move = performer.LOCOMOTION.find(a.label)
            went = clip.root_position[a.stop, [0, 2]] - clip.root_position[a.start, [0, 2]]
            assert np.linalg.norm(went) == pytest.approx(abs(move.travel[1]), abs=0.08), a.label


def test_avoidance_takes_the_body_out_of_the_way():
    """In its marked interval some part of the body is well away from where it began."""
    seen = set()
    for style in ("boxing", "avoidance"):
        performance = performer.perform(style, mirrored=False)
        for clip, truth in zip(performance.clips, performance.truth):
            position, _ = forward_kinematics(clip.skeleton, clip.root_position, clip.wxyz)
            for a in truth.actions:
                if a.avoid is not None:
                    inside = position[a.avoid[0] : a.avoid[1]]
                    away = np.linalg.norm(inside - position[a.start], axis=2).max()
                    assert a.start <= a.avoid[0] < a.avoid[1] <= a.stop
                    assert away > 0.2, a.label
                    if style == "avoidance":
                        seen.add(a.label)
    assert len(seen) >= 16


def test_targets_are_done_and_marked():
    """Under, over and at things: each where and how it says, its first frame marked."""
    performance = performer.perform("targets", mirrored=False)
    seen = set()
    for clip, truth in zip(performance.clips, performance.truth):
        position, _ = forward_kinematics(clip.skeleton, clip.root_position, clip.wxyz)
        joint = clip.skeleton.joint
        for a in truth.actions:
            if a.kind != "target":
                continue
            seen.add(a.label)
            assert a.mark is not None and a.start <= a.mark < a.stop
            during = position[a.mark : a.stop]
            highest = during[:, :, 1].max(axis=1).min()  # the lowest that the whole body gets
            if a.label == "crawl_under":
                assert highest < 0.95
            elif a.label == "duck_under":
                assert highest < 1.30
            elif a.label == "jump_over":
                feet = during[:, [joint("left_toe"), joint("right_toe")], 1].min(axis=1)
                assert feet.max() > 0.30  # both feet at once
            else:
                assert any(a.mark < s.frame < a.stop for s in truth.strikes)
    assert len(seen) == 6


@pytest.mark.parametrize("seed", [0, 203])
def test_who_goes_for_a_target_gets_ready_first(seed: int):
    """Up to the mark on both feet and in balance, there in a posture of its own."""
    performance = performer.perform("targets", seed=seed, mirrored=False)
    clips = concatenate(list(performance.clips))
    balance = find_balance(clips, find_contacts(clips))
    s = clips.skeleton
    legs = [s.joint(f"{side}_{part}") for side in SIDES for part in LEG_ROLES]
    upper = [j for j in range(1, len(s)) if j not in legs]
    ready = {}
    for truth, first in zip(performance.truth, clips.clip_start.tolist()):
        for a in truth.actions:
            if a.mark is None:
                continue
            assert 0.35 * FPS <= a.mark - a.start <= 0.6 * FPS, a.label
            assert truth.on_ground[a.start : a.mark + 1].all(), a.label
            assert not truth.on_ground[a.mark : a.mark + round(0.35 * FPS)].all(), a.label
            assert balance.distance[first + a.start : first + a.mark + 1].max() < -0.02, a.label
            before, now = clips.wxyz[first + a.start], clips.wxyz[first + a.mark]
            bent = angle(before, now)
            assert np.mean(bent[upper]) > np.radians(20), a.label
            assert np.sum(bent[[j for j in legs if "Toes" not in s.names[j]]] ** 2) < 4.0, a.label
            sunk = clips.root_position[[first + a.start, first + a.mark], 1] @ [1, -1]
            assert sunk > (0.05 if a.label in ("crawl_under", "duck_under", "jump_over") else 0.03)
            ready[a.label] = now
    assert len(ready) == 6
    apart = [
        np.mean(angle(a[upper], b[upper])) for a, b in itertools.combinations(ready.values(), 2)
    ]
    assert min(apart) > np.radians(12)


def test_falls_end_on_the_ground_and_getting_up_in_guard(boxing: Performance):
    fallen = set()
    for clip, truth in zip(boxing.clips, boxing.truth):
        head = forward_kinematics(clip.skeleton, clip.root_position, clip.wxyz)[0][:, 4, 1]
        for a in truth.actions:
            if a.label.startswith("fall_"):
                fallen.add(a.label)
                assert clip.root_position[a.stop, 1] < 0.30 and head[a.stop] < 0.45
            if a.label.startswith("get_up"):
                assert clip.root_position[a.stop, 1] > 0.85 and head[a.stop] > 1.4
    assert fallen == {"fall_back", "fall_forward", "fall_left", "fall_right"}


def test_the_sword_is_a_segment_that_points_where_it_is_told():
    clip, truth = perform_take(
        "cut", [as_written(SWORD.find("cut_down"))], SWORD, rng=np.random.default_rng(0)
    )
    position, world = forward_kinematics(clip.skeleton, clip.root_position, clip.wxyz)
    grip = position[:, clip.skeleton.joint("sword")]
    tip = tip_positions(clip.skeleton, "right_hand", position, world)
    assert np.allclose(np.linalg.norm(tip - grip, axis=1), 0.92)
    way = (tip - grip)[0] / 0.92
    yaw, pitch = np.radians(SWORD.guard["blade"])
    told = np.array([np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)])
    assert way @ told > np.cos(np.radians(2.0))
    (strike,) = truth.strikes
    _, distance, height = SWORD.find("cut_down").blows[0].target
    assert strike.tip[1] == pytest.approx(height, abs=0.2)
    assert strike.tip[2] == pytest.approx(distance, abs=0.25)


def test_a_planted_hand_stays_where_it_is():
    """Falling forward, both hands carry weight: they do not slide."""
    clip, truth = perform_take(
        "fall",
        [as_written(BOXING.find(label)) for label in ("fall_forward", "get_up_forward")],
        BOXING,
        rng=np.random.default_rng(0),
    )
    pose = forward_kinematics(clip.skeleton, clip.root_position, clip.wxyz)
    start = truth.actions[0].start
    for plant in BOXING.find("fall_forward").plants:
        tip = tip_positions(clip.skeleton, plant.hand, *pose)
        held = tip[start + round(plant.start * FPS) : start + round(plant.stop * FPS)]
        assert np.abs(held - held[0]).max() < 0.025


def test_performances_are_kept_and_read_back_the_same(tmp_path):
    made = performer.performed("avoidance", 3, cache=tmp_path)
    (kept,) = tmp_path.iterdir()
    again = performer.performed("avoidance", 3, cache=tmp_path)
    for a, b in zip(made.clips, again.clips):
        assert a.name == b.name and a.wxyz.tobytes() == b.wxyz.tobytes()
        assert a.root_position.tobytes() == b.root_position.tobytes()
    for a, b in zip(made.truth, again.truth):
        assert a.actions == b.actions and np.array_equal(a.on_ground, b.on_ground)
        assert truth_to_json(a) == truth_to_json(b)
    kept.write_bytes(kept.read_bytes()[:-100])  # damaged: made anew
    anew = performer.performed("avoidance", 3, cache=tmp_path)
    assert anew.clips[0].wxyz.tobytes() == made.clips[0].wxyz.tobytes()
    assert performer.performed("avoidance", 3, cache=None).truth[0].actions == made.truth[0].actions
