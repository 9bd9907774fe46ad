"""Where one captured motion may go on as another (Lee & Lee 2004, section 6, graph construction).

A transition i → j: frame i resembles frame j − 1, and the same contact event happens at both. It
is the local minimum of its neighbourhood, and among the best of the wanted number.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from kumite.annotate import AvoidanceParts, Contacts
from kumite.brief import brief
from kumite.checked import checked
from kumite.clip import ClipSet
from kumite.errors import KumiteError, unknown
from kumite.graph.distance import PoseFeatures, pose_features, squared_distances
from kumite.kernels import distance as kernels

EVENTS = {"left": (0,), "right": (1,), "both": (0, 1), "none": ()}
"""Whose lift-off a join waits for; ``none`` joins anywhere."""
PER_SECOND = 52.0  # wanted transitions per second of capture: the paper's 27,072 of 8 minutes
LARGEST_SHARE = 0.2  # of the pairs at an event: the paper's share is 0.14
FEWEST = 3  # ways in and out that a rare pose keeps at an event …
STRETCH_LIMIT = 1.7  # … if they cost no more than this times the threshold
LEAST_LIMIT, MOST_LIMIT = 1e-3, 1e3  # rad²; what a second guess begins with, and where it ends
_MANY = 4000  # frames from which on only the best local minima are kept, by a guess of a limit
_ROOM = 4096  # first guess of local minima a task


@brief
@dataclass(frozen=True)
class Transitions:
    """X transitions: frame ``source`` may be followed by frame ``target``."""

    source: np.ndarray  # [X] int32, i
    target: np.ndarray  # [X] int32, j
    cost: np.ndarray  # [X] float32, root of D(i, j - 1): about radians
    threshold: float  # the largest cost accepted of any pose, rare ones apart
    candidates: int  # pairs that meet the contact condition (without one, local minima looked at)

    def __len__(self) -> int:
        return len(self.source)


@checked
def find_transitions(
    clips: ClipSet,
    contacts: Contacts,
    *,
    event: str = "left",
    per_second: float = PER_SECOND,
    largest_share: float = LARGEST_SHARE,
    features: PoseFeatures | None = None,
    whole: AvoidanceParts | None = None,
    without: np.ndarray | None = None,
) -> Transitions:
    """The best transitions, about ``per_second`` for each second of capture.

    whole: parts of the clips that no transition enters behind their first frame, or leaves before
    their last. without [F] bool: frames that none leaves or enters. Errors: an
    unknown event; no such event in the clips.
    """
    if event not in EVENTS:
        raise unknown("event", event, EVENTS)
    if not 0 < per_second < np.inf:
        raise KumiteError(f"per_second {per_second}; expected more than 0 transitions a second")
    features = features or pose_features(clips)
    frames, group = _candidate_frames(clips, contacts, event)
    if whole is not None:
        # Who leaves from frame i leaves out i + 1; who joins at i plays i + 1 first: of a part both
        # must not be, unless it is its first frame.
        free = ~whole.inner[frames + 1]
        frames, group = frames[free], group[free]
    if without is not None:
        free = ~(without[frames] | without[frames + 1])
        frames, group = frames[free], group[free]
    if len(frames) < 2:
        raise KumiteError(
            f"too few frames for a graph: {len(clips)} frames in {len(clips.names)} clip(s) hold "
            f"{len(frames)} {event}-foot lift-off(s); expected at least 2"
        )
    joined = np.zeros(len(frames), dtype=bool)
    joined[1:] = (np.diff(frames) == 1) & (np.diff(clips.clip_of_frame[frames]) == 0)
    wanted = max(1, round(min(per_second * clips.seconds, float(len(clips)) ** 2)))
    at_event = features.take(frames)
    if event != "none":
        # One foot lifts off at no two frames in a row: nothing competes, and all pairs count. They
        # are counted here, for where there are many not all of them are kept.
        candidates = int(sum(n * (n - 1) for n in np.unique(group, return_counts=True)[1].tolist()))
        wanted = min(wanted, max(1, round(largest_share * candidates)))
    a, b, d = _local_minima(at_event, joined, group, wanted)
    if event == "none":
        candidates = len(d)
    order = np.argsort(d, kind="stable")
    order = order[:wanted]
    if len(order) == 0:
        raise KumiteError("too few frames for a graph: no two poses are alike")
    a, b, d = a[order], b[order], d[order]
    worst = d[-1]
    if event != "none":
        # A rare pose (a deep duck, a far punch) is unlike most others and would be lost: its few
        # best ways in and out are kept, within reason.
        ways = np.bincount(a, minlength=len(frames)), np.bincount(b, minlength=len(frames))
        rare = np.flatnonzero(np.minimum(*ways) < FEWEST)
        more = _few_best(at_event, group, rare, np.float32(STRETCH_LIMIT**2) * worst)
        a, b, d = (np.concatenate(both) for both in zip((a, b, d), more))
    # A pair that is found twice has the same distance, bit by bit.
    _, keep = np.unique(a.astype(np.int64) * len(frames) + b, return_index=True)
    a, b, d = a[keep], b[keep], d[keep]
    return Transitions(
        frames[a].astype(np.int32),
        (frames[b] + 1).astype(np.int32),
        np.sqrt(d).astype(np.float32),
        float(np.sqrt(worst)),
        candidates,
    )


def _few_best(
    features: PoseFeatures, group: np.ndarray, rare: np.ndarray, limit: np.float32
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The ``FEWEST`` best pairs (a, b, D) below a limit out of and into each of the rare poses."""
    source, target, cost = [], [], []
    for first in range(0, len(rare), kernels.ROWS):
        rows = rare[first : first + kernels.ROWS]
        d = squared_distances(features, rows, np.arange(len(group)))
        d[group[rows][:, None] != group[None]] = np.inf
        d[np.arange(len(rows)), rows] = np.inf
        best = np.argsort(d, axis=1, kind="stable")[:, :FEWEST]
        near = np.take_along_axis(d, best, axis=1)
        row, k = np.nonzero(near < limit)
        one, other, apart = rows[row], best[row, k], near[row, k]
        # D is symmetric: who is best left for is best come from.
        source += [one, other]
        target += [other, one]
        cost += [apart, apart]
    if not source:
        nothing = np.zeros(0, dtype=np.int64)
        return nothing, nothing, np.zeros(0, dtype=np.float32)
    return np.concatenate(source), np.concatenate(target), np.concatenate(cost)


def _candidate_frames(
    clips: ClipSet, contacts: Contacts, event: str
) -> tuple[np.ndarray, np.ndarray]:
    """Frames that may be joined [P] and the event at each [P]; never a clip's last frame."""
    if event == "none":
        last = np.zeros(len(clips), dtype=bool)
        last[clips.clip_start[1:] - 1] = True
        frames = np.flatnonzero(~last)
        return frames, np.zeros(len(frames), dtype=np.int32)
    lift_off = contacts.lift_off(clips.clip_start)
    group = np.full(len(clips), -1, dtype=np.int32)
    for foot in EVENTS[event]:
        group[lift_off[:, foot]] = foot
    frames = np.flatnonzero(group >= 0)
    return frames, group[frames]


def _local_minima(
    features: PoseFeatures, joined: np.ndarray, group: np.ndarray, wanted: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All local minima (a, b, D), or at least the ``wanted`` best of them where they are many."""
    count = features.quaternion.shape[2]
    tasks = (count + kernels.ROWS - 1) // kernels.ROWS
    limit = np.float32(np.inf)
    if count > _MANY:
        limit = _limit_from_sample(features, wanted)
    room = _ROOM
    while True:
        found_a = np.empty((tasks, room), dtype=np.int32)
        found_b = np.empty((tasks, room), dtype=np.int32)
        found_d = np.empty((tasks, room), dtype=np.float32)
        counts = np.zeros(tasks, dtype=np.int64)
        kernels.local_minima(
            features.quaternion,
            features.weight,
            features.euclidean,
            joined,
            group,
            limit,
            found_a,
            found_b,
            found_d,
            counts,
        )
        if counts.max() <= room:
            if np.isinf(limit) or counts.sum() >= wanted:
                used = np.arange(room)[None, :] < counts[:, None]
                return found_a[used], found_b[used], found_d[used]
            # The sample was too hopeful; where captures repeat or stand still it may even say 0.
            higher = max(16.0 * float(limit), LEAST_LIMIT)
            limit = np.float32(higher if higher < MOST_LIMIT else np.inf)
        else:
            room = int(counts.max())


def _limit_from_sample(features: PoseFeatures, wanted: int) -> np.float32:
    """A distance below which about twice the wanted number of local minima lies.

    Measured on a few runs of rows spread over the poses, so that memory stays small; clip borders
    and groups are left out of account.
    """
    count = features.quaternion.shape[2]
    runs = np.linspace(0, count - 17, 24).astype(int)
    rows = np.unique((runs[:, None] + np.arange(16)).ravel())
    line = np.empty((16 + kernels.LANES, count), dtype=np.float32)
    values = []
    for start in runs:
        kernels.distance_rows(
            features.quaternion, features.weight, features.euclidean, start, start + 16, line
        )
        inner = line[1:15, 1:-1]
        low = np.ones_like(inner, dtype=bool)
        for dr in (-1, 0, 1):
            for dc in (-1, 0, 1):
                if dr or dc:
                    low &= inner <= line[1 + dr : 15 + dr, 1 + dc : count - 1 + dc]
        values.append(inner[low])
    sample = np.concatenate(values)
    expected = len(sample) * count / len(rows)
    share = min(1.0, 2.0 * wanted / max(expected, 1.0))
    return np.float32(np.quantile(sample, share)) if share < 1 else np.float32(np.inf)


@checked
def strongest_component(clips: ClipSet, transitions: Transitions) -> np.ndarray:
    """The frames [F] bool of the largest strongly connected component: no dead ends."""
    follows = np.ones(len(clips), dtype=bool)
    follows[clips.clip_start[1:] - 1] = False
    step = np.flatnonzero(follows)
    source = np.concatenate([step, transitions.source])
    target = np.concatenate([step + 1, transitions.target])
    graph = coo_array((np.ones(len(source), np.int8), (source, target)), shape=(len(clips),) * 2)
    _, label = connected_components(graph.tocsr(), directed=True, connection="strong")
    return label == np.argmax(np.bincount(label))
