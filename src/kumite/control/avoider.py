"""A controller that gets its character out of the way (Oshita & Masaoka 2011).

It chooses only while an attack is coming. The character may be in any layer: where the capture that
it plays comes past a state of the avoidance layer, an avoidance may be begun there without a join;
where that would be too late, it is begun at once, by a join, as from the state most like the pose.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from kumite.annotate import Strikes
from kumite.control.attack import Attack
from kumite.control.avoidance import NONE, Avoidance, AvoidanceSearch, Outcome, Plan, Standing
from kumite.control.protocol import PASS, View
from kumite.graph.spans import NO_STATE, entries, nearest
from kumite.rotation import planar_compose, planar_inverse
from kumite.synthesis import Cast

SOONEST = 4.0  # s before its end from which an attack is minded
SOON = 0.1  # s in which a state is worth waiting for
NEAR = 0.5  # rad: as near to where others go on, one hands over before its action ends
WORST = 1.0  # rad: a pose farther from a state is not joined to what begins there


@dataclass
class Threat:
    """An attack as an avoider sees it."""

    attack: Attack
    number: int
    name: str  # of what attacks
    tried: set[int] = field(default_factory=set)  # states from which avoiding it was thought about
    told: set[str] = field(default_factory=set)  # outcomes that have been told
    covered: bool = False  # by the plan that is followed
    settled: bool = False  # nothing more is to be done about it


class Avoider:
    """Avoids what it is told of by :meth:`mind`."""

    name = "avoid"
    layer = "avoidance"

    def __init__(
        self,
        search: AvoidanceSearch,
        away: np.ndarray,
        strikes: Strikes,
        tell: Callable[[Avoidance, Threat], None],
    ) -> None:
        """search: of a library's avoidance layer. away [F] rad: how far each frame is from where
        the other controllers could go on. strikes: blows, which are not broken off once they are
        driven home. tell: is told what each search comes to."""
        self.search, self.tell, self._away = search, tell, away
        self._enter = entries(search.library)
        self._strikes = np.zeros(len(away), dtype=bool)
        for start, lands in zip(strikes.start.tolist(), strikes.frame.tolist()):
            self._strikes[start : lands + 1] = True
        near, self._unlike = nearest(search.library)
        self._like = search.library.table.last[near]
        self.start()

    def start(self) -> None:
        self.threats: list[Threat] = []
        self.plan: Plan | None = None
        self._next = 0  # of the plan's path
        self._edge = NONE  # what it chose last, while that is played

    def mind(self, attack: Attack, number: int, name: str) -> None:
        """Know of an attack from now on. name: of what attacks."""
        self.threats.append(Threat(attack, number, name))

    def forget(self, number: int) -> None:
        """An attack is over."""
        self.threats = [t for t in self.threats if t.number != number]

    def watch(self, view: View) -> int | None:
        now = view.seconds
        self.threats = [t for t in self.threats if t.attack.when[-1] >= now]
        if not view.free:
            return None
        k, cast = view.me, view.cast
        frame = int(cast.frame[k])
        if self.plan is not None:
            # What it minded is over: from here the others go on, if what is shown lets them.
            minded = any(t.covered for t in self.threats)
            if minded or self._edge == NONE or self._away[frame] > NEAR:
                return None
            self._next = len(self.plan.path)
            return frame
        ahead = frame + int(cast.fraction[k] > 0.0)
        if self._strikes[frame]:
            return None  # a blow that is driven home is not broken off
        state = int(self._enter[ahead]) if ahead < len(self._enter) else NO_STATE
        comes_past = state != NO_STATE and state <= cast.stop[k]
        soon = comes_past and state - frame <= SOON * view.fps
        if soon and self._search(view, standing(cast, k, state)):
            return state
        here = joined(cast, k, int(self._like[frame]))
        if self._unlike[frame] <= WORST and self._search(view, here):
            return frame
        if comes_past and self._search(view, standing(cast, k, state)):
            return state
        return None

    def choose(self, view: View) -> int:
        if self.plan is None:
            return PASS
        if self._next == len(self.plan.path):  # it is out of the way of what it minded
            self.plan = None
            for t in self.threats:
                t.covered = False
            k, stop, edge = view.me, int(view.cast.stop[view.me]), self._edge
            self._edge = NONE
            ended = self.search.state_at(stop) != NONE
            here = (
                standing(view.cast, k, stop, edge)
                if ended
                else joined(view.cast, k, int(self._like[stop]))
            )
            if not self._search(view, here):
                return PASS
        assert self.plan is not None
        self._edge = self.plan.path[self._next]
        self._next += 1
        return view.spans.span(self.layer, self._edge)

    def rate(self, view: View) -> float:
        if self.plan is None:
            return 1.0
        now, then = view.seconds, view.seconds + 1.0 / view.fps
        frames = self.plan.frames(then) - self.plan.frames(now)
        if then > self.plan.ends:
            frames += (then - max(now, self.plan.ends)) * view.fps
        return frames

    def interrupted(self, view: View) -> None:
        self.plan, self._edge = None, NONE
        for t in self.threats:
            t.covered, t.tried = False, set()

    def _search(self, view: View, where: Standing) -> bool:
        """Look for a way out from a state ahead; whether there is a plan now.

        From one state the same would be found, so each attack is thought about there once.
        """
        state = where.stop
        now = view.seconds
        soon = [
            t
            for t in self.threats
            if not (t.covered or t.settled)
            and state not in t.tried
            and t.attack.when[-1] - now < SOONEST
        ]
        if not soon:
            return False
        threat = min(soon, key=lambda t: t.attack.when[-1])
        threat.tried.add(state)
        attacks = [threat.attack, *(t.attack for t in self.threats if t is not threat)]
        found = self.search.search(where, attacks, now)
        if found.outcome not in threat.told or found.outcome == Outcome.FOUND:
            threat.told.add(found.outcome)
            self.tell(found, threat)
        threat.settled = found.outcome == Outcome.LATE
        if found.plan is None:
            return False
        self.plan, self._next, threat.covered = found.plan, 0, True
        return True


def standing(cast: Cast, k: int, stop: int, stretch: int = NONE) -> Standing:
    """Where character k is, on its way to library frame ``stop``."""
    return Standing(
        cast.anchor[k].copy(),
        float(np.minimum(cast.frame[k] + cast.fraction[k], stop)),
        stop,
        stretch,
        1.0 / float(cast.rate[k]),
        cast.left(k),
    )


def joined(cast: Cast, k: int, state: int) -> Standing:
    """Character k as if it stood in the state at library frame ``state``, where it is now."""
    facing = cast.library.clips.facing
    anchor = planar_compose(cast.facing[k], planar_inverse(facing[state]))
    return Standing(anchor, float(state), state, NONE, 1.0 / float(cast.rate[k]))
