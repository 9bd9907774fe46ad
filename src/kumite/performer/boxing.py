"""Boxing: the orthodox guard, its footwork, and the takes (see ``moves.py`` for the words)."""

from __future__ import annotations

from collections.abc import Mapping

from kumite.performer.defence import DEFENCES
from kumite.performer.moves import Foothold, Move, Step, Style, Take, Vector
from kumite.performer.patterns import BACK, FORWARD, LEFTWARD, PIVOT, RIGHTWARD
from kumite.performer.punches import BLOWS
from kumite.performer.reactions import REACTIONS

GUARD: Mapping[str, Vector] = {
    "pelvis": (-0.01, 0.935, 0.0),
    "pelvis_turn": (-32.0, 6.0, 0.0),  # yaw, pitch (forward), roll (to the right)
    "chest_turn": (-38.0, 17.0, 0.0),
    "head_turn": (-4.0, 12.0, 0.0),
    "left_hand": (0.075, 1.475, 0.40),
    "right_hand": (-0.085, 1.46, 0.235),
    "elbow": (0.0, 0.0),  # left, right: 0 hanging, 1 out at the shoulder, below 0 tucked in
    "heel": (2.0, 14.0),  # left, right: raised [deg]
}
FEET: Mapping[str, Foothold] = {  # the ball of each foot and its yaw, in the stance frame
    "left": (0.12, 0.24, -20.0),
    "right": (-0.14, -0.22, -58.0),
}
_SINK = {"pelvis": ((0.2, (0, -0.02, 0.0)),)}

FOOTWORK: tuple[Move, ...] = (
    Move("guard", "idle", 0.9, steps=(Step("left", 0.05, 0.26, 0.08),)),
    Move(
        "guard_shift", "idle", 1.1,
        {"pelvis": ((0.35, (0.03, -0.015, 0.05)), (0.75, (-0.02, -0.01, -0.04))),
         "chest_turn": ((0.35, (4, 2, 1)), (0.75, (-4, -1, -1))),
         "head_turn": ((0.4, (2, 0, 2)), (0.8, (-2, 0, -2)))},
        (Step("left", 0.05, 0.27, 0.08), Step("right", 0.45, 0.66, 0.06)),
    ),
    Move("step_forward", "transition", 0.76, _SINK, FORWARD, (0, 0.38, 0)),
    Move("step_back", "transition", 0.76, _SINK, BACK, (0, -0.36, 0)),
    Move("step_left", "transition", 0.78, _SINK, LEFTWARD, (0.33, 0, 0)),
    Move("step_right", "transition", 0.78, _SINK, RIGHTWARD, (-0.33, 0, 0)),
    Move("step_forward_left", "transition", 0.78, _SINK, FORWARD, (0.23, 0.26, 0)),
    Move("step_forward_right", "transition", 0.78, _SINK, FORWARD, (-0.23, 0.26, 0)),
    Move("step_back_left", "transition", 0.78, _SINK, BACK, (0.23, -0.26, 0)),
    Move("step_back_right", "transition", 0.78, _SINK, BACK, (-0.23, -0.26, 0)),
    Move("pivot_left", "transition", 0.82, {"head_turn": ((0.15, (20, 0, 0)),), "pelvis": ((0.25, (0, -0.03, 0)),)}, PIVOT, (-0.10, 0.04, 70)),
    Move("pivot_right", "transition", 0.82, {"head_turn": ((0.15, (-20, 0, 0)),), "pelvis": ((0.25, (0, -0.03, 0)),)}, PIVOT, (0.10, 0.04, -70)),
    Move("turn_left", "transition", 0.74, {"head_turn": ((0.15, (12, 0, 0)),)}, PIVOT, (0, 0, 38)),
    Move("turn_right", "transition", 0.74, {"head_turn": ((0.15, (-12, 0, 0)),)}, PIVOT, (0, 0, -38)),
)  # fmt: skip
MOVES = FOOTWORK + BLOWS + DEFENCES + REACTIONS


def _labels(moves: tuple[Move, ...], ending: str = "") -> tuple[str, ...]:
    return tuple(m.label for m in moves if m.label.endswith(ending))


_FALLS = ("fall_back", "get_up_back", "guard", "fall_forward", "get_up_forward", "step_forward")
_STRUCK = tuple(m.label for m in REACTIONS if m.from_guard and m.to_guard)

BOXING = Style(
    "boxing",
    GUARD,
    FEET,
    MOVES,
    {
        "guard": Take(("guard", "guard_shift"), 12),
        "footwork": Take(
            (*(m.label for m in MOVES if m.label.startswith("step_")), "guard", "guard_shift"),
            30,
        ),
        "turns": Take(("turn_left", "turn_right", "pivot_left", "pivot_right", "step_back"), 24),
        "jab": Take(("jab", "jab", "guard", "step_back", "turn_left", "turn_right"), 30),
        "cross": Take(("cross", "cross", "guard", "step_back", "turn_left", "turn_right"), 28),
        "hooks": Take(
            ("left_hook", "right_hook", "guard", "step_back", "turn_left", "turn_right"), 34
        ),
        "one_two": Take(
            ("one_two", "one_two", "step_back", "guard", "turn_left", "turn_right"), 30
        ),
        "uppercuts": Take(
            ("left_uppercut", "right_uppercut", "guard", "step_back", "turn_left"), 26
        ),
        "low": Take((*_labels(BLOWS, "_low"), "guard", "step_back"), 32),
        "combinations": Take(
            ("one_two_hook", "one_two", "jab_cross_uppercut", "step_back", "turn_right"), 25
        ),
        "defence": Take((*_labels(DEFENCES), "guard"), 44),
        "counter": Take(
            ("slip_left", "cross", "slip_right", "left_hook", "duck", "jab", "step_back"),
            30,
        ),
        "struck": Take((*_STRUCK, "guard", "step_forward"), 36),
        "falls": Take((*_FALLS, "fall_left", "get_up_left", "step_forward", *_FALLS)),
        "shadow": Take(_labels(FOOTWORK + BLOWS + DEFENCES), 46),
    },
    blow_angle=16.0,
    blow_reach=(-0.04, 0.03),
    blow_height=(-0.12, 0.10),
    blow_step=(-0.12, 0.34),
    blow_turn=38.0,
    travel=0.35,
    tempo=0.1,
)
