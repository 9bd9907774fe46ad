"""GLB files: valid for the Khronos validator, and read back by an evaluator of our own."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kumite.body import body_mesh, skin_vertices
from kumite.clip import forward_kinematics, resample
from kumite.errors import KumiteError
from kumite.export.gltf import write_glb
from kumite.rotation import exp
from kumite.scene import Recording
from tests import toys

VALIDATE = """
const fs = require('fs');
const v = require(process.argv[1] + '/node_modules/gltf-validator');
v.validateBytes(new Uint8Array(fs.readFileSync(process.argv[2])))
  .then(r => console.log(JSON.stringify(r.issues)))
"""


@pytest.fixture(scope="module")
def recording() -> Recording:
    """Two characters who flail, and a ball that moves."""
    rng = np.random.default_rng(0)
    s = toys.skeleton()
    frames = 25
    swing = np.cumsum(rng.normal(0, 0.1, (frames, 2, len(s), 3)), axis=0)
    swing[:, :, 1] = 0.0  # a joint that never turns
    root = np.array([0, toys.HIP_HEIGHT, 0]) + np.cumsum(rng.normal(0, 0.02, (frames, 2, 3)), 0)
    return Recording(
        "flail",
        30.0,
        s,
        ("red", "blue"),
        root,
        exp(swing),
        np.ones((frames, 2, 2), bool),
        np.zeros((frames, 2), int),
        ("ball",),
        np.cumsum(np.full((frames, 1, 3), 0.01), axis=0),
        settings={"object_radius": {"ball": 0.2}},
    )


@pytest.fixture(scope="module")
def written(recording: Recording, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("glb") / "flail.glb"
    write_glb(path, recording)
    return path


def parse(path: Path) -> tuple[dict, bytes]:
    blob = path.read_bytes()
    assert blob[:4] == b"glTF" and int.from_bytes(blob[8:12], "little") == len(blob)
    size = int.from_bytes(blob[12:16], "little")
    return json.loads(blob[20 : 20 + size]), blob[28 + size :]


def read(document: dict, binary: bytes, accessor: int) -> np.ndarray:
    a = document["accessors"][accessor]
    view = document["bufferViews"][a["bufferView"]]
    dtype = {5126: np.float32, 5123: np.uint16, 5125: np.uint32}[a["componentType"]]
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}[a["type"]]
    start = view.get("byteOffset", 0)
    flat = np.frombuffer(binary, dtype, a["count"] * width, start)
    return flat.reshape(a["count"], width)


def matrix(translation, xyzw, scale=(1, 1, 1)) -> np.ndarray:
    x, y, z, w = xyzw
    m = np.eye(4)
    m[:3, :3] = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    ) * np.array(scale)
    m[:3, 3] = translation
    return m


def worlds(document: dict, binary: bytes, frame: int) -> dict[int, np.ndarray]:
    """World matrices of all nodes at a frame, as a player of glTF would find them."""
    local = {
        n: {
            "translation": node.get("translation", [0, 0, 0]),
            "rotation": node.get("rotation", [0, 0, 0, 1]),
            "scale": node.get("scale", [1, 1, 1]),
        }
        for n, node in enumerate(document["nodes"])
    }
    animation = document["animations"][0]
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        value = read(document, binary, sampler["output"])[frame]
        local[channel["target"]["node"]][channel["target"]["path"]] = value
    out: dict[int, np.ndarray] = {}

    def visit(n: int, above: np.ndarray) -> None:
        v = local[n]
        out[n] = above @ matrix(v["translation"], v["rotation"], v["scale"])
        for child in document["nodes"][n].get("children", []):
            visit(child, out[n])

    for n in document["scenes"][0]["nodes"]:
        visit(n, np.eye(4))
    return out


def test_a_box_is_a_car_that_points_its_way(recording: Recording, tmp_path: Path):
    size, yaw = [1.7, 1.4, 4.0], 2.2
    told = {"object_radius": {"ball": 2.0}, "object_size": {"ball": size}}
    boxed = replace(recording, settings={**told, "object_yaw": {"ball": yaw}})
    write_glb(tmp_path / "box.glb", boxed)
    document, binary = parse(tmp_path / "box.glb")
    (n,) = (n for n, node in enumerate(document["nodes"]) if node["name"] == "ball")
    parts = document["meshes"][document["nodes"][n]["mesh"]]["primitives"]
    assert len(parts) == 3
    own = np.concatenate([read(document, binary, p["attributes"]["POSITION"]) for p in parts])
    assert np.allclose(np.ptp(own, axis=0), size, atol=0.02)
    front = np.array([0.0, 0.0, 2.0, 1.0])
    at = (worlds(document, binary, 7)[n] @ front)[:3] - boxed.object_position[7, 0]
    assert np.allclose(at, [2.0 * np.sin(yaw), 0.0, 2.0 * np.cos(yaw)], atol=1e-4)


def test_a_box_without_wheels_is_a_plain_box(recording: Recording, tmp_path: Path):
    size, yaw = np.array([2.4, 0.06, 0.3]), 0.7
    told = {"object_size": {"ball": size.tolist()}, "object_yaw": {"ball": yaw}}
    write_glb(tmp_path / "bar.glb", replace(recording, settings={**told, "object_wheels": []}))
    document, binary = parse(tmp_path / "bar.glb")
    (n,) = (n for n, node in enumerate(document["nodes"]) if node["name"] == "ball")
    (part,) = document["meshes"][document["nodes"][n]["mesh"]]["primitives"]
    own = read(document, binary, part["attributes"]["POSITION"]).astype(float)
    assert np.allclose(np.unique(own, axis=0), np.unique(0.5 * size * np.sign(own), axis=0))
    assert len(np.unique(own, axis=0)) == 8
    triangles = own[read(document, binary, part["indices"]).reshape(-1, 3)]
    a, b, c = triangles.transpose(1, 0, 2)
    # Closed, and turned outwards: the volume below its triangles is the box's.
    assert np.sum(np.cross(a, b) * c) / 6 == pytest.approx(size.prod(), rel=1e-5)
    normals = read(document, binary, part["attributes"]["NORMAL"])
    assert np.allclose(np.sum(normals * own, axis=1), np.abs(normals) @ (0.5 * size), atol=1e-6)
    end = (worlds(document, binary, 7)[n] @ [1.2, 0.0, 0.0, 1.0])[:3]
    at = end - recording.object_position[7, 0]
    assert np.allclose(at, [1.2 * np.cos(yaw), 0.0, -1.2 * np.sin(yaw)], atol=1e-4)


def test_joints_and_skin_are_where_ours_are(recording: Recording, written: Path):
    document, binary = parse(written)
    mesh = body_mesh(recording.skeleton)
    times = read(document, binary, document["animations"][0]["samplers"][0]["input"])
    assert np.allclose(np.diff(times[:, 0]), 1 / 30, atol=1e-6)
    for frame in (0, 7, 24):
        world = worlds(document, binary, frame)
        for k in range(2):
            pose = recording.root_position[frame, k], recording.wxyz[frame, k]
            position, turn = (
                x[0] for x in forward_kinematics(recording.skeleton, *(p[None] for p in pose))
            )
            skin = document["skins"][k]
            got = np.array([world[j][:3, 3] for j in skin["joints"]])
            assert np.allclose(got, position, atol=1e-4)
            bind = read(document, binary, skin["inverseBindMatrices"]).reshape(-1, 4, 4)
            carry = np.array([world[j] @ b.T for j, b in zip(skin["joints"], bind)])
            expected, _ = skin_vertices(mesh, recording.skeleton, position, turn)
            at = 0
            for primitive in document["meshes"][k]["primitives"]:
                a = primitive["attributes"]
                p, j, w = (
                    read(document, binary, a[n]) for n in ("POSITION", "JOINTS_0", "WEIGHTS_0")
                )
                h = np.concatenate([p, np.ones((len(p), 1))], axis=1)
                v = np.einsum("vk,vkab,vb->va", w, carry[j], h)[:, :3]
                assert np.allclose(v, expected[at : at + len(v)], atol=2e-4)
                at += len(v)
            assert at == len(mesh)


def test_the_ball_moves_and_still_joints_are_left_out(recording: Recording, written: Path):
    document, binary = parse(written)
    (ball,) = (n for n, node in enumerate(document["nodes"]) if node["name"] == "ball")
    world = worlds(document, binary, 20)
    assert np.allclose(world[ball][:3, 3], recording.object_position[20, 0], atol=1e-5)
    assert world[ball][0, 0] == pytest.approx(0.2)
    (still,) = (n for n, node in enumerate(document["nodes"]) if node["name"] == "red:spine")
    assert all(c["target"]["node"] != still for c in document["animations"][0]["channels"])


def test_a_recording_in_which_nothing_moves(recording: Recording, tmp_path: Path):
    """A single picture, and bodies that stand still: no animation, and nothing left unused."""
    one = replace(
        recording,
        **{
            name: getattr(recording, name)[:1]
            for name in ("root_position", "wxyz", "contacts", "library_frame", "object_position")
        },
    )
    write_glb(tmp_path / "one.glb", one)
    document, _ = parse(tmp_path / "one.glb")
    assert not document.get("animations")
    used = {p[k] for m in document["meshes"] for p in m["primitives"] for k in ("indices",)}
    used |= {
        a for m in document["meshes"] for p in m["primitives"] for a in p["attributes"].values()
    }
    used |= {s["inverseBindMatrices"] for s in document["skins"]}
    assert used == set(range(len(document["accessors"])))


@pytest.mark.parametrize("fps", [12.0, 60.0])
def test_another_rate(recording: Recording, tmp_path: Path, fps: float):
    """The keys of each character are those of its clip resampled, and the ball keeps its pace."""
    write_glb(tmp_path / "rate.glb", recording, fps=fps)
    document, binary = parse(tmp_path / "rate.glb")
    times = read(document, binary, document["animations"][0]["samplers"][0]["input"])[:, 0]
    assert np.allclose(np.diff(times), 1 / fps, atol=1e-6)
    assert recording.seconds - 2 / 12 <= times[-1] <= recording.seconds
    key = len(times) - 2
    world = worlds(document, binary, key)
    for k, name in enumerate(recording.names):
        clip = resample(recording.clip(name), fps)
        assert len(clip) == len(times)
        position, _ = forward_kinematics(clip.skeleton, clip.root_position, clip.wxyz)
        got = np.array([world[j][:3, 3] for j in document["skins"][k]["joints"]])
        assert np.allclose(got, position[key], atol=1e-4)
    (ball,) = (n for n, node in enumerate(document["nodes"]) if node["name"] == "ball")
    assert np.allclose(world[ball][:3, 3], 0.01 + 0.3 * times[key], atol=1e-5)


def test_what_cannot_be_written(recording: Recording, tmp_path: Path):
    bad = recording.wxyz.copy()
    bad[3, 0, 0, 0] = np.nan
    with pytest.raises(KumiteError, match="expected finite"):
        replace(recording, wxyz=bad)
    for fps, message in ((0.0, "more than 0"), (float("nan"), "more than 0"), (1e9, "at most")):
        with pytest.raises(KumiteError, match=message):
            write_glb(tmp_path / "bad.glb", recording, fps=fps)
    assert not list(tmp_path.iterdir())


def test_same_recording_same_bytes(recording: Recording, written: Path, tmp_path: Path):
    write_glb(tmp_path / "again.glb", recording)
    assert (tmp_path / "again.glb").read_bytes() == written.read_bytes()


def test_the_khronos_validator_finds_nothing(written: Path):
    folder = os.environ.get("KUMITE_GLTF_VALIDATOR")
    if not folder or not shutil.which("node"):
        if os.environ.get("CI"):
            pytest.fail("KUMITE_GLTF_VALIDATOR must name the validator's folder on CI")
        pytest.skip("KUMITE_GLTF_VALIDATOR does not name a folder with gltf-validator")
    done = subprocess.run(
        ["node", "-e", VALIDATE, folder, str(written)], capture_output=True, text=True, check=True
    )
    issues = json.loads(done.stdout)
    assert issues["numErrors"] == issues["numWarnings"] == 0, issues["messages"]
    assert issues["numInfos"] == issues["numHints"] == 0, issues["messages"]
