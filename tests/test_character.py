"""Characters played from a library: joins, springs, inverse kinematics, foot lock, reactions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kumite import rotation
from kumite.clip import SIDES, forward_kinematics
from kumite.graph import Layer
from kumite.kernels import character as kernels
from kumite.kernels import pose
from kumite.synthesis import Cast
from kumite.synthesis.cast import _below
from kumite.synthesis.recoil import MOST_GIVEN, RECOIL
from tests import toys

FRONT = np.array([0.0, 0.0, 1.0])


@pytest.mark.jit_off
@settings(max_examples=40, deadline=None)
@given(st.floats(-2, 2), st.floats(-20, 20), st.floats(0.02, 0.5), st.floats(0.001, 0.5))
def test_springs_solve_their_equation(x, v, half_life, t):
    """Critically damped: x'' = -2 y x' - y² x; checked against many tiny steps of it."""
    position, velocity = np.array([x]), np.array([v])
    kernels.spring(position, velocity, half_life, t)
    y = 2 * np.log(2) / half_life
    a, b = x, v
    steps = 4000
    dt = t / steps
    for _ in range(steps):  # midpoint rule
        ma, mb = a + 0.5 * dt * b, b + 0.5 * dt * (-2 * y * b - y * y * a)
        a, b = a + dt * mb, b + dt * (-2 * y * mb - y * y * ma)
    scale = abs(x) + abs(v) * half_life
    assert position[0] == pytest.approx(a, abs=1e-3 * scale + 1e-9)
    assert velocity[0] == pytest.approx(b, abs=1e-3 * scale * y + 1e-9)


@pytest.mark.jit_off
@settings(max_examples=40, deadline=None)
@given(st.integers(0, 100_000))
def test_two_bone_reach(seed):
    """The foot gets where it should, keeps its world rotation, and no bone changes its length."""
    rng = np.random.default_rng(seed)
    s = toys.skeleton()
    wxyz = rotation.exp(rng.normal(0, 0.3, (len(s), 3)))
    wxyz[s.joint("left_shin")] = rotation.from_axis_angle([1, 0, 0], rng.uniform(0.2, 2.0))
    root = rng.normal(0, 1, 3)
    position, world = (a[0] for a in forward_kinematics(s, root[None], wxyz[None]))
    hip, knee, foot = (s.joint(f"left_{p}") for p in ("thigh", "shin", "foot"))
    goal = position[hip] + rng.normal(0, 1, 3) * 0.4
    length = np.linalg.norm(goal - position[hip])
    kept = world[foot].copy()
    w, p, q = wxyz.copy(), position.copy(), world.copy()
    below = _below(s, [[hip, knee, foot]])[0]
    kernels.reach(hip, knee, foot, below, goal, s.parents, s.offsets, w, p, q)
    again, turned = (a[0] for a in forward_kinematics(s, root[None], w[None]))
    assert np.allclose(again, p, atol=1e-9)
    assert rotation.angle(turned[foot], kept) < 1e-6
    bones = np.linalg.norm(s.offsets[[knee, foot]], axis=1)
    if abs(bones[0] - bones[1]) + 1e-3 < length < 0.998 * bones.sum():
        assert np.allclose(again[foot], goal, atol=1e-6)
    else:
        assert np.dot(again[foot] - again[hip], goal - again[hip]) > 0
    others = [j for j in range(len(s)) if j not in (knee, foot, s.joint("left_toe"))]
    assert np.allclose(again[others], position[others], atol=1e-12)


@pytest.mark.jit_off
def test_a_straight_leg_bends_its_knee_forward():
    s = toys.skeleton()
    straight = s.offsets.copy()
    straight[:, 2] = 0.0
    wxyz = np.tile([1.0, 0.0, 0.0, 0.0], (len(s), 1))
    root = np.array([0.0, toys.HIP_HEIGHT, 0.0])
    position, world = (np.empty((len(s), n)) for n in (3, 4))
    pose.forward_kinematics_frame(s.parents, straight, root, wxyz, position, world)
    hip, knee, foot = (s.joint(f"right_{p}") for p in ("thigh", "shin", "foot"))
    goal = position[foot] + [0.0, 0.2, 0.0]
    below = _below(s, [[hip, knee, foot]])[0]
    kernels.reach(hip, knee, foot, below, goal, s.parents, straight, wxyz, position, world)
    assert np.allclose(position[foot], goal, atol=1e-5)
    assert position[knee, 2] > 0.2


@pytest.mark.jit_off
@pytest.mark.parametrize("seed", range(5))
def test_what_is_shown_goes_on_through_a_join(seed):
    """Place and velocity of the root and the ankles, turns of the joints, at any two frames."""
    rng = np.random.default_rng(seed)
    fps, at, to, joints = 30.0, 1, 4, 3
    clip = np.array([0, 0, 0, 1, 1, 1], np.int32)
    root, facing = rng.normal(0, 1, (2, 6, 3))
    ankle = rng.normal(0, 1, (6, 2, 3))
    wxyz = rotation.exp(rng.normal(0, 0.5, (6, joints, 3)))
    anchor = rng.normal(0, 1, 3)
    offset, spin = rng.normal(0, 0.3, (2, joints, 3))
    root_offset, root_velocity = rng.normal(0, 0.3, (2, 3))
    foot_offset, foot_velocity = rng.normal(0, 0.3, (2, 2, 3))

    def shown(frame: int):
        past = [rotation.planar_apply(anchor, p[frame - 1]) for p in (root, ankle)]
        now = [rotation.planar_apply(anchor, p[frame]) for p in (root, ankle)]
        base = wxyz[frame].copy()
        base[0] = rotation.multiply(rotation.from_yaw(anchor[2]), base[0])
        turned = rotation.multiply(base, rotation.exp(offset))
        return (
            now[0] + root_offset,
            (now[0] - past[0]) * fps + root_velocity,
            now[1] + foot_offset,
            (now[1] - past[1]) * fps + foot_velocity,
            turned * np.sign(turned[:, :1]),
        )

    before = shown(at)
    stood = rotation.planar_compose(anchor, facing[at])
    state = (offset, spin, root_offset, root_velocity, foot_offset, foot_velocity, spin, spin)
    ground = np.ones((6, 2), bool)
    kernels.join(
        0,
        at,
        to,
        anchor[None],
        kernels.Capture(fps, root, wxyz, facing, ankle, ground, clip),
        kernels.Offsets(*(x[None] for x in state)),
    )
    for a, b in zip(before, shown(to)):
        assert np.allclose(a, b, atol=1e-9)
    stands = rotation.planar_compose(anchor, facing[to])
    assert np.allclose(stood[:2], stands[:2])
    assert rotation.wrap_angle(stood[2] - stands[2]) == pytest.approx(0, abs=1e-9)


def _walk(library: Layer, frames: int, seed: int):
    """A cast of two that takes random actions: positions, contacts and joins by frame."""
    cast, rng = Cast(library, 2), np.random.default_rng(seed)
    table = library.table
    for k in range(2):
        cast.place(k, int(rng.integers(table.states)), np.array([k * 2.0, 0.0, k * 3.0]))
    cast.show(0.0)
    position, joined = [cast.position.copy()], [np.zeros(2, bool)]
    contacts, root = [cast.contacts], [cast.root_position.copy()]
    for _ in range(frames):
        jump = np.zeros(2, bool)
        stretch = np.zeros(2, dtype=np.int64)
        who = cast.waiting
        for k in who:
            s = int(np.searchsorted(table.state_frame, cast.frame[k]))
            a = table.actions_of(s)
            stretch[k] = table.stretch[rng.integers(a.start, a.stop)]
        cast.begin(who, stretch)
        jump[who] = cast.jump[who]
        cast.advance()
        position.append(cast.position.copy())
        joined.append(jump)
        contacts.append(cast.contacts)
        root.append(cast.root_position.copy())
    return cast, *(np.array(x) for x in (position, contacts, root, joined))


def test_bones_keep_their_lengths(library: Layer):
    _, position, *_ = _walk(library, 200, 1)
    s = library.clips.skeleton
    bones = np.linalg.norm(position[:, :, 1:] - position[:, :, s.parents[1:]], axis=-1)
    assert np.allclose(bones, np.linalg.norm(s.offsets[1:], axis=1), atol=1e-9)


def test_without_joins_the_capture_is_played_as_it_is(library: Layer):
    cast = Cast(library, 1)
    table, clips = library.table, library.clips
    state = next(
        s
        for s in range(table.states)
        if np.any(table.first[table.stretch[table.actions_of(s)]] == table.state_frame[s] + 1)
    )
    f = int(table.state_frame[state])
    k = int(np.flatnonzero(table.first == f + 1)[0])
    cast.place(0, state, clips.facing[f])
    cast.begin(np.array([0]), np.array([k]))
    assert not cast.jump[0]
    position, _ = clips.world
    while cast.frame[0] < cast.stop[0]:
        cast.advance()
        assert np.allclose(cast.position[0], position[cast.frame[0]], atol=2e-3)


def test_joins_do_not_jump(library: Layer):
    """Poses, and the speed of every joint, change at a join as they do elsewhere."""
    _, position, _, _, joined = _walk(library, 2000, 2)
    fps = library.clips.fps
    velocity = np.diff(position, axis=0) * fps
    change = np.linalg.norm(np.diff(velocity, axis=0), axis=-1).max(axis=-1)  # [F - 2, K]
    at_join = joined[1:-1]
    source, _ = library.clips.world
    same = np.diff(library.clips.clip_of_frame) == 0
    natural = np.linalg.norm(np.diff(np.diff(source, axis=0) * fps, axis=0), axis=-1).max(axis=-1)
    natural = natural[same[1:] & same[:-1]]
    assert at_join.sum() > 20
    assert np.median(change[at_join]) < np.quantile(natural, 0.95)
    assert change[at_join].max() < 1.5 * natural.max()


def test_planted_feet_hold(library: Layer):
    _, position, contacts, *_ = _walk(library, 2000, 3)
    s = library.clips.skeleton
    fps = library.clips.fps
    source, _ = library.clips.world

    def skate(p, planted):
        out = []
        for i, side in enumerate(SIDES):
            v = np.linalg.norm(np.diff(p[:, s.joint(f"{side}_foot")][:, [0, 2]], axis=0), axis=1)
            out.append(v[planted[1:, i] & planted[:-1, i]] * fps)
        return np.concatenate(out).mean()

    ground = library.contacts.on_ground.copy()
    ground[library.clips.clip_start[:-1]] = False
    yardstick = skate(source, ground)
    for k in range(2):
        assert skate(position[:, k], contacts[:, k]) < 1.5 * yardstick + 0.01


def test_shifting_a_body_leaves_its_planted_feet(library: Layer):
    cast = Cast(library, 1)
    states = library.table.state_frame
    both = int(np.flatnonzero(library.contacts.on_ground[states].all(axis=1))[0])
    cast.place(0, both, np.zeros(3))
    cast.show(0.0)
    s = library.clips.skeleton
    feet = [s.joint("left_foot"), s.joint("right_foot")]
    before, root = cast.position[0, feet].copy(), cast.root_position[0].copy()
    cast.anchor[0, :2] += [0.02, -0.01]
    cast.foot_offset[0] -= [0.02, 0.0, -0.01]
    cast.show(0.0)
    assert np.allclose(cast.root_position[0] - root, [0.02, 0, -0.01], atol=1e-9)
    assert np.allclose(cast.position[0, feet], before, atol=2e-3)


def test_a_struck_head_gives_way_along_the_blow_and_recovers(library: Layer):
    cast = Cast(library, 1)
    cast.place(0, 0, np.zeros(3))
    cast.show(0.0)
    s = library.clips.skeleton
    head = s.joint("head")
    rest = cast.position[0].copy()
    blow = np.array([0.08, 0.0, 0.0])
    cast.strike(0, head, rest[head] + [0, 0.08, 0], blow)
    moved = []
    for _ in range(90):
        cast.show(1 / 60)
        moved.append(cast.position[0, head] - rest[head])
    moved = np.array(moved)
    assert 0.02 < moved[:, 0].max() < 0.12
    assert abs(moved[:, [1, 2]]).max() < 0.5 * moved[:, 0].max()
    assert np.linalg.norm(moved[-1]) < 2e-3
    feet = [s.joint("left_foot"), s.joint("right_foot")]
    assert np.allclose(cast.position[0, feet], rest[feet], atol=2e-3)


def _elbow(cast: Cast, side: str) -> float:
    """How far an elbow is bent [rad]."""
    joint = cast.library.clips.skeleton.joint
    at = [cast.position[0, joint(f"{side}_{p}")] for p in ("upper_arm", "forearm", "hand")]
    upper, fore = at[1] - at[0], at[2] - at[1]
    return float(np.arctan2(np.linalg.norm(np.cross(upper, fore)), upper @ fore))


@pytest.mark.parametrize("part", ["upper_arm", "forearm", "hand"])
def test_a_struck_arm_gives_way_and_recovers(library: Layer, part: str):
    """A blow of 6 m/s against a guard, beside the same guard that nobody strikes."""
    joint = library.clips.skeleton.joint
    far = {"upper_arm": "forearm", "forearm": "hand", "hand": "hand"}[part]
    for state in range(0, library.table.states, 7):
        struck, left = Cast(library, 1), Cast(library, 1)
        for cast in (struck, left):
            cast.place(0, state, np.zeros(3))
            cast.show(0.0)
        here = [joint(f"left_{part}"), joint(f"left_{far}")]
        struck.strike(0, here[0], left.position[0, here].mean(axis=0), RECOIL * 6 * -FRONT)
        moved, trunk, bent = [np.zeros(3)], [], []
        for _ in range(36):
            for cast in (struck, left):
                cast.show(1 / 60)
            moved.append((struck.position[0, here] - left.position[0, here]).mean(axis=0))
            neck = joint("head")
            trunk.append(np.linalg.norm(struck.position[0, neck] - left.position[0, neck]))
            bent.append(_elbow(struck, "left") - _elbow(left, "left"))
        moved = np.array(moved)
        away = np.linalg.norm(moved, axis=1)
        assert 0.04 <= away.max() <= 0.12
        assert moved[away.argmax()] @ -FRONT > 0.8 * away.max()  # along the blow
        assert away.argmax() <= 8 and away[30] < 0.2 * away.max()  # frames of 1/60 s
        assert np.all(np.diff(away[away.argmax() :]) < 0)  # back without swinging over
        # Continuous: no faster than a spring of that peak and half-life.
        assert np.abs(np.diff(moved, axis=0)).max() < away.max() * np.e * np.log(4) / 0.16 / 60
        assert min(bent) > -1e-6 and _elbow(left, "left") + max(bent) < np.radians(151)
        assert 0.002 < max(trunk) < 0.5 * away.max()  # the trunk has its share


def test_a_blow_that_would_open_an_elbow_is_left_to_the_shoulder(library: Layer):
    joint = library.clips.skeleton.joint
    cast = Cast(library, 1)
    cast.place(0, 0, np.zeros(3))
    cast.show(0.0)
    shoulder, elbow, wrist = (joint(f"left_{p}") for p in ("upper_arm", "forearm", "hand"))
    along = cast.position[0, wrist] - cast.position[0, shoulder]
    rest, bend = cast.position[0, wrist].copy(), _elbow(cast, "left")
    cast.strike(0, elbow, rest, 0.1 * along / np.linalg.norm(along))
    for _ in range(30):
        cast.show(1 / 60)
        assert _elbow(cast, "left") == pytest.approx(bend, abs=1e-6)
        assert np.isfinite(cast.wxyz).all()


def test_many_hard_blows_turn_no_joint_out_of_its_bounds(library: Layer):
    joint = library.clips.skeleton.joint
    cast = Cast(library, 1)
    cast.place(0, 0, np.zeros(3))
    cast.show(0.0)
    rng = np.random.default_rng(0)
    for _ in range(60):
        for part in ("left_forearm", "right_upper_arm", "head", "left_hand"):
            at = cast.position[0, joint(part)] + rng.normal(0, 0.1, 3)
            cast.strike(0, joint(part), at, rng.normal(0, 0.5, 3))
        cast.show(1 / 60)
        assert np.isfinite(cast.wxyz).all()
        turned = np.linalg.norm(cast._offsets.reaction[0], axis=1)
        assert turned.max() <= MOST_GIVEN + 1e-9
    for _ in range(120):
        cast.show(1 / 60)
    assert np.abs(cast._offsets.reaction).max() < 1e-4


def test_a_waist_that_the_pelvis_carries_gives_way_too(library: Layer):
    cast = Cast(library, 1)
    cast.place(0, 0, np.zeros(3))
    cast.show(0.0)
    skeleton = library.clips.skeleton
    pelvis, head = skeleton.joint("pelvis"), skeleton.joint("head")
    rest = cast.position[0, head].copy()
    cast.strike(0, pelvis, cast.position[0, pelvis] + [0, 0.2, 0], np.array([0.03, 0.0, 0.0]))
    moved = []
    for _ in range(30):
        cast.show(1 / 60)
        moved.append(cast.position[0, head, 0] - rest[0])
    assert max(moved) > 0.03


def test_many_characters_are_what_few_are(library: Layer):
    """The kernel that runs on all cores gives the bytes of the one that does not."""
    few, many = Cast(library, 1), Cast(library, kernels.MANY + 3)
    for cast in (few, many):
        for k in range(cast.count):
            cast.place(k, 1, np.array([0.3, 0.1, 0.7]))
        first = library.table.stretch[library.table.actions_of(1)][0]
        everyone = np.arange(cast.count)
        cast.begin(everyone, np.full(cast.count, first))
        cast.advance()
    assert np.array_equal(many.wxyz, np.broadcast_to(few.wxyz, many.wxyz.shape))
    assert np.array_equal(many.position, np.broadcast_to(few.position, many.position.shape))
