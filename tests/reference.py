"""Slow, obvious twins of what the kernels do: loops, float64, no tricks."""

from __future__ import annotations

import math
from typing import Any, NamedTuple, Protocol

import numpy as np


def quaternion_matrix(q: np.ndarray) -> np.ndarray:
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def forward_kinematics(parents, offsets, root, wxyz):
    """Positions [J, 3] and world matrices [J, 3, 3] of one pose, by 3 × 3 matrices."""
    position = np.zeros((len(parents), 3))
    matrix = np.zeros((len(parents), 3, 3))
    for j, p in enumerate(parents):
        local = quaternion_matrix(wxyz[j])
        if j == 0:
            position[j], matrix[j] = root, local
        else:
            position[j] = position[p] + matrix[p] @ offsets[j]
            matrix[j] = matrix[p] @ local
    return position, matrix


def distances(quaternion, weight, feature):
    """D [P, P] of all pairs, in float64."""
    count = quaternion.shape[2]
    out = np.zeros((count, count))
    for a in range(count):
        for b in range(count):
            for j in range(len(weight)):
                dot = abs(
                    sum(float(quaternion[j, c, a]) * float(quaternion[j, c, b]) for c in range(4))
                )
                out[a, b] += float(weight[j]) * (2 * math.acos(min(dot, 1.0))) ** 2
            for row in feature:
                out[a, b] += (float(row[a]) - float(row[b])) ** 2
    return out


def local_minima(distance, joined, group, limit):
    """Pairs (a, b) as in kernels.distance.local_minima, given the whole matrix."""
    count = len(distance)
    found = set()
    for a in range(count):
        for b in range(count):
            d = distance[a, b]
            if a == b or not d < limit or group[a] != group[b]:
                continue
            rivals = []
            for r in (a - 1, a, a + 1):
                for c in (b - 1, b, b + 1):
                    if (r, c) == (a, b) or not (0 <= r < count and 0 <= c < count):
                        continue
                    if r != a and not joined[max(r, a)]:
                        continue
                    if c != b and not joined[max(c, b)]:
                        continue
                    if group[r] == group[a] and group[c] == group[b]:
                        rivals.append(((r, c), distance[r, c]))
            if all(e > d or (e == d and rc > (a, b)) for rc, e in rivals):
                found.add((a, b))
    return found


def reachable(edges: dict[int, list[int]], start: int) -> set[int]:
    seen, todo = {start}, [start]
    while todo:
        for n in edges.get(todo.pop(), []):
            if n not in seen:
                seen.add(n)
                todo.append(n)
    return seen


def largest_component(edges: dict[int, list[int]], nodes: range) -> set[int]:
    """The largest set of nodes that all reach each other."""
    forward = {n: reachable(edges, n) for n in nodes}
    groups = {frozenset(m for m in forward[n] if n in forward[m]) for n in nodes}
    return set(max(groups, key=lambda g: (len(g), -min(g))))


def polar_value(value, grid, point):
    """Linear interpolation of values [M] on a TargetGrid, written with np.interp axis by axis."""
    angle = math.atan2(point[0], point[2])
    distance = math.hypot(point[0], point[2])
    table = np.asarray(value, dtype=np.float64).reshape(grid.size)
    angles = grid.low[0] + grid.step[0] * np.arange(grid.size[0])
    distances_ = grid.low[1] + grid.step[1] * np.arange(grid.size[1])
    heights = grid.low[2] + grid.step[2] * np.arange(grid.size[2])
    if grid.inside_only and not bool(grid.contains(np.asarray(point))):
        return 0.0
    if grid.wraps:
        angles = np.append(angles, grid.high[0])
        table = np.concatenate([table, table[:1]])
        angle = (angle - grid.low[0]) % (2 * math.pi) + grid.low[0]
    if len(heights) > 1:
        table = np.array(
            [[np.interp(point[1], heights, line) for line in plane] for plane in table]
        )
    else:
        table = table[..., 0]
    line = [np.interp(distance, distances_, row) for row in table]
    return float(np.interp(angle, angles, line))


def value_iteration(table, reward, discount, grid, sweeps):
    """V [N, M] of Eq. 4, action by action, point by point."""
    points = grid.points
    value = np.zeros((table.states, len(points)))
    for _ in range(sweeps):
        new = np.zeros_like(value)
        for s in range(table.states):
            for m, e in enumerate(points):
                best = -math.inf
                for a in range(table.action_start[s], table.action_start[s + 1]):
                    k = table.stretch[a]
                    x, z, yaw = table.displacement[k]
                    dx, dz = e[0] - x, e[2] - z
                    c, n = math.cos(yaw), math.sin(yaw)
                    later = (c * dx - n * dz, e[1], n * dx + c * dz)
                    q = reward[k, m] + discount ** table.duration[k] * polar_value(
                        value[table.target[k]], grid, later
                    )
                    best = max(best, q)
                new[s, m] = best
        value = new
    return value


def first_touch(p0, p1, a0, a1, b0, b1, radius_a, radius_b, radius, steps=4000):
    """First time 0..1 at which a moving sphere and a moving capsule touch, by brute force."""
    for k in range(steps + 1):
        t = k / steps
        p, a, b = (u + t * (v - u) for u, v in ((p0, p1), (a0, a1), (b0, b1)))
        ab = b - a
        s = np.clip(np.dot(p - a, ab) / max(np.dot(ab, ab), 1e-12), 0, 1)
        if np.linalg.norm(p - a - s * ab) - (radius_a + s * (radius_b - radius_a)) <= radius:
            return t
    return None


class Edge(NamedTuple):
    action: int
    comp: float  # as the searcher sees it
    coop: float
    state: Any


class PlainGame(Protocol):
    def player(self, state: Any) -> int: ...  # 0: the searcher
    def edges(self, state: Any) -> list[Edge]: ...
    def considered(self, state: Any) -> int: ...  # edges before pruning
    def leaf(self, state: Any) -> tuple[float, float]: ...


class PlainFound(NamedTuple):
    comp: float
    coop: float
    best: int | None
    children: list[tuple[int, float, float]]  # action and scores copied up
    nodes: list[int]
    considered: list[int]


def game_tree(
    game: PlainGame, state: Any, depth: int, comp: float = 0.0, coop: float = 0.0
) -> PlainFound:
    """Eqs. 1-3 of Shum et al. 2012 as they are written; comp, coop: the sums of the way here."""
    nodes, considered = [1] + [0] * depth, [1] + [0] * depth
    edges = game.edges(state) if depth > 0 else []
    if depth > 0:
        considered[1] = game.considered(state)
    if not edges:
        more = game.leaf(state)
        return PlainFound(comp + more[0], coop + more[1], None, [], nodes, considered)
    below = [game_tree(game, e.state, depth - 1, comp + e.comp, coop + e.coop) for e in edges]
    for d in range(depth):
        nodes[d + 1] = sum(child.nodes[d] for child in below)
        considered[d + 1] += sum(child.considered[d] for child in below if d > 0)
    if game.player(state) == 0:
        best = max(range(len(below)), key=lambda n: below[n].comp + below[n].coop)
    else:
        best = min(range(len(below)), key=lambda n: below[n].comp - below[n].coop)
    children = [(e.action, child.comp, child.coop) for e, child in zip(edges, below)]
    return PlainFound(below[best].comp, below[best].coop, best, children, nodes, considered)
