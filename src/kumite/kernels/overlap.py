"""How deep the parts of one body are inside each other.

Shapes: F frames, B body parts (tapered capsules), P pairs of parts.
"""

from __future__ import annotations

import numpy as np
from numba import prange

from kumite.kernels.blow import capsule_gap
from kumite.kernels.jit import kernel, parallel_kernel

SAMPLES = 7  # spheres along a part's axis that stand for the part


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
