"""``lrf3d render``: the film of a saved run, or pictures of it."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from lrf3d.cli import options


def render(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A run.npz, or its folder.")],
    out: Annotated[
        Path | None,
        typer.Option(
            help="The film: .mp4, .webp or .gif; with --at a .png, with --frames a folder. "
            "In the run's folder if not given."
        ),
    ] = None,
    at: Annotated[
        float | None, typer.Option(help="Draw one picture at this time [s] instead of a film.")
    ] = None,
    frames: Annotated[
        bool, typer.Option("--frames", help="Write each frame of the film as a .png.")
    ] = False,
    first: Annotated[
        float | None, typer.Option("--from", help="Begin the film at this time of the run [s].")
    ] = None,
    last: Annotated[
        float | None, typer.Option("--to", help="End the film at this time of the run [s].")
    ] = None,
    view: options.ViewOption = None,
    size: options.Size = None,
    fps: options.Fps = None,
    playback: options.Playback = None,
    points_by: options.PointsBy = None,
    samples: options.Samples = 4,
    workers: options.Workers = None,
    renderer: options.RendererOption = None,
) -> None:
    """Draw the film of a run, a picture of one moment of it, or all its frames as pictures."""
    from lrf3d.cli.console import print_table
    from lrf3d.cli.film import make_film, make_frames, make_picture
    from lrf3d.io import load_run
    from lrf3d.output import make_folder

    film = options.film_options(
        size=size,
        fps=fps,
        playback=playback,
        view=view,
        samples=samples,
        workers=workers,
        renderer=renderer,
    )
    path = _output_path(run, out, at is not None, frames)
    kept = load_run(run)
    if points_by is not None:
        kept = replace(kept, film=replace(kept.film, points_by=points_by.value))
    make_folder(path.parent)
    if frames:
        count = make_frames(kept, path, film, (first, last))
        print_table([("frames", f"{count} in {path}")])
    elif at is not None:
        make_picture(kept, path, at, film)
        print_table([("picture", str(path))])
    else:
        drawn = make_film(kept, path, film, (first, last))
        print_table([("video", str(path)), ("frames", drawn)])


def _output_path(run: Path, out: Path | None, picture: bool, frames: bool) -> Path:
    """The file or folder to write to; its ending must fit what is drawn."""
    from lrf3d.errors import InputError

    if picture and frames:
        raise InputError("--at and --frames: one is a single picture, the other all; give one")
    ending = ".png" if picture else "" if frames else ".mp4"
    if out is None:
        folder = run if run.is_dir() else run.parent
        return folder / ("frames" if frames else f"run{ending}")
    given = out.suffix.lower()
    if frames and given in (".png", ".mp4", ".webp", ".gif"):
        raise InputError(f"--out {out}: --frames writes many files; name a folder")
    if picture and given != ending:
        raise InputError(f"--out {out}: expected a name that ends in .png, as --at draws a picture")
    if not picture and given == ".png":
        raise InputError(
            f"--out {out}: a .png is one picture; give its time with --at TIME, or use --frames"
        )
    return out
