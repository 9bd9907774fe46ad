"""What joins leave along a path: how far the body will be shown from where the capture has it.

At a join the differences of the root's and the ankles' places become offsets that springs take to
zero, but for a planted foot's, which stays (:mod:`kumite.kernels.character`). Here the same is
foreseen for paths that are not played yet: offsets frame by frame, and how a leg bends for them.
Rotations that joints keep for a moment are left out: a tenth of a second later they move nothing
by more than centimetres.

Shapes: F frames, n frames of a path, B spheres, G groups. Points: the root, the left ankle, the
right. Places: these two ankles and both knees, as :data:`PLACES` counts them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kumite.kernels.jit import lean_kernel

PLACES = 5  # root, left and right knee, left and right ankle
ROOT, KNEE, ANKLE = 0, 1, 3


class Joins(NamedTuple):
    """What of the capture offsets come from, and how they fade."""

    point: np.ndarray  # [F, 3, 3] m, library world
    leg: np.ndarray  # [F, 2, 2, 3] m, hip and knee of each side
    before: np.ndarray  # [F] the frame before in the same clip, or itself
    planted: np.ndarray  # [F, 2] bool
    slow: float  # 1/s, of the root's spring
    quick: float  # 1/s, of the ankles'
    longest: float  # m that a planted foot may stay off
    reckoned: bool  # False: what is shown is taken to be the capture


@lean_kernel
def add_join(source, target, lasted, lasts, old, new, joins, offset, velocity):
    """Add to offsets [3, 3] and velocities [3, 3] what going from a frame to another leaves.

    lasted, lasts [s]: for how long the frames before and after are shown; old, new [4]: where.
    """
    point, a, b = joins.point, joins.before[source], joins.before[target]
    for p in range(3):
        x, z = point[source, p, 0], point[source, p, 2]
        v, w = point[target, p, 0], point[target, p, 2]
        offset[p, 0] += old[2] * x + old[3] * z + old[0] - (new[2] * v + new[3] * w + new[0])
        offset[p, 1] += point[source, p, 1] - point[target, p, 1]
        offset[p, 2] += old[2] * z - old[3] * x + old[1] - (new[2] * w - new[3] * v + new[1])
        x, z = (x - point[a, p, 0]) / lasted, (z - point[a, p, 2]) / lasted
        v, w = (v - point[b, p, 0]) / lasts, (w - point[b, p, 2]) / lasts
        velocity[p, 0] += old[2] * x + old[3] * z - (new[2] * v + new[3] * w)
        velocity[p, 1] += (point[source, p, 1] - point[a, p, 1]) / lasted
        velocity[p, 1] -= (point[target, p, 1] - point[b, p, 1]) / lasts
        velocity[p, 2] += old[2] * z - old[3] * x - (new[2] * w - new[3] * v)


@lean_kernel
def fade(offset, velocity, planted, dt, slow, quick, longest, left_slow, left_quick):
    """Offsets [3, 3] and velocities [3, 3] over dt [s], as :func:`character.move_feet` has it."""
    for p in range(3):
        y, e, stays = slow, left_slow, False
        if p > 0:
            far = offset[p, 0] ** 2 + offset[p, 2] ** 2 > longest * longest
            y, e, stays = quick, left_quick, planted[p - 1] and not far
        for c in range(3):
            if stays and c != 1:
                velocity[p, c] = 0.0
                continue
            change = velocity[p, c] + offset[p, c] * y
            offset[p, c] = e * (offset[p, c] + change * dt)
            velocity[p, c] = e * (velocity[p, c] - change * y * dt)


@lean_kernel
def follow(path, count, frames, until, now, graph, scratch):
    """Offsets along a path that is laid and timed, as far as ``until`` [s] is: at each of its
    frames as it is come to and as it is left, into scratch.offset [n, 2, 3, 3].
    """
    joins, out, at, when = graph.joins, scratch.offset, scratch.at, scratch.when
    offset, velocity = scratch.left[0], scratch.left[1]
    for p in range(3):
        for c in range(3):
            offset[p, c], velocity[p, c] = now.left[0, p, c], now.left[1, p, c]
    k, lasted, known, left_slow, left_quick = 0, now.slowness / graph.fps, -1.0, 0.0, 0.0
    for i in range(frames):
        stop = now.stop if k == 0 else graph.last[path[k - 1]]
        if i > 0:
            lasted = when[i] - when[i - 1]
            if abs(lasted - known) > 1e-12:
                known = lasted
                left_slow, left_quick = np.exp(-joins.slow * lasted), np.exp(-joins.quick * lasted)
            frame = stop - int(scratch.upto[k] - at[i] + 0.5)
            fade(
                offset, velocity, joins.planted[frame], lasted, joins.slow, joins.quick,
                joins.longest, left_slow, left_quick,
            )  # fmt: skip
        for p in range(3):
            for c in range(3):
                out[i, 0, p, c] = offset[p, c]
        while k < count and at[i] >= scratch.upto[k] - 1e-9:
            target = graph.first[path[k]] - 1
            if target != stop:
                lasts = when[i + 1] - when[i] if i + 1 < frames else lasted
                old, new = scratch.anchor[k], scratch.anchor[k + 1]
                add_join(stop, target, lasted, lasts, old, new, joins, offset, velocity)
            stop = graph.last[path[k]]
            k += 1
        for p in range(3):
            for c in range(3):
                out[i, 1, p, c] = offset[p, c]
        if when[i] >= until:
            break


@lean_kernel
def displace(row, share, after, frame, step, part_way, joins, scratch, out):
    """How far [5, 3] places will be shown from the capture's, part of the way to a path's frame.

    The capture is ``share`` of the way between library frames row and after, in frame [4]. A leg
    keeps its plane and the lengths of its bones, and reaches no farther than they do.
    """
    if not joins.reckoned:
        out[:] = 0.0
        return
    c, n, leg, point = frame[2], frame[3], joins.leg, joins.point
    old = scratch.offset[step - 1, 1 if part_way > 0.0 else 0]
    new = scratch.offset[step, 0]
    for i in range(3):
        out[ROOT, i] = old[0, i] + part_way * (new[0, i] - old[0, i])
    rx, ry, rz = out[ROOT, 0], out[ROOT, 1], out[ROOT, 2]
    for s in range(2):
        ox = old[1 + s, 0] + part_way * (new[1 + s, 0] - old[1 + s, 0])
        oy = old[1 + s, 1] + part_way * (new[1 + s, 1] - old[1 + s, 1])
        oz = old[1 + s, 2] + part_way * (new[1 + s, 2] - old[1 + s, 2])
        hx = leg[row, s, 0, 0] + share * (leg[after, s, 0, 0] - leg[row, s, 0, 0])
        hy = leg[row, s, 0, 1] + share * (leg[after, s, 0, 1] - leg[row, s, 0, 1])
        hz = leg[row, s, 0, 2] + share * (leg[after, s, 0, 2] - leg[row, s, 0, 2])
        x = leg[row, s, 1, 0] + share * (leg[after, s, 1, 0] - leg[row, s, 1, 0]) - hx
        ky = leg[row, s, 1, 1] + share * (leg[after, s, 1, 1] - leg[row, s, 1, 1]) - hy
        z = leg[row, s, 1, 2] + share * (leg[after, s, 1, 2] - leg[row, s, 1, 2]) - hz
        kx, kz = c * x + n * z, c * z - n * x  # the knee as seen from the hip
        x = point[row, 1 + s, 0] + share * (point[after, 1 + s, 0] - point[row, 1 + s, 0]) - hx
        ay = point[row, 1 + s, 1] + share * (point[after, 1 + s, 1] - point[row, 1 + s, 1]) - hy
        z = point[row, 1 + s, 2] + share * (point[after, 1 + s, 2] - point[row, 1 + s, 2]) - hz
        ax, az = c * x + n * z, c * z - n * x  # the ankle
        gx, gy, gz = ax + ox - rx, ay + oy - ry, az + oz - rz  # and where it should be
        thigh = np.sqrt(kx * kx + ky * ky + kz * kz)
        shin = np.sqrt((ax - kx) ** 2 + (ay - ky) ** 2 + (az - kz) ** 2)
        is_now = np.sqrt(ax * ax + ay * ay + az * az) + 1e-12
        far = np.sqrt(gx * gx + gy * gy + gz * gz) + 1e-12
        longest = max(0.999 * (thigh + shin), is_now)
        want = min(max(far, abs(thigh - shin) + 1e-4), longest)
        ux, uy, uz = ax / is_now, ay / is_now, az / is_now
        vx, vy, vz = gx / far, gy / far, gz / far
        along = kx * ux + ky * uy + kz * uz
        px, py, pz = kx - along * ux, ky - along * uy, kz - along * uz
        out_of_line = np.sqrt(px * px + py * py + pz * pz) + 1e-12
        px, py, pz = px / out_of_line, py / out_of_line, pz / out_of_line
        # The way the knee points turns as the line from hip to ankle does, by the shortest arc.
        off = (px * vx + py * vy + pz * vz) / (1.0 + ux * vx + uy * vy + uz * vz + 1e-12)
        px, py, pz = px - off * (ux + vx), py - off * (uy + vy), pz - off * (uz + vz)
        along = (thigh * thigh - shin * shin + want * want) / (2.0 * want)
        high = np.sqrt(max(thigh * thigh - along * along, 0.0))
        out[KNEE + s, 0] = rx + along * vx + high * px - kx
        out[KNEE + s, 1] = ry + along * vy + high * py - ky
        out[KNEE + s, 2] = rz + along * vz + high * pz - kz
        out[ANKLE + s, 0] = rx + want * vx - ax
        out[ANKLE + s, 1] = ry + want * vy - ay
        out[ANKLE + s, 2] = rz + want * vz - az


@lean_kernel
def shift_body(volumes, low, high, moved, out):
    """Move spheres low..high of [3, B] as the places [5, 3] they hang between are moved."""
    for j in range(low, high):
        a, b, part = volumes.between[j, 0], volumes.between[j, 1], volumes.along[j]
        for c in range(3):
            out[c, j] += moved[a, c] + part * (moved[b, c] - moved[a, c])


@lean_kernel
def shift_bounds(volumes, moved, out):
    """Move and widen spheres [4, G] around groups so that they stay around what is moved."""
    for g in range(out.shape[1]):
        first = volumes.group[g]
        a, b, part = volumes.between[first, 0], volumes.between[first, 1], volumes.group_along[g]
        more = 0.0
        for c in range(3):
            way = moved[b, c] - moved[a, c]
            out[c, g] += moved[a, c] + part * way
            more += way * way
        out[3, g] += volumes.group_spread[g] * np.sqrt(more)
