"""Packages whose names are fetched when first used: a command waits for no compiler it needs not.

What a package holds stands once, in its ``__init__.pyi``, where type checkers and editors look too.
"""

from __future__ import annotations

import ast
import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any


class Later:
    """A module that is imported when something of it is first used.

    Beside ``if TYPE_CHECKING: import numpy as np`` it stands for it where most who import do not
    compute: NumPy costs 0.15 s.
    """

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, attribute: str) -> Any:
        return getattr(importlib.import_module(self._name), attribute)


def names_of(
    package: str, file: str
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """``__getattr__``, ``__dir__`` and ``__all__`` of a package, from the stub beside its file."""
    stub = ast.parse(Path(file).with_suffix(".pyi").read_text("utf-8"))
    where = {
        alias.name: str(line.module)
        for line in stub.body
        if isinstance(line, ast.ImportFrom)
        for alias in line.names
    }

    def fetch(name: str) -> Any:
        if name not in where:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        if where[name] == package:  # a package in it
            return importlib.import_module(f"{package}.{name}")
        value = getattr(importlib.import_module(where[name]), name)
        setattr(sys.modules[package], name, value)  # from now on it is found without this
        return value

    def names() -> list[str]:
        return sorted({*vars(sys.modules[package]), *where})

    return fetch, names, sorted(where)
