"""A library: clips with several motion graphs, its layers, over one frame index."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from kumite.annotate import Contacts, find_contacts, find_strikes
from kumite.brief import brief, pictured
from kumite.checks import freeze_mapping, instance
from kumite.clip import ClipSet
from kumite.errors import KumiteError, unknown
from kumite.graph.avoiding import build_avoidance
from kumite.graph.errands import build_preparation
from kumite.graph.joins import JoinBound
from kumite.graph.layer import Layer, build_frames
from kumite.graph.whole import build_actions
from kumite.layers import LAYERS, TAKES


@brief
@pictured
@dataclass(frozen=True)
class Library:
    """Clips and the motion graphs over them that they allow.

    layers: by name, of ``frames`` (Lee & Lee 2004), whole ``actions`` (Shum et al. 2012),
    ``avoidance`` (Oshita & Masaoka 2011) and ``preparation`` (Shum et al. 2013), in that order; all
    are of the same clips. missing: why each of the others could not be made.

    Errors: no layer, one of another name, layers of different clips.
    """

    layers: Mapping[str, Layer]
    missing: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        layers = freeze_mapping(self, "layers", LAYERS, Layer, "library: layers")
        freeze_mapping(self, "missing", LAYERS, str, "library: missing layers")
        if not layers:
            raise KumiteError("library: no layers; expected at least one")
        first = next(iter(layers.values()))
        for name, layer in layers.items():
            if layer.clips is not first.clips or layer.contacts is not first.contacts:
                raise KumiteError(f"library: layer {name}: of other clips")

    @staticmethod
    def of(layer: Layer) -> Library:
        """A library of one layer."""
        return Library({layer.name: layer})

    @property
    def clips(self) -> ClipSet:
        """Of all layers."""
        return next(iter(self.layers.values())).clips

    @property
    def contacts(self) -> Contacts:
        """When feet stand in the clips."""
        return next(iter(self.layers.values())).contacts

    @cached_property
    def digest(self) -> str:
        """16 hex digits that name the content."""
        of = "".join(f"{name}{layer.digest}" for name, layer in self.layers.items())
        return hashlib.sha256(of.encode()).hexdigest()[:16]

    def layer(self, name: str) -> Layer:
        """A layer by name. Errors: there is none of that name, and why."""
        if name not in LAYERS:
            raise unknown("layer", name, LAYERS)
        if name not in self.layers:
            why = self.missing.get(name, "it was not built")
            raise KumiteError(
                f"the library has no layer {name!r} ({why}), only {', '.join(self.layers)}; "
                f"it takes {TAKES[name]}: build it again (kumite build) with such clips"
            )
        return self.layers[name]

    def facts(self) -> list[str]:
        return [
            *self.clips.facts(),
            *(f"{n}: {x.table.states} states, {x.table.actions} actions"
              for n, x in self.layers.items()),
        ]  # fmt: skip


def build_library(
    clips: ClipSet,
    *,
    layers: Iterable[str] | None = None,
    bound: JoinBound | None = None,
    progress: Callable[[str], None] = lambda stage: None,
    **options: Mapping[str, Any],
) -> Library:
    """A library of every layer that some clips allow.

    layers: those that it must have and no others; None: those that can be made. bound: the farthest
    that a join may jump; None: the usual (:class:`JoinBound`). options: of a layer's own builder by
    the layer's name, such as ``frames={"event": "both"}`` (:func:`build_frames`,
    :func:`build_actions`, :func:`build_avoidance`, :func:`build_preparation`): such a layer must be
    made, too. progress is told each stage as it begins.

    Errors: a layer that must be made cannot be; none can be made: why not, of each; an unknown
    layer.
    """
    instance(clips, ClipSet, "build_library")
    wanted = LAYERS if layers is None else tuple(layers)
    for name in (*wanted, *options):
        if name not in LAYERS:
            raise unknown("layer", name, LAYERS)
    must = set(options) if layers is None else set(wanted)
    progress("finding contacts and effective hits")
    contacts = find_contacts(clips)
    noted = {"contacts": contacts, "strikes": find_strikes(clips), "bound": bound}
    made: dict[str, Layer] = {}
    missing: dict[str, str] = {}
    for name in LAYERS:
        if name not in wanted:
            continue

        def tell(stage: str, name: str = name) -> None:
            progress(f"{name}: {stage}")

        try:
            made[name] = _BUILDERS[name](
                clips, **{**noted, "progress": tell, **options.get(name, {})}
            )
        except KumiteError as error:
            if name in must:
                raise
            missing[name] = str(error)
    if not made:
        raise KumiteError("; ".join(f"{name}: {why}" for name, why in missing.items()))
    return Library(made, missing)


_BUILDERS: Mapping[str, Callable[..., Layer]] = {
    "frames": build_frames,
    "actions": build_actions,
    "avoidance": build_avoidance,
    "preparation": build_preparation,
}
