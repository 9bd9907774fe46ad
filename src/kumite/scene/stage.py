"""What can be watched: the live scene and the recording answer to the same few names."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from kumite.brief import brief
from kumite.checks import instance
from kumite.clip import Skeleton
from kumite.scene.recording import Event, Recording

RADIUS = 0.1  # m of an object of which a recording does not say it
OUT_OF_SIGHT = np.array([0.0, -50.0, 0.0])  # m, of an object that is not there now


@brief
@dataclass
class SceneObject:
    """A thing in the scene that is no character: a ball to hit, with a size a box, or a line on
    the floor about a place."""

    name: str
    position: np.ndarray  # [3] m, where its middle is now
    radius: float  # m
    draggable: bool = False
    size: tuple[float, float, float] | None = None  # m: width, height and length of a box
    yaw: float = 0.0  # rad, the way a box's length points
    line: bool = False  # round, of that radius
    thrown: bool = False  # comes and goes: nobody looks for it
    wheels: bool = False  # a box that is a car


def recorded_objects(recording: Recording) -> list[SceneObject]:
    """The objects of a recording, where they are in its first frame."""
    told = recording.settings
    radii, sizes = told.get("object_radius", {}), told.get("object_size", {})
    yaws = told.get("object_yaw", {})
    wheels = told.get("object_wheels", sizes)  # boxes were all cars before it was told
    return [
        SceneObject(
            name,
            recording.object_position[0, o].astype(np.float64),
            float(radii.get(name, RADIUS)),
            size=_size(sizes[name]) if name in sizes else None,
            yaw=float(yaws.get(name, 0.0)),
            line=name in told.get("object_line", ()),
            thrown=name in told.get("object_thrown", ()),
            wheels=name in wheels,
        )
        for o, name in enumerate(recording.objects)
    ]


def in_sight(position: np.ndarray) -> np.ndarray:
    """Which of places [..., 3] m are above the ground, or near to it."""
    return position[..., 1] > 0.5 * OUT_OF_SIGHT[1]


def _size(numbers: Sequence[float]) -> tuple[float, float, float]:
    width, height, length = numbers
    return float(width), float(height), float(length)


class Stage(Protocol):
    """A scene that moves on one frame at a time. K characters; what is shown is read only."""

    @property
    def title(self) -> str: ...
    @property
    def fps(self) -> float: ...
    @property
    def skeleton(self) -> Skeleton: ...
    @property
    def names(self) -> tuple[str, ...]: ...
    @property
    def seed(self) -> int: ...
    @property
    def frame(self) -> int:
        """Frames since the start."""
        ...

    @property
    def root_position(self) -> np.ndarray:
        """[K, 3] m, now."""
        ...

    @property
    def wxyz(self) -> np.ndarray:
        """[K, J, 4], now."""
        ...

    @property
    def objects(self) -> Sequence[SceneObject]: ...
    @property
    def events(self) -> Sequence[Event]:
        """Everything so far, oldest first."""
        ...

    def step(self) -> bool:
        """Move on one frame; False when there is no next one."""
        ...

    def reset(self, seed: int) -> None:
        """Start again."""
        ...

    def move_object(self, name: str, position: np.ndarray) -> None:
        """Put an object somewhere; the characters see it from the next frame on."""
        ...


class Playback:
    """A recording on the stage."""

    def __init__(self, recording: Recording) -> None:
        instance(recording, Recording, "Playback")
        self.title = recording.scene
        self.fps = recording.fps
        self.skeleton = recording.skeleton
        self.names = recording.names
        self.seed = int(recording.settings.get("seed", 0))
        self.unarmed = tuple(recording.settings.get("unarmed", ()))
        self.objects = recorded_objects(recording)
        self.load(recording)

    def load(self, recording: Recording) -> None:
        """Show another recording of the same characters and objects, from its start."""
        self.recording = recording
        self._all_events = sorted(recording.events, key=lambda e: e.frame)
        self._event_frames = [e.frame for e in self._all_events]
        self._events: list[Event] = []
        self.reset(self.seed)

    def _show(self) -> None:
        self.root_position = self.recording.root_position[self.frame].astype(np.float64)
        self.wxyz = self.recording.wxyz[self.frame].astype(np.float64)
        for o, thing in enumerate(self.objects):
            thing.position = self.recording.object_position[self.frame, o].astype(np.float64)

    def step(self) -> bool:
        if self.frame + 1 >= len(self.recording):
            return False
        self.frame += 1
        self._show()
        return True

    def reset(self, seed: int) -> None:
        self.frame = 0
        self._show()

    def seek(self, frame: int) -> None:
        self.frame = int(np.clip(frame, 0, len(self.recording) - 1))
        self._show()

    def move_object(self, name: str, position: np.ndarray) -> None:
        """Nothing can be moved in a recording."""

    @property
    def events(self) -> Sequence[Event]:
        # Asked for at every picture: bisected, and the last one handed out again while it holds.
        count = bisect_right(self._event_frames, self.frame)
        if count != len(self._events):
            self._events = self._all_events[:count]
        return self._events
