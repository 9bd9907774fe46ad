"""Styles: the weights by which a fighter directed by a game tree judges what happens (B6, B8).

    F_comp = −w_θ(θ − θ_d)² − w_r(r − r_d)²  +  w_D⁺ D⁺ − w_D⁻ D⁻  +  w_S S        (Eqs. 4, 5, 7, 8)
    F_coop = −w_γ(γ − γ_d)² − w_p‖p − p_d‖²  +  (±w_a or 0)                        (Eqs. 9 to 11)

(Shum et al. 2012, section VI.) Both movement terms are costs: the print omits the minus signs, but
says that a distance near the preferred one scores high. Angles are in radians, distances in metres.

    D = ‖v_attack‖ / v' · vulnerability                                                      (Eq. 6)

Orders have a scale of their own: as they stand, w_p = 10 and w_a = 10⁶ are lost beside blows, which
are worth 10⁵ for each m/s, and nobody goes where he is sent. So both are counted in the worth of a
solid blow, W = 10 · max(w_D⁺, w_D⁻), one of 5 m/s to the head:

    w_p = 10   makes a metre² off the place cost W: half a metre nearer outweighs one such blow from
               1.3 m on, and who has come near is free to fight;
    w_a = 10⁶  makes an action of A⁺ worth 100 W: more than all blows that two choices may land.

Both are proportional: w_p = 1 is a tenth of it. So they hold in any style (:meth:`Style.in_play`).
A style that gives none, 0, goes by the paper's: what is ordered counts.

with v' = :data:`UNIT_SPEED` and the vulnerability of the part that is hit. S comes from
:mod:`kumite.control.combination`, p_d and the actions wanted from :mod:`kumite.control.routes`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from math import isfinite
from numbers import Real
from typing import TYPE_CHECKING

from kumite.annotate.vocabulary import DIRECTIONS, KINDS
from kumite.checked import checked
from kumite.checks import instance
from kumite.errors import KumiteError, unknown
from kumite.kernels import style as columns
from kumite.lazy import Later

if TYPE_CHECKING:
    import numpy as np

    from kumite.annotate import Actions
else:
    np = Later("numpy")

SOLID = 10.0  # D of a solid blow: 5 m/s to the head
PATH, ORDER = 10.0, 1e6  # the paper's w_p and w_a
ORDER_BLOWS = 100.0  # solid blows that w_a = ORDER is worth
UNIT_SPEED = 1.0  # v', m/s (the paper's 100, of centimetres a second)
VULNERABILITY = {"head": 2.0, "torso": 1.0, "limbs": 0.0}  # w_being_attack
SHORT_RANGE = ("hook", "uppercut")
"""Ways of an attack that are short-range. Straights, kicks, slashes and thrusts are long-range."""


@dataclass(frozen=True)
class Style:
    """How much a fighter minds what. All of it may be changed between decisions (B12)."""

    facing: float = 10.0  # w_θ, of the angle [rad] between where it looks and the opponent
    distance: float = 10.0  # w_r, of the distance [m] to the opponent
    preferred_facing: float = 0.0  # θ_d, rad: 0 looks at the opponent
    preferred_distance: float = 0.8  # r_d, m
    given_short: float = 1e5  # w_D⁺, of damage given by short-range attacks
    given_long: float = 1e5  # w_D⁺, by the others
    taken: float = 1e5  # w_D⁻, of damage received
    suitability: float = 1e2  # w_S, of the action combination table
    heading: float = 0.0  # w_γ, of the way it faces in the world [rad]
    place: float = 0.0  # w_p, of the distance to the next check point; 10, or 0: it is followed
    requirement: float = 0.0  # w_a, of actions wanted, or unwanted; 10⁶, or 0: that is heeded
    preferred_heading: float | None = None  # γ_d, rad; None: none

    def __post_init__(self) -> None:
        wrong = []
        for name, value in asdict(self).items():
            if value is None and name == "preferred_heading":
                continue
            if isinstance(value, bool) or not isinstance(value, Real):
                wrong.append(f"{name}: {value!r}; expected a number")
                continue
            object.__setattr__(self, name, float(value))
            if not isfinite(value):
                wrong.append(f"{name}: {float(value)}; expected a finite number")
            elif value < 0 and name not in ANGLES:
                wrong.append(f"{name}: {float(value):g}; expected 0 or more")
        if not wrong and self.heading > 0 and self.preferred_heading is None:
            wrong.append(f"heading: {self.heading:g}; expected a preferred_heading with it")
        if wrong:
            raise KumiteError("\n".join(f"style: {what}" for what in wrong))

    def changed(self, **weights: float | None) -> Style:
        """The style with some weights changed. Errors: unknown names, with near ones; values that
        are not finite, or below 0.
        """
        for name in weights:
            if name not in NAMES:
                raise unknown("weight of a style", name, NAMES)
        return replace(self, **weights)

    def as_array(self) -> np.ndarray:
        """The weights [COLUMNS] float64, in the columns of :mod:`kumite.kernels.style`."""
        out = np.zeros(columns.COLUMNS)
        for name, value in asdict(self).items():
            out[getattr(columns, name.upper())] = 0.0 if value is None else value
        return out

    @property
    def solid_blow(self) -> float:
        """What a solid blow is worth, given or taken. Where blows do not count: what else does."""
        blows = SOLID * max(self.given_short, self.given_long, self.taken)
        return max(blows, self.facing, self.distance, self.suitability)

    def in_play(self) -> np.ndarray:
        """The weights [COLUMNS] as they count in the game: those of orders in solid blows."""
        out = self.as_array()
        out[columns.PLACE] = (self.place or PATH) / PATH * self.solid_blow
        asked = (self.requirement or ORDER) / ORDER
        out[columns.REQUIREMENT] = asked * ORDER_BLOWS * self.solid_blow
        return out

    def given(self, actions: Actions) -> np.ndarray:
        """w_D⁺ [A] of the damage that each action gives; 0 for those that are no attacks."""
        attack = actions.kind == KINDS.index("attack")
        weight = np.where(short_range(actions), self.given_short, self.given_long)
        return np.where(attack, weight, 0.0)


NAMES = tuple(f.name for f in fields(Style))
ANGLES = ("preferred_facing", "preferred_heading")


def short_range(actions: Actions) -> np.ndarray:
    """Which actions [A] bool are short-range attacks: hooks and uppercuts (the † of Table III).

    Of an action of several blows the first decides, as it does its direction.
    """
    from kumite.annotate import Actions

    instance(actions, Actions, "actions")
    return np.isin(actions.direction, [DIRECTIONS.index(way) for way in SHORT_RANGE])


_BOXER = Style()
_SWORD = _BOXER.changed(preferred_distance=1.5)
_CHASER = _BOXER.changed(preferred_distance=0.1, taken=0.0, suitability=0.0)
_RUNAWAY = _BOXER.changed(preferred_distance=3.0, given_short=0.0, given_long=0.0, suitability=0.0)

STYLES: dict[str, Style] = {
    "boxer": _BOXER,
    "infighter": _BOXER.changed(preferred_distance=0.5, given_long=10.0),
    "outboxer": _BOXER.changed(preferred_distance=2.0, given_short=10.0),
    "boxer_path": _BOXER.changed(place=PATH, requirement=ORDER),
    "sword_fighter": _SWORD,
    "sword_fighter_path": _SWORD.changed(place=PATH, requirement=ORDER),
    "chaser": _CHASER,
    "runaway": _RUNAWAY,
    "chaser_path": _CHASER.changed(place=PATH),
    "runaway_path": _RUNAWAY.changed(place=PATH),
}
"""The paper's, Tables III and IV."""


@checked
def style(wanted: str | Mapping[str, object] | Style) -> Style:
    """A style by the name of a preset, or by a mapping of weights to change.

    A mapping's ``preset`` names the style that is changed; without it, that is "boxer". Errors:
    unknown presets and weights, with near names; values that are no weights.
    """
    if isinstance(wanted, Style):
        return wanted
    if isinstance(wanted, str):
        wanted = {"preset": wanted}
    weights = dict(wanted)
    preset = weights.pop("preset", "boxer")
    if not isinstance(preset, str) or preset not in STYLES:
        raise unknown("style", str(preset), STYLES)
    return STYLES[preset].changed(**weights)  # type: ignore[arg-type]  # checked in there
