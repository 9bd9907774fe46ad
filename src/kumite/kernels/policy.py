"""Precomputed policies: rewards, interpolation and value iteration (Lee & Lee 2004, section 4).

Solved is  V(s, e) = max_a [ R(s, e, a) + γ^T(a) V(s', e') ]  (Eq. 4, with the discount of the
action's duration), e on a grid around the avatar. All actions that land on one frame share one
stretch l, so Q(l, e) = R(l, e) + γ^T(l) V(s'(l), e'(l, e)) is backed up once a stretch and
V(s, e) = max over the state's actions of Q(stretch(a), e): the same numbers, with an interpolation
a stretch instead of one an action.

Shapes: N states, A actions, L stretches, M grid points, W interpolation corners (4 or 8).
"""

from __future__ import annotations

import numpy as np
from numba import prange

from kumite.kernels.jit import kernel, parallel_kernel


@kernel
def wrapped(angle):
    """The same angle in [-π, π)."""
    return angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi))


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


@parallel_kernel
def successor_corners(
    displacement, points, heading, low, step, size, wraps, inside_only, index, weight
):
    """Where each grid point lies on the grid after each stretch.

    points [M, 3]; heading: the second column is the way the target faces. index [L, M, W] int32
    and weight [L, M, W] float32 are filled.
    """
    for s in prange(displacement.shape[0]):
        i8 = np.zeros(8, dtype=np.int64)
        w8 = np.zeros(8)
        for m in range(points.shape[0]):
            x, z = carry(displacement[s], points[m, 0], points[m, 2])
            y = wrapped(points[m, 1] - displacement[s, 2]) if heading else points[m, 1]
            n = corners(x, y, z, low, step, size, wraps, inside_only, i8, w8)
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


APPROACH, STRIKE, STATION = range(3)
POINT, DISTANCE, SIGMA, BEARING, BEARING_SIGMA, HEADING, HEADING_SIGMA, ORBIT, ALWAYS = range(9)
"""Columns of params. POINT: 0 the body, 1 where blows land; ORBIT in rad a frame."""


@kernel
def station_reward(root, centre, first, last, params, b, discount, target, sx, sz):
    """How well a stretch keeps a station: a distance, a bearing, a heading, a way round.

    root [T, 4], centre [T, 2] from first to last: the stretch's tracks; params [Z, 9], b the row;
    target [H, 4] foreseen, moved by (-sx, -sz).
    max_t γ^t s(t), or (1 - γ) Σ γ^t s(t), with s the product of exp(-|distance - wanted| / σ), the
    same of the bearing and of the heading, and the share of the wanted turning round the target.
    """
    best, total, factor = 0.0, 0.0, 1.0
    before = np.nan
    for t in range(first, last):
        h = min(t - first, target.shape[0] - 1)
        tx, tz = target[h, 0] - sx, target[h, 2] - sz
        factor *= discount
        x, z = tx - root[t, 0], tz - root[t, 1]
        if params[b, POINT] == 0.0:
            d = np.hypot(x, z)
        else:
            d = np.hypot(tx - centre[t, 0], tz - centre[t, 1])
        s = np.exp(-abs(d - params[b, DISTANCE]) / params[b, SIGMA])
        if params[b, BEARING_SIGMA] > 0.0:
            left, ahead = x * root[t, 3] - z * root[t, 2], x * root[t, 2] + z * root[t, 3]
            off = wrapped(np.arctan2(left, ahead) - params[b, BEARING])
            s *= np.exp(-abs(off) / params[b, BEARING_SIGMA])
        if params[b, HEADING_SIGMA] > 0.0:
            off = wrapped(target[h, 3] + params[b, HEADING] - np.arctan2(root[t, 2], root[t, 3]))
            s *= np.exp(-abs(off) / params[b, HEADING_SIGMA])
        if params[b, ORBIT] != 0.0:
            round_it = np.arctan2(-x, -z)
            if t == first:
                before = np.arctan2(-tx, -tz)
            turned = wrapped(round_it - before)
            s *= min(max(turned / params[b, ORBIT], 0.0), 1.0)
            before = round_it
        best = max(best, factor * s)
        total += factor * s
    return (1.0 - discount) * total if params[b, ALWAYS] != 0.0 else best


@parallel_kernel
def station_rewards(root, centre, start, params, discount, points, out):
    """Rewards [L, M] of stretches for targets [M, 4] that stand still; params [1, 9]."""
    for s in prange(out.shape[0]):
        for m in range(points.shape[0]):
            one = points[m : m + 1]
            out[s, m] = station_reward(
                root, centre, start[s], start[s + 1], params, 0, discount, one, 0.0, 0.0
            )
