"""``lrf3d render``: the film of a run that was kept, or a picture of one moment."""

from pathlib import Path
from typing import Annotated

import typer

from lrf3d.cli import options


def render(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A run.npz, or its folder.")],
    out: Annotated[
        Path | None, typer.Option(help="The film .mp4, or a picture .png; beside the run if not.")
    ] = None,
    at: Annotated[
        float | None, typer.Option(help="Draw one picture of this time [s] instead of a film.")
    ] = None,
    view: options.ViewOption = None,
    size: options.Size = "1280x720",
    fps: options.Fps = 25,
    playback: options.Playback = None,
    samples: options.Samples = 4,
    workers: options.Workers = None,
) -> None:
    """Draw the film of a run, or a picture of one moment of it."""
    from lrf3d.cli.console import print_table, progress_bar
    from lrf3d.errors import InputError
    from lrf3d.logs import load_run
    from lrf3d.output import make_folder, replacing
    from lrf3d.render.video import frame, render_video

    pixels = options.parse_size(size)
    kept = load_run(run)
    folder = run if run.is_dir() else run.parent
    ending = ".mp4" if at is None else ".png"
    path = folder / f"run{ending}" if out is None else out
    if path.suffix.lower() != ending:
        raise InputError(f"--out {path}: expected a name that ends in {ending}")
    make_folder(path.parent)
    seen = "chase" if view is None else view
    pace = 1.0 if playback is None else playback
    if at is None:
        with progress_bar("film") as progress:
            render_video(
                kept,
                path,
                size=pixels,
                fps=fps,
                playback=pace,
                view=seen,
                samples=samples,
                workers=workers,
                progress=progress,
            )
        print_table([("video", str(path))])
        return
    from PIL import Image

    pixelmap = frame(kept, at, size=pixels, view=seen, samples=samples, playback=pace)
    picture = Image.fromarray(pixelmap)
    with replacing(path) as unfinished:
        picture.save(unfinished)
    print_table([("picture", str(path))])
