"""What happened, as a line to read and a score to keep."""

from __future__ import annotations

import html
from collections import deque
from collections.abc import Iterable, Mapping, Sequence

from kumite.body import main_colours, mix
from kumite.scene.events import (
    Avoided,
    Decision,
    Done,
    Event,
    Hit,
    Launch,
    Missed,
    MovedGoal,
    Passed,
    Reaction,
    Searched,
    Stale,
    Strike,
    Struck,
    Throw,
    Touched,
)
from kumite.scene.wording import describe

LINES = 12  # events on the panel
GREY = "#9aa0aa"  # of whoever has no colour
QUIET = (Decision,)  # several a second: shown only when asked for
MARKS: dict[type[Event], str] = {
    Strike: "○",
    Hit: "●",
    Reaction: "↯",
    Decision: "·",
    Throw: "○",
    Searched: "◌",
    Avoided: "↷",
    Missed: "·",
    Struck: "●",
    Stale: "×",
    Launch: "▸",
    Done: "✓",
    Passed: "↷",
    Touched: "×",
    MovedGoal: "→",
}


def struck(event: Hit | Struck) -> str:
    """The character or thing that a blow or a ball lands on."""
    return event.character if isinstance(event, Struck) else event.victim


class EventLog:
    """The stage's events as a panel shows them: new ones once, scores, the last few lines.

    counts: what a score is kept of: blows thrown and landed, balls thrown at each and whether they
    struck, errands done and what was touched.
    """

    def __init__(self, names: Sequence[str], counts: Sequence[str] = ("blows",)) -> None:
        self.names, self.counts = tuple(names), tuple(counts)
        light = [mix(colour, (255, 255, 255), 0.35) for colour in main_colours(self.names)]
        self.colours = {n: "#{:02x}{:02x}{:02x}".format(*c) for n, c in zip(self.names, light)}
        self.rewind()

    def rewind(self) -> None:
        """Forget everything: the stage starts again or jumps."""
        self._seen = 0
        self._frame = -1
        self._loud: deque[Event] = deque(maxlen=LINES)
        self._all: deque[Event] = deque(maxlen=LINES)
        self.strikes = dict.fromkeys(self.names, 0)
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
            if not isinstance(event, QUIET):
                self._loud.append(event)
            if event.character in self.thrown:
                self._count(event)

    def _count(self, event: Event) -> None:
        match event:
            case Strike():
                counts = self.strikes
            case Throw():
                counts = self.thrown
            case Hit(blocked=False):
                counts = self.landed
            case Avoided():
                counts = self.avoided
            case Struck():
                counts = self.struck
            case Done():
                counts = self.done
            case Touched():
                counts = self.touched
            case _:
                return
        counts[event.character] += 1

    def lines(self, quiet: bool = False) -> list[Event]:
        """The last events to show, newest first. quiet: decisions, too."""
        return list(self._all if quiet else self._loud)[::-1]

    @property
    def columns(self) -> dict[str, dict[str, int]]:
        """What is counted of each, in order."""
        out: dict[str, dict[str, int]] = {}
        if "blows" in self.counts:
            out |= {"strikes": self.strikes, "hits": self.landed}
        if "balls" in self.counts:
            out |= {"thrown": self.thrown, "avoided": self.avoided, "struck": self.struck}
        if "errands" in self.counts:
            out |= {"done": self.done, "hits": self.landed, "touched": self.touched}
        return out


def score_html(log: EventLog, most: int = 8) -> str:
    """Strikes and hits of every character, or balls thrown at each, avoided and not; the busiest
    ``most`` of a crowd, and the sum over all at whom balls are thrown.
    """
    columns, balls = log.columns, log.counts == ("balls",)
    key = log.thrown if balls else log.landed
    order = sorted(log.names, key=lambda n: -key[n]) if len(log.names) > most else log.names
    rows = "".join(
        _score_row(n, log.colours.get(n, GREY), [c[n] for c in columns.values()])
        for n in order[:most]
    )
    if balls and len(log.names) > 1:
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
    landed = isinstance(event, Struck) or (isinstance(event, Hit) and not event.blocked)
    weight = 600 if landed else 400
    cell = "white-space:nowrap;vertical-align:top;padding-right:.5em"
    return (
        f'<tr style="opacity:{1 - faded:.2f}">'
        f'<td style="opacity:.6;{cell}">{event.frame / fps:.1f}</td>'
        f'<td style="color:{colours.get(event.character, GREY)};{cell}">'
        f"{MARKS.get(type(event), '▪')} {html.escape(event.character)}</td>"
        f'<td style="font-weight:{weight}">{html.escape(describe(event))}</td></tr>'
    )


def lines_html(log: EventLog, fps: float, quiet: bool = False) -> str:
    """The last events, newest first: when, who, what. quiet: decisions, too."""
    rows = "".join(
        _line_html(event, fps, log.colours, min(0.05 * i, 0.5))
        for i, event in enumerate(log.lines(quiet))
    )
    return (
        '<div style="padding:0 1em .6em;font-size:.8em;line-height:1.35;min-height:16em">'
        f"<table>{rows or '<tr><td>nothing yet</td></tr>'}</table></div>"
    )
