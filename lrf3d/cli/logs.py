"""``lrf3d map`` and ``lrf3d slam``: recorded logs, with known poses and with odometry alone."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from lrf3d.cli import options
from lrf3d.cli.console import Report, Rows
from lrf3d.text import counted

if TYPE_CHECKING:
    from lrf3d.io import LaserLog
    from lrf3d.recorded import MappedLog, SolvedLog

LogArgument = Annotated[Path, typer.Argument(metavar="LOG")]


def map_(
    context: typer.Context,
    log: LogArgument,
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

    from lrf3d.recorded import map_log

    with report.progress("scans") as progress:
        mapped = map_log(
            drive, mode=mode or "robust", sigma=sigma, all_scans=all_scans, progress=progress
        )
    _finish(context, report, log, out, mapped, {})


def slam(
    context: typer.Context,
    log: LogArgument,
    report: Report,
    out: options.Out = None,
    relations: Path | None = None,
    key_distance: float | None = None,
    largest_range: options.LargestRange = None,
    scan_topic: options.ScanTopic = None,
) -> None:
    """Find poses and map of a log from odometry and scans.

    Loops are closed; the systematic errors of the wheels, and the lag of the laser behind them, are
    estimated.

    Writes run.npz, map.geojson, map.png, trajectory.tum and summary.json.

    Options:
        log: A CARMEN log (.log, .clf, .gz) or a ROS 2 bag (.mcap, .db3).
        relations: Score by known relative poses: lines a b dx dy dtheta of ODOM lines.
        key_distance: Distance [m] from one key scan to the next; 0.5 if not given.
    """
    from lrf3d.io.reading import CARMEN_ENDINGS, load_log

    poses = "auto" if log.name.lower().endswith(CARMEN_ENDINGS) else "odom"
    # A log that cannot be read is reported before the rest is imported.
    drive = load_log(log, largest_range=largest_range, poses=poses, scan_topic=scan_topic)

    from lrf3d.io import save_run
    from lrf3d.io.trajectory_files import load_relations, save_tum
    from lrf3d.recorded import solved_log

    known = None if relations is None else load_relations(relations)
    chosen = {} if key_distance is None else {"key_distance": key_distance}
    with report.progress("scans") as progress:
        solved = solved_log(drive, relations=known, progress=progress, **chosen)
    files: dict[str, tuple[str, Any]] = {
        "run": ("run.npz", lambda path: save_run(solved.run, path)),
        "trajectory": ("trajectory.tum", lambda path: save_tum(*solved.trajectory(), path)),
    }
    _finish(context, report, log, out, solved, files)


def _finish(
    context: typer.Context,
    report: Report,
    path: Path,
    out: Path | None,
    done: "MappedLog | SolvedLog",
    files: dict[str, tuple[str, Any]],
) -> None:
    """Write the results of a log, and print them."""
    from lrf3d.cli.console import warn
    from lrf3d.cli.folder import results_folder
    from lrf3d.mapping import save_map
    from lrf3d.recorded import SolvedLog

    output = results_folder(context, report, [path], done.log.name, out)
    solved = isinstance(done, SolvedLog)
    rows, details = _slam_rows(done) if isinstance(done, SolvedLog) else _map_rows(done)
    for sentence in done.solution.sentences() if isinstance(done, SolvedLog) else ():
        warn(sentence)
    save_map(done.map, output.path / "map.geojson", free=done.free_cells())
    for name, save in files.values():
        save(output.path / name)
    output.finish(
        done.summary(),
        {"map": "map.geojson", **{kind: name for kind, (name, _) in files.items()}},
        {"map picture": ("map.png", done.draw)},
        rows=rows,
        details=details,
        following=f"lrf3d view {output.path}" if solved else f"lrf3d run {output.path}/map.geojson",
        kept=f"{output.path / 'map.geojson'} holds the map",
    )


def _log_rows(log: "LaserLog", text: str) -> list[tuple[str, str]]:
    """What a log held, and what was left out of it."""
    rows = [("log", text)]
    if log.bad_count:
        bad = counted(log.bad_count, f"bad {log.bad_lines[0].kind}")
        rows.append(("", f"{bad} left out, the first {log.bad_lines[0]}"))
        rows += [("", str(line)) for line in log.bad_lines[1:]]
    if log.not_numbers:
        rows.append(("", f"{counted(log.not_numbers, 'reading')} NaN: no return"))
    return rows


def _map_rows(mapped: "MappedLog") -> tuple[Rows, Rows]:
    """The figures of a mapped log as a table, and more of them."""
    log, score, figures = mapped.log, mapped.score, mapped.summary()
    text = f"{counted(len(log), 'scan')} of {counted(len(log.scans[0].ranges), 'beam')}"
    rows = [*_log_rows(log, text), ("poses", log.source)]
    rows.append(("map", f"{mapped.map.counts}, {score.length:.0f} m long"))
    details = [("median", f"{figures['median_milliseconds_a_scan']:.2f} ms a scan")]
    if score.returns:
        explained = f"{_share(score.explained)} of the {score.returns:,} returns of the odd scans"
        rows.append(("explains", f"{explained}, which it was not built from"))
        error = score.median_range_error
        off = "–" if error != error else f"{error:.3f} m"
        details.append(("violated", f"{_share(score.violation)} of their beams go through a wall"))
        details.append(("error", f"{off}, the median of their ranges"))
    return [*rows, ("time", f"{figures['milliseconds_a_scan']:.2f} ms a scan")], details


def _share(value: float) -> str:
    return "–" if value != value else f"{100.0 * value:.1f} %"


def _slam_rows(solved: "SolvedLog") -> tuple[Rows, Rows]:
    """The figures of a solved log as a table, and more of them."""
    summary, solution = solved.summary(), solved.solution
    log, slam, wheels = summary["log"], summary["slam"], summary["wheels"]
    scans = f"{counted(log['scans'], 'scan')} of {counted(log['beams'], 'beam')}"
    poses = counted(log["odometry_lines"], "pose")
    rows = _log_rows(solved.log, f"{scans}, {poses} by odometry")
    rows += [("", sentence) for sentence in solution.repairs.sentences()]
    closed = counted(slam["loop_closures"], "loop closure")
    rows.append(("drive", f"{slam['length_m']:.0f} m, {closed}"))
    if slam["scans_by_odometry_alone"]:
        lost = counted(slam["scans_by_odometry_alone"], "scan")
        rows.append(("", f"{lost} matched nothing: placed by odometry"))
    rows.append(("map", solved.map.counts))
    rows += [("check", sentence) for sentence in solution.check.sentences()]
    if (score := solved.score) is not None:
        text = f"{score.translation_mean:.4f} ± {score.translation_std:.4f} m,"
        text += f" {score.rotation_mean:.2f} ± {score.rotation_std:.2f}° over {score.relations}"
        rows.append(("relations", text))
    rows.append(("time", f"{summary['milliseconds_a_scan']:.2f} ms a scan"))
    turn, distance = 1.0 + wheels["turn_share"], 1.0 + wheels["way_share"]
    dropped = counted(slam["loop_closures_dropped"], "more loop closure")
    return rows, [
        ("keys", f"{counted(slam['key_scans'], 'key scan')}; {dropped} dropped"),
        ("wheels", f"lag {wheels['lag_lines']:.2f} lines, turn {wheels['turn_rad_per_m']:+.4f}"
                   f" rad/m, {turn:.3f} times the turns, {distance:.3f} times the distances"),
        ("", f"solved {counted(wheels['solved_times'], 'time')} to learn that"),
    ]  # fmt: skip
