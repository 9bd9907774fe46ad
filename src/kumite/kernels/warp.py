"""Smooth time warps along a path of edges (Oshita & Masaoka 2011, section 4.1).

The *slowness* of a path is how long a frame of capture is shown: σ(x) = 1 + (s - 1) w(x) + (σ₀ - 1)
r(x), at x frames from now. w is 0 in edges that may not be adjusted and goes up and down by ramps
inside the others, r falls from 1 to 0 in one ramp, so that a slowness σ₀ of now goes over without a
jump. w + r is at most 1, so σ is between the least and the largest of 1, s and σ₀: time never
stands still. It is the integral of σ: linear in s, so s follows from a time to be kept.
"""

from __future__ import annotations

from kumite.kernels.jit import lean_kernel


@lean_kernel
def passing(x, ramp):
    """r(x): how much of the slowness of now is left."""
    return max(0.0, 1.0 - x / ramp) if ramp > 0.0 else 0.0


@lean_kernel
def carried(x, ramp, slowness):
    """Frames by which x frames take longer because of the slowness of now."""
    over = min(x, ramp)
    return (slowness - 1.0) * (over - 0.5 * over * over / ramp) if over > 0.0 else 0.0


@lean_kernel
def fill(edges, upto, adjustable, ramp, at, weight):
    """Frames of a path from now on, at [n] and weight w [n] at each. Returns n, -1 for too many.

    upto, adjustable [edges]: frames from now to the end of each, and whether its speed may change.
    """
    n = 1
    at[0] = 0.0
    begins = 0.0
    for k in range(edges):
        # Borders are frames, so frames of an edge are whole numbers from its end.
        left = upto[k] - begins
        count = int(left + 1.0 - 1e-9)
        if n + count > at.shape[0]:
            return -1
        for i in range(count):
            at[n] = upto[k] - (count - 1 - i)
            n += 1
        begins = upto[k]
    for i in range(n):
        weight[i] = 0.0
    k, first = 0, 0
    while k < edges:
        if not adjustable[k]:
            k += 1
            continue
        low = upto[k - 1] if k > 0 else 0.0
        while k + 1 < edges and adjustable[k + 1]:
            k += 1
        high = upto[k]
        way = min(ramp, 0.5 * (high - low))
        while first < n and at[first] < low:
            first += 1
        i = first
        while i < n and at[i] <= high:
            if way > 0.0:
                slope = max(0.0, min(1.0, min(at[i] - low, high - at[i]) / way))
                weight[i] = min(slope, 1.0 - passing(at[i], ramp))
            i += 1
        k += 1
    return n


@lean_kernel
def solve(at, weight, n, middle, want, ramp, slowness):
    """The s for which the frame at ``middle`` is shown after ``want`` frames; 1 if none can be."""
    some, fixed = 0.0, 0.0
    for i in range(1, n):
        a, b = at[i - 1], min(at[i], middle)
        if b <= a:
            break
        share = (b - a) / (at[i] - a)
        w0, w1 = weight[i - 1], weight[i - 1] + share * (weight[i] - weight[i - 1])
        r0, r1 = passing(a, ramp), passing(at[i], ramp)
        r1 = r0 + share * (r1 - r0)
        some += 0.5 * (w0 + w1) * (b - a)
        fixed += (b - a) + (slowness - 1.0) * 0.5 * (r0 + r1) * (b - a)
    return 1.0 + (want - fixed) / some if some > 1e-9 else 1.0


@lean_kernel
def phase_times(at, weight, n, scale, ramp, slowness, fps, when):
    """When [n] s from now each frame is shown. Between frames σ counts as linear."""
    when[0] = 0.0
    before = 1.0 + (scale - 1.0) * weight[0] + (slowness - 1.0) * passing(at[0], ramp)
    for i in range(1, n):
        here = 1.0 + (scale - 1.0) * weight[i] + (slowness - 1.0) * passing(at[i], ramp)
        when[i] = when[i - 1] + 0.5 * (before + here) * (at[i] - at[i - 1]) / fps
        before = here
