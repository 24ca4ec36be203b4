"""``lrf3d render``: the film of a saved run, or pictures of it."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

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
    film.check()
    path = _output_path(run, out, at is not None)

    from lrf3d.files import make_folder
    from lrf3d.io import load_run

    kept = load_run(run)
    if points_by is not None:
        kept = replace(kept, film=replace(kept.film, points_by=points_by))
    make_folder(path.parent)
    if at is not None:
        film.draw(kept, path, at)
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
