"""The built-in performer: original clips authored in code, and their ground truth.

Moves are tables (:mod:`kumite.performer.boxing`); a user's own :class:`Move` is performed alike:

    clip, truth = perform_take("mine", [as_written(move)], BOXING, rng=np.random.default_rng(0))
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kumite.clip import Clip
from kumite.errors import unknown
from kumite.performer.boxing import BOXING
from kumite.performer.figure import skeleton
from kumite.performer.locomotion import LOCOMOTION
from kumite.performer.moves import Blow, Move, Step, Style, Take, aim
from kumite.performer.take import (
    Action,
    Performed,
    Strike,
    Truth,
    as_written,
    perform_take,
    vary,
)

STYLES = {style.name: style for style in (BOXING, LOCOMOTION)}


@dataclass(frozen=True)
class Performance:
    """Clips at 60 Hz and, for each, what is true of it."""

    clips: tuple[Clip, ...]
    truth: tuple[Truth, ...]


def perform(style: str = "boxing", seed: int = 0) -> Performance:
    """All takes of a style of the repertoire. The same seed gives the same bytes.

    Errors: an unknown style.
    """
    if style not in STYLES:
        raise unknown("style", style, STYLES)
    chosen = STYLES[style]
    clips, truths = [], []
    streams = np.random.SeedSequence(seed).spawn(len(chosen.takes))
    for (name, take), stream in zip(chosen.takes.items(), streams):
        rng = np.random.default_rng(stream)
        order = list(take.moves)
        if take.count is not None:
            # Every move once before any comes again: a shuffled deck, not dice.
            order = []
            while len(order) < take.count:
                order += [take.moves[k] for k in rng.permutation(len(take.moves))]
        score = [vary(chosen.find(label), chosen, rng) for label in order[: take.count]]
        clip, truth = perform_take(name, score, chosen, rng=rng)
        clips.append(clip)
        truths.append(truth)
    return Performance(tuple(clips), tuple(truths))


__all__ = [
    "BOXING",
    "LOCOMOTION",
    "STYLES",
    "Action",
    "Blow",
    "Move",
    "Performance",
    "Performed",
    "Step",
    "Strike",
    "Style",
    "Take",
    "Truth",
    "aim",
    "as_written",
    "perform",
    "perform_take",
    "skeleton",
    "vary",
]
