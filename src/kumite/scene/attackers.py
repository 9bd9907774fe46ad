"""Those who attack by their policies, and make up their minds an action ahead.

So their motion is known to the end of the action after the present one: blows in it become attacks
that somebody may see coming and avoid, as balls in flight are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kumite.body import Body, Spheres, limb_spheres, strikes_with
from kumite.clip import LIMBS, forward_kinematics
from kumite.control import Fighters, Skill, approach, stretch_tracks, strike, trained
from kumite.control.attack import Attack, from_limbs
from kumite.control.protocol import Plain, View
from kumite.errors import KumiteError
from kumite.graph import Layer
from kumite.kernels.blow import NO_BLOW
from kumite.rotation import planar_apply, planar_inverse, rotate, wrap_angle
from kumite.scene.events import Decision
from kumite.scene.recording import Recording
from kumite.scene.settings_dodge import AttackerSettings
from kumite.synthesis import Cast

FORESEEN = 600  # frames that may be known ahead at most


@dataclass(frozen=True)
class Blow:
    """A blow that is going to be thrown."""

    who: int
    limb: int  # index into clip.LIMBS
    blow: int  # of the library's strikes
    attack: Attack


def skill_of(
    library: Layer,
    cache: Path | None,
    progress: Callable[[str, int, float], None] = lambda name, sweep, residual: None,
) -> Skill:
    """Policies that bring blows to a target. Errors: nobody in the library can strike."""
    tracks = stretch_tracks(library) if len(library.strikes) else None
    if tracks is None or len(tracks.tip) == 0:
        raise KumiteError("the attackers' library holds no blows in its graph: nobody can strike")
    policies = [
        trained(library, b, cache, progress=progress) for b in (approach(), strike(library))
    ]
    return Skill(library, policies[0], policies[1], tracks)


class Attackers(Plain):
    """A characters who attack, as a cast of their own library, and the controller of them all."""

    name = "policy"

    def __init__(self, skill: Skill, settings: Sequence[AttackerSettings]) -> None:
        """They take their places by :meth:`place`."""
        self.skill, self.library, self._settings = skill, skill.library, settings
        self.fps = self.library.clips.fps
        self._alone = Cast(self.library, 1)
        skeleton = self.library.clips.skeleton
        self._spheres = [limb_spheres(skeleton, strikes_with(skeleton, limb)) for limb in LIMBS]

    def place(self, seed: int) -> None:
        """Everybody takes their place, with a seed."""
        settings = self._settings
        self.cast = Cast(self.library, len(settings))
        self.fighters = Fighters(self.skill, [s.temper() for s in settings], seed)
        rng = np.random.default_rng([seed, 2])
        # Everyone starts in a state with many ways out: the usual guard, not the end of a blow.
        ways = np.diff(self.library.table.action_start)
        common = np.flatnonzero(ways >= np.quantile(ways, 0.75))
        for k, s in enumerate(settings):
            facing = np.array([*s.position, np.radians(s.yaw_deg)])
            self.cast.place(k, int(rng.choice(common)), facing)
        self.cast.show(0.0)
        self.next = np.full(len(settings), -1)  # [A] the stretch that each takes next, -1: any
        self._known: dict[tuple[int, int, int], int] = {}  # blows told of -> frames of them

    def decide(
        self, k: int, target: np.ndarray, bodies: np.ndarray, frame: int, name: str
    ) -> Decision:
        """What character k, of a name, does after its present action.

        target [H, 4]: where what it aims at is expected then, and the way that faces; bodies
        [O, H, 2]: roots to keep off, both in the scene; frame: of the scene, now.
        """
        cast, table = self.cast, self.library.table
        here = cast.facing_at(cast.stop)[k]
        to_here = planar_inverse(here)
        seen = np.column_stack(
            [planar_apply(to_here, target[:, :3]), wrap_angle(target[:, 3] - here[2])]
        )
        flat = np.stack([bodies[..., 0], np.zeros(bodies.shape[:2]), bodies[..., 1]], axis=-1)
        others = np.ascontiguousarray(planar_apply(to_here, flat)[..., [0, 2]])
        state = int(np.searchsorted(table.state_frame, cast.stop[k]))
        self.next[k] = self.fighters.pick(k, state, seen, others)
        stretch, choices = int(self.next[k]), self.fighters.choices
        return Decision(
            frame,
            name,
            by="policy",
            state=state,
            stretch=stretch,
            worth=float(choices.worth[k]),
            considered=int(choices.considered[k]),
            apart=int(choices.apart[k]),
            jump=bool(table.first[stretch] != cast.stop[k] + 1),
        )

    def choose(self, view: View) -> int:
        """What was decided on, an action ago."""
        return view.spans.span(self.library.name, int(self.next[view.me]))

    def foresee(self, k: int, frame: int) -> list[Blow]:
        """Blows of character k that have not been told of, or of which more is known than was.

        frame: of the scene, now.
        """
        cast, table, s = self.cast, self.library.table, int(self.next[k])
        roots, turns = cast.foresee(k, FORESEEN, self._alone, (s,))
        shown = np.concatenate(
            [
                np.arange(int(cast.frame[k]) + 1, int(cast.stop[k]) + 1),
                np.arange(int(table.first[s]), int(table.last[s]) + 1),
            ]
        )[: len(roots)]
        when = (frame + 1 + np.arange(len(roots))) / self.fps
        thrown = cast.played.blow_of_frame[shown]
        out = []
        for limb, blow, first, stop in _runs(thrown):
            begins = frame + 1 + first
            if self._known.get((k, limb, blow), -1) == frame + 1 + stop:
                continue
            self._known[k, limb, blow] = frame + 1 + stop
            span = slice(first, stop)
            name = f"{LIMBS[limb]} at {begins / self.fps:.2f} s"
            attack = from_limbs(
                self.library.clips.skeleton, roots[span], turns[span], when[span], LIMBS[limb],
                spheres=self._spheres[limb], name=name,
            )  # fmt: skip
            out.append(Blow(k, limb, blow, attack))
        return out

    def known(self, k: int) -> float:
        """For how long [s] from now it is known what character k does."""
        left = int(self.cast.stop[k]) - int(self.cast.frame[k])
        return (left + int(self.library.table.duration[self.next[k]])) / self.fps

    def parts_ahead(self, k: int, body: Body, rows: Sequence[int]) -> np.ndarray:
        """Where the middles of parts of character k's body will be [T, M, 3] m: now, and at the
        frames to come as far as they are known.
        """
        roots, turns = self.cast.foresee(k, FORESEEN, self._alone, (int(self.next[k]),))
        roots = np.concatenate([self.cast.root_position[k, None], roots])
        turns = np.concatenate([self.cast.wxyz[k, None], turns])
        position, world = forward_kinematics(self.library.clips.skeleton, roots, turns)
        joint, middle = body.joint[rows], 0.5 * (body.start[rows] + body.end[rows])
        return position[:, joint] + rotate(world[:, joint], middle)


def _runs(thrown: np.ndarray) -> list[tuple[int, int, int, int]]:
    """Runs of one blow in thrown [T, 4]: limb, blow, first frame and one past the last."""
    out = []
    for limb in range(thrown.shape[1]):
        row = thrown[:, limb]
        cut = np.flatnonzero(np.diff(row)) + 1
        for a, b in zip([0, *cut.tolist()], [*cut.tolist(), len(row)]):
            if b > a and row[a] != NO_BLOW:
                out.append((limb, int(row[a]), a, b))
    return out


def middle_of(library: Layer, body: Body, part: str) -> np.ndarray:
    """Where the middle of a part is [F, 3] at every frame of a library, in its world."""
    position, world = library.clips.world
    p = body.part(part)
    joint, middle = int(body.joint[p]), 0.5 * (body.start[p] + body.end[p])
    return position[:, joint] + rotate(world[:, joint], middle)


def recorded_attack(
    recording: Recording,
    name: str,
    limb: str,
    begin: float = 0.0,
    end: float = np.inf,
    *,
    spheres: Spheres | None = None,
) -> Attack:
    """What a character's limb, or its ``sword``, sweeps through in a recording from ``begin`` to
    ``end`` [s]; the recording's times. Errors: nobody of that name; no frames then.
    """
    k = recording.character(name)
    first = max(int(np.ceil(begin * recording.fps - 1e-9)), 0)
    stop = int(min(np.floor(end * recording.fps + 1e-9) + 1, len(recording)))
    if stop <= first:
        raise KumiteError(
            f"{recording.scene}: nothing from {begin:g} to {end:g} s; expected some of the "
            f"{recording.seconds:g} s that were recorded"
        )
    return from_limbs(
        recording.skeleton,
        recording.root_position[first:stop, k],
        recording.wxyz[first:stop, k],
        np.arange(first, stop) / recording.fps,
        limb,
        spheres=spheres,
        name=f"{name}'s {limb}",
    )
