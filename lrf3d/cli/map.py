"""``lrf3d map``: the mapper on a recorded log."""

from pathlib import Path
from typing import Annotated

import typer

from lrf3d.cli import options
from lrf3d.cli.console import json_text, print_json, print_table, progress_bar


def map_(
    log: Annotated[
        Path, typer.Argument(metavar="LOG", help="A CARMEN log: .log, .clf, packed as .gz or not.")
    ],
    out: options.Out = None,
    mode: options.ModeOption = None,
    sigma: Annotated[
        float | None, typer.Option(help="Noise [m] of the ranges at the farthest that is measured.")
    ] = None,
    largest_range: Annotated[
        float | None, typer.Option(help="Readings [m] from here on are no return; 50 if not given.")
    ] = None,
    json: options.Json = False,
) -> None:
    """Build a map from the even scans of a log, and test it on the odd ones.

    Poses are taken as logged. Writes map.geojson, map.png and summary.json.
    """
    from lrf3d.logs import load_log
    from lrf3d.logs.laser_log import LARGEST_RANGE
    from lrf3d.output import make_folder, write_text
    from lrf3d.study.log_mapping import SIGMA, draw_mapped_log, map_log

    drive = load_log(log, largest_range=LARGEST_RANGE if largest_range is None else largest_range)
    folder = make_folder(Path("out") / drive.name if out is None else out)
    with progress_bar("scans") as progress:
        mapped = map_log(
            drive,
            mode=(options.Mode.ROBUST if mode is None else mode).value,
            sigma=SIGMA if sigma is None else sigma,
            progress=progress,
        )
    files = draw_mapped_log(mapped, folder)
    files["summary"] = folder / "summary.json"
    summary = {**mapped.summary(), "files": {name: path.name for name, path in files.items()}}
    write_text(files["summary"], json_text(summary))
    if json:
        print_json(summary)
        return
    print_table([*mapped.rows(), *((name, str(path)) for name, path in files.items())])
