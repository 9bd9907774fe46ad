"""Boxing: the orthodox guard and what a boxer does from it, as tables (see ``moves.py``)."""

from __future__ import annotations

from collections.abc import Mapping

from kumite.performer.moves import Aim, Blow, Move, Step, Style, Take, Vector, aim

GUARD: Mapping[str, Vector] = {
    "pelvis": (-0.01, 0.935, 0.0),
    "pelvis_turn": (-32.0, 6.0, 0.0),  # yaw, pitch (forward), roll (to the right)
    "chest_turn": (-38.0, 17.0, 0.0),
    "head_turn": (-4.0, 12.0, 0.0),
    "left_hand": (0.075, 1.475, 0.40),
    "right_hand": (-0.035, 1.455, 0.235),
    "elbow": (0.0, 0.0),  # left, right: 0 before the ribs, 1 out at the shoulder, -1 behind
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
        (0.29, (0.43, 1.51, 0.49)),
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
    "left_hand": ((0.38, (0.13, 1.47, 0.31)),),
    "elbow": (
        (0.13, (0, 0.05)),
        (0.26, (0, 0.75)),
        (0.38, (0, 1.0)),
        (0.46, (0, 0.9)),
        (0.66, (0, 0.15)),
    ),
    "heel": ((0.38, (2, 42)), (0.52, (2, 30))),
}


_LEFT_UPPERCUT = {
    "pelvis": ((0.16, (0.03, -0.09, 0.02)), (0.36, (0.01, 0.0, 0.06)), (0.5, (0, -0.01, 0.03))),
    "pelvis_turn": ((0.17, (16, 4, 0)), (0.36, (-18, -2, 0))),
    "chest_turn": ((0.18, (20, 8, -4)), (0.36, (-26, -4, 2))),
    "head_turn": ((0.18, (2, 2, 0)), (0.37, (-2, -2, 0))),
    "left_hand": (
        (0.06, (0.08, 1.46, 0.38)),
        (0.20, (0.17, 1.14, 0.30)),
        (0.36, aim(0, 0, 0)),
        (0.43, aim(-0.03, 0.10, -0.05)),
        (0.62, (0.06, 1.50, 0.42)),
        (0.76, (0.075, 1.475, 0.40)),
    ),
    "right_hand": ((0.36, (-0.05, 1.47, 0.24)),),
    "elbow": ((0.30, (0.10, 0)), (0.42, (0.22, 0))),
    "heel": ((0.18, (8, 14)), (0.36, (20, 16))),
}
_RIGHT_UPPERCUT = {
    "pelvis": ((0.17, (-0.03, -0.09, 0.0)), (0.38, (0.01, 0.0, 0.08)), (0.52, (0, -0.01, 0.04))),
    "pelvis_turn": ((0.18, (-8, 4, 0)), (0.38, (34, -2, 0))),
    "chest_turn": ((0.19, (-10, 8, 4)), (0.38, (58, -4, -2))),
    "head_turn": ((0.19, (-2, 2, 0)), (0.39, (2, -2, 0))),
    "right_hand": (
        (0.06, (-0.035, 1.45, 0.235)),
        (0.21, (-0.15, 1.12, 0.20)),
        (0.38, aim(0, 0, 0)),
        (0.45, aim(0.03, 0.10, -0.05)),
        (0.64, (-0.02, 1.49, 0.32)),
        (0.80, (-0.035, 1.455, 0.235)),
    ),
    "left_hand": ((0.38, (0.10, 1.47, 0.28)),),
    "elbow": ((0.32, (0, 0.10)), (0.44, (0, 0.22))),
    "heel": ((0.19, (4, 18)), (0.38, (2, 42)), (0.52, (2, 30))),
}


def _sunk(time: float, land: float, strikes: bool) -> float:
    """How much lower [m] a hand is at a key of a blow to the body."""
    if not strikes:
        return 0.16
    if time > land + 0.22:
        return 0.0  # back in guard
    return 0.24 if time > 0.1 else 0.03


def _low(keys: Mapping, land: float) -> dict:
    """A blow to the body: the same arm, sunk knees and a trunk that leans in when it lands."""
    out = dict(keys)
    out["pelvis"] = tuple(
        (t, (x, y - (0.15 if t >= land - 0.05 else 0.06), z)) for t, (x, y, z) in keys["pelvis"]
    )
    for channel, more in (("pelvis_turn", 8.0), ("chest_turn", 13.0), ("head_turn", -6.0)):
        out[channel] = tuple(
            (t, (a, b + (more if t >= land - 0.1 else 0.3 * more), c))
            for t, (a, b, c) in keys[channel]
        )
    # A hook to the body swings with the elbow half as high.
    out["elbow"] = tuple((t, (0.4 * left, 0.4 * right)) for t, (left, right) in keys["elbow"])
    for hand in ("left_hand", "right_hand"):
        strikes = any(isinstance(v, Aim) for _, v in keys[hand])
        # The striking arm comes from below, from its load to its way back; the other one sinks.
        out[hand] = tuple(
            (t, v) if isinstance(v, Aim) else (t, (v[0], v[1] - _sunk(t, land, strikes), v[2]))
            for t, v in keys[hand]
        )
    return out


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
    Move("step_forward_left", "transition", 0.74, {"pelvis": ((0.2, (0, -0.02, 0.0)),)}, _FORWARD, (0.19, 0.21, 0)),
    Move("step_forward_right", "transition", 0.74, {"pelvis": ((0.2, (0, -0.02, 0.0)),)}, _FORWARD, (-0.19, 0.21, 0)),
    Move("step_back_left", "transition", 0.74, {"pelvis": ((0.2, (0, -0.02, 0.0)),)}, _BACK, (0.19, -0.21, 0)),
    Move("step_back_right", "transition", 0.74, {"pelvis": ((0.2, (0, -0.02, 0.0)),)}, _BACK, (-0.19, -0.21, 0)),
    Move("pivot_left", "transition", 0.80, {"head_turn": ((0.15, (20, 0, 0)),), "pelvis": ((0.25, (0, -0.03, 0)),)}, _PIVOT, (-0.10, 0.04, 70)),
    Move("pivot_right", "transition", 0.80, {"head_turn": ((0.15, (-20, 0, 0)),), "pelvis": ((0.25, (0, -0.03, 0)),)}, _PIVOT, (0.10, 0.04, -70)),
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
    Move("left_uppercut", "attack", 0.92, _LEFT_UPPERCUT, _LEAD, (0, 0.03, 0), (Blow("left_hand", 0.36, (2, 0.56, 1.47)),)),
    Move("right_uppercut", "attack", 0.96, _RIGHT_UPPERCUT, _LEAD, (0, 0.03, 0), (Blow("right_hand", 0.38, (0, 0.56, 1.47)),)),
    Move("jab_low", "attack", 0.82, _low(_JAB, 0.29), _LEAD, (0, 0.06, 0), (Blow("left_hand", 0.32, (2, 0.82, BODY_HIGH)),)),
    Move("cross_low", "attack", 0.90, _low(_CROSS, 0.32), _LEAD, (0, 0.06, 0), (Blow("right_hand", 0.355, (0, 0.82, BODY_HIGH)),)),
    Move("left_hook_low", "attack", 0.96, _low(_LEFT_HOOK, 0.36), _LEAD, (0, 0.04, 0), (Blow("left_hand", 0.365, (4, 0.58, BODY_HIGH)),)),
    Move("right_hook_low", "attack", 1.0, _low(_RIGHT_HOOK, 0.38), _LEAD, (0, 0.04, 0), (Blow("right_hand", 0.385, (-2, 0.58, BODY_HIGH)),)),
    Move(
        "one_two_hook", "attack", 1.60, _after(_after(_JAB, _CROSS, 0.30), _LEFT_HOOK, 0.74), _LEAD, (0, 0.06, 0),
        (Blow("left_hand", 0.32, (2, 0.84, HEAD_HIGH)), Blow("right_hand", 0.655, (0, 0.84, HEAD_HIGH)),
         Blow("left_hand", 1.105, (4, 0.62, HEAD_HIGH))),
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
        "slip_left", "defence", 0.80,
        {"pelvis": ((0.24, (0.07, -0.10, 0.02)), (0.34, (0.07, -0.10, 0.02))),
         "pelvis_turn": ((0.24, (10, 6, -6)),),
         "chest_turn": ((0.24, (26, 14, -20)), (0.34, (26, 14, -20))),
         "head_turn": ((0.26, (2, 2, -14)),),
         "left_hand": ((0.26, (0.22, 1.36, 0.44)), (0.36, (0.22, 1.36, 0.44))),
         "right_hand": ((0.26, (0.10, 1.36, 0.34)), (0.36, (0.10, 1.36, 0.34)))},
        (Step("left", 0.04, 0.22, 0.075),), avoid=(0.12, 0.50),
    ),
    Move(
        "slip_right", "defence", 0.80,
        {"pelvis": ((0.24, (-0.07, -0.10, 0.02)), (0.34, (-0.07, -0.10, 0.02))),
         "pelvis_turn": ((0.24, (-6, 6, 6)),),
         "chest_turn": ((0.24, (-16, 14, 20)), (0.34, (-16, 14, 20))),
         "head_turn": ((0.26, (-2, 2, 14)),),
         "left_hand": ((0.26, (-0.04, 1.36, 0.42)), (0.36, (-0.04, 1.36, 0.42))),
         "right_hand": ((0.26, (-0.17, 1.34, 0.24)), (0.36, (-0.17, 1.34, 0.24)))},
        (Step("left", 0.04, 0.22, 0.075),), avoid=(0.12, 0.50),
    ),
    Move(
        "roll_left", "defence", 1.05,
        {"pelvis": ((0.20, (-0.07, -0.10, 0.01)), (0.40, (0.0, -0.24, 0.0)), (0.60, (0.08, -0.11, 0.01))),
         "pelvis_turn": ((0.20, (-4, 8, 5)), (0.40, (2, 14, 0)), (0.60, (10, 8, -5))),
         "chest_turn": ((0.20, (-12, 18, 18)), (0.40, (4, 32, 0)), (0.60, (22, 18, -18))),
         "head_turn": ((0.40, (0, 8, 0)),),
         "left_hand": ((0.22, (-0.02, 1.36, 0.41)), (0.42, (0.10, 1.18, 0.46)), (0.62, (0.21, 1.36, 0.43))),
         "right_hand": ((0.22, (-0.15, 1.34, 0.25)), (0.42, (-0.04, 1.17, 0.40)), (0.62, (0.09, 1.36, 0.33))),
         "heel": ((0.40, (6, 30)),)},
        (Step("left", 0.04, 0.22, 0.075),), avoid=(0.14, 0.74),
    ),
    Move(
        "roll_right", "defence", 1.05,
        {"pelvis": ((0.20, (0.07, -0.10, 0.01)), (0.40, (0.0, -0.24, 0.0)), (0.60, (-0.08, -0.11, 0.01))),
         "pelvis_turn": ((0.20, (10, 8, -5)), (0.40, (2, 14, 0)), (0.60, (-4, 8, 5))),
         "chest_turn": ((0.20, (22, 18, -18)), (0.40, (4, 32, 0)), (0.60, (-12, 18, 18))),
         "head_turn": ((0.40, (0, 8, 0)),),
         "left_hand": ((0.22, (0.21, 1.36, 0.43)), (0.42, (0.10, 1.18, 0.46)), (0.62, (-0.02, 1.36, 0.41))),
         "right_hand": ((0.22, (0.09, 1.36, 0.33)), (0.42, (-0.04, 1.17, 0.40)), (0.62, (-0.15, 1.34, 0.25))),
         "heel": ((0.40, (6, 30)),)},
        (Step("left", 0.04, 0.22, 0.075),), avoid=(0.14, 0.74),
    ),
    Move(
        "sway_back", "defence", 0.90,
        {"pelvis": ((0.26, (0.0, -0.05, -0.06)), (0.40, (0.0, -0.05, -0.06))),
         "pelvis_turn": ((0.26, (-4, -14, 0)), (0.40, (-4, -14, 0))),
         "chest_turn": ((0.27, (-6, -36, 0)), (0.40, (-6, -36, 0))),
         "head_turn": ((0.28, (0, -6, 0)),),
         "left_hand": ((0.28, (0.08, 1.46, 0.14)), (0.40, (0.08, 1.46, 0.14))),
         "right_hand": ((0.28, (-0.05, 1.43, 0.00)), (0.40, (-0.05, 1.43, 0.00)))},
        (Step("left", 0.04, 0.22, 0.075),), avoid=(0.14, 0.58),
    ),
    Move(
        "block_high_left", "defence", 0.80,
        {"pelvis": ((0.22, (-0.01, -0.03, -0.02)),), "chest_turn": ((0.22, (-10, 2, 4)), (0.36, (-10, 2, 4))),
         "head_turn": ((0.22, (2, 8, 3)),),
         "left_hand": ((0.20, (0.13, 1.60, 0.24)), (0.38, (0.13, 1.59, 0.23))),
         "right_hand": ((0.22, (-0.04, 1.47, 0.24)),), "elbow": ((0.20, (0.30, 0)), (0.38, (0.30, 0)))},
        (Step("left", 0.04, 0.22, 0.075),),
    ),
    Move(
        "block_high_right", "defence", 0.80,
        {"pelvis": ((0.22, (0.01, -0.03, -0.02)),), "chest_turn": ((0.22, (14, 2, -4)), (0.36, (14, 2, -4))),
         "head_turn": ((0.22, (-2, 8, -3)),),
         "right_hand": ((0.20, (-0.10, 1.60, 0.20)), (0.38, (-0.10, 1.59, 0.19))),
         "left_hand": ((0.22, (0.09, 1.48, 0.34)),), "elbow": ((0.20, (0, 0.30)), (0.38, (0, 0.30)))},
        (Step("left", 0.04, 0.22, 0.075),),
    ),
    Move(
        "block_low_left", "defence", 0.85,
        {"pelvis": ((0.24, (0.0, -0.09, -0.03)), (0.38, (0.0, -0.09, -0.03))),
         "chest_turn": ((0.24, (2, 12, -12)), (0.38, (2, 12, -12))), "head_turn": ((0.24, (0, 4, 4)),),
         "left_hand": ((0.22, (0.16, 1.22, 0.33)), (0.38, (0.16, 1.22, 0.33))),
         "right_hand": ((0.24, (-0.05, 1.36, 0.27)),)},
        (Step("left", 0.04, 0.22, 0.075),),
    ),
    Move(
        "block_low_right", "defence", 0.85,
        {"pelvis": ((0.24, (0.0, -0.09, -0.03)), (0.38, (0.0, -0.09, -0.03))),
         "chest_turn": ((0.24, (4, 12, 12)), (0.38, (4, 12, 12))), "head_turn": ((0.24, (0, 4, -4)),),
         "right_hand": ((0.22, (-0.14, 1.20, 0.22)), (0.38, (-0.14, 1.20, 0.22))),
         "left_hand": ((0.24, (0.08, 1.37, 0.38)),)},
        (Step("left", 0.04, 0.22, 0.075),),
    ),
    Move(
        "parry_left", "defence", 0.70,
        {"chest_turn": ((0.20, (-8, 0, 0)),), "head_turn": ((0.2, (4, 2, 0)),),
         "left_hand": ((0.10, (0.14, 1.50, 0.40)), (0.22, (-0.05, 1.45, 0.44)), (0.32, (-0.02, 1.44, 0.42)))},
        (Step("left", 0.04, 0.22, 0.075),),
    ),
    Move(
        "parry_right", "defence", 0.70,
        {"chest_turn": ((0.20, (12, 0, 0)),), "head_turn": ((0.2, (-4, 2, 0)),),
         "right_hand": ((0.10, (-0.10, 1.49, 0.27)), (0.22, (0.08, 1.44, 0.37)), (0.32, (0.06, 1.43, 0.35)))},
        (Step("left", 0.04, 0.22, 0.075),),
    ),
    Move(
        "jump_back", "defence", 0.85,
        {"pelvis": ((0.12, (0, -0.10, 0.03)), (0.27, (0, 0.05, -0.02)), (0.44, (0, -0.09, -0.03))),
         "chest_turn": ((0.14, (0, 6, 0)), (0.44, (0, 7, 0))),
         "heel": ((0.13, (20, 24)), (0.28, (26, 30)), (0.44, (8, 16)))},
        (Step("left", 0.15, 0.40, 0.12), Step("right", 0.14, 0.38, 0.11)), (0, -0.48, 0), avoid=(0.16, 0.60),
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
    Move(
        "struck_body_front", "reaction", 1.0,
        {"pelvis": ((0.12, (0, -0.04, -0.08)), (0.34, (0, -0.10, -0.12))),
         "pelvis_turn": ((0.16, (0, 12, 0)), (0.34, (0, 12, 0))),
         "chest_turn": ((0.14, (0, 30, 0)), (0.34, (0, 34, 0))), "head_turn": ((0.16, (0, 20, 0)), (0.36, (0, 12, 0))),
         "left_hand": ((0.18, (0.10, 1.20, 0.28)), (0.36, (0.10, 1.18, 0.28))),
         "right_hand": ((0.18, (-0.07, 1.17, 0.20)), (0.36, (-0.07, 1.15, 0.20)))},
        _BACK, (0, -0.16, 0),
    ),
    Move(
        "struck_body_left", "reaction", 1.0,
        {"pelvis": ((0.12, (-0.05, -0.04, -0.03)), (0.34, (-0.07, -0.09, -0.05))),
         "chest_turn": ((0.14, (-8, 18, -18)), (0.34, (-8, 20, -20))), "head_turn": ((0.16, (-6, 14, -6)),),
         "left_hand": ((0.18, (0.12, 1.20, 0.28)), (0.36, (0.12, 1.19, 0.27))),
         "right_hand": ((0.18, (-0.10, 1.30, 0.20)),)},
        _RIGHTWARD, (-0.10, -0.05, 0),
    ),
    Move(
        "struck_body_right", "reaction", 1.0,
        {"pelvis": ((0.12, (0.05, -0.04, -0.03)), (0.34, (0.07, -0.09, -0.05))),
         "chest_turn": ((0.14, (10, 18, 18)), (0.34, (10, 20, 20))), "head_turn": ((0.16, (6, 14, 6)),),
         "left_hand": ((0.18, (0.10, 1.32, 0.32)),),
         "right_hand": ((0.18, (-0.10, 1.18, 0.18)), (0.36, (-0.10, 1.17, 0.17)))},
        _LEFTWARD, (0.10, -0.05, 0),
    ),
    Move(
        "stagger", "reaction", 1.75,
        {"pelvis": ((0.12, (0, -0.02, -0.07)), (0.45, (0.06, -0.07, -0.12)), (0.85, (-0.07, -0.08, -0.10)), (1.25, (0.03, -0.05, -0.04))),
         "pelvis_turn": ((0.14, (-4, -8, 0)), (0.5, (8, 2, 5)), (0.9, (-8, 4, -5)), (1.3, (0, 2, 0))),
         "chest_turn": ((0.12, (-8, -22, 2)), (0.34, (-12, -20, 6)), (0.66, (14, 6, 12)), (1.02, (-12, 12, -10)), (1.36, (0, 4, 2))),
         "head_turn": ((0.09, (6, -34, 8)), (0.20, (10, -38, 12)), (0.60, (14, 10, 14)), (0.95, (-12, 16, -12)), (1.3, (0, 4, 0))),
         "left_hand": ((0.20, (0.24, 1.34, 0.26)), (0.60, (0.30, 1.22, 0.30)), (1.0, (0.20, 1.28, 0.32)), (1.35, (0.10, 1.42, 0.36))),
         "right_hand": ((0.20, (-0.22, 1.30, 0.06)), (0.60, (-0.22, 1.16, 0.16)), (1.0, (-0.24, 1.24, 0.10)), (1.35, (-0.07, 1.40, 0.22)))},
        (Step("right", 0.10, 0.34, 0.07, True), Step("left", 0.36, 0.62, 0.08, True), Step("right", 0.66, 0.92, 0.07, True),
         Step("left", 0.96, 1.24), Step("right", 1.26, 1.50, 0.06)),
        (0, -0.62, 0),
    ),
)  # fmt: skip

BOXING = Style(
    "boxing",
    GUARD,
    FEET,
    MOVES,
    {
        "guard": Take(("guard", "guard_shift"), 12),
        "footwork": Take(
            (*(m.label for m in MOVES if m.label.startswith("step_")), "guard", "guard_shift"),
            36,
        ),
        "turns": Take(("turn_left", "turn_right", "pivot_left", "pivot_right", "step_back"), 24),
        "jab": Take(("jab", "jab", "guard", "step_back", "turn_left", "turn_right"), 36),
        "cross": Take(("cross", "cross", "guard", "step_back", "turn_left", "turn_right"), 34),
        "hooks": Take(
            ("left_hook", "right_hook", "guard", "step_back", "turn_left", "turn_right"), 34
        ),
        "one_two": Take(
            ("one_two", "one_two", "step_back", "guard", "turn_left", "turn_right"), 30
        ),
        "uppercuts": Take(
            ("left_uppercut", "right_uppercut", "guard", "step_back", "turn_left"), 26
        ),
        "low": Take(
            (*(m.label for m in MOVES if m.label.endswith("_low")), "guard", "step_back"), 30
        ),
        "combinations": Take(("one_two_hook", "one_two", "step_back", "turn_right"), 20),
        "defence": Take((*(m.label for m in MOVES if m.kind == "defence"), "guard"), 44),
        "counter": Take(
            ("slip_left", "cross", "slip_right", "left_hook", "duck", "jab", "step_back"),
            30,
        ),
        "struck": Take(
            (*(m.label for m in MOVES if m.kind == "reaction"), "guard", "step_forward"),
            36,
        ),
        "shadow": Take(tuple(m.label for m in MOVES if m.kind != "reaction"), 48),
    },
    blow_angle=16.0,
    blow_reach=(-0.05, 0.06),
    blow_height=(-0.12, 0.07),
    travel=0.5,
    tempo=0.12,
)
