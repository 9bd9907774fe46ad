"""Takes: moves strung together, placed in the world, and what is known to be true of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d, minimum_filter1d

from kumite.clip import SIDES, Clip, forward_kinematics, tip_positions
from kumite.errors import KumiteError, unknown
from kumite.performer.figure import BALL_HEIGHT, Targets, lowered, pose, skeleton
from kumite.performer.moves import Aim, Move, Style
from kumite.rotation import planar_apply

FPS = 60.0
SETTLE = 0.10  # s of guard between two moves
LEAD_IN = 0.5  # s of guard before the first and after the last
SMOOTHING = 0.022  # s, rounds off what keys leave of corners
SWAY = 0.008  # m of bounce


@dataclass(frozen=True)
class Strike:
    """A blow as it was authored."""

    frame: int  # in which it lands
    limb: str
    tip: np.ndarray  # [3] m, world
    velocity: np.ndarray  # [3] m/s of the tip, by central differences


@dataclass(frozen=True)
class Action:
    """A move as it was performed: frames start..stop."""

    start: int
    stop: int
    kind: str
    label: str
    avoid: tuple[int, int] | None = None  # frames in which the body is out of where it was
    mark: int | None = None  # first frame of a target movement


@dataclass(frozen=True)
class Truth:
    """What is true of a clip, because it was authored so."""

    on_ground: np.ndarray  # [F, 2] bool, left and right foot planted
    strikes: tuple[Strike, ...]
    actions: tuple[Action, ...]


@dataclass(frozen=True)
class Performed:
    """One move as it is to be performed: a row of the repertoire, varied."""

    move: Move
    tempo: float = 1.0  # durations are multiplied by it
    travel: tuple[float, float, float] = (0.0, 0.0, 0.0)
    targets: tuple[tuple[float, float, float], ...] = ()  # of each blow


def as_written(move: Move) -> Performed:
    return Performed(move, 1.0, move.travel, tuple(b.target for b in move.blows))


def vary(move: Move, style: Style, rng: np.random.Generator) -> Performed:
    """A move as a person does it the next time: other pace, other length, another target."""
    x, z, yaw = move.travel
    pace = float(rng.uniform(1 - style.tempo, 1 + style.tempo))
    if not move.holds:
        return Performed(move, 1.0, move.travel)  # phases of a gait must fit each other
    scale = rng.uniform(1 - style.travel, 1 + style.travel)
    drift = rng.normal(0, 0.02, 2) if move.steps else np.zeros(2)
    swing = rng.normal(0, 4.0) if move.steps else 0.0
    if move.kind == "attack":
        z += rng.choice([0.0, 0.0, 0.10, 0.18])  # on the spot, or stepping in
    shift = (
        rng.uniform(-1, 1) * style.blow_angle,
        rng.uniform(*style.blow_reach),
        rng.uniform(*style.blow_height),
    )
    targets = tuple(
        (b.target[0] + shift[0], b.target[1] + shift[1], b.target[2] + shift[2]) for b in move.blows
    )
    travel = (x * scale + drift[0], z * scale + drift[1], yaw * scale + swing)
    return Performed(move, pace, travel, targets)


@dataclass
class _Track:
    """Keys of one channel over a whole take."""

    guard: np.ndarray
    times: list[float] = field(default_factory=list)
    values: list[np.ndarray] = field(default_factory=list)

    def add(self, time: float, value: np.ndarray) -> None:
        if self.times and time <= self.times[-1] + 1e-6:
            return
        self.times.append(time)
        self.values.append(value)

    def sample(self, at: np.ndarray) -> np.ndarray:
        if len(self.times) == 1:
            return np.repeat(self.values[0][None], len(at), axis=0)
        inside = np.clip(at, self.times[0], self.times[-1])
        smooth = PchipInterpolator(self.times, np.array(self.values), axis=0)(inside)
        return gaussian_filter1d(smooth, SMOOTHING * FPS, axis=0, mode="nearest")


def perform_take(
    name: str, score: Sequence[Performed], style: Style, *, rng: np.random.Generator
) -> tuple[Clip, Truth]:
    """A clip of moves one after the other, beginning and ending in guard, with its truth.

    Errors: no moves; a key at a time outside its move; a limb that a blow does not know.
    """
    if not score:
        raise KumiteError(f"{name}: a take needs at least one move")
    starts, t = [], LEAD_IN
    for p in score:
        starts.append(t)
        t += p.move.seconds * p.tempo + (SETTLE if p.move.holds else 0.0)
    total = t + LEAD_IN
    at = np.arange(round(total * FPS) + 1) / FPS

    stance, feet, on_ground = _walk(score, starts, at, style)
    place = {c: v.sample(at) for c, v in _channels(score, starts, total, style).items()}
    breath = _alive(at, style.sway, rng)
    carried = {
        c: planar_apply(stance, place[c] + breath.get(c, 0.0))
        for c in ("pelvis", "left_hand", "right_hand")
    }
    turned = {c: np.radians(place[c]) for c in ("pelvis_turn", "chest_turn", "head_turn")}
    for c in turned:
        turned[c] = turned[c] + breath.get(c, 0.0)
        turned[c][:, 0] += stance[:, 2]
    foot_turn = np.stack([feet[:, :, 3], np.radians(place["heel"])], axis=-1)
    foot_turn[:, :, 1] = np.maximum(foot_turn[:, :, 1], 0.0)
    targets = Targets(
        carried["pelvis"],
        turned["pelvis_turn"],
        turned["chest_turn"],
        turned["head_turn"],
        np.stack([carried["left_hand"], carried["right_hand"]], axis=1),
        np.clip(place["elbow"], -1.0, 1.0),
        feet[:, :, :3],
        foot_turn,
    )
    pelvis = targets.pelvis.copy()
    # Lowest within the filter's width, then smoothed: smooth, and nowhere above what legs reach.
    low = minimum_filter1d(lowered(targets), 2 * style.vault + 1, mode="nearest")
    pelvis[:, 1] = gaussian_filter1d(low, style.vault / 3.0, mode="nearest", radius=style.vault)
    hand = targets.hand.copy()
    hand[:, :, 1] += style.hands_sink * (pelvis[:, 1] - targets.pelvis[:, 1])[:, None]
    root, wxyz = pose(replace(targets, pelvis=pelvis, hand=hand))
    clip = Clip(name, skeleton(), FPS, root, wxyz)
    truth = Truth(on_ground, _strikes(clip, score, starts), _actions(score, starts))
    return clip, truth


def _channels(
    score: Sequence[Performed], starts: Sequence[float], total: float, style: Style
) -> dict[str, _Track]:
    tracks = {c: _Track(np.array(v)) for c, v in style.guard.items()}
    for track in tracks.values():
        track.add(0.0, track.guard)
    for p, start in zip(score, starts):
        end = start + p.move.seconds * p.tempo
        for c in p.move.keys:
            if c not in tracks:
                raise unknown(f"channel of {p.move.label}", c, style.guard)
        for c, track in tracks.items():
            rows = p.move.keys.get(c, ())
            if p.move.holds:
                track.add(start, track.guard)
            blow = 0
            for time, value in rows:
                if not (0 < time < p.move.seconds or (time == 0 and not p.move.holds)):
                    raise KumiteError(
                        f"{p.move.label}: {c} has a key at {time} s; expected between 0 and "
                        f"{p.move.seconds} s"
                    )
                moment = start + time * p.tempo
                if isinstance(value, Aim):
                    mine = [b for b, x in enumerate(p.move.blows) if x.limb == c]
                    if not mine:
                        raise KumiteError(f"{p.move.label}: {c} aims, but strikes no blow")
                    blow = mine[min(blow, len(mine) - 1)]
                    track.add(moment, _aimed(p.targets[blow], value))
                elif c.endswith("_hand"):
                    track.add(moment, np.array(value))
                else:
                    track.add(moment, track.guard + np.array(value))
            if p.move.holds:
                track.add(end, track.guard)
    for track in tracks.values():
        track.add(total, track.guard)
    return tracks


def _aimed(target: tuple[float, float, float], value: Aim) -> np.ndarray:
    """A place [3] in the stance frame, measured from a target (angle [deg], distance, height)."""
    angle, distance, height = np.radians(target[0]), target[1], target[2]
    left, up, ahead = value.offset
    sideways = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    outward = np.array([np.sin(angle), 0.0, np.cos(angle)])
    return (distance + ahead) * outward + left * sideways + np.array([0.0, height + up, 0.0])


def _walk(
    score: Sequence[Performed], starts: Sequence[float], at: np.ndarray, style: Style
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stance frames [F, 3], feet [F, 2, 4] (ball [m] and yaw) and contacts [F, 2] of a take.

    The stance glides while feet step; a foot that is not stepping does not move at all.
    """
    stance = _glide(score, starts, at)
    feet = np.zeros((len(at), 2, 4))
    on_ground = np.ones((len(at), 2), dtype=bool)
    for s, side in enumerate(SIDES):
        steps = [
            (start + step.lift * p.tempo, start + step.land * p.tempo, step, p, start)
            for p, start in zip(score, starts)
            for step in p.move.steps
            if step.foot == side
        ]
        down = _foothold(stance[0], side, style)
        feet[:, s] = down
        for n, (lift, land, step, p, start) in enumerate(steps):
            again = steps[n + 1][0] if n + 1 < len(steps) else land
            moment = start + p.move.seconds * p.tempo
            if step.stride:
                moment = 0.5 * (land + again) if n + 1 < len(steps) else at[-1]
            goal = _foothold(stance[min(round(moment * FPS), len(at) - 1)], side, style)
            u = (at - lift) / (land - lift)
            move = goal - down
            move[3] = (move[3] + np.pi) % (2 * np.pi) - np.pi
            after = at > lift
            feet[after, s] = (down + _ease(u)[:, None] * move)[after]
            air = (u > 0) & (u < 1)
            feet[air, s, 1] += step.height * np.sin(np.pi * _lean(u[air])) ** 2
            on_ground[air, s] = False
            down = down + move
    return stance, feet, on_ground


def _glide(score: Sequence[Performed], starts: Sequence[float], at: np.ndarray) -> np.ndarray:
    """Stance frames [F, 3]: each move's travel, carried out along an arc at its own pace."""
    pace = np.zeros((len(at), 3))  # travelled in each frame, in the stance's own axes
    for p, start in zip(score, starts):
        if not np.any(np.abs(p.travel) > 1e-9):
            continue
        steps = p.move.steps
        if not steps:
            raise KumiteError(f"{p.move.label}: travels without a step")
        if p.move.glide not in GLIDES:
            raise unknown(f"glide of {p.move.label}", p.move.glide, GLIDES)
        begin, end = start, start + p.move.seconds * p.tempo
        if p.move.glide == "ease":
            begin = start + min(s.lift for s in steps) * p.tempo - 0.04
            end = start + max(s.land for s in steps) * p.tempo + 0.06
        done = GLIDES[p.move.glide]((at - begin) / (end - begin))
        x, z, yaw = p.travel
        pace[1:] += np.diff(done)[:, None] * np.array([x, z, np.radians(yaw)])
    # Half of a frame's turn comes before its shift and half after: arcs come out round.
    yaw = np.cumsum(pace[:, 2])
    mid = yaw - 0.5 * pace[:, 2]
    x = np.cumsum(np.cos(mid) * pace[:, 0] + np.sin(mid) * pace[:, 1])
    z = np.cumsum(-np.sin(mid) * pace[:, 0] + np.cos(mid) * pace[:, 1])
    return np.stack([x, z, yaw], axis=1)


def _foothold(stance: np.ndarray, side: str, style: Style) -> np.ndarray:
    """Ball [3] and yaw of a foot that stands in a stance."""
    x, z, yaw = style.feet[side]
    ball = planar_apply(stance, np.array([x, BALL_HEIGHT, z]))
    return np.array([*ball, stance[2] + np.radians(yaw)])


def _ease(u: np.ndarray) -> np.ndarray:
    """0 to 1 with no velocity and no acceleration at either end (minimum jerk)."""
    u = np.clip(u, 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


GLIDES = {
    "ease": _ease,
    "steady": lambda u: np.clip(u, 0.0, 1.0),
    "start": lambda u: np.clip(u, 0.0, 1.0) ** 2,
    "stop": lambda u: 1.0 - (1.0 - np.clip(u, 0.0, 1.0)) ** 2,
}
"""How a stance travels over a move, 0..1: from rest to rest, at one speed, from rest, to rest."""


def _lean(u: np.ndarray) -> np.ndarray:
    """A foot rises faster than it is put down."""
    return u**0.85


def _alive(at: np.ndarray, sway_share: float, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Bounce and breathing: what never stops while a boxer stands. By channel, [F, 3]."""
    beat = rng.uniform(1.5, 1.9)
    phase = rng.uniform(0, 2 * np.pi, 8)

    def wave(hertz: float, k: int) -> np.ndarray:
        return np.sin(2 * np.pi * hertz * at + phase[k])

    zero = np.zeros(len(at))
    bounce = sway_share * SWAY * wave(beat, 0)
    sway = sway_share * 0.006 * wave(0.5 * beat, 1)
    breath = np.radians(0.9) * wave(0.45, 2)
    return {
        "pelvis": np.stack([sway, bounce, sway_share * 0.005 * wave(0.37 * beat, 3)], axis=1),
        "chest_turn": np.stack([np.radians(1.2) * wave(0.6, 4), breath, zero], axis=1),
        "head_turn": np.stack([np.radians(1.0) * wave(0.4, 5), 0.4 * breath, zero], axis=1),
        "left_hand": np.stack([0.006 * wave(0.9, 6), bounce + 0.006 * wave(0.7, 7), sway], axis=1),
        "right_hand": np.stack([0.005 * wave(0.8, 4), bounce + 0.005 * wave(0.6, 6), sway], axis=1),
    }


def _strikes(clip: Clip, score: Sequence[Performed], starts: Sequence[float]) -> tuple[Strike, ...]:
    position, world = forward_kinematics(clip.skeleton, clip.root_position, clip.wxyz)
    out = []
    for p, start in zip(score, starts):
        for blow in p.move.blows:
            frame = round((start + blow.time * p.tempo) * clip.fps)
            window = slice(frame - 1, frame + 2)
            tip = tip_positions(clip.skeleton, blow.limb, position[window], world[window])
            out.append(Strike(frame, blow.limb, tip[1], (tip[2] - tip[0]) * clip.fps / 2))
    return tuple(sorted(out, key=lambda s: s.frame))


def _actions(score: Sequence[Performed], starts: Sequence[float]) -> tuple[Action, ...]:
    out = []
    for p, start in zip(score, starts):

        def frame(time: float, start: float = start, tempo: float = p.tempo) -> int:
            return round((start + time * tempo) * FPS)

        m = p.move
        avoid = None if m.avoid is None else (frame(m.avoid[0]), frame(m.avoid[1]))
        mark = None if m.mark is None else frame(m.mark)
        out.append(Action(frame(0.0), frame(m.seconds), m.kind, m.label, avoid, mark))
    return tuple(out)
