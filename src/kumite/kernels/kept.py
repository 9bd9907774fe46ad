"""Compiled kernels, kept on disk while their sources are the same.

Numba keeps compiled code while the function's own file is the same; but a kernel holds the code and
the constants of those it calls in other files. So here the folder is named by a digest of all of
those files. A file holds the code for one signature and is named by it: several processes may
compile into one cache, and checkouts of any version share it. (Numba's own index of signatures is
rewritten whole by each process, and would then name the wrong code.)
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import pickle
import re
import shutil
import sys
import time
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.serialize import dumps

from kumite import caches

KEPT_FOR = 30 * 24 * 3600.0  # s for which code of other versions is kept
_IMPORT = re.compile(rb"^from kumite\.kernels\.(\w+) import", re.MULTILINE)


@cache
def _sources(file: str) -> tuple[str, ...]:
    """The digests of a file and of every kernel module that it imports, directly or not."""
    found: dict[Path, bytes] = {}
    waiting = [Path(file)]
    while waiting:
        path = waiting.pop()
        if path in found or not path.is_file():
            continue
        found[path] = path.read_bytes()
        names = _IMPORT.findall(found[path])
        waiting += [Path(__file__).with_name(f"{name.decode()}.py") for name in names]
    return tuple(sorted(hashlib.sha256(text).hexdigest() for text in found.values()))


def keep(dispatcher: Any, *more: Any) -> None:
    """Keep its compiled code while the sources behind it, and behind ``more``, are the same."""
    if not hasattr(dispatcher, "_cache"):  # nothing is compiled (NUMBA_DISABLE_JIT)
        return
    files = [d.py_func.__code__.co_filename for d in (dispatcher, *more)]
    dispatcher._cache = _Kept(dispatcher.py_func, tuple(_sources(file) for file in files))


class _Place:
    """What Numba asks a "locator" for; ours has nothing to look for."""

    def from_function(self, function: Any, file: str) -> _Place:
        return self

    def get_cache_path(self) -> str:
        return ""

    def ensure_cache_path(self) -> None:
        """The folder is made when something is written."""

    def get_source_stamp(self) -> str:
        return ""

    def get_disambiguator(self) -> str:
        return ""


class _Implementation(CompileResultCacheImpl):
    _locator_classes = [_Place()]  # type: ignore[assignment] # noqa: RUF012 - Numba's form


class _Kept(FunctionCache):
    _impl_class = _Implementation  # type: ignore[assignment]

    def __init__(self, function: Any, sources: tuple[tuple[str, ...], ...]) -> None:
        super().__init__(function)
        code = function.__code__
        name = f"{function.__qualname__}-{code.co_firstlineno}"
        self._cache_file = _Files(Path(code.co_filename).stem, name, _digest(repr(sources)))  # type: ignore[assignment]


class _Files:
    """The files of one kernel: a signature each."""

    def __init__(self, module: str, name: str, sources: str) -> None:
        self._module, self._name, self._sources = module, re.sub(r"[^\w.-]", "", name), sources

    def save(self, key: tuple[Any, ...], data: Any) -> None:
        folder = self._folder()
        if folder is None:
            return
        # A disk that is full, or a folder that has gone, only means that it is compiled again.
        with contextlib.suppress(OSError):
            if not folder.exists():
                folder.mkdir(parents=True, exist_ok=True)
                _clear(folder)
            path = folder / self._file(key)
            temporary = path.with_suffix(f".{os.getpid()}")
            try:
                temporary.write_bytes(dumps((key, data)))
                temporary.replace(path)
            finally:
                temporary.unlink(missing_ok=True)

    def load(self, key: tuple[Any, ...]) -> Any:
        folder = self._folder()
        if folder is None:
            return None
        try:
            kept, data = pickle.loads((folder / self._file(key)).read_bytes())
        except Exception:  # not there; or damaged, which pickle tells in any way
            return None
        _used(folder)
        return data if kept == key else None  # a digest says less than the whole signature

    def holds(self, key: tuple[Any, ...]) -> bool:
        """Whether there is a file for a signature."""
        folder = self._folder()
        return folder is not None and (folder / self._file(key)).is_file()

    def flush(self) -> None:
        """Numba's wish to forget what is kept."""
        folder = self._folder()
        for path in () if folder is None else folder.glob(f"{self._name}.*"):
            path.unlink(missing_ok=True)

    def _folder(self) -> Path | None:
        root = caches.compiled()
        if root is None:
            return None
        made_by = f"{sys.implementation.cache_tag}-numba-{numba.__version__}"
        return root / made_by / f"{self._module}-{self._sources}"

    def _file(self, key: tuple[Any, ...]) -> str:
        signature, *rest = key
        return f"{self._name}.{_digest(str((signature, rest)))}.nbc"


@cache
def _used(folder: Path) -> None:
    with contextlib.suppress(OSError):
        os.utime(folder)


def _clear(folder: Path) -> None:
    """Remove what was kept of the same module and has not been used for long."""
    module = folder.name.rsplit("-", 1)[0]
    for other in folder.parent.glob(f"{module}-*"):
        if time.time() - other.stat().st_mtime > KEPT_FOR:
            shutil.rmtree(other, ignore_errors=True)


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]
