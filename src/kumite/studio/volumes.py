"""Volumes of an avoidance as translucent spheres: the body's, the attacks', and what was left."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import viser

from kumite.body import RGB
from kumite.control.attack import Attack
from kumite.control.avoidance import Plan
from kumite.scene.stage import Avoiding
from kumite.scene.volumes import Volume, attack_volume
from kumite.studio.ring import STAGE

BODY_COLOUR: RGB = (110, 190, 255)
ATTACK_COLOUR: RGB = (255, 92, 60)
LEFT_COLOUR: RGB = (90, 230, 130)
OPACITY = 0.28
MOST_ATTACKS = 24  # shown at once, those thrown last
SUBDIVISIONS = 1  # of the octahedron, twice: 66 corners


@dataclass
class Shown:
    """What the page asks to see."""

    who: int = 0  # whose volumes
    body: bool = False
    attacks: bool = False
    left: bool = False


class VolumePicture(NamedTuple):
    """What one drawing needs of the stage, copied under the lock."""

    body: Volume | None
    attacks: dict[int, Attack]
    plan: Plan | None
    left: Volume | None  # given when the plan is new


@dataclass
class Volumes:
    """Spheres on the stage. Nothing is sent of what is switched off, or has not changed."""

    nodes: viser.SceneApi
    avoiding: Avoiding
    shown: Shown = field(default_factory=Shown)

    def __post_init__(self) -> None:
        self._mesh = _ball()
        self._body: viser.BatchedMeshHandle | None = None
        self._attacks: dict[int, tuple[Attack, viser.BatchedMeshHandle]] = {}
        self._left: viser.BatchedMeshHandle | None = None
        self._plan: Plan | None = None  # whose volume is shown

    def look(self) -> VolumePicture:
        """Under the lock: what is asked for, as it is now."""
        shown, of, k = self.shown, self.avoiding, self.shown.who
        if k not in of.avoiding:
            return VolumePicture(None, {}, None, None)
        plan = of.plan(k) if shown.left else None
        return VolumePicture(
            of.body(k) if shown.body else None,
            dict(sorted(of.attacks().items())[-MOST_ATTACKS:]) if shown.attacks else {},
            plan,
            of.left(k) if plan is not None and plan is not self._plan else None,
        )

    def draw(self, picture: VolumePicture) -> None:
        """Show these, and no others."""
        self._draw_body(picture.body)
        for number in [n for n, (a, _) in self._attacks.items() if picture.attacks.get(n) is not a]:
            self._attacks.pop(number)[1].remove()
        for number, attack in picture.attacks.items():
            if number not in self._attacks:
                handle = self._add(f"attack {number}", attack_volume(attack), ATTACK_COLOUR)
                self._attacks[number] = attack, handle
        if picture.plan is None or picture.left is not None:
            self._plan = None
            if self._left is not None:
                self._left.remove()
                self._left = None
        if picture.plan is not None and picture.left is not None:
            self._plan = picture.plan
            if len(picture.left.radius):
                self._left = self._add("left", picture.left, LEFT_COLOUR)

    def _draw_body(self, body: Volume | None) -> None:
        if body is None:
            if self._body is not None:
                self._body.remove()
                self._body = None
        elif self._body is None:
            self._body = self._add("body", body, BODY_COLOUR)
        else:
            self._body.batched_positions = body.centre.astype(np.float32)

    def _add(self, name: str, volume: Volume, colour: RGB) -> viser.BatchedMeshHandle:
        vertices, faces = self._mesh
        count = len(volume.radius)
        return self.nodes.add_batched_meshes_simple(
            f"{STAGE}/volume/{name}",
            vertices,
            faces,
            np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
            volume.centre,
            batched_scales=volume.radius,
            batched_colors=colour,
            opacity=OPACITY,
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )


def _ball() -> tuple[np.ndarray, np.ndarray]:
    """Vertices [V, 3] and faces [P, 3] of a sphere of radius 1."""
    corners = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    triangles = np.array(
        [[corners[x], corners[y], corners[z]] for x in (0, 1) for y in (2, 3) for z in (4, 5)]
    )
    flipped = np.linalg.det(triangles) < 0
    triangles[flipped] = triangles[flipped][:, ::-1]
    for _ in range(2):
        a, b, c = triangles.transpose(1, 0, 2)
        ab, bc, ca = a + b, b + c, c + a
        ab, bc, ca = (m / np.linalg.norm(m, axis=1, keepdims=True) for m in (ab, bc, ca))
        triangles = np.concatenate(
            [np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    flat = triangles.reshape(-1, 3).round(9)
    vertices, index = np.unique(flat, axis=0, return_inverse=True)
    return vertices, index.reshape(-1, 3)
