"""A controller that decides only while the opponent is near: between fights others are heard."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kumite.control.protocol import PASS, Controller, Plain, View
from kumite.kernels.blow import NOBODY

AWAY = 1.5  # times the distance at which a fight begins: from there on it is over


class Engage(Plain):
    """Lets another controller decide from when the opponent has come near until it is away.

    Where the opponent comes near in the midst of what somebody else has chosen, that is broken off
    if it may be.
    """

    def __init__(
        self, controller: Controller, near: float, over: Callable[[int], bool] = lambda k: False
    ) -> None:
        """near [m]: between two pelvises. over(k): whether there is nothing more to fight about
        with opponent k."""
        self.name, self.controller, self.near = controller.name, controller, near
        self.layer = getattr(controller, "layer", None)
        self._over = over
        self.engaged = False

    def start(self) -> None:
        self.engaged = False
        self.controller.start()

    def watch(self, view: View) -> int | None:
        if self.engaged or not view.free or self._away(view) > self.near:
            return None
        return int(view.cast.frame[view.me])

    def choose(self, view: View) -> int:
        self.engaged = self._away(view) <= self.near * (AWAY if self.engaged else 1.0)
        return self.controller.choose(view) if self.engaged else PASS

    def rate(self, view: View) -> float:
        return self.controller.rate(view)

    def interrupted(self, view: View) -> None:
        self.controller.interrupted(view)

    def _away(self, view: View) -> float:
        """How far the opponent is [m]; infinity without one to fight."""
        o = int(view.opponent[view.me])
        if o == NOBODY or self._over(o):
            return np.inf
        return float(np.hypot(*(view.place[o] - view.place[view.me])))
