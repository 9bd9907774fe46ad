from kumite import mocap, performer
from kumite.annotate import find_contacts, find_strikes
from kumite.clip import Clip, ClipSet, Skeleton, concatenate, mirror, resample
from kumite.control import AvoidanceSearch, approach, solve, strike
from kumite.errors import KumiteError
from kumite.graph import (
    Library,
    build_action_library,
    build_avoidance_library,
    build_library,
    builtin_library,
    load_library,
    save_library,
)
from kumite.scene import (
    BoutScene,
    DodgeScene,
    LiveScene,
    Playback,
    PrepareScene,
    Recording,
    builtin_scenes,
    load_recording,
    load_scene,
    measure,
    record,
    save_recording,
)

__version__: str

__all__ = [
    "AvoidanceSearch",
    "BoutScene",
    "Clip",
    "ClipSet",
    "DodgeScene",
    "KumiteError",
    "Library",
    "LiveScene",
    "Playback",
    "PrepareScene",
    "Recording",
    "Skeleton",
    "approach",
    "build_action_library",
    "build_avoidance_library",
    "build_library",
    "builtin_library",
    "builtin_scenes",
    "concatenate",
    "find_contacts",
    "find_strikes",
    "load_library",
    "load_recording",
    "load_scene",
    "measure",
    "mirror",
    "mocap",
    "performer",
    "record",
    "resample",
    "save_library",
    "save_recording",
    "solve",
    "strike",
]
