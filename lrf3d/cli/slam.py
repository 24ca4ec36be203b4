"""``lrf3d slam``: poses and map of a recorded log, from its scans and its odometry."""

from pathlib import Path
from typing import Annotated

import typer

from lrf3d.cli import options
from lrf3d.cli.console import progress_bar, warn


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
    from functools import partial

    from lrf3d.cli.folder import results_folder
    from lrf3d.io import load_log, save_run
    from lrf3d.io.reading import CARMEN_ENDINGS
    from lrf3d.io.trajectory_files import load_relations, save_tum
    from lrf3d.log_slam import draw_slam_log, slam_log
    from lrf3d.mapping import save_map
    from lrf3d.slam.front_end import KEY_DISTANCE

    known = None if relations is None else load_relations(relations)
    poses = "auto" if log.name.lower().endswith(CARMEN_ENDINGS) else "odom"
    drive = load_log(log, largest_range=largest_range, poses=poses, scan_topic=scan_topic)
    output = results_folder(context, [log], drive.name, out)
    with progress_bar("scans") as progress:
        solved = slam_log(
            drive,
            key_distance=KEY_DISTANCE if key_distance is None else key_distance,
            relations=known,
            progress=progress,
        )
    for sentence in solved.solution.check.sentences():
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
        solved.summary(),
        files,
        {"map picture": (output.path / "map.png", partial(draw_slam_log, solved))},
        rows=solved.rows(),
        kept=f"{files['map']} holds the map",
        json=json,
    )
