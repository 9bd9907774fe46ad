"""A library for preparation: locomotion, and the target motions that it prepares for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict

import numpy as np

from kumite.annotate import (
    Contacts,
    Cycles,
    Strikes,
    find_cycles,
    find_reference,
)
from kumite.annotate.balance import find_balance
from kumite.annotate.reference import LEGS
from kumite.body import lay_body
from kumite.clip import ClipSet
from kumite.errors import KumiteError
from kumite.graph.distance import pose_features
from kumite.graph.finding import MOST, find_targets
from kumite.graph.hierarchy import (
    ALIKE,
    Hierarchy,
    Targets,
    build_hierarchy,
    check_targets,
    hierarchy_table,
)
from kumite.graph.joins import JoinBound, JoinMeter
from kumite.graph.layer import Layer, counted, noted
from kumite.graph.preparing import Preparing, find_about, own_blows


def build_preparation(
    clips: ClipSet,
    targets: Targets | None = None,
    cycles: Cycles | None = None,
    *,
    most: int = MOST,
    alike: float = ALIKE,
    threshold: float = LEGS,
    bound: JoinBound | None = None,
    keep_all: bool = False,
    contacts: Contacts | None = None,
    strikes: Strikes | None = None,
    progress: Callable[[str], None] = lambda stage: None,
) -> Layer:
    """The layer ``preparation``: the hierarchical graph of clips (Shum et al. 2013, section 4).

    targets: None: as they are found (:func:`find_targets`), at most ``most`` of a name, and the
    cycles with them. cycles: the cores; None: as they are found outside of the targets. alike
    [rad], threshold [rad²]: see :func:`build_hierarchy` and :func:`find_reference`. A target is
    entered up to its reference posture, and left from where what it is about is over. bound: the
    farthest that a join may jump; None: the usual (:class:`JoinBound`): a target whose
    best way in or out jumps farther is left out, unless ``keep_all`` (for targets that a person has
    marked). contacts, strikes: of these clips, if they are known. Errors: no targets, no cycles;
    frames that are no part of one clip; limits out of range.
    """
    contacts, strikes = noted(clips, contacts, strikes, progress)
    if targets is None:
        progress("finding target motions")
        targets, cycles = find_targets(clips, contacts, strikes, most=most)
    if len(targets) == 0:
        raise KumiteError("no target motion; expected at least one to prepare for")
    if not 0 < alike < np.inf:
        raise KumiteError(f"alike {alike} rad; expected more than 0")
    if not 0 < threshold < np.inf:
        raise KumiteError(f"threshold {threshold} rad²; expected more than 0")
    check_targets(clips, targets)
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
    bound, features = bound or JoinBound(), pose_features(clips)

    def hierarchy_of(targets: Targets) -> Hierarchy:
        past = np.array([a.past for a in about])
        return build_hierarchy(
            clips,
            cycles,
            targets,
            alike=alike,
            features=features,
            latest=reference,
            earliest=past,
        )

    hierarchy = hierarchy_of(targets)
    fits = _fits(clips, hierarchy, bound)
    over = [label for label, fit in zip(targets.label, fits.tolist()) if not fit]
    if len(over) == count and not keep_all:
        raise KumiteError(
            f"none of {count} target motion(s) joins a cycle within the bound; expected at most "
            f"{bound.height:g} m (--join-height), {bound.angle:g} rad (--join-angle) and "
            f"{bound.speed:g} m/s (--join-speed) for one"
        )
    if over and not keep_all:
        kept = np.flatnonzero(fits)
        targets, reference, count = targets.take(kept), reference[kept], len(kept)
        references, about = [references[t] for t in kept], [about[t] for t in kept]
        hierarchy = hierarchy_of(targets)
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
    played = np.zeros(len(clips), dtype=bool)
    for first, last in zip(table.first.tolist(), table.last.tolist()):
        played[first : last + 1] = True
    report = {
        "level": "preparation",
        "alike": float(alike),
        "threshold": float(threshold),
        "join_bound": asdict(bound),
        "targets_over_bound": over,
        "left_out": {"in no cycle, link or target": int((~played).sum())},
        "fps": clips.fps,
        "frames": len(clips),
        "frames_kept": int(played.sum()),
        "cores": list(cycles.label),
        "targets": list(targets.label),
        "fall_back": [targets.label[t] for t in range(count) if not references[t].found],
        **counted(clips, table, strikes, played),
    }
    return Layer(clips, contacts, strikes, table, report, preparing=preparing)


def _fits(clips: ClipSet, hierarchy: Hierarchy, bound: JoinBound) -> np.ndarray:
    """Which targets [T] bool have a best way in and a best way out that keep to a bound."""
    meter, t = JoinMeter(clips), np.arange(len(hierarchy.targets))
    into, out = (np.argmin(d, axis=0) for d in (hierarchy.entry_distance, hierarchy.exit_distance))
    enters = meter.joins(hierarchy.leave[into, t], hierarchy.entry[into, t] + 1)
    returns = meter.joins(hierarchy.exit[out, t], hierarchy.land[out, t] + 1)
    return bound.within(enters) & bound.within(returns)


def outside(clips: ClipSet, targets: Targets) -> np.ndarray:
    """Frames [F] bool of no target."""
    out = np.ones(len(clips), dtype=bool)
    for start, stop in zip(targets.start.tolist(), targets.stop.tolist()):
        out[start : stop + 1] = False
    return out
