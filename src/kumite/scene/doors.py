"""What a scene is made of and told is checked where it comes in."""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel

from kumite.checks import FAR, array, instance, shown, whole
from kumite.errors import KumiteError
from kumite.graph import Layer, Library


def check_scene(settings: object, library: object, seed: object, *layers: str) -> Layer:
    """The layer that a scene runs on, which may be given in place of a library that has it.

    layers: that it can run on, the best first.

    Errors: settings of no scene, such as its name; no library, or one without the layer; a seed
    that is no number.
    """
    check_settings(settings)
    whole(seed, "seed", least=0)
    return layer_of(library, "library", *layers)


def check_settings(settings: object) -> None:
    """Errors: settings of no scene, such as its name."""
    if not isinstance(settings, BaseModel):
        raise KumiteError(
            f"scene: {shown(settings)}; expected its settings, as kumite.load_scene gives them"
        )


def layer_of(library: object, what: str, *layers: str) -> Layer:
    """The first of some layers that a library has, or the layer itself that is given.

    Errors: neither; no such layer.
    """
    if isinstance(library, Library):
        return library.layer(next((n for n in layers if n in library.layers), layers[0]))
    return instance(library, Layer, what)


def a_place(position: object, name: str) -> np.ndarray:
    """Where an object is put [3] m. Errors: three finite numbers it is not."""
    return array(position, f"the place of {name!r}", (3,), least=-FAR, most=FAR).copy()
