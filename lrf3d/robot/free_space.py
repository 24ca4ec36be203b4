"""Free space: where a robot can be between the walls, as a graph of lattice cells.

The cells keep a distance to the walls. They are in the local frame of the world, with the steps
between neighbouring cells and the costs of these.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Bool, Float, Int
from lrf3d.robot.sides import Lattice, Sides, find_sides
from lrf3d.robot.wall_samples import (
    SURROUNDINGS,
    planning_window,
    sample_walls,
    spacing_for,
    thinned,
    walls_within,
)
from lrf3d.world import World

Side = Literal["inside", "outside"]
"""Side of the walls: inside, among them, or outside of them."""

CELLS = 100_000
"""Approximate number of cells of the lattice, within the limits of their size."""

CELL_SIZES = (0.1, 1.0)
"""Smallest and largest side of a cell [m]: a fifth of a door, and a third of a narrow street."""

WALL_PENALTY = 6.0
"""Factor by which a step at the least distance to a wall costs more than in the open."""

TIGHT_PENALTY = 10.0
"""Additional cost factor of a step through a tight place, which is taken only to get behind it."""

LARGEST_PARTS = 8
"""Number of the largest parts of the free space that are compared."""

SUBSTANTIAL = 0.7
"""Least length of the walls along the inside, as a share of those along the outside, for the robot
to drive inside. For a house it is more than 1, unless its walls are thicker than any real ones."""

BUILDING, OPEN = 0.3, 0.95
"""Weights of walls seen from within a building and from open land: a room is preferred to the land
around it, and the inside of a building is left out unless there is little else."""


@dataclass(frozen=True)
class FreeSpace:
    """The cells that a robot can stand in, all joined to each other.

    Args:
        cells: (k, 2) their centres [m] in the local frame.
        clearances: (k,) distance [m] of each to the nearest wall.
        graph: (k, k) sparse matrix of the costs of steps between neighbours.
        size: Side of a cell [m].
        least: Least distance [m] to walls.
        roomy: (k,) whether each cell is not in a tight place.
        worth: Weighted length [m] of the walls along it.
        walls: The nearest-neighbour tree over points of the walls.
        side: The side of the walls that it is on.
        low: (2,) the corner of the lattice [m].
        barred: (columns, rows) which cells of the lattice have room but are excluded: they are on
            the other side, or not known to be free.
        start: The cell where the drive starts, or None if it may start anywhere.
    """

    cells: Float
    clearances: Float
    graph: Any
    size: float
    least: float
    roomy: Bool
    worth: float
    walls: Any
    side: Side
    low: Float
    barred: Bool
    start: int | None = None

    def clearance(self, points: Float) -> Float:
        """Distance (k,) [m] of points (k, 2) of the local frame to the nearest wall."""
        return np.asarray(self.walls.query(points)[0], dtype=np.float64)

    def length(self, path: Int) -> float:
        """Length [m] of a path of neighbouring cells."""
        steps = np.diff(self.cells[path], axis=0)
        return float(np.hypot(steps[:, 0], steps[:, 1]).sum())

    def bars(self, points: Float) -> Bool:
        """Which of the points (k, 2) of the local frame lie in a barred cell."""
        column, row = np.floor((points - self.low) / self.size).astype(np.int64).T
        return np.asarray(self.barred[column, row])


def find_free_space(
    world: World,
    *,
    least: float,
    clearance: float,
    comfortable: float = 0.0,
    where: Side | None = None,
    start: Float | None = None,
) -> FreeSpace:
    """The free space of a world, or of its densest part where it is very large.

    In a plan of rooms it is inside, in a town outside of the buildings. If walls divide the free
    space, the part along most of the walls is chosen. In a map with known free cells only those are
    used.

    Args:
        world: The walls.
        least: Least distance to walls [m].
        clearance: Distance to walls [m] that is kept where there is room.
        comfortable: Distance to walls [m] below which a place is tight, such as a door.
        where: The side of the walls to stay on; it depends on the world if not given.
        start: Position x, y [m] that the space must contain; any if not given.

    Raises:
        InputError: There are no walls, or there is no room for the robot between them.
    """
    from scipy.spatial import cKDTree

    name = world.name or "world"
    if not len(world.segments):
        raise InputError(f"{name}: no walls, so no route can be found")
    segments = world.segments - np.tile(world.origin, 2)
    start = None if start is None else start - world.origin
    low, high = planning_window(segments, start)
    # Walls beyond the reach of the window have no effect in it.
    reach = clearance + least + SURROUNDINGS
    segments, which = walls_within(segments, low - reach, high + reach)
    if not len(segments):
        raise InputError(f"{name}: no walls near the start, so no route can be found")
    points, weights = thinned(*sample_walls(segments, spacing_for(segments)))
    # The samples do not include the ends of the walls, which protrude the most.
    tree = cKDTree(np.vstack([points, segments.reshape(-1, 2)]))
    middles, gaps, size = lattice = _lattice(low, high, tree)
    graph, free = _graph(lattice, tree, least, comfortable, clearance)
    cells, clearances = middles.reshape(-1, 2)[free], gaps.reshape(-1)[free]
    if not len(cells):
        raise InputError(
            f"{name}: no place that is {least:g} m away from all walls; give a route or a smaller"
            " radius"
        )
    sides = find_sides(world, segments, world.objects[which], lattice, free, graph)
    known = np.ones(len(cells), dtype=np.bool_)
    if world.free is not None:
        known = world.free.contain(cells + world.origin)
    walls_along = _WallsAlong(cells, points, weights, 2.0 * (least + size))
    begin = None
    if start is not None:
        begin = _cell_of(start, cells, known, tree, least, size)
        if begin is None:
            x, y = (start + world.origin).tolist()
            raise InputError(
                f"{name}: no room around the start ({x:g}, {y:g}) for a robot that stays"
                f" {least:g} m away from walls"
            )
    allowed = known & _allowed(sides, known, where, begin, walls_along)
    if not allowed.any():
        place = "free cell" if where is None else f"place {where} the walls"
        raise InputError(
            f"{name}: no {place} that is {least:g} m away from all walls; give a route or a"
            " smaller radius"
        )
    if begin is not None and not allowed[begin]:
        raise InputError(f"{name}: the start does not lie {where} the walls")
    chosen, worth = _best_part(np.flatnonzero(allowed), graph, sides, where, begin, walls_along)
    barred = np.zeros(gaps.size, dtype=np.bool_)
    barred[free] = ~allowed
    if world.free is not None:
        barred |= ~world.free.contain(middles.reshape(-1, 2) + world.origin)
    clearances = clearances[chosen]
    return FreeSpace(
        cells[chosen],
        clearances,
        graph[chosen][:, chosen],
        size,
        least,
        clearances >= comfortable,
        worth,
        tree,
        "outside" if sides.outside[chosen].any() else "inside",
        low,
        barred.reshape(gaps.shape),
        None if begin is None else int(np.searchsorted(chosen, begin)),
    )


def _lattice(low: Float, high: Float, tree: Any) -> Lattice:
    """About `CELLS` cells over the box from low to high, with their distances to the walls."""
    size = float(np.clip(np.sqrt(np.prod(high - low) / CELLS), *CELL_SIZES))
    shape = np.ceil((high - low) / size).astype(int)
    axes = [low[axis] + size * (0.5 + np.arange(shape[axis])) for axis in (0, 1)]
    middles = np.stack(np.meshgrid(*axes, indexing="ij"), axis=2)
    return Lattice(middles, np.asarray(tree.query(middles.reshape(-1, 2))[0]).reshape(shape), size)


def _graph(
    lattice: Lattice, tree: Any, least: float, comfortable: float, clearance: float
) -> tuple[Any, Int]:
    """The costs of the steps between neighbouring free cells, and which cells are free."""
    from scipy.sparse import coo_array

    middles, gaps, _ = lattice
    free = gaps >= least
    number = np.cumsum(free).reshape(free.shape) - 1
    width, height = free.shape
    rows, columns, costs = [], [], []
    for dx, dy in ((1, 0), (0, 1), (1, 1), (1, -1)):
        here = (slice(0, width - dx), slice(max(0, -dy), height - max(0, dy)))
        there = (slice(dx, width), slice(max(0, dy), height + min(0, dy)))
        both = free[here] & free[there]
        start, end = middles[here][both], middles[there][both]
        length = np.hypot(*(end - start).T)
        nearest = np.minimum(gaps[here][both], gaps[there][both])
        # Only steps near a wall need checks between their ends.
        close = np.flatnonzero(nearest < least + 0.5 * length)
        for share in (0.25, 0.5, 0.75):
            between = start[close] * (1.0 - share) + end[close] * share
            nearest[close] = np.minimum(nearest[close], tree.query(between)[0])
        open_ = nearest >= least
        rows.append(number[here][both][open_])
        columns.append(number[there][both][open_])
        # The lower limit avoids a division by zero without a wider clearance.
        nearness = np.clip((clearance - nearest[open_]) / max(clearance - least, 1e-9), 0.0, 1.0)
        tight = TIGHT_PENALTY * (nearest[open_] < comfortable)
        costs.append(length[open_] * (1.0 + WALL_PENALTY * nearness**2 + tight))
    count = int(free.sum())
    row, column, cost = (np.concatenate(part) for part in (rows, columns, costs))
    graph = coo_array((cost, (row, column)), shape=(count, count)).tocsr()
    return graph + graph.T, np.flatnonzero(free.reshape(-1))


@dataclass(frozen=True)
class _WallsAlong:
    """Measures the walls along cells.

    Args:
        cells: (n, 2) the cells [m].
        points: (k, 2) points of the walls [m].
        weights: (k,) the length of wall that each represents [m].
        reach: Largest distance [m] from a cell of a wall along it.
    """

    cells: Float
    points: Float
    weights: Float
    reach: float

    def length(self, cells: Int | Bool) -> float:
        """Length [m] of the walls along some of the cells."""
        from scipy.spatial import cKDTree

        if not len(self.cells[cells]):
            return 0.0
        gap, _ = cKDTree(self.cells[cells]).query(self.points, distance_upper_bound=self.reach)
        return float(self.weights[np.isfinite(gap)].sum())


def _allowed(
    sides: Sides, known: Bool, where: Side | None, begin: int | None, walls_along: _WallsAlong
) -> Bool:
    """Which cells (n,) may be driven through, if they are known to be free."""
    if where is not None:
        return sides.outside if where == "outside" else ~sides.outside
    everywhere = np.ones(len(known), dtype=np.bool_)
    if sides.is_town:
        return everywhere
    outdoors = known & sides.outside
    rooms = known & ~sides.outside & ~sides.in_building
    if outdoors.any() and walls_along.length(rooms) < SUBSTANTIAL * walls_along.length(outdoors):
        # A few walls in the open, which enclose hardly anything.
        return everywhere
    inside = begin is None or not sides.outside[begin]
    return ~sides.outside if inside else sides.outside


def _cell_of(
    start: Float, cells: Float, known: Bool, tree: Any, least: float, size: float
) -> int | None:
    """The nearest known cell that a straight path from the start leads to, or None."""
    from scipy.spatial import cKDTree

    candidates = np.flatnonzero(known)
    if not len(candidates):
        return None
    room = min(float(tree.query(start)[0]), least) - 0.25 * size
    away, near = cKDTree(cells[candidates]).query(start, k=min(16, len(candidates)))
    for distance, candidate in zip(np.atleast_1d(away), np.atleast_1d(near), strict=True):
        if distance > least + 2.0 * size:
            break
        cell = int(candidates[candidate])
        # At least four samples a cell, so that the path does not step over a wall.
        share = np.linspace(0.0, 1.0, int(4.0 * distance / size) + 2)[:, None]
        if (tree.query(start * (1.0 - share) + cells[cell] * share)[0] >= room).all():
            return cell
    return None


def _best_part(
    allowed: Int,
    graph: Any,
    sides: Sides,
    where: Side | None,
    begin: int | None,
    walls_along: _WallsAlong,
) -> tuple[Int, float]:
    """The part of the allowed cells along the most walls, and their weighted length."""
    from scipy.sparse.csgraph import connected_components

    _, label = connected_components(graph[allowed][:, allowed], directed=False)
    parts = np.argsort(-np.bincount(label), kind="stable")[:LARGEST_PARTS]
    if begin is not None:
        parts = label[allowed == begin]
    best, most = allowed, -1.0
    for part in parts:
        cells = allowed[label == part]
        worth = walls_along.length(cells)
        if where is None and sides.in_building[cells[0]]:
            worth *= BUILDING
        elif where is None and sides.outside[cells].any():
            worth *= OPEN
        if worth > most:
            best, most = cells, worth
    return best, most
