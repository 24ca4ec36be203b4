"""Plots of values on matplotlib axes: the functions of :mod:`lrf3d.plot`."""

from __future__ import annotations

from collections.abc import Callable
from io import BytesIO
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cbook import normalize_kwargs
from matplotlib.collections import LineCollection, PathCollection, PolyCollection
from matplotlib.lines import Line2D
from matplotlib.markers import MarkerStyle
from matplotlib.path import Path
from matplotlib.patheffects import withStroke
from matplotlib.transforms import Affine2D
from shapely.plotting import patch_from_polygon

from lrf3d.base.errors import InputError, expect
from lrf3d.geometry.lines import ROUNDING, Float, Int, lengths, numbers
from lrf3d.laser import LaserRangeFinder, LaserScan, reflection_points
from lrf3d.mapping import LineMap
from lrf3d.mapping.tints import object_tints
from lrf3d.robot import EstimatedTrajectory, Trajectory
from lrf3d.simulation.run import Run
from lrf3d.studio.figures.sheet import DOT, FAINT, HAIRLINE, INK, LINE, PAD, dressed, plain, sheet
from lrf3d.studio.scene.look import DART, ESTIMATE_FADED
from lrf3d.studio.scene.marks import TRUTH, believed, kept_ellipses, outlines
from lrf3d.studio.scene.stage.structures import Sight, enclosed_areas
from lrf3d.world import World

__all__ = ["estimate", "map", "png", "points", "run", "scan", "trajectory", "world"]

# Colour of what walls enclose.
INSIDE = "#eef0f3"

# Colour of returns.
POINT = "#6f7986"

# How true walls are drawn under a map.
BELOW: dict[str, Any] = {"color": "#c3c8d0", "linewidth": 1.0}

# Colour of beams.
BEAM = "#f2a03d"

# Colour of the returns of a scan, and of loop closures that were dropped.
HIT = "#d6361f"

# Colour of the robot's path.
PATH = "#2f6fb3"

# Colour of an estimated path.
ESTIMATE = "#ed1799"

# Colour of the robot.
ROBOT = "#16324f"

# Colour of loop closures.
CLOSED = "#0b8a5f"

# Glass is dashed and mirrors are dash-dotted, in worlds and in maps.
DASHES = {"glass": "dashed", "mirror": "dashdot"}

# Reflection points drawn at most: more would only make the picture slower.
MOST_POINTS = 200_000

# Up to this number of poses each is drawn with its name, as in Fig. 5 of Teslić.
FEW_POSES = 6

# Up to this number of objects each is drawn with its name.
FEW_OBJECTS = 9

# Longer side of a value's picture in a notebook [inches].
PICTURE = 4.8

# Median distance of poses from which on they are places and no drive, as a part of the axes.
JUMP = 0.15

# Distance of a robot's name from its middle [points].
NAME_AWAY = 16.0


def world(world: World, ax: Axes | None = None, *, poses: Any = None, **style: Any) -> Axes:
    """Plot the walls of a world; what they enclose is filled, glass and mirrors are dashed.

    What encloses one of the poses (k, 3) of robots is a room, and stays white.
    """
    expect(world, World, "world")
    robots = np.empty((0, 3)) if poses is None else _rows(poses, 3, "poses")
    ax = _axes(ax)
    outlines = [patch_from_polygon(area).get_path() for area in _enclosed(world, robots)]
    ax.add_collection(PathCollection(outlines, facecolor=INSIDE, edgecolor="none", zorder=0))
    made_of = [
        "glass" if one and one.passes else "mirror" if one and one.mirrors else "wall"
        for one in world.materials
    ]
    kinds = np.array(made_of or ["wall"])[world.objects if made_of else 0 * world.objects]
    usual = {"color": INK, "linewidth": LINE, "label": "true walls", "zorder": 2}
    _draw_walls(ax, world.segments, kinds, _styled(usual, style))
    return _shown(ax)


def map(
    line_map: LineMap,
    ax: Axes | None = None,
    *,
    objects: Int | None = None,
    among: Int | None = None,
    **style: Any,
) -> Axes:
    """Plot the segments of a map, a colour for each object; few objects are named G1, G2, ….

    Colours are chosen by the numbers (m,) of the objects, such as those of films,
    ``run.lasting_objects[-1]``. Names count these, or all numbers that they are ``among``.
    """
    expect(line_map, LineMap, "map")
    ax = _axes(ax)
    if objects is None:
        objects = np.unique(line_map.objects, return_inverse=True)[1]
    colours = object_tints(objects)
    width = float(np.interp(len(line_map), [60, 5000], [2.6, 0.9]))
    words = "map, a colour for each object"
    usual = {"color": colours, "linewidth": width, "label": words, "zorder": 4}
    _draw_walls(ax, line_map.segments, line_map.kinds, _styled(usual, style))
    numbers = np.unique(objects)
    places = np.searchsorted(numbers if among is None else np.unique(among), numbers)
    for place, number in zip(places, numbers, strict=True) if len(numbers) <= FEW_OBJECTS else ():
        members = np.flatnonzero(objects == number)
        longest = members[lengths(line_map.segments[members]).argmax()]
        x, y = line_map.segments[longest].reshape(2, 2).mean(axis=0).tolist()
        box = {"boxstyle": "round,pad=0.22", "facecolor": "white", "edgecolor": "none"}
        name = ax.text(x, y, f"G{place + 1}", ha="center", va="center", bbox=box, clip_on=True)
        name.set(color=colours[longest], fontsize=9, weight="bold", zorder=6)
    return _shown(ax)


def points(points: Float, ax: Axes | None = None, **style: Any) -> Axes:
    """Plot returns (n, 2) as dots, evenly thinned where there are very many.

    They do not widen the view: images behind mirrors lie far outside.
    """
    points = _rows(points, 2, "points")
    ax = _axes(ax)
    if not len(points):
        return ax
    shown = points[:: max(1, -(-len(points) // MOST_POINTS))]
    size = float(np.interp(len(shown), [500, 50_000], [2.6, 0.7]))
    usual = {"color": POINT, "marker": ".", "markersize": size, "zorder": 1}
    view = ax.dataLim.frozen() if ax.has_data() else None
    ax.plot(*shown.T, **_styled({**usual, "linestyle": "none", "mew": 0}, style))
    # Dots of a large cloud are too fine for a legend.
    ax.plot([], [], ".", color=style.get("color", POINT), label="returns")
    if view is not None:
        ax.dataLim.set(view)
    return _shown(ax)


def scan(
    scan: LaserScan, ax: Axes | None = None, *, lrf: LaserRangeFinder | None = None, **style: Any
) -> Axes:
    """Plot the beams and returns of a scan, and the robot at its pose.

    With the range finder, beams without return are drawn up to its range.
    """
    expect(scan, LaserScan, "scan")
    expect(lrf, LaserRangeFinder | None, "range finder")
    ax = _axes(ax)
    hits = scan.points()
    here = np.array([scan.pose[:2]])
    usual = {"color": BEAM, "linewidth": HAIRLINE, "alpha": 0.5, "label": "beams", "zorder": 1}
    missed = np.isposinf(scan.ranges) & (lrf is not None)
    if len(hits):
        # Beams end at returns or at nothing: the returns decide what is in view.
        ax.add_collection(_fan(here, hits, **_styled(usual, style)), autolim=False)
        ax.plot(*hits.T, ".", color=HIT, markersize=DOT, mew=0, label="returns", zorder=5)
    if lrf is not None and missed.any():
        far = reflection_points(
            scan.pose, scan.angles[missed], np.full(missed.sum(), lrf.range_max)
        )
        faint = {"alpha": 0.15, **({} if not len(hits) else {"label": "_missed"})}
        ax.add_collection(_fan(here, far, **_styled(usual, {**style, **faint})), autolim=False)
    _draw_robots(ax, np.array([scan.pose]), named=False)
    return _shown(ax)


def trajectory(trajectory: Trajectory | Float, ax: Axes | None = None, **style: Any) -> Axes:
    """Plot a drive, or poses (k, 3): few as robots by name, many as a path with a robot.

    The path is broken at poses that are NaN.
    """
    known = trajectory.poses if isinstance(trajectory, Trajectory) else trajectory
    poses = _rows(known, 3, "trajectory")
    ax = _axes(ax)
    if len(poses) <= FEW_POSES:
        _draw_robots(ax, poses, named=len(poses) > 1)
        return _shown(ax)
    ax.update_datalim(poses[:, :2])
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    usual = {"color": PATH, "linewidth": LINE, "label": "path", "zorder": 3}
    if np.nanmedian(steps) > JUMP * max(ax.dataLim.size):
        usual |= {"linestyle": "none", "marker": "o", "markersize": DOT, "label": "poses"}
        style = {key: value for key, value in style.items() if key != "label"}
    line = ax.plot(*poses[:, :2].T, **_styled(usual, style))[0]
    ax.plot(
        *poses[0, :2], "o", markersize=DOT, mfc="white", mec=line.get_color(), zorder=5,
        label="_start",
    )  # fmt: skip
    _draw_robots(ax, poses[-1:], named=False)
    return _shown(ax)


def estimate(
    estimate: EstimatedTrajectory, ax: Axes | None = None, *, closures: bool = True, **style: Any
) -> Axes:
    """Plot an estimated path with its ellipses of 95 % and, if asked, a line for each closure."""
    expect(estimate, EstimatedTrajectory, "estimate")
    ax = _axes(ax)
    usual = {"color": ESTIMATE, "linewidth": LINE, "label": believed(estimate), "zorder": 3}
    path = ax.plot(*estimate.poses[:, :2].T, **_styled(usual, style))[0]
    kept = kept_ellipses(estimate)
    rings = outlines(estimate.poses[estimate.known_scans[kept], :2], estimate.ellipses[kept])
    faded = {"alpha": 0.5 * (1.0 + ESTIMATE_FADED), "linewidths": HAIRLINE, "zorder": 3}
    edges: Any = {"facecolors": "none", "edgecolors": path.get_color(), **faded}
    ax.add_collection(PolyCollection(list(rings), **edges))
    for pairs, colour, name in closures * (
        (estimate.dropped_closures, HIT, "dropped closures"),
        (estimate.closures, CLOSED, "loop closures"),
    ):
        if len(pairs):
            ends = list(estimate.lines(pairs).reshape(-1, 2, 2))
            ax.add_collection(
                LineCollection(ends, colors=colour, linewidths=HAIRLINE, zorder=3, label=name)
            )
    return _shown(ax)


def run(run: Run, ax: Axes | None = None) -> Axes:
    """Plot a run: its map, the robot's path and its estimate, over the true walls."""
    expect(run, Run, "run")
    poses = run.trajectory.poses
    ax = world(Sight.of(run.world, poses[:, :2]).world, ax, poses=poses, **BELOW)
    if run.maps:
        map(run.map, ax, objects=run.lasting_objects[-1])
    return paths(poses, run.estimate, ax)


def paths(poses: Float, estimated: EstimatedTrajectory | None, ax: Axes) -> Axes:
    """Plot the poses (k, 3) of a drive, and its estimate where there is one."""
    if estimated is None:
        return trajectory(poses, ax)
    # Of a recorded drive the truth is not known: its poses are the estimate.
    if not np.array_equal(poses, estimated.poses):
        trajectory(poses, ax, linewidth=2.0 * LINE, label=TRUTH)
    return estimate(estimated, ax, closures=False)


def png(value: World | LineMap | LaserScan | Run) -> bytes:
    """A small picture of a value as a PNG file, which notebooks show for it; pyplot is not used."""
    expect(value, World | LineMap | LaserScan | Run, "value")
    draw = next(function for kind, function in _PLOTS.items() if isinstance(value, kind))
    figure = sheet(PICTURE, PICTURE)
    ax = draw(value, dressed(figure.add_subplot()))
    ax.set_aspect("equal", adjustable="box")
    size = np.maximum(ax.dataLim.size, ROUNDING) if ax.has_data() else np.ones(2)
    figure.set_size_inches(*(PICTURE * np.clip(size / size[::-1], 0.3, 1.0)))
    ax.set_title(fill(plain(repr(value)), 60), loc="left", color=FAINT, fontsize=7)
    file = BytesIO()
    figure.savefig(file, format="png", dpi=100, bbox_inches="tight", pad_inches=PAD)
    return file.getvalue()


# What draws the picture of a value, by its type.
_PLOTS: dict[type, Callable[..., Any]] = {World: world, LineMap: map, LaserScan: scan, Run: run}


def _rows(values: Any, columns: int, name: str) -> Float:
    """Rows (k, columns) of numbers, of which some may be NaN."""
    rows: Float = np.asarray(numbers(values, name), dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] != columns:
        raise InputError(f"{name} of shape {rows.shape}: expected (k, {columns})")
    return rows


def _axes(ax: Axes | None) -> Axes:
    expect(ax, Axes | None, "ax")
    if ax is not None:
        if ax.get_aspect() == "auto":
            ax.set_aspect("equal", adjustable="datalim")
        return ax
    from matplotlib import pyplot

    return dressed(pyplot.figure().add_subplot())


def _shown(ax: Axes) -> Axes:
    ax.autoscale_view()
    return ax


def _styled(usual: dict[str, Any], style: dict[str, Any]) -> dict[str, Any]:
    """Keywords that are given before the usual ones, whichever of their names they have."""
    given = normalize_kwargs(normalize_kwargs(style, Line2D), LineCollection)
    if "colors" in given:
        given["color"] = given.pop("colors")
    return {**usual, **given}


def _draw_walls(ax: Axes, segments: Float, kinds: Any, style: dict[str, Any]) -> None:
    """Draw segments (n, 4), those of glass and mirrors with dashes and names of their own."""
    colours = np.asarray(style["color"])
    for kind in ("wall", "glass", "mirror"):
        chosen = np.asarray(kinds) == kind
        if not chosen.any():
            continue
        own = {**style, "color": style["color"] if colours.ndim < 2 else colours[chosen]}
        if kind == "wall":
            own["capstyle"] = "round"
        else:
            own |= {"linestyle": DASHES[kind], "label": f"{kind}, {style['label'].split(',')[0]}"}
        ax.add_collection(LineCollection(list(segments[chosen].reshape(-1, 2, 2)), **own))


def _enclosed(world: World, poses: Float) -> Any:
    """What the walls of each object enclose, without courtyards, as shapely polygons."""
    import shapely

    names, numbers = np.unique(world.objects, return_inverse=True)
    areas = shapely.get_parts(enclosed_areas(world.segments, numbers, len(names))[1])
    inhabited = shapely.STRtree(areas).query(shapely.points(poses[:, :2]), predicate="within")[1]
    # In normal form courtyards turn against the outer ring, which is what leaves them unfilled.
    return shapely.normalize(np.delete(areas, inhabited))


def _draw_robots(ax: Axes, poses: Float, *, named: bool) -> None:
    """Draw robots as darts of an even size: at its true size a city would swallow one."""
    for number, (x, y, theta) in enumerate(poses.tolist()):
        dart = MarkerStyle(Path(DART), transform=Affine2D().rotate(theta))
        ax.plot(
            x, y, marker=dart, markersize=13, color=ROBOT, mec="white", mew=HAIRLINE, zorder=7,
            linestyle="none", label="robot" if number == 0 else "_robot",
        )  # fmt: skip
        if named:
            # The name stands behind the robot, where it has no beams.
            behind = (-NAME_AWAY * np.cos(theta), -NAME_AWAY * np.sin(theta))
            name = ax.annotate(
                f"p{number + 1}", (x, y), behind, textcoords="offset points", ha="center",
                va="center", zorder=7, color=ROBOT, fontsize=10, weight="bold",
            )  # fmt: skip
            name.set_path_effects([withStroke(linewidth=3, foreground="white")])


def _fan(here: Float, ends: Float, **style: Any) -> LineCollection:
    beams = np.stack([np.broadcast_to(here, ends.shape), ends], axis=1)
    return LineCollection(list(beams), **style)
