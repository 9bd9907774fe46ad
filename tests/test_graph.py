"""Components, folding and the library file, on graphs worked out by hand and on the performer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kumite import files
from kumite.annotate import Contacts, find_contacts, find_strikes
from kumite.clip import Clip, concatenate
from kumite.errors import KumiteError
from kumite.graph import (
    Layer,
    Transitions,
    build_frames,
    find_transitions,
    fold,
    load_library,
    save_library,
)
from kumite.graph import strongest_component as component
from kumite.graph.library_file import VERSION
from kumite.rotation import planar_apply, planar_compose, planar_inverse
from tests import reference, toys
from tests.shared import only


def transitions(pairs: list[tuple[int, int]]) -> Transitions:
    source, target = (np.array(c, dtype=np.int32) for c in zip(*pairs))
    return Transitions(source, target, np.full(len(pairs), 0.5, np.float32), 0.5, len(pairs))


def test_folding_a_graph_worked_by_hand():
    # One clip of 10 frames; from 4 back to 2, from 8 back to 2 and to 6. Frames 0 and 1 cannot be
    # come back to, 9 cannot be left: kept are 2..8.
    clips = toys.clip_set([10])
    jumps = transitions([(4, 2), (8, 2), (8, 6)])
    kept = component(clips, jumps)
    assert list(np.flatnonzero(kept)) == [2, 3, 4, 5, 6, 7, 8]
    table = fold(clips, jumps, kept)
    assert list(table.state_frame) == [4, 8]
    # State 4 goes on to 5..8 or back to 2..4; state 8 goes to 2..4 or 6..8.
    assert list(table.action_start) == [0, 2, 4]
    assert list(table.first) == [2, 5, 6] and list(table.last) == [4, 8, 8]
    assert list(table.target) == [0, 1, 1] and list(table.duration) == [3, 4, 3]
    assert list(table.stretch) == [0, 1, 0, 2]
    assert list(table.join_cost) == [0.5, 0.0, 0.5, 0.5]


def test_a_frame_whose_only_way_out_is_a_jump_is_a_state():
    clips = toys.clip_set([5])
    jumps = transitions([(4, 1), (2, 1)])
    table = fold(clips, jumps, component(clips, jumps))
    assert list(table.state_frame) == [2, 4]
    assert list(np.diff(table.action_start)) == [2, 1]


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.lists(st.integers(2, 9), min_size=1, max_size=4))
def test_components_equal_the_twin(seed, lengths):
    clips = toys.clip_set(lengths)
    count = len(clips)
    rng = np.random.default_rng(seed)
    pairs = [tuple(rng.integers(0, count, 2).tolist()) for _ in range(int(rng.integers(1, 8)))]
    jumps = transitions(pairs)
    edges: dict[int, list[int]] = {}
    for f in range(count - 1):
        if clips.clip_of_frame[f] == clips.clip_of_frame[f + 1]:
            edges.setdefault(f, []).append(f + 1)
    for i, j in pairs:
        edges.setdefault(i, []).append(j)
    expected = reference.largest_component(edges, range(count))
    found = set(np.flatnonzero(component(clips, jumps)).tolist())
    assert len(found) == len(expected)
    for n in found:  # a largest one, if not the same one
        assert found <= reference.reachable(edges, n)


def test_too_short_clips_are_refused():
    with pytest.raises(KumiteError, match="too few frames for a graph"):
        build_frames(toys.clip_set([3]))
    with pytest.raises(KumiteError, match="too few frames for a graph"):
        build_frames(toys.clip_set([3]), event="none")


def test_no_dead_ends_and_every_action_plays_captured_frames(library: Layer):
    table, clips = library.table, library.clips
    assert np.all(np.diff(table.action_start) >= 1)
    assert np.all(table.duration >= 1)
    assert np.all(clips.clip_of_frame[table.first] == clips.clip_of_frame[table.last])
    assert np.array_equal(table.state_frame[table.target], table.last)
    # Inside an action there is no state: that is what folding means.
    for first, last in zip(table.first, table.last):
        inside = (table.state_frame >= first) & (table.state_frame < last)
        assert not inside.any()
    # From every state every other one is reached.
    edges = {
        s: table.target[table.stretch[table.actions_of(s)]].tolist() for s in range(table.states)
    }
    everything = set(range(table.states))
    for s in (0, table.states // 2, table.states - 1):
        assert reference.reachable(edges, s) == everything


def test_displacements_carry_the_facing_frame(library: Layer):
    table, facing = library.table, library.clips.facing
    for k in range(0, len(table.first), 7):
        before, after = facing[table.first[k] - 1], facing[table.last[k]]
        assert np.allclose(planar_compose(before, table.displacement[k])[:2], after[:2], atol=1e-9)
        point = np.array([0.3, 1.0, 0.8])
        there = planar_apply(planar_inverse(table.displacement[k]), point)
        world = planar_apply(before, point)
        assert np.allclose(planar_apply(after, there), world, atol=1e-9)


def test_library_file_round_trips(library: Layer, tmp_path):
    path = tmp_path / "a.kumite"
    save_library(path, library)
    back = only(load_library(path))
    assert back.digest == library.digest and back.report == library.report
    assert back.clips.names == library.clips.names
    assert back.clips.skeleton.same_as(library.clips.skeleton)
    save_library(tmp_path / "b.kumite", back)
    assert path.read_bytes() == (tmp_path / "b.kumite").read_bytes()


def test_a_library_with_shapes_that_do_not_fit_is_damaged(library: Layer, tmp_path):
    path = tmp_path / "bad.kumite"
    clips = replace(
        library.clips, clip_start=np.array([0, 5, len(library.clips)]), names=("a", "b")
    )
    save_library(path, replace(library, clips=clips))
    load_library(path)  # two clips, two starts: fits
    object.__setattr__(clips, "names", ("a",))
    save_library(path, replace(library, clips=clips))
    with pytest.raises(KumiteError, match="damaged library"):
        load_library(path)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("table.stretch", 10**6, "an action without a stretch"),
        ("table.target", -1, "a stretch that ends in no state"),
        ("table.first", 0, "a stretch without frames"),
        ("table.action_start", 0, "a state without actions"),
        ("table.displacement", np.nan, "displacement: nan at .*; expected finite"),
        ("strikes.limb", 4, "a blow lies outside the frames or the limbs"),
    ],
)
def test_a_library_whose_numbers_point_nowhere_is_damaged(
    library: Layer, tmp_path, name, value, message
):
    """Kernels follow them without looking: unchecked, they end the process."""
    save_library(tmp_path / "a.kumite", library)
    header, arrays = files.load(tmp_path / "a.kumite", "library", VERSION)
    name = f"frames/{name}"
    wrong = arrays[name].copy()
    wrong[len(wrong) // 2] = value
    files.save(tmp_path / "b.kumite", "library", VERSION, header, {**arrays, name: wrong})
    with pytest.raises(KumiteError, match=f"b.kumite: damaged library .*{message}"):
        load_library(tmp_path / "b.kumite")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("left_out", 3),
        ("left_out", {"why": "x"}),
        ("left_out", {"why": None}),
        ("joins_over_bound", [1]),
        ("targets_over_bound", 7),
        ("targets_over_bound", [1.5]),
        ("mean_join_cost", "low"),
    ],
)
def test_a_report_that_says_no_such_thing_is_damaged(library: Layer, tmp_path, name, value):
    """Reports are shown, and counted with: found by fuzzing."""
    save_library(tmp_path / "a.kumite", library)
    header, arrays = files.load(tmp_path / "a.kumite", "library", VERSION)
    header["layers"]["frames"]["report"][name] = value
    files.save(tmp_path / "b.kumite", "library", VERSION, header, arrays)
    with pytest.raises(KumiteError, match=f"b.kumite: damaged library .*report: {name}"):
        load_library(tmp_path / "b.kumite")


def test_notes_that_do_not_fit_the_clips_are_refused(library: Layer):
    fewer = Contacts(library.contacts.on_ground[1:], library.contacts.resting_height)
    with pytest.raises(KumiteError, match=r"contacts of \d+ frames, clips of"):
        replace(library, contacts=fewer)


def test_building_twice_gives_the_same_library(library: Layer):
    again = build_frames(library.clips)
    assert again.digest == library.digest


def test_notes_of_one_clip_do_not_leak_into_the_next():
    a, b = toys.still(20, name="a"), toys.still(20, name="b")
    far = Clip("b", b.skeleton, 30, b.root_position + np.array([5.0, 0, 0]), b.wxyz)
    clips = concatenate([a, far])
    assert len(find_strikes(clips)) == 0  # the step from clip to clip is no blow
    assert find_contacts(clips).on_ground.all()


@pytest.mark.parametrize("event", ["left", "both"])
def test_a_graph_of_many_frames_is_made_by_the_same_rules(
    library: Layer, monkeypatch: pytest.MonkeyPatch, event: str
):
    """Of many lift-offs only the nearest pairs are kept in memory: shares are of all pairs."""
    takes = list(library.clips)
    found = []
    for count in (len(takes) // 4, len(takes) // 2, len(takes)):
        clips = concatenate(takes[:count])
        contacts = find_contacts(clips)
        plain = find_transitions(clips, contacts, event=event, per_second=200.0)
        with monkeypatch.context() as m:
            m.setattr("kumite.graph.transitions._MANY", 20)
            of_many = find_transitions(clips, contacts, event=event, per_second=200.0)
        for name in ("source", "target", "cost"):
            assert np.array_equal(getattr(plain, name), getattr(of_many, name)), name
        assert (plain.candidates, plain.threshold) == (of_many.candidates, of_many.threshold)
        off = contacts.lift_off(clips.clip_start)
        ways = sum(int(n) * (int(n) - 1) for n in off[:, : 2 if event == "both" else 1].sum(axis=0))
        assert len(plain) >= min(round(200.0 * clips.seconds), round(0.2 * plain.candidates))
        assert plain.candidates <= ways  # of both feet at once one counts
        found.append(len(plain))
    assert found == sorted(set(found))


@pytest.mark.slow
def test_the_real_boxer_gives_a_graph_of_the_papers_size(boxer: Layer):
    r = boxer.report
    assert r["frames"] == 14445
    assert 12_000 <= r["frames_kept"] <= 14_000  # the paper, at half the rate: 6,453
    assert 330 <= r["states"] <= 480  # 437
    assert 20_000 <= r["actions"] <= 30_000  # 27,072
