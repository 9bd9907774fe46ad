"""Routes: check points that a character passes one after the other (Shum et al. 2012, section
VIII-C; B8).

A check point is a place on the ground, with a time if wanted, and with actions that are wanted
there. A character that reaches it performs them, waits until the time has come, and only then the
next one is its goal, p_d of the cooperative function. :class:`Route` says where and when,
:class:`Progress` how far one character has come.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from math import isfinite
from typing import TYPE_CHECKING

from kumite.checked import checked
from kumite.checks import shown
from kumite.errors import KumiteError
from kumite.lazy import Later

if TYPE_CHECKING:
    import numpy as np
else:
    np = Later("numpy")

RADIUS = 0.5  # m
PACE = 0.5  # m/s to a check point without a time: a boxer's, who goes on fighting
EARLY = 0.4  # s before its time that a place is aimed at: who is early waits, who is late misses
DOUBLES = 4.0  # s late in which an order comes to press twice as much …
MOST_DOUBLES = 10.0  # … no more often than that
NEVER = float("inf")  # s
_FINE = 4096  # points along which a spiral is measured


@dataclass(frozen=True)
class CheckPoint:
    """A place to pass."""

    place: tuple[float, float]  # (x, z) m
    time: float | None = None  # s: when to go on from it; None: at once
    require: tuple[str, ...] = ()  # labels, ways or kinds of actions to perform there, each once
    refuse: tuple[str, ...] = ()  # those not to perform on the way there, nor there
    radius: float = RADIUS  # m: so near is there
    middle: bool = False  # it is a place for the middle between a fighter and its opponent

    def __post_init__(self) -> None:
        put = object.__setattr__
        for name in ("require", "refuse"):
            given = getattr(self, name)
            put(self, name, (given,) if isinstance(given, str) else tuple(given))
        try:
            put(self, "place", tuple(float(v) for v in self.place))
        except (TypeError, ValueError):
            raise KumiteError(f"check point: place {shown(self.place)}; expected x and z") from None
        wrong = []
        if len(self.place) != 2 or not all(map(isfinite, self.place)):
            wrong.append(f"place {self.place}; expected x and z, finite")
        if self.time is not None and not isfinite(self.time):
            wrong.append(f"time {self.time}; expected seconds, or none")
        if not 0 < self.radius < NEVER:
            wrong.append(f"radius {self.radius}; expected metres above 0")
        both = [word for word in self.require if word in self.refuse]
        if both:
            wrong.append(f"{', '.join(both)} required and refused; expected one of the two")
        if wrong:
            raise KumiteError("\n".join(f"check point: {what}" for what in wrong))


@checked
@dataclass(frozen=True)
class Route:
    """Check points in order."""

    points: tuple[CheckPoint, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", tuple(self.points))
        if not self.points:
            raise KumiteError("route: no check points; expected at least one")
        latest = -NEVER
        for k, point in enumerate(self.points):
            if point.time is not None and point.time < latest:
                raise KumiteError(
                    f"route: check point {k} is at {point.time:g} s, one before it at "
                    f"{latest:g} s; expected times that do not go back"
                )
            latest = latest if point.time is None else point.time

    def __len__(self) -> int:
        return len(self.points)

    @property
    def places(self) -> np.ndarray:
        """[points, 2] m."""
        return np.array([point.place for point in self.points])

    @property
    def length(self) -> float:
        """From the first check point to the last, straight from one to the next [m]."""
        return float(np.linalg.norm(np.diff(self.places, axis=0), axis=1).sum())

    def then(self, other: Route) -> Route:
        """This route and another one behind it. Errors: times that go back."""
        return Route((*self.points, *other.points))

    def later(self, seconds: float) -> Route:
        """The same check points, their times so much later."""
        return Route(
            tuple(p if p.time is None else replace(p, time=p.time + seconds) for p in self.points)
        )

    def moved(self, index: int, place: tuple[float, float]) -> Route:
        """One of its check points in another place (x, z) m. Errors: there is none such."""
        if not 0 <= index < len(self):
            raise KumiteError(f"check point {index}; expected 0 to {len(self) - 1}")
        points = list(self.points)
        points[index] = replace(points[index], place=place)
        return Route(tuple(points))


@dataclass(frozen=True)
class Reached:
    """A check point that is done: reached, its actions performed, its time come."""

    index: int
    time: float  # s at which the character was there
    left: float  # s at which the next one became its goal
    late_by: float  # s of left after the check point's time; 0 without one
    distance: float  # m from it when it was reached


@dataclass(frozen=True)
class Missed:
    """A check point that is not done though its time has come."""

    index: int
    due: float | None  # s
    distance: float  # m, the closest that the character has been; inf if it was never seen
    reached: bool  # in its turn, but then actions were not performed
    lacking: tuple[str, ...]


@checked
class Progress:
    """How far a character has come on a route. It is updated as often as one likes."""

    def __init__(self, route: Route) -> None:
        self.route = route
        self.index = 0  # of the check point that is its goal; the number of points: all are done
        self.arrived: float | None = None  # s at which it reached that one
        self.lacking = route.points[0].require  # of its actions, those not performed yet
        self.closest = np.full(len(route), np.inf)  # [points] m
        self.reached: list[Reached] = []
        self.given_up: list[Missed] = []
        self._places = route.places
        self._distance = 0.0
        self._set_out: tuple[np.ndarray, float] | None = None  # where and when, to that one

    @property
    def done(self) -> bool:
        return self.index == len(self.route)

    def update(
        self, place: Iterable[float], time: float, performed: Collection[str] = ()
    ) -> Reached | None:
        """Where (x, z) the character is at a time [s], and what it has performed since the last
        update: labels, ways and kinds. The check point that is done by it, if any: one at most.

        Who has not come to a check point when the next one's time is due gives it up and goes
        there, unless something was to be performed at it.

        Actions count from the update at which it is there; from then on it may be moved away by
        what it performs.
        """
        x, z = place
        if self._set_out is None:
            self._set_out = np.array([x, z], dtype=float), time
        distance = np.hypot(self._places[:, 0] - x, self._places[:, 1] - z)
        np.minimum(self.closest, distance, out=self.closest)
        if self.done:
            return None
        self._give_up(time)
        point = self.route.points[self.index]
        if self.arrived is None and distance[self.index] <= point.radius:
            self.arrived, self._distance = time, float(distance[self.index])
        if self.arrived is None:
            return None
        self.lacking = tuple(word for word in self.lacking if word not in performed)
        if self.lacking or (point.time is not None and time < point.time):
            return None
        late = 0.0 if point.time is None else time - point.time
        found = Reached(self.index, self.arrived, time, late, self._distance)
        self.reached.append(found)
        self._go_on()
        return found

    def _go_on(self) -> None:
        self.index, self.arrived, self._set_out = self.index + 1, None, None
        self.lacking = () if self.done else self.route.points[self.index].require

    def _give_up(self, time: float) -> None:
        points = self.route.points
        while self.arrived is None and self.index + 1 < len(points):
            point, then = points[self.index], points[self.index + 1]
            if point.require or point.time is None or then.time is None or time < then.time:
                return
            self.given_up.append(self._miss(self.index))
            self._go_on()

    def _miss(self, k: int) -> Missed:
        point, current = self.route.points[k], k == self.index
        return Missed(
            k,
            point.time,
            float(self.closest[k]),
            current and self.arrived is not None,
            self.lacking if current else point.require,
        )

    def move(self, index: int, place: tuple[float, float]) -> None:
        """Put a check point in another place (x, z) m; if the character waits there, it goes on to
        the new one. Errors: as :meth:`Route.moved`.
        """
        self.route = self.route.moved(index, place)
        self._places = self.route.places
        if index >= self.index:
            self.closest[index] = np.inf
        if index == self.index:
            self._set_out = None
            self.arrived, self.lacking = None, self.route.points[index].require

    def goal(self, time: float) -> tuple[float, float]:
        """Where (x, z) to go at a time [s], now or later, as far as is known now.

        A character that only waits will go on by itself when the time has come; at the end of its
        route it stays at the last check point.
        """
        points = self.route.points
        k = min(self.index, len(points) - 1)
        waits = self.arrived is not None and not self.lacking
        due = points[k].time
        if waits and (due is None or time >= due) and k + 1 < len(points):
            k += 1
        return points[k].place

    def ahead(self, time: float, step: float, count: int) -> np.ndarray:
        """Where to be [count, 2] at a time [s] and every ``step`` after it, as far as is known now.

        Between check points with times at an even pace, 0.4 s ahead of them; to one without at
        0.5 m/s from where the character set out, and then at it until it is reached. Nobody is to
        be farther than where something is still to be performed.
        """
        out = np.tile(np.array(self.goal(time)), (count, 1))
        k, points = min(self.index, len(self.route) - 1), self.route.points
        begin = k = k - 1 if k > 0 and points[k - 1].time is not None else k
        while (
            k + 1 < len(points)
            and points[k + 1].time is not None
            and not (k >= self.index and points[k].require and (k > self.index or self.lacking))
        ):
            k += 1
        at = time + step * np.arange(count)
        if self._walks:
            start, since = self._set_out  # type: ignore[misc]  # it walks
            share = np.clip((at - since) / max(self._due - since, 1e-9), 0.0, 1.0)
            return start + share[:, None] * (self._places[self.index] - start)
        if k == begin or points[begin].time is None:
            return out
        times = np.array([p.time for p in points[begin : k + 1]], dtype=float)
        for axis in range(2):
            out[:, axis] = np.interp(at + EARLY, times, self._places[begin : k + 1, axis])
        return out

    @property
    def _walks(self) -> bool:
        """Whether it is on its way to a check point without a time."""
        on_the_way = not self.done and self.arrived is None and self._set_out is not None
        return on_the_way and self.route.points[self.index].time is None

    @property
    def _due(self) -> float:
        """When [s] it is expected at the check point without a time that it walks to."""
        start, since = self._set_out  # type: ignore[misc]  # it walks
        return since + float(np.hypot(*(self._places[self.index] - start))) / PACE

    def urgency(self, time: float) -> float:
        """How many times its weight a route counts at a time [s]: 1, and twice as much every 4 s
        that the character is late at a check point without a time. So whoever is in the way, or
        worth a blow, is so for a while only.
        """
        late = time - self._due if self._walks else 0.0
        return 2.0 ** min(max(late, 0.0) / DOUBLES, MOST_DOUBLES)

    @property
    def wanted(self) -> tuple[str, ...]:
        """A⁺: what to perform now."""
        return self.lacking if self.arrived is not None else ()

    @property
    def unwanted(self) -> tuple[str, ...]:
        """A⁻: what not to perform now."""
        return () if self.done else self.route.points[self.index].refuse

    def missed(self, time: float = NEVER) -> tuple[Missed, ...]:
        """Check points that should be done by a time [s] and are not.

        Without a time, at the end of a scene: all that are not done.
        """
        due = [
            self._miss(k)
            for k in range(self.index, len(self.route))
            if time == NEVER or ((at := self.route.points[k].time) is not None and at <= time)
        ]
        return (*self.given_up, *due)


# Shapes ------------------------------------------------------------------------------------------


def line(
    start: tuple[float, float],
    end: tuple[float, float],
    points: int = 2,
    *,
    seconds: float | None = None,
    begin: float = 0.0,
    radius: float = RADIUS,
) -> Route:
    """Straight from one place to another, both of them check points, the others evenly between.

    seconds: from the first to the last, which is then at ``begin`` + seconds; None: no times.
    """
    share = _shares(points)[:, None]
    places = (1.0 - share) * np.array(start, dtype=float) + share * np.array(end, dtype=float)
    return _timed(places, seconds, begin, radius)


def through(
    places: Iterable[tuple[float, float]],
    seconds: float | None = None,
    *,
    start: tuple[float, float] | None = None,
    radius: float = RADIUS,
) -> Route:
    """From each place straight to the next, at one speed: at the last one after ``seconds``, on the
    way from ``start`` or else from the first of them; None: no times. Errors: no places.
    """
    route = Route(tuple(CheckPoint(place, radius=radius) for place in places))
    if seconds is None:
        return route
    if not 0 <= seconds < NEVER:
        raise KumiteError(f"route: {seconds} s; expected 0 s or more, finite")
    begin = route.places[:1] if start is None else np.array([start])
    way = np.linalg.norm(np.diff(route.places, axis=0, prepend=begin), axis=1).cumsum()
    share = way / way[-1] if way[-1] > 0 else np.ones(len(way))
    return Route(
        tuple(replace(p, time=float(t)) for p, t in zip(route.points, share * seconds, strict=True))
    )


def circle(
    centre: tuple[float, float],
    radius: float,
    turns: float = 1.0,
    seconds: float | None = None,
    points: int = 13,
    *,
    angle: float = 0.0,
    begin: float = 0.0,
    point_radius: float = RADIUS,
) -> Route:
    """Round a centre, from an angle [rad; 0 is +Z of it, π/2 +X] by so many turns; below 0 the
    other way. Times as in :func:`line`.
    """
    return spiral(
        centre,
        radius,
        radius,
        turns,
        seconds,
        points,
        angle=angle,
        begin=begin,
        point_radius=point_radius,
    )


def spiral(
    centre: tuple[float, float],
    inner: float,
    outer: float,
    turns: float = 1.0,
    seconds: float | None = None,
    points: int = 13,
    *,
    angle: float = 0.0,
    begin: float = 0.0,
    point_radius: float = RADIUS,
) -> Route:
    """From an inner to an outer radius [m] round a centre, farther by as much in each turn.

    Check points lie evenly along the way, so that times (see :func:`line`) ask for one speed.
    """
    if not (inner >= 0 and outer >= 0 and all(map(isfinite, (inner, outer, turns, angle)))):
        raise KumiteError(
            f"route: radii {inner:g} and {outer:g} m, {turns:g} turns from {angle:g} rad; expected "
            "finite numbers, and radii of 0 or more"
        )

    def at(share: np.ndarray) -> np.ndarray:
        phi, r = angle + 2.0 * np.pi * turns * share, inner + (outer - inner) * share
        return np.stack([centre[0] + r * np.sin(phi), centre[1] + r * np.cos(phi)], axis=1)

    fine = np.linspace(0.0, 1.0, _FINE + 1)
    step = np.linalg.norm(np.diff(at(fine), axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(step)])
    if way[-1] == 0.0:
        raise KumiteError("route: a way of no length; expected a radius or turns above 0")
    return _timed(at(np.interp(_shares(points) * way[-1], way, fine)), seconds, begin, point_radius)


def _shares(points: int) -> np.ndarray:
    if points < 2:
        raise KumiteError(f"route: {points} check points; expected at least 2")
    return np.linspace(0.0, 1.0, points)


def _timed(places: np.ndarray, seconds: float | None, begin: float, radius: float) -> Route:
    if seconds is not None and not (0 <= seconds < NEVER and isfinite(begin)):
        raise KumiteError(
            f"route: {seconds} s from {begin} s on; expected finite numbers, 0 s or more"
        )
    times = None if seconds is None else begin + _shares(len(places)) * seconds
    return Route(
        tuple(
            CheckPoint(
                (float(x), float(z)), None if times is None else float(times[k]), radius=radius
            )
            for k, (x, z) in enumerate(places)
        )
    )
