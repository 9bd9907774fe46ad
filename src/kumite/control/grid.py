"""Where a target may be, seen from the avatar: a polar grid in its facing frame (A6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kumite.checked import checked
from kumite.checks import array
from kumite.errors import KumiteError


@checked
@dataclass(frozen=True)
class TargetGrid:
    """Angles × distances × heights. Angle 0 is straight ahead (+Z), positive to the left (+X).

    With ``heading`` the third axis is not the target's height but the way it faces [rad], seen
    from the avatar, from -π to π with both ends.
    """

    low: tuple[float, float, float]  # rad, m, m: the first angle, distance and height
    high: tuple[float, float, float]  # the last ones; of an angle all round, one turn after low
    size: tuple[int, int, int]  # points along each; one height: the grid is flat
    wraps: bool  # the angle goes all round
    inside_only: bool  # values are 0 outside the grid; else the nearest point of it counts
    heading: bool = False

    def __post_init__(self) -> None:
        if min(self.size) < 1 or self.size[0] < 2 or self.size[1] < 2:
            raise KumiteError(f"target grid: size {self.size}, expected at least 2 × 2 × 1")
        for low, high, size in zip(self.low, self.high, self.size):
            if not (np.isfinite(low) and np.isfinite(high)) or (size > 1 and high <= low):
                raise KumiteError(f"target grid: empty range {low}..{high}")
        if self.heading and not (
            self.size[2] > 2 and np.allclose([self.low[2], self.high[2]], [-np.pi, np.pi])
        ):
            raise KumiteError("target grid: headings must go from -π to π in at least 3 points")

    @property
    def step(self) -> tuple[float, float, float]:
        """Spacing of the points."""
        spans = [n if (axis == 0 and self.wraps) else n - 1 for axis, n in enumerate(self.size)]
        return tuple(
            (high - low) / span if span else 1.0
            for low, high, span in zip(self.low, self.high, spans)
        )  # type: ignore[return-value]

    @property
    def points(self) -> np.ndarray:
        """Grid points [M, 3] in the facing frame: x, height (or heading) and z; the height varies
        fastest."""
        angle, distance, height = (
            low + step * np.arange(n) for low, step, n in zip(self.low, self.step, self.size)
        )
        a, d, h = np.meshgrid(angle, distance, height, indexing="ij")
        return np.stack([d * np.sin(a), h, d * np.cos(a)], axis=-1).reshape(-1, 3)

    def __len__(self) -> int:
        return int(np.prod(self.size))

    def contains(self, point: np.ndarray) -> np.ndarray:
        """Whether points [..., 3] of the facing frame lie within the grid's bounds [...]."""
        p = np.asarray(point, dtype=np.float64)
        angle = np.arctan2(p[..., 0], p[..., 2])
        distance = np.hypot(p[..., 0], p[..., 2])
        inside = (distance >= self.low[1]) & (distance <= self.high[1])
        if not self.wraps:
            inside &= (angle >= self.low[0]) & (angle <= self.high[0])
        if self.size[2] > 1:
            inside &= (p[..., 1] >= self.low[2]) & (p[..., 1] <= self.high[2])
        return inside

    def kernel_arguments(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool, bool]:
        """low, step, size, wraps, inside_only as the kernels take them."""
        return (
            np.array(self.low),
            np.array(self.step),
            np.array(self.size, dtype=np.int64),
            self.wraps,
            self.inside_only,
        )


def approach_grid(radius: float = 2.0, distances: int = 5, angles: int = 13) -> TargetGrid:
    """The paper's grid for approaching: flat, all round, 2 m, 5 distances × 13 angles."""
    return TargetGrid(
        (-np.pi, 0.0, 0.0),
        (np.pi, radius, 0.0),
        (angles, distances, 1),
        wraps=True,
        inside_only=False,
    )


def heading_grid(
    radius: float = 2.0, distances: int = 5, angles: int = 12, headings: int = 13
) -> TargetGrid:
    """A grid for where a target is and which way it faces: every 30° of both by default."""
    return TargetGrid(
        (-np.pi, 0.0, -np.pi),
        (np.pi, radius, np.pi),
        (angles, distances, headings),
        wraps=True,
        inside_only=False,
        heading=True,
    )


@checked
def strike_grid(
    points: np.ndarray, angles: int = 10, distances: int = 10, heights: int = 4
) -> TargetGrid:
    """The paper's grid for punching: the bounding volume of the effective hitting points [P, 3]."""
    points = array(points, "effective hitting points", ("P", 3))
    if len(points) == 0:
        raise KumiteError("the library holds no effective hits: there is nothing to strike with")
    angle = np.arctan2(points[:, 0], points[:, 2])
    distance = np.hypot(points[:, 0], points[:, 2])
    stats = [(angle.min(), angle.max()), (distance.min(), distance.max())]
    stats.append((points[:, 1].min(), points[:, 1].max()))
    # A cell of at least a centimetre (or a hundredth of a radian), also for a single blow.
    low = tuple(float(a if b - a > 0.02 else a - 0.05) for a, b in stats)
    high = tuple(float(b if b - a > 0.02 else b + 0.05) for a, b in stats)
    return TargetGrid(low, high, (angles, distances, heights), wraps=False, inside_only=True)  # type: ignore[arg-type]
