"""A whole style performed: every take, varied by a seed, with its truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kumite.brief import brief
from kumite.clip import Clip, mirror
from kumite.errors import unknown
from kumite.performer.moves import Style
from kumite.performer.skeleton import skeleton
from kumite.performer.styles import STYLES
from kumite.performer.take import perform_take, vary
from kumite.performer.truth import Truth, mirrored_truth


@brief
@dataclass(frozen=True)
class Performance:
    """Clips at 60 Hz and, for each, what is true of it."""

    clips: tuple[Clip, ...]
    truth: tuple[Truth, ...]


def _mirrored(clip: Clip, style: Style) -> Clip:
    """The clip in a mirror: a sword changes hands, so its skeleton is another one."""
    seen = mirror(clip)
    if not style.armed:
        return seen
    return Clip(seen.name, skeleton(armed="left"), seen.fps, seen.root_position, seen.wxyz)


def perform(style: str = "boxing", seed: int = 0, *, mirrored: bool = True) -> Performance:
    """All takes of a style of the repertoire. The same seed gives the same bytes.

    mirrored: every take once more, seen in a mirror; with a sword it is left-handed, on a skeleton
    of its own. Errors: an unknown style.
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
    if mirrored:
        clips += [_mirrored(clip, chosen) for clip in clips]
        truths += [mirrored_truth(truth) for truth in truths]
    return Performance(tuple(clips), tuple(truths))
