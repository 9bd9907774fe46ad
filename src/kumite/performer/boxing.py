"""Boxing: the orthodox guard and what a boxer does from it, as tables (see ``moves.py``)."""

from __future__ import annotations

from collections.abc import Mapping

from kumite.performer.moves import Blow, Move, Step, Style, Vector, aim

GUARD: Mapping[str, Vector] = {
    "pelvis": (-0.01, 0.935, 0.0),
    "pelvis_turn": (-32.0, 6.0, 0.0),  # yaw, pitch (forward), roll (to the right)
    "chest_turn": (-38.0, 17.0, 0.0),
    "head_turn": (-4.0, 12.0, 0.0),
    "left_hand": (0.075, 1.475, 0.40),
    "right_hand": (-0.035, 1.455, 0.235),
    "elbow": (0.0, 0.0),  # left, right: 0 hangs, 1 out at shoulder height
    "heel": (2.0, 14.0),  # left, right: raised [deg]
}
FEET: Mapping[str, Vector] = {  # the ball of each foot and its yaw, in the stance frame
    "left": (0.12, 0.24, -20.0),
    "right": (-0.14, -0.22, -58.0),
}

_LEAD = (Step("left", 0.04, 0.25), Step("right", 0.50, 0.70, 0.055))  # the rear foot follows
_FORWARD = (Step("left", 0.05, 0.30), Step("right", 0.30, 0.52, 0.06))
_BACK = (Step("right", 0.05, 0.28, 0.07), Step("left", 0.26, 0.50))
_LEFTWARD = (Step("left", 0.05, 0.29), Step("right", 0.31, 0.53, 0.06))
_RIGHTWARD = (Step("right", 0.05, 0.28, 0.07), Step("left", 0.27, 0.51))
_PIVOT = (Step("left", 0.04, 0.24, 0.075), Step("right", 0.22, 0.48, 0.06))

HEAD_HIGH = 1.55  # m, where a boxer's head is in guard
BODY_HIGH = 1.15

_JAB = {
    "pelvis": (
        (0.11, (0.0, -0.012, -0.02)),
        (0.29, (0.02, -0.03, 0.10)),
        (0.42, (0.01, -0.02, 0.06)),
    ),
    "pelvis_turn": ((0.12, (5, 0, 0)), (0.29, (-10, 5, 0)), (0.44, (-4, 2, 0))),
    "chest_turn": ((0.12, (7, -1, 0)), (0.29, (-20, 6, 1)), (0.46, (-6, 2, 0))),
    "head_turn": ((0.29, (2, 6, -3)),),
    "left_hand": (
        (0.05, (0.08, 1.47, 0.39)),
        (0.14, (0.085, 1.45, 0.33)),
        (0.28, aim(0, 0, -0.005)),
        (0.32, aim(0, -0.003, 0.0)),
        (0.44, (0.06, 1.49, 0.53)),
        (0.58, (0.075, 1.47, 0.40)),
    ),
    "right_hand": ((0.30, (-0.03, 1.45, 0.30)),),
    "elbow": ((0.13, (0.02, 0.0)), (0.25, (0.40, 0.0)), (0.33, (0.42, 0.0)), (0.48, (0.08, 0.0))),
    "heel": ((0.30, (0, 10)),),
}
_CROSS = {
    "pelvis": (
        (0.12, (-0.01, -0.015, -0.03)),
        (0.32, (0.03, -0.045, 0.10)),
        (0.46, (0.02, -0.03, 0.06)),
    ),
    "pelvis_turn": ((0.13, (-6, 0, 0)), (0.31, (38, 4, 0)), (0.40, (34, 4, 0))),
    "chest_turn": ((0.14, (-8, 0, 0)), (0.325, (66, 5, -2)), (0.41, (58, 5, -2))),
    "head_turn": ((0.32, (2, 5, 3)),),
    "right_hand": (
        (0.05, (-0.035, 1.45, 0.23)),
        (0.16, (-0.05, 1.44, 0.17)),
        (0.315, aim(0, 0, -0.005)),
        (0.355, aim(0, -0.005, 0.0)),
        (0.50, (-0.05, 1.48, 0.42)),
        (0.68, (-0.035, 1.455, 0.24)),
    ),
    "left_hand": (
        (0.16, (0.07, 1.48, 0.38)),
        (0.33, (0.09, 1.46, 0.24)),
        (0.5, (0.085, 1.47, 0.30)),
    ),
    "elbow": ((0.15, (0.0, 0.04)), (0.28, (0.0, 0.38)), (0.36, (0.0, 0.40)), (0.54, (0.0, 0.08))),
    "heel": ((0.14, (2, 18)), (0.31, (0, 44)), (0.44, (0, 38))),
}
_LEFT_HOOK = {
    "pelvis": ((0.14, (0.035, -0.04, 0.02)), (0.36, (-0.01, -0.03, 0.05)), (0.5, (0, -0.02, 0.03))),
    "pelvis_turn": ((0.15, (18, 2, 0)), (0.36, (-26, 2, 0)), (0.46, (-26, 2, 0))),
    "chest_turn": ((0.17, (26, 2, 0)), (0.37, (-36, 3, 0)), (0.47, (-38, 3, 0))),
    "head_turn": ((0.17, (4, 3, 0)), (0.38, (-3, 3, 0))),
    "left_hand": (
        (0.06, (0.08, 1.47, 0.39)),
        (0.19, (0.27, 1.41, 0.30)),
        (0.29, (0.40, 1.51, 0.47)),
        (0.365, aim(0.02, 0, 0)),
        (0.42, aim(-0.11, -0.005, -0.05)),
        (0.60, (0.0, 1.48, 0.36)),
        (0.76, (0.075, 1.475, 0.40)),
    ),
    "right_hand": ((0.36, (-0.05, 1.47, 0.22)),),
    "elbow": (
        (0.10, (0.1, 0)),
        (0.27, (0.75, 0)),
        (0.37, (1.0, 0)),
        (0.46, (0.85, 0)),
        (0.66, (0.15, 0)),
    ),
    "heel": ((0.36, (30, 12)), (0.5, (18, 12))),
}
_RIGHT_HOOK = {
    "pelvis": (
        (0.15, (-0.03, -0.035, -0.02)),
        (0.38, (0.02, -0.035, 0.07)),
        (0.52, (0.01, -0.02, 0.04)),
    ),
    "pelvis_turn": ((0.16, (-10, 2, 0)), (0.38, (40, 3, 0)), (0.47, (40, 3, 0))),
    "chest_turn": ((0.18, (-14, 2, 0)), (0.39, (70, 4, 0)), (0.48, (72, 4, 0))),
    "head_turn": ((0.19, (-4, 3, 0)), (0.40, (3, 3, 0))),
    "right_hand": (
        (0.06, (-0.035, 1.45, 0.235)),
        (0.20, (-0.25, 1.40, 0.14)),
        (0.31, (-0.36, 1.51, 0.40)),
        (0.385, aim(-0.02, 0, 0)),
        (0.44, aim(0.11, -0.005, -0.05)),
        (0.62, (0.03, 1.47, 0.30)),
        (0.80, (-0.035, 1.455, 0.235)),
    ),
    "left_hand": ((0.38, (0.10, 1.47, 0.27)),),
    "elbow": (
        (0.13, (0, 0.05)),
        (0.26, (0, 0.75)),
        (0.38, (0, 1.0)),
        (0.46, (0, 0.9)),
        (0.66, (0, 0.15)),
    ),
    "heel": ((0.38, (2, 42)), (0.52, (2, 30))),
}


def _shifted(keys: Mapping, by: float) -> dict:
    """The same keys, later."""
    return {c: tuple((t + by, v) for t, v in rows) for c, rows in keys.items()}


def _after(first: Mapping, second: Mapping, at: float) -> dict:
    """Two blows in a row: keys of the first up to ``at``, then those of the second."""
    late = _shifted(second, at)
    out = {}
    for c in {*first, *late}:
        rows = late.get(c, ())
        begin = min((t for t, _ in rows), default=float("inf"))
        out[c] = tuple(r for r in first.get(c, ()) if r[0] < begin - 0.04) + tuple(rows)
    return out


MOVES: tuple[Move, ...] = (
    Move("guard", "idle", 0.9, steps=(Step("left", 0.05, 0.26, 0.08),)),
    Move(
        "guard_shift", "idle", 1.1,
        {"pelvis": ((0.35, (0.03, -0.015, 0.05)), (0.75, (-0.02, -0.01, -0.04))),
         "chest_turn": ((0.35, (4, 2, 1)), (0.75, (-4, -1, -1))),
         "head_turn": ((0.4, (2, 0, 2)), (0.8, (-2, 0, -2)))},
        (Step("left", 0.05, 0.27, 0.08), Step("right", 0.45, 0.66, 0.06)),
    ),
    Move("step_forward", "transition", 0.72, {"pelvis": ((0.2, (0, -0.02, 0.0)),)}, _FORWARD, (0, 0.30, 0)),
    Move("step_back", "transition", 0.72, {"pelvis": ((0.2, (0, -0.02, 0.0)),)}, _BACK, (0, -0.30, 0)),
    Move("step_left", "transition", 0.74, {"pelvis": ((0.2, (0, -0.02, 0.0)),)}, _LEFTWARD, (0.28, 0, 0)),
    Move("step_right", "transition", 0.74, {"pelvis": ((0.2, (0, -0.02, 0.0)),)}, _RIGHTWARD, (-0.28, 0, 0)),
    Move("turn_left", "transition", 0.70, {"head_turn": ((0.15, (12, 0, 0)),)}, _PIVOT, (0, 0, 38)),
    Move("turn_right", "transition", 0.70, {"head_turn": ((0.15, (-12, 0, 0)),)}, _PIVOT, (0, 0, -38)),
    Move("jab", "attack", 0.78, _JAB, _LEAD, (0, 0.05, 0), (Blow("left_hand", 0.32, (2, 0.84, HEAD_HIGH)),)),
    Move("cross", "attack", 0.86, _CROSS, _LEAD, (0, 0.04, 0), (Blow("right_hand", 0.355, (0, 0.84, HEAD_HIGH)),)),
    Move("left_hook", "attack", 0.92, _LEFT_HOOK, _LEAD, (0, 0.03, 0), (Blow("left_hand", 0.365, (4, 0.62, HEAD_HIGH)),)),
    Move("right_hook", "attack", 0.96, _RIGHT_HOOK, _LEAD, (0, 0.03, 0), (Blow("right_hand", 0.385, (-2, 0.62, HEAD_HIGH)),)),
    Move(
        "one_two", "attack", 1.16, _after(_JAB, _CROSS, 0.30), _LEAD, (0, 0.06, 0),
        (Blow("left_hand", 0.32, (2, 0.84, HEAD_HIGH)), Blow("right_hand", 0.655, (0, 0.84, HEAD_HIGH))),
    ),
    Move(
        "duck", "defence", 0.95,
        {"pelvis": ((0.14, (0, 0.005, 0)), (0.36, (0.0, -0.27, -0.04)), (0.46, (0.02, -0.27, -0.02))),
         "pelvis_turn": ((0.38, (4, 16, 0)),),
         "chest_turn": ((0.38, (8, 32, -2)), (0.48, (8, 30, 3))),
         "head_turn": ((0.38, (0, 8, 0)),),
         "left_hand": ((0.38, (0.09, 1.18, 0.46)), (0.48, (0.09, 1.18, 0.46))),
         "right_hand": ((0.38, (-0.06, 1.17, 0.40)), (0.48, (-0.06, 1.17, 0.40))),
         "heel": ((0.38, (6, 34)), (0.48, (6, 34)))},
        (Step("left", 0.04, 0.22, 0.075),),
    ),
    Move(
        "struck_head_front", "reaction", 0.95,
        {"pelvis": ((0.12, (0, 0.0, -0.05)), (0.36, (0, -0.03, -0.10))),
         "pelvis_turn": ((0.14, (-3, -5, 0)),),
         "chest_turn": ((0.11, (-4, -16, 0)), (0.22, (-5, -22, 0)), (0.5, (0, -4, 0))),
         "head_turn": ((0.08, (0, -26, 0)), (0.16, (0, -34, 0)), (0.34, (0, 6, 0))),
         "left_hand": ((0.16, (0.12, 1.41, 0.27)), (0.45, (0.09, 1.48, 0.28))),
         "right_hand": ((0.18, (-0.10, 1.39, 0.12)), (0.45, (-0.05, 1.48, 0.17)))},
        _BACK, (0, -0.16, 0),
    ),
    Move(
        "struck_head_left", "reaction", 0.95,
        {"pelvis": ((0.12, (-0.03, -0.01, -0.01)), (0.36, (-0.06, -0.03, -0.03))),
         "chest_turn": ((0.12, (-14, 0, 7)), (0.24, (-20, 2, 10)), (0.5, (-4, 0, 2))),
         "head_turn": ((0.08, (-30, -4, 12)), (0.16, (-42, -6, 18)), (0.36, (-6, 4, 4))),
         "left_hand": ((0.18, (0.04, 1.43, 0.34)), (0.45, (0.06, 1.50, 0.32))),
         "right_hand": ((0.18, (-0.14, 1.38, 0.17)), (0.45, (-0.06, 1.48, 0.20)))},
        _RIGHTWARD, (-0.10, -0.04, 0),
    ),
    Move(
        "struck_head_right", "reaction", 0.95,
        {"pelvis": ((0.12, (0.03, -0.01, -0.01)), (0.36, (0.05, -0.03, -0.03))),
         "chest_turn": ((0.12, (14, 0, -7)), (0.24, (20, 2, -10)), (0.5, (4, 0, -2))),
         "head_turn": ((0.08, (30, -4, -12)), (0.16, (42, -6, -18)), (0.36, (6, 4, -4))),
         "left_hand": ((0.18, (0.16, 1.41, 0.33)), (0.45, (0.09, 1.50, 0.33))),
         "right_hand": ((0.18, (-0.02, 1.41, 0.22)), (0.45, (-0.03, 1.48, 0.24)))},
        _LEFTWARD, (0.10, -0.04, 0),
    ),
)  # fmt: skip

BOXING = Style(
    "boxing",
    GUARD,
    FEET,
    MOVES,
    {
        "guard": (("guard", "guard_shift"), 12),
        "footwork": (("step_forward", "step_back", "step_left", "step_right", "guard"), 26),
        "turns": (("turn_left", "turn_right", "turn_left", "turn_right", "step_back"), 22),
        "jab": (("jab", "jab", "guard", "step_back", "turn_left", "turn_right"), 36),
        "cross": (("cross", "cross", "guard", "step_back", "turn_left", "turn_right"), 34),
        "hooks": (("left_hook", "right_hook", "guard", "step_back", "turn_left", "turn_right"), 34),
        "one_two": (("one_two", "one_two", "step_back", "guard", "turn_left", "turn_right"), 30),
        "duck": (("duck", "guard", "step_left", "step_right", "jab"), 18),
        "struck": (
            ("struck_head_front", "struck_head_left", "struck_head_right", "guard", "step_forward"),
            18,
        ),
        "shadow": (tuple(m.label for m in MOVES if m.kind != "reaction"), 48),
    },
    blow_angle=16.0,
    blow_reach=(-0.05, 0.06),
    blow_height=(-0.12, 0.07),
    travel=0.5,
    tempo=0.12,
)
