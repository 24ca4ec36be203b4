"""Marks: what figures are made of, each drawn on axes and given back as a sign for the legend."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from matplotlib.path import Path
from matplotlib.patheffects import withStroke

from lrf3d.geometry import Float, Int, lengths
from lrf3d.laser import LaserRangeFinder, LaserScan, reflection_points
from lrf3d.mapping import LineMap
from lrf3d.pose import Pose
from lrf3d.render.page import Frame
from lrf3d.scene.look import DART, object_tints
from lrf3d.world import World

INSIDE, POINT, BEAM, HIT, PATH, ROBOT = (
    "#eef0f3",
    "#6f7986",
    "#f2a03d",
    "#d6361f",
    "#2f6fb3",
    "#16324f",
)
"""Colours of buildings, points, beams, beam ends, the robot's way and the robot."""

Colour = str | tuple[float, float, float]
"""A colour of matplotlib: its name, or red, green, blue in 0…1."""

PATH_WIDTH, WIDTH_UNDER = 1.1, 2.8
"""Widths of the robot's way [points], by itself and under that of an estimate."""

DASHES = (0.0, (4.0, 2.0))
"""The dashes of a route that is yet to be driven: offset, on and off."""

MOST_POINTS = 200_000
"""Reflection points drawn at most: more would only make the picture slower."""

FEW_POSES, FEW_OBJECTS = 6, 9
"""Up to this number of poses and objects, each is drawn with its name, as in Fig. 5."""

JUMP = 0.15
"""Poses that lie mostly farther apart than this part of the frame are no drive, but places."""

DART_SIZE = 0.016
"""Size of the robot as a part of the frame: at its true size a city would swallow it."""


def draw_walls(
    axes: Axes, frame: Frame, world: World, poses: Float, colour: str, *, width: float
) -> list[Line2D]:
    """Draw walls, and fill what they enclose unless a robot stands in it: rooms stay white."""
    if not len(world.segments):
        return []
    solid = [_outline(area) for area in _enclosed(frame, world, poses)]
    axes.add_collection(PathCollection(solid, facecolor=INSIDE, edgecolor="none", zorder=0.4))
    axes.add_collection(_lines(frame, world.segments, colour, width, zorder=2.0))
    return [Line2D([], [], color=colour, linewidth=1.5 * width, label="true walls")]


def _enclosed(frame: Frame, world: World, poses: Float) -> Any:
    """What the walls of each object enclose, without courtyards, as shapely polygons."""
    import shapely

    lines = shapely.linestrings(frame.local(world.segments).reshape(-1, 2, 2))
    _, number = np.unique(world.objects, return_inverse=True)
    order = np.argsort(number, kind="stable")
    walls = shapely.multilinestrings(lines[order], indices=number[order])
    areas = shapely.get_parts(shapely.build_area(walls))
    robots = shapely.points(frame.local(poses[:, :2]))
    inhabited = shapely.STRtree(areas).query(robots, predicate="within")[1]
    # In normal form courtyards turn against the outer ring, which is what leaves them unfilled.
    return shapely.normalize(np.delete(areas, inhabited))


def _outline(area: Any) -> Path:
    rings = [area.exterior, *area.interiors]
    paths = [Path(np.asarray(ring.coords), closed=True) for ring in rings]
    return Path.make_compound_path(*paths)


def draw_points(axes: Axes, frame: Frame, points: Float) -> list[Line2D]:
    """Draw reflection points as dots, evenly thinned where there are very many."""
    if not len(points):
        return []
    shown = frame.local(points[:: max(1, -(-len(points) // MOST_POINTS))])
    size = float(np.interp(len(shown), [500, 5000, 50_000], [7.0, 2.0, 0.5]))
    axes.scatter(shown[:, 0], shown[:, 1], s=size, color=POINT, alpha=0.8, linewidths=0, zorder=1.5)
    return [Line2D([], [], color=POINT, marker=".", linestyle="none", label="reflection points")]


def draw_objects(axes: Axes, frame: Frame, line_map: LineMap, objects: Int) -> list[Line2D]:
    """Draw the segments of a map, each object (m,) in its colour; few objects by name."""
    if not len(line_map):
        return []
    colours = object_tints(objects)
    width = float(np.interp(len(line_map), [60, 600, 5000], [2.6, 1.8, 0.9]))
    axes.add_collection(_lines(frame, line_map.segments, colours, width, zorder=4.0))
    numbers = np.unique(objects)
    for number in numbers if len(numbers) <= FEW_OBJECTS else []:
        members = np.flatnonzero(objects == number)
        longest = members[lengths(line_map.segments[members]).argmax()]
        middle = frame.local(line_map.segments[longest].reshape(2, 2)).mean(axis=0)
        axes.text(
            middle[0],
            middle[1],
            f"G{number + 1}",
            color=colours[longest],
            fontsize=9,
            weight="bold",
            ha="center",
            va="center",
            zorder=6,
            clip_on=True,
            bbox={"boxstyle": "round,pad=0.22", "facecolor": "white", "edgecolor": "none"},
        )
    words = "map, a colour for each object"
    return [Line2D([], [], color=colours[0], linewidth=2.6, label=words)]


def draw_scan(
    axes: Axes, frame: Frame, scan: LaserScan, lrf: LaserRangeFinder | None
) -> list[Line2D]:
    """Draw a scan beam by beam; with the range finder also the beams that met nothing."""
    points = frame.local(scan.points())
    here = frame.local(np.array([scan.pose[:2]]))
    # Beams end at returns or at nothing: what is in view is decided by the returns.
    axes.add_collection(_fan(here, points, alpha=0.5), autolim=False)
    missed = np.isposinf(scan.ranges)
    if lrf is not None and missed.any():
        far = np.full(missed.sum(), lrf.range_max)
        ends = frame.local(reflection_points(scan.pose, scan.angles[missed], far))
        axes.add_collection(_fan(here, ends, alpha=0.15), autolim=False)
    axes.scatter(points[:, 0], points[:, 1], s=9.0, color=HIT, linewidths=0, zorder=5)
    signs = []
    if len(points) or (lrf is not None and missed.any()):
        signs.append(Line2D([], [], color=BEAM, linewidth=1.2, label="beams"))
    if len(points):
        signs.append(Line2D([], [], color=HIT, marker=".", linestyle="none", label="returns"))
    return signs


def draw_route(axes: Axes, frame: Frame, way: Float) -> Line2D:
    """Draw way-points (n, 2) joined by a dashed line."""
    x, y = frame.local(way).T
    axes.plot(x, y, color=PATH, linewidth=1.2, linestyle=DASHES, zorder=3)
    return Line2D([], [], color=PATH, linewidth=1.2, linestyle=DASHES, label="route")


def draw_poses(
    axes: Axes,
    frame: Frame,
    poses: Float,
    name: str = "path",
    colour: Colour = PATH,
    width: float = PATH_WIDTH,
) -> list[Line2D]:
    """Draw few poses as robots by name, many as a path of a name with the robot at its end."""
    if not len(poses):
        return []
    signs = []
    places = frame.local(poses[:, :2])
    named = len(poses) <= FEW_POSES
    if not named:
        jump = JUMP * float(frame.size.max())
        signs.append(_draw_path(axes, places, name, colour, width, jump=jump))
    size = DART_SIZE * float(np.sqrt(frame.size.prod()))
    for index in range(len(poses)) if named else [len(poses) - 1]:
        pose = Pose(places[index, 0], places[index, 1], poses[index, 2])
        outline = pose.apply(size * DART)
        axes.add_patch(Polygon(outline, facecolor=ROBOT, edgecolor="white", lw=0.6, zorder=7))
        if named and len(poses) > 1:
            # The name stands behind the robot, where it has no beams.
            behind = pose.apply(np.array([[-2.4 * size, 0.0]]))[0]
            label = axes.text(
                behind[0],
                behind[1],
                f"p{index + 1}",
                ha="center",
                va="center",
                zorder=7,
                clip_on=True,
            )
            label.set(color=ROBOT, fontsize=10, weight="bold")
            label.set_path_effects([withStroke(linewidth=3, foreground="white")])
    signs.append(Line2D([], [], color=ROBOT, marker=">", linestyle="none", label="robot"))
    return signs


def _draw_path(
    axes: Axes, places: Float, name: str, colour: Colour, width: float, *, jump: float
) -> Line2D:
    """Draw a drive as a line, and places that lie mostly farther apart than a jump [m] as dots."""
    x, y = places.T
    if np.median(np.hypot(np.diff(x), np.diff(y))) > jump:
        axes.scatter(x, y, s=12, color=colour, linewidths=0, zorder=3)
        return Line2D([], [], color=colour, marker=".", linestyle="none", label="poses")
    axes.plot(x, y, color=colour, linewidth=width, alpha=0.9, zorder=3)
    axes.scatter(x[:1], y[:1], s=22, facecolor="white", edgecolor=colour, zorder=5)
    return Line2D([], [], color=colour, linewidth=width, label=name)


def _lines(
    frame: Frame, segments: Float, colours: str | Float, width: float, *, zorder: float
) -> LineCollection:
    ends = frame.local(segments).reshape(-1, 2, 2)
    return LineCollection(
        list(ends), colors=colours, linewidths=width, capstyle="round", zorder=zorder
    )


def _fan(here: Float, ends: Float, *, alpha: float) -> LineCollection:
    beams = np.stack([np.broadcast_to(here, ends.shape), ends], axis=1)
    return LineCollection(list(beams), colors=BEAM, linewidths=0.6, alpha=alpha, zorder=1.2)
