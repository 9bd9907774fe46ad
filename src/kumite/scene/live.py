"""The live scene: characters of one library who see, choose, move, hit and are hit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from kumite.body import ARMS, lay_body
from kumite.clip import LIMBS
from kumite.control import (
    BEHAVIOURS,
    Behaviour,
    Fighters,
    Skill,
    Temper,
    approach,
    stretch_tracks,
    strike,
    trained,
)
from kumite.errors import KumiteError, unknown
from kumite.graph import Layer, Library
from kumite.kernels import crowd as kernels
from kumite.kernels.blow import NO_BLOW, NOBODY, swept_contact
from kumite.kernels.character import MANY
from kumite.rotation import rotate
from kumite.scene import events
from kumite.scene.doors import a_place, check_scene
from kumite.scene.events import Decision, Event, Hit
from kumite.scene.floor import Floor, Landing
from kumite.scene.memory import refuse_too_many
from kumite.scene.pairs import pair_up
from kumite.scene.settings import NEAREST, SceneSettings
from kumite.scene.stage import SceneObject
from kumite.scene.starts import draw_starts, stream
from kumite.synthesis.recoil import RECOIL

AIM = "head"
ANTICIPATION = 0.4  # s of the other's motion that a fighter foresees; then it takes it to stand
SWING = 0.35  # m/s that a struck target gains per m/s of the blow
SWING_RATE = 7.0  # rad/s of the target's pendulum
SWING_DAMPING = 0.25  # of critical
FEW_TO_TUNE = 4  # characters that each have their own sliders
REPAIRING = 1.0  # s after which those who aim at the nearest look round again


class WeightControl:
    """The weight of a behaviour, of one character or of all: a control of the studio."""

    minimum, maximum = 0.0, 12.0

    def __init__(self, name: str, behaviour: str, tempers: Sequence[Temper]) -> None:
        self.name = name
        self.behaviour = behaviour
        self.tempers = tempers

    @property
    def value(self) -> float:
        return self.tempers[0].weight(self.behaviour)

    def set(self, value: float) -> None:
        """Errors: the last weight above 0 cannot be taken away."""
        for temper in self.tempers:
            temper.set_weight(self.behaviour, value)


class LiveScene:
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
        """behaviours: a user's own by name, besides those of :data:`kumite.control.BEHAVIOURS`.

        Errors: a library that nobody can strike with, an unknown behaviour, too many characters.
        """
        library = check_scene(settings, library, seed, "frames", "actions")
        self.settings = settings
        self.library = library
        self.title = settings.title
        self.fps = library.clips.fps
        self.skeleton = library.clips.skeleton
        refuse_too_many(
            len(settings.character) + (settings.crowd.count if settings.crowd else 0),
            len(self.skeleton),
        )
        self.names = tuple(c.name for c in settings.characters)
        if len(library.strikes) == 0:
            raise KumiteError("the library holds no effective hits: nobody in it can strike")
        tracks = stretch_tracks(library)
        if len(tracks.tip) == 0:
            raise KumiteError(
                f"none of the library's {len(library.strikes)} blows is in the connected part of "
                "its graph: nobody can strike; build it with more clips or more --per-second"
            )
        more = self._named_behaviours(behaviours or {})
        self.skill = Skill(
            library,
            trained(library, approach(), cache, progress=progress),
            trained(library, strike(library), cache, progress=progress),
            tracks,
            tuple(trained(library, b, cache, progress=progress) for b in more),
        )
        self.body = lay_body(self.skeleton)
        position, world = library.clips.world
        head = self.body.part(AIM)
        middle = 0.5 * (self.body.start[head] + self.body.end[head])
        joint = int(self.body.joint[head])
        self._head = position[:, joint] + rotate(world[:, joint], middle)  # [F, 3] library world
        self._horizon = max(1, round(ANTICIPATION * self.fps))
        self.tempers = [
            Temper(
                c.approach,
                c.strike,
                c.facing,
                c.few,
                again=c.again,
                personal_space=c.personal_space,
                more=dict(c.behaviours),
            )
            for c in settings.characters
        ]
        self.reset(seed)

    def _named_behaviours(self, own: Mapping[str, Behaviour]) -> list[Behaviour]:
        """Those that the scene or the user names, besides approach and strike."""
        names = {n: None for c in self.settings.characters for n in c.behaviours} | dict.fromkeys(
            own
        )
        known = [n for n in [*BEHAVIOURS, *own] if n not in ("approach", "strike")]
        out = []
        for name in names:
            if name in ("approach", "strike"):
                raise KumiteError(f"behaviours: {name} has a weight of its own ({name} = …)")
            if name not in known:
                raise unknown("behaviour", name, known)
            found = own[name] if name in own else BEHAVIOURS[name](self.library)
            out.append(replace(found, name=name))
        return out

    @property
    def controls(self) -> list[WeightControl]:
        """What the studio may tune while the scene runs: each behaviour's weight."""
        names = ("approach", "strike", *(p.behaviour.name for p in self.skill.more))
        if len(self.tempers) > FEW_TO_TUNE:
            return [WeightControl(n, n, self.tempers) for n in names]
        return [
            WeightControl(f"{who}: {n}", n, [temper])
            for who, temper in zip(self.names, self.tempers)
            for n in names
        ]

    def reset(self, seed: int) -> None:
        """Start again from the beginning, with a seed."""
        self.seed = int(seed)
        self.frame = 0
        self.events: list[Event] = []
        count = len(self.names)
        self.fighters = Fighters(self.skill, self.tempers, self.seed)
        self.objects = [
            SceneObject(o.name, np.array(o.position), o.radius, o.draggable)
            for o in self.settings.object
        ]
        self._home = [thing.position.copy() for thing in self.objects]
        self._swing = [np.zeros(3) for _ in self.objects]
        self.floor = Floor(self.library, count)
        self.cast = cast = self.floor.cast
        # Everyone is on the way to a state with many ways out: the usual guard, not a blow's end.
        table = self.library.table
        ways = np.diff(table.action_start)[table.target]
        common = np.flatnonzero(ways >= np.quantile(np.diff(table.action_start), 0.75))
        streams = [stream(self.seed, k) for k in range(count)]
        for k, (stretch, frame) in enumerate(zip(*draw_starts(self.library, common, streams))):
            c = self.settings.characters[k]
            facing = np.array([*c.position, np.radians(c.yaw_deg)])
            cast.place(k, int(table.target[stretch]), facing, frame=int(frame))
        self.floor.start()
        clips = self.library.clips
        yaws = np.radians([o.yaw_deg for o in self.settings.object])
        self._things = np.zeros((len(self.objects), 4))
        self._things[:, 3] = yaws
        self._actors = kernels.Actors(
            cast.frame,
            cast.fraction,
            cast.rate,
            cast.stop,
            cast.anchor,
            self.floor.opponent,
            np.full(count, NOBODY, dtype=np.int64),
            self._things,
            self._head,
            clips.root_position,
            clips.facing,
        )
        self._aim()

    def _aim(self) -> None:
        """Who aims at whom: as the scene says, or at the nearest who is free (or else at all)."""
        opponent, thing = self._actors.opponent, self._actors.thing
        number = {name: k for k, name in enumerate(self.names)}
        objects = [o.name for o in self.settings.object]
        free = []
        for k, c in enumerate(self.settings.characters):
            if c.aims_at == NEAREST:
                free.append(k)
            elif c.aims_at in number:
                opponent[k] = number[c.aims_at]
            else:
                thing[k] = objects.index(c.aims_at)
        ground = self.cast.root_position[:, [0, 2]]
        if len(free) == 1:  # the others are named: the nearest of them, whoever they aim at
            away = np.hypot(*(ground - ground[free[0]]).T)
            away[free[0]] = np.inf
            opponent[free[0]] = np.argmin(away)
        elif free:
            who = np.array(free)
            opponent[who] = who[pair_up(ground[who], np.searchsorted(who, opponent[who]))]

    @property
    def root_position(self) -> np.ndarray:
        return self.cast.root_position

    @property
    def wxyz(self) -> np.ndarray:
        return self.cast.wxyz

    def move_object(self, name: str, position: np.ndarray) -> None:
        """Put an object somewhere (its place of rest): seen from the next decision on.

        Errors: a place that is not three finite numbers.
        """
        for o, thing in enumerate(self.objects):
            if thing.name == name:
                self._home[o] = a_place(position, name)
                thing.position = self._home[o].copy()
                self._swing[o][:] = 0.0

    def step(self) -> bool:
        """One frame: who has ended an action chooses, all move, blows are tested."""
        if self.frame % round(REPAIRING * self.fps) == 0 and self.frame:
            self._aim()
        for o, thing in enumerate(self.objects):
            self._things[o, :3] = thing.position
        cast, floor = self.cast, self.floor
        who = cast.waiting
        states = np.searchsorted(self.library.table.state_frame, cast.stop[who])
        self.fighters.note(who)
        if len(who):
            choose = kernels.choose_many if cast.count >= MANY else kernels.choose
            choose(
                who,
                states,
                cast.root_position,
                floor.grid,
                self._actors,
                self.fighters.minds,
                self.skill.moves,
                self.skill.behaviours,
                self._horizon,
                self.fighters.choices,
            )
            cast.begin(who, self.fighters.choices.stretch)
        happened = floor.advance()
        self._note_decisions(who, states)
        self.frame += 1
        if happened:
            for k, s, blow in floor.thrown:
                strikes = self.library.strikes
                self.events.append(events.strike(self.frame, self.names[k], s, blow, strikes))
            for landing in floor.landings:
                self._land(landing)
        if self.objects:
            self._test_objects()
            self._swing_objects()
        return True

    def _note_decisions(self, who: np.ndarray, states: np.ndarray) -> None:
        choices, jump = self.fighters.choices, self.cast.jump
        for k, state in zip(who.tolist(), states.tolist()):
            self.events.append(
                Decision(
                    self.frame,
                    self.names[k],
                    by="policy",
                    state=state,
                    stretch=int(choices.stretch[k]),
                    worth=float(choices.worth[k]),
                    considered=int(choices.considered[k]),
                    apart=int(choices.apart[k]),
                    jump=bool(jump[k]),
                )
            )

    def _land(self, landing: Landing) -> None:
        """A blow has hit an opponent: say so, and let the struck segment give."""
        body = self.body
        victim, part = self.names[landing.victim], body.parts[landing.part]
        self._hit(
            landing.who,
            landing.limb,
            victim,
            part,
            landing.velocity,
            landing.place,
            landing.share,
        )
        joint = int(body.joint[landing.part])
        self.cast.strike(landing.victim, joint, landing.place, RECOIL * landing.velocity)

    def _hit(
        self,
        k: int,
        s: int,
        victim: str,
        part: str,
        velocity: np.ndarray,
        place: np.ndarray,
        t: float,
    ) -> None:
        self.events.append(
            Hit(
                self.frame,
                self.names[k],
                victim=victim,
                limb=LIMBS[s],
                part=part,
                speed=float(np.linalg.norm(velocity)),
                place=events.place(place),
                time=(self.frame - 1 + t) / self.fps,
                blocked=part in ARMS and part != victim,
                blow=int(self.floor.blows.thrown[k, s]),
            )
        )

    def _test_objects(self) -> None:
        blows = self.floor.blows
        for k in np.flatnonzero(self._actors.thing != NOBODY).tolist():
            o = int(self._actors.thing[k])
            thing = self.objects[o]
            at, radius = thing.position, thing.radius
            for s in range(len(LIMBS)):
                if blows.thrown[k, s] in (NO_BLOW, blows.landed[k, s]):
                    continue
                p0, p1 = blows.tip[:, k, s]
                fist = self.floor.shapes.tip_radius[s]
                t = swept_contact(p0, p1, at, at, at, at, radius, radius, fist)
                if t < 0:
                    continue
                velocity = (p1 - p0) * self.fps
                blows.landed[k, s] = blows.thrown[k, s]
                self._swing[o] += SWING * velocity
                self._hit(k, s, thing.name, thing.name, velocity, p0 + t * (p1 - p0), t)

    def _swing_objects(self) -> None:
        """Struck targets swing about where they belong and come back."""
        dt = 1.0 / self.fps
        for o, thing in enumerate(self.objects):
            pull = SWING_RATE**2 * (self._home[o] - thing.position)
            drag = 2.0 * SWING_DAMPING * SWING_RATE * self._swing[o]
            self._swing[o] += dt * (pull - drag)  # semi-implicit Euler: stays bounded
            thing.position = thing.position + dt * self._swing[o]
