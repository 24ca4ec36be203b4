"""The options of films and pictures, and how they are drawn."""

import re
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import typer

from lrf3d.cli.console import Report
from lrf3d.cli.options import Workers

if TYPE_CHECKING:
    from lrf3d.run import Run

_LARGE, _SMALL = (1280, 720), (640, 360)
"""Sizes [pixels] of films for players, and of films that are drawn slowly or shared."""

_RATE, _GIF_RATE = 25.0, 10.0
"""Frames a second. A GIF of 15 s then has less than 10 MB."""


@dataclass(frozen=True)
class Film:
    """The options of a film; None means the default of the run, the format or the machine.

    Options:
        view: Camera: story, chase, first, orbit, overview, top, or one of the world.
        size: Size [pixels]; 1280x720, but 640x360 for .webp, .gif and with Embree.
        fps: Frames per second; 25, but 10 for .gif.
        playback: Simulated seconds per second of film.
        samples: Samples per pixel for smooth edges: 0 or 4.
        renderer: Renderer; embree needs no OpenGL. The best available if not given.
        panel: What the panel says: short, three facts, or full, all numbers.
    """

    title: ClassVar[str | None] = "Film"
    view: str | None = None
    size: Annotated[str | None, typer.Option(metavar="WxH")] = None
    fps: Annotated[float | None, typer.Option(min=0.1, max=1000.0)] = None
    playback: Annotated[float | None, typer.Option(min=0.01)] = None
    samples: int = 4
    workers: Workers = None
    renderer: Literal["gl", "embree"] | None = None
    panel: Literal["short", "full"] = "short"

    def check(self) -> None:
        """Check the size, before any work."""
        self._size()

    def write(
        self,
        run: "Run",
        path: Path,
        report: Report,
        part: tuple[float | None, float | None] = (None, None),
    ) -> dict[str, Any]:
        """Write the film of a run, and return its figures."""
        from lrf3d.render.video import render_video
        from lrf3d.scene.stage import stage_of

        ending, options = path.suffix.lower(), self._options()
        if self.size is None and ending in (".gif", ".webp"):
            options["size"] = _SMALL
        rate = self.fps or (_GIF_RATE if ending == ".gif" else _RATE)
        count, began = 0, perf_counter()
        # The light is baked once, for all that draw.
        with report.progress("light") as progress:
            stage_of(run, progress)
        with report.progress("film") as progress:

            def counting(done: int, total: int) -> None:
                nonlocal count
                count = total
                progress(done, total)

            render_video(
                run, path, fps=rate, workers=self.workers, part=part, progress=counting, **options
            )
        figures = {"frames": count, "size": list(options["size"]), "renderer": options["renderer"]}
        return {**figures, "seconds": perf_counter() - began}

    def draw(self, run: "Run", path: Path, time: float) -> None:
        """Write the picture of a run at a time [s]."""
        from lrf3d.files import replacing
        from lrf3d.render.pictures import save_png
        from lrf3d.render.video import frame

        picture = frame(run, time, **self._options())
        with replacing(path) as unfinished:
            save_png(picture, unfinished)

    def _options(self) -> dict[str, Any]:
        """Keyword arguments to draw any picture: with OpenGL, or else with Embree."""
        from lrf3d.cli.console import warn
        from lrf3d.errors import MissingLibraryError
        from lrf3d.render.gl import require_gl

        shared = {name: getattr(self, name) for name in ("view", "playback", "samples", "panel")}
        renderer = self.renderer or "gl"
        if self.renderer is None:
            try:
                require_gl()
            except MissingLibraryError as error:
                warn(f"Embree draws instead, smaller and slower: {error}")
                renderer = "embree"
        size = self._size() or (_LARGE if renderer == "gl" else _SMALL)
        return {**shared, "size": size, "renderer": renderer}

    def _size(self) -> tuple[int, int] | None:
        """Width and height; both even, as H.264 needs them."""
        from lrf3d.errors import InputError, shown

        if self.size is None:
            return None
        given = re.fullmatch(r"([0-9]{1,5})x([0-9]{1,5})", self.size.lower())
        if given is None:
            raise InputError(f"--size {shown(self.size)}: expected WIDTHxHEIGHT, such as 1280x720")
        size = int(given[1]), int(given[2])
        if min(size) < 64 or max(size) > 7680 or size[0] % 2 or size[1] % 2:
            raise InputError(f"--size {self.size}: expected even numbers from 64 to 7680")
        return size
