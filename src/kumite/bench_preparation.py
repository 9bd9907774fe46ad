"""The figures of preparation: how fast it is learned, and how many prepare at once."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

Best = Callable[[Callable[[], Any]], float]  # seconds of the fastest of a few runs
Figure = tuple[Callable[[Path], float], str, float | None]

MANY = 500
SECONDS = 8.0  # of a drill: walkers come to their balls, kick them and go after them
FRAMES = 120


def preparation_figures(best: Best) -> dict[str, Figure]:
    """Figures by name: what works them out of a folder (all here do without), unit and limit."""
    return {
        "preparation learned by SARSA to the paper's rule": (
            lambda folder: _learning(best, False),
            "s",
            10.0,
        ),
        "preparation learned by SARSA, levels that rise step by step": (
            lambda folder: _learning(best, True),
            "s",
            10.0,
        ),
        f"preparation: {MANY} walkers at 60 Hz, the whole scene": (
            lambda folder: _drill(best),
            "s/s",
            1.0,
        ),
        "preparation: a character-frame in a crowd": (
            lambda folder: _prepared(best, MANY),
            "µs",
            20.0,
        ),
        "preparation: a character-frame of one alone": (
            lambda folder: _prepared(best, 1),
            "µs",
            None,
        ),
    }


def _walker():
    """Seven motions of a walker, at five levels of preparation: each may follow each."""
    from kumite.control import Motions

    quarter = np.pi / 4
    whole = [[0, 0, 0], [0, 0.65, 0], [0.55, 0.1, 0], [-0.55, 0.1, 0], [0, -0.52, 0]]
    whole += [[0, 0, quarter], [0, 0, -quarter]]
    scale = 1 - 0.2 * np.arange(5)
    names = ("stand", "forward", "left", "right", "back", "turn left", "turn right")
    moves = np.array(whole)[:, None, :] * scale[None, :, None]
    return Motions(names, moves, np.full(7, 0.6), np.ones((7, 7), bool))


def _learning(best: Best, gradually: bool) -> float:
    from kumite.control import PreparationSettings, gradual
    from kumite.control.preparation import train

    settings, motions = gradual() if gradually else PreparationSettings(), _walker()
    return best(lambda: train(motions, settings))


@cache
def _targets():
    from kumite.control import cache_folder
    from kumite.graph import builtin_layer

    return builtin_layer(cache_folder(None), style="targets", level="preparation")


def _drill(best: Best) -> float:
    from kumite.control import cache_folder
    from kumite.scene import PrepareScene, load_scene, with_count

    settings = with_count(load_scene("drill"), MANY)
    scene = PrepareScene(settings, _targets(), cache=cache_folder(None))

    def work() -> None:
        scene.reset(1)
        for _ in range(round(SECONDS * scene.fps)):
            scene.step()

    return best(work) * (60.0 / scene.fps) / SECONDS


def _prepared(best: Best, count: int) -> float:
    """What preparing costs on top of what is prepared."""
    from kumite.synthesis import Cast, Preparation, references

    library = _targets()
    assert library.preparing is not None
    cast = Cast(library, count)
    for k in range(count):
        cast.place(k, k % library.table.states, np.array([2.0 * k, 0.0, 0.0]))
    cast.show(0.0)
    like = references(library.clips, library.preparing.reference)
    work = Preparation(library.clips.skeleton, library.clips.fps, like, count)

    def frames() -> None:
        for _ in range(FRAMES):
            work.show_cast(cast, 0.5)

    return 1e6 * best(frames) / (FRAMES * count)
