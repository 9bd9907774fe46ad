"""Leading by hand: what a click into the picture means, and which way an arrow key points.

A click on a thing, or near it, sends the walker to it; any other click to that place of the floor.
An arrow key sends it a few steps into that direction as the viewer sees it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kumite.rotation import from_yaw, rotate
from kumite.scene.stage import Led, SceneObject
from kumite.studio.doors import a_place
from kumite.studio.paths import on_floor

NEAR = 0.4  # m from a thing's surface to a ray that means it
STEP = 2.5  # m that an arrow key sends a walker
APART = 0.1  # m between the points that a bar is tried at
UP, LEFT, DOWN, RIGHT = "↑", "←", "↓", "→"
WAYS = {UP: (1, 0), DOWN: (-1, 0), LEFT: (0, -1), RIGHT: (0, 1)}  # shares ahead and to the right


def meant(
    eye: np.ndarray, way: np.ndarray, objects: Sequence[SceneObject], names: Sequence[str]
) -> str | tuple[float, float] | None:
    """What a ray from an eye [3] along a way [3] means: the thing that it comes nearest to within
    0.4 m before it meets the floor, else the place (x, z) of the floor; None: the sky.

    names: of things; an object "bar, left" is part of the thing "bar".
    """
    way = way / np.linalg.norm(way)
    place = on_floor(eye, way)
    far = np.inf if place is None else eye[1] / -way[1]
    best, found = NEAR, None
    for thing in objects:
        name = next((n for n in names if thing.name == n or thing.name.startswith(f"{n}, ")), None)
        if name is None:
            continue
        points, radius = _points(thing)
        along = np.clip((points - eye) @ way, 0.0, far)
        off = np.linalg.norm(points - eye - along[:, None] * way, axis=1).min() - radius
        if off < best:
            best, found = off, name
    return place if found is None else found


def _points(thing: SceneObject) -> tuple[np.ndarray, float]:
    """Points [n, 3] m in a ball or along a box, and how far [m] its surface is from them."""
    if thing.size is None:
        return thing.position[None], thing.radius
    size = np.array(thing.size)
    axis = int(np.argmax(size))
    count = 2 + int(size[axis] / APART)
    local = np.zeros((count, 3))
    local[:, axis] = np.linspace(-0.5, 0.5, count) * size[axis]
    return thing.position + rotate(from_yaw(thing.yaw), local), 0.5 * float(
        np.delete(size, axis).min()
    )


def way_seen(eye: np.ndarray, look_at: np.ndarray, up: np.ndarray, key: str) -> np.ndarray:
    """The way [2] (x, z) over the ground, of length 1, that an arrow points in a camera's picture:
    up is away from the camera. up [3]: of the picture, for a camera that looks straight down."""
    ahead = (look_at - eye)[[0, 2]]
    if np.hypot(*ahead) < 1e-3 * np.linalg.norm(look_at - eye):
        ahead = up[[0, 2]]
    ahead = ahead / max(float(np.hypot(*ahead)), 1e-9)  # straight down with no side up: nowhere
    forward, right = WAYS[key]
    return forward * ahead + right * np.array([-ahead[1], ahead[0]])


@dataclass
class Leader:
    """Who is led, and what it is told; the caller keeps the scene from stepping meanwhile."""

    walk: Led
    names: Sequence[str]  # of all on the stage
    who: int = 0  # a row of those who are led

    @property
    def name(self) -> str:
        return self.names[self.walk.led[self.who]]

    @property
    def led(self) -> bool:
        """Whether the hand sends it to a place now."""
        return self.walk.sent(self.who)

    def point(self, eye: np.ndarray, way: np.ndarray, objects: Sequence[SceneObject]) -> None:
        """Send it to what a ray [3], [3] means. objects: where they were seen."""
        what = meant(eye, way, objects, self.walk.things)
        if isinstance(what, str):
            self.walk.go_to(self.who, what)
        elif what is not None:
            x, _, z = a_place("goal", [what[0], 0.0, what[1]])
            self.walk.go(self.who, np.array([x, z]))

    def press(self, eye: np.ndarray, look_at: np.ndarray, up: np.ndarray, key: str) -> None:
        """Send it into the direction of an arrow as a camera sees it."""
        here = self.walk.place(self.who)
        self.walk.go(self.who, here + STEP * way_seen(eye, look_at, up, key))

    def trigger(self, motion: str) -> str | None:
        """Let it do a target motion; else what it is busy with."""
        if self.walk.trigger(self.who, motion):
            return None
        return self.walk.prepared(self.who).does
