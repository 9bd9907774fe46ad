"""What is known to be true of a clip, because it was authored so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from kumite import checks
from kumite.brief import brief
from kumite.clip import Clip, forward_kinematics, tip_positions
from kumite.errors import KumiteError

if TYPE_CHECKING:
    from kumite.performer.take import Performed


@brief
@dataclass(frozen=True)
class Strike:
    """A blow as it was authored."""

    frame: int  # in which it lands
    limb: str
    tip: np.ndarray  # [3] m, world
    velocity: np.ndarray  # [3] m/s of the tip, by central differences

    def __post_init__(self) -> None:
        checks.whole(self.frame, "strike: frame", least=0)
        checks.text(self.limb, "strike: limb")
        checks.freeze(self, "strike", tip=(float, (3,)), velocity=(float, (3,)))


@dataclass(frozen=True)
class Action:
    """A move as it was performed: frames start..stop."""

    start: int
    stop: int
    kind: str
    label: str
    avoid: tuple[int, int] | None = None  # frames in which the body is out of where it was
    mark: int | None = None  # first frame of a target movement

    def __post_init__(self) -> None:
        checks.whole(self.start, "action: start", least=0)
        checks.whole(self.stop, "action: stop", least=self.start)
        checks.text(self.kind, "action: kind")
        checks.text(self.label, "action: label")
        if self.avoid is not None:
            first, last = (checks.whole(f, "action: avoid", least=0) for f in self.avoid)
            object.__setattr__(self, "avoid", (first, last))
        if self.mark is not None:
            checks.whole(self.mark, "action: mark", least=0)


@brief
@dataclass(frozen=True)
class Truth:
    """What is true of a clip."""

    on_ground: np.ndarray  # [F, 2] bool, left and right foot planted
    strikes: tuple[Strike, ...]
    actions: tuple[Action, ...]

    def __post_init__(self) -> None:
        frames = checks.freeze(self, "truth", on_ground=(np.bool_, ("F", 2)))["F"]
        ends = [s.frame for s in self.strikes] + [a.stop for a in self.actions]
        if max(ends, default=0) > frames:
            raise KumiteError(f"truth: something happens after the {frames} frames")


def authored_strikes(
    clip: Clip, score: Sequence[Performed], starts: Sequence[float]
) -> tuple[Strike, ...]:
    """Every blow of a take, with place and velocity of the tip."""
    blows = [
        (round((start + blow.time * p.tempo) * clip.fps), blow.limb)
        for p, start in zip(score, starts)
        for blow in p.move.blows
    ]
    out = []
    for frame, limb in sorted(blows):
        window = slice(frame - 1, frame + 2)
        pose = forward_kinematics(clip.skeleton, clip.root_position[window], clip.wxyz[window])
        tip = tip_positions(clip.skeleton, limb, *pose)
        out.append(Strike(frame, limb, tip[1], (tip[2] - tip[0]) * clip.fps / 2))
    return tuple(out)


def authored_actions(
    score: Sequence[Performed], starts: Sequence[float], fps: float
) -> tuple[Action, ...]:
    """Every move of a take, in frames."""
    out = []
    for p, start in zip(score, starts):

        def frame(time: float, start: float = start, tempo: float = p.tempo) -> int:
            return round((start + time * tempo) * fps)

        m = p.move
        avoid = None if m.avoid is None else (frame(m.avoid[0]), frame(m.avoid[1]))
        mark = None if m.mark is None else frame(m.mark)
        out.append(Action(frame(0.0), frame(m.seconds), m.kind, m.label, avoid, mark))
    return tuple(out)


def mirrored_truth(truth: Truth) -> Truth:
    """What is true of the clip seen in a mirror: left and right change places, x changes sign."""
    flip = np.array([-1.0, 1.0, 1.0])
    strikes = tuple(
        Strike(s.frame, swap_sides(s.limb), s.tip * flip, s.velocity * flip) for s in truth.strikes
    )
    actions = tuple(replace(a, label=swap_sides(a.label)) for a in truth.actions)
    return Truth(truth.on_ground[:, ::-1].copy(), strikes, actions)


def swap_sides(label: str) -> str:
    """A label with left for right and right for left."""
    other = {"left": "right", "right": "left"}
    return "_".join(other.get(word, word) for word in label.split("_"))
