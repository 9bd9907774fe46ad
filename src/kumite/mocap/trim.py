"""Frames that stand apart from a take: the T pose that many exporters put before the motion.

The body snaps from such a frame into the motion, and a snap is a blow to whoever looks for fast
hands. Frames at the start, and at the end, are left out if the body leaves them at a speed that no
body has, and is calm after that. Of a pose with arms stretched out, or the rest pose itself, less
is asked, and it may last as long as it likes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kumite.clip import SIDES, Clip, forward_kinematics

_FEW = 5  # frames that may stand apart, whatever their pose
_FAR = 0.2  # m: a snap moves hands, feet, head or hips so far in a frame
_FAST = 12.0  # m/s; a fist reaches 10 m/s, but not in one frame with calm before and after
_FAST_FROM_T = 7.0  # m/s; arms sink from a T pose at 3 m/s
_CALM, _CALM_FROM_T = 1 / 3, 1 / 2  # of the snap: how far the body goes in any of the next frames
_NEXT = 3  # frames that are to be calm
_STRAIGHT = np.cos(np.radians(25))  # between upper arm and forearm
_OUT = np.cos(np.radians(60))  # between an arm and the line of the shoulders; an A pose counts
_AT_REST = 0.1  # rad: mean turn of the joints in the rest pose


def without_apart(clip: Clip) -> tuple[Clip, list[str]]:
    """The clip without frames that stand apart at its ends, and what was left out."""
    if len(clip) <= _FEW + _NEXT or not _may_stand_apart(clip):
        return clip, []
    step, position = _steps(clip, slice(None))
    if not np.any((step >= _FAR) & (step * clip.fps >= _FAST_FROM_T)):
        return clip, []
    posed = _posed(clip, position, clip.wxyz)
    first = _apart(step, posed, clip.fps)
    last = _apart(step[::-1], posed[::-1], clip.fps)
    if len(clip) - first - last < 2 or first + last == 0:
        return clip, []
    notes = []
    for count, where, snap in ((first, "first", step[first - 1]), (last, "last", step[-last])):
        if count:
            is_posed = posed[0] if where == "first" else posed[-1]
            frames = f"{where} frame" if count == 1 else f"{where} {count} frames"
            what = f"the {frames}{' (a T or rest pose)' if is_posed else ''}"
            notes.append(
                f"{what} left out: the body is {snap:.2f} m away in the next; --keep-t-pose, or "
                "keep_t_pose in kumite.toml, keeps all"
            )
    stop = len(clip) - last
    return (
        replace(clip, root_position=clip.root_position[first:stop], wxyz=clip.wxyz[first:stop]),
        notes,
    )


def _may_stand_apart(clip: Clip) -> bool:
    """Whether a clip begins or ends in a pose, or with a snap: few do, and few frames tell."""
    for some in (slice(None, _FEW + 2), slice(-_FEW - 2, None)):
        step, position = _steps(clip, some)
        end = slice(None, 1) if some.start is None else slice(-1, None)
        if np.any(step >= _FAR) or _posed(clip, position[end], clip.wxyz[end])[0]:
            return True
    return False


def _steps(clip: Clip, frames: slice) -> tuple[np.ndarray, np.ndarray]:
    """How far the body goes to the next frame [F - 1] m, and where joints are [F, J, 3]."""
    position, _ = forward_kinematics(clip.skeleton, clip.root_position[frames], clip.wxyz[frames])
    parts = [clip.skeleton.joint(r) for r in _PARTS]
    step = np.linalg.norm(np.diff(position[:, parts], axis=0), axis=2).max(axis=1)
    return step, position


_PARTS = ("pelvis", "head", *(f"{s}_{p}" for s in SIDES for p in ("hand", "foot")))


def _apart(step: np.ndarray, posed: np.ndarray, fps: float) -> int:
    """How many frames stand apart at the start. step: [F - 1] m, posed: [F] bool."""
    held = int(np.argmin(posed)) if not posed.all() else 0
    for count in range(min(max(held + 2, _FEW), len(step) - _NEXT), 0, -1):
        snap = step[count - 1]
        after = step[count : count + _NEXT].max()
        if held:
            # The snap may have been smoothed over frames between the pose and the motion.
            apart = snap * fps >= _FAST_FROM_T and after <= _CALM_FROM_T * snap
            apart = apart and count <= held + 2
        else:
            before = step[: count - 1].max(initial=0.0)
            apart = snap * fps >= _FAST and max(after, before) <= _CALM * snap
        if apart and snap >= _FAR:
            return count
    return 0


def _posed(clip: Clip, position: np.ndarray, wxyz: np.ndarray) -> np.ndarray:
    """Whether each frame [F] is the rest pose, or has both arms stretched out to the sides."""
    joint = clip.skeleton.joint
    shoulders = {s: position[:, joint(f"{s}_upper_arm")] for s in SIDES}
    across = _unit(shoulders["left"] - shoulders["right"])
    out = np.ones(len(position), dtype=bool)
    for side, sign in zip(SIDES, (1.0, -1.0)):
        elbow, wrist = (position[:, joint(f"{side}_{p}")] for p in ("forearm", "hand"))
        upper, lower = _unit(elbow - shoulders[side]), _unit(wrist - elbow)
        out &= (np.sum(upper * lower, axis=1) > _STRAIGHT) & (
            sign * np.sum(_unit(wrist - shoulders[side]) * across, axis=1) > _OUT
        )
    turned = 2 * np.arccos(np.minimum(np.abs(wxyz[:, 1:, 0]), 1.0)).mean(axis=1)
    return out | (turned < _AT_REST)


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12)
