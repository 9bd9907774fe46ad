"""How soon a target is reached: by a policy's choices, and at best by any path of the graph.

Both play on the action table. A standing target is a point, so where it is, seen from the avatar,
and the avatar's state are all there is to know. Global search is A* in whole frames (Hart, Nilsson,
Raphael 1968); its estimate is never too large (``reaches``), so without merging what it finds is
the optimum. Two places in one cell of one state count as one, the sooner: that makes it finite, and
its answer an upper bound on the optimum.

Shapes: N states, A actions, L stretches, P marks, H frames looked ahead.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange

from kumite.kernels.jit import kernel, parallel_kernel
from kumite.kernels.look_ahead import look_ahead, look_further
from kumite.kernels.policy import carry

NEVER = -1
EMPTY = np.int64(-1)
MULTIPLIER = np.uint64(0x9E3779B97F4A7C15)  # Fibonacci hashing: odd, near 2^64 / golden ratio
HALF = np.int64(1 << 20)  # cells to either side of the avatar that a key can tell apart
LOW = np.int64(0xFFFFFFFF)
SLACK = 1e-9  # m: the estimate must not be too large by rounding


class Marks(NamedTuple):
    """What must come near the target, seen from where stretches begin: tips or the centre."""

    point: np.ndarray  # [P, 3] m
    when: np.ndarray  # [P] frames since the stretch began, from 1, ascending in a stretch
    start: np.ndarray  # [L + 1]
    flat: bool  # heights do not count


class Search(NamedTuple):
    """Room for one search: open nodes as struct of arrays, a heap of them, a table of cells."""

    taken: np.ndarray  # [nodes] int32, frames since the start
    state: np.ndarray  # [nodes] int32
    place: np.ndarray  # [nodes, 2] m, the target seen from the avatar
    heap: np.ndarray  # [nodes] int64, (frames at least in all) << 32 | node
    cell: np.ndarray  # [power of 2 above nodes] int64 keys
    soonest: np.ndarray  # [the same] int32, frames after which the cell was first reached


@kernel
def first_reached(marks, stretch, x, y, z, tolerance):
    """Frames after which a stretch comes within ``tolerance`` of a point, or NEVER."""
    for p in range(marks.start[stretch], marks.start[stretch + 1]):
        dx, dz = marks.point[p, 0] - x, marks.point[p, 2] - z
        dy = 0.0 if marks.flat else marks.point[p, 1] - y
        if dx * dx + dy * dy + dz * dz <= tolerance * tolerance:
            return marks.when[p]
    return NEVER


@kernel
def reaches(moves, marks, y, tolerance, out):
    """How far on the ground [m] any path from a state can reach: out [N, H + 1] is filled.

    Of marks within ``tolerance`` of height y, within 0..H frames. By the triangle inequality never
    less than the truth, and one action's way and what is left after it are never less than the
    whole: the frames it takes to reach a distance are a consistent estimate for A*.
    """
    states, horizon = out.shape[0], out.shape[1] - 1
    count = len(moves.duration)
    own = np.full((count, horizon + 1), -np.inf)
    way = np.hypot(moves.displacement[:, 0], moves.displacement[:, 1])
    for k in range(count):
        for p in range(marks.start[k], marks.start[k + 1]):
            counts = marks.flat or abs(marks.point[p, 1] - y) <= tolerance
            if counts and marks.when[p] <= horizon:
                away = np.hypot(marks.point[p, 0], marks.point[p, 2])
                own[k, marks.when[p]] = max(own[k, marks.when[p]], away)
    out[:] = -np.inf
    for t in range(1, horizon + 1):
        for k in range(count):
            own[k, t] = max(own[k, t], own[k, t - 1])
            if t > moves.duration[k]:
                later = way[k] + out[moves.successor[k], t - moves.duration[k]]
                own[k, t] = max(own[k, t], later)
        for s in range(states):
            for a in range(moves.action_start[s], moves.action_start[s + 1]):
                out[s, t] = max(out[s, t], own[moves.stretch[a], t])


@kernel
def frames_at_least(reach, distance):
    """The fewest frames within which ``reach`` [H + 1], ascending, is ``distance``; H + 1: none."""
    low, high = 1, len(reach)
    while low < high:
        middle = (low + high) // 2
        if reach[middle] >= distance:
            high = middle
        else:
            low = middle + 1
    return low


@kernel
def _push(heap, size, key):
    at = size
    while at > 0 and heap[(at - 1) >> 1] > key:
        heap[at] = heap[(at - 1) >> 1]
        at = (at - 1) >> 1
    heap[at] = key


@kernel
def _pop(heap, size):
    """The smallest key; ``size`` - 1 keys are left."""
    top, key = heap[0], heap[size - 1]
    at, child = 0, 1
    while child < size - 1:
        if child + 1 < size - 1 and heap[child + 1] < heap[child]:
            child += 1
        if heap[child] >= key:
            break
        heap[at] = heap[child]
        at, child = child, 2 * child + 1
    heap[at] = key
    return top


@kernel
def _sooner(search, state, x, z, cell, taken):
    """Whether nothing was in this cell of this state as soon; if so, it is now."""
    i = min(max(np.int64(np.floor(x / cell)) + HALF, 0), 2 * HALF - 1)
    j = min(max(np.int64(np.floor(z / cell)) + HALF, 0), 2 * HALF - 1)
    key = (np.int64(state) << 42) | (i << 21) | j
    mask = len(search.cell) - 1
    at = np.int64((np.uint64(key) * MULTIPLIER) >> np.uint64(32)) & mask
    while search.cell[at] != EMPTY and search.cell[at] != key:
        at = (at + 1) & mask
    if search.cell[at] == key and search.soonest[at] <= taken:
        return False
    search.cell[at] = key
    search.soonest[at] = taken
    return True


@kernel
def best_frames(moves, marks, reach, state, target, tolerance, cell, search):
    """Frames of the soonest path from a state to a target [3]: (frames or NEVER, nodes, whether
    the search ended before its room did). reach [N, H + 1] of ``reaches`` bounds the frames by H.
    """
    horizon = reach.shape[1] - 1
    room = len(search.taken)
    search.cell[:] = EMPTY
    y = target[1]
    best, nodes, size = horizon + 1, 1, 1
    search.taken[0], search.state[0] = 0, state
    search.place[0, 0], search.place[0, 1] = target[0], target[2]
    search.heap[0] = 0
    while size > 0:
        key = _pop(search.heap, size)
        size -= 1
        if (key >> 32) >= best:
            break
        n = key & LOW
        s, taken, x, z = search.state[n], search.taken[n], search.place[n, 0], search.place[n, 1]
        for a in range(moves.action_start[s], moves.action_start[s + 1]):
            k = moves.stretch[a]
            after = first_reached(marks, k, x, y, z, tolerance)
            if after != NEVER:
                best = min(best, taken + after)
                continue
            then = taken + moves.duration[k]
            if then >= best:
                continue
            u, v = carry(moves.displacement[k], x, z)
            successor = moves.successor[k]
            left = np.hypot(u, v) - tolerance - SLACK
            whole = then + frames_at_least(reach[successor], left)
            if whole >= best or not _sooner(search, successor, u, v, cell, then):
                continue
            if nodes == room:
                return (best if best <= horizon else NEVER), nodes, False
            search.taken[nodes], search.state[nodes] = then, successor
            search.place[nodes, 0], search.place[nodes, 1] = u, v
            _push(search.heap, size, (np.int64(whole) << 32) | nodes)
            size += 1
            nodes += 1
    return (best if best <= horizon else NEVER), nodes, True


@kernel
def choose(moves, behaviours, weights, few, state, x, y, z, worth, gap):
    """The stretch of the action that is worth most; the first of equals.

    By one exact backup; where few > 1, that many of the best are weighed again by two. worth, gap
    [most actions of a state] are room to work in.
    """
    first = moves.action_start[state]
    count = moves.action_start[state + 1] - first
    target, nobody = np.array([[x, y, z, 0.0]]), np.empty((0, 1, 2))
    look_ahead(state, target, nobody, 0.0, moves, behaviours, weights, 0.0, worth, gap)
    if few <= 1:
        return moves.stretch[first + np.argmax(worth[:count])]
    best, most = moves.stretch[first], -np.inf
    for _ in range(min(few, count)):
        a = np.argmax(worth[:count])
        worth[a] = -np.inf
        value = look_further(first + a, target, moves, behaviours, weights, 0.0)
        if value > most:
            best, most = moves.stretch[first + a], value
    return best


@kernel
def policy_frames(moves, marks, behaviours, weights, few, state, target, tolerance, horizon):
    """Frames until the greedy policy reaches a target [3], NEVER within ``horizon``."""
    most = np.max(np.diff(moves.action_start))
    worth, gap = np.empty(most), np.empty(most)
    x, y, z = target
    taken = 0
    while taken < horizon:
        k = choose(moves, behaviours, weights, few, state, x, y, z, worth, gap)
        after = first_reached(marks, k, x, y, z, tolerance)
        if after != NEVER:
            return taken + after if taken + after <= horizon else NEVER
        taken += moves.duration[k]
        x, z = carry(moves.displacement[k], x, z)
        state = moves.successor[k]
    return NEVER


@kernel
def policy_times(moves, marks, behaviours, weights, few, state, target, tolerance, horizon, out):
    """``policy_frames`` of every trial: state [n], target [n, 3]; out [n] is filled."""
    for n in range(len(state)):
        out[n] = policy_frames(
            moves, marks, behaviours, weights, few, state[n], target[n], tolerance, horizon
        )


@parallel_kernel
def best_times(moves, marks, state, target, tolerance, cell, horizon, room, out, nodes, whole):
    """``best_frames`` of every trial: out, nodes, whole [n] are filled; room: nodes at most."""
    for n in prange(len(state)):
        reach = np.empty((len(moves.action_start) - 1, horizon + 1))
        reaches(moves, marks, target[n, 1], tolerance, reach)
        cells = 2
        while cells <= room + 1:
            cells *= 2
        search = Search(
            np.empty(room, dtype=np.int32),
            np.empty(room, dtype=np.int32),
            np.empty((room, 2)),
            np.empty(room, dtype=np.int64),
            np.empty(cells, dtype=np.int64),
            np.empty(cells, dtype=np.int32),
        )
        out[n], nodes[n], whole[n] = best_frames(
            moves, marks, reach, state[n], target[n], tolerance, cell, search
        )
