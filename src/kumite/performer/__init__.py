"""The built-in performer: original clips authored in code, and their ground truth.

Moves are tables (:mod:`kumite.performer.moves`); a user's own :class:`Move` is performed like ours:

    clip, truth = perform_take("mine", [as_written(move)], rng=np.random.default_rng(0))
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kumite.clip import Clip
from kumite.performer.figure import skeleton
from kumite.performer.moves import MOVES, Blow, Move, Step, aim
from kumite.performer.take import (
    Action,
    Performed,
    Strike,
    Truth,
    as_written,
    find_move,
    perform_take,
    vary,
)

TAKES: dict[str, tuple[tuple[str, ...], int]] = {
    # name: the moves that it draws from, and how many of them are performed
    "guard": (("guard", "guard_shift"), 12),
    "footwork": (("step_forward", "step_back", "step_left", "step_right", "guard"), 26),
    "turns": (("turn_left", "turn_right", "turn_left", "turn_right", "step_back"), 22),
    "jab": (("jab", "jab", "guard", "step_back", "turn_left", "turn_right"), 36),
    "cross": (("cross", "cross", "guard", "step_back", "turn_left", "turn_right"), 34),
    "hooks": (("left_hook", "right_hook", "guard", "step_back", "turn_left", "turn_right"), 34),
    "one_two": (("one_two", "one_two", "step_back", "guard", "turn_left", "turn_right"), 30),
    "duck": (("duck", "guard", "step_left", "step_right", "jab"), 18),
    "struck": (
        ("struck_head_front", "struck_head_left", "struck_head_right", "guard", "step_forward"),
        18,
    ),
    "shadow": (tuple(m.label for m in MOVES if m.kind != "reaction"), 48),
}  # fmt: skip


@dataclass(frozen=True)
class Performance:
    """Clips at 60 Hz and, for each, what is true of it."""

    clips: tuple[Clip, ...]
    truth: tuple[Truth, ...]


def perform(seed: int = 0) -> Performance:
    """All takes of the repertoire. The same seed gives the same bytes."""
    clips, truths = [], []
    streams = np.random.SeedSequence(seed).spawn(len(TAKES))
    for (name, (labels, count)), stream in zip(TAKES.items(), streams):
        rng = np.random.default_rng(stream)
        score = []
        while len(score) < count:
            # Every move once before any comes again: a shuffled deck, not dice.
            score += [vary(find_move(labels[k]), rng) for k in rng.permutation(len(labels))]
        clip, truth = perform_take(name, score[:count], rng=rng)
        clips.append(clip)
        truths.append(truth)
    return Performance(tuple(clips), tuple(truths))


__all__ = [
    "MOVES",
    "TAKES",
    "Action",
    "Blow",
    "Move",
    "Performance",
    "Performed",
    "Step",
    "Strike",
    "Truth",
    "aim",
    "as_written",
    "find_move",
    "perform",
    "perform_take",
    "skeleton",
    "vary",
]
