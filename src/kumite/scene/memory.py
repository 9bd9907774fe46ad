"""How many characters fit: a crowd that does not is refused before it is made."""

from __future__ import annotations

import os
from pathlib import Path

from kumite.errors import KumiteError

SHARE = 0.7  # of the free memory that a scene may take
JOINT_BYTES = 320  # a character's pose, offsets and their velocities, a joint
CHARACTER_BYTES = 6_000  # its blows, its mind, its names and events for some minutes
RECORDED_BYTES = 16  # a joint and frame of a recording, which keeps single precision
_CGROUP = Path("/sys/fs/cgroup/memory.max")


def free_memory() -> float:
    """Bytes that this machine, or this container of it, has free; 8 GB where nobody tells."""
    try:
        free = float(os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (ValueError, OSError, AttributeError):
        return 8e9
    try:
        return min(free, float(_CGROUP.read_text()))
    except (OSError, ValueError):  # no such limit, or "max"
        return free


def most_characters(joints: int, frames: int = 0) -> int:
    """How many characters fit into memory, with a recording of so many frames."""
    each = CHARACTER_BYTES + joints * (JOINT_BYTES + RECORDED_BYTES * frames)
    return int(SHARE * free_memory() / each)


def refuse_too_many(count: int, joints: int, frames: int = 0) -> None:
    """Errors: more characters than fit; says how many do."""
    most = most_characters(joints, frames)
    if count > most:
        what = f" with {frames} recorded frames" if frames else ""
        raise KumiteError(
            f"count: {count} characters{what} do not fit into memory; at most {most} do"
        )
