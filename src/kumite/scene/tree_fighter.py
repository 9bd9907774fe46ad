"""Characters that look ahead by game tree whenever an action has ended (Shum et al. 2012).

Everything that is decided on may change between two decisions (B12).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from kumite.control import Progress, Route, style
from kumite.control.game_tree import (
    CALM,
    GOAL_EVERY,
    MEMORY,
    NOBODY_ELSE,
    Decision,
    GameTree,
    Others,
    Player,
)
from kumite.control.protocol import Plain, View
from kumite.errors import KumiteError
from kumite.graph import Layer
from kumite.graph.spans import Spans, nearest
from kumite.kernels.blow import NO_BLOW, NOBODY
from kumite.kernels.moves import FALL, NOTHING
from kumite.rotation import planar_compose
from kumite.scene import events
from kumite.scene.controls import ORDERS, OrderControl, check_orders
from kumite.scene.events import Caught, CheckPointMissed, CheckPointReached
from kumite.scene.floor import Floor
from kumite.scene.reactions import Reactions
from kumite.scene.settings_fight import BoutSettings, CueSettings

NEAR = 6.0  # m within which others are minded
FREE = 1.5  # times the distance of a catch: so far one has got away
GOALS = 25  # places ahead of which a fighter knows: 6 s


class TreeFighter(Plain):
    """The controller of every character that looks ahead. It always has something to do.

    One object serves them all, for they plan with each other in mind.
    """

    name = "tree"
    layer = "actions"

    def __init__(
        self,
        layer: Layer,
        spans: Spans,
        names: tuple[str, ...],
        players: Sequence[Player],
        routes: Sequence[Route | None],
        bout: BoutSettings,
        turn_to_nearest: Callable[[int], None],
    ) -> None:
        """players, routes [K]: of all characters of the world, those that others decide for, too.
        turn_to_nearest: lets a character mind whoever is nearest, where the scene says so.

        Errors: a layer that is not one of whole actions; names in A⁺, A⁻ or at check points that no
        action has.
        """
        self.library, self.names, self.bout = layer, names, bout
        self.fps = layer.clips.fps
        self.tree = GameTree(layer, bout.rules())
        self.players, self.routes = list(players), list(routes)
        for name, player, route in zip(names, self.players, self.routes):
            check_orders(name, self.tree, player, route)
        self._begins = int(spans.begins[spans.layers.index(self.layer)])
        self._spans = spans
        self._turn_to_nearest = turn_to_nearest
        self._kept: dict[tuple[int, str], Any] = {}  # of players, what cues have changed
        self._calm = np.isin(self.tree.kinds, CALM)
        self._like = None  # [F] the calm stretch after which one may go on
        if len(spans.layers) > 1:
            self._like, _ = nearest(layer, np.flatnonzero(self._calm))

    def check_cue(self, cue: CueSettings) -> None:
        """Errors: names that no action has."""
        orders = Player(wanted=cue.wanted or (), unwanted=cue.unwanted or (), only=cue.only or ())
        check_orders(f"cue of {cue.who}", self.tree, orders, cue.route())

    @property
    def common(self) -> np.ndarray:
        """Stretches to begin after: where idling or moving about has ended, with many ways out."""
        table = self.library.table
        ways = np.diff(table.action_start)[table.target] * self._calm
        return np.flatnonzero(ways >= max(np.quantile(ways[self._calm], 0.5), 1))

    def begin(
        self,
        floor: Floor,
        stretch: np.ndarray,
        reactions: Reactions,
        tell: Callable[[events.Event], None],
    ) -> None:
        """A world begins, or begins again. stretch [K]: after which each character stands; -1: in
        none of this layer."""
        count = len(self.names)
        self.frame = 0
        self.floor, self.cast, self.reactions, self._tell = floor, floor.cast, reactions, tell
        for (k, field), kept in self._kept.items():
            setattr(self.players[k], field, kept)
        self._kept = {}
        self.decisions: list[Decision] = []
        self._recent = [deque(maxlen=MEMORY) for _ in range(count)]
        self.progress = [None if r is None else Progress(r) for r in self.routes]
        self._done: list[set[str]] = [set() for _ in range(count)]
        self._told = [0] * count  # check points before this one have been told if missed
        self._caught = np.zeros(count, dtype=bool)
        self._landed = [NO_BLOW] * count  # the blow each has landed last in what it is doing
        self.stretch = stretch.copy()
        self._elsewhere = stretch < 0  # in a span of another layer than its stretch
        for k in np.flatnonzero(self._elsewhere).tolist():
            assert self._like is not None  # there are several layers
            self.stretch[k] = self._like[self.cast.frame[k]]

    # The controller ------------------------------------------------------------------------------

    def choose(self, view: View) -> int:
        self.frame = view.frame
        return self.decide(view.me) + self._begins

    # What happens, as the world tells it ---------------------------------------------------------

    def began(self, k: int, span: int) -> None:
        """Character k begins a span, whoever has chosen it."""
        layer, stretch = self._spans.stretch(span)
        if layer == self.layer:
            self.does(k, stretch)
            return
        assert self._like is not None
        self._elsewhere[k] = True
        self.stretch[k] = self._like[self._spans.last[span]]  # it goes on as after that
        self._landed[k] = NO_BLOW

    def away(self, k: int) -> None:
        """Character k is posed by somebody else from now on."""
        self._elsewhere[k], self._landed[k] = True, NO_BLOW

    def does(self, k: int, stretch: int) -> None:
        """Character k is in a stretch from now on."""
        self.stretch[k], self._elsewhere[k] = stretch, False
        self._landed[k] = NO_BLOW
        self._done[k] |= {self.tree.kinds[stretch], self.tree.labels[stretch]}

    def landed(self, k: int, blow: int) -> None:
        """A blow of character k has met somebody."""
        self._landed[k] = blow

    def reacts(self, k: int) -> bool:
        """Whether character k does what it does because it was struck."""
        return not self._elsewhere[k] and self.tree.kinds[self.stretch[k]] == "reaction"

    def lies(self, k: int) -> bool:
        """Whether character k has been knocked down for good."""
        return self.players[k].stays_down and self.tree.labels[self.stretch[k]] == "fall"

    def is_to_fall(self, k: int) -> bool:
        """Whether a fall is asked of character k: then any blow fells it."""
        player = self._player(k)
        fall = self.tree.response[:, FALL]
        return bool(player.wanted and np.any(self.tree.asked(player)[fall[fall != NOTHING]] > 0))

    # Deciding ------------------------------------------------------------------------------------

    def decide(self, k: int) -> int:
        """What character k does next, as its game tree says: a stretch."""
        self._turn_to_nearest(k)
        cast, table, o = self.cast, self.library.table, int(self.floor.opponent[k])
        reached = cast.reached
        facing = cast.facing_at(reached)
        pair = (k, o)
        for p in pair:
            if self._elsewhere[p]:
                assert self._like is not None
                self.stretch[p] = self._like[reached[p]]
        late = self.reactions.late
        # Who is in another layer's span counts as at the end of what it will be like then.
        local = [
            int(table.duration[self.stretch[p]])
            if self._elsewhere[p]
            else int(reached[p] - table.first[self.stretch[p]] + 1 - late[p])
            for p in pair
        ]
        begun = (float(self.frame - local[0]), float(self.frame - local[1]))
        state = self.tree.state(
            (int(self.stretch[k]), int(self.stretch[o])),
            begun,
            (
                begun[0] + float(table.duration[self.stretch[k]]),
                begun[1] + float(table.duration[self.stretch[o]]) + self._still_elsewhere(o),
            ),
            (facing[k], facing[o]),
            float(self.frame),
            (self._landed[k], self._landed[o]),
        )
        players = (self._player(k), self._player(o))
        others = self._others(k, o)
        decision = self.tree.decide(state, players, tuple(self._recent[k]), others)
        self.decisions.append(decision)
        self._recent[k].append(decision.stretch)
        self._tell(
            events.Decision(
                self.frame,
                self.names[k],
                by="tree",
                action=self.tree.labels[decision.stretch],
                stretch=decision.stretch,
                comp=decision.comp,
                coop=decision.coop,
                nodes=int(decision.nodes.sum()),
                considered=int(decision.considered.sum()),
                pruned=decision.pruned,
                jump=self._jumps(k, decision.stretch),
                outside_set=decision.outside,
                flaws=", ".join(decision.flaws),
            )
        )
        return decision.stretch

    def _still_elsewhere(self, k: int) -> float:
        """Frames until character k, if it is in another layer's span, may choose again."""
        if not self._elsewhere[k]:
            return 0.0
        cast = self.cast
        return float(max(cast.stop[k] - cast.frame[k], 0) / cast.rate[k])

    def _jumps(self, k: int, stretch: int) -> bool:
        """Whether a stretch begins with a join, where character k is."""
        return int(self.cast.reached[k]) != int(self.library.table.first[stretch]) - 1

    def _others(self, k: int, o: int) -> Others:
        """Who else is near character k and its opponent, as the tree is told of them."""
        place = self.cast.root_position[:, [0, 2]]
        near = np.linalg.norm(place - place[k], axis=1) < NEAR
        near |= np.isin(self.floor.opponent, [k, o])  # after one of the two, wherever they are
        near[[k, o]] = False
        who = np.flatnonzero(near)
        if len(who) == 0:
            return NOBODY_ELSE
        step = np.arange(GOALS) * round(GOAL_EVERY * self.fps)
        cast, facing = self.cast, self.library.clips.facing
        ahead = facing[cast.frames_ahead(who, step)]
        track = planar_compose(cast.anchor[who, None], ahead)[..., :2]
        after = self.floor.opponent[who]
        side = np.where(after == o, 0, np.where(after == k, 1, -1))
        styles = [self.players[e].style for e in who.tolist()]
        wants = [(s.distance, s.preferred_distance, s.given_short) for s in styles]
        return Others(track, side, np.array(wants))

    def _player(self, k: int) -> Player:
        """A fighter as it plays now: with where it is to be, and what is wanted there."""
        player, progress = self.players[k], self.progress[k]
        rival = int(self.floor.opponent[k])
        if rival != NOBODY and self.lies(rival):  # it is over
            return replace(player, only=("idle",) if "idle" in self.tree.choices else ())
        if progress is None:
            return player
        goal = progress.ahead(self.frame / self.fps, GOAL_EVERY, GOALS)
        return replace(
            player,
            goal=goal + self._beside(k) if _is_shared(progress) else goal,
            urgency=progress.urgency(self.frame / self.fps),
            wanted=(*player.wanted, *progress.wanted),
            unwanted=(*player.unwanted, *progress.unwanted),
        )

    def _beside(self, k: int) -> np.ndarray:
        """From the middle between fighter k and its opponent to where it would stand [2] m: on the
        side on which it is, at half the distance it prefers. Two cannot be in one place.
        """
        place = self.cast.root_position[:, [0, 2]]
        way = place[k] - place[self.floor.opponent[k]]
        return 0.5 * self.players[k].style.preferred_distance * way / max(np.hypot(*way), 1e-9)

    # What is told while it runs -------------------------------------------------------------------

    def set_route(self, k: int, route: Route | None) -> None:
        """Send a fighter along check points, in place of any it had; its times count from now.
        None: along none. Errors: nobody is called so; wrong actions at a check point.
        """
        check_orders(self.names[k], self.tree, self.players[k], route)
        self.routes[k] = route
        self.progress[k] = None if route is None else Progress(route.later(self.frame / self.fps))
        self._told[k] = 0
        self._done[k] = set()

    def move_check_point(self, k: int, index: int, place: tuple[float, float]) -> None:
        """Put a check point of a fighter's route elsewhere (x, z) m. Errors: there is none such."""
        route, progress = self.routes[k], self.progress[k]
        if route is None or progress is None:
            raise KumiteError(f"{self.names[k]} has no route; expected a check point of one")
        self.routes[k] = route.moved(index, place)
        progress.move(index, place)

    def orders_of(self, k: int) -> list[OrderControl]:
        """What one fighter is told of actions: A⁺, A⁻ and the action set."""
        return [
            OrderControl(self.names[k], f, self.players[k], self.tree, self.routes[k])
            for f in ORDERS
        ]

    def take_cue(self, k: int, cue: CueSettings) -> None:
        """Character k fights otherwise from its next decision on."""
        for field in ("style", "depth", "wanted", "unwanted", "only"):
            told = getattr(cue, field)
            if told is not None:
                self._kept.setdefault((k, field), getattr(self.players[k], field))
                setattr(self.players[k], field, style(told) if field == "style" else told)
        route = cue.route()
        if route is not None:
            self.progress[k], self._told[k] = Progress(route), 0

    # What is passed ------------------------------------------------------------------------------

    def catch(self) -> None:
        """Tell whom somebody has come so near that it counts; again after it has got away."""
        place, opponent = self.cast.root_position[:, [0, 2]], self.floor.opponent
        far = np.linalg.norm(place - place[opponent], axis=1)
        wants = np.array([p.style.preferred_distance for p in self.players])
        caught = self.tree.rules.catch
        near = (far < caught) & (wants < wants[opponent])
        for k in np.flatnonzero(near & ~self._caught).tolist():
            victim, distance = self.names[opponent[k]], float(far[k])
            self._tell(Caught(self.frame, self.names[k], victim=victim, distance=distance))
        self._caught = near | (self._caught & (far < FREE * caught))

    def pass_check_points(self) -> None:
        """Who has come to a check point, or has missed one, is told."""
        seconds = self.frame / self.fps
        for k, progress in enumerate(self.progress):
            if progress is None or progress.done:
                continue
            place = self.cast.root_position[k]
            if _is_shared(progress):
                place = 0.5 * (place + self.cast.root_position[self.floor.opponent[k]])
            reached = progress.update((float(place[0]), float(place[2])), seconds, self._done[k])
            self._done[k] = set()
            if reached is not None:
                self._tell(
                    CheckPointReached(
                        self.frame,
                        self.names[k],
                        point=reached.index,
                        late_by=reached.late_by,
                        distance=reached.distance,
                    )
                )
            for m in progress.missed(seconds):
                if m.index < self._told[k]:
                    continue
                self._tell(
                    CheckPointMissed(
                        self.frame, self.names[k], point=m.index, due=m.due, distance=m.distance
                    )
                )
                self._told[k] = m.index + 1


def _is_shared(progress: Progress) -> bool:
    """Whether a route's check point of now is for the middle between a fighter and its opponent."""
    points = progress.route.points
    return points[min(progress.index, len(points) - 1)].middle
