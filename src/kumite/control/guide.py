"""Who leads somebody to a place: a learned controller, made fit for a body (Shum et al. 2013).

The controller (:mod:`kumite.control.preparation`) chooses among a few motions and levels by the
cells in which goal and source of influence are seen. A :class:`Guide` says what the choice means in
the library: which core to play, how to turn on the way, and, within the last cell, of which the
controller knows nothing more, how far to prepare so as to come to rest at the place itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kumite.control.approach import Approach
from kumite.control.preparation import PreparationPolicy
from kumite.errors import KumiteError
from kumite.graph import Library
from kumite.graph.hierarchy import ways_into_cores
from kumite.rotation import wrap_angle

SHORTEST_TURN = 0.5  # s in which a turn is made near the place, where steps are short
ASIDE = 0.6  # of the distance to the place: so far behind it lies what is steered for


@dataclass(frozen=True)
class Guide:
    """A policy and the library whose motions it chooses."""

    library: Library
    approach: Approach
    policy: PreparationPolicy

    def __post_init__(self) -> None:
        if self.library.preparing is None:
            raise KumiteError(
                "the library is not one for preparation; expected one built with "
                "'kumite build --level preparation'"
            )
        if len(self.policy.class_after) != len(self.approach.core):
            raise KumiteError("guide: the policy is of other motions")

    @cached_property
    def onward(self) -> np.ndarray:
        """The stretch [S, M] that leads from a state soonest into a core."""
        preparing = self.library.preparing
        assert preparing is not None
        cores = len(preparing.hierarchy.cores)
        return ways_into_cores(self.library.table, preparing.what, cores)

    def choose(
        self,
        row: np.ndarray,
        level: np.ndarray,
        goal: tuple[np.ndarray, np.ndarray],
        source: tuple[np.ndarray, np.ndarray],
    ) -> tuple[np.ndarray, np.ndarray]:
        """Motions (rows of the approach) and levels for W characters who did motions ``row`` and
        are prepared to ``level``; goal and source as they see them: distance [m], angle [rad]."""
        return self.policy.decide(row, level, *goal, *source)

    def turn(
        self, row: np.ndarray, bearing: np.ndarray, near: np.ndarray, alpha: np.ndarray
    ) -> np.ndarray:
        """How fast [rad/s] to turn towards what is seen at ``bearing`` [rad].

        The motions of an approach turn by a few angles; what is played turns by what is needed, in
        the time of the motion and at most by the largest of these; sooner near the place. Who is
        prepared turns as much less as the way gets shorter (alpha: 0 to 1).
        """
        most = np.abs(self.approach.steer).max()
        seconds = self.approach.motions.duration[row]
        rate = np.clip(bearing / np.where(near, SHORTEST_TURN, seconds), -most / seconds, most / seconds)
        return np.where(self.moves[row], rate, 0.0) * (1.0 - alpha)

    @cached_property
    def moves(self) -> np.ndarray:
        """Which motions [M'] get somewhere: who stands does not turn."""
        way = self.approach.motions.displacement[:, 0]
        return np.hypot(way[:, 0], way[:, 1]) > 0.1

    def settle(self, distance: np.ndarray) -> np.ndarray:
        """Level at a distance [m] to the place: from 0 a cell away to 1 at it, so that steps get
        shorter as the way does. (The paper forces 1 on reaching the cell, 0.6 m too soon.)"""
        return np.clip(1.0 - distance / self.policy.settings.goal_step, 0.0, 1.0)


def seen(facing: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distances [K] m and angles [K] rad to the left at which places [K, 2] are seen from facing
    frames [K, 3]."""
    way = place - facing[:, :2]
    return np.hypot(way[:, 0], way[:, 1]), wrap_angle(
        np.arctan2(way[:, 0], way[:, 1]) - facing[:, 2]
    )


def steered_for(facing: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """Places [K, 2] to steer for, so as to come to goals [K, 3] with their heading: behind them,
    less and less. A heading of NaN is any."""
    away = np.hypot(*(goal[:, :2] - facing[:, :2]).T)
    heading = np.stack([np.sin(goal[:, 2]), np.cos(goal[:, 2])], axis=1)
    return goal[:, :2] - np.nan_to_num(heading) * (ASIDE * away)[:, None]
