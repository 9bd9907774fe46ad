"""Those who avoid blows: attack volumes of limbs, blows back, and the scenes slip and blades."""

from __future__ import annotations

import numpy as np
import pytest

from kumite import toml
from kumite.body import body_mesh, limb_spheres, strikes_with
from kumite.clip import LIMBS, forward_kinematics, tip_positions
from kumite.control.attack import Attack, from_limbs
from kumite.control.avoidance import AvoidanceSearch, Standing
from kumite.control.counter import CounterSearch
from kumite.errors import KumiteError
from kumite.graph import Layer
from kumite.rotation import rotate
from kumite.scene import EvasionScene, builtin_scenes, measure, record
from kumite.scene.attackers import recorded_attack
from kumite.scene.evasion import EvasionScene as Scene
from kumite.scene.events import Avoided, Foreseen, Hit, Strike
from kumite.scene.settings import SceneSettings
from tests.shared import builtin

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def avoiding() -> Layer:
    return builtin("avoidance", "avoidance")


@pytest.fixture(scope="module")
def swordsman() -> Layer:
    return builtin("sword")


@pytest.fixture(scope="module")
def blades(avoiding: Layer, swordsman: Layer) -> EvasionScene:
    return EvasionScene(builtin_scenes()["blades"], avoiding, swordsman)


@pytest.mark.parametrize("limb", LIMBS)
def test_attack_volumes_of_limbs_are_where_forward_kinematics_puts_them(avoiding, limb):
    clip = avoiding.clips.clip(0)
    when = 3.0 + np.arange(40) / clip.fps
    attack = from_limbs(clip.skeleton, clip.root_position[:40], clip.wxyz[:40], when, limb)
    spheres = limb_spheres(clip.skeleton, limb)
    position, world = forward_kinematics(clip.skeleton, clip.root_position[:40], clip.wxyz[:40])
    for i, joint in enumerate(spheres.joint.tolist()):
        at = position[:, joint] + rotate(world[:, joint], spheres.centre[i])
        np.testing.assert_allclose(attack.centre[:, i], at, atol=1e-12)
    np.testing.assert_array_equal(attack.when, when)
    tip = tip_positions(clip.skeleton, limb, position, world)
    near = np.linalg.norm(attack.centre - tip[:, None], axis=2) - attack.radius
    assert near.min(axis=1).max() < 0.12  # the volume reaches nearly to the end of the limb


def test_a_sword_is_spheres_from_its_hilt_to_its_point(swordsman):
    clips = swordsman.clips
    skeleton = clips.skeleton
    assert strikes_with(skeleton, "right_hand") == "sword"
    assert strikes_with(skeleton, "left_hand") == "left_hand"
    clip = clips.clip(0)
    attack = from_limbs(
        skeleton, clip.root_position[:5], clip.wxyz[:5], np.arange(5) / clip.fps, "sword"
    )
    position, world = forward_kinematics(skeleton, clip.root_position[:5], clip.wxyz[:5])
    np.testing.assert_allclose(attack.centre[:, 0], position[:, skeleton.joint("sword")])
    tip = tip_positions(skeleton, "sword", position, world)
    np.testing.assert_allclose(attack.centre[:, -1], tip, atol=1e-12)
    apart = np.linalg.norm(np.diff(attack.centre[0], axis=0), axis=1)
    assert apart.max() < 2.0 * attack.radius[0]  # no gap that something could slip through


def test_attacks_of_limbs_say_what_is_wrong(avoiding):
    clip = avoiding.clips.clip(0)
    root, wxyz = clip.root_position[:4], clip.wxyz[:4]
    with pytest.raises(KumiteError, match="left_elbow"):
        from_limbs(clip.skeleton, root, wxyz, np.arange(4.0), "left_elbow")
    with pytest.raises(KumiteError, match="expected"):
        from_limbs(clip.skeleton, root, wxyz, np.arange(5.0), "left_hand")
    with pytest.raises(KumiteError, match="ascend"):
        from_limbs(clip.skeleton, root, wxyz, np.zeros(4), "left_hand")
    with pytest.raises(KumiteError, match="sword"):
        from_limbs(clip.skeleton, root, wxyz, np.arange(4.0), "sword")


def test_blades_avoids_what_would_have_hit(blades):
    blades.reset(1)
    recording = record(blades, 16.0)
    gap = {e.attack: e.gap for e in recording.events if isinstance(e, Foreseen)}
    meant = {n for n, g in gap.items() if g < 0.0}
    hits = {e.attack for e in recording.events if isinstance(e, Hit) and e.attack is not None}
    avoided = {e.attack for e in recording.events if isinstance(e, Avoided)}
    assert meant
    assert len(meant & avoided) > len(meant & hits)
    # Blows that are told of are thrown when it was said.
    begun = {e.attack: e for e in recording.events if isinstance(e, Strike)}
    for e in recording.events:
        if isinstance(e, Foreseen) and e.attack in begun and e.begins > 0.1:
            strike = begun[e.attack]
            assert strike.frame / recording.fps == pytest.approx(e.begins, abs=0.02)
    assert measure(recording).characters[1].thrown == len(begun)
    assert recording.settings["unarmed"] == ["runaway"]


def test_what_is_foreseen_is_what_is_recorded(blades):
    blades.reset(3)
    seen: list[Attack] = []
    menace = Scene._menace

    def note(self, blow, at):
        seen.append(blow.attack)
        menace(self, blow, at)

    blades._menace = note.__get__(blades)
    try:
        recording = record(blades, 12.0)
    finally:
        del blades._menace
    of_time = [a for a in seen if a.when[-1] < recording.seconds - 0.1]
    assert of_time
    struck = {e.frame for e in recording.events if isinstance(e, Hit)}
    if not struck:  # undisturbed
        attack = of_time[0]
        limb = "sword" if len(attack.radius) > 10 else "left_hand"
        same = recorded_attack(
            recording, "swordsman", limb, float(attack.when[0]), float(attack.when[-1])
        )
        np.testing.assert_allclose(same.when, attack.when, atol=1e-9)
        # Bodies that are pushed apart move a little.
        assert np.abs(same.centre - attack.centre).max() < 0.05


def test_the_same_seed_gives_the_same_frames(blades):
    runs = []
    for _ in range(2):
        blades.reset(5)
        runs.append(record(blades, 6.0))
    assert runs[0].wxyz.tobytes() == runs[1].wxyz.tobytes()
    assert runs[0].root_position.tobytes() == runs[1].root_position.tobytes()
    assert runs[0].events == runs[1].events
    blades.reset(6)
    assert record(blades, 6.0).wxyz.tobytes() != runs[0].wxyz.tobytes()


def test_the_unarmed_carry_a_sword_that_is_not_there(blades):
    skeleton = blades.skeleton
    sword = skeleton.joint("sword")
    assert blades.unarmed == ("runaway",)
    np.testing.assert_array_equal(blades.wxyz[0, sword], [1.0, 0.0, 0.0, 0.0])
    armed, bare = body_mesh(skeleton), body_mesh(skeleton, armed=False)
    assert np.any(armed.joints[armed.weights > 0] == sword)
    assert not np.any(bare.joints[bare.weights > 0] == sword)


def test_counters_meet_what_they_are_meant_for(fighting: AvoidanceSearch):
    search = CounterSearch(fighting)
    library = fighting.library
    strikes = library.strikes
    # Somebody who stands where a blow of the library lands, seen from a way into it, is met.
    x = int(search.which[len(search.which) // 2])
    tip = tip_positions(library.clips.skeleton, LIMBS[int(strikes.limb[x])], *library.clips.world)[
        strikes.frame[x]
    ]
    table = library.table
    before = int(
        np.flatnonzero((table.first <= strikes.frame[x]) & (table.last >= strikes.frame[x]))[0]
    )
    state_frame = int(table.first[before]) - 1
    standing = Standing(np.zeros(3), float(state_frame), state_frame)
    if fighting.state_at(state_frame) < 0:
        pytest.skip("the blow's stretch is entered by a jump only")
    goal = tip[None, None]
    far = np.full((1, 3), 50.0)
    found = search.find(standing, goal, np.array([0.05]), far)
    assert found is not None
    assert found.gap < 0.03
    assert search.find(standing, goal + 30.0, np.array([0.05]), far) is None


@pytest.fixture(scope="module")
def fighting() -> AvoidanceSearch:
    return AvoidanceSearch(builtin("boxing", "avoidance"))


DODGER = '[[dodger]]\nname = "a"\nposition = [0, 1]\n'
ATTACKER = '[[attacker]]\nname = "b"\nposition = [0, -1]\n'


@pytest.mark.parametrize(
    "text, wrong",
    [
        (ATTACKER, "there are none"),
        (DODGER + ATTACKER + "[balls]\nthrows = 3\n", "one of them"),
        (DODGER + ATTACKER.replace('"b"', '"a"'), "used twice"),
        (DODGER + ATTACKER + 'library = "judo"\n', "sword"),
        (DODGER + ATTACKER + "approach = 0\nstrike = 0\n", "above 0"),
        (
            DODGER + ATTACKER + ATTACKER.replace('"b"', '"c"') + 'library = "sword"\n',
            "expected one",
        ),
        (DODGER + ATTACKER + "[dodge]\ndistance = 0.1\n", "distance"),
    ],
)
def test_bad_scene_files_say_what_is_wrong(text, wrong):
    with pytest.raises(KumiteError, match=wrong):
        toml.parse('title = "t"\n' + text, "t.toml", SceneSettings)


def test_attackers_of_a_library_of_ones_own():
    text = 'title = "t"\n' + DODGER + ATTACKER + 'library = "mine/boxer.kumite"\n'
    assert toml.parse(text, "t.toml", SceneSettings).attacker[0].library == "mine/boxer.kumite"


def test_a_scene_without_attackers_is_refused(avoiding, swordsman):
    with pytest.raises(KumiteError, match="who attacks"):
        EvasionScene(builtin_scenes()["dodgeball"], avoiding, swordsman)


def test_slip_and_blades_come_with_kumite():
    scenes = builtin_scenes()
    assert scenes["slip"].names == ("blue", "red")
    assert scenes["blades"].aims == {"runaway": "swordsman", "swordsman": "runaway"}
