"""What each joint is for: roles from a mapping, from joint names, and from the tree's shape.

Names come first, since a rig that calls a joint ``LeftForeArm`` means it. They are compared
without case, prefix (``mixamorig:``), separators, digits and side. Helpers (dummies, twist and
roll joints, nubs) never have a role: a role belongs to the joint that really turns. Then the tree
fills what names leave open, and for rigs with names that say nothing it finds two legs, two arms
and a head by their symmetry.
"""

from __future__ import annotations

import functools
import itertools
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from kumite.clip import (
    ARM_ROLES,
    LEG_ROLES,
    NO_PARENT,
    REQUIRED_ROLES,
    ROLES,
    SIDES,
    Skeleton,
)
from kumite.errors import KumiteError, unknown
from kumite.mocap.limbs import Limbs, find_limbs

# Part names by role, the clearest first: with a CMU hand and a CMU wrist, the hand is the hand.
_SIDED = {
    "clavicle": ("clavicle", "collar", "collarbone", "shoulder"),
    "upper_arm": ("upperarm", "uparm", "uarm", "humerus", "shldr", "arm", "shoulder"),
    "forearm": ("forearm", "farm", "lowerarm", "lowarm", "larm", "radius", "elbow"),
    "hand": ("hand", "wrist", "palm"),
    "thigh": ("upleg", "thigh", "femur", "upperleg", "hip", "leg"),
    "shin": ("shin", "tibia", "lowerleg", "lowleg", "calf", "knee", "leg"),
    "foot": ("foot", "ankle"),
    "toe": ("toe", "toes", "toebase", "ball", "metatarsals"),
}
_SIDED_BY_JOINT = {
    "hand": ("wrist", "hand"),
    "foot": ("ankle", "foot"),
    "toe": ("toe", "toes", "toebase", "ball", "foot"),
}
_AMBIGUOUS = ("shoulder", "leg")
_MIDDLE = {
    "neck": ("neck", "lowerneck", "necklower", "neckbase", "neckbone", "necktwist"),
    "head": ("head", "skull"),
}
_HELPER = re.compile(
    r"dummy|twist|roll|nub|helper|effector|(^|[^a-z])ik([^a-z]|$)|(?<!b)end$|site$"
)
_SAY_ROLE = "say --role ROLE=JOINT, or ROLE = 'JOINT' under [roles] in kumite.toml"
_SIDE_WORDS = {"left": "left", "right": "right", "l": "left", "r": "right"}
_EMPTY_WORDS = ("bip", "mixamorig", "jnt", "bone", "def", "org", "bend")
_NEARLY_ALL = 0.8  # of the names begin with a word that says nothing
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")


@dataclass(frozen=True)
class FoundRoles:
    """Joints by role, and how each was found."""

    joints: Mapping[str, int]  # role -> joint
    how: Mapping[str, str]  # role -> 'given', 'name' or 'tree'


def find_roles(skeleton: Skeleton, given: Mapping[str, str] | None = None) -> FoundRoles:
    """Every role that can be found. ``given`` maps roles to joint names and beats everything.

    Errors: unknown role or joint in ``given``; required roles that are not to be found, all at
    once, with the joints that there are; limbs whose joints are not in a row.
    """
    joints: dict[str, int] = {}
    how: dict[str, str] = {}

    def take(role: str, joint: int | None, source: str) -> None:
        if joint is not None and role not in joints and joint not in joints.values():
            joints[role], how[role] = joint, source

    for role, name in (given or {}).items():
        if role not in ROLES:
            raise unknown("role", role, ROLES)
        if name not in skeleton.names:
            raise unknown(f"joint for {role!r}:", name, skeleton.names)
        joints[role], how[role] = skeleton.names.index(name), "given"
    for role, joint in _by_names(skeleton).items():
        take(role, joint, "name")
    for side in SIDES:
        for role, joint in _limb_gaps(skeleton, joints, side).items():
            take(role, joint, "tree")
    if any(r not in joints for r in REQUIRED_ROLES if r not in ("pelvis", "chest", "head")):
        for role, joint in _by_limbs(skeleton, find_limbs(skeleton), joints).items():
            take(role, joint, "tree")
    for role, joint in _trunk(skeleton, joints).items():
        take(role, joint, "tree")
    missing = [r for r in REQUIRED_ROLES if r not in joints]
    if missing:
        shown = ", ".join(skeleton.names[:60]) + (" …" if len(skeleton) > 60 else "")
        raise KumiteError(
            f"no {_listed(missing)} to be found among the joints: {shown}; {_SAY_ROLE}"
        )
    for parts in (ARM_ROLES[1:], LEG_ROLES[:3]):
        for above, below in itertools.pairwise(parts):
            for side in SIDES:
                a, b = joints[f"{side}_{above}"], joints[f"{side}_{below}"]
                if a == b or a not in _ancestors(skeleton, b):
                    raise KumiteError(
                        f"{side}_{below} ({skeleton.names[b]!r}) is not below {side}_{above} "
                        f"({skeleton.names[a]!r}); expected a limb's joints in a row: {_SAY_ROLE}"
                    )
    return FoundRoles({r: joints[r] for r in ROLES if r in joints}, how)


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} or {names[-1]}"


# Names -------------------------------------------------------------------------------------------


@functools.lru_cache(maxsize=4096)
def split_name(name: str) -> tuple[str, str | None]:
    """A joint's part and side: ``mixamorig:LeftForeArm`` is ``('forearm', 'left')``."""
    words = [w for w in _words(name) if w not in _EMPTY_WORDS]
    for at in (0, -1, *range(1, max(len(words) - 1, 1))):
        if words and at < len(words) and words[at] in _SIDE_WORDS:
            side = _SIDE_WORDS[words[at]]
            del words[at]
            return "".join(words), side
    joined = "".join(words)
    for word in ("left", "right"):
        if joined.startswith(word) or joined.endswith(word):
            return joined.removeprefix(word).removesuffix(word), word
    # CMU writes lfemur and rhand: a side only where the rest is a part that we know.
    known = {p for parts in _SIDED.values() for p in parts} | {"hipjoint"}
    if joined[:1] in ("l", "r") and joined[1:] in known:
        return joined[1:], _SIDE_WORDS[joined[0]]
    return joined, None


def _words(name: str) -> list[str]:
    """The words of a name behind its namespace, in lower case and without numbers."""
    words = (w.lower() for w in _WORD.findall(re.split(r"[:|]", name)[-1]))
    return [w for w in words if not w.isdigit()]


@functools.lru_cache(maxsize=64)
def _without_prefix(names: tuple[str, ...]) -> tuple[str, ...]:
    """Names without the words that nearly all of them begin with: ``CC_Base_``, ``Robot_``."""
    bare = [re.split(r"[:|]", n)[-1] for n in names]
    while True:
        first = Counter(w[0] for w in map(_words, bare) if len(w) > 1)
        word, count = first.most_common(1)[0] if first else ("", 0)
        if count < _NEARLY_ALL * len(names) or word in _SIDE_WORDS:
            return tuple(bare)
        bare = [_behind(word, n) for n in bare]


def _behind(word: str, name: str) -> str:
    """A name behind its first word, where it is this one and not all that there is."""
    found = next((m for m in _WORD.finditer(name) if not m.group().isdigit()), None)
    if found is None or found.group().lower() != word or len(_words(name)) == 1:
        return name
    return name[found.end() :]


def _by_names(skeleton: Skeleton) -> dict[str, int]:
    """Roles that names settle; ambiguous parts (shoulder, hip, leg) by their company."""
    parts: dict[tuple[str | None, str], int] = {}
    for j, name in enumerate(_without_prefix(skeleton.names)):
        part, side = split_name(name)
        bare = re.split(r"[:|]", name)[-1]
        helper = _HELPER.search(re.sub(r"(?<=[a-z])(?=[A-Z])", " ", bare).lower())
        if not helper or part in _MIDDLE["neck"]:
            parts.setdefault((side, part), j)  # the first of Neck, Neck1 is the neck
    found: dict[str, int] = {}
    # Rigs that name joints, not bones: a wrist is where the hand begins, and a foot is its ball.
    by_joint = ("left", "elbow") in parts and ("left", "wrist") in parts
    sided = _SIDED | (_SIDED_BY_JOINT if by_joint else {})
    for role, words in _MIDDLE.items():
        joint = next((parts[None, w] for w in words if (None, w) in parts), None)
        if joint is not None:
            found[role] = joint
    for side in SIDES:
        used: set[int] = set()
        # Clear words of every role come before the ambiguous words of any: LeftShoulder is a
        # clavicle above LeftArm and an upper arm above LeftElbow; LeftLeg a shin below LeftUpLeg.
        for last in (False, True):
            for role in (
                "upper_arm",
                "forearm",
                "hand",
                "clavicle",
                "thigh",
                "shin",
                "foot",
                "toe",
            ):
                words = sided[role]
                clear = words if last else [w for w in words if w not in _AMBIGUOUS]
                joint = next(
                    (
                        parts[side, w]
                        for w in clear
                        if (side, w) in parts and parts[side, w] not in used
                    ),
                    None,
                )
                if joint is not None and f"{side}_{role}" not in found:
                    if role == "clavicle" and f"{side}_upper_arm" not in found:
                        continue
                    found[f"{side}_{role}"] = joint
                    used.add(joint)
    return found


# Tree --------------------------------------------------------------------------------------------


def _ancestors(skeleton: Skeleton, joint: int) -> list[int]:
    """The joint and all above it, up to the root."""
    path = []
    while joint != NO_PARENT:
        path.append(joint)
        joint = int(skeleton.parents[joint])
    return path


def common_ancestor(skeleton: Skeleton, a: int, b: int) -> int:
    """The lowest joint above (or at) both."""
    above = set(_ancestors(skeleton, a))
    return next(j for j in _ancestors(skeleton, b) if j in above)


def _limb_gaps(skeleton: Skeleton, joints: Mapping[str, int], side: str) -> dict[str, int]:
    """Limb joints that are settled by their neighbours: a shin is what a foot hangs on."""
    found: dict[str, int] = {}
    lengths = np.linalg.norm(skeleton.offsets, axis=1)

    def above(joint: int) -> int | None:
        while joint > 0 and lengths[joint] < 1e-9:
            joint = int(skeleton.parents[joint])
        parent = int(skeleton.parents[joint]) if joint > 0 else 0
        return parent or None

    for parts in (ARM_ROLES[1:], LEG_ROLES[:3]):
        first, middle, last = (f"{side}_{p}" for p in parts)
        known = {r: joints[r] for r in (first, middle, last) if r in joints}
        if last in known and middle not in known:
            joint = above(known[last])
            if joint is not None and joint != known.get(first):
                found[middle] = known[middle] = joint
        if middle in known and first not in known:
            joint = above(known[middle])
            if joint is not None:
                found[first] = joint
        if middle in known and last not in known:
            below = [c for c in skeleton.children(known[middle]) if lengths[c] > 1e-9]
            if len(below) == 1:
                found[last] = below[0]
    foot = found.get(f"{side}_foot", joints.get(f"{side}_foot"))
    if foot is not None and f"{side}_toe" not in joints:
        below = [c for c in skeleton.children(foot) if lengths[c] > 1e-9]
        if len(below) == 1:
            found[f"{side}_toe"] = below[0]
    return found


def _by_limbs(skeleton: Skeleton, limbs: Limbs | None, joints: Mapping[str, int]) -> dict[str, int]:
    """Roles of a skeleton whose names say too little, unless names contradict its shape."""
    if limbs is None:
        return {}
    found: dict[str, int] = {}
    for side, legs, arms in zip(SIDES, limbs.legs, limbs.arms):
        for part, joint in zip(LEG_ROLES, legs):
            found[f"{side}_{part}"] = joint
        for part, joint in zip(ARM_ROLES[-len(arms) :], arms):
            found[f"{side}_{part}"] = joint
    if limbs.head is not None:
        found["head"] = limbs.head
    clash = any(r in joints and joints[r] != j for r, j in found.items() if r != "head")
    return {} if clash else found


def _trunk(skeleton: Skeleton, joints: Mapping[str, int]) -> dict[str, int]:
    """Pelvis, chest, neck and head, once the limbs are known."""
    found: dict[str, int] = {}
    if "left_thigh" in joints and "right_thigh" in joints:
        found["pelvis"] = common_ancestor(skeleton, joints["left_thigh"], joints["right_thigh"])
    if "left_upper_arm" in joints and "right_upper_arm" in joints:
        arms = (joints["left_upper_arm"], joints["right_upper_arm"])
        chest = common_ancestor(skeleton, *arms)
        if chest in (joints.get("neck"), joints.get("head")):
            # Clavicles that hang on the neck (3ds Max Biped): the chest is what the neck hangs on.
            top = int(skeleton.parents[chest])
            chest = chest if top in (NO_PARENT, found.get("pelvis")) else top
        if chest == found.get("pelvis"):
            # Arms that hang on the hips leave the spine beside them: its first joint then.
            spine = [c for c in skeleton.children(chest) if _is_spine(skeleton.names[c])]
            chest = spine[0] if spine else chest
        found["chest"] = chest
        if "head" not in joints and chest != found.get("pelvis"):
            limbs = {j for a in arms for j in _ancestors(skeleton, a)}
            free = [c for c in skeleton.children(chest) if c not in limbs]
            if len(free) == 1:
                below = [free[0]]
                while len(skeleton.children(below[-1])) == 1:
                    below.append(skeleton.children(below[-1])[0])
                found["head"] = below[-1]
                if len(below) > 1:
                    found["neck"] = below[0]
    return found


def _is_spine(name: str) -> bool:
    part, side = split_name(name)
    return side is None and part in ("spine", "chest", "torso", "abdomen", "waist", "thorax")
