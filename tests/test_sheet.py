"""Contact sheets and plots: pictures that show what they should."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from PIL import Image

from kumite.body import body_mesh, palettes
from kumite.clip import forward_kinematics
from kumite.errors import KumiteError
from kumite.export.moment_sheet import LANDED, STOPPED, moment_image, moment_sheet
from kumite.export.moments import moments
from kumite.export.plot import plot_hits
from kumite.export.sheet import (
    BACKGROUND,
    FLOOR,
    _cameras,
    body_shape,
    contact_sheet,
    look,
    recording_sheet,
    render,
)
from kumite.graph import Layer
from kumite.kernels.raster import draw_triangles
from kumite.scene import Recording, World, load_scene, record
from kumite.scene.events import Hit
from tests import toys
from tests.telling import event


def _still(count: int = 1):
    clips = [toys.still(4) for _ in range(count)]
    root = np.stack([c.root_position for c in clips], axis=1).copy()
    root[:, :, 0] += np.arange(count)
    return clips[0].skeleton, root, np.stack([c.wxyz for c in clips], axis=1)


def test_a_sheet_has_a_cell_for_every_frame(tmp_path):
    skeleton, root, wxyz = _still(2)
    contact_sheet(tmp_path / "a.png", skeleton, root, wxyz, [0, 1, 2], columns=2, size=(160, 120))
    image = np.asarray(Image.open(tmp_path / "a.png").convert("RGB")).astype(int)
    assert abs(image.shape[1] - 320) < 20 and abs(image.shape[0] - 240) < 20
    red = (image[..., 0] - image[..., 2] > 60).sum()
    blue = (image[..., 2] - image[..., 0] > 60).sum()
    assert red > 200 and blue > 200  # both corners are in the picture
    contact_sheet(tmp_path / "b.png", skeleton, root, wxyz, [0, 1, 2], columns=2, size=(160, 120))
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_a_recording_is_drawn(library: Layer, tmp_path):
    scene = World(load_scene("target"), library)
    recording_sheet(tmp_path / "r.png", record(scene, 1.0), size=(120, 100))
    assert Image.open(tmp_path / "r.png").size[0] > 300


def test_feet_stand_on_the_floor_and_the_figure_fills_the_cell():
    """A figure of known height seen from the front covers the pixels the camera says it must."""
    skeleton, root, wxyz = _still()
    position, world = forward_kinematics(skeleton, root[0], wxyz[0])
    camera = look(np.array([0.0, 1.0, 0.0]), 0.0, 0.0, 2.5, (200, 250))
    shape = body_shape(body_mesh(skeleton), skeleton, position[0], world[0], palettes(["red"])[0])
    xy, near = camera.project(shape.vertices)
    assert (near > 0).all()
    image = render(camera, [shape]).astype(int)
    red = np.argwhere(image[..., 0] - image[..., 2] > 60)
    assert red[:, 1].min() >= xy[:, 0].min() - 1 and red[:, 1].max() <= xy[:, 0].max() + 1
    # 2.5 m over 250 pixels: a pixel is a centimetre, and height 0 is 100 pixels below the middle.
    assert np.allclose(camera.project(np.zeros((1, 3)))[0], [[100, 225]])


@pytest.mark.parametrize("deep", [3.0, 30.0, 200.0])
def test_the_floor_is_seen_under_the_farthest_figure(deep: float):
    """However far a crowd goes back: haze begins behind it, and ends."""
    skeleton, root, wxyz = _still()
    crowd = np.repeat(root[:1], 3, axis=1)
    crowd[0, :, [0, 2]] = [[0.0, 0.0, 2.0], [0.0, -deep, 0.0]]
    rotations = np.repeat(wxyz[:1], 3, axis=1)
    (camera,) = _cameras(skeleton, crowd, rotations, "front", (160, 120), follow=True)
    image = render(camera, []) / 255.0

    feet = crowd[0] * [1.0, 0.0, 1.0]
    away = (camera.eye - feet) @ camera.axes[2]
    ((x, y),), _ = camera.project(feet[[away.argmax()]] + [0.3, 0.0, 0.0])
    seen = image[int(y), int(x)]
    assert np.abs(seen - FLOOR).max() < np.abs(seen - BACKGROUND).max()


def test_what_does_not_fit_is_said(tmp_path):
    skeleton, root, wxyz = _still()
    good = (skeleton, root, wxyz)
    cases: tuple[tuple[tuple, list[int], dict[str, Any], str], ...] = (
        ((skeleton, root[:, 0], wxyz), [0], {}, "expected"),
        (good, [], {}, "expected some of 0 … 3"),
        (good, [4], {}, "expected some of 0 … 3"),
        (good, [0], {"labels": ["a", "b"]}, "2 labels for 1 frames"),
        (good, [0], {"colours": []}, "colours for 0 of 1"),
        (good, [0], {"columns": 0}, "0 columns"),
    )
    for data, frames, more, message in cases:
        with pytest.raises(KumiteError, match=message):
            contact_sheet(tmp_path / "a.png", *data, frames, **more)
    assert not list(tmp_path.iterdir())


def test_views_that_do_not_exist(tmp_path):
    skeleton, root, wxyz = _still()
    with pytest.raises(KumiteError, match="below"):
        contact_sheet(tmp_path / "a.png", skeleton, root, wxyz, [0], view="below")
    assert not list(tmp_path.iterdir())


@pytest.mark.jit_off
def test_triangles_hide_what_is_behind_them():
    """A near green triangle over a far red one that fills the picture, drawn in either order."""
    xy = np.array([[-50, -50], [100, -50], [0, 100], [2, 2], [8, 2], [2, 8]], dtype=float)
    near = np.array([0.1, 0.1, 0.1, 0.5, 0.5, 0.5])
    colour = np.repeat([[1.0, 0, 0], [0, 1.0, 0]], 3, axis=0)
    for faces in ([[0, 1, 2], [3, 4, 5]], [[3, 4, 5], [0, 1, 2]]):
        depth, image = np.zeros((10, 10)), np.zeros((10, 10, 3))
        draw_triangles(xy, near, colour, np.array(faces), depth, image)
        inside = np.array([[x + y < 9 and x >= 2 and y >= 2 for x in range(10)] for y in range(10)])
        assert np.allclose(image[inside], [0, 1, 0]) and np.allclose(depth[inside], 0.5)
        assert np.allclose(image[~inside & (depth < 0.3)], [1, 0, 0])
        assert (depth > 0).all() and (depth > 0.3).sum() >= inside.sum()


def test_hits_are_plotted(library: Layer, tmp_path):
    for ending in ("png", "svg"):
        plot_hits(tmp_path / f"hits.{ending}", library.strikes, "performer")
        assert (tmp_path / f"hits.{ending}").stat().st_size > 10_000
    with pytest.raises(KumiteError, match=r"expected \.png"):
        plot_hits(tmp_path / "hits.xyz", library.strikes, "performer")


@pytest.fixture(scope="module")
def fight(library: Layer) -> Recording:
    return record(World(load_scene("sparring"), library, seed=3), 8.0)


def test_a_sheet_shows_the_hits(fight: Recording, tmp_path):
    """As many cells as hits, each in its frame, both fighters large in it, the hit marked."""
    hits = [e for e in fight.events if isinstance(e, Hit)]
    found = moments(fight, "hits", most=5)
    assert len(found) == 5 < len(hits) and found == sorted(found, key=lambda m: m.frame)
    frames = [round(e.time * fight.fps) for e in hits]
    assert {m.frame for m in found} <= set(frames)
    assert found[0].frame == frames[0] and found[-1].frame == frames[-1]
    text = found[0].text.replace(" ", "_")
    assert hits[0].part in text and hits[0].character in text

    image = moment_image(fight, found[:2], size=(180, 160)).astype(int)
    for x, moment in ((0, found[0]), (182, found[1])):
        cell = image[:, x : x + 180]
        marked = np.abs(cell - (STOPPED if moment.blocked else LANDED)).sum(axis=-1) < 40
        red = cell[..., 0] - cell[..., 2] > 60
        blue = cell[..., 2] - cell[..., 0] > 60
        assert marked.sum() > 4 and (red & ~marked).sum() > 200 and blue.sum() > 200
        worn = np.argwhere(red | blue)[:, 0]
        assert np.ptp(worn) > 0.45 * 160  # shorts to head: near
    evenly = moment_image(fight, moments(fight, "evenly", most=2), size=(180, 160)).astype(int)
    assert not (np.abs(evenly - LANDED).sum(axis=-1) < 40).any()
    moment_sheet(tmp_path / "a.png", fight, "blows")
    assert Image.open(tmp_path / "a.png").size == (4 * 362 - 2, 3 * 332 - 2)
    with pytest.raises(KumiteError, match=r"'throws'.*expected one of .*hits"):
        moment_sheet(tmp_path / "b.png", fight, "throws")
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]


def test_a_ball_is_shown_where_it_comes_nearest():
    """A ball flies past at 2 m/s and comes down later, when it is told that it was avoided."""
    clip = toys.still(60)
    skeleton, frames = clip.skeleton, np.arange(60)
    ball = np.stack([2.0 - frames / 15.0, np.full(60, 1.0), np.full(60, 0.6)], axis=1)
    recording = Recording(
        scene="made up",
        fps=30.0,
        skeleton=skeleton,
        names=("anna",),
        root_position=clip.root_position[:, None],
        wxyz=clip.wxyz[:, None],
        contacts=np.ones((60, 1, 2), dtype=bool),
        library_frame=np.zeros((60, 1), dtype=int),
        objects=("ball 1",),
        object_position=ball[:, None],
        events=(
            event(2, "throw", "anna", {"attack": 1, "ball": "ball 1"}),
            event(3, "avoidance", "anna", {"attack": 1, "outcome": "found"}),
            event(55, "avoided", "anna", {"attack": 1, "ball": "ball 1"}),
            event(58, "avoided", "anna", {"attack": 2}),  # by luck: not shown
        ),
    )
    (moment,) = moments(recording)
    joints, _ = forward_kinematics(skeleton, clip.root_position, clip.wxyz)
    away = np.linalg.norm(joints - ball[:, None], axis=-1).min(axis=1)
    assert moment.frame == away.argmin() == 30 and "avoids a ball" in moment.text
    assert np.allclose(moment.trail[-1], ball[30]) and len(moment.trail) == 10
