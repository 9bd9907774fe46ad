"""A scene in which people avoid the blows of others, and strike back (Oshita & Masaoka 2011).

Who avoids comes first, then who attacks; each side plays a library of its own. Where only one side
has swords, everyone has a sword's joint and those of the other side are unarmed: theirs is neither
seen nor felt.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kumite.body import ARMS
from kumite.body.spheres import SWORD
from kumite.clip import LIMBS, Skeleton
from kumite.control.attack import Attack
from kumite.control.conductor import Conductor
from kumite.control.counter import Counter, CounterFighter, CounterSearch, Opening
from kumite.control.protocol import Controller
from kumite.control.tuning import Tunable, find
from kumite.errors import KumiteError
from kumite.graph import Layer, Library
from kumite.graph.spans import Spans
from kumite.kernels.blow import NOBODY
from kumite.rotation import planar_apply, wrap_angle
from kumite.scene import events
from kumite.scene.apart import held_apart, push_two
from kumite.scene.attackers import Attackers, Blow, middle_of, skill_of
from kumite.scene.avoiding import Avoiders, search_of
from kumite.scene.blows import Blows, Contact
from kumite.scene.controls import (
    KEPT,
    policy_tunables,
    reaction_tunables,
    search_tunables,
    tunable,
)
from kumite.scene.doors import check_scene, layer_of
from kumite.scene.events import Avoided, Event, Foreseen, Hit
from kumite.scene.memory import refuse_too_many
from kumite.scene.settings_dodge import DodgeSettings
from kumite.scene.stage import Offers, SceneObject
from kumite.scene.volumes import Volumes
from kumite.synthesis import Cast
from kumite.synthesis.recoil import RECOIL

ANTICIPATION = 0.4  # s of another's motion that an attacker foresees; then it takes it to stand
NEAR = 2.0  # m from an avoider within which a blow that is meant for another menaces it, too
GOALS = ("head", "chest")  # what blows back are meant for
TRUNK = ("head", "chest", "pelvis")  # what of an attacker an avoidance must not run into …
THIN = 0.12  # m, of the spheres there: arms may touch
PUSH = 1.2  # m/s at most with which two who are in each other are carried apart


@dataclass
class Coming:
    """A blow that is on its way to one of those who avoid."""

    number: int
    blow: Blow
    at: int  # whom it is meant for
    landed: bool = False
    gap: float = np.inf  # m between it and the body, had that stayed where it was when it was told


class Everyone:
    """Both casts as one, as far as a recording asks."""

    def __init__(self, casts: Sequence[Cast]) -> None:
        self._casts = casts

    def _all(self, name: str) -> np.ndarray:
        return np.concatenate([getattr(cast, name) for cast in self._casts])

    @property
    def contacts(self) -> np.ndarray:
        return self._all("contacts")

    @property
    def held(self) -> np.ndarray:
        return self._all("held")

    @property
    def frame(self) -> np.ndarray:
        return self._all("frame")

    @property
    def pace(self) -> np.ndarray:
        return self._all("pace")


class EvasionScene:
    """People under attack, one frame at a step. The same seed gives the same frames.

    ``controllers`` [K] are those of each character, in order (:mod:`kumite.control.protocol`).
    Follows the :class:`~kumite.scene.stage.Stage` protocol, so the studio can show it.
    """

    def __init__(
        self,
        settings,
        library: Library | Layer,
        attack: Library | Layer,
        *,
        seed: int = 0,
        cache: Path | None = None,
        progress: Callable[[str, int, float], None] = lambda name, sweep, residual: None,
    ) -> None:
        """library: of those who avoid; attack: of those who attack.

        Errors: either side is empty; a library without avoidance parts, or one without blows;
        libraries of different bodies or frame rates; too many characters.
        """
        library = check_scene(settings, library, seed, "avoidance")
        attack = layer_of(attack, "the attackers' library", "frames", "actions")
        if not (settings.dodging and settings.attacker):
            raise KumiteError(
                f"{settings.title!r} needs somebody who avoids and somebody who attacks; expected "
                "[[dodger]]s and [[attacker]]s"
            )
        self.settings, self.library, self.title = settings, library, settings.title
        self.fps = library.clips.fps
        if attack.clips.fps != self.fps:
            raise KumiteError(f"libraries of {self.fps:g} and {attack.clips.fps:g} frames a second")
        self._dodgers_count = len(settings.dodging)
        self.names = tuple(s.name for s in (*settings.dodging, *settings.attacker))
        skeletons = [library.clips.skeleton, attack.clips.skeleton]
        self.skeleton, self._rows = _shared(skeletons)
        refuse_too_many(len(self.names), len(self.skeleton))
        sides = (self.names[: self._dodgers_count], self.names[self._dodgers_count :])
        self.unarmed = tuple(
            name
            for side, own in zip(sides, skeletons)
            if len(own) < len(self.skeleton)
            for name in side
        )
        self.dodge = settings.dodge or DodgeSettings()
        search = search_of(library, self.dodge)
        self.skill = skill_of(attack, cache, progress)
        self.side = Avoiders(
            search,
            settings.dodging,
            self._tell,
            watched=lambda d: self.attackers.cast.root_position[self._foe(d), [0, 2]],
            distance=self.dodge.distance,
        )
        self.attackers = Attackers(self.skill, settings.attacker)
        self._counters: list[CounterFighter] = []
        if self.dodge.counters:
            blows = CounterSearch(search)
            for controllers in self.side.controllers:
                self._counters.append(CounterFighter(blows, self._opening, self._tell_counter))
                controllers.insert(1, self._counters[-1])
        self.controllers: list[list[Controller]] = [
            *self.side.controllers,
            *([self.attackers] for _ in settings.attacker),
        ]
        self._spans = Spans.of(Library.of(attack), (attack.name,))
        self.reset(seed)

    def reset(self, seed: int) -> None:
        """Start again from the beginning, with a seed."""
        self.seed = int(seed)
        self.frame = 0
        self.events: list[Event] = []
        self.side.start(self.seed)
        self.attackers.place(self.seed)
        cast = self.attackers.cast
        self._conductor = Conductor(
            cast,
            self._spans,
            self.names[self._dodgers_count :],
            np.full(cast.count, NOBODY),
            self.controllers[self._dodgers_count :],
            begin=self._begin,
            free=lambda k: True,
        )
        self._conductor.start(self.seed)
        self.cast = Everyone([self.side.cast, cast])
        self._sides = (Blows(self.side.cast), Blows(cast))
        self._heads = middle_of(self.library, self._sides[0].body, "head")
        self._coming: dict[tuple[int, int, int], Coming] = {}
        self._numbers = 0
        for a in range(cast.count):
            self._decide(a)

    def _begin(self, a: int, span: int, controller: Controller) -> None:
        """An attacker begins what it has decided on, and decides on what comes after it."""
        cast = self.attackers.cast
        cast.begin(np.array([a]), np.full(cast.count, span))
        self._decide(a)

    @property
    def root_position(self) -> np.ndarray:
        return np.concatenate([self.side.cast.root_position, self.attackers.cast.root_position])

    @property
    def wxyz(self) -> np.ndarray:
        out = np.zeros((len(self.names), len(self.skeleton), 4))
        out[..., 0] = 1.0
        out[: self._dodgers_count, self._rows[0]] = self.side.cast.wxyz
        out[self._dodgers_count :, self._rows[1]] = self.attackers.cast.wxyz
        return out

    @property
    def objects(self) -> list[SceneObject]:
        return []

    def move_object(self, name: str, position: np.ndarray) -> None:
        """There are none."""

    @property
    def tunables(self) -> list[Tunable]:
        """What may be tuned while it runs, of those who avoid and of those who attack."""
        side, count = self.side, self._dodgers_count

        def keep(distance: float) -> None:
            side.roamer.distance = distance

        def kept() -> float:
            return float(side.roamer.distance or 0.0)

        return [
            *reaction_tunables(self.names[:count], side.avoiders),
            *search_tunables(lambda: side.search, side.tune),
            tunable(KEPT, "", "avoid", "dodge.distance", kept, keep),
            *(
                t
                for t in policy_tunables(self.names[count:], self.attackers.fighters.tempers)
                if t.field != "again"  # which no scene file sets
            ),
        ]

    def tunable(self, name: str) -> Tunable:
        """One of them by name. Errors: there is none such."""
        return find(self.tunables, name)

    @property
    def offers(self) -> Offers:
        """What may be done with it while it runs."""
        return Offers(
            avoiding=Volumes(dict(enumerate(self.side.avoiders)), lambda: self.side.cast),
            tunables=tuple(self.tunables),
        )

    def step(self) -> bool:
        """One frame: controllers decide, all move, blows are tested."""
        self._conductor.step(self.frame)
        self.side.conductor.step(self.frame)
        self.side.cast.advance()
        self.attackers.cast.advance()
        self._keep_apart()
        self.frame += 1
        for side, begun in enumerate([s.step() for s in self._sides]):
            if self._strikes(side):
                for k, s, blow in begun:
                    self._tell_strike(side, k, s, blow)
        for side in (0, 1):
            if self._strikes(side):
                self._land(side)
        self._end_blows()
        return True

    # Who minds whom ------------------------------------------------------------------------------

    def _foe(self, d: int) -> int:
        """The attacker nearest to a character who avoids."""
        off = self.attackers.cast.root_position - self.side.cast.root_position[d]
        return int(np.argmin(np.hypot(off[:, 0], off[:, 2])))

    def _victim(self, a: int) -> int:
        """The character who avoids nearest to an attacker."""
        off = self.side.cast.root_position - self.attackers.cast.root_position[a]
        return int(np.argmin(np.hypot(off[:, 0], off[:, 2])))

    def _decide(self, a: int) -> None:
        """An attacker makes up its mind, and who may be struck sees what is coming."""
        attackers, cast, clips = self.attackers, self.side.cast, self.library.clips
        steps = np.arange(1, max(1, round(ANTICIPATION * self.fps)) + 1)
        frames = cast.frames_ahead(np.arange(cast.count), steps)  # [D, H]
        at = self._victim(a)
        head = planar_apply(cast.anchor[at], self._heads[frames[at]])
        yaw = cast.anchor[at, 2] + clips.facing[frames[at], 2]
        root = planar_apply(cast.anchor[:, None], clips.root_position[frames])[..., [0, 2]]
        self.events.append(
            attackers.decide(
                a,
                np.column_stack([head, wrap_angle(yaw)]),
                root,
                self.frame,
                self.names[self._dodgers_count + a],
            )
        )
        for blow in attackers.foresee(a, self.frame):
            self._menace(blow, at)
        if self.dodge.searches:
            self._stand_in_the_way(a)

    def _stand_in_the_way(self, a: int) -> None:
        """An attacker's body, as far as it is known, is to be kept clear of while avoiding."""
        body = self._sides[1].body
        rows = [body.part(part) for part in TRUNK]
        centre = self.attackers.parts_ahead(a, body, rows)
        when = (self.frame + np.arange(len(centre))) / self.fps
        attack = Attack(when, centre, np.full(len(rows), THIN), f"body of {a}")
        for avoider in self.side.avoiders:  # nobody gets out of its way
            avoider.mind(attack, -1 - a, self.frame / self.fps, avoid=False)

    def _menace(self, blow: Blow, at: int) -> None:
        """A blow has been foreseen, or more of it."""
        key = (blow.who, blow.limb, blow.blow)
        known = self._coming.get(key)
        if known is None:
            self._numbers += 1
            known = self._coming[key] = Coming(self._numbers, blow, at)
        known.blow = blow
        cast, spheres = self.side.cast, self.side.search.spheres
        body = spheres.at(cast.position[at], cast.world_wxyz[at])
        known.gap = blow.attack.nearest(body, spheres.radius)
        attacker = self.names[self._dodgers_count + blow.who]
        self.events.append(
            Foreseen(
                self.frame,
                attacker,
                attack=known.number,
                limb=LIMBS[blow.limb],
                blow=blow.blow,
                victim=self.names[at],
                gap=known.gap,
                begins=float(blow.attack.when[0]),
            )
        )
        if not self.dodge.searches:
            return
        for d in range(self._dodgers_count):
            off = blow.attack.centre[..., [0, 2]] - cast.root_position[d, [0, 2]]
            if d == at or np.hypot(off[..., 0], off[..., 1]).min() < NEAR:
                self.side.avoiders[d].mind(
                    blow.attack, known.number, self.frame / self.fps, attacker=attacker
                )

    def _opening(self, d: int) -> Opening:
        """Whom a character who avoids may strike back: the nearest attacker."""
        foe, body = self._foe(d), self._sides[1].body
        rows = [body.part(part) for part in (*GOALS, "pelvis")]
        goal = self.attackers.parts_ahead(foe, body, rows)
        radius = 0.5 * (body.radius_start + body.radius_end)[rows]
        following = min(
            [float(c.blow.attack.when[0]) for c in self._coming.values()],
            default=self.frame / self.fps + self.attackers.known(foe),
        )
        return Opening(goal[:, :-1], radius[:-1], goal[:, -1], following)

    def _tell(self, event: Event) -> None:
        self.events.append(event)

    def _tell_counter(self, d: int, found: Counter) -> None:
        limb = LIMBS[int(self.library.strikes.limb[found.blow])]
        self.events.append(
            events.Counter(
                self.frame,
                self.names[d],
                victim=self.names[self._dodgers_count + self._foe(d)],
                limb=limb,
                blow=found.blow,
                gap=found.gap,
                seconds=found.seconds,
            )
        )

    # Bodies and blows ----------------------------------------------------------------------------

    def _keep_apart(self) -> None:
        mine, its = self._sides
        for d in range(self._dodgers_count):
            for a in range(self.attackers.cast.count):
                push_two(
                    (mine.body, mine.cast, d, held_apart(mine.body, mine.thrown[d])),
                    (its.body, its.cast, a, held_apart(its.body, its.thrown[a])),
                    self.fps,
                    PUSH,
                )

    def _strikes(self, side: int) -> bool:
        """Whether one side's blows count: arms of those who only avoid swing as if they struck."""
        return side == 1 or bool(self._counters)

    def _tell_strike(self, side: int, k: int, s: int, blow: int) -> None:
        coming = self._coming.get((k, s, blow)) if side == 1 else None
        who = self.names[side * self._dodgers_count + k]
        strikes = self._sides[side].cast.library.strikes
        attack = None if coming is None else coming.number
        self.events.append(events.strike(self.frame, who, s, blow, strikes, attack))

    def _land(self, side: int) -> None:
        """Blows of one side that have met somebody: say so, and let the struck segment give."""
        mine, other = self._sides[side], self._sides[1 - side]
        for k, s in mine.flying:
            for victim in range(other.cast.count):
                met = mine.meets(k, s, other, victim)
                if met is not None:
                    mine.landed[k, s] = mine.thrown[k, s]
                    self._hit(side, k, s, victim, met)
                    break

    def _hit(self, side: int, k: int, s: int, victim: int, met: Contact) -> None:
        mine, other = self._sides[side], self._sides[1 - side]
        part, blow = other.body.parts[met.part], int(mine.thrown[k, s])
        coming = self._coming.get((k, s, blow)) if side == 1 else None
        if coming is not None:
            coming.landed = True
        who, whom = (0, self._dodgers_count) if side == 0 else (self._dodgers_count, 0)
        self.events.append(
            Hit(
                self.frame,
                self.names[who + k],
                victim=self.names[whom + victim],
                limb=LIMBS[s],
                part=part,
                speed=float(np.linalg.norm(met.velocity)),
                place=events.place(met.place),
                time=(self.frame - 1 + met.share) / self.fps,
                blocked=part in ARMS and not bool(mine.armed[s]),
                blow=blow,
                attack=None if coming is None else coming.number,
            )
        )
        joint = int(other.body.joint[met.part])
        other.cast.strike(victim, joint, met.place, RECOIL * met.velocity)

    def _end_blows(self) -> None:
        """Blows that are over: whoever has not been met has avoided them, and may strike back."""
        now = self.frame / self.fps
        for key, coming in list(self._coming.items()):
            if coming.blow.attack.when[-1] > now + 1e-9:
                continue
            del self._coming[key]
            self.side.forget(coming.number)
            if not coming.landed:
                attacker = self.names[self._dodgers_count + coming.blow.who]
                self.events.append(
                    Avoided(
                        self.frame,
                        self.names[coming.at],
                        attack=coming.number,
                        attacker=attacker,
                    )
                )
                if self._counters:
                    self._counters[coming.at].avoided(now)


def _shared(skeletons: Sequence[Skeleton]) -> tuple[Skeleton, list[np.ndarray]]:
    """A skeleton for all, with a sword if any has one, and the joints of each in it.

    Errors: bodies that differ in more than a sword.
    """
    largest = max(skeletons, key=len)
    rows = []
    for one in skeletons:
        own = [n for n in largest.names if n in one.names]
        more = [n for n in largest.names if n not in one.names]
        sword = [largest.names[largest.roles[SWORD]]] if SWORD in largest.roles else []
        same = own == list(one.names) and more in ([], sword)
        at = np.array([largest.names.index(n) for n in own], dtype=np.int64)
        if not same or not np.allclose(largest.offsets[at], one.offsets, atol=1e-6):
            raise KumiteError(
                "the libraries of those who avoid and of those who attack are of different "
                "bodies; expected one body, with a sword or without"
            )
        rows.append(at)
    return largest, rows
