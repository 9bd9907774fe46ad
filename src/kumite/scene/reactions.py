"""What a blow does to a fighter (Shum et al. 2012, section VII): a moment of physics, then capture.

In the frame in which a blow lands all is worked out at once: where physics takes the body in the
next fifth of a second while it tries to go on with what it was doing, and the captured response
that fits best from there. Then those poses are shown frame by frame, and the response is entered.
So from the hit on it is known what the victim does and when it chooses again; the game tree, which
cannot run physics at every node, expects the response of :attr:`GameTree.response` in its place.

Without physics the struck segment gives way and the response that the tree expects begins at once.
Whoever reacts does so at the captured speed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kumite.clip import LIMBS, SIDES, forward_kinematics
from kumite.control.game_tree import GameTree
from kumite.errors import KumiteError
from kumite.kernels.moves import FALL, NOTHING
from kumite.scene import events
from kumite.scene.floor import Floor, Landing
from kumite.synthesis import (
    EFFECTIVE_MASS,
    Cast,
    Moment,
    Pushed,
    Ragdoll,
    Responses,
    blow_impulse,
    find_responses,
    has_physics,
)
from kumite.synthesis.recoil import RECOIL
from kumite.synthesis.response import SIZES

SECONDS = 0.2  # of physics after a blow
MOST_PHYSICAL = 8  # fighters up to which "auto" is physical: a push takes 30 to 40 ms
HURRY = 3.0  # cost of a second more of a response: nobody shall stand there and be struck for long


@dataclass(frozen=True)
class Answer:
    """What a fighter does about a blow."""

    stretch: int  # of the action table
    begun: bool  # already by a moment of physics; otherwise it is to be begun now
    action: str  # its label
    size: str
    physical: bool
    impulse: float  # N s that the body takes up
    deviation: float | None  # m, greatest, mean of all joints, by physics

    def told(self, frame: int, who: str) -> events.Reaction:
        """For the log."""
        return events.Reaction(
            frame,
            who,
            action=self.action,
            stretch=self.stretch,
            size=self.size,
            physical=self.physical,
            impulse=self.impulse,
            deviation=self.deviation,
        )


@dataclass
class _Physical:
    """A moment of physics that is being shown, and the response that follows."""

    pushed: Pushed
    ankles: np.ndarray  # [T, 2, 3] m
    planted: np.ndarray  # [2] bool
    from_anchor: np.ndarray  # [2] m, where the anchor lay when the blow landed
    first: int  # library frame before the response's first
    entry: int  # library frame of the response that the last pose comes to
    last: int
    shown: int = 0  # poses so far

    @property
    def left(self) -> int:
        return len(self.ankles) - self.shown


class Reactions:
    """The reactions of all fighters of a scene. The same blows give the same bytes."""

    def __init__(self, tree: GameTree, count: int, mode: str = "auto") -> None:
        """mode: "physical", "kinematic" or "auto", physical where MuJoCo is there and fighters are
        few. Errors: physical without MuJoCo, or without a reaction among the actions.
        """
        self.tree = tree
        library = tree.library
        stretches = np.flatnonzero(np.array(tree.kinds) == "reaction")
        if mode == "physical" and len(stretches) == 0:
            raise KumiteError(
                "physical reactions end in a captured one; expected a reaction among the actions"
            )
        few = count <= MOST_PHYSICAL and len(stretches) > 0 and has_physics()
        self.physical = mode == "physical" or (mode == "auto" and few)
        self.late = np.zeros(count, dtype=np.int64)  # frames until what is shown is being played
        self._moments: dict[int, _Physical] = {}
        if self.physical:
            clips, table = library.clips, library.table
            spans = np.stack([table.first[stretches], table.last[stretches]], axis=1)
            self._stretch = stretches
            self._responses: Responses = find_responses(clips, spans)
            self._alone = Cast(library, 1)
            self._feet = [clips.skeleton.joint(f"{side}_foot") for side in SIDES]
            self._ragdoll: Ragdoll | None = None  # of the floor's bodies

    def start(self, floor: Floor) -> None:
        """Nobody has been struck yet."""
        self.floor = floor
        self._moments.clear()
        self.late[:] = 0
        self._before = (floor.cast.root_position.copy(), floor.cast.wxyz.copy())
        if self.physical and self._ragdoll is None:
            self._ragdoll = Ragdoll(floor.cast.library.clips.skeleton, floor.body, floor.fps)

    def advance(self) -> bool:
        """:meth:`Floor.advance`, in which those who were struck show what physics made of it."""
        cast = self.floor.cast
        self._before[0][:], self._before[1][:] = cast.root_position, cast.wxyz
        for k, moment in self._moments.items():
            self._show(k, moment)
        happened = self.floor.advance()
        for k in [k for k, moment in self._moments.items() if moment.left == 0]:
            self._enter(k, self._moments.pop(k))
        return happened

    def forget(self, k: int) -> None:
        """A fighter does something else from now on."""
        if self._moments.pop(k, None) is not None:
            self.floor.cast.held[k], self.late[k] = False, 0
        self.floor.cast.set_rate(k, 1.0)

    def react(self, landing: Landing, blocked: bool, falls: bool = False) -> Answer | None:
        """A blow has landed; a blocked one only moves the arm that it meets.

        falls: the victim is to fall, however light the blow.
        """
        tree, cast, body = self.tree, self.floor.cast, self.floor.body
        joint, limb = int(body.joint[landing.part]), LIMBS[landing.limb]
        if self.physical and not blocked:
            return self._push(landing, joint, limb, falls)
        cast.strike(landing.victim, joint, landing.place, RECOIL * landing.velocity)
        if blocked:
            return None
        speed = float(np.linalg.norm(landing.velocity))
        size = int(speed >= tree.rules.stagger_from)
        if falls or speed >= tree.rules.fall_from:
            size = FALL
        high = body.parts[landing.part] in ("head", "neck")
        response = int(tree.response[int(high), size])
        if response == NOTHING:
            return None
        impulse = blow_impulse(landing.velocity, limb)
        cast.set_rate(landing.victim, 1.0)
        return self._answer(response, SIZES[size], impulse, None)

    def _answer(
        self, stretch: int, size: str, impulse: np.ndarray, pushed: Pushed | None
    ) -> Answer:
        return Answer(
            stretch,
            pushed is not None,
            self.tree.labels[stretch],
            size,
            pushed is not None and pushed.physical,
            float(np.linalg.norm(impulse)),
            float(pushed.deviation.max()) if pushed else None,
        )

    # A moment of physics -------------------------------------------------------------------------

    def _push(self, landing: Landing, joint: int, limb: str, falls: bool) -> Answer:
        k, cast, rules = landing.victim, self.floor.cast, self.tree.rules
        assert self._ragdoll is not None  # start has made it
        mass = EFFECTIVE_MASS["foot" if limb.endswith("foot") else "hand"]
        planted = cast.contacts[k].copy()
        pushed = self._ragdoll.push(
            self._now(k),
            self._meant(k),
            planted,
            joint,
            landing.place,
            blow_impulse(landing.velocity, limb),
            SECONDS,
            striking_mass=mass,
        )
        entry, _ = self._responses.match(
            pushed.end,
            pushed.impulse,
            stagger_from=0.0 if falls else mass * rules.stagger_from,
            fall_from=0.0 if falls else mass * rules.fall_from,
            hurry=HURRY / self.floor.fps,
        )
        frame, last = int(self._responses.frame[entry]), int(self._responses.last[entry])
        stretch = int(self._stretch[self._responses.response[entry]])
        cast.set_rate(k, 1.0)
        cast.adopt(k, frame, last, pushed.end)  # whence it will be played: others may count on it
        position, _ = forward_kinematics(
            self.floor.cast.library.clips.skeleton, pushed.root_position, pushed.wxyz
        )
        self._moments[k] = moment = _Physical(
            pushed,
            position[:, self._feet],
            planted,
            cast.anchor[k, :2].copy(),
            int(self.tree.library.table.first[stretch]) - 1,
            frame,
            last,
        )
        cast.frame[k] = self._counted(k, moment)
        cast.held[k], cast.stands[k] = True, planted
        size = SIZES[self._responses.size[entry]]
        return self._answer(stretch, size, pushed.impulse, pushed)

    def _now(self, k: int) -> Moment:
        """The pose shown, and how it came there."""
        cast, (root, wxyz) = self.floor.cast, self._before
        return Moment.between(
            np.stack([root[k], cast.root_position[k]]),
            np.stack([wxyz[k], cast.wxyz[k]]),
            self.floor.fps,
        )

    def _meant(self, k: int) -> tuple[np.ndarray, np.ndarray]:
        """What a fighter would have shown next: roots [T, 3] and rotations [T, J, 4]."""
        moment = self._moments.get(k)
        if moment is None:
            frames = max(1, round(SECONDS * self.floor.fps))
            return self.floor.cast.foresee(k, frames, self._alone)
        pushed, i = moment.pushed, moment.shown
        return pushed.root_position[i:] + self._carried(k, moment), pushed.wxyz[i:]

    def _carried(self, k: int, moment: _Physical) -> np.ndarray:
        """How far [3] m other bodies have carried a fighter since it was struck."""
        way = self.floor.cast.anchor[k, :2] - moment.from_anchor
        return np.array([way[0], 0.0, way[1]])

    def _counted(self, k: int, moment: _Physical) -> int:
        """The library frame that counts as shown now, so that the response is entered in time.

        Where it would lie before the response, that is begun later than now: :attr:`late`.
        """
        frame = moment.entry - moment.left
        self.late[k] = max(moment.first - frame, 0)
        return frame + int(self.late[k])

    def _show(self, k: int, moment: _Physical) -> None:
        i = moment.shown
        moment.shown += 1
        carried = self._carried(k, moment)
        self.floor.cast.hold(
            k,
            self._counted(k, moment),
            moment.pushed.root_position[i] + carried,
            moment.pushed.wxyz[i],
            self._ankles(i, moment, carried),
            moment.planted,
        )

    def _ankles(self, i: int, moment: _Physical, carried: np.ndarray) -> np.ndarray:
        """Where the legs [2, 3] reach to: feet that stand are not carried away."""
        return moment.ankles[i] + np.where(moment.planted[:, None], 0.0, carried)

    def _enter(self, k: int, moment: _Physical) -> None:
        """The last pose is shown: from here on the response is played."""
        end, carried = moment.pushed.end, self._carried(k, moment)
        now = Moment(end.root_position + carried, end.wxyz, end.root_velocity, end.joint_velocity)
        ankles = self._ankles(moment.shown - 1, moment, carried)
        self.floor.cast.adopt(k, moment.entry, moment.last, now, ankles)
