"""Precomputed policies (Lee & Lee 2004, section 4): approach a target, strike it.

    V(s, e) = max_a [ R(s, e, a) + γ^T(a) V(s', e') ]                                   (Eq. 4)

s a state of the action table, e where the target is, seen from the avatar, T(a) the action's
duration, e' the target seen from where the action leaves the avatar; V(s', e') is interpolated
linearly between grid points. Solved by full sweeps to a stated residual (the paper samples).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from kumite.brief import brief
from kumite.checked import checked
from kumite.checks import freeze, instance, number, whole
from kumite.clip import LIMBS
from kumite.control.grid import TargetGrid, approach_grid, heading_grid, strike_grid
from kumite.errors import KumiteError
from kumite.graph import Layer
from kumite.kernels import policy as kernels
from kumite.rotation import planar_apply, planar_compose, planar_inverse

DISCOUNT_PER_SECOND = 0.97**15  # the paper's 0.97 a frame at 15 frames a second


@dataclass(frozen=True)
class Tracks:
    """What the stretches do, seen from where they begin (the facing frame of first - 1)."""

    centre: np.ndarray  # [L's frames, 2] m, ground track of the centroid of the hitting points:
    # of each blow the fist's front where it is fastest
    centre_start: np.ndarray  # [L + 1]
    root: np.ndarray  # [L's frames, 3] (x, z, yaw) of the facing frame
    tip: np.ndarray  # [effective frames, 3] m
    tip_weight: np.ndarray  # [effective frames] 0..1, speed over the fastest blow's
    tip_when: np.ndarray  # [effective frames] frames since the action began, from 1
    tip_start: np.ndarray  # [L + 1]


@checked
def stretch_tracks(library: Layer, limbs: tuple[str, ...] = LIMBS) -> Tracks:
    """Tracks of every stretch; ``limbs`` are those whose hits count."""
    table, strikes, facing = library.table, library.strikes, library.clips.facing
    use = [LIMBS.index(limb) for limb in limbs]
    effective = strikes.effective[:, use]
    mine = np.isin(strikes.limb, use)
    points = strikes.tip[strikes.frame[mine], strikes.limb[mine]]
    ahead = points.mean(axis=0) if len(points) else np.array([0.0, 0.0, 0.6])
    fastest = strikes.speed[:, use][effective].max() if effective.any() else 1.0

    length = table.duration
    start = np.concatenate([[0], np.cumsum(length)])
    owner = np.repeat(np.arange(len(length)), length)
    since = np.arange(start[-1]) - start[owner]
    frame = table.first[owner] + since
    relative = planar_compose(planar_inverse(facing[table.first - 1])[owner], facing[frame])
    centre = planar_apply(relative, ahead)[:, [0, 2]]

    row, limb = np.nonzero(effective[frame])
    tip = planar_apply(relative[row], strikes.tip[:, use][frame[row], limb])
    return Tracks(
        np.ascontiguousarray(centre),
        start.astype(np.int64),
        np.ascontiguousarray(relative),
        np.ascontiguousarray(tip),
        strikes.speed[:, use][frame[row], limb] / fastest,
        (since[row] + 1).astype(np.int64),
        np.searchsorted(owner[row], np.arange(len(length) + 1)).astype(np.int64),
    )


@dataclass(frozen=True)
class Station:
    """A reward: to be somewhere with respect to the target, at some moment or all the time."""

    point: str = "body"  # what is brought there: the body, or the "reach" (where blows land)
    distance: float = 0.0  # m wanted from the target
    sigma: float = 0.2  # m, how sharply
    bearing: float | None = None  # deg to the left of straight ahead where the target is wanted
    bearing_sigma: float = 30.0  # deg, how sharply
    heading: float | None = None  # deg to the left of the target's own heading to face along
    heading_sigma: float = 30.0  # deg, how sharply
    orbit: float = 0.0  # rad/s wanted round the target: + to the avatar's right hand; 0: none
    always: bool = False  # all the time, not at the best moment

    def __post_init__(self) -> None:
        if self.point not in ("body", "reach"):
            raise KumiteError(f"station: point {self.point!r}, expected body or reach")
        if not (self.distance >= 0 and min(self.sigma, self.bearing_sigma, self.heading_sigma) > 0):
            raise KumiteError("station: expected distance not below 0 m, sigmas above 0")
        angles = [self.bearing or 0.0, self.heading or 0.0]
        if not np.isfinite([self.distance, self.orbit, *angles]).all():
            raise KumiteError("station: distance, bearing, heading and orbit must be finite")


@checked
@dataclass(frozen=True)
class Behaviour:
    """What is rewarded, where it is looked up, and where it counts: data, so a user adds one."""

    name: str
    grid: TargetGrid
    discount_per_second: float = DISCOUNT_PER_SECOND
    sigma: float = 0.10  # m, how sharply approaching is rewarded (Eq. 5)
    tolerance: float = 0.15  # m, how near a blow must pass to count (Eq. 6)
    limbs: tuple[str, ...] = LIMBS
    station: Station | None = None  # what is rewarded, if not approaching or striking
    nearest: float = 0.0  # m: the behaviour counts only while its target is that far off
    farthest: float = float("inf")  # m

    def __post_init__(self) -> None:
        if self.station is None and self.name not in ("approach", "strike"):
            raise KumiteError(
                f"unknown behaviour {self.name!r}: expected approach, strike, or one with a station"
            )
        turned = self.station is not None and self.station.heading is not None
        if turned != self.grid.heading:
            raise KumiteError(
                f"{self.name}: a station with a heading needs a grid of headings "
                "(kumite.control.heading_grid), and no other does"
            )
        if not 0 <= self.nearest < self.farthest:
            raise KumiteError(f"{self.name}: active from {self.nearest} to {self.farthest} m")
        if not 0 < self.discount_per_second < 1:
            raise KumiteError("discount_per_second: expected more than 0 and less than 1")
        if not (self.sigma > 0 and self.tolerance > 0):
            raise KumiteError("sigma and tolerance: expected more than 0 m")


def keep_off(distance: float = 1.5) -> Behaviour:
    """Stay at a distance [m], the target in front: retreat from one that comes nearer."""
    station = Station(distance=distance, sigma=0.25, bearing=0.0, always=True)
    return Behaviour("keep_off", approach_grid(), station=station)


def circle(distance: float = 1.1, orbit: float = 0.7) -> Behaviour:
    """Go round the target at a distance [m] and a rate [rad/s], facing it."""
    station = Station(distance=distance, sigma=0.3, bearing=0.0, orbit=orbit, always=True)
    return Behaviour("circle", approach_grid(), station=station)


def take_place(distance: float = 0.0) -> Behaviour:
    """Reach the target's place, or a distance [m] from it, and face the way it faces."""
    station = Station(distance=distance, sigma=0.15, heading=0.0, heading_sigma=25.0, always=True)
    return Behaviour("take_place", heading_grid(), station=station)


BEHAVIOURS: dict[str, Callable[[Layer], Behaviour]] = {
    "approach": lambda library: approach(),
    "strike": lambda library: strike(library),
    "keep_off": lambda library: keep_off(),
    "circle": lambda library: circle(),
    "circle_back": lambda library: replace(circle(orbit=-0.7), name="circle_back"),
    "take_place": lambda library: take_place(),
}
"""Behaviours that scenes may name."""


def approach(**changes) -> Behaviour:
    """Bring the place where blows land over the target (A6, A7)."""
    return Behaviour("approach", approach_grid(), **changes)


def strike(library: Layer, **changes) -> Behaviour:
    """Hit the target, fast (A6, A7). The grid is the bounding volume of the library's hits.

    It counts only while the target is in reach, :attr:`Behaviour.farthest`: no farther off than an
    action of the library strikes, or ends where the next one may. Beyond, it is worth nothing.
    """
    instance(library, Layer, "strike")
    changes.setdefault("grid", strike_grid(library.strikes.points))
    found = Behaviour("strike", **changes)
    if "farthest" in changes:
        return found
    tracks = stretch_tracks(library, found.limbs)
    blow = np.hypot(tracks.tip[:, 0], tracks.tip[:, 2]).max(initial=0.0) + found.tolerance
    step = np.hypot(*library.table.displacement[:, :2].T).max(initial=0.0) + found.grid.high[1]
    return replace(found, farthest=float(max(blow, step)))


@brief
@dataclass(frozen=True)
class Policy:
    """A solved behaviour: values of being in a state with the target at a grid point."""

    behaviour: Behaviour
    value: np.ndarray  # [N, M] float32
    residual: float  # largest change of the last sweep, over the largest value
    converged: bool
    sweeps: int
    backups: int  # Bellman backups done: actions × grid points × sweeps
    seconds: float

    def __post_init__(self) -> None:
        instance(self.behaviour, Behaviour, "policy: behaviour")
        freeze(self, "policy", value=(np.float32, ("N", len(self.behaviour.grid))))
        instance(self.converged, bool, "policy: converged")
        whole(self.sweeps, "policy: sweeps", least=0)
        whole(self.backups, "policy: backups", least=0)
        number(self.seconds, "policy: seconds", least=0.0)
        if self.residual != np.inf:  # of no sweep
            number(self.residual, "policy: residual", least=0.0)

    @cached_property
    def grid_arguments(self) -> tuple:
        return self.behaviour.grid.kernel_arguments()


def frame_discount(behaviour: Behaviour, fps: float) -> float:
    """γ per frame at a rate: the same per second at any rate."""
    return behaviour.discount_per_second ** (1.0 / fps)


def reward_params(behaviour: Behaviour, fps: float) -> np.ndarray:
    """What a behaviour rewards [9], as the kernels take it."""
    out = np.zeros(9)
    s = behaviour.station
    if s is None:
        near = behaviour.name == "approach"
        out[kernels.SIGMA] = behaviour.sigma if near else behaviour.tolerance
        return out
    out[kernels.POINT] = s.point == "reach"
    out[kernels.DISTANCE], out[kernels.SIGMA] = s.distance, s.sigma
    if s.bearing is not None:
        out[kernels.BEARING] = np.radians(s.bearing)
        out[kernels.BEARING_SIGMA] = np.radians(s.bearing_sigma)
    if s.heading is not None:
        out[kernels.HEADING] = np.radians(s.heading)
        out[kernels.HEADING_SIGMA] = np.radians(s.heading_sigma)
    out[kernels.ORBIT], out[kernels.ALWAYS] = s.orbit / fps, s.always
    return out


def stretch_rewards(behaviour: Behaviour, tracks: Tracks, fps: float) -> np.ndarray:
    """R [L, M] float32 of every stretch for the target at every grid point."""
    points = behaviour.grid.points
    out = np.empty((len(tracks.tip_start) - 1, len(points)), dtype=np.float32)
    discount = frame_discount(behaviour, fps)
    if behaviour.station is not None:
        x, z, yaw = tracks.root.T
        root = np.stack([x, z, np.sin(yaw), np.cos(yaw)], axis=1)
        params = reward_params(behaviour, fps)[None]
        target = np.concatenate([points, points[:, 1:2]], axis=1)  # the one of the two that counts
        kernels.station_rewards(
            root, tracks.centre, tracks.centre_start, params, discount, target, out
        )
    elif behaviour.name == "approach":
        kernels.approach_rewards(
            tracks.centre, tracks.centre_start, discount, behaviour.sigma, points, out
        )
    else:
        kernels.strike_rewards(
            tracks.tip,
            tracks.tip_weight,
            tracks.tip_when,
            tracks.tip_start,
            discount,
            behaviour.tolerance,
            points,
            out,
        )
    return out


def solve(
    library: Layer,
    behaviour: Behaviour,
    *,
    residual: float = 1e-4,
    most_sweeps: int = 1000,
    progress: Callable[[int, float], None] = lambda sweep, residual: None,
) -> Policy:
    """Value iteration by full sweeps until a sweep changes no value by more than ``residual`` times
    the largest value. ``converged`` says whether it got there within ``most_sweeps``.
    """
    instance(library, Layer, "solve")
    begin = time.perf_counter()
    table = library.table
    tracks = stretch_tracks(library, behaviour.limbs)
    grid = behaviour.grid
    points = grid.points
    reward = stretch_rewards(behaviour, tracks, library.clips.fps)
    count = 4 if grid.size[2] == 1 else 8
    index = np.empty((len(table.first), len(points), count), dtype=np.int32)
    weight = np.empty(index.shape, dtype=np.float32)
    kernels.successor_corners(
        table.displacement, points, grid.heading, *grid.kernel_arguments(), index, weight
    )
    factor = (frame_discount(behaviour, library.clips.fps) ** table.duration).astype(np.float32)
    value = np.zeros((table.states, len(points)), dtype=np.float32)
    q = np.empty(reward.shape, dtype=np.float32)
    change = np.empty(table.states, dtype=np.float32)
    left, sweep = np.inf, 0
    while sweep < most_sweeps and left > residual:
        kernels.back_up_stretches(reward, factor, table.target, index, weight, value, q)
        kernels.best_actions(table.action_start, table.stretch, q, value, change)
        sweep += 1
        largest = float(value.max())
        left = float(change.max()) / largest if largest > 0 else 0.0
        progress(sweep, left)
    return Policy(
        behaviour,
        value,
        left,
        left <= residual,
        sweep,
        table.actions * len(points) * sweep,
        time.perf_counter() - begin,
    )
