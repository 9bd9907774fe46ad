"""The text file of actions, which a person edits and a program writes again.

::

    == jab_left  1251 frames  30.0 a second
    jab_left    0   41  idle    -          none      idle                 d3c0f1
    jab_left   41   83  attack  left_hand  straight  left_hand_straight   5e12aa

A clip's heading says how many frames it has; under it stands a line for each action: clip, start,
stop (frames of the clip; stop is one past the last), kind, limb, direction, label. Words with a
space in them stand in double quotes. Behind the label may stand ``avoid=START-STOP`` words: the
avoidance parts whose middle lies in the action, which may begin before it or end after it. A person
may add ``mark=FRAME``, the first frame of what the action is about, which makes it a target motion,
or ``cycle``, which makes it a cycle of locomotion.

**Edits survive.** Nothing but the file itself tells what a person has done, so that it can be
moved, mailed and kept in version control:

- a line that a program wrote ends in a check word, made from the line's other words. A line whose
  check word is missing or does not fit was written or changed by a person and is kept as it stands;
- the lines of a program cover each clip from its first frame to its last. Frames of a clip with a
  heading that no line covers were uncovered by a person: they stay so;
- a comment (from ``#`` to the end of a line) makes its line a person's; one on a line of its own is
  kept before the line that it stood before.

An avoidance part is a word of its action's line, so an edit of it, or of the line it stands in, is
kept in the same way, and so is that a person took it out.

So :func:`merge` needs no memory: it keeps what a person wrote, leaves out what a person took out
and fills the rest from a new analysis. Where both claim a frame, the person's line has it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from kumite import files
from kumite.annotate.action_lines import (
    AVOID,
    CYCLE,
    HEADING,
    MARK,
    NONE,
    OURS,
    ActionFile,
    Line,
    Section,
    middle,
    parse,
    quoted,
)
from kumite.annotate.actions import Actions
from kumite.annotate.avoidance import AvoidanceParts
from kumite.annotate.vocabulary import DIRECTIONS, DIRECTIONS_OF, KINDS, NO_LIMB
from kumite.checked import checked
from kumite.clip import LIMBS, ClipSet, runs
from kumite.errors import at, unknown

SLIVER = 0.15  # s: less than this left of a line is not an action

_HELP = (
    "actions found by `kumite segment`: clip, start, stop, kind, limb, direction, label, check",
    "change, add, split, join or delete lines as you like: running it again keeps what you did",
    "start and stop are frames of the clip, stop is one past the last; words with spaces in quotes",
    "the check word tells lines that you have not touched; delete it to keep a line as it is",
    f"{AVOID}START-STOP behind a label: frames in which the body is out of where it was",
    f"{MARK}FRAME behind a label: the action is a target motion (to prepare for), from there on",
    f"{CYCLE} behind a label: the action is a cycle of locomotion",
    *(f"{kind}: {', '.join(ways)}" for kind, ways in DIRECTIONS_OF.items()),
    f"limb: {', '.join(LIMBS)} or {NONE}; a sword strikes with the hand that holds it",
)


@dataclass
class Kept:
    """What a person had done to a file and is kept in the new one."""

    lines: int = 0
    gaps: int = 0  # runs of frames that no line covers
    parts: int = 0  # avoidance parts, those of the program's lines too
    comments: int = 0
    written: int = 0  # lines by the program
    clips: list[str] = field(default_factory=list)  # with any of these


# Reading -----------------------------------------------------------------------------------------


def check(path: Path | str, known: ActionFile, clips: Sequence[ClipSet]) -> None:
    """That a file fits clips. Errors: an unknown clip, another rate, a line outside its clip, two
    lines by hand, or two avoidance parts of such lines, that overlap.
    """
    size = {n: int(k) for s in clips for n, k in zip(s.names, np.diff(s.clip_start))}
    rate = {n: s.fps for s in clips for n in s.names}
    for name, section in known.sections.items():
        first = section.number or next((x.number for x in section.lines), None)
        if name not in size:
            raise at(path, first, str(unknown("clip", name, size)))
        if section.fps is not None and abs(section.fps - rate[name]) > 1e-3:
            raise at(
                path,
                section.number,
                f"clip {name!r} is cut at {section.fps:g} frames a second and loaded at "
                f"{rate[name]:g}; expected one rate (--fps {section.fps:g})",
            )
        before: Line | None = None
        for line in (x for x in section.lines if x.by_hand):
            if line.stop > size[name]:
                raise at(
                    path,
                    line.number,
                    f"stop {line.stop} is outside clip {name!r}; expected at most {size[name]}",
                )
            if before is not None and line.start < before.stop:
                raise at(
                    path,
                    line.number,
                    f"{line.start} to {line.stop} overlaps line {before.number} "
                    f"({before.start} to {before.stop}); expected actions one after the other",
                )
            before = line
        _check_parts(path, section, size[name])


def _check_parts(path: Path | str, section: Section, frames: int) -> None:
    """That avoidance parts of a person's lines lie in their clip and do not overlap."""
    before: tuple[int, int, int | None] | None = None
    parts = [(a, b, x) for x in section.lines if x.by_hand for a, b in x.avoid]
    for a, b, line in sorted(parts, key=lambda part: part[:2]):
        word = f"{AVOID}{a}-{b}"
        if b > frames:
            raise at(
                path,
                line.number,
                f"{word} is outside clip {line.clip!r}; expected at most {frames}",
            )
        if before is not None and a < before[1]:
            raise at(
                path,
                line.number,
                f"{word} overlaps {AVOID}{before[0]}-{before[1]} of line {before[2]}; "
                "expected parts one after the other",
            )
        before = (a, b, line.number)


@checked
def read_actions(path: Path | str, clips: ClipSet) -> Actions:
    """The actions that a file gives clips, in order; a person's lines have what two lines claim.

    Clips that the file does not name have none. Errors: not such a file; a line that is wrong or
    does not fit the clips, as ``actions.txt:17: what; what was expected``.
    """
    return to_actions(_lines_of(path, clips), clips)


@checked
def read_avoidance(path: Path | str, clips: ClipSet) -> AvoidanceParts:
    """The avoidance parts that a file of actions gives clips. Errors: as :func:`read_actions`."""
    return to_parts(_lines_of(path, clips), clips)


@dataclass(frozen=True)
class Marked:
    """What a file of actions says of preparation, in frames of a set of clips."""

    targets: tuple[tuple[str, int, int, int], ...]  # label, start, stop (its last frame), mark
    cycles: tuple[tuple[str, int, int], ...]  # label, start, stop (its last frame)


@checked
def read_marked(path: Path | str, clips: ClipSet) -> Marked:
    """The target motions and cycles that a file marks, each label once: a second one is numbered.

    Errors: as :func:`read_actions`; no action has a mark.
    """
    first = {n: int(a) for n, a in zip(clips.names, clips.clip_start)}
    targets, cycles, used = [], [], set()
    for x in _lines_of(path, clips):
        if x.mark is None and not x.cycle:
            continue
        label, again = x.label or x.clip, 2
        while label in used:
            label, again = f"{x.label or x.clip}_{again}", again + 1
        used.add(label)
        ends = first[x.clip] + x.start, first[x.clip] + x.stop - 1
        if x.mark is None:
            cycles.append((label, *ends))
        else:
            targets.append((label, *ends, first[x.clip] + x.mark))
    if not targets:
        raise at(path, None, f"no action is a target motion; expected {MARK}FRAME behind a label")
    return Marked(tuple(targets), tuple(cycles))


def _lines_of(path: Path | str, clips: ClipSet) -> list[Line]:
    """A file's lines, in order of clips and starts, each frame and part in one of them only."""
    known = parse(path)
    check(path, known, [clips])
    lines = []
    for c, name in enumerate(clips.names):
        section = known.sections.get(name, Section(()))
        frames = int(clips.clip_start[c + 1] - clips.clip_start[c])
        taken = np.zeros(frames, dtype=bool)
        hand = [x for x in section.lines if x.by_hand]
        for x in hand:
            taken[x.start : x.stop] = True
        rest = [
            piece
            for x in section.lines
            if not x.by_hand
            for piece in _free_pieces(x, taken, claim=True)
        ]
        lines += _settled(sorted([*hand, *rest], key=lambda x: x.start))
    return lines


def _settled(lines: Iterable[Line]) -> list[Line]:
    """Lines of a clip, no part in two of them: a person's have it first, then earlier ones."""
    lines = list(lines)
    taken: list[tuple[int, int]] = [part for x in lines if x.by_hand for part in x.avoid]
    out = []
    for x in lines:
        if not x.by_hand and x.avoid:
            free = tuple(
                (a, b)
                for a, b in x.avoid
                if x.start <= middle(a, b) < x.stop
                and all(b <= start or stop <= a for start, stop in taken)
            )
            taken += free
            x = replace(x, avoid=free)
        out.append(x)
    return out


# Writing -----------------------------------------------------------------------------------------


def to_actions(lines: Iterable[Line], clips: ClipSet) -> Actions:
    """Lines of a file, in order of clips and starts, as actions."""
    lines = list(lines)
    first = {n: int(a) for n, a in zip(clips.names, clips.clip_start)}
    offset = np.array([first[x.clip] for x in lines], dtype=np.int64)
    return Actions(
        offset + np.array([x.start for x in lines], dtype=np.int64),
        offset + np.array([x.stop for x in lines], dtype=np.int64),
        np.array([KINDS.index(x.kind) for x in lines], dtype=np.int32),
        np.array([NO_LIMB if x.limb == NONE else LIMBS.index(x.limb) for x in lines], np.int32),
        np.array([DIRECTIONS.index(x.direction) for x in lines], dtype=np.int32),
        tuple(x.label for x in lines),
        clips.clip_start,
    )


def to_parts(lines: Iterable[Line], clips: ClipSet) -> AvoidanceParts:
    """The avoidance parts of lines of a file."""
    first = {n: int(a) for n, a in zip(clips.names, clips.clip_start)}
    found = sorted((first[x.clip] + a, first[x.clip] + b) for x in lines for a, b in x.avoid)
    start, stop = np.array(found, dtype=np.int64).reshape(-1, 2).T
    return AvoidanceParts(start, stop, clips.clip_start)


def to_lines(
    actions: Actions, clips: ClipSet, avoidance: AvoidanceParts | None = None
) -> list[Line]:
    """Actions as lines of a file, as a program writes them.

    avoidance: parts of the same clips; those whose middle lies in no action are left out.
    """
    parts: dict[int, list[tuple[int, int]]] = {}
    if avoidance is not None:
        for a, b in zip(avoidance.start.tolist(), avoidance.stop.tolist()):
            k = int(np.searchsorted(actions.start, middle(a, b), side="right")) - 1
            parts.setdefault(k, []).append((a, b))
    return [
        Line(
            clips.names[c],
            int(a - clips.clip_start[c]),
            int(b - clips.clip_start[c]),
            KINDS[kind],
            NONE if limb == NO_LIMB else LIMBS[limb],
            DIRECTIONS[way],
            "" if label == NONE else label,
            avoid=tuple(
                (p - int(clips.clip_start[c]), q - int(clips.clip_start[c]))
                for p, q in parts.get(k, ())
            ),
        )
        for k, (c, a, b, kind, limb, way, label) in enumerate(
            zip(
                actions.clip,
                actions.start,
                actions.stop,
                actions.kind,
                actions.limb,
                actions.direction,
                actions.label,
            )
        )
    ]


def merge(
    known: ActionFile | None, lines: Iterable[Line], clips: Iterable[ClipSet]
) -> tuple[ActionFile, Kept]:
    """A new analysis of clips, with all that a person has done to the file of the last one.

    known: that file, checked against the clips, or None; lines: of the new analysis.
    """
    fresh: dict[str, list[Line]] = {}
    for line in lines:
        fresh.setdefault(line.clip, []).append(line)
    kept = Kept()
    sections = {}
    for one in clips:
        for name, frames in zip(one.names, np.diff(one.clip_start).tolist()):
            old = known.sections.get(name, Section(())) if known else Section(())
            taken = _uncovered(old, frames)
            gaps = len(runs(taken))
            hand = [replace(x, number=None) for x in old.lines if x.by_hand]
            for x in hand:
                taken[x.start : x.stop] = True
            new = _left_over(fresh.get(name, ()), taken, round(SLIVER * one.fps))
            both = _settled(sorted([*hand, *new], key=lambda x: x.start))
            sections[name] = Section(tuple(both), frames, one.fps, old.comments)
            kept.lines += len(hand)
            kept.gaps += gaps
            kept.parts += sum(len(x.avoid) for x in both)
            kept.comments += len(old.comments)
            kept.written += len(new)
            if hand or gaps or old.comments:
                kept.clips.append(name)
    head = known.comments if known else ()
    kept.comments += len(head)
    return ActionFile(sections, head), kept


def _left_over(lines: Iterable[Line], taken: np.ndarray, shortest: int) -> list[Line]:
    """What is left of lines [frames that others have taken]; slivers go to the line they touch."""
    out: list[Line] = []
    waiting: Line | None = None
    for x in lines:
        for piece in _free_pieces(x, taken):
            if waiting is not None and waiting.stop == piece.start:
                piece = replace(piece, start=waiting.start, avoid=waiting.avoid + piece.avoid)
                waiting = None
            elif waiting is not None:
                out.append(waiting)
                waiting = None
            whole = piece.stop - piece.start >= min(shortest, x.stop - x.start)
            if whole:
                out.append(piece)
            elif out and out[-1].stop == piece.start:
                out[-1] = replace(out[-1], stop=piece.stop, avoid=out[-1].avoid + piece.avoid)
            else:
                waiting = piece
    return out if waiting is None else [*out, waiting]


def _uncovered(section: Section, frames: int) -> np.ndarray:
    """Frames [F] bool of a clip that a person has taken out."""
    out = np.zeros(frames, dtype=bool)
    if section.frames is not None:
        out[: section.frames] = True
        for x in section.lines:
            out[x.start : x.stop] = False
    return out


def _free_pieces(line: Line, taken: np.ndarray, *, claim: bool = False) -> list[Line]:
    """What is left of a line where other lines have taken frames; claim: take what is left."""
    free = ~taken[line.start : line.stop]
    pieces = runs(free)
    if claim:
        taken[line.start : line.stop] = True
    return [
        replace(line, start=line.start + a, stop=line.start + b, number=None)
        for a, b in pieces.tolist()
    ]


@checked
def write_actions(
    path: Path | str, actions: Actions, clips: ClipSet, avoidance: AvoidanceParts | None = None
) -> None:
    """Write actions, and their avoidance parts, as a program does: no line counts as a person's.

    Frames of a clip that no action covers count as taken out. Errors: a file that cannot be
    written.
    """
    write(path, merge(None, to_lines(actions, clips, avoidance), [clips])[0])


def write(path: Path | str, content: ActionFile) -> None:
    """Write a file whole, or not at all. Errors: it cannot be written."""
    with files.writing(path) as temporary:
        temporary.write_text(_text(content), encoding="utf-8", newline="\n")


def _text(content: ActionFile) -> str:
    words = [_columns(x) for s in content.sections.values() for x in s.lines]
    columns = 8 if any(row[7] for row in words) else 7
    width = [max((len(row[k]) for row in words), default=0) for k in range(columns)]
    out = [f"{OURS} {line}" for line in _HELP] + list(content.comments)
    for name, section in content.sections.items():
        out += ["", f"{HEADING} {quoted(name)}  {section.frames} frames  {section.fps!r} a second"]
        waiting = sorted(section.comments, key=lambda c: c[0])
        for x in section.lines:
            while waiting and waiting[0][0] <= x.start:
                out.append(waiting.pop(0)[1])
            row = "  ".join(
                w.rjust(n) if k in (1, 2) else w.ljust(n)
                for k, (w, n) in enumerate(zip(_columns(x), width))
            )
            end = "" if x.by_hand else f"  {x.check}"
            out.append(f"{row}{end}{'  ' + x.comment if x.comment else ''}".rstrip())
        out += [c for _, c in waiting]
    return "\n".join(out) + "\n"


def _columns(line: Line) -> list[str]:
    """The words of a line, its avoidance parts in one column, the eighth."""
    return [*line.words[:7], " ".join(line.words[7:])]
