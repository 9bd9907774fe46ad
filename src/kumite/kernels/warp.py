"""Time warps of paths: how slowly each library frame of a path is played, and when it is shown.

The slowness of a path, scene frames per library frame, is sigma = base + (s - 1) share: base is 1,
but for what is left of the slowness before the path; share is 1 on edges whose speed may be
adjusted and 0 on others, with linear ramps between. Both are given at the integers of the path and
linear between them, so that the time to any place is exact, and linear in s (Oshita & Masaoka 2011,
Eq. 2 and 3, with their discontinuities taken out).

A path of E edges has N + 1 places 0..N, library frames from where its first edge begins. Times are
in scene frames. Nothing here makes arrays.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kumite.kernels.jit import kernel


class Profile(NamedTuple):
    """A path's slowness in two parts and their integrals from 0, at its places: [N + 1] or more."""

    base: np.ndarray
    base_time: np.ndarray
    share: np.ndarray
    share_time: np.ndarray


@kernel
def ramp_at(edge, frames, length):
    """Length of the ramp at the border before an edge: at most half of an edge is a ramp at one
    end. At a path's two ends it lies within the edge, elsewhere half in each."""
    if edge == 0:
        return min(length, 0.5 * frames[0])
    if edge == frames.shape[0]:
        return min(length, 0.5 * frames[edge - 1])
    return min(length, frames[edge - 1], frames[edge])


@kernel
def fill(frames, adjustable, length, slowness, profile):
    """A path's profile; returns N.

    frames [E]: how long its edges are; adjustable [E] bool; length: of a ramp [library frames];
    slowness: at which what goes before is played.
    """
    base, base_time, share, share_time = profile
    edges, at = frames.shape[0], 0
    fade = ramp_at(0, frames, length)
    for e in range(edges):
        here = 1.0 if adjustable[e] else 0.0
        before = 1.0 if e > 0 and adjustable[e - 1] else 0.0
        after = 1.0 if e < edges - 1 and adjustable[e + 1] else 0.0
        enter, leave = ramp_at(e, frames, length), ramp_at(e + 1, frames, length)
        for i in range(frames[e] + (e == edges - 1)):
            left = frames[e] - i
            if e == 0:
                value = before + (here - before) * min(i / enter, 1.0)
            else:
                value = before + (here - before) * min(0.5 + i / enter, 1.0)
            if e == edges - 1:
                value += (after - here) * max(1.0 - left / leave, 0.0)
            else:
                value += (after - here) * max(0.5 - left / leave, 0.0)
            n = at + i
            share[n] = value
            base[n] = 1.0 + (slowness - 1.0) * max(1.0 - n / fade, 0.0)
        at += frames[e]
    share_time[0] = base_time[0] = 0.0
    for n in range(at):
        share_time[n + 1] = share_time[n] + 0.5 * (share[n] + share[n + 1])
        base_time[n + 1] = base_time[n] + 0.5 * (base[n] + base[n + 1])
    return at


@kernel
def within(value, integral, place, count):
    """An integral up to a place, which may lie a little before or after the path."""
    n = min(max(int(np.floor(place)), 0), count - 1)
    a = place - n
    if place < 0.0:
        return a * value[0]
    if place > count:
        return integral[count] + (place - count) * value[count]
    return integral[n] + a * (value[n] + 0.5 * a * (value[n + 1] - value[n]))


@kernel
def time_at(place, s, count, profile):
    """When a place of the path is shown, from when its place 0 is."""
    own = within(profile.base, profile.base_time, place, count)
    return own + (s - 1.0) * within(profile.share, profile.share_time, place, count)


@kernel
def solve(now, place, wait, count, profile):
    """The s at which it is ``wait`` from place ``now`` to ``place``; NaN where nothing adjusts."""
    own = within(profile.base, profile.base_time, place, count)
    own -= within(profile.base, profile.base_time, now, count)
    adjusted = within(profile.share, profile.share_time, place, count)
    adjusted -= within(profile.share, profile.share_time, now, count)
    if adjusted <= 1e-9:
        return np.nan
    return 1.0 + (wait - own) / adjusted


@kernel
def place_at(time, s, count, profile):
    """The place that is shown at a time: the inverse of :func:`time_at`."""
    if time <= 0.0:
        return time / (profile.base[0] + (s - 1.0) * profile.share[0])
    low, high = 0, count  # shown no later than the time, and after it
    last = time_at(float(count), s, count, profile)
    if time >= last:
        return count + (time - last) / (profile.base[count] + (s - 1.0) * profile.share[count])
    while high - low > 1:
        middle = (low + high) // 2
        if profile.base_time[middle] + (s - 1.0) * profile.share_time[middle] <= time:
            low = middle
        else:
            high = middle
    left = time - profile.base_time[low] - (s - 1.0) * profile.share_time[low]
    here = profile.base[low] + (s - 1.0) * profile.share[low]
    slope = profile.base[high] + (s - 1.0) * profile.share[high] - here
    # here a + slope a² / 2 = left, the root that is right for any sign of the slope
    return low + 2.0 * left / (here + np.sqrt(max(here * here + 2.0 * slope * left, 0.0)))


@kernel
def places(begin, step, s, count, profile, out):
    """The places shown at times begin, begin + step, … into ``out`` [T]."""
    for i in range(out.shape[0]):
        out[i] = place_at(begin + i * step, s, count, profile)
