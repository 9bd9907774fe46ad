"""A small library to avoid with, and throws at whoever stands somewhere in it."""

from __future__ import annotations

from functools import cache

import numpy as np

from kumite.clip import concatenate
from kumite.control.attack import Attack, thrown
from kumite.control.avoidance import AvoidanceSearch, Standing, _now
from kumite.graph import Layer, build_avoidance
from kumite.kernels import avoid as kernels
from kumite.kernels import joins
from kumite.performer.avoidance import AVOIDANCE
from kumite.performer.moves import Move
from kumite.performer.take import perform_take, vary
from kumite.rotation import planar_apply, planar_compose

FPS = 30.0
FEW = ("wait", "duck", "shuffle", "lean_left", "wait", "sidestep_right", "twist_right", "hollow")


def performed(labels: tuple[str, ...], seed: int = 7, fps: float = FPS) -> Layer:
    """The performer's moves of the style avoidance, one after the other, as a library."""
    rng = np.random.default_rng(seed)
    moves: list[Move] = [AVOIDANCE.find(label) for label in labels]
    score = [vary(move, AVOIDANCE, rng) for move in moves]
    clip, _ = perform_take("few", score, AVOIDANCE, rng=rng)
    return build_avoidance(concatenate([clip], fps))


@cache
def few() -> Layer:
    return performed(FEW + FEW[:3])


def somewhere(rng: np.random.Generator, library: Layer) -> Standing:
    """Anywhere in a stretch, played at any speed, after a join or not."""
    table = library.table
    stretch = int(rng.integers(len(table.first)))
    low, high = int(table.first[stretch]) - 1, int(table.last[stretch])
    phase = (
        float(rng.uniform(low, high)) if rng.random() < 0.7 else float(rng.integers(low, high + 1))
    )
    anchor = np.array([*rng.uniform(-3, 3, 2), rng.uniform(-np.pi, np.pi)])
    slowness = float(rng.choice([1.0, 1.0, 0.5, 1.4, 2.5]))
    left = None
    if rng.random() < 0.5:
        size = np.array([[0.03, 0.12, 0.12], [0.1, 0.3, 0.3]])[:, :, None]
        left = rng.normal(0.0, size, (2, 3, 3)) * [1.0, 0.1, 1.0]
    return Standing(anchor, phase, high, stretch, slowness, left)


def at_body(
    rng: np.random.Generator,
    search: AvoidanceSearch,
    standing: Standing,
    now: float = 0.0,
    *,
    off: float = 0.05,
    radius: tuple[float, float] = (0.03, 0.25),
    seconds: tuple[float, float] = (0.4, 1.9),
) -> Attack:
    """A ball aimed at one of the spheres of a body, about ``off`` [m] beside it."""
    frame = int(standing.phase)
    some = search.volumes.centre[frame, :, int(rng.integers(len(search.spheres)))].astype(float)
    goal = planar_apply(standing.anchor, some) + rng.normal(0.0, off, 3)
    facing = planar_compose(standing.anchor, search.library.clips.facing[frame])
    bearing, far = facing[2] + rng.uniform(-2, 2), rng.uniform(3, 9)
    place = np.array([facing[0], 0, facing[1]]) + far * np.array(
        [np.sin(bearing), 0, np.cos(bearing)]
    )
    place[1] = rng.uniform(0.8, 1.9)
    lasts = rng.uniform(*seconds)
    velocity = (goal - place) / lasts
    velocity[1] += 0.5 * 9.81 * lasts
    return thrown(place, velocity, float(rng.uniform(*radius)), when=now)


class Foresight:
    """What a search reckons with along a path, all of whose edges are slowed by ``scale``."""

    def __init__(
        self, search: AvoidanceSearch, standing: Standing, path: list[int], scale: float
    ) -> None:
        self.search, self.now, self.path = search, _now(standing), np.array(path, dtype=np.int32)
        self.room = search._room().scratch
        graph, room, count = search.graph, self.room, len(path)
        kernels.lay(self.path, count, self.now, graph, room)
        room.adjustable[: count + 1] = True
        ramp = search.weighing.ramp * graph.fps
        frames = kernels.fill(count + 1, room.upto, room.adjustable, ramp, room.at, room.weight)
        kernels.phase_times(
            room.at, room.weight, frames, scale, ramp, self.now.slowness, graph.fps, room.when
        )
        self.at, self.when = room.at[:frames].copy(), room.when[:frames].copy()
        self.ends = float(self.when[-1])
        joins.follow(self.path, count, frames, np.inf, self.now, graph, room)

    def at_time(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Spheres [B, 3] as captured and as they will be shown, ``t`` s from now."""
        graph, room, volumes = self.search.graph, self.room, self.search.volumes
        step = max(1, int(np.searchsorted(self.when, t - 1e-9)))
        way = (t - self.when[step - 1]) / (self.when[step] - self.when[step - 1])
        x = self.at[step - 1] + way * (self.at[step] - self.at[step - 1])
        k = int(np.searchsorted(room.upto[: len(self.path)], x - 1e-9))
        phase, last = kernels.phase_at(x, k, self.path, self.now, graph, room)
        row = min(int(phase + 1e-9), last)
        share, after, frame = phase - row, min(row + 1, last), room.anchor[k]
        moved, body = np.zeros((joins.PLACES, 3)), np.zeros((3, len(self.search.spheres)))
        kernels.put_body(volumes, 0, body.shape[1], row, share, after, frame, body)
        captured = body.T.copy()
        joins.displace(row, share, after, frame, step, way, graph.joins, room, moved)
        joins.shift_body(volumes, 0, body.shape[1], moved, body)
        return captured, body.T.copy()
