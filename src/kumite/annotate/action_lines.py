"""Lines of the text file of actions (:mod:`kumite.annotate.action_file`), read word by word."""

from __future__ import annotations

import json
import re
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from kumite.annotate.vocabulary import DIRECTIONS_OF, KINDS
from kumite.clip import LIMBS
from kumite.errors import KumiteError, at, unknown
from kumite.mocap import text

NONE = "-"  # no limb, no label
HEADING = "=="
AVOID = "avoid="
MARK = "mark="
CYCLE = "cycle"
OURS = "#:"  # begins a comment of ours, which is written anew each time
_WORD = re.compile(r'\s*("(?:[^"\\]|\\.)*"|#.*|[^\s#"][^\s"]*)')
_MOST = 10**9  # frames: a number beyond it is no frame


@dataclass(frozen=True)
class Line:
    """One action as it stands in a file, in frames of its clip."""

    clip: str
    start: int
    stop: int
    kind: str
    limb: str  # or NONE
    direction: str
    label: str
    by_hand: bool = False
    comment: str = ""  # behind it, with its #
    number: int | None = None  # line in the file it was read from
    avoid: tuple[tuple[int, int], ...] = ()  # (start, stop) of its avoidance parts, in order
    mark: int | None = None  # first frame of what it is about: the action is a target motion
    cycle: bool = False  # the action is a cycle of locomotion

    @property
    def words(self) -> tuple[str, ...]:
        return (
            quoted(self.clip),
            str(self.start),
            str(self.stop),
            self.kind,
            self.limb,
            quoted(self.direction),
            quoted(self.label or NONE),
            *(f"{AVOID}{a}-{b}" for a, b in self.avoid),
            *([] if self.mark is None else [f"{MARK}{self.mark}"]),
            *([CYCLE] if self.cycle else []),
        )

    @property
    def check(self) -> str:
        return f"{zlib.crc32(' '.join(self.words).encode()) & 0xFFFFFF:06x}"


@dataclass(frozen=True)
class Section:
    """What a file says of one clip."""

    lines: tuple[Line, ...]  # in order of their starts
    frames: int | None = None  # that the heading gives; None without a heading
    fps: float | None = None
    comments: tuple[tuple[int, str], ...] = ()  # (start of the line after it, comment)
    number: int | None = None  # of the heading


@dataclass(frozen=True)
class ActionFile:
    """A file of actions: a section a clip, and comments that stand before all of them."""

    sections: Mapping[str, Section]
    comments: tuple[str, ...] = ()


# Reading -----------------------------------------------------------------------------------------


def parse(path: Path | str) -> ActionFile:
    """What a file holds, checked word by word. Errors: the first that is wrong, with its line."""
    path = Path(path)
    sections: dict[str, Section] = {}
    lines: dict[str, list[Line]] = {}
    waiting: list[str] = []
    head: list[str] = []
    current: str | None = None
    comments: dict[str, list[tuple[int, str]]] = {}
    source = text.decode(path, text.read_bytes(path))
    for number, row in enumerate(source.split("\n"), 1):
        words, comment = _split(path, number, row)
        if not words:
            if comment and not comment.startswith(OURS):
                waiting.append(comment)
            continue
        if words[0] == HEADING:
            _end_comments(waiting, current, head, comments)
            current, section = _heading(path, number, words)
            if current in sections:
                raise at(path, number, f"a second heading of clip {current!r}; expected one")
            sections[current] = section
            continue
        line = _line(path, number, words, comment)
        place = comments.setdefault(line.clip, []) if current is not None or lines else None
        for c in waiting:
            if place is None:
                head.append(c)
            else:
                place.append((line.start, c))
        waiting.clear()
        lines.setdefault(line.clip, []).append(line)
    _end_comments(waiting, current, head, comments)
    for name in (*lines, *comments):
        sections.setdefault(name, Section(()))
    for name, section in sections.items():
        mine = sorted(lines.get(name, ()), key=lambda x: (x.start, x.stop))
        sections[name] = replace(section, lines=tuple(mine), comments=tuple(comments.get(name, ())))
    return ActionFile(sections, tuple(head))


def _end_comments(
    waiting: list[str],
    current: str | None,
    head: list[str],
    comments: dict[str, list[tuple[int, str]]],
) -> None:
    """Comments with no line after them belong to the end of the section they stand in."""
    for comment in waiting:
        if current is None:
            head.append(comment)
        else:
            comments.setdefault(current, []).append((_MOST, comment))
    waiting.clear()


def _split(path: Path, number: int, row: str) -> tuple[list[str], str]:
    """The words of a row and the comment behind them."""
    words: list[str] = []
    i, row = 0, row.rstrip()
    while i < len(row):
        match = _WORD.match(row, i)
        if match is None:
            raise at(
                path, number, f"{text.shown(row[i:].strip())} has no closing quote; expected one"
            )
        word = match[1]
        if word.startswith("#"):
            return words, word
        if word.startswith('"'):
            try:
                word = json.loads(word)
            except ValueError:
                raise at(
                    path, number, f"{text.shown(word)} is no quoted word; expected one as in JSON"
                ) from None
        words.append(word)
        i = match.end()
    return words, ""


def _heading(path: Path, number: int, words: list[str]) -> tuple[str, Section]:
    if len(words) != 7 or words[3] != "frames" or words[5:] != ["a", "second"]:
        shape = f"{HEADING} CLIP N frames RATE a second"
        raise at(path, number, f"{text.shown(' '.join(words))}; expected {shape}")
    frames = _frame(path, number, words[2], "the clip's number of frames")
    fps = text.number(path, number, words[4], "the clip's frames a second")
    if frames == 0 or fps <= 0:
        raise at(path, number, "a clip without frames; expected numbers more than 0")
    return words[1], Section((), frames, fps, (), number)


def _line(path: Path, number: int, words: list[str], comment: str) -> Line:
    more = [word for word in words[7:] if word.startswith((AVOID, MARK)) or word == CYCLE]
    words = [*words[:7], *(word for word in words[7:] if word not in more)]
    if len(words) not in (7, 8):
        shape = (
            f"clip start stop kind limb direction label, perhaps {AVOID}START-STOP, "
            f"{MARK}FRAME or {CYCLE}, and perhaps a check word"
        )
        raise at(
            path, number, f"{len(words)} words; expected {shape} (labels with spaces in quotes)"
        )
    clip, first, last, kind, limb, direction, label = words[:7]
    start = _frame(path, number, first, "the frame at which the action starts")
    stop = _frame(path, number, last, "the frame at which the action stops")
    try:
        if kind not in KINDS:
            raise unknown("kind", kind, KINDS)
        if limb != NONE and limb not in LIMBS:
            raise unknown("limb", limb, (*LIMBS, NONE))
        if direction not in DIRECTIONS_OF[kind]:
            raise unknown(f"direction of {kind}", direction, DIRECTIONS_OF[kind])
    except KumiteError as error:
        raise at(path, number, str(error)) from None
    if stop <= start:
        raise at(path, number, f"stop {stop} is not after start {start}; expected a later frame")
    label = "" if label == NONE else label
    avoid = [word for word in more if word.startswith(AVOID)]
    parts = tuple(sorted(_part(path, number, word, start, stop) for word in avoid))
    mark = _mark(path, number, [word for word in more if word.startswith(MARK)], start, stop)
    cycle = CYCLE in more
    if cycle and mark is not None:
        raise at(
            path, number, f"{MARK}{mark} and {CYCLE}; expected one: a target motion is no cycle"
        )
    line = Line(
        clip, start, stop, kind, limb, direction, label, True, comment, number, parts, mark, cycle
    )
    untouched = len(words) == 8 and words[7] == line.check and not comment
    return replace(line, by_hand=not untouched)


def _part(path: Path, number: int, word: str, start: int, stop: int) -> tuple[int, int]:
    """An avoidance part of the action from start to stop."""
    match = re.fullmatch(r"(\d{1,9})-(\d{1,9})", word.removeprefix(AVOID), re.ASCII)
    if match is None:
        raise at(
            path, number, f"{text.shown(word)} is no part; expected {AVOID}START-STOP, two frames"
        )
    a, b = int(match[1]), int(match[2])
    if b <= a:
        raise at(path, number, f"{word}: stop {b} is not after start {a}; expected a later frame")
    if not start <= middle(a, b) < stop:
        raise at(
            path,
            number,
            f"{word} is not of the action {start} to {stop}; expected its middle in it",
        )
    return a, b


def _mark(path: Path, number: int, words: list[str], start: int, stop: int) -> int | None:
    """The first frame of what the action from start to stop is about, where one is marked."""
    if not words:
        return None
    if len(words) > 1:
        raise at(path, number, f"{' '.join(map(text.shown, words))}; expected one {MARK}FRAME")
    mark = _frame(path, number, words[0].removeprefix(MARK), f"a frame behind {MARK}")
    if not start <= mark < stop - 1:
        raise at(
            path,
            number,
            f"{MARK}{mark} is outside of the action {start} to {stop}; expected a frame from "
            f"{start} to {stop - 2}",
        )
    return mark


def middle(start: int, stop: int) -> int:
    """The frame that says which action a part belongs to."""
    return (start + stop - 1) // 2


def _frame(path: Path, number: int, word: str, what: str) -> int:
    if not re.fullmatch(r"\d{1,9}", word, re.ASCII):
        raise at(path, number, f"{text.shown(word)} is not a frame; expected {what}, from 0")
    return int(word)


def quoted(word: str) -> str:
    """A word as it stands in a file."""
    plain = word and not re.search(r'[\s#"]', word) and word != HEADING
    return word if plain and word.isprintable() else json.dumps(word, ensure_ascii=True)
