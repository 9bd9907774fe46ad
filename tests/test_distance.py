"""Pose distances and their local minima against slow twins."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kumite import rotation
from kumite.annotate import find_contacts
from kumite.clip import Clip, concatenate
from kumite.errors import KumiteError
from kumite.graph import distance as graph_distance
from kumite.graph import find_transitions, pose_features
from kumite.kernels import distance as kernels
from tests import reference, toys


def features(count: int, seed: int, joints: int = 3, dims: int = 4):
    rng = np.random.default_rng(seed)
    walk = np.cumsum(rng.normal(0, 0.3, (count, joints, 3)), axis=0)
    q = rotation.exp(walk) * rng.choice([-1.0, 1.0], (count, joints, 1))
    quaternion = np.ascontiguousarray(np.moveaxis(q, 0, 2), dtype=np.float32)
    weight = rng.uniform(0.1, 2, joints).astype(np.float32)
    return quaternion, weight, rng.normal(0, 1, (dims, count)).astype(np.float32)


@pytest.mark.jit_off
@pytest.mark.parametrize("count", [1, 5, 37])
def test_distances_equal_the_twin(count):
    q, w, f = features(count, count)
    expected = reference.distances(q, w, f)
    line = np.empty((count + kernels.LANES, count), np.float32)
    kernels.distance_rows(q, w, f, 0, count, line)
    assert np.allclose(line[:count], expected, rtol=2e-5, atol=2e-5)


def test_large_and_tiny_angles():
    angles = np.array([0, 1e-4, 1e-3, 0.1, 1, 2, 3, np.pi - 1e-3, np.pi])
    q = rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), angles).T[None].astype(np.float32)
    line = np.empty((1 + kernels.LANES, len(angles)), np.float32)
    zero = np.zeros((2, len(angles)), np.float32)
    kernels.distance_rows(q, np.ones(1, np.float32), zero, 0, 1, line)
    assert np.allclose(line[0], angles**2, rtol=2e-5, atol=2e-6)


@pytest.mark.jit_off
@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000), st.integers(2, 40), st.integers(1, 3), st.floats(2, 80))
def test_local_minima_equal_the_twin(seed, count, groups, limit):
    q, w, f = features(count, seed, joints=2, dims=2)
    rng = np.random.default_rng(seed)
    joined = rng.random(count) < 0.8
    joined[0] = False
    group = rng.integers(0, groups, count).astype(np.int32)
    line = np.empty((count + kernels.LANES, count), np.float32)
    kernels.distance_rows(q, w, f, 0, count, line)
    expected = reference.local_minima(line[:count], joined, group, limit)
    tasks = (count + kernels.ROWS - 1) // kernels.ROWS
    a, b = np.empty((2, tasks, count * count), np.int32)
    d = np.empty((tasks, count * count), np.float32)
    counts = np.zeros(tasks, np.int64)
    kernels.local_minima(q, w, f, joined, group, np.float32(limit), a, b, d, counts)
    found = {(int(a[t, n]), int(b[t, n])) for t in range(tasks) for n in range(counts[t])}
    assert found == expected


@pytest.mark.parametrize("moved", ["root", "reference above the hips", "hips below a reference"])
def test_where_a_body_stands_and_faces_does_not_count_but_height_and_lean_do(moved):
    c = toys.still(3)
    s = c.skeleton if moved == "root" else toys.with_reference(c.skeleton)
    turned = 1 if moved.startswith("hips") else 0
    wxyz, root = np.tile([1.0, 0.0, 0.0, 0.0], (3, len(s), 1)), c.root_position.copy()
    wxyz[1, turned] = rotation.from_yaw(1.0)
    root[1] += [3, 0, -2]
    wxyz[2, turned] = rotation.multiply(
        rotation.from_yaw(1.0), rotation.from_axis_angle([1, 0, 0], 0.3)
    )
    root[2, 1] -= 0.1
    # One-frame clips: no velocities come into it.
    clips = [Clip(f"c{i}", s, 30, root[i : i + 1], wxyz[i : i + 1]) for i in range(3)]
    f = pose_features(concatenate(clips))
    line = np.empty((3 + kernels.LANES, 3), np.float32)
    kernels.distance_rows(f.quaternion, f.weight, f.euclidean, 0, 3, line)
    assert line[0, 1] == pytest.approx(0, abs=1e-5)
    expected = 0.3**2 + (0.1 * graph_distance.HEIGHT_WEIGHT) ** 2
    assert line[0, 2] == pytest.approx(expected, rel=1e-3)


def test_poses_that_are_all_alike_come_to_an_end():
    """A long still take: all distances are 0, so no sample of them says what to accept."""
    clips = toys.clip_set([4100])
    with pytest.raises(KumiteError, match="no two poses are alike"):
        find_transitions(clips, find_contacts(clips), event="none")


def test_joins_need_the_same_event():
    rng = np.random.default_rng(1)
    s = toys.skeleton()
    frames = 400
    wxyz = rotation.exp(0.02 * rng.normal(0, 1, (frames, len(s), 3)))
    t = np.arange(frames) / 30
    for side, phase in (("left", 0.0), ("right", np.pi)):
        lift = np.maximum(np.sin(2 * np.pi * t + phase), 0)
        wxyz[:, s.joint(f"{side}_thigh")] = rotation.from_axis_angle([1, 0, 0], -0.9 * lift)
        wxyz[:, s.joint(f"{side}_shin")] = rotation.from_axis_angle([1, 0, 0], 1.2 * lift)
    root = np.tile([0, toys.HIP_HEIGHT, 0], (frames, 1))
    clips = concatenate([Clip("steps", s, 30, root, wxyz)])
    contacts = find_contacts(clips)
    lift_off = contacts.lift_off(clips.clip_start)
    assert lift_off[:, 0].sum() >= 10 and lift_off[:, 1].sum() >= 10
    for event, feet in (("left", [0]), ("right", [1]), ("both", [0, 1])):
        x = find_transitions(clips, contacts, event=event)
        here, there = lift_off[x.source][:, feet], lift_off[x.target - 1][:, feet]
        assert len(x) and np.all((here & there).any(axis=1))
    anywhere = find_transitions(clips, contacts, event="none", per_second=5.0)
    assert len(anywhere) == pytest.approx(5 * frames / 30, rel=0.1)
