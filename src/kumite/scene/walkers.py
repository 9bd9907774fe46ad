"""People who walk to places and prepare on the way for what they will do there (Shum et al. 2013).

K characters as arrays: a cast plays cores and target motions, a :class:`Preparation` bends what it
plays, and a :class:`Guide` chooses. Who, where and what for, the scene says anew in every frame.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kumite.control.guide import Guide, seen, steered_for
from kumite.errors import KumiteError
from kumite.rotation import (
    angle,
    conjugate,
    from_yaw,
    multiply,
    planar_apply,
    planar_compose,
    planar_inverse,
    wrap_angle,
)
from kumite.synthesis import Cast, LevelFilter, Moment, Preparation, References, references

PREPARATIONS = ("ours", "linear", "none")
ON_THE_WAY = -1  # what somebody does who does no target motion
NOTHING = -1  # what somebody prepares for who prepares for nothing

CLOSE = 0.10  # m from its place: near enough for the motion that is done there
OFF, ASKEW = 0.35, np.radians(30)  # m and rad that a target motion may be bent to fit, at most
PATIENCE = 0.4  # s without getting nearer to its place, then it must do
NEAR = 0.6  # m within which it may turn freely
ARRIVED = 0.8  # m from a place where nothing is to be done: there a walk is ended
KEEP = 2.5  # m to the next place: nearer, and the style is kept up until then
POSTURE_HALF_LIFE = 0.12  # s in which one reference posture becomes another
READY = 0.5  # level from which on a target motion is begun at its reference posture


class Walkers:
    """Arrays are overwritten by each frame."""

    def __init__(
        self,
        guide: Guide,
        homes: np.ndarray,
        event: Callable[..., None],
        *,
        preparation: str = "ours",
        curve: np.ndarray | None = None,
    ) -> None:
        """homes [K, 3]: facing frames to begin at. curve: C, [J] or [T, J] of each target. event is
        told (kind, character, **data)."""
        library = guide.library
        preparing = library.preparing
        if preparing is None:
            raise KumiteError("walkers: the library is not one for preparation")
        self.guide, self.library, self.event = guide, library, event
        self.preparing, self.fps = preparing, library.clips.fps
        self.prepares = preparation != "none"
        count = len(homes)
        clips, skeleton = library.clips, library.clips.skeleton
        self.like = references(clips, preparing.reference)
        everyone = np.zeros(count, dtype=np.int64)
        given = None if curve is None else np.broadcast_to(curve, self.like.wxyz.shape[:2])
        self.curve = given
        postures = References(
            self.like.wxyz[everyone], self.like.root[everyone], self.like.ankle[everyone]
        )
        self.shown = Preparation(
            skeleton, self.fps, postures, count, curve=None if given is None else given[everyone]
        )
        self.cast = Cast(library, count)
        self.filter = LevelFilter(count, self.fps)
        self.goal = np.array(homes)  # [K, 3] where to be, with what heading (NaN: any)
        self.source = np.zeros((count, 2))  # of influence
        self.wants = np.full(count, NOTHING)  # the target motion prepared for
        self.doing = np.full(count, ON_THE_WAY)  # the target motion done
        self.level = np.zeros(count)  # chosen
        self.alpha = np.zeros(count)  # shown
        self.heeds = np.ones(count, dtype=bool)  # comes to rest at its place by itself
        self._since = np.zeros(count, dtype=np.int64)  # frames of the motion done
        self._heed_now = np.zeros(count, dtype=bool)  # something has changed: decide at once
        self._nearest = np.full(count, np.inf)  # m to its place, so far
        self._waited = np.zeros(count, dtype=np.int64)  # frames since
        self._object = np.zeros((count, 3))  # of the target motion done
        self._way = np.full(count, np.nan)  # heading that it is to have at contact
        self._span = np.zeros((count, 2), dtype=np.int64)  # frames first and contact
        cores = preparing.hierarchy.cores
        self._stand = int(np.argmin(np.abs(cores.speed)))
        self.row = np.full(count, guide.row_of(self._stand))
        self._cycle = np.maximum(1, np.round(cores.seconds * self.fps).astype(np.int64))
        table = library.table
        begins = np.flatnonzero(np.isin(table.state_frame, cores.stop[self._stand]))
        for k, home in enumerate(homes):
            self.cast.place(k, int(begins[0]), home)
        self.cast.show(0.0)
        for k, home in enumerate(homes):
            self.shown.place(k, self.cast.facing[k], home)
        self._posture_of = np.zeros(count, dtype=np.int64)
        self._settled = np.ones(count, dtype=bool)
        self.shown.show_cast(self.cast, self.alpha, np.arange(count))
        self._before = (self.shown.root_position.copy(), self.shown.wxyz.copy())

    @property
    def facing(self) -> np.ndarray:
        """Where they are [K, 3]."""
        return self.shown.facing

    # What a target motion needs.

    def place_from(self, t: np.ndarray, frame: np.ndarray) -> np.ndarray:
        """Where the object of targets t [N] is to be at contact [N, 3], seen from the facing frames
        of frames [N] of theirs."""
        clips, p = self.library.clips, self.preparing
        start = clips.facing[p.hierarchy.targets.start[t]]
        return planar_apply(
            planar_compose(planar_inverse(clips.facing[frame]), start), p.place[t]
        )

    def begins_at(self, t: np.ndarray) -> np.ndarray:
        """The frame [N] that target motions t are planned to be begun at."""
        p = self.preparing
        if self.prepares:
            return p.reference[t]
        best = np.argmin(p.hierarchy.entry_distance, axis=0)
        return p.hierarchy.entry[best[t], t]

    def stance(self, t: np.ndarray, place: np.ndarray, here: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """Where [N, 3] to begin targets t for objects at places [N, 3] m, coming from facing frames
        here [N, 3]. normal [N]: the way through an obstacle; NaN: from wherever one comes."""
        frame = self.begins_at(t)
        p = self.place_from(t, frame)
        way = place[:, [0, 2]] - here[:, :2]
        heading = np.arctan2(way[:, 0], way[:, 1]) - np.arctan2(p[:, 0], p[:, 2])
        clips = self.library.clips
        turned = clips.facing[frame, 2] - clips.facing[self.preparing.hierarchy.targets.start[t], 2]
        through = normal - self.preparing.way[t] + turned
        heading = wrap_angle(np.where(np.isnan(normal), heading, through))
        c, s = np.cos(heading), np.sin(heading)
        x = place[:, 0] - (c * p[:, 0] + s * p[:, 2])
        z = place[:, 2] - (-s * p[:, 0] + c * p[:, 2])
        return np.stack([x, z, heading], axis=1)

    def seconds_to_contact(self, t: np.ndarray) -> np.ndarray:
        """From the beginning of targets [N] to their contact."""
        return (self.preparing.contact[t] - self.begins_at(t)) / self.fps

    # What the scene asks for.

    def decide_anew(self, who: np.ndarray) -> None:
        """Something has changed for characters: they choose again as soon as they can."""
        self._heed_now[who] = True
        self._nearest[who], self._waited[who] = np.inf, 0

    def ready(self) -> np.ndarray:
        """Who [N] is where its target motion may begin, or as near to it as it comes."""
        way = (self.doing == ON_THE_WAY) & (self.wants != NOTHING)
        off, askew = self.off()
        nearer = off < self._nearest - 0.01
        self._nearest = np.where(nearer, off, self._nearest)
        self._waited = np.where(nearer, 0, self._waited + 1)
        fits = (off <= OFF) & (askew <= ASKEW)
        prepared = self.alpha >= READY if self.prepares else np.ones(len(off), dtype=bool)
        late = self._waited >= (PATIENCE * self.fps if self.prepares else 1)
        return np.flatnonzero(way & fits & ((prepared & (off <= CLOSE)) | late))

    def off(self) -> tuple[np.ndarray, np.ndarray]:
        """How far all are from their places [K] m, and from their headings [K] rad."""
        away = np.hypot(*(self.goal[:, :2] - self.facing[:, :2]).T)
        askew = np.abs(wrap_angle(np.nan_to_num(self.goal[:, 2] - self.facing[:, 2])))
        return away, askew

    def launch(self, k: int, t: int, place: np.ndarray | None = None, normal: float = np.nan) -> None:
        """Let character k begin target t now, from the pose it shows.

        place [3] m: of the object: the motion is bent to meet it; None: as captured. normal: the
        way through it. Begun at the reference posture by who is prepared, else where, up to the
        mark, the motion is most like what is shown.
        """
        p, clips, cast = self.preparing, self.library.clips, self.cast
        h = p.hierarchy
        now = Moment.between(
            np.stack([self._before[0][k], self.shown.root_position[k]]),
            np.stack([self._before[1][k], self.shown.wxyz[k]]),
            self.fps,
        )
        first, apart = self._best_beginning(k, t)
        core = int(np.argmin(np.where(h.returns[:, t], h.exit_distance[:, t], np.inf)))
        cast.adopt(k, first, int(h.exit[core, t]), now)
        self.shown.place(k, cast.facing[k], cast.facing[k])
        self.doing[k], self._heed_now[k] = t, False
        self.filter.restart(k, 0.0)
        self._span[k] = first, p.contact[t]
        self._object[k] = np.nan if place is None else place
        start = clips.facing[h.targets.start[t], 2]
        way = normal - p.way[t] - start  # the anchor's turn that would have it
        self._way[k] = way
        self.event(
            "launch",
            k,
            motion=h.targets.label[t],
            level=round(float(self.alpha[k]), 4),
            apart=round(apart, 4),
            to_contact=round((int(p.contact[t]) - first) / self.fps, 4),
            turned=round(float(np.linalg.norm(now.joint_velocity)), 3),
        )

    def _best_beginning(self, k: int, t: int) -> tuple[int, float]:
        """The frame to begin target t at, and how far its pose is from what is shown [rad]."""
        p, clips = self.preparing, self.library.clips
        h = p.hierarchy
        if self.prepares and self.alpha[k] >= READY:
            frames = np.array([p.reference[t]])
        else:
            frames = np.arange(int(h.entry[:, t].min()), int(h.targets.mark[t]) + 1)
        mine = self.shown.wxyz[k].copy()
        mine[0] = multiply(from_yaw(-self.facing[k, 2]), mine[0])
        theirs = clips.wxyz[frames].copy()
        theirs[:, 0] = multiply(from_yaw(-clips.facing[frames, 2]), theirs[:, 0])
        apart = np.sqrt(np.mean(angle(theirs, mine[None]) ** 2, axis=1))
        best = int(np.argmin(apart))
        return int(frames[best]), float(apart[best])

    # A frame.

    def advance(self) -> None:
        """Everyone one frame on."""
        cast, guide = self.cast, self.guide
        self._before = (self.shown.root_position.copy(), self.shown.wxyz.copy())
        self._choose(cast.waiting)
        cast.advance()
        busy = self.doing != ON_THE_WAY
        smooth = self.filter.push(np.where(busy, 0.0, self.level))
        off, _ = self.off()
        bearing = seen(self.facing, steered_for(self.facing, self.goal))[1]
        rests = self.heeds & (self.wants != NOTHING) & ~busy & (np.abs(bearing) < 0.5 * np.pi)
        self.alpha = np.where(busy, 0.0, smooth)
        if self.prepares:
            self.alpha = np.where(rests, np.maximum(smooth, guide.settle(off)), self.alpha)
        near = off < NEAR
        askew = np.nan_to_num(wrap_angle(self.goal[:, 2] - self.facing[:, 2]))
        square = np.clip(1.0 - off / NEAR, 0.0, 1.0) * ~np.isnan(self.goal[:, 2])
        turn = guide.turn(self.row, (1 - square) * bearing + square * askew, near, self.alpha)
        shift = np.zeros((len(off), 3))
        shift[:, 2] = np.where(busy, 0.0, turn / self.fps)
        self._meet(shift)
        self._lead()
        self.shown.show_cast(cast, self.alpha, np.arange(len(off)), shift)

    def _choose(self, who: np.ndarray) -> None:
        """Those at the end of what they play take what comes next."""
        if len(who) == 0:
            return
        cast, guide, preparing = self.cast, self.guide, self.preparing
        self._end_targets(who)
        played = self._core_of_frame[cast.stop[who]]
        core = guide.approach.core[self.row[who]]
        self._since[who] += np.where(played == core, self._frames_played(who), 0)
        due = self._heed_now[who] | ((played == core) & (self._since[who] >= 0.8 * self._cycle[core]))
        if np.any(due):
            self._decide(who[due])
        state = np.searchsorted(self.library.table.state_frame, cast.stop[who])
        stretch = np.zeros(cast.count, dtype=np.int64)
        stretch[who] = guide.onward[state, guide.approach.core[self.row[who]]]
        cast.begin(who, stretch)
