"""A skin for any skeleton: one mesh of a boxer, blended between the joints it is carried by."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from kumite import rotation
from kumite.body.boxer import make_surfaces
from kumite.body.stance import Stance, stand
from kumite.body.sweep import vertex_normals
from kumite.brief import brief
from kumite.checked import checked
from kumite.clip import Skeleton
from kumite.errors import KumiteError

ROLES = ("skin", "hair", "shirt", "shorts", "gloves", "shoes", "soles", "trim")
"""What a vertex is of; a palette gives each a colour. Vertices and faces are grouped by role."""


@checked
@brief
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

    def colours(self, palette: Mapping[str, tuple[int, int, int]]) -> np.ndarray:
        """Colours [V, 3], 0..1, from a palette that gives every role one (0..255)."""
        return (np.array([palette[r] for r in ROLES], dtype=np.float32) / 255.0)[self.role]


@checked
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


@checked
def body_mesh(skeleton: Skeleton, *, armed: bool = True) -> BodyMesh:
    """The skin of a boxer on any skeleton with the required roles; sizes follow from its bones.

    armed: with the sword that the skeleton may have a joint for.
    Errors: :class:`KumiteError` for roles that are missing and limbs without length.
    """
    stance = stand(skeleton)
    surfaces = sorted(
        make_surfaces(skeleton, stance, armed=armed), key=lambda s: ROLES.index(s.role)
    )
    start = np.cumsum([0, *(len(s.vertices) for s in surfaces)])
    vertices = np.concatenate([s.vertices for s in surfaces])
    normals = np.concatenate([vertex_normals(s.vertices, s.faces) for s in surfaces])
    faces = np.concatenate([s.faces + at for s, at in zip(surfaces, start)])
    joints, weights = _four_strongest(np.concatenate([s.weights for s in surfaces]))
    role = np.concatenate([np.full(len(s.vertices), ROLES.index(s.role)) for s in surfaces])
    vertices, normals = _unpose(skeleton, stance, vertices, normals, joints, weights)
    return BodyMesh(vertices, faces, normals, joints, weights, role)


def _four_strongest(dense: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Joints and weights [V, 4] of dense weights [V, J], largest first, rows summing to 1."""
    order = np.argsort(-dense, axis=1, kind="stable")[:, :4]
    weights = np.take_along_axis(dense, order, axis=1)
    weights = np.where(weights > 1e-3, weights, 0.0)
    weights = weights / weights.sum(axis=1, keepdims=True)
    return np.where(weights > 0, order, 0), weights


def _unpose(
    skeleton: Skeleton,
    stance: Stance,
    vertices: np.ndarray,
    normals: np.ndarray,
    joints: np.ndarray,
    weights: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Rest-pose vertices and normals [V, 3] that skinning carries onto the standing ones."""
    turn = rotation.to_matrix(stance.wxyz)
    shift = stance.position - np.einsum("jab,jb->ja", turn, skeleton.rest_positions)
    blend = np.einsum("vk,vkab->vab", weights, turn[joints])
    move = np.einsum("vk,vka->va", weights, shift[joints])
    # Bones that are turned against each other by half a turn blend to nothing.
    flat = np.linalg.det(blend) < 0.05
    blend[flat] = turn[joints[flat, 0]]
    move[flat] = shift[joints[flat, 0]]
    rest = np.linalg.solve(blend, (vertices - move)[..., None])[..., 0]
    rest_normals = np.linalg.solve(blend, normals[..., None])[..., 0]
    return rest, rest_normals / np.linalg.norm(rest_normals, axis=1, keepdims=True)
