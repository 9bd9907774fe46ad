"""What controllers do beside each other: balls avoided, blows landed, with and without ``avoid``.

python benchmarks/controllers.py [LIBRARY.kumite] [--seeds 0 1 2 3] [--seconds 60]
"""

from __future__ import annotations

import argparse
from pathlib import Path

from kumite.control import cache_folder
from kumite.graph import builtin_library, load_library
from kumite.scene import World, load_scene
from kumite.scene.events import Avoided, Hit, Struck, Throw

NAMES = ("thrown", "struck", "avoided", "landed")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("library", nargs="?", type=Path)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2, 3])
    parser.add_argument("--seconds", type=float, default=60.0)
    given = parser.parse_args()
    if given.library is None:
        folder = cache_folder(None)
        library = builtin_library(folder, style="all", layers=("actions", "avoidance"))
    else:
        library = load_library(given.library)
    print(f"{'seed':>5} {'controllers':>16}" + "".join(f"{name:>9}" for name in NAMES))
    total = {True: [0] * len(NAMES), False: [0] * len(NAMES)}
    for seed in given.seeds:
        for avoids in (True, False):
            scene = World(load_scene("under-fire"), library, seed=seed)
            if not avoids:
                for controllers in scene.controllers:
                    del controllers[0]
            for _ in range(round(given.seconds * scene.fps)):
                scene.step()
            counts = [
                sum(isinstance(e, Throw) for e in scene.events),
                sum(isinstance(e, Struck) for e in scene.events),
                sum(isinstance(e, Avoided) for e in scene.events),
                sum(isinstance(e, Hit) and not e.blocked for e in scene.events),
            ]
            total[avoids] = [a + b for a, b in zip(total[avoids], counts)]
            row(str(seed), avoids, counts)
    for avoids in (True, False):
        row("all", avoids, total[avoids])


def row(seed: str, avoids: bool, counts: list[int]) -> None:
    which = "avoid, fight" if avoids else "fight"
    print(f"{seed:>5} {which:>16}" + "".join(f"{n:>9}" for n in counts))


if __name__ == "__main__":
    main()
