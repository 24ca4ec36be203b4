"""The page and its server, Starlette and uvicorn, and what a page is opened for.

Everything is served from this machine; the page loads nothing from elsewhere.
"""

import asyncio
import contextlib
import errno
import gzip
import html
import io
import json
import socket
import webbrowser
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from PIL import Image

from lrf3d.errors import InputError, OutputError, missing_extra
from lrf3d.interrupts import asked, check
from lrf3d.io import load_run
from lrf3d.pose import Pose, as_pose
from lrf3d.scenario import Scenario, start_of
from lrf3d.scene.moments import Scene
from lrf3d.scene.stage import Stage
from lrf3d.scene.timeline import Timeline
from lrf3d.view.hand_drive import HandDrive
from lrf3d.view.message import stage_message
from lrf3d.view.shown import VIEWS, Driven, Played, Shown, Wanted, setup_of

FIRST_PORT, PORTS = 8080, 100
"""Ports that are tried if none is given."""

MESSAGE_SIZE = 10_000
"""Longest message [bytes] from a page, whose own have some hundred."""

_STEP = 1.0 / 30.0
"""Time between two steps of a drive [s]."""

_PAGE = Path(__file__).parent / "page"


@dataclass(frozen=True, eq=False)
class Site:
    """What is served: the setup and the world for all pages, and what makes one page's own part."""

    setup: dict[str, Any]
    stage: Stage
    make: Callable[[], Shown]

    @property
    def plays(self) -> bool:
        """Whether a run is played, which has an end; another is driven."""
        return bool(self.setup["end"])


def run_view(path: str, playback: float | None) -> Site:
    """The site of a run that is played."""
    run = load_run(path)
    speed = run.film.playback if playback is None else playback
    timeline = Timeline(run, playback=speed)
    scene = Scene(timeline)
    setup = setup_of(scene, VIEWS, end=timeline.end - timeline.start)
    return Site(setup, scene.stage, lambda: Played(run, scene.stage, speed))


def world_view(scenario: Scenario, seed: int) -> Site:
    """The site of a world to drive in, with a route or poses to start at."""
    start = start_pose(scenario)
    drive = HandDrive(scenario, start, rng=seed)
    # The first step compiles kernels and builds search trees, so it is made before the user drives.
    drive.step(0.0)
    stage = drive.scene.stage
    views = tuple(view for view in VIEWS if view != "story")
    setup = setup_of(drive.scene, views, end=0.0)
    setup["title"] = scenario.world.name or scenario.name
    return Site(setup, stage, lambda: Driven(HandDrive(scenario, start, rng=seed, stage=stage)))


def start_pose(scenario: Scenario) -> Pose:
    """Where a scenario's robot starts."""
    if scenario.start is not None:
        return scenario.start
    if scenario.route is not None:
        return start_of(scenario.route)
    assert scenario.poses is not None
    return as_pose(scenario.poses[0])


def serve(
    site: Site,
    door: socket.socket,
    *,
    host: str,
    browser: bool = True,
    started: Callable[[str], None] = lambda address: None,
) -> None:
    """Show a site until the program is interrupted; `started` is called with its address.

    The door is a socket of :func:`bound` for the host; it is closed in the end.

    Raises:
        MissingLibraryError: The libraries of the extra ``view`` are not installed.
    """
    try:
        import uvicorn

        app = application(site, host)
    except ImportError as error:
        raise missing_extra(f"the view needs a server ({error})", "view") from None
    port = door.getsockname()[1]
    address = f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"
    server = uvicorn.Server(
        uvicorn.Config(
            app,
            log_level="critical",
            ws_max_size=MESSAGE_SIZE,
            # A short message could unpack to gigabytes.
            ws_per_message_deflate=False,
            proxy_headers=False,
            timeout_graceful_shutdown=1,
        )
    )

    async def run() -> None:
        serving = asyncio.create_task(server.serve([door]))
        while not (server.started or serving.done() or asked()):
            await asyncio.sleep(0.01)
        if server.started:
            started(address)
            if browser:
                webbrowser.open(address)
        while not (asked() or serving.done()):
            await asyncio.sleep(0.05)
        server.should_exit = True
        await serving

    # Signals set the flag of lrf3d.interrupts, which is looked at here.
    server.capture_signals = contextlib.nullcontext  # type: ignore[method-assign, assignment]
    with door:
        asyncio.run(run())
    check()


def application(site: Site, host: str) -> Any:
    """The application that answers a site's pages, and nobody else."""
    from starlette.applications import Starlette
    from starlette.middleware import Middleware
    from starlette.middleware.trustedhost import TrustedHostMiddleware
    from starlette.responses import FileResponse, HTMLResponse, Response
    from starlette.routing import Route, WebSocketRoute

    words = {
        "{title}": html.escape(site.setup["title"]),
        "{mode}": "plays" if site.plays else "drives",
        "{setup}": json.dumps(site.setup).replace("<", "\\u003c"),
    }
    page = (_PAGE / "index.html").read_text(encoding="utf-8")
    for name, text in words.items():
        page = page.replace(name, text)
    # Row 0 of the ground's picture is at the smallest y, as textures have it.
    ground = io.BytesIO()
    Image.fromarray(site.stage.ground.picture).save(ground, "JPEG", quality=90)
    world = gzip.compress(stage_message(site.stage), 1)
    answers = {
        "/": HTMLResponse(page),
        "/lrf3d/world": Response(world, headers={"Content-Encoding": "gzip"}),
        "/lrf3d/ground.jpg": Response(ground.getvalue(), media_type="image/jpeg"),
        **{
            f"/lrf3d/{name}": FileResponse(_PAGE / name)
            for name in ("page.css", "page.js", "scene.js")
        },
    }
    names = own_names(host)
    return Starlette(
        routes=[
            *(
                Route(path, lambda request, answer=answer: answer)
                for path, answer in answers.items()
            ),
            WebSocketRoute("/lrf3d/moments", lambda socket: _show(site, socket)),
        ],
        middleware=[
            Middleware(TrustedHostMiddleware, allowed_hosts=names, www_redirect=False),
            Middleware(_OwnPages),
        ],
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

    await socket.accept()
    loop = asyncio.get_running_loop()
    # In threads, so that one page's work holds up no other.
    shown = await loop.run_in_executor(None, site.make)
    wanted, new = Wanted(), asyncio.Event()

    async def listen() -> None:
        nonlocal wanted, shown
        while True:
            text = await socket.receive_text()
            if text == "again":
                shown = await loop.run_in_executor(None, site.make)
            wanted = wanted.changed(text)
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

    # Either ends by an error where the page has left.
    tasks = [asyncio.create_task(each) for each in (listen(), answer())]
    try:
        await asyncio.gather(*tasks)
    except (WebSocketDisconnect, RuntimeError):
        pass
    finally:
        for task in tasks:
            task.cancel()


def own_names(host: str) -> list[str]:
    """The names that the page can be opened by where the server listens at a host."""
    names = ["localhost", "127.0.0.1", "[::1]"]
    if host.lower() in (*names, "::1"):
        return names
    import ifaddr

    addresses = [ip.ip for adapter in ifaddr.get_adapters() for ip in adapter.ips]
    own = [one if isinstance(one, str) else f"[{one[0]}]" for one in addresses]
    name = socket.gethostname().lower()
    short = name.partition(".")[0]
    return [*names, *own, host.lower(), name, short, f"{short}.local"]


def bound(host: str, port: int | None) -> socket.socket:
    """A socket at a host and a port, or the first free one from 8080 on.

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
    for number in range(FIRST_PORT, FIRST_PORT + PORTS) if port is None else [port]:
        door = socket.socket(family, socket.SOCK_STREAM)
        door.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            door.bind((address[0], number, *address[2:]))
            # From now on nobody else has it; who comes before the page is ready waits.
            door.listen()
        except OSError as error:
            door.close()
            if error.errno == errno.EADDRNOTAVAIL:
                raise InputError(f"--host {host}: not an address of this machine") from None
            reason = error.strerror
        else:
            return door
    if port is None:
        raise OutputError(f"no free port from {FIRST_PORT} on; choose one with --port")
    raise OutputError(f"--port {port}: {reason} at {host}; choose another")
