"""What Oshita & Masaoka (2011) say of their results, beside what comes of it here.

    python benchmarks/avoidance.py                          # all sections, as Markdown
    python benchmarks/avoidance.py --only avoided --quick   # one, with few throws
    python benchmarks/avoidance.py -o docs/avoidance.md     # between the marks of the document

With KUMITE_MOCAP set a graph of real takes is measured, too. Throws are drawn with SEED and the
numbers after it: no settings were chosen with these in view.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import numpy as np
from reproduction import _put, _table

from kumite import mocap
from kumite.bench_avoidance import sixteen
from kumite.control import cache_folder
from kumite.control.attack import Attack, thrown
from kumite.control.avoidance import Avoidance, AvoidanceSearch, Outcome, Standing
from kumite.graph import Layer, build_avoidance, builtin_layer
from kumite.kernels import avoid as kernels
from kumite.rotation import planar_apply
from kumite.scene import World, load_scene
from kumite.scene.balls import aimed
from kumite.scene.events import Struck, Throw
from kumite.scene.settings_dodge import BallsSettings, DodgersSettings, DodgeSettings
from kumite.scene.throwing import AIM_SPREAD

SEED = 20110
THROWS, FEW_THROWS = 1000, 60
BLIND = 120  # throws at who does not look
RUNS = 4  # scenes, each with a seed of its own, that the throws are spread over
EVERY = 1.8  # s between throws: the last has landed
PAPER = {  # Table 1, ms: (index, culling)
    (True, True): 14,
    (False, True): 225,
    (True, False): 18,
    (False, False): 496,
}
REAL = ("1_avoid", "3_avoid", "3_pass_duck", "3_pass_jump", "1_jump", "1_jump_1", "1_jump_2",
        "1_jump_high", "1_jump_high_1", "3_jump", "3_walk_side", "3_walk_stop_walk")  # fmt: skip
MOVES_ROOT = 0.3  # m: a part that carries the root farther is a step or a leap

# Graphs ------------------------------------------------------------------------------------------


def real() -> Layer:
    folder = Path(os.environ["KUMITE_MOCAP"]) / "woody"
    return build_avoidance(mocap.load([folder / f"{name}.amc" for name in REAL]).clip_set())


@cache
def library(name: str) -> Layer:
    if name == "sixteen":
        return sixteen()
    if name == "performer":
        return builtin_layer(cache_folder(None), style="avoidance", level="avoidance")
    return real()


def graphs() -> list[str]:
    return ["sixteen", "performer", *(["real"] if os.environ.get("KUMITE_MOCAP") else [])]


# Throws ------------------------------------------------------------------------------------------


@dataclass(eq=False)
class Asked:
    """One search, and what was known when it began."""

    standing: Standing
    attacks: list[Attack]
    now: float
    found: Avoidance
    seconds: float  # that it took


@dataclass(eq=False)
class Thrown:
    """What became of one."""

    searches: list[Asked] = field(default_factory=list)
    struck: bool = False
    nearest: float = np.inf  # m from the body's spheres, as shown
    moved: float = 0.0  # m, mean over spheres of the farthest from where they were, as shown

    @property
    def weighed(self) -> list[Asked]:
        """Searches in which the ball was found to come right."""
        right = (Outcome.FOUND, Outcome.HIT, Outcome.NO_CANDIDATE)
        return [s for s in self.searches if s.found.outcome in right]


@cache
def scene_of(name: str) -> World:
    settings = load_scene("dodgeball")
    new = {**dict(settings), "balls": BallsSettings(throws=100_000, every=EVERY)}
    return World(type(settings).model_construct(**new), library(name))


def play(name: str, throws: int, *, blind: bool = False) -> list[Thrown]:
    """Throws at one who avoids; blind: who does not look."""
    return [t for run in range(RUNS) for t in _play(name, SEED + run, -(-throws // RUNS), blind)]


def _play(name: str, seed: int, throws: int, blind: bool) -> list[Thrown]:
    scene = scene_of(name)
    scene.reset(seed)
    search, out = scene.fire.search, [Thrown() for _ in range(throws)]
    plain = type(search).search

    def noted(standing, attacks, now, *, main=0):
        begin = time.perf_counter()
        found = plain(search, standing, attacks, now, main=main)
        asked = Asked(standing, list(attacks), now, found, time.perf_counter() - begin)
        out[int(attacks[main].name.split()[-1]) - 1].searches.append(asked)
        return found

    vars(search)["search"] = noted
    kept = [list(controllers) for controllers in scene.controllers]
    if blind:
        for controllers in scene.controllers:
            del controllers[0]
    spheres, before, first, most = search.spheres, None, None, 0.0
    current = -1
    for _ in range(round((1.0 + throws * EVERY) * scene.fps)):
        known = len(scene.events)
        scene.step()
        for event in scene.events[known:]:
            if isinstance(event, Throw):
                current, first, most = event.attack - 1, None, np.zeros(len(spheres))
            elif isinstance(event, Struck) and event.attack - 1 == current:
                out[current].struck = True
        if current < 0:
            continue
        ball = scene.fire.balls.position[current % len(scene.fire.balls.position)]
        in_flight = scene.fire.balls.attack[current % len(scene.fire.balls.position)] is not None
        body = spheres.at(scene.cast.position[0], scene.cast.world_wxyz[0])
        first = body if first is None else first
        throw = out[current]
        if in_flight:
            near = np.linalg.norm(body - ball, axis=1) - spheres.radius - scene.fire.settings.radius
            if before is not None:  # as near as both come within the frame
                s = before[0] - before[1]
                u = (body - ball) - s
                along = np.clip(-(s * u).sum(1) / np.maximum((u * u).sum(1), 1e-12), 0, 1)
                swept = np.linalg.norm(s + along[:, None] * u, axis=1)
                near = np.minimum(near, swept - spheres.radius - scene.fire.settings.radius)
            throw.nearest = min(throw.nearest, float(near.min()))
            most = np.maximum(most, np.linalg.norm(body - first, axis=1))
            throw.moved = float(most.mean())
            before = (body, ball.copy())
        else:
            before = None
    del vars(search)["search"]
    for controllers, all_of_them in zip(scene.controllers, kept, strict=True):
        controllers[:] = all_of_them
    return out


# Other choices -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Candidates:
    """Those valid of one search without the index, in the order in which they are enumerated."""

    path: list[tuple[int, ...]]
    part: np.ndarray  # [V] as searches number them
    costs: np.ndarray  # [V, 4] e, and of avoidance, body, time scale
    leaves: np.ndarray  # [V] bool


@cache
def _exhaustive(search: AvoidanceSearch) -> AvoidanceSearch:
    return AvoidanceSearch(search.library, replace(search.settings, index=False))


def candidates(search: AvoidanceSearch, asked: Asked) -> Candidates:
    whole = _exhaustive(search)
    found = whole.search(asked.standing, asked.attacks, asked.now)
    room, count = whole._room(), sum(found.counts)
    valid = np.flatnonzero(room.outcome[:count] == kernels.VALID)
    paths = [tuple(room.path[c, : room.length[c]].tolist()) for c in valid]
    scores = room.scores[valid].copy()
    return Candidates(paths, room.part[valid].copy(), scores[:, :4], scores[:, 4] > 0.0)


def displacement(search: AvoidanceSearch, asked: Asked, path: Sequence[int], part: int) -> float:
    """Mean over the spheres of the farthest [m] from where they were, as a path is planned, until
    its part has ended.
    """
    graph, standing = search.graph, asked.standing
    room, edges = search._room(), np.array(path, dtype=np.int32)
    now = kernels.Now(
        np.asarray(standing.anchor, dtype=float), standing.phase, standing.stop, standing.stretch,
        standing.slowness, np.zeros((2, 3, 3)),
    )  # fmt: skip
    kernels.lay(edges, len(edges), now, graph, room.scratch)
    first, most = None, np.zeros(len(search.spheres))
    for k in range(len(path) + 1):
        low = int(standing.phase) if k == 0 else int(graph.first[path[k - 1]]) - 1
        high = standing.stop if k == 0 else int(graph.last[path[k - 1]])
        if k == len(path):
            high = int(graph.ends[part])
        x, z, c, n = room.scratch.anchor[k]
        anchor = np.array([x, z, np.arctan2(n, c)])
        for f in range(low, high + 1):
            body = planar_apply(anchor, search.volumes.centre[f].T.astype(float))
            first = body if first is None else first
            most = np.maximum(most, np.linalg.norm(body - first, axis=1))
    return float(most.mean())


def steps_and_leaps(search: AvoidanceSearch) -> np.ndarray:
    """Which parts [A] carry the root by more than MOVES_ROOT."""
    root, graph = search.library.clips.root_position, search.graph
    way = root[graph.ends][:, [0, 2]] - root[graph.begins][:, [0, 2]]
    return np.linalg.norm(way, axis=1) > MOVES_ROOT


# Sections ----------------------------------------------------------------------------------------


_SECTIONS: dict[str, Callable[[int], str]] = {}


def _section(name: str):
    def register(function: Callable[[int], str]) -> Callable[[int], str]:
        _SECTIONS[name] = function
        return function

    return register


@cache
def played(name: str, throws: int) -> list[Thrown]:
    """Those of the built-in library are fewer: it is the largest, and only to compare with."""
    return play(name, throws if name != "performer" else max(throws * 3 // 10, FEW_THROWS))


def _share(of: Sequence[bool]) -> str:
    return f"{np.mean(of):.1%} of {len(of)}" if len(of) else "–"


@_section("avoided")
def avoided(throws: int) -> str:
    """How many throws miss."""
    rows = []
    for name in graphs():
        found = played(name, throws)
        blind = play(name, min(throws, BLIND), blind=True)
        right = [t for t in found if t.weighed]
        first = [t for t in right if t.weighed[0].found.outcome == Outcome.FOUND]
        later = [t for t in right if t not in first and _taken(t)]
        never = [t for t in right if t not in first and t not in later]
        wide = [t for t in found if not t.weighed]
        near = np.array([t.nearest for t in first if not t.struck])
        rows.append(
            (
                name,
                _share([not t.struck for t in blind]),
                _share([not t.struck for t in found]),
                _share([not t.struck for t in first]),
                _share([not t.struck for t in later]),
                _share([not t.struck for t in never]),
                _share([not t.struck for t in wide]),
                f"{100 * np.median(near):.0f} cm" if len(near) else "–",
            )
        )
    header = ("graph", "who does not look", "who does", "a dodge is there at first sight")
    more = ("only after another edge", "none is", "it seems to pass by", "nearest, median")
    return f"{_table((*header, *more), rows)}\n\n{_in_time(throws)}"


BINS = ((0.0, 0.5), (0.5, 0.6), (0.6, 0.7), (0.7, 0.8), (0.8, 2.0))  # s


def _in_time(throws: int) -> str:
    """How often a dodge is there by the time left, and what became of the candidates where none."""
    rows, why = [], []
    for name in graphs():
        asked = [t.weighed[0] for t in played(name, throws) if t.weighed]
        shares = []
        for low, high in BINS:
            some = [s.found.outcome == Outcome.FOUND for s in asked if low <= s.found.aim < high]
            shares.append(_share(some))
        rows.append((name, *shares))
        none = [s.found.counts for s in asked if s.found.outcome == Outcome.HIT]
        counts = np.sum(none, axis=0) if none else np.ones(kernels.OUTCOMES)
        of = counts / counts.sum()
        hit = of[kernels.HIT] + of[kernels.CULLED]
        told = (hit, of[kernels.STIFF], of[kernels.TOO_FAST])
        empty = sum(s.found.outcome == Outcome.NO_CANDIDATE for s in asked)
        why.append((name, len(none), *(f"{share:.0%}" for share in told), empty))
    header = ("time to the ball's middle", *(f"{low:g} to {high:g} s" for low, high in BINS))
    one = _table(header, rows)
    header = ("no dodge there", "searches", "candidates hit", "their speed may not be adjusted so")
    return f"{one}\n\n{_table((*header, 'by more than 4', 'searches without any'), why)}"


def _taken(throw: Thrown) -> bool:
    return any(s.found.outcome == Outcome.FOUND for s in throw.searches)


@_section("chosen")
def chosen(throws: int) -> str:
    """How far the body moves for what is chosen, and what agrees."""
    moves, agrees = [], []
    for name in graphs():
        search = scene_of(name).fire.search
        rng, far = np.random.default_rng(SEED), steps_and_leaps(search)
        ours, first, step, leap = [], [], [], []
        same = {k: [] for k in ("e", "e_avoid", "e_body", "e_time")}
        chance, several = [], 0
        for throw in played(name, throws):
            for asked in [s for s in throw.weighed if s.found.outcome == Outcome.FOUND][:1]:
                have = candidates(search, asked)
                plan = asked.found.plan
                assert plan is not None
                mine = (asked.found.path, plan.part)
                k = next(n for n, p in enumerate(have.path) if (p, int(have.part[n])) == mine)
                way = [displacement(search, asked, mine[0], mine[1])]
                ours.append(way[0])
                first.append(displacement(search, asked, have.path[0], int(have.part[0])))
                some = np.flatnonzero(far[have.part])
                if len(some):
                    n = int(rng.choice(some))
                    step.append(displacement(search, asked, have.path[n], int(have.part[n])))
                    leap.append(way[0])
                if len(have.path) > 1:
                    several += 1
                    chance.append(1.0 / len(have.path))
                    for c, key in enumerate(same):
                        same[key].append(bool(have.costs[k, c] <= have.costs[:, c].min() + 1e-9))
        told = (f"{np.mean(v):.3f} m" if v else "–" for v in (ours, first, leap, step))
        moves.append((name, len(ours), *told, len(step)))
        agrees.append(
            (name, several, *(f"{np.mean(v):.0%}" for v in same.values()), f"{np.mean(chance):.0%}")
        )
    one = _table(
        ("graph", "searches", "ours", "first valid", "ours, where a step or leap is valid",
         "a random one of these", "of"), moves,
    )  # fmt: skip
    header = ("graph", "searches with several valid", "least e of all", "least e_avoid")
    two = _table((*header, "least e_body", "least e_time", "one at random would be"), agrees)
    return f"{one}\n\n{two}"


@_section("searches")
def searches(throws: int) -> str:
    """How searches are answered."""
    rows = []
    for name in graphs():
        weighed = [s for t in played(name, throws) for s in t.weighed]
        found = [s for s in weighed if s.found.outcome == Outcome.FOUND]
        index = [s for s in found if s.found.indexed]
        fps = library(name).clips.fps
        left = [(s.standing.stop - s.standing.phase) / fps * s.standing.slowness for s in weighed]
        early = [s.seconds < max(x, 1.0 / fps) for s, x in zip(weighed, left, strict=True)]
        rows.append(
            (
                name,
                len(weighed),
                _share([s.found.indexed for s in found]),
                f"{np.mean([s.found.candidates for s in index]):.0f}" if index else "–",
                f"{np.mean([s.found.candidates for s in weighed if not s.found.indexed]):.0f}",
                _share(early),
                f"{np.median([abs(np.log2(s.found.scale)) for s in found]):.2f}",
            )
        )
    rows.append(("the paper", "", "90 %", 5, 100, "50 %", ""))
    header = ("graph", "searches", "found by the index", "candidates with it", "without")
    more = ("done before the edge ended", "median of abs(log2 s)")
    return _table((*header, *more), rows)


def _repeated(work: Callable[[], object], repeats: int = 5) -> float:
    """Milliseconds of the fastest of a few."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        times.append(1e3 * (time.perf_counter() - begin))
    return min(times)


def anywhere(name: str, count: int) -> list[tuple[Standing, list[Attack], float]]:
    """Throws at who begins a random edge, as the scene aims them."""
    search, rng = scene_of(name).fire.search, np.random.default_rng(SEED)
    table, facing, out = search.library.table, search.library.clips.facing, []
    for stretch in rng.integers(len(table.first), size=count):
        frame = int(table.first[stretch])
        body = search.volumes.centre[frame].T.astype(float)
        goal = body[rng.integers(len(body))] + rng.normal(0.0, AIM_SPREAD, 3)
        place, velocity = aimed(rng, BallsSettings(), facing[frame], goal)
        here = Standing(np.zeros(3), float(frame), int(table.last[stretch]), int(stretch))
        out.append((here, [thrown(place, velocity, BallsSettings().radius)], 0.0))
    return out


@_section("time")
def timings(throws: int) -> str:
    """The paper's Table 1."""
    rows, built = [], []
    rules = DodgeSettings().search()
    for name in graphs():
        asked = anywhere(name, max(throws // 2, 4 * FEW_THROWS))
        search, base = AvoidanceSearch(library(name), replace(rules, index=True)), np.nan
        known = [a for a in asked if search.search(*a).indexed][:100]
        for index, culling in PAPER:
            search = AvoidanceSearch(library(name), replace(rules, index=index, culling=culling))
            _ = search.masks, search.index
            found = [search.search(*a) for a in known]
            weighed = [sum(f.counts) - f.counts[kernels.STIFF] for f in found]
            times = [_repeated(lambda a=a, s=search: s.search(*a), 3) for a in known]
            if not np.isfinite(base):
                base = np.mean(times)
            paper = PAPER[index, culling]
            rows.append(
                (name, "yes" if index else "no", "yes" if culling else "no", len(known),
                 f"{np.mean([f.candidates for f in found]):.0f}", f"{np.mean(weighed):.0f}",
                 f"{np.median(times):.3f}", f"{np.mean(times):.3f}", f"{np.mean(times) / base:.2f}",
                 paper, f"{paper / PAPER[True, True]:.1f}")
            )  # fmt: skip

        def build(name=name, rules=rules) -> AvoidanceSearch:
            search = AvoidanceSearch(library(name), replace(rules, index=True))
            _ = search.index
            return search

        search = build()
        built.append(
            (name, f"{library(name).clips.seconds:.0f} s", search.library.table.states,
             search.library.table.actions, len(library(name).avoidance),
             f"{1e-3 * _repeated(build, 3):.2f} s", f"{search.index_bytes / 1e6:.0f} MB")
        )  # fmt: skip
    header = ("graph", "index", "culling", "searches", "candidates", "that can be timed")
    more = ("median ms", "mean ms", "to both", "the paper's ms", "to both")
    one = _table((*header, *more), rows)
    header = ("graph", "clips", "states", "actions", "parts", "index built in", "its memory")
    return f"{one}\n\n{_table(header, built)}"


@_section("barrage")
def barrage(throws: int) -> str:
    """Two hundred under fire."""
    settings = load_scene("barrage")
    count, seconds = (200, 10.0) if throws > FEW_THROWS else (50, 3.0)
    slow = sixteen(30.0)
    rows = []
    for every in (0.5, 0.05):
        balls = BallsSettings(throws=10_000, first=0.5, every=every, bearing_deg=40, pool=100)
        new = {**dict(settings), "balls": balls, "dodgers": DodgersSettings(count=count)}
        scene = World(type(settings).model_construct(**new), slow, seed=SEED)
        for _ in range(30):
            scene.step()
        cpu, wall, slowest = time.process_time(), time.perf_counter(), 0.0
        for _ in range(round(seconds * scene.fps)):
            begin = time.perf_counter()
            scene.step()
            slowest = max(slowest, time.perf_counter() - begin)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        thrown = sum(isinstance(e, Throw) for e in scene.events)
        rows.append(
            (count, f"{1 / every:g}", thrown, f"{wall / seconds:.2f} s", f"{cpu / seconds:.2f} s",
             f"{1e3 * slowest:.0f} ms")
        )  # fmt: skip
    header = ("characters", "throws a second", "thrown", "wall time for a second", "processor time")
    return _table((*header, "slowest frame"), rows)


def _throws(throws: int) -> str:
    last = SEED + RUNS - 1
    return f"\n\n{throws} throws, {EVERY:g} s apart, in {RUNS} scenes of seeds {SEED} to {last}."


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--only", nargs="+", choices=list(_SECTIONS), default=list(_SECTIONS))
    parser.add_argument("--throws", type=int, default=THROWS, help="at each graph")
    parser.add_argument("--quick", action="store_true", help="few throws")
    parser.add_argument("-o", "--output", type=Path, help="a document with marks")
    given = parser.parse_args()
    throws = FEW_THROWS if given.quick else given.throws
    for name in given.only:
        begin = time.perf_counter()
        text = _SECTIONS[name](throws) + _throws(throws) * (name not in ("time", "barrage"))
        if name in ("time", "barrage"):
            text += f"\n\nLoad of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores."
        print(f"## {name} ({time.perf_counter() - begin:.0f} s)\n\n{text}\n", flush=True)
        if given.output is not None:
            _put(given.output, f"avoidance {name}", text)


if __name__ == "__main__":
    main()
