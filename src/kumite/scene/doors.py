"""What a scene is made of and told is checked where it comes in."""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel

from kumite.checks import FAR, array, instance, shown, whole
from kumite.errors import KumiteError
from kumite.graph import Library


def check_scene(settings: object, library: object, seed: object) -> None:
    """Errors: settings of no scene, such as its name; no library; a seed that is no number."""
    if not isinstance(settings, BaseModel):
        raise KumiteError(
            f"scene: {shown(settings)}; expected its settings, as kumite.load_scene gives them"
        )
    instance(library, Library, "library")
    whole(seed, "seed", least=0)


def a_place(position: object, name: str) -> np.ndarray:
    """Where an object is put [3] m. Errors: three finite numbers it is not."""
    return array(position, f"the place of {name!r}", (3,), least=-FAR, most=FAR).copy()
