"""What a move is, and a style: the words in which the repertoire's tables are written.

A move is written in the *stance frame*: its origin on the ground between the feet, +Z towards
the opponent, +X to the performer's left. Lengths in metres, angles in degrees, times in seconds
from the start of the move. A channel holds (time, value) keys; between keys it moves smoothly, and
before the first and after the last it is in guard. Values are added to the guard's, but for the way
of a blade and for hands: a hand's value is the place of the fist's front *with the head where guard
has it*; hands go along with the head, so that a fist at the chin stays there while its owner ducks.
``aim(…)`` is a place measured from what the blow is aimed at, ``put(…)`` one in the stance whatever
the head does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from kumite.errors import unknown

Vector = tuple[float, ...]
Foothold = tuple[float, float, float]  # (x, z) of the ball and yaw


@dataclass(frozen=True)
class Aim:
    """A place measured from the blow's target, in the direction of the target: see :func:`aim`."""

    offset: tuple[float, float, float]


def aim(left: float = 0.0, up: float = 0.0, ahead: float = 0.0) -> Aim:
    """A place beside, above or beyond the target, seen from the stance."""
    return Aim((left, up, ahead))


@dataclass(frozen=True)
class Put:
    """A place in the stance: see :func:`put`."""

    place: tuple[float, float, float]


def put(left: float, up: float, ahead: float) -> Put:
    """A place in the stance frame, whatever the head (or the foot's step) does."""
    return Put((left, up, ahead))


Value = Vector | Aim | Put
Key = tuple[float, Value]


@dataclass(frozen=True)
class Step:
    """A foot leaves the ground and comes down where it stands in the stance.

    The stance is that of the end of the move, or, for a ``stride`` of a gait, that of the middle of
    the time until the foot is lifted again. In the air the foot follows its arc, and the channel
    ``left_foot`` or ``right_foot``, if the move has it: for kicks and jumps.
    """

    foot: str  # left or right
    lift: float  # s
    land: float  # s
    height: float = 0.085  # m
    stride: bool = False
    to: Foothold | None = None  # in the stance, if not where the guard has the foot


@dataclass(frozen=True)
class Plant:
    """A hand is set down, or takes hold, and stays where it is in the world."""

    hand: str  # left_hand or right_hand
    start: float  # s, when it has arrived
    stop: float  # s, when it leaves
    place: tuple[float, float, float]  # in the stance at the middle of that time
    fade: float = 0.15  # s to get there, and to leave


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
    kind: str  # attack, defence, transition, reaction, idle, target
    seconds: float
    keys: Mapping[str, tuple[Key, ...]] = field(default_factory=dict)
    steps: tuple[Step, ...] = ()
    travel: tuple[float, float, float] = (0.0, 0.0, 0.0)  # left, ahead [m], turned left [deg]
    blows: tuple[Blow, ...] = ()
    glide: str = "ease"  # how the stance travels: ease, steady, start (from rest), stop (to rest)
    from_guard: bool = True  # else it goes on from the pose that the move before has ended in
    to_guard: bool = True
    avoid: tuple[float, float] | None = None  # s in which the body is out of where it was
    mark: float | None = None  # s of the first frame of a target movement
    plants: tuple[Plant, ...] = ()


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
    feet: Mapping[str, Foothold]  # left, right: ball of the foot (x, z) and its yaw, in the stance
    moves: tuple[Move, ...]
    takes: Mapping[str, Take]
    armed: bool = False  # with a sword, which the channel blade points: (yaw, pitch up) [deg]
    vault: int = 9  # frames over which the pelvis sinks to let legs reach: few in a gait
    weight: float = 0.12  # of the way to the other foot that the pelvis goes while a foot is lifted
    sway: float = 1.0  # how much of the bounce that never stops
    blow_angle: float = 0.0  # deg by which a blow's target is varied to either side
    blow_reach: tuple[float, float] = (0.0, 0.0)  # m nearer and farther
    blow_height: tuple[float, float] = (0.0, 0.0)  # m lower and higher
    blow_step: tuple[float, float] = (0.0, 0.0)  # m back and ahead, with the step of a blow
    blow_turn: float = 0.0  # deg turned to either side with the step of a blow
    travel: float = 0.3  # share by which steps and turns are varied
    tempo: float = 0.1  # share by which durations are varied

    def find(self, label: str) -> Move:
        """A move by label. Errors: unknown, with near names."""
        for move in self.moves:
            if move.label == label:
                return move
        raise unknown("move", label, [m.label for m in self.moves])
