"""What is fuzzed: how a case is made from a generator, and what is done with it.

A case must end in a result or a :class:`KumiteError`. Whatever else it raises is a find.
"""

from __future__ import annotations

import contextlib
import functools
import itertools
import json
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from safetensors.numpy import save as save_tensors

from kumite import files, mocap, performer
from kumite.annotate import (
    find_contacts,
    find_cycles,
    read_actions,
    read_avoidance,
    read_marked,
)
from kumite.body import lay_spheres, load_spheres, save_spheres
from kumite.cli.library import library_lines, library_values
from kumite.clip import Clip, ClipSet, concatenate, resample
from kumite.control import build_table, read_table, trained, write_table
from kumite.control.policy import BEHAVIOURS
from kumite.errors import KumiteError
from kumite.export.bvh import write_bvh
from kumite.export.gltf import write_glb
from kumite.export.moments import moments
from kumite.export.sheet import recording_sheet
from kumite.graph import (
    Layer,
    assess_library,
    build_actions,
    build_frames,
    build_preparation,
    load_library,
    save_library,
)
from kumite.graph.hierarchy import authored_targets
from kumite.mocap.asfamc import read_amc, read_asf
from kumite.mocap.bvh import read_bvh
from kumite.performer import kept
from kumite.scene import (
    Playback,
    World,
    load_recording,
    load_scene,
    measure,
    record,
    save_recording,
)
from kumite.scene import recording as recordings
from kumite.scene.events import Hit, Struck
from kumite.scene.recording import Recording
from kumite.scene.reports import reports
from kumite.scene.wording import describe
from kumite.studio.wording import EventLog, lines_html, score_html, struck
from tests.fuzz import commands, mutate
from tests.telling import THINGS, one_of_each
from tests.test_asfamc import AMC, ASF

Rng = np.random.Generator
Case = Callable[[Rng, Path], None]


# Small things to begin with --------------------------------------------------------------------


@functools.cache
def clips(style: str = "boxing") -> ClipSet:
    made = performer.perform(style, mirrored=False)
    voluntary = [
        c for c, t in zip(made.clips, made.truth) if all(a.kind != "reaction" for a in t.actions)
    ]
    return concatenate([resample(c, 15.0) for c in voluntary[:8]])


@functools.cache
def libraries() -> dict[str, Layer]:
    """One of every level."""
    made = performer.perform("targets", mirrored=False)
    fps = 15.0
    walks = concatenate([resample(c, fps) for c in made.clips])
    targets, contacts = authored_targets(walks, made.truth, made.clips[0].fps), find_contacts(walks)
    cycles = find_cycles(walks, contacts)
    return {
        "frames": build_frames(clips(), avoidance=True, event="both"),
        "actions": build_actions(clips()),
        "preparation": build_preparation(walks, targets, cycles, contacts=contacts),
    }


@functools.cache
def fight() -> Recording:
    """Two who spar, with a ball and an event of every kind that is told."""
    scene = World(load_scene("sparring"), libraries()["frames"], seed=1)
    made = record(scene, 2.0)
    frames = len(made)
    return replace(
        made,
        objects=THINGS,
        object_position=np.full((frames, 3, 3), 0.5, np.float32),
        rate=np.ones((frames, 2), np.float32),
        events=(*made.events, *one_of_each()),
        settings={
            **made.settings,
            "object_radius": {"ball 1": 0.1},
            "object_size": {"car": [1.7, 1.4, 4.0]},
            "object_yaw": {"car": 0.5},
            "object_wheels": ["car"],
            "object_thrown": ["ball 1"],
            "unarmed": ["blue"],
        },
    )


# Files of ours, forged: with a checksum that fits ----------------------------------------------


def forged(path: Path, kind: Any, version: Any, header: Any, arrays: Mapping[str, Any]) -> None:
    """A file as :func:`kumite.files.save` writes it, of whatever content."""
    tensors = {k: np.ascontiguousarray(v) for k, v in sorted(arrays.items())}
    what = {"kind": kind, "version": version, "header": header}
    what["crc32"] = files._checksum(header, tensors)
    path.write_bytes(save_tensors(tensors, metadata={files.META_KEY: json.dumps(what)}))


def _forge(rng: Rng, path: Path, good: Path, kind: str, version: int) -> None:
    header, arrays = _content(good, kind, version)
    for _ in range(int(rng.choice([1, 1, 1, 2]))):
        if rng.random() < 0.55:
            arrays = mutate.arrays(rng, arrays)
        else:
            header = mutate.json_value(rng, header)
    try:
        forged(path, kind, version, header, arrays)
    except (UnicodeEncodeError, ValueError, OverflowError):  # what no file can hold
        path.write_bytes(b"")
    if rng.random() < 0.05:
        path.write_bytes(mutate.text(rng, path.read_bytes()))


@functools.cache
def _content(good: Path, kind: str, version: int) -> tuple[dict, dict]:
    return files.load(good, kind, version)


def _saved(folder: Path, name: str, save: Callable[[Path], None]) -> Path:
    path = folder / "good" / name
    if not path.exists():
        path.parent.mkdir(exist_ok=True)
        save(path)
    return path


_turn = itertools.count()
_deep = True


def _looks_deep(every: int) -> bool:
    """Whether it is a case's turn for what costs more."""
    return _deep and next(_turn) % every == 0


def forged_library(rng: Rng, folder: Path) -> None:
    from kumite.graph.library_file import KIND, VERSION

    level = str(rng.choice(["frames", "actions", "preparation"]))
    good = _saved(folder, f"{level}.kumite", lambda p: save_library(p, libraries()[level]))
    path = folder / "forged.kumite"
    _forge(rng, path, good, KIND, VERSION)
    library = load_library(path)
    library_lines(library)
    json.dumps(library_values(library), allow_nan=False)
    assess_library(library)
    if _looks_deep(8):
        save_library(folder / "again.kumite", library)
        assert load_library(folder / "again.kumite").digest == library.digest
        _run(library.layer(level), level)


def library_commands(rng: Rng, folder: Path) -> None:
    level = str(rng.choice(["frames", "actions", "preparation"]))
    good = _saved(folder, f"{level}.kumite", lambda p: save_library(p, libraries()[level]))
    path = folder / "forged.kumite"
    _forge(rng, path, good, *files.LIBRARY)
    commands.on_library(rng, folder, path, level)


def _learned_enough(batch: int, changed: float) -> None:
    """However many batches a sound library takes to be learned, it is honest work, and no find."""
    if batch >= 20:
        raise KumiteError("learned enough")


def _run(library: Layer, level: str) -> None:
    """Have the characters of a scene made for it do something."""
    from kumite.scene import PrepareScene, World

    if level == "frames":
        scene = World(load_scene("sparring"), library, seed=1)
    elif level == "actions":
        scene = World(load_scene("boxing"), library, seed=1)
    else:
        scene = PrepareScene(load_scene("ball-kick"), library, seed=1, progress=_learned_enough)
    made = record(scene, 1.0)
    measure(made)
    assert np.isfinite(made.root_position).all()


def forged_recording(rng: Rng, folder: Path) -> None:
    good = _saved(folder, "fight.rec", lambda p: save_recording(p, fight()))
    path = folder / "forged.rec"
    _forge(rng, path, good, recordings.KIND, recordings.VERSION)
    made = load_recording(path)
    json.dumps(measure(made).to_json(), allow_nan=False)
    for report in reports(made):
        json.dumps([report.rows, report.columns, report.total], allow_nan=False)
    for moment in moments(made):
        assert 0 <= moment.frame < len(made)
    stage = Playback(made)
    log = EventLog(made.names, counts=("blows", "balls", "errands"))
    while stage.step():
        for event in log.update(stage.events, stage.frame):
            describe(event)
            if isinstance(event, Hit | Struck):
                struck(event)
        lines_html(log, stage.fps, quiet=True)
    score_html(log)
    if _looks_deep(8):
        write_glb(folder / "x.glb", made)
        for name in made.names:
            write_bvh(folder / "x.bvh", made.clip(name))
    if _looks_deep(20):
        recording_sheet(folder / "x.png", made, [0, len(made) - 1], size=(64, 48))


def recording_commands(rng: Rng, folder: Path) -> None:
    good = _saved(folder, "fight.rec", lambda p: save_recording(p, fight()))
    path = folder / "forged.rec"
    _forge(rng, path, good, *files.RECORDING)
    commands.on_recording(rng, folder, path)


def forged_policy(rng: Rng, folder: Path) -> None:
    """A damaged policy is solved again, never believed."""
    library = libraries()["frames"]
    behaviour = BEHAVIOURS["approach"](library)
    good = folder / "good"
    good.mkdir(exist_ok=True)
    known = trained(library, behaviour, good)
    (name,) = (p.name for p in good.glob("approach-*.policy"))
    _forge(rng, folder / name, good / name, "policy", 1)
    found = trained(library, behaviour, folder)
    assert found.value.shape == known.value.shape and np.isfinite(found.value).all()
    assert isinstance(found.converged, bool) and isinstance(found.sweeps, int)


def policy_commands(rng: Rng, folder: Path) -> None:
    library = libraries()["frames"]
    path = _saved(folder, "frames.kumite", lambda p: save_library(p, library))
    good, beside = folder / "good", Path(f"{path}.cache")
    beside.mkdir(exist_ok=True)
    behaviour = BEHAVIOURS[str(rng.choice(["approach", "strike"]))](library)
    trained(library, behaviour, good)
    (name,) = (p.name for p in good.glob(f"{behaviour.name}-*.policy"))
    _forge(rng, beside / name, good / name, "policy", 1)
    commands.on_policy(rng, path)


@functools.cache
def _performance() -> performer.Performance:
    made = performer.perform("boxing", mirrored=False)
    return performer.Performance(made.clips[:2], made.truth[:2])


def forged_performance(rng: Rng, folder: Path) -> None:
    good = _saved(folder, "performance.kumite", lambda p: kept._save(p, _performance()))
    path = folder / "forged-performance.kumite"
    _forge(rng, path, good, kept.KIND, kept.VERSION)
    try:
        made = kept._load(path, armed=False)
    except files.UNREADABLE as error:  # whoever asks makes it anew
        raise KumiteError(str(error)[:100]) from None
    for truth in made.truth:
        json.dumps(performer.truth_to_json(truth), allow_nan=False)


def performance_commands(rng: Rng, folder: Path) -> None:
    good = _saved(folder, "performance.kumite", lambda p: kept._save(p, _performance()))
    path = folder / "forged-performance.kumite"
    _forge(rng, path, good, kept.KIND, kept.VERSION)
    commands.on_performance(rng, folder, path)


# Texts -----------------------------------------------------------------------------------------


def _text_case(sources: Callable[[Path], list[bytes]], ending: str, read: Callable) -> Case:
    """A case that changes one of some texts and has it read."""

    def case(rng: Rng, folder: Path) -> None:
        known = _sources(sources, folder)
        source = mutate.text(rng, known[rng.integers(len(known))], known)
        path = folder / f"fuzz{ending}"
        path.write_bytes(source)
        read(path)

    return case


@functools.cache
def _sources(make: Callable[[Path], list[bytes]], folder: Path) -> list[bytes]:
    return make(folder)


def _bvh_sources(folder: Path) -> list[bytes]:
    short = clips().clip(0)
    write_bvh(folder / "a.bvh", Clip("a", short.skeleton, 15.0, short.root_position[:6],
                                     short.wxyz[:6]))  # fmt: skip
    arm = (
        b"HIERARCHY\nROOT hip\n{\n OFFSET 0 0 0\n CHANNELS 6 Xposition Yposition Zposition "
        b"Zrotation Xrotation Yrotation\n JOINT mid\n {\n  OFFSET 0 10 0\n  CHANNELS 3 Zrotation "
        b"Xrotation Yrotation\n  End Site\n  {\n   OFFSET 0 5 0\n  }\n }\n}\nMOTION\nFrames: 2\n"
        b"Frame Time: 0.0333\n0 90 0 1 2 3 4 5 6\n0 91 0 1.5 2 3 4 5e1 -6\n"
    )
    return [arm, arm, (folder / "a.bvh").read_bytes()]


def _read_bvh(path: Path) -> None:
    raw = read_bvh(path)
    assert np.isfinite(raw.root_position).all() and np.isfinite(raw.wxyz).all()


def _load_bvh(path: Path) -> None:
    mocap.load(path, metres_per_unit=0.01)


def _read_amc(path: Path) -> None:
    raw = read_amc(path, _asf())
    assert np.isfinite(raw.root_position).all() and np.isfinite(raw.wxyz).all()


@functools.cache
def _asf() -> Any:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "small.asf"
        path.write_text(ASF)
        return read_asf(path)


def _scenes(folder: Path) -> list[bytes]:
    found = resources.files("kumite.scene") / "builtin"
    return [p.read_bytes() for p in sorted(found.iterdir(), key=str) if p.name.endswith(".toml")]


def _read_scene(path: Path) -> None:
    load_scene(str(path))


def _settings(folder: Path) -> list[bytes]:
    (folder / "a.bvh").touch()
    return [
        b'fps = 30\nup_axis = "Y"\nmetres_per_unit = 0.01\nground_height = 0.1\n'
        b'[roles]\npelvis = "hips"\nleft_hand = "LeftWrist"\n'
        b'[files."a.bvh"]\nfile_fps = 60\nname = "jab"\n'
    ]


def _read_settings(path: Path) -> None:
    from kumite.mocap.settings import read_settings

    path.rename(path.with_name("kumite.toml"))
    read_settings(path.parent)


def _actions(folder: Path) -> list[bytes]:
    library = libraries()["actions"]
    assert library.actions is not None
    from kumite.annotate import write_actions

    write_actions(folder / "actions.txt", library.actions, library.clips,
                  libraries()["frames"].avoidance)  # fmt: skip
    return [(folder / "actions.txt").read_bytes()]


def _read_actions(path: Path) -> None:
    known = libraries()["actions"].clips
    for read in (read_marked, read_avoidance):
        with contextlib.suppress(KumiteError):
            read(path, known)
    read_actions(path, known)


def _combinations(folder: Path) -> list[bytes]:
    library = libraries()["actions"]
    assert library.actions is not None
    path = folder / "table.toml"
    write_table(path, build_table(library, library.actions))
    return [path.read_bytes()]


def _read_table(path: Path) -> None:
    library = libraries()["actions"]
    assert library.actions is not None
    read_table(path, library, library.actions)


def _spheres(folder: Path) -> list[bytes]:
    skeleton = clips().skeleton
    save_spheres(folder / "spheres.toml", lay_spheres(skeleton), skeleton)
    return [(folder / "spheres.toml").read_bytes()]


def _read_spheres(path: Path) -> None:
    load_spheres(path, clips().skeleton)


def prepare(target: str, deep: bool) -> None:
    """What is made, trained and compiled once is not held against a case. deep: see ``run``."""
    global _deep
    _deep = deep
    if target == "library" and deep:
        for level, library in libraries().items():
            for _ in range(3):  # compiled for one and for many
                with contextlib.suppress(KumiteError):  # it has learned enough
                    _run(library, level)


TARGETS: dict[str, Case] = {
    "library": forged_library,
    "recording": forged_recording,
    "policy": forged_policy,
    "performance": forged_performance,
    "library-commands": library_commands,
    "recording-commands": recording_commands,
    "policy-commands": policy_commands,
    "performance-commands": performance_commands,
    "bvh": _text_case(_bvh_sources, ".bvh", _read_bvh),
    "mocap": _text_case(lambda f: _bvh_sources(f)[-1:], ".bvh", _load_bvh),
    "asf": _text_case(lambda _: [ASF.encode()], ".asf", read_asf),
    "amc": _text_case(lambda _: [AMC.encode()], ".amc", _read_amc),
    "scene": _text_case(_scenes, ".toml", _read_scene),
    "settings": _text_case(_settings, ".toml", _read_settings),
    "actions": _text_case(_actions, ".txt", _read_actions),
    "combinations": _text_case(_combinations, ".toml", _read_table),
    "spheres": _text_case(_spheres, ".toml", _read_spheres),
}
"""What can be fuzzed, by name."""
