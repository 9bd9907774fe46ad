"""How high and how low a body is over each place along a way, as it goes along it."""

from __future__ import annotations

import numpy as np

from kumite.kernels.jit import kernel


@kernel
def sweep(start, end, radius_start, radius_end, way, origin, width, step, top, low, span, height):
    """Capsules start, end [F, B, 3] m with radii [B] m: of all frames together the highest and the
    lowest point over each place, top [P] and low [P] m; place p is origin + p · width … + width
    along the unit vector way (x, z). Of each frame how far back and ahead it reaches, span [F, 2]
    m, and its lowest and highest point, height [F, 2] m.

    Capsules are taken as spheres at most ``step`` apart. top begins at -inf, low at inf.
    """
    frames, parts = start.shape[:2]
    places = len(top)
    for f in range(frames):
        span[f, 0], span[f, 1] = np.inf, -np.inf
        height[f, 0], height[f, 1] = np.inf, -np.inf
        for b in range(parts):
            x, y, z = start[f, b, 0], start[f, b, 1], start[f, b, 2]
            dx, dy, dz = end[f, b, 0] - x, end[f, b, 1] - y, end[f, b, 2] - z
            pieces = int(np.ceil(np.sqrt(dx * dx + dy * dy + dz * dz) / step))
            for i in range(pieces + 1):
                u = i / max(pieces, 1)
                r = radius_start[b] + u * (radius_end[b] - radius_start[b])
                s = (x + u * dx) * way[0] + (z + u * dz) * way[1] - origin
                h = y + u * dy
                span[f, 0], span[f, 1] = min(span[f, 0], s - r), max(span[f, 1], s + r)
                height[f, 0], height[f, 1] = min(height[f, 0], h - r), max(height[f, 1], h + r)
                first = max(int(np.floor((s - r) / width)), 0)
                for p in range(first, min(int(np.floor((s + r) / width)), places - 1) + 1):
                    off = max(p * width - s, s - (p + 1) * width, 0.0)
                    rise = np.sqrt(max(r * r - off * off, 0.0))
                    top[p], low[p] = max(top[p], h + rise), min(low[p], h - rise)
        span[f, 0], span[f, 1] = span[f, 0] + origin, span[f, 1] + origin
