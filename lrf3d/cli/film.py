"""``lrf3d render``, and the options of films and pictures that ``lrf3d run`` has, too."""

import re
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import typer

from lrf3d.cli.console import Report
from lrf3d.cli.options import OutFile, RunArgument, Workers

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

    def __post_init__(self) -> None:
        self._size()  # An invalid one is found before any work.

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

        ending, options = path.suffix.lower(), self.options()
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

    def options(self) -> dict[str, Any]:
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


def render(
    run: RunArgument,
    film: Film,
    report: Report,
    out: OutFile = None,
    at: float | None = None,
    first: Annotated[float | None, typer.Option("--from")] = None,
    last: Annotated[float | None, typer.Option("--to")] = None,
    points_by: Literal["range", "intensity"] | None = None,
) -> None:
    """Draw the film of a run, or a picture of one moment.

    The ending of --out selects the kind.

    Options:
        out: The film: .mp4, .webp or .gif; with --at a .png. In the run's folder if not given.
        at: Draw one picture at this time [s] instead of a film.
        first: Begin the film at this time of the run [s].
        last: End the film at this time of the run [s].
        points_by: What the colour of hit points shows; that of the run if not given.
    """
    path = _output_path(run, out, at is not None)

    from lrf3d.files import make_folder
    from lrf3d.io import load_run

    kept = load_run(run)
    if points_by is not None:
        kept = replace(kept, film=replace(kept.film, points_by=points_by))
    make_folder(path.parent)
    if at is not None:
        from lrf3d.files import replacing
        from lrf3d.render.video import frame, save_png

        picture = frame(kept, at, **film.options())
        with replacing(path) as unfinished:
            save_png(picture, unfinished)
        report.print({"picture": str(path)}, [("picture", str(path))])
        return
    drawn = film.write(kept, path, report, (first, last))
    each = 1e3 * drawn["seconds"] / max(drawn["frames"], 1)
    by = "OpenGL" if drawn["renderer"] == "gl" else "Embree"
    report.print(
        {"video": str(path), "drawn": drawn},
        [
            ("film", str(path)),
            ("drawn", f"{drawn['frames']} frames of {'x'.join(map(str, drawn['size']))}"),
            ("time", f"{drawn['seconds']:.1f} s, {each:.0f} ms each by {by}"),
        ],
    )


def _output_path(run: Path, out: Path | None, picture: bool) -> Path:
    """The file to write to; its ending must fit what is drawn."""
    from lrf3d.errors import InputError

    if out is None:
        return (run if run.is_dir() else run.parent) / ("run.png" if picture else "run.mp4")
    if picture and out.suffix.lower() != ".png":
        raise InputError(f"--out {out}: expected a name that ends in .png, as --at draws a picture")
    if out.suffix.lower() == ".png" and not picture:
        raise InputError(f"--out {out}: a .png is one picture; give its time with --at TIME")
    return out
