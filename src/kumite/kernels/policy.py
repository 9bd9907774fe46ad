"""Precomputed policies: rewards, interpolation and value iteration (Lee & Lee 2004, section 4).

Solved is  V(s, e) = max_a [ R(s, e, a) + γ^T(a) V(s', e') ]  (Eq. 4, with the discount of the
action's duration), e on a grid around the avatar. All actions that land on one frame share one
stretch l, so Q(l, e) = R(l, e) + γ^T(l) V(s'(l), e'(l, e)) is backed up once a stretch and
V(s, e) = max over the state's actions of Q(stretch(a), e): the same numbers, with an interpolation
a stretch instead of one an action.

Shapes: N states, A actions, L stretches, M grid points, W interpolation corners (4 or 8).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange

from kumite.kernels.jit import kernel, parallel_kernel

FACING_CONE = np.cos(np.radians(30.0))  # within it a target is faced; a boxer's hips are bladed


@kernel
def carry(displacement, x, z):
    """A ground point seen from the frame that ``displacement`` (x, z, yaw) leads to."""
    dx, dz = x - displacement[0], z - displacement[1]
    c, s = np.cos(displacement[2]), np.sin(displacement[2])
    return c * dx - s * dz, s * dx + c * dz


@kernel
def corners(x, y, z, low, step, size, wraps, inside_only, index, weight):
    """Linear interpolation on the polar grid at a point of the facing frame.

    low, step, size [3] of (angle, distance, height); wraps: the angle is all round. inside_only:
    outside the grid all weights are 0; else the point is clamped onto it. Fills index and weight
    [8] (4 used where there is one height) and returns how many.
    """
    heights = size[2]
    count = 4 if heights == 1 else 8
    angle = np.arctan2(x, z) - low[0]
    if wraps:
        angle = angle - np.floor(angle / (2.0 * np.pi)) * (2.0 * np.pi)
    u = angle / step[0]
    v = (np.hypot(x, z) - low[1]) / step[1]
    h = 0.0 if heights == 1 else (y - low[2]) / step[2]
    slack = 1e-6  # grid points themselves must not fall outside by rounding
    out = (not wraps and (u < -slack or u > size[0] - 1 + slack)) or (
        v < -slack or v > size[1] - 1 + slack or h < -slack or h > heights - 1 + slack
    )
    if out and inside_only:
        for k in range(count):
            index[k] = 0
            weight[k] = 0.0
        return count
    if not wraps:
        u = min(max(u, 0.0), size[0] - 1.0)
    v = min(max(v, 0.0), size[1] - 1.0)
    h = min(max(h, 0.0), heights - 1.0)
    u0 = int(u) if wraps else min(int(u), max(size[0] - 2, 0))
    v0 = min(int(v), max(size[1] - 2, 0))
    h0 = min(int(h), max(heights - 2, 0))
    fu, fv, fh = u - u0, v - v0, h - h0
    u0 = u0 % size[0]
    u1 = (u0 + 1) % size[0]
    v1, h1 = min(v0 + 1, size[1] - 1), min(h0 + 1, heights - 1)
    for c in range(count):
        du, dv, dh = c & 1, (c >> 1) & 1, (c >> 2) & 1
        iu = u1 if du else u0
        iv = v1 if dv else v0
        ih = h1 if dh else h0
        index[c] = (iu * size[1] + iv) * heights + ih
        weight[c] = (fu if du else 1.0 - fu) * (fv if dv else 1.0 - fv) * (fh if dh else 1.0 - fh)
    return count


@kernel
def interpolate(value, x, y, z, low, step, size, wraps, inside_only, index, weight):
    """One state's values [M] at a point of its facing frame."""
    count = corners(x, y, z, low, step, size, wraps, inside_only, index, weight)
    v = 0.0
    for k in range(count):
        v += weight[k] * value[index[k]]
    return v


@parallel_kernel
def successor_corners(displacement, points, low, step, size, wraps, inside_only, index, weight):
    """Where each grid point lies on the grid after each stretch.

    points [M, 3]; index [L, M, W] int32 and weight [L, M, W] float32 are filled.
    """
    for s in prange(displacement.shape[0]):
        i8 = np.zeros(8, dtype=np.int64)
        w8 = np.zeros(8)
        for m in range(points.shape[0]):
            x, z = carry(displacement[s], points[m, 0], points[m, 2])
            n = corners(x, points[m, 1], z, low, step, size, wraps, inside_only, i8, w8)
            for k in range(n):
                index[s, m, k] = i8[k]
                weight[s, m, k] = w8[k]


@kernel
def approach_reward(track, discount, sigma, x, z):
    """max_t γ^t exp(-|p(t) - p_d| / σ)  (Eq. 5); track [T, 2], the first frame played is t = 1."""
    best = 0.0
    factor = 1.0
    for t in range(track.shape[0]):
        factor *= discount
        if factor <= best:
            break  # even a perfect place could not beat it any more
        d = np.hypot(track[t, 0] - x, track[t, 1] - z)
        best = max(best, factor * np.exp(-d / sigma))
    return best


@kernel
def strike_reward(tip, weight, when, discount, tolerance, x, y, z):
    """max_t γ^t I(t) w(t)  (Eq. 6) over effective frames: tip [P, 3], weight [P], when [P] ≥ 1."""
    best = 0.0
    for p in range(tip.shape[0]):
        d2 = (tip[p, 0] - x) ** 2 + (tip[p, 1] - y) ** 2 + (tip[p, 2] - z) ** 2
        if d2 <= tolerance * tolerance:
            best = max(best, discount ** when[p] * weight[p])
    return best


@parallel_kernel
def approach_rewards(track, start, discount, sigma, points, out):
    """Rewards [L, M] of stretches whose tracks are track[start[l]:start[l + 1]]."""
    for s in prange(out.shape[0]):
        part = track[start[s] : start[s + 1]]
        for m in range(points.shape[0]):
            out[s, m] = approach_reward(part, discount, sigma, points[m, 0], points[m, 2])


@parallel_kernel
def strike_rewards(tip, weight, when, start, discount, tolerance, points, out):
    """Rewards [L, M] of stretches whose effective hits are tip[start[l]:start[l + 1]]."""
    for s in prange(out.shape[0]):
        a, b = start[s], start[s + 1]
        for m in range(points.shape[0]):
            out[s, m] = strike_reward(
                tip[a:b],
                weight[a:b],
                when[a:b],
                discount,
                tolerance,
                points[m, 0],
                points[m, 1],
                points[m, 2],
            )


@parallel_kernel
def back_up_stretches(reward, factor, target, index, weight, value, out):
    """Q [L, M] from the values [N, M] of the states that the stretches end in."""
    for s in prange(reward.shape[0]):
        v = value[target[s]]
        for m in range(reward.shape[1]):
            e = np.float32(0.0)
            for k in range(index.shape[2]):
                e += weight[s, m, k] * v[index[s, m, k]]
            out[s, m] = reward[s, m] + factor[s] * e


@parallel_kernel
def best_actions(action_start, stretch, q, value, change):
    """V(s, e) = max over the actions of s of Q: value [N, M] in place, its largest change [N]."""
    for s in prange(action_start.shape[0] - 1):
        row = value[s]
        old = row.copy()
        first = stretch[action_start[s]]
        for m in range(row.shape[0]):
            row[m] = q[first, m]
        for a in range(action_start[s] + 1, action_start[s + 1]):
            line = q[stretch[a]]
            for m in range(row.shape[0]):
                row[m] = max(row[m], line[m])
        largest = np.float32(0.0)
        for m in range(row.shape[0]):
            largest = max(largest, abs(row[m] - old[m]))
        change[s] = largest


class Moves(NamedTuple):
    """What the stretches of an action table do, seen from where they begin."""

    action_start: np.ndarray  # [N + 1]
    stretch: np.ndarray  # [A]
    successor: np.ndarray  # [L]
    displacement: np.ndarray  # [L, 3]
    duration: np.ndarray  # [L] frames
    start: np.ndarray  # [L + 1] first row of each stretch in centre and root
    centre: np.ndarray  # [T, 2] m, where blows land, on the ground
    root: np.ndarray  # [T, 4] m and sine, cosine: (x, z) and yaw of the facing frame
    tip: np.ndarray  # [P, 3] m, effective hitting points
    tip_weight: np.ndarray  # [P]
    tip_when: np.ndarray  # [P] frames, from 1
    tip_start: np.ndarray  # [L + 1]


class Worth(NamedTuple):
    """A solved behaviour, and how its reward is scaled."""

    value: np.ndarray  # [N, M] float32
    low: np.ndarray  # the grid: see corners()
    step: np.ndarray
    size: np.ndarray
    wraps: bool
    inside_only: bool
    discount: float  # per frame
    scale: float  # m, σ of approaching or the tolerance of striking


@kernel
def worth_later(worth, state, x, y, z, index, weight):
    """The interpolated value of a state with the target at a point of its facing frame."""
    return interpolate(
        worth.value[state],
        x,
        y,
        z,
        worth.low,
        worth.step,
        worth.size,
        worth.wraps,
        worth.inside_only,
        index,
        weight,
    )


@kernel
def look_ahead(state, goal, target, others, moves, near, hit, approach, strike, facing, worth, gap):
    """One step of Eq. 4 at run time, exact in the continuous target, for every action of a state.

    target [H, 3]: where the target is expected at frames 1.. after the decision, seen from the
    avatar's facing frame; the last row holds from then on. goal [H, 3]: the same for approaching,
    brought within the reach of its grid. others [O, H, 2]: the same for bodies that must not be run
    into. approach, strike, facing: weights. Fills worth [n] with the weighted values, cut down by
    exp(-facing) for each unit by which the target is out of a cone ahead (in cosine, mean over the
    action), and gap [n] with the smallest distance kept to the other bodies.
    """
    index = np.zeros(8, dtype=np.int64)
    weight = np.zeros(8)
    horizon = target.shape[0] - 1
    for n, a in enumerate(range(moves.action_start[state], moves.action_start[state + 1])):
        k = moves.stretch[a]
        first, last = moves.start[k], moves.start[k + 1]
        end = min(moves.duration[k], horizon + 1) - 1
        worth[n] = 0.0
        if approach != 0.0:
            best, factor, nearest = 0.0, 1.0, np.inf
            for t in range(last - first):
                factor *= near.discount
                if factor <= best:
                    break
                h = min(t, horizon)
                dx, dz = (
                    moves.centre[first + t, 0] - goal[h, 0],
                    moves.centre[first + t, 1] - goal[h, 2],
                )
                d2 = dx * dx + dz * dz
                if d2 < nearest:  # later and farther off is never better
                    nearest = d2
                    best = max(best, factor * np.exp(-np.sqrt(d2) / near.scale))
            x, z = carry(moves.displacement[k], goal[end, 0], goal[end, 2])
            later = worth_later(near, moves.successor[k], x, 0.0, z, index, weight)
            worth[n] += approach * (best + near.discount ** moves.duration[k] * later)
        if strike != 0.0:
            best = 0.0
            for p in range(moves.tip_start[k], moves.tip_start[k + 1]):
                h = min(moves.tip_when[p] - 1, horizon)
                d2 = 0.0
                for c in range(3):
                    d2 += (moves.tip[p, c] - target[h, c]) ** 2
                if d2 <= hit.scale * hit.scale:
                    best = max(best, hit.discount ** moves.tip_when[p] * moves.tip_weight[p])
            x, z = carry(moves.displacement[k], target[end, 0], target[end, 2])
            later = worth_later(hit, moves.successor[k], x, target[end, 1], z, index, weight)
            worth[n] += strike * (best + hit.discount ** moves.duration[k] * later)
        near2, astray = np.inf, 0.0
        for t in range(last - first):
            h = min(t, horizon)
            rx, rz = moves.root[first + t, 0], moves.root[first + t, 1]
            x, z = target[h, 0] - rx, target[h, 2] - rz
            ahead = x * moves.root[first + t, 2] + z * moves.root[first + t, 3]
            astray += max(0.0, FACING_CONE - ahead / (np.sqrt(x * x + z * z) + 1e-9))
            for o in range(others.shape[0]):
                dx, dz = rx - others[o, h, 0], rz - others[o, h, 1]
                near2 = min(near2, dx * dx + dz * dz)
        worth[n] *= np.exp(-facing * astray / (last - first))
        gap[n] = np.sqrt(near2)
