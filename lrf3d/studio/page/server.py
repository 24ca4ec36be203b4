"""The server of the page, for a run that is played or a world to drive in.

Everything is served from this machine, by the library of the page's socket; the page loads nothing
from elsewhere.
"""

import asyncio
import contextlib
import errno
import gzip
import html
import io
import ipaddress
import json
import logging
import os
import re
import socket
import webbrowser
from collections.abc import Callable, Coroutine
from functools import partial
from pathlib import Path
from typing import Any
from weakref import WeakSet

from PIL import Image

from lrf3d.base.errors import InputError, OutputError, missing_extra
from lrf3d.base.interrupts import asked, check
from lrf3d.simulation.run import Run
from lrf3d.simulation.scenario import Scenario
from lrf3d.simulation.sensor import caster_of
from lrf3d.studio.page.hand_drive import HandDrive
from lrf3d.studio.page.message import stage_message
from lrf3d.studio.page.session import PageSession, Wanted

# The port that is tried if none is given.
PORT = 8080

# Length of the longest message from a page [bytes], whose own have some hundred.
MESSAGE_SIZE = 10_000

# Least time between two answers to a page that drives [s].
_STEP = 1 / 30

# Number of pages whose messages are answered at a time: each thread keeps memory of its own.
_PAGES_AT_WORK = 4

# Time that a page may take to load a file [s].
_PATIENCE = 60.0

# Time between two checks whether the program is to end [s].
_WAIT = 0.05

# Time that pages have to close their sockets in the end [s].
_LAST_WORDS = 0.5

# Path of what stands in the world, which is packed.
_WORLD = "/lrf3d/world"

# Headers of all answers: no other site may frame the page or load its files.
GUARDS = {
    "Content-Security-Policy": "frame-ancestors 'none'; base-uri 'none'; object-src 'none'",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}

# The files of the page.
PAGE = Path(__file__).parent / "static"

# Path of the socket of a scene.
MOMENTS = "/lrf3d/moments"

# Files that pages load, by path: the content type, and the bytes.
Files = dict[str, tuple[str, bytes]]

# A function that serves one page over its socket.
Talk = Callable[[Any], Coroutine[Any, Any, None]]

# The functions that serve pages, by the path of their socket.
Talks = dict[str, Talk]

# Makes what one page shows: each has its own.
Make = Callable[[], PageSession]


def run_view(run: Run, playback: float | None) -> Make:
    """What pages show of a run that is played."""
    return lambda: PageSession.played(run, run.playback if playback is None else playback)


def world_view(scenario: Scenario, seed: int) -> Make:
    """What pages show of a world to drive in, with a route or poses to start at."""
    # One for all pages; one for each would stay in memory until the garbage collector finds it.
    caster = caster_of("embree", scenario.world)
    drive = HandDrive(scenario, rng=seed, caster=caster)
    # The first step compiles kernels and builds search trees, so it is made before the user drives.
    drive.step(0.0)
    stage = PageSession.driven(drive).scene.stage
    return lambda: PageSession.driven(HandDrive(scenario, rng=seed, caster=caster), stage)


def serve(
    make: Make,
    door: socket.socket,
    *,
    host: str,
    browser: bool = True,
    started: Callable[[str], None] = lambda address: None,
) -> None:
    """Serve pages until the program is interrupted; `started` is called with their address.

    The door is a socket of :func:`bound` for the host; it is closed in the end.

    Raises:
        MissingLibraryError: The libraries of the extra ``view`` are not installed.
    """
    talks = {MOMENTS: moments_talk(make)}
    serve_pages(
        lambda: page_files(make()), talks, door, host=host, browser=browser, started=started
    )


def serve_pages(
    files: Callable[[], Files],
    talks: Talks,
    door: socket.socket,
    *,
    host: str,
    largest: int = MESSAGE_SIZE,
    browser: bool = True,
    started: Callable[[str], None] = lambda address: None,
) -> None:
    """Serve files by their paths, and sockets with messages [bytes], as `serve` does."""
    try:
        from websockets.asyncio.server import ServerConnection
        from websockets.asyncio.server import serve as listen
    except ImportError as error:
        raise missing_extra(f"the view needs a server ({error})", "view") from None
    port = door.getsockname()[1]
    address = f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"
    transports: WeakSet[Any] = WeakSet()

    class Page(ServerConnection):
        def connection_made(self, transport: Any) -> None:
            transports.add(transport)
            super().connection_made(transport)

    async def run() -> None:
        server = await listen(
            lambda page: talks[_path(page.request)](page),
            sock=door,
            create_connection=Page,
            process_request=partial(_guarded, files(), talks, host),
            max_size=largest,
            # A short message could unpack to gigabytes.
            compression=None,
            open_timeout=_PATIENCE,
            close_timeout=_PATIENCE,
            # Pages may close in the middle of a message.
            logger=logging.Logger("view", logging.CRITICAL),
        )
        started(address)
        if browser:
            webbrowser.open(address)
        # Signals set the flag of lrf3d.base.interrupts, which is looked at here.
        while not asked():
            await asyncio.sleep(_WAIT)
        server.close()
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(server.wait_closed(), _LAST_WORDS)
        # Pages that have stopped reading, as on a laptop that sleeps, would not let the end come.
        for transport in [*transports]:
            transport.abort()

    with door:
        asyncio.run(run())
    check()


def page_files(session: PageSession) -> Files:
    """What the page loads, by its path."""
    stage = session.scene.stage
    # Row 0 of the ground's picture is at the smallest y, as textures have it.
    ground = io.BytesIO()
    Image.fromarray(stage.ground.picture).save(ground, "JPEG", quality=90)
    files = {
        "/": ("text/html; charset=utf-8", page_text(session.setup()).encode()),
        _WORLD: ("application/octet-stream", gzip.compress(stage_message(stage), 1)),
        "/lrf3d/ground.jpg": ("image/jpeg", ground.getvalue()),
    }
    for name in ("page.css", "page.js", "scene.js", "served.js"):
        kind = "text/css" if name.endswith("css") else "text/javascript"
        files[f"/lrf3d/{name}"] = kind, (PAGE / name).read_bytes()
    return files


def _guarded(files: Files, talks: Talks, host: str, connection: Any, request: Any) -> Any:
    """Answer a request for the page, its files or a socket; None opens the socket."""
    response = _refusal(host, connection, request)
    if response is None and _path(request) not in talks:
        response = _file(files, connection, request)
    if response is not None:
        for name, value in GUARDS.items():
            response.headers[name] = value
    return response


def _refusal(host: str, connection: Any, request: Any) -> Any:
    """Refuse requests of other sites, and those that are not for reading.

    A web page anywhere can have its visitor's browser send requests to this machine. It could read
    the scene and drive the robot, and so is refused: by its origin, or, where a name of its own
    points here (DNS rebinding), by that name.
    """
    named, origin = (request.headers.get_all(name) for name in ("Host", "Origin"))
    if len(named) != 1 or not is_own(re.sub(r":\d+$", "", named[0]), host):
        return connection.respond(400, "the page does not open by this name\n")
    if origin not in ([], [f"http://{named[0]}"]):
        return connection.respond(403, "pages of other sites may not use this one\n")
    if _method(request) not in ("GET", "HEAD"):
        refusal = connection.respond(405, "the page is only read\n")
        refusal.headers["Allow"] = "GET, HEAD"
        return refusal
    return None


def _method(request: Any) -> str:
    # Older versions of the library refuse other methods themselves.
    return str(getattr(request, "method", "GET"))


def _path(request: Any) -> str:
    return str(request.path.partition("?")[0])


def _file(files: Files, connection: Any, request: Any) -> Any:
    from websockets.datastructures import Headers
    from websockets.http11 import Response

    path = _path(request)
    if path not in files:
        return connection.respond(404, "there is no such page\n")
    kind, body = files[path]
    headers = Headers({"Content-Type": kind, "Content-Length": str(len(body))})
    if path == _WORLD:
        headers["Content-Encoding"] = "gzip"
    return Response(200, "OK", headers, b"" if _method(request) == "HEAD" else body)


def page_text(setup: dict[str, Any]) -> str:
    """The page's HTML, with what it is given once."""
    words = {name: html.escape(str(value)) for name, value in setup.items()}
    words["setup"] = json.dumps(setup).replace("<", "\\u003c")
    return re.sub(
        r"\{(\w+)\}",
        lambda found: words[found[1]],
        (PAGE / "index.html").read_text(encoding="utf-8"),
    )


def moments_talk(make: Make) -> Talk:
    """The function that serves the pages of a run or a world, some of them at a time."""
    return partial(_show, make, asyncio.Semaphore(_PAGES_AT_WORK))


async def _show(make: Make, turns: asyncio.Semaphore, page: Any) -> None:
    """Answer each message of a page, until it leaves; an empty answer says that nothing changed."""
    from websockets.exceptions import ConnectionClosed
    from websockets.protocol import State

    time = asyncio.get_running_loop().time
    shown: PageSession | None = None
    wanted = Wanted()
    last = time()
    with contextlib.suppress(ConnectionClosed):
        while True:
            before = wanted
            wanted = wanted.changed(await page.recv())
            # In threads, so that no page has to wait for another. A page that left while it
            # waited for its turn needs no answer.
            async with turns:
                if page.state is not State.OPEN:
                    return
                if shown is None or wanted.drive != before.drive:
                    shown = await asyncio.to_thread(make)
                seconds = time() - last
                last = time()
                answer = await asyncio.to_thread(shown.answer, wanted, seconds)
            await page.send(answer or b"")
            if shown.drive is not None:
                await asyncio.sleep(last + _STEP - time())


def is_own(name: str, host: str) -> bool:
    """Whether the page opens by a name where the server listens at a host."""
    with contextlib.suppress(ValueError):
        # Only names can be made to point here from elsewhere.
        return bool(ipaddress.ip_address(name.strip("[]")))
    own = ["localhost", host.lower()]
    if host.lower() not in ("localhost", "127.0.0.1", "::1"):
        machine = socket.gethostname().lower()
        short = machine.partition(".")[0]
        own += [machine, short, f"{short}.local"]
    return name.lower() in own


def bound(host: str, port: int | None) -> socket.socket:
    """A socket at a host and a port; if none is given, at 8080 or, where that is taken, any.

    A browser that connects before the page is ready waits.

    Raises:
        InputError: There is no such host, or it is another machine.
        OutputError: The port is taken.
    """
    try:
        # Listening at an empty name would let all machines in.
        family, *_, address = socket.getaddrinfo(host or "\0", None, type=socket.SOCK_STREAM)[0]
    except (OSError, ValueError):
        raise InputError(f"--host {host}: no such address") from None
    for number in [PORT, 0] if port is None else [port]:
        try:
            return socket.create_server((address[0], number, *address[2:]), family=family)
        except OSError as error:
            if error.errno == errno.EADDRNOTAVAIL:
                raise InputError(f"--host {host}: not an address of this machine") from None
            reason = os.strerror(error.errno or 0)
    raise OutputError(f"--port {number}: {reason} at {host}; choose another")
