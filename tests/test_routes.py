"""Routes: progress worked out by hand, and shapes with known lengths."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kumite.control import routes
from kumite.control.routes import (
    EARLY,
    CheckPoint,
    Missed,
    Progress,
    Reached,
    Route,
    circle,
    line,
    spiral,
)
from kumite.errors import KumiteError


def test_a_character_goes_on_when_it_is_there():
    progress = Progress(Route((CheckPoint((0, 0)), CheckPoint((2, 0)))))
    assert progress.goal(0.0) == (0.0, 0.0)
    assert progress.update((1.0, 0.0), 0.0) is None
    assert progress.update((0.3, 0.4), 1.0) == Reached(0, 1.0, 1.0, 0.0, 0.5)  # on the rim
    assert progress.goal(1.0) == (2.0, 0.0)
    assert progress.update((2.0, 0.2), 2.0) == Reached(1, 2.0, 2.0, 0.0, 0.2)
    assert progress.done and progress.goal(3.0) == (2.0, 0.0)
    assert progress.update((2.0, 0.0), 3.0) is None
    assert progress.missed() == ()


def test_it_waits_until_the_time_has_come():
    progress = Progress(Route((CheckPoint((0, 0), time=5.0), CheckPoint((2, 0), time=6.0))))
    assert progress.update((0.0, 0.1), 3.0) is None  # two seconds early
    assert progress.goal(4.9) == (0.0, 0.0)
    assert progress.goal(5.0) == (2.0, 0.0)  # a look ahead: by then it will have waited enough
    assert progress.update((0.9, 0.0), 4.0) is None  # pushed away; it was there
    assert progress.update((0.2, 0.0), 5.25) == Reached(0, 3.0, 5.25, 0.25, 0.1)
    assert progress.update((2.0, 0.0), 7.5) == Reached(1, 7.5, 7.5, 1.5, 0.0)


def test_required_actions_are_performed_there():
    point = CheckPoint((0, 0), time=2.0, require=("fall", "left_hand_straight"))
    progress = Progress(Route((point, CheckPoint((1, 1)))))
    progress.update((3.0, 0.0), 0.0, {"fall"})  # too early: not there
    assert progress.wanted == ()
    assert progress.update((0.1, 0.0), 1.0, {"left_hand_straight", "attack"}) is None
    assert progress.wanted == ("fall",)
    assert progress.update((0.0, 0.0), 3.0, {"left_hand_straight"}) is None  # its time has come
    assert progress.goal(9.0) == (0.0, 0.0)
    assert progress.missed(3.0) == (Missed(0, 2.0, 0.0, True, ("fall",)),)
    # What it performs may carry it away.
    assert progress.update((0.9, 0.0), 4.0, {"fall"}) == Reached(0, 1.0, 4.0, 2.0, 0.1)
    assert progress.wanted == () and progress.lacking == ()


def test_refused_actions_are_unwanted_until_the_check_point_is_done():
    progress = Progress(Route((CheckPoint((0, 0), refuse=("fall",)), CheckPoint((1, 0)))))
    assert progress.unwanted == ("fall",)
    progress.update((0, 0), 0.0)
    assert progress.unwanted == ()
    progress.update((1, 0), 1.0)
    assert progress.unwanted == ()


def test_what_is_missed_is_told_with_when_and_by_how_much():
    points = (CheckPoint((0, 0)), CheckPoint((0, 4), time=2.0), CheckPoint((3, 4), time=8.0))
    progress = Progress(Route((*points, CheckPoint((9, 4)))))
    assert progress.missed(1.0) == ()
    assert progress.missed(2.0)[0].distance == np.inf  # it was never seen
    progress.update((0, 0), 0.0)
    for time, place in ((1.0, (0.0, 2.0)), (2.0, (1.0, 4.0)), (3.0, (3.0, 3.0))):
        assert progress.update(place, time) is None
    assert progress.missed(3.0) == (Missed(1, 2.0, 1.0, False, ()),)
    assert [m.index for m in progress.missed(8.0)] == [1, 2]
    assert [(m.index, m.due, m.distance) for m in progress.missed()] == [
        (1, 2.0, 1.0),
        (2, 8.0, 1.0),
        (3, None, pytest.approx(np.hypot(6.0, 1.0))),
    ]
    # Late is told when it comes after all, before the next one's time.
    assert progress.goal(7.0) == (0.0, 4.0)
    late = progress.update((0.0, 4.0), 7.5)
    assert late is not None and late.late_by == 5.5 and progress.given_up == []


def test_who_is_too_late_gives_a_check_point_up_for_the_next():
    points = [CheckPoint((float(k), 0), time=float(k)) for k in range(4)]
    progress = Progress(Route((*points, CheckPoint((9, 0), time=9.0, require=("duck",)))))
    progress.update((0.0, 0.0), 0.0)
    assert progress.update((0.2, 0.0), 2.5) is None
    assert progress.index == 2 and progress.given_up == [Missed(1, 1.0, 0.8, False, ())]
    assert progress.missed(2.5) == (Missed(1, 1.0, 0.8, False, ()), Missed(2, 2.0, 1.8, False, ()))
    found = progress.update((2.8, 0.0), 3.0)  # two are given up, the third is not far
    assert found is not None and found.index == 3 and progress.index == 4
    progress.update((3.0, 0.0), 99.0)
    assert progress.index == 4  # something is to be done there


def test_where_to_be_moves_at_an_even_pace_between_times():
    points = (
        CheckPoint((0, 0), time=1.0),
        CheckPoint((2, 0), time=2.0),
        CheckPoint((2, 4), time=4.0, require=("duck",)),
        CheckPoint((0, 4), time=5.0),
    )
    progress = Progress(Route(points))
    where = [[0, 0], [0, 0], [1, 0], [2, 0], [2, 1], [2, 2], [2, 3], [2, 4], [2, 4]]
    found = progress.ahead(0.5 - EARLY, 0.5, 12)
    assert np.allclose(found, [*where, [2, 4], [2, 4], [2, 4]])
    assert Progress(Route((CheckPoint((3, 1)),))).ahead(0.0, 1.0, 2).tolist() == [[3, 1], [3, 1]]
    for k in range(4):
        progress.update(points[k].place, float(points[k].time or 0), {"duck"})
    assert np.allclose(progress.ahead(4.5 - EARLY, 0.5, 2), [[1, 4], [0, 4]])


def test_without_a_time_it_is_walked_to_and_who_is_late_is_pressed():
    progress = Progress(Route((CheckPoint((3.0, 0.0)), CheckPoint((3.0, 1.0)))))
    progress.update((1.0, 0.0), 10.0)
    way = progress.ahead(11.0, 1.0, 5)  # 2 m at 0.5 m/s
    assert np.allclose(way, [[1.5, 0], [2, 0], [2.5, 0], [3, 0], [3, 0]])
    assert progress.urgency(14.0) == 1.0
    assert progress.urgency(18.0) == 2.0 and progress.urgency(22.0) == 4.0
    assert progress.urgency(1e6) == progress.urgency(1e7) < np.inf
    progress.move(0, (1.0, 4.0))
    progress.update((1.0, 2.0), 20.0)  # it sets out anew
    assert progress.urgency(24.0) == 1.0
    assert progress.update((1.0, 4.0), 24.0) is not None
    assert progress.urgency(99.0) == 1.0


def test_one_update_does_one_check_point():
    progress = Progress(Route((CheckPoint((0, 0)), CheckPoint((0, 0)), CheckPoint((0, 0)))))
    found = [progress.update((0, 0), t) for t in (0.0, 0.1, 0.2, 0.3)]
    assert [None if r is None else r.index for r in found] == [0, 1, 2, None]


def test_a_time_of_zero_is_a_time():
    progress = Progress(Route((CheckPoint((0, 0), time=0.0), CheckPoint((5, 0)))))
    assert progress.update((0, 0), -1.0) is None
    assert progress.goal(-0.5) == (0.0, 0.0)
    assert progress.goal(0.0) == (5.0, 0.0)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"place": (0, np.nan)}, "place"),
        ({"place": (0, 0, 0)}, "expected x and z"),
        ({"place": (0, 0), "time": np.inf}, "time inf"),
        ({"place": (0, 0), "radius": 0.0}, "radius 0.0"),
        ({"place": (0, 0), "require": "fall", "refuse": ["fall"]}, "required and refused"),
    ],
)
def test_what_is_no_check_point_is_refused(wrong: dict, message: str):
    with pytest.raises(KumiteError, match=message):
        CheckPoint(**wrong)


def test_what_is_no_route_is_refused():
    with pytest.raises(KumiteError, match="at least one"):
        Route(())
    with pytest.raises(KumiteError, match="check point 2 is at 1 s, one before it at 2 s"):
        Route((CheckPoint((0, 0), 2.0), CheckPoint((0, 0)), CheckPoint((0, 0), 1.0)))
    with pytest.raises(KumiteError, match="at least 2"):
        line((0, 0), (1, 0), 1)
    with pytest.raises(KumiteError, match="no length"):
        circle((0, 0), 0.0)
    with pytest.raises(KumiteError, match="radii -1"):
        spiral((0, 0), -1.0, 2.0)
    with pytest.raises(KumiteError, match="0 s or more"):
        line((0, 0), (1, 0), seconds=-1.0)


# Shapes ------------------------------------------------------------------------------------------


def times(route: Route) -> list[float]:
    return [p.time for p in route.points if p.time is not None]


def test_a_line_is_even():
    route = line((1, 2), (4, 6), 6, seconds=10.0, begin=3.0, radius=0.2)
    assert route.length == pytest.approx(5.0)
    assert route.places[1] == pytest.approx((1.6, 2.8))
    assert [p.time for p in route.points] == pytest.approx([3, 5, 7, 9, 11, 13])
    assert {p.radius for p in route.points} == {0.2}
    assert {p.time for p in line((0, 0), (1, 0), 3).points} == {None}


def test_a_circle_goes_round_from_plus_z_to_plus_x():
    route = circle((1, 2), 3.0, 2.0, 16.0, 9)
    expected = [(1, 5), (4, 2), (1, -1), (-2, 2)] * 2 + [(1, 5)]
    # Quarter turns in so fine a chain of chords are off by less than a millionth.
    assert np.allclose(route.places, expected, atol=1e-5)
    assert [p.time for p in route.points] == pytest.approx(range(0, 17, 2))
    other = circle((1, 2), 3.0, -0.25, points=2)
    assert np.allclose(other.places, [(1, 5), (-2, 2)], atol=1e-5)
    fine = circle((0, 0), 2.0, 1.5, points=1000)
    assert fine.length == pytest.approx(1.5 * 2 * np.pi * 2.0, rel=1e-4)


def test_a_spiral_is_as_long_as_archimedes_says():
    inner, outer, turns = 1.0, 6.0, 2.5
    route = spiral((3, -1), inner, outer, turns, 60.0, 2001, angle=0.3)
    a = (outer - inner) / (2 * np.pi * turns)  # r = a φ

    def until(r: float) -> float:
        phi = r / a
        return 0.5 * a * (phi * np.sqrt(1 + phi**2) + np.arcsinh(phi))

    assert route.length == pytest.approx(until(outer) - until(inner), rel=1e-4)
    away = np.linalg.norm(route.places - (3, -1), axis=1)
    assert away[[0, -1]] == pytest.approx([inner, outer])
    steps = np.linalg.norm(np.diff(route.places, axis=0), axis=1)
    assert steps == pytest.approx(np.full(2000, steps.mean()), rel=1e-3)  # one speed
    assert np.diff(times(route)) == pytest.approx(np.full(2000, 0.03))


def test_routes_are_put_behind_one_another():
    both = line((0, 0), (1, 0), seconds=2.0).then(line((1, 0), (1, 5), seconds=4.0, begin=2.0))
    assert len(both) == 4 and both.length == pytest.approx(6.0)
    with pytest.raises(KumiteError, match="go back"):
        both.then(line((1, 5), (0, 0), seconds=1.0))


# Properties --------------------------------------------------------------------------------------

metres = st.floats(-50, 50)
spirals = st.builds(
    spiral,
    st.tuples(metres, metres),
    st.floats(0.1, 20),
    st.floats(0.1, 20),
    st.floats(-4, 4).filter(lambda t: abs(t) > 0.01),
    st.floats(0, 300) | st.none(),
    st.integers(2, 40),
    begin=st.floats(-10, 100),
)


@given(spirals)
@settings(max_examples=60, deadline=None)
def test_times_of_a_shape_never_go_back(route: Route):
    found = times(route)
    assert len(found) in (0, len(route))
    assert all(a <= b for a, b in zip(found, found[1:]))
    assert np.isfinite(route.places).all()


@given(
    st.lists(st.tuples(metres, metres, st.booleans(), st.booleans()), min_size=1, max_size=6),
    st.lists(st.tuples(metres, metres, st.booleans()), max_size=40),
    st.floats(1, 100),
)
@settings(max_examples=150, deadline=None)
def test_check_points_are_done_in_order_and_never_early(points, walk, radius):
    route = Route(
        tuple(
            CheckPoint((x, z), 2.0 * k if timed else None, ("duck",) if needs else (), (), radius)
            for k, (x, z, timed, needs) in enumerate(points)
        )
    )
    progress = Progress(route)
    for time, (x, z, ducks) in enumerate(walk):
        found = progress.update((x, z), float(time), {"duck"} if ducks else ())
        assert found is None or (found.left == time and found.time <= time)
        assert progress.goal(float(time)) in [p.place for p in route.points]
    given_up = [m.index for m in progress.given_up]
    assert sorted([r.index for r in progress.reached] + given_up) == list(range(progress.index))
    assert not any(route.points[k].require for k in given_up)
    assert all(a.left < b.left for a, b in zip(progress.reached, progress.reached[1:]))
    for r in progress.reached:
        due = route.points[r.index].time
        assert r.late_by == (0.0 if due is None else r.left - due) and r.late_by >= 0
        assert r.distance <= radius
    left = progress.missed()
    assert [m.index for m in left] == [*given_up, *range(progress.index, len(route))]
    if walk:
        nearest = np.min([np.hypot(*(route.places - (x, z)).T) for x, z, _ in walk], axis=0)
        now = [m.distance for m in left[len(given_up) :]]
        assert np.allclose(now, nearest[progress.index :])


def test_through_places_at_one_speed():
    route = routes.through([(0, 0), (3, 0), (3, 1)], 8.0)
    assert [p.time for p in route.points] == [0.0, 6.0, 8.0]
    route = routes.through([(0, 0), (3, 0), (3, 1)], 10.0, start=(0, -4))
    assert [p.time for p in route.points] == [5.0, 8.75, 10.0]
    assert [p.time for p in route.later(2.0).points] == [7.0, 10.75, 12.0]
    assert {p.time for p in routes.through([(0, 0), (1, 0)]).points} == {None}
    assert [p.time for p in routes.through([(1, 1)], 4.0).points] == [4.0]
    with pytest.raises(KumiteError, match="no check points"):
        routes.through([], 5.0)
    with pytest.raises(KumiteError, match="-1"):
        routes.through([(0, 0)], -1.0)


def test_a_check_point_that_is_moved_must_be_reached_anew():
    route = Route((CheckPoint((0, 0)), CheckPoint((2, 0), require=("fall",)), CheckPoint((4, 0))))
    progress = Progress(route)
    progress.update((0, 0), 0.0)
    progress.update((2, 0), 1.0)
    assert progress.wanted == ("fall",)
    progress.move(1, (2, 3))
    assert progress.wanted == () and progress.goal(1.0) == (2.0, 3.0)
    assert progress.missed()[0].distance == np.inf
    progress.move(0, (9, 9))  # is done, and stays so
    assert progress.index == 1 and route.points[0].place == (0.0, 0.0)
    with pytest.raises(KumiteError, match="check point 3"):
        progress.move(3, (0, 0))
