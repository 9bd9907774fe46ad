"""A fight as a game (Shum et al. 2012, sections V and VI): who can do what, and what comes of it.

Two players play stretches of an action-level graph, each from where it stands. Whoever ends first
chooses next. What both do until then is known, so blows that meet are found; a blow that lands cuts
the victim's action short and puts a reaction in its place, which the victim does not choose.

Times are frames. A planar frame (x, z, yaw) carries points of a stretch's own frame, the facing
frame it begins in, into the scene. Shapes: N states, A actions, L stretches, R rows (a stretch of T
frames has T + 1, its beginning first), P tips (frames in which a blow may land), B spheres.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kumite.kernels.jit import kernel
from kumite.kernels.policy import wrapped
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

# The state of one player; a state is that of both, one after the other.
STRETCH, BEGUN, END, X, Z, YAW, LANDED, FIELDS = range(8)
STATE = 2 * FIELDS
NOTHING = -1
TRUNK = 4  # spheres that must not overlap: head, chest, belly, pelvis; the rest are arms
HEAD = 0
IDLE, ATTACK, DEFENCE, OTHER = range(4)
ILLOGICAL, TOO_FAR, TURNED_AWAY, OVERLAPS, ENDS_INSIDE = 1, 2, 4, 8, 16
"""What is wrong with an action (section V-C), the least important first."""
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
    spread: np.ndarray  # [L] m from the facing frame to a trunk's sphere on the ground, at most
    body: np.ndarray  # [R, B, 3] m, float32, centres of spheres
    radius: np.ndarray  # [B] m, met by a tip
    bulk: np.ndarray  # [TRUNK] m, kept from the other trunk: arms are held before it
    tip_start: np.ndarray  # [L + 1]
    tip_when: np.ndarray  # [P] frames since the beginning, ascending in a stretch
    tip: np.ndarray  # [P, 3] m
    tip_before: np.ndarray  # [P, 3] m, a frame earlier: nothing skips through
    tip_speed: np.ndarray  # [P] m/s
    tip_blow: np.ndarray  # [P] number of the blow, ascending in time
    last_tip: np.ndarray  # [L] frames, or NOTHING


class Rules(NamedTuple):
    """What counts."""

    stride: int  # frames between those in which bodies are compared
    facing: np.ndarray  # [2] rad from the opponent at the end of an action, at most
    attack_range: float  # m
    defence_range: float  # m
    tip_radius: float  # m
    catch: float  # m between two that counts as caught; 0: nobody is
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
    response: np.ndarray  # [2, SIZES] stretches of reactions to the trunk and the head, or NOTHING
    tired: np.ndarray  # [L] what it costs the searcher to begin a stretch: it did the like lately


_FIELDS = {n: t for part in (Moves, Rules, Want) for n, t in part.__annotations__.items()}
Game = NamedTuple("Game", list(_FIELDS.items()))  # type: ignore[misc]  # flat, for the search


@kernel
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
            game.spread,
            game.body,
            game.radius,
            game.bulk,
            game.tip_start,
            game.tip_when,
            game.tip,
            game.tip_before,
            game.tip_speed,
            game.tip_blow,
            game.last_tip,
        ),
        Rules(
            game.stride,
            game.facing,
            game.attack_range,
            game.defence_range,
            game.tip_radius,
            game.catch,
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
            game.response,
            game.tired,
        ),
    )


@kernel
def compose(x, z, yaw, u, w, turn):
    """Planar frame (u, w, turn) of frame (x, z, yaw), in the scene."""
    c, s = np.cos(yaw), np.sin(yaw)
    return x + c * u + s * w, z - s * u + c * w, yaw + turn


@kernel
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


@kernel
def begin(state, p, k, time, x, z, yaw, moves):
    """Player p begins stretch k at a time and place."""
    o = p * FIELDS
    state[o + STRETCH], state[o + BEGUN], state[o + END] = k, time, time + moves.duration[k]
    state[o + X], state[o + Z], state[o + YAW] = x, z, yaw
    state[o + LANDED] = NOTHING


@kernel
def next_player(state):
    """Who ends first; of equals the searcher."""
    return 0 if state[END] <= state[FIELDS + END] else 1


@kernel
def contact(state, p, since, until, moves, rules):
    """The first tip of player p that meets the opponent after ``since``, no later than ``until``.

    Returns (tip or NOTHING, sphere). Arms are met where they are in the way at that frame.
    """
    a, v = p * FIELDS, (1 - p) * FIELDS
    k, other = int(state[a + STRETCH]), int(state[v + STRETCH])
    yaw = state[a + YAW] - state[v + YAW]
    c, s = np.cos(yaw), np.sin(yaw)
    x, z = state[a + X] - state[v + X], state[a + Z] - state[v + Z]
    cv, sv = np.cos(state[v + YAW]), np.sin(state[v + YAW])
    x, z = cv * x - sv * z, sv * x + cv * z  # the attacker's frame, seen from the victim's
    body, radius, when = moves.body, moves.radius, moves.tip_when
    tip, before = moves.tip, moves.tip_before
    for n in range(moves.tip_start[k], moves.tip_start[k + 1]):
        time = state[a + BEGUN] + when[n]
        if time <= since or moves.tip_blow[n] <= state[a + LANDED]:
            continue
        if time > until:
            break
        i = min(max(int(time - state[v + BEGUN]), 0), moves.duration[other])
        row = moves.start[other] + i
        px, pz = x + c * tip[n, 0] + s * tip[n, 2], z - s * tip[n, 0] + c * tip[n, 2]
        qx, qz = x + c * before[n, 0] + s * before[n, 2], z - s * before[n, 0] + c * before[n, 2]
        py, qy = tip[n, 1], before[n, 1]
        ux, uy, uz = px - qx, py - qy, pz - qz  # the way of the tip in this frame
        way2 = ux * ux + uy * uy + uz * uz + 1e-12
        met, soonest = NOTHING, 2.0
        for b in range(radius.shape[0]):
            wx, wy, wz = body[row, b, 0] - qx, body[row, b, 1] - qy, body[row, b, 2] - qz
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


@kernel
def land(before, state, p, n, part, moves, rules, want):
    """Tip n of player p meets a part: damage D (Eq. 6), and what its reaction is asked for.

    The victim's action is cut short there. before: the state as it was when the blow landed.
    """
    a = p * FIELDS
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
    time = before[a + BEGUN] + moves.tip_when[n]
    x, z, yaw = place_at(before, 1 - p, time, moves)
    begin(state, 1 - p, response, time, x, z, yaw, moves)
    asked = want.asked[1 - p, response] * want.weights[1 - p, REQUIREMENT]
    return damage, asked


@kernel
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


@kernel
def play_on(state, since, until, both, moves, rules, want):
    """What happens after ``since`` until someone chooses, or, with ``both``, until both have ended.

    Returns what player 0 and player 1 dealt, weighted by their own w⁺, what they dealt unweighted
    (D of Eq. 6), coop of reactions, and whether one was caught before someone chooses. ``state`` is
    changed by reactions.
    """
    chosen, near = since, False
    score0, score1, dealt0, dealt1, coop = 0.0, 0.0, 0.0, 0.0, 0.0
    while True:
        ends = (state[END], state[FIELDS + END])
        to = min(until, max(ends[0], ends[1]) if both else min(ends[0], ends[1]))
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
        if not both and not near:
            near = caught(state, chosen, since, min(when, to), moves, rules)
        if when == np.inf:
            return score0, score1, dealt0, dealt1, coop, near
        since = when
        # Blows of one frame both land: the state before it counts for both.
        before = state.copy()
        if n0 != NOTHING:
            state[LANDED] = moves.tip_blow[n0]
        if n1 != NOTHING:
            state[FIELDS + LANDED] = moves.tip_blow[n1]
        for p in range(2):
            n, part = (n0, part0) if p == 0 else (n1, part1)
            if n == NOTHING:
                continue
            damage, asked = land(before, state, p, n, part, moves, rules, want)
            short = moves.short[int(before[p * FIELDS + STRETCH])]
            worth = damage * want.weights[p, GIVEN_SHORT if short else GIVEN_LONG]
            coop += asked
            if p == 0:
                score0, dealt0 = score0 + worth, dealt0 + damage
            else:
                score1, dealt1 = score1 + worth, dealt1 + damage


@kernel
def opponent_ahead(state, q, time, x, z, yaw, rows, moves):
    """Bodies [n, TRUNK, 3] and facing frames [n, 2] of player q from ``time`` to the end of its
    action, seen from (x, z, yaw); n of at most ``rows``."""
    o = q * FIELDS
    k = int(state[o + STRETCH])
    first = min(max(int(time - state[o + BEGUN]), 0), moves.duration[k])
    n = min(moves.duration[k] - first + 1, rows)
    body, place = np.empty((n, TRUNK, 3)), np.empty((n, 2))
    c, s = np.cos(yaw), np.sin(yaw)
    u, w = state[o + X] - x, state[o + Z] - z
    u, w = c * u - s * w, s * u + c * w
    turn = state[o + YAW] - yaw
    c, s = np.cos(turn), np.sin(turn)
    source, track = moves.body, moves.track
    for i in range(n):
        row = moves.start[k] + first + i
        place[i, 0] = u + c * track[row, 0] + s * track[row, 1]
        place[i, 1] = w - s * track[row, 0] + c * track[row, 1]
        for b in range(TRUNK):
            bx, bz = source[row, b, 0], source[row, b, 2]
            body[i, b, 0] = u + c * bx + s * bz
            body[i, b, 1] = source[row, b, 1]
            body[i, b, 2] = w - s * bx + c * bz
    return body, place


@kernel
def overlaps(body, row, other, i, bulk):
    """Whether the trunk spheres of two bodies overlap."""
    for a in range(TRUNK):
        for b in range(TRUNK):
            dx = body[row, a, 0] - other[i, b, 0]
            dy = body[row, a, 1] - other[i, b, 1]
            dz = body[row, a, 2] - other[i, b, 2]
            r = bulk[a] + bulk[b]
            if dx * dx + dy * dy + dz * dz < r * r:
                return True
    return False


@kernel
def judge(stretches, other, place, spread, attacked, facing, moves, rules, flaws):
    """What is wrong with each of stretches [n] (section V-C), into flaws [n].

    other [m, TRUNK, 3], place [m, 2]: the opponent frame by frame, seen from here, then it stands;
    its spheres are within ``spread`` [m] of its place. Ranges are those of the nearest the two get,
    where the stretch is begun or later. facing [rad]: how far from the opponent it may end.
    """
    body, track, start, bulk = moves.body, moves.track, moves.start, moves.bulk
    duration, kind, stride = moves.duration, moves.kind, rules.stride
    last = place.shape[0] - 1
    widest = 2.0 * bulk.max()
    cone = np.cos(facing)
    for n in range(stretches.shape[0]):
        k = stretches[n]
        flaw, nearest2 = 0, place[0, 0] * place[0, 0] + place[0, 1] * place[0, 1]
        apart = widest + spread + moves.spread[k]  # m: farther off, trunks cannot touch
        for i in range(stride, duration[k] + stride, stride):
            f = min(i, duration[k])
            row, h = start[k] + f, min(f, last)
            dx, dz = place[h, 0] - track[row, 0], place[h, 1] - track[row, 1]
            d2 = dx * dx + dz * dz
            nearest2 = min(nearest2, d2)
            if d2 < apart * apart and overlaps(body, row, other, h, bulk):
                flaw |= OVERLAPS
                if f == duration[k]:
                    flaw |= ENDS_INSIDE
        row, h = start[k] + duration[k], min(duration[k], last)
        dx, dz = place[h, 0] - track[row, 0], place[h, 1] - track[row, 1]
        ahead = dx * np.sin(track[row, 2]) + dz * np.cos(track[row, 2])
        if ahead < cone * np.sqrt(dx * dx + dz * dz):
            flaw |= TURNED_AWAY
        reach = rules.attack_range if kind[k] == ATTACK else rules.defence_range
        if (kind[k] == ATTACK or kind[k] == DEFENCE) and nearest2 > reach * reach:
            flaw |= TOO_FAR
        if kind[k] == DEFENCE and not attacked:
            flaw |= ILLOGICAL
        flaws[n] = flaw


@kernel
def worst_allowed(flaws):
    """The flaws that must be put up with: those of no action but the least important (section V-C).

    Actions whose flaws are below the number returned are kept. Where all overlap, OVERLAPS is taken
    from all of them: what counts then is the last frame, and the other flaws as ever.
    """
    if flaws.min() >= OVERLAPS:
        for n in range(flaws.shape[0]):
            flaws[n] -= OVERLAPS
    least = flaws.min()
    limit = 1
    while limit <= least:
        limit *= 2
    return limit


@kernel
def movement(state, p, moves, want):
    """f^mov1 of player p at the end of its action (Eq. 4), and f^mov2 (Eq. 9); both are costs."""
    weights = want.weights[p]
    time = state[p * FIELDS + END]
    x, z, yaw = place_at(state, p, time, moves)
    u, w, _ = place_at(state, 1 - p, time, moves)
    r = np.sqrt((u - x) ** 2 + (w - z) ** 2)
    off = abs(wrapped(np.arctan2(u - x, w - z) - yaw - weights[PREFERRED_FACING]))
    comp = -weights[FACING] * off * off - weights[DISTANCE] * (r - weights[PREFERRED_DISTANCE]) ** 2
    coop = 0.0
    if weights[PLACE] != 0.0:
        g = int((time - want.goal_from) / want.goal_every + 0.5)
        g = min(max(g, 0), want.goal.shape[1] - 1)
        coop -= weights[PLACE] * ((want.goal[p, g, 0] - x) ** 2 + (want.goal[p, g, 1] - z) ** 2)
    if weights[HEADING] != 0.0:
        turned = wrapped(yaw - weights[PREFERRED_HEADING])
        coop -= weights[HEADING] * turned * turned
    return comp, coop


@kernel
def edge(state, p, k, opposing, moves, rules, want):
    """What it adds that player p begins stretch k in ``state``, where it stands there already.

    Returns comp and coop as the searcher sees them; ``state`` becomes that of the next choice.
    """
    weights = want.weights[p]
    since = state[p * FIELDS + BEGUN]
    score0, score1, dealt0, dealt1, coop, near = play_on(
        state, since, np.inf, False, moves, rules, want
    )
    given, taken = (score0, dealt1) if p == 0 else (score1, dealt0)
    if near:
        given += weights[GIVEN_SHORT]
        taken += 1.0
    comp, there = movement(state, p, moves, want)
    comp += given - weights[TAKEN] * taken + weights[SUITABILITY] * want.suits[k, opposing]
    coop += there + weights[REQUIREMENT] * want.asked[p, k]
    return (comp if p == 0 else -comp), coop


@kernel
def expand(game, state, children):
    """All that whoever is next can do and should consider: see :mod:`kumite.kernels.search`."""
    moves, rules, want = parts(game)
    p = next_player(state)
    o, q = p * FIELDS, 1 - p
    time = state[o + END]
    x, z, yaw = place_at(state, p, time, moves)
    here = moves.successor[int(state[o + STRETCH])]
    stretches = moves.stretch[moves.action_start[here] : moves.action_start[here + 1]]
    opposing = int(state[q * FIELDS + STRETCH])
    due = state[q * FIELDS + BEGUN] + moves.last_tip[opposing]
    attacked = moves.kind[opposing] == ATTACK and due >= time
    longest = moves.duration.max() + 1
    other, place = opponent_ahead(state, q, time, x, z, yaw, longest, moves)
    flaws = np.empty(stretches.shape[0], dtype=np.int64)
    judge(
        stretches,
        other,
        place,
        moves.spread[opposing],
        attacked,
        rules.facing[p],
        moves,
        rules,
        flaws,
    )
    limit = worst_allowed(flaws)
    count = 0
    for n in range(stretches.shape[0]):
        if flaws[n] >= limit:
            continue
        child = children.state[count]
        for f in range(STATE):
            child[f] = state[f]
        begin(child, p, stretches[n], time, x, z, yaw, moves)
        children.action[count] = stretches[n]
        children.comp[count], children.coop[count] = edge(
            child, p, stretches[n], opposing, moves, rules, want
        )
        if p == 0:
            children.comp[count] -= want.tired[stretches[n]]
        count += 1
    return count, stretches.shape[0], p


@kernel
def leaves(game, children, count):
    """What is begun is played to its end, with nobody choosing anything more."""
    moves, rules, want = parts(game)
    weights = want.weights
    for n in range(count):
        state = children.state[n]
        since = min(state[END], state[FIELDS + END])
        score0, _, dealt0, dealt1, coop, _ = play_on(state, since, np.inf, True, moves, rules, want)
        if dealt0 > 0.0 or dealt1 > 0.0:
            children.comp[n] += score0 - weights[0, TAKEN] * dealt1
        children.coop[n] += coop
