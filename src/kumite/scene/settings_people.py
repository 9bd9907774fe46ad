"""Scene files: who is in a scene, what decides for each, and how it fights, avoids and prepares."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import AliasChoices, Field, model_validator

from kumite.control.routes import Route
from kumite.control.rules import Player, Temper
from kumite.errors import KumiteError
from kumite.scene.settings_base import (
    FARTHEST,
    NEAREST,
    REACTION,
    Finite,
    Metres,
    Name,
    Positive,
    Reaction,
    Settings,
)
from kumite.scene.settings_dodge import DodgerSettings
from kumite.scene.settings_fight import (
    Controllers,
    FighterSettings,
    PolicySettings,
    TreeSettings,
    Weights,
    refuse_controllers,
)

CROWD_SPACING = 1.5  # m between the two of a pair; pairs stand twice as far apart


class PreparesSettings(Settings):
    """What somebody prepares for."""

    goes_to: tuple[Name, ...] = ()  # [[target]]s in this order; none: the nearest


class CharacterSettings(Weights):
    """Somebody, and what decides for it. Without ``fight`` it fights by policies, with the weights
    that stand here."""

    name: Name
    position: tuple[Metres, Metres]  # m, x and z
    yaw_deg: Finite = 0.0  # 0 faces +Z
    against: Name | None = Field(default=None, validation_alias=AliasChoices("against", "aims_at"))
    """A character (its head), an object, or "nearest"."""
    team: Name | None = None  # "nearest" is never somebody of it
    controllers: Controllers = ("fight",)
    fight: Annotated[TreeSettings | PolicySettings, Field(discriminator="by")] | None = None
    prepare: PreparesSettings | None = None
    engage: Positive = 3.0  # m at which a fight begins, where others are heard in between
    reaction: Reaction = REACTION

    @model_validator(mode="after")
    def _controllers_fit(self) -> CharacterSettings:
        refuse_controllers(self.controllers)
        for name in ("fight", "prepare"):
            if getattr(self, name) is not None and name not in self.controllers:
                raise ValueError(
                    f"{name} says how it does what it does not do; expected {name!r} among its "
                    f"controllers ({', '.join(self.controllers)})"
                )
        if "fight" in self.controllers and self.against is None:
            raise ValueError(
                'it fights nobody; expected against = a character, an object or "nearest"'
            )
        return self


class CrowdSettings(Weights):
    """Characters that stand in pairs all over a square, each with the nearest who is free."""

    count: Annotated[int, Field(ge=2, le=1_000_000)] = 30
    spacing: Annotated[Finite, Field(ge=0.8, le=20)] = CROWD_SPACING  # m
    again: Annotated[int, Field(ge=1, le=50)] = 1  # a crowd decides in a fifth of the time

    @model_validator(mode="after")
    def _finds_room(self) -> CrowdSettings:
        try:
            self.refuse_too_wide()
        except KumiteError as error:  # said with its line, as all that is wrong with a file
            raise ValueError(str(error)) from None
        return self

    def refuse_too_wide(self) -> None:
        """Errors: more than find room."""
        most = 2 * int(FARTHEST / self.spacing - 1.0) ** 2
        if self.count > most:
            raise KumiteError(
                f"count: {self.count} at a spacing of {self.spacing:g} m do not find room within "
                f"{FARTHEST:g} m; expected at most {most}"
            )

    def characters(self) -> tuple[CharacterSettings, ...]:
        """Pairs on a square lattice, face to face. Errors: more than find room."""
        self.refuse_too_wide()  # a count given beside the file was not checked with it
        pairs = (self.count + 1) // 2
        across = max(1, round(pairs**0.5))
        shared = self.model_dump(exclude={"count", "spacing"})
        out = []
        for k in range(self.count):
            row, column = divmod(k // 2, across)
            x = 2.0 * self.spacing * (column - 0.5 * (across - 1))
            z = 2.0 * self.spacing * (row - 0.5 * ((pairs - 1) // across))
            side = 0.5 if k % 2 else -0.5
            out.append(
                CharacterSettings(
                    name=f"boxer {k + 1}",
                    position=(x, z + side * self.spacing),
                    yaw_deg=180.0 if k % 2 else 0.0,
                    against=NEAREST,
                    **shared,
                )
            )
        return tuple(out)


@dataclass(frozen=True)
class Person:
    """Somebody of a scene, however the scene file says so."""

    name: str
    position: tuple[float, float]
    yaw_deg: float
    against: str | None
    team: str | None
    controllers: tuple[str, ...]
    fight: TreeSettings | Weights | None  # how it fights
    goes_to: tuple[str, ...]  # what it prepares for
    engage: float = 3.0  # m at which its fights begin, where other controllers come after them
    reaction: float = REACTION  # s until it knows of an attack that has begun

    @property
    def by_tree(self) -> bool:
        return isinstance(self.fight, TreeSettings)

    @property
    def by_policy(self) -> bool:
        return isinstance(self.fight, Weights)

    @property
    def player(self) -> Player:
        """How it plays a game tree; who does not play, as others take it to."""
        return self.fight.player() if isinstance(self.fight, TreeSettings) else Player()

    @property
    def route(self) -> Route | None:
        return self.fight.route() if isinstance(self.fight, TreeSettings) else None

    @property
    def temper(self) -> Temper | None:
        """How it chooses by policies, if it does."""
        return self.fight.temper() if isinstance(self.fight, Weights) else None


def of_character(c: CharacterSettings) -> Person:
    """A ``[[character]]``."""
    fights = "fight" in c.controllers
    fight = (c if c.fight is None else c.fight) if fights else None
    goes_to = c.prepare.goes_to if c.prepare else ()
    return Person(
        c.name, c.position, c.yaw_deg, c.against, c.team, c.controllers, fight, goes_to, c.engage,
        c.reaction,
    )  # fmt: skip


def of_fighter(f: FighterSettings) -> Person:
    """A ``[[fighter]]``."""
    return Person(
        f.name, f.position, f.yaw_deg, f.against, None, f.controllers, f, (), reaction=f.reaction
    )


def of_dodger(d: DodgerSettings) -> Person:
    """A ``[[dodger]]``."""
    controllers = ("avoid", "roam")
    return Person(
        d.name, d.position, d.yaw_deg, None, None, controllers, None, (), reaction=d.reaction
    )
