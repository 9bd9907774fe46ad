"""Fighters: several behaviours at once by a weighted sum, random among the best few (A9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kumite.control.policy import Policy, Tracks, frame_discount
from kumite.errors import KumiteError
from kumite.graph import Library
from kumite.kernels import crowd as kernels
from kumite.kernels.policy import Moves, Worth

MANY = 8  # characters that choose at once (1 ms of work) from which threads pay


@dataclass
class Temper:
    """How a fighter chooses. All of it may be changed while the scene runs."""

    approach: float = 1.0  # weight of bringing blows' reach over the target
    strike: float = 6.0  # weight of hitting it
    facing: float = 3.0  # how much turning away from it meanwhile cuts an action's worth
    few: int = 3  # how many of the best actions are drawn from
    slack: float = 0.2  # how much less an action may gain than the best one, as a share of that
    boredom: float = 0.5  # how much of its gain an action loses while it was used recently
    memory: int = 6  # how many actions back "recently" goes
    personal_space: float = 0.7  # m between the bodies that an action must leave

    def __post_init__(self) -> None:
        if self.approach < 0 or self.strike < 0 or self.approach + self.strike == 0:
            raise KumiteError("weights: approach and strike must not be below 0, nor both 0")
        if self.few < 1 or self.memory < 0:
            raise KumiteError("few: expected at least 1; memory: at least 0")


@dataclass(frozen=True)
class Skill:
    """What all fighters of one library share: policies and the tracks of its actions."""

    library: Library
    approach: Policy
    strike: Policy
    tracks: Tracks

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
            table.duration,
            tracks.centre_start,
            tracks.centre,
            np.stack([x, z, np.sin(yaw), np.cos(yaw)], axis=1),
            tracks.tip,
            tracks.tip_weight,
            tracks.tip_when,
            tracks.tip_start,
        )

    def worth(self, policy: Policy) -> Worth:
        """A policy as the kernels take it."""
        behaviour = policy.behaviour
        scale = behaviour.sigma if behaviour.name == "approach" else behaviour.tolerance
        discount = frame_discount(behaviour, self.library.clips.fps)
        low, step, size, wraps, inside_only = policy.grid_arguments
        return Worth(policy.value, low, step, size, wraps, inside_only, discount, scale)

    @cached_property
    def worths(self) -> tuple[Worth, Worth]:
        return self.worth(self.approach), self.worth(self.strike)


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
            np.zeros((count, 7)),
            np.full((count, memory), -1, dtype=np.int64),
            np.zeros(count, dtype=np.int64),
            np.random.SeedSequence(seed).generate_state(count, np.uint64),
        )
        self.choices = kernels.Choices(
            np.zeros(count, dtype=np.int64),
            np.zeros(count),
            np.zeros(count, dtype=np.int64),
            np.zeros(count, dtype=np.int64),
        )

    def _note(self, who: np.ndarray) -> None:
        """The tempers of those who are about to choose, as they are now."""
        for k in who.tolist():
            t = self.tempers[k]
            self.minds.temper[k] = (
                t.approach,
                t.strike,
                t.facing,
                t.few,
                t.slack,
                t.boredom,
                t.personal_space,
            )

    def decide(
        self,
        who: np.ndarray,
        states: np.ndarray,
        place: np.ndarray,
        grid: kernels.Hash,
        actors: kernels.Actors,
        horizon: int,
    ) -> kernels.Choices:
        """Characters who [W], each in its state [W] of the action table, pick their next actions.

        place [K, 3]: where all stand, hashed in ``grid``; horizon: frames that the others' motion
        is foreseen. What is returned holds the last choice of everyone [K].
        """
        self._note(who)
        run = kernels.decide_many if len(who) >= MANY else kernels.decide
        moves, worths = self.skill.moves, self.skill.worths
        run(who, states, place, grid, actors, self.minds, moves, *worths, horizon, self.choices)
        return self.choices

    def pick(self, k: int, state: int, target: np.ndarray, others: np.ndarray) -> int:
        """Character k picks an action of a state: its stretch.

        target [H, 3]: the target's expected places at frames 1.. from now, others [O, H, 2] those
        of bodies to keep apart from; in its facing frame, the last row from then on.
        """
        self._note(np.array([k]))
        moves, worths = self.skill.moves, self.skill.worths
        kernels.pick(k, state, target, others, self.minds, moves, *worths, self.choices)
        return int(self.choices.stretch[k])
