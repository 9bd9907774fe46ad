"""Moments of a recording that are worth a picture: blows that land, balls avoided, bars passed, …

An event is told when it is over: a ball counts as avoided once it has come down. A moment is when
it is seen: the ball is nearest then.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from kumite.clip import LIMBS, Skeleton, forward_kinematics
from kumite.errors import unknown
from kumite.scene.events import (
    KINDS,
    Attacked,
    Avoided,
    Caught,
    CheckPointReached,
    Event,
    EventIndex,
    Hit,
    Launch,
    Missed,
    Passed,
    RunOver,
    Strike,
    Struck,
    Throw,
    Touched,
)
from kumite.scene.recording import Recording
from kumite.scene.reports import found_ways_out
from kumite.scene.wording import describe

EVENLY = "evenly"
GROUPS = {
    "hits": (Hit, Struck),
    "blows": (Strike,),
    "launches": (Launch,),
    "passed": (Passed, Touched),
}
"""Words for kinds of events; every kind is a word for itself, too."""
TELLING = (Hit, Struck, Avoided, Passed, Caught, RunOver, CheckPointReached)
"""What is shown unless something is asked for."""
TRAIL = 0.3  # s of the way that what strikes has come
PASSING = 4.0  # s before an obstacle counts as passed in which it may have been
FLIGHT = 3.0  # s that a ball flies, at most


@dataclass(frozen=True)
class Moment:
    """A frame, and what is to be seen in it."""

    frame: int
    text: str = ""
    who: tuple[int, ...] = ()  # characters it is about, who acts first; empty: all
    mark: np.ndarray | None = None  # [3] m, where something lands
    blocked: bool = False
    trail: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))  # [n, 3] m
    thing: int | None = None  # the object that it is about


def moments(recording: Recording, at: str | None = None, most: int = 12) -> list[Moment]:
    """At most so many moments, in order. at: a kind of event, a word of ``GROUPS``, or 'evenly';
    by default what the recording tells of, or evenly where it tells of nothing.

    Errors: no event of that kind.
    """
    held = {type(e) for e in recording.events}
    wanted = TELLING if at is None else GROUPS.get(at, (KINDS[at],) if at in KINDS else ())
    ways_out = found_ways_out(recording.events)
    found = [e for e in recording.events if isinstance(e, wanted)]
    if ways_out:  # who was only lucky has not avoided anything that is worth a picture
        found = [
            e for e in found if not isinstance(e, Avoided) or (e.attack, e.character) in ways_out
        ]
    if at == EVENLY or (at is None and not found):
        frames = np.unique(np.linspace(0, len(recording) - 1, most).round().astype(int))
        return [Moment(f) for f in frames.tolist()]
    if not found:
        words = {w for w, kinds in GROUPS.items() if held & set(kinds)} | {k.kind for k in held}
        raise unknown("event to show", str(at), [*words, EVENLY])
    found = _picked(found, most)
    return sorted((_moment(recording, e) for e in found), key=lambda m: m.frame)


def _picked(found: list[Event], most: int) -> list[Event]:
    """So many of them, from the first to the last."""
    if len(found) <= most:
        return found
    return [found[i] for i in np.linspace(0, len(found) - 1, most).round().astype(int)]


def _moment(recording: Recording, event: Event) -> Moment:
    who, last = event.character, len(recording) - 1
    k, frame = recording.names.index(who), min(event.frame, last)
    match event:
        case Hit():
            return _landing(recording, event, k)
        case Struck():
            part = event.part.replace("_", " ")
            text = f"{who}: struck on the {part}, {event.speed:.1f} m/s"
            trail = _way(recording.object_position, _ball(recording, event), frame, recording.fps)
            return Moment(frame, text, (k,), np.array(event.place), False, trail)
        case Avoided() | Missed():
            return _escape(recording, event, k, frame)
        case Passed() | Touched():
            clear = f", {100 * event.clearance:.0f} cm clear" if isinstance(event, Passed) else ""
            text = f"{who}: {event.kind} the {event.thing}{clear}"
            return _beside(recording, event.thing, k, frame, text)
    victim = getattr(event, "victim", None)
    other = () if victim is None else _index(recording, victim)
    return Moment(frame, f"{who}: {describe(event)}", (k, *other))


def _landing(recording: Recording, hit: Hit, k: int) -> Moment:
    """A blow, when it lands between two frames."""
    frame = min(round(hit.time * recording.fps), len(recording) - 1)
    where = hit.victim if hit.part == hit.victim else f"{hit.victim}'s {hit.part}"
    text = f"{hit.character}: {hit.limb} to {where}, {hit.speed:.1f} m/s".replace("_", " ")
    return Moment(
        frame,
        f"{text}, blocked" if hit.blocked else text,
        (k, *_index(recording, hit.victim)),
        np.array(hit.place),
        hit.blocked,
        _tip(recording, k, hit.limb, frame),
    )


def _beside(recording: Recording, name: str, k: int, end: int, text: str) -> Moment:
    """When a character came nearest to a thing."""
    thing = recording.objects.index(name)
    begin = max(0, end - round(PASSING * recording.fps))
    way = recording.root_position[begin : end + 1, k] - recording.object_position[begin, thing]
    frame = begin + int(np.hypot(way[:, 0], way[:, 2]).argmin())
    return Moment(frame, text, (k,), thing=thing)


def _escape(recording: Recording, event: Avoided | Missed, k: int, end: int) -> Moment:
    """When what was thrown or struck at somebody, who avoided it, came nearest."""
    word = "avoids" if isinstance(event, Avoided) else "is missed by"
    told = EventIndex(recording.events)
    blow = [e for e in told.of(Strike) if e.attack == event.attack]
    if blow:
        a, limb = recording.names.index(blow[0].character), blow[0].limb
        begin = min(blow[0].frame, end)
        tip = _tips(recording, a, limb, begin, end + 1)
        frame = begin + _nearest(recording, k, tip, begin)
        text = f"{event.character} {word} {blow[0].character}'s {limb.replace('_', ' ')}"
        return Moment(frame, text, (k, a), trail=_tip(recording, a, limb, frame))
    ball = _ball(recording, event)
    if ball is None:
        return Moment(end, f"{event.character} {word} an attack", (k,))
    begin = max(0, end - round(FLIGHT * recording.fps))
    begin = max(begin, *(e.frame for e in told.of(Throw) if e.attack == event.attack))
    frame = begin + _nearest(recording, k, recording.object_position[begin : end + 1, ball], begin)
    trail = _way(recording.object_position, ball, frame, recording.fps)
    return Moment(frame, f"{event.character} {word} a ball", (k,), trail=trail)


def _index(recording: Recording, name: str) -> tuple[int, ...]:
    return (recording.names.index(name),) if name in recording.names else ()


def _ball(recording: Recording, event: Attacked) -> int | None:
    """The object that is thrown."""
    return None if event.ball is None else recording.objects.index(event.ball)


def _way(position: np.ndarray, thing: int | None, frame: int, fps: float) -> np.ndarray:
    """Where a thing has come from, up to a frame."""
    if thing is None:
        return np.zeros((0, 3))
    return position[max(0, frame - round(TRAIL * fps)) : frame + 1, thing].astype(np.float64)


def _nearest(recording: Recording, k: int, places: np.ndarray, begin: int) -> int:
    """When places [n, 3], one a frame, come nearest to a character's joints."""
    joints = _joints(recording, k, begin, begin + len(places))
    away = np.linalg.norm(joints - places[:, None], axis=2).min(axis=1)
    return int(away.argmin())


def _joints(recording: Recording, k: int, begin: int, end: int) -> np.ndarray:
    root = recording.root_position[begin:end, k].astype(np.float64)
    wxyz = recording.wxyz[begin:end, k].astype(np.float64)
    return forward_kinematics(recording.skeleton, root, wxyz)[0]


def _tips(recording: Recording, k: int, limb: str, begin: int, end: int) -> np.ndarray:
    """Where a limb strikes, frame by frame [n, 3]: the hand, or the sword's joint."""
    return _joints(recording, k, begin, end)[:, _joint(recording.skeleton, limb)]


def _joint(skeleton: Skeleton, limb: str) -> int:
    toe = limb.replace("foot", "toe")
    role = toe if toe in skeleton.roles else limb
    return skeleton.joint(role) if limb in LIMBS and role in skeleton.roles else 0


def _tip(recording: Recording, k: int, limb: str, frame: int) -> np.ndarray:
    begin = max(0, frame - round(TRAIL * recording.fps))
    return _tips(recording, k, limb, begin, frame + 1)


def shown_at(moment: Moment, names: Sequence[str]) -> tuple[int, ...]:
    """The characters that a picture of a moment is about."""
    return moment.who or tuple(range(len(names)))
