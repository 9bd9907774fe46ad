"""Balance: where the centre of mass is, and whether it is over the support area.

The centre of mass follows from the masses of the body's parts (de Leva 1996), each taken to lie at
the centroid of its capsule. The support area is the convex hull of what touches the ground: heel,
ball and toes of the feet that stand, each as wide as a foot.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kumite import rotation
from kumite.annotate.contacts import Contacts
from kumite.body import Body, lay_body
from kumite.body.segments import foot_line
from kumite.body.stance import stand
from kumite.brief import brief
from kumite.checked import checked
from kumite.checks import freeze
from kumite.clip import SIDES, ClipSet, Skeleton
from kumite.errors import KumiteError
from kumite.kernels import balance as kernels

BREADTH_OF_STATURE = 0.055  # of a foot: Drillis & Contini 1966, as the lengths of body/stance.py
RAISED = 0.03  # m above a foot's lowest corner: what is higher does not touch the ground
CORNERS = 6  # of a foot: heel, ball and toes, left and right of each


@checked
@brief
@dataclass(frozen=True)
class Balance:
    """The centre of mass and its support, frame by frame."""

    centre: np.ndarray  # [F, 3] m
    corner: np.ndarray  # [F, 2, 6, 2] m, x and z of what may touch the ground, left and right foot
    touches: np.ndarray  # [F, 2, 6] bool, which of these do
    distance: np.ndarray  # [F] m from the support area, negative inside, inf where nothing touches

    def __post_init__(self) -> None:
        frames = len(self.centre)
        freeze(
            self,
            "balance",
            centre=(float, (frames, 3)),
            corner=(float, (frames, 2, CORNERS, 2)),
            touches=(np.bool_, (frames, 2, CORNERS)),
        )
        freeze(self, "balance", False, distance=(float, (frames,)))

    @property
    def balanced(self) -> np.ndarray:
        """Whether the centre of mass is over the support area [F]."""
        return self.distance <= 0.0


@checked
def find_balance(clips: ClipSet, contacts: Contacts, body: Body | None = None) -> Balance:
    """Centre of mass, support area and the distance between them of every frame.

    Errors: contacts of other clips; roles that are missing.
    """
    if len(contacts.on_ground) != len(clips):
        raise KumiteError(
            f"balance: contacts of {len(contacts.on_ground)} frames, clips of {len(clips)}"
        )
    position, world = clips.world
    centre = centre_of_mass(body or lay_body(clips.skeleton), position, world)
    corner, touches = support(clips.skeleton, position, world, contacts.on_ground)
    return Balance(centre, corner, touches, support_distance(corner, touches, centre[:, [0, 2]]))


def support(
    skeleton: Skeleton, position: np.ndarray, world_wxyz: np.ndarray, on_ground: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Corners [F, 2, 6, 2] m of the soles in poses, x and z, and which of them [F, 2, 6] touch the
    ground. on_ground [F, 2]: feet that stand. Errors: roles that are missing."""
    at = sole_corners(skeleton, position, world_wxyz)
    low = at[..., 1].min(axis=2, keepdims=True)
    touches = on_ground[:, :, None] & (at[..., 1] <= low + RAISED)
    return np.ascontiguousarray(at[..., [0, 2]]), touches


@checked
def centre_of_mass(body: Body, position: np.ndarray, world_wxyz: np.ndarray) -> np.ndarray:
    """Centres of mass [..., 3] of poses of joints at [..., J, 3] turned by [..., J, 4]."""
    turned = rotation.rotate(world_wxyz[..., body.joint, :], centroids(body))
    share = body.mass / body.mass.sum()
    return np.einsum("b,...bc->...c", share, position[..., body.joint, :] + turned)


def centroids(body: Body) -> np.ndarray:
    """Centroids [B, 3] of the parts in their joints' axes: a frustum between two half spheres."""
    way = body.end - body.start
    length = np.linalg.norm(way, axis=1)
    r, s = body.radius_start, body.radius_end
    frustum = length / 3 * (r * r + r * s + s * s)  # volumes over π
    first, last = 2 / 3 * r**3, 2 / 3 * s**3
    along = length / 4 * (r * r + 2 * r * s + 3 * s * s) / (r * r + r * s + s * s)
    moment = frustum * along - first * 3 / 8 * r + last * (length + 3 / 8 * s)
    middle = moment / (frustum + first + last)
    return body.start + way * (middle / np.maximum(length, 1e-12))[:, None]


def sole_corners(skeleton: Skeleton, position: np.ndarray, world_wxyz: np.ndarray) -> np.ndarray:
    """Corners [..., 2, 6, 3] of the soles in poses: heels, balls and toes, inner and outer.

    Toes are carried by the toe's joint where there is one, so that they stay flat under a raised
    heel. Errors: roles that are missing.
    """
    stance = stand(skeleton)
    joints, places = [], []
    for side in SIDES:
        heel, toe = foot_line(skeleton, stance, side)
        ahead = (toe - heel) / np.linalg.norm(toe - heel)
        across = np.cross([0.0, 1.0, 0.0], ahead) * 0.5 * BREADTH_OF_STATURE * stance.stature
        foot = skeleton.joint(f"{side}_foot")
        front = skeleton.roles.get(f"{side}_toe", foot)
        ball = 0.3 * heel + 0.7 * toe
        if front != foot:  # below the toe's joint
            ball = heel + ahead * float((stance.position[front] - heel) @ ahead)
        for carrier, point in ((foot, heel), (foot, ball), (front, toe)):
            for sign in (1.0, -1.0):
                joints.append(carrier)
                places.append(stance.in_joint(carrier, point + sign * across))
    corner = position[..., joints, :] + rotation.rotate(world_wxyz[..., joints, :], places)
    return corner.reshape(*corner.shape[:-2], 2, CORNERS, 3)


def support_distance(corner: np.ndarray, touches: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Signed distances [F] m of ground points [F, 2] to the convex hulls of the corners
    [F, ..., 2] that touch the ground [F, ...]: negative inside, inf where none does."""
    frames = len(point)
    out = np.empty(frames)
    kernels.support_distances(
        np.ascontiguousarray(corner.reshape(frames, -1, 2), dtype=np.float64),
        np.ascontiguousarray(touches.reshape(frames, -1), dtype=np.bool_),
        np.ascontiguousarray(point, dtype=np.float64),
        out,
    )
    return out
