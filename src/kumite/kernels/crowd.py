"""All characters of a scene at once: who is near, what each does next, who is pushed, who is hit.

Shapes: K characters, H foreseen frames, B body parts, O objects, M remembered actions. Every
function works on one character or loops over them; nothing depends on the number of threads.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange

from kumite.kernels.blow import NO_BLOW, NO_HIT, NOBODY, swept_contact
from kumite.kernels.character import planar_point
from kumite.kernels.jit import kernel, parallel_kernel
from kumite.kernels.policy import carry, look_ahead
from kumite.kernels.pose import add_rotated

NEIGHBOURS = 6  # bodies that a character minds, its opponent among them
MINDED = 2.2  # m within which it does
CELL = 2.2  # m, edge of a cell of the hash: no smaller than any radius asked for
FAR = 1e6  # m, where nobody is
FACING, FEW, SLACK, BOREDOM, SPACE = range(5)
"""Columns of a temper."""


class Hash(NamedTuple):
    """A spatial hash of places on the ground, made anew each frame."""

    start: np.ndarray  # [T + 1] int32, T a power of two: first item of a bucket
    item: np.ndarray  # [K] int32, characters by bucket
    cell: np.ndarray  # [K, 2] int32, the cell each is in


class Actors(NamedTuple):
    """Where all characters are in the library and in the scene, and whom they aim at."""

    frame: np.ndarray  # [K]
    stop: np.ndarray  # [K]
    anchor: np.ndarray  # [K, 3]
    opponent: np.ndarray  # [K] a character, or NOBODY
    thing: np.ndarray  # [K] an object, or NOBODY
    things: np.ndarray  # [O, 3] m
    aim: np.ndarray  # [F, 3] m, library world: what opponents aim at (the head)
    root: np.ndarray  # [F, 3] m, library world
    facing: np.ndarray  # [F, 3] library world


class Minds(NamedTuple):
    """How each character chooses, and what it remembers."""

    weights: np.ndarray  # [K, Z] of the behaviours
    temper: np.ndarray  # [K, 5]
    recent: np.ndarray  # [K, M] stretches, or -1
    recent_at: np.ndarray  # [K] where the next one is written
    seed: np.ndarray  # [K] uint64


class Choices(NamedTuple):
    """What each character chose last."""

    stretch: np.ndarray  # [K]
    worth: np.ndarray  # [K]
    considered: np.ndarray  # [K]
    apart: np.ndarray  # [K]


@kernel
def bucket(ix, iz, mask):
    """Bucket of a cell."""
    return (ix * 73856093 ^ iz * 19349663) & mask


@kernel
def fill_hash(place, grid):
    """Sort characters at place [K, 3] (x and z count) into buckets; by number within each."""
    mask = grid.start.shape[0] - 2
    grid.start[:] = 0
    for k in range(place.shape[0]):
        grid.cell[k, 0] = int(np.floor(place[k, 0] / CELL))
        grid.cell[k, 1] = int(np.floor(place[k, 2] / CELL))
        grid.start[bucket(grid.cell[k, 0], grid.cell[k, 1], mask) + 1] += 1
    for b in range(mask + 1):
        grid.start[b + 1] += grid.start[b]
    for k in range(place.shape[0] - 1, -1, -1):
        b = bucket(grid.cell[k, 0], grid.cell[k, 1], mask)
        grid.start[b + 1] -= 1
        grid.item[grid.start[b + 1]] = k
    # Each start now stands one bucket too far left: it is the bucket's own.
    for b in range(mask + 1):
        grid.start[b] = grid.start[b + 1]
    grid.start[mask + 1] = place.shape[0]


@kernel
def nearest(k, place, radius, grid, found):
    """The characters nearest to k within a radius [m], nearest first, in found; how many.

    Of equal distances the lower number comes first. found [n] says how many are wanted.
    """
    mask = grid.start.shape[0] - 2
    count = 0
    distance = np.empty(found.shape[0])
    for dx in range(-1, 2):
        for dz in range(-1, 2):
            ix, iz = grid.cell[k, 0] + dx, grid.cell[k, 1] + dz
            b = bucket(ix, iz, mask)
            for i in range(grid.start[b], grid.start[b + 1]):
                j = grid.item[i]
                if j == k or grid.cell[j, 0] != ix or grid.cell[j, 1] != iz:
                    continue
                x, z = place[j, 0] - place[k, 0], place[j, 2] - place[k, 2]
                d2 = x * x + z * z
                if d2 > radius * radius:
                    continue
                at = min(count, found.shape[0] - 1)
                if count == found.shape[0] and not (
                    d2 < distance[at] or (d2 == distance[at] and j < found[at])
                ):
                    continue
                while at > 0 and (
                    d2 < distance[at - 1] or (d2 == distance[at - 1] and j < found[at - 1])
                ):
                    distance[at], found[at] = distance[at - 1], found[at - 1]
                    at -= 1
                distance[at], found[at] = d2, j
                count = min(count + 1, found.shape[0])
    return count


@kernel
def draw(seed, k, n):
    """A number 0..n-1 from character k's own stream (splitmix64)."""
    seed[k] += np.uint64(0x9E3779B97F4A7C15)
    z = seed[k]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return int(z % np.uint64(n))


@kernel
def foresee(k, here, actors, target, other):
    """Where k's target [H, 3] and its body [H, 2] are expected, seen from ``here``."""
    o = actors.opponent[k]
    for h in range(target.shape[0]):
        if o == NOBODY:
            thing = actors.things[actors.thing[k]]
            target[h, 0], target[h, 2] = carry(here, thing[0], thing[2])
            target[h, 1] = thing[1]
            other[h, 0] = other[h, 1] = FAR  # a thing may be stood under
            continue
        f = min(actors.frame[o] + h + 1, actors.stop[o])
        x, z = planar_point(actors.anchor[o], actors.aim[f, 0], actors.aim[f, 2])
        target[h, 0], target[h, 2] = carry(here, x, z)
        target[h, 1] = actors.aim[f, 1]
        x, z = planar_point(actors.anchor[o], actors.root[f, 0], actors.root[f, 2])
        other[h, 0], other[h, 1] = carry(here, x, z)


@kernel
def decide_one(k, state, place, grid, actors, minds, moves, behaviours, horizon, choices):
    """Character k, in a state, picks its next action; place [K, 3] is where all stand.

    The same as the paper's choice by value, with weights; random among the best few (A9).
    """
    here = np.empty(3)
    f = actors.frame[k]
    here[0], here[1] = planar_point(actors.anchor[k], actors.facing[f, 0], actors.facing[f, 1])
    here[2] = actors.anchor[k, 2] + actors.facing[f, 2]
    target = np.empty((horizon, 3))
    others = np.full((NEIGHBOURS, horizon, 2), FAR)
    foresee(k, here, actors, target, others[0])
    count = 1
    if place.shape[0] > 2:
        found = np.empty(NEIGHBOURS, dtype=np.int64)
        for i in range(nearest(k, place, MINDED, grid, found)):
            j = found[i]
            if j == actors.opponent[k] or count == NEIGHBOURS:
                continue
            for h in range(horizon):
                g = min(actors.frame[j] + h + 1, actors.stop[j])
                x, z = planar_point(actors.anchor[j], actors.root[g, 0], actors.root[g, 2])
                others[count, h, 0], others[count, h, 1] = carry(here, x, z)
            count += 1
    pick(k, state, target, others[:count], minds, moves, behaviours, choices)


@kernel
def pick(k, state, target, others, minds, moves, behaviours, choices):
    """Character k picks among the actions of a state, with target [H, 3] and others [O, H, 2]."""
    temper = minds.temper[k]
    begin, end = moves.action_start[state], moves.action_start[state + 1]
    count = end - begin
    worth, gap = np.empty(count), np.empty(count)
    weights = minds.weights[k]
    look_ahead(state, target, others, moves, behaviours, weights, temper[FACING], worth, gap)
    apart, widest = 0, -1.0
    for n in range(count):
        apart += gap[n] >= temper[SPACE]
        widest = max(widest, gap[n])
    # Where every action would come too near, those that stay farthest off.
    least = temper[SPACE] if apart else widest - 0.02
    allowed = gap >= least
    # What counts is how much better an action is than the usual one: far from the target all are
    # worth nearly the same, and still one of them leads there.
    usual = np.median(worth[allowed])
    gain = worth - usual
    for n in range(count):
        if not allowed[n]:
            gain[n] = -np.inf
            continue
        for m in range(minds.recent.shape[1]):
            if minds.recent[k, m] == moves.stretch[begin + n]:
                gain[n] -= temper[BOREDOM] * abs(gain[n])
                break
    few = min(int(temper[FEW]), count)
    best = np.empty(few, dtype=np.int64)
    kept = 0
    for i in range(few):
        top = -1
        for n in range(count):
            if gain[n] > -np.inf and (top < 0 or gain[n] > gain[top]):
                free = True
                for j in range(kept):
                    free = free and best[j] != n
                if free:
                    top = n
        if top < 0 or (i > 0 and gain[top] < (1.0 - temper[SLACK]) * gain[best[0]]):
            break
        best[kept] = top
        kept += 1
    n = best[draw(minds.seed, k, kept)]
    s = moves.stretch[begin + n]
    if minds.recent.shape[1]:
        minds.recent[k, minds.recent_at[k]] = s
        minds.recent_at[k] = (minds.recent_at[k] + 1) % minds.recent.shape[1]
    choices.stretch[k] = s
    choices.worth[k] = worth[n]
    choices.considered[k] = count
    choices.apart[k] = apart


@kernel
def decide(who, states, place, grid, actors, minds, moves, behaviours, horizon, choices):
    """Every character of who [W], in its state [W], picks its next action: all at once."""
    for w in range(who.shape[0]):
        k = who[w]
        decide_one(k, states[w], place, grid, actors, minds, moves, behaviours, horizon, choices)


@parallel_kernel
def decide_many(who, states, place, grid, actors, minds, moves, behaviours, horizon, choices):
    """:func:`decide` on all cores."""
    for w in prange(who.shape[0]):
        k = who[w]
        decide_one(k, states[w], place, grid, actors, minds, moves, behaviours, horizon, choices)


@kernel
def push_one(k, place, radius, most, grid, push):
    """How far [2] character k is carried away this frame from those nearer than radius [m]."""
    found = np.empty(8, dtype=np.int64)
    push[0] = push[1] = 0.0
    for i in range(nearest(k, place, radius, grid, found)):
        j = found[i]
        x, z = place[k, 0] - place[j, 0], place[k, 2] - place[j, 2]
        d = np.hypot(x, z)
        if d < 1e-6:  # on one spot: the lower number goes one way, the higher the other
            x, z, d = (-1.0 if k < j else 1.0), 0.0, 1.0
            share = 0.5 * min(radius, most)
        else:
            share = 0.5 * min(radius - d, most)
        push[0] += share * x / d
        push[1] += share * z / d


@kernel
def keep_apart(place, radius, most, grid, push, anchor, foot):
    """Carry bodies nearer than radius [m] apart, by at most ``most`` [m] a pair; feet stay."""
    for k in range(place.shape[0]):
        push_one(k, place, radius, most, grid, push[k])
    for k in range(place.shape[0]):
        anchor[k, 0] += push[k, 0]
        anchor[k, 1] += push[k, 1]
        for f in range(2):
            foot[k, f, 0] -= push[k, 0]
            foot[k, f, 2] -= push[k, 1]


class Shapes(NamedTuple):
    """Where blows land on a body, and with what limbs strike. B parts, four limbs."""

    joint: np.ndarray  # [B]
    start: np.ndarray  # [B, 3] m, in the joint's axes
    end: np.ndarray
    radius_start: np.ndarray  # [B] m
    radius_end: np.ndarray
    target: np.ndarray  # [B] bool, what counts as hit
    tip_joint: np.ndarray  # [4]
    tip_offset: np.ndarray  # [4, 3] centre of the fist's sphere
    tip_radius: np.ndarray  # [4] m


class Blows(NamedTuple):
    """Fists, bodies and blows of all characters, now and a frame before."""

    tip: np.ndarray  # [2, K, 4, 3] before and now
    a: np.ndarray  # [2, K, B, 3]
    b: np.ndarray  # [2, K, B, 3]
    thrown: np.ndarray  # [K, 4] the blow each limb is throwing, or NO_BLOW
    landed: np.ndarray  # [K, 4] the last blow of the limb that landed
    begun: np.ndarray  # [K, 4] bool, thrown since the last frame
    part: np.ndarray  # [K, 4] what was hit in this frame, or NO_HIT
    when: np.ndarray  # [K, 4] 0..1 within the frame


@kernel
def measure_one(k, position, world_wxyz, shapes, blows):
    """Fists and body parts of character k in the pose just made; the last become those before."""
    for s in range(4):
        j = shapes.tip_joint[s]
        blows.tip[0, k, s] = blows.tip[1, k, s]
        add_rotated(world_wxyz[k, j], shapes.tip_offset[s], position[k, j], blows.tip[1, k, s])
    for p in range(shapes.joint.shape[0]):
        j = shapes.joint[p]
        blows.a[0, k, p] = blows.a[1, k, p]
        blows.b[0, k, p] = blows.b[1, k, p]
        add_rotated(world_wxyz[k, j], shapes.start[p], position[k, j], blows.a[1, k, p])
        add_rotated(world_wxyz[k, j], shapes.end[p], position[k, j], blows.b[1, k, p])


@kernel
def throw_one(k, blow, blows):
    """Note which blows [4] of character k have begun; a limb that rests may throw them again."""
    for s in range(4):
        blows.begun[k, s] = blow[s] != NO_BLOW and blow[s] != blows.thrown[k, s]
        blows.thrown[k, s] = blow[s]
        if blow[s] == NO_BLOW:
            blows.landed[k, s] = NO_BLOW


@kernel
def hit_one(k, victim, shapes, blows):
    """Which blows of character k touch the victim's target parts during this frame."""
    for s in range(4):
        blows.part[k, s] = NO_HIT
        blows.when[k, s] = 2.0
        blow = blows.thrown[k, s]
        if victim == NOBODY or blow == NO_BLOW or blow == blows.landed[k, s]:
            continue
        for p in range(shapes.target.shape[0]):
            if not shapes.target[p]:
                continue
            t = swept_contact(
                blows.tip[0, k, s],
                blows.tip[1, k, s],
                blows.a[0, victim, p],
                blows.a[1, victim, p],
                blows.b[0, victim, p],
                blows.b[1, victim, p],
                shapes.radius_start[p],
                shapes.radius_end[p],
                shapes.tip_radius[s],
            )
            if t >= 0.0 and t < blows.when[k, s]:
                blows.when[k, s] = t
                blows.part[k, s] = p


@kernel
def test_blows(frame, opponent, blow_of_frame, position, world_wxyz, shapes, blows):
    """Fists, bodies and hits of all characters; how many blows began or landed in this frame."""
    count = 0
    for k in range(frame.shape[0]):
        measure_one(k, position, world_wxyz, shapes, blows)
        throw_one(k, blow_of_frame[frame[k]], blows)
    for k in range(frame.shape[0]):
        hit_one(k, opponent[k], shapes, blows)
        for s in range(4):
            count += blows.begun[k, s] or blows.part[k, s] != NO_HIT
    return count


@parallel_kernel
def test_blows_many(frame, opponent, blow_of_frame, position, world_wxyz, shapes, blows):
    """:func:`test_blows` on all cores."""
    count = 0
    for k in prange(frame.shape[0]):
        measure_one(k, position, world_wxyz, shapes, blows)
        throw_one(k, blow_of_frame[frame[k]], blows)
    for k in prange(frame.shape[0]):
        hit_one(k, opponent[k], shapes, blows)
        for s in range(4):
            count += blows.begun[k, s] or blows.part[k, s] != NO_HIT
    return count
