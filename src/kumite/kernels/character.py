"""Characters played from a library, all K at once: joins, inertialisation, foot lock, pose.

A character shows library frame f, or a phase on the way to the next (:mod:`kumite.kernels.phase`),
under an anchor, the planar transform from the library's world to the scene's. At a join the anchor
changes so that the facing frame stays, and what is left of the difference (joint rotations, height,
velocities) becomes an offset that a critically damped spring takes to zero: pose and velocity are
continuous. A planted foot does not take part in that: its offset stays while it bears weight, and
fades while it is in the air.

Shapes: K characters, J joints, F frames. Rotation offsets are rotation vectors in joint axes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange

from kumite.kernels.jit import kernel, parallel_kernel
from kumite.kernels.limb import pose_joint, product, reach
from kumite.kernels.phase import (
    AT_FRAME,
    Phase,
    earlier,
    following,
    part_way,
    sample_moving,
)
from kumite.kernels.pose import add_rotated, quaternion_product

LN2 = 0.6931471805599453
MANY = 256  # characters (2 ms of work) from which threads pay, on cores that others use too


class Capture(NamedTuple):
    """The library's arrays that are played."""

    fps: float
    root: np.ndarray  # [F, 3]
    wxyz: np.ndarray  # [F, J, 4]
    facing: np.ndarray  # [F, 3]
    ankle: np.ndarray  # [F, 2, 3]
    on_ground: np.ndarray  # [F, 2] bool
    clip_of_frame: np.ndarray  # [F]


class Build(NamedTuple):
    """The skeleton's arrays."""

    parents: np.ndarray  # [J]
    offsets: np.ndarray  # [J, 3]
    legs: np.ndarray  # [2, 3] thigh, shin and foot joints
    below: np.ndarray  # [2, N] what hangs from each thigh, itself first, then -1


class Springs(NamedTuple):
    """Half-lives [s] of offsets, and how far [m] a planted foot may be held from the capture's."""

    joint: float
    root: float
    reaction: float
    longest_foot_offset: float


class Offsets(NamedTuple):
    """What is shown besides the capture, and how it moves."""

    joint: np.ndarray  # [K, J, 3] rotation vectors
    joint_velocity: np.ndarray
    root: np.ndarray  # [K, 3] m
    root_velocity: np.ndarray
    foot: np.ndarray  # [K, 2, 3] m
    foot_velocity: np.ndarray
    reaction: np.ndarray  # [K, J, 3] rotation vectors
    reaction_velocity: np.ndarray


class Poses(NamedTuple):
    """What is shown."""

    root_position: np.ndarray  # [K, 3]
    wxyz: np.ndarray  # [K, J, 4]
    position: np.ndarray  # [K, J, 3]
    world_wxyz: np.ndarray  # [K, J, 4]


class Played(NamedTuple):
    """K characters, what they are played from and what is shown."""

    frame: np.ndarray  # [K] library frame shown
    fraction: np.ndarray  # [K] of the way to the next, in [0, 1)
    rate: np.ndarray  # [K] library frames per shown frame
    pace: np.ndarray  # [K] the rate that led to what is shown
    stop: np.ndarray  # [K] last frame of the action
    anchor: np.ndarray  # [K, 3] library world → scene
    jump: np.ndarray  # [K] bool, whether the last action began with a join
    first: np.ndarray  # [L] frames of the stretches
    last: np.ndarray  # [L]
    blow_of_frame: np.ndarray  # [F, 4]
    held: np.ndarray  # [K] bool, shows its pose of offsets as it is: no spring moves it on
    springs: Springs
    capture: Capture
    build: Build
    offsets: Offsets
    poses: Poses


@kernel
def exponential(v, out):
    """Quaternion of a rotation vector."""
    angle = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    s = np.sin(0.5 * angle) / angle if angle > 1e-9 else 0.5
    out[0] = np.cos(0.5 * angle)
    for c in range(3):
        out[1 + c] = s * v[c]


@kernel
def logarithm(q, out):
    """Rotation vector of the shortest arc of a quaternion."""
    sign = -1.0 if q[0] < 0.0 else 1.0
    s = np.sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    scale = sign * (2.0 * np.arctan2(s, sign * q[0]) / s if s > 1e-9 else 2.0)
    for c in range(3):
        out[c] = scale * q[1 + c]


@kernel
def conjugate(q, out):
    out[0] = q[0]
    for c in range(1, 4):
        out[c] = -q[c]


@kernel
def difference(a, b, out):
    """Rotation vector of a⁻¹ b."""
    inverse = np.empty(4)
    product = np.empty(4)
    conjugate(a, inverse)
    quaternion_product(inverse, b, product)
    logarithm(product, out)


@kernel
def planar_point(t, x, z):
    """A ground point carried by a planar transform (x, z, yaw)."""
    c, s = np.cos(t[2]), np.sin(t[2])
    return c * x + s * z + t[0], -s * x + c * z + t[1]


@kernel
def add_movement(point, first, last, anchor, scale, out):
    """Add to ``out`` [3] how a library point [F, 3] moves from frame to frame, in the scene."""
    x0, z0 = planar_point(anchor, point[first, 0], point[first, 2])
    x1, z1 = planar_point(anchor, point[last, 0], point[last, 2])
    out[0] += scale * (x1 - x0)
    out[1] += scale * (point[last, 1] - point[first, 1])
    out[2] += scale * (z1 - z0)


@kernel
def wrap(angle):
    return angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi))


@kernel
def align(anchor, facing_from, facing_to, out):
    """The anchor under which ``facing_to`` lies where ``facing_from`` lay under ``anchor``."""
    x, z = planar_point(anchor, facing_from[0], facing_from[1])
    yaw = anchor[2] + facing_from[2] - facing_to[2]
    c, s = np.cos(yaw), np.sin(yaw)
    out[0] = x - (c * facing_to[0] + s * facing_to[1])
    out[1] = z - (-s * facing_to[0] + c * facing_to[1])
    out[2] = wrap(yaw)


@kernel
def spring(position, velocity, half_life, dt):
    """One step of a critically damped spring to zero, in place: exact for any dt."""
    y = 2.0 * LN2 / half_life
    decay(position, velocity, y, np.exp(-y * dt), dt)


@kernel
def decay(position, velocity, y, e, dt):
    """:func:`spring` with its rate y [1/s] and what that leaves after dt, e, worked out before."""
    for c in range(position.shape[0]):
        j = velocity[c] + position[c] * y
        position[c] = e * (position[c] + j * dt)
        velocity[c] = e * (velocity[c] - j * y * dt)


@kernel
def anchored_root(anchor, root_position, root_wxyz, position, wxyz):
    """A library root pose in the scene."""
    x, z = planar_point(anchor, root_position[0], root_position[2])
    position[0] = x
    position[1] = root_position[1]
    position[2] = z
    turn = np.zeros(4)
    turn[0] = np.cos(0.5 * anchor[2])
    turn[2] = np.sin(0.5 * anchor[2])
    quaternion_product(turn, root_wxyz, wxyz)


@kernel
def join(k, frame_from, frame_to, anchor, capture, offsets):
    """Move character k from frame_from to frame_to = j - 1, which it resembles, in place.

    What was shown stays shown: the differences go into the offsets.
    """
    now, then = Phase(frame_from, 0.0, 1.0), Phase(frame_to, 0.0, 1.0)
    join_at(k, frame_from, frame_to, now, then, anchor, capture, offsets)


@kernel
def join_at(k, frame_from, frame_to, now, then, anchor, capture, offsets):
    """:func:`join` of a character that is at phase ``now`` and is to be at phase ``then``.

    The facing frames of the two frames are laid on each other, so that a path over the ground does
    not depend on how fast it is gone.
    """
    here = anchor[k]
    before = np.empty(3)
    for c in range(3):
        before[c] = here[c]
    align(before, capture.facing[frame_from], capture.facing[frame_to], here)
    joints = capture.wxyz.shape[1]
    # Of the source and of the target each: a shown frame before, and now.
    places, turns = np.empty((4, 3, 3)), np.empty((4, joints, 4))
    ratio_from = sample_moving(capture, now, places[:2], turns[:2])
    ratio_to = sample_moving(capture, then, places[2:], turns[2:])
    held, shown, turn, base = np.empty(4), np.empty(4), np.empty(4), np.empty(4)
    p_from, p_to = np.empty(3), np.empty(3)
    v, w = np.zeros(3), np.zeros(3)
    for j in range(joints):
        exponential(offsets.joint[k, j], held)
        if j == 0:
            anchored_root(before, places[1, 0], turns[1, 0], p_from, turn)
            anchored_root(here, places[3, 0], turns[3, 0], p_to, base)
        else:
            for c in range(4):
                turn[c], base[c] = turns[1, j, c], turns[3, j, c]
        quaternion_product(turn, held, shown)
        difference(base, shown, offsets.joint[k, j])
        difference(turns[0, j], turns[1, j], v)
        difference(turns[2, j], turns[3, j], w)
        for c in range(3):
            change = ratio_from * v[c] - ratio_to * w[c]
            offsets.joint_velocity[k, j, c] += change * capture.fps
    fps_from, fps_to = capture.fps * ratio_from, capture.fps * ratio_to
    for c in range(3):
        offsets.root[k, c] += p_from[c] - p_to[c]
    add_movement(places[:, 0], 0, 1, before, fps_from, offsets.root_velocity[k])
    add_movement(places[:, 0], 2, 3, here, -fps_to, offsets.root_velocity[k])
    for f in range(2):
        ankle = places[:, 1 + f]
        add_movement(ankle, 0, 1, before, fps_from, offsets.foot_velocity[k, f])
        add_movement(ankle, 2, 3, here, -fps_to, offsets.foot_velocity[k, f])
        x0, z0 = planar_point(before, ankle[1, 0], ankle[1, 2])
        x1, z1 = planar_point(here, ankle[3, 0], ankle[3, 2])
        offsets.foot[k, f, 0] += x0 - x1
        offsets.foot[k, f, 1] += ankle[1, 1] - ankle[3, 1]
        offsets.foot[k, f, 2] += z0 - z1


@kernel
def turned_rate(turn, velocity, out):
    """Rate of a rotation vector whose rotation turns with ``velocity`` [rad/s], in turned axes.

    The inverse of the right Jacobian of the exponential: v + turn × v / 2 + c turn × (turn × v).
    """
    angle = np.sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    if angle > 1e-3:
        c = 1.0 / angle**2 - 0.5 / (angle * np.tan(0.5 * angle))
    else:
        c = 1.0 / 12.0
    x, y, z = turn[0], turn[1], turn[2]
    ax = y * velocity[2] - z * velocity[1]
    ay = z * velocity[0] - x * velocity[2]
    az = x * velocity[1] - y * velocity[0]
    out[0] = velocity[0] + 0.5 * ax + c * (y * az - z * ay)
    out[1] = velocity[1] + 0.5 * ay + c * (z * ax - x * az)
    out[2] = velocity[2] + 0.5 * az + c * (x * ay - y * ax)


@kernel
def adopt(k, frame, rate, anchor, shown, moving, ankles, stepping, capture, offsets):
    """Let character k go on from a pose of its own as if it had come to a frame, in place.

    shown [J + 1, 4]: the root's place (and one number more), then local rotations; moving
    [J + 1, 3]: their velocities, m/s and rad/s in joint axes; ankles, stepping [2, 3]: where the
    pose has them and how they move. The anchor [K, 3] is the one under which the frame is played,
    and the capture moves at ``rate`` there. All that differs from the capture goes into the
    offsets: place and velocity stay.
    """
    here, joints = anchor[k], capture.wxyz.shape[1]
    places, turns = np.empty((2, 3, 3)), np.empty((2, joints, 4))
    fps = capture.fps * sample_moving(capture, Phase(frame, 0.0, rate), places, turns)
    place, base, v, back = np.empty(3), np.empty(4), np.empty(3), np.empty(4)
    carried, none = np.empty(3), np.zeros(3)
    anchored_root(here, places[1, 0], turns[1, 0], place, base)
    for j in range(joints):
        if j > 0:
            for c in range(4):
                base[c] = turns[1, j, c]
        turn = offsets.joint[k, j]
        difference(base, shown[1 + j], turn)
        difference(turns[0, j], turns[1, j], v)
        exponential(-turn, back)
        add_rotated(back, v, none, carried)  # the capture's own, in the axes of the pose shown
        for c in range(3):
            carried[c] = moving[1 + j, c] - carried[c] * fps
        turned_rate(turn, carried, offsets.joint_velocity[k, j])
    for c in range(3):
        offsets.root[k, c] = shown[0, c] - place[c]
        offsets.root_velocity[k, c] = moving[0, c]
    add_movement(places[:, 0], 0, 1, here, -fps, offsets.root_velocity[k])
    for f in range(2):
        ankle = places[:, 1 + f]
        x, z = planar_point(here, ankle[1, 0], ankle[1, 2])
        offsets.foot[k, f, 0] = ankles[f, 0] - x
        offsets.foot[k, f, 1] = ankles[f, 1] - ankle[1, 1]
        offsets.foot[k, f, 2] = ankles[f, 2] - z
        for c in range(3):
            offsets.foot_velocity[k, f, c] = stepping[f, c]
        add_movement(ankle, 0, 1, here, -fps, offsets.foot_velocity[k, f])
    offsets.reaction[k] = 0.0
    offsets.reaction_velocity[k] = 0.0


@kernel
def give_way(axes, owner, levers, displacement, shares, damping, turn):
    """Turns [N, 3] of joints that move a point by about ``displacement`` [3], damped least squares.

    axes [M, 3]: about which joint owner [M] may turn; levers [N, 3]: from the joints to the point.
    Joint n gives way shares^n times as readily as the first. Added to ``turn``.
    """
    moves = np.empty((axes.shape[0], 3))
    normal = np.zeros((3, 3))
    for m in range(axes.shape[0]):
        ax, ay, az = axes[m]
        x, y, z = levers[owner[m]]
        moves[m, 0], moves[m, 1], moves[m, 2] = ay * z - az * y, az * x - ax * z, ax * y - ay * x
        ready = shares ** owner[m]
        for r in range(3):
            for c in range(3):
                normal[r, c] += ready * moves[m, r] * moves[m, c]
    more = damping * (normal[0, 0] + normal[1, 1] + normal[2, 2]) + 1e-9
    for r in range(3):
        normal[r, r] += more
    # normal w = displacement by cofactors: it is symmetric and positive definite.
    a, b, c = normal[0]
    d, e, f = normal[1, 1], normal[1, 2], normal[2, 2]
    ca, cb, cc = d * f - e * e, c * e - b * f, b * e - c * d
    one = a * ca + b * cb + c * cc
    u, v, w = displacement
    x = (ca * u + cb * v + cc * w) / one
    y = (cb * u + (a * f - c * c) * v + (b * c - a * e) * w) / one
    z = (cc * u + (b * c - a * e) * v + (a * d - b * b) * w) / one
    for m in range(axes.shape[0]):
        angle = shares ** owner[m] * (moves[m, 0] * x + moves[m, 1] * y + moves[m, 2] * z)
        for k in range(3):
            turn[owner[m], k] += angle * axes[m, k]


@kernel
def move_feet(foot_offset, foot_velocity, planted, and_planted, half_life, longest, dt):
    """Offsets of the two feet over one frame: held on the ground, faded in the air, in place.

    planted, and_planted [2]: whether a foot stands in the frames before and after the phase shown.
    On the way from a frame in which it stands to one in which it does not, it moves.

    An offset longer than ``longest`` [m] fades on the ground too: better a slip than a split.
    """
    for f in range(2):
        # Height always fades: a foot must not stand in the air.
        spring(foot_offset[f, 1:2], foot_velocity[f, 1:2], half_life, dt)
        far = foot_offset[f, 0] ** 2 + foot_offset[f, 2] ** 2 > longest * longest
        if planted[f] and and_planted[f] and not far:
            foot_velocity[f, 0] = 0.0
            foot_velocity[f, 2] = 0.0
        else:
            spring(foot_offset[f, 0:1], foot_velocity[f, 0:1], half_life, dt)
            spring(foot_offset[f, 2:3], foot_velocity[f, 2:3], half_life, dt)


@kernel
def turned_by(x, y, z):
    """Quaternion of a rotation vector, in scalars."""
    a2 = x * x + y * y + z * z
    if a2 < 1e-3:  # the series is exact to a rounding there
        w = 1.0 - a2 * (0.125 - a2 * (1.0 / 384.0 - a2 / 46080.0))
        s = 0.5 - a2 * (1.0 / 48.0 - a2 * (1.0 / 3840.0 - a2 / 645120.0))
    else:
        angle = np.sqrt(a2)
        w = np.cos(0.5 * angle)
        s = np.sin(0.5 * angle) / angle
    return w, s * x, s * y, s * z


@kernel
def show_one(k, dt, played):
    """One frame of character k of :func:`show`."""
    f, part, anchor = played.frame[k], played.fraction[k], played.anchor
    if played.held[k]:
        dt = 0.0
    springs, capture, build = played.springs, played.capture, played.build
    offsets, poses = played.offsets, played.poses
    g = following(capture.clip_of_frame, f) if part > 0.0 else f
    root_position, wxyz = poses.root_position[k], poses.wxyz[k]
    position, world = poses.position[k], poses.world_wxyz[k]
    spring(offsets.root[k], offsets.root_velocity[k], springs.root, dt)
    move_feet(
        offsets.foot[k],
        offsets.foot_velocity[k],
        capture.on_ground[f],
        capture.on_ground[g],
        springs.joint,
        springs.longest_foot_offset,
        dt,
    )
    held, held_velocity = offsets.joint[k], offsets.joint_velocity[k]
    pushed, pushed_velocity = offsets.reaction[k], offsets.reaction_velocity[k]
    quick, slow = 2.0 * LN2 / springs.joint, 2.0 * LN2 / springs.reaction
    left_quick, left_slow = np.exp(-quick * dt), np.exp(-slow * dt)
    root_wxyz = np.empty(4)
    if part > 0.0:
        root, turn = np.empty(3), np.empty(4)
        for c in range(3):
            root[c] = capture.root[f, c] + part * (capture.root[g, c] - capture.root[f, c])
        turn[0], turn[1], turn[2], turn[3] = part_way(capture.wxyz, f, g, 0, part)
        anchored_root(anchor[k], root, turn, root_position, root_wxyz)
    else:
        anchored_root(anchor[k], capture.root[f], capture.wxyz[f, 0], root_position, root_wxyz)
    for c in range(3):
        root_position[c] += offsets.root[k, c]
    parents, bones = build.parents, build.offsets
    for j in range(wxyz.shape[0]):
        struck = False
        for c in range(3):
            change = held_velocity[j, c] + held[j, c] * quick
            held[j, c] = left_quick * (held[j, c] + change * dt)
            held_velocity[j, c] = left_quick * (held_velocity[j, c] - change * quick * dt)
            struck = struck or pushed_velocity[j, c] != 0.0
        w, x, y, z = turned_by(held[j, 0], held[j, 1], held[j, 2])
        if struck:
            for c in range(3):
                change = pushed_velocity[j, c] + pushed[j, c] * slow
                pushed[j, c] = left_slow * (pushed[j, c] + change * dt)
                pushed_velocity[j, c] = left_slow * (pushed_velocity[j, c] - change * slow * dt)
            a, b, c_, d = turned_by(pushed[j, 0], pushed[j, 1], pushed[j, 2])
            w, x, y, z = product(w, x, y, z, a, b, c_, d)
        if j == 0:
            w, x, y, z = product(root_wxyz[0], root_wxyz[1], root_wxyz[2], root_wxyz[3], w, x, y, z)
            wxyz[0, 0], wxyz[0, 1], wxyz[0, 2], wxyz[0, 3] = w, x, y, z
            world[0, 0], world[0, 1], world[0, 2], world[0, 3] = w, x, y, z
            for c in range(3):
                position[0, c] = root_position[c]
            continue
        q = capture.wxyz
        a, b, c_, d = q[f, j, 0], q[f, j, 1], q[f, j, 2], q[f, j, 3]
        if part > 0.0:
            a, b, c_, d = part_way(q, f, g, j, part)
        w, x, y, z = product(a, b, c_, d, w, x, y, z)
        wxyz[j, 0], wxyz[j, 1], wxyz[j, 2], wxyz[j, 3] = w, x, y, z
        pose_joint(j, parents, bones, wxyz, position, world)
    goal = np.empty(3)
    for s in range(2):
        ankle = capture.ankle
        a, b, c_ = ankle[f, s, 0], ankle[f, s, 1], ankle[f, s, 2]
        if part > 0.0:
            a += part * (ankle[g, s, 0] - a)
            b += part * (ankle[g, s, 1] - b)
            c_ += part * (ankle[g, s, 2] - c_)
        x, z = planar_point(anchor[k], a, c_)
        goal[0] = x + offsets.foot[k, s, 0]
        goal[1] = b + offsets.foot[k, s, 1]
        goal[2] = z + offsets.foot[k, s, 2]
        thigh, shin, foot = build.legs[s, 0], build.legs[s, 1], build.legs[s, 2]
        reach(thigh, shin, foot, build.below[s], goal, parents, bones, wxyz, position, world)


class Own(NamedTuple):
    """What a :class:`Played` has besides its tuples."""

    frame: np.ndarray
    fraction: np.ndarray
    rate: np.ndarray
    pace: np.ndarray
    stop: np.ndarray
    anchor: np.ndarray
    jump: np.ndarray
    first: np.ndarray
    last: np.ndarray
    blow_of_frame: np.ndarray
    held: np.ndarray


@kernel
def own_of(p):
    return Own(
        p.frame,
        p.fraction,
        p.rate,
        p.pace,
        p.stop,
        p.anchor,
        p.jump,
        p.first,
        p.last,
        p.blow_of_frame,
        p.held,
    )


@kernel
def show_part(k, dt, own, springs, capture, build, offsets, poses):
    """:func:`show_one` of what makes a :class:`Played`."""
    whole = Played(
        own.frame,
        own.fraction,
        own.rate,
        own.pace,
        own.stop,
        own.anchor,
        own.jump,
        own.first,
        own.last,
        own.blow_of_frame,
        own.held,
        springs,
        capture,
        build,
        offsets,
        poses,
    )
    show_one(k, dt, whole)


def _show(dt, own, springs, capture, build, offsets, poses):
    for k in prange(own.frame.shape[0]):
        show_part(k, dt, own, springs, capture, build, offsets, poses)


_show_many = parallel_kernel(_show)


@kernel
def show(dt, played):
    """One frame of all characters: offsets move on by dt, poses are made, feet put down."""
    for k in range(played.frame.shape[0]):
        show_one(k, dt, played)


@kernel
def show_many(dt, played):
    """:func:`show` on all cores: worth its start-up from ``MANY`` characters on."""
    p = played  # a loop on all cores is handed tuples of arrays, but none that hold others
    _show_many(dt, own_of(p), p.springs, p.capture, p.build, p.offsets, p.poses)


@kernel
def begin(who, stretch, played):
    """Characters who [W] take the stretches [K] they chose; jump [K]: whether it was a join.

    Who would pass the end of its action with the next frame has the rest of the way to it before
    what it takes, so that the time a chain of actions takes is exact; at a join, as far as the
    clip reaches back. Who breaks an action off begins the next at once.
    """
    for w in range(who.shape[0]):
        k = who[w]
        frame, fraction, rate = played.frame[k], played.fraction[k], played.rate[k]
        left = (played.stop[k] - frame) - fraction
        target = played.first[stretch[k]] - 1
        ends = left >= 0.0 and left < rate - AT_FRAME
        source = played.stop[k] if ends else frame
        played.stop[k] = played.last[stretch[k]]
        played.jump[k] = target != source or (fraction > 0.0 and not ends)
        if not played.jump[k]:
            continue
        clip_of_frame = played.capture.clip_of_frame
        to, part = earlier(clip_of_frame, target, 0.0, left if ends else 0.0)
        now, then = Phase(frame, fraction, played.pace[k]), Phase(to, part, rate)
        join_at(k, source, target, now, then, played.anchor, played.capture, played.offsets)
        played.frame[k], played.fraction[k] = to, part
