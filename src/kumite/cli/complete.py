"""What the shell offers for a scene: built-in ones by name, and files. Imports nothing heavy."""

from __future__ import annotations

from pathlib import Path

from kumite.scene import catalogue


def complete_scene(incomplete: str) -> list[str]:
    """Scenes to run that begin as what was typed."""
    return _offered(incomplete, (".toml",))


def complete_shown(incomplete: str) -> list[str]:
    """What the studio shows."""
    return _offered(incomplete, (".toml", ".rec", ".kumite"))


def _offered(incomplete: str, endings: tuple[str, ...]) -> list[str]:
    typed = Path(incomplete)
    folder = typed if incomplete.endswith("/") else typed.parent
    try:
        beside = sorted(p for p in folder.iterdir() if not p.name.startswith("."))
    except OSError:
        beside = []
    files = [f"{p}/" if p.is_dir() else str(p) for p in beside if p.is_dir() or p.suffix in endings]
    return [name for name in (*catalogue.names(), *files) if name.startswith(incomplete)]
