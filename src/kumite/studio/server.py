"""The web server behind the studio: where it listens, and what it never does.

viser listens on every interface by default, prints a banner, tries a thousand ports on any error
and offers a public tunnel. The studio listens where it is told and nowhere else, says one line,
refuses the tunnel, and lets in its own page only (:mod:`kumite.studio.gate`).
"""

from __future__ import annotations

import contextlib
import ipaddress
import logging
import socket
import warnings
from collections.abc import Iterator, Sequence

import rich
import viser

from kumite.errors import KumiteError
from kumite.studio.gate import Gate, guarding

PORTS_TRIED = 100
# A page may go between two messages to it; viser drops what comes after, and need not say so.
warnings.filterwarnings("ignore", message="Queued a .* on a closed connection")


class LocalServer(viser.ViserServer):
    """A viser server that cannot be put on the public internet from its own page."""

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Refused: any page that reaches the socket can ask for a tunnel, not only the user."""
        return None


@contextlib.contextmanager
def quiet_viser() -> Iterator[None]:
    """Without viser's banner and farewell, which go through rich's shared console."""
    console = rich.get_console()
    before = console.quiet
    console.quiet = True
    try:
        yield
    finally:
        console.quiet = before


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach ``host``."""
    try:
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except OSError:
        return False
    return all(ipaddress.ip_address(str(f[4][0]).split("%")[0]).is_loopback for f in found)


def _bind_error(host: str, port: int) -> OSError | None:
    """Why ``host:port`` cannot be listened on, or None."""
    try:
        family, kind, proto, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        with socket.socket(family, kind, proto) as probe:
            # As the server itself does: a port in TIME_WAIT is free.
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
            probe.listen(1)
    except OSError as error:
        return error
    return None


def free_port(host: str, port: int | None, *, strict: bool = False) -> int:
    """The first free port from ``port`` on, or 0 (any) for None and 0.

    Errors: a host that is not this machine's; with ``strict`` a port that is taken; none free.
    """
    if port is not None and not 0 <= port <= 65535:
        raise KumiteError(f"port {port}: expected 0 (any) to 65535")
    error = _bind_error(host, 0)
    if error is not None:
        raise KumiteError(f"host {host!r}: cannot listen there ({error.strerror or error})")
    if not port:
        return 0
    last = port if strict else min(port + PORTS_TRIED - 1, 65535)
    for candidate in range(port, last + 1):
        error = _bind_error(host, candidate)
        if error is None:
            return candidate
    raise KumiteError(
        f"port {port} on {host} is taken ({error.strerror if error else 'in use'}); "
        "choose another, or 0 for any free"
    )


def open_server(
    host: str,
    port: int | None,
    label: str,
    *,
    strict: bool = False,
    allowed: Sequence[str] = (),
) -> viser.ViserServer:
    """A running server; its real port is ``server.get_port()``.

    allowed: names besides ``host`` that it may be asked for as. Errors as :func:`free_port`, and
    names that are none.
    """
    gate = Gate(host, allowed)
    wanted = free_port(host, port, strict=strict)
    # A browser that closes its tab mid-handshake is no event worth a traceback.
    logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
    with quiet_viser(), guarding(gate, host, wanted):
        server = LocalServer(host=host, port=wanted, label=label, verbose=False)
    if not gate.installed:
        close_server(server)
        raise KumiteError(
            f"viser {viser.__version__} opens its server in an unknown way, so that it cannot be "
            "guarded; expected the version in requirements/run.txt"
        )
    gate.server = server
    if strict and wanted and server.get_port() != wanted:  # taken between the probe and the bind
        close_server(server)
        raise KumiteError(f"port {wanted} on {host} is taken; choose another, or 0 for any free")
    return server


def close_server(server: viser.ViserServer) -> None:
    """Stop listening and let the pages go."""
    with quiet_viser():
        server.stop()


def url_of(host: str, port: int) -> str:
    """What to type into a browser on this machine."""
    shown = {"0.0.0.0": "127.0.0.1", "::": "[::1]", "": "127.0.0.1"}.get(host, host)
    if ":" in shown and not shown.startswith("["):
        shown = f"[{shown}]"
    return f"http://{shown}:{port}"
