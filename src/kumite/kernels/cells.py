"""What makes the search for an avoidance quick (Oshita & Masaoka 2011, section 5).

The *index* lists for every state and cell of space the paths that leave this cell in time; *masks*
show in nine horizontal slices where a body stays throughout its avoidance, so that an attack which
comes there hits. Neither changes what is found: the index lists every path whose avoidance volume
an attack can meet, and a bit is set only where the attack would be met for certain.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kumite.kernels.avoid import frame_of, lay, put_body
from kumite.kernels.jit import kernel, lean_kernel

CELL = 0.10  # m (section 5.1)
ACROSS, HIGH = 40, 23  # cells about a character: what is beyond counts as in the outermost
LOWEST = -0.1  # m
MARGIN = 1e-3  # m by which places are taken to be uncertain
SLICES = 9
SLICE = 0.22  # m
PIXEL = 0.04  # m
PIXELS = 64


class Index(NamedTuple):
    """P paths of all states and E entries of their cells, both by state."""

    path_of: np.ndarray  # [N + 1]
    box: np.ndarray  # [N, 2, 3] m, from where to where the body leaves cells, in the state's frame
    path: np.ndarray  # [P, D'] int32, of as many edges as there are at most
    length: np.ndarray  # [P] int32
    part: np.ndarray  # [P] int32
    middle: np.ndarray  # [P] float32 frames from the state to the middle of the part
    cell_of: np.ndarray  # [N + 1]
    cell: np.ndarray  # [U] int32, ascending in each state
    entry_of: np.ndarray  # [U + 1]
    entry: np.ndarray  # [E] int32, number of a path in its state


@lean_kernel
def cell_of(x, y, z):
    """The cell that a point is in."""
    half = 0.5 * ACROSS * CELL
    a = min(max(int(np.floor((x + half) / CELL)), 0), ACROSS - 1)
    b = min(max(int(np.floor((y - LOWEST) / CELL)), 0), HIGH - 1)
    c = min(max(int(np.floor((z + half) / CELL)), 0), ACROSS - 1)
    return (b * ACROSS + a) * ACROSS + c


@lean_kernel
def cells_of(x, y, z, r, seen, stamp, out):
    """Cells that a sphere meets and that are not stamped yet, into ``out``, which has room for all.
    Returns their number.
    """
    n = 0
    r = r + MARGIN
    half = 0.5 * ACROSS * CELL
    i0, i1 = int(np.floor((x - r + half) / CELL)), int(np.floor((x + r + half) / CELL))
    j0, j1 = int(np.floor((y - r - LOWEST) / CELL)), int(np.floor((y + r - LOWEST) / CELL))
    k0, k1 = int(np.floor((z - r + half) / CELL)), int(np.floor((z + r + half) / CELL))
    for j in range(j0, j1 + 1):
        low = LOWEST + j * CELL
        dy = max(low - y, 0.0, y - low - CELL)
        for i in range(i0, i1 + 1):
            low = i * CELL - half
            dx = max(low - x, 0.0, x - low - CELL)
            for k in range(k0, k1 + 1):
                low = k * CELL - half
                dz = max(low - z, 0.0, z - low - CELL)
                if dx * dx + dy * dy + dz * dz > r * r:
                    continue
                a = min(max(i, 0), ACROSS - 1)
                b = min(max(j, 0), HIGH - 1)
                c = min(max(k, 0), ACROSS - 1)
                key = (b * ACROSS + a) * ACROSS + c
                if seen[key] != stamp:
                    seen[key] = stamp
                    out[n] = key
                    n += 1
    return n


@kernel
def enter(
    count, path, length, part, now, graph, volumes, moves, scratch, stamp, seen, size, key, of, box
):  # fmt: skip
    """Cells that ``count`` paths of one state leave: keys and numbers of paths, into key and of.

    A sphere of the body counts in the cell that its middle is in, and an attack looks so much
    farther: far fewer entries than cells that are touched, and the same paths or a few more.
    moves [A, B] bool: spheres that leave their place in a part. size [cells] counts entries, box
    [2, 3] grows around middles. Returns how many there are; if more than there is room for, the
    rest is only counted.
    """
    n, room = 0, key.shape[0]
    for c in range(count):
        p = part[c]
        lay(path[c], length[c], now, graph, scratch)
        first = graph.begins[p]
        frame = scratch.anchor[length[c]]
        put_body(volumes, 0, volumes.radius.shape[0], first, 0.0, first, frame, scratch.still)
        for j in range(scratch.still.shape[1]):
            if not moves[p, j]:
                continue
            for axis in range(3):
                box[0, axis] = min(box[0, axis], scratch.still[axis, j])
                box[1, axis] = max(box[1, axis], scratch.still[axis, j])
            x, y, z = scratch.still[0, j], scratch.still[1, j], scratch.still[2, j]
            key_here = cell_of(x, y, z)
            if seen[key_here] == stamp + c:
                continue
            seen[key_here] = stamp + c
            if n < room:
                key[n], of[n] = key_here, c
                size[key_here] += 1
            n += 1
    return n


@kernel
def gather(count, key, of, size, cell, entry_of, entry):
    """Entries sorted by cell: cells that have any, where their entries begin, and these."""
    used, n = 0, 0
    for k in range(size.shape[0]):
        if size[k]:
            cell[used], entry_of[used] = k, n
            n += size[k]
            size[k] = entry_of[used]  # from here on where the next entry goes
            used += 1
    for e in range(count):
        entry[size[key[e]]] = of[e]
        size[key[e]] += 1
    size[:] = 0
    return used


@lean_kernel
def look_up(
    state, facing, ahead, low, high, attacks, main, widest, index, stamp, turn, seen, seen_path,
    found, path, length, part,
):  # fmt: skip
    """Paths of a state's index that leave cells an attack comes through, between ``low`` and
    ``high`` frames from now (exclusive), in their order. As :func:`enumerate_paths` does.

    facing [3]: the state's facing frame in the scene, ``ahead`` frames from now. widest [m]: the
    largest sphere of the body. turn [4]: room.
    """
    frame_of(facing, turn)
    first = index.path_of[state]
    total = index.path_of[state + 1] - first
    for p in range(total):
        seen_path[p] = False
    begin, end, box = index.cell_of[state], index.cell_of[state + 1], index.box[state]
    for n in range(attacks.sample[main], attacks.sample[main + 1]):
        for i in range(attacks.count[main]):
            a, b = attacks.centre[n, i, 0] - turn[0], attacks.centre[n, i, 2] - turn[1]
            x, z = turn[2] * a - turn[3] * b, turn[3] * a + turn[2] * b
            y, r = attacks.centre[n, i, 1], attacks.radius[main, i] + widest + MARGIN
            if (
                x + r < box[0, 0] or y + r < box[0, 1] or z + r < box[0, 2]
                or x - r > box[1, 0] or y - r > box[1, 1] or z - r > box[1, 2]
            ):  # fmt: skip
                continue
            more = cells_of(x, y, z, r - MARGIN, seen, stamp, found)
            for m in range(more):
                lower, upper = begin, end
                while lower < upper:
                    half = (lower + upper) // 2
                    if index.cell[half] < found[m]:
                        lower = half + 1
                    else:
                        upper = half
                if lower == end or index.cell[lower] != found[m]:
                    continue
                for e in range(index.entry_of[lower], index.entry_of[lower + 1]):
                    seen_path[index.entry[e]] = True
    count, room = 0, length.shape[0]
    for p in range(total):
        if not seen_path[p]:
            continue
        q = first + p
        if not low < ahead + index.middle[q] < high:
            continue
        if count < room:
            length[count], part[count] = index.length[q], index.part[q]
            for d in range(index.length[q]):
                path[count, d] = index.path[q, d]
        count += 1
    return count


@kernel
def spheres_that_leave(centre, begins, ends, left, out):
    """Which spheres [A, B] are at least ``left`` from where they were at some frame of a part."""
    for a in range(begins.shape[0]):
        for j in range(centre.shape[2]):
            out[a, j] = False
            for f in range(begins[a], ends[a] + 1):
                d2 = 0.0
                for c in range(3):
                    d2 += (centre[f, c, j] - centre[begins[a], c, j]) ** 2
                if d2 >= left * left:
                    out[a, j] = True
                    break


@kernel
def draw_masks(centre, radius, begins, ends, least, origin, bits):
    """Set the pixels [A, slices, rows] whose boxes are in reach of one sphere throughout a part.

    In reach: so near to it that an attack of radius ``least`` there overlaps it.
    """
    for a in range(begins.shape[0]):
        for j in range(radius.shape[0]):
            reach = radius[j] + least - MARGIN
            f = begins[a]
            x, y, z = centre[f, 0, j], centre[f, 1, j], centre[f, 2, j]
            for s in range(bits.shape[1]):
                bottom = origin[a, 1] + s * SLICE
                if y + reach < bottom or y - reach > bottom + SLICE:
                    continue
                k0 = max(int((z - reach - origin[a, 2]) / PIXEL), 0)
                k1 = min(int((z + reach - origin[a, 2]) / PIXEL) + 1, bits.shape[2])
                i0 = max(int((x - reach - origin[a, 0]) / PIXEL), 0)
                i1 = min(int((x + reach - origin[a, 0]) / PIXEL) + 1, PIXELS)
                for k in range(k0, k1):
                    for i in range(i0, i1):
                        middle_x = origin[a, 0] + (i + 0.5) * PIXEL
                        middle_z = origin[a, 2] + (k + 0.5) * PIXEL
                        inside = True
                        for g in range(begins[a], ends[a] + 1):
                            dx = abs(centre[g, 0, j] - middle_x) + 0.5 * PIXEL
                            dy = abs(centre[g, 1, j] - bottom - 0.5 * SLICE) + 0.5 * SLICE
                            dz = abs(centre[g, 2, j] - middle_z) + 0.5 * PIXEL
                            if dx * dx + dy * dy + dz * dz > reach * reach:
                                inside = False
                                break
                        if inside:
                            bits[a, s, k] |= np.uint64(1) << np.uint64(i)
