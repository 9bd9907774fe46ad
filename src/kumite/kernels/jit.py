"""The one way in which kernels are compiled."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from types import FunctionType
from typing import Any

from numba.core import config

from kumite.kernels import kept
from kumite.kernels.within import Kernel


def _compiled(function: Callable[..., Any], *plugs: Any, **options: Any) -> Any:
    if config.DISABLE_JIT:  # pyright: ignore[reportAttributeAccessIssue]
        return function
    made = Kernel(function, nogil=True, error_model="numpy", **options)
    kept.keep(made, *plugs)
    return made


# error_model="numpy": no exceptions inside loops. Of fast-math only contraction (fused
# multiply-add): nothing is reordered, so a run gives the same bytes as the last, whatever the
# number of threads.
def kernel(function: Callable[..., Any]) -> Any:
    """A function that is compiled when it is first called, and kept."""
    return _compiled(function, fastmath={"contract"})


def lean_kernel(function: Callable[..., Any]) -> Any:
    """A kernel that must neither make arrays nor return any to a kernel that is not lean.

    Numba counts who uses an array whenever a tuple of arrays is looked into, one count for all
    cores: most of the time of small kernels that are handed large tuples. These count nothing.
    """
    return _compiled(function, fastmath={"contract"}, _nrt=False)  # not a public option


def parallel_kernel(function: Callable[..., Any]) -> Any:
    """A kernel whose ``prange`` loops run on all cores.

    It is compiled under a name of its own: kept code is found by file, name, line and types, so a
    function that is compiled both ways would otherwise be read in the way that came first.
    """
    copy = FunctionType(function.__code__, function.__globals__, function.__name__)
    copy.__qualname__ = f"{function.__qualname__}_on_all_cores"
    copy.__doc__ = function.__doc__
    return _compiled(copy, fastmath={"contract"}, parallel=True)


def plugged(template: Callable[..., Any], parallel: bool = False, **plugs: Any) -> Any:
    """A kernel made of a plain function in which each name in ``plugs`` is the kernel given.

    It is kept on disk like any other, which neither a closure over kernels nor a kernel as an
    argument is: Numba finds kept code by their identity, which is new in every process. Here it is
    found by the module and the name of the plugs, so these must be functions of a module. Outside
    of this folder only the plugs' own files are watched for changes, not those they call.

    Nothing is contracted: a sum in the template must not depend on whether a plug was inlined.
    """
    names = [template.__qualname__, str(parallel)]
    for name, plug in sorted(plugs.items()):
        plain = getattr(plug, "py_func", plug)
        if "<" in plain.__qualname__:
            raise TypeError(f"{plain.__qualname__}: only functions of a module can be plugged in")
        names += [name, plain.__module__, plain.__qualname__]
    code = template.__code__
    copy = FunctionType(code, {**template.__globals__, **plugs}, template.__name__)
    copy.__qualname__ = f"{template.__qualname__}_{_digest(names)}"
    copy.__doc__ = template.__doc__
    return _compiled(copy, *plugs.values(), parallel=parallel)


def _digest(names: list[str]) -> str:
    return hashlib.sha256("\0".join(names).encode()).hexdigest()[:12]
