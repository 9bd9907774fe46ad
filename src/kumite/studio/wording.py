"""What happened, as a line to read and a score to keep."""

from __future__ import annotations

import html
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from kumite.scene.recording import Event
from kumite.studio import palette

LINES = 12  # events on the panel
QUIET_KINDS = frozenset({"decision"})  # several a second: shown only when asked for
MARKS = {"strike": "○", "hit": "●", "dodge": "↷", "reaction": "↯", "decision": "·"}


def _words(value: Any) -> str:
    return str(value).replace("_", " ")


def _number(value: Any) -> str:
    return f"{value:.2f}" if isinstance(value, float) else _words(value)


def _first(data: Mapping[str, Any], *names: str) -> Any:
    return next((data[n] for n in names if data.get(n) is not None), None)


def struck(event: Event) -> str | None:
    """The character or object that a hit landed on."""
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
    rest = [
        _number(v) if k in ("action", "label", "name", "kind") else f"{_words(k)} {_number(v)}"
        for k, v in data.items()
        if isinstance(v, str | int | float) and not isinstance(v, bool)
    ]
    return ", ".join(rest[:4])


class EventLog:
    """The stage's events as the panel shows them: new ones once, scores, the last few lines."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
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
            if event.kind == "strike" and event.character in self.thrown:
                self.thrown[event.character] += 1
            landed = event.kind == "hit" and not event.data.get("blocked")
            if landed and event.character in self.landed:
                self.landed[event.character] += 1

    @property
    def lines(self) -> list[Event]:
        """The last events to show, newest first."""
        return list(self._all if self.show_quiet else self._loud)[::-1]


def _colour_of(name: str, names: Sequence[str]) -> str:
    if name not in names:
        return "#9aa0aa"
    return palette.css(palette.mix(palette.corner(names.index(name)), (255, 255, 255), 0.35))


def score_html(log: EventLog, most: int = 8) -> str:
    """Strikes and hits of every character; the busiest ``most`` of a crowd."""
    order = sorted(log.names, key=lambda n: -log.landed[n]) if len(log.names) > most else log.names
    rows = "".join(
        f'<tr><td style="color:{_colour_of(n, log.names)};font-weight:600">{html.escape(n)}</td>'
        f'<td style="text-align:right">{log.thrown[n]}</td>'
        f'<td style="text-align:right;font-weight:700">{log.landed[n]}</td></tr>'
        for n in order[:most]
    )
    more = f'<div style="opacity:.6">and {len(log.names) - most} more</div>' * (len(order) > most)
    return (
        '<div style="padding:0 1em .4em;font-size:.85em"><table style="width:100%">'
        '<tr style="opacity:.6"><td></td><td style="text-align:right">strikes</td>'
        f'<td style="text-align:right">hits</td></tr>{rows}</table>{more}</div>'
    )


def _line_html(event: Event, fps: float, names: Sequence[str], faded: float) -> str:
    said = describe(event)
    if event.kind not in ("strike", "hit"):
        said = f"{_words(event.kind)}: {said}" if said else _words(event.kind)
    weight = 600 if event.kind == "hit" and not event.data.get("blocked") else 400
    cell = "white-space:nowrap;vertical-align:top;padding-right:.5em"
    return (
        f'<tr style="opacity:{1 - faded:.2f}">'
        f'<td style="opacity:.6;{cell}">{event.frame / fps:.1f}</td>'
        f'<td style="color:{_colour_of(event.character, names)};{cell}">'
        f"{MARKS.get(event.kind, '▪')} {html.escape(event.character)}</td>"
        f'<td style="font-weight:{weight}">{html.escape(said)}</td></tr>'
    )


def lines_html(log: EventLog, fps: float) -> str:
    """The last events, newest first: when, who, what."""
    rows = "".join(
        _line_html(event, fps, log.names, min(0.05 * i, 0.5)) for i, event in enumerate(log.lines)
    )
    return (
        '<div style="padding:0 1em .6em;font-size:.8em;line-height:1.35;min-height:16em">'
        f"<table>{rows or '<tr><td>nothing yet</td></tr>'}</table></div>"
    )
