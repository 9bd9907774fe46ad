"""The text file of an action combination table, which a person edits and a program writes again.

::

    [attack]
    left_hand_straight = { positions = ["head"], directions = ["front"], check = "b8f9a3" }

    [defence]
    duck = { positions = ["head", "upper torso"], directions = ["front", "horizontal"] }

    [[pair]]
    action = "duck"
    opponent = "left_hand_uppercut"
    suitability = -0.5

TOML. A line stands for all actions with its label; one of ``label@clip:start`` for that action
alone, and goes before its label's. A ``[[pair]]`` is a person's, and goes before annotations.

**Edits survive.** A line that a program wrote ends in a check word made from its other words. One
without, or with another, was written or changed by a person: it stays whenever the table is written
again, as do pairs, and comments before the line that they stand before.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from kumite import files, toml
from kumite.annotate import Actions
from kumite.checked import checked
from kumite.control.combination import (
    ANNOTATED,
    HIT_DIRECTIONS,
    POSITIONS,
    CombinationTable,
    Entry,
    Pair,
    build_table,
)
from kumite.errors import KumiteError, at
from kumite.graph import Layer
from kumite.mocap import text

OURS = "#:"  # begins a comment of ours, which is written anew each time
END = ""  # what a comment at the end of a file stands before
_HELP = (
    "how well actions suit actions of the opponent: S = what an attack and a defence share / what "
    "the defence has",
    "change or add lines as you like: what you wrote stays when the table is written again",
    "a line is for all actions with its label, one of label@clip:start for that action alone",
    "the check word tells lines that you have not touched; delete it to keep a line as it is",
    f"positions: {', '.join(POSITIONS)}; directions: {', '.join(HIT_DIRECTIONS)}",
    "[[pair]] with action, opponent and suitability goes before all that; below 0 it discourages",
)
_STRING = re.compile(r'"(?:[^"\\]|\\.)*"|\'[^\']*\'')
_KEY = re.compile(r"\s*(\"(?:[^\"\\]|\\.)*\"|'[^']*'|[\w-]+)\s*=", re.ASCII)
_HEADER = re.compile(r"\s*\[\s*(\w+)\s*\]\s*(#.*)?$", re.ASCII)
_PAIR = re.compile(r"\s*\[\[\s*pair\s*\]\]")


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class _Line(_Model):
    positions: tuple[Literal["head", "upper torso", "lower torso"], ...]
    directions: tuple[Literal["front", "horizontal", "upwards"], ...]
    check: str = ""


class _PairLine(_Model):
    action: str
    opponent: str
    suitability: Annotated[float, Field(allow_inf_nan=False)]


class _File(_Model):
    attack: dict[str, _Line] = {}
    defence: dict[str, _Line] = {}
    pair: tuple[_PairLine, ...] = ()


# Reading -----------------------------------------------------------------------------------------


@checked
def read_table(path: Path | str, library: Layer, actions: Actions) -> CombinationTable:
    """The table that a file gives a library's actions; what it does not say, their motion does.

    Errors: no such file, not TOML; unknown keys, words and actions, each with its line and near
    names; a pair that is there twice.
    """
    path = Path(path)
    return _merged(path, _read(path), build_table(library, actions), again=False)


def _read(path: Path) -> str:
    return text.decode(path, text.read_bytes(path))


def _merged(path: Path, source: str, found: CombinationTable, *, again: bool) -> CombinationTable:
    """What a file says with what a table says.

    again: the table is newer, so that a file's lines count only where a person wrote them and the
    table has none by hand; else all of them do.
    """
    said = toml.parse(source, path, _File)
    wrong: list[str] = []

    def known(action: str, kind: str | None, *place: int | str) -> bool:
        try:
            found.find(action, kind)
        except KumiteError as error:
            wrong.append(str(at(path, toml.line_of(source, *place), str(error))))
            return False
        return True

    entries = {(e.kind, e.action): e for e in found.entries}
    own = {key for key, entry in entries.items() if entry.by_hand}
    lines = {(e.kind, e.action): e for e in _entries(said)}
    ruling = {key for key, entry in lines.items() if entry.by_hand or not again}
    # A label's line stands for all its actions but those that have a line of their own there.
    entries = {
        key: entry
        for key, entry in entries.items()
        if key in own or key in lines or (entry.kind, _label(found, entry)) not in ruling
    }
    for (kind, name), entry in lines.items():
        if not entry.by_hand and (again or not _there(found, entry)):
            continue  # nothing of a person's is lost, and the actions may have been cut anew
        if known(name, kind, kind, name) and (kind, name) not in own:
            entries[kind, name] = entry
    pairs = {}
    for k, one in enumerate(said.pair):
        if (one.action, one.opponent) in pairs:
            line = toml.line_of(source, "pair", k)
            what = f"{one.action!r} against {one.opponent!r} for the second time; expected one pair"
            wrong.append(str(at(path, line, what)))
        mine = known(one.action, None, "pair", k, "action")
        if known(one.opponent, None, "pair", k, "opponent") and mine:
            pairs[one.action, one.opponent] = Pair(one.action, one.opponent, one.suitability)
    if wrong:
        raise KumiteError("\n".join(wrong))
    for pair in found.pairs:
        pairs[pair.action, pair.opponent] = pair
    return replace(
        found,
        entries=found.ordered(entries.values()),
        pairs=tuple(pairs.values()),
        comments=tuple(_comments(source, said)),
    )


def _entries(said: _File) -> Iterator[Entry]:
    for kind in ANNOTATED:
        for name, line in getattr(said, kind).items():
            entry = Entry(kind, name, line.positions, line.directions)
            yield replace(entry, by_hand=line.check != entry.check)


def _there(table: CombinationTable, entry: Entry) -> bool:
    try:
        table.find(entry.action, entry.kind)
    except KumiteError:
        return False
    return True


def _label(table: CombinationTable, entry: Entry) -> str:
    return table.labels[table.find(entry.action, entry.kind)[0]]


def _comments(source: str, said: _File) -> Iterator[tuple[str, str]]:
    """A person's comments, each with the key of what it stands before (or behind)."""
    waiting: list[str] = []
    section, pair = "", -1
    for row in source.split("\n"):
        comment = _comment(row)
        if comment and not comment.startswith(OURS):
            waiting.append(comment)
        key = None
        if header := _HEADER.match(row):
            key = section = header[1]
        elif _PAIR.match(row):
            section, pair = "pair", pair + 1
        elif section in ANNOTATED and (found := _KEY.match(row)):
            key = f"{section} {_unquoted(found[1])}"
        if section == "pair" and pair < len(said.pair) and not row.lstrip().startswith("#"):
            # Those within a pair, and between its lines, belong to it.
            key = _pair_key(said.pair[pair]) if row.strip() else None
        if key is not None:
            yield from ((key, c) for c in waiting)
            waiting.clear()
    yield from ((END, c) for c in waiting)


def _comment(row: str) -> str:
    begin = _STRING.sub(lambda m: "_" * len(m[0]), row).find("#")
    return row[begin:].rstrip() if begin >= 0 else ""


def _unquoted(key: str) -> str:
    if key.startswith('"'):
        try:
            return json.loads(key)
        except ValueError:
            return key  # an escape of TOML's own
    return key.strip("'")


def _pair_key(pair: Pair | _PairLine) -> str:
    return f"pair {pair.action} {pair.opponent}"


# Writing -----------------------------------------------------------------------------------------


@checked
def write_table(
    path: Path | str, table: CombinationTable, *, keep: bool = True
) -> CombinationTable:
    """Write a table; what is written is returned.

    keep: where the file is there already, a person's lines, pairs and comments in it stay, unless
    the table itself has others by hand for the same actions. Errors: a file that is no such table
    or names actions that are no more; nothing is written then.
    """
    path = Path(path)
    if keep and path.exists():
        table = _merged(path, _read(path), table, again=True)
    with files.writing(path) as temporary:
        temporary.write_text(_source(table), "utf-8", newline="\n")
    return table


def _source(table: CombinationTable) -> str:
    comments: dict[str, list[str]] = {}
    for key, comment in table.comments:
        comments.setdefault(key, []).append(comment)
    out = [f"{OURS} {line}" for line in _HELP]
    for kind in ANNOTATED:
        out += ["", *comments.pop(kind, ()), f"[{kind}]"]
        for entry in (e for e in table.entries if e.kind == kind):
            out += comments.pop(f"{kind} {entry.action}", ())
            out.append(_line(entry))
    for pair in table.pairs:
        out += ["", *comments.pop(_pair_key(pair), ()), "[[pair]]"]
        out.append(f"action = {_quoted(pair.action)}")
        out.append(f"opponent = {_quoted(pair.opponent)}")
        out.append(f"suitability = {pair.suitability!r}")
    left = [comment for each in comments.values() for comment in each]
    return "\n".join([*out, *(["", *left] if left else []), ""])


def _line(entry: Entry) -> str:
    bare = re.fullmatch(r"[\w-]+", entry.action, re.ASCII)
    key = entry.action if bare else _quoted(entry.action)
    words = [f"positions = {_listed(entry.positions)}", f"directions = {_listed(entry.directions)}"]
    if not entry.by_hand:
        words.append(f'check = "{entry.check}"')
    return f"{key} = {{ {', '.join(words)} }}"


def _listed(words: Iterable[str]) -> str:
    return f"[{', '.join(_quoted(word) for word in words)}]"


def _quoted(word: str) -> str:
    """A TOML string: JSON's, but for one character that JSON leaves as it is."""
    return json.dumps(word, ensure_ascii=False).replace("\x7f", "\\u007F")
