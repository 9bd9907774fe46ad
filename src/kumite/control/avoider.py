"""A controller that gets its character out of the way (Oshita & Masaoka 2011).

It chooses only while an attack is coming. Where its character plays an edge of the avoidance layer,
it goes on from that edge's end. Elsewhere, where the capture that is played comes past a state of
that layer, an avoidance may be begun there without a join; where that would be too late, it is
begun at once, by a join, as from the state most like the pose.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from kumite.control.attack import Attack
from kumite.control.avoidance import NONE, Avoidance, AvoidanceSearch, Outcome, Plan, Standing
from kumite.control.protocol import NO_SPAN, PASS, View
from kumite.graph.spans import NO_STATE
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
    ball: str | None = None  # that is thrown, or …
    attacker: str | None = None  # … whose blow it is
    tried: set[tuple[int, int]] = field(default_factory=set)  # from where avoiding was thought of
    told: set[str] = field(default_factory=set)  # outcomes that have been told
    covered: bool = False  # by the plan that is followed
    settled: bool = False  # nothing more is to be done about it but to keep clear of it


class Avoider:
    """Avoids what it is told of by :meth:`mind`."""

    name = "avoid"

    def __init__(
        self,
        search: AvoidanceSearch,
        tell: Callable[[Avoidance, Threat], None],
        *,
        reaction: float = 0.0,
        away: np.ndarray | None = None,
    ) -> None:
        """search: of a library's avoidance layer. tell: is told what each search comes to.

        reaction: s after which it knows of an attack that has begun, or of more of it. away [F]
        rad: how far each frame is from where the controllers after it could go on; None: they go
        on where an avoidance has ended.
        """
        self.search, self.tell, self.reaction, self._away = search, tell, reaction, away
        self.layer = search.library.name
        self.start()

    def start(self) -> None:
        self.threats: list[Threat] = []
        self._unknown: list[tuple[float, Threat]] = []  # and from when on each is known
        self._forget_plan()

    @property
    def watches(self) -> bool:
        return bool(self.threats or self._unknown) or self.plan is not None

    # What comes ----------------------------------------------------------------------------------

    def mind(
        self,
        attack: Attack,
        number: int,
        now: float,
        *,
        ball: str | None = None,
        attacker: str | None = None,
        avoid: bool = True,
    ) -> None:
        """An attack begins, or more of it can be seen at a time [s]: one of the same number is
        replaced. It is known a reaction later.

        ball: the thing that is thrown; attacker: whose blow it is. avoid: it is got out of the way
        of; else it is something that an avoidance must keep clear of.
        """
        seen = Threat(attack, number, ball, attacker, settled=not avoid)
        self._unknown = [(w, t) for w, t in self._unknown if t.attack.when[-1] >= now]
        self._unknown.append((now + self.reaction, seen))

    def forget(self, number: int) -> None:
        """An attack is over."""
        self.threats = [t for t in self.threats if t.number != number]
        self._unknown = [(w, t) for w, t in self._unknown if t.number != number]

    def _learn(self, now: float) -> None:
        """Know what is known from now on, and forget what is over."""
        threats = {t.number: t for t in self.threats}
        for _, seen in [u for u in self._unknown if u[0] <= now + 1e-9]:
            if seen.number in threats:
                seen.told = threats[seen.number].told
            threats[seen.number] = seen
        self._unknown = [u for u in self._unknown if u[0] > now + 1e-9]
        self.threats = [t for t in threats.values() if t.attack.when[-1] >= now]

    # The controller ------------------------------------------------------------------------------

    def watch(self, view: View) -> int | None:
        self._learn(view.seconds)
        if self.plan is not None and not self._goes_on(view):
            self._forget_plan()
        if not view.free:
            return None
        k, cast = view.me, view.cast
        frame, stop = int(cast.frame[k]), int(cast.stop[k])
        edge = self._edge_of(view)
        if edge != NONE:
            if self._find(view, standing(cast, k, stop, edge), stop):
                return stop
            return self._hands_over(frame)
        if self.plan is not None:
            return None
        search, here = self.search, frame + int(cast.fraction[k] > 0.0)
        if not self._unseen(view.seconds) or search.strikes[frame]:
            return None  # a blow that is driven home is not broken off
        state = int(search.entries[here]) if here < len(search.entries) else NO_STATE
        comes_past = state != NO_STATE and state <= stop
        soon = comes_past and state - frame <= SOON * view.fps
        if soon and self._find(view, standing(cast, k, state), state):
            return state
        like, unlike = search.nearest
        if unlike[frame] <= WORST and self._find(view, joined(cast, k, int(like[frame])), frame):
            return frame
        if comes_past and self._find(view, standing(cast, k, state), state):
            return state
        return None

    def choose(self, view: View) -> int:
        if self.plan is not None and not self._goes_on(view):
            self._forget_plan()
        if self.plan is None:
            return PASS
        if self._next == len(self.plan.path):  # it is out of the way of what it minded
            edge, k, stop = self._edge_of(view), view.me, int(view.cast.stop[view.me])
            self._forget_plan()
            if self.search.state_at(stop) != NONE:
                here = standing(view.cast, k, stop, edge)
            else:  # it has handed over within an edge
                here = joined(view.cast, k, int(self.search.nearest[0][stop]))
            if not self._find(view, here, stop):
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
        self._forget_plan()
        for t in self.threats:
            t.tried = set()

    # Searching -----------------------------------------------------------------------------------

    @property
    def rest(self) -> tuple[int, ...]:
        """What of the plan's path has not begun: stretches."""
        return () if self.plan is None else self.plan.path[self._next :]

    def _edge_of(self, view: View) -> int:
        """The stretch of the avoidance layer that its character plays, or NONE."""
        if view.span == NO_SPAN:
            return NONE
        layer, stretch = view.spans.stretch(view.span)
        return stretch if layer == self.layer else NONE

    def _goes_on(self, view: View) -> bool:
        """Whether its character does what the plan counts on: a controller before it may have done
        something else meanwhile."""
        if self._edge == NONE:  # the path has not begun: it does where that edge ends
            return int(view.cast.stop[view.me]) == self._from
        return view.span == view.spans.span(self.layer, self._edge)

    def _hands_over(self, frame: int) -> int | None:
        """Where what it avoids is over and those after it could go on from here: here."""
        if self.plan is None or self._edge == NONE or self._away is None:
            return None
        if any(t.covered for t in self.threats) or self._away[frame] > NEAR:
            return None
        self._next = len(self.plan.path)
        return frame

    def _forget_plan(self) -> None:
        self.plan: Plan | None = None
        self._next = 0  # of the plan's path
        self._edge = NONE  # what it chose last, while that is played
        self._from = NO_STATE  # the frame after which its path begins
        for t in self.threats:  # what is still to come is thought about anew
            t.covered = False

    def _unseen(self, now: float) -> list[Threat]:
        """What is to be thought about: what is not seen to, and near enough."""
        return [
            t
            for t in self.threats
            if not (t.covered or t.settled) and t.attack.when[-1] - now < SOONEST
        ]

    def _find(self, view: View, where: Standing, leave: int) -> bool:
        """Look for a way out from where its character will be, having left what it plays at a
        library frame; whether there is a new plan.

        Whatever it plays, from one state the same would be found: each attack is thought about
        there once.
        """
        now, key = view.seconds, (view.begun, where.stop)
        soon = [t for t in self._unseen(now) if key not in t.tried]
        if not soon:
            return False
        threat = min(soon, key=lambda t: t.attack.when[-1])
        threat.tried.add(key)
        attacks = [threat.attack, *(t.attack for t in self.threats if t is not threat)]
        found = self.search.search(where, attacks, now)
        if found.outcome not in threat.told or found.outcome == Outcome.FOUND:
            threat.told.add(found.outcome)
            self.tell(found, threat)
        # Wide of where it is may be right where it goes next; too late remains so.
        threat.settled = found.outcome == Outcome.LATE
        if found.plan is None:
            return False
        self.plan, self._next, self._edge, self._from = found.plan, 0, NONE, leave
        threat.covered = True
        return True


def standing(cast: Cast, k: int, stop: int, stretch: int = NONE) -> Standing:
    """Where character k is, on its way to library frame ``stop``; stretch: of the avoidance layer,
    if it plays one."""
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
