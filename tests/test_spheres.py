"""Spheres that cover a body, and their file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from kumite import mocap as mocap_files
from kumite.body import Spheres, lay_body, lay_spheres
from kumite.body.spheres import load_spheres, save_spheres
from kumite.clip import Skeleton
from kumite.errors import KumiteError
from kumite.performer import skeleton as figure
from kumite.scene import World, load_scene
from kumite.scene.avoiding import volume_of
from kumite.scene.settings_dodge import DodgeSettings
from tests import dodging, toys


def surface(body, rng: np.random.Generator, count: int = 4000):
    """Points of capsules' skins: of a sphere anywhere along a random capsule. (part, place)."""
    part = rng.integers(len(body), size=count)
    t = rng.random(count)
    out = rng.normal(size=(count, 3))
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    centre = body.start[part] + t[:, None] * (body.end[part] - body.start[part])
    radius = body.radius_start[part] + t * (body.radius_end[part] - body.radius_start[part])
    return part, centre + radius[:, None] * out


def check_cover(skeleton: Skeleton, thicker: float) -> None:
    body = lay_body(skeleton)
    spheres = lay_spheres(skeleton, body, thicker=thicker)
    part, place = surface(body, np.random.default_rng(0))
    for joint in np.unique(body.joint):
        mine = place[body.joint[part] == joint]
        some = spheres.joint == joint
        apart = np.linalg.norm(mine[:, None] - spheres.centre[some], axis=2)
        assert np.all((apart - spheres.radius[some]).min(axis=1) <= 1e-9)
    # And no sphere stands out by more than it must: its far end is near some capsule of its joint.
    for b, (joint, centre, radius) in enumerate(
        zip(spheres.joint, spheres.centre, spheres.radius, strict=True)
    ):
        least = np.inf
        for k in np.flatnonzero(body.joint == joint):
            way = body.end[k] - body.start[k]
            t = np.clip((centre - body.start[k]) @ way / max(way @ way, 1e-12), 0, 1)
            thick = body.radius_start[k] + t * (body.radius_end[k] - body.radius_start[k])
            least = min(least, np.linalg.norm(centre - body.start[k] - t * way) + radius - thick)
        assert least <= thicker + 0.02, b


@pytest.mark.parametrize("thicker", [0.002, 0.01, 0.05])
def test_the_performer_is_covered(thicker: float):
    check_cover(figure(), thicker)
    check_cover(toys.skeleton(), thicker)


def test_people_are_covered(mocap: Path):
    for path in ("boxer/ducking.bvh", "woody/1_avoid.amc", "cmu/14"):
        found = mocap / path
        if found.is_dir():
            found = sorted(found.glob("*.amc"))[0]
        check_cover(mocap_files.load([found]).clip_set().skeleton, 0.01)


def test_spheres_move_with_the_pose():
    clips = toys.clip_set([3])
    spheres = lay_spheres(clips.skeleton)
    position, world = clips.world
    centre = spheres.of_frames(clips)
    assert centre.shape == (3, 3, len(spheres)) and centre.dtype == np.float32
    np.testing.assert_allclose(np.moveaxis(centre, 1, 2), spheres.at(position, world), atol=1e-6)
    assert abs(centre[0, 1].min() - spheres.radius[0]) < 0.2  # feet on the ground


def test_write_read_write(tmp_path: Path):
    skeleton = figure()
    spheres = lay_spheres(skeleton)
    save_spheres(tmp_path / "a.toml", spheres, skeleton)
    read = load_spheres(tmp_path / "a.toml", skeleton)
    np.testing.assert_array_equal(read.joint, spheres.joint)
    np.testing.assert_allclose(read.centre, spheres.centre, atol=1e-4)
    np.testing.assert_allclose(read.radius, spheres.radius, atol=1e-4)
    save_spheres(tmp_path / "b.toml", read, skeleton)
    assert (tmp_path / "a.toml").read_bytes() == (tmp_path / "b.toml").read_bytes()


def test_odd_names_and_names_that_are_roles_of_others(tmp_path: Path):
    s = toys.skeleton()
    names = list(s.names)
    names[1], names[2] = "chest", 'a "spine\\'  # the role chest is joint 2
    odd = Skeleton(tuple(names), s.parents, s.offsets, s.roles, s.tip_parents, s.tip_offsets)
    spheres = Spheres(np.arange(len(odd)), np.zeros((len(odd), 3)), np.full(len(odd), 0.1))
    save_spheres(tmp_path / "a.toml", spheres, odd)
    np.testing.assert_array_equal(load_spheres(tmp_path / "a.toml", odd).joint, spheres.joint)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "sphere"),
        ("[[sphere]\n", "a.toml"),
        ('[[sphere]]\njoint = "tail"\ncentre = [0, 0, 0]\nradius = 0.1\n', "tail"),
        ('[[sphere]]\njoint = "head"\ncentre = [0, 0]\nradius = 0.1\n', "centre"),
        ('[[sphere]]\njoint = "head"\ncentre = [0, 0, 0]\nradius = 0\n', "radius"),
        ('[[sphere]]\njoint = "head"\ncentre = [0, nan, 0]\nradius = 0.1\n', "finite"),
        ('[[sphere]]\njoint = "head"\ncentre = [0, 0, 0]\nradius = 0.1\ncolour = 1\n', "colour"),
    ],
)
def test_bad_files(tmp_path: Path, text: str, told: str):
    (tmp_path / "a.toml").write_text(text)
    with pytest.raises(KumiteError, match=told):
        load_spheres(tmp_path / "a.toml", toys.skeleton())


def test_no_file_and_no_text(tmp_path: Path):
    with pytest.raises(KumiteError, match="cannot be read"):
        load_spheres(tmp_path / "none.toml", toys.skeleton())
    (tmp_path / "a.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(KumiteError, match="UTF-8"):
        load_spheres(tmp_path / "a.toml", toys.skeleton())


def test_spheres_that_make_no_sense():
    for joint, centre, radius in (
        ([], np.zeros((0, 3)), []),
        ([0], np.zeros((2, 3)), [0.1]),
        ([0], np.full((1, 3), np.nan), [0.1]),
        ([0], np.zeros((1, 3)), [0.0]),
        ([-1], np.zeros((1, 3)), [0.1]),
    ):
        with pytest.raises(KumiteError, match="spheres"):
            Spheres(np.array(joint), centre, np.array(radius))
    for thicker in (0.0, -0.1, np.nan, 2.0):
        with pytest.raises(KumiteError, match="thicker"):
            lay_spheres(toys.skeleton(), thicker=thicker)


def test_a_scene_takes_an_edited_file(tmp_path):
    library = dodging.few()
    skeleton = library.clips.skeleton
    laid = lay_spheres(skeleton)
    path = tmp_path / "spheres.toml"
    save_spheres(path, Spheres(laid.joint, laid.centre, laid.radius + 0.05), skeleton)
    dodge = DodgeSettings(spheres=str(path), index=False)
    settings = load_scene("dodgeball").model_copy(update={"dodge": dodge})
    scene = World(settings, library)
    assert np.allclose(scene.fire.search.spheres.radius, laid.radius + 0.05, atol=1e-4)
    missing = DodgeSettings(spheres=str(tmp_path / "none.toml"), index=False)
    with pytest.raises(KumiteError, match=r"none\.toml"):
        volume_of(missing, skeleton)
