"""The search for an avoidance, against its slow twin and without what makes it quick."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kumite.annotate import no_avoidance
from kumite.control.attack import Attack, packed, thrown
from kumite.control.avoidance import AvoidanceRules, AvoidanceSearch, Outcome, Standing
from kumite.control.volumes import hung
from kumite.errors import KumiteError
from kumite.kernels import avoid as kernels
from kumite.kernels.joins import ANKLE
from kumite.kernels.weighing import weigh
from kumite.rotation import planar_apply
from kumite.synthesis import Cast
from tests.avoid_twin import Twin
from tests.dodging import Foresight, at_body, few, somewhere

COUNTS = {kernels.VALID: "valid", kernels.STIFF: "stiff", kernels.TOO_FAST: "too fast"}


@cache
def searching(**rules) -> AvoidanceSearch:
    return AvoidanceSearch(few(), AvoidanceRules(**{"index": True, **rules}))


def test_a_small_graph_is_not_indexed():
    """Trying all of its paths is quicker; what is found is the same."""
    by_itself, asked = AvoidanceSearch(few()), searching()
    assert not by_itself.indexes and by_itself.index_bytes < 1000 < asked.index_bytes
    for seed in range(8):
        standing, coming, now = case(seed)
        found, known = (s.search(standing, coming, now) for s in (by_itself, asked))
        assert (found.outcome, found.path, found.part) == (known.outcome, known.path, known.part)
        assert not found.indexed


def case(seed: int, attacks: int = 1, radius: tuple[float, float] = (0.03, 0.12)):
    rng = np.random.default_rng(seed)
    search = searching()
    standing = somewhere(rng, few())
    now = float(rng.choice([0.0, 3.25]))
    return (
        standing,
        [
            at_body(rng, search, standing, now, radius=radius, seconds=(0.5, 1.4))
            for _ in range(attacks)
        ],
        now,
    )


@pytest.mark.parametrize("attacks", [1, 2])
def test_the_twin_finds_the_same(attacks: int):
    seen = Counter(same_as_the_twin(1000 * attacks + n, attacks) for n in range(40))
    assert seen[Outcome.FOUND] > 2 and seen[Outcome.HIT] > 5, seen


@pytest.mark.jit_off
def test_nothing_is_written_beside_its_place():
    """As plain Python an index out of range is an error; few, for it takes long."""
    found = [same_as_the_twin(1000 + seed, 1) for seed in range(3)]
    here = Standing(np.zeros(3), float(few().table.first[0]), int(few().table.last[0]), 0)
    large = thrown((0, 1.0, 4.0), (0, 0, -4.0), 2.0, gravity=0.0)  # meets nearly every cell
    found.append(searching().search(here, [large], 0.0).outcome)
    assert Outcome.HIT in found


@cache
def twin() -> Twin:
    return Twin(few(), searching().spheres, searching().settings)


def same_as_the_twin(seed: int, attacks: int) -> str:
    search = searching()
    standing, coming, now = case(seed, attacks)
    found = search.search(standing, coming, now)
    outcome, aim, weighed = twin().search(standing, coming, now)
    assert found.outcome == outcome, seed
    np.testing.assert_allclose(found.aim, aim, atol=1e-9)
    if outcome != Outcome.FOUND:
        return outcome
    best = weighed[0]
    assert (found.path, found.part) == (best.path, best.part), seed
    np.testing.assert_allclose(
        [found.cost, *found.costs, found.overlap, found.distance, found.before, found.scale],
        [best.e, *best.costs, best.overlap, best.d, best.d0, best.s],
        rtol=0,
        atol=1e-6,
    )
    others = [(w.path, w.part) for w in weighed[1:] if w.outcome == "valid"]
    told = [(path, int(search.which[part])) for path, part in found.others]
    if found.indexed:  # the index knows those who leave, and some who do not
        others = [o for o in others if o in told]
    assert told == others[:32]
    if not found.indexed:
        twins = Counter(w.outcome for w in weighed)
        for kind, name in COUNTS.items():
            assert found.counts[kind] == twins[name], (seed, name)
    return outcome


def test_the_index_changes_nothing():
    indexed = 0
    for seed in range(400):
        standing, coming, now = case(seed, 1 + seed % 2)
        quick = searching().search(standing, coming, now)
        slow = searching(index=False).search(standing, coming, now)
        assert quick.outcome == slow.outcome
        if quick.outcome == Outcome.FOUND:
            assert (quick.path, quick.part, quick.cost) == (slow.path, slow.part, slow.cost), seed
            assert sum(quick.counts) <= sum(slow.counts)
        indexed += quick.indexed
        assert not slow.indexed
    assert indexed > 25


def test_culling_changes_nothing():
    culled = 0
    for seed in range(400):
        standing, coming, now = case(seed, radius=(0.1, 0.25))
        quick = searching(index=False).search(standing, coming, now)
        slow = searching(index=False, culling=False).search(standing, coming, now)
        assert (quick.outcome, quick.path, quick.others) == (slow.outcome, slow.path, slow.others)
        if not slow.counts:
            continue
        # What is culled the exact test calls hit, and all else comes to the same.
        assert slow.counts[kernels.CULLED] == 0
        assert quick.counts[kernels.HIT] + quick.counts[kernels.CULLED] == slow.counts[kernels.HIT]
        for kind in (kernels.VALID, kernels.STIFF, kernels.TOO_FAST, kernels.TOO_LONG):
            assert quick.counts[kind] == slow.counts[kind]
        culled += quick.counts[kernels.CULLED]
    assert culled > 50


@settings(max_examples=80, deadline=None)
@given(
    st.integers(0, 10**6),
    st.floats(0.01, 0.6),
    st.floats(0.3, 200.0),
    st.floats(0.3, 1.9),
)
def test_a_culled_candidate_is_hit(seed: int, radius: float, speed: float, seconds: float):
    """Balls of any size and speed in straight lines, through a body or near it."""
    rng = np.random.default_rng(seed)
    search = searching(index=False)
    standing = somewhere(rng, few())
    some = search.volumes.centre[int(standing.phase), :, int(rng.integers(len(search.spheres)))]
    goal = planar_apply(standing.anchor, some.astype(float)) + rng.normal(0, 0.1, 3)
    way = rng.normal(size=3)
    way *= speed / np.linalg.norm(way)
    coming = [thrown(goal - way * seconds, way, radius, seconds=seconds + 1.0, gravity=0.0)]
    quick = search.search(standing, coming, 0.0)
    slow = searching(index=False, culling=False).search(standing, coming, 0.0)
    assert (quick.outcome, quick.path, quick.others) == (slow.outcome, slow.path, slow.others)
    if slow.counts:
        hits = quick.counts[kernels.HIT] + quick.counts[kernels.CULLED]
        assert hits == slow.counts[kernels.HIT]
    with_index = searching().search(standing, coming, 0.0)
    assert (with_index.outcome, with_index.path) == (slow.outcome, slow.path)


# What joins leave --------------------------------------------------------------------------------


def played(seed: int, scale: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Two edges after some others, slowed by ``scale``: distances [T, B] m of the spheres foreseen
    and of those captured from those shown, and s since the last join [T].
    """
    rng = np.random.default_rng(seed)
    search, cast, table = searching(), Cast(few(), 1), few().table
    fps, spheres = search.graph.fps, search.spheres

    def onward(state: int) -> int:
        return int(table.stretch[rng.integers(*table.action_start[state : state + 2])])

    state = int(rng.integers(table.states))
    cast.place(0, state, np.array([*rng.uniform(-2, 2, 2), rng.uniform(-3, 3)]))
    path = [onward(state)]
    while len(path) < 5:
        path.append(onward(int(table.target[path[-1]])))
    cast.show(0.0)
    for stretch in path[:3]:
        while not len(cast.waiting):
            cast.advance()
        cast.begin(np.array([0]), np.array([stretch]))
    for _ in range(int(rng.integers(1, 4))):
        if not len(cast.waiting):
            cast.advance()
    now = Standing(
        cast.anchor[0].copy(), float(cast.phase[0]), int(cast.stop[0]), path[2], 1.0, cast.left(0)
    )
    foresight = Foresight(search, now, path[3:], scale)
    ours, theirs, since, last, t = [], [], [], -np.inf, 0.0
    rest = path[3:]
    while (then := t + 1 / fps) <= foresight.ends:
        cast.rate[0] = float(np.diff(np.interp([t, then], foresight.when, foresight.at))[0])
        while len(cast.waiting) and rest:
            cast.begin(np.array([0]), np.array([rest.pop(0)]))
            last = t if cast.jump[0] else last
        if len(cast.waiting):
            break
        cast.advance()
        t = then
        shown = spheres.at(cast.position[0], cast.world_wxyz[0])
        captured, foreseen = foresight.at_time(t)
        ours.append(np.linalg.norm(foreseen - shown, axis=1))
        theirs.append(np.linalg.norm(captured - shown, axis=1))
        since.append(t - last)
    return np.array(ours), np.array(theirs), np.array(since)


@pytest.mark.parametrize(("scale", "feet_off"), [(1.0, 0.01), (1.1, 0.06)])
def test_what_is_foreseen_is_what_the_cast_shows(scale: float, feet_off: float):
    """Legs at once, as their ankles are held where they were; the rest when joints have settled.
    Slowed, a foot that is lifted between two shown frames fades a frame sooner or later.
    """
    found = [played(seed, scale) for seed in range(60)]
    ours, theirs, since = (np.concatenate(some) for some in zip(*found))
    between, _ = hung(few().clips.skeleton, searching().spheres)
    legs, feet = np.any(between > 0, axis=1), np.all(between >= ANKLE, axis=1)
    late = (since > 0.2) & np.isfinite(since)
    assert late.sum() > 100 and (since < 0.2).sum() > 100
    assert np.percentile(theirs[:, legs], 95) > 0.1  # it is not the capture
    assert np.percentile(ours[:, legs], 95) < 0.03
    assert np.percentile(ours[late][:, legs], 99) < feet_off
    assert np.percentile(ours[late][:, ~legs], 99) < 0.03
    assert np.median(ours[:, feet]) < 0.002


def test_what_joins_leave_may_be_left_out():
    differ = 0
    for seed in range(60):
        standing, coming, now = case(seed)
        plain = searching(joins=False, index=False, culling=False)
        found = plain.search(standing, coming, now)
        without = plain.search(replace(standing, left=None), coming, now)
        assert (found.outcome, found.path, found.costs) == (
            without.outcome,
            without.path,
            without.costs,
        ) or found.outcome != Outcome.FOUND
        reckoned = searching(index=False, culling=False).search(standing, coming, now)
        differ += found.counts != reckoned.counts
    assert differ > 5


# Nothing passes through --------------------------------------------------------------------------


def judged(attack: Attack, clearance: float = 0.0) -> tuple[str, float]:
    """What comes of a body at rest under an attack: outcome and distance of a path that stays."""
    search = searching(clearance=clearance, wide=0.0)
    stretch = int(np.argmax(search.graph.part_of[1:] > search.graph.part_of[:-1]))
    part = int(search.graph.part_of[stretch])
    begins = int(search.graph.begins[part])
    still = search.volumes.centre.copy()
    still[:] = still[begins]  # everyone stays as the part begins
    bound = np.repeat(search.volumes.bound[begins : begins + 1], len(still), axis=0)
    volumes = search.volumes._replace(centre=still, bound=bound)
    facing = few().clips.facing.copy()
    facing[:] = facing[begins]
    graph = search.graph._replace(facing=facing)
    now = kernels.Now(
        np.zeros(3), float(few().table.first[stretch] - 1), int(few().table.last[stretch]),
        stretch, 1.0, np.zeros((2, 3, 3)),
    )  # fmt: skip
    middle = 0.5 * (graph.begins[part] + graph.ends[part])
    aim = (middle - now.phase) / graph.fps
    given_, which = packed([attack], 0.0, facing[begins, :2])
    assert which == [0]
    room, out = search._room(), np.zeros(8)
    became = weigh(
        np.zeros(1, dtype=np.int32), 0, part, 0, aim, now, graph, volumes, given_,
        search.weighing, searching(culling=False).masks, room.scratch, out,
    )  # fmt: skip
    return ("hit" if became == kernels.HIT else "miss"), float(out[5])


def aimed_at_still(seed: int, speed: float, miss: float | None):
    """A ball in a straight line whose way comes ``miss`` [m] short of touching a body; None:
    through one of its spheres' middles.
    """
    rng = np.random.default_rng(seed)
    search = searching()
    stretch = int(np.argmax(search.graph.part_of[1:] > search.graph.part_of[:-1]))
    part = int(search.graph.part_of[stretch])
    begins = int(search.graph.begins[part])
    body = search.volumes.centre[begins].T.astype(float)
    size = search.spheres.radius
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)
    radius = float(rng.uniform(0.01, 0.15))
    goal = body[rng.integers(len(body))]
    if miss is not None:  # pushed sideways until the whole line is so far off
        side = np.cross(way, rng.normal(size=3))
        side /= np.linalg.norm(side)
        low, high = 0.0, 4.0

        def off(x: float) -> float:
            apart = body - (goal + x * side)
            apart -= (apart @ way)[:, None] * way
            return float((np.linalg.norm(apart, axis=1) - size).min()) - radius

        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if off(middle) < miss else (low, middle)
        goal = goal + high * side
    middle = (search.graph.begins[part] + search.graph.ends[part]) / 2
    when = (middle - few().table.first[stretch] + 1) / search.graph.fps
    reach = 3.0 / speed
    t = np.array([max(when - reach, 0.0), when + reach])
    centre = goal + ((t - when) * speed)[:, None] * way
    return Attack(t, centre[:, None], np.array([radius]))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.floats(1.0, 40.0) | st.floats(40.0, 399.0))
def test_no_ball_passes_through_a_body(seed: int, speed: float):
    assert judged(aimed_at_still(seed, speed, None))[0] == "hit"


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.floats(5.0, 40.0) | st.floats(40.0, 399.0))
def test_a_ball_that_misses_by_a_centimetre_misses(seed: int, speed: float):
    outcome, distance = judged(aimed_at_still(seed, speed, 0.01))
    assert outcome == "miss"
    assert distance == pytest.approx(0.01, abs=1e-4) or distance > 0.01  # it may pass too late
    assert judged(aimed_at_still(seed, speed, -0.01))[0] == "hit"


# What a search can come to -----------------------------------------------------------------------


def standing_still() -> Standing:
    return Standing(np.zeros(3), float(few().table.first[0]), int(few().table.last[0]), 0)


def ahead(arrives: float, far: float = 4.0, **more) -> Attack:
    """A ball at the chest of who stands still, in a straight line."""
    facing = few().clips.facing[int(standing_still().phase)]
    goal = np.array([facing[0], 1.3, facing[1]])
    way = np.array([0.0, 0.0, -1.0])
    return thrown(goal - way * far, way * far / arrives, 0.11, gravity=0.0, **more)


def test_outcomes():
    search, here = searching(), standing_still()
    past = ahead(1.0, seconds=2.0)
    assert search.search(here, [past], 2.5).outcome == Outcome.LATE
    assert search.search(here, [past], 1.0).outcome == Outcome.LATE  # it is inside the body
    early = search.search(here, [ahead(3.5)], 0.0)
    assert early.outcome == Outcome.EARLY and 3.0 < early.aim < 4.0
    off = Attack(past.when, past.centre + np.array([1.5, 0, 0]), past.radius)
    wide = search.search(here, [off], 0.0)
    assert wide.outcome == Outcome.WIDE and 0.5 < wide.distance < 1.5
    far = Attack(past.when, past.centre + np.array([50, 0, 0]), past.radius)
    assert search.search(here, [far], 0.0).outcome == Outcome.WIDE
    narrow = searching(window=1e-4).search(here, [ahead(1.0137)], 0.0)
    assert narrow.outcome == Outcome.NO_CANDIDATE and narrow.candidates == 0
    everywhere = thrown((0, 1.0, 4.0), (0, 0, -4.0), 2.0, gravity=0.0)
    assert search.search(here, [everywhere], 0.0).outcome == Outcome.HIT


def test_an_attack_under_way_is_seen_from_now_on():
    """Between two samples, too: it is in the body although the next sample is beyond it."""
    search, here = searching(), standing_still()
    quick = ahead(0.01)
    inside = search.search(here, [quick], 0.01)
    assert inside.outcome == Outcome.LATE


def test_the_plan_shows_the_middle_of_the_part_in_time():
    shown = 0
    for seed in range(200):
        standing, coming, now = case(seed)
        search = searching()
        found = search.search(standing, coming, now)
        if found.outcome != Outcome.FOUND:
            continue
        plan = found.plan
        assert plan is not None and plan.path == found.path and plan.begins == now
        table, parts = few().table, few().avoidance
        middle = parts.centre[found.part]
        gone = middle - standing.phase
        if plan.path:
            lasts = [int(table.duration[s]) for s in plan.path[:-1]]
            gone = standing.stop - standing.phase + sum(lasts)
            gone += middle - (table.first[plan.path[-1]] - 1)
        when = np.interp(gone, plan.at, plan.when)
        off = abs(when - found.aim) * few().clips.fps
        assert off < 0.6, seed  # frames: half a frame early or late is left as it is
        rate = np.diff(plan.at) / np.diff(plan.when) / few().clips.fps
        assert np.all(rate > 0.25 - 1e-9) and np.all(rate < 4.0 + 1e-9)
        shown += 1
    assert shown > 30


@pytest.mark.parametrize(
    "wrong",
    [
        {"window": 0.0},
        {"window": float("nan")},
        {"ramp": 0.0},
        {"left": -0.1},
        {"most": 0.5},
        {"most": 20.0},
        {"weights": (1.0, -1.0, 1.0)},
        {"weights": (1.0, 1.0)},
        {"weights": (float("nan"), 1.0, 1.0)},
    ],
)
def test_rules_that_make_no_sense(wrong):
    with pytest.raises(KumiteError, match="avoidance: "):
        AvoidanceRules(**wrong)


def test_a_library_without_parts():
    none = replace(few(), avoidance=no_avoidance(few().clips.clip_start))
    with pytest.raises(KumiteError, match="no avoidance parts"):
        AvoidanceSearch(none)


def test_who_does_not_move_may_be_timed_either_way():
    """V_still is 0 in the paper: what stands still is no faster than that."""
    search = searching(still=0.05)
    speed_known = search.graph.slows & search.graph.quickens
    assert not np.any(search.graph.slows & ~speed_known & search.graph.quickens)
    always = AvoidanceSearch(few(), AvoidanceRules(still=50.0)).graph
    assert np.all(always.slows) and np.all(always.quickens)
