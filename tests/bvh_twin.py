"""BVH read slowly and obviously: token after token, matrices, every channel as the format says."""

from __future__ import annotations

import itertools
import re
from pathlib import Path

import numpy as np


def slow_positions(path: Path | str) -> dict[str, np.ndarray]:
    """World positions [F, 3] of every joint by name, in file units and axes.

    A position channel replaces that coordinate of OFFSET; nothing is repaired.
    """
    source = Path(path).read_bytes().decode("cp932", "replace")
    source = re.sub(r"(?m)^\s*(#|//).*$", "", source)
    head, motion = re.split(r"(?mi)^\s*MOTION\s*$", source)
    joints: list[tuple[str, int, list[float], list[str]]] = []
    open_joints: list[int] = []
    tokens = iter(re.findall(r"[{}]|[^\s{}]+", head))
    for token in tokens:
        key = token.upper()
        if key in ("ROOT", "JOINT"):
            joints.append((next(tokens), open_joints[-1] if open_joints else -1, [], []))
            opened = len(joints) - 1
        elif key == "END":
            opened = -1
        elif key == "{":
            open_joints.append(opened)
        elif key == "}":
            open_joints.pop()
        elif key == "OFFSET":
            xyz = [float(next(tokens)) for _ in range(3)]
            if open_joints[-1] >= 0:
                joints[open_joints[-1]][2].extend(xyz)
        elif key == "CHANNELS":
            names = [next(tokens) for _ in range(int(next(tokens)))]
            joints[open_joints[-1]][3].extend(names)
    numbers = [float(t) for t in motion.split("Frame Time:")[1].split()[1:]]
    width = sum(len(channels) for _, _, _, channels in joints)
    out: dict[str, list[np.ndarray]] = {name: [] for name, *_ in joints}
    for f in range(len(numbers) // width):
        row = iter(numbers[f * width : (f + 1) * width])
        world: list[np.ndarray] = []
        for name, parent, offset, channels in joints:
            local = np.eye(4)
            local[:3, 3] = offset
            for channel in channels:
                k = "XYZ".index(channel[0].upper())
                value = next(row)
                if channel.lower().endswith("position"):
                    local[k, 3] = value
                else:
                    local = local @ turn_about(k, value)
            world.append(local if parent < 0 else world[parent] @ local)
            out[name].append(world[-1][:3, 3])
    return {name: np.array(places) for name, places in out.items()}


def turn_about(axis: int, degrees: float) -> np.ndarray:
    """A turn about an axis (0 x, 1 y, 2 z) as a matrix [4, 4]."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.eye(4)
    a, b = (axis + 1) % 3, (axis + 2) % 3
    turn[a, a], turn[a, b], turn[b, a], turn[b, b] = c, -s, s, c
    return turn


def rows_of(path: Path | str) -> tuple[str, list[list[float]]]:
    """The text of a file up to its numbers, and a row of numbers a frame."""
    lines = Path(path).read_text("cp932").split("\n")
    first = next(k for k, line in enumerate(lines) if line.startswith("Frame Time")) + 1
    rows = [[float(t) for t in line.split()] for line in lines[first:] if line.strip()]
    return "\n".join(lines[:first]), rows


def with_rows(head: str, rows: list[list[float]], seconds: float | None = None) -> str:
    """A file of a head and rows, with as many frames declared as there are rows."""
    head = re.sub(r"Frames: \d+", f"Frames: {len(rows)}", head)
    if seconds is not None:
        head = re.sub(r"Frame Time: \S+", f"Frame Time: {seconds!r}", head)
    return "\n".join(itertools.chain([head], (" ".join(map(repr, r)) for r in rows))) + "\n"
