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
from scipy.spatial import ConvexHull

from kumite.annotate.balance import centre_of_mass, support
from kumite.annotate.reference import where_found
from kumite.body import RGB, BodyMesh, main_colours, mix, skin_vertices
from kumite.rotation import from_yaw, planar_apply, planar_inverse
from kumite.scene import PrepareScene
from kumite.scene.look import line
from kumite.scene.opponents import NOBODY
from kumite.scene.prepare import NO_THING
from kumite.scene.walkers import NOTHING, ON_THE_WAY
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


class Posture(NamedTuple):
    """A reference posture in its facing frame."""

    vertices: np.ndarray  # [V, 3] m
    hull: np.ndarray  # [n, 2] m, corners of the support area in turn, x and z; none where n is 0
    centre: np.ndarray  # [2] m, the centre of mass on the ground


class PreparedPicture(NamedTuple):
    """What one drawing needs of the stage, copied under the lock."""

    goal: np.ndarray | None  # [2] m, x and z
    target: int  # motion whose reference posture is shown, or NOTHING
    begins: np.ndarray  # [3] the facing frame that it is begun at
    asked: Asked


class State(NamedTuple):
    """How far somebody is prepared, and for what."""

    chosen: float  # level
    shown: float
    prepares: str | None  # the target motion
    does: str | None
    away: float | None  # m to its place


@dataclass
class Prepared:
    """Of one walker at a time: nothing is sent of what is switched off, or has not changed."""

    server: viser.ViserServer
    scene: PrepareScene
    mesh: BodyMesh
    asked: Asked = field(default_factory=Asked)

    def __post_init__(self) -> None:
        preparing = self.scene.library.preparing
        assert preparing is not None
        self._preparing = preparing
        self._postures: dict[int, Posture] = {}
        self._bodies: dict[int, viser.MeshHandle] = {}
        self._supports: dict[int, viser.FrameHandle] = {}
        self._frame = self.server.scene.add_frame(f"{STAGE}/prepared", show_axes=False)
        part = line(GOAL_RADIUS)
        self._ring = self.server.scene.add_mesh_simple(
            f"{STAGE}/goal",
            part.vertices,
            part.faces,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )
        self._of = -1  # whose colour the ring has

    # What there is to see.

    def _goes(self) -> bool:
        scene, k = self.scene, self.asked.who
        led = np.isfinite(scene.told[k, 0])
        return bool(led or scene.thing[k] != NO_THING or scene.opponents.foe[k] != NOBODY)

    def state(self) -> State:
        """Under the lock: how things stand."""
        w, k = self.scene.walkers, self.asked.who
        wants, doing = int(w.wants[k]), int(w.doing[k])
        label = self.scene.motions
        return State(
            float(w.level[k]),
            float(w.alpha[k]),
            None if wants == NOTHING else label[wants],
            None if doing == ON_THE_WAY else label[doing],
            float(w.off()[0][k]) if self._goes() else None,
        )

    def about(self, motion: str) -> str:
        """Which frame the reference posture of a target motion is."""
        t, p = self.scene.motions.index(motion), self._preparing
        mark = int(p.hierarchy.targets.mark[t])
        return where_found(int(p.reference[t]), mark, bool(p.found[t]))

    def posture(self, target: int) -> Posture:
        """The reference posture of a target motion."""
        if target not in self._postures:
            self._postures[target] = self._find(int(self._preparing.reference[target]))
        return self._postures[target]

    def _find(self, frame: int) -> Posture:
        library = self.scene.library
        clips, contacts = library.clips, library.contacts
        position, world = (x[frame] for x in clips.world)
        back = planar_inverse(clips.facing[frame])
        vertices, _ = skin_vertices(self.mesh, clips.skeleton, position, world)
        ground = contacts.on_ground[frame : frame + 1]
        corner_at, touches = support(clips.skeleton, position[None], world[None], ground)
        corners = corner_at[touches]
        hull = corners[ConvexHull(corners).vertices] if len(corners) > 2 else np.empty((0, 2))
        centre = centre_of_mass(self.scene.body, position, world)
        flat = np.insert(hull, 1, 0.0, axis=1)
        return Posture(
            planar_apply(back, vertices),
            planar_apply(back, flat)[:, [0, 2]],
            planar_apply(back, centre)[[0, 2]],
        )

    @cached_property
    def _disc(self) -> tuple[np.ndarray, np.ndarray]:
        around = 2.0 * np.pi * np.arange(CENTRE_SIDES) / CENTRE_SIDES
        return _flat(CENTRE_RADIUS * np.stack([np.sin(around), np.cos(around)], axis=1), 2 * LIFT)

    # Drawing it.

    def look(self) -> PreparedPicture:
        """Under the lock: what is asked for, as it is now."""
        w, asked = self.scene.walkers, self.asked
        k = asked.who
        goal, told = w.goal[k].copy(), self.scene.told[k].copy()
        # At a goal without a heading nothing is begun; who does a motion has begun it.
        begins = np.isfinite(goal[2]) and w.doing[k] == ON_THE_WAY
        shows = begins and (asked.posture or asked.support)
        return PreparedPicture(
            # Where the hand has just sent it, it goes from the next frame on.
            (told if np.isfinite(told[0]) else goal[:2]) if asked.goal and self._goes() else None,
            int(w.wants[k]) if shows else NOTHING,
            goal,
            Asked(**vars(asked)),
        )

    def draw(self, picture: PreparedPicture) -> None:
        """Show these, and no others."""
        if picture.goal is not None:
            if self._of != picture.asked.who:
                self._of = picture.asked.who
                self._ring.color = mix(
                    main_colours(self.scene.names)[self._of], (255, 255, 255), 0.3
                )
            self._ring.position = np.insert(picture.goal, 1, 0.0)
        self._switch(self._ring, picture.goal is not None)
        t = picture.target
        if t != NOTHING:
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

    def _add_body(self, target: int) -> viser.MeshHandle:
        return self.server.scene.add_mesh_simple(
            f"{STAGE}/prepared/body/{target}",
            self.posture(target).vertices.astype(np.float32),
            self.mesh.faces,
            color=BODY_COLOUR,
            opacity=OPACITY,
            cast_shadow=False,
            receive_shadow=False,
        )

    def _add_support(self, target: int) -> viser.FrameHandle:
        name = f"{STAGE}/prepared/support/{target}"
        posture, scene = self.posture(target), self.server.scene
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
