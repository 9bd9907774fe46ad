"""Scene files of game-tree fights: who fights whom, in which style, along which check points."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from kumite.control import CheckPoint, Route, Style, style
from kumite.control.game_tree import BOREDOM, DEEPEST, RESTLESSNESS, Player, Rules
from kumite.control.routes import circle, line, spiral
from kumite.errors import KumiteError

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Metres = Annotated[float, Field(ge=-1000, le=1000)]
Name = Annotated[str, Field(min_length=1, max_length=60)]


class _Settings(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class CheckPointSettings(_Settings):
    """A place to pass, perhaps at a time, perhaps doing something there (B8)."""

    place: tuple[Metres, Metres]  # m, x and z
    time: Annotated[Finite, Field(ge=0)] | None = None  # s
    require: tuple[str, ...] = ()  # kinds or labels of actions
    refuse: tuple[str, ...] = ()
    radius: Positive = 0.5  # m within which it is reached


class PathSettings(_Settings):
    """Check points along a line, a circle or a spiral."""

    shape: Literal["line", "circle", "spiral"]
    centre: tuple[Metres, Metres] = (0.0, 0.0)  # of a circle or spiral; where a line begins
    end: tuple[Metres, Metres] = (0.0, 5.0)  # of a line
    inner: Annotated[Finite, Field(ge=0)] = 1.0  # m
    outer: Positive = 4.0  # m, of a circle its radius
    angle: Finite = 0.0  # degrees, where a circle or spiral begins
    turns: Finite = 1.0
    seconds: Positive | None = None  # for all of it
    points: Annotated[int, Field(ge=2, le=500)] = 13
    radius: Positive = 0.5  # m within which a point is reached

    def route(self) -> Route:
        angle = self.angle * 3.141592653589793 / 180.0
        if self.shape == "line":
            return line(
                self.centre, self.end, self.points, seconds=self.seconds, radius=self.radius
            )
        if self.shape == "circle":
            return circle(
                self.centre,
                self.outer,
                self.turns,
                self.seconds,
                self.points,
                angle=angle,
                point_radius=self.radius,
            )
        return spiral(
            self.centre,
            self.inner,
            self.outer,
            self.turns,
            self.seconds,
            self.points,
            angle=angle,
            point_radius=self.radius,
        )


class FighterSettings(_Settings):
    name: Name
    position: tuple[Metres, Metres]  # m, x and z
    yaw_deg: Finite = 0.0  # 0 faces +Z
    against: Name
    style: str | dict[str, str | float] = "boxer"  # a preset, or one with weights changed
    depth: Annotated[int, Field(ge=1, le=DEEPEST)] = 3
    wanted: tuple[str, ...] = ()  # A⁺, kinds or labels of actions
    unwanted: tuple[str, ...] = ()  # A⁻
    facing_deg: Positive | None = None  # from the opponent at the end, in place of the bout's
    boredom: Annotated[Finite, Field(ge=0)] = BOREDOM
    restlessness: Annotated[Finite, Field(ge=0)] = RESTLESSNESS
    point: tuple[CheckPointSettings, ...] = ()
    path: PathSettings | None = None  # before the points

    @model_validator(mode="after")
    def _style_is_one(self) -> FighterSettings:
        try:
            self.weights()
            self.route()
        except KumiteError as error:
            raise ValueError(str(error)) from None
        return self

    def weights(self) -> Style:
        return style(self.style)

    def route(self) -> Route | None:
        points = tuple(CheckPoint(**p.model_dump()) for p in self.point)
        if self.path is None:
            return Route(points) if points else None
        route = self.path.route()
        return route.then(Route(points)) if points else route

    def player(self) -> Player:
        facing = None if self.facing_deg is None else self.facing_deg * 3.141592653589793 / 180.0
        return Player(
            self.weights(),
            self.depth,
            self.wanted,
            self.unwanted,
            facing=facing,
            boredom=self.boredom,
            restlessness=self.restlessness,
        )


class BoutSettings(_Settings):
    """What a fight goes by."""

    library: Literal["boxing", "sword", "locomotion"] = "boxing"  # of the built-in performer
    facing_deg: Positive = 60.0  # from the opponent at the end of an action, at most
    attack_range: Positive = 1.0  # m
    defence_range: Positive = 3.0  # m
    catch: Annotated[Finite, Field(ge=0)] = 0.0  # m; 0: nobody is caught
    stagger_from: Positive = 5.2  # m/s of a blow
    fall_from: Positive = 10.0  # m/s
    reactions: Literal["physical", "kinematic", "auto"] = "auto"  # what moves a struck body

    def rules(self) -> Rules:
        values = self.model_dump(exclude={"library", "facing_deg", "reactions"})
        return Rules(facing=self.facing_deg * 3.141592653589793 / 180.0, **values)
