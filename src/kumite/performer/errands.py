"""Targets: walk up, crawl or duck under, jump over, kick a ball, kick or punch, and walk on.

Who is about to do one of these takes up a posture for it first, on both feet: a motion to a target
gets ready, and its mark, the first frame of the movement itself, is where it leaves that posture.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from kumite.performer.locomotion import FEET, MOVES, STAND
from kumite.performer.moves import Blow, Key, Move, Plant, Step, Style, Take, Value, aim, put

_GAIT = ("walk", "walk_start", "walk_stop")
_WALKS = tuple(m for m in MOVES if m.label in (*_GAIT, "stand", "run", "run_start", "run_stop"))

MARK = 0.04  # s from the ready posture on, before the first foot is lifted


def _ready(seconds: float, posture: Mapping[str, Value], move: Move) -> Move:
    """A move that first gets ready: ``seconds`` to a posture, by channel, on both feet.

    The posture is in balance and far from standing (20° a joint of the upper body and more), so that
    a walk that takes it on shows what is to come. The move is written from there on: its keys, steps,
    plants and blows come as much later.
    """
    keys: dict[str, tuple[Key, ...]] = {c: ((seconds, v),) for c, v in posture.items()}
    for c, rest in move.keys.items():
        keys[c] = keys.get(c, ()) + tuple((seconds + t, v) for t, v in rest)
    return replace(
        move,
        seconds=seconds + move.seconds,
        keys=keys,
        steps=tuple(replace(s, lift=seconds + s.lift, land=seconds + s.land) for s in move.steps),
        blows=tuple(replace(b, time=seconds + b.time) for b in move.blows),
        plants=tuple(
            replace(p, start=seconds + p.start, stop=seconds + p.stop) for p in move.plants
        ),
        mark=seconds + MARK,
    )


TARGETS: tuple[Move, ...] = (
    _ready(
        0.45,
        {"pelvis": (0, -0.12, -0.08), "pelvis_turn": (0, 14, 0), "chest_turn": (0, 52, 0), "head_turn": (0, 24, 0),
         "left_hand": put(0.25, 0.72, 0.26), "right_hand": put(-0.25, 0.72, 0.26), "heel": (0, 0)},
        Move(
            "duck_under", "target", 2.30,
            {"pelvis": ((0.75, (0, -0.34, -0.06)), (1.45, (0, -0.34, -0.06)), (1.95, (0, -0.03, 0))),
             "pelvis_turn": ((0.75, (0, 20, 0)), (1.45, (0, 20, 0))),
             "chest_turn": ((0.78, (0, 60, 0)), (1.42, (0, 60, 0)), (1.90, (0, 6, 0))),
             "head_turn": ((0.75, (0, 34, 0)), (1.45, (0, 30, 0))),
             "left_hand": ((0.72, put(0.30, 0.62, 0.26)), (1.45, put(0.30, 0.60, 0.28))), "right_hand": ((0.72, put(-0.30, 0.62, 0.26)), (1.45, put(-0.30, 0.60, 0.28))),
             "heel": ((0.70, (14, 14)), (1.45, (14, 14)))},
            (Step("left", 0.10, 0.44, 0.07, True), Step("right", 0.52, 0.88, 0.07, True), Step("left", 0.98, 1.34, 0.07, True),
             Step("right", 1.44, 1.78, 0.07), Step("left", 1.84, 2.12, 0.06)),
            (0, 1.50, 0), glide="ease",
        ),
    ),
    _ready(
        0.50,
        {"pelvis": (0, -0.16, -0.09), "pelvis_turn": (0, 18, 0), "chest_turn": (0, 62, 0), "head_turn": (0, 12, 0),
         "left_hand": put(0.24, 0.66, 0.56), "right_hand": put(-0.24, 0.66, 0.56), "heel": (0, 0)},
        Move(
            "crawl_under", "target", 4.60,
            {"pelvis": ((0.40, (0, -0.30, -0.06)), (0.95, (0, -0.43, 0.0)), (3.10, (0, -0.43, 0.0)), (3.75, (0, -0.32, -0.02)), (4.25, (0, -0.06, 0))),
             "pelvis_turn": ((0.95, (0, 60, 0)), (3.05, (0, 60, 0)), (3.75, (0, 20, 0))),
             "chest_turn": ((0.95, (0, 82, 0)), (3.05, (0, 82, 0)), (3.75, (0, 38, 0)), (4.2, (0, 6, 0))),
             "head_turn": ((0.95, (0, 40, 0)), (3.15, (0, 40, 0)), (3.75, (0, 8, 0))),
             "left_hand": ((0.74, put(0.26, 0.22, 0.54)), (3.10, put(0.21, 0.16, 0.50)), (3.75, put(0.27, 0.60, 0.36))), "right_hand": ((0.74, put(-0.26, 0.22, 0.54)), (3.00, put(-0.21, 0.16, 0.50)), (3.75, put(-0.27, 0.60, 0.36))),
             "heel": ((0.60, (34, 34)), (0.95, (58, 58)), (3.20, (58, 58)), (3.7, (24, 24)))},
            (Step("left", 0.30, 0.58, 0.05, True, (0.14, -0.36, 2.0)), Step("right", 0.58, 0.84, 0.05, True, (-0.14, -0.36, -2.0)),
             Step("left", 1.02, 1.34, 0.05, True, (0.14, -0.36, 2.0)), Step("right", 1.46, 1.78, 0.05, True, (-0.14, -0.36, -2.0)),
             Step("left", 1.90, 2.22, 0.05, True, (0.14, -0.36, 2.0)), Step("right", 2.34, 2.66, 0.05, True, (-0.14, -0.36, -2.0)),
             Step("left", 2.78, 3.10, 0.05, True, (0.12, -0.14, 4.0)), Step("right", 3.30, 3.62, 0.06), Step("left", 3.78, 4.06, 0.05)),
            (0, 1.30, 0),
            plants=(Plant("left_hand", 0.92, 1.44, (0.21, 0.07, 0.50)), Plant("right_hand", 0.92, 1.02, (-0.21, 0.07, 0.50), 0.12),
                    Plant("right_hand", 1.32, 1.90, (-0.21, 0.07, 0.52)), Plant("left_hand", 1.76, 2.34, (0.21, 0.07, 0.52)),
                    Plant("right_hand", 2.20, 2.78, (-0.21, 0.07, 0.52)), Plant("left_hand", 2.64, 3.12, (0.21, 0.07, 0.52))),
        ),
    ),
    _ready(
        0.50,
        {"pelvis": (0, -0.14, -0.02), "pelvis_turn": (0, 10, 0), "chest_turn": (0, 52, 0), "head_turn": (0, 2, 0),
         "left_hand": put(0.38, 1.14, -0.24), "right_hand": put(-0.38, 1.14, -0.24), "elbow": (0.25, 0.25), "heel": (0, 0)},
        Move(
            "jump_over", "target", 1.95,
            {"pelvis": ((0.40, (0, -0.13, -0.02)), (0.58, (0, -0.02, 0.02)), (0.80, (0, 0.20, 0.02)), (1.02, (0, 0.0, 0.0)), (1.16, (0, -0.17, -0.02)), (1.55, (0, -0.02, 0))),
             "pelvis_turn": ((0.42, (0, 8, 0)), (0.80, (0, 4, 0)), (1.16, (0, 10, 0))),
             "chest_turn": ((0.42, (0, 32, 0)), (0.62, (0, 8, 0)), (0.80, (0, 20, 0)), (1.16, (0, 22, 0))),
             "head_turn": ((0.42, (0, 10, 0)), (1.16, (0, 12, 0))),
             "left_foot": ((0.74, (0, 0.34, 0.02)), (0.86, (0, 0.34, 0.06))), "right_foot": ((0.72, (0, 0.36, 0.08)), (0.84, (0, 0.36, 0.08))),
             "left_hand": ((0.42, (0.30, 0.86, -0.16)), (0.66, (0.42, 1.22, 0.32)), (0.95, (0.44, 1.16, 0.26)), (1.25, (0.32, 0.92, 0.16))),
             "right_hand": ((0.42, (-0.30, 0.86, -0.16)), (0.66, (-0.42, 1.22, 0.32)), (0.95, (-0.44, 1.16, 0.26)), (1.25, (-0.32, 0.92, 0.16))),
             "elbow": ((0.42, (0, 0)),), "heel": ((0.50, (20, 34)), (0.80, (20, 22)), (1.00, (12, 12)), (1.12, (2, 2)))},
            (Step("left", 0.08, 0.36, 0.07, True), Step("right", 0.52, 1.00, 0.12), Step("left", 0.60, 1.06, 0.12), Step("right", 1.40, 1.64, 0.05)),
            (0, 1.35, 0),
        ),
    ),
    _ready(
        0.42,
        {"pelvis": (-0.02, -0.07, -0.05), "pelvis_turn": (-8, 8, 0), "chest_turn": (12, 28, 0), "head_turn": (0, 26, 0),
         "left_hand": put(0.64, 1.10, 0.12), "right_hand": put(-0.62, 1.12, 0.02), "elbow": (0.2, 0.2), "heel": (0, 0)},
        Move(
            "kick_ball", "target", 1.85,
            {"pelvis": ((0.36, (0.03, -0.05, -0.04)), (0.70, (0.07, -0.05, 0.01)), (0.95, (0.06, -0.02, 0.02)), (1.30, (0.01, -0.02, 0))),
             "pelvis_turn": ((0.48, (-16, 4, 0)), (0.74, (18, -4, 0)), (0.92, (22, -6, 0))),
             "chest_turn": ((0.48, (10, 6, 0)), (0.74, (-12, 2, -4)), (0.92, (-16, 0, -4))), "head_turn": ((0.45, (0, 22, 0)), (0.75, (0, 20, 0)), (1.0, (0, 4, 0))),
             "right_foot": ((0.60, (-0.04, 0.20, -0.36)), (0.72, aim(0, 0, -0.08)), (0.77, aim(0.02, 0.10, 0.20)), (0.88, aim(0.06, 0.44, 0.36)), (1.12, (0, 0.14, 0.06))),
             "left_hand": ((0.50, (0.40, 0.95, -0.12)), (0.78, (0.34, 0.98, 0.30)), (1.05, (0.30, 0.86, 0.12))), "right_hand": ((0.50, (-0.30, 0.90, 0.22)), (0.78, (-0.38, 0.90, -0.20)), (1.05, (-0.30, 0.84, 0.0))),
             "elbow": ((0.60, (0, 0)),), "heel": ((0.40, (0, 30)), (0.55, (4, 56)), (0.70, (10, 40)), (0.90, (24, 4)), (1.10, (4, 0)))},
            (Step("left", 0.08, 0.38, 0.07, True), Step("right", 0.36, 1.28, 0.05), Step("left", 1.40, 1.66, 0.05)),
            (0, 0.50, 0), (Blow("right_foot", 0.72, (-6, 0.44, 0.11)),),
        ),
    ),
    _ready(
        0.40,
        {"pelvis": (0, -0.07, -0.04), "pelvis_turn": (0, 4, 0), "chest_turn": (-4, 18, 0), "head_turn": (0, 12, 0),
         "left_hand": (0.13, 1.42, 0.28), "right_hand": (-0.13, 1.42, 0.24), "heel": (0, 0)},
        Move(
            "front_kick", "target", 1.85,
            {"pelvis": ((0.36, (0.05, -0.03, -0.02)), (0.66, (0.09, 0.0, 0.05)), (0.84, (0.09, -0.01, 0.03)), (1.25, (0.01, -0.02, 0))),
             "pelvis_turn": ((0.50, (2, -4, 0)), (0.68, (12, -20, 0)), (0.82, (8, -12, 0))),
             "chest_turn": ((0.50, (-4, 4, 0)), (0.68, (6, -18, 0)), (0.82, (2, -8, 0))), "head_turn": ((0.6, (0, 4, 0)),),
             "right_foot": ((0.56, put(-0.06, 0.54, 0.26)), (0.68, aim(0, 0.0, -0.04)), (0.72, aim(0, 0.02, 0.12)), (0.90, put(-0.06, 0.50, 0.34)), (1.08, (0, 0.12, 0.06))),
             "left_hand": ((0.44, (0.20, 1.26, 0.32)), (0.85, (0.22, 1.22, 0.28))), "right_hand": ((0.44, (-0.20, 1.26, 0.28)), (0.85, (-0.24, 1.18, 0.20))),
             "heel": ((0.40, (0, 24)), (0.54, (2, 10)), (0.68, (14, -62)), (0.76, (14, -60)), (0.92, (4, -6)), (1.1, (2, 0)))},
            (Step("left", 0.08, 0.36, 0.07, True), Step("right", 0.34, 1.22, 0.05), Step("left", 1.38, 1.64, 0.05)),
            (0, 0.36, 0), (Blow("right_foot", 0.68, (-2, 0.84, 0.98)),),
        ),
    ),
    _ready(
        0.38,
        {"pelvis": (0, -0.09, -0.04), "pelvis_turn": (-22, 4, 0), "chest_turn": (-40, 8, 0), "head_turn": (-4, 8, 0),
         "left_hand": put(0.10, 1.34, 0.42), "right_hand": put(-0.27, 1.08, -0.08), "heel": (0, 0)},
        Move(
            "punch", "target", 1.55,
            {"pelvis": ((0.30, (0, -0.08, -0.03)), (0.62, (0.02, -0.10, 0.10)), (0.78, (0.02, -0.09, 0.08))),
             "pelvis_turn": ((0.40, (-34, 4, 0)), (0.62, (20, 4, 0)), (0.76, (16, 4, 0))),
             "chest_turn": ((0.42, (-46, 8, 0)), (0.62, (38, 10, 0)), (0.76, (30, 9, 0))), "head_turn": ((0.42, (-4, 8, 0)), (0.64, (0, 8, 0))),
             "left_hand": ((0.36, put(0.10, 1.36, 0.46)), (0.64, put(0.22, 1.32, 0.20)), (0.90, put(0.20, 1.20, 0.26))),
             "right_hand": ((0.40, put(-0.22, 1.28, 0.06)), (0.50, put(-0.20, 1.30, 0.18)), (0.60, aim()), (0.645, aim(0, 0, 0.22)), (0.90, put(-0.16, 1.24, 0.34)), (1.15, put(-0.26, 1.0, 0.20))),
             "elbow": ((0.58, (0.15, 0.3)),), "heel": ((0.45, (0, 16)), (0.62, (0, 46)), (0.80, (0, 38)))},
            (Step("left", 0.06, 0.36, 0.07, to=(0.12, 0.42, -6.0)), Step("left", 0.98, 1.24, 0.06),
                Step("right", 1.26, 1.48, 0.04)),
            blows=(Blow("right_hand", 0.60, (0, 0.84, 1.42)),),
        ),
    ),
)  # fmt: skip


def _errand(target: str, gait: str = "walk") -> tuple[str, ...]:
    approach = (f"{gait}_start", *[gait] * 3, f"{gait}_stop")
    return (
        "stand",
        *approach,
        target,
        "walk_start",
        "walk",
        "walk_stop",
        target,
        *approach,
    )


ERRANDS = Style(
    "targets",
    STAND,
    FEET,
    (*_WALKS, *TARGETS),
    {
        **{m.label: Take(_errand(m.label)) for m in TARGETS},
        "running_jump": Take(_errand("jump_over", "run")),
        "course": Take(
            ("stand", "walk_start", "walk", "walk_stop", "jump_over", "walk_start", "walk_stop", "duck_under", "walk_start",
             "walk", "walk_stop", "crawl_under", "walk_start", "walk_stop", "kick_ball", "walk_start", "walk", "walk_stop", "front_kick", "punch", "stand")
        ),
    },
    vault=7,
    sway=0.25,
    blow_angle=10.0,
    blow_reach=(-0.03, 0.03),
    blow_height=(-0.04, 0.04),
    travel=0.12,
    tempo=0.06,
)  # fmt: skip
