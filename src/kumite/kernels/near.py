"""Who is near: a spatial hash of places on the ground, made anew each frame. K characters."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kumite.kernels.jit import kernel

CELL = 2.2  # m, edge of a cell of the hash: no smaller than any radius asked for


class Hash(NamedTuple):
    """A spatial hash of places on the ground, made anew each frame."""

    start: np.ndarray  # [T + 1] int32, T a power of two: first item of a bucket
    item: np.ndarray  # [K] int32, characters by bucket
    cell: np.ndarray  # [K, 2] int32, the cell each is in


@kernel
def bucket(ix, iz, mask):
    """Bucket of a cell."""
    return (ix * 73856093 ^ iz * 19349663) & mask


@kernel
def fill_hash(place, grid):
    """Sort characters at place [K, 3] (x and z count) into buckets; by number within each."""
    mask = grid.start.shape[0] - 2
    grid.start[:] = 0
    for k in range(place.shape[0]):
        grid.cell[k, 0] = int(np.floor(place[k, 0] / CELL))
        grid.cell[k, 1] = int(np.floor(place[k, 2] / CELL))
        grid.start[bucket(grid.cell[k, 0], grid.cell[k, 1], mask) + 1] += 1
    for b in range(mask + 1):
        grid.start[b + 1] += grid.start[b]
    for k in range(place.shape[0] - 1, -1, -1):
        b = bucket(grid.cell[k, 0], grid.cell[k, 1], mask)
        grid.start[b + 1] -= 1
        grid.item[grid.start[b + 1]] = k
    # Each start now stands one bucket too far left: it is the bucket's own.
    for b in range(mask + 1):
        grid.start[b] = grid.start[b + 1]
    grid.start[mask + 1] = place.shape[0]


@kernel
def nearest(k, place, radius, grid, found):
    """The characters nearest to k within a radius [m], nearest first, in found; how many.

    Of equal distances the lower number comes first. found [n] says how many are wanted.
    """
    mask = grid.start.shape[0] - 2
    count = 0
    distance = np.empty(found.shape[0])
    for dx in range(-1, 2):
        for dz in range(-1, 2):
            ix, iz = grid.cell[k, 0] + dx, grid.cell[k, 1] + dz
            b = bucket(ix, iz, mask)
            for i in range(grid.start[b], grid.start[b + 1]):
                j = grid.item[i]
                if j == k or grid.cell[j, 0] != ix or grid.cell[j, 1] != iz:
                    continue
                x, z = place[j, 0] - place[k, 0], place[j, 2] - place[k, 2]
                d2 = x * x + z * z
                if d2 > radius * radius:
                    continue
                at = min(count, found.shape[0] - 1)
                if count == found.shape[0] and not (
                    d2 < distance[at] or (d2 == distance[at] and j < found[at])
                ):
                    continue
                while at > 0 and (
                    d2 < distance[at - 1] or (d2 == distance[at - 1] and j < found[at - 1])
                ):
                    distance[at], found[at] = distance[at - 1], found[at - 1]
                    at -= 1
                distance[at], found[at] = d2, j
                count = min(count + 1, found.shape[0])
    return count
