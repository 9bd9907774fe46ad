"""Files of ours: safetensors with a JSON header, versioned, written whole or not at all."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import tempfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load as load_tensors
from safetensors.numpy import save as save_tensors

from kumite.errors import KumiteError

META_KEY = "kumite"


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

    A link is followed: what it points at is written, and the link stays.
    """
    refuse_unwritable(path)
    goal = Path(os.path.realpath(path))
    try:
        goal.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(
            prefix=f".{goal.name}.", suffix=goal.suffix, dir=goal.parent
        )
        os.close(handle)
    except OSError as error:
        raise KumiteError(f"{path}: cannot be written ({error.strerror})") from None
    temporary = Path(name)
    try:
        yield temporary
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        temporary.replace(goal)
    except OSError as error:
        raise KumiteError(f"{path}: cannot be written ({error.strerror})") from None
    finally:
        temporary.unlink(missing_ok=True)


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
    """Write arrays and a JSON header. The same content gives the same bytes."""
    tensors = {k: np.ascontiguousarray(v) for k, v in sorted(arrays.items())}
    # One key: safetensors writes several in an order that changes from run to run.
    what = {"kind": kind, "version": version, "header": header}
    what["crc32"] = _checksum(header, tensors)
    meta = {META_KEY: json.dumps(what, sort_keys=True, allow_nan=False)}
    with writing(path) as temporary:
        temporary.write_bytes(save_tensors(tensors, metadata=meta))


def kind_of(path: Path | str) -> str | None:
    """What a file that :func:`save` wrote holds; None of any other file, and of none."""
    try:
        with Path(path).open("rb") as file:
            size = int.from_bytes(file.read(8), "little")
            if size > os.fstat(file.fileno()).st_size:
                return None
            meta = json.loads(json.loads(file.read(size))["__metadata__"][META_KEY])
        return str(meta["kind"])
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def load(path: Path | str, kind: str, version: int) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """The header and arrays of a file that :func:`save` wrote.

    Errors: missing, damaged, another kind of file, another version.
    """
    path = Path(path)
    try:
        blob = path.read_bytes()
    except OSError as error:
        raise KumiteError(f"{path}: cannot be read ({error.strerror})") from None
    try:
        size = int.from_bytes(blob[:8], "little")
        meta = json.loads(json.loads(blob[8 : 8 + size])["__metadata__"][META_KEY])
        found, number, header = meta["kind"], meta["version"], meta["header"]
    except (ValueError, KeyError, TypeError, MemoryError, OverflowError, RecursionError):
        raise KumiteError(
            f"{path}: damaged, or not a file of Kumite's; expected a {kind}"
        ) from None
    if found != kind:
        raise KumiteError(f"{path}: this is a {found}; expected a {kind}")
    if number != version:
        raise KumiteError(
            f"{path}: {kind} of version {number}; this Kumite reads version {version}: "
            "build it again"
        )
    try:
        arrays = load_tensors(blob)
    except (SafetensorError, ValueError, KeyError) as error:
        raise KumiteError(f"{path}: damaged {kind} ({error})") from None
    if _checksum(header, arrays) != meta.get("crc32"):
        raise KumiteError(f"{path}: damaged {kind} (its content does not fit its checksum)")
    return header, arrays


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
