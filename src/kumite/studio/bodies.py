"""Bodies in the browser: skinned meshes for a few fighters, instanced limbs for a crowd.

A skinned mesh of viser's has one colour, its own bones, and two messages a bone and frame; so a
body is cut into one mesh a colour, and each mesh gets only the bones that carry it. That reads
best, and costs some fifty messages a fighter and frame. A crowd is cut at the joints instead:
one rigid piece a joint and colour, instanced over all characters, two messages a piece and frame
however many they are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import viser

from kumite.body import RGB, ROLES, BodyMesh, Palette, body_mesh, mix, palettes
from kumite.body.spheres import SWORD
from kumite.clip import Skeleton
from kumite.rotation import multiply, rotate
from kumite.scene.stage import OUT_OF_SIGHT
from kumite.studio.ring import STAGE

CROWD = 9  # characters from which on they are drawn as a crowd
LEAST_WEIGHT = 0.08  # a joint that carries no vertex of a piece by more is not one of its bones
SHARE_OF_PIECE = 0.25  # of a face's weight; pieces overlap at the joints so that no gap opens
STRUCK: RGB = (255, 255, 255)
FLASH_SECONDS = 0.22


class Bodies(Protocol):
    """All characters of a stage."""

    def draw(self, position: np.ndarray, wxyz: np.ndarray, seconds: float) -> None:
        """World joint positions [K, J, 3] m and rotations [K, J, 4], ``seconds`` after the last."""
        ...

    def flash(self, character: int) -> None:
        """Brighten a character who was hit, for a moment."""
        ...


@dataclass(frozen=True)
class Piece:
    """Part of a skin with one colour for a character."""

    vertices: np.ndarray  # [v, 3] m, rest pose, root joint at the origin
    faces: np.ndarray  # [p, 3]
    joints: np.ndarray  # [b] the joints that carry it
    weights: np.ndarray  # [v, b] rows sum to 1


def dense_weights(mesh: BodyMesh, joints: int) -> np.ndarray:
    """How much each joint carries each vertex [V, J]."""
    out = np.zeros((len(mesh), joints))
    np.add.at(out, (np.arange(len(mesh))[:, None], mesh.joints), mesh.weights)
    return out


def cut(mesh: BodyMesh, weights: np.ndarray, faces: np.ndarray) -> Piece:
    """The piece of a skin made of ``faces`` [p, 3], with the joints that matter to it."""
    used, index = np.unique(faces, return_inverse=True)
    carried = weights[used]
    joints = np.flatnonzero(carried.max(axis=0) > LEAST_WEIGHT)
    carried = carried[:, joints]
    return Piece(
        mesh.vertices[used],
        index.reshape(-1, 3),
        joints,
        carried / carried.sum(axis=1, keepdims=True),
    )


def faces_by_colour(mesh: BodyMesh, colours: Palette) -> list[tuple[str, np.ndarray]]:
    """Faces [p, 3] of every colour, with a role that wears it."""
    role = mesh.role[mesh.faces[:, 0]]
    groups: dict[RGB, list[int]] = {}
    for i, name in enumerate(ROLES):
        if np.any(role == i):
            groups.setdefault(colours[name], []).append(i)
    return [(ROLES[g[0]], mesh.faces[np.isin(role, g)]) for g in groups.values()]


def pose_uncompiled(
    skeleton: Skeleton, root_position: np.ndarray, wxyz: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """As :func:`kumite.clip.forward_kinematics`, slower, with nothing to compile: a recording is
    seen at once."""
    position, world = np.empty((*wxyz.shape[:2], 3)), np.array(wxyz, dtype=np.float64)
    position[:, 0] = root_position
    for j in range(1, len(skeleton)):
        p = skeleton.parents[j]
        position[:, j] = position[:, p] + rotate(world[:, p], skeleton.offsets[j])
        world[:, j] = multiply(world[:, p], wxyz[:, j])
    return position, world


class _Flashes:
    """Which characters are bright from a blow, and how bright."""

    def __init__(self, count: int) -> None:
        self._left = np.zeros(count)  # s

    def start(self, character: int) -> None:
        self._left[character] = FLASH_SECONDS

    def age(self, seconds: float) -> dict[int, float]:
        """Brightness 0 to 1 of those whose colour changes now; 0 once at the end."""
        lit = np.flatnonzero(self._left > 0)
        self._left[lit] = np.maximum(self._left[lit] - seconds, 0.0)
        return {int(k): float(self._left[k] / FLASH_SECONDS) for k in lit}


class SkinnedBodies:
    """One skinned mesh a character and colour, its bones in the world's axes."""

    def __init__(
        self,
        server: viser.ViserServer,
        skeleton: Skeleton,
        mesh: BodyMesh,
        names: Sequence[str],
        own: Mapping[int, BodyMesh] | None = None,
    ) -> None:
        """own: meshes of characters who do not have the common one."""
        rest = skeleton.rest_positions
        self._flashes = _Flashes(len(names))
        self._meshes: list[list[tuple[viser.MeshSkinnedHandle, np.ndarray, RGB]]] = []
        for k, colours in enumerate(palettes(names)):
            mesh_of = (own or {}).get(k, mesh)
            weights = dense_weights(mesh_of, len(skeleton))
            parts = []
            for role, faces in faces_by_colour(mesh_of, colours):
                piece = cut(mesh_of, weights, faces)
                bones = len(piece.joints)
                handle = server.scene.add_mesh_skinned(
                    f"{STAGE}/body/{k}/{role}",
                    piece.vertices,
                    piece.faces,
                    bone_wxyzs=np.tile([1.0, 0.0, 0.0, 0.0], (bones, 1)),
                    bone_positions=rest[piece.joints],
                    skin_weights=piece.weights,
                    color=colours[role],
                )
                parts.append((handle, piece.joints, colours[role]))
            self._meshes.append(parts)

    @property
    def bones(self) -> int:
        """Bones a character, over all its meshes; each costs two messages a frame."""
        return sum(len(joints) for _, joints, _ in self._meshes[0]) if self._meshes else 0

    def flash(self, character: int) -> None:
        self._flashes.start(character)

    def draw(self, position: np.ndarray, wxyz: np.ndarray, seconds: float) -> None:
        for k, parts in enumerate(self._meshes):
            for handle, joints, _ in parts:
                for bone, j in zip(handle.bones, joints):
                    bone.wxyz = wxyz[k, j]
                    bone.position = position[k, j]
        for k, light in self._flashes.age(seconds).items():
            for handle, _, colour in self._meshes[k]:
                handle.color = mix(colour, STRUCK, 0.6 * light)


class CrowdBodies:
    """One instanced rigid piece a joint and role, over all characters."""

    def __init__(
        self,
        server: viser.ViserServer,
        skeleton: Skeleton,
        mesh: BodyMesh,
        names: Sequence[str],
        unarmed: np.ndarray,
    ) -> None:
        count, outfits = len(names), palettes(names)
        weights = dense_weights(mesh, len(skeleton))
        self._sword, self._unarmed = skeleton.roles.get(SWORD), unarmed
        rest = skeleton.rest_positions
        self._flashes = _Flashes(count)
        self._light = np.zeros(count)
        self._pieces: list[tuple[viser.BatchedMeshHandle, int, np.ndarray]] = []
        role_of_face = mesh.role[mesh.faces[:, 0]]
        share = weights[mesh.faces].mean(axis=1)  # [P, J]
        most = share.argmax(axis=1)
        for i, role in enumerate(ROLES):
            colours = np.array([outfit[role] for outfit in outfits], dtype=np.uint8)
            for j in range(len(skeleton)):
                own = (role_of_face == i) & ((share[:, j] >= SHARE_OF_PIECE) | (most == j))
                if not np.any(own & (most == j)):
                    continue
                piece = cut(mesh, weights, mesh.faces[own])
                handle = server.scene.add_batched_meshes_simple(
                    f"{STAGE}/crowd/{role}/{j}",
                    piece.vertices - rest[j],
                    piece.faces,
                    batched_wxyzs=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
                    batched_positions=np.zeros((count, 3)),
                    batched_colors=colours,
                    lod="off",
                )
                self._pieces.append((handle, j, colours))

    def flash(self, character: int) -> None:
        self._flashes.start(character)

    def draw(self, position: np.ndarray, wxyz: np.ndarray, seconds: float) -> None:
        lit = self._flashes.age(seconds)
        for k, light in lit.items():
            self._light[k] = 0.6 * light
        for handle, j, colours in self._pieces:
            handle.batched_wxyzs = wxyz[:, j].astype(np.float32)
            place = position[:, j].astype(np.float32)
            if j == self._sword:
                place[self._unarmed] = OUT_OF_SIGHT
            handle.batched_positions = place
            if lit:
                white = np.array(STRUCK) - colours.astype(np.float64)
                bright = colours + self._light[:, None] * white
                handle.batched_colors = bright.astype(np.uint8)


def show_bodies(
    server: viser.ViserServer,
    skeleton: Skeleton,
    mesh: BodyMesh,
    names: Sequence[str],
    unarmed: Sequence[str] = (),
) -> Bodies:
    """Bodies for everyone on the stage, in the way their number asks for.

    unarmed: names of those whose sword is not to be seen.
    """
    if len(names) >= CROWD:
        bare_handed = np.array([name in unarmed for name in names])
        return CrowdBodies(server, skeleton, mesh, names, bare_handed)
    bare = body_mesh(skeleton, armed=False) if unarmed else mesh
    own = {k: bare for k, name in enumerate(names) if name in unarmed}
    return SkinnedBodies(server, skeleton, mesh, names, own)
