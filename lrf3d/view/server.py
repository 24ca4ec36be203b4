"""The page and its server, and what a page is opened for.

Everything is served from this machine, by the library of the page's socket; the page loads nothing
from elsewhere.
"""

import asyncio
import contextlib
import errno
import gzip
import html
import io
import json
import logging
import re
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

_PATIENCE = 60.0
"""How long a page may take to load a file [s]."""

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
        from websockets.asyncio.server import serve as listen

        answer = _answers(site, own_names(host))
    except ImportError as error:
        raise missing_extra(f"the view needs a server ({error})", "view") from None
    port = door.getsockname()[1]
    address = f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"

    async def run() -> None:
        server = await listen(
            lambda page: _show(site, page),
            sock=door,
            process_request=answer,
            max_size=MESSAGE_SIZE,
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
        # Signals set the flag of lrf3d.interrupts, which is looked at here.
        while not asked():
            await asyncio.sleep(0.05)
        server.close()
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(server.wait_closed(), 1.0)

    with door:
        asyncio.run(run())
    check()


def _answers(site: Site, names: list[str]) -> Callable[[Any, Any], Any]:
    """A function that answers requests for a site's page, its files and its socket.

    A web page anywhere can have its visitor's browser send requests to this machine. It could read
    the scene and drive the robot, and so is refused: by its origin, or, where a name of its own
    points here (DNS rebinding), by that name.
    """
    from websockets.datastructures import Headers
    from websockets.http11 import Response

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
    files = {
        "/": ("text/html; charset=utf-8", page.encode()),
        "/lrf3d/world": ("application/octet-stream", gzip.compress(stage_message(site.stage), 1)),
        "/lrf3d/ground.jpg": ("image/jpeg", ground.getvalue()),
    }
    for name in ("page.css", "page.js", "scene.js"):
        kind = "text/css" if name.endswith("css") else "text/javascript"
        files[f"/lrf3d/{name}"] = kind, (_PAGE / name).read_bytes()

    def answer(connection: Any, request: Any) -> Any:
        host, origin = (request.headers.get_all(name) for name in ("Host", "Origin"))
        if len(host) != 1 or re.sub(r":\d+$", "", host[0]).lower() not in names:
            return connection.respond(400, "the page does not open by this name\n")
        if origin not in ([], [f"http://{host[0]}"]):
            return connection.respond(403, "pages of other sites may not use this one\n")
        path = request.path.partition("?")[0]
        if path == "/lrf3d/moments":
            return None
        if path not in files:
            return connection.respond(404, "there is no such page\n")
        kind, body = files[path]
        headers = Headers({"Content-Type": kind, "Content-Length": str(len(body))})
        if path == "/lrf3d/world":
            headers["Content-Encoding"] = "gzip"
        return Response(200, "OK", headers, body)

    return answer


async def _show(site: Site, page: Any) -> None:
    """Answer what a page wants, until it leaves.

    A run is shown as the page asks; a drive goes on by itself.
    """
    from websockets.exceptions import ConnectionClosed

    loop = asyncio.get_running_loop()
    # In threads, so that one page's work holds up no other.
    shown = await loop.run_in_executor(None, site.make)
    wanted, new = Wanted(), asyncio.Event()

    async def listen() -> None:
        nonlocal wanted, shown
        while True:
            text = await page.recv()
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
                await page.send(message or b"")

    # Either ends by an error where the page has left.
    tasks = [asyncio.create_task(each) for each in (listen(), answer())]
    with contextlib.suppress(ConnectionClosed):
        try:
            await asyncio.gather(*tasks)
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
