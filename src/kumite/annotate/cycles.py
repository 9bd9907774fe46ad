"""Cycles of locomotion: one stride to repeat, the core nodes of a hierarchical motion graph
(Shum et al. 2013, section 4.1).

A cycle of a gait goes from one lift-off of the left foot to the next, with one of the right foot
between: so all cycles meet at the same phase. It counts if the body is upright and its end looks
like its start, now and a moment before (pose and velocity). A cycle of standing is a quiet part on
both feet whose ends look alike. Where a body stands and faces does not count; how far it gets does:
it names the cycle, and is its displacement.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kumite.annotate.actions import Actions
from kumite.annotate.contacts import Contacts, velocity
from kumite.annotate.vocabulary import KINDS
from kumite.brief import brief
from kumite.checked import checked
from kumite.checks import fps, freeze, names
from kumite.clip import SIDES, ClipSet, forward_kinematics, runs
from kumite.errors import KumiteError, unknown
from kumite.rotation import (
    conjugate,
    exp,
    from_yaw,
    log,
    multiply,
    planar_apply,
    planar_compose,
    planar_inverse,
)

PARTS = ("upper_arm", "forearm", "thigh", "shin", "foot")
HEIGHT_WEIGHT = 3.0  # rad/m: 10 cm of pelvis height weigh as 0.3 rad

STAND = "stand"
SAMPLES = 400  # poses by which it is told what is usual


@dataclass(frozen=True)
class CycleSettings:
    """What counts as a cycle, and what it is called."""

    period: tuple[float, float] = (0.4, 1.8)  # s, of a gait
    stand: tuple[float, float] = (1.0, 2.5)  # s, of standing
    gap: float = 0.7  # rad by which the end's pose may differ from the start's, all joints together
    upright: float = 0.85  # of the height at which the pelvis stands
    quiet: float = 0.12  # m/s: whose pelvis and hands are slower stands
    turn: float = 0.26  # rad that a cycle turns by, to be called turning
    place: float = 0.15  # m/s: slower gaits step on the spot
    flight: float = 0.12  # share of a cycle that no foot stands: more is no walk, but, from
    run: float = 1.5  # m/s on, a run
    leap: float = 0.08  # m: below it, a leap if both feet are so high for half that share
    strange: float = 1.5  # rad farther from the usual than the most usual cycle, nobody stands so:
    # a T pose
    slack: float = 0.07  # s by which an end may be moved to where it looks more like the start


@brief
@dataclass(frozen=True)
class Cycles:
    """M cycles. One plays frames start + 1 … stop, and ``stop`` looks like ``start``."""

    label: tuple[str, ...]  # M
    start: np.ndarray  # [M] int64, frame in the set of clips
    stop: np.ndarray  # [M] int64
    displacement: np.ndarray  # [M, 3] (x, z, yaw) from the facing frame of start to that of stop
    gap: np.ndarray  # [M] rad, root of the squared angles between the poses of start and stop
    skate: np.ndarray  # [M] m/s, of a supporting foot at its fastest when the cycle is closed
    fps: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "label", names(self.label, "cycles: labels", unlike=False))
        object.__setattr__(self, "fps", fps(self.fps, "cycles: fps"))
        count = len(self.label)
        freeze(
            self,
            "cycles",
            start=(np.int64, (count,)),
            stop=(np.int64, (count,)),
            displacement=(float, (count, 3)),
            gap=(float, (count,)),
            skate=(float, (count,)),
        )
        if np.any(self.stop <= self.start):
            raise KumiteError("cycles: a cycle must stop after it starts")

    def __len__(self) -> int:
        return len(self.label)

    @property
    def seconds(self) -> np.ndarray:
        """How long each lasts [M]."""
        return (self.stop - self.start) / self.fps

    @property
    def speed(self) -> np.ndarray:
        """How fast each gets on [M] m/s."""
        return np.hypot(self.displacement[:, 0], self.displacement[:, 1]) / self.seconds

    def take(self, index: Sequence[int] | np.ndarray) -> Cycles:
        i = np.asarray(index, dtype=np.int64)
        return Cycles(
            tuple(self.label[k] for k in i.tolist()),
            self.start[i],
            self.stop[i],
            self.displacement[i],
            self.gap[i],
            self.skate[i],
            self.fps,
        )


@checked
def find_cycles(
    clips: ClipSet,
    contacts: Contacts,
    settings: CycleSettings | None = None,
    *,
    most: int = 1,
    where: np.ndarray | None = None,
) -> Cycles:
    """The cycles that the clips show, at most ``most`` of each name, the best closing ones.

    where: frames [F] bool in which to look (of labelled locomotion, say); all by default.
    Errors: there is none; contacts of other clips; roles that are missing.
    """
    settings = settings or CycleSettings()
    if len(contacts.on_ground) != len(clips):
        raise KumiteError(
            f"cycles: contacts of {len(contacts.on_ground)} frames, clips of {len(clips)}"
        )
    look = _Look(clips, contacts)
    ranges = _strides(look, settings) + _stands(look, settings)
    if where is not None:
        ranges = [(a, b) for a, b in ranges if np.all(where[a : b + 1])]
    found = [r for r in ranges if look.gap(*r) <= settings.gap]
    if not found:
        closest = min((float(look.gap(*r)) for r in ranges), default=np.inf)
        why = (
            f"of {len(ranges)} strides and stands the best ends {closest:.2f} rad from where it "
            f"starts, allowed are {settings.gap:g}"
            if ranges
            else "no upright stride from one lift-off of the left foot to the next, and no "
            "quiet stand"
        )
        raise KumiteError(
            f"no cycle of locomotion in {len(clips.names)} clip(s) ({clips.seconds:.1f} s): {why}"
        )
    named = [(look.name(*r, settings), r) for r in found]
    odd = [look.strangeness(start) for _, (start, _) in named]
    usual = min(odd) + settings.strange
    named = [n for n, strange in zip(named, odd) if n[0] != STAND or strange <= usual]
    cycles = _measured(look, [name for name, _ in named], [r for _, r in named])
    order = np.argsort(cycles.gap + cycles.skate, kind="stable").tolist()
    kept: list[int] = []
    for i in order:
        if sum(cycles.label[k] == cycles.label[i] for k in kept) < most:
            kept.append(i)
    return cycles.take(sorted(kept, key=lambda i: (cycles.label[i], order.index(i))))


@checked
def hand_cycles(
    clips: ClipSet,
    contacts: Contacts,
    labelled: Sequence[tuple[str, int, int]],
    *,
    slack: float = CycleSettings.slack,
) -> Cycles:
    """Cycles labelled by hand: (label, start, stop) in frames of the set.

    slack: by how much [s] a stop may be moved to where it looks more like the start. Errors: frames
    that are no part of one clip; none at all.
    """
    look = _Look(clips, contacts)
    out = []
    for label, start, stop in labelled:
        inside = 0 <= start < stop < len(clips)
        if not inside or clips.clip_of_frame[start] != clips.clip_of_frame[stop]:
            raise KumiteError(
                f"cycle {label!r}: frames {start} to {stop} are no part of one clip "
                f"(there are {len(clips)} frames, a cycle stops after it starts)"
            )
        out.append(look.ended(start, stop, round(slack * clips.fps)))
    if not out:
        raise KumiteError("cycles: none is labelled; expected at least one (label, start, stop)")
    return _measured(look, [label for label, _, _ in labelled], out)


@checked
def labelled_frames(actions: Actions, kinds: Sequence[str] = ("transition", "idle")) -> np.ndarray:
    """Frames [F] bool of actions of these kinds: where :func:`find_cycles` is to look."""
    for kind in kinds:
        if kind not in KINDS:
            raise unknown("kind of action", kind, KINDS)
    out = np.zeros(int(actions.clip_start[-1]), dtype=bool)
    for start, stop, kind in zip(actions.start, actions.stop, actions.kind.tolist()):
        out[start:stop] = KINDS[kind] in kinds
    return out


def closed(clips: ClipSet, start: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
    """Root [T + 1, 3] and rotations [T + 1, J, 4] of frames start … stop, made to close.

    By how the last pose differs from the first, each is bent back, evenly over the time: the last
    is the first, displaced by the cycle's displacement.
    """
    root = clips.root_position[start : stop + 1].copy()
    wxyz = clips.wxyz[start : stop + 1].copy()
    along = np.linspace(0.0, 1.0, len(root))[:, None]
    facing = clips.facing
    moved = planar_compose(facing[stop], planar_inverse(facing[start]))
    goal = planar_apply(moved, root[0])
    root += along * (goal - root[-1])
    first = wxyz[0].copy()
    first[0] = multiply(from_yaw(moved[2]), first[0])
    left = log(multiply(conjugate(wxyz[-1]), first))
    return root, multiply(wxyz, exp(along[:, :, None] * left))


class _Look:
    """What cycles are told by, of a set of clips."""

    def __init__(self, clips: ClipSet, contacts: Contacts) -> None:
        self.clips, self.contacts = clips, contacts
        skeleton = clips.skeleton
        self.position, world = clips.world
        pelvis = skeleton.joint("pelvis")
        joints = [skeleton.joint(f"{side}_{part}") for part in PARTS for side in SIDES]
        joints += [j for j in skeleton.trunk(skeleton.joint("chest")) if j not in joints]
        upright = multiply(from_yaw(-clips.facing[:, 2]), world[:, pelvis])
        self.pose = np.concatenate([upright[:, None], clips.wxyz[:, joints]], axis=1)
        self.height = self.position[:, pelvis, 1]
        self.standing = float(np.percentile(self.height, 90))
        hands = [skeleton.joint(f"{side}_hand") for side in SIDES]
        moving = [velocity(self.position[:, j], clips) for j in (pelvis, *hands)]
        self.fastest = np.linalg.norm(moving, axis=2).max(axis=0)
        feet = [skeleton.joint(f"{side}_foot") for side in SIDES]
        parts = [[f, skeleton.roles.get(f"{side}_toe", f)] for f, side in zip(feet, SIDES)]
        self.clearance = (self.position[:, parts, 1] - contacts.resting_height).min(axis=(1, 2))

    def apart(self, f: int | np.ndarray, g: int | np.ndarray) -> np.ndarray:
        """How far poses are apart [rad]: the root of the squared angles of all joints."""
        turns = log(multiply(conjugate(self.pose[f]), self.pose[g]))
        height = HEIGHT_WEIGHT * (self.height[g] - self.height[f])
        return np.sqrt(np.sum(turns**2, axis=(-1, -2)) + height**2)

    def strangeness(self, start: int) -> float:
        """How far a pose is from those of all clips [rad], the median of a few hundred."""
        some = np.linspace(0, len(self.clips) - 1, min(len(self.clips), SAMPLES)).astype(np.int64)
        return float(np.median(self.apart(np.full(len(some), start), some)))

    def gap(self, start: int, stop: int | np.ndarray) -> np.ndarray:
        """How far the ends of a cycle are apart, or the poses before them, whichever is more."""
        first = start == self.clips.clip_start[self.clips.clip_of_frame[start]]
        starts, stops = np.full(np.shape(stop), start), np.asarray(stop)
        now = self.apart(starts, stops)
        return now if first else np.maximum(now, self.apart(starts - 1, stops - 1))

    def ended(self, start: int, stop: int, slack: int) -> tuple[int, int]:
        """The cycle with its end moved by up to so many frames to where the gap is least."""
        clip = self.clips.clip_of_frame[start]
        last = int(self.clips.clip_start[clip + 1]) - 1
        ends = np.arange(max(stop - slack, start + 1), min(stop + slack, last) + 1)
        return start, int(ends[np.argmin(self.gap(start, ends))])

    def name(self, start: int, stop: int, settings: CycleSettings) -> str:
        """What a cycle is called: its gait and where it goes."""
        facing = self.clips.facing
        x, z, yaw = planar_compose(planar_inverse(facing[start]), facing[stop])
        seconds = (stop - start) / self.clips.fps
        on_ground = self.contacts.on_ground[start + 1 : stop + 1]
        speed = float(np.hypot(x, z)) / seconds
        if np.all(on_ground) and speed < settings.place:
            return STAND
        off = ~on_ground.any(axis=1)
        if speed > settings.run:
            gait = "run" if np.mean(off) > settings.flight else "walk"
        else:
            high = off & (self.clearance[start + 1 : stop + 1] > settings.leap)
            gait = "leap" if np.mean(high) > 0.5 * settings.flight else "walk"
        if speed < settings.place:
            gait, way = "step", ""
        else:
            # The way it goes as seen by a body that faces half way between its two ends.
            sector = round((np.arctan2(x, z) - 0.5 * yaw) / (0.5 * np.pi)) % 4
            way = ("", "_left", "_back", "_right")[sector]
        turn = ("_turn_left" if yaw > 0 else "_turn_right") if abs(yaw) > settings.turn else ""
        return gait + way + turn


def _strides(look: _Look, settings: CycleSettings) -> list[tuple[int, int]]:
    """From each lift-off of the left foot to the next, with one of the right foot between."""
    clips = look.clips
    off = look.contacts.lift_off(clips.clip_start)
    left, right = (np.flatnonzero(off[:, s]) for s in range(2))
    shortest, longest = settings.period
    out = []
    for a, b in zip(left[:-1].tolist(), left[1:].tolist()):
        if clips.clip_of_frame[a] != clips.clip_of_frame[b]:
            continue
        if not shortest <= (b - a) / clips.fps <= longest:
            continue
        between = np.count_nonzero((right > a) & (right <= b))
        upright = look.height[a : b + 1].mean() >= settings.upright * look.standing
        if between == 1 and upright:
            out.append(look.ended(a, b, round(settings.slack * clips.fps)))
    return out


def _stands(look: _Look, settings: CycleSettings) -> list[tuple[int, int]]:
    """Of each quiet part on both feet the two frames that look most alike."""
    clips = look.clips
    still = look.contacts.on_ground.all(axis=1) & (look.fastest < settings.quiet)
    still &= look.height >= settings.upright * look.standing
    shortest, longest = (round(s * clips.fps) for s in settings.stand)
    out = []
    for a, b in runs(still, clips.clip_start).tolist():
        best, least = None, np.inf
        for start in range(a + 1, b - shortest, max(1, shortest // 6)):
            ends = np.arange(start + shortest, min(start + longest, b - 1) + 1)
            if len(ends) == 0:
                continue
            gaps = look.gap(start, ends)
            if gaps.min() < least:
                best, least = (start, int(ends[np.argmin(gaps)])), float(gaps.min())
        if best:
            out.append(best)
    return out


def _measured(look: _Look, labels: Sequence[str], ranges: Sequence[tuple[int, int]]) -> Cycles:
    """The cycles of these frames with their displacement, gap and foot skate."""
    clips = look.clips
    start, stop = (np.array(x, dtype=np.int64) for x in zip(*ranges))
    facing = clips.facing
    return Cycles(
        tuple(labels),
        start,
        stop,
        planar_compose(planar_inverse(facing[start]), facing[stop]),
        np.array([look.gap(a, b) for a, b in ranges]),
        np.array([_skate(look, a, b) for a, b in ranges]),
        clips.fps,
    )


def _skate(look: _Look, start: int, stop: int) -> float:
    """How much faster [m/s] than in the capture a supporting foot slides in the closed cycle.

    A foot's slide is the speed of its slower part, ankle or toes, along the ground.
    """
    clips, skeleton = look.clips, look.clips.skeleton
    shown, _ = forward_kinematics(skeleton, *closed(clips, start, stop))
    captured = look.position[start : stop + 1]
    on_ground = look.contacts.on_ground[start : stop + 1]
    worst = 0.0
    for s, side in enumerate(SIDES):
        ankle = skeleton.joint(f"{side}_foot")
        parts = [ankle, skeleton.roles.get(f"{side}_toe", ankle)]
        slide = [
            np.linalg.norm(np.diff(p[:, parts][..., [0, 2]], axis=0), axis=2).min(axis=1)
            for p in (shown, captured)
        ]
        held = on_ground[1:, s] & on_ground[:-1, s]
        worst = max(worst, float(np.max((slide[0] - slide[1])[held], initial=0.0)) * clips.fps)
    return worst
