"""Small pictures of clips, libraries and recordings, for notebooks."""

from __future__ import annotations

import base64
import html as markup
import io
from dataclasses import replace

import numpy as np
from PIL import Image

from kumite.clip import Clip, ClipSet
from kumite.export.moment_sheet import moment_image
from kumite.export.moments import Moment, moments
from kumite.graph import Layer
from kumite.scene.recording import Recording

CELLS = 6
SIZE = (130, 150)  # pixels of a cell


def html(value: Clip | ClipSet | Layer | Recording) -> str:
    """A strip of six cells as an inline PNG, and what ``repr`` says below it."""
    with io.BytesIO() as file:
        Image.fromarray(strip(value)).save(file, format="PNG")
        data = base64.b64encode(file.getvalue()).decode()
    return (
        f'<div><img src="data:image/png;base64,{data}"><br>'
        f"<code>{markup.escape(repr(value))}</code></div>"
    )


def strip(value: Clip | ClipSet | Layer | Recording) -> np.ndarray:
    """The picture [H, W, 3] uint8: of motion frames at even distances, of a set of clips the middle
    of some, of a recording what happened in it.
    """
    if isinstance(value, Recording):
        found = moments(value, most=CELLS)
        if len(value.names) > CELLS:  # of a crowd the first few are enough to see
            found = [m if m.who else replace(m, who=tuple(range(CELLS))) for m in found]
        return moment_image(value, found, columns=CELLS, size=SIZE)
    if isinstance(value, Clip):
        frames = np.linspace(0, len(value) - 1, CELLS).round().astype(int)
        return _of_frames(value, frames, value.name)
    clips = value.clips if isinstance(value, Layer) else value
    some = np.unique(np.linspace(0, len(clips.names) - 1, CELLS).round().astype(int))
    if len(some) == 1:
        return strip(clips.clip(0))
    middle = (clips.clip_start[some] + clips.clip_start[some + 1]) // 2
    return _of_frames(clips, middle, "")


def _of_frames(motion: Clip | ClipSet, frames: np.ndarray, name: str) -> np.ndarray:
    recording = Recording(
        scene=name,
        fps=motion.fps,
        skeleton=motion.skeleton,
        names=(name or "clips",),
        root_position=motion.root_position[frames, None],
        wxyz=motion.wxyz[frames, None],
        contacts=np.zeros((len(frames), 1, 2), dtype=bool),
        library_frame=np.zeros((len(frames), 1), dtype=np.int32),
    )
    found = [Moment(f) for f in range(len(frames))]
    return moment_image(recording, found, columns=CELLS, size=SIZE, timed=False)
