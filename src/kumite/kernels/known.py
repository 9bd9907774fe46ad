"""The kernels that scenes call, with the types they are called with: a table beside this file.

A line of it says what needs a kernel, about how long compiling takes [s], its name, and the types
of its arguments: ``f8``, ``b1``, … numbers, ``f8.2C`` an array of two dimensions, rows together (a
``!`` at the end: read-only), ``(…)`` a tuple, ``module:Class(…)`` a named one.
"""

# pyright: reportAttributeAccessIssue=false, reportGeneralTypeIssues=false

from __future__ import annotations

import importlib
import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numba.core import types
from numba.np.numpy_support import as_dtype, from_dtype

from kumite.kernels.within import KERNELS

TABLE = Path(__file__).with_name("known.txt")
_TOKEN = re.compile(r"[^(),]+|[(),]")
_NUMBERS = {spelt: from_dtype(np.dtype(spelt)) for spelt in ("i4", "i8", "u8", "f4", "f8", "b1")}
_SPELT = {found: spelt for spelt, found in _NUMBERS.items()}


class Known(NamedTuple):
    """A kernel that is called with arguments of some types."""

    needs: tuple[str, ...]  # what needs it
    seconds: float  # that compiling took where the table was made
    name: str  # module and name
    types: str  # of its arguments


def known() -> list[Known]:
    """The table."""
    rows = []
    for line in TABLE.read_text("utf-8").splitlines():
        needs, seconds, name, spelt = line.split(" ")
        rows.append(Known(tuple(needs.split(",")), float(seconds), name, spelt))
    return rows


def spell(found: Any) -> str:
    """A Numba type, or a tuple of them, in the words of the table."""
    if found in _SPELT:
        return _SPELT[found]
    if isinstance(found, types.Array):
        spelt = f"{as_dtype(found.dtype).str[1:]}.{found.ndim}{found.layout}"
        return spelt if found.mutable else f"{spelt}!"
    if isinstance(found, types.BaseNamedTuple):
        of = found.instance_class
        return f"{of.__module__}:{of.__qualname__}({','.join(spell(t) for t in found.types)})"
    if isinstance(found, tuple | types.BaseTuple):
        return f"({','.join(spell(t) for t in found)})"
    if found == types.none:
        return "none"
    raise ValueError(f"no words for type {found}")


def read_types(spelt: str) -> Any:
    """The tuple of Numba types that :func:`spell` spelt."""
    return tuple(_read(iter(_TOKEN.findall(spelt)), next_is_tuple=True))


def _read(tokens: Any, next_is_tuple: bool = False) -> list[Any]:
    """The types up to the bracket that closes, the opening one being next or read already."""
    if next_is_tuple:
        next(tokens)
    found: list[Any] = []
    name = ""
    for token in tokens:
        if token == "(":
            inner = _read(tokens)
            if name:
                module, of = name.split(":")
                of = getattr(importlib.import_module(module), of)
                found.append(types.BaseTuple.from_types(inner, of))
            else:
                found.append(types.BaseTuple.from_types(inner))
            name = ""
            continue
        if token in ",)":
            if name:
                found.append(_simple(name))
            name = ""
            if token == ")":
                return found
            continue
        name = token
    return found


def _simple(spelt: str) -> Any:
    if spelt == "none":
        return types.none
    number, _, shape = spelt.partition(".")
    if not shape:
        return _NUMBERS[number]
    dtype = from_dtype(np.dtype(number))
    return types.Array(dtype, int(shape[0]), shape[1], readonly=shape.endswith("!"))


def forget() -> None:
    """Forget which kernels were called; their code is read anew from the cache."""
    for kernel in KERNELS.values():
        kernel._reset_overloads()


def called() -> set[tuple[str, str]]:
    """The names and types of the kernels of this package called since, as the table spells them."""
    return {
        (name, spell(args))
        for name, kernel in KERNELS.items()
        if name.startswith("kumite.")
        for args in kernel.overloads
    }
