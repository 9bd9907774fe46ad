"""Contact sheets of moments: a cell for every hit, near, from the side, with the hit marked."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from kumite.body import Palette, body_mesh, palettes
from kumite.clip import facing_frame, forward_kinematics
from kumite.export.moments import EVENLY, Moment, moments, shown_at
from kumite.export.sheet import (
    Camera,
    body_shape,
    look,
    object_shapes,
    recording_sheet,
    render,
    sheet_of,
)
from kumite.files import writing
from kumite.scene.recording import Recording
from kumite.scene.stage import in_sight, recorded_objects

SIZE = (360, 330)  # pixels of a cell, width and height
COLUMNS = 4
FLESH = 0.16  # m around the joints
PITCH = 0.12  # rad that the camera looks down
BESIDE = 1.5  # m from those shown, within which what flies is kept in the picture, too
LEAST = 1.7  # m that a picture shows from top to bottom: who crawls is not seen nearer
NEAR = 12.0  # m from the middle of a picture beyond which nobody is drawn
WIDER = 1.6  # times the usual height of a picture that a single one may show
SAMPLES = 3  # pixels drawn a pixel shown, of marks
LANDED, STOPPED = (255, 214, 40), (150, 190, 235)  # colours of marks: a hit, and one blocked
DARK = (40, 42, 48)


def moment_sheet(
    path: Path | str,
    recording: Recording,
    at: str | None = None,
    *,
    most: int = 12,
    columns: int = COLUMNS,
    size: tuple[int, int] = SIZE,
) -> None:
    """Draw the moments of a recording that ``at`` asks for (:func:`moments`) to a PNG.

    Errors: no event of that kind.
    """
    found = moments(recording, at, most)
    if at == EVENLY or not any(m.text for m in found):
        recording_sheet(path, recording, [m.frame for m in found])
        return
    image = moment_image(recording, found, columns=columns, size=size)
    with writing(path) as temporary:
        Image.fromarray(image).save(temporary, format="PNG")


def moment_image(
    recording: Recording,
    found: Sequence[Moment],
    *,
    columns: int = COLUMNS,
    size: tuple[int, int] = SIZE,
    timed: bool = True,
) -> np.ndarray:
    """A picture [H, W, 3] uint8 with a cell for each moment. timed: write when it was."""
    outfits = palettes(recording.names)
    poses = [_pose(recording, m.frame) for m in found]
    views = [_view(recording, m, pose[0]) for m, pose in zip(found, poses)]
    # One scale for all but those that need more: figures can be compared from cell to cell.
    heights = [_height(points, yaw, size) for points, yaw in views]
    usual = float(np.median(heights))
    cells = []
    for moment, pose, (points, yaw), height in zip(found, poses, views, heights):
        camera = _camera(points, yaw, min(max(height, usual), WIDER * usual), size)
        picture = Image.fromarray(_draw(recording, moment, pose, camera, outfits))
        _mark(picture, moment, camera, outfits)
        if timed:
            _write(picture, f"{moment.frame / recording.fps:.2f} s  {moment.text}")
        cells.append(np.asarray(picture))
    return sheet_of(cells, min(columns, len(cells)))


def _pose(recording: Recording, frame: int) -> tuple[np.ndarray, np.ndarray]:
    """Everybody's joints [K, J, 3] and their rotations [K, J, 4]."""
    root = recording.root_position[frame].astype(np.float64)
    wxyz = recording.wxyz[frame].astype(np.float64)
    return forward_kinematics(recording.skeleton, root, wxyz)


def _view(recording: Recording, moment: Moment, joints: np.ndarray) -> tuple[np.ndarray, float]:
    """What is to be in the picture [n, 3], and the side [rad] it is seen from.

    Two people are seen from the side, whoever comes first among the characters on the left; one
    from the side of what comes at it, or three quarters from the front.
    """
    who = sorted(shown_at(moment, recording.names))
    points = joints[who].reshape(-1, 3)
    flown = moment.trail[:: max(1, len(moment.trail) // 4)]
    if len(flown):
        away = np.linalg.norm(points[:, None] - flown, axis=2).min(axis=0)
        points = np.concatenate([points, flown[away < BESIDE]])
    if len(who) > 1:
        way = joints[who[1], 0] - joints[who[0], 0]
    elif len(moment.trail) > 1:
        way = moment.trail[0] - moment.trail[-1]
        front = facing_frame(
            recording.skeleton,
            recording.root_position[moment.frame, who].astype(np.float64),
            recording.wxyz[moment.frame, who].astype(np.float64),
        )[0, 2]
        beside = float(np.arctan2(way[0], way[2])) - 0.5 * np.pi
        # From whichever side its face is seen.
        return points, beside if np.cos(beside - front) >= 0 else beside + np.pi
    else:
        root = recording.root_position[moment.frame, who].astype(np.float64)
        wxyz = recording.wxyz[moment.frame, who].astype(np.float64)
        return points, float(facing_frame(recording.skeleton, root, wxyz)[0, 2]) + 0.25 * np.pi
    return points, float(np.arctan2(way[0], way[2])) - 0.5 * np.pi


def _height(points: np.ndarray, yaw: float, size: tuple[int, int]) -> float:
    """How many metres a picture must show from top to bottom."""
    seen = points @ look(np.zeros(3), yaw, PITCH, 1.0, size).axes.T
    wide, high = np.ptp(seen[:, 0]) + 2 * FLESH, np.ptp(seen[:, 1]) + 2 * FLESH
    return float(1.12 * max(high, wide * size[1] / size[0], LEAST))


def _camera(points: np.ndarray, yaw: float, height: float, size: tuple[int, int]) -> Camera:
    low, high = points.min(axis=0), points.max(axis=0)
    target = 0.5 * (low + high)
    # Feet stand at the same height in every cell, with room for the words above.
    target[1] = 0.5 * height - FLESH - 0.03 * height
    target[1] = max(target[1], high[1] + 2 * FLESH - 0.5 * height)
    return look(target, yaw, PITCH, height, size, 3.0)


def _draw(
    recording: Recording,
    moment: Moment,
    pose: tuple[np.ndarray, np.ndarray],
    camera: Camera,
    outfits: Sequence[Palette],
) -> np.ndarray:
    position, world = pose
    middle = camera.eye - camera.distance * camera.axes[2]
    unarmed = recording.settings.get("unarmed", ())
    shapes = []
    for k, name in enumerate(recording.names):
        if np.hypot(*(position[k, 0] - middle)[[0, 2]]) < NEAR:
            mesh = body_mesh(recording.skeleton, armed=name not in unarmed)
            shapes.append(body_shape(mesh, recording.skeleton, position[k], world[k], outfits[k]))
    places = recording.object_position[moment.frame].astype(np.float64)
    for o, (thing, centre) in enumerate(zip(recorded_objects(recording), places)):
        before = float((camera.eye - centre) @ camera.axes[2]) < camera.distance
        in_the_way = before and thing.size is not None and o != moment.thing
        if in_sight(centre) and not in_the_way:
            shapes += object_shapes(thing, centre)
    return render(camera, shapes)


def _mark(picture: Image.Image, moment: Moment, camera: Camera, outfits: Sequence[Palette]) -> None:
    """The way of what strikes, and where it lands."""
    fine = Image.new("RGBA", (picture.width * SAMPLES, picture.height * SAMPLES))
    draw, pixel = ImageDraw.Draw(fine), fine.height / 330
    if len(moment.trail) > 1:
        way = (SAMPLES * camera.project(moment.trail)[0]).tolist()
        landed = moment.mark is not None and moment.who
        colour = outfits[moment.who[0]]["gloves"] if landed else DARK
        for n, (a, b) in enumerate(zip(way, way[1:])):
            share = (n + 1) / len(way)
            fill, width = (*colour, round(220 * share)), round(pixel * (1 + 3 * share))
            draw.line([tuple(a), tuple(b)], fill=fill, width=width)
    if moment.mark is not None:
        x, y = (SAMPLES * camera.project(moment.mark[None])[0][0]).tolist()
        colour = STOPPED if moment.blocked else LANDED
        for fill, width in ((DARK, 4.5), (colour, 2.5)):  # a dark rim: it is seen on any ground
            for n in range(8):
                way = np.array([np.cos(n * np.pi / 4), np.sin(n * np.pi / 4)])
                inner, outer = 11.0 * pixel * way, (21.0 if n % 2 == 0 else 17.0) * pixel * way
                ends = [(x + inner[0], y + inner[1]), (x + outer[0], y + outer[1])]
                draw.line(ends, fill=fill, width=round(width * pixel))
    overlay = fine.resize(picture.size, Image.Resampling.LANCZOS)
    picture.paste(overlay, mask=overlay)


def _write(picture: Image.Image, text: str) -> None:
    """A line of words, as large as they find room."""
    draw = ImageDraw.Draw(picture)
    for size in range(max(11, picture.height // 19), 8, -1):
        font = ImageFont.load_default(size=size)
        if draw.textlength(text, font=font) < picture.width - 12:
            break
    else:
        text = text.partition("  ")[0]  # in a small cell: when, not what
    draw.text((6, 5), text, fill=(50, 54, 60), font=font)
