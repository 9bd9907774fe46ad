"""What a library is worth: how much of its clips is in the graph, how smooth its joins are, and
which kinds of scenes it is good for.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from kumite.annotate import KINDS
from kumite.graph.joins import JoinMeter
from kumite.graph.library import Library
from kumite.graph.preparing import KINDS as ABOUT

WILL_WORK, THIN, WILL_NOT = "will work", "thin", "will not"

# Limits set by what scenes showed on real and built-in libraries, whole and in part.
ROUGH = 0.02  # of the joins: so many over the bound of joins show
FEW_BLOWS = 8  # a fight with fewer repeats itself
FEW_STATES = 30  # from so few places in the clips there is little choice
FEW_ATTACKS, FEW_OTHERS = 5, 5  # actions of whole-action fights: attacks; defences and steps
FEW_PARTS = 8  # avoidance parts
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
        """The assessment as a table of labels and texts."""
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
        return rows + [(v.kind, str(v)) for v in self.scenes]

    def to_json(self) -> dict[str, Any]:
        """The assessment as plain values."""

        def plain(value: Any) -> Any:
            if isinstance(value, dict):
                return {key: plain(v) for key, v in value.items()}
            if isinstance(value, list | tuple):
                return [plain(v) for v in value]
            return round(value, 4) if isinstance(value, float) else value

        return plain(asdict(self))


def assess(library: Library) -> Assessment:
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


def _join_quality(library: Library, source: np.ndarray, target: np.ndarray) -> JoinQuality:
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


def _policy_fight(library: Library, blows: int, kept: np.ndarray) -> Verdict:
    table = library.table
    ways = table.actions / table.states
    found = len(library.strikes)
    return _verdict(
        "fight by policy",
        [
            (
                library.preparing is not None,
                "its graph is one of walks and what they lead to",
                "--level frames",
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
            (blows < FEW_BLOWS, f"{blows} blows repeat themselves", "more clips with blows"),
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


def _tree_fight(library: Library) -> Verdict:
    if library.actions is None:
        return Verdict(
            "fight by tree", WILL_NOT, "its graph is not one of whole actions", "--level actions"
        )
    # What some state offers: reactions are offered by none.
    offered = np.unique(library.table.stretch)
    kind = library.actions.kind[library.action_of_stretch[offered]]
    attacks, others = (
        int(np.isin(kind, [KINDS.index(k) for k in names]).sum())
        for names in (("attack",), ("defence", "transition"))
    )
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
                attacks < FEW_ATTACKS,
                f"{attacks} attacks repeat themselves",
                "more clips with blows, or a larger --alike",
            ),
            (
                others < FEW_OTHERS,
                f"{others} steps and defences are few to come nearer by",
                "more clips with steps, or a larger --alike",
            ),
        ],
    )


def _avoids(library: Library) -> Verdict:
    held = len(np.unique(library.parts_of_stretch[1]))
    found, level = len(library.avoidance), library.report.get("level", "frames")
    return _verdict(
        "avoid",
        [
            (
                found == 0 and level != "avoidance",
                "its graph keeps no avoidance whole",
                "--level avoidance",
            ),
            (
                held == 0,
                f"none of {found} avoidance parts is in the graph",
                "clips that begin and end in guard, or a wider bound of joins",
            ),
        ],
        [
            (
                held < FEW_PARTS,
                f"{held} avoidance parts leave most attacks without an answer",
                "more clips with ducks, slips and steps aside",
            ),
            (
                level != "avoidance",
                "an avoidance is seldom near in a graph made for other ends",
                "--level avoidance",
            ),
        ],
    )


def _prepares(library: Library) -> Verdict:
    if library.preparing is None:
        return Verdict(
            "prepare",
            WILL_NOT,
            "its graph is not one of walks and what they lead to",
            "--level preparation",
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
                f"{targets} target motion(s), all of the kind {', '.join(kinds)}",
                "more clips that walk up to something and go on",
            ),
            (
                cores < FEW_CORES,
                f"{cores} cycle(s) of locomotion turn and stop badly",
                "clips that walk, turn and stand",
            ),
        ],
    )
