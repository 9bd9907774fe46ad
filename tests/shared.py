"""What several modules of tests work on, made once."""

from __future__ import annotations

from functools import cache

from kumite import caches
from kumite.graph import Layer, Library, builtin_layer


def only(library: Library) -> Layer:
    """The layer of a library that has one."""
    (layer,) = library.layers.values()
    return layer


@cache
def builtin(style: str = "boxing", level: str = "frames") -> Layer:
    """The built-in performer's library, kept between runs under the code that makes it."""
    return builtin_layer(caches.cache_folder(None), style=style, level=level)
