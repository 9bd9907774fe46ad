"""Room between limbs and the rest of the body: a fist does not go into the chin.

Tables place hands; bodies have girth. What would be inside is pushed out to the skin, softly, so
that a motion stays as smooth as its keys were.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from kumite.body import lay_body
from kumite.performer.skeleton import Trunk, skeleton

SOFT = 0.012  # m over which a point begins to be pushed
GIVE = 0.008  # m that flesh and gloves give
FIST_CENTRE = 0.04  # m, of the glove's ball behind the fist's front
HAND = 0.10  # m, from a fist's front back to the wrist
FLOOR = 0.06  # m of a fist above the ground


@cache
def _capsules() -> dict[str, tuple[str, np.ndarray, np.ndarray, float]]:
    """By part: the joint that carries it, its ends [3] in that joint's axes and its radius."""
    body, names = lay_body(skeleton()), skeleton().names
    out = {}
    for k, part in enumerate(body.parts):
        thick = float(max(body.radius_start[k], body.radius_end[k]))
        out[part] = (names[int(body.joint[k])], body.start[k], body.end[k], thick)
    return out


def _trunk_capsules(
    trunk: Trunk, parts: tuple[str, ...]
) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """Ends [F, 3] and radius of parts of the trunk, in the world."""
    rows = (_capsules()[part] for part in parts)
    return [(trunk.carried(j, a), trunk.carried(j, b), thick) for j, a, b, thick in rows]


def pushed_out(point: np.ndarray, a: np.ndarray, b: np.ndarray, room: float) -> np.ndarray:
    """Points [F, 3] at least ``room`` from the segments a [F, 3] to b [F, 3]."""
    along = b - a
    length = float(np.linalg.norm(along[0]))  # of a bone: the same in all frames
    middle = point - a - 0.5 * along
    # Beyond six times the softness nothing is pushed, to the bit.
    near = np.flatnonzero(
        np.einsum("fc,fc->f", middle, middle) < (room + 0.5 * length + 6 * SOFT) ** 2
    )
    if not len(near):
        return point
    along, from_a = along[near], point[near] - a[near]
    t = np.einsum("fc,fc->f", from_a, along) / max(length**2, 1e-9)
    away = from_a - np.clip(t, 0.0, 1.0)[:, None] * along
    distance = np.maximum(np.sqrt(np.einsum("fc,fc->f", away, away)), 1e-4)
    wanted = room + SOFT * np.logaddexp(0.0, (distance - room) / SOFT)
    push = np.where(distance < room + 6 * SOFT, wanted / distance - 1.0, 0.0)
    out = point.copy()
    out[near] += push[:, None] * away
    return out


def clear_hands(hand: np.ndarray, shoulder: np.ndarray, trunk: Trunk) -> np.ndarray:
    """Fists' fronts [F, 2, 3] out of the trunk, the head and each other, and above the floor.

    shoulder [F, 2, 3]: about where the arms begin, which says how the fists lie.
    """
    out = hand.copy()
    capsules = _trunk_capsules(trunk, ("head", "neck", "chest", "waist", "pelvis"))
    thick = _capsules()["left_hand"][3]
    for _ in range(2):
        for s in range(2):
            way = out[:, s] - shoulder[:, s]
            way = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-6)
            centre = out[:, s] - FIST_CENTRE * way
            moved = centre
            for a, b, room in capsules:
                moved = pushed_out(moved, a, b, room + thick - GIVE)
            other = out[:, 1 - s]
            back = shoulder[:, 1 - s] - other
            back = back / np.maximum(np.linalg.norm(back, axis=1, keepdims=True), 1e-6)
            moved = pushed_out(moved, other, other + HAND * back, 2 * thick - GIVE)
            out[:, s] += moved - centre
    out[:, :, 1] = _above(out[:, :, 1], FLOOR)
    return out


def clear_elbow(elbow: np.ndarray, trunk: Trunk) -> np.ndarray:
    """Elbows [F, 3] out of the ribs, the hips and the floor."""
    thick = _capsules()["left_forearm"][3]
    for a, b, room in _trunk_capsules(trunk, ("chest", "waist", "pelvis")):
        elbow = pushed_out(elbow, a, b, room + thick - GIVE)
    low = elbow[:, 1]
    elbow[:, 1] = np.where(low > thick + 8 * SOFT, low, _above(low, thick))
    return elbow


def _above(height: np.ndarray, floor: float) -> np.ndarray:
    return floor + SOFT * np.logaddexp(0.0, (height - floor) / SOFT)
