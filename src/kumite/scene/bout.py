"""A fight by game tree: each fighter looks ahead whenever its action has ended (Shum et al. 2012).

Everything that is decided on may change between two decisions (B12). A blow that lands cuts its
victim's action short; what follows is said by :mod:`kumite.scene.reactions`.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import Any

import numpy as np

from kumite.body import ARMS
from kumite.clip import LIMBS
from kumite.control import Progress, Route, style
from kumite.control.avoidance import Avoidance, AvoidanceSearch, Outcome
from kumite.control.avoider import Avoider, Threat
from kumite.control.conductor import Conductor
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
from kumite.control.protocol import Controller, View
from kumite.errors import KumiteError, unknown
from kumite.graph import Layer, Library
from kumite.graph.spans import Spans, nearest
from kumite.kernels.blow import NO_BLOW, NOBODY
from kumite.kernels.moves import FALL, NOTHING
from kumite.rotation import planar_compose
from kumite.scene import events
from kumite.scene.apart import push_apart
from kumite.scene.controls import (
    ORDERS,
    OrderControl,
    StyleControl,
    check_orders,
    style_controls,
)
from kumite.scene.dodgers import searched, volume_of
from kumite.scene.doors import check_scene
from kumite.scene.events import (
    Caught,
    CheckPointMissed,
    CheckPointReached,
    Cue,
    Event,
    Hit,
    RunOver,
)
from kumite.scene.floor import Floor, Landing
from kumite.scene.reactions import MOST_PHYSICAL, Reactions
from kumite.scene.settings import SceneSettings
from kumite.scene.settings_base import ARENA, NEAREST
from kumite.scene.settings_dodge import BallsSettings, DodgeSettings
from kumite.scene.settings_fight import CHANGES, BoutSettings, CueSettings
from kumite.scene.stage import SceneObject
from kumite.scene.starts import draw_starts, stream
from kumite.scene.story import Story
from kumite.scene.throwing import Throwing

NEAR = 6.0  # m within which others are minded
FREE = 1.5  # times the distance of a catch: so far one has got away
GOALS = 25  # places ahead of which a fighter knows: 6 s


class BoutScene:
    """A fight that runs, one frame at a step. The same seed gives the same frames.

    Follows the :class:`~kumite.scene.stage.Stage` protocol, so the studio can show it.
    """

    def __init__(self, settings: SceneSettings, library: Library | Layer, *, seed: int = 0) -> None:
        """Errors: a library whose graph is not one of whole actions; names in A⁺, A⁻ or at check
        points that no action has.
        """
        layers = library
        library = check_scene(settings, library, seed, "actions")
        if not settings.fighters:
            raise KumiteError(f"{settings.title!r} is no fight by game tree; expected [[fighter]]s")
        self.settings = settings
        self.library = library
        self.title = settings.title
        self.fps = library.clips.fps
        self.skeleton = library.clips.skeleton
        self.names = settings.names
        self.bout = settings.bout or BoutSettings()
        self.tree = GameTree(library, self.bout.rules())
        self.reactions = Reactions(self.tree, len(self.names), self.bout.reactions)
        self.players = [f.player() for f in settings.fighters]
        self.routes = [f.route() for f in settings.fighters]
        self._kept: dict[tuple[int, str], Any] = {}  # of players, what cues have changed
        for name, player, route in zip(self.names, self.players, self.routes):
            check_orders(name, self.tree, player, route)
        for cue in settings.cue:
            orders = Player(
                wanted=cue.wanted or (), unwanted=cue.unwanted or (), only=cue.only or ()
            )
            check_orders(f"cue of {cue.who}", self.tree, orders, cue.route())
        self.spans, self._throwing = Spans.of(Library.of(library), ("actions",)), None
        self._avoiders: dict[int, Avoider] = {}
        if settings.avoiding:
            self._equip(layers)
        self.controllers: list[list[Controller]] = [
            [self._avoiders[k] if c == "avoid" else TreeFighter(self) for c in f.controllers]
            for k, f in enumerate(settings.fighters)
        ]
        self._edge: list[SceneObject] = []
        if self.bout.arena is not None:
            self._edge.append(SceneObject(ARENA, np.zeros(3), self.bout.arena, line=True))
        self.reset(seed)

    def _equip(self, library: Library | Layer) -> None:
        """Let those who avoid see what is thrown. Errors: a library without avoidance."""
        if isinstance(library, Layer):
            raise KumiteError(
                f"{self.title!r} needs the layers actions and avoidance; expected a library that "
                "has both, not one of its layers"
            )
        avoidance = library.layer("avoidance")
        self.spans = Spans.of(library, ("actions", "avoidance"))
        calm = np.flatnonzero(np.isin(self.tree.kinds, CALM))
        self._like, away = nearest(self.library, calm)
        dodge = self.settings.dodge or DodgeSettings()
        search = AvoidanceSearch(avoidance, dodge.search(), spheres=volume_of(dodge, self.skeleton))
        _ = search.masks, search.index  # made now, not at the first throw
        for k, name in enumerate(self.names):
            if name in self.settings.avoiding:
                self._avoiders[k] = Avoider(
                    search,
                    away,
                    self.library.strikes,
                    lambda found, threat, k=k: self._tell_search(k, found, threat),
                )

    @property
    def controls(self) -> list[StyleControl]:
        """Numbers that may be tuned while the fight runs."""
        return [c for k in range(len(self.names)) for c in self.controls_of(k)]

    def controls_of(self, k: int) -> list[StyleControl]:
        """Numbers of one fighter."""
        return style_controls(self.names[k], self.players[k])

    def orders_of(self, k: int) -> list[OrderControl]:
        """What one fighter is told of actions: A⁺, A⁻ and the action set."""
        return [
            OrderControl(self.names[k], f, self.players[k], self.tree, self.routes[k])
            for f in ORDERS
        ]

    def set_route(self, name: str, route: Route | None) -> None:
        """Send a fighter along check points, in place of any it had; its times count from now.
        None: along none. Errors: nobody is called so; wrong actions at a check point.
        """
        k = self._number(name)
        check_orders(name, self.tree, self.players[k], route)
        self.routes[k] = route
        self.progress[k] = None if route is None else Progress(route.later(self.frame / self.fps))
        self._told[k] = 0
        self._done[k] = set()

    def move_check_point(self, name: str, index: int, place: tuple[float, float]) -> None:
        """Put a check point of a fighter's route elsewhere (x, z) m. Errors: there is none such."""
        k = self._number(name)
        route, progress = self.routes[k], self.progress[k]
        if route is None or progress is None:
            raise KumiteError(f"{name} has no route; expected a check point of one")
        self.routes[k] = route.moved(index, place)
        progress.move(index, place)

    def _number(self, name: str) -> int:
        if name not in self.names:
            raise unknown("fighter", name, self.names)
        return self.names.index(name)

    def reset(self, seed: int) -> None:
        """Start again from the beginning, with a seed."""
        self.seed = int(seed)
        self.frame = 0
        self.events: list[Event] = []
        self.story = Story(self.settings.cue, self.settings.vehicle, self.fps)
        self.decisions: list[Decision] = []
        count = len(self.names)
        streams = [stream(self.seed, k) for k in range(count)]
        self.floor = Floor(self.library, count, (self.spans.first, self.spans.last))
        self.cast = cast = self.floor.cast
        table = self.library.table
        number = {name: k for k, name in enumerate(self.names)}
        self.floor.opponent[:] = [number.get(f.against, NOBODY) for f in self.settings.fighters]
        # Everyone starts where idling or moving about has ended, with many ways out.
        calm = np.isin(self.tree.kinds, CALM)
        ways = np.diff(table.action_start)[table.target] * calm
        common = np.flatnonzero(ways >= max(np.quantile(ways[calm], 0.5), 1))
        self.stretch, begins = draw_starts(self.library, common, streams, at_ends=True)
        self._recent = [deque(maxlen=MEMORY) for _ in range(count)]
        for (k, field), kept in self._kept.items():
            setattr(self.players[k], field, kept)
        self._kept = {}
        self.progress = [None if r is None else Progress(r) for r in self.routes]
        self._done: list[set[str]] = [set() for _ in range(count)]
        self._told = [0] * count  # check points before this one have been told if missed
        self._elsewhere = np.zeros(count, dtype=bool)  # in a span of another layer than its stretch
        self._caught = np.zeros(count, dtype=bool)
        self._landed = [NO_BLOW] * count  # the blow each has landed last in what it is doing
        bout = self.bout
        spread = np.array([bout.scatter, bout.scatter, np.radians(bout.scatter_deg)])
        for k, f in enumerate(self.settings.fighters):
            moved = streams[k].uniform(-1.0, 1.0, 3) * spread
            facing = np.array([*f.position, np.radians(f.yaw_deg)]) + moved
            state = int(table.target[self.stretch[k]])
            cast.place(k, state, facing, frame=int(begins[k]))
        self.floor.start()
        self._nearest = self.floor.opponent == NOBODY
        for k in np.flatnonzero(self._nearest).tolist():
            self._turn_to_nearest(k)
        self.reactions.start(self.floor)
        self.conductor = Conductor(
            cast,
            self.spans,
            self.names,
            self.floor.opponent,
            self.controllers,
            begin=self._take,
            free=self._free,
            chooses=lambda k: not self._lies(k),
        )
        self.conductor.start()
        if self._avoiders:
            self._throwing = Throwing(
                self.settings.balls or BallsSettings(),
                cast,
                self.floor.body,
                next(iter(self._avoiders.values())).search.spheres,
                self.seed,
                sorted(self._avoiders),
                self.names,
                lambda k, attack, number, ball: self._avoiders[k].mind(attack, number, ball),
                self._forget,
                self.events.append,
            )

    @property
    def objects(self) -> list[SceneObject]:
        balls = [] if self._throwing is None else self._throwing.balls.objects
        return self.story.objects + self._edge + balls

    @property
    def root_position(self) -> np.ndarray:
        return self.cast.root_position

    @property
    def wxyz(self) -> np.ndarray:
        return self.cast.wxyz

    def move_object(self, name: str, position: np.ndarray) -> None:
        """There are no objects in a fight."""

    def step(self) -> bool:
        """One frame: who has ended an action looks ahead and chooses, all move on."""
        self.story.step(self, self.frame / self.fps)
        if self._throwing is not None:
            self._throwing.due(self.frame)
        self.conductor.step(self.frame)
        happened = self.reactions.advance()
        if len(self.names) <= MOST_PHYSICAL:  # among many trunks are kept apart, limbs are not
            push_apart(self.floor)
        self.frame += 1
        if self._throwing is not None:
            self._throwing.step(self.frame)
        self._pass_check_points()
        if self.bout.catch:
            self._catch()
        if happened:
            for k, s, blow in self.floor.thrown:
                strikes = self.library.strikes
                self.events.append(events.strike(self.frame, self.names[k], s, blow, strikes))
            for landing in self.floor.landings:
                self._land(landing)
        return True

    def _is_to_fall(self, k: int) -> bool:
        """Whether a fall is asked of character k: then any blow fells it."""
        player = self._player(k)
        fall = self.tree.response[:, FALL]
        return bool(player.wanted and np.any(self.tree.asked(player)[fall[fall != NOTHING]] > 0))

    def _lies(self, k: int) -> bool:
        """Whether character k has been knocked down for good."""
        fighter, stretch = self.settings.fighters[k], self.stretch[k]
        return fighter.stays_down and self.tree.labels[stretch] == "fall"

    # Deciding ------------------------------------------------------------------------------------

    def _free(self, k: int) -> bool:
        """Whether character k may break off what it does."""
        reacts = not self._elsewhere[k] and self.tree.kinds[self.stretch[k]] == "reaction"
        return not (self.cast.held[k] or self._lies(k) or reacts)

    def _take(self, k: int, span: int, controller: Controller) -> None:
        """Character k begins a span that one of its controllers has chosen."""
        self._begin(k, span)
        if isinstance(controller, TreeFighter):
            return  # it has told more of it
        layer, stretch = self.spans.stretch(span)
        self.events.append(
            events.Decision(
                self.frame,
                self.names[k],
                by=controller.name,
                stretch=stretch,
                action=self.tree.labels[stretch] if layer == "actions" else "",
                jump=bool(self.cast.jump[k]),
            )
        )

    def choose_by_tree(self, k: int) -> int:
        """What character k does next, as its game tree says: a stretch."""
        if self._nearest[k]:
            self._turn_to_nearest(k)
        cast, table, o = self.cast, self.library.table, int(self.floor.opponent[k])
        reached = cast.reached
        facing = cast.facing_at(reached)
        pair = (k, o)
        for p in pair:
            if self._elsewhere[p]:
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
        self.events.append(
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

    def _turn_to_nearest(self, k: int) -> None:
        """Character k minds the nearest of those who are after it, or of all."""
        place = self.cast.root_position[:, [0, 2]]
        far = np.linalg.norm(place - place[k], axis=1)
        after = self.floor.opponent == k
        far[~after if after.any() else np.arange(len(far)) == k] = np.inf
        self.floor.opponent[k] = int(np.argmin(far))

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
        if self._lies(int(self.floor.opponent[k])):  # it is over
            return replace(player, only=("idle",) if "idle" in self.tree.choices else ())
        if progress is None:
            return player
        goal = progress.ahead(self.frame / self.fps, GOAL_EVERY, GOALS)
        return replace(
            player,
            goal=goal + self._beside(k) if _is_shared(progress) else goal,
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

    def _begin(self, k: int, span: int) -> None:
        """Character k begins a span now, whatever it does."""
        chosen = np.full(len(self.names), span)
        self.cast.begin(np.array([k]), chosen)
        layer, stretch = self.spans.stretch(span)
        if layer == "actions":
            self._does(k, stretch)
            return
        self._elsewhere[k] = True
        self.stretch[k] = self._like[self.spans.last[span]]  # it goes on as after that
        self._landed[k] = NO_BLOW

    def _does(self, k: int, stretch: int) -> None:
        """Character k is in a stretch from now on."""
        self.stretch[k], self._elsewhere[k] = stretch, False
        self._landed[k] = NO_BLOW
        self._done[k] |= {self.tree.kinds[stretch], self.tree.labels[stretch]}

    # Bodies --------------------------------------------------------------------------------------

    def _land(self, landing: Landing) -> None:
        """A blow has landed: say so, and react to it."""
        part = self.floor.body.parts[landing.part]
        blocked = part in ARMS
        self._landed[landing.who] = landing.blow
        self.events.append(
            Hit(
                self.frame,
                self.names[landing.who],
                victim=self.names[landing.victim],
                limb=LIMBS[landing.limb],
                part=part,
                speed=float(np.linalg.norm(landing.velocity)),
                place=events.place(landing.place),
                time=(self.frame - 1 + landing.share) / self.fps,
                blocked=blocked,
                blow=landing.blow,
            )
        )
        if self._lies(landing.victim):
            return
        reaction = self.reactions.react(landing, blocked, self._is_to_fall(landing.victim))
        if reaction is None:
            return
        begin = self._does if reaction.begun else self._begin
        begin(landing.victim, reaction.stretch)
        self.conductor.interrupt(landing.victim)
        self.events.append(reaction.told(self.frame, self.names[landing.victim]))

    def _forget(self, number: int) -> None:
        """What was thrown is over."""
        for avoider in self._avoiders.values():
            avoider.forget(number)

    def _tell_search(self, k: int, found: Avoidance, threat: Threat) -> None:
        if found.outcome == Outcome.FOUND and self._throwing is not None:
            self._throwing.found(threat.number)
        self.events.append(
            searched(self.frame, self.names[k], found, threat.number, ball=threat.name)
        )

    # The story -----------------------------------------------------------------------------------

    def take_cue(self, cue: CueSettings) -> None:
        """Somebody fights otherwise from their next decision on."""
        k = self.names.index(cue.who)
        if cue.against is not None:
            self._nearest[k] = cue.against == NEAREST
            if not self._nearest[k]:
                self.floor.opponent[k] = self.names.index(cue.against)
        for field in ("style", "depth", "wanted", "unwanted", "only"):
            told = getattr(cue, field)
            if told is not None:
                self._kept.setdefault((k, field), getattr(self.players[k], field))
                setattr(self.players[k], field, style(told) if field == "style" else told)
        route = cue.route()
        if route is not None:
            self.progress[k], self._told[k] = Progress(route), 0
        changes = {name: getattr(cue, name) for name in CHANGES if name != "point"}
        self.events.append(Cue(self.frame, cue.who, **changes))

    def run_over(self, k: int, by: str, speed: float) -> None:
        """Character k falls, struck by a vehicle."""
        self.events.append(RunOver(self.frame, self.names[k], vehicle=by, speed=speed))
        fall = int(self.tree.response[0, FALL])
        if fall != NOTHING and not self._lies(k):
            self.reactions.forget(k)
            self._begin(k, fall)
            self.conductor.interrupt(k)

    def drag(self, k: int, way: np.ndarray) -> None:
        """Character k is moved over the ground by way [2] m, feet and all."""
        self.cast.anchor[k, :2] += way

    def _catch(self) -> None:
        """Tell whom somebody has come so near that it counts; again after it has got away."""
        place, opponent = self.cast.root_position[:, [0, 2]], self.floor.opponent
        far = np.linalg.norm(place - place[opponent], axis=1)
        wants = np.array([p.style.preferred_distance for p in self.players])
        near = (far < self.bout.catch) & (wants < wants[opponent])
        for k in np.flatnonzero(near & ~self._caught).tolist():
            victim, distance = self.names[opponent[k]], float(far[k])
            self.events.append(Caught(self.frame, self.names[k], victim=victim, distance=distance))
        self._caught = near | (self._caught & (far < FREE * self.bout.catch))

    # Check points --------------------------------------------------------------------------------

    def _pass_check_points(self) -> None:
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
                self.events.append(
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
                self.events.append(
                    CheckPointMissed(
                        self.frame, self.names[k], point=m.index, due=m.due, distance=m.distance
                    )
                )
                self._told[k] = m.index + 1


class TreeFighter:
    """The controller of a fighter that looks ahead by game tree. It always has something to do."""

    name = "tree"
    watches = False  # it sees what it needs when it chooses

    def __init__(self, scene: BoutScene) -> None:
        self._scene = scene

    def start(self) -> None:
        """Nothing is kept from before."""

    def watch(self, view: View) -> int | None:
        return None

    def choose(self, view: View) -> int:
        return self._scene.choose_by_tree(view.me)

    def rate(self, view: View) -> float:
        return 1.0

    def interrupted(self, view: View) -> None:
        """It looks ahead anew whenever an action has ended."""


def _is_shared(progress: Progress) -> bool:
    """Whether a route's check point of now is for the middle between a fighter and its opponent."""
    points = progress.route.points
    return points[min(progress.index, len(points) - 1)].middle
