"""Attacks as space-time volumes: thrown, sampled, refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kumite.control.attack import (
    GRAVITY,
    INTERVAL,
    LONGEST_STEP,
    Attack,
    packed,
    thrown,
)
from kumite.errors import KumiteError


def test_a_throw_in_closed_form():
    p, v = np.array([1.0, 1.5, -2.0]), np.array([3.0, 4.0, 5.0])
    ball = thrown(p, v, 0.1, when=2.0)
    t = ball.when - 2.0
    np.testing.assert_allclose(
        ball.centre[:, 0], p + t[:, None] * v - [[0, 1, 0]] * (0.5 * GRAVITY * t**2)[:, None]
    )
    assert ball.centre[-1, 0, 1] == pytest.approx(0.1)  # it lies
    assert t[-1] == pytest.approx((4 + np.sqrt(16 + 2 * GRAVITY * 1.4)) / GRAVITY)
    straight = thrown(p, v, 0.1, gravity=0.0, seconds=1.5)
    np.testing.assert_allclose(straight.centre[-1, 0], p + 1.5 * v)
    assert straight.speed == pytest.approx(np.linalg.norm(v))


@settings(max_examples=80, deadline=None)
@given(st.floats(0.5, 60.0), st.floats(-1.2, 1.2), st.floats(0.1, 3.0), st.floats(0.005, 2.0))
def test_how_densely_it_is_sampled(speed: float, pitch: float, height: float, radius: float):
    v = speed * np.array([0, np.sin(pitch), np.cos(pitch)])
    ball = thrown((0, height, 0), v, radius)
    when, centre = ball.dense
    assert when[0] == ball.when[0] and when[-1] == ball.when[-1]
    assert np.all(np.diff(when) > 0) and np.diff(when).max(initial=0) <= INTERVAL + 1e-9
    step = np.linalg.norm(np.diff(centre, axis=0), axis=2)
    assert step.max(initial=0) <= LONGEST_STEP * (1 + 1e-6)
    np.testing.assert_allclose(centre, ball.at(when), atol=1e-12)


def test_between_and_beyond_its_times():
    a = Attack(
        np.array([0.0, 1.0, 3.0]),
        np.array([[[0.0, 0, 0]], [[1, 0, 0]], [[1, 4, 0]]]),
        np.array([0.1]),
    )
    np.testing.assert_allclose(a.at(0.5), [[0.5, 0, 0]])
    np.testing.assert_allclose(
        a.at(np.array([-1.0, 2.0, 9.0]))[:, 0], [[0, 0, 0], [1, 2, 0], [1, 4, 0]]
    )
    assert a.speed == pytest.approx(2.0)
    one = Attack(np.zeros(1), np.ones((1, 1, 3)), np.array([0.1]))
    assert one.speed == 0.0
    np.testing.assert_allclose(one.at(np.array([0.0, 5.0])), np.ones((2, 1, 3)))


def test_what_is_still_to_come():
    ball = thrown((0, 1, -10), (0, 0, 10), 0.1, gravity=0.0, seconds=2.0)
    given_, which = packed([ball], 0.503, np.zeros(2))
    assert which == [0]
    assert np.all(given_.when >= 0) and np.all(np.diff(given_.when) > 0)
    place = given_.centre[:, 0, 2]
    np.testing.assert_allclose(place, -10 + 10 * (0.503 + given_.when))
    assert np.all(np.abs(place) < 2.1)
    assert given_.lasts.sum() == pytest.approx(given_.when[-1] - given_.when[0])
    # Under way between two samples it is where it is, not where it will be.
    given_, _ = packed([ball], 0.9531, np.zeros(2))
    assert given_.when[0] == 0.0
    assert given_.centre[0, 0, 2] == pytest.approx(-10 + 9.531)
    assert packed([ball], 3.0, np.zeros(2))[1] == []
    assert packed([ball], 0.0, np.array([50.0, 0.0]))[1] == []
    limb = Attack(np.array([0.0, 1.0]), np.zeros((2, 3, 3)), np.array([0.1, 0.2, 0.3]))
    given_, which = packed([ball, limb], 0.0, np.zeros(2))
    assert which == [0, 1] and given_.count.tolist() == [1, 3]
    np.testing.assert_allclose(given_.radius, [[0.1, 0, 0], [0.1, 0.2, 0.3]])


@pytest.mark.parametrize(
    "wrong",
    [
        {"radius": 0.0},
        {"radius": -1.0},
        {"radius": float("nan")},
        {"radius": 5.0},
        {"velocity": (0, 0, 0)},
        {"velocity": (0, 0, 1e4)},
        {"velocity": (0, 0, float("inf"))},
        {"velocity": (0, 0)},
        {"position": (float("nan"), 0, 0)},
        {"seconds": 0.0},
        {"seconds": float("nan")},
        {"seconds": 1e9},
        {"gravity": float("inf")},
        {"gravity": float("nan")},
        {"when": float("nan")},
    ],
)
def test_throws_that_make_no_sense(wrong):
    given_ = {"position": (0, 1, 0), "velocity": (0, 0, 5), "radius": 0.1} | wrong
    with pytest.raises(KumiteError, match="attack 'ball'"):
        thrown(**given_)


@pytest.mark.parametrize(
    ("when", "centre", "radius", "told"),
    [
        ([], np.zeros((0, 1, 3)), [0.1], "at least one"),
        ([0.0], np.zeros((1, 0, 3)), [], "at least one"),
        ([0.0, 0.0], np.zeros((2, 1, 3)), [0.1], "ascend"),
        ([0.0, np.nan], np.zeros((2, 1, 3)), [0.1], "ascend|finite"),
        ([0.0, 1.0], np.full((2, 1, 3), np.inf), [0.1], "finite"),
        ([0.0, 1.0], np.zeros((2, 1, 3)), [0.0], "radii"),
        ([0.0, 1.0], np.array([[[0.0, 0, 0]], [[0, 0, 500]]]), [0.1], "m/s"),
        ([0.0, 1e9], np.zeros((2, 1, 3)), [0.1], "expected at most 600"),
        ([0.0, 1.0], np.zeros((3, 1, 3)), [0.1], "centre"),
    ],
)
def test_attacks_that_make_no_sense(when, centre, radius, told):
    with pytest.raises(KumiteError, match=told):
        Attack(np.array(when, dtype=float), centre, np.array(radius, dtype=float))
