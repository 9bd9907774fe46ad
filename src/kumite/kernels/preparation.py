"""Preparation (Shum et al. 2013, section 5): locomotion bent towards a reference posture.

One number a character, the level of preparation a in [0, 1], says how far. Joint rotations are
blended, each by a weight of its own; the way over the ground gets shorter; the root goes as high
as the feet ask for; and feet that stand stay where they stand, by two-bone inverse kinematics.

The locomotion comes as poses in the scene. What is prepared lags behind it, for it goes a shorter
way: so each character has a planar transform, ``lag``, from where the locomotion is to where the
prepared character is.

Shapes: T frames, K characters, J joints, R reference postures.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange

from kumite.kernels.character import LN2, decay, planar_point, wrap
from kumite.kernels.jit import kernel, parallel_kernel
from kumite.kernels.limb import pose_joint, product, reach

SMALL_ARC = 1e-6  # 1 - cosine of half the angle: below it the arc is as good as straight
GONE = 1e-6  # m: an offset that has faded so far is gone
MANY = 256  # characters from which threads pay, on cores that others use too


class Postures(NamedTuple):
    """Reference postures, each in the facing frame of its pose."""

    wxyz: np.ndarray  # [R, J, 4], the root's without its heading
    root: np.ndarray  # [R, 2] m, x and z of the root
    ankle: np.ndarray  # [R, 2] m above the ground, left and right
    curve: np.ndarray  # [R, J] constants C


class Posture(NamedTuple):
    """One of them."""

    wxyz: np.ndarray  # [J, 4]
    root: np.ndarray  # [2]
    ankle: np.ndarray  # [2]
    curve: np.ndarray  # [J]


class Locomotion(NamedTuple):
    """What is prepared: poses in the scene."""

    root: np.ndarray  # [T, K, 3]
    wxyz: np.ndarray  # [T, K, J, 4]
    facing: np.ndarray  # [T, K, 3]
    ankle: np.ndarray  # [T, K, 2, 3]
    on_ground: np.ndarray  # [T, K, 2] bool
    shift: np.ndarray  # [T, K, 3] planar: what who prepares goes besides, seen from where it is


class Going(NamedTuple):
    """What is kept of each character from frame to frame."""

    begun: np.ndarray  # [K] bool, whether the rest holds the frame before
    lag: np.ndarray  # [K, 3] planar, locomotion → prepared
    facing: np.ndarray  # [K, 3] of the locomotion
    planted: np.ndarray  # [K, 2] bool
    ankle: np.ndarray  # [K, 2, 2] m, x and z of the locomotion's ankles
    shown: np.ndarray  # [K, 2, 2] m, x and z of the prepared ones
    offset: np.ndarray  # [K, 2, 2] m, x and z from where the blend has an ankle to where it is
    velocity: np.ndarray  # [K, 2, 2] m/s


class Prepared(NamedTuple):
    """What is shown."""

    root: np.ndarray  # [T, K, 3]
    wxyz: np.ndarray  # [T, K, J, 4]
    position: np.ndarray  # [T, K, J, 3]
    world_wxyz: np.ndarray  # [T, K, J, 4]
    facing: np.ndarray  # [T, K, 3]


@kernel
def blend_weight(level, curve):
    """Weight of the reference posture at a level of preparation: (1 - (1 - a)^(1/C))^C, Eq. 1.

    The print has the exponents the other way round, by which a C below 1 would lag, not lead.
    """
    if level <= 0.0:
        return 0.0
    if level >= 1.0:
        return 1.0
    if curve == 1.0:
        return level
    if curve == 0.5:
        return np.sqrt(level * (2.0 - level))  # the quarter circle
    return (1.0 - (1.0 - level) ** (1.0 / curve)) ** curve


@kernel
def arc(aw, ax, ay, az, bw, bx, by, bz, part):
    """The rotation ``part`` of the way from a to b by the shorter arc, in scalars. Eq. 2."""
    if part <= 0.0:
        return aw, ax, ay, az
    if part >= 1.0:
        return bw, bx, by, bz
    cosine = aw * bw + ax * bx + ay * by + az * bz
    sign = 1.0
    if cosine < 0.0:
        cosine, sign = -cosine, -1.0
    if cosine > 1.0 - SMALL_ARC:
        left, to = 1.0 - part, sign * part
    else:
        angle = np.arccos(cosine)
        left, to = np.sin((1.0 - part) * angle), sign * np.sin(part * angle)
    w, x, y, z = left * aw + to * bw, left * ax + to * bx, left * ay + to * by, left * az + to * bz
    n = 1.0 / np.sqrt(w * w + x * x + y * y + z * z)
    return n * w, n * x, n * y, n * z


@kernel
def compose(a, x, z, yaw, out):
    """The planar transform of (x, z, yaw) first, then a [3], into ``out`` (which may be a)."""
    c, s = np.cos(a[2]), np.sin(a[2])
    px, pz = c * x + s * z + a[0], -s * x + c * z + a[1]
    out[0], out[1], out[2] = px, pz, wrap(a[2] + yaw)


@kernel
def seen_from(a, b):
    """Planar frame b [3] seen from frame a [3]."""
    c, s = np.cos(a[2]), np.sin(a[2])
    x, z = b[0] - a[0], b[1] - a[1]
    return c * x - s * z, s * x + c * z, wrap(b[2] - a[2])


@kernel
def shifts(shift):
    """Whether a character goes anywhere besides."""
    return shift[0] != 0.0 or shift[1] != 0.0 or shift[2] != 0.0


@kernel
def fall_behind(lag, before, now, weight, shift):
    """Move a character's lag on by a step of the locomotion, of which it goes 1 - weight (Eq. 3,
    4), and by what it goes besides, shift [3].

    The step turns as much less as it gets less far.
    """
    if weight <= 0.0 and not shifts(shift):
        return
    x, z, yaw = seen_from(before, now)
    here = np.empty(3)
    compose(lag, before[0], before[1], before[2], here)
    go = 1.0 - weight
    compose(here, go * x, go * z, go * yaw, here)
    compose(here, shift[0], shift[1], shift[2], here)
    # lag = here · now⁻¹
    turn = wrap(here[2] - now[2])
    c, s = np.cos(turn), np.sin(turn)
    lag[0] = here[0] - (c * now[0] + s * now[1])
    lag[1] = here[1] - (-s * now[0] + c * now[1])
    lag[2] = turn


@kernel
def carry_feet(k, on_ground, ankle, blended, weight, half_life, dt, going):
    """Where feet are over the ground: the offsets of character k from the blend, in place.

    ankle [2, 3]: where the locomotion has them; blended [2, 2]: x and z where the blend has them.
    A foot that stood and stands moves as the locomotion's own does (a heel that is raised takes the
    ankle along), times 1 - weight; one in the air takes off with the velocity it had and comes back
    to the blend's (critically damped).
    """
    rate = 2.0 * LN2 / half_life
    left = np.exp(-rate * dt)
    c, s = np.cos(going.lag[k, 2]), np.sin(going.lag[k, 2])
    for f in range(2):
        offset, velocity = going.offset[k, f], going.velocity[k, f]
        x, z = ankle[f, 0] - going.ankle[k, f, 0], ankle[f, 2] - going.ankle[k, f, 1]
        if going.begun[k] and on_ground[f] and going.planted[k, f]:
            stay = 1.0 - weight
            for i in range(2):
                step = stay * (c * x + s * z) if i == 0 else stay * (c * z - s * x)
                now = going.shown[k, f, i] + step - blended[f, i]
                velocity[i] = (now - offset[i]) / dt
                offset[i] = now
        elif offset[0] != 0.0 or offset[1] != 0.0:
            decay(offset, velocity, rate, left, dt)
            if offset[0] ** 2 + offset[1] ** 2 < GONE * GONE:
                offset[:] = 0.0
                velocity[:] = 0.0
        going.planted[k, f] = on_ground[f]
        going.ankle[k, f, 0], going.ankle[k, f, 1] = ankle[f, 0], ankle[f, 2]
        for i in range(2):
            going.shown[k, f, i] = blended[f, i] + offset[i]


@kernel
def go_plain(t, k, moves, build, going, out):
    """A frame of an unprepared character: the locomotion's own, carried by the lag."""
    lag, root = going.lag[k], moves.root[t, k]
    still = lag[0] == 0.0 and lag[1] == 0.0 and lag[2] == 0.0
    place, turns = out.root[t, k], out.wxyz[t, k]
    for j in range(turns.shape[0]):
        for c in range(4):
            turns[j, c] = moves.wxyz[t, k, j, c]
    for c in range(3):
        place[c] = root[c]
        out.facing[t, k, c] = moves.facing[t, k, c]
    if not still:
        place[0], place[2] = planar_point(lag, root[0], root[2])
        half = 0.5 * lag[2]
        q = moves.wxyz[t, k, 0]
        turns[0, 0], turns[0, 1], turns[0, 2], turns[0, 3] = product(
            np.cos(half), 0.0, np.sin(half), 0.0, q[0], q[1], q[2], q[3]
        )
        g = moves.facing[t, k]
        compose(lag, g[0], g[1], g[2], out.facing[t, k])
    pose_all(build, place, turns, out.position[t, k], out.world_wxyz[t, k])
    for f in range(2):
        a = moves.ankle[t, k, f]
        going.planted[k, f] = moves.on_ground[t, k, f]
        going.ankle[k, f, 0], going.ankle[k, f, 1] = a[0], a[2]
        x, z = (a[0], a[2]) if still else planar_point(lag, a[0], a[2])
        going.shown[k, f, 0], going.shown[k, f, 1] = x, z
        going.velocity[k, f, 0], going.velocity[k, f, 1] = 0.0, 0.0


@kernel
def pose_all(build, root, wxyz, position, world):
    """Positions and world rotations of all joints."""
    for c in range(3):
        position[0, c] = root[c]
    for c in range(4):
        world[0, c] = wxyz[0, c]
    for j in range(1, wxyz.shape[0]):
        pose_joint(j, build.parents, build.offsets, wxyz, position, world)


@kernel
def blend_pose(t, k, level, moves, base, build, here, out):
    """Blend the rotations of a character at prepared frame ``here`` [3]; root height 0. Eq. 2."""
    turns, loco, like, curve = out.wxyz[t, k], moves.wxyz[t, k], base.wxyz, base.curve
    known, weight = -1.0, 0.0
    for j in range(turns.shape[0]):
        if curve[j] != known:  # neighbours in the tree share theirs: powers are dear
            known = curve[j]
            weight = blend_weight(level, known)
        a, b = loco[j], like[j]
        w, x, y, z = a[0], a[1], a[2], a[3]
        if j == 0:
            half = -0.5 * moves.facing[t, k, 2]
            w, x, y, z = product(np.cos(half), 0.0, np.sin(half), 0.0, w, x, y, z)
        w, x, y, z = arc(w, x, y, z, b[0], b[1], b[2], b[3], weight)
        if j == 0:
            half = 0.5 * here[2]
            w, x, y, z = product(np.cos(half), 0.0, np.sin(half), 0.0, w, x, y, z)
        turns[j, 0], turns[j, 1], turns[j, 2], turns[j, 3] = w, x, y, z
    root, weight = moves.root[t, k], blend_weight(level, curve[0])
    g = moves.facing[t, k]
    c, s = np.cos(g[2]), np.sin(g[2])
    dx, dz = root[0] - g[0], root[2] - g[1]
    x = (1.0 - weight) * (c * dx - s * dz) + weight * base.root[0]
    z = (1.0 - weight) * (s * dx + c * dz) + weight * base.root[1]
    place = out.root[t, k]
    place[0], place[2] = planar_point(here, x, z)
    place[1] = 0.0
    pose_all(build, place, turns, out.position[t, k], out.world_wxyz[t, k])


@kernel
def prepare_one(t, k, level, base, half_life, dt, moves, build, going, out):
    """Frame t of character k; ``base``: the posture it prepares for (a :class:`Posture`)."""
    weight, shift = blend_weight(level, base.curve[0]), moves.shift[t, k]
    if going.begun[k]:
        fall_behind(going.lag[k], going.facing[k], moves.facing[t, k], weight, shift)
    offset = going.offset[k]
    settled = offset[0, 0] == 0.0 and offset[0, 1] == 0.0
    settled = settled and offset[1, 0] == 0.0 and offset[1, 1] == 0.0
    if level <= 0.0 and settled and not shifts(shift):
        go_plain(t, k, moves, build, going, out)
    else:
        lag, g, here = going.lag[k], moves.facing[t, k], out.facing[t, k]
        compose(lag, g[0], g[1], g[2], here)
        blend_pose(t, k, level, moves, base, build, here, out)
        place, position, world = out.root[t, k], out.position[t, k], out.world_wxyz[t, k]
        ankle = moves.ankle[t, k]
        left, right = build.legs[0, 2], build.legs[1, 2]
        # The feet's mean height goes from the locomotion's to the posture's: Eq. 5, but that with
        # its ΔY alone who is all prepared would go up and down with the feet of the locomotion.
        want = (1.0 - weight) * (ankle[0, 1] + ankle[1, 1]) + weight * (
            base.ankle[0] + base.ankle[1]
        )
        height = 0.5 * (want - position[left, 1] - position[right, 1])
        place[1] = height
        for j in range(position.shape[0]):
            position[j, 1] += height
        blended, goal = np.empty((2, 2)), np.empty(3)
        for f in range(2):
            foot = build.legs[f, 2]
            blended[f, 0], blended[f, 1] = position[foot, 0], position[foot, 2]
        carry_feet(k, moves.on_ground[t, k], ankle, blended, weight, half_life, dt, going)
        for f in range(2):
            goal[0], goal[2] = going.shown[k, f, 0], going.shown[k, f, 1]
            goal[1] = (1.0 - weight) * ankle[f, 1] + weight * base.ankle[f]
            thigh, shin, foot = build.legs[f, 0], build.legs[f, 1], build.legs[f, 2]
            reach(
                thigh,
                shin,
                foot,
                build.below[f],
                goal,
                build.parents,
                build.offsets,
                out.wxyz[t, k],
                position,
                world,
            )
    for c in range(3):
        going.facing[k, c] = moves.facing[t, k, c]
    going.begun[k] = True


def _prepare(level, reference, postures, half_life, dt, moves, build, going, out):
    """All frames of all characters: level [T, K], reference [K]."""
    for k in prange(level.shape[1]):
        r = reference[k]
        base = Posture(postures.wxyz[r], postures.root[r], postures.ankle[r], postures.curve[r])
        for t in range(level.shape[0]):
            prepare_one(t, k, level[t, k], base, half_life, dt, moves, build, going, out)


prepare = kernel(_prepare)
prepare_many = parallel_kernel(_prepare)  # on all cores: worth its start-up from ``MANY`` on
