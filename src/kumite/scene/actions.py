"""The actions of a library on the stage: one at a time, over and over."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from kumite.annotate import Actions
from kumite.checked import checked
from kumite.errors import KumiteError
from kumite.graph import Layer
from kumite.rotation import from_yaw, multiply, planar_apply, planar_inverse
from kumite.scene.events import strike
from kumite.scene.recording import Recording
from kumite.scene.stage import Offers, Playback

WHO = "actor"


@checked
def action_recording(library: Layer, action: int) -> Recording:
    """An action as it was captured, from the origin and facing +Z, with the blows in it.

    Errors: a library without actions; no such action.
    """
    actions, clips = _actions(library), library.clips
    if not 0 <= action < len(actions):
        raise KumiteError(f"action {action}; expected 0 to {len(actions) - 1}")
    a, b = int(actions.start[action]), int(actions.stop[action])
    home = planar_inverse(clips.facing[a])
    turn = from_yaw(np.array(home[2]))
    root = planar_apply(np.tile(home, (b - a, 1)), clips.root_position[a:b])
    wxyz = clips.wxyz[a:b].copy()
    wxyz[:, 0] = multiply(np.tile(turn, (b - a, 1)), wxyz[:, 0])
    strikes = library.strikes
    blows = np.flatnonzero((strikes.frame >= a) & (strikes.frame < b))
    return Recording(
        scene="actions",
        fps=clips.fps,
        skeleton=clips.skeleton,
        names=(WHO,),
        root_position=root[:, None],
        wxyz=wxyz[:, None],
        contacts=library.contacts.on_ground[a:b, None],
        library_frame=np.arange(a, b)[:, None],
        events=tuple(
            strike(int(strikes.frame[x]) - a, WHO, int(strikes.limb[x]), x, strikes)
            for x in blows.tolist()
        ),
        settings={"library": library.digest},
    )


def _actions(library: Layer) -> Actions:
    actions = library.actions
    if actions is None or len(actions) == 0:
        raise KumiteError(
            "the library holds no actions; expected one of whole actions "
            "(kumite build --layer actions)"
        )
    return actions


@checked
class ActionPlayback(Playback):
    """A library's actions on the stage. Errors: a library without actions."""

    def __init__(self, library: Layer, action: int = 0) -> None:
        self.library = library
        self.actions = _actions(library)
        super().__init__(action_recording(library, action))
        self.action = action

    @property
    def offers(self) -> Offers:
        """It can be wound, and another action chosen."""
        return Offers(played=self, listed=self)

    def choose(self, action: int) -> None:
        """Play another action, from its first frame. Errors: no such action."""
        self.load(action_recording(self.library, action))
        self.action = action

    def step(self) -> bool:
        """Move on one frame; after the last comes the first."""
        if not super().step():
            self.seek(0)
        return True

    @property
    def clip_frame(self) -> int:
        """The frame of its clip that is shown."""
        shown = int(self.recording.library_frame[self.frame, 0])
        return shown - int(self.actions.clip_start[self.actions.clip[self.action]])

    @cached_property
    def ways_on(self) -> np.ndarray:
        """How many actions [A] the graph offers after each; 0 after one that is not part of it."""
        out = np.zeros(len(self.actions), dtype=np.int64)
        table = self.library.table
        out[self.library.action_of_stretch] = np.diff(table.action_start)[table.target]
        return out
