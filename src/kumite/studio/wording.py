"""What happened, as a line to read and a score to keep."""

from __future__ import annotations

import html
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from kumite.body import main_colours, mix
from kumite.scene.dodge import DodgeScene
from kumite.scene.prepare import PrepareScene
from kumite.scene.recording import Event
from kumite.scene.stage import Playback, Stage
from kumite.scene.walkers import OFF

LINES = 12  # events on the panel
GREY = "#9aa0aa"  # of whoever has no colour
LANDED = frozenset({"hit", "struck"})  # kinds that are seen where they land
QUIET_KINDS = frozenset({"decision"})  # several a second: shown only when asked for
MARKS = {
    "strike": "○",
    "hit": "●",
    "dodge": "↷",
    "reaction": "↯",
    "decision": "·",
    "throw": "○",
    "avoidance": "◌",
    "avoided": "↷",
    "missed": "·",
    "struck": "●",
    "stale": "×",
    "launch": "▸",
    "done": "✓",
    "passed": "↷",
    "touched": "×",
    "moved goal": "→",
}
SAID = {
    "found": "avoids it",
    "wide": "lets it pass",
    "early": "has time yet",
    "hit": "no way out",
    "no candidate": "no way out in time",
    "too late": "sees it too late",
}  # what a search came to
CANDIDATES = ("hit", "culled", "stiff", "too_fast", "too_long")  # what became of those not taken


def _words(value: Any) -> str:
    return str(value).replace("_", " ")


def _number(value: Any) -> str:
    return f"{value:.2f}" if isinstance(value, float) else _words(value)


def _first(data: Mapping[str, Any], *names: str) -> Any:
    return next((data[n] for n in names if data.get(n) is not None), None)


def struck(event: Event) -> str | None:
    """The character or object that a hit landed on."""
    if event.kind == "struck":
        return event.character
    whom = _first(event.data, "target", "victim", "on", "opponent", "object")
    return None if whom is None else str(whom)


def place(event: Event) -> list[float] | None:
    """Where a hit landed [3] m, if the event says so."""
    point = _first(event.data, "place", "position", "point", "at")
    if not isinstance(point, Sequence) or isinstance(point, str) or len(point) != 3:
        return None
    return [float(x) for x in point]


def describe(event: Event) -> str:
    """What was done, without who and when: ``left hand → Blue's head, 6.2 m/s``."""
    data = event.data
    limb, part = _first(data, "limb"), _first(data, "part", "struck")
    speed, whom = _first(data, "speed"), struck(event)
    if event.kind in ("strike", "hit"):
        said = _words(limb) if limb is not None else event.kind
        if whom is not None and part is not None and str(part) != whom:
            said += f" → {whom}'s {_words(part)}"
        elif whom is not None or part is not None:
            said += f" → {_words(part if whom is None else whom)}"
        if isinstance(speed, int | float):
            said += f", {speed:.1f} m/s"
        if data.get("blocked"):
            said += ", blocked"
        return said
    if event.kind in TOLD:
        return TOLD[event.kind](data)
    rest = [
        _number(v) if k in ("action", "label", "name", "kind") else f"{_words(k)} {_number(v)}"
        for k, v in data.items()
        if isinstance(v, str | int | float) and not isinstance(v, bool)
    ]
    return ", ".join(rest[:4])


def _thrown(data: Mapping[str, Any]) -> str:
    said = f"ball {data.get('attack', '')} is thrown"
    return said + (f", {data['speed']:.1f} m/s" if "speed" in data else "")


def _avoided(data: Mapping[str, Any]) -> str:
    return f"ball {data.get('attack', '')} is avoided"


def _missed(data: Mapping[str, Any]) -> str:
    return f"ball {data.get('attack', '')} comes near nobody"


def _struck(data: Mapping[str, Any]) -> str:
    said = f"ball {data.get('attack', '')} → {_words(data.get('part', 'body'))}"
    said += f", {data['speed']:.1f} m/s" if "speed" in data else ""
    return said + (", meant for another" if data.get("meant") is False else "")


def _stale(data: Mapping[str, Any]) -> str:
    count = data.get("dropped", 0)
    return f"ball {data.get('attack', '')}: {count} {'path' if count == 1 else 'paths'} too late"


def _searched(data: Mapping[str, Any]) -> str:
    """What a search came to: how many candidates, at what cost, how far away."""
    outcome, count = data.get("outcome"), data.get("candidates")
    said = f"ball {data.get('attack', '')}: {SAID.get(str(outcome), _words(outcome))}"
    if "aim" in data:
        said += f", in {data['aim']:.2f} s"
    if outcome != "found":
        became = [f"{data[n]} {_words(n)}" for n in CANDIDATES if data.get(n)]
        return said + (f"; of {count} candidates {', '.join(became)}" if became else "")
    where = "from the index" if data.get("indexed") else "searched"
    said += f"; {data.get('valid', 0)} of {count} candidates, {where}"
    if len(data.get("costs", ())) == 3:
        parts = zip(("avoidance", "body", "timescale"), data["costs"])
        said += f"; cost {data.get('cost', 0.0):.2f}: "
        said += ", ".join(f"{name} {cost:.2f}" for name, cost in parts)
    return said + (f"; {100 * data['distance']:.0f} cm away" if "distance" in data else "")


DODGING = {
    "throw": _thrown,
    "avoidance": _searched,
    "avoided": _avoided,
    "missed": _missed,
    "struck": _struck,
    "stale": _stale,
}
"""How what happens to those at whom balls are thrown is said."""


def _launched(data: Mapping[str, Any]) -> str:
    """How well prepared a motion was begun, how soon it meets something, and how far it is bent."""
    said = _words(data.get("motion", "motion"))
    if "level" in data:
        said += f", prepared to {data['level']:.2f}"
    if "apart_deg" in data:
        said += f", {data['apart_deg']:.1f}° from its posture"
    if "to_contact" in data:
        said += f"; contact in {data['to_contact']:.2f} s"
    if (off := data.get("bent")) is not None:
        said += f", bent by {100 * off:.0f} cm" if off <= OFF else f", {off:.1f} m off: not bent"
    return said


def _done(data: Mapping[str, Any]) -> str:
    return f"{_words(data.get('motion', 'motion'))} is done"


def _passed(data: Mapping[str, Any]) -> str:
    clearance = 100 * float(data.get("clearance", 0.0))
    how = f"{clearance:.0f} cm clear" if clearance >= 0 else f"{-clearance:.0f} cm too near"
    return f"{_words(data.get('thing', 'obstacle'))} is passed, {how}"


def _touched(data: Mapping[str, Any]) -> str:
    return f"{_words(data.get('part', 'body'))} touches {_words(data.get('thing', 'obstacle'))}"


def _moved(data: Mapping[str, Any]) -> str:
    return f"cannot stand in {_words(data.get('thing', 'an obstacle'))}: goes beside it"


PREPARING = {
    "launch": _launched,
    "done": _done,
    "passed": _passed,
    "touched": _touched,
    "moved goal": _moved,
}
"""How what happens to those who prepare is said."""

TOLD = {**DODGING, **PREPARING}


def is_preparing(stage: Stage) -> bool:
    """Whether those on a stage prepare for what they do: in a recording, whether one did."""
    if isinstance(stage, Playback):
        return any(e.kind == "launch" for e in stage.recording.events)
    return isinstance(stage, PrepareScene)


def is_dodging(stage: Stage) -> bool:
    """Whether balls are thrown at those on a stage: in a recording, whether one was."""
    if isinstance(stage, Playback):
        return any(e.kind == "throw" for e in stage.recording.events)
    return isinstance(stage, DodgeScene)


class EventLog:
    """The stage's events as the panel shows them: new ones once, scores, the last few lines.

    dodging: what counts is how many balls were thrown at whom, and how many struck. preparing: how
    many motions were done, what they hit and what was touched.
    """

    def __init__(
        self, names: Sequence[str], *, dodging: bool = False, preparing: bool = False
    ) -> None:
        self.names, self.dodging, self.preparing = tuple(names), dodging, preparing
        light = [mix(colour, (255, 255, 255), 0.35) for colour in main_colours(self.names)]
        self.colours = {n: "#{:02x}{:02x}{:02x}".format(*c) for n, c in zip(self.names, light)}
        self.show_quiet = False
        self.rewind()

    def rewind(self) -> None:
        """Forget everything: the stage starts again or jumps."""
        self._seen = 0
        self._frame = -1
        self._loud: deque[Event] = deque(maxlen=LINES)
        self._all: deque[Event] = deque(maxlen=LINES)
        self.thrown = dict.fromkeys(self.names, 0)
        self.landed = dict.fromkeys(self.names, 0)
        self.avoided = dict.fromkeys(self.names, 0)
        self.struck = dict.fromkeys(self.names, 0)
        self.done = dict.fromkeys(self.names, 0)
        self.touched = dict.fromkeys(self.names, 0)

    def update(self, events: Sequence[Event], frame: int) -> list[Event]:
        """Take in what is new, and return it; nothing is returned after a jump backwards."""
        jumped = len(events) < self._seen or frame < self._frame
        if jumped:
            self.rewind()
        fresh = list(events[self._seen :])
        self._take(fresh)
        self._seen, self._frame = len(events), frame
        return [] if jumped else fresh

    def _take(self, fresh: Iterable[Event]) -> None:
        for event in fresh:
            self._all.append(event)
            if event.kind not in QUIET_KINDS:
                self._loud.append(event)
            if event.character not in self.thrown:
                continue
            if event.kind in ("strike", "throw"):
                self.thrown[event.character] += 1
            elif event.kind == "hit" and not event.data.get("blocked"):
                self.landed[event.character] += 1
            elif event.kind in ("avoided", "struck"):
                counts = self.avoided if event.kind == "avoided" else self.struck
                counts[event.character] += 1
            elif event.kind in ("done", "touched"):
                counts = self.done if event.kind == "done" else self.touched
                counts[event.character] += 1

    @property
    def lines(self) -> list[Event]:
        """The last events to show, newest first."""
        return list(self._all if self.show_quiet else self._loud)[::-1]


def score_html(log: EventLog, most: int = 8) -> str:
    """Strikes and hits of every character, or balls thrown at each, avoided and not; the busiest
    ``most`` of a crowd, and the sum over all at whom balls are thrown.
    """
    columns = {"strikes": log.thrown, "hits": log.landed}
    if log.dodging:
        columns = {"thrown": log.thrown, "avoided": log.avoided, "struck": log.struck}
    if log.preparing:
        columns = {"done": log.done, "hits": log.landed, "touched": log.touched}
    key = log.thrown if log.dodging else log.landed
    order = sorted(log.names, key=lambda n: -key[n]) if len(log.names) > most else log.names
    rows = "".join(
        _score_row(n, log.colours.get(n, GREY), [c[n] for c in columns.values()])
        for n in order[:most]
    )
    if log.dodging and len(log.names) > 1:
        rows += _score_row("all", "inherit", [sum(c.values()) for c in columns.values()])
    heads = "".join(f'<td style="text-align:right">{name}</td>' for name in columns)
    more = f'<div style="opacity:.6">and {len(log.names) - most} more</div>' * (len(order) > most)
    return (
        '<div style="padding:0 1em .4em;font-size:.85em"><table style="width:100%">'
        f'<tr style="opacity:.6"><td></td>{heads}</tr>{rows}</table>{more}</div>'
    )


def _score_row(name: str, colour: str, counts: Sequence[int]) -> str:
    """A name and its counts, the last of which matters most."""
    cells = "".join(
        f'<td style="text-align:right;font-weight:{700 if k == len(counts) - 1 else 400}">{n}</td>'
        for k, n in enumerate(counts)
    )
    return f'<tr><td style="color:{colour};font-weight:600">{html.escape(name)}</td>{cells}</tr>'


def _line_html(event: Event, fps: float, colours: Mapping[str, str], faded: float) -> str:
    said = describe(event)
    if event.kind not in ("strike", "hit", *TOLD):
        said = f"{_words(event.kind)}: {said}" if said else _words(event.kind)
    weight = 600 if event.kind in LANDED and not event.data.get("blocked") else 400
    cell = "white-space:nowrap;vertical-align:top;padding-right:.5em"
    return (
        f'<tr style="opacity:{1 - faded:.2f}">'
        f'<td style="opacity:.6;{cell}">{event.frame / fps:.1f}</td>'
        f'<td style="color:{colours.get(event.character, GREY)};{cell}">'
        f"{MARKS.get(event.kind, '▪')} {html.escape(event.character)}</td>"
        f'<td style="font-weight:{weight}">{html.escape(said)}</td></tr>'
    )


def lines_html(log: EventLog, fps: float) -> str:
    """The last events, newest first: when, who, what."""
    rows = "".join(
        _line_html(event, fps, log.colours, min(0.05 * i, 0.5)) for i, event in enumerate(log.lines)
    )
    return (
        '<div style="padding:0 1em .6em;font-size:.8em;line-height:1.35;min-height:16em">'
        f"<table>{rows or '<tr><td>nothing yet</td></tr>'}</table></div>"
    )
