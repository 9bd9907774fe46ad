"""A user's TOML, checked by name: every problem at once, with its line and the valid choices."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from kumite.errors import KumiteError, at

MOST_CHARACTERS = 4_000_000  # of a text
MOST_PARTS = 32  # of a dotted key: time to parse grows with their square
_MOST_PROBLEMS = 20  # told at once
_PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')\s*+"""
_DEEP_KEY = re.compile(rf"(?<![\w-])(?:{_PART}\.\s*+){{{MOST_PARTS}}}")

Model = TypeVar("Model", bound=BaseModel)


def parse(source: str, where: Path | str, model: type[Model]) -> Model:
    """The settings that a text holds.

    Errors: not TOML; unknown, missing and wrong keys; more than a person writes.
    """
    _refuse_monsters(source, where)
    try:
        return model.model_validate(tomllib.loads(source))
    # ValueError: a TOMLDecodeError is one, and so is what int() says of a number of 5,000 digits.
    except ValidationError as error:
        raise KumiteError("\n".join(_problems(where, source, model, error))) from None
    except (ValueError, OverflowError, RecursionError) as error:
        line = re.search(r"at line (\d+)", str(error))
        raise at(where, int(line[1]) if line else None, f"not TOML: {error}") from None


def _refuse_monsters(source: str, where: Path | str) -> None:
    """Errors: a text or a key that would take long to parse, and that nobody means."""
    if len(source) > MOST_CHARACTERS:
        what = f"{len(source)} characters; expected at most {MOST_CHARACTERS}"
        raise KumiteError(f"{where}: {what}")
    deep = _DEEP_KEY.search(source)
    if deep is not None:
        line = source.count("\n", 0, deep.start()) + 1
        raise at(where, line, f"a key of more than {MOST_PARTS} parts; expected fewer dots")


def _problems(
    where: Path | str, source: str, model: type[BaseModel], error: ValidationError
) -> list[str]:
    out = []
    for problem in error.errors()[:_MOST_PROBLEMS]:
        place = problem["loc"]
        key = ".".join(repr(k) if "." in str(k) else str(k) for k in place)
        message = problem["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
        if problem["type"] == "extra_forbidden":
            what = f"unknown key {key!r}; expected one of {', '.join(_keys(model, place[:-1]))}"
        elif problem["type"] == "missing":
            what = f"{key}: missing; expected a value"
        elif problem["type"] == "value_error":  # raised by a model of ours: it says it all
            what = f"{key}: {message}" if key else message
        else:
            given = _shown(problem["input"])
            limits = problem.get("ctx", {})
            if "too_short" in problem["type"]:
                message = f"at least {limits['min_length']}"
            elif "too_long" in problem["type"]:
                message = f"at most {limits['max_length']}"
            what = f"{key}: {given}; expected {message}"
        out.append(f"{at(where, line_of(source, *place), what)}")
    more = error.error_count() - len(out)
    return out + ([f"{where}: and {more} more"] if more > 0 else [])


def _shown(value: Any) -> str:
    try:
        given = repr(value)
    except ValueError:  # an integer of more digits than Python prints
        return "a number of thousands of digits"
    return given if len(given) < 80 else given[:77] + "…"


def _keys(model: type[BaseModel], place: tuple[int | str, ...]) -> list[str]:
    """The keys that the table at a place may hold."""
    found = [model]
    for part in place:  # a number, or a name that is nobody's field, is an entry of several
        fields = [m.model_fields[str(part)] for m in found if str(part) in m.model_fields]
        if fields:
            found = [m for field in fields for m in _models(field.annotation)]
    return sorted(
        {k for m in found for k, f in m.model_fields.items() if f.annotation is not type(None)}
    )


def _models(hint: Any) -> list[type[BaseModel]]:
    """The tables that a hint speaks of, however deep within it."""
    if isinstance(hint, type) and issubclass(hint, BaseModel):
        return [hint]
    return [model for part in get_args(hint) for model in _models(part)]


def line_of(source: str, *place: int | str) -> int | None:
    """The line on which a key stands, as far as its text tells; else its table's line.

    A number counts the ``[[tables]]`` of the name before it.
    """
    lines = [line.partition("#")[0] for line in source.split("\n")]
    found: int | None = None
    begin, end = 0, len(lines)
    for part, following in zip(place, [*place[1:], None]):
        if isinstance(part, int):
            continue
        name = re.escape(part)
        if isinstance(following, int):
            header = re.compile(rf"\s*\[\[\s*[\"']?{name}[\"']?\s*\]\]")
            tables = [n for n in range(begin, end) if header.match(lines[n])]
            if following < len(tables):
                found = begin = tables[following]
                rest = range(begin + 1, end)
                end = next((n for n in rest if lines[n].lstrip().startswith("[")), end)
                continue
        dot = "" if following is None else "."  # "a" is not the key "a.bvh", but leads to "a.b"
        key = re.compile(rf"(^|[\s.\[\"'{{,]){name}([\s\"'=\]{dot}]|$)")
        at_line = next((n for n in range(begin, end) if key.search(lines[n])), None)
        if at_line is None:
            break
        found = begin = at_line
    return None if found is None else found + 1
