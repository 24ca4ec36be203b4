"""The page and its server: Starlette and uvicorn, and three.js, which NiceGUI brings.

Everything is served from this machine; the page loads nothing from elsewhere.
"""

import asyncio
import contextlib
import errno
import html
import json
import socket
import webbrowser
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.util import find_spec
from ipaddress import ip_address
from pathlib import Path
from typing import Any

from lrf3d.errors import InputError, OutputError, missing_extra
from lrf3d.gltf import still_glb
from lrf3d.interrupts import asked, check
from lrf3d.scene.moments import Scene
from lrf3d.view.shown import Shown, Wanted

FIRST_PORT, PORTS = 8080, 100
"""Ports that are tried if none is given."""

MESSAGE_SIZE = 10_000
"""Longest message [bytes] from a page, whose own have some hundred."""

_STEP = 1.0 / 30.0
"""Time between two steps of a drive [s]."""

_PAGE = Path(__file__).parent / "page"
_FILES = ("page.css", "page.js", "marks.js", "rig.js", "world.js")


@dataclass(frozen=True, eq=False)
class Site:
    """What is served: the setup and the world for all pages, and what makes one page's own part."""

    setup: dict[str, Any]
    glb: bytes
    make: Callable[[], Shown]
    plays: bool = field(default=False)

    @classmethod
    def of(cls, scene: Scene, setup: dict[str, Any], make: Callable[[], Shown]) -> "Site":
        """The site of a scene; one whose setup has an end is played, another is driven."""
        obstacles = scene.obstacles.bodies(scene.timeline.start)
        glb = still_glb(setup["title"], scene.stage, [("robot", scene.robot), *obstacles])
        return cls(setup, glb, make, bool(setup["end"]))


def serve(
    site: Site,
    *,
    host: str = "127.0.0.1",
    port: int | None,
    browser: bool = True,
    started: Callable[[str], None] = lambda address: None,
) -> None:
    """Show a site until the program is interrupted; `started` is called with its address.

    Raises:
        MissingLibraryError: NiceGUI is not installed.
        OutputError: The address was taken meanwhile.
    """
    try:
        import uvicorn

        three = find_spec("nicegui.elements.scene")
    except (ImportError, ValueError) as error:
        raise missing_extra(f"the view needs NiceGUI ({error})", "view") from None
    assert three is not None and three.origin is not None
    port = free_port(host, port)
    app = application(site, host, Path(three.origin).parent / "dist" / "index.js")
    server = uvicorn.Server(
        uvicorn.Config(
            app,
            host=host,
            port=port,
            log_level="critical",
            ws_max_size=MESSAGE_SIZE,
            # A short message could unpack to gigabytes.
            ws_per_message_deflate=False,
            proxy_headers=False,
            timeout_graceful_shutdown=1,
        )
    )

    async def run() -> None:
        serving = asyncio.create_task(server.serve())
        while not (server.started or serving.done() or asked()):
            await asyncio.sleep(0.01)
        if server.started:
            started(page_address(host, port))
            if browser:
                webbrowser.open(page_address(host, port))
        while not (asked() or serving.done()):
            await asyncio.sleep(0.05)
        server.should_exit = True
        await serving

    # Signals set the flag of lrf3d.interrupts, which is looked at here.
    server.capture_signals = contextlib.nullcontext  # type: ignore[method-assign, assignment]
    try:
        asyncio.run(run())
    except SystemExit:
        # The program was stopped as the server started, or the address was taken meanwhile.
        check()
        free_port(host, port)
        raise
    check()


def application(site: Site, host: str, three: Path) -> Any:
    """The application that answers a site's pages, and nobody else."""
    from starlette.applications import Starlette
    from starlette.middleware import Middleware
    from starlette.middleware.trustedhost import TrustedHostMiddleware
    from starlette.requests import Request
    from starlette.responses import FileResponse, HTMLResponse, Response
    from starlette.routing import Route, WebSocketRoute
    from starlette.websockets import WebSocket

    def page(request: Request) -> Response:
        setup = json.dumps(site.setup).replace("<", "\\u003c")
        text = (_PAGE / "index.html").read_text(encoding="utf-8")
        title = html.escape(site.setup["title"])
        return HTMLResponse(text.replace("{title}", title).replace("{setup}", setup))

    def world(request: Request) -> Response:
        return Response(site.glb, media_type="model/gltf-binary")

    def file(path: Path) -> Route:
        return Route(f"/lrf3d/{path.name}", lambda request: FileResponse(path))

    async def moments(socket: WebSocket) -> None:
        await socket.accept()
        await _show(site, socket)

    three_route = Route("/lrf3d/three.js", lambda request: FileResponse(three))
    routes = [Route("/", page), Route("/lrf3d/world.glb", world), three_route]
    routes += [file(_PAGE / name) for name in _FILES]
    middleware = [
        Middleware(TrustedHostMiddleware, allowed_hosts=own_names(host), www_redirect=False),
        Middleware(_OwnPages),
    ]
    return Starlette(
        routes=[*routes, WebSocketRoute("/lrf3d/moments", moments)], middleware=middleware
    )


class _OwnPages:
    """Refuses requests from foreign pages.

    A web page anywhere can have its visitor's browser send requests to this machine. It could read
    the scene and drive the robot. Under a name that it makes point here (DNS rebinding) it is
    refused by Starlette's own TrustedHostMiddleware.
    """

    def __init__(self, app: Any) -> None:
        self._app = app

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        from starlette.datastructures import Headers
        from starlette.responses import PlainTextResponse

        answer = self._app
        if scope["type"] in ("http", "websocket"):
            headers = Headers(scope=scope)
            own = f"http://{headers.get('host')}"
            if headers.get("origin", own) != own:
                answer = PlainTextResponse("pages of other sites may not use this one\n", 403)
        await answer(scope, receive, send)


async def _show(site: Site, socket: Any) -> None:
    """Answer what a page wants, until it leaves.

    A run is shown as the page asks; a drive goes on by itself.
    """
    from starlette.websockets import WebSocketDisconnect

    loop = asyncio.get_running_loop()
    # In threads, so that one page's work holds up no other.
    shown = await loop.run_in_executor(None, site.make)
    wanted, new = Wanted(), asyncio.Event()

    async def listen() -> None:
        nonlocal wanted, shown
        while True:
            text = await socket.receive_text()
            try:
                sent = json.loads(text)
            except ValueError:
                continue
            if isinstance(sent, dict) and sent.get("again") is True:
                shown = await loop.run_in_executor(None, site.make)
            wanted = wanted.changed(sent)
            new.set()

    async def answer() -> None:
        last = loop.time()
        while True:
            if site.plays:
                await new.wait()
                new.clear()
            else:
                await asyncio.sleep(max(0.0, last + _STEP - loop.time()))
            now = loop.time()
            message = await loop.run_in_executor(None, shown.answer, wanted, now - last)
            last = now
            if message is not None or site.plays:
                await socket.send_bytes(message or b"")

    tasks = [asyncio.create_task(each) for each in (listen(), answer())]
    done, left = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    for task in left:
        task.cancel()
    for task in done:
        error = task.exception()
        if error is not None and not isinstance(error, WebSocketDisconnect | RuntimeError):
            raise error


def own_names(host: str) -> list[str]:
    """The names that the page can be opened by where the server listens at a host."""
    names = ["localhost", "127.0.0.1", "[::1]"]
    if _is_loopback(host):
        return names
    import ifaddr

    addresses = [ip.ip for adapter in ifaddr.get_adapters() for ip in adapter.ips]
    own = [one if isinstance(one, str) else f"[{one[0]}]" for one in addresses]
    name = socket.gethostname().lower()
    short = name.partition(".")[0]
    return [*names, *own, host.lower(), name, short, f"{short}.local"]


def _is_loopback(host: str) -> bool:
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host.lower() == "localhost"


def page_address(host: str, port: int) -> str:
    """The address of the page, as one types it into a browser."""
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


def free_port(host: str, port: int | None) -> int:
    """The port that was asked for at a host, or the first free one from 8080.

    Raises:
        InputError: There is no such host, or it is another machine.
        OutputError: The port is taken.
    """
    try:
        # Listening at an empty name would let all machines in.
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM) if host else []
    except (OSError, ValueError):
        found = []
    if not found:
        raise InputError(f"--host {host}: no such address")
    family, *_, address = found[0]
    tried = range(FIRST_PORT, FIRST_PORT + PORTS) if port is None else [port]
    for number in tried:
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((address[0], number, *address[2:]))
            except OSError as error:
                if error.errno == errno.EADDRNOTAVAIL:
                    raise InputError(f"--host {host}: not an address of this machine") from None
                if port is not None:
                    raise OutputError(
                        f"--port {port}: {error.strerror} at {host}; choose another"
                    ) from None
                continue
        return number
    raise OutputError(f"no free port from {FIRST_PORT} on; choose one with --port")
