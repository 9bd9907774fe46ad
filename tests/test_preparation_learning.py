"""SARSA of preparation behaviour: closed forms, an exact twin, the rule that ends it, resuming."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from kumite import files
from kumite.control.preparation import (
    KIND,
    LEARNING,
    VERSION,
    Learning,
    Motions,
    PreparationSettings,
    build_process,
    gradual,
    train,
    trained_preparation,
)
from kumite.errors import KumiteError
from kumite.kernels import sarsa as kernels
from tests.preparation_twin import Exact, four_cores, walker

SMALL = PreparationSettings(
    source_distances=3, source_angles=2, goal_angles=4, levels=3, level_step=0.4, places=16
)


def learner_of(states: int, actions: int, seed: int = 1) -> kernels.Learner:
    return kernels.Learner(
        np.zeros((states, actions)),
        np.zeros((states, actions), np.int32),
        np.zeros(states, np.int32),
        np.full(states, actions, np.int32),
        np.array([seed], np.uint64),
    )


def one_class(goal_next, goal_reward, source_next, at_source, level, two_changes=False):
    """A process in which all motions may follow each other: tables without places get one."""
    motions, levels = goal_next.shape[:2]
    actions = motions * levels
    return kernels.Process(
        np.ascontiguousarray(goal_next[..., None], np.int32),
        np.ascontiguousarray(goal_reward[..., None], float),
        np.ascontiguousarray(source_next[..., None], np.int32),
        at_source,
        np.array(level, float),
        0.8,
        two_changes,
        np.array([0, actions]),
        np.arange(actions),
        np.zeros(motions, np.int64),
        np.ones(motions),
    )


def chain() -> kernels.Process:
    """Five cells in a row, the goal before the first; forward pays -1, back -2."""
    forward = np.arange(5) - 1  # before cell 0 is AT_GOAL
    back = np.minimum(np.arange(5) + 1, 4)
    return one_class(
        np.stack([forward, back])[:, None],
        np.repeat([[-1.0], [-2.0]], 5, axis=1)[:, None],
        np.zeros((2, 1, 1)),
        0,
        [0.0, 1.0],
    )


@pytest.mark.jit_off
def test_a_chain_in_closed_form():
    """Q(n, forward) = -(1 - γ^(n+1)) / (1 - γ), Q(n, back) = -2 + γ Q(n + 1, forward)."""
    process, discount = chain(), 0.3
    learner = learner_of(10, 2)
    learner.q[:, 1] = -9.0  # so that forward is the best, and what is evaluated
    rates = kernels.Rates(0.7, math.inf, discount, 0.0, False, 1000)
    kernels.episodes(process, rates, learner, 600)
    worth = -(1 - discount ** np.arange(1, 6)) / (1 - discount)
    assert np.allclose(learner.q[:5, 0], worth, atol=1e-6)
    assert (learner.best == 0).all()
    for n in range(4):  # one flag is left: back is tried once there, and forward is best after it
        learner.q[n, 1] = worth[n]  # while not tried it is met on the way: as good as forward
        learner.visits[:], learner.untried[:] = 1, 0
        learner.visits[n, 1], learner.untried[n] = 0, 1
        while learner.untried[n]:
            kernels.episodes(process, rates._replace(rate=1.0, flags=True), learner, 1)
        assert learner.q[n, 1] == pytest.approx(-2 + discount * worth[n + 1], abs=1e-6)
    assert (learner.best[:4] == 0).all()


@pytest.mark.jit_off
def test_what_was_never_tried_goes_first():
    process = chain()._replace(goal_next=np.full((2, 1, 5, 1), kernels.AT_GOAL, np.int32))
    rates = kernels.Rates(0.7, math.inf, 0.3, 0.0, True, 1000)
    learner = learner_of(10, 2)
    kernels.episodes(process, rates, learner, 200)
    assert learner.visits.min() == 1 or (learner.visits > 0).all()
    assert (learner.untried == 0).all()
    assert (learner.visits[:, 1] == 1).all()  # the worse one: tried once, for its flag
    without = learner_of(10, 2)
    without.q[:, 0] = 1.0
    kernels.episodes(process, rates._replace(flags=False, rate=1e-9), without, 200)
    assert (without.visits[:, 1] == 0).all() and (without.untried == 1).all()


@pytest.mark.jit_off
@pytest.mark.parametrize(
    ("two_changes", "expected"),
    [
        # level before, source cell before (0 is at the source, where the motion always leads)
        (False, {(0.0, 1): -0.8, (1.0, 1): 0.0, (0.0, 0): 0.0, (1.0, 0): -0.8}),
        (True, {(0.0, 1): -0.8, (1.0, 1): -1.6, (0.0, 0): 0.0, (1.0, 0): -0.8}),
    ],
)
def test_on_reaching_the_source_the_level_is_forced_to_one(two_changes, expected):
    """By hand, level 0 chosen each time: 0.8 × -(Δα)², Δα to 1 where the source is reached."""
    process = one_class(
        np.full((1, 1, 1), kernels.AT_GOAL),
        np.zeros((1, 1, 1)),
        np.zeros((1, 1, 2)),
        1,
        [0.0, 1.0],
        two_changes,
    )
    learner = learner_of(4, 1)
    kernels.episodes(process, kernels.Rates(1.0, math.inf, 0.3, 0.1, True, 10), learner, 100)
    for (level, cell), worth in expected.items():
        assert learner.q[int(level) * 2 + cell, 0] == pytest.approx(worth)


def test_the_forced_level_is_the_next_states():
    """Reached from outside, the next state is the one of level 1; within, the chosen level's."""
    process = one_class(
        np.zeros((1, 1, 1)), np.zeros((1, 1, 1)), np.zeros((1, 1, 2)), 1, [0.0, 1.0]
    )
    learner = learner_of(4, 1)
    outcome = kernels.episodes(
        process, kernels.Rates(1.0, math.inf, 0.0, 0.0, True, 2), learner, 1000
    )
    at_source_at_one = learner.visits[2, 0]
    starts = 1000 / 4
    assert at_source_at_one == pytest.approx(3 * starts, rel=0.2)  # started there, or reached it
    assert outcome[3] == 1000  # no episode came to the goal


@pytest.mark.jit_off
def test_the_reward_by_hand():
    """0.1 (-|θ_g|) + 0.5 (d_g before - d_g after), from the one place of each cell."""
    motions = Motions(
        ("forward", "turn left"),
        np.array([[(0.0, 0.5, 0.0)], [(0.0, 0.0, math.pi / 4)]]),
        np.ones(2),
        np.ones((2, 2), bool),
    )

    def rewards(farthest: float, arrival: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        cell, reward = np.empty((2, 1, 8, 1), np.int32), np.empty((2, 1, 8, 1))
        polar = kernels.Polar(0.6, 2, 8, farthest)
        weights = kernels.Weights(0.1, 0.5, arrival)
        kernels.goal_steps(motions.displacement, polar, weights, cell, reward)
        return cell[:, 0, :, 0], reward[:, 0, :, 0]

    cells, reward = rewards(2.6)
    away = 1.6  # the middle of 0.6 to 2.6 m
    off = (0.6180339887498949 - 0.5) * math.pi / 4  # to the left of the cell's middle
    for cell in range(8):
        angle = math.remainder(cell * math.pi / 4 + off, 2 * math.pi)
        x, z = away * math.sin(angle), away * math.cos(angle)
        left, nearer = math.atan2(x, z - 0.5), away - math.hypot(x, z - 0.5)
        assert reward[0, cell] == pytest.approx(-0.1 * abs(left) + 0.5 * nearer)
        turned = math.remainder(angle - math.pi / 4, 2 * math.pi)
        assert reward[1, cell] == pytest.approx(-0.1 * abs(turned))
        assert cells[1, cell] == (cell - 1) % 8
    cells, reward = rewards(1.2)  # 0.9 m away: a step ahead is at the goal
    assert cells[0, 0] == kernels.AT_GOAL != cells[0, 4]
    more = rewards(1.2, arrival=1.0)[1] - reward
    assert np.allclose(more, cells == kernels.AT_GOAL)


@pytest.mark.parametrize("settings", [SMALL, replace(gradual(), places=16)])
def test_tables_equal_the_twin(settings: PreparationSettings):
    motions = four_cores(settings)
    process, exact = build_process(motions, settings), Exact(motions, settings)
    goals = len(exact.goals)
    for u, (m, a) in enumerate(exact.actions):
        for g in range(goals):
            cells = np.where(process.goal_next[m, a, g] < 0, goals, process.goal_next[m, a, g])
            share = np.bincount(cells, minlength=goals + 1) / settings.places
            assert np.allclose(share, exact.to_goal[u, g]), (m, a, g)
        assert np.allclose(process.goal_reward[m, a].mean(axis=-1), exact.gain[u])
        for i in range(len(exact.sources)):
            share = np.bincount(process.source_next[m, a, i], minlength=len(exact.sources))
            assert np.allclose(share / settings.places, exact.to_source[u, i]), (m, a, i)


def test_exact_solutions_agree():
    """Policy iteration ends where value iteration does."""
    exact = Exact(four_cores(SMALL), SMALL)
    policy = exact.q(np.zeros(exact.shape)).argmax(axis=-1)
    for _ in range(50):
        value = exact.value(policy)
        better = exact.q(value).argmax(axis=-1)
        if (better == policy).all():
            break
        policy = better
    assert np.allclose(exact.value(policy), exact.solve(), atol=1e-9)


@pytest.mark.parametrize(
    ("settings", "bounds"),
    [(SMALL, (0.02, 0.35)), (replace(SMALL, discount=0.7, arrival=1.0), (0.06, 0.5))],
)
def test_regret_is_small(settings: PreparationSettings, bounds: tuple[float, float]):
    motions = four_cores(settings)
    policy = train(motions, settings, seed=3)
    mean, largest = Exact(motions, settings).regret(policy.best)
    print(f"regret over the range of V*: mean {mean:.4f}, largest {largest:.3f}")
    assert policy.converged
    assert mean <= bounds[0] and largest <= bounds[1]


def test_at_a_constant_rate_it_does_not_come_to_rest():
    """Why the rate settles: at λ throughout, best actions change for ever, by chance."""
    settings = replace(SMALL, settling=math.inf)
    policy = train(walker(settings=settings), settings, most_batches=60)
    assert not policy.converged and policy.curve.changed[-1] > 0.05


def test_the_rule_that_ends_it():
    motions = walker(settings=SMALL)
    policy = train(motions, SMALL)
    changed = policy.curve.changed
    assert policy.converged and changed[-1] < 0.02 and (changed[:-1] >= 0.02).all()
    learning = Learning(motions, SMALL)
    before = learning.learner.best.copy()
    share = learning.batch()
    assert share == (before != learning.learner.best).mean() == changed[0]
    never = train(motions, replace(SMALL, changed=0.0), most_batches=5)
    assert not never.converged and len(never.curve) == 5
    # few enough changes are no end while there are actions that nobody tried
    soon = Learning(motions, replace(SMALL, changed=1.0, batch=1, longest=1))
    soon.batch()
    assert soon.untried > 0 and not soon.converged


def test_best_actions_are_the_largest_values():
    motions = four_cores(SMALL)
    learning = Learning(motions, SMALL, seed=5)
    for _ in range(5):
        learning.batch()
    rows = np.unique(motions.follows, axis=0)
    allowed = np.repeat(np.repeat(rows, SMALL.levels, axis=1), learning.states // len(rows), axis=0)
    q = np.where(allowed, learning.learner.q, -np.inf)
    assert (learning.learner.best == q.argmax(axis=1)).all()
    assert (learning.learner.visits[~allowed] == 0).all()
    left = ((learning.learner.visits == 0) & allowed).sum(axis=1)
    assert (learning.learner.untried == left).all()


def test_the_same_seed_gives_the_same_bytes(tmp_path):
    motions = walker(settings=SMALL)
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        learning = Learning(motions, SMALL, seed)
        for _ in range(4):
            learning.batch()
        learning.save(tmp_path / name)
    a, b, c = ((tmp_path / n).read_bytes() for n in "abc")
    assert a == b != c


def test_what_is_taken_up_again_gives_the_same_bytes(tmp_path):
    motions = walker(settings=SMALL)
    whole = Learning(motions, SMALL)
    for _ in range(5):
        whole.batch()
    whole.save(tmp_path / "whole")
    for stop in range(5):
        part = Learning(motions, SMALL)
        for _ in range(stop):
            part.batch()
        part.save(tmp_path / "part")
        again = Learning.load(tmp_path / "part", motions, SMALL)
        for _ in range(5 - stop):
            again.batch()
        again.save(tmp_path / "again")
        assert (tmp_path / "again").read_bytes() == (tmp_path / "whole").read_bytes(), stop
    with pytest.raises(KumiteError, match="other motions"):
        Learning.load(tmp_path / "part", motions, SMALL, seed=9)
    (tmp_path / "part").write_bytes(b"nothing")
    with pytest.raises(KumiteError, match="damaged"):
        Learning.load(tmp_path / "part", motions, SMALL)


def test_an_interruption_is_taken_up(tmp_path):
    motions, kept = walker(settings=SMALL), tmp_path / "kept"
    whole = train(motions, SMALL)

    def interrupt(batch: int, changed: float) -> None:
        if batch == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(motions, SMALL, checkpoint=kept, progress=interrupt)
    seen: list[int] = []
    policy = train(
        motions, SMALL, checkpoint=kept, progress=lambda batch, changed: seen.append(batch)
    )
    assert seen[0] == 4 and not kept.exists()
    assert policy.best.tobytes() == whole.best.tobytes()
    assert policy.curve.changed.tobytes() == whole.curve.changed.tobytes()


def test_an_interruption_within_a_batch_leaves_what_was_before_it(tmp_path, monkeypatch):
    motions, play = walker(settings=SMALL), kernels.episodes
    learning = Learning(motions, SMALL)
    learning.batch()
    learning.save(tmp_path / "before")

    def interrupted(*arguments):
        play(*arguments)
        raise KeyboardInterrupt

    monkeypatch.setattr(kernels, "episodes", interrupted)
    with pytest.raises(KeyboardInterrupt):
        learning.batch()
    learning.save(tmp_path / "after")
    assert (tmp_path / "after").read_bytes() == (tmp_path / "before").read_bytes()


def test_it_is_found_again_by_content(tmp_path):
    motions = walker(settings=SMALL)
    first = trained_preparation(motions, tmp_path, SMALL)
    batches: list[int] = []
    again = trained_preparation(
        motions, tmp_path, SMALL, progress=lambda batch, changed: batches.append(batch)
    )
    assert not batches and again.seconds == first.seconds and again.converged
    assert (again.best == first.best).all() and len(again.curve) == len(first.curve)
    trained_preparation(walker(0.5, settings=SMALL), tmp_path, SMALL)
    assert len(list(tmp_path.iterdir())) == 2
    for path in tmp_path.iterdir():
        path.write_bytes(b"damaged")
    assert (trained_preparation(motions, tmp_path, SMALL).best == first.best).all()
    assert (trained_preparation(motions, None, SMALL).best == first.best).all()


@pytest.mark.parametrize("name, wrong", [("best", 10**6), ("best", -1), ("class_after", 99)])
def test_forged_policies_are_learned_again(tmp_path, name: str, wrong: int):
    motions = walker(settings=SMALL)
    first = trained_preparation(motions, tmp_path, SMALL)
    (path,) = tmp_path.glob("*.policy")
    header, arrays = files.load(path, KIND, VERSION)
    arrays[name] = arrays[name].copy()
    arrays[name].flat[0] = wrong
    files.save(path, KIND, VERSION, header, arrays)
    assert (trained_preparation(motions, tmp_path, SMALL).best == first.best).all()
    assert (files.load(path, KIND, VERSION)[1]["best"] == first.best).all()
    with pytest.raises(KumiteError, match=name):
        replace(first, **{name: arrays[name]})


@pytest.mark.parametrize("name", ["q", "visits", "best", "untried", "curve"])
def test_forged_learning_is_refused(tmp_path, name: str):
    motions, path = walker(settings=SMALL), tmp_path / "kept.learning"
    learning = Learning(motions, SMALL)
    learning.batch()
    learning.save(path)
    header, arrays = files.load(path, LEARNING, VERSION)
    arrays[name] = arrays[name].copy()
    arrays[name].flat[0] = np.nan if arrays[name].dtype.kind == "f" else -(10**6)
    files.save(path, LEARNING, VERSION, header, arrays)
    with pytest.raises(KumiteError, match="damaged"):
        Learning.load(path, motions, SMALL)


def test_decisions_come_from_the_cell_that_is_seen():
    motions = four_cores()
    policy = Learning(motions).policy()
    best = np.arange(policy.best.size).reshape(policy.best.shape) % 35
    policy = replace(policy, best=best)
    walk = policy.class_after[1]
    eighth, quarter = math.pi / 4, math.pi / 2
    for level, d_g, theta_g, d_i, theta_i, index in (
        (0.0, 0.7, 0.0, 0.1, 0.0, (walk, 0, 0, 0)),
        (0.11, 9.0, 0.49 * eighth, 0.61, quarter, (walk, 1, 0, 5)),
        (1.0, 1.0, 0.51 * eighth, 99.0, -quarter, (walk, 5, 1, 19)),
        (0.79, 0.1, -eighth, 1.3, math.pi, (walk, 4, 7, 10)),  # at the goal: as just before it
        (0.0, 0.7, 2 * math.pi - eighth, 0.1, -math.pi, (walk, 0, 7, 2)),
    ):
        motion, chosen = policy.decide(1, level, d_g, theta_g, d_i, theta_i)
        assert motion == best[index] // 5
        assert chosen == pytest.approx(0.2 * (best[index] % 5))
    motion, chosen = policy.decide([1, 2], 0.0, [0.7, 1.0], 0.0, 2.0, 0.1)
    assert motion.shape == chosen.shape == (2,)
    assert policy.at_goal(0.59) and not policy.at_goal(0.6)
    assert list(policy.at_source(np.array([0.5, 0.7]))) == [True, False]


def approach(policy, motions, goal=3.2, angle=0.2) -> tuple[float, list[float]]:
    """Walk to a goal that is the source of influence: how near it came, the levels chosen."""
    motion, level, levels = 0, 0.0, []
    for _ in range(30):
        if policy.at_goal(goal):
            break
        motion, level = policy.decide(motion, level, goal, angle, goal, angle)
        column = int(np.argmin(np.abs(policy.settings.chosen - level)))
        goal, angle = kernels.seen_after(motions.displacement[motion, column], goal, angle)
        levels.append(float(level))
    return goal, levels


@pytest.mark.slow
def test_printed_numbers_halt_before_the_source_and_gradual_ones_prepare():
    motions = walker()
    stopped, levels = approach(train(motions), motions)
    assert 0.6 <= stopped < 1.3 and len(levels) == 30 and max(levels) <= 0.2
    prepared = train(motions, gradual())
    for goal, angle in ((3.2, 0.2), (2.9, 0.0), (3.5, 1.0)):
        near, levels = approach(prepared, motions, goal, angle)
        assert near < 0.6 and levels[0] == 0 and levels[-1] >= 0.4


def test_a_level_of_1_may_be_one_of_those_chosen():
    """Six levels; then none is added for the one forced."""
    settings = PreparationSettings(levels=6)
    assert list(settings.all_levels) == list(settings.chosen)
    assert len(PreparationSettings().all_levels) == 6
    assert build_process(walker(settings=settings), settings).level[-1] == 1.0


def spoiled(**changes) -> Motions:
    return replace(walker(), **changes)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Motions((), np.zeros((0, 5, 3)), np.zeros(0), np.zeros((0, 0))), "there are none"),
        (lambda: spoiled(names=("stand",) * 7), "different"),
        (lambda: spoiled(displacement=np.zeros((7, 3))), r"expected \(7, levels, 3\)"),
        (lambda: spoiled(displacement=np.zeros((6, 5, 3))), r"expected \(7, levels, 3\)"),
        (lambda: spoiled(displacement="far"), "displacement: 'far'; expected an array of numbers"),
        (lambda: spoiled(displacement=np.full((7, 5, 3), np.nan)), "must be finite"),
        (lambda: spoiled(duration=np.ones(6)), r"duration \(6,\), expected \(7,\)"),
        (lambda: spoiled(duration=np.zeros(7)), "more than 0 s"),
        (lambda: spoiled(follows=np.ones((7, 6))), r"expected \(7, 7\)"),
        (lambda: spoiled(follows=np.zeros((7, 7))), "no motion may follow 'stand'"),
        (lambda: Learning(spoiled(displacement=np.zeros((7, 4, 3)))), "for 4 levels, the settings"),
        (lambda: Learning(spoiled(displacement=np.zeros((7, 5, 3)))), "cannot be reached"),
        (lambda: Learning(spoiled(follows=np.eye(7))), "cannot be reached"),
        (lambda: PreparationSettings(discount=1.0), "discount 1.0"),
        (lambda: PreparationSettings(discount=-0.1), "discount"),
        (lambda: PreparationSettings(discount=math.nan), "discount"),
        (lambda: PreparationSettings(explore=1.5), "explore 1.5"),
        (lambda: PreparationSettings(explore=-0.1), "explore"),
        (lambda: PreparationSettings(rate=0.0), "rate"),
        (lambda: PreparationSettings(settling=0.0), "settling"),
        (lambda: PreparationSettings(changed=2.0), "changed"),
        (lambda: PreparationSettings(levels=7), "7 levels"),
        (lambda: PreparationSettings(levels=True), "levels True"),
        (lambda: PreparationSettings(goal_distances=1), "goal_distances 1"),
        (lambda: PreparationSettings(goal_step="far"), "goal_step 'far', expected a number"),  # type: ignore[arg-type]
        (lambda: PreparationSettings(goal_step=-1.0), "steps of distance"),
        (lambda: PreparationSettings(farthest=2.4), "farthest 2.4 m"),
        (lambda: PreparationSettings(steadiness=-1.0), "steadiness"),
        (lambda: PreparationSettings(batch=0), "batch 0"),
        (lambda: Learning(walker(), PreparationSettings(source_angles=10**6)), "take fewer"),
        (lambda: Learning(walker()).policy().decide(7, 0, 1, 0, 1, 0), "expected 0 to 6"),
        (lambda: Learning(walker()).policy().decide(0.5, 0, 1, 0, 1, 0), "expected 0 to 6"),
        (lambda: Learning(walker()).policy().decide(0, 2, 1, 0, 1, 0), "level of 0 to 1"),
        (lambda: Learning(walker()).policy().decide(0, 0, -1, 0, 1, 0), "not below 0"),
        (lambda: Learning(walker()).policy().decide(0, 0, math.nan, 0, 1, 0), "finite"),
    ],
)
def test_bad_input_is_said_once(make, message):
    with pytest.raises(KumiteError, match=message):
        make()
