"""A scene of dodgers: what is thrown meets what it should, and the same seed gives the same."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from kumite.annotate import AvoidanceParts, no_avoidance
from kumite.body import lay_body
from kumite.control.avoidance import Avoidance, AvoidanceSearch, Outcome, Plan
from kumite.errors import KumiteError
from kumite.graph import build_avoidance, find_avoiding_transitions
from kumite.scene import dodgers
from kumite.scene.balls import Balls, capsules_of, velocity_to
from kumite.scene.dodge import DodgeScene
from kumite.scene.dodgers import _after
from kumite.scene.events import Avoided, Missed, Stale, Struck, Throw
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


def scene(seed: int = 1, count: int = 1, latency: int = 1, every: float = 1.2) -> DodgeScene:
    who: dict = {"dodger": [DodgerSettings(name="d", position=(0, 0)).model_dump()]}
    if count > 1:
        who = {"dodgers": DodgersSettings(count=count, spacing=2.0).model_dump()}
    made = SceneSettings.model_validate(
        {
            "title": "t",
            "about": "a",
            **who,
            "balls": {"throws": 1000, "every": every, "first": 0.3, "speed": [5.0, 9.0]},
            "dodge": {"latency": latency},
        }
    )
    return DodgeScene(made, few(), seed=seed)


def told(made: DodgeScene, frames: int) -> tuple[bytes, list]:
    poses = []
    for _ in range(frames):
        made.step()
        poses.append(made.wxyz.tobytes() + made.root_position.tobytes())
    return b"".join(poses), [e.to_json() for e in made.events]


@pytest.mark.parametrize("latency", [1, 10])
def test_the_same_seed_gives_the_same_bytes(latency: int, monkeypatch):
    first = told(made := scene(4, 2, latency), 240)
    made.reset(4)
    assert told(made, 240) == first
    kinds = [e[1] for e in first[1]]
    assert kinds.count("throw") >= 6
    # However long searches take, and in however many threads.
    plain, rng = AvoidanceSearch.search, np.random.default_rng(0)

    def late(self, *given, **more):
        time.sleep(float(rng.uniform(0.0, 0.03)))
        return plain(self, *given, **more)

    monkeypatch.setattr(AvoidanceSearch, "search", late)
    monkeypatch.setattr(dodgers, "_POOL", [ThreadPoolExecutor(3)])
    made.reset(4)
    assert told(made, 240) == first
    made.reset(5)
    assert told(made, 240) != first


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
    made.throw(here + aside + ahead, here + aside - ahead, 9.0)
    made.throw(here + ahead, here, 9.0)
    for _ in range(240):
        made.step()
    ends = {e.attack: e for e in made.events if isinstance(e, Struck | Avoided | Missed)}
    assert isinstance(ends[1], Missed) and not isinstance(ends[2], Missed)


def test_avoiding_helps():
    seen = {}
    for blind in (False, True):
        made = scene(7, 4, every=0.5)
        if blind:
            vars(made.dodgers)["menace"] = lambda *given, **said: None
        for _ in range(700):
            made.step()
        kinds = [e.kind for e in made.events]
        seen[blind] = kinds.count("struck") / max(kinds.count("throw"), 1)
    assert seen[False] < seen[True]


# Searches in the background ----------------------------------------------------------------------


def test_what_is_left_of_a_path():
    assert _after((1, 2, 3), []) == (1, 2, 3)
    assert _after((1, 2, 3), [1]) == (2, 3)
    assert _after((1, 2, 3), [1, 2, 3]) == ()
    assert _after((1, 2, 3), [2]) is None
    assert _after((1,), [1, 2]) is None
    assert _after((), [1]) is None


def found_by(made: DodgeScene, paths: list[tuple[int, ...]]) -> Avoidance:
    now = made.frame / made.fps
    plan = Plan(paths[0], 0, now, np.array([0.0, 30.0]), np.array([0.0, 1.0]))
    others = tuple((p, 0) for p in paths[1:])
    told = {"cost": 0.5, "costs": (0.2, 0.2, 0.1), "distance": 0.1, "before": -0.1}
    return Avoidance(Outcome.FOUND, paths[0], 0, 0.5, **told, plan=plan, others=others)


@pytest.mark.parametrize("fits", [True, False])
def test_stale_candidates_are_dropped(fits: bool, monkeypatch):
    """Another edge has begun meanwhile: the best path with that edge is taken, or none."""
    table, timed = few().table, []
    made = scene(1, 1, latency=75)
    made.step()
    mind = made.dodgers.minds[0]
    state = int(table.target[mind.stretch])
    ways = table.stretch[table.actions_of(state)].tolist()
    calm = [w for w in ways if not made.dodgers._avoids[w]]
    other = ways[0]

    def searched(self, standing, attacks, now, *, main=0):
        # Whatever is chosen, one of these goes on with it.
        return found_by(made, [(99999, other), *((w, other) for w in calm if fits)])

    def plan(self, standing, path, part, aim, now):
        timed.append(tuple(path))
        return Plan(tuple(path), part, now, np.array([0.0, 30.0]), np.array([0.0, 1.0]))

    monkeypatch.setattr(AvoidanceSearch, "search", searched)
    monkeypatch.setattr(AvoidanceSearch, "timed", plan)
    made.throw(np.array([0.0, 1.2, 7.0]), np.array([0.0, 1.2, 0.0]), 2.0)
    edges = mind.edges
    for _ in range(100):
        made.step()
        if timed or any(isinstance(e, Stale) for e in made.events):
            break
    assert mind.edges > edges
    if fits and mind.edges == edges + 1:
        assert timed == [(other,)]
    if not fits:
        assert not timed and any(isinstance(e, Stale) for e in made.events)


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
    for wrong in ({"window": 0}, {"most": 8.0}, {"latency": 0}, {"body": -1}):
        with pytest.raises(ValueError, match=r"input|less|greater"):
            DodgeSettings(**wrong)
