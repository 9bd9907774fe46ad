"""How to approach a goal and prepare on the way (Shum et al. 2013, section 6), learned by SARSA.

    s = {α, Next(m), d_g, θ_g, d_i, θ_i}                                                  (Eq. 6)
    a = {m, α'}                                                                           (Eq. 7)
    r = w_θ (-|θ_g'|) + w_d (d_g - d_g') + w_α (-(Δα)²)                                (Eqs. 8-11)
    Q(s, a) ← Q(s, a) + λ (r + γ Q(s', a') - Q(s, a))                                    (Eq. 14)

d_g, θ_g: where the goal is seen, d_i, θ_i: the source of influence; θ to the left. The process is
quantised: docs/preparation-learning.md says how, and what is read otherwise than printed.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from kumite import files
from kumite.brief import brief
from kumite.checked import checked
from kumite.checks import array, freeze, instance, number
from kumite.errors import KumiteError
from kumite.kernels import sarsa as kernels

KIND = "preparation"
LEARNING = "preparation being learned"
VERSION = 1
MOST_PAIRS = 10_000_000  # states × actions: 12 bytes each, twice
CURVE = ("changed", "mean_return", "steps", "motion_seconds", "given_up")


@checked
@brief
@dataclass(frozen=True)
class Motions:
    """What a character may do on its way, at each level of preparation that may be chosen."""

    names: tuple[str, ...]
    displacement: np.ndarray  # [M, A, 3] m, m, rad: planar (x, z, yaw), already scaled by level
    duration: np.ndarray  # [M] s
    follows: np.ndarray  # [M, M] bool: the column's motion may follow the row's

    def __post_init__(self) -> None:
        object.__setattr__(self, "names", tuple(self.names))
        for field, kind in (("displacement", float), ("duration", float), ("follows", bool)):
            try:
                array = np.array(getattr(self, field), dtype=kind)
            except (TypeError, ValueError):
                raise KumiteError(f"motions: {field} is no array of numbers") from None
            array.setflags(write=False)
            object.__setattr__(self, field, array)
        count, shape = len(self.names), self.displacement.shape
        if count == 0:
            raise KumiteError("motions: there are none")
        if len(set(self.names)) != count:
            raise KumiteError("motions: names must be different from each other")
        if len(shape) != 3 or shape[0] != count or shape[1] == 0 or shape[2] != 3:
            raise KumiteError(f"motions: displacement {shape}, expected ({count}, levels, 3)")
        if self.duration.shape != (count,):
            raise KumiteError(f"motions: duration {self.duration.shape}, expected ({count},)")
        if self.follows.shape != (count, count):
            raise KumiteError(f"motions: follows {self.follows.shape}, expected {(count, count)}")
        if not (np.isfinite(self.displacement).all() and np.isfinite(self.duration).all()):
            raise KumiteError("motions: displacement and duration must be finite")
        if not (self.duration > 0).all():
            raise KumiteError("motions: expected durations of more than 0 s")
        for name, row in zip(self.names, self.follows):
            if not row.any():
                raise KumiteError(f"motions: no motion may follow {name!r}")


@dataclass(frozen=True)
class PreparationSettings:
    """The paper's numbers, and what it leaves open."""

    source_step: float = 0.6  # m
    source_distances: int = 5
    source_angles: int = 4
    goal_step: float = 0.6  # m; nearer than that is at the goal
    goal_distances: int = 2
    goal_angles: int = 8
    level_step: float = 0.2
    levels: int = 5  # that may be chosen, from 0; 1 is the one forced
    farthest: float = 3.0  # m: where the places of the outermost cells end
    places: int = 64  # in a cell, on which goal and source are put by chance
    facing: float = 0.1  # w_θ
    progress: float = 0.5  # w_d
    steadiness: float = 0.8  # w_α
    arrival: float = 0.0  # reward for reaching the goal; not in the paper
    two_changes: bool = False  # forced from the chosen α' to 1: (α' - α)² + (1 - α')², not (1 - α)²
    rate: float = 0.7  # λ
    settling: float = 3.0  # the n-th visit of a pair learns at λ / (1 + n / settling); inf: at λ
    discount: float = 0.3  # γ, an action
    explore: float = 0.1  # ε
    exploring_starts: bool = True
    changed: float = 0.02  # learned when a batch changes the best action of fewer of the states
    batch: int = 4  # episodes a state
    longest: int = 1000  # actions after which an episode is given up

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not isinstance(value, (bool, int, float)):
                raise KumiteError(f"preparation: {field.name} {value!r}, expected a number")
        for field, low in (
            ("source_distances", 2),
            ("goal_distances", 2),
            ("source_angles", 1),
            ("goal_angles", 1),
            ("levels", 1),
            ("places", 1),
            ("batch", 1),
            ("longest", 1),
        ):
            value = getattr(self, field)
            if isinstance(value, bool) or not isinstance(value, int) or value < low:
                raise KumiteError(f"preparation: {field} {value!r}, expected a number from {low}")
        for field, low, high in (
            ("discount", 0.0, 1.0),
            ("explore", 0.0, 1.0),
            ("changed", 0.0, 1.0),
        ):
            value = getattr(self, field)
            if not low <= value <= high or (field == "discount" and value == high):
                end = "less than 1" if field == "discount" else "at most 1"
                raise KumiteError(f"preparation: {field} {value}, expected at least 0 and {end}")
        if not 0 < self.rate <= 1:
            raise KumiteError(f"preparation: rate {self.rate}, expected more than 0 and at most 1")
        if not self.settling > 0:
            raise KumiteError(f"preparation: settling {self.settling}, expected more than 0")
        weights = (self.facing, self.progress, self.steadiness, self.arrival)
        if not all(math.isfinite(w) and w >= 0 for w in weights):
            raise KumiteError(
                "preparation: facing, progress, steadiness and arrival, "
                "expected finite and not below 0"
            )
        if not (self.level_step > 0 and self.level_step * (self.levels - 1) <= 1 + 1e-9):
            raise KumiteError(
                f"preparation: {self.levels} levels {self.level_step} apart, expected within 0 to 1"
            )
        if not (self.source_step > 0 and self.goal_step > 0):
            raise KumiteError("preparation: steps of distance, expected more than 0 m")
        nearest = max(
            (self.source_distances - 1) * self.source_step,
            (self.goal_distances - 1) * self.goal_step,
        )
        if not nearest < self.farthest < math.inf:
            raise KumiteError(
                f"preparation: farthest {self.farthest} m, expected more than the "
                f"{nearest:g} m where the last cells begin"
            )

    @property
    def chosen(self) -> np.ndarray:
        """Levels [A] that may be chosen."""
        return np.round(np.arange(self.levels) * self.level_step, 9)

    @property
    def all_levels(self) -> np.ndarray:
        """Levels [L] that a state may have: those, and 1."""
        chosen = self.chosen
        return chosen if chosen[-1] == 1.0 else np.append(chosen, 1.0)

    @property
    def goal_cells(self) -> kernels.Polar:
        return kernels.Polar(self.goal_step, self.goal_distances, self.goal_angles, self.farthest)

    @property
    def source_cells(self) -> kernels.Polar:
        return kernels.Polar(
            self.source_step, self.source_distances, self.source_angles, self.farthest
        )


def gradual(**changes: Any) -> PreparationSettings:
    """Settings under which levels rise step by step towards the source: not the printed ones.

    With those a character stays before the source (docs/preparation-learning.md).
    """
    given: dict[str, Any] = {
        "arrival": 1.0,
        "discount": 0.8,
        "two_changes": True,
        "goal_distances": 5,
        "settling": 10.0,
    }
    return PreparationSettings(**{**given, **changes})


def build_process(motions: Motions, settings: PreparationSettings) -> kernels.Process:
    """The quantised process: where motions bring goal and source, from each place of each cell.

    Errors: other levels than the settings say, too many states, a goal out of reach.
    """
    count, levels = motions.displacement.shape[:2]
    if levels != settings.levels:
        raise KumiteError(
            f"motions: displacement for {levels} levels, the settings say {settings.levels}"
        )
    rows, class_after = np.unique(motions.follows, axis=0, return_inverse=True)
    goals = (settings.goal_distances - 1) * settings.goal_angles
    sources = settings.source_distances * settings.source_angles
    pairs = len(rows) * len(settings.all_levels) * goals * sources * count * levels
    if pairs > MOST_PAIRS:
        raise KumiteError(
            f"preparation: {pairs} states × actions, more than {MOST_PAIRS}: "
            "take fewer motions, cells or levels"
        )
    goal_next = np.empty((count, levels, goals, settings.places), dtype=np.int32)
    goal_reward = np.empty(goal_next.shape)
    source_next = np.empty((count, levels, sources, settings.places), dtype=np.int32)
    weights = kernels.Weights(settings.facing, settings.progress, settings.arrival)
    kernels.goal_steps(motions.displacement, settings.goal_cells, weights, goal_next, goal_reward)
    kernels.source_steps(motions.displacement, settings.source_cells, source_next)
    allowed = np.repeat(rows, levels, axis=1)
    process = kernels.Process(
        goal_next,
        goal_reward,
        source_next,
        settings.source_angles,
        settings.all_levels,
        float(settings.steadiness),
        settings.two_changes,
        np.concatenate([[0], np.cumsum(allowed.sum(axis=1))]).astype(np.int64),
        np.nonzero(allowed)[1].astype(np.int64),
        class_after.reshape(-1).astype(np.int64),
        motions.duration,
    )
    _refuse_unreachable(process, rows)
    return process


def _refuse_unreachable(process: kernels.Process, follows: np.ndarray) -> None:
    """Every class and goal cell must have some way to the goal."""
    classes, goals = len(follows), process.goal_next.shape[2]
    after = process.goal_next.transpose(0, 2, 1, 3).reshape(len(process.class_after), goals, -1)
    there = np.zeros((classes, goals + 1), dtype=bool)
    there[:, kernels.AT_GOAL] = True  # the last column: what AT_GOAL indexes
    while True:
        by = np.stack([there[c][a].any(axis=-1) for c, a in zip(process.class_after, after)])
        found = there.copy()
        for c, row in enumerate(follows):
            found[c, :goals] |= by[row].any(axis=0)
        if (found == there).all():
            break
        there = found
    lost = int((~there).sum())
    if lost:
        raise KumiteError(
            f"preparation: the goal cannot be reached from {lost} of {classes * goals} cells, "
            "whatever the motions: they move too little, or not that way"
        )


@dataclass(frozen=True)
class Curve:
    """How learning went, a row a batch."""

    changed: np.ndarray  # [B] share of the states whose best action the batch changed
    mean_return: np.ndarray  # [B] of an episode, discounted
    steps: np.ndarray  # [B] actions done
    motion_seconds: np.ndarray  # [B] s of motion an episode
    given_up: np.ndarray  # [B] episodes that did not come to the goal

    def __post_init__(self) -> None:
        freeze(self, "learning curve", **dict.fromkeys(CURVE, (float, ("B",))))

    def __len__(self) -> int:
        return len(self.changed)


class Learning:
    """SARSA under way: batch after batch, saved and taken up again between any two.

    All that it learns with is in arrays, the random generator included: what was interrupted and
    taken up gives the same bytes as what was not.
    """

    def __init__(
        self, motions: Motions, settings: PreparationSettings | None = None, seed: int = 0
    ) -> None:
        self.motions, self.settings = motions, settings or PreparationSettings()
        self.process = build_process(motions, self.settings)
        self.seed = seed
        p = self.process
        per_class = len(p.level) * p.goal_next.shape[2] * p.source_next.shape[2]
        self.states = (len(p.choice_start) - 1) * per_class
        actions = p.goal_next.shape[0] * p.goal_next.shape[1]
        self.learner = kernels.Learner(
            np.zeros((self.states, actions)),
            np.zeros((self.states, actions), dtype=np.int32),
            np.repeat(p.choice[p.choice_start[:-1]], per_class).astype(np.int32),
            np.repeat(np.diff(p.choice_start), per_class).astype(np.int32),
            np.array([seed % 2**64], dtype=np.uint64),
        )
        self._rows: tuple[tuple[float, ...], ...] = ()

    @property
    def batches(self) -> int:
        return len(self._rows)

    @property
    def converged(self) -> bool:
        """The last batch changed the best action of few enough states, and all have been tried."""
        if not self._rows or self._rows[-1][0] >= self.settings.changed:
            return False
        return not self.settings.exploring_starts or self.untried == 0

    @property
    def curve(self) -> Curve:
        table = np.array(self._rows).reshape(-1, len(CURVE))
        return Curve(*(np.ascontiguousarray(c) for c in table.T))

    @property
    def untried(self) -> int:
        """Actions of states that were never tried."""
        return int(self.learner.untried.sum())

    def batch(self) -> float:
        """Play one batch of episodes: the share of the states whose best action it changed."""
        s = self.settings
        rates = kernels.Rates(
            float(s.rate),
            float(s.settling),
            float(s.discount),
            float(s.explore),
            s.exploring_starts,
            s.longest,
        )
        # On a copy: an interruption anywhere in here leaves what was learned before this batch.
        learner = kernels.Learner(*(array.copy() for array in self.learner))
        count = s.batch * self.states
        mean, steps, seconds, lost = kernels.episodes(self.process, rates, learner, count)
        changed = float((learner.best != self.learner.best).mean())
        rows = (*self._rows, (changed, mean, steps, seconds / count, lost))
        self.__dict__.update(learner=learner, _rows=rows)
        return changed

    def policy(self, seconds: float = 0.0) -> PreparationPolicy:
        """What is learned so far."""
        p = self.process
        shape = (
            len(p.choice_start) - 1,
            len(p.level),
            p.goal_next.shape[2],
            p.source_next.shape[2],
        )
        best = self.learner.best.reshape(shape).copy()
        best.setflags(write=False)
        return PreparationPolicy(
            self.settings, best, p.class_after.copy(), self.curve, self.converged, seconds
        )

    def save(self, path: Path | str) -> None:
        header = {"key": _key(self.motions, self.settings, self.seed)}
        arrays = {**self.learner._asdict(), "curve": np.array(self._rows).reshape(-1, len(CURVE))}
        files.save(path, LEARNING, VERSION, header, arrays)

    @classmethod
    def load(
        cls,
        path: Path | str,
        motions: Motions,
        settings: PreparationSettings | None = None,
        seed: int = 0,
    ) -> Learning:
        """Taken up where it was saved. Errors: damaged; other motions, settings, seed, code."""
        self = cls(motions, settings, seed)
        header, arrays = files.load(path, LEARNING, VERSION)
        if header.get("key") != _key(motions, self.settings, seed):
            raise KumiteError(f"{path}: learned with other motions, settings, seed or code")
        for name, held in self.learner._asdict().items():
            found = arrays.get(name)
            if found is None or found.shape != held.shape or found.dtype != held.dtype:
                raise KumiteError(f"{path}: damaged {LEARNING} ({name})")
            held[...] = found
        if not (self._fits() and np.isfinite(self.learner.q).all()):
            raise KumiteError(f"{path}: damaged {LEARNING} (numbers out of range)")
        try:
            self._rows = tuple(map(tuple, np.reshape(arrays["curve"], (-1, len(CURVE))).tolist()))
            _ = self.curve
        except (KeyError, ValueError, KumiteError):
            raise KumiteError(f"{path}: damaged {LEARNING} (curve)") from None
        return self

    def _fits(self) -> bool:
        """Whether kernels may follow what has been learned."""
        best, visits, untried = self.learner.best, self.learner.visits, self.learner.untried
        allowed = _allowed(self.process, self.learner.q.shape[1])
        of_class = np.repeat(np.arange(len(allowed)), self.states // len(allowed))
        return bool(
            np.all((best >= 0) & (best < allowed.shape[1]))
            and allowed[of_class, best].all()
            and np.all(visits >= 0)
            and np.array_equal(untried, (allowed[of_class] & (visits == 0)).sum(axis=1))
        )


@brief
@dataclass(frozen=True)
class PreparationPolicy:
    """The motion and the level of preparation to choose, in every state."""

    settings: PreparationSettings
    best: np.ndarray  # [C, L, G, I] int32, motion * levels + level
    class_after: np.ndarray  # [M]
    curve: Curve
    converged: bool  # by the rule, not only because batches ran out
    seconds: float  # that learning took

    def __post_init__(self) -> None:
        what = "preparation policy"
        instance(self.settings, PreparationSettings, f"{what}: settings")
        instance(self.curve, Curve, f"{what}: curve")
        instance(self.converged, bool, f"{what}: converged")
        number(self.seconds, f"{what}: seconds", least=0.0)
        freeze(self, what, best=(np.int32, ("C", "L", "G", "I")), class_after=(np.int32, ("M",)))
        actions = len(self.class_after) * self.settings.levels
        # Kernels follow these numbers without looking.
        for name, most in (("best", actions - 1), ("class_after", len(self.best) - 1)):
            array(getattr(self, name), f"{what}: {name}", (...,), np.int32, least=0, most=most)

    def decide(
        self, last: Any, level: Any, d_g: Any, theta_g: Any, d_i: Any, theta_i: Any
    ) -> tuple[np.ndarray, np.ndarray]:
        """(motion, level of preparation) to choose; arguments of any shapes that go together.

        last: the motion done before; level: α now, 0 to 1; d_g, theta_g [m, rad to the left]: the
        goal as seen; d_i, theta_i: the source of influence. At the goal, where nothing is left to
        learn, it chooses as just before it (see :meth:`at_goal`).
        """
        numbers = [np.asarray(v, dtype=float) for v in (level, d_g, theta_g, d_i, theta_i)]
        if not all(np.isfinite(v).all() for v in numbers):
            raise KumiteError("preparation: level, distances and angles must be finite")
        level, d_g, theta_g, d_i, theta_i = numbers
        if ((level < 0) | (level > 1)).any() or (d_g < 0).any() or (d_i < 0).any():
            raise KumiteError("preparation: expected a level of 0 to 1, distances not below 0")
        last = np.asarray(last)
        if last.dtype.kind not in "iu" or ((last < 0) | (last >= len(self.class_after))).any():
            raise KumiteError(
                f"preparation: last motion, expected 0 to {len(self.class_after) - 1}"
            )
        s = self.settings
        near = np.abs(level[..., None] - s.all_levels).argmin(axis=-1)
        goal = _cells(s.goal_cells, np.maximum(d_g, s.goal_step), theta_g) - s.goal_angles
        source = _cells(s.source_cells, d_i, theta_i)
        motion, chosen = np.divmod(self.best[self.class_after[last], near, goal, source], s.levels)
        return motion, s.chosen[chosen]

    def at_goal(self, d_g: Any) -> np.ndarray:
        """Whether a distance [m] counts as being at the goal."""
        return np.asarray(d_g) < self.settings.goal_step

    def at_source(self, d_i: Any) -> np.ndarray:
        """Whether a distance [m] counts as at the source: on reaching it α is forced to 1."""
        return np.asarray(d_i) < self.settings.source_step


def _cells(polar: kernels.Polar, distance: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """As the kernel's ``cell_of``, over arrays."""
    ring = np.minimum(distance / polar.step, polar.distances - 1).astype(np.int64)
    turn = np.floor(angle / (2 * np.pi) * polar.angles + 0.5).astype(np.int64) % polar.angles
    return ring * polar.angles + turn


def _no_progress(batch: int, changed: float) -> None:
    pass


def train(
    motions: Motions,
    settings: PreparationSettings | None = None,
    *,
    seed: int = 0,
    most_batches: int = 1000,
    checkpoint: Path | str | None = None,
    progress: Callable[[int, float], None] = _no_progress,
) -> PreparationPolicy:
    """Learn until a batch changes the best action of fewer than ``settings.changed`` of the states.

    What is interrupted is kept at ``checkpoint`` and taken up from there the next time, with the
    same result. ``progress`` is called after each batch with its number and that share.
    """
    learning = None
    if checkpoint is not None and Path(checkpoint).exists():
        with contextlib.suppress(KumiteError):  # damaged, or of other code: from the beginning
            learning = Learning.load(checkpoint, motions, settings, seed)
    learning = learning or Learning(motions, settings, seed)
    begin = time.perf_counter()
    try:
        while not learning.converged and learning.batches < most_batches:
            changed = learning.batch()
            progress(learning.batches, changed)
    except BaseException:
        if checkpoint is not None:
            with contextlib.suppress(KumiteError):
                learning.save(checkpoint)
        raise
    if checkpoint is not None:
        Path(checkpoint).unlink(missing_ok=True)
    return learning.policy(time.perf_counter() - begin)


@checked
def trained_preparation(
    motions: Motions,
    folder: Path | str | None,
    settings: PreparationSettings | None = None,
    *,
    seed: int = 0,
    most_batches: int = 1000,
    progress: Callable[[int, float], None] = _no_progress,
) -> PreparationPolicy:
    """The policy of motions and settings: read from ``folder``, else learned and kept there.

    A folder of None, or one that cannot be written, only means that it is learned again next time.
    """
    settings = settings or PreparationSettings()
    key = hashlib.sha256(f"{_key(motions, settings, seed)} {most_batches}".encode()).hexdigest()
    path = None if folder is None else Path(folder) / f"preparation-{key[:16]}.policy"
    if path is not None and path.exists():
        with contextlib.suppress(*files.UNREADABLE):
            return _read(path, settings, build_process(motions, settings))
    policy = train(
        motions,
        settings,
        seed=seed,
        most_batches=most_batches,
        checkpoint=None if path is None else path.with_suffix(".learning"),
        progress=progress,
    )
    if path is not None:
        header = {"converged": policy.converged, "seconds": policy.seconds}
        arrays = {"best": policy.best, "class_after": policy.class_after, **asdict(policy.curve)}
        with contextlib.suppress(KumiteError):
            files.save(path, KIND, VERSION, header, arrays)
    return policy


def _read(path: Path, settings: PreparationSettings, process: kernels.Process) -> PreparationPolicy:
    header, arrays = files.load(path, KIND, VERSION)
    best = arrays["best"]
    classes, goals, sources = (
        len(process.choice_start) - 1,
        process.goal_next.shape[2],
        process.source_next.shape[2],
    )
    if best.shape != (classes, len(process.level), goals, sources):
        raise KumiteError(f"{path}: damaged {KIND}")
    curve = Curve(*(arrays[name] for name in CURVE))
    found = PreparationPolicy(settings, best, arrays["class_after"], curve, **header)
    allowed = _allowed(process, len(found.class_after) * settings.levels)
    fits = [allowed[c, found.best[c]].all() for c in range(classes)]
    if not (all(fits) and np.array_equal(found.class_after, process.class_after)):
        raise KumiteError(f"{path}: damaged {KIND}")
    return found


def _allowed(process: kernels.Process, actions: int) -> np.ndarray:
    """Which actions [C, U] may follow a motion of each class."""
    allowed = np.zeros((len(process.choice_start) - 1, actions), dtype=bool)
    of_class = np.repeat(np.arange(len(allowed)), np.diff(process.choice_start))
    allowed[of_class, process.choice] = True
    return allowed


def _key(motions: Motions, settings: PreparationSettings, seed: int) -> str:
    """What a result depends on: motions, settings, seed and our code."""
    h = hashlib.sha256(files.code_digest("control", "kernels").encode())
    finite = {k: str(v) for k, v in asdict(settings).items()}
    h.update(json.dumps([list(motions.names), finite, seed], sort_keys=True).encode())
    for of in (motions.displacement, motions.duration, motions.follows):
        h.update(f"{of.dtype} {of.shape}".encode() + np.ascontiguousarray(of).tobytes())
    return h.hexdigest()
