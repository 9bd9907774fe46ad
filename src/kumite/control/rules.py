"""Rules that controllers go by, as plain values: a scene file is checked before anything computes.

Of the game tree :class:`Rules` and :class:`Player`, of fighters with policies :class:`Temper`, of
who avoids :class:`AvoidanceRules`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf, isfinite, radians
from typing import TYPE_CHECKING

from kumite.control.styles import STYLES, Style
from kumite.errors import KumiteError

if TYPE_CHECKING:
    import numpy as np

GRAVITY = 9.81  # m/s²
DEEPEST = 6  # levels; a seventh would take hours
BOREDOM = 1e5  # score that an action loses for each recent use: a blow of 1 m/s
RESTLESSNESS = 15.0  # score that an action loses for each recent one of its kind
FREE = ("catch", "arena")  # of the rules, which there need not be: 0


@dataclass(frozen=True)
class Rules:
    """What is pruned (section V-C) and what counts as what."""

    every: float = 0.1  # s between poses of which bodies are compared
    facing: float = radians(60.0)  # rad from the opponent at the end of an action, at most
    attack_range: float = 1.0  # m
    defence_range: float = 3.0  # m
    tip_radius: float = 0.03  # m, of a fist's front
    catch: float = 0.0  # m between two that counts as caught; 0: nobody is
    arena: float = 0.0  # m from the middle of the scene that nobody is to go beyond; 0: everywhere
    stagger_from: float = 5.2  # m/s of a blow that staggers
    fall_from: float = 10.0  # m/s of a blow that fells

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not isfinite(value) or value < 0 or (value == 0 and name not in FREE):
                raise KumiteError(f"rules: {name} {value}; expected more than 0")


@dataclass
class Player:
    """How one side plays. All of it may be changed while the scene runs."""

    style: Style = field(default_factory=lambda: STYLES["boxer"])
    depth: int = 3  # levels of the tree
    wanted: tuple[str, ...] = ()  # A⁺, kinds or labels of actions
    unwanted: tuple[str, ...] = ()  # A⁻
    goal: np.ndarray | None = None  # [G, 2] m, where to be now and every GOAL_EVERY s
    urgency: float = 1.0  # times its weight that the goal counts now
    facing: float | None = None  # rad, in place of the rules' own
    boredom: float = BOREDOM  # score that an action loses for each recent use (B11)
    restlessness: float = RESTLESSNESS  # and for each recent one of its kind
    only: tuple[str, ...] = ()  # the action set, kinds or labels; empty: all
    stays_down: bool = False  # after a fall

    def __post_init__(self) -> None:
        if not 1 <= self.depth <= DEEPEST:
            raise KumiteError(f"depth {self.depth}; expected 1 to {DEEPEST}")
        for name in ("boredom", "restlessness"):
            value = getattr(self, name)
            if not 0 <= value < inf:
                raise KumiteError(f"{name} {value}; expected 0 or more, finite")


@dataclass
class Temper:
    """How a fighter chooses. All of it may be changed while the scene runs."""

    approach: float = 1.0  # weight of bringing blows' reach over the target
    strike: float = 6.0  # weight of hitting it
    facing: float = 3.5  # how much turning away from it meanwhile cuts an action's worth
    few: int = 3  # how many of the best actions are drawn from
    slack: float = 0.2  # how much less an action may gain than the best one, as a share of that
    boredom: float = 0.5  # how much of its gain an action loses while it was used recently
    memory: int = 6  # how many actions back "recently" goes
    again: int = 4  # how many of the best actions are weighed once more, a step further ahead
    personal_space: float = 0.7  # m between the bodies that an action must leave
    more: dict[str, float] = field(default_factory=dict)  # weights of other behaviours, by name

    def __post_init__(self) -> None:
        self._check_weights()
        if self.few < 1 or self.again < 1 or self.memory < 0:
            raise KumiteError("few, again: expected at least 1; memory: at least 0")

    def _check_weights(self) -> None:
        every = [self.approach, self.strike, *self.more.values()]
        if not all(map(isfinite, every)) or min(every) < 0 or sum(every) == 0:
            raise KumiteError("weights: expected none below 0, and not all 0")

    def weight(self, behaviour: str) -> float:
        """The weight of a behaviour by name."""
        if behaviour in ("approach", "strike"):
            return float(getattr(self, behaviour))
        return self.more.get(behaviour, 0.0)

    def set_weight(self, behaviour: str, value: float) -> None:
        """Another weight, from the next decision on. Errors: below 0; all would be 0."""
        before = self.weight(behaviour)
        self._put(behaviour, value)
        try:
            self._check_weights()
        except KumiteError:
            self._put(behaviour, before)
            raise

    def _put(self, behaviour: str, value: float) -> None:
        if behaviour in ("approach", "strike"):
            setattr(self, behaviour, value)
        else:
            self.more[behaviour] = value


@dataclass(frozen=True)
class AvoidanceRules:
    """The paper's numbers, by its names in the comments, and ours."""

    window: float = 1.0  # s, T_window: how far the avoidance may be from the attack as captured
    weights: tuple[float, float, float] = (1.0, 1.0, 1.0)  # w_a, w_b, w_t
    enough: float = 0.5  # m s, E_avoidance
    far: float = 1.0  # m, D_body, which the paper does not give
    most: float = 4.0  # E_time
    fast: float = 0.3  # m/s, V_fast: faster edges may be slowed down
    slow: float = 0.1  # m/s, V_slow: slower edges may be sped up
    still: float = 0.0  # m/s, V_still: those no faster either way
    clearance: float = 0.02  # m between attack and body, the paper's 0
    left: float = 0.05  # m by which a part of the body must have moved to have left its place
    ramp: float = 0.2  # s in which a change of speed comes and goes
    wide: float = 0.10  # m at which an attack passes by and nothing is done about it
    ahead: float = 2.0  # s before an attack's middle from which avoiding it is thought about
    horizon: float = 1.5  # s to which the index looks ahead
    joins: bool = True  # whether what joins leave is reckoned with
    index: bool | None = None  # None: where the graph is so large that looking up pays
    culling: bool = True

    def __post_init__(self) -> None:
        for name in ("window", "enough", "far", "ahead", "horizon", "ramp"):
            if not 0 < getattr(self, name) < 100:
                raise KumiteError(f"avoidance: {name} {getattr(self, name)}; expected above 0")
        for name in ("clearance", "left", "wide", "fast", "slow", "still"):
            if not 0 <= getattr(self, name) < 100:
                raise KumiteError(f"avoidance: {name} {getattr(self, name)}; expected at least 0")
        if len(self.weights) != 3 or not all(isfinite(w) and w >= 0 for w in self.weights):
            raise KumiteError("avoidance: weights: expected three numbers, none below 0")
        if not 1 <= self.most <= 16:
            raise KumiteError(f"avoidance: most {self.most}; expected from 1 to 16")
