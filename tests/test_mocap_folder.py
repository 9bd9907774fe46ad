"""Folders of mocap: units, axes, floor, names, settings, and what goes wrong."""

from __future__ import annotations

import csv
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from kumite import rotation
from kumite.clip import Clip, Skeleton, check, forward_kinematics
from kumite.errors import KumiteError
from kumite.export.bvh import write_bvh
from kumite.mocap import sources
from kumite.mocap.folder import Loaded, find_asf, load

# The manifest's scale of these five is not a person's. By it the soccer players' hips are 4.8 m
# up: their files are in centimetres. The two walks share their skeleton, to the digit, with the
# thirty clips in inches beside them; taken as centimetres their hips are 0.40 m up.
MANIFEST_IS_WRONG = {
    "cmu/soccer/10_01.bvh": 0.01,
    "cmu/soccer/10_03.bvh": 0.01,
    "cmu/soccer/11_01.bvh": 0.01,
    "woody/freeWalk_01.bvh": 0.0254,
    "woody/freeWalk_02.bvh": 0.0254,
}
STANDING = ("boxer/jab_left", "woody/idle_65", "woody/1_walk_straight", "woody/WalkForwardNormal00",
            "cmu/16/16_31", "cmu/02/02_07", "pair/hys_push")  # fmt: skip


@pytest.fixture(scope="module")
def everything(mocap: Path) -> Loaded:
    return load(mocap)


def test_every_file_of_the_manifest(mocap: Path, everything: Loaded) -> None:
    with (mocap / "MANIFEST.csv").open() as file:
        rows = {row["file"]: row for row in csv.DictReader(file)}
    infos = {i.source.relative_to(mocap).as_posix(): i for i in everything.info}
    assert infos.keys() == rows.keys() and len(rows) == 240
    for name, row in rows.items():
        scale = MANIFEST_IS_WRONG.get(name, float(row["metres_per_unit"]))
        assert infos[name].metres_per_unit == pytest.approx(scale, rel=2e-3), name
        assert infos[name].file_fps == float(row["fps"]), name
        assert infos[name].frames == int(row["frames"]), name
        assert infos[name].up_axis == "Y", name


def test_people_stand_on_the_floor_and_face_forward(mocap: Path, everything: Loaded) -> None:
    for clip, info in zip(everything.clips, everything.info):
        skeleton = clip.skeleton
        joint = skeleton.joint
        rest = skeleton.rest_positions
        assert skeleton.lateral_axis[0] > 0.99, info.source
        assert rest[joint("head")][1] - rest[joint("left_foot")][1] > 1.1, info.source
        name = info.source.relative_to(mocap).with_suffix("").as_posix()
        if name in STANDING:
            position, _ = forward_kinematics(skeleton, clip.root_position, clip.wxyz)
            assert 0.85 < np.median(position[:, joint("pelvis"), 1]) < 1.07, name
            feet = position[:, [joint("left_toe"), joint("right_toe")], 1].min(axis=1)
            assert 0.0 < np.median(feet) < 0.06, name
            # Toes are before ankles, along the way that the body faces.
            toe = position[:, joint("left_toe")] - position[:, joint("left_foot")]
            left = position[:, joint("left_thigh")] - position[:, joint("right_thigh")]
            assert np.median(np.cross(left, toe)[:, 1]) < 0, name


def test_rest_poses_face_z(everything: Loaded) -> None:
    for skeleton in {c.skeleton.names: c.skeleton for c in everything.clips}.values():
        if "left_toe" in skeleton.roles:
            rest = skeleton.rest_positions
            toe = rest[skeleton.joint("left_toe")] - rest[skeleton.joint("left_foot")]
            assert toe[2] > 0.05


def test_clips_are_sound(everything: Loaded) -> None:
    assert [p for clip in everything.clips for p in check(clip)] == []
    # These begin with frames that stand apart: T poses, or a body metres away. The files do that.
    apart = {i.name for i in everything.info for f in i.facts if "left out: the body" in f.value}
    assert apart == {"09_10", "16_15", "16_23", "10_01", "10_03", "11_01"}


def test_one_skeleton_makes_a_set(mocap: Path) -> None:
    loaded = load(mocap / "boxer")
    clips = loaded.clip_set()
    assert clips.names[0] == "being_hit" and len(clips) == 14_445 and clips.fps == 30
    halved = load(mocap / "boxer", fps=15).clip_set()
    assert halved.fps == 15 and abs(len(halved) - len(clips) / 2) <= 12
    assert loaded.info[0].file_fps == load(mocap / "boxer", fps=15).info[0].file_fps == 30


def test_two_skeletons_do_not(mocap: Path) -> None:
    mixed = load([mocap / "boxer/jab_left.bvh", mocap / "cmu/14"])
    assert [c.name for c in mixed.clips] == ["jab_left", "14_02"]
    with pytest.raises(
        KumiteError, match="two skeletons in one library: jab_left and 14_02 differ"
    ):
        mixed.clip_set()


def test_report_says_what_was_inferred(mocap: Path) -> None:
    report = load(mocap / "boxer").report()
    assert "every clip: metres_per_unit: 0.0254 (inferred: inches; legs of 0.88 m)" in report
    assert "every clip: file_fps: 30 (stated)" in report
    assert any(
        "left_hand=LeftHand" in line and "(inferred: joint names)" in line for line in report
    )
    amc = load(mocap / "cmu/14").report()
    assert any("120 (assumed: the file does not say" in line for line in amc)


# A person of our own, for what must not need real clips ------------------------------------------


def person(frames: int = 40, scale: float = 1.0) -> Clip:
    """Someone who stands, then walks on the spot a little; metres, on the floor, facing +Z."""
    bones: list[tuple[str, int, list[float]]] = [
        ("Hips", -1, [0, 0, 0]),
        ("Spine", 0, [0, 0.2, 0]),
        ("Head", 1, [0, 0.42, 0.01]),
    ]
    tips: list[tuple[int, list[float]]] = [(2, [0, 0.2, 0])]
    for side, x in (("Left", 1.0), ("Right", -1.0)):
        k = len(bones)
        bones += [
            (f"{side}Arm", 1, [0.18 * x, 0.3, 0]),
            (f"{side}ForeArm", k, [0.29 * x, 0, 0]),
            (f"{side}Hand", k + 1, [0.26 * x, 0, 0]),
            (f"{side}UpLeg", 0, [0.09 * x, -0.05, 0]),
            (f"{side}Leg", k + 3, [0, -0.43, 0]),
            (f"{side}Foot", k + 4, [0, -0.42, 0]),
            (f"{side}Toe", k + 5, [0, -0.05, 0.14]),
        ]
        tips += [(k + 2, [0.18 * x, 0, 0]), (k + 6, [0, 0, 0.06])]
    skeleton = Skeleton(
        tuple(n for n, _, _ in bones),
        np.array([p for _, p, _ in bones]),
        scale * np.array([o for _, _, o in bones]),
        tip_parents=np.array([j for j, _ in tips]),
        tip_offsets=scale * np.array([o for _, o in tips]),
    )
    t = np.arange(frames) / 30
    wxyz = np.tile(rotation.IDENTITY_WXYZ, (frames, len(bones), 1))
    wxyz[:, 6] = rotation.exp(np.stack([-0.3 * np.sin(2 * t), 0 * t, 0 * t], axis=1))
    wxyz[:, 13] = rotation.exp(np.stack([0.3 * np.sin(2 * t), 0 * t, 0 * t], axis=1))
    root = scale * np.stack([0.1 * t, np.full(frames, 0.98), 0.3 * t], axis=1)
    return Clip("person", skeleton, 30.0, root, wxyz)


def positions(clip: Clip) -> np.ndarray:
    return forward_kinematics(clip.skeleton, clip.root_position, clip.wxyz)[0]


@pytest.mark.parametrize("unit", [1.0, 0.01, 0.0254, 0.001, 0.0254 / 0.45])
@pytest.mark.parametrize("size", [0.8, 1.0, 1.15])
def test_units_are_found_for_small_and_tall(tmp_path: Path, unit: float, size: float) -> None:
    clip = person(scale=size)
    write_bvh(tmp_path / "p.bvh", clip, metres_per_unit=unit)
    back = load(tmp_path / "p.bvh")
    assert back.info[0].metres_per_unit == pytest.approx(unit)
    names = back.clips[0].skeleton.names
    index = [names.index(n) for n in clip.skeleton.names]
    np.testing.assert_allclose(positions(back.clips[0])[:, index], positions(clip), atol=1e-5)


def test_no_known_unit_is_an_error_that_says_what_to_give(tmp_path: Path) -> None:
    write_bvh(tmp_path / "p.bvh", person(), metres_per_unit=0.1)
    with pytest.raises(
        KumiteError, match=r"no known unit: .*; say --metres-per-unit, or metres_per"
    ):
        load(tmp_path)
    assert load(tmp_path, metres_per_unit=0.1).info[0].metres_per_unit == 0.1


def stood_on_z(clip: Clip) -> Clip:
    """The same motion in a Z-up world."""
    turn = rotation.exp([np.pi / 2, 0, 0])
    wxyz = clip.wxyz.copy()
    wxyz[..., 1:] = rotation.rotate(turn, wxyz[..., 1:])
    skeleton = replace(
        clip.skeleton,
        offsets=rotation.rotate(turn, clip.skeleton.offsets),
        tip_offsets=rotation.rotate(turn, clip.skeleton.tip_offsets),
    )
    return Clip(clip.name, skeleton, clip.fps, rotation.rotate(turn, clip.root_position), wxyz)


def test_z_up_is_found_and_put_right(tmp_path: Path) -> None:
    clip = person()
    write_bvh(tmp_path / "p.bvh", stood_on_z(clip))
    back = load(tmp_path)
    assert back.info[0].up_axis == "Z"
    index = [back.clips[0].skeleton.names.index(n) for n in clip.skeleton.names]
    np.testing.assert_allclose(positions(back.clips[0])[:, index], positions(clip), atol=1e-5)
    assert load(tmp_path, up_axis="y").info[0].up_axis == "Y"
    with pytest.raises(KumiteError, match="up axis 'W'; expected one of Y, Z, X, -Y, -Z, -X"):
        load(tmp_path, up_axis="w")


def raised(clip: Clip, height: float | np.ndarray) -> Clip:
    root = clip.root_position.copy()
    root[:, 1] += height
    return replace(clip, root_position=root)


def test_a_floor_elsewhere_is_found_once_for_a_session(tmp_path: Path) -> None:
    """Clips of a session share a floor, so that one that never lands does not sink."""
    clip = person()
    for k in range(4):
        write_bvh(tmp_path / f"stand{k}.bvh", raised(clip, -0.98))
    write_bvh(tmp_path / "in_the_air.bvh", raised(clip, -0.98 + 0.5))
    back = load(tmp_path)
    assert len({i.ground_height for i in back.info}) == 1
    assert back.info[0].ground_height == pytest.approx(-0.98, abs=0.04)
    standing = next(c for c in back.clips if c.name == "stand0")
    # The file's floor is not known better than a toe's height above its sole.
    assert abs(standing.root_position[0, 1] - 0.98) < 0.04
    air = next(c for c in back.clips if c.name == "in_the_air")
    assert air.root_position[0, 1] == pytest.approx(standing.root_position[0, 1] + 0.5, abs=1e-6)
    assert load(tmp_path, ground=-1.0).clips[0].root_position[0, 1] == pytest.approx(1.5, abs=1e-5)


def test_a_jump_does_not_move_the_floor(tmp_path: Path) -> None:
    clip = person(90)
    height = np.where((np.arange(90) > 20) & (np.arange(90) < 75), 0.6, 0.0)
    write_bvh(tmp_path / "jump.bvh", raised(clip, height))
    assert load(tmp_path).info[0].ground_height == 0.0


def test_given_beats_settings_beats_inference(tmp_path: Path) -> None:
    clip = person()
    for name in ("a", "b"):
        write_bvh(tmp_path / "takes" / f"{name}.bvh", clip)
    (tmp_path / "kumite.toml").write_text("metres_per_unit = 0.02\nfile_fps = 60\n")
    (tmp_path / "takes/kumite.toml").write_text(
        'ground_height = 0.1\n[roles]\nchest = "Head"\nhead = "Spine"\n'
        '[files."b.bvh"]\nmetres_per_unit = 0.03\nup_axis = "z"\nname = "second"\n'
    )
    a, b = load(tmp_path).info
    assert (a.name, a.metres_per_unit, a.up_axis, a.file_fps) == ("a", 0.02, "Y", 60)
    assert (b.name, b.metres_per_unit, b.up_axis, b.ground_height) == ("second", 0.03, "Z", 0.1)
    assert a.roles["chest"] == "Head"
    assert {str(f) for f in a.facts} >= {
        "metres_per_unit: 0.02 (settings)",
        "file_fps: 60 (settings)",
    }
    swapped = {"chest": "Spine", "head": "Head"}
    given = load(tmp_path, metres_per_unit=0.5, roles=swapped, file_fps=10, fps=5)
    assert [i.metres_per_unit for i in given.info] == [0.5, 0.5]
    assert given.info[0].roles["chest"] == "Spine"
    assert given.info[0].file_fps == 10 and given.clips[0].fps == 5
    # A file by itself is read with the settings beside it, and no others.
    assert load(tmp_path / "takes/a.bvh").info[0].metres_per_unit == 0.01


@pytest.mark.parametrize(
    ("toml", "message"),
    [
        ("up_axis = 'W'", r"kumite\.toml:1: up_axis: 'W'; expected 'Y', 'Z', 'X'"),
        (
            "\nmeters_per_unit = 1",
            r"toml:2: unknown key 'meters_per_unit'; expected one of encoding, file_fps",
        ),
        ("metres_per_unit = 0", "metres_per_unit: 0; expected greater than 0"),
        ("metres_per_unit = 'cm'", "metres_per_unit: 'cm'; expected a valid number"),
        ("ground_height = nan", "ground_height: nan; expected a finite number"),
        ("[roles]\nfist = 'Hips'", "unknown role 'fist'; expected one of pelvis"),
        ("[roles]\nhead = 'Hed'", r"unknown joint for 'head': 'Hed'; did you mean 'Head'"),
        (
            "[files.'a.bvh']\nfsp = 3",
            r"toml:2: unknown key .*fsp.; expected one of encoding, file_fps, .*, name, roles",
        ),
        (
            "fps = 5\n[files.'a.bvh'.roles]\nfist = 'Hips'",
            r"toml:2: files\.'a\.bvh'\.roles: unknown",
        ),
        ("[files.'c.bvh']", r"toml:1: files\.'c\.bvh': no such file"),
        ("up_axis =", "not TOML"),
        ("x = 1\ny = 2", "unknown key 'x'.*\n.*unknown key 'y'"),
        ("a = " + "[" * 100_000, "not TOML"),
        ("fps = " + "1" * 5000, "not TOML: Exceeds the limit"),
        ("fps = 0x" + "f" * 5000, "fps: a number of thousands of digits; expected a valid number"),
        ("\n" + "x." * 8000 + "x = 1", ":2: a key of more than 32 parts"),
        ("[files.'" + "a" * 5000 + ".bvh']", r":1: files\.'a+…': no such file"),
        ('[files."a\\u0000b"]', r":1: files\.'a.x00b': no such file"),
    ],
)
def test_settings_that_are_wrong(tmp_path: Path, toml: str, message: str) -> None:
    write_bvh(tmp_path / "a.bvh", person())
    (tmp_path / "kumite.toml").write_text(toml)
    with pytest.raises(KumiteError, match=message):
        load(tmp_path)


def test_sources_of_every_kind(tmp_path: Path) -> None:
    clip = person()
    for name in ("b.bvh", "sub/a.BVH", "sub/deep/a.bvh", "c.txt"):
        write_bvh(tmp_path / name, clip)
    found = load(tmp_path)
    assert [i.source.relative_to(tmp_path).as_posix() for i in found.info] == [
        "b.bvh",
        "sub/a.BVH",
        "sub/deep/a.bvh",
    ]
    assert [c.name for c in found.clips] == ["b", "sub-a", "deep-a"]
    assert len(load(str(tmp_path / "**/*.bvh")).clips) == 2
    assert len(load([tmp_path / "b.bvh", tmp_path / "sub", tmp_path / "b.bvh"]).clips) == 3
    assert load(tmp_path / "b.bvh", names={"b": "other"}).clips[0].name == "other"
    with pytest.raises(KumiteError, match="'q', which is not among the files"):
        load(tmp_path, names={"q": "x"})
    with pytest.raises(KumiteError, match="given twice: x"):
        load(tmp_path, names={"b.bvh": "x", "a.BVH": "x"})


def test_sources_that_lead_nowhere(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("no mocap")
    for source, message in (
        (tmp_path, "no mocap in this folder"),
        (tmp_path / "walk.bvh", "no such file or folder"),
        (tmp_path / "notes.txt", "not a mocap file"),
        (tmp_path / "*.bvh", "matches no mocap"),
        ([], "an empty list"),
        ("a\0b", "not a path|no such file"),
        ("a" * 5000, "not a path|no such file"),
        ("a" * 5000 + "*.bvh", "not a path|matches no mocap"),
    ):
        with pytest.raises(KumiteError, match=message):
            load(source)
    bad: dict[str, Any]
    for bad in ({"fps": 0}, {"file_fps": -1}, {"metres_per_unit": np.nan}, {"ground": np.inf}):
        with pytest.raises(KumiteError, match="expected"):
            load(tmp_path, **bad)


def test_every_bad_file_is_named_at_once(tmp_path: Path) -> None:
    write_bvh(tmp_path / "good.bvh", person())
    (tmp_path / "bad1.bvh").write_text("HIERARCHY\nROOTS x")
    (tmp_path / "bad2.bvh").write_bytes(b"")
    with pytest.raises(KumiteError) as error:
        load(tmp_path)
    lines = str(error.value).split("\n")
    assert "bad1.bvh:2: unexpected" in lines[0] and "bad2.bvh: the file is empty" in lines[1]
    assert lines[2:] == ["say --skip-bad (skip_bad=True) to go on without these files"]
    loaded = load(tmp_path, skip_bad=True)
    assert [c.name for c in loaded.clips] == ["good"]
    assert [b.source.name for b in loaded.bad] == ["bad1.bvh", "bad2.bvh"]
    (tmp_path / "good.bvh").unlink()
    with pytest.raises(KumiteError) as error:  # nothing is left to go on with
        load(tmp_path, skip_bad=True)
    assert "skip" not in str(error.value)


def test_which_skeleton_an_amc_gets(tmp_path: Path) -> None:
    def touch(*names: str) -> None:
        for path in tmp_path.iterdir():
            path.unlink()
        for name in names:
            (tmp_path / name).touch()

    touch("02_01.amc", "02.asf", "0.asf", "03.asf")
    assert find_asf(tmp_path / "02_01.amc").name == "02.asf"
    touch("hys_push.amc", "hys.asf", "mmk.asf")
    assert find_asf(tmp_path / "hys_push.amc").name == "hys.asf"
    touch("walk.amc", "woody.ASF")
    assert find_asf(tmp_path / "walk.amc").name == "woody.ASF"
    touch("walk.amc", "a.asf", "b.asf")
    with pytest.raises(KumiteError, match=r"AMC without its ASF; .*\(a\.asf, b\.asf\)"):
        load(tmp_path)
    touch("021_01.amc", "02.asf", "03.asf")
    with pytest.raises(KumiteError, match="AMC without its ASF"):
        load(tmp_path)


def test_an_exported_clip_keeps_its_place(mocap: Path, tmp_path: Path) -> None:
    for name in ("boxer/hook_left_near.bvh", "cmu/135/135_05.amc", "cmu/soccer/10_03.bvh"):
        clip = load(mocap / name).clips[0]
        write_bvh(tmp_path / "out.bvh", clip)
        back = load(tmp_path / "out.bvh").clips[0]
        index = [back.skeleton.names.index(n) for n in clip.skeleton.names]
        np.testing.assert_allclose(positions(back)[:, index], positions(clip), atol=1e-5)
        assert dict(back.skeleton.roles) == {r: back.skeleton.names.index(clip.skeleton.names[j])
                                             for r, j in clip.skeleton.roles.items()}  # fmt: skip


def test_files_of_another_skeleton_beside(mocap: Path, tmp_path: Path) -> None:
    """A session is one skeleton in one folder: units are not shared across skeletons."""
    shutil.copy(mocap / "woody/PushBack00.bvh", tmp_path)
    shutil.copy(mocap / "woody/idle_65.bvh", tmp_path)
    scales = {i.name: i.metres_per_unit for i in load(tmp_path).info}
    assert scales == {"PushBack00": 0.01, "idle_65": 0.0254}
    assert sources.SUFFIXES == (".bvh", ".amc")
