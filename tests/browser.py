"""A headless browser on the studio: open it, know where things are in it, drag, look."""

from __future__ import annotations

import atexit
import contextlib
import io
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING
from unittest.mock import patch
from urllib.parse import urlparse

import numpy as np
import pytest
import viser
from PIL import Image

from kumite.studio import Studio
from kumite.studio import studio as studio_loop
from kumite.studio.viewer import Viewer
from tests.stranger import running

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

CHROMIUM = Path("/usr/bin/chromium")
SIZE = (900, 600)
ARGUMENTS = (
    "--no-sandbox",
    "--disable-gpu",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
)
# Without a graphics card a picture costs half a second of computing. What a test looks for is seen
# as well in ten pictures a second of half the resolution, without smooth edges and shadows.
PLAIN = """
const draw = window.requestAnimationFrame.bind(window), waiting = new Set();
let last = 0;
window.requestAnimationFrame = then => {
  const id = setTimeout(() => draw(t => {
    if (waiting.delete(id)) { last = t; then(t); }
  }), Math.max(0, last + 100 - performance.now()));
  waiting.add(id);
  return id;
};
window.cancelAnimationFrame = id => waiting.delete(id);
const open = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, options) {
  return open.call(this, kind, {...options, antialias: false});
};
"""
HALF = "?fixedDpr=0.5"
PICTURES = 10.0  # a second, that a studio sends
HARMLESS = (
    "GPU stall",
    "GL Driver Message",
    "Download the React DevTools",
    "[Performance]",
    "Unable to preventDefault inside passive event listener",  # the viewer's own, of a drag
)


@dataclass
class Traffic:
    """What a page asked for and complained about."""

    hosts: set[str] = field(default_factory=set)
    errors: list[str] = field(default_factory=list)
    websocket_bytes: int = 0
    websocket_frames: int = 0


def viewer_of(studio: Studio) -> Viewer:
    """What belongs to the first page of a studio; without a page to the server itself."""
    pages = [v for v in studio.viewers.values() if v.client is not None]
    found = pages or [*studio.viewers.values()]
    return found[0] if found else studio.look_in(studio.server)


def need_chromium() -> None:
    """Skip without a browser; in CI that is a failure."""
    if CHROMIUM.exists():
        return
    if os.environ.get("CI"):
        pytest.fail(f"{CHROMIUM} is missing: the studio cannot be tested")
    pytest.skip(f"{CHROMIUM} is missing")


@cache
def _chromium() -> Browser:
    """The browser that all tests of a process share; each has pages of its own."""
    from playwright.sync_api import sync_playwright

    playwright = sync_playwright().start()
    browser = playwright.chromium.launch(
        executable_path=str(CHROMIUM), headless=True, args=list(ARGUMENTS)
    )
    atexit.register(playwright.stop)
    atexit.register(browser.close)
    return browser


@contextlib.contextmanager
def open_page(
    url: str, size: tuple[int, int] = SIZE, *, plain: bool = True
) -> Iterator[tuple[Page, Traffic]]:
    """A headless page of ``size`` (width, height) px at ``url``, and what it asked for.

    plain: drawn as seldom and as simply as a test needs.
    """
    traffic = Traffic()

    def came(payload: str | bytes) -> None:
        traffic.websocket_frames += 1
        traffic.websocket_bytes += len(payload)

    page = _chromium().new_page(viewport={"width": size[0], "height": size[1]})
    if plain:
        page.add_init_script(PLAIN)
    page.on("request", lambda r: traffic.hosts.add(urlparse(r.url).hostname or ""))
    page.on("websocket", lambda w: traffic.hosts.add(urlparse(w.url).hostname or ""))
    page.on("websocket", lambda w: w.on("framereceived", came))
    page.on("pageerror", lambda e: traffic.errors.append(str(e)))
    page.on(
        "console",
        lambda m: (
            traffic.errors.append(m.text)
            if m.type == "error" and not any(h in m.text for h in HARMLESS)
            else None
        ),
    )
    page.goto(url)
    try:
        yield page, traffic
    finally:
        page.close()


@contextlib.contextmanager
def seen(studio: Studio, url: str = "") -> Iterator[tuple[Page, viser.ClientHandle]]:
    """A studio that runs, seen in a page at its own or another ``url``; the server's side of it.

    At the end nothing has gone wrong in the page, and it asked for nothing from elsewhere.
    """
    url = url or studio.url
    lamp = studio.server.scene._handle_from_node_name["/light/key"]
    assert isinstance(lamp, viser.DirectionalLightHandle)
    lamp.cast_shadow = False
    with (
        patch.object(studio_loop, "MOST_DRAWN", PICTURES),
        open_page(url + HALF) as (page, traffic),
    ):
        client = client_of(studio.server, page)
        page.wait_for_selector("canvas")
        let_draw(page)
        close_notes(page)
        yield page, client
        assert traffic.errors == []
        assert traffic.hosts <= {urlparse(url).hostname, ""}


@contextlib.contextmanager
def watching(studio: Studio) -> Iterator[tuple[Page, viser.ClientHandle]]:
    """The same of a studio that runs no longer than it is seen."""
    need_chromium()
    with running(studio), seen(studio) as (page, client):
        yield page, client


def let_draw(page: Page, pictures: int = 4) -> None:
    """Wait until the page has drawn as often."""
    page.evaluate(
        """count => new Promise(done => {
            const next = () => count-- > 0 ? requestAnimationFrame(next) : done();
            next();
        })""",
        pictures,
    )


def wait_until(page: Page, condition: Callable[[], bool], what: str, seconds: float = 30.0) -> None:
    """Let the page run until ``condition`` holds; fails after ``seconds`` naming ``what``."""
    end = time.perf_counter() + seconds
    while not condition():
        if time.perf_counter() > end:
            pytest.fail(f"waited {seconds:.0f} s for: {what}")
        page.wait_for_timeout(100)


def close_notes(page: Page) -> None:
    """Close what the viewer says of a browser without a graphics card: it hides the scene."""
    for button in page.locator(".mantine-Notification-closeButton").all():
        button.click()
    page.wait_for_function("() => !document.querySelector('.mantine-Notification-root')")


def picture(page: Page) -> np.ndarray:
    """The page as it is seen now [H, W, 3] uint8."""
    return np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB"))


def save_picture(
    url: str, path: Path, size: tuple[int, int] = (1280, 800), wait: float = 6
) -> None:
    """A picture of a running studio for the documentation, ``wait`` seconds after it appears."""
    with open_page(url, size, plain=False) as (page, _):
        page.wait_for_selector("canvas")
        page.wait_for_timeout(wait * 1000)
        close_notes(page)
        path.parent.mkdir(parents=True, exist_ok=True)
        page.screenshot(path=str(path))


def client_of(server: viser.ViserServer, page: Page) -> viser.ClientHandle:
    """The server's side of the only open page, once its camera is known."""
    wait_until(page, lambda: len(server.get_clients()) > 0, "the page to connect", 40)
    return next(iter(server.get_clients().values()))


def project(point: np.ndarray, camera: viser.CameraHandle, page: Page) -> tuple[float, float]:
    """Where a world point [3] is on the page (x, y) px.

    The camera's picture fills the canvas, which may not fill the page.
    """
    box = page.locator("canvas").first.bounding_box()
    if box is None:
        pytest.fail("the page has no canvas to be seen")
    forward = camera.look_at - camera.position
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, camera.up_direction)
    right = right / np.linalg.norm(right)
    up = np.cross(right, forward)
    ray = np.asarray(point, dtype=np.float64) - camera.position
    focal = 0.5 * box["height"] / np.tan(0.5 * camera.fov)
    depth = float(ray @ forward)
    return (
        box["x"] + 0.5 * box["width"] + focal * float(ray @ right) / depth,
        box["y"] + 0.5 * box["height"] - focal * float(ray @ up) / depth,
    )


def drag(page: Page, start: tuple[float, float], end: tuple[float, float], steps: int = 8) -> None:
    """Press at ``start``, move to ``end`` and let go; px on the page."""
    page.mouse.move(*start)
    let_draw(page)  # a gizmo takes the pointer only after a frame with it on the handle
    page.mouse.down()
    for i in range(1, steps + 1):
        t = i / steps
        page.mouse.move(start[0] + t * (end[0] - start[0]), start[1] + t * (end[1] - start[1]))
        page.wait_for_timeout(60)
    page.mouse.up()


def around(image: np.ndarray, centre: tuple[float, float], radius: int) -> np.ndarray:
    """The square of pixels [h, w, 3] within ``radius`` px of a place on the page."""
    x, y = round(centre[0]), round(centre[1])
    height, width = image.shape[:2]
    return image[
        max(y - radius, 0) : min(y + radius, height), max(x - radius, 0) : min(x + radius, width)
    ]
