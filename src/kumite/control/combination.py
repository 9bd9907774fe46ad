"""The action combination table: which action suits which action of the opponent (B7).

    S = matched / defence                                       (Shum et al. 2012, section VIII-A)

Every attack is annotated with the positions that it hits and the directions that it comes from,
every defence with the positions that it protects and the directions that it does so against.
*matched* counts the elements that both have, *defence* those that the defence has, positions and
directions together: a defence is worth most where it is effective and meant for just that. Pairs
that are not a defence against an attack have 0, until a person says otherwise.

**Attacks.** Positions: the bands of a standing body that the effective hitting points pass where
the limb is nearly as far out as it gets; a combination has those of all its blows. Directions:
straights and thrusts come from the front, hooks horizontally, uppercuts upwards; kicks and slashes
the way the tip goes meanwhile, against the line from the chest to the tip. (The facing frame would
not do: a boxer's hips may be turned from the opponent by a quarter circle.)

**Defences.** Directions and what may be protected are known of each way; what is, is measured:

=========  ==============================  ===================  ======================
way        may protect                     where it             against
=========  ==============================  ===================  ======================
duck       head, upper torso               goes down            front, horizontal
slip       head, upper torso               goes along the floor front
sway       head, upper torso               goes along the floor horizontal, upwards
jump back  upper torso, lower torso        goes along the floor horizontal, upwards
block      head, upper torso, lower torso  is behind the arm    front, horizontal
=========  ==============================  ===================  ======================

A part has gone where it is further from its place than :data:`GONE`. In a duck the lower torso
has not: what is above comes down there. A jump back keeps the head in reach of a lunging fist, so
the paper does not count it. A defence too small to protect anything has the first of its row.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from kumite.annotate import DIRECTIONS, KINDS, NO_LIMB, Actions
from kumite.annotate.contacts import velocity
from kumite.annotate.kinds import OUTWARD, UPWARD, strike_directions
from kumite.brief import brief
from kumite.checked import checked
from kumite.checks import freeze
from kumite.clip import LIMBS, ClipSet, tip_positions
from kumite.errors import KumiteError, unknown
from kumite.graph import Layer

POSITIONS = ("head", "upper torso", "lower torso")
HIT_DIRECTIONS = ("front", "horizontal", "upwards")
HEAD, UPPER, LOWER = range(3)
FRONT, HORIZONTAL, UPWARDS = range(3)

OUT = 0.9  # of a blow's farthest reach: nearer to the body it is still under way
MARGIN = 0.05  # m, half a fist: so far beyond its middle it hits, too
CHIN = 0.05  # of the height from pelvis to head joint, that the chin is below the head joint
GONE = np.array([0.12, 0.2, 0.2])  # m: half of a head, or of a trunk, and half a fist
FAST = 0.75  # of a limb's highest speed: the blow of an attack in which none was found

_DIRECTION_OF = {"straight": FRONT, "thrust": FRONT, "hook": HORIZONTAL, "uppercut": UPWARDS}
_PROTECTS = {
    "duck": ((HEAD, UPPER), (FRONT, HORIZONTAL)),
    "slip": ((HEAD, UPPER), (FRONT,)),
    "sway": ((HEAD, UPPER), (HORIZONTAL, UPWARDS)),
    "jump back": ((UPPER, LOWER), (HORIZONTAL, UPWARDS)),
    "block": ((HEAD, UPPER, LOWER), (FRONT, HORIZONTAL)),
}
AT = "@"  # between the label and the place of one action: "jab@left_jabs:41"
ANNOTATED = ("attack", "defence")


@checked
@brief
@dataclass(frozen=True)
class Annotations:
    """What attacks hit and from where, what defences protect and against what; else nothing."""

    positions: np.ndarray  # [A, 3] bool, of POSITIONS
    directions: np.ndarray  # [A, 3] bool, of HIT_DIRECTIONS

    def __post_init__(self) -> None:
        count = len(self.positions)
        freeze(
            self,
            "annotations",
            positions=(np.bool_, (count, len(POSITIONS))),
            directions=(np.bool_, (count, len(HIT_DIRECTIONS))),
        )


def suitability(defences: Annotations, attacks: Annotations) -> np.ndarray:
    """S [D, A] of every defence against every attack; 0 for a defence that protects nothing."""
    defence, attack = (
        np.concatenate([x.positions, x.directions], axis=1).astype(float)
        for x in (defences, attacks)
    )
    elements = defence.sum(axis=1, keepdims=True)
    return defence @ attack.T / np.maximum(elements, 1.0)


# From the motion ---------------------------------------------------------------------------------


@checked
def annotate_actions(library: Layer, actions: Actions) -> Annotations:
    """What each action [A] of a library's clips hits or protects, told from its motion.

    Errors: actions of other clips; a role that is missing.
    """
    clips = library.clips
    if not np.array_equal(actions.clip_start, clips.clip_start):
        raise KumiteError("combination: these actions are of other clips than the library's")
    body = _Body.of(clips)
    ways = strike_directions(clips, library.strikes)
    positions = np.zeros((len(actions), len(POSITIONS)), dtype=bool)
    directions = np.zeros((len(actions), len(HIT_DIRECTIONS)), dtype=bool)
    for k in range(len(actions)):
        kind, way = KINDS[actions.kind[k]], DIRECTIONS[actions.direction[k]]
        frames = slice(int(actions.start[k]), int(actions.stop[k]))
        if kind == "attack":
            blows = _blows(body, library, ways, actions, k)
            for limb, hit, its_way in blows:
                positions[k, _hit(body, limb, hit)] = True
                directions[k, _from(body, limb, hit, its_way)] = True
        elif kind == "defence":
            possible, against = _PROTECTS[way]
            found = _covered(body, frames) if way == "block" else _left(body, frames, way)
            positions[k, [p for p in possible if found[p]] or possible[:1]] = True
            directions[k, list(against)] = True
    return Annotations(positions, directions)


@dataclass(frozen=True)
class _Body:
    """Where the body is, in all frames."""

    head: np.ndarray  # [F, 3] m
    chest: np.ndarray  # [F, 3]
    pelvis: np.ndarray  # [F, 3]
    elbow: np.ndarray  # [F, 2, 3], left and right
    tip: np.ndarray  # [F, 4, 3], of the limbs
    velocity: np.ndarray  # [F, 4, 3] m/s of the tips
    borders: np.ndarray  # [2] m: below the first is the lower torso, above the second the head

    @staticmethod
    def of(clips: ClipSet) -> _Body:
        position, world = clips.world
        skeleton = clips.skeleton
        roles = ("head", "chest", "pelvis")
        head, chest, pelvis = (position[:, skeleton.joint(role)] for role in roles)
        elbow = position[:, [skeleton.joint(f"{side}_forearm") for side in ("left", "right")]]
        tip = np.stack([tip_positions(skeleton, limb, position, world) for limb in LIMBS], axis=1)
        moving = np.stack([velocity(tip[:, k], clips) for k in range(len(LIMBS))], axis=1)
        # Most frames of a fighter are near the guard. The chest's joint does not tell where the
        # lower torso ends: skeletons have it anywhere from the waist to the shoulder blades.
        top, bottom = np.median(head[:, 1]), np.median(pelvis[:, 1])
        borders = np.array([0.5 * (top + bottom), top - CHIN * (top - bottom)])
        return _Body(head, chest, pelvis, elbow, tip, moving, borders)

    def bands(self, low: float, high: float) -> np.ndarray:
        """Which of POSITIONS [3] bool lie between two heights [m]. Legs count as lower torso."""
        first, last = np.searchsorted(self.borders, [low, high])
        found = np.zeros(len(POSITIONS), dtype=bool)
        found[len(POSITIONS) - 1 - last : len(POSITIONS) - first] = True
        return found


def _blows(
    body: _Body, library: Layer, ways: Sequence[str], actions: Actions, k: int
) -> list[tuple[int, np.ndarray, str]]:
    """Limb, frames and way of each blow of an attack; its fastest moment if none was found."""
    strikes = library.strikes
    start, stop = int(actions.start[k]), int(actions.stop[k])
    inside = np.flatnonzero((strikes.frame >= start) & (strikes.frame < stop))
    own = DIRECTIONS[actions.direction[k]]
    found = [i for i in inside.tolist() if ways[i]]  # a foot without a way only runs
    if found:
        # The first blow's way is the action's, which a person may have corrected.
        return [
            (
                int(strikes.limb[i]),
                np.arange(strikes.start[i], strikes.stop[i]),
                own if i == found[0] else ways[i],
            )
            for i in found
        ]
    speed = np.linalg.norm(body.velocity[start:stop], axis=2)
    limb = int(actions.limb[k])
    if limb == NO_LIMB:
        limb = int(speed.max(axis=0).argmax())
    return [(limb, start + np.flatnonzero(speed[:, limb] >= FAST * speed[:, limb].max()), own)]


def _out(body: _Body, limb: int, frames: np.ndarray) -> np.ndarray:
    """Those frames of a blow in which it is nearly as far out as it gets."""
    away = (body.tip[frames, limb] - body.pelvis[frames])[:, [0, 2]]
    reach = np.linalg.norm(away, axis=1)
    return frames[reach >= OUT * reach.max()]


def _hit(body: _Body, limb: int, frames: np.ndarray) -> np.ndarray:
    """What a blow hits [3] bool."""
    height = body.tip[_out(body, limb, frames), limb, 1]
    return body.bands(height.min() - MARGIN, height.max() + MARGIN)


def _from(body: _Body, limb: int, frames: np.ndarray, way: str) -> int:
    """Which of HIT_DIRECTIONS a blow comes from."""
    if way in _DIRECTION_OF:
        return _DIRECTION_OF[way]
    out = _out(body, limb, frames)
    v = body.velocity[out, limb].mean(axis=0)
    v /= max(float(np.linalg.norm(v)), 1e-9)
    if v[1] > UPWARD:
        return UPWARDS
    outward = (body.tip[out, limb] - body.chest[out]).mean(axis=0)[[0, 2]]
    along = v[[0, 2]] @ outward / max(float(np.linalg.norm(outward)), 1e-9)
    level = float(np.linalg.norm(v[[0, 2]]))
    # A slash straight down has little that is level: it comes from the front.
    return HORIZONTAL if along < OUTWARD * level and level > UPWARD else FRONT


def _left(body: _Body, frames: slice, way: str) -> np.ndarray:
    """Which of POSITIONS [3] bool the body leaves."""
    parts = np.stack([body.head[frames], body.chest[frames], body.pelvis[frames]], axis=1)
    moved = parts - parts[0]
    if way == "duck":
        return -moved[:, :, 1].min(axis=0) > GONE
    return np.linalg.norm(moved[:, :, [0, 2]], axis=2).max(axis=0) > GONE


def _covered(body: _Body, frames: slice) -> np.ndarray:
    """Which of POSITIONS [3] bool are behind the arm that moves, from the elbow to the tip."""
    hand = body.tip[frames, :2] - body.head[frames, None]
    far = np.linalg.norm(hand - hand[0], axis=2)  # [frames, 2]
    at, arm = np.unravel_index(int(far.argmax()), far.shape)
    ends = (body.elbow[frames][at, arm, 1], body.tip[frames][at, arm, 1])
    return body.bands(min(ends), max(ends))


# The table ---------------------------------------------------------------------------------------


@checked
@dataclass(frozen=True)
class Entry:
    """What one line of a table says of all actions with a label, or of one of them."""

    kind: str  # attack or defence
    action: str  # a label; or label@clip:start, start a frame of the clip
    positions: tuple[str, ...]
    directions: tuple[str, ...]
    by_hand: bool = False

    def __post_init__(self) -> None:
        if self.kind not in ANNOTATED:
            raise unknown("kind with annotations", self.kind, ANNOTATED)
        for name, valid in (("positions", POSITIONS), ("directions", HIT_DIRECTIONS)):
            given = tuple(getattr(self, name))
            for word in given:
                if word not in valid:
                    raise unknown(name.removesuffix("s"), word, valid)
            object.__setattr__(self, name, tuple(word for word in valid if word in given))

    @property
    def check(self) -> str:
        """Made of the other words: does it fit, nobody has changed the line."""
        words = f"{self.kind} {self.action} {self.positions} {self.directions}"
        return f"{zlib.crc32(words.encode('utf-8', 'replace')) & 0xFFFFFF:06x}"


@checked
@dataclass(frozen=True)
class Pair:
    """A suitability that a person gives a pair of actions, whatever their annotations."""

    action: str  # the character's; a label, or label@clip:start
    opponent: str
    suitability: float  # below 0 it discourages

    def __post_init__(self) -> None:
        if not np.isfinite(self.suitability):
            raise KumiteError(
                f"combination: suitability {self.suitability} of {self.action!r} against "
                f"{self.opponent!r}; expected a finite number"
            )
        object.__setattr__(self, "suitability", float(self.suitability))


@checked
@dataclass(frozen=True)
class CombinationTable:
    """How well each action suits each action of the opponent, and what says so."""

    labels: tuple[str, ...]  # A
    places: tuple[str, ...]  # A, clip:start
    kinds: tuple[str, ...]  # A
    entries: tuple[Entry, ...]  # one of a single action goes before one of its label
    pairs: tuple[Pair, ...] = ()  # a later one goes before an earlier one
    comments: tuple[tuple[str, str], ...] = ()  # a file's: (key of what it stands before, comment)

    def __post_init__(self) -> None:
        if not len(self.labels) == len(self.places) == len(self.kinds):
            raise KumiteError("combination: labels, places and kinds of different actions")
        for entry in self.entries:
            self.find(entry.action, entry.kind)
        for pair in self.pairs:
            self.find(pair.action)
            self.find(pair.opponent)

    def __len__(self) -> int:
        return len(self.labels)

    def find(self, action: str, kind: str | None = None) -> np.ndarray:
        """The actions [·] that a label, or label@clip:start, means. Errors: none, with near ones.

        kind: only actions of it.
        """
        found = self._index.get((kind, action))
        if found is not None:
            return found
        label = action.rpartition(AT)[0]
        what = "action" if kind is None else kind
        if (kind, label) in self._index:
            mine = [self.places[k] for k in self._index[kind, label]]
            raise unknown(f"place of {what} {label!r}:", action.rpartition(AT)[2], mine)
        labels = {x for x, its in zip(self.labels, self.kinds) if kind in (None, its)}
        raise unknown(what, action, labels)

    @cached_property
    def _index(self) -> dict[tuple[str | None, str], np.ndarray]:
        found: dict[tuple[str | None, str], list[int]] = {}
        for k, (label, place, kind) in enumerate(zip(self.labels, self.places, self.kinds)):
            for name in (label, f"{label}{AT}{place}"):
                for key in ((None, name), (kind, name)):
                    found.setdefault(key, []).append(k)
        return {key: np.array(each) for key, each in found.items()}

    @cached_property
    def annotations(self) -> Annotations:
        """What the entries say of each action."""
        positions = np.zeros((len(self), len(POSITIONS)), dtype=bool)
        directions = np.zeros((len(self), len(HIT_DIRECTIONS)), dtype=bool)
        for entry in sorted(self.entries, key=lambda e: e.action not in self.labels):
            which = self.find(entry.action, entry.kind)
            positions[which] = [p in entry.positions for p in POSITIONS]
            directions[which] = [d in entry.directions for d in HIT_DIRECTIONS]
        return Annotations(positions, directions)

    @cached_property
    def suitability(self) -> np.ndarray:
        """S [A, A] float64: the character's action, the opponent's."""
        kind = np.array(self.kinds)
        both = (kind == "defence")[:, None] & (kind == "attack")[None, :]
        out = np.where(both, suitability(self.annotations, self.annotations), 0.0)
        for pair in self.pairs:
            out[np.ix_(self.find(pair.action), self.find(pair.opponent))] = pair.suitability
        out.flags.writeable = False
        return out

    def with_entry(self, entry: Entry) -> CombinationTable:
        """The table with an entry of a person's. Errors: an action it does not have.

        One for a label leaves alone those of its actions that have an entry of their own.
        """
        others = [e for e in self.entries if (e.kind, e.action) != (entry.kind, entry.action)]
        return replace(self, entries=self.ordered([*others, replace(entry, by_hand=True)]))

    def with_pair(self, action: str, opponent: str, suitability: float) -> CombinationTable:
        """The table with a pair overridden. Errors: unknown actions; a value that is not finite."""
        others = [p for p in self.pairs if (p.action, p.opponent) != (action, opponent)]
        return replace(self, pairs=(*others, Pair(action, opponent, suitability)))

    def ordered(self, entries: Iterable[Entry]) -> tuple[Entry, ...]:
        """Attacks before defences, labels as they first appear, single actions behind them."""
        first: dict[str, int] = {}
        for k, label in enumerate(self.labels):
            first.setdefault(label, k)

        def key(entry: Entry) -> tuple[int, int, bool, int]:
            which = int(self.find(entry.action, entry.kind)[0])
            single = entry.action not in first
            return ANNOTATED.index(entry.kind), first[self.labels[which]], single, which

        return tuple(sorted(entries, key=key))


@checked
def build_table(
    library: Layer, actions: Actions, annotations: Annotations | None = None
) -> CombinationTable:
    """All attacks paired with all defences of a library's actions.

    annotations: those of :func:`annotate_actions`, if they are known already. Entries are by label:
    where its actions differ, the label has what most of them have and the others stand behind it.
    """
    found = annotate_actions(library, actions) if annotations is None else annotations
    if len(found.positions) != len(actions):
        raise KumiteError("combination: annotations of other actions")
    clip, first = actions.clip, actions.clip_start
    labels = actions.label
    places = tuple(f"{library.clips.names[c]}:{a - first[c]}" for c, a in zip(clip, actions.start))
    kinds = tuple(KINDS[k] for k in actions.kind)
    bare = CombinationTable(labels, places, kinds, ())
    entries = []
    for kind in ANNOTATED:
        for label in {x: None for x, its in zip(labels, kinds) if its == kind}:
            which = bare.find(label, kind).tolist()
            said = [(tuple(found.positions[k]), tuple(found.directions[k])) for k in which]
            most = max(said, key=said.count)  # the first of those that are as frequent
            entries.append(_entry(kind, label, most))
            entries += [
                _entry(kind, f"{label}{AT}{places[k]}", each)
                for k, each in zip(which, said)
                if each != most
            ]
    return replace(bare, entries=bare.ordered(entries))


def _entry(kind: str, action: str, said: tuple[tuple[bool, ...], tuple[bool, ...]]) -> Entry:
    positions = tuple(p for p, has in zip(POSITIONS, said[0]) if has)
    directions = tuple(d for d, has in zip(HIT_DIRECTIONS, said[1]) if has)
    return Entry(kind, action, positions, directions)
