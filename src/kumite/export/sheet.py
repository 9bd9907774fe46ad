"""Contact sheets: a motion at a glance, as one PNG with a cell for every frame asked for.

A small software renderer: it needs no window and no graphics card, so it works in tests, in CI and
over SSH. One light, one shadow on the floor, one line of text a cell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from kumite import files
from kumite.body import BodyMesh, Palette, body_mesh, palettes, skin_vertices
from kumite.clip import Skeleton, facing_frame, forward_kinematics
from kumite.errors import KumiteError, unknown
from kumite.kernels.raster import draw_triangles
from kumite.rotation import from_yaw, rotate
from kumite.scene.look import shown
from kumite.scene.recording import Recording
from kumite.scene.stage import SceneObject, recorded_objects

# Where the eye stands: turned from the character's front [rad], raised above the floor [rad].
VIEWS = {
    "front": (0.0, 0.10),
    "three-quarter": (0.75, 0.20),
    "side": (0.5 * np.pi, 0.10),
    "top": (0.0, 1.45),
}
SAMPLES = 2  # pixels rendered a pixel shown, along each side
LENS = 4.2  # focal length over the cell's height: a long lens bends proportions little
FLOOR_GAP = 0.006  # m; the floor is drawn this much lower, so that soles on it stay in sight
MARGIN = 1.08
BACKGROUND = np.array([0.93, 0.94, 0.95])
FLOOR = np.array([0.84, 0.85, 0.86])
OBJECT_COLOUR = np.array([0.95, 0.75, 0.15])
GRID = 0.5  # m
HAZE_FROM, HAZE_DEPTH = 4.0, 10.0  # m behind the last figure, and how deep at least


@dataclass(frozen=True)
class Camera:
    """An eye that looks at a point."""

    eye: np.ndarray  # [3] m
    axes: np.ndarray  # [3, 3] rows: right, up, towards the eye
    distance: float  # m, from the eye to what it looks at
    focal: float  # pixels
    width: int  # pixels
    height: int  # pixels
    depth: float = 0.0  # m, how far behind that the scene goes on

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pixels [V, 2] and nearness 1/z [V] of points [V, 3]."""
        seen = (points - self.eye) @ self.axes.T
        away = -seen[:, 2]
        near = np.where(away > 0.05, 1.0 / np.maximum(away, 0.05), -1.0)
        x = 0.5 * self.width + self.focal * seen[:, 0] * near
        y = 0.5 * self.height - self.focal * seen[:, 1] * near
        return np.stack([x, y], axis=1), near

    @property
    def rays(self) -> np.ndarray:
        """Directions [H, W, 3] through the pixels, one metre towards the point looked at."""
        x = (np.arange(self.width) + 0.5 - 0.5 * self.width) / self.focal
        y = (0.5 * self.height - np.arange(self.height) - 0.5) / self.focal
        return x[None, :, None] * self.axes[0] + y[:, None, None] * self.axes[1] - self.axes[2]


def look(
    target: np.ndarray,
    yaw: float,
    pitch: float,
    span: float,
    size: tuple[int, int],
    depth: float = 0.0,
) -> Camera:
    """A camera that sees ``span`` metres from top to bottom at the target.

    ``yaw``: the side of the target it stands on (0: +Z), ``pitch``: how high, both in radians.
    ``depth``: how far [m] behind the target there is something to see: haze begins after that.
    """
    width, height = size
    back = np.array([np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)])
    right = np.array([np.cos(yaw), 0.0, -np.sin(yaw)])
    axes = np.stack([right, np.cross(back, right), back])
    distance = LENS * span
    eye = target + distance * back
    return Camera(eye, axes, distance, LENS * height, width, height, depth)


# Rendering ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Shape:
    """Triangles to draw, in the world."""

    vertices: np.ndarray  # [V, 3] m
    normals: np.ndarray  # [V, 3]
    faces: np.ndarray  # [P, 3] int32
    colours: np.ndarray  # [V, 3] sRGB, 0..1


def render(camera: Camera, shapes: Sequence[Shape]) -> np.ndarray:
    """An image [H, W, 3] uint8 of shapes on the floor, which is at height 0."""
    fine = Camera(
        camera.eye,
        camera.axes,
        camera.distance,
        camera.focal * SAMPLES,
        camera.width * SAMPLES,
        camera.height * SAMPLES,
        camera.depth,
    )
    # The key light stands over the camera's left shoulder, so that every view is lit alike.
    light = camera.axes.T @ np.array([-0.45, 0.55, 0.70])
    light[1] = max(light[1], 0.75)
    light /= np.linalg.norm(light)
    image, depth = _floor(fine, shapes, light)
    for shape in shapes:
        lit = _lit(shape, light, fine)
        xy, near = fine.project(shape.vertices)
        draw_triangles(xy, near, lit, shape.faces, depth, image)
    image = image.reshape(camera.height, SAMPLES, camera.width, SAMPLES, 3).mean(axis=(1, 3))
    return (np.clip(image, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)


def _lit(shape: Shape, light: np.ndarray, camera: Camera) -> np.ndarray:
    """Colours [V, 3] under a key light, a sky, and a thin rim that parts limbs from the trunk."""
    n = shape.normals
    key = np.clip(n @ light, 0.0, None)
    sky = 0.5 + 0.5 * n[:, 1]
    to_eye = camera.eye - shape.vertices
    to_eye /= np.linalg.norm(to_eye, axis=1, keepdims=True)
    facing = np.clip(np.sum(n * to_eye, axis=1), 0.0, 1.0)
    edge = 0.72 + 0.28 * np.sqrt(facing)
    return shape.colours * ((0.42 + 0.22 * sky + 0.52 * key) * edge)[:, None]


def _floor(
    camera: Camera, shapes: Sequence[Shape], light: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The empty floor with the shapes' shadows: image [H, W, 3] and nearness [H, W]."""
    rays = camera.rays
    down = rays[..., 1] < -1e-4
    way = np.where(down, -(camera.eye[1] + FLOOR_GAP) / np.where(down, rays[..., 1], -1.0), 1e6)
    at = camera.eye[[0, 2]] + way[..., None] * rays[..., [0, 2]]
    # Lines are one and a half pixels wide at any distance: their width grows with the footprint.
    pixel = way / camera.focal / np.maximum(np.abs(rays[..., 1]), 0.08)
    from_line = np.abs(at - GRID * np.round(at / GRID))
    on_line = np.clip(1.5 - from_line / np.maximum(pixel, 1e-9)[..., None], 0.0, 1.0).max(axis=-1)
    line = on_line * np.clip(0.12 * GRID / pixel, 0.0, 1.0)
    shade = np.zeros((camera.height, camera.width, 3))
    if shapes:
        _cast_shadows(camera, shapes, light, shade)
    colour = FLOOR * (1.0 - 0.14 * line - 0.30 * shade[..., 0])[..., None]
    # Haze is of the distance behind all that is shown, and as deep as that.
    behind = way - camera.distance - camera.depth - HAZE_FROM
    behind = np.clip(behind / (HAZE_DEPTH + camera.depth), 0.0, 1.0)
    haze = np.where(down, behind, 1.0)[..., None]
    image = colour * (1.0 - haze) + BACKGROUND * haze
    return np.ascontiguousarray(image), np.where(down, 1.0 / np.maximum(way, 1e-6), 0.0)


def _cast_shadows(
    camera: Camera, shapes: Sequence[Shape], light: np.ndarray, shade: np.ndarray
) -> None:
    """Flatten shapes onto the floor along the light and mark where they fall in ``shade``."""
    unseen = np.zeros(shade.shape[:2])
    for shape in shapes:
        height = np.maximum(shape.vertices[:, 1], 0.0)
        flat = shape.vertices - height[:, None] * (light / light[1])
        flat[:, 1] = -FLOOR_GAP
        xy, near = camera.project(flat)
        draw_triangles(xy, near, np.ones_like(flat), shape.faces, unseen, shade)


def body_shape(
    mesh: BodyMesh,
    skeleton: Skeleton,
    position: np.ndarray,
    world_wxyz: np.ndarray,
    colours: Palette,
) -> Shape:
    """A body in one pose: joint positions [J, 3], world rotations [J, 4]."""
    vertices, normals = skin_vertices(mesh, skeleton, position, world_wxyz)
    return Shape(vertices, normals, mesh.faces, mesh.colours(colours))


def ball(centre: np.ndarray, radius: float, colour: np.ndarray = OBJECT_COLOUR) -> Shape:
    """A sphere."""
    rings, segments = 12, 20
    polar = np.pi * (np.arange(rings) + 0.5) / rings
    around = 2 * np.pi * np.arange(segments) / segments
    n = np.stack(
        [
            np.outer(np.sin(polar), np.cos(around)),
            np.outer(np.cos(polar), np.ones(segments)),
            np.outer(np.sin(polar), np.sin(around)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    r, s = np.meshgrid(np.arange(rings - 1), np.arange(segments), indexing="ij")
    a = (r * segments + s).ravel()
    b = (r * segments + (s + 1) % segments).ravel()
    faces = np.concatenate(
        [
            np.stack([a, b, a + segments], axis=1),
            np.stack([b, b + segments, a + segments], axis=1),
        ]
    ).astype(np.int32)
    return Shape(centre + radius * n, n, faces, np.broadcast_to(colour, n.shape).copy())


def object_shapes(thing: SceneObject, centre: np.ndarray) -> list[Shape]:
    """A ball, a box, a car or a line, with its middle at a place [3] m."""
    parts = shown(thing)
    if not parts:
        return [ball(centre, thing.radius)]
    turn = from_yaw(thing.yaw)
    return [
        Shape(
            centre + rotate(turn, part.vertices),
            rotate(turn, part.normals),
            part.faces,
            np.tile(part.colour, (len(part.vertices), 1)),
        )
        for part in parts
    ]


# Sheets ------------------------------------------------------------------------------------------


def contact_sheet(
    path: Path | str,
    skeleton: Skeleton,
    root_position: np.ndarray,
    wxyz: np.ndarray,
    frames: Sequence[int],
    *,
    columns: int = 6,
    view: str = "three-quarter",
    colours: Sequence[Palette] | None = None,
    size: tuple[int, int] = (240, 320),
    labels: Sequence[str] | None = None,
    follow: bool = True,
    object_position: np.ndarray | None = None,
    objects: Sequence[SceneObject] = (),
    unarmed: Sequence[int] = (),
) -> None:
    """Draw frames of K characters, roots [F, K, 3] and rotations [F, K, J, 4], to a PNG.

    ``view``: 'front', 'three-quarter', 'side' or 'top', as the first character faces in the first
    frame shown; with several characters, as it looks at the second. ``follow`` keeps the characters
    in the middle of each cell; otherwise one camera sees all. ``size``: pixels (w, h) of a cell.
    ``unarmed``: characters whose sword, if the skeleton has one, is not seen.
    ``objects`` [O] are drawn where ``object_position`` [F, O, 3] (m) says.

    Errors: shapes that do not fit; no frames; frames out of range; an unknown view.
    """
    root_position = np.asarray(root_position, dtype=np.float64)
    wxyz = np.asarray(wxyz, dtype=np.float64)
    if wxyz.ndim != 4 or wxyz.shape != (*root_position.shape[:2], len(skeleton), 4):
        raise KumiteError(
            f"sheet: root_position {root_position.shape} and wxyz {wxyz.shape}; "
            f"expected [F, K, 3] and [F, K, {len(skeleton)}, 4]"
        )
    if view not in VIEWS:
        raise unknown("view", view, VIEWS)
    count = len(root_position)
    shown = np.asarray(frames, dtype=np.int64)
    if shown.ndim != 1 or len(shown) == 0 or shown.min() < 0 or shown.max() >= count:
        raise KumiteError(f"sheet: frames {list(frames)}, expected some of 0 … {count - 1}")
    if columns < 1 or min(size) < 16:
        raise KumiteError(f"sheet: {columns} columns of {size} pixels")
    names = [f"{f}" for f in shown] if labels is None else list(labels)
    if len(names) != len(shown):
        raise KumiteError(f"sheet: {len(names)} labels for {len(shown)} frames")
    characters = root_position.shape[1]
    numbers = [str(k + 1) for k in range(characters)]
    looks = palettes(numbers) if colours is None else list(colours)
    if len(looks) < characters:
        raise KumiteError(f"sheet: colours for {len(looks)} of {characters} characters")
    things = np.zeros((count, 0, 3)) if object_position is None else np.asarray(object_position)
    if things.shape != (count, len(objects), 3):
        raise KumiteError(
            f"sheet: object_position {things.shape}; expected [{count}, {len(objects)}, 3]"
        )

    meshes = {armed: body_mesh(skeleton, armed=armed) for armed in {True, not unarmed}}
    cells = []
    cameras = _cameras(skeleton, root_position[shown], wxyz[shown], view, size, follow)
    for frame, name, camera in zip(shown, names, cameras):
        position, world = forward_kinematics(skeleton, root_position[frame], wxyz[frame])
        shapes = [
            body_shape(meshes[k not in unarmed], skeleton, position[k], world[k], looks[k])
            for k in range(characters)
        ]
        for thing, centre in zip(objects, things[frame]):
            shapes += object_shapes(thing, centre)
        cells.append(_labelled(render(camera, shapes), name))
    _save(path, cells, min(columns, len(cells)))


def recording_sheet(
    path: Path | str,
    recording: Recording,
    frames: Sequence[int] | None = None,
    *,
    columns: int = 6,
    view: str = "side",
    colours: Sequence[Palette] | None = None,
    size: tuple[int, int] = (320, 240),
    follow: bool = True,
) -> None:
    """Draw frames of a recording (twelve at even distances unless given), labelled in seconds."""
    evenly = np.unique(np.linspace(0, len(recording) - 1, 12).round().astype(int))
    chosen = evenly.tolist() if frames is None else list(frames)
    unarmed = recording.settings.get("unarmed", ())
    contact_sheet(
        path,
        recording.skeleton,
        recording.root_position,
        recording.wxyz,
        chosen,
        columns=columns,
        view=view,
        colours=palettes(recording.names) if colours is None else colours,
        size=size,
        labels=[f"{f / recording.fps:.2f} s" for f in chosen],
        follow=follow,
        object_position=recording.object_position,
        objects=recorded_objects(recording),
        unarmed=[k for k, n in enumerate(recording.names) if n in unarmed],
    )


def _cameras(
    skeleton: Skeleton,
    root: np.ndarray,
    wxyz: np.ndarray,
    view: str,
    size: tuple[int, int],
    follow: bool,
) -> list[Camera]:
    """One camera a cell, all of one scale, for roots [S, K, 3] and rotations [S, K, J, 4]."""
    turned, pitch = VIEWS[view]
    yaw = turned + _front(skeleton, root[0], wxyz[0])
    samples, characters = root.shape[:2]
    flat, _ = forward_kinematics(
        skeleton, root.reshape(-1, 3), wxyz.reshape(samples * characters, -1, 4)
    )
    joints = flat.reshape(samples, -1, 3)  # all characters' joints of a cell
    low, high = joints.min(axis=1), joints.max(axis=1)
    low[:, 1] = np.minimum(low[:, 1], 0.0)
    if not follow:
        low[:], high[:] = low.min(axis=0), high.max(axis=0)
    target = 0.5 * (low + high)
    # A steady height: a crouch should look lower, not move the floor.
    target[:, 1] = 0.5 * (float(low[:, 1].min()) + float(high[:, 1].max()))
    probe = look(np.zeros(3), yaw, pitch, 1.0, size)
    seen = np.abs((joints - target[:, None]) @ probe.axes.T).max(axis=(0, 1))
    flesh = 0.16  # m around the joints
    span = 2 * max(seen[1] + flesh, (seen[0] + flesh) * size[1] / size[0]) * MARGIN
    depth = float(((target[:, None] - joints) @ probe.axes[2]).max())
    return [look(t, yaw, pitch, float(span), size, max(depth, 0.0)) for t in target]


def _front(skeleton: Skeleton, root: np.ndarray, wxyz: np.ndarray) -> float:
    """The yaw [rad] that 'front' is seen from, for roots [K, 3] and rotations [K, J, 4]."""
    facing = facing_frame(skeleton, root, wxyz)
    if len(facing) > 1:
        apart = facing[1, :2] - facing[0, :2]
        if np.hypot(*apart) > 0.1:
            return float(np.arctan2(apart[0], apart[1]))
    return float(facing[0, 2])


def _labelled(image: np.ndarray, text: str) -> np.ndarray:
    picture = Image.fromarray(image)
    if text:
        font = ImageFont.load_default(size=max(11, image.shape[0] // 20))
        ImageDraw.Draw(picture).text((6, 4), text, fill=(60, 64, 70), font=font)
    return np.asarray(picture)


def sheet_of(cells: Sequence[np.ndarray], columns: int) -> np.ndarray:
    """Cells [H, W, 3] side by side with a thin gap."""
    high, wide = cells[0].shape[:2]
    rows = -(-len(cells) // columns)
    gap = 2
    sheet = np.full((rows * (high + gap) - gap, columns * (wide + gap) - gap, 3), 255, np.uint8)
    for i, cell in enumerate(cells):
        y, x = (i // columns) * (high + gap), (i % columns) * (wide + gap)
        sheet[y : y + high, x : x + wide] = cell
    return sheet


def _save(path: Path | str, cells: Sequence[np.ndarray], columns: int) -> None:
    """A sheet, written whole or not at all."""
    with files.writing(path) as temporary:
        Image.fromarray(sheet_of(cells, columns)).save(temporary, format="PNG")
