"""A fight by game tree: each fighter looks ahead whenever its action has ended (Shum et al. 2012).

Everything that is decided on may change between two decisions (B12). A blow that lands cuts its
victim's action short; the struck segment gives way, and the reaction that the tree expects follows.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from kumite.body import ARMS
from kumite.clip import LIMBS
from kumite.control import Progress, style
from kumite.control.game_tree import GOAL_EVERY, MEMORY, Decision, GameTree, Player
from kumite.errors import KumiteError
from kumite.graph import Library
from kumite.kernels.blow import NO_BLOW
from kumite.kernels.game import FALL, FLINCH, NOTHING, STAGGER
from kumite.scene.fighters import BoutSettings
from kumite.scene.floor import Floor, Landing
from kumite.scene.recording import Event
from kumite.scene.settings import SceneSettings
from kumite.scene.stage import SceneObject
from kumite.scene.story import CueSettings, Story

RECOIL = 0.018  # m that a struck segment gives way per m/s of the blow
GOALS = 25  # places ahead of which a fighter knows: 6 s
SIZES = {FLINCH: "flinch", STAGGER: "stagger", FALL: "fall"}


class StyleControl:
    """A number that a fighter goes by: a control of the studio, used by its next decision."""

    def __init__(self, name: str, field: str, player: Player, least: float, most: float) -> None:
        self.name = name
        self.field = field
        self.player = player
        self.minimum, self.maximum = least, most

    @property
    def value(self) -> float:
        holder = self.player if self.field == "depth" else self.player.style
        return float(getattr(holder, self.field))

    def set(self, value: float) -> None:
        if self.field == "depth":
            self.player.depth = round(value)
        else:
            self.player.style = self.player.style.changed(**{self.field: float(value)})


class BoutScene:
    """A fight that runs, one frame at a step. The same seed gives the same frames.

    Follows the :class:`~kumite.scene.stage.Stage` protocol, so the studio can show it.
    """

    def __init__(self, settings: SceneSettings, library: Library, *, seed: int = 0) -> None:
        """Errors: a library whose graph is not one of whole actions; names in A⁺, A⁻ or at check
        points that no action has.
        """
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
        self.players = [f.player() for f in settings.fighters]
        self._kept: dict[int, dict] = {}  # players as they were before a cue changed them
        self._check_names()
        self.reset(seed)

    def _check_names(self) -> None:
        for player in self.players:
            self.tree.asked(player)
        for cue in self.settings.cue:
            self.tree.asked(Player(wanted=cue.wanted or (), unwanted=cue.unwanted or ()))
        known = self.tree.names
        routed = [(f.name, f.point) for f in self.settings.fighters]
        routed += [(c.who, c.point or ()) for c in self.settings.cue]
        for name, points in routed:
            for point in points:
                unknown = sorted({*point.require, *point.refuse} - known)
                if unknown:
                    raise KumiteError(
                        f"{name}: no action is called {', '.join(map(repr, unknown))} at a "
                        f"check point; expected one of {', '.join(sorted(known))}"
                    )

    @property
    def controls(self) -> list[StyleControl]:
        """What the studio may tune while the fight runs."""
        fields = (
            ("depth", 1, 5),
            ("preferred_distance", 0.0, 4.0),
            ("distance", 0.0, 1e3),
            ("facing", 0.0, 1e3),
            ("given_short", 0.0, 1e5),
            ("given_long", 0.0, 1e5),
            ("taken", 0.0, 1e5),
            ("suitability", 0.0, 1e3),
            ("place", 0.0, 1e3),
        )
        return [
            StyleControl(f"{who}: {field}", field, player, least, most)
            for who, player in zip(self.names, self.players)
            for field, least, most in fields
        ]

    def reset(self, seed: int) -> None:
        """Start again from the beginning, with a seed."""
        self.seed = int(seed)
        self.frame = 0
        self.events: list[Event] = []
        self.story = Story(self.settings.cue, self.settings.vehicle, self.fps)
        self.decisions: list[Decision] = []
        count = len(self.names)
        rng = np.random.default_rng(self.seed)
        self.floor = Floor(self.library, count)
        self.cast = cast = self.floor.cast
        table = self.library.table
        number = {name: k for k, name in enumerate(self.names)}
        self.floor.opponent[:] = [number[f.against] for f in self.settings.fighters]
        # Everyone starts where idling or moving about has ended, with many ways out.
        calm = np.isin(self.tree.kinds, ("transition", "idle"))
        ways = np.diff(table.action_start)[table.target] * calm
        common = np.flatnonzero(ways >= max(np.quantile(ways[calm], 0.5), 1))
        self.stretch = rng.choice(common, count)
        self._recent = [deque(maxlen=MEMORY) for _ in range(count)]
        for k, kept in self._kept.items():
            self.players[k].__dict__.update(kept)
        self._kept = {}
        self._asked = [(f.wanted, f.unwanted) for f in self.settings.fighters]
        routes = [f.route() for f in self.settings.fighters]
        self.progress = [None if r is None else Progress(r) for r in routes]
        self._done: list[set[str]] = [set() for _ in range(count)]
        self._told = [0] * count
        self._landed = [NO_BLOW] * count  # the blow each has landed last in what it is doing
        bout = self.bout
        spread = np.array([bout.scatter, bout.scatter, np.radians(bout.scatter_deg)])
        moved = rng.uniform(-1.0, 1.0, (count, 3)) * spread
        for k, f in enumerate(self.settings.fighters):
            facing = np.array([*f.position, np.radians(f.yaw_deg)]) + moved[k]
            cast.place(k, int(table.target[self.stretch[k]]), facing)
        self.floor.start()

    @property
    def objects(self) -> list[SceneObject]:
        return self.story.objects

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
        for k in self.cast.waiting.tolist():
            if self._lies(k):
                self.cast.hold(k)
            else:
                self._choose(k)
        happened = self.floor.advance()
        self.frame += 1
        self._pass_check_points()
        if happened:
            for k, s, blow in self.floor.thrown:
                self._event("strike", k, limb=LIMBS[s], blow=blow)
            for landing in self.floor.landings:
                self._land(landing)
        return True

    def _lies(self, k: int) -> bool:
        """Whether character k has been knocked down for good."""
        fighter, stretch = self.settings.fighters[k], self.stretch[k]
        return fighter.stays_down and self.tree.labels[stretch] == "fall"

    # Deciding ------------------------------------------------------------------------------------

    def _choose(self, k: int) -> None:
        cast, table, o = self.cast, self.library.table, int(self.floor.opponent[k])
        facing = cast.facing
        pair = (k, o)
        local = [int(cast.frame[p] - table.first[self.stretch[p]] + 1) for p in pair]
        begun = (float(self.frame - local[0]), float(self.frame - local[1]))
        state = self.tree.state(
            (int(self.stretch[k]), int(self.stretch[o])),
            begun,
            (
                begun[0] + float(table.duration[self.stretch[k]]),
                begun[1] + float(table.duration[self.stretch[o]]),
            ),
            (facing[k], facing[o]),
            float(self.frame),
            (self._landed[k], self._landed[o]),
        )
        for p in pair:
            self._set_goal(p)
        players = (self.players[k], self.players[o])
        decision = self.tree.decide(state, players, tuple(self._recent[k]))
        self.decisions.append(decision)
        self._recent[k].append(decision.stretch)
        self._begin(k, decision.stretch)
        self._event(
            "decision",
            k,
            action=self.tree.labels[decision.stretch],
            stretch=decision.stretch,
            comp=float(f"{decision.comp:.6g}"),
            coop=float(f"{decision.coop:.6g}"),
            nodes=int(decision.nodes.sum()),
            considered=int(decision.considered.sum()),
            pruned=round(decision.pruned, 4),
            jump=bool(cast.jump[k]),
        )

    def _set_goal(self, k: int) -> None:
        player, progress, (wanted, unwanted) = self.players[k], self.progress[k], self._asked[k]
        if progress is None:
            return
        player.goal = progress.ahead(self.frame / self.fps, GOAL_EVERY, GOALS)
        player.wanted = (*wanted, *progress.wanted)
        player.unwanted = (*unwanted, *progress.unwanted)

    def _begin(self, k: int, stretch: int) -> None:
        """Character k begins a stretch now, whatever it does."""
        chosen = np.full(len(self.names), stretch)
        self.cast.begin(np.array([k]), chosen)
        self.stretch[k] = stretch
        self._landed[k] = NO_BLOW
        self._done[k] |= {self.tree.kinds[stretch], self.tree.labels[stretch]}

    # Bodies --------------------------------------------------------------------------------------

    def _land(self, landing: Landing) -> None:
        """A blow has landed: say so, let the struck segment give, and react to it."""
        body, tree = self.floor.body, self.tree
        part = body.parts[landing.part]
        speed = float(np.linalg.norm(landing.velocity))
        blocked = part in ARMS
        self._landed[landing.who] = landing.blow
        self._event(
            "hit",
            landing.who,
            victim=self.names[landing.victim],
            limb=LIMBS[landing.limb],
            part=part,
            speed=round(speed, 4),
            place=[round(float(x), 4) for x in landing.place],
            time=round((self.frame - 1 + landing.share) / self.fps, 4),
            blocked=blocked,
            blow=landing.blow,
        )
        joint = int(body.joint[landing.part])
        self.cast.strike(landing.victim, joint, landing.place, RECOIL * landing.velocity)
        if blocked:
            return
        rules = tree.rules
        size = FALL if speed >= rules.fall_from else int(speed >= rules.stagger_from)
        row = tree.response[int(part in ("head", "neck"))]
        self._set_goal(landing.victim)
        if row[FALL] != NOTHING and tree.asked(self.players[landing.victim])[row[FALL]] > 0:
            size = FALL  # it is asked for
        self._react(landing.victim, int(row[size]), size)

    def _react(self, k: int, response: int, size: int) -> None:
        if response == NOTHING or self._lies(k):
            return
        self._begin(k, response)
        self._event("reaction", k, action=self.tree.labels[response], size=SIZES[size])

    # The story -----------------------------------------------------------------------------------

    def take_cue(self, cue: CueSettings) -> None:
        """Somebody fights otherwise from their next decision on."""
        k = self.names.index(cue.who)
        player = self.players[k]
        self._kept.setdefault(k, dict(vars(player)))
        if cue.against is not None:
            self.floor.opponent[k] = self.names.index(cue.against)
        if cue.style is not None:
            player.style = style(cue.style)
        if cue.depth is not None:
            player.depth = cue.depth
        wanted, unwanted = self._asked[k]
        wanted = wanted if cue.wanted is None else cue.wanted
        unwanted = unwanted if cue.unwanted is None else cue.unwanted
        self._asked[k] = player.wanted, player.unwanted = wanted, unwanted
        route = cue.route()
        if route is not None:
            self.progress[k], self._told[k] = Progress(route), 0
        told = cue.model_dump(exclude={"who", "at", "after", "check_point"}, exclude_none=True)
        self._event("cue", k, **{name: told[name] for name in told if name != "point"})

    def run_over(self, k: int, by: str, speed: float) -> None:
        """Character k falls, struck by a vehicle."""
        self._event("run over", k, by=by, speed=round(speed, 3))
        self._react(k, int(self.tree.response[0, FALL]), FALL)

    def carry(self, k: int, by: np.ndarray) -> None:
        """Character k is moved [2] m over the ground."""
        self.cast.anchor[k, :2] += by

    # Check points --------------------------------------------------------------------------------

    def _pass_check_points(self) -> None:
        seconds = self.frame / self.fps
        for k, progress in enumerate(self.progress):
            if progress is None or progress.done:
                continue
            place = self.cast.root_position[k]
            reached = progress.update((float(place[0]), float(place[2])), seconds, self._done[k])
            self._done[k] = set()
            if reached is not None:
                self._event(
                    "check point",
                    k,
                    point=reached.index,
                    late_by=round(float(reached.late_by or 0.0), 3),
                    distance=round(float(reached.distance), 3),
                )
            missed = progress.missed(seconds)
            for m in missed[self._told[k] :]:
                due = None if m.due is None else round(float(m.due), 3)
                self._event("missed", k, point=m.index, due=due, by=round(float(m.distance), 3))
            self._told[k] = max(self._told[k], len(missed))

    def _event(self, kind: str, k: int, **data) -> None:
        self.events.append(Event(self.frame, kind, self.names[k], data))
