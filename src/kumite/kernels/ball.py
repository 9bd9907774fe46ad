"""Do moving spheres meet bodies? The first body that each meets between two frames."""

from __future__ import annotations

import numpy as np

from kumite.kernels.blow import NO_HIT, swept_contact
from kumite.kernels.jit import kernel

REACH = 1.6  # m from a root within which a body is looked at


@kernel
def first_met(p0, p1, radius, a0, a1, b0, b1, radius_a, radius_b, root, spared, who, part, when):
    """Spheres that go from p0 to p1 [S, 3] among bodies of capsules a to b [K, P, 3], before (0)
    and now (1): whom each meets first, with what part and when (0..1), or NO_HIT.

    root [K, 3]; spared [S]: whom a sphere does not meet, or -1.
    """
    for s in range(p0.shape[0]):
        who[s], part[s], when[s] = NO_HIT, NO_HIT, 2.0
        dx, dy, dz = p1[s, 0] - p0[s, 0], p1[s, 1] - p0[s, 1], p1[s, 2] - p0[s, 2]
        step = np.sqrt(dx * dx + dy * dy + dz * dz)
        for k in range(root.shape[0]):
            if k == spared[s]:
                continue
            off = (p1[s, 0] - root[k, 0]) ** 2 + (p1[s, 2] - root[k, 2]) ** 2
            if off > (REACH + step + radius[s]) ** 2:
                continue
            for p in range(a0.shape[1]):
                t = swept_contact(
                    p0[s], p1[s], a0[k, p], a1[k, p], b0[k, p], b1[k, p],
                    radius_a[p], radius_b[p], radius[s],
                )  # fmt: skip
                if 0.0 <= t < when[s]:
                    who[s], part[s], when[s] = k, p, t
