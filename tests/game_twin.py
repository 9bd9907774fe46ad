"""A slow, obvious twin of the fight (Shum et al. 2012, V and VI), and toys to compare it on.

The fight goes on frame by frame, all in scene coordinates, by objects. Nothing is shared with
kumite.kernels.game but its tuples, which :meth:`Toy.game` fills.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from kumite.control.styles import Style
from kumite.kernels import moves as kernels
from kumite.kernels.moves import ATTACK, DEFENCE, HEAD, NOTHING, SIZES, TRUNK
from kumite.kernels.style import PLACE
from kumite.rotation import planar_apply, planar_compose, wrap_angle
from tests.reference import Edge

SPHERES = 8


class Tip(NamedTuple):
    when: int  # frames since the beginning
    at: tuple[float, float, float]
    before: tuple[float, float, float]  # a frame earlier
    speed: float
    blow: int


@dataclass
class Move:
    """A stretch."""

    track: np.ndarray  # [T + 1, 3]
    body: np.ndarray  # [T + 1, B, 3]
    into: int = 0
    kind: int = kernels.OTHER
    short: bool = False
    tips: list[Tip] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.body = np.asarray(self.body, np.float32)

    @property
    def duration(self) -> int:
        return len(self.track) - 1

    @property
    def last_tip(self) -> int | None:
        return max((tip.when for tip in self.tips), default=None)


@dataclass
class Side:
    style: Style = field(default_factory=Style)
    asked: dict[int, int] = field(default_factory=dict)
    goal: tuple[float, float] | None = None


class Fighter(NamedTuple):
    move: int
    begun: int
    end: int
    anchor: np.ndarray  # [3] where the move began
    landed: int = NOTHING  # the last blow that met something


class Moment(NamedTuple):
    fighters: tuple[Fighter, Fighter]


@dataclass
class Toy:
    moves: list[Move]
    choices: list[list[int]]  # of each state
    radius: np.ndarray = field(default_factory=lambda: np.full(SPHERES, 0.12))
    sides: tuple[Side, Side] = field(default_factory=lambda: (Side(), Side()))
    suits: np.ndarray | None = None
    response: list[list[int]] = field(default_factory=lambda: [[NOTHING] * SIZES] * 2)
    tired: dict[int, float] = field(default_factory=dict)
    third: np.ndarray = field(default_factory=lambda: np.zeros((0, 1, 2)))
    third_side: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    third_wants: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    stride: int = 3
    facing: float = math.radians(60)
    attack_range: float = 1.0
    defence_range: float = 3.0
    tip_radius: float = 0.03
    catch: float = 0.0
    arena: float = 0.0
    halts: list[list[list[tuple[float, float]]]] | None = None  # of each state; None: all rest
    stagger_from: float = 5.2
    fall_from: float = 10.0

    def vulnerable(self, part: int) -> float:
        return 2.0 if part == HEAD else 1.0 if part < TRUNK else 0.0

    # As the kernel takes it ----------------------------------------------------------------------

    def game(self) -> kernels.Game:
        moves = self.moves
        tips = [tip for move in moves for tip in move.tips]
        ways = [way for of in self.ways_to_rest for way in of]
        hull, trunk, ring, reach = zip(*(self.bounds(m) for m in moves))
        end = np.array([m.track[-1, 2] for m in moves])
        weights = np.stack([side.style.as_array() for side in self.sides])
        asked, goal = np.zeros((2, len(moves))), np.zeros((2, 1, 2))
        for p, side in enumerate(self.sides):
            for move, sign in side.asked.items():
                asked[p, move] = sign
            if side.goal is None:
                weights[p, PLACE] = 0.0
            else:
                goal[p] = side.goal
        tired = np.zeros(len(moves))
        for move, cost in self.tired.items():
            tired[move] = cost
        suits = np.zeros((len(moves),) * 2) if self.suits is None else self.suits
        last = [NOTHING if m.last_tip is None else m.last_tip for m in moves]
        return kernels.Game(
            np.concatenate([[0], np.cumsum([len(c) for c in self.choices])]).astype(np.int64),
            np.array([move for choice in self.choices for move in choice], np.int64),
            np.array([m.into for m in moves], np.int64),
            np.array([m.duration for m in moves], np.int64),
            np.array([m.kind for m in moves], np.int64),
            np.array([m.short for m in moves]),
            np.concatenate([[0], np.cumsum([m.duration + 1 for m in moves])]).astype(np.int64),
            np.concatenate([m.track for m in moves]).astype(float),
            np.stack([np.sin(end), np.cos(end)], axis=1),
            np.concatenate(trunk),
            np.concatenate([m.body for m in moves]).swapaxes(1, 2).copy(),
            self.radius,
            self.radius[:4],
            np.array(hull, float),
            np.concatenate(ring),
            np.concatenate([[0], np.cumsum([len(m.tips) for m in moves])]).astype(np.int64),
            np.array([tip.when for tip in tips], np.int64),
            np.array([tip.at for tip in tips], float).reshape(-1, 3),
            np.array([tip.before for tip in tips], float).reshape(-1, 3),
            np.array([math.dist(tip.at, tip.before) + 1e-6 for tip in tips], float),
            np.array([tip.speed for tip in tips], float),
            np.array([tip.blow for tip in tips], np.int64),
            np.array(last, np.int64),
            np.array(reach, float),
            np.cumsum([0, *(len(of) for of in self.ways_to_rest)]),
            np.cumsum([0, *(len(way) for way in ways)]),
            np.array([place for way in ways for place in way], float).reshape(-1, 2),
            self.stride,
            np.full(2, self.facing),
            self.attack_range,
            self.defence_range,
            self.tip_radius,
            self.catch,
            self.arena,
            self.stagger_from,
            self.fall_from,
            np.array([self.vulnerable(b) for b in range(SPHERES)]),
            weights,
            suits.astype(np.float32),
            asked,
            goal,
            0.0,
            1.0,
            self.third,
            self.third_side,
            self.third_wants,
            np.array(self.response, np.int64),
            tired,
        )

    def bounds(self, move: Move):
        """Circles about the body and, row by row, the trunk and the body; one about the tips."""
        ground = move.body[..., ::2].astype(float)
        far = np.linalg.norm(ground, axis=-1) + self.radius
        off = np.linalg.norm(ground - move.track[:, None, :2], axis=-1) + self.radius
        wide = off[:, :TRUNK].max(axis=1)
        trunk = np.column_stack([move.track[:, :2], wide + 1e-6])
        tips = [math.hypot(at[0], at[2]) for tip in move.tips for at in (tip.at, tip.before)]
        return (
            (0, 0, far.max() + 1e-6),
            trunk,
            np.column_stack([move.track[:, :2], off.max(axis=1) + 1e-6]),
            (0, 0, max(tips, default=0.0) + 1e-6),
        )

    @property
    def ways_to_rest(self) -> list[list[list[tuple[float, float]]]]:
        return [[[]]] * len(self.choices) if self.halts is None else self.halts

    @property
    def most(self) -> int:
        return max(len(choice) for choice in self.choices)

    # The fight -----------------------------------------------------------------------------------

    def place(self, fighter: Fighter, time: int) -> np.ndarray:
        """The facing frame in the scene; who has ended stands."""
        move = self.moves[fighter.move]
        frame = min(max(time - fighter.begun, 0), move.duration)
        return planar_compose(fighter.anchor, move.track[frame])

    def spheres(self, fighter: Fighter, time: int) -> np.ndarray:
        move = self.moves[fighter.move]
        frame = min(max(time - fighter.begun, 0), move.duration)
        return planar_apply(fighter.anchor, move.body[frame].astype(float))

    def meets(self, attacker: Fighter, victim: Fighter, time: int) -> tuple[Tip, int] | None:
        """The first tip of this frame that meets a sphere on its way, and which it meets first."""
        centres = self.spheres(victim, time)
        for tip in self.moves[attacker.move].tips:
            if tip.when != time - attacker.begun or tip.blow <= attacker.landed:
                continue
            a, b = planar_apply(attacker.anchor, np.array([tip.before, tip.at]))
            entries = []
            for s in range(SPHERES):
                entry = entering(a, b, centres[s], float(self.radius[s]) + self.tip_radius)
                if entry is not None:
                    entries.append((entry, s))
            if entries:
                return tip, min(entries)[1]
        return None

    def play(self, fighters, since: int, both: bool):
        """Frame by frame until one ends, or both: (fighters, what each dealt, weighted by w⁺, and
        D, coop of reactions, whether the two came within a catch)."""
        fighters, time = list(fighters), since
        score, dealt, coop, caught = [0.0, 0.0], [0.0, 0.0], 0.0, False
        while True:
            ends = [f.end for f in fighters]
            time += 1
            if time > (max(ends) if both else min(ends)):
                return tuple(fighters), score, dealt, coop, caught
            if (time - since - 1) % self.stride == 0:
                a, b = (self.place(f, time) for f in fighters)
                caught |= math.dist(a[:2], b[:2]) < self.catch
            met = [self.meets(fighters[p], fighters[1 - p], time) for p in range(2)]
            seen = list(fighters)
            for p in range(2):
                hit = met[p]
                if hit is None:
                    continue
                tip, part = hit
                if fighters[p] is seen[p]:
                    fighters[p] = fighters[p]._replace(landed=tip.blow)
                damage = tip.speed * self.vulnerable(part)
                move, style = self.moves[seen[p].move], self.sides[p].style
                dealt[p] += damage
                score[p] += damage * (style.given_short if move.short else style.given_long)
                if damage == 0:
                    continue
                size = (tip.speed >= self.stagger_from) + (tip.speed >= self.fall_from)
                victim = self.sides[1 - p]
                responses = self.response[1 if part == HEAD else 0]
                falls = responses[-1] != NOTHING and victim.asked.get(responses[-1], 0) > 0
                reaction = responses[-1 if falls else size]
                if reaction != NOTHING:
                    coop += victim.asked.get(reaction, 0) * victim.style.requirement
                    fighters[1 - p] = self.begin(reaction, time, self.place(seen[1 - p], time))

    def begin(self, move: int, time: int, anchor: np.ndarray) -> Fighter:
        return Fighter(move, time, time + self.moves[move].duration, anchor)

    def flaws(self, me: Fighter, other: Fighter, move: int, time: int) -> list[bool]:
        """What an action does wrong: it leaves the arena; it runs out of it; then of section V-C in
        its order, the first of the last frame alone, the second of all frames looked at."""
        mine = self.begin(move, time, self.place(me, time))
        looked = sorted({*range(self.stride, mine.end - time, self.stride), mine.end - time})

        def overlap(t: int) -> bool:
            a, b = self.spheres(mine, t), self.spheres(other, t)
            return any(
                np.linalg.norm(a[i] - b[j]) < self.radius[i] + self.radius[j]
                for i in range(TRUNK)
                for j in range(TRUNK)
            )

        def apart(t: int) -> float:
            return math.dist(self.place(mine, t)[:2], self.place(other, t)[:2])

        x, z, yaw = self.place(mine, mine.end)
        u, w, _ = self.place(other, mine.end)
        off = abs(wrap_angle(math.atan2(u - x, w - z) - yaw))
        kind, opposing = self.moves[move].kind, self.moves[other.move]
        reach = {ATTACK: self.attack_range, DEFENCE: self.defence_range}.get(kind, math.inf)
        attacked = (
            opposing.kind == ATTACK
            and opposing.last_tip is not None
            and other.begun + opposing.last_tip >= time
        )
        leaves, runs_out = self.out_of_the_arena(mine)
        return [
            leaves,
            runs_out,
            overlap(mine.end),
            any(overlap(time + t) for t in looked),
            bool(off > self.facing),
            min(apart(time + t) for t in [0, *looked]) > reach,
            kind == DEFENCE and not attacked,
        ]

    def out_of_the_arena(self, mine: Fighter) -> tuple[bool, bool]:
        """Whether an action leaves the arena; or ends so that nobody comes to rest in it."""
        if self.arena == 0.0:
            return False, False

        def beyond(x: float, z: float) -> float:
            return max(math.hypot(x, z) - self.arena, 0.0)

        looked = range(mine.end, mine.begun, -self.stride)
        farthest = max(beyond(*self.place(mine, t)[:2]) for t in looked)
        if farthest > beyond(*mine.anchor[:2]) + 1e-9:
            return True, False
        end = self.place(mine, mine.end)
        for way in self.ways_to_rest[self.moves[mine.move].into]:
            places = [planar_apply(end, np.array([x, 0.0, z])) for x, z in way]
            if not any(beyond(p[0], p[2]) for p in places):
                return False, False
        return False, True

    def kept(self, flaws: list[list[bool]]) -> list[int]:
        """Those that do nothing wrong; else those that pass the more important rules."""
        left = list(range(len(flaws)))
        for edge in (0, 1):  # of the arena; where none can keep to it all else counts as ever
            left = [n for n in left if not flaws[n][edge]] or left
        # Penetration: "if none of the actions can avoid such penetrations, ... at the last frame".
        inside = 3 if any(not flaws[n][3] for n in left) else 2
        ordered = {n: [flaws[n][inside], *flaws[n][4:]] for n in left}
        for rules in (4, 3, 2, 1):
            passing = [n for n, f in ordered.items() if not any(f[:rules])]
            if passing:
                return passing
        return left

    # As tests.reference.game_tree plays it -------------------------------------------------------

    def player(self, state: Moment) -> int:
        return 0 if state.fighters[0].end <= state.fighters[1].end else 1

    def offered(self, state: Moment) -> list[int]:
        return self.choices[self.moves[state.fighters[self.player(state)].move].into]

    def considered(self, state: Moment) -> int:
        return len(self.offered(state))

    def edges(self, state: Moment) -> list[Edge]:
        p, offered = self.player(state), self.offered(state)
        me, other = state.fighters[p], state.fighters[1 - p]
        time, side = me.end, self.sides[p]
        style = side.style
        edges = []
        for n in self.kept([self.flaws(me, other, k, time) for k in offered]):
            k = offered[n]
            both = [me, other]
            both[p], both[1 - p] = self.begin(k, time, self.place(me, time)), other
            after, score, dealt, reacted, caught = self.play(both, time, False)
            comp, coop = self.standing(p, after, after[p].end)
            coop += reacted - self.standing(p, state.fighters, time)[1]
            comp += score[p] - style.taken * dealt[1 - p]  # Eq. 5
            if caught:
                comp += style.given_short - style.taken
            if self.suits is not None:
                comp += style.suitability * float(np.float32(self.suits[k, other.move]))  # Eq. 7
            if p == 0:
                comp -= self.tired.get(k, 0.0)
            if self.arena:
                mine = both[p]
                comp -= 1e6 * max(math.hypot(*self.place(mine, mine.end)[:2]) - self.arena, 0.0)
            coop += side.asked.get(k, 0) * style.requirement  # Eq. 10
            edges.append(Edge(k, comp if p == 0 else -comp, coop, Moment(after)))
        return edges

    def standing(self, p: int, fighters: Sequence[Fighter], time: int) -> tuple[float, float]:
        """Eq. 4, with what others make of it, and Eq. 9."""
        side = self.sides[p]
        style = side.style
        x, z, yaw = self.place(fighters[p], time)
        u, w, _ = self.place(fighters[1 - p], time)
        theta = float(wrap_angle(math.atan2(u - x, w - z) - yaw - style.preferred_facing))
        r = math.dist((x, z), (u, w))
        comp = -style.facing * theta**2 - style.distance * (r - style.preferred_distance) ** 2
        for at, after_whom, wants in zip(self.third, self.third_side, self.third_wants):
            far = math.dist((x, z), at[int(min(max(time + 0.5, 0), len(at) - 1))])
            if after_whom == 1 - p:
                comp += wants[0] * (far - wants[1]) ** 2
                comp -= style.distance * (far - style.preferred_distance) ** 2
                if far < self.catch:
                    comp -= style.taken + wants[2]
            comp -= 1e4 * max(1.0 - far / 0.8, 0.0)
        coop = 0.0
        if side.goal is not None:
            coop -= style.place * math.dist((x, z), side.goal) ** 2
        if style.heading:
            assert style.preferred_heading is not None
            coop -= style.heading * float(wrap_angle(yaw - style.preferred_heading)) ** 2
        return comp, coop

    def leaf(self, state: Moment) -> tuple[float, float]:
        since = min(f.end for f in state.fighters)
        _, score, dealt, coop, _ = self.play(state.fighters, since, True)
        return score[0] - self.sides[0].style.taken * dealt[1], coop


def entering(a, b, centre, radius: float) -> float | None:
    """When the line from a (0) to b (1) enters a sphere, if the way between meets it."""
    way = b - a
    length2 = float(way @ way)
    nearest = a + np.clip((centre - a) @ way / max(length2, 1e-12), 0, 1) * way
    if np.linalg.norm(centre - nearest) >= radius:
        return None
    # |a + t way - centre|² = radius², the smaller t
    half, rest = float((a - centre) @ way), float((a - centre) @ (a - centre)) - radius**2
    return (-half - math.sqrt(max(half**2 - length2 * rest, 0.0))) / max(length2, 1e-12)


def as_state(now: Moment) -> np.ndarray:
    out = np.zeros(kernels.STATE)
    for p, f in enumerate(now.fighters):
        out[p * kernels.FIELDS : (p + 1) * kernels.FIELDS] = [
            f.move,
            f.begun,
            f.end,
            *f.anchor,
            f.landed,
        ]
    return out


# Toys to compare on -------------------------------------------------------------------------------

#  m, of who looks along z: head, chest, waist, pelvis; left forearm, hand; right forearm, hand
STANCE = np.array(
    [
        [0, 1.6, 0],
        [0, 1.35, 0],
        [0, 1.1, 0],
        [0, 0.95, 0],
        [0.3, 1.0, 0],
        [0.3, 0.8, 0],
        [-0.3, 1.0, 0],
        [-0.3, 0.8, 0],
    ]
)


def still(frames: int, **more) -> Move:
    """A move that stands where it is."""
    return Move(np.zeros((frames + 1, 3)), np.tile(STANCE, (frames + 1, 1, 1)), **more)


def walk(frames: int, by: tuple[float, float, float], **more) -> Move:
    """A move to a planar frame, evenly."""
    track = np.linspace((0.0, 0.0, 0.0), by, frames + 1)
    body = np.stack([planar_apply(t, STANCE) for t in track])
    return Move(track, body, **more)


def standing(move: int, end: int, at: tuple[float, float, float], toy: Toy) -> Fighter:
    """Who has done, or does, a move that ends then; at: where it began."""
    return Fighter(move, end - toy.moves[move].duration, end, np.array(at, float))


def random_toy(seed: int, brawl: bool) -> tuple[Toy, Moment]:
    """Two that are near each other; brawl: all at arm's length, with many blows."""
    rng = np.random.default_rng(seed)
    states, reactions = 2, 2
    total = int(rng.integers(5, 9)) + reactions
    moves: list[Move] = []
    for n in range(total):
        frames = int(rng.integers(2, 13))
        kind = int(rng.integers(0, 4)) if n < total - reactions else kernels.OTHER
        if brawl and n < total - reactions and rng.random() < 0.5:
            kind = ATTACK
        step = rng.normal(0, 0.02 if brawl else 0.06, (frames, 3)) * [1, 1, 2]
        track = np.concatenate([np.zeros((1, 3)), np.cumsum(step, axis=0)])
        arms = STANCE + rng.normal(0, 0.02, STANCE.shape)
        arms[TRUNK:] = rng.uniform([-0.4, 0.8, -0.1], [0.4, 1.6, 0.5], (SPHERES - TRUNK, 3))
        body = np.stack([planar_apply(t, arms) for t in track])
        tips = []
        if kind == ATTACK or rng.random() < 0.1:
            for blow in range(int(rng.integers(1, 4))):
                for when in np.sort(rng.integers(1, frames + 1, 2)):
                    at = rng.uniform([-0.2, 0.8, 0.3], [0.2, 1.75, 1.1])
                    before = at - rng.uniform([-0.1, -0.1, 0.0], [0.1, 0.1, 0.5])
                    speed = float(rng.uniform(2, 12))
                    tips.append(Tip(int(when), tuple(at), tuple(before), speed, blow))
            tips.sort(key=lambda tip: tip.when)
        moves.append(
            Move(track, body, int(rng.integers(0, states)), kind, bool(rng.random() < 0.5), tips)
        )
    offered = np.arange(total - reactions)
    choices = [list(offered[:3]), [int(k) for k in offered if rng.random() < 0.6] or [0]]
    styles = []
    for _ in range(2):
        w = rng.uniform(0, 20, 9)
        heading = float(rng.uniform(-3, 3))
        styles.append(
            Style(
                w[0],
                w[1],
                w[2] / 20,
                w[3] / 10,
                w[4],
                w[5],
                w[6],
                w[7],
                w[8] / 10,
                1.0,
                5.0,
                heading,
            )
        )
    sides = tuple(
        Side(
            style,
            {int(k): int(rng.integers(-1, 2)) for k in range(total)},
            tuple(rng.normal(size=2)) if rng.random() < 0.5 else None,
        )
        for style in styles
    )
    some = [NOTHING, total - 2, total - 1]
    toy = Toy(
        moves,
        [[int(k) for k in c] for c in choices],
        radius=rng.uniform(0.08, 0.16, SPHERES),
        sides=(sides[0], sides[1]),
        suits=rng.normal(size=(total, total)),
        response=[[int(some[i]) for i in rng.integers(0, 3, SIZES)] for _ in range(2)],
        tired={int(offered[0]): 3.0},
        stride=int(rng.integers(1, 4)),
        catch=float(rng.choice([0.0, 0.7])),
    )
    others = int(rng.integers(0, 3)) if rng.random() < 0.5 else 0
    toy.third = rng.normal(0, 1.0, (others, 5, 2))
    toy.third_side = rng.integers(-1, 2, others)
    toy.third_wants = rng.uniform(0, 3, (others, 3))
    far = rng.uniform(0.4, 0.9) if brawl else rng.uniform(0.3, 1.6)
    yaw = rng.uniform(-3, 3)
    own = np.array([*rng.normal(size=2), yaw])
    other = planar_compose(own, [rng.normal(0, 0.1), far, math.pi + rng.normal(0, 0.3)])
    first, second = (int(k) for k in rng.integers(0, total, 2))
    ends = int(rng.integers(0, moves[second].duration))
    here = Moment(
        (
            standing(first, 0, (0, 0, 0), toy)._replace(anchor=own),
            standing(second, ends, (0, 0, 0), toy)._replace(anchor=other),
        )
    )
    return toy, here


def fenced(toy: Toy, now: Moment, seed: int) -> None:
    """Put an arena about the middle, so that some actions lead out of it."""
    rng = np.random.default_rng(seed)
    far = max(math.hypot(*toy.place(f, f.end)[:2]) for f in now.fighters)
    toy.arena = max(far + rng.normal(0, 0.2), 0.1)
    toy.halts = [
        [[tuple(rng.normal(0, 0.2, 2)) for _ in range(rng.integers(0, 3))] for _ in range(ways)]
        for ways in rng.integers(0, 3, len(toy.choices))
    ]


def turned(now: Moment, toy: Toy, by: tuple[float, float, float]) -> Moment:
    """The same moment elsewhere in the scene."""
    one, two = (f._replace(anchor=planar_compose(by, f.anchor)) for f in now.fighters)
    return Moment((one, two))
