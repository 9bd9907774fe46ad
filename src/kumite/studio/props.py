"""Things on the stage that are no bodies: targets with a handle to drag, and bursts of hits."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import viser

from kumite.body import RGB, mix
from kumite.rotation import from_yaw
from kumite.scene.look import Part, shown
from kumite.scene.stage import SceneObject, in_sight
from kumite.studio.doors import a_place, a_way, safely
from kumite.studio.ring import STAGE

TARGET_COLOUR: RGB = (246, 196, 60)
STRUCK_COLOUR: RGB = (255, 255, 255)
BURSTS = 6  # at once
BURST_SECONDS = 0.35
FLASH_SECONDS = 0.25
SETTLE_HALFLIFE = 0.4  # s; the handle rests where the object hangs, not where it swings


class Targets:
    """A sphere, box, car or line for every object, and a gizmo at each one that can be dragged.
    What is far below the ground is hidden.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        objects: Sequence[SceneObject],
        moved: Callable[[str, np.ndarray], None],
        dragged: Callable[[int, str, np.ndarray, np.ndarray], None] | None = None,
    ) -> None:
        """dragged: told which page drags which of the objects that are dragged themselves, with the
        ray [3], [3] in the page's world that points to the new place. A gizmo, which they have
        otherwise, takes all clicks on them and round about.
        """
        self._objects = tuple(o.name for o in objects)
        self._sizes = [o.size for o in objects]
        self._shown = [
            _add_parts(server, f"{STAGE}/object/{i}", o, parts)
            if (parts := shown(o))
            else _add_sphere(server, f"{STAGE}/object/{i}", o)
            for i, o in enumerate(objects)
        ]
        self._radius = np.array([o.radius for o in objects])  # m, as drawn at scale 1
        self._gizmos: dict[int, viser.TransformControlsHandle] = {}
        self._held: set[tuple[int, int]] = set()  # pages, and what each drags
        self._flash = np.zeros(len(objects))  # s left
        for i, o in enumerate(objects):
            if o.draggable and dragged is None:
                self._gizmos[i] = self._add_gizmo(server, i, o, moved)
            elif o.draggable and dragged is not None:
                self._let_drag(i, o.name, dragged)

    def renew(self, server: viser.ViserServer, objects: Sequence[SceneObject]) -> None:
        """Draw what has another size since a restart: obstacles are as the seed has them."""
        for i, (o, size) in enumerate(zip(objects, self._sizes)):
            if o.size != size and (parts := shown(o)):
                self._shown[i].remove()
                self._shown[i] = _add_parts(server, f"{STAGE}/object/{i}", o, parts)
        self._sizes = [o.size for o in objects]

    def _let_drag(
        self, index: int, name: str, dragged: Callable[[int, str, np.ndarray, np.ndarray], None]
    ) -> None:
        def drag(event: viser.SceneNodeDragEvent) -> None:
            page = event.client_id
            (self._held.discard if event.phase == "end" else self._held.add)((page, index))
            eye = a_place("camera", event.client.camera.position)
            dragged(page, name, eye, a_way("drag", np.asarray(event.end_position) - eye))

        self._shown[index].on_drag(safely(drag))

    def _add_gizmo(
        self,
        server: viser.ViserServer,
        index: int,
        thing: SceneObject,
        moved: Callable[[str, np.ndarray], None],
    ) -> viser.TransformControlsHandle:
        gizmo = server.scene.add_transform_controls(
            f"{STAGE}/gizmo/{index}",
            scale=gizmo_scale(thing.radius),
            disable_rotations=True,
            depth_test=False,
            position=thing.position,
        )

        def drag(event: viser.TransformControlsEvent) -> None:
            held = (-1 if event.client_id is None else event.client_id, index)
            if event.phase == "start":
                self._held.add(held)
            elif event.phase == "end":
                self._held.discard(held)
            moved(thing.name, np.array(event.target.position, dtype=np.float64))

        gizmo.on_update(safely(drag))
        return gizmo

    def held(self, page: int) -> bool:
        """Whether a page drags one: its ground must not slide away under the pointer."""
        return any(holder == page for holder, _ in self._held)

    def let_go(self, page: int) -> None:
        """A page has gone, whatever it held."""
        self._held = {held for held in self._held if held[0] != page}

    def strike(self, name: str) -> None:
        """Flash an object that was hit."""
        if name in self._objects:
            self._flash[self._objects.index(name)] = FLASH_SECONDS

    def draw(self, position: np.ndarray, radius: np.ndarray, seconds: float) -> None:
        """Put the objects at ``position`` [O, 3] m, ``seconds`` of wall time after the last; balls
        are of ``radius`` [O] m now.
        """
        left = 0.5 ** (seconds / SETTLE_HALFLIFE)
        seen = in_sight(position)
        for i, thing in enumerate(self._shown):
            if thing.visible != seen[i]:
                thing.visible = bool(seen[i])
            if not seen[i]:
                continue
            thing.position = position[i]
            scale = float(radius[i] / self._radius[i])
            if isinstance(thing, viser.IcosphereHandle) and thing.scale != scale:
                thing.scale = scale
            if self._flash[i] > 0 and isinstance(thing, viser.IcosphereHandle):
                self._flash[i] = max(self._flash[i] - seconds, 0.0)
                thing.color = mix(TARGET_COLOUR, STRUCK_COLOUR, self._flash[i] / FLASH_SECONDS)
            gizmo = self._gizmos.get(i)
            if gizmo is not None and all(i != held for _, held in self._held):
                gizmo.position = position[i] + (np.asarray(gizmo.position) - position[i]) * left


def _add_sphere(server: viser.ViserServer, name: str, thing: SceneObject) -> viser.IcosphereHandle:
    return server.scene.add_icosphere(
        name, radius=thing.radius, color=TARGET_COLOUR, subdivisions=3, position=thing.position
    )


def _add_parts(
    server: viser.ViserServer, name: str, thing: SceneObject, parts: tuple[Part, ...]
) -> viser.FrameHandle:
    frame = server.scene.add_frame(
        name, show_axes=False, position=thing.position, wxyz=from_yaw(thing.yaw)
    )
    for part in parts:
        r, g, b = (round(255 * c) for c in part.colour)
        server.scene.add_mesh_simple(
            f"{name}/{part.name}", part.vertices, part.faces, color=(r, g, b), flat_shading=True
        )
    return frame


def gizmo_scale(radius: float) -> float:
    """Length [m] of a gizmo's arrows around an object: out of the sphere, in reach of the mouse."""
    return max(3.0 * radius, 0.3)


class Bursts:
    """Flashes at the places where blows land: a ball that grows and fades."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._balls = [
            server.scene.add_icosphere(
                f"{STAGE}/burst/{i}",
                radius=1.0,
                color=(255, 236, 170),
                opacity=0.8,
                subdivisions=2,
                visible=False,
                cast_shadow=False,
                receive_shadow=False,
            )
            for i in range(BURSTS)
        ]
        self._age = np.full(BURSTS, np.inf)  # s
        self._size = np.zeros(BURSTS)  # m

    def add(self, position: Sequence[float], speed: float) -> None:
        """A burst at ``position`` [3] m; faster blows [m/s] make larger ones."""
        i = int(np.argmax(self._age))
        self._age[i] = 0.0
        self._size[i] = float(np.clip(0.07 + 0.012 * speed, 0.07, 0.2))
        self._balls[i].position = np.asarray(position, dtype=np.float64)

    def clear(self) -> None:
        """No burst outlives a restart."""
        self._age[:] = BURST_SECONDS
        self.draw(0.0)

    def draw(self, seconds: float) -> bool:
        """Age by ``seconds``; True while any is to be seen."""
        for i, ball in enumerate(self._balls):
            if not np.isfinite(self._age[i]):
                continue
            t = self._age[i] / BURST_SECONDS
            ball.visible = t < 1.0
            if t < 1.0:
                size = float(self._size[i] * (0.45 + 0.55 * np.sqrt(t)))
                ball.scale = size
                ball.opacity = float(0.85 * (1.0 - t))
                self._age[i] += seconds
            else:
                self._age[i] = np.inf
        return bool(np.any(np.isfinite(self._age)))
