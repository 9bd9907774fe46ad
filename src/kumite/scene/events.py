"""What happens in a scene: one class a kind of event.

Every scene tells the same thing by the same class. An event checks its fields by their annotations
when it is made, so whoever holds one need not look again; numbers are rounded to what is worth
keeping. ``kind`` is its name in files and on the command line. SI units throughout.

In a recording's file an event is a row ``[frame, kind, character, {field: value}]``; fields that
have their default are left out. Rows of older files are read as well: see :func:`read_events`.
"""

from __future__ import annotations

import functools
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self, TypeVar

import numpy as np

from kumite.checked import checked
from kumite.checks import check_fields, instance, mapping, one_of, rounded, text
from kumite.clip import LIMBS
from kumite.errors import KumiteError, unknown

if TYPE_CHECKING:
    from kumite.annotate import Strikes

Limb = Annotated[str, one_of(*LIMBS)]
Metres = Annotated[float, rounded(4)]
MetresPerSecond = Annotated[float, rounded(4)]
Seconds = Annotated[float, rounded(4)]
Degrees = Annotated[float, rounded(3)]
Share = Annotated[float, rounded(4)]  # 0 to 1
Impulse = Annotated[float, rounded(3)]  # N s
Cost = Annotated[float, rounded(5)]
Worth = Annotated[float, rounded(6)]
Score = Annotated[float, lambda value, what: float(f"{value:.6g}")]
Place = Annotated[tuple[float, float, float], rounded(4)]  # m, in the scene's axes


def place(point: np.ndarray) -> Place:
    """A point [3] m for an event."""
    x, y, z = point.tolist()
    return x, y, z


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened: at a frame, by or to a character."""

    kind: ClassVar[str]
    renamed: ClassVar[Mapping[str, str]] = {}  # old names of fields in files, and today's
    dropped: ClassVar[frozenset[str]] = frozenset()  # fields that files had once
    lacking: ClassVar[Mapping[str, Any]] = {}  # fields that files had not once, and what to take
    times: ClassVar[tuple[str, ...]] = ()  # fields in seconds since the start

    frame: int  # of the scene or the recording, from 0
    character: str

    def __post_init__(self) -> None:
        if type(self) is Event:
            raise KumiteError("an event of no kind; expected one of kumite.scene.events.KINDS")
        check_fields(self, f"event {self.kind!r}")
        if self.frame < 0:
            raise KumiteError(f"event {self.kind!r}: frame: {self.frame}; expected at least 0")

    @property
    def things(self) -> tuple[str, ...]:
        """The scene's objects that it names."""
        return ()

    def to_json(self) -> list[Any]:
        """Its row in a file."""
        data = {}
        for name, default in _defaults(type(self)):
            value = getattr(self, name)
            if default is MISSING or value != default:
                data[name] = list(value) if isinstance(value, tuple) else value
        return [self.frame, self.kind, self.character, data]

    def counted_from(self, begin: int, fps: float) -> Self:
        """The same as told by a recording that begins at a frame of the scene."""
        if begin == 0:
            return self
        times = {name: getattr(self, name) for name in self.times}
        times = {name: t - begin / fps for name, t in times.items() if t is not None}
        return replace(self, frame=self.frame - begin, **times)


@functools.cache
def _defaults(kind: type[Event]) -> tuple[tuple[str, Any], ...]:
    """Its fields besides the frame and the character, and the default of each, or MISSING."""
    return tuple((f.name, f.default) for f in fields(kind)[2:])


# Blows -------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Strike(Event):
    """A character throws a blow: the frames have begun in which it may land."""

    kind: ClassVar[str] = "strike"

    limb: Limb
    blow: int | None = None  # row of its library's Strikes; None: it is none of them
    speed: MetresPerSecond | None = None  # of the limb's tip, as captured, where it is fastest
    attack: int | None = None  # number of the attack, where somebody saw it coming


def strike(
    frame: int, who: str, limb: int, blow: int, strikes: Strikes, attack: int | None = None
) -> Strike:
    """A blow of a library is thrown. limb: index into clip.LIMBS."""
    speed = float(np.linalg.norm(strikes.velocity[blow]))
    return Strike(frame, who, limb=LIMBS[limb], blow=blow, speed=speed, attack=attack)


@dataclass(frozen=True, slots=True, kw_only=True)
class Hit(Event):
    """A blow lands, on a character or on a thing. character: who strikes."""

    kind: ClassVar[str] = "hit"
    lacking: ClassVar[Mapping[str, Any]] = {"blocked": False}
    times: ClassVar[tuple[str, ...]] = ("time",)

    victim: str  # a character or a thing
    limb: Limb  # that strikes
    part: str  # of the victim's body; a thing's own name
    speed: MetresPerSecond  # of what strikes against what is struck
    place: Place  # where it lands
    time: Seconds  # since the start, between two frames
    blocked: bool  # an arm has stopped it
    blow: int | None = None  # as in Strike
    attack: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Reaction(Event):
    """A character reacts to a blow that has landed on it."""

    kind: ClassVar[str] = "reaction"

    action: str  # label of the captured reaction that it plays
    stretch: int  # of the library's action table
    size: Annotated[str, one_of("flinch", "stagger", "fall")]
    physical: bool  # whether a moment of physics comes first
    impulse: Impulse  # that the body takes up; all that the blow brings, without physics
    deviation: Metres | None  # greatest, mean of all joints, by physics; None without it


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOver(Event):
    """A vehicle runs a character down."""

    kind: ClassVar[str] = "run over"
    renamed: ClassVar[Mapping[str, str]] = {"by": "vehicle"}

    vehicle: str
    speed: MetresPerSecond

    @property
    def things(self) -> tuple[str, ...]:
        return (self.vehicle,)


# Decisions ---------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision(Event):
    """A character's controller chooses what it does next."""

    kind: ClassVar[str] = "decision"
    dropped: ClassVar[frozenset[str]] = frozenset({"frames"})
    lacking: ClassVar[Mapping[str, Any]] = {"jump": False}

    by: str  # the controller: policy, tree, avoid, prepare, or the name of one's own
    stretch: int  # of the action table that the controller plans on: what it does
    jump: bool  # it begins with a join: it is not what follows in the capture
    action: str = ""  # its label, where actions have labels
    considered: int | None = None  # ways to go on that were looked at, at all depths
    # policy
    state: int | None = None  # of the action table
    worth: Worth | None = None  # of state and action
    apart: int | None = None  # of the ways considered, those that keep off others
    # tree
    comp: Score | None = None  # score of the best line of play for itself
    coop: Score | None = None  # and for what is wanted of it
    nodes: int | None = None  # of the tree
    pruned: Share | None = None  # of the actions looked at
    outside_set: bool = False  # of the actions that it may use: none of those could be done
    flaws: str = ""  # rules that it breaks, for want of a better one
    # prepare
    level: Share | None = None  # of preparation that is aimed at, 0 to 1


# What is seen coming, and avoided ----------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Attacked(Event):
    """Of an attack, a thrown ball or a blow: it has a number, and comes from one of the two.

    Both are None where a recording was begun after it.
    """

    attack: int
    ball: str | None = None  # the thing
    attacker: str | None = None  # whose blow it is

    @property
    def things(self) -> tuple[str, ...]:
        return () if self.ball is None else (self.ball,)


@dataclass(frozen=True, slots=True, kw_only=True)
class Throw(Event):
    """A ball is thrown at a character."""

    kind: ClassVar[str] = "throw"

    attack: int  # its number
    ball: str  # the thing
    speed: MetresPerSecond
    place: Place  # where it is thrown from

    @property
    def things(self) -> tuple[str, ...]:
        return (self.ball,)


@dataclass(frozen=True, slots=True, kw_only=True)
class Foreseen(Event):
    """A blow is known before it is thrown, or more of it is. character: who will strike."""

    kind: ClassVar[str] = "foreseen"
    renamed: ClassVar[Mapping[str, str]] = {"at": "victim"}
    times: ClassVar[tuple[str, ...]] = ("begins",)

    attack: int  # its number
    limb: Limb
    blow: int  # as in Strike
    victim: str
    gap: Metres  # between it and the victim, were that to stay as it stands; below 0 it would land
    begins: Seconds  # since the start


@dataclass(frozen=True, slots=True, kw_only=True)
class Searched(Attacked):
    """A character has searched for a way to avoid an attack (Oshita & Masaoka 2011)."""

    kind: ClassVar[str] = "avoidance"

    outcome: Annotated[str, one_of("found", "wide", "early", "too late", "no candidate", "hit")]
    aim: Seconds | None = None  # from the search until the attack is avoided
    candidates: int | None = None  # avoidances that were looked at, and what became of them:
    valid: int = 0
    hit: int = 0
    culled: int = 0
    stiff: int = 0
    too_fast: int = 0
    too_long: int = 0
    # Of the best, where one was found:
    path: tuple[int, ...] = ()  # stretches of the action table
    part: int | None = None  # of the library's AvoidanceParts
    indexed: bool | None = None  # found by the index, without a search
    scale: Share | None = None  # of time
    cost: Cost | None = None
    costs: Annotated[tuple[float, ...], rounded(5)] = ()  # of avoidance, body and timescale
    distance: Metres | None = None  # from the attack at its nearest
    before: Metres | None = None  # the same if nothing were done


@dataclass(frozen=True, slots=True, kw_only=True)
class Stale(Attacked):
    """What a search has found comes too late: the character does something else by now."""

    kind: ClassVar[str] = "stale"
    renamed: ClassVar[Mapping[str, str]] = {"dropped": "paths"}

    paths: int  # that were found, all of them in vain


@dataclass(frozen=True, slots=True, kw_only=True)
class Avoided(Attacked):
    """An attack is over without having struck the character that it was meant for."""

    kind: ClassVar[str] = "avoided"


@dataclass(frozen=True, slots=True, kw_only=True)
class Missed(Attacked):
    """A ball is down that would have struck nobody anyhow. character: at whom it was thrown."""

    kind: ClassVar[str] = "missed"


@dataclass(frozen=True, slots=True, kw_only=True)
class Struck(Attacked):
    """A ball strikes a character."""

    kind: ClassVar[str] = "struck"

    part: str  # of the body
    speed: MetresPerSecond
    place: Place
    meant: bool  # it was thrown at this character


@dataclass(frozen=True, slots=True, kw_only=True)
class Counter(Event):
    """A character strikes back after it has avoided a blow."""

    kind: ClassVar[str] = "counter"

    victim: str
    limb: Limb
    blow: int  # as in Strike
    gap: Metres  # to the victim at its nearest
    seconds: Seconds  # until then


# Preparation -------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Launch(Event):
    """A character begins a target motion (Shum et al. 2013)."""

    kind: ClassVar[str] = "launch"

    motion: str  # its label
    level: Share  # of preparation
    apart_deg: Degrees  # mean of the joints, from the posture in which it begins
    to_contact: Seconds
    bent: Metres | None  # by which it is bent, or would be, to meet its thing; None without one


@dataclass(frozen=True, slots=True, kw_only=True)
class Done(Event):
    """A character has done a target motion."""

    kind: ClassVar[str] = "done"

    motion: str


@dataclass(frozen=True, slots=True, kw_only=True)
class _AtThing(Event):
    thing: str

    @property
    def things(self) -> tuple[str, ...]:
        return (self.thing,)


@dataclass(frozen=True, slots=True, kw_only=True)
class Passed(_AtThing):
    """A character has passed an obstacle."""

    kind: ClassVar[str] = "passed"

    clearance: Metres  # at its nearest; below 0 it was in it


@dataclass(frozen=True, slots=True, kw_only=True)
class Touched(_AtThing):
    """A character touches an obstacle that it passes."""

    kind: ClassVar[str] = "touched"

    part: str  # of its body


@dataclass(frozen=True, slots=True, kw_only=True)
class MovedGoal(_AtThing):
    """A character is sent into a thing, and goes to a side of it."""

    kind: ClassVar[str] = "moved goal"


# Stories -----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Cue(Event):
    """A character fights otherwise from now on. What is None stays."""

    kind: ClassVar[str] = "cue"

    against: str | None = None
    style: str | Mapping[str, str | float] | None = None
    depth: int | None = None
    wanted: tuple[str, ...] | None = None
    unwanted: tuple[str, ...] | None = None
    only: tuple[str, ...] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Caught(Event):
    """A character comes as near to one that flees as counts."""

    kind: ClassVar[str] = "caught"

    victim: str
    distance: Metres


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckPointReached(Event):
    """A character has done what it was to do at a check point of its route."""

    kind: ClassVar[str] = "check point"

    point: int  # from 0
    late_by: Seconds
    distance: Metres  # from it


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckPointMissed(Event):
    """A check point is due and not done; it may be later."""

    kind: ClassVar[str] = "check point missed"
    renamed: ClassVar[Mapping[str, str]] = {"by": "distance"}
    times: ClassVar[tuple[str, ...]] = ("due",)

    point: int  # from 0
    due: Seconds | None
    distance: Metres  # from it at the nearest


KINDS: Mapping[str, type[Event]] = {
    c.kind: c
    for c in (
        Strike, Hit, Reaction, RunOver, Decision, Throw, Foreseen, Searched, Stale, Avoided,
        Missed, Struck, Counter, Launch, Done, Passed, Touched, MovedGoal, Cue, Caught,
        CheckPointReached, CheckPointMissed,
    )
}  # fmt: skip
"""Every kind of event by its name in files."""

E = TypeVar("E", bound=Event)


@checked
class EventIndex:
    """Events, to be asked for by kind and character; each list is in order."""

    def __init__(self, events: Iterable[Event]) -> None:
        self._found: dict[tuple[type[Event], str | None], list[Any]] = defaultdict(list)
        for event in events:
            self._found[type(event), None].append(event)
            self._found[type(event), event.character].append(event)

    def of(self, kind: type[E], character: str | None = None) -> list[E]:
        """Those of a kind; of one character alone, if it is named."""
        return self._found.get((kind, character), [])


# Files -------------------------------------------------------------------------------------------


def read_events(rows: Sequence[Sequence[Any]]) -> tuple[Event, ...]:
    """The events of a recording's file, also of one written before they had classes.

    Errors: an unknown kind, an unknown or a missing field, a value that is not of its type.
    """
    sources: dict[int, dict[str, str]] = {}  # attack -> what files of before do not say of it
    out = []
    for frame, kind, character, data in rows:
        event = _read(frame, kind, character, data, sources)
        if isinstance(event, Throw):
            sources[event.attack] = {"ball": event.ball}
        elif isinstance(event, Foreseen):
            sources[event.attack] = {"attacker": event.character}
        out.append(event)
    return tuple(out)


def _read(
    frame: int, kind: str, character: str, data: Any, sources: Mapping[int, dict[str, str]]
) -> Event:
    text(kind, "event")
    said = dict(mapping(instance(data, Mapping, f"event {kind!r}: data"), f"event {kind!r}: data"))
    if kind == Missed.kind and "point" in said:  # one word for two things, once
        kind = CheckPointMissed.kind
    if kind not in KINDS:
        raise unknown("kind of event", kind, KINDS)
    made = KINDS[kind]
    known = dict(_defaults(made))
    said = {**made.lacking, **{made.renamed.get(name, name): v for name, v in said.items()}}
    said = {name: value for name, value in said.items() if name not in made.dropped}
    if made is Decision and "by" not in said:
        said["by"] = "tree" if "nodes" in said else "avoid" if "frames" in data else "policy"
    if issubclass(made, Attacked) and isinstance(said.get("attack"), int):
        said = {**sources.get(said["attack"], {}), **said}
    for name in said:
        if name not in known:
            raise unknown(f"field of event {kind!r}", name, known)
    for name, default in known.items():
        if default is MISSING and name not in said:
            raise KumiteError(f"event {kind!r}: {name} is missing")
    return made(frame, character, **said)
