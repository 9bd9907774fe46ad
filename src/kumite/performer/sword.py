"""The sword: guard, cuts from four sides, thrust and lunge, parries, steps, being struck, a fall.

The sword is in the right hand, the right foot leads. A blow's target is where the point lands; its
hand is aimed a sword's length short of it. The channel ``blade`` is the way the sword points, (yaw
to the left, pitch up) in degrees: (0, 90) straight up, (0, 120) up and back over the shoulder.
"""

from __future__ import annotations

from collections.abc import Mapping

from kumite.performer.moves import Blow, Foothold, Move, Plant, Step, Style, Take, Vector, aim, put

GUARD: Mapping[str, Vector] = {
    "pelvis": (0.0, 0.925, 0.0),
    "pelvis_turn": (26.0, 4.0, 0.0),
    "chest_turn": (30.0, 9.0, 0.0),
    "head_turn": (6.0, 6.0, 0.0),
    "left_hand": (0.30, 1.02, -0.02),
    "right_hand": (-0.15, 1.14, 0.42),
    "elbow": (0.15, 0.1),
    "heel": (10.0, 0.0),
    "blade": (8.0, 38.0),
}
FEET: Mapping[str, Foothold] = {"right": (-0.10, 0.25, -6.0), "left": (0.12, -0.21, 52.0)}

_FORWARD = (Step("right", 0.05, 0.32), Step("left", 0.32, 0.58, 0.06))
_BACK = (Step("left", 0.05, 0.33, 0.06), Step("right", 0.30, 0.59, 0.07))
_LEFTWARD = (Step("left", 0.05, 0.31, 0.07), Step("right", 0.31, 0.59, 0.07))
_RIGHTWARD = (Step("right", 0.05, 0.32), Step("left", 0.33, 0.60, 0.06))
_STEP_IN = (Step("right", 0.22, 0.47), Step("left", 0.54, 0.82, 0.055))
_SHUFFLE = (Step("right", 0.04, 0.24, 0.07),)

_CUT_RIGHT = {
    "pelvis": (
        (0.32, (-0.03, -0.03, -0.04)),
        (0.54, (0.03, -0.05, 0.08)),
        (0.7, (0.02, -0.04, 0.06)),
    ),
    "pelvis_turn": ((0.34, (-22, 0, 0)), (0.54, (14, 4, 0)), (0.68, (18, 4, 0))),
    "chest_turn": ((0.36, (-42, -2, 4)), (0.54, (14, 6, -2)), (0.68, (30, 7, -3))),
    "head_turn": ((0.36, (-6, 0, 0)), (0.56, (2, 3, 0))),
    "right_hand": (
        (0.36, (-0.42, 1.44, 0.16)),
        (0.44, (-0.42, 1.44, 0.36)),
        (0.52, aim(-0.16, -0.14, -0.93)),
        (0.62, aim(0.26, -0.26, -1.02)),
        (0.72, aim(0.34, -0.30, -1.10)),
        (0.96, (-0.10, 1.13, 0.42)),
    ),
    "left_hand": ((0.38, (0.30, 1.10, 0.16)), (0.62, (0.34, 1.02, -0.12))),
    "blade": (
        (0.36, (-128, 42)),
        (0.435, (-74, 22)),
        (0.52, (0, 6)),
        (0.61, (74, -4)),
        (0.72, (98, -2)),
        (0.96, (16, 34)),
    ),
    "elbow": ((0.38, (0.15, 0.55)), (0.54, (0.15, 0.25))),
    "heel": ((0.54, (34, 0)), (0.7, (30, 0))),
}
_CUT_LEFT = {
    "pelvis": (
        (0.32, (0.03, -0.03, -0.03)),
        (0.54, (-0.02, -0.05, 0.08)),
        (0.7, (-0.02, -0.04, 0.06)),
    ),
    "pelvis_turn": ((0.34, (20, 2, 0)), (0.54, (-14, 4, 0)), (0.68, (-16, 4, 0))),
    "chest_turn": ((0.36, (34, 6, -4)), (0.54, (-16, 6, 2)), (0.68, (-30, 6, 3))),
    "head_turn": ((0.36, (6, 0, 0)), (0.56, (-2, 3, 0))),
    "right_hand": (
        (0.36, (0.24, 1.40, 0.36)),
        (0.44, (0.16, 1.40, 0.46)),
        (0.52, aim(0.14, -0.14, -0.94)),
        (0.62, aim(-0.28, -0.24, -1.00)),
        (0.72, aim(-0.38, -0.28, -1.06)),
        (0.96, (-0.20, 1.13, 0.42)),
    ),
    "left_hand": ((0.40, put(0.32, 1.02, 0.02)), (0.76, put(0.33, 0.99, 0.06))),
    "blade": (
        (0.36, (124, 40)),
        (0.435, (72, 20)),
        (0.52, (0, 6)),
        (0.61, (-72, -2)),
        (0.72, (-96, 2)),
        (0.96, (2, 34)),
    ),
    "elbow": ((0.38, (0.15, 0.35)), (0.54, (0.15, 0.15)), (0.7, (0.15, 0.4))),
    "heel": ((0.54, (30, 0)), (0.7, (26, 0))),
}
_CUT_DOWN = {
    "pelvis": ((0.34, (0, 0.015, -0.05)), (0.56, (0, -0.07, 0.09)), (0.72, (0, -0.06, 0.07))),
    "pelvis_turn": ((0.35, (-10, -5, 0)), (0.56, (4, 8, 0)), (0.7, (4, 8, 0))),
    "chest_turn": ((0.37, (-18, -12, 0)), (0.56, (4, 16, 0)), (0.7, (8, 20, 0))),
    "head_turn": ((0.37, (-4, -2, 0)), (0.58, (0, 2, 0))),
    "right_hand": (
        (0.37, (-0.20, 1.74, 0.12)),
        (0.45, (-0.18, 1.78, 0.28)),
        (0.54, aim(-0.04, -0.24, -0.88)),
        (0.63, aim(-0.04, -0.46, -0.98)),
        (0.74, aim(-0.04, -0.52, -1.02)),
        (0.98, (-0.15, 1.12, 0.42)),
    ),
    "left_hand": ((0.40, put(0.32, 1.04, 0.02)), (0.76, put(0.33, 0.98, 0.08))),
    "blade": (
        (0.37, (0, 112)),
        (0.44, (0, 92)),
        (0.54, (2, 16)),
        (0.62, (6, -3)),
        (0.74, (8, -16)),
        (0.98, (8, 32)),
    ),
    "elbow": ((0.38, (0.15, 0.5)), (0.56, (0.15, 0.15))),
    "heel": ((0.56, (34, 0)), (0.72, (30, 0))),
}
_CUT_UP = {
    "pelvis": (
        (0.34, (-0.03, -0.10, -0.04)),
        (0.55, (0.01, -0.01, 0.08)),
        (0.7, (0.01, -0.01, 0.06)),
    ),
    "pelvis_turn": ((0.35, (-20, 4, 0)), (0.55, (10, 0, 0)), (0.68, (12, -2, 0))),
    "chest_turn": ((0.37, (-40, 10, 6)), (0.55, (12, 0, -2)), (0.68, (20, -5, -3))),
    "head_turn": ((0.37, (-4, 0, 0)), (0.56, (2, 0, 0))),
    "right_hand": (
        (0.37, put(-0.46, 0.86, 0.04)),
        (0.45, put(-0.40, 0.84, 0.34)),
        (0.53, aim(-0.14, -0.20, -0.92)),
        (0.63, aim(0.14, 0.22, -0.98)),
        (0.72, aim(0.20, 0.30, -1.04)),
        (0.98, (-0.12, 1.16, 0.42)),
    ),
    "left_hand": ((0.4, (0.28, 1.06, 0.16)), (0.64, (0.34, 1.04, -0.12))),
    "blade": (
        (0.37, (-118, -34)),
        (0.45, (-58, -34)),
        (0.53, (-2, 8)),
        (0.62, (30, 58)),
        (0.72, (40, 74)),
        (0.98, (10, 42)),
    ),
    "elbow": ((0.4, (0.15, 0.2)), (0.55, (0.15, 0.3)), (0.7, (0.15, 0.5))),
    "heel": ((0.55, (32, 0)), (0.7, (28, 0))),
}
_THRUST = {
    "pelvis": ((0.20, (0, -0.03, -0.05)), (0.40, (0, -0.07, 0.12)), (0.52, (0, -0.06, 0.10))),
    "pelvis_turn": ((0.20, (-6, 0, 0)), (0.40, (16, 6, 0)), (0.52, (14, 6, 0))),
    "chest_turn": ((0.21, (-10, 0, 0)), (0.40, (26, 9, 0)), (0.52, (24, 9, 0))),
    "head_turn": ((0.40, (0, 2, 0)),),
    "right_hand": (
        (0.21, (-0.20, 1.12, 0.20)),
        (0.34, aim(-0.02, -0.04, -1.00)),
        (0.41, aim(-0.02, -0.04, -0.70)),
        (0.60, (-0.15, 1.20, 0.50)),
        (0.78, (-0.15, 1.14, 0.42)),
    ),
    "left_hand": ((0.22, (0.28, 1.06, 0.04)), (0.42, (0.34, 1.02, -0.20))),
    "blade": ((0.21, (6, 8)), (0.36, (1, 3)), (0.46, (1, 3)), (0.72, (8, 30))),
    "elbow": ((0.30, (0.15, 0.15)),),
    "heel": ((0.40, (38, 0)), (0.52, (34, 0))),
}
_LUNGE = {
    **{
        c: tuple((t + (0.06 if t > 0.3 else 0.0), v) for t, v in rows)
        for c, rows in _THRUST.items()
    },
    "pelvis": (
        (0.20, (0, -0.03, -0.05)),
        (0.46, (0, -0.20, 0.34)),
        (0.60, (0, -0.20, 0.34)),
        (0.86, (0, -0.06, 0.06)),
    ),
    "chest_turn": ((0.21, (-10, 0, 0)), (0.46, (28, 15, 0)), (0.60, (26, 15, 0))),
    "right_hand": (
        (0.21, (-0.20, 1.12, 0.20)),
        (0.40, aim(-0.02, -0.04, -1.00)),
        (0.48, aim(-0.02, -0.04, -0.70)),
        (0.72, (-0.15, 1.20, 0.48)),
        (0.95, (-0.15, 1.14, 0.42)),
    ),
    "heel": ((0.44, (44, 0)), (0.60, (44, 0))),
}


def _parry(
    label: str,
    hand: tuple[float, float, float],
    blade: tuple[float, float],
    chest: tuple[float, float, float],
    sink: float = 0.03,
) -> Move:
    """The sword goes there in a fifth of a second, holds, and comes back."""
    x, y, z = hand
    return Move(
        label,
        "defence",
        0.84,
        {
            "pelvis": ((0.22, (0.0, -sink, -0.03)), (0.40, (0.0, -sink, -0.03))),
            "chest_turn": ((0.22, chest), (0.40, chest)),
            "head_turn": ((0.24, (0, 3, 0)),),
            "right_hand": ((0.20, (x, y, z)), (0.40, (x, y - 0.01, z - 0.015))),
            "blade": ((0.20, blade), (0.42, blade)),
            "left_hand": ((0.24, (0.30, 1.08, 0.04)),),
            "elbow": ((0.22, (0.15, 0.25)), (0.40, (0.15, 0.25))),
        },
        _SHUFFLE,
    )


def _struck(
    label: str,
    chest: Vector,
    head: Vector,
    shift: Vector,
    steps: tuple[Step, ...],
    travel: tuple[float, float, float],
) -> Move:
    half = tuple(0.5 * v for v in chest)
    return Move(
        label,
        "reaction",
        1.0,
        {
            "pelvis": ((0.12, tuple(0.5 * v for v in shift)), (0.36, shift)),
            "chest_turn": ((0.11, half), (0.22, chest), (0.5, tuple(0.2 * v for v in chest))),
            "head_turn": (
                (0.08, tuple(0.7 * v for v in head)),
                (0.16, head),
                (0.36, tuple(-0.15 * v for v in head)),
            ),
            "right_hand": ((0.20, (-0.24, 1.06, 0.36)), (0.46, (-0.18, 1.12, 0.40))),
            "blade": ((0.22, (-10, 18)), (0.5, (4, 32))),
            "left_hand": ((0.20, (0.36, 1.10, 0.10)), (0.46, (0.32, 1.05, 0.0))),
        },
        steps,
        travel,
    )


_CHEST_HIGH = 1.32
_REACH = 1.74  # m, of a cut with a step
_SINK = {"pelvis": ((0.2, (0, -0.02, 0.0)),)}

MOVES: tuple[Move, ...] = (
    Move("guard", "idle", 0.9, steps=(Step("right", 0.05, 0.26, 0.07),)),
    Move(
        "guard_shift", "idle", 1.1,
        {"pelvis": ((0.35, (0.02, -0.015, 0.04)), (0.75, (-0.02, -0.01, -0.03))), "chest_turn": ((0.35, (3, 2, 1)), (0.75, (-4, -1, -1))),
         "blade": ((0.35, (4, 30)), (0.75, (12, 44)))},
        (Step("right", 0.05, 0.27, 0.07), Step("left", 0.45, 0.67, 0.06)),
    ),
    Move("step_forward", "transition", 0.76, _SINK, _FORWARD, (0, 0.36, 0)),
    Move("step_back", "transition", 0.76, _SINK, _BACK, (0, -0.36, 0)),
    Move("step_left", "transition", 0.78, _SINK, _LEFTWARD, (0.32, 0, 0)),
    Move("step_right", "transition", 0.78, _SINK, _RIGHTWARD, (-0.32, 0, 0)),
    Move("turn_left", "transition", 0.76, {"head_turn": ((0.15, (12, 0, 0)),)}, _LEFTWARD, (0, 0, 38)),
    Move("turn_right", "transition", 0.76, {"head_turn": ((0.15, (-12, 0, 0)),)}, _RIGHTWARD, (0, 0, -38)),
    Move("cut_right", "attack", 1.14, _CUT_RIGHT, _STEP_IN, (0, 0.16, 0), (Blow("right_hand", 0.52, (0, _REACH, _CHEST_HIGH)),)),
    Move("cut_left", "attack", 1.14, _CUT_LEFT, _STEP_IN, (0, 0.16, 0), (Blow("right_hand", 0.52, (0, _REACH, _CHEST_HIGH)),)),
    Move("cut_down", "attack", 1.16, _CUT_DOWN, _STEP_IN, (0, 0.16, 0), (Blow("right_hand", 0.53, (0, _REACH, 1.50)),)),
    Move("cut_up", "attack", 1.16, _CUT_UP, _STEP_IN, (0, 0.16, 0), (Blow("right_hand", 0.53, (0, _REACH, 1.24)),)),
    Move("thrust", "attack", 0.94, _THRUST, _STEP_IN, (0, 0.14, 0), (Blow("right_hand", 0.34, (0, 1.80, _CHEST_HIGH)),)),
    Move(
        "lunge", "attack", 1.30, _LUNGE,
        (Step("right", 0.20, 0.44, 0.07, to=(-0.10, 0.72, -6.0)), Step("right", 0.66, 0.96, 0.06), Step("left", 1.02, 1.20, 0.04)),
        blows=(Blow("right_hand", 0.40, (0, 2.10, 1.26)),),
    ),
    _parry("parry_high", (-0.26, 1.70, 0.40), (62, 16), (-6, -4, 0)),
    _parry("parry_low", (-0.20, 0.94, 0.44), (26, -46), (2, 10, 0), 0.09),
    _parry("parry_left", (0.14, 1.20, 0.46), (6, 78), (10, 2, 0)),
    _parry("parry_right", (-0.38, 1.20, 0.40), (-8, 78), (-14, 2, 0)),
    _struck("struck_front", (0, -18, 0), (0, -24, 0), (0, -0.03, -0.08), _BACK, (0, -0.24, 0)),
    _struck("struck_left", (-16, 4, 10), (-24, -4, 12), (-0.06, -0.03, -0.03), _RIGHTWARD, (-0.18, -0.06, 0)),
    _struck("struck_right", (16, 4, -10), (24, -4, -12), (0.06, -0.03, -0.03), _LEFTWARD, (0.18, -0.06, 0)),
    Move(
        "fall_back", "reaction", 1.75,
        {"pelvis": ((0.12, (0, -0.02, -0.06)), (0.40, (0, -0.16, -0.20)), (0.62, (0, -0.52, -0.40)), (0.78, (0, -0.755, -0.54)), (0.88, (0, -0.775, -0.57)), (1.70, (0, -0.78, -0.58))),
         "pelvis_turn": ((0.14, (-2, -6, 0)), (0.40, (-8, -10, 0)), (0.64, (-18, -22, 0)), (0.80, (-24, -40, 0)), (1.02, (-26, -80, 0)), (1.70, (-26, -80, 0))),
         "chest_turn": ((0.12, (-4, -14, 0)), (0.40, (-12, -8, 0)), (0.66, (-22, -4, 0)), (0.82, (-28, -26, 0)), (1.06, (-30, -88, 0)), (1.16, (-30, -90, 0)), (1.70, (-30, -91, 0))),
         "head_turn": ((0.09, (0, -20, 0)), (0.50, (-4, 10, 0)), (0.84, (-4, -6, 0)), (1.10, (-6, -60, 0)), (1.25, (-6, -78, 0)), (1.70, (-6, -80, 0))),
         "left_hand": ((0.30, (0.30, 1.16, 0.10)), (0.60, put(0.42, 0.52, -0.46)), (1.10, put(0.80, 0.10, -0.88)), (1.70, put(0.82, 0.09, -0.88))),
         "right_hand": ((0.30, (-0.30, 1.20, 0.30)), (0.60, put(-0.52, 0.66, -0.24)), (1.10, put(-0.78, 0.10, -0.92)), (1.70, put(-0.80, 0.09, -0.92))),
         "blade": ((0.30, (-30, 30)), (0.60, (-70, 24)), (1.06, (-84, 3)), (1.70, (-84, 2))),
         "heel": ((0.40, (0, 0)), (1.70, (0, 0)))},
        (Step("left", 0.10, 0.36, 0.06, to=(0.14, 0.12, 8.0)), Step("right", 0.30, 0.56, 0.07, to=(-0.15, 0.22, -2.0))),
        (0, -0.34, 0), to_guard=False,
        plants=(Plant("left_hand", 0.72, 0.92, (0.35, 0.075, -0.70)),),
    ),
    Move(
        "get_up_back", "transition", 2.60,
        {"pelvis": ((0.10, (0, -0.78, -0.58)), (0.55, (0, -0.78, -0.56)), (0.85, (0, -0.72, -0.46)), (1.04, (0, -0.57, -0.31)), (1.22, (0, -0.39, -0.09)), (1.60, (0, -0.28, 0)), (2.05, (0, -0.07, 0))),
         "pelvis_turn": ((0.10, (-26, -80, 0)), (0.60, (-26, -34, 0)), (0.90, (-26, -28, 0)), (1.20, (-24, -10, 0)), (1.60, (-14, 10, 0))),
         "chest_turn": ((0.10, (-30, -91, 0)), (0.60, (-30, -8, 0)), (0.90, (-28, 12, 0)), (1.25, (-24, 22, 0)), (1.60, (-14, 28, 0)), (2.05, (0, 6, 0))),
         "head_turn": ((0.10, (-6, -80, 0)), (0.55, (-4, 0, 0)), (1.20, (0, 4, 0))),
         "left_hand": ((0.10, put(0.82, 0.09, -0.88)), (0.45, put(0.40, 0.20, -0.70)), (1.10, put(0.46, 0.38, -0.06)), (1.46, put(0.34, 0.84, 0.30)), (2.05, (0.30, 1.02, -0.02))),
         "right_hand": ((0.10, put(-0.80, 0.09, -0.92)), (0.55, put(-0.50, 0.24, -0.44)), (0.95, put(-0.40, 0.42, 0.10)), (1.38, put(-0.26, 0.80, 0.44)), (2.05, (-0.15, 1.13, 0.42))),
         "blade": ((0.10, (-84, 2)), (0.60, (-64, 6)), (1.05, (-30, 10)), (1.50, (2, 26))),
         "heel": ((1.25, (34, 14)), (1.7, (28, 8)))},
        (Step("left", 1.48, 1.76, 0.06), Step("right", 1.85, 2.10, 0.06)), from_guard=False,
        plants=(Plant("left_hand", 0.55, 0.98, (0.34, 0.075, -0.74)),),
    ),
)  # fmt: skip


def _of(kind: str) -> tuple[str, ...]:
    return tuple(m.label for m in MOVES if m.kind == kind and m.from_guard and m.to_guard)


_STEPS = tuple(m.label for m in MOVES if m.label.startswith(("step_", "turn_")))

SWORD = Style(
    "sword",
    GUARD,
    FEET,
    MOVES,
    {
        "guard": Take(("guard", "guard_shift"), 8),
        "footwork": Take((*_STEPS, "guard"), 28),
        "cuts": Take((*(m for m in _of("attack") if m.startswith("cut")), "step_back"), 30),
        "thrusts": Take(("thrust", "lunge", "guard", "step_back", "turn_left", "turn_right"), 24),
        "parries": Take((*_of("defence"), "guard"), 25),
        "ripostes": Take(
            ("parry_left", "cut_left", "parry_right", "thrust", "parry_high", "cut_down", "step_back",
             "parry_low", "cut_up"), 27,
        ),
        "struck": Take((*_of("reaction"), "guard", "step_forward"), 20),
        "falls": Take(("fall_back", "get_up_back", "step_forward", "fall_back", "get_up_back")),
        "free": Take((*_of("attack"), *_of("defence"), *_STEPS, "guard"), 34),
    },
    armed=True,
    blow_angle=14.0,
    blow_reach=(-0.08, 0.05),
    blow_height=(-0.14, 0.12),
    blow_step=(-0.05, 0.30),
    blow_turn=34.0,
    travel=0.35,
    tempo=0.1,
)  # fmt: skip
