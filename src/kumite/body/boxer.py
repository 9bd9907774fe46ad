"""The look of the body: a boxer in vest, shorts, gloves and boots.

Every part is swept along a bone of the standing skeleton. Numbers in the tables are metres for a
person of 1.80 m, drawn after the breadths and depths of ANSUR II's median man; they scale with the
stature, lengths along a limb with its bones. A limb is one surface over its joints, with weights
that pass from bone to bone, so that knees and elbows bend without gaps; where limbs meet the trunk
they start inside it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kumite import rotation
from kumite.body.stance import FRONT, LEFT, UP, Stance, crown_and_chin
from kumite.body.sweep import (
    AHEAD,
    AT,
    Surface,
    closed_tube,
    place,
    place_along,
    profile,
    ring_points,
    smoothstep,
)
from kumite.clip import SIDES, Skeleton

MODEL_STATURE = 1.80  # m, of the tables
MODEL_SHOULDER = 0.193  # m, half the distance between the shoulder joints
MODEL_HIP = 0.090  # m, half the distance between the hip joints

# at is the way from the hip joints (0) to the shoulder joints (1).
TRUNK = (
    (0.26, 0.100, 0.060, 0.060),
    (0.27, 0.138, 0.096, 0.088),
    (0.36, 0.139, 0.100, 0.088),
    (0.48, 0.145, 0.106, 0.094),
    (0.62, 0.160, 0.116, 0.107),
    (0.74, 0.174, 0.125, 0.116),
    (0.84, 0.182, 0.128, 0.121),
    (0.92, 0.181, 0.119, 0.121),
    (1.00, 0.168, 0.100, 0.114),
    (1.06, 0.143, 0.080, 0.103, -0.004),
    (1.10, 0.115, 0.064, 0.092, -0.008),
    (1.12, 0.101, 0.056, 0.085, -0.010),
    (1.12, 0.080, 0.040, 0.066, -0.010),
)
PELVIS = (
    (-0.23, 0.040, 0.030, 0.030),
    (-0.21, 0.085, 0.060, 0.065),
    (-0.12, 0.140, 0.092, 0.105),
    (0.00, 0.172, 0.106, 0.128),
    (0.12, 0.172, 0.110, 0.126),
    (0.24, 0.157, 0.108, 0.108),
    (0.33, 0.147, 0.105, 0.097),
    (0.34, 0.100, 0.070, 0.060),
)
WAISTBAND = (
    (0.275, 0.120, 0.090, 0.085),
    (0.280, 0.156, 0.112, 0.108),
    (0.310, 0.153, 0.110, 0.105),
    (0.345, 0.149, 0.108, 0.100),
    (0.350, 0.130, 0.094, 0.085),
)
# at is metres above the shoulder joints.
NECK = (
    (-0.030, 0.110, 0.045, 0.070, -0.012),
    (0.045, 0.100, 0.052, 0.080, -0.012),
    (0.064, 0.083, 0.054, 0.077, -0.011),
    (0.082, 0.067, 0.055, 0.070, -0.009),
    (0.105, 0.058, 0.055, 0.063, -0.004),
    (0.130, 0.057, 0.056, 0.060, 0.002),
    (0.165, 0.050, 0.050, 0.050, 0.004),
)
# at runs along the arm: 0 shoulder, 1 elbow, 2 wrist; sides is in the plane of the raised arm.
ARM = (
    (-0.22, 0.018, 0.018, 0.018),
    (-0.17, 0.046, 0.044, 0.046),
    (-0.06, 0.063, 0.062, 0.062),
    (0.12, 0.065, 0.065, 0.064),
    (0.28, 0.058, 0.061, 0.058),
    (0.50, 0.049, 0.057, 0.053),
    (0.75, 0.043, 0.048, 0.047),
    (0.94, 0.041, 0.042, 0.043),
    (1.05, 0.043, 0.043, 0.042),
    (1.20, 0.046, 0.048, 0.043),
    (1.40, 0.043, 0.045, 0.041),
    (1.65, 0.035, 0.037, 0.035),
    (1.88, 0.029, 0.031, 0.031),
    (2.00, 0.026, 0.030, 0.030),
)
# at is metres from the wrist towards the knuckles; front is the side of the thumb.
GLOVE = (
    (-0.074, 0.030, 0.032, 0.032),
    (-0.073, 0.040, 0.043, 0.043),
    (-0.030, 0.039, 0.042, 0.042),
    (0.000, 0.039, 0.042, 0.041),
    (0.020, 0.045, 0.048, 0.047),
    (0.050, 0.054, 0.056, 0.056),
    (0.085, 0.057, 0.059, 0.060),
    (0.112, 0.051, 0.054, 0.056),
    (0.128, 0.036, 0.040, 0.042),
    (0.134, 0.014, 0.017, 0.018),
)
GLOVE_THUMB = (
    (0.000, 0.008, 0.008, 0.008),
    (0.006, 0.018, 0.017, 0.017),
    (0.030, 0.023, 0.021, 0.021),
    (0.060, 0.021, 0.020, 0.020),
    (0.074, 0.013, 0.012, 0.012),
    (0.078, 0.004, 0.004, 0.004),
)
CUFF = (
    (-0.079, 0.034, 0.036, 0.036),
    (-0.078, 0.043, 0.046, 0.046),
    (-0.052, 0.043, 0.046, 0.046),
    (-0.051, 0.034, 0.036, 0.036),
)
# at runs along the leg: 0 hip, 1 knee, 2 ankle.
LEG = (
    (-0.02, 0.040, 0.040, 0.040),
    (0.02, 0.078, 0.078, 0.084),
    (0.20, 0.083, 0.083, 0.088),
    (0.40, 0.077, 0.078, 0.080),
    (0.65, 0.065, 0.069, 0.066),
    (0.85, 0.056, 0.060, 0.055),
    (0.98, 0.052, 0.060, 0.050),
    (1.08, 0.050, 0.054, 0.050),
    (1.20, 0.052, 0.047, 0.058),
    (1.34, 0.053, 0.044, 0.066),
    (1.50, 0.047, 0.041, 0.058),
    (1.72, 0.036, 0.036, 0.042),
    (1.90, 0.032, 0.036, 0.038),
    (1.96, 0.030, 0.034, 0.036),
)
SHORTS_LEG = (
    (-0.16, 0.040, 0.040, 0.050),
    (-0.14, 0.068, 0.080, 0.098),
    (-0.02, 0.088, 0.098, 0.122),
    (0.15, 0.096, 0.100, 0.116),
    (0.40, 0.099, 0.102, 0.106),
    (0.62, 0.101, 0.106, 0.106),
    (0.63, 0.098, 0.102, 0.102),
    (0.615, 0.070, 0.072, 0.072),
)
BOOT = (
    (1.58, 0.034, 0.034, 0.040),
    (1.585, 0.046, 0.043, 0.056),
    (1.70, 0.042, 0.042, 0.050),
    (1.86, 0.039, 0.043, 0.046),
    (1.97, 0.041, 0.050, 0.048),
    (2.06, 0.040, 0.050, 0.046),
    (2.10, 0.030, 0.034, 0.034),
)
SOCK = (
    (1.54, 0.032, 0.032, 0.038),
    (1.545, 0.047, 0.044, 0.060),
    (1.60, 0.049, 0.046, 0.060),
    (1.605, 0.034, 0.034, 0.040),
)
# at is metres ahead of the ankle; sides, height of the upper above the ground.
SHOE = (
    (-0.066, 0.012, 0.046),
    (-0.060, 0.026, 0.060),
    (-0.040, 0.036, 0.080),
    (0.000, 0.040, 0.100),
    (0.040, 0.042, 0.098),
    (0.085, 0.045, 0.078),
    (0.130, 0.050, 0.062),
    (0.170, 0.048, 0.052),
    (0.198, 0.036, 0.044),
    (0.212, 0.016, 0.036),
)
SOLE_THICK = 0.018  # m
SOLE_RIM = 0.004  # m, how far the sole stands out
# at is the way from chin (0) to crown (1).
HEAD = (
    (-0.02, 0.012, 0.014, 0.014, 0.052),
    (0.01, 0.030, 0.032, 0.040, 0.048),
    (0.08, 0.046, 0.048, 0.058, 0.034),
    (0.18, 0.056, 0.064, 0.074, 0.022),
    (0.30, 0.063, 0.075, 0.084, 0.014),
    (0.42, 0.068, 0.080, 0.092, 0.008),
    (0.52, 0.071, 0.082, 0.098, 0.003),
    (0.63, 0.073, 0.089, 0.102, 0.000),
    (0.76, 0.072, 0.084, 0.101, -0.002),
    (0.87, 0.061, 0.069, 0.088, -0.004),
    (0.95, 0.041, 0.045, 0.062, -0.008),
    (0.99, 0.018, 0.019, 0.026, -0.012),
    (1.00, 0.004, 0.004, 0.006, -0.014),
)
HAIR_THICK = 0.008  # m
# at is metres from the grip, in the fist, towards the point; front is the edge.
HILT = (
    (-0.100, 0.010, 0.010, 0.010),
    (-0.095, 0.016, 0.016, 0.016),
    (-0.080, 0.012, 0.012, 0.012),
    (0.062, 0.012, 0.012, 0.012),
    (0.064, 0.016, 0.085, 0.085),
    (0.080, 0.016, 0.085, 0.085),
    (0.082, 0.008, 0.010, 0.010),
)
BLADE = (  # but for the first row, at counts from the point
    (0.080, 0.004, 0.017, 0.017),
    (-0.100, 0.003, 0.014, 0.014),
    (-0.006, 0.002, 0.005, 0.005),
    (0.000, 0.001, 0.001, 0.001),
)


class Modeller:
    """A standing skeleton, the scale of its person, and the surfaces made so far."""

    def __init__(self, skeleton: Skeleton, stance: Stance) -> None:
        self.skeleton = skeleton
        self.stance = stance
        self.scale = stance.stature / MODEL_STATURE
        self.surfaces: list[Surface] = []

    def at(self, role: str) -> np.ndarray:
        """Where a role's joint stands [3]."""
        return self.stance.position[self.skeleton.joint(role)]

    def sized(self, rows: Sequence[Sequence[float]], *, along: bool) -> np.ndarray:
        """A table for this person's stature; ``along`` scales the way along the axis too."""
        table = np.array([(*r, 0.0) if len(r) == 4 else r for r in rows], dtype=np.float64)
        table[:, AT if along else AT + 1 :] *= self.scale
        return table

    def add(self, role: str, points: np.ndarray, weights: np.ndarray) -> None:
        """Close rings [R, S, 3] with weights [R, J] or [R, S, J] into a surface."""
        vertices, faces = closed_tube(points)
        count = len(self.skeleton)
        rings, segments = points.shape[:2]
        if weights.ndim == 2:
            weights = np.broadcast_to(weights[:, None], (rings, segments, count))
        flat = weights.reshape(-1, count)
        poles = np.stack([weights[0].mean(axis=0), weights[-1].mean(axis=0)])
        self.surfaces.append(Surface(role, vertices, faces, np.concatenate([flat, poles])))

    def only(self, joint: int, rings: int) -> np.ndarray:
        """Weights [R, J] of one joint."""
        return self.passing([(joint, 0.0, 1.0)], np.zeros(rings))

    def passing(self, chain: Sequence[tuple[int, float, float]], at: np.ndarray) -> np.ndarray:
        """Weights [..., J] that pass down a chain of (joint, from where, over what half width)."""
        out = np.zeros((*np.shape(at), len(self.skeleton)))
        rest = np.ones(np.shape(at))
        for (joint, _, _), later in zip(chain, [*chain[1:], None]):
            on = (
                np.zeros(np.shape(at))
                if later is None
                else smoothstep(later[1] - later[2], later[1] + later[2], at)
            )
            out[..., joint] += rest * (1 - on)
            rest = rest * on
        return out


def make_surfaces(skeleton: Skeleton, stance: Stance, *, armed: bool = True) -> list[Surface]:
    """Every piece of a boxer's skin in the standing pose, with its sword or without."""
    m = Modeller(skeleton, stance)
    _trunk(m)
    _neck_and_head(m)
    for side, sign in zip(SIDES, (1.0, -1.0)):
        _arm(m, side, sign)
        _leg(m, side, sign)
        _foot(m, side)
    if armed and "sword" in skeleton.roles:
        _sword(m)
    return m.surfaces


def _sword(m: Modeller) -> None:
    """A blade from the joint of the role ``sword`` to its tip, and a hilt."""
    joint = m.skeleton.joint("sword")
    tip_joint, offset = m.skeleton.tip("sword")
    grip = m.stance.position[joint]
    point = m.stance.position[tip_joint] + rotation.rotate(m.stance.wxyz[tip_joint], offset)
    length = float(np.linalg.norm(point - grip))
    axis = (point - grip) / length
    flat = np.cross(axis, UP if abs(axis[1]) < 0.9 else FRONT)
    flat = flat / np.linalg.norm(flat)
    edge = np.cross(flat, axis)
    blade = np.array([(*row, 0.0) for row in BLADE])
    blade[1:, AT] += length
    for role, rings in (("trim", blade), ("hair", np.array([(*row, 0.0) for row in HILT]))):
        points = place(rings, ring_points(rings, 10), grip, axis, flat, edge)
        m.add(role, points, m.only(joint, len(rings)))


# Trunk and head ----------------------------------------------------------------------------------


def _spine_chain(m: Modeller, low: int, high: int, wide: float) -> list[tuple[int, float, float]]:
    """Joints from ``low`` up to ``high`` with the heights [m] from which they carry the trunk.

    Of joints at one height the last counts: it turns with all the others.
    """
    path = [high]
    while path[-1] > 0 and path[-1] != low:
        path.append(int(m.skeleton.parents[path[-1]]))
    heights = m.stance.position[:, 1]
    chain: list[tuple[int, float, float]] = []
    for joint in path[::-1]:
        height = float(heights[joint])
        if chain and height - chain[-1][1] < 0.01:
            chain[-1] = (joint, chain[-1][1], chain[-1][2])
            continue
        room = height - chain[-1][1] if chain else wide
        chain.append((joint, height, min(wide, 0.9 * room)))
    return chain


def _trunk(m: Modeller) -> None:
    shoulders = 0.5 * (m.at("left_upper_arm") + m.at("right_upper_arm"))
    hips = 0.5 * (m.at("left_thigh") + m.at("right_thigh"))
    axis = shoulders - hips
    chain = _spine_chain(m, m.skeleton.joint("pelvis"), m.skeleton.joint("chest"), 0.10 * m.scale)
    broad = _ratio(m, "upper_arm", MODEL_SHOULDER)
    hip = _ratio(m, "thigh", MODEL_HIP)
    for role, rows, count, exponent in (
        ("shirt", TRUNK, 19, 2.35),
        ("shorts", PELVIS, 10, 2.3),
        ("trim", WAISTBAND, 7, 2.35),
    ):
        table = m.sized(rows, along=False)
        up = np.clip(table[:, AT], 0.0, 1.0)
        table[:, 1] *= (1 - up) * hip + up * broad
        rings = profile(table, count)
        points = place(rings, ring_points(rings, 24, exponent), hips, axis, LEFT, FRONT)
        weights = m.passing(chain, points[..., 1])
        if role == "shirt":
            _follow_shoulders(m, points, weights)
        m.add(role, points, weights)


def _ratio(m: Modeller, role: str, model: float) -> float:
    """How much broader this skeleton is at a pair of joints than the model, within reason."""
    across = 0.5 * np.linalg.norm(m.at(f"left_{role}") - m.at(f"right_{role}"))
    return float(np.clip(across / (model * m.scale), 0.85, 1.2))


def _follow_shoulders(m: Modeller, points: np.ndarray, weights: np.ndarray) -> None:
    """Let the trunk near a shoulder follow the collar bone and a little of the arm, in place."""
    for side in SIDES:
        arm = m.skeleton.joint(f"{side}_upper_arm")
        collar = m.skeleton.roles.get(f"{side}_clavicle", int(m.skeleton.parents[arm]))
        away = np.linalg.norm(points - m.stance.position[arm], axis=-1) / m.scale
        for joint, most, near, far in ((collar, 0.85, 0.06, 0.17), (arm, 0.30, 0.04, 0.12)):
            share = most * (1 - smoothstep(near, far, away))[..., None]
            weights *= 1 - share
            weights[..., joint] += share[..., 0]


def _neck_and_head(m: Modeller) -> None:
    skeleton, stance, k = m.skeleton, m.stance, m.scale
    head = skeleton.joint("head")
    crown, chin = crown_and_chin(skeleton, stance)
    shoulders = 0.5 * (m.at("left_upper_arm") + m.at("right_upper_arm"))
    # The neck ends 3 cm above the chin's height, inside the skull.
    neck = m.sized(NECK, along=True)
    neck[:, AT] *= (chin + 0.035 * k - shoulders[1]) / neck[-1, AT]
    skull = np.array([m.at("head")[0], chin, m.at("head")[2] + 0.012 * k])
    base = np.array([shoulders[0], shoulders[1], shoulders[2]])
    rings = profile(neck, 9)
    lean = np.array([skull[0], skull[1] + 0.035 * k, skull[2] - 0.012 * k]) - base
    lean = lean / lean[1]
    points = place(rings, ring_points(rings, 20), base, lean, LEFT, FRONT)
    chain = _spine_chain(m, skeleton.joint("chest"), head, 0.04 * k)
    chain = [(j, max(y, float(shoulders[1]) + 0.02 * k), w) for j, y, w in chain]
    m.add("skin", points, m.passing(chain, points[..., 1]))

    tall = (crown - chin) * UP
    table = m.sized(HEAD, along=False)
    rings = profile(table, 18)
    shape = ring_points(rings, 22, 2.15)
    points = place(rings, shape, skull, tall, LEFT, FRONT)
    m.add("skin", points, m.only(head, len(rings)))
    _hair(m, table, skull, tall, head)

    def bead(role: str, where: Sequence[float], size: Sequence[float], tilt: float = 0.0) -> None:
        """An ellipsoid on the head; where = (side, way from chin to crown, ahead)."""
        angle = np.linspace(0.0, np.pi, 6)
        ring = np.zeros((6, 5))
        ring[:, AT] = -np.cos(angle) * size[1] * k
        ring[:, 1] = np.maximum(np.sin(angle), 0.05) * size[0] * k
        ring[:, 2] = ring[:, 3] = np.maximum(np.sin(angle), 0.05) * size[2] * k
        ring[:, AHEAD] = -tilt * ring[:, AT]
        centre = skull + where[0] * k * LEFT + where[1] * tall + where[2] * k * FRONT
        m.add(role, place(ring, ring_points(ring, 9), centre, UP, LEFT, FRONT), m.only(head, 6))

    bead("skin", (0.0, 0.415, 0.087), (0.0125, 0.028, 0.019), 0.45)  # nose
    for sign in (1.0, -1.0):
        bead("hair", (0.029 * sign, 0.515, 0.0755), (0.0105, 0.0065, 0.007))  # eye
        bead("hair", (0.030 * sign, 0.585, 0.0785), (0.0175, 0.0045, 0.008))  # brow
        bead("skin", (0.073 * sign, 0.47, -0.010), (0.007, 0.030, 0.017), -0.2)  # ear


def _hair(m: Modeller, table: np.ndarray, skull: np.ndarray, tall: np.ndarray, head: int) -> None:
    """A cap over the skull, down to the brow's height in front, the ears, and the nape."""
    segments = 24
    angle = 2 * np.pi * np.arange(segments) / segments
    ahead = np.sin(angle)
    line = np.where(
        ahead > 0, 0.56 + 0.24 * np.abs(ahead) ** 0.7, 0.56 - 0.30 * np.abs(ahead) ** 1.5
    )
    rings = 8
    fraction = np.linspace(0.0, 1.0, rings)[:, None]
    way = line + (1.0 - line) * np.sin(0.5 * np.pi * fraction)
    dense = profile(table, 200)
    points = np.empty((rings, segments, 3))
    grown = np.clip(np.minimum(fraction / 0.12, 1.0), 0.0, 1.0) * HAIR_THICK - 0.002
    for s in range(segments):
        ring = np.stack([np.interp(way[:, s], dense[:, AT], dense[:, c]) for c in range(5)], axis=1)
        ring[:, 1:4] += grown * m.scale
        shape = ring_points(ring, segments, 2.15)[:, s]
        points[:, s] = (
            skull
            + (way[:, s] * (1 + 0.03 * fraction[:, 0]))[:, None] * tall
            + shape[:, :1] * LEFT
            + shape[:, 1:] * FRONT
        )
    m.add("hair", points, m.only(head, rings))


# Limbs -------------------------------------------------------------------------------------------


def _limb_path(m: Modeller, side: str, roles: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """The joints [3, 3] of a limb, and the way [3] along it at which they stand [m]."""
    path = np.stack([m.at(f"{side}_{r}") for r in roles])
    return path, np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])


def _along_limb(m: Modeller, rows: Sequence[Sequence[float]], reach: np.ndarray) -> np.ndarray:
    """A table whose ``at`` counts bones (0, 1, 2), in metres along a limb."""
    table = m.sized(rows, along=False)
    slope = np.concatenate([[reach[1]], [reach[2] - reach[1]]])
    at = table[:, AT]
    table[:, AT] = np.where(at < 1.0, at * slope[0], reach[1] + (at - 1.0) * slope[1])
    return table


def _arm(m: Modeller, side: str, sign: float) -> None:
    k = m.scale
    joint = m.skeleton.joint
    path, reach = _limb_path(m, side, ("upper_arm", "forearm", "hand"))
    arm, forearm, hand = (joint(f"{side}_{r}") for r in ("upper_arm", "forearm", "hand"))
    collar = m.skeleton.roles.get(f"{side}_clavicle", int(m.skeleton.parents[arm]))
    chain = [
        (collar, 0.0, 0.0),
        (arm, -0.005 * k, 0.045 * k),
        (forearm, reach[1], 0.042 * k),
        (hand, reach[2], 0.03 * k),
    ]
    axis = _unit(path[2] - path[0])
    ahead = _unit(FRONT - axis * float(FRONT @ axis))
    outer = np.cross(ahead, axis) * sign
    rings = profile(_along_limb(m, ARM, reach), 25)
    points = place_along(rings, ring_points(rings, 14), path, outer, ahead)
    m.add("skin", points, m.passing(chain, rings[:, AT]))

    fist = _unit(path[2] - path[1])
    ahead = _unit(FRONT - fist * float(FRONT @ fist))
    outer = np.cross(ahead, fist) * sign
    at_wrist = [(forearm, 0.0, 0.0), (hand, -0.025 * k, 0.03 * k)]
    for role, rows, count in (("gloves", GLOVE, 13), ("trim", CUFF, 5)):
        rings = profile(m.sized(rows, along=True), count)
        points = place(rings, ring_points(rings, 16, 2.25), path[2], fist, outer, ahead)
        m.add(role, points, m.passing(at_wrist, rings[:, AT]))
    # The thumb lies along the fist's front, towards the palm.
    rings = profile(m.sized(GLOVE_THUMB, along=True), 7)
    root = path[2] + k * (0.016 * fist + 0.040 * ahead - 0.022 * outer)
    along = _unit(fist + 0.28 * ahead - 0.10 * outer)
    points = place(rings, ring_points(rings, 10), root, along, outer, ahead)
    m.add("gloves", points, m.only(hand, len(rings)))


def _leg(m: Modeller, side: str, sign: float) -> None:
    k = m.scale
    joint = m.skeleton.joint
    path, reach = _limb_path(m, side, ("thigh", "shin", "foot"))
    thigh, shin, foot = (joint(f"{side}_{r}") for r in ("thigh", "shin", "foot"))
    chain = [
        (joint("pelvis"), 0.0, 0.0),
        (thigh, 0.02 * k, 0.08 * k),
        (shin, reach[1], 0.055 * k),
        (foot, reach[2], 0.03 * k),
    ]
    for role, rows, count, segments in (
        ("skin", LEG, 22, 16),
        ("shorts", SHORTS_LEG, 11, 20),
        ("trim", SOCK, 5, 16),
        ("shoes", BOOT, 8, 16),
    ):
        rings = profile(_along_limb(m, rows, reach), count)
        points = place_along(rings, ring_points(rings, segments), path, sign * LEFT, FRONT)
        m.add(role, points, m.passing(chain, rings[:, AT]))


def _foot(m: Modeller, side: str) -> None:
    k, stance, skeleton = m.scale, m.stance, m.skeleton
    foot = skeleton.joint(f"{side}_foot")
    ankle = stance.position[foot]
    tip_joint, offset = skeleton.tip(f"{side}_foot")
    tip = stance.position[tip_joint] + rotation.rotate(stance.wxyz[tip_joint], offset)
    ahead = (tip - ankle) * np.array([1.0, 0.0, 1.0])
    length = float(np.linalg.norm(ahead))
    ahead = ahead / length if length > 0.02 else FRONT
    across = np.cross(UP, ahead)
    # The shoe ends a thumb's breadth past the toes, but stays a human foot.
    stretch = float(np.clip((length / k + 0.028) / SHOE[-1][0], 0.8, 1.2))
    toe = skeleton.roles.get(f"{side}_toe")
    chain = [(foot, 0.0, 0.0)]
    if toe is not None:
        chain.append((toe, float((stance.position[toe] - ankle) @ ahead), 0.03 * k))
    base = np.array([ankle[0], stance.ground, ankle[2]])
    shape = np.array(SHOE)
    shape[:, 0] = np.where(shape[:, 0] > 0, shape[:, 0] * stretch, shape[:, 0])
    for role, low, rim, high, exponent in (
        ("shoes", 0.6 * SOLE_THICK, 0.0, None, 2.5),
        ("soles", 0.0, SOLE_RIM, SOLE_THICK, 6.0),
    ):
        top = shape[:, 2] if high is None else np.full(len(shape), high)
        table = np.zeros((len(shape), 5))
        table[:, AT] = shape[:, 0] + rim * np.sign(shape[:, 0])
        table[:, 1] = shape[:, 1] + rim
        table[:, 2] = table[:, 3] = 0.5 * (top - low)  # here "front" is up
        table[:, AHEAD] = 0.5 * (top + low)
        rings = profile(table * k, 12)
        points = place(rings, ring_points(rings, 14, exponent), base, ahead, across, UP)
        m.add(role, points, m.passing(chain, rings[:, AT]))


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)
