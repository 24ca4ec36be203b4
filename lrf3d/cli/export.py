"""``lrf3d export``: a run for other programs."""

from typing import Annotated

import typer

from lrf3d.cli.console import Report
from lrf3d.cli.options import Count, OutFile, RunArgument


def export(
    run: RunArgument,
    to: Annotated[str, typer.Option(metavar="FORMAT")],
    report: Report,
    out: OutFile = None,
    every: Count = 1,
) -> None:
    """Write a run for another program.

    carmen is a text log; mcap is a ROS 2 bag in one file, for Foxglove; rosbag2 is a ROS 2 bag as
    a folder, for ros2 bag play, rviz and slam_toolbox; glb is an animated 3D scene for Blender and
    web viewers: the world, the robot, its beams and its map as it grows.

    Options:
        to: The format: carmen, mcap, rosbag2 or glb.
        out: The file; in the run's folder if not given.
        every: Keep every n-th scan.
    """
    from lrf3d.io import load_run

    kept = load_run(run)

    from lrf3d.errors import InputError
    from lrf3d.exporting import EXPORTERS, export_run
    from lrf3d.files import make_folder

    if to not in EXPORTERS:
        raise InputError(f"--to {to}: expected one of {', '.join(EXPORTERS)}")
    folder = run if run.is_dir() else run.parent
    path = folder / EXPORTERS[to] if out is None else out
    make_folder(path.parent)
    export_run(kept, to, path, every=every)
    files = [path] if path.is_file() else sorted(path.iterdir())
    scans, size = len(range(0, len(kept), every)), sum(file.stat().st_size for file in files)
    report.print(
        {"file": str(path), "format": to, "scans": scans, "bytes": size},
        [(to, str(path)), ("scans", f"{scans:,}"), ("size", f"{size / 1e6:.1f} MB")],
    )
