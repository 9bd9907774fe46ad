"""What is wrong with the actions that whole game trees look at (Shum et al. 2012, Table V)."""

from __future__ import annotations

import numpy as np

from kumite.kernels import game as fight
from kumite.kernels import moves as kernels
from kumite.kernels import prune
from kumite.kernels.jit import kernel, lean_kernel
from kumite.kernels.search import empty_children

RULES = {  # the most important first
    "overlap": prune.OVERLAPS | prune.ENDS_INSIDE,
    "not facing": prune.TURNED_AWAY,
    "out of range": prune.TOO_FAR,
    "illogical": prune.ILLOGICAL,
}
COMBINATIONS = 2 * prune.LEAVES  # of flaws
NODES, KEPT, PUT_UP, COUNTS = COMBINATIONS, COMBINATIONS + 1, COMBINATIONS + 2, COMBINATIONS + 3


@lean_kernel
def judged(game, state, way, flaws):
    """Flaws of each action that can be done in a state; how many there are. way [m, 5]: room."""
    p = kernels.next_player(state)
    here = game.successor[int(state[p * kernels.FIELDS + kernels.STRETCH])]
    stretches = game.stretch[game.action_start[here] : game.action_start[here + 1]]
    fight.look_at(game, state, stretches, way, flaws[: stretches.shape[0]])
    return stretches.shape[0]


@kernel
def counted(game, state, children, flaws, counts):
    """Expand one node, and count what is wrong with what it offers."""
    rival = 1 - kernels.next_player(state)
    lasts = game.duration[int(state[rival * kernels.FIELDS + kernels.STRETCH])]
    offered = judged(game, state, np.empty((lasts // game.stride + 2, 5)), flaws)
    for n in range(offered):
        counts[flaws[n]] += 1
    kept, _, _ = fight.expand(game, state, children)
    counts[NODES] += 1
    counts[KEPT] += kept
    counts[PUT_UP] += 1 if prune.fewest(flaws[:offered]) > 0 else 0
    return kept


@kernel
def tally(game, state, most, counts):
    """Count over all expanded nodes of a whole tree of three levels."""
    flaws = np.empty(most, dtype=np.int64)
    a = empty_children(most, state.shape[0])
    b = empty_children(most, state.shape[0])
    c = empty_children(most, state.shape[0])
    for i in range(counted(game, state, a, flaws, counts)):
        for j in range(counted(game, a.state[i], b, flaws, counts)):
            counted(game, b.state[j], c, flaws, counts)


def tallied(tree, decide, counts, state, players, recent, others):
    """Decide as the tree does, and add to counts [COUNTS] what a whole tree of three levels saw."""
    now = min(state[kernels.END], state[kernels.FIELDS + kernels.END])
    here = np.zeros_like(counts)
    tally(tree.game(players, recent, now, others), state, tree.most, here)
    if not counts.any():  # once a fight: the same numbers as the search itself tells
        whole = decide(state, players, recent, others, bounds=False)
        assert whole.nodes[1:].sum() == here[KEPT]
        assert whole.considered[1:].sum() == here[:COMBINATIONS].sum()
    counts += here
    return decide(state, players, recent, others)
