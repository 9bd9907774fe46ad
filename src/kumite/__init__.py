"""Kumite: motion capture of one person at a time, turned into characters that spar.

The pipeline, one import a stage:

    mocap.load → build_library → LiveScene → record → measure / write_glb / write_bvh / studio.serve
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
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

__version__ = "0.1.0"

# Names are fetched from their modules when first used: ``kumite --help`` must not wait for them.
_WHERE = {
    "annotate": ("find_contacts", "find_strikes"),
    "clip": ("Clip", "ClipSet", "Skeleton", "concatenate", "mirror", "resample"),
    "control": ("AvoidanceSearch", "approach", "solve", "strike"),
    "errors": ("KumiteError",),
    "graph": (
        "Library",
        "build_action_library",
        "build_avoidance_library",
        "build_library",
        "builtin_library",
        "load_library",
        "save_library",
    ),
    "scene": (
        "BoutScene",
        "DodgeScene",
        "PrepareScene",
        "LiveScene",
        "Playback",
        "Recording",
        "builtin_scenes",
        "load_recording",
        "load_scene",
        "measure",
        "record",
        "save_recording",
    ),
}
_MODULE_OF = {name: module for module, names in _WHERE.items() for name in names}


def __getattr__(name: str) -> Any:
    if name in ("mocap", "performer"):
        return importlib.import_module(f"kumite.{name}")
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'kumite' has no attribute {name!r}")
    return getattr(importlib.import_module(f"kumite.{_MODULE_OF[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


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
