"""GLB out: one skinned, animated body a character, and the scene's objects.

glTF 2.0: metres, right-handed, Y up like ours; only its quaternions are xyzw. Each joint is a node;
the skin's inverse bind matrices undo the rest pose, in which no joint is turned. Joints that never
turn get no animation channel; a channel's keys are the recording's frames, or another rate's.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib as gltf

from kumite import files
from kumite.body import BodyMesh, Palette, body_mesh, palettes
from kumite.body.mesh import ROLES
from kumite.checks import fps as checked_fps
from kumite.checks import instance
from kumite.clip import MOST_FRAMES, NO_PARENT, Skeleton
from kumite.errors import KumiteError
from kumite.rotation import continuous, from_yaw, slerp
from kumite.scene.look import Part, shown
from kumite.scene.recording import Recording
from kumite.scene.stage import recorded_objects

GENERATOR = "Kumite"
STILL = 1e-6  # a channel whose values differ by less than this is left out
OBJECT_COLOUR = (0.95, 0.75, 0.15)
_ROUGHNESS = {"gloves": 0.35, "shoes": 0.45, "skin": 0.6, "paint": 0.4, "glass": 0.2}


def write_glb(path: Path | str, recording: Recording, *, fps: float | None = None) -> None:
    """Write a recording as binary glTF. The file appears whole or not at all.

    ``fps``: keys a second, the recording's own unless given.

    Errors: a rate that is not more than 0; a file that cannot be written.
    """
    instance(recording, Recording, "write_glb")
    if fps is not None and fps != recording.fps:
        recording = _at_rate(recording, fps)
    document = _Document(recording.scene, len(recording), recording.fps)
    unarmed = recording.settings.get("unarmed", ())
    skins = {}  # by whether they are armed
    for armed in sorted({name not in unarmed for name in recording.names}):
        skins[armed] = _share_mesh(document, body_mesh(recording.skeleton, armed=armed))
    bind = document.add(_inverse_bind(recording.skeleton), gltf.MAT4)
    outfits = palettes(recording.names)
    for k, name in enumerate(recording.names):
        skin = skins[name not in unarmed]
        _add_character(document, recording, k, name, skin, bind, outfits[k])
    _add_objects(document, recording)
    with files.writing(path) as temporary:
        temporary.write_bytes(document.to_bytes())


def _at_rate(recording: Recording, fps: float) -> Recording:
    """What is seen of a recording, at another rate; marks on frames are those of the frame before.

    Its events are left out: they count frames of the first rate, and GLB holds none.
    """
    fps = checked_fps(fps, f"{recording.scene}: keys a second")
    last = len(recording) - 1
    keys = last * fps / recording.fps
    if keys > MOST_FRAMES:
        raise KumiteError(
            f"{recording.scene}: {keys:.3g} keys at {fps:g} a second; "
            f"expected at most {MOST_FRAMES}"
        )
    at = np.minimum(np.arange(int(keys + 1e-6) + 1) * (recording.fps / fps), last)
    before = (at + 1e-9).astype(np.int64)
    after = np.minimum(before + 1, last)
    part = np.maximum(at - before, 0.0)[:, None, None]

    def between(values: np.ndarray) -> np.ndarray:
        return values[before] * (1 - part) + values[after] * part

    return replace(
        recording,
        fps=fps,
        root_position=between(recording.root_position),
        wxyz=slerp(recording.wxyz[before], recording.wxyz[after], part),
        contacts=recording.contacts[before],
        library_frame=recording.library_frame[before],
        rate=None if recording.rate is None else recording.rate[before],
        object_position=between(recording.object_position),
        events=(),
    )


class _Document:
    """A glTF document and its one buffer, filled from the front."""

    def __init__(self, title: str, frames: int, fps: float) -> None:
        self._times = (np.arange(frames) / fps).astype(np.float32)
        self._top: list[int] = []
        self.root = gltf.GLTF2(
            asset=gltf.Asset(version="2.0", generator=GENERATOR),
            scene=0,
            scenes=[gltf.Scene(name=title, nodes=self._top)],
        )
        self.animation = gltf.Animation(name=title, channels=[], samplers=[])
        self._parts: list[bytes] = []
        self._length = 0

    def add(self, array: np.ndarray, kind: str, *, target: int | None = None, bounds=False) -> int:
        """An array as an accessor in a buffer view of its own; returns the accessor."""
        component = {
            np.dtype(np.float32): gltf.FLOAT,
            np.dtype(np.uint16): gltf.UNSIGNED_SHORT,
            np.dtype(np.uint32): gltf.UNSIGNED_INT,
        }[array.dtype]
        blob = np.ascontiguousarray(array).tobytes()
        blob += b"\0" * (-len(blob) % 4)
        view = gltf.BufferView(
            buffer=0, byteOffset=self._length, byteLength=array.nbytes, target=target
        )
        self._parts.append(blob)
        self._length += len(blob)
        self.root.bufferViews.append(view)
        accessor = gltf.Accessor(
            bufferView=len(self.root.bufferViews) - 1,
            componentType=component,
            count=len(array),
            type=kind,
        )
        if bounds:
            flat = array.reshape(len(array), -1)
            accessor.min = flat.min(axis=0).tolist()
            accessor.max = flat.max(axis=0).tolist()
        self.root.accessors.append(accessor)
        return len(self.root.accessors) - 1

    @cached_property
    def times(self) -> int:
        """The accessor of the keys' times, which all channels share; none where nothing moves."""
        return self.add(self._times, gltf.SCALAR, bounds=True)

    def add_node(self, node: gltf.Node, *, top: bool = False) -> int:
        self.root.nodes.append(node)
        index = len(self.root.nodes) - 1
        if top:
            self._top.append(index)
        return index

    def add_material(self, name: str, colour: tuple[float, float, float], rough: float) -> int:
        linear = [float(_to_linear(c)) for c in colour]
        self.root.materials.append(
            gltf.Material(
                name=name,
                pbrMetallicRoughness=gltf.PbrMetallicRoughness(
                    baseColorFactor=[*linear, 1.0], metallicFactor=0.0, roughnessFactor=rough
                ),
            )
        )
        return len(self.root.materials) - 1

    def animate(self, node: int, path: str, values: np.ndarray, kind: str) -> None:
        """A linear channel, unless the values never change."""
        if np.ptp(values, axis=0).max() < STILL:
            return
        output = self.add(values.astype(np.float32), kind)
        self.animation.samplers.append(
            gltf.AnimationSampler(input=self.times, output=output, interpolation="LINEAR")
        )
        self.animation.channels.append(
            gltf.AnimationChannel(
                sampler=len(self.animation.samplers) - 1,
                target=gltf.AnimationChannelTarget(node=node, path=path),
            )
        )

    def to_bytes(self) -> bytes:
        if self.animation.channels:
            self.root.animations.append(self.animation)
        self.root.buffers.append(gltf.Buffer(byteLength=self._length))
        self.root.set_binary_blob(b"".join(self._parts))
        return b"".join(self.root.save_to_bytes())


def _share_mesh(document: _Document, mesh: BodyMesh) -> list[tuple[str, dict[str, Any], int]]:
    """Vertex data of each colour role, written once for all characters: role, attributes, faces."""
    out = []
    for r, role in enumerate(ROLES):
        used = np.flatnonzero(mesh.role == r)
        if len(used) == 0:
            continue
        span = slice(int(used[0]), int(used[-1]) + 1)
        faces = mesh.faces[mesh.role[mesh.faces[:, 0]] == r] - span.start
        attributes = {
            "POSITION": document.add(
                mesh.vertices[span], gltf.VEC3, target=gltf.ARRAY_BUFFER, bounds=True
            ),
            "NORMAL": document.add(mesh.normals[span], gltf.VEC3, target=gltf.ARRAY_BUFFER),
            "JOINTS_0": document.add(mesh.joints[span], gltf.VEC4, target=gltf.ARRAY_BUFFER),
            "WEIGHTS_0": document.add(mesh.weights[span], gltf.VEC4, target=gltf.ARRAY_BUFFER),
        }
        indices = document.add(
            faces.astype(np.uint16).ravel(), gltf.SCALAR, target=gltf.ELEMENT_ARRAY_BUFFER
        )
        out.append((role, attributes, indices))
    return out


def _inverse_bind(skeleton: Skeleton) -> np.ndarray:
    """Inverse bind matrices [J, 4, 4] float32, each column by column as glTF wants them."""
    matrices = np.tile(np.eye(4, dtype=np.float32), (len(skeleton), 1, 1))
    matrices[:, 3, :3] = -skeleton.rest_positions
    return matrices


def _add_character(
    document: _Document,
    recording: Recording,
    k: int,
    name: str,
    skin_data: list[tuple[str, dict[str, Any], int]],
    bind: int,
    palette: Palette,
) -> None:
    skeleton = recording.skeleton
    primitives = []
    for role, attributes, indices in skin_data:
        r, g, b = (c / 255.0 for c in palette[role])
        material = document.add_material(f"{name} {role}", (r, g, b), _ROUGHNESS.get(role, 0.8))
        primitives.append(
            gltf.Primitive(
                attributes=gltf.Attributes(**attributes), indices=indices, material=material
            )
        )
    document.root.meshes.append(gltf.Mesh(name=f"{name} body", primitives=primitives))

    xyzw = np.roll(continuous(recording.wxyz[:, k]), -1, axis=-1)
    xyzw = xyzw / np.linalg.norm(xyzw, axis=-1, keepdims=True)
    first = len(document.root.nodes)
    for j, joint in enumerate(skeleton.names):
        parent = skeleton.parents[j]
        at = recording.root_position[0, k] if parent == NO_PARENT else skeleton.offsets[j]
        document.add_node(
            gltf.Node(
                name=f"{name}:{joint}",
                translation=[float(x) for x in at],
                rotation=_unit(xyzw[0, j]),
                children=[first + c for c in skeleton.children(j)],
            ),
        )
        document.animate(first + j, "rotation", xyzw[:, j], gltf.VEC4)
    document.animate(first, "translation", recording.root_position[:, k], gltf.VEC3)

    # A node of its own above each skeleton keeps importers from merging two into one armature.
    document.add_node(gltf.Node(name=name, children=[first]), top=True)
    document.root.skins.append(
        gltf.Skin(
            name=name,
            joints=list(range(first, first + len(skeleton))),
            inverseBindMatrices=bind,
            skeleton=first,
        )
    )
    document.add_node(
        gltf.Node(name=name, mesh=len(document.root.meshes) - 1, skin=len(document.root.skins) - 1),
        top=True,
    )


def _unit(xyzw: np.ndarray) -> list[float]:
    """A quaternion whose float64 numbers have unit length, as the specification wants."""
    q = xyzw.astype(np.float64)
    return (q / np.linalg.norm(q)).tolist()


def _add_objects(document: _Document, recording: Recording) -> None:
    """Balls, which share one unit sphere, boxes, cars and lines."""
    sphere = None
    for o, thing in enumerate(recorded_objects(recording)):
        if parts := shown(thing):
            mesh, scale = _add_parts(document, thing.name, parts), None
        else:
            mesh = sphere = _add_sphere(document) if sphere is None else sphere
            scale = [thing.radius] * 3
        xyzw = np.roll(from_yaw(thing.yaw), -1)
        node = gltf.Node(
            name=thing.name,
            mesh=mesh,
            translation=[float(x) for x in recording.object_position[0, o]],
            rotation=_unit(xyzw) if thing.yaw else None,
            scale=scale,
        )
        index = document.add_node(node, top=True)
        document.animate(index, "translation", recording.object_position[:, o], gltf.VEC3)


def _add_sphere(document: _Document) -> int:
    vertices, faces = _sphere()
    material = document.add_material("object", OBJECT_COLOUR, 0.5)
    return _add_mesh(
        document, "sphere", [_primitive(document, vertices, vertices, faces, material)]
    )


def _add_parts(document: _Document, name: str, parts: tuple[Part, ...]) -> int:
    primitives = []
    for part in parts:
        rough = _ROUGHNESS.get(part.name, 0.8)
        material = document.add_material(f"{name} {part.name}", part.colour, rough)
        primitives.append(
            _primitive(
                document, part.vertices, part.normals, part.faces.astype(np.uint16), material
            )
        )
    return _add_mesh(document, name, primitives)


def _add_mesh(document: _Document, name: str, primitives: list[gltf.Primitive]) -> int:
    document.root.meshes.append(gltf.Mesh(name=name, primitives=primitives))
    return len(document.root.meshes) - 1


def _primitive(
    document: _Document,
    vertices: np.ndarray,
    normals: np.ndarray,
    faces: np.ndarray,
    material: int,
) -> gltf.Primitive:
    attributes = gltf.Attributes(
        POSITION=document.add(vertices, gltf.VEC3, target=gltf.ARRAY_BUFFER, bounds=True),
        NORMAL=document.add(normals, gltf.VEC3, target=gltf.ARRAY_BUFFER),
    )
    indices = document.add(faces.ravel(), gltf.SCALAR, target=gltf.ELEMENT_ARRAY_BUFFER)
    return gltf.Primitive(attributes=attributes, indices=indices, material=material)


def _sphere(rings: int = 12, sectors: int = 20) -> tuple[np.ndarray, np.ndarray]:
    """A unit sphere: vertices (and normals) [V, 3] float32, faces [P, 3] uint16."""
    polar = np.linspace(0, np.pi, rings + 1)[1:-1, None]
    around = np.linspace(0, 2 * np.pi, sectors, endpoint=False)[None]
    ring = np.stack(
        [
            np.sin(polar) * np.cos(around),
            np.broadcast_to(np.cos(polar), (rings - 1, sectors)),
            -np.sin(polar) * np.sin(around),
        ],
        axis=-1,
    ).reshape(-1, 3)
    vertices = np.concatenate([[[0, 1, 0]], ring, [[0, -1, 0]]])
    vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    faces = []
    for s in range(sectors):
        t = (s + 1) % sectors
        faces.append((0, 1 + s, 1 + t))
        for r in range(rings - 2):
            a, b = 1 + r * sectors, 1 + (r + 1) * sectors
            faces += [(a + s, b + s, b + t), (a + s, b + t, a + t)]
        last = 1 + (rings - 2) * sectors
        faces.append((len(vertices) - 1, last + t, last + s))
    return vertices.astype(np.float32), np.array(faces, dtype=np.uint16)


def _to_linear(c: float) -> float:
    """sRGB to linear light."""
    return c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4
