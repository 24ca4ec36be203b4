"""``lrf3d slam``: poses and map of a recorded log, from its scans and its odometry."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lrf3d.cli import options
from lrf3d.cli.console import Report
from lrf3d.text import counted

if TYPE_CHECKING:
    from lrf3d.recorded import SolvedLog


def slam(
    context: typer.Context,
    log: Annotated[Path, typer.Argument(metavar="LOG")],
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

    from lrf3d.cli.console import warn
    from lrf3d.cli.folder import results_folder
    from lrf3d.io import save_run
    from lrf3d.io.trajectory_files import load_relations, save_tum
    from lrf3d.mapping import save_map
    from lrf3d.recorded import solved_log

    known = None if relations is None else load_relations(relations)
    chosen = {} if key_distance is None else {"key_distance": key_distance}
    with report.progress("scans") as progress:
        solved = solved_log(drive, relations=known, progress=progress, **chosen)
    output = results_folder(context, report, [log], drive.name, out)
    for sentence in solved.solution.sentences():
        warn(sentence)
    files = {"run": "run.npz", "map": "map.geojson", "trajectory": "trajectory.tum"}
    save_run(solved.run, output.path / files["run"])
    save_map(solved.run.map, output.path / files["map"], free=solved.free_cells())
    save_tum(*solved.trajectory(), output.path / files["trajectory"])
    rows, details = rows_of(solved)
    output.finish(
        solved.summary(),
        files,
        {"map picture": ("map.png", solved.draw)},
        rows=rows,
        details=details,
        following=f"lrf3d view {output.path}",
        kept=f"{output.path / files['map']} holds the map",
    )


def rows_of(solved: "SolvedLog") -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """The figures of a solved log as a table, and more of them."""
    summary, solution = solved.summary(), solved.solution
    log, wheels, slam = summary["log"], summary["wheels"], summary["slam"]
    scans = f"{counted(log['scans'], 'scan')} of {counted(log['beams'], 'beam')}"
    rows = [("log", f"{scans}, {counted(log['odometry_lines'], 'pose')} by odometry")]
    if log["bad_lines"]:
        bad = counted(log["bad_lines"], "bad line")
        rows.append(("", f"{bad} left out, the first {solved.log.bad_lines[0]}"))
    if log["readings_not_numbers"]:
        rows.append(("", f"{counted(log['readings_not_numbers'], 'reading')} NaN: no return"))
    rows += [("", sentence) for sentence in solution.repairs.sentences()]
    closed = counted(slam["loop_closures"], "loop closure")
    rows.append(("drive", f"{slam['length_m']:.0f} m, {closed}"))
    if slam["scans_by_odometry_alone"]:
        lost = counted(slam["scans_by_odometry_alone"], "scan")
        rows.append(("", f"{lost} matched nothing: placed by odometry"))
    rows.append(("map", solved.run.map.counts))
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
