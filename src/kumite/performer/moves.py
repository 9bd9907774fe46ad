"""What a move is, and a style: the words in which the repertoire's tables are written.

A move is written in the *stance frame*: its origin on the ground between the feet, +Z towards
the opponent, +X to the performer's left. Lengths in metres, angles in degrees, times in seconds
from the start of the move. A channel holds (time, value) keys; between keys it moves smoothly, and
before the first and after the last it is in guard. Values are added to the guard's, but for hands:
those are places of the fist's front, or ``aim(…)``: a place measured from what the blow is aimed
at.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from kumite.errors import unknown

Vector = tuple[float, ...]


@dataclass(frozen=True)
class Aim:
    """A place measured from the blow's target, in the direction of the target: see :func:`aim`."""

    offset: tuple[float, float, float]


def aim(left: float = 0.0, up: float = 0.0, ahead: float = 0.0) -> Aim:
    """A place beside, above or beyond the target, seen from the stance."""
    return Aim((left, up, ahead))


@dataclass(frozen=True)
class Step:
    """A foot leaves the ground and comes down where it stands in the stance.

    The stance is that of the end of the move, or, for a ``stride`` of a gait, that of the middle of
    the time until the foot is lifted again.
    """

    foot: str  # left or right
    lift: float  # s
    land: float  # s
    height: float = 0.085  # m
    stride: bool = False


@dataclass(frozen=True)
class Blow:
    """When a limb lands on what it is aimed at."""

    limb: str
    time: float  # s
    target: tuple[float, float, float]  # angle [deg, + left], distance and height [m] by default


@dataclass(frozen=True)
class Move:
    """One row of the repertoire."""

    label: str
    kind: str  # attack, defence, transition, reaction, idle
    seconds: float
    keys: Mapping[str, tuple[tuple[float, Vector | Aim], ...]] = field(default_factory=dict)
    steps: tuple[Step, ...] = ()
    travel: tuple[float, float, float] = (0.0, 0.0, 0.0)  # left, ahead [m], turned left [deg]
    blows: tuple[Blow, ...] = ()
    glide: str = "ease"  # how the stance travels: ease, steady, start (from rest), stop (to rest)
    holds: bool = True  # begins and ends in guard; a phase of a gait goes on from the one before
    avoid: tuple[float, float] | None = None  # s in which the body is out of where it was
    mark: float | None = None  # s of the first frame of a target movement


@dataclass(frozen=True)
class Take:
    """What one clip shows: moves in this order, or ``count`` of them drawn from a deck."""

    moves: tuple[str, ...]
    count: int | None = None


@dataclass(frozen=True)
class Style:
    """A way of standing and the moves that begin and end in it."""

    name: str
    guard: Mapping[str, Vector]  # every channel's value at rest
    feet: Mapping[
        str, Vector
    ]  # left, right: ball of the foot (x, z) and its yaw, in the stance frame
    moves: tuple[Move, ...]
    takes: Mapping[str, Take]
    vault: int = 9  # frames over which the pelvis sinks to let legs reach: few in a gait
    hands_sink: float = 0.0  # share of that sinking that hands go along with
    sway: float = 1.0  # how much of the bounce that never stops
    blow_angle: float = 0.0  # deg by which a blow's target is varied to either side
    blow_reach: tuple[float, float] = (0.0, 0.0)  # m nearer and farther
    blow_height: tuple[float, float] = (0.0, 0.0)  # m lower and higher
    travel: float = 0.3  # share by which steps and turns are varied
    tempo: float = 0.1  # share by which durations are varied

    def find(self, label: str) -> Move:
        """A move by label. Errors: unknown, with near names."""
        for move in self.moves:
            if move.label == label:
                return move
        raise unknown("move", label, [m.label for m in self.moves])
