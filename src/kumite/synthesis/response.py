"""Which captured response goes on best from where a blow has left a body.

Shum et al. 2012, section VII: after the physical moment the response motion that fits the impulse
and the posture is blended in. The impulse says how much must happen (a flinch, a stagger, a fall);
among the responses of that size the one is taken whose pose, movement and direction are nearest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kumite.brief import brief
from kumite.checked import checked
from kumite.checks import freeze
from kumite.clip import ClipSet, Skeleton, facing_frame
from kumite.errors import KumiteError
from kumite.rotation import from_yaw, planar_apply, planar_inverse, rotate, wrap_angle
from kumite.synthesis.moment import Moment

SIZES = ("flinch", "stagger", "fall")
"""How much a response does, least first: the feet stay; the body is driven; it goes down."""
FLINCH, STAGGER, FALL = range(3)

# Impulses from which more happens. A fist brings 2.9 kg (ragdoll.EFFECTIVE_MASS): 5.2 m/s and
# 10 m/s. The straight punches measured there came at 9.14 ± 2.06 m/s: the harder third fells.
STAGGER_FROM = 15.0  # N s
FALL_FROM = 29.0  # N s

DRIVEN = 0.20  # m over the ground that the pelvis goes in a stagger, at the least
DOWN = 0.60  # of its height at the start to which the pelvis sinks in a fall, at most
ENTRY = (
    0.25  # s of a response's beginning in which it may be entered: the ragdoll played some of it
)
ENTRY_STEP = 1.0 / 30.0  # s between places to enter
HEADING = 0.40  # s in which the way that a response goes is measured: later it comes back

# What makes a cost of 1: joints 10 cm away, pelvis and head 1 m/s other, opposite direction 1/2.
POSTURE_SCALE = 0.10  # m
SPEED_SCALE = 1.0  # m/s
DIRECTION_WEIGHT = 2.0


@checked
@brief
@dataclass(frozen=True)
class Responses:
    """R places to enter a response, as seen from the facing frame there."""

    skeleton: Skeleton
    frame: np.ndarray  # [R] int64, library frame that is entered
    last: np.ndarray  # [R] int64, last frame of the response
    response: np.ndarray  # [R] int32, which of the responses given
    size: np.ndarray  # [R] int32, FLINCH, STAGGER or FALL
    posture: np.ndarray  # [R, J, 3] m, joints
    speed: np.ndarray  # [R, 2, 3] m/s, pelvis and head
    heading: np.ndarray  # [R, 2] unit vector (x, z), the way the body goes

    def __post_init__(self) -> None:
        rows = len(self.frame)
        freeze(
            self,
            "responses",
            frame=(np.int64, (rows,)),
            last=(np.int64, (rows,)),
            response=(np.int32, (rows,)),
            size=(np.int32, (rows,)),
            posture=(float, (rows, len(self.skeleton), 3)),
            speed=(float, (rows, 2, 3)),
            heading=(float, (rows, 2)),
        )
        if rows == 0:
            raise KumiteError("responses: none to choose from")

    def __len__(self) -> int:
        return len(self.frame)

    def size_for(
        self, impulse: float, stagger_from: float = STAGGER_FROM, fall_from: float = FALL_FROM
    ) -> int:
        """How much happens after an impulse [N s], of what there is: a harder blow never does less.

        Where no response has the size wanted, the next smaller one is taken, else the smallest.
        """
        wanted = FLINCH + int(impulse >= stagger_from) + int(impulse >= fall_from)
        there = np.unique(self.size)
        fits = there[there <= wanted]
        return int(fits[-1] if len(fits) else there[0])

    def costs(self, now: Moment, impulse: np.ndarray) -> np.ndarray:
        """How badly each entry [R] fits a pose, its movement and the way an impulse [3] points."""
        s = self.skeleton
        position, velocity = now.joints(s)
        facing = facing_frame(s, now.root_position[None], now.wxyz[None])[0]
        posture = planar_apply(planar_inverse(facing), position)
        turned_back = from_yaw(-facing[2])
        speed = rotate(turned_back, velocity[_gauges(s)])
        push = rotate(turned_back, np.asarray(impulse, dtype=np.float64))[[0, 2]]
        out = np.mean(np.sum((self.posture - posture) ** 2, axis=2), axis=1) / POSTURE_SCALE**2
        out += np.mean(np.sum((self.speed - speed) ** 2, axis=2), axis=1) / SPEED_SCALE**2
        along = self.heading @ push / max(float(np.linalg.norm(push)), 1e-9)
        return out + DIRECTION_WEIGHT * (1.0 - along)

    def match(
        self,
        now: Moment,
        impulse: np.ndarray,
        *,
        stagger_from: float = STAGGER_FROM,
        fall_from: float = FALL_FROM,
        hurry: float = 0.0,
    ) -> tuple[int, float]:
        """The entry to take, and its cost: the cheapest of the size that the impulse asks for.

        now: where the blow has left the body (``Pushed.end``); impulse [3] N s: of the blow; hurry:
        cost of each frame that a response goes on.
        Errors: a pose of another skeleton; an impulse that is not finite.
        """
        impulse = np.asarray(impulse, dtype=np.float64)
        if now.wxyz.shape != (len(self.skeleton), 4):
            raise KumiteError(
                f"responses: a pose of {len(now.wxyz)} joints, expected {len(self.skeleton)}"
            )
        if impulse.shape != (3,) or not np.all(np.isfinite(impulse)):
            raise KumiteError("responses: the impulse must be 3 finite numbers")
        size = self.size_for(float(np.linalg.norm(impulse)), stagger_from, fall_from)
        cost = self.costs(now, impulse) + hurry * (self.last - self.frame)
        cost[self.size != size] = np.inf
        index = int(np.argmin(cost))
        return index, float(cost[index])


@checked
def find_responses(clips: ClipSet, spans: Sequence[tuple[int, int]] | np.ndarray) -> Responses:
    """The table of responses given as library frames (first, last).

    Sizes and directions are measured from the motion, not named. Errors: no spans; a span that is
    no part of one clip.
    """
    skeleton, fps = clips.skeleton, clips.fps
    pelvis, head = _gauges(skeleton)
    position, _ = clips.world
    rows: list[tuple[int, int, int, int]] = []
    step = max(1, round(ENTRY_STEP * fps))
    for r, (first, last) in enumerate(np.asarray(spans, dtype=np.int64).reshape(-1, 2).tolist()):
        if not 0 <= first < last < len(clips) or (
            clips.clip_of_frame[first] != clips.clip_of_frame[last]
        ):
            raise KumiteError(f"responses: frames {first} to {last} are no part of one clip")
        way = position[first : last + 1, pelvis]
        driven = np.linalg.norm((way - way[0])[:, [0, 2]], axis=1).max() > DRIVEN
        size = FALL if way[:, 1].min() < DOWN * way[0, 1] else STAGGER if driven else FLINCH
        stop = min(first + round(ENTRY * fps), last - 1)
        rows += [(f, last, r, size) for f in range(first, stop + 1, step)]
    if not rows:
        raise KumiteError("responses: none to choose from")
    frame, last, response, size = np.array(rows).T
    home = planar_inverse(clips.facing[frame])
    posture = planar_apply(home[:, None], position[frame])
    past = np.maximum(frame - 1, clips.clip_start[clips.clip_of_frame[frame]])
    # From the frame before, as a cast takes it when it goes on from there.
    speed = (position[frame] - position[past])[:, [pelvis, head]] * fps
    speed = rotate(from_yaw(wrap_angle(home[:, 2]))[:, None], speed)
    heading = np.array([_farthest(position[f : e + 1], fps) for f, e in zip(frame, last)])
    heading = planar_apply(np.array([0.0, 0.0, 1.0]) * home, heading)[:, [0, 2]]
    length = np.linalg.norm(heading, axis=1, keepdims=True)
    heading = np.where(length > 0.01, heading / np.maximum(length, 0.01), 0.0)
    return Responses(skeleton, frame, last, response, size, posture, speed, heading)


def _farthest(position: np.ndarray, fps: float) -> np.ndarray:
    """How far [3] the middle of joints [F, J, 3] gets from where it begins, soon after."""
    middle = position[: 1 + round(HEADING * fps)].mean(axis=1) * np.array([1.0, 0.0, 1.0])
    way = middle - middle[0]
    return way[np.argmax(np.sum(way**2, axis=1))]


def _gauges(skeleton: Skeleton) -> list[int]:
    """The joints whose movement is compared."""
    return [skeleton.joint("pelvis"), skeleton.joint("head")]
