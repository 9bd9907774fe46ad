"""What two fighters are in a game: their moves, the rules, what each wants, and the state of both.

Times are frames. A planar frame (x, z, yaw) carries points of a stretch's own frame, the facing
frame it begins in, into the scene. Circles are (x, z, radius) on the ground. Shapes: N states, A
actions, L stretches, R rows (a stretch of T frames has T + 1, its beginning first), P tips (frames
in which a blow may land), B spheres.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kumite.kernels.jit import lean_kernel

# The state of one player; a state is that of both, one after the other.
STRETCH, BEGUN, END, X, Z, YAW, LANDED, FIELDS = range(8)
QUIET = 2 * FIELDS  # 1 where no tip can meet anything if both go on as they do, else 0
STATE = 2 * FIELDS + 1
NOTHING = -1
TRUNK = 4  # spheres that must not overlap: head, chest, belly, pelvis; the rest are arms
SPHERES = 8  # B: the trunk's, forearms and gloves
HEAD = 0
IDLE, ATTACK, DEFENCE, OTHER = range(4)
FLINCH, STAGGER, FALL, SIZES = range(4)


class Moves(NamedTuple):
    """What stretches do, seen from where they begin."""

    action_start: np.ndarray  # [N + 1]
    stretch: np.ndarray  # [A]
    successor: np.ndarray  # [L]
    duration: np.ndarray  # [L] frames
    kind: np.ndarray  # [L] IDLE, ATTACK, DEFENCE, OTHER
    short: np.ndarray  # [L] bool, a short-range attack
    start: np.ndarray  # [L + 1] first row
    track: np.ndarray  # [R, 3] facing frames (x, z, yaw)
    heading: np.ndarray  # [L, 2] sine and cosine of the yaw at the end
    trunk: np.ndarray  # [R, 3] circles that hold the trunk's spheres, as bulky as they are kept
    body: np.ndarray  # [R, 3, B] m, float32, centres of spheres
    radius: np.ndarray  # [B] m, met by a tip
    bulk: np.ndarray  # [TRUNK] m, kept from the other trunk: arms are held before it
    hull: np.ndarray  # [L, 3] circles that hold the body from the beginning to the end
    ring: np.ndarray  # [R, 3] circles that hold the body
    tip_start: np.ndarray  # [L + 1]
    tip_when: np.ndarray  # [P] frames since the beginning, ascending in a stretch
    tip: np.ndarray  # [P, 3] m
    tip_before: np.ndarray  # [P, 3] m, a frame earlier: nothing skips through
    tip_way: np.ndarray  # [P] m in that frame, and a little more
    tip_speed: np.ndarray  # [P] m/s
    tip_blow: np.ndarray  # [P] number of the blow, ascending in time
    last_tip: np.ndarray  # [L] frames, or NOTHING
    reach: np.ndarray  # [L, 3] circles that hold all tips and the places a frame earlier
    halt_start: np.ndarray  # [N + 1] ways to come to rest, of each state
    halt_place_start: np.ndarray  # [W + 1]
    halt_place: np.ndarray  # [Q, 2] m, along such ways


class Rules(NamedTuple):
    """What counts."""

    stride: int  # frames between those in which bodies are compared
    facing: np.ndarray  # [2] rad from the opponent at the end of an action, at most
    attack_range: float  # m
    defence_range: float  # m
    tip_radius: float  # m
    catch: float  # m between two that counts as caught; 0: nobody is
    arena: float  # m from the middle of the scene that nobody is to go beyond; 0: everywhere
    stagger_from: float  # m/s
    fall_from: float  # m/s
    vulnerable: np.ndarray  # [B] of each part


class Want(NamedTuple):
    """What the two players are after."""

    weights: np.ndarray  # [2, style.COLUMNS]
    suits: np.ndarray  # [L, L] float32, S of one's own stretch against the opponent's
    asked: np.ndarray  # [2, L] 1 in A⁺, -1 in A⁻, else 0
    goal: np.ndarray  # [2, G, 2] m, where to be now and every so many frames later; then as last
    goal_from: float  # frames, now
    goal_every: float  # frames
    third: np.ndarray  # [E, G, 2] m, where others will be, at the same times
    third_side: np.ndarray  # [E] 0, 1: they are after the opponent of that player; else NOTHING
    third_wants: np.ndarray  # [E, 3] their w_r, r_d and what a catch is worth to them
    response: np.ndarray  # [2, SIZES] stretches of reactions to the trunk and the head, or NOTHING
    tired: np.ndarray  # [L] what it costs the searcher to begin a stretch: it did the like lately


_FIELDS = {n: t for part in (Moves, Rules, Want) for n, t in part.__annotations__.items()}
Game = NamedTuple("Game", list(_FIELDS.items()))  # type: ignore[misc]  # flat, for the search


@lean_kernel
def parts(game):
    """The Moves, Rules and Want of a game."""
    return (
        Moves(
            game.action_start,
            game.stretch,
            game.successor,
            game.duration,
            game.kind,
            game.short,
            game.start,
            game.track,
            game.heading,
            game.trunk,
            game.body,
            game.radius,
            game.bulk,
            game.hull,
            game.ring,
            game.tip_start,
            game.tip_when,
            game.tip,
            game.tip_before,
            game.tip_way,
            game.tip_speed,
            game.tip_blow,
            game.last_tip,
            game.reach,
            game.halt_start,
            game.halt_place_start,
            game.halt_place,
        ),
        Rules(
            game.stride,
            game.facing,
            game.attack_range,
            game.defence_range,
            game.tip_radius,
            game.catch,
            game.arena,
            game.stagger_from,
            game.fall_from,
            game.vulnerable,
        ),
        Want(
            game.weights,
            game.suits,
            game.asked,
            game.goal,
            game.goal_from,
            game.goal_every,
            game.third,
            game.third_side,
            game.third_wants,
            game.response,
            game.tired,
        ),
    )


@lean_kernel
def compose(x, z, yaw, u, w, turn):
    """Planar frame (u, w, turn) of frame (x, z, yaw), in the scene."""
    c, s = np.cos(yaw), np.sin(yaw)
    return x + c * u + s * w, z - s * u + c * w, yaw + turn


@lean_kernel
def place_at(state, p, time, moves):
    """The facing frame of player p at a time; after its action has ended it stands."""
    o = p * FIELDS
    k = int(state[o + STRETCH])
    i = min(max(int(time - state[o + BEGUN]), 0), moves.duration[k])
    row = moves.start[k] + i
    return compose(
        state[o + X],
        state[o + Z],
        state[o + YAW],
        moves.track[row, 0],
        moves.track[row, 1],
        moves.track[row, 2],
    )


@lean_kernel
def begin(state, p, k, time, x, z, yaw, moves):
    """Player p begins stretch k at a time and place."""
    o = p * FIELDS
    state[o + STRETCH], state[o + BEGUN], state[o + END] = k, time, time + moves.duration[k]
    state[o + X], state[o + Z], state[o + YAW] = x, z, yaw
    state[o + LANDED] = NOTHING


@lean_kernel
def next_player(state):
    """Who ends first; of equals the searcher."""
    return 0 if state[END] <= state[FIELDS + END] else 1


@lean_kernel
def seen_from(state, q, x, z, yaw):
    """The frame in which player q's stretch begins, seen from (x, z, yaw): x, z, cosine, sine."""
    o = q * FIELDS
    c, s = np.cos(yaw), np.sin(yaw)
    u, w = state[o + X] - x, state[o + Z] - z
    turn = state[o + YAW] - yaw
    return c * u - s * w, s * u + c * w, np.cos(turn), np.sin(turn)


@lean_kernel
def carried(frame, x, z):
    """A point of a frame (:func:`seen_from`) seen from without."""
    u, w, c, s = frame
    return u + c * x + s * z, w - s * x + c * z


@lean_kernel
def inverse(frame):
    """The frame from which a frame is seen, seen from there."""
    u, w, c, s = frame
    return s * w - c * u, -s * u - c * w, c, -s


@lean_kernel
def touch(x, z, radius, circles, n, gap):
    """Whether a circle and the n-th of circles come within ``gap`` [m] of each other."""
    dx, dz, r = circles[n, 0] - x, circles[n, 1] - z, circles[n, 2] + radius + gap
    return dx * dx + dz * dz < r * r
