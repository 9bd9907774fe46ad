"""What may be told while a scene runs: numbers to go by, and actions that are wanted or not.

Whatever is told counts from the next decision on (B12).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from kumite.control import Route
from kumite.control.avoidance import AvoidanceSearch
from kumite.control.avoider import Avoider
from kumite.control.game_tree import GameTree, Player
from kumite.control.rules import DEEPEST, Temper
from kumite.control.styles import ANGLES, ORDER, PATH
from kumite.control.tuning import Scale, Tunable
from kumite.errors import KumiteError
from kumite.synthesis.rates import FASTEST

ORDERS = ("wanted", "unwanted", "only")
HEADING = 10.0  # w_γ of who is given a heading and minded none: as the other movement terms
FEW_TO_TUNE = 4  # characters that each have their own; of more, all have one together


class Spec(NamedTuple):
    """A number that may be tuned, whoever's it is."""

    field: str
    unit: str
    minimum: float
    maximum: float
    scale: Scale
    help: str


STYLE = (
    Spec("preferred_distance", "m", 0, 5, "linear", "how far from the opponent it wants to be"),
    Spec("distance", "points/m²", 0, 1e4, "log", "what it costs to be nearer or farther"),
    Spec("preferred_facing", "°", -180, 180, "linear", "how far beside the opponent it looks"),
    Spec("facing", "points/rad²", 0, 1e4, "log", "what it costs to look elsewhere"),
    Spec("given_short", "points/(m/s)", 0, 1e6, "log", "worth of its hooks and uppercuts"),
    Spec("given_long", "points/(m/s)", 0, 1e6, "log", "worth of its straights, kicks and cuts"),
    Spec("taken", "points/(m/s)", 0, 1e6, "log", "what it costs to be hit"),
    Spec("suitability", "points", 0, 1e4, "log", "worth of a defence that suits the attack"),
    Spec("preferred_heading", "°", -180, 180, "linear", "which way it looks, in the world"),
    Spec("heading", "points/rad²", 0, 1e4, "log", "what it costs to look another way"),
    Spec("place", "", 0.01, 1e3, "log", "of its path; 10: a metre² off costs a solid blow"),
    Spec("requirement", "", 1.0, 1e8, "log", "of wanted actions; 10⁶: a hundred solid blows"),
)
PLAYER = (
    Spec("depth", "levels", 1, DEEPEST - 1, "linear", "choices that it looks ahead"),
    Spec("boredom", "points", 0, 1e6, "log", "what an action loses that was used lately"),
    Spec("restlessness", "points", 0, 1e4, "log", "what it loses for each recent one of its kind"),
    Spec("facing_deg", "°", 5, 180, "linear", "how far off the opponent actions may end"),
)
RULES = (
    Spec("attack_range", "m", 0.2, 4, "linear", "from farther away nobody attacks"),
    Spec("defence_range", "m", 0.2, 8, "linear", "from farther away nobody defends"),
    Spec("catch", "m", 0, 3, "linear", "who comes so near has caught the other; 0: nobody"),
    Spec("stagger_from", "m/s", 0.5, 20, "linear", "blows that make stagger"),
    Spec("fall_from", "m/s", 0.5, 100, "log", "blows that fell"),
)
OF_WORLD = ("catch", "stagger_from", "fall_from")  # of the rules; the others are the tree's
TEMPER = (
    Spec("facing", "", 0, 20, "linear", "how much turning away cuts an action's worth"),
    Spec("few", "actions", 1, 50, "linear", "how many of the best are drawn from"),
    Spec("again", "actions", 1, 50, "linear", "how many are weighed a step further ahead"),
    Spec("personal_space", "m", 0, 3, "linear", "kept to the other's body"),
)
SEARCH = (
    Spec("avoidance", "", 0, 10, "linear", "weight of moving no more than need be"),
    Spec("body", "", 0, 10, "linear", "weight of staying where it is"),
    Spec("timescale", "", 0, 10, "linear", "weight of the captured speed"),
    Spec("window", "s", 0.1, 4, "linear", "how far from the attack as captured"),
    Spec("clearance", "m", 0, 0.3, "linear", "kept between body and attack"),
    Spec("most", "", 1, FASTEST, "linear", "times the captured speed, at most"),
)
REACTION = Spec("reaction", "s", 0, 1, "linear", "until it knows of an attack that can be seen")
KEPT = Spec("distance", "m", 0.5, 10, "linear", "kept to whoever attacks")
CURVE = (
    Spec("legs", "", 0.05, 10, "log", "C: below 1 the legs prepare later, above 1 sooner"),
    Spec("upper", "", 0.05, 10, "log", "C of the upper body"),
)
REST = Spec("rest", "s", 0, 60, "linear", "that an opponent who was struck keeps away")
WHOLE = ("depth", "few", "again")
WEIGHTS = ("avoidance", "body", "timescale")  # in the order of the search's


def tunable(
    spec: Spec,
    who: str,
    controller: str,
    key: str,
    get: Callable[[], float],
    put: Callable[[float], None],
) -> Tunable:
    """One of a spec; its range holds what it is now."""
    low, high = min(spec.minimum, now := get()), max(spec.maximum, now)
    whole = spec.field in WHOLE
    return Tunable(
        who,
        controller,
        spec.field,
        spec.unit,
        low,
        high,
        spec.scale,
        spec.help,
        key,
        get,
        put,
        whole,
    )


# By game tree ------------------------------------------------------------------------------------


def tree_tunables(who: str, player: Player, tree: GameTree) -> list[Tunable]:
    """All numbers that a fighter by game tree goes by. Angles are in degrees."""
    of_style = [
        tunable(s, who, "tree", f"style.{s.field}", *_of_style(player, s.field)) for s in STYLE
    ]
    of_player = [
        tunable(s, who, "tree", s.field, *_of_player(player, tree, s.field)) for s in PLAYER
    ]
    return of_player + of_style


def _of_style(player: Player, field: str) -> tuple[Callable[[], float], Callable[[float], None]]:
    standard = {"place": PATH, "requirement": ORDER}.get(field, 0.0)

    def get() -> float:
        value = float(getattr(player.style, field) or standard)
        return round(float(np.degrees(value)), 6) if field in ANGLES else value

    def put(value: float) -> None:
        weights = {field: float(np.radians(value)) if field in ANGLES else value}
        # A heading brings its weight, and the weight a heading.
        if field == "heading" and player.style.preferred_heading is None:
            weights["preferred_heading"] = 0.0
        if field == "preferred_heading" and player.style.heading == 0.0:
            weights["heading"] = HEADING
        player.style = player.style.changed(**weights)

    return get, put


def _of_player(
    player: Player, tree: GameTree, field: str
) -> tuple[Callable[[], float], Callable[[float], None]]:
    if field == "facing_deg":

        def facing() -> float:
            own = tree.rules.facing if player.facing is None else player.facing
            return round(float(np.degrees(own)), 6)

        def face(value: float) -> None:
            player.facing = float(np.radians(value))

        return facing, face
    return (
        lambda: float(getattr(player, field)),
        lambda value: setattr(player, field, getattr(replace(player, **{field: value}), field)),
    )


def rule_tunables(tree: GameTree) -> list[Tunable]:
    """Of the rules by which actions are pruned, and of what blows and catches are."""

    def of(field: str) -> tuple[Callable[[], float], Callable[[float], None]]:
        def put(value: float) -> None:
            tree.rules = replace(tree.rules, **{field: value})

        return lambda: float(getattr(tree.rules, field)), put

    return [
        tunable(s, "", "world" if s.field in OF_WORLD else "tree", f"bout.{s.field}", *of(s.field))
        for s in RULES
    ]


# By policies -------------------------------------------------------------------------------------


def policy_tunables(
    names: Sequence[str], tempers: Sequence[Temper], behaviours: Sequence[str] = ()
) -> list[Tunable]:
    """Of fighters by policies: of each, or of all together where there are many. behaviours: names
    of those besides approach and strike. Errors of setting one: all weights would be 0.
    """
    if len(tempers) > FEW_TO_TUNE:
        return _policy_tunables("", tempers, behaviours)
    return [
        t for name, one in zip(names, tempers) for t in _policy_tunables(name, [one], behaviours)
    ]


def _policy_tunables(
    who: str, tempers: Sequence[Temper], behaviours: Sequence[str]
) -> list[Tunable]:
    def weight(field: str) -> Tunable:
        spec = Spec(field, "", 0, 12, "linear", f"weight of the behaviour {field}")
        key = field if field in ("approach", "strike") else f"behaviours.{field}"

        def put(value: float) -> None:
            for temper in tempers:
                temper.set_weight(field, value)

        return tunable(spec, who, "policy", key, lambda: tempers[0].weight(field), put)

    def other(spec: Spec) -> Tunable:
        def put(value: float) -> None:
            for temper in tempers:
                setattr(temper, spec.field, value)

        get = lambda: float(getattr(tempers[0], spec.field))  # noqa: E731  # with its put
        return tunable(spec, who, "policy", spec.field, get, put)

    return [
        *(weight(field) for field in ("approach", "strike", *behaviours)),
        *(other(spec) for spec in TEMPER),
    ]


# Who avoids, who prepares ------------------------------------------------------------------------


def search_tunables(
    search: Callable[[], AvoidanceSearch], tune: Callable[..., None]
) -> list[Tunable]:
    """Rules of the search for avoidances: searches that are under way keep theirs. tune: goes by
    other rules from now on."""

    def of(field: str) -> tuple[Callable[[], float], Callable[[float], None]]:
        if field not in WEIGHTS:
            return (
                lambda: float(getattr(search().settings, field)),
                lambda value: tune(**{field: value}),
            )
        n = WEIGHTS.index(field)

        def weigh(value: float) -> None:
            weights = list(search().settings.weights)
            weights[n] = value
            tune(weights=tuple(weights))

        return lambda: float(search().settings.weights[n]), weigh

    return [tunable(s, "", "avoid", f"dodge.{s.field}", *of(s.field)) for s in SEARCH]


def reaction_tunables(names: Sequence[str], avoiders: Sequence[Avoider]) -> list[Tunable]:
    """How soon those who avoid know of what comes: of each, or of all together where there are
    many."""

    def of(who: str, some: Sequence[Avoider]) -> Tunable:
        def put(seconds: float) -> None:
            for avoider in some:
                avoider.reaction = seconds

        return tunable(REACTION, who, "avoid", "reaction", lambda: some[0].reaction, put)

    if len(avoiders) > FEW_TO_TUNE:
        return [of("", avoiders)]
    return [of(name, [one]) for name, one in zip(names, avoiders)]


# Actions that are wanted, or not -----------------------------------------------------------------


class OrderControl:
    """Kinds and labels of actions that a fighter is told: A⁺, A⁻ or its action set."""

    def __init__(
        self, who: str, field: str, player: Player, tree: GameTree, route: Route | None
    ) -> None:
        self.who, self.field = who, field
        self.player, self.tree, self.route = player, tree, route

    @property
    def options(self) -> tuple[str, ...]:
        """What may be named: the kinds and labels of what can be chosen, kinds first."""
        return self.tree.choices

    @property
    def value(self) -> tuple[str, ...]:
        return getattr(self.player, self.field)

    def set(self, names: Iterable[str]) -> None:
        """Errors: names that no action has; nothing would be left to choose. Then all stays."""
        told = replace(self.player, **{self.field: tuple(names)})
        check_orders(self.who, self.tree, told, self.route)
        setattr(self.player, self.field, getattr(told, self.field))


def check_orders(who: str, tree: GameTree, player: Player, route: Route | None) -> None:
    """Errors: names that no action has, of the player or at a check point; nothing is left to
    choose, by itself or on the way to one.
    """
    places: list[tuple[str, tuple[str, ...], tuple[str, ...]]] = [("", (), ())]
    places += [
        (f" at check point {k}", p.require, p.refuse)
        for k, p in enumerate(route.points if route else ())
        if p.require or p.refuse
    ]
    for where, require, refuse in places:
        try:
            tree.allowed(player)
            tree.asked(
                replace(
                    player,
                    wanted=(*player.wanted, *require),
                    unwanted=(*player.unwanted, *refuse),
                )
            )
        except KumiteError as error:
            raise KumiteError(f"{who}{where}: {error}") from None
