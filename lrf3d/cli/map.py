"""``lrf3d map``: the mapper on a recorded log."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lrf3d.cli import options
from lrf3d.cli.console import progress_bar
from lrf3d.text import counted

if TYPE_CHECKING:
    from lrf3d.recorded import MappedLog


class Poses(StrEnum):
    """Where the poses of a log may come from."""

    AUTO = "auto"
    TRUTH = "truth"
    TF = "tf"
    ODOM = "odom"


def map_(
    context: typer.Context,
    log: Annotated[
        Path,
        typer.Argument(
            metavar="LOG",
            help="A CARMEN log (.log, .clf, .gz), a ROS 2 bag (.mcap, .db3, a folder), or a run.",
        ),
    ],
    out: options.Out = None,
    mode: options.ModeOption = None,
    sigma: Annotated[
        float | None, typer.Option(help="Noise [m] of the ranges at the largest range.")
    ] = None,
    largest_range: Annotated[
        float | None, typer.Option(help="CARMEN: readings [m] of this or more are no return.")
    ] = None,
    poses: Annotated[
        Poses, typer.Option(help="Source of the poses; auto takes the best that the log has.")
    ] = Poses.AUTO,
    scan_topic: Annotated[
        str | None, typer.Option(help="Bags: topic of the scans; /scan if not given.")
    ] = None,
    all_scans: Annotated[
        bool, typer.Option("--all", help="Build the map from all scans, without a test.")
    ] = False,
    json: options.Json = False,
) -> None:
    """Build a map from the even scans of a log, and test it on the odd ones.

    Poses are those logged with the scans; in a bag the ground truth, else the transforms up to the
    root, else odometry. The summary says which.

    Writes map.geojson, map.png and summary.json.
    """
    from lrf3d.cli.folder import results_folder
    from lrf3d.io import load_log
    from lrf3d.mapping import save_map
    from lrf3d.recorded import map_log

    drive = load_log(log, largest_range=largest_range, poses=poses.value, scan_topic=scan_topic)
    with progress_bar("scans") as progress:
        mapped = map_log(
            drive,
            mode=(options.Mode.ROBUST if mode is None else mode).value,
            sigma=sigma,
            all_scans=all_scans,
            progress=progress,
        )
    output = results_folder(context, [log], drive.name, out)
    files = {"map": output.path / "map.geojson"}
    save_map(mapped.map, files["map"], free=mapped.free_cells())
    output.finish(
        mapped.summary(),
        files,
        {"map picture": (output.path / "map.png", mapped.draw)},
        rows=rows(mapped),
        kept=f"{files['map']} holds the map",
        json=json,
    )


def rows(mapped: "MappedLog") -> list[tuple[str, str]]:
    """The figures of a mapped log as a printed table."""
    log, score, figures = mapped.log, mapped.score, mapped.summary()
    beams = counted(len(log.scans[0].ranges), "beam")
    bad = counted(log.bad_count, f"bad {log.bad_lines[0].kind if log.bad_lines else 'line'}")
    table = [("log", f"{counted(len(log), 'scan')} of {beams}, {bad}")]
    table += [("", str(line)) for line in log.bad_lines]
    if log.not_numbers:
        table.append(("", f"{counted(log.not_numbers, 'reading')} NaN: no return"))
    table.append(("poses", log.source))
    table.append(("map", f"{mapped.map.counts}, {score.length:.0f} m long"))
    if score.returns:
        explained = f"{_share(score.explained)} of {score.returns} returns explained"
        error = score.median_range_error
        off = "–" if error != error else f"{error:.3f} m"
        violated = f"{_share(score.violation)} violated, median range error {off}"
        table.append(("odd scans", f"{explained}, {violated}"))
    mean, median = figures["milliseconds_a_scan"], figures["median_milliseconds_a_scan"]
    return [*table, ("time", f"{mean:.2f} ms a scan, median {median:.2f} ms")]


def _share(value: float) -> str:
    return "–" if value != value else f"{100.0 * value:.1f} %"
