"""SARSA on a process of cells: motion and level of preparation towards a goal (Shum et al. 2013).

A state is (class, level, goal cell, source cell): which actions may follow, how prepared the
character is, where goal and source of influence are seen. An action is (motion, level). Each step
puts the goal and the source on one of K places of their cells, by chance; the motion carries them
to new cells. So the process is Markov, and its transitions are shares of places: exact, whatever
simulates it.

Shapes: C classes, M motions, A levels that may be chosen, L levels (A, and the one forced at the
source, if it is not among them), G goal cells short of the goal, I source cells, K places in a
cell, S = C L G I states, U = M A actions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kumite.kernels.jit import kernel

AT_GOAL = np.int32(-1)


class Polar(NamedTuple):
    """Cells about the character: distance from 0 in steps, angle with cell 0 about straight ahead.

    Cell r * angles + t. What is farther than the last distance counts as in it.
    """

    step: float  # m
    distances: int
    angles: int
    farthest: float  # m, where the places of the last distance end


class Weights(NamedTuple):
    """Of what the motion alone decides of the reward (Eq. 11)."""

    facing: float
    progress: float
    arrival: float  # for reaching the goal


class Process(NamedTuple):
    """What happens, as tables."""

    goal_next: np.ndarray  # [M, A, G, K] int32, a goal cell or AT_GOAL
    goal_reward: np.ndarray  # [M, A, G, K], weighted facing, progress and arrival
    source_next: np.ndarray  # [M, A, I, K] int32
    at_source: int  # source cells below it are at the source
    level: np.ndarray  # [L], the last is the one forced
    steadiness: float  # weight of -(change of level)²
    two_changes: bool  # what is forced counts as two changes: to the level chosen, from it to 1
    choice_start: np.ndarray  # [C + 1]
    choice: np.ndarray  # actions m * A + a, ascending in a class
    class_after: np.ndarray  # [M]
    duration: np.ndarray  # [M] s


class Rates(NamedTuple):
    """How it learns."""

    rate: float  # λ of Eq. 14
    settling: float  # the n-th visit of a pair learns at λ / (1 + n / settling); inf: at λ
    discount: float  # γ
    explore: float  # ε
    flags: bool  # exploring starts: what was never tried goes first
    longest: int  # steps after which an episode is given up


class Learner(NamedTuple):
    """All that learning changes."""

    q: np.ndarray  # [S, U]
    visits: np.ndarray  # [S, U] int32; 0 is the flag of an action not tried yet
    best: np.ndarray  # [S] int32, the action of the largest q, the first of equals
    untried: np.ndarray  # [S] int32, actions of the state without visits
    seed: np.ndarray  # [1] uint64


@kernel
def draw(seed, n):
    """A number 0..n-1 (splitmix64; the product's high bits, n far below 2^32)."""
    seed[0] += np.uint64(0x9E3779B97F4A7C15)
    z = seed[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return np.int64(((z >> np.uint64(32)) * np.uint64(n)) >> np.uint64(32))


@kernel
def cell_of(polar, distance, angle):
    """The cell of a distance [m] and an angle [rad]."""
    r = int(min(distance / polar.step, polar.distances - 1.0))
    t = int(np.floor(angle / (2.0 * np.pi) * polar.angles + 0.5)) % polar.angles
    return r * polar.angles + t


@kernel
def place_in(polar, cell, k, count, shift):
    """Place k of a cell's ``count``: (distance, angle), a lattice of even spread in both."""
    r, t = cell // polar.angles, cell % polar.angles
    low = r * polar.step
    high = polar.farthest if r == polar.distances - 1 else low + polar.step
    u = (k + 0.5) / count
    v = (shift + (k + 1) * 0.6180339887498949) % 1.0
    return low + u * (high - low), (t + v - 0.5) * 2.0 * np.pi / polar.angles


@kernel
def seen_after(displacement, distance, angle):
    """(distance, angle) of a point after a planar displacement (x, z, yaw); angles to the left."""
    x = distance * np.sin(angle) - displacement[0]
    z = distance * np.cos(angle) - displacement[1]
    c, s = np.cos(displacement[2]), np.sin(displacement[2])
    return np.hypot(x, z), np.arctan2(x * c - z * s, x * s + z * c)


@kernel
def goal_steps(displacement, polar, weights, goal_next, goal_reward):
    """Where each motion and level brings the goal, and the reward of that."""
    motions, levels, cells, places = goal_next.shape
    for m in range(motions):
        for a in range(levels):
            for g in range(cells):
                for k in range(places):
                    before, angle = place_in(polar, g + polar.angles, k, places, 0.0)
                    d, off = seen_after(displacement[m, a], before, angle)
                    facing, progress = -abs(off), before - d  # Eqs. 8, 9
                    reward = weights.facing * facing + weights.progress * progress
                    cell = cell_of(polar, d, off) - polar.angles
                    if cell < 0:
                        cell, reward = AT_GOAL, reward + weights.arrival
                    goal_next[m, a, g, k], goal_reward[m, a, g, k] = cell, reward


@kernel
def source_steps(displacement, polar, source_next):
    """Where each motion and level brings the source of influence."""
    motions, levels, cells, places = source_next.shape
    for m in range(motions):
        for a in range(levels):
            for i in range(cells):
                for k in range(places):
                    d, angle = place_in(polar, i, k, places, 0.25)
                    d, angle = seen_after(displacement[m, a], d, angle)
                    source_next[m, a, i, k] = cell_of(polar, d, angle)


@kernel
def state_of(process, c, level, g, i):
    """The number of a state."""
    goals, sources = process.goal_next.shape[2], process.source_next.shape[2]
    return ((c * process.level.shape[0] + level) * goals + g) * sources + i


@kernel
def choose(process, rates, learner, s, c):
    """An action for state s: one never tried, by chance one of all, or the best (6.4)."""
    first, last = process.choice_start[c], process.choice_start[c + 1]
    if rates.flags and learner.untried[s] > 0:
        n = draw(learner.seed, learner.untried[s])
        for j in range(first, last):
            if learner.visits[s, process.choice[j]] == 0:
                if n == 0:
                    return int(process.choice[j])
                n -= 1
    if draw(learner.seed, 1 << 30) < rates.explore * (1 << 30):
        return int(process.choice[first + draw(learner.seed, last - first)])
    return int(learner.best[s])


@kernel
def learn(process, rates, learner, s, c, u, target):
    """Q(s, u) ← Q + λ (target - Q), Eq. 14; the best action of s kept up to date."""
    q, best = learner.q[s], learner.best[s]
    before = q[u]
    rate = rates.rate / (1.0 + learner.visits[s, u] / rates.settling)
    q[u] = before + rate * (target - before)
    learner.untried[s] -= learner.visits[s, u] == 0
    learner.visits[s, u] += 1
    if u != best:
        if q[u] > q[best] or (q[u] == q[best] and u < best):
            learner.best[s] = u
    elif q[u] < before:
        for j in range(process.choice_start[c], process.choice_start[c + 1]):
            other = process.choice[j]
            if q[other] > q[best] or (q[other] == q[best] and other < best):
                best = other
        learner.best[s] = best


@kernel
def episodes(process, rates, learner, count):
    """Play and learn: (mean return of an episode, steps, seconds, episodes given up)."""
    goals, sources = process.goal_next.shape[2], process.source_next.shape[2]
    levels, places = process.goal_next.shape[1], process.goal_next.shape[3]
    classes, forced = process.choice_start.shape[0] - 1, process.level.shape[0] - 1
    total, steps, seconds, lost = 0.0, 0, 0.0, 0
    for _ in range(count):
        c = draw(learner.seed, classes)
        level = draw(learner.seed, forced + 1)
        g = draw(learner.seed, goals)
        i = draw(learner.seed, sources)
        s = state_of(process, c, level, g, i)
        u = choose(process, rates, learner, s, c)
        factor = 1.0
        for step in range(rates.longest):
            m, a = u // levels, u % levels
            k = draw(learner.seed, places)
            g_next = process.goal_next[m, a, g, k]
            reward = process.goal_reward[m, a, g, k]
            i_next = process.source_next[m, a, i, draw(learner.seed, places)]
            reached = i_next < process.at_source and i >= process.at_source
            level_next = forced if reached else a
            between = a if process.two_changes else level_next
            change = process.level[between] - process.level[level]
            rise = process.level[level_next] - process.level[between]
            reward -= process.steadiness * (change * change + rise * rise)  # Eq. 10
            total += factor * reward  # Eq. 13
            factor *= rates.discount
            steps += 1
            seconds += process.duration[m]
            if g_next == AT_GOAL:
                learn(process, rates, learner, s, c, u, reward)
                break
            c_next = process.class_after[m]
            s_next = state_of(process, c_next, level_next, g_next, i_next)
            u_next = choose(process, rates, learner, s_next, c_next)
            target = reward + rates.discount * learner.q[s_next, u_next]
            learn(process, rates, learner, s, c, u, target)
            s, c, u, level, g, i = s_next, c_next, u_next, level_next, g_next, i_next
            lost += step == rates.longest - 1
    return total / count, steps, seconds, lost
