"""The library of the built-in performer: made on first use, then found in the user's cache."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from kumite import performer
from kumite.annotate import find_contacts, find_cycles
from kumite.checked import checked
from kumite.clip import Clip, ClipSet, concatenate
from kumite.errors import KumiteError, unknown
from kumite.files import code_digest
from kumite.graph.avoiding import build_avoidance
from kumite.graph.errands import build_preparation
from kumite.graph.hierarchy import authored_targets
from kumite.graph.layer import Layer, build_frames
from kumite.graph.library import Library, build_library
from kumite.graph.library_file import load_library, save_library
from kumite.graph.whole import build_actions
from kumite.layers import LAYERS

FPS = 60.0
ALL = "all"  # a style of all of these:
EVERYTHING = ("boxing", "avoidance", "targets")


@checked
def builtin_library(
    cache: Path | None,
    progress: Callable[[str], None] = lambda stage: None,
    *,
    style: str = "boxing",
    layers: Sequence[str] = ("frames",),
) -> Library:
    """A library of the built-in performer, kept in ``cache`` under the code that makes it.

    style: of the performer's, or ``all``: boxing, what it avoids, its walks and target motions
    together. layers: those that are wanted (:data:`LAYERS`); frames and avoidance are without
    reactions, for nobody chooses to be struck. Errors: an unknown style or layer; a style that does
    not allow a layer.
    """
    for name in layers:
        if name not in LAYERS:
            raise unknown("layer", name, LAYERS)
    if len(layers) == 1 and style != ALL:
        return Library.of(builtin_layer(cache, progress, style=style, level=layers[0]))
    path = _kept(cache, f"{style}-{'-'.join(layers)}")
    if path is not None and path.exists():
        with contextlib.suppress(KumiteError):
            return load_library(path)
    progress("performing")
    styles = EVERYTHING if style == ALL else (style,)
    made = [performer.performed(name, mirrored=False, cache=cache) for name in styles]
    clips = concatenate(
        [
            replace(clip, name=f"{name} {clip.name}")
            for name, one in zip(styles, made)
            for clip in one.clips
        ],
        FPS,
    )
    struck = [any(a.kind == "reaction" for a in t.actions) for one in made for t in one.truth]
    without = np.repeat(struck, np.diff(clips.clip_start))
    library = build_library(
        clips,
        layers=layers,
        progress=progress,
        frames={"event": "both", "without": without},
        avoidance={"blows": True, "without": without},
    )
    if library.missing:
        name, why = next(iter(library.missing.items()))
        raise KumiteError(f"style {style!r}: no layer {name!r} ({why})")
    if path is not None:
        with contextlib.suppress(KumiteError):
            save_library(path, library)
    return library


def _kept(cache: Path | None, name: str) -> Path | None:
    """Where a library is kept."""
    key = code_digest("performer", "body", "annotate", "graph", "clip", "rotation", "kernels")
    return None if cache is None else cache / f"performer-{name}-{key}.kumite"


@checked
def builtin_layer(
    cache: Path | None,
    progress: Callable[[str], None] = lambda stage: None,
    *,
    style: str = "boxing",
    level: str = "frames",
) -> Layer:
    """The built-in performer's motion graph, kept in ``cache`` under the code that makes it.

    level: a graph of ``frames`` (:func:`build_frames`), without reactions, or of whole ``actions``
    (:func:`build_actions`), with them, or one from which an ``avoidance`` is soon reached
    (:func:`build_avoidance`), without, or, of the style targets, of locomotion and the
    target motions that ``preparation`` is for (:func:`build_preparation`). Of the style
    avoidance the avoidance parts are kept whole, and frames are joined at either foot's lift-off: a
    way out is then never far. Errors: an unknown style or level; a style without target motions.
    """
    if level not in LAYERS:
        raise unknown("layer", level, LAYERS)
    avoids = style == "avoidance"
    path = _kept(cache, f"{style}-{level}")
    if path is not None and path.exists():
        with contextlib.suppress(KumiteError):  # damaged or of another version: made anew
            return load_library(path).layer(level)
    progress("performing")
    made = performer.performed(style, mirrored=False, cache=cache)
    if level == "frames":
        clips = concatenate(_voluntary(made), FPS)
        event = "both" if avoids else "left"
        library = build_frames(clips, event=event, avoidance=avoids, progress=progress)
    elif level == "avoidance":
        clips = concatenate(_voluntary(made), FPS)
        library = build_avoidance(clips, blows=not avoids, progress=progress)
    elif level == "preparation":
        clips = concatenate(list(made.clips), FPS)
        library = _preparation(clips, made, progress)
    else:
        clips = concatenate(list(made.clips), FPS)
        library = build_actions(clips, avoidance=avoids, progress=progress)
    if path is not None:
        with contextlib.suppress(KumiteError):  # a cache that cannot be written only costs time
            save_library(path, library)
    return library


def _preparation(
    clips: ClipSet, made: performer.Performance, progress: Callable[[str], None]
) -> Layer:
    """Of the targets as they were authored, and the cycles of what else was."""
    targets, contacts = authored_targets(clips, made.truth, FPS), find_contacts(clips)
    goes = np.zeros(len(clips), dtype=bool)
    for truth, first, source in zip(made.truth, clips.clip_start.tolist(), made.clips):
        for a in truth.actions:
            if a.mark is None:
                start, stop = (first + round(f * FPS / source.fps) for f in (a.start, a.stop))
                goes[start : stop + 1] = True
    cycles = find_cycles(clips, contacts, where=goes)
    return build_preparation(clips, targets, cycles, contacts=contacts, progress=progress)


def _voluntary(performance: performer.Performance) -> list[Clip]:
    """Clips without reactions: nobody chooses to be struck."""
    return [
        clip
        for clip, truth in zip(performance.clips, performance.truth)
        if all(action.kind != "reaction" for action in truth.actions)
    ]
