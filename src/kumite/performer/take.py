"""Takes: moves strung together, placed in the world, and what is known to be true of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d, minimum_filter1d

from kumite.checked import checked
from kumite.clip import Clip
from kumite.errors import KumiteError, unknown
from kumite.performer.figure import Targets, lowered, pose, with_heels_raised
from kumite.performer.footwork import ease, walk
from kumite.performer.moves import Aim, Move, Put, Style, Vector
from kumite.performer.skeleton import skeleton, trunk
from kumite.performer.truth import Truth, authored_actions, authored_strikes
from kumite.rotation import planar_apply, planar_inverse

FPS = 60.0
SETTLE = 0.10  # s of guard between two moves
LEAD_IN = 0.5  # s of guard before the first and after the last
SMOOTHING = 0.03  # s, rounds off what keys leave of corners
FIST_SMOOTHING = 0.012  # s, of hands: blows are quicker than trunks
SWAY = 0.008  # m of bounce
HANDS = ("left_hand", "right_hand")
FEET = ("left_foot", "right_foot")
TURNS = ("pelvis_turn", "chest_turn", "head_turn")
UNMOVED: dict[str, Vector] = {"left_foot": (0.0, 0.0, 0.0), "right_foot": (0.0, 0.0, 0.0)}
"""Channels that a style's guard need not name."""


@dataclass(frozen=True)
class Performed:
    """One move as it is to be performed: a row of the repertoire, varied."""

    move: Move
    tempo: float = 1.0  # durations are multiplied by it
    travel: tuple[float, float, float] = (0.0, 0.0, 0.0)
    targets: tuple[tuple[float, float, float], ...] = ()  # of each blow


@checked
def as_written(move: Move) -> Performed:
    return Performed(move, 1.0, move.travel, tuple(b.target for b in move.blows))


@checked
def vary(move: Move, style: Style, rng: np.random.Generator) -> Performed:
    """A move as a person does it the next time: other pace, other length, another target."""
    x, z, yaw = move.travel
    pace = float(rng.uniform(1 - style.tempo, 1 + style.tempo))
    if not (move.from_guard or move.to_guard):
        return Performed(move, 1.0, move.travel)  # phases of a gait must fit each other
    scale = rng.uniform(1 - style.travel, 1 + style.travel)
    # Feet never come down just where they were; at a target they do nearly.
    stray = 0.01 if move.kind == "target" else 0.045
    drift = rng.normal(0, stray, 2) if move.steps else np.zeros(2)
    swing = rng.normal(0, 4.0) if move.steps else 0.0
    if move.kind == "attack" and move.steps:
        # On the spot two times in five, else with a step that turns to the target or closes in.
        stepping = rng.random() < 0.6
        z += stepping * rng.uniform(*style.blow_step)
        swing += stepping * rng.uniform(-1, 1) * style.blow_turn
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
    smoothing: float = SMOOTHING  # s
    times: list[float] = field(default_factory=list)
    values: list[np.ndarray] = field(default_factory=list)

    def add(self, time: float, value: np.ndarray) -> None:
        if self.times and time <= self.times[-1] + 1e-6:
            return
        self.times.append(time)
        self.values.append(value)

    def sample(self, at: np.ndarray) -> np.ndarray:
        values = np.array(self.values)
        if not np.any(values - values[0]):
            return np.repeat(values[:1], len(at), axis=0)
        inside = np.clip(at, self.times[0], self.times[-1])
        smooth = PchipInterpolator(self.times, values, axis=0)(inside)
        return gaussian_filter1d(smooth, self.smoothing * FPS, axis=0, mode="nearest")


@checked
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
        t += p.move.seconds * p.tempo + (SETTLE if p.move.to_guard else 0.0)
    total = t + LEAD_IN
    at = np.arange(round(total * FPS) + 1) / FPS

    place = {c: v.sample(at) for c, v in _channels(score, starts, total, style).items()}
    stance, feet, aloft = walk(score, starts, at, FPS, style, place)
    alive = _alive(at, style.sway, rng)
    turned = {c: np.radians(place[c]) + alive.get(c, 0.0) for c in TURNS}
    for c in TURNS:
        turned[c][:, 0] += stance[:, 2]
    # A planted foot raises its heel; only one in the air raises its toes.
    heel = np.maximum(np.radians(place["heel"]), -0.5 * np.pi * aloft)
    targets = Targets(
        planar_apply(stance, place["pelvis"] + alive["pelvis"])
        + _weight(feet, aloft, style.weight),
        turned["pelvis_turn"],
        turned["chest_turn"],
        turned["head_turn"],
        np.zeros((len(at), 2, 3)),  # once the head is known
        np.clip(place["elbow"], -1.0, 1.2),
        feet[:, :, :3],
        np.stack([feet[:, :, 3], heel], axis=-1),
        _pointed(stance, place["blade"]) if style.armed else None,
    )
    pelvis = targets.pelvis.copy()
    # Lowest within the filter's width, then smoothed: smooth, and nowhere above what legs reach.
    low = minimum_filter1d(lowered(targets), 2 * style.vault + 1, mode="nearest")
    pelvis[:, 1] = gaussian_filter1d(low, style.vault / 3.0, mode="nearest", radius=style.vault)
    hand = _hands(score, starts, at, stance, place, alive, pelvis, turned, style)
    targets = with_heels_raised(replace(targets, pelvis=pelvis, hand=hand))
    wxyz = pose(targets, skeleton(armed="right" if style.armed else None))
    clip = Clip(name, skeleton(armed="right" if style.armed else None), FPS, pelvis, wxyz)
    strikes = authored_strikes(clip, score, starts)
    return clip, Truth(aloft == 0.0, strikes, authored_actions(score, starts, FPS))


WEIGHT_TIME = 0.09  # s in which weight goes from foot to foot


def _weight(feet: np.ndarray, aloft: np.ndarray, share: float) -> np.ndarray:
    """How the pelvis leans [F, 3] towards the foot that carries it."""
    between = feet[:, 1, :3] - feet[:, 0, :3]
    between[:, 1] = 0.0
    lifted = gaussian_filter1d(aloft[:, 0] - aloft[:, 1], WEIGHT_TIME * FPS, mode="nearest")
    return share * lifted[:, None] * gaussian_filter1d(between, WEIGHT_TIME * FPS, axis=0)


def _channels(
    score: Sequence[Performed], starts: Sequence[float], total: float, style: Style
) -> dict[str, _Track]:
    """Every channel's keys. Hands and feet have a fourth number: 1 where they are carried along (by
    the head, by the step), 0 where the place is one in the stance.
    """
    tracks = {}
    for c, v in (UNMOVED | dict(style.guard)).items():
        limb = c in HANDS + FEET
        tracks[c] = _Track(
            np.array([*v, 1.0] if limb else v), FIST_SMOOTHING if limb else SMOOTHING
        )
        tracks[c].add(0.0, tracks[c].guard)
    for p, start in zip(score, starts):
        end = start + p.move.seconds * p.tempo
        for c in p.move.keys:
            if c not in tracks:
                raise unknown(f"channel of {p.move.label}", c, tracks)
        for c, track in tracks.items():
            rows = p.move.keys.get(c, ())
            if p.move.from_guard:
                track.add(start, track.guard)
            mine = iter([k for k, b in enumerate(p.move.blows) if b.limb == c])
            blow, landed = next(mine, None), -1.0
            for time, value in rows:
                if not (0 < time < p.move.seconds or (time == 0 and not p.move.from_guard)):
                    raise KumiteError(
                        f"{p.move.label}: {c} has a key at {time} s; expected between 0 and "
                        f"{p.move.seconds} s"
                    )
                if isinstance(value, Aim):
                    if blow is None:
                        raise KumiteError(f"{p.move.label}: {c} aims, but strikes no blow")
                    # Keys aim at a limb's next blow until half a second after it has landed.
                    landed = p.move.blows[blow].time
                    if time > landed + FOLLOW_THROUGH:
                        blow = next(mine, blow)
                    new = np.array([*_aimed(p.targets[blow], value), 0.0])
                elif isinstance(value, Put):
                    new = np.array([*value.place, 0.0])
                elif c in HANDS:
                    new = np.array([*value, 1.0])
                elif c == "blade":
                    new = np.array(value)
                elif c in FEET:
                    new = track.guard + np.array([*value, 0.0])
                else:
                    new = track.guard + np.array(value)
                track.add(start + time * p.tempo, new)
            if p.move.to_guard:
                track.add(end, track.guard)
    for track in tracks.values():
        track.add(total, track.guard)
    return tracks


FOLLOW_THROUGH = 0.16  # s after a blow in which its limb's keys still aim at the same target


def _aimed(target: tuple[float, float, float], value: Aim) -> np.ndarray:
    """A place [3] in the stance frame, measured from a target (angle [deg], distance, height)."""
    angle, distance, height = np.radians(target[0]), target[1], target[2]
    left, up, ahead = value.offset
    sideways = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    outward = np.array([np.sin(angle), 0.0, np.cos(angle)])
    return (distance + ahead) * outward + left * sideways + np.array([0.0, height + up, 0.0])


def _hands(
    score: Sequence[Performed],
    starts: Sequence[float],
    at: np.ndarray,
    stance: np.ndarray,
    place: dict[str, np.ndarray],
    alive: dict[str, np.ndarray],
    pelvis: np.ndarray,
    turned: dict[str, np.ndarray],
    style: Style,
) -> np.ndarray:
    """Fists [F, 2, 3] in the world: carried by the head, aimed, put, or planted where they are."""
    guard = [np.array(style.guard[c], dtype=float)[None] for c in ("pelvis", *TURNS)]
    rest = trunk(guard[0], *(np.radians(g) for g in guard[1:])).at["Head"]
    now = trunk(pelvis, *(turned[c] for c in TURNS)).at["Head"]
    shift = planar_apply(planar_inverse(stance), now) - rest
    out = []
    for hand in HANDS:
        there = place[hand][:, :3] + alive[hand] + place[hand][:, 3:] * shift
        there = planar_apply(stance, there)
        for p, start in zip(score, starts):
            for plant in p.move.plants:
                if plant.hand != hand:
                    continue
                begin, end = start + plant.start * p.tempo, start + plant.stop * p.tempo
                middle = min(round(0.5 * (begin + end) * FPS), len(at) - 1)
                spot = planar_apply(stance[middle], np.array(plant.place))
                inside = np.minimum(at - begin, end - at) / plant.fade + 1.0
                there += ease(inside)[:, None] * (spot - there)
        out.append(there)
    return np.stack(out, axis=1)


def _pointed(stance: np.ndarray, blade: np.ndarray) -> np.ndarray:
    """The way of a blade [F, 3] in the world, from yaw and pitch [deg] in the stance."""
    yaw, pitch = np.radians(blade[:, 0]) + stance[:, 2], np.radians(blade[:, 1])
    flat = np.cos(pitch)
    return np.stack([np.sin(yaw) * flat, np.sin(pitch), np.cos(yaw) * flat], axis=1)


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
        "left_hand": np.stack([0.006 * wave(0.9, 6), 0.006 * wave(0.7, 7), zero], axis=1),
        "right_hand": np.stack([0.005 * wave(0.8, 4), 0.005 * wave(0.6, 6), zero], axis=1),
    }
