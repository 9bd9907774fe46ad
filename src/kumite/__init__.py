"""Kumite: motion capture of one person at a time, turned into characters that spar.

The pipeline, one import a stage:

    mocap.load → build_library → LiveScene → record → measure / write_glb / write_bvh / studio.serve
"""

from kumite import mocap, performer
from kumite.annotate import find_contacts, find_strikes
from kumite.clip import Clip, ClipSet, Skeleton, concatenate, mirror, resample
from kumite.control import approach, solve, strike
from kumite.errors import KumiteError
from kumite.graph import Library, build_library, builtin_library, load_library, save_library
from kumite.scene import (
    LiveScene,
    Playback,
    Recording,
    builtin_scenes,
    load_recording,
    load_scene,
    measure,
    record,
    save_recording,
)

__version__ = "0.1.0"

__all__ = [
    "Clip",
    "ClipSet",
    "KumiteError",
    "Library",
    "LiveScene",
    "Playback",
    "Recording",
    "Skeleton",
    "approach",
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
