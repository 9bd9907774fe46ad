"""Do fists meet bodies? Swept tests between two frames, so that no fist skips through."""

from __future__ import annotations

import numpy as np

from kumite.kernels.jit import kernel

NO_HIT = -1
NO_BLOW = -1
NOBODY = -1
NO_LIMB = -1
SQUARELY = np.cos(np.radians(30.0))  # how a blow must meet an arm; else it glances off
REFINEMENTS = 8  # halvings of the step in which contact begins


@kernel
def capsule_gap(p, a, b, radius_a, radius_b):
    """Distance from a point to a tapered capsule's skin (negative inside), radius interpolated."""
    ab2 = ap = 0.0
    for c in range(3):
        ab2 += (b[c] - a[c]) ** 2
        ap += (b[c] - a[c]) * (p[c] - a[c])
    t = min(max(ap / ab2, 0.0), 1.0) if ab2 > 1e-12 else 0.0
    d2 = 0.0
    for c in range(3):
        d2 += (p[c] - a[c] - t * (b[c] - a[c])) ** 2
    return np.sqrt(d2) - (radius_a + t * (radius_b - radius_a))


@kernel
def touches(t, p0, p1, a0, a1, b0, b1, radius_a, radius_b, radius, p, a, b):
    """Whether the moving sphere meets the moving capsule at time t (0..1); p, a, b are scratch."""
    for c in range(3):
        p[c] = p0[c] + t * (p1[c] - p0[c])
        a[c] = a0[c] + t * (a1[c] - a0[c])
        b[c] = b0[c] + t * (b1[c] - b0[c])
    return capsule_gap(p, a, b, radius_a, radius_b) <= radius


@kernel
def swept_contact(p0, p1, a0, a1, b0, b1, radius_a, radius_b, radius):
    """First time 0..1 at which a moving sphere touches a moving tapered capsule, or -1.

    Both move in straight lines between two frames; steps are a quarter of the thinnest radius, so
    that nothing can pass through between two of them; the first contact is then closed in on.
    """
    travel = 0.0
    for c in range(3):
        step = max(abs((p1[c] - p0[c]) - (a1[c] - a0[c])), abs((p1[c] - p0[c]) - (b1[c] - b0[c])))
        travel += step * step
    thin = 0.25 * (min(radius_a, radius_b) + radius)
    steps = int(np.ceil(np.sqrt(travel) / thin)) + 1
    p, a, b = np.empty(3), np.empty(3), np.empty(3)
    apart, t = 0.0, 0.0
    for k in range(steps + 1):
        t = k / steps
        if touches(t, p0, p1, a0, a1, b0, b1, radius_a, radius_b, radius, p, a, b):
            if k == 0:
                return 0.0
            for _ in range(REFINEMENTS):
                middle = 0.5 * (apart + t)
                if touches(middle, p0, p1, a0, a1, b0, b1, radius_a, radius_b, radius, p, a, b):
                    t = middle
                else:
                    apart = middle
            return t
        apart = t
    return -1.0


@kernel
def squareness(t, p0, p1, a0, a1, b0, b1):
    """Cosine between a moving sphere's way into a moving capsule and the skin's normal, at t."""
    a, way, out = np.empty(3), np.empty(3), np.empty(3)
    ab2 = ap = 0.0
    for c in range(3):
        a[c] = a0[c] + t * (a1[c] - a0[c])
        out[c] = p0[c] + t * (p1[c] - p0[c]) - a[c]
        ab = b0[c] + t * (b1[c] - b0[c]) - a[c]
        ab2 += ab * ab
        ap += ab * out[c]
    u = min(max(ap / ab2, 0.0), 1.0) if ab2 > 1e-12 else 0.0
    into = way2 = out2 = 0.0
    for c in range(3):
        out[c] -= u * (b0[c] + t * (b1[c] - b0[c]) - a[c])
        way[c] = (p1[c] - p0[c]) - (1.0 - u) * (a1[c] - a0[c]) - u * (b1[c] - b0[c])
        into -= way[c] * out[c]
        way2 += way[c] * way[c]
        out2 += out[c] * out[c]
    return into / np.sqrt(way2 * out2 + 1e-18)
