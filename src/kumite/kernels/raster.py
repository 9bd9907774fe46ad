"""Triangles into pixels with a depth buffer. Shapes: V vertices, P triangles, H × W pixels."""

from __future__ import annotations

import numpy as np

from kumite.kernels.jit import kernel


@kernel
def edge(ax, ay, bx, by, px, py):
    """Twice the signed area of the triangle a b p."""
    return (bx - ax) * (py - ay) - (by - ay) * (px - ax)


@kernel
def draw_triangles(xy, near, colour, faces, depth, image):
    """Draw faces [P, 3] of pixels xy [V, 2], nearness 1/z [V] and colours [V, 3].

    ``depth`` [H, W] holds the nearness drawn so far and ``image`` [H, W, 3] its colours. Triangles
    with a corner behind the eye (nearness ≤ 0) are left out. Both sides are drawn.
    """
    high, wide = depth.shape
    for p in range(faces.shape[0]):
        a, b, c = faces[p, 0], faces[p, 1], faces[p, 2]
        if near[a] <= 0.0 or near[b] <= 0.0 or near[c] <= 0.0:
            continue
        ax, ay, bx, by, cx, cy = xy[a, 0], xy[a, 1], xy[b, 0], xy[b, 1], xy[c, 0], xy[c, 1]
        area = edge(ax, ay, bx, by, cx, cy)
        if area == 0.0:
            continue
        left = max(0, int(np.floor(min(ax, bx, cx))))
        right = min(wide - 1, int(np.ceil(max(ax, bx, cx))))
        top = max(0, int(np.floor(min(ay, by, cy))))
        bottom = min(high - 1, int(np.ceil(max(ay, by, cy))))
        for y in range(top, bottom + 1):
            for x in range(left, right + 1):
                px, py = x + 0.5, y + 0.5
                u = edge(bx, by, cx, cy, px, py) / area
                v = edge(cx, cy, ax, ay, px, py) / area
                w = 1.0 - u - v
                if u < 0.0 or v < 0.0 or w < 0.0:
                    continue
                n = u * near[a] + v * near[b] + w * near[c]
                if n <= depth[y, x]:
                    continue
                depth[y, x] = n
                for k in range(3):
                    image[y, x, k] = u * colour[a, k] + v * colour[b, k] + w * colour[c, k]
