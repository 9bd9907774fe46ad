"""Files of ours: safetensors with a JSON header, versioned, written whole or not at all.

What is read is taken for what an enemy wrote: a checksum tells damage, not honesty. Here the
header is bounded and made of plain values; what its values and the arrays mean is checked by the
dataclasses they become.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import os
import platform
import re
import secrets
import time
import zlib
from collections.abc import Iterator, Mapping
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kumite.checks import is_control, shown
from kumite.errors import KumiteError, short
from kumite.lazy import Later

if TYPE_CHECKING:
    import numpy as np
    import safetensors
    import safetensors.numpy as tensors
else:
    np, safetensors, tensors = map(Later, ("numpy", "safetensors", "safetensors.numpy"))

LIBRARY, RECORDING = ("library", 6), ("recording", 2)  # kind and version
META_KEY = "kumite"
MOST_HEADER = 100_000_000  # bytes of a file's header: the most that safetensors reads
MOST_VALUES = 20_000_000  # in it: each takes some 60 bytes of memory
DEEPEST = 32  # values within values
LONGEST_TEXT = 100_000  # characters
MOST_INTEGER = 2**63  # all integers are smaller
_PART = ".kumite-part."  # how the name of a file begins that is being written
_ABANDONED = 86_400.0  # s after which nobody is still writing one

# What a reader of a damaged file may run into before its own checks do.
UNREADABLE = (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, KumiteError)


def refuse_unwritable(path: Path | str) -> None:
    """Say now what would stop a file from being written after long work. Touches nothing.

    Errors: a folder or device in its place, a file among its folders, a folder without permission.
    """
    path = Path(path)
    try:
        # A rename would put a plain file where a folder or device (/dev/null) was.
        if path.is_dir():
            raise KumiteError(f"{path}: cannot be written (Is a directory)")
        if path.exists() and not path.is_file():
            raise KumiteError(f"{path}: cannot be written (a device or pipe; expected a file)")
        folder = Path(os.path.realpath(path)).parent
        while not folder.exists() and folder != folder.parent:
            folder = folder.parent
        if not folder.is_dir():
            raise KumiteError(f"{path}: cannot be written ({folder} is not a folder)")
        if not os.access(folder, os.W_OK | os.X_OK):
            raise KumiteError(f"{path}: cannot be written (no permission to write in {folder})")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise KumiteError(f"{str(path)[:200]}: cannot be written ({reason})") from None


@contextlib.contextmanager
def writing(path: Path | str) -> Iterator[Path]:
    """A temporary path beside ``path``, renamed onto it at the end; removed if anything fails.

    After a crash or a power cut there is the old file or the new one, whole. What a process that
    was killed left behind is removed when the next one writes to the folder. A link is followed:
    what it points at is written, and the link stays.
    """
    refuse_unwritable(path)
    goal = Path(os.path.realpath(path))
    suffix = goal.suffix if len(goal.suffix) <= 10 else ""  # for writers that go by it
    name = f"{_PART}{_here()}.{os.getpid()}.{secrets.token_hex(4)}{suffix}"
    temporary = goal.parent / name
    try:
        goal.parent.mkdir(parents=True, exist_ok=True)
        _clear_abandoned(goal.parent)
        temporary.touch(exist_ok=False)
        yield temporary
        with temporary.open("r+b") as file:
            os.fsync(file.fileno())
        temporary.replace(goal)
        _sync_folder(goal.parent)
    except OSError as error:
        raise KumiteError(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def _sync_folder(folder: Path) -> None:
    """Bring a rename to the disk, where folders can be opened (not on Windows)."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


@functools.cache
def _here() -> str:
    """8 hex digits of where process numbers mean what they mean here: machine and container."""
    space = ""
    with contextlib.suppress(OSError, AttributeError):
        space = os.readlink("/proc/self/ns/pid")  # noqa: PTH115
    return hashlib.sha256(f"{platform.node()} {space}".encode()).hexdigest()[:8]


@functools.cache  # once a process and folder
def _clear_abandoned(folder: Path) -> None:
    """Remove what processes that are no more were writing."""
    name = re.compile(re.escape(_PART) + r"([0-9a-f]{8})\.(\d{1,10})\.[0-9a-f]{8}(\..*)?")
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            found = name.fullmatch(entry.name)
            if found is None or not entry.is_file(follow_symlinks=False):
                continue
            with contextlib.suppress(OSError):
                age = time.time() - entry.stat(follow_symlinks=False).st_mtime
                if age > _ABANDONED or (found[1] == _here() and not _runs(int(found[2]))):
                    Path(entry.path).unlink()


def _runs(process: int) -> bool:
    """Whether a process of this machine may still run: on Windows to ask would end it."""
    if os.name != "posix":
        return True
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        return True  # somebody else's
    return True


def _checksum(header: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> int:
    """CRC-32 of the content: what a disk or a transfer has changed is told, not computed with."""
    crc = zlib.crc32(json.dumps(header, sort_keys=True).encode())
    for name, array in sorted(arrays.items()):
        crc = zlib.crc32(f"{name} {array.dtype} {array.shape}".encode(), crc)
        crc = zlib.crc32(np.ascontiguousarray(array).reshape(-1).view(np.uint8).data, crc)
    return crc


def save(
    path: Path | str, kind: str, version: int, header: Mapping[str, Any], arrays: dict[str, Any]
) -> None:
    """Write arrays and a JSON header. The same content gives the same bytes.

    Errors: a header of other than plain values; a file that cannot be written.
    """
    try:
        plain(header, "header")
    except KumiteError as error:
        raise KumiteError(f"{path}: cannot be written ({error})") from None
    stored = {k: np.ascontiguousarray(v) for k, v in sorted(arrays.items())}
    # One key: safetensors writes several in an order that changes from run to run.
    what = {"kind": kind, "version": version, "header": header}
    what["crc32"] = _checksum(header, stored)
    meta = {META_KEY: json.dumps(what, sort_keys=True, allow_nan=False)}
    with writing(path) as temporary:
        temporary.write_bytes(tensors.save(stored, metadata=meta))


def plain(value: object, what: str, depth: int = 0) -> None:
    """Errors: anything but JSON's values, numbers beyond 64 bits or not finite, control characters
    other than tabs and line ends, texts without end, values within values within values …"""
    if value is None or isinstance(value, bool):
        return
    if isinstance(value, str):
        if len(value) > LONGEST_TEXT:
            raise KumiteError(f"{what}: {len(value)} characters; expected at most {LONGEST_TEXT}")
        if not value.isprintable() and any(is_control(c) and c not in "\t\n" for c in value):
            raise KumiteError(f"{what}: {shown(value)}; expected no control characters")
    elif isinstance(value, int):
        if not -MOST_INTEGER <= value < MOST_INTEGER:
            raise KumiteError(f"{what}: a number of more than 64 bits")
    elif isinstance(value, float):
        if value != value or value in (inf, -inf):
            raise KumiteError(f"{what}: {value}; expected a finite number")
    elif depth == DEEPEST:
        raise KumiteError(f"{what}: more than {DEEPEST} values within each other")
    elif isinstance(value, dict):
        for key, part in value.items():
            if not isinstance(key, str):
                raise KumiteError(f"{what}: {shown(key)}; expected text as a key")
            plain(key, what)
            plain(part, key, depth + 1)
    elif isinstance(value, list | tuple):
        for part in value:
            plain(part, what, depth + 1)
    else:
        raise KumiteError(f"{what}: {shown(value)}; expected a plain value")


def _meta(blob: bytes) -> dict[str, Any]:
    """What :func:`save` says of the arrays, from a file's first bytes.

    Errors: ValueError, LookupError, TypeError; a header beyond bounds.
    """
    text = json.loads(_bounded(blob))["__metadata__"][META_KEY]
    meta = json.loads(_bounded(text.encode("utf-8")))
    if not {"kind", "version", "header"} <= set(meta):
        raise KeyError
    return meta


def _bounded(source: bytes) -> bytes:
    """JSON that will not fill the memory. Errors: ValueError."""
    if source.count(b",") + source.count(b"[") + source.count(b"{") > MOST_VALUES:
        raise ValueError(f"more than {MOST_VALUES} values")
    return source


_NO_META = (*UNREADABLE, MemoryError, RecursionError)


def kind_of(path: Path | str) -> str | None:
    """What a file that :func:`save` wrote holds; None of any other file, and of none."""
    try:
        if not Path(path).is_file():
            return None
        with Path(path).open("rb") as file:
            size = int.from_bytes(file.read(8), "little")
            if size > min(os.fstat(file.fileno()).st_size, MOST_HEADER):
                return None
            kind = _meta(file.read(size))["kind"]
        return kind if isinstance(kind, str) else None
    except (OSError, *_NO_META):
        return None


def refuse_unreadable(path: Path | str, kind: str, version: int) -> None:
    """Say now what a file's first bytes tell of why :func:`load` would not read it.

    Errors: missing, not a file of ours, another kind of file, another version.
    """
    path = Path(path)
    with _reading(path), path.open("rb") as file:
        first = file.read(8)
        size = min(int.from_bytes(first, "little"), MOST_HEADER + 1)
        _head(path, first + file.read(min(size, os.fstat(file.fileno()).st_size)), kind, version)


def load(path: Path | str, kind: str, version: int) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """The header and arrays of a file that :func:`save` wrote.

    Errors: missing, damaged, another kind of file, another version.
    """
    path = Path(path)
    with _reading(path):
        blob = path.read_bytes()
    meta = _head(path, blob, kind, version)
    try:
        header = meta["header"]
        if not isinstance(header, dict):
            raise TypeError("its header is no table")
        plain(header, "header")
        arrays = tensors.load(blob)
    except (safetensors.SafetensorError, *_NO_META) as error:
        raise KumiteError(f"{path}: damaged {kind} ({error})") from None
    if _checksum(header, arrays) != meta.get("crc32"):
        raise KumiteError(f"{path}: damaged {kind} (its content does not fit its checksum)")
    return header, arrays


@contextlib.contextmanager
def _reading(path: Path) -> Iterator[None]:
    """What the system says of a path, in a sentence. Errors: a folder, pipe or device."""
    try:
        if path.exists() and not path.is_file():
            raise KumiteError(f"{path}: cannot be read (not a file)")
        yield
    except OSError as error:
        raise KumiteError(f"{short(path)}: cannot be read ({error.strerror or error})") from None
    except ValueError:  # a NUL
        raise KumiteError(f"{shown(str(path))}: not a path") from None


def _head(path: Path, blob: bytes, kind: str, version: int) -> dict[str, Any]:
    """What :func:`save` says of the arrays. Errors: it is none of ours, or not the one wanted."""
    try:
        size = int.from_bytes(blob[:8], "little")
        if size > MOST_HEADER:
            raise ValueError
        meta = _meta(blob[8 : 8 + size])
    except _NO_META:
        raise KumiteError(
            f"{path}: damaged, or not a file of Kumite's; expected a {kind}"
        ) from None
    found, number = meta["kind"], meta["version"]
    if found != kind:
        raise KumiteError(f"{path}: this is a {shown(found).strip(chr(39))}; expected a {kind}")
    if number != version:
        raise KumiteError(
            f"{path}: {kind} of version {shown(number)}; this Kumite reads version {version}: "
            "build it again"
        )
    return meta


def code_digest(*modules: str) -> str:
    """16 hex digits of the sources of modules and packages of ours ("graph", "clip", …).

    What is computed by them and kept is kept under it: changed code finds nothing of the old.
    """
    h = hashlib.sha256()
    root = Path(__file__).parent
    for name in sorted(modules):
        for path in [root / f"{name}.py", *sorted((root / name).glob("*.py"))]:
            if path.exists():
                h.update(path.read_bytes())
    return h.hexdigest()[:16]
