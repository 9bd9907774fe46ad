"""Packages whose names are fetched when first used: a command waits for no compiler it needs not.

What a package holds stands once, in its ``__init__.pyi``, where type checkers and editors look too.
"""

from __future__ import annotations

import functools
import importlib
import sys

TYPE_CHECKING = False  # typing itself would have to be imported first
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any


class Later:
    """A module that is imported when something of it is first used.

    Beside ``if TYPE_CHECKING: import numpy as np`` it stands for it where most who import do not
    compute: NumPy costs 0.15 s.
    """

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, attribute: str) -> Any:
        value = getattr(importlib.import_module(self._name), attribute)
        setattr(self, attribute, value)  # from now on it is found without this
        return value


def names_of(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """``__getattr__`` and ``__dir__`` of a package, from the stub beside its file.

    ``__all__`` is among what is fetched: nothing is read before it is asked for.
    """

    def fetch(name: str) -> Any:
        if name == "__all__":
            return sorted(_stub(file))
        module = _stub(file).get(name)
        if module is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        if module == package:  # a package in it
            return importlib.import_module(f"{package}.{name}")
        value = getattr(importlib.import_module(module), name)
        setattr(sys.modules[package], name, value)  # from now on it is found without this
        return value

    def names() -> list[str]:
        return sorted({*vars(sys.modules[package]), *_stub(file)})

    return fetch, names


@functools.cache
def _stub(file: str) -> dict[str, str]:
    """The names that the stub of a package lists, and the modules they are in."""
    import ast

    with open(f"{file}i", encoding="utf-8") as stub:  # noqa: PTH123 - pathlib costs 10 ms
        lines = ast.parse(stub.read()).body
    return {
        alias.name: str(line.module)
        for line in lines
        if isinstance(line, ast.ImportFrom)
        for alias in line.names
    }
