"""Scene files of people who avoid: who they are, how they search, what comes at them."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from kumite.control.rules import GRAVITY, AvoidanceRules, Temper
from kumite.scene.settings_base import REACTION, Finite, Metres, Name, Reaction, Settings
from kumite.synthesis.rates import FASTEST

STYLES = ("boxing", "sword")
POOL = 12  # balls that are seen at once: the oldest is thrown again

Range = tuple[Finite, Finite]


class DodgerSettings(Settings):
    """Somebody who avoids."""

    name: Name
    position: tuple[Metres, Metres]  # m, x and z
    yaw_deg: Finite = 0.0  # 0 faces +Z
    reaction: Reaction = REACTION


class DodgersSettings(Settings):
    """Many of them, in rows."""

    count: Annotated[int, Field(ge=1, le=10_000)] = 9
    spacing: Annotated[Finite, Field(ge=1.0, le=50.0)] = 4.0  # m
    reaction: Reaction = REACTION

    def dodgers(self) -> tuple[DodgerSettings, ...]:
        across = max(1, round(self.count**0.5))
        rows = -(-self.count // across)
        return tuple(
            DodgerSettings(
                name=f"dodger {n + 1}",
                position=(
                    self.spacing * (n % across - 0.5 * (across - 1)),
                    -self.spacing * (n // across - 0.5 * (rows - 1)),
                ),
                reaction=self.reaction,
            )
            for n in range(self.count)
        )


class DodgeSettings(Settings):
    """How they search; names as in :class:`~kumite.control.avoidance.AvoidanceRules`."""

    library: Literal["avoidance", "boxing"] = "avoidance"  # of the built-in performer
    window: Annotated[Finite, Field(gt=0, le=10)] = 1.0  # s
    avoidance: Annotated[Finite, Field(ge=0)] = 1.0  # weights
    body: Annotated[Finite, Field(ge=0)] = 1.0
    timescale: Annotated[Finite, Field(ge=0)] = 1.0
    clearance: Annotated[Finite, Field(ge=0, le=1)] = 0.02  # m
    most: Annotated[Finite, Field(ge=1, le=FASTEST)] = 4.0
    spheres: str | None = None  # a file of the body's volume (kumite spheres); by default laid
    index: bool | None = None  # by default where the graph is so large that looking up pays
    culling: bool = True
    searches: bool = True  # False: they only stand about
    counters: bool = True  # where a blow has been avoided, they strike back, if they have blows
    distance: Annotated[Finite, Field(ge=0.5, le=10)] = 1.0  # m kept to whoever attacks

    @model_validator(mode="before")
    @classmethod
    def _old_keys(cls, told: object) -> object:
        if isinstance(told, dict) and "latency" in told:
            raise ValueError("latency is no more; expected reaction = 0.2, in s, of whoever avoids")
        return told

    def search(self) -> AvoidanceRules:
        return AvoidanceRules(
            window=self.window,
            weights=(self.avoidance, self.body, self.timescale),
            clearance=self.clearance,
            most=self.most,
            index=self.index,
            culling=self.culling,
        )


class BallsSettings(Settings):
    """Who throws: from how far, how fast, at what part of those who avoid."""

    throws: Annotated[int, Field(ge=0, le=100_000)] = 0  # 0: only by hand
    first: Annotated[Finite, Field(ge=0)] = 1.0  # s, of the first throw
    every: Annotated[Finite, Field(ge=0.02, le=3600)] = 2.5  # s between throws
    speed: Range = (8.0, 13.0)  # m/s, mean over the ground
    distance: Range = (5.0, 8.0)  # m
    height: Range = (1.0, 1.9)  # m above the ground that it leaves the hand
    bearing_deg: Annotated[Finite, Field(ge=0, le=180)] = 70.0  # off straight ahead, at most
    radius: Annotated[Finite, Field(ge=0.01, le=0.5)] = 0.11  # m
    gravity: Annotated[Finite, Field(ge=0, le=100)] = GRAVITY  # m/s²
    pool: Annotated[int, Field(ge=1, le=1000)] = POOL

    @model_validator(mode="after")
    def _ranges(self) -> BallsSettings:
        for name, least in (("speed", 0.5), ("distance", 0.5), ("height", 0.0)):
            low, high = getattr(self, name)
            if not least <= low <= high <= 400:
                raise ValueError(
                    f"{name} = [{low:g}, {high:g}]; expected from {least:g} to 400, in order"
                )
        return self


class AttackerSettings(Settings):
    """Somebody who attacks those who avoid."""

    name: Name
    position: tuple[Metres, Metres]  # m, x and z
    yaw_deg: Finite = 0.0  # 0 faces +Z
    # Of the built-in performer, "boxing" or "sword"; or a .kumite file.
    library: Annotated[str, Field(min_length=1, max_length=4096)] = "boxing"
    approach: Annotated[Finite, Field(ge=0)] = 1.0  # weights of the behaviours
    strike: Annotated[Finite, Field(ge=0)] = 6.0
    facing: Annotated[Finite, Field(ge=0)] = 3.5
    few: Annotated[int, Field(ge=1, le=50)] = 3  # drawn from the best few actions
    personal_space: Annotated[Finite, Field(ge=0, le=3)] = 0.7  # m kept to the other's body

    @model_validator(mode="after")
    def _some_weight(self) -> AttackerSettings:
        if self.library not in STYLES and not self.library.endswith(".kumite"):
            raise ValueError(
                f"library {self.library!r}: expected {' or '.join(STYLES)}, or a .kumite file"
            )
        if self.approach + self.strike == 0:
            raise ValueError("all weights are 0; expected approach or strike above 0")
        return self

    def temper(self) -> Temper:
        return Temper(
            self.approach, self.strike, self.facing, self.few, personal_space=self.personal_space
        )
