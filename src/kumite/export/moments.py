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
from kumite.scene.recording import Event, Recording
from kumite.scene.reports import found_ways_out

EVENLY = "evenly"
GROUPS = {
    "hits": ("hit", "struck"),
    "avoided": ("avoided",),
    "blows": ("strike",),
    "launches": ("launch",),
    "passed": ("passed", "touched"),
}
"""Words for kinds of events; every kind is a word for itself, too."""
TELLING = ("hit", "struck", "avoided", "passed", "caught", "run over", "check point")
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
    held = {e.kind for e in recording.events}
    kinds = set(TELLING) & held if at is None else set(GROUPS.get(at, (at,)))
    found = [e for e in recording.events if e.kind in kinds]
    ways_out = found_ways_out(recording.events)
    if ways_out:  # who was only lucky has not avoided anything that is worth a picture
        found = [
            e for e in found if e.kind != "avoided" or (e.data["attack"], e.character) in ways_out
        ]
    if at == EVENLY or (at is None and not found):
        frames = np.unique(np.linspace(0, len(recording) - 1, most).round().astype(int))
        return [Moment(f) for f in frames.tolist()]
    if not found:
        words = sorted({w for w, ks in GROUPS.items() if held & set(ks)} | held)
        raise unknown("event to show", str(at), [*words, EVENLY])
    found = _picked(found, most)
    return sorted((_moment(recording, e) for e in found), key=lambda m: m.frame)


def _picked(found: list[Event], most: int) -> list[Event]:
    """So many of them, from the first to the last."""
    if len(found) <= most:
        return found
    return [found[i] for i in np.linspace(0, len(found) - 1, most).round().astype(int)]


def _moment(recording: Recording, event: Event) -> Moment:
    k = recording.names.index(event.character)
    data, last = event.data, len(recording) - 1
    frame = min(event.frame, last)
    if event.kind == "hit":
        frame = min(round(float(data["time"]) * recording.fps), last)
        victim, part = str(data["victim"]), str(data["part"]).replace("_", " ")
        limb = str(data["limb"]).replace("_", " ")
        blocked = bool(data.get("blocked"))
        where = victim if part == victim else f"{victim}'s {part}"
        text = f"{event.character}: {limb} to {where}, {float(data['speed']):.1f} m/s"
        return Moment(
            frame,
            f"{text}, blocked" if blocked else text,
            (k, *_index(recording, victim)),
            np.array(data["place"]),
            blocked,
            _tip(recording, k, str(data["limb"]), frame),
        )
    if event.kind == "struck":
        part = str(data["part"]).replace("_", " ")
        ball = _ball_of(recording, data["attack"], frame)
        text = f"{event.character}: struck on the {part}, {float(data['speed']):.1f} m/s"
        trail = _way(recording.object_position, ball, frame, recording.fps)
        return Moment(frame, text, (k,), np.array(data["place"]), False, trail)
    if event.kind in ("avoided", "missed") and "attack" in data:
        return _escape(recording, event, k, frame)
    if event.kind in ("passed", "touched"):
        thing = recording.objects.index(data["thing"])
        begin = max(0, frame - round(PASSING * recording.fps))
        way = recording.root_position[begin : frame + 1, k]
        way = way - recording.object_position[begin, thing]
        frame = begin + int(np.hypot(way[:, 0], way[:, 2]).argmin())
        clear = f", {100 * data['clearance']:.0f} cm clear" if "clearance" in data else ""
        text = f"{event.character}: {event.kind} the {data['thing']}{clear}"
        return Moment(frame, text, (k,), thing=thing)
    other = _index(recording, str(data.get("victim", data.get("at", ""))))
    more = next((str(data[n]) for n in ("motion", "action", "victim", "point") if n in data), "")
    text = f"{event.character}: {event.kind} {more}".replace("_", " ").rstrip()
    return Moment(frame, text, (k, *other))


def _escape(recording: Recording, event: Event, k: int, end: int) -> Moment:
    """When what was thrown or struck at somebody, who avoided it, came nearest."""
    attack = event.data["attack"]
    word = "avoids" if event.kind == "avoided" else "is missed by"
    blow = [e for e in recording.events if e.kind == "strike" and e.data.get("attack") == attack]
    if blow:
        a, limb = recording.names.index(blow[0].character), str(blow[0].data["limb"])
        begin = min(blow[0].frame, end)
        tip = _tips(recording, a, limb, begin, end + 1)
        frame = begin + _nearest(recording, k, tip, begin)
        text = f"{event.character} {word} {blow[0].character}'s {limb.replace('_', ' ')}"
        return Moment(frame, text, (k, a), trail=_tip(recording, a, limb, frame))
    ball = _ball_of(recording, attack, end)
    if ball is None:
        return Moment(end, f"{event.character} {word} an attack", (k,))
    begin = max(0, end - round(FLIGHT * recording.fps))
    thrown = [e for e in recording.events if e.kind == "throw" and e.data["attack"] == attack]
    begin = max(begin, thrown[0].frame)
    frame = begin + _nearest(recording, k, recording.object_position[begin : end + 1, ball], begin)
    trail = _way(recording.object_position, ball, frame, recording.fps)
    return Moment(frame, f"{event.character} {word} a ball", (k,), trail=trail)


def _index(recording: Recording, name: str) -> tuple[int, ...]:
    return (recording.names.index(name),) if name in recording.names else ()


def _ball_of(recording: Recording, attack: int, frame: int) -> int | None:
    """The ball of a throw."""
    names = [
        e.data["ball"]
        for e in recording.events
        if e.kind == "throw" and e.data["attack"] == attack and e.frame <= frame
    ]
    return recording.objects.index(names[-1]) if names else None


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
