"""Crowds: neighbours, pairs, decisions of many at once, bodies of different pairs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kumite.errors import KumiteError
from kumite.graph import Layer
from kumite.kernels import crowd as kernels
from kumite.kernels import near
from kumite.scene import (
    SceneSettings,
    World,
    load_scene,
    measure,
    policy_fighter,
    record,
    with_count,
)
from kumite.scene import memory as memory_module
from kumite.scene.events import Strike
from kumite.scene.pairs import pair_up


def _hash(place: np.ndarray) -> near.Hash:
    count = len(place)
    buckets = 1 << max(3, int(2 * count - 1).bit_length())
    grid = near.Hash(
        np.zeros(buckets + 1, np.int32), np.zeros(count, np.int32), np.zeros((count, 2), np.int32)
    )
    near.fill_hash(place, grid)
    return grid


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 60), st.floats(0.5, 30))
def test_neighbours_are_those_of_brute_force(seed, count, spread):
    rng = np.random.default_rng(seed)
    place = rng.uniform(-spread, spread, (count, 3))
    place[rng.integers(count)] = place[rng.integers(count)]  # two on one spot now and then
    grid = _hash(place)
    assert sorted(grid.item.tolist()) == list(range(count))
    for k in range(count):
        found = np.empty(4, dtype=np.int64)
        n = near.nearest(k, place, 2.0, grid, found)
        gap = np.hypot(*(place[:, [0, 2]] - place[k, [0, 2]]).T)
        others = [j for j in np.lexsort((np.arange(count), gap)) if j != k and gap[j] <= 2.0]
        assert found[:n].tolist() == others[:4]


def test_draws_are_even_and_each_has_its_own():
    seed = np.array([1, 2], dtype=np.uint64)
    first = [kernels.draw(seed, 0, 5) for _ in range(5000)]
    second = [kernels.draw(seed, 1, 5) for _ in range(5000)]
    assert np.abs(np.bincount(first, minlength=5) / 5000 - 0.2).max() < 0.03
    assert np.mean(np.array(first) == np.array(second)) < 0.25


def test_pairs_are_the_nearest_who_are_free():
    line = np.array([[0.0, 0.0], [1.0, 0.0], [1.9, 0.0], [5.0, 0.0], [5.5, 0.0]])
    nobody = np.full(5, -1)
    # 3 and 4 are nearest, then 1 and 2; 0 is left over and aims at 1.
    assert pair_up(line, nobody).tolist() == [1, 2, 1, 4, 3]
    # A pair that is near each other stays, though 2 is nearer to 1 than 0 is.
    assert pair_up(line, np.array([1, 0, -1, 4, 3])).tolist() == [1, 0, 1, 4, 3]
    # A pair that has lost each other does not.
    far = line.copy()
    far[0] = [-9.0, 0.0]
    assert pair_up(far, np.array([1, 0, -1, 4, 3])).tolist() == [1, 2, 1, 4, 3]


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.integers(2, 50))
def test_everyone_has_an_opponent_and_pairs_are_mutual(seed, count):
    ground = np.random.default_rng(seed).uniform(-5, 5, (count, 2))
    opponent = pair_up(ground, np.full(count, -1))
    assert np.all((opponent >= 0) & (opponent < count) & (opponent != np.arange(count)))
    mutual = opponent[opponent] == np.arange(count)
    assert (~mutual).sum() <= count % 2


def test_thirty_boxers_fight_each_with_the_nearest(library: Layer):
    scene = World(load_scene("crowd"), library, seed=1)
    fight = record(scene, 20.0)
    found = measure(fight)
    assert len(found.characters) == 30
    assert sum(c.landed > 0 for c in found.characters) >= 26
    assert all(c.thrown > 0 for c in found.characters)
    assert found.min_separation_m is not None and found.min_separation_m > 0.25
    assert max(c.join_jump_m_s for c in found.characters) < 0.6
    opponent = scene.floor.opponent
    assert np.array_equal(opponent[opponent], np.arange(30))
    # Nobody stands still: every one takes actions all the time.
    assert min(c.joins for c in found.characters) >= 3


def test_many_at_once_are_as_one_after_the_other(library: Layer, monkeypatch: pytest.MonkeyPatch):
    """The kernel on all cores gives the bytes of the one that is not."""
    frames = []
    for many in (2, 10**6):
        monkeypatch.setattr(policy_fighter, "MANY", many)
        scene = World(with_count(load_scene("crowd"), 20), library, seed=3)
        for _ in range(60):
            scene.step()
        frames.append((scene.cast.frame.copy(), scene.wxyz.copy()))
    assert np.array_equal(frames[0][0], frames[1][0])
    assert frames[0][1].tobytes() == frames[1][1].tobytes()


def test_one_who_aims_at_the_nearest_among_named_ones_aims_at_another(library: Layer):
    characters = [
        {"name": "a", "position": (0, 0), "aims_at": "b"},
        {"name": "b", "position": (0, 1.2), "aims_at": "a"},
        {"name": "third", "position": (0, 2.6), "aims_at": "nearest"},
    ]
    scene = World(
        SceneSettings.model_validate({"title": "three", "character": characters}), library, seed=0
    )
    assert scene.floor.opponent.tolist() == [1, 0, 1]
    for _ in range(int(10 * scene.fps)):
        scene.step()
    assert any(isinstance(e, Strike) and e.character == "third" for e in scene.events)


def test_bodies_of_different_pairs_keep_apart(library: Layer):
    """Two pairs put into each other: the other pair is minded too, not the opponent alone."""
    corners = [(0.0, -0.6), (0.0, 0.6), (0.35, -0.6), (0.35, 0.6)]
    characters = [
        {"name": f"c{k}", "position": p, "yaw_deg": 180.0 * (k % 2), "aims_at": f"c{k ^ 1}"}
        for k, p in enumerate(corners)
    ]
    scene = World(
        SceneSettings.model_validate({"title": "two pairs", "character": characters}),
        library,
        seed=0,
    )
    gaps = []
    for _ in range(int(20 * scene.fps)):
        scene.step()
        ground = scene.root_position[:, [0, 2]]
        gaps.append(np.linalg.norm(ground[[0, 1]] - ground[[2, 3]], axis=1).min())
    late = np.array(gaps[int(5 * scene.fps) :])
    assert late.min() > 0.25 and np.median(late) > 0.45


def test_counts_that_make_no_sense_or_do_not_fit_are_refused(library: Layer, monkeypatch):
    crowd = load_scene("crowd")
    with pytest.raises(KumiteError, match="expected a scene with a"):
        with_count(load_scene("sparring"), 5)
    with pytest.raises(KumiteError, match="expected at least 2"):
        with_count(crowd, 1)
    with pytest.raises(KumiteError, match=r"do not fit into memory; at most \d+ do"):
        World(with_count(crowd, 10**9), library)
    monkeypatch.setattr(memory_module, "free_memory", lambda: 20e6)
    fits = memory_module.most_characters(len(library.clips.skeleton))
    assert 100 < fits < 10_000
    World(with_count(crowd, 30), library)
    with pytest.raises(KumiteError, match="30 characters with 6000 recorded frames do not fit"):
        record(World(crowd, library), 100.0)
