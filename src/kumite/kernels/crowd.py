"""All characters of a scene at once: who is near, what each does next, who is pushed, who is hit.

Shapes: K characters, H foreseen frames, B body parts, O objects, M remembered actions. Every
function works on one character or loops over them; nothing depends on the number of threads.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange

from kumite.kernels.blow import (
    NO_BLOW,
    NO_HIT,
    NO_LIMB,
    NOBODY,
    SQUARELY,
    squareness,
    swept_contact,
)
from kumite.kernels.character import own_of, planar_point, show_part
from kumite.kernels.jit import kernel, parallel_kernel
from kumite.kernels.limb import turned
from kumite.kernels.look_ahead import look_ahead, look_further
from kumite.kernels.near import fill_hash, nearest
from kumite.kernels.phase import AT_FRAME, move_on
from kumite.kernels.policy import carry, wrapped

NEIGHBOURS = 6  # bodies that a character minds, its opponent among them
MINDED = 2.2  # m within which it does
FAR = 1e6  # m, where nobody is
FACING, FEW, SLACK, BOREDOM, SPACE, AGAIN = range(6)
"""Columns of a temper."""


class Actors(NamedTuple):
    """Where all characters are in the library and in the scene, and whom they aim at."""

    frame: np.ndarray  # [K]
    fraction: np.ndarray  # [K] of the way to the next frame
    rate: np.ndarray  # [K] library frames per shown frame
    stop: np.ndarray  # [K]
    anchor: np.ndarray  # [K, 3]
    opponent: np.ndarray  # [K] a character, or NOBODY
    thing: np.ndarray  # [K] an object, or NOBODY
    things: np.ndarray  # [O, 4] m, and the way it faces [rad]
    aim: np.ndarray  # [F, 3] m, library world: what opponents aim at (the head)
    root: np.ndarray  # [F, 3] m, library world
    facing: np.ndarray  # [F, 3] library world


class Minds(NamedTuple):
    """How each character chooses, and what it remembers."""

    weights: np.ndarray  # [K, Z] of the behaviours
    temper: np.ndarray  # [K, 6]
    recent: np.ndarray  # [K, M] stretches, or -1
    recent_at: np.ndarray  # [K] where the next one is written
    seed: np.ndarray  # [K] uint64
    first: np.ndarray  # [L] library frame that each stretch begins with
    beside: np.ndarray  # [K] library frame that whom it faces shows as it chooses, or NOBODY
    step: int  # frames: who begin one motion within so many move in step


class Choices(NamedTuple):
    """What each character chose last."""

    stretch: np.ndarray  # [K]
    worth: np.ndarray  # [K]
    considered: np.ndarray  # [K]
    apart: np.ndarray  # [K]


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
def frame_after(k, frames, actors):
    """The library frame that k is at after so many shown frames, along its action."""
    along = actors.fraction[k] + frames * actors.rate[k]
    return min(actors.frame[k] + int(along + AT_FRAME), actors.stop[k])


@kernel
def foresee(k, here, actors, target, other):
    """Where k's target [H, 4] and its body [H, 2] are expected, seen from ``here``."""
    o = actors.opponent[k]
    for h in range(target.shape[0]):
        if o == NOBODY:
            thing = actors.things[actors.thing[k]]
            target[h, 0], target[h, 2] = carry(here, thing[0], thing[2])
            target[h, 1], target[h, 3] = thing[1], wrapped(thing[3] - here[2])
            other[h, 0] = other[h, 1] = FAR  # a thing may be stood under
            continue
        f = frame_after(o, h + 1, actors)
        x, z = planar_point(actors.anchor[o], actors.aim[f, 0], actors.aim[f, 2])
        target[h, 0], target[h, 2] = carry(here, x, z)
        target[h, 1] = actors.aim[f, 1]
        target[h, 3] = wrapped(actors.anchor[o, 2] + actors.facing[f, 2] - here[2])
        x, z = planar_point(actors.anchor[o], actors.root[f, 0], actors.root[f, 2])
        other[h, 0], other[h, 1] = carry(here, x, z)


@kernel
def decide_one(k, state, place, grid, actors, minds, moves, behaviours, horizon, choices):
    """Character k, in a state, picks its next action; place [K, 3] is where all stand.

    The same as the paper's choice by value, with weights; random among the best few (A9).
    """
    here = np.empty(3)
    f = max(actors.frame[k], actors.stop[k])  # where its action ends, if it is not quite there
    here[0], here[1] = planar_point(actors.anchor[k], actors.facing[f, 0], actors.facing[f, 1])
    here[2] = actors.anchor[k, 2] + actors.facing[f, 2]
    target = np.empty((horizon, 4))
    others = np.empty((NEIGHBOURS, horizon, 2))
    others[:] = FAR
    foresee(k, here, actors, target, others[0])
    count = 1
    if place.shape[0] > 2:
        found = np.empty(NEIGHBOURS, dtype=np.int64)
        for i in range(nearest(k, place, MINDED, grid, found)):
            j = found[i]
            if j == actors.opponent[k] or count == NEIGHBOURS:
                continue
            for h in range(horizon):
                g = frame_after(j, h + 1, actors)
                x, z = planar_point(actors.anchor[j], actors.root[g, 0], actors.root[g, 2])
                others[count, h, 0], others[count, h, 1] = carry(here, x, z)
            count += 1
    pick(k, state, target, others[:count], minds, moves, behaviours, choices)


@kernel
def give_way(k, actors, minds, choices):
    """Whether k, who has just chosen, must choose once more: for the one it faces has, too, in the
    same moment, and the same."""
    o = actors.opponent[k]
    if o == NOBODY or o > k or actors.frame[o] < actors.stop[o]:
        return False
    minds.beside[k] = minds.first[choices.stretch[o]]
    if abs(minds.first[choices.stretch[k]] - minds.beside[k]) > minds.step:
        return False
    if minds.recent.shape[1]:  # what it does not do is not what it has done
        minds.recent_at[k] = (minds.recent_at[k] - 1) % minds.recent.shape[1]
    return True


@kernel
def best_left(values, allowed, taken, count):
    """The largest of the allowed values [n] that is not among taken[:count], or -1."""
    top = -1
    for n in range(values.shape[0]):
        if not allowed[n] or (top >= 0 and values[n] <= values[top]):
            continue
        free = True
        for i in range(count):
            free = free and taken[i] != n
        if free:
            top = n
    return top


@kernel
def median_of(values, allowed):
    """The median of the allowed values, of which there is one at least."""
    line, count = np.empty(values.shape[0]), 0
    for n in range(values.shape[0]):
        if not allowed[n]:
            continue
        at = count
        while at > 0 and line[at - 1] > values[n]:
            line[at] = line[at - 1]
            at -= 1
        line[at] = values[n]
        count += 1
    half = count >> 1
    return line[half] if count & 1 else (line[half - 1] + line[half]) / 2


@kernel
def weigh_again(many, state, target, allowed, moves, behaviours, weights, facing, worth):
    """The best ``many`` of the allowed actions are weighed by two backups: worth [n], in place.

    Only they are allowed from then on: what is weighed otherwise cannot be compared with them.
    """
    begin, done = moves.action_start[state], 0
    best = np.empty(many, dtype=np.int64)
    while done < many:
        best[done] = best_left(worth, allowed, best, done)
        if best[done] < 0:
            break
        done += 1
    allowed[:] = False
    for i in range(done):
        n = best[i]
        worth[n] = look_further(begin + n, target, moves, behaviours, weights, facing)
        allowed[n] = True


@kernel
def keep_out_of_step(k, begin, minds, moves, gain):
    """No two who face each other do the same at the same time, where there is anything else to do:
    actions that would are left out, gain [n] in place.
    """
    count, left = gain.shape[0], 0
    for n in range(count):
        left += gain[n] > -np.inf
    for n in range(count):
        late = minds.first[moves.stretch[begin + n]] - minds.beside[k]
        if left > 1 and gain[n] > -np.inf and abs(late) <= minds.step:
            gain[n] = -np.inf
            left -= 1


@kernel
def pick(k, state, target, others, minds, moves, behaviours, choices):
    """Character k picks among the actions of a state, with target [H, 4] and others [O, H, 2]."""
    temper = minds.temper[k]
    begin, end = moves.action_start[state], moves.action_start[state + 1]
    count = end - begin
    worth, gap = np.empty(count), np.empty(count)
    weights, facing, space = minds.weights[k], temper[FACING], temper[SPACE]
    look_ahead(state, target, others, space, moves, behaviours, weights, facing, worth, gap)
    apart, widest = 0, -1.0
    for n in range(count):
        apart += gap[n] >= space
        widest = max(widest, gap[n])
    # Where every action would come too near, those that stay farthest off.
    least = space if apart else widest - 0.02
    allowed = np.empty(count, dtype=np.bool_)
    for n in range(count):
        allowed[n] = gap[n] >= least
    # What counts is how much better an action is than the usual one: far from the target all are
    # worth nearly the same, and still one of them leads there.
    usual = median_of(worth, allowed)
    if temper[AGAIN] > 1.0:
        many = int(temper[AGAIN])
        weigh_again(many, state, target, allowed, moves, behaviours, weights, facing, worth)
    gain = np.empty(count)
    for n in range(count):
        gain[n] = worth[n] - usual if allowed[n] else -np.inf
        if not allowed[n]:
            continue
        for m in range(minds.recent.shape[1]):
            if minds.recent[k, m] == moves.stretch[begin + n]:
                gain[n] -= temper[BOREDOM] * abs(gain[n])
                break
    if minds.beside[k] != NOBODY:
        keep_out_of_step(k, begin, minds, moves, gain)
    few = min(int(temper[FEW]), count)
    best = np.empty(few, dtype=np.int64)
    kept = 0
    for i in range(few):
        top = best_left(gain, allowed, best, kept)
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
def carry_away(k, push, anchor, foot):
    """Move character k by its push; planted feet stay where they are."""
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
    target: np.ndarray  # [B] bool, what can be struck
    guard: np.ndarray  # [B] bool, an arm: it must be struck squarely
    limb: np.ndarray  # [B] the limb that strikes with the part, or NO_LIMB
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
    flying: np.ndarray  # [K] bool, whether any of them may still land
    part: np.ndarray  # [K, 4] what was hit in this frame, or NO_HIT
    when: np.ndarray  # [K, 4] 0..1 within the frame


@kernel
def carried_point(k, j, position, world_wxyz, v, i):
    """Point v[i] of joint j of character k, in the scene."""
    x, y, z = turned(
        world_wxyz[k, j, 0],
        world_wxyz[k, j, 1],
        world_wxyz[k, j, 2],
        world_wxyz[k, j, 3],
        v[i, 0],
        v[i, 1],
        v[i, 2],
    )
    return position[k, j, 0] + x, position[k, j, 1] + y, position[k, j, 2] + z


@kernel
def measure_one(k, position, world_wxyz, shapes, blows):
    """Fists and body parts of character k in the pose just made; the last become those before."""
    tip, a, b = blows.tip, blows.a, blows.b
    for s in range(4):
        for c in range(3):
            tip[0, k, s, c] = tip[1, k, s, c]
        j = shapes.tip_joint[s]
        tip[1, k, s, 0], tip[1, k, s, 1], tip[1, k, s, 2] = carried_point(
            k, j, position, world_wxyz, shapes.tip_offset, s
        )
    for p in range(shapes.joint.shape[0]):
        for c in range(3):
            a[0, k, p, c] = a[1, k, p, c]
            b[0, k, p, c] = b[1, k, p, c]
        j = shapes.joint[p]
        a[1, k, p, 0], a[1, k, p, 1], a[1, k, p, 2] = carried_point(
            k, j, position, world_wxyz, shapes.start, p
        )
        b[1, k, p, 0], b[1, k, p, 1], b[1, k, p, 2] = carried_point(
            k, j, position, world_wxyz, shapes.end, p
        )


@kernel
def throw_one(k, blow_of_frame, f, blows):
    """Note which blows character k throws at frame f; a limb that rests may throw them again.

    Returns how many have begun; whether any may land is noted, too.
    """
    begun, flying = 0, False
    for s in range(4):
        blow = blow_of_frame[f, s]
        blows.begun[k, s] = blow != NO_BLOW and blow != blows.thrown[k, s]
        blows.thrown[k, s] = blow
        blows.part[k, s] = NO_HIT
        if blow == NO_BLOW:
            blows.landed[k, s] = NO_BLOW
        begun += blows.begun[k, s]
        flying = flying or blow != blows.landed[k, s]
    blows.flying[k] = flying
    return begun


@kernel
def hit_one(k, victim, shapes, blows):
    """What each blow of character k touches first of its victim in this frame; how many do.

    A glove that throws a blow of its own is passed by: two fists on their way do not meet. A blow
    that does not meet an arm squarely glances off and goes on to what is behind.
    """
    count = 0
    for s in range(4):
        blows.when[k, s] = 2.0
        blow = blows.thrown[k, s]
        if victim == NOBODY or blow == NO_BLOW or blow == blows.landed[k, s]:
            continue
        for p in range(shapes.target.shape[0]):
            own = shapes.limb[p]
            if not shapes.target[p] or (own != NO_LIMB and blows.thrown[victim, own] != NO_BLOW):
                continue
            p0, p1 = blows.tip[0, k, s], blows.tip[1, k, s]
            a0, a1 = blows.a[0, victim, p], blows.a[1, victim, p]
            b0, b1 = blows.b[0, victim, p], blows.b[1, victim, p]
            t = swept_contact(
                p0,
                p1,
                a0,
                a1,
                b0,
                b1,
                shapes.radius_start[p],
                shapes.radius_end[p],
                shapes.tip_radius[s],
            )
            if t < 0.0 or t >= blows.when[k, s]:
                continue
            if not shapes.guard[p] or squareness(t, p0, p1, a0, a1, b0, b1) >= SQUARELY:
                blows.when[k, s] = t
                blows.part[k, s] = p
        count += blows.part[k, s] != NO_HIT
    return count


class Room(NamedTuple):
    """How bodies that come too near are carried apart, and where that is worked out."""

    closest: float  # m between pelvises under which they are
    most: float  # m a frame and pair
    push: np.ndarray  # [K, 2] m


@kernel
def start_blows(played, grid, shapes, blows):
    """What :func:`step` expects of the frame before the first: places hashed, bodies measured."""
    fill_hash(played.poses.root_position, grid)
    for k in range(played.frame.shape[0]):
        measure_one(k, played.poses.position, played.poses.world_wxyz, shapes, blows)
        throw_one(k, played.blow_of_frame, played.frame[k], blows)


def _advance(dt, own, springs, capture, build, offsets, poses, grid, room, shapes, blows):
    frame, place = own.frame, poses.root_position
    for k in prange(frame.shape[0]):
        move_on(k, frame, own.fraction, own.rate, own.pace)
        show_part(k, dt, own, springs, capture, build, offsets, poses)
    fill_hash(place, grid)
    for k in prange(frame.shape[0]):
        push_one(k, place, room.closest, room.most, grid, room.push[k])
    for k in prange(frame.shape[0]):
        carry_away(k, room.push, own.anchor, offsets.foot)
    count = 0
    for k in prange(frame.shape[0]):
        measure_one(k, poses.position, poses.world_wxyz, shapes, blows)
        count += throw_one(k, own.blow_of_frame, frame[k], blows)
    return count


def _hit(opponent, shapes, blows):
    # Apart from the loop above: put into one, blows would be tested on bodies not yet measured.
    count = 0
    for k in prange(opponent.shape[0]):
        if blows.flying[k]:
            count += hit_one(k, opponent[k], shapes, blows)
    return count


_advance_few, _advance_many = kernel(_advance), parallel_kernel(_advance)
_hit_few, _hit_many = kernel(_hit), parallel_kernel(_hit)


@kernel
def advance(dt, played, grid, opponent, room, shapes, blows):
    """One frame of all along the actions begun: all move on, bodies are kept apart, blows tested.

    Returns how many blows began or landed.

    grid holds where all stand afterwards.
    """
    p = played
    own, offsets = own_of(p), p.offsets
    begun = _advance_few(
        dt,
        own,
        p.springs,
        p.capture,
        p.build,
        offsets,
        p.poses,
        grid,
        room,
        shapes,
        blows,
    )
    return begun + _hit_few(opponent, shapes, blows)


@kernel
def advance_many(dt, played, grid, opponent, room, shapes, blows):
    """:func:`advance` on all cores."""
    p = played  # a loop on all cores is handed tuples of arrays, but none that hold others
    own, offsets = own_of(p), p.offsets
    begun = _advance_many(
        dt,
        own,
        p.springs,
        p.capture,
        p.build,
        offsets,
        p.poses,
        grid,
        room,
        shapes,
        blows,
    )
    return begun + _hit_many(opponent, shapes, blows)


def _choose(who, states, place, grid, actors, minds, moves, behaviours, horizon, choices):
    """Who [W], in states [W], choose, all at once; then, once more, those of two who face each
    other and have chosen the same. grid must hold where all stand, place [K, 3].
    """
    count = who.shape[0]
    order = np.empty(count, dtype=np.int64)
    for w in range(count):
        o = actors.opponent[who[w]]
        minds.beside[who[w]] = NOBODY if o == NOBODY else actors.frame[o]
        order[w] = w
    for turn in range(2):
        for n in prange(count):
            k, state = who[order[n]], states[order[n]]
            decide_one(k, state, place, grid, actors, minds, moves, behaviours, horizon, choices)
        if turn == 0:
            again = 0
            for w in range(count):
                if give_way(who[w], actors, minds, choices):
                    order[again] = w
                    again += 1
            count = again


choose, choose_many = kernel(_choose), parallel_kernel(_choose)
