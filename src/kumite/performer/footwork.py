"""Footwork: where the stance glides and where each foot is, step by step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from kumite.clip import SIDES
from kumite.errors import KumiteError, unknown
from kumite.performer.moves import Foothold, Style
from kumite.performer.skeleton import BALL_HEIGHT
from kumite.rotation import planar_apply

if TYPE_CHECKING:
    from kumite.performer.take import Performed


def walk(
    score: Sequence[Performed],
    starts: Sequence[float],
    at: np.ndarray,
    fps: float,
    style: Style,
    place: dict[str, np.ndarray],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stance frames [F, 3], feet [F, 2, 4] (ball [m] and yaw) and how far each is off the ground
    [F, 2]: 0 planted to 1 in the air.

    The stance glides while feet step; a foot that is not stepping does not move at all. ``place``
    holds the foot channels [F, 4], which count in the air only.
    """
    stance = _glide(score, starts, at)
    feet = np.zeros((len(at), 2, 4))
    aloft = np.zeros((len(at), 2))
    for s, side in enumerate(SIDES):
        steps = [
            (start + step.lift * p.tempo, start + step.land * p.tempo, step, p, start)
            for p, start in zip(score, starts)
            for step in p.move.steps
            if step.foot == side
        ]
        down = _foothold(stance[0], style.feet[side])
        feet[:, s] = down
        free = place[f"{side}_foot"]
        for n, (lift, land, step, p, start) in enumerate(steps):
            again = steps[n + 1][0] if n + 1 < len(steps) else land
            moment = start + p.move.seconds * p.tempo
            if step.stride:
                moment = 0.5 * (land + again) if n + 1 < len(steps) else at[-1]
            foothold = step.to or style.feet[side]
            goal = _foothold(stance[min(round(moment * fps), len(at) - 1)], foothold)
            move = goal - down
            move[3] = (move[3] + np.pi) % (2 * np.pi) - np.pi
            first, last = np.searchsorted(at, [lift, land], side="right")
            u = (at[first:last] - lift) / (land - lift)
            until = np.searchsorted(at, again, side="right") if n + 1 < len(steps) else len(at)
            feet[first:until, s] = down + move
            path = down + (u**2 * (3.0 - 2.0 * u))[:, None] * move
            # A foot rises faster than it is put down.
            path[:, 1] += step.height * np.sin(np.pi * u**0.85) ** 2
            off = ease(np.minimum(u, 1.0 - u) * (land - lift) / RAMP)
            own = free[first:last]
            if np.any(own != UNMOVED):
                ball = planar_apply(stance[first:last], own[:, :3])
                ball += own[:, 3:] * (path[:, :3] - planar_apply(stance[first:last], np.zeros(3)))
                path[:, :3] += off[:, None] * (ball - path[:, :3])
            feet[first:last, s] = path
            aloft[first:last, s] = np.maximum(off, 1e-6)
            down = down + move
    return stance, feet, aloft


UNMOVED = np.array([0.0, 0.0, 0.0, 1.0])  # a foot channel that leaves the foot to its step
RAMP = 0.12  # s in which a lifted foot goes over to its channel


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
            begin = start + min(s.lift for s in steps) * p.tempo - 0.07
            end = start + max(s.land for s in steps) * p.tempo + 0.10
        first, last = np.searchsorted(at, [begin, end])
        first, last = max(first - 1, 0), min(last + 1, len(at))
        done = GLIDES[p.move.glide]((at[first:last] - begin) / (end - begin))
        x, z, yaw = p.travel
        pace[first + 1 : last] += np.diff(done)[:, None] * np.array([x, z, np.radians(yaw)])
    # Half of a frame's turn comes before its shift and half after: arcs come out round.
    yaw = np.cumsum(pace[:, 2])
    mid = yaw - 0.5 * pace[:, 2]
    x = np.cumsum(np.cos(mid) * pace[:, 0] + np.sin(mid) * pace[:, 1])
    z = np.cumsum(-np.sin(mid) * pace[:, 0] + np.cos(mid) * pace[:, 1])
    return np.stack([x, z, yaw], axis=1)


def _foothold(stance: np.ndarray, foothold: Foothold) -> np.ndarray:
    """Ball [3] and yaw of a foot that stands at (x, z, yaw) in a stance."""
    x, z, yaw = foothold
    c, s = math.cos(stance[2]), math.sin(stance[2])
    ball = (stance[0] + c * x + s * z, BALL_HEIGHT, stance[1] - s * x + c * z)
    return np.array([*ball, stance[2] + math.radians(yaw)])


def ease(u: np.ndarray) -> np.ndarray:
    """0 to 1 with no velocity and no acceleration at either end (minimum jerk)."""
    u = np.clip(u, 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


GLIDES = {
    "ease": ease,
    "steady": lambda u: np.clip(u, 0.0, 1.0),
    "start": lambda u: np.clip(u, 0.0, 1.0) ** 2,
    "stop": lambda u: 1.0 - (1.0 - np.clip(u, 0.0, 1.0)) ** 2,
}
"""How a stance travels over a move, 0..1: from rest to rest, at one speed, from rest, to rest."""
