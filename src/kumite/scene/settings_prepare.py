"""Scene files of people who prepare: who walks, and what there is to do something at."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from kumite.scene.settings_base import Finite, Metres, Name, Settings


def _motion_is_kind(given: Any) -> Any:
    """What is done at a thing was called its motion."""
    if isinstance(given, dict) and "motion" in given:
        if "kind" in given:
            raise ValueError("kind and motion say the same; expected one of them (kind)")
        return {("kind" if key == "motion" else key): value for key, value in given.items()}
    return given


Curve = dict[str, Annotated[Finite, Field(gt=0)]]  # C by joint, role or group
WIDEST = 20.0  # m


class WalkerSettings(Settings):
    """Somebody who walks to things and does what is to be done at them."""

    name: Name
    position: tuple[Metres, Metres]  # m, x and z
    yaw_deg: Finite = 0.0  # 0 faces +Z
    goes_to: tuple[Name, ...] = ()  # [[target]]s in this order, over and over; none: the nearest


class WalkersSettings(Settings):
    """Many of them in rows, each with a thing of its own."""

    count: Annotated[int, Field(ge=1, le=10_000)] = 9
    spacing: Annotated[Finite, Field(ge=2.0, le=50.0)] = 6.0  # m
    kind: Name = "kick"  # of what is done there, or a label

    _old = model_validator(mode="before")(_motion_is_kind)

    def walkers(self) -> tuple[WalkerSettings, ...]:
        return tuple(
            WalkerSettings(name=f"walker {n + 1}", position=place, goes_to=(f"thing {n + 1}",))
            for n, place in enumerate(self._places())
        )

    def targets(self) -> tuple[TargetSettings, ...]:
        return tuple(
            TargetSettings(
                name=f"thing {n + 1}", kind=self.kind, position=(x, z + 0.5 * self.spacing)
            )
            for n, (x, z) in enumerate(self._places())
        )

    def _places(self) -> list[tuple[float, float]]:
        across = max(1, round(self.count**0.5))
        rows = -(-self.count // across)
        return [
            (
                self.spacing * (n % across - 0.5 * (across - 1)),
                self.spacing * (n // across - 0.5 * (rows - 1)),
            )
            for n in range(self.count)
        ]


class TargetSettings(Settings):
    """A thing at which a target motion is done: a ball to kick, a bar to get under, a hurdle."""

    name: Name
    kind: Name  # what is done there: under, over, kick, punch or strike; or a label of the library
    position: tuple[Metres, Metres]  # m, x and z of its middle
    yaw_deg: Finite = 0.0  # the way through an obstacle, or the way back
    width: Annotated[Finite, Field(ge=0.8, le=WIDEST)] = 2.4  # m, of an obstacle
    # m: of a bar's underside, a hurdle's top, a ball's middle; None: as the motion needs.
    height: Annotated[Finite, Field(gt=0, le=5)] | None = None
    radius: Annotated[Finite, Field(ge=0.02, le=0.5)] = 0.11  # m, of a ball

    _old = model_validator(mode="before")(_motion_is_kind)


class OpponentsSettings(Settings):
    """People who close in on the walkers."""

    count: Annotated[int, Field(ge=1, le=200)] = 3
    distance: Annotated[Finite, Field(ge=2, le=50)] = 5.0  # m at which they begin
    motions: tuple[Name, ...] = ("punch",)  # kinds or labels: what is done when one is in reach
    rest: Annotated[Finite, Field(ge=0, le=60)] = 4.0  # s that who was struck keeps away


class PrepareSettings(Settings):
    """How they go about it."""

    library: Literal["targets"] = "targets"  # the performer's style
    preparation: Literal["ours", "linear", "none"] = "ours"
    automatic: bool = True  # goes, and launches what is to be done, by itself
    gaits: tuple[Name, ...] = ()  # cores to go with; none: walks of any kind
    curve: Curve = Field(default_factory=dict)  # C by joint, role, "legs" or "upper"
    curves: dict[Name, Curve] = Field(default_factory=dict)  # the same, by kind or label of targets
    scatter: Annotated[Finite, Field(ge=0, le=5)] = 0.0  # m off its place that one begins, at most
    scatter_deg: Annotated[Finite, Field(ge=0, le=180)] = 0.0  # and off its heading

    @model_validator(mode="after")
    def _curves_count(self) -> PrepareSettings:
        if self.preparation != "ours" and (self.curve or self.curves):
            raise ValueError(f'curve and curves say nothing to preparation = "{self.preparation}"')
        return self
