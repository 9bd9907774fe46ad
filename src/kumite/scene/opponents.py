"""Opponents who close in on walkers: one comes near, the others wait; who is struck keeps away."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kumite.control.guide import seen
from kumite.errors import KumiteError
from kumite.graph.kinds import MUCH_WORSE, STRIKE, TAKES, Suited
from kumite.rotation import from_yaw, planar_apply, planar_inverse, rotate
from kumite.scene.settings_prepare import OpponentsSettings
from kumite.scene.walkers import NOTHING, ON_THE_WAY, Walkers
from kumite.synthesis.recoil import RECOIL

NOBODY = -1
REACH, RING = 0.6, 2.4  # m from a walker at which its opponent stops, and the others do
SKIN = 0.13  # m from the middle of a trunk to where it is struck
BEHIND = 1.5  # m that an opponent behind counts as farther away than one ahead
SETTLED = 0.5  # m that another must be nearer: nobody turns to and fro between two
LOOSE = 0.8  # of its part of the ring about a walker in which an opponent may begin
LOW, HIGH = 0.45, 1.0  # of the height of who stands: where a blow to a trunk or a head lands
WATCHED = 0.15  # s over which it is seen how they move


def blows_at(settings: OpponentsSettings, suited: Suited) -> tuple[int, ...]:
    """The target motions that may be done to opponents: of a kind those at the height of a trunk or
    a head, as well joined as the best nearly; a label whatever its height.

    Errors: a word that is no kind and no label; a motion that is no blow; none so high.
    """
    found: dict[int, None] = {}
    for word in settings.motions:
        which = suited.meant(word, "opponents.motions")
        wrong = [suited.label[t] for t in which.tolist() if suited.about[t] != STRIKE]
        if wrong or word in ("under", "over"):
            raise KumiteError(
                f"opponents.motions {list(settings.motions)}: expected blows; "
                f"{wrong[0] if wrong else word} is none"
            )
        if word in suited.label:
            found |= dict.fromkeys(which.tolist())
            continue
        high = suited.high[which] / suited.tall
        fits = which[(high >= LOW) & (high <= HIGH)]
        if len(which) and not len(fits):
            raise KumiteError(
                f"opponents.motions: every {word} of this library lands below a trunk or above a "
                f"head ({', '.join(f'{h:.2f}' for h in suited.high[which])} m); expected one at "
                f"{LOW * suited.tall:.2f} to {HIGH * suited.tall:.2f} m: {TAKES[word]}"
            )
        good = fits[suited.apart[fits] <= suited.apart[fits].min(initial=np.inf) + MUCH_WORSE]
        found |= dict.fromkeys(good.tolist())
    return tuple(found)


def closing_in(
    settings: OpponentsSettings, middle: np.ndarray, streams: Sequence[np.random.Generator]
) -> np.ndarray:
    """Where opponents begin [N, 3]: in a ring about a place [2], facing it, each somewhere in its
    part of the ring."""
    part = np.arange(settings.count) + [LOOSE * rng.random() for rng in streams]
    bearing = 2 * np.pi * part / settings.count
    way = np.stack([np.sin(bearing), np.cos(bearing)], axis=1)
    return np.column_stack([middle + settings.distance * way, bearing + np.pi])


class Opponents:
    """Who of K walkers is whose opponent: the first ``users`` are those they close in on."""

    def __init__(
        self,
        settings: OpponentsSettings | None,
        walkers: Walkers,
        users: int,
        motions: Sequence[int],
        streams: Sequence[np.random.Generator],
    ) -> None:
        """motions: the target motions that may be done to them; streams [K]: what each draws
        from."""
        self.settings, self.walkers, self.users = settings, walkers, users
        self.motions, self.streams, self.fps = motions, streams, walkers.fps
        count = len(walkers.facing)
        self.foe = np.full(count, NOBODY)  # whom each means to strike
        self.to_do = np.full(count, NOTHING)  # with what motion
        self.flees = np.zeros(count, dtype=np.int64)  # the frame until which somebody keeps away
        self._path = np.tile(walkers.facing[:, :2], (max(2, round(WATCHED * self.fps)), 1, 1))

    def assign(self, frame: int) -> None:
        """Walkers turn to the nearest who does not keep away; what they will do is drawn then."""
        w = self.walkers
        self._path = np.concatenate([self._path[1:], w.facing[None, :, :2]])
        if self.settings is None:
            return
        others = np.arange(self.users, len(self.foe))
        come = others[self.flees[others] <= frame]
        for k in range(self.users):
            if w.doing[k] != ON_THE_WAY:
                continue
            near = NOBODY
            if len(come):
                away, aside = seen(np.tile(w.facing[k], (len(come), 1)), w.facing[come, :2])
                away += BEHIND * np.abs(aside) / np.pi
                away[come == self.foe[k]] -= SETTLED
                near = int(come[np.argmin(away)])
            if near != self.foe[k]:
                self.foe[k] = near
                if near != NOBODY and self.to_do[k] == NOTHING:
                    self.to_do[k] = self.motions[int(self.streams[k].integers(len(self.motions)))]
                w.decide_anew(np.array([k]))

    def forget(self, k: int) -> None:
        """Walker k has done what was to be done."""
        self.to_do[k], self.foe[k] = NOTHING, NOBODY

    def place(self, k: int, foe: int, t: int, seconds: float) -> np.ndarray:
        """Where ``foe`` [3] is to be struck by target t in so many seconds, going on as now."""
        w = self.walkers
        moves = (self._path[-1, foe] - self._path[0, foe]) / ((len(self._path) - 1) / self.fps)
        at = w.shown.root_position[foe, [0, 2]] + seconds * moves
        way = w.facing[k, :2] - at
        at = at + SKIN * way / max(float(np.hypot(*way)), 1e-9)
        return np.array([at[0], w.preparing.place[t, 1], at[1]])

    def goal(self, k: int, frame: int) -> np.ndarray:
        """Where [3] opponent k goes: up to the nearest walker, or away from it for a while."""
        assert self.settings is not None
        w = self.walkers
        away = np.hypot(*(w.facing[: self.users, :2] - w.facing[k, :2]).T)
        at = w.facing[int(np.argmin(away)), :2]
        out = w.facing[k, :2] - at
        out /= max(float(np.hypot(*out)), 1e-9)
        far = REACH if k in self.foe[: self.users] else RING
        far = self.settings.distance if self.flees[k] > frame else far
        return np.array([*(at + far * out), np.nan])

    def reel(
        self, foe: int, joint: int, place: np.ndarray, velocity: np.ndarray, frame: int
    ) -> None:
        """Who is struck at a place [3] at a velocity [3] m/s gives way, and keeps away a while."""
        assert self.settings is not None
        w = self.walkers
        back = planar_inverse(w.shown.lag[foe])
        way = rotate(from_yaw(back[2]), RECOIL * velocity)
        w.cast.strike(foe, joint, planar_apply(back, place), way)
        self.flees[foe] = frame + round(self.settings.rest * self.fps)
        w.decide_anew(np.array([foe]))
