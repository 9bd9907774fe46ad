"""Pairs in formation: paths that keep their distance, each for one pair (Shum et al. 2012, section
VIII-C, figures 10 and 11)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from kumite.lazy import Later
from kumite.scene.settings_base import Finite, Name, Positive, Settings
from kumite.scene.settings_fight import CheckPointSettings, FighterSettings, Manner

if TYPE_CHECKING:
    import numpy as np
else:
    np = Later("numpy")

MOST_PAIRS = 1000
APART = 1.2  # m between the two of a pair when they begin


class MemberSettings(Manner):
    """One side of every pair."""

    name: Name
    require: tuple[str, ...] = ()  # at the last check point: kinds or labels of actions
    refuse: tuple[str, ...] = ()  # before it
    later: Annotated[Finite, Field(ge=0, le=60)] = 0.0  # s after its path's times


class PairsSettings(Settings):
    """Pairs whose paths are laid out so that no two of them meet.

    facing: whether those of a pair face each other when they begin, or along their way. Who face
    each other share their path: its check points are places of the middle between them.
    spiral: rings of pairs all round a centre, that turn and spread. crossing: half of the pairs go
    along +X, the others along +Z, so timed that wherever two paths cross the second pair comes
    ``spacing`` / ``speed`` later.
    """

    count: Annotated[int, Field(ge=1, le=MOST_PAIRS)] = 12
    layout: Literal["spiral", "crossing"] = "spiral"
    spacing: Annotated[Finite, Field(ge=1.5, le=50)] = 3.0  # m between pairs, at least
    speed: Annotated[Finite, Field(gt=0, le=5)] = 0.2  # m/s, at most
    seconds: Annotated[Finite, Field(gt=0, le=3600)] = 30.0
    points: Annotated[int, Field(ge=2, le=200)] = 13
    radius: Positive = 0.7  # m within which a check point is reached
    facing: Literal["rival", "way"] = "rival"
    turn_deg: Annotated[Finite, Field(ge=-3600, le=3600)] = 40.0  # of a spiral, at most
    one: MemberSettings
    other: MemberSettings

    def fighters(self) -> tuple[FighterSettings, ...]:
        """Both of every pair, one after the other."""
        ways = self._spiral() if self.layout == "spiral" else self._crossing()
        return tuple(f for k, (way, times) in enumerate(ways) for f in self._pair(k, way, times))

    def _spiral(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Places [points, 2] and times [points] of every pair."""
        rings = max(1, round(np.sqrt(self.count / 8.0)))
        arms = -(-self.count // rings)
        innermost = max(0.5 * self.spacing / np.sin(np.pi / arms), 1.0) if arms > 1 else 1.0
        share = np.linspace(0.0, 1.0, self.points)
        # Nobody's way is longer than the speed asks for, and it spreads by 0.6 of that at least.
        length = self.speed * self.seconds
        outermost = innermost + (rings - 1) * self.spacing + 0.5 * length
        turn = np.radians(self.turn_deg)
        turn = np.sign(turn) * min(abs(turn), 0.8 * length / outermost)
        grow = np.sqrt(length**2 - (outermost * turn) ** 2)
        out = []
        for k in range(self.count):
            ring, arm = divmod(k, arms)
            # Odd rings stand in the gaps of even ones.
            angle = 2.0 * np.pi * (arm + 0.5 * (ring % 2)) / arms + turn * share
            r = innermost + ring * self.spacing + grow * share
            places = np.stack([r * np.sin(angle), r * np.cos(angle)], axis=1)
            out.append((places, self.seconds * share))
        return out

    def _crossing(self) -> list[tuple[np.ndarray, np.ndarray]]:
        lanes = (self.count + 1) // 2
        length = max(self.speed * self.seconds, self.spacing * (lanes + 1))  # from side to side
        share = np.linspace(0.0, 1.0, self.points)
        later = self.spacing / self.speed
        out = []
        for k in range(self.count):
            lane, way = divmod(k, 2)
            # Lane n of either starts n steps later: where lanes m and n cross both are m + n steps
            # on their way, and those along +Z are one step later.
            begin = later * (lane + (1 if way else 0))
            ahead = share * length - 0.5 * length
            aside = np.full_like(share, self.spacing * (lane - 0.5 * (lanes - 1)))
            places = np.stack([aside, ahead] if way else [ahead, aside], axis=1)
            out.append((places, begin + share * length / self.speed))
        return out

    def _pair(self, k: int, places: np.ndarray, times: np.ndarray) -> list[FighterSettings]:
        tangent = places[1] - places[0]
        tangent = tangent / np.linalg.norm(tangent)
        members = (self.one, self.other)
        out = []
        for side, member in zip((0.5, -0.5), members):
            rival = members[1] if member is members[0] else members[0]
            if self.facing == "rival":
                here, way = places[0] + side * APART * tangent, -np.sign(side) * tangent
            else:  # as far behind as it follows later
                here, way = places[0] - self.speed * member.later * tangent, tangent
            last = self.points - 1
            begin = CheckPointSettings(
                place=(float(here[0]), float(here[1])), time=float(times[0]), radius=self.radius
            )
            point = tuple(
                CheckPointSettings(
                    place=(float(p[0]), float(p[1])),
                    time=float(t + member.later),
                    require=member.require if n == last else (),
                    refuse=member.refuse if n < last else (),
                    radius=self.radius,
                    middle=self.facing == "rival",
                )
                for n, (p, t) in enumerate(zip(places, times))
            )
            manner = {key: getattr(member, key) for key in Manner.model_fields}
            out.append(
                FighterSettings(
                    **manner,
                    name=f"{member.name} {k + 1}",
                    position=(float(here[0]), float(here[1])),
                    yaw_deg=float(np.degrees(np.arctan2(way[0], way[1]))),
                    against=f"{rival.name} {k + 1}",
                    point=(begin, *point) if self.facing == "way" and member.later else point,
                )
            )
        return out
