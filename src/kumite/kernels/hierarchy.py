"""How cores of a hierarchical graph hang together: the nearest pose of a cycle, the best link.

Shapes: F frames, P poses of a cycle, Jw joints that count, D Euclidean features, D a pose last.
"""

from __future__ import annotations

import numpy as np

from kumite.kernels.jit import kernel


@kernel
def nearest_poses(quaternion, weight, feature, cycle, near, which):
    """Of each frame [F] the least distance to the frames of a cycle [P] and which it is, into near
    [F] (squared) and which [F].

    quaternion [F, Jw, 4], weight [Jw], feature [F, D]. A pose that is already farther than the best
    is given up half way; frames follow each other, so the search begins where the last one ended.
    """
    best = 0
    for f in range(quaternion.shape[0]):
        least = np.inf
        begin = best
        for i in range(cycle.shape[0]):
            p = (begin + i) % cycle.shape[0]
            g = cycle[p]
            total = 0.0
            for d in range(feature.shape[1]):
                total += (feature[f, d] - feature[g, d]) ** 2
                if total >= least:
                    break
            for j in range(weight.shape[0]):
                if total >= least:
                    break
                dot = 0.0
                for c in range(4):
                    dot += quaternion[f, j, c] * quaternion[g, j, c]
                total += weight[j] * (2.0 * np.arccos(min(abs(dot), 1.0))) ** 2
            if total < least:
                least, best = total, p
        near[f], which[f] = least, cycle[best]


@kernel
def best_link(from_, to, clip_of_frame, longest, price):
    """First and last frame of the part of a clip of at most ``longest`` frames that leads best from
    one core to another: the worse of from_[first] and to[last], and ``price`` a frame, is least.
    """
    least, first, last = np.inf, 0, 0
    for a in range(from_.shape[0]):
        if from_[a] >= least:
            continue
        for b in range(a, min(a + longest + 1, from_.shape[0])):
            if clip_of_frame[b] != clip_of_frame[a]:
                break
            cost = max(from_[a], to[b]) + price * (b - a)
            if cost < least:
                least, first, last = cost, a, b
    return first, last
