"""Spans: the frame ranges of several layers in one index, and ways from one layer to another.

All layers of a library are over the same frames, so a capture that is played in one layer often
comes past a state of another: going over there needs no join. The way back is one: to what is most
like the end of the span that was played.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kumite.graph.distance import pose_features, squared_distances
from kumite.graph.layer import Layer
from kumite.graph.library import Library

NO_STATE = -1
ROWS = 512  # frames that are compared at once


@dataclass(frozen=True)
class Spans:
    """The spans of some layers, one layer after the other: S of them."""

    layers: tuple[str, ...]
    begins: np.ndarray  # [N + 1] where those of each layer begin, the end
    first: np.ndarray  # [S] int32, first library frame played
    last: np.ndarray  # [S] int32, last library frame played

    @classmethod
    def of(cls, library: Library, layers: Sequence[str]) -> Spans:
        """Errors: the library lacks a layer."""
        tables = [library.layer(name).table for name in layers]
        begins = np.cumsum([0, *(len(t.first) for t in tables)])
        first, last = (
            np.ascontiguousarray(np.concatenate([getattr(t, which) for t in tables]), np.int32)
            for which in ("first", "last")
        )
        first.flags.writeable = last.flags.writeable = False
        return cls(tuple(layers), begins, first, last)

    @cached_property
    def _begins(self) -> list[int]:
        return self.begins.tolist()

    def span(self, layer: str, stretch: int) -> int:
        """The span that is a layer's stretch."""
        return self._begins[self.layers.index(layer)] + int(stretch)

    def stretch(self, span: int) -> tuple[str, int]:
        """The layer and the stretch that a span is."""
        n = bisect_right(self._begins, span) - 1
        return self.layers[n], int(span) - self._begins[n]


def entries(layer: Layer) -> np.ndarray:
    """The frame of the next state of a layer at or after each frame [F], within its clip; NO_STATE
    where there is none. A capture that is played comes past it."""
    clips, states = layer.clips, layer.table.state_frame.astype(np.int64)
    frame = np.arange(len(clips))
    at = np.searchsorted(states, frame)
    found = np.append(states, NO_STATE)[at]
    clip = clips.clip_of_frame
    inside = (found != NO_STATE) & (clip[found] == clip[frame])
    return np.where(inside, found, NO_STATE)


def nearest(layer: Layer, stretches: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Of each frame [F] the stretch of a layer whose end is most like it, and how far off that is
    [F] rad: whoever shows the frame may go on as after the stretch, by a join.

    stretches: only of these; None: of all.
    """
    which = np.arange(len(layer.table.last)) if stretches is None else stretches
    ends, first = np.unique(layer.table.last[which], return_index=True)
    features = pose_features(layer.clips)
    near, far = [], []
    for begin in range(0, len(layer.clips), ROWS):
        rows = np.arange(begin, min(begin + ROWS, len(layer.clips)))
        d = squared_distances(features, rows, ends)
        best = np.argmin(d, axis=1)
        near.append(which[first[best]])
        far.append(np.sqrt(np.maximum(d[np.arange(len(rows)), best], 0.0)))
    return np.concatenate(near), np.concatenate(far)
