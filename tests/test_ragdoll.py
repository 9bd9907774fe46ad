"""Blows that move bodies: the ragdoll, the response that follows, going on from a pose, contact."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from kumite import rotation
from kumite.annotate import find_contacts
from kumite.body import Body, keep_out, lay_body
from kumite.body.apart import DIRECTIONS, NEAR, NO_PART, posed
from kumite.clip import ClipSet, Skeleton, concatenate, facing_frame, forward_kinematics
from kumite.errors import KumiteError
from kumite.graph import Layer
from kumite.kernels import character as kernels
from kumite.kernels import overlap
from kumite.synthesis import Cast, Moment, Ragdoll, Responses, blow_impulse, find_responses
from kumite.synthesis.ragdoll import EFFECTIVE_MASS, LIMP
from kumite.synthesis.recoil import recoiling
from kumite.synthesis.response import FALL, FLINCH, SIZES, STAGGER
from tests import toys
from tests.shared import performed

SECONDS = 0.25


@pytest.fixture(scope="module")
def physics():
    return pytest.importorskip("mujoco")


def struck(clips: ClipSet, ragdoll: Ragdoll, f: int, impulse, part="head", **more):
    """A clip's frame f struck in the middle of a part, and the motion [T, J, 3] not struck."""
    s, body, frames = clips.skeleton, ragdoll.body, round(SECONDS * clips.fps)
    ahead = slice(f + 1, f + 1 + frames)
    now = Moment.between(clips.root_position[f - 1 : f + 1], clips.wxyz[f - 1 : f + 1], clips.fps)
    targets = clips.root_position[ahead], clips.wxyz[ahead]
    p = body.part(part)
    joint = int(body.joint[p])
    position, world = (x[f, joint] for x in clips.world)
    point = position + rotation.rotate(world, 0.5 * (body.start[p] + body.end[p]))
    planted = more.pop("planted", np.array([True, True]))
    out = ragdoll.push(now, targets, planted, joint, point, impulse, SECONDS, **more)
    return out, forward_kinematics(s, *targets)[0]


def standing(clips: ClipSet, count: int) -> list[int]:
    """Frames from which both feet stay on the ground, spread over a set."""
    feet = find_contacts(clips).on_ground
    ground = feet[:, 0] & feet[:, 1]
    frames = round(SECONDS * clips.fps)
    clip = clips.clip_of_frame
    fits = [
        f
        for f in range(1, len(clips) - frames - 1)
        if clip[f - 1] == clip[f + frames] and ground[f : f + frames + 1].all()
    ]
    return [fits[k] for k in np.linspace(0, len(fits) - 1, count).astype(int)]


@pytest.fixture(scope="module")
def clips(library: Layer) -> ClipSet:
    return library.clips


@pytest.fixture(scope="module")
def ragdoll(physics, clips: ClipSet) -> Ragdoll:
    return Ragdoll(clips.skeleton, lay_body(clips.skeleton), clips.fps)


@pytest.fixture(scope="module")
def stood(clips: ClipSet) -> list[int]:
    return standing(clips, 6)


# The ragdoll ------------------------------------------------------------------------------------


def test_a_free_body_moves_as_newton_says(physics):
    """One capsule in the air: v = J / m, and ω = (r × J) / I about an axis across it."""
    mass, length, radius = 6.0, 0.4, 0.1
    bone = Skeleton(("bone",), np.array([-1]), np.zeros((1, 3)))
    ends = np.array([[-length / 2, 0.0, 0.0]]), np.array([[length / 2, 0.0, 0.0]])
    one = np.array([radius])
    body = Body(("bone",), np.array([0]), *ends, one, one, np.array([mass]))
    ragdoll = Ragdoll(bone, body, 60.0, tone=LIMP, gravity=0.0)
    here, still = np.array([0.0, 2.0, 0.0]), np.zeros(3)
    now = Moment(here, rotation.IDENTITY_WXYZ[None], still, still[None])
    targets = here[None], rotation.IDENTITY_WXYZ[None, None]
    impulse, arm = np.array([0.0, 1.5, -3.0]), np.array([0.15, 0.0, 0.0])
    out = ragdoll.push(now, targets, np.zeros(2), 0, here + arm, impulse, 1 / 60, striking_mass=0.0)
    # A cylinder and two half balls, each about the middle.
    ball, tube = 4 / 3 * np.pi * radius**3, np.pi * radius**2 * length
    ball, tube = mass * ball / (ball + tube), mass * tube / (ball + tube)
    offset = length / 2 + 3 / 8 * radius
    inertia = tube * (radius**2 / 4 + length**2 / 12)
    inertia += ball * (2 / 5 * radius**2 - (3 / 8 * radius) ** 2 + offset**2)
    assert out.physical
    assert np.allclose(out.end.root_velocity, impulse / mass, atol=1e-6)
    turned = rotation.rotate(out.end.wxyz[0], out.end.joint_velocity[0])
    assert np.allclose(turned, np.cross(arm, impulse) / inertia, rtol=5e-3, atol=1e-3)
    moving = 0.5 * mass * np.sum((impulse / mass) ** 2) + 0.5 * inertia * np.sum(turned**2)
    assert out.kinetic[-1] == pytest.approx(moving, rel=1e-3)


def test_without_a_blow_the_body_goes_on(ragdoll: Ragdoll, clips: ClipSet, stood: list[int]):
    found = [struck(clips, ragdoll, f, np.zeros(3))[0] for f in stood]
    assert all(p.physical for p in found)
    mean = np.mean([p.deviation.mean() for p in found])
    print(f"built-in performer: {100 * mean:.2f} cm off on average")
    assert mean < 0.01
    assert max(p.slip for p in found) < 0.002


def test_a_real_boxer_goes_on_and_is_moved(physics, boxer: Layer):
    clips = boxer.clips
    ragdoll = Ragdoll(clips.skeleton, lay_body(clips.skeleton), clips.fps)
    head = clips.skeleton.joint("head")
    off, slips = [], []
    for f in standing(clips, 4):
        calm, meant = struck(clips, ragdoll, f, np.zeros(3))
        back = rotation.rotate(rotation.from_yaw(clips.facing[f, 2]), [0.0, 0.0, -1.0])
        hit, _ = struck(clips, ragdoll, f, 20.0 * back)
        moved = forward_kinematics(clips.skeleton, hit.root_position, hit.wxyz)[0] - meant
        assert calm.physical and hit.physical
        assert 0.06 < (moved[:, head] @ back).max() < 0.30
        off.append(calm.deviation.mean())
        slips += [calm.slip, hit.slip]
    print(f"real boxer: {100 * np.mean(off):.2f} cm off on average")
    assert np.mean(off) < 0.015
    assert max(slips) < 0.01


@pytest.mark.parametrize("part", ["head", "chest"])
def test_a_blow_moves_the_body_its_way(ragdoll, clips, stood, part: str):
    joint = int(ragdoll.body.joint[ragdoll.body.part(part)])
    for k, angle in enumerate(np.arange(6) * np.pi / 3):
        way = np.array([np.cos(angle), 0.0, np.sin(angle)])
        f = stood[k % len(stood)]
        calm, _ = struck(clips, ragdoll, f, np.zeros(3), part)
        hit, _ = struck(clips, ragdoll, f, 20.0 * way, part)
        at = [forward_kinematics(clips.skeleton, p.root_position, p.wxyz)[0] for p in (hit, calm)]
        moved = (at[0] - at[1])[:6, joint][-1] * [1, 0, 1]
        if part == "head":  # the chest's joint lies close to where the blow lands: it hardly turns
            assert moved @ way > 0.03
        assert moved @ way > 0.8 * np.linalg.norm(moved)


def test_harder_blows_move_more_and_nobody_flies(ragdoll, clips, stood):
    s = clips.skeleton
    moved = []
    for speed in (2.0, 6.0, 10.0):
        impulse = blow_impulse(np.array([0.0, 0.0, -speed]), "right_hand")
        found = [struck(clips, ragdoll, f, impulse) for f in stood]
        at = [forward_kinematics(s, p.root_position, p.wxyz)[0] - meant for p, meant in found]
        moved.append([[np.linalg.norm(x[:, s.joint(j)], axis=1).max() for j in ("head", "pelvis")]
                      for x in at])  # fmt: skip
        assert max(p.slip for p, _ in found) < 0.01
    head, pelvis = np.mean(moved, axis=1).T
    assert np.all(np.diff(head) > 0.02)
    assert np.all(np.diff(pelvis) > 0.0)
    assert 0.10 < head[2] < 0.30
    assert pelvis[2] < 0.10


def test_a_planted_foot_stays_and_a_free_one_need_not(ragdoll, clips, stood):
    s = clips.skeleton
    feet = [s.joint("left_foot"), s.joint("right_foot")]
    f = stood[2]
    stands = clips.world[0][f, feet]
    hit = np.array([25.0, 0.0, 0.0])
    gone = {}
    for planted in ((True, True), (True, False), (False, True)):
        out, _ = struck(clips, ragdoll, f, hit, "pelvis", planted=np.array(planted))
        at = forward_kinematics(s, out.root_position, out.wxyz)[0][:, feet]
        gone[planted] = np.linalg.norm(at - stands, axis=-1).max(axis=0)
        assert np.all(gone[planted][np.array(planted)] < 0.01)
        assert out.slip == pytest.approx(gone[planted][np.array(planted)].max())
    assert gone[True, False][1] > gone[True, True][1]
    assert gone[False, True][0] > gone[True, True][0]


def test_the_same_blow_gives_the_same_bytes(ragdoll, clips, stood):
    hit = np.array([5.0, 3.0, -20.0])
    first, _ = struck(clips, ragdoll, stood[1], hit)
    struck(clips, ragdoll, stood[3], 2.0 * hit, "waist")
    other = Ragdoll(clips.skeleton, lay_body(clips.skeleton), clips.fps)
    for again in (ragdoll, other):
        out, _ = struck(clips, again, stood[1], hit)
        assert out.wxyz.tobytes() == first.wxyz.tobytes()
        assert out.root_position.tobytes() == first.root_position.tobytes()
        assert out.kinetic.tobytes() == first.kinetic.tobytes()


def test_what_a_blow_brought_is_spent(ragdoll, clips, stood):
    """A body at rest, struck: its energy falls from the first frame on and is gone in a second."""
    f = stood[0]
    now = Moment(
        clips.root_position[f], clips.wxyz[f], np.zeros(3), np.zeros_like(clips.wxyz[f, :, 1:])
    )
    s = clips.skeleton
    head = s.joint("head")
    targets = clips.root_position[f : f + 1], clips.wxyz[f : f + 1]
    out = ragdoll.push(
        now, targets, np.ones(2), head, clips.world[0][f, head] + [0, 0.1, 0], [20.0, 0, 0], 1.0
    )
    brought = out.kinetic[0]
    assert 5.0 < brought < 20.0**2 / (2 * 2.5)
    assert np.all(np.diff(out.kinetic)[:4] < 0)
    assert out.kinetic[len(out.kinetic) // 2 :].max() < 0.02 * brought
    assert out.deviation[-1] < 0.01


def test_a_hand_takes_less_of_a_blow_than_a_trunk(ragdoll, clips, stood):
    hit = np.array([0.0, 0.0, -29.0])
    trunk, _ = struck(clips, ragdoll, stood[0], hit, "chest")
    hand, _ = struck(clips, ragdoll, stood[0], hit, "left_hand")
    assert np.allclose(trunk.impulse, hit)
    assert 0.5 < np.linalg.norm(hand.impulse) < 0.6 * np.linalg.norm(hit)


def test_a_blow_up_gives_way_kinematically(ragdoll, clips, stood):
    f = stood[0]
    out, meant = struck(clips, ragdoll, f, np.array([1e7, 0.0, 0.0]))
    assert not out.physical and out.why
    assert np.all(np.isfinite(out.wxyz)) and np.all(np.isfinite(out.deviation))
    at = forward_kinematics(clips.skeleton, out.root_position, out.wxyz)[0]
    head = clips.skeleton.joint("head")
    assert 0.02 < (at - meant)[:, head, 0].max() < 1.0
    calm, _ = struck(clips, ragdoll, f, np.zeros(3))  # and it leaves nothing behind
    assert calm.physical and calm.deviation.mean() < 0.02


def test_recoil_peaks_after_its_time_and_comes_back(clips):
    s = clips.skeleton
    root, wxyz = (np.repeat(x[:1], 90, axis=0) for x in (clips.root_position, clips.wxyz))
    rest = forward_kinematics(s, root, wxyz)[0]
    head = s.joint("head")
    blow = np.array([0.05, 0.0, 0.0])
    out = recoiling(s, root, wxyz, head, rest[0, head] + [0, 0.1, 0], blow, clips.fps)
    moved = np.linalg.norm((forward_kinematics(s, root, out)[0] - rest)[:, head], axis=1)
    assert 0.02 < moved.max() < 0.08
    assert 3 < np.argmax(moved) < 12
    assert moved[-1] < 2e-3


def test_what_makes_no_push_is_refused(ragdoll, clips, stood, monkeypatch):
    with pytest.raises(KumiteError, match="finite"):
        struck(clips, ragdoll, stood[0], np.array([np.nan, 0.0, 0.0]))
    now = Moment.between(clips.root_position[:2], clips.wxyz[:2], clips.fps)
    good = clips.root_position[2:4], clips.wxyz[2:4]
    for targets, joint in (
        ((good[0], good[1][:, :5]), 0),
        (good, 99),
        ((good[0][:0], good[1][:0]), 0),
    ):
        with pytest.raises(KumiteError, match="ragdoll"):
            ragdoll.push(now, targets, np.ones(2), joint, np.zeros(3), np.zeros(3), 0.1)
    with pytest.raises(KumiteError, match="expected finite"):
        Moment(np.full(3, np.inf), clips.wxyz[0], np.zeros(3), np.zeros((clips.wxyz.shape[1], 3)))
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(KumiteError, match=r"kumite\[physics\]"):
        Ragdoll(clips.skeleton, ragdoll.body, 60.0)


def test_a_kick_brings_more_than_a_fist():
    fast = np.array([0.0, 0.0, 8.0])
    assert np.allclose(blow_impulse(fast, "left_hand"), [0, 0, 8.0 * EFFECTIVE_MASS["hand"]])
    assert np.linalg.norm(blow_impulse(fast, "foot")) > np.linalg.norm(blow_impulse(fast))


def test_any_skeleton_can_be_pushed(physics):
    """Toys, and one below a root without a role: at rest they stand."""
    for s in (toys.skeleton(), toys.with_reference(toys.skeleton())):
        wxyz = np.tile(rotation.IDENTITY_WXYZ, (len(s), 1))
        root, still = np.array([0.0, toys.HIP_HEIGHT, 0.0]), np.zeros(3)
        now = Moment(root, wxyz, still, np.zeros((len(s), 3)))
        ragdoll = Ragdoll(s, lay_body(s), 24.0)
        for planted in ((True, True), (False, False)):
            out = ragdoll.push(
                now, (root[None], wxyz[None]), np.array(planted), s.joint("head"), still, still, 0.4
            )
            assert out.physical
            assert out.deviation.max() < 2e-3


def test_the_order_of_the_joints_does_not_matter(physics):
    """The same body with its joints listed level by level: the same push, the same answer."""
    one = toys.skeleton()
    level = np.zeros(len(one), dtype=int)
    for j in range(1, len(one)):
        level[j] = level[one.parents[j]] + 1
    order = np.argsort(level, kind="stable")
    back = np.argsort(order)
    other = Skeleton(
        tuple(one.names[j] for j in order),
        np.concatenate([[-1], back[one.parents[order[1:]]]]),
        one.offsets[order],
        {role: int(back[j]) for role, j in one.roles.items()},
        back[one.tip_parents],
        one.tip_offsets,
    )
    assert not np.array_equal(order, back)
    rng = np.random.default_rng(1)
    wxyz, spin = rotation.exp(rng.normal(0, 0.1, (len(one), 3))), rng.normal(0, 1, (len(one), 3))
    root = np.array([0.0, toys.HIP_HEIGHT, 0.0])
    found = []
    for s, pick in ((one, np.arange(len(one))), (other, order)):
        now = Moment(root, wxyz[pick], np.zeros(3), spin[pick])
        point = now.joints(s)[0][s.joint("head")]
        out = Ragdoll(s, lay_body(s), 30.0).push(
            now, (root[None], wxyz[pick][None]), np.array([True, False]), s.joint("head"), point,
            np.array([3.0, 0.0, -15.0]), 0.2,
        )  # fmt: skip
        assert out.physical
        found.append((out.wxyz[:, np.argsort(pick)], out.end.joint_velocity[np.argsort(pick)]))
    for a, b in zip(*found):
        assert np.allclose(a, b, atol=1e-6)


def test_an_armed_fighter_can_be_pushed(physics):
    """A sword is a joint of its own, listed after all others."""
    clips = concatenate(performed("sword").clips[:1])
    ragdoll = Ragdoll(clips.skeleton, lay_body(clips.skeleton), clips.fps)
    for f in standing(clips, 3):
        out, _ = struck(clips, ragdoll, f, np.zeros(3))
        assert out.physical
        assert out.deviation.max() < 0.03


# A pose and how it moves -------------------------------------------------------------------------


def test_a_moment_goes_where_it_moves():
    rng = np.random.default_rng(3)
    s = toys.skeleton()
    roots = rng.normal(0, 1, (2, 3))
    turns = rotation.exp(rng.normal(0, 0.4, (2, len(s), 3)))
    later = Moment.between(roots, turns, 30.0)
    root, wxyz = later.after(-1 / 30)
    assert np.allclose(root, roots[0])
    assert rotation.angle(wxyz, turns[0]).max() < 1e-6
    position, velocity = later.joints(s)
    ends = [forward_kinematics(s, *(x[None] for x in later.after(t)))[0][0] for t in (-1e-5, 1e-5)]
    assert np.allclose(0.5 * (ends[0] + ends[1]), position, atol=1e-6)
    assert np.allclose((ends[1] - ends[0]) / 2e-5, velocity, atol=1e-3)


# Going on from a pose -----------------------------------------------------------------------------


@pytest.mark.jit_off
@pytest.mark.parametrize("seed", range(4))
def test_the_rate_of_a_rotation_vector(seed):
    rng = np.random.default_rng(seed)
    turn, velocity = rng.normal(0, 1, 3), rng.normal(0, 3, 3)
    turn *= [1e-5, 0.5, 2.0, 3.0][seed] / np.linalg.norm(turn)
    rate, dt = np.empty(3), 1e-6
    kernels.turned_rate(turn, velocity, rate)
    ends = [rotation.multiply(rotation.exp(turn), rotation.exp(x * dt * velocity)) for x in (-1, 1)]
    slope = (rotation.log(ends[1]) - rotation.log(ends[0])) / (2 * dt)
    assert np.allclose(rate, slope, atol=1e-4)


def test_a_character_goes_on_from_its_own_pose(library: Layer):
    """Place and velocity of everything are the given ones, and the capture's after a while."""
    clips, s = library.clips, library.clips.skeleton
    fps, rng = clips.fps, np.random.default_rng(5)
    cast = Cast(library, 2)
    cast.place(0, 3, np.zeros(3))
    cast.place(1, 3, np.ones(3))
    length = np.diff(clips.clip_start)
    start = int(clips.clip_start[np.argmax(length)])
    for trial in range(5):
        source, frame = start + 40 + 31 * trial, start + 300 + 17 * trial
        turn = rotation.multiply(clips.wxyz[source], rotation.exp(rng.normal(0, 0.15, (len(s), 3))))
        root = clips.root_position[source] + [3.0, 0.02, -2.0]
        spin = rng.normal(0, 2.0, (len(s), 3))
        now = Moment(root, turn, rng.normal(0, 0.5, 3), spin)
        other = cast._offsets.joint[1].copy()
        cast.adopt(0, frame, frame + 60, now)
        assert np.array_equal(cast._offsets.joint[1], other)
        assert (cast.frame[0], cast.stop[0]) == (frame, frame + 60)
        cast.show(0.0)
        position, velocity = now.joints(s)
        assert np.allclose(cast.root_position[0], root, atol=1e-9)
        legs = [s.joint(f"{a}_{b}") for a in ("left", "right") for b in ("thigh", "shin", "foot")]
        rest = [j for j in range(len(s)) if j not in legs]
        assert rotation.angle(cast.wxyz[0, rest], turn[rest]).max() < 1e-6
        assert np.allclose(cast.position[0], position, atol=2e-3)  # legs: straight to 99.9 %
        facing = facing_frame(s, root[None], turn[None])[0]
        assert np.allclose(cast.facing[0, :2], facing[:2], atol=1e-9)
        # What is shown moves as the offsets and the capture together do: a tiny step of both.
        dt = 1e-4
        before = cast.wxyz[0].copy()
        cast.show(dt)
        offsets = rotation.log(rotation.multiply(rotation.conjugate(before), cast.wxyz[0])) / dt
        own = rotation.log(
            rotation.multiply(rotation.conjugate(clips.wxyz[frame - 1]), clips.wxyz[frame])
        ) * fps  # fmt: skip
        base = clips.wxyz[frame].copy()
        base[0] = rotation.multiply(rotation.from_yaw(cast.anchor[0, 2]), base[0])
        held = rotation.multiply(rotation.conjugate(base), turn)
        shown = offsets + rotation.rotate(rotation.conjugate(held), own)
        assert np.allclose(shown[rest], spin[rest], atol=0.02)
        for _ in range(60):
            cast.advance()
        assert np.abs(cast._offsets.joint[0]).max() < 1e-3
        assert velocity.shape == position.shape


def test_poses_and_speeds_do_not_jump_where_a_character_goes_on(library: Layer):
    """Frame by frame: a cast plays, its own pose is handed back to it elsewhere in a clip."""
    clips = library.clips
    cast = Cast(library, 1)
    start = int(clips.clip_start[np.argmax(np.diff(clips.clip_start))])
    at = slice(start + 29, start + 31)
    first = Moment.between(clips.root_position[at], clips.wxyz[at], clips.fps)
    cast.adopt(0, start + 30, start + 90, first)
    shown, roots, turns = [], [], []
    for t in range(60):
        cast.advance()
        shown.append(cast.position[0].copy())
        roots.append(cast.root_position[0].copy())
        turns.append(cast.wxyz[0].copy())
        if t == 29:
            now = Moment.between(np.array(roots[-2:]), np.array(turns[-2:]), clips.fps)
            cast.adopt(0, start + 200, start + 260, now)
    places = np.array(shown)
    speed = (places[1:] - places[:-1]) * clips.fps
    change = np.linalg.norm(speed[1:] - speed[:-1], axis=-1).max(axis=-1)
    assert change[27:30].max() < 3.0 * np.quantile(change, 0.9) + 0.3
    assert np.linalg.norm(speed, axis=-1).max() / clips.fps < 0.15


def test_going_on_refuses_what_it_cannot_play(library: Layer):
    cast, clips = Cast(library, 1), library.clips
    now = Moment.between(clips.root_position[:2], clips.wxyz[:2], clips.fps)
    second = int(clips.clip_start[1])
    for frame, last in ((second - 1, second), (5, 4), (5, len(clips))):
        with pytest.raises(KumiteError, match="one clip"):
            cast.adopt(0, frame, last, now)
    toy = toys.skeleton()
    small = Moment(
        np.zeros(3), np.tile([1.0, 0, 0, 0], (len(toy), 1)), np.zeros(3), np.zeros((len(toy), 3))
    )
    with pytest.raises(KumiteError, match="joints"):
        cast.adopt(0, 5, 9, small)


# Responses ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def reactions() -> tuple[ClipSet, Responses, list[str]]:
    performance = performed("boxing")
    clips = concatenate(performance.clips)
    spans, labels = [], []
    for start, truth in zip(clips.clip_start.tolist(), performance.truth):
        for action in truth.actions:
            if action.kind == "reaction":
                spans.append((start + action.start, start + action.stop - 1))
                labels.append(action.label)
    return clips, find_responses(clips, spans), labels


def test_sizes_are_those_that_were_authored(reactions):
    _, table, labels = reactions
    for r, label in enumerate(labels):
        size = set(table.size[table.response == r].tolist())
        wanted = FALL if "fall" in label else FLINCH if "light" in label else STAGGER
        assert size == {wanted}, label


def test_harder_blows_never_get_a_smaller_response(reactions):
    clips, table, _ = reactions
    now = Moment.between(clips.root_position[200:202], clips.wxyz[200:202], clips.fps)
    sizes = [table.size[table.match(now, np.array([0, 0, -j]))[0]] for j in np.linspace(0, 60, 61)]
    assert np.all(np.diff(sizes) >= 0)
    assert set(sizes) == set(range(len(SIZES)))
    for there in ([FLINCH], [FALL], [FLINCH, FALL], [STAGGER, FALL]):
        some = np.isin(table.size, there)
        part = Responses(
            table.skeleton,
            *(getattr(table, n)[some] for n in
              ("frame", "last", "response", "size", "posture", "speed", "heading")),
        )  # fmt: skip
        found = [part.size_for(float(j)) for j in range(60)]
        assert np.all(np.diff(found) >= 0) and set(found) <= set(there)


def test_a_response_fits_its_own_beginning_best(reactions):
    """Wherever it is and whichever way it faces; and the way of the impulse decides a tie."""
    clips, table, _ = reactions
    for k in (0, len(table) // 2, len(table) - 1):
        f = int(table.frame[k])
        turn, shift = rotation.from_yaw(1.1), np.array([4.0, 0.0, -2.0])
        roots = rotation.rotate(turn, clips.root_position[f - 1 : f + 1]) + shift
        wxyz = clips.wxyz[f - 1 : f + 1].copy()
        wxyz[:, 0] = rotation.multiply(turn, wxyz[:, 0])
        now = Moment.between(roots, wxyz, clips.fps)
        yaw = facing_frame(clips.skeleton, now.root_position[None], now.wxyz[None])[0, 2]
        x, z = table.heading[k]
        way = rotation.rotate(rotation.from_yaw(yaw), [x, 0.0, z])
        size = {FLINCH: 5.0, STAGGER: 20.0, FALL: 40.0}[int(table.size[k])]
        index, cost = table.match(now, size * way)
        assert cost == pytest.approx(0.0, abs=0.02)
        assert index == k
        assert table.costs(now, -way)[k] > cost + 3.9


def test_blows_from_the_front_drive_back(reactions):
    """A boxer in guard, struck hard to the face: what is chosen goes the way of the blow."""
    clips, table, labels = reactions
    f = int(table.frame[0])
    now = Moment.between(clips.root_position[f - 1 : f + 1], clips.wxyz[f - 1 : f + 1], clips.fps)
    yaw = clips.facing[f, 2]
    for way, word in (([0.0, 0.0, -1.0], "fall_back"), ([0.5, 0.0, 0.85], "fall_forward")):
        push = 40.0 * rotation.rotate(rotation.from_yaw(yaw), way)
        index, _ = table.match(now, push)
        assert labels[table.response[index]] == word


def test_responses_refuse_what_they_cannot_read(reactions):
    clips, table, _ = reactions
    now = Moment.between(clips.root_position[:2], clips.wxyz[:2], clips.fps)
    with pytest.raises(KumiteError, match="none"):
        find_responses(clips, [])
    with pytest.raises(KumiteError, match="one clip"):
        find_responses(clips, [(int(clips.clip_start[1]) - 5, int(clips.clip_start[1]) + 5)])
    with pytest.raises(KumiteError, match="finite"):
        table.match(now, np.array([np.nan, 0, 0]))


# Two bodies ---------------------------------------------------------------------------------------


def brute_depth(a, b, shift, n: int = 60) -> float:
    """The deepest of many spheres along every part of a in every part of b."""
    t = np.linspace(0, 1, n)[:, None]
    best = 0.0
    for a0, a1, ra0, ra1 in zip(*a):
        p = a0 + t * (a1 - a0) + shift
        ra = (ra0 + t * (ra1 - ra0))[:, 0]
        for b0, b1, rb0, rb1 in zip(*b):
            q = b1 - b0
            u = np.clip((p - b0) @ q / max(q @ q, 1e-12), 0, 1)
            gap = np.linalg.norm(p - b0 - u[:, None] * q, axis=1) - (rb0 + u * (rb1 - rb0))
            best = max(best, float((ra - gap).max()))
    return best


@pytest.mark.parametrize("apart", [0.1, 0.35, 0.6])
def test_bodies_leave_each_other_by_the_shortest_way(clips, apart: float):
    s = clips.skeleton
    body = lay_body(s)
    rng = np.random.default_rng(int(100 * apart))
    position, world = clips.world
    f, g = rng.integers(0, len(clips), 2)
    angle = rng.uniform(0, 2 * np.pi)
    there = clips.root_position[g] - clips.root_position[f] + [
        apart * np.cos(angle), 0.0, apart * np.sin(angle)
    ]  # fmt: skip
    one, other = position[f] + there * [1, 0, 1], position[g]
    found = keep_out(body, one, world[f], body, other, world[g])
    a, b = posed(body, one, world[f]), posed(body, other, world[g])
    assert found.depth == pytest.approx(brute_depth(a, b, 0.0), abs=2e-3)
    if found.depth > NEAR:
        mine, its = slice(found.part, found.part + 1), slice(found.other, found.other + 1)
        pair = [x[mine] for x in a], [x[its] for x in b]
        assert brute_depth(pair[0], pair[1], 0.0) == pytest.approx(found.depth, abs=2e-3)
    x, z = found.displacement
    assert brute_depth(a, b, np.array([x, 0.0, z])) < 2 * NEAR + 1e-4
    length = np.hypot(x, z)
    longest = length / 1.03 - 0.01  # of ways to try: none that is clearly shorter is free
    for turn in np.arange(2 * DIRECTIONS) * np.pi / DIRECTIONS if longest > 0 else ():
        way = longest * np.array([np.cos(turn), 0.0, np.sin(turn)])
        assert brute_depth(a, b, way, 25) > NEAR


@pytest.mark.jit_off
def test_the_deepest_overlap_is_that_of_the_deepest_frame():
    rng = np.random.default_rng(2)
    start, end = rng.normal(0, 0.2, (2, 5, 4, 3))
    radius = rng.uniform(0.05, 0.2, 4)
    first, second = np.array([0, 1, 0]), np.array([2, 3, 3])
    each, found = np.empty((5, 3)), np.empty(3)
    overlap.overlaps(start, end, radius, radius, first, second, each)
    overlap.deepest_overlaps(start, end, radius, first, second, found)
    assert np.allclose(found, each.max(axis=0), atol=1e-12)


def test_spheres_leave_each_other_by_what_they_are_deep():
    def ball(radius: float) -> Body:
        at, size = np.zeros((1, 3)), np.array([radius])
        return Body(("ball",), np.array([0]), at, at, size, size, np.ones(1))

    still = rotation.IDENTITY_WXYZ[None]
    a, b = ball(0.3), ball(0.2)
    found = keep_out(a, np.array([[0.4, 1.0, 0.0]]), still, b, np.array([[0.0, 1.0, 0.0]]), still)
    assert found.depth == pytest.approx(0.1)
    assert np.allclose(found.displacement, [0.1, 0.0], atol=2 * NEAR)
    away = keep_out(a, np.array([[0.6, 1.0, 0.0]]), still, b, np.array([[0.0, 1.0, 0.0]]), still)
    assert away.depth == 0.0 and away.part == NO_PART and not away.displacement.any()
    with pytest.raises(KumiteError, match="pose"):
        keep_out(a, np.array([[np.nan, 1.0, 0.0]]), still, b, np.zeros((1, 3)), still)
