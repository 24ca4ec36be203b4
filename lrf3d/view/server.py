"""The page and its server: NiceGUI brings both, with three.js, and needs no other host.

Everything is served from this machine; the page loads nothing from elsewhere.
"""

import asyncio
import errno
import logging
import socket
from collections.abc import Callable
from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path
from typing import Any

from lrf3d.errors import InputError, OutputError, missing_extra
from lrf3d.interrupts import asked, check
from lrf3d.view.hand_drive import HandDrive, Wish
from lrf3d.view.page_data import PageScene

FIRST_PORT, PORTS = 8080, 100
"""Ports that are tried if none is given."""

MESSAGE_SIZE = 100_000
"""Longest message [bytes] from a page, whose own have some hundred."""

_STEP = 0.05
"""Time between two steps of a drive [s]."""

_SOON = 0.01
"""Time between two checks whether the server listens [s]."""

_FOLDER = Path(__file__).parent


@dataclass(frozen=True, slots=True)
class Replayed:
    """A run to play back: its arrays, their description, and simulated seconds per second."""

    block: bytes
    told: dict[str, Any]
    playback: float


def serve(
    scene: PageScene,
    show: Replayed | Callable[[], HandDrive],
    *,
    host: str = "127.0.0.1",
    port: int | None,
    browser: bool = True,
    started: Callable[[str], None] = lambda address: None,
) -> None:
    """Show a run or a drive in the browser until the program is interrupted.

    Args:
        scene: The scene.
        show: A run to play back, or what makes the drive of a new page.
        host: The address or name to listen at; others than 127.0.0.1 let other machines in.
        port: The port; the first free one if None.
        browser: Whether to open the browser.
        started: Called with the address of the page when it can be opened.

    Raises:
        MissingLibraryError: NiceGUI is not installed.
        OutputError: The address was taken meanwhile.
    """
    try:
        from nicegui import app, ui
        from nicegui.server import Server
    except ImportError as error:
        raise missing_extra(f"the view needs NiceGUI ({error})", "view") from None
    from fastapi import Response

    from lrf3d.view.element import RunView

    port = free_port(host, port)
    setup = {**scene.setup, "glb": "/lrf3d/scene.glb", "replay": None, "speed": 1.0}

    @app.get("/lrf3d/scene.glb")
    def _scene() -> Response:
        return Response(scene.glb, media_type="model/gltf-binary")

    if isinstance(show, Replayed):
        setup["replay"] = {**show.told, "file": "/lrf3d/run"}
        setup["speed"] = show.playback
        block = show.block

        @app.get("/lrf3d/run")
        def _run() -> Response:
            return Response(block, media_type="application/octet-stream")

    @ui.page("/", title=f"lrf3d {scene.setup['title']}")
    def _page() -> None:
        ui.add_css((_FOLDER / "page.css").read_text(encoding="utf-8"))
        view = RunView(setup)
        if not isinstance(show, Replayed):
            _attach(view, show)

    async def _announce() -> None:
        while not Server.instance.started:
            await asyncio.sleep(_SOON)
        started(page_address(host, port))

    async def _stop() -> None:
        while not asked():
            await asyncio.sleep(_STEP)
        app.shutdown()

    app.on_startup(_announce)
    app.on_startup(_stop)
    _answer_own_pages_only(host)
    try:
        ui.run(
            host=host,
            port=port,
            show=browser,
            reload=False,
            title="lrf3d",
            favicon="🤖",
            dark=True,
            show_welcome_message=False,
            uvicorn_logging_level="error",
            ws_max_size=MESSAGE_SIZE,
            # A short message could unpack to gigabytes.
            ws_per_message_deflate=False,
            proxy_headers=False,
        )
    except SystemExit:
        # The program was stopped as the server started, or the address was taken meanwhile.
        check()
        free_port(host, port)
        raise
    check()


def _answer_own_pages_only(host: str) -> None:
    """Refuse requests under foreign names and from foreign pages.

    A web page anywhere can have its visitor's browser send requests to this machine, under a name
    that it makes point here (DNS rebinding), or as itself. It could read the scene and drive the
    robot.
    """
    from fastapi import Request, Response
    from nicegui import app, core
    from starlette.middleware.trustedhost import TrustedHostMiddleware

    # Without a list, the websocket's library takes the page's own origin only.
    core.sio.eio.cors_allowed_origins = None
    # It would write to the terminal what strangers send.
    for library in ("engineio.server", "socketio.server"):
        logging.getLogger(library).setLevel(logging.CRITICAL)

    @app.middleware("http")
    async def _refuse_foreign_pages(request: Request, answer: Callable[..., Any]) -> Any:
        own = f"http://{request.headers['host']}"
        if request.headers.get("origin", own) != own:
            return Response("pages of other sites may not use this one\n", 403)
        return await answer(request)

    app.add_middleware(TrustedHostMiddleware, allowed_hosts=own_names(host), www_redirect=False)


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


def _attach(view: Any, make: Callable[[], HandDrive]) -> None:
    """Put a drive onto the page that is being made."""
    from nicegui import ui

    drive: HandDrive | None = None
    wish, again = Wish(), False

    def obey(event: Any) -> None:
        nonlocal wish
        wish = wish_of(event.args) or wish

    def restart() -> None:
        nonlocal again
        again = True

    view.on("drive", obey)
    view.on("again", restart)
    loop = asyncio.get_event_loop()
    last = loop.time()

    async def step() -> None:
        nonlocal drive, last, again
        # In threads, so that one page's work holds up no other. The timer waits for the page to be
        # connected: who only asks for it gets no drive.
        if drive is None:
            drive = await loop.run_in_executor(None, make)
        now = loop.time()
        seconds, last = now - last, now
        drive.wish = wish
        if again:
            again = False
            drive.restart()
        news = await loop.run_in_executor(None, drive.step, seconds)
        if news is not None:
            view.run_method("state", news)

    ui.timer(_STEP, step)


def wish_of(args: object) -> Wish | None:
    """The wish that a page sent, or None where it is malformed."""
    if not isinstance(args, dict):
        return None
    wishes = [
        float(value)
        for value in (args.get("forward"), args.get("turn"))
        if isinstance(value, (int, float)) and abs(value) <= 1.0
    ]
    return Wish(*wishes) if len(wishes) == 2 else None


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
