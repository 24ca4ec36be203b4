"""``lrf3d render``: the film of a saved run, or pictures of it."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from lrf3d.cli.console import Report
from lrf3d.cli.film import Film
from lrf3d.cli.options import OutFile, RunArgument


def render(
    run: RunArgument,
    film: Film,
    report: Report,
    out: OutFile = None,
    at: float | None = None,
    frames: bool = False,
    first: Annotated[float | None, typer.Option("--from")] = None,
    last: Annotated[float | None, typer.Option("--to")] = None,
    points_by: Literal["range", "intensity"] | None = None,
) -> None:
    """Draw the film of a run, or a picture of one moment.

    The ending of --out selects the kind; a folder takes all frames as pictures.

    Options:
        out: The film: .mp4, .webp or .gif; with --at a .png, with --frames a folder. In the run's
            folder if not given.
        at: Draw one picture at this time [s] instead of a film.
        frames: Write each frame of the film as a .png.
        first: Begin the film at this time of the run [s].
        last: End the film at this time of the run [s].
        points_by: What the colour of hit points shows; that of the run if not given.
    """
    film.check()
    path = _output_path(run, out, at is not None, frames)

    from lrf3d.files import make_folder
    from lrf3d.io import load_run

    kept = load_run(run)
    if points_by is not None:
        kept = replace(kept, film=replace(kept.film, points_by=points_by))
    make_folder(path.parent)
    figures: dict[str, Any] = {}
    if at is None:
        figures = film.write(kept, path, report, frames=frames, part=(first, last))
    else:
        film.draw(kept, path, at)
    what = "frames" if frames else "video" if at is None else "picture"
    rows = [("film" if what == "video" else what, str(path))]
    if figures:
        each = 1e3 * figures["seconds"] / max(figures["frames"], 1)
        by = "OpenGL" if figures["renderer"] == "gl" else "Embree"
        size = "x".join(map(str, figures["size"]))
        drawn = f"{figures['seconds']:.1f} s, {each:.0f} ms each by {by}"
        rows += [("drawn", f"{figures['frames']} frames of {size}"), ("time", drawn)]
    report.print({what: str(path), **({} if not figures else {"drawn": figures})}, rows)


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
