"""Striking back: a path of the motion graph whose blow meets where somebody will be.

The paths are enumerated as those to an avoidance are, with the library's blows in place of its
avoidance parts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kumite.body import lay_body
from kumite.clip import LIMBS, tip_positions
from kumite.control.avoidance import NONE, AvoidanceSearch, Standing, _now
from kumite.control.avoider import standing
from kumite.control.protocol import NO_SPAN, PASS, Plain, View
from kumite.kernels import counter as kernels
from kumite.kernels import paths
from kumite.rotation import planar_compose

WITHIN = 1.2  # s from now at the latest that a blow lands
DEEP = 0.02  # m that a fist should reach into what it meets
NEARLY = 0.03  # m by which it may miss: whoever is hit moves
HASTE = 0.15  # m of depth that a second of waiting is worth
ROOM = 0.55  # m between two pelvises that a path must leave where it ends
TRIED = 16  # of the best paths that are looked at for room
BOLDNESS = 1.0  # s after an avoided blow in which there is time to strike back
SAFE = 0.25  # s between a blow back and the next blow that may come


@dataclass(frozen=True)
class Counter:
    """A blow back."""

    path: tuple[int, ...]  # stretches after the present edge; the blow is in the last but one …
    blow: int  # of the library's strikes
    gap: float  # m between fist and skin at their nearest, below 0 inside
    seconds: float  # from now until then


@dataclass(frozen=True)
class Opening:
    """Whom a blow back may be meant for, as far as is known what that one does."""

    goal: np.ndarray  # [T, M, 3] m: where M parts of its body are at frames 0.. from now
    radius: np.ndarray  # [M] m, of these
    body: np.ndarray  # [T, 3] m: its pelvis
    until: float  # s of the scene at which the next blow may come


class CounterSearch:
    """Blows of a library, by the paths that lead to them."""

    def __init__(self, search: AvoidanceSearch) -> None:
        """search: of the same library, whose graph is searched."""
        self.search = search
        library = search.library
        clips, strikes, table = library.clips, library.strikes, library.table
        position, world = clips.world
        body = lay_body(clips.skeleton)
        self._radius = np.array([body.radius_end[body.part(limb)] for limb in LIMBS])
        tips = [tip_positions(clips.skeleton, limb, position, world) for limb in LIMBS]
        inside = [
            np.flatnonzero((strikes.frame >= first) & (strikes.frame <= last))
            for first, last in zip(table.first, table.last)
        ]
        self.which = np.concatenate([*inside, np.zeros(0, dtype=np.int64)]).astype(np.int64)
        self._begins = strikes.start[self.which].astype(np.int64)
        self._ends = strikes.stop[self.which].astype(np.int64)
        self._tip = np.concatenate(
            [
                np.zeros((0, 3)),
                *(
                    tips[strikes.limb[x]][strikes.start[x] : strikes.stop[x]]
                    for x in self.which.tolist()
                ),
            ]
        )
        part_of = np.cumsum([0, *(len(x) for x in inside)])
        peak = strikes.frame[self.which].astype(np.float64)
        soonest = np.empty(table.states)
        paths.soonest(
            table.action_start, table.stretch, table.first, table.last, table.target, part_of,
            peak, soonest,
        )  # fmt: skip
        frame = strikes.frame[self.which]
        self.graph = search.graph._replace(
            part_of=part_of, begins=frame, ends=frame, soonest=soonest
        )
        self._after = _goes_on(table.first, table.last)

    def find(
        self,
        standing: Standing,
        goal: np.ndarray,
        radius: np.ndarray,
        body: np.ndarray,
        *,
        within: float = WITHIN,
    ) -> Counter | None:
        """A blow that meets one of M goals, if there is one.

        goal [T, M, 3] m: where they will be at frames 0.. from now, the last row from then on;
        radius [M] m; body [T, 3]: the pelvis between them, which is not walked into. Of blows that
        reach within so many s, one that does so soon and well.
        """
        search = self.search
        state = search.state_at(standing.stop)
        if state == NONE or len(self.which) == 0:
            return None
        room, now = search._room(), _now(standing)
        fps = self.graph.fps
        count = paths.enumerate_paths(
            state, standing.stop - standing.phase, 0.0, within * fps, 0, self.graph, room.node,
            room.way, room.gone, room.path, room.length, room.part,
        )  # fmt: skip
        count = min(count, len(room.length))
        gap, when = np.empty(count), np.empty(count)
        fist = float(self._radius.max())
        kernels.aim_all(
            count, room.path, room.length, room.part, self._begins, self._ends, self._tip, now,
            self.graph, goal, radius + fist, room.scratch, gap, when,
        )  # fmt: skip
        reaches = np.flatnonzero(gap < NEARLY)
        if len(reaches) == 0:
            return None
        cost = np.maximum(gap[reaches], -DEEP) + HASTE * when[reaches] / fps
        for best in reaches[np.argsort(cost, kind="stable")[:TRIED]].tolist():
            path = room.path[best, : room.length[best]].tolist()
            following = self._after[
                path[-1]
            ]  # what the blow's own capture does next: it ends there
            if following != NONE:
                path.append(int(following))
            end = self._end(standing, path)
            if np.hypot(*(body[-1, [0, 2]] - end)) >= ROOM:
                blow = int(self.which[room.part[best]])
                return Counter(tuple(path), blow, float(gap[best]), float(when[best]) / fps)
        return None

    def _end(self, standing: Standing, path: list[int]) -> np.ndarray:
        """Where [2] a path ends, over the ground."""
        library = self.search.library
        here = planar_compose(standing.anchor, library.clips.facing[standing.stop])
        for stretch in path:
            here = planar_compose(here, library.table.displacement[stretch])
        return here[:2]


class CounterFighter(Plain):
    """A controller that strikes back for a while after a blow has been avoided."""

    name = "counter"

    def __init__(
        self,
        search: CounterSearch,
        opening: Callable[[int], Opening],
        tell: Callable[[int, Counter], None],
    ) -> None:
        """opening(k): whom character k may strike. tell(k, counter): is told what it does."""
        self.search, self.opening, self.tell = search, opening, tell
        self.layer = search.search.library.name
        self.start()

    def start(self) -> None:
        self._bold = -np.inf  # s until which it strikes back
        self._rest: list[int] = []  # stretches of a blow that has begun
        self._span = NO_SPAN  # that it chose last

    def avoided(self, now: float) -> None:
        """A blow has been avoided."""
        self._bold = now + BOLDNESS

    def choose(self, view: View) -> int:
        if view.span != self._span:  # somebody else has chosen meanwhile
            self._rest = []
        if not self._rest and view.seconds <= self._bold:
            self._rest = self._find(view)
        if not self._rest:
            self._span = NO_SPAN
            return PASS
        self._span = view.spans.span(self.layer, self._rest.pop(0))
        return self._span

    def interrupted(self, view: View) -> None:
        self._rest = []

    def _find(self, view: View) -> list[int]:
        """The stretches of a blow that meets somebody before the next can come, if there is one."""
        k, now, seen = view.me, view.seconds, self.opening(view.me)
        layer, edge = view.spans.stretch(view.span) if view.span != NO_SPAN else ("", NONE)
        here = standing(view.cast, k, int(view.cast.stop[k]), edge if layer == self.layer else NONE)
        found = self.search.find(here, seen.goal, seen.radius, seen.body)
        if found is None or seen.until < now + found.seconds + SAFE:
            return []
        self._bold = -np.inf
        self.tell(k, found)
        return list(found.path)


def _goes_on(first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """The stretch [L] with which a stretch's capture simply goes on, or NONE."""
    of = {int(f): s for s, f in enumerate(first)}
    return np.array([of.get(int(f) + 1, NONE) for f in last], dtype=np.int64)
