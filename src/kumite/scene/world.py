"""The world: characters of one library, what decides for each, things, blows and what they do.

Each character has controllers, in order of priority (:mod:`kumite.control.protocol`); the first
that has something to say is heard. Nothing else knows which of them decided.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kumite.body import ARMS
from kumite.clip import LIMBS
from kumite.control import Behaviour, Progress, Route
from kumite.control.conductor import Conductor, ControllerError
from kumite.control.engage import Engage
from kumite.control.game_tree import CALM, Decision, GameTree
from kumite.control.protocol import SELF, Controller, External, View
from kumite.control.roamer import Roamer
from kumite.control.tuning import Tunable, find
from kumite.errors import KumiteError, unknown
from kumite.graph import Layer, Library
from kumite.graph.spans import Spans, nearest
from kumite.kernels.blow import NOBODY
from kumite.kernels.moves import FALL, NOTHING
from kumite.scene import events
from kumite.scene.apart import push_apart
from kumite.scene.avoiding import search_of
from kumite.scene.controls import (
    OrderControl,
    rule_tunables,
    tree_tunables,
)
from kumite.scene.doors import check_scene, check_settings
from kumite.scene.events import Cue, Event, Hit, RunOver
from kumite.scene.fire import Fire
from kumite.scene.floor import Floor, Landing
from kumite.scene.hanging import Hanging
from kumite.scene.leading import Walks
from kumite.scene.memory import refuse_too_many
from kumite.scene.needs import wanted_layers
from kumite.scene.pairs import pair_up
from kumite.scene.policy_fighter import PolicyFighter
from kumite.scene.preparer import Preparer
from kumite.scene.reactions import MOST_PHYSICAL, Reactions
from kumite.scene.settings import SceneSettings
from kumite.scene.settings_base import ARENA, NEAREST
from kumite.scene.settings_dodge import BallsSettings, DodgeSettings
from kumite.scene.settings_fight import CHANGES, BoutSettings, CueSettings
from kumite.scene.stage import Offers, SceneObject
from kumite.scene.starts import draw_starts, stream
from kumite.scene.story import Story
from kumite.scene.tree_fighter import TreeFighter
from kumite.synthesis.recoil import RECOIL

REPAIRING = 1.0  # s after which those who aim at the nearest look round again


@dataclass(frozen=True)
class Character:
    """One of a world's characters: where it is, and what decides for it."""

    world: World
    number: int

    @property
    def name(self) -> str:
        return self.world.names[self.number]

    @property
    def controllers(self) -> list[Controller]:
        """In order of priority; the list may be changed between two steps."""
        return self.world.controllers[self.number]

    @property
    def place(self) -> np.ndarray:
        """Where it is on the floor, and the way it faces [3]: m, m, rad."""
        return self.world.cast.facing[self.number]

    @property
    def opponent(self) -> str | None:
        """Whom it minds now."""
        k = int(self.world.floor.opponent[self.number])
        return None if k == NOBODY else self.world.names[k]


class World:
    """A scene that runs, one frame at a step. The same seed gives the same frames.

    Follows the :class:`~kumite.scene.stage.Stage` protocol, so the studio can show it.
    """

    def __init__(
        self,
        settings: SceneSettings,
        library: Library | Layer,
        *,
        seed: int = 0,
        cache: Path | None = None,
        behaviours: Mapping[str, Behaviour] | None = None,
        progress: Callable[[str, int, float], None] = lambda name, sweep, residual: None,
    ) -> None:
        """library: with every layer that the characters' controllers plan on; one layer, where that
        is enough. cache: of trained policies. behaviours: a user's own by name, besides those of
        :data:`kumite.control.BEHAVIOURS`. progress: is told how training goes.

        Errors: a layer that the library lacks; a library that nobody can strike with; names of
        actions, of orders or at check points, that it does not have; an unknown behaviour; too many
        characters.
        """
        check_settings(settings)
        many = (settings.crowd, settings.dodgers)
        several = sum(m.count for m in many if m is not None)
        joints = getattr(getattr(library, "clips", None), "skeleton", ())
        refuse_too_many(
            len(settings.character) + len(settings.dodger) + several, max(len(joints), 1)
        )
        wanted = wanted_layers(settings, getattr(library, "layers", ("frames",)))
        self.library = check_scene(settings, library, seed, *wanted[:1])
        if not settings.people:
            raise KumiteError(
                f"{settings.title!r} has nobody in it; expected [[character]]s or [[fighter]]s"
            )
        self.settings, self.title = settings, settings.title
        self.fps, self.skeleton = self.library.clips.fps, self.library.clips.skeleton
        people = settings.people
        self.names = tuple(p.name for p in people)
        if isinstance(library, Layer):
            if len(wanted) > 1:
                raise KumiteError(
                    f"{self.title!r} needs the layers {' and '.join(wanted)}; expected a library "
                    "that has all of them, not one of its layers"
                )
            every, wanted = Library.of(library), (library.name,)
        else:
            every = library
        self.spans = Spans.of(every, wanted)
        self.bout = settings.bout or BoutSettings()
        self._reactions: Reactions | None = None
        self.fight: TreeFighter | None = None  # of those who fight by game tree
        self.policy: PolicyFighter | None = None  # of those who fight by policies
        self._preparer: Preparer | None = None  # of those who prepare
        self._fire: Fire | None = None  # what is thrown, and who avoids it
        self._roamer: Roamer | None = None  # of those who only move about
        if any(p.by_tree for p in people):
            self.fight = TreeFighter(
                every.layer("actions"),
                self.spans,
                self.names,
                [p.player for p in people],
                [p.route for p in people],
                self.bout,
                self._turn_to_nearest,
            )
            for cue in settings.cue:
                self.fight.check_cue(cue)
            self._reactions = Reactions(self.fight.tree, len(self.names), self.bout.reactions)
        if any(p.by_policy for p in people):
            layer = every.layer(next(n for n in wanted if n != "avoidance"))
            self.policy = PolicyFighter(
                layer,
                self.spans,
                [p.temper for p in people],
                cache=cache,
                behaviours=behaviours,
                progress=progress,
            )
        if "avoidance" in wanted:
            self._equip(every)
        if settings.preparing:
            self._preparer = Preparer(settings, every, cache=cache)
        self._layers = {name: every.layer(name) for name in wanted}
        self.controllers: list[list[Controller]] = [
            [self._controller(k, name) for name in p.controllers] for k, p in enumerate(people)
        ]
        self._edge: list[SceneObject] = []
        if self.bout.arena is not None:
            self._edge.append(SceneObject(ARENA, np.zeros(3), self.bout.arena, line=True))
        self.reset(seed)
        if self._fire is not None:
            self._fire.search_once()

    def _controller(self, k: int, name: str) -> Controller:
        """What a scene file calls a controller, for character k."""
        if name == "avoid":
            return self.fire.avoiders[k]
        if name == "roam":
            assert self._roamer is not None
            return self._roamer
        if name == "external":
            return External()
        person = self.settings.people[k]
        if name == "prepare":
            assert self._preparer is not None
            return self._preparer
        found = self.fight if person.by_tree else self.policy
        assert found is not None
        last = person.controllers[-1] == name
        return found if last else Engage(found, person.engage, self._lies)

    def _equip(self, library: Library) -> None:
        """Let those who avoid see what is thrown, and those who roam know where they belong."""
        layer, people = library.layer("avoidance"), self.settings.people
        homes = np.array([[*p.position, np.radians(p.yaw_deg)] for p in people])
        dodge = self.settings.dodge or DodgeSettings()
        self._roamer = Roamer(layer, homes, watched=self._watched, distance=dodge.distance)
        away = None  # an avoidance is played to its end where nobody plans on another layer
        if self.library is not layer:
            calm = None
            if self.fight is not None:
                calm = np.flatnonzero(np.isin(self.fight.tree.kinds, CALM))
            _, away = nearest(self.library, calm)
        self._fire = Fire(
            self.names,
            {k: p.reaction for k, p in enumerate(people) if "avoid" in p.controllers},
            search_of(layer, dodge),
            self.settings.balls or BallsSettings(),
            away=away,
            searches=dodge.searches,
        )

    def _watched(self, k: int) -> np.ndarray | None:
        """Where the opponent of character k is [2] m."""
        o = int(self.floor.opponent[k])
        return None if o == NOBODY else self.cast.root_position[o, [0, 2]]

    def reset(self, seed: int) -> None:
        """Start again from the beginning, with a seed."""
        self.seed = int(seed)
        self.frame = 0
        self.error: ControllerError | None = None
        self.events: list[Event] = []
        people, count = self.settings.people, len(self.names)
        self.story = Story(self.settings.cue, self.settings.vehicle, self.fps)
        self.hanging = Hanging(self.settings.object)
        self.floor = Floor(self.library, count, (self.spans.first, self.spans.last))
        number = {p.name: k for k, p in enumerate(people)}
        things = [o.name for o in self.settings.object]
        self.thing = np.full(count, NOBODY, dtype=np.int64)  # what each strikes at, if no opponent
        for k, p in enumerate(people):
            self.floor.opponent[k] = number.get(p.against or "", NOBODY)
            if p.against in things:
                self.thing[k] = things.index(p.against)
        stretch = self._place()
        self.floor.start()
        self._nearest = np.array([p.against == NEAREST for p in people])
        for k in np.flatnonzero(self._nearest).tolist():
            if people[k].by_tree:
                self._turn_to_nearest(k)
        if self.fight is not None:
            self.reactions.start(self.floor)
            self.fight.begin(self.floor, stretch, self.reactions, self.events.append)
        if self.policy is not None:
            self._aim()
            self.policy.begin(self.floor, self.hanging.seen, self.thing, self.seed)
        if self._preparer is not None:
            self._preparer.begin(self.floor, self.seed, self.events)
        self._conductor = Conductor(
            self.cast,
            self.spans,
            self.names,
            self.floor.opponent,
            self.controllers,
            begin=self._begin,
            free=self._is_free,
            chooses=lambda k: not (self._lies(k) or self._poses_itself(k)),
            begin_many=self._begin_many,
        )
        alone = self.fight is None and self.policy is None
        self._conductor.start(self.seed, self._begun_in.tolist() if alone else None)
        self._posed_by = [0] * count  # the number of the controller that poses each, if one does
        if self._fire is not None:
            self._fire.begin(self.floor, self.seed, self.events.append)

    def _place(self) -> np.ndarray:
        """Everyone where it begins; the stretches [K] of the actions' layer after which they stand,
        -1 of none."""
        people, table = self.settings.people, self.library.table
        homes = np.array([[*p.position, np.radians(p.yaw_deg)] for p in people])
        streams = [stream(self.seed, k) for k in range(len(people))]
        at_ends = self.fight is not None
        if self.fight is not None:
            common = self.fight.common
        elif self._roamer is not None and self.library is self._roamer.library:
            common = self._roamer.restful()
        else:  # on the way to a state with many ways out: the usual guard, not a blow's end
            ways = np.diff(table.action_start)
            common = np.flatnonzero(ways[table.target] >= np.quantile(ways, 0.75))
        stretch, begins = draw_starts(self.library, common, streams, at_ends=at_ends)
        bout = self.bout
        if bout.scatter or bout.scatter_deg:
            spread = np.array([bout.scatter, bout.scatter, np.radians(bout.scatter_deg)])
            homes += spread * np.array([rng.uniform(-1.0, 1.0, 3) for rng in streams])
        for k, home in enumerate(homes):
            self.cast.place(k, int(table.target[stretch[k]]), home, frame=int(begins[k]))
        self._begun_in = stretch
        return stretch if at_ends else np.full(len(people), -1)

    # What is shown -------------------------------------------------------------------------------

    @property
    def cast(self):
        return self.floor.cast

    @property
    def root_position(self) -> np.ndarray:
        return self.cast.root_position

    @property
    def wxyz(self) -> np.ndarray:
        return self.cast.wxyz

    @property
    def objects(self) -> list[SceneObject]:
        balls = [] if self._fire is None else self._fire.balls.objects
        things = [] if self._preparer is None else self._preparer.scene.objects
        return self.hanging.objects + things + self.story.objects + self._edge + balls

    def move_object(self, name: str, position: np.ndarray) -> None:
        """Hang a thing elsewhere: seen from the next decision on. What moves by itself stays.

        Errors: a place that is not three finite numbers.
        """
        self.hanging.move(name, position)
        if self._preparer is not None:
            self._preparer.scene.move_object(name, position)

    def character(self, name: str) -> Character:
        """A character by name. Errors: there is none of that name."""
        return Character(self, self._number(name))

    def _number(self, name: str) -> int:
        if name not in self.names:
            raise unknown("character", name, self.names)
        return self.names.index(name)

    # What may be told while it runs --------------------------------------------------------------

    @property
    def tunables(self) -> list[Tunable]:
        """Numbers that may be tuned while the world runs, of every controller and of the world."""
        out: list[Tunable] = []
        if self.fight is not None:
            for k in self.directed:
                out += tree_tunables(self.names[k], self.fight.players[k], self.fight.tree)
        if self.policy is not None:
            out += self.policy.tunables(self.names)
        if self._fire is not None:
            out += self._fire.tunables
        if self._preparer is not None:
            out += self._preparer.scene.tunables
        return out if self.fight is None else [*out, *rule_tunables(self.fight.tree)]

    def tunable(self, name: str) -> Tunable:
        """One of them by name, ``red: tree: depth``. Errors: there is none such."""
        return find(self.tunables, name)

    @property
    def directed(self) -> tuple[int, ...]:
        """Who fights by game tree, and may be sent along check points."""
        people = self.settings.people
        return tuple(k for k, p in enumerate(people) if self.fight is not None and p.by_tree)

    @property
    def offers(self) -> Offers:
        """What may be done with it while it runs."""
        preparer, fire = self._preparer, self._fire
        fights = self.fight is not None or self.policy is not None
        return Offers(
            directed=self if self.directed else None,
            throwing=fire,
            avoiding=None if fire is None else fire.volumes,
            led=None if preparer is None else Walks(preparer.scene, preparer.who),
            tunables=tuple(self.tunables),
            counts=(
                *(("blows",) if fights else ()),
                *(("balls",) if fire is not None else ()),
                *(("errands",) if preparer is not None else ()),
            ),
            seen="beside" if fights else "before" if fire is not None else "behind",
            yaw=float(self.cast.facing[0, 2]),
        )

    @property
    def fire(self) -> Fire:
        """What is thrown, and those who avoid it. Errors: nobody avoids anything."""
        if self._fire is None:
            raise KumiteError(f"nobody avoids anything in {self.title!r}")
        return self._fire

    def orders_of(self, k: int) -> list[OrderControl]:
        """What one who fights by game tree is told of actions: A⁺, A⁻ and the action set."""
        if self.fight is None or not self.settings.people[k].by_tree:
            return []
        return self.fight.orders_of(k)

    def set_route(self, name: str, route: Route | None) -> None:
        """Send a fighter along check points, in place of any it had; its times count from now.
        None: along none. Errors: nobody is called so, or it does not fight by game tree; wrong
        actions at a check point.
        """
        fight, k = self._by_tree(name)
        fight.frame = self.frame
        fight.set_route(k, route)

    def move_check_point(self, name: str, index: int, place: tuple[float, float]) -> None:
        """Put a check point of a fighter's route elsewhere (x, z) m. Errors: there is none such."""
        fight, k = self._by_tree(name)
        fight.move_check_point(k, index, place)

    def _by_tree(self, name: str) -> tuple[TreeFighter, int]:
        k = self._number(name)
        if self.fight is None or not self.settings.people[k].by_tree:
            raise KumiteError(f"{name} does not fight by game tree; expected somebody who does")
        return self.fight, k

    @property
    def tree(self) -> GameTree:
        """What fighters look ahead in. Errors: nobody fights by game tree."""
        return self.tree_fighter.tree

    @property
    def tree_fighter(self) -> TreeFighter:
        """The controller of all who fight by game tree. Errors: nobody does."""
        if self.fight is None:
            raise KumiteError(f"nobody fights by game tree in {self.title!r}")
        return self.fight

    @property
    def policy_fighter(self) -> PolicyFighter:
        """The controller of all who fight by policies. Errors: nobody does."""
        if self.policy is None:
            raise KumiteError(f"nobody fights by policies in {self.title!r}")
        return self.policy

    @property
    def reactions(self) -> Reactions:
        """What blows do to fighters. Errors: nobody fights by game tree, so bodies only give."""
        if self._reactions is None:
            raise KumiteError(f"nobody in {self.title!r} has captured reactions")
        return self._reactions

    @property
    def players(self):
        """How each plays [K], those that others decide for as fighters take them to."""
        return self.tree_fighter.players

    @property
    def routes(self) -> list[Route | None]:
        """Along which each is sent [K]."""
        return [None] * len(self.names) if self.fight is None else self.fight.routes

    @property
    def progress(self) -> list[Progress | None]:
        """How far each is along its route [K]."""
        return [None] * len(self.names) if self.fight is None else self.fight.progress

    @property
    def decisions(self) -> list[Decision]:
        """Of all fighters by game tree, oldest first."""
        return [] if self.fight is None else self.fight.decisions

    # A frame -------------------------------------------------------------------------------------

    def step(self, choices: Mapping[str, int] | None = None) -> bool:
        """One frame: who has ended an action chooses, all move on, what meets is told.

        choices: spans (:attr:`spans`) by name, of characters who wait (:attr:`waiting`); they come
        before those of all controllers.

        Errors: a controller fails, or chooses what there is not; a choice for nobody, or for
        somebody who does not wait. From a failed controller on the world goes no further.
        """
        if self.error is not None:
            raise self.error
        self.story.step(self, self.frame / self.fps)
        if self._fire is not None:
            self._fire.due(self.frame)
        self.hanging.look()
        if self.policy is not None and self.frame and self.frame % round(REPAIRING * self.fps) == 0:
            self._aim()
        try:
            self._conductor.step(self.frame, choices)
        except ControllerError as error:
            self.error = error
            raise
        if self._preparer is not None:
            self._preparer.step()
        happened = (self.floor if self._reactions is None else self._reactions).advance()
        if len(self.names) <= MOST_PHYSICAL:  # among many trunks are kept apart, limbs are not
            push_apart(self.floor)
        self.frame += 1
        if self._fire is not None:
            self._fire.step(self.frame)
        if self.fight is not None:
            self.fight.frame = self.frame
            self.fight.pass_check_points()
            if self.fight.tree.rules.catch:
                self.fight.catch()
        if happened:
            strikes = self.library.strikes
            for k, s, blow in self.floor.thrown:
                if self.floor.opponent[k] == self.thing[k] == NOBODY:
                    continue  # arms of who strikes at nobody swing as if they struck
                self.events.append(events.strike(self.frame, self.names[k], s, blow, strikes))
            for landing in self.floor.landings:
                self._land(landing)
        if self.hanging.objects:
            self.hanging.step(self.floor, self.thing, self._hit_thing)
        return True

    def _aim(self) -> None:
        """Whom those who fight by policies aim at: the nearest who is free (or else at all)."""
        people = self.settings.people
        free = [k for k, p in enumerate(people) if p.by_policy and p.against == NEAREST]
        if len(free) == 1 or any(p.team is not None for p in people):
            for k in free:  # the others are named: the nearest of them, whoever they aim at
                self._turn_to_nearest(k, among_all=True)
        elif free:
            ground = self.cast.root_position[:, [0, 2]]
            who, opponent = np.array(free), self.floor.opponent
            opponent[who] = who[pair_up(ground[who], np.searchsorted(who, opponent[who]))]

    def _turn_to_nearest(self, k: int, among_all: bool = False) -> None:
        """Character k, if it is against the nearest, minds the nearest of those who are after it,
        or of all; nobody of its own team."""
        if not self._nearest[k]:
            return
        people, opponent = self.settings.people, self.floor.opponent
        place = self.cast.root_position[:, [0, 2]]
        far = np.linalg.norm(place - place[k], axis=1)
        far[k] = np.inf
        if people[k].team is not None:
            far[[p.team == people[k].team for p in people]] = np.inf
        after = (opponent == k) & np.isfinite(far)
        if after.any() and not among_all:
            far[~after] = np.inf
        if np.isfinite(far).any():
            opponent[k] = int(np.argmin(far))

    # Deciding ------------------------------------------------------------------------------------

    def view(self, k: int) -> View:
        """What the controllers of character k may know now."""
        return self._conductor.view(k)

    @property
    def waiting(self) -> tuple[str, ...]:
        """Who will choose in the next step: their actions have ended."""
        return self._conductor.waiting

    def options(self, name: str) -> np.ndarray:
        """The spans [N] that a character who waits may begin as its library's graphs have it.

        Errors: nobody is called so; it does not wait.
        """
        return self._conductor.options(name, self._layers)

    def _lies(self, k: int) -> bool:
        """Whether character k has been knocked down for good."""
        return self.fight is not None and self.fight.lies(k)

    def _is_free(self, k: int) -> bool:
        """Whether character k may break off what it does."""
        if self._preparer is not None and self._preparer.serves(k):
            return self._preparer.is_free(k)
        reacts = self.fight is not None and self.fight.reacts(k)
        return not (self.cast.held[k] or self._lies(k) or reacts)

    def _poses_itself(self, k: int) -> bool:
        """Whether character k is posed by a controller that nobody has broken off."""
        poses = self._preparer is not None and self._preparer.serves(k)
        return poses and self._conductor.charge[k] == self._posed_by[k]

    def _play(self, k: int, span: int) -> None:
        """Character k begins a span now, whatever it does."""
        if self._preparer is not None and self._preparer.serves(k):
            self._preparer.release(k)
        self.cast.begin(np.array([k]), np.full(len(self.names), span))
        if self.fight is not None:
            self.fight.began(k, span)

    def _begin(self, k: int, span: int, controller: Controller) -> None:
        """Character k begins a span that a controller has chosen."""
        if span == SELF:
            assert self._preparer is not None
            self._preparer.take(k)
            self._posed_by[k] = self._conductor.charge[k]
            if self.fight is not None:
                self.fight.away(k)
            return
        self._play(k, span)
        if controller.name == TreeFighter.name:
            return  # it has told more
        if controller.name == PolicyFighter.name:
            self.events.extend(self.policy_fighter.told(self.frame, np.array([k]), self.names))
            return
        layer, stretch = self.spans.stretch(span)
        label = ""
        if layer == "actions" and self.fight is not None:
            label = self.fight.tree.labels[stretch]
        self.events.append(
            events.Decision(
                self.frame,
                self.names[k],
                by=controller.name,
                stretch=stretch,
                action=label,
                jump=bool(self.cast.jump[k]),
            )
        )

    def _begin_many(self, who: np.ndarray, spans: np.ndarray, controller: Controller) -> None:
        """Characters who [W] begin spans [K] that a controller of all of them has chosen."""
        self.cast.begin(who, spans)
        if self.fight is not None:
            for k in who.tolist():
                self.fight.began(k, int(spans[k]))
        if controller is self.policy:
            self.events.extend(self.policy_fighter.told(self.frame, who, self.names))

    # Bodies --------------------------------------------------------------------------------------

    def _land(self, landing: Landing) -> None:
        """A blow has landed on somebody: say so, and react to it."""
        body, victim = self.floor.body, landing.victim
        part = body.parts[landing.part]
        blocked = part in ARMS
        self._tell_hit(landing, self.names[victim], part, blocked)
        if self.fight is None:
            # Without captured reactions the struck segment gives way.
            joint = int(body.joint[landing.part])
            self.cast.strike(victim, joint, landing.place, RECOIL * landing.velocity)
            return
        self.fight.landed(landing.who, landing.blow)
        if self._lies(victim):
            return
        reaction = self.reactions.react(landing, blocked, self.fight.is_to_fall(victim))
        if reaction is None:
            return
        if reaction.begun:
            if self._preparer is not None and self._preparer.serves(victim):
                self._preparer.release(victim, adopt=False)
            self.fight.does(victim, reaction.stretch)
        else:
            self._play(victim, self.spans.span("actions", reaction.stretch))
        self._conductor.interrupt(victim)
        self.events.append(reaction.told(self.frame, self.names[victim]))

    def _hit_thing(self, landing: Landing) -> None:
        """A blow has landed on a thing that hangs."""
        name = self.hanging.objects[landing.victim].name
        self._tell_hit(landing, name, name, False)

    def _tell_hit(self, landing: Landing, victim: str, part: str, blocked: bool) -> None:
        self.events.append(
            Hit(
                self.frame,
                self.names[landing.who],
                victim=victim,
                limb=LIMBS[landing.limb],
                part=part,
                speed=float(np.linalg.norm(landing.velocity)),
                place=events.place(landing.place),
                time=(self.frame - 1 + landing.share) / self.fps,
                blocked=blocked,
                blow=landing.blow,
            )
        )

    # The story -----------------------------------------------------------------------------------

    def take_cue(self, cue: CueSettings) -> None:
        """Somebody fights otherwise from their next decision on."""
        k = self.names.index(cue.who)
        if cue.against is not None:
            self._nearest[k] = cue.against == NEAREST
            if not self._nearest[k]:
                self.floor.opponent[k] = self.names.index(cue.against)
        self.tree_fighter.take_cue(k, cue)
        changes = {name: getattr(cue, name) for name in CHANGES if name != "point"}
        self.events.append(Cue(self.frame, cue.who, **changes))

    def run_over(self, k: int, by: str, speed: float) -> None:
        """Character k falls, struck by a vehicle."""
        self.events.append(RunOver(self.frame, self.names[k], vehicle=by, speed=speed))
        if self.fight is None:
            return
        fall = int(self.fight.tree.response[0, FALL])
        if fall != NOTHING and not self._lies(k):
            self.reactions.forget(k)
            self._play(k, self.spans.span("actions", fall))
            self._conductor.interrupt(k)

    def drag(self, k: int, way: np.ndarray) -> None:
        """Character k is moved over the ground by way [2] m, feet and all."""
        self.cast.anchor[k, :2] += way
