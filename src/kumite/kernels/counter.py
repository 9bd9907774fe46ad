"""Where blows at the ends of paths land: how near their fists come to what they are meant for."""

from __future__ import annotations

import numpy as np

from kumite.kernels.avoid import lay
from kumite.kernels.jit import kernel


@kernel
def aim_all(
    count, path, length, part, begins, ends, limb_tip, now, graph, goal, radius, scratch, gap, when
):
    """How near [C] the fist of each path's blow comes to a goal's skin [m], and frames [C] from now
    until then.

    begins, ends [X]: library frames of blows; limb_tip [F', 3] m: their fists in the library's
    world, blow after blow; goal [T, M, 3] m: places at frames 0.. from now, the last row from then
    on; radius [M] m, of goals and fist.
    """
    offset = np.zeros(begins.shape[0] + 1, dtype=np.int64)
    for x in range(begins.shape[0]):
        offset[x + 1] = offset[x] + ends[x] - begins[x]
    for c in range(count):
        x, last = part[c], length[c]
        lay(path[c], last, now, graph, scratch)
        here = scratch.anchor[last]
        s = path[c, last - 1]
        # The frame before the last edge's first is shown when the edge before it ends.
        passed = scratch.upto[last - 1] - (graph.first[s] - 1)
        gap[c], when[c] = np.inf, np.inf
        for f in range(max(begins[x], graph.first[s]), min(ends[x], graph.last[s] + 1)):
            tip = limb_tip[offset[x] + f - begins[x]]
            px = here[2] * tip[0] + here[3] * tip[2] + here[0]
            pz = here[2] * tip[2] - here[3] * tip[0] + here[1]
            t = passed + f
            row = min(max(int(t + 0.5), 0), goal.shape[0] - 1)
            for m in range(goal.shape[1]):
                dx, dy, dz = px - goal[row, m, 0], tip[1] - goal[row, m, 1], pz - goal[row, m, 2]
                d = np.sqrt(dx * dx + dy * dy + dz * dz) - radius[m]
                if d < gap[c]:
                    gap[c], when[c] = d, t
