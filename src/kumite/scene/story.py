"""What happens at a moment of a scene: someone changes opponent or style, a car drives through.

The story lines of Shum et al. 2012 (section VIII-C, figure 11): a strong enemy is "crashed into by
a car" at the end of the path; the hero "retreats into an alley where an ally joins in".
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from kumite.control import Progress
from kumite.rotation import planar_apply, planar_inverse
from kumite.scene.settings_fight import CueSettings, Moment, VehicleSettings
from kumite.scene.stage import SceneObject

BRAKE = 8.0  # m/s² of a vehicle that has run somebody over
CLEAR = 0.25  # m kept before a vehicle by the middle of whom it carries away


class Actors(Protocol):
    """What a story needs of a scene."""

    @property
    def names(self) -> tuple[str, ...]: ...
    @property
    def root_position(self) -> np.ndarray: ...
    @property
    def progress(self) -> list[Progress | None]: ...
    def take_cue(self, cue: CueSettings) -> None:
        """Somebody fights otherwise from now on."""
        ...

    def run_over(self, k: int, by: str, speed: float) -> None:
        """Character k falls."""
        ...

    def drag(self, k: int, way: np.ndarray) -> None:
        """Character k is moved over the ground by way [2] m, feet and all."""
        ...


class Story:
    """The cues and vehicles of a scene, and how far they are."""

    def __init__(
        self, cues: tuple[CueSettings, ...], vehicles: tuple[VehicleSettings, ...], fps: float
    ) -> None:
        self._cues = list(cues)
        self._dt = 1.0 / fps
        self.vehicles = [Vehicle(v) for v in vehicles]

    @property
    def objects(self) -> list[SceneObject]:
        return [v.body for v in self.vehicles]

    def step(self, scene: Actors, seconds: float) -> None:
        """A frame on: what is due begins, vehicles move."""
        for cue in [c for c in self._cues if _has_come(c, scene, seconds)]:
            self._cues.remove(cue)
            scene.take_cue(cue)
        for vehicle in self.vehicles:
            vehicle.drives = vehicle.drives or _has_come(vehicle.settings, scene, seconds)
            if vehicle.drives:
                vehicle.step(scene, self._dt)


def _has_come(moment: Moment, scene: Actors, seconds: float) -> bool:
    if moment.at is not None:
        return seconds >= moment.at
    waited_for = (scene.progress[scene.names.index(name)] for name in moment.waits_for)
    return all(p is not None and _is_at(p, moment.check_point) for p in waited_for)


def _is_at(progress: Progress, check_point: int) -> bool:
    """Whether a check point has been reached, or given up for a later one."""
    index = check_point % len(progress.route)
    return progress.index > index or (progress.index == index and progress.arrived is not None)


class Vehicle:
    """A box on its way."""

    def __init__(self, settings: VehicleSettings) -> None:
        self.settings = settings
        self.drives = False
        self.speed = settings.speed
        way = np.subtract(settings.end, settings.start)
        self.length = float(np.linalg.norm(way))
        self.ahead = way / self.length
        self.yaw = float(np.arctan2(way[0], way[1]))
        self.driven = 0.0  # m
        self._struck: set[int] = set()
        width, height, length = settings.size
        self.body = SceneObject(
            settings.name,
            self._middle(),
            0.5 * length,
            size=(width, height, length),
            yaw=self.yaw,
            wheels=True,
        )

    def _middle(self) -> np.ndarray:
        x, z = np.asarray(self.settings.start) + self.driven * self.ahead
        return np.array([x, 0.5 * self.settings.size[1], z])

    def step(self, scene: Actors, dt: float) -> None:
        """Move on; who is in the way is run down and carried along, and it brakes."""
        if self._struck:
            self.speed = max(self.speed - BRAKE * dt, 0.0)
        self.driven = min(self.driven + self.speed * dt, self.length)
        self.body.position = self._middle()
        moving = self.speed > 0.0 and self.driven < self.length
        width, height, length = self.settings.size
        here = np.array([self.body.position[0], self.body.position[2], self.yaw])
        seen = planar_apply(planar_inverse(here), scene.root_position)
        front = 0.5 * length + CLEAR
        inside = (
            (np.abs(seen[:, 0]) < 0.5 * width + CLEAR)
            & (np.abs(seen[:, 2]) < front)
            & (seen[:, 1] < height)
        )
        for k in np.flatnonzero(inside & moving).tolist():
            if k not in self._struck:
                self._struck.add(k)
                scene.run_over(k, self.settings.name, self.speed)
            scene.drag(k, (front - seen[k, 2]) * self.ahead)
