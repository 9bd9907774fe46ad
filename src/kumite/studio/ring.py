"""The place: floor, light, camera, and the frame that everything on stage stands in.

To follow the fighters the studio moves the stage under the camera, not the camera: the user's
orbit then never fights with the server over the camera. Each page has a stage's frame of its own,
in which stands what is shown to all.
"""

from __future__ import annotations

import numpy as np
import viser

STAGE = "/stage"  # parent of all that moves with the fighters
BACKDROP = (20, 20, 20)  # the dark theme's own background, so that the floor fades into it
FOV = 0.70  # rad, vertical: about a 45 mm lens
EYE_HEIGHT = 1.45  # m
LOOK_HEIGHT = 0.95  # m
BACK, FARTHEST = 6.5, 20.0  # m from people at whom things are thrown, at least and at most
ASIDE = 0.5  # rad off straight before them
FARTHEST_BEHIND, BEHIND_HEIGHT = 10.0, 2.6  # m from who walks about, and above the floor
FOLLOW_HALFLIFE = 0.35  # s for the stage to make up half the way to the fighters' midpoint


def build(server: viser.ViserServer) -> None:
    """Floor and light in an empty scene."""
    scene = server.scene
    scene.set_up_direction("+y")
    scene.world_axes.visible = False
    scene.configure_default_lights(enabled=False)
    scene.configure_environment_map(hdri=None)
    scene.configure_fog(14.0, 40.0, color=BACKDROP)
    # One key light that casts the shadow, a cool rim from behind, and the sky.
    scene.add_light_directional(
        "/light/key",
        color=(255, 244, 226),
        intensity=2.6,
        cast_shadow=True,
        position=(2.2, 5.0, 2.6),
    )
    scene.add_light_directional(
        "/light/rim", color=(170, 200, 255), intensity=1.1, position=(-3.0, 3.0, -4.0)
    )
    scene.add_light_hemisphere(
        "/light/sky", sky_color=(235, 240, 255), ground_color=(92, 84, 78), intensity=1.5
    )
    scene.add_frame(STAGE, show_axes=False)
    scene.add_grid(
        f"{STAGE}/floor",
        width=120.0,
        height=120.0,
        plane="xz",
        cell_size=0.5,
        cell_thickness=0.8,
        cell_color=(74, 77, 84),
        section_size=1.0,
        section_thickness=1.1,
        section_color=(98, 102, 110),
        plane_color=(52, 54, 60),
        plane_opacity=1.0,
        shadow_opacity=0.55,
        fade_distance=32.0,
        fade_strength=1.4,
    )


def aim(server: viser.ViserServer, points: np.ndarray, centre: np.ndarray) -> None:
    """The camera a page starts with: side on to ``points`` [N, 3] m, all of them in the picture.

    ``centre`` [2] m is where on the ground the stage's frame puts its origin.
    """
    flat = points[:, [0, 2]] - centre
    reach = float(np.max(np.linalg.norm(flat, axis=1))) if len(flat) else 0.0
    # The axis of greatest spread lies across the picture.
    across = np.linalg.svd(flat)[2][0] if len(flat) > 1 and reach > 1e-3 else np.array([0.0, 1.0])
    towards = np.array([across[1], -across[0]])
    towards *= np.sign(towards @ np.array([1.0, 0.6])) or 1.0
    _look_from(server, towards * max((reach + 0.75) / np.tan(FOV / 2), 3.4), reach)


def aim_at(server: viser.ViserServer, points: np.ndarray, yaw: float, centre: np.ndarray) -> None:
    """The camera of a page from which things are thrown at people at ``points`` [N, 3] m who face
    ``yaw`` [rad]: before them. It does not go back as far as would show all of many.
    """
    reach = float(np.linalg.norm(points[:, [0, 2]] - centre, axis=1).max())
    distance = np.clip((reach + 0.75) / np.tan(FOV / 2), BACK, FARTHEST)
    _look_from(server, distance * np.array([np.sin(yaw + ASIDE), np.cos(yaw + ASIDE)]), reach)


def aim_behind(
    server: viser.ViserServer, points: np.ndarray, yaw: float, centre: np.ndarray
) -> None:
    """The camera of a page that shows people on their way among ``points`` [N, 3] m, the first of
    whom faces ``yaw`` [rad]: from behind and above, so that the floor can be pointed at. It does
    not go back as far as would show all of a long way.
    """
    reach = float(np.linalg.norm(points[:, [0, 2]] - centre, axis=1).max())
    distance = np.clip((reach + 0.75) / np.tan(FOV / 2), BACK, FARTHEST_BEHIND)
    way = -np.array([np.sin(yaw + ASIDE), np.cos(yaw + ASIDE)])
    _look_from(server, distance * way, 0.0, BEHIND_HEIGHT)


def _look_from(
    server: viser.ViserServer, eye: np.ndarray, reach: float, height: float = EYE_HEIGHT
) -> None:
    lift = height + 0.35 * max(reach - 2.0, 0.0)  # a crowd is seen from above
    camera = server.initial_camera
    camera.fov = FOV
    camera.near = 0.05
    camera.up = (0.0, 1.0, 0.0)
    camera.position = (float(eye[0]), float(lift), float(eye[1]))
    camera.look_at = (0.0, LOOK_HEIGHT, 0.0)


class Follow:
    """Keeps the fighters' midpoint [x, z] at the world's origin, smoothly."""

    def __init__(self, frame: viser.FrameHandle) -> None:
        self._frame = frame
        self.on = True
        self.centre = np.zeros(2)  # m, the point of the stage that lies at the world's origin

    def jump(self, centre: np.ndarray) -> None:
        """At once: the scene starts or is wound."""
        self.centre = np.array(centre, dtype=np.float64)
        self._frame.position = (-self.centre[0], 0.0, -self.centre[1])

    def update(self, midpoint: np.ndarray, seconds: float) -> None:
        """Move on by ``seconds`` of wall time towards ``midpoint`` [2] m."""
        if self.on:
            left = 0.5 ** (seconds / FOLLOW_HALFLIFE)
            self.jump(midpoint + (self.centre - midpoint) * left)
