"""Roles of the usual families of skeletons, by name, by shape and by mapping."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kumite import rotation
from kumite.clip import LEG_ROLES, REQUIRED_ROLES, ROLES, SIDES, Skeleton
from kumite.errors import KumiteError
from kumite.mocap.asfamc import read_asf
from kumite.mocap.bvh import read_bvh
from kumite.mocap.raw import MOST_JOINTS
from kumite.mocap.roles import find_roles, split_name

# What each family calls root and spine up to the chest, neck, head, a left arm and a left leg.
FAMILIES: dict[str, tuple[list[str], list[str], list[str], list[str]]] = {
    "mixamo": (
        ["mixamorig:Hips", "mixamorig:Spine", "mixamorig:Spine1", "mixamorig:Spine2"],
        ["mixamorig:Neck", "mixamorig:Head", "mixamorig:HeadTop_End"],
        [f"mixamorig:Left{n}" for n in ("Shoulder", "Arm", "ForeArm", "Hand", "HandIndex1")],
        [f"mixamorig:Left{n}" for n in ("UpLeg", "Leg", "Foot", "ToeBase", "Toe_End")],
    ),
    "lafan1": (
        ["Hips", "Spine", "Spine1", "Spine2"],
        ["Neck", "Head"],
        ["LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand"],
        ["LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToe"],
    ),
    "rokoko": (
        ["Hips", "Spine", "Spine2", "Spine4"],
        ["Neck", "Head"],
        ["LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand", "LeftFinger2Proximal"],
        ["LeftThigh", "LeftShin", "LeftFoot", "LeftToe"],
    ),
    "biped": (
        ["Bip01 Pelvis", "Bip01 Spine", "Bip01 Spine1"],
        ["Bip01 Neck", "Bip01 Head", "Bip01 HeadNub"],
        [f"Bip01 L {n}" for n in ("Clavicle", "UpperArm", "Forearm", "Hand", "Finger0")],
        [f"Bip01 L {n}" for n in ("Thigh", "Calf", "Foot", "Toe0", "Toe0Nub")],
    ),
    "unreal": (
        ["pelvis", "spine_01", "spine_02", "spine_03"],
        ["neck_01", "head"],
        ["clavicle_l", "upperarm_l", "lowerarm_l", "hand_l", "index_01_l"],
        ["thigh_l", "calf_l", "foot_l", "ball_l"],
    ),
    "biovision": (
        ["Hips", "Chest"],
        ["Neck", "Head"],
        ["LeftCollar", "LeftShoulder", "LeftElbow", "LeftWrist"],
        ["LeftHip", "LeftKnee", "LeftAnkle", "LeftToe"],
    ),
    "smpl": (
        ["Pelvis", "Spine1", "Spine2", "Spine3"],
        ["Neck", "Head"],
        ["L_Collar", "L_Shoulder", "L_Elbow", "L_Wrist", "L_Hand"],
        ["L_Hip", "L_Knee", "L_Ankle", "L_Foot"],
    ),
    "blender": (
        ["hips", "spine", "chest"],
        ["neck", "head"],
        ["shoulder.L", "upper_arm.L", "forearm.L", "hand.L", "thumb.01.L"],
        ["thigh.L", "shin.L", "foot.L", "toe.L"],
    ),
    "xsens": (
        ["Pelvis", "L5", "L3", "T12", "T8"],
        ["Neck", "Head"],
        ["LeftShoulder", "LeftUpperArm", "LeftForeArm", "LeftHand"],
        ["LeftUpperLeg", "LeftLowerLeg", "LeftFoot", "LeftToe"],
    ),
    "xsens bvh": (
        ["Hips", "Chest", "Chest2", "Chest3", "Chest4"],
        ["Neck", "Head"],
        ["LeftCollar", "LeftShoulder", "LeftElbow", "LeftWrist"],
        ["LeftHip", "LeftKnee", "LeftAnkle", "LeftToe"],
    ),
    "optitrack": (
        ["Skeleton1:Hip", "Skeleton1:Ab", "Skeleton1:Chest"],
        ["Skeleton1:Neck", "Skeleton1:Head"],
        [f"Skeleton1:L{n}" for n in ("Shoulder", "UArm", "FArm", "Hand")],
        [f"Skeleton1:L{n}" for n in ("Thigh", "Shin", "Foot", "Toe")],
    ),
    "perception neuron": (
        [f"Robot_{n}" for n in ("Hips", "Spine", "Spine1", "Spine2")],
        ["Robot_Neck", "Robot_Head"],
        [f"Robot_Left{n}" for n in ("Shoulder", "Arm", "ForeArm", "Hand", "HandThumb1")],
        [f"Robot_Left{n}" for n in ("UpLeg", "Leg", "Foot", "ToeBase")],
    ),
    "daz": (
        ["hip", "abdomenLower", "abdomenUpper", "chestLower", "chestUpper"],
        ["neckLower", "head"],
        ["lCollar", "lShldrBend", "lForearmBend", "lHand", "lThumb1"],
        ["lThighBend", "lShin", "lFoot", "lToe"],
    ),
    "character creator": (
        ["CC_Base_Hip", "CC_Base_Waist", "CC_Base_Spine01", "CC_Base_Spine02"],
        ["CC_Base_NeckTwist01", "CC_Base_Head"],
        [f"CC_Base_L_{n}" for n in ("Clavicle", "Upperarm", "Forearm", "Hand")],
        [f"CC_Base_L_{n}" for n in ("Thigh", "Calf", "Foot", "ToeBase")],
    ),
    "rigify": (
        ["DEF-hips", "DEF-spine", "DEF-chest"],
        ["DEF-neck", "DEF-head"],
        [f"DEF-{n}.L" for n in ("shoulder", "upper_arm", "forearm", "hand")],
        [f"DEF-{n}.L" for n in ("thigh", "shin", "foot", "toe")],
    ),
    "kinect": (
        ["SpineBase", "SpineMid", "SpineShoulder"],
        ["Neck", "Head"],
        ["ClavicleLeft", "ShoulderLeft", "ElbowLeft", "WristLeft", "HandTipLeft"],
        ["HipLeft", "KneeLeft", "AnkleLeft", "FootLeft"],
    ),
    "poser": (
        ["hip", "abdomen", "chest"],
        ["neck", "head"],
        ["lCollar", "lShldr", "lForeArm", "lHand", "lThumb1"],
        ["lThigh", "lShin", "lFoot", "lToe"],
    ),
}
_MIRROR = (
    ("Left", "Right"),
    ("L_", "R_"),
    (" L ", " R "),
    ("_l", "_r"),
    (".L", ".R"),
    (":L", ":R"),
    ("l", "r"),
)


def right(name: str) -> str:
    for a, b in _MIRROR:
        if a in name and (a != "l" or name.startswith("l")):
            return name.replace(a, b, 1)
    raise AssertionError(name)


def person(family: str) -> Skeleton:
    """A skeleton of a person with the family's names, facing +Z."""
    spine, neck, arm, leg = FAMILIES[family]
    joints: list[tuple[str, str | None, list[float]]] = []

    def grow(names: list[str], parent: str | None, bones: list[list[float]], flip: float) -> None:
        for k, name in enumerate(names):
            x, y, z = bones[min(k, len(bones) - 1)]
            joints.append((name, parent, [flip * x, y, z]))
            parent = name

    grow(spine, None, [[0, 0, 0], [0, 0.15, 0]], 1)
    arm_bones = [[0.05, 0.1, 0], [0.12, 0, 0], [0.3, 0, 0], [0.26, 0, 0], [0.08, 0, 0]]
    leg_bones = [[0.09, -0.05, 0], [0, -0.43, 0], [0, -0.42, 0], [0, -0.06, 0.13], [0, 0, 0.06]]
    grow(leg, spine[0], leg_bones, 1)
    grow([right(n) for n in leg], spine[0], leg_bones, -1)
    grow(arm, spine[-1], arm_bones, 1)
    grow([right(n) for n in arm], spine[-1], arm_bones, -1)
    grow(neck, spine[-1], [[0, 0.2, 0], [0, 0.1, 0]], 1)
    names = [n for n, _, _ in joints]
    parents = np.array([names.index(p) if p else -1 for _, p, _ in joints])
    return Skeleton(tuple(names), parents, np.array([o for _, _, o in joints]))


def expected(family: str) -> dict[str, str]:
    spine, neck, arm, leg = FAMILIES[family]
    out = {"pelvis": spine[0], "chest": spine[-1], "neck": neck[0], "head": neck[1]}
    for part, name in zip(("clavicle", "upper_arm", "forearm", "hand"), arm):
        out[f"left_{part}"], out[f"right_{part}"] = name, right(name)
    for part, name in zip(LEG_ROLES, leg):
        out[f"left_{part}"], out[f"right_{part}"] = name, right(name)
    return out


@pytest.mark.parametrize("family", FAMILIES)
def test_every_role_of_every_family(family: str) -> None:
    skeleton = person(family)
    found = find_roles(skeleton)
    assert {r: skeleton.names[j] for r, j in found.joints.items()} == expected(family)
    assert set(found.how.values()) <= {"name", "tree"}


@pytest.mark.parametrize("family", ["biped", "mixamo", "daz", "xsens bvh"])
def test_clavicles_may_hang_on_the_neck(family: str) -> None:
    """As 3ds Max Biped has it; and its thighs, on the first joint of the spine."""
    spine, neck, arm, leg = FAMILIES[family]
    skeleton = person(family)
    names = list(skeleton.names)
    parents = skeleton.parents.copy()
    order = list(range(len(names)))
    for name in (arm[0], right(arm[0])):
        parents[names.index(name)] = names.index(neck[0])
    thighs = [names.index(n) for n in (leg[0], right(leg[0]))]
    parents[thighs] = names.index(spine[1])
    # Parents before children again: trunk, neck, then all else in its order.
    first = [names.index(n) for n in (*spine, *neck)]
    order = first + [j for j in order if j not in first]
    place = {j: k for k, j in enumerate(order)}
    moved = Skeleton(
        tuple(names[j] for j in order),
        np.array([place.get(int(parents[j]), -1) for j in order]),
        skeleton.offsets[order],
    )
    found = find_roles(moved)
    wanted = expected(family) | {"pelvis": spine[1], "chest": spine[-1]}
    assert {r: moved.names[j] for r, j in found.joints.items()} == wanted


@pytest.mark.parametrize("shape", ["star", "path", "threes", "bush"])
def test_roles_of_thousands_of_joints_are_refused(shape: str) -> None:
    count = MOST_JOINTS
    k = np.arange(count)
    parents = {
        "star": np.where(k > 0, 0, -1),
        "path": k - 1,
        "threes": np.where(k % 3 == 1, 0, k - 1),
        "bush": np.where(k > 0, (k - 1) // 15, -1),
    }[shape]
    # Within a blink: the square of the joints took minutes.
    many = Skeleton(tuple(f"j{j}" for j in k), parents, np.ones((count, 3)))
    with pytest.raises(KumiteError, match=r"to be found among .* say --role ROLE=JOINT"):
        find_roles(many)


@pytest.mark.parametrize("family", FAMILIES)
def test_shape_alone_finds_the_limbs(family: str) -> None:
    skeleton = person(family)
    silent = replace(skeleton, names=tuple(f"joint{k}" for k in range(len(skeleton))))
    found = find_roles(silent)
    wanted = expected(family)
    for role, joint in found.joints.items():
        if role != "head":  # the last joint of the head's branch may be its end
            assert skeleton.names[joint] == wanted[role], role
    assert set(found.how.values()) == {"tree"}


def test_shape_tells_left_from_right_whichever_way_the_body_lies() -> None:
    skeleton = person("lafan1")
    silent = replace(skeleton, names=tuple(f"joint{k}" for k in range(len(skeleton))))
    lying = replace(silent, offsets=rotation.rotate(rotation.exp([1.2, -0.4, 2.0]), silent.offsets))
    assert find_roles(lying).joints == find_roles(silent).joints


REAL = {
    "boxer/jab_left.bvh": {
        "pelvis": "Hips", "chest": "Spine1", "head": "Head",
        "left_clavicle": "LeftShoulder1", "right_clavicle": "RightShoulder",
        "left_upper_arm": "LeftArm", "left_forearm": "LeftForeArm", "left_hand": "LeftHand",
        "left_thigh": "LeftUpLeg", "left_shin": "LeftLeg", "left_foot": "LeftFoot",
        "left_toe": "LeftToes",
    },
    "woody/woody.asf": {
        "pelvis": "root", "chest": "Spine1", "head": "HEad", "left_clavicle": "LeftShoulder1",
        "right_upper_arm": "RightArm", "right_thigh": "RightUpLeg", "right_toe": "RightToes",
    },
    "cmu/16/16.asf": {
        "pelvis": "root", "chest": "thorax", "neck": "lowerneck", "head": "head",
        "left_clavicle": "lclavicle", "left_upper_arm": "lhumerus", "left_forearm": "lradius",
        "left_hand": "lhand", "right_hand": "rhand", "left_thigh": "lfemur",
        "left_shin": "ltibia", "left_foot": "lfoot", "left_toe": "ltoes",
    },
    "cmu/soccer/10_01.bvh": {
        "pelvis": "hip", "chest": "chest", "neck": "neck", "head": "head",
        "left_clavicle": "lCollar", "left_upper_arm": "lShldr", "right_forearm": "rForeArm",
        "right_hand": "rHand", "left_thigh": "lThigh", "left_shin": "lShin", "left_foot": "lFoot",
    },
}  # fmt: skip


@pytest.mark.parametrize("name", REAL)
def test_real_skeletons(mocap: Path, name: str) -> None:
    path = mocap / name
    skeleton = read_asf(path).skeleton if path.suffix == ".asf" else read_bvh(path).skeleton
    found = find_roles(skeleton).joints
    assert set(REQUIRED_ROLES) <= set(found)
    assert {r: skeleton.names[found[r]] for r in REAL[name]} == REAL[name]
    for side in SIDES:
        # A CMU wrist is half way down the forearm: hand to elbow is a person's forearm.
        lengths = np.linalg.norm(skeleton.offsets, axis=1)
        forearm = lengths[skeleton.chain(found[f"{side}_forearm"], found[f"{side}_hand"])].sum()
        shin = lengths[skeleton.chain(found[f"{side}_shin"], found[f"{side}_foot"])].sum()
        assert 0.45 < forearm / shin < 0.8


def test_a_mapping_beats_names() -> None:
    skeleton = person("unreal")
    found = find_roles(skeleton, {"chest": "spine_02", "left_hand": "index_01_l"})
    assert skeleton.names[found.joints["chest"]] == "spine_02"
    assert found.how["chest"] == "given" and found.how["head"] == "name"
    with pytest.raises(KumiteError, match="unknown role 'left_fist'"):
        find_roles(skeleton, {"left_fist": "hand_l"})
    with pytest.raises(KumiteError, match=r"unknown joint for 'left_hand': 'hand_L'; did you mean"):
        find_roles(skeleton, {"left_hand": "hand_L"})


def test_limbs_are_in_a_row() -> None:
    with pytest.raises(KumiteError, match=r"left_shin .'calf_l'. is not below left_thigh .'head'."):
        find_roles(person("unreal"), {"left_thigh": "head", "head": "spine_02"})


def test_gaps_in_limbs_are_filled() -> None:
    skeleton = person("mixamo")
    names = [n.replace("LeftLeg", "Gelenk").replace("RightForeArm", "Ecke") for n in skeleton.names]
    found = find_roles(replace(skeleton, names=tuple(names)))
    assert names[found.joints["left_shin"]].endswith("Gelenk")
    assert names[found.joints["right_forearm"]].endswith("Ecke")
    assert found.how["left_shin"] == "tree"


def test_all_that_is_missing_is_named_at_once() -> None:
    stick = Skeleton(("hips", "stick", "Head"), np.array([-1, 0, 1]), np.ones((3, 3)))
    with pytest.raises(KumiteError) as error:
        find_roles(stick)
    message = str(error.value)
    assert "left_foot" in message and "right_hand" in message and "hips, stick, Head" in message
    assert "head" not in message.split(" to be found")[0].replace("forehead", "")


@pytest.mark.parametrize(
    ("name", "part", "side"),
    [
        ("mixamorig:LeftForeArm", "forearm", "left"),
        ("Bip01 R UpperArm", "upperarm", "right"),
        ("upperarm_twist_01_l", "upperarmtwist", "left"),
        ("lfemur", "femur", "left"),
        ("lowerback", "lowerback", None),
        ("rThigh", "thigh", "right"),
        ("lowerneck", "lowerneck", None),
        ("root", "root", None),
        ("left_hand", "hand", "left"),
        ("LEFTHAND", "hand", "left"),
        ("HEad", "head", None),
        ("", "", None),
    ],
)
def test_names_are_taken_apart(name: str, part: str, side: str | None) -> None:
    assert split_name(name) == (part, side)


def test_roles_are_known_ones() -> None:
    assert set(find_roles(person("lafan1")).joints) <= set(ROLES)
