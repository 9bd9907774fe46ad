"""The library of the built-in performer: made on first use, then found in the user's cache."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from kumite import performer
from kumite.annotate import find_contacts, find_cycles
from kumite.clip import Clip, ClipSet, concatenate
from kumite.errors import KumiteError, unknown
from kumite.files import code_digest
from kumite.graph.avoiding import build_avoidance_library
from kumite.graph.errands import build_preparation_library
from kumite.graph.hierarchy import authored_targets
from kumite.graph.library import Library, build_library, load_library, save_library
from kumite.graph.whole import build_action_library

FPS = 60.0


LEVELS = ("frames", "actions", "avoidance", "preparation")


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
    (:func:`build_avoidance_library`), without, or, of the style targets, of locomotion and the
    target motions that ``preparation`` is for (:func:`build_preparation_library`). Of the style
    avoidance the avoidance parts are kept whole, and frames are joined at either foot's lift-off: a
    way out is then never far. Errors: an unknown style or level; a style without target motions.
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
    elif level == "preparation":
        clips = concatenate(list(made.clips), FPS)
        library = _preparation(clips, made, progress)
    else:
        clips = concatenate(list(made.clips), FPS)
        library = build_action_library(clips, avoidance=avoids, progress=progress)
    if path is not None:
        with contextlib.suppress(KumiteError):  # a cache that cannot be written only costs time
            save_library(path, library)
    return library


def _preparation(
    clips: ClipSet, made: performer.Performance, progress: Callable[[str], None]
) -> Library:
    """Of the targets as they were authored, and the cycles of what else was."""
    targets, contacts = authored_targets(clips, made.truth, FPS), find_contacts(clips)
    goes = np.zeros(len(clips), dtype=bool)
    for truth, first, source in zip(made.truth, clips.clip_start.tolist(), made.clips):
        for a in truth.actions:
            if a.mark is None:
                start, stop = (first + round(f * FPS / source.fps) for f in (a.start, a.stop))
                goes[start : stop + 1] = True
    cycles = find_cycles(clips, contacts, where=goes)
    return build_preparation_library(clips, targets, cycles, contacts=contacts, progress=progress)


def _voluntary(performance: performer.Performance) -> list[Clip]:
    """Clips without reactions: nobody chooses to be struck."""
    return [
        clip
        for clip, truth in zip(performance.clips, performance.truth)
        if all(action.kind != "reaction" for action in truth.actions)
    ]
