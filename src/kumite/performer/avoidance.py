"""Getting out of the way: twenty-two ways to avoid what comes flying, from an alert stand.

Every row marks in ``avoid`` when the body is out of where it stood.
"""

from __future__ import annotations

from collections.abc import Mapping

from kumite.performer.moves import (
    Aim,
    Foothold,
    Key,
    Move,
    Plant,
    Put,
    Step,
    Style,
    Take,
    Value,
    Vector,
    aim,
    put,
)
from kumite.performer.truth import swap_sides

ALERT: Mapping[str, Vector] = {
    "pelvis": (0.0, 0.945, 0.0),
    "pelvis_turn": (0.0, 5.0, 0.0),
    "chest_turn": (0.0, 10.0, 0.0),
    "head_turn": (0.0, 6.0, 0.0),
    "left_hand": (0.27, 1.10, 0.27),
    "right_hand": (-0.27, 1.10, 0.27),
    "elbow": (0.2, 0.2),
    "heel": (6.0, 6.0),
}
FEET: Mapping[str, Foothold] = {"left": (0.15, 0.07, 12.0), "right": (-0.15, 0.05, -12.0)}

_LEFTWARD = (Step("left", 0.06, 0.34), Step("right", 0.36, 0.66, 0.06))
_BACK = (Step("right", 0.06, 0.35, 0.06), Step("left", 0.36, 0.66, 0.07))
_FORWARD = (Step("left", 0.06, 0.34), Step("right", 0.36, 0.66, 0.06))


def _held(at: tuple[float, float], value: Value) -> tuple[Key, ...]:
    """A pose reached at the first time and left at the second."""
    return tuple((t, value) for t in at)


def _leap(sign: float) -> Move:
    """Both feet push off to the left (+1) or the right (-1); the near foot goes first."""
    near, far = ("left", "right") if sign > 0 else ("right", "left")
    return Move(
        f"jump_{near}", "defence", 1.15,
        {"pelvis": ((0.20, (-0.03 * sign, -0.15, 0)), (0.42, (0, 0.06, 0)), (0.64, (0.03 * sign, -0.15, 0))),
         "chest_turn": ((0.20, (0, 12, 8 * sign)), (0.42, (0, 2, -8 * sign)), (0.64, (0, 12, -2 * sign))),
         "left_hand": ((0.22, (0.27, 1.02, 0.10)), (0.44, (0.44, 1.24, 0.22))), "right_hand": ((0.22, (-0.27, 1.02, 0.10)), (0.44, (-0.44, 1.24, 0.22))),
         "heel": ((0.26, (30, 30)), (0.42, (32, 32)), (0.60, (8, 8)))},
        (Step(near, 0.24, 0.54, 0.13), Step(far, 0.27, 0.57, 0.14)), (0.62 * sign, 0, 0), avoid=(0.26, 0.90),
    )  # fmt: skip


_LEFT: tuple[Move, ...] = (
    Move(
        "twist_left", "defence", 0.95,
        {"pelvis": _held((0.22, 0.42), (0.02, -0.05, -0.02)), "pelvis_turn": _held((0.22, 0.42), (32, 2, 0)),
         "chest_turn": _held((0.24, 0.43), (74, 0, 0)), "head_turn": ((0.26, (10, 2, 0)), (0.42, (10, 2, 0))),
         "left_hand": _held((0.26, 0.42), (0.26, 1.20, 0.02)), "right_hand": _held((0.26, 0.42), (-0.02, 1.22, 0.30)),
         "heel": _held((0.24, 0.42), (6, 34))},
        (Step("right", 0.04, 0.25, 0.05, to=(-0.14, 0.04, 10.0)), Step("right", 0.60, 0.82, 0.05)), avoid=(0.14, 0.60),
    ),
    Move(
        "lean_left", "defence", 0.95,
        {"pelvis": _held((0.26, 0.42), (0.11, -0.07, 0)), "pelvis_turn": _held((0.26, 0.42), (0, 3, -10)),
         "chest_turn": _held((0.27, 0.43), (0, 6, -34)), "head_turn": _held((0.28, 0.42), (0, 2, -16))},
        avoid=(0.15, 0.60),
    ),
    Move(
        "duck_left", "defence", 1.10,
        {"pelvis": _held((0.34, 0.50), (0.13, -0.30, -0.02)), "pelvis_turn": _held((0.34, 0.50), (0, 14, -8)),
         "chest_turn": _held((0.35, 0.50), (6, 30, -22)), "head_turn": _held((0.36, 0.50), (0, -4, -8)),
         "left_hand": _held((0.36, 0.50), put(0.48, 0.72, 0.26)), "right_hand": _held((0.36, 0.50), put(-0.10, 0.86, 0.46))},
        avoid=(0.18, 0.76),
    ),
    Move("sidestep_left", "defence", 1.0, {"pelvis": ((0.3, (0, -0.04, 0)),), "chest_turn": ((0.25, (0, 2, -6)),)}, _LEFTWARD, (0.48, 0, 0), avoid=(0.20, 0.80)),
    Move(
        "lift_left_leg", "defence", 1.0,
        {"pelvis": _held((0.24, 0.52), (-0.12, -0.01, -0.01)), "chest_turn": _held((0.28, 0.48), (0, 4, -3)),
         "left_foot": ((0.34, (0.10, 0.46, 0.04)), (0.46, (0.10, 0.46, 0.04))), "heel": _held((0.34, 0.46), (34, 2)),
         "left_hand": _held((0.30, 0.48), (0.40, 1.22, 0.20)), "right_hand": _held((0.30, 0.48), (-0.36, 1.14, 0.22))},
        (Step("left", 0.16, 0.66, 0.03),), avoid=(0.24, 0.58),
    ),
    _leap(1.0),
)  # fmt: skip


def _mirrored(channel: str, value: Value) -> Value:
    if isinstance(value, Put):
        x, y, z = value.place
        return put(-x, y, z)
    if isinstance(value, Aim):
        x, y, z = value.offset
        return aim(-x, y, z)
    if channel.endswith("_turn"):
        yaw, pitch, roll = value
        return (-yaw, pitch, -roll)
    if channel in ("heel", "elbow"):
        left, right = value
        return (right, left)
    x, y, z = value
    return (-x, y, z)


def mirrored_move(move: Move) -> Move:
    """The move for the other side, in a stance whose feet mirror each other."""
    keys = {
        swap_sides(channel): tuple((time, _mirrored(channel, value)) for time, value in rows)
        for channel, rows in move.keys.items()
    }
    steps = tuple(
        Step(
            swap_sides(s.foot), s.lift, s.land, s.height, s.stride,
            None if s.to is None else (-s.to[0], s.to[1], -s.to[2]),
        )
        for s in move.steps
    )  # fmt: skip
    x, z, yaw = move.travel
    return Move(
        swap_sides(move.label),
        move.kind,
        move.seconds,
        keys,
        steps,
        (-x, z, -yaw),
        avoid=move.avoid,
    )


MOVES: tuple[Move, ...] = (
    Move(
        "wait", "idle", 1.0,
        {"pelvis": ((0.3, (0.025, -0.015, 0)), (0.7, (-0.025, -0.012, 0))), "chest_turn": ((0.35, (3, 1, 0)), (0.7, (-3, 0, 0)))},
    ),
    Move("shuffle", "idle", 1.0, steps=(Step("left", 0.10, 0.34, 0.06), Step("right", 0.46, 0.70, 0.06))),
    Move("step_forward", "transition", 0.90, {"pelvis": ((0.3, (0, -0.03, 0)),)}, _FORWARD, (0, 0.40, 0)),
    Move("turn_left", "transition", 0.90, {"head_turn": ((0.2, (15, 0, 0)),)}, _LEFTWARD, (0, 0, 40)),
    Move("turn_right", "transition", 0.90, {"head_turn": ((0.2, (-15, 0, 0)),)}, tuple(Step(swap_sides(s.foot), s.lift, s.land, s.height) for s in _LEFTWARD), (0, 0, -40)),
    *_LEFT,
    *(mirrored_move(m) for m in _LEFT),
    Move(
        "duck", "defence", 1.05,
        {"pelvis": _held((0.34, 0.48), (0, -0.34, -0.04)), "pelvis_turn": _held((0.34, 0.48), (0, 14, 0)),
         "chest_turn": _held((0.35, 0.48), (0, 34, 0)), "head_turn": _held((0.36, 0.48), (0, 10, 0)),
         "left_hand": _held((0.36, 0.48), put(0.22, 0.98, 0.36)), "right_hand": _held((0.36, 0.48), put(-0.22, 0.98, 0.36))},
        avoid=(0.17, 0.72),
    ),
    Move(
        "bow", "defence", 1.05,
        {"pelvis": _held((0.32, 0.46), (0, -0.12, -0.13)), "pelvis_turn": _held((0.32, 0.46), (0, 34, 0)),
         "chest_turn": _held((0.34, 0.47), (0, 66, 0)), "head_turn": _held((0.35, 0.47), (0, 56, 0)),
         "left_hand": _held((0.36, 0.47), put(0.32, 0.66, 0.22)), "right_hand": _held((0.36, 0.47), put(-0.32, 0.66, 0.22))},
        avoid=(0.17, 0.74),
    ),
    Move(
        "lean_back", "defence", 1.0,
        {"pelvis": _held((0.28, 0.44), (0, -0.07, 0.01)), "pelvis_turn": _held((0.28, 0.44), (0, -16, 0)),
         "chest_turn": _held((0.29, 0.44), (0, -40, 0)), "head_turn": _held((0.30, 0.44), (0, -16, 0)),
         "left_hand": _held((0.30, 0.44), (0.36, 1.10, 0.34)), "right_hand": _held((0.30, 0.44), (-0.36, 1.10, 0.34))},
        avoid=(0.15, 0.64),
    ),
    Move(
        "limbo", "defence", 1.35,
        {"pelvis": _held((0.44, 0.66), (0, -0.32, 0.10)), "pelvis_turn": _held((0.44, 0.66), (0, -30, 0)),
         "chest_turn": _held((0.46, 0.66), (0, -62, 0)), "head_turn": _held((0.48, 0.66), (0, -42, 0)),
         "left_hand": _held((0.46, 0.66), (0.50, 1.00, 0.20)), "right_hand": _held((0.46, 0.66), (-0.50, 1.00, 0.20)),
         "heel": _held((0.42, 0.66), (34, 34))},
        avoid=(0.20, 0.98),
    ),
    Move(
        "hollow", "defence", 0.95,
        {"pelvis": _held((0.24, 0.40), (0, -0.05, -0.20)), "pelvis_turn": _held((0.24, 0.40), (0, 22, 0)),
         "chest_turn": _held((0.25, 0.40), (0, 30, 0)), "head_turn": _held((0.26, 0.40), (0, 8, 0)),
         "left_hand": _held((0.26, 0.40), (0.42, 1.16, 0.40)), "right_hand": _held((0.26, 0.40), (-0.42, 1.16, 0.40))},
        avoid=(0.13, 0.58),
    ),
    Move("step_back", "defence", 1.0, {"pelvis": ((0.3, (0, -0.04, 0)),), "chest_turn": ((0.22, (0, -6, 0)),)}, _BACK, (0, -0.48, 0), avoid=(0.20, 0.80)),
    Move(
        "jump_back", "defence", 1.15,
        {"pelvis": ((0.20, (0, -0.15, 0.03)), (0.42, (0, 0.06, -0.02)), (0.64, (0, -0.15, 0.02))),
         "chest_turn": ((0.20, (0, 14, 0)), (0.42, (0, 6, 0)), (0.64, (0, 16, 0))),
         "left_hand": ((0.22, (0.28, 1.02, 0.12)), (0.44, (0.38, 1.24, 0.36))), "right_hand": ((0.22, (-0.28, 1.02, 0.12)), (0.44, (-0.38, 1.24, 0.36))),
         "heel": ((0.26, (30, 30)), (0.42, (30, 30)), (0.60, (10, 10)))},
        (Step("left", 0.24, 0.55, 0.12), Step("right", 0.24, 0.55, 0.12)), (0, -0.58, 0), avoid=(0.26, 0.90),
    ),
    Move(
        "jump_up", "defence", 1.25,
        {"pelvis": ((0.26, (0, -0.24, -0.02)), (0.42, (0, 0.03, 0)), (0.60, (0, 0.20, 0)), (0.78, (0, 0.02, 0)), (0.90, (0, -0.17, 0))),
         "chest_turn": ((0.26, (0, 24, 0)), (0.44, (0, -2, 0)), (0.60, (0, 8, 0)), (0.90, (0, 16, 0))),
         "left_foot": _held((0.56, 0.66), (0, 0.16, 0)), "right_foot": _held((0.56, 0.66), (0, 0.16, 0)),
         "left_hand": ((0.27, (0.30, 0.96, 0.0)), (0.50, (0.40, 1.36, 0.30)), (0.90, (0.32, 1.12, 0.26))), "right_hand": ((0.27, (-0.30, 0.96, 0.0)), (0.50, (-0.40, 1.36, 0.30)), (0.90, (-0.32, 1.12, 0.26))),
         "heel": ((0.38, (40, 40)), (0.60, (36, 36)), (0.78, (26, 26)), (0.88, (6, 6)))},
        (Step("left", 0.42, 0.79, 0.10), Step("right", 0.42, 0.79, 0.10)), avoid=(0.46, 0.76),
    ),
    Move(
        "jump_tuck", "defence", 1.35,
        {"pelvis": ((0.28, (0, -0.28, -0.02)), (0.44, (0, 0.03, 0)), (0.63, (0, 0.22, 0)), (0.82, (0, 0.01, 0)), (0.95, (0, -0.22, 0))),
         "chest_turn": ((0.28, (0, 28, 0)), (0.46, (0, 4, 0)), (0.63, (0, 22, 0)), (0.95, (0, 20, 0))),
         "left_foot": _held((0.60, 0.68), (0, 0.42, 0.04)), "right_foot": _held((0.60, 0.68), (0, 0.42, 0.04)),
         "left_hand": ((0.29, (0.30, 0.96, -0.04)), (0.52, (0.44, 1.30, 0.34)), (0.95, (0.34, 1.12, 0.28))), "right_hand": ((0.29, (-0.30, 0.96, -0.04)), (0.52, (-0.44, 1.30, 0.34)), (0.95, (-0.34, 1.12, 0.28))),
         "heel": ((0.40, (40, 40)), (0.63, (24, 24)), (0.82, (24, 24)), (0.92, (6, 6)))},
        (Step("left", 0.44, 0.83, 0.08), Step("right", 0.44, 0.83, 0.08)), avoid=(0.48, 0.80),
    ),
    Move(
        "drop", "defence", 2.10,
        {"pelvis": ((0.22, (0, -0.24, 0.0)), (0.46, (0, -0.405, 0.20)), (0.98, (0, -0.41, 0.20)), (1.45, (0, -0.28, 0.05))),
         "pelvis_turn": ((0.24, (0, 8, 0)), (0.50, (0, 32, 0)), (0.98, (0, 32, 0)), (1.45, (0, 10, 0))),
         "chest_turn": ((0.24, (0, 26, 0)), (0.50, (0, 60, 0)), (0.98, (0, 60, 0)), (1.45, (0, 24, 0))),
         "head_turn": ((0.50, (0, 34, 0)), (0.98, (0, 30, 0))),
         "left_hand": ((0.42, put(0.26, 0.26, 0.68)), (1.00, put(0.26, 0.16, 0.72)), (1.45, put(0.25, 0.80, 0.46))), "right_hand": ((0.42, put(-0.26, 0.26, 0.68)), (1.00, put(-0.26, 0.16, 0.72)), (1.45, put(-0.25, 0.80, 0.46))),
         "heel": ((0.24, (34, 34)), (0.48, (72, 72)), (0.98, (72, 72)), (1.45, (34, 34)))},
        avoid=(0.16, 1.60),
        plants=(Plant("left_hand", 0.54, 0.94, (0.26, 0.07, 0.74)), Plant("right_hand", 0.54, 0.94, (-0.26, 0.07, 0.74))),
    ),
)  # fmt: skip

_AVOIDING = tuple(m.label for m in MOVES if m.avoid is not None)
_REST = ("wait", "shuffle", "step_forward", "turn_left", "turn_right")

AVOIDANCE = Style(
    "avoidance",
    ALERT,
    FEET,
    MOVES,
    {
        "waiting": Take(_REST, 15),
        "leaning": Take((*(m for m in _AVOIDING if m.startswith(("twist", "lean", "lift", "hollow"))), "shuffle", "step_forward"), 33),
        "ducking": Take((*(m for m in _AVOIDING if m.startswith(("duck", "bow", "limbo", "drop"))), "shuffle", "step_forward"), 28),
        "leaping": Take((*(m for m in _AVOIDING if m.startswith(("jump", "sidestep", "step"))), "shuffle", "step_forward", "turn_left"), 33),
        "free": Take((*_AVOIDING, *_REST), 54),
    },
    weight=0.22,
    sway=0.8,
    travel=0.2,
    tempo=0.08,
)  # fmt: skip
