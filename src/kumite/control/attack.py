"""Attacks as space-time volumes: spheres at times (Oshita & Masaoka 2011, section 4.2).

A ball, a limb of whoever moves, a sword: each becomes the same. How densely it is sampled follows
from how fast it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kumite.body import Spheres, limb_spheres
from kumite.brief import brief
from kumite.checked import checked
from kumite.checks import array, freeze, number
from kumite.clip import Skeleton, forward_kinematics
from kumite.control.rules import GRAVITY
from kumite.errors import KumiteError
from kumite.kernels.avoid import Attacks

INTERVAL = 1 / 20  # s between samples at most, the paper's
LONGEST_STEP = 0.10  # m that an attack goes between two samples at most
FASTEST = 400.0  # m/s: faster is no attack but a mistake
SMALLEST, LARGEST = 0.005, 2.0  # m, radii
LONGEST = 600.0  # s
NEAR = 2.0  # m from a character's root over the ground: only there an attack counts


@checked
@brief
@dataclass(frozen=True)
class Attack:
    """I spheres at T times; between them they move in straight lines."""

    when: np.ndarray  # [T] s, ascending, of the scene's clock
    centre: np.ndarray  # [T, I, 3] m
    radius: np.ndarray  # [I] m
    name: str = "attack"

    def __post_init__(self) -> None:
        times, spheres = len(self.when), len(self.radius)
        freeze(
            self,
            f"attack {self.name!r}",
            when=(np.float64, (times,)),
            centre=(np.float64, (times, spheres, 3)),
            radius=(np.float64, (spheres,)),
        )
        for what, fits in (
            ("expected at least one time and one sphere", times > 0 and spheres > 0),
            ("times must ascend", bool(np.all(np.diff(self.when) > 0))),
            (
                "it is not finite",
                bool(np.isfinite(self.when).all() and np.isfinite(self.centre).all()),
            ),
            (
                f"radii must be from {SMALLEST} to {LARGEST} m",
                bool(np.all((self.radius >= SMALLEST) & (self.radius <= LARGEST))),
            ),
        ):
            if not fits:
                raise KumiteError(f"attack {self.name!r}: {what}")
        if self.when[-1] - self.when[0] > LONGEST:
            raise KumiteError(
                f"attack {self.name!r}: {self.when[-1] - self.when[0]:g} s; expected at most "
                f"{LONGEST:g}"
            )
        if self.speed > FASTEST * (1.0 + 1e-9):  # rounding
            raise KumiteError(
                f"attack {self.name!r}: {self.speed:.0f} m/s; expected at most {FASTEST:g}"
            )

    def __len__(self) -> int:
        return len(self.when)

    @property
    def speed(self) -> float:
        """The largest of its spheres' speeds [m/s]."""
        if len(self.when) < 2:
            return 0.0
        way = np.linalg.norm(np.diff(self.centre, axis=0), axis=2)
        return float((way / np.diff(self.when)[:, None]).max())

    def nearest(self, body: np.ndarray, radius: np.ndarray) -> float:
        """The smallest gap [m] to spheres [B, 3] of radii [B] that stay where they are."""
        off = self.dense[-1][:, :, None] - body
        return float((np.linalg.norm(off, axis=-1) - self.radius[:, None] - radius).min())

    def at(self, when: np.ndarray | float) -> np.ndarray:
        """Centres [..., I, 3] at times, at its ends before and after them."""
        t = np.clip(when, self.when[0], self.when[-1])
        k = np.clip(np.searchsorted(self.when, t, side="right") - 1, 0, max(len(self) - 2, 0))
        if len(self) == 1:
            return np.broadcast_to(self.centre[0], (*np.shape(t), *self.centre.shape[1:]))
        share = ((t - self.when[k]) / (self.when[k + 1] - self.when[k]))[..., None, None]
        return self.centre[k] + share * (self.centre[k + 1] - self.centre[k])

    @cached_property
    def dense(self) -> tuple[np.ndarray, np.ndarray]:
        """Times [T'] so near to each other that no sphere goes farther than it may between two,
        centres [T', I, 3].
        """
        if len(self) < 2:
            return self.when, self.centre
        way = np.linalg.norm(np.diff(self.centre, axis=0), axis=2).max(axis=1)
        parts = np.ceil(np.maximum(way / LONGEST_STEP, np.diff(self.when) / INTERVAL) - 1e-9)
        parts = np.maximum(parts, 1).astype(int)
        of = np.repeat(np.arange(len(parts)), parts)
        part = np.arange(len(of)) - np.repeat(np.cumsum(parts) - parts, parts)
        when = np.append(self.when[of] + part / parts[of] * np.diff(self.when)[of], self.when[-1])
        return when, self.at(when)


def thrown(
    position: Sequence[float] | np.ndarray,
    velocity: Sequence[float] | np.ndarray,
    radius: float,
    *,
    when: float = 0.0,
    seconds: float = 4.0,
    gravity: float = GRAVITY,
    name: str = "ball",
) -> Attack:
    """A ball in flight from a place with a velocity, until it lands or ``seconds`` have passed.

    Errors: not finite, a radius or speed that makes no sense.
    """
    p = array(position, f"attack {name!r}: expected a finite place and velocity: place", (3,))
    v = array(velocity, f"attack {name!r}: expected a finite place and velocity: velocity", (3,))
    radius = number(radius, f"attack {name!r}: radius", least=SMALLEST, most=LARGEST, unit="m")
    if not (0 < seconds <= LONGEST and np.isfinite(gravity) and np.isfinite(when)):
        raise KumiteError(
            f"attack {name!r}: expected a finite time and gravity, above 0 to {LONGEST:g} s"
        )
    if not SMALLEST <= radius <= LARGEST:
        raise KumiteError(
            f"attack {name!r}: radius {radius} m; expected from {SMALLEST} to {LARGEST}"
        )
    speed = float(np.linalg.norm(v))
    if not 0 < speed <= FASTEST:
        raise KumiteError(f"attack {name!r}: {speed:g} m/s; expected above 0, at most {FASTEST:g}")
    end = seconds
    if gravity > 0:  # it lies where it has come down
        drop = v[1] ** 2 + 2.0 * gravity * max(p[1] - radius, 0.0)
        end = min(end, (v[1] + np.sqrt(drop)) / gravity)
    end = max(end, 1e-3)
    fastest = max(speed, float(np.linalg.norm(v - [0.0, gravity * end, 0.0])))
    count = int(np.ceil(max(end / INTERVAL, fastest * end / LONGEST_STEP))) + 1
    t = np.linspace(0.0, end, count)
    centre = p + t[:, None] * v
    centre[:, 1] -= 0.5 * gravity * t**2
    return Attack(when + t, centre[:, None], np.array([radius]), name)


def from_limbs(
    skeleton: Skeleton,
    root_position: np.ndarray,
    wxyz: np.ndarray,
    when: np.ndarray,
    limb: str,
    *,
    spheres: Spheres | None = None,
    name: str = "blow",
) -> Attack:
    """What a limb sweeps through: motion of roots [T, 3] m and rotations [T, J, 4] at times [T] s.

    It may be recorded or foreseen. limb: a hand with its forearm, a foot with its shin (one of
    ``clip.LIMBS``), or ``sword`` for the blade; spheres: what of it, by default
    :func:`~kumite.body.limb_spheres`. Errors: an unknown limb; shapes that do not fit; times that
    do not ascend; what is not finite.
    """
    spheres = spheres or limb_spheres(skeleton, limb)
    root_position, wxyz = np.asarray(root_position, float), np.asarray(wxyz, float)
    times = np.shape(when)
    if root_position.shape != (*times, 3) or wxyz.shape != (*times, len(skeleton), 4):
        raise KumiteError(
            f"attack {name!r}: roots {list(root_position.shape)} and rotations {list(wxyz.shape)} "
            f"at times {list(times)}; expected [T, 3], [T, {len(skeleton)}, 4] and [T]"
        )
    position, world = forward_kinematics(skeleton, root_position, wxyz)
    return Attack(np.asarray(when, float), spheres.at(position, world), spheres.radius, name)


def packed(
    attacks: Sequence[Attack], now: float, place: np.ndarray, within: float = NEAR
) -> tuple[Attacks, list[int]]:
    """Attacks as the kernels take them, and which these are: of each what is still to come, times
    from ``now`` on (where it is now, first), from the first sample near a place [x, z] to the last.

    An attack that comes by twice is one attack. Those that never come by are left out.
    """
    taken, which = [], []
    for m, attack in enumerate(attacks):
        when, centre = attack.dense
        first = int(np.searchsorted(when, now))
        if 0 < first < len(when) and when[first] > now:  # it is on its way from one to the next
            first -= 1
            when, centre = when.copy(), centre.copy()
            when[first], centre[first] = now, attack.at(now)
        x, z = centre[first:, :, 0] - place[0], centre[first:, :, 2] - place[1]
        close = (x * x + z * z < (within + attack.radius) ** 2).any(axis=1).nonzero()[0]
        if len(close):
            part = slice(first + close[0], first + close[-1] + 1)
            taken.append((when[part] - now, _lasts(when[part]), centre[part], attack.radius))
            which.append(m)
    if len(taken) == 1:
        when, lasts, centre, radius = taken[0]
        sample = np.array([0, len(when)])
        radii, count = radius[None].copy(), np.array([len(radius)])  # may be written to, as below
        return Attacks(sample, when, lasts, centre, radii, count), which
    most = max((len(t[3]) for t in taken), default=1)
    sample = np.cumsum([0, *(len(t[0]) for t in taken)])
    centre, radius = np.zeros((sample[-1], most, 3)), np.zeros((len(taken), most))
    for m, t in enumerate(taken):
        centre[sample[m] : sample[m + 1], : len(t[3])] = t[2]
        radius[m, : len(t[3])] = t[3]
    when = np.concatenate([np.zeros(0), *(t[0] for t in taken)])
    lasts = np.concatenate([np.zeros(0), *(t[1] for t in taken)])
    count = np.array([len(t[3]) for t in taken], dtype=np.int64)
    return Attacks(sample, when, lasts, centre, radius, count), which


def _lasts(when: np.ndarray) -> np.ndarray:
    """The time [T] that each sample stands for: half of the way to its neighbours."""
    half, out = 0.5 * (when[1:] - when[:-1]), np.zeros(len(when))
    out[:-1] = half
    out[1:] += half
    return out
