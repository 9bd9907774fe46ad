"""The figures: how fast, how much memory, how good. Printed by ``kumite bench``, asserted nowhere.

Each figure runs in a process of its own, so that its peak memory is its own, and once before it is
timed, so that compiled kernels are at hand ("from nothing compiled" says so and does not).
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from kumite.bench_avoidance import avoidance_figures
from kumite.bench_compile import Value, compile_figures
from kumite.bench_preparation import preparation_figures
from kumite.errors import KumiteError

REPEATS = 3
SPARRING_SEEDS = range(5)
SPARRING_SECONDS = 60.0
_FIGURES: dict[str, tuple[Callable[[Path], Value], str, float | None]] = {}


def _figure(name: str, unit: str, limit: float | None = None):
    def register(function: Callable[[Path], float]) -> Callable[[Path], float]:
        _FIGURES[name] = (function, unit, limit)
        return function

    return register


def _best(work: Callable[[], Any]) -> float:
    """Seconds of the fastest of a few runs, after one that is not timed."""
    work()
    times = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return min(times)


@cache
def _clips(folder: Path):
    from kumite import mocap

    return mocap.load(folder).clip_set()


@cache
def _library(folder: Path):
    from kumite.graph import build_frames

    return build_frames(_clips(folder))


@_figure("read the boxer folder", "s", 1.0)
def _read(folder: Path) -> float:
    from kumite import mocap

    return _best(lambda: mocap.load(folder).clip_set())


@_figure("read AMC", "frames/s", 20_000)
def _read_amc(folder: Path) -> float:
    from kumite import mocap

    found = sorted(folder.parent.glob("cmu/*/*.amc"), key=lambda p: -p.stat().st_size)[:4]
    if not found:
        return float("nan")
    frames = sum(i.frames for i in mocap.load(found).info)
    return frames / _best(lambda: mocap.load(found))


@_figure("notes: contacts and hits", "s", 0.5)
def _notes(folder: Path) -> float:
    from dataclasses import replace

    from kumite.annotate import find_contacts, find_strikes

    def work() -> None:
        clips = replace(_clips(folder))  # a copy without the kinematics worked out before
        find_contacts(clips)
        find_strikes(clips)

    return _best(work)


@_figure("the performer's clips, all styles, from nothing", "s", 3.0)
def _perform(folder: Path) -> float:
    from kumite import performer

    return _best(lambda: [performer.perform(style) for style in performer.STYLES])


@_figure("distance stage", "frame pairs/s", 1.5e8)
def _distance(folder: Path) -> float:
    from kumite.graph import pose_features
    from kumite.kernels.distance import row_sums

    f = pose_features(_clips(folder))
    out = np.empty(len(_clips(folder)))
    return len(out) ** 2 / _best(lambda: row_sums(f.quaternion, f.weight, f.euclidean, out))


@_figure("graph, joins at left lift-off", "s", 5.0)
def _graph(folder: Path) -> float:
    from kumite.graph import build_frames

    return _best(lambda: build_frames(_clips(folder)))


@_figure("graph, all pairs of frames", "s", 5.0)
def _whole_graph(folder: Path) -> float:
    from kumite.graph import build_frames

    return _best(lambda: build_frames(_clips(folder), event="none"))


def _solve(folder: Path, name: str):
    from kumite.control import approach, solve, strike

    library = _library(folder)
    behaviour = approach() if name == "approach" else strike(library)
    return solve(library, behaviour)


@_figure("approach policy to 1e-4", "s", 1.0)
def _approach(folder: Path) -> float:
    return _best(lambda: _solve(folder, "approach"))


@_figure("strike policy to 1e-4", "s", 5.0)
def _strike(folder: Path) -> float:
    return _best(lambda: _solve(folder, "strike"))


@_figure("Bellman backups, strike policy", "backups/s")
def _backups(folder: Path) -> float:
    backups = _solve(folder, "strike").backups
    return backups / _best(lambda: _solve(folder, "strike"))


STREAM_WORDS = 1 << 23  # 3 arrays of 64 MiB: no cache holds them


@cache
def _stream() -> float:
    """Bytes/s of STREAM's triad: two arrays read, one written (McCalpin's count)."""
    from kumite.kernels.stream import triad

    a, b, c = np.zeros(STREAM_WORDS), np.ones(STREAM_WORDS), np.ones(STREAM_WORDS)
    return 3 * a.nbytes / _best(lambda: triad(a, b, c, 3.0))


@_figure("STREAM triad", "GB/s")
def _triad(folder: Path) -> float:
    return _stream() / 1e9


@_figure("share of STREAM that Bellman backups reach", "share")
def _share_of_stream(folder: Path) -> float:
    """Bytes that a sweep's two kernels ask for, over the time they take, over STREAM's.

    ``back_up_stretches`` goes once through index and weight [L, M, W], reward and Q [L, M], and the
    values [L, M] of the states stretches end in. ``best_actions`` reads a line of Q [M] an action
    and goes through values [N, M] and its copy of them, old and new. Lines of Q (0.6 MB in all)
    and values come again from cache, so the share may be above 1: it would take that much bandwidth
    if they did not.
    """
    from kumite.control import strike
    from kumite.control.policy import stretch_rewards, stretch_tracks
    from kumite.kernels import policy as kernels

    library = _library(folder)
    behaviour, table = strike(library), library.table
    points = behaviour.grid.points
    reward = stretch_rewards(behaviour, stretch_tracks(library), library.clips.fps)
    index = np.empty((*reward.shape, 8), dtype=np.int32)
    weight = np.empty(index.shape, dtype=np.float32)
    kernels.successor_corners(
        table.displacement, points, False, *behaviour.grid.kernel_arguments(), index, weight
    )
    factor = np.full(len(reward), 0.5, dtype=np.float32)
    value, q = np.zeros((table.states, len(points)), np.float32), np.empty_like(reward)
    change = np.empty(table.states, dtype=np.float32)

    def sweep() -> None:
        kernels.back_up_stretches(reward, factor, table.target, index, weight, value, q)
        kernels.best_actions(table.action_start, table.stretch, q, value, change)

    stretches = index.nbytes + weight.nbytes + 2 * reward.nbytes + q.nbytes
    actions = table.actions * len(points) * q.itemsize + 4 * value.nbytes
    return (stretches + actions) / _best(sweep) / _stream()


def _skill(folder: Path):
    from kumite.control import Skill, stretch_tracks

    library = _library(folder)
    near, hit = _solve(folder, "approach"), _solve(folder, "strike")
    return Skill(library, near, hit, stretch_tracks(library))


def _weighed_again() -> int:
    """As fighters of a scene choose, if nothing else is said."""
    from kumite.control import Temper

    return Temper().again


def _over_best_path(folder: Path, aim: str, count: int, few: int = 1) -> float:
    from kumite.control.worth import around, ratios, time_to_target

    skill = _skill(folder)
    return ratios(time_to_target(skill, around(skill, count, 0), aim, few=few)).median


@_figure("time to reach over the best path's, median", "ratio", 1.15)
def _reach(folder: Path) -> float:
    return _over_best_path(folder, "reach", 60, few=_weighed_again())


@_figure("time to hit over the best path's, median", "ratio", 1.15)
def _hit(folder: Path) -> float:
    return _over_best_path(folder, "hit", 40, few=_weighed_again())


@_figure("time to hit over the best path's, median, one backup as in a crowd", "ratio")
def _hit_at_once(folder: Path) -> float:
    return _over_best_path(folder, "hit", 40)


@cache
def _covered(folder: Path):
    from kumite.control.worth import coverage

    return coverage(_skill(folder), 200)


@_figure("targets hit within 2 s, share", "share")
def _hit_soon(folder: Path) -> float:
    return _covered(folder).policy


@_figure("targets hit within 2 s on the best path, share", "share")
def _hit_soon_at_best(folder: Path) -> float:
    return _covered(folder).best


def _sparring(folder: Path):
    from kumite.scene import World, load_scene

    return World(load_scene("sparring"), _library(folder))


@_figure("run sparring", "× real time", 50.0)
def _run(folder: Path) -> float:
    from kumite.scene import record

    scene = _sparring(folder)

    def work() -> None:
        scene.reset(1)
        record(scene, SPARRING_SECONDS)

    return SPARRING_SECONDS / _best(work)


def _crowd(folder: Path, count: int):
    from kumite.scene import World, load_scene, with_count

    scene = World(with_count(load_scene("crowd"), count), _library(folder))
    for _ in range(round(scene.fps)):  # a second in which they come to blows
        scene.step()
    return scene


def _frames(folder: Path, count: int, frames: int) -> float:
    """Seconds that frames of a crowd take."""
    scene = _crowd(folder, count)

    def work() -> None:
        for _ in range(frames):
            scene.step()

    return _best(work)


@_figure("crowd: 30 boxers x 1,000 frames", "s", 0.25)
def _thirty(folder: Path) -> float:
    return _frames(folder, 30, 1000)


@_figure("crowd: 1,000 boxers", "× real time", 1.0)
def _thousand(folder: Path) -> float:
    return 60 / _library(folder).clips.fps / _frames(folder, 1000, 60)


@_figure("crowd: cost of an avatar-frame of 10,000 over that of 30", "ratio")
def _flat(folder: Path) -> float:
    return (_frames(folder, 10_000, 12) / (12 * 10_000)) / (_frames(folder, 30, 300) / (300 * 30))


@cache
def _fights(folder: Path):
    from kumite.scene import measure, record

    scene = _sparring(folder)
    found = []
    for seed in SPARRING_SEEDS:
        scene.reset(seed)
        found.append(measure(record(scene, SPARRING_SECONDS)))
    return found


@_figure("sparring: hits landed by the lesser boxer, least of five minutes", "hits/10 s", 1.0)
def _landed(folder: Path) -> float:
    return min(c.landed for m in _fights(folder) for c in m.characters) * 10 / SPARRING_SECONDS


@_figure("sparring: blows blocked by arms, a boxer's mean", "blows/10 s")
def _blocked(folder: Path) -> float:
    every = [c.blocked for m in _fights(folder) for c in m.characters]
    return sum(every) / len(every) * 10 / SPARRING_SECONDS


@_figure("sparring: foot skate over the source's, worst", "ratio", 1.5)
def _skate(folder: Path) -> float:
    return max(c.skate_ratio or 0.0 for m in _fights(folder) for c in m.characters)


@_figure("sparring: smallest distance between bodies", "m", 0.25)
def _separation(folder: Path) -> float:
    return min(m.min_separation_m or 0.0 for m in _fights(folder))


@_figure("sparring: facing the other within 45°, worst", "share", 0.8)
def _facing(folder: Path) -> float:
    return min(c.facing_share or 0.0 for m in _fights(folder) for c in m.characters)


@_figure("sparring: largest jump of root speed at a join", "m/s", 0.3)
def _jump(folder: Path) -> float:
    return max(c.join_jump_m_s for m in _fights(folder) for c in m.characters)


PLACES = 6  # of a fight, at which its game tree is searched
FIGHT_SECONDS = 8.0


@cache
def _places(folder: Path):
    """The game of a fight of the folder's actions, and (game, state, players, recent) at moments at
    which someone chooses."""
    from kumite.graph import build_actions
    from kumite.scene import World, load_scene, record

    scene = World(load_scene("boxing"), build_actions(_clips(folder)), seed=1)
    tree, decide, found = scene.tree, scene.tree.decide, []

    def note(state, players, recent, others):
        found.append((tree.game(players, recent, others=others), state, players, recent))
        return decide(state, players, recent, others)

    vars(tree)["decide"] = note
    record(scene, FIGHT_SECONDS)
    del vars(tree)["decide"]
    return tree, found[2 :: max((len(found) - 2) // PLACES, 1)][:PLACES]


def _whole_trees(folder: Path, all_cores: bool) -> float:
    """Nodes/s of whole trees of three levels."""
    from kumite.control.game_tree import SEARCH

    tree, places = _places(folder)
    search = SEARCH.parallel if all_cores else SEARCH.serial

    def nodes() -> int:
        return sum(int(search(g, s, 3, tree.most, False).nodes.sum()) for g, s, *_ in places)

    return nodes() / _best(nodes)


@_figure("game tree: nodes on one core", "nodes/s", 1e6)
def _nodes(folder: Path) -> float:
    return _whole_trees(folder, False)


@_figure("game tree: nodes on all cores", "nodes/s", 1.8e6)
def _nodes_on_all_cores(folder: Path) -> float:
    return _whole_trees(folder, True)


@_figure("game tree: nodes on all cores over those on one", "times")
def _more_on_all_cores(folder: Path) -> float:
    return _whole_trees(folder, True) / _whole_trees(folder, False)


def _deciding(folder: Path, depth: int) -> float:
    """Seconds that a decision takes, mean."""
    from dataclasses import replace

    tree, places = _places(folder)
    sides = [((replace(p[0], depth=depth), p[1]), state, recent) for _, state, p, recent in places]
    return _best(lambda: [tree.decide(s, p, recent) for p, s, recent in sides]) / len(sides)


@_figure("game tree: a decision 1 level deep", "s")
def _decision_1(folder: Path) -> float:
    return _deciding(folder, 1)


@_figure("game tree: a decision 2 levels deep", "s")
def _decision_2(folder: Path) -> float:
    return _deciding(folder, 2)


@_figure("game tree: a decision 3 levels deep", "s", 0.03)
def _decision_3(folder: Path) -> float:
    return _deciding(folder, 3)


@_figure("game tree: a decision 4 levels deep", "s", 1.0)
def _decision_4(folder: Path) -> float:
    return _deciding(folder, 4)


@_figure("game tree: nodes looked at for a decision 3 levels deep, mean", "nodes")
def _looked_at(folder: Path) -> float:
    tree, places = _places(folder)
    found = [tree.decide(state, players, recent) for _, state, players, recent in places]
    return float(np.mean([d.nodes.sum() for d in found]))


_FIGURES |= preparation_figures(_best)
_FIGURES |= avoidance_figures(_best)
_FIGURES |= compile_figures()


@_figure("kumite build from nothing compiled", "s", 90.0)
def _cold(folder: Path) -> float:
    with tempfile.TemporaryDirectory() as scratch:
        environment = {**os.environ, "NUMBA_CACHE_DIR": f"{scratch}/numba"}
        command = [sys.executable, "-m", "kumite", "build", str(folder)]
        begin = time.perf_counter()
        subprocess.run(
            [*command, "-o", f"{scratch}/cold.kumite"],
            env=environment,
            check=True,
            capture_output=True,
        )
        return time.perf_counter() - begin


def default_folder(scratch: Path) -> Path:
    """The boxer's clips where KUMITE_MOCAP says, else the built-in performer's, written as BVH."""
    root = os.environ.get("KUMITE_MOCAP")
    if root and (Path(root) / "boxer").is_dir():
        return Path(root) / "boxer"
    from kumite import performer
    from kumite.export.bvh import write_bvh

    for clip in performer.perform(mirrored=False).clips:
        write_bvh(scratch / f"{clip.name}.bvh", clip)
    return scratch


def run_all(
    folder: Path | None, only: str | None, progress: Callable[[str], None]
) -> list[dict[str, Any]]:
    """Every figure (whose name holds ``only``) as {"name", "value", "unit", "limit", "peak_mb"}.

    A limit is what is wanted: at most, for seconds, ratios and jumps; at least, for the others.
    """
    names = [n for n in _FIGURES if only is None or only in n]
    if not names:
        raise KumiteError(f"no figure has {only!r} in its name; expected one of {list(_FIGURES)}")
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        chosen = folder or default_folder(Path(scratch))
        for name in names:
            progress(name)
            done = subprocess.run(
                [sys.executable, "-m", "kumite.bench", name, str(chosen)],
                capture_output=True,
                text=True,
            )
            if done.returncode:
                raise KumiteError(f"{name}: {done.stderr.strip().splitlines()[-1]}")
            found = json.loads(done.stdout.splitlines()[-1])
            rows += [row for row in found if np.isfinite(row["value"])]
    return rows


def _main(name: str, folder: str) -> None:
    function, unit, limit = _FIGURES[name]
    value = function(Path(folder))
    peak = _peak_mb(children=function is _cold or name in compile_figures())
    told = {"unit": unit, "limit": limit, "peak_mb": peak}
    values = value if isinstance(value, dict) else {"": value}
    rows = [{"name": f"{name}: {n}" if n else name, "value": v, **told} for n, v in values.items()]
    print(json.dumps(rows))


def _peak_mb(children: bool) -> float | None:
    """The most memory [MB] that this process, or its children, had; None where nobody tells."""
    try:
        import resource
    except ModuleNotFoundError:  # Windows
        return None
    who = resource.RUSAGE_CHILDREN if children else resource.RUSAGE_SELF
    peak = resource.getrusage(who).ru_maxrss * (1 if sys.platform == "darwin" else 1024) / 1e6
    return round(peak, 1)


if __name__ == "__main__":
    _main(*sys.argv[1:3])
