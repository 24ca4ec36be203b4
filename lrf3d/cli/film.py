"""``lrf3d render``, and the film that a run ends with."""

from argparse import Namespace
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

from lrf3d.cli.console import Report, warn
from lrf3d.errors import InputError, MissingLibraryError
from lrf3d.files import make_folder, replacing
from lrf3d.render.gl import require_gl
from lrf3d.render.video import frame, render_video, save_png
from lrf3d.run import Run
from lrf3d.scene.stage import stage_of
from lrf3d.text import counted

_LARGE, _SMALL = (1280, 720), (640, 360)
"""Sizes [pixels] of films for players, and of films that are drawn slowly or shared."""

_RATE, _GIF_RATE = 25.0, 10.0
"""Frames a second. A GIF of 15 s then has less than 10 MB."""


def render(run: Run, args: Namespace, report: Report) -> None:
    """Draw the film of a run, or a picture of one moment."""
    picture = args.at is not None
    if args.out is not None and picture != (args.out.suffix.lower() == ".png"):
        raise InputError(
            f"--out {args.out}: expected a name that ends in .png, as --at draws a picture"
            if picture
            else f"--out {args.out}: a .png is one picture; give its time with --at TIME"
        )
    path = args.out or folder_of(args.run) / ("run.png" if picture else "run.mp4")
    if args.points_by is not None:
        run = replace(run, film=replace(run.film, points_by=args.points_by))
    make_folder(path.parent)
    if picture:
        drawing = frame(run, args.at, **_look(args))
        with replacing(path) as unfinished:
            save_png(drawing, unfinished)
        report.print({"picture": str(path)}, [("picture", str(path))])
        return
    drawn = write_film(run, path, args, report, part=(args.from_, args.to))
    each = 1e3 * drawn["seconds"] / max(drawn["frames"], 1)
    width, height = drawn["size"]
    by = "OpenGL" if drawn["renderer"] == "gl" else "Embree"
    report.print(
        {"video": str(path), "drawn": drawn},
        [
            ("film", str(path)),
            ("drawn", f"{counted(drawn['frames'], 'frame')} of {width}x{height}"),
            ("time", f"{drawn['seconds']:.1f} s, {each:.0f} ms each by {by}"),
        ],
    )


def folder_of(run: Path) -> Path:
    """The folder of a run, which may be named by its folder or by its file."""
    return run if run.is_dir() else run.parent


def write_film(
    run: Run,
    path: Path,
    args: Namespace,
    report: Report,
    *,
    part: tuple[float | None, float | None] = (None, None),
) -> dict[str, Any]:
    """Write the film of a run, and return its figures."""
    ending, look = path.suffix.lower(), _look(args)
    if args.size is None and ending in (".gif", ".webp"):
        look["size"] = _SMALL
    rate = args.fps or (_GIF_RATE if ending == ".gif" else _RATE)
    began, done = perf_counter(), list[int]()
    # The light is baked once, for all that draw.
    with report.progress("light") as progress:
        stage_of(run, progress)
    with report.progress("film") as progress:

        def noted(number: int, total: int) -> None:
            done.append(number)
            progress(number, total)

        render_video(run, path, fps=rate, workers=args.workers, part=part, progress=noted, **look)
    figures = {"size": list(look["size"]), "renderer": look["renderer"]}
    return {"frames": len(done), **figures, "seconds": perf_counter() - began}


def _look(args: Namespace) -> dict[str, Any]:
    """Keyword arguments to draw any picture: with OpenGL, or else with Embree."""
    look = {name: vars(args)[name] for name in ("view", "playback", "panel")}
    renderer = args.renderer or "gl"
    if args.renderer is None:
        try:
            require_gl()
        except MissingLibraryError as error:
            warn(f"Embree draws instead, smaller and slower: {error}")
            renderer = "embree"
    return {
        **look,
        "samples": int(args.samples),
        "renderer": renderer,
        "size": args.size or (_LARGE if renderer == "gl" else _SMALL),
    }
