"""Blows of the fists: straights, hooks and uppercuts, high and low, and their combinations."""

from __future__ import annotations

from collections.abc import Mapping

from kumite.performer.moves import Blow, Move, Put, aim, put
from kumite.performer.patterns import LEAD

HEAD_HIGH = 1.56  # m, where a boxer's head is in guard
BODY_HIGH = 1.17

_JAB = {
    "pelvis": (
        (0.08, (0.0, -0.010, -0.010)),
        (0.28, (0.015, -0.03, 0.055)),
        (0.44, (0.01, -0.02, 0.04)),
    ),
    "pelvis_turn": ((0.10, (5, 0, 0)), (0.25, (-12, 5, 0)), (0.42, (-4, 2, 0))),
    "chest_turn": ((0.10, (8, -1, 0)), (0.25, (-26, 6, 1)), (0.44, (-6, 2, 0))),
    "head_turn": ((0.25, (2, 5, -3)),),
    "left_hand": (
        (0.10, (0.085, 1.455, 0.335)),
        (0.22, aim(0, 0, 0)),
        (0.255, aim(0, 0, 0.21)),
        (0.40, (0.06, 1.49, 0.50)),
        (0.54, (0.075, 1.475, 0.40)),
    ),
    "right_hand": (
        (0.10, (-0.10, 1.455, 0.23)),
        (0.26, (-0.13, 1.445, 0.20)),
        (0.42, (-0.10, 1.455, 0.23)),
    ),
    "elbow": ((0.09, (-0.05, 0.0)), (0.22, (0.35, 0.0)), (0.29, (0.40, 0.0)), (0.44, (0.05, 0.0))),
    "heel": ((0.26, (0, 20)),),
}
_CROSS = {
    "pelvis": (
        (0.09, (-0.005, -0.015, -0.012)),
        (0.31, (0.02, -0.04, 0.065)),
        (0.48, (0.015, -0.03, 0.04)),
    ),
    "pelvis_turn": ((0.11, (-7, 0, 0)), (0.28, (42, 4, 0)), (0.37, (36, 4, 0))),
    "chest_turn": ((0.11, (-10, 0, 0)), (0.285, (74, 7, -2)), (0.37, (62, 6, -2))),
    "head_turn": ((0.29, (2, 4, 3)),),
    "right_hand": (
        (0.10, (-0.09, 1.45, 0.19)),
        (0.165, (-0.08, 1.47, 0.28)),
        (0.25, aim(0, 0, 0)),
        (0.295, aim(0, 0, 0.24)),
        (0.46, (-0.05, 1.48, 0.38)),
        (0.62, (-0.085, 1.46, 0.24)),
    ),
    "left_hand": (
        (0.14, (0.075, 1.485, 0.37)),
        (0.29, (0.10, 1.475, 0.24)),
        (0.46, (0.085, 1.475, 0.30)),
    ),
    "elbow": ((0.12, (0.0, 0.12)), (0.25, (0.0, 0.35)), (0.32, (0.0, 0.42)), (0.48, (0.0, 0.05))),
    "heel": ((0.12, (2, 18)), (0.28, (0, 46)), (0.42, (0, 38))),
}
_LEFT_HOOK = {
    "pelvis": (
        (0.17, (0.045, -0.05, 0.02)),
        (0.37, (-0.01, -0.03, 0.06)),
        (0.52, (0, -0.02, 0.03)),
    ),
    "pelvis_turn": ((0.18, (22, 2, 0)), (0.37, (-30, 2, 0)), (0.47, (-30, 2, 0))),
    "chest_turn": ((0.19, (34, 3, -3)), (0.385, (-42, 3, 0)), (0.48, (-44, 3, 0))),
    "head_turn": ((0.19, (5, 3, 0)), (0.39, (-3, 3, 0))),
    "left_hand": (
        (0.20, (0.35, 1.39, 0.18)),
        (0.275, (0.50, 1.48, 0.38)),
        (0.335, aim(0.06, 0, 0)),
        (0.385, aim(-0.30, 0.01, -0.08)),
        (0.46, aim(-0.36, 0.0, -0.26)),
        (0.66, (0.04, 1.48, 0.37)),
    ),
    "right_hand": (
        (0.19, (-0.09, 1.46, 0.24)),
        (0.36, (-0.15, 1.44, 0.17)),
        (0.50, (-0.15, 1.44, 0.18)),
    ),
    "elbow": (
        (0.10, (0.1, 0)),
        (0.25, (0.85, 0)),
        (0.37, (1.1, 0)),
        (0.48, (0.85, 0)),
        (0.66, (0.1, 0)),
    ),
    "heel": ((0.36, (34, 12)), (0.5, (20, 12))),
}
_RIGHT_HOOK = {
    "pelvis": (
        (0.17, (-0.035, -0.04, -0.02)),
        (0.39, (0.02, -0.05, 0.05)),
        (0.54, (0.01, -0.02, 0.04)),
    ),
    "pelvis_turn": ((0.18, (-12, 2, 0)), (0.39, (44, 5, 0)), (0.48, (42, 5, 0))),
    "chest_turn": ((0.19, (-18, 2, 3)), (0.40, (80, 4, 0)), (0.49, (80, 4, 0))),
    "head_turn": ((0.20, (-4, 3, 0)), (0.41, (3, 3, 0))),
    "right_hand": (
        (0.21, (-0.35, 1.39, 0.12)),
        (0.295, (-0.48, 1.48, 0.34)),
        (0.35, aim(-0.08, 0, 0)),
        (0.41, aim(0.28, 0.01, -0.07)),
        (0.49, aim(0.33, 0.0, -0.24)),
        (0.70, (0.0, 1.47, 0.28)),
    ),
    "left_hand": ((0.39, (0.15, 1.45, 0.27)), (0.52, (0.15, 1.45, 0.27))),
    "elbow": (
        (0.12, (0, 0.05)),
        (0.27, (0, 0.85)),
        (0.39, (0, 1.1)),
        (0.50, (0, 0.9)),
        (0.70, (0, 0.1)),
    ),
    "heel": ((0.39, (2, 44)), (0.53, (2, 30))),
}
_LEFT_UPPERCUT = {
    "pelvis": ((0.19, (0.035, -0.11, 0.02)), (0.37, (0.01, 0.01, 0.07)), (0.5, (0, -0.01, 0.03))),
    "pelvis_turn": ((0.20, (18, 5, 0)), (0.38, (-20, -2, 0))),
    "chest_turn": ((0.21, (26, 12, -6)), (0.38, (-32, -5, 2))),
    "head_turn": ((0.20, (2, 2, 0)), (0.39, (-2, -2, 0))),
    "left_hand": (
        (0.20, put(0.20, 0.96, 0.10)),
        (0.265, put(0.16, 1.04, 0.40)),
        (0.33, aim(0.01, 0, 0)),
        (0.38, aim(-0.03, 0.33, -0.06)),
        (0.64, (0.06, 1.50, 0.40)),
    ),
    "right_hand": ((0.36, (-0.14, 1.44, 0.18)), (0.46, (-0.14, 1.44, 0.18))),
    "elbow": ((0.20, (0.05, 0)), (0.35, (0.0, 0)), (0.44, (0.10, 0))),
    "heel": ((0.19, (8, 14)), (0.37, (22, 18))),
}
_RIGHT_UPPERCUT = {
    "pelvis": ((0.20, (-0.03, -0.11, 0.0)), (0.39, (0.01, 0.0, 0.07)), (0.54, (0, -0.01, 0.04))),
    "pelvis_turn": ((0.20, (-8, 5, 0)), (0.39, (38, -2, 0))),
    "chest_turn": ((0.21, (-12, 12, 6)), (0.39, (66, -5, -2))),
    "head_turn": ((0.20, (-2, 2, 0)), (0.40, (2, -2, 0))),
    "right_hand": (
        (0.20, put(-0.21, 0.94, -0.04)),
        (0.28, put(-0.15, 1.03, 0.34)),
        (0.35, aim(-0.01, 0, 0)),
        (0.40, aim(0.03, 0.33, -0.06)),
        (0.66, (-0.03, 1.49, 0.30)),
    ),
    "left_hand": ((0.39, (0.11, 1.465, 0.27)),),
    "elbow": ((0.20, (0, 0.05)), (0.37, (0, 0.0)), (0.46, (0, 0.10))),
    "heel": ((0.20, (4, 18)), (0.39, (2, 44)), (0.54, (2, 30))),
}


def _low(keys: Mapping, land: float) -> dict:
    """A blow to the body: the same arm, sunk knees and a trunk that leans in when it lands."""
    out = dict(keys)
    out["pelvis"] = tuple(
        (t, (x, y - (0.17 if t >= land - 0.05 else 0.08), z)) for t, (x, y, z) in keys["pelvis"]
    )
    for channel, more in (("pelvis_turn", 8.0), ("chest_turn", 12.0), ("head_turn", -4.0)):
        out[channel] = tuple(
            (t, (a, b + (more if t >= land - 0.1 else 0.3 * more), c))
            for t, (a, b, c) in keys[channel]
        )
    for hand in ("left_hand", "right_hand"):  # an uppercut is loaded as much lower as it lands
        out[hand] = tuple(
            (t, put(v.place[0], v.place[1] - 0.09, v.place[2]) if isinstance(v, Put) else v)
            for t, v in keys[hand]
        )
    # A hook to the body swings with the elbow half as high.
    out["elbow"] = tuple((t, (0.5 * left, 0.5 * right)) for t, (left, right) in keys["elbow"])
    return out


def _after(first: Mapping, second: Mapping, at: float) -> dict:
    """Two blows in a row: keys of the first up to ``at``, then those of the second."""
    late = {c: tuple((t + at, v) for t, v in rows) for c, rows in second.items()}
    out = {}
    for c in {*first, *late}:
        rows = late.get(c, ())
        begin = min((t for t, _ in rows), default=float("inf"))
        out[c] = tuple(r for r in first.get(c, ()) if r[0] < begin - 0.04) + tuple(rows)
    return out


_STRAIGHT = (0.82, HEAD_HIGH)  # distance and height of the target
_CROSS_AT = (0.78, HEAD_HIGH)
_HOOK = (0.70, HEAD_HIGH)
_UPPERCUT = (0.61, 1.40)
_JAB_LANDS, _CROSS_LANDS, _LEFT_HOOK_LANDS, _RIGHT_HOOK_LANDS = 0.22, 0.25, 0.335, 0.35
_LEFT_UPPERCUT_LANDS, _RIGHT_UPPERCUT_LANDS = 0.33, 0.35
_SECOND, _THIRD = 0.26, 0.62  # s after the first blow of a combination


def _blow(
    label: str, seconds: float, keys: Mapping, ahead: float, *blows: tuple[str, float, tuple]
) -> Move:
    struck = tuple(Blow(f"{side}_hand", time, target) for side, time, target in blows)
    return Move(label, "attack", seconds, keys, LEAD, (0, ahead, 0), struck)


BLOWS: tuple[Move, ...] = (
    _blow("jab", 0.72, _JAB, 0.06, ("left", _JAB_LANDS, (2, *_STRAIGHT))),
    _blow("cross", 0.78, _CROSS, 0.05, ("right", _CROSS_LANDS, (0, *_CROSS_AT))),
    _blow("left_hook", 0.86, _LEFT_HOOK, 0.04, ("left", _LEFT_HOOK_LANDS, (4, *_HOOK))),
    _blow("right_hook", 0.90, _RIGHT_HOOK, 0.04, ("right", _RIGHT_HOOK_LANDS, (-2, *_HOOK))),
    _blow("left_uppercut", 0.84, _LEFT_UPPERCUT, 0.04, ("left", _LEFT_UPPERCUT_LANDS, (2, *_UPPERCUT))),
    _blow("right_uppercut", 0.88, _RIGHT_UPPERCUT, 0.04, ("right", _RIGHT_UPPERCUT_LANDS, (0, *_UPPERCUT))),
    _blow("jab_low", 0.78, _low(_JAB, 0.25), 0.08, ("left", _JAB_LANDS, (2, 0.87, BODY_HIGH))),
    _blow("cross_low", 0.84, _low(_CROSS, 0.28), 0.08, ("right", _CROSS_LANDS, (0, 0.86, BODY_HIGH))),
    _blow("left_hook_low", 0.92, _low(_LEFT_HOOK, 0.36), 0.05, ("left", _LEFT_HOOK_LANDS, (4, 0.76, BODY_HIGH))),
    _blow("right_hook_low", 0.96, _low(_RIGHT_HOOK, 0.38), 0.05, ("right", _RIGHT_HOOK_LANDS, (-2, 0.78, BODY_HIGH))),
    _blow("left_uppercut_low", 0.90, _low(_LEFT_UPPERCUT, 0.36), 0.05, ("left", _LEFT_UPPERCUT_LANDS, (2, 0.66, 1.02))),
    _blow("right_uppercut_low", 0.94, _low(_RIGHT_UPPERCUT, 0.38), 0.05, ("right", _RIGHT_UPPERCUT_LANDS, (0, 0.66, 1.02))),
    _blow(
        "one_two", 1.04, _after(_JAB, _CROSS, _SECOND), 0.07,
        ("left", _JAB_LANDS, (2, *_STRAIGHT)), ("right", _SECOND + _CROSS_LANDS, (0, *_CROSS_AT)),
    ),
    _blow(
        "one_two_hook", 1.48, _after(_after(_JAB, _CROSS, _SECOND), _LEFT_HOOK, _THIRD), 0.07,
        ("left", _JAB_LANDS, (2, *_STRAIGHT)), ("right", _SECOND + _CROSS_LANDS, (0, *_CROSS_AT)),
        ("left", _THIRD + _LEFT_HOOK_LANDS, (4, *_HOOK)),
    ),
    _blow(
        "jab_cross_uppercut", 1.46, _after(_after(_JAB, _CROSS, _SECOND), _LEFT_UPPERCUT, _THIRD), 0.07,
        ("left", _JAB_LANDS, (2, *_STRAIGHT)), ("right", _SECOND + _CROSS_LANDS, (0, *_CROSS_AT)),
        ("left", _THIRD + _LEFT_UPPERCUT_LANDS, (2, *_UPPERCUT)),
    ),
)  # fmt: skip
