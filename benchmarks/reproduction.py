"""What Shum, Komura & Yamazaki (2012) say of their results, beside what comes of it here.

    python benchmarks/reproduction.py                          # all sections, as Markdown
    python benchmarks/reproduction.py --only chase --quick     # one, on two seeds
    python benchmarks/reproduction.py -o docs/reproduction.md  # between the marks of the document

With KUMITE_MOCAP set what boxers do is measured on the real boxer's library, too. Seeds begin at
FIRST_SEED: no settings were chosen with these in view.
"""

from __future__ import annotations

import argparse
import re
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from fights import (
    FIRST_SEED,
    SECONDS,
    Fight,
    Job,
    along,
    boxers,
    fights,
    followed,
    library,
    play,
    stage,
)
from flaws import COMBINATIONS, KEPT, NODES, PUT_UP, RULES

from kumite.scene import World, load_scene

PAPER_PRUNING = {"boxing": (120.0, 35.5), "sword": (94.3, 68.2), "locomotion": (95.8, 40.3)}
FEW_SEEDS, SEEDS = 2, 10
CLOSE = 0.5  # m between pelvises of different pairs: nearer they run into each other

_SECTIONS: dict[str, Callable[[int], str]] = {}


def _section(name: str):
    def register(function: Callable[[int], str]) -> Callable[[int], str]:
        _SECTIONS[name] = function
        return function

    return register


# Tables ------------------------------------------------------------------------------------------


def _table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)


def _spread(values: Iterable[float], form: str = ".2f") -> str:
    """Mean, and the least and the largest."""
    v = np.array(list(values), dtype=float)
    if not len(v):
        return "–"
    return f"{v.mean():{form}} ({v.min():{form}} to {v.max():{form}})"


def _runs(seeds: int, time: str = f"{SECONDS:g} s each") -> str:
    return f"Seeds {FIRST_SEED} to {FIRST_SEED + seeds - 1}, {time}."


def _said(met: bool) -> str:
    return "yes" if met else "**no**"


@_section("pruning")
def pruning(seeds: int) -> str:
    """Table V."""
    runs = [("boxing", n, 2 * seeds) for n in boxers()]
    runs += [("sword", "sword", 2 * seeds), ("chase", "locomotion", 2 * seeds)]
    rows, why = [], []
    for scene, name, count in runs:
        found = fights(scene, count, name, depths=(3, 3), endless=True, tallied=True)
        counts = np.sum([f.counts for f in found], axis=0)
        flaws = counts[:COMBINATIONS]
        offered, nodes = flaws.sum(), counts[NODES]
        before, after = offered / nodes, counts[KEPT] / nodes
        paper = PAPER_PRUNING.get(name)
        told = f"{paper[0]} → {paper[1]}, {1 - paper[1] / paper[0]:.1%}" if paper else ""
        pruned = f"{1 - after / before:.1%}"
        minutes = f"{count * SECONDS / 60:g}"
        actions = len(library(name).table.first)
        rows.append((name, actions, minutes, f"{before:.1f}", f"{after:.1f}", pruned, told))
        number, left, shares = np.arange(COMBINATIONS), np.ones(COMBINATIONS, dtype=bool), []
        for bits in RULES.values():
            has = (number & bits) > 0
            alone = has & ((number & ~bits) == 0)
            each = [flaws[has].sum(), flaws[has & left].sum(), flaws[alone].sum()]
            shares.append(" / ".join(f"{100 * share / offered:.1f}" for share in each))
            left &= ~has
        gap = np.mean([f.gap.mean() for f in found])
        why.append((name, *shares, f"{counts[PUT_UP] / nodes:.1%}", f"{gap:.2f} m"))
    header = ("library", "actions", "minutes", "before", "after", "pruned", "the paper's")
    reasons = ("library", *RULES, "nodes where nothing passes all", "mean distance")
    return (
        f"{_table(header, rows)}\n\nOf 100 actions offered: how many break a rule / break it and"
        f" none before it / break no other:\n\n{_table(reasons, why)}"
    )


# Time --------------------------------------------------------------------------------------------


def _best(work: Callable[[], Any], repeats: int) -> tuple[float, float, Any]:
    """Wall and processor seconds of the fastest of a few runs, and what came of it."""
    found = []
    for _ in range(repeats):
        cpu, wall = time.process_time(), time.perf_counter()
        came = work()
        found.append((time.perf_counter() - wall, time.process_time() - cpu, came))
    return min(found, key=lambda f: f[0])


def _places(library: str, count: int) -> tuple[World, list]:
    """A fight, and what was asked in decisions spread over 30 s of it."""
    scene, found = stage(Job("boxing", FIRST_SEED, library)), []
    decide = scene.tree.decide

    def note(*given):
        found.append(given)
        return decide(*given)

    vars(scene.tree)["decide"] = note
    for _ in range(round(SECONDS * scene.fps)):
        scene.step()
    del vars(scene.tree)["decide"]
    return scene, found[1 :: max(len(found) // count, 1)][:count]


@_section("time")
def timings(seeds: int) -> str:
    """One decision by depth; 30 s of a fight."""
    few = {4: 12, 5: 4} if seeds > FEW_SEEDS else {4: 4, 5: 1}
    rows, runs = [], []
    for name in boxers():
        scene, places = _places(name, 24)
        for bounds, depth in [(b, d) for b in (True, False) for d in range(1, 6)]:
            count = few.get(depth, 24) * (1 + (bounds and depth > 3))
            wall, cpu, nodes = [], 0.0, 0
            for state, players, *rest in places[:: max(len(places) // count, 1)]:
                pair = (replace(players[0], depth=depth), players[1])
                decide = partial(scene.tree.decide, state, pair, *rest, bounds=bounds)
                seconds, used, decision = _best(decide, 3 if depth < 4 else 1)
                nodes += int(decision.nodes.sum())
                wall.append(1e3 * seconds)
                cpu += used
            row = (name, "bounded" if bounds else "whole", depth, len(wall))
            ms = (np.median(wall), np.max(wall), 1e3 * cpu / len(wall))
            rate = 1e3 * nodes / sum(wall)
            told = f"{nodes / len(wall):,.0f}", f"{rate:.1e}"
            rows.append((*row, *(f"{m:.3g}" for m in ms), *told))
        for depth in range(1, 6 if seeds > FEW_SEEDS else 5):  # at 5 it takes minutes
            job = Job("boxing", FIRST_SEED, name, depths=(depth, depth))
            _, _, f = _best(partial(play, job), 3 if depth < 4 else 1)
            per = f"{f.nodes / f.decisions:,.0f}"
            runs.append((name, depth, f"{f.wall:.2f}", f"{f.cpu:.2f}", f.decisions, per))
    header = ("library", "tree", "depth", "decisions", "median ms", "most ms", "mean CPU ms")
    whole = _table((*header, "nodes each", "nodes/s"), rows)
    fought = ("library", "depth of both", "wall s", "CPU s", "decisions", "nodes each")
    return f"One decision:\n\n{whole}\n\n30 s of `boxing`:\n\n{_table(fought, runs)}"


# Along paths -------------------------------------------------------------------------------------


@_section("formation")
def formation(seeds: int) -> str:
    """A hundred pairs along spirals."""
    rows = []
    for n in range(min(seeds, 3)):
        job = Job("spiral", FIRST_SEED + n, pairs=100)
        f = play(job)
        w = followed(job, f)
        time_taken = f"{f.wall:.1f}", f"{f.cpu:.1f}", f.decisions
        off = f"{w.middle_off:.2f}", f"{w.middle_late:.2f}", f"{w.apart:.2f}"
        rows.append((job.seed, *time_taken, *off, f"{w.down:.0%}", f"{w.early:.0%}"))
    header = ("seed", "wall s", "CPU s", "decisions", "middle to its path m", "to its due place m")
    header += ("closest of different pairs m", "blue lies at the end", "fell too early")
    return _table(header, rows)


# Who does what -----------------------------------------------------------------------------------


def _blows(found: list[Fight], who: Sequence[int]) -> tuple[float, float, str, str]:
    """Shares of short-range blows among those thrown and landed; both as they are told."""
    out = []
    for blows in ([f.thrown for f in found], [f.landed for f in found]):
        short = [b for of in blows for k in who for b in of[k]]
        out.append((float(np.mean(short)) if short else np.nan, len(short)))
    (thrown, n), (landed, m) = out
    return thrown, landed, f"{thrown:.0%} of {n}", f"{landed:.0%} of {m}" if m else "none"


@_section("boxing")
def boxing(seeds: int) -> str:
    """Infighters, general boxers, an outboxer."""
    claims, rows = [], []
    sides = (("infight", "both", (0, 1)), ("boxing", "both", (0, 1)))
    sides += (("outbox", "the outboxer", (0,)), ("outbox", "its rival", (1,)))
    for name in boxers():
        found = {scene: fights(scene, seeds, name) for scene in ("infight", "boxing", "outbox")}
        shares = []
        for scene, told, who in sides:
            thrown, _, *shorts = _blows(found[scene], who)
            shares.append(thrown)
            gap = _spread(f.gap.mean() for f in found[scene])
            hits = np.mean([len(f.landed[k]) for f in found[scene] for k in who])
            rows.append((name, scene, told, f"{gap} m", *shorts, f"{hits:.1f}"))
        near = [float(np.mean([f.gap.mean() for f in f_])) for f_ in found.values()]
        met = near[0] < near[1] < near[2]
        told = " / ".join(f"{m:.2f}" for m in near)
        claims.append((name, "distance", "in < general < out", f"{told} m", _said(met)))
        met = shares[0] > shares[1] > shares[2]
        told = " / ".join(f"{s:.0%}" for s in shares[:3])
        claims.append((name, "short of thrown", "in > general > out", told, _said(met)))
    header = ("library", "scene", "who", "distance", "short of thrown", "short of landed")
    return (
        f"{_table(('library', 'figure', 'wanted', 'reached', 'met'), claims)}\n\n"
        f"{_table((*header, 'hits landed each'), rows)}\n\n{_runs(seeds)}"
    )


def _match(scene: str, seeds: int, name: str) -> tuple[object, ...]:
    """Matches of depth 4 against depth 2, each seed with either of them as red."""
    mine, theirs, dealt, taken = [], [], [], []
    for k, depths in enumerate(((4, 2), (2, 4))):
        for f in fights(scene, seeds, name, depths=depths):
            mine.append(len(f.landed[k]))
            theirs.append(len(f.landed[1 - k]))
            dealt.append(f.damage[k])
            taken.append(f.damage[1 - k])
    won, lost = (float(np.mean(np.sign(np.subtract(mine, theirs)) == s)) for s in (1, -1))
    hits = f"{np.mean(mine):.1f} : {np.mean(theirs):.1f}"
    damage = f"{np.mean(dealt):.0f} : {np.mean(taken):.0f} m/s"
    told = f"{won:.0%} won, {lost:.0%} lost, {1 - won - lost:.0%} even"
    return scene, name, "≥ 80 % won", told, hits, damage, _said(won >= 0.8), len(mine)


@_section("smart")
def smart(seeds: int) -> str:
    """The deeper tree wins."""
    rows = [_match("smart", seeds, name) for name in boxers()]
    rows += [_match("sword", seeds, "sword")]
    header = ("scene", "library", "wanted", "depth 4 against depth 2", "hits", "damage")
    return _table((*header, "met", "matches"), rows)


@_section("sword")
def sword(seeds: int) -> str:
    """Nothing self-evidently wrong with a sword fight."""
    found = fights("sword", seeds)
    hits = np.array([len(n) / SECONDS * 60 for f in found for n in f.landed])
    blows = np.array([len(n) / SECONDS * 60 for f in found for n in f.thrown])
    facing = 100 * np.array([np.mean(f.facing < np.radians(45.0), axis=0) for f in found]).ravel()
    mean, least = [f.gap.mean() for f in found], [f.gap.min() for f in found]
    near = max(abs(gap - 1.5) for gap in mean)
    rows = [
        ("blows thrown a minute by each", "> 0", _spread(blows, ".1f"), _said(blows.min() > 0)),
        ("blows landed a minute by each", "some", _spread(hits, ".1f"), _said(hits.mean() > 0)),
        ("fighters who land none in 30 s", "", f"{np.mean(hits == 0):.0%}", ""),
        ("mean distance of a fight", "1.5 m within 0.5", f"{_spread(mean)} m", _said(near < 0.5)),
        ("closest in a fight", "> 0.25 m", f"{_spread(least)} m", _said(min(least) > 0.25)),
        ("facing within 45°, %", "≥ 80", _spread(facing, ".0f"), _said(facing.min() >= 80)),
    ]
    return _table(("figure", "wanted", "reached", "met"), rows) + f"\n\n{_runs(seeds)}"


# Chases ------------------------------------------------------------------------------------------


@_section("chase")
def chase(seeds: int) -> str:
    """A chaser that looks further ahead than the runaway catches it quickly."""
    rows, bout = [], load_scene("chase").bout
    assert bout is not None and bout.arena is not None
    runs = [("chase", depths, False) for depths in ((4, 2), (2, 2), (2, 4))]
    runs += [("chase, endless", depths, True) for depths in ((4, 2), (2, 2))]
    runs += [("two-chasers", depths, False) for depths in ((3, 3, 2), (2, 2, 2), (4, 4, 2))]
    for scene, depths, endless in runs:
        name = scene.partition(",")[0]
        found, when = fights(name, 2 * seeds, depths=depths, endless=endless), []
        for f in found:  # the runaway is the last
            gap = np.linalg.norm(f.ground[:, :-1] - f.ground[:, -1:], axis=2).min(axis=1)
            near = np.flatnonzero(gap < bout.catch)
            when.append((near[0] + 1) / f.fps if len(near) else np.inf)
        caught = [w for w in when if np.isfinite(w)]
        median = np.median(when) if len(caught) > len(when) / 2 else np.inf
        told = f"{median:.1f} s" if np.isfinite(median) else f"over {SECONDS:g} s"
        mean = f"{np.minimum(when, SECONDS).mean():.1f} s"
        who = f"{' and '.join(map(str, depths[:-1]))} against {depths[-1]}"
        shares = f"{len(caught)} of {len(when)}"
        rows.append((scene, who, shares, mean, told, f"{_spread(caught, '.1f')} s"))
    header = ("scene", "depths, chaser against runaway", f"within {bout.catch} m in {SECONDS:g} s")
    more = (f"mean, who is not counted as {SECONDS:g} s", "median of all", "of those caught")
    return f"{_table((*header, *more), rows)}\n\n{_runs(2 * seeds, f'at most {SECONDS:g} s each')}"


@_section("paths")
def paths(seeds: int) -> str:
    """Chases along paths."""
    rows = []
    for scene in ("circle", "crossing-paths"):
        routes = [r for r in (f.route() for f in load_scene(scene).fighters) if r is not None]
        found = along(scene, seeds, seconds=max(float(r.points[-1].time or 0.0) for r in routes))
        off, late = [w.off for w in found], [w.late for w in found]
        met = _said(max(off) < routes[0].points[0].radius)
        told = "within a check point's radius, 1 m"
        rows.append((scene, "a fighter to its path, mean of a run", told, f"{_spread(off)} m", met))
        rows.append((scene, "to where it is due", "", f"{_spread(late)} m", ""))
        if len(routes) > 2:
            apart = [w.apart for w in found]
            met = _said(min(apart) > CLOSE)
            rows.append(
                (scene, "closest of different pairs", f"> {CLOSE} m", f"{_spread(apart)} m", met)
            )
    return (
        _table(("scene", "figure", "wanted", "reached", "met"), rows)
        + f"\n\n{_runs(seeds, 'each to its last check point')}"
    )


@_section("spiral")
def spiral(seeds: int) -> str:
    """Pairs fight along spirals, and at the end one of each is knocked down."""
    found = along("spiral", seeds)
    down, early = [100 * w.down for w in found], [100 * w.early for w in found]
    off, late, apart = (
        [getattr(w, n) for w in found] for n in ("middle_off", "middle_late", "apart")
    )
    when, there = [w.felled.mean() for w in found], [w.from_end for w in found]
    rows = [
        ("blue lies at the end", "100 %", f"{_spread(down, '.0f')} %", _said(min(down) == 100)),
        ("blue fell before it was to", "0 %", f"{_spread(early, '.0f')} %", _said(max(early) == 0)),
        ("when it fell, mean of a run", "", f"{_spread(when, '.1f')} s", ""),
        (
            "a pair's middle to the last check point then, mean of a run",
            "within its radius, 0.7 m",
            f"{_spread(there)} m",
            _said(max(there) <= 0.7),
        ),
        ("a pair's middle to its path", "≤ 0.5 m", f"{_spread(off)} m", _said(max(off) <= 0.5)),
        ("to where it is due", "", f"{_spread(late)} m", ""),
        (
            "closest of different pairs",
            f"> {CLOSE} m",
            f"{_spread(apart)} m",
            _said(min(apart) > CLOSE),
        ),
    ]
    return (
        _table(("figure", "wanted", "reached", "met"), rows) + f"\n\n{_runs(seeds)} Twelve pairs."
    )


# The document ------------------------------------------------------------------------------------


def _put(document: Path, name: str, text: str) -> None:
    """Between the marks of a section stands what was measured."""
    old = document.read_text("utf-8")
    marks = f"<!-- {name} -->", f"<!-- /{name} -->"
    pattern = re.escape(marks[0]) + ".*?" + re.escape(marks[1])
    new, times = re.subn(pattern, lambda _: f"{marks[0]}\n{text}\n{marks[1]}", old, flags=re.DOTALL)
    if times != 1:
        raise SystemExit(
            f"{document}: expected {marks[0]} … {marks[1]} once, found it {times} times"
        )
    document.write_text(new, "utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--only", nargs="+", choices=list(_SECTIONS), default=list(_SECTIONS))
    parser.add_argument("--quick", action="store_true", help="two seeds of each")
    parser.add_argument("-o", "--output", type=Path, help="a document with marks")
    given = parser.parse_args()
    for name in given.only:
        begin = time.perf_counter()
        text = _SECTIONS[name](FEW_SEEDS if given.quick else SEEDS)
        print(f"## {name} ({time.perf_counter() - begin:.0f} s)\n\n{text}\n", flush=True)
        if given.output is not None:
            _put(given.output, name, text)


if __name__ == "__main__":
    main()
