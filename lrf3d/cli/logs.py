"""``lrf3d map`` and ``lrf3d slam``: recorded logs, with known poses and with odometry alone."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from lrf3d.cli import options
from lrf3d.cli.console import Report
from lrf3d.progress import Progress
from lrf3d.text import counted

if TYPE_CHECKING:
    from lrf3d.io import LaserLog
    from lrf3d.recorded import SolvedLog
    from lrf3d.run import Run

LogArgument = Annotated[Path, typer.Argument(metavar="LOG")]


def map_(
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
    from lrf3d.scoring import score_log

    settings: dict[str, Any] = {"mode": mode or "robust", "sigma": sigma}
    with report.progress("scans") as progress:
        progress, milliseconds = _timed(progress)
        run = map_log(drive, **settings, all_scans=all_scans, progress=progress)
    score = score_log(run.map, [] if all_scans else drive.scans[1::2])
    bad = [{line.kind: line.number, "reason": line.reason} for line in drive.bad_lines]
    summary = {
        "name": drive.name,
        "mode": settings["mode"],
        "sigma_m": sigma,
        "log": {**drive.counts, "poses": drive.source, "first_bad_lines": bad},
        "map": {"segments": len(run.map), "objects": run.map.object_count},
        "score": score.as_dict(),
        "milliseconds_a_scan": milliseconds(),
    }
    rows = [*_log_rows(drive), ("poses", drive.source)]
    rows.append(("map", f"{run.map.counts}, {score.length:.0f} m long"))
    if score.returns:
        share = f"{100.0 * score.explained:.1f} % of the {score.returns:,} returns of the odd scans"
        rows.append(("explains", f"{share}, which it was not built from"))
    rows.append(("time", f"{milliseconds():.2f} ms a scan"))
    _finish(report, log, out, run, range(len(run)), summary, rows, "run {}/map.geojson", {})


def slam(
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
    from lrf3d.io.reading import load_log, odometry_of

    # A log that cannot be read is reported before the rest is imported.
    poses = odometry_of(log)
    drive = load_log(log, largest_range=largest_range, poses=poses, scan_topic=scan_topic)

    from lrf3d.cli.console import warn
    from lrf3d.io import save_run
    from lrf3d.io.trajectory_files import load_relations, save_tum
    from lrf3d.recorded import solve_log
    from lrf3d.scoring import score_trajectory

    known = None if relations is None else load_relations(relations)
    chosen = {} if key_distance is None else {"key_distance": key_distance}
    with report.progress("scans") as progress:
        progress, milliseconds = _timed(progress)
        solved = solve_log(drive, progress=progress, **chosen)
    score = None if known is None else score_trajectory(solved.line_poses, known).as_dict()
    for sentence in solved.warnings:
        warn(sentence)
    run, times = solved.run, drive.odometry.times
    summary = {**solved.summary(), "score": score, "milliseconds_a_scan": milliseconds()}
    _finish(
        report, log, out, run, solved.slam.key_scans.tolist(),
        summary, _slam_rows(solved, summary), "view {}",
        {
            "run.npz": lambda path: save_run(run, path),
            "trajectory.tum": lambda path: save_tum(times, solved.line_poses, path),
        },
    )  # fmt: skip


def _timed(progress: Progress) -> tuple[Progress, Callable[[], float]]:
    """Progress that is timed, and the mean time of a scan [ms] after the first, which compiles."""
    stamps: list[float] = []

    def note(done: int, count: int) -> None:
        stamps.append(perf_counter())
        progress(done, count)

    return note, lambda: 1e3 * (stamps[-1] - stamps[0]) / max(len(stamps) - 1, 1)


def _finish(
    report: Report,
    path: Path,
    out: Path | None,
    run: "Run",
    mapped: Sequence[int],
    summary: dict[str, Any],
    rows: list[tuple[str, str]],
    following: str,
    files: Mapping[str, Callable[[Path], None]],
) -> None:
    """Write the map of a drive, which some of its scans made, and other results, and print them."""
    import numpy as np

    from lrf3d.cli.folder import results_folder
    from lrf3d.laser.free_space import distinct_poses, free_cells
    from lrf3d.mapping import save_map

    scans = [run.scan(number) for number in mapped]
    distinct = distinct_poses(run.trajectory.poses[mapped])

    def draw(picture: Path) -> None:
        from lrf3d.render.figures import draw_map

        draw_map(
            run.map, picture, points=np.vstack([scan.points() for scan in scans]),
            poses=run.trajectory.poses, estimate=run.estimate, title=run.world.name,
        )  # fmt: skip

    output = results_folder(report, [path], run.world.name, out)
    save_map(run.map, output.path / "map.geojson", free=free_cells([scans[k] for k in distinct]))
    for name, save in files.items():
        save(output.path / name)
    output.finish(
        summary,
        {"map": "map.geojson", **{name.split(".")[0]: name for name in files}},
        {"map picture": ("map.png", draw)},
        rows=rows,
        following=f"lrf3d {following.format(output.path)}",
        kept=f"{output.path / 'map.geojson'} holds the map",
    )


def _log_rows(log: "LaserLog", poses: str = "") -> list[tuple[str, str]]:
    """What a log held, and what was left out of it."""
    beams = counted(len(log.scans[0].ranges), "beam")
    rows = [("log", f"{counted(len(log), 'scan')} of {beams}{poses}")]
    if log.bad_count:
        bad = counted(log.bad_count, f"bad {log.bad_lines[0].kind}")
        rows.append(("", f"{bad} left out, the first {log.bad_lines[0]}"))
        rows += [("", str(line)) for line in log.bad_lines[1:]]
    if log.not_numbers:
        rows.append(("", f"{counted(log.not_numbers, 'reading')} NaN: no return"))
    return rows


def _slam_rows(solved: "SolvedLog", summary: dict[str, Any]) -> list[tuple[str, str]]:
    """What most users ask of a solved log, as a table."""
    poses = counted(summary["log"]["odometry_lines"], "pose")
    rows = _log_rows(solved.log, f", {poses} by odometry")
    rows += [("", sentence) for sentence in solved.repairs.sentences()]
    closed = counted(summary["slam"]["loop_closures"], "loop closure")
    rows.append(("drive", f"{summary['slam']['length_m']:.0f} m, {closed}"))
    if lost := summary["slam"]["scans_by_odometry_alone"]:
        rows.append(("", f"{counted(lost, 'scan')} matched nothing: placed by odometry"))
    rows.append(("map", solved.run.map.counts))
    rows += [("check", sentence) for sentence in solved.check.sentences()]
    if score := summary["score"]:
        text = "{translation_mean:.4f} ± {translation_std:.4f} m, {rotation_mean:.2f} ±"
        text += " {rotation_std:.2f}° over {relations}"
        rows.append(("relations", text.format(**score)))
    return [*rows, ("time", f"{summary['milliseconds_a_scan']:.2f} ms a scan")]
