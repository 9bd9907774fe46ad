"""Keeping time: how many frames are due now, without drift and without a growing debt."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from kumite.errors import KumiteError

MAX_DEBT = 0.25  # s behind before the clock starts anew: slow motion instead of a freeze
LEAST_DRAWN = 15  # pictures a second to keep up while frames are made too slowly


class Pace:
    """Frames at a rate, counted from one anchor so that rounding never adds up."""

    def __init__(self, fps: float, clock: Callable[[], float] = time.perf_counter) -> None:
        self.fps = fps
        self._speed = 1.0
        self._clock = clock
        self.restart()

    @property
    def speed(self) -> float:
        """Seconds of the scene in a second of wall time."""
        return self._speed

    @speed.setter
    def speed(self, speed: float) -> None:
        if not 0.0 < speed < math.inf:
            raise KumiteError(f"speed {speed}: expected a finite number above 0")
        self._speed = speed
        self.restart()

    @property
    def rate(self) -> float:
        """Frames in a second of wall time."""
        return self.fps * self._speed

    def restart(self) -> None:
        """Count from now: after a pause or a jump."""
        self._anchor = self._clock()
        self._taken = 0

    def take(self) -> int:
        """The frames that are due and not yet taken; they count as taken."""
        behind = int((self._clock() - self._anchor) * self.rate) - self._taken
        if behind > max(1.0, MAX_DEBT * self.rate):
            self.restart()
            return min(behind, math.ceil(self.rate / LEAST_DRAWN))
        self._taken += behind
        return behind

    def wait(self) -> float:
        """Seconds until the next frame is due."""
        return max(self._anchor + (self._taken + 1) / self.rate - self._clock(), 0.0)
