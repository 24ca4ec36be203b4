"""The page and its server: NiceGUI brings both, with three.js, and needs no other host.

Everything is served from this machine; the page loads nothing from elsewhere.
"""

import asyncio
import errno
import socket
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.errors import InputError, MissingLibraryError, OutputError
from lrf3d.interrupts import asked, check
from lrf3d.view.hand_drive import HandDrive, Wish
from lrf3d.view.page_data import PageScene

FIRST_PORT, PORTS = 8080, 100
"""Ports that are tried if none is given."""

_STEP = 0.05
"""Time between two steps of a drive [s]."""

_SOON = 0.01
"""Time between two looks at whether the server listens [s]."""

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
        host: The address or name to listen at; others than 127.0.0.1 let other machines in. Which
            names the page may then be opened by, :class:`~lrf3d.view.guard.Guard` says.
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
        raise MissingLibraryError(
            f"the view needs NiceGUI ({error}); install it: pip install 'lrf3d[view]'"
        ) from None
    from fastapi import Request, Response

    from lrf3d.view import guard
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
        if isinstance(show, Replayed):
            RunView(setup)
        else:
            _attach(show(), setup)

    @app.exception_handler(404)
    def _not_found(request: Request, error: Exception) -> Response:
        # NiceGUI's own would log the path as it came, and make a page for each.
        return Response("lrf3d: there is no such page\n", 404, media_type="text/plain")

    def _start() -> None:
        # Only now is the stack complete; what is refused must not get as far as its headers.
        assert app.middleware_stack is not None
        app.middleware_stack = guard.Guard(app.middleware_stack, host=host, port=port)

    async def _announce() -> None:
        while not Server.instance.started:
            await asyncio.sleep(_SOON)
        started(guard.page_address(host, port))

    async def _stop() -> None:
        while not asked():
            await asyncio.sleep(_STEP)
        app.shutdown()

    app.on_startup(_start)
    app.on_startup(_announce)
    app.on_startup(_stop)
    guard.quiet()
    guard.refuse_attachments()
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
            ws_max_size=guard.MESSAGE_SIZE,
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


def _attach(drive: HandDrive, setup: dict[str, Any]) -> None:
    """Put a drive onto the page that is being made."""
    from nicegui import ui

    from lrf3d.view import guard
    from lrf3d.view.element import RunView

    x, y = (np.array(drive.pose[:2]) - setup["origin"]).tolist()
    start = {"x": x, "y": y, "theta": drive.pose.theta}
    view = RunView({**setup, "start": start})

    again = False

    def obey(event: Any) -> None:
        drive.wish = wish_of(event.args) or drive.wish

    def restart() -> None:
        nonlocal again
        again = True

    view.on("drive", obey)
    view.on("again", restart)
    loop = asyncio.get_event_loop()
    last = loop.time()

    async def step() -> None:
        nonlocal last, again
        now = loop.time()
        seconds, last = now - last, now
        if guard.backlog(view.client) > guard.BACKLOG:
            return
        if again:
            # Between two steps: a thread may be within one when the page asks for it.
            again = False
            drive.restart()
        # In a thread, so that working out a large map holds up no other page.
        news = await loop.run_in_executor(None, drive.step, seconds)
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
