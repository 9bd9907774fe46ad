"""Run a scene without drawing and record it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kumite.checked import checked
from kumite.checks import number
from kumite.control.conductor import ControllerError
from kumite.errors import KumiteError
from kumite.scene.evasion import EvasionScene
from kumite.scene.memory import refuse_too_many
from kumite.scene.metrics import source_skate
from kumite.scene.prepare import PrepareScene
from kumite.scene.recording import NO_FRAME, Recording
from kumite.scene.world import World

MOST_BYTES = 16e9  # of one recording


@checked
def record(
    scene: World | EvasionScene | PrepareScene,
    seconds: float,
    progress: Callable[[float], None] = lambda share: None,
    stop: Callable[[], bool] = lambda: False,
) -> Recording:
    """Step a scene for a time [s] and keep every frame and event. progress is told 0..1.

    stop: asked before every frame but the first; where it says so the recording ends early.

    A scene that has run before goes on from where it is; its earlier events are left out, and times
    count from the recording's first frame.

    Errors: a time that is none, or more than memory holds; a controller fails: what ran until then
    is the error's ``recording``.
    """
    seconds = number(seconds, "seconds", above=0.0)
    count, joints = len(scene.names), len(scene.skeleton)
    largest = MOST_BYTES / (16.0 * count * joints * scene.fps)  # of rotations, nearly all there is
    if seconds > largest:
        raise KumiteError(
            f"seconds: {seconds:g}, expected at most {largest:.0f} (a recording is held in memory)"
        )
    frames = max(1, round(seconds * scene.fps))
    refuse_too_many(count, joints, frames)
    root = np.empty((frames, count, 3), np.float32)
    wxyz = np.empty((frames, count, joints, 4), np.float32)
    contacts = np.empty((frames, count, 2), bool)
    shown = np.empty((frames, count), np.int32)
    rate = np.empty((frames, count), np.float32)
    things = np.empty((frames, len(scene.objects), 3), np.float32)
    begin, seen = scene.frame, len(scene.events)
    failed: ControllerError | None = None
    for f in range(frames):
        if f:
            if stop():
                frames = f
                break
            try:
                scene.step()
            except ControllerError as error:
                failed, frames = error, f
                break
        root[f] = scene.root_position
        wxyz[f] = scene.wxyz
        contacts[f] = scene.cast.contacts
        shown[f] = np.where(scene.cast.held, NO_FRAME, scene.cast.frame)
        rate[f] = scene.cast.pace
        for o, thing in enumerate(scene.objects):
            things[f, o] = thing.position
        if f % 16 == 0:
            progress(f / frames)
    progress(1.0)
    recording = Recording(
        scene=scene.title,
        fps=scene.fps,
        skeleton=scene.skeleton,
        names=scene.names,
        root_position=root[:frames],
        wxyz=wxyz[:frames],
        contacts=contacts[:frames],
        library_frame=shown[:frames],
        objects=tuple(thing.name for thing in scene.objects),
        object_position=things[:frames],
        rate=None if np.all(rate[:frames] == 1.0) else rate[:frames],
        events=tuple(e.counted_from(begin, scene.fps) for e in scene.events[seen:]),
        settings={
            "seed": scene.seed,
            "library": scene.library.digest,
            "source_skate_m_s": source_skate(scene.library),
            "object_radius": {thing.name: thing.radius for thing in scene.objects},
            "object_size": {o.name: list(o.size) for o in scene.objects if o.size is not None},
            "object_yaw": {o.name: o.yaw for o in scene.objects if o.size is not None},
            "object_line": [o.name for o in scene.objects if o.line],
            "object_thrown": [o.name for o in scene.objects if o.thrown],
            "object_wheels": [o.name for o in scene.objects if o.wheels],
            "aims_at": scene.settings.aims,
            **({"unarmed": list(unarmed)} if (unarmed := getattr(scene, "unarmed", ())) else {}),
            "scene": scene.settings.model_dump(mode="json"),
        },
    )
    if failed is not None:
        failed.recording = recording
        raise failed
    return recording
