"""What may be told to a fighter of a game tree while it fights; its next decision uses it (B12).
And to those who avoid: their next search does.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Protocol

import numpy as np

from kumite.control import Route
from kumite.control.avoidance import AvoidanceSearch
from kumite.control.game_tree import GameTree, Player
from kumite.control.styles import ANGLES
from kumite.errors import KumiteError

SPANS = {  # least, most, step of what may be tuned; angles in degrees
    "depth": (1, 5, 1),
    "preferred_distance": (0, 4, 0.1),
    "distance": (0, 1e3, 1),
    "preferred_facing": (-180, 180, 5),
    "facing": (0, 1e3, 1),
    "given_short": (0, 1e5, 1e3),
    "given_long": (0, 1e5, 1e3),
    "taken": (0, 1e5, 1e3),
    "suitability": (0, 1e3, 1),
    "preferred_heading": (-180, 180, 5),
    "heading": (0, 1e3, 1),
    "place": (0, 1e5, 10),
    "requirement": (0, 1e7, 1e5),
    "boredom": (0, 2e5, 1e3),
    "restlessness": (0, 1e3, 10),
}
OF_PLAYER = ("depth", "boredom", "restlessness")  # the others are of its style
ORDERS = ("wanted", "unwanted", "only")
HEADING = 10.0  # w_γ of who is given a heading and minded none: as the other movement terms


class StyleControl:
    """A number that a fighter goes by. Angles are in degrees, as sliders show them."""

    def __init__(self, who: str, field: str, player: Player) -> None:
        self.name = f"{who}: {field}"
        self.field = field
        self.player = player
        least, most, self.step = SPANS[field]
        self.minimum, self.maximum = min(least, self.value), max(most, self.value)

    @property
    def value(self) -> float:
        holder = self.player if self.field in OF_PLAYER else self.player.style
        value = float(getattr(holder, self.field) or 0.0)
        return round(float(np.degrees(value)), 6) if self.field in ANGLES else value

    def set(self, value: float) -> None:
        """A heading brings its weight, and the weight a heading, if there is none. Errors: values
        that are not allowed.
        """
        player, field = self.player, self.field
        if field in OF_PLAYER:
            value = round(value) if field == "depth" else value
            setattr(player, field, getattr(replace(player, **{field: value}), field))
            return
        weights = {field: float(np.radians(value)) if field in ANGLES else float(value)}
        if field == "heading" and player.style.preferred_heading is None:
            weights["preferred_heading"] = 0.0
        if field == "preferred_heading" and player.style.heading == 0.0:
            weights["heading"] = HEADING
        player.style = player.style.changed(**weights)


def style_controls(who: str, player: Player) -> list[StyleControl]:
    """All numbers that a fighter goes by."""
    return [StyleControl(who, field, player) for field in SPANS]


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


SEARCH_SPANS = {  # least, most, step, and what it is called
    "window": (0.1, 4.0, 0.05, "T_window [s]"),
    "clearance": (0.0, 0.3, 0.005, "clearance [m]"),
}
WEIGHTS = ("avoidance", "body", "timescale")  # in the order of the search's
HEAVIEST = 10.0


class Searching(Protocol):
    """A scene in which somebody avoids."""

    @property
    def search(self) -> AvoidanceSearch:
        """What they search with now."""
        ...

    def tune(self, **rules: object) -> None:
        """Other rules for the next searches."""
        ...


class SearchControl:
    """A number that searches go by."""

    def __init__(self, scene: Searching, field: str) -> None:
        self.scene, self.field = scene, field
        spans = SEARCH_SPANS.get(field, (0.0, HEAVIEST, 0.1, f"weight of {field}"))
        self.minimum, self.maximum, self.step, self.name = spans
        self.minimum, self.maximum = min(self.minimum, self.value), max(self.maximum, self.value)

    @property
    def value(self) -> float:
        rules = self.scene.search.settings
        if self.field in WEIGHTS:
            return float(rules.weights[WEIGHTS.index(self.field)])
        return float(getattr(rules, self.field))

    def set(self, value: float) -> None:
        """Errors: values that are not allowed."""
        if self.field in WEIGHTS:
            weights = list(self.scene.search.settings.weights)
            weights[WEIGHTS.index(self.field)] = float(value)
            self.scene.tune(weights=tuple(weights))
        else:
            self.scene.tune(**{self.field: float(value)})


def search_controls(scene: Searching) -> list[SearchControl]:
    """All numbers that may be tuned while a scene runs."""
    return [SearchControl(scene, field) for field in (*WEIGHTS, *SEARCH_SPANS)]
