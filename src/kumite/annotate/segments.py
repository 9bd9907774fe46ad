"""Where one action ends and the next begins (Shum et al. 2012, section IV).

The paper cuts a capture at double support phases and joins the parts again where the sum of the
squared accelerations of the joints is above a threshold at the cut, for the body is then in the
middle of a blow. A fighter in guard stands on both feet most of the time, a runner never does; so
here

- in a double support phase the cut goes to where the body *rests*: quiet, near its own guard, and
  going nowhere, just before it moves again;
- a rest that lasts becomes a part of its own;
- between rests, steps are taken in pairs from the rest that they leave, and a pair ends where its
  second foot comes down: there a runner is cut, too, and a cycle of a gait begins and ends alike;
- a cut between steps counts only where the arms and the trunk accelerate little.

Quiet is what the arms, the chest and the head do relative to the pelvis, and how the pelvis goes
along the ground: the bounce of a guard is not an action.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from scipy.ndimage import gaussian_filter1d

from kumite.annotate.contacts import Contacts, find_contacts
from kumite.clip import SIDES, ClipSet, runs
from kumite.rotation import planar_apply, planar_inverse

ROLES = (
    "pelvis",
    "chest",
    "head",
    *(f"{side}_{part}" for part in ("hand", "forearm", "foot") for side in SIDES),
)
"""Joints whose trajectories are looked at: R of them, in this order."""
PELVIS, CHEST, HEAD = 0, 1, 2
HANDS, FEET = slice(3, 5), slice(7, 9)
UPPER = slice(0, 7)

SMOOTHING = 0.03  # s, of positions before they are differentiated: captures tremble
BOUNCE = 0.25  # how much of the pelvis' up and down counts as movement
CALM = 30.0  # percentile of quietness below which a clip's guard is taken
QUIETEST = 5.0  # percentile: a boxer who never stands still is quiet in his own way
LIGHT = (0.03, 0.3)  # m and m/s: a foot that is lifted so little steps, too
LYING = 0.5  # of the height of the pelvis in guard: below it the body lies, and may rest there


@dataclass(frozen=True)
class CutSettings:
    """What a rest is, and how cuts are set by it. Times in seconds."""

    quiet: float = 0.2  # m/s, root mean square of the joints: below it a body rests
    least_quiet: float = 0.45  # m/s: however restless the guard, above it no body rests
    near: float = 0.12  # m from the guard, of the joint that is farthest
    going: float = 0.2  # m/s of the pelvis along the ground, over two fifths of a second
    acceleration: float = 30.0  # m/s², root mean square of trunk and arms: above it nothing is cut
    before: float = 0.08  # the body has begun before it is seen to move
    after: float = 0.2  # and ends later than it is seen to: returns are slow at last
    long_rest: float = 0.8  # a rest that lasts is idleness, a part of its own
    short_rest: float = 0.3  # a shorter one does not part two steps on the spot
    stand: float = 0.2  # shorter double support is part of a step
    shortest: float = 0.15  # of a part


class Cut(IntEnum):
    """Why a clip is cut there."""

    BORDER = 0  # the clip begins or ends
    REST = 1  # a rest between two movements
    SHORT_REST = 2
    REST_BEGINS = 3  # a lasting one
    REST_ENDS = 4
    STEP = 5  # the second foot of a pair comes down


@dataclass(frozen=True)
class Motion:
    """Trajectories of the joints of ROLES, smoothed, and what follows of them at once."""

    position: np.ndarray  # [F, R, 3] m
    velocity: np.ndarray  # [F, R, 3] m/s
    acceleration: np.ndarray  # [F, R, 3] m/s²
    standing: np.ndarray  # [C] m, height of the pelvis in guard
    quiet: np.ndarray  # [F] m/s, the measure that rests are told by
    away: np.ndarray  # [F] m from the clip's guard, of the joint that is farthest
    upper: np.ndarray  # [F] m/s², root mean square of the accelerations of trunk and arms


def find_motion(clips: ClipSet) -> Motion:
    """The trajectories that cuts and kinds are told by. Errors: a role that is missing."""
    joints = [clips.skeleton.joint(role) for role in ROLES]
    raw = clips.world[0][:, joints]
    position, velocity, acceleration = (np.zeros_like(raw) for _ in range(3))
    bounds = list(zip(clips.clip_start[:-1].tolist(), clips.clip_start[1:].tolist()))
    for a, b in bounds:
        position[a:b] = gaussian_filter1d(raw[a:b], SMOOTHING * clips.fps, axis=0, mode="nearest")
        if b - a > 1:
            velocity[a:b] = np.gradient(position[a:b], axis=0) * clips.fps
            acceleration[a:b] = np.gradient(velocity[a:b], axis=0) * clips.fps
    speed2, force2 = (_squared(x) for x in (velocity, acceleration))
    quiet = np.sqrt(speed2 + 0.05**2 * force2)
    upper = np.sqrt(np.mean(np.sum(acceleration[:, UPPER] ** 2, axis=2), axis=1))

    to_facing = planar_inverse(clips.facing)
    pose = planar_apply(to_facing[:, None], position[:, UPPER])
    feet = planar_apply(to_facing, position[:, FEET].mean(axis=1))
    pose[:, PELVIS, [0, 2]] -= feet[:, [0, 2]]
    away = np.zeros(len(clips))
    guard = np.zeros((len(bounds), *pose.shape[1:]))
    for c, (a, b) in enumerate(bounds):
        calm = quiet[a:b] <= np.percentile(quiet[a:b], CALM)
        guard[c] = np.median(pose[a:b][calm], axis=0)
        away[a:b] = np.linalg.norm(pose[a:b] - guard[c], axis=2).max(axis=1)
    return Motion(position, velocity, acceleration, guard[:, PELVIS, 1], quiet, away, upper)


def _squared(x: np.ndarray) -> np.ndarray:
    """Mean square [F] of vectors [F, R, 3]: arms, chest and head relative to the pelvis, the pelvis
    along the ground as much as all together, for it carries them.
    """
    x = x.copy()
    x[:, 1:7] -= x[:, :1]
    x[:, PELVIS, 1] *= BOUNCE
    x[:, PELVIS, ::2] *= np.sqrt(x.shape[1])
    return np.mean(np.sum(x**2, axis=2), axis=1)


def find_cuts(
    clips: ClipSet, contacts: Contacts, motion: Motion, settings: CutSettings
) -> tuple[np.ndarray, np.ndarray]:
    """Frames [P + 1] at which clips are cut, borders included, and why [P + 1] (Cut)."""
    resting = contacts.resting_height
    light = find_contacts(clips, height=LIGHT[0], speed=LIGHT[1], resting_height=resting).on_ground
    frames: list[int] = []
    reasons: list[Cut] = []
    for c in range(len(clips.names)):
        a, b = int(clips.clip_start[c]), int(clips.clip_start[c + 1])
        frames.append(a)
        reasons.append(Cut.BORDER)
        rests = _rests(
            motion, _stands(light[a:b], clips.fps, settings), c, a, b, clips.fps, settings
        )
        cuts = _rest_cuts(rests, motion.quiet[a:b], clips.fps, settings)
        steps = _landings(light[a:b], clips.fps)
        found = dict(cuts)
        for begin, end in zip([0, *found], [*found, b - a]):
            inside = steps[(steps > begin) & (steps < end - 0.05 * clips.fps)]
            # The last pair, and the odd step after it, end with the rest that follows.
            for k in inside[1 : max(len(inside) - 2, 0) : 2].tolist():
                if motion.upper[a + k] < settings.acceleration:
                    cuts.append((k, Cut.STEP))
        for frame, reason in sorted(cuts):
            if frame + a > frames[-1] and frame < b - a:
                frames.append(frame + a)
                reasons.append(reason)
    return np.array([*frames, len(clips)]), np.array([*reasons, Cut.BORDER])


def _rests(
    motion: Motion,
    stands: np.ndarray,
    clip: int,
    a: int,
    b: int,
    fps: float,
    settings: CutSettings,
) -> np.ndarray:
    """Half-open runs [n, 2] of frames of a clip in which the body rests."""
    quiet = motion.quiet[a:b]
    place = motion.position[a:b, PELVIS][:, [0, 2]]
    reach = max(1, round(0.2 * fps))
    k = np.arange(b - a)
    ahead, behind = np.minimum(k + reach, b - a - 1), np.maximum(k - reach, 0)
    gone = np.linalg.norm(place[ahead] - place[behind], axis=1) * fps / (2 * reach)
    lying = motion.position[a:b, PELVIS, 1] < LYING * motion.standing[clip]
    near = (motion.away[a:b] < settings.near) & stands & (gone < settings.going)
    resting = (quiet < _limit(quiet, settings)) & (near | lying)
    # moments too short to be a movement part no rest
    found = runs(resting, apart=round(0.05 * fps))
    return found[found[:, 1] - found[:, 0] >= 0.04 * fps]


def _stands(on_ground: np.ndarray, fps: float, settings: CutSettings) -> np.ndarray:
    """Frames [F] of double support that is more than a gait's, from step to step."""
    both = on_ground[:, 0] & on_ground[:, 1]
    for a, b in runs(both).tolist():
        if b - a < settings.stand * fps and a > 0 and b < len(both):
            both[a:b] = False
    return both


def _limit(quiet: np.ndarray, settings: CutSettings) -> float:
    """What counts as quiet in a clip [m/s]."""
    own = 1.5 * float(np.percentile(quiet, QUIETEST))
    return float(np.clip(own, settings.quiet, max(settings.quiet, settings.least_quiet)))


def _rest_cuts(
    rests: np.ndarray, quiet: np.ndarray, fps: float, settings: CutSettings
) -> list[tuple[int, Cut]]:
    """Cuts of a clip at its rests: in order, frames within the clip."""
    count = len(quiet)
    limit = 0.6 * _limit(quiet, settings)
    out: list[tuple[float, Cut]] = []
    before, after, shortest = (
        t * fps for t in (settings.before, settings.after, settings.shortest)
    )
    for a, b in rests.tolist():
        lasting = (settings.short_rest if a == 0 else settings.long_rest) * fps
        if a == 0 and b == count:
            continue
        if b < count and b - a >= lasting:  # slow beginnings: after a stand they can be seen
            still = np.flatnonzero(quiet[a:b] < limit)
            if len(still):
                b = max(b - round(0.1 * fps), a + int(still[-1]) + 1)
        if a == 0:
            if b - before > shortest:
                out.append((b - before, Cut.REST_ENDS))
        elif b == count:
            if count - a - after > shortest:
                out.append((a + after, Cut.REST_BEGINS))
        elif b - a >= lasting:
            out += [(a + after, Cut.REST_BEGINS), (b - before, Cut.REST_ENDS)]
        else:
            short = b - a <= settings.short_rest * fps
            out.append((max(b - before, 0.5 * (a + b)), Cut.SHORT_REST if short else Cut.REST))
    rounded = [(round(frame), reason) for frame, reason in out]
    return sorted({frame: reason for frame, reason in rounded if 0 < frame < count}.items())


def _landings(on_ground: np.ndarray, fps: float) -> np.ndarray:
    """Frames at which a foot comes down; both feet at once are one landing."""
    down = np.zeros(len(on_ground), dtype=bool)
    down[1:] = (on_ground[1:] & ~on_ground[:-1]).any(axis=1)
    frames = np.flatnonzero(down)
    return frames[np.diff(frames, prepend=-fps) > 0.1 * fps]
