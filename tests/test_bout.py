"""Fights by game tree: they are what their settings say, and can be told to be others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from kumite.control.game_tree import GameTree, Player
from kumite.errors import KumiteError
from kumite.graph import Layer, build_actions
from kumite.mocap import load
from kumite.scene import SceneSettings, World, load_scene, measure, record
from kumite.scene.events import CheckPointMissed, CheckPointReached, Decision, Hit, Reaction
from tests.shared import builtin


@pytest.fixture(scope="module")
def actions() -> Layer:
    """The built-in boxer's actions."""
    return builtin(level="actions")


def _fight(actions: Layer, **changes) -> World:
    """Boxing with one or the other fighter changed: red={…}, blue={…}."""
    settings = load_scene("boxing").model_dump(exclude_none=True)
    for fighter in settings["fighter"]:
        fighter.update(changes.get(fighter["name"], {}))
    return World(SceneSettings.model_validate(settings), actions, seed=changes.get("seed", 0))


def _run(scene: World, seconds: float) -> np.ndarray:
    """Distances [frames] between the first two while it runs."""
    out = []
    for _ in range(round(seconds * scene.fps)):
        scene.step()
        out.append(np.hypot(*(scene.root_position[0] - scene.root_position[1])[[0, 2]]))
    return np.array(out)


def _landed(scene: World, name: str) -> int:
    return sum(isinstance(e, Hit) and e.character == name and not e.blocked for e in scene.events)


def test_two_fight_and_the_log_says_what_was_looked_at(actions: Layer):
    scene = _fight(actions)
    recording = record(scene, 15.0)
    kinds = {e.kind for e in recording.events}
    assert {"decision", "strike", "hit", "reaction"} <= kinds
    for e in recording.events:
        if isinstance(e, Decision):
            assert e.by == "tree" and e.considered and e.nodes and e.pruned is not None
            assert e.considered >= e.nodes > 1 and 0 <= e.pruned < 1
            assert scene.tree.kinds[e.stretch] != "reaction"  # nobody chooses to be struck
    found = measure(recording)
    assert found.min_separation_m is not None and found.min_separation_m > 0.3
    for c in found.characters:
        assert c.thrown >= c.landed and c.facing_share is not None and c.facing_share > 0.6
        assert c.skate_m_s < 0.02 and c.join_jump_m_s < 0.6


def test_the_real_boxer_fights(mocap: Path):
    real = build_actions(load(mocap / "boxer").clip_set())
    scenes = [_fight(real, seed=seed) for seed in (1, 2)]
    for scene in scenes:
        _run(scene, 15.0)
        for name in scene.names:
            chosen = [e for e in scene.events if isinstance(e, Decision) and e.character == name]
            assert any(scene.tree.kinds[e.stretch] == "attack" for e in chosen)
    assert sum(_landed(s, name) for s in scenes for name in s.names) >= 2


def test_a_blow_that_lands_brings_its_reaction_and_one_that_is_blocked_does_not(actions: Layer):
    scene = _fight(actions, seed=3)
    _run(scene, 15.0)
    hits = [e for e in scene.events if isinstance(e, Hit)]
    reactions = {(e.frame, e.character) for e in scene.events if isinstance(e, Reaction)}
    assert any(not e.blocked for e in hits)
    struck = {(e.frame, e.victim) for e in hits if not e.blocked}
    assert reactions == struck


def test_who_has_waited_long_attacks_though_it_may_miss(actions: Layer):
    scene = _fight(actions)
    tree, player = scene.tree, scene.players[0]
    calm = [k for k, kind in enumerate(tree.kinds) if kind in ("idle", "transition")][:8]
    tired = tree.game((player, player), tuple(calm)).tired
    kind = np.array(tree.kinds)
    assert set(tired[kind == "attack"]) == {0.0}
    assert set(tired[calm]) == {player.boredom + 8 * player.restlessness}
    fresh = np.setdiff1d(np.flatnonzero(np.isin(kind, ("idle", "transition"))), calm)
    assert set(tired[fresh]) == {8 * player.restlessness}


def test_the_same_seed_gives_the_same_fight(actions: Layer):
    def fight(seed: int) -> World:
        scene = _fight(actions, seed=seed)
        _run(scene, 6.0)
        return scene

    a, b, c = fight(1), fight(1), fight(2)
    assert a.wxyz.tobytes() == b.wxyz.tobytes() and a.events == b.events
    assert a.wxyz.tobytes() != c.wxyz.tobytes()
    a.reset(2)
    _run(a, 6.0)
    assert a.wxyz.tobytes() == c.wxyz.tobytes() and a.events == c.events


def test_infighters_are_nearer_than_those_who_keep_away(actions: Layer):
    inside = {"style": "infighter"}
    far_off = {"style": "outboxer"}
    for seed in (1, 2):
        near = _run(_fight(actions, red=inside, blue=inside, seed=seed), 20.0)
        far = _run(_fight(actions, red=far_off, blue=far_off, seed=seed), 20.0)
        assert near[120:].mean() + 0.3 < far[120:].mean()


@pytest.mark.slow
def test_who_looks_further_ahead_lands_more(actions: Layer):
    wins = 0
    for seed in range(3):
        scene = _fight(actions, red={"depth": 3}, blue={"depth": 1}, seed=seed)
        _run(scene, 30.0)
        wins += _landed(scene, "red") > _landed(scene, "blue")
    assert wins >= 2


def test_weights_and_depth_count_from_the_next_decision(actions: Layer):
    scene = _fight(actions, red={"style": "infighter"}, blue={"style": "infighter"})
    controls = {f"{c.who}: {c.field}": c for c in scene.tunables}
    _run(scene, 6.0)
    for name in ("red", "blue"):
        controls[f"{name}: preferred_distance"].set(3.0)
        for field in ("given_short", "given_long", "taken"):
            controls[f"{name}: {field}"].set(0.0)
        controls[f"{name}: depth"].set(2)
    assert scene.players[0].depth == 2 and scene.players[1].style.preferred_distance == 3.0
    assert _run(scene, 8.0)[-60:].mean() > 2.0


def test_a_pair_follows_check_points_and_says_what_it_missed(actions: Layer):
    path = {
        "path": {"shape": "line", "centre": (0, 0), "end": (3.0, 0), "points": 4, "radius": 0.6},
        "style": "boxer_path",
        "depth": 2,
    }
    far = {"style": "boxer_path", "depth": 2}
    far["point"] = [{"place": (40.0, 0.0), "time": 5.0}]
    scene = _fight(actions, red=path, blue=far)
    _run(scene, 25.0)
    reached = [e.point for e in scene.events if isinstance(e, CheckPointReached)]
    assert reached == list(range(len(reached))) and len(reached) >= 2
    (missed,) = [e for e in scene.events if isinstance(e, CheckPointMissed)]
    assert missed.character == "blue" and missed.due == 5.0 and missed.distance > 20.0


def test_each_check_point_that_is_missed_is_told_though_one_before_it_was_reached_late(
    actions: Layer,
):
    late = [{"place": (0.0, 0.0), "time": 0.5, "radius": 20.0, "require": ["defence"]}]
    far = [{"place": (40.0, 0.0), "time": t} for t in (6.0, 8.0)]
    scene = _fight(actions, red={"point": late + far, "depth": 1})
    _run(scene, 9.0)
    told = [e.point for e in scene.events if isinstance(e, CheckPointMissed)]
    assert told == [0, 1, 2]
    (reached,) = [e for e in scene.events if isinstance(e, CheckPointReached)]
    assert reached.point == 0 and reached.late_by > 0


def test_two_share_a_check_point_by_the_middle_between_them(actions: Layer):
    """It is reached though neither is there, and each is to stand on its own side of it."""
    middle = np.array([0.3, 0.1])
    for shared in (True, False):
        point = {"place": tuple(middle), "time": 20.0, "radius": 0.2, "middle": shared}
        red = {"point": [point], "position": (0.3, 0.8)}
        scene = _fight(actions, red=red, blue={"point": [point], "position": (0.3, -0.6)})
        goals = [scene.tree_fighter._player(k).goal for k in range(2)]
        place = scene.root_position[:, [0, 2]]
        for k, goal in enumerate(goals):
            assert goal is not None
            aside = (place[k] - place[1 - k]) / np.linalg.norm(place[k] - place[1 - k])
            half = 0.5 * scene.players[k].style.preferred_distance
            assert np.allclose(goal, middle + shared * half * aside)
        scene.step()
        arrived = [p is not None and p.arrived is not None for p in scene.progress]
        assert arrived == [shared, shared]


def test_wrong_fights_are_refused(actions: Layer, library: Layer):
    with pytest.raises(KumiteError, match="no layer 'actions'"):
        World(load_scene("boxing"), library)
    with pytest.raises(KumiteError, match="no action is called 'flying_kick'"):
        _fight(actions, red={"wanted": ["flying_kick"]})
    with pytest.raises(KumiteError, match="A⁻ holds every action"):
        _fight(actions, red={"unwanted": ["attack", "defence", "transition", "idle"]})
    with pytest.raises(ValueError, match=r"style 'infigter'.*infighter"):
        _fight(actions, red={"style": "infigter"})
    with pytest.raises(ValueError, match="weight of a style 'strenght'"):
        _fight(actions, red={"style": {"strenght": 2.0}})
    with pytest.raises(ValueError, match="red is against 'green'"):
        _fight(actions, red={"against": "green"})
    with pytest.raises(KumiteError, match="expected 1 to"):
        Player(depth=0)


def test_decisions_are_those_of_the_whole_tree(actions: Layer):
    """What bounds skip changes no decision."""
    tree = GameTree(actions)
    scene = _fight(actions, seed=5)
    for _ in range(6):
        _run(scene, 1.0)
        k = int(scene.cast.waiting[0]) if len(scene.cast.waiting) else 0
        state = tree.state(
            (int(scene.tree_fighter.stretch[k]), int(scene.tree_fighter.stretch[1 - k])),
            (-60.0, -30.0),
            (0.0, 20.0),
            (scene.cast.facing[k], scene.cast.facing[1 - k]),
            0.0,
        )
        players = (Player(depth=2), Player(depth=2))
        some, whole = (tree.decide(state, players, bounds=b) for b in (True, False))
        assert (some.stretch, some.comp) == (whole.stretch, pytest.approx(whole.comp))
        assert some.nodes.sum() <= whole.nodes.sum()
