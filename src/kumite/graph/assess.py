"""What a library is worth: how much of its clips is in the graph, how smooth its joins are, and
which kinds of scenes it is good for.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from kumite.annotate import KINDS
from kumite.checked import checked
from kumite.graph.joins import JoinMeter
from kumite.graph.layer import Layer
from kumite.graph.library import Library
from kumite.graph.preparing import KINDS as ABOUT
from kumite.graph.preparing import own_blows

WILL_WORK, THIN, WILL_NOT = "will work", "thin", "will not"

# Limits set by what scenes showed on four real people, whole, in three clips and in one, and on the
# built-in performer. Policies: 20 s of sparring; trees: 12 s of boxing; ten balls.
FEW_BLOWS = 8  # a fight with fewer repeats itself
STANDS = 0.6  # m that an action gets on at most whose blow is aimed, not one of the way
FEW_STRIKE = 0.1  # of the actions: where fewer strike, hardly one fits
LONG = 1.8  # s
FEW_STATES = 20  # from so few places in the clips there is little choice
FEW_ATTACKS, FEW_OTHERS = 8, 12  # actions of whole-action fights: attacks; defences and steps
SOON = 0.8  # s in which an avoidance must be under way to be in time
# Avoidances so soon, on average: with 6 to 9 three balls of four are avoided, with 2 to 3 one of
# three.
FEW_WAYS = 4.0
FEW_TARGETS, FEW_CORES = 3, 3


@dataclass(frozen=True)
class Spread:
    """A measure of joins beside the same of the clips' own motion from frame to frame."""

    median: float
    worst: float
    own_99: float  # the clips' own 99th percentile


@dataclass(frozen=True)
class JoinQuality:
    """How far the joins of a graph jump (:mod:`kumite.graph.joins`)."""

    count: int
    height: Spread  # m
    angle: Spread  # rad
    speed: Spread  # m/s


@dataclass(frozen=True)
class Verdict:
    """What a library is good for, in one kind of scene."""

    kind: str  # "fight by policy", "fight by tree", "avoid" or "prepare"
    word: str  # WILL_WORK, THIN or WILL_NOT
    why: str  # empty where it will work
    advice: str  # what to try; empty where it will work

    def __str__(self) -> str:
        if not self.why:
            return self.word
        return f"{self.word}, because {self.why}" + (f"; try {self.advice}" if self.advice else "")


@dataclass(frozen=True)
class Assessment:
    """What a library is worth."""

    seconds: float  # of the clips
    reached: float  # share of the clips' frames that are in the graph
    left_out: dict[str, float]  # share of the frames that are not, by the reason why
    states: int
    actions: int
    joins: JoinQuality
    joins_over_bound: int  # that were left out
    blows: int
    blows_reached: int
    scenes: tuple[Verdict, ...]

    def verdict(self, kind: str) -> Verdict:
        """The verdict on one kind of scene. Errors: KeyError of an unknown kind."""
        return {v.kind: v for v in self.scenes}[kind]

    def rows(self) -> list[tuple[str, str]]:
        """The assessment as a table of labels and texts, without the verdicts."""
        j = self.joins
        why = ", ".join(f"{share:.0%} {reason}" for reason, share in self.left_out.items())
        rows = [
            ("frames in the graph", f"{self.reached:.0%} of {self.seconds:.0f} s"),
            ("not in it", why or "none"),
            ("states, actions", f"{self.states}, {self.actions}"),
            ("blows in the graph", f"{self.blows_reached} of {self.blows}"),
            ("joins", f"{j.count}; {self.joins_over_bound} over the bound were left out"),
        ]
        if j.count:
            rows += [
                (f"join, {label}", f"{s.median:.{d}f} median, {s.worst:.{d}f} worst; the clips' "
                 f"own frame to frame, 99th percentile: {s.own_99:.{d}f}")
                for label, s, d in (
                    ("pelvis height (m)", j.height, 3),
                    ("largest joint angle (rad)", j.angle, 2),
                    ("pelvis velocity (m/s)", j.speed, 2),
                )
            ]  # fmt: skip
        return rows

    def to_json(self) -> dict[str, Any]:
        """The assessment as plain values."""

        def plain(value: Any) -> Any:
            if isinstance(value, dict):
                return {key: plain(v) for key, v in value.items()}
            if isinstance(value, list | tuple):
                return [plain(v) for v in value]
            return round(value, 4) if isinstance(value, float) else value

        return plain(asdict(self))


@checked
def assess(library: Layer) -> Assessment:
    """What a library is worth: see :class:`Assessment`."""
    clips, table, report = library.clips, library.table, library.report
    kept = np.zeros(len(clips), dtype=bool)
    for first, last in zip(table.first.tolist(), table.last.tolist()):
        kept[first : last + 1] = True
    source = table.state_frame[np.repeat(np.arange(table.states), np.diff(table.action_start))]
    target = table.first[table.stretch]
    joined = source != target - 1
    left_out = {
        str(reason): float(count) / len(clips)
        for reason, count in dict(report.get("left_out", {})).items()
    }
    if not left_out and not kept.all():  # of an older build
        left_out = {"for reasons not recorded": float(1 - kept.mean())}
    joins = _join_quality(library, source[joined], target[joined])
    blows = library.strikes.frame[kept[library.strikes.frame]]
    return Assessment(
        clips.seconds,
        float(kept.mean()),
        left_out
        or ({"for reasons not recorded": float(1 - kept.mean())} if not kept.all() else {}),
        table.states,
        table.actions,
        joins,
        int(report.get("joins_over_bound", 0)),
        len(library.strikes),
        len(blows),
        (
            _policy_fight(library, len(blows), kept),
            _tree_fight(library),
            _avoids(library),
            _prepares(library),
        ),
    )


SERVES = {
    "fight by policy": "frames",
    "fight by tree": "actions",
    "avoid": "avoidance",
    "prepare": "preparation",
}
"""The layer that a kind of scene runs on."""


@checked
def assess_library(library: Library) -> tuple[dict[str, Assessment], tuple[Verdict, ...]]:
    """What each layer of a library is worth, and what the whole is good for: of each kind of scene
    the verdict on the layer that it runs on."""
    found = {name: assess(layer) for name, layer in library.layers.items()}
    verdicts = []
    for kind, name in SERVES.items():
        if name in found:
            verdicts.append(found[name].verdict(kind))
        else:
            why = library.missing.get(name, "")
            advice = "" if why else f"--layer {name}"
            verdicts.append(
                Verdict(kind, WILL_NOT, why or f"the layer {name!r} was not built", advice)
            )
    return found, tuple(verdicts)


def _join_quality(library: Layer, source: np.ndarray, target: np.ndarray) -> JoinQuality:
    meter = JoinMeter(library.clips)
    jumps, own = meter.joins(source, target), meter.own()

    def spread(name: str) -> Spread:
        mine, theirs = getattr(jumps, name), getattr(own, name)
        return Spread(
            float(np.median(mine)) if len(mine) else 0.0,
            float(np.max(mine, initial=0.0)),
            float(np.percentile(theirs, 99)) if len(theirs) else 0.0,
        )

    return JoinQuality(len(jumps), spread("height"), spread("angle"), spread("speed"))


def _verdict(
    kind: str, never: list[tuple[bool, str, str]], thin: list[tuple[bool, str, str]]
) -> Verdict:
    """The first reason why a library is not good for a kind of scene: (is it so, why, advice)."""
    for word, reasons in ((WILL_NOT, never), (THIN, thin)):
        for so, why, advice in reasons:
            if so:
                return Verdict(kind, word, why, advice)
    return Verdict(kind, WILL_WORK, "", "")


def _policy_fight(library: Layer, blows: int, kept: np.ndarray) -> Verdict:
    table, clips = library.table, library.clips
    ways, lasts = table.actions / table.states, float(table.duration[table.stretch].mean())
    found = len(library.strikes)
    # A blow that is aimed is struck from about where one stands; arms swing on the way, too.
    frame = own_blows(clips, library.strikes).frame if found else library.strikes.frame
    far = np.hypot(table.displacement[:, 0], table.displacement[:, 1])
    aimed = np.array(
        [
            np.count_nonzero((frame >= a) & (frame <= b)) if d < STANDS else 0
            for a, b, d in zip(table.first.tolist(), table.last.tolist(), far.tolist())
        ]
    )
    strikes = float(np.mean(aimed > 0))
    return _verdict(
        "fight by policy",
        [
            (
                library.preparing is not None,
                "its graph is one of walks and what they lead to",
                "--layer frames",
            ),
            (found == 0, "no blow is in the clips", "clips with punches or kicks"),
            (
                blows == 0,
                f"none of {found} blows is in the graph",
                "--event both, more clips, or a wider --join-height, --join-angle, --join-speed",
            ),
            (ways < 1.05, "there is never more than one way on", "more or longer clips"),
        ],
        [
            (
                aimed.sum() < FEW_BLOWS,
                f"{aimed.sum()} blows are struck from where one stands: they repeat themselves",
                "more clips with blows",
            ),
            (
                strikes < FEW_STRIKE,
                f"only {strikes:.0%} of the actions strike",
                "fewer clips without blows",
            ),
            (
                lasts > LONG * clips.fps,
                f"an action lasts {lasts / clips.fps:.1f} s on average: the other moves meanwhile",
                "--event both",
            ),
            (
                table.states < FEW_STATES,
                f"{table.states} states leave little choice",
                "more clips, or --event both",
            ),
            (
                float(kept.mean()) < 0.5,
                f"only {kept.mean():.0%} of the frames are in the graph",
                "--event both, or clips that begin and end alike",
            ),
        ],
    )


def _tree_fight(library: Layer) -> Verdict:
    if library.actions is None:
        return Verdict(
            "fight by tree", WILL_NOT, "its graph is not one of whole actions", "--layer actions"
        )
    # What some state offers: reactions are offered by none.
    offered = np.unique(library.table.stretch)
    kind = library.actions.kind[library.action_of_stretch[offered]]
    attack = kind == KINDS.index("attack")
    others = int(np.isin(kind, [KINDS.index(k) for k in ("defence", "transition")]).sum())
    way = library.table.displacement[offered, :2]
    attacks, aimed = int(attack.sum()), int((attack & (np.hypot(*way.T) < STANDS)).sum())
    return _verdict(
        "fight by tree",
        [
            (attacks == 0, "no attack is connected", "more clips with blows, or a larger --alike"),
            (
                others == 0,
                "no step and no defence is connected: nobody gets nearer",
                "clips with steps between guards, or a larger --alike",
            ),
        ],
        [
            (
                aimed < FEW_ATTACKS,
                f"{aimed} attacks are struck from where one stands: they repeat themselves",
                "more clips with blows, or a larger --alike",
            ),
            (
                others < FEW_OTHERS,
                f"{others} steps and defences are few to come nearer by",
                "more clips with steps, or a larger --alike",
            ),
        ],
    )


def _avoids(library: Layer) -> Verdict:
    held = len(np.unique(library.parts_of_stretch[1]))
    found, level = len(library.avoidance), library.report.get("level", "frames")
    soon = ways_out_soon(library) if held else 0.0
    return _verdict(
        "avoid",
        [
            (
                found == 0 and level != "avoidance",
                "its graph keeps no avoidance whole",
                "--layer avoidance",
            ),
            (
                held == 0,
                f"none of {found} avoidance parts is in the graph",
                "clips that begin and end in guard, or a wider bound of joins",
            ),
        ],
        [
            (
                level != "avoidance" and soon < FEW_WAYS,
                f"on average {soon:.1f} avoidances can be under way within {SOON:g} s",
                "the layer avoidance",
            ),
            (
                soon < FEW_WAYS,
                f"on average {soon:.1f} avoidances can be under way within {SOON:g} s: most "
                "attacks find none in time",
                "more clips with ducks, slips and steps aside out of the guard that others are in",
            ),
        ],
    )


def ways_out_soon(library: Layer) -> float:
    """How many avoidance parts are at their middle within SOON of a state, on average over time."""
    table = library.table
    begin, part = library.parts_of_stretch
    stretch = np.repeat(np.arange(len(table.first)), np.diff(begin))
    wait = library.avoidance.centre[part] - table.first[stretch] + 1
    quick = np.flatnonzero(wait <= SOON * library.clips.fps)
    held = np.searchsorted(stretch[quick], np.arange(len(table.first) + 1))
    count = np.diff(held)[table.stretch]  # of each action
    state = np.repeat(np.repeat(np.arange(table.states), np.diff(table.action_start)), count)
    since = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    which = part[quick[np.repeat(held[table.stretch], count) + since]]
    offered = np.unique(np.stack([state, which], axis=1), axis=0)[:, 0]
    ways = np.bincount(offered, minlength=table.states)
    time = np.bincount(table.target, weights=table.duration, minlength=table.states)
    return float(np.average(ways, weights=time)) if time.sum() else 0.0


def _prepares(library: Layer) -> Verdict:
    if library.preparing is None:
        return Verdict(
            "prepare",
            WILL_NOT,
            "its graph is not one of walks and what they lead to",
            "--layer preparation",
        )
    h = library.preparing.hierarchy
    kinds = sorted({ABOUT[k] for k in library.preparing.kind.tolist()})
    targets, cores = len(h.targets), len(h.cores)
    goes = [label for label in h.cores.label if label.startswith(("walk", "run"))]
    return _verdict(
        "prepare",
        [(not goes, "no walk is among the cores: nobody gets anywhere", "clips that walk or run")],
        [
            (
                targets < FEW_TARGETS,
                f"{targets} target motion(s), of {', '.join(kinds)}",
                "more clips that walk up to something and go on",
            ),
            (
                cores < FEW_CORES,
                f"{cores} cycle(s) of locomotion turn and stop badly",
                "clips that walk, turn and stand",
            ),
        ],
    )
