"""What a target motion is about, and where: a strike, a bar to get under, a hurdle to get over.

Shum et al. (2013) say of a target motion its reference posture, and leave the ball, the opponent
and the obstacles to who makes a scene. Here they follow from the capture: a blow tells where a ball
would have to lie, and the body's capsules, swept along the way, how low a bar it passes under and
how high a hurdle it passes over.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from kumite.annotate import Strikes, only_blows
from kumite.annotate.contacts import velocity
from kumite.annotate.kinds import strike_directions
from kumite.body import Body, lay_body
from kumite.brief import brief
from kumite.checked import checked
from kumite.checks import freeze
from kumite.clip import LIMBS, ClipSet
from kumite.errors import KumiteError
from kumite.graph.hierarchy import ENTRY, RETURN, Hierarchy, Targets
from kumite.kernels import passing as kernels
from kumite.rotation import planar_apply, planar_inverse, rotate

KINDS = ("strike", "under", "over")
"""What a target motion is about."""
NO_LIMB = -1
"""The limb of a target in which none strikes."""
LINK = -1
"""What a stretch is that belongs to no core and to no target."""

MARGIN = 0.05  # m along the way, before and behind an obstacle, that the body keeps clear of
PLACE = 0.01  # m: how finely places along the way are told apart
PIECE = 0.01  # m between the spheres that a capsule is taken as: 0.4 mm in a thin one's height
GOES = 0.3  # m: who gets less far passes nothing
UNDER, OVER = 0.85, 0.10  # of the height at the start: a bar below, a hurdle above is an obstacle …
RUNS = 1.4  # m/s of the hips: above it only high kicks are blows, arms and legs swing as they go
ROLLS = 0.10  # m: a foot that is lower in a blow, fast as it may be, stands or rolls
KICK = 0.40  # … and who clears one strikes only with a foot that is so high, of the same


@checked
@brief
@dataclass(frozen=True)
class Preparing:
    """What a library for preparation holds besides its table: M cores, T targets, L stretches."""

    hierarchy: Hierarchy
    what: np.ndarray  # [L] int32, of each stretch of the table: core m, M + t for target t, or LINK
    kind: np.ndarray  # [T] int32, index into KINDS
    limb: np.ndarray  # [T] int32, index into clip.LIMBS of the limb that strikes, or NO_LIMB
    reference: np.ndarray  # [T] int64, frame of the reference posture
    found: np.ndarray  # [T] bool, False: no frame fits, it is the target's first frame
    # Frame at which a blow hits, the pelvis passes the obstacle, or, of who passes nothing, the
    # body is lowest (under) or highest (over).
    contact: np.ndarray  # [T] int64
    # Where the object is then, in the facing frame of frame ``hierarchy.targets.start``: the tip of
    # the limb; of obstacles the point of the ground below the pelvis.
    place: np.ndarray  # [T, 3] m
    # Under: height of the underside of the lowest bar across the way there that the whole body
    # passes under; over: of the top of the highest hurdle. Of who passes nothing, of the body's
    # highest or lowest point then. Strikes: 0.
    clear: np.ndarray  # [T] m
    way: np.ndarray  # [T] rad to the left of where the start faces: the way that it goes
    past: np.ndarray  # [T] int64, frame from which on the object is left behind

    def __post_init__(self) -> None:
        cores, count = len(self.hierarchy.cores), len(self.hierarchy.targets)
        freeze(self, "preparing", what=(np.int32, ("L",)), found=(np.bool_, (count,)))
        for name in ("kind", "limb"):
            freeze(self, "preparing", **{name: (np.int32, (count,))})
        for name in ("reference", "contact", "past"):
            freeze(self, "preparing", **{name: (np.int64, (count,))})
        freeze(self, "preparing", place=(float, (count, 3)), clear=(float, (count,)))
        freeze(self, "preparing", way=(float, (count,)))
        strikes = self.kind == KINDS.index("strike")
        for wrong, fits in (
            ("a stretch of none of its cores and targets", _within(self.what, -1, cores + count)),
            ("a kind of target that is none", _within(self.kind, 0, len(KINDS))),
            ("a limb that is none", _within(self.limb, -1, len(LIMBS))),
            ("a strike without a limb", np.array_equal(strikes, self.limb != NO_LIMB)),
        ):
            if not fits:
                raise KumiteError(f"preparing: {wrong}")

    def check(self, clips: ClipSet, stretches: int) -> None:
        """Errors: frames that are none of their clips', each in one; stretches of another table."""
        if len(self.what) != stretches:
            raise KumiteError(f"preparing: {len(self.what)} stretches, the table has {stretches}")
        h, clip = self.hierarchy, clips.clip_of_frame
        cores, targets = h.cores, h.targets
        together = (
            ("core", cores.label, cores.start, (cores.stop, h.leave, h.land, h.link_land)),
            (
                "target",
                targets.label,
                targets.start,
                (targets.stop, h.entry.T, h.exit.T, self.reference, self.contact, self.past),
            ),
        )
        frames = (h.link_leave, h.link_first, h.link_last, cores.start, targets.start)
        inside = all(_within(x, 0, len(clips)) for x in frames)
        for what, labels, first, others in together:
            for k, label in enumerate(labels if inside else ()):
                # Frames of a core are rows of what leads out of it, columns of what leads in.
                mine = [x[:, k] if x is h.link_land else x[k] for x in others]
                mine = np.concatenate([np.ravel(x) for x in mine])
                inside &= _within(mine, 0, len(clips))
                if inside and np.any(clip[mine] != clip[first[k]]):
                    raise KumiteError(f"preparing: {what} {label!r} leaves its clip")
        if not inside:
            raise KumiteError(f"preparing: a frame that is none of the {len(clips)} there are")


def is_obstacle(preparing: Preparing, tall: float) -> np.ndarray:
    """Which targets [T] bool get the whole body past a bar or a hurdle that is in the way of who
    stands ``tall`` [m].

    Who passes nothing has left it behind in the frame after contact; who passes takes longer.
    """
    p = preparing
    under = (p.kind == KINDS.index("under")) & (p.clear < UNDER * tall)
    over = (p.kind == KINDS.index("over")) & (p.clear > OVER * tall)
    return (under | over) & (p.past > p.contact + 1)


def _within(index: np.ndarray, low: int, high: int) -> bool:
    return bool(np.all((index >= low) & (index < high)))


@dataclass(frozen=True)
class About:
    """What one target motion is about: see :class:`Preparing`, whose rows they become."""

    kind: int
    limb: int
    contact: int
    place: np.ndarray  # [3] m
    clear: float  # m
    way: float  # rad
    past: int  # frame from which on the object is left behind


def find_about(
    clips: ClipSet,
    strikes: Strikes,
    targets: Targets,
    t: int,
    reference: int,
    body: Body | None = None,
) -> About:
    """What target t is about.

    A blow between mark and stop is a strike: the fastest kick, else the fastest of other blows.
    Arms swing in a jump, legs in a run up to it: whoever clears an obstacle strikes only with a
    foot that is high. An obstacle is one that the body is wholly before at frame ``reference`` (and
    until then) and wholly behind when the target ends: where the bar can be lowest, or the hurdle
    highest, whichever is more out of the way of who stands. strikes: :func:`own_blows`. body: of
    these clips, if it is known.
    """
    start, stop, mark = (int(x[t]) for x in (targets.start, targets.stop, targets.mark))
    moved = clips.world[0][stop, 0] - clips.world[0][start, 0]
    far = float(np.hypot(moved[0], moved[2]))
    facing = clips.facing[start]
    yaw = float(np.arctan2(moved[0], moved[2])) if far >= GOES else float(facing[2])
    passed = _Passing(clips, body or lay_body(clips.skeleton), (start, stop), reference, yaw)
    under, over = passed.under(mark), passed.over(mark)
    clears = passed.passes and (under[1] < UNDER * passed.tall or over[1] > OVER * passed.tall)
    way = float((yaw - facing[2] + np.pi) % (2 * np.pi) - np.pi)
    to_facing = planar_inverse(facing)
    hit = _blow(strikes, mark, stop, KICK * passed.tall if clears else None, clips)
    if hit is not None:
        frame, limb = int(strikes.frame[hit]), int(strikes.limb[hit])
        tip = planar_apply(clips.facing[frame], strikes.tip[frame, limb])
        place = planar_apply(to_facing, tip)
        return About(KINDS.index("strike"), limb, frame, place, 0.0, way, frame + 1)
    ducks = 1.0 - under[1] / passed.tall >= over[1] / passed.tall
    contact, clear = under if ducks else over
    pelvis = clips.world[0][contact, clips.skeleton.joint("pelvis")] * np.array([1.0, 0.0, 1.0])
    kind = KINDS.index("under" if ducks else "over")
    place = planar_apply(to_facing, pelvis)
    return About(kind, NO_LIMB, contact, place, max(clear, 0.0), way, passed.past(contact))


def own_blows(clips: ClipSet, strikes: Strikes) -> Strikes:
    """The strikes that no locomotion has: of who runs only high kicks, and no foot that stands."""
    hips = velocity(clips.world[0][:, clips.skeleton.joint("pelvis")], clips)[strikes.frame]
    runs = np.hypot(hips[:, 0], hips[:, 2]) > RUNS
    foot = np.array([LIMBS[k].endswith("foot") for k in strikes.limb.tolist()], dtype=bool)
    kick = np.array([way == "kick" for way in strike_directions(clips, strikes)], dtype=bool)
    stands = foot & (strikes.tip[strikes.frame, strikes.limb, 1] < ROLLS)
    return only_blows(strikes, kick | ~(runs | stands))


def _blow(
    strikes: Strikes, mark: int, stop: int, least: float | None, clips: ClipSet
) -> int | None:
    """The blow that a target is about, if any. least [m]: height of a foot's tip that counts while
    the body clears an obstacle; None: it does not."""
    found = np.flatnonzero((strikes.frame >= mark) & (strikes.frame <= stop))
    frame, limb = strikes.frame[found], strikes.limb[found]
    foot = np.array([LIMBS[k].endswith("foot") for k in limb.tolist()], dtype=bool)
    if least is not None:
        high = foot & (strikes.tip[frame, limb, 1] >= least)
        found, frame, limb, foot = found[high], frame[high], limb[high], foot[high]
    if len(found) == 0:
        return None
    order = np.lexsort((-strikes.speed[frame, limb], ~foot))
    return int(found[order[0]])


class _Passing:
    """The body of one target swept along its way."""

    def __init__(
        self, clips: ClipSet, body: Body, ends: tuple[int, int], reference: int, yaw: float
    ) -> None:
        clip = int(clips.clip_of_frame[ends[0]])
        first, last = (int(f) for f in clips.clip_start[clip : clip + 2])
        # All frames that a stretch may play: it is entered sooner or later, and left likewise.
        self.first = max(ends[0] - round(ENTRY * clips.fps), first)
        stop = min(ends[1] + round(RETURN * clips.fps) + 1, last)
        position, world = (x[self.first : stop] for x in clips.world)
        ends_of = [
            position[:, body.joint] + rotate(world[:, body.joint], x)
            for x in (body.start, body.end)
        ]
        way = np.array([np.sin(yaw), np.cos(yaw)])
        pelvis = position[:, clips.skeleton.joint("pelvis")]
        self.along = pelvis[:, [0, 2]] @ way
        reach = float(max(np.linalg.norm(x - pelvis[:, None], axis=2).max() for x in ends_of)) + 0.5
        self.origin = float(self.along.min()) - reach
        places = int(np.ceil((self.along.max() + reach - self.origin) / PLACE))
        top, low = np.full(places, -np.inf), np.full(places, np.inf)
        self.span, self.height = np.empty((len(position), 2)), np.empty((len(position), 2))
        kernels.sweep(
            *ends_of,
            body.radius_start,
            body.radius_end,
            way,
            self.origin,
            PLACE,
            PIECE,
            top,
            low,
            self.span,
            self.height,
        )
        # An obstacle at a place has the margin on either side of it.
        wide = 2 * int(np.ceil(MARGIN / PLACE)) + 1
        self.top, self.low = maximum_filter1d(top, wide), minimum_filter1d(low, wide)
        self.tall = float(np.ptp(self.height[ends[0] - self.first]))
        self.stop = ends[1]
        before = float(self.span[: reference - self.first + 1, 1].max()) + MARGIN
        behind = float(self.span[ends[1] - self.first, 0]) - MARGIN
        frames = np.arange(reference, ends[1] + 1)
        at = self.along[frames - self.first]
        self.candidates = frames[(at > before) & (at < behind)]

    @property
    def passes(self) -> bool:
        """Whether there is a place that the whole body goes past."""
        return len(self.candidates) > 0

    def under(self, mark: int) -> tuple[int, float]:
        """Frame at which the pelvis passes the lowest bar, and the bar's height [m]."""
        if not self.passes:
            top = self.height[mark - self.first : self.stop - self.first + 1, 1]
            return mark + int(np.argmin(top)), float(top.min())
        top = self.top[self._place(self.candidates)]
        return int(self.candidates[np.argmin(top)]), float(top.min())

    def over(self, mark: int) -> tuple[int, float]:
        """Frame at which the pelvis passes the highest hurdle, and the hurdle's height [m]."""
        if not self.passes:
            low = self.height[mark - self.first : self.stop - self.first + 1, 0]
            return mark + int(np.argmax(low)), float(low.max())
        low = self.low[self._place(self.candidates)]
        return int(self.candidates[np.argmax(low)]), float(low.max())

    def past(self, contact: int) -> int:
        """The first frame from which on the body is behind what is there at frame ``contact``."""
        if not self.passes:
            return contact + 1
        at = self.along[contact - self.first] + MARGIN
        rows = slice(contact - self.first, self.stop - self.first + 1)
        return contact + int(np.flatnonzero(self.span[rows, 0] <= at)[-1]) + 1

    def _place(self, frames: np.ndarray) -> np.ndarray:
        return np.floor((self.along[frames - self.first] - self.origin) / PLACE).astype(np.int64)
