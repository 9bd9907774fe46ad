"""How well a path through the motion graph avoids an attack (Oshita & Masaoka 2011, section 4).

The body's volume is a set of spheres at every library frame, an attack's a set of spheres at times
of its own. Both move in straight lines between, so the smallest distance of a step is that of two
points on two lines, and nothing passes through at any speed.

Phases are library frames with a fraction, times are seconds from now. Shapes: F frames, B spheres
of the body, L stretches, A parts to avoid with, M attacks, T samples of all attacks, I spheres of
an attack, C candidates, D edges of a path at most.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kumite.kernels.jit import lean_kernel
from kumite.kernels.joins import Joins
from kumite.kernels.warp import carried, fill, phase_times, solve

DEPTH = 32  # edges of a path at most
MOST_FRAMES = 1024  # library frames of a path at most
EPSILON = 1e-9

# What became of a candidate.
VALID, HIT, CULLED, STIFF, TOO_FAST, TOO_LONG = 0, 1, 2, 3, 4, 5
OUTCOMES = 6


class Volumes(NamedTuple):
    """The body at every library frame, its spheres in groups of neighbours."""

    centre: np.ndarray  # [F, 3, B] float32 m, library world
    radius: np.ndarray  # [B] float32 m
    group: np.ndarray  # [G + 1] spheres of group g are group[g]:group[g + 1]
    bound: np.ndarray  # [F, 4, G] float32, x, y, z and radius of a sphere around each group
    between: np.ndarray  # [B, 2] places (joins.PLACES) that a sphere hangs between …
    along: np.ndarray  # [B] … and how far from the one to the other
    group_along: np.ndarray  # [G] the same of a group's middle: its spheres share their places
    group_spread: np.ndarray  # [G] how much farther one of them is along


class Graph(NamedTuple):
    """The action table, and what of it avoids."""

    action_start: np.ndarray  # [N + 1]
    stretch: np.ndarray  # [A'] of the actions
    first: np.ndarray  # [L]
    last: np.ndarray  # [L]
    target: np.ndarray  # [L]
    displacement: np.ndarray  # [L, 3]
    facing: np.ndarray  # [F, 3]
    part_of: np.ndarray  # [L + 1] parts of stretch l are part_of[l]:part_of[l + 1]
    begins: np.ndarray  # [A] library frame
    ends: np.ndarray  # [A] library frame, the last in the part
    slows: np.ndarray  # [L] bool, may be slowed down
    quickens: np.ndarray  # [L] bool, may be sped up
    soonest: np.ndarray  # [N] frames at least from a state to the middle of a part
    fps: float
    joins: Joins


class Attacks(NamedTuple):
    """M attacks: spheres at times. Attack m has samples sample[m]:sample[m + 1]."""

    sample: np.ndarray  # [M + 1]
    when: np.ndarray  # [T] s from now, ascending in each attack
    lasts: np.ndarray  # [T] s that a sample stands for
    centre: np.ndarray  # [T, I, 3] m, scene
    radius: np.ndarray  # [M, I] m
    count: np.ndarray  # [M] spheres of each


class Now(NamedTuple):
    """Where a character is: in a stretch (or none) that ends in a state."""

    anchor: np.ndarray  # [3] library → scene
    phase: float
    stop: int  # library frame at which the present edge ends
    stretch: int  # the present edge
    slowness: float  # s of play for 1 s of capture, now
    left: np.ndarray  # [2, 3, 3] of joins: offsets of root and ankles and their velocities, scene


class Weighing(NamedTuple):
    """Section 4's numbers."""

    weight: np.ndarray  # [3] of avoidance, body and time scale
    enough: float  # E_avoidance, m s
    far: float  # D_body, m
    most: float  # E_time
    clearance: float  # m that must stay between attack and body
    left: float  # m that a sphere must have moved to have left its place
    ramp: float  # s in which a change of speed comes
    widest: float  # m, radius of the body's largest sphere


class Masks(NamedTuple):
    """Where the body without its legs is throughout a part, as captured, for attacks no smaller
    than ``least``: one bit a pixel.

    In nine horizontal slices (section 5.2), :mod:`kumite.kernels.cells`.
    """

    bits: np.ndarray  # [A, slices, rows] uint64, 0 parts for no masks
    origin: np.ndarray  # [A, 3] m, library world
    pixel: float  # m
    height: float  # m of a slice
    least: float  # m


class Scratch(NamedTuple):
    """Room for one candidate at a time."""

    anchor: np.ndarray  # [D + 1, 4] x, z, cos and sin of yaw of each edge
    upto: np.ndarray  # [D + 1] phase counted from now at which each edge ends
    adjustable: np.ndarray  # [D + 1] bool
    at: np.ndarray  # [frames] phases counted from now …
    weight: np.ndarray  # [frames] how far they are adjustable
    when: np.ndarray  # [frames] … and when they are shown, s from now
    none: np.ndarray  # [0] the path of no edges
    still: np.ndarray  # [3, B] body at the part's beginning …
    still_bound: np.ndarray  # [4, G] … and around its groups
    body: np.ndarray  # [3, B] body now
    bound: np.ndarray  # [4, G]
    before: np.ndarray  # [3, B] body at the sample before
    before_bound: np.ndarray  # [4, G]
    left: np.ndarray  # [2, 3, 3] offsets and velocities on their way along a path
    offset: np.ndarray  # [frames, 2, 3, 3] offsets as a frame is come to, and as it is left
    moved: np.ndarray  # [2, PLACES, 3] how far places are moved, at a sample and at the one before


@lean_kernel
def frame_of(anchor, row):
    """A planar transform [3] as x, z, cos, sin into row [4]."""
    row[0], row[1] = anchor[0], anchor[1]
    row[2], row[3] = np.cos(anchor[2]), np.sin(anchor[2])


@lean_kernel
def lay(path, count, now, graph, scratch):
    """Anchors and lengths of a path's edges: the present one, then ``count`` others."""
    facing, here = graph.facing, scratch.anchor
    yaw = now.anchor[2]
    frame_of(now.anchor, here[0])
    ahead = now.stop - now.phase
    scratch.upto[0] = ahead
    f = now.stop
    x = here[0, 2] * facing[f, 0] + here[0, 3] * facing[f, 1] + here[0, 0]
    z = -here[0, 3] * facing[f, 0] + here[0, 2] * facing[f, 1] + here[0, 1]
    yaw += facing[f, 2]
    for k in range(count):
        s = path[k]
        e = graph.first[s] - 1
        turn = yaw - facing[e, 2]
        c, n = np.cos(turn), np.sin(turn)
        row = here[k + 1]
        row[0] = x - (c * facing[e, 0] + n * facing[e, 1])
        row[1] = z - (-n * facing[e, 0] + c * facing[e, 1])
        row[2], row[3] = c, n
        ahead += graph.last[s] - e
        scratch.upto[k + 1] = ahead
        f = graph.last[s]
        x = c * facing[f, 0] + n * facing[f, 1] + row[0]
        z = -n * facing[f, 0] + c * facing[f, 1] + row[1]
        yaw = turn + facing[f, 2]


@lean_kernel
def middle(path, count, part, now, graph):
    """Frames from now to the middle of the path's avoidance part, which is in its last edge."""
    a = 0.5 * (graph.begins[part] + graph.ends[part])
    if count == 0:
        return a - now.phase
    x = now.stop - now.phase
    for k in range(count - 1):
        s = path[k]
        x += graph.last[s] - graph.first[s] + 1
    return x + a - (graph.first[path[count - 1]] - 1)


@lean_kernel
def time_scale(path, count, part, aim, now, graph, weighing, scratch):
    """The time scale s of a path so that its avoidance falls on ``aim`` [s] (Eqs. 2 and 3).

    Returns (s, outcome): s = 1 where nothing need be adjusted. Notes which edges are adjustable.
    What the slowness of now costs on its way to 1 counts as time that cannot be adjusted.
    """
    whole = middle(path, count, part, now, graph)
    natural = whole + carried(whole, weighing.ramp * graph.fps, now.slowness)
    want = aim * graph.fps
    adjustable = scratch.adjustable
    for k in range(count + 1):
        adjustable[k] = False
    if abs(natural - want) < 0.5:  # half a frame
        return 1.0, VALID
    slower = want > natural
    some, x = 0.0, 0.0
    for k in range(count + 1):
        s = now.stretch if k == 0 else path[k - 1]
        length = now.stop - now.phase if k == 0 else graph.last[s] - graph.first[s] + 1.0
        if k == count:
            length = whole - x
        x += length
        if s >= 0 and (graph.slows[s] if slower else graph.quickens[s]):
            adjustable[k] = True
            some += length
    if some < 0.5:
        return 1.0, STIFF
    return (want - (natural - some)) / some, VALID


@lean_kernel
def put_bounds(volumes, row, share, following, frame, out):
    """Spheres [4, G] around the groups in the scene, between library frames row and following."""
    bound = volumes.bound
    a, b, c, n = frame[0], frame[1], frame[2], frame[3]
    for g in range(out.shape[1]):
        x = bound[row, 0, g] + share * (bound[following, 0, g] - bound[row, 0, g])
        z = bound[row, 2, g] + share * (bound[following, 2, g] - bound[row, 2, g])
        out[0, g] = c * x + n * z + a
        out[1, g] = bound[row, 1, g] + share * (bound[following, 1, g] - bound[row, 1, g])
        out[2, g] = c * z - n * x + b
        # A sphere's way from the middle of its group is longest at one of both ends.
        out[3, g] = max(bound[row, 3, g], bound[following, 3, g])


@lean_kernel
def put_body(volumes, low, high, row, share, following, frame, out):
    """Spheres low..high of [3, B] in the scene, between library frames row and following."""
    centre = volumes.centre
    a, b, c, n = frame[0], frame[1], frame[2], frame[3]
    for j in range(low, high):
        x = centre[row, 0, j] + share * (centre[following, 0, j] - centre[row, 0, j])
        z = centre[row, 2, j] + share * (centre[following, 2, j] - centre[row, 2, j])
        out[0, j] = c * x + n * z + a
        out[1, j] = centre[row, 1, j] + share * (centre[following, 1, j] - centre[row, 1, j])
        out[2, j] = c * z - n * x + b


@lean_kernel
def phase_at(x, k, path, now, graph, scratch):
    """Layer phase of a path's edge k, x frames from now, and the last frame of the edge."""
    if k == 0:
        return now.phase + x, now.stop
    s = path[k - 1]
    return graph.first[s] - 1 + (x - scratch.upto[k - 1]), graph.last[s]


@lean_kernel
def gap(px, py, pz, r, body, radius, low, high):
    """Smallest distance between a sphere and spheres low..high of a body [3, B]."""
    least = np.inf
    for j in range(low, high):
        dx, dy, dz = px - body[0, j], py - body[1, j], pz - body[2, j]
        least = min(least, np.sqrt(dx * dx + dy * dy + dz * dz) - radius[j])
    return least - r


@lean_kernel
def swept_gap(qx, qy, qz, before, px, py, pz, body, r, radius, low, high):
    """:func:`gap`, its smallest while a sphere goes from q to p and the body from ``before``."""
    least = np.inf
    for j in range(low, high):
        sx, sy, sz = qx - before[0, j], qy - before[1, j], qz - before[2, j]
        ux, uy, uz = px - body[0, j] - sx, py - body[1, j] - sy, pz - body[2, j] - sz
        along = -(sx * ux + sy * uy + sz * uz) / (ux * ux + uy * uy + uz * uz + 1e-18)
        along = min(max(along, 0.0), 1.0)
        dx, dy, dz = sx + along * ux, sy + along * uy, sz + along * uz
        least = min(least, np.sqrt(dx * dx + dy * dy + dz * dz) - radius[j])
    return least - r


@lean_kernel
def overlap(px, py, pz, r, still, body, radius, left, low, high):
    """Depth [m] by which a sphere is in the places that a body has left (Eqs. 4 and 5).

    Of each of the body's spheres: how much farther it is now than it would have been, where it
    would have been met, is met no more, and has moved by ``left`` at least.
    """
    depth = 0.0
    for j in range(low, high):
        dx, dy, dz = px - still[0, j], py - still[1, j], pz - still[2, j]
        was = np.sqrt(dx * dx + dy * dy + dz * dz) - radius[j] - r
        if was >= 0.0:
            continue
        dx, dy, dz = px - body[0, j], py - body[1, j], pz - body[2, j]
        is_now = np.sqrt(dx * dx + dy * dy + dz * dz) - radius[j] - r
        dx, dy, dz = still[0, j] - body[0, j], still[1, j] - body[1, j], still[2, j] - body[2, j]
        if is_now >= 0.0 and dx * dx + dy * dy + dz * dz >= left * left:
            depth += is_now - was
    return depth


@lean_kernel
def time_path(path, count, part, aim, scale, now, graph, weighing, scratch):
    """When each frame of a path is shown, with its speed adjusted smoothly. Returns (frames, s).

    s [-] is what adjustable edges are slowed by at most: that of Eq. 3, but farther from 1 because
    it comes and goes in ramps. Where it is beyond what is allowed it is told, and not played.
    """
    ramp = weighing.ramp * graph.fps
    frames = fill(count + 1, scratch.upto, scratch.adjustable, ramp, scratch.at, scratch.weight)
    if frames < 0:
        return 0, scale
    if scale != 1.0:
        whole = middle(path, count, part, now, graph)
        want = aim * graph.fps
        scale = solve(scratch.at, scratch.weight, frames, whole, want, ramp, now.slowness)
    played = min(max(scale, 1.0 / weighing.most), weighing.most)
    phase_times(
        scratch.at, scratch.weight, frames, played, ramp, now.slowness, graph.fps, scratch.when
    )
    return frames, scale


@lean_kernel
def moment(t, step, frames, when):
    """The first frame of a path, from ``step`` on, shown at or after a time t; or the last."""
    while step < frames - 1 and when[step] < t:
        step += 1
    return step


@lean_kernel
def between(t, step, when):
    """How far on the way from the frame before to this one a path is at a time t, 0 to 1."""
    return (t - when[step - 1]) / (when[step] - when[step - 1])


@lean_kernel
def timed(path, count, part, aim, now, graph, weighing, scratch):
    """Lay a path out, and time it so that its part falls on ``aim`` [s] (Eqs. 2 and 3).

    Returns (outcome, frames, s of Eq. 3, s with ramps): VALID, or why it cannot be timed.
    """
    scale, outcome = time_scale(path, count, part, aim, now, graph, weighing, scratch)
    most = weighing.most
    if outcome != VALID:
        return outcome, 0, scale, scale
    if not (1.0 / most <= scale <= most):
        return TOO_FAST, 0, scale, scale
    lay(path, count, now, graph, scratch)
    frames, smooth = time_path(path, count, part, aim, scale, now, graph, weighing, scratch)
    if frames == 0:
        return TOO_LONG, 0, scale, smooth
    if not (1.0 / most <= smooth <= most):
        return TOO_FAST, 0, scale, smooth
    return VALID, frames, scale, smooth
