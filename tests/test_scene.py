"""Scenes: files, sparring, the target, blows, recordings, metrics."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kumite import files
from kumite.body import ARMS
from kumite.clip import concatenate, tip_positions
from kumite.errors import KumiteError
from kumite.graph import Layer, build_frames
from kumite.kernels import blow as kernels
from kumite.kernels import crowd, near
from kumite.performer import perform
from kumite.rotation import from_yaw
from kumite.scene import (
    Playback,
    Recording,
    SceneSettings,
    World,
    builtin_scenes,
    load_recording,
    load_scene,
    measure,
    record,
    save_recording,
)
from kumite.scene.events import Decision, Hit
from kumite.scene.floor import PUSH_SPEED
from kumite.scene.metrics import foot_skate, source_skate
from tests import reference, toys
from tests.telling import event


@pytest.fixture(scope="module")
def sparring(library: Layer) -> World:
    return World(load_scene("sparring"), library, seed=1)


@pytest.fixture(scope="module")
def fight(sparring: World) -> Recording:
    sparring.reset(1)
    return record(sparring, 30.0)


# Blows -------------------------------------------------------------------------------------------


@pytest.mark.jit_off
@settings(max_examples=60, deadline=None)
@given(st.integers(0, 100_000))
def test_swept_contact_equals_brute_force(seed):
    rng = np.random.default_rng(seed)
    p0, p1, a0, a1, b0, b1 = rng.normal(0, 0.6, (6, 3))
    ra, rb, r = rng.uniform(0.05, 0.2, 3)
    expected = reference.first_touch(p0, p1, a0, a1, b0, b1, ra, rb, r)
    t = kernels.swept_contact(p0, p1, a0, a1, b0, b1, ra, rb, r)
    if expected is None:
        assert t == -1.0
    elif t < 0:  # grazing: never deeper than the step allows
        steps = np.linspace(0, 1, 2001)[:, None]
        p, a, b = (u + steps * (v - u) for u, v in ((p0, p1), (a0, a1), (b0, b1)))
        gaps = [kernels.capsule_gap(*x, ra, rb) - r for x in zip(p, a, b)]
        assert min(gaps) > -0.05 * (min(ra, rb) + r)
    else:
        travel = np.linalg.norm(p1 - p0) + max(np.linalg.norm(a1 - a0), np.linalg.norm(b1 - b0))
        # The first step that touches is closed in on; a graze before it may be missed.
        relative = max(np.linalg.norm((p1 - p0) - (a1 - a0)), np.linalg.norm((p1 - p0) - (b1 - b0)))
        assert (t - expected) * relative <= 0.5 * (min(ra, rb) + r)
        assert (expected - t) * travel <= 1e-2


@pytest.mark.parametrize("speed", [1.0, 5.0, 20.0, 100.0, 1000.0])
def test_no_fist_skips_through_a_head_at_any_speed(speed):
    """Straight at the centre, at 30 frames a second: from one side to the other in one frame."""
    step = speed / 30
    p0, p1 = np.array([-step / 2, 0, 0]), np.array([step / 2, 0, 0])
    zero = np.zeros(3)
    t = kernels.swept_contact(p0, p1, zero, zero, zero, zero, 0.1, 0.1, 0.05)
    assert t >= 0
    if step / 2 > 0.15:
        assert (t - 0.5) * step == pytest.approx(-0.15, abs=0.05)


HEAD, FOREARM, GLOVE = range(3)


def _first_struck(aside: float = 0.0, *, throws: bool = False, arms: bool = True) -> int:
    """What a fist meets on its way (0, 1.5, 0) → (0, 1.5, 1) to a head at z = 0.9.

    Before the head, ``aside`` to its left, an upright forearm at z = 0.6 and its glove at z = 0.4.
    """
    places = [[0.0, 1.5, 0.9], [aside, 1.4, 0.6], [aside, 1.5, 0.4]]
    shapes = crowd.Shapes(
        np.zeros(3, int),
        np.zeros((3, 3)),
        np.zeros((3, 3)),
        np.array([0.09, 0.04, 0.06]),
        np.array([0.09, 0.04, 0.06]),
        np.array([True, arms, arms]),
        np.array([False, True, True]),
        np.array([kernels.NO_LIMB, kernels.NO_LIMB, 0]),
        np.zeros(4, int),
        np.zeros((4, 3)),
        np.full(4, 0.06),
    )
    blows = crowd.Blows(
        np.zeros((2, 2, 4, 3)),
        np.tile(np.array(places), (2, 2, 1, 1)),
        np.tile(np.array([places[0], [aside, 1.6, 0.6], places[2]]), (2, 2, 1, 1)),
        np.full((2, 4), kernels.NO_BLOW),
        np.full((2, 4), kernels.NO_BLOW),
        np.zeros((2, 4), bool),
        np.ones(2, bool),
        np.full((2, 4), kernels.NO_HIT),
        np.zeros((2, 4)),
    )
    blows.tip[:, 0, 1] = [[0.0, 1.5, 0.0], [0.0, 1.5, 1.0]]
    blows.thrown[0, 1] = 7
    if throws:
        blows.thrown[1, 0] = 3
    crowd.hit_one(0, 1, shapes, blows)
    assert np.all(blows.part[0, [0, 2, 3]] == kernels.NO_HIT)
    return int(blows.part[0, 1])


@pytest.mark.jit_off
def test_a_blow_spends_itself_on_what_it_meets_first():
    assert _first_struck(arms=False) == HEAD
    assert _first_struck() == GLOVE
    # Two fists on their way do not meet, but a forearm is struck though its fist is on its way.
    assert _first_struck(throws=True) == FOREARM
    # Met at 25° from square: blocked. At 53°, or not at all: it goes on to the head.
    assert _first_struck(0.05) == GLOVE
    assert _first_struck(0.096) == HEAD
    assert _first_struck(0.5) == HEAD


@pytest.mark.jit_off
@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0, 120.0])
def test_how_squarely_a_moving_arm_is_met(degrees):
    """Only the way of one with respect to the other counts."""
    a, b, drift = np.zeros(3), np.array([0.0, 0.3, 0.0]), np.array([0.3, -0.1, 0.2])
    angle = np.radians(degrees)
    p = np.array([0.1 * np.sin(angle), 0.2, -0.1 * np.cos(angle)])
    way = np.array([0.0, 0.0, 0.4])
    still = kernels.squareness(0.0, p, p + way, a, a, b, b)
    both = kernels.squareness(
        0.5, p - way / 2, p + way / 2 + 2 * drift, a, a + 2 * drift, b, b + 2 * drift
    )
    assert still == pytest.approx(np.cos(angle)) and both == pytest.approx(np.cos(angle))


# Scene files -------------------------------------------------------------------------------------


def test_builtin_scenes_are_found_and_near_names_suggested():
    assert set(builtin_scenes()) >= {"sparring", "target"}
    with pytest.raises(KumiteError, match=r"unknown scene 'sparing': did you mean sparring"):
        load_scene("sparing")


GOOD = """
title = "Mine"
[[character]]
name = "a"
position = [0, 0]
aims_at = "b"
[[character]]
name = "b"
position = [0, 1]
yaw_deg = 180
aims_at = "a"
"""


def test_a_scene_file_is_read(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(GOOD)
    scene = load_scene(str(path))
    assert scene.title == "Mine" and scene.character[1].yaw_deg == 180


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (GOOD.replace("position = [0, 1]", "position = [0]"), r"character.1.position"),
        (
            GOOD.replace('aims_at = "b"', 'aims_at = "c"'),
            "a is against 'c'; expected another",
        ),
        (GOOD.replace('name = "b"', 'name = "a"'), "twice: a"),
        (GOOD + "approach = 0\nstrike = 0\n", "all weights are 0"),
        (GOOD + "strike = nan\n", "character.1.strike"),
        (
            GOOD + "weight = 1\n",
            r"mine.toml:12: unknown key 'character.1.weight'; expected one of again, against",
        ),
        (
            GOOD.replace("[0, 1]", "[0, 1e6]"),
            r"mine.toml:9: character.1.position.1: 1000000.0; exp",
        ),
        ("a = " + "[" * 100_000, "not TOML"),
        ("title = ", "not TOML"),
        ('title = "x"', "nobody is in it"),
    ],
)
def test_wrong_scene_files_name_the_key(tmp_path, text, message):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(KumiteError, match=message) as error:
        load_scene(str(path))
    assert "mine.toml" in str(error.value)


def test_a_scene_file_that_is_missing_or_no_text(tmp_path):
    with pytest.raises(KumiteError, match="cannot be read"):
        load_scene(str(tmp_path / "none.toml"))
    (tmp_path / "bin.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(KumiteError, match="not UTF-8"):
        load_scene(str(tmp_path / "bin.toml"))


# Sparring ----------------------------------------------------------------------------------------


def test_a_library_whose_blows_are_out_of_reach_is_refused(library: Layer):
    """Blows that the graph leaves out can never be thrown."""
    played = np.zeros(len(library.clips), dtype=bool)
    for first, last in zip(library.table.first, library.table.last):
        played[first : last + 1] = True
    strikes = library.strikes
    effective = strikes.effective & ~played[:, None]
    effective[np.flatnonzero(~played)[0], 0] = True
    lost = replace(library, strikes=replace(strikes, effective=effective))
    with pytest.raises(KumiteError, match="in the connected part of its graph: nobody can strike"):
        World(load_scene("sparring"), lost)


def test_the_same_seed_gives_the_same_bytes(sparring: World, tmp_path):
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        sparring.reset(seed)
        save_recording(tmp_path / name, record(sparring, 5.0))
    a, b, c = ((tmp_path / n).read_bytes() for n in "abc")
    assert a == b and a != c


def test_a_recording_begins_where_the_scene_is(sparring: World):
    """A scene that has run before: what happened then is not in the recording."""
    sparring.reset(1)
    whole = record(sparring, 10.0)
    sparring.reset(1)
    first, second = record(sparring, 5.0), record(sparring, 5.0)
    cut = len(first) - 1  # the scene's frame that the second begins with
    assert first.events and second.events
    rest = whole.events[len(first.events) :][: len(second.events)]
    assert [(e.frame - cut, e.kind, e.character) for e in rest] == [
        (e.frame, e.kind, e.character) for e in second.events
    ]
    for e in second.events:
        assert 0 <= e.frame < len(second)
        if isinstance(e, Hit):
            assert e.time == pytest.approx(e.frame / second.fps, abs=1.1 / second.fps)


def test_bodies_on_one_spot_are_carried_apart_slowly(library: Layer):
    name = "abc"
    settings = SceneSettings.model_validate(
        {
            "title": "crowd",
            "character": [
                {"name": name[k], "position": (0, 0), "aims_at": name[k - 1]} for k in range(3)
            ],
        }
    )
    scene = World(settings, library, seed=0)
    for _ in range(int(4 * scene.fps)):
        before = scene.cast.anchor.copy()
        place, room = scene.cast.root_position, scene.floor.room
        near.fill_hash(place, scene.floor.grid)
        for k in range(3):
            crowd.push_one(k, place, room.closest, room.most, scene.floor.grid, room.push[k])
        for k in range(3):
            crowd.carry_away(k, room.push, scene.cast.anchor, scene.cast.foot_offset)
        moved = np.hypot(*(scene.cast.anchor - before)[:, :2].T)
        assert moved.max() <= PUSH_SPEED / scene.fps + 1e-9  # half of it from each of two others
        scene.step()
    ground = scene.root_position[:, [0, 2]]
    gaps = np.linalg.norm(ground[[0, 1, 2]] - ground[[1, 2, 0]], axis=1)
    assert gaps.min() > 0.25


def test_two_boxers_fight(fight: Recording):
    m = measure(fight)
    assert fight.seconds == 30.0 and m.seconds == 30.0
    assert m.min_separation_m is not None and m.min_separation_m > 0.25
    for c in m.characters:
        assert c.thrown >= c.landed >= 1
        assert c.facing_share is not None and c.facing_share > 0.6
        assert c.skate_m_s < 0.02  # the performer's own feet do not move at all
        assert c.join_jump_m_s < 0.6
        assert c.variety > 0.2


def test_hits_are_where_a_fist_and_a_body_are(fight: Recording, sparring: World):
    hits = [e for e in fight.events if isinstance(e, Hit)]
    assert hits
    for e in hits:
        attacker = fight.clip(e.character)
        from kumite.clip import forward_kinematics

        pose = [x[e.frame : e.frame + 1] for x in (attacker.root_position, attacker.wxyz)]
        position, world = forward_kinematics(fight.skeleton, *pose)
        fist = tip_positions(fight.skeleton, e.limb, position, world)[0]
        moved = e.speed / fight.fps
        assert np.linalg.norm(fist - e.place) < 0.12 + 2 * moved
        trunk = ("head", "neck", "chest", "waist")
        assert e.part in (ARMS if e.blocked else trunk)
        assert e.victim != e.character
        assert (e.frame - 1) / fight.fps <= e.time + 1e-3 <= e.frame / fight.fps + 2e-3


def test_a_blow_lands_once(fight: Recording):
    last: dict[tuple, int] = {}
    for e in fight.events:
        if isinstance(e, Hit):
            key = (e.character, e.limb, e.blow)
            assert e.frame - last.get(key, -1000) > 5
            last[key] = e.frame


def test_a_blow_lands_or_is_blocked_never_both(fight: Recording):
    """Arms stop some blows of a fight, not all; what an arm stopped does not land behind it."""
    blocked = [e for e in fight.events if isinstance(e, Hit) and e.blocked]
    landed = [e for e in fight.events if isinstance(e, Hit) and not e.blocked]
    assert blocked and landed
    for e in blocked:
        assert not any(
            (f.character, f.limb, f.blow) == (e.character, e.limb, e.blow)
            and abs(f.frame - e.frame) <= 5
            for f in landed
        )


def test_a_struck_body_shows_it(library: Layer):
    """The victim's head is displaced along the blow in the frames after a hit."""
    scene = World(load_scene("sparring"), library, seed=1)
    moved = []
    for _ in range(int(20 * scene.fps)):
        seen = len(scene.events)
        scene.step()
        for e in scene.events[seen:]:
            if isinstance(e, Hit) and e.part == "head":
                k = scene.names.index(e.victim)
                moved.append(float(np.abs(scene.cast._offsets.reaction_velocity[k]).max()))
    assert moved and min(moved) > 0.1


def test_decisions_are_logged_with_what_was_considered(fight: Recording):
    decisions = [e for e in fight.events if isinstance(e, Decision)]
    assert len(decisions) > 20
    assert all(e.by == "policy" and e.considered and e.apart is not None for e in decisions)
    assert all(0 <= (e.apart or 0) <= (e.considered or 0) for e in decisions)


def test_behaviours_are_named_in_scene_files_and_tuned_while_it_runs(library: Layer, tmp_path):
    file = tmp_path / "shy.toml"
    file.write_text(
        'title = "shy"\n[[character]]\nname = "red"\nposition = [0, -0.5]\naims_at = "ball"\n'
        "strike = 0.0\napproach = 0.0\nbehaviours = { keep_off = 2.0 }\n"
        '[[object]]\nname = "ball"\nposition = [0, 1.5, 0.3]\n'
    )
    scene = World(load_scene(str(file)), library, seed=0)
    for _ in range(int(15 * scene.fps)):
        scene.step()
    away = np.hypot(*(scene.root_position[0, [0, 2]] - [0.0, 0.3]))
    assert away > 1.15
    assert not any(isinstance(e, Hit) for e in scene.events)
    weights = {c.field: c for c in scene.tunables}
    assert {"approach", "strike", "keep_off"} < set(weights) and weights["keep_off"].value == 2.0
    weights["strike"].set(6.0)
    weights["approach"].set(1.0)
    weights["keep_off"].set(0.0)
    for _ in range(int(25 * scene.fps)):
        scene.step()
    assert any(isinstance(e, Hit) for e in scene.events)
    with pytest.raises(KumiteError, match="not all 0"):
        for control in weights.values():
            control.set(0.0)


def test_unknown_behaviours_and_weights_all_zero_are_refused(library: Layer, tmp_path):
    two = [
        {"name": n, "position": (0, z), "aims_at": o} for n, z, o in (("a", 0, "b"), ("b", 1, "a"))
    ]

    def scene(**changes) -> SceneSettings:
        return SceneSettings.model_validate(
            {"title": "x", "character": [{**two[0], **changes}, two[1]]}
        )

    with pytest.raises(KumiteError, match="unknown behaviour 'cirle'; did you mean 'circle'"):
        World(scene(behaviours={"cirle": 1.0}), library)
    with pytest.raises(KumiteError, match="has a weight of its own"):
        World(scene(behaviours={"strike": 1.0}), library)
    with pytest.raises(ValueError, match="all weights are 0"):
        scene(approach=0.0, strike=0.0)


# The target --------------------------------------------------------------------------------------


def test_a_boxer_goes_for_the_target_wherever_it_is_put(library: Layer):
    scene = World(load_scene("target"), library, seed=0)
    for place in ([0.0, 1.5, 1.2], [-1.5, 1.45, -1.0], [2.0, 1.5, -1.0]):
        scene.move_object("target", np.array(place))
        before = sum(isinstance(e, Hit) for e in scene.events)
        for _ in range(int(25 * scene.fps)):
            scene.step()
        gap = np.hypot(*(scene.root_position[0, [0, 2]] - np.array(place)[[0, 2]]))
        assert gap < 1.3, place
        assert sum(isinstance(e, Hit) for e in scene.events) > before, place


def _run(scene: World, seconds: float) -> tuple[np.ndarray, np.ndarray, int]:
    """Over a time: where the boxer is [F, 2] on the ground, how far off the target [F], hits."""
    before, ground = sum(isinstance(e, Hit) for e in scene.events), []
    for _ in range(int(seconds * scene.fps)):
        scene.step()
        ground.append(scene.root_position[0, [0, 2]])
    way = np.array(ground)
    gap = np.linalg.norm(way - scene.objects[0].position[[0, 2]], axis=1)
    return way, gap, sum(isinstance(e, Hit) for e in scene.events) - before


def test_a_target_dragged_behind_is_turned_to_and_hit(library: Layer):
    scene = World(load_scene("target"), library, seed=0)
    scene.move_object("target", np.array([0.0, 1.5, -1.5]))
    _, gap, hits = _run(scene, 20.0)
    assert gap[-1] < 1.0 and hits >= 1


@pytest.mark.parametrize("height", [0.0, 0.3, 2.6, 50.0])
def test_a_target_at_a_height_of_no_blow_is_approached_and_kept_near(library: Layer, height):
    scene = World(load_scene("target"), library, seed=1)
    scene.move_object("target", np.array([0.5, height, 1.5]))
    way, gap, hits = _run(scene, 16.0)
    late = len(way) // 2
    assert hits == 0 and gap[late:].max() < 1.0
    # Nobody stands still: he decides, and his feet carry him about it.
    assert np.linalg.norm(np.diff(way[late:], axis=0), axis=1).sum() > 0.4
    assert sum(isinstance(e, Decision) for e in scene.events) >= 10


def test_a_target_out_of_every_grid_is_walked_to(library: Layer):
    scene = World(load_scene("target"), library, seed=0)
    place = np.array([-3.5, 1.5, -3.5])
    policies = scene.policy_fighter.skill.policies
    assert not any(p.behaviour.grid.contains(place) for p in policies)
    assert np.hypot(3.5, 3.5) > scene.policy_fighter.skill.strike.behaviour.farthest
    scene.move_object("target", place)
    _, gap, hits = _run(scene, 30.0)
    fifth = len(gap) // 5
    assert np.all(np.diff(gap[: 3 * fifth : fifth]) < -0.5)
    assert gap.min() < 1.0 and hits >= 1


def test_a_struck_target_swings_and_comes_back(library: Layer):
    scene = World(load_scene("target"), library, seed=0)
    home = scene.objects[0].position.copy()
    scene.hanging._speed[0] = np.array([1.0, 0.0, 0.0])
    far = 0.0
    for _ in range(int(3 * scene.fps)):
        scene.hanging.step(scene.floor, np.full(1, kernels.NOBODY), lambda landing: None)
        far = max(far, float(np.linalg.norm(scene.objects[0].position - home)))
    assert 0.05 < far < 0.3
    assert np.allclose(scene.objects[0].position, home, atol=0.02)


# Recordings and metrics --------------------------------------------------------------------------


def test_recordings_round_trip(fight: Recording, tmp_path):
    save_recording(tmp_path / "a.rec", fight)
    back = load_recording(tmp_path / "a.rec")
    assert back.names == fight.names and back.fps == fight.fps
    assert np.array_equal(back.wxyz, fight.wxyz)
    assert back.events == fight.events
    save_recording(tmp_path / "b.rec", back)
    assert (tmp_path / "a.rec").read_bytes() == (tmp_path / "b.rec").read_bytes()
    assert measure(back) == measure(fight)


def test_a_recording_whose_shapes_do_not_fit_is_damaged(fight: Recording, tmp_path):
    save_recording(tmp_path / "a.rec", fight)
    header, arrays = files.load(tmp_path / "a.rec", "recording", 2)
    files.save(tmp_path / "b.rec", "recording", 2, header, {**arrays, "wxyz": arrays["wxyz"][1:]})
    with pytest.raises(KumiteError, match=r"b\.rec: damaged recording .*wxyz"):
        load_recording(tmp_path / "b.rec")


def test_playback_shows_the_recording(fight: Recording):
    play = Playback(fight)
    frames = 1
    while play.step():
        frames += 1
    assert frames == len(fight)
    assert len(play.events) == len(fight.events)
    for frame in (len(fight) // 2, 10, len(fight) - 1):
        play.seek(frame)
        assert np.allclose(play.wxyz, fight.wxyz[frame])
        assert list(play.events) == [e for e in fight.events if e.frame <= frame]
    assert play.events is play.events  # asked for at every picture: nothing is copied


def test_one_character_alone(fight: Recording):
    red = fight.only("red")
    assert red.names == ("red",) and np.array_equal(red.wxyz[:, 0], fight.wxyz[:, 0])
    with pytest.raises(KumiteError, match="unknown character 'green'"):
        fight.only("green")


def _standing(positions: list[list[float]], yaws: list[float], frames: int = 31) -> Recording:
    """Characters that stand still, but for the first, which slides 1 m to its left in a second."""
    s = toys.skeleton()
    count = len(positions)
    root = np.zeros((frames, count, 3))
    root[:] = [[x, toys.HIP_HEIGHT, z] for x, z in positions]
    root[:, 0, 0] += np.arange(frames) / (frames - 1)
    wxyz = np.zeros((frames, count, len(s), 4))
    wxyz[..., 0] = 1
    wxyz[:, :, 0] = from_yaw(np.array(yaws))
    names = tuple("abc"[:count])
    return Recording(
        "test",
        30.0,
        s,
        names,
        root,
        wxyz,
        np.ones((frames, count, 2), bool),
        np.tile(np.arange(frames)[:, None], (1, count)),
        events=(
            event(3, "strike", "a"),
            event(5, "hit", "a"),
            event(8, "hit", "a", {"part": "left_forearm", "blocked": True}),
        ),
        settings={"aims_at": {"a": "b", "b": "a"}, "source_skate_m_s": 0.5},
    )


def test_metrics_of_a_scene_worked_by_hand():
    m = measure(_standing([[0, 0], [0, 2]], [0.0, 0.0]))
    a, b = m.characters
    assert m.min_separation_m == pytest.approx(2.0)
    assert (a.thrown, a.landed, a.blocked, b.thrown) == (1, 1, 1, 0)
    assert a.skate_m_s == pytest.approx(1.0, rel=1e-5) and a.skate_ratio == pytest.approx(2.0)
    assert b.skate_m_s == 0
    assert a.facing_share == 1.0 and b.facing_share == 0.0  # b looks away
    assert a.join_jump_m_s == 0 and a.joins == 0


def test_join_jumps_are_changes_of_the_roots_speed():
    r = _standing([[0, 0], [0, 2]], [0.0, np.pi])
    root = r.root_position.copy()
    root[15:, 0, 0] += np.linspace(0, 1, 16)  # from 1 m/s to 3 m/s
    shown = r.library_frame.copy()
    shown[16:, 0] += 100
    from dataclasses import replace

    m = measure(replace(r, root_position=root, library_frame=shown))
    assert m.characters[0].joins == 1
    assert m.characters[0].join_jump_m_s == pytest.approx(2.0, rel=1e-3)


def test_source_skate_is_the_clips_own(library: Layer):
    clips = library.clips
    position, _ = clips.world
    by_clip = [
        foot_skate(clips.skeleton, position[a:b], library.contacts.on_ground[a:b], clips.fps)
        for a, b in zip(clips.clip_start[:-1], clips.clip_start[1:])
    ]
    assert min(by_clip) <= source_skate(library) <= max(by_clip)


@pytest.mark.slow
def test_five_minutes_of_the_real_boxer(boxer: Layer):
    """The figures that a fight on real motion must reach, over several seeds."""
    scene = World(load_scene("sparring"), boxer)
    landed = {"red": 0, "blue": 0}
    facing, skate = [], []
    for seed in range(5):
        scene.reset(seed)
        m = measure(record(scene, 60.0))
        assert m.min_separation_m is not None and m.min_separation_m >= 0.25
        for c in m.characters:
            landed[c.name] += c.landed
            facing.append(c.facing_share)
            skate.append(c.skate_ratio)
            assert c.join_jump_m_s <= 0.3
    assert all(n >= 30 for n in landed.values())  # one in ten seconds
    assert np.mean(facing) >= 0.8 and max(skate) <= 1.5


def test_two_of_one_clip_do_not_move_in_step():
    """What one clip offers is little, and two who see the same of each other choose alike."""
    (jab,) = [c for c in perform("boxing", 0).clips if c.name == "jab"]
    thin = build_frames(concatenate([jab]))
    for seed in range(10):
        scene = World(load_scene("sparring"), thin, seed=seed)
        apart = []
        for _ in range(round(10 * scene.fps)):
            scene.step()
            apart.append(abs(int(scene.cast.frame[0]) - int(scene.cast.frame[1])))
        assert np.mean(np.array(apart) <= 2) < 0.1, seed
        assert any(isinstance(e, Hit) for e in scene.events), seed


def test_an_unknown_key_deep_in_a_scene_names_those_it_may_have(tmp_path: Path):
    """A list that may be left out, in a table of a list: found by fuzzing."""
    text = """title = "x"
[[fighter]]
name = "a"
position = [0, 0]
against = "b"
[[fighter]]
name = "b"
position = [0, 1]
against = "a"
[[cue]]
who = "a"
at = 1.0
[[cue.point]]
palce = [0.0, 4.0]
"""
    (tmp_path / "x.toml").write_text(text, "utf-8")
    with pytest.raises(KumiteError, match=r"unknown key .*palce.*expected one of .*place"):
        load_scene(str(tmp_path / "x.toml"))


def test_who_chooses_at_the_same_moment_does_not_choose_the_same(library: Layer):
    scene = World(load_scene("sparring"), library, seed=1)
    cast = scene.cast
    state = int(np.argmax(np.diff(library.table.action_start)))
    for k in range(2):  # twins: in one state, one before the other
        cast.place(k, state, np.array([0.0, k, k * np.pi]))
    scene.floor.start()
    scene.step()
    first = library.table.first[scene.policy_fighter.fighters.choices.stretch]
    assert abs(int(first[0]) - int(first[1])) > scene.policy_fighter.fighters.minds.step
