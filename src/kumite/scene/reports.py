"""What a recording is about, counted from its events: fights, throws, blows avoided, errands, …

A report is made where the recording holds events of its kind, whatever scene they came from.
"""

from __future__ import annotations

from collections import Counter as Tally
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from kumite.scene.events import (
    Attacked,
    Avoided,
    Caught,
    CheckPointMissed,
    CheckPointReached,
    Counter,
    Decision,
    Done,
    Event,
    EventIndex,
    Foreseen,
    Hit,
    Launch,
    Missed,
    Passed,
    Reaction,
    RunOver,
    Searched,
    Strike,
    Struck,
    Throw,
    Touched,
)
from kumite.scene.recording import Recording

FOUND = "found"  # the outcome of a search for a way out that has found one
LATE = 0.1  # s after which a check point counts as reached too late

Value = int | float | None


@dataclass(frozen=True)
class Report:
    """Figures of one kind: a row for every character (or motion), the same columns in each."""

    name: str
    rows: Mapping[str, Mapping[str, Value]]  # label -> column -> figure; None: there is none

    @property
    def columns(self) -> tuple[str, ...]:
        return tuple(next(iter(self.rows.values())))

    @property
    def total(self) -> dict[str, Value]:
        """Sums over all rows of what is counted; None of what is not."""
        return {
            c: sum(int(row[c] or 0) for row in self.rows.values())
            if all(isinstance(row[c], int) for row in self.rows.values())
            else None
            for c in self.columns
        }


def reports(recording: Recording) -> tuple[Report, ...]:
    """All that a recording has something to say about."""
    events = EventIndex(recording.events)
    made = (make(recording, events) for make in _REPORTS)
    return tuple(report for report in made if report is not None and report.rows)


def _catches(recording: Recording) -> bool:
    """Whether its scene is about catching someone."""
    bout = recording.settings.get("scene", {}).get("bout") or {}
    return bool(bout.get("catch"))


def _fight(recording: Recording, events: EventIndex) -> Report | None:
    """Blows at each other or at a target, also where none was thrown. Those of people on errands
    have a report of their own.
    """
    could = recording.settings.get("aims_at") and not _catches(recording)
    if events.of(Launch) or not (events.of(Strike) or could):
        return None
    taken = Tally(e.victim for e in events.of(Hit) if not e.blocked)
    fall = bool(events.of(Reaction) or events.of(RunOver))
    rows = {}
    for name in recording.names:
        mine = events.of(Hit, name)
        landed = [e for e in mine if not e.blocked]
        rows[name] = {
            "thrown": len(events.of(Strike, name)),
            "landed": len(landed),
            "blocked": len(mine) - len(landed),
            "taken": taken[name],
            "fastest m/s": max((round(e.speed, 2) for e in landed), default=None),
        }
        if fall:
            falls = sum(e.size == "fall" for e in events.of(Reaction, name))
            rows[name]["knocked down"] = falls + len(events.of(RunOver, name))
    return Report("fight", rows)


def _throws(recording: Recording, events: EventIndex) -> Report | None:
    """Balls, by the one they were thrown at. Avoided: they would have met it and it found a way
    out; by luck: it found none and yet was not met; wide: they would not have met it.
    """
    if not events.of(Throw):
        return None
    ways_out = found_ways_out(events.of(Searched))
    ends = [*events.of(Avoided), *events.of(Missed), *events.of(Struck)]
    end = {e.attack: e for e in ends}
    rows = {}
    for name in recording.names:
        thrown = [e.attack for e in events.of(Throw, name)]
        struck = events.of(Struck, name)
        if not thrown and not struck:
            continue
        kinds = [_end_of_throw(a, end.get(a), ways_out, name) for a in thrown]
        others = [e for e in struck if e.attack not in thrown]
        rows[name] = {
            "thrown": len(thrown),
            **{kind: kinds.count(kind) for kind in ("avoided", "by luck", "wide", "struck")},
            "struck by another's": len(others),
            "in flight at the end": kinds.count("in flight"),
        }
    return Report("throws", rows)


def found_ways_out(events: Iterable[Event]) -> set[tuple[int, str]]:
    """Attacks, and who has found a way out of them."""
    searched = (e for e in events if isinstance(e, Searched))
    return {(e.attack, e.character) for e in searched if e.outcome == FOUND}


def _end_of_throw(
    attack: int, end: Attacked | None, ways_out: set[tuple[int, str]], name: str
) -> str:
    if end is None:
        return "in flight"
    if isinstance(end, Struck):
        return "struck" if end.character == name else "wide"
    if isinstance(end, Missed):
        return "wide"
    return "avoided" if (attack, name) in ways_out else "by luck"


def _blows_avoided(recording: Recording, events: EventIndex) -> Report | None:
    """Blows that were seen coming, by the one they came at: as balls; and what was struck back."""
    if not events.of(Foreseen):
        return None
    gap = {e.attack: e.gap for e in events.of(Foreseen)}
    ways_out = found_ways_out(events.of(Searched))
    rows = {}
    for name in recording.names:
        coming = {e.attack for e in events.of(Foreseen) if e.victim == name}
        if not coming:
            continue
        missed = [e.attack for e in events.of(Avoided, name)]
        escaped = {a for a in missed if (a, name) in ways_out}
        lucky = [a for a in missed if a not in escaped and gap.get(a, np.inf) < 0.0]
        met = [e for e in events.of(Hit) if e.victim == name and e.attack in coming]
        rows[name] = {
            "blows": len(coming),
            "avoided": len(escaped),
            "by luck": len(lucky),
            "wide": len(missed) - len(escaped) - len(lucky),
            "struck": sum(not e.blocked for e in met),
            "blocked": sum(e.blocked for e in met),
            "struck back": len(events.of(Counter, name)),
            "landed": sum(not e.blocked for e in events.of(Hit, name)),
        }
    return Report("blows avoided", rows)


def _errands(recording: Recording, events: EventIndex) -> Report | None:
    """What people on errands have begun and done, by character."""
    if not events.of(Launch):
        return None
    rows = {}
    for name in recording.names:
        begun, passed = events.of(Launch, name), events.of(Passed, name)
        if not begun:
            continue
        rows[name] = {"begun": len(begun), "done": len(events.of(Done, name))}
        if events.of(Strike):
            rows[name]["blows"] = len(events.of(Strike, name))
            rows[name]["met"] = len(events.of(Hit, name))
        if events.of(Passed) or events.of(Touched):
            rows[name]["passed"] = len(passed)
            rows[name]["touched"] = len(events.of(Touched, name))
            clear = [round(e.clearance, 2) for e in passed]
            rows[name]["nearest m"] = min(clear, default=None)
    return Report("errands", rows)


def _launches(recording: Recording, events: EventIndex) -> Report | None:
    """How well prepared motions were begun, by motion: level of preparation, 0 to 1, and how far
    the joints were from where the motion begins.
    """
    if not events.of(Launch):
        return None
    by_motion: dict[str, list[Launch]] = defaultdict(list)
    for event in events.of(Launch):
        by_motion[event.motion].append(event)
    rows = {}
    for motion, found in sorted(by_motion.items()):
        level, apart = [e.level for e in found], [e.apart_deg for e in found]
        rows[motion] = {
            "launched": len(found),
            "level": round(float(np.mean(level)), 2),
            "lowest": round(min(level), 2),
            "apart deg": round(float(np.mean(apart)), 1),
        }
    return Report("launches", rows)


def _chase(recording: Recording, events: EventIndex) -> Report | None:
    """Who was caught, and when. Also where nobody was, if the scene is about that."""
    if not events.of(Caught) and not _catches(recording):
        return None
    rows = {}
    for name in recording.names:
        mine = events.of(Caught, name)
        taken = [e for e in events.of(Caught) if e.victim == name]
        first = min((e.frame / recording.fps for e in [*mine, *taken]), default=None)
        rows[name] = {
            "caught": len(mine),
            "was caught": len(taken),
            "first at s": None if first is None else round(first, 2),
        }
    return Report("chase", rows)


def _check_points(recording: Recording, events: EventIndex) -> Report | None:
    """Check points of paths and stories, by the one they are for."""
    if not events.of(CheckPointReached) and not events.of(CheckPointMissed):
        return None
    rows = {}
    for name in recording.names:
        reached, late = events.of(CheckPointReached, name), events.of(CheckPointMissed, name)
        if not reached and not late:
            continue
        lateness, off = [e.late_by for e in reached], [e.distance for e in reached]
        # A point that was not reached when it was due may be reached later.
        open_still = {e.point for e in late} - {e.point for e in reached}
        rows[name] = {
            "reached": len(reached),
            "in time": sum(x <= LATE for x in lateness),
            "not reached": len(open_still),
            "latest s": round(max(lateness), 2) if reached else None,
            "mean distance m": round(float(np.mean(off)), 2) if reached else None,
        }
    return Report("check points", rows)


def _game_tree(recording: Recording, events: EventIndex) -> Report | None:
    """How far those who fight by game tree have looked ahead."""
    rows = {}
    for name in recording.names:
        mine = [e for e in events.of(Decision, name) if e.by == "tree"]
        if mine:
            rows[name] = {
                "decisions": len(mine),
                "nodes": sum(e.nodes or 0 for e in mine),
                "pruned %": round(100 * float(np.mean([e.pruned or 0.0 for e in mine])), 1),
            }
    return Report("game tree", rows)


_REPORTS: tuple[Callable[[Recording, EventIndex], Report | None], ...] = (
    _fight,
    _throws,
    _blows_avoided,
    _errands,
    _launches,
    _chase,
    _check_points,
    _game_tree,
)
