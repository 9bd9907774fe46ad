"""The action table: what every controller plans on (Lee & Lee 2004, section 3).

Nodes are *states*, frames with several ways out. An *action* goes from a state to the next one: it
jumps to a frame (or simply goes on) and plays captured frames up to the next state. All actions
that land on the same frame share one *stretch* of frames, because a join carries the facing frame
of state i onto that of frame j − 1: what follows looks the same from wherever it was entered. So
durations, displacements, rewards and values are kept once a stretch, and there are far fewer of
them than actions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kumite.brief import brief
from kumite.checked import checked
from kumite.checks import freeze, rising
from kumite.clip import ClipSet
from kumite.errors import KumiteError
from kumite.graph.transitions import Transitions
from kumite.rotation import planar_compose, planar_inverse


@brief
@dataclass(frozen=True)
class ActionTable:
    """N states, A actions in CSR by state, L stretches."""

    state_frame: np.ndarray  # [N] int32
    action_start: np.ndarray  # [N + 1] int32, actions of state s are action_start[s:s + 2]
    stretch: np.ndarray  # [A] int32
    join_cost: np.ndarray  # [A] float32, 0 where the capture simply goes on
    first: np.ndarray  # [L] int32, first frame played
    last: np.ndarray  # [L] int32, last frame played: the next state's frame
    target: np.ndarray  # [L] int32, the state it ends in
    displacement: (
        np.ndarray
    )  # [L, 3] (x, z, yaw) from the facing frame of first - 1 to that of last

    def __post_init__(self) -> None:
        size = freeze(
            self,
            "action table",
            state_frame=(np.int32, ("N",)),
            action_start=(np.int32, ("N + 1",)),
            stretch=(np.int32, ("A",)),
            join_cost=(np.float32, ("A",)),
            first=(np.int32, ("L",)),
            last=(np.int32, ("L",)),
            target=(np.int32, ("L",)),
            displacement=(float, ("L", 3)),
        )
        states, actions, stretches = size["N"], size["A"], size["L"]
        if states == 0 or size["N + 1"] != states + 1:
            raise KumiteError(
                "action table: expected states, where the actions of each start, the end"
            )
        # Kernels follow these numbers without looking: one that is out of range must not get there.
        for what, fits in (
            (
                "states whose frames are not in order",
                self.state_frame[0] >= 0 and rising(self.state_frame),
            ),
            ("a state without actions", rising(self.action_start)),
            ("actions that no state has", self.action_start[[0, -1]].tolist() == [0, actions]),
            ("an action without a stretch", _within(self.stretch, stretches)),
            ("a stretch without frames", np.all((self.first >= 1) & (self.first <= self.last))),
            (
                "a stretch that ends in no state",
                _within(self.target, states)
                and np.array_equal(self.state_frame[self.target], self.last),
            ),
            ("a join that costs less than nothing", np.all(self.join_cost >= 0)),
        ):
            if not fits:
                raise KumiteError(f"action table: {what}")

    @property
    def duration(self) -> np.ndarray:
        """Frames [L] that each stretch lasts."""
        return self.last - self.first + 1

    @property
    def states(self) -> int:
        return len(self.state_frame)

    @property
    def actions(self) -> int:
        return len(self.stretch)

    def actions_of(self, state: int) -> slice:
        return slice(int(self.action_start[state]), int(self.action_start[state + 1]))


def _within(index: np.ndarray, count: int) -> bool:
    """Whether all of an index point into ``count`` things."""
    return bool(np.all((index >= 0) & (index < count)))


@checked
def fold(clips: ClipSet, transitions: Transitions, kept: np.ndarray) -> ActionTable:
    """Fold chains of frames with one way out into actions (Lee & Lee 2004, figure 2).

    kept [F] bool: a strongly connected component. A frame whose only way out is a jump is a state
    with one action, so that every action is one range of frames. Errors: fewer than 2 states.
    """
    inside = kept[transitions.source] & kept[transitions.target]
    source, target = transitions.source[inside], transitions.target[inside]
    cost = transitions.cost[inside]
    jump = target != source + 1
    source, target, cost = source[jump], target[jump], cost[jump]

    goes_on = kept.copy()
    goes_on[:-1] &= kept[1:]
    goes_on[-1] = False
    goes_on[clips.clip_start[1:] - 1] = False
    is_state = np.zeros(len(clips), dtype=bool)
    is_state[source] = True
    is_state &= kept
    state_frame = np.flatnonzero(is_state).astype(np.int32)
    if len(state_frame) < 2:
        raise KumiteError(
            f"too few frames for a graph: {int(kept.sum())} connected frames give "
            f"{len(state_frame)} state(s); expected at least 2 (more or longer clips)"
        )
    simply = state_frame[goes_on[state_frame]]
    source = np.concatenate([source, simply])
    target = np.concatenate([target, simply + 1])
    cost = np.concatenate([cost, np.zeros(len(simply), np.float32)])
    order = np.lexsort((target, source))
    source, target, cost = source[order], target[order], cost[order]

    first, stretch = np.unique(target, return_inverse=True)
    end = np.searchsorted(state_frame, first)
    last = state_frame[end]
    if np.any(clips.clip_of_frame[last] != clips.clip_of_frame[first]):
        raise KumiteError("internal error: a stretch leaves its clip")  # kept is not a component
    facing = clips.facing
    return ActionTable(
        state_frame,
        np.searchsorted(source, np.append(state_frame, len(clips))).astype(np.int32),
        stretch.astype(np.int32).ravel(),
        cost.astype(np.float32),
        first.astype(np.int32),
        last.astype(np.int32),
        end.astype(np.int32),
        planar_compose(planar_inverse(facing[first - 1]), facing[last]),
    )
