"""Plots of worlds, maps, scans and trajectories on matplotlib axes, in world coordinates [m].

Each function draws on the axes that it is given, or on those of a new figure, and returns them.
Several plots on the same axes lie over each other; the view grows to show them all, unless its
limits were set by hand. A metre is as long in x as in y. Marks and colours are those of the figures
of `lrf3d run`.

Examples:
    >>> import lrf3d
    >>> from matplotlib.figure import Figure
    >>> room = lrf3d.load_world("paper_room")
    >>> run = lrf3d.simulate(room, [(1, 1, 0), (2, 1, 0)], rng=0)
    >>> figure = Figure()
    >>> axes = figure.add_subplot()
    >>> axes = lrf3d.plot.world(room, axes)
    >>> axes = lrf3d.plot.scan(run.scan(1), axes)
    >>> axes = lrf3d.plot.map(run.map, axes)
    >>> figure.savefig("room.png")
"""

from collections.abc import Callable
from io import BytesIO
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserRangeFinder, LaserScan
from lrf3d.mapping import LineMap
from lrf3d.render.figures import UNDER_MAP
from lrf3d.render.marks import draw_objects, draw_poses, draw_scan, draw_walls
from lrf3d.render.page import FAINT, INK, MARGIN, Frame, dress, plain
from lrf3d.robot import Trajectory
from lrf3d.run import Run
from lrf3d.scene.structures import Sight
from lrf3d.world import World

__all__ = ["map", "png", "run", "scan", "trajectory", "world"]

FIGURE = 6.4
"""Width of a new figure [inches]: that of matplotlib's own."""

SMALL = 4.8
"""The longer side of the picture of a value in a notebook [inches]: its text stays readable, and
a notebook of twenty of them stays under a megabyte."""

DOTS_PER_INCH = 100
"""Resolution of the picture of a value in a notebook."""


def world(world: World, ax: Axes | None = None, *, poses: Float | None = None) -> Axes:
    """Plot the walls of a world; what they enclose is filled.

    Args:
        world: The world.
        ax: The axes to draw on; those of a new figure if not given.
        poses: (k, 3) poses of robots: what encloses one of them is a room, and stays white.
    """
    robots = np.empty((0, 3)) if poses is None else np.asarray(poses, dtype=np.float64)

    def draw(ax: Axes, frame: Frame) -> None:
        draw_walls(ax, frame, world, robots, INK, width=1.2)

    return _drawn(draw, ax, _ends(world.segments))


def map(line_map: LineMap, ax: Axes | None = None, *, objects: Int | None = None) -> Axes:
    """Plot the segments of a map, a colour for each object; few objects are named G1, G2, ….

    Args:
        line_map: The map.
        ax: The axes to draw on; those of a new figure if not given.
        objects: (m,) numbers of the segments' objects that choose the colours, such as
            ``run.lasting_objects[-1]``, which are those of films; the map's own if not given.
    """
    if objects is None:
        objects = np.unique(line_map.objects, return_inverse=True)[1]
    numbers = objects

    def draw(ax: Axes, frame: Frame) -> None:
        draw_objects(ax, frame, line_map, numbers)

    return _drawn(draw, ax, _ends(line_map.segments))


def scan(scan: LaserScan, ax: Axes | None = None, *, lrf: LaserRangeFinder | None = None) -> Axes:
    """Plot the beams and returns of a scan, and the robot at its pose.

    Args:
        scan: The scan.
        ax: The axes to draw on; those of a new figure if not given.
        lrf: The range finder; with it, beams that met nothing are drawn up to its range.
    """
    pose = np.array([scan.pose])

    def draw(ax: Axes, frame: Frame) -> None:
        draw_scan(ax, frame, scan, lrf)
        draw_poses(ax, frame, pose)

    return _drawn(draw, ax, pose[:, :2], scan.points())


def trajectory(trajectory: Trajectory | Float, ax: Axes | None = None) -> Axes:
    """Plot a drive: few poses as robots, many as a path with the robot at its end.

    Args:
        trajectory: The drive, or its poses (k, 3).
        ax: The axes to draw on; those of a new figure if not given.
    """
    known = trajectory.poses if isinstance(trajectory, Trajectory) else trajectory
    poses = np.asarray(known, dtype=np.float64)

    def draw(ax: Axes, frame: Frame) -> None:
        draw_poses(ax, frame, poses)

    return _drawn(draw, ax, poses[:, :2])


def run(run: Run, ax: Axes | None = None) -> Axes:
    """Plot a run: its map and the robot's way, over the true walls.

    Args:
        run: The run.
        ax: The axes to draw on; those of a new figure if not given.
    """
    poses, near = run.trajectory.poses, Sight.of_run(run).world

    def draw(ax: Axes, frame: Frame) -> None:
        draw_walls(ax, frame, near, poses, UNDER_MAP, width=1.0)
        if run.maps:
            draw_objects(ax, frame, run.map, run.lasting_objects[-1])
        draw_poses(ax, frame, poses)

    return _drawn(draw, ax, _ends(near.segments), poses[:, :2], _ends(run.map.segments))


def png(value: World | LineMap | LaserScan | Run) -> bytes:
    """A small picture of a value as a PNG file, which notebooks show for it.

    It needs no display, and leaves pyplot's figures alone.
    """
    draw = next(function for kind, function in _PLOTS.items() if isinstance(value, kind))
    figure = Figure(dpi=DOTS_PER_INCH, facecolor="white")
    FigureCanvasAgg(figure)
    ax = draw(value, _dressed(figure.add_axes((0.0, 0.0, 1.0, 1.0))))
    frame = Frame.whole([ax.dataLim.get_points()] if ax.has_data() else [])
    ax.set(xlim=(frame.low[0], frame.high[0]), ylim=(frame.low[1], frame.high[1]))
    figure.set_size_inches(SMALL * frame.size / frame.size.max())
    ax.set_title(fill(plain(repr(value)), 72), loc="left", color=FAINT, fontsize=7)
    file = BytesIO()
    figure.savefig(file, format="png", bbox_inches="tight", pad_inches=0.08)
    return file.getvalue()


_PLOTS: dict[type, Callable[..., Any]] = {World: world, LineMap: map, LaserScan: scan, Run: run}
"""What draws the picture of a value, by its type."""


def _drawn(draw: Callable[[Axes, Frame], None], ax: Axes | None, *places: Float) -> Axes:
    """The axes, with a mark drawn on them that takes these places (n, 2) [m]."""
    if ax is None:
        ax = _dressed(pyplot.figure(figsize=(FIGURE, 0.75 * FIGURE)).add_subplot())
    before = [ax.dataLim.get_points()] if ax.has_data() else []
    if not before:
        ax.set_aspect("equal", adjustable="datalim")
    # Robots are drawn in proportion to all that is on the axes.
    draw(ax, Frame.whole([*places, *before]))
    ax.autoscale_view()
    return ax


def _dressed(axes: Axes) -> Axes:
    """New axes in metres, in the look of all figures."""
    dress(axes)
    axes.margins(MARGIN)
    for axis, name in ((axes.xaxis, "x"), (axes.yaxis, "y")):
        axis.set_label_text(f"{name} [m]", color=FAINT, fontsize=9)
    return axes


def _ends(segments: Float) -> Float:
    return segments.reshape(-1, 2)
