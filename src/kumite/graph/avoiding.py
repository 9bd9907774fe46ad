"""Transitions from which an avoidance is soon reached, wherever a character is.

Oshita & Masaoka (2011, section 6) find that in a standard motion graph few avoidances can be
reached in time, and leave a better one to others. Here every way out of the capture is a chance to
avoid: at short intervals, a few of the avoidance motions that differ most are offered, each entered
where its beginning fits best. Apart from these, captures go on as they are, with now and then a
way into another, so that paths that only rest or walk do not multiply.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kumite.annotate import AvoidanceParts, Contacts, Strikes
from kumite.checked import checked
from kumite.checks import instance
from kumite.clip import ClipSet
from kumite.errors import KumiteError
from kumite.graph.distance import PoseFeatures, pose_features, squared_distances
from kumite.graph.joins import JoinBound
from kumite.graph.layer import Layer, chosen_parts, folded, noted, with_parts
from kumite.graph.transitions import Transitions
from kumite.rotation import planar_apply, planar_compose, planar_inverse

EVERY = 0.20  # s between the frames from which an avoidance may be begun
LEAD = 0.40  # s before a part in which it is entered
CHANGE_EVERY = 1.2  # s between the frames from which another capture may be gone on with
OFFERED = 16  # avoidances at such a frame, at most: as many as the paper's library has
SOONER = 0.1  # s that a second, later way into the same avoidance must gain
ELSEWHERE = 2  # other ways at a frame of change
WORST = 1.0  # rad: poses farther apart are not joined …
FEWEST = 2  # … but every frame keeps its best so many ways into an avoidance
UNLIKE = 0.10  # m, root mean square: avoidances nearer to each other than that are alike
RECOVERY = 0.10  # s after an avoidance in which blows are offered, too
WIND_UP = (0.12, 0.36)  # s before a blow's drive in which it is entered …
COMMITTED = 0.36  # … and from which on it is gone through with
BLOWS = 6  # offered at such a frame, at most
SAME_PLACE = 0.10  # m: blows that land nearer to each other than that are alike
ROLES = ("head", "chest", "pelvis", "left_hand", "right_hand", "left_foot", "right_foot")


def build_avoidance(
    clips: ClipSet,
    avoidance: AvoidanceParts | bool = True,
    *,
    every: float = EVERY,
    offered: int = OFFERED,
    worst: float = WORST,
    blows: bool = False,
    bound: JoinBound | None = None,
    contacts: Contacts | None = None,
    strikes: Strikes | None = None,
    without: np.ndarray | None = None,
    progress: Callable[[str], None] = lambda stage: None,
) -> Layer:
    """The layer ``avoidance``, made of :func:`find_avoiding_transitions`.

    contacts, strikes: of these clips, if they are known. without [F] bool: frames that are not
    to be in it. avoidance: its parts; True: as they are found. blows: whether some are offered
    after each. bound: the farthest that a join may jump; None: the usual (:class:`JoinBound`).
    Errors: there are no parts.
    """
    instance(clips, ClipSet, "build_avoidance")
    contacts, strikes = noted(clips, contacts, strikes, progress)
    parts = chosen_parts(clips, contacts, avoidance, progress)
    progress("comparing poses")
    transitions = find_avoiding_transitions(
        clips,
        parts,
        every=every,
        offered=offered,
        worst=worst,
        strikes=strikes if blows else None,
        without=without,
    )
    progress("folding the graph")
    told = {"level": "avoidance", "every": every, "offered": offered, "worst": worst}
    told |= {"blows": True} if blows else {}
    library = folded(clips, contacts, strikes, transitions, parts, told, bound)
    return with_parts(library, avoidance)


@checked
def find_avoiding_transitions(
    clips: ClipSet,
    parts: AvoidanceParts,
    *,
    every: float = EVERY,
    offered: int = OFFERED,
    worst: float = WORST,
    features: PoseFeatures | None = None,
    strikes: Strikes | None = None,
    without: np.ndarray | None = None,
) -> Transitions:
    """Transitions into avoidances from everywhere, and between captures now and then.

    every [s], offered: how often and how many; worst [rad]: see above. No transition leaves or
    enters within a part, or a frame of ``without`` [F] bool. strikes: blows to strike back with,
    which are offered just after each part. Errors: no parts, numbers out of range.
    """
    if len(parts) == 0:
        raise KumiteError("no avoidance parts; expected clips in which somebody avoids something")
    if not 0.02 <= every <= 10 or offered < 1 or not 0 < worst < np.inf:
        raise KumiteError(
            f"every {every} s, {offered} offered, worst {worst} rad; expected 0.02 to 10 s, at "
            "least 1 and more than 0"
        )
    features = features or pose_features(clips)
    fps, clip = clips.fps, clips.clip_of_frame
    inside = _inside(parts)
    step, change = max(1, round(every * fps)), round(CHANGE_EVERY * fps)
    since = np.arange(len(clips)) - clips.clip_start[clip]
    ends = np.zeros(len(clips), dtype=bool)
    ends[clips.clip_start[1:] - 1] = True
    # Whoever has begun to avoid goes through with it: else paths that begin again and again, and
    # never do, would be most of all.
    entry, part_of_entry = _entries(clips, parts, inside, round(LEAD * fps))
    if len(entry) == 0:
        raise KumiteError(
            f"each of {len(parts)} avoidance part(s) begins with its clip: no frame leads into "
            "one; expected clips that begin before someone avoids something"
        )
    if without is not None:
        usable = ~without[entry]
        entry, part_of_entry = entry[usable], part_of_entry[usable]
    begun = inside.copy()
    begun[entry[entry < parts.start[part_of_entry]]] = True
    may_leave = ~begun & (since > 0)
    if without is not None:
        may_leave &= ~without
    if strikes is not None:  # and whoever has begun to strike
        for start, stop in zip(strikes.start.tolist(), strikes.stop.tolist()):
            first = clips.clip_start[clip[start]]
            may_leave[max(start - round(COMMITTED * fps), first) : stop] = False
    leaving = np.flatnonzero(may_leave & ((since % step == 0) | ends | _lasts(parts, len(clips))))
    if len(leaving) == 0:
        raise KumiteError(
            f"too few frames for a graph: of {len(clips)} in {len(clips.names)} clip(s) none is "
            "outside of the avoidance parts"
        )
    # Where the capture goes on into an avoidance there must be another way, too.
    into = np.zeros(len(clips), dtype=bool)
    before = np.searchsorted(leaving, parts.start) - 1
    same = (before >= 0) & (clip[leaving[before]] == clip[parts.start])
    into[leaving[before[same]]] = True
    changing = np.flatnonzero(may_leave & ((since % change == 0) | ends | into))
    # From i the capture goes on with j where i is like j - 1; a part's own frames go on anyway.
    d = _between(features, leaving, entry - 1)
    own = (entry[None] > leaving[:, None]) & (entry[None] - leaving[:, None] <= step)
    d[own & (clip[leaving][:, None] == clip[entry][None])] = np.inf
    order = np.argsort(part_of_entry, kind="stable")
    first = np.searchsorted(part_of_entry[order], np.arange(len(parts) + 1))
    best = np.full((len(leaving), len(parts)), np.inf, dtype=np.float32)  # [S, P]
    # Nothing enters a part that begins with its clip: there is no frame before it.
    open_ = np.flatnonzero(np.diff(first))
    best[:, open_] = np.minimum.reduceat(d[:, order], first[open_], axis=1)
    unlike = _signatures(clips, parts)
    source, target, cost = [], [], []
    sooner = round(SOONER * fps)
    for row, i in enumerate(leaving):
        for p in _choose(best[row], unlike, offered, worst):
            mine = order[first[p] : first[p + 1]]
            fits = mine[np.argmin(d[row, mine])]
            late = mine[(d[row, mine] <= worst) & (entry[mine] >= entry[fits] + sooner)]
            # Where it fits best, and where it is over soonest.
            for e in {int(fits), int(late[np.argmax(entry[late])]) if len(late) else int(fits)}:
                source.append(int(i))
                target.append(int(entry[e]))
                cost.append(float(d[row, e]))
    # Other captures: frames to go on from that lie in no part, a second apart from each other.
    onward = np.flatnonzero(may_leave & ~ends & (since % step == 0))
    d = _between(features, changing, onward)
    near = np.abs(changing[:, None] - onward[None]) < fps
    d[near & (clip[changing][:, None] == clip[onward][None])] = np.inf
    for row, i in enumerate(changing):
        left = ELSEWHERE
        for j in np.argsort(d[row], kind="stable").tolist():
            enough = left < ELSEWHERE and d[row, j] > worst
            if left == 0 or not np.isfinite(d[row, j]) or enough:
                break
            taken = [t for s, t in zip(source[-ELSEWHERE:], target[-ELSEWHERE:]) if s == i]
            if any(abs(t - onward[j]) < fps and clip[t] == clip[onward[j]] for t in taken):
                continue
            source.append(int(i))
            target.append(int(onward[j]) + 1)
            cost.append(float(d[row, j]))
            left -= 1
    if strikes is not None and len(strikes):
        recovers = leaving[_just_after(parts, leaving, clip, round(RECOVERY * fps))]
        for i, j, c in _strike_back(clips, strikes, features, recovers, begun, worst):
            source.append(i), target.append(j), cost.append(c)
    pairs, keep = np.unique(np.stack([source, target], axis=1), axis=0, return_index=True)
    costs = np.array(cost, dtype=np.float32)[keep]
    return Transitions(
        pairs[:, 0].astype(np.int32),
        pairs[:, 1].astype(np.int32),
        costs,
        float(worst),
        len(leaving) * len(entry),
    )


def _inside(parts: AvoidanceParts) -> np.ndarray:
    """Frames [F] after which the part they are in goes on."""
    return np.append(parts.inner[1:], False)


def _lasts(parts: AvoidanceParts, frames: int) -> np.ndarray:
    out = np.zeros(frames, dtype=bool)
    out[parts.stop - 1] = True
    return out


def _entries(
    clips: ClipSet, parts: AvoidanceParts, inside: np.ndarray, lead: int
) -> tuple[np.ndarray, np.ndarray]:
    """Frames at which parts may be entered, up to ``lead`` before each begins, and whose."""
    entry, whose = [], []
    for p, start in enumerate(parts.start.tolist()):
        border = int(clips.clip_start[clips.clip_of_frame[start]])
        for j in range(start, max(start - lead, border + 1) - 1, -1):
            if j - 1 < border or inside[j - 1]:
                break
            entry.append(j)
            whose.append(p)
    return np.array(entry, dtype=np.int64), np.array(whose, dtype=np.int64)


def _just_after(
    parts: AvoidanceParts, frames: np.ndarray, clip: np.ndarray, within: int
) -> np.ndarray:
    """Which frames [S] bool follow the end of a part by up to so many. clip [F]: of each frame."""
    last = parts.stop - 1
    since = np.searchsorted(last, frames, side="right") - 1
    part = last[np.maximum(since, 0)]
    return (since >= 0) & (clip[frames] == clip[part]) & (frames - part <= within)


def _strike_back(
    clips: ClipSet,
    strikes: Strikes,
    features: PoseFeatures,
    leaving: np.ndarray,
    begun: np.ndarray,
    worst: float,
) -> list[tuple[int, int, float]]:
    """Transitions (source, target, cost) into blows from frames [S]: of those that land at about
    one place, seen from where the blow is entered, only the one that joins best.
    """
    soon, late = (round(t * clips.fps) for t in WIND_UP)
    lead = np.arange(soon, late + 1)
    usable = strikes.start - late > clips.clip_start[clips.clip_of_frame[strikes.start]]
    entry = strikes.start[usable, None] - lead  # [X, E]
    inside = begun[entry].any(axis=1)
    frame, limb, entry = (
        strikes.frame[usable][~inside],
        strikes.limb[usable][~inside],
        entry[~inside],
    )
    if len(entry) == 0 or len(leaving) == 0:
        return []
    to_entry = planar_compose(planar_inverse(clips.facing[entry[:, 0]]), clips.facing[frame])
    lands = planar_apply(to_entry, strikes.tip[frame, limb])
    d = _between(features, leaving, entry.ravel() - 1).reshape(len(leaving), *entry.shape)
    own = np.abs(entry[None] - leaving[:, None, None]) < clips.fps
    d[own & (clips.clip_of_frame[leaving][:, None, None] == clips.clip_of_frame[entry][None])] = (
        np.inf
    )
    out = []
    for row, i in enumerate(leaving.tolist()):
        chosen: list[int] = []
        best = d[row].min(axis=1)
        for x in np.argsort(best, kind="stable").tolist():
            if len(chosen) == BLOWS or best[x] > worst:
                break
            if np.any(np.linalg.norm(lands[chosen] - lands[x], axis=1) < SAME_PLACE):
                continue
            chosen.append(x)
            out.append((i, int(entry[x, np.argmin(d[row, x])]), float(best[x])))
    return out


def _between(features: PoseFeatures, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Root of D [R, C] float32 rad between frames."""
    return np.sqrt(np.maximum(squared_distances(features, rows, columns), 0.0))


def _signatures(clips: ClipSet, parts: AvoidanceParts) -> np.ndarray:
    """Where each part takes the body: [P, R * 3] m from its beginning to its middle."""
    position, _ = clips.world
    joints = [clips.skeleton.joint(role) for role in ROLES]
    middle = (parts.start + parts.stop) // 2
    frame = planar_inverse(clips.facing[parts.start])[:, None]
    moved = [planar_apply(frame, position[f][:, joints]) for f in (middle, parts.start)]
    return (moved[0] - moved[1]).reshape(len(parts), -1)


def _choose(cost: np.ndarray, signature: np.ndarray, most: int, worst: float) -> list[int]:
    """Parts to offer: those that join best, of parts that are alike only the best."""
    chosen: list[int] = []
    for p in np.argsort(cost, kind="stable").tolist():
        if len(chosen) == most or not np.isfinite(cost[p]):
            break
        if cost[p] > worst and len(chosen) >= FEWEST:
            break
        off = signature[chosen] - signature[p]
        if np.any(np.mean(off**2, axis=1) * 3.0 < UNLIKE**2):
            continue
        chosen.append(p)
    return chosen
