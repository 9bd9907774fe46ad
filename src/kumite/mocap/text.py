"""Text files of numbers: reading them whole, fast, and saying exactly where one is wrong."""

from __future__ import annotations

import codecs
import contextlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kumite.errors import KumiteError, at, short
from kumite.kernels import parse

LARGEST = 1e9  # a length or angle beyond this is damage, and its square would overflow further on
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_NOT_MOTION = {  # what downloads leave in a file's place
    b"version https://git-lfs": "a pointer of Git LFS, not the file itself (git lfs pull)",
    b"<!doctype": "a web page",
    b"<html": "a web page",
}
_ENCODING = "say --encoding, or encoding in kumite.toml"
_SHOWN = 40  # characters of a bad token that an error repeats


def read_bytes(path: Path) -> bytes:
    """A UTF-8 file's bytes with ``\\n`` line ends and no byte order mark.

    Errors: missing, unreadable, empty, not text.
    """
    data = _bytes(path).removeprefix(codecs.BOM_UTF8)
    if data[:2] in _UTF_16 or b"\0" in data[:4096]:
        raise KumiteError(f"{path}: not a plain text file; expected UTF-8")
    return _line_ends(data)


def read_text(path: Path, encoding: str | None = None) -> tuple[bytes, tuple[str, ...]]:
    """A text file's bytes as UTF-8 with ``\\n`` line ends, and a note if it was something else.

    A file in no stated encoding that is not UTF-8 is taken for Shift-JIS where it holds bytes that
    Western text has not, else for Western text (Windows-1252).

    Errors: missing, unreadable, empty, not text; an unknown encoding, bytes that it has not.
    """
    data = _bytes(path)
    if encoding is not None:
        return _line_ends(_transcoded(path, data, encoding)), ()
    if data[:2] in _UTF_16:
        return _line_ends(_transcoded(path, data, "utf-16")), ("read as UTF-16",)
    data = data.removeprefix(codecs.BOM_UTF8)
    if b"\0" in data[:4096]:
        raise KumiteError(f"{path}: not a plain text file; expected text, such as UTF-8")
    for start, what in _NOT_MOTION.items():
        if data[:200].lstrip().lower().startswith(start):
            raise KumiteError(f"{path}: {what}; expected motion capture")
    if data.isascii():
        return _line_ends(data), ()
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        name, text = _guessed(data)
        return _line_ends(text.encode("utf-8")), (f"not UTF-8, read as {name}; else {_ENCODING}",)
    return _line_ends(data), ()


def _bytes(path: Path) -> bytes:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise KumiteError(f"{short(path)}: cannot be read ({error.strerror})") from None
    except ValueError:  # a path with a NUL in it
        raise KumiteError(f"{short(path)!r}: not a path") from None
    if not data.removeprefix(codecs.BOM_UTF8).strip():
        raise KumiteError(f"{path}: the file is empty")
    return data


def _line_ends(data: bytes) -> bytes:
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in data else data


def _transcoded(path: Path, data: bytes, encoding: str) -> bytes:
    try:
        return data.decode(encoding).removeprefix("\ufeff").encode("utf-8")
    except (LookupError, AttributeError, TypeError, ValueError) as error:
        if isinstance(error, UnicodeDecodeError):
            line = data.count(b"\n", 0, error.start) + 1
            byte = f"byte 0x{data[error.start]:02x} is not {shown(encoding)}"
            raise at(path, line, f"{byte}; expected another encoding") from None
        raise KumiteError(
            f"unknown encoding {shown(encoding)}; expected one that Python knows, such as "
            "shift_jis, cp1252, gbk or euc_kr"
        ) from None


def _guessed(data: bytes) -> tuple[str, str]:
    """The name of an 8-bit encoding, and the text of ``data`` in it."""
    if re.search(rb"[\x81-\x9f\xe0-\xfc][\x40-\xfc]", data) and re.search(rb"[\x81-\x9f]", data):
        with contextlib.suppress(UnicodeDecodeError):
            return "Shift-JIS", data.decode("cp932")
    try:
        return "Windows-1252", data.decode("cp1252")
    except UnicodeDecodeError:
        return "Latin-1", data.decode("latin-1")


def decode(path: Path, data: bytes, line: int = 1) -> str:
    """UTF-8 text of ``data``, which begins at ``line``. Errors: another encoding, with its line."""
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        line += data.count(b"\n", 0, error.start)
        raise at(
            path, line, f"byte 0x{data[error.start]:02x} is not UTF-8; expected a UTF-8 text file"
        ) from None


def shown(token: str | bytes) -> str:
    """A token as an error repeats it: quoted, on one line, not too long."""
    if isinstance(token, bytes):
        token = token.decode("utf-8", "replace")
    return repr(token if len(token) <= _SHOWN else token[:_SHOWN] + "…")


def number(path: Path, line: int, token: str | bytes, what: str) -> float:
    """One finite number. Errors: anything else, with file, line, token and ``what`` it is for."""
    text = token.decode("utf-8", "replace") if isinstance(token, bytes) else token
    if not _NUMBER.fullmatch(text):
        if _NUMBER.fullmatch(text.replace(",", ".", 1)):
            what = f"a decimal point, and {what}"
        raise at(path, line, f"{shown(text)} is not a number; expected {what}")
    value = float(text)
    if not abs(value) <= LARGEST:
        raise at(path, line, f"{shown(text)} is beyond ±{LARGEST:g}; expected {what}")
    return value


@dataclass(frozen=True)
class Table:
    """What :func:`read_table` found."""

    values: np.ndarray  # numbers in the order of the text, flat
    tokens: int
    refused: int | None  # first byte of a token that does not fit its column, if any
    broken: int | None = None  # byte of the first line end within a period, if any


def read_table(data: bytes, columns: Sequence[str | None]) -> Table:
    """Numbers of a text whose tokens repeat with ``columns``: a word, or None for a number.

    Never allocates by what a file declares, only by what it holds. Numbers are those that
    ``float`` gives, bit for bit.
    """
    words = sorted({c for c in columns if c is not None})
    blobs = [w.encode() for w in words]
    word_start = np.concatenate([[0], np.cumsum([len(b) for b in blobs])]).astype(np.int64)
    number_of = {w: k for k, w in enumerate(words)}
    column_word = np.array([parse.NO_BYTE if c is None else number_of[c] for c in columns], int)
    # The shortest token and the space after it take two bytes; untouched pages cost nothing.
    most = len(data) // 2 + 1
    out = np.empty(most)
    inexact = np.empty((most, 3), dtype=np.int64)
    tokens, numbers, hard, refused, broken = parse.parse_table(
        np.frombuffer(data, np.uint8),
        np.frombuffer(b"".join(blobs) or b"\0", np.uint8),
        word_start,
        column_word,
        out,
        inexact,
    )
    for k, a, b in inexact[:hard].tolist():
        out[k] = float(data[a:b])
    values = out[:numbers].copy()
    if refused == parse.NO_BYTE and not np.all(np.abs(values) <= LARGEST):
        index = int(np.argmax(~(np.abs(values) <= LARGEST)))
        return Table(values, tokens, _byte_of_number(data, columns, index))
    return Table(values, tokens, _byte(refused), _byte(broken))


def _byte(found: int) -> int | None:
    return None if found == parse.NO_BYTE else int(found)


def _byte_of_number(data: bytes, columns: Sequence[str | None], index: int) -> int:
    """Where the number of this index begins."""
    seen = -1
    for k, match in enumerate(re.finditer(rb"[^\x00-\x20]+", data)):
        if columns[k % len(columns)] is None:
            seen += 1
            if seen == index:
                return match.start()
    raise AssertionError("the number was counted but is not there")


def token_at(data: bytes, start: int) -> bytes:
    """The token that begins at a byte."""
    match = re.compile(rb"[^\x00-\x20]*").match(data, start)
    return match.group() if match else b""


# Frame rates -------------------------------------------------------------------------------------

_RATES = np.concatenate([np.arange(1, 1001), np.array([24, 30, 60, 120, 240]) / 1.001])


def rate_of(frame_time: float, text: str) -> float:
    """Frames a second of a frame time that was written with few digits.

    ``0.033333`` is 30, not 30.0003: the usual rate that prints as ``text``, within one unit of its
    last digit and one per cent; otherwise simply the inverse.
    """
    mantissa, _, exponent = text.lower().partition("e")
    decimals = len(mantissa.partition(".")[2]) - (int(exponent[:6]) if exponent else 0)
    decimals = max(min(decimals, 300), -300)
    unit = 10.0**-decimals
    exact = 1.0 / frame_time
    if np.any(np.abs(_RATES - exact) < 1e-9 * exact):
        return float(_RATES[np.argmin(np.abs(_RATES - exact))])
    near = _RATES[np.argmin(np.abs(_RATES - exact))]
    if abs(1.0 / near - frame_time) <= unit and abs(near / exact - 1) <= 0.0101:
        return float(near)
    return exact
