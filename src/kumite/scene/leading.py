"""Those of a scene who can be led by hand, whoever else is in it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import ConvexHull

from kumite.annotate.balance import centre_of_mass, support
from kumite.annotate.reference import where_found
from kumite.rotation import from_yaw, multiply, planar_apply, planar_inverse
from kumite.scene.opponents import NOBODY
from kumite.scene.prepare import NO_THING, PrepareScene
from kumite.scene.stage import Preparation, Reference
from kumite.scene.walkers import NOTHING, ON_THE_WAY


class Walks:
    """Rows of people who prepare, as characters of a stage. Follows :class:`Led`."""

    def __init__(self, scene: PrepareScene, led: Sequence[int]) -> None:
        """led [n]: which character of the stage each walker is."""
        self._scene, self._led = scene, tuple(led)
        self._references: dict[str, Reference] = {}

    @property
    def led(self) -> tuple[int, ...]:
        return self._led

    @property
    def motions(self) -> tuple[str, ...]:
        return tuple(self._scene.motions)

    @property
    def things(self) -> tuple[str, ...]:
        return tuple(self._scene.things.names)

    @property
    def automatic(self) -> bool:
        return self._scene.automatic

    @automatic.setter
    def automatic(self, on: bool) -> None:
        self._scene.automatic = on

    def go(self, k: int, place: np.ndarray) -> np.ndarray:
        return self._scene.go(k, place)

    def go_to(self, k: int, name: str) -> None:
        self._scene.go_to(k, name)

    def trigger(self, k: int, motion: str) -> bool:
        return self._scene.trigger(k, motion)

    def place(self, n: int) -> np.ndarray:
        return self._scene.walkers.facing[n, :2]

    def sent(self, n: int) -> bool:
        return bool(np.isfinite(self._scene.told[n, 0]))

    def prepared(self, n: int) -> Preparation:
        scene, w, label = self._scene, self._scene.walkers, self._scene.motions
        wants, doing, goal = int(w.wants[n]), int(w.doing[n]), w.goal[n].copy()
        goes = self.sent(n) or scene.thing[n] != NO_THING or scene.opponents.foe[n] != NOBODY
        # At a goal without a heading nothing is begun; who does a motion has begun it.
        begins = wants != NOTHING and np.isfinite(goal[2]) and doing == ON_THE_WAY
        # Where the hand has just sent it, it goes from the next frame on.
        to = scene.told[n].copy() if self.sent(n) else goal[:2]
        return Preparation(
            float(w.level[n]),
            float(w.alpha[n]),
            None if wants == NOTHING else label[wants],
            None if doing == ON_THE_WAY else label[doing],
            float(w.off()[0][n]) if goes else None,
            to if goes else None,
            goal if begins else None,
        )

    def reference(self, motion: str) -> Reference:
        if motion not in self._references:
            self._references[motion] = self._find(self._scene.motions.index(motion))
        return self._references[motion]

    def _find(self, t: int) -> Reference:
        library, p = self._scene.library, self._scene.preparing
        frame, mark = int(p.reference[t]), int(p.hierarchy.targets.mark[t])
        clips, contacts = library.clips, library.contacts
        position, world = (x[frame] for x in clips.world)
        back = planar_inverse(clips.facing[frame])
        ground = contacts.on_ground[frame : frame + 1]
        corner_at, touches = support(clips.skeleton, position[None], world[None], ground)
        corners = corner_at[touches]
        hull = corners[ConvexHull(corners).vertices] if len(corners) > 2 else np.empty((0, 2))
        centre = centre_of_mass(self._scene.body, position, world)
        flat = np.insert(hull, 1, 0.0, axis=1)
        return Reference(
            planar_apply(back, position),
            multiply(np.broadcast_to(from_yaw(np.array(back[2])), world.shape), world),
            planar_apply(back, flat)[:, [0, 2]],
            planar_apply(back, centre)[[0, 2]],
            where_found(frame, mark, bool(p.found[t])),
        )
