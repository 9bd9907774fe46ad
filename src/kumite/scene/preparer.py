"""The controller of those in a world who prepare for what they will do (Shum et al. 2013).

It poses its characters itself: what they play is bent towards what they prepare for. As long as it
is in charge of one, the world shows what it makes; when another controller is, it only sees where
the character is, and goes on from there.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from kumite.clip import SIDES
from kumite.control.protocol import SELF, Plain, View
from kumite.graph import Library
from kumite.rotation import planar_compose, planar_inverse
from kumite.scene.events import Event
from kumite.scene.floor import Floor
from kumite.scene.prepare import PrepareScene
from kumite.scene.settings import SceneSettings
from kumite.scene.settings_prepare import WalkerSettings
from kumite.scene.walkers import ON_THE_WAY
from kumite.synthesis import Moment


class Preparer(Plain):
    """The controller of every character that prepares. It always has something to do."""

    name = "prepare"
    poses = True

    def __init__(
        self,
        settings: SceneSettings,
        library: Library,
        *,
        cache: Path | None = None,
        progress: Callable[[int, float], None] = lambda batch, changed: None,
    ) -> None:
        """Errors: as :class:`PrepareScene`'s."""
        people = settings.people
        self.who = [k for k, p in enumerate(people) if "prepare" in p.controllers]
        self._row = {k: n for n, k in enumerate(self.who)}
        walkers = tuple(
            WalkerSettings(
                name=people[k].name,
                position=people[k].position,
                yaw_deg=people[k].yaw_deg,
                goes_to=people[k].goes_to,
            )
            for k in self.who
        )
        alone = SceneSettings(
            title=settings.title, walker=walkers, target=settings.target, prepare=settings.prepare
        )
        self.scene = PrepareScene(alone, library, cache=cache, progress=progress)
        skeleton = self.scene.skeleton
        self._feet = [skeleton.joint(f"{side}_foot") for side in SIDES]

    @property
    def walkers(self):
        return self.scene.walkers

    def begin(self, floor: Floor, seed: int, events: list[Event]) -> None:
        """A world begins, or begins again: all stand on its floor, played by nobody yet."""
        self.scene.reset(seed, events)
        self._floor = floor
        self.walkers.active[:] = False
        self._before = (floor.cast.root_position.copy(), floor.cast.wxyz.copy())
        self._anchor = floor.cast.anchor.copy()

    def choose(self, view: View) -> int:
        return SELF

    def serves(self, k: int) -> bool:
        """Whether it is in charge of character k."""
        n = self._row.get(k)
        return n is not None and bool(self.walkers.active[n])

    def is_free(self, k: int) -> bool:
        """Whether character k, of whom it is in charge, may break off what it does."""
        return bool(self.walkers.doing[self._row[k]] == ON_THE_WAY)

    def take(self, k: int) -> None:
        """Be in charge of character k from now on."""
        n, cast = self._row[k], self._floor.cast
        self._anchor[k] = cast.anchor[k]
        self.walkers.enter(n, int(cast.reached[k]), self._now(k))

    def release(self, k: int, *, adopt: bool = True) -> None:
        """Leave character k to somebody else, at the end of an action. adopt: it shows what it
        showed; False: somebody has seen to that."""
        now, cast = self.walkers.leave(self._row[k]), self._floor.cast
        if adopt:
            frame = int(cast.frame[k])
            cast.adopt(k, frame, frame, now)

    def step(self) -> None:
        """A frame on: the floor will show next what those it is in charge of come to."""
        cast, walkers, facing = self._floor.cast, self.walkers, self._floor.cast.facing
        for n, k in enumerate(self.who):
            if walkers.active[n]:  # others may have carried it away
                self.scene.pushed[n] = cast.anchor[k, :2] - self._anchor[k, :2]
            else:
                walkers.follow(n, facing[k])
        self._before[0][:], self._before[1][:] = cast.root_position, cast.wxyz
        self.scene.step()
        shown, played = walkers.shown, walkers.cast
        stands = played.contacts
        for n, k in enumerate(self.who):
            if not walkers.active[n]:
                continue
            frame = int(played.frame[n])
            at = cast.library.clips.facing[frame]
            cast.anchor[k] = planar_compose(shown.facing[n], planar_inverse(at))
            self._anchor[k] = cast.anchor[k]
            ankles = shown.position[n, self._feet]
            cast.hold(k, frame, shown.root_position[n], shown.wxyz[n], ankles, stands[n])
            cast.stop[k] = int(played.stop[n])

    def _now(self, k: int) -> Moment:
        """What character k shows, and how it came there."""
        cast, (root, wxyz) = self._floor.cast, self._before
        return Moment.between(
            np.stack([root[k], cast.root_position[k]]),
            np.stack([wxyz[k], cast.wxyz[k]]),
            self._floor.fps,
        )
