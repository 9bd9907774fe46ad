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
REACH = 1.8  # m between two pelvises beyond which arms do not meet
STRIKES_WITH = {"hand": ("hand", "forearm", "upper_arm"), "foot": ("foot", "shin", "thigh")}


def pairs(opponent: np.ndarray) -> list[tuple[int, int]]:
    """Who fights whom, each two once, the lower number first; opponent [K]."""
    both = {(min(k, o), max(k, o)) for k, o in enumerate(opponent.tolist()) if o >= 0}
    return sorted(both)


def held_apart(body: Body, thrown: np.ndarray) -> np.ndarray:
    """Parts of a body that must not be in another: all but those that strike; thrown [4]."""
    strikes = set()
    for limb, blow in zip(LIMBS, thrown.tolist()):
        if blow != NO_BLOW:
            side, end = limb.split("_")
            strikes |= {f"{side}_{part}" for part in STRIKES_WITH[end]}
    return np.array([p for p, name in enumerate(body.parts) if name not in strikes])


def push_apart(floor: Floor) -> None:
    """Carry every two who fight and are deeper than :data:`ALLOWED` in each other a bit apart."""
    cast, thrown = floor.cast, floor.blows.thrown
    for k, o in pairs(floor.opponent):
        push_two(
            (floor.body, cast, k, held_apart(floor.body, thrown[k])),
            (floor.body, cast, o, held_apart(floor.body, thrown[o])),
            floor.fps,
        )


One = tuple[Body, Cast, int, np.ndarray]
"""A body, the cast that plays it, its number there, and the parts that must not be in another."""


def push_two(one: One, other: One, fps: float, speed: float = PUSH_SPEED) -> None:
    """Carry two who are deeper than :data:`ALLOWED` in each other a bit apart, at most so fast."""
    (a, cast_a, k, parts), (b, cast_b, o, other_parts) = one, other
    if np.hypot(*(cast_a.root_position[k] - cast_b.root_position[o])[[0, 2]]) > REACH:
        return
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
        return
    length = float(np.hypot(*found.displacement))
    way = min(found.depth - ALLOWED, speed / fps) * found.displacement / length
    cast_a.carry(k, 0.5 * way)
    cast_b.carry(o, -0.5 * way)
