"""The performer's body: its skeleton, and poses from where hips, chest, head, hands and feet are.

An animator thinks in places: this pelvis height, that fist there, this foot flat. The figure turns
such targets into joint rotations with analytic two-bone limbs, all frames at once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kumite.clip import Skeleton
from kumite.performer.clearance import clear_elbow, clear_hands
from kumite.performer.limbs import held, middle, swivelled, two_bones
from kumite.performer.skeleton import (
    BALL,
    BLADE,
    BONES,
    COLLARS,
    FIST,
    FOREARM,
    HIPS,
    SHIN,
    THIGH,
    UPPER_ARM,
    Trunk,
    trunk,
    turn,
)
from kumite.rotation import conjugate, cross, from_axis_angle, multiply, rotate

STRAIGHTEST = 0.985  # of a leg's length: knees never lock
ARM_STRAIGHTEST = 0.998
CLOSEST_FIST = 0.215  # m from the shoulder: an elbow folds no further
FADE = 0.08  # m over which what a leg does by itself sets in
STRIDE = 0.23  # m of a foot from below its hip, as CROUCHED
CROUCHED = 0.76  # m from hip to ankle, below which heels may have to rise
CLOSEST_ANKLE = 0.22  # m from the hip
STEEPEST_SHIN = 0.56  # rad that an ankle bends: a shin that leans further raises the heel
KNEE_HEIGHT = 0.06  # m of the joint above the ground, kneeling
GRIP = 3.0  # frames over which a hand rolls about its sword
BRAKE = 0.02  # m over which an arm comes to its longest
SWIVEL = 75.0  # deg by which an elbow that is "out" is raised from where it hangs


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
    elbow: np.ndarray  # [F, 2] 0: hanging, 1: out at shoulder height, below 0: tucked in
    ball: np.ndarray  # [F, 2, 3] the ball of the foot
    foot_turn: np.ndarray  # [F, 2, 2] yaw, and how far the heel is raised about the ball
    blade: np.ndarray | None = None  # [F, 3] the way a sword points


def lowered(targets: Targets) -> np.ndarray:
    """Pelvis heights [F] at which both legs reach their feet, no higher than asked for."""
    height = targets.pelvis[:, 1].copy()
    q = turn(targets.pelvis_turn)
    longest = STRAIGHTEST * (THIGH + SHIN)
    for s in range(2):
        hip = rotate(q, HIPS[s])
        ankle = _ankle(targets, s)
        away = ankle[:, [0, 2]] - (targets.pelvis + hip)[:, [0, 2]]
        up = np.sqrt(np.maximum(longest**2 - np.sum(away**2, axis=1), 0.01))
        height = np.minimum(height, ankle[:, 1] + up - hip[:, 1])
    return height


def _frames(targets: Targets, some: np.ndarray) -> Targets:
    """The targets of some frames."""
    t = targets
    pose = (
        t.pelvis,
        t.pelvis_turn,
        t.chest_turn,
        t.head_turn,
        t.hand,
        t.elbow,
        t.ball,
        t.foot_turn,
    )
    return Targets(*(array[some] for array in pose))


def with_heels_raised(targets: Targets) -> Targets:
    """The targets with heels raised where a knee is so far ahead that the ankle could not bend."""
    foot_turn = targets.foot_turn.copy()
    hips = turn(targets.pelvis_turn)
    for s in range(2):
        hip = targets.pelvis + rotate(hips, HIPS[s])
        leg = hip - _ankle(targets, s)
        # Cheap to tell where it may be so; the raise fades in with it, so that no heel jumps.
        folded = (CROUCHED - np.linalg.norm(leg, axis=1)) / FADE
        astride = (np.hypot(leg[:, 0], leg[:, 2]) - STRIDE) / FADE
        share = np.clip(np.maximum(folded, astride), 0.0, 1.0)
        some = np.flatnonzero(share)
        if not len(some):
            continue
        part = _frames(targets, some)
        for _ in range(4):
            ankle = _ankle(part, s)
            down = ankle - hip[some] - _knee(hips[some], hip[some], ankle, part, s)
            down = down / np.linalg.norm(down, axis=1, keepdims=True)
            toes = rotate(_foot(part, s), np.array([0.0, 0.0, 1.0]))
            bend = -np.arcsin(np.clip(np.sum(down * toes, axis=1), -1.0, 1.0))
            part.foot_turn[:, s, 1] += 0.8 * 0.05 * np.logaddexp(0.0, (bend - STEEPEST_SHIN) / 0.05)
        raised = part.foot_turn[:, s, 1] - foot_turn[some, s, 1]
        foot_turn[some, s, 1] += share[some] ** 2 * (3.0 - 2.0 * share[some]) * raised
    return replace(targets, foot_turn=foot_turn)


def pose(targets: Targets, body: Skeleton) -> np.ndarray:
    """Joint rotations [F, J, 4] that meet the targets; the root is the pelvis.

    A hand that is out of reach is reached for as far as the arm goes.
    """
    frames = len(targets.pelvis)
    joint = {n: j for j, n in enumerate(body.names)}
    local = np.zeros((frames, len(body), 4))
    local[..., 0] = 1.0
    t = trunk(targets.pelvis, targets.pelvis_turn, targets.chest_turn, targets.head_turn)
    for name, parent, _, _ in BONES[:5]:
        turned = t.turned[name]
        local[:, joint[name]] = turned if parent is None else _from(t.turned[parent], turned)
    shoulders = np.stack([t.carried("Chest", p) for p in _SHOULDERS], axis=1)
    hand = clear_hands(targets.hand, shoulders, t)
    for s, side in enumerate(("Left", "Right")):
        clavicle, upper, lower = _arm(t, hand[:, s], targets.elbow[:, s], s)
        local[:, joint[f"{side}Shoulder"]] = clavicle
        local[:, joint[f"{side}Arm"]] = _from(clavicle, upper)
        local[:, joint[f"{side}ForeArm"]] = _from(upper, lower)
        if s == 1 and targets.blade is not None:
            blade = rotate(conjugate(t.turned["Chest"]), targets.blade)
            held_so = held(lower, blade, np.array([-1.0, 0.0, 0.0]), BLADE, GRIP)
            local[:, joint["RightHand"]] = _from(lower, held_so)
        thigh, shin = _leg(t.turned["Hips"], targets, s)
        foot = _foot(targets, s)
        local[:, joint[f"{side}UpLeg"]] = _from(t.turned["Hips"], thigh)
        local[:, joint[f"{side}Leg"]] = _from(thigh, shin)
        local[:, joint[f"{side}Foot"]] = _from(shin, foot)
        flat = from_axis_angle(
            np.array([1.0, 0.0, 0.0]), -np.maximum(targets.foot_turn[:, s, 1], 0)
        )
        local[:, joint[f"{side}Toes"]] = flat
    return local


_SHOULDERS = (np.array([0.18, 0.195, 0.0]), np.array([-0.18, 0.195, 0.0]))  # in the chest's axes


def _from(parent: np.ndarray, child: np.ndarray) -> np.ndarray:
    return multiply(conjugate(parent), child)


def _arm(
    t: Trunk, hand: np.ndarray, elbow: np.ndarray, s: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Collarbone, upper arm and forearm [F, 4], in the chest's axes, of an arm to a fist [F, 3]."""
    sign = 1.0 - 2.0 * s
    out = np.array([sign, 0.0, 0.0])
    chest = t.turned["Chest"]
    collar, to_shoulder = COLLARS[s]
    fist = rotate(conjugate(chest), hand - t.at["Chest"]) - collar
    # The collarbone follows the fist a little: a reaching shoulder comes forward.
    ahead = np.clip(fist[:, 2] - 0.25, 0.0, 0.5)
    rise = np.clip(fist[:, 1], -0.1, 0.3)
    clavicle = multiply(
        from_axis_angle(np.array([0.0, 1.0, 0.0]), -sign * 0.55 * ahead),
        from_axis_angle(np.array([0.0, 0.0, 1.0]), sign * 0.35 * rise),
    )
    shoulder = collar + rotate(clavicle, to_shoulder)
    goal = fist + collar
    pole = swivelled(
        goal - shoulder,
        np.array([-0.3 * sign, -0.2, 0.933]),
        np.array([0.35 * sign, -0.9, -0.08]),
        sign * np.radians(SWIVEL) * elbow,
    )
    lengths = (UPPER_ARM, FOREARM + FIST)
    reach = (CLOSEST_FIST, ARM_STRAIGHTEST * (UPPER_ARM + FOREARM + FIST))
    bent = middle(shoulder, goal, lengths, pole, reach, BRAKE)
    room = clear_elbow(t.at["Chest"] + rotate(chest, shoulder + bent), t)
    pole = rotate(conjugate(chest), room - t.at["Chest"]) - shoulder
    upper, lower = two_bones(shoulder, goal, lengths, pole, out, reach, BRAKE)
    return clavicle, upper, lower


_LEG = (THIGH, SHIN)
_LEG_REACH = (CLOSEST_ANKLE, 0.999 * (THIGH + SHIN))


def _leg(hips: np.ndarray, targets: Targets, s: int) -> tuple[np.ndarray, np.ndarray]:
    """Thigh and shin [F, 4], in the world, of a leg to its ankle."""
    hip, ankle = targets.pelvis + rotate(hips, HIPS[s]), _ankle(targets, s)
    bent = _knee(hips, hip, ankle, targets, s)
    return two_bones(hip, ankle, _LEG, bent, np.array([0.0, -1.0, 0.0]), _LEG_REACH)


def _knee(
    hips: np.ndarray, hip: np.ndarray, ankle: np.ndarray, targets: Targets, s: int
) -> np.ndarray:
    """Where a knee is [F, 3], seen from its hip: the way the foot and the hips point."""
    sign = 1.0 - 2.0 * s
    yaw = targets.foot_turn[:, s, 0]
    pole = np.stack([np.sin(yaw), np.zeros(len(yaw)), np.cos(yaw)], axis=1)
    pole += 0.5 * rotate(hips, np.array([0.25 * sign, 0.0, 1.0]))
    bent = middle(hip, ankle, _LEG, pole, _LEG_REACH)
    share = np.clip((KNEE_HEIGHT + FADE - hip[:, 1] - bent[:, 1]) / FADE, 0.0, 1.0)[:, None]
    low = np.flatnonzero(share)
    if len(low):
        out = sign * rotate(hips[low], np.array([1.0, 0.0, 0.0]))
        bent[low] += share[low] * (_off_the_floor(hip[low], ankle[low], bent[low], out) - bent[low])
    return bent


def _off_the_floor(
    hip: np.ndarray, ankle: np.ndarray, bent: np.ndarray, outward: np.ndarray
) -> np.ndarray:
    """Knees [F, 3], seen from the hips, turned about the leg's line until none is in the floor."""
    way = ankle - hip
    way = way / np.linalg.norm(way, axis=1, keepdims=True)
    along = np.sum(bent * way, axis=1)
    out = bent - along[:, None] * way
    radius = np.maximum(np.linalg.norm(out, axis=1), 1e-6)
    up = np.array([0.0, 1.0, 0.0]) - way[:, 1:2] * way
    steep = np.maximum(np.linalg.norm(up, axis=1), 1e-3)
    up = up / steep[:, None]
    side = cross(way, up)
    rise = np.sum(out * up, axis=1) / radius
    least = (KNEE_HEIGHT - hip[:, 1] - along * way[:, 1]) / (radius * steep)
    soft = 0.04
    rise_to = np.minimum(least + soft * np.logaddexp(0.0, (rise - least) / soft), 0.98)
    aside = np.sum(out * side, axis=1) / radius + 0.3 * np.sum(outward * side, axis=1)
    aside = np.tanh(aside / 0.1) * np.sqrt(np.maximum(1.0 - rise_to**2, 0.0))
    return along[:, None] * way + radius[:, None] * (rise_to[:, None] * up + aside[:, None] * side)


def _foot(targets: Targets, s: int) -> np.ndarray:
    """A foot's world rotation [F, 4]: its yaw, and then the heel about the ball."""
    yaw, heel = 0.5 * targets.foot_turn[:, s, 0], 0.5 * targets.foot_turn[:, s, 1]
    cy, sy, ch, sh = np.cos(yaw), np.sin(yaw), np.cos(heel), np.sin(heel)
    return np.stack([cy * ch, cy * sh, sy * ch, -sy * sh], axis=1)


def _ankle(targets: Targets, s: int) -> np.ndarray:
    """Ankles [F, 3]: the foot turns about its ball."""
    yaw, heel = targets.foot_turn[:, s, 0], targets.foot_turn[:, s, 1]
    ahead = np.sin(heel) * BALL[1] + np.cos(heel) * BALL[2]
    up = np.cos(heel) * BALL[1] - np.sin(heel) * BALL[2]
    offset = np.stack([np.sin(yaw) * ahead, up, np.cos(yaw) * ahead], axis=1)
    return targets.ball[:, s] - offset
