"""Fights that run by themselves, side by side, and what is measured of them."""

from __future__ import annotations

import multiprocessing
import os
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numba
import numpy as np
from flaws import COUNTS, tallied
from scipy.spatial import KDTree

from kumite import mocap
from kumite.control import Route, cache_folder
from kumite.control.styles import VULNERABILITY, short_range
from kumite.graph import Layer, build_actions, builtin_layer
from kumite.scene import SceneSettings, World, load_scene, with_count
from kumite.scene.events import Hit, Reaction, Strike

FIRST_SEED = 200  # no settings were chosen with this one or those after it in view
SECONDS = 30.0
WORKERS = 2
# Where everyone begins, besides in which of a few postures: else some seeds give the same fight.
SCATTER = {"scatter": 0.05, "scatter_deg": 5.0}
REAL = "real boxer"
ALL_WAYS = ", all ways"  # of a library: a state offers whatever joins, however many that are


@dataclass(frozen=True)
class Job:
    """A fight that is to run."""

    scene: str
    seed: int
    library: str | None = None  # a style, or REAL; None: as the scene says
    depths: tuple[int, ...] = ()  # of its fighters, in place of the scene's
    seconds: float = SECONDS
    pairs: int | None = None
    endless: bool = False  # without the scene's arena
    tallied: bool = False  # whole trees of three levels are counted at every decision

    @property
    def settings(self) -> SceneSettings:
        settings = load_scene(self.scene)
        if settings.bout is not None and settings.bout.scatter == 0:
            bout = settings.bout.model_copy(update=SCATTER)
            settings = settings.model_copy(update={"bout": bout})
        if settings.bout is not None and self.endless:
            bout = settings.bout.model_copy(update={"arena": None})
            settings = settings.model_copy(update={"bout": bout})
        return settings if self.pairs is None else with_count(settings, self.pairs)


@dataclass(frozen=True)
class Fight:
    """What came of it. K fighters, F frames."""

    fps: float
    wall: float  # s
    cpu: float  # s
    nodes: int
    decisions: int
    ground: np.ndarray  # [F, K, 2] m, pelvises
    facing: np.ndarray  # [F, K] rad off the opponent
    thrown: list[list[bool]]  # [K] of each blow whether it was of short range
    landed: list[list[bool]]  # [K] of each on head or trunk
    damage: list[float]  # [K] D dealt (Eq. 6)
    falls: list[list[float]]  # [K] s
    down: np.ndarray  # [K] bool, at the end
    counts: np.ndarray  # [COUNTS]

    @property
    def gap(self) -> np.ndarray:
        """[F] m between the first two."""
        return np.linalg.norm(self.ground[:, 0] - self.ground[:, 1], axis=1)


@cache
def library(name: str) -> Layer:
    if name.endswith(ALL_WAYS):
        found = library(name.removesuffix(ALL_WAYS))
        return build_actions(found.clips, found.actions, most_ways=10**6)
    if name == REAL:
        folder = Path(os.environ["KUMITE_MOCAP"]) / "boxer"
        return build_actions(mocap.load(folder).clip_set())
    return builtin_layer(cache_folder(None), style=name, level="actions")


def boxers() -> list[str]:
    real = Path(os.environ.get("KUMITE_MOCAP", "")) / "boxer"
    return ["boxing", *([REAL] if os.environ.get("KUMITE_MOCAP") and real.is_dir() else [])]


def stage(job: Job) -> World:
    settings = job.settings
    assert settings.bout is not None
    scene = World(settings, library(job.library or settings.bout.library), seed=job.seed)
    for player, depth in zip(scene.players, job.depths):
        player.depth = depth
    return scene


def play(job: Job) -> Fight:
    scene = stage(job)
    counts = np.zeros(COUNTS, dtype=np.int64)
    if job.tallied:
        vars(scene.tree)["decide"] = partial(tallied, scene.tree, scene.tree.decide, counts)
    motion, number = scene.library, {name: k for k, name in enumerate(scene.names)}
    ground, facing = [], []
    wall, cpu = time.perf_counter(), time.process_time()
    for _ in range(round(job.seconds * scene.fps)):
        scene.step()
        here = scene.root_position[:, [0, 2]].astype(float)
        way = here[scene.floor.opponent] - here
        ground.append(here)
        off = np.arctan2(way[:, 0], way[:, 1]) - scene.cast.facing[:, 2]
        facing.append(np.abs((off + np.pi) % (2 * np.pi) - np.pi))
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    actions = motion.actions
    assert actions is not None
    action = np.searchsorted(actions.start, motion.strikes.frame, side="right") - 1
    short = short_range(actions)[action]
    people = range(len(number))
    thrown, landed = [[] for _ in people], [[] for _ in people]
    damage, falls = [0.0 for _ in people], [[] for _ in people]
    for e in scene.events:
        k = number[e.character]
        if isinstance(e, Strike):
            thrown[k].append(bool(short[e.blow]))
        elif isinstance(e, Hit) and not e.blocked:
            landed[k].append(bool(short[e.blow]))
            at = "head" if e.part == "head" else "torso"
            damage[k] += e.speed * VULNERABILITY[at]
        elif isinstance(e, Reaction) and scene.tree.labels[e.stretch] == "fall":
            falls[k].append(e.frame / scene.fps)
    down = np.array([scene.tree.labels[s] == "fall" for s in scene.tree_fighter.stretch])
    nodes = sum(int(d.nodes.sum()) for d in scene.decisions)
    return Fight(
        scene.fps,
        wall,
        cpu,
        nodes,
        len(scene.decisions),
        np.array(ground),
        np.array(facing),
        thrown,
        landed,
        damage,
        falls,
        down,
        counts,
    )


@cache
def pool() -> ProcessPoolExecutor:
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(WORKERS, context, numba.set_num_threads, (1,))


def fights(scene: str, seeds: int, motion: str | None = None, **more) -> list[Fight]:
    """One for each seed, side by side. motion: a library."""
    jobs = [Job(scene, FIRST_SEED + n, motion, **more) for n in range(seeds)]
    return list(pool().map(play, jobs))


def _off_path(at: np.ndarray, route: Route) -> np.ndarray:
    """How far places [F, 2] are from the line through a route's check points [F] m."""
    p = route.places
    way = np.diff(p, axis=0)
    d = at[:, None] - p[:-1]
    along = np.clip((d * way).sum(-1) / np.maximum((way**2).sum(-1), 1e-12), 0.0, 1.0)
    return np.linalg.norm(d - along[..., None] * way, axis=-1).min(axis=1)


def _off_time(at: np.ndarray, route: Route, fps: float) -> np.ndarray:
    """How far places [F, 2] are from where the route's times have it [F] m."""
    when = np.array([p.time for p in route.points], dtype=float)
    now = np.arange(1, len(at) + 1) / fps
    due = np.stack([np.interp(now, when, route.places[:, i]) for i in range(2)], axis=1)
    return np.linalg.norm(at - due, axis=1)


def _between_pairs(ground: np.ndarray) -> float:
    """The smallest distance between any two of different pairs [m]; fighters 2k, 2k + 1 are one."""
    if ground.shape[1] < 3:
        return np.inf
    least = np.inf
    for here in ground:
        distance, index = KDTree(here).query(here, k=3)  # oneself, perhaps one's rival, another
        other = index // 2 != np.arange(len(here))[:, None] // 2
        least = min(least, float(np.asarray(distance)[other].min(initial=np.inf)))
    return least


@dataclass(frozen=True)
class Followed:
    """How pairs kept to their paths. P pairs, K fighters."""

    middle_off: float  # m, mean, of a pair's middle from its path
    middle_late: float  # m, mean, from where it should be by then
    off: float  # m, mean, of a fighter from its path
    late: float  # m, mean
    apart: float  # m, the closest of different pairs
    down: float  # share of pairs whose second lies at the end
    early: float  # share in which it fell before the last check point was gone for
    felled: np.ndarray  # s, when each of those seconds fell that did
    from_end: float  # m, mean, of a pair's middle from the last check point then


def followed(job: Job, f: Fight) -> Followed:
    routes = [r for r in (w.route() for w in job.settings.fighters) if r is not None]
    middle = 0.5 * (f.ground[:, ::2] + f.ground[:, 1::2])
    pairs, people = range(middle.shape[1]), range(len(routes))
    sent = float(routes[0].points[-2].time or 0.0)  # when the last check point is gone for
    falls = [(k, fell[0]) for k, fell in enumerate(f.falls[1::2]) if fell]
    ends = np.array([r.places[-1] for r in routes[::2]])
    there = [np.hypot(*(middle[round(t * f.fps) - 1, k] - ends[k])) for k, t in falls]
    return Followed(
        float(np.mean([_off_path(middle[:, k], routes[2 * k]) for k in pairs])),
        float(np.mean([_off_time(middle[:, k], routes[2 * k], f.fps) for k in pairs])),
        float(np.mean([_off_path(f.ground[:, k], routes[k]) for k in people])),
        float(np.mean([_off_time(f.ground[:, k], routes[k], f.fps) for k in people])),
        _between_pairs(f.ground),
        float(np.mean(f.down[1::2])),
        float(np.mean([any(t < sent for t in fell) for fell in f.falls[1::2]])),
        np.array([t for _, t in falls]),
        float(np.mean(there)) if there else np.nan,
    )


def along(scene: str, seeds: int, **more) -> list[Followed]:
    found = fights(scene, seeds, **more)
    return [followed(Job(scene, FIRST_SEED, **more), f) for f in found]
