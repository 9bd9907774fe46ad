"""The body laid on a skeleton as tapered capsules: what can be hit, weighed and measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kumite import rotation
from kumite.body.stance import (
    FOOT_OF_STATURE,
    FRONT,
    HAND_OF_STATURE,
    UP,
    Stance,
    crown_and_chin,
    stand,
)
from kumite.brief import brief
from kumite.checked import checked
from kumite.clip import SIDES, Skeleton
from kumite.errors import KumiteError, unknown

TOTAL_MASS = 75.0  # kg

# Segment masses as fractions of the whole, men: P. de Leva, J. Biomech. 29(9), 1996, table 4.
# His head and neck are one segment, split here by volume; upper, middle and lower trunk are the
# chest, waist and pelvis.
MASS_FRACTION = {
    "head": 0.0574,
    "neck": 0.0120,
    "chest": 0.1596,
    "waist": 0.1633,
    "pelvis": 0.1117,
    "upper_arm": 0.0271,
    "forearm": 0.0162,
    "hand": 0.0061,
    "thigh": 0.1416,
    "shin": 0.0433,
    "foot": 0.0137,
}
_SIDED = ("upper_arm", "forearm", "hand", "thigh", "shin", "foot")
PARTS = (
    "head",
    "neck",
    "chest",
    "waist",
    "pelvis",
    *(f"{side}_{part}" for side in SIDES for part in _SIDED),
)
ARMS = tuple(f"{side}_{part}" for side in SIDES for part in ("upper_arm", "forearm", "hand"))
"""Parts that guard: a blow that they stop is blocked."""

# Radii as fractions of the stature, at the start and end of each capsule: girths of ANSUR II's
# median man divided by 2π, hands with a 10 oz glove.
RADIUS = {
    "head": (0.050, 0.047),
    "neck": (0.034, 0.033),
    "chest": (0.066, 0.070),
    "waist": (0.068, 0.066),
    "pelvis": (0.072, 0.072),
    "upper_arm": (0.031, 0.026),
    "forearm": (0.026, 0.018),
    "hand": (0.030, 0.035),
    "thigh": (0.051, 0.036),
    "shin": (0.034, 0.021),
    "foot": (0.025, 0.020),
}


@checked
@brief
@dataclass(frozen=True)
class Body:
    """Tapered capsules, one a segment, each carried by a joint. A sphere has start == end."""

    parts: tuple[str, ...]  # B
    joint: np.ndarray  # [B] int32, the joint whose axes carry the part
    start: np.ndarray  # [B, 3] m, in the joint's axes
    end: np.ndarray  # [B, 3] m, in the joint's axes
    radius_start: np.ndarray  # [B] m
    radius_end: np.ndarray  # [B] m
    mass: np.ndarray  # [B] kg

    def __post_init__(self) -> None:
        put = object.__setattr__
        count = len(self.parts)
        for name, shape, dtype in (
            ("joint", (count,), np.int32),
            ("start", (count, 3), np.float64),
            ("end", (count, 3), np.float64),
            ("radius_start", (count,), np.float64),
            ("radius_end", (count,), np.float64),
            ("mass", (count,), np.float64),
        ):
            array = np.array(getattr(self, name), dtype=dtype)
            if array.shape != shape or not np.all(np.isfinite(array)):
                raise KumiteError(f"body: {name} is {array.shape}, expected finite {shape}")
            array.flags.writeable = False
            put(self, name, array)
        if np.any(self.radius_start <= 0) or np.any(self.radius_end <= 0) or np.any(self.mass <= 0):
            raise KumiteError("body: radii and masses must be more than 0")

    def __len__(self) -> int:
        return len(self.parts)

    def part(self, name: str) -> int:
        """The row of a part; :class:`KumiteError` if there is none of that name."""
        if name not in self.parts:
            raise unknown("body part", name, self.parts)
        return self.parts.index(name)


@checked
def lay_body(skeleton: Skeleton, *, total_mass: float = TOTAL_MASS) -> Body:
    """Lay a body on any skeleton with the required roles; sizes follow from its bones.

    ``total_mass`` in kg. Errors: roles that are missing; limbs without length.
    """
    if not (np.isfinite(total_mass) and total_mass > 0):
        raise KumiteError(f"body: a mass of {total_mass} kg, expected more than 0")
    stance = stand(skeleton)
    ends = _ends(skeleton, stance)
    joints = [ends[p][0] for p in PARTS]
    kinds = [p.removeprefix("left_").removeprefix("right_") for p in PARTS]
    radius = np.array([RADIUS[k] for k in kinds]) * stance.stature
    fraction = np.array([MASS_FRACTION[k] for k in kinds])
    return Body(
        PARTS,
        np.array(joints),
        np.array([stance.in_joint(j, ends[p][1]) for p, j in zip(PARTS, joints)]),
        np.array([stance.in_joint(j, ends[p][2]) for p, j in zip(PARTS, joints)]),
        radius[:, 0],
        radius[:, 1],
        total_mass * fraction / fraction.sum(),
    )


def _ends(skeleton: Skeleton, stance: Stance) -> dict[str, tuple[int, np.ndarray, np.ndarray]]:
    """The joint and the axis' two ends [3] of every part, in the standing pose."""
    h = stance.stature
    at = {role: stance.position[j] for role, j in skeleton.roles.items()}
    joint = skeleton.joint
    crown, chin = crown_and_chin(skeleton, stance)
    shoulders = 0.5 * (at["left_upper_arm"] + at["right_upper_arm"])
    hips = 0.5 * (at["left_thigh"] + at["right_thigh"])
    head = np.array([at["head"][0], 0.0, at["head"][2] + 0.012 * h])
    trunk = shoulders - hips
    neck_joint = skeleton.roles.get("neck", joint("chest"))
    waist = _waist_joint(skeleton, stance, hips + 0.45 * trunk)
    across = 0.055 * h * np.array([1.0, 0.0, 0.0])
    out: dict[str, tuple[int, np.ndarray, np.ndarray]] = {
        "head": (joint("head"), head + (chin + 0.046 * h) * UP, head + (crown - 0.048 * h) * UP),
        "neck": (neck_joint, shoulders + 0.02 * h * UP, head + (chin + 0.02 * h) * UP),
        "chest": (joint("chest"), hips + 0.62 * trunk, hips + 0.86 * trunk),
        "waist": (waist, hips + 0.32 * trunk, hips + 0.52 * trunk),
        # The pelvis lies across: wider than deep.
        "pelvis": (joint("pelvis"), hips - across + 0.08 * trunk, hips + across + 0.08 * trunk),
    }
    for side in SIDES:
        for part, child in (
            ("upper_arm", "forearm"),
            ("forearm", "hand"),
            ("thigh", "shin"),
            ("shin", "foot"),
        ):
            j = joint(f"{side}_{part}")
            out[f"{side}_{part}"] = (j, at[f"{side}_{part}"], at[f"{side}_{child}"])
        wrist = at[f"{side}_hand"]
        reach = wrist - at[f"{side}_forearm"]
        reach = reach / np.linalg.norm(reach)
        out[f"{side}_hand"] = (
            joint(f"{side}_hand"),
            wrist + 0.2 * HAND_OF_STATURE * h * reach,
            wrist + 0.42 * HAND_OF_STATURE * h * reach,
        )
        start, radius = RADIUS["foot"]
        heel, ball = foot_line(skeleton, stance, side)
        out[f"{side}_foot"] = (
            joint(f"{side}_foot"),
            heel + start * h * UP,
            ball + radius * h * UP,
        )
    return out


def foot_line(skeleton: Skeleton, stance: Stance, side: str) -> tuple[np.ndarray, np.ndarray]:
    """Centres [3] of the heel and of the toes' pads on the ground, in the standing pose."""
    ankle = stance.position[skeleton.joint(f"{side}_foot")]
    joint, offset = skeleton.tip(f"{side}_foot")
    tip = stance.position[joint] + rotation.rotate(stance.wxyz[joint], offset)
    ahead = (tip - ankle) * np.array([1.0, 0.0, 1.0])
    length = float(np.linalg.norm(ahead))
    ahead = ahead / length if length > 1e-6 else FRONT
    ankle = np.array([ankle[0], stance.ground, ankle[2]])
    h = stance.stature
    return ankle - 0.012 * h * ahead, ankle + (0.70 * FOOT_OF_STATURE) * h * ahead


def _waist_joint(skeleton: Skeleton, stance: Stance, centre: np.ndarray) -> int:
    """The spine joint that turns with the waist: the highest one that lies below its middle."""
    pelvis, chest = skeleton.joint("pelvis"), skeleton.joint("chest")
    below = [j for j in _spine(skeleton, pelvis, chest) if stance.position[j][1] <= centre[1]]
    return below[-1] if below else pelvis


def _spine(skeleton: Skeleton, pelvis: int, chest: int) -> list[int]:
    """Joints from the pelvis up to the chest; the pelvis may be no ancestor (a side branch)."""
    path = [chest]
    while path[-1] > 0 and path[-1] != pelvis:
        path.append(int(skeleton.parents[path[-1]]))
    return path[::-1]
