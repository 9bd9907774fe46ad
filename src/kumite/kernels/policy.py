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
    turn: np.ndarray  # [L, 2] sine and cosine of the displacement's yaw
    duration: np.ndarray  # [L] frames
    start: np.ndarray  # [L + 1] first row of each stretch in centre and root
    centre: np.ndarray  # [T, 2] m, where blows land, on the ground
    root: np.ndarray  # [T, 4] m and sine, cosine: (x, z) and yaw of the facing frame
    tip: np.ndarray  # [P, 3] m, effective hitting points
    tip_weight: np.ndarray  # [P]
    tip_when: np.ndarray  # [P] frames, from 1
    tip_start: np.ndarray  # [L + 1]


class Behaviours(NamedTuple):
    """Solved behaviours, Z of them, and what each rewards."""

    kind: np.ndarray  # [Z] APPROACH, STRIKE or STATION
    params: np.ndarray  # [Z, 7]: see Station's columns; σ of approaching, tolerance of striking
    discount: np.ndarray  # [Z] per frame
    fade: np.ndarray  # [Z, T] its powers, from 0 to the longest duration
    active: np.ndarray  # [Z, 2] m, nearest and farthest target for which it counts
    value: np.ndarray  # flat float32, one behaviour after the other: [N, M of it]
    start: np.ndarray  # [Z + 1]
    points: np.ndarray  # [Z] M of each
    low: np.ndarray  # [Z, 3] the grids: see corners()
    step: np.ndarray  # [Z, 3]
    size: np.ndarray  # [Z, 3]
    wraps: np.ndarray  # [Z] bool
    inside_only: np.ndarray  # [Z] bool


APPROACH, STRIKE, STATION = range(3)
POINT, DISTANCE, SIGMA, BEARING, BEARING_SIGMA, ORBIT, ALWAYS = range(7)
"""Columns of params. POINT: 0 the body, 1 where blows land; ORBIT in rad a frame."""


@kernel
def station_reward(root, centre, params, discount, target, sx, sz):
    """How well a stretch keeps a station: a distance, a bearing, a way round the target.

    root [T, 4], centre [T, 2]: the stretch's tracks; target [H, 3] foreseen, moved by (-sx, -sz).
    max_t γ^t s(t), or (1 - γ) Σ γ^t s(t), with s the product of exp(-|distance - wanted| / σ), the
    same of the bearing, and the share of the wanted turning round the target.
    """
    best, total, factor = 0.0, 0.0, 1.0
    before = np.nan
    for t in range(root.shape[0]):
        h = min(t, target.shape[0] - 1)
        tx, tz = target[h, 0] - sx, target[h, 2] - sz
        factor *= discount
        x, z = tx - root[t, 0], tz - root[t, 1]
        if params[POINT] == 0.0:
            d = np.hypot(x, z)
        else:
            d = np.hypot(tx - centre[t, 0], tz - centre[t, 1])
        s = np.exp(-abs(d - params[DISTANCE]) / params[SIGMA])
        if params[BEARING_SIGMA] > 0.0:
            left, ahead = x * root[t, 3] - z * root[t, 2], x * root[t, 2] + z * root[t, 3]
            off = np.arctan2(left, ahead) - params[BEARING]
            off -= 2.0 * np.pi * np.floor((off + np.pi) / (2.0 * np.pi))
            s *= np.exp(-abs(off) / params[BEARING_SIGMA])
        if params[ORBIT] != 0.0:
            round_it = np.arctan2(-x, -z)
            if t == 0:
                before = np.arctan2(-tx, -tz)
            turned = round_it - before
            turned -= 2.0 * np.pi * np.floor((turned + np.pi) / (2.0 * np.pi))
            s *= min(max(turned / params[ORBIT], 0.0), 1.0)
            before = round_it
        best = max(best, factor * s)
        total += factor * s
    return (1.0 - discount) * total if params[ALWAYS] != 0.0 else best


@parallel_kernel
def station_rewards(root, centre, start, params, discount, points, out):
    """Rewards [L, M] of stretches for targets [M, 3] that stand still."""
    for s in prange(out.shape[0]):
        a, b = start[s], start[s + 1]
        for m in range(points.shape[0]):
            out[s, m] = station_reward(
                root[a:b], centre[a:b], params, discount, points[m : m + 1], 0.0, 0.0
            )


@kernel
def worth_later(all_of, b, state, x, y, z, index, weight):
    """Behaviour b's interpolated value of a state with the target at a point of its frame."""
    first = all_of.start[b] + state * all_of.points[b]
    return interpolate(
        all_of.value[first : first + all_of.points[b]],
        x,
        y,
        z,
        all_of.low[b],
        all_of.step[b],
        all_of.size[b],
        all_of.wraps[b],
        all_of.inside_only[b],
        index,
        weight,
    )


@kernel
def reward_now(k, kind, params, discount, target, sx, sz, moves):
    """R of stretch k for a target [H, 3], foreseen and moved by (-sx, -sz)."""
    horizon = target.shape[0] - 1
    first, last = moves.start[k], moves.start[k + 1]
    best = 0.0
    if kind == STATION:
        part = slice(first, last)
        return station_reward(
            moves.root[part], moves.centre[part], params, discount, target, sx, sz
        )
    if kind == STRIKE:
        for p in range(moves.tip_start[k], moves.tip_start[k + 1]):
            h = min(moves.tip_when[p] - 1, horizon)
            dx, dz = moves.tip[p, 0] - target[h, 0] + sx, moves.tip[p, 2] - target[h, 2] + sz
            dy = moves.tip[p, 1] - target[h, 1]
            if dx * dx + dy * dy + dz * dz <= params[SIGMA] * params[SIGMA]:
                best = max(best, discount ** moves.tip_when[p] * moves.tip_weight[p])
        return best
    # The largest of γ^t exp(-d/σ), found by its logarithm: one exponential instead of many.
    most, passed, fall = -np.inf, 0.0, np.log(discount)
    for t in range(last - first):
        passed += fall
        if passed <= most:
            break  # even a perfect place could not beat it any more
        h = min(t, horizon)
        dx = moves.centre[first + t, 0] - target[h, 0] + sx
        dz = moves.centre[first + t, 1] - target[h, 2] + sz
        most = max(most, passed - np.sqrt(dx * dx + dz * dz) / params[SIGMA])
    return np.exp(most)


@kernel
def off_the_rim(behaviours, b, x, z):
    """The share of the way to a target (x, z) that lies beyond behaviour b's grid.

    A target out of the grid is looked at as if it stood on its rim: each action brings it nearer.
    (Were the place after the action clamped instead, no way of getting there would be better than
    another.)
    """
    if behaviours.inside_only[b]:
        return 0.0
    rim = behaviours.low[b, 1] + behaviours.step[b, 1] * (behaviours.size[b, 1] - 1)
    return max(0.0, 1.0 - rim / max(np.hypot(x, z), 1e-9))


@kernel
def look_ahead(state, target, others, moves, behaviours, weights, facing, worth, gap):
    """One step of Eq. 4 at run time, exact in the continuous target, for every action of a state.

    target [H, 3]: where the target is expected at frames 1.. after the decision, seen from the
    avatar's facing frame; the last row holds from then on. others [O, H, 2]: the same for bodies
    that must not be run into. weights [Z] of the behaviours; one counts only while the target is in
    its active region. Fills worth [n] with the weighted values, cut down by exp(-facing) for each
    unit by which the target is out of a cone ahead (in cosine, mean over the action), and gap [n]
    with the smallest distance kept to the other bodies.
    """
    index = np.zeros(8, dtype=np.int64)
    weight = np.zeros(8)
    horizon = target.shape[0] - 1
    begin, end = moves.action_start[state], moves.action_start[state + 1]
    worth[:] = 0.0
    away = np.hypot(target[0, 0], target[0, 2])
    for b in range(behaviours.kind.shape[0]):
        if weights[b] == 0.0 or not behaviours.active[b, 0] <= away <= behaviours.active[b, 1]:
            continue
        share = off_the_rim(behaviours, b, target[0, 0], target[0, 2])
        sx, sz = share * target[0, 0], share * target[0, 2]
        for n in range(end - begin):
            k = moves.stretch[begin + n]
            now = reward_now(
                k,
                behaviours.kind[b],
                behaviours.params[b],
                behaviours.discount[b],
                target,
                sx,
                sz,
                moves,
            )
            h = min(moves.duration[k], horizon + 1) - 1
            dx = target[h, 0] - sx - moves.displacement[k, 0]
            dz = target[h, 2] - sz - moves.displacement[k, 1]
            s, c = moves.turn[k, 0], moves.turn[k, 1]
            x, y, z = c * dx - s * dz, target[h, 1], s * dx + c * dz
            later = worth_later(behaviours, b, moves.successor[k], x, y, z, index, weight)
            worth[n] += weights[b] * (now + behaviours.fade[b, moves.duration[k]] * later)
    for n in range(end - begin):
        k = moves.stretch[begin + n]
        first, last = moves.start[k], moves.start[k + 1]
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
