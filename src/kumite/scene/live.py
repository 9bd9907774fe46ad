"""The live scene: characters of one library who see, choose, move, hit and are hit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from kumite.body import lay_body
from kumite.clip import LIMBS
from kumite.control import Fighter, Skill, Temper, approach, stretch_tracks, strike, trained
from kumite.errors import KumiteError
from kumite.graph import Library
from kumite.kernels import blow as kernels
from kumite.rotation import planar_apply, planar_inverse, rotate
from kumite.scene.recording import Event
from kumite.scene.settings import SceneSettings
from kumite.scene.stage import SceneObject
from kumite.synthesis import Cast

TARGET_PARTS = ("head", "neck", "chest", "waist")
AIM = "head"
CLOSEST = 0.40  # m between two pelvises under which bodies are pushed apart
PUSH_SPEED = 0.5  # m/s, at most, of that push: slow enough not to be seen as a jump
ANTICIPATION = 0.4  # s of the other's motion that a fighter foresees; then it takes it to stand
RECOIL = 0.018  # m that a struck segment gives way per m/s of the blow
SWING = 0.35  # m/s that a struck target gains per m/s of the blow
SWING_RATE = 7.0  # rad/s of the target's pendulum
SWING_DAMPING = 0.25  # of critical


@dataclass
class Blows:
    """Where blows land on a body, as the kernels take it. B parts, four limbs."""

    joint: np.ndarray
    start: np.ndarray
    end: np.ndarray
    radius_start: np.ndarray
    radius_end: np.ndarray
    target: np.ndarray  # [B] bool
    tip_joint: np.ndarray  # [4]
    tip_offset: np.ndarray  # [4, 3], centre of the fist's sphere: its front is the limb's tip
    tip_radius: np.ndarray  # [4]


class LiveScene:
    """A scene that runs, one frame at a step. The same seed gives the same frames.

    Follows the :class:`~kumite.scene.stage.Stage` protocol, so the studio can show it.
    """

    def __init__(
        self,
        settings: SceneSettings,
        library: Library,
        *,
        seed: int = 0,
        cache: Path | None = None,
        progress: Callable[[str, int, float], None] = lambda name, sweep, residual: None,
    ) -> None:
        self.settings = settings
        self.library = library
        self.title = settings.title
        self.fps = library.clips.fps
        self.skeleton = library.clips.skeleton
        self.names = tuple(c.name for c in settings.character)
        if len(library.strikes) == 0:
            raise KumiteError("the library holds no effective hits: nobody in it can strike")
        tracks = stretch_tracks(library)
        if len(tracks.tip) == 0:
            raise KumiteError(
                f"none of the library's {len(library.strikes)} blows is in the connected part of "
                "its graph: nobody can strike; build it with more clips or more --per-second"
            )
        self.skill = Skill(
            library,
            trained(library, approach(), cache, progress=progress),
            trained(library, strike(library), cache, progress=progress),
            tracks,
        )
        self.body = lay_body(self.skeleton)
        self._blows = self._lay_blows()
        self._aim = [self._aims_at(c.aims_at) for c in settings.character]
        position, world = library.clips.world
        head = self.body.part(AIM)
        middle = 0.5 * (self.body.start[head] + self.body.end[head])
        joint = int(self.body.joint[head])
        self._head_joint, self._head_offset = joint, middle
        self._head = position[:, joint] + rotate(world[:, joint], middle)  # [F, 3] library world
        self.tempers = [
            Temper(c.approach, c.strike, c.facing, c.few, personal_space=c.personal_space)
            for c in settings.character
        ]
        self.reset(seed)

    def _aims_at(self, name: str) -> tuple[str, int]:
        if name in self.names:
            return "character", self.names.index(name)
        return "object", [o.name for o in self.settings.object].index(name)

    def _lay_blows(self) -> Blows:
        body, skeleton = self.body, self.skeleton
        joints, offsets, radii = [], [], []
        for limb in LIMBS:
            joint, offset = skeleton.tip(limb)
            radius = float(body.radius_end[body.part(limb)])
            length = float(np.linalg.norm(offset))
            joints.append(joint)
            offsets.append(offset * (1.0 - min(radius / max(length, 1e-6), 1.0)))
            radii.append(radius)
        return Blows(
            body.joint.astype(np.int64),
            body.start,
            body.end,
            body.radius_start,
            body.radius_end,
            np.array([p in TARGET_PARTS for p in body.parts]),
            np.array(joints),
            np.array(offsets),
            np.array(radii),
        )

    def reset(self, seed: int) -> None:
        """Start again from the beginning, with a seed."""
        self.seed = int(seed)
        self.frame = 0
        self.events: list[Event] = []
        count = len(self.names)
        streams = np.random.SeedSequence(self.seed).spawn(count + 1)
        rng = np.random.default_rng(streams[0])
        self.fighters = [
            Fighter(self.skill, temper, np.random.default_rng(s))
            for temper, s in zip(self.tempers, streams[1:])
        ]
        self.objects = [
            SceneObject(o.name, np.array(o.position), o.radius, o.draggable)
            for o in self.settings.object
        ]
        self._home = [thing.position.copy() for thing in self.objects]
        self._swing = [np.zeros(3) for _ in self.objects]
        self.cast = Cast(self.library, count)
        # Everyone starts in a state with many ways out: the usual guard, not the end of a blow.
        ways = np.diff(self.library.table.action_start)
        common = np.flatnonzero(ways >= np.quantile(ways, 0.75))
        for k, c in enumerate(self.settings.character):
            facing = np.array([*c.position, np.radians(c.yaw_deg)])
            self.cast.place(k, int(rng.choice(common)), facing)
        self.cast.show(0.0)
        parts = len(self.body)
        self._tip = np.zeros((count, len(LIMBS), 3))
        self._a, self._b = np.zeros((count, parts, 3)), np.zeros((count, parts, 3))
        self._landed = np.full((count, len(LIMBS)), kernels.NO_BLOW, dtype=np.int32)
        self._thrown = self._landed.copy()
        self._measure()

    @property
    def root_position(self) -> np.ndarray:
        return self.cast.root_position

    @property
    def wxyz(self) -> np.ndarray:
        return self.cast.wxyz

    def move_object(self, name: str, position: np.ndarray) -> None:
        """Put an object somewhere (its place of rest): seen from the next decision on."""
        for o, thing in enumerate(self.objects):
            if thing.name == name:
                self._home[o] = np.array(position, dtype=np.float64)
                thing.position = self._home[o].copy()
                self._swing[o][:] = 0.0

    def step(self) -> bool:
        """One frame: who has ended an action chooses, all move, blows are tested."""
        for k in self.cast.waiting:
            self._decide(int(k))
        self.cast.advance()
        self.frame += 1
        self._keep_apart()
        self._test_blows()
        self._swing_objects()
        return True

    # Deciding ------------------------------------------------------------------------------------

    def _decide(self, k: int) -> None:
        state = int(np.searchsorted(self.library.table.state_frame, self.cast.frame[k]))
        here = planar_inverse(self.cast.facing[k])
        kind, index = self._aim[k]
        if kind == "character":
            frames = self._foreseen(index)
            target = self._place_of(index, self._head[frames])
            other = self._place_of(index, self.library.clips.root_position[frames])
        else:
            target = other = self.objects[index].position[None]
        target, other = planar_apply(here, target), planar_apply(here, other)[:, [0, 2]]
        if kind == "object":
            other = np.full((1, 2), 1e6)  # a target may be stood under
        choice = self.fighters[k].choose(state, np.ascontiguousarray(target), other.copy())
        jump = self.cast.begin(k, choice.stretch)
        self._event(
            "decision",
            k,
            state=state,
            stretch=choice.stretch,
            worth=round(choice.worth, 6),
            considered=choice.considered,
            apart=choice.apart,
            jump=bool(jump),
        )

    def _foreseen(self, k: int) -> np.ndarray:
        """Library frames [H] that character k will show next, as far as others can foresee."""
        ahead = max(1, round(ANTICIPATION * self.fps))
        return np.minimum(self.cast.frame[k] + np.arange(1, ahead + 1), self.cast.stop[k])

    def _place_of(self, k: int, point: np.ndarray) -> np.ndarray:
        return planar_apply(self.cast.anchor[k], point)

    # Bodies --------------------------------------------------------------------------------------

    def _keep_apart(self) -> None:
        """Two bodies that come too near are carried apart, slowly; planted feet stay."""
        ground = self.cast.root_position[:, [0, 2]]
        near = KDTree(ground).query_pairs(CLOSEST, output_type="ndarray")
        for i, j in near[np.lexsort(near.T)].tolist():
            gap = ground[j] - ground[i]
            distance = float(np.hypot(*gap))
            away = gap / distance if distance > 1e-6 else np.array([1.0, 0.0])
            push = 0.5 * min(CLOSEST - distance, PUSH_SPEED / self.fps) * away
            self.cast.shift(i, *(-push))
            self.cast.shift(j, *push)

    def _measure(self) -> None:
        """Fists and bodies of the pose just made, kept beside those of the one before."""
        cast, blows = self.cast, self._blows
        self._tip_before, self._a_before, self._b_before = self._tip, self._a, self._b
        self._tip, self._a, self._b = (np.empty_like(x) for x in (self._tip, self._a, self._b))
        kernels.limb_tips(
            cast.position, cast.world_wxyz, blows.tip_joint, blows.tip_offset, self._tip
        )
        kernels.part_ends(
            cast.position, cast.world_wxyz, blows.joint, blows.start, blows.end, self._a, self._b
        )

    def _test_blows(self) -> None:
        self._measure()
        blow = self.cast.blow_of_frame[self.cast.frame]
        for k, s in zip(*np.nonzero((blow != kernels.NO_BLOW) & (blow != self._thrown))):
            self._event("strike", int(k), limb=LIMBS[s], blow=int(blow[k, s]))
        self._thrown = np.where(blow != kernels.NO_BLOW, blow, self._thrown)
        # A limb that has finished a blow may throw the same captured one again.
        self._thrown = np.where(blow == kernels.NO_BLOW, kernels.NO_BLOW, self._thrown)
        self._landed = np.where(blow == kernels.NO_BLOW, kernels.NO_BLOW, self._landed)
        self._test_bodies(blow)
        self._test_objects(blow)

    def _test_bodies(self, blow: np.ndarray) -> None:
        opponent = np.array([i if kind == "character" else kernels.NOBODY for kind, i in self._aim])
        part = np.empty(blow.shape, dtype=np.int64)
        when = np.empty(blow.shape)
        blows = self._blows
        kernels.find_hits(
            opponent,
            blow,
            self._landed,
            self._tip_before,
            self._tip,
            self._a_before,
            self._a,
            self._b_before,
            self._b,
            blows.radius_start,
            blows.radius_end,
            blows.target,
            blows.tip_radius,
            part,
            when,
        )
        for k, s in zip(*np.nonzero(part != kernels.NO_HIT)):
            victim, struck = int(opponent[k]), int(part[k, s])
            t = float(when[k, s])
            moved = self._tip[k, s] - self._tip_before[k, s]
            place = self._tip_before[k, s] + t * moved
            middle_before = 0.5 * (self._a_before[victim, struck] + self._b_before[victim, struck])
            middle = 0.5 * (self._a[victim, struck] + self._b[victim, struck])
            velocity = (moved - (middle - middle_before)) * self.fps
            speed = float(np.linalg.norm(velocity))
            self._landed[k, s] = blow[k, s]
            self._event(
                "hit",
                int(k),
                victim=self.names[victim],
                limb=LIMBS[s],
                part=self.body.parts[struck],
                speed=round(speed, 4),
                place=[round(float(x), 4) for x in place],
                time=round((self.frame - 1 + t) / self.fps, 4),
                blow=int(blow[k, s]),
            )
            self.cast.strike(victim, int(blows.joint[struck]), place, RECOIL * velocity)

    def _test_objects(self, blow: np.ndarray) -> None:
        for k, (kind, o) in enumerate(self._aim):
            if kind != "object":
                continue
            thing = self.objects[o]
            for s in range(len(LIMBS)):
                if blow[k, s] in (kernels.NO_BLOW, self._landed[k, s]):
                    continue
                p0, p1 = self._tip_before[k, s], self._tip[k, s]
                t = kernels.swept_contact(
                    p0,
                    p1,
                    thing.position,
                    thing.position,
                    thing.position,
                    thing.position,
                    thing.radius,
                    thing.radius,
                    self._blows.tip_radius[s],
                )
                if t < 0:
                    continue
                velocity = (p1 - p0) * self.fps
                self._landed[k, s] = blow[k, s]
                self._swing[o] += SWING * velocity
                self._event(
                    "hit",
                    k,
                    victim=thing.name,
                    limb=LIMBS[s],
                    part=thing.name,
                    speed=round(float(np.linalg.norm(velocity)), 4),
                    place=[round(float(x), 4) for x in p0 + t * (p1 - p0)],
                    time=round((self.frame - 1 + t) / self.fps, 4),
                    blow=int(blow[k, s]),
                )

    def _swing_objects(self) -> None:
        """Struck targets swing about where they belong and come back."""
        dt = 1.0 / self.fps
        for o, thing in enumerate(self.objects):
            pull = SWING_RATE**2 * (self._home[o] - thing.position)
            drag = 2.0 * SWING_DAMPING * SWING_RATE * self._swing[o]
            self._swing[o] += dt * (pull - drag)  # semi-implicit Euler: stays bounded
            thing.position = thing.position + dt * self._swing[o]

    def _event(self, kind: str, k: int, **data) -> None:
        self.events.append(Event(self.frame, kind, self.names[k], data))
