"""Where a character is between two library frames: its phase, and the capture there.

A phase is a library frame and a fraction of the way to the next, in [0, 1). A character moves on by
its rate, library frames per shown frame; at rate 1 it shows the frames as they were captured.

Shapes: K characters, J joints, F frames.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kumite.kernels.jit import kernel

AT_FRAME = 1e-9  # of a frame: nearer than that a phase is at the frame


class Phase(NamedTuple):
    """A place in the library and how fast it is passed."""

    frame: int
    fraction: float
    rate: float  # library frames per shown frame


@kernel
def following(clip_of_frame, frame):
    """The frame after another, or itself where its clip ends."""
    after = frame + 1
    if after < clip_of_frame.shape[0] and clip_of_frame[after] == clip_of_frame[frame]:
        return after
    return frame


@kernel
def settled(frame, along):
    """Frame and fraction of a phase ``along`` frames after one."""
    whole = np.floor(along + AT_FRAME)
    fraction = along - whole
    return frame + int(whole), fraction if fraction > AT_FRAME else 0.0


@kernel
def move_on(k, frame, fraction, rate, pace):
    """Character k one shown frame on; pace [K] keeps the rate at which it moved."""
    frame[k], fraction[k] = settled(frame[k], fraction[k] + rate[k])
    pace[k] = rate[k]


@kernel
def move_all(frame, fraction, rate, pace):
    """:func:`move_on` for all."""
    for k in range(frame.shape[0]):
        move_on(k, frame, fraction, rate, pace)


@kernel
def earlier(clip_of_frame, frame, fraction, back):
    """Frame and fraction of a phase ``back`` frames before one, no farther than its clip goes."""
    past, at = settled(frame, fraction - back)
    clip = clip_of_frame[frame]
    if past >= 0 and clip_of_frame[past] == clip:
        return past, at
    first = frame
    while first > 0 and clip_of_frame[first - 1] == clip:
        first -= 1
    return first, 0.0


@kernel
def part_way(wxyz, f, g, j, part):
    """Rotation of joint j on the way from frame f to g, by the shorter arc, in scalars.

    The chord's point made a unit again: of frames θ apart it is off the arc by θ³/62 at most.
    """
    w, x, y, z = wxyz[f, j, 0], wxyz[f, j, 1], wxyz[f, j, 2], wxyz[f, j, 3]
    a, b, c, d = wxyz[g, j, 0], wxyz[g, j, 1], wxyz[g, j, 2], wxyz[g, j, 3]
    to = part if w * a + x * b + y * c + z * d >= 0.0 else -part
    left = 1.0 - part
    w, x, y, z = left * w + to * a, left * x + to * b, left * y + to * c, left * z + to * d
    n = 1.0 / np.sqrt(w * w + x * x + y * y + z * z)
    return n * w, n * x, n * y, n * z


@kernel
def sample(capture, frame, fraction, places, turns):
    """The capture at a phase: places [3, 3] of the root and both ankles, rotations [J, 4]."""
    g = following(capture.clip_of_frame, frame) if fraction > 0.0 else frame
    for c in range(3):
        places[0, c] = capture.root[frame, c]
        places[1, c] = capture.ankle[frame, 0, c]
        places[2, c] = capture.ankle[frame, 1, c]
    if fraction > 0.0:
        for c in range(3):
            places[0, c] += fraction * (capture.root[g, c] - places[0, c])
            places[1, c] += fraction * (capture.ankle[g, 0, c] - places[1, c])
            places[2, c] += fraction * (capture.ankle[g, 1, c] - places[2, c])
    for j in range(turns.shape[0]):
        if fraction > 0.0:
            turns[j, 0], turns[j, 1], turns[j, 2], turns[j, 3] = part_way(
                capture.wxyz, frame, g, j, fraction
            )
        else:
            for c in range(4):
                turns[j, c] = capture.wxyz[frame, j, c]


@kernel
def sample_moving(capture, phase, places, turns):
    """The capture a shown frame before a phase and at it: places [2, 3, 3], rotations [2, J, 4].

    Returns by how much to multiply a difference of the two: where the clip does not reach back so
    far, they are nearer in time. At the first frame of a clip nothing moves.
    """
    f, part = earlier(capture.clip_of_frame, phase.frame, phase.fraction, phase.rate)
    sample(capture, f, part, places[0], turns[0])
    sample(capture, phase.frame, phase.fraction, places[1], turns[1])
    apart = (phase.frame - f) + (phase.fraction - part)
    return phase.rate / apart if apart > AT_FRAME else 1.0
