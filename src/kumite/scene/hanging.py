"""Things that hang in a scene and are struck at: they swing about their places and come back."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from kumite.clip import LIMBS
from kumite.kernels.blow import NO_BLOW, NOBODY, swept_contact
from kumite.scene.doors import a_place
from kumite.scene.floor import Floor, Landing
from kumite.scene.settings import ObjectSettings
from kumite.scene.stage import SceneObject

SWING = 0.35  # m/s that a struck thing gains per m/s of the blow
SWING_RATE = 7.0  # rad/s of its pendulum
SWING_DAMPING = 0.25  # of critical


class Hanging:
    """O things. ``seen`` [O, 4] is where they are and which way they face, for controllers."""

    def __init__(self, settings: Iterable[ObjectSettings]) -> None:
        settings = tuple(settings)
        self.objects = [
            SceneObject(o.name, np.array(o.position), o.radius, o.draggable) for o in settings
        ]
        self.seen = np.zeros((len(self.objects), 4))
        self.seen[:, 3] = np.radians([o.yaw_deg for o in settings])
        self._home = [thing.position.copy() for thing in self.objects]
        self._speed = [np.zeros(3) for _ in self.objects]
        self.look()

    def look(self) -> None:
        """Let controllers see where things are now."""
        for o, thing in enumerate(self.objects):
            self.seen[o, :3] = thing.position

    def move(self, name: str, position: np.ndarray) -> None:
        """Hang a thing elsewhere. Errors: a place that is not three finite numbers."""
        for o, thing in enumerate(self.objects):
            if thing.name == name:
                self._home[o] = a_place(position, name)
                thing.position = self._home[o].copy()
                self._speed[o][:] = 0.0

    def step(self, floor: Floor, thing: np.ndarray, tell: Callable[[Landing], None]) -> None:
        """A frame on. thing [K]: at which each character strikes, or NOBODY; tell: is told of each
        blow that lands, with the thing in place of a victim."""
        blows, fps = floor.blows, floor.fps
        for k in np.flatnonzero(thing != NOBODY).tolist():
            o = int(thing[k])
            at, radius = self.objects[o].position, self.objects[o].radius
            for s in range(len(LIMBS)):
                blow = int(blows.thrown[k, s])
                if blow in (NO_BLOW, blows.landed[k, s]):
                    continue
                p0, p1 = blows.tip[:, k, s]
                fist = floor.shapes.tip_radius[s]
                t = swept_contact(p0, p1, at, at, at, at, radius, radius, fist)
                if t < 0:
                    continue
                velocity = (p1 - p0) * fps
                blows.landed[k, s] = blow
                self._speed[o] += SWING * velocity
                tell(Landing(k, s, o, 0, blow, velocity, p0 + t * (p1 - p0), t))
        for o, hung in enumerate(self.objects):
            pull = SWING_RATE**2 * (self._home[o] - hung.position)
            drag = 2.0 * SWING_DAMPING * SWING_RATE * self._speed[o]
            self._speed[o] += (pull - drag) / fps  # semi-implicit Euler: stays bounded
            hung.position = hung.position + self._speed[o] / fps
