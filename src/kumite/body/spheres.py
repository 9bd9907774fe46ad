"""Spheres laid on the skeleton so that they cover the body, its volume (Oshita & Masaoka 2011).

The paper lays them by hand; here they follow from the capsules of the body, and a file of them can
be edited. A chain of spheres covers a capsule if each is a little thicker than the capsule: how
much decides how many there are.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from kumite import toml
from kumite.body.segments import Body, lay_body
from kumite.brief import brief
from kumite.checked import checked
from kumite.clip import LIMBS, ClipSet, Skeleton
from kumite.errors import KumiteError, unknown
from kumite.files import writing
from kumite.rotation import rotate

THICKER = 0.01  # m by which spheres stand out from the capsules they cover
LARGEST = 1.0  # m, of a sphere on a body
BLADE = 0.03  # m, radius of the spheres along a sword
SWORD = "sword"
"""The role of the joint that carries a sword, and its name among what strikes."""
_CARRIED = {"hand": ("forearm", "hand"), "foot": ("shin", "foot")}


@checked
@brief
@dataclass(frozen=True)
class Spheres:
    """B spheres, each carried by a joint."""

    joint: np.ndarray  # [B] int32
    centre: np.ndarray  # [B, 3] m, in the joint's axes
    radius: np.ndarray  # [B] m

    def __post_init__(self) -> None:
        put = object.__setattr__
        count = len(self.joint)
        if count == 0:
            raise KumiteError("spheres: there are none; expected at least one")
        for name, shape, dtype in (
            ("joint", (count,), np.int32),
            ("centre", (count, 3), np.float64),
            ("radius", (count,), np.float64),
        ):
            array = np.array(getattr(self, name), dtype=dtype)
            if array.shape != shape or not np.all(np.isfinite(array)):
                raise KumiteError(f"spheres: {name} is {array.shape}, expected finite {shape}")
            array.flags.writeable = False
            put(self, name, array)
        if np.any(self.radius <= 0) or np.any(self.joint < 0):
            raise KumiteError("spheres: radii must be more than 0, joints at least 0")

    def __len__(self) -> int:
        return len(self.joint)

    def at(self, position: np.ndarray, world_wxyz: np.ndarray) -> np.ndarray:
        """Centres [..., B, 3] in poses of joints at [..., J, 3] turned by [..., J, 4]."""
        turned = rotate(world_wxyz[..., self.joint, :], self.centre)
        return position[..., self.joint, :] + turned

    def of_frames(self, clips: ClipSet) -> np.ndarray:
        """Centres [F, 3, B] float32 of all frames, in the clips' world."""
        position, world = clips.world
        return np.ascontiguousarray(np.moveaxis(self.at(position, world), -1, -2), np.float32)


@checked
def lay_spheres(
    skeleton: Skeleton, body: Body | None = None, *, thicker: float = THICKER
) -> Spheres:
    """Chains of spheres that cover every capsule of a body, and stand out by ``thicker`` [m].

    Between two spheres of radius R whose centres are 2 h apart the chain is √(R² - h²) thick, so
    R = r + thicker allows h² = R² - r². Errors: not more than 0; roles that are missing.
    """
    if not 0 < thicker < LARGEST:
        raise KumiteError(f"spheres: thicker by {thicker} m; expected more than 0, below {LARGEST}")
    body = body or lay_body(skeleton)
    joint, centre, radius = [], [], []
    for b in range(len(body)):
        r0, r1 = float(body.radius_start[b]), float(body.radius_end[b])
        thin = min(r0, r1)
        apart = 2.0 * np.sqrt((thin + thicker) ** 2 - thin**2)
        length = float(np.linalg.norm(body.end[b] - body.start[b]))
        count = 1 if length == 0.0 else int(np.ceil(length / apart)) + 1
        for t in np.linspace(0.0, 1.0, count) if count > 1 else [0.0]:
            joint.append(int(body.joint[b]))
            centre.append(body.start[b] + t * (body.end[b] - body.start[b]))
            # The next sphere may be thicker: as thick as the capsule is half way to it.
            reach = 0.5 * abs(r1 - r0) / max(count - 1, 1)
            radius.append(r0 + t * (r1 - r0) + thicker + reach)
    return Spheres(np.array(joint), np.array(centre), np.array(radius))


@checked
def limb_spheres(
    skeleton: Skeleton, limb: str, body: Body | None = None, *, thicker: float = THICKER
) -> Spheres:
    """What of a body strikes with a limb: its fist and forearm, foot and shin, or its sword.

    limb: one of ``clip.LIMBS``, or ``sword``: spheres along the blade, from the joint of that role
    to its tip. Errors: another limb; no sword; not more than 0.
    """
    if limb == SWORD:
        return _blade(skeleton)
    if limb not in LIMBS:
        raise unknown("limb", limb, (*LIMBS, SWORD))
    body = body or lay_body(skeleton)
    side, end = limb.split("_")
    rows = [body.part(f"{side}_{part}") for part in _CARRIED[end]]
    names = ("joint", "start", "end", "radius_start", "radius_end", "mass")
    arrays = [getattr(body, name)[rows] for name in names]
    return lay_spheres(skeleton, Body(tuple(body.parts[r] for r in rows), *arrays), thicker=thicker)


@checked
def strikes_with(skeleton: Skeleton, limb: str) -> str:
    """What strikes when a limb does: the limb, or the sword in its hand."""
    if SWORD in skeleton.roles and skeleton.tip(limb)[0] == skeleton.joint(SWORD):
        return SWORD
    return limb


def _blade(skeleton: Skeleton) -> Spheres:
    joint = skeleton.joint(SWORD)
    carrier, point = skeleton.tip(SWORD)
    if carrier != joint:  # the tip hangs from a joint below: at rest it is so far from the hilt
        point = skeleton.rest_positions[carrier] + point - skeleton.rest_positions[joint]
    # The blade is a line: spheres that touch at 1.4 radii from centre to centre are 0.7 thick.
    count = int(np.ceil(float(np.linalg.norm(point)) / (1.4 * BLADE))) + 1
    centre = np.linspace(0.0, 1.0, count)[:, None] * point
    return Spheres(np.full(count, joint), centre, np.full(count, BLADE))


class _Sphere(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    joint: str  # a joint's name or role
    centre: tuple[float, float, float]  # m, in the joint's axes
    radius: float = Field(gt=0, le=LARGEST)


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    sphere: tuple[_Sphere, ...] = Field(min_length=1)


@checked
def save_spheres(path: Path | str, spheres: Spheres, skeleton: Skeleton) -> None:
    """A TOML file of them, one ``[[sphere]]`` each, that can be edited."""
    names = skeleton.names
    # A role may be another joint's name.
    roles = {j: role for role, j in skeleton.roles.items() if role not in names or names[j] == role}
    rows = [
        "# Spheres on the skeleton: joint (role or name), centre in its axes and radius in m.\n"
    ]
    for j, centre, r in zip(spheres.joint.tolist(), spheres.centre.tolist(), spheres.radius):
        name = json.dumps(roles.get(j, names[j]), ensure_ascii=False)
        x, y, z = centre
        rows.append(
            f"\n[[sphere]]\njoint = {name}\ncentre = [{x:.4f}, {y:.4f}, {z:.4f}]\n"
            f"radius = {r:.4f}\n"
        )
    with writing(path) as temporary:
        temporary.write_text("".join(rows), "utf-8", newline="\n")


@checked
def load_spheres(path: Path | str, skeleton: Skeleton) -> Spheres:
    """Errors: a file that is missing, no TOML, or names a joint that the skeleton has not."""
    path = Path(path)
    try:
        text = path.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not UTF-8 text"
        raise KumiteError(f"{path}: cannot be read ({reason}); expected a TOML file") from None
    rows: Sequence[_Sphere] = toml.parse(text, str(path), _File).sphere
    joints = [_joint(path, skeleton, row.joint) for row in rows]
    return Spheres(
        np.array(joints), np.array([r.centre for r in rows]), np.array([r.radius for r in rows])
    )


def _joint(path: Path, skeleton: Skeleton, name: str) -> int:
    if name in skeleton.names:
        return skeleton.names.index(name)
    if name in skeleton.roles:
        return int(skeleton.roles[name])
    error = unknown("joint", name, [*skeleton.roles, *skeleton.names])
    raise KumiteError(f"{path}: {error}")
