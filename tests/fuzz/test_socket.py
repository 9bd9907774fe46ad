"""The studio's socket under messages that are nearly right, and some that are not at all.

``KUMITE_FUZZ`` says how many; the seed is fixed.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from random import Random
from typing import Any

import msgspec
import numpy as np
import pytest
from viser import _messages

from kumite.studio import Interlude, Studio
from kumite.studio.panel import FASTEST, SLOWEST
from tests.stranger import CAMERA, CLICK, DRAG, GIZMO, join, plays_and_is_steered, running, say

COUNT = int(os.environ.get("KUMITE_FUZZ", "250"))
KINDS = sorted(m.__name__ for m in _messages.Message.get_subclasses())
WORDS = ("value", "removed", "visible", "disabled", "min", "max", "options", "update_cb", "_impl")


def junk(random: Random, depth: int = 2) -> Any:
    """A value that a field may be taken for."""
    plain: list[Any] = [None, True, False, 0, -1, 1, 2**53, 2**63 - 1, -(2**63), 0.5, 1e308, 1e-308]
    plain += [
        float("nan"),
        float("inf"),
        float("-inf"),
        "",
        "x",
        "\x1b[0m\n",
        "é" * 3000,
        b"\0" * 9,
    ]
    kind = random.randrange(8 if depth else 6)
    if kind < 5:
        return random.choice(plain)
    if kind == 5:
        return random.uniform(-10.0, 10.0)
    if kind == 6:
        return [junk(random, depth - 1) for _ in range(random.randrange(5))]
    return {random.choice(WORDS): junk(random, depth - 1) for _ in range(random.randrange(3))}


def nearly(random: Random, studio: Studio) -> Any:
    """A message that a page may send, with something in it changed."""
    handles = [*studio.server.gui._gui_input_handle_from_uuid.values()]
    handle = random.choice(handles)
    message: dict[str, Any] = dict(
        random.choice(
            [
                CAMERA,
                CLICK,
                DRAG,
                GIZMO,
                {"type": "CommandTriggerMessage", "uuid": "x"},
                *[
                    {
                        "type": "GuiUpdateMessage",
                        "uuid": handle._impl.uuid,
                        "updates": {"value": handle.value},
                    }
                ]
                * 4,
            ]
        )
    )
    for _ in range(random.choice((0, 1, 1, 1, 2))):
        field = random.choice([*message])
        how = random.randrange(6)
        if how == 0:
            message.pop(field)
        elif how == 1:
            message[random.choice(WORDS)] = junk(random)
        elif how == 2:
            message["type"] = random.choice(KINDS)
        elif isinstance(message.get("updates"), dict) and how < 5:
            message["updates"] = {random.choice(("value", "value", *WORDS)): junk(random)}
        elif isinstance(message[field], list) and message[field]:
            changed = [*message[field]]
            changed[random.randrange(len(changed))] = junk(random)
            message[field] = changed
        else:
            message[field] = junk(random)
        if not message:
            break
    raw = bytearray(msgspec.msgpack.encode(message))
    if random.random() < 0.15:
        for _ in range(random.randrange(1, 4)):
            raw[random.randrange(len(raw))] = random.randrange(256)
    return bytes(raw) if random.random() < 0.98 else "text"


@pytest.fixture
def studio() -> Iterator[Studio]:
    with running(Studio(Interlude(), port=0)) as found:
        yield found


def test_no_message_ends_or_spoils_the_studio(studio: Studio, capfd: pytest.CaptureFixture[str]):
    random = Random(15)
    studio.look_in(studio.server)
    controls = dict(studio.server.gui._gui_input_handle_from_uuid)
    nodes = set(studio.server.scene._handle_from_node_name)
    for _ in range(COUNT):
        with join(studio) as bad:  # leaving it waits until all that was said has been looked at
            say(bad, CAMERA)
            say(bad, nearly(random, studio))
    assert studio.server.gui._gui_input_handle_from_uuid == controls
    assert not any(handle._impl.removed for handle in controls.values())
    assert set(studio.server.scene._handle_from_node_name) == nodes
    assert SLOWEST <= studio._pace.speed <= FASTEST
    assert np.all(np.isfinite(studio.stage.root_position))
    plays_and_is_steered(studio)
    said = capfd.readouterr()
    assert "Traceback" not in said.out + said.err and len(said.out + said.err) < 20_000
