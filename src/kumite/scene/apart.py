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
    body, cast, thrown = floor.body, floor.cast, floor.blows.thrown
    for k, o in pairs(floor.opponent):
        if np.hypot(*(cast.root_position[k] - cast.root_position[o])[[0, 2]]) > REACH:
            continue
        found = keep_out(
            body,
            cast.position[k],
            cast.world_wxyz[k],
            body,
            cast.position[o],
            cast.world_wxyz[o],
            parts=held_apart(body, thrown[k]),
            other_parts=held_apart(body, thrown[o]),
        )
        if found.depth <= ALLOWED:
            continue
        length = float(np.hypot(*found.displacement))
        way = min(found.depth - ALLOWED, PUSH_SPEED / floor.fps) * found.displacement / length
        cast.carry(k, 0.5 * way)
        cast.carry(o, -0.5 * way)
