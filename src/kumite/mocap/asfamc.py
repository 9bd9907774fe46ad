"""ASF and AMC: a skeleton of bones with their own axes, and a motion that turns them.

The problem. A bone rests along ``direction`` (world axes) and turns in its own axes C. With M the
product of its degrees of freedom, in the order of its ``axis``, its rotation in the world is

    W = W_parent · C · M · C⁻¹

since every bone's rest orientation is the world's. So the rotation of our joint, from its parent's
axes, is C M C⁻¹, the joint lies where its bone begins, and a child's offset is its parent's
direction · length. Source: Acclaim's ASF/AMC description, and J. Lander, "Working with motion
capture file formats", Game Developer, January 1998.

Degrees of freedom that stretch or shift a bone (``l``, ``tx`` … below the root) are left out.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from kumite import rotation
from kumite.clip import NO_PARENT, Skeleton
from kumite.errors import KumiteError, at, told_of, unknown
from kumite.kernels import parse
from kumite.mocap import text
from kumite.mocap.raw import MOST_CHARACTERS, MOST_JOINTS, SAY_RATE, RawMotion, Stretch, check_size

DOFS = ("tx", "ty", "tz", "rx", "ry", "rz", "l")
USUAL_FPS = 120.0  # of CMU's database, whose AMC files do not say
INCH = 0.0254  # m; ASF lengths are inches once divided by the header's `length`
_SECTIONS = (
    *(":version", ":name", ":units", ":documentation", ":root"),
    *(":bonedata", ":hierarchy", ":skin"),
)
_ROOT_KEYS = "order, axis, position or orientation"
_BONE_KEYS = "id, name, direction, length, axis, bodymass, cofmass, dof, limits or end"


@dataclass(frozen=True)
class AsfSkeleton:
    """A skeleton as an ASF file gives it. Lengths in file units."""

    source: Path
    skeleton: Skeleton
    axes_wxyz: np.ndarray  # [J, 4] C of every joint
    orders: tuple[str, ...]  # J, in which order its turns apply, like 'xyz'
    dofs: tuple[tuple[str, ...], ...]  # J, the values that an AMC gives, in its order
    root_position: np.ndarray  # [3] file units, added to the motion's
    metres_per_unit: float | None  # what :units says, if it does
    radians: bool  # angles of an AMC that does not say
    notes: tuple[str, ...] = ()  # what was odd about the file


@dataclass
class _Bone:
    name: str
    line: int
    direction: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    length: float = 0.0
    axis: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    order: str = "xyz"
    dofs: tuple[str, ...] = ()


# Skeleton ----------------------------------------------------------------------------------------


class _Asf:
    """An ASF file while it is read, a line at a time."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.root = _Bone("root", 1, dofs=("tx", "ty", "tz", "rx", "ry", "rz"))
        self.root_position = [0.0, 0.0, 0.0]
        self.bones: dict[str, _Bone] = {}
        self.links: list[tuple[int, str, list[str]]] = []
        self.length: float | None = None
        self.radians = False
        self.seen: set[str] = set()

    def error(self, line: int, what: str) -> KumiteError:
        return at(self.path, line, what)

    def numbers(self, line: int, words: list[str], count: int) -> list[float]:
        if len(words) - 1 < count:
            raise self.error(line, f"{words[0]} with {len(words) - 1} values; expected {count}")
        what = f"{words[0]} and {count} number{'s' * (count > 1)}"
        return [text.number(self.path, line, w, what) for w in words[1 : 1 + count]]

    def axis_order(self, line: int, word: str) -> str:
        order = word.lower()
        if len(order) != 3 or sorted(order) != ["x", "y", "z"]:
            raise self.error(line, f"axis order {text.shown(word)}; expected XYZ in some order")
        return order

    def dof_names(self, line: int, words: list[str]) -> tuple[str, ...]:
        dofs = tuple(w.lower() for w in words)
        for word, dof in zip(words, dofs):
            if dof not in DOFS:
                raise self.error(
                    line,
                    f"unknown degree of freedom {text.shown(word)}; expected {', '.join(DOFS)}",
                )
        if len(set(dofs)) != len(dofs):
            raise self.error(line, f"degrees of freedom twice: {' '.join(dofs)}")
        return dofs

    def units(self, line: int, words: list[str]) -> None:
        key = words[0].lower()
        if key == "length":
            self.length = self.numbers(line, words, 1)[0]
            if self.length <= 0:
                raise self.error(line, f"length {text.shown(words[1])}; expected more than 0")
        elif key == "angle":
            if len(words) < 2 or words[1].lower() not in ("deg", "rad"):
                shown = text.shown(words[1]) if len(words) > 1 else "nothing"
                raise self.error(line, f"angle {shown}; expected deg or rad")
            self.radians = words[1].lower() == "rad"

    def root_line(self, line: int, words: list[str]) -> None:
        key = words[0].lower()
        if key == "order":
            self.root.dofs = self.dof_names(line, words[1:])
        elif key == "axis":
            if len(words) < 2:
                raise self.error(line, "axis without an order; expected XYZ in some order")
            self.root.order = self.axis_order(line, words[1])
        elif key == "position":
            self.root_position = self.numbers(line, words, 3)
        elif key == "orientation":
            self.root.axis = self.numbers(line, words, 3)
        else:
            raise self.error(line, f"unknown key {text.shown(words[0])}; expected {_ROOT_KEYS}")

    def bone_line(self, bone: _Bone, line: int, words: list[str]) -> None:
        key = words[0].lower()
        if key == "name":
            if len(words) < 2:
                raise self.error(line, "a bone without a name")
            bone.name = words[1]
        elif key == "direction":
            bone.direction = self.numbers(line, words, 3)
        elif key == "length":
            bone.length = self.numbers(line, words, 1)[0]
        elif key == "axis":
            bone.axis = self.numbers(line, words, 3)
            bone.order = self.axis_order(line, words[4]) if len(words) > 4 else "xyz"
        elif key == "dof":
            bone.dofs = self.dof_names(line, words[1:])
        elif key not in ("id", "bodymass", "cofmass", "limits") and not key.startswith("("):
            raise self.error(line, f"unknown key {text.shown(words[0])}; expected {_BONE_KEYS}")

    def keep(self, bone: _Bone) -> None:
        if not bone.name:
            raise self.error(bone.line, "a bone without a name")
        if len(bone.name) > MOST_CHARACTERS:
            what = f"a name of {len(bone.name)} characters; expected at most {MOST_CHARACTERS}"
            raise self.error(bone.line, what)
        if bone.name in self.bones or bone.name == "root":
            raise self.error(bone.line, f"bone {text.shown(bone.name)} twice; expected it once")
        if len(self.bones) == MOST_JOINTS:
            what = f"more than {MOST_JOINTS} bones; expected those of a person"
            raise self.error(bone.line, what)
        self.bones[bone.name] = bone

    def read(self, lines: Iterator[tuple[int, str]]) -> None:
        section = ""
        bone: _Bone | None = None
        line = 1
        for line, row in lines:
            words = row.split()
            if words[0].startswith(":"):
                if bone is not None:
                    raise self.error(line, f"{text.shown(words[0])} inside a bone; expected end")
                section = words[0].lower()
                if section not in _SECTIONS:
                    raise self.error(
                        line,
                        f"unknown section {text.shown(words[0])}; expected {', '.join(_SECTIONS)}",
                    )
                self.seen.add(section)
            elif section == ":units":
                self.units(line, words)
            elif section == ":root":
                self.root_line(line, words)
            elif section == ":bonedata":
                key = words[0].lower()
                if bone is None:
                    if key != "begin":
                        raise self.error(line, f"unexpected {text.shown(words[0])}; expected begin")
                    bone = _Bone("", line)
                elif key == "end":
                    self.keep(bone)
                    bone = None
                else:
                    self.bone_line(bone, line, words)
            elif section == ":hierarchy":
                if words[0].lower() not in ("begin", "end"):
                    self.links.append((line, words[0], words[1:]))
            elif not section:
                raise self.error(line, f"unexpected {text.shown(words[0])}; expected :version")
        if bone is not None:
            raise self.error(
                line, f"the file ends inside bone {text.shown(bone.name)}; expected end"
            )
        for needed in (":bonedata", ":hierarchy"):
            if needed not in self.seen:
                raise self.error(line, f"the file ends without {needed}")

    def ordered(self) -> tuple[list[_Bone], list[int]]:
        """Bones and their parents' indices, the root first and each before its children."""
        children: dict[str, list[str]] = {}
        parent_line: dict[str, int] = {}
        for line, parent, names in self.links:
            for name in (parent, *names):
                if name != "root" and name not in self.bones:
                    raise self.error(line, str(unknown("bone", name[:80], ["root", *self.bones])))
            for name in names:
                if name == "root" or name in parent_line:
                    raise self.error(line, f"bone {text.shown(name)} has a parent already")
                parent_line[name] = line
                children.setdefault(parent, []).append(name)
        order: list[_Bone] = []
        parents: list[int] = []
        stack = [("root", NO_PARENT)]
        while stack:
            name, parent = stack.pop()
            index = len(order)
            order.append(self.root if name == "root" else self.bones[name])
            parents.append(parent)
            stack.extend((c, index) for c in reversed(children.get(name, ())))
        if len(order) != len(self.bones) + 1:
            reached = {b.name for b in order}
            lost = [n for n in self.bones if n not in reached]
            raise self.error(
                self.bones[lost[0]].line, f"bones that hang on nothing: {', '.join(lost[:8])}"
            )
        return order, parents


def read_asf(path: Path | str, *, encoding: str | None = None) -> AsfSkeleton:
    """One ASF file, in its own units. ``encoding``: of its names, where it is not UTF-8.

    Errors: missing sections, unknown keys or bones, values that are not numbers, a hierarchy that
    is not one tree.
    """
    path = Path(path)
    data, notes = text.read_text(path, encoding)
    source = text.decode(path, data)
    asf = _Asf(path)
    asf.read(_lines(source))
    bones, parents = asf.ordered()
    ends = np.array([np.array(b.direction) * b.length for b in bones])
    offsets = np.zeros((len(bones), 3))
    for j, parent in enumerate(parents):
        if parent not in (NO_PARENT, 0):
            offsets[j] = ends[parent]
    inner = set(parents)
    leaves = [j for j in range(1, len(bones)) if j not in inner and np.any(ends[j] != 0)]
    with told_of(path):
        skeleton = Skeleton(
            tuple(b.name for b in bones),
            np.array(parents),
            offsets,
            tip_parents=np.array(leaves, dtype=np.int32),
            tip_offsets=ends[leaves].reshape(-1, 3),
        )
    scale = 1.0 if asf.radians else np.pi / 180
    return AsfSkeleton(
        path,
        skeleton,
        np.array([_fixed_axes(b.order, np.array(b.axis) * scale) for b in bones]),
        tuple(b.order for b in bones),
        tuple(b.dofs for b in bones),
        np.array(asf.root_position),
        None if asf.length is None else INCH / asf.length,
        asf.radians,
        notes,
    )


def _fixed_axes(order: str, xyz: np.ndarray) -> np.ndarray:
    """Turns about fixed axes by angles about x, y and z [3] [rad], applied in this order.

    For the usual XYZ, x first: Rz Ry Rx. The values are x, y, z whatever the order, as those of
    the root's orientation are.
    """
    q = rotation.IDENTITY_WXYZ
    for axis in order:
        k = "xyz".index(axis)
        q = rotation.multiply(rotation.from_axis_angle(np.eye(3)[k], xyz[k]), q)
    return q


def _lines(source: str) -> Iterator[tuple[int, str]]:
    """Lines with their numbers, without comments and blank lines."""
    for n, line in enumerate(source.split("\n"), 1):
        row = line.partition("#")[0].strip()
        if row:
            yield n, row


# Motion ------------------------------------------------------------------------------------------


def read_amc(
    path: Path | str,
    asf: AsfSkeleton,
    fps: float | None = None,
    *,
    encoding: str | None = None,
) -> RawMotion:
    """One AMC file on its skeleton, in the files' own units. ``fps`` beats what the file says.

    Errors: an unknown bone, another count of values than the bone's degrees of freedom, frames out
    of order or cut off, values that are not numbers.
    """
    path = Path(path)
    data, odd = text.read_text(path, encoding)
    if b"#" in data:
        data = re.sub(rb"#[^\n]*", b"", data)
    first = re.search(rb"^[ \t]*[^:\s][^\n]*$", data, re.MULTILINE)
    header = text.decode(path, data if first is None else data[: first.start()])
    if first is None:
        raise at(path, data.count(b"\n") + 1, "the file ends here; expected frame 1")
    header_line = header.count("\n") + 1
    stated, radians, declared = _amc_header(path, header, asf.radians, fps)
    body = data[first.start() :]
    motion = _Amc(path, asf, header_line)
    names, values = motion.read(body)
    notes = [*asf.notes, *odd]
    if declared is not None and abs(declared - len(values)) == 1:
        notes.append(f"{len(values)} frames are read, {declared} are declared")
    elif declared is not None and declared != len(values):
        last = header_line + body.rstrip().count(b"\n")
        raise at(path, last, f"{len(values)} frames; expected {declared}, as :FRAME-RANGE declares")
    absent = [n for n, d in zip(asf.skeleton.names, asf.dofs) if d and n not in names]
    if absent:
        notes.append(f"bones that the motion leaves out stay at rest: {', '.join(absent)}")
    check_size(path, len(values), len(asf.skeleton))
    root, wxyz, dropped = _poses(asf, names, values, 1.0 if radians else np.pi / 180)
    if dropped:
        notes.append(f"bones that change length or shift keep their rest: {', '.join(dropped)}")
    wildest = max(dropped, key=lambda n: dropped[n], default=None)
    return RawMotion(
        path,
        asf.skeleton,
        fps or stated or USUAL_FPS,
        fps is None and stated is not None,
        root,
        wxyz,
        asf.metres_per_unit,
        asf.source,
        tuple(notes),
        stretch=None if wildest is None else Stretch(wildest, dropped[wildest]),
    )


def _amc_header(
    path: Path, header: str, radians: bool, fps: float | None
) -> tuple[float | None, bool, int | None]:
    """Frames a second (None: not said), whether angles are in radians, frames declared.

    fps: what the user says of the rate; the file's own is not asked then.
    """
    told = fps is not None
    frames: int | None = None
    for line, row in _lines(header):
        key, *rest = row.split()
        key = key.upper()
        if key == ":SAMPLES-PER-SECOND" and not told:
            token = rest[0] if rest else ""
            fps = text.number(path, line, token, f"frames a second; else say {SAY_RATE}")
            if not 0.1 <= fps <= 1e5:
                expected = f"expected 0.1 to 100000; else say {SAY_RATE}"
                raise at(path, line, f"{text.shown(token)} frames a second; {expected}")
        elif key == ":FRAME-RANGE":
            match = re.fullmatch(r"(\d{1,9})\s*-?\s*(\d{1,9})", " ".join(rest), re.ASCII)
            if match is None or int(match[2]) < int(match[1]):
                raise at(
                    path, line, f"frame range {text.shown(' '.join(rest))}; expected like 1-120"
                )
            frames = int(match[2]) - int(match[1]) + 1
        elif key in (":DEGREES", ":RADIANS"):
            radians = key == ":RADIANS"
    return fps, radians, frames


class _Amc:
    """An AMC file while its frames are read."""

    def __init__(self, path: Path, asf: AsfSkeleton, first_line: int) -> None:
        self.path = path
        self.first_line = first_line
        self.dofs = dict(zip(asf.skeleton.names, asf.dofs))

    def read(self, body: bytes) -> tuple[tuple[str, ...], np.ndarray]:
        """Bones in the order of frame 1, and all their values [F, V] in that order."""
        second = re.compile(rb"^[ \t]*\d+[ \t]*$", re.MULTILINE)
        heads = second.finditer(body)
        next(heads, None)
        end = next(heads, None)
        sample = body if end is None else body[: end.start()]
        names, values = self.read_exactly(sample)
        if end is None:
            return names, values
        columns: list[str | None] = [None]
        for name in names:
            columns += [name, *[None] * len(self.dofs[name])]
        table = text.read_table(body, columns)
        if table.refused is None and table.tokens % len(columns) == 0:
            rows = table.values.reshape(table.tokens // len(columns), -1)
            if np.all(np.diff(rows[:, 0]) == 1):
                return names, rows[:, 1:]
        # Bones in another order, or something wrong: the slow way accepts the one, names the other.
        return self.read_exactly(body)

    def read_exactly(self, body: bytes) -> tuple[tuple[str, ...], np.ndarray]:
        """The same, a line at a time."""
        rows: list[list[float]] = []
        names: tuple[str, ...] = ()
        frame: dict[str, list[float]] = {}
        count: int | None = None
        line = self.first_line
        for line, row in _lines(text.decode(self.path, body, self.first_line)):
            line += self.first_line - 1
            words = row.split()
            if len(words) == 1 and words[0].isascii() and words[0].isdigit():
                if count is not None:
                    names = self.close(line, count, names, frame, rows)
                    if words[0].lstrip("0") != str(count + 1):
                        raise at(
                            self.path,
                            line,
                            f"frame {text.shown(words[0])} after {count}; expected {count + 1}",
                        )
                if len(words[0]) > 9:
                    raise at(self.path, line, f"{text.shown(words[0])}; expected a frame's number")
                count, frame = int(words[0]), {}
            elif count is None:
                raise at(
                    self.path, line, f"unexpected {text.shown(words[0])}; expected a frame's number"
                )
            else:
                self.bone(line, words, frame)
        if count is None:
            raise at(self.path, line, "the file ends here; expected a frame's number")
        names = self.close(line, count, names, frame, rows)
        return names, np.array(rows)

    def bone(self, line: int, words: list[str], frame: dict[str, list[float]]) -> None:
        name = words[0]
        if name not in self.dofs:
            raise at(self.path, line, str(unknown("bone", name[:80], self.dofs)))
        if name in frame:
            raise at(self.path, line, f"bone {text.shown(name)} twice in a frame; expected it once")
        dofs = self.dofs[name]
        if len(words) - 1 != len(dofs):
            raise at(
                self.path,
                line,
                f"{text.shown(name)} with {len(words) - 1} values; "
                f"expected {len(dofs)} ({' '.join(dofs) or 'none'})",
            )
        what = f"a value of {name}"
        frame[name] = [text.number(self.path, line, w, what) for w in words[1:]]

    def close(
        self,
        line: int,
        count: int,
        names: tuple[str, ...],
        frame: dict[str, list[float]],
        rows: list[list[float]],
    ) -> tuple[str, ...]:
        """Keep a frame, if it has the bones of the first; returns those."""
        if "root" not in frame:
            raise at(self.path, line, f"frame {count} ends without 'root'")
        names = names or tuple(frame)
        if len(frame) != len(names) or any(n not in frame for n in names):
            odd = sorted(set(names) ^ set(frame))
            raise at(
                self.path,
                line,
                f"frame {count} ends with {len(frame)} bones; expected the {len(names)} of "
                f"the first (differs in {', '.join(odd[:4])})",
            )
        rows.append([v for n in names for v in frame[n]])
        return names


def _poses(
    asf: AsfSkeleton, names: tuple[str, ...], values: np.ndarray, radians_per_unit: float
) -> tuple[np.ndarray, np.ndarray, dict[str, float]]:
    """Root positions [F, 3], rotations [F, J, 4], and how far left-out shifts go, by bone."""
    column: dict[tuple[str, str], int] = {}
    for name in names:
        for dof in asf.dofs[asf.skeleton.names.index(name)]:
            column[name, dof] = len(column)
    start, columns, axes = [0], [], []
    dropped: dict[str, float] = {}
    for name, order in zip(asf.skeleton.names, asf.orders):
        # Fixed axes, the first turn first, are body axes with the first turn last.
        for axis in reversed(order):
            if (name, f"r{axis}") in column:
                columns.append(column[name, f"r{axis}"])
                axes.append("xyz".index(axis))
        start.append(len(columns))
        shifts = ("l",) if name == "root" else ("l", "tx", "ty", "tz")
        shifted = [values[:, column[name, s]] for s in shifts if (name, s) in column]
        if np.any(shifted):
            dropped[name] = float(np.linalg.norm(shifted, axis=0).max())
    wxyz = np.empty((len(values), len(asf.skeleton), 4))
    parse.euler_to_wxyz(
        np.ascontiguousarray(values),
        np.array(start, np.int64),
        np.array(columns, np.int64),
        np.array(axes, np.int64),
        radians_per_unit,
        wxyz,
    )
    # C M C⁻¹ turns the vector part of M by C and leaves its angle.
    turned = rotation.to_matrix(asf.axes_wxyz)  # [J, 3, 3]
    wxyz[..., 1:] = np.einsum("jab,fjb->fja", turned, wxyz[..., 1:])
    root = np.tile(asf.root_position, (len(values), 1))
    for k, axis in enumerate("xyz"):
        if ("root", f"t{axis}") in column:
            root[:, k] += values[:, column["root", f"t{axis}"]]
    return root, wxyz, dropped
