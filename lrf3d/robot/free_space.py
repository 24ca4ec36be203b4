"""Free space: where a robot can be between the walls, as a lattice of cells joined to a graph.

A world enters; the cells that keep off the walls leave, in the local frame of the world, with
the steps between them and what each step costs.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Bool, Float, Int, lengths
from lrf3d.world import World
from lrf3d.world.model import DEFAULT_HEIGHT
from lrf3d.world.pieces import pieces_of

SURROUNDINGS = 6.0
"""How far [m] around the walls a robot may drive."""

WIDEST = 500.0
"""Largest side [m] of the part of a world that is planned in: as much as a drive can show."""

CELLS = 100_000
"""About how many cells the lattice has, as far as their size allows."""

CELL_SIZES = (0.1, 1.0)
"""Smallest and largest side of a cell [m]: a fifth of a door, and a third of a narrow street."""

WALL_PENALTY = 6.0
"""How many times dearer than in the open a step is at the least distance to a wall."""

TIGHT_PENALTY = 10.0
"""How many times dearer again a step through a tight place is: none is taken but to get behind."""

LARGEST_PARTS = 8
"""How many parts of the free space, the largest, are compared."""

SPACING = 0.2
"""Distance [m] between the points of the walls that distances are measured to."""


SAMPLES, MANY_SAMPLES = 20_000_000, 1_000_000
"""Most samples of all walls together, and from how many on those that lie together count as one:
4,000 km and 200 km of walls, of which a window of 500 m shows a part."""


@dataclass(frozen=True)
class FreeSpace:
    """The cells that a robot can stand in, all joined to each other.

    Args:
        cells: (k, 2) their middles [m] in the local frame.
        clearances: (k,) distance [m] of each to the nearest wall.
        graph: (k, k) sparse matrix of the costs of steps between neighbours.
        size: Side of a cell [m].
        least: Distance [m] to walls that is always kept.
        roomy: (k,) whether each is no tight place.
        worth: Length [m] of the walls along it, weighed by how much they are to be driven to.
        walls: The nearest-neighbour tree over points of the walls.
    """

    cells: Float
    clearances: Float
    graph: Any
    size: float
    least: float
    roomy: Bool
    worth: float
    walls: Any

    def clearance(self, points: Float) -> Float:
        """Distance (k,) [m] of points (k, 2) of the local frame to the nearest wall."""
        return np.asarray(self.walls.query(points)[0], dtype=np.float64)


def find_free_space(
    world: World, *, least: float, clearance: float, comfortable: float = 0.0
) -> FreeSpace:
    """The free space of a world, or of its densest part where it is very large.

    Where walls part the free space, the part along most of the walls is chosen; the inside of a
    building only where nothing else is left.

    Args:
        world: The walls.
        least: Distance to walls [m] that is always kept.
        clearance: Distance to walls [m] that is kept where there is room.
        comfortable: Distance to walls [m] below which a place is tight: a door.

    Raises:
        InputError: There are no walls, or there is no room for the robot between them.
    """
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    if not len(world.segments):
        raise InputError(f"{world.name or 'world'}: no walls, so no route can be found")
    segments = world.segments - np.tile(world.origin, 2)
    points, weights = sample_walls(segments, _spacing(segments))
    low, high = _window(points, weights)
    # Walls out of reach of the window change nothing in it, however many there are.
    reach = clearance + least + SURROUNDINGS
    segments = segments[_meets(segments, low - reach, high + reach)]
    points, weights = _thinned(*sample_walls(segments, _spacing(segments)))
    size = float(np.clip(np.sqrt(np.prod(high - low) / CELLS), *CELL_SIZES))
    # The samples stop short of the ends of the walls, which stand out the most.
    tree = cKDTree(np.vstack([points, segments.reshape(-1, 2)]))
    shape = np.ceil((high - low) / size).astype(int)
    x, y = (low[axis] + size * (0.5 + np.arange(shape[axis])) for axis in (0, 1))
    middles = np.stack(np.meshgrid(x, y, indexing="ij"), axis=2)
    gaps = np.asarray(tree.query(middles.reshape(-1, 2))[0]).reshape(shape)
    graph, index = _graph(middles, gaps, tree, (least, comfortable, clearance))
    cells, gaps = middles.reshape(-1, 2)[index], gaps.reshape(-1)[index]
    if not len(cells):
        raise InputError(
            f"{world.name or 'world'}: no place that is {least:g} m away from all walls; give a"
            " route or a smaller radius"
        )
    _, label = connected_components(graph, directed=False)
    part, worth = _best_part(world, cells, np.asarray(label), points, weights, least + size)
    chosen = np.flatnonzero(label == part)
    gaps = gaps[chosen]
    roomy = gaps >= comfortable
    return FreeSpace(cells[chosen], gaps, graph[chosen][:, chosen], size, least, roomy, worth, tree)


def sample_walls(segments: Float, spacing: float) -> tuple[Float, Float]:
    """Points (k, 2) along segments (n, 4) at most a spacing apart, and the length (k,) each has."""
    counts = np.ceil(lengths(segments) / spacing).astype(int)
    wall = np.repeat(np.arange(len(segments)), counts)
    step = np.arange(len(wall)) - np.repeat(np.cumsum(counts) - counts, counts)
    place = ((step + 0.5) / counts[wall])[:, None]
    points = segments[wall, :2] * (1.0 - place) + segments[wall, 2:] * place
    return points, lengths(segments)[wall] / counts[wall]


def _spacing(segments: Float) -> float:
    """Distance [m] between samples: no less than lets memory hold those of walls laid on walls."""
    return max(SPACING, float(lengths(segments).sum()) / SAMPLES)


def _thinned(points: Float, weights: Float) -> tuple[Float, Float]:
    """Samples (k, 2) with their weights; where there are very many, one for each small cell."""
    if len(points) <= MANY_SAMPLES:
        return points, weights
    cells = np.floor((points - points.min(axis=0)) / (0.5 * SPACING)).astype(np.int64)
    rows = cells[:, 0] * (int(cells[:, 1].max()) + 1) + cells[:, 1]
    _, first, cell = np.unique(rows, return_index=True, return_inverse=True)
    total = np.bincount(cell.reshape(-1), weights).astype(np.float64)
    return points[first], total


def _meets(segments: Float, low: Float, high: Float) -> Any:
    """Which segments' boxes meet the box from `low` to `high`."""
    ends = segments.reshape(-1, 2, 2)
    return ((ends.max(axis=1) > low) & (ends.min(axis=1) < high)).all(axis=1)


def _window(points: Float, weights: Float) -> tuple[Float, Float]:
    """The box to plan in: around all walls, or where the most walls stand if that is too wide."""
    from scipy.ndimage import uniform_filter

    low, high = points.min(axis=0) - SURROUNDINGS, points.max(axis=0) + SURROUNDINGS
    if (high - low).max() <= WIDEST:
        return low, high
    tile = WIDEST / 10.0
    counts = np.minimum(np.ceil((high - low) / tile).astype(int), 4000)
    edges = [np.linspace(low[axis], high[axis], counts[axis] + 1) for axis in (0, 1)]
    amount, _, _ = np.histogram2d(points[:, 0], points[:, 1], bins=edges, weights=weights)
    amount = uniform_filter(amount, size=9, mode="constant")
    place = np.array(np.unravel_index(int(np.argmax(amount)), amount.shape))
    middle = low + (place + 0.5) * (high - low) / counts
    return np.maximum(low, middle - WIDEST / 2), np.minimum(high, middle + WIDEST / 2)


def _graph(
    middles: Float, gaps: Float, tree: Any, distances: tuple[float, float, float]
) -> tuple[Any, Int]:
    """The costs of the steps between neighbouring free cells, and which cells are free."""
    from scipy.sparse import coo_array

    least, comfortable, clearance = distances
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
        # Only steps by a wall need a look at what lies between their ends.
        close = np.flatnonzero(nearest < least + 0.5 * length)
        for place in (0.25, 0.5, 0.75):
            between = start[close] * (1.0 - place) + end[close] * place
            nearest[close] = np.minimum(nearest[close], tree.query(between)[0])
        open_ = nearest >= least
        rows.append(number[here][both][open_])
        columns.append(number[there][both][open_])
        nearness = np.clip((clearance - nearest[open_]) / max(clearance - least, 1e-9), 0.0, 1.0)
        tight = TIGHT_PENALTY * (nearest[open_] < comfortable)
        costs.append(length[open_] * (1.0 + WALL_PENALTY * nearness**2 + tight))
    count = int(free.sum())
    row, column, cost = (np.concatenate(part) for part in (rows, columns, costs))
    graph = coo_array((cost, (row, column)), shape=(count, count)).tocsr()
    return graph + graph.T, np.flatnonzero(free.reshape(-1))


def _best_part(
    world: World, cells: Float, label: Any, points: Float, weights: Float, reach: float
) -> tuple[int, float]:
    """The part of the free space along which the most walls stand, and their weighed length."""
    from scipy.spatial import cKDTree

    largest = np.argsort(-np.bincount(label), kind="stable")[:LARGEST_PARTS]
    walls = []
    for part in largest:
        gap, _ = cKDTree(cells[label == part]).query(points, distance_upper_bound=2.0 * reach)
        walls.append(weights[np.isfinite(gap)].sum())
    # Both sides of one wall look alike, so a room goes before the land around it; what is inside
    # a building stays out unless little else is there.
    inside = inside_buildings(world, cells[[int(np.argmax(label == part)) for part in largest]])
    outside = largest == label[int(np.argmin(cells.sum(axis=1)))]
    worth = np.array(walls) * np.where(inside, 0.3, np.where(outside, 0.95, 1.0))
    return int(largest[np.argmax(worth)]), float(worth.max())


def inside_buildings(world: World, points: Float) -> Any:
    """Which of the points (k, 2) lie in a closed object that holds no other object."""
    import shapely

    inside = np.zeros(len(points), dtype=bool)
    if world.object_count == 1 and world.heights.max() <= DEFAULT_HEIGHT:
        # One ring no higher than a storey and nothing around it: a room.
        return inside
    local = world.segments - np.tile(world.origin, 2)
    places = shapely.points(points)
    middles = shapely.points(0.5 * (local[:, :2] + local[:, 2:]))
    for number in _around(world, local, points):
        own = world.objects == number
        rings = pieces_of(local[own])
        if all(ring.closed for ring in rings):
            # Symmetric differences count crossings, so a courtyard is not inside.
            area = shapely.Polygon()
            for ring in rings:
                area = shapely.symmetric_difference(
                    area, shapely.make_valid(shapely.Polygon(ring.points))
                )
            shapely.prepare(area)
            if not shapely.contains_properly(area, middles[~own]).any():
                inside |= shapely.contains_properly(area, places)
    return inside


def _around(world: World, local: Float, points: Float) -> Int:
    """Objects whose boxes hold any of the points (k, 2): a building around a point is one."""
    ends = local.reshape(-1, 2, 2)
    low = np.full((world.object_count, 2), np.inf)
    high = np.full((world.object_count, 2), -np.inf)
    np.minimum.at(low, world.objects, ends.min(axis=1))
    np.maximum.at(high, world.objects, ends.max(axis=1))
    held = [((point >= low) & (point <= high)).all(axis=1) for point in points]
    return np.flatnonzero(np.any(held, axis=0))
