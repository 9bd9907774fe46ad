"""Public functions and classes say in one sentence what they were handed instead of what they take.

:func:`checked` compares what is handed over with the types that a signature states, each time it is
called, so that a wrong one is not met deep inside, in another library's words. What arrays and
numbers mean is checked by who uses them.
"""

from __future__ import annotations

import functools
import inspect
import numbers
import operator
import sys
import types
from collections import abc
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar, Union, get_args, get_origin

from kumite.checks import a, shown
from kumite.errors import KumiteError
from kumite.lazy import Later

if TYPE_CHECKING:
    import numpy as np
else:
    np = Later("numpy")

F = TypeVar("F", bound=Callable)
_ROWS = (abc.Sequence, abc.Collection, abc.Iterable, list, tuple)


@dataclass(frozen=True)
class _Kind:
    """What a value is to be: how to tell, and what it is called."""

    fits: Callable[[Any], bool]
    name: str
    numbers: bool = False  # whether it is one or several of them, which arrays hold, too


def checked(of: F) -> F:
    """A function, or a class as it is made, that refuses arguments of other types than it states.

    Errors of what it gives back: a KumiteError that names the argument and what was expected. What
    is stated in words that say nothing here (a protocol, a type variable) is not looked at.
    """
    if isinstance(of, type):
        of.__init__ = _checked(of.__init__, of.__name__)  # type: ignore[misc]
        return of  # pyright: ignore[reportReturnType] - the class that it was
    return _checked(of, of.__name__)


def _checked(function: Any, name: str) -> Any:
    @functools.wraps(function)
    def call(*args: Any, **given: Any) -> Any:
        places, kinds = _wanted(function)
        for place, value in (*zip(places, args), *given.items()):
            kind = kinds.get(place)
            if kind is not None and not kind.fits(value):
                what = shown(value) if isinstance(value, str | float | int) else a(value)
                nan = ", none of them NaN" if _holds_nan(value) else ""
                raise KumiteError(f"{name}: {place}: {what}; expected {kind.name}{nan}")
        return function(*args, **given)

    return call


@functools.cache
def _wanted(function: Any) -> tuple[list[str], dict[str, _Kind]]:
    """Names of arguments in order; what those are to be of which it is known."""
    known = dict(vars(sys.modules[function.__module__]))
    places, kinds = [], {}
    for p in inspect.signature(function).parameters.values():
        if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD):
            places.append(p.name)
        if p.kind in (p.VAR_POSITIONAL, p.VAR_KEYWORD) or p.annotation is p.empty:
            continue
        try:
            hint = (
                eval(p.annotation, dict(known)) if isinstance(p.annotation, str) else p.annotation
            )
        except NameError:  # known to type checkers only
            continue
        kind = _kind(hint)
        if kind is not None:
            kinds[p.name] = kind
    return places, kinds


def _kind(hint: Any) -> _Kind | None:
    origin, args = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        parts = [_kind(part) for part in args]
        if any(part is None for part in parts):
            return None
        some = [part for part in parts if part is not None]
        return _Kind(
            lambda v: any(part.fits(v) for part in some), " or ".join(part.name for part in some)
        )
    if origin is Literal:
        return _Kind(lambda v: v in args, " or ".join(map(repr, args)))
    if origin is not None and origin in _ROWS:
        return _rows(origin, args)
    if hint in _PLAIN:
        return _PLAIN[hint]
    if getattr(hint, "__name__", "") == "ndarray":
        return _Kind(_is_array, "an array of numbers")
    if origin in (dict, abc.Mapping):
        hint = abc.Mapping
    if origin is abc.Callable or hint is abc.Callable:
        return _Kind(callable, "a function")
    if not isinstance(hint, type) or getattr(hint, "_is_protocol", False) or hint is object:
        return None
    return _Kind(lambda v: isinstance(v, hint), a(hint))


def _rows(origin: Any, args: tuple[Any, ...]) -> _Kind:
    """Several of a kind: a tuple, a list, an array; text is one value, not several."""
    several = args[:1] if len(args) == 1 or args[1:] == (Ellipsis,) else args
    each = [_kind(part) for part in several]
    length = None if len(several) == 1 or origin is not tuple else len(several)
    of_numbers = all(kind is not None and kind.numbers for kind in each)
    rows = abc.Iterable if origin in (abc.Iterable, abc.Collection) else abc.Sequence
    names = [kind.name if kind else "a value" for kind in each]

    def fits(value: Any) -> bool:
        if type(value).__name__ == "ndarray":
            if not of_numbers or value.dtype.kind not in "biuf" or value.ndim == 0:
                return False
            return length is None or value.shape == (length,)
        if isinstance(value, str | bytes | abc.Mapping) or not isinstance(value, rows):
            return False
        if isinstance(value, abc.Iterator):  # it can be gone through only once
            return True
        found = tuple(value)
        kinds = each if length is not None else each * len(found)
        return len(found) == len(kinds) and all(
            kind is None or kind.fits(v) for kind, v in zip(kinds, found)
        )

    if length is not None:
        return _Kind(fits, f"{length} values ({', '.join(names)})", of_numbers)
    return _Kind(fits, f"several, each {names[0]}", of_numbers)


def _holds_nan(value: Any) -> bool:
    """Whether it is NaN, or a list or tuple of which a value is."""
    values = value if isinstance(value, list | tuple) else (value,)
    return any(isinstance(v, float) and v != v for v in values)


def _is_number(value: Any) -> bool:
    real = isinstance(value, numbers.Real) and not isinstance(value, bool)
    return real and value == value


def _is_whole(value: Any) -> bool:
    try:
        operator.index(value)
    except TypeError:
        return False
    return not isinstance(value, bool)


def _is_array(value: Any) -> bool:
    if type(value).__name__ == "ndarray":
        return value.dtype.kind in "biuf"
    if isinstance(value, str | bytes | abc.Mapping) or not isinstance(value, abc.Sequence):
        return False
    try:
        return np.asarray(value).dtype.kind in "biuf"
    except (TypeError, ValueError, OverflowError):
        return False


_PLAIN: dict[Any, _Kind] = {
    None: _Kind(lambda v: v is None, "None"),
    type(None): _Kind(lambda v: v is None, "None"),
    float: _Kind(_is_number, "a number", True),
    int: _Kind(_is_whole, "a whole number", True),
    bool: _Kind(lambda v: isinstance(v, bool) or type(v).__name__ == "bool", "true or false"),
    str: _Kind(lambda v: isinstance(v, str), "text"),
    Path: _Kind(lambda v: isinstance(v, Path), "a path"),
}
