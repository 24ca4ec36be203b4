"""Making a film with a bar on the terminal, or saying why there is none."""

from pathlib import Path

from lrf3d.cli.console import progress_bar, warn
from lrf3d.simulation import Run


def make_film(
    run: Run,
    path: Path,
    *,
    size: tuple[int, int],
    fps: int,
    playback: float,
    view: str,
    samples: int,
    workers: int | None,
) -> Path | None:
    """Write the film of a run; without a GL library say the line to run, and give None."""
    from lrf3d.errors import MissingLibraryError
    from lrf3d.render.video import render_video

    try:
        with progress_bar("film") as progress:
            render_video(
                run,
                path,
                size=size,
                fps=fps,
                playback=playback,
                view=view,
                samples=samples,
                workers=workers,
                progress=progress,
            )
    except MissingLibraryError as error:
        warn(f"no film: {error}")
        return None
    return path
