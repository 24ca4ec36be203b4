"""``lrf3d slam``: poses and map of a recorded log, from its scans and its odometry."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lrf3d.cli import options
from lrf3d.cli.console import progress_bar, warn
from lrf3d.text import counted

if TYPE_CHECKING:
    from lrf3d.recorded import SolvedLog


def slam(
    context: typer.Context,
    log: Annotated[
        Path,
        typer.Argument(
            metavar="LOG", help="A CARMEN log (.log, .clf, .gz) or a ROS 2 bag (.mcap, .db3)."
        ),
    ],
    out: options.Out = None,
    relations: Annotated[
        Path | None,
        typer.Option(help="Score by known relative poses: lines a b dx dy dtheta of ODOM lines."),
    ] = None,
    key_distance: Annotated[
        float | None, typer.Option(help="Distance [m] from one key scan to the next; 0.5.")
    ] = None,
    largest_range: Annotated[
        float | None, typer.Option(help="CARMEN: readings [m] of this or more are no return.")
    ] = None,
    scan_topic: Annotated[
        str | None, typer.Option(help="Bags: topic of the scans; /scan if not given.")
    ] = None,
    json: options.Json = False,
) -> None:
    """Find the poses and the map of a recorded drive from its scans and its odometry.

    Loops are closed; the systematic errors of the wheels, and the lag of the laser behind them, are
    estimated.

    Writes run.npz, map.geojson, map.png, trajectory.tum and summary.json.
    """
    from lrf3d.cli.folder import results_folder
    from lrf3d.io import load_log, save_run
    from lrf3d.io.reading import CARMEN_ENDINGS
    from lrf3d.io.trajectory_files import load_relations, save_tum
    from lrf3d.mapping import save_map
    from lrf3d.recorded import solved_log
    from lrf3d.slam.front_end import KEY_DISTANCE

    known = None if relations is None else load_relations(relations)
    poses = "auto" if log.name.lower().endswith(CARMEN_ENDINGS) else "odom"
    drive = load_log(log, largest_range=largest_range, poses=poses, scan_topic=scan_topic)
    with progress_bar("scans") as progress:
        solved = solved_log(
            drive,
            key_distance=KEY_DISTANCE if key_distance is None else key_distance,
            relations=known,
            progress=progress,
        )
    summary = solved.summary()
    output = results_folder(context, [log], drive.name, out)
    for sentence in solved.solution.sentences():
        warn(sentence)
    files = {
        "run": output.path / "run.npz",
        "map": output.path / "map.geojson",
        "trajectory": output.path / "trajectory.tum",
    }
    save_run(solved.run, files["run"])
    save_map(solved.run.map, files["map"], free=solved.free_cells())
    save_tum(*solved.trajectory(), files["trajectory"])
    output.finish(
        summary,
        files,
        {"map picture": (output.path / "map.png", solved.draw)},
        rows=rows(solved),
        kept=f"{files['map']} holds the map",
        json=json,
    )


def rows(solved: "SolvedLog") -> list[tuple[str, str]]:
    """The figures of a solved log as a printed table."""
    summary, solution = solved.summary(), solved.solution
    log, wheels, slam = summary["log"], summary["wheels"], summary["slam"]
    scans = f"{counted(log['scans'], 'scan')} of {counted(log['beams'], 'beam')}"
    bad = counted(log["bad_lines"], "bad line")
    table = [("log", f"{scans}, {counted(log['odometry_lines'], 'pose')} by odometry, {bad}")]
    table += [("", f"first bad {line}") for line in solved.log.bad_lines[:1]]
    if log["readings_not_numbers"]:
        table.append(("", f"{counted(log['readings_not_numbers'], 'reading')} NaN: no return"))
    table += [("", sentence) for sentence in solution.repairs.sentences()]
    text = f"lag {wheels['lag_lines']:.2f} lines, turn {wheels['turn_rad_per_m']:+.4f} rad/m"
    table.append(("wheels", text))
    if wheels["solved_times"] > 1:
        turn, distance = 1.0 + wheels["turn_share"], 1.0 + wheels["way_share"]
        text = f"scans show {turn:.2f} times their turns and {distance:.2f} times their distances"
        table.append(("", f"{text}: solved {wheels['solved_times']} times to learn that"))
    closed = counted(slam["loop_closures"], "loop closure")
    if slam["loop_closures_dropped"]:
        closed += f", {slam['loop_closures_dropped']} more dropped"
    keys = counted(slam["key_scans"], "key scan")
    table.append(("drive", f"{slam['length_m']:.0f} m, {keys}, {closed}"))
    if slam["scans_by_odometry_alone"]:
        lost = counted(slam["scans_by_odometry_alone"], "scan")
        table.append(("", f"{lost} matched nothing: placed by odometry"))
    table.append(("map", solved.run.map.counts))
    table += [("", sentence) for sentence in solution.check.sentences()]
    if (score := solved.score) is not None:
        text = f"{score.translation_mean:.4f} ± {score.translation_std:.4f} m,"
        text += f" {score.rotation_mean:.2f} ± {score.rotation_std:.2f}° over {score.relations}"
        table.append(("relations", text))
    return [*table, ("time", f"{summary['milliseconds_a_scan']:.2f} ms a scan")]
