"""What the page's server lets in: requests for its own address, from its own page.

A web page anywhere can have its visitor's browser send requests to this machine, under a name that
it makes point here (DNS rebinding), or as itself. If ``Host`` and ``Origin`` were not checked, it
could read the scene and drive the robot. Malformed requests are dropped silently, so that nobody
outside can write to the terminal.
"""

import logging
import re
import socket
import traceback
from ipaddress import ip_address
from pathlib import Path
from typing import Any

from nicegui import Client, core
from starlette.datastructures import Headers
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Receive, Scope, Send

PAGES = 64
"""Pages that may be open at once: each keeps a drive with its map."""

BACKLOG = 40
"""Messages that may wait for one page, two seconds of a drive; slower pages miss the rest."""

MESSAGE_SIZE = 100_000
"""Longest message [bytes] from a page, whose own have some hundred."""

_LOGGERS = ("asyncio", "engineio.server", "nicegui", "socketio.server", "uvicorn.error")
_PACKAGE = Path(__file__).parents[1]


class Guard:
    """Passes requests of the server's own page on to an application, and refuses all others.

    ``Host`` must be a name of this server with its port: a loopback address, ``localhost``, and, if
    it listens to other machines, any IP address (an address, unlike a name, cannot be made to point
    elsewhere), the name that it listens at and the machine's own. ``Origin``, if given, must be the
    same host; a websocket must have one.

    Args:
        app: The application.
        host: The address or name that the server listens at.
        port: Its port.
    """

    def __init__(self, app: ASGIApp, *, host: str, port: int) -> None:
        self._app, self._port = app, port
        self._address = page_address(host, port)
        self._local = _is_loopback(host)
        self._names = {"localhost"} if self._local else {"localhost", host.lower(), *_own_names()}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request or a websocket's handshake, or pass it on."""
        if scope["type"] in ("http", "websocket") and (refusal := self._refusal(scope)):
            status, reason = refusal
            # Without no-store, browsers could keep a refusal for the page's own files.
            headers = {"cache-control": "no-store"}
            await PlainTextResponse(f"lrf3d: {reason}\n", status, headers)(scope, receive, send)
        else:
            await self._app(scope, receive, send)

    def _refusal(self, scope: Scope) -> tuple[int, str] | None:
        headers = Headers(scope=scope)
        hosts, origins = headers.getlist("host"), headers.getlist("origin")
        if len(hosts) != 1 or not self._is_own(hosts[0]):
            asked = ascii(", ".join(hosts)[:80])
            return 421, (
                f"this page is at {self._address}, not at {asked};"
                " to open it by another name, start it with --host NAME"
            )
        own = f"http://{hosts[0]}".lower()
        if any(origin.lower() != own for origin in origins):
            return 403, "pages of other sites may not use this one"
        if scope["type"] == "websocket":
            return None if origins else (403, "a websocket needs the Origin of its page")
        # Pictures, scripts and the like, which other sites may embed without an Origin.
        foreign = headers.get("sec-fetch-site", "none") not in ("none", "same-origin")
        if foreign and headers.get("sec-fetch-mode") != "navigate":
            return 403, "pages of other sites may not use this one"
        if scope["path"] == "/" and len(Client.instances) >= PAGES:
            return 503, f"{PAGES} pages are open; close one, and try again in a minute"
        return None

    def _is_own(self, host: str) -> bool:
        match = re.fullmatch(r"(?:\[([^][]+)\]|([^][:]+))(?::([0-9]{1,5}))?", host)
        if match is None or int(match[3] or 80) != self._port:
            return False
        name = match[1] or match[2]
        try:
            address = ip_address(name)
        except ValueError:
            return name.lower() in self._names
        return address.is_loopback or not self._local


def page_address(host: str, port: int) -> str:
    """The address of the page, as one types it into a browser."""
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


def _is_loopback(host: str) -> bool:
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host.lower() == "localhost"


def _own_names() -> set[str]:
    name = socket.gethostname().lower()
    short = name.partition(".")[0]
    return {name, short, f"{short}.local"}


def quiet() -> None:
    """Let the server's libraries report only what failed in lrf3d itself.

    They log what they cannot use, with tracebacks and as it came: whoever sends it could write
    escape sequences and lines of his own to the terminal.
    """
    for name in _LOGGERS:
        logging.getLogger(name).addFilter(_is_own_failure)


def _is_own_failure(record: logging.LogRecord) -> bool:
    error = record.exc_info[1] if record.exc_info else None
    if error is None:
        return False
    files = {Path(frame.f_code.co_filename) for frame, _ in traceback.walk_tb(error.__traceback__)}
    return any(_PACKAGE in file.parents for file in files - {Path(__file__)})


def refuse_attachments() -> None:
    """Drop binary messages: pages send none, and announced ones are kept until all have come."""
    engine = core.sio.eio
    take = engine.handlers["message"]

    async def checked(session: str, message: Any) -> None:
        if isinstance(message, str) and message[:1] not in "56":
            await take(session, message)

    engine.on("message", checked)


def backlog(client: Client) -> int:
    """The number of messages that wait for a page to take them."""
    sockets = core.sio.eio.sockets
    ids = [engine_id for _, engine_id in core.sio.manager.get_participants("/", client.id)]
    return max((sockets[each].queue.qsize() for each in ids if each in sockets), default=0)
