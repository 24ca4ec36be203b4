"""``lrf3d score``: somebody else's trajectory and map of a run, against the truth."""

from argparse import Namespace
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.apps.cli.console import Console
from lrf3d.apps.cli.folder import draw_figure, results_folder
from lrf3d.base.errors import InputError
from lrf3d.geometry.lines import Float
from lrf3d.geometry.pose import Pose, compose
from lrf3d.mapping import LineMap, load_map
from lrf3d.recordings.formats.trajectory import load_tum
from lrf3d.robot import EstimatedTrajectory, Trajectory
from lrf3d.scoring.map_score import drawn_part, judged_part, score_map, visible_walls
from lrf3d.scoring.trajectory_score import PoseErrors, pose_errors
from lrf3d.simulation.run import Run
from lrf3d.world import World, load_world
from lrf3d.world.pieces import joined_objects


def score(run: Run, args: Namespace, console: Console) -> None:
    """Score an estimated trajectory of a run, and its map."""
    if args.trajectory is None:
        raise InputError("--trajectory: not given; a TUM file with lines t x y z qx qy qz qw")
    if not run.knows_truth:
        raise InputError(f"{args.run}: a recorded drive, whose true trajectory is not known")
    estimate = load_tum(args.trajectory)
    errors = pose_errors(run.trajectory, estimate)
    path = Path(args.run).resolve()
    name = path.parent.name if path.name == "run.npz" else path.stem
    output = results_folder(args, console, [args.run, args.trajectory], f"{name}_score")
    figures: dict[str, Any] = {"name": run.world.name, "trajectory": errors.as_dict()}
    line_map = LineMap.empty()
    if args.map is not None:
        line_map = _moved_map(args.map, errors.alignment)
        walls, numbers = visible_walls(judged_part(run))
        objects = joined_objects(run.world)[numbers]
        found = score_map(line_map, walls, objects, walls=run.world.segments)
        figures["map"] = found.as_dict()
    aligned = with_trajectory(run, estimate, errors.alignment)
    draw = partial(
        draw_figure, "map", line_map, poses=run.trajectory.poses, world=run.world,
        points=np.vstack([scan.points() for scan in drawn_part(run).scans]),
        estimate=aligned.estimate, title=f"{run.world.name}: {Path(args.trajectory).name}",
    )  # fmt: skip
    output.finish(
        figures,
        {},
        {"score picture": ("score.png", draw)},
        rows=_score_rows(errors, figures),
        following=["render", args.run, "--trajectory", args.trajectory],
        kept=f"{output.path / 'summary.json'} holds the figures",
    )


def with_trajectory(run: Run, estimate: Trajectory, alignment: Pose | None = None) -> Run:
    """A run with somebody's estimate of its trajectory, aligned with the true one."""
    if alignment is None:
        alignment = pose_errors(run.trajectory, estimate).alignment
    poses = compose(np.array(alignment), estimate.at(run.trajectory.times))
    poses[:, 2] = np.unwrap(poses[:, 2])
    return replace(run, estimate=EstimatedTrajectory(poses))


def _moved_map(path: Path, pose: Pose) -> LineMap:
    """A map of lrf3d, or the walls of any file of a world, in the frame that has this pose."""
    found: LineMap | World | None = None
    if str(path).lower().endswith(".geojson"):
        with suppress(InputError):
            found = load_map(path)
    found = load_world(path) if found is None else found
    ends: Float = pose.apply(found.segments.reshape(-1, 2)).reshape(-1, 4)
    return LineMap(ends, found.objects, np.full(len(ends), 2))


def _score_rows(errors: PoseErrors, figures: dict[str, Any]) -> list[tuple[str, str]]:
    trajectory = figures["trajectory"]
    matched, count = errors.matched
    how = "between whose stamps the truth is interpolated" if errors.interpolated else "by stamps"
    absolute = trajectory["ape_m"]
    rows = [
        ("poses", f"{matched:,} of {count:,} matched, {how}"),
        ("absolute", f"{absolute['rmse']:.4f} m RMSE, {absolute['max']:.4f} m at most"),
        (
            "relative",
            f"{trajectory['rpe_m']['rmse']:.4f} m RMSE, {trajectory['rpe_deg']['rmse']:.3f}° RMSE",
        ),
    ]
    plain = trajectory["ape_unaligned_m"]["rmse"]
    # Errors that are this many times larger without the alignment are those of another frame.
    far_off = 3.0
    if plain > far_off * max(absolute["rmse"], 0.01):
        x, y, theta = errors.alignment
        moved = f"({x:.2f} m, {y:.2f} m, {np.degrees(theta):.1f}°)"
        rows.append(("frame", f"another than the run's, which is {moved} off: {plain:.2f} m RMSE"))
    if "map" in figures:
        found = figures["map"]
        shares = f"F1 of lengths {found['length_f1']:.3f}, of segments {found['segment_f1']:.3f}"
        rows.append(("map", shares))
    return rows
