"""Two posed bodies that are in each other: how deep, and the shortest way out over the ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kumite.body.segments import Body
from kumite.brief import brief
from kumite.checked import checked
from kumite.errors import KumiteError
from kumite.kernels import overlap as kernels
from kumite.rotation import rotate

DIRECTIONS = 16  # ways out that are tried: the shortest of them is at most 2 % too long in the open
NEAR = 5e-4  # m of depth that counts as apart
NO_PART = -1
FARTHEST = 3.0  # m that any two people must go at most


@brief
@dataclass(frozen=True)
class Apart:
    """What two bodies need to be apart."""

    depth: float  # m of the deepest pair of parts, 0 if the bodies are apart
    part: int  # the first body's in that pair, or NO_PART
    other: int  # the second body's, or NO_PART
    displacement: np.ndarray  # [2] m (x, z) by which the first body leaves the second


def posed(body: Body, position: np.ndarray, world_wxyz: np.ndarray) -> tuple[np.ndarray, ...]:
    """Ends [B, 3], [B, 3] of a body's parts in a world pose [J, 3], [J, 4], and their radii."""
    at, turned = position[body.joint], world_wxyz[body.joint]
    start, end = at + rotate(turned, body.start), at + rotate(turned, body.end)
    return start, end, body.radius_start, body.radius_end


@checked
def keep_out(
    body: Body,
    position: np.ndarray,
    world_wxyz: np.ndarray,
    other: Body,
    other_position: np.ndarray,
    other_world_wxyz: np.ndarray,
    *,
    parts: np.ndarray | None = None,
    other_parts: np.ndarray | None = None,
) -> Apart:
    """How deep two posed bodies are in each other, and how the first must move to be out.

    Poses are of the world: positions [J, 3] m, rotations [J, 4]. The displacement is the shortest
    of :data:`DIRECTIONS` ways over the ground, the line between the bodies' middles among them;
    after it parts are at most :data:`NEAR` deep. parts, other_parts: rows of the bodies that count,
    by default all. Errors: poses that do not fit the bodies.
    """
    for b, p in ((body, position), (other, other_position)):
        if p.ndim != 2 or len(p) <= int(b.joint.max()) or not np.all(np.isfinite(p)):
            raise KumiteError(f"bodies: a pose {list(p.shape)} that does not fit its body")
    mine = np.arange(len(body)) if parts is None else np.asarray(parts)
    its = np.arange(len(other)) if other_parts is None else np.asarray(other_parts)
    a = tuple(x[mine] for x in posed(body, position, world_wxyz))
    b = tuple(x[its] for x in posed(other, other_position, other_world_wxyz))
    pair = np.full(2, NO_PART, dtype=np.int64)
    scratch = (np.empty(3) for _ in range(3))
    depth = float(kernels.deepest_pair(*a, *b, 0.0, 0.0, pair, *scratch))
    part, of_other = NO_PART, NO_PART
    if depth > 0.0:
        part, of_other = int(mine[pair[0]]), int(its[pair[1]])
    if depth <= NEAR:
        return Apart(depth, part, of_other, np.zeros(2))
    line = (a[0] + a[1]).mean(axis=0) - (b[0] + b[1]).mean(axis=0)
    first = float(np.arctan2(line[2], line[0]))  # any, when one stands in the other
    best, shortest = np.zeros(2), FARTHEST
    for k in range(DIRECTIONS):
        # Outwards from the likeliest, so that the others stop early.
        angle = first + np.pi * 2.0 / DIRECTIONS * ((k + 1) // 2) * (-1.0) ** k
        direction = np.array([np.cos(angle), np.sin(angle)])
        way = float(kernels.push_out(*a, *b, direction, NEAR, shortest, pair))
        if way < shortest:
            best, shortest = way * direction, way
    return Apart(depth, part, of_other, best)
