"""A controller that moves about between attacks: near its home, or at a distance from somebody.

It always has something to do, so it may stand last.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from kumite.control.protocol import Plain, View
from kumite.graph import Layer
from kumite.graph.spans import nearest
from kumite.rotation import planar_compose, wrap_angle

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
        self._ways: list[np.ndarray | None] = [None] * table.states
        self._avoids = avoids

    def restful(self) -> np.ndarray:
        """Stretches to begin after: those that avoid nothing and end with many ways to go on."""
        table = self.library.table
        calm = np.flatnonzero(~self._avoids)
        ways = np.diff(table.action_start)[table.target]
        return calm[ways[calm] >= np.median(ways[calm])] if len(calm) else np.arange(len(ways))

    def choose(self, view: View) -> int:
        """A way to go on that avoids nothing, looks where it should and stays where it should."""
        k, table, cast = view.me, self.library.table, view.cast
        stop = int(cast.stop[k])
        ways = self._ways_from(self._state_at(stop))
        facing = planar_compose(cast.anchor[k], self.library.clips.facing[stop])
        ends = planar_compose(facing, table.displacement[ways])
        home, watched = self.homes[k], self.watched(k)
        if watched is None:
            want = np.full(len(ends), home[2])
        else:
            want = np.arctan2(watched[0] - ends[:, 0], watched[1] - ends[:, 1])
        off = np.abs(wrap_angle(want - ends[:, 2]))
        away = np.linalg.norm(ends[:, :2] - home[:2], axis=1)
        keeps = watched is not None and self.distance is not None
        cost = off + HOME * np.maximum(away - (ROAMING if keeps else TOO_FAR), 0.0)
        if keeps:
            more = np.linalg.norm(ends[:, :2] - watched, axis=1) - self.distance
            cost += np.where(more < 0.0, -TOO_NEAR, TOO_WIDE) * more + IN_VAIN * self._strikes[ways]
        few = np.argsort(cost, kind="stable")[:FEW]
        few = few[cost[few] <= cost[few[0]] + AS_GOOD]
        return view.spans.span(self.layer, int(ways[view.rng.choice(few)]))

    def _ways_from(self, state: int) -> np.ndarray:
        """The stretches that avoid nothing from a state, or all if there are none."""
        found = self._ways[state]
        if found is None:
            table = self.library.table
            ways = table.stretch[table.actions_of(state)]
            calm = ways[~self._avoids[ways]]
            found = self._ways[state] = calm if len(calm) else ways
        return found

    def _state_at(self, frame: int) -> int:
        """The state at a library frame, or the one most like it."""
        table = self.library.table
        state = int(np.searchsorted(table.state_frame, frame))
        if state < table.states and table.state_frame[state] == frame:
            return state
        return int(table.target[self._nearest[frame]])

    @cached_property
    def _nearest(self) -> np.ndarray:
        return nearest(self.library)[0]
