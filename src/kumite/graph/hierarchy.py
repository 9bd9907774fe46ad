"""The hierarchical motion graph (Shum et al. 2013, section 4.1).

*Core* nodes are cycles of locomotion, which repeat themselves; *target* motions leave from one and
return to one. What leads from a core to another, into a target and out of it, is found here: where
in the cycle it is best to leave, where to come back, and how far the poses are apart there (rad, as
transitions are told: :mod:`kumite.graph.distance`). From standing to running no two poses are
alike: between two cores a stretch of capture may lie, such as the first step of a walk.

:func:`hierarchy_table` makes it an action table, so that whatever plays one plays this.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kumite.annotate.cycles import Cycles
from kumite.brief import brief
from kumite.checked import checked
from kumite.checks import freeze, names, number
from kumite.clip import ClipSet
from kumite.errors import KumiteError
from kumite.graph.distance import PoseFeatures, pose_features
from kumite.graph.table import ActionTable
from kumite.kernels import hierarchy as kernels
from kumite.performer.truth import Truth
from kumite.rotation import planar_compose, planar_inverse

LONGEST_LINK = 1.6  # s of capture between two cores
LINK_PRICE = 0.1  # rad/s: of two links that fit alike the shorter one
ENTRY, RETURN = 0.25, 0.4  # s by which a target's start and stop may be moved to fit a core
ALIKE = 1.8  # rad: farther apart, and a target does not leave from a core or return to it


@brief
@dataclass(frozen=True)
class Targets:
    """T target motions: frames start … stop of the set, the movement itself from ``mark`` on."""

    label: tuple[str, ...]
    start: np.ndarray  # [T] int64
    stop: np.ndarray  # [T] int64, its last frame
    mark: np.ndarray  # [T] int64

    def __post_init__(self) -> None:
        object.__setattr__(self, "label", names(self.label, "targets: labels", unlike=False))
        count = len(self.label)
        for name in ("start", "stop", "mark"):
            freeze(self, "targets", **{name: (np.int64, (count,))})
        fits = (self.start <= self.mark) & (self.mark <= self.stop) & (self.start < self.stop)
        if not np.all(fits):
            t = int(np.argmin(fits))
            raise KumiteError(
                f"target {self.label[t]!r}: mark {self.mark[t]}; expected one from its start "
                f"{self.start[t]} to its stop {self.stop[t]}"
            )

    def __len__(self) -> int:
        return len(self.label)

    def take(self, index: Sequence[int] | np.ndarray) -> Targets:
        """Some of them, by their numbers."""
        i = np.asarray(index, dtype=np.int64)
        label = tuple(self.label[t] for t in i.tolist())
        return Targets(label, self.start[i], self.stop[i], self.mark[i])


@checked
def authored_targets(clips: ClipSet, truths: Sequence[Truth], fps: float) -> Targets:
    """The target motions of the performer, each label once: of every one the first.

    truths: of the clips of the set, in order, their frames at ``fps``. Errors: none is marked.
    """
    rows: dict[str, tuple[int, int, int]] = {}
    scale = clips.fps / fps
    for truth, first in zip(truths, clips.clip_start.tolist()):
        for a in truth.actions:
            if a.mark is not None and a.label not in rows:
                rows[a.label] = tuple(first + round(f * scale) for f in (a.start, a.stop, a.mark))  # type: ignore[assignment]
    if not rows:
        raise KumiteError("no target motion: none of these clips marks the frame where one begins")
    return Targets(tuple(rows), *(np.array(column) for column in zip(*rows.values())))


@checked
@brief
@dataclass(frozen=True)
class Hierarchy:
    """M cores, T targets, and how they hang together. Frames are of the set of clips."""

    cores: Cycles  # M
    targets: Targets  # T
    # From core m into target t: leave the core at a frame of its cycle, go on as from ``entry``.
    leave: np.ndarray  # [M, T] int64
    entry: np.ndarray  # [M, T] int64
    entry_distance: np.ndarray  # [M, T] rad
    # From target t back into core m: at frame ``exit``, go on in the cycle as from ``land``.
    exit: np.ndarray  # [M, T] int64
    land: np.ndarray  # [M, T] int64
    exit_distance: np.ndarray  # [M, T] rad
    # From core m to core n: leave m at a frame, play the capture from there on (link_first …
    # link_last: one frame if the poses meet), go on in n.
    link_leave: np.ndarray  # [M, M] int64
    link_first: np.ndarray  # [M, M] int64
    link_last: np.ndarray  # [M, M] int64
    link_land: np.ndarray  # [M, M] int64
    link_distance: np.ndarray  # [M, M] rad, the worse of its two ends
    alike: float  # rad, the most that a join may bridge

    def __post_init__(self) -> None:
        m, t = len(self.cores), len(self.targets)
        if m == 0:
            raise KumiteError("hierarchy: no core motions; expected at least one cycle")
        object.__setattr__(self, "alike", number(self.alike, "hierarchy: alike", least=0.0))
        for name in ("leave", "entry", "exit", "land"):
            freeze(self, "hierarchy", **{name: (np.int64, (m, t))})
        for name in ("entry_distance", "exit_distance"):
            freeze(self, "hierarchy", **{name: (float, (m, t))})
        for name in ("leave", "first", "last", "land"):
            freeze(self, "hierarchy", **{f"link_{name}": (np.int64, (m, m))})
        freeze(self, "hierarchy", link_distance=(float, (m, m)))

    @property
    def enters(self) -> np.ndarray:
        """Which targets [M, T] may be entered from a core: alike enough, or the best there is."""
        best = np.argmin(self.entry_distance, axis=0)[None] == np.arange(len(self.cores))[:, None]
        return (self.entry_distance <= self.alike) | best

    @property
    def returns(self) -> np.ndarray:
        """Which cores [M, T] a target may return to: alike enough, or the best there is."""
        best = np.argmin(self.exit_distance, axis=0)[None] == np.arange(len(self.cores))[:, None]
        return (self.exit_distance <= self.alike) | best

    @property
    def links(self) -> np.ndarray:
        """Which cores [M, M] may follow a core: itself; by a link that is alike enough; the best
        link there is, either way."""
        far = np.where(np.eye(len(self.cores), dtype=bool), np.inf, self.link_distance)
        index = np.arange(len(self.cores))
        out = (far <= self.alike) | np.eye(len(self.cores), dtype=bool)
        out[index, np.argmin(far, axis=1)] = True
        out[np.argmin(far, axis=0), index] = True
        return out


@checked
def build_hierarchy(
    clips: ClipSet,
    cores: Cycles,
    targets: Targets,
    *,
    alike: float = ALIKE,
    features: PoseFeatures | None = None,
    latest: np.ndarray | None = None,
    earliest: np.ndarray | None = None,
) -> Hierarchy:
    """How cores and targets hang together.

    A join goes to where poses are least apart, over all frames of a core's cycle and over the
    frames within ``ENTRY`` of a target's start (up to its mark, or frame ``latest`` [T] from start
    to mark) and within ``RETURN`` of its stop (after its mark, or from frame ``earliest`` [T] up to
    stop on). Errors: frames of a target that are no part of one clip; no cores.
    """
    if len(cores) == 0:
        raise KumiteError("hierarchy: no core motions; expected at least one cycle")
    check_targets(clips, targets)
    clip = clips.clip_of_frame
    latest = targets.mark if latest is None else latest
    earliest = targets.mark + 1 if earliest is None else np.minimum(earliest, targets.stop)
    features = features or pose_features(clips)
    m, count = len(cores), len(targets)
    leave, entry, exit_, land = (np.zeros((m, count), dtype=np.int64) for _ in range(4))
    entry_distance, exit_distance = np.zeros((m, count)), np.zeros((m, count))
    frames = [np.arange(a + 1, b + 1) for a, b in zip(cores.start, cores.stop)]
    for t in range(count):
        first, last = (int(f) for f in clips.clip_start[clip[targets.start[t]] :][:2])
        start, stop = int(targets.start[t]), int(targets.stop[t])
        slack = round(ENTRY * clips.fps)
        starts = np.arange(max(start - slack, first), min(start + slack, latest[t]) + 1)
        slack = round(RETURN * clips.fps)
        stops = np.arange(max(stop - slack, earliest[t]), min(stop + slack, last - 1) + 1)
        for c in range(m):
            i, j, entry_distance[c, t] = _nearest(features, frames[c], starts)
            leave[c, t], entry[c, t] = frames[c][i], starts[j]
            i, j, exit_distance[c, t] = _nearest(features, stops, frames[c])
            exit_[c, t], land[c, t] = stops[i], frames[c][j]
    links = _links(clips, features, frames)
    return Hierarchy(
        cores,
        targets,
        leave,
        entry,
        entry_distance,
        exit_,
        land,
        exit_distance,
        links[0],
        links[1],
        links[2],
        links[3],
        links[4],
        alike,
    )


def check_targets(clips: ClipSet, targets: Targets) -> None:
    """Errors: frames of a target that are no part of one clip."""
    clip = clips.clip_of_frame
    for t, label in enumerate(targets.label):
        a, b = int(targets.start[t]), int(targets.stop[t])
        if not (a >= 0 and b < len(clips) and clip[a] == clip[b]):
            raise KumiteError(f"target {label!r}: frames {a} to {b} are no part of one clip")


def pose_distances(features: PoseFeatures, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Distances [len(a), len(b)] rad between the poses of frames: the root of D."""
    out = np.zeros((len(a), len(b)))
    for q, weight in zip(features.quaternion.astype(np.float64), features.weight.tolist()):
        cosine = np.clip(np.abs(q[:, a].T @ q[:, b]), 0.0, 1.0)
        out += weight * (2.0 * np.arccos(cosine)) ** 2
    x, y = (features.euclidean[:, f].astype(np.float64) for f in (a, b))
    out += np.maximum((x**2).sum(axis=0)[:, None] + (y**2).sum(axis=0) - 2.0 * x.T @ y, 0.0)
    return np.sqrt(out)


def _nearest(features: PoseFeatures, a: np.ndarray, b: np.ndarray) -> tuple[int, int, float]:
    """Which of a and of b are least apart, and by how much."""
    apart = pose_distances(features, a, b)
    i, j = np.unravel_index(int(np.argmin(apart)), apart.shape)
    return int(i), int(j), float(apart[i, j])


def _links(
    clips: ClipSet, features: PoseFeatures, frames: list[np.ndarray]
) -> tuple[np.ndarray, ...]:
    """Leave, first, last, land [M, M] and the distance of the best way from each core to each."""
    m, count, longest = len(frames), len(clips), round(LONGEST_LINK * clips.fps)
    near, which = np.empty((m, count)), np.empty((m, count), dtype=np.int64)
    quaternion = np.ascontiguousarray(np.moveaxis(features.quaternion, 2, 0), dtype=np.float64)
    euclidean = np.ascontiguousarray(features.euclidean.T, dtype=np.float64)
    for c in range(m):
        kernels.nearest_poses(
            quaternion, features.weight.astype(float), euclidean, frames[c], near[c], which[c]
        )
    near = np.sqrt(near)
    out = tuple(np.zeros((m, m), dtype=np.int64) for _ in range(4))
    distance = np.zeros((m, m))
    for c in range(m):
        for n in range(m):
            if c == n:
                ends = frames[c][-1]
                out[0][c, n], out[3][c, n] = ends, frames[c][0] - 1
                out[1][c, n] = out[2][c, n] = ends
                distance[c, n] = pose_distances(features, frames[c][-1:], frames[c][:1] - 1)[0, 0]
                continue
            first, last = kernels.best_link(
                near[c], near[n], clips.clip_of_frame, longest, LINK_PRICE / clips.fps
            )
            out[0][c, n], out[1][c, n] = which[c, first], first
            out[2][c, n], out[3][c, n] = last, which[n, last]
            distance[c, n] = max(near[c, first], near[n, last])
    return (*out, distance)


@checked
def hierarchy_table(clips: ClipSet, hierarchy: Hierarchy) -> tuple[ActionTable, np.ndarray]:
    """The hierarchy as an action table, and what each stretch is [L] int32: the core m it is of,
    M + t for target t, -1 for a link between cores.

    Cycles are cut where something leaves them; every piece ends in a state.
    """
    cores, targets = hierarchy.cores, hierarchy.targets
    m, count = len(cores), len(targets)
    enters, returns, links = hierarchy.enters, hierarchy.returns, hierarchy.links
    leaves: list[set[int]] = [{int(stop)} for stop in cores.stop]
    for c in range(m):
        leaves[c] |= {int(hierarchy.leave[c, t]) for t in range(count) if enters[c, t]}
        leaves[c] |= {int(hierarchy.link_leave[c, n]) for n in range(m) if links[c, n]}
    stretches: dict[tuple[int, int], int] = {}  # (first, last) -> what it is
    ways: dict[int, set[tuple[int, int]]] = {}  # frame of a state -> stretches that it offers

    def into(core: int, phase: int) -> tuple[int, int]:
        """The piece of a cycle that goes on after a frame of it."""
        if phase >= cores.stop[core]:
            phase = int(cores.start[core])
        piece = (phase + 1, min(f for f in leaves[core] if f > phase))
        stretches[piece] = core
        return piece

    for c in range(m):
        for frame in sorted(leaves[c]):
            ways.setdefault(frame, set()).add(into(c, frame))
    for c in range(m):
        for n in range(m):
            if c == n or not links[c, n]:
                continue
            first, last = int(hierarchy.link_first[c, n]), int(hierarchy.link_last[c, n])
            leave, onward = int(hierarchy.link_leave[c, n]), into(n, int(hierarchy.link_land[c, n]))
            if first == last:
                ways[leave].add(onward)
            else:
                stretches.setdefault((first + 1, last), -1)
                ways[leave].add((first + 1, last))
                ways.setdefault(last, set()).add(onward)
    for t in range(count):
        ends = {int(hierarchy.exit[c, t]) for c in range(m) if returns[c, t]}
        for c in range(m):
            if enters[c, t]:
                for last in ends:
                    piece = (int(hierarchy.entry[c, t]) + 1, last)
                    stretches[piece] = m + t
                    ways[int(hierarchy.leave[c, t])].add(piece)
            if returns[c, t]:
                onward = into(c, int(hierarchy.land[c, t]))
                ways.setdefault(int(hierarchy.exit[c, t]), set()).add(onward)
    return _as_table(clips, stretches, ways)


def _as_table(
    clips: ClipSet, stretches: dict[tuple[int, int], int], ways: dict[int, set[tuple[int, int]]]
) -> tuple[ActionTable, np.ndarray]:
    pieces, states = sorted(stretches), sorted(ways)
    number = {piece: i for i, piece in enumerate(pieces)}
    state_of = {frame: s for s, frame in enumerate(states)}
    offered = [sorted(number[p] for p in ways[frame]) for frame in states]
    source = np.array([f for f, offers in zip(states, offered) for _ in offers])
    stretch = np.array([i for offers in offered for i in offers])
    first, last = np.array(pieces).T
    features = pose_features(clips)
    cost = [
        0.0 if a == b else pose_distances(features, np.array([a]), np.array([b]))[0, 0]
        for a, b in zip(source.tolist(), (first[stretch] - 1).tolist())
    ]
    table = ActionTable(
        np.array(states),
        np.concatenate([[0], np.cumsum([len(offers) for offers in offered])]),
        stretch,
        np.array(cost),
        first,
        last,
        np.array([state_of[f] for f in last.tolist()]),
        planar_compose(planar_inverse(clips.facing[first - 1]), clips.facing[last]),
    )
    return table, np.array([stretches[p] for p in pieces], dtype=np.int32)


def ways_into_cores(table: ActionTable, what: np.ndarray, cores: int) -> np.ndarray:
    """The stretch [S, M] that leads from each state soonest into each core, by way of no target.

    what [L]: as :func:`hierarchy_table` tells; -1 where there is no way.
    """
    states = table.states
    source = np.repeat(np.arange(states), np.diff(table.action_start))
    open_ = what[table.stretch] < cores
    source, stretch = source[open_], table.stretch[open_]
    frames = (table.last - table.first + 1)[stretch].astype(float)
    out = np.full((states, cores), -1, dtype=np.int64)
    for m in range(cores):
        there = what[stretch] == m
        left = np.full(states, np.inf)  # frames until the core is entered
        while True:
            cost = np.where(there, 0.0, frames + left[table.target[stretch]])
            best = np.full(states, np.inf)
            np.minimum.at(best, source, cost)
            if np.array_equal(best, left):
                break
            left = best
        for a in np.flatnonzero(np.isfinite(cost) & (cost == left[source]))[::-1].tolist():
            out[source[a], m] = stretch[a]
    return out
