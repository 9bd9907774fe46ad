"""The library of the built-in performer: made on first use, then found in the user's cache."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path

from kumite import performer
from kumite.clip import Clip, concatenate
from kumite.errors import KumiteError, unknown
from kumite.files import code_digest
from kumite.graph.avoiding import build_avoidance_library
from kumite.graph.library import Library, build_library, load_library, save_library
from kumite.graph.whole import build_action_library

FPS = 60.0


LEVELS = ("frames", "actions", "avoidance")


def builtin_library(
    cache: Path | None,
    progress: Callable[[str], None] = lambda stage: None,
    *,
    style: str = "boxing",
    level: str = "frames",
) -> Library:
    """The built-in performer's motion graph, kept in ``cache`` under the code that makes it.

    level: a graph of ``frames`` (:func:`build_library`), without reactions, or of whole ``actions``
    (:func:`build_action_library`), with them, or one from which an ``avoidance`` is soon reached
    (:func:`build_avoidance_library`), without. Of the style avoidance the avoidance parts are kept
    whole, and frames are joined at either foot's lift-off: a way out is then never far. Errors: an
    unknown style or level.
    """
    if level not in LEVELS:
        raise unknown("level", level, LEVELS)
    avoids = style == "avoidance"
    key = code_digest("performer", "body", "annotate", "graph", "clip", "rotation", "kernels")
    path = None if cache is None else cache / f"performer-{style}-{level}-{key}.kumite"
    if path is not None and path.exists():
        with contextlib.suppress(KumiteError):  # damaged or of another version: made anew
            return load_library(path)
    progress("performing")
    made = performer.performed(style, mirrored=False, cache=cache)
    if level == "frames":
        clips = concatenate(_voluntary(made), FPS)
        event = "both" if avoids else "left"
        library = build_library(clips, event=event, avoidance=avoids, progress=progress)
    elif level == "avoidance":
        clips = concatenate(_voluntary(made), FPS)
        library = build_avoidance_library(clips, blows=not avoids, progress=progress)
    else:
        clips = concatenate(list(made.clips), FPS)
        library = build_action_library(clips, avoidance=avoids, progress=progress)
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
