"""Checks at the door: what comes from outside is what it should be, or one sentence says it is not.

Every check is told what it looks at ("clip 'walk': root_position") and returns the value as the
code behind it wants it. Dataclasses check their fields when they are made, so that whoever holds
one need not look again.
"""

from __future__ import annotations

import dataclasses
import functools
import numbers
import operator
import types
from collections.abc import Callable, Iterable, Mapping, Sequence
from math import inf, isfinite, nan
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from kumite.errors import KumiteError
from kumite.lazy import Later

if TYPE_CHECKING:
    import numpy as np
else:
    np = Later("numpy")

T = TypeVar("T")
Size = int | str  # of one axis of an array; a letter stands for any, the same one everywhere
Check = Callable[[Any, str], Any]  # of a value and what it is; the value as it is wanted

FAR = 1e9  # m, or units of a file: nobody and nothing is farther away
UNIT_WITHIN = 1e-3  # by which a quaternion's length may differ from 1
LONGEST_NAME = 1000  # characters
LEAST_FPS, MOST_FPS = 0.001, 100_000.0  # frames a second
_KINDS = {"f": "biuf", "i": "iuf", "u": "iuf", "b": "biuf"}  # of NumPy, that each may be made of
_CALLED = {"f": "numbers", "i": "whole numbers", "u": "whole numbers", "b": "true or false"}


def shown(value: object, longest: int = 60) -> str:
    """A value for a message: short, on one line, whatever it is."""
    try:
        text = repr(value)
    except Exception:  # an integer of too many digits; somebody's own __repr__
        text = f"a {type(value).__name__}"
    text = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)
    return text if len(text) <= longest else f"{text[: longest - 1]}…"


def a(value: type | object) -> str:
    """A type, or that of a value, with its article."""
    name = value.__name__ if isinstance(value, type) else type(value).__name__
    return "None" if name == "NoneType" else f"{'an' if name[0] in 'AEIOUaeio' else 'a'} {name}"


def instance(value: object, kind: type[T] | tuple[type, ...], what: str) -> T:
    """A value of a type, or of one of several. Errors: it is of another."""
    if not isinstance(value, kind):
        kinds = kind if isinstance(kind, tuple) else (kind,)
        raise KumiteError(f"{what}: {a(value)}; expected {' or '.join(a(k) for k in kinds)}")
    return value  # type: ignore[return-value]


def number(
    value: object,
    what: str,
    *,
    least: float = -inf,
    most: float = inf,
    above: float = -inf,
    unit: str = "",
) -> float:
    """A finite number, from least (or more than above) to most.

    Errors: no number, NaN, infinite, out of range.
    """
    try:
        if type(value) is float:
            found = value
        elif isinstance(value, bool) or not isinstance(value, numbers.Real):
            raise TypeError
        else:
            found = float(value)
    except (TypeError, ValueError, OverflowError):
        found = nan
    if not (isfinite(found) and least <= found <= most and found > above):
        limits = [f"more than {above:g}"] if above > -inf else []
        limits += [f"at least {least:g}"] if least > -inf else []
        limits += [f"at most {most:g}"] if most < inf else []
        wanted = " ".join(["a number", " and ".join(limits), unit]).replace("  ", " ").strip()
        raise KumiteError(f"{what}: {shown(value)}; expected {wanted}")
    return found


def whole(value: object, what: str, *, least: int | None = None, most: int | None = None) -> int:
    """A whole number, from least to most. Errors: no whole number; out of range."""
    try:
        if isinstance(value, bool):
            raise TypeError
        found = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise KumiteError(f"{what}: {shown(value)}; expected a whole number") from None
    low, high = (least if least is not None else found), (most if most is not None else found)
    if not low <= found <= high:
        limits = [f"at least {least}"] if least is not None else []
        limits += [f"at most {most}"] if most is not None else []
        raise KumiteError(f"{what}: {shown(value)}; expected {' and '.join(limits)}")
    return found


def flag(value: object, what: str) -> bool:
    """True or false. Errors: it is neither."""
    if not isinstance(value, bool | np.bool_):
        raise KumiteError(f"{what}: {shown(value)}; expected true or false")
    return bool(value)


def fps(value: object, what: str) -> float:
    """A frame rate. Errors: as :func:`number`."""
    return number(value, what, above=LEAST_FPS, most=MOST_FPS, unit="frames a second")


def text(value: object, what: str, *, longest: int = LONGEST_NAME) -> str:
    """A name or a line of text.

    Errors: no string; longer than that; control characters, which a terminal would obey; halves of
    characters, which no file can hold.
    """
    if not isinstance(value, str):
        raise KumiteError(f"{what}: {shown(value)}; expected text")
    if len(value) > longest:
        raise KumiteError(f"{what}: {len(value)} characters; expected at most {longest}")
    if not value.isprintable() and any(is_control(c) for c in value):
        raise KumiteError(f"{what}: {shown(value)}; expected no control characters")
    return value


def is_control(c: str) -> bool:
    """Whether a character is a control character (C0, DEL, C1) or half of a surrogate pair."""
    return c < " " or "\x7f" <= c <= "\x9f" or "\ud800" <= c <= "\udfff"


def names(value: object, what: str, *, unlike: bool = True, least: int = 0) -> tuple[str, ...]:
    """Names in order. Errors: no names; fewer than least; two alike, unless that is allowed."""
    if isinstance(value, str) or not isinstance(value, Iterable):
        raise KumiteError(f"{what}: {shown(value)}; expected names")
    out = tuple(text(v, what) for v in value)
    if len(out) < least:
        raise KumiteError(f"{what}: {len(out)}; expected at least {least}")
    if unlike and len(set(out)) != len(out):
        seen: set[str] = set()
        twice = sorted({n for n in out if n in seen or seen.add(n)})  # type: ignore[func-returns-value]
        raise KumiteError(f"{what} used twice: {', '.join(twice[:10])}")
    return out


def mapping(value: object, what: str) -> Mapping[str, Any]:
    """A mapping with names as keys. Errors: it is none."""
    if not isinstance(value, Mapping):
        raise KumiteError(f"{what}: {a(value)}; expected a mapping")
    for key in value:
        text(key, f"{what}: a key")
    return value


def array(
    value: object,
    what: str,
    shape: tuple[Size | Any, ...],
    dtype: type | np.dtype = float,
    *,
    least: float | None = None,
    most: float | None = None,
    finite: bool = True,
) -> np.ndarray:
    """An array of a shape and dtype, contiguous, its numbers finite and within least … most.

    shape: a size or a letter (any size) an axis; a leading ``...`` stands for any axes before.
    Errors: no array of numbers; another shape; numbers that the dtype cannot hold; out of range.
    """
    wanted = np.dtype(dtype)
    try:
        found = np.asarray(value)
    except (TypeError, ValueError, OverflowError):  # rows of different lengths
        raise KumiteError(f"{what}: {a(value)}; expected an array {_axes(shape)}") from None
    if found.dtype.kind not in _KINDS[wanted.kind] and found.size:
        raise KumiteError(
            f"{what}: {found.dtype if found.dtype.kind not in 'OUS' else a(value)}; "
            f"expected an array {_axes(shape)} of {_CALLED[wanted.kind]}"
        )
    if found.shape == (0,) and len(shape) > 1 and isinstance(shape[0], str):
        found = np.zeros((0, *(s if isinstance(s, int) else 0 for s in shape[1:])))  # [] is none
    _refuse_shape(found.shape, what, shape)
    if found.size == 0:
        return np.zeros(found.shape, wanted)
    if wanted.kind in "iu" and not np.can_cast(found.dtype, wanted):
        limits = np.iinfo(wanted)
        low, high = int(found.min()), int(found.max())
        if low < limits.min or high > limits.max:
            wrong = low if low < limits.min else high
            raise KumiteError(f"{what}: {wrong}; expected {limits.min} to {limits.max}")
    if wanted.kind in "iu" and found.dtype.kind == "f":
        odd = ~(np.isfinite(found) & (found == np.floor(found)))
        if odd.any():
            raise KumiteError(f"{what}: {found[odd].flat[0]}; expected whole numbers")
    if wanted.kind == "b" and found.dtype.kind != "b" and not np.isin(found, (0, 1)).all():
        raise KumiteError(f"{what}: expected true or false, or 1 and 0")
    with np.errstate(over="ignore", invalid="ignore"):
        out = np.ascontiguousarray(found, dtype=wanted)
    low, high = out.min(), out.max()  # NaN if any number is
    if wanted.kind == "f" and finite and not (np.isfinite(low) and np.isfinite(high)):
        place = np.unravel_index(int(np.argmin(np.isfinite(out))), out.shape)
        where = f" at {[int(i) for i in place]}" if place else ""
        raise KumiteError(f"{what}: {found[place]}{where}; expected finite numbers")
    if least is not None and low < least:
        raise KumiteError(f"{what}: {low}; expected at least {least:g}")
    if most is not None and high > most:
        raise KumiteError(f"{what}: {high}; expected at most {most:g}")
    return out


def rising(values: np.ndarray) -> bool:
    """Whether whole numbers [N] rise from each to the next; np.diff would wrap."""
    return bool(np.all(values[1:] > values[:-1]))


def unit_quaternions(wxyz: np.ndarray, what: str) -> np.ndarray:
    """Quaternions [..., 4] of unit length, as they are. Errors: one that is not."""
    off = np.abs(np.einsum("...k,...k->...", wxyz, wxyz, dtype=np.float64) - 1.0)
    if off.size and not off.max() <= 2 * UNIT_WITHIN:
        place = np.unravel_index(int(np.argmax(off)), off.shape)
        length = float(np.linalg.norm(wxyz[place].astype(np.float64)))
        where = [int(i) for i in place]
        raise KumiteError(f"{what}: a length of {length:g} at {where}; expected unit quaternions")
    return wxyz


def read_only(array: np.ndarray, given: object) -> np.ndarray:
    """An array that nobody writes to: a copy where it is the one that was given."""
    if array.flags.writeable:
        array = array.copy() if array is given else array
        array.flags.writeable = False
    return array


def freeze(
    record: object, what: str, finite: bool = True, /, **fields: tuple[type, tuple[Size, ...]]
) -> dict[str, int]:
    """Check a frozen dataclass' arrays, and make them read-only, in place.

    fields: name=(dtype, shape), shapes as their comments say: ``("F", 3)``. A letter is the same
    size in all of them. Numbers must be within ±``FAR``, or with ``finite`` False may be anything.
    Returns the letters' sizes. Errors: as :func:`array`, told as ``what``'s.
    """
    sizes: dict[str, int] = {}
    for name, (dtype, shape) in fields.items():
        given = getattr(record, name)
        wanted = tuple(sizes.get(s, s) if isinstance(s, str) else s for s in shape)
        far = FAR if finite and np.dtype(dtype).kind == "f" else None
        least = None if far is None else -far
        out = array(given, f"{what}: {name}", wanted, dtype, finite=finite, least=least, most=far)
        sizes.update({s: n for s, n in zip(shape, out.shape) if isinstance(s, str)})
        object.__setattr__(record, name, read_only(out, given))
    return sizes


def freeze_mapping(
    record: object, field: str, keys: Sequence[str], of: type, what: str
) -> Mapping[str, Any]:
    """Check a frozen dataclass' mapping, and keep it read-only, in the order of ``keys``.

    Errors: no mapping; another key; a value of another type.
    """
    given = mapping(getattr(record, field), what)
    for key, value in given.items():
        if key not in keys:
            raise KumiteError(f"{what}: {shown(key)}; expected one of {', '.join(keys)}")
        instance(value, of, f"{what}: {key}")
    kept = types.MappingProxyType({key: given[key] for key in keys if key in given})
    object.__setattr__(record, field, kept)
    return kept


# By annotation -----------------------------------------------------------------------------------


def rounded(digits: int) -> Check:
    """For ``Annotated``: a number, or each of several, to so many digits after the point."""

    def to_digits(value: Any, what: str) -> Any:
        if isinstance(value, tuple):
            return tuple(round(v, digits) for v in value)
        return round(value, digits)

    return to_digits


def one_of(*choices: str) -> Check:
    """For ``Annotated``: one of several words."""

    def check(value: str, what: str) -> str:
        if value not in choices:
            raise KumiteError(f"{what}: {shown(value)}; expected one of {', '.join(choices)}")
        return value

    return check


def above_zero(value: float, what: str) -> float:
    """For ``Annotated``: a number more than 0. Errors: it is not."""
    return number(value, what, above=0.0)


@functools.cache
def annotated(kind: type) -> tuple[tuple[str, Check], ...]:
    """The fields of a dataclass or a TypedDict, and what each annotation asks for."""
    return tuple((name, of_type(hint)) for name, hint in _annotations(kind).items())


def _annotations(kind: type) -> dict[str, Any]:
    hints = get_type_hints(kind, include_extras=True)
    if dataclasses.is_dataclass(kind):
        return {f.name: hints[f.name] for f in dataclasses.fields(kind)}
    return hints


def check_fields(record: object, what: str) -> None:
    """Check a frozen dataclass' fields by their annotations, in place. Errors: told as what's."""
    for name, passed, default, check in _checked(type(record)):
        given = getattr(record, name)
        if type(given) in passed or given is default:  # most are: thousands are made a second
            continue
        found = check(given, f"{what}: {name}")
        if found is not given:
            object.__setattr__(record, name, found)


@functools.cache
def _checked(kind: type) -> tuple[tuple[str, frozenset[type], Any, Check], ...]:
    """Of each field: its name, types of which every value will do, its default, its check."""
    defaults = {f.name: f.default for f in dataclasses.fields(kind)}  # type: ignore[arg-type]
    return tuple(
        (name, _will_do(hint), defaults[name], of_type(hint))
        for name, hint in _annotations(kind).items()
    )


def _will_do(annotation: Any) -> frozenset[type]:
    if get_origin(annotation) in (Union, types.UnionType):
        return frozenset().union(*(_will_do(a) for a in get_args(annotation)))
    return frozenset({annotation} & {bool, int, type(None)})


def of_type(annotation: Any) -> Check:
    """What checks a value of a type: a plain one, a union, a tuple, a mapping by names, or
    ``Annotated`` with more checks, which are made in order.
    """
    origin, args = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        first, *more = of_type(args[0]), *args[1:]

        def in_order(value: Any, what: str) -> Any:
            value = first(value, what)
            for check in more:
                value = check(value, what)
            return value

        return in_order
    if origin in (Union, types.UnionType):
        return _union([a for a in args if a is not type(None)], type(None) in args)
    if origin is tuple:
        return _items(args)
    if origin is not None and issubclass(origin, Mapping):
        each = of_type(args[1])
        return lambda value, what: {
            name: each(part, f"{what} of {name!r}") for name, part in mapping(value, what).items()
        }
    return _PLAIN[annotation]


_PLAIN: dict[Any, Check] = {
    bool: flag,
    int: whole,
    float: number,
    str: text,
    Any: lambda value, what: value,
}


def _union(kinds: list[Any], none: bool) -> Check:
    several = [of_type(kind) for kind in kinds]

    def any_of(value: Any, what: str) -> Any:
        if none and value is None:
            return None
        if len(several) == 1:
            return several[0](value, what)
        errors = []
        for check in several:
            try:
                return check(value, what)
            except KumiteError as error:
                errors.append(error)
        raise errors[0]

    return any_of


def _items(kinds: tuple[Any, ...]) -> Check:
    """Of a tuple: so many values, or any number of one kind."""
    kind, any_number = kinds[0], kinds[-1] is ...
    if kind is str:
        return lambda value, what: names(value, what, unlike=False)
    shape: tuple[Size, ...] = ("N",) if any_number else (len(kinds),)
    return lambda value, what: tuple(array(value, what, shape, kind).tolist())


def _refuse_shape(found: tuple[int, ...], what: str, shape: tuple[Size | Any, ...]) -> None:
    open_ = bool(shape) and shape[0] is ...
    wanted = shape[1:] if open_ else shape
    tail = found[len(found) - len(wanted) :] if open_ else found
    if len(tail) != len(wanted) or any(isinstance(w, int) and n != w for n, w in zip(tail, wanted)):
        raise KumiteError(f"{what} is {list(found)}, expected {_axes(shape)}")


def _axes(shape: tuple[Size | Any, ...]) -> str:
    return "[" + ", ".join("…" if s is ... else str(s) for s in shape) + "]"
