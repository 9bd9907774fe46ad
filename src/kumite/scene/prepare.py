"""A scene of people who prepare for what they will do on the way to it (Shum et al. 2013)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from kumite.body import lay_body
from kumite.clip import LIMBS
from kumite.control.guide import learned_guide, seen
from kumite.control.preparation import PreparationSettings
from kumite.control.tuning import Tunable, find
from kumite.errors import KumiteError, unknown
from kumite.graph import Layer, Library
from kumite.graph.kinds import suited
from kumite.graph.preparing import Preparing
from kumite.kernels.blow import NO_BLOW, swept_contact
from kumite.rotation import rotate
from kumite.scene import events
from kumite.scene.balls import capsules_of
from kumite.scene.controls import CURVE, REST, tunable
from kumite.scene.doors import check_scene
from kumite.scene.events import Event, Hit, MovedGoal, Passed, Strike, Touched
from kumite.scene.floor import TARGET_PARTS
from kumite.scene.memory import refuse_too_many
from kumite.scene.opponents import NOBODY, Opponents, blows_at, closing_in
from kumite.scene.settings_prepare import PrepareSettings
from kumite.scene.stage import Offers, SceneObject
from kumite.scene.starts import stream
from kumite.scene.things import STRIKE, Things, fitting
from kumite.scene.walkers import ARRIVED, NOTHING, ON_THE_WAY, Walkers
from kumite.synthesis.preparation import curves

NO_THING = -1
ROOM = 0.5  # m between two pelvises under which people give way to each other
APART = 1.0  # m, the same of two opponents
GIVE_WAY = 0.4  # m/s at which they do
STRUCK_AROUND = 0.12  # s around its contact in which a blow may land
NOTICED = 4.0  # m within which a thing ahead is prepared for by who is led by hand …
AHEAD = np.radians(75)  # … so far to either side
MARGIN = 0.5  # m: what is nearer than that is as likely as what is there
CONVINCED, FORGETS = 12.0, 0.5  # 1/s, how fast a heading convinces, and how fast that is forgotten
PATIENCE = 5.0  # s without getting nearer to where the hand sent it, then it goes its own way


class PrepareScene:
    """Walkers, things and opponents, one frame at a step. The same seed gives the same frames.

    Follows the :class:`~kumite.scene.stage.Stage` protocol, so the studio can show it.
    """

    def __init__(
        self,
        settings,
        library: Library | Layer,
        *,
        seed: int = 0,
        cache: Path | None = None,
        learning: PreparationSettings | None = None,
        progress: Callable[[int, float], None] = lambda batch, changed: None,
    ) -> None:
        """learning: how the approach is learned, :func:`~kumite.control.gradual` by default.

        Errors: another kind of library; motions that it does not have; obstacles that these do
        not clear; somebody who begins in an obstacle; too many characters."""
        library = check_scene(settings, library, seed, "preparation")
        if library.preparing is None:
            raise KumiteError(
                f"{settings.title!r} is about preparation; expected a library built with "
                "'kumite build --layer preparation'"
            )
        self.settings, self.library, self.title = settings, library, settings.title
        self.preparing: Preparing = library.preparing
        self.fps, self.skeleton = library.clips.fps, library.clips.skeleton
        self.prepare = settings.prepare or PrepareSettings()
        self.names = settings.names
        self.users = len(settings.walking)
        refuse_too_many(len(self.names), len(self.skeleton))
        self.motions = library.preparing.hierarchy.targets.label
        self.suited = suited(library)
        self._choose_kinds()
        self.things = Things(settings.targets, self.preparing, self._draw_motions(seed))
        for w in settings.walking:
            within = self.things.inside(np.array(w.position))
            if within is not None:
                raise KumiteError(
                    f"position of {w.name}: it begins in {self.things.names[within]}; "
                    "expected a place that is free"
                )
        self.body = lay_body(self.skeleton)
        self._blow = blows_of(library)
        self._tips = [self.skeleton.tip(limb) for limb in LIMBS]
        self._trunk = [i for i, part in enumerate(self.body.parts) if part in TARGET_PARTS[:4]]
        self.curve = self._curves()
        self.guide = learned_guide(
            library,
            cache,
            self.curve[:, 0],
            gaits=self.prepare.gaits or None,
            levels=self.prepare.preparation != "none",
            settings=learning,
            progress=progress,
        )
        self.automatic = self.prepare.automatic
        self.reset(seed)

    def _choose_kinds(self) -> None:
        """The target motions that suit each thing, and those that may be done to opponents."""
        settings, of = self.settings, self.suited
        foes = settings.opponents
        words = [*(t.kind for t in settings.targets), *(foes.motions if foes else ())]
        self._fits = [fitting(t, of) for t in settings.targets]
        self._blows = blows_at(foes, of) if foes else ()
        of.refuse_without(words, self.title)
        for word in self.prepare.curves:
            of.meant(word, "prepare.curves")

    def _draw_motions(self, seed: int) -> np.ndarray:
        """What is done at each thing [N]: of a size that is told what fits it best, else one of
        those that suit it, by the thing's own luck."""
        out = np.zeros(len(self._fits), dtype=np.int64)
        for n, (thing, fits) in enumerate(zip(self.settings.targets, self._fits)):
            drawn = 0 if thing.height is not None else _thing_stream(seed, n).integers(len(fits))
            out[n] = fits[int(drawn)]
        return out

    def _curves(self) -> np.ndarray:
        """Constants C [T, J] of the target motions: of all, then of their kinds, then by label."""
        p, of = self.prepare, self.suited
        if p.preparation != "ours":
            return np.ones((len(self.motions), len(self.skeleton)))
        rows = []
        for t, label in enumerate(self.motions):
            told = dict(p.curve)
            for word in (*reversed(of.kinds_of(t)), label):
                told |= p.curves.get(word, {})
            rows.append(curves(self.skeleton, told))
        return np.array(rows)

    def reset(self, seed: int, events: list[Event] | None = None) -> None:
        """Start again from the beginning, with a seed. events: where to tell them; by default a
        list of its own."""
        self.seed, self.frame = int(seed), 0
        self.events = [] if events is None else events
        self.things = Things(self.settings.targets, self.preparing, self._draw_motions(self.seed))
        walking, foes = self.settings.walking, self.settings.opponents
        streams = [stream(self.seed, k) for k in range(len(self.names))]
        homes = [[*w.position, np.radians(w.yaw_deg)] for w in walking]
        if foes:
            middle = np.mean([w.position for w in walking], axis=0)
            homes += closing_in(foes, middle, streams[self.users :]).tolist()
        homes = [self._scattered(home, rng) for home, rng in zip(homes, streams)]
        self.walkers = Walkers(
            self.guide,
            self.names,
            np.array(homes),
            self.events.append,
            streams,
            preparation=self.prepare.preparation,
            curve=self.curve,
        )
        count = len(homes)
        self.thing = np.full(count, NO_THING)  # what each goes to
        self.pushed = np.zeros((count, 2))  # m by which others have carried each away
        self.opponents = Opponents(foes, self.walkers, self.users, self._blows, streams)
        self.told = np.full((count, 2), np.nan)  # m: or where, by hand
        self._nearest = np.full(count, np.inf)  # m that it has come to there …
        self._nearer_at = np.zeros(count, dtype=np.int64)  # … in this frame
        # How likely each thing is what somebody who is led by hand makes for.
        self.belief = np.zeros((count, len(self.things)))
        self.turn = np.zeros(count, dtype=np.int64)  # how far each is in its course
        self._landed = np.zeros(count, dtype=bool)
        self._depth = np.full(count, -np.inf)  # m, deepest in the obstacle that it passes
        self._at = np.full(count, NO_THING)  # the thing that a target motion is done at
        self._whom = np.full(count, NOBODY)
        self._busy = np.zeros(count, dtype=bool)
        self._course = [
            [self.things.names.index(n) for n in w.goes_to] for w in self.settings.walking
        ]

    def _scattered(self, home: list[float], rng: np.random.Generator) -> np.ndarray:
        """A facing frame [3] off ``home`` as far as the scene lets chance take it, never into an
        obstacle."""
        p = self.prepare
        spread = np.array([p.scatter, p.scatter, np.radians(p.scatter_deg)])
        off = rng.uniform(-1.0, 1.0, 3) * spread
        place = np.array(home) + off
        return np.array(home) if self.things.inside(place[:2]) is not None else place

    @property
    def cast(self):
        return self.walkers.cast

    @property
    def root_position(self) -> np.ndarray:
        return self.walkers.shown.root_position

    @property
    def wxyz(self) -> np.ndarray:
        return self.walkers.shown.wxyz

    @property
    def objects(self) -> list[SceneObject]:
        return self.things.objects

    def move_object(self, name: str, position: np.ndarray) -> None:
        """Balls may be put elsewhere; obstacles stay."""
        self.things.move(name, position)

    @property
    def tunables(self) -> list[Tunable]:
        """What may be tuned while it runs."""

        def curve_of(part: str) -> float:
            at = 0 if part == "legs" else self.skeleton.joint("head")
            told = self.prepare.curve.get(part)
            return float(curves(self.skeleton)[at] if told is None else told)

        def bend(part: str, value: float) -> None:
            told = {**self.prepare.curve, part: value}
            self.prepare = self.prepare.model_copy(update={"curve": told})
            self.curve[:] = self._curves()

        out = []
        if self.prepare.preparation == "ours":
            out += [
                tunable(
                    spec,
                    "",
                    "prepare",
                    f"prepare.curve.{spec.field}",
                    lambda part=spec.field: curve_of(part),
                    lambda value, part=spec.field: bend(part, value),
                )
                for spec in CURVE
            ]
        foes = self.settings.opponents
        if foes is not None:

            def rest(seconds: float) -> None:
                self.settings = self.settings.model_copy(
                    update={
                        "opponents": self.settings.opponents.model_copy(update={"rest": seconds})
                    }
                )
                self.opponents.settings = self.settings.opponents

            out.append(
                tunable(
                    REST,
                    "",
                    "world",
                    "opponents.rest",
                    lambda: float(self.settings.opponents.rest),
                    rest,
                )
            )
        return out

    def tunable(self, name: str) -> Tunable:
        """One of them by name. Errors: there is none such."""
        return find(self.tunables, name)

    @property
    def offers(self) -> Offers:
        from kumite.scene.leading import Walks

        return Offers(
            led=Walks(self, range(self.users)),
            tunables=tuple(self.tunables),
            counts=("errands",),
            seen="behind",
            yaw=float(self.walkers.facing[0, 2]),
        )

    # What may be told by hand.

    def go(self, k: int, place: np.ndarray) -> np.ndarray:
        """Send walker k to a place [2] m of the ground; where it really goes: out of an obstacle to
        the nearer side of it. Who goes by itself does so again when it is there, or has not come
        nearer for 5 s; so does who has opponents.
        """
        place = np.array(place, dtype=np.float64)
        if not np.all(np.isfinite(place)):
            raise KumiteError("goal: expected two finite numbers")
        within = self.things.inside(place)
        if within is not None:
            yaw = self.things.yaw[within]
            way = np.array([np.sin(yaw), np.cos(yaw)])
            along = (place - self.things.position[within, [0, 2]]) @ way
            place = place + ((0.6 if along >= 0 else -0.6) - along) * way
            self.events.append(
                MovedGoal(self.frame, self.names[k], thing=self.things.names[within])
            )
        self.told[k], self.thing[k] = place, NO_THING
        self._nearest[k], self._nearer_at[k] = np.inf, self.frame
        self.walkers.decide_anew(np.array([k]))
        return place

    def go_to(self, k: int, name: str) -> None:
        """Send walker k to a thing. Errors: there is none of that name."""
        if name not in self.things.names:
            raise unknown("thing", name, self.things.names)
        self.thing[k], self.told[k] = self.things.names.index(name), np.nan
        self.walkers.decide_anew(np.array([k]))

    def let_go(self, k: int) -> None:
        """Walker k is no longer sent anywhere: it stays, or goes by itself."""
        self.thing[k], self.told[k] = NO_THING, np.nan
        self.walkers.decide_anew(np.array([k]))

    def trigger(self, k: int, motion: str) -> bool:
        """Let walker k do a target motion now, by its label, or one of a kind: that which it
        prepares for, else the best of it; False while it does another. It is bent to meet what is
        at hand for it, if anything is. Errors: there is none of that name or kind.
        """
        which = self.suited.meant(motion, "trigger")
        self.suited.refuse_without([motion], self.title)
        if self.walkers.doing[k] != ON_THE_WAY:
            return False
        wants = int(self.walkers.wants[k])
        t = wants if wants in which else int(which[0])
        fits = wants == t and self._aimed(k)
        self._launch(k, t, bend=fits)
        return True

    # A frame.

    def step(self) -> bool:
        w = self.walkers
        self._assign()
        self._aim()
        for k in w.ready().tolist():
            if self.automatic and k < self.users and self._aimed(k):
                self._launch(k, int(w.wants[k]), bend=True)
        self._keep_apart()
        w.advance()
        self.frame += 1
        self._contacts()
        self.things.step(1.0 / self.fps)
        return True

    def _assign(self) -> None:
        """Who goes where by itself."""
        w, things = self.walkers, self.things
        if self.automatic or self.settings.opponents:
            self._hand_back()
        self.opponents.assign(self.frame)
        if not self.automatic or len(things) == 0:
            return
        free = (self.thing[: self.users] == NO_THING) & np.isnan(self.told[: self.users, 0])
        for k in np.flatnonzero(free).tolist():
            if self._course[k]:
                self.thing[k] = self._course[k][self.turn[k] % len(self._course[k])]
            else:
                away = np.hypot(*(things.position[:, [0, 2]] - w.facing[k, :2]).T)
                away[~things.lie] = np.inf
                if np.isfinite(away.min()):
                    self.thing[k] = int(np.argmin(away))
            w.decide_anew(np.array([k]))

    def _hand_back(self) -> None:
        """Who has come to where the hand sent it, or comes no nearer, is led no longer."""
        w = self.walkers
        led = np.flatnonzero(np.isfinite(self.told[:, 0]))
        away = np.hypot(*(self.told[led] - w.facing[led, :2]).T)
        nearer = (away < self._nearest[led] - 0.05) | (w.doing[led] != ON_THE_WAY)
        self._nearer_at[led[nearer]] = self.frame
        self._nearest[led[nearer]] = away[nearer]
        stuck = self.frame - self._nearer_at[led] > PATIENCE * self.fps
        for k in led[(away < ARRIVED) | stuck].tolist():
            self.let_go(k)

    def _aim(self) -> None:
        """Goals, sources of influence and what is prepared for, of all."""
        w = self.walkers
        w.mix[:] = 0.0
        place, normal = self._objects_of(np.arange(len(self.names)))
        has = np.isfinite(place[:, 0])
        wants = np.full(len(has), NOTHING)
        wants[self.thing >= 0] = self.things.motion[self.thing[self.thing >= 0]]
        wants = np.where(self.opponents.foe != NOBODY, self.opponents.to_do, wants)
        w.heeds[:] = has & np.isnan(self.told[:, 0])
        busy = np.flatnonzero((w.doing != ON_THE_WAY) & (self._whom != NOBODY))
        for k in busy.tolist():
            left = (self.preparing.contact[w.doing[k]] - w.cast.frame[k]) / self.fps
            if left > 0:
                w.aim(k, self.opponents.place(k, int(self._whom[k]), int(w.doing[k]), left))
        who = np.flatnonzero(has)
        if len(who):
            w.goal[who] = w.stance(wants[who], place[who], w.facing[who], normal[who])
            w.source[who] = place[who][:, [0, 2]]
        led = np.flatnonzero(np.isfinite(self.told[:, 0]))
        for k in led.tolist():
            w.goal[k] = [*self.told[k], np.nan]
            wants[k] = self._notice(k)
        rest = np.flatnonzero(~has & np.isnan(self.told[:, 0]))
        if not self.automatic:
            for k in rest[rest < self.users].tolist():
                w.goal[k] = [*w.facing[k, :2], np.nan]
                wants[k] = self._notice(k)
        for k in rest[rest >= self.users].tolist():
            w.goal[k] = self.opponents.goal(k, self.frame)
        changed = np.flatnonzero(wants != w.wants)
        w.wants[:] = wants
        w.decide_anew(changed)

    def _notice(self, k: int) -> int:
        """The motion for what walker k, led by hand, seems to make for; or for nothing.

        What that is nobody says: it is a belief over all things ahead, told by distance at first
        and by where k heads then. The likeliest is the source of influence, and k prepares for all,
        as far as each is likely (what section 8 of the paper asks for).
        """
        w, things = self.walkers, self.things
        if self.opponents.foe[k] != NOBODY:
            w.source[k] = w.facing[self.opponents.foe[k], :2]
            return int(self.opponents.to_do[k])
        if len(things) == 0:
            return NOTHING
        here = np.tile(w.facing[k], (len(things), 1))
        away, aside = seen(here, things.position[:, [0, 2]])
        near = (np.abs(aside) < AHEAD) & (away < NOTICED)
        if not np.any(near):
            self.belief[k] = 0.0
            return NOTHING
        prior = np.where(near, 1.0 / (MARGIN + away), 0.0)
        prior /= prior.sum()
        # Nobody heads far aside of where he goes: a step of Bayes' rule, and a little forgetting.
        likely = np.exp((np.cos(aside) - 1.0) * CONVINCED / self.fps)
        known = np.where(self.belief[k] > 0.0, self.belief[k], prior)  # of what comes into view
        now = np.where(near, known, 0.0) * likely
        now /= now.sum()
        self.belief[k] = now + (prior - now) * FORGETS / self.fps
        n = int(np.argmax(self.belief[k]))
        np.add.at(w.mix[k], things.motion, self.belief[k])
        w.source[k] = things.position[n, [0, 2]]
        return int(things.motion[n])

    def _objects_of(self, who: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where the objects [N, 3] are that characters go to, and which way through [N]; NaN."""
        w = self.walkers
        place, normal = np.full((len(who), 3), np.nan), np.full(len(who), np.nan)
        at = np.flatnonzero(self.thing[who] >= 0)
        if len(at):
            k = who[at]
            place[at], normal[at] = self.things.gates(w.facing[k], self.thing[k])
        for n in np.flatnonzero(self.opponents.foe[who] != NOBODY).tolist():
            k = int(who[n])
            t = int(self.opponents.to_do[k])
            seconds = float(w.seconds_to_contact(np.array([t]))[0])
            place[n] = self.opponents.place(k, int(self.opponents.foe[k]), t, seconds)
        return place, normal

    def _aimed(self, k: int) -> bool:
        return bool(self.thing[k] >= 0 or self.opponents.foe[k] != NOBODY)

    def _launch(self, k: int, t: int, *, bend: bool) -> None:
        place, normal = self._objects_of(np.array([k]))
        meets = bend and bool(np.isfinite(place[0, 0]))
        self.walkers.launch(k, t, place[0] if meets else None, float(normal[0]))
        self._landed[k], self._depth[k] = False, -np.inf
        self._at[k] = self.thing[k] if meets else self._nearest_thing(k, t)
        self._whom[k] = self.opponents.foe[k]
        limb = int(self.preparing.limb[t])
        if limb >= 0:
            self.events.append(self._thrown(k, t))

    def _thrown(self, k: int, t: int) -> Strike:
        """Character k throws the blow of target t."""
        limb, blow, who = int(self.preparing.limb[t]), int(self._blow[t]), self.names[k]
        if blow == NO_BLOW:
            return Strike(self.frame, who, limb=LIMBS[limb])
        return events.strike(self.frame, who, limb, blow, self.library.strikes)

    def _nearest_thing(self, k: int, t: int) -> int:
        """The thing that a motion launched by hand may meet."""
        fits = self.things.motion == t
        if not np.any(fits):
            return NO_THING
        ground = self.things.position[:, [0, 2]]
        away = np.hypot(*(ground - self.walkers.facing[k, :2]).T)
        n = int(np.argmin(np.where(fits, away, np.inf)))
        return n if away[n] < NOTICED else NO_THING

    def _keep_apart(self) -> None:
        """People give way to each other."""
        w = self.walkers
        w.push[:] = self.pushed
        self.pushed[:] = 0.0
        if len(self.names) < 2:
            return
        ground = w.shown.root_position[:, [0, 2]]
        for a, b in KDTree(ground).query_pairs(APART, output_type="ndarray").tolist():
            way = ground[b] - ground[a]
            away = max(float(np.hypot(*way)), 1e-6)
            room = APART if min(a, b) >= self.users else ROOM
            push = np.clip(0.5 * (room - away), 0.0, GIVE_WAY / self.fps) * way / away
            w.push[a] -= push
            w.push[b] += push

    def _contacts(self) -> None:
        """What target motions meet in this frame."""
        w, p = self.walkers, self.preparing
        busy = w.doing != ON_THE_WAY
        over = np.flatnonzero(self._busy & ~busy)
        self._busy = busy
        for k in over.tolist():
            self._finish(k)
        around = STRUCK_AROUND * self.fps
        for k in np.flatnonzero(busy).tolist():
            t = int(w.doing[k])
            late = w.cast.frame[k] - p.contact[t]
            if p.kind[t] != STRIKE:
                self._pass(k, int(self._at[k]))
            elif abs(late) <= around and not self._landed[k]:
                self._strike(k, t)
            if w.cast.frame[k] >= p.past[t] and self.thing[k] == self._at[k]:
                self._next(k)

    def _next(self, k: int) -> None:
        """Walker k has done what was to be done at its thing: on to the next."""
        if self.thing[k] != NO_THING:
            course = self._course[k] if k < self.users else ()
            # What it was sent to by hand is not its turn.
            self.turn[k] += bool(course and self.thing[k] == course[self.turn[k] % len(course)])
            self.thing[k] = NO_THING
        self.opponents.forget(k)

    def _finish(self, k: int) -> None:
        n = int(self._at[k])
        if self._depth[k] > -np.inf and n != NO_THING:
            thing, clearance = self.things.names[n], -float(self._depth[k])
            self.events.append(Passed(self.frame, self.names[k], thing=thing, clearance=clearance))
        if n != NO_THING and self.thing[k] == n:  # some motions end as soon as they are past it
            self._next(k)
        self._at[k], self._whom[k] = NO_THING, NOBODY

    def _pass(self, k: int, n: int) -> None:
        if n == NO_THING:
            return
        w = self.walkers
        off = np.hypot(*(self.things.position[n, [0, 2]] - w.facing[k, :2]))
        if off > 1.5 + 0.5 * self.things.width[n]:
            return
        shown = w.shown
        capsules = capsules_of(self.body, shown.position[k : k + 1], shown.world_wxyz[k : k + 1])
        depth, part = self.things.depth(n, capsules[:, 0], self.body)
        if depth > 0 >= self._depth[k]:
            thing, part = self.things.names[n], self.body.parts[part]
            self.events.append(Touched(self.frame, self.names[k], thing=thing, part=part))
        self._depth[k] = max(self._depth[k], depth)

    def _tip_now(self, k: int, limb: int, pose: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        joint, offset = self._tips[limb]
        position, world = pose
        return position[k, joint] + rotate(world[k, joint], offset)

    def _strike(self, k: int, t: int) -> None:
        """Does the blow of target t land in this frame?"""
        w, limb = self.walkers, int(self.preparing.limb[t])
        before, now = w.shown_before, (w.shown.position, w.shown.world_wxyz)
        p0, p1 = (self._tip_now(k, limb, pose) for pose in (before, now))
        velocity = (p1 - p0) * self.fps
        n, foe = int(self._at[k]), int(self._whom[k])
        if n != NO_THING:
            at, r = self.things.position[n], float(self.things.radius[n])
            when = swept_contact(p0, p1, at, at, at, at, r, r, 0.03)
            if when >= 0:
                self.things.kick(n, velocity)
                thing = self.things.names[n]
                self._hit(k, t, thing, thing, velocity, p0 + when * (p1 - p0), when)
        elif foe != NOBODY:
            body = self.body
            a, b = (
                capsules_of(body, x[0][foe : foe + 1], x[1][foe : foe + 1])[:, 0]
                for x in (before, now)
            )
            best = (2.0, 0)
            for part in self._trunk:
                when = swept_contact(
                    p0, p1, a[0, part], a[1, part], b[0, part], b[1, part],
                    body.radius_start[part], body.radius_end[part], 0.03,
                )  # fmt: skip
                if 0.0 <= when < best[0]:
                    best = (when, part)
            if best[0] <= 1.0:
                when, part = best
                joint, place = int(body.joint[part]), p0 + when * (p1 - p0)
                self._hit(k, t, self.names[foe], body.parts[part], velocity, place, when)
                self.opponents.reel(foe, joint, place, velocity, self.frame)

    def _hit(
        self,
        k: int,
        t: int,
        victim: str,
        part: str,
        velocity: np.ndarray,
        place: np.ndarray,
        share: float,
    ) -> None:
        """The blow of target t lands, within the last frame."""
        self._landed[k] = True
        thrown = self._thrown(k, t)
        self.events.append(
            Hit(
                self.frame,
                thrown.character,
                victim=victim,
                limb=thrown.limb,
                part=part,
                speed=float(np.linalg.norm(velocity)),
                place=events.place(place),
                time=(self.frame - 1 + share) / self.fps,
                blocked=False,
                blow=thrown.blow,
            )
        )


def _thing_stream(seed: int, n: int) -> np.random.Generator:
    """What thing n draws from: none of the characters' streams."""
    return np.random.default_rng([seed, n, 1])


def blows_of(library: Layer) -> np.ndarray:
    """The blow [T] of each target motion, a row of the library's strikes, or NO_BLOW: the one of
    its limb that is nearest to its contact.
    """
    p, strikes = library.preparing, library.strikes
    assert p is not None
    out = np.full(len(p.limb), NO_BLOW)
    for t, (limb, contact) in enumerate(zip(p.limb.tolist(), p.contact.tolist())):
        off = np.where(strikes.limb == limb, np.abs(strikes.frame - contact), np.inf)
        if len(off) and off.min() <= STRUCK_AROUND * library.clips.fps:
            out[t] = int(np.argmin(off))
    return out
