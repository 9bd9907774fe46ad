"""Forward kinematics over frames. Shapes: F frames, J joints, parents before children."""

from __future__ import annotations

from numba import prange

from kumite.kernels.jit import kernel, parallel_kernel

MANY = 4000  # frames (2 ms of work) from which threads pay, on cores that others use too


@kernel
def quaternion_product(a, b, out):
    """Hamilton product a b of two wxyz quaternions into ``out`` (which may be neither)."""
    out[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
    out[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2]
    out[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1]
    out[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]


@kernel
def add_rotated(q, v, base, out):
    """``out = base + q v q⁻¹`` for one vector."""
    tx = 2.0 * (q[2] * v[2] - q[3] * v[1])
    ty = 2.0 * (q[3] * v[0] - q[1] * v[2])
    tz = 2.0 * (q[1] * v[1] - q[2] * v[0])
    out[0] = base[0] + v[0] + q[0] * tx + q[2] * tz - q[3] * ty
    out[1] = base[1] + v[1] + q[0] * ty + q[3] * tx - q[1] * tz
    out[2] = base[2] + v[2] + q[0] * tz + q[1] * ty - q[2] * tx


@kernel
def forward_kinematics_frame(parents, offsets, root_position, wxyz, position, world_wxyz):
    """One pose: joint positions [J, 3] and world rotations [J, 4]."""
    for c in range(3):
        position[0, c] = root_position[c]
    for c in range(4):
        world_wxyz[0, c] = wxyz[0, c]
    for j in range(1, parents.shape[0]):
        p = parents[j]
        add_rotated(world_wxyz[p], offsets[j], position[p], position[j])
        quaternion_product(world_wxyz[p], wxyz[j], world_wxyz[j])


@kernel
def forward_kinematics(parents, offsets, root_position, wxyz, position, world_wxyz):
    """All frames: positions [F, J, 3] and world rotations [F, J, 4]."""
    for f in range(root_position.shape[0]):
        forward_kinematics_frame(
            parents, offsets, root_position[f], wxyz[f], position[f], world_wxyz[f]
        )


@parallel_kernel
def forward_kinematics_many(parents, offsets, root_position, wxyz, position, world_wxyz):
    """:func:`forward_kinematics` on all cores: worth its start-up from ``MANY`` frames on."""
    for f in prange(root_position.shape[0]):
        forward_kinematics_frame(
            parents, offsets, root_position[f], wxyz[f], position[f], world_wxyz[f]
        )
