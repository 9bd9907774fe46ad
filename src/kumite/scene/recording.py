"""A recording: what happened in a scene, frame by frame and event by event.

The studio plays it, exporters write it, metrics measure it. The same seed gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, TypedDict

import numpy as np

from kumite import checks, files
from kumite.brief import brief, pictured
from kumite.checked import checked
from kumite.clip import Clip, Skeleton
from kumite.errors import KumiteError, unknown
from kumite.scene.events import Event, read_events

KIND, VERSION = files.RECORDING
NO_FRAME = -1  # library_frame of a pose that is no captured frame


Size = Annotated[tuple[float, float, float], lambda v, what: checks.array(v, what, (3,), least=0.0)]


def _with_bout(scene: Mapping[str, Any], what: str) -> Mapping[str, Any]:
    bout = scene.get("bout")
    return scene if bout is None else {**scene, "bout": checks.mapping(bout, f"{what}: bout")}


class Made(TypedDict, total=False):
    """What a recording may say of how it was made; other names hold any plain value."""

    seed: int
    library: str  # its digest
    source_skate_m_s: float | None
    object_radius: Mapping[str, Annotated[float, checks.above_zero]]  # m
    object_size: Mapping[str, Size]  # m, of boxes
    object_yaw: Mapping[str, float]  # rad
    object_line: tuple[str, ...]
    object_thrown: tuple[str, ...]
    object_wheels: tuple[str, ...]
    aims_at: Mapping[str, str | None]
    unarmed: tuple[str, ...]
    scene: Annotated[Mapping[str, Any], _with_bout]  # the scene's settings


@brief
@pictured
@dataclass(frozen=True)
class Recording:
    """N characters on one skeleton over F frames."""

    scene: str
    fps: float
    skeleton: Skeleton
    names: tuple[str, ...]  # K
    root_position: np.ndarray  # [F, K, 3] float32 m
    wxyz: np.ndarray  # [F, K, J, 4] float32
    contacts: np.ndarray  # [F, K, 2] bool, left and right foot planted
    library_frame: np.ndarray  # [F, K] int32 captured frame shown, or NO_FRAME
    objects: tuple[str, ...] = ()  # O
    object_position: np.ndarray = field(default_factory=lambda: np.zeros((0, 0, 3), np.float32))
    events: tuple[Event, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)  # seed, library, scene settings
    rate: np.ndarray | None = None  # [F, K] float32 captured frames passed to come here; None: 1

    def __post_init__(self) -> None:
        put = object.__setattr__
        checks.text(self.scene, "recording: scene")
        checks.instance(self.skeleton, Skeleton, "recording: skeleton")
        put(self, "fps", checks.fps(self.fps, "recording: fps"))
        put(self, "names", checks.names(self.names, "recording: characters' names", least=1))
        put(self, "objects", checks.names(self.objects, "recording: objects' names"))
        count, joints, things = len(self.names), len(self.skeleton), len(self.objects)
        shown = checks.array(
            self.root_position, "recording: root_position", ("F", count, 3), np.float32
        )
        frames = len(shown)
        if frames == 0:
            raise KumiteError("recording: no frames")
        if np.size(self.object_position) == 0:
            put(self, "object_position", np.zeros((frames, things, 3), np.float32))
        fields: dict[str, tuple[type, tuple[checks.Size, ...]]] = {
            "root_position": (np.float32, (frames, count, 3)),
            "wxyz": (np.float32, (frames, count, joints, 4)),
            "contacts": (np.bool_, (frames, count, 2)),
            "library_frame": (np.int32, (frames, count)),
            "object_position": (np.float32, (frames, things, 3)),
        }
        if self.rate is not None:
            fields["rate"] = (np.float32, (frames, count))
        checks.freeze(self, "recording", **fields)
        checks.unit_quaternions(self.wxyz, "recording: wxyz")
        if self.library_frame.min() < NO_FRAME:
            raise KumiteError("recording: library_frame: expected frames, or NO_FRAME")
        put(self, "events", tuple(self.events))
        for event in self.events:
            checks.instance(event, Event, "recording: events")
            if event.character not in self.names:
                raise unknown("character of an event", event.character, self.names)
            if event.frame > frames:
                raise KumiteError(
                    f"recording: an event in frame {event.frame}; expected 0 to {frames}"
                )
            for thing in event.things:
                if thing not in self.objects:
                    raise KumiteError(
                        f"event {event.kind!r}: {checks.shown(thing)} is none of the objects"
                    )
        given = checks.mapping(self.settings, "recording: settings")
        for name, check in checks.annotated(Made):
            if name in given:
                check(given[name], f"recording: {name}")

    def __len__(self) -> int:
        return len(self.root_position)

    @property
    def seconds(self) -> float:
        return len(self) / self.fps

    def facts(self) -> list[str]:
        who = ", ".join(self.names) if len(self.names) <= 4 else f"{len(self.names)} characters"
        time = f"{self.seconds:.1f} s at {self.fps:g} frames/s"
        things = [f"{len(self.objects)} objects"] if self.objects else []
        return [repr(self.scene), who, time, *things, f"{len(self.events)} events"]

    def character(self, name: str) -> int:
        if name not in self.names:
            raise unknown("character", name, self.names)
        return self.names.index(name)

    def only(self, name: str) -> Recording:
        """The recording with one character alone."""
        k = self.character(name)
        one = slice(k, k + 1)
        return replace(
            self,
            names=(name,),
            root_position=self.root_position[:, one],
            wxyz=self.wxyz[:, one],
            contacts=self.contacts[:, one],
            library_frame=self.library_frame[:, one],
            rate=None if self.rate is None else self.rate[:, one],
            events=tuple(e for e in self.events if e.character == name),
        )

    def clip(self, name: str) -> Clip:
        """One character's motion as a clip."""
        k = self.character(name)
        return Clip(
            name,
            self.skeleton,
            self.fps,
            self.root_position[:, k].astype(np.float64),
            self.wxyz[:, k].astype(np.float64),
        )


def skeleton_header(skeleton: Skeleton) -> dict[str, Any]:
    """A skeleton as JSON values (exact: floats survive JSON)."""
    return {
        "names": list(skeleton.names),
        "parents": skeleton.parents.tolist(),
        "offsets": skeleton.offsets.tolist(),
        "roles": dict(skeleton.roles),
        "tip_parents": skeleton.tip_parents.tolist(),
        "tip_offsets": skeleton.tip_offsets.tolist(),
    }


def skeleton_from_header(header: Mapping[str, Any]) -> Skeleton:
    return Skeleton(
        header["names"],
        header["parents"],
        header["offsets"],
        header["roles"],
        header["tip_parents"],
        header["tip_offsets"],
    )


def save_recording(path: Path | str, recording: Recording) -> None:
    """Errors: no recording; a file that cannot be written."""
    checks.instance(recording, Recording, "save_recording")
    header = {
        "scene": recording.scene,
        "fps": recording.fps,
        "skeleton": skeleton_header(recording.skeleton),
        "names": list(recording.names),
        "objects": list(recording.objects),
        "events": [event.to_json() for event in recording.events],
        "settings": dict(recording.settings),
    }
    arrays = {
        "root_position": recording.root_position,
        "wxyz": recording.wxyz,
        "contacts": recording.contacts,
        "library_frame": recording.library_frame,
        "object_position": recording.object_position,
    }
    if recording.rate is not None:
        arrays["rate"] = recording.rate
    files.save(path, KIND, VERSION, header, arrays)


@checked
def load_recording(path: Path | str) -> Recording:
    """Errors: missing, damaged, another kind of file, another version, shapes that do not fit."""
    header, arrays = files.load(path, KIND, VERSION)
    try:
        return Recording(
            scene=header["scene"],
            fps=header["fps"],
            skeleton=skeleton_from_header(header["skeleton"]),
            names=header["names"],
            objects=header["objects"],
            events=read_events(header["events"]),
            settings=header["settings"],
            **arrays,
        )
    except files.UNREADABLE as error:
        raise KumiteError(f"{path}: damaged recording ({error})") from None
