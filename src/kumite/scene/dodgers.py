"""Those who avoid: they stand or move about, see what comes, and get out of its way.

The search runs in the background (Oshita & Masaoka 2011, section 6): what it finds is taken up a
fixed number of frames later, so that a scene shows the same whether a machine is fast or slow. The
present edge goes on meanwhile; if it ends, another is begun, and paths without that are dropped.
Only what would be taken up in the very next frame is waited for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from kumite.body import Spheres, load_spheres
from kumite.clip import Skeleton
from kumite.control.attack import Attack
from kumite.control.avoidance import Avoidance, AvoidanceSearch, Outcome, Plan, Standing
from kumite.rotation import planar_compose, wrap_angle
from kumite.scene.events import Decision, Event, Searched, Stale
from kumite.scene.settings_dodge import DodgeSettings
from kumite.synthesis import Cast

LATENCY = 1  # frames after which what a search has found is taken up
PATIENCE = 1  # frames before it is due at which a search is waited for, at the end of an edge
SOONEST = 4.0  # s before its end from which an attack is minded
FEW = 3  # of the best ways to go on that are drawn from
HOME = 0.5  # rad for each metre away from home
TOO_FAR = 0.6  # m from home that is not minded …
ROAMING = 3.0  # … and by those who keep a distance
TOO_NEAR = 2.0  # rad for each metre nearer than the distance to keep …
TOO_WIDE = 1.0  # … and for each metre farther
IN_VAIN = 1.5  # rad, of a blow at nobody …
SOON = 0.6  # s after which at the latest it would come

_POOL: list[ThreadPoolExecutor] = []


def background() -> ThreadPoolExecutor:
    """One thread for all scenes: kernels in it run beside those of the picture."""
    if not _POOL:
        _POOL.append(ThreadPoolExecutor(1, "avoidance"))
    return _POOL[0]


def volume_of(dodge: DodgeSettings, skeleton: Skeleton) -> Spheres | None:
    """The body's volume, if a file says what it is. Errors: of the file."""
    return None if dodge.spheres is None else load_spheres(dodge.spheres, skeleton)


@dataclass
class Menace:
    """An attack as one of those who avoid sees it."""

    attack: Attack
    number: int
    ball: str | None = None  # that is thrown, or …
    attacker: str | None = None  # … whose blow it is
    told: set[str] = field(default_factory=set)  # outcomes that have been told
    tried: int = -1  # in which of its victim's edges avoiding it was last thought about
    covered: bool = False  # by the plan that is being followed
    settled: bool = False  # nothing more is to be done about it


@dataclass
class Mind:
    """What one of them is up to."""

    home: np.ndarray  # [3] facing frame that it comes back to
    stretch: int
    edges: int = 0  # begun so far
    menaces: list[Menace] = field(default_factory=list)
    plan: Plan | None = None
    next_edge: int = 0  # of the plan
    search: Future[Avoidance] | None = None
    main: Menace | None = None  # what is searched for
    due: int = 0  # frame at which the search is taken up
    since: list[int] = field(default_factory=list)  # edges begun since it was
    resolved: list[int] = field(default_factory=list)  # stretches to play, unless it must avoid


class Dodgers:
    """K characters who avoid, and what each knows of the attacks on it."""

    def __init__(
        self,
        search: AvoidanceSearch,
        names: Sequence[str],
        homes: np.ndarray,
        rng: np.random.Generator,
        tell: Callable[[Event], None],
        *,
        latency: int = LATENCY,
    ) -> None:
        """names [K]; homes [K, 3]: facing frames. tell: is told of searches and decisions."""
        self.names, self.frame = tuple(names), 0
        self.search, self.rng, self.tell, self.latency = search, rng, tell, latency
        self.library = library = search.library
        self.fps = library.clips.fps
        self.cast = Cast(library, len(homes))
        table = library.table
        part_of = search.graph.part_of
        self._avoids = part_of[1:] > part_of[:-1]
        peaks = np.sort(self.library.strikes.frame)
        soon = np.maximum(table.first + round(SOON * self.fps), table.last)
        self._strikes = np.searchsorted(peaks, soon, "right") > np.searchsorted(peaks, table.first)
        calm = np.flatnonzero(~self._avoids)
        ways = np.diff(table.action_start)[table.target]
        restful = calm[ways[calm] >= np.median(ways[calm])] if len(calm) else np.arange(len(ways))
        self.minds = []
        for k, home in enumerate(homes):
            stretch = int(rng.choice(restful))
            self.cast.place(k, int(table.target[stretch]), home)
            self.minds.append(Mind(np.array(home, dtype=float), stretch))
        self.watched: list[np.ndarray | None] = [None] * len(homes)  # [x, z] that each looks at
        self.distance: float | None = None  # m to keep to it; None: stay at home
        self.resolve: Callable[[int], Sequence[int]] = lambda k: ()  # stretches to play, if any
        self.cast.show(0.0)

    def menace(
        self,
        k: int,
        attack: Attack,
        number: int,
        *,
        ball: str | None = None,
        attacker: str | None = None,
    ) -> Menace:
        """Let character k know of an attack on it; one of the same number is replaced.

        ball: the thing that is thrown; attacker: whose blow it is.
        """
        mind = self.minds[k]
        for known in mind.menaces:
            if known.number == number:
                known.attack, known.covered, known.settled, known.tried = attack, False, False, -1
                return known
        mind.menaces.append(Menace(attack, number, ball, attacker))
        return mind.menaces[-1]

    def forget(self, number: int) -> None:
        """An attack is over for everyone."""
        for mind in self.minds:
            mind.menaces = [m for m in mind.menaces if m.number != number]

    def step(self, frame: int) -> None:
        """One frame: searches are taken up and begun, edges chosen, all move on."""
        self.frame, now = frame, frame / self.fps
        cast = self.cast
        for k, mind in enumerate(self.minds):
            if mind.search is not None and frame >= mind.due:
                self._take_up(k, mind, now)
            mind.menaces = [m for m in mind.menaces if m.attack.when[-1] >= now]
        for k, mind in enumerate(self.minds):
            cast.rate[k] = self._rate(mind, now)
        while len(waiting := cast.waiting):  # again, where an edge is shorter than a quick frame
            for k in waiting.tolist():
                mind = self.minds[k]
                # Who must choose now and would know better in the next frame waits for it: an
                # edge taken at random here would make what is found stale.
                if mind.search is not None and mind.due <= frame + PATIENCE:
                    self._take_up(k, mind, now)
                    cast.rate[k] = self._rate(mind, now)
                self._go_on(k, mind, now)
        for k, mind in enumerate(self.minds):
            if mind.search is None and self._seen(mind, now):
                mind.due = frame + self.latency
                mind.search = background().submit(self.search.search, *self._asked(k, mind, now))
        cast.advance()

    def _rate(self, mind: Mind, now: float) -> float:
        if mind.plan is None:
            return 1.0
        then = now + 1.0 / self.fps
        frames = mind.plan.frames(then) - mind.plan.frames(now)
        if then > mind.plan.ends:
            frames += (then - max(now, mind.plan.ends)) * self.fps
            if now > mind.plan.ends:
                mind.plan = None
        return frames

    # Searching -----------------------------------------------------------------------------------

    def standing(self, k: int) -> Standing:
        """Where character k is."""
        cast, mind = self.cast, self.minds[k]
        return Standing(
            cast.anchor[k].copy(),
            float(cast.frame[k] + cast.fraction[k]),
            int(cast.stop[k]),
            mind.stretch,
            1.0 / float(cast.rate[k]),
            cast.left(k),
        )

    def _seen(self, mind: Mind, now: float) -> Menace | None:
        """What is to be thought about next: the attack that is over first of those not yet seen to.

        In the same edge the same would be found, so each is thought about once an edge.
        """
        soon = [
            m
            for m in mind.menaces
            if not (m.covered or m.settled)
            and m.tried < mind.edges
            and m.attack.when[-1] - now < SOONEST
        ]
        return min(soon, key=lambda m: m.attack.when[-1]) if soon else None

    def _asked(self, k: int, mind: Mind, now: float) -> tuple[Standing, list[Attack], float]:
        """A search's arguments."""
        mind.main = main = self._seen(mind, now)
        assert main is not None
        main.tried, mind.since = mind.edges, []
        return (
            self.standing(k),
            [main.attack, *(m.attack for m in mind.menaces if m is not main)],
            now,
        )

    def _search(self, standing: Standing, attacks: list[Attack], now: float) -> Avoidance:
        return self.search.search(standing, attacks, now)

    def _take_up(self, k: int, mind: Mind, now: float) -> None:
        assert mind.search is not None and mind.main is not None
        found, menace = mind.search.result(), mind.main
        mind.search = mind.main = None
        self._follow(k, mind, found, menace, now)

    def _follow(self, k: int, mind: Mind, found: Avoidance, menace: Menace, now: float) -> None:
        """Take up what has been found against an attack."""
        if found.outcome not in menace.told or found.outcome == Outcome.FOUND:
            menace.told.add(found.outcome)
            self.tell(
                searched(
                    self.frame, self.names[k], found, menace.number, menace.ball, menace.attacker
                )
            )
        # Wide of where it is may be right where it goes next; too late remains so.
        menace.settled = found.outcome == Outcome.LATE
        if found.outcome != Outcome.FOUND or found.plan is None:
            return
        for path, part in ((found.path, found.plan.part), *found.others):
            rest = _after(path, mind.since)
            if rest is None:
                continue
            aim = found.plan.begins + found.aim
            mind.plan = self.search.timed(self.standing(k), rest, part, aim, now)
            mind.next_edge = 0
            mind.resolved = []
            for m in mind.menaces:
                m.covered = m is menace or m.covered
            menace.covered = True
            return
        menace.tried = -1
        self.tell(
            Stale(
                self.frame,
                self.names[k],
                attack=menace.number,
                ball=menace.ball,
                attacker=menace.attacker,
                paths=1 + len(found.others),
            )
        )

    # Going on ------------------------------------------------------------------------------------

    def _go_on(self, k: int, mind: Mind, now: float) -> None:
        """Character k begins another edge: its plan's, or one that suits.

        Whoever stands at a fork when an attack is first seen decides there and then.
        """
        planned = mind.plan is not None and mind.next_edge < len(mind.plan.path)
        if not planned and mind.search is None and self._seen(mind, now):
            asked = self._asked(k, mind, now)
            main, mind.main = mind.main, None
            assert main is not None
            self._follow(k, mind, self._search(*asked), main, now)
        if mind.plan is not None and mind.next_edge < len(mind.plan.path):
            stretch = mind.plan.path[mind.next_edge]
            mind.next_edge += 1
        else:
            mind.resolved = mind.resolved or list(self.resolve(k))
            stretch = mind.resolved.pop(0) if mind.resolved else self._idle(k, mind)
            for m in mind.menaces:  # what is still to come is thought about anew
                m.covered = False
        mind.stretch = stretch
        mind.since.append(stretch)
        mind.edges += 1
        chosen = np.full(self.cast.count, stretch)
        self.cast.begin(np.array([k]), chosen)
        jump = bool(self.cast.jump[k])
        self.tell(Decision(self.frame, self.names[k], by="avoid", stretch=stretch, jump=jump))

    def _idle(self, k: int, mind: Mind) -> int:
        """A way to go on that avoids nothing, looks where it should and stays near home."""
        table, cast = self.library.table, self.cast
        state = int(np.searchsorted(table.state_frame, cast.stop[k]))
        ways = table.stretch[table.actions_of(state)]
        calm = ways[~self._avoids[ways]]
        ways = calm if len(calm) else ways
        facing = planar_compose(cast.anchor[k], self.library.clips.facing[int(cast.stop[k])])
        ends = planar_compose(facing, table.displacement[ways])
        watched = self.watched[k]
        if watched is None:
            want = np.full(len(ends), mind.home[2])
        else:
            want = np.arctan2(watched[0] - ends[:, 0], watched[1] - ends[:, 1])
        off = np.abs(wrap_angle(want - ends[:, 2]))
        away = np.linalg.norm(ends[:, :2] - mind.home[:2], axis=1)
        roams = watched is not None and self.distance is not None
        cost = off + HOME * np.maximum(away - (ROAMING if roams else TOO_FAR), 0.0)
        if roams:
            more = np.linalg.norm(ends[:, :2] - watched, axis=1) - self.distance
            cost += np.where(more < 0.0, -TOO_NEAR, TOO_WIDE) * more + IN_VAIN * self._strikes[ways]
        few = np.argsort(cost, kind="stable")[:FEW]
        few = few[cost[few] <= cost[few[0]] + 0.15]
        return int(ways[self.rng.choice(few)])


def _after(path: Sequence[int], begun: Sequence[int]) -> tuple[int, ...] | None:
    """What is left of a path after the edges begun; None if it is another path."""
    if tuple(path[: len(begun)]) != tuple(begun) or len(path) < len(begun):
        return None
    return tuple(path[len(begun) :])


def searched(
    frame: int,
    name: str,
    found: Avoidance,
    attack: int,
    ball: str | None = None,
    attacker: str | None = None,
) -> Searched:
    """What the log says of a search by ``name`` for a way out."""
    names = ("valid", "hit", "culled", "stiff", "too_fast", "too_long")
    said: dict[str, Any] = dict(zip(names, found.counts))
    if found.counts:
        said["candidates"] = found.candidates
    if np.isfinite(found.aim):
        said["aim"] = found.aim
    if found.outcome == Outcome.FOUND:
        best = ("path", "part", "indexed", "scale", "cost", "costs", "distance", "before")
        said |= {field: getattr(found, field) for field in best}
    return Searched(
        frame, name, attack=attack, ball=ball, attacker=attacker, outcome=found.outcome, **said
    )
