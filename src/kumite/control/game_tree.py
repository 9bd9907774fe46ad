"""Fighters that compete and cooperate by game tree (Shum et al. 2012).

A decision expands what both may do for some levels (:mod:`kumite.kernels.game`), by the exact
search of :mod:`kumite.kernels.search`. Nothing is precomputed but the geometry of the actions:
styles, check points, wanted actions and depth may change between any two decisions (B12).
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kumite.annotate import KINDS
from kumite.body import lay_body
from kumite.control.combination import build_table
from kumite.control.rules import Player, Rules
from kumite.control.styles import VULNERABILITY, short_range
from kumite.errors import KumiteError
from kumite.graph import Layer
from kumite.kernels import game as fight
from kumite.kernels import moves as kernels
from kumite.kernels import prune
from kumite.kernels.blow import NO_BLOW
from kumite.kernels.moves import FALL, FLINCH, NOTHING, SIZES, STAGGER
from kumite.kernels.search import make_search
from kumite.kernels.style import HEADING, PLACE, REQUIREMENT
from kumite.rotation import planar_apply, planar_compose, planar_inverse, rotate
from kumite.synthesis.cast import blow_windows
from kumite.synthesis.response import find_responses

TRUNK = ("head", "chest", "waist", "pelvis")
ARMS = ("left_forearm", "left_hand", "right_forearm", "right_hand")
BULK = 0.08  # m by which a trunk is thicker for the other body: arms are held before it
STOUTER = 1.1  # the spheres of a part are that much thicker than its capsule: they stand for all
SLACK = 1e-6  # m by which bounds are wider than what they hold: no rounding makes a difference
MEMORY = 8  # actions back that "recently" goes
GOAL_EVERY = 0.25  # s
CALM = ("transition", "idle")  # kinds of who waits
GOES_NOWHERE = 0.15  # m that one may move and still be at rest
HALT_EVERY = 0.1  # s between places on a way to come to rest
MOST_HALTS = 8  # such ways of a state
OUTSIDE = 1e12  # score that an action loses which is not in the set: more than all else together
COOPERATIVE = [HEADING, PLACE, REQUIREMENT]  # columns of weights


@dataclass(frozen=True)
class Others:
    """Third characters whom two players meet (E of them)."""

    track: np.ndarray  # [E, G, 2] m, where they will be now and every GOAL_EVERY s
    side: np.ndarray  # [E] whose opponent they are after: 0 the first player's, 1 its own, else -1
    wants: np.ndarray  # [E, 3] their w_r, r_d [m] and w_D⁺ of a catch


NOBODY_ELSE = Others(np.zeros((0, 1, 2)), np.zeros(0, dtype=np.int64), np.zeros((0, 3)))


@dataclass(frozen=True)
class Decision:
    """What was chosen, and out of how much."""

    stretch: int
    comp: float  # of the best line of play
    coop: float
    nodes: np.ndarray  # [D + 1] at each depth, the root at 0
    considered: np.ndarray  # [D + 1] the same before pruning
    seconds: float
    outside: bool = False  # of the action set: nothing in it could be done
    flaws: tuple[str, ...] = ()  # rules of pruning that it breaks: no action passes them all

    @property
    def pruned(self) -> float:
        """Share of the actions looked at that were not considered further."""
        return 1.0 - float(self.nodes[1:].sum()) / max(float(self.considered[1:].sum()), 1.0)


FLAWS = {
    prune.LEAVES: "leaves the arena",
    prune.RUNS_OUT: "runs out of the arena",
    prune.ENDS_INSIDE: "ends inside",
    prune.OVERLAPS: "overlaps",
    prune.TURNED_AWAY: "turned away",
    prune.TOO_FAR: "too far",
    prune.ILLOGICAL: "illogical",
}
"""What may be wrong with an action that is chosen all the same, for want of a better one."""
SEARCH = make_search(fight.expand, fight.leaves)


class GameTree:
    """The game that a library of whole actions is, and the search of it."""

    def __init__(
        self, library: Layer, rules: Rules | None = None, suits: np.ndarray | None = None
    ) -> None:
        """suits [A, A]: S of the library's actions against each other, by default as
        :func:`build_table` finds it. Errors: the graph is not one of whole actions.
        """
        self.library = library
        self.rules = rules or Rules()
        action = library.action_of_stretch
        actions = library.actions
        assert actions is not None  # action_of_stretch has looked
        if suits is None:
            suits = build_table(library, actions).suitability
        self.suits = np.ascontiguousarray(suits[np.ix_(action, action)], dtype=np.float32)
        self.kinds = tuple(KINDS[k] for k in actions.kind[action].tolist())
        self.labels = tuple(actions.label[a] for a in action.tolist())
        self.moves = _moves(library)
        self.response = self._responses()
        self.blow_rank = _ranks(library)
        self.most = int(np.diff(library.table.action_start).max())

    @cached_property
    def kind_number(self) -> np.ndarray:
        """[L] the same number for stretches of one kind; idling counts as moving about."""
        return np.unique(["wait" if k in CALM else k for k in self.kinds], return_inverse=True)[1]

    @cached_property
    def names(self) -> frozenset[str]:
        """Kinds and labels that A⁺, A⁻ and the action set may name."""
        return frozenset(self.kinds) | frozenset(self.labels)

    @cached_property
    def choices(self) -> tuple[str, ...]:
        """Kinds, then labels, of what can be chosen."""
        kinds, labels = ({of[k] for k in self._offered} for of in (self.kinds, self.labels))
        return (*sorted(kinds), *sorted(labels - kinds - {""}))

    def asked(self, player: Player) -> np.ndarray:
        """1 of each stretch in A⁺, -1 in A⁻, else 0 [L]. Errors: names that no action has; A⁻
        holds all that can be chosen.
        """
        out = self._named(player.wanted).astype(float) - self._named(player.unwanted)
        if player.unwanted and np.all(out[self._offered] < 0):
            raise KumiteError("A⁻ holds every action that can be chosen; expected one to be left")
        return out

    def allowed(self, player: Player) -> np.ndarray:
        """Whether each stretch is in the action set [L]. Errors: names that no action has; nothing
        in it can be chosen.
        """
        if not player.only:
            return np.ones(len(self.kinds), dtype=bool)
        out = self._named(player.only)
        if not out[self._offered].any():
            raise KumiteError(
                f"the action set ({', '.join(player.only)}) holds no action that can be chosen; "
                "expected one"
            )
        return out

    @cached_property
    def _offered(self) -> np.ndarray:
        """Stretches that can be chosen."""
        return np.unique(self.moves.stretch)

    def _named(self, names: tuple[str, ...]) -> np.ndarray:
        """Whether each stretch [L] is of one of these kinds or labels. Errors: unknown ones."""
        unknown = sorted({*names} - self.names)
        if unknown:
            raise KumiteError(
                f"no action is called {', '.join(map(repr, unknown))}; expected kinds "
                f"({', '.join(sorted(set(self.kinds)))}) or labels of the library"
            )
        return np.isin(self.kinds, names) | np.isin(self.labels, names)

    def _responses(self) -> np.ndarray:
        """Stretches [2, SIZES] that answer a blow to the trunk and to the head, or NOTHING.

        Of each size the one in which the body goes straightest back; where none has a size, the
        next smaller one.
        """
        table, kinds = self.library.table, np.array(self.kinds)
        reaction = np.flatnonzero(kinds == "reaction")
        out = np.full((2, SIZES), NOTHING)
        if len(reaction) == 0:
            return out
        spans = [(int(table.first[k]), int(table.last[k])) for k in reaction]
        found = find_responses(self.library.clips, spans)
        size = np.array([found.size[found.response == r].max() for r in range(len(spans))])
        back = -table.displacement[reaction, 1] - np.abs(table.displacement[reaction, 0])
        for wanted in (FLINCH, STAGGER, FALL):
            there = np.flatnonzero(size == wanted)
            order = reaction[there[np.argsort(-back[there], kind="stable")]]
            if len(order):
                out[0, wanted], out[1, wanted] = order[min(1, len(order) - 1)], order[0]
            elif wanted > FLINCH:
                out[:, wanted] = out[:, wanted - 1]
        return out

    def state(
        self,
        stretches: tuple[int, int],
        begun: tuple[float, float],
        ends: tuple[float, float],
        facing: tuple[np.ndarray, np.ndarray],
        now: float,
        landed: tuple[int, int] = (NO_BLOW, NO_BLOW),
    ) -> np.ndarray:
        """The state of two players at a time [frames], the searcher first.

        facing: the planar frames [3] in which they are now; begun: when their stretches began;
        landed: the blow of the library that each has landed last with what it is doing, or NO_BLOW.
        """
        out = np.zeros(kernels.STATE)
        for p in range(2):
            k = stretches[p]
            i = int(np.clip(now - begun[p], 0, self.moves.duration[k]))
            here = self.moves.track[self.moves.start[k] + i]
            anchor = planar_compose(facing[p], planar_inverse(here))
            out[p * kernels.FIELDS : (p + 1) * kernels.FIELDS] = [
                k,
                begun[p],
                ends[p],
                *anchor,
                NOTHING if landed[p] == NO_BLOW else self.blow_rank[landed[p]],
            ]
        return out

    def game(
        self,
        players: tuple[Player, Player],
        recent: tuple[int, ...] = (),
        now: float = 0.0,
        others: Others = NOBODY_ELSE,
    ) -> kernels.Game:
        """What the search needs besides the state; recent: stretches that the first used lately;
        now: the time [frames], from which goals count.
        """
        r, fps = self.rules, self.library.clips.fps
        vulnerable = np.array(
            [VULNERABILITY["head" if p == "head" else "torso"] for p in TRUNK]
            + [VULNERABILITY["limbs"]] * len(ARMS)
        )
        rules = kernels.Rules(
            max(1, round(r.every * fps)),
            np.array([r.facing if p.facing is None else p.facing for p in players]),
            float(r.attack_range),
            float(r.defence_range),
            float(r.tip_radius),
            float(r.catch),
            float(r.arena),
            float(r.stagger_from),
            float(r.fall_from),
            vulnerable,
        )
        weights = np.stack([p.style.in_play() for p in players])
        weights[:, PLACE] *= [p.urgency for p in players]
        goals = [
            np.zeros((1, 2)) if p.goal is None else np.reshape(p.goal, (-1, 2)) for p in players
        ]
        goal = np.zeros((2, max(len(g) for g in goals), 2))
        asked = np.stack([self.asked(p) for p in players])
        for p, player in enumerate(players):
            goal[p, : len(goals[p])] = goals[p]
            goal[p, len(goals[p]) :] = goals[p][-1]
            if player.goal is None:
                weights[p, PLACE] = 0.0
            if not asked[p].any():
                weights[p, REQUIREMENT] = 0.0
        return kernels.Game(
            *self.moves,
            *rules,
            weights,
            self.suits,
            asked,
            goal,
            float(now),
            GOAL_EVERY * fps,
            others.track,
            others.side,
            others.wants,
            self.response,
            self._tired(players[0], recent),
        )

    def _tired(self, player: Player, recent: tuple[int, ...]) -> np.ndarray:
        """What each stretch [L] costs the searcher: if it was among its recent choices, or many of
        its kind; and if it is not in its action set.

        An attack rests whoever has waited as far as its style cares for it: hooks an infighter.
        """
        out, lately, kinds = np.zeros(len(self.kinds)), list(recent), self.kind_number
        np.add.at(out, lately, player.boredom)
        like = np.bincount(kinds[lately], minlength=int(kinds.max()) + 1)[kinds].astype(float)
        attack, calm = self.moves.kind == kernels.ATTACK, np.isin(self.kinds, CALM)
        if attack.any() and calm.any():
            style = player.style
            given = np.where(self.moves.short, style.given_short, style.given_long)
            share = given / max(style.given_short, style.given_long, 1e-9)
            waited = like[calm][0]
            like[attack] += (1.0 - share[attack]) * max(waited - like[attack][0], 0.0)
        return out + player.restlessness * like + OUTSIDE * ~self.allowed(player)

    def decide(
        self,
        state: np.ndarray,
        players: tuple[Player, Player],
        recent: tuple[int, ...] = (),
        others: Others = NOBODY_ELSE,
        *,
        bounds: bool = True,
    ) -> Decision:
        """What the searcher, the first of players, does next in a state (:meth:`state`).

        recent: stretches it used lately, which cost it (B11). It looks as deep as the searcher's
        depth says. Where nobody minds check points or wanted actions all of coop is 0, and the
        search skips what cannot change the choice (``bounds``); nodes are those looked at.
        """
        begin = time.perf_counter()
        now = min(state[kernels.END], state[kernels.FIELDS + kernels.END])
        game = self.game(players, recent, now, others)
        bounds = bounds and not np.any(game.weights[:, COOPERATIVE])
        run = SEARCH.serial if bounds or players[0].depth < 3 else SEARCH.parallel
        found = run(game, state, players[0].depth, self.most, bounds)
        best = found.best
        action, comp = int(found.action[best]), float(found.comp[best])
        flaws = int(fight.flaws_of(game, state, action))
        return Decision(
            action,
            comp + OUTSIDE * round(-comp / OUTSIDE),  # without what it cost to leave the set
            float(found.coop[best]),
            found.nodes,
            found.considered,
            time.perf_counter() - begin,
            not self.allowed(players[0])[action],
            tuple(name for flaw, name in FLAWS.items() if flaws & flaw),
        )


def _ranks(library: Layer) -> np.ndarray:
    """The place in time [X] of each blow of a library."""
    out = np.empty(len(library.strikes), dtype=np.int64)
    out[np.argsort(library.strikes.frame, kind="stable")] = np.arange(len(out))
    return out


def _moves(library: Layer) -> kernels.Moves:
    """The stretches as the kernels take them."""
    table, clips = library.table, library.clips
    body = lay_body(clips.skeleton)
    position, world = clips.world
    facing = clips.facing
    duration = table.duration
    start = np.concatenate([[0], np.cumsum(duration + 1)]).astype(np.int64)
    owner = np.repeat(np.arange(len(duration)), duration + 1)
    local = np.arange(start[-1]) - start[owner]
    frame = table.first[owner] - 1 + local
    home = planar_inverse(facing[table.first - 1])[owner]
    track = planar_compose(home, facing[frame])
    middle = []
    for part in (*TRUNK, *ARMS):
        b = body.part(part)
        j = int(body.joint[b])
        at = position[:, j] + rotate(world[:, j], 0.5 * (body.start[b] + body.end[b]))
        middle.append(planar_apply(home, at[frame]))
    spheres = np.stack(middle, axis=1)  # [R, B, 3]
    parts = [body.part(p) for p in (*TRUNK, *ARMS)]
    radius = STOUTER * np.maximum(body.radius_start[parts], body.radius_end[parts])
    bulk = radius[: len(TRUNK)] + BULK
    places = spheres.astype(np.float32)  # what the kernels have
    ground = places[..., [0, 2]].astype(float)
    trunk = _circles(ground[:, : len(TRUNK)], bulk, np.arange(len(track)))
    hull = _circles(ground, radius, start[:-1])
    ring = _circles(ground, radius, np.arange(len(track)))
    end = track[start[1:] - 1, 2]
    windows = blow_windows(library)
    row, limb = np.nonzero((windows[frame] != NO_BLOW) & (local > 0)[:, None])
    tips = np.moveaxis(library.strikes.tip, 1, 0)  # [4, F, 3] in each frame's facing frame

    def placed(f: np.ndarray) -> np.ndarray:
        return planar_apply(planar_compose(home[row], facing[f]), tips[limb, f])

    now, before = placed(frame[row]), placed(frame[row] - 1)
    reach = np.zeros((len(duration), 3))
    striking, first = np.unique(owner[row], return_index=True)
    ways = np.stack([now, before], axis=1)[..., [0, 2]]
    reach[striking] = _circles(ways, np.zeros(2), first)
    way = np.linalg.norm(now - before, axis=1)
    last_tip = np.full(len(duration), NOTHING)
    np.maximum.at(last_tip, owner[row], local[row])
    actions, action = library.actions, library.action_of_stretch
    assert actions is not None
    kind = np.full(len(duration), kernels.OTHER)
    for name, code in (("attack", kernels.ATTACK), ("defence", kernels.DEFENCE)):
        kind[actions.kind[action] == KINDS.index(name)] = code
    kind[actions.kind[action] == KINDS.index("idle")] = kernels.IDLE
    return kernels.Moves(
        table.action_start.astype(np.int64),
        table.stretch.astype(np.int64),
        table.target.astype(np.int64),
        duration.astype(np.int64),
        kind.astype(np.int64),
        short_range(actions)[action],
        start,
        np.ascontiguousarray(track),
        np.stack([np.sin(end), np.cos(end)], axis=1),
        trunk,
        np.ascontiguousarray(places.swapaxes(1, 2)),
        radius,
        bulk,
        hull,
        ring,
        np.searchsorted(owner[row], np.arange(len(duration) + 1)).astype(np.int64),
        local[row].astype(np.int64),
        np.ascontiguousarray(now),
        np.ascontiguousarray(before),
        way + SLACK,
        way * clips.fps,
        _ranks(library)[windows[frame[row], limb]],
        last_tip.astype(np.int64),
        reach,
        *halts(
            table.action_start,
            table.stretch,
            table.target,
            start,
            track,
            max(1, round(clips.fps * HALT_EVERY)),
        ),
    )


def halts(
    first: np.ndarray,
    ways: np.ndarray,
    target: np.ndarray,
    start: np.ndarray,
    track: np.ndarray,
    stride: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ways to come to rest from each state [N + 1], where their places begin [W + 1], and those
    [Q, 2], seen from the state. A state offers stretches ``ways`` [A] from its ``first`` [N + 1]
    on, which lead into ``target`` [L] along rows of ``track`` [R, 3] from ``start`` [L + 1] on.

    At rest is who can go on with stretches that go nowhere: a way without places. From any other
    state the few that take least room, each a stretch and then a way from where it leads: what is
    left of a way is a way again. A state from which nobody comes to rest has none.
    """
    room = np.maximum.reduceat(np.linalg.norm(track[:, :2], axis=1), start[:-1])
    stays = room[ways] <= GOES_NOWHERE
    owner = np.repeat(np.arange(len(first) - 1), np.diff(first))
    rests = np.ones(len(first) - 1, dtype=bool)
    while True:
        found = np.zeros_like(rests)
        found[owner[stays & rests[target[ways]]]] = True
        found &= rests
        if np.array_equal(found, rests):
            break
        rests = found
    out: list[list[np.ndarray]] = [[np.zeros((0, 3))] if r else [] for r in rests.tolist()]
    while True:
        more: dict[int, list[np.ndarray]] = {}
        for state in [n for n, known in enumerate(out) if not known]:
            for k in ways[first[state] : first[state + 1]].tolist():
                known = out[int(target[k])]
                if not known:
                    continue
                rows = np.arange(int(start[k + 1]) - 1, int(start[k]), -stride)[::-1]
                more.setdefault(state, []).extend(
                    np.concatenate([track[rows], planar_compose(track[rows[-1]], way)])
                    for way in known
                )
        if not more:
            break
        for state, found_ways in more.items():
            far = [float(np.linalg.norm(way[:, :2], axis=1).max()) for way in found_ways]
            out[state] = [found_ways[i] for i in np.argsort(far, kind="stable")[:MOST_HALTS]]
    flat = [way for of in out for way in of]
    places = np.concatenate([np.zeros((0, 3)), *flat])
    return (
        np.cumsum([0, *(len(of) for of in out)]),
        np.cumsum([0, *(len(way) for way in flat)]),
        np.ascontiguousarray(places[:, :2]),
    )


def _circles(points: np.ndarray, rim: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Circles [G, 3] on the ground that hold discs [R, n, 2] with radii ``rim`` [n]; the rows of
    the g-th begin with ``first[g]``."""
    low = np.minimum.reduceat((points - rim[:, None]).min(axis=1), first)
    high = np.maximum.reduceat((points + rim[:, None]).max(axis=1), first)
    middle = 0.5 * (low + high)
    count = np.diff(np.append(first, len(points)))
    off = np.linalg.norm(points - np.repeat(middle, count, axis=0)[:, None], axis=-1) + rim
    radius = np.maximum.reduceat(off.max(axis=1), first) + SLACK
    return np.column_stack([middle, radius])
