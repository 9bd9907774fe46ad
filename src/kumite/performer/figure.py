"""The performer's body: its skeleton, and poses from where hips, chest, head, hands and feet are.

An animator thinks in places: this pelvis height, that fist there, this foot flat. The figure turns
such targets into joint rotations with analytic two-bone limbs, all frames at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kumite.clip import Skeleton
from kumite.rotation import conjugate, from_axis_angle, multiply, rotate, slerp

THIGH, SHIN = 0.435, 0.43  # m
UPPER_ARM, FOREARM = 0.285, 0.255
BALL = np.array([0.0, -0.062, 0.125])  # from the ankle to the ball of the foot, foot flat
BALL_HEIGHT = 0.026  # of the ball's joint above the ground, foot flat
STRAIGHTEST = 0.985  # of a leg's length: knees never lock
ARM_STRAIGHTEST = 0.985
CLOSEST_FIST = 0.15  # m from the shoulder: an elbow folds no further

_BONES: tuple[tuple[str, str | None, tuple[float, float, float], str | None], ...] = (
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
_TIPS = {
    "Head": (0.0, 0.19, 0.015),
    "LeftHand": (0.115, 0.0, 0.0),
    "RightHand": (-0.115, 0.0, 0.0),
    "LeftToes": (0.0, -0.012, 0.075),
    "RightToes": (0.0, -0.012, 0.075),
}
FIST = 0.115  # m from the wrist to the front of the fist


def skeleton() -> Skeleton:
    """The performer's skeleton: 21 joints, 1.75 m tall, resting in a T facing +Z."""
    names = [b[0] for b in _BONES]
    return Skeleton(
        tuple(names),
        np.array([names.index(b[1]) if b[1] else -1 for b in _BONES]),
        np.array([b[2] for b in _BONES]),
        {b[3]: j for j, b in enumerate(_BONES) if b[3]},
        np.array([names.index(n) for n in _TIPS]),
        np.array(list(_TIPS.values())),
    )


@dataclass(frozen=True)
class Targets:
    """What the figure is asked to do in each of F frames, in the world [m, rad].

    Turns are (yaw, pitch, roll): about +Y, then leaning forward, then tilting to the right.
    """

    pelvis: np.ndarray  # [F, 3]
    pelvis_turn: np.ndarray  # [F, 3]
    chest_turn: np.ndarray  # [F, 3]
    head_turn: np.ndarray  # [F, 3]
    hand: np.ndarray  # [F, 2, 3] the front of the fist, left and right
    elbow: np.ndarray  # [F, 2] 0: before the ribs, 1: out at shoulder height, -1: behind
    ball: np.ndarray  # [F, 2, 3] the ball of the foot
    foot_turn: np.ndarray  # [F, 2, 2] yaw, and how far the heel is raised about the ball


def turn(yaw_pitch_roll: np.ndarray) -> np.ndarray:
    """Quaternions [..., 4] of (yaw, pitch, roll) [..., 3]."""
    yaw = from_axis_angle(np.array([0.0, 1.0, 0.0]), yaw_pitch_roll[..., 0])
    pitch = from_axis_angle(np.array([1.0, 0.0, 0.0]), yaw_pitch_roll[..., 1])
    roll = from_axis_angle(np.array([0.0, 0.0, 1.0]), yaw_pitch_roll[..., 2])
    return multiply(yaw, multiply(pitch, roll))


def lowered(targets: Targets) -> np.ndarray:
    """Pelvis heights [F] at which both legs reach their feet, no higher than asked for."""
    height = targets.pelvis[:, 1].copy()
    q = turn(targets.pelvis_turn)
    longest = STRAIGHTEST * (THIGH + SHIN)
    for s, sign in enumerate((1.0, -1.0)):
        hip = rotate(q, np.array([sign * 0.09, -0.06, 0.0]))
        ankle = _ankle(targets, s)
        away = ankle[:, [0, 2]] - (targets.pelvis + hip)[:, [0, 2]]
        up = np.sqrt(np.maximum(longest**2 - np.sum(away**2, axis=1), 0.01))
        height = np.minimum(height, ankle[:, 1] + up - hip[:, 1])
    return height


def pose(targets: Targets) -> tuple[np.ndarray, np.ndarray]:
    """Root positions [F, 3] and joint rotations [F, J, 4] that meet the targets.

    A hand that is out of reach is reached for as far as the arm goes.
    """
    body = skeleton()
    frames = len(targets.pelvis)
    joint = {n: j for j, n in enumerate(body.names)}
    local = np.zeros((frames, len(body), 4))
    local[..., 0] = 1.0

    hips, chest, head = (
        turn(t) for t in (targets.pelvis_turn, targets.chest_turn, targets.head_turn)
    )
    half = np.full(frames, 0.5)
    spine = slerp(hips, chest, half)
    neck = slerp(chest, head, half)
    local[:, joint["Hips"]] = hips
    local[:, joint["Spine"]] = multiply(conjugate(hips), spine)
    local[:, joint["Chest"]] = multiply(conjugate(spine), chest)
    local[:, joint["Neck"]] = multiply(conjugate(chest), neck)
    local[:, joint["Head"]] = multiply(conjugate(neck), head)

    offset = body.offsets
    at_spine = targets.pelvis + rotate(hips, offset[joint["Spine"]])
    at_chest = at_spine + rotate(spine, offset[joint["Chest"]])
    for s, side in enumerate(("Left", "Right")):
        sign = 1.0 - 2.0 * s
        # The collarbone follows the fist a little: a reaching shoulder comes forward.
        collar = at_chest + rotate(chest, offset[joint[f"{side}Shoulder"]])
        reach = rotate(conjugate(chest), targets.hand[:, s] - collar)
        ahead = np.clip(reach[:, 2] - 0.25, 0.0, 0.5)
        rise = np.clip(reach[:, 1], -0.1, 0.3)
        clavicle = multiply(
            from_axis_angle(np.array([0.0, 1.0, 0.0]), -sign * 0.55 * ahead),
            from_axis_angle(np.array([0.0, 0.0, 1.0]), sign * 0.35 * rise),
        )
        local[:, joint[f"{side}Shoulder"]] = clavicle
        clavicle = multiply(chest, clavicle)
        shoulder = collar + rotate(clavicle, offset[joint[f"{side}Arm"]])
        # Down, a little out, and ahead: a fist at the chin has its elbow before the ribs.
        hang = np.array([0.3 * sign, -1.0, 0.5])
        out = np.array([1.0 * sign, 0.05, -0.35])
        behind = np.array([0.35 * sign, -0.2, -1.0])
        e = targets.elbow[:, s : s + 1]
        up, back = np.clip(e, 0.0, 1.0), np.clip(-e, 0.0, 1.0)
        pole = rotate(chest, (1 - up - back) * hang + up * out + back * behind)
        upper, lower = _two_bones(
            shoulder,
            targets.hand[:, s],
            UPPER_ARM,
            FOREARM + FIST,
            pole,
            np.array([sign, 0.0, 0.0]),
            (CLOSEST_FIST, ARM_STRAIGHTEST * (UPPER_ARM + FOREARM + FIST)),
        )
        local[:, joint[f"{side}Arm"]] = multiply(conjugate(clavicle), upper)
        local[:, joint[f"{side}ForeArm"]] = multiply(conjugate(upper), lower)

        hip = targets.pelvis + rotate(hips, offset[joint[f"{side}UpLeg"]])
        foot = _foot(targets, s)
        knee = rotate(_yaw(targets.foot_turn[:, s, 0]), np.array([0.0, 0.0, 1.0]))
        knee = knee + 0.5 * rotate(hips, np.array([0.25 * sign, 0.0, 1.0]))
        thigh, shin = _two_bones(
            hip,
            _ankle(targets, s),
            THIGH,
            SHIN,
            knee,
            np.array([0.0, -1.0, 0.0]),
            (0.1, 0.999 * (THIGH + SHIN)),
        )
        local[:, joint[f"{side}UpLeg"]] = multiply(conjugate(hips), thigh)
        local[:, joint[f"{side}Leg"]] = multiply(conjugate(thigh), shin)
        local[:, joint[f"{side}Foot"]] = multiply(conjugate(shin), foot)
        flat = from_axis_angle(np.array([1.0, 0.0, 0.0]), -targets.foot_turn[:, s, 1])
        local[:, joint[f"{side}Toes"]] = flat
    return targets.pelvis, local


def _yaw(angle: np.ndarray) -> np.ndarray:
    return from_axis_angle(np.array([0.0, 1.0, 0.0]), angle)


def _foot(targets: Targets, s: int) -> np.ndarray:
    heel = from_axis_angle(np.array([1.0, 0.0, 0.0]), targets.foot_turn[:, s, 1])
    return multiply(_yaw(targets.foot_turn[:, s, 0]), heel)


def _ankle(targets: Targets, s: int) -> np.ndarray:
    """Ankles [F, 3]: the foot turns about its ball."""
    return targets.ball[:, s] - rotate(_foot(targets, s), BALL)


def _two_bones(
    root: np.ndarray,
    goal: np.ndarray,
    first: float,
    second: float,
    pole: np.ndarray,
    axis: np.ndarray,
    reach: tuple[float, float],
) -> tuple[np.ndarray, np.ndarray]:
    """World rotations [F, 4] of two bones from root [F, 3] to goal [F, 3].

    pole [F, 3]: the way the middle joint points; axis [3]: the bones' direction at rest; reach: the
    shortest and the longest distance [m] between the ends that the bones may span. The bend's axis
    is the cross product of pole and direction, so a hinge bends one way only.
    """
    to = goal - root
    length = np.linalg.norm(to, axis=1, keepdims=True)
    way = to / np.maximum(length, 1e-6)
    d = np.clip(length[:, 0], *reach)
    out = pole - np.sum(pole * way, axis=1, keepdims=True) * way
    out = out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-6)
    along = (first**2 - second**2 + d**2) / (2 * d)
    aside = np.sqrt(np.maximum(first**2 - along**2, 0.0))
    upper = way * along[:, None] + out * aside[:, None]
    lower = way * d[:, None] - upper
    hinge = np.cross(out, way)
    return _frame(upper, hinge, axis), _frame(lower, hinge, axis)


def _frame(bone: np.ndarray, hinge: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Rotations [F, 4] that turn ``axis`` onto the bone, the joint's side axis on the hinge.

    The side axis at rest is +X for a leg (knees bend about it) and ∓Y for an arm in a T.
    """
    bone = bone / np.linalg.norm(bone, axis=1, keepdims=True)
    side = np.array([1.0, 0.0, 0.0]) if axis[1] else np.array([0.0, -axis[0], 0.0])
    third = np.cross(axis, side)
    hinge = hinge - np.sum(hinge * bone, axis=1, keepdims=True) * bone
    hinge = hinge / np.maximum(np.linalg.norm(hinge, axis=1, keepdims=True), 1e-9)
    rest = np.stack([axis, side, third], axis=1)  # columns
    now = np.stack([bone, hinge, np.cross(bone, hinge)], axis=2)
    return _from_matrix(now @ rest.T)


def _from_matrix(m: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(m).as_quat(scalar_first=True)
