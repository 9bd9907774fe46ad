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
from kumite.kernels.joins import Joins, displace, follow, shift_body, shift_bounds
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
def far_off(qx, qy, qz, before, px, py, pz, bound, g, seen, r):
    """How near a sphere that goes from q to p can at least come to a group."""
    ux, uy, uz = px - bound[0, g], py - bound[1, g], pz - bound[2, g]
    size = bound[3, g]
    if seen:
        sx, sy, sz = qx - before[0, g], qy - before[1, g], qz - before[2, g]
        ux, uy, uz = ux - sx, uy - sy, uz - sz
        along = -(sx * ux + sy * uy + sz * uz) / (ux * ux + uy * uy + uz * uz + 1e-18)
        along = min(max(along, 0.0), 1.0)
        ux, uy, uz = sx + along * ux, sy + along * uy, sz + along * uz
        size = max(size, before[3, g])
    return np.sqrt(ux * ux + uy * uy + uz * uz) - size - r


@lean_kernel
def certainly_hit(part, frame, px, py, pz, masks):
    """Whether a point is where the body is throughout a part: one bit of its masks."""
    bits, origin, pixel, height = masks.bits, masks.origin, masks.pixel, masks.height
    a, b = px - frame[0], pz - frame[1]
    x = frame[2] * a - frame[3] * b - origin[part, 0]
    z = frame[3] * a + frame[2] * b - origin[part, 2]
    i, k = int(np.floor(x / pixel)), int(np.floor(z / pixel))
    level = int(np.floor((py - origin[part, 1]) / height))
    if i < 0 or i >= 64 or k < 0 or k >= bits.shape[2] or level < 0 or level >= bits.shape[1]:
        return False
    return (bits[part, level, k] >> np.uint64(i)) & np.uint64(1) != np.uint64(0)


@lean_kernel
def glance(path, count, main, aim, frames, now, graph, volumes, attacks, weighing, scratch):
    """Distances of an attack to the body as shown, and to the body as the part begins, at its last
    sample up to ``aim``: the smallest are no larger. (inf, inf) where the path is
    over by then, or the attack does not begin before.
    """
    n = attacks.sample[main]
    while n + 1 < attacks.sample[main + 1] and attacks.when[n + 1] <= aim:
        n += 1
    at, when, t, step = scratch.at, scratch.when, attacks.when[n], 1
    while step < frames - 1 and when[step] < t:
        step += 1
    if t < 0.0 or when[step] < t:
        return np.inf, np.inf
    part_way = (t - when[step - 1]) / (when[step] - when[step - 1])
    x, k = at[step - 1] + part_way * (at[step] - at[step - 1]), 0
    while k < count and x > scratch.upto[k]:
        k += 1
    phase, last = phase_at(x, k, path, now, graph, scratch)
    row = min(max(int(phase), 0), last)
    share, after, everyone = phase - row, min(row + 1, last), volumes.radius.shape[0]
    moved, body = scratch.moved[0], scratch.body
    displace(row, share, after, scratch.anchor[k], step, part_way, graph.joins, scratch, moved)
    put_body(volumes, 0, everyone, row, share, after, scratch.anchor[k], body)
    shift_body(volumes, 0, everyone, moved, body)
    shown, still = np.inf, np.inf
    for i in range(attacks.count[main]):
        x, y, z = attacks.centre[n, i, 0], attacks.centre[n, i, 1], attacks.centre[n, i, 2]
        r = attacks.radius[main, i]
        shown = min(shown, gap(x, y, z, r, body, volumes.radius, 0, everyone))
        still = min(still, gap(x, y, z, r, scratch.still, volumes.radius, 0, everyone))
    return shown, still


@lean_kernel
def weigh(
    path, count, part, main, aim, now, graph, volumes, attacks, weighing, masks, scratch, out
):
    """Evaluate a candidate: Eqs. 2 to 10. Returns what became of it; out [8] is then

    (e, e_avoidance, e_body, e_timescale, e', d, d0, s). main: the attack to be avoided, whose time
    is ``aim`` [s]; of the others it is enough not to be hit. masks: see :func:`certainly_hit`.

    Hit or not and d are of the body as it will be shown, with what joins leave; e' and d0 of the
    capture: what place a part leaves is its own, whichever way it is come to.
    """
    scale, outcome = time_scale(path, count, part, aim, now, graph, weighing, scratch)
    if outcome != VALID:
        return outcome
    most = weighing.most
    if not (1.0 / most <= scale <= most):
        return TOO_FAST
    lay(path, count, now, graph, scratch)
    frames, smooth = time_path(path, count, part, aim, scale, now, graph, weighing, scratch)
    if frames == 0:
        return TOO_LONG
    if not (1.0 / most <= smooth <= most):
        return TOO_FAST
    begins, ends = float(graph.begins[part]), float(graph.ends[part])
    frame, at, when = scratch.anchor[count], scratch.at, scratch.when
    until = 0.0
    for m in range(attacks.sample.shape[0] - 1):
        until = max(until, attacks.when[attacks.sample[m + 1] - 1])
    follow(path, count, frames, until, now, graph, scratch)
    # Where the attack passes while the body is away, a look at its masks is enough for many.
    own = now.phase if count == 0 else graph.first[path[count - 1]] - 1 - scratch.upto[count - 1]
    step, reckoned = 1, graph.joins.reckoned
    for n in range(attacks.sample[main], attacks.sample[main + 1]):
        t = attacks.when[n]
        if t < 0.0 or masks.bits.shape[0] == 0:
            continue
        while step < frames - 1 and when[step] < t:
            step += 1
        if when[step] < t:
            break
        share = (t - when[step - 1]) / (when[step] - when[step - 1])
        phase = own + at[step - 1] + share * (at[step] - at[step - 1])
        if phase < begins or phase > ends:
            continue
        x, y, z = 0.0, 0.0, 0.0  # by how much the root will be shown elsewhere
        if reckoned:
            root, then = scratch.offset[step - 1, 1, 0], scratch.offset[step, 0, 0]
            x = root[0] + share * (then[0] - root[0])
            y = root[1] + share * (then[1] - root[1])
            z = root[2] + share * (then[2] - root[2])
        for i in range(attacks.count[main]):
            if attacks.radius[main, i] >= masks.least and certainly_hit(
                part, frame, attacks.centre[n, i, 0] - x, attacks.centre[n, i, 1] - y,
                attacks.centre[n, i, 2] - z, masks,
            ):  # fmt: skip
                return CULLED
    first = graph.begins[part]
    group, radius = volumes.group, volumes.radius
    put_body(volumes, 0, radius.shape[0], first, 0.0, first, frame, scratch.still)
    put_bounds(volumes, first, 0.0, first, frame, scratch.still_bound)
    body, bound, before, before_bound = (
        scratch.body,
        scratch.bound,
        scratch.before,
        scratch.before_bound,
    )
    moved, moved_before = scratch.moved[0], scratch.moved[1]
    depth, nearest = 0.0, np.inf
    # How near it comes at the time that counts: what cannot come nearer is not looked into.
    near_by, was = glance(
        path, count, main, aim, frames, now, graph, volumes, attacks, weighing, scratch
    )
    if near_by < weighing.clearance:
        return HIT
    near_by, was = near_by + EPSILON, was + EPSILON
    for turn in range(attacks.sample.shape[0] - 1):
        m = main if turn == 0 else (turn - 1 if turn <= main else turn)
        least = near_by if m == main else weighing.clearance
        step, k, seen = 1, 0, False
        row, share, after, edge = 0, 0.0, 0, 0
        for n in range(attacks.sample[m], attacks.sample[m + 1]):
            t = attacks.when[n]
            if t < 0.0:
                continue
            while step < frames - 1 and when[step] < t:
                step += 1
            if when[step] < t:
                break  # what comes later is another path's
            part_way = (t - when[step - 1]) / (when[step] - when[step - 1])
            x = at[step - 1] + part_way * (at[step] - at[step - 1])
            while k < count and x > scratch.upto[k]:
                k += 1
            phase, last = phase_at(x, k, path, now, graph, scratch)
            old_row, old_share, old_after, old_edge = row, share, after, edge
            row, edge = min(max(int(phase), 0), last), k
            share, after = phase - row, min(row + 1, last)
            put_bounds(volumes, row, share, after, scratch.anchor[k], bound)
            displace(
                row, share, after, scratch.anchor[k], step, part_way, graph.joins, scratch, moved
            )
            shift_bounds(volumes, moved, bound)
            away = m == main and k == count and begins <= phase <= ends
            for i in range(attacks.count[m]):
                r = attacks.radius[m, i]
                px, py, pz = (
                    attacks.centre[n, i, 0],
                    attacks.centre[n, i, 1],
                    attacks.centre[n, i, 2],
                )
                qx, qy, qz = px, py, pz
                if seen:
                    qx = attacks.centre[n - 1, i, 0]
                    qy = attacks.centre[n - 1, i, 1]
                    qz = attacks.centre[n - 1, i, 2]
                for g in range(bound.shape[1]):
                    low, high = group[g], group[g + 1]
                    # Only a group that can be nearer than what is nearest so far is looked into.
                    if far_off(qx, qy, qz, before_bound, px, py, pz, bound, g, seen, r) < least:
                        put_body(volumes, low, high, row, share, after, scratch.anchor[k], body)
                        shift_body(volumes, low, high, moved, body)
                        if seen:
                            put_body(
                                volumes, low, high, old_row, old_share, old_after,
                                scratch.anchor[old_edge], before,
                            )  # fmt: skip
                            shift_body(volumes, low, high, moved_before, before)
                            d = swept_gap(
                                qx, qy, qz, before, px, py, pz, body, r, radius, low, high
                            )
                        else:
                            d = gap(px, py, pz, r, body, radius, low, high)
                        if d < weighing.clearance:
                            return HIT
                        least = min(least, d)
                    if m != main:
                        continue
                    still = scratch.still_bound
                    dx, dy, dz = px - still[0, g], py - still[1, g], pz - still[2, g]
                    lower = np.sqrt(dx * dx + dy * dy + dz * dz) - still[3, g] - r
                    if lower < was:
                        was = min(was, gap(px, py, pz, r, scratch.still, radius, low, high))
                    if away and lower < 0.0:
                        put_body(volumes, low, high, row, share, after, scratch.anchor[k], body)
                        more = overlap(
                            px, py, pz, r, scratch.still, body, radius, weighing.left, low, high
                        )
                        depth += more * attacks.lasts[n]
            for g in range(bound.shape[1]):
                for c in range(4):
                    before_bound[c, g] = bound[c, g]
            for p in range(moved.shape[0]):
                for c in range(3):
                    moved_before[p, c] = moved[p, c]
            seen = True
        if m == main:
            nearest = least
    if nearest == np.inf:
        return TOO_LONG
    avoidance = max(0.0, 1.0 - depth / weighing.enough)
    if nearest <= was:
        near = 1.0
    else:
        near = min(1.0, (nearest - was) / weighing.far)
    slow = max(scale, 1.0 / scale) / most
    weight = weighing.weight
    out[0] = weight[0] * avoidance + weight[1] * near + weight[2] * slow
    out[1], out[2], out[3] = avoidance, near, slow
    out[4], out[5], out[6], out[7] = depth, nearest, was, smooth
    return VALID


@lean_kernel
def weigh_all(
    count, path, length, part, main, aim, now, graph, volumes, attacks, weighing, masks, scratch,
    outcome, scores,
):  # fmt: skip
    """Evaluate candidates [C, D]; what became of them [C] and their scores [C, 8]. Returns the best
    (the first of equals, -1 for none) and whether it avoids what would have hit the body.

    Who is where the attack comes by and leaves in time goes before who never was there.
    """
    best, least, avoids = -1, np.inf, False
    for c in range(count):
        out = scores[c]
        outcome[c] = weigh(
            path[c], length[c], part[c], main, aim, now, graph, volumes, attacks, weighing, masks,
            scratch, out,
        )  # fmt: skip
        if outcome[c] != VALID:
            continue
        leaves = out[4] > 0.0
        if best < 0 or (leaves and not avoids) or (leaves == avoids and out[0] < least):
            best, least, avoids = c, out[0], leaves
    return best, avoids
