"""Who may come into the studio and what they may do: forged requests, a hostile client."""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest
import viser
from websockets.exceptions import ConnectionClosed, InvalidStatus

from kumite.errors import KumiteError
from kumite.graph import Layer
from kumite.scene import World, load_scene
from kumite.studio import Interlude, Studio
from kumite.studio.gate import MOST_LINES, MOST_PAGES, Gate, Names, place_of
from tests import browser
from tests.stranger import (
    CAMERA,
    CLICK,
    DRAG,
    GIZMO,
    control,
    goodbye,
    join,
    plays_and_is_steered,
    request,
    running,
    say,
    setting,
    wait,
)

NAN, INF = float("nan"), float("inf")
ASK = "GET / HTTP/1.1\nHost: {host}\n{more}Connection: close\n\n"


@pytest.fixture(scope="module")
def studio() -> Iterator[Studio]:
    with running(Studio(Interlude(), port=0)) as found:
        yield found


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("127.0.0.1:{port}", b"200"),
        ("localhost:{port}", b"200"),
        ("LOCALHOST:{port}", b"200"),
        ("[::1]:{port}", b"200"),
        ("localhost:9000", b"200"),  # ssh -L 9000:localhost:8080
        ("evil.example", b"403"),
        ("evil.example:{port}", b"403"),
        ("127.0.0.1.evil.example:{port}", b"403"),
        ("localhost.evil.example:{port}", b"403"),
        ("localhost@evil.example:{port}", b"403"),
        ("0.0.0.0:{port}", b"403"),
        ("192.168.1.9:{port}", b"403"),
        ("127.0.0.1:{port}\nHost: evil.example", b"403"),
        ("", b"403"),
        ("127.0.0.1:99999", b"403"),
    ],
)
def test_it_answers_to_its_own_hosts_only(studio: Studio, host: str, status: bytes):
    answer = request(studio, ASK.replace("{host}", host).replace("{more}", ""))
    assert answer.split(b" ")[1] == status
    assert (b"frame-ancestors 'self'" in answer) and (b"same-origin" in answer)


@pytest.mark.parametrize(
    "origin",
    [
        "http://evil.example",
        "http://127.0.0.1",
        "http://127.0.0.1:1",
        "http://localhost:3000",
        "https://localhost:3000",
        "http://127.0.0.1:{port}.evil.example",
        "http://127.0.0.1:{port}@evil.example",
        "null",
        "file://",
        "http://127.0.0.1:{port}/",
        "",
    ],
)
def test_a_page_of_another_origin_comes_nowhere(studio: Studio, origin: str):
    origin = origin.replace("{port}", str(studio.server.get_port()))
    with pytest.raises(InvalidStatus) as refused:
        join(studio, origin)
    assert refused.value.response.status_code == 403
    ask = ASK.replace("{host}", "127.0.0.1:{port}").replace("{more}", f"Origin: {origin}\n")
    assert b" 403 " in request(studio, ask)[:20]


def test_neither_does_one_that_says_none_nor_a_part_of_another_page(studio: Studio):
    ask = ASK.replace("{host}", "127.0.0.1:{port}")
    upgrade = "Upgrade: WebSocket\nSec-WebSocket-Version: 13\n"
    assert b" 403 " in request(studio, ask.replace("{more}", upgrade))[:20]
    for site, mode, status in (
        ("cross-site", "no-cors", b"403"),
        ("same-site", "no-cors", b"403"),
        ("cross-site", "navigate", b"200"),  # a link to the studio
        ("none", "navigate", b"200"),
        ("same-origin", "no-cors", b"200"),
    ):
        more = f"Sec-Fetch-Site: {site}\nSec-Fetch-Mode: {mode}\n"
        assert request(studio, ask.replace("{more}", more)).split(b" ")[1] == status, (site, mode)
    plays_and_is_steered(studio)


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "[::1]"])
def test_its_own_page_may_be_asked_for_by_any_of_its_names(studio: Studio, host: str):
    with join(studio, f"http://{host}:{studio.server.get_port()}") as page:
        say(page, CAMERA)
        assert wait(lambda: len(studio.server.get_clients()) > 0)


def test_names_of_other_places():
    def has(names: Names, text: str) -> bool:
        place = place_of(text)
        assert place is not None
        return names.has(place)

    tunnel = Names("127.0.0.1", ["hub.example.org", "notebook:8888"])
    assert has(tunnel, "hub.example.org") and has(tunnel, "hub.example.org:80")
    assert has(tunnel, "notebook:8888") and not has(tunnel, "notebook:8080")
    everywhere = Names("0.0.0.0")
    assert has(everywhere, "192.168.1.9:8080") and has(everywhere, "localhost:8080")
    assert not has(everywhere, "evil.example:8080") and not has(everywhere, "0.0.0.0:8080")
    one = Names("192.0.2.7")
    assert has(one, "192.0.2.7:80") and not has(one, "192.0.2.8") and not has(one, "localhost")
    with pytest.raises(KumiteError, match="--allow-host"):
        Names("127.0.0.1", ["http://hub.example.org/"])
    for bad in ("a b", "x:y", "http://x", "[::1", "a@b", "x:99999", ""):
        assert place_of(bad) is None
    frames = Gate("127.0.0.1", ["hub.example.org"]).headers()["Content-Security-Policy"]
    assert frames == "frame-ancestors 'self' http://hub.example.org:* https://hub.example.org:*"


def hostile(studio: Studio) -> dict[str, object]:
    """Messages of which each is refused, by what is wrong with them."""
    speed = setting(studio, "Speed", 1.0)
    drags = {"NaN": [NAN, 0.0, 0.0], "short": [0.0], "words": ["a", "b", "c"], "none": None}
    return {
        "text": "hello",
        "nothing": b"",
        "noise": bytes(range(256)),
        "deep": b"\x91" * 5000,
        "list": [1, 2, 3],
        "no kind": {"a": 1},
        "kind": {"type": ["x"]},
        "unknown": {"type": "x" * 10_000},
        "share": {"type": "ShareUrlRequest"},
        "remove node": {"type": "RemoveSceneNodeMessage", "name": "/stage"},
        "remove control": {"type": "GuiRemoveMessage", "uuid": speed["uuid"]},
        "script": {"type": "RunJavascriptMessage", "source": "alert(1)"},
        "form": {"type": "GuiFormDirtyMessage", "uuid": "x"},
        "upload": {"type": "FileTransferPart", "transfer_uuid": "x", "content": b"x"},
        "slider NaN": setting(studio, "Speed", NAN),
        "slider inf": setting(studio, "Speed", INF),
        "slider word": setting(studio, "Speed", "fast"),
        "slider list": setting(studio, "Speed", [1.0]),
        "slider none": setting(studio, "Speed", None),
        "switch 2": setting(studio, "Follow", 2),
        "removed": speed | {"updates": {"removed": True}},
        "removed, too": speed | {"updates": {"value": 1.0, "removed": True}},
        "private": speed | {"updates": {"update_cb": []}},
        "no update": speed | {"updates": {}},
        "updates": speed | {"updates": 3},
        "more fields": speed | {"excluded_self_client": 1},
        "control": speed | {"uuid": 7},
        "command": {"type": "CommandTriggerMessage"},
        "eye NaN": CAMERA | {"position": [0.0, NAN, 0.0]},
        "eye inf": CAMERA | {"look_at": [INF, 0.0, 0.0]},
        "pixels": CAMERA | {"image_width": 1.5},
        "ray": CLICK | {"ray_direction": [0.0, 0.0, INF]},
        "ray none": CLICK | {"ray_origin": None},
        "area": CLICK | {"event_type": "rect-select"},
        "key": CLICK | {"modifier": "x" * 100},
        "owner": GIZMO | {"owner": "1"},
        "phase": DRAG | {"phase": "begin"},
        "instance": DRAG | {"instance_index": True},
        **{f"drag {name}": DRAG | {"end_position": x} for name, x in drags.items()},
        **{f"gizmo {name}": GIZMO | {"position": x} for name, x in drags.items()},
    }


def test_who_says_what_no_page_says_is_let_go(studio: Studio):
    for what, message in hostile(studio).items():
        with join(studio) as bad:
            say(bad, message)
            assert goodbye(bad) == 1008, what
    for label in ("Speed", "Time", "Follow"):  # nothing was removed
        assert not control(studio, label)._impl.removed
    plays_and_is_steered(studio)


def test_what_comes_too_late_is_passed_over(studio: Studio):
    """Values a moment out of date are no reason to be let go: the page is still heard after."""
    late = [
        setting(studio, "Speed", 50.0),
        setting(studio, "Speed", -1e300),
        setting(studio, "Time", 1e9),
        setting(studio, "Speed", 1.0) | {"uuid": "gone"},
        {"type": "CommandTriggerMessage", "uuid": "gone"},
        GIZMO | {"name": "/gone"},
        DRAG | {"name": "/gone"},
        CAMERA | {"position": [1e30, 0.0, 0.0]},
    ]
    follow = control(studio, "Follow")
    studio.set_speed(1.0)
    with join(studio) as page:
        say(page, CAMERA)
        follow.disabled = True
        say(page, setting(studio, "Follow", not follow.value))
        for message in late:
            say(page, message)
        say(page, setting(studio, "Decisions", True))
        assert wait(lambda: control(studio, "Decisions").value is True)
    assert follow.value is True and studio._pace.speed == 1.0
    follow.disabled = False
    plays_and_is_steered(studio)


def test_large_messages_and_floods_end_nothing_but_themselves(studio: Studio):
    with join(studio) as bad:
        say(bad, CAMERA | {"type": "x" * 1_000_000})
        assert goodbye(bad) == 1009
    with join(studio) as bad:
        with contextlib.suppress(ConnectionClosed):
            for _ in range(20_000):
                bad.ping()
        goodbye(bad)
    with join(studio) as bad:
        with contextlib.suppress(ConnectionClosed):
            for k in range(20_000):
                say(bad, setting(studio, "Time", 0.1 * (k % 10)))
        goodbye(bad)
    plays_and_is_steered(studio)


def test_pages_are_counted(studio: Studio):
    pages = [join(studio) for _ in range(MOST_PAGES)]
    with join(studio) as another:
        assert goodbye(another) == 1013
    for page in pages:
        page.close()
    plays_and_is_steered(studio)


def test_strangers_write_few_lines(caplog: pytest.LogCaptureFixture, capfd):
    stage = Interlude()
    with caplog.at_level(logging.WARNING), running(Studio(stage, port=0)) as studio:
        for k in range(MOST_LINES + 20):
            if k % 2:
                with pytest.raises(InvalidStatus):
                    join(studio, "http://evil.example/" + "x" * 2000)
            else:
                with join(studio) as bad:
                    say(bad, {"type": "\x1b[31m" + "x" * 10_000, "y": "z" * 5000})
        plays_and_is_steered(studio)
    assert len(caplog.messages) <= MOST_LINES + 1
    assert all(len(m) < 300 and m.isprintable() for m in caplog.messages)
    said = capfd.readouterr()
    assert len(said.out) + len(said.err) < 10_000 and "Traceback" not in said.err


def test_the_doors_take_nothing_that_is_not_finite(library: Layer):
    """Our own calls check, too: a script may reach them without any page."""
    stage = World(load_scene("target"), library, seed=0)
    studio = Studio(stage, port=0)
    home, control_of_stage = stage.objects[0].position.copy(), stage.tunables[0]
    try:
        for bad in (NAN, INF, -INF):
            for act in (
                lambda b=bad: studio.set_speed(b),
                lambda b=bad: control_of_stage.set(b),
                lambda b=bad: studio.move_object(stage.objects[0].name, np.array([0.0, b, 0.0])),
            ):
                with pytest.raises(KumiteError):
                    act()
        with pytest.raises(KumiteError):
            studio.move_object(stage.objects[0].name, np.array([1e6, 0.0, 0.0]))
        with pytest.raises(KumiteError):
            studio.restart(-1)
        with pytest.raises(KumiteError, match="expected 0 to 12"):
            control_of_stage.set(1e9)
        assert np.array_equal(stage.objects[0].position, home)
        with running(studio):
            with join(studio) as bad:
                say(bad, GIZMO | {"position": [NAN, 0.0, 0.0]})
            with join(studio) as good:
                say(good, CAMERA)
                say(good, GIZMO | {"position": [2.0, 1.4, 0.0]})
                assert wait(lambda: abs(stage.hanging._home[0][0] - 2.0) < 1e-6)
            plays_and_is_steered(studio)
    finally:
        studio.close()


HOSTILE_PAGE = """<!doctype html><title>hostile</title>
<iframe id=frame src="%(studio)s"></iframe><script>
window.found = {};
const studio = "%(studio)s", done = (name, what) => { window.found[name] = what; };
fetch(studio).then(r => r.text())
  .then(t => done("fetch", "read " + t.length), e => done("fetch", "refused"));
fetch(studio, {mode: "no-cors"}).then(r => done("blind", r.type), e => done("blind", "refused"));
fetch(studio, {method: "POST", body: "x", mode: "no-cors"})
  .then(r => done("post", r.type), e => done("post", "refused"));
const script = document.createElement("script");
script.src = studio; script.onload = () => done("script", "loaded");
script.onerror = () => done("script", "refused"); document.head.append(script);
const socket = new WebSocket(studio.replace("http", "ws"), ["viser-v%(version)s"]);
socket.onopen = () => done("socket", "open"); socket.onerror = () => done("socket", "refused");
const form = document.createElement("form");
form.method = "POST"; form.action = studio; form.target = "out";
const out = document.createElement("iframe"); out.name = "out";
out.onload = () => done("form", "sent");
document.body.append(out, form); form.submit();
document.getElementById("frame").onload = e => {
  let read = false;
  try { read = Boolean(e.target.contentDocument); } catch { }
  done("frame", read ? "read" : "refused");
};
</script>"""


CAME_OF_IT = dict.fromkeys(("fetch", "blind", "post", "script", "socket", "frame"), "refused")
CAME_OF_IT |= {"form": "sent"}  # a browser does not say what came of it


@pytest.fixture
def elsewhere() -> Iterator[tuple[str, dict[str, bytes]]]:
    """A web server on another port: its address, and the pages that it serves."""
    pages: dict[str, bytes] = {}

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(pages.get(self.path, b""))

        def log_message(self, *_: object) -> None:  # type: ignore[override]
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://localhost:{server.server_port}", pages
    server.shutdown()
    server.server_close()


@pytest.mark.slow
def test_a_hostile_page_in_the_same_browser_can_do_nothing(elsewhere):
    browser.need_chromium()
    address, pages = elsewhere
    stage = Interlude()
    with running(Studio(stage, port=0)) as studio:
        for host in ("127.0.0.1", "localhost"):
            own = studio.url.replace("127.0.0.1", host)
            page_of = {"studio": own, "version": viser.__version__}
            pages["/"] = (HOSTILE_PAGE % page_of).encode()
            with browser.open_page(address) as (page, _):
                page.wait_for_function("() => Object.keys(window.found).length === 7")
                page.wait_for_timeout(1000)  # for what a frame might still do
                assert page.evaluate("() => window.found") == CAME_OF_IT
                assert not studio.server.get_clients()
            with browser.seen(studio, own) as (page, _):
                studio.restart()
                if not studio.playing:
                    studio.toggle()
                page.get_by_role("button", name="Pause").click()
                browser.wait_until(page, lambda: not studio.playing, "the studio to pause")
                page.get_by_role("button", name="Play").click()
                browser.wait_until(page, lambda: studio.playing, "the studio to play")
