"""Scene files: who is where, and who aims at what. TOML, checked by name before anything runs."""

from __future__ import annotations

import difflib
import os
from importlib import resources
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, model_validator

from kumite import toml
from kumite.errors import KumiteError

Finite = Annotated[float, Field(allow_inf_nan=False)]
Metres = Annotated[float, Field(ge=-1000, le=1000)]  # recordings keep single precision
Name = Annotated[str, Field(min_length=1, max_length=60)]


class _Settings(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class CharacterSettings(_Settings):
    name: Name
    position: tuple[Metres, Metres]  # m, x and z
    yaw_deg: Finite = 0.0  # 0 faces +Z
    aims_at: Name  # a character (its head) or an object
    approach: Annotated[Finite, Field(ge=0)] = 1.0  # weights of the behaviours
    strike: Annotated[Finite, Field(ge=0)] = 6.0
    facing: Annotated[Finite, Field(ge=0)] = 3.0
    few: Annotated[int, Field(ge=1, le=50)] = 3  # drawn from the best few actions
    personal_space: Annotated[Finite, Field(ge=0, le=3)] = 0.7  # m kept to the other's body

    @model_validator(mode="after")
    def _some_weight(self) -> CharacterSettings:
        if self.approach + self.strike == 0:
            raise ValueError("approach and strike are both 0; expected at least one weight above 0")
        return self


class ObjectSettings(_Settings):
    name: Name
    position: tuple[Metres, Metres, Metres]  # m
    radius: Annotated[Finite, Field(gt=0, le=5)] = 0.1
    draggable: bool = True


class SceneSettings(_Settings):
    title: Name
    about: str = ""
    character: Annotated[tuple[CharacterSettings, ...], Field(min_length=1)]
    object: tuple[ObjectSettings, ...] = ()

    @model_validator(mode="after")
    def _names_fit(self) -> SceneSettings:
        names = [c.name for c in self.character] + [o.name for o in self.object]
        twice = sorted({n for n in names if names.count(n) > 1})
        if twice:
            raise ValueError(f"names used twice: {', '.join(twice)}")
        for c in self.character:
            if c.aims_at == c.name or c.aims_at not in names:
                others = ", ".join(n for n in names if n != c.name) or "nothing else"
                raise ValueError(
                    f"{c.name} aims at {c.aims_at!r}; expected another name of the scene ({others})"
                )
        return self


def builtin_scenes() -> dict[str, SceneSettings]:
    """The scenes that come with Kumite, by name."""
    folder = resources.files("kumite.scene") / "builtin"
    files = sorted((f for f in folder.iterdir() if f.name.endswith(".toml")), key=lambda f: f.name)
    return {
        f.name.removesuffix(".toml"): toml.parse(f.read_text("utf-8"), f.name, SceneSettings)
        for f in files
    }


def load_scene(name: str) -> SceneSettings:
    """A built-in scene by name, or a TOML scene file by path.

    Errors: an unknown name (near ones are suggested), a file that is missing, no TOML, or holds a
    wrong key or value (each named, all at once).
    """
    scenes = builtin_scenes()
    if name in scenes:
        return scenes[name]
    path = Path(name)
    # Not Path.exists, which raises on a name that is too long for the system.
    if path.suffix == ".toml" or os.path.exists(name):  # noqa: PTH110
        try:
            text = path.read_text("utf-8")
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or "not UTF-8 text; expected a TOML file"
            raise KumiteError(f"{name}: cannot be read ({reason})") from None
        return toml.parse(text, name, SceneSettings)
    near = difflib.get_close_matches(name, scenes, n=2, cutoff=0.4)
    hint = f"did you mean {' or '.join(near)}? " if near else ""
    raise KumiteError(
        f"unknown scene {name!r}: {hint}expected one of {', '.join(sorted(scenes))}, "
        "or the path of a .toml scene file"
    )
