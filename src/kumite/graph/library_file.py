"""A library as one file: what its layers share is written once."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from kumite import files
from kumite.annotate import Actions, AvoidanceParts, Contacts, Cycles, Strikes
from kumite.checked import checked
from kumite.checks import instance
from kumite.clip import ClipSet, Skeleton
from kumite.errors import KumiteError
from kumite.graph.hierarchy import Hierarchy, Targets
from kumite.graph.layer import Layer, clip_arrays, own_arrays, preparing_header
from kumite.graph.library import Library
from kumite.graph.preparing import Preparing
from kumite.graph.table import ActionTable

KIND, VERSION = files.LIBRARY


def save_library(path: Path | str, library: Library | Layer) -> None:
    """Write a library, or a layer as one that has no other.

    Errors: neither; a file that cannot be written.
    """
    if isinstance(library, Layer):
        library = Library.of(library)
    instance(library, Library, "save_library")
    clips = library.clips
    header = {
        "clip_names": list(clips.names),
        "fps": clips.fps,
        "joint_names": list(clips.skeleton.names),
        "roles": dict(clips.skeleton.roles),
        "layers": {name: _header(layer) for name, layer in library.layers.items()},
        "missing": dict(library.missing),
    }
    arrays = clip_arrays(clips, library.contacts)
    for name, layer in library.layers.items():
        arrays |= {f"{name}/{key}": array for key, array in own_arrays(layer).items()}
    files.save(path, KIND, VERSION, header, arrays)


def _header(layer: Layer) -> dict[str, Any]:
    return {
        "report": layer.report,
        "labels": None if layer.actions is None else list(layer.actions.label),
        "preparing": None if layer.preparing is None else preparing_header(layer.preparing),
    }


@checked
def load_library(path: Path | str) -> Library:
    """Errors: missing, damaged, another kind of file, another version."""
    header, arrays = files.load(path, KIND, VERSION)

    def part(prefix: str) -> dict[str, np.ndarray]:
        return {k.removeprefix(prefix): v for k, v in arrays.items() if k.startswith(prefix)}

    try:
        skeleton = Skeleton(names=header["joint_names"], roles=header["roles"], **part("skeleton."))
        clips = ClipSet(
            skeleton=skeleton,
            fps=header["fps"],
            names=header["clip_names"],
            **part("clips."),
        )
        contacts = Contacts(**part("contacts."))
        layers = {}
        for name, told in header["layers"].items():
            layers[name] = _layer(
                clips, contacts, told, lambda prefix, name=name: part(f"{name}/{prefix}.")
            )
        return Library(layers, header["missing"])
    except files.UNREADABLE as error:
        raise KumiteError(f"{path}: damaged library ({error})") from None


def _layer(
    clips: ClipSet, contacts: Contacts, told: Any, part: Callable[[str], dict[str, Any]]
) -> Layer:
    actions = preparing = None
    if told["labels"] is not None:
        actions = Actions(label=told["labels"], clip_start=clips.clip_start, **part("actions"))
    if told["preparing"] is not None:
        preparing = _preparing(told["preparing"], part, clips.fps)
    return Layer(
        clips,
        contacts,
        Strikes(**part("strikes")),
        ActionTable(**part("table")),
        told["report"],
        actions,
        AvoidanceParts(clip_start=clips.clip_start, **part("avoidance")),
        preparing,
    )


def _preparing(header: Any, part: Callable[[str], dict[str, Any]], fps: float) -> Preparing:
    return Preparing(
        Hierarchy(
            cores=Cycles(label=header["cores"], fps=fps, **part("cores")),
            targets=Targets(label=header["targets"], **part("targets")),
            alike=header["alike"],
            **part("hierarchy"),
        ),
        **part("preparing"),
    )
