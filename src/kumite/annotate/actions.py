"""Actions: semantic parts of a capture, such as a left straight, a duck or a step back, found
without hand work (Shum et al. 2012, section IV, the motion analyser).

:mod:`kumite.annotate.segments` says where clips are cut, :mod:`kumite.annotate.kinds` what the
parts are; here they become one table. Actions of a clip tile it, unless a person has taken some out
(:mod:`kumite.annotate.action_file`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from kumite.annotate.contacts import Contacts
from kumite.annotate.kinds import KindSettings, find_kind, find_trajectories, strike_directions
from kumite.annotate.segments import Cut, CutSettings, find_cuts, find_motion
from kumite.annotate.strikes import Strikes
from kumite.annotate.vocabulary import DIRECTIONS, DIRECTIONS_OF, KINDS, NO_LIMB
from kumite.brief import brief
from kumite.checked import checked
from kumite.checks import freeze, names, rising
from kumite.clip import LIMBS, ClipSet
from kumite.errors import KumiteError


@brief
@dataclass(frozen=True)
class Actions:
    """Actions of a set of clips, end to end and in order (A of them)."""

    start: np.ndarray  # [A] int64, first frame in the set of clips
    stop: np.ndarray  # [A] int64, one past the last
    kind: np.ndarray  # [A] int32, index into KINDS
    limb: np.ndarray  # [A] int32, index into clip.LIMBS of the limb that strikes first, or NO_LIMB
    direction: np.ndarray  # [A] int32, index into DIRECTIONS
    label: tuple[str, ...]  # A, a word of its own for each
    clip_start: np.ndarray  # [C + 1] int64, of the set of clips

    def __post_init__(self) -> None:
        object.__setattr__(self, "label", names(self.label, "actions: labels", unlike=False))
        count = len(self.label)
        freeze(
            self,
            "actions",
            start=(np.int64, (count,)),
            stop=(np.int64, (count,)),
            kind=(np.int32, (count,)),
            limb=(np.int32, (count,)),
            direction=(np.int32, (count,)),
            clip_start=(np.int64, ("C + 1",)),
        )
        if np.any(self.stop <= self.start):
            raise KumiteError("actions: an action must stop after it starts")
        if np.any(self.start[1:] < self.stop[:-1]):
            raise KumiteError("actions: they overlap, or are not in order")
        if list(self.clip_start[:1]) != [0] or not rising(self.clip_start):
            raise KumiteError("actions: clips must start at 0, one after the other")
        frames = int(self.clip_start[-1])
        if count and (self.start[0] < 0 or self.stop[-1] > frames):
            raise KumiteError(f"actions: one lies outside the {frames} frames")
        if np.any(self.clip != np.searchsorted(self.clip_start, self.stop - 1, side="right") - 1):
            raise KumiteError("actions: one goes from one clip into the next")
        for name, low, high in (
            ("kind", 0, len(KINDS)),
            ("limb", NO_LIMB, len(LIMBS)),
            ("direction", 0, len(DIRECTIONS)),
        ):
            values = getattr(self, name)
            if np.any((values < low) | (values >= high)):
                raise KumiteError(f"actions: {name} must be from {low} to {high - 1}")
        for kind, way in zip(self.kind.tolist(), self.direction.tolist()):
            if DIRECTIONS[way] not in DIRECTIONS_OF[KINDS[kind]]:
                raise KumiteError(f"actions: {DIRECTIONS[way]!r} is no way of {KINDS[kind]}")

    def __len__(self) -> int:
        return len(self.start)

    @property
    def clip(self) -> np.ndarray:
        """The clip [A] that each action belongs to."""
        return np.searchsorted(self.clip_start, self.start, side="right") - 1


@checked
def shorter_rests(actions: Actions, longest: float) -> Actions:
    """The same actions, but whoever rests longer than 1.5 times so many frames may go on between.

    A rest is cut into equal parts of about ``longest``: to choose one is not to sleep through it.
    """
    idle = actions.kind == KINDS.index("idle")
    frames = actions.stop - actions.start
    parts = np.where(idle & (frames > 1.5 * longest), np.rint(frames / longest), 1).astype(np.int64)
    of = np.repeat(np.arange(len(actions)), parts)
    part = np.arange(len(of)) - np.repeat(np.cumsum(parts) - parts, parts)
    start = actions.start[of] + part * frames[of] // parts[of]
    stop = actions.start[of] + (part + 1) * frames[of] // parts[of]
    kind, limb, direction = actions.kind[of], actions.limb[of], actions.direction[of]
    label = tuple(actions.label[a] for a in of.tolist())
    return Actions(start, stop, kind, limb, direction, label, actions.clip_start)


@dataclass(frozen=True)
class ActionSettings:
    """How actions are cut and told."""

    cuts: CutSettings = field(default_factory=CutSettings)
    kinds: KindSettings = field(default_factory=KindSettings)


@dataclass
class _Part:
    """An action on its way: what it is, and why it begins."""

    start: int
    stop: int
    cut: Cut
    kind: str
    way: str
    limb: int
    label: str


@checked
def find_actions(
    clips: ClipSet,
    contacts: Contacts,
    strikes: Strikes,
    settings: ActionSettings | None = None,
) -> Actions:
    """Every clip cut into actions. Errors: roles that are missing.

    contacts, strikes: of these clips, as :func:`find_contacts` and :func:`find_strikes` find them.
    """
    settings = settings or ActionSettings()
    if len(contacts.on_ground) != len(clips) or len(strikes.effective) != len(clips):
        raise KumiteError("actions: contacts and strikes are of other clips")
    motion = find_motion(clips)
    frames, reasons = find_cuts(clips, contacts, motion, settings.cuts)

    def classified(start: np.ndarray, stop: np.ndarray, cut: np.ndarray) -> list[_Part]:
        found, level = find_trajectories(clips, contacts, motion, start, stop)
        owner = clips.clip_of_frame[start]
        out = []
        for k, (a, b) in enumerate(zip(start.tolist(), stop.tolist())):
            inside = (strikes.frame >= a) & (strikes.frame < b)
            # Arms that swing in a run go along the forearm, too, but never as sharply.
            slow = (strikes.limb < 2) & (not armed) & (found.arm[k] < settings.kinds.arm)
            blows = np.flatnonzero(inside & ~slow & striking)
            kind, way = find_kind(found, k, level[owner[k]], len(blows) > 0, settings.kinds)
            limb, label = NO_LIMB, way.replace(" ", "_") if kind != "idle" else "idle"
            if kind == "attack":
                limb, way = int(strikes.limb[blows[0]]), ways[blows[0]]
                label = "+".join(f"{LIMBS[strikes.limb[i]]}_{ways[i]}" for i in blows)
            out.append(_Part(a, b, Cut(cut[k]), kind, way, limb, label))
        return out

    armed = "sword" in clips.skeleton.roles
    ways = strike_directions(clips, strikes)
    striking = np.array([way != "" for way in ways], dtype=bool)
    parts = classified(frames[:-1], frames[1:], reasons[:-1])
    keep = _wanted(parts)
    if not all(keep):
        start = np.array([p.start for p, kept in zip(parts, keep) if kept])
        cut = np.array([p.cut for p, kept in zip(parts, keep) if kept])
        parts = classified(start, np.append(start[1:], len(clips)), cut)
    return Actions(
        np.array([p.start for p in parts]),
        np.array([p.stop for p in parts]),
        np.array([KINDS.index(p.kind) for p in parts]),
        np.array([p.limb for p in parts]),
        np.array([DIRECTIONS.index(p.way) for p in parts]),
        tuple(p.label for p in parts),
        clips.clip_start,
    )


def _wanted(parts: list[_Part]) -> list[bool]:
    """Which parts begin an action: the others go on with the one before."""
    out = []
    for k, part in enumerate(parts):
        if k == 0 or part.cut == Cut.BORDER:
            out.append(True)
            continue
        before, both_idle = parts[k - 1], parts[k - 1].kind == part.kind == "idle"
        joins = (
            # standing on after steps on the spot, and before the first of them
            (part.cut == Cut.REST_BEGINS and both_idle)
            or (part.cut == Cut.REST_ENDS and both_idle and before.cut == Cut.BORDER)
            or (part.cut == Cut.SHORT_REST and both_idle)
            # one blow that takes more than two steps to get over, and bounces
            or (part.cut == Cut.STEP and (before.kind == "reaction" or both_idle))
        )
        out.append(not joins)
    return out
