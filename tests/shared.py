"""What several modules of tests work on, made once."""

from __future__ import annotations

from functools import cache

from kumite import caches
from kumite.graph import Library, builtin_library


@cache
def builtin(style: str = "boxing", level: str = "frames") -> Library:
    """The built-in performer's library, kept between runs under the code that makes it."""
    return builtin_library(caches.cache_folder(None), style=style, level=level)
