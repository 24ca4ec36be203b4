"""The editor's page and its socket, on the server of `lrf3d view`.

The page sends messages in JSON, in which ``do`` names the action. The answer to decisions is the
resulting plan, and later the rooms and the route, which take longer.
"""

import asyncio
import contextlib
import json
import socket
from collections.abc import Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from lrf3d.apps.edit.editor import Editor
from lrf3d.apps.edit.message import packed
from lrf3d.base.errors import InputError, Lrf3dError
from lrf3d.base.files import locked
from lrf3d.studio.page.server import MOMENTS, Files, Talks, moments_talk, page_files, serve_pages
from lrf3d.studio.page.session import PageSession
from lrf3d.world.files import edits_path

# Largest message of a page [bytes]: enough for thousands of decisions.
LARGEST = 4_000_000

# Time between two checks whether the source has changed [s].
_WATCH = 1.0

# Path of the page's socket.
SOCKET = "/lrf3d/edits"

# A function that performs a page's action, given the values of its message.
Act = Callable[[Any, dict[str, Any]], Coroutine[Any, Any, None]]

STATIC = Path(__file__).parent / "static"


class Desk:
    """An editor and the pages that show it, one of which may write."""

    def __init__(self, editor: Editor) -> None:
        self.editor = editor
        self.files: Files = {}
        self.talks: Talks = {SOCKET: self.talk}
        self._writer: Any = None
        self._busy = asyncio.Lock()
        # Plans one by one: what waits for its turn is dropped when a newer plan comes, and what is
        # saved does not wait.
        self._planner = ThreadPoolExecutor(1)
        # The actions of messages, by the name of each.
        self._acts: dict[str, Act] = {
            "scan": self._scan,
            "keep": self._keep,
            "read": self._read_again,
            "world": self._save,
            "map": self._save,
            "drive": self._film,
        }
        for path in sorted(STATIC.iterdir()):
            kind = {".html": "html", ".css": "css", ".js": "javascript"}[path.suffix]
            name = "/" if kind == "html" else f"/lrf3d/{path.name}"
            self.files[name] = f"text/{kind}; charset=utf-8", path.read_bytes()
        self._show_source()

    def _show_source(self) -> None:
        if picture := self.editor.picture():
            self.files["/lrf3d/source.png"] = "image/png", picture

    async def talk(self, page: Any) -> None:
        """Serve a page until it closes; the first of several may write, the others only read."""
        from websockets.exceptions import ConnectionClosed

        if self._writer is None:
            self._writer = page
        follow = None
        watch = asyncio.create_task(self._watch(page))
        try:
            await self._send_plan(page)
            follow = asyncio.create_task(self._follow(page))
            while True:
                if await self._answer(page, await page.recv()):
                    follow.cancel()
                    follow = asyncio.create_task(self._follow(page))
        except ConnectionClosed:
            pass
        finally:
            watch.cancel()
            if follow is not None:
                follow.cancel()
            if self._writer is page:
                self._writer = None

    async def _answer(self, page: Any, text: Any) -> bool:
        """Perform a page's action and answer; returns whether the plan has changed."""
        plan = self.editor.plan
        try:
            values = json.loads(text)
            await self._acts[values["do"]](page, values)
        except (KeyError, RecursionError, TypeError, ValueError, Lrf3dError) as error:
            said = str(error) if isinstance(error, Lrf3dError) else "malformed message"
            await page.send(packed({"kind": "error", "text": said}))
        if plan is self.editor.plan:
            return False
        await self._send_plan(page)
        return True

    async def _scan(self, page: Any, values: dict[str, Any]) -> None:
        x, y, theta = map(float, values["pose"])
        await page.send(self.editor.scan((x, y, theta)))

    async def _keep(self, page: Any, values: dict[str, Any]) -> None:
        self._check_writer(page)
        async with self._busy:
            await asyncio.to_thread(self.editor.decide, values["edits"])

    async def _read_again(self, page: Any, values: dict[str, Any]) -> None:
        async with self._busy:
            await asyncio.to_thread(self.editor.read)
            self._show_source()

    async def _save(self, page: Any, values: dict[str, Any]) -> None:
        self._check_writer(page)
        save = {"world": self.editor.save_world, "map": self.editor.save_map}[values["do"]]
        path = await asyncio.to_thread(save)
        await page.send(packed({"kind": "said", "text": f"{path} is written"}))

    async def _film(self, page: Any, values: dict[str, Any]) -> None:
        await asyncio.to_thread(self._drive)
        await page.send(packed({"kind": "film", "address": "/film"}))

    def _check_writer(self, page: Any) -> None:
        if self._writer is not page:
            raise InputError("another page has this file open; this one only reads")

    async def _send_plan(self, page: Any) -> None:
        reads = self.editor.read_only or self._writer is not page
        await page.send(packed({"kind": "role", "reads": reads}))
        await page.send(await asyncio.to_thread(self.editor.message))

    async def _follow(self, page: Any) -> None:
        """Send the rooms and the route of the current plan."""
        loop = asyncio.get_running_loop()
        for find in (self.editor.rooms, self.editor.route):
            try:
                answer = await loop.run_in_executor(self._planner, find)
            except (Lrf3dError, ValueError, IndexError) as error:
                answer = packed({"kind": "none", "what": find.__name__, "text": str(error)})
            with contextlib.suppress(Exception):
                await page.send(answer)

    async def _watch(self, page: Any) -> None:
        """Tell a page when the source has changed."""
        seen = self.editor.seen
        while True:
            await asyncio.sleep(_WATCH)
            now = self.editor.stamp()
            if now not in (seen, self.editor.seen):
                await page.send(packed({"kind": "changed"}))
            seen = now

    def _drive(self) -> None:
        """Simulate a drive through the plan as `lrf3d run` does, and serve its film."""
        run = self.editor.scenario.with_route().run(rng=0, on_collision=lambda note: None)

        def make() -> PageSession:
            return PageSession.played(run, run.playback)

        files = page_files(make())
        files["/film"] = files.pop("/")
        self.files.update(files)
        self.talks[MOMENTS] = moments_talk(make)


def edit(
    path: Path,
    options: dict[str, Any],
    door: socket.socket,
    *,
    host: str,
    browser: bool,
    started: Callable[[str], None],
) -> None:
    """Serve the editor of a file until the program is interrupted.

    Raises:
        InputError: The file cannot be read.
    """
    with ExitStack() as stack:
        read_only = False
        try:
            stack.enter_context(locked(edits_path(path)))
        except InputError:
            read_only = True
        desk = Desk(Editor(path, options, read_only=read_only))
        serve_pages(
            lambda: desk.files,
            desk.talks,
            door,
            host=host,
            largest=LARGEST,
            browser=browser,
            started=started,
        )
