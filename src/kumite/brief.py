"""How values that hold arrays show themselves: in a line or two, and in a notebook as a picture."""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence, Set
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")

MOST_WORDS = 3  # of a sequence of short values: more are counted
LONGEST = 60  # characters of one value

# Pictures are drawn by a layer above, which is named here and imported when one is shown.
PICTURES = "kumite.export.notebook"


def brief(cls: type[T]) -> type[T]:
    """Give a dataclass that holds arrays a short ``repr``.

    A class may say what counts about it by a method ``facts() -> list[str]``; of others every field
    is shown, arrays by type and shape.
    """
    cls.__repr__ = _repr
    return cls


def pictured(cls: type[T]) -> type[T]:
    """Give a class a picture of itself in notebooks, with its ``repr`` below."""
    cls._repr_html_ = _repr_html  # pyright: ignore[reportAttributeAccessIssue]
    return cls


def _repr(self: Any) -> str:
    name = type(self).__name__
    facts = getattr(self, "facts", None)
    said = facts() if facts else [f"{f.name}={short(getattr(self, f.name))}" for f in fields(self)]
    return f"{name}({', '.join(said)})"


def _repr_html(self: Any) -> str:
    return importlib.import_module(PICTURES).html(self)


def short(value: Any) -> str:
    """A value in a few words."""
    if isinstance(value, np.ndarray):
        return f"{value.dtype}[{', '.join(map(str, value.shape))}]"
    if isinstance(value, np.generic):
        return repr(value.item())
    if is_dataclass(value) and not isinstance(value, type):
        held = [getattr(value, f.name) for f in fields(value)]
        heavy = any(isinstance(v, np.ndarray | Mapping) or is_dataclass(v) for v in held)
        return f"{type(value).__name__}(…)" if heavy else _cut(repr(value))
    if isinstance(value, str | bytes):
        return _cut(repr(value))
    if isinstance(value, Mapping | Sequence | Set):
        words = [short(v) for v in list(value)[: MOST_WORDS + 1]]
        text = ", ".join(words)
        if len(value) <= MOST_WORDS and len(text) <= LONGEST and not isinstance(value, Mapping):
            return f"({text})"
        return f"({len(value)} {'entries' if isinstance(value, Mapping) else 'values'})"
    return _cut(repr(value))


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"
