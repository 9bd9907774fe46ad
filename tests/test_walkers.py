"""Walkers: where target motions begin, how they are bent, and the things they are done at."""

from __future__ import annotations

from collections import deque
from pathlib import Path

import numpy as np
import pytest

from kumite.clip import LIMBS, forward_kinematics
from kumite.control import approach_motions, gradual
from kumite.control.guide import Guide, learned_guide
from kumite.graph import Layer
from kumite.graph.hierarchy import ways_into_cores
from kumite.graph.kinds import suited
from kumite.graph.preparing import KINDS
from kumite.rotation import (
    angle,
    planar_apply,
    planar_compose,
    planar_inverse,
    rotate,
    wrap_angle,
)
from kumite.scene import PrepareScene
from kumite.scene.settings import SceneSettings
from kumite.scene.settings_prepare import TargetSettings
from kumite.scene.things import MASS_RATIO, Things, fitting
from kumite.scene.walkers import OFF, Walkers
from tests.shared import builtin

STRIKE = KINDS.index("strike")
QUICK = gradual(places=16, batch=1)


@pytest.fixture(scope="module")
def targets() -> Layer:
    return builtin("targets", "preparation")


@pytest.fixture(scope="module")
def guide(targets: Layer, tmp_path_factory: pytest.TempPathFactory) -> Guide:
    assert targets.preparing is not None
    curve = np.ones(len(targets.preparing.hierarchy.targets))
    return learned_guide(targets, tmp_path_factory.mktemp("learned"), curve, gaits=["walk"])


def some_walkers(guide: Guide, homes: np.ndarray, preparation: str = "ours") -> Walkers:
    return Walkers(
        guide,
        [f"w{k}" for k in range(len(homes))],
        homes,
        lambda event: None,
        preparation=preparation,
    )


def tip_at(library: Layer, frame: int, limb: int) -> np.ndarray:
    """The tip of a limb in a captured frame, by kinematics of its own."""
    clips = library.clips
    position, world = forward_kinematics(
        clips.skeleton, clips.root_position[frame][None], clips.wxyz[frame][None]
    )
    joint, offset = clips.skeleton.tip(LIMBS[limb])
    return position[0, joint] + rotate(world[0, joint], offset)


# Where target motions begin -----------------------------------------------------------------------


@pytest.mark.parametrize("preparation", ["ours", "none"])
def test_begun_at_its_stance_a_blow_meets_its_object_unbent(
    targets: Layer, guide: Guide, preparation: str
):
    w = some_walkers(guide, np.zeros((1, 3)), preparation)
    p, clips = targets.preparing, targets.clips
    assert p is not None
    rng = np.random.default_rng(1)
    for t in np.flatnonzero(p.kind == STRIKE).tolist():
        for _ in range(20):
            here = np.array([*rng.uniform(-5, 5, 2), rng.uniform(-np.pi, np.pi)])
            way = rng.uniform(1.5, 6.0) * np.array([np.sin(a := rng.uniform(0, 7)), np.cos(a)])
            place = np.array([here[0] + way[0], p.place[t, 1], here[1] + way[1]])
            one = np.array([t])
            stance = w.stance(one, place[None], here[None], np.array([np.nan]))[0]
            frame = int(w.begins_at(one)[0])
            tip = tip_at(targets, int(p.contact[t]), int(p.limb[t]))
            shown = planar_apply(planar_compose(stance, planar_inverse(clips.facing[frame])), tip)
            np.testing.assert_allclose(shown, place, atol=1e-6)
            # Who goes on straight comes there facing as the motion begins: no detour.
            ahead = np.arctan2(*(stance[:2] - here[:2]))
            assert abs(wrap_angle(ahead - stance[2])) < 1e-6


def test_begun_at_its_stance_an_obstacle_is_passed_in_its_middle(targets: Layer, guide: Guide):
    w, p, clips = some_walkers(guide, np.zeros((1, 3))), targets.preparing, targets.clips
    assert p is not None
    pelvis = clips.skeleton.joint("pelvis")
    for t in np.flatnonzero(p.kind != STRIKE).tolist():
        for normal in np.linspace(-3, 3, 7):
            place, one = np.array([1.0, 0.0, -2.0]), np.array([t])
            here = np.array([-3.0, 4.0, 0.3])
            stance = w.stance(one, place[None], here[None], np.array([normal]))[0]
            carry = planar_compose(stance, planar_inverse(clips.facing[int(p.reference[t])]))
            position = planar_apply(carry, clips.world[0][:, pelvis])
            contact, past = int(p.contact[t]), int(p.past[t])
            np.testing.assert_allclose(position[contact, [0, 2]], place[[0, 2]], atol=1e-6)
            went = position[past, [0, 2]] - position[int(p.reference[t]), [0, 2]]
            assert abs(wrap_angle(np.arctan2(went[0], went[1]) - normal)) < np.radians(15)


@pytest.mark.parametrize("off", [0.0, 0.1, 0.3, OFF + 0.05])
def test_blows_are_bent_as_far_as_allowed(targets: Layer, guide: Guide, off: float):
    p = targets.preparing
    assert p is not None
    for t in np.flatnonzero(p.kind == STRIKE).tolist():
        home = np.array([[2.0, -1.0, 0.7]])
        w = some_walkers(guide, home)
        w.goal[:], w.heeds[:], w.stands[:] = home, False, True
        for _ in range(5):
            w.advance()
        # Where it would meet its object unbent, and so far off it.
        carry = planar_compose(w.facing[0], planar_inverse(clips_facing(targets, w, t)))
        there = planar_apply(carry, tip_at(targets, int(p.contact[t]), int(p.limb[t])))
        place = there + off * np.array([0.6, 0.0, 0.8])
        w.launch(0, t, place)
        while w.cast.frame[0] < p.contact[t]:
            w.advance()
        joint, offset = targets.clips.skeleton.tip(LIMBS[int(p.limb[t])])
        tip = w.shown.position[0, joint] + rotate(w.shown.world_wxyz[0, joint], offset)
        left = float(np.hypot(*(tip - place)[[0, 2]]))
        if off > OFF:
            assert left > 0.5 * off  # it is left as captured
        else:
            # Bent by 30 cm, a foot that leaves the ground late is still on its way.
            assert left < (0.01 if off <= 0.1 else 0.03), p.hierarchy.targets.label[t]


def clips_facing(library: Layer, w: Walkers, t: int) -> np.ndarray:
    """The facing frame of the library at which target t would be begun now."""
    return library.clips.facing[w._best_beginning(0, t)[0]]


def test_who_does_nothing_shows_its_cast(guide: Guide):
    homes = np.array([[0.0, 0.0, 0.0], [3.0, -2.0, 1.2]])
    w = some_walkers(guide, homes, "none")
    w.goal[:], w.heeds[:] = homes, False
    for _ in range(90):
        w.advance()
        assert np.all(w.alpha == 0.0)
        np.testing.assert_array_equal(w.shown.wxyz[:, 1:], w.cast.wxyz[:, 1:])
        np.testing.assert_allclose(w.shown.root_position, w.cast.root_position, atol=1e-12)
        np.testing.assert_allclose(w.shown.position, w.cast.position, atol=1e-12)


def test_ways_into_cores_are_the_shortest(targets: Layer):
    """By search from every state, one stretch after another."""
    p, table = targets.preparing, targets.table
    assert p is not None
    cores = len(p.hierarchy.cores)
    onward = ways_into_cores(table, p.what, cores)
    length = (table.last - table.first + 1).astype(float)
    actions = [
        [
            a
            for a in table.stretch[table.action_start[s] : table.action_start[s + 1]].tolist()
            if p.what[a] < cores
        ]  # by way of no target
        for s in range(table.states)
    ]
    for m in range(cores):
        goal = p.what[np.arange(len(length))] == m
        # Frames until a core's own stretch begins, by relaxation until nothing changes.
        left = np.full(table.states, np.inf)
        queue = deque(range(table.states))
        while queue:
            s = queue.popleft()
            best = min(
                (0.0 if goal[a] else length[a] + left[table.target[a]] for a in actions[s]),
                default=np.inf,
            )
            if best < left[s]:
                left[s] = best
                queue.extend(
                    q for q in range(table.states) if s in table.target[actions[q]].tolist()
                )
        for s in range(table.states):
            a = int(onward[s, m])
            if not np.isfinite(left[s]):
                assert a == -1
                continue
            assert a in actions[s]
            cost = 0.0 if goal[a] else length[a] + left[table.target[a]]
            assert cost == left[s], (s, m)


# Things -------------------------------------------------------------------------------------------


def some_things(library: Layer, *settings: TargetSettings) -> Things:
    p = library.preparing
    assert p is not None
    found = suited(library)
    motion = np.array([fitting(s, found)[0] for s in settings])
    return Things(settings, p, motion)


def test_a_ball_never_gains_energy_and_comes_to_rest(targets: Layer):
    ball = TargetSettings(name="ball", kind="kick_ball", position=(1.0, 2.0))
    rng = np.random.default_rng(3)
    for _ in range(10):
        things = some_things(targets, ball)
        kick = rng.normal(size=3) * 6.0
        things.kick(0, kick)
        assert things.velocity[0, 0] == pytest.approx(MASS_RATIO * kick[0])
        assert things.velocity[0, 1] > 0  # it is lifted
        energy = np.inf
        for _ in range(60 * 20):
            things.step(1 / 60)
            v, high = things.velocity[0], things.position[0, 1]
            now = 0.5 * v @ v + 9.81 * high
            # Semi-implicit steps err by g² dt² / 2 a frame at most.
            assert now <= energy + 0.5 * (9.81 / 60) ** 2 + 1e-9
            assert high >= things.radius[0] - 1e-9
            energy = now
        assert things.lie[0] and high == pytest.approx(things.radius[0], abs=2e-3)
        np.testing.assert_array_equal(things.objects[0].position, things.position[0])


def test_what_hangs_comes_back(targets: Layer):
    pad = TargetSettings(name="pad", kind="punch", position=(0.0, 0.0))
    things = some_things(targets, pad)
    assert not things.lies[0]
    things.kick(0, np.array([0.0, 0.0, 3.0]))
    far = []
    for _ in range(600):
        things.step(1 / 60)
        far.append(float(np.linalg.norm(things.position[0] - things.home[0])))
    assert 0.1 < max(far) < 1.0 and far[-1] < 1e-3


def test_things_move_alike_together_and_alone(targets: Layer):
    """Arrays of things against one at a time."""
    settings = [
        TargetSettings(name=f"{m} {n}", kind=m, position=(3.0 * n, 0.0))
        for n, m in enumerate(["kick_ball", "punch", "jump_over", "kick_ball", "front_kick"])
    ]
    rng = np.random.default_rng(5)
    kicks = rng.normal(size=(5, 3)) * 4.0
    together = some_things(targets, *settings)
    alone = [some_things(targets, s) for s in settings]
    for n in (0, 1, 3, 4):
        together.kick(n, kicks[n])
        alone[n].kick(0, kicks[n])
    for _ in range(200):
        together.step(1 / 60)
        for n, one in enumerate(alone):
            one.step(1 / 60)
            np.testing.assert_array_equal(together.position[n], one.position[0])


def test_inside_of_obstacles_by_their_corners(targets: Layer):
    bar = TargetSettings(name="bar", kind="duck_under", position=(2, -1), yaw_deg=40, width=3.0)
    things, rng = some_things(targets, bar), np.random.default_rng(7)
    yaw = np.radians(40)
    side, way = np.array([np.cos(yaw), -np.sin(yaw)]), np.array([np.sin(yaw), np.cos(yaw)])
    for _ in range(300):
        a, b = rng.uniform(-3, 3), rng.uniform(-1, 1)
        place = np.array([2.0, -1.0]) + a * side + b * way
        expected = 0 if abs(a) < 1.5 + 0.3 and abs(b) < 0.3 else None
        assert things.inside(place) == expected


def test_gates_lead_across_obstacles_from_either_side(targets: Layer):
    bar = TargetSettings(name="bar", kind="duck_under", position=(2, -1), yaw_deg=40, width=3.0)
    things = some_things(targets, bar)
    yaw = np.radians(40)
    side, way = np.array([np.cos(yaw), -np.sin(yaw)]), np.array([np.sin(yaw), np.cos(yaw)])
    for aside in (-4.0, -0.5, 0.0, 0.8, 4.0):
        for before in (-3.0, 3.0):
            here = np.array([[*(np.array([2.0, -1.0]) + aside * side + before * way), 0.0]])
            place, through = things.gates(here, np.array([0]))
            kept = np.clip(aside, -1.0, 1.0)  # half a metre from the posts
            np.testing.assert_allclose(place[0, [0, 2]], [2, -1] + kept * side, atol=1e-9)
            expected = yaw if before < 0 else yaw + np.pi
            assert abs(wrap_angle(through[0] - expected)) < 1e-9


def test_settled_policies_are_kept(targets: Layer, tmp_path: Path):
    curve = np.array([1.0, 1.0, 0.5, 1.0, 1.0, 1.0])  # of six target motions
    first = learned_guide(targets, tmp_path, curve, gaits=["walk"], levels=False)
    kept = sorted(p.name for p in tmp_path.iterdir())
    again = learned_guide(targets, tmp_path, curve, gaits=["walk"], levels=False)
    assert len(first.policies) == 2 and kept == sorted(p.name for p in tmp_path.iterdir())
    for a, b in zip(first.policies, again.policies):
        np.testing.assert_array_equal(a.best, b.best)


def test_targets_with_the_same_curve_share_a_policy(targets: Layer, tmp_path: Path):
    """Section 6: what a controller has to know of a target is the C of its root."""
    walker = {"name": "anna", "position": (0.0, 0.0)}

    def scene_of(folder: str, **prepare) -> PrepareScene:
        new = {"title": "t", "about": "a", "walker": [walker], "prepare": prepare}
        settings = SceneSettings.model_validate(new)
        return PrepareScene(settings, targets, cache=tmp_path / folder, learning=QUICK)

    def kept(folder: str) -> int:
        return len(list((tmp_path / folder).iterdir()))

    labels = list(targets.preparing.hierarchy.targets.label)  # type: ignore[union-attr]
    root = targets.clips.skeleton.names[0]
    one = scene_of("one", curves={"punch": {"head": 0.25}, "duck_under": {"upper": 2.0}})
    assert len(one.guide.policies) == 1 and kept("one") == 1
    assert set(one.guide.policy_of.tolist()) == {0}
    two = scene_of("two", curves={"punch": {root: 0.5}, "kick_ball": {root: 0.5}})
    assert len(two.guide.policies) == 2 and kept("two") == 2
    which = dict(zip(labels, two.guide.policy_of.tolist()))
    assert which["punch"] == which["kick_ball"] != which["jump_over"] == which["duck_under"]
    # Each is learned from ways that get shorter by its own C: where the C is the usual one, it is
    # the policy that all share otherwise.
    np.testing.assert_array_equal(
        two.guide.policies[which["jump_over"]].best, one.guide.policies[0].best
    )
    a, b = (
        approach_motions(targets, QUICK, gaits=["walk"], curve=c).motions.displacement
        for c in (1.0, 0.5)
    )
    assert np.hypot(*b[0, 2, :2]) < 0.8 * np.hypot(*a[0, 2, :2])


def test_each_target_is_prepared_for_with_its_own_curve(guide: Guide):
    """The head goes as far towards the posture as the constant of what is prepared for says."""
    clips = guide.library.clips
    head, count = clips.skeleton.joint("head"), len(guide.policy_of)
    curve = np.full((count, len(clips.skeleton)), 0.5)
    curve[:, head] = np.linspace(0.25, 2.0, count)
    w = Walkers(guide, ["w"], np.zeros((1, 3)), lambda event: None, curve=curve)
    w.heeds[:] = False
    for t in range(count):
        w.wants[:] = t
        for _ in range(round(2.5 * w.fps)):
            w._lead()
        np.testing.assert_allclose(w.shown.postures.curve[0], curve[t], atol=1e-2)
        w.shown.show_cast(w.cast, 0.5, np.arange(1))
        way = angle(w.cast.wxyz[0, head], w.like.wxyz[t, head])
        gone = angle(w.cast.wxyz[0, head], w.shown.wxyz[0, head])
        c = curve[t, head]
        assert gone == pytest.approx((1 - 0.5 ** (1 / c)) ** c * way, abs=0.01)
