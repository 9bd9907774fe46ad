"""Which actions of a fight should be considered (Shum et al. 2012, section V-C).

Shapes as in :mod:`kumite.kernels.moves`.
"""

from __future__ import annotations

import numpy as np

from kumite.kernels.jit import lean_kernel
from kumite.kernels.moves import ATTACK, DEFENCE, TRUNK, carried, compose, touch

ILLOGICAL, TOO_FAR, TURNED_AWAY, OVERLAPS, ENDS_INSIDE, RUNS_OUT, LEAVES = 1, 2, 4, 8, 16, 32, 64
"""What is wrong with an action, the least important first; the last two of an arena."""

ROUNDING = 1e-9  # m: who stands outside does not leave


@lean_kernel
def way_of(first, last, frame, moves, stride, way):
    """Where the opponent is every ``stride`` frames: its facing frame's x and z, and its trunk's
    circle, into way [m, 5]. After ``last`` frames from row ``first`` it stands; the row of way in
    which it does is returned."""
    stands = last // stride + 1
    for j in range(stands + 1):
        row = first + min(j * stride, last)
        way[j, 0], way[j, 1] = carried(frame, moves.track[row, 0], moves.track[row, 1])
        way[j, 2], way[j, 3] = carried(frame, moves.trunk[row, 0], moves.trunk[row, 1])
        way[j, 4] = moves.trunk[row, 2]
    return stands


@lean_kernel
def overlaps(body, row, other, frame, bulk):
    """Whether the trunk spheres of two rows overlap; those of ``other`` are in a frame."""
    found = False
    for b in range(TRUNK):  # without branches: all at once
        x, z = carried(frame, body[other, 0, b], body[other, 2, b])
        y = body[other, 1, b]
        for a in range(TRUNK):
            dx, dy, dz = body[row, 0, a] - x, body[row, 1, a] - y, body[row, 2, a] - z
            r = bulk[a] + bulk[b]
            found |= dx * dx + dy * dy + dz * dz < r * r
    return found


@lean_kernel
def judge(stretches, first, last, frame, way, stands, attacked, facing, hasty, moves, rules, flaws):
    """What is wrong with each of stretches [n], into flaws [n]; if ``hasty`` the first thing found.

    first, last, frame, way, stands: the opponent's rows seen from here (:func:`way_of`). Ranges
    are those of the nearest the two get, where the stretch is begun or later. facing [rad]: how far
    from the opponent it may end.
    """
    body, track, trunk, start, bulk = moves.body, moves.track, moves.trunk, moves.start, moves.bulk
    duration, kind, heading, stride = moves.duration, moves.kind, moves.heading, rules.stride
    attack2, defence2 = rules.attack_range**2, rules.defence_range**2
    cone = np.cos(facing)
    for n in range(stretches.shape[0]):
        k = stretches[n]
        row, other = start[k] + duration[k], first + min(duration[k], last)
        x, z = carried(frame, track[other, 0], track[other, 1])
        dx, dz = x - track[row, 0], z - track[row, 1]
        end2 = dx * dx + dz * dz
        flaw = 0
        if dx * heading[k, 0] + dz * heading[k, 1] < cone * np.sqrt(end2):
            flaw = TURNED_AWAY
        if kind[k] == DEFENCE and not attacked:
            flaw |= ILLOGICAL
        if hasty and flaw:
            flaws[n] = flaw
            continue
        reach2 = np.inf
        if kind[k] == ATTACK:
            reach2 = attack2
        elif kind[k] == DEFENCE:
            reach2 = defence2
        nearest2 = min(end2, way[0, 0] * way[0, 0] + way[0, 1] * way[0, 1])
        x, z = carried(frame, trunk[other, 0], trunk[other, 1])
        if touch(x, z, trunk[other, 2], trunk, row, 0.0) and overlaps(
            body, row, other, frame, bulk
        ):
            flaw |= OVERLAPS | ENDS_INSIDE
        for j in range(1, (duration[k] - 1) // stride + 1):
            if hasty and flaw:
                break
            row, h = start[k] + j * stride, min(j, stands)
            if nearest2 > reach2:
                dx, dz = way[h, 0] - track[row, 0], way[h, 1] - track[row, 1]
                nearest2 = min(nearest2, dx * dx + dz * dz)
            if touch(way[h, 2], way[h, 3], way[h, 4], trunk, row, 0.0) and overlaps(
                body, row, first + min(j * stride, last), frame, bulk
            ):
                flaw |= OVERLAPS
        if nearest2 > reach2:
            flaw |= TOO_FAR
        flaws[n] = flaw


@lean_kernel
def beyond(x, z, yaw, u, w, arena):
    """How far [m] point (u, w) of frame (x, z, yaw) is beyond the edge of the arena."""
    x, z, _ = compose(x, z, yaw, u, w, 0.0)
    return np.sqrt(x * x + z * z) - arena


@lean_kernel
def leaves(k, x, z, yaw, moves, rules):
    """Whether stretch k leads out of the arena from (x, z, yaw), or farther out from outside.

    The last frame and every ``stride`` before it are looked at: straight between two places inside
    is inside.
    """
    hull, track, arena = moves.hull, moves.track, rules.arena
    if beyond(x, z, yaw, hull[k, 0], hull[k, 1], arena) < -hull[k, 2]:  # nor does any of the body
        return False
    most = max(np.sqrt(x * x + z * z) - arena, 0.0) + ROUNDING
    first, lasts = moves.start[k], moves.duration[k]
    for i in range(lasts, 0, -rules.stride):
        if beyond(x, z, yaw, track[first + i, 0], track[first + i, 1], arena) > most:
            return True
    return False


@lean_kernel
def runs_out(k, x, z, yaw, moves, rules):
    """Whether nobody can come to rest in the arena after stretch k, begun in (x, z, yaw)."""
    row, node, places = moves.start[k] + moves.duration[k], moves.successor[k], moves.halt_place
    track, starts = moves.track, moves.halt_place_start
    x, z, yaw = compose(x, z, yaw, track[row, 0], track[row, 1], track[row, 2])
    for way in range(moves.halt_start[node], moves.halt_start[node + 1]):
        inside = True
        for i in range(starts[way], starts[way + 1]):
            if beyond(x, z, yaw, places[i, 0], places[i, 1], rules.arena) > 0.0:
                inside = False
                break
        if inside:
            return False
    return True


@lean_kernel
def fence(stretches, x, z, yaw, hasty, moves, rules, flaws):
    """Add to flaws [n] which of stretches [n], begun in (x, z, yaw), leave the arena, or end so
    fast that nothing is left but to leave it; if ``hasty`` only where no flaw has been found."""
    for n in range(stretches.shape[0]):
        if hasty and flaws[n]:
            continue
        if leaves(stretches[n], x, z, yaw, moves, rules):
            flaws[n] |= LEAVES
        elif runs_out(stretches[n], x, z, yaw, moves, rules):
            flaws[n] |= RUNS_OUT


@lean_kernel
def fewest(flaws):
    """The least of flaws [n]."""
    least = flaws[0]
    for n in range(1, flaws.shape[0]):
        least = min(least, flaws[n])
    return least


@lean_kernel
def worst_allowed(flaws):
    """The flaws that must be put up with: those of no action but the least important (section V-C).

    Actions whose flaws are below the number returned are kept. Where all overlap that do not leave
    the arena, OVERLAPS is taken from all: what counts then is the last frame, and the other flaws
    as ever. Where all leave it, LEAVES is, and where all others run out of it, RUNS_OUT.
    """
    for edge in (LEAVES, RUNS_OUT, OVERLAPS):
        if fewest(flaws) >= edge:
            for n in range(flaws.shape[0]):
                flaws[n] &= ~edge
    least = fewest(flaws)
    limit = 1
    while limit <= least:
        limit *= 2
    return limit
