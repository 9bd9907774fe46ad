"""Performances kept in a folder, under the code that made them: made once, then read."""

from __future__ import annotations

import contextlib
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from kumite import checks, files
from kumite.checked import checked
from kumite.clip import Clip, runs
from kumite.errors import KumiteError
from kumite.performer.perform import Performance, perform
from kumite.performer.skeleton import skeleton
from kumite.performer.styles import STYLES
from kumite.performer.take import FPS
from kumite.performer.truth import Action, Strike, Truth

KIND, VERSION = "performance", 1


def performed(
    style: str = "boxing", seed: int = 0, *, mirrored: bool = True, cache: Path | None
) -> Performance:
    """What :func:`perform` gives, from the folder ``cache`` where it lies there already."""
    if cache is None or style not in STYLES:
        return perform(style, seed, mirrored=mirrored)
    key = files.code_digest("performer", "body", "clip", "rotation")
    path = cache / f"performance-{style}-{seed}-{'both' if mirrored else 'one'}-{key}.kumite"
    if path.exists():
        with contextlib.suppress(*files.UNREADABLE):  # damaged: made anew
            return _load(path, armed=STYLES[style].armed)
    made = perform(style, seed, mirrored=mirrored)
    with contextlib.suppress(KumiteError):  # a cache that cannot be written only costs time
        cache.mkdir(parents=True, exist_ok=True)
        _save(path, made)
    return made


@checked
def truth_to_json(truth: Truth) -> dict[str, Any]:
    """Strikes, actions and contacts (as runs of frames) of a clip, for a file of its own."""
    contacts = {}
    for s, side in enumerate(("left", "right")):
        contacts[side] = runs(truth.on_ground[:, s]).tolist()
    return {"contacts": contacts, **_events(truth)}


def _events(truth: Truth) -> dict[str, Any]:
    strikes = [
        {
            "frame": s.frame,
            "limb": s.limb,
            "tip": s.tip.tolist(),
            "velocity": s.velocity.tolist(),
        }
        for s in truth.strikes
    ]
    return {"strikes": strikes, "actions": [asdict(a) for a in truth.actions]}


def _save(path: Path, made: Performance) -> None:
    header = {"names": [c.name for c in made.clips], "truth": [_events(t) for t in made.truth]}
    arrays = {
        "frames": np.array([len(c) for c in made.clips]),
        "root_position": np.concatenate([c.root_position for c in made.clips]),
        "wxyz": np.concatenate([c.wxyz for c in made.clips]),
        "on_ground": np.concatenate([t.on_ground for t in made.truth]),
    }
    files.save(path, KIND, VERSION, header, arrays)


def _load(path: Path, *, armed: bool) -> Performance:
    """Errors: as :func:`files.load`; content that is no performance's (``files.UNREADABLE``)."""
    header, arrays = files.load(path, KIND, VERSION)
    frames = checks.array(arrays["frames"], "frames", ("C",), np.int64, least=1)
    names = checks.names(header["names"], "clip names", least=1)
    total = len(arrays["on_ground"])
    if not (len(names) == len(frames) == len(header["truth"]) and sum(frames.tolist()) == total):
        raise KumiteError(f"{path}: damaged {KIND}")
    cuts = np.cumsum(frames)[:-1]
    parts = [np.split(arrays[k], cuts) for k in ("root_position", "wxyz", "on_ground")]
    clips, truths = [], []
    for name, events, count, root, wxyz, on_ground in zip(names, header["truth"], frames, *parts):
        hand = ("left" if name.endswith("_mirrored") else "right") if armed else None
        clips.append(Clip(name, skeleton(armed=hand), FPS, root, wxyz))
        strikes = tuple(
            Strike(s["frame"], s["limb"], s["tip"], s["velocity"]) for s in events["strikes"]
        )
        actions = tuple(Action(**a) for a in events["actions"])
        if len(clips[-1]) != count:
            raise KumiteError(f"{path}: damaged {KIND}")
        truths.append(Truth(on_ground, strikes, actions))
    return Performance(tuple(clips), tuple(truths))
