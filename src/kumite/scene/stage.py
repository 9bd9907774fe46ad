"""What can be watched: the live scene and the recording answer to the same few names."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol

import numpy as np

from kumite.brief import brief
from kumite.checks import instance
from kumite.clip import Skeleton
from kumite.control.tuning import Tunable
from kumite.scene.events import Launch, Throw
from kumite.scene.recording import Event, Recording

if TYPE_CHECKING:
    from kumite.control import Progress, Route
    from kumite.control.attack import Attack
    from kumite.control.avoidance import Plan
    from kumite.scene.actions import ActionPlayback
    from kumite.scene.volumes import Volume

RADIUS = 0.1  # m of an object of which a recording does not say it
OUT_OF_SIGHT = np.array([0.0, -50.0, 0.0])  # m, of an object that is not there now


@brief
@dataclass
class SceneObject:
    """A thing in the scene that is no character: a ball to hit, with a size a box, or a line on
    the floor about a place."""

    name: str
    position: np.ndarray  # [3] m, where its middle is now
    radius: float  # m
    draggable: bool = False
    size: tuple[float, float, float] | None = None  # m: width, height and length of a box
    yaw: float = 0.0  # rad, the way a box's length points
    line: bool = False  # round, of that radius
    thrown: bool = False  # comes and goes: nobody looks for it
    wheels: bool = False  # a box that is a car


def recorded_objects(recording: Recording) -> list[SceneObject]:
    """The objects of a recording, where they are in its first frame."""
    told = recording.settings
    radii, sizes = told.get("object_radius", {}), told.get("object_size", {})
    yaws = told.get("object_yaw", {})
    wheels = told.get("object_wheels", sizes)  # boxes were all cars before it was told
    return [
        SceneObject(
            name,
            recording.object_position[0, o].astype(np.float64),
            float(radii.get(name, RADIUS)),
            size=_size(sizes[name]) if name in sizes else None,
            yaw=float(yaws.get(name, 0.0)),
            line=name in told.get("object_line", ()),
            thrown=name in told.get("object_thrown", ()),
            wheels=name in wheels,
        )
        for o, name in enumerate(recording.objects)
    ]


def in_sight(position: np.ndarray) -> np.ndarray:
    """Which of places [..., 3] m are above the ground, or near to it."""
    return position[..., 1] > 0.5 * OUT_OF_SIGHT[1]


def _size(numbers: Sequence[float]) -> tuple[float, float, float]:
    width, height, length = numbers
    return float(width), float(height), float(length)


Count = Literal["blows", "balls", "errands"]

# What a stage may offer. K characters; numbers of characters are rows of K.


class Order(Protocol):
    """Kinds and labels of actions that somebody is told."""

    field: str  # wanted, unwanted or only

    @property
    def options(self) -> tuple[str, ...]: ...
    @property
    def value(self) -> tuple[str, ...]: ...
    def set(self, names: Iterable[str]) -> None:
        """Tell others. Errors: they cannot be told."""
        ...


class Directed(Protocol):
    """Some may be sent along check points, and told which actions to do."""

    @property
    def directed(self) -> tuple[int, ...]:
        """Who."""
        ...

    @property
    def progress(self) -> Sequence[Progress | None]:
        """How far each is on its route [K]."""
        ...

    def set_route(self, name: str, route: Route | None) -> None: ...
    def move_check_point(self, name: str, index: int, place: tuple[float, float]) -> None: ...
    def orders_of(self, k: int) -> Sequence[Order]: ...


class Throwable(Protocol):
    """Balls may be thrown at some."""

    @property
    def streams(self) -> bool:
        """Whether balls come by themselves."""
        ...

    @streams.setter
    def streams(self, on: bool) -> None: ...
    @property
    def thrown_at(self) -> tuple[int, ...]:
        """Whom [n]."""
        ...

    @property
    def ball_radius(self) -> float:
        """Of those that come by themselves [m]."""
        ...

    def bodies(self) -> tuple[np.ndarray, np.ndarray]:
        """Their bodies as spheres now: centres [n, B, 3] and radii [B], m."""
        ...

    def throw(
        self,
        position: np.ndarray,
        goal: np.ndarray,
        speed: float,
        at: int = 0,
        radius: float | None = None,
    ) -> None:
        """From a place [3] by a goal [3], meant for character ``at``. Errors: it makes no sense."""
        ...

    def throw_one(self, speed: float | None = None, radius: float | None = None) -> None: ...


class Avoiding(Protocol):
    """Some avoid, and the volumes that they reckon with can be seen."""

    @property
    def avoiding(self) -> tuple[int, ...]:
        """Who."""
        ...

    def body(self, k: int) -> Volume: ...
    def attacks(self) -> dict[int, Attack]:
        """Those under way that anybody still minds, by number."""
        ...

    def plan(self, k: int) -> Plan | None: ...
    def left(self, k: int) -> Volume:
        """What its plan makes its body leave."""
        ...


class Preparation(NamedTuple):
    """How far somebody is prepared, for what, and where that is begun."""

    chosen: float  # level
    shown: float
    prepares: str | None  # the motion
    does: str | None
    away: float | None  # m to its place
    goal: np.ndarray | None  # [2] m, x and z
    begins: np.ndarray | None  # [3] the facing frame in which the motion is begun


class Reference(NamedTuple):
    """The posture that a motion is prepared for, in its facing frame."""

    position: np.ndarray  # [J, 3] m
    wxyz: np.ndarray  # [J, 4]
    hull: np.ndarray  # [n, 2] m, corners of the support area in turn, x and z; n may be 0
    centre: np.ndarray  # [2] m, the centre of mass on the ground
    about: str  # which frame it is


class Led(Protocol):
    """Some go where they are sent, and prepare for what they do there. Rows n are of ``led``."""

    @property
    def automatic(self) -> bool:
        """Whether they go by themselves where they are not sent."""
        ...

    @automatic.setter
    def automatic(self, on: bool) -> None: ...
    @property
    def led(self) -> tuple[int, ...]:
        """Who [n]."""
        ...

    @property
    def motions(self) -> tuple[str, ...]: ...
    @property
    def things(self) -> tuple[str, ...]:
        """What they may be sent to."""
        ...

    def go(self, k: int, place: np.ndarray) -> np.ndarray: ...
    def go_to(self, k: int, name: str) -> None: ...
    def trigger(self, k: int, motion: str) -> bool: ...
    def place(self, n: int) -> np.ndarray:
        """Where it is [2] m."""
        ...

    def sent(self, n: int) -> bool:
        """Whether the hand sends it to a place now."""
        ...

    def prepared(self, n: int) -> Preparation: ...
    def reference(self, motion: str) -> Reference: ...


@dataclass(frozen=True)
class Offers:
    """What can be done with a stage, besides watching it. What is None has nothing of the kind.

    Whoever shows a stage goes by this, and does not ask which scene it is.
    """

    directed: Directed | None = None
    throwing: Throwable | None = None
    avoiding: Avoiding | None = None
    led: Led | None = None
    tunables: tuple[Tunable, ...] = ()
    counts: tuple[Count, ...] = ("blows",)  # what a score is kept of
    seen: Literal["beside", "before", "behind"] = "beside"  # from where, at first …
    yaw: float = 0.0  # … of whoever faces that way [rad]
    played: Playback | None = None  # a recording that can be wound
    listed: ActionPlayback | None = None  # actions to choose from


def offers_of(stage: Stage) -> Offers:
    """What a stage offers: its ``offers``; a stage without can only be watched."""
    found: Any = getattr(stage, "offers", None)
    return found if isinstance(found, Offers) else Offers()


class Stage(Protocol):
    """A scene that moves on one frame at a time. K characters; what is shown is read only."""

    @property
    def title(self) -> str: ...
    @property
    def fps(self) -> float: ...
    @property
    def skeleton(self) -> Skeleton: ...
    @property
    def names(self) -> tuple[str, ...]: ...
    @property
    def seed(self) -> int: ...
    @property
    def frame(self) -> int:
        """Frames since the start."""
        ...

    @property
    def root_position(self) -> np.ndarray:
        """[K, 3] m, now."""
        ...

    @property
    def wxyz(self) -> np.ndarray:
        """[K, J, 4], now."""
        ...

    @property
    def objects(self) -> Sequence[SceneObject]: ...
    @property
    def events(self) -> Sequence[Event]:
        """Everything so far, oldest first."""
        ...

    def step(self) -> bool:
        """Move on one frame; False when there is no next one."""
        ...

    def reset(self, seed: int) -> None:
        """Start again."""
        ...

    def move_object(self, name: str, position: np.ndarray) -> None:
        """Put an object somewhere; the characters see it from the next frame on."""
        ...


class Playback:
    """A recording on the stage."""

    def __init__(self, recording: Recording) -> None:
        instance(recording, Recording, "Playback")
        self.title = recording.scene
        self.fps = recording.fps
        self.skeleton = recording.skeleton
        self.names = recording.names
        self.seed = int(recording.settings.get("seed", 0))
        self.unarmed = tuple(recording.settings.get("unarmed", ()))
        self.objects = recorded_objects(recording)
        self.load(recording)

    @property
    def offers(self) -> Offers:
        """It can be wound; the score is of what happens in it."""
        kinds = {type(e) for e in self.recording.events}
        counts: list[Count] = []
        if Throw in kinds:
            counts.append("balls")
        if Launch in kinds:
            counts.append("errands")
        return Offers(counts=tuple(counts) or ("blows",), played=self)

    def load(self, recording: Recording) -> None:
        """Show another recording of the same characters and objects, from its start."""
        self.recording = recording
        self._all_events = sorted(recording.events, key=lambda e: e.frame)
        self._event_frames = [e.frame for e in self._all_events]
        self._events: list[Event] = []
        self.reset(self.seed)

    def _show(self) -> None:
        self.root_position = self.recording.root_position[self.frame].astype(np.float64)
        self.wxyz = self.recording.wxyz[self.frame].astype(np.float64)
        for o, thing in enumerate(self.objects):
            thing.position = self.recording.object_position[self.frame, o].astype(np.float64)

    def step(self) -> bool:
        if self.frame + 1 >= len(self.recording):
            return False
        self.frame += 1
        self._show()
        return True

    def reset(self, seed: int) -> None:
        self.frame = 0
        self._show()

    def seek(self, frame: int) -> None:
        self.frame = int(np.clip(frame, 0, len(self.recording) - 1))
        self._show()

    def move_object(self, name: str, position: np.ndarray) -> None:
        """Nothing can be moved in a recording."""

    @property
    def events(self) -> Sequence[Event]:
        # Asked for at every picture: bisected, and the last one handed out again while it holds.
        count = bisect_right(self._event_frames, self.frame)
        if count != len(self._events):
            self._events = self._all_events[:count]
        return self._events
