"""How far is the trajectory of SLAM off, online and finished, and what does it cost?

A recorded log with relations, or a simulated drive whose truth is known, is solved at several
distances between key scans: online, as a robot would, and with the final refinement.
"""

import time
from pathlib import Path
from typing import Annotated

import numpy as np

import lrf3d
from benchmarks.report import Figure, Report, Row, scatter
from lrf3d.geometry.lines import Float
from lrf3d.scoring.trajectory_score import Relations, score_trajectory
from lrf3d.slam import Slam
from lrf3d.slam.offline import solve_log
from lrf3d.slam.places import odometry_increments

WORLD = "corridor"
"""The world of the simulated drive: there and back, and there again."""

APART = (1, 10, 100)
"""How many scans the ends of the relations of a simulated drive lie apart, as in those of Kümmerle
et al.: some from one scan to the next, some to where the robot comes by again."""


def bench(
    *,
    log: Annotated[Path | None, "A recorded log; else a simulated drive."] = None,
    relations: Annotated[Path | None, "Relations of the log: lines a b dx dy dtheta."] = None,
    scans: Annotated[int, "Scans of the simulated drive."] = 900,
    spacings: Annotated[str, "Distances between key scans [m]."] = "0.25,0.5,1",
    figure: Figure = None,
) -> Report:
    """Solve a drive by SLAM: how far off it is, online and finished, and how long it takes."""
    from lrf3d.base.errors import InputError

    if (log is None) != (relations is None):
        raise InputError("--log and --relations: the one needs the other; give both or none")
    metres = [float(part) for part in spacings.split(",") if part.replace(".", "", 1).isdecimal()]
    if len(metres) != len(spacings.split(",")) or not min(metres, default=0.0) > 0.0:
        raise InputError(f"--spacings {spacings}: expected distances in metres, such as 0.25,0.5")
    report = Report(__doc__.splitlines()[0])
    if log is not None and relations is not None:
        recorded(report, log, relations)
    else:
        for spacing in metres:
            simulated(report, spacing, scans)
    if figure is not None:
        labels = "time [s]", "mean error of the translation [m]"
        scatter(figure, report.tables["slam"], "solve_s", "error_m", "step", labels, "drive")
    return report


def recorded(report: Report, log: Path, relations: Path) -> None:
    """A log, solved as ``lrf3d slam`` does."""
    from lrf3d.recordings.formats.trajectory import load_relations

    begin = time.process_time()
    poses = solve_log(log).line_poses
    spent = time.process_time() - begin
    figures = score(poses, load_relations(relations))
    report.add("slam", drive=log.name, step="finished", solve_s=spent, **figures)


def simulated(report: Report, spacing: float, scans: int) -> None:
    """A drive through a built-in world, with wheels that slip and drift."""
    run = lrf3d.load_scenario(WORLD).run(rng=0, scans=scans, mapper={"mode": "paper"}, snapshots=1)
    true, rng = run.trajectory.poses, np.random.default_rng(0)
    errors = lrf3d.WheelOdometry(turn_per_metre=0.03)
    increments = [errors(step, rng) for step in odometry_increments(true)]
    first, second = np.hstack([[np.arange(len(true) - apart), np.arange(apart, len(true))]
                               for apart in APART])  # fmt: skip
    known = np.array([lrf3d.Pose(*true[a]).inverse() @ lrf3d.Pose(*true[b])
                      for a, b in zip(first, second, strict=True)])  # fmt: skip
    relations = Relations(first, second, known, np.ones(len(first), np.bool_))
    slam = Slam(key_distance=spacing)
    begin = time.process_time()
    for number, scan in enumerate(run.scans):
        slam.update(scan, increments[number - 1] if number else (0.0, 0.0, 0.0))
    spent = time.process_time() - begin
    name = f"{WORLD}, {spacing:g} m"
    report.add("slam", drive=name, step="online", solve_s=spent,
               **score(np.asarray(slam.trajectory()), relations))  # fmt: skip
    begin = time.process_time()
    slam.finish()
    spent += time.process_time() - begin
    report.add("slam", drive=name, step="finished", solve_s=spent,
               **score(np.asarray(slam.trajectory()), relations))  # fmt: skip


def score(poses: Float, relations: Relations) -> Row:
    """Errors of poses against relations."""
    found = score_trajectory(poses, relations)
    return {"error_m": found.translation_mean, "std_m": found.translation_std,
            "rotation_deg": found.rotation_mean}  # fmt: skip
