"""The fight as a game: against a slow twin, and cases worked by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kumite import mocap as mocap_files
from kumite.control.game_tree import SEARCH, GameTree, Player, halts
from kumite.control.styles import STYLES, Style
from kumite.errors import KumiteError
from kumite.graph import ActionTable, Layer, build_actions
from kumite.kernels import moves as kernels
from kumite.kernels.game import expand, flaws_of, leaves
from kumite.kernels.moves import ATTACK, DEFENCE, NOTHING
from kumite.kernels.search import empty_children
from kumite.rotation import planar_apply
from tests import toys
from tests.game_twin import (
    STANCE,
    Fighter,
    Moment,
    Move,
    Side,
    Tip,
    Toy,
    as_state,
    fenced,
    random_toy,
    standing,
    still,
    turned,
    walk,
)
from tests.reference import game_tree


class Child(NamedTuple):
    action: int
    comp: float
    coop: float
    state: np.ndarray

    def fighter(self, p: int) -> Fighter:
        row = self.state[p * kernels.FIELDS : (p + 1) * kernels.FIELDS]
        return Fighter(int(row[0]), int(row[1]), int(row[2]), row[3:6], int(row[6]))


def expanded(toy: Toy, now: Moment | np.ndarray, leaf: bool = False) -> list[Child]:
    """What the kernel makes of a moment, by ``leaf`` with what is expected beyond."""
    state = as_state(now) if isinstance(now, Moment) else now
    children = empty_children(toy.most, kernels.STATE)
    game = toy.game()
    count, _, _ = expand(game, state, children)
    if leaf:
        leaves(game, children, count)
    rows = zip(children.action, children.comp, children.coop, children.state)
    return [Child(int(a), float(m), float(o), s) for a, m, o, s in list(rows)[:count]]


# Against the twin --------------------------------------------------------------------------------


def same_edges(toy: Toy, now: Moment) -> None:
    edges, children, ends = toy.edges(now), expanded(toy, now), expanded(toy, now, leaf=True)
    assert [c.action for c in children] == [e.action for e in edges]
    for edge, child, leaf in zip(edges, children, ends):
        assert child[1:3] == pytest.approx(edge[1:3], abs=1e-8)
        for p, expected in enumerate(edge.state.fighters):
            fighter = child.fighter(p)
            assert fighter[:3] == expected[:3] and fighter.landed == expected.landed
            off = fighter.anchor - expected.anchor
            assert np.allclose([*off[:2], math.sin(off[2] / 2)], 0, atol=1e-9)
        more = (leaf.comp - child.comp, leaf.coop - child.coop)
        assert more == pytest.approx(toy.leaf(edge.state), abs=1e-7)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.booleans())
def test_expand_and_leaves_as_the_twin(seed: int, brawl: bool):
    toy, now = random_toy(seed, brawl)
    same_edges(toy, now)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.booleans())
def test_in_an_arena_as_the_twin(seed: int, brawl: bool):
    toy, now = random_toy(seed, brawl)
    fenced(toy, now, seed)
    same_edges(toy, now)


# What the twin has found: blows that met the wrong sphere first; a catch before a blow that was
# looked for where the victim reacts; all that overlap; what was in range when it was begun.
@pytest.mark.jit_off
@pytest.mark.parametrize("seed", [82, 114, 230, 289, 317, 412, 550, 593, 632, 779])
def test_toys_on_which_the_twin_once_differed(seed: int):
    same_edges(*random_toy(seed, seed % 2 == 0))


@pytest.mark.parametrize(
    ("depth", "seed"), [(1, 4), (1, 5), *[(2, s) for s in range(10, 18)], (3, 1), (3, 2), (3, 6)]
)
def test_the_search_as_the_twin(depth: int, seed: int):
    toy, now = random_toy(seed, seed % 2 == 0)
    expected = game_tree(toy, now, depth)
    for search in SEARCH:
        found = search(toy.game(), as_state(now), depth, toy.most, False)
        assert found.nodes.tolist() == expected.nodes
        assert found.considered.tolist() == expected.considered
        assert found.action.tolist() == [child[0] for child in expected.children]
        scores = np.stack([found.comp, found.coop], axis=1)
        assert scores == pytest.approx(np.array([c[1:] for c in expected.children]), abs=1e-7)
        assert found.best == expected.best


@pytest.mark.parametrize("seed", range(20))
def test_it_makes_no_difference_where_in_the_scene_they_are(seed: int):
    toy, now = random_toy(seed, seed % 2 == 0)
    for side in toy.sides:
        side.goal, side.style = None, side.style.changed(heading=0.0)
    toy.third = toy.third[:0]
    here, there = expanded(toy, now), expanded(toy, turned(now, toy, (3.0, -7.0, 2.5)))
    assert [c.action for c in here] == [c.action for c in there]
    assert [c.comp for c in here] == pytest.approx([c.comp for c in there], abs=1e-8)
    assert [c.coop for c in here] == [c.coop for c in there]


# Worked by hand ----------------------------------------------------------------------------------
# One stands at the origin and looks along z, the other looks back at it from ``far`` m away.

FREE = Style(facing=0.0, distance=0.0, given_short=0.0, given_long=0.0, taken=0.0, suitability=0.0)
BLOWS = FREE.changed(given_long=100.0, given_short=10.0, taken=1.0)
HEAD_HEIGHT = STANCE[0, 1]
STAND, JAB, REACT, PASS = range(4)


def jab(blow: int = 0, speed: float = 6.0, short: bool = False) -> Move:
    """10 frames; in the fourth the fist goes from 0.4 to 0.7 m ahead, at the height of the head."""
    tip = Tip(4, (0, HEAD_HEIGHT, 0.7), (0, HEAD_HEIGHT, 0.4), speed, blow)
    return still(10, kind=ATTACK, short=short, tips=[tip])


def facing(toy: Toy, far: float, other: int = STAND, end: int = 5) -> Moment:
    """The searcher chooses at 0; the other, ``far`` m away, until ``end`` does ``other``."""
    return Moment(
        (standing(STAND, 0, (0, 0, 0), toy), standing(other, end, (0, far, math.pi), toy))
    )


def boxing(choices: list[int], style: Style = BLOWS, **more) -> Toy:
    """STAND, JAB, REACT (8 frames, 0.4 m back), PASS (12 frames, 0.06 m to the left)."""
    moves = [still(10), jab(), walk(8, (0, -0.4, 0)), walk(12, (0.06, 0, 0))]
    sides = (Side(style), Side(style))
    options = {"sides": sides, "response": [[REACT] * 3] * 2, **more}
    return Toy(moves, [choices], **options)


@pytest.mark.jit_off
def test_a_blow_to_the_head():
    """D = 6 m/s * 2. At frame 4 the victim has done 6 of 12 frames: 0.03 m to its left, which is
    -x here. Its action is cut there, and the reaction begins."""
    toy = boxing([JAB])
    (child,) = expanded(toy, facing(toy, 0.8, PASS, end=10))
    assert child.comp == pytest.approx(100.0 * 12.0) and child.coop == 0.0
    me, victim = child.fighter(0), child.fighter(1)
    assert me[:3] == (JAB, 0, 10) and me.landed == 0
    assert victim[:3] == (REACT, 4, 12)
    assert victim.anchor == pytest.approx([-0.03, 0.8, math.pi])


def test_a_blow_of_the_opponent_and_one_of_short_range():
    toy = boxing([STAND])
    (child,) = expanded(toy, facing(toy, 0.8, JAB, end=10))
    assert child.comp == pytest.approx(-1.0 * 12.0)
    assert child.fighter(0)[:3] == (REACT, 4, 12)
    toy = boxing([JAB])
    toy.moves[JAB] = jab(short=True)
    (child,) = expanded(toy, facing(toy, 0.8, end=10))
    assert child.comp == pytest.approx(10.0 * 12.0)


def test_a_blow_to_the_trunk_and_what_it_does():
    """The speed says how it is answered: below 5.2 m/s, from there, and from 10 m/s."""
    low = STANCE[1, 1]
    for size, speed in enumerate((4.0, 5.2, 10.0)):
        toy = boxing([JAB], response=[[STAND, PASS, REACT], [NOTHING] * 3])
        tip = Tip(4, (0, low, 0.7), (0, low, 0.4), speed, 0)
        toy.moves[JAB] = still(10, kind=ATTACK, tips=[tip])
        (child,) = expanded(toy, facing(toy, 0.8, end=10))
        assert child.comp == pytest.approx(100.0 * speed)  # vulnerability 1
        assert child.fighter(1)[:2] == ((STAND, PASS, REACT)[size], 4)


def test_a_blow_that_nothing_answers_still_counts():
    toy = boxing([JAB], response=[[NOTHING] * 3] * 2)
    (child,) = expanded(toy, facing(toy, 0.8, end=10))
    assert child.comp == pytest.approx(1200.0) and child.fighter(1)[:3] == (STAND, 0, 10)


@pytest.mark.jit_off
def test_an_arm_in_the_way_stops_a_blow():
    toy = boxing([JAB])
    body = STANCE.copy()
    body[5] = 0, HEAD_HEIGHT, 0.25  # a hand before the face
    toy.moves[STAND].body[:] = body
    (child,) = expanded(toy, facing(toy, 0.8, end=10))
    assert child.comp == 0.0 and child.fighter(1)[:3] == (STAND, 0, 10)
    assert child.fighter(0).landed == 0  # the blow is spent


def test_the_first_sphere_on_the_way_is_met_though_another_is_larger():
    """The fist goes from 0 to 1 m. The head, 0.15 m about 1.0, is entered at 0.85; a guard behind
    it, 0.43 m about 1.35, at 0.92, although where the fist ends it is in that the deeper."""
    toy = boxing([JAB])
    tip = Tip(4, (0, HEAD_HEIGHT, 1.0), (0, HEAD_HEIGHT, 0.0), 6.0, 0)
    toy.moves[JAB] = still(10, kind=ATTACK, tips=[tip])
    toy.radius[5] = 0.40
    toy.moves[STAND].body[:, 5] = 0, HEAD_HEIGHT, -0.35
    (child,) = expanded(toy, facing(toy, 1.0, end=10))
    assert child.comp == pytest.approx(1200.0)


@pytest.mark.jit_off
def test_blows_of_one_frame_both_land():
    toy = boxing([JAB])
    (child,) = expanded(toy, facing(toy, 0.8, JAB, end=10))
    assert child.comp == pytest.approx(100.0 * 12.0 - 1.0 * 12.0)
    for p in range(2):
        assert child.fighter(p)[:3] == (REACT, 4, 12)
    assert child.fighter(0).anchor == pytest.approx([0, 0, 0])
    assert child.fighter(1).anchor == pytest.approx([0, 0.8, math.pi])


def test_the_sooner_blow_stops_the_later_one():
    toy = boxing([JAB])
    (child,) = expanded(toy, facing(toy, 0.8, JAB, end=9))  # begun a frame earlier
    assert child.comp == pytest.approx(-12.0)
    assert child.fighter(0)[:3] == (REACT, 3, 11) and child.fighter(1)[:3] == (JAB, -1, 9)


def test_a_blow_lands_once_and_the_next_one_again():
    toy = boxing([JAB], response=[[NOTHING] * 3] * 2)
    at, before = (0, HEAD_HEIGHT, 0.7), (0, HEAD_HEIGHT, 0.4)
    tips = [Tip(when, at, before, 6.0, blow) for when, blow in ((3, 0), (4, 0), (5, 1))]
    toy.moves[JAB] = still(10, kind=ATTACK, tips=tips)
    (child,) = expanded(toy, facing(toy, 0.8, end=10))
    assert child.comp == pytest.approx(2 * 1200.0) and child.fighter(0).landed == 1


def test_a_fast_fist_does_not_skip_through():
    """From 0.2 to 1.4 m in a frame; the head is between 0.65 and 0.95."""
    toy = boxing([JAB])
    tip = Tip(4, (0, HEAD_HEIGHT, 1.4), (0, HEAD_HEIGHT, 0.2), 36.0, 0)
    toy.moves[JAB] = still(10, kind=ATTACK, tips=[tip])
    (child,) = expanded(toy, facing(toy, 0.8, end=10))
    assert child.comp == pytest.approx(100.0 * 72.0)


def test_blows_after_the_next_choice_count_beyond_the_tree_only():
    toy = boxing([JAB])
    now = facing(toy, 0.8, end=3)  # the blow would land at 4
    (child,), (leaf,) = expanded(toy, now), expanded(toy, now, leaf=True)
    assert child.comp == 0.0 and child.fighter(1)[:3] == (STAND, -7, 3)
    assert leaf.comp == pytest.approx(1200.0)


def test_a_blow_at_the_frame_of_the_next_choice_lands():
    toy = boxing([JAB])
    (child,) = expanded(toy, facing(toy, 0.8, end=4))
    assert child.comp == pytest.approx(1200.0) and child.fighter(1)[:3] == (REACT, 4, 12)


@pytest.mark.jit_off
def test_during_a_long_action_the_other_moves_twice():
    toy = Toy([still(10), still(20), still(5)], [[1], [2]], sides=(Side(FREE), Side(FREE)))
    toy.moves[0].into, toy.moves[2].into = 0, 1
    now = facing(toy, 2.0, other=2, end=2)
    state, players = as_state(now), []
    for _ in range(6):
        players.append((kernels.next_player(state), min(state[kernels.END], state[9])))
        (child,) = expanded(toy, state)
        state = child.state
    # 0 does 20 frames; meanwhile 1 chooses at 2, 7, 12 and 17. Then 0 is in state 0 again.
    assert players == [(0, 0), (1, 2), (1, 7), (1, 12), (1, 17), (0, 20)]


# Pruning -----------------------------------------------------------------------------------------

INSIDE, THROUGH_AWAY, THROUGH, AWAY = 1, 2, 3, 4


@pytest.mark.jit_off
def test_what_passes_the_more_important_rules_is_kept():
    """0.8 m ahead stands the other. All but standing and turning on the spot walk into it."""
    moves = [
        still(6),
        walk(6, (0, 0.8, 0)),
        walk(6, (0, 1.6, 0)),
        walk(6, (0, 1.6, math.pi)),
        walk(6, (0, 0, math.pi)),
    ]

    def kept(choices: list[int]) -> list[int]:
        toy = Toy(moves, [choices], sides=(Side(FREE), Side(FREE)))
        return [c.action for c in expanded(toy, facing(toy, 0.8))]

    assert kept([INSIDE, THROUGH_AWAY, THROUGH, AWAY, STAND]) == [STAND]
    assert kept([INSIDE, THROUGH_AWAY, THROUGH, AWAY]) == [AWAY]
    assert kept([INSIDE, THROUGH_AWAY, THROUGH]) == [THROUGH]  # none avoids it: the last frame
    assert kept([INSIDE, THROUGH_AWAY]) == [THROUGH_AWAY]
    assert kept([INSIDE]) == [INSIDE]


def kept_of(moves: list[Move], choices: list[int], far: float, opposing: int = 0, end: int = 9):
    toy = Toy(moves, [choices], sides=(Side(FREE), Side(FREE)))
    return [c.action for c in expanded(toy, facing(toy, far, opposing, end))]


def test_attacks_beyond_1_m_and_defences_beyond_3_m_are_pruned():
    moves = [still(10), jab(), still(10, kind=DEFENCE)]
    assert kept_of(moves, [0, 1], 1.01) == [0]
    assert kept_of(moves, [0, 1], 0.99) == [0, 1]
    assert kept_of(moves, [0, 2], 3.01, opposing=1) == [0]
    assert kept_of(moves, [0, 2], 2.99, opposing=1) == [0, 2]


def test_a_range_is_that_of_the_nearest_the_two_get():
    lunge, spring = walk(10, (0, 0.3, 0), kind=ATTACK), walk(10, (0, -0.5, 0), kind=DEFENCE)
    moves = [still(10), jab(), lunge, spring]
    assert kept_of(moves, [0, 2], 1.29) == [0, 2]
    assert kept_of(moves, [0, 2], 1.31) == [0]
    assert kept_of(moves, [0, 3], 2.99, opposing=1) == [0, 3]  # in range when it is begun


def test_defences_while_nobody_attacks_are_pruned():
    moves = [still(10), jab(), still(10, kind=DEFENCE)]
    assert kept_of(moves, [0, 2], 2.0, opposing=0) == [0]
    assert kept_of(moves, [0, 2], 2.0, opposing=1) == [0, 2]  # its blow is to come at 3
    assert kept_of(moves, [0, 2], 2.0, opposing=1, end=5) == [0]  # it came at -1


# In an arena: a round one of 2 m, the searcher looks along z from z = ``at``; the other is far off
# on its other side, so that all but the edge is as it should be.
BACK, AHEAD, FAR_AHEAD, RUN, ROUND_AND_BACK = range(1, 6)


def kept_at(at: float, choices: list[int], arena: float = 2.0, **more) -> list[int]:
    there = np.linspace((0, 0, 0), (0, 0.6, 0), 7)
    out_and_in = np.concatenate([there, there[-2::-1]])
    moves = [
        still(10),
        walk(10, (0, -0.5, 0)),
        walk(10, (0, 0.5, 0)),
        walk(10, (0, 1.0, 0)),
        walk(10, (0, 0.5, 0), into=1),
        Move(out_and_in, np.stack([planar_apply(t, STANCE) for t in out_and_in])),
    ]
    toy = Toy(moves, [choices, [STAND]], sides=(Side(FREE), Side(FREE)), arena=arena, **more)
    toy.facing = math.pi
    me, other = standing(STAND, 0, (0, at, 0), toy), standing(STAND, 5, (0, -1.9, 0), toy)
    return [c.action for c in expanded(toy, Moment((me, other)))]


@pytest.mark.jit_off
def test_who_would_leave_the_arena_does_not():
    every = [STAND, BACK, AHEAD, FAR_AHEAD, ROUND_AND_BACK]
    assert kept_at(0.0, every) == every
    assert kept_at(1.2, every) == [STAND, BACK, AHEAD, ROUND_AND_BACK]  # 2.2 m is outside
    assert kept_at(1.45, every) == [STAND, BACK, AHEAD]  # on its way: 2.05 m
    assert kept_at(1.6, every) == [STAND, BACK]
    assert kept_at(1.6, every, arena=0.0) == every
    assert kept_at(1.6, every, arena=100.0) == every


def test_who_is_outside_goes_no_farther_and_loses_by_staying():
    every = [STAND, BACK, AHEAD, FAR_AHEAD]
    assert kept_at(2.3, every) == [STAND, BACK]
    assert kept_at(2.3, [AHEAD, FAR_AHEAD]) == [AHEAD, FAR_AHEAD]  # nothing else is left
    moves = [still(10), walk(10, (0, -0.1, 0))]
    toy = Toy(moves, [[0, 1]], sides=(Side(FREE), Side(FREE)), arena=2.0, facing=math.pi)
    me, other = standing(0, 0, (0, 2.3, 0), toy), standing(0, 5, (0, 0, 0), toy)
    stays, returns = expanded(toy, Moment((me, other)))
    assert (stays.comp, returns.comp) == pytest.approx((-3e5, -2e5))  # 10⁶ a metre


@pytest.mark.jit_off
def test_who_runs_keeps_room_to_stop():
    """After RUN nobody rests but 0.3 m farther, or 0.3 m aside."""
    ahead, aside = [(0.0, 0.2), (0.0, 0.3)], [(0.3, 0.0)]
    assert kept_at(1.1, [STAND, RUN], halts=[[[]], [ahead]]) == [STAND, RUN]
    assert kept_at(1.3, [STAND, RUN], halts=[[[]], [ahead]]) == [STAND]  # 2.1 m
    assert kept_at(1.3, [STAND, RUN], halts=[[[]], [ahead, aside]]) == [STAND, RUN]
    assert kept_at(1.3, [FAR_AHEAD, RUN], halts=[[[]], [ahead]]) == [RUN]  # leaving is worse
    assert kept_at(1.3, [STAND, RUN], halts=[[[]], []]) == [STAND]  # never at rest


def test_ways_to_rest():
    """Running goes on running or slows down; who walks may stand. State 2 is a trap: no way."""
    STANDS, WALKS, RUNS, TRAP = range(4)
    stretches = [  # from, to, m ahead
        (STANDS, STANDS, 0.0),
        (STANDS, WALKS, 0.5),
        (WALKS, STANDS, 0.4),
        (WALKS, RUNS, 1.0),
        (RUNS, RUNS, 1.5),
        (RUNS, WALKS, 1.2),
        (TRAP, TRAP, 1.0),
    ]
    action_start = np.searchsorted([s[0] for s in stretches], np.arange(5))
    target = np.array([s[1] for s in stretches])
    track = np.concatenate([np.linspace((0, 0, 0), (0, s[2], 0), 3) for s in stretches])
    starts, place_starts, places = halts(
        action_start, np.arange(7), target, np.arange(8) * 3, track, stride=1
    )
    assert starts.tolist() == [0, 1, 2, 3, 3]
    assert place_starts.tolist() == [0, 0, 2, 6]
    assert places[:, 0].tolist() == [0.0] * 6
    assert places[:, 1] == pytest.approx([0.2, 0.4, 0.6, 1.2, 1.4, 1.6])


def test_of_what_is_wrong_the_less_important_is_put_up_with():
    moves = [still(10), jab(), still(10, kind=DEFENCE), walk(10, (0, 0, math.pi))]
    assert kept_of(moves, [1], 2.0) == [1]
    assert kept_of(moves, [1, 2], 2.0) == [2]  # no sense, but in range
    assert kept_of(moves, [1, 3], 2.0) == [1]  # out of range, but facing
    assert kept_of(moves, [3], 2.0) == [3]


def test_facing_at_the_end_to_60_degrees():
    moves = [still(10), *[walk(10, (0, 0, math.radians(a))) for a in (59, 61, -59, -61)]]
    assert kept_of(moves, [1, 2, 3, 4], 2.0) == [1, 3]


# Scores ------------------------------------------------------------------------------------------


@pytest.mark.jit_off
def test_movement_costs():
    """It ends 0.2 m ahead, turned by 0.3 rad; the other is 1.2 m away: r = 1, θ = -0.3.

    -2 * 0.3² - 3 * (1 - 0.5)² = -0.18 - 0.75.
    """
    style = FREE.changed(facing=2.0, distance=3.0, preferred_distance=0.5)
    toy = Toy([still(10), walk(10, (0, 0.2, 0.3))], [[1]], sides=(Side(style), Side(FREE)))
    (child,) = expanded(toy, facing(toy, 1.2, end=20))
    assert child.comp == pytest.approx(-0.93) and child.coop == 0.0
    toy.sides = (Side(FREE), Side(style))  # the other's costs are the searcher's gain
    now = facing(toy, 1.2, end=-1)
    (child,) = expanded(toy, now)
    assert child.comp == pytest.approx(0.93)


@pytest.mark.jit_off
def test_check_points_and_headings_cost_both_alike():
    """It ends in (0, 0.2), 1 m from the check point, and looks along 0.3 rad instead of 0.1.

    -4 * 1² - 2 * 0.2² = -4.08.
    """
    style = FREE.changed(place=4.0, heading=2.0, preferred_heading=0.1)
    side = Side(style, goal=(1.0, 0.2))
    toy = Toy([still(10), walk(10, (0, 0.2, 0.3))], [[1]], sides=(side, Side(FREE)))
    (child,) = expanded(toy, facing(toy, 1.2, end=20))
    before = -4.0 * (1.0**2 + 0.2**2) - 2.0 * 0.1**2  # what counts is what it gains
    assert child.comp == 0.0 and child.coop == pytest.approx(-4.08 - before)
    toy.sides = (Side(FREE), replace(side, goal=(0.0, 2.0)))
    (child,) = expanded(toy, facing(toy, 1.2, end=-1))  # to (0, 1.0), and it looks back
    turn = math.pi + 0.3 - 0.1 - 2 * math.pi
    before = -4.0 * 0.8**2 - 2.0 * (math.pi - 0.1) ** 2
    assert child.coop == pytest.approx(-4.0 - 2.0 * turn**2 - before)


def test_wanted_and_unwanted_actions_and_reactions():
    style = BLOWS.changed(requirement=7.0)
    toy = boxing([STAND, JAB], response=[[REACT] * 3] * 2)
    toy.sides = (Side(style, {STAND: -1, JAB: 1}), Side(style.changed(requirement=5.0)))
    stand, hit = expanded(toy, facing(toy, 0.8, end=10))
    assert (stand.coop, hit.coop) == (-7.0, 7.0)
    toy.sides[1].asked = {REACT: 1}  # the victim is wanted to be hit
    stand, hit = expanded(toy, facing(toy, 0.8, end=10))
    assert (stand.coop, hit.coop) == (-7.0, 7.0 + 5.0)


def test_suitability_is_that_against_what_the_other_does():
    toy = boxing([STAND, PASS], style=FREE.changed(suitability=8.0))
    toy.suits = np.zeros((4, 4))
    toy.suits[STAND, JAB], toy.suits[PASS, JAB], toy.suits[JAB, PASS] = 0.25, 0.75, 1.0
    assert [c.comp for c in expanded(toy, facing(toy, 2.0, JAB, end=9))] == [2.0, 6.0]


def test_what_was_used_lately_costs_the_searcher_and_not_the_other():
    toy = boxing([STAND, PASS], style=FREE, tired={PASS: 3.0})
    assert [c.comp for c in expanded(toy, facing(toy, 2.0))] == [0.0, -3.0]
    assert [c.comp for c in expanded(toy, facing(toy, 2.0, end=-1))] == [0.0, 0.0]
    below = expanded(toy, expanded(toy, facing(toy, 2.0, end=20))[0].state)
    assert [c.comp for c in below] == [0.0, -3.0]


@pytest.mark.jit_off
def test_a_catch_counts_once_for_both():
    style = FREE.changed(given_short=30.0, taken=4.0)
    moves = [still(10), walk(10, (0, 0.5, 0)), still(10)]
    toy = Toy(moves, [[1, 2]], sides=(Side(style), Side(style)), catch=0.6, stride=1)
    run, wait = expanded(toy, facing(toy, 1.0, end=20))
    assert (run.comp, wait.comp) == (26.0, 0.0)
    run, wait = expanded(toy, facing(toy, 1.0, end=2))  # 0.9 m away when the other chooses
    assert (run.comp, wait.comp) == (0.0, 0.0)


def test_a_catch_before_a_blow_is_one_though_the_victim_is_thrown_back():
    """Walking past, the victim is 0.55 m away at frame 2 and 0.8 m at 4, when it is hit."""
    track = np.zeros((13, 3))
    track[:, 1] = np.interp(np.arange(13), [0, 2, 4, 12], [0, 0.25, 0, 0])
    toy = boxing([JAB], FREE.changed(given_short=30.0), catch=0.6, stride=1)
    body = STANCE + track[:, None, [0, 2, 1]] * [1, 0, 1]
    toy.moves[PASS] = Move(track, body)
    (child,) = expanded(toy, facing(toy, 0.8, PASS, end=12))
    assert child.fighter(1)[:2] == (REACT, 4) and child.comp == 30.0


# Real libraries ----------------------------------------------------------------------------------


def some_start(tree: GameTree, rng: np.random.Generator) -> np.ndarray:
    """Two who have just ended actions, or one of whom is in the midst, 0.6 to 1.6 m apart."""
    table, moves = tree.library.table, tree.moves
    offered = np.unique(table.stretch)
    one, two = (int(k) for k in rng.choice(offered, 2))
    late = int(rng.integers(0, moves.duration[two]))
    facing = np.array([0.0, 0.0, 0.0]), np.array([0.0, rng.uniform(0.6, 1.6), math.pi])
    facing[1][2] += rng.normal(0, 0.2)
    lengths = float(moves.duration[one]), float(moves.duration[two])
    return tree.state((one, two), (-lengths[0], late - lengths[1]), (0.0, float(late)), facing, 0.0)


def bounds_change_nothing(tree: GameTree, depths: list[int]) -> None:
    rng = np.random.default_rng(5)
    styles = [STYLES[name] for name in ("boxer", "infighter", "outboxer")]
    fewer = 0
    for n, depth in enumerate(depths):
        state = some_start(tree, rng)
        players = (Player(styles[n % 3], depth), Player(styles[n // 3 % 3]))
        recent = tuple(int(k) for k in rng.choice(len(tree.kinds), 3))
        short, full = (tree.decide(state, players, recent, bounds=b) for b in (True, False))
        assert (short.stretch, short.comp, short.coop) == (full.stretch, full.comp, full.coop)
        assert np.all(short.nodes <= full.nodes)
        fewer += short.nodes.sum() < full.nodes.sum()
    assert fewer > 0


@pytest.fixture(scope="module")
def performer_tree(fighters: Layer) -> GameTree:
    return GameTree(fighters)


@pytest.fixture(scope="module")
def boxer_tree(mocap: Path) -> GameTree:
    return GameTree(build_actions(mocap_files.load(mocap / "boxer").clip_set()))


def test_bounds_do_not_change_the_answer(performer_tree: GameTree):
    bounds_change_nothing(performer_tree, [2] * 14 + [3] * 6)


def test_weights_of_what_nobody_asks_for_do_not_keep_bounds_from_being_used(
    performer_tree: GameTree,
):
    state = some_start(performer_tree, np.random.default_rng(3))
    sides = Player(STYLES["boxer_path"]), Player()
    short, full = (performer_tree.decide(state, sides, bounds=b) for b in (True, False))
    assert (short.stretch, short.comp, short.coop) == (full.stretch, full.comp, 0.0)
    assert short.nodes.sum() < full.nodes.sum()


@pytest.mark.slow
def test_bounds_do_not_change_the_answer_of_a_real_boxer(boxer_tree: GameTree):
    bounds_change_nothing(boxer_tree, [2] * 14 + [3] * 6)


@pytest.mark.parametrize("threads", [1, 2])
def test_the_same_bytes_whatever_the_number_of_threads(performer_tree: GameTree, threads: int):
    tree, before = performer_tree, numba.get_num_threads()
    players = Player(STYLES["boxer_path"], wanted=("attack",), goal=np.array([1.0, 2.0])), Player()
    game = tree.game(players)
    state = some_start(tree, np.random.default_rng(8))
    serial = SEARCH.serial(game, state, 3, tree.most, False)
    try:
        numba.set_num_threads(min(threads, before))
        parallel = SEARCH.parallel(game, state, 3, tree.most, False)
    finally:
        numba.set_num_threads(before)
    assert serial.nodes.sum() > 100 and np.any(serial.coop != 0)
    for one, other in zip(serial, parallel):
        assert np.asarray(one).tobytes() == np.asarray(other).tobytes()


def sizes(tree: GameTree, depth: int) -> tuple[list[int], list[int], dict[str, int]]:
    """Nodes at each depth, the same before pruning, and below each first choice's label."""
    k = int(tree.library.table.stretch[0])
    ended = -float(tree.moves.duration[k])
    facing = np.array([0.0, 0.0, 0.0]), np.array([0.0, 0.9, math.pi])
    state = tree.state((k, k), (ended, ended), (0.0, 0.0), facing, 0.0)
    game = tree.game((Player(), Player()))
    found = SEARCH.serial(game, state, depth, tree.most, False)
    children = empty_children(tree.most, kernels.STATE)
    count, _, _ = expand(game, state, children)
    below: dict[str, int] = {}
    for n in range(count):
        label = tree.labels[int(children.action[n])]
        more = SEARCH.serial(game, children.state[n], depth - 1, tree.most, False).nodes.sum()
        below[label] = below.get(label, 0) + int(more)
    return found.nodes.tolist(), found.considered.tolist(), below


@pytest.mark.parametrize("arena", [False, True])
@pytest.mark.parametrize("seed", range(10))
def test_what_is_wrong_with_an_action_is_told(seed: int, arena: bool):
    toy, now = random_toy(seed, seed % 2 == 0)
    if arena:
        fenced(toy, now, seed)
    p = toy.player(now)
    me, other = now.fighters[p], now.fighters[1 - p]
    for k in toy.offered(now):
        expected = sum(
            2 ** (6 - n) for n, wrong in enumerate(toy.flaws(me, other, k, me.end)) if wrong
        )
        assert flaws_of(toy.game(), as_state(now), k) == expected


def test_a_fight_says_which_rules_had_to_be_broken(performer_tree: GameTree):
    tree, moves = performer_tree, performer_tree.moves
    k = int(np.flatnonzero(np.array(tree.kinds) == "idle")[0])
    far = [np.array([0.0, 0.0, 0.0]), np.array([0.0, -1.5, 0.0])]  # behind the one who chooses
    ends = (0.0, float(moves.duration[k]))
    state = tree.state((k, k), (-ends[1], 0.0), ends, (far[0], far[1]), 0.0)
    decision = tree.decide(state, (Player(depth=1), Player()))
    assert decision.flaws == ("turned away",)
    state = tree.state((k, k), (-ends[1], 0.0), ends, (far[0], -far[1]), 0.0)
    assert tree.decide(state, (Player(depth=1), Player())).flaws == ()


def test_the_size_of_a_fixed_fight(performer_tree: GameTree):
    """Golden numbers; those of each first choice say where it went astray."""
    nodes, considered, below = sizes(performer_tree, 3)
    assert sum(below.values()) == sum(nodes[1:]), below
    expected = [1, 40, 1818, 63137], [1, 64, 2560, 116352]
    assert (nodes, considered) == expected, (nodes, considered, below)


@pytest.mark.slow
def test_the_size_of_a_real_boxers_fight(boxer_tree: GameTree):
    """Golden shares: the paper prunes 70 % of a boxer's actions."""
    nodes, considered, below = sizes(boxer_tree, 3)
    assert sum(below.values()) == sum(nodes[1:]), below
    share = 1 - sum(nodes[1:]) / sum(considered[1:])
    assert 0.2 < share < 0.9, (nodes, considered)


# What is refused ---------------------------------------------------------------------------------


def test_what_cannot_be_played_is_said(performer_tree: GameTree):
    tree = performer_tree
    kinds = tuple(set(tree.kinds))
    with pytest.raises(KumiteError, match="A⁻ holds every action"):
        tree.game((Player(unwanted=kinds), Player()))
    tree.game((Player(wanted=("attack",), unwanted=kinds), Player()))  # these are neither
    with pytest.raises(KumiteError, match=r"no action is called 'atack'; expected kinds .*attack"):
        tree.game((Player(), Player(wanted=("atack",))))
    one = np.zeros(1, np.int32)
    speed, move = np.zeros(1, np.float32), np.zeros((1, 3))
    frames = ActionTable(np.array([3]), np.array([0, 1]), one, speed, one + 1, one + 3, one, move)
    with pytest.raises(KumiteError, match="actions"):
        GameTree(toys.library(frames, 10))  # a graph of frames
    for depth in (0, 7):
        with pytest.raises(KumiteError, match=f"depth {depth}; expected 1 to 6"):
            Player(depth=depth)
