"""Fighters: several behaviours at once by a weighted sum, random among the best few (A9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kumite.brief import brief
from kumite.checked import checked
from kumite.control.policy import Policy, Tracks, frame_discount, reward_params
from kumite.control.rules import Temper
from kumite.graph import Layer
from kumite.kernels import crowd as kernels
from kumite.kernels import policy as kernels_policy
from kumite.kernels.blow import NOBODY
from kumite.kernels.look_ahead import Behaviours, Moves

IN_STEP = 0.2  # s: of two who face each other none begins what the other began so shortly before


@brief
@dataclass(frozen=True)
class Skill:
    """What all fighters of one library share: policies and the tracks of its actions."""

    library: Layer
    approach: Policy
    strike: Policy
    tracks: Tracks
    more: tuple[Policy, ...] = ()  # of other behaviours

    @cached_property
    def moves(self) -> Moves:
        """The actions as the kernels take them."""
        table, tracks = self.library.table, self.tracks
        x, z, yaw = tracks.root.T
        return Moves(
            table.action_start,
            table.stretch,
            table.target,
            table.displacement,
            np.stack([np.sin(table.displacement[:, 2]), np.cos(table.displacement[:, 2])], axis=1),
            table.duration,
            tracks.centre_start,
            tracks.centre,
            np.stack([x, z, np.sin(yaw), np.cos(yaw)], axis=1),
            _discs(tracks),
            tracks.tip,
            tracks.tip_weight,
            tracks.tip_when,
            tracks.tip_start,
        )

    @property
    def policies(self) -> tuple[Policy, ...]:
        return (self.approach, self.strike, *self.more)

    @cached_property
    def behaviours(self) -> Behaviours:
        """All behaviours as the kernels take them."""
        fps = self.library.clips.fps
        every = [p.behaviour for p in self.policies]
        grids = [p.grid_arguments for p in self.policies]
        kinds = {"approach": kernels_policy.APPROACH, "strike": kernels_policy.STRIKE}
        sizes = [p.value.size for p in self.policies]
        discount = np.array([frame_discount(b, fps) for b in every])
        return Behaviours(
            np.array([kernels_policy.STATION if b.station else kinds[b.name] for b in every]),
            np.stack([reward_params(b, fps) for b in every]),
            discount,
            discount[:, None] ** np.arange(int(self.library.table.duration.max()) + 1),
            np.array([(b.nearest, b.farthest) for b in every]),
            np.concatenate([p.value.ravel() for p in self.policies]),
            np.concatenate([[0], np.cumsum(sizes)]),
            np.array([p.value.shape[1] for p in self.policies]),
            np.stack([g[0] for g in grids]),
            np.stack([g[1] for g in grids]),
            np.stack([g[2] for g in grids]),
            np.array([g[3] for g in grids]),
            np.array([g[4] for g in grids]),
            np.array([b.grid.heading for b in every]),
        )


def _discs(tracks: Tracks) -> np.ndarray:
    """Discs (x, z, radius) [L, 3] that hold the root tracks."""
    start, place = tracks.centre_start, tracks.root[:, :2]
    low, high = (f.reduceat(place, start[:-1]) for f in (np.minimum, np.maximum))
    middle = 0.5 * (low + high)
    away = np.hypot(*(place - np.repeat(middle, np.diff(start), axis=0)).T)
    return np.column_stack([middle, np.maximum.reduceat(away, start[:-1])])


@checked
class Fighters:
    """K minds: each sees where its target will be and picks its next action.

    ``tempers`` may be changed between decisions; the next one uses them.
    """

    def __init__(self, skill: Skill, tempers: Sequence[Temper], seed: int) -> None:
        self.skill = skill
        self.tempers = list(tempers)
        count = len(self.tempers)
        memory = max((t.memory for t in self.tempers), default=0)
        self.minds = kernels.Minds(
            np.zeros((count, len(skill.policies))),
            np.zeros((count, 6)),
            np.full((count, memory), -1, dtype=np.int64),
            np.zeros(count, dtype=np.int64),
            np.random.SeedSequence(seed).generate_state(count, np.uint64),
            skill.library.table.first.astype(np.int64),
            np.full(count, NOBODY, dtype=np.int64),
            round(IN_STEP * skill.library.clips.fps),
        )
        self.choices = kernels.Choices(
            np.zeros(count, dtype=np.int64),
            np.zeros(count),
            np.zeros(count, dtype=np.int64),
            np.zeros(count, dtype=np.int64),
        )

    def note(self, who: np.ndarray) -> None:
        """The tempers of those who are about to choose, as they are now."""
        names = [p.behaviour.name for p in self.skill.more]
        for k in who.tolist():
            t = self.tempers[k]
            more = [t.more.get(name, 0.0) for name in names]
            self.minds.weights[k] = (t.approach, t.strike, *more)
            self.minds.temper[k] = (t.facing, t.few, t.slack, t.boredom, t.personal_space, t.again)

    def pick(self, k: int, state: int, target: np.ndarray, others: np.ndarray) -> int:
        """Character k picks an action of a state: its stretch.

        target [H, 3]: the target's expected places at frames 1.. from now, or [H, 4] with the way
        it faces [rad]; others [O, H, 2] those of bodies to keep apart from; in its facing frame,
        the last row from then on.
        """
        self.note(np.array([k]))
        moves, behaviours = self.skill.moves, self.skill.behaviours
        if target.shape[1] == 3:
            target = np.column_stack([target, np.zeros(len(target))])
        kernels.pick(k, state, target, others, self.minds, moves, behaviours, self.choices)
        return int(self.choices.stretch[k])
