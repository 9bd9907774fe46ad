from kumite import mocap, performer
from kumite.annotate import find_contacts, find_strikes
from kumite.clip import Clip, ClipSet, Skeleton, concatenate, mirror, resample
from kumite.control import AvoidanceSearch, approach, solve, strike
from kumite.errors import KumiteError
from kumite.graph import (
    Layer,
    Library,
    build_actions,
    build_avoidance,
    build_frames,
    build_library,
    build_preparation,
    builtin_layer,
    builtin_library,
    load_library,
    save_library,
)
from kumite.scene import (
    Playback,
    PrepareScene,
    Recording,
    World,
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
    "Clip",
    "ClipSet",
    "KumiteError",
    "Layer",
    "Library",
    "Playback",
    "PrepareScene",
    "Recording",
    "Skeleton",
    "World",
    "approach",
    "build_actions",
    "build_avoidance",
    "build_frames",
    "build_library",
    "build_preparation",
    "builtin_layer",
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
