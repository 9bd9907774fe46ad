"""What events and settings of a recording say: by kind and by name, which values are of which type.

Whoever reads a recording (metrics, the studio, exports) finds these where they stand, or nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from kumite.checks import array, instance, mapping, names, number, shown, text, whole
from kumite.errors import KumiteError

Check = Callable[[Any, str], object]


def _flag(value: Any, what: str) -> bool:
    return instance(value, bool, what)


def _place(value: Any, what: str) -> np.ndarray:
    return array(value, what, (3,))


def _numbers(value: Any, what: str) -> np.ndarray:
    return array(value, what, ("N",))


def _names(value: Any, what: str) -> tuple[str, ...]:
    return names(value, what, unlike=False)


def _or_none(check: Check) -> Check:
    return lambda value, what: None if value is None else check(value, what)


def _by_name(check: Check) -> Check:
    def each(value: Any, what: str) -> None:
        for name, part in mapping(value, what).items():
            check(part, f"{what} of {name!r}")

    return each


def _above_zero(value: Any, what: str) -> float:
    return number(value, what, above=0.0)


def _size(value: Any, what: str) -> np.ndarray:
    return array(value, what, (3,), least=0.0)


BLOW: dict[str, Check] = {
    "victim": text, "object": text, "target": text, "on": text, "opponent": text,
    "limb": text, "part": text, "struck": text, "speed": number, "place": _place, "time": number,
    "blocked": _flag, "blow": whole, "attack": whole,
}  # fmt: skip
BALL: dict[str, Check] = {
    "attack": whole, "ball": text, "part": text, "speed": number, "place": _place, "meant": _flag,
    "dropped": whole,
}  # fmt: skip
MOTION: dict[str, Check] = {
    "motion": text, "thing": text, "part": text, "level": number, "apart_deg": number,
    "to_contact": number, "bent": _or_none(number), "clearance": number,
}  # fmt: skip
SEARCH: dict[str, Check] = {
    "attack": whole, "outcome": text, "aim": number, "candidates": whole, "indexed": _flag,
    "scale": number, "cost": number, "costs": _numbers, "distance": number, "before": number,
    "part": whole, "path": _numbers,
    **dict.fromkeys(("valid", "hit", "culled", "stiff", "too_fast", "too_long"), whole),
}  # fmt: skip
SAID: dict[str, dict[str, Check]] = {
    "strike": BLOW,
    "hit": BLOW,
    "decision": {
        "stretch": whole,
        "state": whole,
        "worth": number,
        "action": text,
        "nodes": whole,
        "considered": whole,
        "pruned": number,
        "comp": number,
        "coop": number,
    },
    "reaction": {
        "deviation": _or_none(number),
        "impulse": number,
        "physical": _flag,
        "size": text,
        "action": text,
    },
    "run over": {"by": text, "speed": number},
    "foreseen": {
        "attack": whole,
        "limb": text,
        "blow": whole,
        "at": text,
        "gap": number,
        "begins": number,
    },
    "counter": {"victim": text, "limb": text, "blow": whole, "gap": number, "seconds": number},
    "throw": BALL,
    "struck": BALL,
    "avoided": BALL,
    "stale": BALL,
    "avoidance": SEARCH,
    # Of balls the attack, of check points the point, when it was due and by how much it was missed.
    "missed": {"attack": whole, "point": whole, "due": _or_none(number), "by": number},
    "launch": MOTION,
    "done": MOTION,
    "passed": MOTION,
    "touched": MOTION,
    "moved goal": MOTION,
    "caught": {"victim": text, "distance": number},
    "check point": {"point": whole, "late_by": number, "distance": number},
}
"""What an event of a kind may say, and what must stand there. Other names hold any plain value."""
NEEDED = {
    "strike": ("limb",),
    "hit": ("victim", "limb", "part", "speed", "place", "time"),
    "throw": ("attack", "ball"),
    "struck": ("attack", "part", "speed", "place"),
    "avoided": ("attack",),
    "avoidance": ("attack", "outcome"),
    "foreseen": ("attack", "at", "gap"),
    "launch": ("motion", "level", "apart_deg"),
    "passed": ("thing", "clearance"),
    "touched": ("thing", "part"),
    "check point": ("point", "late_by", "distance"),
}
"""What an event of a kind in a file must say."""
THINGS = ("ball", "thing")
"""Names under which an event names one of the objects."""


def _scene(value: Any, what: str) -> None:
    bout = mapping(value, what).get("bout")
    if bout is not None:
        mapping(bout, f"{what}: bout")


SETTINGS: dict[str, Check] = {
    "seed": whole,
    "library": text,
    "source_skate_m_s": _or_none(number),
    "object_radius": _by_name(_above_zero),
    "object_size": _by_name(_size),
    "object_yaw": _by_name(number),
    "object_line": _names,
    "object_thrown": _names,
    "object_wheels": _names,
    "aims_at": _by_name(_or_none(text)),
    "unarmed": _names,
    "scene": _scene,
}
"""What a recording may say of how it was made."""


def check_event(kind: Any, data: Any) -> None:
    """Errors: a kind that is no text; data that are not as its kind says them."""
    text(kind, "event")
    instance(data, Mapping, f"event {kind!r}: data")
    said = SAID.get(kind, {})
    for name, value in data.items():
        if name in said:
            said[name](value, f"event {kind!r}: {name}")
        elif not isinstance(name, str):
            text(name, f"event {kind!r}: a key")
    if "nodes" in data and "pruned" not in data and kind == "decision":
        raise KumiteError(f"event {kind!r}: pruned is missing")


def check_whole(kind: str, data: Mapping[str, Any], objects: tuple[str, ...]) -> None:
    """Errors: data that lack what readers of a file look for; an object that is none."""
    for name in NEEDED.get(kind, ()):
        if name not in data:
            raise KumiteError(f"event {kind!r}: {name} is missing")
    for name in THINGS:
        if name in data and name in SAID.get(kind, {}) and data[name] not in objects:
            raise KumiteError(f"event {kind!r}: {shown(data[name])} is none of the objects")


def check_settings(settings: Any) -> None:
    """Errors: settings that are not of their types."""
    for name, value in mapping(settings, "recording: settings").items():
        if name in SETTINGS:
            SETTINGS[name](value, f"recording: {name}")
