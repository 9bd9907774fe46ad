"""Events for tests: one of each kind, and short ways to make more."""

from __future__ import annotations

from typing import Any

from kumite.scene.events import Event, read_events

AT = {"speed": 6.5, "place": [0.1, 1.4, 0.2]}
BLOW = {"victim": "blue", "limb": "left_hand", "blow": 3}
FULL: dict[str, dict[str, Any]] = {
    "strike": {"limb": "left_hand", "blow": 3, "speed": 8.5},
    "hit": {**BLOW, **AT, "part": "head", "time": 0.5, "blocked": False},
    "reaction": {"action": "stagger back", "stretch": 7, "size": "stagger", "physical": True,
                 "impulse": 12.5, "deviation": 0.04},
    "run over": {"vehicle": "car", "speed": 14.0},
    "decision": {"by": "tree", "stretch": 7, "jump": True, "action": "jab", "considered": 40,
                 "comp": -1.5, "coop": 0.0, "nodes": 30, "pruned": 0.25},
    "throw": {"attack": 1, "ball": "ball 1", **AT},
    "foreseen": {**BLOW, "attack": 9, "gap": -0.02, "begins": 0.7},
    "avoidance": {"attack": 1, "ball": "ball 1", "outcome": "found", "aim": 0.4, "candidates": 5,
                  "valid": 2, "hit": 3, "path": [4, 5], "part": 1, "indexed": True, "scale": 1.1,
                  "cost": 0.6, "costs": [0.1, 0.2, 0.3], "distance": 0.2, "before": -0.1},
    "stale": {"attack": 9, "attacker": "red", "paths": 2},
    "avoided": {"attack": 9, "attacker": "red"},
    "missed": {"attack": 1, "ball": "ball 1"},
    "struck": {"attack": 1, "ball": "ball 1", **AT, "part": "chest", "meant": False},
    "counter": {**BLOW, "gap": 0.01, "seconds": 0.4},
    "launch": {"motion": "kick_ball", "level": 0.5, "apart_deg": 3.0, "to_contact": 0.4,
               "bent": 0.05},
    "done": {"motion": "kick_ball"},
    "passed": {"thing": "beam", "clearance": 0.03},
    "touched": {"thing": "beam", "part": "head"},
    "moved goal": {"thing": "beam"},
    "cue": {"style": {"preset": "boxer", "distance": 0.5}, "only": ["idle"], "depth": 2},
    "caught": {"victim": "blue", "distance": 0.7},
    "check point": {"point": 1, "late_by": 0.1, "distance": 0.3},
    "check point missed": {"point": 1, "due": None, "distance": 0.3},
}  # fmt: skip
"""What an event of each kind may say in a file."""
THINGS = ("ball 1", "car", "beam")
"""What these name."""
OPTIONAL = ("attack", "ball", "attacker")  # left out below, unless they are said


def one_of_each() -> tuple[Event, ...]:
    """An event of every kind, by red."""
    return read_events([[k, kind, "red", data] for k, (kind, data) in enumerate(FULL.items())])


def event(frame: int, kind: str, who: str, data: dict[str, Any] | None = None) -> Event:
    """An event that says this; what it must say besides is filled in."""
    said = {name: value for name, value in FULL[kind].items() if name not in OPTIONAL}
    if kind == "throw":
        said["ball"] = "ball 1"
    if kind == "avoidance":
        said = {}
    if kind == "decision":
        said = {"by": "policy", "stretch": 0, "jump": False}
    (made,) = read_events([[frame, kind, who, {**said, **(data or {})}]])
    return made
