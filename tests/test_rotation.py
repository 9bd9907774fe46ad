"""Rotations and planar transforms against SciPy and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kumite import rotation

number = st.floats(-1, 1, allow_nan=False)
vectors = st.tuples(number, number, number).map(np.array)
# Lengths near 0 and near π are where formulas break.
angles = st.one_of(
    st.floats(0, np.pi), st.sampled_from([0.0, 1e-12, 1e-9, 1e-7, 1e-4, np.pi - 1e-7, np.pi - 1e-4])
)
directions = vectors.filter(lambda v: np.linalg.norm(v) > 1e-3).map(lambda v: v / np.linalg.norm(v))
rotvecs = st.tuples(directions, angles).map(lambda p: p[0] * p[1])
planars = st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-3.1, 3.1)).map(np.array)


def scipy(q):
    return Rotation.from_quat(q, scalar_first=True)


@given(rotvecs)
def test_exp_and_log_agree_with_scipy(v):
    q = rotation.exp(v)
    assert np.allclose(scipy(q).as_matrix(), Rotation.from_rotvec(v).as_matrix(), atol=1e-12)
    assert np.allclose(rotation.exp(rotation.log(q)), q, atol=1e-9) or np.allclose(
        rotation.exp(rotation.log(q)), -q, atol=1e-9
    )
    assert np.linalg.norm(rotation.log(q)) <= np.pi + 1e-9


@given(rotvecs, rotvecs, vectors)
def test_products_and_rotation_agree_with_scipy(a, b, v):
    p, q = rotation.exp(a), rotation.exp(b)
    assert np.allclose(
        scipy(rotation.multiply(p, q)).as_matrix(), (scipy(p) * scipy(q)).as_matrix(), atol=1e-12
    )
    assert np.allclose(rotation.rotate(p, v), scipy(p).apply(v), atol=1e-12)
    assert np.allclose(rotation.rotate(rotation.conjugate(p), rotation.rotate(p, v)), v, atol=1e-12)


@given(rotvecs)
def test_from_matrix_undoes_to_matrix(v):
    q = rotation.exp(v)
    back = rotation.from_matrix(scipy(q).as_matrix())
    assert np.allclose(scipy(back).as_matrix(), scipy(q).as_matrix(), atol=1e-9)
    many = rotation.from_matrix(np.stack([scipy(q).as_matrix(), np.eye(3)]))
    assert many.shape == (2, 4) and np.allclose(np.abs(many[1]), [1, 0, 0, 0])


@given(vectors, vectors)
def test_cross_agrees_with_numpy(a, b):
    assert np.allclose(rotation.cross(a, b), np.cross(a, b), atol=1e-12)


@given(rotvecs, rotvecs, st.floats(0, 1))
def test_slerp_moves_at_constant_speed_along_the_shortest_arc(a, b, t):
    p, q = rotation.exp(a), rotation.exp(b)
    whole = rotation.angle(p, q)
    at = rotation.slerp(p, q, np.array(t))
    assert rotation.angle(p, at) == pytest.approx(t * whole, abs=1e-6)
    assert rotation.angle(at, q) == pytest.approx((1 - t) * whole, abs=1e-6)


@given(directions, directions)
def test_between_turns_one_direction_onto_another(a, b):
    assert np.allclose(rotation.rotate(rotation.between(a, b), a), b, atol=1e-6)


def test_between_opposite_directions():
    for a in np.eye(3):
        assert np.allclose(rotation.rotate(rotation.between(a, -a), a), -a, atol=1e-12)


@given(planars, planars, vectors)
def test_planar_transforms_compose_and_invert(a, b, p):
    both = rotation.planar_apply(rotation.planar_compose(a, b), p)
    assert np.allclose(both, rotation.planar_apply(a, rotation.planar_apply(b, p)), atol=1e-9)
    back = rotation.planar_apply(rotation.planar_inverse(a), rotation.planar_apply(a, p))
    assert np.allclose(back, p, atol=1e-9)
    turn = rotation.rotate(rotation.from_yaw(a[2]), p) + np.array([a[0], 0, a[1]])
    assert np.allclose(rotation.planar_apply(a, p), turn, atol=1e-9)


def test_yaw_turns_from_forward_to_the_left():
    ahead = np.array([0.0, 0.0, 1.0])
    assert np.allclose(rotation.planar_apply([0, 0, np.pi / 2], ahead), [1, 0, 0])


@given(st.sampled_from(["XYZ", "ZYX", "ZXY", "YXZ", "XZY", "YZX"]), rotvecs)
def test_euler_angles_return(order, v):
    q = rotation.exp(v)
    again = rotation.from_euler(order, rotation.to_euler(order, q, degrees=True), degrees=True)
    assert rotation.angle(q, again) == pytest.approx(0, abs=1e-6)


def test_continuous_takes_out_sign_flips():
    q = rotation.exp(np.linspace(0, 3, 50)[:, None] * np.array([0.0, 1.0, 0.0]))
    flipped = q * np.where(np.arange(50) % 3 == 0, -1.0, 1.0)[:, None]
    assert np.all(np.sum(np.diff(rotation.continuous(flipped), axis=0) ** 2, axis=1) < 0.01)


def test_zero_quaternion_is_the_identity():
    assert np.array_equal(rotation.normalize([0, 0, 0, 0]), [1, 0, 0, 0])
