"""The one way in which kernels are compiled."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit

# Numba keeps compiled code while the function's own file is the same; but a kernel holds the code
# and the constants of those it calls in other files. So what is kept is kept for all files at once.
_SOURCES = hashlib.sha256(
    b"".join(path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))
).hexdigest()


def _kept_while_all_sources_are(decorate: Callable[..., Any]) -> Callable[..., Any]:
    def compile_lazily(function: Callable[..., Any]) -> Any:
        dispatcher = decorate(function)
        # Not a public name; where it is gone (or nothing is compiled) Numba's own rule holds.
        with contextlib.suppress(AttributeError):
            dispatcher._cache._cache_file._source_stamp = _SOURCES
        return dispatcher

    return compile_lazily


# error_model="numpy": no exceptions inside loops. Of fast-math only contraction (fused
# multiply-add): nothing is reordered, so a run gives the same bytes as the last, whatever the
# number of threads.
kernel = _kept_while_all_sources_are(
    njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
)
parallel_kernel = _kept_while_all_sources_are(
    njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, parallel=True)
)
