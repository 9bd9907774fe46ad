"""BVH: a hierarchy of joints with channels, then one row of numbers a frame.

What the format leaves open is read as its tools do: position channels replace the joint's OFFSET
(the root's too), and rotation channels turn one after another, each in the axes that the ones
before it left, in the order that the joint itself gives. What becomes of position channels below
the root is settled once roles are known (:mod:`kumite.mocap.rigid`).
"""

from __future__ import annotations

import re
from collections import deque
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from kumite.clip import NO_PARENT, Skeleton
from kumite.errors import KumiteError, at, told_of
from kumite.kernels import parse
from kumite.mocap import text
from kumite.mocap.raw import MOST_CHARACTERS, MOST_JOINTS, SAY_RATE, RawMotion, check_size

POSITION_CHANNELS = ("Xposition", "Yposition", "Zposition")
ROTATION_CHANNELS = ("Xrotation", "Yrotation", "Zrotation")
_CHANNELS = {c.lower(): c for c in (*POSITION_CHANNELS, *ROTATION_CHANNELS)}
_KEYWORDS = "ROOT, JOINT, End Site, OFFSET, CHANNELS, { or }"
_LONGEST_FRAME = 1.0  # s; beyond it a frame time is a rate, or in another unit
_SHORTEST_FRAME = 1e-5  # s
_STILL = 2e-5  # of the longest bone: a position channel that differs less from its OFFSET is it
_MOTION = re.compile(rb"^[ \t]*(?:\}[ \t]*)*(MOTION):?(?![^\s{}])", re.MULTILINE | re.IGNORECASE)
_COMMENT = re.compile(rb"^[ \t]*(?:#|//)[^\n]*", re.MULTILINE)
_REMARK = re.compile(r"\s(?:#|//).*")  # behind a statement; a name may hold a '#'
_FRAMES = re.compile(rb"\s*Frames[ \t]*:?\s*([^\s:]+)", re.IGNORECASE)
_FRAME_TIME = re.compile(rb"\s*Frame[ \t]*Time[ \t]*:?[ \t]*(\S*)", re.IGNORECASE)


@dataclass
class _Joint:
    name: str
    parent: int
    index: int
    offset: list[float] | None = None
    channels: list[str] | None = None
    tips: list[list[float]] = field(default_factory=list)


@dataclass
class _EndSite:
    joint: _Joint
    offset: list[float] | None = None


def read_bvh(
    path: Path | str, *, fps: float | None = None, encoding: str | None = None
) -> RawMotion:
    """One BVH file, in its own units.

    fps: the file's rate, whatever it says of it; encoding: of its joint names.

    Errors: anything but a whole, well-formed file, with line, token and what was expected.
    """
    path = Path(path)
    data, notes = text.read_text(path, encoding)
    if b"#" in data or b"//" in data:
        data = _COMMENT.sub(b"", data)
    motion = _MOTION.search(data)
    header = text.decode(path, data if motion is None else data[: motion.start(1)])
    joints = _Hierarchy(path, header).read(complete=motion is not None)
    if motion is None:
        raise at(path, data.count(b"\n") + 1, "the file ends here; expected MOTION")
    frames, rate, start = _motion_header(path, data, motion.end(), fps)
    values, more = _motion(path, data, start, frames, joints)
    return _assemble(path, joints, values, rate, (*notes, *more))


# Hierarchy ---------------------------------------------------------------------------------------


class _Hierarchy:
    """A HIERARCHY while it is read. Iterative: a file may nest as deep as it likes."""

    def __init__(self, path: Path, header: str) -> None:
        self.path = path
        self.last_line = header.count("\n") + 1
        # Braces stand alone, whatever line they are on.
        remarks = "#" in header or "//" in header
        self.todo: deque[tuple[int, str]] = deque(
            (n, part.strip())
            for n, line in enumerate(header.split("\n"), 1)
            for part in re.split(r"([{}])", _REMARK.sub("", line) if remarks else line)
            if part.strip()
        )
        self.joints: list[_Joint] = []
        self.open: list[_Joint | _EndSite] = []  # whose braces are open, the innermost last
        self.opens_next: _Joint | _EndSite | None = None  # its name was read, not yet its brace
        self.titled = False

    def error(self, line: int, what: str) -> KumiteError:
        return at(self.path, line, what)

    def read(self, *, complete: bool) -> list[_Joint]:
        """The joints in file order, parents first. ``complete``: MOTION follows."""
        while self.todo:
            line, statement = self.todo.popleft()
            word, *rest = statement.split(None, 1)
            more = self.statement(line, word, statement, rest[0] if rest else "")
            if more:
                self.todo.appendleft((line, more))
        if not self.titled:
            raise self.error(self.last_line, "the file ends here; expected HIERARCHY")
        if self.opens_next is not None or self.open or not self.joints:
            inside = [o for o in self.open if isinstance(o, _Joint)]
            where = f" (joint {text.shown(inside[-1].name)} is open)" if inside else ""
            expected = "'{'" if self.opens_next else "'}'" if self.open else "ROOT"
            what = "MOTION comes" if complete else "the file ends"
            raise self.error(self.last_line, f"{what} too early{where}; expected {expected}")
        return self.joints

    def statement(self, line: int, word: str, statement: str, rest: str) -> str:
        """Take one statement in; returns what is left of it for the next."""
        key = word.upper()
        if key == "ENDSITE":
            key, rest = "END", "Site"
        elif key == "END" and not rest and self.todo and self.todo[0][1].upper() == "SITE":
            rest = self.todo.popleft()[1]
        if self.opens_next is not None:
            if statement != "{":
                raise self.error(line, f"unexpected {text.shown(statement)}; expected '{{'")
            self.open.append(self.opens_next)
            self.opens_next = None
            return ""
        if not self.titled:
            if key != "HIERARCHY":
                raise self.error(line, f"unexpected {text.shown(word)}; expected HIERARCHY")
            self.titled = True
            return rest
        if key == "ROOT":
            if self.joints:
                raise self.error(line, "a second ROOT; expected one character in a file")
            self.joint(line, rest, NO_PARENT)
            return ""
        if not self.open:
            raise self.error(line, f"unexpected {text.shown(word)}; expected ROOT or MOTION")
        inside = self.open[-1]
        if statement == "}":
            self.close(line)
        elif key == "OFFSET":
            return self.offset(line, inside, rest)
        elif key == "CHANNELS":
            return self.channels(line, inside, rest)
        elif key not in ("JOINT", "END"):
            raise self.error(line, f"unknown keyword {text.shown(word)}; expected {_KEYWORDS}")
        elif isinstance(inside, _EndSite):
            raise self.error(line, f"{text.shown(word)} in an End Site; expected OFFSET or '}}'")
        elif key == "JOINT":
            self.joint(line, rest, inside.index)
        elif rest.lower().startswith("site"):
            self.opens_next = _EndSite(inside)
        else:
            raise self.error(line, f"{text.shown(statement)}; expected 'End Site'")
        return ""

    def joint(self, line: int, name: str, parent: int) -> None:
        if not name:
            raise self.error(line, "a joint without a name")
        if len(name) > MOST_CHARACTERS:
            what = f"a name of {len(name)} characters; expected at most {MOST_CHARACTERS}"
            raise self.error(line, what)
        if len(self.joints) == MOST_JOINTS:
            raise self.error(line, f"more than {MOST_JOINTS} joints; expected those of a person")
        self.opens_next = _Joint(name, parent, len(self.joints))
        self.joints.append(self.opens_next)

    def close(self, line: int) -> None:
        closed = self.open.pop()
        if closed.offset is None:
            what = (
                "End Site" if isinstance(closed, _EndSite) else f"joint {text.shown(closed.name)}"
            )
            raise self.error(line, f"{what} has no OFFSET")
        if isinstance(closed, _EndSite):
            closed.joint.tips.append(closed.offset)

    def offset(self, line: int, inside: _Joint | _EndSite, rest: str) -> str:
        while len(rest.split()) < 3 and self.todo and _is_number(self.todo[0][1].split()[0]):
            rest = f"{rest} {self.todo.popleft()[1]}"
        tokens = rest.split(None, 3)
        if len(tokens) < 3:
            raise self.error(line, f"OFFSET with {len(tokens)} numbers; expected 3")
        if inside.offset is not None:
            raise self.error(line, "a second OFFSET; expected one only")
        what = "an OFFSET of 3 numbers"
        inside.offset = [text.number(self.path, line, t, what) for t in tokens[:3]]
        return tokens[3] if len(tokens) > 3 else ""

    def channels(self, line: int, inside: _Joint | _EndSite, rest: str) -> str:
        # Their names may stand on the lines below.
        words = rest.split()
        while len(words) < 1 + _count(words) and self.todo:
            following = self.todo[0][1].split()
            if words and following[0].lower() not in _CHANNELS:
                break
            words += following
            self.todo.popleft()
        channels, more = _channels(self.path, line, words)
        if isinstance(inside, _EndSite):
            if channels:
                raise self.error(line, "CHANNELS in an End Site; expected OFFSET or '}'")
        elif inside.channels is not None:
            raise self.error(line, "a second CHANNELS; expected one only")
        else:
            inside.channels = channels
        return more


def _count(words: list[str]) -> int:
    """How many channels a ``CHANNELS`` statement announces; 0 where that is no count."""
    return int(words[0]) if words and re.fullmatch(r"[0-6]", words[0]) else 0


def _is_number(word: str) -> bool:
    return word.lstrip("+-")[:1].isdigit() or word.lstrip("+-")[:1] == "."


def _channels(path: Path, line: int, words: list[str]) -> tuple[list[str], str]:
    """The channels of a ``CHANNELS`` statement, and what follows them."""
    if not words or not (words[0].isascii() and words[0].isdigit()) or len(words[0]) > 3:
        shown = text.shown(words[0]) if words else "nothing"
        raise at(path, line, f"CHANNELS {shown}; expected a count from 0 to 6")
    count = int(words[0])
    if count > 6:
        raise at(path, line, f"CHANNELS {count}; expected a count from 0 to 6")
    names = words[1 : 1 + count]
    channels = []
    for word in names:
        channel = _CHANNELS.get(word.lower())
        if channel is None:
            raise at(
                path,
                line,
                f"unknown channel {text.shown(word)}; "
                f"expected one of {', '.join(_CHANNELS.values())}",
            )
        if channel in POSITION_CHANNELS and channel in channels:
            raise at(path, line, f"channel {channel} twice; expected it once")
        channels.append(channel)
    if len(channels) < count:
        raise at(path, line, f"{len(channels)} channels; expected {count}, as declared")
    return channels, " ".join(words[1 + count :])


# Motion ------------------------------------------------------------------------------------------


def _motion_header(
    path: Path, data: bytes, start: int, fps: float | None
) -> tuple[int, float, int]:
    """Declared frames, frames a second, and the byte at which the numbers begin."""
    found: list[tuple[int, str]] = []
    for key, pattern in (("Frames", _FRAMES), ("Frame Time", _FRAME_TIME)):
        match = pattern.match(data, start)
        if match is None:
            space = re.compile(rb"\s*").match(data, start)
            start = start if space is None else space.end()
            line = data.count(b"\n", 0, start) + 1
            if start == len(data):
                raise at(path, line, f"the file ends here; expected '{key}:'")
            row = data[start:].partition(b"\n")[0].strip()
            raise at(path, line, f"unexpected {text.shown(row)}; expected '{key}: …'")
        line = data.count(b"\n", 0, match.start(1)) + 1
        found.append((line, match[1].decode("utf-8", "replace")))
        start = match.end()
    (frames_line, frames), (time_line, time) = found
    if not (frames.isascii() and frames.isdigit()) or len(frames) > 12 or int(frames) == 0:
        raise at(path, frames_line, f"Frames: {text.shown(frames)}; expected a count of 1 or more")
    if fps is None:
        fps = _rate(path, time_line, time)
    return int(frames), fps, start


def _rate(path: Path, line: int, time: str) -> float:
    """Frames a second of a frame time as it is written."""
    expected = f"a frame time from {_SHORTEST_FRAME:g} to {_LONGEST_FRAME:g} s"
    say = SAY_RATE
    seconds = text.number(path, line, time or "nothing", f"{expected}; else say {say}")
    if not _SHORTEST_FRAME <= seconds <= _LONGEST_FRAME:
        if _LONGEST_FRAME < seconds <= 1000:
            say = f"--file-fps {seconds:g} if this is a rate (or file_fps in kumite.toml)"
        what = f"Frame Time: {text.shown(time)}; expected {expected}; else say {say}"
        raise at(path, line, what)
    return text.rate_of(seconds, time)


def _motion(
    path: Path, data: bytes, start: int, frames: int, joints: list[_Joint]
) -> tuple[np.ndarray, tuple[str, ...]]:
    """The channels' values [F, channels], in the file's units; and what is odd about them."""
    body = data[start:]
    first_line = data.count(b"\n", 0, start) + 1
    channels = sum(len(j.channels or ()) for j in joints)
    if channels == 0:
        raise at(path, first_line, "no joint has channels; expected some motion")
    table = text.read_table(body, [None] * channels)
    if table.refused is not None:
        line = first_line + body.count(b"\n", 0, table.refused)
        text.number(path, line, text.token_at(body, table.refused), f"{channels} numbers a frame")
    found, over = divmod(table.tokens, channels)
    check_size(path, found, len(joints))
    values = table.values[: found * channels].reshape(found, channels)
    if table.broken is None and over == 0:  # every row is whole
        if found == frames:
            return values, ()
        if abs(found - frames) == 1:
            return values, (f"{found} whole rows of motion are read, {frames} are declared",)
    rows = 0
    odd: tuple[int, int] | None = None
    for line, row in enumerate(body.split(b"\n"), first_line):
        count = len(row.split())
        rows += count > 0
        if count % channels and odd is None:
            odd = line, count
    # Rows may be broken into lines, but not shifted: as many lines as frames are a row each.
    if over == 0 and found == frames and rows != frames:
        return values, ()
    if odd is not None:
        raise at(path, odd[0], f"{odd[1]} numbers; expected {channels}, one a channel")
    last = first_line + body.rstrip().count(b"\n")
    raise at(path, last, f"{found} frames of motion; expected {frames}, as declared, or one beside")


# From channels to poses --------------------------------------------------------------------------


def _assemble(
    path: Path, joints: list[_Joint], values: np.ndarray, fps: float, notes: tuple[str, ...]
) -> RawMotion:
    starts = np.concatenate([[0], np.cumsum([len(j.channels or ()) for j in joints])])
    turn_start, columns, axes = [0], [], []
    for joint, first in zip(joints, starts):
        for k, channel in enumerate(joint.channels or ()):
            if channel in ROTATION_CHANNELS:
                columns.append(int(first) + k)
                axes.append(ROTATION_CHANNELS.index(channel))
        turn_start.append(len(columns))
    wxyz = np.empty((len(values), len(joints), 4))
    parse.euler_to_wxyz(
        values,
        np.array(turn_start, np.int64),
        np.array(columns, np.int64),
        np.array(axes, np.int64),
        np.pi / 180,
        wxyz,
    )
    offsets = np.array([j.offset for j in joints], dtype=np.float64)
    still = _STILL * float(np.linalg.norm(offsets[1:], axis=1).max(initial=0.0))
    root_position = np.tile(offsets[0], (len(values), 1))
    positions: dict[int, np.ndarray] = {}
    for j, (joint, first) in enumerate(zip(joints, starts)):
        held = {c: int(first) + k for k, c in enumerate(joint.channels or ()) if "position" in c}
        if not held:
            continue
        position = np.tile(offsets[j], (len(values), 1))
        for axis, channel in enumerate(POSITION_CHANNELS):
            if channel in held:
                position[:, axis] = values[:, held[channel]]
        if j == 0:
            root_position = position
        elif np.abs(position - offsets[j]).max() > still:
            positions[j] = position
    names, renamed = _unique([j.name for j in joints])
    if renamed:
        notes = (*notes, f"joint names used twice were numbered: {', '.join(renamed)}")
    tip_parents = np.array([j for j, n in enumerate(joints) for _ in n.tips], dtype=np.int32)
    tip_offsets = np.array([t for n in joints for t in n.tips], dtype=np.float64).reshape(-1, 3)
    parents = np.array([j.parent for j in joints])
    with told_of(path):
        skeleton = Skeleton(
            names, parents, offsets, tip_parents=tip_parents, tip_offsets=tip_offsets
        )
    return RawMotion(
        path, skeleton, fps, True, root_position, wxyz, notes=notes, positions=positions
    )


def _unique(names: list[str]) -> tuple[tuple[str, ...], list[str]]:
    """Names with a number after those that came before, and the names that were changed."""
    taken = set(names)
    seen: set[str] = set()
    counts: dict[str, int] = {}
    out, renamed = [], []
    for name in names:
        new = name
        while new in seen:
            counts[name] = counts.get(name, 1) + 1
            new = f"{name}_{counts[name]}"
            if new in taken:
                new = name
        if new != name:
            renamed.append(new)
        seen.add(new)
        out.append(new)
    return tuple(out), renamed
