"""How alike two poses are: joint angles and joint velocities, weighted by joint.

After Lee & Lee 2004, section 6, and Lee et al. 2002. Where a body stands and which way it faces
does not count; how it leans and how high its pelvis is, do.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from kumite.brief import brief
from kumite.checked import checked
from kumite.clip import ClipSet
from kumite.kernels import distance as kernels
from kumite.rotation import conjugate, from_yaw, log, multiply, planar_apply

JOINT_WEIGHTS = MappingProxyType(
    {
        "pelvis": 1.0,
        "spine": 1.0,
        "chest": 1.0,
        "upper_arm": 1.0,
        "forearm": 1.0,
        "thigh": 1.0,
        "shin": 1.0,
    }
)
"""Weight of a joint's squared angle, by the part of its role: Lee et al. 2002's set (shoulders,
elbows, hips, knees, pelvis, spine count, others do not). Joints without a role between the pelvis
and the chest are spine."""
HEIGHT_WEIGHT = 3.0  # rad/m: 10 cm of pelvis height weigh as 0.3 rad
VELOCITY_HORIZON = 0.1  # s: a difference in velocity counts as what it comes to in this time


@brief
@dataclass(frozen=True)
class PoseFeatures:
    """What is compared, poses last and float32 for the kernels. P poses, D Euclidean features."""

    quaternion: np.ndarray  # [Jw, 4, P]
    weight: np.ndarray  # [Jw]
    euclidean: np.ndarray  # [D, P], D even

    def take(self, frames: np.ndarray) -> PoseFeatures:
        return PoseFeatures(
            np.ascontiguousarray(self.quaternion[:, :, frames]),
            self.weight,
            np.ascontiguousarray(self.euclidean[:, frames]),
        )


def joint_weights(clips: ClipSet) -> np.ndarray:
    """Weight [J] of each joint of the skeleton."""
    skeleton = clips.skeleton
    weight = np.zeros(len(skeleton))
    for j in skeleton.trunk(skeleton.joint("chest")):
        weight[j] = JOINT_WEIGHTS["spine"]
    for role, joint in skeleton.roles.items():
        weight[joint] = JOINT_WEIGHTS.get(role.removeprefix("left_").removeprefix("right_"), 0.0)
    return weight


@checked
def pose_features(clips: ClipSet) -> PoseFeatures:
    """Features of every frame (P = F)."""
    skeleton = clips.skeleton
    weight = joint_weights(clips)
    used = np.flatnonzero(weight > 0)
    yaw = clips.facing[:, 2]
    # The pelvis is compared as it stands in the world, whatever joints above it carry.
    pelvis = skeleton.joint("pelvis")
    position, world = clips.world
    hips = position[:, pelvis]
    wxyz = clips.wxyz.copy()
    wxyz[:, pelvis] = world[:, pelvis]
    local = wxyz.copy()
    local[:, pelvis] = multiply(from_yaw(-yaw), wxyz[:, pelvis])
    spin = np.zeros((len(clips), len(skeleton), 3))  # rad/s, joint axes
    drift = np.zeros((len(clips), 3))  # m/s of the pelvis, facing frame
    for a, b in zip(clips.clip_start[:-1], clips.clip_start[1:]):
        if b - a < 2:
            continue
        # Backward differences: what the eye has just seen, and what a join must carry on.
        step = log(multiply(conjugate(wxyz[a : b - 1]), wxyz[a + 1 : b]))
        spin[a + 1 : b] = step * clips.fps
        spin[a] = spin[a + 1]
        moved = np.diff(hips[a:b], axis=0) * clips.fps
        turn = np.zeros((b - a - 1, 3))
        turn[:, 2] = -yaw[a + 1 : b]
        drift[a + 1 : b] = planar_apply(turn, moved)
        drift[a] = drift[a + 1]
    scale = VELOCITY_HORIZON * np.sqrt(weight[used])
    parts = [
        HEIGHT_WEIGHT * hips[:, 1][None],
        HEIGHT_WEIGHT * VELOCITY_HORIZON * drift.T,
        (spin[:, used] * scale[None, :, None]).reshape(len(clips), -1).T,
    ]
    if sum(len(p) for p in parts) % 2:  # the kernels take two at a time
        parts.append(np.zeros((1, len(clips))))
    return PoseFeatures(
        np.ascontiguousarray(np.moveaxis(local[:, used], 0, 2), dtype=np.float32),
        weight[used].astype(np.float32),
        np.ascontiguousarray(np.concatenate(parts), dtype=np.float32),
    )


def squared_distances(features: PoseFeatures, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """D [R, C] float32 rad² between poses, given by their numbers."""
    of = features.take(np.concatenate([rows, columns]))
    out = np.empty((len(rows) + kernels.LANES, len(rows) + len(columns)), dtype=np.float32)
    kernels.distance_rows(of.quaternion, of.weight, of.euclidean, 0, len(rows), out)
    return out[: len(rows), len(rows) :]
