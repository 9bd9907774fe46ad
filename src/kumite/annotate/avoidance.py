"""Avoidance parts: the body leaves its place, quickly, and returns (Oshita & Masaoka 2011,
section 3.1, where a person marks them).

A duck, a twist, a lean, a slip, a leg that is lifted and a jump return to where they began. A step
aside or back does not: it comes to rest, in guard, elsewhere. So there are two ways to find them.

By height alone, in whatever else the body does, be it a walk:

- *low*: the head dips below where it is carried, and comes up again;
- *aloft*: both feet are off the ground higher than in a run.

And between two moments of rest in guard, by where the trunk and the feet are then:

- *aside*: the pelvis ends elsewhere, far, fast, and not ahead;
- *leg*: one foot is lifted high and put down again;
- *out*: the trunk is away from where it was and from where it comes to rest.

A part begins where most of the way out is done and ends where the way back begins in earnest; a
step begins with the pelvis and ends with the last foot. What is an attack is none, nor are the
crouches before and after a jump.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d, minimum_filter1d

from kumite.annotate.actions import Actions, find_actions
from kumite.annotate.contacts import Contacts
from kumite.annotate.strikes import find_strikes
from kumite.annotate.vocabulary import KINDS
from kumite.brief import brief
from kumite.checked import checked
from kumite.checks import freeze, rising
from kumite.clip import SIDES, ClipSet, runs
from kumite.errors import KumiteError
from kumite.rotation import planar_apply, planar_inverse

TRUNK = ("pelvis", "chest", "head", "left_upper_arm", "right_upper_arm")
"""Joints that say where the body is: a twist moves the shoulders, a bow the head."""
SMOOTHING = 0.02  # s, of positions before they are differentiated
CARRIED = 80.0  # percentile of the head's height: how high it is carried
CALM = 30.0  # percentile of the trunk's speed below which a clip's guard is taken


@brief
@dataclass(frozen=True)
class AvoidanceParts:
    """Intervals of a set of clips, in order and apart (P of them)."""

    start: np.ndarray  # [P] int64, first frame in the set of clips
    stop: np.ndarray  # [P] int64, one past the last
    clip_start: np.ndarray  # [C + 1] int64, of the set of clips

    def __post_init__(self) -> None:
        freeze(
            self,
            "avoidance parts",
            start=(np.int64, ("P",)),
            stop=(np.int64, ("P",)),
            clip_start=(np.int64, ("C + 1",)),
        )
        if np.any(self.stop <= self.start):
            raise KumiteError("avoidance parts: a part must stop after it starts")
        if np.any(self.start[1:] < self.stop[:-1]):
            raise KumiteError("avoidance parts: they overlap, or are not in order")
        if list(self.clip_start[:1]) != [0] or not rising(self.clip_start):
            raise KumiteError("avoidance parts: clips must start at 0, one after the other")
        frames = int(self.clip_start[-1])
        if len(self) and (self.start[0] < 0 or self.stop[-1] > frames):
            raise KumiteError(f"avoidance parts: one lies outside the {frames} frames")
        if np.any(self.clip != np.searchsorted(self.clip_start, self.stop - 1, side="right") - 1):
            raise KumiteError("avoidance parts: one goes from one clip into the next")

    def __len__(self) -> int:
        return len(self.start)

    @property
    def clip(self) -> np.ndarray:
        """The clip [P] that each part belongs to."""
        return np.searchsorted(self.clip_start, self.start, side="right") - 1

    @property
    def centre(self) -> np.ndarray:
        """The middle [P] of each part, in frames: what is timed to an attack."""
        return 0.5 * (self.start + self.stop - 1)

    @property
    def inner(self) -> np.ndarray:
        """Frames [F] bool of a part but its first: it is neither entered there nor left before."""
        out = np.zeros(int(self.clip_start[-1]) + 1, dtype=np.int64)
        np.add.at(out, self.start + 1, 1)
        np.add.at(out, self.stop, -1)
        return np.cumsum(out[:-1]) > 0

    def within(self, first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Parts that lie whole in ranges of frames first [L] to last [L], as CSR: [L + 1], [K]."""
        low = np.searchsorted(self.start, first, side="left")
        high = np.maximum(np.searchsorted(self.stop, np.asarray(last) + 1, side="right"), low)
        count = high - low
        begin = np.concatenate([[0], np.cumsum(count)])
        part = np.arange(begin[-1]) - np.repeat(begin[:-1], count) + np.repeat(low, count)
        return begin.astype(np.int64), part.astype(np.int64)


def no_avoidance(clip_start: np.ndarray) -> AvoidanceParts:
    """No parts, of a set of clips."""
    nothing = np.zeros(0, np.int64)
    return AvoidanceParts(nothing, nothing, clip_start)


@dataclass(frozen=True)
class AvoidanceSettings:
    """How far, how fast and for how long the body must go."""

    low: float = 0.18  # m that the head dips
    low_speed: float = 0.4  # m/s that it dips at, at its fastest
    lying: float = 0.8  # of the head's height: who goes so low has fallen
    lowest_for: float = 5.0  # s that it may stay down: longer is a crawl
    aloft: float = 0.12  # m that both ankles are above where they rest
    step: float = 0.4  # m that the pelvis goes aside or back …
    step_speed: float = 1.8  # … m/s, at its fastest
    step_for: float = 1.2  # … s that it may take
    ahead: float = 0.25  # cosine to the facing direction: beyond it a step goes ahead
    left: float = 0.05  # m, of the pelvis that leaves and of feet that arrive
    arrived: float = 0.08  # m, root mean square of the trunk's joints that arrive
    settle: float = 0.12  # s that one stands before a step is over
    leg: float = 0.3  # m that an ankle is lifted
    out: float = 0.11  # m, root mean square of the trunk's joints, that the trunk goes
    out_speed: float = 0.6  # m/s, of the same
    out_for: float = 2.0  # s that it may stay out
    share: float = 0.62  # of the farthest: beyond it a body is out, …
    enough: float = 0.2  # m … or beyond this, where the farthest is far, …
    low_enough: float = 0.3  # m … of dips
    rest: float = 0.25  # m/s of the trunk: below it a body may rest, …
    near: float = 0.08  # m … this near its guard
    floor: float = 0.06  # m … with both ankles no higher
    shortest: float = 0.08  # s of a part
    apart: float = 0.3  # s around a jump and a step: a dip so near belongs to them


@dataclass(frozen=True)
class _Body:
    """What is measured of clips. F frames."""

    trunk: np.ndarray  # [F, 5, 3] m, smoothed
    feet: np.ndarray  # [F, 2, 3] m
    lift: np.ndarray  # [F, 2] m, of the ankles above where they rest
    dip: np.ndarray  # [F] m of the head below where it is carried
    head: np.ndarray  # [F] m, how high the clip carries it
    speed: np.ndarray  # [F] m/s, root mean square of the trunk's joints
    away: np.ndarray  # [F] m, root mean square of the trunk's joints, from the clip's guard
    attack: np.ndarray  # [F] bool
    reaction: np.ndarray  # [F] bool


@checked
def find_avoidance(
    clips: ClipSet,
    contacts: Contacts,
    settings: AvoidanceSettings | None = None,
    *,
    actions: Actions | None = None,
) -> AvoidanceParts:
    """The avoidance parts of clips. Errors: roles that are missing, notes of other clips.

    actions: of these clips, where they are known already; else they are found.
    """
    settings = settings or AvoidanceSettings()
    if len(contacts.on_ground) != len(clips):
        raise KumiteError("avoidance parts: contacts are of other clips")
    if actions is None:
        actions = find_actions(clips, contacts, find_strikes(clips))
    elif not np.array_equal(actions.clip_start, clips.clip_start):
        raise KumiteError("avoidance parts: actions are of other clips")
    body = _measure(clips, contacts, actions)
    spans = list(_between_rests(clips, actions, body, settings))
    taken = np.zeros(len(clips), dtype=bool)
    found: list[tuple[int, int]] = []

    def add(parts: Iterator[tuple[int, int]], margin: float) -> None:
        around = round(margin * clips.fps)
        for a, b in parts:
            if b - a < settings.shortest * clips.fps or taken[a:b].any():
                continue
            found.append((a, b))
            first, stop = clips.clip_start[clips.clip_of_frame[a] :][:2]
            taken[max(a - around, first) : min(b + around, stop)] = True

    add(_aside(clips, spans, body, settings), settings.apart)
    add(_aloft(clips, body, settings), settings.apart)
    add(_low(clips, body, settings), 0.0)
    add(_legs(spans, body, settings), 0.0)
    add(_out(clips.fps, spans, body, settings), 0.0)
    parts = np.array(sorted(found), dtype=np.int64).reshape(-1, 2)
    return AvoidanceParts(parts[:, 0], parts[:, 1], clips.clip_start)


def _measure(clips: ClipSet, contacts: Contacts, actions: Actions) -> _Body:
    joint, position = clips.skeleton.joint, clips.world[0]
    trunk = position[:, [joint(role) for role in TRUNK]]
    feet = position[:, [joint(f"{side}_foot") for side in SIDES]]
    to_facing = planar_inverse(clips.facing)
    middle = planar_apply(to_facing, feet.mean(axis=1))
    speed, away, dip, carried = (np.zeros(len(clips)) for _ in range(4))
    for a, b in zip(clips.clip_start[:-1].tolist(), clips.clip_start[1:].tolist()):
        trunk[a:b] = gaussian_filter1d(trunk[a:b], SMOOTHING * clips.fps, axis=0, mode="nearest")
        if b - a > 1:
            speed[a:b] = _size(np.gradient(trunk[a:b], axis=0) * clips.fps)
        pose = planar_apply(to_facing[a:b, None], trunk[a:b])
        pose[:, :, [0, 2]] -= middle[a:b, None, [0, 2]]
        calm = speed[a:b] <= np.percentile(speed[a:b], CALM)
        away[a:b] = _size(pose - np.median(pose[calm], axis=0))
        head = trunk[a:b, TRUNK.index("head"), 1]
        carried[a:b] = np.percentile(head, CARRIED)
        dip[a:b] = carried[a:b] - head
    lift = feet[:, :, 1] - contacts.resting_height[:, 0]
    return _Body(
        trunk,
        feet,
        lift,
        dip,
        carried,
        speed,
        away,
        *(_inside(actions, kind) for kind in ("attack", "reaction")),
    )


def _inside(actions: Actions, kind: str) -> np.ndarray:
    """Frames [F] bool of actions of a kind."""
    out = np.zeros(int(actions.clip_start[-1]), dtype=bool)
    for k in np.flatnonzero(actions.kind == KINDS.index(kind)).tolist():
        out[actions.start[k] : actions.stop[k]] = True
    return out


def _size(x: np.ndarray) -> np.ndarray:
    """Root mean square [F] over joints of vectors [F, R, 3]."""
    return np.sqrt(np.mean(np.sum(x**2, axis=2), axis=1))


def _between_rests(
    clips: ClipSet, actions: Actions, body: _Body, settings: AvoidanceSettings
) -> Iterator[tuple[int, int]]:
    """Spans of frames from one moment of rest in guard to the next, both included."""
    reach = max(1, round(0.1 * clips.fps))
    slowest = np.zeros(len(clips), dtype=bool)
    for a, b in zip(clips.clip_start[:-1].tolist(), clips.clip_start[1:].tolist()):
        slowest[a:b] = body.speed[a:b] <= minimum_filter1d(body.speed[a:b], 2 * reach + 1)
    rests = slowest & (body.speed < settings.rest) & (body.away < settings.near)
    rests &= body.lift.max(axis=1) < settings.floor
    rests[actions.start] = True
    rests[clips.clip_start[:-1]] = rests[clips.clip_start[1:] - 1] = True
    frames = np.flatnonzero(rests)
    for a, b in zip(frames[:-1].tolist(), frames[1:].tolist()):
        if clips.clip_of_frame[a] == clips.clip_of_frame[b] and b - a >= 0.2 * clips.fps:
            yield a, b + 1


def _most(mask: np.ndarray, a: int, b: int) -> bool:
    """Whether most of frames a to b are in a mask [F]."""
    return 2 * int(np.count_nonzero(mask[a:b])) > b - a


def _around(out: np.ndarray) -> tuple[int, int]:
    """The run of frames [F] in which ``out`` is high, around its highest."""
    top, below = int(np.argmax(out)), np.flatnonzero(~(out > 0))
    left = np.searchsorted(below, top)
    return (
        int(below[left - 1]) + 1 if left > 0 else 0,
        int(below[left]) if left < len(below) else len(out),
    )


def _low(clips: ClipSet, body: _Body, settings: AvoidanceSettings) -> Iterator[tuple[int, int]]:
    """Dips of the head that end."""
    borders = np.concatenate([clips.clip_start[:-1], clips.clip_start[1:] - 1])
    for a, b in runs(body.dip > 0.5 * settings.low, clips.clip_start).tolist():
        depth = float(body.dip[a:b].max())
        ends = not np.any((borders >= a) & (borders < b))
        fallen = depth > settings.lying * body.head[a]
        speed = float(np.diff(body.dip[a:b]).max(initial=0.0)) * clips.fps
        if (
            depth < settings.low
            or fallen
            or not ends
            or speed < settings.low_speed
            or b - a > settings.lowest_for * clips.fps
        ):
            continue
        first, last = _around(body.dip[a:b] - min(settings.share * depth, settings.low_enough))
        # Nobody strikes from very low, and no hit that leaves a man standing bends him as far.
        other = body.attack | body.reaction
        if depth > 1.5 * settings.low or not _most(other, a + first, a + last):
            yield a + first, a + last


def _aloft(clips: ClipSet, body: _Body, settings: AvoidanceSettings) -> Iterator[tuple[int, int]]:
    """Jumps: both feet high at once."""
    lower, higher = body.lift.min(axis=1), body.lift.max(axis=1)
    upright = body.dip < 2 * settings.low  # who crawls has both feet up, too
    high = (lower > 0.25 * settings.aloft) & upright
    for a, b in runs(high, clips.clip_start).tolist():
        top = float(lower[a:b].max())
        if top < settings.aloft:
            continue
        first, last = _around(lower[a:b] - 0.3 * top)
        kicks = top < 0.5 * float(higher[a:b].max())
        if not (kicks and _most(body.attack, a + first, a + last)):
            yield a + first, a + last


def _aside(
    clips: ClipSet, spans: list[tuple[int, int]], body: _Body, settings: AvoidanceSettings
) -> Iterator[tuple[int, int]]:
    """Steps and jumps that end elsewhere, but not ahead."""
    for a, b in spans:
        pelvis = body.trunk[a:b, 0][:, [0, 2]]
        gone = pelvis[-1] - pelvis[0]
        far = float(np.linalg.norm(gone))
        yaw = clips.facing[a, 2]
        ahead = float(gone @ (np.sin(yaw), np.cos(yaw)))
        speed = np.linalg.norm(np.gradient(pelvis, axis=0), axis=1).max() * clips.fps
        falls = float(body.dip[a:b].max()) > 2 * settings.low
        if far < settings.step or speed < settings.step_speed or falls:
            continue
        left = np.linalg.norm(pelvis - pelvis[0], axis=1) > settings.left
        feet = np.linalg.norm(body.feet[a:b] - body.feet[b - 1], axis=2).max(axis=1)
        trunk = _size(body.trunk[a:b] - body.trunk[b - 1])
        down = np.max(np.flatnonzero(feet > settings.left), initial=0)
        down += round(settings.settle * clips.fps)
        still = np.max(np.flatnonzero(trunk > settings.arrived), initial=0)
        first, last = int(np.argmax(left)), min(int(max(down, still)) + 1, b - a)
        if (
            ahead < settings.ahead * far
            and last - first < settings.step_for * clips.fps
            and not _most(body.attack, a + first, a + last)
        ):
            yield a + first, a + last


def _returns(body: _Body, a: int, b: int) -> tuple[np.ndarray, float]:
    """How far [b - a] the trunk is from where it was and comes to rest, and how far those are."""
    trunk = body.trunk[a:b]
    from_first = _size(trunk - trunk[0])
    return np.minimum(from_first, _size(trunk - trunk[-1])), float(from_first[-1])


def _legs(
    spans: list[tuple[int, int]], body: _Body, settings: AvoidanceSettings
) -> Iterator[tuple[int, int]]:
    """A leg that is lifted: the body stays where it is."""
    for a, b in spans:
        lift = body.lift[a:b].max(axis=1)
        _, gone = _returns(body, a, b)
        if lift.max() < settings.leg or gone > 0.5 * settings.leg:
            continue
        first, last = _around(lift - settings.share * float(lift.max()))
        apart = body.feet[a:b] - body.trunk[a:b, :1]
        kicks = np.linalg.norm(apart[:, :, [0, 2]], axis=2).max() > 0.45  # m
        if not (kicks and _most(body.attack, a + first, a + last)):
            yield a + first, a + last


def _out(
    fps: float, spans: list[tuple[int, int]], body: _Body, settings: AvoidanceSettings
) -> Iterator[tuple[int, int]]:
    """A trunk that goes out of the way and comes back."""
    for a, b in spans:
        out, gone = _returns(body, a, b)
        farthest = float(out.max())
        speed = float(np.gradient(_size(body.trunk[a:b] - body.trunk[a])).max() * fps)
        if farthest < settings.out or speed < settings.out_speed or gone > 0.7 * farthest:
            continue
        first, last = _around(out - min(settings.share * farthest, settings.enough))
        if last - first < settings.out_for * fps and not _most(body.attack, a + first, a + last):
            yield a + first, a + last
