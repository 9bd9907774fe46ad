"""Where is kept what can be made again: the one place that knows.

====================================  =====================================================
the user's cache folder for Kumite    libraries, performances and policies of the built-in
                                      performer; kernels in its folder ``compiled``
``KUMITE_CACHE``                      names another folder for all of it
``NUMBA_CACHE_DIR``                   names another folder for the kernels
``LIBRARY.kumite.cache``              policies of a library, beside it
====================================  =====================================================
"""

from __future__ import annotations

import atexit
import logging
import os
import shutil
import tempfile
from functools import cache
from pathlib import Path

from platformdirs import user_cache_dir

NAME = "KUMITE_CACHE"


def root() -> Path | None:
    """The folder of everything, made; a temporary one where none can be written, or None."""
    named = os.environ.get(NAME)
    return _usable(named or os.path.expanduser(user_cache_dir("kumite", appauthor=False)))  # noqa: PTH111


def compiled() -> Path | None:
    """The folder of compiled kernels."""
    named = os.environ.get("NUMBA_CACHE_DIR")
    if named:
        return _usable(named)
    folder = root()
    return None if folder is None else folder / "compiled"


def cache_folder(library_path: Path | str | None) -> Path | None:
    """The folder of what belongs to a library; for None, the built-in performer's."""
    return root() if library_path is None else Path(f"{library_path}.cache")


@cache
def _usable(folder: str) -> Path | None:
    try:
        if folder.startswith("~"):  # nobody's home
            raise OSError("this user has no home")
        Path(folder).mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
        return Path(folder)
    except OSError as error:
        return _temporary(folder, error.strerror or str(error))


_TEMPORARY: list[Path | None] = []  # made once, whatever cannot be written


def _temporary(instead_of: str, reason: str) -> Path | None:
    if not _TEMPORARY:
        try:
            _TEMPORARY.append(Path(tempfile.mkdtemp(prefix="kumite-")))
        except OSError:
            _TEMPORARY.append(None)
        where = _TEMPORARY[0]
        if where is not None:
            os.environ[NAME] = str(where)  # processes that this one starts use it, too
            atexit.register(shutil.rmtree, where, ignore_errors=True)
        logging.getLogger("kumite").warning(
            "%s cannot be written (%s): kernels are compiled anew each time; "
            "name a folder to keep them in with %s",
            instead_of,
            reason,
            NAME,
        )
    return _TEMPORARY[0]
