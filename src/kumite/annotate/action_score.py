"""How well actions are found, on clips whose truth is known, and on takes whose names tell it.

On the performer's clips truth is a list of moves with a few frames of guard between them. There

- a *true boundary* is the frames from one move's stop to the next one's start; the first and the
  last move have one to the guard around them, unless they are idle themselves;
- a *found boundary* is where one action of a clip ends and the next begins;
- they match one to one where they are at most TOLERANCE frames apart: precision is the share of
  found boundaries that match, recall that of true ones;
- a move's kind is right where the action that shares most frames with it is of that kind;
- an avoidance part is right where it and a true one have at least half of the frames in common that
  either has, one to one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kumite.annotate.actions import Actions
from kumite.annotate.avoidance import AvoidanceParts
from kumite.annotate.vocabulary import KINDS
from kumite.clip import ClipSet
from kumite.performer import Truth

TOLERANCE = 3  # frames
COMMON = 0.5  # of the frames that either of two parts has


@dataclass(frozen=True)
class ActionScore:
    """Counts, so that scores of several sets can be added up."""

    found: int  # boundaries
    found_right: int
    true: int
    true_found: int
    confusion: np.ndarray  # [5, 5] moves by true kind (rows) and found kind, in the order of KINDS

    @property
    def precision(self) -> float:
        return self.found_right / max(self.found, 1)

    @property
    def recall(self) -> float:
        return self.true_found / max(self.true, 1)

    @property
    def kinds_right(self) -> float:
        return float(np.trace(self.confusion) / max(self.confusion.sum(), 1))

    def __add__(self, other: ActionScore) -> ActionScore:
        return ActionScore(
            self.found + other.found,
            self.found_right + other.found_right,
            self.true + other.true,
            self.true_found + other.true_found,
            self.confusion + other.confusion,
        )


def score_actions(clips: ClipSet, actions: Actions, truth: Sequence[Truth]) -> ActionScore:
    """Actions of the performer's clips against their truth, both at the clips' rate."""
    total = ActionScore(0, 0, 0, 0, np.zeros((len(KINDS), len(KINDS)), dtype=np.int64))
    for c, known in enumerate(truth):
        first = int(clips.clip_start[c])
        mine = actions.clip == c
        start, stop, kind = actions.start[mine] - first, actions.stop[mine] - first, actions.kind
        cuts = start[1:].astype(float)
        found_right = np.zeros(len(cuts), dtype=bool)
        bounds = true_boundaries(known)
        hits = 0
        for a, b in bounds:
            apart = np.maximum(np.maximum(a - cuts, cuts - b), 0.0)
            apart[found_right] = np.inf
            if len(cuts) and apart.min() <= TOLERANCE:
                found_right[int(np.argmin(apart))] = True
                hits += 1
        confusion = np.zeros_like(total.confusion)
        for move in known.actions:
            shared = np.minimum(stop, move.stop) - np.maximum(start, move.start)
            if len(shared):
                confusion[KINDS.index(move.kind), kind[mine][int(np.argmax(shared))]] += 1
        total += ActionScore(len(cuts), int(found_right.sum()), len(bounds), hits, confusion)
    return total


@dataclass(frozen=True)
class AvoidanceScore:
    """Counts of avoidance parts, and how far the right ones are off."""

    found: int
    true: int
    right: int
    start_off: np.ndarray  # [right] s, found minus true
    stop_off: np.ndarray  # [right] s

    @property
    def precision(self) -> float:
        return self.right / max(self.found, 1)

    @property
    def recall(self) -> float:
        return self.right / max(self.true, 1)

    def __add__(self, other: AvoidanceScore) -> AvoidanceScore:
        return AvoidanceScore(
            self.found + other.found,
            self.true + other.true,
            self.right + other.right,
            np.concatenate([self.start_off, other.start_off]),
            np.concatenate([self.stop_off, other.stop_off]),
        )


def true_avoidance(clips: ClipSet, truth: Sequence[Truth]) -> AvoidanceParts:
    """What the performer marked: frames in which the body is out of where it was."""
    marked = [
        (int(first) + a.avoid[0], int(first) + a.avoid[1])
        for first, known in zip(clips.clip_start[:-1], truth)
        for a in known.actions
        if a.avoid is not None
    ]
    start, stop = np.array(marked, dtype=np.int64).reshape(-1, 2).T
    return AvoidanceParts(start, stop, clips.clip_start)


def score_avoidance(
    clips: ClipSet, parts: AvoidanceParts, truth: Sequence[Truth], common: float = COMMON
) -> AvoidanceScore:
    """Avoidance parts of the performer's clips against their truth, both at the clips' rate.

    common: the share of frames that makes two parts the same (intersection over union).
    """
    true = true_avoidance(clips, truth)
    start = np.maximum(true.start[:, None], parts.start)
    stop = np.minimum(true.stop[:, None], parts.stop)
    either = np.maximum(true.stop[:, None], parts.stop) - np.minimum(
        true.start[:, None], parts.start
    )
    share = np.maximum(stop - start, 0) / either
    pairs = []
    while share.size and share.max() >= common:
        t, p = np.unravel_index(np.argmax(share), share.shape)
        share[t], share[:, p] = 0.0, 0.0
        pairs.append((t, p))
    t, p = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    return AvoidanceScore(
        len(parts),
        len(true),
        len(pairs),
        (parts.start[p] - true.start[t]) / clips.fps,
        (parts.stop[p] - true.stop[t]) / clips.fps,
    )


def true_boundaries(truth: Truth) -> list[tuple[int, int]]:
    """First and last frame at which a cut between two moves is right."""
    moves = truth.actions
    pause = min((b.start - a.stop for a, b in zip(moves[:-1], moves[1:])), default=0)
    out = [(a.stop, b.start) for a, b in zip(moves[:-1], moves[1:])]
    settle = max((b - a for a, b in out), default=pause)
    if moves[0].kind != "idle":
        out.insert(0, (moves[0].start - settle, moves[0].start))
    if moves[-1].kind != "idle":
        out.append((moves[-1].stop, moves[-1].stop + settle))
    return out


def kind_shares(clips: ClipSet, actions: Actions) -> Mapping[str, np.ndarray]:
    """How many actions of each kind [5] every clip holds, by its name."""
    return {
        name: np.bincount(actions.kind[actions.clip == c], minlength=len(KINDS))
        for c, name in enumerate(clips.names)
    }
