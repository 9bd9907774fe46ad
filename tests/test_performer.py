"""The built-in performer: what it promises of its clips, checked on the clips themselves."""

from __future__ import annotations

import numpy as np
import pytest

from kumite import performer
from kumite.annotate import find_contacts, find_strikes
from kumite.clip import LIMBS, SIDES, check, concatenate, forward_kinematics, tip_positions
from kumite.errors import KumiteError
from kumite.performer import (
    BOXING,
    Blow,
    Move,
    Performance,
    Step,
    Style,
    aim,
    as_written,
    perform_take,
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


def test_at_least_a_minute_at_60_hz_with_every_move(style: Style, performance: Performance):
    assert sum(c.seconds for c in performance.clips) >= 60
    assert all(c.fps == FPS for c in performance.clips)
    done = {a.label for t in performance.truth for a in t.actions}
    assert done == {m.label for m in style.moves}
    for clip, truth in zip(performance.clips, performance.truth):
        assert check(clip) == []
        assert len(truth.on_ground) == len(clip)
        stops = [0, *(a.stop for a in truth.actions)]
        assert all(a.start >= s for a, s in zip(truth.actions, stops))


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
    clips = concatenate(performance.clips)
    truth = np.concatenate([t.on_ground for t in performance.truth])
    found = find_contacts(clips).on_ground
    hit = (found & truth).sum()
    precision, recall = hit / found.sum(), hit / truth.sum()
    print(f"contacts: precision {precision:.3f}, recall {recall:.3f}")
    assert precision >= 0.95 and recall >= 0.95


def test_blows_found_are_those_authored(boxing: Performance):
    clips = concatenate(boxing.clips)
    strikes = find_strikes(clips)
    authored = [
        (int(clips.clip_start[c]) + s.frame, LIMBS.index(s.limb))
        for c, t in enumerate(boxing.truth)
        for s in t.strikes
    ]
    found = list(zip(strikes.start.tolist(), strikes.stop.tolist(), strikes.limb.tolist()))
    # The annotator marks the drive of a blow; it lands at its end or just after.
    matched = [any(a - 3 <= f <= b + 8 and k == limb for a, b, k in found) for f, limb in authored]
    true = [any(a - 3 <= f <= b + 8 and k == limb for f, limb in authored) for a, b, k in found]
    recall, precision = float(np.mean(matched)), float(np.mean(true))
    print(f"blows: precision {precision:.3f}, recall {recall:.3f}")
    assert recall >= 0.95 and precision >= 0.9


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
        assert np.linalg.norm(strike.tip - goal) < 0.08, label
        position, world = forward_kinematics(clip.skeleton, clip.root_position, clip.wxyz)
        tip = tip_positions(clip.skeleton, strike.limb, position, world)
        assert np.allclose(tip[strike.frame], strike.tip)
        slope = (tip[strike.frame + 1] - tip[strike.frame - 1]) * FPS / 2
        assert np.allclose(slope, strike.velocity)


def test_fists_are_as_fast_as_fists(boxing: Performance):
    peaks = []
    for truth, clip in zip(boxing.truth, boxing.clips):
        position, world = forward_kinematics(clip.skeleton, clip.root_position, clip.wxyz)
        for s in truth.strikes:
            tip = tip_positions(clip.skeleton, s.limb, position, world)
            speed = np.linalg.norm(np.gradient(tip, axis=0), axis=1) * FPS
            peaks.append(speed[s.frame - 15 : s.frame + 6].max())
    assert 4.0 < np.median(peaks) < 8.0 and max(peaks) < 11.0 and min(peaks) > 2.5


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
    """No joint jumps: neighbouring frames differ by less than what a fast arm turns in a 60th."""
    for clip in performance.clips:
        step = angle(clip.wxyz[:-1], clip.wxyz[1:])
        assert step.max() < np.radians(40), clip.name
        spin = log(multiply(conjugate(clip.wxyz[:-1]), clip.wxyz[1:])) * FPS
        change = np.linalg.norm(np.diff(spin, axis=0), axis=-1)
        assert np.quantile(change, 0.999) < 12.0, clip.name  # rad/s from frame to frame
        root = np.linalg.norm(np.diff(clip.root_position, 2, axis=0), axis=1) * FPS**2
        assert root.max() < 45.0, clip.name  # m/s²: a leap pushes off with four times its weight


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


def test_avoidance_takes_the_head_out_of_the_way(boxing: Performance):
    """In the middle of its marked interval the head is well away from where it began."""
    checked = 0
    for clip, truth in zip(boxing.clips, boxing.truth):
        position, _ = forward_kinematics(clip.skeleton, clip.root_position, clip.wxyz)
        head = position[:, clip.skeleton.joint("head")]
        for a in truth.actions:
            if a.avoid is not None:
                away = np.linalg.norm(head[a.avoid[0] : a.avoid[1]] - head[a.start], axis=1)
                assert a.start <= a.avoid[0] < a.avoid[1] <= a.stop
                assert away.max() > 0.12, a.label
                checked += 1
    assert checked >= 8
