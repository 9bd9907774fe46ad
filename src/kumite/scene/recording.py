"""A recording: what happened in a scene, frame by frame and event by event.

The studio plays it, exporters write it, metrics measure it. The same seed gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from kumite import files
from kumite.clip import Clip, Skeleton
from kumite.errors import KumiteError, unknown

KIND = "recording"
VERSION = 2
NO_FRAME = -1  # library_frame of a pose that is no captured frame


@dataclass(frozen=True)
class Event:
    """Something that happened: at a frame, of a kind, to or by a character."""

    frame: int
    kind: str  # decision, strike, hit, …
    character: str  # who acts
    data: Mapping[str, Any] = field(default_factory=dict)  # JSON values; SI units


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
        for name, dtype in (
            ("root_position", np.float32),
            ("wxyz", np.float32),
            ("contacts", np.bool_),
            ("library_frame", np.int32),
            ("object_position", np.float32),
        ):
            array = np.ascontiguousarray(getattr(self, name), dtype=dtype)
            put(self, name, array)
        frames, count = self.root_position.shape[:2]
        if self.object_position.size == 0:
            put(self, "object_position", np.zeros((frames, len(self.objects), 3), np.float32))
        expected = {
            "root_position": (frames, len(self.names), 3),
            "wxyz": (frames, count, len(self.skeleton), 4),
            "contacts": (frames, count, 2),
            "library_frame": (frames, count),
            "object_position": (frames, len(self.objects), 3),
        }
        for name, shape in expected.items():
            if getattr(self, name).shape != shape:
                raise KumiteError(
                    f"recording: {name} is {getattr(self, name).shape}, expected {shape}"
                )
        if self.rate is not None:
            rate = np.ascontiguousarray(self.rate, dtype=np.float32)
            put(self, "rate", rate)
            if rate.shape != (frames, count):
                raise KumiteError(f"recording: rate is {rate.shape}, expected {(frames, count)}")
        if frames == 0:
            raise KumiteError("recording: no frames")

    def __len__(self) -> int:
        return len(self.root_position)

    @property
    def seconds(self) -> float:
        return len(self) / self.fps

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
        tuple(header["names"]),
        np.array(header["parents"]),
        np.array(header["offsets"]),
        header["roles"],
        np.array(header["tip_parents"], dtype=np.int32),
        np.array(header["tip_offsets"], dtype=np.float64).reshape(-1, 3),
    )


def save_recording(path: Path | str, recording: Recording) -> None:
    header = {
        "scene": recording.scene,
        "fps": recording.fps,
        "skeleton": skeleton_header(recording.skeleton),
        "names": list(recording.names),
        "objects": list(recording.objects),
        "events": [[e.frame, e.kind, e.character, dict(e.data)] for e in recording.events],
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


def load_recording(path: Path | str) -> Recording:
    """Errors: missing, damaged, another kind of file, another version, shapes that do not fit."""
    header, arrays = files.load(path, KIND, VERSION)
    try:
        return Recording(
            scene=header["scene"],
            fps=header["fps"],
            skeleton=skeleton_from_header(header["skeleton"]),
            names=tuple(header["names"]),
            objects=tuple(header["objects"]),
            events=events_from_header(header["events"]),
            settings=header["settings"],
            **arrays,
        )
    except (KeyError, TypeError, ValueError, KumiteError) as error:
        raise KumiteError(f"{path}: damaged recording ({error})") from None


def events_from_header(rows: Sequence[Sequence[Any]]) -> tuple[Event, ...]:
    return tuple(Event(int(f), k, c, d) for f, k, c, d in rows)
