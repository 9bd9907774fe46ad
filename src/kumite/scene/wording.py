"""Events in words: what the studio's log says, and captions of pictures."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from kumite.control.avoidance import Outcome
from kumite.scene.events import (
    Attacked,
    Avoided,
    Caught,
    CheckPointMissed,
    CheckPointReached,
    Counter,
    Cue,
    Decision,
    Done,
    Event,
    Foreseen,
    Hit,
    Launch,
    Missed,
    MovedGoal,
    Passed,
    Reaction,
    RunOver,
    Searched,
    Stale,
    Strike,
    Struck,
    Throw,
    Touched,
)
from kumite.scene.walkers import OFF

SAID = {
    Outcome.FOUND: "avoids it",
    Outcome.WIDE: "lets it pass",
    Outcome.EARLY: "has time yet",
    Outcome.HIT: "no way out",
    Outcome.NO_CANDIDATE: "no way out in time",
    Outcome.LATE: "sees it too late",
}  # what a search came to
CANDIDATES = ("hit", "culled", "stiff", "too_fast", "too_long")  # what became of those not taken


def _words(value: object) -> str:
    return str(value).replace("_", " ")


def describe(event: Event) -> str:
    """What was done, without who and when: ``left hand → Blue's head, 6.2 m/s``."""
    return SAYS[type(event)](event)


def _strike(e: Strike) -> str:
    return _words(e.limb) + ("" if e.speed is None else f", {e.speed:.1f} m/s")


def _hit(e: Hit) -> str:
    whom = e.victim if e.part == e.victim else f"{e.victim}'s {_words(e.part)}"
    said = f"{_words(e.limb)} → {whom}, {e.speed:.1f} m/s"
    return said + (", blocked" if e.blocked else "")


def _reaction(e: Reaction) -> str:
    return f"reaction: {e.size}, {_words(e.action)}, {e.impulse:.0f} N s"


def _run_over(e: RunOver) -> str:
    return f"run over by the {_words(e.vehicle)}, {e.speed:.1f} m/s"


def _decision(e: Decision) -> str:
    said = f"decision of {e.by}: {_words(e.action) or f'stretch {e.stretch}'}"
    if e.nodes is not None:
        said += f", {e.nodes} of {e.considered} nodes"
    elif e.considered is not None:
        said += f", of {e.considered}"
    said += "" if e.level is None else f", level {e.level:.2f}"
    return said + (f", {e.flaws}" if e.flaws else "")


def _source(e: Attacked) -> str:
    """What an attack is called: ``ball 3``, ``red's blow``."""
    if e.attacker is not None:
        return f"{e.attacker}'s blow"
    return f"attack {e.attack}" if e.ball is None else f"ball {e.attack}"


def _thrown(e: Throw) -> str:
    return f"ball {e.attack} is thrown, {e.speed:.1f} m/s"


def _foreseen(e: Foreseen) -> str:
    how = "would land" if e.gap < 0.0 else f"would pass at {100 * e.gap:.0f} cm"
    return f"{_words(e.limb)} is coming at {e.victim}, {how}"


def _avoided(e: Avoided) -> str:
    return f"{_source(e)} is avoided"


def _missed(e: Missed) -> str:
    return f"{_source(e)} comes near nobody"


def _struck(e: Struck) -> str:
    said = f"{_source(e)} → {_words(e.part)}, {e.speed:.1f} m/s"
    return said + ("" if e.meant else ", meant for another")


def _stale(e: Stale) -> str:
    return f"{_source(e)}: {e.paths} {'path' if e.paths == 1 else 'paths'} too late"


def _searched(e: Searched) -> str:
    """What a search came to: how many candidates, at what cost, how far away."""
    said = f"{_source(e)}: {SAID[e.outcome]}"
    if e.aim is not None:
        said += f", in {e.aim:.2f} s"
    if e.outcome != Outcome.FOUND:
        became = [f"{n} {_words(name)}" for name in CANDIDATES if (n := getattr(e, name))]
        return said + (f"; of {e.candidates} candidates {', '.join(became)}" if became else "")
    where = "from the index" if e.indexed else "searched"
    said += f"; {e.valid} of {e.candidates} candidates, {where}"
    if e.cost is not None:
        parts = zip(("avoidance", "body", "timescale"), e.costs)
        said += f"; cost {e.cost:.2f}: "
        said += ", ".join(f"{name} {cost:.2f}" for name, cost in parts)
    return said + ("" if e.distance is None else f"; {100 * e.distance:.0f} cm away")


def _counter(e: Counter) -> str:
    return f"strikes back: {_words(e.limb)} at {e.victim}, in {e.seconds:.2f} s"


def _launched(e: Launch) -> str:
    """How well prepared a motion was begun, how soon it meets something, and how far it is bent."""
    said = f"{_words(e.motion)}, prepared to {e.level:.2f}, {e.apart_deg:.1f}° from its posture"
    said += f"; contact in {e.to_contact:.2f} s"
    if e.bent is None:
        return said
    how = f"bent by {100 * e.bent:.0f} cm" if e.bent <= OFF else f"{e.bent:.1f} m off: not bent"
    return f"{said}, {how}"


def _done(e: Done) -> str:
    return f"{_words(e.motion)} is done"


def _passed(e: Passed) -> str:
    clearance = 100 * e.clearance
    how = f"{clearance:.0f} cm clear" if clearance >= 0 else f"{-clearance:.0f} cm too near"
    return f"{_words(e.thing)} is passed, {how}"


def _touched(e: Touched) -> str:
    return f"{_words(e.part)} touches {_words(e.thing)}"


def _moved(e: MovedGoal) -> str:
    return f"cannot stand in {_words(e.thing)}: goes beside it"


def _cue(e: Cue) -> str:
    style = e.style if e.style is None or isinstance(e.style, str) else "of its own"
    said = [
        *([] if e.against is None else [f"against {e.against}"]),
        *([] if style is None else [f"style {_words(style)}"]),
        *([] if e.depth is None else [f"depth {e.depth}"]),
    ]
    for name, actions in (("wanted", e.wanted), ("unwanted", e.unwanted), ("only", e.only)):
        if actions is not None:
            said.append(f"{name} {_words(' '.join(actions)) or 'nothing'}")
    return f"cue: {', '.join(said) or 'a new route'}"


def _caught(e: Caught) -> str:
    return f"caught {e.victim}, {100 * e.distance:.0f} cm away"


def _reached(e: CheckPointReached) -> str:
    late = f", {e.late_by:.1f} s late" if e.late_by > 0.0 else ""
    return f"check point {e.point + 1} is reached{late}"


def _not_reached(e: CheckPointMissed) -> str:
    return f"check point {e.point + 1} is due, {e.distance:.1f} m away at the nearest"


SAYS: dict[type[Event], Callable[[Any], str]] = {
    Strike: _strike,
    Hit: _hit,
    Reaction: _reaction,
    RunOver: _run_over,
    Decision: _decision,
    Throw: _thrown,
    Foreseen: _foreseen,
    Searched: _searched,
    Stale: _stale,
    Avoided: _avoided,
    Missed: _missed,
    Struck: _struck,
    Counter: _counter,
    Launch: _launched,
    Done: _done,
    Passed: _passed,
    Touched: _touched,
    MovedGoal: _moved,
    Cue: _cue,
    Caught: _caught,
    CheckPointReached: _reached,
    CheckPointMissed: _not_reached,
}
"""How an event of each kind is said."""
