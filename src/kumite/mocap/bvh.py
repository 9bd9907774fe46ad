"""BVH: a hierarchy of joints with channels, then one row of numbers a frame.

What the format leaves open is read as its tools do: position channels replace the joint's OFFSET
(the root's too), and rotation channels turn one after another, each in the axes that the ones
before it left, in the order that the joint itself gives.
"""

from __future__ import annotations

import re
from collections import deque
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from kumite import rotation
from kumite.clip import NO_PARENT, Skeleton
from kumite.errors import KumiteError, at, told_of
from kumite.kernels import parse
from kumite.mocap import text
from kumite.mocap.raw import RawMotion

POSITION_CHANNELS = ("Xposition", "Yposition", "Zposition")
ROTATION_CHANNELS = ("Xrotation", "Yrotation", "Zrotation")
_CHANNELS = {c.lower(): c for c in (*POSITION_CHANNELS, *ROTATION_CHANNELS)}
_KEYWORDS = "ROOT, JOINT, End Site, OFFSET, CHANNELS, { or }"
_LONGEST_FRAME = 10.0  # s; beyond it a frame time is in another unit
_SHORTEST_FRAME = 1e-5  # s
_STILL = 1e-4  # of the longest bone: a position channel that moves less than this is constant


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


def read_bvh(path: Path | str) -> RawMotion:
    """One BVH file, in its own units.

    Errors: anything but a whole, well-formed file, with line, token and what was expected.
    """
    path = Path(path)
    data = text.read_bytes(path)
    motion = re.search(rb"^[ \t]*MOTION[ \t]*$", data, re.MULTILINE | re.IGNORECASE)
    header = text.decode(path, data if motion is None else data[: motion.start()])
    joints = _Hierarchy(path, header).read(complete=motion is not None)
    if motion is None:
        raise at(path, data.count(b"\n") + 1, "the file ends here; expected MOTION")
    frames, frame_time, start = _motion_header(path, data, motion.end())
    values = _motion(path, data, start, frames, sum(len(j.channels or ()) for j in joints))
    return _assemble(path, joints, values, frame_time)


# Hierarchy ---------------------------------------------------------------------------------------


class _Hierarchy:
    """A HIERARCHY while it is read. Iterative: a file may nest as deep as it likes."""

    def __init__(self, path: Path, header: str) -> None:
        self.path = path
        self.last_line = header.count("\n") + 1
        # Braces stand alone, whatever line they are on.
        self.todo: deque[tuple[int, str]] = deque(
            (n, part.strip())
            for n, line in enumerate(header.split("\n"), 1)
            for part in re.split(r"([{}])", line)
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
        tokens = rest.split(None, 3)
        if len(tokens) < 3:
            raise self.error(line, f"OFFSET with {len(tokens)} numbers; expected 3")
        if inside.offset is not None:
            raise self.error(line, "a second OFFSET; expected one only")
        what = "an OFFSET of 3 numbers"
        inside.offset = [text.number(self.path, line, t, what) for t in tokens[:3]]
        return tokens[3] if len(tokens) > 3 else ""

    def channels(self, line: int, inside: _Joint | _EndSite, rest: str) -> str:
        channels, more = _channels(self.path, line, rest)
        if isinstance(inside, _EndSite):
            if channels:
                raise self.error(line, "CHANNELS in an End Site; expected OFFSET or '}'")
        elif inside.channels is not None:
            raise self.error(line, "a second CHANNELS; expected one only")
        else:
            inside.channels = channels
        return more


def _channels(path: Path, line: int, rest: str) -> tuple[list[str], str]:
    """The channels of a ``CHANNELS`` statement, and what follows them on the same line."""
    words = rest.split()
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


def _motion_header(path: Path, data: bytes, start: int) -> tuple[int, tuple[float, str], int]:
    """Declared frames, frame time [s] with its text, and the byte at which the numbers begin."""
    found: list[tuple[int, str]] = []
    line = data.count(b"\n", 0, start) + 1
    for key in ("Frames", "Frame Time"):
        value = None
        while value is None:
            begin = data.find(b"\n", start) + 1
            if begin == 0:
                raise at(path, line, f"the file ends here; expected '{key}:'")
            line += 1
            end = data.find(b"\n", begin)
            end = len(data) if end < 0 else end
            row = data[begin:end]
            start = end
            if row.strip():
                pattern = rb"\s*" + key.replace(" ", r"\s+").encode() + rb"\s*:\s*(\S+)\s*"
                match = re.fullmatch(pattern, row, re.IGNORECASE)
                if match is None:
                    raise at(
                        path, line, f"unexpected {text.shown(row.strip())}; expected '{key}: …'"
                    )
                value = match.group(1).decode("utf-8", "replace")
        found.append((line, value))
    (frames_line, frames), (time_line, time) = found
    if not (frames.isascii() and frames.isdigit()) or len(frames) > 12 or int(frames) == 0:
        raise at(path, frames_line, f"Frames: {text.shown(frames)}; expected a count of 1 or more")
    expected = f"a frame time from {_SHORTEST_FRAME:g} to {_LONGEST_FRAME:g} s"
    seconds = text.number(path, time_line, time, expected)
    if not _SHORTEST_FRAME <= seconds <= _LONGEST_FRAME:
        raise at(path, time_line, f"Frame Time: {text.shown(time)}; expected {expected}")
    return int(frames), (seconds, time), start


def _motion(path: Path, data: bytes, start: int, frames: int, channels: int) -> np.ndarray:
    """The channels' values [F, channels], in the file's units."""
    body = data[start:]
    first_line = data.count(b"\n", 0, start) + 1
    if channels == 0:
        raise at(path, first_line, "no joint has channels; expected some motion")
    table = text.read_table(body, [None])
    if table.refused is not None:
        line = first_line + body.count(b"\n", 0, table.refused)
        text.number(path, line, text.token_at(body, table.refused), f"{channels} numbers a frame")
    if table.tokens == frames * channels:
        return table.values.reshape(frames, channels)
    rows = 0
    for line, row in enumerate(body.split(b"\n"), first_line):
        count = len(row.split())
        if count == 0:
            continue
        if count != channels:
            raise at(path, line, f"{count} numbers; expected {channels}, one a channel")
        rows += 1
    last = first_line + body.rstrip().count(b"\n")
    raise at(path, last, f"{rows} frames of motion; expected {frames}, as declared")


# From channels to poses --------------------------------------------------------------------------


def _assemble(
    path: Path, joints: list[_Joint], values: np.ndarray, frame_time: tuple[float, str]
) -> RawMotion:
    notes: list[str] = []
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
    parents = np.array([j.parent for j in joints])
    offsets = np.array([j.offset for j in joints], dtype=np.float64)
    longest = float(np.linalg.norm(offsets[1:], axis=1).max(initial=0.0))
    root_position = np.tile(offsets[0], (len(values), 1))
    stretched: list[str] = []
    moving: dict[int, np.ndarray] = {}
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
            continue
        middle = np.median(position, axis=0)
        if np.ptp(position, axis=0).max() > _STILL * max(longest, float(np.abs(middle).max())):
            moving[j] = position
        elif np.any(middle):
            # All zeros beside a real OFFSET are displacements, not a bone of no length.
            offsets[j] = middle
    if list(moving) == [1] and np.count_nonzero(parents == 0) == 1 and not joints[0].tips:
        # A reference joint above the hips: the hips become the root, at the same place in space.
        notes.append(f"joint {joints[0].name!r} above {joints[1].name!r} was merged into it")
        root_position = root_position + rotation.rotate(wxyz[:, 0], moving.pop(1))
        wxyz = np.concatenate(
            [rotation.multiply(wxyz[:, 0], wxyz[:, 1])[:, None], wxyz[:, 2:]], axis=1
        )
        joints, offsets = joints[1:], offsets[1:]
        parents = np.where(parents[1:] == 0, NO_PARENT, parents[1:] - 1)
    for j, position in moving.items():
        middle = np.median(position, axis=0)
        reach = float(np.linalg.norm(position - middle, axis=1).max())
        offsets[j] = middle
        stretched.append(f"{joints[j].name} (up to {reach:.3g} file units)")
    if stretched:
        notes.append(f"bones that change length keep their middle length: {', '.join(stretched)}")
    names, renamed = _unique([j.name for j in joints])
    if renamed:
        notes.append(f"joint names used twice were numbered: {', '.join(renamed)}")
    tip_parents = np.array([j for j, n in enumerate(joints) for _ in n.tips], dtype=np.int32)
    tip_offsets = np.array([t for n in joints for t in n.tips], dtype=np.float64).reshape(-1, 3)
    with told_of(path):
        skeleton = Skeleton(
            names, parents, offsets, tip_parents=tip_parents, tip_offsets=tip_offsets
        )
    fps = text.rate_of(*frame_time)
    return RawMotion(path, skeleton, fps, True, root_position, wxyz, notes=tuple(notes))


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
