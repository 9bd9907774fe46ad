"""What target motions are for, in words that fit every library: under, over, kick, punch, strike.

A label names one motion of one library; a kind names all of any library that serve. Which are of a
kind follows from what was found in the capture (:mod:`kumite.graph.preparing`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from kumite.body import lay_body
from kumite.clip import LIMBS, ClipSet
from kumite.errors import KumiteError, unknown
from kumite.graph.layer import Layer
from kumite.graph.preparing import KINDS as ABOUT
from kumite.graph.preparing import Preparing, is_obstacle
from kumite.rotation import rotate

TAKES = {
    "under": "clips that walk, get under something (duck or crawl) and walk on",
    "over": "clips that walk, jump or step over something and walk on",
    "kick": "clips that walk up or stand, kick and go on",
    "punch": "clips that walk up or stand, punch and go on",
    "strike": "clips that walk up or stand, punch or kick and go on",
}
"""The kinds, and which clips one takes. A kick or a punch is a strike."""
KINDS = tuple(TAKES)
STRIKE = ABOUT.index("strike")
FEET = [LIMBS.index(limb) for limb in LIMBS if limb.endswith("foot")]
UNSTEADY = 0.6  # rad that a motion without a reference posture counts as less well joined
LOW_HIPS = 0.2  # of the height of who stands: whose pelvis gets lower lies, or sits …
LIES = 1.0  # … rad that such a motion counts as less well joined: it is taken only at need
LYING = 0.35  # m: what is struck below it lies on the ground, else it hangs there
MUCH_WORSE = 0.8  # rad: who is so much less well joined than the best is taken only at need


@dataclass(frozen=True)
class Suited:
    """Which of T target motions are of which kind, and how well each is joined to locomotion."""

    label: tuple[str, ...]  # T
    about: np.ndarray  # [T] as Preparing.kind
    of: dict[str, np.ndarray]  # by kind: numbers of targets, the best joined first
    apart: (
        np.ndarray
    )  # [T] rad of its best ways in and out together, more where it is unsteady or lies
    clear: np.ndarray  # [T] m: see Preparing
    high: np.ndarray  # [T] m above ground at which a strike hits
    tall: float  # m, height of who stands
    on_the_spot: int  # how many get lower or higher where they are, and past nothing

    def kinds_of(self, t: int) -> tuple[str, ...]:
        """The kinds that target t is of, the widest last."""
        return tuple(kind for kind, which in self.of.items() if t in which)

    def meant(self, word: str, what: str) -> np.ndarray:
        """The target motions [N] that a word means, which is a kind or a label, the best joined
        first; none of a kind that the library does not have.

        what: what the word was given for, for errors. Errors: it is neither.
        """
        if word in self.of:
            return self.of[word]
        if word in self.label:
            return np.array([self.label.index(word)])
        raise unknown(f"{what}: kind or target motion", word, (*KINDS, *self.label))

    def refuse_without(self, words: Iterable[str], title: str) -> None:
        """Errors: no motion of a kind, one line for all."""
        lacks = [w for w in dict.fromkeys(words) if w in self.of and len(self.of[w]) == 0]
        if not lacks:
            return
        has = ", ".join(f"{k} {len(v)}" for k, v in self.of.items() if len(v) and k != "strike")
        spot = ""
        if self.on_the_spot and {"under", "over"} & set(lacks):
            spot = f"; {self.on_the_spot} get lower or higher where they stand, past nothing"
        raise KumiteError(
            f"{title!r} needs motions of the kind {' and '.join(lacks)}; this library has none "
            f"({has or 'nor any other'}{spot}). It takes {', and '.join(TAKES[w] for w in lacks)}"
        )

    def spare(self, which: np.ndarray, height: float) -> np.ndarray:
        """How much [N] m targets have to spare at a height: of a bar's underside, a hurdle's top
        (below 0: they do not clear it), or the middle of what is struck (how far they are off, from
        0 down)."""
        clear, about = self.clear[which], self.about[which]
        under, over = height - clear, clear - height
        strike = -np.abs(self.high[which] - height)
        return np.choose(about, [strike, under, over])

    def fit(self, which: np.ndarray, height: float | None, reach: float) -> np.ndarray:
        """Those of targets [N] that suit a thing, the best first.

        height [m]: as :meth:`spare` takes it: those that clear it, or strike within ``reach`` [m]
        of it, the nearest size first. None: those that are not much less well joined than the best;
        of kicks those at what lies on the ground, if there are any.
        """
        if len(which) == 0:
            return which
        if height is None:
            lie = np.isin(which, self.of["kick"]) & (self.high[which] < LYING)
            which = which[lie] if np.any(lie) else which
            return which[self.apart[which] <= self.apart[which].min() + MUCH_WORSE]
        spare = self.spare(which, height)
        least = np.where(self.about[which] == STRIKE, -reach, 0.0)
        good = spare >= least
        return which[good][np.argsort(np.abs(spare[good]), kind="stable")]


def suited(layer: Layer) -> Suited:
    """What the target motions of a library for preparation are for. Errors: it is for another
    thing.
    """
    p = layer.preparing
    if p is None:
        raise KumiteError("the library is not one for preparation; expected --layer preparation")
    tall = _tall(layer.clips, p)
    real = is_obstacle(p, tall)
    hips = layer.clips.world[0][:, layer.clips.skeleton.joint("pelvis"), 1]
    # In a roll feet fly about, too.
    strike = (p.kind == STRIKE) & (hips[p.contact] >= LOW_HIPS * tall)
    kick = strike & np.isin(p.limb, FEET)
    is_of = {
        "under": real & (p.kind == ABOUT.index("under")),
        "over": real & (p.kind == ABOUT.index("over")),
        "kick": kick,
        "punch": strike & ~kick,
        "strike": strike,
    }
    h = p.hierarchy
    apart = h.entry_distance.min(axis=0) + h.exit_distance.min(axis=0)
    apart = apart + np.where(p.found, 0.0, UNSTEADY)
    apart = apart + np.where(_lowest_hips(layer.clips, p) < LOW_HIPS * tall, LIES, 0.0)
    order = np.argsort(apart, kind="stable")
    return Suited(
        h.targets.label,
        p.kind,
        {kind: order[of[order]] for kind, of in is_of.items()},
        apart,
        p.clear,
        p.place[:, 1],
        tall,
        int(np.count_nonzero((p.kind != STRIKE) & ~real)),
    )


def _lowest_hips(clips: ClipSet, p: Preparing) -> np.ndarray:
    """How low [T] m the pelvis gets in each target."""
    high = clips.world[0][:, clips.skeleton.joint("pelvis"), 1]
    of = p.hierarchy.targets
    return np.array([high[a : b + 1].min() for a, b in zip(of.start, of.stop)])


def _tall(clips: ClipSet, p: Preparing) -> float:
    """How tall [m] the body is in the slowest core."""
    cores = p.hierarchy.cores
    slowest = int(np.argmin(np.abs(cores.speed)))
    frames = np.arange(cores.start[slowest], cores.stop[slowest] + 1)
    body = lay_body(clips.skeleton)
    position, world = (x[frames][:, body.joint] for x in clips.world)
    ends = [(position + rotate(world, x))[..., 1] for x in (body.start, body.end)]
    top = np.maximum(ends[0] + body.radius_start, ends[1] + body.radius_end).max(axis=1)
    low = np.minimum(ends[0] - body.radius_start, ends[1] - body.radius_end).min(axis=1)
    return float(np.median(top - low))
