"""ASF and AMC against matrices worked out a frame at a time, and every kind of damage."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kumite import rotation
from kumite.clip import forward_kinematics
from kumite.errors import KumiteError
from kumite.mocap.asfamc import read_amc, read_asf
from kumite.mocap.bvh import read_bvh
from kumite.mocap.raw import MOST_JOINTS, RawMotion, Stretch

ASF = """# made by hand
:version 1.10
:name small
:units
  mass 1.0
  length 0.45
  angle deg
:documentation
  nothing begin end :here
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
  begin
    id 1
    name upper
    direction 0 1 0
    length 2
    axis 0 0 90 XYZ
    dof rx ry rz
    limits (-160.0 20.0)
           (-70.0 70.0)
           (-60.0 70.0)
  end
  begin
    id 2
    name fixed
    direction 0 0 0
    length 0
    axis 0 0 0 XYZ
  end
  begin
    id 3
    name lower
    direction 1 0 0
    length 3
    axis 30 -40 50 ZXY
    dof rz rx
  end
:hierarchy
  begin
    root upper
    upper fixed
    fixed lower
  end
"""
AMC = """#!OML:ASF small.asf
:FULLY-SPECIFIED
:DEGREES
:SAMPLES-PER-SECOND 60
1
root 1 2 3 0 0 0
upper 0 0 0
lower 0 0
2
root 1 2 3 10 20 30
upper 90 0 0
lower 15 -25
3
root 1 2 3 -10 120 30
upper 10 -40 60
lower 150 -25
"""


def read(tmp_path: Path, asf: str = ASF, amc: str | bytes = AMC) -> RawMotion:
    (tmp_path / "small.asf").write_text(asf)
    (tmp_path / "small.amc").write_bytes(amc if isinstance(amc, bytes) else amc.encode())
    return read_amc(tmp_path / "small.amc", read_asf(tmp_path / "small.asf"))


def positions(raw: RawMotion) -> np.ndarray:
    return forward_kinematics(raw.skeleton, raw.root_position, raw.wxyz)[0]


# The slow twin -----------------------------------------------------------------------------------


def turn(axis: str, degrees: float) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return {
        "x": np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
        "y": np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]),
        "z": np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]),
    }[axis]


def slow_bone_ends(asf: Path, amc: Path) -> list[dict[str, tuple[np.ndarray, np.ndarray]]]:
    """Where every bone begins and ends, a frame at a time, in rows as Lander writes them.

    L = C⁻¹ M C B, with row vectors and rotations transposed: another arrangement than the reader's.
    """
    bones: dict[str, dict[str, list[str]]] = {}
    links: dict[str, list[str]] = {}
    section, bone = "", {}
    for line in asf.read_text().split("\n"):
        words = line.split("#")[0].split()
        if not words:
            continue
        if words[0] in (":root", ":bonedata", ":hierarchy", ":units", ":documentation"):
            section = words[0]
        elif section == ":bonedata" and words[0] == "begin":
            bone = {}
        elif section == ":bonedata" and words[0] == "end":
            bones[bone["name"][0]] = bone
        elif section == ":bonedata":
            bone[words[0]] = words[1:]
        elif section == ":hierarchy" and words[0] not in ("begin", "end"):
            links[words[0]] = words[1:]
    frames: list[dict[str, list[float]]] = []
    for line in amc.read_text().split("\n"):
        words = line.split("#")[0].split()
        if not words or words[0].startswith(":"):
            continue
        if len(words) == 1 and words[0].isdigit():
            frames.append({})
        else:
            frames[-1][words[0]] = [float(w) for w in words[1:]]

    def rows(order: str, degrees: dict[str, float]) -> np.ndarray:
        out = np.eye(3)
        for axis in order:
            out = out @ turn(axis, degrees.get(axis, 0.0)).T
        return out

    result = []
    for frame in frames:
        root = frame["root"]
        world = {"root": rows("xyz", dict(zip("xyz", root[3:])))}
        ends = {"root": (np.array(root[:3]), np.array(root[:3]))}
        todo = ["root"]
        while todo:
            parent = todo.pop()
            for name in links.get(parent, []):
                data = bones[name]
                order = data["axis"][3].lower()
                c = rows(order, dict(zip("xyz", map(float, data["axis"][:3]))))
                dofs = [d[1] for d in data.get("dof", [])]
                m = rows(order, dict(zip(dofs, frame.get(name, []))))
                world[name] = np.linalg.inv(c) @ m @ c @ world[parent]
                along = np.array([float(w) for w in data["direction"]]) * float(data["length"][0])
                ends[name] = (ends[parent][1], ends[parent][1] + along @ world[name])
                todo.append(name)
        result.append(ends)
    return result


def compare(raw: RawMotion, slow: list[dict[str, tuple[np.ndarray, np.ndarray]]]) -> None:
    fast, world = forward_kinematics(raw.skeleton, raw.root_position, raw.wxyz)
    tip_of = dict(zip(raw.skeleton.tip_parents.tolist(), raw.skeleton.tip_offsets))
    assert set(raw.skeleton.names) == set(slow[0])
    for f, ends in enumerate(slow):
        for j, name in enumerate(raw.skeleton.names):
            np.testing.assert_allclose(fast[f, j], ends[name][0], atol=1e-9)
            if j in tip_of:
                end = fast[f, j] + rotation.rotate(world[f, j], tip_of[j])
                np.testing.assert_allclose(end, ends[name][1], atol=1e-9)


def test_positions_worked_out_by_hand(tmp_path: Path) -> None:
    raw = read(tmp_path)
    assert raw.skeleton.names == ("root", "upper", "fixed", "lower")
    assert raw.fps == 60 and raw.fps_stated and raw.metres_per_unit == pytest.approx(0.0254 / 0.45)
    at_rest = positions(raw)[0]
    np.testing.assert_allclose(at_rest, [[1, 2, 3], [1, 2, 3], [1, 4, 3], [1, 4, 3]], atol=1e-12)
    np.testing.assert_allclose(raw.skeleton.tip_offsets, [[3, 0, 0]])
    # The upper bone's x axis is the world's y: it turns the arm, not the bone itself.
    upper = raw.wxyz[1, 1]
    np.testing.assert_allclose(upper, [np.sqrt(0.5), 0, np.sqrt(0.5), 0], atol=1e-12)


def test_small_file_against_the_slow_twin(tmp_path: Path) -> None:
    raw = read(tmp_path)
    compare(raw, slow_bone_ends(tmp_path / "small.asf", tmp_path / "small.amc"))


@pytest.mark.parametrize(
    ("asf", "amc"),
    [("cmu/09/09.asf", "cmu/09/09_03.amc"), ("woody/woody.asf", "woody/1_jump.amc")],
)
def test_real_files_against_the_slow_twin(mocap: Path, asf: str, amc: str) -> None:
    compare(read_amc(mocap / amc, read_asf(mocap / asf)), slow_bone_ends(mocap / asf, mocap / amc))


def test_radians_are_the_same_motion(tmp_path: Path) -> None:
    degrees = read(tmp_path)
    lines = []
    for line in AMC.replace(":DEGREES", ":RADIANS").split("\n"):
        words = line.split()
        if words and words[0] in ("root", "upper", "lower"):
            k = 4 if words[0] == "root" else 1
            turned = [repr(float(np.radians(float(w)))) for w in words[k:]]
            words = [str(w) for w in words[:k]] + turned
        lines.append(" ".join(words))
    radians = read(tmp_path, amc="\n".join(lines))
    np.testing.assert_allclose(radians.wxyz, degrees.wxyz, atol=1e-12)
    unsaid = ASF.replace("deg", "rad").replace("0 0 90 XYZ", "0 0 1.5707963267948966 XYZ")
    unsaid = unsaid.replace(
        "30 -40 50", " ".join(repr(float(np.radians(a))) for a in (30, -40, 50))
    )
    both = read(tmp_path, unsaid, "\n".join(lines).replace(":RADIANS", ""))
    np.testing.assert_allclose(both.wxyz, degrees.wxyz, atol=1e-12)


def test_order_of_values_and_bones_does_not_matter(tmp_path: Path) -> None:
    plain = read(tmp_path)
    amc = AMC.replace("lower 15 -25\n", "").replace("upper 90", "lower 15 -25\nupper 90")
    np.testing.assert_array_equal(read(tmp_path, amc=amc).wxyz, plain.wxyz)
    asf = ASF.replace("TX TY TZ RX RY RZ", "RX RY RZ TX TY TZ")
    amc = AMC.replace("1 2 3 0 0 0", "0 0 0 1 2 3").replace("1 2 3 10 20 30", "10 20 30 1 2 3")
    amc = amc.replace("1 2 3 -10 120 30", "-10 120 30 1 2 3")
    swapped = read(tmp_path, asf, amc)
    np.testing.assert_array_equal(swapped.wxyz, plain.wxyz)
    np.testing.assert_array_equal(swapped.root_position, plain.root_position)


def test_root_position_and_rate(tmp_path: Path) -> None:
    moved = read(tmp_path, ASF.replace("position 0 0 0", "position 0 5 0"))
    assert moved.root_position[0].tolist() == [1, 7, 3]
    silent = read(tmp_path, amc=AMC.replace(":SAMPLES-PER-SECOND 60\n", ""))
    assert silent.fps == 120 and not silent.fps_stated
    given_rate = read_amc(tmp_path / "small.amc", read_asf(tmp_path / "small.asf"), fps=30)
    assert given_rate.fps == 30


def test_the_users_rate_beats_a_broken_one(tmp_path: Path) -> None:
    with pytest.raises(KumiteError, match="else say --file-fps, or file_fps in"):
        read(tmp_path, amc=AMC.replace("SECOND 60", "SECOND 0"))
    raw = read_amc(tmp_path / "small.amc", read_asf(tmp_path / "small.asf"), fps=50)
    assert raw.fps == 50


def test_one_frame_beside_the_range_is_said(tmp_path: Path) -> None:
    raw = read(tmp_path, amc=":FRAME-RANGE 1-4\n" + AMC)
    assert len(raw) == 3 and raw.notes == ("3 frames are read, 4 are declared",)


def test_what_is_left_out_is_said(tmp_path: Path) -> None:
    stretched = read(
        tmp_path,
        ASF.replace("dof rz rx", "dof rz rx l"),
        AMC.replace("lower 0 0", "lower 0 0 0").replace("-25", "-25 0.5"),
    )
    assert "lower" in stretched.notes[0] and stretched.stretch == Stretch("lower", 0.5)
    np.testing.assert_allclose(stretched.wxyz, read(tmp_path).wxyz)
    partial = read(tmp_path, amc="\n".join(r for r in AMC.split("\n") if "lower" not in r))
    assert partial.notes == ("bones that the motion leaves out stay at rest: lower",)
    assert np.all(partial.wxyz[:, 3] == [1, 0, 0, 0])


def test_bvh_and_asf_of_one_performer_agree(mocap: Path) -> None:
    """Seoul's skeleton comes in both formats: the same joints in the same places at rest."""
    ours = read_asf(mocap / "woody/woody.asf").skeleton
    theirs = read_bvh(mocap / "woody/idle_65.bvh").skeleton
    index = {n.lower(): j for j, n in enumerate(theirs.names)} | {"root": 0}
    for j, name in enumerate(ours.names):
        if "dummy" in name.lower() or name == "Spine1":
            continue
        gap = ours.rest_positions[j] - theirs.rest_positions[index[name.lower()]]
        assert np.linalg.norm(gap) * 0.0254 < 0.005, name


def test_reading_is_fast(mocap: Path) -> None:
    asf = read_asf(mocap / "cmu/02/02.asf")
    path = mocap / "cmu/02/02_07.amc"
    read_amc(path, asf)
    start = time.perf_counter()
    frames = len(read_amc(path, asf))
    assert frames / (time.perf_counter() - start) > 20_000


BAD_ASF = {
    "nothing": (lambda s: "", "the file is empty"),
    "cut": (lambda s: s[: s.index("  length 3")], "ends inside bone 'lower'; expected end"),
    "no hierarchy": (lambda s: s.split(":hierarchy")[0], "ends without :hierarchy"),
    "unclosed": (
        lambda s: s.replace("  end\n:hierarchy", ":hierarchy"),
        ":hierarchy' inside a bone",
    ),
    "section": (
        lambda s: s.replace(":name", ":nam"),
        ":3: unknown section ':nam'; expected :version",
    ),
    "key": (
        lambda s: s.replace("length 2", "lenth 2"),
        ":20: unknown key 'lenth'; expected id, name",
    ),
    "number": (lambda s: s.replace("length 2", "length two"), ":20: 'two' is not a number"),
    "nan": (lambda s: s.replace("length 2", "length nan"), ":20: 'nan' is not a number"),
    "direction": (
        lambda s: s.replace("direction 0 1 0", "direction 0 1"),
        "with 2 values; expected 3",
    ),
    "axis": (
        lambda s: s.replace("90 XYZ", "90 XYX"),
        "axis order 'XYX'; expected XYZ in some order",
    ),
    "dof": (
        lambda s: s.replace("rz rx", "rz rw"),
        "unknown degree of freedom 'rw'; expected tx, ty",
    ),
    "dof twice": (lambda s: s.replace("rz rx", "rz rz"), "degrees of freedom twice"),
    "angle": (
        lambda s: s.replace("angle deg", "angle grad"),
        ":7: angle 'grad'; expected deg or rad",
    ),
    "length": (
        lambda s: s.replace("length 0.45", "length 0"),
        ":6: length '0'; expected more than 0",
    ),
    "bone twice": (lambda s: s.replace("name fixed", "name upper"), "bone 'upper' twice"),
    "unnamed": (lambda s: s.replace("    name upper\n", ""), "a bone without a name"),
    "unknown": (lambda s: s.replace("fixed lower", "fixed lowr"), "'lowr'; did you mean 'lower'"),
    "loop": (
        lambda s: s.replace("fixed lower", "fixed lower upper"),
        "'upper' has a parent already",
    ),
    "adrift": (lambda s: s.replace("    fixed lower\n", ""), "hang on nothing: lower"),
}


@pytest.mark.parametrize("kind", BAD_ASF)
def test_damaged_skeletons_are_named(tmp_path: Path, kind: str) -> None:
    damage, message = BAD_ASF[kind]
    with pytest.raises(KumiteError, match=message):
        read(tmp_path, damage(ASF))


BAD_AMC = {
    "nothing": (lambda s: "", "the file is empty"),
    "only a header": (lambda s: s[: s.index("1\nroot")], "ends here; expected frame 1"),
    "cut in a line": (lambda s: s[:-5], ":16: 'lower' with 1 values; expected 2"),
    "cut between lines": (
        lambda s: s[: s.rindex("lower")],
        "frame 3 ends with 2 bones; expected the 3 of the first .differs in lower",
    ),
    "bone": (lambda s: s.replace("upper 90", "uper 90"), ":11: unknown bone 'uper'; did you mean"),
    "count": (
        lambda s: s.replace("upper 90 0 0", "upper 90 0"),
        ":11: 'upper' with 2 values; expected 3",
    ),
    "number": (lambda s: s.replace("upper 90", "upper x"), ":11: 'x' is not a number"),
    "nan": (lambda s: s.replace("upper 90", "upper nan"), ":11: 'nan' is not a number"),
    "inf": (lambda s: s.replace("upper 90", "upper 1e400"), ":11: '1e400' is beyond"),
    "frame left out": (lambda s: s.replace("\n2\n", "\n4\n"), ":9: frame '4' after 1; expected 2"),
    "bone twice": (
        lambda s: s.replace("lower 15", "upper 0 0 0\nlower 15"),
        "'upper' twice in a frame",
    ),
    "no root": (lambda s: s.replace("root 1 2 3 10 20 30\n", ""), "ends without 'root'"),
    "no frame number": (lambda s: s.replace("60\n1\n", "60\n"), ":5: unexpected 'root'"),
    "long digits": (
        lambda s: s.replace("upper 90", "upper 0.12345678901234567891x"),
        ":11: '0.12345678901234567891x' is not a number",
    ),
    "range": (lambda s: ":FRAME-RANGE 1-9\n" + s, "3 frames; expected 9, as :FRAME-RANGE declares"),
    "bad range": (lambda s: ":FRAME-RANGE 9-1\n" + s, "frame range '9-1'; expected like 1-120"),
    "rate": (lambda s: s.replace("SECOND 60", "SECOND 0"), ":4: '0' frames a second"),
    "rate nan": (lambda s: s.replace("SECOND 60", "SECOND nan"), ":4: 'nan' is not a number"),
}


@pytest.mark.parametrize("kind", BAD_AMC)
def test_damaged_motions_are_named(tmp_path: Path, kind: str) -> None:
    damage, message = BAD_AMC[kind]
    with pytest.raises(KumiteError, match=message):
        read(tmp_path, amc=damage(AMC))


def test_other_encodings_are_named(tmp_path: Path) -> None:
    asf, amc = (s.replace("upper", "épaule") for s in (ASF, AMC))
    read(tmp_path, amc=amc.encode("latin-1"), asf=asf)
    (tmp_path / "small.asf").write_bytes(asf.encode("latin-1"))
    raw = read_amc(tmp_path / "small.amc", read_asf(tmp_path / "small.asf"))
    assert raw.skeleton.names[1] == "épaule" and "read as Windows-1252" in raw.notes[0]
    with pytest.raises(KumiteError, match=r"small\.amc:7: byte 0xe9 is not 'utf-8'"):
        read_amc(tmp_path / "small.amc", read_asf(tmp_path / "small.asf"), encoding="utf-8")


def test_deep_skeletons_are_not_recursion(tmp_path: Path) -> None:
    count = MOST_JOINTS
    bones = "".join(f"begin\nname b{k}\ndirection 0 1 0\nlength 1\nend\n" for k in range(count))
    links = "root b0\n" + "".join(f"b{k} b{k + 1}\n" for k in range(count - 1))
    raw = read(tmp_path, f":bonedata\n{bones}:hierarchy\n{links}", "1\nroot 0 0 0 0 0 0\n")
    assert len(raw.skeleton) == count + 1
    with pytest.raises(KumiteError, match="more than 2000 bones"):
        read(tmp_path, f":bonedata\n{bones}begin\nname x\nend\n:hierarchy\n{links}")


PIECES = st.sampled_from(
    ["", " ", "\n", "-", "9", "#", ":", "nan", "1e300", "root", "begin\n", "end"]
)


@settings(max_examples=250, deadline=None)
@given(st.booleans(), st.integers(0, 900), st.integers(0, 40), PIECES | st.text(max_size=4))
def test_mutations_are_a_motion_or_one_error(
    tmp_path_factory: pytest.TempPathFactory, motion: bool, at: int, cut: int, put: str
) -> None:
    folder = tmp_path_factory.getbasetemp()
    sources = {"m.asf": ASF, "m.amc": AMC}
    key = "m.amc" if motion else "m.asf"
    at %= len(sources[key])
    sources[key] = sources[key][:at] + put + sources[key][at + cut :]
    for name, source in sources.items():
        (folder / name).write_bytes(source.encode("utf-8", "surrogatepass"))
    try:
        raw = read_amc(folder / "m.amc", read_asf(folder / "m.asf"))
    except KumiteError as error:
        assert str(error).startswith(str(folder))
    else:
        assert np.isfinite(positions(raw)).all()


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=200), st.binary(max_size=200))
def test_any_bytes_are_one_error(
    tmp_path_factory: pytest.TempPathFactory, a: bytes, b: bytes
) -> None:
    folder = tmp_path_factory.getbasetemp()
    (folder / "z.asf").write_bytes(a)
    (folder / "z.amc").write_bytes(b)
    (folder / "good.asf").write_text(ASF)
    with pytest.raises(KumiteError):
        read_asf(folder / "z.asf")
    with pytest.raises(KumiteError):
        read_amc(folder / "z.amc", read_asf(folder / "good.asf"))
