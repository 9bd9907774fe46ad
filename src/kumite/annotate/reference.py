"""The posture that a target motion is prepared for with (Shum et al. 2013, section 4.2).

A target motion leaves a locomotion, does what it is about, and returns. From the first frame of
what it is about, the *mark*, we go back towards its start until a posture is found that

1. stands in balance: the centre of mass is over the support area,
2. stands on the same feet as the start,
3. has the legs much as the start has them,

so that a character may take it on while it still walks. If there is none it is the start's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kumite.annotate.balance import Balance, find_balance
from kumite.annotate.contacts import Contacts
from kumite.annotate.strikes import Strikes
from kumite.brief import brief
from kumite.checked import checked
from kumite.checks import freeze
from kumite.clip import LEG_ROLES, SIDES, ClipSet
from kumite.errors import KumiteError
from kumite.rotation import angle, conjugate, from_yaw, multiply

LEGS = 4.0  # rad²: six joints of both legs that differ by 47° each: who ducks bends them
DEPARTED = 0.25  # of the farthest that a target goes from its start: there it has begun


@checked
@brief
@dataclass(frozen=True)
class Reference:
    """The posture found in a target motion, and how it was."""

    start: int  # T_0, frame in the set of clips
    mark: int  # T_t, the first frame of the target movement
    frame: int  # T_p
    found: bool  # False: no frame fits, it is the start's
    balanced: np.ndarray  # [mark - start + 1] bool, condition 1 from the start to the mark
    same_contacts: np.ndarray  # likewise bool, condition 2
    legs: np.ndarray  # likewise rad², what condition 3 looks at

    def __post_init__(self) -> None:
        frames = self.mark - self.start + 1
        freeze(
            self,
            "reference",
            balanced=(np.bool_, (frames,)),
            same_contacts=(np.bool_, (frames,)),
            legs=(float, (frames,)),
        )

    def __str__(self) -> str:
        return where_found(self.frame, self.mark, self.found)


def where_found(frame: int, mark: int, found: bool) -> str:
    """Which frame a reference posture is, in words. found: as of :class:`Reference`."""
    if found:
        return f"frame {frame}, {mark - frame} before the mark"
    return f"frame {frame}, the start: no frame up to the mark fits"


@checked
def find_reference(
    clips: ClipSet,
    contacts: Contacts,
    start: int,
    mark: int,
    *,
    threshold: float = LEGS,
    balance: Balance | None = None,
) -> Reference:
    """The reference posture of the target motion that starts at frame ``start``.

    mark: first frame of the target movement, as the user marks it or :func:`find_mark` finds it.
    threshold: of the sum of squared angles of the legs' joints [rad²]. balance: of these clips, if
    it is known.

    Errors: a mark outside of the clip, or before the start; a threshold that is not above 0.
    """
    _check(clips, start, mark)
    if not threshold > 0:
        raise KumiteError(f"reference: threshold {threshold} rad²; expected more than 0")
    balance = balance or find_balance(clips, contacts)
    span = slice(start, mark + 1)
    balanced = balance.balanced[span]
    same = np.all(contacts.on_ground[span] == contacts.on_ground[start], axis=1)
    legs = leg_differences(clips, start, span)
    fits = np.flatnonzero(balanced & same & (legs < threshold))
    found = len(fits) > 0
    frame = start + int(fits[-1]) if found else start  # the first on the way back is the last
    return Reference(start, mark, frame, found, balanced, same, legs)


def _check(clips: ClipSet, start: int, mark: int) -> None:
    if not 0 <= start < len(clips):
        raise KumiteError(f"reference: start {start}; expected a frame from 0 to {len(clips) - 1}")
    clip = int(clips.clip_of_frame[start])
    last = int(clips.clip_start[clip + 1]) - 1
    if not start <= mark <= last:
        raise KumiteError(
            f"reference: mark {mark} is outside of the target motion in {clips.names[clip]!r}; "
            f"expected a frame from its start {start} to the clip's end {last}"
        )


def leg_differences(clips: ClipSet, start: int, span: slice) -> np.ndarray:
    """Sums [n] of the squared angles [rad²] by which the legs' joints differ from a frame's."""
    roles = (f"{side}_{part}" for side in SIDES for part in LEG_ROLES if part != "toe")
    joints = [clips.skeleton.joint(role) for role in roles]
    return np.sum(angle(clips.wxyz[span][:, joints], clips.wxyz[start, joints]) ** 2, axis=1)


@checked
def find_mark(
    clips: ClipSet,
    start: int,
    stop: int,
    strikes: Strikes | None = None,
    *,
    share: float = DEPARTED,
) -> int:
    """The first frame of the target movement in start .. stop - 1, where nobody marks it.

    Where the drive of the first blow begins; without one, where the posture (angles of all joints
    but the legs', heading aside, and where the pelvis is high up) has gone ``share`` of the
    farthest that it goes from where it starts. Errors: frames that are no part of one clip.
    """
    _check(clips, start, stop - 1)
    if strikes is not None:
        begun = strikes.start[(strikes.frame >= start) & (strikes.frame < stop)]
        if len(begun):
            return int(max(begun.min(), start))
    legs = {clips.skeleton.roles.get(f"{s}_{p}") for s in SIDES for p in LEG_ROLES}
    joints = [j for j in range(len(clips.skeleton)) if j not in legs]
    wxyz = clips.wxyz[start:stop].copy()
    yaw = clips.facing[start:stop, 2]
    wxyz[:, 0] = multiply(conjugate(from_yaw(yaw)), wxyz[:, 0])
    apart = np.sum(angle(wxyz[:, joints], wxyz[0, joints]) ** 2, axis=1)
    height = clips.world[0][start:stop, clips.skeleton.joint("pelvis"), 1]
    away = np.sqrt(apart + (3.0 * (height - height[0])) ** 2)  # 10 cm weigh as 0.3 rad
    return start + int(np.argmax(away >= share * away.max()))
