"""Time warps along a path, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from kumite.kernels.warp import carried, fill, phase_times, solve

FPS = 30.0


def warped(lengths, adjustable, ramp, middle, want, slowness=1.0):
    """(s, at, when in frames, slowness at each frame) of a path of edges."""
    upto = np.cumsum(np.asarray(lengths, dtype=float))
    at, weight, when = np.zeros(500), np.zeros(500), np.zeros(500)
    n = fill(len(upto), upto, np.array(adjustable), ramp, at, weight)
    s = solve(at, weight, n, middle, want, ramp, slowness)
    phase_times(at, weight, n, s, ramp, slowness, 1.0, when)
    fades = np.clip(1 - at[:n] / ramp, 0, None)
    return s, at[:n], when[:n], 1 + (s - 1) * weight[:n] + (slowness - 1) * fades


def test_frames_of_a_path():
    at, weight = np.zeros(100), np.zeros(100)
    n = fill(2, np.array([2.3, 6.3]), np.array([False, True]), 1.0, at, weight)
    np.testing.assert_allclose(at[:n], [0, 0.3, 1.3, 2.3, 3.3, 4.3, 5.3, 6.3])
    np.testing.assert_allclose(weight[:n], [0, 0, 0, 0, 1, 1, 1, 0], atol=1e-12)
    assert fill(1, np.array([99.0]), np.array([True]), 1.0, at, weight) == 100
    assert fill(1, np.array([100.0]), np.array([True]), 1.0, at, weight) == -1


def test_nothing_to_adjust_is_the_identity():
    s, at, when, slow = warped([10, 20, 10], [True, False, True], 6.0, 35.0, 35.0)
    assert s == 1.0
    np.testing.assert_array_equal(when, at)
    np.testing.assert_array_equal(slow, 1.0)


def test_one_edge_in_closed_form():
    """An edge of L frames, ramps of r: w integrates to L - r."""
    ramp, length = 6.0, 30.0
    s, _, when, slow = warped([10, length, 10], [False, True, False], ramp, 45.0, 55.0)
    assert s == pytest.approx(1.0 + 10.0 / (length - ramp))
    assert when[-1] == pytest.approx(60.0)
    assert slow.max() == pytest.approx(s)


def test_what_is_carried_over_in_closed_form():
    assert carried(100.0, 6.0, 2.0) == pytest.approx(3.0)
    assert carried(3.0, 6.0, 2.0) == pytest.approx(3.0 - 0.75)
    assert carried(0.0, 6.0, 2.0) == 0.0
    _, at, when, slow = warped([20, 20], [False, False], 6.0, 30.0, 30.0, slowness=2.0)
    assert when[-1] == pytest.approx(40.0 + 3.0)
    np.testing.assert_allclose(slow, 1 + np.clip(1 - at / 6.0, 0, None))


@settings(max_examples=200, deadline=None)
@given(
    st.lists(st.tuples(st.integers(1, 40), st.booleans()), min_size=1, max_size=8),
    st.floats(0.01, 1.0),
    st.floats(0.5, 24.0),
    st.floats(0.25, 4.0),
    st.floats(0.25, 4.0),
    st.floats(0.05, 1.0),
)
def test_any_path(edges, first, ramp, slowness, stretch, share):
    lengths = [max(first * edges[0][0], 0.2), *(n for n, _ in edges[1:])]
    adjustable = [a for _, a in edges]
    middle = share * sum(lengths)
    s, at, when, slow = warped(lengths, adjustable, ramp, middle, middle * stretch, slowness)
    assert np.all(np.diff(at) > 0) and at[-1] == pytest.approx(sum(lengths))
    assert slow[0] == pytest.approx(slowness)  # the slowness of now goes over
    assume(0.25 <= s <= 4.0)  # searches drop what is beyond
    low, high = min(1.0, s, slowness), max(1.0, s, slowness)
    assert np.all(slow >= low - 1e-9) and np.all(slow <= high + 1e-9)
    assert np.all(np.diff(when) > 0)
    # No jump: between neighbours no more than the two ramps allow.
    fastest = max((min(ramp, 0.5 * n) for n in lengths), default=ramp)
    shortest = min(min(ramp, 0.5 * n) for n in lengths)
    assert fastest >= shortest > 0
    steps = np.abs(np.diff(slow)) / np.diff(at)
    assert np.all(steps <= (abs(s - 1) / min(shortest, ramp) + abs(slowness - 1) / ramp) + 1e-6)


@settings(max_examples=200, deadline=None)
@given(
    st.lists(st.integers(2, 40), min_size=1, max_size=6),
    st.floats(1.0, 24.0),
    st.floats(0.3, 3.5),
    st.floats(0.4, 2.5),
    st.floats(0.1, 1.0),
)
def test_the_middle_shows_when_it_is_to(lengths, ramp, slowness, stretch, share):
    total = float(sum(lengths))
    middle = share * total
    want = stretch * middle
    s, at, when, slow = warped(lengths, [True] * len(lengths), ramp, middle, want, slowness)
    assume(s != 1.0)
    # The exact time at which it shows: slowness is linear between frames.
    k = min(int(np.searchsorted(at, middle)), len(at) - 1)
    x = middle - at[k - 1]
    here = slow[k - 1] + (slow[k] - slow[k - 1]) * x / (at[k] - at[k - 1])
    assert when[k - 1] + 0.5 * (slow[k - 1] + here) * x == pytest.approx(want, abs=1e-6)
