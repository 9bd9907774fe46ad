"""The action-level motion graph (Shum et al. 2012, section IV): edges are whole actions.

Nodes are postures: the poses in which actions start and end, clustered by likeness. The result is
the same action table as that of the frame-level graph, so every controller plans on it: a state is
the last frame of an action, its actions are all those that start in the cluster it ends in.
Reactions are stretches of the table that no state offers: nobody chooses to be struck. They end
where whoever was struck can act again, which may be long before he rests.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import squareform

from kumite.annotate import (
    DIRECTIONS,
    KINDS,
    Actions,
    AvoidanceParts,
    Contacts,
    Strikes,
    find_actions,
    only_blows,
    shorter_rests,
)
from kumite.annotate.action_file import SLIVER
from kumite.checks import instance
from kumite.clip import ClipSet
from kumite.errors import KumiteError
from kumite.graph.distance import pose_features
from kumite.graph.joins import JoinBound, JoinMeter
from kumite.graph.layer import Layer, chosen_parts, noted, with_parts
from kumite.graph.table import ActionTable
from kumite.kernels import distance as kernels
from kumite.rotation import planar_compose, planar_inverse

ALIKE = 1.2  # rad: poses of one cluster are nearer than that, on average (root of D)
SHAKEN = 0.8  # s that a reaction to a hit lasts at least: then it ends with the step that is taken
MOST_WAYS = 64  # actions that a state offers: each kind of label's best joins, turn by turn
REST = 0.7  # s: longer rests are offered in parts
_SPARE = 8  # rows that the kernel may write beyond the last


def build_actions(
    clips: ClipSet,
    actions: Actions | None = None,
    *,
    alike: float = ALIKE,
    most_ways: int = MOST_WAYS,
    avoidance: AvoidanceParts | bool = False,
    bound: JoinBound | None = None,
    contacts: Contacts | None = None,
    strikes: Strikes | None = None,
    progress: Callable[[str], None] = lambda stage: None,
) -> Layer:
    """The layer ``actions``: the action-level graph of a set of clips.

    contacts, strikes: of these clips, if they are known.

    actions: of these clips, by default as the motion analyser finds them. alike: how far [rad]
    poses of one node may be apart. most_ways: actions that a state offers at most; of more those of
    each label that join best, label by label in turn, so that a large capture gives smoother joins
    and not only more of the same. avoidance: parts that no action's end may cut: the action in
    which the middle of one lies plays all of it (:func:`uncut`); True: as they are found; False:
    none. bound: the farthest that a join may jump; None: the usual (:class:`JoinBound`). Errors: no
    connected part with two actions that can be chosen.
    """
    instance(clips, ClipSet, "build_actions")
    if most_ways < 2:
        raise KumiteError(f"most_ways {most_ways}; expected at least 2")
    if not 0 < alike < np.inf:
        raise KumiteError(f"alike {alike}; expected more than 0 rad")
    bound = bound or JoinBound()
    contacts, strikes = noted(clips, contacts, strikes, progress)
    if actions is None:
        progress("finding actions")
        actions = find_actions(clips, contacts, strikes)
    elif not np.array_equal(actions.clip_start, clips.clip_start):
        raise KumiteError("actions: of other clips")
    parts = chosen_parts(clips, contacts, avoidance, progress, actions)
    actions = shorter_rests(actions, REST * clips.fps)
    actions = uncut(actions, parts, round(SLIVER * clips.fps))
    attack = np.flatnonzero(actions.kind == KINDS.index("attack"))
    which = np.searchsorted(actions.start[attack], strikes.frame, side="right") - 1
    strikes = only_blows(
        strikes, (which >= 0) & (strikes.frame < np.append(actions.stop[attack], 0)[which])
    )
    whole, actions = actions, _recovered(actions, contacts.on_ground, clips.fps)
    progress("clustering postures")
    # An action is entered from the frame before it, where its clip has one: then what follows in
    # the capture follows here without a join.
    starts_clip = np.isin(actions.start, clips.clip_start)
    enter = np.where(starts_clip, actions.start, actions.start - 1)
    last = actions.stop - 1
    keep = last > enter
    start_node, end_node, nodes = _postures(clips, enter, last, alike)
    chosen = actions.kind != KINDS.index("reaction")
    alike_enough = _connected(start_node, end_node, nodes, keep, chosen)
    keep, follows, over = _bounded(
        clips, (enter, last), (start_node, end_node), alike_enough, chosen, bound
    )
    usable = keep & chosen
    if usable.sum() < 2 or np.all(actions.kind[usable] == KINDS.index("idle")):
        raise KumiteError(
            f"too few actions for a graph: of {len(actions)} found, {int(usable.sum())} are "
            "connected and can be chosen; expected at least 2, not only rests (more clips, a "
            f"larger --alike, or a wider bound of joins: {over} jump more than {bound.height:g} m "
            f"--join-height, {bound.angle:g} rad --join-angle or {bound.speed:g} m/s --join-speed)"
        )
    order = np.flatnonzero(keep)
    state_frame = last[order]  # ascending: actions are in order and do not overlap
    joins = _join_costs(clips, state_frame, enter[order])
    words = np.unique([actions.label[a] for a in order], return_inverse=True)[1]
    follows = follows[np.ix_(order, np.flatnonzero(usable))]
    number = np.flatnonzero(usable[order])
    offered = [_best_of_each(number[found], joins[s], words) for s, found in enumerate(follows)]
    offered = [np.sort(o[:most_ways]) for o in offered]
    counts = np.array([len(o) for o in offered])
    stretch = np.concatenate(offered)
    cost = joins[np.repeat(np.arange(len(order)), counts), stretch]
    facing = clips.facing
    first = enter[order] + 1
    table = ActionTable(
        state_frame.astype(np.int32),
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int32),
        stretch.astype(np.int32),
        cost,
        first.astype(np.int32),
        state_frame.astype(np.int32),
        np.arange(len(order), dtype=np.int32),
        planar_compose(planar_inverse(facing[first - 1]), facing[state_frame]),
    )
    frames_kept = np.zeros(len(clips), dtype=bool)
    for a, b in zip(first.tolist(), state_frame.tolist()):
        frames_kept[a : b + 1] = True
    report = {
        "level": "actions",
        "alike": alike,
        "join_bound": asdict(bound),
        "joins_over_bound": over,
        "left_out": _left_out(whole, frames_kept, alike_enough & ~keep),
        "fps": clips.fps,
        "frames": len(clips),
        "frames_kept": int(table.duration.sum()),
        "actions_found": len(actions),
        "nodes": len(np.unique(end_node[order])),
        "states": table.states,
        "actions": table.actions,
        "stretches": len(first),
        "mean_ways_out": float(counts.mean()),
        "mean_action_s": float(table.duration.mean() / clips.fps),
        "mean_join_cost": float(cost[cost > 0].mean()) if np.any(cost > 0) else 0.0,
        "hits": len(strikes),
        "hits_kept": _inside(strikes.frame, first, state_frame),
        **{f"{kind}s": int(np.sum(keep & (actions.kind == k))) for k, kind in enumerate(KINDS)},
    }
    return with_parts(Layer(clips, contacts, strikes, table, report, actions, parts), avoidance)


def uncut(actions: Actions, parts: AvoidanceParts, shortest: int = 1) -> Actions:
    """The same actions, but none begins or ends within a part: the one in which the middle of a
    part lies takes all of it from its neighbours, and a neighbour of which less than ``shortest``
    frames are left joins it. A part whose middle lies in no action is none's, and cuts none.
    """
    start, stop = actions.start.copy(), actions.stop.copy()
    owners = np.searchsorted(actions.start, (parts.start + parts.stop - 1) // 2, side="right") - 1
    for a, b, k in zip(parts.start.tolist(), parts.stop.tolist(), owners.tolist()):
        if k < 0 or (a + b - 1) // 2 >= actions.stop[k]:
            continue
        start[k], stop[k] = min(start[k], a), max(stop[k], b)
        stop[:k] = np.minimum(stop[:k], a)
        start[k + 1 :] = np.maximum(start[k + 1 :], b)
    cut = (start != actions.start) | (stop != actions.stop)
    cut[owners[owners >= 0]] = False
    for k in np.flatnonzero(cut & (stop - start < shortest) & (stop > start)).tolist():
        # It touches the action that has taken from it: before it where its start moved, else after.
        if start[k] != actions.start[k]:
            stop[(stop == start[k]) & (start < stop)] = stop[k]
        else:
            start[(start == stop[k]) & (start < stop)] = start[k]
        start[k] = stop[k]
    keep = np.flatnonzero(start < stop)
    kind, limb, way = actions.kind[keep], actions.limb[keep], actions.direction[keep]
    label = tuple(actions.label[k] for k in keep.tolist())
    return Actions(start[keep], stop[keep], kind, limb, way, label, actions.clip_start)


def _recovered(actions: Actions, on_ground: np.ndarray, fps: float) -> Actions:
    """Actions in which a reaction to a hit ends where, :data:`SHAKEN` after it began, both feet
    come to stand (on_ground [F, 2]); what he does from there until he rests is left out.
    """
    both = on_ground[:, 0] & on_ground[:, 1]
    stands = np.flatnonzero(both[1:] & ~both[:-1]) + 1
    begins = actions.start + round(SHAKEN * fps)
    next_stand = np.append(stands, len(both))[np.searchsorted(stands, begins)]
    hit = (actions.kind == KINDS.index("reaction")) & (actions.direction == DIRECTIONS.index("hit"))
    return replace(
        actions, stop=np.where(hit, np.minimum(actions.stop, next_stand + 1), actions.stop)
    )


def _inside(frame: np.ndarray, first: np.ndarray, last: np.ndarray) -> int:
    """How many frames [n] lie in stretches [L], in order, from first to last."""
    stretch = np.searchsorted(first, frame, side="right") - 1
    return int(np.sum((stretch >= 0) & (frame <= last[stretch])))


def _distances(clips: ClipSet, frames: np.ndarray) -> np.ndarray:
    """Root of D [n, n] rad between poses."""
    features, count = pose_features(clips).take(frames), len(frames)
    rows = np.empty((count + _SPARE, count), dtype=np.float32)
    kernels.distance_rows(features.quaternion, features.weight, features.euclidean, 0, count, rows)
    square = rows[:count]
    out = np.sqrt(np.maximum(0.5 * (square + square.T), 0.0))
    np.fill_diagonal(out, 0.0)
    return out


def _postures(
    clips: ClipSet, enter: np.ndarray, last: np.ndarray, alike: float
) -> tuple[np.ndarray, np.ndarray, int]:
    """The nodes that actions start [A] and end [A] in, and how many there are."""
    frames = np.unique(np.concatenate([enter, last]))
    if len(frames) < 2:
        raise KumiteError("too few actions for a graph: expected at least 2")
    condensed = squareform(_distances(clips, frames), checks=False)
    node = fcluster(linkage(condensed, "average"), alike, "distance") - 1
    return (
        node[np.searchsorted(frames, enter)],
        node[np.searchsorted(frames, last)],
        int(node.max()) + 1,
    )


def _connected(
    start: np.ndarray, end: np.ndarray, nodes: int, keep: np.ndarray, chosen: np.ndarray
) -> np.ndarray:
    """The actions [A] of the largest part in which each leads to each, by choice or by a blow."""
    while True:
        edges = coo_array((np.ones(keep.sum()), (start[keep], end[keep])), shape=(nodes, nodes))
        _, part = connected_components(edges.tocsr(), directed=True, connection="strong")
        inside = keep & (part[start] == part[end])
        if not inside.any():
            return inside
        largest = np.argmax(np.bincount(part[start[inside]]))
        inside &= part[start] == largest
        # A posture in which nothing can be chosen would be a dead end.
        ways = np.bincount(start[inside & chosen], minlength=nodes)
        left = inside & (ways[end] > 0)
        if np.array_equal(left, keep):
            return keep
        keep = left


def _bounded(
    clips: ClipSet,
    frames: tuple[np.ndarray, np.ndarray],
    nodes: tuple[np.ndarray, np.ndarray],
    keep: np.ndarray,
    chosen: np.ndarray,
    bound: JoinBound,
) -> tuple[np.ndarray, np.ndarray, int]:
    """Of actions that share nodes those [A] that still lead to each other where no join jumps
    farther than a bound; which follows which [A, A] bool, by choice; and how many pairs jump too
    far. frames, nodes: that actions are entered from, and end in, each [A].
    """
    (enter, last), (start, end) = frames, nodes
    follows = (end[:, None] == start[None]) & keep[:, None] & keep[None]
    struck = follows & ~chosen[None]  # a blow comes when it comes: no bound of joins keeps it away
    follows &= chosen[None]
    a, b = np.nonzero(follows)
    over = ~bound.within(JoinMeter(clips).joins(last[a], enter[b] + 1))
    if not over.any():
        return keep, follows, 0
    follows[a[over], b[over]] = False
    while keep.any():
        # A posture in which nothing can be chosen would be a dead end.
        left = keep & follows[:, keep].any(axis=1)
        edges = (follows | struck) & left[:, None] & left[None]
        _, part = connected_components(coo_array(edges).tocsr(), connection="strong")
        inside = left & (part == np.argmax(np.bincount(part[left]))) if left.any() else left
        if np.array_equal(inside, keep):
            break
        keep = inside
    return keep, follows & keep[:, None] & keep[None], int(over.sum())


def _left_out(actions: Actions, kept: np.ndarray, over: np.ndarray) -> dict[str, int]:
    """Why frames are not in the graph, and how many. kept [F]; over [A]: left out by the bound."""
    why = np.full(len(kept), -1)
    reasons = ("joins over the bound", "postures unlike those of others", "after a reaction")
    recovers = actions.kind == KINDS.index("reaction")
    for a, (start, stop) in enumerate(zip(actions.start.tolist(), actions.stop.tolist())):
        reaction = bool(recovers[a] and kept[start:stop].any())
        why[start:stop] = 0 if over[a] else 2 if reaction else 1
    why[kept] = -2
    counts = {reason: int(np.sum(why == k)) for k, reason in enumerate(reasons)}
    counts["in no action"] = int(np.sum(why == -1))
    return {reason: count for reason, count in counts.items() if count}


def _best_of_each(found: np.ndarray, cost: np.ndarray, word: np.ndarray) -> np.ndarray:
    """Actions found, in turn the best of each word: first each word's best, then its second …"""
    by_cost = found[np.argsort(cost[found], kind="stable")]
    by_word = by_cost[np.argsort(word[by_cost], kind="stable")]
    first = np.searchsorted(word[by_word], word[by_word])
    turn = np.arange(len(by_word)) - first
    return by_word[np.lexsort((cost[by_word], turn))]


def _join_costs(clips: ClipSet, source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Root of D [n, m] float32 between frames; 0 where the capture goes on."""
    frames, index = np.unique(np.concatenate([source, target]), return_inverse=True)
    distance = _distances(clips, frames)
    return distance[np.ix_(index[: len(source)], index[len(source) :])].astype(np.float32)
