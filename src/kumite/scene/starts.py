"""Where characters begin: each somewhere inside an action, no two in step.

Everyone draws from a stream of its own, so that one more character changes nobody else's luck.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kumite.graph import Layer
from kumite.kernels.blow import NO_BLOW
from kumite.synthesis.cast import blow_windows

LONGEST = 1.5  # s before its end that an action is entered, at most
IN_STEP = 0.2  # s: who begin so near to each other in the captures move in step
ENOUGH = 8  # ends of stretches to a character: of fewer, seeds would repeat themselves
TRIES = 32  # draws until somebody is in step with nobody


def stream(seed: int, k: int) -> np.random.Generator:
    """What character k draws from."""
    return np.random.default_rng([seed, k])


def draw_starts(
    layer: Layer,
    stretches: np.ndarray,
    streams: Sequence[np.random.Generator],
    *,
    at_ends: bool = False,
    otherwise: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """The stretch [K] in which each of K characters begins, and the frame [K] of it.

    stretches [N]: those that may be begun in. From the frame drawn to the end of its stretch
    nobody throws a blow. Frames are ``IN_STEP`` apart as long as there is room. at_ends: everyone
    begins at the end of a stretch, about to choose, if there are ends enough and they are so far
    apart. otherwise [M]: where those begin who would be in step in all that they draw.
    """
    table, fps = layer.table, layer.clips.fps
    strikes = np.any(blow_windows(layer) != NO_BLOW, axis=1)
    struck = np.maximum.accumulate(np.where(strikes, np.arange(len(strikes)), -1))
    last = table.last.astype(np.int64)
    first = np.maximum(table.first, last - round(LONGEST * fps))
    first = np.minimum(np.maximum(first, struck[last] + 1), last)
    reach = max(1, round(IN_STEP * fps))
    taken = np.zeros(len(strikes) + reach + 1, dtype=bool)
    at_ends = at_ends and len(np.unique(last[stretches])) >= ENOUGH * len(streams)
    chosen, frame = (np.zeros(len(streams), dtype=np.int64) for _ in range(2))
    for k, rng in enumerate(streams):
        for of in (stretches, otherwise):
            if of is None or len(of) == 0:
                break
            s = of[rng.integers(len(of), size=TRIES)]
            f = rng.integers(first[s], last[s] + 1)
            if at_ends and not np.all(taken[last[s]]):
                f = last[s]
            free = np.flatnonzero(~taken[f])
            t = int(free[0]) if len(free) else 0
            chosen[k], frame[k] = s[t], f[t]
            if len(free):
                break
        taken[max(frame[k] - reach, 0) : frame[k] + reach + 1] = True
    return chosen, frame
