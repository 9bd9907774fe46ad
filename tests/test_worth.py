"""Policies and global search against slow twins that try everything."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from kumite.control import (
    Fighters,
    Skill,
    TargetGrid,
    Temper,
    approach,
    approach_grid,
    solve,
    stretch_tracks,
    strike,
)
from kumite.control.policy import Behaviour, frame_discount, stretch_rewards
from kumite.control.worth import (
    REACHED,
    Times,
    Trials,
    around,
    coverage,
    measure_worth,
    ratios,
    time_to_target,
    within_a_walk,
)
from kumite.errors import KumiteError
from kumite.graph import ActionTable, Layer
from kumite.kernels import policy as kernels
from kumite.rotation import planar_apply, planar_inverse
from tests import toys

FPS = 30.0
STATES, WAYS = 4, 3  # of the toy, and actions of each state


def wander(seed: int, frames: int = 6) -> Layer:
    """Four states, three random ways out of each, of ``frames`` or two thirds of them, each of
    which steps and turns at random; hits in the longer stretches.
    """
    rng = np.random.default_rng(seed)
    last = frames * np.arange(1, STATES + 1)
    first = np.concatenate([last - frames + 1, last - frames + 1 + frames // 3])
    into = np.tile(np.arange(STATES), 2)
    ways = np.sort([rng.permutation(2 * STATES)[:WAYS] for _ in range(STATES)]).ravel()
    step = np.stack([*rng.uniform(-0.4, 0.4, (2, 2 * STATES)), rng.uniform(-1, 1, 2 * STATES)], -1)
    table = ActionTable(
        last,
        WAYS * np.arange(STATES + 1),
        ways,
        np.zeros(len(ways), np.float32),
        first,
        last[into],
        into,
        step,
    )
    places = rng.uniform([-0.4, 1.2, 0.3], [0.4, 1.6, 0.8], (STATES, 3))
    hits = {int(f) - 1: (tuple(p), 3.0 + k) for k, (f, p) in enumerate(zip(last, places))}
    return toys.library(table, int(last[-1]) + 1, hits)


@cache
def skill_of(seed: int) -> Skill:
    library = wander(seed)
    near, hit = solve(library, approach()), solve(library, strike(library))
    return Skill(library, near, hit, stretch_tracks(library))


def exhaustive(
    table: ActionTable,
    reward: np.ndarray,
    discount: float,
    grid: TargetGrid,
    state: int,
    m: int,
    depth: int,
) -> float:
    """The most that ``depth`` actions can earn from a state and a grid point, by trying them all;
    between grid points the mean over the corners of the interpolation."""
    if depth == 0:
        return 0.0
    best = -np.inf
    for a in range(table.action_start[state], table.action_start[state + 1]):
        k = table.stretch[a]
        worth, after = float(reward[k, m]), discount ** int(table.duration[k])
        x, y, z = grid.points[m]
        u, v = kernels.carry(table.displacement[k], x, z)
        index, weight = np.zeros(8, np.int64), np.zeros(8)
        count = kernels.corners(u, y, v, *grid.kernel_arguments(), index, weight)
        for i, w in zip(index[:count], weight[:count]):
            if w > 0:
                later = exhaustive(
                    table, reward, discount, grid, int(table.target[k]), int(i), depth - 1
                )
                worth += after * w * later
        best = max(best, worth)
    return best


@pytest.mark.parametrize("name", ["approach", "strike"])
def test_values_equal_exhaustive_search(name: str):
    """Within what the residual and the depth leave open: both are sums of a geometric series."""
    library, depth, residual = wander(3, frames=18), 3, 1e-6
    table = library.table
    hits = TargetGrid((-1.0, 0.2, 1.1), (1.0, 0.9, 1.7), (3, 3, 2), wraps=False, inside_only=True)
    flat = approach_grid(2.0, 3, 5)
    behaviour = Behaviour(
        name, flat if name == "approach" else hits, 1e-4, sigma=0.5, tolerance=0.4
    )
    solved = solve(library, behaviour, residual=residual)
    discount = frame_discount(behaviour, FPS)
    reward = stretch_rewards(behaviour, stretch_tracks(library), FPS)
    shrink = discount ** int(table.duration.min())
    open_ = residual * solved.value.max() / (1 - shrink)
    open_ += shrink**depth * reward.max() / (1 - shrink)
    assert solved.converged and open_ < 0.005 * solved.value.max()
    for state in range(STATES):
        for m in range(0, len(behaviour.grid), 4):
            expected = exhaustive(table, reward, discount, behaviour.grid, state, m, depth)
            assert abs(solved.value[state, m] - expected) <= open_ + 1e-6


def soonest(skill: Skill, aim: str, state: int, target: np.ndarray, left: int) -> float:
    """Frames to a target by trying every path of at most ``left`` frames that may be sooner than
    the best so far; inf: none.
    """
    table, tracks, best = skill.library.table, skill.tracks, np.inf
    for k in table.stretch[table.actions_of(state)]:
        if aim == "reach":
            a, b = tracks.centre_start[k : k + 2]
            off = np.linalg.norm(tracks.centre[a:b] - target[[0, 2]], axis=1)
            there = 1 + np.flatnonzero(off <= REACHED)
        else:
            a, b = tracks.tip_start[k : k + 2]
            off = np.linalg.norm(tracks.tip[a:b] - target, axis=1)
            there = tracks.tip_when[a:b][off <= skill.strike.behaviour.tolerance]
        length = int(table.duration[k])
        if len(there):
            best = min(best, float(there.min()))
        elif length < min(left, best - 1):
            seen = planar_apply(planar_inverse(table.displacement[k]), target)
            sooner = int(min(left, best - 1)) - length
            best = min(best, length + soonest(skill, aim, int(table.target[k]), seen, sooner))
    return best if best <= left else np.inf


def trials_of(skill: Skill, count: int, seed: int) -> Trials:
    """Targets near enough to be reached in a few actions."""
    rng = np.random.default_rng(seed)
    target = rng.uniform([-0.9, 1.3, -0.9], [0.9, 1.5, 0.9], (count, 3))
    return Trials(rng.integers(STATES, size=count), target)


@pytest.mark.parametrize("aim", ["reach", "hit"])
@pytest.mark.parametrize("seed", range(2))
def test_global_search_finds_what_trying_every_path_finds(aim: str, seed: int):
    skill, frames = skill_of(seed), 27
    trials = trials_of(skill, 25, seed)
    times = time_to_target(skill, trials, aim, longest=frames / FPS, cell=1e-6)
    expected = [soonest(skill, aim, s, t, frames) for s, t in zip(trials.state, trials.target)]
    assert times.whole.all()
    assert np.array_equal(times.best, np.array(expected) / FPS)
    assert np.isfinite(times.best).sum() > 3


@pytest.mark.parametrize("aim", ["reach", "hit"])
@pytest.mark.parametrize("few", [1, 3])
def test_no_policy_is_sooner_than_the_best_path(aim: str, few: int):
    for seed in range(4):
        skill = skill_of(seed)
        times = time_to_target(
            skill, trials_of(skill, 40, seed), aim, few=few, longest=2.0, cell=1e-6
        )
        assert times.whole.all() and np.isfinite(times.policy).any()
        assert np.all(times.policy >= times.best)


def test_merging_only_makes_it_later():
    skill = skill_of(0)
    trials = trials_of(skill, 40, 1)
    fine, coarse = (
        time_to_target(skill, trials, "hit", longest=1.5, cell=cell) for cell in (1e-6, 0.2)
    )
    assert np.all(coarse.best >= fine.best)
    assert coarse.nodes.sum() < fine.nodes.sum()


@pytest.mark.parametrize("again", [1, 4])
def test_the_policy_chooses_as_a_fighter_does(library: Layer, again: int):
    """A fighter without chance, boredom and cone, followed until it hits."""
    near, hit = solve(library, approach()), solve(library, strike(library))
    skill = Skill(library, near, hit, stretch_tracks(library))
    trials = around(skill, 10, 5)
    times = time_to_target(skill, trials, "hit", longest=4.0, room=2, few=again)
    temper = Temper(
        1.0, 6.0, facing=0.0, few=1, slack=0.0, boredom=0.0, personal_space=0.0, again=again
    )
    table, tracks = library.table, skill.tracks
    for state, target, found in zip(trials.state, trials.target, times.policy):
        fighter, taken, s, seen = Fighters(skill, [temper], 0), 0, state, target
        while taken < 8.0 * library.clips.fps:
            k = fighter.pick(0, int(s), seen[None], np.full((1, 1, 2), 1e6))
            a, b = tracks.tip_start[k : k + 2]
            off = np.linalg.norm(tracks.tip[a:b] - seen, axis=1)
            there = tracks.tip_when[a:b][off <= hit.behaviour.tolerance]
            if len(there):
                assert found == pytest.approx((taken + there[0]) / library.clips.fps)
                break
            taken += int(table.duration[k])
            s = table.target[k]
            seen = planar_apply(planar_inverse(table.displacement[k]), seen)
        else:
            assert np.isinf(found)


def test_targets_are_drawn_where_they_should_be():
    skill = skill_of(1)
    disc = around(skill, 2000, 0).target
    away = np.hypot(disc[:, 0], disc[:, 2])
    assert away.max() <= 2.0 and (away < 1.0).mean() == pytest.approx(0.25, abs=0.03)
    assert np.isin(disc[:, 1], skill.tracks.tip[:, 1]).all()
    grid = skill.strike.behaviour.grid
    unmoved = within_a_walk(skill, 500, 0, walk=0.0).target
    away = np.hypot(unmoved[:, 0], unmoved[:, 2])
    assert grid.low[1] <= away.min() and away.max() <= grid.high[1]
    walked = within_a_walk(skill, 2000, 0).target
    assert grid.high[1] < np.hypot(walked[:, 0], walked[:, 2]).max() <= grid.high[1] + 1.3
    assert walked[:, 1].min() >= grid.low[2] and walked[:, 1].max() <= grid.high[2]


def test_the_performers_policies_are_nearly_as_soon_as_the_best_path(library: Layer):
    near, hit = solve(library, approach()), solve(library, strike(library))
    skill = Skill(library, near, hit, stretch_tracks(library))
    worth = measure_worth(skill, 12, 1)
    print(worth)
    assert worth.reach.median < 2.0 and worth.hit.median < 2.0
    assert worth.reach.count >= 10 and worth.covered.best >= worth.covered.policy
    assert "goal" in str(worth)


def test_it_is_the_same_every_time():
    skill = skill_of(2)
    one, two = (time_to_target(skill, trials_of(skill, 30, 7), "hit") for _ in range(2))
    for name in ("policy", "best", "nodes", "whole"):
        assert np.array_equal(getattr(one, name), getattr(two, name))
    assert coverage(skill, 20, 3) == coverage(skill, 20, 3)


def test_a_search_without_room_says_so():
    skill = skill_of(0)
    times = time_to_target(skill, trials_of(skill, 30, 0), "hit", room=2)
    assert not times.whole.all()


def test_ratios_and_what_makes_no_sense():
    nothing = np.zeros(4)
    times = Times(
        np.array([2.0, 3.0, np.inf, 1.0]), np.array([1.0, 2.0, 1.0, np.inf]), *[nothing] * 2
    )
    found = ratios(times)
    assert (found.median, found.high, found.count, found.lost) == (2.0, np.inf, 3, 1)
    with pytest.raises(KumiteError, match="no path"):
        ratios(Times(nothing, np.full(4, np.inf), nothing, nothing))
    with pytest.raises(KumiteError, match="aim"):
        time_to_target(skill_of(0), trials_of(skill_of(0), 1, 0), "kick")
    with pytest.raises(KumiteError, match="cell"):
        time_to_target(skill_of(0), trials_of(skill_of(0), 1, 0), "hit", cell=0.0)
