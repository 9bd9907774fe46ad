"""Effective hits of fists and feet (Lee & Lee 2004, section 6, data annotation).

A fist delivers power where its velocity, projected on the axis of the forearm, is above a threshold
and points along it. The paper says no more; a foot kicks round its knee, so it counts where it is
fast, seen from the hips, forward and ahead of them; and a sword, a joint of the role ``sword``,
strikes with edge and point in front of the body. The paper marks frames; a *strike* is one run of
such frames, told by its fastest frame, so that blows can be counted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kumite.annotate.contacts import velocity
from kumite.brief import brief
from kumite.checked import checked
from kumite.checks import freeze, instance
from kumite.clip import LIMBS, ClipSet, runs, tip_positions
from kumite.errors import KumiteError
from kumite.rotation import planar_apply, planar_inverse

HAND_SPEED = 2.0  # m/s along the forearm
FOOT_SPEED = 6.0  # m/s from the hips: walking swings a foot at 3 m/s without kicking
EDGE_SPEED = 12.0  # m/s of a weapon's tip, in a cut
POINT_SPEED = 3.0  # m/s of a weapon's tip along the weapon, in a thrust
AHEAD = 0.6  # m from the body in front, where a weapon strikes: before it is there it is swung back
APART = 0.08  # s: no arm strikes twice within it
FLOOR = 0.4  # m: a hand that goes lower reaches for the floor, it does not strike


@brief
@dataclass(frozen=True)
class Strikes:
    """Effective hits of all clips: by frame and limb, and as one row a blow (X blows)."""

    effective: np.ndarray  # [F, 4] bool, in the order of clip.LIMBS
    tip: np.ndarray  # [F, 4, 3] m, the limbs' tips in the frame's facing frame
    speed: np.ndarray  # [F, 4] m/s, what the threshold is for: see above
    frame: np.ndarray  # [X] int32, the fastest frame of each blow
    start: np.ndarray  # [X] int32, first frame above the threshold
    stop: np.ndarray  # [X] int32, one past the last
    limb: np.ndarray  # [X] int32, index into clip.LIMBS
    velocity: np.ndarray  # [X, 3] m/s of the tip, in the facing frame of ``frame``

    def __post_init__(self) -> None:
        limbs = len(LIMBS)
        frames = freeze(
            self,
            "strikes",
            effective=(np.bool_, ("F", limbs)),
            tip=(float, ("F", limbs, 3)),
            speed=(float, ("F", limbs)),
            frame=(np.int32, ("X",)),
            start=(np.int32, ("X",)),
            stop=(np.int32, ("X",)),
            limb=(np.int32, ("X",)),
            velocity=(float, ("X", 3)),
        )["F"]
        inside = (self.start >= 0) & (self.start <= self.frame) & (self.frame < self.stop)
        if not np.all(inside & (self.stop <= frames) & (self.limb >= 0) & (self.limb < limbs)):
            raise KumiteError("strikes: a blow lies outside the frames or the limbs")

    def __len__(self) -> int:
        return len(self.frame)

    @property
    def points(self) -> np.ndarray:
        """Effective hitting points [P, 3]: the tip at each effective frame, in its facing frame."""
        return self.tip[self.effective]


@checked
def only_blows(strikes: Strikes, keep: np.ndarray) -> Strikes:
    """The strikes without the blows that are not kept [X] bool: arms swing in running, too."""
    effective = np.zeros_like(strikes.effective)
    for x in np.flatnonzero(keep).tolist():
        inside = slice(int(strikes.start[x]), int(strikes.stop[x]))
        effective[inside, strikes.limb[x]] = strikes.effective[inside, strikes.limb[x]]
    rows = ("frame", "start", "stop", "limb", "velocity")
    kept = {name: getattr(strikes, name)[keep] for name in rows}
    return replace(strikes, effective=effective, **kept)


def find_strikes(
    clips: ClipSet, *, hand_speed: float = HAND_SPEED, foot_speed: float = FOOT_SPEED
) -> Strikes:
    """Effective hits; hand_speed: of a fist along the forearm, foot_speed: from the hips [m/s]."""
    instance(clips, ClipSet, "find_strikes")
    if hand_speed <= 0 or foot_speed <= 0:
        raise KumiteError("strikes: the speed thresholds must be above 0")
    position, world = clips.world
    skeleton = clips.skeleton
    to_facing = planar_inverse(clips.facing)
    turn = to_facing * np.array([0.0, 0.0, 1.0])
    count = len(clips)
    effective = np.zeros((count, len(LIMBS)), dtype=bool)
    tip = np.zeros((count, len(LIMBS), 3))
    speed = np.zeros((count, len(LIMBS)))
    rows = []
    hips = velocity(position[:, skeleton.joint("pelvis")], clips)
    for k, limb in enumerate(LIMBS):
        side, part = limb.split("_")
        point = tip_positions(skeleton, limb, position, world)
        v = velocity(point, clips)
        tip[:, k] = planar_apply(to_facing, point)
        weapon = skeleton.roles.get("sword")
        if part == "foot":
            swing = planar_apply(turn, v - hips)
            speed[:, k] = np.linalg.norm(swing, axis=1)
            effective[:, k] = (speed[:, k] > foot_speed) & (swing[:, 2] > 0) & (tip[:, k, 2] > 0)
        elif weapon is not None and skeleton.tip(limb)[0] == weapon:
            speed[:, k] = np.linalg.norm(v, axis=1)
            deadly = (speed[:, k] > EDGE_SPEED) | (
                _along(v, point, position[:, weapon]) > POINT_SPEED
            )
            effective[:, k] = deadly & (tip[:, k, 2] > AHEAD)
        else:
            elbow, wrist = (position[:, skeleton.joint(f"{side}_{r}")] for r in ("forearm", "hand"))
            speed[:, k] = _along(v, wrist, elbow)
            effective[:, k] = (speed[:, k] > hand_speed) & (point[:, 1] > FLOOR)
        apart = round(APART * clips.fps)
        for a, b in runs(effective[:, k], clips.clip_start, apart=apart).tolist():
            peak = a + int(np.argmax(speed[a:b, k]))
            rows.append((peak, a, b, k, planar_apply(turn[peak], v[peak])))
    rows.sort(key=lambda r: (r[0], r[3]))
    column = [np.array([r[c] for r in rows], dtype=np.int32) for c in range(4)]
    return Strikes(
        effective,
        tip,
        speed,
        *column,
        velocity=np.array([r[4] for r in rows]).reshape(-1, 3),
    )


def _along(v: np.ndarray, end: np.ndarray, start: np.ndarray) -> np.ndarray:
    """The part [F] of velocities [F, 3] along the way from start to end [F, 3]."""
    axis = end - start
    return np.sum(v * axis, axis=1) / np.maximum(np.linalg.norm(axis, axis=1), 1e-9)
