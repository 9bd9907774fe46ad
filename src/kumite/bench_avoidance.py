"""The figures of avoidance: how long a search takes in a graph such as the paper's."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

Best = Callable[[Callable[[], Any]], float]  # seconds of the fastest of a few runs
Figure = tuple[Callable[[Path], float], str, float | None]

SECONDS = 160.0  # of the paper's graph
SIXTEEN = (
    "twist_left", "twist_right", "lean_left", "lean_right", "lean_back", "hollow", "bow", "duck",
    "duck_left", "duck_right", "limbo", "sidestep_left", "sidestep_right", "step_back", "jump_up",
    "jump_tuck",
)  # fmt: skip
REST = ("wait", "shuffle", "step_forward", "turn_left", "turn_right")
THROWS = 200


def avoidance_figures(best: Best) -> dict[str, Figure]:
    """Figures by name: what works them out of a folder (all here do without), unit and limit."""
    return {
        "avoidance: a search that the index answers": (
            lambda folder: _avoiding(best, True),
            "s",
            0.0005,
        ),
        "avoidance: the same without the index": (
            lambda folder: _avoiding(best, False),
            "s",
            0.01,
        ),
        "avoidance: the index": (lambda folder: _index(best), "s", 5.0),
        "avoidance: the index's memory": (lambda folder: _index_megabytes(), "MB", None),
    }


def sixteen(fps: float = 60.0) -> Any:
    """As the paper's: a library of 2 min 40 s with 16 avoidance motions, each of them once."""
    from kumite.clip import concatenate
    from kumite.graph import build_avoidance
    from kumite.performer.avoidance import AVOIDANCE
    from kumite.performer.take import perform_take, vary

    rng = np.random.default_rng(16)
    labels, total, n = [], 0.0, 0
    for label in rng.permutation(SIXTEEN).tolist():
        labels.append(label)
        total += AVOIDANCE.find(label).seconds
    while total < 0.9 * SECONDS:  # takes settle between moves
        labels.append(REST[n % len(REST)])
        total += AVOIDANCE.find(labels[-1]).seconds
        n += 1
    order = rng.permutation(len(labels))
    score = [vary(AVOIDANCE.find(labels[k]), AVOIDANCE, rng) for k in order]
    clip, _ = perform_take("sixteen", score, AVOIDANCE, rng=rng)
    return build_avoidance(concatenate([clip], fps))


@cache
def _dodging() -> Any:
    """A search, and throws at who is at the beginning of a stretch."""
    from kumite.control.attack import thrown
    from kumite.control.avoidance import AvoidanceSearch, Standing
    from kumite.control.rules import AvoidanceRules
    from kumite.scene.balls import aimed
    from kumite.scene.settings_dodge import BallsSettings

    library = sixteen()
    search = AvoidanceSearch(library, AvoidanceRules(index=True))
    rng, asked = np.random.default_rng(20110), []
    table, facing = library.table, library.clips.facing
    for stretch in rng.choice(len(table.first), THROWS):
        frame = int(table.first[stretch])
        body = search.volumes.centre[frame].T
        goal = body[rng.integers(len(body))].astype(float)
        place, velocity = aimed(rng, BallsSettings(), facing[frame], goal)
        standing = Standing(np.zeros(3), float(frame), int(table.last[stretch]), int(stretch))
        asked.append((standing, [thrown(place, velocity, 0.11)], 0.0))
    return search, asked


def _avoiding(best: Best, indexed: bool) -> float:
    """Seconds that a search takes, mean of those that the index answers: with it, or without."""
    from dataclasses import replace

    from kumite.control.avoidance import AvoidanceSearch

    search, asked = _dodging()
    known = [a for a in asked if search.search(*a).indexed] or asked
    if not indexed:
        search = AvoidanceSearch(search.library, replace(search.settings, index=False))
    return best(lambda: [search.search(*a) for a in known]) / len(known)


def _index(best: Best) -> float:
    from kumite.control.avoidance import AvoidanceSearch
    from kumite.control.rules import AvoidanceRules

    library = _dodging()[0].library
    return best(lambda: AvoidanceSearch(library, AvoidanceRules(index=True)).index)


def _index_megabytes() -> float:
    return _dodging()[0].index_bytes / 1e6
