"""How deep the parts of one body are inside each other, or those of two bodies.

Shapes: F frames, B body parts (tapered capsules), P pairs of parts.
"""

from __future__ import annotations

import numpy as np
from numba import prange

from kumite.kernels.blow import capsule_gap
from kumite.kernels.jit import kernel, parallel_kernel

SAMPLES = 7  # spheres along a part's axis that stand for the part
SHRINKS = 24  # of the golden section: a part's length to 1e-5 of it
GOLDEN = 0.6180339887498949
MOST_PUSHES = 60  # each by the depth that is left: what remains after them is below a millimetre


@kernel
def depth(a0, a1, ra0, ra1, b0, b1, rb0, rb1, p):
    """How deep one tapered capsule is in another (0: apart); p is scratch [3]."""
    deepest = 0.0
    for k in range(SAMPLES):
        t = k / (SAMPLES - 1)
        for c in range(3):
            p[c] = a0[c] + t * (a1[c] - a0[c])
        radius = ra0 + t * (ra1 - ra0)
        deepest = max(deepest, radius - capsule_gap(p, b0, b1, rb0, rb1))
    return deepest


@parallel_kernel
def overlaps(start, end, radius_start, radius_end, first, second, out):
    """Depths [F, P] of the pairs (first [P], second [P]) of parts with ends [F, B, 3]."""
    for f in prange(len(start)):
        p = np.empty(3)
        for k in range(len(first)):
            i, j = first[k], second[k]
            a0, a1, ra0, ra1 = start[f, i], end[f, i], radius_start[i], radius_end[i]
            b0, b1, rb0, rb1 = start[f, j], end[f, j], radius_start[j], radius_end[j]
            one = depth(a0, a1, ra0, ra1, b0, b1, rb0, rb1, p)
            out[f, k] = max(one, depth(b0, b1, rb0, rb1, a0, a1, ra0, ra1, p))


@kernel
def deepest_overlaps(start, end, radius, first, second, out):
    """The most [P] of :func:`overlaps` over few frames, of capsules of one radius [B] each."""
    p = np.empty(3)
    for k in range(len(first)):
        i, j = first[k], second[k]
        a, b = radius[i], radius[j]
        out[k] = 0.0
        for f in range(len(start)):
            a0, a1, b0, b1 = start[f, i], end[f, i], start[f, j], end[f, j]
            one = depth(a0, a1, a, a, b0, b1, b, b, p)
            out[k] = max(out[k], max(one, depth(b0, b1, b, b, a0, a1, a, a, p)))


@kernel
def sphere_depth(t, a0, a1, ra0, ra1, b0, b1, rb0, rb1, p):
    """How deep the sphere at t (0..1) along one part is in another; p is scratch [3]."""
    for c in range(3):
        p[c] = a0[c] + t * (a1[c] - a0[c])
    return ra0 + t * (ra1 - ra0) - capsule_gap(p, b0, b1, rb0, rb1)


@kernel
def deepest_sphere(a0, a1, ra0, ra1, b0, b1, rb0, rb1, p):
    """The deepest of all spheres along a part (negative: apart), by golden section.

    The distance from a segment is convex along another, so there is one deepest place.
    """
    low, high = 0.0, 1.0
    left, right = 1.0 - GOLDEN, GOLDEN
    at_left = sphere_depth(left, a0, a1, ra0, ra1, b0, b1, rb0, rb1, p)
    at_right = sphere_depth(right, a0, a1, ra0, ra1, b0, b1, rb0, rb1, p)
    for _ in range(SHRINKS):
        if at_left > at_right:
            high, right, at_right = right, left, at_left
            left = high - GOLDEN * (high - low)
            at_left = sphere_depth(left, a0, a1, ra0, ra1, b0, b1, rb0, rb1, p)
        else:
            low, left, at_left = left, right, at_right
            right = low + GOLDEN * (high - low)
            at_right = sphere_depth(right, a0, a1, ra0, ra1, b0, b1, rb0, rb1, p)
    ends = max(
        sphere_depth(0.0, a0, a1, ra0, ra1, b0, b1, rb0, rb1, p),
        sphere_depth(1.0, a0, a1, ra0, ra1, b0, b1, rb0, rb1, p),
    )
    return max(max(at_left, at_right), ends)


@kernel
def deepest_pair(a_start, a_end, a0, a1, b_start, b_end, b0, b1, x, z, pair, p, start, end):
    """Depth of the deepest pair of parts of two bodies, the first moved by (x, z), and which.

    a_start, a_end [A, 3], radii a0, a1 [A], b's likewise [B]; pair [2] is filled, -1 where all are
    apart; p, start, end are scratch [3]. 0 where all are apart.
    """
    deepest = 0.0
    pair[0] = pair[1] = -1
    for i in range(len(a_start)):
        for c in range(3):
            shift = x if c == 0 else (z if c == 2 else 0.0)
            start[c] = a_start[i, c] + shift
            end[c] = a_end[i, c] + shift
        reach_a = max(a0[i], a1[i])
        half_a = 0.0
        for c in range(3):
            half_a += 0.25 * (end[c] - start[c]) ** 2
        for j in range(len(b_start)):
            between = half_b = 0.0
            for c in range(3):
                between += (0.5 * (start[c] + end[c] - b_start[j, c] - b_end[j, c])) ** 2
                half_b += 0.25 * (b_end[j, c] - b_start[j, c]) ** 2
            reach = np.sqrt(half_a) + np.sqrt(half_b) + reach_a + max(b0[j], b1[j])
            if reach <= deepest or between > (reach - deepest) ** 2:
                continue  # even their bounding spheres are not that deep in each other
            one = deepest_sphere(start, end, a0[i], a1[i], b_start[j], b_end[j], b0[j], b1[j], p)
            if one > deepest:
                deepest = one
                pair[0], pair[1] = i, j
    return deepest


@kernel
def push_out(a_start, a_end, a0, a1, b_start, b_end, b0, b1, direction, near, limit, pair):
    """How far [m] body a must go along a ground direction [2] until no part is in one of b.

    A step by the depth that is left cannot go past the first place where they are apart, so the
    steps close in on it, to ``near``; limit: of the way, where a longer one is of no use.
    """
    p, start, end = np.empty(3), np.empty(3), np.empty(3)
    way = 0.0
    for _ in range(MOST_PUSHES):
        left = deepest_pair(
            a_start,
            a_end,
            a0,
            a1,
            b_start,
            b_end,
            b0,
            b1,
            way * direction[0],
            way * direction[1],
            pair,
            p,
            start,
            end,
        )
        if left <= near or way >= limit:
            return way
        way += left
    return way
