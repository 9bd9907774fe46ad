"""Where characters begin: each somewhere inside an action, no two in step.

Everyone draws from a stream of its own, so that one more character changes nobody else's luck.
"""

from __future__ import annotations

import numpy as np

from kumite.graph import Layer
from kumite.kernels.blow import NO_BLOW
from kumite.synthesis.cast import blow_windows

LONGEST = 1.5  # s before its end that an action is entered, at most
IN_STEP = 0.2  # s: who begin so near to each other in the captures move in step
TRIES = 32  # draws until somebody is in step with nobody


def stream(seed: int, k: int) -> np.random.Generator:
    """What character k draws from."""
    return np.random.default_rng([seed, k])


def draw_starts(
    layer: Layer,
    stretches: np.ndarray,
    streams: list[np.random.Generator],
    *,
    at_ends: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """The stretch [K] in which each of K characters begins, and the frame [K] of it.

    stretches [N]: those that may be begun in. From the frame drawn to the end of its stretch
    nobody throws a blow. Frames are ``IN_STEP`` apart as long as there is room. at_ends: everyone
    begins at the end of a stretch, about to choose, as long as ends are so far apart.
    """
    table, fps = layer.table, layer.clips.fps
    strikes = np.any(blow_windows(layer) != NO_BLOW, axis=1)
    struck = np.maximum.accumulate(np.where(strikes, np.arange(len(strikes)), -1))
    last = table.last[stretches].astype(np.int64)
    first = np.maximum(table.first[stretches], last - round(LONGEST * fps))
    first = np.minimum(np.maximum(first, struck[last] + 1), last)
    reach = max(1, round(IN_STEP * fps))
    taken = np.zeros(len(strikes) + reach + 1, dtype=bool)
    chosen, frame = (np.zeros(len(streams), dtype=np.int64) for _ in range(2))
    for k, rng in enumerate(streams):
        n = rng.integers(len(stretches), size=TRIES)
        f = rng.integers(first[n], last[n] + 1)
        if at_ends and not np.all(taken[last[n]]):
            f = last[n]
        free = np.flatnonzero(~taken[f])
        t = int(free[0]) if len(free) else 0
        chosen[k], frame[k] = stretches[n[t]], f[t]
        taken[max(f[t] - reach, 0) : f[t] + reach + 1] = True
    return chosen, frame
