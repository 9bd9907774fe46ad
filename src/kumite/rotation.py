"""Rotations and planar transforms: pure broadcasting functions over NumPy arrays.

Quaternions are ``wxyz``, unit length, and rotate column vectors: ``rotate(q, v)`` is q v q⁻¹.
A planar transform is ``(x, z, yaw)``: yaw about +Y (0 faces +Z), then a shift on the ground.
All functions accept any leading shape and broadcast.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

IDENTITY_WXYZ = np.array([1.0, 0.0, 0.0, 0.0])
SMALL_ANGLE = 1e-8  # rad; below it sin(x)/x is 1 to the last bit


def normalize(wxyz: ArrayLike) -> np.ndarray:
    """Unit quaternions [..., 4]; a zero quaternion becomes the identity."""
    q = np.asarray(wxyz, dtype=np.float64)
    n = np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(n > 0, q / np.where(n > 0, n, 1.0), IDENTITY_WXYZ)


def multiply(a: ArrayLike, b: ArrayLike) -> np.ndarray:
    """Hamilton product [..., 4]: first b, then a."""
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    aw, ax, ay, az = (a[..., k] for k in range(4))
    bw, bx, by, bz = (b[..., k] for k in range(4))
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[..., 0] = aw * bw - ax * bx - ay * by - az * bz
    out[..., 1] = aw * bx + ax * bw + ay * bz - az * by
    out[..., 2] = aw * by - ax * bz + ay * bw + az * bx
    out[..., 3] = aw * bz + ax * by - ay * bx + az * bw
    return out


def conjugate(wxyz: ArrayLike) -> np.ndarray:
    """The inverse rotation [..., 4]."""
    return np.asarray(wxyz, dtype=np.float64) * np.array([1.0, -1.0, -1.0, -1.0])


def rotate(wxyz: ArrayLike, vector: ArrayLike) -> np.ndarray:
    """Vectors [..., 3] rotated by quaternions [..., 4]."""
    q = np.asarray(wxyz, dtype=np.float64)
    v = np.asarray(vector, dtype=np.float64)
    w, u = q[..., :1], q[..., 1:]
    t = 2.0 * cross(u, v)
    return v + w * t + cross(u, t)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products [..., 3]: NumPy's, without its price for short arrays."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[..., 0] = ay * bz - az * by
    out[..., 1] = az * bx - ax * bz
    out[..., 2] = ax * by - ay * bx
    return out


def exp(rotation_vector: ArrayLike) -> np.ndarray:
    """Quaternions [..., 4] of rotation vectors [..., 3] [rad]."""
    v = np.asarray(rotation_vector, dtype=np.float64)
    angle = np.linalg.norm(v, axis=-1, keepdims=True)
    half = 0.5 * angle
    scale = np.where(angle > SMALL_ANGLE, np.sin(half) / np.maximum(angle, SMALL_ANGLE), 0.5)
    return np.concatenate([np.cos(half), scale * v], axis=-1)


def log(wxyz: ArrayLike) -> np.ndarray:
    """Rotation vectors [..., 3] [rad] of the shortest arc, length ≤ π."""
    q = np.asarray(wxyz, dtype=np.float64)
    q = np.where(q[..., :1] < 0, -q, q)
    s = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(s, q[..., :1])
    scale = np.where(s > SMALL_ANGLE, angle / np.maximum(s, SMALL_ANGLE), 2.0)
    return scale * q[..., 1:]


def from_axis_angle(axis: ArrayLike, angle: ArrayLike) -> np.ndarray:
    """Quaternions [..., 4] of unit axes [..., 3] and angles [...] [rad]."""
    half = 0.5 * np.asarray(angle, dtype=np.float64)[..., None]
    axis = np.asarray(axis, dtype=np.float64)
    s = np.sin(half) * axis
    return np.concatenate([np.broadcast_to(np.cos(half), (*s.shape[:-1], 1)), s], axis=-1)


def from_yaw(yaw: ArrayLike) -> np.ndarray:
    """Quaternions [..., 4] of turns about +Y [rad]."""
    half = 0.5 * np.asarray(yaw, dtype=np.float64)
    zero = np.zeros_like(half)
    return np.stack([np.cos(half), zero, np.sin(half), zero], axis=-1)


def between(a: ArrayLike, b: ArrayLike) -> np.ndarray:
    """The shortest rotation [..., 4] that turns directions a [..., 3] onto b."""
    a = np.asarray(a, dtype=np.float64)
    b = np.asarray(b, dtype=np.float64)
    a = a / np.maximum(np.linalg.norm(a, axis=-1, keepdims=True), 1e-30)
    b = b / np.maximum(np.linalg.norm(b, axis=-1, keepdims=True), 1e-30)
    a, b = np.broadcast_arrays(a, b)
    w = 1.0 + np.sum(a * b, axis=-1, keepdims=True)
    # Opposite directions: half a turn about any axis at right angles to a.
    pick = np.where(np.abs(a[..., :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    v = np.where(w > 1e-9, np.cross(a, b), np.cross(a, pick))
    return normalize(np.concatenate([np.where(w > 1e-9, w, 0.0), v], axis=-1))


def slerp(a: ArrayLike, b: ArrayLike, t: ArrayLike) -> np.ndarray:
    """Quaternions [..., 4] at fractions t [...] along the shortest arc from a to b."""
    step = log(multiply(conjugate(a), b))
    return multiply(a, exp(np.asarray(t, dtype=np.float64)[..., None] * step))


def angle(a: ArrayLike, b: ArrayLike) -> np.ndarray:
    """Angles [...] [rad], 0..π, between rotations."""
    return np.linalg.norm(log(multiply(conjugate(a), b)), axis=-1)


def continuous(wxyz: ArrayLike) -> np.ndarray:
    """The same rotations [F, ..., 4] with signs chosen so that neighbours in time are near."""
    q = np.array(wxyz, dtype=np.float64)
    if len(q) > 1:
        dots = np.sum(q[1:] * q[:-1], axis=-1)
        sign = np.cumprod(np.where(dots < 0, -1.0, 1.0), axis=0)
        q[1:] *= sign[..., None]
    return q


def from_euler(order: str, angles: ArrayLike, *, degrees: bool) -> np.ndarray:
    """Quaternions [..., 4] of Euler angles [..., n]; order as SciPy: 'ZYX' turns with the body."""
    a = np.asarray(angles, dtype=np.float64)
    flat = Rotation.from_euler(order, a.reshape(-1, len(order)), degrees=degrees)
    return flat.as_quat(scalar_first=True).reshape(*a.shape[:-1], 4)


def to_euler(order: str, wxyz: ArrayLike, *, degrees: bool) -> np.ndarray:
    """Euler angles [..., 3] of quaternions [..., 4]; ``order`` as in :func:`from_euler`."""
    q = np.asarray(wxyz, dtype=np.float64)
    flat = Rotation.from_quat(q.reshape(-1, 4), scalar_first=True)
    return flat.as_euler(order, degrees=degrees, suppress_warnings=True).reshape(*q.shape[:-1], 3)


def to_matrix(wxyz: ArrayLike) -> np.ndarray:
    """Rotation matrices [..., 3, 3]."""
    q = np.asarray(wxyz, dtype=np.float64)
    flat = Rotation.from_quat(q.reshape(-1, 4), scalar_first=True)
    return flat.as_matrix().reshape(*q.shape[:-1], 3, 3)


def from_matrix(matrix: np.ndarray) -> np.ndarray:
    """Quaternions [..., 4] of rotation matrices [..., 3, 3], which are taken to be such.

    Of the four ways to take the square root the one with the largest pivot (Shepperd 1978).
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = (
        [matrix[..., r, c] for c in range(3)] for r in range(3)
    )
    rows = (
        (1.0 + xx + yy + zz, zy - yz, xz - zx, yx - xy),
        (zy - yz, 1.0 + xx - yy - zz, yx + xy, xz + zx),
        (xz - zx, yx + xy, 1.0 - xx + yy - zz, zy + yz),
        (yx - xy, xz + zx, zy + yz, 1.0 - xx - yy + zz),
    )
    pivot = np.argmax(np.stack([rows[k][k] for k in range(4)], axis=-1), axis=-1)[..., None]
    q = np.stack(rows[0], axis=-1)
    for k in range(1, 4):
        if np.any(pivot == k):
            q = np.where(pivot == k, np.stack(rows[k], axis=-1), q)
    return normalize(q)


def wrap_angle(angle: ArrayLike) -> np.ndarray:
    """Angles [...] wrapped to [-π, π)."""
    return (np.asarray(angle, dtype=np.float64) + np.pi) % (2 * np.pi) - np.pi


# Planar transforms (x, z, yaw) -------------------------------------------------------------------


def planar_apply(xzyaw: ArrayLike, point: ArrayLike) -> np.ndarray:
    """Points [..., 3] carried from the planar frame into the frame it is given in."""
    t = np.asarray(xzyaw, dtype=np.float64)
    p = np.asarray(point, dtype=np.float64)
    c, s = np.cos(t[..., 2]), np.sin(t[..., 2])
    x = c * p[..., 0] + s * p[..., 2] + t[..., 0]
    z = -s * p[..., 0] + c * p[..., 2] + t[..., 1]
    return np.stack([x, np.broadcast_to(p[..., 1], x.shape), z], axis=-1)


def planar_compose(a: ArrayLike, b: ArrayLike) -> np.ndarray:
    """The transform [..., 3] that applies b first, then a."""
    a = np.asarray(a, dtype=np.float64)
    b = np.asarray(b, dtype=np.float64)
    c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
    return np.stack(
        [
            c * b[..., 0] + s * b[..., 1] + a[..., 0],
            -s * b[..., 0] + c * b[..., 1] + a[..., 1],
            wrap_angle(a[..., 2] + b[..., 2]),
        ],
        axis=-1,
    )


def planar_compose_one(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """:func:`planar_compose` of two transforms [3], in a tenth of the time."""
    ax, az, yaw, x, z, turn = *a.tolist(), *b.tolist()
    c, s = math.cos(yaw), math.sin(yaw)
    whole = math.remainder(yaw + turn, 2.0 * math.pi)
    return np.array([c * x + s * z + ax, -s * x + c * z + az, whole])


def planar_inverse(xzyaw: ArrayLike) -> np.ndarray:
    """The inverse transform [..., 3]."""
    t = np.asarray(xzyaw, dtype=np.float64)
    c, s = np.cos(t[..., 2]), np.sin(t[..., 2])
    return np.stack(
        [
            -(c * t[..., 0] - s * t[..., 1]),
            -(s * t[..., 0] + c * t[..., 1]),
            wrap_angle(-t[..., 2]),
        ],
        axis=-1,
    )
