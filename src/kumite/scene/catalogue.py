"""Scenes as they are found, before anything is made of them: listing them waits for no compiler."""

from __future__ import annotations

import difflib
import os
import tomllib
from importlib import resources
from pathlib import Path

from kumite.errors import KumiteError

ENDING = ".toml"


def names() -> list[str]:
    """The built-in scenes, sorted."""
    files = (resources.files("kumite.scene") / "builtin").iterdir()
    return sorted(f.name.removesuffix(ENDING) for f in files if f.name.endswith(ENDING))


def about(name: str) -> str:
    """What a built-in scene shows."""
    return tomllib.loads(_builtin(name)).get("about", "")


def find(name: str) -> tuple[str, str]:
    """The text of a built-in scene or of a TOML scene file, and what to call it in errors.

    Errors: an unknown name (near ones are suggested); a file that cannot be read.
    """
    known = names()
    if name in known:
        return _builtin(name), f"{name}{ENDING}"
    path = Path(name)
    # Not Path.exists, which raises on a name that is too long for the system.
    if path.suffix == ENDING or os.path.exists(name):  # noqa: PTH110
        try:
            return path.read_text("utf-8"), name
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or "not UTF-8 text; expected a TOML file"
            raise KumiteError(f"{name}: cannot be read ({reason})") from None
    near = difflib.get_close_matches(name, known, n=2, cutoff=0.4)
    hint = f"did you mean {' or '.join(near)}? " if near else ""
    raise KumiteError(
        f"unknown scene {name!r}: {hint}expected one of {', '.join(known)}, "
        "or the path of a .toml scene file"
    )


def _builtin(name: str) -> str:
    return (resources.files("kumite.scene") / "builtin" / f"{name}{ENDING}").read_text("utf-8")
