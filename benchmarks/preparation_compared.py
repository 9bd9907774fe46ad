"""People who prepare on their way, beside those who prepare in all joints alike, or not at all.

    python benchmarks/preparation_compared.py                         # as Markdown
    python benchmarks/preparation_compared.py --runs 20 --only switch  # one section, few
    python benchmarks/preparation_compared.py -o docs/preparation.md  # between its marks

Approaches begin anywhere 3 to 7 m from what there is to do, facing anywhere: the same ones for
every way of preparing. All of a seed and a way go in one scene, each in a field of its own. Shum
et al. (2013) show pictures of theirs and name no figures.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from reproduction import _put, _table

from kumite.clip import LIMBS, SIDES
from kumite.control import PreparationSettings, cache_folder
from kumite.graph import Layer, builtin_layer, load_library
from kumite.graph.preparing import KINDS
from kumite.rotation import angle, conjugate, log, multiply, rotate
from kumite.scene import PrepareScene
from kumite.scene.events import Hit, Launch, Passed, Touched
from kumite.scene.metrics import foot_skate, source_skate
from kumite.scene.settings import SceneSettings
from kumite.scene.settings_prepare import PrepareSettings, TargetSettings, WalkerSettings
from kumite.scene.walkers import ON_THE_WAY, headless

SEED = 300
RUNS = 100  # approaches of each target motion
FIELD = 40.0  # m from one to the next: nobody is in another's way
NEAREST, FARTHEST = 3.0, 7.0  # m from what there is to do
PATIENCE, AFTER = 20.0, 8.0  # s in which a target motion is to begin, and that are watched besides
AROUND = 2  # frames before and after a launch in which a jump is put down to it
BINS = np.arange(0.0, 3.01, 0.25)  # m
WAYS = ("none", "linear", "ours")
PRINTED = "ours, constants as printed"


@dataclass(eq=False)
class Approaches:
    """What became of K approaches, over F frames."""

    fps: float
    label: tuple[str, ...]  # [K] target motion
    kind: np.ndarray  # [K] index into KINDS
    launch: np.ndarray  # [K] frame, or -1: it did not begin in time
    apart: np.ndarray  # [K] deg, from the pose shown to the one that is begun at
    to_reference: np.ndarray  # [K] deg, to the reference posture
    to_contact: np.ndarray  # [K] s
    level: np.ndarray  # [F, K] chosen
    alpha: np.ndarray  # [F, K] shown
    away: np.ndarray  # [F, K] m, to where the target motion is to begin
    source: np.ndarray  # [F, K] m, to what it is done at
    speed: np.ndarray  # [F, K] m/s, of the root over the ground
    turn_jump: np.ndarray  # [F, K] rad/s, the largest change of a joint's angular velocity
    root_jump: np.ndarray  # [F, K] m/s, change of the root's velocity
    feet: np.ndarray  # [F, K, 4, 3] m: ankles, then toes
    on_ground: np.ndarray  # [F, K, 2]
    miss: np.ndarray  # [K] m, least distance of the tip to where the ball lay; NaN of obstacles
    hit: np.ndarray  # [K] bool
    passed: np.ndarray  # [K] bool, obstacles
    touched: np.ndarray  # [K] bool

    @property
    def began(self) -> np.ndarray:
        return self.launch >= 0

    @property
    def before(self) -> np.ndarray:
        """Frames [F, K] of the way, up to the launch."""
        frame = np.arange(len(self.alpha))[:, None]
        return frame < np.where(self.began, self.launch, len(self.alpha))


def fields(library: Layer, preparation: str, runs: int, seed: int) -> SceneSettings:
    """A scene of ``runs`` approaches of each target motion."""
    preparing = library.preparing
    assert preparing is not None
    labels = preparing.hierarchy.targets.label
    rng = np.random.default_rng(seed)
    walkers, things = [], []
    across = int(np.ceil(np.sqrt(runs * len(labels))))
    for n in range(runs * len(labels)):
        middle = FIELD * np.array([n % across, n // across])
        bearing, yaw, way = rng.uniform(-np.pi, np.pi, 3)
        at = middle + rng.uniform(NEAREST, FARTHEST) * np.array([np.sin(bearing), np.cos(bearing)])
        walkers.append(
            WalkerSettings(
                name=f"w{n}", position=tuple(at), yaw_deg=np.degrees(yaw), goes_to=(f"t{n}",)
            )
        )
        things.append(
            TargetSettings(
                name=f"t{n}",
                kind=labels[n % len(labels)],
                position=tuple(middle),
                yaw_deg=np.degrees(way),
            )
        )
    return SceneSettings(
        title="fields",
        about="approaches side by side",
        walker=tuple(walkers),
        target=tuple(things),
        prepare=PrepareSettings.model_validate({"preparation": preparation}),
    )


def approach(library: Layer, cache_at: Path | None, way: str, runs: int, seed: int) -> Approaches:
    """All approaches of a seed, in one way of preparing."""
    settings = fields(library, "ours" if way == PRINTED else way, runs, seed)
    learning = PreparationSettings() if way == PRINTED else None
    scene = PrepareScene(settings, library, seed=seed, cache=cache_at, learning=learning)
    preparing, clips, fps = library.preparing, library.clips, scene.fps
    assert preparing is not None
    skeleton, w, things = library.clips.skeleton, scene.walkers, scene.things
    count = len(scene.names)
    feet = [skeleton.joint(f"{s}_foot") for s in SIDES] + [
        skeleton.joint(f"{s}_toe") for s in SIDES
    ]
    reference = headless(
        clips.wxyz[preparing.reference], clips.facing[preparing.reference, 2]
    )  # [T, J, 4]
    limb = preparing.limb[things.motion]
    frames = round((PATIENCE + AFTER) * fps)
    rows: dict[str, list[np.ndarray]] = {
        k: [] for k in ("level", "alpha", "away", "source", "speed", "turn_jump", "root_jump",
                        "feet", "on_ground")
    }  # fmt: skip
    launch = np.full(count, -1)
    apart, to_reference, to_contact = (np.full(count, np.nan) for _ in range(3))
    miss = np.full(count, np.inf)
    hit, passed, touched = (np.zeros(count, dtype=bool) for _ in range(3))
    known = 0
    root, wxyz, turning, moving = w.shown.root_position.copy(), w.shown.wxyz.copy(), None, None
    yaw = w.facing[:, 2].copy()
    for f in range(frames):
        rows["away"].append(w.off()[0])
        ground = things.home[:, [0, 2]] - w.facing[:, :2]
        rows["source"].append(np.hypot(*ground.T))
        scene.step()
        for event in scene.events[known:]:
            k = int(event.character[1:])
            if isinstance(event, Launch) and launch[k] < 0 and f < PATIENCE * fps:
                launch[k], t = f, int(w.doing[k])
                apart[k], to_contact[k] = event.apart_deg, event.to_contact
                like = headless(wxyz[k : k + 1], yaw[k : k + 1])
                off = angle(reference[t][None], like)
                to_reference[k] = np.degrees(np.sqrt(np.mean(off**2)))
            first = launch[k] >= 0 and f < launch[k] + AFTER * fps
            hit[k] |= isinstance(event, Hit) and first
            passed[k] |= isinstance(event, Passed) and first
            touched[k] |= isinstance(event, Touched) and first
        known = len(scene.events)
        shown = w.shown
        now_moving = (shown.root_position - root) * fps
        now_turning = log(multiply(conjugate(wxyz), shown.wxyz)) * fps
        still = np.zeros(count)
        rows["turn_jump"].append(
            still if turning is None
            else np.linalg.norm(now_turning - turning, axis=-1).max(axis=1)
        )  # fmt: skip
        rows["root_jump"].append(
            still if moving is None else np.linalg.norm(now_moving - moving, axis=-1)
        )
        rows["speed"].append(np.hypot(now_moving[:, 0], now_moving[:, 2]))
        turning, moving = now_turning, now_moving
        root, wxyz = shown.root_position.copy(), shown.wxyz.copy()
        yaw = shown.facing[:, 2].copy()
        rows["level"].append(w.level.copy())
        rows["alpha"].append(w.alpha.copy())
        rows["feet"].append(shown.position[:, feet].astype(np.float32))
        rows["on_ground"].append(w.cast.contacts.copy())
        for k in np.flatnonzero((w.doing != ON_THE_WAY) & (limb >= 0)).tolist():
            if launch[k] < 0:
                continue
            joint, offset = skeleton.tip(LIMBS[limb[k]])
            tip = shown.position[k, joint] + rotate(shown.world_wxyz[k, joint], offset)
            miss[k] = min(miss[k], float(np.linalg.norm(tip - things.home[k])))
    arrays = {k: np.array(v) for k, v in rows.items()}
    return Approaches(
        fps=fps, label=tuple(settings.targets[k].kind for k in range(count)), kind=things.kind,
        launch=launch, apart=apart, to_reference=to_reference, to_contact=to_contact,
        miss=np.where(np.isfinite(miss), miss, np.nan), hit=hit, passed=passed, touched=touched,
        **arrays,
    )  # fmt: skip


# Sections ----------------------------------------------------------------------------------------

Played = Callable[[str], Approaches]
_SECTIONS: dict[str, Callable[[Layer, Played], str]] = {}


def _section(name: str):
    def register(function: Callable[[Layer, Played], str]):
        _SECTIONS[name] = function
        return function

    return register


def _named(found: Approaches, label: str) -> np.ndarray:
    return np.array([name == label for name in found.label])


def _mean(values: np.ndarray, form: str) -> str:
    return f"{np.nanmean(values):{form}}" if np.any(np.isfinite(values)) else "–"


@_section("switch")
def switch(library: Layer, played: Played) -> str:
    """How alike the poses are where target motions begin, and what jumps there."""
    rows = []
    for way in (*WAYS, PRINTED):
        a = played(way)
        k = np.flatnonzero(a.began)
        around = np.clip(a.launch[k] + np.arange(-AROUND, AROUND + 1)[:, None], 0, len(a.alpha) - 1)
        turn, root = a.turn_jump[around, k].max(axis=0), a.root_jump[around, k].max(axis=0)
        usual = a.turn_jump[a.before], a.root_jump[a.before]
        rows.append(
            (
                way,
                f"{np.mean(a.began):.0%} of {len(a.launch)}",
                f"{_mean(a.launch[k] / a.fps, '.1f')} s",
                f"{_mean(a.apart[k], '.1f')}°",
                f"{_mean(a.to_reference[k], '.1f')}°",
                f"{_mean(turn, '.2f')} rad/s",
                f"{_mean(root, '.3f')} m/s",
                f"{np.mean(usual[0]):.2f}, {np.mean(usual[1]):.3f}",
            )
        )
    header = ("preparation", "begun within 20 s", "after, mean", "pose to where it is begun",
              "to the reference posture", "largest jump of a joint's angular velocity",
              "of the root's velocity", "the same on the way, mean")  # fmt: skip
    return _table(header, rows)


@_section("targets")
def targets(library: Layer, played: Played) -> str:
    """What comes of each target motion."""
    preparing = library.preparing
    assert preparing is not None
    rows = []
    for label in preparing.hierarchy.targets.label:
        for way in WAYS:
            a = played(way)
            of = _named(a, label) & a.began
            kind = KINDS[int(a.kind[_named(a, label)][0])]
            if kind == "strike":
                met = f"{np.mean(a.hit[of]):.0%} hit" if of.any() else "–"
                off = f"{100 * np.nanmedian(a.miss[of]):.0f} cm" if of.any() else "–"
            else:
                clear = a.passed[of] & ~a.touched[of]
                met = f"{np.mean(clear):.0%} clear" if of.any() else "–"
                off = "–"
            rows.append(
                (
                    label if way == WAYS[0] else "",
                    way,
                    f"{np.mean(a.began[_named(a, label)]):.0%}",
                    f"{_mean(a.launch[of] / a.fps, '.1f')} s",
                    f"{_mean(a.to_contact[of], '.2f')} s",
                    f"{_mean(a.apart[of], '.1f')}°",
                    f"{_mean(a.to_reference[of], '.1f')}°",
                    met,
                    off,
                )
            )
    header = ("target", "preparation", "begun", "after, mean", "from then to contact",
              "pose to where it is begun", "to the reference posture", "met",
              "tip to the ball's middle, median")  # fmt: skip
    return _table(header, rows)


@_section("approach")
def way_there(library: Layer, played: Played) -> str:
    """Speed and level on the way by distance."""
    rows = []
    for low, high in zip(BINS[:-1], BINS[1:]):
        row = [f"{low:g} to {high:g} m"]
        for way in WAYS:
            a = played(way)
            inside = a.before & (a.away >= low) & (a.away < high)
            row.append(f"{a.speed[inside].mean():.2f} m/s" if inside.any() else "–")
        for way in (*WAYS[1:], PRINTED):
            a = played(way)
            inside = a.before & (a.source >= low) & (a.source < high)
            row.append(f"{a.alpha[inside].mean():.2f}" if inside.any() else "–")
        rows.append(row)
    header = ("distance", *(f"speed, {way}" for way in WAYS))
    more = (f"mean level by distance to the object, {way}" for way in (*WAYS[1:], PRINTED))
    return _table((*header, *more), rows)


@_section("smoothness")
def smoothness(library: Layer, played: Played) -> str:
    """Levels as chosen and as shown, and how feet slide."""
    rows, source = [], source_skate(library)
    for way in (*WAYS, PRINTED):
        a = played(way)
        row = [way]
        for level in (a.level, a.alpha):
            rate = np.abs(np.diff(level, axis=0)) * a.fps
            bend = np.abs(np.diff(level, n=2, axis=0)) * a.fps**2
            row += [f"{rate[a.before[1:]].max():.1f}", f"{bend[a.before[2:]].mean():.1f}"]
        skeleton = library.clips.skeleton
        skates, whole = [], []
        position = np.zeros((len(a.alpha), len(skeleton), 3))
        joints = [skeleton.joint(f"{s}_{r}") for r in ("foot", "toe") for s in SIDES]
        for k in range(len(a.launch)):
            position[:, joints] = a.feet[:, k]
            walk = a.on_ground[:, k] & a.before[:, k, None]
            skates.append(foot_skate(skeleton, position, walk, a.fps))
            whole.append(foot_skate(skeleton, position, a.on_ground[:, k], a.fps))
        row += [f"{1000 * np.mean(skates):.1f} mm/s", f"{np.mean(skates) / source:.2f}",
                f"{np.mean(whole) / source:.2f}"]  # fmt: skip
        rows.append(row)
    header = ("preparation", "chosen: largest rate [1/s]", "mean second rate [1/s²]",
              "shown: largest rate [1/s]", "mean second rate [1/s²]", "feet slide on the way",
              "over the capture's", "with target motions, over the capture's")  # fmt: skip
    return _table(header, rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--only", nargs="+", choices=list(_SECTIONS), default=list(_SECTIONS))
    parser.add_argument("--runs", type=int, default=RUNS, help="approaches of each target motion")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--library", type=Path, help="built with --level preparation")
    parser.add_argument("-o", "--output", type=Path, help="a document with marks")
    given = parser.parse_args()
    if given.runs < 1:
        parser.error(f"--runs {given.runs}: expected at least 1")
    folder = cache_folder(given.library)
    if given.library is not None:
        library = load_library(given.library).layer("preparation")
    else:
        library = builtin_layer(folder, style="targets", level="preparation")

    @cache
    def played(way: str) -> Approaches:
        return approach(library, folder, way, given.runs, given.seed)

    for name in given.only:
        begin = time.perf_counter()
        text = _SECTIONS[name](library, played)
        text += f"\n\n{given.runs} approaches of each target motion, seed {given.seed}."
        print(f"## {name} ({time.perf_counter() - begin:.0f} s)\n\n{text}\n", flush=True)
        if given.output is not None:
            _put(given.output, f"preparation {name}", text)


if __name__ == "__main__":
    main()
