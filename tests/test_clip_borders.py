"""What is found in a set of clips is what is found in each: nothing goes across a border.

Clips are cut from takes in the midst of jumps, ducks, blows and steps. Two things are shared by all
clips of a set, and are given to each alone here: the heights at which feet rest, and, in cycles and
targets, how high and how a body usually stands. So those are compared in another order of clips.
"""

from __future__ import annotations

from itertools import groupby
from pathlib import Path

import numpy as np
import pytest

from kumite.annotate import (
    Actions,
    AvoidanceParts,
    Contacts,
    find_actions,
    find_avoidance,
    find_contacts,
    find_cycles,
    find_strikes,
)
from kumite.clip import Clip, ClipSet, concatenate, runs
from kumite.errors import KumiteError
from kumite.graph import build_avoidance, find_avoiding_transitions, find_targets
from kumite.performer import perform

CASES = Path(__file__).parent / "cases"


def cut(style: str, count: int, longest: int, seed: int = 3) -> list[Clip]:
    """Pieces of a style's takes from anywhere to anywhere."""
    rng = np.random.default_rng(seed)
    takes = list(concatenate(list(perform(style, 0, mirrored=False).clips), 30.0))
    out = []
    for k in range(count):
        take = takes[int(rng.integers(len(takes)))]
        a = int(rng.integers(len(take) - longest // 2))
        b = min(a + int(rng.integers(longest // 2, longest)), len(take))
        parts = take.root_position[a:b], take.wxyz[a:b]
        out.append(Clip(f"{take.name} {k}", take.skeleton, take.fps, *parts))
    return out


@pytest.fixture(scope="module", params=["avoidance", "targets"])
def pieces(request: pytest.FixtureRequest) -> list[Clip]:
    return cut(request.param, 12, 90)


def test_runs_end_where_clips_do():
    rng = np.random.default_rng(0)
    for _ in range(50):
        mask = rng.random(40) < 0.6
        edges = np.unique([0, 40, *rng.integers(1, 40, 3)])
        want = []
        for a, b in zip(edges[:-1].tolist(), edges[1:].tolist()):
            for value, frames in groupby(range(a, b), key=lambda f: mask[f]):
                inside = list(frames)
                if value:
                    want.append([inside[0], inside[-1] + 1])
        assert runs(mask, edges).tolist() == want
        # Runs with a frame or two between them are one, of one clip.
        clip = np.searchsorted(edges, np.arange(40), side="right")
        joined = want[:1]
        for a, b in want[1:]:
            if a - joined[-1][1] < 3 and clip[a] == clip[joined[-1][1] - 1]:
                joined[-1] = [joined[-1][0], b]
            else:
                joined.append([a, b])
        assert runs(mask, edges, apart=3).tolist() == joined
    assert runs(np.zeros(0, dtype=bool)).shape == (0, 2)
    assert runs(np.ones(3, dtype=bool)).tolist() == [[0, 3]]


def test_notes_of_a_set_are_those_of_each_clip(pieces: list[Clip]):
    clips = concatenate(pieces)
    contacts = find_contacts(clips)
    strikes = find_strikes(clips)
    actions = find_actions(clips, contacts, strikes)
    parts = find_avoidance(clips, contacts, actions=actions)
    found = 0
    for clip, a, b in zip(pieces, clips.clip_start.tolist(), clips.clip_start[1:].tolist()):
        alone = concatenate([clip])
        mine = Contacts(contacts.on_ground[a:b], contacts.resting_height)
        blows = find_strikes(alone)
        inside = (strikes.frame >= a) & (strikes.frame < b)
        for name in ("frame", "start", "stop"):
            assert np.array_equal(getattr(blows, name) + a, getattr(strikes, name)[inside])
        acts = find_actions(alone, mine, blows)
        _same(acts, actions, a, b)
        assert acts.label == tuple(np.array(actions.label)[_inside(actions, a, b)])
        spans = find_avoidance(alone, mine, actions=acts)
        _same(spans, parts, a, b)
        found += len(blows) + len(spans)
    assert found > 8


def _inside(spans: Actions | AvoidanceParts, a: int, b: int) -> np.ndarray:
    return np.flatnonzero((spans.start >= a) & (spans.start < b))


def _same(alone: Actions | AvoidanceParts, found: Actions | AvoidanceParts, a: int, b: int) -> None:
    inside = _inside(found, a, b)
    assert (alone.start + a).tolist() == found.start[inside].tolist()
    assert (alone.stop + a).tolist() == found.stop[inside].tolist()


def test_contacts_of_clips_do_not_depend_on_their_order(pieces: list[Clip]):
    _any_order(pieces, lambda clips: [find_contacts(clips).on_ground])


def test_cycles_and_targets_do_not_depend_on_the_order_of_clips():
    def found(clips: ClipSet) -> list[np.ndarray]:
        contacts = find_contacts(clips)
        cycles = find_cycles(clips, contacts)
        targets, _ = find_targets(clips, contacts, find_strikes(clips), most=99)
        assert len(cycles) > 1 and len(targets) > 1
        out = []
        for spans in (cycles, targets):
            frames = np.zeros(len(clips))
            frames[spans.start], frames[spans.stop] = 1, 2
            out.append(frames)
        return out

    _any_order(cut("targets", 12, 240), found)


def _any_order(pieces: list[Clip], found) -> None:
    """Notes [F] of each clip are the same with the clips in another order."""
    order = np.random.default_rng(1).permutation(len(pieces))
    one, other = concatenate(pieces), concatenate([pieces[k] for k in order])
    for first, second in zip(found(one), found(other)):
        for place, k in enumerate(order.tolist()):
            mine = first[one.clip_start[k] : one.clip_start[k + 1]]
            theirs = second[other.clip_start[place] : other.clip_start[place + 1]]
            assert np.array_equal(mine, theirs), pieces[k].name


def test_a_jump_at_the_end_of_a_clip_is_not_one_with_that_at_the_start_of_the_next(run):
    folder = CASES / "aloft_across_clips"
    status, _, err = run("segment", folder, "-o", "actions.txt")
    assert (status, err.count("Traceback")) == (0, 0)
    lines = Path("actions.txt").read_text().splitlines()
    assert sum("avoid=" in line and not line.startswith("#") for line in lines) == 2


def test_nothing_enters_a_part_that_begins_with_its_clip(pieces: list[Clip]):
    clips = concatenate(pieces)
    contacts = find_contacts(clips)
    found = find_avoidance(clips, contacts)
    # Every clip begins with a part, those of the middle in one that is found as well.
    start = np.concatenate([clips.clip_start[:-1], found.start])
    stop = np.concatenate([clips.clip_start[:-1] + 4, found.stop])
    keep = np.flatnonzero((stop - start > 0) & (np.isin(start, clips.clip_start) | (start > 0)))
    order = keep[np.argsort(start[keep], kind="stable")]
    start, stop = start[order], stop[order]
    apart = np.append(True, start[1:] >= np.maximum.accumulate(stop)[:-1])
    parts = AvoidanceParts(start[apart], stop[apart], clips.clip_start)
    first = np.isin(parts.start, clips.clip_start)
    assert first.sum() > 5 and (~first).any()
    made = find_avoiding_transitions(clips, parts, strikes=find_strikes(clips))
    assert not np.isin(made.target, clips.clip_start).any()
    only = AvoidanceParts(parts.start[first], parts.stop[first], clips.clip_start)
    with pytest.raises(KumiteError, match="begins with its clip"):
        build_avoidance(clips, only)
