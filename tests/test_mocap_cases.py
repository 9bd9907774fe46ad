"""Files as they come: odd layouts, channels, axes, units and poses, against a slow reading of each.

The files in tests/cases were written by hand; the slow twin follows every channel as BVH says.
"""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kumite.annotate import find_strikes
from kumite.clip import Clip, forward_kinematics
from kumite.errors import KumiteError
from kumite.mocap import load
from kumite.mocap.bvh import read_bvh
from kumite.mocap.folder import MOST_STRETCH, Loaded
from kumite.mocap.rigid import fixed_bones
from tests.bvh_twin import rows_of, slow_positions, turn_about, with_rows

CASES = Path(__file__).parent / "cases"
WALK = CASES / "13c_comment.bvh"  # forty frames of a walk, every joint as usual


def places(clip: Clip) -> dict[str, np.ndarray]:
    position, _ = forward_kinematics(clip.skeleton, clip.root_position, clip.wxyz)
    return {name: position[:, j] for j, name in enumerate(clip.skeleton.names)}


def assert_same(
    loaded: Loaded, slow: dict[str, np.ndarray], axes=(1, 1, 1), first: int = 0
) -> None:
    """Every joint lies within 0.1 mm of where the slow twin has it, in centimetres."""
    (clip,) = loaded.clips
    up = np.array([0.0, loaded.info[0].ground_height, 0.0])
    for name, place in places(clip).items():
        expected = slow[name][first:] * 0.01 * np.array(axes) - up
        np.testing.assert_allclose(place, expected, atol=1e-4, err_msg=name)


def blows(loaded: Loaded) -> int:
    return len(find_strikes(loaded.clip_set()))


def height(loaded: Loaded, role: str) -> float:
    return float(places(loaded.clips[0])[loaded.info[0].roles[role]][0, 1])


def said(loaded: Loaded) -> str:
    return "\n".join(loaded.report())


# The cases ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "axes", "first", "note"),
    [
        ("01_frames_one_more", (1, 1, 1), 0, "40 whole rows of motion are read, 39 are declared"),
        ("03c_sjis", (1, 1, 1), 0, "not UTF-8, read as Shift-JIS; else say --encoding"),
        ("11c_reference_prop", (1, 1, 1), 0, "what hangs beside Hips was left out: Sword"),
        ("13c_comment", (1, 1, 1), 0, ""),
        ("15b_tpose_then_still", (1, 1, 1), 1, "the first frame (a T or rest pose) left out"),
        ("17c_yneg", (1, -1, -1), 0, "up_axis: -Y (inferred: heads are above feet"),
        ("30_arms_on_neck", (1, 1, 1), 0, "chest=Chest"),
    ],
)
def test_cases_are_where_the_file_has_them(
    name: str, axes: tuple[int, int, int], first: int, note: str
) -> None:
    loaded = load(CASES / f"{name}.bvh")
    slow = slow_positions(CASES / f"{name}.bvh")
    assert_same(loaded, slow, axes, first)
    assert note in said(loaded)
    assert height(loaded, "head") == pytest.approx(1.6, abs=0.05)
    assert -0.02 < height(loaded, "left_toe") < 0.1
    assert loaded.info[0].roles["chest"] == "Chest" and blows(loaded) == 0
    travel = np.linalg.norm(
        places(loaded.clips[0])["Hips"][-1] - places(loaded.clips[0])["Hips"][0]
    )
    assert travel == pytest.approx(0 if "still" in name else 1.56, abs=1e-6)


def test_the_users_rate_beats_no_rate(tmp_path: Path, run) -> None:
    shutil.copy(CASES / "02_ft0.bvh", tmp_path)
    with pytest.raises(
        KumiteError, match=r"ft0\.bvh:129: Frame Time: '0\.0'.*--file-fps, or file_fps"
    ):
        load(tmp_path)
    loaded = load(tmp_path, file_fps=100)
    assert loaded.clips[0].fps == 100 and len(loaded.clips[0]) == 40
    assert_same(loaded, slow_positions(tmp_path / "02_ft0.bvh"))
    status, out, _ = run("info", tmp_path, "--file-fps", 100, "--json")
    assert status == 0 and json.loads(out)["clips"][0]["fps"] == 100
    (tmp_path / "kumite.toml").write_text("file_fps = 50\n")
    assert load(tmp_path).clips[0].fps == 50
    for odd in ("30", "nan", "", "-1", "x"):  # whatever stands there
        text = (CASES / "02_ft0.bvh").read_text().replace("Frame Time: 0.0", f"Frame Time: {odd}")
        (tmp_path / "02_ft0.bvh").write_text(text)
        assert load(tmp_path).clips[0].fps == 50


# Position channels below the root ----------------------------------------------------------------


def wrapped(tmp_path: Path, reference: list[list[float]]) -> Path:
    """The case with a prop, a joint more above it all, which moves as told [F][6]."""
    head, rows = rows_of(CASES / "11c_reference_prop.bvh")
    channels = "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
    head = head.replace(
        "ROOT Reference", f"ROOT World\n{{\nOFFSET 0 0 0\n{channels}\nJOINT Reference"
    )
    path = tmp_path / "wrapped.bvh"
    rows = [[*above, *row] for above, row in zip(reference, rows)]
    path.write_text(with_rows(head.replace("MOTION", "}\nMOTION"), rows))
    return path


def test_hips_two_levels_down_are_followed_under_a_moving_reference(tmp_path: Path) -> None:
    t = np.arange(40.0)
    moving = np.stack([3 * t, 0 * t, -2 * t, 0 * t, 0 * t, 4 * t], axis=1).tolist()
    path = wrapped(tmp_path, moving)
    loaded = load(path)
    assert_same(loaded, slow_positions(path))
    assert loaded.clips[0].skeleton.names[0] == "Hips"
    assert "joints World, Reference above Hips were merged into it" in said(loaded)


def test_a_part_of_the_body_beside_moving_hips_is_not_left_out() -> None:
    """What hangs there is told to be the head: refused, not dropped."""
    with pytest.raises(KumiteError, match=r"channels move joint 'Hips' .* up to 0\.\d\d m from"):
        load(CASES / "11c_reference_prop.bvh", roles={"head": "Sword"})


def with_positions(tmp_path: Path, joint: str, position: np.ndarray, turn: float = 0.0) -> Path:
    """The walk with position channels of one joint [F, 3]; the root turns ``turn`` ° a frame."""
    head, rows = rows_of(WALK)
    lines = head.split("\n")
    at = next(k for k, line in enumerate(lines) if line.strip() == f"JOINT {joint}")
    before = sum(int(c) for c in re.findall(r"CHANNELS (\d)", "\n".join(lines[:at])))
    lines[at + 3] = lines[at + 3].replace("CHANNELS 3", "CHANNELS 6 Xposition Yposition Zposition")
    for f, row in enumerate(rows):
        row[5] = turn * f
        row[before:before] = position[f].tolist()
    path = tmp_path / "moved.bvh"
    path.write_text(with_rows("\n".join(lines), rows))
    return path


def plain(tmp_path: Path, turn: float = 0.0) -> dict[str, np.ndarray]:
    head, rows = rows_of(WALK)
    for f, row in enumerate(rows):
        row[5] = turn * f
    (tmp_path / "plain.txt").write_text(with_rows(head, rows))
    return slow_positions(tmp_path / "plain.txt")


def test_positions_in_the_world_are_known(tmp_path: Path) -> None:
    loaded = load(CASES / "21_world_pos.bvh")
    assert_same(loaded, slow_positions(WALK))
    assert "position channels of Chest, Head are places in the world" in said(loaded)
    slow = plain(tmp_path, turn=9)
    in_world = with_positions(tmp_path, "Chest", slow["Chest"], turn=9)
    assert_same(load(in_world), slow)
    in_axes = with_positions(tmp_path, "Chest", slow["Chest"] - slow["Spine"], turn=9)
    assert_same(load(in_axes), slow)
    shift = with_positions(tmp_path, "Chest", np.zeros((40, 3)))
    assert_same(load(shift), slow_positions(WALK))


def test_bones_that_change_length_within_bounds_are_held_and_beyond_refused(tmp_path: Path) -> None:
    offset = np.array([0.0, 22.0, 0.0])
    wave = np.sin(np.arange(40.0))[:, None] * [0, 1, 0]
    path = with_positions(tmp_path, "Chest", offset + 2 * wave)
    slow, held = slow_positions(path), places(load(path).clips[0])
    gap = max(np.linalg.norm(held[n] - slow[n] * 0.01, axis=1).max() for n in slow)
    assert gap == pytest.approx(0.02, rel=0.1) and gap < MOST_STRETCH
    shaken = load(with_positions(tmp_path, "Chest", 2 * wave))  # around zero: beside OFFSET
    assert height(shaken, "head") == pytest.approx(1.59, abs=0.03)
    for position in (offset + 20 * wave, offset + np.arange(40.0)[:, None] * [0, 0, 4]):
        path = with_positions(tmp_path, "Chest", position)
        with pytest.raises(
            KumiteError, match=r"joint 'Chest'.* m from where the file has them; ex"
        ):
            load(path)
        assert_same(load(path, joint_positions="offsets"), slow_positions(WALK))
        (tmp_path / "kumite.toml").write_text('joint_positions = "offsets"\n')
        assert_same(load(path), slow_positions(WALK))
        (tmp_path / "kumite.toml").unlink()


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_any_hierarchy_is_where_its_channels_put_it(
    tmp_path_factory: pytest.TempPathFactory, seed: int
) -> None:
    """Within 0.1 mm of metres, or as far off as it says."""
    rng = np.random.default_rng(seed)
    count, frames = int(rng.integers(2, 9)), 3
    parents = [-1, *(int(rng.integers(0, k)) for k in range(1, count))]
    children = [[c for c in range(count) if parents[c] == j] for j in range(count)]
    order: list[int] = []
    widths: list[int] = []

    def text(j: int) -> str:
        order.append(j)
        moves = rng.random() < (0.9 if j == 0 else 0.25)
        axes = rng.permutation(3)[: rng.integers(0, 4)]
        channels = [f"{'XYZ'[a]}position" for a in rng.permutation(3)] if moves else []
        channels += [f"{'XYZ'[a]}rotation" for a in axes]
        widths.append(len(channels))
        x, y, z = rng.uniform(0.2, 0.6, 3)
        inner = "".join(text(c) for c in children[j]) or "End Site { OFFSET 0 0.1 0 }\n"
        key = "ROOT" if j == 0 else "JOINT"
        names = f"CHANNELS {len(channels)} {' '.join(channels)}\n"
        return f"{key} j{j}\n{{ OFFSET {x} {y} {z}\n{names}{inner}}}\n"

    head = text(0)
    if sum(widths) == 0:
        return
    still = rng.uniform(0.3, 1.0, sum(widths))
    rows = [
        (still + (rng.random() < 0.5) * rng.normal(size=len(still))).tolist() for _ in range(frames)
    ]
    path = tmp_path_factory.getbasetemp() / "any.bvh"
    path.write_text(with_rows(f"HIERARCHY\n{head}MOTION\nFrames: 0\nFrame Time: 0.01", rows))
    pelvis = int(rng.integers(0, count))
    slow = slow_positions(path)
    raw = read_bvh(path)
    raw, roles = fixed_bones(raw, {"pelvis": raw.skeleton.names.index(f"j{pelvis}")})
    assert raw.skeleton.names[roles["pelvis"]] == f"j{pelvis}"
    position, _ = forward_kinematics(raw.skeleton, raw.root_position, raw.wxyz)
    gap = max(
        float(np.linalg.norm(position[:, j] - slow[name], axis=1).max())
        for j, name in enumerate(raw.skeleton.names)
    )
    allowed = raw.stretch.distance if raw.stretch is not None else 0.0
    assert gap == pytest.approx(allowed, abs=1e-4)


# Axes and units ----------------------------------------------------------------------------------

TURNS = {"Y": (0, 0), "Z": (0, 90), "X": (2, -90), "-Y": (0, 180), "-Z": (0, -90), "-X": (2, 90)}


def turned(tmp_path: Path, axis: str, *, rest: bool) -> Path:
    """The walk in a world whose up is another: offsets and root turned, or the root alone."""
    k, degrees = TURNS[axis]
    turn = turn_about(k, degrees)[:3, :3]
    head, rows = rows_of(WALK)
    if rest:  # of this walk only X turns, which no turn about X changes; others change its sign
        head = re.sub(
            r"OFFSET (\S+) (\S+) (\S+)",
            lambda m: (
                "OFFSET " + " ".join(map(repr, (turn @ [float(v) for v in m.groups()]).tolist()))
            ),
            head,
        )
        rows = [[0.0] * len(row) for row in rows]
    for f, row in enumerate(rows):
        row[:3] = (turn @ [0.0, 94.0, 4.0 * f]).tolist()
        if not rest:
            row[3:6] = [float(degrees), 0.0, 0.0] if k == 2 else [0.0, float(degrees), 0.0]
    path = tmp_path / "turned.bvh"
    path.write_text(with_rows(head, rows))
    return path


@pytest.mark.parametrize("axis", TURNS)
def test_people_stand_whichever_axis_is_up(tmp_path: Path, axis: str) -> None:
    path = turned(tmp_path, axis, rest=True)
    loaded = load(path)
    assert loaded.info[0].up_axis == axis and loaded.doubts() == []
    slow = slow_positions(path)
    k, sign = "XYZ".index(axis[-1]), -1.0 if axis.startswith("-") else 1.0
    for name, place in places(loaded.clips[0]).items():
        high = sign * slow[name][:, k] * 0.01 - loaded.info[0].ground_height
        np.testing.assert_allclose(place[:, 1], high, atol=1e-4)
    left, right = (places(loaded.clips[0])[f"{s}UpLeg"][0] for s in ("Left", "Right"))
    toe = places(loaded.clips[0])["LeftToeBase"][0] - places(loaded.clips[0])["LeftFoot"][0]
    assert np.cross(left - right, toe)[1] < 0  # not mirrored


def test_an_axis_that_only_the_motion_shows_is_asked_for(tmp_path: Path) -> None:
    for axis in ("X", "-X", "-Y", "-Z"):
        path = turned(tmp_path, axis, rest=False)
        with pytest.raises(KumiteError, match=f"along {axis} in the motion.*say --up-axis, or up_"):
            load(path)
        assert height(load(path, up_axis=axis), "head") == pytest.approx(1.59, abs=0.05)
    usual = load(turned(tmp_path, "Z", rest=False))
    assert usual.info[0].up_axis == "Z" and "say --up-axis" in usual.doubts()[0]


@pytest.mark.parametrize(
    ("leg", "unit", "outcome"),
    [
        (0.54, 0.0254, "doubt"),  # not a giant in CMU's units
        (0.86, 0.0254 / 0.45, "sure"),
        (0.51, 0.0254, "refused"),  # or legs of 1.13 m in CMU's
        (0.86, 0.1, "refused"),
    ],
)
def test_units_in_doubt(tmp_path: Path, leg: float, unit: float, outcome: str) -> None:
    head, rows = rows_of(WALK)
    scale = leg / 0.82 / 100 / unit
    head = re.sub(
        r"OFFSET (\S+) (\S+) (\S+)",
        lambda m: "OFFSET " + " ".join(repr(float(v) * scale) for v in m.groups()),
        head,
    )
    rows = [[*(v * scale for v in row[:3]), *row[3:]] for row in rows]
    (tmp_path / "x.bvh").write_text(with_rows(head, rows))
    if outcome == "refused":
        with pytest.raises(
            KumiteError, match=r"the legs fit .*say --metres-per-unit, or metres_per"
        ):
            load(tmp_path)
    else:
        loaded = load(tmp_path)
        assert loaded.info[0].metres_per_unit == pytest.approx(unit)
        assert len(loaded.doubts()) == (outcome == "doubt")
    assert height(load(tmp_path, metres_per_unit=unit), "head") == pytest.approx(
        1.6 * leg / 0.82, abs=0.1
    )


# T poses -----------------------------------------------------------------------------------------


def posed(tmp_path: Path, weights: np.ndarray, fps: float) -> Loaded:
    """Somebody who stands, and in a T pose as far as told, 0 to 1, in each frame."""
    head, (t_pose, still, *_) = rows_of(CASES / "15b_tpose_then_still.bvh")
    rows = [(np.array(still) * (1 - w) + np.array(t_pose) * w).tolist() for w in weights]
    (tmp_path / "posed.bvh").write_text(with_rows(head, rows, 1 / fps))
    return load(tmp_path)


@pytest.mark.parametrize("fps", [30, 60, 120])
@pytest.mark.parametrize("count", [1, 2, 5, 40])
def test_t_poses_at_the_ends_are_left_out(tmp_path: Path, fps: float, count: int) -> None:
    weights = np.zeros(120)
    weights[:count] = 1
    for w in (weights, weights[::-1]):
        loaded = posed(tmp_path, w, fps)
        assert len(loaded.clips[0]) == 120 - count and blows(loaded) == 0
        assert loaded.info[0].frames == 120 and "--keep-t-pose" in said(loaded)
    weights[count] = 0.5  # smoothed on its way
    assert blows(posed(tmp_path, weights, fps)) == 0
    kept = load(tmp_path, keep_t_pose=True)
    assert len(kept.clips[0]) == 120


def test_arms_that_sink_from_a_t_pose_are_motion(tmp_path: Path) -> None:
    weights = np.clip(1 - np.arange(120) / 40, 0, 1)  # in two thirds of a second, at 60 Hz
    assert len(posed(tmp_path, weights, 60).clips[0]) == 120


# Folders -----------------------------------------------------------------------------------------


def test_bad_files_hide_no_folder(tmp_path: Path, run) -> None:
    folder = tmp_path / "mocap"
    folder.mkdir()
    for name in ("01_frames_one_more", "02_ft0", "13c_comment"):
        shutil.copy(CASES / f"{name}.bvh", folder)
    (folder / ".stale.bvh").write_text("HIER")  # hidden: not a take
    status, out, err = run("info", folder)
    assert status == 3 and "13c_comment" in out and "2 clips" in out
    assert re.search(r"left out: .*02_ft0\.bvh:129: Frame Time", err) and "stale" not in err
    status, out, _ = run("info", folder, "--json")
    told = json.loads(out)
    assert status == 3 and len(told["clips"]) == 2
    assert "129" in told["bad"][0]["reason"] and told["bad"][0]["source"].endswith("02_ft0.bvh")
    actions = tmp_path / "a.txt"
    status, _, err = run("segment", folder, "-o", actions)
    assert status == 2 and "say --skip-bad" in err and not actions.exists()
    status, _, err = run("segment", folder, "-o", actions, "--skip-bad")
    assert status == 0 and "left out: " in err and actions.exists()
    assert run("likeness", folder)[0] == 2 and run("likeness", folder, "--skip-bad")[0] == 0
    assert run("build", folder, "-o", "x.kumite")[0] == 2
    status, _, err = run("info", folder / "02_ft0.bvh")
    assert status == 2 and "--skip-bad" not in err


def test_a_broken_kumite_toml_is_never_gone_on_without(tmp_path: Path) -> None:
    shutil.copy(WALK, tmp_path)
    (tmp_path / "kumite.toml").write_text("fsp = 3")
    with pytest.raises(KumiteError, match="unknown key 'fsp'"):
        load(tmp_path, skip_bad=True)
