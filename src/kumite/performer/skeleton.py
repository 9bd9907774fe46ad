"""The performer's skeleton, and its trunk: where hips, chest and head are, how they are turned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kumite.clip import Skeleton
from kumite.rotation import rotate, slerp

THIGH, SHIN = 0.435, 0.43  # m
UPPER_ARM, FOREARM = 0.285, 0.255
BALL = np.array([0.0, -0.062, 0.125])  # from the ankle to the ball of the foot, foot flat
BALL_HEIGHT = 0.026  # of the ball's joint above the ground, foot flat
BLADE = np.array([-np.sin(np.radians(40)), 0.0, np.cos(np.radians(40))])
"""A sword's direction in the right hand's axes: across the palm, a little forward."""
SWORD = 0.92  # m from the grip to the point

BONES: tuple[tuple[str, str | None, tuple[float, float, float], str | None], ...] = (
    ("Hips", None, (0.0, 0.0, 0.0), "pelvis"),
    ("Spine", "Hips", (0.0, 0.10, -0.01), None),
    ("Chest", "Spine", (0.0, 0.15, 0.0), "chest"),
    ("Neck", "Chest", (0.0, 0.245, 0.01), "neck"),
    ("Head", "Neck", (0.0, 0.095, 0.02), "head"),
    ("LeftShoulder", "Chest", (0.03, 0.195, 0.0), "left_clavicle"),
    ("LeftArm", "LeftShoulder", (0.15, 0.0, -0.01), "left_upper_arm"),
    ("LeftForeArm", "LeftArm", (UPPER_ARM, 0.0, 0.0), "left_forearm"),
    ("LeftHand", "LeftForeArm", (FOREARM, 0.0, 0.0), "left_hand"),
    ("RightShoulder", "Chest", (-0.03, 0.195, 0.0), "right_clavicle"),
    ("RightArm", "RightShoulder", (-0.15, 0.0, -0.01), "right_upper_arm"),
    ("RightForeArm", "RightArm", (-UPPER_ARM, 0.0, 0.0), "right_forearm"),
    ("RightHand", "RightForeArm", (-FOREARM, 0.0, 0.0), "right_hand"),
    ("LeftUpLeg", "Hips", (0.09, -0.06, 0.0), "left_thigh"),
    ("LeftLeg", "LeftUpLeg", (0.0, -THIGH, 0.0), "left_shin"),
    ("LeftFoot", "LeftLeg", (0.0, -SHIN, 0.0), "left_foot"),
    ("LeftToes", "LeftFoot", tuple(BALL.tolist()), "left_toe"),
    ("RightUpLeg", "Hips", (-0.09, -0.06, 0.0), "right_thigh"),
    ("RightLeg", "RightUpLeg", (0.0, -THIGH, 0.0), "right_shin"),
    ("RightFoot", "RightLeg", (0.0, -SHIN, 0.0), "right_foot"),
    ("RightToes", "RightFoot", tuple(BALL.tolist()), "right_toe"),
)
_OFFSETS = {name: np.array(offset) for name, _, offset, _ in BONES}
COLLARS = tuple((_OFFSETS[f"{s}Shoulder"], _OFFSETS[f"{s}Arm"]) for s in ("Left", "Right"))
"""Of the left and the right arm: collarbone from the chest, shoulder from the collarbone."""
HIPS = (_OFFSETS["LeftUpLeg"], _OFFSETS["RightUpLeg"])  # from the pelvis
_TIPS = {
    "Head": (0.0, 0.19, 0.015),
    "LeftHand": (0.115, 0.0, 0.0),
    "RightHand": (-0.115, 0.0, 0.0),
    "LeftToes": (0.0, -0.012, 0.075),
    "RightToes": (0.0, -0.012, 0.075),
}
FIST = 0.115  # m from the wrist to the front of the fist


def skeleton(*, armed: str | None = None) -> Skeleton:
    """The performer's skeleton: 21 joints, 1.75 m tall, resting in a T facing +Z.

    armed: "left" or "right", the hand with a sword: a joint of its own, whose tip is the point.
    """
    bones = list(BONES)
    tips: dict[str, tuple[float, float, float]] = dict(_TIPS)
    if armed is not None:
        x, y, z = SWORD * BLADE
        side = -1.0 if armed == "left" else 1.0
        bones.append(("Sword", f"{armed.title()}Hand", (-0.075 * side, 0.0, 0.0), "sword"))
        tips["Sword"] = (float(side * x), float(y), float(z))
    names = [b[0] for b in bones]
    return Skeleton(
        tuple(names),
        np.array([names.index(b[1]) if b[1] else -1 for b in bones]),
        np.array([b[2] for b in bones]),
        {b[3]: j for j, b in enumerate(bones) if b[3]},
        np.array([names.index(n) for n in tips]),
        np.array(list(tips.values())),
    )


def turn(yaw_pitch_roll: np.ndarray) -> np.ndarray:
    """Quaternions [..., 4] of (yaw, pitch, roll) [..., 3]."""
    half = 0.5 * yaw_pitch_roll
    (cy, cp, cr), (sy, sp, sr) = np.moveaxis(np.cos(half), -1, 0), np.moveaxis(np.sin(half), -1, 0)
    return np.stack(
        [
            cy * cp * cr + sy * sp * sr,
            cy * sp * cr + sy * cp * sr,
            sy * cp * cr - cy * sp * sr,
            cy * cp * sr - sy * sp * cr,
        ],
        axis=-1,
    )


@dataclass(frozen=True)
class Trunk:
    """World rotations [F, 4] and places [F, 3] of the trunk's joints, by name."""

    turned: dict[str, np.ndarray]
    at: dict[str, np.ndarray]

    def carried(self, joint: str, point: np.ndarray) -> np.ndarray:
        """A point [3] of a joint's axes, in the world [F, 3]."""
        return self.at[joint] + rotate(self.turned[joint], point)


def trunk(
    pelvis: np.ndarray, pelvis_turn: np.ndarray, chest_turn: np.ndarray, head_turn: np.ndarray
) -> Trunk:
    """The trunk of a pose: the spine is half way between hips and chest, the neck between chest
    and head.
    """
    hips, chest, head = turn(pelvis_turn), turn(chest_turn), turn(head_turn)
    half = np.full(len(pelvis), 0.5)
    turned = {"Hips": hips, "Spine": slerp(hips, chest, half), "Chest": chest}
    turned |= {"Neck": slerp(chest, head, half), "Head": head}
    at = {"Hips": pelvis}
    for joint, parent, offset, _ in BONES[1:5]:
        assert parent is not None  # all but the hips have one
        at[joint] = at[parent] + rotate(turned[parent], np.array(offset))
    return Trunk(turned, at)
