"""What precomputed policies are worth: how soon they reach a target, over the soonest of all paths.

Lee & Lee 2004 (section 7) say of their policies that they find optimal paths at a given resolution,
as global search would. Here both are run and timed on the action table: the greedy policy with
exact backups, as fighters play it but without chance and boredom, and global search with continuous
places. Two aims: *reach*, the centre of the hitting points (Eq. 5's p) comes within 0.15 m of the
target on the ground; *hit*, a tip passes it effectively within the strike behaviour's tolerance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kumite.checked import checked
from kumite.control.fighter import Skill
from kumite.control.grid import TargetGrid
from kumite.errors import KumiteError
from kumite.kernels import worth as kernels
from kumite.rotation import planar_apply

GOAL = 1.15  # median of the policy's time over the best path's
REACHED = 0.15  # m
LONGEST = 6.0  # s that the best path may take; the policy may take twice as long
CELL = 0.1  # m, places this near count as one in global search: half of it changes nothing
ROOM = 1 << 19  # nodes of one global search
WALK = 1.3  # m, how far the volume of hits is carried for coverage
SOON = 2.0  # s within which a covered target is hit
WEIGHTS = {"reach": (1.0, 0.0), "hit": (1.0, 6.0)}  # of approach and strike


@dataclass(frozen=True)
class Trials:
    """States to start in, and where the standing target is, seen from there."""

    state: np.ndarray  # [n] int64
    target: np.ndarray  # [n, 3] m, in the facing frame

    def __len__(self) -> int:
        return len(self.state)


def around(skill: Skill, count: int, seed: int) -> Trials:
    """Targets spread evenly over the approach grid's disc, at heights of the effective hits."""
    rng = np.random.default_rng(seed)
    away = skill.approach.behaviour.grid.high[1] * np.sqrt(rng.random(count))
    angle = rng.uniform(-np.pi, np.pi, count)
    height = rng.choice(skill.tracks.tip[:, 1], count)
    target = np.stack([away * np.sin(angle), height, away * np.cos(angle)], axis=-1)
    return Trials(rng.integers(skill.library.table.states, size=count), target)


def within_a_walk(skill: Skill, count: int, seed: int, walk: float = WALK) -> Trials:
    """Targets spread evenly over the strike grid's volume, carried by up to ``walk`` m any way and
    turned any way: what stepping about in a disc would bring within the volume."""
    rng = np.random.default_rng(seed)
    low, high = (np.array(v) for v in _bounds(skill.strike.behaviour.grid))
    angle, squared, height = (low + (high - low) * rng.random((count, 3))).T
    away = np.sqrt(squared)
    point = np.stack([away * np.sin(angle), height, away * np.cos(angle)], axis=-1)
    shift, way, turn = walk * np.sqrt(rng.random(count)), *rng.uniform(-np.pi, np.pi, (2, count))
    carried = np.stack([shift * np.sin(way), shift * np.cos(way), turn], axis=-1)
    return Trials(
        rng.integers(skill.library.table.states, size=count), planar_apply(carried, point)
    )


def _bounds(grid: TargetGrid) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Angle, distance squared (in which area is even) and height: the first and the last."""
    (a, b, c), (d, e, f) = grid.low, grid.high
    return (a, b * b, c), (d, e * e, f)


@dataclass(frozen=True)
class Times:
    """How long each of n trials takes [s]; inf: not within the longest time."""

    policy: np.ndarray  # [n]
    best: np.ndarray  # [n]
    nodes: np.ndarray  # [n], of global search
    whole: np.ndarray  # [n] bool: the search ended before its room did

    @property
    def ratio(self) -> np.ndarray:
        """The policy's time over the best path's, where there is such a path."""
        there = np.isfinite(self.best)
        return self.policy[there] / self.best[there]


def time_to_target(
    skill: Skill,
    trials: Trials,
    aim: str,
    *,
    weights: tuple[float, float] | None = None,
    few: int = 1,
    longest: float = LONGEST,
    cell: float = CELL,
    room: int = ROOM,
) -> Times:
    """Times until the targets are reached or hit, by the policy and by the best path.

    weights: of approach and strike; by default approach alone for *reach*, 1 and 6 for *hit*.
    few: how many of the best actions are weighed again by a second backup; 1: none. cell: places
    of one state in one cell [m] count as one in global search, so that its time is an upper bound.
    """
    if aim not in WEIGHTS:
        raise KumiteError(f"unknown aim {aim!r}; expected one of {list(WEIGHTS)}")
    if not (longest > 0 and cell > 0 and room > 0 and few > 0):
        raise KumiteError("longest, cell, room and few: expected more than 0")
    moves, fps = skill.moves, skill.library.clips.fps
    marks = _marks(skill, aim)
    greed = np.array([*(weights or WEIGHTS[aim]), *(0.0 for _ in skill.more)], dtype=float)
    tolerance = REACHED if aim == "reach" else skill.strike.behaviour.tolerance
    horizon = round(longest * fps)
    policy, best, nodes = (np.empty(len(trials), dtype=np.int64) for _ in range(3))
    whole = np.empty(len(trials), dtype=np.bool_)
    state, target = trials.state, np.ascontiguousarray(trials.target)
    kernels.policy_times(
        moves,
        marks,
        skill.behaviours,
        greed,
        few,
        state,
        target,
        tolerance,
        2 * horizon,
        policy,
    )
    kernels.best_times(
        moves, marks, state, target, tolerance, cell, horizon, room, best, nodes, whole
    )
    return Times(_seconds(policy, fps), _seconds(best, fps), nodes, whole)


def _seconds(frames: np.ndarray, fps: float) -> np.ndarray:
    return np.where(frames == kernels.NEVER, np.inf, frames / fps)


def _marks(skill: Skill, aim: str) -> kernels.Marks:
    tracks = skill.tracks
    if aim == "hit":
        return kernels.Marks(tracks.tip, tracks.tip_when, tracks.tip_start, False)
    start = tracks.centre_start
    since = np.arange(start[-1]) - np.repeat(start[:-1], np.diff(start)) + 1
    return kernels.Marks(np.insert(tracks.centre, 1, 0.0, axis=1), since, start, True)


@dataclass(frozen=True)
class Coverage:
    """Share of targets within a walk that are hit soon."""

    policy: float
    best: float


def coverage(
    skill: Skill, count: int = 100, seed: int = 0, *, soon: float = SOON, few: int = 1
) -> Coverage:
    """Of ``within_a_walk``'s targets, the share hit within ``soon`` s, by policy and best path."""
    times = time_to_target(skill, within_a_walk(skill, count, seed), "hit", longest=soon, few=few)
    return Coverage(float((times.policy <= soon).mean()), float(np.isfinite(times.best).mean()))


@dataclass(frozen=True)
class Ratios:
    """The policy's time over the best path's."""

    median: float
    high: float  # 95th percentile; inf: the policy does not come there
    count: int  # targets that some path reaches
    lost: int  # of these, the ones that the policy never does


def ratios(times: Times) -> Ratios:
    """Errors: no path reaches any target."""
    found = times.ratio
    if len(found) == 0:
        raise KumiteError("no path reaches any of the targets within the longest time")
    median, high = np.quantile(found, [0.5, 0.95], method="higher")
    return Ratios(float(median), float(high), len(found), int(np.isinf(found).sum()))


@dataclass(frozen=True)
class Worth:
    """How good policies are."""

    reach: Ratios
    hit: Ratios
    covered: Coverage

    def __str__(self) -> str:
        lines = [
            f"time to {name} over the best path's: median {r.median:.2f} (goal ≤ {GOAL}), "
            f"95 % within {r.high:.2f}, {r.count} targets, {r.lost} never"
            for name, r in (("reach", self.reach), ("hit", self.hit))
        ]
        share = f"{self.covered.policy:.0%}, on the best path {self.covered.best:.0%}"
        return "\n".join([*lines, f"targets hit within {SOON:g} s: {share}"])


@checked
def measure_worth(skill: Skill, count: int = 100, seed: int = 0, *, few: int = 1) -> Worth:
    """Both aims on one set of standing targets, and coverage on another."""
    trials = around(skill, count, seed)
    return Worth(
        ratios(time_to_target(skill, trials, "reach", few=few)),
        ratios(time_to_target(skill, trials, "hit", few=few)),
        coverage(skill, count, seed, few=few),
    )
