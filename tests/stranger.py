"""Clients of the studio that are no browser: one that behaves, and raw requests of any kind."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import msgspec
import numpy as np
import pytest
import viser
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.sync.connection import Connection
from websockets.typing import Origin, Subprotocol

from kumite.studio import Studio
from kumite.studio.viewer import NOBODY

CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [0.0, 1.5, 5.0],
    "fov": 0.7,
    "near": 0.05,
    "far": 1000,
    "image_height": 600,
    "image_width": 900,
    "look_at": [0.0, 1.0, 0.0],
    "up_direction": [0.0, 1.0, 0.0],
}
CLICK = {
    "type": "ScenePointerMessage",
    "event_type": "click",
    "ray_origin": [0.0, 1.5, 5.0],
    "ray_direction": [0.0, -0.3, -1.0],
    "screen_pos": [[0.5, 0.5]],
    "modifier": None,
}
DRAG = {
    "type": "SceneNodeDragMessage",
    "phase": "update",
    "name": "/stage/path/0/discs",
    "instance_index": 0,
    "start_position": [0.0, 0.0, 0.0],
    "start_screen_pos": [0.5, 0.5],
    "end_position": [1.0, 0.0, 0.0],
    "end_screen_pos": [0.6, 0.5],
    "button": "left",
    "modifier": None,
    "owner": "",
}
GIZMO = {
    "type": "TransformControlsUpdateMessage",
    "name": "/stage/gizmo/0",
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [0.0, 1.0, 0.0],
    "owner": "",
}


@contextlib.contextmanager
def running(studio: Studio) -> Iterator[Studio]:
    thread = threading.Thread(target=studio.run, daemon=True)
    thread.start()
    try:
        yield studio
    finally:
        studio.stop()
        thread.join(10)
        studio.close()
        assert not thread.is_alive()


def wait(condition: Callable[[], Any], seconds: float = 20.0) -> bool:
    end = time.perf_counter() + seconds
    while not condition():
        if time.perf_counter() > end:
            return False
        time.sleep(0.02)
    return True


def join(studio: Studio, origin: str | None = None) -> Connection:
    """A connection as a page of ``origin`` (the studio's own by default) makes it."""
    address = studio.url.replace("http", "ws", 1)
    return connect(
        address,
        origin=Origin(studio.url if origin is None else origin),
        subprotocols=[Subprotocol(f"viser-v{viser.__version__}")],
        compression=None,
        max_size=None,
        max_queue=None,
        open_timeout=20,
        close_timeout=1,
    )


def say(client: Connection, message: Any) -> None:
    client.send(message if isinstance(message, bytes | str) else msgspec.msgpack.encode(message))


def goodbye(client: Connection) -> int | None:
    """Read on until the studio lets the client go; with which code."""
    with pytest.raises(ConnectionClosed) as end:
        while True:
            client.recv(timeout=20)
    return None if end.value.rcvd is None else end.value.rcvd.code


def control(studio: Studio, label: str) -> Any:
    """The control of that label, in a panel that all pages share."""
    if NOBODY not in studio.viewers:
        studio.look_in(studio.server)
    handles = studio.server.gui._gui_input_handle_from_uuid.values()
    return next(h for h in handles if getattr(h, "label", None) == label)


def setting(studio: Studio, label: str, value: Any) -> dict[str, Any]:
    """The message that sets a control."""
    uuid = control(studio, label)._impl.uuid
    return {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}}


def request(studio: Studio, text: str) -> bytes:
    """What the studio answers to a raw request; ``{port}`` in it is the studio's."""
    port = studio.server.get_port()
    with socket.create_connection(("127.0.0.1", port), timeout=20) as link:
        link.sendall(text.format(port=port).replace("\n", "\r\n").encode())
        found = b""
        with contextlib.suppress(ConnectionError):
            while part := link.recv(1 << 16):
                found += part
        return found


def plays_and_is_steered(studio: Studio) -> None:
    """A good page connects, and sets the speed; the stage moves. Fails if not."""
    speed = 1.0 if control(studio, "Speed").value != 1.0 else 1.5
    with join(studio) as good:
        say(good, CAMERA)
        say(good, setting(studio, "Speed", speed))
        assert wait(lambda: studio._pace.speed == speed), "a good page cannot steer"
        studio.restart()
        if not studio.playing:
            studio.toggle()
        before = studio.stage.frame
        assert wait(lambda: studio.stage.frame > before), "the stage stands still"
        assert np.all(np.isfinite(studio.stage.root_position))
