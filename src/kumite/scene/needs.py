"""What a scene needs to run: a library of which kind, motions of which kinds, physics."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import asdict, dataclass
from typing import Any

from kumite.scene.settings import SceneSettings
from kumite.scene.settings_dodge import DodgeSettings
from kumite.scene.settings_fight import BoutSettings
from kumite.scene.settings_prepare import PrepareSettings


@dataclass(frozen=True)
class Needs:
    """What a scene is given when nothing is said, and what one's own has to hold."""

    level: str  # of the library: 'kumite build --layer'
    style: str  # of the built-in performer, who stands in for a library
    motions: tuple[str, ...]  # kinds of motion that the library must hold, or labels of its own
    attackers: str | None = None  # the library of those who attack: a style, or a file
    layers: tuple[str, ...] = ()  # all that are needed, the first of them first
    physics: str = "no"  # 'no', 'if installed' or 'yes': MuJoCo moves bodies that are struck

    def __post_init__(self) -> None:
        if not self.layers:
            object.__setattr__(self, "layers", (self.level,))

    def to_json(self) -> dict[str, Any]:
        return {**asdict(self), "motions": list(self.motions), "layers": list(self.layers)}


def needs(settings: SceneSettings) -> Needs:
    """What a scene needs."""
    if settings.walking:
        style = (settings.prepare or PrepareSettings()).library
        return Needs("preparation", style, _prepared_for(settings))
    if settings.dodging:
        style = (settings.dodge or DodgeSettings()).library
        attackers = settings.attacker[0].library if settings.attacker else None
        return Needs("avoidance", style, ("avoidance",), attackers)
    bout = settings.bout or BoutSettings()
    layers = wanted_layers(settings)
    level = layers[0]
    fights = [p for p in settings.people if p.fight is not None]
    still = bout.library == "locomotion"
    motions = (("steps",) if still else ("blows", "steps")) if fights else ("steps",)
    if level == "actions" and not still:
        motions = (*motions, "defences")
    motions = (*motions, *(m for m, who in (("avoidance", settings.avoiding),) if who))
    if settings.preparing:
        motions = (*motions, *_prepared_for(settings))
    physics = {"kinematic": "no", "auto": "if installed", "physical": "yes"}[bout.reactions]
    physics = physics if level == "actions" else "no"
    style = bout.library if len(layers) == 1 or bout.library != "boxing" else "all"
    return Needs(level, style, motions, layers=layers, physics=physics)


def _prepared_for(settings: SceneSettings) -> tuple[str, ...]:
    """Walks, and the kinds of what is done at the end of them."""
    words = {t.kind for t in settings.targets}
    words |= set(settings.opponents.motions if settings.opponents else ())
    return "walks", *sorted(words)


def wanted_layers(settings: SceneSettings, has: Collection[str] = ("frames",)) -> tuple[str, ...]:
    """The layers that the controllers of a scene's [[character]]s and [[fighter]]s plan on, the
    first of them the one in which everyone begins.

    has: the layers that there are: policies take a graph of frames, or else one of whole actions.
    """
    people = settings.people
    tree = any(p.by_tree for p in people)
    out = ["actions"] if tree else []
    if any(p.by_policy for p in people) and not tree:
        out.append(next((n for n in ("frames", "actions") if n in has), "frames"))
    roams = any("roam" in p.controllers for p in people)
    out += ["avoidance"] if settings.avoiding or roams else []
    out += ["preparation"] if settings.preparing else []
    return tuple(out) or ("actions",)  # of who leaves everything to others
