"""Who stands in balance: the support area's convex hull, and how far a point is from it.

Shapes: F frames, P corners a frame.
"""

from __future__ import annotations

import numpy as np

from kumite.kernels.jit import kernel

NO_SUPPORT = np.inf  # the distance to an area that is not there


@kernel
def convex_hull(points, hull):
    """The corners of the convex hull of points [P, 2], in order; returns how many there are.

    Monotone chain (Andrew 1979), into hull [2 P, 2]. Points are sorted in place; of points on a
    line the two ends are left.
    """
    count = points.shape[0]
    for i in range(1, count):  # insertion sort: there are a dozen
        x, y = points[i, 0], points[i, 1]
        k = i
        while k > 0 and (points[k - 1, 0] > x or (points[k - 1, 0] == x and points[k - 1, 1] > y)):
            points[k, 0], points[k, 1] = points[k - 1, 0], points[k - 1, 1]
            k -= 1
        points[k, 0], points[k, 1] = x, y
    size = 0
    for way in range(2):
        low = size + 1
        for step in range(count):
            i = step if way == 0 else count - 1 - step
            while size > low and (hull[size - 1, 0] - hull[size - 2, 0]) * (
                points[i, 1] - hull[size - 2, 1]
            ) <= (hull[size - 1, 1] - hull[size - 2, 1]) * (points[i, 0] - hull[size - 2, 0]):
                size -= 1
            hull[size, 0], hull[size, 1] = points[i, 0], points[i, 1]
            size += 1
        size -= 1  # the last point is the first of the way back
    return max(size, 1)


@kernel
def distance_to_hull(hull, size, x, y):
    """Signed distance of a point to a convex area with corners in order: negative inside.

    An area of one corner or two is a point or a line: nothing is inside.
    """
    nearest, inside = np.inf, size > 2
    for i in range(size):
        ax, ay = hull[i, 0], hull[i, 1]
        bx, by = hull[(i + 1) % size, 0] - ax, hull[(i + 1) % size, 1] - ay
        px, py = x - ax, y - ay
        length = bx * bx + by * by
        t = min(max((px * bx + py * by) / length, 0.0), 1.0) if length > 0.0 else 0.0
        nearest = min(nearest, (px - t * bx) ** 2 + (py - t * by) ** 2)
        if bx * py - by * px < 0.0:
            inside = False
    return -np.sqrt(nearest) if inside else np.sqrt(nearest)


@kernel
def support_distances(corner, counts, point, out):
    """Signed distances [F] of ground points [F, 2] to the hulls of the corners [F, P, 2] that
    count [F, P]; NO_SUPPORT where none does."""
    most = corner.shape[1]
    used, hull = np.empty((most, 2)), np.empty((2 * most + 2, 2))
    for f in range(corner.shape[0]):
        n = 0
        for p in range(most):
            if counts[f, p]:
                used[n, 0], used[n, 1] = corner[f, p, 0], corner[f, p, 1]
                n += 1
        if n == 0:
            out[f] = NO_SUPPORT
            continue
        size = convex_hull(used[:n], hull)
        out[f] = distance_to_hull(hull, size, point[f, 0], point[f, 1])
