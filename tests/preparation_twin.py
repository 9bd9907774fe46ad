"""The process of preparation behaviour, worked out slowly, and solved exactly by policy iteration.

Written from docs/preparation-learning.md, not from the kernel: points carried by planar transforms,
states and actions of the whole process as dense matrices.
"""

from __future__ import annotations

import math

import numpy as np

from kumite.control.preparation import Motions, PreparationSettings
from kumite.rotation import planar_apply, planar_inverse

GOAL = -1


def walker(
    step: float = 0.65, turn_deg: float = 45.0, settings: PreparationSettings | None = None
) -> Motions:
    """Stand, step forward, left, right and back, turn left and right: each may follow each."""
    turn = math.radians(turn_deg)
    whole = {
        "stand": (0, 0, 0),
        "forward": (0, step, 0),
        "left": (0.85 * step, 0.1, 0),
        "right": (-0.85 * step, 0.1, 0),
        "back": (0, -0.8 * step, 0),
        "turn left": (0, 0, turn),
        "turn right": (0, 0, -turn),
    }
    levels = (settings or PreparationSettings()).chosen
    displacement = np.array(list(whole.values()))[:, None, :] * (1 - levels)[None, :, None]
    count = len(whole)
    seconds = np.array([1.0, 0.6, 0.7, 0.7, 0.7, 0.6, 0.6])
    return Motions(tuple(whole), displacement, seconds, np.ones((count, count), bool))


def four_cores(settings: PreparationSettings | None = None) -> Motions:
    """The same, with four cores: after standing, walking, side steps and turns other motions go."""
    motions = walker(settings=settings)
    follows = np.ones((7, 7), bool)
    follows[1, 4] = follows[4, 1] = False  # no stepping back out of a walk, nor the other way
    follows[2:4, 5:7] = follows[5:7, 2:4] = False  # no turns out of side steps, nor back
    return Motions(motions.names, motions.displacement, motions.duration, follows)


def places(low, high, middle, width, count, shift):
    """Places [K, 2] (distance, angle) of a cell."""
    found = []
    for k in range(count):
        part = (shift + (k + 1) * (math.sqrt(5) - 1) / 2) % 1.0
        found.append((low + (k + 0.5) / count * (high - low), middle + (part - 0.5) * width))
    return np.array(found)


def carried(displacement, seen):
    """(distance, angle) [K, 2] as seen after a displacement."""
    d, angle = seen.T
    point = np.stack([d * np.sin(angle), np.zeros(len(d)), d * np.cos(angle)], axis=-1)
    x, _, z = planar_apply(planar_inverse(displacement), point).T
    return np.stack([np.sqrt(x * x + z * z), np.arctan2(x, z)], axis=-1)


def cell(distance, angle, step, distances, angles):
    ring = min(math.floor(distance / step), distances - 1)
    width = 2 * math.pi / angles
    nearest = min(range(angles), key=lambda t: abs(math.remainder(angle - t * width, 2 * math.pi)))
    return ring, nearest


class Exact:
    """Transition shares and mean rewards of the process, and its exact solution."""

    def __init__(self, motions: Motions, s: PreparationSettings) -> None:
        self.s, self.motions = s, motions
        self.rows, self.class_after = np.unique(motions.follows, axis=0, return_inverse=True)
        self.class_after = self.class_after.reshape(-1)
        count, levels = motions.displacement.shape[:2]
        self.actions = [(m, a) for m in range(count) for a in range(levels)]
        self.goals = [(r, t) for r in range(1, s.goal_distances) for t in range(s.goal_angles)]
        self.sources = [(r, t) for r in range(s.source_distances) for t in range(s.source_angles)]
        goals, sources, actions = len(self.goals), len(self.sources), len(self.actions)
        self.to_goal = np.zeros((actions, goals, goals + 1))  # the last: the goal
        self.gain = np.zeros((actions, goals))
        self.to_source = np.zeros((actions, sources, sources))
        for u, (m, a) in enumerate(self.actions):
            displacement = motions.displacement[m, a]
            for g, (r, t) in enumerate(self.goals):
                high = s.farthest if r == s.goal_distances - 1 else (r + 1) * s.goal_step
                width = 2 * math.pi / s.goal_angles
                seen = places(r * s.goal_step, high, t * width, width, s.places, 0.0)
                for (before, _), (d, angle) in zip(seen, carried(displacement, seen)):
                    ring, turn = cell(d, angle, s.goal_step, s.goal_distances, s.goal_angles)
                    reward = s.facing * -abs(angle) + s.progress * (before - d)
                    if ring == 0:
                        self.to_goal[u, g, GOAL] += 1 / s.places
                        reward += s.arrival
                    else:
                        self.to_goal[u, g, self.goals.index((ring, turn))] += 1 / s.places
                    self.gain[u, g] += reward / s.places
            for i, (r, t) in enumerate(self.sources):
                high = s.farthest if r == s.source_distances - 1 else (r + 1) * s.source_step
                width = 2 * math.pi / s.source_angles
                seen = places(r * s.source_step, high, t * width, width, s.places, 0.25)
                for d, angle in carried(displacement, seen):
                    there = cell(d, angle, s.source_step, s.source_distances, s.source_angles)
                    self.to_source[u, i, self.sources.index(there)] += 1 / s.places
        self.levels = s.all_levels
        self.shape = (len(self.rows), len(self.levels), goals, sources)
        inner = np.array([r == 0 for r, _ in self.sources])
        self.reaches = ~inner[:, None] & inner[None, :]  # [I, I]

    def q(self, value: np.ndarray) -> np.ndarray:
        """Q [C, L, G, I, U] of values [C, L, G, I]; what may not follow is -inf."""
        s, forced = self.s, len(self.levels) - 1
        out = np.full((*self.shape, len(self.actions)), -np.inf)
        for u, (m, a) in enumerate(self.actions):
            after = value[self.class_after[m]]
            stays, reaches = self.to_source[u] * ~self.reaches, self.to_source[u] * self.reaches
            go = self.to_goal[u, :, :-1]
            ahead = go @ after[a] @ stays.T + go @ after[forced] @ reaches.T
            share = reaches.sum(axis=1)
            for level, alpha in enumerate(self.levels):
                if s.two_changes:
                    rise = share * (1 - self.levels[a]) ** 2
                    cost = (self.levels[a] - alpha) ** 2 + rise
                else:
                    cost = (1 - share) * (self.levels[a] - alpha) ** 2 + share * (1 - alpha) ** 2
                worth = self.gain[u][:, None] - s.steadiness * cost[None] + s.discount * ahead
                for c, row in enumerate(self.rows):
                    if row[m]:
                        out[c, level, :, :, u] = worth
        return out

    def value(self, policy: np.ndarray, start: np.ndarray | None = None) -> np.ndarray:
        """V [C, L, G, I] of a policy of the same shape, by successive backups to 1e-12."""
        value = np.zeros(self.shape) if start is None else start
        while True:
            new = np.take_along_axis(self.q(value), policy[..., None], axis=-1)[..., 0]
            if np.abs(new - value).max() < 1e-12:
                return new
            value = new

    def solve(self, residual: float = 1e-12) -> np.ndarray:
        """V* [C, L, G, I], by value iteration."""
        value = np.zeros(self.shape)
        while True:
            new = self.q(value).max(axis=-1)
            if np.abs(new - value).max() < residual:
                return new
            value = new

    def regret(self, policy: np.ndarray) -> tuple[float, float]:
        """Mean and largest of (V* - V_π) over the states, over the range of V*."""
        best = self.solve()
        lost = (best - self.value(policy)) / np.ptp(best)
        return float(lost.mean()), float(lost.max())
