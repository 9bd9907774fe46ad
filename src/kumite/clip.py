"""Skeletons, clips and sets of clips: the data every later stage reads.

A :class:`ClipSet` holds all clips on one skeleton at one rate, concatenated, so that one frame
number addresses everything: pose, contact, strike. Metres, radians, Y up, wxyz.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from kumite import checks, rotation
from kumite.brief import brief, pictured
from kumite.errors import KumiteError
from kumite.kernels import pose as pose_kernels
from kumite.roles import (
    ARM_ROLES as ARM_ROLES,
)
from kumite.roles import (
    LEG_ROLES as LEG_ROLES,
)
from kumite.roles import (
    LIMBS as LIMBS,
)
from kumite.roles import (
    REQUIRED_ROLES as REQUIRED_ROLES,
)
from kumite.roles import (
    ROLES as ROLES,
)
from kumite.roles import (
    SIDES as SIDES,
)

NO_PARENT = -1  # parents[0] of every skeleton
MOST_FRAMES = 1_000_000  # of one resampled clip: more than two hours at 120 frames a second


@brief
@dataclass(frozen=True)
class Skeleton:
    """A tree of joints with rigid bones, parents before children."""

    names: tuple[str, ...]
    parents: np.ndarray  # [J] int32, parents[0] = NO_PARENT
    offsets: np.ndarray  # [J, 3] m, from the parent, in the parent's axes; offsets[0] is not used
    roles: Mapping[str, int] = field(default_factory=dict)  # role -> joint
    tip_parents: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32))  # [T] End Sites
    tip_offsets: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))  # [T, 3] m

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "names", checks.names(self.names, "skeleton: joint names"))
        count = len(self.names)
        if count == 0:
            raise KumiteError("skeleton: no joints; expected at least the root")
        roles = checks.mapping(self.roles, "skeleton: roles")
        roles = {k: checks.whole(j, f"skeleton: the joint of {k!r}") for k, j in roles.items()}
        put(self, "roles", MappingProxyType(roles))
        put(
            self,
            "tip_offsets",
            np.zeros((0, 3)) if np.size(self.tip_offsets) == 0 else self.tip_offsets,
        )
        checks.freeze(
            self,
            "skeleton",
            parents=(np.int32, (count,)),
            offsets=(float, (count, 3)),
            tip_parents=(np.int32, ("T",)),
            tip_offsets=(float, ("T", 3)),
        )
        if self.parents[0] != NO_PARENT:
            raise KumiteError("skeleton: the first joint must be the root")
        if np.any(self.parents[1:] < 0) or np.any(self.parents[1:] >= np.arange(1, count)):
            raise KumiteError("skeleton: parents must come before their children")
        for role, joint in roles.items():
            if not 0 <= joint < count:
                raise KumiteError(f"skeleton: {role} is joint {joint}; expected 0 to {count - 1}")
        if np.any((self.tip_parents < 0) | (self.tip_parents >= count)):
            raise KumiteError(f"skeleton: tip parents must be joints, 0 to {count - 1}")

    def facts(self) -> list[str]:
        return [f"{len(self)} joints from {self.names[0]}", f"{len(self.roles)} roles"]

    def __len__(self) -> int:
        return len(self.names)

    def same_as(self, other: Skeleton) -> bool:
        """Same joints with the same lengths, within a millimetre."""
        return (
            self.names == other.names
            and np.array_equal(self.parents, other.parents)
            and bool(np.allclose(self.offsets[1:], other.offsets[1:], atol=1e-3))
        )

    def joint(self, role: str) -> int:
        """The joint of a role; :class:`KumiteError` if this skeleton has none."""
        try:
            return self.roles[role]
        except KeyError:
            raise KumiteError(
                f"the skeleton has no joint for {role!r} (it has {', '.join(self.roles) or 'none'})"
            ) from None

    def children(self, joint: int) -> list[int]:
        return np.flatnonzero(self.parents == joint).tolist()

    def chain(self, ancestor: int, joint: int) -> list[int]:
        """Joints from just below ``ancestor`` down to ``joint``."""
        path = []
        while joint != ancestor:
            if joint == NO_PARENT:
                raise KumiteError("skeleton: no such chain")
            path.append(joint)
            joint = int(self.parents[joint])
        return path[::-1]

    def trunk(self, joint: int) -> list[int]:
        """Joints from just below the pelvis down to ``joint``; from just below the root where the
        pelvis is a branch of its own.
        """
        pelvis, path = self.joint("pelvis"), []
        while joint not in (pelvis, 0):
            path.append(joint)
            joint = int(self.parents[joint])
        return path[::-1]

    @cached_property
    def rest_positions(self) -> np.ndarray:
        """Joint positions [J, 3] with no joint turned and the root at the origin."""
        out = np.zeros((len(self), 3))
        for j in range(1, len(self)):
            out[j] = out[self.parents[j]] + self.offsets[j]
        return out

    def tip(self, role: str) -> tuple[int, np.ndarray]:
        """The far end of a role's segment: the joint that carries it and the offset [3] from it.

        The farthest End Site below the joint; without End Sites the farthest joint below; without
        either, the bone carried on by half its length.
        """
        joint = self.joint(role)
        below = {joint: None}  # in order
        for j, parent in enumerate(self.parents.tolist()):
            if parent in below:
                below[j] = None
        rest = self.rest_positions
        ends = [(int(p), o) for p, o in zip(self.tip_parents, self.tip_offsets) if p in below]
        ends = ends or [(j, np.zeros(3)) for j in below if j != joint]
        if not ends:
            return joint, 0.5 * self.offsets[joint]
        far = max(ends, key=lambda e: float(np.linalg.norm(rest[e[0]] + e[1] - rest[joint])))
        return far[0], np.array(far[1])

    @cached_property
    def lateral_axis(self) -> np.ndarray:
        """Unit vector [3] from the right to the left hip in the pelvis' own axes."""
        rest = self.rest_positions
        v = rest[self.joint("left_thigh")] - rest[self.joint("right_thigh")]
        v = v * np.array([1.0, 0.0, 1.0])
        n = np.linalg.norm(v)
        return v / n if n > 1e-9 else np.array([1.0, 0.0, 0.0])

    @cached_property
    def mirror_joints(self) -> np.ndarray:
        """For every joint [J] the one on the other side (itself on the midline)."""
        other = np.arange(len(self))
        for part in (*ARM_ROLES, *LEG_ROLES):
            a, b = self.roles.get(f"left_{part}"), self.roles.get(f"right_{part}")
            while a is not None and b is not None and a != b and NO_PARENT not in (a, b):
                other[a], other[b] = b, a
                a, b = int(self.parents[a]), int(self.parents[b])
        index = {n: j for j, n in enumerate(self.names)}
        for j, name in enumerate(self.names):
            for left, right in (("Left", "Right"), ("left", "right"), ("l", "r"), ("L", "R")):
                if other[j] == j and name.startswith(left):
                    k = index.get(right + name[len(left) :])
                    if k is not None and other[k] == k:
                        other[j], other[k] = k, j
        return other


@brief
@pictured
@dataclass(frozen=True)
class Clip:
    """One take: frame k is at k / fps seconds."""

    name: str
    skeleton: Skeleton
    fps: float
    root_position: np.ndarray  # [F, 3] m
    wxyz: (
        np.ndarray
    )  # [F, J, 4] each joint's rotation from its parent's axes; the root's from world
    notes: tuple[str, ...] = ()  # what was inferred or repaired on the way in

    def __post_init__(self) -> None:
        checks.text(self.name, "clip: name")
        checks.instance(self.skeleton, Skeleton, f"{self.name}: skeleton")
        object.__setattr__(self, "fps", checks.fps(self.fps, f"{self.name}: fps"))
        _check_motion(self, self.name)

    def __len__(self) -> int:
        return len(self.root_position)

    @property
    def seconds(self) -> float:
        return len(self) / self.fps

    def facts(self) -> list[str]:
        joints = f"{len(self.skeleton)} joints"
        return [repr(self.name), f"{self.seconds:.2f} s at {self.fps:g} frames/s", joints]


def _check_motion(motion: Clip | ClipSet, what: str) -> int:
    """Check poses and freeze them: their number. Errors: as a clip's."""
    joints = len(motion.skeleton)
    fields = {"root_position": (float, ("F", 3)), "wxyz": (float, ("F", joints, 4))}
    frames = checks.freeze(motion, what, **fields)["F"]
    if frames == 0:
        raise KumiteError(f"{what}: no frames")
    checks.unit_quaternions(motion.wxyz, f"{what}: wxyz")
    return frames


@brief
@pictured
@dataclass(frozen=True)
class ClipSet:
    """Clips of one skeleton at one rate, end to end."""

    skeleton: Skeleton
    fps: float
    names: tuple[str, ...]  # C
    clip_start: np.ndarray  # [C + 1] int64, first frame of each clip, then F
    root_position: np.ndarray  # [F, 3] m
    wxyz: np.ndarray  # [F, J, 4]

    def __post_init__(self) -> None:
        put = object.__setattr__
        checks.instance(self.skeleton, Skeleton, "clip set: skeleton")
        put(self, "fps", checks.fps(self.fps, "clip set: fps"))
        put(self, "names", checks.names(self.names, "clip set: clip names", least=1))
        checks.freeze(self, "clip set", clip_start=(np.int64, (len(self.names) + 1,)))
        frames = _check_motion(self, "clip set")
        if self.clip_start[0] != 0 or self.clip_start[-1] != frames:
            raise KumiteError("clip set: clip_start must run from 0 to F")
        if not checks.rising(self.clip_start):
            raise KumiteError("clip set: every clip needs at least one frame")

    def __len__(self) -> int:
        return len(self.root_position)

    @property
    def seconds(self) -> float:
        return len(self) / self.fps

    def facts(self) -> list[str]:
        clips = f"{len(self.names)} clips" if len(self.names) != 1 else repr(self.names[0])
        joints = f"{len(self.skeleton)} joints"
        return [clips, f"{self.seconds:.1f} s at {self.fps:g} frames/s", joints]

    def clip(self, index: int) -> Clip:
        a, b = self.clip_start[index], self.clip_start[index + 1]
        return Clip(
            self.names[index], self.skeleton, self.fps, self.root_position[a:b], self.wxyz[a:b]
        )

    def __iter__(self) -> Iterator[Clip]:
        return (self.clip(i) for i in range(len(self.names)))

    @cached_property
    def clip_of_frame(self) -> np.ndarray:
        """The clip [F] int32 that each frame belongs to."""
        return np.repeat(np.arange(len(self.names), dtype=np.int32), np.diff(self.clip_start))

    @cached_property
    def world(self) -> tuple[np.ndarray, np.ndarray]:
        """Joint positions [F, J, 3] and world rotations [F, J, 4] of every frame."""
        return forward_kinematics(self.skeleton, self.root_position, self.wxyz)

    @cached_property
    def facing(self) -> np.ndarray:
        """The facing frame [F, 3] (x, z, yaw) of every frame."""
        cuts = self.clip_start[1:-1]  # where hips lie, the last clear direction is the same clip's
        parts = zip(np.split(self.root_position, cuts), np.split(self.wxyz, cuts))
        return np.concatenate([facing_frame(self.skeleton, *part) for part in parts])


def forward_kinematics(
    skeleton: Skeleton, root_position: ArrayLike, wxyz: ArrayLike
) -> tuple[np.ndarray, np.ndarray]:
    """Joint positions [..., J, 3] and world rotations [..., J, 4] of poses [..., 3], [..., J, 4].

    Leading axes go together as NumPy's do. Errors: another shape; no numbers.
    """
    root, pose = _poses(skeleton, root_position, wxyz)
    lead = root.shape[:-1]
    if len(lead) != 1:
        root, pose = root.reshape(-1, 3), pose.reshape(-1, len(skeleton), 4)
    position = np.empty((*pose.shape[:2], 3))
    world = np.empty(pose.shape)
    many = len(root) >= pose_kernels.MANY
    run = pose_kernels.forward_kinematics_many if many else pose_kernels.forward_kinematics
    run(skeleton.parents, skeleton.offsets, root, pose, position, world)
    if len(lead) != 1:
        position, world = position.reshape(*lead, -1, 3), world.reshape(*lead, -1, 4)
    return position, world


def _poses(
    skeleton: Skeleton, root_position: ArrayLike, wxyz: ArrayLike
) -> tuple[np.ndarray, np.ndarray]:
    """Poses [..., 3], [..., J, 4] of the same leading axes, contiguous. Errors: other shapes."""
    joints = len(checks.instance(skeleton, Skeleton, "skeleton"))
    # Whether they are finite is the caller's: this is called for every picture.
    root = checks.array(root_position, "root_position", (..., 3), finite=False)
    pose = checks.array(wxyz, "wxyz", (..., joints, 4), finite=False)
    if root.shape[:-1] != pose.shape[:-2]:
        try:
            lead = np.broadcast_shapes(root.shape[:-1], pose.shape[:-2])
        except ValueError:
            raise KumiteError(
                f"root_position is {list(root.shape)} and wxyz {list(pose.shape)}, "
                "expected [..., 3] and [..., J, 4] with leading axes that go together"
            ) from None
        root = np.ascontiguousarray(np.broadcast_to(root, (*lead, 3)))
        pose = np.ascontiguousarray(np.broadcast_to(pose, (*lead, joints, 4)))
    return root, pose


def tip_positions(
    skeleton: Skeleton, role: str, position: np.ndarray, world_wxyz: np.ndarray
) -> np.ndarray:
    """World positions [..., 3] of a role's far end, from world poses [..., J, 3], [..., J, 4].

    Errors: another shape; no such role.
    """
    joints = len(checks.instance(skeleton, Skeleton, "skeleton"))
    joint, offset = skeleton.tip(role)
    position = checks.array(position, "position", (..., joints, 3), finite=False)
    world_wxyz = checks.array(world_wxyz, "world_wxyz", (..., joints, 4), finite=False)
    return position[..., joint, :] + rotation.rotate(world_wxyz[..., joint, :], offset)


def facing_frame(skeleton: Skeleton, root_position: ArrayLike, wxyz: ArrayLike) -> np.ndarray:
    """Planar facing frames [F, ..., 3] (x, z, yaw) of poses [F, ..., 3] and [F, ..., J, 4]: below
    the pelvis, at right angles to the hips.

    Falls back to the last clear direction where the hips' axis is nearly upright. Errors: other
    shapes; no numbers; a skeleton without pelvis or hips.
    """
    p, pose = _poses(skeleton, root_position, wxyz)
    pelvis = skeleton.joint("pelvis")
    q = pose[..., 0, :]
    for j in skeleton.chain(0, pelvis):
        p = p + rotation.rotate(q, skeleton.offsets[j])
        q = rotation.multiply(q, pose[..., j, :])
    lateral = rotation.rotate(q, skeleton.lateral_axis)
    yaw = np.arctan2(-lateral[..., 2], lateral[..., 0])
    clear = np.hypot(lateral[..., 0], lateral[..., 2]) > 0.1
    if yaw.ndim and not np.all(clear):
        yaw = _last_clear(yaw.reshape(len(yaw), -1), clear.reshape(len(yaw), -1)).reshape(yaw.shape)
    return np.stack([p[..., 0], p[..., 2], yaw], axis=-1)


def _last_clear(yaw: np.ndarray, clear: np.ndarray) -> np.ndarray:
    """Directions [F, N] of which those that are not clear are the last clear ones before, or the
    first after."""
    last = np.maximum.accumulate(np.where(clear, np.arange(len(yaw))[:, None], -1), axis=0)
    last = np.where(last < 0, np.argmax(clear, axis=0), last)  # frame 0 where none is clear
    out = np.take_along_axis(yaw, last, axis=0)
    return np.where(clear.any(axis=0), out, yaw)


def resample(clip: Clip, fps: float) -> Clip:
    """The clip at another rate: positions linearly, rotations along the shortest arc."""
    checks.instance(clip, Clip, "resample")
    fps = checks.fps(fps, f"{clip.name}: the rate to resample to")
    if fps == clip.fps:
        return clip
    frames = (len(clip) - 1) * fps / clip.fps
    if frames > MOST_FRAMES:
        raise KumiteError(
            f"{clip.name}: {frames:.3g} frames at {fps:g} frames a second (it has {len(clip)} at "
            f"{clip.fps:g}); expected at most {MOST_FRAMES}"
        )
    count = int(np.floor(frames + 1e-6)) + 1
    at = np.minimum(np.arange(count) * (clip.fps / fps), len(clip) - 1)
    i = (at + 1e-9).astype(np.int64)
    t = np.maximum(at - i, 0.0)
    k = np.minimum(i + 1, len(clip) - 1)
    root = clip.root_position[i] * (1 - t)[:, None] + clip.root_position[k] * t[:, None]
    on_frame = t < 1e-9
    wxyz = np.where(
        on_frame[:, None, None],
        clip.wxyz[i],
        rotation.slerp(clip.wxyz[i], clip.wxyz[k], t[:, None]),
    )
    return Clip(clip.name, clip.skeleton, fps, root, wxyz, clip.notes)


def mirror(clip: Clip, name: str | None = None) -> Clip:
    """The clip seen in a mirror: left and right change places, x changes sign."""
    checks.instance(clip, Clip, "mirror")
    flip = np.array([1.0, 1.0, -1.0, -1.0])
    wxyz = clip.wxyz[:, clip.skeleton.mirror_joints] * flip
    root = clip.root_position * np.array([-1.0, 1.0, 1.0])
    return Clip(name or f"{clip.name}_mirrored", clip.skeleton, clip.fps, root, wxyz, clip.notes)


def check(clip: Clip) -> list[str]:
    """Everything that looks wrong with a clip's data, at once; empty when nothing does."""
    problems = []
    off = np.abs(np.linalg.norm(clip.wxyz, axis=-1) - 1).max()
    if off > 1e-6:
        problems.append(f"{clip.name}: quaternions are not unit length (off by {off:.2g})")
    if len(clip) > 1:
        speed = np.linalg.norm(np.diff(clip.root_position, axis=0), axis=1) * clip.fps
        if speed.max() > 15:
            k = int(np.argmax(speed))
            problems.append(f"{clip.name}: the root moves at {speed[k]:.0f} m/s after frame {k}")
    return problems


def runs(
    mask: np.ndarray, clip_start: Sequence[int] | np.ndarray | None = None, *, apart: int = 1
) -> np.ndarray:
    """Half-open runs [n, 2] int64 of True in mask [F], in order.

    clip_start [C + 1]: of the clips that the frames are of; a run ends where its clip does. Without
    it all frames are of one clip. apart: runs of one clip with fewer frames between them are one.
    """
    mask = np.asarray(mask, dtype=bool)
    clip_start = np.array([0, len(mask)]) if clip_start is None else np.asarray(clip_start)
    border = np.zeros(len(mask) + 1, dtype=bool)
    border[clip_start] = True
    padded = np.concatenate([[False], mask, [False]])
    start = np.flatnonzero(mask & (~padded[:-2] | border[:-1]))
    stop = np.flatnonzero(mask & (~padded[2:] | border[1:])) + 1
    clip = np.searchsorted(clip_start, start, side="right")
    new = (start[1:] - stop[:-1] >= apart) | (clip[1:] != clip[:-1])
    ends = np.ones(min(len(start), 1), dtype=bool)  # the first run begins, the last ends, if any
    first, last = np.concatenate([ends, new]), np.concatenate([new, ends])
    return np.stack([start[first], stop[last]], axis=1)


def concatenate(clips: Sequence[Clip], fps: float | None = None) -> ClipSet:
    """Clips of one skeleton as a set, resampled to ``fps`` (the lowest rate among them by default).

    Errors: no clips; two skeletons (named, with the first joint that differs).
    """
    if not isinstance(clips, Sequence):
        raise KumiteError(f"clips: {checks.a(clips)}; expected a list of clips")
    if not clips:
        raise KumiteError("no clips to put together")
    for clip in clips:
        checks.instance(clip, Clip, "clips")
    rate = min(c.fps for c in clips) if fps is None else checks.fps(fps, "fps")
    first = clips[0]
    for clip in clips[1:]:
        if not first.skeleton.same_as(clip.skeleton):
            raise KumiteError(
                f"two skeletons in one library: {first.name} and {clip.name} differ "
                f"{_first_difference(first.skeleton, clip.skeleton)}; expected one skeleton"
            )
    names = [c.name for c in clips]
    if len(set(names)) != len(names):
        twice = sorted({n for n in names if names.count(n) > 1})
        raise KumiteError(f"clip names used twice: {', '.join(twice)}")
    same = [resample(c, rate) for c in clips]
    return ClipSet(
        first.skeleton,
        rate,
        tuple(names),
        np.concatenate([[0], np.cumsum([len(c) for c in same])]),
        np.concatenate([c.root_position for c in same]),
        np.concatenate([c.wxyz for c in same]),
    )


def _first_difference(a: Skeleton, b: Skeleton) -> str:
    if len(a) != len(b):
        return f"in size ({len(a)} and {len(b)} joints)"
    for j, (m, n) in enumerate(zip(a.names, b.names)):
        if m != n:
            return f"at joint {j} ({m!r} and {n!r})"
        if j and a.parents[j] != b.parents[j]:
            return f"at {m!r} (another parent)"
        if j and not np.allclose(a.offsets[j], b.offsets[j], atol=1e-3):
            gap = float(np.linalg.norm(a.offsets[j] - b.offsets[j]))
            return f"at {m!r} (bone offsets {gap * 100:.1f} cm apart)"
    return "nowhere"
