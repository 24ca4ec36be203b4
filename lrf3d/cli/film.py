"""Films on the command line, with defaults for what is not given."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar

from lrf3d.cli.console import progress_bar, warn
from lrf3d.run import Run

Result = TypeVar("Result")

_LARGE, _SMALL = (1280, 720), (640, 360)
"""Sizes [pixels] of films for players, and of films that are drawn slowly or shared."""

_RATE, _GIF_RATE = 25.0, 10.0
"""Frames a second. A GIF of 15 s then has less than 10 MB."""

_ANIMATIONS = (".gif", ".webp")
"""Endings of films that are embedded in pages."""


@dataclass(frozen=True, slots=True)
class FilmOptions:
    """Options of a film; None means the default of the run, the format or the machine.

    Args:
        size: Width and height [pixels].
        fps: Frames a second.
        playback: Seconds of the run in a second of the film.
        view: Name of the camera.
        samples: Samples a pixel, 0 or 4.
        workers: Number of processes.
        renderer: Name of the renderer.
    """

    size: tuple[int, int] | None
    fps: float | None
    playback: float | None
    view: str | None
    samples: int
    workers: int | None
    renderer: str | None

    def still(self, renderer: str) -> dict[str, Any]:
        """Keyword arguments to draw a single picture with a renderer."""
        return {
            "size": self.size or (_LARGE if renderer == "gl" else _SMALL),
            "playback": self.playback,
            "view": self.view,
            "samples": self.samples,
            "renderer": renderer,
        }

    def moving(self, ending: str, renderer: str) -> dict[str, Any]:
        """Keyword arguments to draw a film, in the format of an ending, with a renderer."""
        usual = _SMALL if ending in _ANIMATIONS else None
        return {
            **replace(self, size=self.size or usual).still(renderer),
            "fps": self.fps or (_GIF_RATE if ending == ".gif" else _RATE),
            "workers": self.workers,
        }


Part = tuple[float | None, float | None]
"""From when to when a film shows its run [s]; None for its start and its end."""


def make_film(run: Run, path: Path, options: FilmOptions, part: Part = (None, None)) -> str:
    """Write the film of a run, in the format of the path's ending, and print how long it took."""
    from lrf3d.render.video import render_video

    def draw(renderer: str) -> str:
        arguments = options.moving(path.suffix.lower(), renderer)
        frames = 0
        began = perf_counter()
        _light(run)
        with progress_bar("film") as progress:

            def count(done: int, total: int) -> None:
                nonlocal frames
                frames = total
                progress(done, total)

            render_video(run, path, **arguments, part=part, progress=count)
        seconds = perf_counter() - began
        width, height = arguments["size"]
        by = "OpenGL" if renderer == "gl" else "Embree"
        each = 1000.0 * seconds / max(frames, 1)
        return f"{frames} of {width}x{height} by {by} in {seconds:.1f} s, {each:.0f} ms each"

    return drawn_by(options.renderer, draw)


def make_frames(run: Run, folder: Path, options: FilmOptions, part: Part = (None, None)) -> int:
    """Write the frames of the film of a run as pictures; returns their number."""
    from lrf3d.render.video import render_frames

    def draw(renderer: str) -> int:
        arguments = options.moving(".png", renderer)
        _light(run)
        with progress_bar("frames") as progress:
            return render_frames(run, folder, **arguments, part=part, progress=progress)

    return drawn_by(options.renderer, draw)


def make_picture(run: Run, path: Path, time: float, options: FilmOptions) -> None:
    """Write a picture of a run at a time [s]."""
    from lrf3d.output import replacing
    from lrf3d.render.pictures import save_png
    from lrf3d.render.video import frame

    picture = drawn_by(
        options.renderer, lambda renderer: frame(run, time, **options.still(renderer))
    )
    with replacing(path) as unfinished:
        save_png(picture, unfinished)


def _light(run: Run) -> None:
    """Bake the light of a run's world, which the films and pictures that follow have at hand."""
    from lrf3d.scene.stage import stage_of

    with progress_bar("light") as progress:
        stage_of(run, progress)


def drawn_by(wanted: str | None, draw: Callable[[str], Result]) -> Result:
    """Draw with the given renderer; if None, with OpenGL, or else with Embree."""
    from lrf3d.errors import MissingLibraryError

    try:
        return draw(wanted or "gl")
    except MissingLibraryError as error:
        if wanted is not None:
            raise
        warn(f"Embree draws instead, smaller and slower: {error}")
        return draw("embree")
