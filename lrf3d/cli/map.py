"""``lrf3d map``: the mapper on a recorded log."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from lrf3d.cli import options
from lrf3d.cli.console import Report
from lrf3d.text import counted

if TYPE_CHECKING:
    from lrf3d.recorded import MappedLog


def map_(
    context: typer.Context,
    log: Annotated[Path, typer.Argument(metavar="LOG")],
    report: Report,
    out: options.Out = None,
    mode: options.Mode = None,
    sigma: float | None = None,
    all_scans: Annotated[bool, typer.Option("--all")] = False,
    largest_range: options.LargestRange = None,
    poses: Literal["auto", "truth", "tf", "odom"] = "auto",
    scan_topic: options.ScanTopic = None,
) -> None:
    """Map a log whose poses are known, and test the map.

    The even scans build the map, the odd ones test it.

    Poses are those logged with the scans; in a bag the ground truth, else the transforms up to the
    root, else odometry. The summary says which.

    Writes map.geojson, map.png and summary.json.

    Options:
        log: A CARMEN log (.log, .clf, .gz), a ROS 2 bag (.mcap, .db3, a folder), or a run.
        mode: Mode of the mapper.
        sigma: Noise [m] of the ranges at the largest range.
        all_scans: Build the map from all scans, without a test.
        poses: Source of the poses; auto takes the best that the log has.
    """
    from lrf3d.io.reading import load_log

    # A log that cannot be read is reported before the mapper is imported.
    drive = load_log(log, largest_range=largest_range, poses=poses, scan_topic=scan_topic)

    from lrf3d.cli.folder import results_folder
    from lrf3d.mapping import save_map
    from lrf3d.recorded import map_log

    with report.progress("scans") as progress:
        mapped = map_log(
            drive, mode=mode or "robust", sigma=sigma, all_scans=all_scans, progress=progress
        )
    output = results_folder(context, report, [log], drive.name, out)
    save_map(mapped.map, output.path / "map.geojson", free=mapped.free_cells())
    rows, details = rows_of(mapped)
    output.finish(
        mapped.summary(),
        {"map": "map.geojson"},
        {"map picture": ("map.png", mapped.draw)},
        rows=rows,
        details=details,
        following=f"lrf3d run {output.path / 'map.geojson'}",
        kept=f"{output.path / 'map.geojson'} holds the map",
    )


def rows_of(mapped: "MappedLog") -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """The figures of a mapped log as a table, and more of them."""
    log, score, figures = mapped.log, mapped.score, mapped.summary()
    text = f"{counted(len(log), 'scan')} of {counted(len(log.scans[0].ranges), 'beam')}"
    rows = [("log", text), ("poses", log.source)]
    if log.bad_count:
        bad = counted(log.bad_count, f"bad {log.bad_lines[0].kind}")
        rows += [("", f"{bad} left out"), *(("", str(line)) for line in log.bad_lines)]
    if log.not_numbers:
        rows.append(("", f"{counted(log.not_numbers, 'reading')} NaN: no return"))
    rows.append(("map", f"{mapped.map.counts}, {score.length:.0f} m long"))
    details = []
    if score.returns:
        explained = f"{_share(score.explained)} of the {score.returns:,} returns of the odd scans"
        rows.append(("explains", f"{explained}, which it was not built from"))
        error = score.median_range_error
        off = "–" if error != error else f"{error:.3f} m"
        details.append(("violated", f"{_share(score.violation)} of their beams go through a wall"))
        details.append(("error", f"{off}, the median of their ranges"))
    rows.append(("time", f"{figures['milliseconds_a_scan']:.2f} ms a scan"))
    details.append(("median", f"{figures['median_milliseconds_a_scan']:.2f} ms a scan"))
    return rows, details


def _share(value: float) -> str:
    return "–" if value != value else f"{100.0 * value:.1f} %"
