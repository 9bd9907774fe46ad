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
from kumite.scene.settings_base import ARENA, NEAREST, Finite, Metres, Name, Settings
from kumite.scene.settings_dodge import (
    AttackerSettings,
    BallsSettings,
    DodgerSettings,
    DodgersSettings,
    DodgeSettings,
)
from kumite.scene.settings_fight import BoutSettings, CueSettings, FighterSettings, VehicleSettings
from kumite.scene.settings_pairs import MOST_PAIRS, PairsSettings
from kumite.scene.settings_people import (
    CharacterSettings,
    CrowdSettings,
    Person,
    of_character,
    of_dodger,
    of_fighter,
)
from kumite.scene.settings_prepare import (
    OpponentsSettings,
    PrepareSettings,
    TargetSettings,
    WalkerSettings,
    WalkersSettings,
)

DOWN = 2.0  # s after which a ball that was thrown has come down
SOONEST = 0.02  # s between two throws


class ObjectSettings(Settings):
    name: Name
    position: tuple[Metres, Metres, Metres]  # m
    yaw_deg: Finite = 0.0  # the way it faces, for behaviours that mind it
    radius: Annotated[Finite, Field(gt=0, le=5)] = 0.1
    draggable: bool = True


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
    def people(self) -> tuple[Person, ...]:
        """All [[character]]s, [[fighter]]s and [[dodger]]s, in that order, those of [crowd],
        [pairs] and [dodgers], too; dodgers whom [[attacker]]s attack are in a scene of their own.
        """
        return (
            *(of_character(c) for c in self.characters),
            *(of_fighter(f) for f in self.fighters),
            *(of_dodger(d) for d in self.dodging if not self.attacker),
        )

    @cached_property
    def avoiding(self) -> tuple[str, ...]:
        """The names of all who avoid what comes at them."""
        people = (p.name for p in self.people if "avoid" in p.controllers)
        return (*(d.name for d in self.dodging if self.attacker), *people)

    @cached_property
    def preparing(self) -> tuple[str, ...]:
        """The names of all who prepare for what they will do."""
        people = (p.name for p in self.people if "prepare" in p.controllers)
        return (*(w.name for w in self.walking), *people)

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
        if self.dodging:
            if self.character or self.crowd or self.fighter or self.pairs or self.object:
                raise ValueError("[[dodger]]s are among themselves; expected nobody else")
            return self._fit_dodgers()
        return self._fit_people()

    def _fit_people(self) -> SceneSettings:
        if not self.people:
            raise ValueError(
                "nobody is in it; expected a [[character]], a [crowd], [[fighter]]s or [pairs]"
            )
        for part in ("prepare", "target", "opponents"):
            if getattr(self, part) and not self.preparing:
                raise ValueError(
                    f"[{part}] is of those who prepare; expected [[walker]]s, or "
                    '[[character]]s with "prepare" among their controllers'
                )
        if self.opponents:
            raise ValueError("[opponents] close in on [[walker]]s; expected [[character]]s instead")
        if (self.dodge or self.balls) and not self.avoiding:
            raise ValueError(
                "[dodge] and [balls] are of those who avoid; expected [[dodger]]s, or "
                '[[character]]s with controllers = ["avoid", "fight"]'
            )
        if not any(p.by_tree for p in self.people):
            for part in ("bout", "cue", "vehicle"):
                if getattr(self, part):
                    raise ValueError(
                        f"[{part}] is of those who fight by game tree; expected [[fighter]]s, or "
                        '[[character]]s with fight = { by = "tree" }'
                    )
        return self._fit_fights()

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

    def _fit_fights(self) -> SceneSettings:
        things = (*(o.name for o in self.object), *(t.name for t in self.targets))
        names = (*self.names, *things, *(v.name for v in self.vehicle))
        bout = self.bout or BoutSettings()
        if bout.arena is not None:
            names = (*names, ARENA)
            for f in self.people:
                far = hypot(*(abs(x) + bout.scatter for x in f.position))
                if far > bout.arena:
                    raise ValueError(
                        f"position of {f.name}: {far:g} m from the middle"
                        f"{' with scatter' if bout.scatter else ''}, but bout.arena is "
                        f"{bout.arena:g} m; expected it to begin inside"
                    )
            routes = [(f.name, f.route) for f in self.people]
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
        for p in self.people:
            if p.against is not None:
                self._refuse_stranger(p, p.against)
            for name in p.goes_to:
                if name not in (t.name for t in self.targets):
                    raise ValueError(
                        f"{p.name} goes to {name!r}; expected a target "
                        f"({', '.join(t.name for t in self.targets) or 'there are none'})"
                    )
        known = {p.name: p for p in self.people}
        for cue in self.cue:
            if cue.who not in known or not known[cue.who].by_tree:
                raise ValueError(
                    f"a cue is for {cue.who!r}; expected somebody who fights by game tree"
                )
            if cue.against is not None:
                self._refuse_stranger(known[cue.who], cue.against)
        routed = {p.name: p.route for p in self.people}
        for moment in (*self.cue, *self.vehicle):
            for name in moment.waits_for:
                route = routed.get(name)
                if route is None or not -len(route) <= moment.check_point < len(route):
                    raise ValueError(
                        f"after {name!r} at check point {moment.check_point}; expected a fighter "
                        "with that check point"
                    )
        return self

    def _refuse_stranger(self, person: Person, against: str) -> None:
        """Errors: it is against nobody of the scene, or, by game tree, against a thing."""
        if against == NEAREST and len(self.people) > 1:
            return
        others = [p.name for p in self.people if p.name != person.name]
        things = [] if person.by_tree else [o.name for o in self.object]
        if against not in (*others, *things):
            told = ", ".join((*others, *things)) or "nothing else"
            raise ValueError(
                f"{person.name} is against {against!r}; expected another name of the scene ({told})"
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Of all that move by themselves."""
        attacked = self.dodging if self.attacker else ()
        groups = (self.people, attacked, self.attacker, self.walking)
        foes = range(self.opponents.count) if self.opponents else ()
        return (
            *(c.name for group in groups for c in group),
            *(f"opponent {n + 1}" for n in foes),
        )

    @property
    def aims(self) -> dict[str, str]:
        """Whom each aims at that always aims at the same."""
        found = {p.name: p.against for p in self.people if p.against not in (None, NEAREST)}
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
    if not settings.avoiding:
        raise KumiteError(
            f"throws: nobody avoids in {settings.title!r}; expected [[dodger]]s, or characters "
            'with "avoid" among their controllers'
        )
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
