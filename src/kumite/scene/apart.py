"""Fighters that are in each other are pushed apart, slowly enough not to be seen as a jump.

An arm or leg that throws a blow may touch: a fist on its way into a face is meant. All other parts
of two who fight each other, limbs too, leave each other over the ground by the shortest way.
"""

from __future__ import annotations

import numpy as np

from kumite.body import Body, keep_out
from kumite.clip import LIMBS
from kumite.kernels.blow import NO_BLOW
from kumite.scene.floor import PUSH_SPEED, Floor
from kumite.synthesis import Cast

ALLOWED = 0.02  # m that parts may be in each other: skin gives
PULL = 5.0  # m/s²: how fast a push begins and ends
REACH = 1.8  # m between two pelvises beyond which arms do not meet
STRIKES_WITH = {"hand": ("hand", "forearm", "upper_arm"), "foot": ("foot", "shin", "thigh")}


def near_pairs(root: np.ndarray) -> list[tuple[int, int]]:
    """All who may touch, each two once, the lower number first; roots [K, 3] m."""
    place = root[:, [0, 2]]
    away = np.linalg.norm(place[:, None] - place, axis=-1)
    k, o = np.nonzero(np.triu(away <= REACH, 1))
    return list(zip(k.tolist(), o.tolist()))


def held_apart(body: Body, thrown: np.ndarray) -> np.ndarray:
    """Parts of a body that must not be in another: all but those that strike; thrown [4]."""
    strikes = set()
    for limb, blow in zip(LIMBS, thrown.tolist()):
        if blow != NO_BLOW:
            side, end = limb.split("_")
            strikes |= {f"{side}_{part}" for part in STRIKES_WITH[end]}
    return np.array([p for p, name in enumerate(body.parts) if name not in strikes])


def push_apart(floor: Floor) -> None:
    """Carry all who are deeper than :data:`ALLOWED` in each other a bit apart.

    How fast they are carried changes by no more than :data:`PULL`, so it is not seen as a jerk.
    """
    cast, thrown, fps = floor.cast, floor.blows.thrown, floor.fps
    wanted = np.zeros_like(floor.pushed)
    for k, o in near_pairs(cast.root_position):
        way = way_apart(
            (floor.body, cast, k, held_apart(floor.body, thrown[k])),
            (floor.body, cast, o, held_apart(floor.body, thrown[o])),
            PUSH_SPEED / fps,
        )
        wanted[k] += 0.5 * way
        wanted[o] -= 0.5 * way
    change = wanted - floor.pushed
    length = np.maximum(np.hypot(change[:, 0], change[:, 1]), 1e-12)
    floor.pushed += np.minimum(1.0, PULL / fps**2 / length)[:, None] * change
    for k in np.flatnonzero(np.any(floor.pushed != 0.0, axis=1)).tolist():
        cast.carry(k, floor.pushed[k])


One = tuple[Body, Cast, int, np.ndarray]
"""A body, the cast that plays it, its number there, and the parts that must not be in another."""


def push_two(one: One, other: One, fps: float, speed: float = PUSH_SPEED) -> None:
    """Carry two who are deeper than :data:`ALLOWED` in each other a bit apart, at most so fast."""
    way = way_apart(one, other, speed / fps)
    if way.any():
        one[1].carry(one[2], 0.5 * way)
        other[1].carry(other[2], -0.5 * way)


def way_apart(one: One, other: One, most: float) -> np.ndarray:
    """The way [2] m, no longer than ``most``, by which the first is to go farther from the second;
    0 where they are no deeper than :data:`ALLOWED` in each other."""
    (a, cast_a, k, parts), (b, cast_b, o, other_parts) = one, other
    if np.hypot(*(cast_a.root_position[k] - cast_b.root_position[o])[[0, 2]]) > REACH:
        return np.zeros(2)
    found = keep_out(
        a,
        cast_a.position[k],
        cast_a.world_wxyz[k],
        b,
        cast_b.position[o],
        cast_b.world_wxyz[o],
        parts=parts,
        other_parts=other_parts,
    )
    if found.depth <= ALLOWED:
        return np.zeros(2)
    length = float(np.hypot(*found.displacement))
    return min(found.depth - ALLOWED, most) * found.displacement / length
