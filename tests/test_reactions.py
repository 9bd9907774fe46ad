"""What a blow does in a fight: a moment of physics, the response that fits, bodies kept apart."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from kumite.body import keep_out
from kumite.clip import SIDES, forward_kinematics
from kumite.control.game_tree import GameTree
from kumite.errors import KumiteError
from kumite.graph import Layer
from kumite.kernels.blow import NO_BLOW
from kumite.kernels.moves import FIELDS, place_at
from kumite.scene import SceneSettings, World, load_scene, measure, record, world
from kumite.scene.apart import held_apart, near_pairs, push_apart
from kumite.scene.events import Reaction
from kumite.scene.floor import PUSH_SPEED
from kumite.scene.reactions import MOST_PHYSICAL, Reactions
from tests.shared import builtin


@pytest.fixture(scope="module")
def actions() -> Layer:
    """The built-in boxer's actions."""
    return builtin(level="actions")


def _fight(actions: Layer, reactions: str = "auto", seed: int = 1) -> World:
    settings = load_scene("boxing").model_dump(exclude_none=True)
    settings["bout"]["reactions"] = reactions
    return World(SceneSettings.model_validate(settings), actions, seed=seed)


def _until_hit(scene: World, seconds: float = 30.0) -> int:
    """Runs to the frame of the next reaction; who was struck."""
    for _ in range(round(seconds * scene.fps)):
        before = len(scene.events)
        scene.step()
        for e in scene.events[before:]:
            if isinstance(e, Reaction):
                return scene.names.index(e.character)
    raise AssertionError("nobody was struck")


def _left_alone(scene: World, monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on nobody strikes, chooses or pushes."""
    monkeypatch.setattr(world, "push_apart", lambda floor: None)
    monkeypatch.setattr(scene, "_land", lambda landing: None)
    fight = scene.tree_fighter
    monkeypatch.setattr(fight, "decide", lambda k: int(fight.stretch[k]))
    scene.floor.room = scene.floor.room._replace(most=0.0)


@pytest.fixture
def physics() -> None:
    pytest.importorskip("mujoco")


def test_a_blow_moves_the_victim_from_the_next_frame_on(actions: Layer, physics: None):
    found = {}
    for mode in ("physical", "kinematic"):
        scene = _fight(actions, mode)
        k = _until_hit(scene)
        event = [e for e in scene.events if isinstance(e, Reaction)][-1]
        assert event.physical == (mode == "physical") and event.impulse > 0
        assert (event.deviation is None) == (mode == "kinematic")
        at = scene.frame, k, scene.wxyz[k].copy()
        scene.step()
        found[mode] = (*at, scene.wxyz[k].copy())
    one, other = found["physical"], found["kinematic"]
    assert one[:2] == other[:2] and np.array_equal(one[2], other[2])  # the same fight so far
    assert not np.allclose(one[3], other[3], atol=1e-4)


def test_the_moment_is_smooth_and_the_response_follows(
    actions: Layer, physics: None, monkeypatch: pytest.MonkeyPatch
):
    scene = _fight(actions, "physical")
    table, cast, fps = actions.table, scene.cast, scene.fps
    poses = [(scene.root_position.copy(), scene.wxyz.copy())] * 2
    step = scene.step

    def kept() -> bool:
        poses.append((scene.root_position.copy(), scene.wxyz.copy()))
        return step()

    monkeypatch.setattr(scene, "step", kept)
    k = _until_hit(scene)
    event = [e for e in scene.events if isinstance(e, Reaction)][-1]
    moment = scene.reactions._moments[k]
    planted, foot = cast.contacts[k].copy(), [scene.skeleton.joint(f"{s}_foot") for s in SIDES]
    stood = cast.position[k, foot].copy()
    stretch = int(scene.tree_fighter.stretch[k])
    assert scene.tree.kinds[stretch] == "reaction" and stretch == event.stretch
    _left_alone(scene, monkeypatch)
    hit = len(poses)  # the pose of the hit is kept by the next step
    frames = moment.left
    assert cast.held[k] and frames == round(0.2 * fps)
    for _ in range(frames):
        scene.step()
        moved = np.linalg.norm(cast.position[k, foot] - stood, axis=1)
        assert np.all(moved[planted] < 0.01)
        i = moment.shown - 1
        assert np.allclose(cast.root_position[k], moment.pushed.root_position[i], atol=1e-9)
        assert np.array_equal(cast.contacts[k], planted)
    assert (
        not cast.held[k] and cast.frame[k] == moment.entry and cast.stop[k] == table.last[stretch]
    )
    assert 0 <= moment.entry - table.first[stretch] <= 0.25 * fps
    for f in range(cast.frame[k] + 1, table.last[stretch] + 1):
        scene.step()
        assert cast.frame[k] == f
    scene.step()
    position, _ = forward_kinematics(
        scene.skeleton,
        np.array([root[k] for root, _ in poses]),
        np.array([wxyz[k] for _, wxyz in poses]),
    )
    speed = np.linalg.norm(np.diff(position[:, 0], axis=0), axis=1) * fps
    assert np.abs(np.diff(speed))[hit - 2 : hit + frames + 4].max() < 0.6
    # No joint moves further in a frame, at either end, than a fist does.
    assert np.linalg.norm(np.diff(position[hit - 2 :], axis=0), axis=2).max() * fps < 12.0


def test_the_tree_expects_a_struck_fighter_where_it_comes_to(
    actions: Layer, physics: None, monkeypatch: pytest.MonkeyPatch
):
    """What the tree is told of the victim is true in and after the moment, to the end."""
    scene = _fight(actions, "physical", seed=2)
    k = _until_hit(scene)
    table, tree, cast = actions.table, scene.tree, scene.cast
    stretch = int(scene.tree_fighter.stretch[k])
    _left_alone(scene, monkeypatch)
    expected = []
    while not cast.frame[k] >= cast.stop[k]:
        local = int(cast.frame[k] - table.first[stretch] + 1 - scene.reactions.late[k])
        begun = float(scene.frame - local)
        end = begun + float(table.duration[stretch])
        state = tree.state(
            (stretch, int(scene.tree_fighter.stretch[1 - k])),
            (begun, float(scene.frame)),
            (end, float(scene.frame)),
            (cast.facing[k], cast.facing[1 - k]),
            float(scene.frame),
        )
        expected.append((end, *place_at(state, 0, end, tree.moves)))
        assert state[:FIELDS][0] == stretch
        scene.step()
    x, z, yaw = cast.facing[k]
    for end, u, w, turned in expected:
        assert end == scene.frame and np.hypot(u - x, w - z) < 1e-6
        assert np.cos(turned - yaw) > 1 - 1e-9
    assert expected and np.all(scene.reactions.late == 0)


def test_who_is_struck_again_is_pushed_from_where_it_is(actions: Layer, physics: None):
    scene = _fight(actions, "physical")
    k = _until_hit(scene)
    scene.step()
    first = scene.reactions._moments[k]
    scene.floor.blows.part[1 - k, 0] = scene.floor.body.part("head")
    scene.floor.blows.thrown[1 - k, 0] = 0
    (landing,) = scene.floor.landings
    shown = scene.wxyz[k].copy()
    scene._land(landing)
    again = scene.reactions._moments[k]
    assert again is not first and again.left == round(0.2 * scene.fps)
    assert np.array_equal(scene.wxyz[k], shown)
    scene.step()
    assert np.abs(scene.wxyz[k] - shown).max() < 0.2


def test_a_physical_fight_is_the_same_every_time(actions: Layer, physics: None):
    a, b = (record(_fight(actions, "physical"), 15.0) for _ in range(2))
    assert any(isinstance(e, Reaction) and e.physical for e in a.events)
    assert a.wxyz.tobytes() == b.wxyz.tobytes() and a.events == b.events
    assert a.root_position.tobytes() == b.root_position.tobytes()
    assert a.library_frame.min() == -1  # poses of physics are no captured ones
    for c in measure(a).characters:
        assert c.skate_m_s < 0.02 and c.join_jump_m_s < 0.6


def test_without_mujoco_fights_are_kinematic(actions: Layer, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    scene = _fight(actions)
    assert not scene.reactions.physical
    _until_hit(scene)
    (event,) = [e for e in scene.events if isinstance(e, Reaction)]
    assert event.physical is False
    with pytest.raises(KumiteError, match=r"kumite\[physics\]"):
        _fight(actions, "physical")


def test_which_fights_are_physical(actions: Layer, physics: None):
    tree = GameTree(actions)
    assert Reactions(tree, MOST_PHYSICAL).physical
    assert not Reactions(tree, MOST_PHYSICAL + 1).physical
    assert Reactions(tree, MOST_PHYSICAL + 1, "physical").physical
    assert not Reactions(tree, 2, "kinematic").physical
    tree.kinds = tuple("idle" for _ in tree.kinds)
    assert not Reactions(tree, 2).physical
    with pytest.raises(KumiteError, match="a reaction among the actions"):
        Reactions(tree, 2, "physical")
    with pytest.raises(ValueError, match="reactions"):
        _fight(actions, "ragdoll")


# Apart -------------------------------------------------------------------------------------------


def _depth(scene: World) -> float:
    body, cast = scene.floor.body, scene.cast
    parts = [held_apart(body, scene.floor.blows.thrown[k]) for k in range(2)]
    poses = [(cast.position[k], cast.world_wxyz[k]) for k in range(2)]
    return keep_out(body, *poses[0], body, *poses[1], parts=parts[0], other_parts=parts[1]).depth


def test_two_in_each_other_leave_slowly_on_planted_feet(actions: Layer):
    scene = _fight(actions)
    cast = scene.cast
    cast.carry(0, cast.root_position[1, [0, 2]] - cast.root_position[0, [0, 2]] + [0.02, 0.0])
    cast._offsets.foot[0] = 0.0  # it has not come by itself: its feet, too
    cast.show(0.0)
    scene.floor.blows.thrown[:] = NO_BLOW
    depths, places = [_depth(scene)], [cast.root_position.copy()]
    foot = cast.position[:, scene.skeleton.joint("left_foot")].copy()
    for _ in range(15):
        push_apart(scene.floor)
        cast.show(0.0)
        depths.append(_depth(scene))
        places.append(cast.root_position.copy())
    assert depths[0] > 0.05 and depths[-1] < depths[0] - 0.05
    step = np.linalg.norm(np.diff(places, axis=0), axis=2)
    assert step.max() <= 0.5 * PUSH_SPEED / scene.fps + 1e-9
    standing = np.linalg.norm(cast.position[:, scene.skeleton.joint("left_foot")] - foot, axis=1)
    assert standing.max() < 0.01


def test_what_strikes_may_touch(actions: Layer):
    body = _fight(actions).floor.body
    thrown = np.full(4, NO_BLOW)
    assert len(held_apart(body, thrown)) == len(body)
    thrown[0] = 7
    left = {body.parts[p] for p in held_apart(body, thrown)}
    assert set(body.parts) - left == {"left_hand", "left_forearm", "left_upper_arm"}
    roots = np.array([[0.0, 1.0, 0.0], [1.5, 0.2, 0.0], [3.0, 1.0, 0.0], [9.0, 1.0, 0.0]])
    assert near_pairs(roots) == [(0, 1), (1, 2)]
