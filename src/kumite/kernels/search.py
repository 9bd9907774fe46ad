"""Exact game-tree search over states that are rows of numbers; games are plugged in.

A node is the moment when either player is about to choose (Shum, Komura, Yamazaki 2012,
section V-A). Actions differ in length, so the players need not take turns: the game says who
chooses. Edges add to two scores along the path, S_comp and S_coop (Eq. 1); both are copied up from
the child that whoever chooses prefers (Eqs. 2, 3). Depth is the number of levels below the root,
whoever chooses at each.

A game is any NamedTuple of arrays and numbers, handed on untouched, and two functions of a module,
compiled with ``@kernel``:

``expand(game, state, children) -> (count, considered, player)``
    fills the first ``count`` rows of ``children`` with what can be done in ``state`` [S]: at most
    as many as the search was given room for. ``comp`` and ``coop`` are what the edge adds, as the
    searcher sees it: F_comp of its own actions, -F_comp of its opponent's, F_coop of either's.
    ``considered``: actions before pruning. ``player``: who chooses, SEARCHER or OPPONENT. A forced
    edge, such as the reaction to a hit, is a list of one. Where ``count`` is 0 the node is a leaf.

``leaves(game, children, count)``
    adds what is expected beyond the tree to ``comp`` and ``coop`` of the first ``count`` rows, in
    which the sums along the path stand already.

The tree is walked depth-first with one list of children per level, so memory does not grow with
the number of nodes. Game tuples are handed over once per expanded node, never once per leaf.

Shapes: M children at most, S numbers in a state, D levels.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import get_num_threads

from kumite.kernels.jit import kernel, lean_kernel, plugged

SEARCHER, OPPONENT = 0, 1  # who chooses: a max node, a min node
NO_CHILD = -1
TASKS = 64  # subtrees to share out: the tree is split at its first level with as many nodes
WORKERS = 6  # a core, who take turns at them: each has large and small ones


class Children(NamedTuple):
    """Nodes side by side, and the edges that lead to them."""

    action: np.ndarray  # [n] int64
    comp: np.ndarray  # [n] added by the edge; then the sum along the path; then what is copied up
    coop: np.ndarray  # [n]
    state: np.ndarray  # [n, S]


class Levels(NamedTuple):
    """How far each level of a depth-first walk is; row 0 is the node it starts from."""

    at: np.ndarray  # [D + 1] the child it is at
    count: np.ndarray  # [D + 1] children
    player: np.ndarray  # [D + 1] who chooses among them
    low: np.ndarray  # [D + 1] S_comp below which it makes no difference at the root
    high: np.ndarray  # [D + 1] S_comp above which it does not


class Found(NamedTuple):
    """The children of the root, in the game's order, and how large the tree was."""

    action: np.ndarray  # [n]
    comp: np.ndarray  # [n] copied up
    coop: np.ndarray  # [n]
    best: int  # the child that is chosen, the first of equals; NO_CHILD where there is none
    nodes: np.ndarray  # [D + 1] made at each depth, the root at 0: the actions kept
    considered: np.ndarray  # [D + 1] the same before the game's pruning


def expand(game, state, children):
    """Stands where a game's own is plugged in: nothing can be done."""
    return 0, 0, SEARCHER


@kernel
def no_more(game, children, count):
    """``leaves`` of a game whose scores end with the tree."""


leaves = no_more  # stands where a game's own is plugged in


@kernel
def empty_children(count, size):
    """Room for ``count`` nodes whose states have ``size`` numbers."""
    return Children(
        np.empty(count, dtype=np.int64), np.empty(count), np.empty(count), np.empty((count, size))
    )


@kernel
def part(children, first, stop):
    """Rows ``first`` to ``stop``, not copied."""
    return Children(
        children.action[first:stop],
        children.comp[first:stop],
        children.coop[first:stop],
        children.state[first:stop],
    )


@lean_kernel
def copy_row(source, n, target, m):
    """Row n of one becomes row m of the other."""
    target.action[m] = source.action[n]
    target.comp[m], target.coop[m] = source.comp[n], source.coop[n]
    for s in range(source.state.shape[1]):
        target.state[m, s] = source.state[n, s]


@lean_kernel
def add_path(nodes, n, first, count):
    """Eq. 1: what the edges to node n's children add becomes the sum along the path."""
    comp, coop = nodes.comp, nodes.coop
    for c in range(first, first + count):
        comp[c] += comp[n]
        coop[c] += coop[n]


@lean_kernel
def preferred(nodes, first, count, player):
    """Eq. 3: the row that ``player`` chooses, the first of equals."""
    comp, coop = nodes.comp, nodes.coop
    sign = 1.0 if player == SEARCHER else -1.0  # argmin(comp - coop) = argmax(-comp + coop)
    best, most = first, sign * comp[first] + coop[first]
    for c in range(first + 1, first + count):
        score = sign * comp[c] + coop[c]
        if score > most:
            best, most = c, score
    return best


@lean_kernel
def copy_up(nodes, n, first, count, player):
    """Eq. 2: node n has the scores of the child that ``player`` chooses."""
    best = preferred(nodes, first, count, player)
    nodes.comp[n], nodes.coop[n] = nodes.comp[best], nodes.coop[best]


@lean_kernel
def narrow(levels, d, comp):
    """A child at level d is worth ``comp``: True where the rest of them make no difference.

    Alpha-beta (Knuth, Moore 1975): whoever chose above already has something as good.
    """
    if levels.player[d] == SEARCHER:
        levels.low[d] = max(levels.low[d], comp)
    else:
        levels.high[d] = min(levels.high[d], comp)
    return levels.low[d] >= levels.high[d]


@kernel
def ascending(scores):
    """The order in which a few scores ascend; equals stay as they are."""
    order = np.empty(scores.shape[0], dtype=np.int64)
    for c in range(scores.shape[0]):
        order[c] = c
    for c in range(1, scores.shape[0]):
        n, at = order[c], c
        while at > 0 and scores[order[at - 1]] > scores[n]:
            order[at] = order[at - 1]
            at -= 1
        order[at] = n
    return order


@kernel
def best_first(nodes, first, count, player):
    """Order children so that what ``player`` prefers at once comes first: bounds come sooner."""
    sign = -1.0 if player == SEARCHER else 1.0
    scores = np.empty(count)
    for c in range(count):
        scores[c] = sign * nodes.comp[first + c]
    order = ascending(scores)
    kept = empty_children(count, nodes.state.shape[1])
    for c in range(count):
        copy_row(nodes, first + c, kept, c)
    for c in range(count):
        copy_row(kept, order[c], nodes, first + c)


def descend(game, depth, most, block, levels, prune, nodes, considered):
    """Search ``depth`` levels below row 0 of ``block``, whose scores are the sums along its path.

    Then they are those copied up. block [(depth + 1) M]: level d's children from row d M on. nodes,
    considered [depth + 1] are added to, but for the node itself. Where ``prune`` is set all of coop
    is 0, and outside of levels.low[0] and high[0] scores are only bounds.
    """
    at, count, player, low, high = levels
    d, at[0], count[0] = 0, 0, 1
    while True:
        n, below = d * most + at[d], (d + 1) * most
        kept = 0
        if depth > 0:
            children = part(block, below, below + most)
            kept, before, player[d + 1] = expand(game, block.state[n], children)
            nodes[d + 1] += kept
            considered[d + 1] += before
            add_path(block, n, below, kept)
        if kept > 0 and d + 1 < depth:
            if prune:  # coop is 0: of equals it makes no difference which comes first
                best_first(block, below, kept, player[d + 1])
            d += 1
            at[d], count[d] = 0, kept
            low[d], high[d] = low[d - 1], high[d - 1]
            continue
        first, last = (below, below + kept) if kept > 0 else (n, n + 1)
        leaves(game, part(block, first, last), last - first)
        if kept > 0:
            copy_up(block, n, below, kept, player[d + 1])
        at[d] += 1
        while d > 0 and (
            at[d] == count[d] or (prune and narrow(levels, d, block.comp[d * most + at[d] - 1]))
        ):
            copy_up(block, (d - 1) * most + at[d - 1], d * most, at[d], player[d])
            d -= 1
            at[d] += 1
        if d == 0:
            return


class Top(NamedTuple):
    """The first levels of the tree, one after the other."""

    nodes: Children
    child: np.ndarray  # [expanded] row of the first child
    count: np.ndarray  # [expanded] children
    player: np.ndarray  # [expanded] who chooses among them
    made: np.ndarray  # [D + 1] nodes at each depth
    considered: np.ndarray  # [D + 1]


# What does not call the game is compiled once for all games.


@kernel
def only_root(state, depth, most, enough):
    """A Top with room for every level that has less than ``enough`` nodes, and their children."""
    room = 1 + depth * enough
    top = Top(
        empty_children(1 + depth * enough * most, state.shape[0]),
        np.empty(room, np.int64),
        np.empty(room, np.int64),
        np.empty(room, np.int64),
        np.zeros(depth + 1, np.int64),
        np.zeros(depth + 1, np.int64),
    )
    top.count[0], top.player[0] = 0, SEARCHER
    top.made[0] = top.considered[0] = 1
    top.nodes.comp[0] = top.nodes.coop[0] = 0.0
    for s in range(state.shape[0]):
        top.nodes.state[0, s] = state[s]
    return top


@kernel
def empty_levels(depth, player):
    """Levels of a walk from one of the nodes among which ``player`` chooses."""
    levels = Levels(
        np.empty(depth + 1, np.int64),
        np.empty(depth + 1, np.int64),
        np.empty(depth + 1, np.int64),
        np.empty(depth + 1),
        np.empty(depth + 1),
    )
    levels.player[0], levels.low[0], levels.high[0] = player, -np.inf, np.inf
    return levels


@kernel
def put_together(top, start, level, made, considered):
    """The Found of a tree of which all is known below row ``start`` of its top.

    made, considered [workers, D + 1 - level] are what the workers counted.
    """
    for w in range(made.shape[0]):
        for d in range(made.shape[1]):
            top.made[level + d] += made[w, d]
            top.considered[level + d] += considered[w, d]
    nodes, count, player = top.nodes, top.count, top.player
    for n in range(start - 1, -1, -1):
        if count[n] > 0:
            copy_up(nodes, n, top.child[n], count[n], player[n])
    best = preferred(nodes, 1, count[0], player[0]) - 1 if count[0] > 0 else NO_CHILD
    first = part(nodes, 1, 1 + count[0])
    return Found(
        first.action.copy(), first.comp.copy(), first.coop.copy(), best, top.made, top.considered
    )


def expand_top(game, state, depth, most, enough):
    """The levels of the tree from ``state`` [S] down to the first with ``enough`` nodes.

    The root is expanded always, other nodes only where their children are not the tree's last
    level. Returns a Top, the number of its levels, and the first and stop row of the lowest: what
    is below these is still to be searched. What had no children is a leaf, not yet played.
    """
    top = only_root(state, depth, most, enough)
    nodes, child, count, player = top.nodes, top.child, top.count, top.player
    start, stop, level = 0, 1, 0
    while level < depth and (level == 0 or (0 < stop - start < enough and level < depth - 1)):
        end = stop
        for n in range(start, stop):
            child[n] = end
            children = part(nodes, end, end + most)
            count[n], before, player[n] = expand(game, nodes.state[n], children)
            add_path(nodes, n, end, count[n])
            end += count[n]
            top.considered[level + 1] += before
        start, stop, level = stop, end, level + 1
        top.made[level] = stop - start
    return top, level, start, stop


def work(game, nodes, start, stop, step, left, most, player, prune, made, considered):
    """Search ``left`` levels below every ``step``-th of nodes ``start`` to ``stop``, among which
    ``player`` chooses.

    made, considered [left + 1] are added to.
    """
    block = empty_children((left + 1) * most, nodes.state.shape[1])
    levels = empty_levels(left, player)
    sign = 0.0 if not prune else -1.0 if player == SEARCHER else 1.0  # equals stay in their order
    scores = np.empty(max((stop - start + step - 1) // step, 0))
    for w in range(scores.shape[0]):
        scores[w] = sign * nodes.comp[start + w * step]
    for w in ascending(scores):
        n = start + w * step
        copy_row(nodes, n, block, 0)
        descend(game, left, most, block, levels, prune, made, considered)
        copy_row(block, 0, nodes, n)
        if prune:
            # One as good is found exactly, wherever it stands: the first of equals is chosen.
            short = np.inf if player == OPPONENT else -np.inf
            narrow(levels, 0, np.nextafter(block.comp[0], short))


@cache
def threads(count: int) -> ThreadPoolExecutor:
    """As many threads, kept for the next search. Kernels let go of the interpreter's lock."""
    return ThreadPoolExecutor(count, thread_name_prefix="search")


class Search(NamedTuple):
    """``search`` of one game: (game, state, depth, most, prune) -> Found."""

    serial: Any  # on the calling thread
    parallel: Any  # on all cores; the same bytes


def make_search(expand: Callable[..., Any], leaves: Callable[..., Any] = no_more) -> Search:
    """The search of the game that ``expand`` and ``leaves`` play, compiled when first called."""
    begin = plugged(expand_top, expand=expand)
    dig = plugged(work, descend=plugged(descend, expand=expand, leaves=leaves))

    def search(cores: int, game, state, depth: int, most: int, prune: bool) -> Found:
        """Search ``depth`` levels below ``state`` [S], of no more than ``most`` children each.

        Workers search below the first levels; what they find is put together in the tree's order.
        So the result does not depend on the number of threads.

        prune: skip what cannot change the choice and its scores. Only for games in which all of
        coop is 0; children of the root that are not chosen may then have a bound instead of their
        scores (not better than the best one's for whoever chooses), and the work is done on one
        core.
        """
        # Workers know nothing of each other's bounds; one that starts below the root has them all.
        enough = 1 if prune else TASKS
        workers = 1 if prune or cores == 1 else WORKERS * cores
        top, level, start, stop = begin(game, state, depth, most, enough)
        workers, left = max(min(workers, stop - start), 1), depth - level
        made = np.zeros((workers, left + 1), np.int64)
        considered = np.zeros((workers, left + 1), np.int64)
        player, nodes = top.player[0], top.nodes
        for n in np.flatnonzero(top.count[:start] == 0).tolist():
            dig(game, nodes, n, n + 1, 1, 0, most, player, False, made[0], considered[0])

        def turn(w: int) -> None:
            first = start + w
            dig(
                game, nodes, first, stop, workers, left, most, player, prune, made[w], considered[w]
            )

        if workers > 1:
            list(threads(cores).map(turn, range(workers)))
        else:
            for w in range(workers):
                turn(w)
        return put_together(top, start, level, made, considered)

    def serial(*args) -> Found:
        return search(1, *args)

    def parallel(*args) -> Found:
        return search(get_num_threads(), *args)

    return Search(serial, parallel)
