"""Game-tree search against a slow twin, trees worked by hand, and a small game in time."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np
import pytest

from kumite.kernels.jit import kernel
from kumite.kernels.search import (
    NO_CHILD,
    OPPONENT,
    SEARCHER,
    Found,
    Search,
    make_search,
)
from tests.reference import Edge, PlainFound, game_tree


class Tree(NamedTuple):
    """A game that is a list of its nodes; the state is the node's number."""

    child: np.ndarray  # [N] the first child; the others follow it
    count: np.ndarray  # [N]
    considered: np.ndarray  # [N]
    player: np.ndarray  # [N]
    comp: np.ndarray  # [N] of the edge to the node, as the searcher sees it
    coop: np.ndarray  # [N]
    more: np.ndarray  # [N, 2] comp and coop, where the search ends at the node


@kernel
def expand_tree(game, state, children):
    n = int(state[0])
    for i in range(game.count[n]):
        c = game.child[n] + i
        children.action[i] = c
        children.comp[i], children.coop[i] = game.comp[c], game.coop[c]
        children.state[i, 0] = c
    return game.count[n], game.considered[n], game.player[n]


@kernel
def tree_leaves(game, children, count):
    for i in range(count):
        n = int(children.state[i, 0])
        children.comp[i] += game.more[n, 0]
        children.coop[i] += game.more[n, 1]


TREE = make_search(expand_tree, tree_leaves)
ROOT = np.zeros(1)


class PlainTree:
    def __init__(self, tree: Tree):
        self.tree = tree

    def player(self, state: int) -> int:
        return int(self.tree.player[state])

    def considered(self, state: int) -> int:
        return int(self.tree.considered[state])

    def edges(self, state: int) -> list[Edge]:
        t = self.tree
        children = range(t.child[state], t.child[state] + t.count[state])
        return [Edge(c, float(t.comp[c]), float(t.coop[c]), c) for c in children]

    def leaf(self, state: int) -> tuple[float, float]:
        return float(self.tree.more[state, 0]), float(self.tree.more[state, 1])


def random_tree(seed: int, depth: int, coop: bool = True, whole: bool = False) -> Tree:
    """0 to 5 children a node (the root: at least one), whoever chooses; whole: scores are small
    whole numbers, so that there are many equals."""
    rng = np.random.default_rng(seed)
    level, counts, first, size = [0], [], [], 1
    for d in range(depth):
        count = rng.integers(1 if d == 0 else 0, 6, len(level))
        counts += list(count)
        first += list(size + np.cumsum(count) - count)
        level = list(range(size, size + int(count.sum())))
        size += len(level)
    child, count = np.zeros(size, np.int64), np.zeros(size, np.int64)
    child[: len(first)], count[: len(counts)] = first, counts
    scores = rng.integers(-2, 3, (size, 4)) if whole else rng.normal(size=(size, 4))
    scores = scores.astype(float) * ([1, 1, 1, 1] if coop else [1, 0, 1, 0])
    considered = count + rng.integers(0, 4, size)
    player = rng.integers(0, 2, size)
    comp, more, other = scores[:, 0], scores[:, 2:], scores[:, 1]
    return Tree(child, count, considered, player, comp.copy(), other.copy(), more.copy())


def same(found: Found, expected: PlainFound) -> None:
    """To the last bit: both add in the same order."""
    assert list(found.nodes) == expected.nodes
    assert list(found.considered) == expected.considered
    assert list(zip(found.action, found.comp, found.coop)) == expected.children
    assert found.best == (NO_CHILD if expected.best is None else expected.best)
    if expected.best is not None:
        assert (found.comp[found.best], found.coop[found.best]) == expected[:2]


@pytest.mark.parametrize("depth", range(1, 6))
@pytest.mark.parametrize("whole", [False, True])
def test_random_trees_as_the_twin(depth: int, whole: bool):
    for seed in range(40 if depth < 5 else 12):
        tree = random_tree(seed, 5, whole=whole)
        expected = game_tree(PlainTree(tree), 0, depth)
        same(TREE.serial(tree, ROOT, depth, 5, False), expected)
        same(TREE.parallel(tree, ROOT, depth, 5, False), expected)


@pytest.mark.jit_off
def test_a_random_tree_as_the_twin_without_compiling_too():
    tree = random_tree(1, 4)
    for depth in range(5):
        expected = game_tree(PlainTree(tree), 0, depth)
        same(TREE.serial(tree, ROOT, depth, 5, False), expected)
        same(TREE.parallel(tree, ROOT, depth, 5, False), expected)


@pytest.mark.parametrize("whole", [False, True])
def test_pruning_keeps_the_choice_and_its_scores(whole: bool):
    fewer = 0
    for seed in range(120):
        tree, depth = random_tree(seed, 5, coop=False, whole=whole), 2 + seed % 4
        full = TREE.serial(tree, ROOT, depth, 5, False)
        for search in TREE:
            short = search(tree, ROOT, depth, 5, True)
            assert short.best == full.best and np.array_equal(short.action, full.action)
            assert short.comp[short.best] == full.comp[full.best]
            sign = 1.0 if tree.player[0] == SEARCHER else -1.0
            assert np.all(sign * full.comp <= sign * short.comp)  # a bound, on the safe side
            assert np.all(short.nodes <= full.nodes)
            fewer += short.nodes.sum() < full.nodes.sum()
    assert fewer > 100


# Trees worked by hand. F is what an edge is worth to whoever takes it: (F_comp, F_coop, below).


class Choice(NamedTuple):
    player: int
    edges: tuple  # of (F_comp, F_coop, Choice or None)


def blue(*edges) -> Choice:
    return Choice(SEARCHER, edges)


def red(*edges) -> Choice:
    return Choice(OPPONENT, edges)


def tree_of(root: Choice) -> Tree:
    rows, todo = [[0, 0, SEARCHER, 0.0, 0.0]], [(0, root)]
    for n, node in todo:
        rows[n][:3] = [len(rows), len(node.edges), node.player]
        for comp, coop, below in node.edges:
            if below is not None:
                todo.append((len(rows), below))
            own = comp if node.player == SEARCHER else -comp
            rows.append([0, 0, SEARCHER, own, coop])
    child, count, player = np.array([row[:3] for row in rows], np.int64).T.copy()
    comp, coop = np.array([row[3:] for row in rows], float).T.copy()
    return Tree(child, count, count, player, comp, coop, np.zeros((len(rows), 2)))


def scores(root: Choice, depth: int) -> tuple[list[tuple[float, float]], int]:
    tree = tree_of(root)
    found = TREE.serial(tree, ROOT, depth, 5, False)
    same(found, game_tree(PlainTree(tree), 0, depth))
    return list(zip(found.comp.tolist(), found.coop.tolist())), found.best


FIGURE_3 = blue(
    (1, 0, red((2, 0, blue((5, 0, None), (0, 0, None))), (0, 0, blue((1, 0, None), (2, 0, None))))),
    (2, 0, red((4, 0, blue((3, 0, None), (4, 0, None))), (3, 0, blue((0, 0, None), (1, 0, None))))),
)


@pytest.mark.jit_off
def test_figure_3_both_act_at_once():
    """a1: red's b1 leads to 1 - 2 + 5 = 4, b2 to 1 - 0 + 2 = 3, so 3; a2: 2 - 4 + 4 = 2 and
    2 - 3 + 1 = 0, so 0. Two levels deep red looks no further than 1 - 2 and 2 - 4."""
    assert scores(FIGURE_3, 3) == ([(3.0, 0.0), (0.0, 0.0)], 0)
    assert scores(FIGURE_3, 2) == ([(-1.0, 0.0), (-2.0, 0.0)], 0)
    assert scores(FIGURE_3, 1) == ([(1.0, 0.0), (2.0, 0.0)], 1)


def test_figure_4_a_long_action_during_which_the_other_acts_twice():
    """Red chooses at t2 and, after a short b1, again at t3; both times the least for blue.

    Short b1, then b3: 6 - 1 - 4 + 2 = 3; then b4: 6 - 1 - 3 + 0 = 2; so 2. Long b2: 6 - 2 + 1 = 5.
    Were blue to choose at t3 it would be 3, and were it so in b2's place red would take 3.
    """
    short = red((4, 0, blue((2, 0, None), (1, 0, None))), (3, 0, blue((0, 0, None))))
    root = blue((6, 0, red((1, 0, short), (2, 0, blue((1, 0, None))))), (1, 0, None))
    assert scores(root, 4) == ([(2.0, 0.0), (1.0, 0.0)], 0)
    assert scores(root, 3) == ([(1.0, 0.0), (1.0, 0.0)], 0)  # 6 - 1 - 4: equal, so the first


def test_figure_5_a_hit_forces_a_reaction():
    """b1 is cut short by a hit worth 10 to blue: b2, the reaction, is all that is left to red.

    a1: b1 leads to 1 - 3 + (10 - 0) by the one edge that costs red 10, that is comp 8; the other
    way, b3, to 1 - 1 = 0. Red foresees it three levels deep, but not two: 1 - 3 = -2.
    """
    hit = red((-10, 0, None))
    root = blue((1, 0, red((3, 0, hit), (1, 0, None))), (-1, 0, None))
    assert scores(root, 3) == ([(0.0, 0.0), (-1.0, 0.0)], 0)
    assert scores(root, 2) == ([(-2.0, 0.0), (-1.0, 0.0)], 1)


@pytest.mark.jit_off
def test_figure_6_two_scores():
    """Left, Eq. 1: along e0 (blue) = (4, 1), e1 (red) = (3, 2), e2 (blue) = (2, 5) the leaf has
    S_comp = 4 - 3 + 2 = 3 and S_coop = 1 + 2 + 5 = 8.

    Right, Eqs. 2 and 3. Below e1 blue has (3, 8) or, by an edge (6, 0), (7, 3): the sums are 11
    and 10, so (3, 8). Red's other way, (5, 1), leads to (-1, 2) and by an edge (1, 1) to (0, 3).
    Red takes the smaller of 3 - 8 = -5 and 0 - 3 = -3: e1, although that gives blue more. At the
    root blue has 3 + 8 = 11 by e0 and by another edge, (9, 1), 10.
    """
    after = red(
        (3, 2, blue((2, 5, None), (6, 0, None))),
        (5, 1, blue((1, 1, None))),
    )
    root = blue((9, 1, None), (4, 1, after))
    assert scores(root, 3) == ([(9.0, 1.0), (3.0, 8.0)], 1)


def test_of_equals_the_first_is_chosen():
    for choose in (blue, red):
        assert scores(choose((1, 0, None), (1, 0, None), (1, 0, None)), 1)[1] == 0
    assert scores(blue((0, 0, None), (1, 2, None), (2, 1, None)), 1)[1] == 1
    assert scores(red((0, 0, None), (1, 2, None), (2, 1, None)), 1)[1] == 1
    below = red((1, 1, None), (2, 0, None))  # equal to red, not to blue
    assert scores(blue((0, 0, below)), 2) == ([(-1.0, 1.0)], 0)


def test_a_root_without_children_has_no_choice():
    tree = tree_of(blue())
    for search in TREE:
        for depth in (0, 1, 3):
            found = search(tree, ROOT, depth, 5, False)
            assert found.best == NO_CHILD and len(found.action) == 0
            assert found.nodes.tolist() == [1] + [0] * depth


def test_a_chain_of_forced_choices_is_split_further_down():
    """One child, one grandchild, then many: the workers share what is below."""
    leaf = blue((1, 0, None), (2, 0, None))
    wide = red(*[(k % 3, 0, leaf) for k in range(5)])
    wider = blue(*[(k % 2, 0, wide) for k in range(5)])
    root = blue((1, 0, red((2, 0, blue((3, 0, wider))))))
    tree = tree_of(root)
    expected = game_tree(PlainTree(tree), 0, 6)
    for search in TREE:
        same(search(tree, ROOT, 6, 5, False), expected)


@pytest.mark.parametrize("threads", [1, 2])
def test_the_same_bytes_whatever_the_number_of_threads(threads: int):
    before = numba.get_num_threads()
    tree = random_tree(4, 5)
    serial = TREE.serial(tree, ROOT, 5, 5, False)
    try:
        numba.set_num_threads(min(threads, before))
        parallel = TREE.parallel(tree, ROOT, 5, 5, False)
    finally:
        numba.set_num_threads(before)
    assert serial.nodes.sum() > 500
    for one, other in zip(serial, parallel):
        assert np.asarray(one).tobytes() == np.asarray(other).tobytes()


# A game in time: two fighters, each with a state machine of actions that differ in length.

STAND, LUNGE, STAGGER = range(3)
NEVER = -1.0
END, INTO, LANDS, DOING = range(4)  # columns of a fighter in the state, the opponent's after it
DISTANCE = 8


class Duel(NamedTuple):
    """What each of A actions does; whole numbers and halves, so that every sum is exact."""

    first: np.ndarray  # [N + 1] the actions of each state
    duration: np.ndarray  # [A]
    into: np.ndarray  # [A] the state it leads to
    lands: np.ndarray  # [A] after which time its blow lands, or NEVER
    reach: np.ndarray  # [A]
    step: np.ndarray  # [A] added to the distance
    guards: np.ndarray  # [A] bool: no blow counts meanwhile
    style: np.ndarray  # [A] F_coop


#        duration, into,  lands, reach, step, guards, style
ACTIONS = {
    STAND: [
        (3, STAND, 2, 2, 0, False, 1),  # jab
        (7, LUNGE, 5, 4, -1, False, 2),  # lunge
        (2, STAND, NEVER, 0, 0, True, 0),  # guard
        (3, STAND, NEVER, 0, 1, False, 0.5),  # step back
        (4, STAND, NEVER, 0, -1, False, 0),  # step in
    ],
    LUNGE: [
        (2, STAND, NEVER, 0, 1, False, 0),  # recover
        (5, LUNGE, 3, 3, 0, False, 1.5),  # strike again
    ],
    STAGGER: [(6, STAND, NEVER, 0, 1, False, 0)],
}


def duel() -> Duel:
    count = [len(ACTIONS[s]) for s in (STAND, LUNGE, STAGGER)]
    columns = [np.array(c) for c in zip(*(a for s in ACTIONS for a in ACTIONS[s]))]
    duration, into, lands, reach, step, guards, style = columns
    first = np.concatenate([[0], np.cumsum(count)])
    return Duel(
        first,
        duration.astype(float),
        into.astype(float),
        lands.astype(float),
        reach.astype(float),
        step.astype(float),
        guards.astype(bool),
        style.astype(float),
    )


@kernel
def land_blows(game, state):
    """Play on until a fighter is about to choose: what the blows on the way are worth to 0."""
    worth = 0.0
    while True:
        until = min(state[END], state[4 + END])
        who, when = -1, until
        for k in range(2):
            lands = state[4 * k + LANDS]
            if lands != NEVER and (lands < when or (lands == when and who == -1)):
                who, when = k, lands
        if who == -1:
            return worth
        doing, victim = int(state[4 * who + DOING]), 4 * (1 - who)
        state[4 * who + LANDS] = NEVER
        guarded = game.guards[int(state[victim + DOING])]
        if state[DISTANCE] <= game.reach[doing] and not guarded:
            worth += 3.0 if who == 0 else -3.0
            state[victim + END], state[victim + INTO] = when, STAGGER
            state[victim + LANDS] = NEVER


@kernel
def expand_duel(game, state, children):
    player = SEARCHER if state[END] <= state[4 + END] else OPPONENT
    me = 4 * player
    now, here = state[me + END], int(state[me + INTO])
    first, last = game.first[here], game.first[here + 1]
    count = 0
    for far in range(2):  # blows out of reach only where there is nothing else
        for a in range(first, last):
            if count > 0 and far == 1:
                break
            if far == 0 and game.lands[a] != NEVER and state[DISTANCE] > game.reach[a] + 1.0:
                continue
            after = children.state[count]
            for s in range(state.shape[0]):
                after[s] = state[s]
            after[me + END], after[me + INTO] = now + game.duration[a], game.into[a]
            after[me + LANDS] = NEVER if game.lands[a] == NEVER else now + game.lands[a]
            after[me + DOING] = a
            after[DISTANCE] += game.step[a]
            children.action[count] = a
            children.comp[count] = land_blows(game, after)
            children.coop[count] = game.style[a]
            count += 1
    return count, last - first, player


@kernel
def duel_leaves(game, children, count):
    for i in range(count):  # sooner free is better, and near is lively
        state = children.state[i]
        children.comp[i] += 0.25 * (state[4 + END] - state[END])
        children.coop[i] -= 0.5 * state[DISTANCE]


DUEL = make_search(expand_duel, duel_leaves)
START = np.array([0, STAND, NEVER, 2, 1, STAND, NEVER, 2, 3], float)


class Doing(NamedTuple):
    end: float
    into: int
    blow: tuple[float, float] | None  # when and how far
    guards: bool


class PlainDuel:
    """The same game by its rules, with events in a list."""

    def player(self, state) -> int:
        return 0 if state[0].end <= state[1].end else 1

    def considered(self, state) -> int:
        return len(ACTIONS[state[self.player(state)].into])

    def edges(self, state) -> list[Edge]:
        who = self.player(state)
        now, here, distance = state[who].end, state[who].into, state[2]
        numbered = [
            (sum(len(ACTIONS[s]) for s in range(here)) + n, action)
            for n, action in enumerate(ACTIONS[here])
        ]
        near = [(n, a) for n, a in numbered if a[2] == NEVER or distance <= a[3] + 1]
        edges = []
        for n, (duration, into, lands, reach, step, guards, style) in near or numbered:
            fighters = list(state[:2])
            blow = None if lands == NEVER else (now + lands, reach)
            fighters[who] = Doing(now + duration, into, blow, guards)
            worth, fighters = self.play_on(fighters, distance + step)
            edges.append(Edge(n, worth, style, (*fighters, distance + step)))
        return edges

    def play_on(self, fighters: list[Doing], distance: float):
        worth = 0.0
        while True:
            until = min(f.end for f in fighters)
            events = [(f.blow[0], k) for k, f in enumerate(fighters) if f.blow]
            events = sorted(event for event in events if event[0] <= until)
            if not events:
                return worth, fighters
            when, k = events[0]
            blow, victim = fighters[k].blow, fighters[1 - k]
            fighters[k] = fighters[k]._replace(blow=None)
            if blow and distance <= blow[1] and not victim.guards:
                worth += (3.0, -3.0)[k]
                fighters[1 - k] = victim._replace(end=when, into=STAGGER, blow=None)

    def leaf(self, state) -> tuple[float, float]:
        return 0.25 * (state[1].end - state[0].end), -0.5 * state[2]


GUARDING = Doing(0, STAND, None, True)
PLAIN_START = (GUARDING, GUARDING._replace(end=1), 3.0)


@pytest.mark.parametrize("depth", range(1, 6))
def test_a_duel_as_the_twin(depth: int):
    expected = game_tree(PlainDuel(), PLAIN_START, depth)
    for search in DUEL:
        same(search(duel(), START, depth, 5, False), expected)


@pytest.mark.jit_off
def test_a_duel_as_the_twin_without_compiling_too():
    expected = game_tree(PlainDuel(), PLAIN_START, 3)
    same(DUEL.serial(duel(), START, 3, 5, False), expected)


def test_the_size_and_the_choices_of_a_duel():
    """Golden numbers: nodes at each depth, the same before pruning, and what is chosen."""
    found = DUEL.serial(duel(), START, 6, 5, False)
    assert found.nodes.tolist() == [1, 5, 24, 92, 349, 1282, 4762]
    assert found.considered.tolist() == [1, 5, 25, 96, 366, 1354, 5049]
    assert found.action.tolist() == [0, 1, 2, 3, 4] and found.best == 0
    assert found.comp.tolist() == [1.5, -8.5, 1.5, 1.25, -8.5]  # a lunge or a step in is answered
    assert found.coop.tolist() == [5.5, 5.0, 5.0, 4.5, 3.0]


@pytest.mark.parametrize("name", Search._fields)
def test_a_second_process_compiles_nothing(name: str):
    tree, depth = random_tree(3, 5), 4
    found = getattr(TREE, name)(tree, ROOT, depth, 5, False)
    again = f"""
from numba.core import event
from tests import test_search as t
with event.install_recorder("numba:compile") as compiled:
    found = t.TREE.{name}(t.random_tree(3, 5), t.ROOT, {depth}, 5, False)
print(found.best, len(compiled.buffer))
"""
    root = Path(__file__).parent.parent
    path = os.pathsep.join([str(root / "src"), str(root)])
    done = subprocess.run(
        [sys.executable, "-c", again],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == [str(found.best), "0"]


def test_only_what_can_be_found_again_is_plugged_in():
    def expand(game, state, children):
        return 0, 0, SEARCHER

    with pytest.raises(TypeError, match="functions of a module"):
        make_search(kernel(expand))
