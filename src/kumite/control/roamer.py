"""A controller that moves about between attacks: near its home, or at a distance from somebody.

It always has something to do, so it may stand last.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from math import cos, pi, sin

import numpy as np

from kumite.control.protocol import Plain, View
from kumite.graph import Layer
from kumite.graph.spans import NO_STATE, nearest
from kumite.rotation import planar_compose_one

FEW = 3  # of the best ways to go on that are drawn from …
AS_GOOD = 0.15  # … if they cost no more above the best
HOME = 0.5  # rad for each metre away from home
TOO_FAR = 0.6  # m from home that is not minded …
ROAMING = 3.0  # … and by those who keep a distance
TOO_NEAR = 2.0  # rad for each metre nearer than the distance to keep …
TOO_WIDE = 1.0  # … and for each metre farther
IN_VAIN = 1.5  # rad, of a blow at nobody …
SOON = 0.6  # s after which at the latest it would come


class Roamer(Plain):
    """Moves about in a layer with avoidance parts, and avoids nothing. One object serves all."""

    name = "roam"

    def __init__(
        self,
        layer: Layer,
        homes: np.ndarray,
        *,
        watched: Callable[[int], np.ndarray | None] = lambda k: None,
        distance: float | None = None,
    ) -> None:
        """homes [K, 3]: facing frames that characters come back to. watched(k): the place [2] m
        that character k looks at; None: it looks where its home faces. distance: m to keep to
        that place; None: it stays at home.
        """
        self.library, self.layer = layer, layer.name
        self.homes, self.watched, self.distance = np.array(homes, dtype=float), watched, distance
        table, strikes = layer.table, layer.strikes
        part_of, _ = layer.parts_of_stretch
        avoids = part_of[1:] > part_of[:-1]
        peaks = np.sort(strikes.frame)
        soon = np.maximum(table.first + round(SOON * layer.clips.fps), table.last)
        self._strikes = np.searchsorted(peaks, soon, "right") > np.searchsorted(peaks, table.first)
        self._avoids = avoids
        self._ways: list[tuple[np.ndarray, ...] | None] = [None] * table.states
        self._states = np.full(len(layer.clips), NO_STATE)  # [F] at each frame
        self._states[table.state_frame] = np.arange(table.states)

    def restful(self) -> np.ndarray:
        """Stretches to begin after: those that avoid nothing and end with many ways to go on."""
        table = self.library.table
        calm = np.flatnonzero(~self._avoids)
        ways = np.diff(table.action_start)[table.target]
        return calm[ways[calm] >= np.median(ways[calm])] if len(calm) else np.arange(len(ways))

    def choose(self, view: View) -> int:
        """A way to go on that avoids nothing, looks where it should and stays where it should."""
        k, cast = view.me, view.cast
        stop = int(cast.stop[k])
        ways, dx, dz, turn, strikes = self._ways_from(self._state_at(stop))
        x, z, yaw = planar_compose_one(cast.anchor[k], self.library.clips.facing[stop]).tolist()
        c, s = cos(yaw), sin(yaw)
        x, z = x + c * dx + s * dz, z - s * dx + c * dz  # [W] where each way ends …
        home_x, home_z, home_yaw = self.homes[k].tolist()
        watched = self.watched(k)
        want = home_yaw if watched is None else np.arctan2(watched[0] - x, watched[1] - z)
        cost = np.abs((want - yaw - turn + pi) % (2.0 * pi) - pi)  # … and looks
        away = np.hypot(x - home_x, z - home_z)
        keeps = None if watched is None else self.distance
        cost += HOME * np.maximum(away - (TOO_FAR if keeps is None else ROAMING), 0.0)
        if watched is not None and keeps is not None:
            more = np.hypot(x - watched[0], z - watched[1]) - keeps
            cost += np.where(more < 0.0, -TOO_NEAR, TOO_WIDE) * more + IN_VAIN * strikes
        few = np.argsort(cost, kind="stable")[:FEW]
        few = few[cost[few] <= cost[few[0]] + AS_GOOD]
        return view.spans.span(self.layer, int(ways[few[view.rng.integers(len(few))]]))

    def _ways_from(self, state: int) -> tuple[np.ndarray, ...]:
        """The stretches [W] that avoid nothing from a state, or all if there are none; where each
        leads to (x, z and yaw), and whether it strikes."""
        found = self._ways[state]
        if found is None:
            table = self.library.table
            ways = table.stretch[table.actions_of(state)]
            calm = ways[~self._avoids[ways]]
            ways = calm if len(calm) else ways
            way = np.ascontiguousarray(table.displacement[ways].T)
            found = self._ways[state] = (ways, *way, self._strikes[ways])
        return found

    def _state_at(self, frame: int) -> int:
        """The state at a library frame, or the one most like it."""
        state = int(self._states[frame])
        return state if state != NO_STATE else int(self.library.table.target[self._nearest[frame]])

    @cached_property
    def _nearest(self) -> np.ndarray:
        return nearest(self.library)[0]
