"""The library of the built-in performer: made on first use, then found in the user's cache."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path

from kumite import performer
from kumite.clip import Clip, concatenate
from kumite.errors import KumiteError
from kumite.files import code_digest
from kumite.graph.library import Library, build_library, load_library, save_library

FPS = 60.0


def builtin_library(
    cache: Path | None, progress: Callable[[str], None] = lambda stage: None
) -> Library:
    """The built-in performer's motion graph, kept in ``cache`` under the code that makes it."""
    key = code_digest("performer", "body", "annotate", "graph", "clip", "rotation", "kernels")
    path = None if cache is None else cache / f"performer-{key}.kumite"
    if path is not None and path.exists():
        with contextlib.suppress(KumiteError):  # damaged or of another version: made anew
            return load_library(path)
    progress("performing")
    clips = concatenate(_voluntary(performer.performed(mirrored=False, cache=cache)), FPS)
    library = build_library(clips, progress=progress)
    if path is not None:
        with contextlib.suppress(KumiteError):  # a cache that cannot be written only costs time
            save_library(path, library)
    return library


def _voluntary(performance: performer.Performance) -> list[Clip]:
    """Clips without reactions: nobody chooses to be struck."""
    return [
        clip
        for clip, truth in zip(performance.clips, performance.truth)
        if all(action.kind != "reaction" for action in truth.actions)
    ]
