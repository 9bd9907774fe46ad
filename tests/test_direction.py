"""Fighters are told things while they fight: their next decision goes by it."""

from __future__ import annotations

import numpy as np
import pytest

from kumite.control import CheckPoint, Route
from kumite.control.game_tree import OUTSIDE, Player
from kumite.control.routes import through
from kumite.control.styles import NAMES
from kumite.errors import KumiteError
from kumite.graph import Layer
from kumite.scene import SceneSettings, World, load_scene
from kumite.scene.controls import OrderControl
from kumite.scene.events import CheckPointMissed, CheckPointReached, Decision, Strike


def fight(fighters: Layer, *, seed: int = 0, depth: int = 1, **red) -> World:
    """Boxing at a small depth, with something of red's changed."""
    settings = load_scene("boxing").model_dump(exclude_none=True)
    for fighter in settings["fighter"]:
        fighter["depth"] = depth
    settings["fighter"][0].update(red)
    return World(SceneSettings.model_validate(settings), fighters, seed=seed)


def run(scene: World, seconds: float) -> list:
    """What red decides meanwhile."""
    count = len(scene.events)
    for _ in range(round(seconds * scene.fps)):
        scene.step()
    new = scene.events[count:]
    return [e for e in new if isinstance(e, Decision) and e.character == "red"]


def order(scene: World, field: str) -> OrderControl:
    return next(o for o in scene.orders_of(0) if o.field == field)


def share(scene: World, decisions: list, name: str) -> float:
    """Of decisions that were for a kind or label."""
    tree = scene.tree
    of = [(tree.kinds[e.stretch], tree.labels[e.stretch]) for e in decisions]
    return float(np.mean([name in names for names in of]))


def test_every_weight_can_be_tuned(fighters: Layer):
    scene = fight(fighters)
    controls = {c.field: c for c in scene.tunables if c.who == "red"}
    assert set(controls) == {*NAMES, "depth", "boredom", "restlessness", "facing_deg"}
    assert controls["facing"].value == scene.players[0].style.facing == 10.0
    for field, control in controls.items():
        value = control.minimum + 0.25 * (control.maximum - control.minimum)
        control.set(value)
        assert control.value == pytest.approx(round(value) if field == "depth" else value)
        with pytest.raises((KumiteError, ValueError, OverflowError)):
            control.set(float("nan"))
    player = scene.players[0]
    assert player.style.preferred_heading == pytest.approx(np.radians(-90.0))
    assert {c.name for c in scene.tunables} >= {"red: tree: depth", "blue: tree: place"}


def test_a_heading_brings_its_weight_and_the_weight_a_heading(fighters: Layer):
    scene = fight(fighters)
    red, blue = ({c.field: c for c in scene.tunables if c.who == who} for who in ("red", "blue"))
    red["preferred_heading"].set(90.0)
    blue["heading"].set(20.0)
    assert red["heading"].value == 10.0 and blue["preferred_heading"].value == 0.0
    red["heading"].set(1e4)
    run(scene, 1.0)
    off = [
        abs(np.angle(np.exp(1j * (scene.cast.facing[0, 2] - np.pi / 2))))
        for _ in range(300)
        if scene.step()
    ]
    assert np.mean(off[-150:]) < np.pi / 3  # +X, though the opponent is not there


def test_wanted_and_unwanted_count_from_the_next_decision(fighters: Layer):
    scene = fight(fighters)
    assert share(scene, run(scene, 8.0), "attack") > 0.5
    order(scene, "unwanted").set(["attack"])
    assert share(scene, run(scene, 8.0), "attack") < 0.2
    order(scene, "unwanted").set([])
    order(scene, "wanted").set(["idle"])
    assert share(scene, run(scene, 8.0), "idle") > 0.8


def test_only_the_action_set_is_chosen_and_what_is_not_says_so(fighters: Layer):
    scene = fight(fighters, depth=2)
    run(scene, 3.0)
    order(scene, "only").set(["transition"])
    for e in run(scene, 6.0):
        inside = scene.tree.kinds[e.stretch] == "transition"
        assert inside != e.outside_set
        assert abs(e.comp) < 0.5 * OUTSIDE  # what leaving the set costs is no score
    order(scene, "only").set(["left_hand_straight"])
    decided = run(scene, 8.0)
    assert {True, False} == {e.outside_set for e in decided}
    order(scene, "only").set([])
    assert not any(e.outside_set for e in run(scene, 3.0))


def test_the_scene_file_gives_the_action_set(fighters: Layer):
    scene = fight(fighters, only=["transition", "idle"])
    for e in run(scene, 5.0):
        inside = scene.tree.kinds[e.stretch] in ("transition", "idle")
        assert inside != e.outside_set


def test_what_is_refused_leaves_all_as_it_was(fighters: Layer):
    scene = fight(fighters, unwanted=["attack"])
    kinds = set(scene.tree.kinds) - {"reaction"}
    for field, names, said in (
        ("unwanted", kinds, "red: A⁻ holds every action"),
        ("wanted", ["flying_kick"], "red: no action is called 'flying_kick'"),
        ("only", ["reaction"], r"red: the action set \(reaction\) holds no action"),
    ):
        before = order(scene, field).value
        with pytest.raises(KumiteError, match=said):
            order(scene, field).set(names)
        assert order(scene, field).value == before
    with pytest.raises(KumiteError, match="red at check point 0: A⁻ holds every action"):
        scene.set_route("red", Route((CheckPoint((0, 0), refuse=tuple(kinds - {"attack"})),)))
    with pytest.raises(KumiteError, match=r"character 'rde'.*red"):
        scene.set_route("rde", None)
    with pytest.raises(KumiteError, match="red has no route"):
        scene.move_check_point("red", 0, (0.0, 0.0))
    assert scene.routes == [None, None] and run(scene, 2.0)
    scene.set_route("red", Route((CheckPoint((0, 0), refuse=("idle",)),)))
    with pytest.raises(KumiteError, match="red at check point 0: A⁻ holds every action"):
        order(scene, "unwanted").set(kinds - {"idle"})
    with pytest.raises(KumiteError, match="check point 1; expected 0 to 0"):
        scene.move_check_point("red", 1, (0.0, 0.0))
    with pytest.raises(KumiteError, match="restlessness -1"):
        Player(restlessness=-1.0)


def test_a_route_is_followed_from_when_it_is_given(fighters: Layer):
    scene = fight(fighters, depth=2)
    run(scene, 4.0)
    x, _, z = scene.root_position[0]
    places = [(x + 1.0, z), (x + 2.0, z)]
    scene.set_route("red", through(places, 6.0, start=(x, z)))
    progress = scene.progress[0]
    assert progress is not None
    times = [p.time for p in progress.route.points]
    assert times == pytest.approx([scene.frame / scene.fps + t for t in (3.0, 6.0)])
    run(scene, 12.0)
    reached = [e for e in scene.events if isinstance(e, CheckPointReached)]
    assert [e.point for e in reached] == [0, 1]
    scene.set_route("red", None)
    assert scene.progress[0] is None and run(scene, 2.0)
    assert not [e for e in scene.events if isinstance(e, CheckPointMissed) and e.point > 1]


def test_a_check_point_is_moved_and_what_is_done_stays_done(fighters: Layer):
    scene = fight(fighters)
    x, _, z = scene.root_position[0]
    scene.set_route("red", through([(x, z), (x + 9.0, z), (x + 12.0, z)]))
    run(scene, 1.0)
    progress = scene.progress[0]
    assert progress is not None and progress.index == 1
    scene.move_check_point("red", 1, (x + 1.5, z))
    assert progress.index == 1 and progress.goal(9.0) == (x + 1.5, z)
    run(scene, 9.0)
    assert [e.point for e in scene.events if isinstance(e, CheckPointReached)] == [0, 1]
    scene.reset(0)  # what was told stays told
    assert scene.progress[0] is not None
    assert scene.progress[0].route.points[1].place == (x + 1.5, z)


def test_told_the_same_the_same_seed_gives_the_same_bytes(fighters: Layer):
    def told() -> World:
        scene = fight(fighters, seed=4)
        run(scene, 2.0)
        scene.set_route("red", through([(1.0, 1.0), (2.0, 0.0)], 5.0))
        run(scene, 2.0)
        order(scene, "only").set(["transition", "attack"])
        run(scene, 2.0)
        return scene

    a, b = told(), told()
    assert a.wxyz.tobytes() == b.wxyz.tobytes() and a.events == b.events
    silent = fight(fighters, seed=4)
    run(silent, 6.0)
    assert silent.events != a.events


def test_where_a_fighter_is_sent_it_goes_and_fights_on(fighters: Layer):
    """In a style that says nothing of paths; from any side, on seeds that nobody chose."""
    blows = 0
    for seed in (3, 8):
        scene = fight(fighters, seed=seed, depth=2)
        run(scene, 2.0)
        x, _, z = scene.root_position[0]
        away = 2.5 * np.array([np.sin(2.5 * seed), np.cos(2.5 * seed)])
        scene.set_route("red", through([(x + away[0], z + away[1])]))
        progress, begin = scene.progress[0], scene.frame
        assert progress is not None
        while not progress.done:
            assert scene.frame - begin < 25.0 * scene.fps
            run(scene, 0.5)
        blows += sum(isinstance(e, Strike) and e.frame > begin for e in scene.events)
    assert blows > 0
