"""People who walk to places and prepare on the way for what they will do there (Shum et al. 2013).

K characters as arrays: a cast plays cores and target motions, a :class:`Preparation` bends what it
plays, and a :class:`Guide` chooses. Who, where and what for, the scene says anew in every frame.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from kumite.clip import SIDES, ClipSet
from kumite.control.approaching import MOVES
from kumite.control.guide import Guide, seen, steered_for
from kumite.errors import KumiteError
from kumite.graph.distance import pose_features, squared_distances
from kumite.rotation import (
    angle,
    from_yaw,
    multiply,
    planar_apply,
    planar_compose,
    planar_inverse,
    wrap_angle,
)
from kumite.scene.events import Decision, Done, Event, Launch
from kumite.scene.starts import draw_starts
from kumite.synthesis import Cast, LevelFilter, Moment, Preparation, References, references
from kumite.synthesis.preparation import blended

ON_THE_WAY = -1  # what somebody does who does no target motion
NOTHING = -1  # what somebody prepares for who prepares for nothing

CLOSE = 0.10  # m from its place: near enough for the motion that is done there
SQUARE = np.radians(12)  # off its heading: so too
OFF, ASKEW = 0.35, np.radians(30)  # m and rad that a target motion may be bent to fit, at most
PATIENCE, LONGEST_PATIENCE = 0.4, 1.5  # s without getting nearer, prepared or not yet: it must do
NO_PATIENCE = 0.05  # s, of who does not prepare: it is past its place
SHARP = np.radians([35, 90])  # angles between which a turn gets sharp
ON_THE_SPOT = 0.85  # of the way that is not gone in a sharp turn …
SLOWS = 2.5  # … and how fast that share changes, 1/s
STARTS_TURNING = 15.0  # rad/s², how fast a turn begins and ends
NEAR = 0.6  # m within which it may turn freely
AWRY = np.radians(60)  # off its heading: as bad as a cell off its place
ARRIVED = 0.8  # m from a place where nothing is to be done: there a walk is ended
KEEP = 2.5  # m to the next place: nearer, and the style is kept up until then
POSTURE_HALF_LIFE = 0.12  # s in which one reference posture becomes another
READY = 0.5  # level from which on a target motion is begun at its reference posture
WHOLE = 0.8  # of a cycle after which it counts as done: it is entered anywhere
STEEPEST = 3.0  # 1/s, of the level shown: the filter's own
UNSEEN = 0.01  # level below which nobody sees what posture is prepared for
ALIKE = 1e-3  # of a quaternion, or m: postures nearer to each other are the same


class Walkers:
    """Arrays are overwritten by each frame."""

    def __init__(
        self,
        guide: Guide,
        names: Sequence[str],
        homes: np.ndarray,
        tell: Callable[[Event], None],
        streams: Sequence[np.random.Generator] = (),
        *,
        preparation: str = "ours",
        curve: np.ndarray | None = None,
    ) -> None:
        """names [K]; homes [K, 3]: facing frames to begin at. curve: C, [J] or [T, J] of each
        target. tell: is told of decisions, and of motions begun and done. streams [K]: what each
        draws its start from; none: all begin in one pose.
        """
        library = guide.library
        preparing = library.preparing
        if preparing is None:
            raise KumiteError("walkers: the library is not one for preparation")
        self.guide, self.library, self.names, self.tell = guide, library, tuple(names), tell
        self.frame = 0  # of the scene
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
        self.mix = np.zeros((count, len(self.like)))  # how sure that is; all 0: it is certain
        self.doing = np.full(count, ON_THE_WAY)  # the target motion done
        self.level = np.zeros(count)  # chosen
        self.alpha = np.zeros(count)  # shown
        self.heeds = np.ones(count, dtype=bool)  # its goal is where wants is to be done
        self.push = np.zeros((count, 2))  # m in the next frame: somebody is in the way
        self.active = np.ones(count, dtype=bool)  # the others are played by somebody else
        self._stretch = np.full(count, NOTHING)  # of the table, played; or part of one
        self._since = np.zeros(count, dtype=np.int64)  # frames of the motion chosen
        self._heed_now = np.ones(count, dtype=bool)  # something has changed: decide at once
        self._nearest = np.full(count, np.inf)  # m to its place, so far
        self._waited = np.zeros(count, dtype=np.int64)  # frames since
        self._object = np.zeros((count, 3))  # of the target motion done
        self._way = np.full(count, np.nan)  # heading that it is to have at contact
        self._span = np.zeros((count, 2), dtype=np.int64)  # frames first and contact
        self._earlies: dict[tuple[int, int], tuple[int, int, int]] = {}
        self._cores_frames: np.ndarray | None = None  # of all cores, for who enters
        cores = preparing.hierarchy.cores
        self._goes = cores.speed > MOVES
        self._stand = int(np.argmin(np.abs(cores.speed)))
        self.row = np.zeros(count, dtype=np.int64)  # the motion chosen, of the approach
        self.stands = np.ones(count, dtype=bool)  # or rather stays where it is
        self._slow = np.zeros(count)  # share of the way that is not gone, in sharp turns
        self._turn = np.zeros(count)  # rad/s, besides what the locomotion turns
        states, links = library.table.state_frame, preparing.hierarchy
        out = np.searchsorted(states, links.link_leave[self._stand])
        self._leave_stand = np.where(links.links[self._stand], out, NOTHING)
        self._cycle = np.maximum(1, np.round(cores.seconds * self.fps).astype(np.int64))
        for k, (stretch, frame) in enumerate(zip(*self._starts(streams, count))):
            self.cast.place(k, int(library.table.target[stretch]), homes[k], frame=int(frame))
        self.cast.show(0.0)
        for k, home in enumerate(homes):
            self.shown.place(k, self.cast.facing[k], home)
        self._posture_of = np.zeros(count, dtype=np.int64)
        self._settled = np.ones(count, dtype=bool)
        self.shown.show_cast(self.cast, self.alpha, np.arange(count))
        self._before = (self.shown.root_position.copy(), self.shown.wxyz.copy())
        # Joints and their world rotations a frame ago.
        self.shown_before = (self.shown.position.copy(), self.shown.world_wxyz.copy())
        self._settled[:] = False

    def _starts(
        self, streams: Sequence[np.random.Generator], count: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """The stretch [K] and the frame [K] in which all begin: they stand, and who would do so in
        step with another goes."""
        table, what = self.library.table, self.preparing.what
        stand = np.flatnonzero(what == self._stand)
        if not streams:
            last = stand[np.argmax(table.last[stand])]
            return np.full(count, last), np.full(count, table.last[last])
        goes = np.flatnonzero(np.isin(what, np.flatnonzero(self._goes)))
        return draw_starts(self.library, stand, streams, otherwise=goes)

    @property
    def facing(self) -> np.ndarray:
        """Where they are [K, 3]."""
        return self.shown.facing

    # Who comes and goes.

    def enter(self, k: int, frame: int, now: Moment) -> None:
        """Let character k walk from now on, from a pose that is like a library frame."""
        self._begin_at(k, *self._core_like(frame), now)
        self.doing[k], self.level[k], self.alpha[k] = ON_THE_WAY, 0.0, 0.0
        self.filter.restart(k, 0.0)
        self.active[k], self.stands[k] = True, False
        self._stretch[k], self._turn[k], self._slow[k] = NOTHING, 0.0, 0.0
        self.decide_anew(np.array([k]))

    def leave(self, k: int) -> Moment:
        """Character k is played by somebody else from now on; what it shows, and how it moves."""
        self.active[k], self.doing[k] = False, ON_THE_WAY
        self.level[k] = self.alpha[k] = 0.0
        return self._moment(k)

    def follow(self, k: int, facing: np.ndarray) -> None:
        """Character k, who is played by somebody else, is at a facing frame [3] now."""
        self.shown.place(k, self.cast.facing[k], facing)
        self.shown.facing[k] = facing

    def _begin_at(self, k: int, land: int, stop: int, now: Moment) -> None:
        self.cast.adopt(k, land, stop, now)
        self.shown.place(k, self.cast.facing[k], self.cast.facing[k])
        self.shown.facing[k] = self.cast.facing[k]
        self.shown.root_position[k], self.shown.wxyz[k] = now.root_position, now.wxyz

    def _core_like(self, frame: int) -> tuple[int, int]:
        """The frame of a core that is most like a library frame, and where it comes to a state."""
        if self._cores_frames is None:
            cores = self.preparing.hierarchy.cores
            self._cores_frames = np.concatenate(
                [np.arange(a + 1, b) for a, b in zip(cores.start.tolist(), cores.stop.tolist())]
            )
            self._features = pose_features(self.library.clips)
        away = squared_distances(self._features, np.array([frame]), self._cores_frames)[0]
        land = int(self._cores_frames[np.argmin(away)])
        states = self.library.table.state_frame
        return land, int(states[np.searchsorted(states, land, side="right")])

    # What a target motion needs.

    def place_from(self, t: np.ndarray, frame: np.ndarray) -> np.ndarray:
        """Where the object of targets t [N] is to be at contact [N, 3], seen from the facing frames
        of frames [N] of theirs."""
        clips, p = self.library.clips, self.preparing
        start = clips.facing[p.hierarchy.targets.start[t]]
        return planar_apply(planar_compose(planar_inverse(clips.facing[frame]), start), p.place[t])

    def begins_at(self, t: np.ndarray) -> np.ndarray:
        """The frame [N] that target motions t are planned to be begun at."""
        p = self.preparing
        if self.prepares:
            return p.reference[t]
        best = np.argmin(p.hierarchy.entry_distance, axis=0)
        return p.hierarchy.entry[best[t], t]

    def stance(
        self, t: np.ndarray, place: np.ndarray, here: np.ndarray, normal: np.ndarray
    ) -> np.ndarray:
        """Where [N, 3] to begin targets t for objects at places [N, 3] m, coming from facing frames
        here [N, 3]. normal [N]: the way through an obstacle; NaN: from wherever one comes."""
        frame = self.begins_at(t)
        p = self.place_from(t, frame)
        way = place[:, [0, 2]] - here[:, :2]
        away = np.maximum(np.hypot(way[:, 0], way[:, 1]), 1e-9)
        # Straight on from here, the object comes to be as far aside as it is to be.
        aside = np.arcsin(np.clip(p[:, 0] / away, -1.0, 1.0))
        heading = np.arctan2(way[:, 0], way[:, 1]) - aside
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
        way = (self.doing == ON_THE_WAY) & (self.wants != NOTHING) & self.heeds & self.active
        off, askew = self.off()
        miss = off + NEAR * askew / AWRY  # who turns gets nearer
        nearer = miss < self._nearest - 0.01
        self._nearest = np.where(nearer, miss, self._nearest)
        self._waited = np.where(nearer, 0, self._waited + 1)
        fits = (off <= OFF) & (askew <= ASKEW)
        prepared = self.alpha >= READY if self.prepares else np.ones(len(off), dtype=bool)
        patience = np.where(self.alpha >= READY, PATIENCE, LONGEST_PATIENCE)
        late = self._waited >= (patience if self.prepares else NO_PATIENCE) * self.fps
        there = (off <= CLOSE) & (askew <= SQUARE)
        return np.flatnonzero(way & fits & ((prepared & there) | late))

    def off(self) -> tuple[np.ndarray, np.ndarray]:
        """How far all are from their places [K] m, and from their headings [K] rad."""
        away = np.hypot(*(self.goal[:, :2] - self.facing[:, :2]).T)
        askew = np.abs(wrap_angle(np.nan_to_num(self.goal[:, 2] - self.facing[:, 2])))
        return away, askew

    def launch(
        self, k: int, t: int, place: np.ndarray | None = None, normal: float = np.nan
    ) -> None:
        """Let character k begin target t now, from the pose it shows.

        place [3] m: of the object: the motion is bent to meet it, if that takes no more than
        ``OFF`` and ``ASKEW``; None: as captured. normal: the way through it. Begun at the reference
        posture by who is prepared, else where, up to the mark, the motion is most like what is
        shown.
        """
        p, clips, cast = self.preparing, self.library.clips, self.cast
        h, now = p.hierarchy, self._moment(k)
        first, apart = self._best_beginning(k, t)
        core = int(np.argmin(np.where(h.returns[:, t], h.exit_distance[:, t], np.inf)))
        cast.adopt(k, first, int(h.exit[core, t]), now)
        self.shown.place(k, cast.facing[k], cast.facing[k])
        self.doing[k], self._heed_now[k], self._stretch[k] = t, False, NOTHING
        self.filter.restart(k, 0.0)
        self._span[k] = first, p.contact[t]
        self._object[k], self._way[k], off = np.nan, np.nan, None
        if place is not None:
            which, here = np.array([t]), self.facing[k]
            goal = self.stance(which, place[None], here[None], np.array([normal]))[0]
            off = round(float(np.hypot(*(goal[:2] - here[:2]))), 4)
            if off <= OFF and np.abs(wrap_angle(goal[2] - here[2])) <= ASKEW:
                self._object[k] = place
                # The turn of the capture that makes it face as it should.
                self._way[k] = goal[2] - clips.facing[self.begins_at(which)[0], 2]
        self.tell(
            Launch(
                self.frame,
                self.names[k],
                motion=self._label(t),
                level=float(self.alpha[k]),
                apart_deg=float(np.degrees(apart)),
                to_contact=(int(p.contact[t]) - first) / self.fps,
                bent=off if np.isfinite(self._way[k]) else None,
            )
        )

    def _best_beginning(self, k: int, t: int) -> tuple[int, float]:
        """The frame to begin target t at, and how far its pose is from what is shown [rad]."""
        p, clips = self.preparing, self.library.clips
        h = p.hierarchy
        if self.prepares and self.alpha[k] >= READY:
            frames = np.array([p.reference[t]])
        else:
            frames = np.arange(int(h.entry[:, t].min()), int(h.targets.mark[t]) + 1)
        mine = headless(self.shown.wxyz[k][None], self.facing[k, 2][None])
        theirs = headless(clips.wxyz[frames], clips.facing[frames, 2])
        apart = np.sqrt(np.mean(angle(theirs, mine) ** 2, axis=1))
        best = int(np.argmin(apart))
        return int(frames[best]), float(apart[best])

    # A frame.

    def advance(self) -> None:
        """Everyone one frame on."""
        cast, shown = self.cast, self.shown
        self._before = (shown.root_position.copy(), shown.wxyz.copy())
        self.shown_before = (shown.position.copy(), shown.world_wxyz.copy())
        self._leave_early()
        self._choose(cast.waiting)
        came_from = cast.facing
        cast.advance()
        busy = self.doing != ON_THE_WAY
        smooth = self.filter.push(np.where(busy, 0.0, self.level))
        off, _ = self.off()
        bearing = seen(self.facing, steered_for(self.facing, self.goal))[1]
        behind = np.abs(seen(self.facing, self.goal[:, :2])[1]) > 0.5 * np.pi
        past = behind & (off < OFF)
        askew = np.nan_to_num(wrap_angle(self.goal[:, 2] - self.facing[:, 2]))
        self.alpha = self._levels(smooth, busy, off, bearing, askew, past)
        headed = ~np.isnan(self.goal[:, 2])
        # Near the place its heading counts more and more; who must turn round goes there first, and
        # past it only the heading is left.
        near = np.where(np.abs(askew) > 0.5 * np.pi, 2.0 * CLOSE, NEAR)
        square = np.where(behind, past, np.clip((near - off) / (near - CLOSE), 0.0, 1.0))
        square = np.where(headed, square, 0.0)
        by = (1.0 - square) * bearing + square * askew
        turns = square * np.minimum(np.abs(askew) / ASKEW, 1.0)
        there = np.where(self.heeds, turns, np.clip(1.0 - off / ARRIVED, 0.0, 1.0))
        there = np.where(self.stands, 1.0, there)
        shift = self._steer(by, off < NEAR, there, came_from)
        self._meet(np.flatnonzero(busy & np.isfinite(self._object[:, 0])), shift)
        self._lead()
        self.shown.show_cast(cast, self.alpha, np.arange(cast.count), shift)
        self.frame += 1

    def _levels(
        self,
        smooth: np.ndarray,
        busy: np.ndarray,
        off: np.ndarray,
        bearing: np.ndarray,
        askew: np.ndarray,
        past: np.ndarray,
    ) -> np.ndarray:
        """Levels [K] to be shown: the ``smooth`` ones, and near their places as these ask for."""
        alpha = np.where(busy, 0.0, smooth)
        if not self.prepares:
            return alpha
        # Who is askew has as far to go: prepared it could not turn.
        wrong = NEAR * np.abs(askew) / AWRY
        before = (np.abs(bearing) < 0.5 * np.pi) | (off < OFF)  # its place, or at it
        rests = before & self.heeds & (self.wants != NOTHING) & ~busy
        # Who has just passed its place comes no nearer: it prepares where it is.
        left = np.where(past, 0.0, off)
        alpha = np.where(rests, np.maximum(smooth, self.guide.settle(left + wrong)), alpha)
        # Who is to turn at its place turns first, whatever level is chosen: prepared it would take
        # half a minute.
        turned = np.clip(1.0 - (np.abs(askew) - ASKEW) / (AWRY - ASKEW), 0.0, 1.0)
        alpha = np.where(self.heeds & (off < NEAR), np.minimum(alpha, turned), alpha)
        # Who comes to rest, or misses its place after all, does not jump into it or out of it.
        step = STEEPEST / self.fps
        return np.where(busy, 0.0, np.clip(alpha, self.alpha - step, self.alpha + step))

    @property
    def _plays(self) -> np.ndarray:
        """The cores [K] that are played, or NOTHING."""
        return np.where(self._stretch >= 0, self.preparing.what[self._stretch], NOTHING)

    def _steer(
        self,
        by: np.ndarray,
        near: np.ndarray,
        there: np.ndarray,
        came_from: np.ndarray,
    ) -> np.ndarray:
        """What all go and turn [K, 3] in this frame besides their locomotion.

        They turn towards what is seen at angles ``by`` [rad], and in sharp turns they go less far:
        up to nearly on the spot, as where they are ``there`` (0 to 1), but for the heading or the
        end of a step. came_from [K, 3]: where the locomotion was a frame ago.
        """
        alpha, shift = self.alpha, np.zeros((len(by), 3))
        goes = self.doing == ON_THE_WAY
        turn = self.guide.turn(self.row, by, near, alpha)
        turn = np.where(goes & ~self.stands, turn, 0.0)
        most = STARTS_TURNING / self.fps
        self._turn = np.where(goes, self._turn + np.clip(turn - self._turn, -most, most), 0.0)
        shift[:, 2] = self._turn / self.fps
        sharp = np.clip((np.abs(by) - SHARP[0]) / (SHARP[1] - SHARP[0]), 0.0, 1.0)
        goes &= self._plays != self._stand  # nobody is held back who stands
        wanted = np.where(goes, ON_THE_SPOT * np.maximum(sharp, there), 0.0)
        most = SLOWS / self.fps
        self._slow += np.clip(wanted - self._slow, -most, most)
        step = planar_compose(planar_inverse(came_from), self.cast.facing)[:, :2]
        shift[:, :2] -= np.where(goes, self._slow * (1.0 - alpha), 0.0)[:, None] * step
        pushed = np.flatnonzero(np.any(self.push != 0.0, axis=1))
        shift[pushed, :2] += turned_by(-self.facing[pushed, 2], self.push[pushed])
        return shift

    def _choose(self, who: np.ndarray) -> None:
        """Those at the end of what they play take what comes next."""
        cast, guide, table = self.cast, self.guide, self.library.table
        plays = self._plays
        # Who stands does not wait for the end of a cycle: all its poses are much alike.
        bored = self._heed_now & (plays == self._stand)
        who = np.union1d(who, np.flatnonzero(bored))
        if len(who) == 0:
            return
        ended = who[self.doing[who] != ON_THE_WAY]
        if len(ended):
            self._return(ended, 0.0)
        plays, core = plays[who], self._core(who)
        frames = (table.last - table.first + 1)[self._stretch[who]]
        self._since[who] += np.where(plays == core, frames, 0)
        stops = ~self.heeds & ~self.stands & (self.off()[0] < ARRIVED)
        due = self._heed_now[who] | stops[who] | (self._since[who] >= WHOLE * self._cycle[core])
        if np.any(due):
            self._decide(who[due])
        core = self._core(who)
        state = np.searchsorted(table.state_frame, cast.stop[who])
        leaves = bored[who] & (core != self._stand) & (self._leave_stand[core] >= 0)
        state = np.where(leaves, self._leave_stand[core], state)
        self._stretch[who] = guide.onward[state, core]
        cast.begin(who, self._stretch)
        for k in who[due & self.active[who]].tolist():
            self.tell(
                Decision(
                    self.frame,
                    self.names[k],
                    by="prepare",
                    stretch=int(self._stretch[k]),
                    jump=bool(cast.jump[k]),
                    level=float(self.level[k]),
                )
            )

    def _core(self, who: np.ndarray) -> np.ndarray:
        """The cores that characters mean to play."""
        chosen = self.guide.approach.core[self.row[who]]
        return np.where(self.stands[who], self._stand, chosen)

    def _decide(self, who: np.ndarray) -> None:
        """The motion and the level of preparation that the controller chooses."""
        facing, goal, guide = self.facing[who], self.goal[who], self.guide
        nothing = self.wants[who] == NOTHING
        away, _ = seen(facing, goal[:, :2])
        _, bearing = seen(facing, steered_for(facing, goal))
        far, aside = seen(facing, self.source[who])
        far = np.where(nothing, guide.policies[0].settings.farthest, far)
        self.row[who], level = guide.choose(
            self.row[who],
            self.level[who],
            (away, bearing),
            (far, np.where(nothing, np.pi, aside)),
            self.wants[who],
        )
        # Who is led elsewhere prepares as if it went to its source: nobody knows what for it goes.
        led = np.flatnonzero(~self.heeds[who] & ~nothing)
        if len(led):
            source = (far[led], aside[led])
            of = who[led]
            level[led] = guide.choose(self.row[of], self.level[of], source, source, self.wants[of])[
                1
            ]
        self.stands[who] = ~self.heeds[who] & (away < ARRIVED)
        unprepared = nothing | (not self.prepares)
        self.level[who] = np.where(unprepared, 0.0, level)
        self._since[who] = 0
        # Who stands goes on looking out for something to do.
        self._heed_now[who] = False

    def _return(self, who: np.ndarray, level: float) -> None:
        """Characters have done their target motions, and are prepared to a level for the next."""
        for k in who.tolist():
            self.tell(Done(self.frame, self.names[k], motion=self._label(int(self.doing[k]))))
        self.doing[who], self.level[who] = ON_THE_WAY, level
        self._stretch[who] = NOTHING
        self.decide_anew(who)

    def _leave_early(self) -> None:
        """Who has another target motion to do close by leaves this one where it is most like the
        posture for the next, and stays in that style (section 7)."""
        if not self.prepares:
            return
        soon = (self.doing != ON_THE_WAY) & (self.wants != NOTHING)
        if not np.any(soon):
            return
        for k in np.flatnonzero(soon & (self.off()[0] <= KEEP)).tolist():
            t, then = int(self.doing[k]), int(self.wants[k])
            frame, land, stop = self._early(t, then)
            if self.cast.frame[k] < frame:
                continue
            if self.cast.frame[k] > frame + 2:
                continue
            self._begin_at(k, land, stop, self._moment(k))
            self._return(np.array([k]), 1.0)
            self._posture_of[k], self._settled[k] = then, False
            self._lead(at_once=np.array([k]))

    def _early(self, t: int, then: int) -> tuple[int, int, int]:
        """Of target t, when ``then`` comes soon: where to leave it, the frame of a walk to go
        on from, and where that comes to a state."""
        if (t, then) in self._earlies:
            return self._earlies[t, then]
        p, clips = self.preparing, self.library.clips
        h, table = p.hierarchy, self.library.table
        frames = np.arange(int(p.past[t]), int(h.exit[:, t].max()) + 1)
        apart = pose_angles(clips, frames, p.reference[then : then + 1])[:, 0]
        frame = int(frames[np.argmin(apart)])
        walk = int(np.argmin(np.where(self._goes, h.exit_distance[:, t], np.inf)))
        cores = h.cores
        cycle = np.arange(cores.start[walk] + 1, cores.stop[walk])
        legs = [clips.skeleton.joint(f"{s}_{x}") for s in SIDES for x in ("thigh", "shin", "foot")]
        away = pose_angles(clips, np.array([frame]), cycle, legs)[0]
        land = int(cycle[np.argmin(away)])
        states = table.state_frame
        stop = int(states[np.searchsorted(states, land, side="right")])
        self._earlies[t, then] = frame, land, stop
        return frame, land, stop

    def _meet(self, who: np.ndarray, shift: np.ndarray) -> None:
        """Bend target motions of characters ``who`` on towards their objects, till contact: a
        share of what is missing in every frame, little at both ends."""
        first, contact = self._span[who].T
        frame = self.cast.frame[who]
        who = who[frame <= contact]
        if len(who) == 0:
            return
        (first, contact), frame = self._span[who].T, self.cast.frame[who]
        u = np.stack([frame - 1 - first, frame - first]) / np.maximum(contact - first, 1)
        before, now = smooth_step(np.clip(u, 0.0, 1.0))
        share = np.where(before < 1.0, (now - before) / np.maximum(1.0 - before, 1e-9), 0.0)
        clips, p = self.library.clips, self.preparing
        t = self.doing[who]
        start = clips.facing[p.hierarchy.targets.start[t]]
        anchor = planar_compose(self.shown.lag[who], self.cast.anchor[who])
        there = planar_apply(anchor, planar_apply(start, p.place[t]))
        askew = wrap_angle(self._way[who] - anchor[:, 2])
        here = self.facing[who]
        there = here[:, :2] + turned_by(askew, there[:, [0, 2]] - here[:, :2])  # once it has turned
        off = (self._object[who][:, [0, 2]] - there) * share[:, None]
        shift[who, :2] = turned_by(-here[:, 2], off)
        shift[who, 2] = askew * share

    def aim(self, k: int, place: np.ndarray) -> None:
        """The object [3] m of the target motion that character k does has moved."""
        if np.isfinite(self._object[k, 0]):
            self._object[k] = place

    def _lead(self, at_once: np.ndarray | None = None) -> None:
        """Let reference postures become those of what is prepared for now."""
        wants = np.where(self.wants == NOTHING, self._posture_of, self.wants)
        mixed = self.mix.sum(axis=1) > 0.0
        self._settled &= (wants == self._posture_of) & ~mixed
        self._posture_of = wants
        who = np.flatnonzero(~self._settled) if at_once is None else at_once
        if len(who) == 0:
            return
        share = 1.0 - 0.5 ** (1.0 / (self.fps * POSTURE_HALF_LIFE))
        share = np.where(self.alpha[who] < UNSEEN, 1.0, share)
        if at_once is not None:
            share = np.ones(len(who))
        like, which, curve = self.like, wants[who], self.curve
        if np.any(mixed[who]):
            sure = np.eye(len(like))[which]
            weight = np.where(mixed[who, None], self.mix[who], sure)
            weight = weight / weight.sum(axis=1, keepdims=True)
            like, which = blended(like, weight), np.arange(len(who))
            curve = None if curve is None else weight @ curve
        left = self.shown.lead(who, like, which, share, None if curve is None else curve[which])
        self._settled[who] = (left < ALIKE) & ~mixed[who]

    def _moment(self, k: int) -> Moment:
        """What character k shows, and how it moves."""
        root, turns = self._before
        return Moment.between(
            np.stack([root[k], self.shown.root_position[k]]),
            np.stack([turns[k], self.shown.wxyz[k]]),
            self.fps,
        )

    def _label(self, t: int) -> str:
        return self.preparing.hierarchy.targets.label[t]


def turned_by(yaw: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Ways [N, 2] (x, z) turned by angles [N]."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.stack([c * way[:, 0] + s * way[:, 1], -s * way[:, 0] + c * way[:, 1]], axis=1)


def smooth_step(u: np.ndarray) -> np.ndarray:
    return u * u * (3.0 - 2.0 * u)


def pose_angles(
    clips: ClipSet, a: np.ndarray, b: np.ndarray, joints: Sequence[int] | None = None
) -> np.ndarray:
    """Root mean squares [A, B] rad of the joints' angles between frames' poses, headings aside."""
    x, y = (headless(clips.wxyz[f], clips.facing[f, 2]) for f in (a, b))
    if joints is not None:
        x, y = x[:, joints], y[:, joints]
    return np.sqrt(np.mean(angle(x[:, None], y[None]) ** 2, axis=-1))


def headless(wxyz: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Poses [N, J, 4] turned so that they face +Z."""
    out = wxyz.copy()
    out[:, 0] = multiply(from_yaw(-yaw), out[:, 0])
    return out
