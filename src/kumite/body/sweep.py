"""Surfaces swept along an axis: rings of rounded cross-sections, closed at both ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

AT, LEFT_RIGHT, FRONT, BACK, AHEAD = range(5)
"""Columns of a profile: place on the axis [m], half widths to the sides, to the front and to the
back [m], and how far the ring's centre lies ahead of the axis [m]."""


@dataclass(frozen=True)
class Surface:
    """A closed piece of skin in the standing pose, of one role."""

    role: str
    vertices: np.ndarray  # [V, 3] m
    faces: np.ndarray  # [P, 3] int32, counter-clockwise from outside
    weights: np.ndarray  # [V, J], rows sum to 1


def profile(rows: Sequence[Sequence[float]] | np.ndarray, rings: int) -> np.ndarray:
    """Rings [R, 5] through a table of key rings, without overshoot, denser where they are denser.

    ``rows`` are (at, sides, front, back[, ahead]); a missing last column is 0.
    """
    keys = np.array([(*r, 0.0) if len(r) == 4 else r for r in rows], dtype=np.float64)
    # The parameter is the distance run along the outline, so that round ends get their rings.
    step = np.linalg.norm(np.diff(keys[:, :4], axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(step)])
    return np.asarray(PchipInterpolator(along, keys)(np.linspace(0.0, along[-1], rings)))


def ring_points(
    rings: np.ndarray, segments: int, exponent: float = 2.0, start_angle: float = 0.0
) -> np.ndarray:
    """Points [R, S, 2] (to the side, ahead) of superellipses around the axis."""
    angle = start_angle + 2 * np.pi * np.arange(segments) / segments
    c, s = np.cos(angle), np.sin(angle)
    power = 2.0 / exponent
    x = np.sign(c) * np.abs(c) ** power
    z = np.sign(s) * np.abs(s) ** power
    side = rings[:, LEFT_RIGHT, None] * x
    depth = np.where(z > 0, rings[:, FRONT, None], rings[:, BACK, None]) * z
    return np.stack([side, depth + rings[:, AHEAD, None]], axis=-1)


def place(
    rings: np.ndarray,
    points: np.ndarray,
    origin: np.ndarray,
    axis: np.ndarray,
    side: np.ndarray,
    ahead: np.ndarray,
) -> np.ndarray:
    """Ring points [R, S, 3] in the world: one straight axis from ``origin``."""
    return (
        origin + rings[:, AT, None, None] * axis + points[..., :1] * side + points[..., 1:] * ahead
    )


def place_along(
    rings: np.ndarray, points: np.ndarray, path: np.ndarray, side: np.ndarray, ahead: np.ndarray
) -> np.ndarray:
    """Ring points [R, S, 3] along a path [N, 3] of straight bones; ``at`` is the way along it."""
    reach = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    at = rings[:, AT]
    bone = np.clip(np.searchsorted(reach, at, side="right") - 1, 0, len(path) - 2)
    length = np.diff(reach)[bone]
    fraction = ((at - reach[bone]) / length)[:, None]
    centre = path[bone] * (1 - fraction) + path[bone + 1] * fraction
    return centre[:, None] + points[..., :1] * side + points[..., 1:] * ahead


def closed_tube(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices [V, 3] and faces [P, 3] of rings [R, S, 3], with a pole at either end.

    Rings run along the axis; ring angles turn from ``side`` to ``ahead``. Faces look outwards
    when side, ahead and axis are a left-handed triple; :func:`outwards` settles it for any.
    """
    rings, segments = points.shape[:2]
    poles = np.stack([points[0].mean(axis=0), points[-1].mean(axis=0)])
    vertices = np.concatenate([points.reshape(-1, 3), poles])
    r, s = np.meshgrid(np.arange(rings - 1), np.arange(segments), indexing="ij")
    a = (r * segments + s).ravel()
    b = (r * segments + (s + 1) % segments).ravel()
    c, d = a + segments, b + segments
    first, last = len(vertices) - 2, len(vertices) - 1
    s = np.arange(segments)
    n = (s + 1) % segments
    top = (rings - 1) * segments
    faces = np.concatenate(
        [
            np.stack([a, c, b], axis=1),
            np.stack([b, c, d], axis=1),
            np.stack([np.full(segments, first), s, n], axis=1),
            np.stack([np.full(segments, last), top + n, top + s], axis=1),
        ]
    )
    return vertices, outwards(vertices, faces.astype(np.int32))


def outwards(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """The faces [P, 3] of a closed surface, turned over if they enclose a negative volume."""
    a, b, c = (vertices[faces[:, i]] - vertices.mean(axis=0) for i in range(3))
    volume = float(np.sum(a * np.cross(b, c)))
    return faces if volume > 0 else np.ascontiguousarray(faces[:, ::-1])


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Unit normals [V, 3]: the faces' around each vertex, weighted by area."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    face = np.cross(b - a, c - a)
    out = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(out, faces[:, corner], face)
    length = np.linalg.norm(out, axis=1, keepdims=True)
    return np.where(length > 1e-14, out / np.maximum(length, 1e-14), [0.0, 1.0, 0.0])


def smoothstep(low: float, high: float, x: np.ndarray) -> np.ndarray:
    """0 below ``low``, 1 above ``high``, smooth between."""
    t = np.clip((np.asarray(x) - low) / (high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)
