"""Whether built-in scenes still show the same, byte for byte, and where they first differ if not.

    PYTHONPATH=before/src python benchmarks/golden.py -o before.json   # of the commit before
    python benchmarks/golden.py --against before.json                  # of this one
    python benchmarks/golden.py boxing slip --seconds 2 --against before.json

A golden file holds, of each scene, a digest of everything and one a second of its poses, its things
and its events; beside it ``before.npz`` has what tells where two runs part. Digests depend on the
processor (fused multiply-add) and on the libraries, so files are compared on the machine that made
them, and are not committed. Only what a recording holds in a file is looked at, so any two commits
whose recordings are of one version may be compared.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from llvmlite import binding

from kumite import files
from kumite.cli.ahead import Wanted
from kumite.cli.scenes import live_scene
from kumite.scene import catalogue, record, save_recording
from kumite.scene.recording import KIND, VERSION

SECONDS = 5.0
SEED = 1
POSES = ("root_position", "wxyz", "contacts", "library_frame", "rate")
THINGS = ("object_position",)
KEPT = ("root_position", "object_position")  # as they are; of the rest a digest a frame and body
DIGITS = 16  # of a digest in hex
EVENTS = "events:"  # how a line of a difference in them begins
Row = list[Any]  # frame, kind, character, data: an event as it stands in a recording's file


@dataclass(frozen=True)
class Golden:
    """What a scene showed."""

    fps: float
    names: tuple[str, ...]  # K
    objects: tuple[str, ...]  # O
    arrays: Mapping[str, np.ndarray]  # [F, K or O, …], as recorded
    events: list[Row]

    def __len__(self) -> int:
        return len(self.arrays["root_position"])

    def seconds(self) -> Iterator[slice]:
        """The frames of each second; the last may be shorter."""
        step = round(self.fps)
        for begin in range(0, len(self), step):
            yield slice(begin, min(begin + step, len(self)))

    def digests(self) -> dict[str, Any]:
        """Of all, and of each second by kind. An event counts in the second it is told of; one told
        after the last frame in the last.
        """
        by_kind = {"poses": [], "things": [], "events": []}
        for part in self.seconds():
            by_kind["poses"].append(_digest(*(self.arrays[n][part].tobytes() for n in POSES)))
            by_kind["things"].append(_digest(*(self.arrays[n][part].tobytes() for n in THINGS)))
            stop = part.stop if part.stop < len(self) else np.inf
            told = [e for e in self.events if part.start <= e[0] < stop]
            by_kind["events"].append(_digest(_json(told)))
        whole = _digest(_json([self.names, self.objects]), *(_json(d) for d in by_kind.values()))
        return {"digest": whole, **by_kind}


def run(scene: str, seconds: float, seed: int) -> Golden:
    """Run a scene, and read it as a file would hold it."""
    live = live_scene(Wanted(scene, None, None, None, seed))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{scene}.rec"
        save_recording(path, record(live, seconds))
        header, arrays = files.load(path, KIND, VERSION)
    shape = arrays["root_position"].shape[:2]
    arrays.setdefault("rate", np.ones(shape, np.float32))
    return Golden(
        header["fps"], tuple(header["names"]), tuple(header["objects"]), arrays, header["events"]
    )


def _digest(*parts: bytes) -> str:
    found = hashlib.sha256()
    for part in parts:
        found.update(len(part).to_bytes(8, "little"))
        found.update(part)
    return found.hexdigest()[:DIGITS]


def _json(value: object) -> bytes:
    return json.dumps(value, sort_keys=True, separators=(",", ":")).encode()


def _each(array: np.ndarray) -> np.ndarray:
    """A digest [F, K] uint64 of what an array [F, K, …] says of each body in each frame."""
    rows = np.ascontiguousarray(array).reshape(*array.shape[:2], -1)
    found = [
        hashlib.blake2b(rows[f, k].tobytes(), digest_size=8).digest()
        for f in range(rows.shape[0])
        for k in range(rows.shape[1])
    ]
    return np.frombuffer(b"".join(found), np.uint64).reshape(rows.shape[:2])


def write(path: Path, seconds: float, seed: int, found: Mapping[str, Golden]) -> None:
    """The digests, and beside them what tells where two runs part."""
    arrays: dict[str, np.ndarray] = {}
    for scene, golden in found.items():
        for name in (*POSES, *THINGS):
            kept = golden.arrays[name]
            arrays[f"{scene}/{name}"] = kept if name in KEPT else _each(kept)
    np.savez_compressed(path.with_suffix(".npz"), allow_pickle=False, **arrays)
    said = {
        "seconds": seconds,
        "seed": seed,
        "processor": binding.get_host_cpu_name(),
        "scenes": {
            scene: {
                **golden.digests(),
                "fps": golden.fps,
                "names": golden.names,
                "objects": golden.objects,
                "told": golden.events,
            }
            for scene, golden in found.items()
        },
    }
    path.write_text(json.dumps(said) + "\n", "utf-8")


# Comparing ---------------------------------------------------------------------------------------


def differences(
    scene: str, golden: Golden, said: Mapping[str, Any], arrays: Mapping[str, np.ndarray]
) -> list[str]:
    """In what a scene differs from what a golden file says of it, a line each; what it has run of
    it if that is less.
    """
    out = [
        f"{what}: {_names(now)}; {_names(before)} before"
        for what, now, before in (
            ("characters", golden.names, tuple(said["names"])),
            ("things", golden.objects, tuple(said["objects"])),
            ("frames a second", (f"{golden.fps:g}",), (f"{said['fps']:g}",)),
        )
        if now != before
    ]
    if out:
        return out
    for name in (*POSES, *THINGS):
        line = _first_difference(name, golden, arrays[f"{scene}/{name}"])
        out += [] if line is None else [line]
    ran, other = len(golden), len(arrays[f"{scene}/root_position"])
    stop = np.inf if ran == other else min(ran, other)  # what follows the last frame is told, too
    now, before = ([e for e in told if e[0] < stop] for told in (golden.events, said["told"]))
    return out + _event_differences(now, before, golden.fps)


def _names(names: tuple[str, ...]) -> str:
    return ", ".join(names) if len(names) <= 6 else f"{len(names)} of them"


def _first_difference(name: str, golden: Golden, before: np.ndarray) -> str | None:
    now = golden.arrays[name]
    frames = min(len(now), len(before))
    now, before = now[:frames], before[:frames]
    compared = now if name in KEPT else _each(now)
    if compared.shape != before.shape:
        return f"{name}: {list(compared.shape)}; {list(before.shape)} before"
    # Bytes are compared: -0.0 is not 0.0.
    rows = compared.view(np.uint32) if compared.dtype == np.float32 else compared
    other = before.view(np.uint32) if before.dtype == np.float32 else before
    off = rows != other
    off = off.any(axis=-1) if off.ndim == 3 else off
    if not off.any():
        return None
    f, k = (int(i) for i in np.argwhere(off)[0])
    who = (golden.objects if name in THINGS else golden.names)[k]
    line = f"{name}: first in frame {f} ({f / golden.fps:.2f} s), {who}"
    if name in KEPT:
        apart = np.linalg.norm(np.asarray(now[f, k] - before[f, k], float))
        most = np.linalg.norm(np.asarray(now - before, float), axis=-1).max()
        line += f", {apart:.2g} m apart; at most {most:.2g} m anywhere"
    return f"{line}; {off.sum()} of {off.size} places"


def _event_differences(now: list[Row], before: list[Row], fps: float) -> list[str]:
    if _json(now) == _json(before):
        return []
    if [e[:3] for e in now] == [e[:3] for e in before]:
        return _fields(now, before)
    i = next(
        (i for i, (a, b) in enumerate(zip(now, before)) if a[:3] != b[:3]),
        min(len(now), len(before)),
    )
    said = [_shown(told[i], fps) if i < len(told) else "nothing" for told in (now, before)]
    kinds = Counter(e[1] for e in now), Counter(e[1] for e in before)
    counts = [
        f"{kind} {kinds[0][kind]} ({kinds[1][kind]} before)"
        for kind in sorted(kinds[0] | kinds[1])
        if kinds[0][kind] != kinds[1][kind]
    ]
    return [
        f"{EVENTS} first number {i + 1}: {said[0]}; before: {said[1]}",
        *([f"{EVENTS} {', '.join(counts)}"] if counts else []),
    ]


def _shown(event: Row, fps: float) -> str:
    frame, kind, who, data = event
    return f"frame {frame} ({frame / fps:.2f} s) {kind} of {who} {json.dumps(data)[:100]}"


def _fields(now: list[Row], before: list[Row]) -> list[str]:
    """The same things happen; what is said of them differs."""
    found: dict[tuple[str, str, str], list[tuple[Row, Row]]] = {}
    for a, b in zip(now, before):
        for name in sorted({*a[3], *b[3]}):
            if name in a[3] and name in b[3]:
                if _json(a[3][name]) != _json(b[3][name]):
                    found.setdefault((a[1], name, "differs"), []).append((a, b))
            else:
                how = "is new" if name in a[3] else "is gone"
                found.setdefault((a[1], name, how), []).append((a, b))
    lines = []
    for (kind, name, how), events in found.items():
        a, b = events[0]
        values = [json.dumps(e[3][name])[:60] for e in (a, b) if name in e[3]]
        lines.append(
            f"{EVENTS} {name} of {kind} {how} in {len(events)}: first in frame {a[0]}, {a[2]}: "
            + "; before ".join(values)
        )
    return lines


def main() -> int:
    parser = argparse.ArgumentParser(description="Whether built-in scenes still show the same.")
    parser.add_argument("scene", nargs="*", help="built-in scenes (default: all)")
    parser.add_argument("-o", "--out", type=Path, help="write a golden .json here (and an .npz)")
    parser.add_argument("--against", type=Path, help="compare with a golden .json")
    parser.add_argument("--seconds", type=float, help=f"of each scene (default {SECONDS:g})")
    args = parser.parse_args()
    scenes = args.scene or catalogue.names()
    seconds, seed = args.seconds or SECONDS, SEED
    said, arrays = None, {}
    if args.against:
        said = json.loads(args.against.read_text("utf-8"))
        arrays = np.load(args.against.with_suffix(".npz"))
        seconds, seed = args.seconds or said["seconds"], said["seed"]
        if said["processor"] != binding.get_host_cpu_name():
            print(f"made on another processor ({said['processor']}): digests may differ anyhow")
    found, differ = {}, 0
    for scene in scenes:
        began = time.process_time()
        found[scene] = golden = run(scene, seconds, seed)
        took = f"{time.process_time() - began:.1f} s of processor"
        if said is None:
            print(f"{scene:16} {golden.digests()['digest']}  ({took})", flush=True)
            continue
        if scene not in said["scenes"]:
            print(f"{scene:16} is new  ({took})", flush=True)
            continue
        lines = differences(scene, golden, said["scenes"][scene], arrays)
        differ += bool(lines)
        shown = [line for line in lines if not line.startswith(EVENTS)]
        how = "DIFFERS" if shown else "same but for events" if lines else "same"
        print(f"{scene:16} {how}  ({took})", flush=True)
        for line in lines:
            print(f"    {line}", flush=True)
    if args.out:
        write(args.out, seconds, seed, found)
    if said is not None:
        print(f"{differ} of {len(scenes)} scenes differ")
    return int(differ > 0)


if __name__ == "__main__":
    sys.exit(main())
