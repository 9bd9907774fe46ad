"""Balance, reference postures, cycles and the hierarchical graph."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull

from kumite import mocap as mocap_files
from kumite.annotate import (
    Contacts,
    centre_of_mass,
    find_balance,
    find_contacts,
    find_cycles,
    find_mark,
    find_reference,
    hand_cycles,
)
from kumite.annotate.balance import centroids, support_distance
from kumite.annotate.cycles import closed
from kumite.body import Body, lay_body
from kumite.clip import Clip, ClipSet, concatenate, facing_frame
from kumite.errors import KumiteError
from kumite.graph import Targets, authored_targets, build_hierarchy, hierarchy_table, pose_features
from kumite.graph.hierarchy import pose_distances
from kumite.rotation import angle, from_axis_angle, planar_compose, planar_inverse
from tests import toys
from tests.shared import performed

GOING = ("run", "walk", "walk_back", "walk_left", "walk_right", "walk_turn_left", "walk_turn_right")


@pytest.fixture(scope="module")
def walks() -> tuple[ClipSet, Contacts]:
    clips = concatenate(list(performed("locomotion").clips))
    return clips, find_contacts(clips)


@pytest.fixture(scope="module")
def errands():
    made = performed("targets")
    clips = concatenate(list(made.clips))
    return clips, find_contacts(clips), authored_targets(clips, made.truth, 60.0)


# Balance ------------------------------------------------------------------------------------------


def two_links(radii: tuple[float, float] = (0.1, 0.1)) -> Body:
    """A thigh of 6 kg below the origin and a shin of 2 kg below it, each 1 m long."""
    down = np.array([[0.0, -1.0, 0.0]] * 2)
    ends = (np.full(2, radii[0]), np.full(2, radii[1]))
    return Body(("thigh", "shin"), np.array([0, 1]), 0.0 * down, down, *ends, np.array([6.0, 2.0]))


def test_the_centre_of_mass_of_two_links():
    straight = np.array([[0.0, 2.0, 0.0], [0.0, 1.0, 0.0]])
    still = np.array([[1.0, 0, 0, 0]] * 2)
    # (6 · 1.5 m + 2 · 0.5 m) / 8
    np.testing.assert_allclose(centre_of_mass(two_links(), straight, still), [0, 1.25, 0])
    bent = still.copy()
    bent[1] = from_axis_angle(np.array([1.0, 0, 0]), 0.5 * np.pi)  # the shin points back: -Z
    expected = [0, (6 * 1.5 + 2 * 1.0) / 8, -2 * 0.5 / 8]
    np.testing.assert_allclose(centre_of_mass(two_links(), straight, bent), expected, atol=1e-12)


def test_centroids_of_tapered_capsules_are_those_of_many_slices():
    body = two_links((0.2, 0.05))
    x = np.linspace(-0.2, 1.05, 400_001)
    radius = np.interp(x, [0.0, 1.0], [0.2, 0.05])
    square = np.where(x < 0, 0.04 - x**2, np.where(x > 1, 0.0025 - (x - 1) ** 2, radius**2))
    expected = (x * square).sum() / square.sum()
    np.testing.assert_allclose(centroids(body)[0], [0, -expected, 0], atol=1e-4)


@pytest.mark.jit_off
@given(st.integers(0, 2**32 - 1), st.integers(3, 12))
@settings(max_examples=80, deadline=None)
def test_distances_to_the_support_area_are_convex_hulls(seed: int, count: int):
    rng = np.random.default_rng(seed)
    corner, point = rng.normal(size=(count, 2)), 1.5 * rng.normal(size=2)
    ours = support_distance(corner[None], np.ones((1, count), bool), point[None])[0]
    hull = ConvexHull(corner)
    planes = hull.equations[:, :2] @ point + hull.equations[:, 2]
    assert (ours < 0) == bool(np.all(planes < 0))
    if ours < 0:
        assert ours == pytest.approx(planes.max(), abs=1e-9)
    else:
        a = corner[hull.simplices[:, 0]]
        b = corner[hull.simplices[:, 1]] - a
        t = np.clip(((point - a) * b).sum(1) / (b * b).sum(1), 0, 1)
        assert ours == pytest.approx(np.linalg.norm(point - a - t[:, None] * b, axis=1).min())


def test_distances_to_areas_that_are_none():
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    points = np.array([[0.5, 0.5], [2.0, 0.5], [0.5, 0.5], [3.0, 4.0], [0.5, 2.0]])
    corner = np.repeat(square[None], 5, axis=0)
    touches = np.array([[1, 1, 1, 1], [1, 1, 1, 1], [0, 0, 0, 0], [1, 0, 0, 0], [1, 0, 1, 0]], bool)
    out = support_distance(corner, touches, points)
    np.testing.assert_allclose(out, [-0.5, 1.0, np.inf, 5.0, np.hypot(0.5, 1.0)])


def test_a_stand_is_in_balance_and_a_lean_is_not():
    skeleton = toys.skeleton()
    wxyz = np.zeros((3, len(skeleton), 4))
    wxyz[..., 0] = 1.0
    root = np.tile([0.0, toys.HIP_HEIGHT, 0.0], (3, 1))
    root[1, 2], root[2, 2] = 0.05, 0.6
    clips = concatenate([Clip("stands", skeleton, 30.0, root, wxyz)])
    contacts = Contacts(np.array([[1, 1], [1, 1], [0, 0]], bool), np.zeros((2, 2)))
    balance = find_balance(clips, contacts, lay_body(skeleton))
    assert balance.balanced.tolist() == [True, True, False]
    assert balance.distance[2] == np.inf
    assert balance.distance[1] == pytest.approx(balance.distance[0], abs=1e-9)
    with pytest.raises(KumiteError, match="contacts of 2 frames, clips of 3"):
        find_balance(clips, Contacts(np.zeros((2, 2), bool), np.zeros((2, 2))))


def test_the_performer_stands_in_balance(errands):
    clips, contacts, targets = errands
    balance = find_balance(clips, contacts)
    assert np.all(balance.balanced[40:150])  # it stands
    t = targets.label.index("jump_over")
    jump = slice(targets.mark[t], targets.stop[t])
    assert np.any(np.isinf(balance.distance[jump])), "nothing supports who is in the air"


# Reference postures -------------------------------------------------------------------------------


def test_reference_postures_of_the_performer(errands):
    clips, contacts, targets = errands
    balance = find_balance(clips, contacts)
    for t in range(len(targets)):
        start, mark = int(targets.start[t]), int(targets.mark[t])
        r = find_reference(clips, contacts, start, mark, balance=balance)
        assert start <= r.frame <= mark
        fits = r.balanced & r.same_contacts & (r.legs < 4.0)
        assert r.found and fits[r.frame - start] and not fits[r.frame - start + 1 :].any()
        assert mark - r.frame <= 0.05 * clips.fps  # it has just got ready
        assert "before the mark" in str(r)
        strict = find_reference(clips, contacts, start, mark, threshold=0.3, balance=balance)
        assert strict.frame <= r.frame


def test_a_reference_that_is_not_found_is_the_start_and_says_so(errands):
    clips, _, targets = errands
    t = targets.label.index("jump_over")
    start, mark = int(targets.start[t]), int(targets.mark[t])
    air = Contacts(np.zeros((len(clips), 2), bool), np.zeros((2, 2)))
    r = find_reference(clips, air, start, mark)
    assert r.frame == start and not r.found and "the start: no frame" in str(r)


def test_marks_that_lie_outside(errands):
    clips, contacts, targets = errands
    start = int(targets.start[0])
    for mark in (start - 1, int(clips.clip_start[1]), -1):
        with pytest.raises(KumiteError, match=f"mark {mark} is outside of the target motion in"):
            find_reference(clips, contacts, start, mark)
    with pytest.raises(KumiteError, match="expected a frame from 0"):
        find_reference(clips, contacts, len(clips), len(clips))
    with pytest.raises(KumiteError, match="threshold 0"):
        find_reference(clips, contacts, start, start + 1, threshold=0.0)


def test_marks_nobody_made_are_while_the_performer_gets_ready(errands):
    clips, _, targets = errands
    for t in range(len(targets)):
        found = find_mark(clips, int(targets.start[t]), int(targets.stop[t]))
        assert targets.start[t] < found <= targets.mark[t] <= found + 0.45 * clips.fps


# Cycles -------------------------------------------------------------------------------------------


def test_cycles_of_the_performer(walks):
    clips, contacts = walks
    cycles = find_cycles(clips, contacts)
    assert set(GOING) | {"stand"} <= set(cycles.label)
    of = cycles.label.index
    assert cycles.seconds[of("walk")] == pytest.approx(1.08, abs=0.03)  # as authored
    assert cycles.speed[of("walk")] == pytest.approx(1.22 / 1.08, rel=0.06)
    assert cycles.seconds[of("run")] == pytest.approx(0.72, abs=0.03)
    assert cycles.displacement[of("walk_back"), 1] == pytest.approx(-0.85, abs=0.06)
    assert cycles.displacement[of("walk_left"), 0] == pytest.approx(0.36, abs=0.03)
    assert cycles.displacement[of("walk_turn_left"), 2] > 0.5
    assert cycles.displacement[of("walk_turn_right"), 2] < -0.5
    assert cycles.speed[of("stand")] < 0.01
    for name in ("walk", "walk_back", "walk_left", "walk_right", "run", "stand"):
        assert cycles.gap[of(name)] < 0.2 and cycles.skate[of(name)] < 0.05


def test_a_closed_cycle_goes_on_from_itself(walks):
    clips, contacts = walks
    cycles = find_cycles(clips, contacts, most=2)
    for m in range(len(cycles)):
        root, wxyz = closed(clips, int(cycles.start[m]), int(cycles.stop[m]))
        ends = facing_frame(clips.skeleton, root[[0, -1]], wxyz[[0, -1]])
        moved = planar_compose(planar_inverse(ends[0]), ends[1])
        np.testing.assert_allclose(moved, cycles.displacement[m], atol=1e-6)
        assert angle(wxyz[0, 1:], wxyz[-1, 1:]).max() < 1e-6
        assert root[0, 1] == pytest.approx(root[-1, 1], abs=1e-9)


def test_where_there_is_no_cycle(walks):
    clips, contacts = walks
    part = clips.root_position[200:230], clips.wxyz[200:230]
    short = concatenate([Clip("short", clips.skeleton, 60.0, *part)])
    with pytest.raises(KumiteError, match=r"no cycle of locomotion in 1 clip\(s\) \(0\.5 s\): no"):
        find_cycles(short, find_contacts(short))
    nowhere = np.zeros(len(clips), bool)
    with pytest.raises(KumiteError, match="no cycle of locomotion"):
        find_cycles(clips, contacts, where=nowhere)


def test_cycles_labelled_by_hand(walks):
    clips, contacts = walks
    found = find_cycles(clips, contacts)
    walk = found.label.index("walk")
    a, b = int(found.start[walk]), int(found.stop[walk])
    mine = hand_cycles(clips, contacts, [("my walk", a, b + 3)])
    assert mine.label == ("my walk",) and abs(mine.stop[0] - b) <= 1
    for wrong in ((5, 5), (-1, 5), (0, len(clips)), (a, int(clips.clip_start[3]))):
        with pytest.raises(KumiteError, match=r"cycle 'mine': frames .* no part of one clip"):
            hand_cycles(clips, contacts, [("mine", *wrong)])


# The graph ----------------------------------------------------------------------------------------


def test_pose_distances_by_hand(errands):
    clips, _, _ = errands
    features = pose_features(clips)
    some = np.array([40, 300, 700])
    out = pose_distances(features, some, some)
    q, x = features.quaternion, features.euclidean
    for i, a in enumerate(some):
        for k, b in enumerate(some):
            turns = angle(q[:, :, a], q[:, :, b])
            total = (features.weight * turns**2).sum() + ((x[:, a] - x[:, b]) ** 2).sum()
            assert out[i, k] == pytest.approx(np.sqrt(total), abs=2e-3)


def test_the_hierarchy_of_the_performer(errands):
    clips, contacts, targets = errands
    cores = find_cycles(clips, contacts)
    h = build_hierarchy(clips, cores, targets)
    ways = {"duck_under", "crawl_under", "jump_over", "kick_ball", "front_kick", "punch"}
    assert set(targets.label) == ways
    stand = cores.label.index("stand")
    assert h.entry_distance[stand].max() < 0.3 and h.exit_distance[stand].max() < 0.3
    features = pose_features(clips)
    for m in range(len(cores)):
        for t in range(len(targets)):
            assert cores.start[m] < h.leave[m, t] <= cores.stop[m]
            assert cores.start[m] < h.land[m, t] <= cores.stop[m]
            assert h.entry[m, t] <= targets.mark[t] < h.exit[m, t]
            # No other phase of the cycle fits better.
            phases = np.arange(cores.start[m] + 1, cores.stop[m] + 1)
            apart = pose_distances(features, phases, h.entry[m, t : t + 1])[:, 0]
            assert h.entry_distance[m, t] == pytest.approx(apart.min(), abs=1e-3)
    assert np.all(np.diag(h.links)) and h.enters.any(axis=0).all() and h.returns.any(axis=0).all()
    table, what = hierarchy_table(clips, h)
    assert set(what.tolist()) >= set(range(len(cores) + len(targets)))
    source = np.repeat(np.arange(table.states), np.diff(table.action_start))
    graph = coo_array((np.ones(len(source)), (source, table.target[table.stretch])))
    assert connected_components(graph, connection="strong")[0] == 1


def test_links_lead_through_what_was_captured(errands):
    clips, contacts, targets = errands
    cores = find_cycles(clips, contacts)
    h = build_hierarchy(clips, cores, targets)
    stand, walk = cores.label.index("stand"), cores.label.index("walk")
    first, last = h.link_first[stand, walk], h.link_last[stand, walk]
    assert 0.5 * clips.fps < last - first < 1.7 * clips.fps  # the first steps of a walk
    assert h.link_distance[stand, walk] < 0.3
    features = pose_features(clips)
    direct = pose_distances(features, h.link_leave[[stand], walk], h.link_land[[stand], walk])
    assert direct[0, 0] > 2 * h.link_distance[stand, walk]


def test_targets_that_do_not_fit(errands):
    clips, contacts, targets = errands
    cores = find_cycles(clips, contacts)
    with pytest.raises(KumiteError, match="target 'x': mark 5; expected one from its start 10"):
        Targets(("x",), np.array([10]), np.array([20]), np.array([5]))
    end = int(clips.clip_start[1])
    with pytest.raises(KumiteError, match=r"target 'x': frames .* no part of one clip"):
        across = (np.array([f]) for f in (end - 5, end + 5, end))
        build_hierarchy(clips, cores, Targets(("x",), *across))
    with pytest.raises(KumiteError, match="no core motions"):
        build_hierarchy(clips, cores.take([]), targets)
    with pytest.raises(KumiteError, match="no target motion"):
        authored_targets(clips, [], 60.0)


# Real clips ---------------------------------------------------------------------------------------


@pytest.mark.slow
def test_real_clips(mocap: Path):
    names = ("1_walk_crawl_walk", "1_walk_jump_walk", "1_run_straight_1", "1_flying_kick", "3_walk")
    files = [mocap / "woody" / f"{n}.amc" for n in names]
    clips = mocap_files.load(files).clip_set()
    contacts = find_contacts(clips)
    cores = find_cycles(clips, contacts)
    assert {"walk", "run", "stand"} <= set(cores.label)
    walk = cores.label.index("walk")
    assert 0.9 < cores.speed[walk] < 1.4 and cores.skate[walk] < 0.1
    at = {n: int(clips.clip_start[clips.names.index(n)]) for n in names}
    # Standing, it bends down into a crawl with both feet on the ground.
    crawl, jump = at["1_walk_crawl_walk"], at["1_walk_jump_walk"]
    targets = Targets(
        ("crawl", "jump"),
        np.array([crawl + 10, jump + 70]),
        np.array([crawl + 215, jump + 115]),
        np.array([crawl + 60, jump + 92]),
    )
    h = build_hierarchy(clips, cores, targets)
    assert h.entry_distance.min(axis=0).max() < 1.5 and h.exit_distance.min(axis=0).max() < 1.5
    crawls = find_reference(clips, contacts, crawl + 10, crawl + 60, threshold=8.0)
    assert crawls.start <= crawls.frame <= crawls.mark
    table, _ = hierarchy_table(clips, h)
    assert table.states > len(cores)
