"""The volumes of an avoidance, to be looked at: the body's, the attacks', and what was left.

All are spheres (Oshita & Masaoka 2011, section 4.2); the last is their avoidance volume: where the
body was as the avoidance part began, and no longer is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

import numpy as np

from kumite.body import Spheres
from kumite.control.attack import Attack
from kumite.control.avoidance import AvoidanceSearch, Plan, Standing
from kumite.control.avoider import Avoider, standing
from kumite.rotation import planar_apply, planar_compose, planar_inverse
from kumite.synthesis import Cast

MOST_SAMPLES = 60  # of an attack that are shown


class Volume(NamedTuple):
    """N spheres."""

    centre: np.ndarray  # [N, 3] m
    radius: np.ndarray  # [N] m


def body_volume(cast: Cast, k: int, spheres: Spheres) -> Volume:
    """The spheres of character k's body now."""
    return Volume(spheres.at(cast.position[k], cast.world_wxyz[k]), spheres.radius)


def attacks_on(avoiders: Iterable[Avoider]) -> dict[int, Attack]:
    """The attacks that anybody still minds, by their numbers."""
    return {t.number: t.attack for avoider in avoiders for t in avoider.threats}


def attack_volume(attack: Attack) -> Volume:
    """An attack's spheres along its way; of a long one some."""
    count = min(len(attack), MOST_SAMPLES)
    some = np.linspace(0, len(attack) - 1, count).round().astype(int)
    return Volume(attack.centre[some].reshape(-1, 3), np.tile(attack.radius, count))


def avoidance_volume(cast: Cast, k: int, avoider: Avoider) -> Volume:
    """The avoidance volume of the plan that character k follows; no spheres without one."""
    if avoider.plan is None:
        return Volume(np.zeros((0, 3)), np.zeros(0))
    here = standing(cast, k, int(cast.stop[k]))
    return left_behind(avoider.search, here, avoider.rest, avoider.plan.part)


class Volumes:
    """Of those of a stage who avoid. Follows :class:`~kumite.scene.stage.Avoiding`."""

    def __init__(self, avoiders: Mapping[int, Avoider], cast: Callable[[], Cast]) -> None:
        """avoiders: by the numbers of their characters in a cast."""
        self._avoiders, self._cast = avoiders, cast

    @property
    def avoiding(self) -> tuple[int, ...]:
        return tuple(sorted(self._avoiders))

    def body(self, k: int) -> Volume:
        return body_volume(self._cast(), k, self._avoiders[k].search.spheres)

    def attacks(self) -> dict[int, Attack]:
        return attacks_on(self._avoiders.values())

    def plan(self, k: int) -> Plan | None:
        return self._avoiders[k].plan

    def left(self, k: int) -> Volume:
        return avoidance_volume(self._cast(), k, self._avoiders[k])


def left_behind(
    search: AvoidanceSearch, standing: Standing, path: tuple[int, ...], part: int
) -> Volume:
    """The spheres that leave their places in a part of a path's last edge, where they were as it
    began. Without a path the part is in the present edge.
    """
    library, graph = search.library, search.graph
    facing, anchor, stop = library.clips.facing, standing.anchor, standing.stop
    for stretch in path:
        joined = planar_inverse(facing[graph.first[stretch] - 1])
        anchor = planar_compose(planar_compose(anchor, facing[stop]), joined)
        stop = int(graph.last[stretch])
    first, last = int(graph.begins[part]), int(graph.ends[part])
    centre = search.volumes.centre[first : last + 1].astype(np.float64)  # [n, 3, B]
    gone = np.linalg.norm(centre - centre[0], axis=1).max(axis=0) >= search.settings.left
    return Volume(planar_apply(anchor, centre[0].T[gone]), search.spheres.radius[gone])
