"""The command line, as a user meets it: what it prints, what it writes, how it fails."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.core import TyperGroup as Group
from typer.main import get_command

from kumite.cli.app import app
from kumite.cli.progress import Lines, Stages
from kumite.clip import forward_kinematics
from kumite.export.bvh import write_bvh
from kumite.graph import Layer, load_library, save_library
from kumite.graph.library_file import VERSION
from kumite.mocap import load
from kumite.performer import STYLES, perform
from kumite.scene import World, load_recording
from tests import toys
from tests.shared import only


@pytest.fixture(scope="module")
def built(library: Layer, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A library file, in a folder of its own."""
    path = tmp_path_factory.mktemp("built") / "built.kumite"
    save_library(path, library)
    return path


@pytest.fixture(scope="module")
def built_whole(whole: Layer, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A library of whole actions."""
    path = tmp_path_factory.mktemp("built") / "whole.kumite"
    save_library(path, whole)
    return path


@pytest.fixture
def kumite(run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """Run a command line in a folder of its own, with a cache of its own."""
    monkeypatch.setenv("KUMITE_CACHE", str(tmp_path / "cache"))
    return run


def test_from_mocap_files_to_a_fight(kumite, library: Layer, tmp_path: Path):
    """info → build → run → metrics → export, on BVH files."""
    for clip in library.clips:
        write_bvh(tmp_path / "mocap" / f"{clip.name}.bvh", clip)
    status, text, _ = kumite("info", "mocap", "--json", "--plot", "hits.png")
    assert status == 0 and (tmp_path / "hits.png").stat().st_size > 10_000
    info = json.loads(text)
    status, table, _ = kumite("info", "mocap")
    assert status == 0 and all(name in table for name in library.clips.names)  # none cut short
    assert {c["name"] for c in info["clips"]} == set(library.clips.names)
    assert info["metres_per_unit"] == 0.01 and info["roles"]["left_hand"]
    first = info["clips"][0]
    assert set(first["hits"]) == {"left_hand", "right_hand", "left_foot", "right_foot"}
    assert first["seconds"] == pytest.approx(first["frames"] / first["fps"], abs=1e-3)
    assert sum(sum(c["hits"].values()) for c in info["clips"]) == len(library.strikes)

    status, text, _ = kumite("build", "mocap", "-o", "my.kumite")
    assert status == 0 and "actions" in text and "states" in text
    outs = ["--out", "fight.rec", "--out", "fight.glb"]
    status, text, _ = kumite(
        "run", "sparring", "--library", "my.kumite", "--seconds", "4", "--seed", "1", *outs
    )
    assert status == 0 and "wrote fight.glb" in text
    assert (tmp_path / "fight.glb").read_bytes()[:4] == b"glTF"
    assert list((tmp_path / "my.kumite.cache").glob("*.policy"))

    status, text, _ = kumite("metrics", "fight.rec", "--json")
    m = json.loads(text)
    assert status == 0 and m["seconds"] == pytest.approx(4.0)
    assert m["min_separation_m"] > 0
    keys = {"name", "thrown", "landed", "skate_m_s", "skate_ratio", "facing_share", "join_jump_m_s"}
    assert all(keys <= set(c) for c in m["characters"])

    status, _, _ = kumite("export", "fight.rec", "-o", "red.bvh", "--character", "red")
    assert status == 0
    back = load(tmp_path / "red.bvh").clips[0]
    red = load_recording(tmp_path / "fight.rec").clip("red")
    a, _ = forward_kinematics(red.skeleton, red.root_position, red.wxyz)
    b, _ = forward_kinematics(back.skeleton, back.root_position, back.wxyz)
    assert np.abs(a - b).max() < 1e-3


def test_from_mocap_files_to_a_graph_of_actions(
    kumite, whole: Layer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """segment → an edit → build --level actions → info → studio, on BVH files."""
    for clip in list(whole.clips)[:6]:
        write_bvh(tmp_path / "mocap" / f"{clip.name}.bvh", clip)
    status, *_ = kumite("segment", "mocap", "-o", "mine.txt")
    assert status == 0
    text = (tmp_path / "mine.txt").read_text()
    line = next(row for row in text.splitlines() if "  attack " in row)
    label = line.split()[-2]
    changed = line.replace(f" {label} ", ' "my own" ')
    (tmp_path / "mine.txt").write_text(text.replace(line, changed))
    options = ["--layer", "actions", "--actions", "mine.txt", "--alike", "1.5", "--most-ways", "9"]
    status, text, err = kumite("build", "mocap", "-o", "my.kumite", *options)
    assert status == 0, err
    found = only(load_library(tmp_path / "my.kumite"))
    assert found.actions is not None and "my own" in found.actions.label
    assert f"{len(found.actions)} actions, {found.report['stretches']} of them connected" in text
    assert f"{found.report['nodes']} nodes of postures alike within 1.5 rad" in text

    status, again, _ = kumite("info", "my.kumite")
    rows = [row for row in again.splitlines() if not row.startswith(("clips: ", "skeleton: "))]
    assert status == 0 and len(rows) >= 3 and all(row in text for row in rows)
    assert all(f"{c.name} {c.seconds:.3g}"[:-1] in again for c in found.clips)
    values = json.loads(kumite("info", "my.kumite", "--json", "--plot", "hits.png")[1])
    assert list(values["layers"]) == ["actions"] and values["clips"] == 6
    ways = np.diff(found.table.action_start)
    assert ways.max() == 9
    assert values["layers"]["actions"]["ways_on"] == {
        "least": ways.min(), "most": ways.max(), "mean": round(ways.mean(), 4),
    }  # fmt: skip
    assert (tmp_path / "hits.png").stat().st_size > 10_000

    monkeypatch.setenv("DEMO_SECONDS", "1")
    status, text, err = kumite("studio", "my.kumite", "--port", "0", "--no-browser")
    assert status == 0 and "http://127.0.0.1:" in text, err


def test_a_library_of_frames_says_what_it_holds(kumite, built: Path, library: Layer):
    status, text, _ = kumite("info", built)
    r = library.report
    assert status == 0 and f"{r['states']} states, {r['actions']} actions of" in text
    assert f"mean join cost {r['mean_join_cost']:.2f}" in text
    values = json.loads(kumite("info", built, "--json")[1])
    assert values["layers"]["frames"]["states"] == r["states"]


def test_policies_plan_on_a_graph_of_actions(kumite, built_whole: Path):
    status, text, err = kumite(
        "run", "sparring", "-l", built_whole, "--seconds", "10", "--seed", "1", "--json"
    )
    assert status == 0, err
    fought = json.loads(text)
    assert sum(c["landed"] for c in fought["characters"]) >= 2
    assert fought["min_separation_m"] > 0.25


def test_the_built_in_performer_needs_no_files(kumite, tmp_path: Path):
    status, text, err = kumite("run", "sparring", "--seconds", "3", "--json")
    assert status == 0, err
    assert [c["name"] for c in json.loads(text)["characters"]] == ["red", "blue"]
    assert list((tmp_path / "cache").glob("performer-*.kumite"))


def test_runs_with_one_seed_are_the_same_bytes(kumite, built: Path, tmp_path: Path):
    for name in ("a", "b"):
        status, *_ = kumite(
            "run", "sparring", "-l", built, "--seconds", "2", "--seed", "5", "-o", f"{name}.rec",
            "-o", f"{name}.glb",
        )  # fmt: skip
        assert status == 0
    for ending in ("rec", "glb"):
        a, b = ((tmp_path / f"{n}.{ending}").read_bytes() for n in "ab")
        assert a == b, ending


@pytest.mark.slow
def test_the_number_of_threads_does_not_change_the_bytes(built: Path, tmp_path: Path):
    written = []
    for threads in ("1", "2"):
        path = tmp_path / f"{threads}.rec"
        command = [sys.executable, "-m", "kumite", "run", "sparring", "-l", str(built)]
        fresh = tmp_path / f"{threads}.kumite"  # a library of its own: policies are trained anew
        fresh.write_bytes(built.read_bytes())
        command[-1] = str(fresh)
        subprocess.run(
            [*command, "--seconds", "3", "-o", str(path)],
            env={**os.environ, "NUMBA_NUM_THREADS": threads},
            check=True,
            capture_output=True,
        )
        written.append(path.read_bytes())
    assert written[0] == written[1]


@pytest.mark.skipif(not Path("/dev/full").is_char_device(), reason="needs /dev/full")
@pytest.mark.parametrize("args", [["scenes"], ["scenes", "--json"], ["--help"]])
def test_output_to_a_full_disk_is_one_error(args):
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, "-m", "kumite", *args]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("error: cannot write to standard output (No space left")


def test_the_performers_clips_leave_as_bvh_with_their_truth(kumite, tmp_path: Path):
    status, text, _ = kumite("perform")
    assert status == 0 and all(style in text for style in STYLES)
    assert set(json.loads(kumite("perform", "--json")[1])) == set(STYLES)
    status, text, _ = kumite("perform", "sword", "-o", "out", "--seed", "4", "--no-mirrored")
    assert status == 0 and "wrote 9 clips to out" in text
    made = perform("sword", 4, mirrored=False)
    for clip, truth in zip(made.clips, made.truth):
        (read,) = load(tmp_path / "out" / f"{clip.name}.bvh", metres_per_unit=0.01).clips
        assert read.fps == pytest.approx(60)
        ours, _ = forward_kinematics(clip.skeleton, clip.root_position, clip.wxyz)
        theirs, _ = forward_kinematics(read.skeleton, read.root_position, read.wxyz)
        # Written to the millionth of a centimetre; put on its ground again when read.
        theirs = theirs[:, [read.skeleton.names.index(n) for n in clip.skeleton.names]]
        drop = ours[0, 0, 1] - theirs[0, 0, 1]
        assert abs(drop) < 0.05
        assert np.abs(ours - theirs - [0, drop, 0]).max() < 1e-4
        said = json.loads((tmp_path / "out" / f"{clip.name}.truth.json").read_text())
        assert [s["frame"] for s in said["strikes"]] == [s.frame for s in truth.strikes]
        planted = np.zeros((len(clip), 2), dtype=bool)
        for k, side in enumerate(("left", "right")):
            for start, stop in said["contacts"][side]:
                planted[start:stop, k] = True
        assert np.array_equal(planted, truth.on_ground)


def test_likeness_is_shown_side_by_side(kumite, tmp_path: Path):
    kumite("perform", "locomotion", "-o", "walks", "--no-mirrored")
    status, text, _ = kumite("likeness", "walks/walk.bvh", "--style", "locomotion")
    assert status == 0 and "step length (m)" in text and "locomotion" in text
    both = json.loads(kumite("likeness", "walks/walk.bvh", "--style", "locomotion", "--json")[1])
    assert set(both) == {"walks/walk.bvh", "locomotion"}
    assert 0.8 < both["walks/walk.bvh"]["step_length"][1] < 1.4


def test_a_crowd_of_any_number(kumite, built: Path):
    status, text, _ = kumite("run", "crowd", "-l", built, "--count", "44", "--seconds", "4")
    assert status == 0 and "4.0 s, 44 characters" in text and "landed" in text


def test_scenes_are_listed(kumite):
    status, text, _ = kumite("scenes")
    assert status == 0 and "sparring" in text and "target" in text
    status, text, _ = kumite("scenes", "--json")
    assert {"sparring", "target"} <= set(json.loads(text))


HEADER = """HIERARCHY
ROOT hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  End Site
  {
    OFFSET 0 1 0
  }
}
MOTION
"""


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("empty.bvh", "", "empty.bvh"),
        ("cut.bvh", HEADER[:60], "cut.bvh"),
        ("letters.bvh", HEADER + "Frames: 1\nFrame Time: 0.03\n0 0 0 0 x 0\n", "letters.bvh:14"),
        ("nan.bvh", HEADER + "Frames: 1\nFrame Time: 0.03\n0 0 0 0 nan 0\n", "nan.bvh:14"),
        ("count.bvh", HEADER + "Frames: 1\nFrame Time: 0.03\n0 0 0 0 0\n", "count.bvh:14"),
        ("few.bvh", HEADER + "Frames: 3\nFrame Time: 0.03\n0 0 0 0 0 0\n", "few.bvh"),
        ("time.bvh", HEADER + "Frames: 1\nFrame Time: 0\n0 0 0 0 0 0\n", "time.bvh:13"),
        ("limbs.bvh", HEADER + "Frames: 1\nFrame Time: 0.03\n0 0 0 0 0 0\n", "hand"),
        ("alone.amc", ":DEGREES\n1\nroot 0 0 0 0 0 0\n", "alone.amc"),
    ],
)
@pytest.mark.parametrize("command", ["info", "build"])
def test_bad_mocap_gets_one_clear_error(kumite, tmp_path, name, content, expected, command):
    (tmp_path / name).write_text(content)
    extra = ["-o", "out.kumite"] if command == "build" else []
    status, _, err = kumite(command, name, *extra)
    assert status == 2 and expected in err and "Traceback" not in err
    assert not list(tmp_path.glob("*.kumite")) and not list(tmp_path.glob(".*"))


def test_two_skeletons_in_one_library(kumite, tmp_path):
    from kumite.clip import Clip, Skeleton

    short = toys.still(40, name="short")
    s = short.skeleton
    tall = Skeleton(s.names, s.parents, s.offsets * 1.1, s.roles, s.tip_parents, s.tip_offsets)
    write_bvh(tmp_path / "short.bvh", short)
    write_bvh(tmp_path / "tall.bvh", Clip("tall", tall, 30, short.root_position * 1.1, short.wxyz))
    status, _, err = kumite("build", ".", "-o", "out.kumite")
    assert status == 2 and "two skeletons" in err
    status, text, _ = kumite("info", ".", "--json")
    assert status == 0 and len(json.loads(text)["clips"]) == 2


FRAMES = ["build", "still.bvh", "-o", "x.kumite", "--layer", "frames"]
WHOLE = ["build", "still.bvh", "-o", "x.kumite", "--layer", "actions"]


@pytest.mark.parametrize(
    ("args", "expected"),
    [
        (["info", "nowhere"], "nowhere"),
        (["info", ""], "an empty name"),
        (["info", "still.bvh", "--role", "fist=Hips"], "error: unknown role 'fist'"),
        (["build", "still.bvh", "-o", "x.kumite"], "too few frames for a graph"),
        (["build", "still.bvh", "-o", "x.kumite", "--event", "hop"], "unknown event 'hop'"),
        (["build", "still.bvh", "-o", "x.kumite", "--per-second", "0"], "per_second"),
        (["build", "still.bvh", "-o", "x.kumite", "--per-second", "inf"], "per_second inf"),
        (["build", "still.bvh", "-o", "x.kumite", "--layer", "action"], "did you mean 'actions'"),
        ([*FRAMES, "--alike", "1"], "--alike: of --layer actions or preparation"),
        ([*FRAMES, "--actions", "a.txt"], "--actions: of other layers; expected none with"),
        ([*WHOLE, "--event", "left"], "--event: of --layer frames"),
        ([*WHOLE, "--per-second", "9"], "--per-second: of --layer frames"),
        ([*WHOLE, "--most-ways", "1"], "most_ways 1; expected at least 2"),
        ([*WHOLE, "--alike", "-1"], "alike -1.0; expected more than 0 rad"),
        ([*WHOLE, "--actions", "none.txt"], "none.txt: cannot be read"),
        ([*WHOLE, "--actions", "still.bvh"], "still.bvh:1: "),
        (WHOLE, "too few actions for a graph"),
        (["info", "BUILT", "--fps", "30"], "--fps: of motion capture"),
        (["info", "none.kumite"], "none.kumite: cannot be read"),
        (["studio", "BUILT"], "the library has no layer 'actions' (it was not built)"),
        (["studio", "BUILT", "--count", "3"], "--count: of a scene"),
        (["studio", "none.kumite"], "none.kumite: cannot be read"),
        (
            ["build", "still.bvh", "-o", "x.kumite", "--fps", "1e9"],
            "at most 100000 frames a second",
        ),
        (
            ["run", "sparring", "-l", "BUILT", "--seconds", "1e9"],
            "seconds: 1e+09, expected at most",
        ),
        (["run", "x" * 5000], "unknown scene"),
        (["run", ""], "unknown scene"),
        (["build", "still.bvh", "-o", "x.kumite", "--role", "hand"], "ROLE=JOINT"),
        (["run", "spaning"], "did you mean sparring"),
        (["run", "sparring", "-l", "none.kumite"], "none.kumite: cannot be read"),
        (["run", "sparring", "-l", "still.bvh"], "not a file of Kumite's"),
        (["run", "sparring", "-l", "BUILT", "--seconds", "0"], "seconds"),
        (["run", "sparring", "-l", "BUILT", "-o", "x.mov"], "ending of x.mov"),
        (["run", "sparring", "-l", "BUILT", "-o", "x.rec", "-o", "x.bvh"], "--character NAME"),
        (["build", "still.bvh", "-o", "still.bvh/x.kumite"], "still.bvh is not a folder"),
        (["build", "still.bvh", "-o", "/dev/null"], "/dev/null: cannot be written (a device"),
        (["run", "sparring", "-l", "BUILT", "--seconds", "1", "-o", "still.bvh/x.rec"], "written"),
        (["metrics", "none.rec"], "none.rec: cannot be read"),
        (["metrics", "BUILT"], "this is a library; expected a recording"),
        (["studio", "spar"], "unknown scene 'spar'"),
        (["studio", "none.rec"], "none.rec: cannot be read"),
        (["bench", "--only", "nothing like it"], "no figure"),
        (["info", "still.bvh", "--plot", "x.png"], "no effective hits"),
        (["run", "sparring", "-l", "BUILT", "--count", "9"], "expected a scene with a [crowd]"),
        (["run", "crowd", "-l", "BUILT", "--count", "1"], "count: 1, expected at least 2"),
        (["run", "crowd", "-l", "BUILT", "--count", "999999999"], "expected at most 884450"),
        (["perform", "swrod"], "did you mean 'sword'"),
        (["perform", "-o", "x"], "name a style to write"),
        (["perform", "sword", "-o", "still.bvh/x"], "still.bvh/x: cannot be made"),
        (["likeness"], "name motion capture files"),
        (["likeness", "--style", "boxng"], "did you mean 'boxing'"),
    ],
)
def test_bad_input_ends_with_status_2_and_leaves_nothing(kumite, built, tmp_path, args, expected):
    write_bvh(tmp_path / "still.bvh", toys.still(40))
    status, _, err = kumite(*[str(built) if a == "BUILT" else a for a in args])
    assert status == 2 and expected in err and "Traceback" not in err
    left = {p.name for p in tmp_path.iterdir()} - {"still.bvh", "cache"}
    assert not left


NOBODY_TO_HIT = """title = "Alone"
[[character]]
name = "red"
position = [0, 0]
aims_at = "ball"
[[object]]
name = "ball"
position = [0, 1.5, 1]
"""
CROWD = 'title = "Many"\n[crowd]\n'


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            NOBODY_TO_HIT.replace("[[obj", "behaviours = { cirle = 1 }\n[[obj"),
            "error: unknown behaviour 'cirle'; did you mean 'circle' or 'circle_back'? (expected",
        ),
        (
            NOBODY_TO_HIT.replace("[[obj", "behaviours = { strike = 1 }\n[[obj"),
            "error: behaviours: strike has a weight of its own",
        ),
        (
            NOBODY_TO_HIT.replace("[[obj", "approach = 0\nstrike = 0\n[[obj"),
            "error: s.toml:2: character.0: all weights are 0; expected approach, strike or another",
        ),
        (CROWD + "approach = 0\nstrike = 0\n", "error: s.toml:2: crowd: all weights are 0"),
        (CROWD + "behaviours = { cirle = 1 }\n", "error: unknown behaviour 'cirle'"),
        (CROWD + "count = 0\n", "error: s.toml:3: crowd.count: 0; expected greater than or equal"),
        (
            CROWD + "count = 1000000\n",
            "error: s.toml:2: crowd: count: 1000000 at a spacing of 1.5 m do not find room within",
        ),
        (CROWD + "count = 2000000\n", "error: s.toml:3: crowd.count: 2000000; expected less than"),
        (
            NOBODY_TO_HIT.replace("1.5, 1]", "1.5, 2000]"),
            "error: s.toml:8: object.0.position.2: 2000; expected less than or equal to 1000",
        ),
        (NOBODY_TO_HIT.replace("1.5, 1]", "nan, 1]"), "error: s.toml:8: object.0.position.1: nan"),
    ],
)
def test_a_scene_that_cannot_be_run_is_one_line(kumite, built, tmp_path, text, expected):
    (tmp_path / "s.toml").write_text(text)
    status, _, err = kumite("run", "s.toml", "-l", built, "--seconds", "1", "-o", "x.rec")
    said = [line for line in err.splitlines() if line.startswith("error: ")]
    assert status == 2 and len(said) == 1 and expected in said[0] and "Traceback" not in err
    assert not (tmp_path / "x.rec").exists()


@pytest.mark.parametrize("count", ["0", "-3", "1"])
def test_a_count_below_two_is_refused(kumite, built, count):
    status, _, err = kumite("run", "crowd", "-l", built, "--count", count)
    assert status == 2 and f"error: count: {count}, expected at least 2" in err


@pytest.mark.parametrize(
    ("count", "free", "expected"),
    [
        (
            "950000",
            1e12,
            "error: count: 950000 at a spacing of 1.5 m do not find room within 1000 m; exp",
        ),
        ("60000", 1e8, "error: count: 60000 characters do not fit into memory; at most "),
    ],
)
def test_a_count_beyond_room_or_memory_is_refused(
    kumite, built, monkeypatch, count, free, expected
):
    monkeypatch.setattr("kumite.scene.memory.free_memory", lambda: float(free))
    status, _, err = kumite("run", "crowd", "-l", built, "--count", count)
    assert status == 2 and expected in err


@pytest.mark.parametrize("scene", ["sparring", "target", "crowd"])
def test_a_library_without_blows_is_refused(kumite, library: Layer, tmp_path, scene):
    """Walking people, say: nobody in it can strike, so no scene is run with it."""
    strikes = library.strikes
    rows = {f: getattr(strikes, f)[:0] for f in ("frame", "limb", "start", "stop", "velocity")}
    none = replace(strikes, effective=np.zeros_like(strikes.effective), **rows)
    save_library(tmp_path / "walk.kumite", replace(library, strikes=none))
    status, _, err = kumite("run", scene, "-l", "walk.kumite", "--seconds", "1")
    assert status == 2 and "error: the library holds no effective hits: nobody in it can" in err


def test_a_target_out_of_every_grid_is_walked_to(kumite, built, tmp_path):
    """The stated fallback: it counts as standing on the rim of the approach grid."""
    (tmp_path / "far.toml").write_text(NOBODY_TO_HIT.replace("1.5, 1]", "1.5, 900]"))
    status, *_ = kumite("run", "far.toml", "-l", built, "--seconds", "8", "-o", "far.rec")
    way = load_recording(tmp_path / "far.rec").root_position[:, 0, 2]
    assert status == 0 and way[-1] - way[0] > 1.0


def test_a_damaged_or_other_version_of_a_library(kumite, built: Path, tmp_path: Path):
    whole = built.read_bytes()
    (tmp_path / "cut.kumite").write_bytes(whole[: len(whole) // 2])
    status, _, err = kumite("run", "sparring", "-l", "cut.kumite")
    assert status == 2 and "cut.kumite: damaged" in err
    (tmp_path / "new.kumite").write_bytes(
        whole.replace(b'\\"version\\": %d' % VERSION, b'\\"version\\": 9', 1)
    )
    status, _, err = kumite("run", "sparring", "-l", "new.kumite")
    assert status == 2 and "version 9" in err


def test_the_studio_ends_by_itself(kumite, built: Path, monkeypatch):
    monkeypatch.setenv("DEMO_SECONDS", "2")
    status, text, _ = kumite("studio", "sparring", "-l", built, "--port", "0", "--no-browser")
    assert status == 0 and "http://127.0.0.1:" in text
    monkeypatch.setenv("DEMO_SECONDS", "soon")
    status, _, err = kumite("studio", "sparring", "-l", built)
    assert status == 2 and "DEMO_SECONDS" in err


@pytest.mark.slow
def test_bench_prints_its_rows(kumite, library: Layer, tmp_path):
    for clip in library.clips:
        write_bvh(tmp_path / "mocap" / f"{clip.name}.bvh", clip)
    status, text, err = kumite("bench", "mocap", "--only", "approach", "--json")
    assert status == 0, err
    (row,) = json.loads(text)
    assert set(row) >= {"name", "value", "unit", "limit", "peak_mb"}
    assert row["value"] > 0 and row["peak_mb"] > 50


# What commands say -------------------------------------------------------------------------------


def _commands() -> dict:
    command = get_command(app)
    assert isinstance(command, Group)
    return dict(command.commands)


@pytest.mark.parametrize("name", sorted(_commands()))
def test_help_is_printed_as_it_was_written(run, name: str):
    """Every word of every option's help, "[m/s]" too."""
    status, text, _ = run(name, "--help")
    printed = "".join(text.split())
    told = [p.help for p in _commands()[name].params if getattr(p, "help", None)]
    assert status == 0 and told
    for said in told:
        assert "".join(said.split()) in printed, said
    assert "--quiet" in printed


def test_progress_is_told_in_lines_where_there_is_no_terminal(monkeypatch, capsys):
    now = [0.0]
    monkeypatch.setattr("kumite.cli.progress.monotonic", lambda: now[0])
    lines = Lines()
    bar = lines.add("running", total=1.0)
    for step in range(1, 101):
        now[0] = 0.5 * step
        lines.update(bar, 0.01 * step)
    stages = Stages(lines)
    for stage in ("learning: batch 1", "learning: batch 2", "writing"):
        stages(stage)
    told = capsys.readouterr().err.splitlines()
    assert told == [
        "running",
        "running: 10%, 45 s left",
        "running: 30%, 35 s left",
        "running: 70%, 15 s left",
        "learning: batch 1",
        "writing",
    ]


def test_quiet_says_results_only(kumite, built: Path):
    for args in (["run", "sparring", "--quiet"], ["--quiet", "run", "sparring"]):
        status, text, err = kumite(*args, "-l", built, "--seconds", "1")
        assert status == 0 and "fight" in text and err == ""
    _, _, err = kumite("run", "sparring", "-l", built, "--seconds", "1")
    assert "running sparring" in err


@pytest.fixture
def ctrl_c():
    """Ctrl-C is heeded, also where these tests run in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_keeps_what_ran(kumite, built: Path, monkeypatch, tmp_path: Path):
    """Once: the recording ends there and is written. Twice: nothing is."""
    step, presses = World.step, []

    def pressed(scene) -> bool:
        if scene.frame in presses:
            signal.raise_signal(signal.SIGINT)
        return step(scene)

    monkeypatch.setattr(World, "step", pressed)
    args = ("run", "sparring", "-l", built, "--seconds", "9000", "-o", "cut.rec")
    presses[:] = [60]
    status, text, err = kumite(*args)
    assert status == 130 and "interrupted after" in err and "wrote cut.rec" in text
    cut = load_recording(tmp_path / "cut.rec")
    assert len(cut) == 62  # the frame in which it was pressed is kept
    (tmp_path / "cut.rec").unlink()
    monkeypatch.setattr(World, "step", step)
    kumite("run", "sparring", "-l", built, "--seconds", f"{62 / cut.fps}", "-o", "whole.rec")
    assert np.array_equal(load_recording(tmp_path / "whole.rec").wxyz, cut.wxyz)
    (tmp_path / "whole.rec").unlink()

    def twice(scene) -> bool:
        if scene.frame == 60:
            signal.raise_signal(signal.SIGINT)
            signal.raise_signal(signal.SIGINT)
        return step(scene)

    monkeypatch.setattr(World, "step", twice)
    status, text, err = kumite(*args)
    assert status == 130 and err.splitlines()[-1] == "interrupted" and "wrote" not in text
    assert not list(tmp_path.iterdir())
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_while_a_library_is_built_leaves_nothing(kumite, monkeypatch, tmp_path: Path):
    def pressed(*args, **options):
        signal.raise_signal(signal.SIGINT)

    for clip in perform("locomotion", mirrored=False).clips[:2]:
        write_bvh(tmp_path / "mocap" / f"{clip.name}.bvh", clip)
    monkeypatch.setattr("kumite.graph.library.find_strikes", pressed)
    status, _, err = kumite("build", "mocap", "-o", "my.kumite")
    assert status == 130 and err.splitlines()[-1] == "interrupted"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["mocap"]


def test_scene_names_are_completed(tmp_path: Path):
    (tmp_path / "spar_mine.toml").touch()
    (tmp_path / "spar_not.txt").touch()
    typed = {"COMP_WORDS": "kumite run spar", "COMP_CWORD": "2"}
    done = subprocess.run(
        [Path(sys.executable).parent / "kumite"],
        env={**os.environ, **typed, "_KUMITE_COMPLETE": "complete_bash"},
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.stdout.split() == ["sparring", "spar_mine.toml"], done.stderr


def test_scenes_say_what_they_need(kumite):
    told = json.loads(kumite("scenes", "--json")[1])
    assert told["crowd"]["characters"] == 30 and told["target"]["characters"] == 1
    assert all({"title", "shows", "characters", "needs"} <= set(s) for s in told.values())
    needs = {name: s["needs"] for name, s in told.items()}
    assert needs["sparring"]["level"] == "frames" and needs["boxing"]["physics"] == "if installed"
    assert needs["slip"]["level"] == "avoidance" and needs["slip"]["attackers"] == "boxing"
    assert needs["ball-kick"]["motions"] == ["walks", "kick"]
    assert needs["gauntlet"]["motions"][-2:] == ["walks", "under"]


def test_all_balls_are_thrown(kumite, tmp_path: Path):
    """As long as it takes; or, where a time is given, as fast as it takes."""
    status, text, err = kumite("run", "dodgeball", "--throws", "14", "--json", "-o", "d.rec")
    told = json.loads(text)
    assert status == 0 and told["seconds"] > 30
    assert told["reports"]["throws"]["dodger"]["thrown"] == 14
    assert told["reports"]["throws"]["dodger"]["in flight at the end"] == 0
    again = json.loads(kumite("metrics", "d.rec", "--json")[1])
    assert again == told
    args = ("run", "dodgeball", "--throws", "14", "--seconds", "10", "--json")
    status, text, err = kumite(*args)
    told = json.loads(text)
    assert told["seconds"] == pytest.approx(10) and "a ball every 0.54 s" in err
    assert told["reports"]["throws"]["dodger"]["thrown"] == 14
    status, _, err = kumite("run", "dodgeball", "--throws", "1000", "--seconds", "10")
    assert status == 2 and "expected at most 351" in err


def test_a_recording_says_what_it_holds(kumite, built: Path, library: Layer):
    kumite("run", "sparring", "-l", built, "--seconds", "4", "--seed", "7", "-o", "a.rec")
    status, text, _ = kumite("info", "a.rec")
    assert status == 0 and "Sparring, seed 7: 4.0 s" in text and "characters: red, blue" in text
    told = json.loads(kumite("info", "a.rec", "--json")[1])
    assert (
        told["library"]
        == json.loads(kumite("info", built, "--json")[1])["layers"]["frames"]["digest"]
    )
    assert told["joints"] == len(library.clips.skeleton)
    assert told["events"]["strike"] >= told["events"]["hit"]
    status, _, err = kumite("info", "a.rec", "--fps", "30")
    assert status == 2 and "a.rec is a recording" in err
