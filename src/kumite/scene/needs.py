"""What a scene needs to run: a library of which kind, motions of which kinds, physics."""

from __future__ import annotations

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
    motions: tuple[str, ...]  # kinds of motion, or targets by label, that the library must hold
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
        labels = {t.motion for t in settings.targets}
        labels |= set(settings.opponents.motions if settings.opponents else ())
        style = (settings.prepare or PrepareSettings()).library
        return Needs("preparation", style, ("walks", *sorted(labels)))
    if settings.dodging:
        style = (settings.dodge or DodgeSettings()).library
        attackers = settings.attacker[0].library if settings.attacker else None
        return Needs("avoidance", style, ("avoidance",), attackers)
    if settings.fighters:
        bout = settings.bout or BoutSettings()
        physics = {"kinematic": "no", "auto": "if installed", "physical": "yes"}[bout.reactions]
        motions = ("steps",) if bout.library == "locomotion" else ("blows", "steps", "defences")
        if not settings.avoiding:
            return Needs("actions", bout.library, motions, physics=physics)
        layers = ("actions", "avoidance")
        return Needs("actions", bout.library, (*motions, "avoidance"), None, layers, physics)
    return Needs("frames", "boxing", ("blows", "steps"))
