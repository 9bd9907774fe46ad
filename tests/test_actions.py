"""Actions: where clips are cut, what the parts are, and the file that a person edits."""

from __future__ import annotations

from dataclasses import replace
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
    find_actions,
    find_contacts,
    find_strikes,
    read_actions,
    write_actions,
)
from kumite.annotate.action_file import ActionFile, Line, Section, merge, parse, write
from kumite.annotate.action_score import score_actions, true_boundaries
from kumite.annotate.segments import Cut, CutSettings, find_cuts, find_motion
from kumite.cli.start import app
from kumite.clip import Clip, ClipSet, concatenate
from kumite.errors import KumiteError
from kumite.performer import perform
from tests import toys


def analysed(clips: ClipSet) -> Actions:
    return find_actions(clips, find_contacts(clips), find_strikes(clips))


@pytest.mark.parametrize("style", ["boxing", "sword", "locomotion"])
def test_the_performers_actions_are_found(style: str):
    made = perform(style, seed=1, mirrored=False)  # thresholds were set on seed 0
    clips = concatenate(made.clips)
    score = score_actions(clips, analysed(clips), made.truth)
    assert score.precision >= 0.90 and score.recall >= 0.90, score
    assert score.kinds_right >= 0.90, score.confusion


@pytest.mark.slow
def test_kinds_of_a_real_boxers_takes(mocap: Path):
    from kumite import mocap as mocap_files

    clips = mocap_files.load(mocap / "boxer").clip_set()
    actions = analysed(clips)
    told = {"being_hit": "reaction", "blocking": "defence", "ducking": "defence"}
    right = count = 0
    for c, name in enumerate(clips.names):
        kinds = [KINDS[k] for k in actions.kind[actions.clip == c]]
        kinds = [k for k in kinds if k not in ("idle", "transition")]
        right += kinds.count(told.get(name, "attack"))
        count += len(kinds)
    assert right >= 0.75 * count


def test_truth_has_a_boundary_between_any_two_moves():
    _, truth = next(iter(zip(*vars(perform("sword", mirrored=False)).values())))
    bounds = true_boundaries(truth)
    assert len(bounds) == len(truth.actions) - 1  # it begins and ends in an idle guard
    assert all(a <= b for a, b in bounds)


def walker(frames: int = 60, fps: float = 60.0) -> ClipSet:
    """Hops forward twice: the whole body is up for a quarter of a second, two landings."""
    c = toys.still(frames, fps=fps)
    root = c.root_position.copy()
    for begin in (10, 35):
        k = np.arange(16)
        root[begin : begin + 16, 1] += 0.2 * np.sin(np.pi * k / 15)
        root[begin:, 2] += np.clip((np.arange(frames - begin)) / 15, 0, 1) * 0.5
    return concatenate([Clip("walker", c.skeleton, fps, root, c.wxyz)])


def test_two_footfalls_are_one_action_that_goes_forward():
    clips = walker()
    frames, reasons = find_cuts(clips, find_contacts(clips), find_motion(clips), CutSettings())
    assert not (reasons == Cut.STEP).any()
    actions = analysed(clips)
    assert actions.start[0] == 0 and actions.stop[-1] == len(clips)
    assert np.array_equal(actions.start[1:], actions.stop[:-1])
    assert list(frames[[0, -1]]) == [0, len(clips)]
    longest = int(np.argmax(actions.stop - actions.start))
    assert KINDS[actions.kind[longest]] == "transition"
    assert DIRECTIONS[actions.direction[longest]] == "forward"


# The table ---------------------------------------------------------------------------------------


def some(**changes) -> Actions:
    values: dict = {
        "start": [0, 10],
        "stop": [10, 20],
        "kind": [0, 4],
        "limb": [0, NO_LIMB],
        "direction": [0, DIRECTIONS.index("none")],
        "label": ("jab", "idle"),
        "clip_start": [0, 20],
    }
    both = values | changes
    return Actions(label=both.pop("label"), **{k: np.array(v) for k, v in both.items()})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"stop": [0, 20]}, "must stop after"),
        ({"stop": [12, 20]}, "overlap"),
        ({"stop": [10, 21]}, "outside"),
        ({"clip_start": [0, 15, 20]}, "into the next"),
        ({"kind": [0, 5]}, "kind must be"),
        ({"limb": [4, NO_LIMB]}, "limb must be"),
        ({"direction": [DIRECTIONS.index("duck"), DIRECTIONS.index("none")]}, "no way of attack"),
        ({"start": [0]}, "start is"),
    ],
)
def test_actions_that_make_no_sense_are_refused(changes: dict, message: str):
    with pytest.raises(KumiteError, match=message):
        some(**changes)


def test_actions_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        some().start[0] = 3


# The file ----------------------------------------------------------------------------------------

FRAMES = 100
CLIPS = concatenate([toys.still(FRAMES, name="a b"), toys.still(FRAMES, name="c#")])


def idle(clip: str, start: int, stop: int, label: str = "idle") -> Line:
    return Line(clip, start, stop, "idle", "-", "none", label)


def tiled(*cuts: int, label: str = "idle") -> list[Line]:
    """Lines of a program over both clips, cut at these frames."""
    bounds = [0, *sorted(set(cuts)), FRAMES]
    return [idle(n, a, b, label) for n in CLIPS.names for a, b in zip(bounds[:-1], bounds[1:])]


def first_file(path: Path) -> Path:
    write(path, merge(None, tiled(20, 50), [CLIPS])[0])
    return path


def again(path: Path, lines: list[Line]) -> ActionFile:
    write(path, merge(parse(path), lines, [CLIPS])[0])
    return parse(path)


def test_a_file_is_stable(tmp_path: Path):
    path = first_file(tmp_path / "actions.txt")
    before = path.read_bytes()
    actions = read_actions(path, CLIPS)
    assert len(actions) == 6 and actions.label[0] == "idle"
    write_actions(path, actions, CLIPS)
    assert path.read_bytes() == before
    content, kept = merge(parse(path), tiled(20, 50), [CLIPS])
    write(path, content)
    assert path.read_bytes() == before
    assert (kept.lines, kept.gaps, kept.comments, kept.written) == (0, 0, 0, 6)


def test_edits_survive_another_analysis(tmp_path: Path):
    path = first_file(tmp_path / "actions.txt")
    rows = path.read_text().split("\n")
    at = [k for k, row in enumerate(rows) if row.startswith('"')]
    rows[at[1]] = '"a b" 20 55 attack left_hand straight "my jab"  # late'  # changed, longer
    rows[at[3]] = "# look at this\n" + rows[at[3]]
    del rows[at[4]]  # taken out: 20 to 50 of the second clip
    path.write_text("\n".join(rows))
    read = read_actions(path, CLIPS)
    assert list(zip(read.start, read.stop)) == [
        (0, 20),
        (20, 55),
        (55, 100),
        (100, 120),
        (150, 200),
    ]
    for _ in range(2):
        content = again(path, tiled(10, 53, label="new"))
    first, second = (content.sections[n] for n in CLIPS.names)
    assert [(x.start, x.stop, x.label) for x in first.lines] == [
        (0, 10, "new"),
        (10, 20, "new"),
        (20, 55, "my jab"),
        (55, 100, "new"),
    ]
    assert first.lines[2].by_hand and first.lines[2].comment == "# late"
    assert [(x.start, x.stop) for x in second.lines] == [(0, 10), (10, 20), (50, 100)]
    assert "# look at this" in path.read_text()


def test_a_clip_that_comes_later_is_added(tmp_path: Path):
    path = tmp_path / "actions.txt"
    one = concatenate([toys.still(FRAMES, name="a b")])
    write(path, merge(None, [x for x in tiled(20) if x.clip == "a b"], [one])[0])
    assert len(again(path, tiled(20)).sections["c#"].lines) == 2


@settings(max_examples=60, deadline=None)
@given(
    cuts=st.sets(st.integers(1, FRAMES - 1), max_size=8),
    others=st.lists(st.sets(st.integers(1, FRAMES - 1), max_size=8), min_size=1, max_size=3),
    taken=st.sets(st.integers(0, 8)),
    mine=st.lists(st.tuples(st.integers(0, FRAMES - 1), st.integers(1, 40)), max_size=4),
)
def test_no_edit_is_lost(cuts, others, taken, mine):
    program = [x for x in tiled(*cuts) if x.clip == "a b"]
    hand: list[Line] = []
    for start, length in mine:
        line = replace(idle("a b", start, min(start + length, FRAMES), "mine"), by_hand=True)
        if all(line.stop <= x.start or line.start >= x.stop for x in hand):
            hand.append(line)
    left = [x for k, x in enumerate(program) if k not in taken]
    content = ActionFile(
        {"a b": Section(tuple(sorted([*left, *hand], key=lambda x: x.start)), 100)}
    )
    covered = np.zeros(FRAMES, dtype=int)
    for x in [*left, *hand]:
        covered[x.start : x.stop] = 1
    for other in others:
        content, kept = merge(content, tiled(*other, label="new"), [CLIPS])
        found = content.sections["a b"].lines
        assert sorted(hand, key=lambda x: x.start) == [x for x in found if x.by_hand]
        assert kept.lines == len(hand)
        now = np.zeros(FRAMES, dtype=int)
        for x in found:
            now[x.start : x.stop] += 1
        assert np.array_equal(now, covered)  # once where a line was, and nowhere else


BAD = [
    ('"a b" 0 10 atack - none x', "unknown kind 'atack'; did you mean 'attack'"),
    ('"a b" 0 10 idle hand none x', "unknown limb 'hand'"),
    ('"a b" 0 10 attack - duck x', "unknown direction of attack 'duck'"),
    ('"a b" 10 10 idle - none x', "stop 10 is not after start 10"),
    ('"a b" -1 10 idle - none x', "'-1' is not a frame"),
    ('"a b" 0 1.5 idle - none x', "'1.5' is not a frame"),
    ('"a b" 0 101 idle - none x', "stop 101 is outside clip 'a b'; expected at most 100"),
    ('"a b" 0 10 idle - none', "6 words; expected clip start stop"),
    ('"a b 0 10 idle - none x', "no closing quote"),
    ("nobody 0 10 idle - none x", "unknown clip 'nobody'"),
    ('"a b" 0 10 idle - none x\n"a b" 9 12 idle - none y', "9 to 12 overlaps line"),
    ('== "a b" 100 frames 60.0 a second', "a second heading"),
    ("== c# 100 frames", "expected == CLIP N frames RATE a second"),
]


@pytest.mark.parametrize(("row", "message"), BAD)
def test_a_bad_line_is_told_and_nothing_is_written(tmp_path: Path, row: str, message: str):
    path = first_file(tmp_path / "actions.txt")
    path.write_text(path.read_text() + row + "\n")
    number = len(path.read_text().split("\n")) - 1
    with pytest.raises(KumiteError) as error:
        read_actions(path, CLIPS)
    assert message in str(error.value) and str(error.value).startswith(f"{path}:{number}: ")


def test_another_rate_is_refused(tmp_path: Path):
    path = first_file(tmp_path / "actions.txt")
    slow = concatenate([toys.still(FRAMES, name=n, fps=CLIPS.fps / 2) for n in CLIPS.names])
    with pytest.raises(KumiteError, match="expected one rate"):
        read_actions(path, slow)


def test_the_command_keeps_edits(tmp_path: Path):
    path = tmp_path / "actions.txt"
    command = ["segment", "--style", "locomotion", "-o", str(path), "--score", "--json"]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.output
    assert '"precision"' in done.output and '"kept_lines": 0' in done.output
    rows = path.read_text().split("\n")
    k = next(k for k, row in enumerate(rows) if row.startswith("walk "))
    rows[k] = rows[k].replace("idle", "idle", 1) + " # mine"
    path.write_text("\n".join(rows))
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0 and '"kept_lines": 1' in done.output
    path.write_text(path.read_text() + "walk 5 2 idle - none x\n")
    before = path.read_bytes()
    done = CliRunner().invoke(app, command)
    assert isinstance(done.exception, KumiteError) and path.read_bytes() == before
