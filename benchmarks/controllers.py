"""What controllers do beside each other, on one character, in a table of the pairs.

Each row is a scene of one or two characters: what each controller is for, with the other beside it
and alone. Balls are thrown where ``avoid`` is among them; there is a bar where ``prepare`` is.

python benchmarks/controllers.py [LIBRARY.kumite] [--seeds 0 1 2] [--seconds 60]
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path
from typing import Any

from kumite.control import cache_folder
from kumite.graph import Library, builtin_library, load_library
from kumite.scene import SceneSettings, World
from kumite.scene.events import Avoided, Decision, Done, Event, Hit, Struck, Throw

LAYERS = ("actions", "avoidance", "preparation")
ROWS: tuple[tuple[str, tuple[str, ...], str | None], ...] = (
    ("tree", ("fight",), "tree"),
    ("policy", ("fight",), "policy"),
    ("tree, balls", ("fight",), "tree"),
    ("policy, balls", ("fight",), "policy"),
    ("avoid + tree", ("avoid", "fight"), "tree"),
    ("avoid + policy", ("avoid", "fight"), "policy"),
    ("prepare", ("prepare",), None),
    ("avoid + prepare", ("avoid", "prepare"), None),
    ("tree + prepare", ("fight", "prepare"), "tree"),
    ("policy + prepare", ("fight", "prepare"), "policy"),
    ("avoid + tree + prepare", ("avoid", "fight", "prepare"), "tree"),
)
COLUMNS = ("thrown", "struck", "avoided", "landed", "motions done", "decisions by")


def settings_of(name: str, controllers: tuple[str, ...], by: str | None) -> SceneSettings:
    """Red, whom a row is about, and blue, who fights it by game tree if it fights."""
    prepares, avoids = "prepare" in controllers, "avoid" in controllers or "balls" in name
    red: dict[str, Any] = {
        "name": "red",
        "position": (0.0, -4.0 if prepares else -0.7),
        "controllers": controllers,
    }
    blue: dict[str, Any] = {
        "name": "blue",
        "position": (0.0, 4.0 if prepares else 0.7),
        "yaw_deg": 180.0,
        "against": "red",
        "fight": {"by": "tree"},
    }
    out: dict[str, Any] = {"title": name, "character": [red]}
    if by is not None:
        red |= {"against": "blue", "fight": {"by": by}}
        out["character"].append(blue)
    if prepares:
        out["target"] = [
            {"name": "bar", "kind": "under", "position": (0.0, -1.0)},
            {"name": "other bar", "kind": "under", "position": (0.0, 3.0)},
        ]
    if avoids:
        out["balls"] = {"throws": 10_000, "every": 4.0}
        if "avoid" not in controllers:  # thrown at one who does not look
            red["controllers"] = ("avoid", *controllers)
    return SceneSettings.model_validate(out)


def ran(world: World, seconds: float, seed: int) -> list[Event]:
    """What happens in so many seconds."""
    world.reset(seed)
    for _ in range(round(seconds * world.fps)):
        world.step()
    return list(world.events)


def counts(events: list[Event], who: str = "red") -> dict[str, Any]:
    """What a character has done: see :data:`COLUMNS`."""
    mine = [e for e in events if e.character == who]
    by = Counter(e.by for e in mine if isinstance(e, Decision))
    return {
        "thrown": sum(isinstance(e, Throw) for e in mine),
        "struck": sum(isinstance(e, Struck) for e in mine),
        "avoided": sum(isinstance(e, Avoided) for e in mine),
        "landed": sum(isinstance(e, Hit) and not e.blocked for e in mine),
        "motions done": sum(isinstance(e, Done) for e in mine),
        "decisions by": by,
    }


def world_of(
    name: str, controllers: tuple[str, ...], by: str | None, library: Library, cache: Path | None
) -> World:
    """The world of a row."""
    world = World(settings_of(name, controllers, by), library, cache=cache)
    if "balls" in name:  # it is thrown at, and has nobody who looks out for it
        del world.character("red").controllers[0]
    return world


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("library", nargs="?", type=Path)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--seconds", type=float, default=60.0)
    given = parser.parse_args()
    cache = cache_folder(given.library)
    if given.library is None:
        library = builtin_library(cache, style="all", layers=LAYERS)
    else:
        library = load_library(given.library)
    print("| controllers | " + " | ".join(COLUMNS) + " |")
    print("| --- |" + " ---: |" * (len(COLUMNS) - 1) + " --- |")
    for name, controllers, by in ROWS:
        world = world_of(name, controllers, by, library, cache)
        total: dict[str, Any] = {}
        for seed in given.seeds:
            found = counts(ran(world, given.seconds, seed))
            total = {key: total[key] + n if total else n for key, n in found.items()}
        by_whom = ", ".join(f"{n} {name}" for name, n in total["decisions by"].most_common())
        cells = [str(total[key]) for key in COLUMNS[:-1]] + [by_whom]
        print(f"| {name} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
