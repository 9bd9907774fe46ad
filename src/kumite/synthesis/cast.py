"""A cast: K characters played from a library, as arrays.

Choices come in as stretches of the action table; poses come out. What happens every frame is one
kernel over all characters; Python objects appear only where a character chooses or is struck.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kumite.checked import checked
from kumite.clip import SIDES, Skeleton, facing_frame
from kumite.errors import KumiteError
from kumite.graph import Layer
from kumite.kernels import character as kernels
from kumite.kernels.blow import NO_BLOW
from kumite.kernels.phase import AT_FRAME, move_all
from kumite.rotation import planar_compose, planar_inverse, wrap_angle
from kumite.synthesis.moment import Moment
from kumite.synthesis.rates import FASTEST, SLOWEST
from kumite.synthesis.recoil import RATE, REACTION_HALF_LIFE, give_way

# Of a difference at rest a critically damped spring leaves 60 % after one of its half-lives, 24 %
# after two, 8 % after three (the exponential of its rate halves twice in each).
JOIN_HALF_LIFE = 0.10  # s, for the difference of the joints at a join
ROOT_HALF_LIFE = 0.20  # s, the same for the root: its speed must not be felt to jump
LONGEST_FOOT_OFFSET = 0.30  # m that a planted foot may stand away from where the capture has it
SPRINGS = kernels.Springs(JOIN_HALF_LIFE, ROOT_HALF_LIFE, REACTION_HALF_LIFE, LONGEST_FOOT_OFFSET)
BLOW_BEFORE, BLOW_AFTER = 0.07, 0.12  # s around the effective frames in which a blow may land


@checked
class Cast:
    """K characters. Arrays named as in ``kernels/character.py``; each frame overwrites the last."""

    def __init__(
        self, library: Layer, count: int, spans: tuple[np.ndarray, np.ndarray] | None = None
    ) -> None:
        """spans: the first and the last library frames of what may be begun, [S] int32 each; None:
        the stretches of the layer."""
        self.library = library
        first, last = spans or (library.table.first, library.table.last)
        clips, skeleton = library.clips, library.clips.skeleton
        joints = len(skeleton)
        self.count = count
        position, _ = clips.world
        feet = [skeleton.joint(f"{side}_foot") for side in SIDES]
        capture = kernels.Capture(
            clips.fps,
            clips.root_position,
            clips.wxyz,
            clips.facing,
            np.ascontiguousarray(position[:, feet]),
            library.contacts.on_ground,
            clips.clip_of_frame,
        )
        build = build_of(skeleton)
        self.frame = np.zeros(count, dtype=np.int64)  # library frame shown
        self.fraction = np.zeros(count)  # of the way to the next, in [0, 1)
        self.rate = np.ones(count)  # library frames per shown frame, see set_rate
        self.pace = np.ones(count)  # the rate that led to what is shown
        self.stop = np.zeros(count, dtype=np.int64)  # last frame of the action: choose again there
        self.anchor = np.zeros((count, 3))  # library world → scene
        self.root_position = np.zeros((count, 3))
        self.wxyz = np.zeros((count, joints, 4))
        self.wxyz[..., 0] = 1.0
        self.position = np.zeros((count, joints, 3))
        self.world_wxyz = self.wxyz.copy()
        shapes = [(joints, 3), (3,), (2, 3), (joints, 3)]  # joint, root, foot, reaction
        self._offsets = kernels.Offsets(
            *(np.zeros((count, *shape)) for shape in shapes for _ in ("offset", "velocity"))
        )
        self.jump = np.zeros(count, dtype=bool)  # whether the last action began with a join
        self.held = np.zeros(count, dtype=bool)  # shows poses handed to it, until it adopts one
        self.stands = np.zeros((count, 2), dtype=bool)  # on which feet it does so
        self.played = kernels.Played(
            self.frame,
            self.fraction,
            self.rate,
            self.pace,
            self.stop,
            self.anchor,
            self.jump,
            first,
            last,
            blow_windows(library),
            self.held,
            SPRINGS,
            capture,
            build,
            self._offsets,
            kernels.Poses(self.root_position, self.wxyz, self.position, self.world_wxyz),
        )

    @property
    def contacts(self) -> np.ndarray:
        """Which feet are planted now [K, 2] bool.

        Between two frames a foot is if it is in both: on the way to one in which it is not, it
        moves.
        """
        on_ground = self.library.contacts.on_ground[self.frame]
        if np.any(self.fraction):
            on_ground &= self.library.contacts.on_ground[self._following]
        return np.where(self.held[:, None], self.stands, on_ground)

    @property
    def facing(self) -> np.ndarray:
        """Facing frames [K, 3] in the scene."""
        facing = self.library.clips.facing[self.frame]
        if np.any(self.fraction):
            way = self.library.clips.facing[self._following] - facing
            way[:, 2] = wrap_angle(way[:, 2])
            facing = facing + self.fraction[:, None] * way
        return planar_compose(self.anchor, facing)

    @property
    def _following(self) -> np.ndarray:
        """The frames [K] towards which fractions count."""
        clips = self.library.clips
        after = np.minimum(self.frame + 1, len(clips) - 1)
        same = clips.clip_of_frame[after] == clips.clip_of_frame[self.frame]
        return np.where(same & (self.fraction > 0.0), after, self.frame)

    @property
    def phase(self) -> np.ndarray:
        """What is shown [K], in library frames: frame and fraction."""
        return self.frame + self.fraction

    @property
    def _waits(self) -> np.ndarray:
        return (self.stop - self.frame) - self.fraction < self.rate - AT_FRAME

    @property
    def waiting(self) -> np.ndarray:
        """Characters who would pass the end of their action with the next frame.

        Each must :meth:`begin` another before a step.
        """
        return np.flatnonzero(self._waits)

    @property
    def reached(self) -> np.ndarray:
        """The frames [K] at which all are, for what is decided on: who waits, at its action's end.

        There it may be a part of a frame short of it; what it takes next begins that much later.
        """
        return np.where(self._waits, np.maximum(self.frame, self.stop), self.frame)

    def frames_ahead(self, who: np.ndarray, steps: np.ndarray) -> np.ndarray:
        """Layer frames [W, T] at which characters who [W] will be after steps [T], no farther
        than their actions go."""
        along = self.fraction[who, None] + steps * self.rate[who, None]
        frame = self.frame[who, None] + np.floor(along + AT_FRAME).astype(np.int64)
        return np.minimum(frame, np.maximum(self.stop, self.frame)[who, None])

    def facing_at(self, frame: np.ndarray) -> np.ndarray:
        """Facing frames [K, 3] in the scene of library frames [K], where they are played now."""
        return planar_compose(self.anchor, self.library.clips.facing[frame])

    def set_rate(self, who: int | np.ndarray, rate: float | np.ndarray) -> None:
        """Play characters faster or slower from the next frame on: library frames per shown frame.

        Many small changes look smooth, a large one is a jerk (:mod:`kumite.kernels.warp`).
        Errors: not within ``SLOWEST`` to ``FASTEST``.
        """
        asked = np.asarray(rate, dtype=np.float64)
        wrong = asked[~((asked >= SLOWEST - AT_FRAME) & (asked <= FASTEST + AT_FRAME))]
        if wrong.size:
            raise KumiteError(f"cast: rate {wrong[0]:g}, expected {SLOWEST} to {FASTEST}")
        self.rate[who] = asked

    def place(self, k: int, state: int, facing: np.ndarray, *, frame: int | None = None) -> None:
        """Put a character into a state (of the action table) at a facing frame, at rest.

        frame: of an action that leads there, where it is on the way; None: it is there."""
        stop = int(self.library.table.state_frame[state])
        f = stop if frame is None else int(frame)
        self.frame[k], self.stop[k] = f, stop
        self.fraction[k], self.rate[k], self.pace[k] = 0.0, 1.0, 1.0
        self.held[k] = False
        self.anchor[k] = planar_compose(facing, planar_inverse(self.library.clips.facing[f]))
        for array in self._offsets:
            array[k] = 0.0

    def begin(self, who: np.ndarray, stretch: np.ndarray) -> None:
        """Characters who [W] take actions, stretches [K], from the states they are in."""
        kernels.begin(who, stretch, self.played)

    def wait(self, k: int) -> None:
        """A character whose action has ended stays at its end for another step."""
        self._come_to(k, int(self.stop[k]))

    def _come_to(self, k: int, frame: int) -> None:
        """Let the next frame move a character on to a library frame."""
        before = frame - self.rate[k]
        self.frame[k] = int(np.floor(before))
        self.fraction[k] = before - self.frame[k]

    def foresee(
        self, k: int, frames: int, alone: Cast, then: Sequence[int] = ()
    ) -> tuple[np.ndarray, np.ndarray]:
        """Roots [T, 3] and rotations [T, J, 4] that a character would show next, undisturbed.

        T is ``frames``, or fewer where its action, and ``then`` those that it is to take
        (stretches), end before; at its end, what it shows now. It goes on at its rate.
        alone: a cast of one from the same library, to try it on; it is left where this leads.
        """
        for name in ("frame", "fraction", "rate", "pace", "stop", "anchor"):
            getattr(alone, name)[0] = getattr(self, name)[k]
        for mine, theirs in zip(alone._offsets, self._offsets):
            mine[0] = theirs[k]
        roots, turns = [], []
        following = iter(then)
        while len(roots) < frames:
            if alone._waits[0]:
                stretch = next(following, None)
                if stretch is None:
                    break
                alone.begin(np.array([0]), np.array([stretch]))
            alone.advance()
            roots.append(alone.root_position[0].copy())
            turns.append(alone.wxyz[0].copy())
        if not roots:
            return self.root_position[k, None].copy(), self.wxyz[k, None].copy()
        return np.array(roots), np.array(turns)

    def hold(
        self,
        k: int,
        frame: int,
        root_position: np.ndarray,
        wxyz: np.ndarray,
        ankles: np.ndarray,
        stands: np.ndarray,
    ) -> None:
        """Let a character show a pose ([3] m, [J, 4]) in the next frame, whatever it plays.

        ankles [2, 3] m: where its legs reach to; stands [2] bool: on which feet it stands. The
        pose counts as library frame ``frame`` and its anchor stays. So from frame to frame, until
        :meth:`adopt`.
        """
        still = np.zeros((1 + len(wxyz), 3))
        self.frame[k], self.fraction[k] = frame, 0.0
        self._take(k, root_position, wxyz, still, ankles, still[:2])
        self._come_to(k, frame)
        self.held[k], self.stands[k] = True, stands

    def adopt(
        self, k: int, frame: int, last: int, now: Moment, ankles: np.ndarray | None = None
    ) -> None:
        """Let a character go on from a pose of its own along library frames.

        It stands where ``now`` does, shows that pose at its next :meth:`show` of no time, and from
        there plays the frames after ``frame`` up to ``last`` (where it waits for a choice):
        the facing frames lie on each other, pose and velocity are continuous, and what differs
        fades as after a join. It goes on at its rate. ankles [2, 3] m: where its legs reach to,
        if not where the pose has them.

        Errors: frames that are no stretch of one clip; another skeleton.
        """
        clips = self.library.clips
        if not (0 <= frame <= last < len(clips)) or (
            clips.clip_of_frame[frame] != clips.clip_of_frame[last]
        ):
            raise KumiteError(f"cast: frames {frame} to {last} are no part of one clip")
        if len(now.wxyz) != len(clips.skeleton):
            raise KumiteError(
                f"cast: a pose of {len(now.wxyz)} joints, expected {len(clips.skeleton)}"
            )
        facing = facing_frame(clips.skeleton, now.root_position[None], now.wxyz[None])[0]
        self.frame[k], self.fraction[k], self.stop[k], self.held[k] = frame, 0.0, last, False
        self.pace[k] = self.rate[k]
        self.anchor[k] = planar_compose(facing, planar_inverse(clips.facing[frame]))
        position, velocity = now.joints(clips.skeleton)
        feet = [clips.skeleton.joint(f"{side}_foot") for side in SIDES]
        self._take(
            k,
            now.root_position,
            now.wxyz,
            np.concatenate([now.root_velocity[None], now.joint_velocity]),
            position[feet] if ankles is None else ankles,
            velocity[feet],
        )

    def _take(self, k: int, root_position, wxyz, moving, ankles, stepping) -> None:
        """Offsets that show a pose, and how it moves, at the library frame where k is."""
        kernels.adopt(
            k,
            int(self.frame[k]),
            float(self.rate[k]),
            self.anchor,
            np.concatenate([[[*root_position, 0.0]], wxyz]),
            moving,
            ankles,
            stepping,
            self.played.capture,
            self._offsets,
        )

    def advance(self) -> None:
        """Everyone one frame on, along the action begun, each at its rate."""
        move_all(self.frame, self.fraction, self.rate, self.pace)
        self.show(1.0 / self.library.clips.fps)

    def show(self, dt: float) -> None:
        """Make the poses of the frames that the characters are at, offsets moved on by dt [s]."""
        show = kernels.show_many if self.count >= kernels.MANY else kernels.show
        show(float(dt), self.played)

    @property
    def foot_offset(self) -> np.ndarray:
        """How far [K, 2, 3] planted feet are held from where the capture has them [m]."""
        return self._offsets.foot

    def left(self, k: int) -> np.ndarray:
        """What joins have left of a character's root, left and right ankle [2, 3, 3]: how far they
        are shown from where the capture has them [m], and how fast that changes [m/s], in the
        scene.
        """
        held = self._offsets
        return np.stack(
            [
                np.concatenate([root[k, None], foot[k]])
                for root, foot in (
                    (held.root, held.foot),
                    (held.root_velocity, held.foot_velocity),
                )
            ]
        )

    def carry(self, k: int, way: np.ndarray) -> None:
        """Carry a character away over the ground by way [2] m; planted feet stay where they are."""
        self.anchor[k, :2] += way
        self._offsets.foot[k][:, [0, 2]] -= way

    def strike(self, k: int, joint: int, point: np.ndarray, displacement: np.ndarray) -> None:
        """Displace a struck segment: ``point`` moves by about ``displacement`` [3] and recovers.

        The joints below give way (:func:`give_way`), played by a critically damped spring from
        rest that peaks there.
        """
        chain, turn, most = give_way(
            self.library.clips.skeleton,
            self.position[k],
            self.world_wxyz[k],
            joint,
            point,
            displacement,
        )
        velocity = self._offsets.reaction_velocity[k, chain] + turn * np.e * RATE
        left = np.maximum(most - np.linalg.norm(self._offsets.reaction[k, chain], axis=1), 0.0)
        speed = np.maximum(np.linalg.norm(velocity, axis=1), 1e-9)
        velocity *= np.minimum(1.0, np.e * RATE * left / speed)[:, None]
        self._offsets.reaction_velocity[k, chain] = velocity


def build_of(skeleton: Skeleton) -> kernels.Build:
    """The skeleton's arrays. Errors: roles of the legs that are missing."""
    legs = [[skeleton.joint(f"{s}_{p}") for p in ("thigh", "shin", "foot")] for s in SIDES]
    return kernels.Build(skeleton.parents, skeleton.offsets, np.array(legs), _below(skeleton, legs))


def _below(skeleton: Skeleton, legs: list[list[int]]) -> np.ndarray:
    """The joints [2, N] that hang from each thigh, parents first, filled up with -1."""
    out = np.full((len(legs), len(skeleton)), -1, dtype=np.int64)
    for row, (thigh, _, _) in zip(out, legs):
        found = [thigh]
        for j in range(thigh + 1, len(skeleton)):
            if skeleton.parents[j] in found:
                found.append(j)
        row[: len(found)] = found
    return out


def blow_windows(library: Layer) -> np.ndarray:
    """The blow [F, 4] int32 that each limb throws at a frame, or NO_BLOW."""
    strikes, clips = library.strikes, library.clips
    out = np.full((len(clips), 4), NO_BLOW, dtype=np.int32)
    before, after = round(BLOW_BEFORE * clips.fps), round(BLOW_AFTER * clips.fps)
    for x in range(len(strikes)):
        c, limb = clips.clip_of_frame[strikes.frame[x]], strikes.limb[x]
        low = max(int(strikes.start[x]) - before, int(clips.clip_start[c]))
        high = min(int(strikes.stop[x]) + after, int(clips.clip_start[c + 1]))
        around = out[low:high, limb]
        around[around == NO_BLOW] = x
    for x in range(len(strikes)):  # a drive is its own blow's, whatever comes close before or after
        out[strikes.start[x] : strikes.stop[x], strikes.limb[x]] = x
    return out
