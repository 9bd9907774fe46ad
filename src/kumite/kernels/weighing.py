"""How well a candidate avoids an attack: section 4 of Oshita & Masaoka (2011), part by part.

:func:`weigh` puts them together: :func:`~kumite.kernels.avoid.timed` (Eqs. 2 and 3), :func:`culled`
(section 5.2), :func:`nearest_to`, :func:`place_left` (Eqs. 4 and 5) and :func:`costs` (Eqs. 6 to
10). Shapes and names are those of :mod:`kumite.kernels.avoid`.
"""

from __future__ import annotations

import numpy as np

from kumite.kernels.avoid import (
    CULLED,
    EPSILON,
    HIT,
    TOO_LONG,
    VALID,
    between,
    gap,
    moment,
    overlap,
    phase_at,
    put_body,
    put_bounds,
    swept_gap,
    timed,
)
from kumite.kernels.jit import lean_kernel
from kumite.kernels.joins import displace, follow, shift_body, shift_bounds


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
    at, when, t = scratch.at, scratch.when, attacks.when[n]
    step = moment(t, 1, frames, when)
    if t < 0.0 or when[step] < t:
        return np.inf, np.inf
    part_way = between(t, step, when)
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
def culled(path, count, part, main, frames, now, graph, attacks, masks, scratch):
    """Whether an attack goes through the body during a part for certain (section 5.2): where the
    body is throughout, a look at its masks is enough.
    """
    if masks.bits.shape[0] == 0:
        return False
    begins, ends = float(graph.begins[part]), float(graph.ends[part])
    frame, at, when, offset = scratch.anchor[count], scratch.at, scratch.when, scratch.offset
    own = now.phase if count == 0 else graph.first[path[count - 1]] - 1 - scratch.upto[count - 1]
    step = 1
    for n in range(attacks.sample[main], attacks.sample[main + 1]):
        t = attacks.when[n]
        if t < 0.0:
            continue
        step = moment(t, step, frames, when)
        if when[step] < t:
            break
        share = between(t, step, when)
        phase = own + at[step - 1] + share * (at[step] - at[step - 1])
        if phase < begins or phase > ends:
            continue
        x, y, z = 0.0, 0.0, 0.0  # by how much the root will be shown elsewhere
        if graph.joins.reckoned:
            root, then = offset[step - 1, 1, 0], offset[step, 0, 0]
            x = root[0] + share * (then[0] - root[0])
            y = root[1] + share * (then[1] - root[1])
            z = root[2] + share * (then[2] - root[2])
        for i in range(attacks.count[main]):
            if attacks.radius[main, i] >= masks.least and certainly_hit(
                part, frame, attacks.centre[n, i, 0] - x, attacks.centre[n, i, 1] - y,
                attacks.centre[n, i, 2] - z, masks,
            ):  # fmt: skip
                return True
    return False


@lean_kernel
def nearest_to(m, path, count, frames, least, now, graph, volumes, attacks, weighing, scratch):
    """d: the smallest distance [m] of attack m to the body as it will be shown, with what joins
    leave, from now until the path is over; ``least`` if it is no smaller. Below the clearance the
    body counts as hit, and any distance of that kind is returned.
    """
    at, when, radius, group = scratch.at, scratch.when, volumes.radius, volumes.group
    body, bound, moved = scratch.body, scratch.bound, scratch.moved[0]
    before, before_bound, moved_before = scratch.before, scratch.before_bound, scratch.moved[1]
    step, k, seen = 1, 0, False
    row, share, after, edge = 0, 0.0, 0, 0
    for n in range(attacks.sample[m], attacks.sample[m + 1]):
        t = attacks.when[n]
        if t < 0.0:
            continue
        step = moment(t, step, frames, when)
        if when[step] < t:
            break  # what comes later is another path's
        part_way = between(t, step, when)
        x = at[step - 1] + part_way * (at[step] - at[step - 1])
        while k < count and x > scratch.upto[k]:
            k += 1
        phase, last = phase_at(x, k, path, now, graph, scratch)
        old_row, old_share, old_after, old_edge = row, share, after, edge
        row, edge = min(max(int(phase), 0), last), k
        share, after = phase - row, min(row + 1, last)
        put_bounds(volumes, row, share, after, scratch.anchor[k], bound)
        displace(row, share, after, scratch.anchor[k], step, part_way, graph.joins, scratch, moved)
        shift_bounds(volumes, moved, bound)
        for i in range(attacks.count[m]):
            r = attacks.radius[m, i]
            px, py, pz = attacks.centre[n, i, 0], attacks.centre[n, i, 1], attacks.centre[n, i, 2]
            qx, qy, qz = px, py, pz
            if seen:
                qx = attacks.centre[n - 1, i, 0]
                qy = attacks.centre[n - 1, i, 1]
                qz = attacks.centre[n - 1, i, 2]
            for g in range(bound.shape[1]):
                # Only a group that can be nearer than what is nearest so far is looked into.
                if far_off(qx, qy, qz, before_bound, px, py, pz, bound, g, seen, r) >= least:
                    continue
                low, high = group[g], group[g + 1]
                put_body(volumes, low, high, row, share, after, scratch.anchor[k], body)
                shift_body(volumes, low, high, moved, body)
                if seen:
                    put_body(
                        volumes, low, high, old_row, old_share, old_after,
                        scratch.anchor[old_edge], before,
                    )  # fmt: skip
                    shift_body(volumes, low, high, moved_before, before)
                    d = swept_gap(qx, qy, qz, before, px, py, pz, body, r, radius, low, high)
                else:
                    d = gap(px, py, pz, r, body, radius, low, high)
                if d < weighing.clearance:
                    return d
                least = min(least, d)
        for g in range(bound.shape[1]):
            for c in range(4):
                before_bound[c, g] = bound[c, g]
        for p in range(moved.shape[0]):
            for c in range(3):
                moved_before[p, c] = moved[p, c]
        seen = True
    return least


@lean_kernel
def place_left(
    path, count, part, main, frames, was, now, graph, volumes, attacks, weighing, scratch
):
    """(d0, e') of an attack: its smallest distance [m] to the body as the part begins, had that
    stayed, or ``was`` if that is smaller; and how much of it goes through the place that the body
    has left during the part, m s (Eqs. 4 and 5). Both are of the capture: what place a part leaves
    is its own, whichever way it is come to.
    """
    begins, ends = float(graph.begins[part]), float(graph.ends[part])
    at, when, radius, group = scratch.at, scratch.when, volumes.radius, volumes.group
    still, bound = scratch.still, scratch.still_bound
    depth, step, k = 0.0, 1, 0
    for n in range(attacks.sample[main], attacks.sample[main + 1]):
        t = attacks.when[n]
        if t < 0.0:
            continue
        step = moment(t, step, frames, when)
        if when[step] < t:
            break
        x = at[step - 1] + between(t, step, when) * (at[step] - at[step - 1])
        while k < count and x > scratch.upto[k]:
            k += 1
        phase, last = phase_at(x, k, path, now, graph, scratch)
        row = min(max(int(phase), 0), last)
        share, after = phase - row, min(row + 1, last)
        away = k == count and begins <= phase <= ends
        for i in range(attacks.count[main]):
            px, py, pz = attacks.centre[n, i, 0], attacks.centre[n, i, 1], attacks.centre[n, i, 2]
            r = attacks.radius[main, i]
            for g in range(bound.shape[1]):
                dx, dy, dz = px - bound[0, g], py - bound[1, g], pz - bound[2, g]
                lower = np.sqrt(dx * dx + dy * dy + dz * dz) - bound[3, g] - r
                low, high = group[g], group[g + 1]
                if lower < was:
                    was = min(was, gap(px, py, pz, r, still, radius, low, high))
                if away and lower < 0.0:
                    body = scratch.body
                    put_body(volumes, low, high, row, share, after, scratch.anchor[k], body)
                    more = overlap(px, py, pz, r, still, body, radius, weighing.left, low, high)
                    depth += more * attacks.lasts[n]
    return was, depth


@lean_kernel
def costs(depth, nearest, was, scale, weighing, out):
    """Write (e, e_avoidance, e_body, e_timescale) of Eqs. 6 to 10 into out [4] and what follows.

    e_avoidance (Eq. 6, read as max(0, 1 - e'/E)) is small where much of the attack goes through the
    place that was left; e_body (Eq. 8) where the body is no farther from it than need be;
    e_timescale (Eq. 9) where its speed is hardly adjusted. e (Eq. 10) is their weighted sum.
    """
    avoidance = max(0.0, 1.0 - depth / weighing.enough)
    if nearest <= was:
        near = 1.0
    else:
        near = min(1.0, (nearest - was) / weighing.far)
    slow = max(scale, 1.0 / scale) / weighing.most
    weight = weighing.weight
    out[0] = weight[0] * avoidance + weight[1] * near + weight[2] * slow
    out[1], out[2], out[3] = avoidance, near, slow


@lean_kernel
def weigh(
    path, count, part, main, aim, now, graph, volumes, attacks, weighing, masks, scratch, out
):
    """Evaluate a candidate: Eqs. 2 to 10. Returns what became of it; out [8] is then

    (e, e_avoidance, e_body, e_timescale, e', d, d0, s). main: the attack to be avoided, whose time
    is ``aim`` [s]; of the others it is enough not to be hit. masks: see :func:`certainly_hit`.
    """
    outcome, frames, scale, smooth = timed(path, count, part, aim, now, graph, weighing, scratch)
    if outcome != VALID:
        return outcome
    until = 0.0
    for m in range(attacks.sample.shape[0] - 1):
        until = max(until, attacks.when[attacks.sample[m + 1] - 1])
    follow(path, count, frames, until, now, graph, scratch)
    if culled(path, count, part, main, frames, now, graph, attacks, masks, scratch):
        return CULLED
    first, everyone = graph.begins[part], volumes.radius.shape[0]
    put_body(volumes, 0, everyone, first, 0.0, first, scratch.anchor[count], scratch.still)
    put_bounds(volumes, first, 0.0, first, scratch.anchor[count], scratch.still_bound)
    # How near it comes at the time that counts: what cannot come nearer is not looked into.
    near_by, was = glance(
        path, count, main, aim, frames, now, graph, volumes, attacks, weighing, scratch
    )
    if near_by < weighing.clearance:
        return HIT
    nearest = np.inf
    for turn in range(attacks.sample.shape[0] - 1):
        m = main if turn == 0 else (turn - 1 if turn <= main else turn)
        least = near_by + EPSILON if m == main else weighing.clearance
        least = nearest_to(
            m, path, count, frames, least, now, graph, volumes, attacks, weighing, scratch
        )
        if least < weighing.clearance:
            return HIT
        if m == main:
            nearest = least
    if nearest == np.inf:
        return TOO_LONG
    was, depth = place_left(
        path, count, part, main, frames, was + EPSILON, now, graph, volumes, attacks, weighing,
        scratch,
    )  # fmt: skip
    costs(depth, nearest, was, scale, weighing, out)
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
