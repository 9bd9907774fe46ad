"""What a recording holds, as lines and as plain values."""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path
from typing import Any

from kumite.cli.app import out, print_json
from kumite.errors import KumiteError

ENDING = ".rec"
MOST_NAMED = 12


def is_recording(source: Path | str) -> bool:
    """Whether a name is that of a recording: by its ending, or by what the file says of itself."""
    if str(source).endswith(ENDING):
        return True
    if not os.path.isfile(source):  # noqa: PTH113 - Path.is_file raises on names that are too long
        return False
    from kumite import files

    return files.kind_of(source) == files.RECORDING[0]


def refuse_no_recording(path: Path | str) -> None:
    """Say what a file is instead of a recording before anything is imported that computes."""
    from kumite import files

    files.refuse_unreadable(path, *files.RECORDING)


def show_recording(path: Path | str, as_json: bool, given: list[str]) -> None:
    """``kumite info`` of a recording. given: options that are of something else."""
    if given:
        raise KumiteError(f"{given[0]}: of motion capture; {path} is a recording")
    refuse_no_recording(path)
    from kumite.scene import load_recording

    r = load_recording(path)
    kinds = dict(Counter(e.kind for e in r.events).most_common())
    seed, library = r.settings.get("seed"), r.settings.get("library")
    if as_json:
        values: dict[str, Any] = {
            "scene": r.scene,
            "seed": seed,
            "seconds": round(r.seconds, 4),
            "fps": r.fps,
            "frames": len(r),
            "joints": len(r.skeleton),
            "characters": list(r.names),
            "objects": list(r.objects),
            "events": kinds,
            "library": library,
        }
        print_json(values)
        return
    events = ", ".join(f"{kind} {n}" for kind, n in kinds.items())
    lines = [
        f"{r.scene}, seed {'unknown' if seed is None else seed}: {r.seconds:.1f} s, "
        f"{len(r)} frames at {r.fps:g} frames/s, {len(r.skeleton)} joints",
        f"characters: {_named(r.names)}",
        *([f"objects: {_named(r.objects)}"] if r.objects else []),
        f"events: {events or 'none'}",
        f"library {library or 'unknown'} (its digest: 'kumite info' of the library says it, too)",
    ]
    for line in lines:
        out.print(line, markup=False, highlight=False)


def _named(names: tuple[str, ...]) -> str:
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(names[:MOST_NAMED]) + more
