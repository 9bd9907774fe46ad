"""Choosing by precomputed values: one exact backup, or two, for a target that is anywhere.

One step of  Q(s, e, a) = R(s, e, a) + γ^T(a) V(s', e')  (Lee & Lee 2004, Eq. 4) at run time: e is
where the target is foreseen, not a grid point, and only V(s', e') comes from the table.

Shapes: A actions, L stretches, Z behaviours, H foreseen frames, O other bodies. A target is
[H, 4]: x, y, z [m] and the way it faces [rad], all seen from the avatar's facing frame.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kumite.kernels.jit import kernel
from kumite.kernels.policy import APPROACH, SIGMA, STRIKE, carry, station_reward, wrapped

FACING_CONE = np.cos(np.radians(30.0))  # within it a target is faced; a boxer's hips are bladed


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
    around: np.ndarray  # [L, 3] m, a disc (x, z, radius) that holds each stretch's root track
    tip: np.ndarray  # [P, 3] m, effective hitting points
    tip_weight: np.ndarray  # [P]
    tip_when: np.ndarray  # [P] frames, from 1
    tip_start: np.ndarray  # [L + 1]


class Behaviours(NamedTuple):
    """Solved behaviours, Z of them, and what each rewards."""

    kind: np.ndarray  # [Z] APPROACH, STRIKE or STATION
    params: np.ndarray  # [Z, 9]: see Station's columns; σ of approaching, tolerance of striking
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
    heading: np.ndarray  # [Z] bool: the third axis is the way the target faces, not its height


# The kernels below loop over the actions of a state themselves, and take arrays out of the tuples
# first: handing over tuples of many arrays costs more than what is done for one action.


@kernel
def approach_now(stretches, sigma, discount, target, sx, sz, moves, out):
    """max_t γ^t exp(-|p(t) - p_d| / σ) of stretches [n] (Eq. 5), by its logarithm, into out [n].

    target [H, 4] is moved by (-sx, -sz).
    """
    start, centre = moves.start, moves.centre
    horizon, fall = target.shape[0] - 1, np.log(discount)
    for n in range(stretches.shape[0]):
        first, last = start[stretches[n]], start[stretches[n] + 1]
        most, passed = -np.inf, 0.0
        for t in range(last - first):
            passed += fall
            if passed <= most:
                break  # even a perfect place could not beat it any more
            h = min(t, horizon)
            dx = centre[first + t, 0] - target[h, 0] + sx
            dz = centre[first + t, 1] - target[h, 2] + sz
            d2 = dx * dx + dz * dz
            enough = (passed - most) * sigma  # m: only nearer than that is it better
            if d2 < enough * enough:
                most = passed - np.sqrt(d2) / sigma
        out[n] = np.exp(most)


@kernel
def strike_now(stretches, tolerance, fade, target, sx, sz, moves, out):
    """max_t γ^t I(t) w(t) of stretches [n] (Eq. 6), into out [n]; fade [T]: the powers of γ."""
    start, tip, when, weight = moves.tip_start, moves.tip, moves.tip_when, moves.tip_weight
    horizon = target.shape[0] - 1
    for n in range(stretches.shape[0]):
        out[n] = 0.0
        for p in range(start[stretches[n]], start[stretches[n] + 1]):
            h = min(when[p] - 1, horizon)
            dx, dz = tip[p, 0] - target[h, 0] + sx, tip[p, 2] - target[h, 2] + sz
            dy = tip[p, 1] - target[h, 1]
            if dx * dx + dy * dy + dz * dz <= tolerance * tolerance:
                out[n] = max(out[n], fade[when[p]] * weight[p])


@kernel
def rewards_now(stretches, b, target, sx, sz, moves, behaviours, out):
    """R of behaviour b for stretches [n] and a target [H, 4] moved by (-sx, -sz), into out [n]."""
    kind, params, discount = behaviours.kind[b], behaviours.params, behaviours.discount[b]
    if kind == APPROACH:
        approach_now(stretches, params[b, SIGMA], discount, target, sx, sz, moves, out)
    elif kind == STRIKE:
        fade = behaviours.fade[b]
        strike_now(stretches, params[b, SIGMA], fade, target, sx, sz, moves, out)
    else:
        start, root, centre = moves.start, moves.root, moves.centre
        for n in range(stretches.shape[0]):
            first, last = start[stretches[n]], start[stretches[n] + 1]
            out[n] = station_reward(root, centre, first, last, params, b, discount, target, sx, sz)


class Places(NamedTuple):
    """Where a target is after each of some stretches [n], on the axes of the grids."""

    angle: np.ndarray
    distance: np.ndarray
    height: np.ndarray
    heading: np.ndarray


@kernel
def places_after(stretches, target, sx, sz, moves, out):
    """Where a target [H, 4], moved by (-sx, -sz), is after stretches [n], into out."""
    duration, displacement, turn = moves.duration, moves.displacement, moves.turn
    angle, distance, height, heading = out.angle, out.distance, out.height, out.heading
    for n in range(stretches.shape[0]):
        k = stretches[n]
        h = min(duration[k], target.shape[0]) - 1
        dx = target[h, 0] - sx - displacement[k, 0]
        dz = target[h, 2] - sz - displacement[k, 1]
        s, c = turn[k, 0], turn[k, 1]
        x, z = c * dx - s * dz, s * dx + c * dz
        angle[n], distance[n] = np.arctan2(x, z), np.sqrt(x * x + z * z)
        height[n], heading[n] = target[h, 1], wrapped(target[h, 3] - displacement[k, 2])


@kernel
def values_after(stretches, b, places, moves, behaviours, out):
    """V(s', e') of behaviour b after stretches [n], interpolated, into out [n].

    The same as by :func:`kumite.kernels.policy.corners`, without arrays in between.
    """
    value, step, low = behaviours.value, behaviours.step[b], behaviours.low[b]
    first, points = behaviours.start[b], behaviours.points[b]
    nu, nv, nh = behaviours.size[b, 0], behaviours.size[b, 1], behaviours.size[b, 2]
    wraps, inside_only = behaviours.wraps[b], behaviours.inside_only[b]
    third = places.heading if behaviours.heading[b] else places.height
    angle, distance, successor = places.angle, places.distance, moves.successor
    slack = 1e-6  # grid points themselves must not fall outside by rounding
    for n in range(stretches.shape[0]):
        u = angle[n] - low[0]
        if wraps:
            u -= 2.0 * np.pi * np.floor(u / (2.0 * np.pi))
        u /= step[0]
        v = (distance[n] - low[1]) / step[1]
        h = 0.0 if nh == 1 else (third[n] - low[2]) / step[2]
        beside = not wraps and (u < -slack or u > nu - 1 + slack)
        over = v < -slack or v > nv - 1 + slack or h < -slack or h > nh - 1 + slack
        if inside_only and (beside or over):
            out[n] = 0.0
            continue
        if not wraps:
            u = min(max(u, 0.0), nu - 1.0)
        v = min(max(v, 0.0), nv - 1.0)
        u0, v0 = int(u), min(int(v), nv - 2)
        if u0 >= nu - 1 and not wraps:
            u0 = nu - 2
        fu, fv = u - u0, v - v0
        u0 = u0 - nu if u0 >= nu else u0  # a whole turn, by rounding
        u1 = 0 if u0 + 1 == nu else u0 + 1
        base = first + successor[stretches[n]] * points
        near, far = base + (u0 * nv + v0) * nh, base + (u1 * nv + v0) * nh
        if nh == 1:
            at = (1.0 - fu) * value[near] + fu * value[far]
            beyond = (1.0 - fu) * value[near + 1] + fu * value[far + 1]
            out[n] = (1.0 - fv) * at + fv * beyond
            continue
        h = min(max(h, 0.0), nh - 1.0)
        h0 = min(int(h), nh - 2)
        fh = h - h0
        near, far = near + h0, far + h0
        at = (1.0 - fu) * value[near] + fu * value[far]
        beyond = (1.0 - fu) * value[near + nh] + fu * value[far + nh]
        below = (1.0 - fv) * at + fv * beyond
        at = (1.0 - fu) * value[near + 1] + fu * value[far + 1]
        beyond = (1.0 - fu) * value[near + nh + 1] + fu * value[far + nh + 1]
        out[n] = (1.0 - fh) * below + fh * ((1.0 - fv) * at + fv * beyond)


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
    return max(0.0, 1.0 - rim / max(np.sqrt(x * x + z * z), 1e-9))


@kernel
def weigh(stretches, target, moves, behaviours, weights, now, later):
    """Σ w R and Σ w γ^T V(s', e') of stretches [n], into now [n] and later [n].

    weights [Z]; a behaviour counts only while the target is in its active region.
    """
    count = stretches.shape[0]
    each = np.empty(count)
    places = Places(np.empty(count), np.empty(count), np.empty(count), np.empty(count))
    now[:count], later[:count] = 0.0, 0.0
    x, z = target[0, 0], target[0, 2]
    away = np.sqrt(x * x + z * z)
    placed = -1.0
    for b in range(weights.shape[0]):
        counts = behaviours.active[b, 0] <= away <= behaviours.active[b, 1]
        if weights[b] == 0.0 or not counts:
            continue
        share = off_the_rim(behaviours, b, x, z)
        if share != placed:
            places_after(stretches, target, share * x, share * z, moves, places)
            placed = share
        rewards_now(stretches, b, target, share * x, share * z, moves, behaviours, each)
        for n in range(count):
            now[n] += weights[b] * each[n]
        values_after(stretches, b, places, moves, behaviours, each)
        fade, duration = behaviours.fade, moves.duration
        for n in range(count):
            later[n] += weights[b] * fade[b, duration[stretches[n]]] * each[n]


@kernel
def cut_by_turning_away(stretches, target, facing, moves, worth):
    """Cut worth [n] of stretches [n] down by exp(-facing) for each unit by which the target is out
    of a cone ahead (in cosine, mean over the action)."""
    start, root = moves.start, moves.root
    horizon = target.shape[0] - 1
    for n in range(stretches.shape[0]):
        first, last = start[stretches[n]], start[stretches[n] + 1]
        total = 0.0
        for t in range(last - first):
            h = min(t, horizon)
            x, z = target[h, 0] - root[first + t, 0], target[h, 2] - root[first + t, 1]
            ahead = x * root[first + t, 2] + z * root[first + t, 3]
            d2 = x * x + z * z
            if ahead <= 0.0 or ahead * ahead < FACING_CONE * FACING_CONE * d2:
                total += FACING_CONE - ahead / (np.sqrt(d2) + 1e-9)
        if total > 0.0:
            worth[n] *= np.exp(-facing * total / (last - first))


@kernel
def narrow(stretches, other, clear, moves, gap):
    """Bring gap [n] of stretches [n] down to the distance they keep to a body at other [H, 2].

    A body whose places lie in a disc that is ``clear`` [m] from the disc of a stretch's own counts
    with the distance of the two, which is less.
    """
    low_x = high_x = other[0, 0]
    low_z = high_z = other[0, 1]
    for h in range(1, other.shape[0]):
        low_x, high_x = min(low_x, other[h, 0]), max(high_x, other[h, 0])
        low_z, high_z = min(low_z, other[h, 1]), max(high_z, other[h, 1])
    x, z, w, d = 0.5 * (low_x + high_x), 0.5 * (low_z + high_z), high_x - low_x, high_z - low_z
    radius = 0.5 * np.sqrt(w * w + d * d)
    start, root, around = moves.start, moves.root, moves.around
    horizon = other.shape[0] - 1
    for n in range(stretches.shape[0]):
        k = stretches[n]
        dx, dz = around[k, 0] - x, around[k, 1] - z
        between = np.sqrt(dx * dx + dz * dz) - around[k, 2] - radius
        if between >= clear:
            gap[n] = min(gap[n], between)
            continue
        first = start[k]
        near2 = np.inf
        for t in range(start[k + 1] - first):
            h = min(t, horizon)
            dx, dz = root[first + t, 0] - other[h, 0], root[first + t, 1] - other[h, 1]
            near2 = min(near2, dx * dx + dz * dz)
        gap[n] = min(gap[n], np.sqrt(near2))


@kernel
def look_ahead(state, target, others, clear, moves, behaviours, weights, facing, worth, gap):
    """Q of every action of a state, exact in the continuous target, and the room it leaves.

    target [H, 4]: expected at frames 1.. after the decision; the last row holds from then on.
    others [O, H, 2]: the same for bodies that must not be run into. weights [Z] of the behaviours.
    Fills worth [n] with the weighted values, cut by turning away, and gap [n] with the smallest
    distance kept to the other bodies: exact below ``clear`` [m], above it any number from there to
    the truth.
    """
    stretches = moves.stretch[moves.action_start[state] : moves.action_start[state + 1]]
    count = stretches.shape[0]
    later = np.empty(count)
    weigh(stretches, target, moves, behaviours, weights, worth, later)
    for n in range(count):
        worth[n] += later[n]
        gap[n] = np.inf
    if facing != 0.0:
        cut_by_turning_away(stretches, target, facing, moves, worth)
    for o in range(others.shape[0]):
        narrow(stretches, others[o], clear, moves, gap)


@kernel
def look_further(action, target, moves, behaviours, weights, facing):
    """Q of an action by two exact backups: what it earns, and the best Q of the state after it."""
    one = moves.stretch[action : action + 1]
    k = one[0]
    now, left = np.empty(1), np.empty(1)
    weigh(one, target, moves, behaviours, weights, now, left)
    x, z = target[0, 0], target[0, 2]
    away = np.sqrt(x * x + z * z)
    duration, state = moves.duration[k], moves.successor[k]
    after = np.zeros(weights.shape[0])
    for b in range(after.shape[0]):
        if behaviours.active[b, 0] <= away <= behaviours.active[b, 1]:
            after[b] = weights[b] * behaviours.fade[b, duration]
    passed = min(duration, target.shape[0] - 1)
    then = np.empty((target.shape[0] - passed, 4))
    here = moves.displacement[k]
    for h in range(then.shape[0]):
        then[h, 0], then[h, 2] = carry(here, target[passed + h, 0], target[passed + h, 2])
        then[h, 1], then[h, 3] = target[passed + h, 1], wrapped(target[passed + h, 3] - here[2])
    stretches = moves.stretch[moves.action_start[state] : moves.action_start[state + 1]]
    reward, later = np.empty(stretches.shape[0]), np.empty(stretches.shape[0])
    weigh(stretches, then, moves, behaviours, after, reward, later)
    best = -np.inf
    for n in range(stretches.shape[0]):
        best = max(best, reward[n] + later[n])
    now[0] += best
    if facing != 0.0:
        cut_by_turning_away(one, target, facing, moves, now)
    return now[0]
