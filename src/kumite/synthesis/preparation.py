"""Who prepares for a target motion while still on the way to it (Shum et al. 2013, section 5).

What a character shows, a walk say, is bent towards a reference posture of the target motion as far
as its *level of preparation* a says: 0 is the walk to the bit, 1 the posture itself, on the spot.
The upper body leads, the legs follow (:func:`curves`). :class:`Preparation` does so frame by frame
for K characters at once, on top of whatever poses them; :func:`prepare_clip` for a clip.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from kumite.annotate.contacts import Contacts
from kumite.annotate.cycles import Cycles, closed
from kumite.brief import brief
from kumite.checked import checked
from kumite.checks import freeze
from kumite.clip import (
    SIDES,
    Clip,
    ClipSet,
    Skeleton,
    facing_frame,
    forward_kinematics,
)
from kumite.errors import KumiteError, unknown
from kumite.kernels import preparation as kernels
from kumite.kernels.character import Build
from kumite.rotation import from_yaw, multiply, planar_apply, planar_compose, planar_inverse
from kumite.synthesis.cast import Cast, build_of

LEGS, UPPER = 1.0, 0.5  # C of the root and the legs, and of all other joints
FOOT_HALF_LIFE = 0.10  # s, of a lifted foot's way back to where the blend has it
SIGMA = 0.15  # s, of the Gaussian filter of levels
REACH = 2.0  # sigmas that the filter looks to either side: the rest is 5 % of the weight


@checked
@brief
@dataclass(frozen=True)
class References:
    """R reference postures, each in the facing frame of its pose."""

    wxyz: np.ndarray  # [R, J, 4], the root's without its heading
    root: np.ndarray  # [R, 2] m, x and z of the root
    ankle: np.ndarray  # [R, 2] m above the ground, left and right

    def __post_init__(self) -> None:
        freeze(
            self,
            "reference postures",
            wxyz=(float, ("R", "J", 4)),
            root=(float, ("R", 2)),
            ankle=(float, ("R", 2)),
        )

    def __len__(self) -> int:
        return len(self.wxyz)


@checked
def references(clips: ClipSet, frames: Sequence[int] | np.ndarray) -> References:
    """The poses of frames as reference postures. Errors: frames that there are not."""
    f = np.asarray(frames, dtype=np.int64).reshape(-1)
    if len(f) == 0 or f.min() < 0 or f.max() >= len(clips):
        raise KumiteError(f"references: frames {f.tolist()}; expected some of 0 … {len(clips) - 1}")
    facing = clips.facing[f]
    wxyz = clips.wxyz[f].copy()
    wxyz[:, 0] = multiply(from_yaw(-facing[:, 2]), wxyz[:, 0])
    root = planar_apply(planar_inverse(facing), clips.root_position[f])
    feet = [clips.skeleton.joint(f"{side}_foot") for side in SIDES]
    return References(wxyz, root[:, [0, 2]], clips.world[0][f][:, feet, 1])


def blended(postures: References, weights: np.ndarray) -> References:
    """Postures [N] in between: each the mean of all R, weighted by its row of weights [N, R].

    Rotations are added as quaternions, all turned to the side of the heaviest. Errors: weights that
    are not above 0 in all.
    """
    w = np.asarray(weights, dtype=np.float64)
    if w.ndim != 2 or w.shape[1] != len(postures) or not np.all(w >= 0) or not np.all(w.sum(1) > 0):
        raise KumiteError(
            f"references: weights {list(w.shape)}; expected {len(postures)} in each row, "
            "none below 0, not all 0"
        )
    w = w / w.sum(axis=1, keepdims=True)
    main = postures.wxyz[np.argmax(w, axis=1)]  # [N, J, 4]
    side = np.where(np.einsum("njc,rjc->nrj", main, postures.wxyz) < 0, -1.0, 1.0)
    wxyz = np.einsum("nr,nrj,rjc->njc", w, side, postures.wxyz)
    wxyz /= np.linalg.norm(wxyz, axis=-1, keepdims=True)
    return References(wxyz, w @ postures.root, w @ postures.ankle)


@checked
def curves(skeleton: Skeleton, given: Mapping[str, float] | None = None) -> np.ndarray:
    """The constant C [J] of each joint: 1 for the root, the pelvis and the legs, 0.5 for others.

    given: C by joint name or by role (:data:`kumite.clip.ROLES`), or of ``"legs"`` and ``"upper"``
    all at once; names before roles before groups. Errors: names that there are not; a C that is
    not above 0.
    """
    given = dict(given or {})
    legs = [
        j
        for j in range(len(skeleton))
        if any(_hangs(skeleton, j, skeleton.joint(f"{s}_thigh")) for s in SIDES)
    ]
    lower = [0, skeleton.joint("pelvis"), *legs]
    groups = ("legs", "upper")
    valid = (*groups, *skeleton.roles, *skeleton.names)
    for name, value in given.items():
        if name not in valid:
            raise unknown("joint, role or group", name, valid)
        if not (np.isfinite(value) and value > 0):
            raise KumiteError(f"preparation: C of {name!r} is {value}; expected more than 0")
    out = np.full(len(skeleton), given.get("upper", UPPER))
    out[lower] = given.get("legs", LEGS)
    for role, joint in skeleton.roles.items():
        out[joint] = given.get(role, out[joint])
    for joint, name in enumerate(skeleton.names):
        if name not in groups and name not in skeleton.roles:
            out[joint] = given.get(name, out[joint])
    return out


def _hangs(skeleton: Skeleton, joint: int, from_: int) -> bool:
    while joint > from_:
        joint = int(skeleton.parents[joint])
    return joint == from_


def weights(level: np.ndarray, curve: np.ndarray) -> np.ndarray:
    """Weights [..., J] of the reference posture at levels [...] for constants C [J]. Eq. 1.

    Errors: levels outside of 0 … 1; a C that is not above 0.
    """
    level, curve = checked_levels(level), np.asarray(curve, dtype=np.float64)
    if not np.all(curve > 0):
        raise KumiteError(f"preparation: C of {curve.min():g}; expected more than 0")
    with np.errstate(under="ignore"):
        return (1.0 - (1.0 - level[..., None]) ** (1.0 / curve)) ** curve


def checked_levels(level: np.ndarray | float) -> np.ndarray:
    """Levels of preparation as an array. Errors: one outside of 0 … 1."""
    out = np.asarray(level, dtype=np.float64)
    if out.size and not (out.min() >= 0.0 and out.max() <= 1.0):  # NaN is neither
        wrong = out[~((out >= 0.0) & (out <= 1.0))]
        raise KumiteError(f"preparation: a level of {wrong.flat[0]:g}; expected 0 to 1")
    return out


@checked
class Preparation:
    """K characters who prepare, frame by frame. Arrays are overwritten by each frame."""

    def __init__(
        self,
        skeleton: Skeleton,
        fps: float,
        postures: References,
        count: int,
        *,
        curve: np.ndarray | None = None,
        foot_half_life: float = FOOT_HALF_LIFE,
    ) -> None:
        """curve: constants C [J], or [R, J] of each posture; by default :func:`curves`'.

        Errors: shapes that do not fit.
        """
        joints = len(skeleton)
        if postures.wxyz.shape[1] != joints:
            raise KumiteError(
                f"preparation: postures of {postures.wxyz.shape[1]} joints, a skeleton of {joints}"
            )
        curve = curves(skeleton) if curve is None else np.asarray(curve, dtype=np.float64)
        shapes = ((joints,), (len(postures), joints))
        if curve.shape not in shapes or not np.all(curve > 0):
            raise KumiteError(
                f"preparation: C must be {joints} numbers, each more than 0, or so many of each of "
                f"{len(postures)} postures"
            )
        if not foot_half_life > 0:
            raise KumiteError(f"preparation: half-life {foot_half_life} s; expected more than 0")
        self.fps, self.foot_half_life = float(fps), float(foot_half_life)
        self.build: Build = build_of(skeleton)
        self.postures = kernels.Postures(
            postures.wxyz.copy(),
            postures.root.copy(),
            postures.ankle.copy(),
            np.array(np.broadcast_to(curve, shapes[1])),
        )
        self.root_position = np.zeros((count, 3))
        self.wxyz = np.zeros((count, joints, 4))
        self.position = np.zeros((count, joints, 3))
        self.world_wxyz = np.zeros((count, joints, 4))
        self.facing = np.zeros((count, 3))  # of what is shown, in the scene
        self._straight = np.zeros((count, 3))
        own = (self.root_position, self.wxyz, self.position, self.world_wxyz, self.facing)
        self._shown = kernels.Prepared(*(array[None] for array in own))
        self.going = kernels.Going(
            np.zeros(count, dtype=bool),
            np.zeros((count, 3)),
            np.zeros((count, 3)),
            np.zeros((count, 2), dtype=bool),
            *(np.zeros((count, 2, 2)) for _ in range(4)),
        )

    @property
    def lag(self) -> np.ndarray:
        """Planar transforms [K, 3] from where the locomotion is to where who prepares is."""
        return self.going.lag

    def place(self, k: int, facing_now: np.ndarray, facing: np.ndarray) -> None:
        """Start a character anew: the locomotion's facing frame now, at ``facing`` [3]."""
        for array in self.going:
            array[k] = 0
        self.going.lag[k] = planar_compose(facing, planar_inverse(facing_now))

    def lead(
        self,
        rows: np.ndarray,
        like: References,
        which: np.ndarray,
        share: np.ndarray | float,
        curve: np.ndarray | None = None,
    ) -> np.ndarray:
        """Let postures ``rows`` [N] become more like postures ``which`` [N] of ``like``, by shares
        [N] of what differs: how much is left [N], the most of any number. curve [N, J]: constants C
        that these shall have; None: those they have."""
        mine, left = self.postures, np.zeros(len(rows))
        part = np.broadcast_to(np.asarray(share, dtype=np.float64), (len(rows),))
        goals = {name: getattr(like, name)[which] for name in ("root", "ankle", "wxyz")}
        goals |= {} if curve is None else {"curve": curve}
        for name, goal in goals.items():
            array = getattr(mine, name)
            now = array[rows]
            if name == "wxyz":  # the nearer of the two quaternions that mean the same
                goal = np.where(np.sum(now * goal, axis=-1, keepdims=True) < 0, -goal, goal)
            now = now + part.reshape(-1, *[1] * (now.ndim - 1)) * (goal - now)
            if name == "wxyz":
                now /= np.linalg.norm(now, axis=-1, keepdims=True)
            array[rows] = now
            left = np.maximum(left, np.abs(goal - now).reshape(len(rows), -1).max(axis=1))
        return left

    def show(
        self,
        root_position: np.ndarray,
        wxyz: np.ndarray,
        facing: np.ndarray,
        ankle: np.ndarray,
        on_ground: np.ndarray,
        level: np.ndarray | float,
        reference: np.ndarray | int = 0,
        shift: np.ndarray | None = None,
    ) -> None:
        """Prepare the next frame of all characters.

        root_position [K, 3], wxyz [K, J, 4], facing [K, 3], ankle [K, 2, 3], on_ground [K, 2]: the
        locomotion's. level [K] in 0 … 1, reference [K] index of the posture. shift [K, 3] (m, m,
        rad): what they go and turn in this frame besides, seen from where they are; feet that stand
        stay. Errors: a level or a reference out of range; shapes that do not fit.
        """
        count = len(self.wxyz)
        levels = _each(checked_levels(level), count)
        like = _checked_references(reference, count, len(self.postures.wxyz))
        moves = kernels.Locomotion(
            _one(root_position, (count, 3)),
            _one(wxyz, self.wxyz.shape),
            _one(facing, (count, 3)),
            _one(ankle, (count, 2, 3)),
            _one(on_ground, (count, 2), np.bool_),
            _one(self._straight if shift is None else shift, (count, 3)),
        )
        self._run(levels[None], like, moves, self._shown)

    def show_cast(
        self,
        cast: Cast,
        level: np.ndarray | float,
        reference: np.ndarray | int = 0,
        shift: np.ndarray | None = None,
    ) -> None:
        """:meth:`show` of what a cast shows."""
        ankle = cast.position[:, self.build.legs[:, 2]]
        self.show(
            cast.root_position,
            cast.wxyz,
            cast.facing,
            ankle,
            cast.contacts,
            level,
            reference,
            shift,
        )

    def _run(self, level, reference, moves, shown) -> None:
        run = kernels.prepare_many if level.shape[1] >= kernels.MANY else kernels.prepare
        run(
            level,
            reference,
            self.postures,
            self.foot_half_life,
            1.0 / self.fps,
            moves,
            self.build,
            self.going,
            shown,
        )


def _one(array: np.ndarray, shape: tuple[int, ...], dtype: type = np.float64) -> np.ndarray:
    """An array of one frame. Errors: another shape."""
    a = np.ascontiguousarray(array, dtype=dtype)
    if a.shape != shape:
        raise KumiteError(f"preparation: {list(a.shape)}, expected {list(shape)}")
    return a[None]


def _each(array: np.ndarray, count: int) -> np.ndarray:
    """One number for each of ``count``, at least one, as kernels take them."""
    if array.shape != (count,):
        array = np.broadcast_to(array, (count,))
    return np.ascontiguousarray(array)


def _checked_references(reference: np.ndarray | int, count: int, known: int) -> np.ndarray:
    like = _each(np.asarray(reference, dtype=np.int64), count)
    if not (like.min() >= 0 and like.max() < known):
        raise KumiteError(f"preparation: reference {like.tolist()[:8]}; expected 0 … {known - 1}")
    return like


@checked
def prepare_clip(
    clip: Clip,
    on_ground: np.ndarray,
    postures: References,
    level: np.ndarray | float,
    *,
    reference: int = 0,
    curve: np.ndarray | None = None,
    foot_half_life: float = FOOT_HALF_LIFE,
) -> Clip:
    """The clip [F] of one character who prepares at levels [F] (or one level all the time).

    on_ground [F, 2]: contacts of the clip. Errors: as :class:`Preparation`'s.
    """
    frames, skeleton = len(clip), clip.skeleton
    work = Preparation(skeleton, clip.fps, postures, 1, curve=curve, foot_half_life=foot_half_life)
    levels = np.ascontiguousarray(np.broadcast_to(checked_levels(level), (frames,)))
    like = _checked_references(reference, 1, len(postures))
    on_ground = np.ascontiguousarray(on_ground, dtype=np.bool_)
    if on_ground.shape != (frames, 2):
        raise KumiteError(f"preparation: contacts {on_ground.shape}, expected {(frames, 2)}")
    position, _ = forward_kinematics(skeleton, clip.root_position, clip.wxyz)
    facing = facing_frame(skeleton, clip.root_position, clip.wxyz)
    ankle = np.ascontiguousarray(position[:, work.build.legs[:, 2]])
    parts = (clip.root_position, clip.wxyz, facing, ankle, on_ground, np.zeros((frames, 3)))
    moves = kernels.Locomotion(*(a[:, None] for a in parts))
    joints = len(skeleton)
    shapes = [(3,), (joints, 4), (joints, 3), (joints, 4), (3,)]
    shown = kernels.Prepared(*(np.zeros((frames, 1, *shape)) for shape in shapes))
    work._run(levels[:, None], like, moves, shown)
    return Clip(clip.name, skeleton, clip.fps, shown.root[:, 0], shown.wxyz[:, 0], clip.notes)


@checked
def repeat_cycle(
    clips: ClipSet, contacts: Contacts, cycles: Cycles, cycle: int, times: int
) -> tuple[Clip, np.ndarray]:
    """A cycle played so many times on end: a clip of T times + 1 frames and its contacts [F, 2]."""
    start, stop = int(cycles.start[cycle]), int(cycles.stop[cycle])
    root, wxyz = closed(clips, start, stop)
    facing = clips.facing
    step = planar_compose(facing[stop], planar_inverse(facing[start]))
    carry, roots, turns = np.zeros(3), [root[:1]], [wxyz[:1]]
    for _ in range(times):
        turned = wxyz[1:].copy()
        turned[:, 0] = multiply(from_yaw(carry[2]), turned[:, 0])
        roots.append(planar_apply(carry, root[1:]))
        turns.append(turned)
        carry = planar_compose(carry, step)
    on_ground = contacts.on_ground[start + 1 : stop + 1]
    ground = np.concatenate([on_ground[-1:], *[on_ground] * times])
    root_position, rotations = np.concatenate(roots), np.concatenate(turns)
    return Clip(cycles.label[cycle], clips.skeleton, clips.fps, root_position, rotations), ground


@checked
def level_displacements(
    clips: ClipSet,
    cycles: Cycles,
    levels: np.ndarray,
    *,
    curve: float = LEGS,
    steer: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """How far each cycle gets at each level: displacements [M, A, 3] (x, z, yaw) from the facing
    frame of its start to that of its end, and how long it takes [M] s.

    levels [A] in 0 … 1; curve: C of the root; steer [M] rad: an extra turn to the left, spread
    evenly over each cycle. What a controller plans on: steps are shortened one by one, so a turning
    cycle is not its displacement times a number. Errors: levels out of range, turns of others.
    """
    weight = weights(np.asarray(levels).reshape(-1), np.array([curve]))[:, 0]
    out = np.zeros((len(cycles), len(weight), 3))
    turn = np.zeros(len(cycles)) if steer is None else np.asarray(steer, dtype=float)
    if turn.shape != (len(cycles),) or not np.all(np.isfinite(turn)):
        raise KumiteError(f"steer {turn.shape}; expected a turn for each of {len(cycles)} cycles")
    facing = clips.facing
    for m, (start, stop) in enumerate(zip(cycles.start.tolist(), cycles.stop.tolist())):
        path = facing[start : stop + 1]
        steps = planar_compose(planar_inverse(path[:-1]), path[1:])
        steps[:, 2] += turn[m] / len(steps)
        for step in steps:
            out[m] = planar_compose(out[m], (1.0 - weight)[:, None] * step)
    return out, cycles.seconds


@checked
def smooth_levels(level: np.ndarray, fps: float, *, sigma: float = SIGMA) -> np.ndarray:
    """Levels [F, ...] passed through a Gaussian filter along time; sigma in seconds (0: as given).

    Both ends go on as they are. Levels within 0 … 1 stay there. Errors: levels out of range; a
    sigma below 0.
    """
    level = checked_levels(level)
    if not sigma >= 0:
        raise KumiteError(f"preparation: sigma {sigma} s; expected at least 0")
    if REACH * sigma * fps < 0.5:  # it reaches no other frame
        return level.copy()
    smooth = gaussian_filter1d(level, sigma * fps, axis=0, mode="nearest", truncate=REACH)
    return np.clip(smooth, 0.0, 1.0)


@checked
class LevelFilter:
    """The same filter while it happens: the levels of K characters, each ``delay`` seconds late."""

    def __init__(self, count: int, fps: float, *, sigma: float = SIGMA) -> None:
        if not (sigma > 0 and fps > 0):
            raise KumiteError(f"preparation: sigma {sigma} s at {fps} frames a second")
        reach = int(REACH * sigma * fps + 0.5)
        kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / (sigma * fps)) ** 2)
        self._kernel = kernel / kernel.sum()
        self._past = np.zeros((len(kernel), count))
        self._begun = False
        self.delay = reach / fps

    def restart(self, k: int, level: float) -> None:
        """Let character k have been asked for this level all the time."""
        self._past[:, k] = level

    def push(self, level: np.ndarray | float) -> np.ndarray:
        """The smooth levels [K] of now, given those [K] that are asked for now."""
        now = checked_levels(level)
        self._past[:-1] = self._past[1:]
        self._past[-1] = now
        if not self._begun:
            self._past[:] = now
            self._begun = True
        return np.clip(self._kernel @ self._past, 0.0, 1.0)
