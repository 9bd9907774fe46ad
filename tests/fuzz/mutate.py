"""Mutations: of text and bytes, of JSON values, of arrays. All from one random generator."""

from __future__ import annotations

import copy
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

Rng = np.random.Generator

NUMBERS = (
    b"0", b"-0", b"-1", b"1", b"9" * 19, b"9" * 400, b"9" * 5000, b"1e308", b"-1e308", b"1e309",
    b"1e-320", b"nan", b"inf", b"-inf", b"0x1F", b"1_0", b".", b"-", b"1e", b"0.1" + b"2" * 30,
    b"0.12345678901234567891x", b"2147483648", b"9223372036854775808", b"1" + b"0" * 30,
)  # fmt: skip
_NUMBER = re.compile(rb"-?\d+\.?\d*(?:e-?\d+)?")
_BYTES = (b"\0", b"\x1f", b"\xff", b"\xc3\xa9", b"\xed\xa0\x80", b"\r", b"\n", b"\t", b"{", b"}",
          b"[", b"]", b'"', b"'", b"=", b".", b"#", b":", b",", b"\\", b" ")  # fmt: skip


def text(rng: Rng, source: bytes, others: Sequence[bytes] = ()) -> bytes:
    """A text with one to four things changed."""
    for _ in range(int(rng.choice([1, 1, 1, 2, 4]))):
        source = _TEXT[int(rng.integers(len(_TEXT)))](rng, source, others)
    return source


def _flip(rng: Rng, source: bytes, _: Any) -> bytes:
    out = bytearray(source or b"\0")
    for _ in range(int(rng.choice([1, 1, 3]))):
        out[rng.integers(len(out))] ^= 1 << int(rng.integers(8))
    return bytes(out)


def _cut(rng: Rng, source: bytes, _: Any) -> bytes:
    a = int(rng.integers(len(source) + 1))
    return source[:a] if rng.random() < 0.3 else source[:a] + source[a + _length(rng) :]


def _double(rng: Rng, source: bytes, _: Any) -> bytes:
    a = int(rng.integers(len(source) + 1))
    part = source[a : a + _length(rng)]
    return source[:a] + part * int(rng.choice([2, 2, 3, 50])) + source[a + len(part) :]


def _put(rng: Rng, source: bytes, _: Any) -> bytes:
    a = int(rng.integers(len(source) + 1))
    return (
        source[:a]
        + _BYTES[rng.integers(len(_BYTES))] * int(rng.choice([1, 1, 2, 300]))
        + (source[a:])
    )


def _number(rng: Rng, source: bytes, _: Any) -> bytes:
    found = list(_NUMBER.finditer(source))
    if not found:
        return source
    m = found[rng.integers(len(found))]
    return source[: m.start()] + NUMBERS[rng.integers(len(NUMBERS))] + source[m.end() :]


def _lines(rng: Rng, source: bytes, _: Any) -> bytes:
    lines = source.split(b"\n")
    a, b = (int(k) for k in rng.integers(len(lines), size=2))
    way = rng.integers(3)
    if way == 0:
        del lines[a]
    elif way == 1:
        lines.insert(b, lines[a])
    else:
        lines[a], lines[b] = lines[b], lines[a]
    return b"\n".join(lines)


def _word(rng: Rng, source: bytes, _: Any) -> bytes:
    words: list[bytes] = re.split(rb"(\s+)", source)
    a, b = (int(k) // 2 * 2 for k in rng.integers(len(words), size=2))
    words[a] = b"" if rng.random() < 0.3 else words[b]
    return b"".join(words)


def _splice(rng: Rng, source: bytes, others: Sequence[bytes]) -> bytes:
    other = others[int(rng.integers(len(others)))] if others else source
    a, b = int(rng.integers(len(source) + 1)), int(rng.integers(len(other) + 1))
    return source[:a] + other[b : b + 4 * _length(rng)] + source[a + _length(rng) :]


_TEXT = (_flip, _cut, _double, _put, _number, _number, _lines, _word, _splice)


def _length(rng: Rng) -> int:
    return int(2 ** rng.uniform(0, 10))


EXTREMES = (
    None, True, False, -1, 0, 1, 2, 2**31, -(2**31) - 1, 2**63, 10**400, 0.5, 1e308, -1e308,
    5e-324, float("nan"), float("inf"), -float("inf"), "", "x", "0", "x" * 2000, "\x1b[2J", "\n",
    "\ud800", "café", [], {}, [[]], [None], {"": None}, [1, 2], [1.0, 2.0, 3.0], ["a", "b", "c"],
)  # fmt: skip


def _bottomless(rng: Rng) -> Any:
    out: Any = []
    for _ in range(int(rng.choice([40, 200]))):
        out = [out] if rng.random() < 0.9 else {"a": out}
    return out


def _places(value: Any, path: tuple = ()) -> list[tuple]:
    out = [path]
    if isinstance(value, dict):
        for k, v in value.items():
            out += _places(v, (*path, k))
    elif isinstance(value, list):
        for k, v in enumerate(value[:40]):
            out += _places(v, (*path, k))
    return out


def json_value(rng: Rng, value: Any) -> Any:
    """A JSON value with something in it changed, taken away, doubled or put elsewhere."""
    value = copy.deepcopy(value)
    places = _places(value)[1:]
    if not places:
        return EXTREMES[rng.integers(len(EXTREMES))]
    *way, key = places[int(rng.integers(len(places)))]
    inside = value
    for k in way:
        inside = inside[k]
    what = rng.integers(8)
    if what <= 3:
        inside[key] = copy.deepcopy(EXTREMES[rng.integers(len(EXTREMES))])
    elif what == 4:
        del inside[key]
    elif what == 5:
        inside[key] = _at(value, places[rng.integers(len(places))])
    elif what == 6 and isinstance(inside, list):
        inside *= 2
    elif what == 6:
        inside[str(EXTREMES[rng.integers(len(EXTREMES))])[:50]] = inside[key]
    elif isinstance(inside[key], int | float) and not isinstance(inside[key], bool):
        inside[key] = inside[key] * float(rng.choice([-1, 0, 1e-9, 1e9, 3])) + rng.integers(-1, 2)
    else:
        inside[key] = _bottomless(rng)
    return value


def _at(value: Any, place: tuple) -> Any:
    for k in place:
        value = value[k]
    return copy.deepcopy(value)


def arrays(rng: Rng, known: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Arrays of which one is another, or gone, or of another shape or type."""
    out = dict(known)
    if not out:
        return out
    name = str(rng.choice(sorted(out)))
    a = out[name]
    what = rng.integers(14)
    if what <= 5 and a.size:
        out[name] = _with_extremes(rng, a)
    elif what == 6:
        del out[name]
    elif what == 7:
        out[name] = a[: int(rng.integers(len(a) + 1))] if a.ndim else a
    elif what == 8:
        out[name] = np.concatenate([a, a]) if a.ndim else a
    elif what == 9:
        to = str(rng.choice(["f2", "f4", "f8", "i1", "i4", "i8", "u1", "u8", "?"]))
        with np.errstate(all="ignore"):
            out[name] = a.astype(to)
    elif what == 10:
        shapes = [(0,), (0, 3), (1, 0), (2**40, 0), (0, 2**40), (), (1,), (a.size,)]
        out[name] = np.resize(a, shapes[rng.integers(len(shapes))])
    elif what == 11:
        out[name] = out[str(rng.choice(sorted(out)))]
    elif what == 12 and a.ndim and len(a) < 10**7:  # of 2**40 empty rows there may be no order
        out[name] = rng.permutation(a)
    else:
        out[str(rng.choice(["x", "", "clips.", "clips.x", "table.first"]))] = a
    return out


def _with_extremes(rng: Rng, a: np.ndarray) -> np.ndarray:
    out = a.copy()
    flat = out.reshape(-1)
    count = int(rng.choice([1, 1, 1, flat.size]))
    at = slice(None) if count == flat.size else rng.integers(flat.size, size=1)
    if a.dtype.kind == "f":
        values = [0.0, -0.0, 1.0, -1.0, 1e-30, 1e6, -1e9, 1e30, np.nan, np.inf, -np.inf]
        top = float(np.finfo(a.dtype).max)
        flat[at] = np.array([*values, top, -top])[rng.integers(len(values) + 2)]
    elif a.dtype.kind in "iu":
        limits = np.iinfo(a.dtype)
        near = flat[rng.integers(flat.size)]
        values = [0, 1, limits.min, limits.max, int(flat.max()), int(near)]
        flat[at] = values[rng.integers(len(values))]
        if rng.random() < 0.5 and count == 1:
            with np.errstate(over="ignore"):
                flat[at] = near + np.array([-1, 1])[rng.integers(2)].astype(a.dtype)
    else:
        flat[at] = ~flat[at]
    return out
