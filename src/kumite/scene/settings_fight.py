"""Scene files of game-tree fights: who fights whom, in which style, along which check points, and
what happens at a moment: somebody changes opponent or style, a car drives through.
"""

from __future__ import annotations

from math import radians
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from kumite.control.routes import CheckPoint, Route, line, spiral
from kumite.control.rules import BOREDOM, DEEPEST, RESTLESSNESS, Player, Rules, Temper
from kumite.control.styles import Style, style
from kumite.errors import KumiteError
from kumite.scene.settings_base import (
    FARTHEST,
    REACTION,
    Finite,
    Metres,
    Name,
    Positive,
    Reaction,
    Settings,
)

Controllers = Annotated[
    tuple[Literal["avoid", "fight", "prepare", "roam", "external"], ...], Field(min_length=1)
]
"""Who decides for a character, by priority: the first that has something to say is heard."""
Weight = Annotated[Finite, Field(ge=0)]


def refuse_controllers(controllers: tuple[str, ...]) -> None:
    """Errors: one twice; one behind another that leaves nothing to it; nobody who always says
    something."""
    told = f"controllers = {list(controllers)}"
    if len(set(controllers)) < len(controllers):
        raise ValueError(f"{told}; expected each once")
    if controllers[-1] == "avoid":
        raise ValueError(
            f'{told}; expected another behind "avoid", which decides only while something comes'
        )
    for name in controllers[:-1]:
        if name in ("prepare", "roam", "external"):
            raise ValueError(
                f'{told}; expected "{name}" last: it always has something to say, so nobody '
                "behind it is heard"
            )


Depth = Annotated[int, Field(ge=1, le=DEEPEST)]
CHANGES = ("against", "style", "depth", "wanted", "unwanted", "only", "point")  # by a cue


class CheckPointSettings(Settings):
    """A place to pass, perhaps at a time, perhaps doing something there (B8)."""

    place: tuple[Metres, Metres]  # m, x and z
    time: Annotated[Finite, Field(ge=0)] | None = None  # s
    require: tuple[str, ...] = ()  # kinds or labels of actions
    refuse: tuple[str, ...] = ()
    radius: Positive = 0.5  # m within which it is reached
    middle: bool = False  # by the middle between the fighter and its opponent


def check_points(points: tuple[CheckPointSettings, ...]) -> Route | None:
    """The route along them, if there are any. Errors: times that go back."""
    return Route(tuple(CheckPoint(**p.model_dump()) for p in points)) if points else None


class PathSettings(Settings):
    """Check points along a line, a circle or a spiral."""

    shape: Literal["line", "circle", "spiral"]
    centre: tuple[Metres, Metres] = (0.0, 0.0)  # of a circle or spiral; where a line begins
    end: tuple[Metres, Metres] = (0.0, 5.0)  # of a line
    inner: Annotated[Finite, Field(ge=0)] = 1.0  # m
    outer: Positive = 4.0  # m, of a circle its radius
    angle: Finite = 0.0  # degrees, where a circle or spiral begins
    turns: Finite = 1.0
    seconds: Positive | None = None  # for all of it
    begin: Annotated[Finite, Field(ge=0)] = 0.0  # s, of the first point
    points: Annotated[int, Field(ge=2, le=500)] = 13
    radius: Positive = 0.5  # m within which a point is reached

    def route(self) -> Route:
        timed = {"seconds": self.seconds, "begin": self.begin}
        if self.shape == "line":
            return line(self.centre, self.end, self.points, radius=self.radius, **timed)
        inner = self.outer if self.shape == "circle" else self.inner
        return spiral(
            self.centre,
            inner,
            self.outer,
            self.turns,
            points=self.points,
            angle=radians(self.angle),
            point_radius=self.radius,
            **timed,
        )


class Manner(Settings):
    """How someone fights."""

    style: str | dict[str, str | float] = "boxer"  # a preset, or one with weights changed
    depth: Depth = 3
    wanted: tuple[str, ...] = ()  # A⁺, kinds or labels of actions
    unwanted: tuple[str, ...] = ()  # A⁻
    only: tuple[str, ...] = ()  # the action set; empty: all
    facing_deg: Positive | None = None  # from the opponent at the end, in place of the bout's
    boredom: Annotated[Finite, Field(ge=0)] = BOREDOM
    restlessness: Annotated[Finite, Field(ge=0)] = RESTLESSNESS
    stays_down: bool = False  # after a fall

    @model_validator(mode="after")
    def _style_is_one(self) -> Self:
        try:
            self.weights()
        except KumiteError as error:
            raise ValueError(str(error)) from None
        return self

    def weights(self) -> Style:
        return style(self.style)

    def player(self) -> Player:
        facing = None if self.facing_deg is None else radians(self.facing_deg)
        return Player(
            self.weights(),
            self.depth,
            self.wanted,
            self.unwanted,
            facing=facing,
            boredom=self.boredom,
            restlessness=self.restlessness,
            only=self.only,
            stays_down=self.stays_down,
        )


class TreeSettings(Manner):
    """Fights by game tree, perhaps along check points."""

    by: Literal["tree"] = "tree"
    point: tuple[CheckPointSettings, ...] = ()
    path: PathSettings | None = None  # before the points

    @model_validator(mode="after")
    def _route_is_one(self) -> Self:
        try:
            self.route()
        except KumiteError as error:
            raise ValueError(str(error)) from None
        return self

    def route(self) -> Route | None:
        points = check_points(self.point)
        if self.path is None:
            return points
        return self.path.route() if points is None else self.path.route().then(points)


class Weights(Settings):
    """Weights of precomputed policies, and how one chooses by them."""

    approach: Weight = 1.0
    strike: Weight = 6.0
    behaviours: dict[str, Weight] = Field(default_factory=dict)  # weights of others, by name
    facing: Weight = 3.5
    few: Annotated[int, Field(ge=1, le=50)] = 3  # drawn from the best few actions
    again: Annotated[int, Field(ge=1, le=50)] = 4  # of the best actions weighed a step further
    personal_space: Annotated[Finite, Field(ge=0, le=3)] = 0.7  # m kept to the other's body

    @model_validator(mode="after")
    def _some_weight(self) -> Self:
        if self.approach + self.strike + sum(self.behaviours.values()) == 0:
            raise ValueError("all weights are 0; expected approach, strike or another above 0")
        return self

    def temper(self) -> Temper:
        return Temper(
            self.approach,
            self.strike,
            self.facing,
            self.few,
            again=self.again,
            personal_space=self.personal_space,
            more=dict(self.behaviours),
        )


class PolicySettings(Weights):
    """Fights by precomputed policies."""

    by: Literal["policy"] = "policy"


class FighterSettings(TreeSettings):
    """A fighter by game tree: a :class:`CharacterSettings` whose fight is all it has."""

    name: Name
    position: tuple[Metres, Metres]  # m, x and z
    yaw_deg: Finite = 0.0  # 0 faces +Z
    against: Name  # another character, or "nearest": of those who are after it
    controllers: Controllers = ("fight",)
    reaction: Reaction = REACTION

    @model_validator(mode="after")
    def _controllers_are_all(self) -> Self:
        refuse_controllers(self.controllers)
        return self


class BoutSettings(Settings):
    """What a fight goes by."""

    library: Literal["boxing", "sword", "locomotion", "all"] = "boxing"  # of the built-in performer
    facing_deg: Positive = 60.0  # from the opponent at the end of an action, at most
    attack_range: Positive = 1.0  # m
    defence_range: Positive = 3.0  # m
    catch: Annotated[Finite, Field(ge=0)] = 0.0  # m; 0: nobody is caught
    arena: Annotated[float, Field(gt=0, le=FARTHEST)] | None = None  # m, radius; None: no edge
    scatter: Annotated[Finite, Field(ge=0, le=10)] = (
        0.0  # m by which the seed moves who begins where
    )
    scatter_deg: Annotated[Finite, Field(ge=0, le=180)] = 0.0  # and turns them
    stagger_from: Positive = 5.2  # m/s of a blow
    fall_from: Positive = 10.0  # m/s
    reactions: Literal["physical", "kinematic", "auto"] = "auto"  # what moves a struck body

    def rules(self) -> Rules:
        apart = {"library", "facing_deg", "scatter", "scatter_deg", "reactions"}
        told = self.model_dump(exclude=apart, exclude_none=True)
        return Rules(facing=radians(self.facing_deg), **told)


class Moment(Settings):
    """When: at a time, or when a fighter, or each of several, has come to a check point."""

    at: Annotated[Finite, Field(ge=0)] | None = None  # s
    after: Name | Annotated[tuple[Name, ...], Field(min_length=1)] | None = None
    check_point: int = -1  # of that fighter's route; -1 is the last

    @model_validator(mode="after")
    def _one_of_both(self) -> Moment:
        if (self.at is None) == (self.after is None):
            raise ValueError('expected "at", a time, or "after", a fighter at a check point')
        return self

    @property
    def waits_for(self) -> tuple[str, ...]:
        """The fighters who have to come to that check point."""
        after = self.after or ()
        return (after,) if isinstance(after, str) else after


class CueSettings(Moment):
    """From a moment on somebody fights otherwise. What is not named stays."""

    who: Name
    against: Name | None = None
    style: str | dict[str, str | float] | None = None
    depth: Depth | None = None
    wanted: tuple[str, ...] | None = None
    unwanted: tuple[str, ...] | None = None
    only: tuple[str, ...] | None = None
    point: tuple[CheckPointSettings, ...] | None = None  # a new route

    def route(self) -> Route | None:
        return None if self.point is None else check_points(self.point)

    @model_validator(mode="after")
    def _changes_something(self) -> CueSettings:
        if all(getattr(self, name) is None for name in CHANGES):
            raise ValueError(f"it changes nothing; expected one of {', '.join(CHANGES)}")
        if self.style is not None:
            Manner(style=self.style)  # raises what is wrong with it
        return self


class VehicleSettings(Moment):
    """A box that drives from a place to another from a moment on, and runs down whom it meets."""

    name: Name
    size: tuple[Positive, Positive, Positive] = (1.8, 1.5, 4.2)  # m: width, height, length
    start: tuple[Metres, Metres]
    end: tuple[Metres, Metres]
    speed: Annotated[Finite, Field(gt=0, le=60)] = 10.0  # m/s

    @model_validator(mode="after")
    def _goes_somewhere(self) -> VehicleSettings:
        if self.start == self.end:
            raise ValueError("start and end are the same; expected a way")
        return self
