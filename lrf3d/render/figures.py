"""Figures: the world with a scan, and the map that was built, as in Fig. 5 and 7 of Teslić et al.

A run enters; a matplotlib figure leaves, and a picture file where a path is given.
"""

from collections.abc import Sequence
from pathlib import Path
from string import ascii_lowercase

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lrf3d.geometry import Float
from lrf3d.laser import LaserRangeFinder, LaserScan
from lrf3d.mapping import LineMap
from lrf3d.render.estimate_marks import draw_estimate
from lrf3d.render.marks import (
    PATH,
    PATH_WIDTH,
    WIDTH_UNDER,
    Colour,
    draw_objects,
    draw_points,
    draw_poses,
    draw_route,
    draw_scan,
    draw_walls,
)
from lrf3d.render.page import FAINT, INK, Frame, Page
from lrf3d.robot import EstimatedTrajectory
from lrf3d.run import Run
from lrf3d.scene.estimate import BELIEVED, TRUTH
from lrf3d.scene.look import ESTIMATE_COLOUR
from lrf3d.scene.structures import Sight
from lrf3d.text import counted
from lrf3d.world import World

UNDER_MAP = "#c3c8d0"
"""Colour of true walls under a map."""


def draw_world(
    world: World,
    path: str | Path | None = None,
    *,
    scan: LaserScan | None = None,
    lrf: LaserRangeFinder | None = None,
    route: Float | None = None,
    poses: Float | None = None,
) -> Figure:
    """Draw a world, and in it a scan with its robot, a route and poses (Fig. 5a).

    Args:
        world: The walls.
        path: Where to write the picture; nowhere if not given.
        scan: A scan to draw beam by beam, with the robot at its pose.
        lrf: The range finder; with it, beams that met nothing are drawn up to its range.
        route: (n, 2) way-points to join by a line.
        poses: (k, 3) poses; few are drawn as robots by name, many as a path.

    Raises:
        OutputError: The picture cannot be written.
    """
    way = np.empty((0, 2)) if route is None else np.asarray(route, dtype=np.float64)[:, :2]
    stops = np.empty((0, 3)) if poses is None else np.asarray(poses, dtype=np.float64)
    where = np.array([scan.pose]) if scan is not None else np.empty((0, 3))
    counts = f"{counted(len(world.segments), 'wall')} of {counted(world.object_count, 'object')}"
    world = Sight.of(world, np.vstack([way, stops[:, :2], where[:, :2]])).world
    frames = Frame.strips([_ends(world.segments), way, stops[:, :2], where[:, :2]])
    if scan is not None:
        counts += f"  ·  scan of {len(scan.ranges)} beams, {int(scan.hits.sum())} returns"
    page = Page(frames, title=(world.name or "world", counts))
    signs: list[Artist] = []
    for axes, frame in zip(page.axes, frames, strict=True):
        signs += draw_walls(axes, frame, world, np.vstack([where, stops]), INK, width=1.6)
        if len(way):
            signs.append(draw_route(axes, frame, way))
        if scan is not None:
            signs += draw_scan(axes, frame, scan, lrf)
        signs += draw_poses(axes, frame, stops if len(stops) else where)
    page.legend(signs)
    return page.save(path)


def draw_map(
    source: Run | LineMap,
    path: str | Path | None = None,
    *,
    points: Float | None = None,
    poses: Float | None = None,
    world: World | None = None,
    estimate: EstimatedTrajectory | None = None,
    title: str = "",
) -> Figure:
    """Draw a map, each object in its colour, over reflection points and true walls (Fig. 7).

    Args:
        source: A run, which brings all that follows along, or just a map.
        path: Where to write the picture; nowhere if not given.
        points: (n, 2) reflection points [m].
        poses: (k, 3) poses of the scans.
        world: The true walls.
        estimate: The estimated poses, with the loop closures.
        title: The headline; the world's name if not given.

    Raises:
        OutputError: The picture cannot be written.
    """
    if isinstance(source, Run):
        world, poses = Sight.of_run(source).world, source.trajectory.poses
        estimate = source.estimate
        points, line_map = _reflections(source), source.map
        objects = source.lasting_objects[-1] if source.maps else line_map.objects
    else:
        line_map, objects = source, np.unique(source.objects, return_inverse=True)[1]
    points = np.empty((0, 2)) if points is None else points
    poses = np.empty((0, 3)) if poses is None else poses
    walls = np.empty((0, 4)) if world is None else world.segments
    estimated = poses if estimate is None else estimate.poses
    places = [_ends(walls), poses[:, :2], estimated[:, :2], _bulk(points)]
    frames = Frame.strips([_ends(line_map.segments), *places])
    counts = [line_map.counts]
    counts += [counted(len(poses), "scan")] if len(poses) else []
    counts += [counted(len(points), "point")] if len(points) else []
    # Of a recorded drive the truth is not known: its poses are the estimate.
    trail: tuple[str, Colour, float] = "path", PATH, PATH_WIDTH
    if estimate is not None:
        counts.append(counted(len(estimate.closures), "loop closure"))
        known = not np.array_equal(poses, estimate.poses)
        trail = (TRUTH, PATH, WIDTH_UNDER) if known else (BELIEVED, ESTIMATE_COLOUR, PATH_WIDTH)
    name = title or (world.name if world is not None else "") or "map"
    page = Page(frames, title=(name, "  ·  ".join(counts)))
    signs: list[Artist] = []
    for axes, frame in zip(page.axes, frames, strict=True):
        if world is not None:
            signs += draw_walls(axes, frame, world, poses, UNDER_MAP, width=1.0)
        signs += draw_points(axes, frame, points)
        signs += draw_objects(axes, frame, line_map, objects)
        signs += draw_poses(axes, frame, poses, *trail)
        if estimate is not None:
            signs += draw_estimate(axes, frame, estimate)
    page.legend(signs)
    return page.save(path)


def draw_noise_levels(
    runs: Sequence[Run], sigmas: Sequence[float], path: str | Path | None = None
) -> Figure:
    """Draw the world with the first scan, and beside it the map at each σ [m] (Fig. 5a–d).

    Raises:
        OutputError: The picture cannot be written.
    """
    world, poses = Sight.of_run(runs[0]).world, runs[0].trajectory.poses
    clouds = [_reflections(run) for run in runs]
    maps = [_ends(run.map.segments) for run in runs]
    frame = Frame.around([_ends(world.segments), poses[:, :2], *maps, *map(_bulk, clouds)])
    page = Page([frame] * (len(runs) + 1))
    first = runs[0].true_scan(0)
    signs: list[Artist] = [*draw_walls(page.axes[0], frame, world, poses, INK, width=1.6)]
    signs += draw_scan(page.axes[0], frame, first, None)
    signs += draw_poses(page.axes[0], frame, poses)
    _head(
        page.axes[0],
        "a",
        "the world and the first scan",
        f"d$_{{max}}$ = {runs[0].lrf.range_max:g} m",
    )
    panels = zip(page.axes[1:], runs, clouds, sigmas, strict=True)
    for letter, (axes, run, cloud, sigma) in zip(ascii_lowercase[1:], panels, strict=False):
        signs += draw_walls(axes, frame, world, poses, UNDER_MAP, width=1.0)
        signs += draw_points(axes, frame, cloud)
        if run.maps:
            signs += draw_objects(axes, frame, run.map, run.lasting_objects[-1])
        draw_poses(axes, frame, poses)
        _head(axes, letter, f"σ = {sigma:g} m", run.map.counts)
    page.legend(signs)
    return page.save(path)


def _head(axes: Axes, letter: str, title: str, counts: str) -> None:
    axes.set_title(f"({letter})  {title}", loc="left", color=INK, fontsize=11, weight="bold")
    axes.set_title(counts, loc="right", color=FAINT, fontsize=9)


def _ends(segments: Float) -> Float:
    return segments.reshape(-1, 2)


def _bulk(points: Float) -> Float:
    """Corners of the box that holds all points (n, 2) but the outermost half percent a side."""
    return np.percentile(points, [0.5, 99.5], axis=0) if len(points) else points


def _reflections(run: Run) -> Float:
    """All measured points (n, 2) of a run."""
    return np.vstack([np.empty((0, 2)), *(scan.points() for scan in run.scans)])
