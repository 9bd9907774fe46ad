"""Small skeletons and clips whose every number can be worked out by hand."""

from __future__ import annotations

import numpy as np

from kumite.annotate import Contacts, Strikes
from kumite.clip import Clip, ClipSet, Skeleton, concatenate
from kumite.graph import ActionTable, Layer
from kumite.rotation import from_yaw

_BONES = (
    # name, parent, offset [m], role
    ("hips", -1, (0, 0, 0), "pelvis"),
    ("spine", 0, (0, 0.2, 0), None),
    ("chest", 1, (0, 0.25, 0), "chest"),
    ("head", 2, (0, 0.3, 0), "head"),
    ("l_shoulder", 2, (0.18, 0.15, 0), "left_upper_arm"),
    ("l_elbow", 4, (0.28, 0, 0), "left_forearm"),
    ("l_wrist", 5, (0.25, 0, 0), "left_hand"),
    ("r_shoulder", 2, (-0.18, 0.15, 0), "right_upper_arm"),
    ("r_elbow", 7, (-0.28, 0, 0), "right_forearm"),
    ("r_wrist", 8, (-0.25, 0, 0), "right_hand"),
    ("l_hip", 0, (0.1, -0.05, 0), "left_thigh"),
    ("l_knee", 10, (0, -0.4, 0.01), "left_shin"),
    ("l_ankle", 11, (0, -0.4, -0.01), "left_foot"),
    ("l_toe", 12, (0, -0.07, 0.13), "left_toe"),
    ("r_hip", 0, (-0.1, -0.05, 0), "right_thigh"),
    ("r_knee", 14, (0, -0.4, 0.01), "right_shin"),
    ("r_ankle", 15, (0, -0.4, -0.01), "right_foot"),
    ("r_toe", 16, (0, -0.07, 0.13), "right_toe"),
)
HIP_HEIGHT = 0.92  # m: the toes touch y = 0 with straight legs


def skeleton() -> Skeleton:
    """18 joints with all required roles; tips on head, fists and toes."""
    names = [b[0] for b in _BONES]
    tips = {"head": (0, 0.2, 0), "l_wrist": (0.1, 0, 0), "r_wrist": (-0.1, 0, 0)}
    tips |= {"l_toe": (0, 0, 0.07), "r_toe": (0, 0, 0.07)}
    return Skeleton(
        tuple(names),
        np.array([b[1] for b in _BONES]),
        np.array([b[2] for b in _BONES], dtype=float),
        {b[3]: j for j, b in enumerate(_BONES) if b[3]},
        np.array([names.index(n) for n in tips]),
        np.array(list(tips.values()), dtype=float),
    )


def with_reference(s: Skeleton) -> Skeleton:
    """The same body below a root that has no role."""
    return Skeleton(
        ("reference", *s.names),
        np.concatenate([[-1], s.parents + 1]),
        np.concatenate([np.zeros((1, 3)), s.offsets]),
        {role: joint + 1 for role, joint in s.roles.items()},
        s.tip_parents + 1,
        s.tip_offsets,
    )


def still(frames: int, *, name: str = "still", fps: float = 30.0, yaw: float = 0.0) -> Clip:
    """A clip that stands, arms out."""
    s = skeleton()
    wxyz = np.zeros((frames, len(s), 4))
    wxyz[..., 0] = 1.0
    wxyz[:, 0] = from_yaw(np.full(frames, yaw))
    root = np.tile([0.0, HIP_HEIGHT, 0.0], (frames, 1))
    return Clip(name, s, fps, root, wxyz)


def clip_set(lengths: list[int], fps: float = 30.0) -> ClipSet:
    return concatenate([still(n, name=f"clip{i}", fps=fps) for i, n in enumerate(lengths)])


def library(table: ActionTable, frames: int, tips: dict[int, tuple] | None = None) -> Layer:
    """A library whose body stands still; tips: frame -> (place [3], speed) of left-hand hits."""
    clips = clip_set([frames])
    effective = np.zeros((frames, 4), bool)
    tip, speed = np.zeros((frames, 4, 3)), np.zeros((frames, 4))
    for f, (place, v) in (tips or {}).items():
        effective[f, 0], tip[f, 0], speed[f, 0] = True, place, v
    empty = np.zeros(0, np.int32)
    strikes = Strikes(effective, tip, speed, empty, empty, empty, empty, np.zeros((0, 3)))
    return Layer(clips, Contacts(np.ones((frames, 2), bool), np.zeros((2, 2))), strikes, table)
