"""``lrf3d render``, ``view`` and ``export``, and the options of the film that a run ends with."""

import re
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import typer

from lrf3d.cli.console import Report
from lrf3d.cli.options import Count, Drive, OutFile, RunArgument, Seed, Workers

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
        began, done = perf_counter(), list[int]()
        # The light is baked once, for all that draw.
        with report.progress("light") as progress:
            stage_of(run, progress)
        with report.progress("film") as progress:

            def noted(number: int, total: int) -> None:
                done.append(number)
                progress(number, total)

            render_video(
                run, path, fps=rate, workers=self.workers, part=part, progress=noted, **options
            )
        figures = {"size": list(options["size"]), "renderer": options["renderer"]}
        return {"frames": len(done), **figures, "seconds": perf_counter() - began}

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
    from lrf3d.errors import InputError

    picture = at is not None
    if out is not None and picture != (out.suffix.lower() == ".png"):
        raise InputError(
            f"--out {out}: expected a name that ends in .png, as --at draws a picture"
            if picture
            else f"--out {out}: a .png is one picture; give its time with --at TIME"
        )
    path = _folder(run) / ("run.png" if picture else "run.mp4") if out is None else out

    from lrf3d.files import make_folder, replacing
    from lrf3d.io import load_run

    kept = load_run(run)
    if points_by is not None:
        kept = replace(kept, film=replace(kept.film, points_by=points_by))
    make_folder(path.parent)
    if at is not None:
        from lrf3d.render.video import frame, save_png

        drawing = frame(kept, at, **film.options())
        with replacing(path) as unfinished:
            save_png(drawing, unfinished)
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


def _folder(run: Path) -> Path:
    """The folder of a run, which may be named by its folder or by its file."""
    return run if run.is_dir() else run.parent


def view(
    what: Annotated[str, typer.Argument(metavar="RUN|WORLD")],
    drive: Drive,
    report: Report,
    host: str = "127.0.0.1",
    port: Annotated[int | None, typer.Option(min=1, max=65535)] = None,
    browser: bool = True,
    playback: Annotated[float | None, typer.Option(min=0.01)] = None,
    seed: Seed = 0,
) -> None:
    """Play a run in the browser, or drive through a world by hand.

    A run can be played, paused and scrubbed. In a world the arrow keys or the pads on the page
    drive the robot, which scans and maps as it goes. Ctrl-C ends the server.

    Options:
        what: A run.npz or its folder to play, or a world to drive in. A built-in world comes before
            a folder of the same name: write ./NAME for that.
        host: Address or name to listen at; 0.0.0.0 lets other machines in. The page opens only by
            this name, an address, or the machine's host name.
        port: Port; if not given, 8080, or any where that is taken.
        browser: Open the browser.
        playback: Simulated seconds per second.
    """
    from lrf3d.io.reading import is_run
    from lrf3d.world.files import find_world

    run = is_run(what)
    if not run:
        # An unknown name is reported before the server is imported.
        find_world(what)
    from lrf3d.view.server import bound, run_view, serve, world_view

    def say(address: str) -> None:
        text = f"{what} is shown at {address}; Ctrl-C ends it"
        report.print({"address": address}, [("view", text)])

    # A wrong address is refused before the work.
    with bound(host, port) as door:
        make = run_view(what, playback) if run else world_view(drive.read(what, report), seed)
        serve(make, door, host=host, browser=browser, started=say)


def export(
    run: RunArgument,
    to: Annotated[str, typer.Option(metavar="FORMAT")],
    report: Report,
    out: OutFile = None,
    every: Count = 1,
) -> None:
    """Write a run for another program.

    carmen is a text log; mcap is a ROS 2 bag in one file, for Foxglove; rosbag2 is a ROS 2 bag as
    a folder, for ros2 bag play, rviz and slam_toolbox; glb is an animated 3D scene for Blender and
    web viewers: the world, the robot, its beams and its map as it grows.

    Options:
        to: The format: carmen, mcap, rosbag2 or glb.
        out: The file; in the run's folder if not given.
        every: Keep every n-th scan.
    """
    from lrf3d.io import load_run

    kept = load_run(run)

    from lrf3d.exporting import EXPORTERS, export_run
    from lrf3d.files import make_folder

    path = _folder(run) / EXPORTERS.get(to, "") if out is None else out
    make_folder(path.parent)
    export_run(kept, to, path, every=every)
    files = [path] if path.is_file() else sorted(path.iterdir())
    scans, size = len(range(0, len(kept), every)), sum(file.stat().st_size for file in files)
    report.print(
        {"file": str(path), "format": to, "scans": scans, "bytes": size},
        [(to, str(path)), ("scans", f"{scans:,}"), ("size", f"{size / 1e6:.1f} MB")],
    )
