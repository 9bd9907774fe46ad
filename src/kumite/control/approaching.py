"""What the controller of preparation may do on its way: a library's cores, each also steered.

Shum et al. (2013, section 6) approach a goal with captured motions only. Of few cores some goals
are out of reach: straight walks never come round to what lies behind. Here a core that goes
somewhere is also offered with an extra turn, spread evenly over its cycle. Who plays one turns the
root on as he goes, and plants the feet by inverse kinematics.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kumite.brief import brief
from kumite.checked import checked
from kumite.control.preparation import (
    Motions,
    PreparationPolicy,
    PreparationSettings,
    gradual,
    trained_preparation,
)
from kumite.errors import KumiteError, unknown
from kumite.graph import Layer
from kumite.synthesis import level_displacements
from kumite.synthesis.preparation import LEGS

STEER = (0.0, 0.4, -0.4, 0.8, -0.8)  # rad over a cycle
STEEREST = 1.6  # rad: farther no foot follows within a cycle
WALK = "walk"  # how the labels of walks begin
MOVES = 0.15  # m/s: who is slower stands


@checked
@brief
@dataclass(frozen=True)
class Approach:
    """The motions that a library is approached with: M' rows, of its M cores."""

    motions: Motions
    core: np.ndarray  # [M'] int64
    steer: np.ndarray  # [M'] rad to the left, the extra turn over the cycle

    def __post_init__(self) -> None:
        count = len(self.motions.names)
        for name, kind in (("core", np.int64), ("steer", np.float64)):
            array = np.array(getattr(self, name), dtype=kind)
            if array.shape != (count,):
                raise KumiteError(f"approach: {name} {array.shape}, expected ({count},)")
            array.setflags(write=False)
            object.__setattr__(self, name, array)


@checked
def approach_motions(
    library: Layer,
    settings: PreparationSettings | None = None,
    steer: Sequence[float] = STEER,
    *,
    gaits: Sequence[str] | None = None,
    curve: float = LEGS,
) -> Approach:
    """The cores of a library for preparation that go somewhere, each once with every ``steer``.

    steer [rad]: extra turns over a cycle, to the left; at a level of preparation they shrink as the
    way does. gaits: labels of the cores to take; None: walks of any kind, or where there are none
    all that go somewhere. (Who runs steps over places; who may stand on the way learns to stay
    where its goal is hard to reach.) curve: C of the root. A motion follows
    another where the hierarchy links their cores. settings: whose levels may be chosen,
    :func:`gradual` by default. Errors: another kind of library; gaits that it does not have or that
    stand; turns that are none, too large, or given twice.
    """
    preparing = library.preparing
    if preparing is None:
        raise KumiteError(
            "the library holds no target motions; expected one for preparation "
            "(kumite build --layer preparation)"
        )
    turns = np.asarray(steer, dtype=float).reshape(-1)
    if not (len(turns) and np.all(np.abs(turns) <= STEEREST)):
        raise KumiteError(
            f"steer {list(steer)}; expected extra turns of at most {STEEREST} rad over a cycle"
        )
    if len(np.unique(turns)) != len(turns):
        raise KumiteError(f"steer {list(steer)}; expected each turn once")
    settings = settings or gradual()
    cores = preparing.hierarchy.cores
    moves = [c for c in range(len(cores)) if cores.speed[c] > MOVES]
    known = sorted({cores.label[c] for c in moves})
    for gait in gaits or ():
        if gait not in known:
            raise unknown("gait", gait, known)
    walks = [c for c in moves if cores.label[c].startswith(WALK)] or moves
    taken = walks if gaits is None else [c for c in moves if cores.label[c] in gaits]
    rows = [(c, s) for c in taken for s in turns]
    if not rows:
        raise KumiteError("the library's cores go nowhere: nothing can be approached with them")
    core = np.array([c for c, _ in rows], dtype=np.int64)
    extra = np.array([s for _, s in rows])
    displacement, seconds = level_displacements(
        library.clips, cores.take(core), settings.chosen, curve=curve, steer=extra
    )
    names = [_name(cores.label[c], c, cores.label.count(cores.label[c]) > 1, s) for c, s in rows]
    follows = preparing.hierarchy.links[np.ix_(core, core)]
    return Approach(Motions(tuple(names), displacement, seconds, follows), core, extra)


def _name(label: str, core: int, shared: bool, steer: float) -> str:
    name = f"{label} #{core}" if shared else label
    if steer == 0.0:
        return name
    return f"{name} {'left' if steer > 0 else 'right'} {abs(np.degrees(steer)):.3g}°"


@checked
def trained_approach(
    library: Layer,
    folder: Path | str | None,
    settings: PreparationSettings | None = None,
    *,
    steer: Sequence[float] = STEER,
    gaits: Sequence[str] | None = None,
    curve: float = LEGS,
    seed: int = 0,
    most_batches: int = 1000,
    progress: Callable[[int, float], None] = lambda batch, changed: None,
) -> tuple[Approach, PreparationPolicy]:
    """What a library is approached with, and the policy that chooses from it: read from ``folder``,
    else learned and kept there (:func:`trained_preparation`). Errors: as both say.
    """
    settings = settings or gradual()
    approach = approach_motions(library, settings, steer, gaits=gaits, curve=curve)
    policy = trained_preparation(
        approach.motions,
        folder,
        settings,
        seed=seed,
        most_batches=most_batches,
        progress=progress,
    )
    return approach, policy
