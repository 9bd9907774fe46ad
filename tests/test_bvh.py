"""BVH in and out: known answers by hand, every kind of damage, reading back what was written."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kumite import rotation
from kumite.clip import Clip, Skeleton, forward_kinematics
from kumite.errors import KumiteError
from kumite.export.bvh import ORDERS, write_bvh
from kumite.mocap import text
from kumite.mocap.bvh import read_bvh
from kumite.mocap.raw import MOST_JOINTS, RawMotion, Stretch, to_clip, to_y_up
from kumite.mocap.rigid import fixed_bones

ARM = """HIERARCHY
ROOT base
{
  OFFSET 9 9 9
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT mid
  {
    OFFSET 0 2 0
    CHANNELS 3 Yrotation Zrotation Xrotation
    JOINT hand
    {
      OFFSET 1 0 0
      CHANNELS 1 Xrotation
      End Site
      {
        OFFSET 0 0 1
      }
      End Site
      {
        OFFSET 0 0.5 0
      }
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.033333
1 2 3 0 0 0 0 0 0 0
1 2 3 90 0 0 90 0 0 90
"""


def read(tmp_path: Path, source: str | bytes) -> RawMotion:
    path = tmp_path / "take.bvh"
    path.write_bytes(source if isinstance(source, bytes) else source.encode())
    return read_bvh(path)


def positions(raw: RawMotion) -> np.ndarray:
    return forward_kinematics(raw.skeleton, raw.root_position, raw.wxyz)[0]


def test_positions_worked_out_by_hand(tmp_path: Path) -> None:
    raw = read(tmp_path, ARM)
    assert raw.skeleton.names == ("base", "mid", "hand")
    assert raw.fps == 30.0
    at_rest, turned = positions(raw)
    # The root's OFFSET does not count where it has position channels.
    np.testing.assert_allclose(at_rest, [[1, 2, 3], [1, 4, 3], [2, 4, 3]], atol=1e-12)
    # 90° about z carries +y to -x; 90° about the new y carries the hand's +x to -z.
    np.testing.assert_allclose(turned, [[1, 2, 3], [-1, 2, 3], [-1, 2, 2]], atol=1e-12)
    np.testing.assert_array_equal(raw.skeleton.tip_parents, [2, 2])
    np.testing.assert_array_equal(raw.skeleton.tip_offsets, [[0, 0, 1], [0, 0.5, 0]])


def slow_positions(path: Path) -> np.ndarray:
    """An independent reading: matrices, a frame at a time, recursion over indented text."""
    lines = path.read_text().split("\n")
    at = next(i for i, line in enumerate(lines) if line.strip() == "MOTION")
    joints: list[tuple[int, list[float], list[str]]] = []
    stack: list[int] = []
    in_end = False
    for line in lines[:at]:
        words = line.split()
        if not words:
            continue
        if words[0] in ("ROOT", "JOINT"):
            joints.append((stack[-1] if stack else -1, [], []))
            stack.append(len(joints) - 1)
        elif words[0] == "End":
            in_end = True
        elif words[0] == "OFFSET" and not in_end:
            joints[stack[-1]][1].extend(map(float, words[1:]))
        elif words[0] == "CHANNELS":
            joints[stack[-1]][2].extend(words[2:])
        elif words[0] == "}":
            if in_end:
                in_end = False
            else:
                stack.pop()
    out = []
    for line in lines[at + 3 :]:
        if not line.strip():
            continue
        numbers = iter(map(float, line.split()))
        world: list[np.ndarray] = []
        for parent, offset, channels in joints:
            local = np.eye(4)
            local[:3, 3] = offset
            for channel in channels:
                value = next(numbers)
                k = "XYZ".index(channel[0])
                if channel.endswith("position"):
                    local[k, 3] = value
                else:
                    c, s = np.cos(np.radians(value)), np.sin(np.radians(value))
                    turn = np.eye(4)
                    a, b = (k + 1) % 3, (k + 2) % 3
                    turn[a, a], turn[a, b], turn[b, a], turn[b, b] = c, -s, s, c
                    local = local @ turn
            world.append(local if parent < 0 else world[parent] @ local)
        out.append([w[:3, 3] for w in world])
    return np.array(out)


@pytest.mark.parametrize(
    "name", ["boxer/uppercut_left.bvh", "woody/PushBack00.bvh", "cmu/soccer/10_03.bvh"]
)
def test_real_files_against_the_slow_twin(mocap: Path, name: str) -> None:
    raw = read_bvh(mocap / name)
    np.testing.assert_allclose(positions(raw), slow_positions(mocap / name), atol=1e-9)


def test_root_position_is_the_channels_not_the_offset(mocap: Path) -> None:
    raw = read_bvh(mocap / "woody/PushBack00.bvh")
    assert raw.skeleton.offsets[0, 1] == pytest.approx(102.336)
    assert raw.root_position[0, 1] == pytest.approx(101.962)


def test_layout_does_not_matter(tmp_path: Path) -> None:
    plain = read(tmp_path, ARM)
    variants = {
        "crlf": ARM.replace("\n", "\r\n"),
        "old mac": ARM.replace("\n", "\r"),
        "tabs": ARM.replace(" ", "\t").replace("End\tSite", "End Site"),
        "braces on the line": ARM.replace("\n{", " {").replace("mid\n  {", "mid {"),
        "one line": " ".join(ARM.split("MOTION")[0].split()) + "\nMOTION" + ARM.split("MOTION")[1],
        "lower case": ARM.replace("OFFSET", "offset").replace("Xrotation", "XROTATION"),
        "byte order mark": "\ufeff" + ARM,
        "blank lines": ARM.replace("\n", "\n\n"),
        "wrapped rows": ARM.replace("1 2 3 0", "1 2 3\n0"),
        "no last line end": ARM.rstrip("\n"),
        "remarks": ARM.replace("JOINT mid", "JOINT mid # of the body").replace(
            "0 2 0", "0 2 0 // y"
        ),
        "end in one word": ARM.replace("End Site", "EndSite"),
        "end on two lines": ARM.replace("End Site", "End\nSite"),
        "motion with a colon": ARM.replace("MOTION", "Motion:"),
        "comments": "# made by hand\n// twice\n"
        + ARM.replace("  JOINT mid", "  # mid\n  JOINT mid"),
        "comments in the motion": ARM.replace("\n1 2 3 90", "\n# the second\n1 2 3 90"),
        "channels below": ARM.replace("3 Yrotation Zrotation", "\n3\n\nYrotation\nZrotation"),
        "offsets below": ARM.replace("OFFSET 0 2 0", "OFFSET\n0\n2 0"),
        "spaces at colons": ARM.replace("Frames: 2", "frames  :\t2 ").replace("Time:", "time :"),
        "no colons": ARM.replace("Frames:", "Frames").replace("Frame Time:", "FrameTime"),
        "one motion line": ARM.replace("Frames: 2\n", "Frames: 2 ").replace("0 0\n1", "0 0 1"),
        "brace before motion": ARM.replace("}\nMOTION", "} MOTION"),
        "all lower case": ARM.lower(),
        "one row more": ARM.replace("Frames: 2", "Frames: 1"),
        "one row fewer": ARM.replace("Frames: 2", "Frames: 3"),
        "utf-16": ARM.encode("utf-16"),
        "exponents": ARM.replace("90 0 0 90 0 0 90", "9e1 0.0 -0 9.0E+01 0 +0e-5 900e-1"),
    }
    for kind, source in variants.items():
        raw = read(tmp_path, source)
        np.testing.assert_allclose(positions(raw), positions(plain), atol=1e-12, err_msg=kind)
        assert raw.skeleton.names == plain.skeleton.names, kind


def test_names_stay_whole(tmp_path: Path) -> None:
    raw = read(tmp_path, ARM.replace("mid", "rig:Left-Arm upper 2").replace("hand", "手"))
    assert raw.skeleton.names == ("base", "rig:Left-Arm upper 2", "手")


def test_equal_names_are_numbered_and_said(tmp_path: Path) -> None:
    raw = read(tmp_path, ARM.replace("hand", "mid"))
    assert raw.skeleton.names == ("base", "mid", "mid_2")
    assert "mid_2" in raw.notes[0]


SIX = """HIERARCHY
ROOT a
{{
  OFFSET 0 0 0
  CHANNELS 3 Xposition Yposition Zposition
  JOINT b
  {{
    OFFSET 0 1 0
    CHANNELS 4 Xposition Yposition Zposition Zrotation
    JOINT c
    {{
      OFFSET 0 1 0
      CHANNELS 0
    }}
  }}
  {extra}
}}
MOTION
Frames: 2
Frame Time: .04
{rows}
"""


def fixed(raw: RawMotion, *, follow: bool = True) -> RawMotion:
    return fixed_bones(raw, {"pelvis": 0}, follow=follow)[0]


def test_constant_position_channels_become_the_offset(tmp_path: Path) -> None:
    raw = fixed(read(tmp_path, SIX.format(extra="", rows="0 0 0 0 3 0 0\n0 0 0 0 3 0 90")))
    np.testing.assert_array_equal(raw.skeleton.offsets[1], [0, 3, 0])
    assert raw.notes == ()
    np.testing.assert_allclose(positions(raw)[1, 2], [-1, 3, 0], atol=1e-12)


def test_positions_of_zero_keep_the_offset(tmp_path: Path) -> None:
    raw = fixed(read(tmp_path, SIX.format(extra="", rows="0 0 0 0 0 0 0\n0 0 0 0 0 0 90")))
    np.testing.assert_array_equal(raw.skeleton.offsets[1], [0, 1, 0])


def test_bones_that_stretch_are_held_and_said(tmp_path: Path) -> None:
    source = SIX.format(extra="", rows="0 0 0 0 3 0 0\n0 0 0 0 4 0 0")
    raw = fixed(read(tmp_path, source))
    np.testing.assert_array_equal(raw.skeleton.offsets[1], [0, 3.5, 0])
    assert raw.stretch == Stretch("b", 0.5)
    assert "keep one: b; joints lie up to 0.5 file units" in raw.notes[0]
    told = fixed(read(tmp_path, source), follow=False)
    np.testing.assert_array_equal(told.skeleton.offsets[1], [0, 1, 0])
    assert told.stretch is None and "left out, as said" in told.notes[0]


def test_hips_below_a_reference_joint_become_the_root(tmp_path: Path) -> None:
    raw = read(tmp_path, SIX.format(extra="", rows="1 0 0 0 3 0 0\n1 0 0 0 3 7 90"))
    raw = fixed_bones(raw, {"pelvis": 1})[0]
    assert raw.skeleton.names == ("b", "c")
    np.testing.assert_allclose(
        positions(raw), [[[1, 3, 0], [1, 4, 0]], [[1, 3, 7], [0, 3, 7]]], atol=1e-12
    )
    assert "joint a above b was merged" in raw.notes[0]


@pytest.mark.parametrize(
    ("written", "fps"),
    [
        ("0.0333333", 30.0),
        ("0.033333", 30.0),
        ("3.33333e-002", 30.0),
        ("0.00833333", 120.0),
        ("0.008333", 120.0),
        ("0.0083", 120.0),
        ("0.016667", 60.0),
        ("0.0416667", 24.0),
        ("0.033367", 30 / 1.001),
        ("0.01", 100.0),
        ("0.02", 50.0),
        ("0.0338983051", 1 / 0.0338983051),
    ],
)
def test_rates_written_with_few_digits(tmp_path: Path, written: str, fps: float) -> None:
    assert read(tmp_path, ARM.replace("0.033333", written)).fps == pytest.approx(fps, rel=1e-12)


BAD = {
    "nothing": (lambda s: "", "the file is empty"),
    "pointer": (lambda s: "version https://git-lfs.github.com/spec/v1\n", "a pointer of Git LFS"),
    "page": (lambda s: "\n<!DOCTYPE html>\n<html>", "a web page; expected motion capture"),
    "no hierarchy": (lambda s: s[10:], ":1: unexpected 'ROOT'; expected HIERARCHY"),
    "cut in the hierarchy": (lambda s: s[:150], "expected MOTION|expected"),
    "cut in the motion": (lambda s: s[:-10], r":29: \d numbers; expected 10"),
    "no motion": (lambda s: s.split("MOTION")[0], "the file ends here; expected MOTION"),
    "brace open": (
        lambda s: s.replace("}\nMOTION", "MOTION"),
        "joint 'base' is open.*expected '}'",
    ),
    "brace missing": (lambda s: s.replace("mid\n  {", "mid\n"), ":8: unexpected 'OFFSET 0 2 0'"),
    "brace too many": (
        lambda s: s.replace("MOTION", "}\nMOTION"),
        "unexpected '}'; expected ROOT or MOTION",
    ),
    "second root": (lambda s: s.replace("MOTION", "ROOT b\nMOTION"), "a second ROOT"),
    "channel": (
        lambda s: s.replace("CHANNELS 1 X", "CHANNELS 1 W"),
        ":13: unknown channel 'Wrotation'; expected one of Xposition",
    ),
    "channel twice": (lambda s: s.replace("6 Xp", "6 Yp"), "channel Yposition twice"),
    "few channels": (lambda s: s.replace("CHANNELS 1", "CHANNELS 2"), "1 channels; expected 2"),
    "many channels": (lambda s: s.replace("CHANNELS 1", "CHANNELS 999999999"), "count from 0 to 6"),
    "keyword": (lambda s: s.replace("OFFSET 1", "OFSET 1"), ":12: unknown keyword 'OFSET'"),
    "offset of two": (lambda s: s.replace("OFFSET 1 0 0", "OFFSET 1 0"), "OFFSET with 2 numbers"),
    "offset": (lambda s: s.replace("OFFSET 1 0 0", "OFFSET 1 0 x"), ":12: 'x' is not a number"),
    "no offset": (lambda s: s.replace("OFFSET 1 0 0", ""), "joint 'hand' has no OFFSET"),
    "brace first": (lambda s: s.replace("ROOT", "}\nROOT"), ":2: unexpected '}'; expected ROOT"),
    "end without offset": (lambda s: s.replace("OFFSET 0 0 1", ""), "End Site has no OFFSET"),
    "joint in an end": (lambda s: s.replace("OFFSET 0 0 1", "JOINT x"), "'JOINT' in an End Site"),
    "end of what": (lambda s: s.replace("End Site", "End"), "'End'; expected 'End Site'"),
    "few frames": (lambda s: s.replace("Frames: 2", "Frames: 4"), "2 frames of motion; expected 4"),
    "more frames": (
        lambda s: s + "1 2 3 90 0 0 90 0 0 90\n" * 2,
        "4 frames of motion; expected 2",
    ),
    "shifted rows": (
        lambda s: s.replace("0 0 0\n1 2 3 90", "0 0\n0 1 2 3 90"),
        ":28: 9 numbers; expected 10",
    ),
    "long digits": (
        lambda s: s.replace("1 2 3 90", "1 2 0.12345678901234567891x 90"),
        ":29: '0.12345678901234567891x' is not a number",
    ),
    "long underscore": (
        lambda s: s.replace("1 2 3 90", "1 2 0.12345678901234567891_1 90"),
        ":29: '0.12345678901234567891_1' is not a number",
    ),
    "decimal comma": (
        lambda s: s.replace("1 2 3 90", "1 2,5 3 90"),
        ":29: '2,5' is not a number; expected a decimal point",
    ),
    "endless": (lambda s: s.replace("0.033333", "1" * 5000), "is beyond ±1e.09; expected a frame"),
    "endless power": (
        lambda s: s.replace("0.033333", "1e-" + "1" * 5000),
        "Frame Time: .*; expected a frame time from",
    ),
    "endless digits": (
        lambda s: s.replace("OFFSET 1 0 0", f"OFFSET {'1' * 200_000}x 0 0"),  # in no square of time
        "'1111.*…' is not a number",
    ),
    "endless name": (lambda s: s.replace("mid", "m" * 5000), ":6: a name of 5000 characters"),
    "rate": (lambda s: s.replace("0.033333", "30"), "else say --file-fps 30 if this is a rate"),
    "huge count": (lambda s: s.replace("Frames: 2", "Frames: 99999999999"), "expected 99999999999"),
    "no frames": (
        lambda s: s.replace("Frames: 2", "Frames: 0"),
        ":26: Frames: '0'; expected a count",
    ),
    "frames of text": (lambda s: s.replace("Frames: 2", "Frames: two"), "Frames: 'two'"),
    "time zero": (
        lambda s: s.replace("0.033333", "0"),
        ":27: Frame Time: '0'; expected a frame time",
    ),
    "time negative": (lambda s: s.replace("0.033333", "-1"), "Frame Time: '-1'"),
    "time nan": (lambda s: s.replace("0.033333", "nan"), ":27: 'nan' is not a number"),
    "time tiny": (lambda s: s.replace("0.033333", "1e-320"), "expected a frame time from"),
    "no time": (lambda s: s.replace("Frame Time", "Time"), "unexpected 'Time: 0.033333'"),
    "letters": (lambda s: s.replace("1 2 3 90", "1 2 abc 90"), ":29: 'abc' is not a number"),
    "nan": (lambda s: s.replace("1 2 3 90", "1 2 nan 90"), ":29: 'nan' is not a number"),
    "inf": (lambda s: s.replace("1 2 3 90", "1 2 -inf 90"), ":29: '-inf' is not a number"),
    "overflow": (lambda s: s.replace("1 2 3 90", "1 2 1e999 90"), ":29: '1e999' is beyond"),
    "underscore": (lambda s: s.replace("1 2 3 90", "1 2 1_0 90"), "'1_0' is not a number"),
    "short row": (lambda s: s.replace("1 2 3 90", "2 3 90"), ":29: 9 numbers; expected 10"),
    "long row": (lambda s: s.replace("1 2 3 90", "1 1 2 3 90"), ":29: 11 numbers; expected 10"),
}


@pytest.mark.parametrize("kind", BAD)
def test_damage_is_named_with_its_line(tmp_path: Path, kind: str) -> None:
    damage, message = BAD[kind]
    with pytest.raises(KumiteError, match=message):
        read(tmp_path, damage(ARM))


def test_other_encodings_are_named(tmp_path: Path) -> None:
    for name, encoding, said in (
        ("épaule", "latin-1", "read as Windows-1252"),
        ("頭", "shift_jis", "read as Shift-JIS"),
        ("手", "utf-16", "read as UTF-16"),
    ):
        raw = read(tmp_path, ARM.replace("mid", name).encode(encoding))
        assert raw.skeleton.names[1] == name and said in raw.notes[0]
        assert read_bvh(raw.source, encoding=encoding).notes == ()
    (tmp_path / "take.bvh").write_bytes(ARM.replace("mid", "躯").encode("gbk"))
    assert read_bvh(tmp_path / "take.bvh", encoding="gbk").skeleton.names[1] == "躯"
    with pytest.raises(KumiteError, match=r"take\.bvh:6: byte 0x.. is not 'ascii'"):
        read_bvh(tmp_path / "take.bvh", encoding="ascii")
    for odd in ("nonsense", "rot13", "hex", "a\0b"):
        with pytest.raises(KumiteError, match="unknown encoding"):
            read_bvh(tmp_path / "take.bvh", encoding=odd)
    with pytest.raises(KumiteError, match="not a plain text file"):
        read(tmp_path, b"\0" + ARM.encode())
    with pytest.raises(KumiteError, match="cannot be read"):
        read_bvh(tmp_path / "missing.bvh")


def test_nesting_is_not_recursion(tmp_path: Path) -> None:
    depth = MOST_JOINTS - 1
    opened = "".join(f"JOINT j{k} {{ OFFSET 0 1 0 CHANNELS 0\n" for k in range(depth))
    head = "HIERARCHY\nROOT r { OFFSET 0 0 0 CHANNELS 1 Xrotation\n"
    motion = "MOTION\nFrames: 1\nFrame Time: 0.1\n0\n"
    assert (
        len(read(tmp_path, head + opened + "}" * (depth + 1) + "\n" + motion).skeleton) == depth + 1
    )
    with pytest.raises(KumiteError, match="too early"):
        read(tmp_path, head + opened + "\n" + motion)
    with pytest.raises(KumiteError, match="unexpected"):
        read(tmp_path, "HIERARCHY\n" + "{" * 100_000)
    with pytest.raises(KumiteError, match=r":2002: more than 2000 joints"):
        read(tmp_path, head + opened + "JOINT x {" + "}" * (depth + 1) + "\n" + motion)


@settings(max_examples=150, deadline=None)
@given(st.binary(max_size=300))
def test_any_bytes_are_a_motion_or_one_error(
    tmp_path_factory: pytest.TempPathFactory, data
) -> None:
    path = tmp_path_factory.getbasetemp() / "fuzz.bvh"
    path.write_bytes(data)
    with pytest.raises(KumiteError):
        read_bvh(path)


@settings(max_examples=300, deadline=None)
@given(
    st.integers(0, len(ARM)),
    st.integers(0, 40),
    st.sampled_from(
        ["", "{", "}", " ", "\n", "-", "9", "e", "JOINT x\n", "OFFSET", "nan", "1e300", "é"]
    )
    | st.text(max_size=5),
)
def test_mutations_are_a_motion_or_one_error(
    tmp_path_factory: pytest.TempPathFactory, at: int, cut: int, put: str
) -> None:
    path = tmp_path_factory.getbasetemp() / "mutant.bvh"
    path.write_bytes((ARM[:at] + put + ARM[at + cut :]).encode("utf-8", "surrogatepass"))
    try:
        raw = read_bvh(path)
    except KumiteError as error:
        assert str(error).startswith(str(path))
    else:
        assert np.isfinite(positions(raw)).all()


@settings(max_examples=200, deadline=None)
@given(
    st.lists(
        st.floats(-1e8, 1e8).map(repr)
        | st.from_regex(r"[+-]?\d{1,25}\.\d{0,25}(e-\d\d?)?", fullmatch=True),
        min_size=1,
    )
)
def test_numbers_are_those_of_float_bit_for_bit(tokens: list[str]) -> None:
    tokens = [t for t in tokens if t.isascii() and abs(float(t)) <= text.LARGEST] or ["0"]
    table = text.read_table(" ".join(tokens).encode(), [None])
    assert table.refused is None
    expected = np.array([float(t) for t in tokens])
    np.testing.assert_array_equal(table.values.view(np.int64), expected.view(np.int64))


def test_a_whole_session_in_a_second(mocap: Path) -> None:
    files = sorted((mocap / "boxer").glob("*.bvh"))
    read_bvh(files[0])
    start = time.perf_counter()
    frames = sum(len(to_clip(read_bvh(f), f.stem, metres_per_unit=0.0254)) for f in files)
    assert frames == 14_445
    assert time.perf_counter() - start < 1.0


def test_z_up_files_stand_up(tmp_path: Path) -> None:
    raw = read(tmp_path, ARM)
    upright = to_y_up(raw, "Z")
    expected = positions(raw)[..., [0, 2, 1]] * [1, 1, -1]
    np.testing.assert_allclose(positions(upright), expected, atol=1e-12)
    np.testing.assert_allclose(upright.skeleton.tip_offsets[0], [0, 1, 0], atol=1e-12)
    for axis, k, sign in (("X", 0, 1), ("-X", 0, -1), ("-Y", 1, -1), ("-Z", 2, -1)):
        turned = positions(to_y_up(raw, axis))
        np.testing.assert_allclose(turned[..., 1], sign * positions(raw)[..., k], atol=1e-12)
        # Turned, not mirrored: three places span the same volume, with its sign.
        assert np.linalg.det(turned[1]) == pytest.approx(np.linalg.det(positions(raw)[1]))
    with pytest.raises(KumiteError, match="expected one of Y, Z, X, -Y, -Z, -X"):
        to_y_up(raw, "W")


# Out ---------------------------------------------------------------------------------------------


@pytest.fixture
def clip() -> Clip:
    """Turns of every size on a skeleton that is not in depth-first order."""
    rng = np.random.default_rng(3)
    skeleton = Skeleton(
        ("root", "spine", "left arm", "rig:head", "lower"),
        np.array([-1, 0, 0, 1, 2]),
        rng.uniform(-0.5, 0.5, (5, 3)),
        tip_parents=np.array([3, 3]),
        tip_offsets=rng.uniform(-0.1, 0.1, (2, 3)),
    )
    q = rng.normal(size=(400, 5, 4))
    q[:100] = [1, 0, 0, 0]
    q[100:150] = [np.sqrt(0.5), 0, np.sqrt(0.5), 0]  # the middle angle of ZYX at its limit
    q[150:200, :, 1:] *= 1e-9
    q[200:210] = [0, 0, 0, 1]
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    return Clip("takes", skeleton, 30.0, rng.uniform(-3, 3, (400, 3)), q)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("unit", [0.01, 1.0, 0.0254])
def test_written_clips_read_back(clip: Clip, tmp_path: Path, order: str, unit: float) -> None:
    first, second = tmp_path / "first.bvh", tmp_path / "second.bvh"
    write_bvh(first, clip, order=order, metres_per_unit=unit)
    back = to_clip(read_bvh(first), "takes", metres_per_unit=unit)
    write_bvh(second, back, order=order, metres_per_unit=unit)
    assert first.read_bytes() == second.read_bytes()
    index = [back.skeleton.names.index(n) for n in clip.skeleton.names]
    ours = forward_kinematics(clip.skeleton, clip.root_position, clip.wxyz)[0]
    theirs = forward_kinematics(back.skeleton, back.root_position, back.wxyz)[0]
    np.testing.assert_allclose(theirs[:, index], ours, atol=1e-5 * max(unit, 0.1))
    assert back.fps == clip.fps
    # The tips are there, and a joint that ends without one got the half bone that it stands for.
    tips = sorted(map(tuple, np.round(back.skeleton.tip_offsets, 4)))
    mine = [*clip.skeleton.tip_offsets, 0.5 * clip.skeleton.offsets[4]]
    np.testing.assert_allclose(tips, sorted(map(tuple, np.round(mine, 4))), atol=2e-4)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(ORDERS))
def test_write_read_write_is_stable(
    tmp_path_factory: pytest.TempPathFactory, seed: int, order: str
) -> None:
    rng = np.random.default_rng(seed)
    skeleton = Skeleton(("a", "b"), np.array([-1, 0]), np.array([[0, 0, 0], [0, 0.3, 0.1]]))
    # Whole quarter turns and nearly so: where Euler angles are at their worst.
    quarters = rng.integers(-4, 5, (30, 2, 3)) * 90.0
    angles = quarters + rng.choice([0, 1e-12, 1e-7, 1e-5, 1e-3, 10], (30, 2, 3))
    clip = Clip(
        "x",
        skeleton,
        60.0,
        rng.normal(size=(30, 3)),
        rotation.from_euler("XYZ", angles, degrees=True),
    )
    folder = tmp_path_factory.getbasetemp()
    write_bvh(folder / "a.bvh", clip, order=order)
    back = to_clip(read_bvh(folder / "a.bvh"), "x", metres_per_unit=0.01)
    write_bvh(folder / "b.bvh", back, order=order)
    assert (folder / "a.bvh").read_bytes() == (folder / "b.bvh").read_bytes()
    assert rotation.angle(back.wxyz, clip.wxyz).max() < 1e-6


def test_what_cannot_be_written(clip: Clip, tmp_path: Path) -> None:
    with pytest.raises(KumiteError, match="'ZZX'; expected one of XYZ"):
        write_bvh(tmp_path / "x.bvh", clip, order="zzx")
    with pytest.raises(KumiteError, match="metres per unit"):
        write_bvh(tmp_path / "x.bvh", clip, metres_per_unit=0.0)
    odd = Skeleton(("a{",), np.array([-1]), np.zeros((1, 3)))
    with pytest.raises(KumiteError, match="cannot stand in a BVH"):
        write_bvh(tmp_path / "x.bvh", Clip("x", odd, 30.0, np.zeros((1, 3)), np.eye(4)[None, :1]))
    assert list(tmp_path.iterdir()) == []
