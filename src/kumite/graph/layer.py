"""A layer of a library: one motion graph over its clips, with what planners on it need."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from kumite.annotate import (
    Actions,
    AvoidanceParts,
    Contacts,
    Strikes,
    find_avoidance,
    find_contacts,
    find_strikes,
    no_avoidance,
)
from kumite.brief import brief, pictured
from kumite.checked import checked
from kumite.checks import instance, mapping, number, text, whole
from kumite.clip import ClipSet
from kumite.errors import KumiteError
from kumite.graph.distance import pose_features
from kumite.graph.joins import JoinBound, bounded
from kumite.graph.preparing import Preparing
from kumite.graph.table import ActionTable, fold
from kumite.graph.transitions import (
    LARGEST_SHARE,
    PER_SECOND,
    Transitions,
    find_transitions,
    strongest_component,
)


def _shares(value: object, what: str) -> None:
    """Errors: anything but counts of frames by the reason why."""
    for reason, count in mapping(value, what).items():
        whole(count, f"{what}: {reason}", least=0)


def _labels(value: object, what: str) -> None:
    """Errors: anything but a list of labels."""
    for label in instance(value, (list, tuple), what):
        text(label, f"{what}: a label")


_REPORTED = {
    **dict.fromkeys(("event", "level"), text),
    **dict.fromkeys(("every", "threshold", "mean_join_cost", "mean_action_s", "alike"), number),
    **dict.fromkeys(("transitions", "candidates", "frames_kept", "hits_kept", "nodes"), whole),
    "joins_over_bound": whole,
    "left_out": _shares,
    "targets_over_bound": _labels,
}  # what a report's values must be, where readers count on it

_NO_PARTS = no_avoidance(np.zeros(1, np.int64))  # of clips that are not known yet


@checked
@brief
@pictured
@dataclass(frozen=True)
class Layer:
    """One motion graph over the frames of some clips: all that a controller on it needs."""

    clips: ClipSet
    contacts: Contacts
    strikes: Strikes
    table: ActionTable
    report: dict[str, Any] = field(default_factory=dict)  # how it was built, JSON values
    actions: Actions | None = None  # what the stretches of an action-level graph are
    avoidance: AvoidanceParts = _NO_PARTS  # kept whole in the graph; none unless it was asked for
    preparing: Preparing | None = None  # what a hierarchical graph is made of

    def __post_init__(self) -> None:
        for name, value in mapping(self.report, "library: report").items():
            if name in _REPORTED:
                _REPORTED[name](value, f"library: report: {name}")
        frames = len(self.clips)
        if len(self.avoidance) == 0:
            object.__setattr__(self, "avoidance", no_avoidance(self.clips.clip_start))
        if not np.array_equal(self.avoidance.clip_start, self.clips.clip_start):
            raise KumiteError("library: its avoidance parts are of other clips")
        for what, found in (
            ("contacts", len(self.contacts.on_ground)),
            ("strikes", len(self.strikes.effective)),
        ):
            if found != frames:
                raise KumiteError(f"library: {what} of {found} frames, clips of {frames}")
        first, last = self.table.first - 1, self.table.last  # actions enter at first - 1
        clip = self.clips.clip_of_frame
        if self.table.state_frame[-1] >= frames or np.any(last >= frames):
            raise KumiteError("library: a state or an action is none of its frames")
        if np.any(clip[first] != clip[last]):
            raise KumiteError("library: an action leaves its clip")
        if self.actions is not None:
            if not np.array_equal(self.actions.clip_start, self.clips.clip_start):
                raise KumiteError("library: its actions are of other clips")
            mine = self.action_of_stretch
            if np.any(mine < 0) or np.any(self.actions.stop[mine] - 1 != last):
                raise KumiteError("library: a stretch is not an action")
        if self.preparing is not None:
            self.preparing.check(self.clips, len(self.table.first))

    @property
    def name(self) -> str:
        """Which layer of a library it is."""
        return self.report.get("level") or ("frames" if self.actions is None else "actions")

    def facts(self) -> list[str]:
        return [
            f"layer {self.name}",
            *self.clips.facts(),
            f"{len(self.strikes)} blows",
            f"{self.table.states} states",
            f"{self.table.actions} actions",
        ]

    @property
    def action_of_stretch(self) -> np.ndarray:
        """The action [L] that each stretch of an action-level graph plays. Errors: it is none."""
        if self.actions is None:
            raise KumiteError(
                "the library's graph is one of frames; expected one of whole actions "
                "(kumite build --layer actions)"
            )
        return np.searchsorted(self.actions.start, self.table.first, side="right") - 1

    @cached_property
    def parts_of_stretch(self) -> tuple[np.ndarray, np.ndarray]:
        """The avoidance parts that stretches play, as CSR: those of stretch l are
        ``part[begin[l]:begin[l + 1]]``, in order (begin [L + 1], part [K]). One of which a stretch
        has only some frames is not among them.
        """
        return self.avoidance.within(self.table.first, self.table.last)

    @cached_property
    def digest(self) -> str:
        """16 hex digits that name the content: what is computed from it is cached under them."""
        h = hashlib.sha256(f"{self.clips.fps}{self.clips.skeleton.names}".encode())
        shared = clip_arrays(self.clips, self.contacts)
        for array in (*shared.values(), *own_arrays(self).values()):
            h.update(np.ascontiguousarray(array).tobytes())
        if self.preparing is not None:
            h.update(str(preparing_header(self.preparing)).encode())
        return h.hexdigest()[:16]


def build_frames(
    clips: ClipSet,
    *,
    event: str = "left",
    per_second: float = PER_SECOND,
    largest_share: float = LARGEST_SHARE,
    avoidance: AvoidanceParts | bool = False,
    bound: JoinBound | None = None,
    contacts: Contacts | None = None,
    strikes: Strikes | None = None,
    without: np.ndarray | None = None,
    progress: Callable[[str], None] = lambda stage: None,
) -> Layer:
    """The layer ``frames`` (Lee & Lee 2004): a graph of frames that are alike.

    contacts, strikes: of these clips, if they are known. without [F] bool: frames that are not to
    be in it. bound: the farthest that a join may jump; None: the usual (:class:`JoinBound`).
    avoidance: parts to keep whole, each within one action of the table (Oshita & Masaoka 2011,
    section 3.1); True: as they are found; False: none. progress is told each stage as it begins.
    Errors: too few frames; no such contact event; parts of other clips.
    """
    instance(clips, ClipSet, "build_frames")
    contacts, strikes = noted(clips, contacts, strikes, progress)
    parts = chosen_parts(clips, contacts, avoidance, progress)
    progress("comparing poses")
    features = pose_features(clips)
    transitions = find_transitions(
        clips,
        contacts,
        event=event,
        per_second=per_second,
        largest_share=largest_share,
        features=features,
        whole=parts,
        without=without,
    )
    told = {"event": event, "per_second": per_second, "largest_share": largest_share}
    progress("folding the graph")
    library = folded(clips, contacts, strikes, transitions, parts, told, bound)
    return with_parts(library, avoidance)


def noted(
    clips: ClipSet,
    contacts: Contacts | None,
    strikes: Strikes | None,
    progress: Callable[[str], None],
) -> tuple[Contacts, Strikes]:
    """Contacts and blows of clips: those that are known, the others as they are found."""
    if contacts is None or strikes is None:
        progress("finding contacts and effective hits")
    contacts = find_contacts(clips) if contacts is None else contacts
    return contacts, find_strikes(clips) if strikes is None else strikes


def folded(
    clips: ClipSet,
    contacts: Contacts,
    strikes: Strikes,
    transitions: Transitions,
    parts: AvoidanceParts,
    told: Mapping[str, Any],
    bound: JoinBound | None = None,
) -> Layer:
    """The library of the connected part of a graph of frames. told: how its transitions were found,
    for the report. bound: of joins; None: the usual. Errors: too few frames; no join keeps to it.
    """
    bound = bound or JoinBound()
    every, transitions = transitions, bounded(clips, transitions, bound)
    kept = strongest_component(clips, transitions)
    table = fold(clips, transitions, kept)
    report = {
        **told,
        "join_bound": asdict(bound),
        "joins_over_bound": len(every) - len(transitions),
        "left_out": _left_out(clips, every, transitions, kept),
        "fps": clips.fps,
        "frames": len(clips),
        "frames_kept": int(kept.sum()),
        "candidates": transitions.candidates,
        "transitions": len(transitions),
        "threshold": transitions.threshold,
        **counted(clips, table, strikes, kept),
    }
    return Layer(clips, contacts, strikes, table, report, None, parts)


def _left_out(
    clips: ClipSet, every: Transitions, transitions: Transitions, kept: np.ndarray
) -> dict[str, int]:
    """Why frames are not in the graph, and how many. every: transitions over the bound, too."""
    clip, frame = clips.clip_of_frame, np.arange(len(clips))
    could = np.zeros(len(clips), dtype=bool)
    if len(every) > len(transitions):
        could = strongest_component(clips, every)
    # Of each clip the last frame to leave from and the first to come to.
    last, first = np.full(len(clips.names), -1), np.full(len(clips.names), len(clips))
    np.maximum.at(last, clip[every.source], every.source)
    np.minimum.at(first, clip[every.target], every.target)
    out: dict[str, int] = {}
    left = ~kept
    for why, these in (
        ("joins over the bound", could),
        ("clips without joins", (last[clip] < 0) & (first[clip] == len(clips))),
        ("after a clip's last way out", frame > last[clip]),
        ("before a clip's first way in", frame < first[clip]),
        ("joined only among themselves", np.ones(len(clips), dtype=bool)),
    ):
        count = int(np.count_nonzero(left & these))
        if count:
            out[why] = count
        left &= ~these
    return out


def counted(
    clips: ClipSet, table: ActionTable, strikes: Strikes, kept: np.ndarray
) -> dict[str, Any]:
    """What a report says of a table. kept [F]: the frames that are in it."""
    jumps = table.join_cost[table.join_cost > 0]
    return {
        "states": table.states,
        "actions": table.actions,
        "stretches": len(table.first),
        "mean_action_s": float(table.duration[table.stretch].mean() / clips.fps),
        "mean_join_cost": float(jumps.mean()) if len(jumps) else 0.0,
        "hits": len(strikes),
        "hits_kept": int(kept[strikes.frame].sum()),
    }


def chosen_parts(
    clips: ClipSet,
    contacts: Contacts,
    avoidance: AvoidanceParts | bool,
    progress: Callable[[str], None],
    actions: Actions | None = None,
) -> AvoidanceParts:
    """The parts that a graph is to keep whole. Errors: parts of other clips."""
    if avoidance is False:
        return no_avoidance(clips.clip_start)
    if avoidance is True:
        progress("finding avoidance parts")
        return find_avoidance(clips, contacts, actions=actions)
    if not np.array_equal(avoidance.clip_start, clips.clip_start):
        raise KumiteError("avoidance parts: of other clips")
    return avoidance


def with_parts(library: Layer, avoidance: AvoidanceParts | bool) -> Layer:
    """The library, its report with a count of avoidance parts where they were asked for."""
    if avoidance is False:
        return library
    held = len(np.unique(library.parts_of_stretch[1]))
    count = {"avoidance_parts": len(library.avoidance), "avoidance_parts_kept": held}
    return replace(library, report={**library.report, **count})


def clip_arrays(clips: ClipSet, contacts: Contacts) -> dict[str, np.ndarray]:
    """What all layers of a library share, by name."""
    skeleton = clips.skeleton
    return {
        "clips.clip_start": clips.clip_start,
        "clips.root_position": clips.root_position,
        "clips.wxyz": clips.wxyz,
        "skeleton.parents": skeleton.parents,
        "skeleton.offsets": skeleton.offsets,
        "skeleton.tip_parents": skeleton.tip_parents,
        "skeleton.tip_offsets": skeleton.tip_offsets,
        **_group("contacts", contacts),
    }


def own_arrays(layer: Layer) -> dict[str, np.ndarray]:
    """What a layer has of its own, by name."""
    return {
        **_group("strikes", layer.strikes),
        **_group("table", layer.table),
        "avoidance.start": layer.avoidance.start,
        "avoidance.stop": layer.avoidance.stop,
        **({} if layer.actions is None else _action_arrays(layer.actions)),
        **({} if layer.preparing is None else _preparing_arrays(layer.preparing)),
    }


def _group(prefix: str, record: Any) -> dict[str, np.ndarray]:
    return {f"{prefix}.{f.name}": getattr(record, f.name) for f in fields(record)}


def _action_arrays(actions: Actions) -> dict[str, np.ndarray]:
    group = _group("actions", actions)
    del group["actions.label"], group["actions.clip_start"]  # a header's, and the clips'
    return group


def _preparing_arrays(preparing: Preparing) -> dict[str, np.ndarray]:
    h = preparing.hierarchy
    group = {
        **_group("preparing", preparing),
        **_group("hierarchy", h),
        **_group("cores", h.cores),
        **_group("targets", h.targets),
    }
    of_a_header = ("cores.label", "cores.fps", "targets.label", "hierarchy.alike")
    records = ("preparing.hierarchy", "hierarchy.cores", "hierarchy.targets")
    return {name: a for name, a in group.items() if name not in (*of_a_header, *records)}


def preparing_header(preparing: Preparing) -> dict[str, Any]:
    """What of it is no array."""
    h = preparing.hierarchy
    return {"cores": list(h.cores.label), "targets": list(h.targets.label), "alike": h.alike}
