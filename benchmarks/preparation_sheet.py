"""Shum et al. 2013, figure 6, on the performer, into docs/: a walk that prepares for boxing.

One row without preparation, one with linear blending, one as we do it; numbers are printed.

python benchmarks/preparation_sheet.py
"""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from kumite import performer
from kumite.annotate import find_contacts, find_cycles, find_mark, find_reference, find_strikes
from kumite.clip import SIDES, Clip, concatenate, facing_frame, forward_kinematics
from kumite.export.sheet import contact_sheet
from kumite.rotation import angle, conjugate, from_yaw, multiply
from kumite.synthesis import Preparation, curves, prepare_clip, references, repeat_cycle

PATH = Path(__file__).parents[1] / "docs" / "preparation-blend.png"
LEVELS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
CYCLES = 4


def main() -> None:
    made = [performer.perform(style, mirrored=False) for style in ("locomotion", "boxing")]
    clips = concatenate(
        [replace(c, name=f"{i} {c.name}") for i, p in enumerate(made) for c in p.clips]
    )
    contacts = find_contacts(clips)
    walking = np.arange(len(clips)) < sum(len(c) for c in made[0].clips)
    cycles = find_cycles(clips, contacts, where=walking)
    walk, on_ground = repeat_cycle(clips, contacts, cycles, cycles.label.index("walk"), CYCLES)

    crosses = [c.name for c in made[1].clips].index("cross")
    cross = next(a for a in made[1].truth[crosses].actions if a.label == "cross")
    first = int(clips.clip_start[len(made[0].clips) + crosses])
    start, stop = first + cross.start, first + cross.stop
    mark = find_mark(clips, start, stop, find_strikes(clips))
    found = find_reference(clips, contacts, start, mark)
    print(f"reference posture: {found}")
    postures = references(clips, [found.frame])

    skeleton = clips.skeleton
    linear = curves(skeleton, {"upper": 1.0})
    ours = curves(skeleton)
    rows = [
        ("none", [walk for _ in LEVELS]),
        ("linear", [prepare_clip(walk, on_ground, postures, a, curve=linear) for a in LEVELS]),
        ("ours", [prepare_clip(walk, on_ground, postures, a) for a in LEVELS]),
    ]
    # The same moment of the walk in each: the left leg swings through.
    frame = int(len(walk) * (CYCLES - 0.75) / CYCLES)
    poses = [(c.root_position[frame], c.wxyz[frame]) for _, row in rows for c in row]
    contact_sheet(
        PATH,
        skeleton,
        np.array([root - [root[0], 0.0, root[2]] for root, _ in poses])[:, None],
        np.array([wxyz for _, wxyz in poses])[:, None],
        list(range(len(poses))),
        columns=len(LEVELS),
        view="three-quarter",
        size=(150, 200),
        labels=[f"{name} {a:.1f}" for name, _ in rows for a in LEVELS],
    )
    print(f"wrote {PATH}")

    upper = ours < 1.0
    for name, row in rows[1:]:
        print(f"\n{name}: level, upper body and legs to go [deg], speed [m/s], slide [mm/s]")
        for a, clip in zip(LEVELS, row):
            away = np.degrees(distance(clip, postures))
            print(
                f"{a:.1f} | {away[:, upper].mean():5.1f} | {away[:, ~upper].mean():5.1f} | "
                f"{speed(clip):.2f} | {1000 * sliding(clip, on_ground):.1f}"
            )
    begin = time.perf_counter()
    prepare_clip(walk, on_ground, postures, 0.5)
    clipwise = 1e6 * (time.perf_counter() - begin) / len(walk)
    print(f"\nµs a character-frame: {clipwise:.1f} of a clip, poses of the walk included;")
    print(*(f"{cost(walk, postures, k):.1f} frame by frame, {k} at once;" for k in (1, 100, 1000)))


def distance(clip: Clip, postures) -> np.ndarray:
    """Angles [F, J] rad to the reference posture, heading aside."""
    wxyz = clip.wxyz.copy()
    yaw = facing_frame(clip.skeleton, clip.root_position, clip.wxyz)[:, 2]
    wxyz[:, 0] = multiply(conjugate(from_yaw(yaw)), wxyz[:, 0])
    return angle(wxyz, postures.wxyz[0])


def speed(clip: Clip) -> float:
    way = clip.root_position[-1] - clip.root_position[0]
    return float(np.hypot(way[0], way[2])) / (len(clip) - 1) * clip.fps


def sliding(clip: Clip, on_ground: np.ndarray) -> float:
    """Mean speed m/s of supporting feet along the ground, of the slower of ankle and toes."""
    position, _ = forward_kinematics(clip.skeleton, clip.root_position, clip.wxyz)
    out = []
    for s, side in enumerate(SIDES):
        parts = [clip.skeleton.joint(f"{side}_{p}") for p in ("foot", "toe")]
        step = np.linalg.norm(np.diff(position[:, parts][..., [0, 2]], axis=0), axis=2).min(axis=1)
        out.append(step[on_ground[1:, s] & on_ground[:-1, s]] * clip.fps)
    return float(np.concatenate(out).mean())


def cost(clip: Clip, postures, count: int) -> float:
    """Microseconds for one frame of one of ``count`` characters: the best of a hundred."""
    work = Preparation(clip.skeleton, clip.fps, postures, count)
    position, _ = forward_kinematics(clip.skeleton, clip.root_position, clip.wxyz)
    facing = facing_frame(clip.skeleton, clip.root_position, clip.wxyz)
    feet = [clip.skeleton.joint(f"{side}_foot") for side in SIDES]
    best = np.inf
    for f in range(100):
        parts = (clip.root_position[f], clip.wxyz[f], facing[f], position[f, feet], [True, False])
        args = [np.repeat(np.asarray(p)[None], count, axis=0) for p in parts]
        begin = time.perf_counter()
        work.show(*args, 0.5)
        best = min(best, time.perf_counter() - begin)
    return 1e6 * best / count


if __name__ == "__main__":
    main()
