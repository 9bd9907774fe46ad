"""Two-bone limbs: an arm or a leg from where it begins, where it ends and which way it bends."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from kumite.rotation import (
    between,
    conjugate,
    cross,
    from_axis_angle,
    from_matrix,
    multiply,
    rotate,
)


def two_bones(
    root: np.ndarray,
    goal: np.ndarray,
    lengths: tuple[float, float],
    pole: np.ndarray,
    axis: np.ndarray,
    reach: tuple[float, float],
    brake: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """World rotations [F, 4] of two bones from root [F, 3] to goal [F, 3].

    lengths: of the bones [m]; pole [F, 3]: the way the middle joint points; axis [3]: the bones'
    direction at rest; reach: the shortest and the longest distance [m] between the ends that the
    bones may span; brake: over how much [m] they come to the longest, softly, or 0. The bend's axis
    is the cross product of pole and direction, so a hinge bends one way only.
    """
    upper = middle(root, goal, lengths, pole, reach, brake)
    way, d = _span(root, goal, reach, brake)
    lower = way * d[:, None] - upper
    # At right angles to the bend; of a straight limb, to its pole.
    hinge = cross(pole, way)
    # The side axis at rest is +X for a leg (knees bend about it) and -Y or +Y for an arm in a T.
    side = np.array([1.0, 0.0, 0.0]) if axis[1] else np.array([0.0, -axis[0], 0.0])
    return along_bone(upper, hinge, axis, side), along_bone(lower, hinge, axis, side)


def middle(
    root: np.ndarray,
    goal: np.ndarray,
    lengths: tuple[float, float],
    pole: np.ndarray,
    reach: tuple[float, float],
    brake: float = 0.0,
) -> np.ndarray:
    """Where the middle joint is [F, 3], seen from the root: see :func:`two_bones`."""
    first, second = lengths
    way, d = _span(root, goal, reach, brake)
    out = pole - np.sum(pole * way, axis=1, keepdims=True) * way
    out = out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-6)
    along = (first**2 - second**2 + d**2) / (2 * d)
    aside = np.sqrt(np.maximum(first**2 - along**2, 0.0))
    return way * along[:, None] + out * aside[:, None]


def _span(
    root: np.ndarray, goal: np.ndarray, reach: tuple[float, float], brake: float
) -> tuple[np.ndarray, np.ndarray]:
    """Direction [F, 3] and length [F] of a limb."""
    to = goal - root
    length = np.linalg.norm(to, axis=1, keepdims=True)
    d = np.minimum(length[:, 0], reach[1])
    if brake:
        # An elbow snaps straight, but not at once: the last centimetres are braked.
        d = reach[1] - brake * np.logaddexp(0.0, (reach[1] - length[:, 0]) / brake)
    return to / np.maximum(length, 1e-6), np.maximum(d, reach[0])


def swivelled(way: np.ndarray, ahead: np.ndarray, hang: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Where elbows point [F, 3], for arms that reach along ``way`` [F, 3].

    An arm that reaches along ``ahead`` [3] has its elbow at ``hang`` [3]; any other follows by the
    shortest arc between the two ways, so that the elbow's way is as smooth as the hand's all over
    the sphere but for straight behind ``ahead``, where no hand goes. ``turn`` [F] swivels the elbow
    about the way of the arm [rad]. All in the chest's axes.
    """
    way = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-6)
    axis = cross(ahead, way)
    cosine = way @ ahead
    # Rodrigues with sine and cosine of the arc between them: v cos + k×v sin + k (k·v)(1-cos).
    hung = (
        hang * cosine[:, None]
        + cross(axis, hang)
        + axis * ((axis @ hang) / np.maximum(1.0 + cosine, 1e-3))[:, None]
    )
    return (
        hung * np.cos(turn)[:, None]
        + cross(way, hung) * np.sin(turn)[:, None]
        + way * (np.sum(way * hung, axis=1) * (1 - np.cos(turn)))[:, None]
    )


def along_bone(
    bone: np.ndarray, hinge: np.ndarray, axis: np.ndarray, side: np.ndarray
) -> np.ndarray:
    """Rotations [F, 4] that turn ``axis`` [3] onto the bone [F, 3] and ``side`` [3] onto the hinge
    [F, 3], made square to the bone.
    """
    bone = bone / np.linalg.norm(bone, axis=1, keepdims=True)
    hinge = hinge - np.sum(hinge * bone, axis=1, keepdims=True) * bone
    hinge = hinge / np.maximum(np.linalg.norm(hinge, axis=1, keepdims=True), 1e-9)
    rest = np.stack([axis, side, cross(axis, side)], axis=1)  # columns
    now = np.stack([bone, hinge, cross(bone, hinge)], axis=2)
    return from_matrix(now @ rest.T)


def held(
    forearm: np.ndarray, blade: np.ndarray, axis: np.ndarray, rest: np.ndarray, frames: float
) -> np.ndarray:
    """Rotations [F, 4] of a hand that points what it holds along ``blade`` [F, 3].

    forearm [F, 4]: the forearm's rotation, in the chest's axes; axis [3]: its direction at rest;
    rest [3]: the held thing's direction in the hand's axes, not along ``axis``. A hand can roll
    about what it holds: it rolls to where the wrist is bent least, the same way round the blade as
    the forearm. Where both are in line any roll is as good, so there the roll is that of the frames
    before and after, smoothed over ``frames``, and the hand never flips.
    """
    ahead, up = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
    blade = blade / np.maximum(np.linalg.norm(blade, axis=1, keepdims=True), 1e-9)
    swing = between(ahead, blade)
    arm = rotate(conjugate(swing), rotate(forearm, axis))  # seen along the blade
    off = np.hypot(arm[:, 0], arm[:, 1])
    roll = np.unwrap(np.arctan2(arm[:, 1], arm[:, 0]))
    weight = off**2 + 1e-4
    roll = gaussian_filter1d(weight * roll, frames, mode="nearest") / gaussian_filter1d(
        weight, frames, mode="nearest"
    )
    # The hand at rest, its blade turned ahead and its direction to +X, from where rolls count.
    side = cross(rest, axis)
    grip = np.stack([rest, side / np.linalg.norm(side), cross(rest, side)], axis=1)
    goal = np.stack([ahead, up, cross(ahead, up)], axis=1)
    home = from_matrix((goal @ np.linalg.inv(grip / np.linalg.norm(grip, axis=0)))[None])[0]
    return multiply(swing, multiply(from_axis_angle(ahead, roll), home))
