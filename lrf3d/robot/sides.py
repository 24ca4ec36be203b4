"""Sides: which free cells are inside, among walls, and which are outside of them.

Doors, windows and gaps connect both, so connectivity alone does not decide it. A place is inside if
walls surround it: in a room there are walls in nearly all directions, in front of a house in half
of them. In a town of closed outlines the streets are outside.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from lrf3d.geometry import Bool, Float, Int, lengths
from lrf3d.world import World
from lrf3d.world.model import DEFAULT_HEIGHT
from lrf3d.world.pieces import pieces_of

DIRECTIONS = [
    *[(1, 0), (2, 1), (1, 1), (1, 2), (0, 1), (-1, 2), (-1, 1), (-2, 1)],
    *[(-1, 0), (-2, -1), (-1, -1), (-1, -2), (0, -1), (1, -2), (1, -1), (2, -1)],
]
"""Directions of the rays from each cell, in cells; a step is at most 2.3 cells long."""

SURROUNDED = 12
"""Least number of these directions in which a surrounded cell has a wall: three quarters. In front
of a straight façade there are 8 or 9, and one metre behind a garage door of 2 m there are 12."""

BLOCKING = 1.2
"""Distance to a wall [cells] below which a cell blocks the view: no step skips such a thick
wall."""

SPECK = 1.0
"""Length [m] of all walls of an object below which it surrounds nothing: a post or a bush, and in
measured maps the specks that lie about outside of a building."""

OPEN_LAND = 5.0
"""Distance to walls [m] at the border of the lattice from where on land is open."""

MOST_PARTS = 300
"""Number of parts of the free space, the largest ones, that are tested for being buildings."""

BUILT_UP = 0.5
"""Share of all walls that are those of buildings in a town."""


@dataclass(frozen=True, slots=True)
class Sides:
    """Where the cells (n,) of a lattice lie.

    Args:
        outside: Which lie outside.
        in_building: Which lie in a closed outline that holds nothing.
        is_town: Whether the walls are those of such buildings, so that outside is in the streets.
    """

    outside: Bool
    in_building: Bool
    is_town: bool


class Lattice(NamedTuple):
    """Square cells (columns, rows) over a box, in the local frame of the world.

    Attributes:
        middles: (columns, rows, 2) their middles [m].
        gaps: (columns, rows) their distances [m] to the nearest wall.
        size: Side of a cell [m].
    """

    middles: Float
    gaps: Float
    size: float


def find_sides(
    world: World, segments: Float, objects: Int, lattice: Lattice, free: Int, graph: Any
) -> Sides:
    """Find on which side of the walls free cells lie.

    Args:
        world: The world.
        segments: (m, 4) its walls that count [m].
        objects: (m,) the object of each.
        lattice: The cells.
        free: (n,) indices of the free cells in the flattened lattice.
        graph: (n, n) the steps between free cells.
    """
    from scipy.sparse.csgraph import connected_components

    middles, gaps, size = lattice
    cells = middles.reshape(-1, 2)[free]
    border = np.ones(gaps.shape, dtype=np.bool_)
    border[1:-1, 1:-1] = False
    seeds = (border & (gaps >= OPEN_LAND)).reshape(-1)[free]
    _, label = connected_components(graph, directed=False)
    building = np.full(int(label.max()) + 1, -1, dtype=np.int64)
    parts, first = np.unique(label, return_index=True)
    largest = np.argsort(-np.bincount(label), kind="stable")[:MOST_PARTS]
    building[parts[largest]] = buildings_around(world, cells[first[largest]])
    built = lengths(segments)[np.isin(objects, building[building >= 0])].sum()
    is_town = bool(built > BUILT_UP * lengths(segments).sum())
    in_building = (building >= 0)[label]
    if is_town:
        return Sides(np.isin(label, label[seeds]), in_building, is_town)
    near = gaps < BLOCKING * size
    near[near] = _beside_walls(middles[near], segments, objects, BLOCKING * size)
    around = _walls_around(near).reshape(-1)[free]
    # Outside is what is connected with open land without passing through surrounded places.
    open_ = np.flatnonzero((around < SURROUNDED) | seeds)
    _, label = connected_components(graph[open_][:, open_], directed=False)
    outside = np.zeros(len(cells), dtype=np.bool_)
    outside[open_] = np.isin(label, label[seeds[open_]])
    return Sides(outside, in_building, is_town)


def _beside_walls(positions: Float, segments: Float, objects: Int, distance: float) -> Bool:
    """Which positions (k, 2) are nearer than a distance [m] to a wall that is not a speck."""
    import shapely

    walls = segments[np.bincount(objects, lengths(segments))[objects] >= SPECK]
    beside = np.zeros(len(positions), dtype=np.bool_)
    tree = shapely.STRtree(shapely.linestrings(walls.reshape(-1, 2, 2)))
    found = tree.query(shapely.points(positions), predicate="dwithin", distance=distance)
    beside[found[0]] = True
    return beside


def _walls_around(blocking: Bool) -> Int:
    """In how many directions (columns, rows) a cell that blocks lies ahead of each cell."""
    columns, rows = blocking.shape
    count = np.zeros(blocking.shape, dtype=np.int64)
    for dx, dy in DIRECTIONS:
        # A cell has a wall ahead if the next cell ahead is a wall or has one ahead itself, so the
        # lattice is swept against the direction, along the axis that it follows more.
        steep = abs(dy) > abs(dx)
        grid = blocking.T if steep else blocking
        major, minor = (dy, dx) if steep else (dx, dy)
        ahead = np.zeros(grid.shape, dtype=np.bool_)
        size = rows if steep else columns
        order = range(size - 1, -1, -1) if major > 0 else range(size)
        for here in order:
            there = here + major
            if 0 <= there < size:
                ahead[here] = _shifted(ahead[there] | grid[there], minor)
        count += ahead.T if steep else ahead
    return count


def _shifted(row: Bool, by: int) -> Bool:
    """The row (n,) whose element i is element i + by of another, and False beyond its ends."""
    shifted = np.zeros_like(row)
    if by >= 0:
        shifted[: len(row) - by] = row[by:]
    else:
        shifted[-by:] = row[:by]
    return shifted


def buildings_around(world: World, points: Float) -> Int:
    """The building (k,), a closed object that holds no other, around each of points; −1 for none.

    One that is inside another closed object is a room, not a building.
    """
    import shapely

    around = np.full(len(points), -1, dtype=np.int64)
    if world.object_count == 1 and world.heights.max() <= DEFAULT_HEIGHT:
        # One ring no higher than a storey and nothing around it: a room.
        return around
    local = world.segments - np.tile(world.origin, 2)
    ends = local.reshape(-1, 2, 2)
    low = np.full((world.object_count, 2), np.inf)
    high = np.full((world.object_count, 2), -np.inf)
    np.minimum.at(low, world.objects, ends.min(axis=1))
    np.maximum.at(high, world.objects, ends.max(axis=1))
    order = np.argsort(world.objects, kind="stable")
    first = np.searchsorted(world.objects[order], np.arange(world.object_count + 1))
    places, middles = shapely.points(points), ends.mean(axis=1)
    boxes = shapely.STRtree(shapely.box(*low.T, *high.T))
    pairs = boxes.query(places, predicate="intersects")
    held = np.zeros(len(points), dtype=np.bool_)
    for number in np.unique(pairs[1]).tolist():
        rings = pieces_of(local[order[first[number] : first[number + 1]]])
        if not all(ring.closed for ring in rings):
            continue
        # Symmetric differences count crossings, so a courtyard is not inside.
        area = shapely.Polygon()
        for ring in rings:
            area = shapely.symmetric_difference(
                area, shapely.make_valid(shapely.Polygon(ring.points))
            )
        shapely.prepare(area)
        near = pairs[0, pairs[1] == number]
        inside = near[shapely.contains_properly(area, places[near])]
        boxed = ((middles >= low[number]) & (middles <= high[number])).all(axis=1)
        others = shapely.points(middles[boxed & (world.objects != number)])
        if shapely.contains_properly(area, others).any():
            held[inside] = True
        else:
            around[inside] = number
    return np.where(held, -1, around)
