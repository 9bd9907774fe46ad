"""Avoidance parts: how they are found, kept in the file of actions, and kept whole in a graph."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from kumite.annotate import (
    DIRECTIONS,
    KINDS,
    NO_LIMB,
    Actions,
    AvoidanceParts,
    find_actions,
    find_avoidance,
    find_contacts,
    find_strikes,
    no_avoidance,
    read_actions,
    read_avoidance,
    write_actions,
)
from kumite.annotate.action_file import Line, merge, parse, to_lines, write
from kumite.annotate.action_score import score_avoidance, true_avoidance
from kumite.cli.start import app
from kumite.clip import Clip, ClipSet, Skeleton, concatenate, mirror, resample
from kumite.errors import KumiteError
from kumite.graph import (
    Layer,
    build_actions,
    build_frames,
    find_transitions,
    load_library,
    save_library,
)
from kumite.graph.whole import uncut
from kumite.performer import perform
from kumite.rotation import from_axis_angle, multiply
from tests import toys
from tests.shared import builtin, only, performed

FPS = 60.0


def found_in(clips: ClipSet) -> AvoidanceParts:
    return find_avoidance(clips, find_contacts(clips))


# How well ----------------------------------------------------------------------------------------


def test_the_performers_parts_are_found():
    made = perform("avoidance", seed=100)  # thresholds were set on seeds 0 to 2; both hands
    clips = concatenate(made.clips)
    parts = found_in(clips)
    score = score_avoidance(clips, parts, made.truth)
    assert score.precision >= 0.95 and score.recall >= 0.92, score
    assert np.percentile(np.abs(score.start_off), 95) < 0.1
    strict = score_avoidance(clips, parts, made.truth, common=0.7)
    assert strict.precision >= 0.85 and strict.recall >= 0.8, strict


def test_a_boxers_defences_are_found():
    made = perform("boxing", seed=100, mirrored=False)
    clips = concatenate(made.clips)
    score = score_avoidance(clips, found_in(clips), made.truth)
    assert score.recall >= 0.85, score
    assert score.found - score.right < 4 * clips.seconds / 60  # quick steps back, most of them


def test_a_walker_hardly_avoids():
    made = perform("locomotion", seed=100, mirrored=False)
    clips = concatenate(made.clips)
    score = score_avoidance(clips, found_in(clips), made.truth)
    assert score.recall >= 0.9  # leaps aside
    assert score.found - score.right < clips.seconds / 60


@pytest.mark.parametrize("fps", [30.0, 120.0])
def test_any_rate_will_do(fps: float):
    made = perform("avoidance", seed=3, mirrored=False)
    first = found_in(concatenate(made.clips))
    clips = concatenate(made.clips, fps)
    other = found_in(clips)
    assert abs(len(other) - len(first)) <= 0.05 * len(first)
    share = fps / made.clips[0].fps
    near = np.abs(first.centre[:, None] * share - other.centre).min(axis=1)
    assert np.mean(near < 0.1 * fps) > 0.9


@pytest.mark.slow
@pytest.mark.parametrize(
    ("files", "least", "most"),
    [
        (["boxer/ducking.bvh"], 16, 19),  # 17 ducks
        (["woody/3_pass_duck.amc"], 4, 4),
        (["woody/3_pass_jump.amc"], 4, 4),
        (["woody/1_walk_jump_walk.amc"], 4, 4),
        (["woody/3_avoid.amc"], 4, 6),
        ([f"woody/1_jump{end}.amc" for end in ("", "_1", "_2", "_high", "_high_1")], 5, 5),
        ([f"boxer/{blow}.bvh" for blow in ("jab_left", "onetwo", "hook_left_near")], 0, 1),
        (["woody/1_walk_straight.amc", "woody/1_run_straight.amc", "woody/3_walk.amc"], 0, 1),
        (["woody/3_beat.amc", "woody/1_punch.amc", "woody/1_slap.amc"], 0, 2),
    ],
)
def test_real_takes(mocap: Path, files: list[str], least: int, most: int):
    from kumite import mocap as mocap_files

    loaded = mocap_files.load([str(mocap / f) for f in files])
    assert least <= len(found_in(loaded.clip_set())) <= most


# Toys, whose every movement is known --------------------------------------------------------------


def bump(frames: int, begin: int, there: int, back: int, end: int) -> np.ndarray:
    """0 to 1 and back [frames], smoothly."""
    at = np.arange(frames)
    up = np.clip((at - begin) / (there - begin), 0, 1)
    down = np.clip((at - back) / (end - back), 0, 1)
    return up**2 * (3 - 2 * up) - down**2 * (3 - 2 * down)


def toy(
    frames: int = 240,
    *,
    bow: float = 0.0,
    lean: float = 0.0,
    rise: float = 0.0,
    times: tuple[int, int, int, int] = (100, 118, 124, 145),
    skeleton: Skeleton | None = None,
) -> ClipSet:
    """Stands for 4 s at 60 Hz, but between these frames bows, leans [rad] or is aloft [m]."""
    way = bump(frames, *times)
    still = toys.still(frames, fps=FPS)
    root, wxyz, s = still.root_position.copy(), still.wxyz.copy(), still.skeleton
    root[:, 1] += rise * way
    spine = s.names.index("spine")
    wxyz[:, spine] = multiply(
        from_axis_angle([1.0, 0.0, 0.0], bow * way), from_axis_angle([0.0, 0.0, 1.0], lean * way)
    )
    return concatenate([Clip("toy", s, FPS, root, wxyz)])


@pytest.mark.parametrize("way", [{"bow": 1.3}, {"lean": 0.9}, {"lean": -0.9}])
def test_out_and_back_is_one_part(way: dict):
    parts = found_in(toy(**way))
    assert len(parts) == 1
    # Out of where it was: later than it begins, sooner than it is over, and all that lies between.
    assert 102 < parts.start[0] < 118 and 124 < parts.stop[0] < 143


def test_a_jump_is_what_is_aloft():
    parts = found_in(toy(rise=0.3, times=(100, 115, 116, 131)))
    assert len(parts) == 1
    assert 100 < parts.start[0] < 110 and 121 < parts.stop[0] < 132


@pytest.mark.parametrize(
    "way",
    [
        {},
        {"bow": 0.2},  # too little
        {"lean": 0.9, "times": (20, 120, 125, 225)},  # too slow
        {"bow": 1.3, "times": (100, 118, 300, 320)},  # it does not come back
    ],
)
def test_what_is_no_avoidance(way: dict):
    assert len(found_in(toy(**way))) == 0


def test_a_clip_is_as_good_in_the_mirror_and_at_another_rate():
    (clip,) = toy(lean=0.9)
    (seen,) = [found_in(concatenate([mirror(clip)]))]
    here = found_in(toy(lean=0.9))
    assert np.array_equal(here.start, seen.start) and np.array_equal(here.stop, seen.stop)
    slow = found_in(concatenate([resample(clip, 25.0)]))
    assert abs(slow.centre[0] / 25 - here.centre[0] / FPS) < 0.05


def test_parts_lie_each_in_one_clip():
    (clip,) = toy(bow=1.3)
    both = concatenate([clip, Clip("again", clip.skeleton, FPS, clip.root_position, clip.wxyz)])
    parts = found_in(both)
    assert parts.clip.tolist() == [0, 1]
    assert parts.start[1] - parts.start[0] == len(clip)


def test_notes_of_other_clips_are_refused():
    clips = toy()
    with pytest.raises(KumiteError, match="contacts are of other clips"):
        find_avoidance(clips, find_contacts(toys.clip_set([30])))


# The table ---------------------------------------------------------------------------------------


def some(start: list[int], stop: list[int], clips: list[int] | None = None) -> AvoidanceParts:
    return AvoidanceParts(np.array(start), np.array(stop), np.array(clips or [0, 50, 100]))


@pytest.mark.parametrize(
    ("start", "stop", "message"),
    [
        ([5], [5], "must stop after"),
        ([5, 8], [9, 20], "overlap"),
        ([30, 8], [40, 20], "overlap, or are not in order"),
        ([90], [101], "outside the 100 frames"),
        ([-1], [4], "outside"),
        ([40], [51], "into the next"),
        ([4], [5, 6], "stop is"),
    ],
)
def test_parts_that_make_no_sense_are_refused(start: list[int], stop: list[int], message: str):
    with pytest.raises(KumiteError, match=message):
        some(start, stop)


def test_centres_and_inner_frames():
    parts = some([10, 60], [15, 61])
    assert parts.centre.tolist() == [12.0, 60.0] and len(parts) == 2
    assert np.flatnonzero(parts.inner).tolist() == [11, 12, 13, 14]
    assert len(no_avoidance(np.array([0, 9]))) == 0


def test_parts_within_ranges_of_frames():
    parts = some([10, 20, 60], [15, 26, 66])
    first = np.array([10, 11, 0, 20, 60, 70])
    last = np.array([14, 40, 24, 25, 64, 90])
    begin, part = parts.within(first, last)
    held = [part[a:b].tolist() for a, b in zip(begin[:-1], begin[1:])]
    assert held == [[0], [1], [0], [1], [], []]
    slow = [
        [p for p in range(3) if a <= parts.start[p] and parts.stop[p] - 1 <= b]
        for a, b in zip(first, last)
    ]
    assert held == slow


def test_scores_are_counted_one_to_one():
    made = performed("avoidance")
    clips = concatenate(made.clips)
    true = true_avoidance(clips, made.truth)
    perfect = score_avoidance(clips, true, made.truth)
    assert perfect.precision == perfect.recall == 1.0
    assert not perfect.start_off.any() and not perfect.stop_off.any()
    half = AvoidanceParts(true.start[::2], true.stop[::2] + 1, clips.clip_start)
    score = score_avoidance(clips, half, made.truth)
    assert score.precision == 1.0 and score.recall == pytest.approx(0.5, abs=0.01)
    assert np.allclose(score.stop_off, 1 / clips.fps)
    none = score_avoidance(clips, no_avoidance(clips.clip_start), made.truth)
    assert none.right == 0 and none.recall == 0.0


# The file ----------------------------------------------------------------------------------------

FRAMES = 100
CLIPS = concatenate([toys.still(FRAMES, name="a b"), toys.still(FRAMES, name="c")])


def idle(clip: str, start: int, stop: int, *avoid: tuple[int, int]) -> Line:
    return Line(clip, start, stop, "idle", "-", "none", "idle", avoid=avoid)


def tiled(*avoid: tuple[int, int], cuts: tuple[int, ...] = (20, 50)) -> list[Line]:
    """Lines of a program over both clips, cut at 20 and 50, with these parts in the first clip."""
    bounds = [0, *cuts, FRAMES]
    return [
        idle(n, a, b, *(p for p in avoid if n == "a b" and a <= (p[0] + p[1] - 1) // 2 < b))
        for n in CLIPS.names
        for a, b in zip(bounds[:-1], bounds[1:])
    ]


def file_of(path: Path, lines: list[Line]) -> Path:
    write(path, merge(None, lines, [CLIPS])[0])
    return path


def parts_of(path: Path) -> list[tuple[int, int]]:
    parts = read_avoidance(path, CLIPS)
    return list(zip(parts.start.tolist(), parts.stop.tolist()))


def edited(path: Path, old: str, new: str) -> None:
    """One line of a file, as a person changes it."""
    rows = path.read_text().split("\n")
    (at,) = [k for k, row in enumerate(rows) if old in row and not row.startswith("#")]
    rows[at] = rows[at].replace(old, new)
    path.write_text("\n".join(rows))


def test_parts_are_written_and_read(tmp_path: Path):
    path = file_of(tmp_path / "actions.txt", tiled((18, 24), (60, 70), (80, 90)))
    row = next(r for r in path.read_text().split("\n") if "avoid=18-24" in r)
    assert row.split()[2:4] == ["20", "50"]  # its middle lies there
    assert parts_of(path) == [(18, 24), (60, 70), (80, 90)]
    before, actions = path.read_bytes(), read_actions(path, CLIPS)
    write_actions(path, actions, CLIPS, read_avoidance(path, CLIPS))
    assert path.read_bytes() == before
    assert all(not x.by_hand for s in parse(path).sections.values() for x in s.lines)
    write_actions(path, actions, CLIPS)
    assert parts_of(path) == [] and len(read_actions(path, CLIPS)) == len(actions)


def test_a_file_without_parts_is_as_it_was(tmp_path: Path):
    path = file_of(tmp_path / "actions.txt", tiled())
    rows = [r for r in path.read_text().split("\n") if r.startswith('"a b"')]
    assert rows[0] == f'"a b"   0   20  idle  -  none  idle  {tiled()[0].check}'


def test_edits_of_parts_survive_another_analysis(tmp_path: Path):
    path = file_of(tmp_path / "actions.txt", tiled((5, 12), (60, 70), (80, 90)))
    edited(path, "avoid=60-70", "avoid=62-75")  # moved; the line's other part is its, too
    edited(path, "avoid=5-12", "")  # taken out
    rows = path.read_text().split("\n")
    at = next(k for k, row in enumerate(rows) if row.startswith("c ") and " 20 " in row)
    rows[at] = "c 20 50 idle - none idle avoid=30-40  # a new one"
    path.write_text("\n".join(rows))
    mine = [(62, 75), (80, 90), (130, 140)]
    assert parts_of(path) == mine
    for _ in range(2):
        fresh = tiled((6, 11), (30, 40), (48, 53), (58, 68), cuts=(22, 47))
        content, kept = merge(parse(path), fresh, [CLIPS])
        write(path, content)
        assert parts_of(path) == [(30, 40), *mine]
        assert kept.parts == 4 and kept.lines == 3


def test_what_two_lines_claim_is_the_persons(tmp_path: Path):
    path = file_of(tmp_path / "actions.txt", tiled((15, 18), (44, 58)))
    edited(path, "avoid=15-18", "avoid=16-22")
    assert parts_of(path) == [(16, 22), (44, 58)]
    content, _ = merge(parse(path), tiled((20, 30), (44, 58)), [CLIPS])
    write(path, content)
    assert parts_of(path) == [(16, 22), (44, 58)]  # 20 to 30 overlaps the person's


BAD = [
    ("avoid=60", "'avoid=60' is no part; expected avoid=START-STOP"),
    ("avoid=-1-60", "is no part; expected avoid=START-STOP"),
    ("avoid=60-70-80", "is no part"),
    ("avoid=60-70.5", "is no part"),
    ("avoid=70-70", "avoid=70-70: stop 70 is not after start 70"),
    ("avoid=30-40", "avoid=30-40 is not of the action 50 to 100; expected its middle in it"),
    ("avoid=90-101", "avoid=90-101 is outside clip 'a b'; expected at most 100"),
    ("avoid=60-70 avoid=69-80", "avoid=69-80 overlaps avoid=60-70 of line"),
    ("avoid=60-70 avoid=60-70", "avoid=60-70 overlaps avoid=60-70 of line"),
    ("more words", "9 words; expected clip start stop"),
]


@pytest.mark.parametrize(("word", "message"), BAD)
def test_a_bad_part_is_told(tmp_path: Path, word: str, message: str):
    path = file_of(tmp_path / "actions.txt", [x for x in tiled() if x.start != 50])
    path.write_text(path.read_text() + f'"a b" 50 100 idle - none idle {word}\n')
    number = len(path.read_text().split("\n")) - 1
    with pytest.raises(KumiteError) as error:
        read_avoidance(path, CLIPS)
    assert message in str(error.value) and str(error.value).startswith(f"{path}:{number}: ")


spans = st.tuples(st.integers(0, FRAMES - 1), st.integers(1, 30)).map(
    lambda x: (x[0], min(x[0] + x[1], FRAMES))
)


def apart(found: list[tuple[int, int]]) -> list[tuple[int, int]]:
    out: list[tuple[int, int]] = []
    for a, b in sorted(found):
        if not out or a >= out[-1][1]:
            out.append((a, b))
    return out


@settings(max_examples=40, deadline=None)
@given(
    parts=st.lists(spans, max_size=6).map(apart),
    others=st.lists(st.lists(spans, max_size=6).map(apart), min_size=1, max_size=3),
    cuts=st.lists(st.sets(st.integers(1, FRAMES - 1), max_size=5), min_size=4, max_size=4),
    touched=st.sets(st.integers(0, 5)),
)
def test_no_part_of_a_persons_line_is_lost(tmp_path_factory, parts, others, cuts, touched):
    path = tmp_path_factory.mktemp("parts") / "actions.txt"
    write(path, merge(None, tiled(*parts, cuts=tuple(sorted(cuts[0]))), [CLIPS])[0])
    assert parts_of(path) == parts
    rows = path.read_text().split("\n")
    at = [k for k, row in enumerate(rows) if row.startswith('"a b"')]
    for k in touched & set(range(len(at))):
        rows[at[k]] = " ".join(rows[at[k]].split()[:-1])  # without its check word: a person's
    path.write_text("\n".join(rows))
    hand = [x for x in parse(path).sections["a b"].lines if x.by_hand]
    mine = {part for x in hand for part in x.avoid}
    for other, cut in zip(others, cuts[1:]):
        content, kept = merge(parse(path), tiled(*other, cuts=tuple(sorted(cut))), [CLIPS])
        write(path, content)
        now = parts_of(path)  # sorted, disjoint and in their clip, or it would be refused
        assert mine <= set(now) <= mine | set(other)
        assert kept.parts == len(now)


def test_every_found_part_is_in_the_file(tmp_path: Path):
    clips = concatenate(perform("avoidance", seed=5, mirrored=False).clips)
    contacts = find_contacts(clips)
    actions = find_actions(clips, contacts, find_strikes(clips))
    parts = find_avoidance(clips, contacts, actions=actions)
    assert sum(len(x.avoid) for x in to_lines(actions, clips, parts)) == len(parts)
    path = tmp_path / "actions.txt"
    write_actions(path, actions, clips, parts)
    back = read_avoidance(path, clips)
    assert np.array_equal(back.start, parts.start) and np.array_equal(back.stop, parts.stop)


def test_the_command_writes_and_scores_parts(tmp_path: Path):
    path = tmp_path / "actions.txt"
    command = ["segment", "--style", "avoidance", "-o", str(path), "--score"]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.output
    assert "avoidance parts of 5 clips" in done.output
    assert "avoidance parts: 116 true" in done.output
    done = CliRunner().invoke(app, [*command, "--json"])
    assert done.exit_code == 0 and '"avoidance_parts": 1' in done.output


# The graph ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def avoider() -> ClipSet:
    return concatenate(performed("avoidance").clips)


def spread(found: list[tuple[int, int]], clip_start: np.ndarray) -> AvoidanceParts:
    start, stop = np.array(found, np.int64).reshape(-1, 2).T
    return AvoidanceParts(start, stop, clip_start)


def is_whole(library: Layer) -> None:
    """Each stretch has all frames of a part or none."""
    table, parts = library.table, library.avoidance
    for a, b in zip(parts.start, parts.stop):
        some = (table.first < b) & (table.last >= a)
        all_of = (table.first <= a) & (table.last >= b - 1)
        assert np.array_equal(some, all_of)
    begin, part = library.parts_of_stretch
    for k in range(len(table.first)):
        held = part[begin[k] : begin[k + 1]]
        assert np.all(parts.start[held] >= table.first[k])
        assert np.all(parts.stop[held] - 1 <= table.last[k])


@pytest.mark.parametrize("event", ["none", "left", "both"])
def test_no_transition_cuts_a_part(avoider: ClipSet, event: str):
    if event == "none":  # all pairs of frames: half of the clips take a quarter of the time
        avoider = concatenate(list(avoider)[:3])
    contacts = find_contacts(avoider)
    parts = find_avoidance(avoider, contacts)
    per_second = 3.0 if event == "none" else 52.0
    made = find_transitions(avoider, contacts, event=event, per_second=per_second, whole=parts)
    for a, b in zip(parts.start.tolist(), parts.stop.tolist()):
        assert not np.any((made.source >= a) & (made.source < b - 1))
        assert not np.any((made.target > a) & (made.target < b))
    free = find_transitions(avoider, contacts, event=event, per_second=per_second)
    cut = [
        np.any((free.source >= a) & (free.source < b - 1))
        for a, b in zip(parts.start.tolist(), parts.stop.tolist())
    ]
    assert any(cut)  # so it was needed
    library = build_frames(avoider, event=event, per_second=per_second, avoidance=parts)
    is_whole(library)
    held = np.unique(library.parts_of_stretch[1])
    assert library.report["avoidance_parts"] == len(parts)
    assert library.report["avoidance_parts_kept"] == len(held) > 0.8 * len(parts)


@settings(max_examples=15, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 399), st.integers(1, 60)), max_size=8),
    st.sampled_from(["none", "both"]),
)
def test_any_parts_are_kept_whole(avoider: ClipSet, spans: list[tuple[int, int]], event: str):
    short = concatenate([next(iter(avoider))])
    found = apart([(a, min(a + n, len(short))) for a, n in spans])
    parts = spread(found, short.clip_start)
    try:
        library = build_frames(short, event=event, per_second=4.0, avoidance=parts)
    except KumiteError as error:
        assert "too few" in str(error)
        return
    is_whole(library)


def test_a_graph_of_actions_keeps_parts_whole(avoider: ClipSet):
    library = build_actions(avoider, avoidance=True)
    is_whole(library)
    parts = library.avoidance
    assert len(np.unique(library.parts_of_stretch[1])) >= 0.95 * len(parts)
    action = library.actions
    assert action is not None
    for a, b in zip(parts.start, parts.stop):
        assert not np.any((action.start > a) & (action.start < b))


def test_a_graph_is_as_it_was_where_nobody_asks(avoider: ClipSet):
    library = build_frames(avoider)
    assert len(library.avoidance) == 0 and "avoidance_parts" not in library.report
    assert len(library.parts_of_stretch[1]) == 0
    assert np.array_equal(library.parts_of_stretch[0], np.zeros(len(library.table.first) + 1))
    none = build_frames(avoider, avoidance=no_avoidance(avoider.clip_start))
    assert np.array_equal(none.table.stretch, library.table.stretch)
    with pytest.raises(KumiteError, match="avoidance parts: of other clips"):
        build_frames(avoider, avoidance=some([10], [20]))
    with pytest.raises(KumiteError, match="avoidance parts are of other clips"):
        Layer(
            library.clips,
            library.contacts,
            library.strikes,
            library.table,
            avoidance=some([10], [20]),
        )


def test_a_library_keeps_its_parts(avoider: ClipSet, tmp_path: Path):
    library = build_frames(avoider, event="both", avoidance=True)
    path = tmp_path / "a.kumite"
    save_library(path, library)
    back = only(load_library(path))
    assert np.array_equal(back.avoidance.start, library.avoidance.start)
    assert np.array_equal(back.avoidance.stop, library.avoidance.stop)
    assert back.digest == library.digest
    none = Layer(library.clips, library.contacts, library.strikes, library.table, library.report)
    assert none.digest != library.digest
    save_library(path, none)
    assert len(only(load_library(path)).avoidance) == 0


def line(*cuts: int, clips: tuple[int, ...] = (0, 100)) -> Actions:
    bounds = sorted({*cuts, *clips})
    count = len(bounds) - 1
    return Actions(
        np.array(bounds[:-1]),
        np.array(bounds[1:]),
        np.full(count, KINDS.index("idle")),
        np.full(count, NO_LIMB),
        np.full(count, DIRECTIONS.index("none")),
        tuple(f"{a}" for a in bounds[:-1]),
        np.array(clips),
    )


@pytest.mark.parametrize(
    ("cuts", "start", "stop", "shortest", "expected"),
    [
        ((30, 60), [32], [50], 1, [(0, 30), (30, 60), (60, 100)]),  # nothing is cut
        ((30, 60), [50], [64], 1, [(0, 30), (30, 64), (64, 100)]),  # its end moves
        ((30, 60), [25], [45], 1, [(0, 25), (25, 60), (60, 100)]),  # its beginning moves
        ((30, 34), [25], [40], 1, [(0, 25), (25, 40), (40, 100)]),  # both
        ((30, 34), [20], [50], 1, [(0, 20), (20, 100)]),  # the middle is the third's
        ((5, 30), [3], [12], 5, [(0, 30), (30, 100)]),  # 3 frames are too few: they join
        ((30, 60, 64), [40], [62], 5, [(0, 30), (30, 64), (64, 100)]),
        ((30, 60), [25, 40], [32, 62], 1, [(0, 32), (32, 62), (62, 100)]),
    ],
)
def test_what_is_cut_is_moved_or_joined(cuts, start, stop, shortest: int, expected):
    parts = some(start, stop, [0, 100])
    found = uncut(line(*cuts), parts, shortest)
    got = list(zip(found.start.tolist(), found.stop.tolist()))
    assert got == expected


@settings(max_examples=200, deadline=None)
@given(
    st.sets(st.integers(1, 99), max_size=10),
    st.lists(spans, max_size=6).map(apart),
    st.integers(1, 8),
)
def test_no_part_is_cut_and_no_frame_is_lost(cuts, found, shortest: int):
    found = apart([x for x in found if x[1] <= 40] + [x for x in found if x[0] >= 40])
    parts = spread(found, np.array([0, 40, 100]))
    made = uncut(line(*cuts, clips=(0, 40, 100)), parts, shortest)
    for a, b in found:
        inside = (made.start <= a) & (made.stop >= b)
        assert inside.sum() == 1
    assert np.sum(made.stop - made.start) == 100


def test_parts_of_no_action_cut_none():
    first = line(30, 60)
    gap = Actions(
        first.start[[0, 2]],
        first.stop[[0, 2]],
        first.kind[:2],
        first.limb[:2],
        first.direction[:2],
        first.label[:2],
        first.clip_start,
    )
    found = uncut(gap, some([35], [55], [0, 100]))
    assert found.start.tolist() == [0, 60]


@pytest.mark.parametrize("level", ["frames", "actions"])
def test_the_performers_ways_out_are_near(level: str):
    library = builtin("avoidance", level)
    is_whole(library)
    assert np.percentile(until_avoidance(library), 95) < (1.2 if level == "frames" else 0.6)
    assert len(builtin().avoidance) == 0


def until_avoidance(library: Layer) -> np.ndarray:
    """Seconds [N] from each state until the middle of the nearest part."""
    table, (begin, part) = library.table, library.parts_of_stretch
    nearest = np.full(len(table.first), np.inf)
    for k in np.flatnonzero(np.diff(begin)):
        nearest[k] = library.avoidance.centre[part[begin[k]]] - table.first[k] + 1
    best = np.full(table.states, np.inf)
    while True:
        after = np.minimum(nearest, table.duration + best[table.target])[table.stretch]
        now = np.minimum.reduceat(after, table.action_start[:-1])
        if np.array_equal(now, best):
            return best / library.clips.fps
        best = now


def test_the_command_builds_with_parts(tmp_path: Path):
    made = CliRunner().invoke(app, ["perform", "avoidance", "-o", str(tmp_path / "bvh")])
    assert made.exit_code == 0, made.output
    bvh = sorted(str(p) for p in (tmp_path / "bvh").glob("lean*.bvh"))
    output = str(tmp_path / "a.kumite")
    build = ["build", *bvh, "-o", output, "--layer", "frames", "--avoidance", "--event", "both"]
    done = CliRunner().invoke(app, build)
    assert done.exit_code == 0, done.output
    assert "avoidance parts of" in done.output and "each within one action" in done.output
    found = len(only(load_library(output)).avoidance)
    actions = str(tmp_path / "actions.txt")
    assert CliRunner().invoke(app, ["segment", *bvh, "-o", actions]).exit_code == 0
    text = Path(actions).read_text()
    Path(actions).write_text(re.sub(r" avoid=\d+-\d+", "", text, count=1))
    for level in ("frames", "actions"):
        command = ["build", *bvh, "-o", output, "--avoidance", "--layer", level]
        done = CliRunner().invoke(app, [*command, "--actions", actions])
        assert done.exit_code == 0, done.output
        assert len(only(load_library(output)).avoidance) == found - 1
    done = CliRunner().invoke(
        app, ["build", *bvh, "-o", output, "--layer", "frames", "--actions", actions]
    )
    assert isinstance(done.exception, KumiteError)
