"""Walls of an occupancy grid: the outlines of its occupied cells, straightened.

The input is cells, the output segments in units of cells. A wall that is one or two cells thick
becomes one line along its middle, a thicker one its outline, through the middles of the edges
between occupied cells and others. Chains of such points are cut where they bend, each piece becomes
the line that fits its points best, and pieces meet where they met before, so that no beam passes
between.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from lrf3d.geometry import Bool, Float, Int, lengths
from lrf3d.world.pieces import from_corner

Complex = NDArray[np.complex128]

TOLERANCE = 1.05
"""Largest distance [cells] of a chain's points from a piece through two of them: the points of a
straight wall at any angle lie within half a cell of a line, and so within one of such a piece."""

NEAR = 6
"""Distance [cells] from parts of three cells and more within which walls are not thinned: a slanted
wall of two and a half cells has some such parts."""

WIDEST_HOLE = 4.3
"""Largest distance [cells] between ends of walls, or single cells, that are joined: three empty
cells, because measured maps have holes."""

FARTHEST_JOINT = 1.5
"""Largest distance [cells] that a joint is moved to where the fitted lines meet."""

STIFFNESS = 0.001
"""Weight of the place of a joint beside those of the lines that meet there, which may be
parallel."""

LONE = np.array([-0.5, -0.5, 0.5, 0.5])
"""A single cell becomes its diagonal [cells], which is visible from most sides."""

_CELLS = {
    "sw": (np.s_[:-1, :-1], -0.5 - 0.5j),
    "se": (np.s_[:-1, 1:], 0.5 - 0.5j),
    "nw": (np.s_[1:, :-1], -0.5 + 0.5j),
    "ne": (np.s_[1:, 1:], 0.5 + 0.5j),
}
"""The cells around all corners of the lattice, and their middles from there, x + iy [cells]."""

_EDGES = {
    "s": ("sw", "se", -0.5j),
    "n": ("nw", "ne", 0.5j),
    "w": ("sw", "nw", -0.5),
    "e": ("se", "ne", 0.5),
}
"""The edges that meet in a corner: the cells on their sides, and their middles."""

_TURNS = [("s", "n", ""), ("w", "e", "")]
_TURNS += [("s", "w", "sw"), ("s", "e", "se"), ("n", "w", "nw"), ("n", "e", "ne")]
"""Pairs of edges that an outline may connect in a corner, and the cell that it turns around."""


def walls_of_grid(occupied: Bool) -> Float:
    """Segments (n, 4) [cells], relative to the outer corner of the first cell of the first row.

    Args:
        occupied: (rows, columns) whether each cell is occupied; the first row is at the bottom.
            Beyond the grid the cells at its border continue: no outline runs along the border.
    """
    double = _double(occupied)
    grid = _thinned(occupied, double)
    thin = grid & ~_blocks(grid, 2)
    row, column = np.nonzero(thin)
    cells: Complex = column + 0.5 + 1.0j * (row + 0.5)
    pairs = np.sort(np.concatenate(list(_links(grid, thin))), axis=1)
    pairs = np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0)
    pairs = np.concatenate([pairs, _bridges(pairs, cells)])
    lone = cells[~np.isin(cells, pairs)]
    diagonals = np.column_stack([lone.real, lone.imag, lone.real, lone.imag]) + LONE
    return np.concatenate([_straightened(pairs, occupied, double), diagonals])


def _blocks(grid: Bool, side: int) -> Bool:
    """Which cells are part of an occupied square of a side [cells]."""
    return _grown(~_grown(~grid, 0, side), 1 - side, 1)


def _grown(grid: Bool, first: int, end: int) -> Bool:
    """Which cells have one of the grid before or behind them, by first to end − 1 steps."""
    for axis in (0, 1):
        grid = np.logical_or.reduce(
            [np.roll(grid, step, axis) for step in range(-end + 1, 1 - first)]
        )
    return grid


def _double(occupied: Bool) -> Bool:
    """Which cells are of walls that are two cells thick, away from thicker parts."""
    thick = _blocks(occupied, 3)
    return _blocks(occupied, 2) & ~(_grown(thick, -NEAR, NEAR + 1) if thick.any() else thick)


def _thinned(occupied: Bool, double: Bool) -> Bool:
    """The grid with walls two cells thick made one cell thick.

    Cells are removed side by side where they connect their neighbours in no other way (Rosenfeld
    1975), so that what was connected stays connected and no gap is closed.
    """
    grid = np.pad(occupied, 1)
    # Counter-clockwise from the east; those at even places share an edge with the cell.
    steps = [(0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1)]
    for side in (2, 4, 6, 0):
        row, column = np.nonzero(_blocks(grid, 2)[1:-1, 1:-1] & double)
        near = [grid[row + 1 + up, column + 1 + right] for up, right in steps]
        parts = [~near[k] & (near[k + 1] | near[(k + 2) % 8]) for k in (0, 2, 4, 6)]
        gone = ~near[side] & (np.sum(parts, axis=0) == 1)
        grid[row[gone] + 1, column[gone] + 1] = False
    return grid[1:-1, 1:-1]


def _links(grid: Bool, thin: Bool) -> Iterator[Complex]:
    """Pairs (k, 2) of points that follow each other, as x + iy.

    They are the middles of thin cells, and of the edges around thick parts, past each corner of the
    lattice; the point of an edge of a thin cell is the middle of the cell.
    """
    around = {name: grid[cells] for name, (cells, _) in _CELLS.items()}
    every = np.stack([*around.values()])
    mixed = every.any(axis=0) & ~every.all(axis=0)
    row, column = np.nonzero(mixed)
    corner = column + 1.0 + 1.0j * (row + 1.0)
    full = {name: cells[mixed] for name, cells in around.items()}
    fine = {name: thin[cells][mixed] for name, (cells, _) in _CELLS.items()}
    for one, other in (("sw", "se"), ("nw", "ne"), ("sw", "nw"), ("se", "ne")):
        met = fine[one] & fine[other]
        yield np.column_stack([corner[met] + _CELLS[one][1], corner[met] + _CELLS[other][1]])
    for one, other, *empty in (("sw", "ne", "se", "nw"), ("se", "nw", "sw", "ne")):
        met = fine[one] & fine[other] & ~full[empty[0]] & ~full[empty[1]]
        yield np.column_stack([corner[met] + _CELLS[one][1], corner[met] + _CELLS[other][1]])
    edge, point, by_thin = {}, {}, {}
    for side, (one, other, middle) in _EDGES.items():
        edge[side] = full[one] != full[other]
        by_thin[side] = edge[side] & (fine[one] | fine[other])
        owner = np.where(full[one], _CELLS[one][1], _CELLS[other][1])
        point[side] = corner + np.where(by_thin[side], owner, middle)
    saddle = (full["sw"] == full["ne"]) & (full["se"] == full["nw"])
    for first, second, turned in _TURNS:
        # Thin cells have links of their own. At a saddle the outline turns around each empty cell.
        met = edge[first] & edge[second] & ~(by_thin[first] & by_thin[second])
        met &= ~(saddle & full[turned]) if turned else ~saddle
        yield np.column_stack([point[first][met], point[second][met]])


def _bridges(pairs: Complex, cells: Complex) -> Complex:
    """Pairs (k, 2) across holes, between ends of thin walls and single cells, the nearest first."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    nodes, at = np.unique(np.append(pairs, cells), return_inverse=True)
    linked, cell = at[: pairs.size], at[pairs.size :]
    graph = coo_array((np.ones(len(pairs)), (linked[::2], linked[1::2])), shape=(len(nodes),) * 2)
    _, part = connected_components(graph, directed=False)
    free = 2 - np.bincount(linked, minlength=len(nodes))
    ends = cell[free[cell] > 0]
    if not len(ends):
        return np.empty((0, 2), np.complex128)
    places = np.column_stack([nodes[ends].real, nodes[ends].imag])
    near = ends[cKDTree(places).query_pairs(WIDEST_HOLE, output_type="ndarray")]
    near = near[part[near[:, 0]] != part[near[:, 1]]]
    bridges = []
    for one, other in near[np.argsort(np.abs(nodes[near[:, 0]] - nodes[near[:, 1]]))].tolist():
        if free[one] > 0 and free[other] > 0:
            free[[one, other]] -= 1
            bridges.append((nodes[one], nodes[other]))
    return np.array(bridges, np.complex128).reshape(-1, 2)


def _straightened(pairs: Complex, occupied: Bool, double: Bool) -> Float:
    """Segments (n, 4) that fit the chains of pairs (k, 2)."""
    import shapely

    if not len(pairs):
        return np.empty((0, 4))
    lines = shapely.linestrings(np.stack([pairs.real, pairs.imag], axis=-1))
    merged = shapely.get_parts(shapely.line_merge(shapely.multilinestrings(lines)))
    chains = [from_corner(shapely.get_coordinates(chain)) for chain in merged]
    count = np.array([len(chain) for chain in chains])
    number = np.repeat(np.arange(len(chains)), count)
    points = np.concatenate(chains)
    # Both points of a post of two by two cells would become one.
    long = count[number, None] > 2
    points = np.where(long, _in_middle(points, occupied, double), points)
    simple = shapely.simplify(shapely.linestrings(points, indices=number), TOLERANCE)
    corners, owner = shapely.get_coordinates(simple, return_index=True)
    # A chain has no point twice, but the first of a ring, so the corners are found by their places.
    far = 1e3 * (points.max() + 1.0)
    kept = np.isin(points @ [1.0, 1.0j] + far * number, corners @ [1.0, 1.0j] + far * owner)
    place = np.flatnonzero(kept)
    same = number[place[:-1]] == number[place[1:]]
    return _fitted(points, place[:-1][same], place[1:][same])


def _in_middle(points: Float, occupied: Bool, double: Bool) -> Float:
    """The points (k, 2), with those in cells of double walls moved to the middle of both cells."""
    column, row = np.minimum(points, np.array(double.shape[::-1]) - 1).astype(np.int64).T
    moved = np.flatnonzero(double[row, column] & (points % 1.0 == 0.5).all(axis=1))
    row, column, grid = row[moved], column[moved], np.pad(occupied, 1)
    weight, middle = np.zeros((len(moved), 1)), np.zeros((len(moved), 2))
    for up in (-1, 0, 1):
        for right in (-1, 0, 1):
            near = grid[row + 1 + up, column + 1 + right][:, None]
            weight, middle = weight + near, middle + near * [right, up]
    points = points.copy()
    points[moved] += middle / weight
    return points


def _fitted(points: Float, first: Int, last: Int) -> Float:
    """Segments (n, 4) along points (k, 2) from each first to each last one, which still meet."""
    # Next to a corner a point may be of the other side.
    inner = (last - first >= 3).astype(np.int64)
    begin, end = first + inner, last + 1 - inner
    x, y = points.T
    terms = np.stack([np.ones(len(x)), x, y, x * x, x * y, y * y])
    sums = np.pad(np.cumsum(terms, axis=1), ((0, 0), (1, 0)))
    count, x, y, xx, xy, yy = sums[:, end] - sums[:, begin]
    mean = np.stack([x, y]).T / count[:, None]
    angle = 0.5 * np.arctan2(2.0 * (xy - x * y / count), xx - yy - (x * x - y * y) / count)
    normal = np.column_stack([-np.sin(angle), np.cos(angle)])
    # A joint moves to the point that is nearest to its lines.
    ends = np.concatenate([points[first], points[last]])
    joints, joint = np.unique(ends, axis=0, return_inverse=True)
    weight = np.minimum(count, 10.0)[:, None, None]
    outer = np.tile(weight * normal[:, :, None] * normal[:, None, :], (2, 1, 1))
    matrix, right = np.zeros((len(joints), 2, 2)), np.zeros((len(joints), 2))
    np.add.at(matrix, joint, outer)
    np.add.at(right, joint, np.einsum("kij,kj->ki", outer, np.tile(mean, (2, 1)) - ends))
    matrix += STIFFNESS * np.trace(matrix, axis1=1, axis2=2)[:, None, None] * np.eye(2)
    step = np.linalg.solve(matrix, right[:, :, None])[:, :, 0]
    step[np.hypot(step[:, 0], step[:, 1]) > FARTHEST_JOINT] = 0.0
    begins, ends = (joints + step)[joint].reshape(2, -1, 2)
    segments = np.hstack([begins, ends])
    return segments[lengths(segments) > 1e-6]
