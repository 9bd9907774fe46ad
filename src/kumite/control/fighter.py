"""A fighter: several behaviours at once by a weighted sum, random among the best few (A9)."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from kumite.control.policy import Policy, Tracks, frame_discount
from kumite.errors import KumiteError
from kumite.graph import Library
from kumite.kernels import policy as kernels


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
class Choice:
    stretch: int
    worth: float
    considered: int  # actions the state offers
    apart: int  # of these, the ones that keep the personal space


@dataclass(frozen=True)
class Skill:
    """What all fighters of one library share: policies and the tracks of its actions."""

    library: Library
    approach: Policy
    strike: Policy
    tracks: Tracks


@dataclass
class Fighter:
    """One character's mind: it sees where its target will be and picks the next action."""

    skill: Skill
    temper: Temper
    rng: np.random.Generator
    _recent: deque[int] = field(default_factory=deque)

    def choose(self, state: int, target: np.ndarray, other: np.ndarray) -> Choice:
        """Pick an action of ``state``.

        target [H, 3]: the target's expected places at frames 1.. from now, other [H, 2] those of
        the body to keep apart from; both in the avatar's facing frame, the last row from then on.
        """
        skill, temper = self.skill, self.temper
        table, tracks = skill.library.table, skill.tracks
        actions = table.actions_of(state)
        worth = np.empty(actions.stop - actions.start)
        gap = np.empty(len(worth))
        fps = skill.library.clips.fps
        near, hit = skill.approach, skill.strike
        goal = _within(target, near.behaviour.grid.high[1])
        kernels.look_ahead(
            state,
            goal,
            target,
            other,
            table.action_start,
            table.stretch,
            table.target,
            table.displacement,
            table.duration,
            frame_discount(near.behaviour, fps),
            near.behaviour.sigma,
            tracks.centre,
            tracks.centre_start,
            near.value,
            near.grid_arguments,
            temper.approach,
            frame_discount(hit.behaviour, fps),
            hit.behaviour.tolerance,
            tracks.tip,
            tracks.tip_weight,
            tracks.tip_when,
            tracks.tip_start,
            hit.value,
            hit.grid_arguments,
            temper.strike,
            tracks.root,
            temper.facing,
            worth,
            gap,
        )
        stretch = table.stretch[actions]
        apart = gap >= temper.personal_space
        # Where every action would come too near, those that stay farthest off.
        allowed = apart if apart.any() else gap >= gap.max() - 0.02
        recent = np.isin(stretch, np.fromiter(self._recent, np.int64, len(self._recent)))
        # What counts is how much better an action is than the usual one: far from the target all
        # are worth nearly the same, and still one of them leads there.
        gain = worth - np.median(worth[allowed])
        gain -= np.where(recent, temper.boredom * np.abs(gain), 0.0)
        gain[~allowed] = -np.inf
        order = np.argsort(-gain, kind="stable")[: temper.few]
        best = order[gain[order] >= (1.0 - temper.slack) * gain[order[0]]]
        if len(best) == 0:  # all are worth less than the median after boredom
            best = order[:1]
        pick = int(best[self.rng.integers(len(best))])
        self._recent.append(int(stretch[pick]))
        while len(self._recent) > temper.memory:
            self._recent.popleft()
        return Choice(int(stretch[pick]), float(worth[pick]), len(worth), int(apart.sum()))


def _within(target: np.ndarray, radius: float) -> np.ndarray:
    """A target's places [H, 3], moved so that the first lies within ``radius`` of the avatar.

    A target out of the grid is approached as if it stood on its rim: each action brings it nearer.
    (Were the place after the action clamped instead, no way of getting there would be better than
    another.)
    """
    away = float(np.hypot(target[0, 0], target[0, 2]))
    if away <= radius:
        return target
    return target - (1.0 - radius / away) * np.array([target[0, 0], 0.0, target[0, 2]])
