"""Figures: the world with a scan, and the map that was built, as in Fig. 5 and 7 of Teslić et al.

A run enters; a matplotlib figure leaves, and a picture file where a path is given: OutputError is
raised where that cannot be written.
"""

from collections.abc import Iterable, Mapping, Sequence
from itertools import cycle
from pathlib import Path
from string import ascii_lowercase
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from lrf3d.base.text import counted
from lrf3d.geometry.lines import Float, Int
from lrf3d.geometry.pose import Pose
from lrf3d.laser import LaserRangeFinder, LaserScan
from lrf3d.mapping import LineMap
from lrf3d.robot import EstimatedTrajectory
from lrf3d.robot.following import Patrol
from lrf3d.simulation.run import Run
from lrf3d.simulation.scenario import Scenario
from lrf3d.studio.figures import plot
from lrf3d.studio.figures.sheet import (
    DOT,
    FAINT,
    HAIRLINE,
    INK,
    LINE,
    MARGIN,
    add_legend,
    dressed,
    plain,
    save_figure,
    sheet,
)
from lrf3d.studio.scene.stage.structures import Sight
from lrf3d.world import World

if TYPE_CHECKING:
    from lrf3d.casting.comparison import CrossCheck

# Colours of the fields of view of lasers, and of dynamic obstacles.
FIELDS = ("#3b7dd8", "#d97b29", "#3f9d5f", "#9a5bb5")
OBSTACLE = "#7a4a9e"

# Room around all panels, for labels, headline and legend [inches].
AROUND = np.array([0.9, 1.6])

# Area of all panels together, whatever the shape of the world [square inches].
AREA = 54.0

# Least side of a panel [inches].
LEAST_SIDE = 2.0

# Largest side of a panel [inches].
MOST_SIDE = 12.0

# Ratio of width and height that rows and columns of panels have together.
SHEET_ASPECT = 1.5

# Least width of a figure, in which a headline is legible [inches].
NARROWEST = 6.0

# Share of returns on each side of the picture that do not widen it [%].
OUTERMOST = 0.5

# Largest number of rooms that are named with their areas.
MOST_ROOMS = 200

# Distance of the scale bar from the corner of a plan, as a share of the plan.
BAR_MARGIN = 0.02

# Width of the plan in lengths of the longest scale bar.
BARS = 4.0

# Colour of refused closures, and of Embree's answer where it is not the exact one.
WRONG = "#7a3fb0"

# Distance from the stretch up to which key scans of other passes are drawn [m].
NEAR = 6.0

# Height of a line of words in a panel, as a share of the panel.
WORDS_STEP = 0.05


# Colours of what the rules of a plan left out, in their order; after the last the first.
LEFT_OUT = ("#c28b00", "#8a5fb0", "#9aa3ad", "#0b8a5f", "#2f9fc4", "#b06a3b", "#c2558a", "#7a9a3a")


class PlanShown(Protocol):
    """What is drawn of a plan: strokes that were left out, doors, and rooms with their areas."""

    doors: Sequence[Any]

    @property
    def removed(self) -> Mapping[str, Float]:
        """Strokes (k, 4) [m] by the name, in the singular, of the rule that left them out."""

    @property
    def rooms(self) -> Sequence[tuple[float, Any]]:
        """Area [m²] and place (2,) of each room."""


class Pass(NamedTuple):
    """What the worst stretch of a drive and other passes of its place saw.

    ``scans`` (k,) are the numbers of the key scans, ``points`` for each the points (m, 2) that it
    saw, ``first`` and ``last`` the scans of the stretch, ``violation`` the share of what others saw
    that its beams pass, and ``apart`` the distance driven [m] from it to another pass.
    """

    scans: Int
    points: Sequence[Float]
    first: int
    last: int
    violation: float
    apart: float


def draw_world(
    world: World,
    path: str | Path | None = None,
    *,
    scan: LaserScan | None = None,
    lrf: LaserRangeFinder | None = None,
    route: Float | None = None,
    poses: Float | None = None,
    plan: PlanShown | None = None,
) -> Figure:
    """Draw a world, and in it a scan with its robot, a route (n, 2) and poses (k, 3) (Fig. 5a).

    With the range finder, beams without return are drawn up to its range. Few poses are drawn as
    robots by name, many as a path; of the plan of a drawing doors, rooms and what was left out.
    """
    legs = np.empty((0, 2)) if route is None else np.asarray(route, dtype=np.float64)[:, :2]
    stops = np.empty((0, 3)) if poses is None else np.asarray(poses, dtype=np.float64)
    where = np.array([scan.pose]) if scan is not None else np.empty((0, 3))
    words = f"{counted(len(world.segments), 'wall')} of {counted(world.object_count, 'object')}"
    if scan is not None:
        words += f"  ·  scan of {len(scan.ranges)} beams, {int(scan.hits.sum())} returns"
    world = Sight.of(world, np.vstack([legs, stops[:, :2], where[:, :2]])).world
    robots = np.vstack([where, stops])
    places = [world.segments.reshape(-1, 2), legs, robots[:, :2]]
    if plan is not None:
        places.append(np.concatenate([np.empty((0, 4)), *plan.removed.values()]).reshape(-1, 2))
    figure, (ax,) = metre_sheet(places, 1, world.name or "world", words)
    plot.world(world, ax, poses=robots)
    if plan is not None:
        _draw_plan(plan, ax)
    if len(legs):
        ax.plot(
            *legs.T, color=plot.PATH, linewidth=LINE, linestyle="dashed", label="route", zorder=3,
        )  # fmt: skip
    if scan is not None:
        plot.scan(scan, ax, lrf=lrf)
    plot.trajectory(stops, ax)
    return finished(figure, [ax], path)


def draw_scenario(
    scenario: Scenario, path: str | Path | None = None, *, plan: PlanShown | None = None
) -> Figure:
    """Draw a world as `draw_world` does, with the start, the lasers and the dynamic obstacles."""
    shown = scenario.poses
    if shown is None and scenario.start is not None:
        shown = np.array([scenario.start])
    figure = draw_world(scenario.world, route=scenario.route, poses=shown, plan=plan)
    ax = figure.axes[0]
    for legend in figure.legends:
        legend.remove()
    for number, obstacle in enumerate(scenario.obstacles):
        moves = obstacle.path
        way = moves.route if isinstance(moves, Patrol) else moves.poses[:, :2]
        outline = Pose(*moves.at(np.zeros(1))[0].tolist()).apply(obstacle.outline)
        label = "_" if number else "obstacles"
        ax.plot(*way.T, color=OBSTACLE, linewidth=1.0, linestyle=":", zorder=4)
        ax.fill(*outline.T, color=OBSTACLE, zorder=4, label=label)
    if shown is not None and len(shown):
        _draw_fields(ax, scenario.lasers, shown[0])
    return finished(figure, [ax], path)


def _draw_fields(ax: Axes, lasers: Sequence[LaserRangeFinder], pose: Float) -> None:
    """Draw the field of view of each laser of a robot at a pose (3,), in small, at its mount."""
    # Radius of the fields, as a share of the narrower side of the axes.
    share = 0.12
    size = share * min(abs(np.diff(ax.get_xlim())[0]), abs(np.diff(ax.get_ylim())[0]))
    for laser, colour in zip(lasers, cycle(FIELDS), strict=False):
        radius = min(size, laser.range_max)
        place = laser.placed(pose)
        angles = np.linspace(laser.angle_min, laser.angle_max, 91) + place[2]
        arc = place[:2] + radius * np.column_stack([np.cos(angles), np.sin(angles)])
        field = np.vstack([place[:2], arc])
        name = f"field of view: {laser.name}"
        ax.fill(*field.T, facecolor=colour, edgecolor=colour, alpha=0.35, zorder=6, label=name)


def _draw_plan(plan: PlanShown, ax: Axes) -> None:
    """Draw the doors and the rooms of a plan, what was left out, and a scale bar."""
    for (name, strokes), colour in zip(plan.removed.items(), cycle(LEFT_OUT), strict=False):
        lines = list(strokes.reshape(-1, 2, 2))
        label = f"left out: {name}s"
        rest = LineCollection(lines, colors=colour, linewidths=HAIRLINE, label=label, zorder=1)
        ax.add_collection(rest, autolim=False)
    for number, door in enumerate(plan.doors):
        label = "doors that stand open" if number == 0 else "_"
        ax.plot(*door.opening.T, color=plot.PATH, linewidth=LINE, label=label, zorder=3)
        ax.annotate(f"{door.width:.2f}", door.opening.mean(axis=0), color=plot.PATH, fontsize=6)
    for area, place in plan.rooms[:MOST_ROOMS]:
        ax.annotate(f"{area:.1f} m²", (place[0], place[1]), ha="center", color=INK, fontsize=8)
    left, right = ax.get_xlim()
    low, high = ax.get_ylim()
    bar = 10.0 ** np.floor(np.log10((right - left) / BARS))
    x = left + BAR_MARGIN * (right - left)
    y = low + BAR_MARGIN * (high - low)
    ax.plot([x, x + bar], [y, y], color=INK, linewidth=4, solid_capstyle="butt", zorder=5)
    ax.annotate(f" {bar:g} m", (x + bar, y), va="center", color=INK, fontsize=8)


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
    """Draw a map, each object in its colour, over returns (n, 2) and true walls (Fig. 7).

    A run brings all that follows along. Where a pose (k, 3) is NaN, the path is broken;
    `lrf3d.plot.estimate` also draws the loop closures of an estimate.
    """
    objects = None
    if isinstance(source, Run):
        poses = source.trajectory.poses
        estimate = source.estimate
        world = Sight.of(source.world, poses[:, :2]).world
        points = _reflections(source)
        line_map = source.map
        objects = source.lasting_objects[-1] if source.maps else None
    else:
        line_map = source
    points = np.empty((0, 2)) if points is None else points
    poses = np.empty((0, 3)) if poses is None else poses
    estimated = poses if estimate is None else estimate.poses
    stops = poses[np.isfinite(poses[:, 0])]
    driven = [stops[:, :2], estimated[np.isfinite(estimated[:, 0]), :2]]
    name = title or (world.name if world is not None else "") or "map"
    # Without a map, a drive is shown on walls that were known before.
    given = 0 if world is None or source is not line_map or len(line_map) else len(world.segments)
    words = _counts(line_map, given, len(stops), len(points))
    figure, (ax,) = metre_sheet([*_framing(world, line_map, points), *driven], 1, name, words)
    if world is not None:
        # Without a map of its own, a drive was found on these walls, which may not be the truth.
        named = plot.BELOW if len(line_map) else {**plot.BELOW, "label": "walls"}
        plot.world(world, ax, poses=stops, **named)
    plot.points(points, ax)
    plot.map(line_map, ax, objects=objects)
    plot.paths(poses, estimate, ax)
    return finished(figure, [ax], path)


def _framing(world: World | None, line_map: LineMap, points: Float) -> list[Float]:
    """Places that frame the picture: the truth where it is known, else nearly all that was seen.

    Images behind mirrors lie far outside.
    """
    if world is not None and len(world.segments):
        return [world.segments.reshape(-1, 2)]
    bulk = [OUTERMOST, 100.0 - OUTERMOST]
    seen = np.percentile(points, bulk, axis=0) if len(points) else points
    return [line_map.segments.reshape(-1, 2), seen]


def _counts(line_map: LineMap, walls: int, scans: int, points: int) -> str:
    named = ((walls, "wall"), (scans, "scan"), (points, "return"))
    words = [counted(number, name) for number, name in named if number]
    return "  ·  ".join(words if walls else [line_map.counts, *words])


def draw_noise_levels(
    runs: Sequence[Run], sigmas: Sequence[float], path: str | Path | None = None
) -> Figure:
    """Draw the world with the first scan, and next to it the map at each σ [m] (Fig. 5a–d)."""
    poses = runs[0].trajectory.poses
    world = Sight.of(runs[0].world, poses[:, :2]).world
    figure, axes = metre_sheet([world.segments.reshape(-1, 2), poses[:, :2]], len(runs) + 1)
    plot.world(world, axes[0], poses=poses)
    plot.scan(runs[0].true_scan(0), axes[0])
    plot.trajectory(poses, axes[0])
    _head(axes[0], f"(a)  the world and the first scan, $d_{{max}}$ = {runs[0].lrf.range_max:g} m")
    objects = [run.lasting_objects[-1] if run.maps else None for run in runs]
    # An object has one name in all panels.
    among = np.concatenate(
        [numbers for numbers in objects if numbers is not None] + [np.zeros(0, np.int64)]
    )
    panels = zip(axes[1:], ascii_lowercase[1:], runs, sigmas, objects, strict=False)
    for ax, letter, run, sigma, numbers in panels:
        plot.world(world, ax, poses=poses, **plot.BELOW)
        plot.points(_reflections(run), ax)
        plot.map(run.map, ax, objects=numbers, among=among)
        plot.trajectory(poses, ax)
        _head(ax, f"({letter})  σ = {sigma:g} m", run.map.counts)
    return finished(figure, axes, path)


def draw_crosscheck(
    world: World,
    lrf: LaserRangeFinder,
    poses: Float,
    result: "CrossCheck",
    path: str | Path | None = None,
) -> Figure:
    """Draw a world, the poses (k, 3), and the beams that the casters see differently."""
    places = [world.segments.reshape(-1, 2), poses[:, :2]]
    found = "all agree on wall and range"
    if result.causes:
        causes = ", ".join(f"{count} {cause}" for cause, count in result.counts.items())
        found = f"{len(result.causes)} seen differently: {causes}"
    title = f"{world.name or 'world'}: the plane against bare Embree"
    figure, (ax,) = metre_sheet(places, 1, title, f"{result.beams:,} beams  ·  {found}")
    plot.world(world, ax, poses=poses)
    plot.trajectory(poses, ax)
    starts = poses[result.scan, :2]
    beams = [
        lrf.directions(poses[scan])[beam]
        for scan, beam in zip(result.scan, result.beam, strict=True)
    ]
    # Many beams are drawn finer, or they would hide the world and each other.
    fine = float(np.interp(len(starts), [20, 100], [1.0, 0.4]))
    for answers, colour, label, width in (
        (result.ranges[:, 1], WRONG, "Embree's answer", LINE),
        (result.ranges[:, 0], plot.BEAM, "exact answer", 2.0 * LINE),
    ):
        if not len(answers):
            continue
        ends = starts + np.clip(answers, 0.0, lrf.range_max)[:, None] * np.array(beams)
        lines = list(np.stack([starts, ends], axis=1))
        ax.add_collection(
            LineCollection(lines, colors=colour, linewidths=fine * width, label=label, zorder=4)
        )
        ax.plot(*ends.T, "o", markersize=DOT * fine, color=colour, mew=0, zorder=5)
    return finished(figure, [ax], path)


def draw_check(
    shown: Pass,
    poses: Float,
    refused: Sequence[tuple[int, int, str]],
    title: str,
    path: str | Path | None = None,
) -> Figure:
    """Draw the worst stretch of a drive, at poses (k, 3) of its key scans.

    Closures between two key scans that were refused are given with the reason.
    """
    scans = shown.scans
    first = shown.first
    last = shown.last
    inside = (scans >= first) & (scans <= last)
    low = poses[inside, :2].min(axis=0) - NEAR
    high = poses[inside, :2].max(axis=0) + NEAR
    driven = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))])
    begin = driven[inside].min() - shown.apart
    end = driven[inside].max() + shown.apart
    others = ((driven < begin) | (driven > end)) & (
        (poses[:, :2] > low) & (poses[:, :2] < high)
    ).all(axis=1)
    seen_by = (
        (inside, plot.HIT, f"scans {first} to {last}"),
        (others, plot.PATH, "scans of other passes"),
    )
    share = f"{100 * shown.violation:.0f} % of what others saw is passed by beams"
    words = f"scans {first} to {last}" + f": {share}" * bool(shown.violation)
    figure, axes = metre_sheet([np.array([low, high])], 3, title, words)
    for ax, panel in zip(axes, (seen_by[:1], seen_by[1:], seen_by[::-1]), strict=True):
        for chosen, colour, name in panel:
            seen = [shown.points[k] for k in np.flatnonzero(chosen).tolist()]
            points = np.vstack([np.empty((0, 2)), *seen])
            ax.plot(*points.T, ".", markersize=1.5, color=colour, label=name, zorder=3)
        ax.plot(*poses[inside, :2].T, color=plot.HIT, linewidth=HAIRLINE, zorder=4)
    ends = [poses[[old, new], :2] for old, new, _ in refused]
    axes[2].add_collection(
        LineCollection(ends, colors=WRONG, linewidths=HAIRLINE, label="refused closures", zorder=5)
    )
    for row, why in enumerate(dict.fromkeys(each for _, _, each in refused)):
        pairs = [f"{scans[old]}:{scans[new]}" for old, new, each in refused if each == why]
        words = f"{len(pairs)} refused, such as {pairs[0]}: {why}"
        axes[2].text(
            BAR_MARGIN, 1.0 - BAR_MARGIN - WORDS_STEP * row, words, va="top",
            transform=axes[2].transAxes, color=WRONG, fontsize=7,
        )  # fmt: skip
    return finished(figure, axes, path)


def metre_sheet(
    places: Iterable[Float], panels: int, title: str = "", words: str = ""
) -> tuple[Figure, list[Axes]]:
    """A figure of equal panels that show the box around places (n, 2) [m]; a metre without any."""
    known = [place for place in places if len(place)] or [np.zeros((1, 2))]
    low = np.min([place.min(axis=0) for place in known], axis=0)
    high = np.max([place.max(axis=0) for place in known], axis=0)
    size = np.maximum(high - low, 1.0) * (1.0 + 2.0 * MARGIN)
    # What has no width, such as a single wall, is shown with something around it.
    size = np.maximum(size, size.max() / (MOST_SIDE / LEAST_SIDE))
    panel = np.clip(size * np.sqrt(AREA / panels / size.prod()), LEAST_SIDE, MOST_SIDE)
    columns = max(1, min(panels, round(np.sqrt(SHEET_ASPECT * panels * panel[1] / panel[0]))))
    rows = -(-panels // columns)
    width, height = panel * [columns, rows] + AROUND * [columns, 1.0]
    figure = sheet(max(width, NARROWEST), height, title, words)
    axes = [dressed(figure.add_subplot(rows, columns, 1 + number)) for number in range(panels)]
    middle = 0.5 * (low + high)
    x, y = np.transpose([middle - 0.5 * size, middle + 0.5 * size])
    for ax in axes:
        ax.set(xlim=x, ylim=y)
        ax.set_aspect("equal", adjustable="box")
    return figure, axes


def finished(figure: Figure, axes: Sequence[Axes], path: str | Path | None) -> Figure:
    """Add the legend, and write the figure if there is a path."""
    add_legend(figure, axes)
    return save_figure(figure, path)


def _head(ax: Axes, title: str, counts: str = "") -> None:
    ax.set_title(plain(title) if "$" not in title else title, loc="left", color=INK, fontsize=10)
    ax.set_title(counts, loc="right", color=FAINT, fontsize=8)


def _reflections(run: Run) -> Float:
    return np.vstack([np.empty((0, 2)), *(scan.points() for scan in run.scans)])
