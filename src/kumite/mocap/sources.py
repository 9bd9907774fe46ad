"""What is to be read: files found, and what is said of them checked, before anything computes."""

from __future__ import annotations

import glob
from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path

from kumite.errors import KumiteError, short, unknown
from kumite.roles import ROLES

SUFFIXES = (".bvh", ".amc")
UP_AXES = ("Y", "Z", "X", "-Y", "-Z", "-X")  # the usual first
JOINT_POSITIONS = ("channels", "offsets")
Source = str | Path | Sequence[str | Path]


def check_options(
    *,
    fps: float | None = None,
    file_fps: float | None = None,
    metres_per_unit: float | None = None,
    up_axis: str | None = None,
    ground: float | None = None,
    roles: Mapping[str, str] | None = None,
    joint_positions: str | None = None,
) -> None:
    """What :func:`kumite.mocap.load` is told of the files. Errors: what makes no sense."""
    if up_axis is not None and up_axis.upper() not in UP_AXES:
        raise KumiteError(f"up axis {up_axis.upper()!r}; expected one of {', '.join(UP_AXES)}")
    for what, number in (
        ("fps", fps),
        ("file_fps", file_fps),
        ("metres_per_unit", metres_per_unit),
    ):
        if number is not None and not (isfinite(number) and number > 0):
            raise KumiteError(f"{what} {number}; expected a number more than 0")
    if ground is not None and not isfinite(ground):
        raise KumiteError(f"ground {ground}; expected a height in metres")
    for role in roles or {}:
        if role not in ROLES:
            raise unknown("role", role, ROLES)
    if joint_positions is not None and joint_positions not in JOINT_POSITIONS:
        raise unknown("joint_positions", joint_positions, JOINT_POSITIONS)


def find_files(source: Source) -> list[tuple[Path, Path]]:
    """Mocap files of a source, each with the folder up to which ``kumite.toml`` is looked for.

    Errors: a path or glob that leads nowhere, a folder without mocap, a file of another kind.
    """
    if not isinstance(source, (str, Path)):
        found: dict[Path, Path] = {}
        for one in source:
            for path, top in find_files(one):
                found.setdefault(path, top)
        if not found:
            raise KumiteError("an empty list of files; expected .bvh or .amc files")
        return list(found.items())
    if not str(source):  # an unset variable of a shell; Path("") would be the current folder
        raise KumiteError("an empty name; expected a folder, a glob or a file")
    path = Path(source)
    try:
        is_folder, exists = path.is_dir(), path.exists()
    except (OSError, ValueError):
        raise KumiteError(f"{short(path)!r}: not a path") from None
    if is_folder:
        files = sorted(p for p in path.rglob("*") if _is_mocap(p))
        if not files:
            raise KumiteError(f"{path}: no mocap in this folder; expected .bvh or .amc files")
        return [(p, path) for p in files]
    if exists:
        if path.suffix.lower() not in SUFFIXES:
            raise KumiteError(f"{path}: not a mocap file; expected {' or '.join(SUFFIXES)}")
        return [(path, path.parent)]
    if glob.has_magic(str(path)):
        matches = sorted(Path(p) for p in glob.glob(str(path), recursive=True))  # noqa: PTH207
        files = [p for p in matches if _is_mocap(p)]
        if not files:
            raise KumiteError(f"{path}: matches no mocap; expected .bvh or .amc files")
        return [(p, p.parent) for p in files]
    raise KumiteError(f"{short(path)}: no such file or folder")


def _is_mocap(path: Path) -> bool:
    # Hidden files are not takes: editors, downloads and our own writing leave such behind.
    if path.suffix.lower() not in SUFFIXES or path.name.startswith("."):
        return False
    try:
        return path.is_file()
    except OSError:  # in a folder that may not be entered
        return False
