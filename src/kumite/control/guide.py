"""Who leads somebody to a place: a learned controller, made fit for a body (Shum et al. 2013).

The controller (:mod:`kumite.control.preparation`) chooses among a few motions and levels by the
cells in which goal and source of influence are seen. A :class:`Guide` says what the choice means in
the library: which core to play, how to turn on the way, and, within the last cell, of which the
controller knows nothing more, how far to prepare so as to come to rest at the place itself.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from kumite.control.approaching import STEEREST, Approach, trained_approach
from kumite.control.preparation import PreparationPolicy, PreparationSettings, gradual
from kumite.errors import KumiteError
from kumite.graph import Layer
from kumite.graph.hierarchy import ways_into_cores
from kumite.rotation import wrap_angle

SHORTEST_TURN = 0.5  # s in which a turn is made near the place, where steps are short
ASIDE = 0.6  # of the distance to the place: so far behind it lies what is steered for


@dataclass(frozen=True)
class Guide:
    """A policy and the library whose motions it chooses."""

    library: Layer
    approach: Approach
    policies: tuple[PreparationPolicy, ...]  # one for each C of the root
    policy_of: np.ndarray  # [T] int64, the policy that prepares for a target motion

    def __post_init__(self) -> None:
        if self.library.preparing is None:
            raise KumiteError(
                "the library is not one for preparation; expected one built with "
                "'kumite build --layer preparation'"
            )
        if any(len(p.class_after) != len(self.approach.core) for p in self.policies):
            raise KumiteError("guide: a policy is of other motions")

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
        wants: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Motions (rows of the approach) and levels for W characters who did motions ``row`` and
        are prepared to ``level``; goal and source as they see them: distance [m], angle [rad].
        wants: target motions prepared for, or -1."""
        motion, chosen = np.empty(len(row), dtype=np.int64), np.empty(len(row))
        which = np.where(wants < 0, 0, self.policy_of[wants])
        for n in np.unique(which).tolist():
            of = which == n
            seen_now = (x[of] for x in (*goal, *source))
            motion[of], chosen[of] = self.policies[n].decide(row[of], level[of], *seen_now)
        return motion, chosen

    def turn(
        self, row: np.ndarray, bearing: np.ndarray, near: np.ndarray, alpha: np.ndarray
    ) -> np.ndarray:
        """How fast [rad/s] to turn towards what is seen at ``bearing`` [rad].

        The motions of an approach turn by a few angles; what is played turns by what is needed, in
        the time of the motion and by ``STEEREST`` at most; sooner near the place. Who is prepared
        turns as much less as the way gets shorter (alpha: 0 to 1).
        """
        seconds = self.approach.motions.duration[row]
        rate = bearing / np.where(near, SHORTEST_TURN, seconds)
        rate = np.clip(rate, -STEEREST / seconds, STEEREST / seconds)
        return rate * (1.0 - alpha)

    def settle(self, distance: np.ndarray) -> np.ndarray:
        """Level at a distance [m] to the place: from 0 a cell away to 1 at it, so that steps get
        shorter as the way does. (The paper forces 1 on reaching the cell, 0.6 m too soon.)"""
        return np.clip(1.0 - distance / self.policies[0].settings.goal_step, 0.0, 1.0)


def learned_guide(
    library: Layer,
    folder: Path | str | None,
    curve: np.ndarray,
    *,
    gaits: Sequence[str] | None = None,
    levels: bool = True,
    settings: PreparationSettings | None = None,
    progress: Callable[[int, float], None] = lambda batch, changed: None,
) -> Guide:
    """A guide of this library: its policies are read from ``folder``, or learned and kept there.

    curve [T]: C of the root, of each target motion: targets that share it share a policy (section
    6). levels: whether anybody prepares; else the policies know level 0 only. settings: how it is
    learned, :func:`gradual` by default. Errors: as :func:`trained_approach`'s.
    """
    settings = settings or gradual()
    if not levels:
        settings = replace(settings, levels=1)
    constants, policy_of = np.unique(curve, return_inverse=True)
    learned = [
        trained_approach(library, folder, settings, gaits=gaits, curve=c, progress=progress)
        for c in constants.tolist()
    ]
    policies = tuple(policy for _, policy in learned)
    return Guide(library, learned[0][0], policies, policy_of.reshape(-1))


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
