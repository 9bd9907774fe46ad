"""Limbs: joints posed one by one, two-bone inverse kinematics. All in scalars: no array is made.

Shapes: J joints. position [J, 3] m, world rotations [J, 4], local rotations wxyz [J, 4].
"""

from __future__ import annotations

import numpy as np

from kumite.kernels.jit import kernel

TINY = 1e-12
NEAR_ENOUGH = 1e-6  # m within which an ankle is where it should be


@kernel
def product(aw, ax, ay, az, bw, bx, by, bz):
    """Hamilton product of two quaternions, in scalars: no array is made for it."""
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


@kernel
def pose_joint(j, parents, offsets, wxyz, position, world):
    """Position and world rotation of a joint below the root, whose parent's are up to date."""
    p = parents[j]
    pw, px, py, pz = world[p, 0], world[p, 1], world[p, 2], world[p, 3]
    x, y, z = offsets[j, 0], offsets[j, 1], offsets[j, 2]
    # v + 2 w (u x v) + 2 u x (u x v)
    tx, ty, tz = 2.0 * (py * z - pz * y), 2.0 * (pz * x - px * z), 2.0 * (px * y - py * x)
    position[j, 0] = position[p, 0] + x + pw * tx + py * tz - pz * ty
    position[j, 1] = position[p, 1] + y + pw * ty + pz * tx - px * tz
    position[j, 2] = position[p, 2] + z + pw * tz + px * ty - py * tx
    world[j, 0], world[j, 1], world[j, 2], world[j, 3] = product(
        pw, px, py, pz, wxyz[j, 0], wxyz[j, 1], wxyz[j, 2], wxyz[j, 3]
    )


@kernel
def pose_below(below, parents, offsets, wxyz, position, world_wxyz):
    """Positions and world rotations of the joints of a limb, whose parents' are up to date."""
    for i in range(below.shape[0]):
        if below[i] < 0:
            break
        pose_joint(below[i], parents, offsets, wxyz, position, world_wxyz)


@kernel
def turned(w, x, y, z, a, b, c):
    """A vector (a, b, c) turned by a quaternion, in scalars."""
    tx, ty, tz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx


@kernel
def set_local(j, parents, world, w, x, y, z, wxyz):
    """The local rotation of joint j that gives it a world rotation, under its parent's."""
    if j == 0:
        wxyz[0, 0], wxyz[0, 1], wxyz[0, 2], wxyz[0, 3] = w, x, y, z
        return
    p = parents[j]
    wxyz[j, 0], wxyz[j, 1], wxyz[j, 2], wxyz[j, 3] = product(
        world[p, 0], -world[p, 1], -world[p, 2], -world[p, 3], w, x, y, z
    )


@kernel
def bend_of(a, b, now, want):
    """By how much [rad] the joint between bones a and b opens for its ends to be ``want`` apart."""
    cos_now = min(max((a * a + b * b - now * now) / (2 * a * b + TINY), -1.0), 1.0)
    cos_want = min(max((a * a + b * b - want * want) / (2 * a * b + TINY), -1.0), 1.0)
    return np.arccos(cos_want) - np.arccos(cos_now)


@kernel
def reach(upper, middle, end, below, goal, parents, offsets, wxyz, position, world):
    """Two-bone inverse kinematics: bring joint ``end`` to ``goal`` [3], keep its world rotation.

    below: the joints that hang from ``upper``, itself first, then -1.

    The limb bends in the plane it bends in; out of reach it stretches towards the goal to 99.9 %.
    Leaves local rotations, positions and world rotations up to date.
    """
    ux, uy, uz = position[upper, 0], position[upper, 1], position[upper, 2]
    mx, my, mz = position[middle, 0], position[middle, 1], position[middle, 2]
    ex, ey, ez = position[end, 0], position[end, 1], position[end, 2]
    gx, gy, gz = goal[0] - ux, goal[1] - uy, goal[2] - uz
    off = (goal[0] - ex) ** 2 + (goal[1] - ey) ** 2 + (goal[2] - ez) ** 2
    if off < NEAR_ENOUGH * NEAR_ENOUGH:
        return
    px, py, pz = ux - mx, uy - my, uz - mz  # from the middle to both ends
    qx, qy, qz = ex - mx, ey - my, ez - mz
    a, b = np.sqrt(px * px + py * py + pz * pz), np.sqrt(qx * qx + qy * qy + qz * qz)
    now = np.sqrt((ex - ux) ** 2 + (ey - uy) ** 2 + (ez - uz) ** 2)
    longest = max(0.999 * (a + b), now)  # a straighter capture than that is not bent by force
    want = min(max(np.sqrt(gx * gx + gy * gy + gz * gz), abs(a - b) + 1e-4), longest)
    ax, ay, az = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
    length = np.sqrt(ax * ax + ay * ay + az * az)
    if length < 1e-6 * a * b:
        # A straight limb: bend about the joint's own side axis, the knee forward (+Z).
        ax, ay, az = turned(
            world[middle, 0], world[middle, 1], world[middle, 2], world[middle, 3], -1.0, 0.0, 0.0
        )
        length = 1.0
    bend = 0.5 * bend_of(a, b, now, want)
    s = np.sin(bend) / length
    bw, bx, by, bz = np.cos(bend), s * ax, s * ay, s * az
    # Where the end comes to by the bend alone, and the shortest turn from there to the goal.
    qx, qy, qz = turned(bw, bx, by, bz, qx, qy, qz)
    vx, vy, vz = mx + qx - ux, my + qy - uy, mz + qz - uz
    scale = 1.0 / (np.sqrt((vx * vx + vy * vy + vz * vz) * (gx * gx + gy * gy + gz * gz)) + TINY)
    tw = 1.0 + scale * (vx * gx + vy * gy + vz * gz)
    tx, ty, tz = (
        scale * (vy * gz - vz * gy),
        scale * (vz * gx - vx * gz),
        scale * (vx * gy - vy * gx),
    )
    n = 1.0 / (np.sqrt(tw * tw + tx * tx + ty * ty + tz * tz) + TINY)
    tw, tx, ty, tz = n * tw, n * tx, n * ty, n * tz
    w, x, y, z = product(
        bw, bx, by, bz, world[middle, 0], world[middle, 1], world[middle, 2], world[middle, 3]
    )
    set_local(middle, parents, world, w, x, y, z, wxyz)
    w, x, y, z = product(
        tw, tx, ty, tz, world[upper, 0], world[upper, 1], world[upper, 2], world[upper, 3]
    )
    set_local(upper, parents, world, w, x, y, z, wxyz)
    p = parents[end]  # it is carried by both turns
    w, x, y, z = product(bw, bx, by, bz, world[p, 0], world[p, 1], world[p, 2], world[p, 3])
    w, x, y, z = product(tw, tx, ty, tz, w, x, y, z)
    wxyz[end, 0], wxyz[end, 1], wxyz[end, 2], wxyz[end, 3] = product(
        w, -x, -y, -z, world[end, 0], world[end, 1], world[end, 2], world[end, 3]
    )
    pose_below(below, parents, offsets, wxyz, position, world)
