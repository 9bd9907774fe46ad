"""Avoidance with the least movement, in time (Oshita & Masaoka 2011).

Given what attacks and where the character is in its present edge, find the path of the motion graph
whose avoidance part falls on the attack: not hit, out of its way just before, no farther away than
need be, its speed adjusted as little as can be.
"""

from __future__ import annotations

import copy
import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from kumite.body import Spheres, lay_spheres
from kumite.brief import brief
from kumite.checks import instance
from kumite.clip import SIDES
from kumite.control.attack import Attack, packed
from kumite.control.rules import AvoidanceRules
from kumite.control.volumes import joins_of, volumes_of
from kumite.errors import KumiteError, unknown
from kumite.graph import Layer
from kumite.graph.spans import entries, nearest
from kumite.kernels import avoid as kernels
from kumite.kernels import cells, paths
from kumite.kernels.joins import PLACES
from kumite.rotation import planar_compose_one, planar_inverse

NONE = -1
END_EFFECTORS = tuple(f"{side}_{part}" for part in ("hand", "foot") for side in SIDES)
MOST_OTHERS = 32  # next best paths that are told
TUNABLE = ("window", "weights", "enough", "far", "most", "clearance", "wide", "ahead")
# Actions from which looking paths up is quicker than trying all: with eight times the built-in
# avoider's 14,594 a search takes 0.62 ms by the index and 0.74 without; as it is, 0.43 and 0.38.
WORTH_INDEXING = 90_000
MOST_PATHS = 50_000  # candidates of one search; what comes after them is not weighed


class Outcome:
    """What a search can come to, as the log says it."""

    FOUND = "found"
    WIDE = "wide"  # it passes by
    EARLY = "early"  # it comes later than is thought ahead
    LATE = "too late"  # it is over, or reaches the body before anything can be done
    NO_CANDIDATE = "no candidate"  # no path has an avoidance in time
    HIT = "hit"  # every candidate would be hit, or could not be timed


@brief
@dataclass(frozen=True)
class Standing:
    """Where a character is: in a stretch of the table, or at rest in a state."""

    anchor: np.ndarray  # [3] library world → scene
    phase: float  # library frame shown, with its fraction
    stop: int  # library frame at which the present edge ends
    stretch: int = NONE  # the present edge, NONE before any
    slowness: float = 1.0  # s of play for 1 s of capture, now
    left: np.ndarray | None = None  # [2, 3, 3] of joins, as Cast.left says; by default nothing


@dataclass(frozen=True)
class Plan:
    """When which frame of a path is shown."""

    path: tuple[int, ...]  # stretches after the present edge
    part: int  # as searches number it
    begins: float  # s, of the scene's clock
    at: np.ndarray  # [n] library frames since it began …
    when: np.ndarray  # [n] … and the s at which they show

    def frames(self, now: float) -> float:
        """Layer frames that have gone by at a time; 1 a frame once it is over."""
        return float(np.interp(now - self.begins, self.when, self.at))

    @property
    def ends(self) -> float:
        return self.begins + float(self.when[-1])


@dataclass(frozen=True)
class Avoidance:
    """What a search came to."""

    outcome: str
    path: tuple[int, ...] = ()  # stretches after the present edge; the last one avoids
    part: int = NONE  # which part of the library's
    aim: float = np.nan  # s from now to the attack's middle
    scale: float = 1.0  # s_time of Eq. 3, by which adjustable edges are slowed
    cost: float = np.nan  # e (Eq. 10) …
    costs: tuple[float, float, float] = (np.nan, np.nan, np.nan)  # … of avoidance, body, time scale
    distance: float = np.nan  # m, d: the smallest to the attack
    before: float = np.nan  # m, d₀: had the body stayed
    overlap: float = 0.0  # m s, e': how much of the attack goes through where the body was
    indexed: bool = False  # whether the index knew it
    counts: tuple[int, ...] = ()  # candidates by what became of them, as kernels.avoid numbers it
    plan: Plan | None = None
    others: tuple[tuple[tuple[int, ...], int], ...] = ()  # the next best, parts as in plans

    @property
    def candidates(self) -> int:
        return sum(self.counts)


class _Room(NamedTuple):
    """Arrays that a search works in."""

    scratch: kernels.Scratch
    node: np.ndarray
    way: np.ndarray
    gone: np.ndarray
    path: np.ndarray
    length: np.ndarray
    part: np.ndarray
    outcome: np.ndarray
    scores: np.ndarray
    turn: np.ndarray
    seen: np.ndarray
    seen_path: np.ndarray
    found: np.ndarray


class AvoidanceSearch:
    """Everything about a library that avoidance needs. Its searches may run in any thread."""

    def __init__(
        self,
        library: Layer,
        settings: AvoidanceRules | None = None,
        *,
        spheres: Spheres | None = None,
    ) -> None:
        """spheres: the body's volume; by default laid to cover it. Errors: no part to use."""
        instance(library, Layer, "AvoidanceSearch")
        self.library, self.settings = library, settings or AvoidanceRules()
        clips = library.clips
        self.spheres = spheres or lay_spheres(clips.skeleton)
        self.volumes = volumes_of(clips, self.spheres)
        parts = library.avoidance
        part_of, which = library.parts_of_stretch
        if len(which) == 0:
            raise KumiteError(
                "the library has no avoidance parts in its graph: nobody in it can avoid anything; "
                "expected clips of ducking, leaning or stepping aside (kumite segment shows what "
                "was found, and lets it be marked by hand)"
            )
        table, s = library.table, self.settings
        speed = fastest_end_effector(library)
        begins = parts.start[which].astype(np.int64)  # of built and of read libraries the same type
        ends = parts.stop[which].astype(np.int64) - 1
        self.which = which  # [A] part of the library for each part of an edge
        middle = 0.5 * (begins + ends)
        soonest = np.empty(table.states)
        paths.soonest(
            table.action_start, table.stretch, table.first, table.last, table.target,
            part_of, middle, soonest,
        )  # fmt: skip
        still = speed <= s.still
        self.graph = kernels.Graph(
            table.action_start,
            table.stretch,
            table.first,
            table.last,
            table.target,
            table.displacement,
            clips.facing,
            part_of,
            begins,
            ends,
            (speed > s.fast) | still,
            ((speed < s.slow) & (speed > s.still)) | still,
            soonest,
            float(clips.fps),
            joins_of(library, s.joins),
        )
        self.weighing = self._weighing(s)
        self._local = threading.local()

    def _weighing(self, s: AvoidanceRules) -> kernels.Weighing:
        return kernels.Weighing(
            np.array(s.weights),
            s.enough,
            s.far,
            s.most,
            s.clearance,
            s.left,
            s.ramp,
            float(self.spheres.radius.max()),
        )

    def tuned(self, **rules: Any) -> AvoidanceSearch:
        """The same with other rules of those that :data:`TUNABLE` names; they share all arrays.
        Searches of this one that are under way end as they began.

        Errors: rules that the index, the masks or the graph were made by; values not allowed.
        """
        for name in rules:
            if name not in TUNABLE:
                raise unknown("rule that can be tuned", name, TUNABLE)
        other = copy.copy(self)
        other.settings = replace(self.settings, **rules)
        other.weighing = self._weighing(other.settings)
        return other

    @cached_property
    def masks(self) -> kernels.Masks:
        """Section 5.2's, for attacks of at least 10 cm."""
        count = len(self.graph.begins) if self.settings.culling else 0
        root = self.library.clips.root_position[self.graph.begins[:count]]
        half = 0.5 * cells.PIXELS * cells.PIXEL
        origin = np.stack([root[:, 0] - half, np.zeros(count), root[:, 2] - half], axis=1)
        bits = np.zeros((count, cells.SLICES, cells.PIXELS), dtype=np.uint64)
        least = 0.10
        # A leg may be shown elsewhere than captured; what hangs from the root goes where it does.
        some = np.flatnonzero((self.volumes.between == 0).all(axis=1))
        cells.draw_masks(
            self.volumes.centre[:, :, some], self.volumes.radius[some], self.graph.begins[:count],
            self.graph.ends[:count], least, origin, bits,
        )  # fmt: skip
        return kernels.Masks(bits, origin, cells.PIXEL, cells.SLICE, least)

    @property
    def indexes(self) -> bool:
        """Whether paths are looked up rather than enumerated: as the rules say, or as pays."""
        asked = self.settings.index
        return self.library.table.actions >= WORTH_INDEXING if asked is None else asked

    @cached_property
    def index(self) -> cells.Index:
        """Section 5.1's grids of all states; of none where paths are enumerated."""
        return _build_index(self) if self.indexes else _no_index()

    @cached_property
    def entries(self) -> np.ndarray:
        """The frame of the next state of each frame's clip [F], at it or after it."""
        return entries(self.library)

    @cached_property
    def nearest(self) -> tuple[np.ndarray, np.ndarray]:
        """The frame of the state most like each frame [F], and how far off that is [F] rad."""
        stretch, far = nearest(self.library)
        return self.library.table.last[stretch], far

    @cached_property
    def strikes(self) -> np.ndarray:
        """Frames [F] in which a blow is driven home."""
        out, blows = np.zeros(len(self.library.clips), dtype=bool), self.library.strikes
        for start, lands in zip(blows.start.tolist(), blows.frame.tolist()):
            out[start : lands + 1] = True
        return out

    @property
    def index_bytes(self) -> int:
        return sum(array.nbytes for array in self.index)

    def search(
        self, standing: Standing, attacks: Sequence[Attack], now: float, *, main: int = 0
    ) -> Avoidance:
        """How to avoid an attack, ``attacks[main]``, and not to be hit by the others meanwhile.

        now: the scene's time [s] at which the character is where ``standing`` says.
        """
        place = planar_compose_one(standing.anchor, self.library.clips.facing[int(standing.phase)])[
            :2
        ]
        attack = attacks[main]
        if attack.when[-1] <= now:
            return Avoidance(Outcome.LATE)
        order = [main, *(m for m in range(len(attacks)) if m != main)]
        given, which = packed([attacks[m] for m in order], now, place)
        if which[:1] != [0]:
            return Avoidance(Outcome.WIDE)
        room, s = self._room(), self.settings
        present = _now(standing)
        gaps = np.empty(len(given.when))
        paths.foresee(0, present, self.graph, self.volumes, given, room.scratch, gaps)
        gaps, when = gaps[: given.sample[1]], given.when[: given.sample[1]]
        if gaps[0] < 0 and when[0] <= 0.0:
            return Avoidance(Outcome.LATE)
        if gaps.min() > s.wide:
            return Avoidance(Outcome.WIDE, distance=float(gaps.min()))
        by = np.flatnonzero(gaps <= max(gaps.min(), 0.0) + s.wide)
        aim = 0.5 * float(when[by[0]] + when[by[-1]])
        if aim > s.ahead:
            return Avoidance(Outcome.EARLY, aim=aim)
        state = self.state_at(present.stop)
        facing = planar_compose_one(standing.anchor, self.library.clips.facing[present.stop])
        reach = aim + 0.5 * s.window - (present.stop - present.phase) / self.graph.fps
        count, best, _, indexed = paths.find(
            state, facing, 0, aim, s.window, self.indexes and reach <= s.horizon, self._stamp(),
            present, self.graph, self.volumes, given, self.weighing, self.masks, self.index, room,
        )  # fmt: skip
        kept = min(count, MOST_PATHS)
        counts = tuple(np.bincount(room.outcome[:kept], minlength=kernels.OUTCOMES).tolist())
        if best < 0:
            outcome = Outcome.HIT if count else Outcome.NO_CANDIDATE
            return Avoidance(outcome, aim=aim, counts=counts)
        valid = np.flatnonzero(room.outcome[:kept] == kernels.VALID)
        leaves = room.scores[valid, 4] > 0.0
        ranked = valid[np.lexsort((valid, room.scores[valid, 0], ~leaves))][: 1 + MOST_OTHERS]
        found = [
            (tuple(room.path[c, : room.length[c]].tolist()), int(room.part[c]))
            for c in ranked.tolist()
        ]
        path, part = found[0]
        e, *costs, overlap, distance, before, scale = room.scores[best].tolist()
        plan = self.timed(standing, path, part, now + aim, now)
        return Avoidance(
            Outcome.FOUND, path, int(self.which[part]), aim, scale, e,
            (costs[0], costs[1], costs[2]), distance, before, overlap, indexed, counts,
            plan, tuple(found[1:]),
        )  # fmt: skip

    def timed(
        self, standing: Standing, path: Sequence[int], part: int, aim: float, now: float
    ) -> Plan:
        """The plan of playing a path so that the middle of its part falls on ``aim`` [s], as near
        as it can.
        """
        room = self._room()
        edges = np.array(path, dtype=np.int32)
        frames = paths.timing(
            edges, len(edges), part, aim - now, _now(standing), self.graph, self.weighing,
            room.scratch,
        )  # fmt: skip
        at, when = room.scratch.at[:frames].copy(), room.scratch.when[:frames].copy()
        return Plan(tuple(path), part, now, at, when)

    def state_at(self, frame: int) -> int:
        """The state that an edge ending at a library frame leads to, or NONE."""
        states = self.library.table.state_frame
        n = int(np.searchsorted(states, frame))
        return n if n < len(states) and states[n] == frame else NONE

    def _stamp(self) -> int:
        self._local.stamp = getattr(self._local, "stamp", 0) + 1
        return self._local.stamp

    def _room(self) -> _Room:
        if not hasattr(self._local, "room"):
            spheres, edges = len(self.spheres), kernels.DEPTH + 1
            groups = len(self.volumes.group) - 1
            frames = kernels.MOST_FRAMES
            shapes = [(3, spheres), (4, groups)] * 3
            shapes += [(2, 3, 3), (frames, 2, 3, 3), (2, PLACES, 3)]
            self._local.room = _Room(
                kernels.Scratch(
                    np.zeros((edges, 4)), np.zeros(edges), np.zeros(edges, dtype=bool),
                    np.zeros(frames), np.zeros(frames), np.zeros(frames),
                    np.zeros(0, dtype=np.int32),
                    *(np.zeros(shape) for shape in shapes),
                ),
                np.zeros(kernels.DEPTH, dtype=np.int64),
                np.zeros(kernels.DEPTH, dtype=np.int64),
                np.zeros(kernels.DEPTH),
                np.zeros((MOST_PATHS, kernels.DEPTH), dtype=np.int32),
                np.zeros(MOST_PATHS, dtype=np.int32),
                np.zeros(MOST_PATHS, dtype=np.int32),
                np.zeros(MOST_PATHS, dtype=np.int32),
                np.zeros((MOST_PATHS, 8)),
                np.zeros(4),
                np.zeros(cells.ACROSS * cells.ACROSS * cells.HIGH, dtype=np.int64),
                np.zeros(MOST_PATHS, dtype=bool),
                np.zeros(cells.ACROSS * cells.ACROSS * cells.HIGH, dtype=np.int64),
            )  # fmt: skip
        return self._local.room


def _now(standing: Standing) -> kernels.Now:
    return kernels.Now(
        np.asarray(standing.anchor, dtype=float),
        float(standing.phase),
        int(standing.stop),
        int(standing.stretch),
        float(standing.slowness),
        np.zeros((2, 3, 3)) if standing.left is None else np.asarray(standing.left, dtype=float),
    )


def fastest_end_effector(library: Layer) -> np.ndarray:
    """The largest speed [L] m/s of hands and feet in each stretch."""
    clips, table = library.clips, library.table
    position, _ = clips.world
    joints = [clips.skeleton.joint(role) for role in END_EFFECTORS]
    speed = np.linalg.norm(np.diff(position[:, joints], axis=0), axis=2).max(axis=1) * clips.fps
    # speed[f] is from frame f to f + 1: a stretch moves from first - 1 to last
    starts = np.stack([table.first - 1, table.last], axis=1).ravel()
    return np.maximum.reduceat(np.append(speed, 0.0), starts)[::2]


def _no_index() -> cells.Index:
    return cells.Index(
        np.zeros(1, dtype=np.int64),
        np.zeros((0, 2, 3)),
        np.zeros((0, 1), dtype=np.int32),
        np.zeros(0, dtype=np.int32),
        np.zeros(0, dtype=np.int32),
        np.zeros(0),
        np.zeros(1, dtype=np.int64),
        np.zeros(0, dtype=np.int32),
        np.zeros(1, dtype=np.int64),
        np.zeros(0, dtype=np.int32),
    )


def _build_index(search: AvoidanceSearch) -> cells.Index:
    graph, s, room = search.graph, search.settings, search._room()
    horizon = s.horizon * graph.fps
    size = np.zeros(len(room.seen), dtype=np.int64)
    seen = np.zeros_like(size)
    moves = np.zeros((len(graph.begins), len(search.spheres)), dtype=bool)
    centre = search.volumes.centre
    cells.spheres_that_leave(centre, graph.begins, graph.ends, s.left - 1e-4, moves)
    states = search.library.table.state_frame
    box = np.zeros((len(states), 2, 3))
    rows: list[tuple[np.ndarray, ...]] = []
    stamp = 1
    key, of = np.zeros(1 << 16, dtype=np.int32), np.zeros(1 << 16, dtype=np.int32)
    for state, frame in enumerate(states.tolist()):
        count = paths.enumerate_paths(
            state, 0.0, -1.0, horizon, 0, graph, room.node, room.way, room.gone, room.path,
            room.length, room.part,
        )  # fmt: skip
        if count > MOST_PATHS:
            raise KumiteError(
                f"avoidance: more than {MOST_PATHS} paths lead to an avoidance within "
                f"{s.horizon} s of a state; expected fewer (a shorter horizon, fewer transitions)"
            )
        now = kernels.Now(
            planar_inverse(search.library.clips.facing[frame]), float(frame), frame, NONE, 1.0,
            np.zeros((2, 3, 3)),
        )  # fmt: skip
        box[state] = [[np.inf] * 3, [-np.inf] * 3]
        while True:
            entries = cells.enter(
                count, room.path, room.length, room.part, now, graph, search.volumes, moves,
                room.scratch, stamp, seen, size, key, of, box[state],
            )  # fmt: skip
            stamp += count + 1
            if entries <= len(key):
                break
            size[:] = 0
            key, of = np.zeros(2 * entries, dtype=np.int32), np.zeros(2 * entries, dtype=np.int32)
        cell = np.zeros(min(entries, len(size)), dtype=np.int32)
        entry_of, entry = np.zeros(len(cell), dtype=np.int64), np.zeros(entries, dtype=np.int32)
        used = cells.gather(entries, key, of, size, cell, entry_of, entry)
        path, length = room.path[:count].copy(), room.length[:count].copy()
        middle = paths.middles(count, path, length, room.part, now, graph)
        rows.append(
            (path, length, room.part[:count].copy(), middle, cell[:used], entry_of[:used], entry)
        )
    per = [np.array([0, *np.cumsum([len(r[k]) for r in rows])]) for k in (1, 4, 6)]
    starts = np.concatenate([r[5] + begin for r, begin in zip(rows, per[2])])
    edges = int(max((r[1].max() for r in rows if len(r[1])), default=1))
    return cells.Index(
        per[0],
        box,
        np.concatenate([r[0][:, :edges] for r in rows]),
        np.concatenate([r[1] for r in rows]),
        np.concatenate([r[2] for r in rows]),
        np.concatenate([r[3] for r in rows]),
        per[1],
        np.concatenate([r[4] for r in rows]),
        np.append(starts, per[2][-1]),
        np.concatenate([r[6] for r in rows]),
    )
