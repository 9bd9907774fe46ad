"""A skeleton put on its feet: the pose in which a body is measured and modelled.

Files rest in many poses: arms sideways, legs 20° apart (CMU), the whole figure lying along an axis.
A body is modelled once, in a pose where every part is easy to describe: upright, facing +Z, legs
down, arms hanging 50° off the side. Each bone is turned there from its rest direction by the
shortest arc, so the twist about a bone stays what the file's rest pose says.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kumite import rotation
from kumite.clip import REQUIRED_ROLES, SIDES, Skeleton
from kumite.errors import KumiteError

# Heights and lengths as fractions of the stature: Drillis & Contini 1966 (in Winter,
# Biomechanics and Motor Control of Human Movement, fig. 4.1).
LEG_OF_STATURE = 0.491  # thigh and shin
ANKLE_OF_STATURE = 0.046  # ankle joint above the sole
TOE_OF_STATURE = 0.014  # ball of the foot above the sole, at the least
HEAD_OF_STATURE = 0.130  # chin to crown
CROWN_OF_STATURE = 0.182  # crown above the shoulder joints
FOOT_OF_STATURE = 0.152
HAND_OF_STATURE = 0.100  # a fist, gloved

UP = np.array([0.0, 1.0, 0.0])
FRONT = np.array([0.0, 0.0, 1.0])
LEFT = np.array([1.0, 0.0, 0.0])


@dataclass(frozen=True)
class Stance:
    """The standing pose of a skeleton, root joint at the origin, facing +Z."""

    position: np.ndarray  # [J, 3] m
    wxyz: np.ndarray  # [J, 4] from each joint's axes to the world's
    stature: float  # m, from the legs
    ground: float  # m, height of the soles (below the root, so negative)

    def in_joint(self, joint: int, point: np.ndarray) -> np.ndarray:
        """World points [..., 3] in the axes of a joint."""
        return rotation.rotate(
            rotation.conjugate(self.wxyz[joint]), np.asarray(point) - self.position[joint]
        )


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / max(float(np.linalg.norm(vector)), 1e-12)


def _upright(skeleton: Skeleton) -> np.ndarray:
    """The turn [4] that brings the rest pose's left, up and front onto +X, +Y and +Z."""
    rest = skeleton.rest_positions
    up = _unit(rest[skeleton.joint("head")] - rest[skeleton.joint("pelvis")])
    left = rest[skeleton.joint("left_thigh")] - rest[skeleton.joint("right_thigh")]
    left = _unit(left - up * float(left @ up))
    # A spine that leans a little at rest is a posture, not another up axis.
    if up[1] > 0.9:
        up = UP
        left = _unit(left * np.array([1.0, 0.0, 1.0]))
    axes = np.stack([left, up, np.cross(left, up)])
    if abs(np.linalg.det(axes) - 1.0) > 1e-6:
        raise KumiteError("skeleton: the hips lie on top of each other or along the spine")
    if np.allclose(axes, np.eye(3), atol=0.05):
        return rotation.IDENTITY_WXYZ  # hips a little askew are a person's, not a file's axes
    turn = rotation.between(up, UP)
    left = rotation.rotate(turn, left)
    return rotation.multiply(rotation.from_yaw(np.arctan2(left[2], left[0])), turn)


def _wanted(side: float) -> dict[str, np.ndarray]:
    """Directions [3] of one side's bones when standing; side is +1 left, −1 right."""
    arm = np.array([np.cos(0.87) * side, -np.sin(0.87), 0.0])
    return {
        "upper_arm": arm,
        "forearm": _unit(arm + 0.12 * FRONT),
        "hand": _unit(arm + 0.12 * FRONT),
        "thigh": _unit(np.array([0.05 * side, -1.0, 0.02])),
        "shin": _unit(np.array([0.02 * side, -1.0, -0.02])),
    }


def stand(skeleton: Skeleton) -> Stance:
    """Put a skeleton on its feet.

    Errors: :class:`KumiteError` naming the roles the skeleton lacks; limbs without length.
    """
    lacking = [r for r in REQUIRED_ROLES if r not in skeleton.roles]
    if lacking:
        raise KumiteError(f"no body for this skeleton: it has no joint for {', '.join(lacking)}")
    rest = skeleton.rest_positions
    upright = _upright(skeleton)
    turn: dict[int, np.ndarray] = {0: upright}
    for side, sign in zip(SIDES, (1.0, -1.0)):
        wanted = _wanted(sign)
        for part, child in (
            ("upper_arm", "forearm"),
            ("forearm", "hand"),
            ("thigh", "shin"),
            ("shin", "foot"),
        ):
            joint = skeleton.joint(f"{side}_{part}")
            bone = rest[skeleton.joint(f"{side}_{child}")] - rest[joint]
            if np.linalg.norm(bone) < 1e-6:
                raise KumiteError(f"no body for this skeleton: its {side} {part} has no length")
            direction = rotation.rotate(upright, bone)
            arc = rotation.between(direction, wanted[part])
            turn[joint] = rotation.multiply(arc, upright)
        turn[skeleton.joint(f"{side}_hand")] = turn[skeleton.joint(f"{side}_forearm")]
        turn[skeleton.joint(f"{side}_foot")] = _flat_foot(skeleton, side, upright)
    wxyz = np.empty((len(skeleton), 4))
    position = np.zeros((len(skeleton), 3))
    for j in range(len(skeleton)):
        parent = int(skeleton.parents[j])
        wxyz[j] = turn[j] if j in turn else wxyz[parent]
        if j:
            position[j] = position[parent] + rotation.rotate(wxyz[parent], skeleton.offsets[j])
    stature, ground = _measure(skeleton, position)
    return Stance(position, wxyz, stature, ground)


def _flat_foot(skeleton: Skeleton, side: str, upright: np.ndarray) -> np.ndarray:
    """The foot's world rotation [4] on flat ground: as at rest, unless the rest foot hangs."""
    joint, offset = skeleton.tip(f"{side}_foot")
    rest = skeleton.rest_positions
    toe = rest[joint] + offset - rest[skeleton.joint(f"{side}_foot")]
    toe = rotation.rotate(upright, toe)
    if _unit(toe)[2] > 0.6:
        return upright
    flat = _unit(FRONT - 0.35 * UP)
    return rotation.multiply(rotation.between(toe, flat), upright)


def _measure(skeleton: Skeleton, position: np.ndarray) -> tuple[float, float]:
    """Stature [m] from the legs, and the height of the soles [m]."""
    legs, soles = [], []
    for side in SIDES:
        hip, knee, ankle = (
            position[skeleton.joint(f"{side}_{r}")] for r in ("thigh", "shin", "foot")
        )
        legs.append(np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee))
        soles.append(ankle[1])
    stature = float(np.mean(legs)) / LEG_OF_STATURE
    ground = float(np.mean(soles)) - ANKLE_OF_STATURE * stature
    for side in SIDES:
        toe = skeleton.roles.get(f"{side}_toe")
        if toe is not None:
            ground = min(ground, float(position[toe][1]) - TOE_OF_STATURE * stature)
    return stature, ground


def crown_and_chin(skeleton: Skeleton, stance: Stance) -> tuple[float, float]:
    """Heights [m] of the top of the head and of the chin in the standing pose.

    From the shoulders, held near the head's joint: files put that joint anywhere from the base of
    the neck to the middle of the skull.
    """
    h = stance.stature
    shoulders = np.mean([stance.position[skeleton.joint(f"{s}_upper_arm")][1] for s in SIDES])
    joint = float(stance.position[skeleton.joint("head")][1])
    crown = float(np.clip(shoulders + CROWN_OF_STATURE * h, joint + 0.06 * h, joint + 0.14 * h))
    return crown, crown - HEAD_OF_STATURE * h
