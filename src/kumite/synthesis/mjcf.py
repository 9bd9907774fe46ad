"""A skeleton and its laid body written as a MuJoCo model, axes and metres as everywhere here.

One body a joint, one capsule a part. A ball joint is at rest in the *neutral* pose: standing, with
elbows and knees half bent, because MuJoCo limits a ball joint by one angle from its rest, and an
elbow that bends from straight to 150° but hardly backwards is a cone about its middle.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np

from kumite import rotation
from kumite.body import Body
from kumite.body.stance import FRONT, LEFT, stand
from kumite.clip import REQUIRED_ROLES, SIDES, Skeleton
from kumite.rotation import conjugate, multiply

# Degrees from neutral, by the role of the joint. Chosen: cones that hold what captured people do
# and keep a limb from folding through itself; a motion that goes beyond widens them.
RANGE_DEG = {
    "chest": 45,
    "neck": 50,
    "head": 60,
    "clavicle": 40,
    "upper_arm": 130,
    "forearm": 80,
    "hand": 80,
    "thigh": 120,
    "shin": 80,
    "foot": 50,
    "toe": 50,
}
OTHER_RANGE_DEG = 45  # of joints without a role: a spine's
BENT_DEG = {"forearm": 70.0, "shin": 65.0}  # of the neutral pose
LIGHT = (0.02, 1e-4)  # kg and kg m² of a joint that carries no part: a collarbone, toes
ARMATURE = 0.002  # kg m² added to every joint: light ends stay soluble at the physics step
PIN = (0.004, 1.0)  # s and share of critical: how fast a pinned foot is brought back
# Share of what moves it that a pin takes. The legs push a whole body's balance through a foot of a
# kilogram: of MuJoCo's usual 0.95 the rest is enough to whirl it.
FIRM = (0.9999, 0.9999, 0.001)


def kind_of(role: str) -> str:
    """A role without its side."""
    return role.removeprefix("left_").removeprefix("right_")


def neutral_pose(skeleton: Skeleton) -> np.ndarray:
    """Local rotations [J, 4] of the neutral pose; the identity for a skeleton that cannot stand."""
    if any(role not in skeleton.roles for role in REQUIRED_ROLES):
        return np.tile(rotation.IDENTITY_WXYZ, (len(skeleton), 1))
    stance = stand(skeleton)
    world = stance.wxyz.copy()
    for side in SIDES:
        at = {p: stance.position[skeleton.joint(f"{side}_{p}")] for p in ("forearm", "hand")}
        arm = at["hand"] - at["forearm"]
        for part, axis in (("forearm", np.cross(arm, FRONT)), ("shin", LEFT)):
            joint = skeleton.joint(f"{side}_{part}")
            bend = np.radians(BENT_DEG[part]) * axis / np.linalg.norm(axis)
            below = [joint]
            for j in range(joint, len(skeleton)):
                if j == joint or skeleton.parents[j] in below:
                    below.append(j)
                    world[j] = multiply(rotation.exp(bend), world[j])
    parent = np.maximum(skeleton.parents, 0)
    local = multiply(conjugate(world[parent]), world)
    local[0] = rotation.IDENTITY_WXYZ  # the root is free: it rests as the world does
    return local


def ranges(skeleton: Skeleton) -> np.ndarray:
    """Angles [J] rad from neutral within which the joints turn; the root's is not used."""
    out = np.full(len(skeleton), np.radians(OTHER_RANGE_DEG))
    for role, joint in skeleton.roles.items():
        out[joint] = np.radians(RANGE_DEG.get(kind_of(role), OTHER_RANGE_DEG))
    return out


def capsule(body: Body, part: int) -> tuple[np.ndarray, np.ndarray, float]:
    """A part as MuJoCo has it: ends [3], [3] and one radius, the mean of a tapered capsule's."""
    radius = 0.5 * float(body.radius_start[part] + body.radius_end[part])
    return body.start[part], body.end[part], radius


def strangers(skeleton: Skeleton, body: Body) -> list[tuple[int, int]]:
    """Pairs of parts that may collide: all but those of one joint or of two next to each other.

    Next to each other are the parts of joints between which no third part hangs.
    """
    carries: dict[int, list[int]] = {}
    for part, joint in enumerate(body.joint.tolist()):
        carries.setdefault(joint, []).append(part)

    def carrier(joint: int) -> int:
        while joint >= 0 and joint not in carries:
            joint = int(skeleton.parents[joint])
        return joint

    near = set()
    for joint in carries:
        up = carrier(int(skeleton.parents[joint])) if joint else -1
        near |= {(joint, joint), (joint, up), (up, joint)}
    pairs = ((a, b) for a in range(len(body)) for b in range(a + 1, len(body)))
    return [p for p in pairs if (int(body.joint[p[0]]), int(body.joint[p[1]])) not in near]


def _text(values: np.ndarray | tuple[float, ...]) -> str:
    return " ".join(repr(float(v)) for v in values)


def mjcf(skeleton: Skeleton, body: Body, step: float, gravity: float) -> str:
    """The model: bodies ``j0`` … with geoms ``p0`` …, the plane ``ground``, pins ``pin0`` ….

    step [s], gravity [m/s²]. Collisions are those of every part with the ground and of
    :func:`strangers`. Pins hold the feet, where there are feet, to bodies that the caller puts
    where they stand.
    """
    neutral, angles = neutral_pose(skeleton), ranges(skeleton)
    root = ET.Element("mujoco", model="ragdoll")
    # Capsules overlap at the joints; inertia is the parts' own, whatever hangs at their ends.
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    ET.SubElement(root, "option", timestep=repr(step), gravity=_text((0, -gravity, 0)))
    world = ET.SubElement(root, "worldbody")
    up = rotation.between([0, 0, 1], [0, 1, 0])
    ET.SubElement(world, "geom", _inert("ground"), type="plane", size="0 0 1", quat=_text(up))
    feet = [skeleton.roles.get(f"{side}_foot") for side in SIDES]
    made: list[ET.Element] = []
    for j in range(len(skeleton)):
        above = made[int(skeleton.parents[j])] if j else world
        place = skeleton.offsets[j] if j else np.zeros(3)
        node = ET.SubElement(above, "body", name=f"j{j}", pos=_text(place), quat=_text(neutral[j]))
        made.append(node)
        if j:
            limit = {"range": _text((0.0, angles[j])), "armature": repr(ARMATURE)}
            ET.SubElement(node, "joint", limit, type="ball")
        else:
            ET.SubElement(node, "freejoint")
        parts = np.flatnonzero(body.joint == j).tolist()
        for p in parts:
            _geom(node, body, p)
        if not parts:
            mass, inertia = LIGHT
            spread = _text((inertia, inertia, inertia))
            ET.SubElement(node, "inertial", pos="0 0 0", mass=repr(mass), diaginertia=spread)
    contact = ET.SubElement(root, "contact")
    for p in range(len(body)):
        ET.SubElement(contact, "pair", geom1="ground", geom2=f"p{p}")
    for a, b in strangers(skeleton, body):
        ET.SubElement(contact, "pair", geom1=f"p{a}", geom2=f"p{b}")
    equality = ET.SubElement(root, "equality")
    for f, foot in enumerate(feet):
        if foot is None:
            continue
        ET.SubElement(world, "body", name=f"pin{f}", mocap="true")
        ET.SubElement(
            equality,
            "weld",
            name=f"pin{f}",
            body1=f"pin{f}",
            body2=f"j{foot}",
            active="false",
            relpose="0 0 0 1 0 0 0",
            solref=_text(PIN),
            solimp=_text(FIRM),
        )
    return ET.tostring(root, encoding="unicode")


def _inert(name: str) -> dict[str, str]:
    """A geom that meets only what a pair names."""
    return {"name": name, "contype": "0", "conaffinity": "0"}


def _geom(node: ET.Element, body: Body, part: int) -> None:
    start, end, radius = capsule(body, part)
    mass = repr(float(body.mass[part]))
    if np.allclose(start, end):
        shape = {"type": "sphere", "pos": _text(start), "size": repr(radius)}
    else:
        shape = {"type": "capsule", "fromto": _text((*start, *end)), "size": repr(radius)}
    ET.SubElement(node, "geom", {**_inert(f"p{part}"), **shape, "mass": mass})
