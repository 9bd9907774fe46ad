"""What joints are for, by name: no numbers, so that who only reads names waits for none."""

from __future__ import annotations

SIDES = ("left", "right")
ARM_ROLES = ("clavicle", "upper_arm", "forearm", "hand")
LEG_ROLES = ("thigh", "shin", "foot", "toe")
ROLES = (
    "pelvis",
    "chest",
    "neck",
    "head",
    *(f"{side}_{part}" for side in SIDES for part in (*ARM_ROLES, *LEG_ROLES)),
)
"""What a joint is for. A limb's joint carries the name of the segment that turns with it:
``left_forearm`` is the elbow, ``left_hand`` the wrist, ``left_shin`` the knee."""
REQUIRED_ROLES = tuple(
    r for r in ROLES if r not in ("neck", *(f"{s}_{p}" for s in SIDES for p in ("clavicle", "toe")))
)
LIMBS = ("left_hand", "right_hand", "left_foot", "right_foot")
"""The limbs that can strike, in the order of every [.., 4] limb array."""
