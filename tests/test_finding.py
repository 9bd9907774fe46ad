"""Target motions, marked in a file of actions or found, and the command that builds with them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from kumite import mocap as mocap_files
from kumite.annotate import find_contacts, find_strikes, read_marked
from kumite.annotate.action_file import merge, parse, write
from kumite.clip import LIMBS, Clip, ClipSet, concatenate
from kumite.errors import KumiteError
from kumite.export.bvh import write_bvh
from kumite.graph import (
    Layer,
    build_preparation,
    find_targets,
    load_library,
    marked_targets,
)
from kumite.graph.preparing import KINDS, Preparing
from tests.shared import only, performed

TAKES = ("duck_under", "jump_over", "front_kick")


@pytest.fixture(scope="module")
def made():
    return performed("targets")


@pytest.fixture(scope="module")
def takes(made) -> ClipSet:
    return concatenate([c for c in made.clips if c.name in TAKES])


def row(clip: str, start: int, stop: int, label: str, more: str = "") -> str:
    return f"{clip} {start} {stop} transition - forward {label} {more}".rstrip() + "\n"


def prepared(library: Layer) -> Preparing:
    assert library.preparing is not None
    return library.preparing


# Found --------------------------------------------------------------------------------------------


def test_the_performers_targets_are_found(made):
    clips = concatenate(list(made.clips))
    found, cycles = find_targets(clips, find_contacts(clips), find_strikes(clips), most=100)
    assert {"stand", "walk"} <= set(cycles.label)
    hit = 0
    truth = [
        (int(first) + a.start, int(first) + a.stop, int(first) + a.mark)
        for t, first in zip(made.truth, clips.clip_start)
        for a in t.actions
        if a.mark is not None
    ]
    matched = []
    for start, stop, mark in truth:
        over = np.minimum(stop, found.stop) - np.maximum(start, found.start)
        t = int(np.argmax(over))
        if over[t] > 0.5 * (stop - start):
            hit += 1
            matched.append(t)
            assert abs(found.mark[t] - mark) < 0.7 * clips.fps
    # The others are no targets of a capture, but neither are they many.
    assert hit >= 0.85 * len(truth) and len(found) - len(set(matched)) <= 0.1 * len(truth)


def test_of_a_name_no_more_are_kept_than_wanted(takes: ClipSet):
    contacts, strikes = find_contacts(takes), find_strikes(takes)
    every, _ = find_targets(takes, contacts, strikes, most=9)
    one, _ = find_targets(takes, contacts, strikes, most=1)
    assert set(one.label) == {"under", "over", "right_foot_kick"} and len(every) > len(one)
    assert set(one.start.tolist()) <= set(every.start.tolist())
    with pytest.raises(KumiteError, match="most 0 of a name"):
        find_targets(takes, contacts, strikes, most=0)


def test_clips_without_targets():
    walk = next(c for c in performed("locomotion").clips if c.name == "walk")
    clips = concatenate([walk])
    with pytest.raises(KumiteError, match=r"no target motion in 1 clip\(s\) .*\(mark it by hand"):
        find_targets(clips, find_contacts(clips), find_strikes(clips))


def test_clips_that_begin_within_their_target(takes: ClipSet):
    strikes, front = find_strikes(takes), int(takes.clip_start[takes.names.index("front_kick")])
    kick = int(strikes.frame[strikes.limb == LIMBS.index("right_foot")][0])
    spans = {"stand": slice(front, front + 300), "part": slice(kick - 8, kick + 60)}
    clips = concatenate(
        [
            Clip(name, takes.skeleton, 60.0, takes.root_position[s], takes.wxyz[s])
            for name, s in spans.items()
        ]
    )
    with pytest.raises(KumiteError, match=r"1 motion\(s\) .* but clips begin or end within each"):
        find_targets(clips, find_contacts(clips), find_strikes(clips))


# Marked -------------------------------------------------------------------------------------------


def test_marks_are_read(takes: ClipSet, tmp_path: Path):
    path, first = tmp_path / "actions.txt", dict(zip(takes.names, takes.clip_start.tolist()))
    path.write_text(
        row("jump_over", 60, 400, "up", "mark=90")
        + row("duck_under", 10, 60, "-", "cycle")
        + row("duck_under", 509, 654, "duck", "mark=536 avoid=560-600")
        + row("front_kick", 500, 600, "duck", "mark=500 # my own")
        + row("front_kick", 700, 800, "other")
    )
    marked = read_marked(path, takes)
    duck, jump, kick = (first[n] for n in ("duck_under", "jump_over", "front_kick"))
    assert sorted(marked.targets) == sorted(
        [
            ("duck", duck + 509, duck + 653, duck + 536),
            ("duck_2", kick + 500, kick + 599, kick + 500),
            ("up", jump + 60, jump + 399, jump + 90),
        ]
    )
    assert marked.cycles == (("duck_under", duck + 10, duck + 59),)
    targets, cycles = marked_targets(takes, find_contacts(takes), marked)
    assert cycles is not None and cycles.label == ("duck_under",)
    assert targets.mark[targets.label.index("up")] == jump + 90
    # Marks and cycles are kept when the file is written again, each time the same.
    content, kept = merge(parse(path), [], [takes])
    write(tmp_path / "b.txt", content)
    text = (tmp_path / "b.txt").read_text()
    assert kept.lines == 5 and "mark=536" in text and " cycle" in text
    assert read_marked(tmp_path / "b.txt", takes) == marked
    write(tmp_path / "c.txt", merge(parse(tmp_path / "b.txt"), [], [takes])[0])
    assert (tmp_path / "c.txt").read_text() == text


@pytest.mark.parametrize(
    ("line", "wrong"),
    [
        (
            row("duck_under", 10, 60, "a", "mark=60"),
            ":1: mark=60 is outside of the action 10 to 60",
        ),
        (row("duck_under", 10, 60, "a", "mark=9"), ":1: mark=9 is outside .* from 10 to 58"),
        (
            row("duck_under", 10, 60, "a", "mark=x"),
            ":1: 'x' is not a frame; expected a frame behind",
        ),
        (row("duck_under", 10, 60, "a", "mark=20 mark=30"), ":1: .* expected one mark=FRAME"),
        (row("duck_under", 10, 60, "a", "mark=20 cycle"), ":1: mark=20 and cycle; expected one"),
        (row("duck_under", 10, 99999, "a", "mark=20"), ":1: stop 99999 is outside clip"),
        (row("duck_undr", 10, 60, "a", "mark=20"), ":1: unknown clip 'duck_undr'"),
        (
            row("duck_under", 10, 60, "a", "cycle"),
            "txt: no action is a target motion; expected mark=",
        ),
        (row("duck_under", 10, 60, "a"), "txt: no action is a target motion"),
        ("", "txt: the file is empty"),
    ],
)
def test_marks_that_do_not_fit(takes: ClipSet, tmp_path: Path, line: str, wrong: str):
    path = tmp_path / "actions.txt"
    path.write_text(line)
    with pytest.raises(KumiteError, match=wrong):
        read_marked(path, takes)


# Commands -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def files(takes: ClipSet, made, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("mocap")
    for clip in made.clips:
        if clip.name in TAKES:
            write_bvh(folder / f"{clip.name}.bvh", clip)
    return folder


def test_build_finds_targets_by_itself(run, files: Path, tmp_path: Path):
    code, text, err = run("build", files, "-o", "p.kumite", "--layer", "preparation", "--most", 1)
    assert code == 0, err
    assert "3 target motions:" in text and "under: gets under a bar" in text
    assert "over: gets over a hurdle 0." in text
    assert "right_foot_kick: strikes with the right foot" in text
    code, told, _ = run("info", "p.kumite", "--json")
    values = json.loads(told)
    assert code == 0 and list(values["layers"]) == ["preparation"]
    assert {t["kind"] for t in values["layers"]["preparation"]["target_motions"]} == {
        "strike",
        "under",
        "over",
    }
    code, text, _ = run("info", "p.kumite")
    assert code == 0 and "cores: " in text


def test_build_takes_marks_from_a_file(run, files: Path, tmp_path: Path):
    (tmp_path / "a.txt").write_text(
        row("duck_under", 509, 654, "duck", "mark=536")
        + row("jump_over", 570, 640, "jump", "mark=598")
    )
    build = ("build", files, "-o", "p.kumite", "--layer", "preparation", "--actions", "a.txt")
    code, text, err = run(*build, "--alike", 1.0, "--threshold", 1e-9)
    assert code == 0, err
    library = only(load_library(tmp_path / "p.kumite"))
    assert prepared(library).hierarchy.targets.label == ("duck", "jump")
    assert prepared(library).hierarchy.alike == 1.0 and library.report["threshold"] == 1e-9
    for t, label in enumerate(("duck", "jump")):
        fell_back = f"{label}: no frame fits, its first frame is taken" in text
        assert fell_back == (not prepared(library).found[t])
        assert fell_back == (label in library.report["fall_back"])
    assert not prepared(library).found.all()


def test_build_for_preparation_is_refused(run, files: Path, tmp_path: Path):
    (tmp_path / "a.txt").write_text(row("duck_under", 509, 654, "duck", "mark=536"))
    build = ("build", files, "-o", "p.kumite", "--layer")
    for arguments, wrong in (
        (("preparation", "--most-ways", 3), "--most-ways: of --layer actions"),
        (("preparation", "--avoidance"), "--avoidance: of --layer frames or actions"),
        (("frames", "--threshold", 3), "--threshold: of --layer preparation"),
        (("preparation", "--most", 3, "--actions", "a.txt"), "--most: of targets that are found"),
        (("preparation", "--threshold", -1), "threshold -1.0 rad²"),
        (("preparation", "--alike", 0), "alike 0.0 rad"),
        (("preparation", "--actions", "none.txt"), "none.txt"),
    ):
        code, _, err = run(*build, *arguments)
        assert code == 2 and wrong in err, arguments
        assert not (tmp_path / "p.kumite").exists()


# Real clips ---------------------------------------------------------------------------------------


@pytest.mark.slow
def test_real_clips_are_built_by_themselves_and_from_a_file(run, mocap: Path, tmp_path: Path):
    names = "1_walk_crawl_walk 1_run_straight_1 1_flying_kick 3_walk 3_pass_jump 3_walk_stop_walk"
    sources = [mocap / "woody" / f"{name}.amc" for name in names.split()]
    code, _, err = run("build", *sources, "-o", "p.kumite", "--layer", "preparation")
    assert code == 0, err
    library = only(load_library(tmp_path / "p.kumite"))
    preparing, clips = prepared(library), library.clips
    targets = preparing.hierarchy.targets
    assert {"stand", "walk"} <= set(preparing.hierarchy.cores.label)
    kinds = {
        (clips.names[clips.clip_of_frame[a]], KINDS[k])
        for a, k in zip(targets.start, preparing.kind)
    }
    assert ("1_walk_crawl_walk", "under") in kinds and ("3_pass_jump", "over") in kinds
    assert ("1_flying_kick", "strike") in kinds
    crawl = [
        t
        for t, a in enumerate(targets.start)
        if clips.clip_of_frame[a] == clips.names.index("1_walk_crawl_walk")
    ]
    assert all(0.5 < preparing.clear[t] < 1.0 for t in crawl)
    (tmp_path / "a.txt").write_text(
        row("1_walk_crawl_walk", 10, 216, "crawl", "mark=60")
        + row("3_pass_jump", 645, 735, "jump", "mark=675")
    )
    code, _, err = run(
        "build", *sources, "-o", "q.kumite", "--layer", "preparation", "--actions", "a.txt"
    )
    assert code == 0, err
    marked = prepared(only(load_library(tmp_path / "q.kumite")))
    assert marked.hierarchy.targets.label == ("crawl", "jump")
    assert [KINDS[k] for k in marked.kind] == ["under", "over"]


@pytest.mark.slow
def test_a_boxers_targets_are_blows_and_ducks(mocap: Path):
    clips = mocap_files.load(mocap / "boxer").clip_set()
    contacts, strikes = find_contacts(clips), find_strikes(clips)
    targets, cycles = find_targets(clips, contacts, strikes)
    library = build_preparation(clips, targets, cycles, contacts=contacts, strikes=strikes)
    for t, label in enumerate(targets.label):
        clip = clips.names[clips.clip_of_frame[targets.start[t]]]
        if clip in ("jab_left", "jab_right", "straight_right"):
            side = clip.split("_")[1]
            assert label.startswith(f"{side}_hand_") and prepared(library).kind[t] == 0
    assert {"left_hand_straight", "right_hand_straight", "under"} <= set(targets.label)
