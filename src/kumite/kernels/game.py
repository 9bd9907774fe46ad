"""A fight as a game (Shum et al. 2012, sections V and VI): who can do what, and what comes of it.

Two players play stretches of an action-level graph, each from where it stands. Whoever ends first
chooses next. What both do until then is known, so blows that meet are found; a blow that lands cuts
the victim's action short and puts a reaction in its place, which the victim does not choose.

Most actions meet nothing, and circles on the ground show it at once: these are scored where they
are. Only the others are played out. Shapes as in :mod:`kumite.kernels.moves`.
"""

from __future__ import annotations

import numpy as np

from kumite.kernels.jit import kernel, lean_kernel
from kumite.kernels.moves import (
    ATTACK,
    BEGUN,
    END,
    FALL,
    FIELDS,
    FLINCH,
    HEAD,
    LANDED,
    NOTHING,
    QUIET,
    SPHERES,
    STAGGER,
    STATE,
    STRETCH,
    YAW,
    X,
    Z,
    begin,
    carried,
    inverse,
    next_player,
    parts,
    place_at,
    seen_from,
    touch,
)
from kumite.kernels.policy import wrapped
from kumite.kernels.prune import beyond, fence, fewest, judge, way_of, worst_allowed
from kumite.kernels.style import (
    DISTANCE,
    FACING,
    GIVEN_LONG,
    GIVEN_SHORT,
    HEADING,
    PLACE,
    PREFERRED_DISTANCE,
    PREFERRED_FACING,
    PREFERRED_HEADING,
    REQUIREMENT,
    SUITABILITY,
    TAKEN,
)

ROOM = 0.8  # m that is kept to others who are not the opponent
CROWDED = 1e4  # score that is lost where there is none of it
OUTSIDE = 1e6  # score that is lost for each metre outside the arena: a blow of 10 m/s


@lean_kernel
def meets(k, begun, landed, other, other_begun, frame, since, until, moves, rules):
    """The first tip of stretch k, of a blow after ``landed``, that meets the body of ``other``
    after ``since``, no later than ``until``; both begun then. frame: k's, seen from the other's.

    Returns (tip or NOTHING, sphere). Arms are met where they are in the way at that frame.
    """
    u, w = carried(frame, moves.reach[k, 0], moves.reach[k, 1])
    if not touch(u, w, moves.reach[k, 2], moves.hull, other, rules.tip_radius):
        return NOTHING, NOTHING
    body, radius, ring, when = moves.body, moves.radius, moves.ring, moves.tip_when
    tip, before, way = moves.tip, moves.tip_before, moves.tip_way
    first, last = moves.start[other], moves.duration[other]
    for n in range(moves.tip_start[k], moves.tip_start[k + 1]):
        time = begun + when[n]
        if time <= since or moves.tip_blow[n] <= landed:
            continue
        if time > until:
            break
        row = first + min(max(int(time - other_begun), 0), last)
        px, pz = carried(frame, tip[n, 0], tip[n, 2])
        if not touch(px, pz, way[n], ring, row, rules.tip_radius):
            continue
        qx, qz = carried(frame, before[n, 0], before[n, 2])
        py, qy = tip[n, 1], before[n, 1]
        ux, uy, uz = px - qx, py - qy, pz - qz  # the way of the tip in this frame
        way2 = ux * ux + uy * uy + uz * uz + 1e-12
        mx, my, mz = px - 0.5 * ux, py - 0.5 * uy, pz - 0.5 * uz
        reached = rules.tip_radius + 0.5 * way[n]
        near = False
        for b in range(SPHERES):  # without branches: all at once
            wx, wy, wz = body[row, 0, b] - mx, body[row, 1, b] - my, body[row, 2, b] - mz
            r = radius[b] + reached
            near |= wx * wx + wy * wy + wz * wz < r * r
        if not near:
            continue
        met, soonest = NOTHING, 2.0
        for b in range(SPHERES):
            wx, wy, wz = body[row, 0, b] - qx, body[row, 1, b] - qy, body[row, 2, b] - qz
            r = radius[b] + rules.tip_radius
            nearest = (wx * ux + wy * uy + wz * uz) / way2
            along = min(max(nearest, 0.0), 1.0)
            dx, dy, dz = wx - along * ux, wy - along * uy, wz - along * uz
            d2 = dx * dx + dy * dy + dz * dz
            if d2 >= r * r:
                continue
            # Where the line enters the sphere: of two the first is met.
            beyond = nearest - along
            enters = nearest - np.sqrt((r * r - d2) / way2 + beyond * beyond)
            if enters < soonest:
                met, soonest = b, enters
        if met != NOTHING:
            return n, met
    return NOTHING, NOTHING


@lean_kernel
def contact(state, p, since, until, moves, rules):
    """The first tip of player p that meets the opponent after ``since``, no later than ``until``:
    :func:`meets`."""
    a, v = p * FIELDS, (1 - p) * FIELDS
    frame = seen_from(state, p, state[v + X], state[v + Z], state[v + YAW])
    k, begun, landed = int(state[a + STRETCH]), state[a + BEGUN], state[a + LANDED]
    other, other_begun = int(state[v + STRETCH]), state[v + BEGUN]
    return meets(k, begun, landed, other, other_begun, frame, since, until, moves, rules)


@lean_kernel
def land(state, p, n, part, when, x, z, yaw, moves, rules, want):
    """Tip n of player p meets a part: damage D (Eq. 6), and what its reaction is asked for.

    The victim, then at (x, z, yaw), has its action cut short.
    """
    speed = moves.tip_speed[n]
    damage = speed * rules.vulnerable[part]
    if damage == 0.0:
        return 0.0, 0.0
    size = FALL if speed >= rules.fall_from else STAGGER if speed >= rules.stagger_from else FLINCH
    head = 1 if part == HEAD else 0
    fall = want.response[head, FALL]
    if fall != NOTHING and want.asked[1 - p, fall] > 0.0:
        size = FALL  # the victim is to fall
    response = want.response[head, size]
    if response == NOTHING:
        return damage, 0.0
    begin(state, 1 - p, response, when, x, z, yaw, moves)
    return damage, want.asked[1 - p, response] * want.weights[1 - p, REQUIREMENT]


@lean_kernel
def caught(state, chosen, since, until, moves, rules):
    """Whether the two are within the distance of a catch after ``since``, no later than ``until``.

    Of the frames after ``chosen`` every ``stride`` is looked at.
    """
    if rules.catch == 0.0:
        return False
    for time in range(int(chosen) + 1, int(until) + 1, rules.stride):
        if time <= since:
            continue
        x, z, _ = place_at(state, 0, time, moves)
        u, w, _ = place_at(state, 1, time, moves)
        if (u - x) ** 2 + (w - z) ** 2 < rules.catch * rules.catch:
            return True
    return False


@lean_kernel
def play_on(state, before, chosen, until, moves, rules, want):
    """What happens after ``chosen`` until someone chooses, and on to ``until`` or both have ended.

    Returns what player 0 and player 1 dealt, weighted by their own w⁺, what they dealt unweighted
    (D of Eq. 6), coop of reactions, and whether one was caught before someone chooses. ``state`` is
    changed by reactions. before [STATE]: room.
    """
    since, near = chosen, False
    score0, score1, dealt0, dealt1, coop = 0.0, 0.0, 0.0, 0.0, 0.0
    while True:
        one, two = state[END], state[FIELDS + END]
        to = max(min(one, two), min(until, max(one, two)))
        when = np.inf
        n0, part0, n1, part1 = NOTHING, NOTHING, NOTHING, NOTHING
        for p in range(2):
            k, begun = int(state[p * FIELDS + STRETCH]), state[p * FIELDS + BEGUN]
            if moves.last_tip[k] == NOTHING or begun + moves.last_tip[k] <= since:
                continue
            n, part = contact(state, p, since, min(to, when), moves, rules)
            if n == NOTHING:
                continue
            if begun + moves.tip_when[n] < when:
                when, n0 = begun + moves.tip_when[n], NOTHING  # sooner than the other's
            if p == 0:
                n0, part0 = n, part
            else:
                n1, part1 = n, part
        if not near:
            near = caught(state, chosen, since, min(when, to), moves, rules)
        if when == np.inf:
            return score0, score1, dealt0, dealt1, coop, near
        since = when
        # Blows of one frame both land: the state before it counts for both.
        for s in range(STATE):
            before[s] = state[s]
        if n0 != NOTHING:
            state[LANDED] = moves.tip_blow[n0]
        if n1 != NOTHING:
            state[FIELDS + LANDED] = moves.tip_blow[n1]
        for p in range(2):
            n, part = (n0, part0) if p == 0 else (n1, part1)
            if n == NOTHING:
                continue
            x, z, yaw = place_at(before, 1 - p, when, moves)
            damage, asked = land(state, p, n, part, when, x, z, yaw, moves, rules, want)
            short = moves.short[int(before[p * FIELDS + STRETCH])]
            worth = damage * want.weights[p, GIVEN_SHORT if short else GIVEN_LONG]
            coop += asked
            if p == 0:
                score0, dealt0 = score0 + worth, dealt0 + damage
            else:
                score1, dealt1 = score1 + worth, dealt1 + damage


@lean_kernel
def closeness(weights, p, u, w, yaw):
    """f^mov1 of player p (Eq. 4) who looks along ``yaw``, the opponent (u, w) away; a cost."""
    off = wrapped(np.arctan2(u, w) - yaw - weights[p, PREFERRED_FACING])
    far = np.sqrt(u * u + w * w) - weights[p, PREFERRED_DISTANCE]
    return -weights[p, FACING] * off * off - weights[p, DISTANCE] * far * far


@lean_kernel
def among_others(p, x, z, time, rules, want):
    """What others make of player p's place at a time: it is one against those who are after it,
    too, their objectives summed with its opponent's (section VIII-B); nobody runs into anybody.
    """
    weights, third = want.weights, want.third
    g = int((time - want.goal_from) / want.goal_every + 0.5)
    g = min(max(g, 0), third.shape[1] - 1)
    comp = 0.0
    for e in range(third.shape[0]):
        u, w = third[e, g, 0] - x, third[e, g, 1] - z
        far = np.sqrt(u * u + w * w)
        if want.third_side[e] == 1 - p:
            mine, its = far - weights[p, PREFERRED_DISTANCE], far - want.third_wants[e, 1]
            comp += want.third_wants[e, 0] * its * its - weights[p, DISTANCE] * mine * mine
            if far < rules.catch:
                comp -= weights[p, TAKEN] + want.third_wants[e, 2]
        if far < ROOM:
            comp -= CROWDED * (1.0 - far / ROOM)
    return comp


@lean_kernel
def standing(p, x, z, yaw, u, w, time, rules, want):
    """f^mov1 (Eq. 4) and f^mov2 (Eq. 9) of player p in (x, z, yaw) at a time, the opponent at
    (u, w); both are costs."""
    weights = want.weights
    coop = 0.0
    if weights[p, PLACE] != 0.0:
        g = int((time - want.goal_from) / want.goal_every + 0.5)
        g = min(max(g, 0), want.goal.shape[1] - 1)
        aside, short = want.goal[p, g, 0] - x, want.goal[p, g, 1] - z
        coop -= weights[p, PLACE] * (aside * aside + short * short)
    if weights[p, HEADING] != 0.0:
        turned = wrapped(yaw - weights[p, PREFERRED_HEADING])
        coop -= weights[p, HEADING] * turned * turned
    comp = closeness(weights, p, u - x, w - z, yaw)
    if want.third.shape[0] > 0:
        comp += among_others(p, x, z, time, rules, want)
    return comp, coop


@lean_kernel
def movement(state, p, moves, rules, want):
    """f^mov1 and f^mov2 of player p at the end of its action."""
    time = state[p * FIELDS + END]
    x, z, yaw = place_at(state, p, time, moves)
    u, w, _ = place_at(state, 1 - p, time, moves)
    return standing(p, x, z, yaw, u, w, time, rules, want)


@lean_kernel
def edge(state, before, p, moves, rules, want):
    """What it adds in ``state`` that player p has begun a stretch: comp, coop as p sees them.

    ``state`` becomes that of the next choice.
    """
    score0, score1, dealt0, dealt1, coop, near = play_on(
        state, before, state[p * FIELDS + BEGUN], -np.inf, moves, rules, want
    )
    given, taken = (score0, dealt1) if p == 0 else (score1, dealt0)
    if near:
        given += want.weights[p, GIVEN_SHORT]
        taken += 1.0
    comp, there = movement(state, p, moves, rules, want)
    return comp + given - want.weights[p, TAKEN] * taken, coop + there


@lean_kernel
def choices(game, state, children, before, way, flaws):
    """:func:`expand`; before [STATE], way [m, 5] and flaws [M]: room."""
    moves, rules, want = parts(game)
    p = next_player(state)
    o, q = p * FIELDS, 1 - p
    time = state[o + END]
    x, z, yaw = place_at(state, p, time, moves)
    here = moves.successor[int(state[o + STRETCH])]
    stretches = moves.stretch[moves.action_start[here] : moves.action_start[here + 1]]
    # The opponent, seen from where the stretches begin.
    opposing, begun = int(state[q * FIELDS + STRETCH]), state[q * FIELDS + BEGUN]
    due = moves.last_tip[opposing] != NOTHING and begun + moves.last_tip[opposing] > time
    done = min(max(int(time - begun), 0), moves.duration[opposing])
    first, last = moves.start[opposing] + done, moves.duration[opposing] - done
    frame = seen_from(state, q, x, z, yaw)
    attacked = moves.kind[opposing] == ATTACK and begun + moves.last_tip[opposing] >= time
    landed = state[q * FIELDS + LANDED]
    back = inverse(frame)
    u, w, _ = place_at(state, q, time, moves)
    _, coop_here = standing(p, x, z, yaw, u, w, time, rules, want)
    stands = way_of(first, last, frame, moves, rules.stride, way)
    flaws = flaws[: stretches.shape[0]]
    for hasty in (True, False):
        judge(
            stretches,
            first,
            last,
            frame,
            way,
            stands,
            attacked,
            rules.facing[p],
            hasty,
            moves,
            rules,
            flaws,
        )
        if rules.arena != 0.0:
            fence(stretches, x, z, yaw, hasty, moves, rules, flaws)
        if fewest(flaws) == 0:  # whatever has a flaw goes, and it makes no difference which
            break
    limit = worst_allowed(flaws)
    action, comps, coops, states = children.action, children.comp, children.coop, children.state
    weights, sign = want.weights, 1.0 if p == 0 else -1.0
    more = weights[p, PLACE] != 0.0 or weights[p, HEADING] != 0.0 or want.third.shape[0] > 0
    count = 0
    for n in range(stretches.shape[0]):
        if flaws[n] >= limit:
            continue
        k = stretches[n]
        for f in range(STATE):
            states[count, f] = state[f]
        begin(states[count], p, k, time, x, z, yaw, moves)
        hit = np.inf  # when first something meets, if both go on
        if moves.last_tip[k] != NOTHING:
            met, _ = meets(k, time, NOTHING, opposing, begun, back, time, hit, moves, rules)
            if met != NOTHING:
                hit = time + moves.tip_when[met]
        if due:
            met, _ = meets(opposing, begun, landed, k, time, frame, time, hit, moves, rules)
            if met != NOTHING:
                hit = begun + moves.tip_when[met]
        states[count, QUIET] = 1.0 if hit == np.inf else 0.0
        chosen = min(state[q * FIELDS + END], time + moves.duration[k])
        if hit > chosen and rules.catch == 0.0 and not more:
            row, other = moves.start[k] + moves.duration[k], first + min(moves.duration[k], last)
            u, w = carried(frame, moves.track[other, 0], moves.track[other, 1])
            u, w = u - moves.track[row, 0], w - moves.track[row, 1]
            comp, coop = closeness(weights, p, u, w, moves.track[row, 2]), 0.0
        else:
            comp, coop = edge(states[count], before, p, moves, rules, want)
        comp += weights[p, SUITABILITY] * want.suits[k, opposing]
        if rules.arena != 0.0:
            row = moves.start[k] + moves.duration[k]
            out = beyond(x, z, yaw, moves.track[row, 0], moves.track[row, 1], rules.arena)
            comp -= OUTSIDE * max(out, 0.0)
        action[count], comps[count] = k, sign * comp
        # Of the way to a check point counts what is gained: few long actions are no better.
        coops[count] = coop - coop_here + weights[p, REQUIREMENT] * want.asked[p, k]
        if p == 0:
            comps[count] -= want.tired[k]
        count += 1
    return count, stretches.shape[0], p


@lean_kernel
def look_at(game, state, stretches, way, flaws):
    """Flaws [n] of whoever is next beginning one of stretches [n]; way [m, 5]: room."""
    moves, rules, _ = parts(game)
    p = next_player(state)
    q = 1 - p
    time = state[p * FIELDS + END]
    x, z, yaw = place_at(state, p, time, moves)
    opposing, begun = int(state[q * FIELDS + STRETCH]), state[q * FIELDS + BEGUN]
    done = min(max(int(time - begun), 0), moves.duration[opposing])
    first, last = moves.start[opposing] + done, moves.duration[opposing] - done
    frame = seen_from(state, q, x, z, yaw)
    attacked = moves.kind[opposing] == ATTACK and begun + moves.last_tip[opposing] >= time
    stands = way_of(first, last, frame, moves, rules.stride, way)
    facing = rules.facing[p]
    judge(stretches, first, last, frame, way, stands, attacked, facing, False, moves, rules, flaws)
    if rules.arena != 0.0:
        fence(stretches, x, z, yaw, False, moves, rules, flaws)


@kernel
def flaws_of(game, state, k):
    """What is wrong with whoever is next beginning stretch k: see :mod:`kumite.kernels.prune`."""
    flaws = np.zeros(1, dtype=np.int64)
    room = game.duration.max() // game.stride + 2
    look_at(game, state, np.array([k]), np.empty((room, 5)), flaws)
    return flaws[0]


@kernel
def expand(game, state, children):
    """All that whoever is next can do and should consider: see :mod:`kumite.kernels.search`."""
    q = 1 - next_player(state)
    looked = game.duration[int(state[q * FIELDS + STRETCH])] // game.stride + 2
    flaws = np.empty(children.action.shape[0], dtype=np.int64)
    return choices(game, state, children, np.empty(STATE), np.empty((looked, 5)), flaws)


@lean_kernel
def play_out(game, children, count, before):
    """:func:`leaves`; before [STATE]: room."""
    moves, rules, want = parts(game)
    for n in range(count):
        if children.state[n, QUIET] != 0.0:
            continue
        state = children.state[n]
        since = min(state[END], state[FIELDS + END])
        score0, _, dealt0, dealt1, coop, _ = play_on(
            state, before, since, np.inf, moves, rules, want
        )
        if dealt0 > 0.0 or dealt1 > 0.0:
            children.comp[n] += score0 - want.weights[0, TAKEN] * dealt1
        children.coop[n] += coop


@kernel
def leaves(game, children, count):
    """What is begun is played to its end, with nobody choosing anything more."""
    play_out(game, children, count, np.empty(STATE))
