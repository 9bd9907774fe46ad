"""Check points on the floor: discs joined by a line, in the colour of whom they are for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
import viser

from kumite.body import main_colours, mix
from kumite.control import Route
from kumite.control.routes import through
from kumite.errors import KumiteError
from kumite.studio.doors import a_place, a_way, safely
from kumite.studio.ring import STAGE

MOST_POINTS = 200  # of a path that is drawn
LIFT = 0.012  # m above the floor
LINE_WIDTH = 0.03  # m
SIDES = 36  # of a disc
BRIGHT = (255, 255, 255)
DONE, AHEAD, NEXT = 0.15, 0.4, 0.8  # how solid a disc is


@dataclass
class Sketch:
    """A path in the making."""

    who: int | None = None  # the fighter for whom; None: none is being drawn
    places: list[tuple[float, float]] = field(default_factory=list)  # (x, z) m

    def begin(self, who: int) -> None:
        self.who, self.places = who, []

    def add(self, place: tuple[float, float]) -> None:
        """One more check point. Errors: it is too far away, or one too many."""
        if len(self.places) >= MOST_POINTS:
            raise KumiteError(f"a path of {MOST_POINTS} check points already; expected 'Finish'")
        x, _, z = a_place("check point", [place[0], 0.0, place[1]]).tolist()
        self.places.append((x, z))

    def end(self) -> None:
        self.who, self.places = None, []


@dataclass(frozen=True)
class Path:
    """What is to be seen of a fighter's check points."""

    who: int
    route: Route
    index: int  # of the next one

    def shows(self, other: Path | None) -> bool:
        """Whether both look the same."""
        return other is not None and self.route is other.route and self.index == other.index


def sketched(sketch: Sketch) -> list[Path]:
    """The path in the making, as it is so far."""
    if sketch.who is None or not sketch.places:
        return []
    return [Path(sketch.who, through(sketch.places), 0)]


def on_floor(origin: np.ndarray, direction: np.ndarray) -> tuple[float, float] | None:
    """Where (x, z) a ray [3], [3] meets the floor, if it does."""
    if direction[1] >= 0.0 or origin[1] <= 0.0:
        return None
    place = origin - direction * (origin[1] / direction[1])
    return float(place[0]), float(place[2])


class Paths:
    """The check points of all fighters. A disc that is dragged says where its middle is now."""

    def __init__(
        self,
        server: viser.ViserServer,
        names: Sequence[str],
        moved: Callable[[int, int, int, np.ndarray, np.ndarray], None],
    ) -> None:
        """names: of all fighters. moved: told which page drags whose check point, which one, and
        the ray [3], [3] in the page's world that points to its new place.
        """
        self._scene = server.scene
        self._moved = moved
        self._colours = main_colours(names)
        self._shown: dict[int, Path] = {}
        self._handles: dict[int, list[viser.SceneNodeHandle]] = {}
        self._disc = _disc()
        self._held: set[int] = set()  # pages that drag one

    def held(self, page: int) -> bool:
        """Whether a page drags one: its ground must not slide away under the pointer."""
        return page in self._held

    def let_go(self, page: int) -> None:
        """A page has gone, whatever it held."""
        self._held.discard(page)

    def draw(self, paths: Iterable[Path]) -> None:
        """Show these, and no others."""
        wanted = {p.who: p for p in paths}
        for who in [*self._shown]:
            if who not in wanted:
                self._remove(who)
        for who, path in wanted.items():
            if path.shows(self._shown.get(who)):
                continue
            self._show(path)
            self._shown[who] = path

    def _remove(self, who: int) -> None:
        for handle in self._handles.pop(who):
            handle.remove()
        del self._shown[who]

    def _show(self, path: Path) -> None:
        before, who = self._shown.get(path.who), path.who
        count, colour = len(path.route), self._colours[path.who]
        place = np.zeros((count, 3))
        place[:, [0, 2]] = path.route.places
        place[:, 1] = LIFT
        radius = np.array([p.radius for p in path.route.points])
        number = np.arange(count)
        solid = np.where(number < path.index, DONE, np.where(number == path.index, NEXT, AHEAD))
        colours = np.array([mix(colour, BRIGHT, 0.45 if k == path.index else 0.0) for k in number])
        if before is not None and len(before.route) == count:
            discs = self._handles[who][0]
            assert isinstance(discs, viser.BatchedMeshHandle)
            discs.batched_positions = place.astype(np.float32)
            discs.batched_opacities = solid.astype(np.float32)
            discs.batched_colors = colours.astype(np.uint8)
            if count > 1:
                line = self._handles[who][1]
                assert isinstance(line, viser.LineSegmentsHandle)
                line.points = _segments(place)
            return
        if before is not None:
            self._remove(who)
        vertices, faces = self._disc
        discs = self._scene.add_batched_meshes_simple(
            f"{STAGE}/path/{who}/discs",
            vertices,
            faces,
            np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
            place,
            batched_scales=np.stack([radius, np.ones(count), radius], axis=1),
            batched_colors=colours.astype(np.uint8),
            batched_opacities=solid,
            opacity=1.0,
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )
        discs.on_drag(safely(lambda event: self._drag(who, event)))
        self._handles[who] = [discs]
        if count > 1:
            line = self._scene.add_line_segments(
                f"{STAGE}/path/{who}/line", _segments(place), np.array(colour), thickness=LINE_WIDTH
            )
            self._handles[who].append(line)

    def _drag(self, who: int, event: viser.SceneNodeDragEvent) -> None:
        (self._held.discard if event.phase == "end" else self._held.add)(event.client_id)
        if event.instance_index is None:
            return
        eye = a_place("camera", event.client.camera.position)
        way = a_way("drag", np.asarray(event.end_position) - eye)
        self._moved(event.client_id, who, event.instance_index, eye, way)


class Drawn:
    """The path in the making, in the page of whoever makes it."""

    def __init__(self, scene: viser.SceneApi, names: Sequence[str]) -> None:
        self._scene, self._colours = scene, main_colours(names)
        self._handles: list[viser.SceneNodeHandle] = []
        self._shown: tuple[int | None, int] = (None, 0)

    def draw(self, sketch: Sketch) -> None:
        """Show it as it is now."""
        shown = (sketch.who, len(sketch.places))
        if shown == self._shown:
            return
        self._shown = shown
        for handle in self._handles:
            handle.remove()
        self._handles = []
        for path in sketched(sketch):
            place = np.zeros((len(path.route), 3))
            place[:, [0, 2]], place[:, 1] = path.route.places, LIFT
            radius = np.array([p.radius for p in path.route.points])
            colour = self._colours[path.who]
            name, (vertices, faces) = f"{STAGE}/sketch", _disc()
            self._handles.append(
                self._scene.add_batched_meshes_simple(
                    f"{name}/discs",
                    vertices,
                    faces,
                    np.tile([1.0, 0.0, 0.0, 0.0], (len(place), 1)),
                    place,
                    batched_scales=np.stack([radius, np.ones(len(place)), radius], axis=1),
                    batched_colors=colour,
                    opacity=NEXT,
                    lod="off",
                    cast_shadow=False,
                    receive_shadow=False,
                )
            )
            if len(place) > 1:
                self._handles.append(
                    self._scene.add_line_segments(
                        f"{name}/line", _segments(place), np.array(colour), thickness=LINE_WIDTH
                    )
                )


def _segments(place: np.ndarray) -> np.ndarray:
    """The line [N - 1, 2, 3] through places [N, 3]."""
    return np.stack([place[:-1], place[1:]], axis=1).astype(np.float32)


def _disc() -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a flat disc of radius 1 that lies on the floor."""
    angle = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)
    rim = np.stack([np.sin(angle), np.zeros(SIDES), np.cos(angle)], axis=1)
    k = np.arange(SIDES)
    faces = np.stack([np.zeros(SIDES, dtype=int), k + 1, (k + 1) % SIDES + 1], axis=1)
    return np.concatenate([np.zeros((1, 3)), rim]), faces
