"""Target motions that nobody marks, found in the clips themselves.

What leaves locomotion is told by three things: a blow faster than arms swing on the way, a pelvis
lower than walking and running take it, or feet that are both higher. Around it a target reaches,
before and after, to where the pose is most like one of the cores. Shum et al. (2013) cut theirs by
hand; a file of actions with marks does so here (:func:`kumite.annotate.read_marked`).
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from kumite.annotate import (
    Balance,
    Contacts,
    Cycles,
    Marked,
    Strikes,
    find_balance,
    find_cycles,
    find_mark,
    find_reference,
    hand_cycles,
)
from kumite.annotate.kinds import strike_directions
from kumite.body import lay_body
from kumite.checked import checked
from kumite.clip import LIMBS, SIDES, ClipSet, runs
from kumite.errors import KumiteError
from kumite.graph.distance import pose_features
from kumite.graph.hierarchy import Targets, pose_distances
from kumite.graph.preparing import KINDS as ABOUT
from kumite.graph.preparing import NO_LIMB, find_about, own_blows

# Limits set with real clips in view (walks, runs, ducks, crawls, jumps, kicks, punches).
HAND = 3.3  # m/s of a fist along the forearm: arms that swing in a run reach 3.2
LOW = 0.78  # of the height at which the pelvis stands: walking and running stay above it
HIGH = 0.17  # m that both feet are off the ground: of who runs 0.09, in a sideways leap 0.14
TOGETHER = 0.6  # s between two departures that are one: crouch, flight and landing
SMOOTH = 0.05  # s
NEAR, FAR = 0.25, 1.2  # s before and after it, in which locomotion is left and taken up again …
UNSTEADY = 0.6  # rad that a start weighs more that is out of balance: no reference posture is near
CROUCH = 0.25  # … and so much farther from a departure: who jumps crouches first
WIND_UP = 0.25  # s before its hit in which a blow has begun, at the latest: hooks are fast at once
MOST = 4  # targets of one name that are kept
LONGEST = 8.0  # s


@checked
def marked_targets(
    clips: ClipSet, contacts: Contacts, marked: Marked
) -> tuple[Targets, Cycles | None]:
    """The targets that a file marks, and its cycles; None if it marks none."""
    labels, *columns = zip(*marked.targets)
    targets = Targets(labels, *(np.array(c, dtype=np.int64) for c in columns))
    return targets, hand_cycles(clips, contacts, marked.cycles) if marked.cycles else None


@checked
def find_targets(
    clips: ClipSet, contacts: Contacts, strikes: Strikes, *, most: int = MOST
) -> tuple[Targets, Cycles]:
    """The target motions that the clips show, in order, and the cycles of what lies between.

    most: of one name, as many are kept, those that are most like the cores where they begin and
    end. Errors: there are none; no cycles; less than 1 of a name.
    """
    if most < 1:
        raise KumiteError(f"most {most} of a name; expected at least 1")
    strikes = own_blows(clips, strikes)
    hearts = _hearts(clips, contacts, strikes)
    if not hearts:
        raise KumiteError(
            f"no target motion in {len(clips.names)} clip(s) ({clips.seconds:.1f} s): no fist "
            f"above {HAND:g} m/s, no kick, no pelvis lower and no feet higher than locomotion "
            "takes them; expected one (mark it by hand: kumite segment, then mark=FRAME behind "
            "its label)"
        )
    near, far = round(NEAR * clips.fps), round(FAR * clips.fps)
    goes = np.ones(len(clips), dtype=bool)
    for a, b, _ in hearts:
        first, stop = clips.clip_start[clips.clip_of_frame[a] :][:2]
        goes[max(a - near, first) : min(b + near + 1, stop)] = False
    cycles = find_cycles(clips, contacts, where=goes)
    away, edges, clip = _away(clips, cycles), clips.clip_start, clips.clip_of_frame
    balance = find_balance(clips, contacts)
    begins = away + np.where(balance.balanced, 0.0, UNSTEADY)
    rows: list[tuple[int, int, int]] = []
    wind_up = round(WIND_UP * clips.fps)
    for a, b, more in hearts:
        first, last = int(edges[clip[a]]), int(edges[clip[a] + 1]) - 1
        before = np.arange(max(a - more - far, first), a - more - near + 1)
        after = np.arange(b + near, min(b + far, last - 1) + 1)
        if len(before) == 0 or len(after) == 0:
            continue  # the clip begins or ends within it
        start, stop = int(before[np.argmin(begins[before])]), int(after[np.argmin(away[after])])
        if rows and start < rows[-1][1]:
            continue  # the other one has it
        mark = find_mark(clips, start, stop, None if more else strikes)
        if not more:
            hits = strikes.frame[(strikes.frame >= start) & (strikes.frame < stop)]
            mark = min([mark, *(int(f) - wind_up for f in hits)])
        rows.append((start, stop, min(max(mark, start), stop - 1)))
    if not rows:
        raise KumiteError(
            f"{len(hearts)} motion(s) leave locomotion, but clips begin or end within each; "
            f"expected {NEAR:g} s of locomotion or standing before and after"
        )
    start, stop, mark = np.array(rows, dtype=np.int64).T
    names = _names(clips, contacts, balance, strikes, Targets(("",) * len(rows), start, stop, mark))
    apart = away[start] + away[stop]
    kept: list[tuple[int, str]] = []
    for name in dict.fromkeys(names):
        mine = [t for t, other in enumerate(names) if other == name]
        best = sorted(sorted(mine, key=lambda t: apart[t])[:most])
        kept += [(t, name if k == 0 else f"{name}_{k + 1}") for k, t in enumerate(best)]
    index = [t for t, _ in sorted(kept)]
    return Targets(
        tuple(name for _, name in sorted(kept)), start[index], stop[index], mark[index]
    ), cycles


def _names(
    clips: ClipSet, contacts: Contacts, balance: Balance, strikes: Strikes, targets: Targets
) -> list[str]:
    """Targets [T] called by what they are about, such as under, or right_foot_kick."""
    ways, body = strike_directions(clips, strikes), lay_body(clips.skeleton)
    out = []
    for t in range(len(targets)):
        start, mark = int(targets.start[t]), int(targets.mark[t])
        reference = find_reference(clips, contacts, start, mark, balance=balance).frame
        about = find_about(clips, strikes, targets, t, reference, body)
        if about.limb == NO_LIMB:
            out.append(ABOUT[about.kind])
        else:
            (x,) = np.flatnonzero((strikes.frame == about.contact) & (strikes.limb == about.limb))
            out.append(f"{LIMBS[about.limb]}_{ways[x] or 'kick'}")
    return out


def _hearts(clips: ClipSet, contacts: Contacts, strikes: Strikes) -> list[tuple[int, int, int]]:
    """First and last frames in which something leaves locomotion, and how many frames farther it
    begins. Blows near a departure are part of it: arms swing in a jump, and hands support.
    """
    departs, apart = _departures(clips, contacts), round(TOGETHER * clips.fps)
    clip = clips.clip_of_frame
    blows = [
        (a, b)
        for a, b in _blows(clips, strikes)
        if not any(a <= q + apart and p - apart <= b and clip[p] == clip[a] for p, q in departs)
    ]
    more = round(CROUCH * clips.fps)
    return sorted([(a, b, more) for a, b in departs] + [(a, b, 0) for a, b in blows])


def _departures(clips: ClipSet, contacts: Contacts) -> list[tuple[int, int]]:
    """Frames in which the pelvis is lower or the feet are higher than locomotion takes them."""
    position, skeleton = clips.world[0], clips.skeleton
    height = position[:, skeleton.joint("pelvis"), 1]
    height = height / np.percentile(height, 90)
    feet = [skeleton.joint(f"{side}_foot") for side in SIDES]
    parts = [[f, skeleton.roles.get(f"{side}_toe", f)] for f, side in zip(feet, SIDES)]
    lifted = (position[:, parts, 1] - contacts.resting_height).min(axis=(1, 2))
    departed = lifted > HIGH
    for first, stop in zip(clips.clip_start[:-1].tolist(), clips.clip_start[1:].tolist()):
        h = gaussian_filter1d(height[first:stop], SMOOTH * clips.fps, mode="nearest")
        departed[first:stop] |= h < LOW
    found = runs(departed, clips.clip_start, apart=round(TOGETHER * clips.fps))
    at_border = np.isin(found, clips.clip_start).any(axis=1)
    short = found[:, 1] - 1 - found[:, 0] <= LONGEST * clips.fps
    return [(a, b - 1) for a, b in found[short & ~at_border].tolist()]


def _blows(clips: ClipSet, strikes: Strikes) -> list[tuple[int, int]]:
    """Frames of blows that no locomotion has, those of one flurry as one."""
    limb, frame = strikes.limb, strikes.frame
    foot = np.array([LIMBS[k].endswith("foot") for k in limb.tolist()], dtype=bool)
    fast = foot | (strikes.speed[frame, limb] >= HAND)
    struck = np.zeros(len(clips), dtype=bool)
    for x in np.flatnonzero(fast).tolist():
        struck[strikes.start[x] : strikes.stop[x]] = True
    found = runs(struck, clips.clip_start, apart=round(TOGETHER * clips.fps))
    return [(a, b - 1) for a, b in found.tolist()]


def _away(clips: ClipSet, cycles: Cycles) -> np.ndarray:
    """How far each frame's pose is from the nearest of the cores' [F] rad."""
    features = pose_features(clips)
    frames = np.concatenate([np.arange(a + 1, b + 1) for a, b in zip(cycles.start, cycles.stop)])
    out = np.empty(len(clips))
    for first in range(0, len(clips), 2048):
        some = np.arange(first, min(first + 2048, len(clips)))
        out[some] = pose_distances(features, some, frames).min(axis=1)
    return out
