"""Who may come into the studio, and how much they may say.

Any page in the user's browser can reach a port of this machine. What tells it from the studio's own
page is what browsers do not let it forge: the Host that it was loaded by and the Origin that it
speaks for. So a request must name a host that the studio is served as, and a page must speak for
the origin that it asks. A name that is made to point to this machine (DNS rebinding) is another
Host, another site is another Origin. The port may be another one, as behind ``ssh -L``: a browser
names the port that it really asks. Other names (a proxy's, a tunnel's) are given by the user.

viser has no place for such checks, so :func:`guarding` puts them where it calls ``websockets``.
"""

from __future__ import annotations

import asyncio
import contextlib
import http
import ipaddress
import logging
import re
import socket
import threading
import time
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, NoReturn

import viser
import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from kumite.errors import KumiteError
from kumite.studio.messages import Refused, Stale, check

MOST_PAGES = 24  # at once
MOST_CONNECTIONS = 96  # with those that only load the page
LARGEST_MESSAGE = 16 * 1024  # bytes
RATE, BURST = 120.0, 240.0  # messages a second, and at once; what comes faster waits its turn
LONGEST_WAIT = 2.0  # s of waiting without a pause; who has still more to say then is let go
FRAME_RATE, FRAMES = 300.0, 1000.0  # as above, of all frames; who sends more is let go
MOST_STALE = 1000  # messages for nothing a page, a slow one in a busy studio
MOST_LINES = 20  # of a log, about all strangers together
CLOSE_TIMEOUT = 1.0  # s that who is let go has to say goodbye
READY_PERIOD = 0.02  # s between looks at a studio that is being built

log = logging.getLogger("kumite.studio")
_AUTHORITY = re.compile(r"(\[[0-9a-f:.%]+\]|[a-z0-9_.-]+)(?::([0-9]{1,5}))?")
_ORIGIN = re.compile(r"(https?)://(.+)")
_PORTS = {"http": 80, "https": 443}


class Place(NamedTuple):
    """A host as a browser names it, and a port where it is told."""

    name: str
    port: int | None


def place_of(text: str) -> Place | None:
    """``name``, ``name:port``, ``1.2.3.4:port`` or ``[::1]:port``; None of anything else."""
    found = _AUTHORITY.fullmatch(text.lower())
    if found is None:
        return None
    port = None if found[2] is None else int(found[2])
    return None if port is not None and port > 65535 else Place(found[1].strip("[]"), port)


def _address(name: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        return ipaddress.ip_address(name.split("%")[0])
    except ValueError:
        return None


class Names:
    """The names that a studio is served as. allowed: further ones, ``NAME`` or ``NAME:PORT``.

    Errors: an allowed name that is none.
    """

    def __init__(self, host: str, allowed: Sequence[str] = ()) -> None:
        self.allowed = [self._parse(text) for text in allowed]
        bare = host.lower().strip("[]")
        self._own = {bare, *_addresses(host)}
        address = _address(bare)
        self._anywhere = bare == "" or (address is not None and address.is_unspecified)
        own = [_address(name) for name in self._own]
        self._here = self._anywhere or any(a is not None and a.is_loopback for a in own)
        if self._here:
            self._own.add("localhost")
        if self._anywhere:
            # A page can be made to be asked for by a foreign name, but not by a foreign number.
            here = socket.gethostname().lower()
            self._own |= {here, f"{here}.local"}

    @staticmethod
    def _parse(text: str) -> Place:
        place = place_of(text)
        if place is None:
            raise KumiteError(
                f"--allow-host {text!r}: expected a host's name, as in the browser's address line "
                "(studio.example.org or 10.0.0.5:8080)"
            )
        return place

    def has(self, place: Place) -> bool:
        """Whether the studio is served as that."""
        address = _address(place.name)
        if address is None:
            own = place.name in self._own
        elif address.is_unspecified:  # 0.0.0.0 in a page is a way round browsers' own checks
            own = False
        else:
            own = self._anywhere or (self._here and address.is_loopback) or place.name in self._own
        return own or self.invited(place)

    def invited(self, place: Place) -> bool:
        """Whether the user has allowed it by name."""
        return any(a.name == place.name and a.port in (None, place.port) for a in self.allowed)


def _addresses(host: str) -> set[str]:
    with contextlib.suppress(OSError):
        return {str(f[4][0]).lower() for f in socket.getaddrinfo(host, None) if host}
    return set()


class Gate:
    """Decides over requests and messages of one studio, and says in few lines whom it refused."""

    def __init__(self, host: str, allowed: Sequence[str] = ()) -> None:
        self.names = Names(host, allowed)
        self.server: viser.ViserServer | None = None  # from when its controls can be told
        self.installed = False
        self._lines = 0
        self._connections = 0

    def say(self, line: str) -> None:
        """Log a line about a stranger, if there have not been too many."""
        self._lines += 1
        if self._lines <= MOST_LINES:
            log.warning("studio: %s", line[:200])
        if self._lines == MOST_LINES:
            log.warning("studio: more of this kind is not told")

    # Requests ------------------------------------------------------------------------------------

    def refusal(self, request: Request, port: int) -> str | None:
        """Why a request is not answered, or None. port: that the studio listens on."""
        hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
        host = place_of(hosts[0]) if len(hosts) == 1 else None
        if host is None or not self.names.has(host):
            return f"asked for as another host ({_shown(hosts)})"
        if len(origins) > 1 or (origins and not self._is_own(origins[0], host, port)):
            return f"a page of another origin ({_shown(origins)})"
        if "websocket" in request.headers.get("Upgrade", "").lower():
            return None if origins else "a connection without an origin"
        asked_by, mode = (request.headers.get(f"Sec-Fetch-{x}", "") for x in ("Site", "Mode"))
        if asked_by in ("cross-site", "same-site") and mode != "navigate" and not origins:
            return "a part of a page of another origin"
        return None

    def _is_own(self, origin: str, host: Place, port: int) -> bool:
        """Whether a page of an origin may speak to the studio that it asks for as ``host``."""
        found = _ORIGIN.fullmatch(origin.lower())
        place = None if found is None else place_of(found[2])
        if found is None or place is None:
            return False
        default = _PORTS[found[1]]
        place = Place(place.name, place.port or default)
        same = place.name == host.name and place.port == (host.port or default)
        return same or self.names.invited(place) or (place.port == port and self.names.has(place))

    def headers(self) -> dict[str, str]:
        """What browsers are told of every answer: no other site may frame or embed it."""
        ancestors = [
            f"http{s}://{f'[{n}]' if ':' in n else n}:{'*' if p is None else p}"
            for n, p in self.names.allowed
            for s in ("", "s")
        ]
        return {
            "Content-Security-Policy": " ".join(["frame-ancestors 'self'", *ancestors]),
            "Cross-Origin-Resource-Policy": "same-origin",
            "X-Content-Type-Options": "nosniff",
            "Referrer-Policy": "no-referrer",
        }

    def enter(self) -> bool:
        """Count a connection in; False if there are too many."""
        self._connections += 1
        return self._connections <= MOST_CONNECTIONS

    def leave(self) -> None:
        self._connections -= 1


def _shown(values: Sequence[str]) -> str:
    text = ", ".join(values)[:60]
    return "".join(c if c.isascii() and c.isprintable() else "?" for c in text) or "none"


class GuardedConnection(ServerConnection):
    """A connection whose requests and messages pass a gate."""

    gate: Gate

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._left, self._at, self._stale = BURST, time.monotonic(), 0
        self._waited = 0.0
        self._frames, self._framed_at = FRAMES, self._at
        inside = self.gate.enter()
        super().connection_made(transport)
        if not inside:
            self.gate.say("too many connections at once")
            self.transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        self.gate.leave()
        super().connection_lost(exc)

    def process_event(self, event: Any) -> None:
        # Pings and empty frames cost time as well, and are no messages.
        now = time.monotonic()
        self._frames = min(FRAMES, self._frames + (now - self._framed_at) * FRAME_RATE) - 1.0
        self._framed_at = now
        if self._frames >= 0.0:
            super().process_event(event)
        elif not self.transport.is_closing():
            self.transport.abort()
            self.gate.say("let a page go: it talks too fast")

    async def recv(self, decode: bool | None = None) -> Any:
        """The next message that a page may send; who sends another is let go."""
        while True:
            if await self._waits_too_long():
                await self._let_go("it talks too fast")
            raw = await super().recv(decode)
            while self.gate.server is None:
                await asyncio.sleep(READY_PERIOD)
            try:
                check(raw, self.gate.server)
                return raw
            except Stale:
                self._stale += 1
                if self._stale <= MOST_STALE:
                    continue
                reason = "too many messages for what is not there"
            except Refused as error:
                reason = str(error)
            await self._let_go(reason)

    async def _let_go(self, reason: str) -> NoReturn:
        """Close, and read no more: of what else it sent nothing is looked at."""
        self.gate.say(f"let a page go: {reason}")
        await self.close(1008, "refused")
        raise self.protocol.close_exc

    async def _waits_too_long(self) -> bool:
        """Wait for the turn of the next message; True if there was no pause for long."""
        now = time.monotonic()
        self._left = min(BURST, self._left + (now - self._at) * RATE) - 1.0
        self._at = now
        if self._left >= 0.0:
            self._waited = 0.0
            return False
        pause = -self._left / RATE
        self._waited += pause
        await asyncio.sleep(pause)
        return self._waited > LONGEST_WAIT


@contextlib.contextmanager
def guarding(gate: Gate, host: str, port: int) -> Iterator[None]:
    """Within it, a server that viser opens at ``host:port`` gets a gate, if ``gate.installed``."""
    asyncio_server: Any = websockets.asyncio.server
    with _patching:
        plain = asyncio_server.serve

        def serve(handler: Any, *where: Any, **options: Any) -> Any:
            if where[0] != host or not getattr(handler, "__module__", "").startswith("viser"):
                return plain(handler, *where, **options)
            gate.installed = True
            return plain(_counted(handler, gate), *where, **_guarded(gate, options))

        asyncio_server.serve = serve
        try:
            yield
        finally:
            asyncio_server.serve = plain


_patching = threading.Lock()


def _guarded(gate: Gate, options: dict[str, Any]) -> dict[str, Any]:
    """viser's options of its server, with the gate before its own checks."""
    answer = options["process_request"]
    kind = type("Guarded", (GuardedConnection,), {"gate": gate})

    def process_request(connection: ServerConnection, request: Request) -> Any:
        reason = gate.refusal(request, connection.local_address[1])
        if reason is None:
            return answer(connection, request)
        gate.say(f"refused {reason}; --allow-host NAME lets a name in")
        text = (
            f"Refused: {reason}.\n"
            "Behind a tunnel or a proxy, name it: kumite studio --allow-host NAME\n"
        )
        return connection.respond(http.HTTPStatus.FORBIDDEN, text)

    def process_response(_: Any, request: Request, response: Response) -> None:
        for name, value in gate.headers().items():
            response.headers[name] = value

    asyncio.get_running_loop().set_exception_handler(
        lambda _, context: gate.say(f"{context.get('exception') or context.get('message')!r}")
    )
    return options | {
        "process_request": process_request,
        "process_response": process_response,
        "create_connection": kind,
        "max_size": LARGEST_MESSAGE,
        "close_timeout": CLOSE_TIMEOUT,
    }


def _counted(handler: Any, gate: Gate) -> Any:
    """viser's handler of a page, for not too many of them, and all of this version of viser."""
    expected, pages = f"viser-v{viser.__version__}", 0

    async def handle(connection: ServerConnection) -> None:
        nonlocal pages
        if connection.subprotocol != expected:
            gate.say("let a page go: of another version of viser; load it anew")
            await connection.close(1002, f"Version mismatch. Server: {viser.__version__}")
        elif pages >= MOST_PAGES:
            gate.say(f"more than {MOST_PAGES} pages at once")
            await connection.close(1013, "too many pages")
        else:
            pages += 1
            try:
                await handler(connection)
            finally:
                pages -= 1

    return handle
