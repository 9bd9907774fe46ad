"""Pairs in formation: no two of them meet, by how their paths are laid and timed."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from pydantic import ValidationError

from kumite.errors import KumiteError
from kumite.scene import SceneSettings, World, load_scene, with_count
from kumite.scene.events import Reaction
from kumite.scene.settings_pairs import APART, PairsSettings
from tests.shared import builtin

SIDES = {"one": {"name": "red"}, "other": {"name": "blue"}}


def _pairs(**settings) -> PairsSettings:
    return PairsSettings.model_validate({**SIDES, **settings})


def _ways(pairs: PairsSettings) -> tuple[np.ndarray, np.ndarray]:
    """Places [pairs, points, 2] m and times [pairs, points] s of the first of every pair."""
    routes = [f.route() for f in pairs.fighters()[::2]]
    return (
        np.array([r.places for r in routes if r]),
        np.array([[p.time for p in r.points] for r in routes if r], dtype=float),
    )


@pytest.mark.parametrize("count", [1, 2, 5, 12, 40, 101])
@pytest.mark.parametrize("turn", [0.0, 40.0, -200.0])
def test_pairs_on_spirals_are_always_the_spacing_apart(count: int, turn: float):
    pairs = _pairs(count=count, spacing=3.0, turn_deg=turn)
    places, times = _ways(pairs)
    assert places.shape == (count, pairs.points, 2)
    assert np.all(times == times[0]) and times[0, -1] == pairs.seconds
    between = 0.5 * (places[:, 1:] + places[:, :-1])  # the way is straight: turning cuts corners
    for at, least in ((places, pairs.spacing - 1e-9), (between, 0.98 * pairs.spacing)):
        for a, b in itertools.combinations(range(count), 2):
            assert np.linalg.norm(at[a] - at[b], axis=1).min() >= least, (a, b)


def test_a_spiral_spreads_and_the_innermost_keep_its_speed():
    pairs = _pairs(count=12, speed=0.4, seconds=20.0, turn_deg=30.0, points=40)
    places, _ = _ways(pairs)
    radius = np.linalg.norm(places, axis=2)
    assert np.all(np.diff(radius, axis=1) > 0)
    inner = int(np.argmin(radius[:, 0]))
    length = np.linalg.norm(np.diff(places[inner], axis=0), axis=1).sum()
    assert length == pytest.approx(0.4 * 20.0, rel=0.15)


@pytest.mark.parametrize("count", [1, 2, 7, 20])
@pytest.mark.parametrize("speed", [0.5, 2.4])
def test_where_paths_cross_the_second_pair_comes_a_spacing_later(count: int, speed: float):
    pairs = _pairs(count=count, layout="crossing", spacing=4.0, speed=speed, seconds=10.0)
    places, times = _ways(pairs)
    assert len(places) == count
    along, across = range(0, count, 2), range(1, count, 2)  # +X and +Z
    for a, b in itertools.product(along, across):
        x, z = places[b, 0, 0], places[a, 0, 1]  # where the two cross
        assert places[a, 0, 0] < x < places[a, -1, 0] and places[b, 0, 1] < z < places[b, -1, 1]
        first = np.interp(x, places[a, :, 0], times[a])
        second = np.interp(z, places[b, :, 1], times[b])
        assert second - first == pytest.approx(pairs.spacing / speed)
    for same in (along, across):  # side by side
        for a, b in itertools.combinations(same, 2):
            aside = 1 if same is along else 0
            assert abs(places[a, 0, aside] - places[b, 0, aside]) >= pairs.spacing - 1e-9
    for p, t in zip(places, times):
        assert np.allclose(np.linalg.norm(np.diff(p, axis=0), axis=1) / np.diff(t), speed)


def test_those_of_a_pair_face_each_other_or_their_way():
    one, other = _pairs(count=1).fighters()
    assert np.hypot(*np.subtract(one.position, other.position)) == pytest.approx(APART)
    assert (one.yaw_deg - other.yaw_deg) % 360 == pytest.approx(180.0)
    assert (one.against, other.against) == (other.name, one.name) == ("blue 1", "red 1")

    behind = {**SIDES, "other": {"name": "blue", "later": 1.5}}
    pairs = PairsSettings.model_validate(
        {**behind, "count": 1, "layout": "crossing", "facing": "way", "speed": 2.0}
    )
    one, other = pairs.fighters()
    assert one.yaw_deg == other.yaw_deg == pytest.approx(90.0)
    assert one.position[0] - other.position[0] == pytest.approx(3.0)  # as far as it goes in 1.5 s
    first, second = one.route(), other.route()
    assert first is not None and second is not None
    assert second.points[-1].time == pytest.approx((first.points[-1].time or 0.0) + 1.5)
    assert len(second) == len(first) + 1  # it begins at a place of its own


def test_those_who_face_each_other_share_check_points_by_the_middle_between_them():
    for facing in ("rival", "way"):
        points = [p for f in _pairs(count=2, facing=facing).fighters() for p in f.point]
        assert all(p.middle == (facing == "rival") for p in points)


@pytest.mark.slow
def test_at_the_last_check_point_of_the_spiral_red_knocks_blue_down():
    scene = World(load_scene("spiral"), builtin(level="actions"), seed=1)
    routes = [r for r in scene.routes[::2] if r is not None]
    off, felled = [], []  # m of the middle of a pair from its path; m from its end, s
    for _ in range(round(30.0 * scene.fps)):
        told = len(scene.events)
        scene.step()
        ground = scene.root_position[:, [0, 2]].astype(float)
        middle = 0.5 * (ground[::2] + ground[1::2])
        off.append([_off(at, route.places) for at, route in zip(middle, routes)])
        for e in scene.events[told:]:
            if isinstance(e, Reaction) and e.size == "fall":
                pair = scene.names.index(e.character) // 2
                end = routes[pair].places[-1]
                felled.append((np.hypot(*(middle[pair] - end)), e.frame / scene.fps))
    lie = [scene.tree.labels[k] == "fall" for k in scene.tree_fighter.stretch]
    assert sum(lie[1::2]) >= 11 and not any(lie[::2])
    assert np.mean(off) <= 0.5
    where, when = np.array(felled).T
    assert where.mean() < 0.7 and where.max() < 1.5
    assert when.min() > float(routes[0].points[-2].time or 0.0) and np.median(when) < 21.0


def _off(at: np.ndarray, places: np.ndarray) -> float:
    """How far a place is from the line through others [m]."""
    way = np.diff(places, axis=0)
    along = ((at - places[:-1]) * way).sum(axis=1) / (way**2).sum(axis=1)
    nearest = places[:-1] + np.clip(along, 0.0, 1.0)[:, None] * way
    return float(np.linalg.norm(at - nearest, axis=1).min())


def test_what_is_required_is_so_at_the_last_check_point_only():
    pairs = _pairs(count=3, other={"name": "blue", "require": ["fall"], "refuse": ["fall"]})
    for f in pairs.fighters()[1::2]:
        assert [p.require for p in f.point] == [()] * (pairs.points - 1) + [("fall",)]
        assert [p.refuse for p in f.point] == [("fall",)] * (pairs.points - 1) + [()]


def test_the_number_of_pairs_may_be_given_beside_the_file():
    spiral = load_scene("spiral")
    assert len(spiral.names) == 24
    assert len(with_count(spiral, 3).names) == 6
    for count in (0, 1001):
        with pytest.raises(KumiteError, match=f"count: {count}"):
            with_count(spiral, count)
    with pytest.raises(KumiteError, match="one by one"):
        with_count(load_scene("boxing"), 3)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("count", 0),
        ("count", 1001),
        ("layout", "star"),
        ("spacing", 0.5),
        ("speed", 0.0),
        ("seconds", float("inf")),
        ("points", 1),
        ("turn_deg", 1e5),
        ("one", {"name": "red", "style": "wrestler"}),
        ("one", {"name": ""}),
    ],
)
def test_bad_values_are_refused_by_name(key: str, value):
    with pytest.raises(ValidationError, match=key):
        _pairs(**{key: value})


def test_both_sides_need_names_of_their_own():
    with pytest.raises(ValidationError, match="red 1"):
        SceneSettings.model_validate(
            {"title": "Twins", "pairs": {"one": {"name": "red"}, "other": {"name": "red"}}}
        )
