"""What a recording is about, counted from its events: fights, throws, blows avoided, errands, …

A report is made where the recording holds events of its kind, whatever scene they came from.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from kumite.scene.recording import Event, Recording

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
    by_kind: dict[str, list[Event]] = defaultdict(list)
    for event in recording.events:
        by_kind[event.kind].append(event)
    made = (make(recording, by_kind) for make in _REPORTS)
    return tuple(report for report in made if report is not None and report.rows)


Events = Mapping[str, list[Event]]


def _of(events: Iterable[Event], name: str) -> list[Event]:
    return [e for e in events if e.character == name]


def _where(events: Iterable[Event], **data: Any) -> list[Event]:
    return [e for e in events if all(e.data.get(key) == value for key, value in data.items())]


def _catches(recording: Recording) -> bool:
    """Whether its scene is about catching someone."""
    bout = recording.settings.get("scene", {}).get("bout") or {}
    return bool(bout.get("catch"))


def _fight(recording: Recording, events: Events) -> Report | None:
    """Blows at each other or at a target, also where none was thrown. Those of people on errands
    have a report of their own.
    """
    could = recording.settings.get("aims_at") and not _catches(recording)
    if "launch" in events or not ("strike" in events or could):
        return None
    hits = events["hit"]
    reactions, run_over = events["reaction"], events["run over"]
    rows = {}
    for name in recording.names:
        mine, taken = _of(hits, name), _where(hits, victim=name)
        landed = [e for e in mine if not e.data.get("blocked")]
        rows[name] = {
            "thrown": len(_of(events["strike"], name)),
            "landed": len(landed),
            "blocked": len(mine) - len(landed),
            "taken": len([e for e in taken if not e.data.get("blocked")]),
            "fastest m/s": max(
                (round(float(e.data["speed"]), 2) for e in landed if "speed" in e.data),
                default=None,
            ),
        }
        if reactions or run_over:
            falls = len(_where(_of(reactions, name), size="fall"))
            rows[name]["knocked down"] = falls + len(_of(run_over, name))
    return Report("fight", rows)


def _throws(recording: Recording, events: Events) -> Report | None:
    """Balls, by the one they were thrown at. Avoided: they would have met it and it found a way
    out; by luck: it found none and yet was not met; wide: they would not have met it.
    """
    if "throw" not in events:
        return None
    ways_out = found_ways_out(events["avoidance"])
    ends = [e for kind in ("avoided", "missed", "struck") for e in events[kind]]
    end = {e.data["attack"]: e for e in ends if "attack" in e.data}  # not missed check points
    rows = {}
    for name in recording.names:
        thrown = [e.data["attack"] for e in _of(events["throw"], name)]
        if not thrown and not _of(events["struck"], name):
            continue
        kinds = [_end_of_throw(a, end.get(a), ways_out, name) for a in thrown]
        others = [e for e in _of(events["struck"], name) if e.data["attack"] not in thrown]
        rows[name] = {
            "thrown": len(thrown),
            **{kind: kinds.count(kind) for kind in ("avoided", "by luck", "wide", "struck")},
            "struck by another's": len(others),
            "in flight at the end": kinds.count("in flight"),
        }
    return Report("throws", rows)


def found_ways_out(events: Iterable[Event]) -> set[tuple[int, str]]:
    """Attacks, and who has found a way out of them."""
    found = _where(events, outcome=FOUND)
    return {(e.data["attack"], e.character) for e in found if e.kind == "avoidance"}


def _end_of_throw(attack: int, end: Event | None, ways_out: set[tuple[int, str]], name: str) -> str:
    if end is None:
        return "in flight"
    if end.kind == "struck":
        return "struck" if end.character == name else "wide"
    if end.kind == "missed":
        return "wide"
    return "avoided" if (attack, name) in ways_out else "by luck"


def _blows_avoided(recording: Recording, events: Events) -> Report | None:
    """Blows that were seen coming, by the one they came at: as balls; and what was struck back."""
    if "foreseen" not in events:
        return None
    gap = {e.data["attack"]: float(e.data["gap"]) for e in events["foreseen"]}
    ways_out = found_ways_out(events["avoidance"])
    rows = {}
    for name in recording.names:
        coming = {e.data["attack"] for e in _where(events["foreseen"], at=name)}
        if not coming:
            continue
        missed = [e.data["attack"] for e in _of(events["avoided"], name)]
        escaped = {a for a in missed if (a, name) in ways_out}
        lucky = [a for a in missed if a not in escaped and gap.get(a, np.inf) < 0.0]
        met = [e for e in _where(events["hit"], victim=name) if e.data.get("attack") in coming]
        rows[name] = {
            "blows": len(coming),
            "avoided": len(escaped),
            "by luck": len(lucky),
            "wide": len(missed) - len(escaped) - len(lucky),
            "struck": len(_where(met, blocked=False)),
            "blocked": len(_where(met, blocked=True)),
            "struck back": len(_of(events["counter"], name)),
            "landed": len(_where(_of(events["hit"], name), blocked=False)),
        }
    return Report("blows avoided", rows)


def _errands(recording: Recording, events: Events) -> Report | None:
    """What people on errands have begun and done, by character."""
    if "launch" not in events:
        return None
    rows = {}
    for name in recording.names:
        begun = _of(events["launch"], name)
        passed = _of(events["passed"], name)
        if not begun:
            continue
        rows[name] = {"begun": len(begun), "done": len(_of(events["done"], name))}
        if events["strike"]:
            rows[name]["blows"] = len(_of(events["strike"], name))
            rows[name]["met"] = len(_of(events["hit"], name))
        if events["passed"] or events["touched"]:
            rows[name]["passed"] = len(passed)
            rows[name]["touched"] = len(_of(events["touched"], name))
            clear = [round(float(e.data["clearance"]), 2) for e in passed]
            rows[name]["nearest m"] = min(clear, default=None)
    return Report("errands", rows)


def _launches(recording: Recording, events: Events) -> Report | None:
    """How well prepared motions were begun, by motion: level of preparation, 0 to 1, and how far
    the joints were from where the motion begins.
    """
    if "launch" not in events:
        return None
    by_motion: dict[str, list[Event]] = defaultdict(list)
    for event in events["launch"]:
        by_motion[event.data["motion"]].append(event)
    rows = {}
    for motion, found in sorted(by_motion.items()):
        level = [float(e.data["level"]) for e in found]
        apart = [float(e.data["apart_deg"]) for e in found]
        rows[motion] = {
            "launched": len(found),
            "level": round(float(np.mean(level)), 2),
            "lowest": round(min(level), 2),
            "apart deg": round(float(np.mean(apart)), 1),
        }
    return Report("launches", rows)


def _chase(recording: Recording, events: Events) -> Report | None:
    """Who was caught, and when. Also where nobody was, if the scene is about that."""
    if "caught" not in events and not _catches(recording):
        return None
    rows = {}
    for name in recording.names:
        mine, taken = _of(events["caught"], name), _where(events["caught"], victim=name)
        first = min((e.frame / recording.fps for e in [*mine, *taken]), default=None)
        rows[name] = {
            "caught": len(mine),
            "was caught": len(taken),
            "first at s": None if first is None else round(first, 2),
        }
    return Report("chase", rows)


def _check_points(recording: Recording, events: Events) -> Report | None:
    """Check points of paths and stories, by the one they are for."""
    missed = [e for e in events["missed"] if "point" in e.data]
    if "check point" not in events and not missed:
        return None
    rows = {}
    for name in recording.names:
        reached, late = _of(events["check point"], name), _of(missed, name)
        if not reached and not late:
            continue
        lateness = [float(e.data["late_by"]) for e in reached]
        off = [float(e.data["distance"]) for e in reached]
        # A point that was not reached when it was due may be reached later.
        open_still = {e.data["point"] for e in late} - {e.data["point"] for e in reached}
        rows[name] = {
            "reached": len(reached),
            "in time": sum(x <= LATE for x in lateness),
            "not reached": len(open_still),
            "latest s": round(max(lateness), 2) if reached else None,
            "mean distance m": round(float(np.mean(off)), 2) if reached else None,
        }
    return Report("check points", rows)


def _game_tree(recording: Recording, events: Events) -> Report | None:
    """How far those who fight by game tree have looked ahead."""
    decisions = [e for e in events["decision"] if "nodes" in e.data]
    if not decisions:
        return None
    rows = {}
    for name in recording.names:
        mine = _of(decisions, name)
        if mine:
            rows[name] = {
                "decisions": len(mine),
                "nodes": sum(int(e.data["nodes"]) for e in mine),
                "pruned %": round(100 * float(np.mean([e.data["pruned"] for e in mine])), 1),
            }
    return Report("game tree", rows)


_REPORTS: tuple[Callable[[Recording, Events], Report | None], ...] = (
    _fight,
    _throws,
    _blows_avoided,
    _errands,
    _launches,
    _chase,
    _check_points,
    _game_tree,
)
