"""Time warps of paths: closed forms, exact times, smooth rates; and characters that play them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from kumite.errors import KumiteError
from kumite.graph import Library
from kumite.kernels import warp as kernels
from kumite.synthesis import Cast, Warp, edge_frames, make_profile, place_of, time_warp
from kumite.synthesis.warp import RAMP

FPS = 60.0
LENGTH = RAMP * FPS  # 12 frames

paths = st.lists(st.tuples(st.integers(1, 60), st.booleans()), min_size=1, max_size=6)
slownesses = st.floats(0.25, 4.0)


def _edges(frames, first: int = 100) -> tuple[np.ndarray, np.ndarray]:
    """Edges of given lengths, one after the other somewhere in a library."""
    ends = first + np.cumsum(frames)
    return ends - np.array(frames), ends - 1


def _share(places: np.ndarray, frames, adjustable, length: float = LENGTH) -> np.ndarray:
    """The share at places, from the ramps' corners: another way than the kernel's."""
    at, value = [0.0], [0.0]
    border, worth = 0.0, [float(a) for a in adjustable]
    start, end = min(length, frames[0] / 2), min(length, frames[-1] / 2)
    at, value = [*at, start], [*value, worth[0]]
    for e in range(len(frames) - 1):
        border += frames[e]
        half = min(length, frames[e], frames[e + 1]) / 2
        at, value = [*at, border - half, border + half], [*value, worth[e], worth[e + 1]]
    total = float(sum(frames))
    at, value = [*at, total - end, total], [*value, worth[-1], 0.0]
    return np.interp(places, at, value)


@pytest.mark.jit_off
def test_a_single_edge_is_a_trapezium():
    """60 frames with ramps of 12 have 48 frames' worth adjusted: 2 s of 1 s is s = 1 + 60 / 48."""
    first, last = _edges([60])
    warp = time_warp(first, last, np.array([True]), FPS, place=60.0, seconds=2.0)
    assert warp.s == pytest.approx(1 + 60 / 48, abs=1e-12)
    assert warp.seconds == pytest.approx(2.0, abs=1e-12)
    # Half-way it is half the time; before that, W(30) = 6 + 18.
    assert warp.seconds_to(30.0) == pytest.approx((30 + (warp.s - 1) * 24) / FPS, abs=1e-12)
    half = time_warp(first, last, np.array([True]), FPS, place=30.0, seconds=1.0)
    assert half.s == pytest.approx(1 + 30 / 24, abs=1e-12)


@pytest.mark.jit_off
def test_of_two_edges_one_is_adjusted_and_the_other_has_half_a_ramp():
    """40 frames that stay, 60 adjusted: W(100) = 60 - 6 - 6 + 6, of which all but 1.5 come after
    the border (a quarter of the ramp's triangle of 12 by 1 lies before it)."""
    first, last = _edges([40, 60])
    may = np.array([False, True])
    warp = time_warp(first, last, may, FPS, place=100.0, seconds=100 / FPS + 0.5)
    assert warp.s == pytest.approx(1 + 30 / 54, abs=1e-12)
    before = (40 + (warp.s - 1) * 1.5) / FPS
    assert warp.seconds_to(40.0) == pytest.approx(before, abs=1e-12)
    assert place_of(first, last, 1, float(last[1])) == 100.0
    assert place_of(first, last, 1, float(first[1] - 1)) == 40.0
    assert edge_frames(first, last).tolist() == [40, 60]


@pytest.mark.jit_off
@settings(max_examples=60, deadline=None)
@given(paths, slownesses, st.floats(0.25, 4.0), st.floats(0.0, 1.0))
def test_the_profile_is_the_ramps_and_times_are_its_integral(path, slowness, s, part):
    frames, may = [n for n, _ in path], [a for _, a in path]
    count, p = make_profile(*_edges(frames), np.array(may), FPS, slowness=slowness)
    n = np.arange(count + 1)
    assert count == sum(frames)
    assert np.allclose(p.share, _share(n, frames, may), atol=1e-12)
    fade = min(LENGTH, frames[0] / 2)
    assert np.allclose(p.base, 1 + (slowness - 1) * np.maximum(1 - n / fade, 0), atol=1e-12)
    assert p.share[0] == p.share[-1] == 0.0 and p.base[-1] == 1.0
    # The integral of what is linear between the places, by many small pieces.
    at = part * count
    fine = np.linspace(0.0, at, 4001)
    sigma = np.interp(fine, n, p.base + (s - 1) * p.share)
    pieces = 0.5 * (sigma[1:] + sigma[:-1]) * np.diff(fine)
    time = kernels.time_at(at, s, count, p)
    assert time == pytest.approx(pieces.sum(), abs=1e-4 * (1 + time))
    assert kernels.place_at(time, s, count, p) == pytest.approx(at, abs=1e-7)


@pytest.mark.jit_off
@settings(max_examples=60, deadline=None)
@given(paths, slownesses, st.floats(0.3, 3.5), st.floats(0.3, 1.0), st.floats(-2.0, 5.0))
def test_the_moment_comes_in_time_and_the_rate_has_no_steps(path, slowness, s, part, now):
    """Whatever s is asked for by its time is found again; rates add up to the places exactly."""
    frames, may = [n for n, _ in path], [a for _, a in path]
    first, last = _edges(frames)
    count, p = make_profile(first, last, np.array(may), FPS, slowness=slowness)
    place = part * count
    assume(place > now + 1)
    adjusted = kernels.within(p.share, p.share_time, place, count)
    adjusted -= kernels.within(p.share, p.share_time, now, count)
    assume(adjusted > 1e-3)
    wait = kernels.time_at(place, s, count, p) - kernels.time_at(now, s, count, p)
    warp = time_warp(
        first, last, np.array(may), FPS, place=place, seconds=wait / FPS, now=now, slowness=slowness
    )
    assert warp.s == pytest.approx(s, abs=1e-6)
    assert warp.seconds_to(place) == pytest.approx(wait / FPS, abs=1e-9)
    assert warp.place(wait / FPS) == pytest.approx(place, abs=1e-6)
    rates = warp.rates(int(warp.seconds * FPS) + 10)
    assert np.all(rates > 0.25 - 1e-9) and np.all(rates < 4.0 + 1e-9)
    assert now + rates.sum() == pytest.approx(warp.place(len(rates) / FPS), abs=1e-6)
    assert rates[-1] == pytest.approx(1.0, abs=1e-9)
    # d(1/σ)/dt = -σ' / σ³, of the steepest place between what two frames show.
    sigma = warp.slowness
    shown = now + np.concatenate([[0.0], np.cumsum(rates)])
    for i in range(1, len(rates)):
        low = max(int(np.floor(shown[i - 1])), 0)
        high = min(int(np.ceil(shown[i + 1])), count)
        if low < high:
            steep = np.abs(np.diff(sigma[low : high + 1])) / sigma[low : high + 1].min() ** 3
            assert abs(rates[i] - rates[i - 1]) <= steep.max() + 1e-6


@pytest.mark.jit_off
def test_at_the_captured_speed_nothing_changes():
    first, last = _edges([20, 33, 9])
    may = np.array([True, False, True])
    warp = time_warp(first, last, may, FPS, place=50.0, seconds=50 / FPS)
    assert warp.s == pytest.approx(1.0, abs=1e-12)
    assert np.allclose(warp.rates(80), 1.0, atol=1e-12)
    assert warp.place(1.5) == pytest.approx(90.0)  # beyond its end it goes on at 1


@pytest.mark.jit_off
def test_what_goes_before_is_left_smoothly():
    """From twice as slow, nothing adjusted: back to 1 within the ramp."""
    count, p = make_profile(*_edges([60]), np.array([False]), FPS, slowness=2.0)
    warp = Warp(FPS, 0.0, 1.0, count, p)
    assert warp.seconds == pytest.approx((60 + 6) / FPS)
    assert warp.rates(1)[0] == pytest.approx(0.5, abs=0.02)
    assert np.isnan(kernels.solve(0.0, 60.0, 70.0, count, p))


@pytest.mark.parametrize(
    "frames, may, more, message",
    [
        ([], [], {}, "expected .E. of both"),
        ([10], [True, True], {}, "expected .E. of both"),
        ([10, 0], [True, True], {}, "edge 1 has 0 frames"),
        ([10], [False], {}, "nothing is adjustable"),
        ([60], [True], {"seconds": 9.0}, "times as long; expected 0.25 to 4"),
        ([60], [True], {"place": 60.0, "seconds": 0.1}, "times as long; expected 0.25 to 4"),
        ([60], [True], {"slowness": 5.0}, "slowness 5, expected 0.25 to 4"),
        ([60], [True], {"place": 61.0}, "expected a way within 0…60"),
        ([60], [True], {"now": 7.0}, "expected a way within 0…60"),
    ],
)
def test_paths_that_make_no_sense_are_refused(frames, may, more, message):
    with pytest.raises(KumiteError, match=message):
        time_warp(*_edges(frames), np.array(may), FPS, **{"place": 5.0, "seconds": 0.1, **more})


@pytest.mark.parametrize("s", [0.5, 2.0])
def test_a_character_that_plays_a_warped_path_is_in_time(library: Library, s: float):
    """Actions in a chain, adjusted every other: each place comes when the warp says."""
    table, fps = library.table, library.clips.fps
    cast, rng, chain, state = Cast(library, 1), np.random.default_rng(4), [], 3
    cast.place(0, state, np.zeros(3))
    cast.show(0.0)
    for _ in range(6):
        a = table.actions_of(state)
        chain.append(int(table.stretch[rng.integers(a.start, a.stop)]))
        state = int(table.target[chain[-1]])
    first, last = table.first[chain], table.last[chain]
    may = np.arange(6) % 2 == 1
    count, profile = make_profile(first, last, may, fps)
    wait = kernels.time_at(float(count - 7), s, count, profile)
    warp = time_warp(first, last, may, fps, place=count - 7.0, seconds=wait / fps)
    starts, taken = np.cumsum([0, *edge_frames(first, last)]), 0
    for i, rate in enumerate(warp.rates(int(warp.seconds * fps))):
        cast.set_rate(0, rate)
        if len(cast.waiting):
            cast.begin(np.array([0]), np.array([chain[taken]]))
            taken += 1
        cast.advance()
        place = starts[taken - 1] + cast.phase[0] - (first[taken - 1] - 1)
        assert place == pytest.approx(warp.place((i + 1) / fps), abs=1e-6)
    assert taken == 6 and cast.stop[0] - cast.phase[0] < 2.0
