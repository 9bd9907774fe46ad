"""The action-level graph: nodes of postures, edges of whole actions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from kumite.annotate import DIRECTIONS, KINDS, NO_LIMB, Actions
from kumite.clip import Clip, ClipSet, concatenate
from kumite.errors import KumiteError
from kumite.graph import Layer, build_actions, load_library, pose_features, save_library
from kumite.graph.whole import MOST_WAYS, SHAKEN, _recovered
from kumite.rotation import from_axis_angle, planar_compose
from kumite.scene import CharacterMetrics, Recording, measure
from kumite.scene.metrics import source_skate
from kumite.synthesis import Cast
from tests import reference, toys
from tests.shared import only

HOLD, MOVE = 4, 8  # frames that a toy's posture is held at each end, and that it moves in between
POSTURES = {"a": 0.0, "b": 0.6, "c": 1.6, "x": 3.0}  # rad, of the left arm


def toy(takes: list[tuple[str, str]]) -> tuple[ClipSet, Actions]:
    """A clip a take, ``"abc"`` going from posture a to b to c; actions in it by kind, in order."""
    clips, kinds, parts, at = [], [], [], 0
    for number, (way, kind) in enumerate(takes):
        s = toys.skeleton()
        angle = []
        for one, other in zip(way, way[1:]):
            ramp = np.linspace(POSTURES[one], POSTURES[other], MOVE)
            angle += [POSTURES[one]] * HOLD + ramp.tolist() + [POSTURES[other]] * HOLD
            parts.append((at, at + 2 * HOLD + MOVE))
            kinds.append(kind)
            at += 2 * HOLD + MOVE
        still = toys.still(len(angle), name=f"take{number}")
        wxyz = still.wxyz.copy()
        wxyz[:, s.joint("left_upper_arm")] = from_axis_angle([0.0, 0.0, 1.0], np.array(angle))
        clips.append(Clip(still.name, s, still.fps, still.root_position, wxyz))
    way = {kind: DIRECTIONS.index(d) for kind, d in FIRST_WAY.items()}
    start, stop = np.array(parts).T
    found = concatenate(clips)
    return found, Actions(
        start,
        stop,
        np.array([KINDS.index(k) for k in kinds]),
        np.full(len(kinds), NO_LIMB),
        np.array([way[k] for k in kinds]),
        tuple(f"{kind} {i}" for i, kind in enumerate(kinds)),
        found.clip_start,
    )


FIRST_WAY = {
    "attack": "straight",
    "defence": "duck",
    "transition": "forward",
    "reaction": "hit",
    "idle": "none",
}
RING = [
    ("ab", "attack"),  # 0
    ("bc", "defence"),  # 1
    ("ca", "transition"),  # 2
    ("aa", "idle"),  # 3
    ("bb", "reaction"),  # 4: nobody chooses it, but it leads on
    ("ax", "attack"),  # 5: from x nothing goes on
]


def test_a_graph_worked_by_hand():
    clips, actions = toy(RING)
    library = build_actions(clips, actions, alike=0.3)
    table = library.table
    assert library.report["nodes"] == 3
    assert library.action_of_stretch.tolist() == [0, 1, 2, 3, 4]
    assert table.state_frame.tolist() == [15, 31, 47, 63, 79]
    # A clip's first action is entered from the clip's first frame, and plays from the second.
    assert table.first.tolist() == [1, 17, 33, 49, 65]
    assert table.last.tolist() == [15, 31, 47, 63, 79]
    offered = [table.stretch[table.actions_of(s)].tolist() for s in range(table.states)]
    at_a, at_b, at_c = [0, 3], [1], [2]
    assert offered == [at_b, at_c, at_a, at_a, at_b]
    assert table.target.tolist() == [0, 1, 2, 3, 4]
    assert library.report["mean_ways_out"] == pytest.approx(7 / 5)
    assert [library.report[f"{k}s"] for k in KINDS] == [1, 1, 1, 1, 1]


def test_what_follows_in_the_capture_follows_without_a_join():
    clips, actions = toy([("aba", "attack"), ("aba", "defence")])
    library = build_actions(clips, actions, alike=0.3)
    table = library.table
    assert table.first.tolist() == [1, 16, 33, 48]
    costs = {
        (s, int(table.stretch[k])): float(table.join_cost[k])
        for s in range(table.states)
        for k in range(table.action_start[s], table.action_start[s + 1])
    }
    assert set(costs) == {(0, 1), (0, 3), (1, 0), (1, 2), (2, 1), (2, 3), (3, 0), (3, 2)}
    assert costs[0, 1] == costs[2, 3] == 0.0
    assert max(costs.values()) < 1e-3  # the same postures, and all are at rest in them


def test_a_larger_distance_makes_fewer_nodes():
    clips, actions = toy(RING)
    found = [build_actions(clips, actions, alike=a).report for a in (0.3, 0.8, 5.0)]
    assert [r["nodes"] for r in found] == [3, 2, 1]
    assert found[-1]["stretches"] == 6  # all in one: x is no dead end any more


@pytest.mark.parametrize("alike", [0.0, -1.0, np.nan, np.inf])
def test_a_distance_that_makes_no_sense(alike: float):
    with pytest.raises(KumiteError, match=r"alike .*; expected more than 0 rad"):
        build_actions(*toy(RING), alike=alike)


def test_too_few_actions():
    with pytest.raises(KumiteError, match="of 1 found, 1 are connected and can be chosen"):
        build_actions(*toy([("aa", "idle")]))
    with pytest.raises(KumiteError, match="of 2 found, 0 are connected"):
        build_actions(*toy([("ab", "attack"), ("cx", "attack")]), alike=0.3)
    with pytest.raises(KumiteError, match="of 2 found, 0 are connected"):
        build_actions(*toy([("ab", "reaction"), ("ba", "reaction")]), alike=0.3)
    clips, actions = toy(RING)
    nothing = np.zeros(0, np.int64)
    none = Actions(nothing, nothing, nothing, nothing, nothing, (), clips.clip_start)
    with pytest.raises(KumiteError, match="too few actions for a graph"):
        build_actions(clips, none)
    assert len(actions) == len(RING)


def test_actions_of_other_clips():
    clips, _ = toy(RING)
    _, other = toy(RING[:3])
    with pytest.raises(KumiteError, match="actions: of other clips"):
        build_actions(clips, other)
    library = build_actions(*toy(RING), alike=0.3)
    with pytest.raises(KumiteError, match="its actions are of other clips"):
        replace(library, actions=other)
    assert library.actions is not None
    stop = library.actions.stop.copy()
    stop[0] -= 1
    with pytest.raises(KumiteError, match="a stretch is not an action"):
        replace(library, actions=replace(library.actions, stop=stop))


def nodes_of(library: Layer) -> tuple[np.ndarray, np.ndarray]:
    """The node [N] that each state is in and [L] that each stretch starts in, by what is offered.

    A stretch that no state offers is in none: -1.
    """
    table = library.table
    offered = [tuple(table.stretch[table.actions_of(s)].tolist()) for s in range(table.states)]
    sets = sorted(set(offered))
    start = np.full(len(table.first), -1)
    for n, members in enumerate(sets):
        assert np.all(start[list(members)] == -1)  # an action starts in one node
        start[list(members)] = n
    return np.array([sets.index(o) for o in offered]), start


def test_a_reaction_ends_where_both_feet_stand_again():
    _, parts = toy([("aba", "reaction"), ("ab", "attack")])
    one = [0, 2]  # the first two parts are one reaction
    kind, limb, way = parts.kind[one], parts.limb[one], parts.direction[one]
    names, clip_start = ("hit", "blow"), parts.clip_start
    actions = Actions(parts.start[one], parts.stop[1:], kind, limb, way, names, clip_start)
    fps = 20.0
    after = round(SHAKEN * fps)
    on_ground = np.ones((int(actions.stop[-1]), 2), dtype=bool)
    assert np.array_equal(
        _recovered(actions, on_ground, fps).stop, actions.stop
    )  # no foot comes down
    for foot, (up, down) in enumerate([(2, 5), (after + 2, after + 4)]):  # the first: too soon
        on_ground[up:down, foot] = False
    assert _recovered(actions, on_ground, fps).stop.tolist() == [after + 5, actions.stop[1]]


def check_graph(library: Layer) -> None:
    """What must hold of any action-level graph."""
    table, clips, actions = library.table, library.clips, library.actions
    assert actions is not None
    mine = library.action_of_stretch
    # Every stretch is a whole action, without the first frame of a clip: from there it is entered.
    at_start = np.isin(actions.start[mine], clips.clip_start)
    assert np.array_equal(table.first, actions.start[mine] + at_start)
    assert np.array_equal(table.last, actions.stop[mine] - 1)
    assert np.array_equal(table.state_frame[table.target], table.last)
    facing = clips.facing
    there = planar_compose(facing[table.first - 1], table.displacement)
    assert np.allclose(there[:, :2], facing[table.last][:, :2], atol=1e-9)
    # Without a limit, what states of a node offer is the same; no node offers a reaction.
    full = build_actions(clips, actions, most_ways=10**6)
    state, start = nodes_of(full)
    assert len(np.unique(state)) == library.report["nodes"]
    reaction = actions.kind[mine] == KINDS.index("reaction")
    assert np.array_equal(start == -1, reaction)
    # With one, each state offers a part of that: of each label what joins best, and no more.
    assert np.array_equal(full.table.first, table.first)
    word = np.array([actions.label[a] for a in mine])
    for s in range(table.states):
        some, every = (t.stretch[t.actions_of(s)] for t in (table, full.table))
        cost = dict(zip(every.tolist(), full.table.join_cost[full.table.actions_of(s)].tolist()))
        assert set(some.tolist()) <= set(every.tolist())
        assert len(some) == min(len(every), MOST_WAYS)
        for label in np.unique(word[every]).tolist():
            left_out = [
                cost[k] for k in set(every.tolist()) - set(some.tolist()) if word[k] == label
            ]
            taken = [cost[k] for k in some.tolist() if word[k] == label]
            assert not left_out or not taken or max(taken) <= min(left_out)
        if len(np.unique(word[every])) <= MOST_WAYS:
            assert set(word[some].tolist()) == set(word[every].tolist())
    # Postures of one node are alike: on average nearer than asked for, told by the slow twin.
    features = pose_features(clips)
    for n in range(state.max() + 1):
        frames = np.unique(
            np.concatenate([table.state_frame[state == n], table.first[start == n] - 1])
        )
        if len(frames) > 60:
            frames = frames[:: len(frames) // 60]  # a sample: hence the tenth of room below
        f = features.take(frames)
        square = reference.distances(f.quaternion, f.weight, f.euclidean)
        pairs = np.sqrt(np.maximum(square, 0.0))[np.triu_indices(len(frames), 1)]
        assert not len(pairs) or pairs.mean() <= 1.1 * library.report["alike"]
    # From everywhere choices lead into one core, in which each action is reached from each, and
    # which no choice leaves. Outside lies what only a blow leads to: reactions, what follows one.
    source = np.repeat(np.arange(table.states), np.diff(table.action_start))
    target = table.target[table.stretch]
    ones = np.ones(len(source))
    edges = coo_array((ones, (source, target)), shape=(table.states, table.states))
    _, part = connected_components(edges.tocsr(), directed=True, connection="strong")
    core = part == np.argmax(np.bincount(part))
    assert not np.any(core[source] & ~core[target])
    onward = {s: target[source == s].tolist() for s in range(table.states)}
    inside = set(np.flatnonzero(core).tolist())
    for s in np.flatnonzero(~core).tolist():
        assert reference.reachable(onward, s) & inside
    assert np.sum(~core[table.target] & ~reaction) <= 0.02 * len(table.first)


def test_the_performers_graph(whole: Layer):
    check_graph(whole)
    r = whole.report
    assert r["stretches"] >= 0.95 * r["actions_found"]
    assert r["mean_ways_out"] > 40
    assert r["reactions"] > 20 and r["attacks"] > 100
    assert r["hits_kept"] >= 0.95 * r["hits"]


def test_the_file_round_trips_with_its_labels(whole: Layer, tmp_path: Path):
    assert whole.actions is not None
    odd = ("a label with 'spaces' and \"quotes\", ü", *whole.actions.label[1:])
    library = replace(whole, actions=replace(whole.actions, label=odd))
    save_library(tmp_path / "a.kumite", library)
    back = only(load_library(tmp_path / "a.kumite"))
    assert back.actions is not None and back.actions.label == odd
    for name in ("start", "stop", "kind", "limb", "direction", "clip_start"):
        assert np.array_equal(getattr(back.actions, name), getattr(whole.actions, name)), name
    assert back.digest == library.digest and back.report == library.report
    save_library(tmp_path / "b.kumite", back)
    assert (tmp_path / "a.kumite").read_bytes() == (tmp_path / "b.kumite").read_bytes()


def test_building_twice_gives_the_same_library(whole: Layer):
    assert build_actions(whole.clips).digest == whole.digest
    assert build_actions(whole.clips, whole.actions).digest == whole.digest


def random_walk(library: Layer, seconds: float, seed: int) -> CharacterMetrics:
    """How a walk by chance over the graph looks, played as in a scene."""
    rng = np.random.default_rng(seed)
    table, fps = library.table, library.clips.fps
    cast = Cast(library, 1)
    cast.place(0, int(rng.integers(table.states)), np.zeros(3))
    cast.show(0.0)
    root, wxyz, contacts, shown = [], [], [], []
    for _ in range(round(seconds * fps)):
        root.append(cast.root_position.copy())
        wxyz.append(cast.wxyz.copy())
        contacts.append(cast.contacts.copy())
        shown.append(cast.frame.copy())
        if len(cast.waiting):
            state = int(np.searchsorted(table.state_frame, cast.frame[0]))
            ways = table.stretch[table.actions_of(state)]
            cast.begin(np.array([0]), np.array([rng.choice(ways)]))
        cast.advance()
    walk = Recording(
        scene="a walk by chance",
        fps=fps,
        skeleton=library.clips.skeleton,
        names=("walker",),
        root_position=np.array(root),
        wxyz=np.array(wxyz),
        contacts=np.array(contacts),
        library_frame=np.array(shown),
        settings={"source_skate_m_s": source_skate(library)},
    )
    return measure(walk).characters[0]


@pytest.mark.slow
def test_the_real_boxers_graph(boxer: Layer):
    """And a walk by chance on it, which looks as one on his graph of frames: there feet skate 0.96
    to 1.30 times as much as in the capture, and the root jumps by 0.22 to 0.30 m/s."""
    library = build_actions(boxer.clips)
    check_graph(library)
    r = library.report
    assert r["stretches"] >= 0.88 * r["actions_found"]
    assert r["mean_ways_out"] > 40
    for walk in (random_walk(library, 60.0, seed) for seed in range(3)):
        assert walk.joins > 30  # else there is nothing to be judged
        assert walk.skate_ratio is not None and walk.skate_ratio <= 1.3  # 1.03 to 1.18
        assert walk.join_jump_m_s <= 0.35  # 0.26 to 0.28
