"""Libraries for preparation: what targets are about, where, and what clears an obstacle."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from kumite import files
from kumite.annotate import find_contacts, find_cycles, find_strikes, hand_cycles
from kumite.body import Body, lay_body
from kumite.clip import LIMBS, ClipSet, concatenate, tip_positions
from kumite.errors import KumiteError
from kumite.graph import (
    Layer,
    Targets,
    authored_targets,
    build_preparation,
    load_library,
    save_library,
)
from kumite.graph.library_file import VERSION
from kumite.graph.preparing import KINDS, MARGIN, PLACE, Preparing, find_about
from kumite.kernels import passing
from kumite.rotation import planar_apply, planar_inverse, rotate
from tests.shared import builtin, only, performed

ABOUT = {
    "duck_under": "under",
    "crawl_under": "under",
    "jump_over": "over",
    "kick_ball": "strike",
    "front_kick": "strike",
    "punch": "strike",
}


def prepared(library: Layer) -> Preparing:
    assert library.preparing is not None
    return library.preparing


@pytest.fixture(scope="module")
def library() -> Layer:
    return builtin("targets", "preparation")


@pytest.fixture(scope="module")
def preparing(library: Layer) -> Preparing:
    return prepared(library)


def skin(body: Body, clips: ClipSet, frames: slice, count: int) -> np.ndarray:
    """Points [F, P, 3] all over the capsules: of tapered ones those of many spheres that touch the
    hull, spread evenly over directions (a golden spiral)."""
    i = np.arange(count) + 0.5
    up, turn = 1 - 2 * i / count, np.pi * (1 + 5**0.5) * i
    flat = np.sqrt(1 - up**2)
    around = np.stack([flat * np.cos(turn), up, flat * np.sin(turn)], axis=1)
    points = []
    for u in np.linspace(0, 1, 25):
        centre = (1 - u) * body.start + u * body.end
        radius = (1 - u) * body.radius_start + u * body.radius_end
        for sphere in range(len(body)):
            points.append((body.joint[sphere], centre[sphere] + radius[sphere] * around))
    position, world = clips.world
    out = [
        position[frames, j][:, None] + rotate(world[frames, j][:, None], local)
        for j, local in points
    ]
    return np.concatenate(out, axis=1)


def test_kinds_are_told_without_labels(preparing: Preparing):
    targets = preparing.hierarchy.targets
    assert set(targets.label) == set(ABOUT)
    for t, label in enumerate(targets.label):
        assert KINDS[preparing.kind[t]] == ABOUT[label], label


@pytest.mark.parametrize("label", ["duck_under", "crawl_under", "jump_over"])
def test_obstacles_are_cleared_as_points_on_the_body_say(library, preparing, label):
    clips, targets = library.clips, preparing.hierarchy.targets
    t = targets.label.index(label)
    start, stop = int(targets.start[t]), int(targets.stop[t])
    points = skin(lay_body(clips.skeleton), clips, slice(start, stop + 1), 160)
    seen = planar_apply(planar_inverse(clips.facing[start]), points)
    way = np.array([np.sin(preparing.way[t]), np.cos(preparing.way[t])])
    along, height = seen[..., [0, 2]] @ way, seen[..., 1]
    under = KINDS[preparing.kind[t]] == "under"
    order = np.argsort(along, axis=None)
    in_order, heights = along.ravel()[order], height.ravel()[order]

    def clear(at: float, wide: float) -> float:
        near = heights[slice(*np.searchsorted(in_order, [at - wide, at + wide]))]
        return float(near.max() if under else near.min())

    at = float(preparing.place[t, [0, 2]] @ way)
    # Whatever is within the margin is clear, by no more than places and points are coarse.
    exact, coarse = clear(at, MARGIN), clear(at, MARGIN + 2 * PLACE)
    ours = float(preparing.clear[t])
    if under:
        assert exact - 1e-3 <= ours <= coarse + 3e-3
        assert ours < 0.85 * height[0].max()
    else:
        assert coarse - 3e-3 <= ours <= exact + 1e-3
        assert ours > 0.2
    # The body goes all past it: before when it starts and at the reference, behind at the end.
    reference = int(preparing.reference[t]) - start
    assert along[: reference + 1].max() < at - MARGIN and along[-1].min() > at + MARGIN
    # Nowhere that the pelvis goes by and the body goes past would the obstacle be much harder.
    pelvis = clips.world[0][start : stop + 1, clips.skeleton.joint("pelvis")]
    gone = planar_apply(planar_inverse(clips.facing[start]), pelvis)[:, [0, 2]] @ way
    frames = np.arange(len(gone))
    fits = (gone > along[: reference + 1].max() + MARGIN) & (gone < along[-1].min() - MARGIN)
    others = [clear(g, MARGIN + 2 * PLACE) for g in gone[(frames >= reference) & fits]]
    assert len(others) > 10
    assert ours <= min(others) + 5e-3 if under else ours >= max(others) - 5e-3
    assert gone[preparing.contact[t] - start] == pytest.approx(at, abs=1e-9)
    assert preparing.place[t, 1] == 0.0


@pytest.mark.parametrize("label", ["kick_ball", "front_kick", "punch"])
def test_strikes_hit_where_and_when_they_were_authored(library, preparing, label):
    clips, targets = library.clips, preparing.hierarchy.targets
    t = targets.label.index(label)
    limb, contact, start = (int(x[t]) for x in (preparing.limb, preparing.contact, targets.start))
    made = performed("targets")
    clip = int(clips.clip_of_frame[contact])
    first = int(clips.clip_start[clip])
    authored = min(made.truth[clip].strikes, key=lambda s: abs(s.frame + first - contact))
    # A blow is fastest shortly before it lands.
    assert 0 <= authored.frame + first - contact <= 0.1 * clips.fps and authored.limb == LIMBS[limb]
    tip = tip_positions(clips.skeleton, LIMBS[limb], *clips.world)[contact]
    x, z, yaw = clips.facing[start]
    off = tip - [x, 0, z]
    c, s = np.cos(yaw), np.sin(yaw)
    expected = [c * off[0] - s * off[2], tip[1], s * off[0] + c * off[2]]
    np.testing.assert_allclose(preparing.place[t], expected, atol=1e-9)
    assert preparing.clear[t] == 0.0 and expected[2] > 0.2


def test_references_and_contacts_lie_within_what_is_played(library, preparing):
    h = preparing.hierarchy
    assert np.all(h.entry <= preparing.reference) and np.all(preparing.reference <= h.targets.mark)
    assert np.all(h.targets.mark <= preparing.contact)
    assert np.all(preparing.contact < h.exit) and preparing.found.all()
    table, cores = library.table, len(h.cores)
    assert len(preparing.what) == len(table.first)
    for row in np.flatnonzero(preparing.what >= cores):
        t = preparing.what[row] - cores
        assert table.first[row] - 1 <= preparing.reference[t] < preparing.contact[t]
        assert preparing.contact[t] <= table.last[row]


def test_the_cores_are_locomotion_and_all_hang_together(preparing):
    assert set(preparing.hierarchy.cores.label) == {"stand", "walk", "run"}
    targets, cores = preparing.hierarchy.targets, preparing.hierarchy.cores
    for a, b in zip(cores.start, cores.stop):
        assert not np.any((targets.start < b) & (targets.stop > a))


@pytest.mark.jit_off
def test_a_sphere_that_rolls_by():
    start = np.array([[[0.0, 1.0, 0.0]], [[0.0, 1.0, 1.0]]])
    top, low = np.full(300, -np.inf), np.full(300, np.inf)
    span, height = np.empty((2, 2)), np.empty((2, 2))
    way, radius = np.array([0.0, 1.0]), np.array([0.3])
    passing.sweep(start, start, radius, radius, way, -1.0, 0.01, 0.01, top, low, span, height)
    np.testing.assert_allclose(span, [[-0.3, 0.3], [0.7, 1.3]])
    np.testing.assert_allclose(height, [[0.7, 1.3]] * 2)
    edge = -1.0 + 0.01 * np.arange(301)  # of the places
    for p in range(300):
        centre = min((max(edge[p], min(c, edge[p + 1])) - c for c in (0.0, 1.0)), key=abs)
        if abs(centre) < 0.2999:
            rise = np.sqrt(0.09 - centre**2)
            assert top[p] == pytest.approx(1 + rise) and low[p] == pytest.approx(1 - rise)
        elif abs(centre) > 0.3001:
            assert top[p] == -np.inf and low[p] == np.inf


def test_who_ducks_on_the_spot_passes_nothing(library):
    clips = library.clips
    duck = prepared(library).hierarchy.targets.label.index("duck_under")
    targets = prepared(library).hierarchy.targets
    start, mark = int(targets.start[duck]), int(targets.mark[duck])
    half = Targets(("half",), np.array([start]), np.array([mark + 25]), np.array([mark]))
    about = find_about(clips, library.strikes, half, 0, mark)
    assert KINDS[about.kind] == "under"
    points = skin(lay_body(clips.skeleton), clips, slice(about.contact, about.contact + 1), 300)
    assert about.clear == pytest.approx(points[..., 1].max(), abs=5e-3)


# Files --------------------------------------------------------------------------------------------


def test_a_library_is_read_as_it_was_written(library, tmp_path: Path):
    save_library(tmp_path / "a.kumite", library)
    again = only(load_library(tmp_path / "a.kumite"))
    assert again.digest == library.digest and again.report == library.report
    for f in fields(Preparing):
        ours, theirs = getattr(prepared(library), f.name), getattr(prepared(again), f.name)
        if f.name != "hierarchy":
            np.testing.assert_array_equal(ours, theirs)
    h = prepared(again).hierarchy
    assert h.cores.label == prepared(library).hierarchy.cores.label
    assert np.array_equal(h.links, prepared(library).hierarchy.links)
    save_library(tmp_path / "b.kumite", again)
    assert (tmp_path / "a.kumite").read_bytes() == (tmp_path / "b.kumite").read_bytes()
    other = replace(library, preparing=replace(prepared(library), way=prepared(library).way + 0.1))
    assert other.digest != library.digest


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("preparing.kind", 7),
        ("preparing.limb", -1),
        ("preparing.what", 99),
        ("preparing.contact", 10**6),
        ("preparing.reference", -3),
        ("preparing.place", np.nan),
        ("hierarchy.entry", 0),
        ("hierarchy.link_land", 11_000),
        ("cores.start", -1),
        ("targets.stop", 10**7),
    ],
)
def test_damaged_libraries(library, tmp_path: Path, name: str, wrong: float):
    save_library(tmp_path / "a.kumite", library)
    header, arrays = files.load(tmp_path / "a.kumite", "library", VERSION)
    name = f"preparation/{name}"
    changed = arrays[name].copy()
    changed.flat[-1] = wrong
    files.save(tmp_path / "b.kumite", "library", VERSION, header, {**arrays, name: changed})
    with pytest.raises(KumiteError, match=r"b\.kumite: damaged library"):
        load_library(tmp_path / "b.kumite")
    files.save(
        tmp_path / "c.kumite", "library", VERSION, header, {**arrays, name: arrays[name][:-1]}
    )
    with pytest.raises(KumiteError, match=r"c\.kumite: damaged library"):
        load_library(tmp_path / "c.kumite")


# What does not fit --------------------------------------------------------------------------------


def test_libraries_that_cannot_be_built(library):
    clips, targets = library.clips, prepared(library).hierarchy.targets
    with pytest.raises(KumiteError, match="no target motion; expected at least one"):
        build_preparation(clips, Targets((), *[np.zeros(0)] * 3))
    for alike, text in ((0.0, "alike 0.0 rad"), (np.nan, "alike nan rad")):
        with pytest.raises(KumiteError, match=text):
            build_preparation(clips, targets, alike=alike)
    with pytest.raises(KumiteError, match=r"threshold -1\.0 rad²"):
        build_preparation(clips, targets, threshold=-1.0)
    end = int(clips.clip_start[1])
    across = Targets(("x",), np.array([end - 50]), np.array([end + 50]), np.array([end]))
    with pytest.raises(KumiteError, match=r"target 'x': frames .* no part of one clip"):
        build_preparation(clips, across)
    with pytest.raises(KumiteError, match="no target motion: none of these clips marks"):
        builtin("locomotion", "preparation")


def test_a_target_that_falls_back_is_told(library):
    clips, targets = library.clips, prepared(library).hierarchy.targets
    t = targets.label.index("jump_over")
    air = int(prepared(library).contact[t])  # nothing supports who is in the air
    jump = Targets(("jump",), np.array([air - 1]), targets.stop[[t]], np.array([air]))
    cores = prepared(library).hierarchy.cores
    built = build_preparation(clips, jump, cores, threshold=1e-9)
    assert built.report["fall_back"] == ["jump"] and not prepared(built).found[0]
    assert prepared(built).reference[0] == air - 1


def test_cores_may_be_given_or_found(library):
    clips, targets = library.clips, prepared(library).hierarchy.targets
    contacts = find_contacts(clips)
    found = find_cycles(clips, contacts)
    walk = found.label.index("walk")
    mine = hand_cycles(
        clips, contacts, [("my walk", int(found.start[walk]), int(found.stop[walk]))]
    )
    built = build_preparation(clips, targets, mine)
    assert built.report["cores"] == ["my walk"]
    assert len(find_strikes(clips)) == built.report["hits"]


def test_authored_targets_at_another_rate():
    made = performed("targets")
    clips = concatenate(list(made.clips), 30.0)
    built = build_preparation(clips, authored_targets(clips, made.truth, 60.0))
    told = {
        label: KINDS[k]
        for label, k in zip(prepared(built).hierarchy.targets.label, prepared(built).kind)
    }
    assert told == ABOUT
