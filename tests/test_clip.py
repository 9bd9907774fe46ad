"""Skeletons, clips, kinematics, facing frames."""

from __future__ import annotations

import re

import numpy as np
import pytest

from kumite import clip as clips
from kumite import rotation
from kumite.errors import KumiteError
from tests import reference, toys


def wild(frames: int, seed: int = 0, fps: float = 30.0) -> clips.Clip:
    rng = np.random.default_rng(seed)
    s = toys.skeleton()
    wxyz = rotation.exp(rng.normal(0, 0.5, (frames, len(s), 3)))
    return clips.Clip("wild", s, fps, rng.normal(0, 1, (frames, 3)), wxyz)


@pytest.mark.jit_off
def test_kinematics_equal_the_matrix_twin():
    c = wild(4)
    position, world = clips.forward_kinematics(c.skeleton, c.root_position, c.wxyz)
    for f in range(4):
        p, m = reference.forward_kinematics(
            c.skeleton.parents, c.skeleton.offsets, c.root_position[f], c.wxyz[f]
        )
        assert np.allclose(position[f], p, atol=1e-12)
        assert np.allclose(rotation.to_matrix(world[f]), m, atol=1e-12)


def test_many_frames_are_what_few_are(monkeypatch):
    """The kernel that runs on all cores gives the bytes of the one that does not."""
    c = wild(50)
    few = clips.forward_kinematics(c.skeleton, c.root_position, c.wxyz)
    monkeypatch.setattr(clips.pose_kernels, "MANY", 1)
    many = clips.forward_kinematics(c.skeleton, c.root_position, c.wxyz)
    assert all(np.array_equal(a, b) for a, b in zip(few, many))


def test_the_trunk_leads_from_the_pelvis_or_from_the_root_beside_it():
    s = toys.skeleton()
    names = [s.names[j] for j in s.trunk(s.joint("head"))]
    assert names == ["spine", "chest", "head"]
    assert s.trunk(s.joint("pelvis")) == []
    # The pelvis as a branch that carries the legs alone: the spine hangs on the root.
    beside = clips.Skeleton(
        s.names, s.parents, s.offsets, {**s.roles, "pelvis": s.joint("left_thigh")}
    )
    assert [s.names[j] for j in beside.trunk(s.joint("head"))] == names


def test_rest_faces_forward_with_the_left_at_plus_x():
    s = toys.skeleton()
    assert np.allclose(s.lateral_axis, [1, 0, 0])
    assert np.allclose(clips.facing_frame(s, *_pose(yaw=0.0)), [[0, 0, 0]])
    assert np.allclose(clips.facing_frame(s, *_pose(yaw=1.2))[0], [0, 0, 1.2])


def _pose(yaw: float):
    c = toys.still(1, yaw=yaw)
    return c.root_position, c.wxyz


def test_facing_survives_a_body_that_lies_on_its_side():
    c = toys.still(3, yaw=0.5)
    wxyz = c.wxyz.copy()
    # The second frame is rolled onto its side: the hips' axis points up and says nothing.
    wxyz[1, 0] = rotation.multiply(wxyz[0, 0], rotation.from_axis_angle([0, 0, 1], np.pi / 2))
    facing = clips.facing_frame(c.skeleton, c.root_position, wxyz)
    assert np.allclose(facing[:, 2], 0.5)


def test_facing_does_not_leak_from_one_clip_into_the_next():
    a, b = toys.still(2, name="a", yaw=0.5), toys.still(2, name="b", yaw=-1.0)
    wxyz = b.wxyz.copy()
    wxyz[0, 0] = rotation.multiply(wxyz[0, 0], rotation.from_axis_angle([0, 0, 1], np.pi / 2))
    rolled = clips.Clip("b", b.skeleton, b.fps, b.root_position, wxyz)
    assert np.allclose(clips.concatenate([a, rolled]).facing[:, 2], [0.5, 0.5, -1.0, -1.0])


def test_tips_are_end_sites_else_the_farthest_joint_else_half_the_bone():
    s = toys.skeleton()
    joint, offset = s.tip("left_hand")
    assert s.names[joint] == "l_wrist" and np.allclose(offset, [0.1, 0, 0])
    bare = clips.Skeleton(s.names, s.parents, s.offsets, s.roles)
    joint, offset = bare.tip("left_foot")
    assert bare.names[joint] == "l_toe" and np.allclose(offset, 0)
    joint, offset = bare.tip("left_hand")
    assert bare.names[joint] == "l_wrist" and np.allclose(offset, [0.125, 0, 0])


def test_resample_keeps_frames_that_coincide_and_the_duration():
    c = wild(31, fps=30.0)
    double = clips.resample(c, 60.0)
    assert len(double) == 61
    assert np.array_equal(double.wxyz[::2], c.wxyz)
    assert np.allclose(clips.resample(double, 30.0).root_position, c.root_position)
    assert len(clips.resample(c, 7.0)) == 8
    assert len(clips.resample(wild(1), 60.0)) == 1


def test_mirror_twice_is_the_original_and_swaps_sides():
    c = wild(3)
    once = clips.mirror(c)
    twice = clips.mirror(once)
    assert np.allclose(twice.wxyz, c.wxyz) and np.allclose(twice.root_position, c.root_position)
    a, _ = clips.forward_kinematics(c.skeleton, c.root_position, c.wxyz)
    b, _ = clips.forward_kinematics(c.skeleton, once.root_position, once.wxyz)
    left, right = (c.skeleton.joint(r) for r in ("left_hand", "right_hand"))
    assert np.allclose(b[:, left], a[:, right] * [-1, 1, 1])


def test_concatenate_takes_the_lowest_rate_and_addresses_frames():
    s = clips.concatenate([toys.still(31, name="a", fps=30), toys.still(61, name="b", fps=60)])
    assert s.fps == 30 and list(s.clip_start) == [0, 31, 62]
    assert list(s.clip_of_frame[[0, 30, 31, 61]]) == [0, 0, 1, 1]
    assert [c.name for c in s] == ["a", "b"]


def test_two_skeletons_are_refused_by_name():
    other = toys.still(2, name="other")
    longer = other.skeleton.offsets.copy()
    longer[6] *= 1.1
    s = other.skeleton
    tall = clips.Skeleton(s.names, s.parents, longer, s.roles, s.tip_parents, s.tip_offsets)
    second = clips.Clip("tall", tall, 30, other.root_position, other.wxyz)
    with pytest.raises(KumiteError, match=r"two skeletons.*'l_wrist'"):
        clips.concatenate([other, second])


def test_clips_used_twice_and_none_at_all_are_refused():
    with pytest.raises(KumiteError, match="twice: still"):
        clips.concatenate([toys.still(2), toys.still(2)])
    with pytest.raises(KumiteError, match="no clips"):
        clips.concatenate([])


def test_arrays_are_read_only():
    c = toys.still(2)
    with pytest.raises(ValueError):
        c.wxyz[0, 0, 0] = 2.0
    with pytest.raises(ValueError):
        c.skeleton.offsets[1] = 0.0


@pytest.mark.parametrize(
    ("parents", "message"),
    [([-1, 2, 0], "before"), ([0, 0, 1], "root"), ([-1, -1, 0], "before")],
)
def test_bad_trees_are_refused(parents, message):
    with pytest.raises(KumiteError, match=message):
        clips.Skeleton(("a", "b", "c"), np.array(parents), np.zeros((3, 3)))


def test_check_names_every_problem():
    c = toys.still(4)
    assert clips.check(c) == []
    root = c.root_position.copy()
    root[2, 0] = 50.0
    wxyz = c.wxyz * 1.0001
    problems = clips.check(clips.Clip("odd", c.skeleton, 30, root, wxyz))
    assert len(problems) == 2 and "unit length" in problems[0] and "after frame 1" in problems[1]


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("root_position", np.nan, "root_position: nan at [1, 0]; expected finite numbers"),
        ("root_position", -np.inf, "root_position: -inf at [1, 0]; expected finite numbers"),
        ("root_position", 1e12, "root_position: 1000000000000.0; expected at most 1e+09"),
        ("wxyz", np.nan, "wxyz: nan at [1, 0, 0]; expected finite numbers"),
        ("wxyz", 0.0, "wxyz: a length of 0 at [1, 0]; expected unit quaternions"),
    ],
)
def test_poses_are_checked_where_a_clip_is_made(field, value, said):
    c = toys.still(4)
    root, wxyz = c.root_position.copy(), c.wxyz.copy()
    (root if field == "root_position" else wxyz)[1] = value
    for make in (
        lambda: clips.Clip("odd", c.skeleton, 30, root, wxyz),
        lambda: clips.ClipSet(c.skeleton, 30, ("odd",), np.array([0, 4]), root, wxyz),
    ):
        with pytest.raises(KumiteError, match=re.escape(said)):
            make()


def test_forward_kinematics_takes_any_leading_axes():
    rng = np.random.default_rng(3)
    skeleton = toys.still(1).skeleton
    root = rng.normal(size=(5, 2, 3)).astype(np.float32)
    wxyz = rng.normal(size=(5, 2, len(skeleton), 4))
    wxyz /= np.linalg.norm(wxyz, axis=-1, keepdims=True)
    position, world = clips.forward_kinematics(skeleton, root, wxyz)
    facing = clips.facing_frame(skeleton, root, wxyz)
    assert facing.shape == (5, 2, 3)
    for k in range(2):
        alone = clips.forward_kinematics(skeleton, root[:, k], wxyz[:, k])
        assert np.array_equal(position[:, k], alone[0]) and np.array_equal(world[:, k], alone[1])
        assert np.array_equal(facing[:, k], clips.facing_frame(skeleton, root[:, k], wxyz[:, k]))
    one = clips.forward_kinematics(skeleton, root[3, 1], wxyz[3, 1])
    assert np.array_equal(one[0], position[3, 1])
    spread = clips.forward_kinematics(
        skeleton, root[3], wxyz[:, 1][:, None]
    )  # [2, 3], [5, 1, J, 4]
    assert spread[0].shape == (5, 2, len(skeleton), 3)
    with pytest.raises(KumiteError, match=r"wxyz is \[5, 2, 4\], expected \[…, \d+, 4\]"):
        clips.forward_kinematics(skeleton, root, wxyz[:, :, 0])
    with pytest.raises(KumiteError, match="leading axes that go together"):
        clips.forward_kinematics(skeleton, root[:4], wxyz)
