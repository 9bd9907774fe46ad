"""Walking, running, starting and stopping, turning, and leaps aside: gaits as tables of phases.

A gait is written as a cycle that goes on from itself: one step of each foot while the stance glides
at one speed. Starts lead into it from a stand, stops out of it; all of them meet at the same phase,
the left foot about to be lifted, so cycles and takes join anywhere they meet.
"""

from __future__ import annotations

from collections.abc import Mapping

from kumite.performer.moves import Foothold, Move, Step, Style, Take, Vector

STAND: Mapping[str, Vector] = {
    "pelvis": (0.0, 0.988, 0.0),
    "pelvis_turn": (0.0, 2.0, 0.0),
    "chest_turn": (0.0, 3.0, 0.0),
    "head_turn": (0.0, 2.0, 0.0),
    "left_hand": (0.27, 0.815, 0.07),
    "right_hand": (-0.27, 0.815, 0.07),
    "elbow": (0.15, 0.15),
    "heel": (0.0, 0.0),
}
FEET: Mapping[str, Foothold] = {"left": (0.085, 0.125, 7.0), "right": (-0.085, 0.125, -7.0)}


_SIGNS = {"left": 1.0, "right": -1.0}


def _gait(
    label: str,
    seconds: float,
    travel: tuple[float, float, float],
    *,
    swing: float,
    lift: float,
    rise: float,
    arms: float,
    bend: float = 0.0,
    toe_off: float = 30.0,
    lean: float = 0.0,
    twist: float = 7.0,
    sink: float = 0.0,
    feet: float | None = None,
) -> Move:
    """One cycle of a gait.

    swing: share of the cycle that a foot is in the air; lift: how high [m]; rise: how much higher the
    pelvis is between steps than at them [m]; arms: how far hands swing to either side [m]; bend: how
    far elbows are bent, 0..1; toe_off: the heel before a foot is lifted [deg]; lean: of the trunk
    [deg]; twist: of the hips [deg]; sink: how much lower the pelvis is than in the stand [m];
    feet: how far either foot is to the side [m], if not as in the stand.
    """
    t = seconds
    up, down = rise - sink, -rise - sink
    side = 0.022

    def hand(sign: float, at: float) -> tuple[float, float, float]:
        """A hand of the left (+1) or right side, ``at`` -1 behind to 1 ahead."""
        x = 0.27 - 0.02 * bend
        y = 0.785 + 0.40 * bend + 0.07 * bend * at + 0.025 * at**2
        return (sign * x, y, 0.07 + 0.16 * bend + arms * at)

    apart = {
        s: None if feet is None else (sign * feet, FEET[s][1], FEET[s][2])
        for s, sign in _SIGNS.items()
    }
    return Move(
        label,
        "transition",
        seconds,
        {
            # Feet meet the ground at 0 (right) and half (left): there the body is lowest.
            "pelvis": (
                (0.0, (0.0, down, 0.0)),
                (0.25 * t, (-side, up, 0.0)),
                (0.50 * t, (0.0, down, 0.0)),
                (0.75 * t, (side, up, 0.0)),
            ),
            "pelvis_turn": (
                (0.0, (twist, lean * 0.5, 0.0)),
                (0.25 * t, (0.0, lean * 0.5, 2.0)),
                (0.50 * t, (-twist, lean * 0.5, 0.0)),
                (0.75 * t, (0.0, lean * 0.5, -2.0)),
            ),
            "chest_turn": (
                (0.0, (-0.8 * twist, lean, 0.0)),
                (0.25 * t, (0.0, lean, -1.0)),
                (0.50 * t, (0.8 * twist, lean, 0.0)),
                (0.75 * t, (0.0, lean, 1.0)),
            ),
            "left_hand": (
                (0.0, hand(1, 1.0)),
                (0.25 * t, hand(1, 0.0)),
                (0.50 * t, hand(1, -1.0)),
                (0.75 * t, hand(1, 0.0)),
            ),
            "right_hand": (
                (0.0, hand(-1, -1.0)),
                (0.25 * t, hand(-1, 0.0)),
                (0.50 * t, hand(-1, 1.0)),
                (0.75 * t, hand(-1, 0.0)),
            ),
            "heel": (
                (0.02 * t, (toe_off, 0.0)),
                (0.20 * t, (0.7 * toe_off, 0.0)),
                (0.40 * t, (0.0, 0.0)),
                (0.44 * t, (0.0, 0.25 * toe_off)),
                (0.52 * t, (0.0, toe_off)),
                (0.70 * t, (0.0, 0.7 * toe_off)),
                (0.90 * t, (0.0, 0.0)),
                (0.94 * t, (0.25 * toe_off, 0.0)),
            ),
        },
        (
            Step("left", (0.5 - swing) * t + 0.001, 0.5 * t, lift, True, apart["left"]),
            Step("right", (1.0 - swing) * t, t - 0.001, lift, True, apart["right"]),
        ),
        travel,
        glide="steady",
        from_guard=False,
        to_guard=False,
    )


def _from_stand(cycle: Move, label: str) -> Move:
    """A step of each foot that gathers speed, from the stand."""
    t = 1.05 * cycle.seconds
    x, z, yaw = cycle.travel
    share = 0.5 * t / cycle.seconds  # from rest to the cycle's speed: half of the way it would go
    high = cycle.steps[0].height
    return Move(
        label,
        "transition",
        t,
        {
            "pelvis": ((0.3 * t, (-0.02, -0.01, 0.015)),),
            # The arms are where they swing through before they begin to swing.
            **{c: ((0.7 * t, cycle.keys[c][1][1]),) for c in ("left_hand", "right_hand")},
        },
        (
            Step("left", 0.16 * t, 0.50 * t, 0.7 * high, True, cycle.steps[0].to),
            Step("right", 0.58 * t, t - 0.001, 0.9 * high, True, cycle.steps[1].to),
        ),
        (x * share, z * share, yaw * share),
        glide="start",
        from_guard=False,
        to_guard=False,
    )


def _to_stand(cycle: Move, label: str) -> Move:
    """The last two steps, to rest with the feet side by side."""
    t = 1.1 * cycle.seconds
    x, z, yaw = cycle.travel
    share = 0.5 * t / cycle.seconds
    return Move(
        label,
        "transition",
        t,
        {},
        (
            Step("left", 0.06 * t, 0.44 * t, cycle.steps[0].height),
            Step("right", 0.46 * t, 0.84 * t, 0.8 * cycle.steps[0].height),
        ),
        (x * share, z * share, yaw * share),
        glide="stop",
        from_guard=False,
        to_guard=False,
    )


_WALK = {"swing": 0.40, "lift": 0.075, "rise": 0.012, "arms": 0.17}
_RUN = {"swing": 0.64, "lift": 0.21, "rise": -0.03, "arms": 0.20, "bend": 1.0, "toe_off": 42.0, "lean": 9.0}  # fmt: skip
_GAITS = (
    _gait("walk", 1.08, (0, 1.22, 0), **_WALK),
    _gait("walk_slow", 1.24, (0, 0.95, 0), swing=0.38, lift=0.065, rise=0.009, arms=0.11, toe_off=22),
    _gait("walk_turn_left", 1.10, (0, 1.10, 40), feet=0.11, **_WALK),
    _gait("walk_turn_right", 1.10, (0, 1.10, -40), feet=0.11, **_WALK),
    _gait("walk_back", 1.14, (0, -0.85, 0), swing=0.38, lift=0.07, rise=0.008, arms=0.08, toe_off=16, twist=-4),
    _gait("walk_left", 0.98, (0.36, 0, 0), swing=0.38, lift=0.07, rise=0.008, arms=0.03, toe_off=8, twist=0, feet=0.18),
    _gait("walk_right", 0.98, (-0.36, 0, 0), swing=0.38, lift=0.07, rise=0.008, arms=0.03, toe_off=8, twist=0, feet=0.18),
    _gait("run", 0.72, (0, 2.05, 0), twist=9.0, sink=0.07, **_RUN),
    _gait("run_turn_left", 0.72, (0, 1.75, 38), twist=9.0, sink=0.09, feet=0.15, **_RUN),
    _gait("run_turn_right", 0.72, (0, 1.75, -38), twist=9.0, sink=0.09, feet=0.15, **_RUN),
)  # fmt: skip

_LEAP = {
    "pelvis": ((0.16, (0, -0.13, 0)), (0.36, (0, 0.07, 0)), (0.58, (0, -0.14, 0))),
    "chest_turn": ((0.17, (0, 12, 0)), (0.37, (0, 2, 0)), (0.58, (0, 13, 0))),
    "left_hand": ((0.18, (0.27, 0.90, -0.05)), (0.38, (0.42, 1.14, 0.16)), (0.60, (0.28, 0.92, 0.16))),
    "right_hand": ((0.18, (-0.27, 0.90, -0.05)), (0.38, (-0.42, 1.14, 0.16)), (0.60, (-0.28, 0.92, 0.16))),
    "heel": ((0.22, (26, 26)), (0.36, (32, 32)), (0.56, (6, 6))),
}  # fmt: skip

# The foot of that side makes room for the other one before it comes to stand.
_LEFTWARD = (
    Step("left", 0.06, 0.36, 0.06, to=(0.17, 0.11, 14.0)),
    Step("right", 0.40, 0.72, 0.06),
    Step("left", 0.76, 1.02, 0.05),
)
_RIGHTWARD = tuple(
    Step("right" if s.foot == "left" else "left", s.lift, s.land, s.height, to=to)
    for s, to in zip(_LEFTWARD, ((-0.17, 0.11, -14.0), None, None))
)

MOVES: tuple[Move, ...] = (
    Move(
        "stand", "idle", 2.2,
        {"pelvis": ((0.7, (0.02, -0.004, 0.0)), (1.6, (-0.015, -0.004, 0.0))),
         "chest_turn": ((0.8, (2, 0, 0)), (1.6, (-2, 0, 0))), "head_turn": ((0.7, (8, 1, 0)), (1.5, (-7, -1, 0)))},
    ),
    Move("turn_left", "transition", 1.12, {"head_turn": ((0.2, (18, 0, 0)),)}, _LEFTWARD, (0, 0, 45)),
    Move("turn_right", "transition", 1.12, {"head_turn": ((0.2, (-18, 0, 0)),)}, _RIGHTWARD, (0, 0, -45)),
    *_GAITS,
    *(_from_stand(g, f"{g.label}_start") for g in _GAITS if "turn" not in g.label),
    *(_to_stand(g, f"{g.label}_stop") for g in _GAITS if "turn" not in g.label),
    Move(
        "leap_left", "transition", 1.0, _LEAP,
        (Step("left", 0.20, 0.47, 0.14), Step("right", 0.23, 0.50, 0.15)), (0.75, 0.05, 0), avoid=(0.24, 0.80),
    ),
    Move(
        "leap_right", "transition", 1.0, _LEAP,
        (Step("right", 0.20, 0.47, 0.14), Step("left", 0.23, 0.50, 0.15)), (-0.75, 0.05, 0), avoid=(0.24, 0.80),
    ),
)  # fmt: skip


def _trip(gait: str, *cycles: str) -> tuple[str, ...]:
    return ("stand", f"{gait}_start", *cycles, f"{gait}_stop")


LOCOMOTION = Style(
    "locomotion",
    STAND,
    FEET,
    MOVES,
    {
        "walk": Take((*_trip("walk", *["walk"] * 6), *_trip("walk_slow", *["walk_slow"] * 5))),
        "walk_turning": Take(
            _trip("walk", "walk", "walk_turn_left", "walk_turn_left", "walk", "walk_turn_right",
                  "walk_turn_right", "walk_turn_right", "walk", "walk_turn_left", "walk")
        ),
        "walk_back": Take(_trip("walk_back", *["walk_back"] * 6)),
        "walk_sideways": Take(
            (*_trip("walk_left", *["walk_left"] * 5), *_trip("walk_right", *["walk_right"] * 5))
        ),
        "run": Take((*_trip("run", *["run"] * 9), *_trip("run", *["run"] * 5))),
        "run_turning": Take(
            _trip("run", "run", "run", "run_turn_left", "run_turn_left", "run", "run_turn_right",
                  "run_turn_right", "run", "run_turn_left", "run_turn_right", "run")
        ),
        "turns": Take(("stand", "turn_left", "turn_right"), 16),
        "leaps": Take(("stand", "leap_left", "leap_right", "leap_right", "leap_left"), 14),
    },
    vault=7,
    sway=0.25,
)  # fmt: skip
