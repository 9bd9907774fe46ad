"""Who fights whom in a crowd: everyone with the nearest who is free."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

FAITHFUL = 2.0  # m: a pair nearer than this stays a pair
LOOKED_AT = 8  # of the nearest others


def pair_up(ground: np.ndarray, partner: np.ndarray) -> np.ndarray:
    """Opponents [K] of characters at ground [K, 2] m.

    partner [K]: the ones they had, or numbers outside 0..K-1. Pairs that are near each other stay.
    The others pair up greedily, the nearest two first (of equal distances those with the lower
    numbers); whoever is left over aims at the nearest of all, paired or not. At least two.
    """
    count = len(ground)
    out = np.full(count, -1)
    for k in range(count):
        j = int(partner[k])
        mutual = 0 <= j < count and j != k and partner[j] == k
        if mutual and np.hypot(*(ground[k] - ground[j])) <= FAITHFUL:
            out[k] = j
    free = np.flatnonzero(out < 0)
    while len(free) > 1:
        near = min(LOOKED_AT + 1, len(free))
        distance, index = _query(ground[free], ground[free], near)
        a = np.repeat(np.arange(len(free)), near - 1)
        b, d = index[:, 1:].ravel(), distance[:, 1:].ravel()
        made = 0
        for i in np.lexsort((b, a, d)):
            k, j = free[a[i]], free[b[i]]
            if k != j and out[k] < 0 and out[j] < 0:
                out[k], out[j] = j, k
                made += 1
        free = np.flatnonzero(out < 0)
        if not made:
            break
    if len(free):
        _, index = _query(ground, ground[free], 2)
        out[free] = np.where(index[:, 0] == free, index[:, 1], index[:, 0])
    return out


def _query(places: np.ndarray, of: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Distances and numbers [Q, count] of the nearest places."""
    distance, index = KDTree(places).query(of, k=count)
    return np.asarray(distance), np.asarray(index)
