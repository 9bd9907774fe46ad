"""A scene of dodgers: what is thrown meets what it should, and the same seed gives the same."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from kumite.annotate import AvoidanceParts, no_avoidance
from kumite.body import lay_body
from kumite.control.attack import thrown
from kumite.control.avoidance import AvoidanceSearch, Outcome
from kumite.control.avoider import Avoider
from kumite.control.protocol import PASS, Plain, View
from kumite.errors import KumiteError
from kumite.graph import build_avoidance, find_avoiding_transitions
from kumite.scene import World
from kumite.scene.balls import Balls, capsules_of, velocity_to
from kumite.scene.events import Avoided, Decision, Missed, Searched, Struck, Throw
from kumite.scene.settings import SceneSettings
from kumite.scene.settings_dodge import (
    BallsSettings,
    DodgerSettings,
    DodgersSettings,
    DodgeSettings,
)
from tests import toys
from tests.dodging import FPS, few

# Balls -------------------------------------------------------------------------------------------


@cache
def body_at_rest():
    clips = toys.clip_set([1])
    position, world = clips.world
    body = lay_body(clips.skeleton)
    return body, capsules_of(body, position, world), clips.root_position


@settings(max_examples=120, deadline=None)
@given(st.integers(0, 10**6), st.floats(1.0, 40.0) | st.floats(40.0, 390.0))
def test_no_ball_passes_through_anybody(seed: int, speed: float):
    body, capsules, roots = body_at_rest()
    rng = np.random.default_rng(seed)
    k = int(rng.integers(len(body)))
    goal = capsules[0, 0, k] + rng.random() * (capsules[1, 0, k] - capsules[0, 0, k])
    way = rng.normal(size=3) * [1, 0.3, 1]
    way /= np.linalg.norm(way)
    radius = float(rng.uniform(0.01, 0.2))
    assume(goal[1] > radius)  # lower it lies on the floor
    balls = Balls(BallsSettings(radius=radius, gravity=0.0, pool=1), body, FPS)
    start = goal - way * rng.uniform(1.5, 3.0)
    start[1] = max(start[1], radius)
    balls.throw(start, velocity_to(start, goal, speed, 0.0), 0.0)
    for _ in range(int(6.0 / speed * FPS) + 2):
        hits = balls.step(roots, np.stack([capsules, capsules]))
        if hits:
            assert hits[0][1] == 0
            return
        if balls.attack[0] is None:
            pytest.fail("it came down")
    pytest.fail("it passed through")


@pytest.mark.parametrize("speed", [1.0, 5.0, 13.0, 40.0, 200.0])
def test_a_ball_that_misses_by_a_centimetre_misses(speed: float):
    body, capsules, roots = body_at_rest()
    radius = 0.11
    spread = np.concatenate([capsules[0, 0], capsules[1, 0]])
    side = float((spread[:, 0] + np.tile(np.maximum(body.radius_start, body.radius_end), 2)).max())
    for off, met in ((0.01, False), (-0.02, True)):
        balls = Balls(BallsSettings(radius=radius, gravity=0.0), body, FPS)
        goal = spread[np.argmax(spread[:, 0])].copy()
        goal[0] = side + radius + off
        balls.throw(goal - [0, 0, 2.0], np.array([0, 0, speed]), 0.0)
        hits = []
        for _ in range(int(4.0 / speed * FPS) + 2):
            hits += balls.step(roots, np.stack([capsules, capsules]))
        assert bool(hits) == met


@pytest.mark.parametrize("lands", [True, False])
def test_a_ball_that_lands_before_a_foot_does_not_strike_it(lands: bool):
    """Not even in the frame in which it lands, which would end under the ground."""
    body, capsules, roots = body_at_rest()
    radius, speed = 0.11, 12.0
    b = body.part("left_foot")
    foot = capsules[:, 0, b].mean(axis=0)
    goal = np.array([foot[0], radius, foot[2]])  # it comes down here …
    fat = max(body.radius_start[b], body.radius_end[b])
    if lands:  # … or so far before that it does not touch
        before = capsules[:, 0, :, 2].max() + fat + radius + 0.02
        goal[2] = max(before, goal[2])
    struck = []
    for share in np.linspace(0.05, 0.95, 10):  # of the frame in which it lands
        balls = Balls(BallsSettings(radius=radius, gravity=0.0, pool=1), body, FPS)
        velocity = np.array([0.0, -0.4 * speed, -speed])
        balls.throw(goal - velocity * (5 + share) / FPS, velocity, 0.0)
        hits = []
        for _ in range(6):
            hits += balls.step(roots, np.stack([capsules, capsules]))
        assert balls.attack[0] is None
        struck.append(bool(hits))
    assert not any(struck) if lands else all(struck)


def test_a_ball_is_where_its_attack_says():
    body, capsules, roots = body_at_rest()
    balls = Balls(BallsSettings(), body, FPS)
    n = balls.throw(np.array([50.0, 1.5, 0]), np.array([3.0, 4.0, 5.0]), 2.0)
    attack = balls.attack[n]
    assert attack is not None
    for f in range(1, 20):
        balls.step(roots, np.stack([capsules, capsules]))
        # Between its times an attack is straight: 5 mm at most off the curve.
        np.testing.assert_allclose(balls.position[n], attack.at(2.0 + f / FPS)[0], atol=5e-3)


@pytest.mark.parametrize("wrong", [{"speed": (9.0, 8.0)}, {"speed": (0.0, 8.0)}, {"radius": 0.0}])
def test_balls_that_make_no_sense(wrong):
    with pytest.raises(ValueError, match=r"expected|greater"):
        BallsSettings(**wrong)


# The scene ---------------------------------------------------------------------------------------


def scene(seed: int = 1, count: int = 1, reaction: float = 0.0, every: float = 1.2) -> World:
    one = DodgerSettings(name="d", position=(0, 0), reaction=reaction)
    who: dict = {"dodger": [one.model_dump()]}
    if count > 1:
        many = DodgersSettings(count=count, spacing=2.0, reaction=reaction)
        who = {"dodgers": many.model_dump()}
    made = SceneSettings.model_validate(
        {
            "title": "t",
            "about": "a",
            **who,
            "balls": {"throws": 1000, "every": every, "first": 0.3, "speed": [5.0, 9.0]},
        }
    )
    return World(made, few(), seed=seed)


def told(made: World, frames: int) -> tuple[bytes, list]:
    poses = []
    for _ in range(frames):
        made.step()
        poses.append(made.wxyz.tobytes() + made.root_position.tobytes())
    return b"".join(poses), [e.to_json() for e in made.events]


@pytest.mark.parametrize("reaction", [0.0, 0.2])
def test_the_same_seed_gives_the_same_bytes(reaction: float):
    first = told(made := scene(4, 2, reaction), 240)
    made.reset(4)
    assert told(made, 240) == first
    kinds = [e[1] for e in first[1]]
    assert kinds.count("throw") >= 6
    made.reset(5)
    assert told(made, 240) != first


def test_another_changes_nobody_elses_luck():
    """Each draws from numbers of its own, whoever else is there."""
    poses = []
    for count in (2, 3):
        made = scene(4, 1, every=100.0)
        who = [DodgerSettings(name=f"d{k}", position=(3.0 * k, 0)) for k in range(count)]
        made = World(made.settings.model_copy(update={"dodger": tuple(who)}), few(), seed=4)
        made.fire.streams = False
        for _ in range(120):
            made.step()
        poses.append(made.wxyz[:2].copy())
    assert np.array_equal(*poses)


def test_every_throw_is_told_of_once():
    made = scene(2, 3, every=0.4)
    for _ in range(400):
        made.step()
    ends = [e.attack for e in made.events if isinstance(e, Struck | Avoided | Missed)]
    assert len(ends) == len(set(ends))
    thrown = [e.attack for e in made.events if isinstance(e, Throw)]
    assert set(ends) <= set(thrown) and len(ends) >= len(thrown) - 8


def test_what_comes_near_nobody_is_not_avoided():
    made = scene(1, 1, every=100.0)
    here, ahead = made.root_position[0], np.array([0.0, 0.3, 5.0])
    aside = np.array([3.0, 0.5, 0.0])
    made.fire.throw(here + aside + ahead, here + aside - ahead, 9.0)
    made.fire.throw(here + ahead, here, 9.0)
    for _ in range(240):
        made.step()
    ends = {e.attack: e for e in made.events if isinstance(e, Struck | Avoided | Missed)}
    assert isinstance(ends[1], Missed) and not isinstance(ends[2], Missed)


def test_avoiding_helps():
    seen = {}
    for blind in (False, True):
        made = scene(7, 4, every=0.5)
        if blind:
            for controllers in made.controllers:
                del controllers[0]
        for _ in range(700):
            made.step()
        kinds = [e.kind for e in made.events]
        seen[blind] = kinds.count("struck") / max(kinds.count("throw"), 1)
    assert seen[False] < seen[True]


# What is known, and when -------------------------------------------------------------------------


@pytest.mark.parametrize("reaction", [0.0, 0.1, 0.25])
def test_nobody_sees_what_cannot_have_been_seen_yet(reaction: float):
    """Until a reaction after the throw all goes on as if nothing had been thrown."""
    with_ball, without = scene(3, 1, reaction, every=100.0), scene(3, 1, reaction, every=100.0)
    with_ball.fire.streams = without.fire.streams = False
    begin = 17
    for made in (with_ball, without):
        for _ in range(begin):
            made.step()
    ahead = np.array([0.0, 0.0, 7.0])
    with_ball.fire.throw(with_ball.root_position[0] + ahead, with_ball.root_position[0], 4.5)
    same = []
    for _ in range(45):
        with_ball.step()
        without.step()
        same.append(np.array_equal(with_ball.wxyz, without.wxyz))
    known = begin + int(np.ceil(reaction * FPS - 1e-9))
    searches = [e for e in with_ball.events if isinstance(e, Searched)]
    assert searches[0].frame == known
    assert all(same[: known - begin])
    assert any(e.outcome == Outcome.FOUND for e in searches)
    assert not all(same)  # it does something about it


def test_more_of_an_attack_replaces_it_a_reaction_later():
    avoider = Avoider(AvoidanceSearch(few()), lambda found, threat: None, reaction=0.2)
    first, better = (thrown([0.0, 1.0, z], [0.0, 2.0, -9.0], 0.1) for z in (6.0, 7.0))
    avoider.mind(first, 4, 0.0, attacker="red")
    avoider.mind(better, 4, 0.1, attacker="red")
    avoider.mind(first, 5, 0.1, avoid=False)
    assert avoider.watches
    for now, known in ((0.19, []), (0.2, [first]), (0.3, [better, first])):
        avoider._learn(now)
        assert [t.attack for t in avoider.threats] == known
    assert [t.settled for t in avoider.threats] == [False, True]
    avoider.forget(4)
    avoider.forget(5)
    assert not avoider.watches


def test_who_is_not_attacked_is_not_asked(monkeypatch):
    made, asked = scene(1, 3, every=100.0), []
    watch = Avoider.watch

    def noted(self, view):
        asked.append((view.me, view.frame))
        return watch(self, view)

    monkeypatch.setattr(Avoider, "watch", noted)
    made.fire.streams = False
    for _ in range(60):
        made.step()
    assert not asked
    here = made.root_position[2]
    behind = here - np.array([0.0, 0.0, 6.0])  # the ball goes on to the first, not to the second
    made.fire.throw(behind, here, 9.0, at=2)
    for _ in range(200):
        made.step()
    assert 2 in {k for k, _ in asked} <= {0, 2} and max(f for _, f in asked) < 180


class Whim(Plain):
    """Takes any way on now and then, whatever anybody else wants."""

    name = "whim"

    def watch(self, view: View) -> int | None:
        return int(view.cast.stop[view.me]) if view.rng.random() < 0.05 else None

    def choose(self, view: View) -> int:
        table = few().table
        if view.rng.random() < 0.6:
            return PASS
        state = int(np.searchsorted(table.state_frame, view.cast.stop[view.me]))
        return int(view.rng.choice(table.stretch[table.actions_of(state)]))


def test_a_plan_is_dropped_where_somebody_else_goes_elsewhere():
    """Whatever stands before it, every edge begins in the state in which the last has ended."""
    made, table = scene(5, 2, every=0.4), few().table
    for controllers in made.controllers:
        controllers.insert(0, Whim())
    at = [int(table.target[s]) for s in made._begun_in]
    for _ in range(900):
        made.step()
    told = [e for e in made.events if isinstance(e, Decision)]
    for e in told:
        k = made.names.index(e.character)
        assert e.stretch in table.stretch[table.actions_of(at[k])]
        at[k] = int(table.target[e.stretch])
    by = [e.by for e in told]
    assert min(by.count(n) for n in ("whim", "avoid", "roam")) > 3


# The graph ---------------------------------------------------------------------------------------


def test_transitions_leave_parts_whole():
    library = few()
    parts, clips = library.avoidance, library.clips
    made = find_avoiding_transitions(clips, parts)
    inner = parts.inner
    jump = made.target != made.source + 1
    assert not np.any(inner[made.target[jump]]), "entered behind its first frame"
    goes_on = np.append(inner[1:], False)
    assert not np.any(goes_on[made.source[jump]]), "left before its last frame"
    assert np.all(made.cost >= 0) and np.all(np.isfinite(made.cost))
    # And each part is whole in some stretch.
    assert np.unique(library.parts_of_stretch[1]).tolist() == list(range(len(parts)))


def test_every_state_reaches_a_part():
    search = AvoidanceSearch(few())
    assert np.all(np.isfinite(search.graph.soonest))
    assert search.graph.soonest.max() < 4.0 * FPS


def test_every_part_can_be_reached_from_somewhere_else():
    library = few()
    table = library.table
    begin, _ = library.parts_of_stretch
    with_part = np.flatnonzero(np.diff(begin))
    ways = [int(np.sum(table.stretch == s)) for s in with_part]
    assert max(ways) > 3


@pytest.mark.parametrize(
    "wrong", [{"every": 0.0}, {"every": np.nan}, {"offered": 0}, {"worst": 0.0}, {"worst": np.inf}]
)
def test_graphs_that_make_no_sense(wrong):
    with pytest.raises(KumiteError, match="expected"):
        find_avoiding_transitions(few().clips, few().avoidance, **wrong)


def test_no_parts_no_graph():
    clips = few().clips
    with pytest.raises(KumiteError, match="no avoidance parts"):
        build_avoidance(clips, no_avoidance(clips.clip_start))
    others = AvoidanceParts(np.array([1]), np.array([3]), np.array([0, 9]))
    with pytest.raises(KumiteError, match="of other clips"):
        build_avoidance(clips, others)
    still = toys.clip_set([90])
    with pytest.raises(KumiteError, match="no avoidance parts"):
        build_avoidance(still)


def test_settings_that_make_no_sense():
    wrong: dict[str, Any]
    for wrong in ({"window": 0}, {"most": 8.0}, {"latency": 1}, {"body": -1}):
        with pytest.raises(ValueError, match=r"input|less|greater|reaction"):
            DodgeSettings(**wrong)
