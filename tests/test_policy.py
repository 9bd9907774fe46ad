"""Value iteration against closed forms, a slow twin and the definition of its residual."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kumite.control import (
    Behaviour,
    Fighters,
    Skill,
    Station,
    TargetGrid,
    Temper,
    approach,
    approach_grid,
    circle,
    heading_grid,
    keep_off,
    solve,
    stretch_tracks,
    strike,
    strike_grid,
    take_place,
    trained,
)
from kumite.control.policy import frame_discount, stretch_rewards
from kumite.errors import KumiteError
from kumite.graph import ActionTable, Layer
from kumite.kernels import look_ahead as look
from kumite.kernels import policy as kernels
from kumite.rotation import planar_compose, planar_inverse
from tests import reference, toys

FPS = 30.0


def two_states(displacement=((0, 0, 0), (0, 0, 0))) -> ActionTable:
    """State 0 at frame 3 and state 1 at frame 8 take turns: 5 frames there, 3 frames back."""
    return ActionTable(
        np.array([3, 8]),
        np.array([0, 1, 2]),
        np.array([1, 0], np.int32),
        np.zeros(2, np.float32),
        np.array([1, 4]),
        np.array([3, 8]),
        np.array([0, 1]),
        np.array(displacement, dtype=float),
    )


@pytest.mark.jit_off
def test_two_states_in_closed_form():
    """A hit in the first action, none in the second: V0 = r + γ^5 V1, V1 = γ^3 V0."""
    place = (0.1, 1.5, 0.6)
    library = toys.library(two_states(), 10, {5: (place, 4.0)})
    grid = TargetGrid((-0.5, 0.3, 1.2), (0.5, 0.9, 1.8), (3, 3, 3), wraps=False, inside_only=True)
    behaviour = Behaviour("strike", grid, tolerance=0.2)
    solved = solve(library, behaviour, residual=1e-7)
    g = frame_discount(behaviour, FPS)
    near = np.linalg.norm(grid.points - place, axis=1) <= 0.2
    assert 0 < near.sum() < len(near)
    r = np.where(near, g**2, 0.0)  # frame 5 is the second of the action from frame 4
    v0 = r / (1 - g**8)
    assert solved.converged and solved.residual <= 1e-7
    assert np.allclose(solved.value[0], v0, rtol=1e-5)
    assert np.allclose(solved.value[1], g**3 * v0, rtol=1e-5)


def test_the_discount_means_the_same_at_any_rate():
    behaviour = approach()
    assert frame_discount(behaviour, 15.0) == pytest.approx(0.97)
    assert frame_discount(behaviour, 60.0) ** 4 == pytest.approx(0.97)


def test_sweeps_equal_the_twin(library: Layer):
    """A few states of the performer's graph, both behaviours, point by point, action by action."""
    small = _few_states(library)
    behaviours = (
        replace(approach(), grid=approach_grid(2.0, 3, 5)),
        replace(strike(library, tolerance=0.6), grid=strike_grid(library.strikes.points, 4, 3, 2)),
    )
    for behaviour in behaviours:
        solved = solve(small, behaviour, residual=0.0, most_sweeps=3)
        reward = stretch_rewards(behaviour, stretch_tracks(small), small.clips.fps)
        discount = frame_discount(behaviour, small.clips.fps)
        expected = reference.value_iteration(small.table, reward, discount, behaviour.grid, 3)
        assert not solved.converged and solved.sweeps == 3
        assert solved.value.max() > 0
        assert np.allclose(solved.value, expected, rtol=1e-4, atol=1e-5)


def _few_states(library: Layer, count: int = 6) -> Layer:
    """The first stretches of a library as a table of its own, each state with all of them."""
    t = library.table
    hits = np.asarray(library.strikes.effective.any(axis=1))
    busy = [k for k in range(len(t.first)) if hits[t.first[k] : t.last[k] + 1].any()]
    pick = np.array(
        (busy[: count // 2] + [k for k in range(len(t.first)) if k not in busy])[:count]
    )
    pick = pick[np.argsort(t.last[pick])]
    every = np.arange(count, dtype=np.int32)
    table = ActionTable(
        t.last[pick],
        np.arange(0, count * count + 1, count),
        np.tile(every, count),
        np.zeros(count * count, np.float32),
        t.first[pick],
        t.last[pick],
        every,
        t.displacement[pick],
    )
    return replace(library, table=table)


def test_values_satisfy_equation_4_within_the_residual(library: Layer):
    for behaviour in (approach(), strike(library)):
        solved = solve(library, behaviour, residual=1e-5)
        once_more = solve(library, behaviour, residual=0.0, most_sweeps=solved.sweeps + 1)
        gap = np.abs(once_more.value - solved.value).max() / solved.value.max()
        assert solved.converged and gap <= 1e-5


def interpolated(value: np.ndarray, grid: TargetGrid, point) -> tuple[float, float]:
    """By the corners that backups use, and as fighters look it up."""
    x, y, z = point
    low, step, size, wraps, inside = grid.kernel_arguments()
    index, weight = np.zeros(8, np.int64), np.zeros(8)
    count = kernels.corners(x, y, z, low, step, size, wraps, inside, index, weight)
    by_corners = sum(weight[c] * value[index[c]] for c in range(count))

    nothing, ones = np.zeros((1, 9)), np.ones(1)
    behaviours = look.Behaviours(
        np.zeros(1, np.int64),
        nothing,
        ones,
        ones[None],
        nothing[:, :2],
        value,
        np.array([0, len(grid)]),
        np.array([len(grid)]),
        low[None],
        step[None],
        size[None],
        np.array([wraps]),
        np.array([inside]),
        np.array([grid.heading]),
    )
    state = np.zeros(1, np.int64)
    moves = look.Moves(*([state] * 14))._replace(successor=state)
    polar = (np.arctan2(x, z), np.hypot(x, z), y, y)
    out = np.empty(1)
    look.values_after(
        state, 0, look.Places(*(np.array([v]) for v in polar)), moves, behaviours, out
    )
    return by_corners, out[0]


points = st.tuples(st.floats(-2.5, 2.5), st.floats(0.5, 2.2), st.floats(-2.5, 2.5))


@pytest.mark.jit_off
@settings(max_examples=60, deadline=None)
@given(points, st.integers(0, 1000))
def test_interpolation_equals_the_twin(point, seed):
    rng = np.random.default_rng(seed)
    for grid in (
        approach_grid(),
        TargetGrid((-1.1, 0.3, 1.2), (1.3, 1.3, 1.6), (10, 10, 4), wraps=False, inside_only=True),
    ):
        value = rng.normal(0, 1, len(grid)).astype(np.float32)
        wanted = reference.polar_value(value, grid, point)
        for got in interpolated(value, grid, point):
            assert got == pytest.approx(wanted, abs=1e-4)


def test_interpolation_is_exact_on_grid_points():
    for grid in (approach_grid(), strike_grid(np.array([[-0.5, 1.2, 0.5], [0.6, 1.7, 1.0]]))):
        value = np.arange(len(grid), dtype=np.float32)
        for m, p in enumerate(grid.points):
            if np.hypot(p[0], p[2]) < 1e-9:
                continue  # all angles meet at the centre
            for got in interpolated(value, grid, p):
                assert got == pytest.approx(m, abs=2e-3)


def test_rewards_in_closed_form():
    """Equations 5 and 6 with one frame and one hit."""
    track = np.array([[0.0, 0.5], [0.0, 0.7]])
    got = kernels.approach_reward(track, 0.9, 0.1, 0.0, 0.7)
    assert got == pytest.approx(max(0.9 * np.exp(-2.0), 0.81))
    tip, weight, when = np.array([[0.0, 1.5, 0.7]]), np.array([0.5]), np.array([3])
    assert kernels.strike_reward(tip, weight, when, 0.9, 0.1, 0.0, 1.5, 0.79) == pytest.approx(
        0.5 * 0.9**3
    )
    assert kernels.strike_reward(tip, weight, when, 0.9, 0.1, 0.0, 1.5, 0.81) == 0.0


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000))
def test_the_approach_reward_stops_early_only_when_nothing_better_can_come(seed):
    rng = np.random.default_rng(seed)
    track = rng.normal(0, 1, (20, 2))
    x, z = rng.normal(0, 1, 2)
    all_frames = [
        0.95 ** (t + 1) * np.exp(-np.hypot(p[0] - x, p[1] - z) / 0.3) for t, p in enumerate(track)
    ]
    assert kernels.approach_reward(track, 0.95, 0.3, x, z) == pytest.approx(max(all_frames))


def test_tracks_are_seen_from_where_an_action_begins(library: Layer):
    tracks, table = stretch_tracks(library), library.table
    assert len(tracks.centre) == len(tracks.root) == table.duration.sum()
    ends = tracks.root[tracks.centre_start[1:] - 1]
    assert np.allclose(ends[:, :2], table.displacement[:, :2])
    assert 0 < tracks.tip_weight.max() <= 1.0
    k = int(np.argmax(np.diff(tracks.tip_start)))
    when = tracks.tip_when[tracks.tip_start[k] : tracks.tip_start[k + 1]]
    assert when.min() >= 1 and when.max() <= table.duration[k]


def test_look_ahead_agrees_with_the_table_for_a_standing_target(library: Layer):
    """The best action's worth at a grid point is its V: one more backup changes nothing."""
    near, hit = (solve(library, b, residual=1e-6) for b in (approach(), strike(library)))
    skill = Skill(library, near, hit, stretch_tracks(library))
    for policy, weights in ((near, (1.0, 0.0)), (hit, (0.0, 1.0))):
        grid = policy.behaviour.grid
        temper = Temper(
            *weights, facing=0.0, few=1, slack=0.0, boredom=0.0, personal_space=0.0, again=1
        )
        for m in range(1, len(grid), 7):
            fighter = Fighters(skill, [temper], 0)
            far = np.full((1, 1, 2), 1e6)
            for state in (0, library.table.states // 2):
                fighter.pick(0, state, grid.points[m][None], far)
                # Points on the rim may leave the grid by rounding and then count as 0.
                if policy.value[state, m] > 1e-3:
                    worth = fighter.choices.worth[0]
                    assert worth == pytest.approx(policy.value[state, m], rel=2e-3)


def test_fighters_keep_their_space_and_do_not_repeat_themselves(library: Layer):
    skill = Skill(
        library,
        solve(library, approach()),
        solve(library, strike(library)),
        stretch_tracks(library),
    )
    target = np.array([[0.0, 1.5, 0.7]])
    state = int(np.argmax(np.diff(library.table.action_start)))
    body = target[None][:, :, [0, 2]]

    def picks(temper: Temper, times: int) -> tuple[Fighters, list[int]]:
        mind = Fighters(skill, [temper], 0)
        return mind, [mind.pick(0, state, target, body) for _ in range(times)]

    _, bold = picks(Temper(personal_space=0.0, few=1, boredom=0.0), 6)
    assert len(set(bold)) == 1
    _, bored = picks(Temper(personal_space=0.0, few=1, boredom=0.9), 4)
    assert len(set(bored)) > 1
    shy, stretches = picks(Temper(personal_space=0.6), 10)
    tracks = skill.tracks
    for stretch in stretches:
        a, b = tracks.centre_start[stretch : stretch + 2]
        gap = np.hypot(*(tracks.root[a:b, :2] - [0.0, 0.7]).T).min()
        assert gap >= 0.6 or shy.choices.apart[0] == 0


def test_policies_are_found_again_by_content(library: Layer, tmp_path):
    first = trained(library, approach(), tmp_path)
    again = trained(library, approach(), tmp_path, progress=lambda *_: pytest.fail("trained twice"))
    assert np.array_equal(first.value, again.value) and again.sweeps == first.sweeps
    other = trained(library, approach(sigma=0.2), tmp_path)
    assert not np.array_equal(first.value, other.value)
    assert len(list(tmp_path.glob("*.policy"))) == 2
    for file in tmp_path.glob("*.policy"):
        file.write_bytes(b"damaged")
    assert np.array_equal(trained(library, approach(), tmp_path).value, first.value)


def test_a_cache_that_cannot_be_written_is_no_error(library: Layer, tmp_path):
    (tmp_path / "file").write_text("")
    assert trained(library, approach(), tmp_path / "file" / "cache").converged


@pytest.mark.parametrize(
    "wrong", [{"discount_per_second": 1.0}, {"sigma": 0.0}, {"tolerance": -1.0}]
)
def test_settings_that_make_no_sense_are_refused(wrong):
    with pytest.raises(KumiteError):
        approach(**wrong)


def test_grids_and_tempers_that_make_no_sense_are_refused():
    with pytest.raises(KumiteError, match="no effective hits"):
        strike_grid(np.zeros((0, 3)))
    with pytest.raises(KumiteError, match="size"):
        TargetGrid((0, 0, 0), (1, 1, 1), (1, 5, 1), wraps=False, inside_only=True)
    with pytest.raises(KumiteError, match="weights"):
        Temper(approach=0.0, strike=0.0)


# Behaviours as data ------------------------------------------------------------------------------


def _station_twin(behaviour, tracks, k: int, target: np.ndarray, fps: float) -> float:
    """What the doc string of Station says, frame by frame."""
    s = behaviour.station
    a, b = tracks.centre_start[k : k + 2]
    discount = behaviour.discount_per_second ** (1.0 / fps)
    values, before = [], np.arctan2(-target[0], -target[2])
    for t in range(a, b):
        x, z, yaw = tracks.root[t]
        point = tracks.centre[t] if s.point == "reach" else np.array([x, z])
        good = np.exp(-abs(np.hypot(*(target[[0, 2]] - point)) - s.distance) / s.sigma)
        if s.bearing is not None:
            seen = np.arctan2(target[0] - x, target[2] - z) - yaw - np.radians(s.bearing)
            seen = (seen + np.pi) % (2 * np.pi) - np.pi
            good *= np.exp(-abs(seen) / np.radians(s.bearing_sigma))
        if s.orbit:
            angle = np.arctan2(x - target[0], z - target[2])
            turned = (angle - before + np.pi) % (2 * np.pi) - np.pi
            good *= np.clip(turned * fps / s.orbit, 0, 1)
            before = angle
        values.append(good * discount ** (t - a + 1))
    return (1 - discount) * sum(values) if s.always else max(values)


@pytest.mark.parametrize(
    "station",
    [
        Station(distance=1.0),
        Station(point="reach", sigma=0.1),
        Station(distance=1.2, bearing=40.0, always=True),
        Station(distance=1.1, sigma=0.3, bearing=0.0, orbit=-0.6, always=True),
    ],
)
def test_station_rewards_equal_a_slow_twin(library: Layer, station: Station):
    behaviour = Behaviour("mine", approach_grid(), station=station)
    tracks, fps = stretch_tracks(library), library.clips.fps
    reward = stretch_rewards(behaviour, tracks, fps)
    points = behaviour.grid.points
    rng = np.random.default_rng(0)
    for k, m in zip(rng.integers(0, len(reward), 40), rng.integers(1, len(points), 40)):
        slow = _station_twin(behaviour, tracks, int(k), points[m], fps)
        assert reward[k, m] == pytest.approx(slow, abs=1e-6)


def test_keeping_off_backs_away_and_circling_goes_round(library: Layer):
    for name, behaviour in (("keep_off", keep_off(1.8)), ("circle", circle())):
        policy = solve(library, behaviour)
        skill = Skill(
            library,
            solve(library, approach()),
            solve(library, strike(library)),
            stretch_tracks(library),
            (policy,),
        )
        temper = Temper(
            0.0, 0.0, personal_space=0.0, facing=0.0, few=1, boredom=0.0, more={name: 1.0}
        )
        mind, tracks = Fighters(skill, [temper], 0), skill.tracks
        state, target = 0, np.array([[0.0, 1.5, 0.9]])
        far = np.full((1, 1, 2), 1e6)
        turned = 0.0
        for _ in range(8):
            k = mind.pick(0, state, target, far)
            a, b = tracks.centre_start[k : k + 2]
            path = np.vstack([[0.0, 0.0], tracks.root[a:b, :2]])
            angle = np.unwrap(np.arctan2(*(path - target[0, [0, 2]]).T))
            turned += angle[-1] - angle[0]
            x, z, yaw = library.table.displacement[k]
            dx, dz = target[0, 0] - x, target[0, 2] - z
            c, s = np.cos(yaw), np.sin(yaw)
            target = np.array([[c * dx - s * dz, 1.5, s * dx + c * dz]])
            state = int(library.table.target[k])
        if name == "keep_off":
            assert np.hypot(target[0, 0], target[0, 2]) > 1.35
        else:
            assert turned > 0.3


def test_a_place_is_reached_and_its_way_faced(library: Layer):
    """Greedy steps of take_place bring the avatar near the place, and round to its heading."""
    place = take_place()
    skill = Skill(
        library,
        solve(library, approach()),
        solve(library, strike(library)),
        stretch_tracks(library),
        (solve(library, place),),
    )
    temper = Temper(
        0.0, 0.0, personal_space=0.0, facing=0.0, few=1, boredom=0.0, more={"take_place": 1.0}
    )
    far = np.full((1, 1, 2), 1e6)
    off, turned = [], []
    for yaw in np.radians([0.0, 90.0, 180.0, -90.0]):
        mind, state, here = Fighters(skill, [temper], 0), 0, np.zeros(3)
        there = np.array([0.6, 1.0, yaw])
        for _ in range(14):
            x, z, heading = planar_compose(planar_inverse(here), there)
            k = mind.pick(0, state, np.array([[x, 1.5, z, heading]]), far)
            here = planar_compose(here, library.table.displacement[k])
            state = int(library.table.target[k])
        off.append(np.hypot(*(here - there)[:2]))
        turned.append(abs((here[2] - yaw + np.pi) % (2 * np.pi) - np.pi))
    assert np.median(off) < 0.3 and np.median(turned) < np.radians(45)


def test_headings_need_a_grid_of_headings():
    with pytest.raises(KumiteError, match="needs a grid of headings"):
        Behaviour("mine", approach_grid(), station=Station(heading=0.0))
    with pytest.raises(KumiteError, match="needs a grid of headings"):
        Behaviour("mine", heading_grid(), station=Station())


def test_a_behaviour_counts_only_in_its_active_region(library: Layer):
    near = replace(keep_off(), name="near", farthest=1.0)
    skill = Skill(
        library,
        solve(library, approach()),
        solve(library, strike(library)),
        stretch_tracks(library),
        (solve(library, near),),
    )
    mind = Fighters(skill, [Temper(0.0, 0.0, facing=0.0, more={"near": 1.0})], 0)
    far = np.full((1, 1, 2), 1e6)
    mind.pick(0, 0, np.array([[0.0, 1.5, 0.9]]), far)
    assert mind.choices.worth[0] > 0
    mind.pick(0, 0, np.array([[0.0, 1.5, 1.1]]), far)
    assert mind.choices.worth[0] == 0


def test_striking_counts_only_while_the_target_is_in_reach(library: Layer):
    """What is said of its reach is what is so: at its rim and beyond, striking is worth nothing."""
    behaviour = strike(library)
    assert 1.2 < behaviour.farthest < 2.0
    assert strike(library, farthest=0.8).farthest == 0.8
    assert strike(library, limbs=("left_hand",)).farthest <= behaviour.farthest
    everywhere = replace(behaviour, farthest=np.inf)
    far = np.full((1, 1, 2), 1e6)
    tracks, near = stretch_tracks(library), solve(library, approach())
    worths = []
    for said in (behaviour, everywhere):
        skill = Skill(library, near, solve(library, said), tracks)
        mind = Fighters(skill, [Temper(0.0, 6.0, facing=0.0, again=1)], 0)
        worths.append([])
        for state in range(0, library.table.states, 5):
            for away in (0.7, behaviour.farthest - 0.01, behaviour.farthest + 0.01, 3.0):
                for yaw in np.linspace(-np.pi, np.pi, 7):
                    target = np.array([[away * np.sin(yaw), 1.5, away * np.cos(yaw)]])
                    mind.pick(0, state, target, far)
                    worths[-1].append((away, mind.choices.worth[0]))
    assert worths[0] == worths[1]
    assert max(w for away, w in worths[0] if away < 1.0) > 0
    assert all(w == 0 for away, w in worths[0] if away > behaviour.farthest)


def test_behaviours_that_make_no_sense_are_refused():
    grid = approach_grid()
    with pytest.raises(KumiteError, match="unknown behaviour 'dance'"):
        Behaviour("dance", grid)
    with pytest.raises(KumiteError, match="expected body or reach"):
        Station(point="nose")
    with pytest.raises(KumiteError, match="sigmas above 0"):
        Station(sigma=0.0)
    with pytest.raises(KumiteError, match="active from 2"):
        Behaviour("mine", grid, station=Station(), nearest=2.0, farthest=1.0)
    temper = Temper()
    with pytest.raises(KumiteError, match="not all 0"):
        temper.set_weight("approach", 0.0)
        temper.set_weight("strike", 0.0)
    assert temper.approach == 0.0 and temper.strike == 6.0  # the last weight stays
