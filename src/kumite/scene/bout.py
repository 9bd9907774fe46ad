"""A fight by game tree: each fighter looks ahead whenever its action has ended (Shum et al. 2012).

Everything that is decided on may change between two decisions (B12). A blow that lands cuts its
victim's action short; the struck segment gives way, and the reaction that the tree expects follows.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from kumite.body import ARMS
from kumite.clip import LIMBS
from kumite.control import Progress
from kumite.control.game_tree import MEMORY, Decision, GameTree, Player
from kumite.errors import KumiteError
from kumite.graph import Library
from kumite.kernels.blow import NO_BLOW
from kumite.kernels.moves import FALL, FLINCH, NOTHING, STAGGER
from kumite.scene.fighters import BoutSettings
from kumite.scene.floor import Floor, Landing
from kumite.scene.recording import Event
from kumite.scene.settings import SceneSettings
from kumite.scene.stage import SceneObject

RECOIL = 0.018  # m that a struck segment gives way per m/s of the blow
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
        if not settings.fighter:
            raise KumiteError(f"{settings.title!r} is no fight by game tree; expected [[fighter]]s")
        self.settings = settings
        self.library = library
        self.title = settings.title
        self.fps = library.clips.fps
        self.skeleton = library.clips.skeleton
        self.names = settings.names
        self.tree = GameTree(library, (settings.bout or BoutSettings()).rules())
        self.players = [f.player() for f in settings.fighter]
        for player, fighter in zip(self.players, settings.fighter):
            self.tree.asked(player)
            for point in fighter.point:
                unknown = sorted({*point.require, *point.refuse} - self.tree.names)
                if unknown:
                    raise KumiteError(
                        f"{fighter.name}: no action is called {', '.join(map(repr, unknown))} at a "
                        f"check point; expected one of {', '.join(sorted(self.tree.names))}"
                    )
        self.reset(seed)

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
        self.objects: list[SceneObject] = []
        self.decisions: list[Decision] = []
        count = len(self.names)
        rng = np.random.default_rng(self.seed)
        self.floor = Floor(self.library, count)
        self.cast = cast = self.floor.cast
        table = self.library.table
        number = {name: k for k, name in enumerate(self.names)}
        self.floor.opponent[:] = [number[f.against] for f in self.settings.fighter]
        # Everyone starts where idling or moving about has ended, with many ways out.
        calm = np.isin(self.tree.kinds, ("transition", "idle"))
        ways = np.diff(table.action_start)[table.target] * calm
        common = np.flatnonzero(ways >= max(np.quantile(ways[calm], 0.5), 1))
        self.stretch = rng.choice(common, count)
        self._recent = [deque(maxlen=MEMORY) for _ in range(count)]
        routes = [f.route() for f in self.settings.fighter]
        self.progress = [None if r is None else Progress(r) for r in routes]
        self._done: list[set[str]] = [set() for _ in range(count)]
        self._told = [0] * count
        self._landed = [NO_BLOW] * count  # the blow each has landed last in what it is doing
        for k, f in enumerate(self.settings.fighter):
            facing = np.array([*f.position, np.radians(f.yaw_deg)])
            cast.place(k, int(table.target[self.stretch[k]]), facing)
        self.floor.start()

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
        for k in self.cast.waiting.tolist():
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
        self._set_goals()
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

    def _set_goals(self) -> None:
        seconds = self.frame / self.fps
        for player, progress, f in zip(self.players, self.progress, self.settings.fighter):
            if progress is None:
                continue
            player.goal = progress.goal(seconds)
            player.wanted = (*f.wanted, *progress.wanted)
            player.unwanted = (*f.unwanted, *progress.unwanted)

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
        response = int(tree.response[int(part in ("head", "neck")), size])
        if response == NOTHING:
            return
        self._begin(landing.victim, response)
        self._event("reaction", landing.victim, action=tree.labels[response], size=SIZES[size])

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
