"""Characters that fight by precomputed policies (Lee & Lee 2004): all of a world at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from kumite.body import lay_body
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
from kumite.control.protocol import Plain, View
from kumite.control.tuning import Tunable
from kumite.errors import KumiteError, unknown
from kumite.graph import Layer
from kumite.graph.spans import Spans, nearest
from kumite.kernels import crowd as kernels
from kumite.kernels.character import MANY
from kumite.rotation import rotate
from kumite.scene import events
from kumite.scene.controls import policy_tunables
from kumite.scene.floor import Floor

AIM = "head"
ANTICIPATION = 0.4  # s of the other's motion that a fighter foresees; then it takes it to stand


class PolicyFighter(Plain):
    """The controller of every character that fights by policies. It always has something to do.

    One object serves them all, so that many choose in one call of a kernel.
    """

    name = "policy"

    def __init__(
        self,
        layer: Layer,
        spans: Spans,
        tempers: Sequence[Temper | None],
        *,
        cache: Path | None = None,
        behaviours: Mapping[str, Behaviour] | None = None,
        progress: Callable[[str, int, float], None] = lambda name, sweep, residual: None,
    ) -> None:
        """tempers [K]: how each character of the world chooses; None of those that are not served.

        Errors: a layer that nobody can strike with, an unknown behaviour.
        """
        self.layer = layer.name
        if len(layer.strikes) == 0:
            raise KumiteError("the library holds no effective hits: nobody in it can strike")
        tracks = stretch_tracks(layer)
        if len(tracks.tip) == 0:
            raise KumiteError(
                f"none of the library's {len(layer.strikes)} blows is in the connected part of "
                "its graph: nobody can strike; build it with more clips or more --per-second"
            )
        self.served = [k for k, t in enumerate(tempers) if t is not None]
        self.tempers = [t or Temper() for t in tempers]
        more = _behaviours_of(layer, self.tempers, behaviours or {})
        self.skill = Skill(
            layer,
            trained(layer, approach(), cache, progress=progress),
            trained(layer, strike(layer), cache, progress=progress),
            tracks,
            tuple(trained(layer, b, cache, progress=progress) for b in more),
        )
        body = lay_body(layer.clips.skeleton)
        position, world = layer.clips.world
        head = body.part(AIM)
        middle = 0.5 * (body.start[head] + body.end[head])
        joint = int(body.joint[head])
        self._head = position[:, joint] + rotate(world[:, joint], middle)  # [F, 3] library world
        self._horizon = max(1, round(ANTICIPATION * layer.clips.fps))
        self._begins = int(spans.begins[spans.layers.index(layer.name)])
        self._like: np.ndarray | None = None  # [F] stretch after which one may go on
        self._alone = len(spans.layers) == 1

    def tunables(self, names: Sequence[str]) -> list[Tunable]:
        """What may be tuned while the world runs, of those it serves."""
        more = [p.behaviour.name for p in self.skill.more]
        return policy_tunables(
            [names[k] for k in self.served], [self.tempers[k] for k in self.served], more
        )

    def begin(self, floor: Floor, things: np.ndarray, thing: np.ndarray, seed: int) -> None:
        """A world begins, or begins again: all stand on its floor. things [O, 4]: where hanging
        things are and which way they face; thing [K]: at which each aims, or NOBODY."""
        cast, clips = floor.cast, self.skill.library.clips
        self.fighters = Fighters(self.skill, self.tempers, seed)
        self._floor = floor
        self._actors = kernels.Actors(
            cast.frame,
            cast.fraction,
            cast.rate,
            cast.stop,
            cast.anchor,
            floor.opponent,
            thing,
            things,
            self._head,
            clips.root_position,
            clips.facing,
        )

    # The controller ------------------------------------------------------------------------------

    def choose(self, view: View) -> int:
        return int(self.choose_many(np.array([view.me]))[view.me])

    def choose_many(self, who: np.ndarray) -> np.ndarray:
        """The spans [K] that characters who [W] begin; those of all others say nothing."""
        cast, floor = self._floor.cast, self._floor
        self._states = self._states_of(cast.stop[who])
        self.fighters.note(who)
        choose = kernels.choose_many if cast.count >= MANY else kernels.choose
        choose(
            who,
            self._states,
            cast.root_position,
            floor.grid,
            self._actors,
            self.fighters.minds,
            self.skill.moves,
            self.skill.behaviours,
            self._horizon,
            self.fighters.choices,
        )
        return self.fighters.choices.stretch + self._begins

    def _states_of(self, frame: np.ndarray) -> np.ndarray:
        """The states [W] to choose in at library frames [W]: those, or the most like them."""
        table = self.skill.library.table
        states = np.searchsorted(table.state_frame, frame)
        if self._alone:
            return states
        states = np.minimum(states, len(table.state_frame) - 1)
        strange = table.state_frame[states] != frame
        if np.any(strange):
            if self._like is None:
                self._like, _ = nearest(self.skill.library)
            states = np.where(strange, table.target[self._like[frame]], states)
        return states

    def told(self, frame: int, who: np.ndarray, names: tuple[str, ...]) -> list[events.Decision]:
        """What characters who [W] have just chosen, for the log."""
        choices, jump = self.fighters.choices, self._floor.cast.jump
        return [
            events.Decision(
                frame,
                names[k],
                by=self.name,
                state=state,
                stretch=int(choices.stretch[k]),
                worth=float(choices.worth[k]),
                considered=int(choices.considered[k]),
                apart=int(choices.apart[k]),
                jump=bool(jump[k]),
            )
            for k, state in zip(who.tolist(), self._states.tolist())
        ]


def _behaviours_of(
    layer: Layer, tempers: Sequence[Temper], own: Mapping[str, Behaviour]
) -> list[Behaviour]:
    """Those that the scene or the user names, besides approach and strike."""
    names = {n: None for t in tempers for n in t.more} | dict.fromkeys(own)
    known = [n for n in [*BEHAVIOURS, *own] if n not in ("approach", "strike")]
    out = []
    for name in names:
        if name in ("approach", "strike"):
            raise KumiteError(f"behaviours: {name} has a weight of its own ({name} = …)")
        if name not in known:
            raise unknown("behaviour", name, known)
        found = own[name] if name in own else BEHAVIOURS[name](layer)
        out.append(replace(found, name=name))
    return out
