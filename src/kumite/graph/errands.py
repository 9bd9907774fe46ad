"""A library for preparation: locomotion, and the target motions that it prepares for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kumite.annotate import (
    Contacts,
    Cycles,
    Strikes,
    find_contacts,
    find_cycles,
    find_reference,
    find_strikes,
)
from kumite.annotate.balance import find_balance
from kumite.annotate.reference import LEGS
from kumite.body import lay_body
from kumite.clip import ClipSet
from kumite.errors import KumiteError
from kumite.graph.distance import pose_features
from kumite.graph.hierarchy import ALIKE, Targets, build_hierarchy, check_targets, hierarchy_table
from kumite.graph.library import Library, counted
from kumite.graph.preparing import Preparing, find_about, own_blows


def build_preparation_library(
    clips: ClipSet,
    targets: Targets,
    cycles: Cycles | None = None,
    *,
    alike: float = ALIKE,
    threshold: float = LEGS,
    contacts: Contacts | None = None,
    strikes: Strikes | None = None,
    progress: Callable[[str], None] = lambda stage: None,
) -> Library:
    """The hierarchical graph of these clips (Shum et al. 2013, section 4), as a library.

    cycles: the cores; None: as they are found outside of the targets. alike [rad], threshold
    [rad²]: see :func:`build_hierarchy` and :func:`find_reference`. A target is entered up to its
    reference posture, and left from where what it is about is over. contacts, strikes: of these
    clips, if they are known. Errors: no targets, no cycles; frames that are no part of one clip;
    limits out of range.
    """
    if len(targets) == 0:
        raise KumiteError("no target motion; expected at least one to prepare for")
    if not 0 < alike < np.inf:
        raise KumiteError(f"alike {alike} rad; expected more than 0")
    if not 0 < threshold < np.inf:
        raise KumiteError(f"threshold {threshold} rad²; expected more than 0")
    check_targets(clips, targets)
    progress("finding contacts and effective hits")
    contacts = find_contacts(clips) if contacts is None else contacts
    strikes = find_strikes(clips) if strikes is None else strikes
    progress("finding cycles of locomotion")
    if cycles is None:
        cycles = find_cycles(clips, contacts, where=outside(clips, targets))
    progress("finding reference postures")
    balance, body, count = find_balance(clips, contacts), lay_body(clips.skeleton), len(targets)
    references = [
        find_reference(clips, contacts, start, mark, threshold=threshold, balance=balance)
        for start, mark in zip(targets.start.tolist(), targets.mark.tolist())
    ]
    reference = np.array([r.frame for r in references])
    blows = own_blows(clips, strikes)
    about = [find_about(clips, blows, targets, t, int(reference[t]), body) for t in range(count)]
    progress("comparing poses")
    hierarchy = build_hierarchy(
        clips,
        cycles,
        targets,
        alike=alike,
        features=pose_features(clips),
        latest=reference,
        earliest=np.array([a.past for a in about]),
    )
    progress("making the action table")
    table, what = hierarchy_table(clips, hierarchy)
    preparing = Preparing(
        hierarchy,
        what,
        np.array([a.kind for a in about]),
        np.array([a.limb for a in about]),
        reference,
        np.array([r.found for r in references]),
        np.array([a.contact for a in about]),
        np.array([a.place for a in about]),
        np.array([a.clear for a in about]),
        np.array([a.way for a in about]),
        np.array([a.past for a in about]),
    )
    kept = np.zeros(len(clips), dtype=bool)
    for first, last in zip(table.first.tolist(), table.last.tolist()):
        kept[first : last + 1] = True
    report = {
        "level": "preparation",
        "alike": float(alike),
        "threshold": float(threshold),
        "fps": clips.fps,
        "frames": len(clips),
        "frames_kept": int(kept.sum()),
        "cores": list(cycles.label),
        "targets": list(targets.label),
        "fall_back": [targets.label[t] for t in range(count) if not references[t].found],
        **counted(clips, table, strikes, kept),
    }
    return Library(clips, contacts, strikes, table, report, preparing=preparing)


def outside(clips: ClipSet, targets: Targets) -> np.ndarray:
    """Frames [F] bool of no target."""
    out = np.ones(len(clips), dtype=bool)
    for start, stop in zip(targets.start.tolist(), targets.stop.tolist()):
        out[start : stop + 1] = False
    return out
