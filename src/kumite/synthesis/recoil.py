"""How a struck body gives way without physics: the joints below the blow turn, and come back."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kumite.clip import SIDES, Skeleton, forward_kinematics
from kumite.kernels import character as kernels
from kumite.rotation import conjugate, exp, multiply, rotate

# One for whatever strikes: a ball is lighter than an arm, but what it does is to be seen as well.
# A hand or a ball of 9 m/s asks for 16 cm; MOST_GIVEN bounds what joints do about it.
RECOIL = 0.018  # m that a struck segment gives way per m/s of what strikes it
REACTION_HALF_LIFE = 0.16  # s, in which a struck body recovers
SHARES = 3.0  # how much more readily each joint from the pelvis out gives way than the one before
DAMPING = 0.02  # of the step of inverse kinematics: no joint whirls where none can give way
MOST_GIVEN = 0.6  # rad that a joint gives way, however hard or often it is struck
MOST_BENT = np.radians(150.0)  # of an elbow
STRAIGHT = np.radians(6.0)  # an elbow bent less is straight: it locks, the shoulder gives way
RATE = 2.0 * np.log(2.0) / REACTION_HALF_LIFE  # 1/s, of the spring it comes back by


def give_way(
    skeleton: Skeleton,
    position: np.ndarray,
    world_wxyz: np.ndarray,
    joint: int,
    point: np.ndarray,
    displacement: np.ndarray,
) -> tuple[list[int], np.ndarray, np.ndarray]:
    """Joints [n] that turn, rotation vectors [n, 3] in their axes that move a struck point, and how
    far [n] rad each may be turned at most.

    One damped Jacobian step of inverse kinematics over the joints from the pelvis to the struck
    one, the outer ones giving way more readily (Lee & Lee 2004, section 6, reaction). ``point`` [3]
    of the pose ([J, 3], [J, 4], world) moves by about ``displacement`` [3] m. An elbow is a hinge
    that only bends: a blow that would open it is left to the shoulder.
    """
    arm = next((a for a in map(_arm(skeleton), SIDES) if joint in a[1:]), None)
    chain = skeleton.trunk(arm[0] if arm else joint) or [joint]  # a waist may be the pelvis itself
    levers = point - position[chain]
    axes, owner = np.tile(np.eye(3), (len(chain), 1)), np.repeat(np.arange(len(chain)), 3)
    most = np.full(len(chain), MOST_GIVEN)
    turn = _step(axes, owner, levers, displacement)
    if arm:
        bend, hinge = _bend(position[arm])
        elbow = len(chain)
        more = _step(
            np.vstack([axes, hinge]),
            np.append(owner, elbow),
            np.vstack([levers, point - position[arm[1]]]),
            displacement,
        )
        if bend > STRAIGHT and more[elbow] @ hinge > 0.0:
            chain, turn = [*chain, arm[1]], more
            most = np.append(most, min(MOST_GIVEN, max(MOST_BENT - bend, 0.0)))
    return chain, rotate(conjugate(world_wxyz[chain]), turn), most


def _arm(skeleton: Skeleton) -> Callable[[str], list[int]]:
    return lambda side: [skeleton.joint(f"{side}_{p}") for p in ("upper_arm", "forearm", "hand")]


def _bend(arm: np.ndarray) -> tuple[float, np.ndarray]:
    """How far [rad] an elbow is bent (shoulder, elbow, wrist [3, 3]), and the axis [3] about which
    its forearm bends more."""
    upper, fore = arm[1] - arm[0], arm[2] - arm[1]
    hinge = np.cross(upper, fore)
    sine = float(np.linalg.norm(hinge))
    return float(np.arctan2(sine, upper @ fore)), hinge / max(sine, 1e-9)


def _step(
    axes: np.ndarray, owner: np.ndarray, levers: np.ndarray, displacement: np.ndarray
) -> np.ndarray:
    """Turns [N, 3] of joints that move a point by about ``displacement`` [3], least squares.

    axes [M, 3]: about which joint owner [M] may turn; levers [N, 3]: from the joints to the point.
    """
    turn = np.zeros_like(levers)
    kernels.give_way(axes, owner, levers, displacement, SHARES, DAMPING, turn)
    return turn


def recoiling(
    skeleton: Skeleton,
    root_position: np.ndarray,
    wxyz: np.ndarray,
    joint: int,
    point: np.ndarray,
    displacement: np.ndarray,
    fps: float,
) -> np.ndarray:
    """Rotations [T, J, 4] of a motion ([T, 3], [T, J, 4]) struck one frame before its first.

    The critically damped spring peaks at the displacement and comes back.
    """
    position, world = forward_kinematics(skeleton, root_position[:1], wxyz[:1])
    chain, turn, most = give_way(skeleton, position[0], world[0], joint, point, displacement)
    turn *= np.minimum(1.0, most / np.maximum(np.linalg.norm(turn, axis=1), 1e-9))[:, None]
    t = (1.0 + np.arange(len(wxyz))) / fps
    share = np.e * RATE * t * np.exp(-RATE * t)
    out = wxyz.copy()
    out[:, chain] = multiply(wxyz[:, chain], exp(share[:, None, None] * turn))
    return out
