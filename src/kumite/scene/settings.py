"""Scene files: who is where, and who aims at what. TOML, checked by name before anything runs."""

from __future__ import annotations

from collections import Counter
from functools import cached_property
from math import hypot
from typing import Annotated

from pydantic import Field, model_validator

from kumite import toml
from kumite.checked import checked
from kumite.errors import KumiteError
from kumite.scene import catalogue
from kumite.scene.settings_base import ARENA, FARTHEST, NEAREST, Finite, Metres, Name, Settings
from kumite.scene.settings_dodge import (
    AttackerSettings,
    BallsSettings,
    DodgerSettings,
    DodgersSettings,
    DodgeSettings,
)
from kumite.scene.settings_fight import BoutSettings, CueSettings, FighterSettings, VehicleSettings
from kumite.scene.settings_pairs import MOST_PAIRS, PairsSettings
from kumite.scene.settings_prepare import (
    OpponentsSettings,
    PrepareSettings,
    TargetSettings,
    WalkerSettings,
    WalkersSettings,
)

Weight = Annotated[float, Field(ge=0, allow_inf_nan=False)]
DOWN = 2.0  # s after which a ball that was thrown has come down
SOONEST = 0.02  # s between two throws
CROWD_SPACING = 1.5  # m between the two of a pair; pairs stand twice as far apart


class CharacterSettings(Settings):
    name: Name
    position: tuple[Metres, Metres]  # m, x and z
    yaw_deg: Finite = 0.0  # 0 faces +Z
    aims_at: Name  # a character (its head), an object, or "nearest"
    approach: Annotated[Finite, Field(ge=0)] = 1.0  # weights of the behaviours
    strike: Annotated[Finite, Field(ge=0)] = 6.0
    behaviours: dict[str, Weight] = Field(default_factory=dict)  # weights of others, by name
    facing: Annotated[Finite, Field(ge=0)] = 3.5
    few: Annotated[int, Field(ge=1, le=50)] = 3  # drawn from the best few actions
    again: Annotated[int, Field(ge=1, le=50)] = 4  # of the best actions weighed a step further
    personal_space: Annotated[Finite, Field(ge=0, le=3)] = 0.7  # m kept to the other's body

    @model_validator(mode="after")
    def _some_weight(self) -> CharacterSettings:
        _refuse_no_weight(self)
        return self


def _refuse_no_weight(of: CharacterSettings | CrowdSettings) -> None:
    if of.approach + of.strike + sum(of.behaviours.values()) == 0:
        raise ValueError("all weights are 0; expected approach, strike or another above 0")


class ObjectSettings(Settings):
    name: Name
    position: tuple[Metres, Metres, Metres]  # m
    yaw_deg: Finite = 0.0  # the way it faces, for behaviours that mind it
    radius: Annotated[Finite, Field(gt=0, le=5)] = 0.1
    draggable: bool = True


class CrowdSettings(Settings):
    """Characters that stand in pairs all over a square, each with the nearest who is free."""

    count: Annotated[int, Field(ge=2, le=1_000_000)] = 30
    spacing: Annotated[Finite, Field(ge=0.8, le=20)] = CROWD_SPACING  # m
    approach: Annotated[Finite, Field(ge=0)] = 1.0
    strike: Annotated[Finite, Field(ge=0)] = 6.0
    behaviours: dict[str, Weight] = Field(default_factory=dict)
    facing: Annotated[Finite, Field(ge=0)] = 3.5
    few: Annotated[int, Field(ge=1, le=50)] = 3
    again: Annotated[int, Field(ge=1, le=50)] = 1  # a crowd decides in a fifth of the time
    personal_space: Annotated[Finite, Field(ge=0, le=3)] = 0.7

    @model_validator(mode="after")
    def _some_weight(self) -> CrowdSettings:
        _refuse_no_weight(self)
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
                    aims_at=NEAREST,
                    **shared,
                )
            )
        return tuple(out)


class SceneSettings(Settings):
    title: Name
    about: str = ""
    character: tuple[CharacterSettings, ...] = ()
    crowd: CrowdSettings | None = None
    fighter: tuple[FighterSettings, ...] = ()  # who fight by game tree
    pairs: PairsSettings | None = None  # and many more of them, in formation
    bout: BoutSettings | None = None  # what their fight goes by
    cue: tuple[CueSettings, ...] = ()  # what changes while they fight
    vehicle: tuple[VehicleSettings, ...] = ()
    object: tuple[ObjectSettings, ...] = ()
    dodger: tuple[DodgerSettings, ...] = ()  # who avoid what is thrown at them
    dodgers: DodgersSettings | None = None  # and many more of them
    dodge: DodgeSettings | None = None  # how they search
    balls: BallsSettings | None = None  # and what is thrown
    attacker: tuple[AttackerSettings, ...] = ()  # or who attacks them
    walker: tuple[WalkerSettings, ...] = ()  # who prepare for what they will do
    walkers: WalkersSettings | None = None  # and many more of them
    prepare: PrepareSettings | None = None  # how they go about it
    target: tuple[TargetSettings, ...] = ()  # at what
    opponents: OpponentsSettings | None = None  # or at whom

    @cached_property
    def walking(self) -> tuple[WalkerSettings, ...]:
        """Those who prepare: named one by one, then those in rows."""
        return self.walker + (self.walkers.walkers() if self.walkers else ())

    @cached_property
    def targets(self) -> tuple[TargetSettings, ...]:
        """Things for them: named one by one, then those of the rows."""
        return self.target + (self.walkers.targets() if self.walkers else ())

    @cached_property
    def dodging(self) -> tuple[DodgerSettings, ...]:
        """Those who avoid: named one by one, then those in rows."""
        return self.dodger + (self.dodgers.dodgers() if self.dodgers else ())

    @cached_property
    def avoiding(self) -> tuple[str, ...]:
        """The names of all who avoid what comes at them."""
        fighters = (f.name for f in self.fighters if "avoid" in f.controllers)
        return (*(d.name for d in self.dodging), *fighters)

    @cached_property
    def characters(self) -> tuple[CharacterSettings, ...]:
        """Those named one by one, then the crowd."""
        return self.character + (self.crowd.characters() if self.crowd else ())

    @cached_property
    def fighters(self) -> tuple[FighterSettings, ...]:
        """Those named one by one, then those in formation."""
        return self.fighter + (self.pairs.fighters() if self.pairs else ())

    @model_validator(mode="after")
    def _attackers_fit(self) -> SceneSettings:
        if not self.attacker:
            return self
        if not self.dodging:
            raise ValueError("[[attacker]]s attack [[dodger]]s; there are none")
        if self.balls:
            raise ValueError("[[attacker]]s and [balls] in one scene; expected one of them")
        libraries = sorted({a.library for a in self.attacker})
        if len(libraries) > 1:
            raise ValueError(
                f"[[attacker]]s with the libraries {' and '.join(libraries)}; expected one"
            )
        return self

    @model_validator(mode="after")
    def _names_fit(self) -> SceneSettings:
        if self.walking:
            return self._fit_walkers()
        for part in ("prepare", "target", "opponents"):
            if getattr(self, part):
                raise ValueError(f"[{part}] is of [[walker]]s; there are none")
        if self.dodging:
            if self.character or self.crowd or self.fighter or self.pairs or self.object:
                raise ValueError("[[dodger]]s are among themselves; expected nobody else")
            return self._fit_dodgers()
        if (self.dodge or self.balls) and not self.avoiding:
            raise ValueError(
                "[dodge] and [balls] are of those who avoid; expected [[dodger]]s, or "
                '[[fighter]]s with controllers = ["avoid", "fight"]'
            )
        if self.fighter or self.pairs:
            if self.character or self.crowd or self.object:
                raise ValueError("[[fighter]]s fight among themselves; expected nobody else")
            return self._fit_fighters()
        if not self.character and self.crowd is None:
            raise ValueError(
                "nobody is in it; expected a [[character]], a [crowd], [[fighter]]s or [pairs]"
            )
        for part in ("bout", "cue", "vehicle"):
            if getattr(self, part):
                raise ValueError(f"[{part}] is of [[fighter]]s; there are none")
        names = [c.name for c in self.characters] + [o.name for o in self.object]
        twice = sorted(n for n, times in Counter(names).items() if times > 1)
        if twice:
            raise ValueError(f"names used twice: {', '.join(twice)}")
        for c in self.character:
            if c.aims_at == NEAREST and len(self.characters) > 1:
                continue
            if c.aims_at == c.name or c.aims_at not in names:
                others = ", ".join(n for n in names if n != c.name) or "nothing else"
                raise ValueError(
                    f"{c.name} aims at {c.aims_at!r}; expected another name of the scene ({others})"
                )
        return self

    def _fit_walkers(self) -> SceneSettings:
        others = ("character", "crowd", "fighter", "pairs", "bout", "cue", "vehicle", "object")
        for part in (*others, "dodger", "dodgers", "dodge", "balls", "attacker"):
            if getattr(self, part):
                raise ValueError(f"[[walker]]s are among themselves; expected no [{part}]")
        if self.targets and self.opponents:
            raise ValueError("[[target]]s and [opponents] in one scene; expected one of them")
        things = [t.name for t in self.targets]
        names = [*self.names, *things]
        twice = sorted(n for n, times in Counter(names).items() if times > 1)
        if twice:
            raise ValueError(f"names used twice: {', '.join(twice)}")
        for w in self.walker:
            for name in w.goes_to:
                if name not in things:
                    raise ValueError(
                        f"{w.name} goes to {name!r}; expected a target "
                        f"({', '.join(things) or 'there are none'})"
                    )
        return self

    def _fit_dodgers(self) -> SceneSettings:
        for part in ("bout", "cue", "vehicle"):
            if getattr(self, part):
                raise ValueError(f"[{part}] is of [[fighter]]s; there are none")
        twice = sorted(n for n, times in Counter(self.names).items() if times > 1)
        if twice:
            raise ValueError(f"names used twice: {', '.join(twice)}")
        return self

    def _fit_fighters(self) -> SceneSettings:
        names = self.names
        names = (*names, *(v.name for v in self.vehicle))
        bout = self.bout or BoutSettings()
        if bout.arena is not None:
            names = (*names, ARENA)
            for f in self.fighters:
                far = hypot(*(abs(x) + bout.scatter for x in f.position))
                if far > bout.arena:
                    raise ValueError(
                        f"position of {f.name}: {far:g} m from the middle"
                        f"{' with scatter' if bout.scatter else ''}, but bout.arena is "
                        f"{bout.arena:g} m; expected it to begin inside"
                    )
            routes = [(f.name, f.route()) for f in self.fighters]
            routes += [(c.who, c.route()) for c in self.cue]
            for name, route in routes:
                for n, point in enumerate(route.points if route else ()):
                    far = hypot(*point.place)
                    if far > bout.arena:
                        raise ValueError(
                            f"check point {n} of {name}: {far:g} m from the middle, but bout.arena "
                            f"is {bout.arena:g} m; expected it inside"
                        )
        twice = sorted(n for n, times in Counter(names).items() if times > 1)
        if twice:
            raise ValueError(f"names used twice: {', '.join(twice)}")
        known = set(self.names)
        for f in self.fighters:
            self._refuse_stranger(f.name, f.against, known)
        for cue in self.cue:
            if cue.who not in known:
                raise ValueError(f"a cue is for {cue.who!r}; expected a fighter")
            if cue.against is not None:
                self._refuse_stranger(cue.who, cue.against, known)
        routed = {f.name: f.route() for f in self.fighters}
        for moment in (*self.cue, *self.vehicle):
            for name in moment.waits_for:
                route = routed.get(name)
                if route is None or not -len(route) <= moment.check_point < len(route):
                    raise ValueError(
                        f"after {name!r} at check point {moment.check_point}; expected a fighter "
                        "with that check point"
                    )
        return self

    @staticmethod
    def _refuse_stranger(name: str, against: str, known: set[str]) -> None:
        if against == NEAREST and len(known) > 1:
            return
        if against == name or against not in known:
            others = ", ".join(sorted(known - {name})) or "nobody else"
            raise ValueError(f"{name} is against {against!r}; expected another fighter ({others})")

    @property
    def names(self) -> tuple[str, ...]:
        """Of all that move by themselves."""
        groups = (self.characters, self.fighters, self.dodging, self.attacker, self.walking)
        foes = range(self.opponents.count) if self.opponents else ()
        return (
            *(c.name for group in groups for c in group),
            *(f"opponent {n + 1}" for n in foes),
        )

    @property
    def aims(self) -> dict[str, str]:
        """Whom each aims at that always aims at the same."""
        found = {c.name: c.aims_at for c in self.characters if c.aims_at != NEAREST}
        found |= {f.name: f.against for f in self.fighters if f.against != NEAREST}
        if len(self.dodging) == len(self.attacker) == 1:
            mine, its = self.dodging[0].name, self.attacker[0].name
            found |= {mine: its, its: mine}
        return found


@checked
def with_count(settings: SceneSettings, count: int) -> SceneSettings:
    """The scene with another number of characters in its crowd, or pairs in its formation.

    Errors: it has neither; a number too small or too large.
    """
    several = ("crowd", "pairs", "dodgers", "walkers", "opponents")
    parts = [p for p in several if getattr(settings, p) is not None]
    part = parts[0] if parts else "crowd"
    of = getattr(settings, part)
    if of is None:
        raise KumiteError(
            f"count: {settings.title!r} names its characters one by one; expected a scene with a "
            "[crowd], [pairs], [dodgers], [walkers] or [opponents]"
        )
    least = 2 if part == "crowd" else 1
    if count < least:
        raise KumiteError(f"count: {count}, expected at least {least}")
    if part == "pairs" and count > MOST_PAIRS:
        raise KumiteError(f"count: {count} pairs, expected at most {MOST_PAIRS}")
    changed = of.model_copy(update={"count": count})
    return SceneSettings.model_construct(**{**dict(settings), part: changed})


@checked
def with_throws(settings: SceneSettings, throws: int) -> SceneSettings:
    """The scene with another number of balls thrown by its seed.

    Errors: nobody in it avoids anything; a number below 0.
    """
    if not settings.dodging:
        raise KumiteError(f"throws: nobody avoids in {settings.title!r}; expected [[dodger]]s")
    if not 0 <= throws <= 100_000:
        raise KumiteError(f"throws: {throws}, expected from 0 to 100000")
    balls = (settings.balls or BallsSettings()).model_copy(update={"throws": throws})
    return SceneSettings.model_construct(**{**dict(settings), "balls": balls})


@checked
def seconds_to_throw(settings: SceneSettings) -> float:
    """How long [s] it takes until all balls that the seed throws are thrown and down."""
    balls = settings.balls or BallsSettings()
    return balls.first + max(balls.throws - 1, 0) * balls.every + DOWN


@checked
def throws_within(settings: SceneSettings, seconds: float) -> SceneSettings:
    """The scene with balls thrown so much faster that all are thrown and down in a time [s].

    Errors: more balls than find time.
    """
    if seconds_to_throw(settings) <= seconds:
        return settings
    balls = settings.balls or BallsSettings()
    every = (seconds - balls.first - DOWN) / max(balls.throws - 1, 1)
    if every < SOONEST:
        most = max(0, int((seconds - balls.first - DOWN) / SOONEST) + 1)
        raise KumiteError(
            f"throws: {balls.throws} in {seconds:g} s; expected at most {most}, or more seconds "
            "(without --seconds the run lasts until all are thrown)"
        )
    balls = balls.model_copy(update={"every": every})
    return SceneSettings.model_construct(**{**dict(settings), "balls": balls})


def builtin_scenes() -> dict[str, SceneSettings]:
    """The scenes that come with Kumite, by name."""
    return {name: load_scene(name) for name in catalogue.names()}


@checked
def load_scene(name: str) -> SceneSettings:
    """A built-in scene by name, or a TOML scene file by path.

    Errors: an unknown name (near ones are suggested), a file that is missing, no TOML, or holds a
    wrong key or value (each named, all at once).
    """
    text, where = catalogue.find(name)
    return toml.parse(text, where, SceneSettings)
