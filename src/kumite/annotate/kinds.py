"""What kind of action a part of a capture is, and which way it goes.

As in Shum et al. 2012 (section IV) it is told by the trajectories of the joints that accelerate:
a fist, a foot or a sword that strikes is an attack; a head that is snapped round is one that has
been hit; a trunk or a guard that is taken away or put in the way is a defence; feet that carry the
body elsewhere are a transition. What is left is idle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from kumite.annotate.contacts import Contacts, velocity
from kumite.annotate.segments import FEET, HANDS, HEAD, LYING, PELVIS, SMOOTHING, Motion
from kumite.annotate.strikes import Strikes
from kumite.clip import LIMBS, ClipSet, tip_positions
from kumite.rotation import conjugate, multiply, planar_apply, planar_inverse

LEVEL = 20.0  # percentile of a clip's own restlessness that limits are raised by


@dataclass(frozen=True)
class KindSettings:
    """Where one kind ends and another begins."""

    snap: float = 10.0  # rad/s² of the head's turn, above what the clip is used to: it was hit
    restless_snap: float = 4.0  # how often over the clip's own level it must be
    trunk: float = 0.6  # rad/s of the chest against the pelvis, above what the clip is used to
    restless_trunk: float = 2.0  # how often over the clip's own level it must be
    arm: float = 25.0  # m/s² of a fist seen from the head: arms that swing in a run do not reach it
    far: float = 0.6  # m: further than this nobody goes in a slip or a block
    turned: float = 0.3  # rad: nor turns
    step: float = 0.12  # m: less is no step
    swing: float = 0.17  # rad: less is no turn
    duck: float = 0.24  # m that the head goes down
    low: float = (
        0.82  # of the pelvis' height in guard: below it knees are bent to get out of the way
    )
    block: float = 0.13  # m that a hand goes from where the guard has it, seen from the head


@dataclass(frozen=True)
class Trajectories:
    """What kinds are told by, a row a part (P of them), in the facing frame of its first frame."""

    path: np.ndarray  # [P, 3] m along x and z, and rad turned to the left
    head: np.ndarray  # [P, 4] m: furthest left, right, ahead and back of the feet's middle
    drop: np.ndarray  # [P] m that the head goes down
    lowest: np.ndarray  # [P] of the pelvis' height in guard
    ends: np.ndarray  # [P, 2] height of the pelvis at first and last, likewise
    snap: np.ndarray  # [P] rad/s², peak acceleration of the head's turn
    trunk: np.ndarray  # [P] rad/s, peak speed of the chest against the pelvis
    arm: np.ndarray  # [P] m/s², peak acceleration of either fist seen from the head
    hand: (
        np.ndarray
    )  # [P, 2, 3] m, furthest from where it began, seen from the head, left and right
    aloft: np.ndarray  # [P] s in which no foot is on the ground


def find_trajectories(
    clips: ClipSet, contacts: Contacts, motion: Motion, start: np.ndarray, stop: np.ndarray
) -> tuple[Trajectories, np.ndarray]:
    """Trajectories of the parts start [P] .. stop [P]; each clip's levels [C, 2] of snap, trunk."""
    turned = clips.world[1]
    chest, head, pelvis = (turned[:, clips.skeleton.joint(r)] for r in ("chest", "head", "pelvis"))
    _, snap = _turning(head, clips)
    trunk, _ = _turning(multiply(conjugate(pelvis), chest), clips)
    fist = motion.acceleration[:, HANDS] - motion.acceleration[:, HEAD, None]
    arm = np.linalg.norm(fist, axis=2).max(axis=1)
    owner = clips.clip_of_frame
    height = motion.position[:, PELVIS, 1] / motion.standing[owner]
    airborne = ~(contacts.on_ground[:, 0] | contacts.on_ground[:, 1])
    rows = []
    for a, b in zip(start.tolist(), stop.tolist()):
        at = planar_apply(planar_inverse(clips.facing[a]), motion.position[a:b])
        feet = at[:, FEET].mean(axis=1)
        over = at[:, HEAD] - feet
        moved = over - over[0]
        gone = at[-1, PELVIS] - at[0, PELVIS]
        yaw = clips.facing[b - 1, 2] - clips.facing[a, 2]
        hand = at[:, HANDS] - at[:, HEAD, None]
        hand = hand - hand[0]
        far = np.linalg.norm(hand, axis=2).argmax(axis=0)
        rows.append(
            (
                (gone[0], gone[2], (yaw + np.pi) % (2 * np.pi) - np.pi),
                (moved[:, 0].max(), -moved[:, 0].min(), moved[:, 2].max(), -moved[:, 2].min()),
                -moved[:, 1].min(),
                height[a:b].min(),
                (height[a], height[b - 1]),
                snap[a:b].max(),
                trunk[a:b].max(),
                arm[a:b].max(),
                (hand[far[0], 0], hand[far[1], 1]),
                airborne[a:b].sum() / clips.fps,
            )
        )
    bounds = zip(clips.clip_start[:-1], clips.clip_start[1:])
    level = [np.percentile([snap[a:b], trunk[a:b]], LEVEL, axis=1) for a, b in bounds]
    return Trajectories(*(np.array(column) for column in zip(*rows))), np.array(level)


def _turning(wxyz: np.ndarray, clips: ClipSet) -> tuple[np.ndarray, np.ndarray]:
    """Speed [rad/s] and acceleration [rad/s²] of a turn [F, 4], each [F]."""
    speed, acceleration = np.zeros(len(wxyz)), np.zeros(len(wxyz))
    for a, b in zip(clips.clip_start[:-1], clips.clip_start[1:]):
        if b - a < 2:
            continue
        q = wxyz[a:b].copy()
        same = np.where(np.sum(q[1:] * q[:-1], axis=1) < 0, -1.0, 1.0)
        q[1:] *= np.cumprod(same)[:, None]
        q = gaussian_filter1d(q, SMOOTHING * clips.fps, axis=0, mode="nearest")
        rate = 2.0 * np.gradient(q, axis=0) * clips.fps  # |dq/dt| is half the turn's speed
        speed[a:b] = np.linalg.norm(rate, axis=1)
        acceleration[a:b] = np.linalg.norm(np.gradient(rate, axis=0) * clips.fps, axis=1)
    return speed, acceleration


def find_kind(
    t: Trajectories, k: int, level: np.ndarray, strikes: bool, settings: KindSettings
) -> tuple[str, str]:
    """Kind and direction of part k; level [2]: its clip's; strikes: a limb strikes in it."""
    x, z, yaw = t.path[k]
    far = float(np.hypot(x, z))
    if t.lowest[k] < LYING:
        if t.ends[k, 1] > t.ends[k, 0] + 0.2:
            return "transition", "up"
        return "reaction", "fall"
    if strikes:
        return "attack", ""
    ducks = t.drop[k] > settings.duck or t.lowest[k] < settings.low
    snapped = t.snap[k] > settings.snap + settings.restless_snap * level[0]
    moved = t.trunk[k] > settings.trunk + settings.restless_trunk * level[1]
    if snapped and moved and not ducks and far < 2 * settings.far:
        return "reaction", "hit"
    goes = far > settings.far or abs(yaw) > settings.turned
    reach = np.linalg.norm(t.hand[k], axis=1).max()
    if moved and not goes:
        return "defence", _defence(t, k, ducks, settings)
    if not goes and reach > settings.block and far < settings.step:
        return "defence", "block"
    if far > settings.step or abs(yaw) > settings.swing:
        return "transition", _way(x, z, yaw, settings)
    return "idle", "none"


def _way(x: float, z: float, yaw: float, settings: KindSettings) -> str:
    """The way of a step: a turn where it turns more than it goes (half a radian as a third of a
    metre).
    """
    if abs(yaw) > settings.swing and abs(yaw) * 0.7 > np.hypot(x, z):
        return "turn left" if yaw > 0 else "turn right"
    if abs(z) >= abs(x):
        return "forward" if z > 0 else "back"
    return "left" if x > 0 else "right"


def _defence(t: Trajectories, k: int, ducks: bool, settings: KindSettings) -> str:
    left, right, _, back = t.head[k]
    if ducks:
        return "duck"
    if t.aloft[k] > 0.05 and t.path[k, 1] < -settings.step:
        return "jump back"
    if max(left, right, back) < settings.block:
        return "block"
    return "sway" if back > max(left, right) else "slip"


def strike_directions(clips: ClipSet, strikes: Strikes) -> list[str]:
    """How each blow [X] goes, by the ways of an attack; "" where a foot only runs."""
    position, world = clips.world
    weapon = clips.skeleton.roles.get("sword")
    out = []
    tips = {k: tip_positions(clips.skeleton, LIMBS[k], position, world) for k in set(strikes.limb)}
    speeds = {k: velocity(tip, clips) for k, tip in tips.items()}
    chest = position[:, clips.skeleton.joint("chest")]
    for frame, a, b, k in zip(strikes.frame, strikes.start, strikes.stop, strikes.limb):
        if LIMBS[k].endswith("foot"):
            out.append("kick" if tips[k][a:b, 1].max() > KICK else "")
            continue
        if weapon is not None and clips.skeleton.tip(LIMBS[k])[0] == weapon:
            v = speeds[k][frame]
            axis = tips[k][frame] - position[frame, weapon]
            along = v @ axis / max(float(np.linalg.norm(v) * np.linalg.norm(axis)), 1e-9)
            out.append("thrust" if along > 0.7 else "slash")
            continue
        peak = a + int(np.argmax(np.linalg.norm(speeds[k][a:b], axis=1)))
        outward = tips[k][peak] - chest[peak]
        outward[1] = 0.0
        outward /= max(float(np.linalg.norm(outward)), 1e-9)
        v = speeds[k][peak] / max(float(np.linalg.norm(speeds[k][peak])), 1e-9)
        if v[1] > UPWARD:
            out.append("uppercut")
        else:
            out.append("straight" if v @ outward > OUTWARD else "hook")
    return out


KICK = 0.3  # m: a foot that stays below it runs
UPWARD = 0.6  # of a fist's velocity at its fastest: an uppercut's
OUTWARD = 0.75  # away from the chest: a straight's
