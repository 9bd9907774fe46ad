"""What a box on the stage looks like, what a car, and what the edge of an arena."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kumite.scene.stage import SceneObject

PAINT = (0.30, 0.34, 0.40)  # sRGB
GLASS = (0.12, 0.15, 0.19)
TYRE = (0.06, 0.06, 0.07)
CHALK = (0.80, 0.80, 0.76)
WOOD = (0.72, 0.53, 0.31)
WHEEL_SIDES = 16
LINE_WIDTH = 0.06  # m, of an arena's edge
LINE_SIDES = 96
LIFT = 0.008  # m of a line above the floor


@dataclass(frozen=True)
class Part:
    """Triangles of one colour. The thing's middle is the origin, its length lies along +Z."""

    name: str
    colour: tuple[float, float, float]  # sRGB, 0..1
    vertices: np.ndarray  # [V, 3] float32 m
    normals: np.ndarray  # [V, 3] float32
    faces: np.ndarray  # [P, 3] int32


def shown(thing: SceneObject) -> tuple[Part, ...]:
    """What a thing looks like; a ball is no parts."""
    if thing.line:
        return (line(thing.radius),)
    if thing.size is None:
        return ()
    return car(thing.size) if thing.wheels else (box(thing.size),)


def box(size: tuple[float, float, float]) -> Part:
    """A plain box of this width, height and length [m]: a bar, a post."""
    width, height, length = size
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    return _part("wood", WOOD, [_prism(corners * [height, length], -0.5 * width, 0.5 * width)])


def line(radius: float) -> Part:
    """A ring on the floor, of this radius [m] in its middle."""
    around = 2.0 * np.pi * np.arange(LINE_SIDES) / LINE_SIDES
    way = np.stack([np.sin(around), np.zeros(LINE_SIDES), np.cos(around)], axis=1)
    half = min(0.5 * LINE_WIDTH, 0.5 * radius)
    vertices = np.concatenate([(radius - half) * way, (radius + half) * way])
    vertices[:, 1] = LIFT
    i = np.arange(LINE_SIDES)
    j = (i + 1) % LINE_SIDES
    faces = np.concatenate(
        [
            np.stack([i, i + LINE_SIDES, j + LINE_SIDES], axis=1),
            np.stack([i, j + LINE_SIDES, j], axis=1),
        ]
    )
    return _part("line", CHALK, [(vertices, np.tile([0.0, 1.0, 0.0], (len(vertices), 1)), faces)])


def car(size: tuple[float, float, float]) -> tuple[Part, ...]:
    """A car that fills a box of this width, height and length [m]."""
    width, height, length = size
    sill, bonnet = -0.32 * height, 0.08 * height
    body = np.array([[sill, -0.5], [bonnet, -0.5], [bonnet, 0.47], [sill, 0.5]])
    cabin = np.array([[bonnet, -0.38], [0.5 * height, -0.30], [0.5 * height, 0.06], [bonnet, 0.22]])
    around = 2.0 * np.pi * np.arange(WHEEL_SIDES) / WHEEL_SIDES
    radius, tyre = 0.22 * height, 0.14 * width
    wheel = radius * np.stack([np.cos(around), np.sin(around)], axis=1)
    wheels = [
        _prism(wheel + np.array([radius - 0.5 * height, z * length]), x, x + tyre)
        for z in (-0.3, 0.3)
        for x in (-0.5 * width, 0.5 * width - tyre)
    ]
    along = np.array([1.0, length])
    return (
        _part("paint", PAINT, [_prism(body * along, -0.48 * width, 0.48 * width)]),
        _part("glass", GLASS, [_prism(cabin * along, -0.42 * width, 0.42 * width)]),
        _part("tyres", TYRE, wheels),
    )


def _prism(profile: np.ndarray, low: float, high: float) -> tuple[np.ndarray, ...]:
    """A convex profile [n, 2] of (y, z), turning from +Y to +Z, drawn along X from low to high.

    Vertices [V, 3], normals [V, 3], faces [P, 3]; each side is flat.
    """
    n = len(profile)
    fan = np.stack([np.zeros(n - 2, int), np.arange(1, n - 1), np.arange(2, n)], axis=1)
    ends = [np.column_stack([np.full(n, x), profile]) for x in (high, low)]
    vertices, faces = [*ends], [fan, fan[:, ::-1] + n]
    normals = [np.tile([x, 0.0, 0.0], (n, 1)) for x in (1.0, -1.0)]
    for i in range(n):
        j, first = (i + 1) % n, 2 * n + 4 * i
        y, z = profile[j] - profile[i]
        vertices.append(np.stack([ends[0][i], ends[0][j], ends[1][j], ends[1][i]]))
        normals.append(np.tile(np.array([0.0, z, -y]) / np.hypot(y, z), (4, 1)))
        faces.append(np.array([[0, 3, 2], [0, 2, 1]]) + first)
    return np.concatenate(vertices), np.concatenate(normals), np.concatenate(faces)


def _part(name: str, colour: tuple[float, float, float], meshes: list) -> Part:
    first = np.cumsum([0] + [len(vertices) for vertices, _, _ in meshes])
    return Part(
        name,
        colour,
        np.concatenate([m[0] for m in meshes]).astype(np.float32),
        np.concatenate([m[1] for m in meshes]).astype(np.float32),
        np.concatenate([m[2] + f for m, f in zip(meshes, first)]).astype(np.int32),
    )
