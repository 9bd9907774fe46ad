"""Time warps: a path of actions played faster or slower, so that a moment of it comes in time.

Of a path's edges some may be adjusted; they last s times as long as captured, the others stay as
they are (Oshita & Masaoka 2011, 4.1). There the speed jumps where the two meet; here the slowness,
scene frames per library frame, goes over in ramps. It begins with what the character has been
played at and ends at 1. With ramps given, time is still linear in s, so s has a closed form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kumite.errors import KumiteError
from kumite.kernels import warp as kernels
from kumite.synthesis.cast import FASTEST, SLOWEST

RAMP = 0.2  # s of captured motion in which one slowness goes over into another


@dataclass(frozen=True)
class Warp:
    """How a path of N library frames is played. Places count frames from where it begins."""

    fps: float
    now: float  # the place shown when time begins
    s: float  # by how much longer adjusted edges last
    count: int  # N
    profile: kernels.Profile

    @property
    def slowness(self) -> np.ndarray:
        """Scene frames per library frame at the path's places [N + 1]."""
        return self.profile.base + (self.s - 1.0) * self.profile.share

    @property
    def seconds(self) -> float:
        """From now to the path's end."""
        return self.seconds_to(float(self.count))

    def seconds_to(self, place: float) -> float:
        """From now until a place is shown."""
        to = kernels.time_at(float(place), self.s, self.count, self.profile)
        return float(to - kernels.time_at(self.now, self.s, self.count, self.profile)) / self.fps

    def place(self, seconds: float) -> float:
        """What is shown so long after now."""
        return float(self._places(seconds * self.fps, 1)[0])

    def rates(self, frames: int) -> np.ndarray:
        """Rates [frames] of the shown frames from now on, for :meth:`Cast.set_rate` before each.

        They add up to the places exactly.
        """
        return np.diff(self._places(0.0, frames + 1))

    def _places(self, begin: float, count: int) -> np.ndarray:
        out = np.empty(count)
        first = kernels.time_at(self.now, self.s, self.count, self.profile) + begin
        kernels.places(first, 1.0, self.s, self.count, self.profile, out)
        return out


def edge_frames(first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Lengths [E] of edges that play library frames first..last each, coming from first - 1."""
    return np.asarray(last, dtype=np.int64) - np.asarray(first, dtype=np.int64) + 1


def place_of(first: np.ndarray, last: np.ndarray, edge: int, frame: float) -> float:
    """The place on a path of a library frame of one of its edges."""
    return float(edge_frames(first, last)[:edge].sum() + frame - first[edge] + 1)


def make_profile(
    first: np.ndarray,
    last: np.ndarray,
    adjustable: np.ndarray,
    fps: float,
    *,
    slowness: float = 1.0,
) -> tuple[int, kernels.Profile]:
    """N and the profile of a path of edges first..last [E], of which some are adjustable [E].

    slowness: of the character now, scene frames per library frame (1 over its rate).
    Errors: no edges, edges without frames, a slowness that no rate within bounds has.
    """
    frames, may = edge_frames(first, last), np.asarray(adjustable, dtype=bool)
    if frames.ndim != 1 or len(frames) == 0 or may.shape != frames.shape:
        raise KumiteError(
            f"warp: edges {frames.shape} and adjustable {may.shape}, expected [E] of both, E ≥ 1"
        )
    if np.any(frames < 1):
        e = int(np.argmin(frames))
        raise KumiteError(f"warp: edge {e} has {frames[e]} frames, expected 1 or more")
    if not (np.isfinite(fps) and fps > 0):
        raise KumiteError(f"warp: {fps} frames a second, expected more than 0")
    if not 1.0 / FASTEST <= slowness <= 1.0 / SLOWEST:
        raise KumiteError(
            f"warp: slowness {slowness:g}, expected {1.0 / FASTEST:g} to {1.0 / SLOWEST:g}"
        )
    profile = kernels.Profile(*(np.empty(int(frames.sum()) + 1) for _ in range(4)))
    count = kernels.fill(frames, may, RAMP * fps, float(slowness), profile)
    return int(count), profile


def time_warp(
    first: np.ndarray,
    last: np.ndarray,
    adjustable: np.ndarray,
    fps: float,
    *,
    place: float,
    seconds: float,
    now: float = 0.0,
    slowness: float = 1.0,
) -> Warp:
    """The warp of a path by which ``place`` is shown ``seconds`` after ``now``.

    Errors: as :func:`make_profile`; nothing adjustable on the way there, or not enough of it.
    """
    count, profile = make_profile(first, last, adjustable, fps, slowness=slowness)
    if not (np.isfinite(now) and now < place <= count):
        raise KumiteError(f"warp: from place {now:g} to {place:g}, expected a way within 0…{count}")
    s = float(kernels.solve(float(now), float(place), float(seconds * fps), count, profile))
    if np.isnan(s):
        raise KumiteError(f"warp: nothing is adjustable between places {now:g} and {place:g}")
    if not 1.0 / FASTEST <= s <= 1.0 / SLOWEST:
        raise KumiteError(
            f"warp: {seconds:g} s to place {place:g} would make adjustable edges last {s:.3g} "
            f"times as long; expected {1.0 / FASTEST:g} to {1.0 / SLOWEST:g}"
        )
    return Warp(float(fps), float(now), s, count, profile)
