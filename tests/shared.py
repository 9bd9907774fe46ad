"""What several modules of tests work on, made once."""

from __future__ import annotations

from functools import cache

from kumite import caches
from kumite.graph import Layer, Library, builtin_layer
from kumite.performer import Performance
from kumite.performer import performed as kept


def only(library: Library) -> Layer:
    """The layer of a library that has one."""
    (layer,) = library.layers.values()
    return layer


@cache
def builtin(style: str = "boxing", level: str = "frames") -> Layer:
    """The built-in performer's library, kept between runs under the code that makes it."""
    return builtin_layer(caches.cache_folder(None), style=style, level=level)


@cache
def performed(style: str) -> Performance:
    """What the built-in performer does in a style, kept between runs likewise; no mirror images."""
    return kept(style, mirrored=False, cache=caches.cache_folder(None))
