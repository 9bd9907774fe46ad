"""What somebody prepares for, to be seen: the goal, and the reference posture where it is begun.

The posture is a translucent body in the facing frame that a target motion is to be begun at, with
the hull of what supports it and its centre of mass on the floor.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
import viser

from kumite.body import RGB, BodyMesh, main_colours, mix, skin_vertices
from kumite.clip import Skeleton
from kumite.rotation import from_yaw
from kumite.scene.look import line
from kumite.scene.stage import Led, Preparation
from kumite.studio.ring import STAGE

BODY_COLOUR: RGB = (150, 210, 255)
SUPPORT_COLOUR: RGB = (90, 230, 130)
CENTRE_COLOUR: RGB = (255, 92, 60)
OPACITY, SUPPORT_OPACITY = 0.35, 0.6
GOAL_RADIUS, CENTRE_RADIUS = 0.22, 0.03  # m
LIFT = 0.012  # m above the floor
CENTRE_SIDES = 16


@dataclass
class Asked:
    """What the page asks to see of whom."""

    who: int = 0
    goal: bool = True
    posture: bool = False
    support: bool = False


class PreparedPicture(NamedTuple):
    """What one drawing needs of the stage, copied under the lock."""

    goal: np.ndarray | None  # [2] m, x and z
    motion: str | None  # whose reference posture is shown
    begins: np.ndarray  # [3] the facing frame that it is begun at
    asked: Asked


@dataclass
class Prepared:
    """Of one walker at a time: nothing is sent of what is switched off, or has not changed."""

    nodes: viser.SceneApi
    walk: Led
    skeleton: Skeleton
    mesh: BodyMesh
    names: tuple[str, ...]  # of all on the stage
    asked: Asked = field(default_factory=Asked)

    def __post_init__(self) -> None:
        self._bodies: dict[str, viser.MeshHandle] = {}
        self._supports: dict[str, viser.FrameHandle] = {}
        self._frame = self.nodes.add_frame(f"{STAGE}/prepared", show_axes=False)
        part = line(GOAL_RADIUS)
        self._ring = self.nodes.add_mesh_simple(
            f"{STAGE}/goal",
            part.vertices,
            part.faces,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )
        self._of = -1  # whose colour the ring has

    def state(self) -> Preparation:
        """Under the lock: how things stand."""
        return self.walk.prepared(self.asked.who)

    @cached_property
    def _disc(self) -> tuple[np.ndarray, np.ndarray]:
        around = 2.0 * np.pi * np.arange(CENTRE_SIDES) / CENTRE_SIDES
        return _flat(CENTRE_RADIUS * np.stack([np.sin(around), np.cos(around)], axis=1), 2 * LIFT)

    # Drawing it.

    def look(self) -> PreparedPicture:
        """Under the lock: what is asked for, as it is now."""
        asked, now = self.asked, self.state()
        shows = now.begins is not None and (asked.posture or asked.support)
        return PreparedPicture(
            now.goal if asked.goal else None,
            now.prepares if shows else None,
            np.zeros(3) if now.begins is None else now.begins,
            Asked(**vars(asked)),
        )

    def draw(self, picture: PreparedPicture) -> None:
        """Show these, and no others."""
        if picture.goal is not None:
            if self._of != picture.asked.who:
                self._of = picture.asked.who
                colour = main_colours(self.names)[self.walk.led[self._of]]
                self._ring.color = mix(colour, (255, 255, 255), 0.3)
            self._ring.position = np.insert(picture.goal, 1, 0.0)
        self._switch(self._ring, picture.goal is not None)
        t = picture.motion
        if t is not None:
            x, z, yaw = picture.begins
            self._frame.position, self._frame.wxyz = (x, 0.0, z), from_yaw(yaw)
            if picture.asked.posture and t not in self._bodies:
                self._bodies[t] = self._add_body(t)
            if picture.asked.support and t not in self._supports:
                self._supports[t] = self._add_support(t)
        for n, body in self._bodies.items():
            self._switch(body, n == t and picture.asked.posture)
        for n, area in self._supports.items():
            self._switch(area, n == t and picture.asked.support)

    def _switch(self, handle: viser.SceneNodeHandle, on: bool) -> None:
        if handle.visible != on:
            handle.visible = on

    def skin(self, motion: str) -> np.ndarray:
        """Vertices [V, 3] m of a motion's reference posture, in its facing frame."""
        posture = self.walk.reference(motion)
        return skin_vertices(self.mesh, self.skeleton, posture.position, posture.wxyz)[0]

    def _add_body(self, motion: str) -> viser.MeshHandle:
        return self.nodes.add_mesh_simple(
            f"{STAGE}/prepared/body/{motion}",
            self.skin(motion).astype(np.float32),
            self.mesh.faces,
            color=BODY_COLOUR,
            opacity=OPACITY,
            cast_shadow=False,
            receive_shadow=False,
        )

    def _add_support(self, motion: str) -> viser.FrameHandle:
        name = f"{STAGE}/prepared/support/{motion}"
        posture, scene = self.walk.reference(motion), self.nodes
        frame = scene.add_frame(name, show_axes=False)
        centre = np.insert(posture.centre, 1, 0.0)
        vertices, faces = self._disc
        parts = [("centre", vertices + centre, faces, CENTRE_COLOUR, 1.0)]
        if len(posture.hull):
            parts.append(("area", *_flat(posture.hull, LIFT), SUPPORT_COLOUR, SUPPORT_OPACITY))
        for what, corners, triangles, colour, opacity in parts:
            scene.add_mesh_simple(
                f"{name}/{what}",
                corners.astype(np.float32),
                triangles,
                color=colour,
                opacity=opacity,
                side="double",
                cast_shadow=False,
                receive_shadow=False,
            )
        return frame


def _flat(corner_at: np.ndarray, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a convex area of the floor with these corners [n, 2] in turn."""
    k = np.arange(1, len(corner_at) - 1)
    faces = np.stack([np.zeros(len(k), dtype=int), k, k + 1], axis=1)
    return np.insert(corner_at, 1, height, axis=1), faces
