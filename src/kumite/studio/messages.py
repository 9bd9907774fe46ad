"""What a page may say to the studio, checked before viser acts on it.

viser believes its pages: any field of any control can be set to anything. Here every message is
looked at first. A page may report its camera, click, drag what can be dragged, press keys, and set
the *value* of a control that is there, is enabled and allows that value; nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, get_args

import msgspec
import viser
from viser import _messages

FAR = 1e4  # m: nothing in the page's world is farther away
LONGEST_NAME = 4000  # characters of a choice, a node's name or a control's id
MOST_PIXELS = 100_000
MOST_INSTANCES = 1_000_000


class Refused(Exception):
    """No page of ours says this. Its text is fit for one line of a log."""


class Stale(Exception):
    """A page may say this of a control or thing that has changed meanwhile: it is passed over."""


Check = Callable[[Any], None]


def number(low: float, high: float) -> Check:
    """A finite number; one outside of ``low`` to ``high`` is passed over."""

    def check(value: Any) -> None:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise Refused(f"{_kind(value)} for a number")
        if not math.isfinite(value):
            raise Refused("a number that is not finite")
        if not low <= value <= high:
            raise Stale

    return check


def whole(low: int, high: int) -> Check:
    """A whole number from ``low`` to ``high``."""
    bounded = number(low, high)

    def check(value: Any) -> None:
        if not isinstance(value, int):
            raise Refused(f"{_kind(value)} for a whole number")
        bounded(value)

    return check


def vector(count: int, each: Check) -> Check:
    """``count`` values, each of which passes a check."""

    def check(value: Any) -> None:
        if not isinstance(value, list) or len(value) != count:
            raise Refused(f"{_kind(value)} for {count} numbers")
        for x in value:
            each(x)

    return check


def either(*choices: Any) -> Check:
    """One of a few values."""

    def check(value: Any) -> None:
        if not any(type(value) is type(c) and value == c for c in choices):
            raise Refused(f"{_kind(value)} where only some values are possible")

    return check


def or_none(inner: Check) -> Check:
    def check(value: Any) -> None:
        if value is not None:
            inner(value)

    return check


def name(value: Any) -> None:
    """A short text."""
    if not isinstance(value, str) or len(value) > LONGEST_NAME:
        raise Refused(f"{_kind(value)} for a name")


def _kind(value: Any) -> str:
    found = type(value).__name__
    return f"{found} of length {len(value)}" if hasattr(value, "__len__") else found


COORDINATE = number(-FAR, FAR)
PLACE = vector(3, COORDINATE)
TURN = vector(4, number(-2.0, 2.0))
ON_SCREEN = vector(2, number(-1e3, 1e3))
MODIFIER = either(None, *get_args(_messages.KeyModifier))
OWNER = either("")  # all that is shown belongs to the server

SPOKEN: dict[str, dict[str, Check]] = {
    "ViewerCameraMessage": {
        "wxyz": TURN,
        "position": PLACE,
        "fov": number(1e-3, math.pi),
        "near": number(0.0, FAR),
        "far": number(0.0, 100 * FAR),
        "image_height": whole(0, MOST_PIXELS),
        "image_width": whole(0, MOST_PIXELS),
        "look_at": PLACE,
        "up_direction": PLACE,
    },
    "ScenePointerMessage": {
        "event_type": either("click"),
        "ray_origin": PLACE,
        "ray_direction": PLACE,
        "screen_pos": vector(1, ON_SCREEN),
        "modifier": MODIFIER,
    },
    "SceneNodeClickMessage": {
        "name": name,
        "instance_index": or_none(whole(0, MOST_INSTANCES)),
        "ray_origin": PLACE,
        "ray_direction": PLACE,
        "screen_pos": ON_SCREEN,
        "modifier": MODIFIER,
        "owner": OWNER,
    },
    "SceneNodeDragMessage": {
        "phase": either(*get_args(_messages._DragPhase)),
        "name": name,
        "instance_index": or_none(whole(0, MOST_INSTANCES)),
        "start_position": PLACE,
        "start_screen_pos": ON_SCREEN,
        "end_position": PLACE,
        "end_screen_pos": ON_SCREEN,
        "button": either(*get_args(_messages.DragButton)),
        "modifier": MODIFIER,
        "owner": OWNER,
    },
    "TransformControlsUpdateMessage": {
        "name": name,
        "wxyz": TURN,
        "position": PLACE,
        "owner": OWNER,
    },
    "TransformControlsDragStartMessage": {"name": name, "owner": OWNER},
    "TransformControlsDragEndMessage": {"name": name, "owner": OWNER},
    "CommandTriggerMessage": {"uuid": name},
    "GuiUpdateMessage": {"uuid": name, "updates": lambda value: None},  # see _check_control
}
"""Everything that a page may say, and what each field of it may be. All fields are needed."""


def check(raw: Any, server: viser.ViserServer) -> None:
    """Let a message pass that a page has sent. Errors: :class:`Refused`, :class:`Stale`."""
    if not isinstance(raw, bytes):
        raise Refused("text instead of a packed message")
    try:
        message = msgspec.msgpack.decode(raw)
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        raise Refused(f"no packed message ({type(error).__name__})") from None
    if not isinstance(message, dict):
        raise Refused(f"{_kind(message)} for a message")
    kind = message.pop("type", None)
    fields = SPOKEN.get(kind) if isinstance(kind, str) else None
    if fields is None:
        raise Refused(f"a kind of message that no page sends: {_short(kind)}")
    if message.keys() != fields.keys():
        raise Refused(f"{kind} with other fields than {', '.join(fields)}")
    for field, passes in fields.items():
        try:
            passes(message[field])
        except Refused as error:
            raise Refused(f"{kind}, {field}: {error}") from None
    if kind == "GuiUpdateMessage":
        _check_control(message, server)


def _short(value: Any) -> str:
    """At most 40 harmless characters of what a stranger sent."""
    text = value if isinstance(value, str) else _kind(value)
    return "".join(c if c.isascii() and c.isprintable() else "?" for c in text[:40])


def _of_choice(handle: Any) -> Check:
    def check(value: Any) -> None:
        name(value)
        if value not in handle.options:  # lists are written anew while they are looked at
            raise Stale

    return check


def _of_number(handle: Any) -> Check:
    # A page rounds to some decimals: the last value of a slider may come out just above its end.
    low = -math.inf if handle.min is None else handle.min - handle.step
    return number(low, math.inf if handle.max is None else handle.max + handle.step)


VALUES: dict[type, Callable[[Any], Check]] = {
    viser.GuiSliderHandle: _of_number,
    viser.GuiNumberHandle: _of_number,
    viser.GuiCheckboxHandle: lambda handle: either(True, False),
    viser.GuiButtonHandle: lambda handle: either(True),
    viser.GuiButtonGroupHandle: _of_choice,
    viser.GuiDropdownHandle: _of_choice,
}
"""What the value of each kind of control may be. Others cannot be set by a page."""


def _check_control(message: Mapping[str, Any], server: viser.ViserServer) -> None:
    updates = message["updates"]
    if not isinstance(updates, dict) or updates.keys() != {"value"}:
        raise Refused("something of a control besides its value")
    # Not a public name: viser finds the control by it, so the check must, too.
    pages = [server.gui, *(client.gui for client in server.get_clients().values())]
    found = (gui._gui_input_handle_from_uuid.get(message["uuid"]) for gui in pages)
    handle = next((h for h in found if h is not None), None)
    if handle is None or handle.disabled or not handle.visible:
        raise Stale
    value_of = VALUES.get(type(handle))
    if value_of is None:
        raise Refused("the value of what is no control")
    try:
        value_of(handle)(updates["value"])
    except Refused as error:
        raise Refused(f"a control's value: {error}") from None
