"""Pose distances in blocks: all pairs of P poses, never P × P in memory.

D(a, b) = Σ_j w_j θ_j² + Σ_d (x_a,d − x_b,d)², θ_j the angle between the joints' rotations
(Lee & Lee 2004 section 6, after Lee et al. 2002), x the Euclidean features (velocities, height),
already scaled. Arrays are laid out with poses last, so that inner loops are contiguous.
"""

from __future__ import annotations

import numpy as np
from numba import prange
from numpy.polynomial import Chebyshev, Polynomial

from kumite.kernels.jit import kernel, parallel_kernel

# (2 acos(1 - y))² is smooth in y on [0, 1], so a polynomial gives it to 4e-7, float32 rounding,
# without the root and the branch of acos that would keep the loop out of vector registers.
_FIT = Chebyshev.interpolate(
    lambda y: np.where(
        y < 1e-4, 8.0 + y * (4.0 / 3.0), (2.0 * np.arccos(1.0 - y)) ** 2 / np.maximum(y, 1e-4)
    ),
    6,
    domain=[0.0, 1.0],
).convert(kind=Polynomial)
C0, C1, C2, C3, C4, C5, C6 = (np.float32(c) for c in _FIT.coef)
ZERO = np.float32(0.0)
ONE = np.float32(1.0)
BLOCK = 512  # columns a pass: accumulators and columns stay in the first-level cache
ROWS = 32  # rows a parallel task, a multiple of LANES
LANES = 4  # rows computed together, so that a column is loaded once for all of them


@kernel
def angle_squared(dot):
    """θ² of two unit quaternions' dot product."""
    y = ONE - min(abs(dot), ONE)
    p = C6 * y + C5
    p = p * y + C4
    p = p * y + C3
    p = p * y + C2
    p = p * y + C1
    p = p * y + C0
    return p * y


@kernel
def distance_block(quaternion, weight, feature, a0, a1, a2, a3, first, last, out):
    """D(a, b) for four poses a and b in first..last into ``out[0..3, first..last]``.

    quaternion [J, 4, P], weight [J], feature [D, P] (D even), out [4, P], all float32.
    """
    n = last - first
    o0, o1, o2, o3 = out[0, first:last], out[1, first:last], out[2, first:last], out[3, first:last]
    for b in range(n):
        o0[b] = o1[b] = o2[b] = o3[b] = ZERO
    for j in range(quaternion.shape[0]):
        w = weight[j]
        qw, qx = quaternion[j, 0], quaternion[j, 1]
        qy, qz = quaternion[j, 2], quaternion[j, 3]
        w0, x0, y0, z0 = qw[a0], qx[a0], qy[a0], qz[a0]
        w1, x1, y1, z1 = qw[a1], qx[a1], qy[a1], qz[a1]
        w2, x2, y2, z2 = qw[a2], qx[a2], qy[a2], qz[a2]
        w3, x3, y3, z3 = qw[a3], qx[a3], qy[a3], qz[a3]
        bw, bx, by, bz = qw[first:last], qx[first:last], qy[first:last], qz[first:last]
        for b in range(n):
            cw, cx, cy, cz = bw[b], bx[b], by[b], bz[b]
            o0[b] += w * angle_squared(w0 * cw + x0 * cx + y0 * cy + z0 * cz)
            o1[b] += w * angle_squared(w1 * cw + x1 * cx + y1 * cy + z1 * cz)
            o2[b] += w * angle_squared(w2 * cw + x2 * cx + y2 * cy + z2 * cz)
            o3[b] += w * angle_squared(w3 * cw + x3 * cx + y3 * cy + z3 * cz)
    for d in range(0, feature.shape[0], 2):
        f, g = feature[d], feature[d + 1]
        f0, f1, f2, f3 = f[a0], f[a1], f[a2], f[a3]
        g0, g1, g2, g3 = g[a0], g[a1], g[a2], g[a3]
        fb, gb = f[first:last], g[first:last]
        for b in range(n):
            x, y = fb[b], gb[b]
            o0[b] += (x - f0) * (x - f0) + (y - g0) * (y - g0)
            o1[b] += (x - f1) * (x - f1) + (y - g1) * (y - g1)
            o2[b] += (x - f2) * (x - f2) + (y - g2) * (y - g2)
            o3[b] += (x - f3) * (x - f3) + (y - g3) * (y - g3)


@kernel
def distance_rows(quaternion, weight, feature, begin, end, out):
    """D(a, b) for a in begin..end and all b into ``out[a - begin]``; out has LANES spare rows."""
    total = quaternion.shape[2]
    for a in range(begin, end, LANES):
        top = total - 1
        for first in range(0, total, BLOCK):
            distance_block(
                quaternion,
                weight,
                feature,
                a,
                min(a + 1, top),
                min(a + 2, top),
                min(a + 3, top),
                first,
                min(first + BLOCK, total),
                out[a - begin : a - begin + LANES],
            )


@parallel_kernel
def local_minima(
    quaternion, weight, feature, joined, group, limit, found_a, found_b, found_d, counts
):
    """Pairs (a, b) of one group whose D is below ``limit`` and a local minimum of its 3 × 3 block.

    joined [P]: pose k follows pose k - 1 in a clip; other neighbours do not compete. group [P]:
    pairs of different groups are no candidates and do not compete. Task t, of ``ROWS`` rows, writes
    found_*[t, :]; counts[t] is what it found, which may be more than fits: then call again with
    more room. Ties are won by the earlier pair. The diagonal is never found.
    """
    total = quaternion.shape[2]
    room = found_a.shape[1]
    for task in prange(counts.shape[0]):
        begin, end = task * ROWS, min(total, (task + 1) * ROWS)
        low, high = max(begin - 1, 0), min(end + 1, total)
        line = np.empty((ROWS + 2 + LANES, total), dtype=np.float32)
        distance_rows(quaternion, weight, feature, low, high, line)
        n = 0
        for a in range(begin, end):
            for b in range(total):
                d = line[a - low, b]
                if not (d < limit) or group[a] != group[b] or a == b:
                    continue
                lowest = True
                for r in range(max(a - 1, 0), min(a + 2, total)):
                    if (r < a and not joined[a]) or (r > a and not joined[r]):
                        continue
                    for c in range(max(b - 1, 0), min(b + 2, total)):
                        if (c < b and not joined[b]) or (c > b and not joined[c]):
                            continue
                        if group[r] != group[a] or group[c] != group[b] or (r == a and c == b):
                            continue
                        other = line[r - low, c]
                        earlier = r < a or (r == a and c < b)
                        if other < d or (earlier and other == d):
                            lowest = False
                if lowest:
                    if n < room:
                        found_a[task, n] = a
                        found_b[task, n] = b
                        found_d[task, n] = d
                    n += 1
        counts[task] = n


@parallel_kernel
def row_sums(quaternion, weight, feature, out):
    """Σ_b D(a, b) for every pose a into ``out`` [P] float64: the distance stage, to time it."""
    total = quaternion.shape[2]
    for task in prange((total + ROWS - 1) // ROWS):
        begin, end = task * ROWS, min(total, (task + 1) * ROWS)
        line = np.empty((LANES, total), dtype=np.float32)
        for a in range(begin, end, LANES):
            distance_rows(quaternion, weight, feature, a, min(a + LANES, end), line)
            for k in range(min(LANES, end - a)):
                s = 0.0
                for b in range(total):
                    s += line[k, b]
                out[a + k] = s
