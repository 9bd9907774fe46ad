"""A skin for any skeleton: one mesh of a boxer, blended between the joints it is carried by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kumite import rotation
from kumite.body.segments import Body, lay_body
from kumite.body.stance import stand
from kumite.clip import Skeleton
from kumite.errors import KumiteError

ROLES = ("skin", "hair", "shirt", "shorts", "gloves", "shoes", "soles", "trim")
"""What a vertex is of; a palette gives each a colour. Vertices and faces are grouped by role."""


@dataclass(frozen=True)
class BodyMesh:
    """A skin in the skeleton's rest pose: no joint turned, the root joint at the origin."""

    vertices: np.ndarray  # [V, 3] float32 m
    faces: np.ndarray  # [P, 3] int32, counter-clockwise from outside
    normals: np.ndarray  # [V, 3] float32, unit length
    joints: np.ndarray  # [V, 4] uint16, the joints that carry a vertex
    weights: np.ndarray  # [V, 4] float32, rows sum to 1, largest first; 0 with joint 0 when unused
    role: np.ndarray  # [V] uint8 index into ROLES, ascending; all corners of a face share it

    def __post_init__(self) -> None:
        put = object.__setattr__
        count = len(self.vertices)
        for name, shape, dtype in (
            ("vertices", (count, 3), np.float32),
            ("faces", (len(self.faces), 3), np.int32),
            ("normals", (count, 3), np.float32),
            ("joints", (count, 4), np.uint16),
            ("weights", (count, 4), np.float32),
            ("role", (count,), np.uint8),
        ):
            array = np.array(getattr(self, name), dtype=dtype)
            if array.shape != shape:
                raise KumiteError(f"body mesh: {name} is {array.shape}, expected {shape}")
            array.flags.writeable = False
            put(self, name, array)

    def __len__(self) -> int:
        return len(self.vertices)

    def colours(self, palette: dict[str, tuple[float, float, float]]) -> np.ndarray:
        """Colours [V, 3] from a palette that gives every role one (0..1)."""
        return np.array([palette[r] for r in ROLES], dtype=np.float32)[self.role]


def skin_vertices(
    mesh: BodyMesh, skeleton: Skeleton, position: np.ndarray, world_wxyz: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and normals [V, 3] of one pose: joint positions [J, 3], world rotations [J, 4].

    Linear blend skinning; the pose is what ``forward_kinematics`` returns for a frame.
    """
    turn = rotation.to_matrix(world_wxyz)
    shift = position - np.einsum("jab,jb->ja", turn, skeleton.rest_positions)
    blend = np.einsum("vk,vkab->vab", mesh.weights, turn[mesh.joints])
    move = np.einsum("vk,vka->va", mesh.weights, shift[mesh.joints])
    vertices = np.einsum("vab,vb->va", blend, mesh.vertices) + move
    normals = np.einsum("vab,vb->va", blend, mesh.normals)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return vertices, normals / np.maximum(length, 1e-12)


def body_mesh(skeleton: Skeleton, body: Body | None = None) -> BodyMesh:
    """The skin of a skeleton's body (laid on it by :func:`lay_body` unless given).

    Errors: roles that are missing; limbs without length.
    """
    from kumite.body.boxer import model

    return model(skeleton, stand(skeleton), body or lay_body(skeleton))
