"""Walls of an occupancy grid: the outlines of its occupied cells, straightened.

The input is cells, the output segments in units of cells. A wall that is one or two cells thick
becomes one line along its middle, a thicker one its outline, through the middles of the edges
between occupied cells and others. Chains of such points are cut where they bend, each piece becomes
the line that fits its points best, and pieces meet where they met before, so that no beam passes
between. Points are complex numbers x + iy [cells].
"""

from collections.abc import Iterator
from functools import reduce
from typing import Any

import numpy as np
import scipy
import shapely
from numpy.typing import NDArray

from lrf3d.base.errors import WorldError
from lrf3d.geometry.lines import ROUNDING, Bool, Float, Int, lengths
from lrf3d.world.pieces import from_corner

Complex = NDArray[np.complex128]

# Rows and columns to the neighbours of a cell, counter-clockwise from the east.
AROUND = [(0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1)]


def parts_of(cells: Bool) -> tuple[Int, int]:
    """The connected part of each cell, from 1, 0 in the others, and the number of parts.

    Cells that touch at a corner are connected.
    """
    parts, count = scipy.ndimage.label(cells, np.ones((3, 3)))
    return np.asarray(parts, dtype=np.int64), int(count)


def box_of(cells: Bool, margin: int = 0) -> tuple[slice, slice]:
    """The rows and columns of the box around some cells, with a margin [cells]."""
    found = (np.flatnonzero(cells.any(axis=axis)) for axis in (1, 0))
    row, column = (
        slice(max(int(own[0]) - margin, 0), int(own[-1]) + margin + 1) if len(own) else slice(0)
        for own in found
    )
    return row, column


def sides_of(parts: Any) -> Int:
    """Height and width (count, 2) [pixels] of the box around each part."""
    boxes = [[part.stop - part.start for part in box] for box in scipy.ndimage.find_objects(parts)]
    return np.array(boxes, dtype=np.int64).reshape(-1, 2)


def extent_of(cells: Bool) -> float:
    """The larger side [pixels] of the box around some cells."""
    return float(max(side.stop - side.start for side in box_of(cells)) if cells.any() else 0)


def grown(cells: Bool, radius: float) -> Bool:
    """Which cells are within a radius [cells] of some cells."""
    near = np.zeros_like(cells)
    box = box_of(cells, int(radius) + 2)
    if near[box].size:
        # Distances take much time and memory.
        row, column = np.indices((5, 5)) - 2
        near[box] = (
            scipy.ndimage.binary_dilation(cells[box], row**2 + column**2 <= radius**2)
            if radius < 3.0
            else scipy.ndimage.distance_transform_edt(~cells[box]) <= radius
        )
    return near


def on_border(cells: Any) -> Any:
    """The values of cells (rows, columns) at the border, each once."""
    return np.unique(np.concatenate([cells[0], cells[-1], cells[:, 0], cells[:, -1]]))


def walls_of_grid(occupied: Bool) -> Float:
    """Segments (n, 4) [cells] of a grid (rows, columns), the first row at the bottom.

    They begin at the outer corner of the first cell. Beyond the grid the cells at its border
    continue: no outline runs along the border.
    """
    borders = sum(np.count_nonzero(np.diff(occupied, axis=axis)) for axis in (0, 1))
    # Largest number of sides between an occupied cell and another: each takes about a kilobyte. The
    # map of a hall of 100 m at 5 cm has some ten thousand.
    most_borders = 500_000
    if borders > most_borders:
        found = f"{borders:,} borders between occupied cells and others, over {most_borders:,}"
        raise WorldError(f"{found}: a pattern, or noise; clean the picture, or cut it")
    double = _opened(occupied, 2)
    # A slanted wall of two and a half cells has parts of three, about which nothing is thinned.
    double &= ~scipy.ndimage.maximum_filter(_opened(occupied, 3), 13, mode="constant")
    grid = _thinned(occupied, double)
    thick = _opened(grid, 2)
    thin = np.argwhere(grid & ~thick)
    cells = np.asarray((thin + 0.5) @ [1.0j, 1.0], dtype=np.complex128)
    pairs = np.concatenate([*_outline(thick), *_thin_links(grid, thick, thin, cells)])
    chains = _merged(pairs)
    bridges = _bridges(chains, cells[~np.isin(cells, pairs)])
    chains = _merged(np.concatenate([pairs, bridges])) if len(bridges) else chains
    lone = cells[~np.isin(cells, np.concatenate([*chains, [0.0]]))]
    # A single cell becomes its diagonal, which is visible from most sides.
    diagonals = np.column_stack([lone.real, lone.imag] * 2) + np.array([-0.5, -0.5, 0.5, 0.5])
    return np.concatenate([_straightened(chains, occupied, double), diagonals])


def _opened(grid: Bool, side: int) -> Bool:
    """Which cells are part of an occupied square of a side [cells]."""
    # Row by row and then column by column: three times as fast as scipy's opening.
    grid = np.pad(grid, side - 1)
    for combine in (np.logical_and, np.logical_or):
        for _ in range(2):
            count = len(grid) - side + 1
            grid = reduce(combine, [grid[k : k + count] for k in range(side)]).T
    return grid


def _around(grid: Bool, cells: Int) -> Bool:
    """Whether each of the eight neighbours (8, k) of cells (k, 2) is in the grid."""
    padded = np.pad(grid, 1)
    return np.array([padded[tuple((cells + step).T)] for step in 1 + np.array(AROUND)])


def _thinned(grid: Bool, double: Bool) -> Bool:
    """The grid with walls two cells thick made one cell thick.

    Cells are removed side by side where they connect their neighbours in no other way (Rosenfeld
    1975), so that what was connected stays connected and no gap is closed.
    """
    grid = grid.copy()
    for side in (2, 4, 6, 0):
        cells = np.argwhere(_opened(grid, 2) & double)
        near = _around(grid, cells)
        parts = ~near[::2] & (near[1::2] | np.roll(near[::2], -1, axis=0))
        grid[tuple(cells[~near[side] & (parts.sum(axis=0) == 1)].T)] = False
    return grid


def _outline(thick: Bool) -> Iterator[Complex]:
    """Pairs (k, 2) of middles of edges around cells, past each corner of the lattice."""
    four = np.array([thick[:-1, :-1], thick[:-1, 1:], thick[1:, :-1], thick[1:, 1:]])
    corners = np.argwhere(four.any(axis=0) & ~four.all(axis=0))
    sw, se, nw, ne = four[:, *corners.T]
    south, north, west, east = edges = [sw != se, nw != ne, sw != nw, se != ne]
    saddle = np.logical_and.reduce(edges)
    # At a saddle the outline turns around each empty cell.
    for one, other, first, second, around in (
        (south, north, -0.5j, 0.5j, saddle),
        (west, east, -0.5, 0.5, saddle),
        (south, west, -0.5j, -0.5, saddle & sw),
        (south, east, -0.5j, 0.5, saddle & se),
        (north, west, 0.5j, -0.5, saddle & nw),
        (north, east, 0.5j, 0.5, saddle & ne),
    ):
        corner = (corners[one & other & ~around] + 1.0) @ [1.0j, 1.0]
        yield np.column_stack([corner + first, corner + second])


def _thin_links(grid: Bool, thick: Bool, thin: Int, cells: Complex) -> Iterator[Complex]:
    """Pairs (k, 2) of the middles of thin cells and of thin or thick neighbours.

    The thin cells (k, 2) are rows and columns; their middles (k,) are the cells.
    """
    linked = _around(grid, thin)
    solid = _around(thick, thin)
    # Cells that touch at a corner are linked past their common neighbours, if there is one.
    linked[1::2] &= ~(linked[::2] | np.roll(linked[::2], -1, axis=0))
    for place, (up, right) in enumerate(AROUND):
        if place < 4:
            cell = cells[linked[place] & ~solid[place]]
            yield np.column_stack([cell, cell + right + 1.0j * up])
        # The outline of a thick part passes through the middles of its edges.
        cell = cells[linked[place] & solid[place]]
        yield np.column_stack([cell, cell + (right if up else 0.5 * right) + 0.5j * up])


def _merged(pairs: Any) -> list[Complex]:
    """Chains of the points of pairs (k, 2), from one end or branch to the next."""
    lines = shapely.linestrings(np.stack([pairs.real, pairs.imag], axis=-1))
    merged = shapely.get_parts(shapely.line_merge(shapely.multilinestrings(lines)))
    chains = [shapely.get_coordinates(chain) for chain in merged]
    starts, last = (np.array([chain[end] @ [1.0, 1.0j] for chain in chains]) for end in (0, -1))
    ends, count = np.unique([starts, last], return_counts=True)
    # A ring that another wall meets begins there.
    met = np.isin(starts, ends[count > 2])
    opened = (own if at else from_corner(own) for own, at in zip(chains, met, strict=True))
    return [points[:, 0] + 1.0j * points[:, 1] for points in opened]


def _bridges(chains: list[Complex], lone: Complex) -> Complex:
    """Pairs (k, 2) across holes, between ends of walls and single cells, the nearest first."""
    # Imported here, as it is slow to import.
    from scipy.spatial import cKDTree

    ends = np.array([end for chain in chains for end in (chain[0], chain[-1])])
    _, where, count = np.unique(ends, return_inverse=True, return_counts=True)
    single = np.flatnonzero(count[where] == 1)
    free = np.concatenate([ends[single], lone])
    owner = np.concatenate([single // 2, -1 - np.arange(len(lone))])
    slots = np.repeat([1, 2], [len(single), len(lone)])
    tree = cKDTree(np.column_stack([free.real, free.imag]))
    # Measured maps have holes: three empty cells are bridged.
    near = tree.query_pairs(4.3, output_type="ndarray")
    near = near[owner[near[:, 0]] != owner[near[:, 1]]]
    bridges = []
    for pair in near[np.argsort(np.abs(free[near[:, 0]] - free[near[:, 1]]))]:
        if slots[pair].all():
            slots[pair] -= 1
            bridges.append(free[pair])
    return np.array(bridges, np.complex128).reshape(-1, 2)


def _straightened(chains: list[Complex], occupied: Bool, double: Bool) -> Float:
    """Segments (n, 4) that fit the chains."""
    if not chains:
        return np.empty((0, 4))
    count = np.array([len(chain) for chain in chains])
    number = np.repeat(np.arange(len(chains)), count)
    first = np.cumsum(count) - count
    points = np.concatenate(chains)
    inside = (points.real % 1.0 == 0.5) & (points.imag % 1.0 == 0.5)
    cells = np.column_stack([points.imag, points.real])[inside].astype(np.int64)
    # The middle of a wall two cells thick is the mean of its cells here.
    near = _around(occupied, cells)
    steps = np.array(AROUND) @ [1.0j, 1.0]
    moved = points.copy()
    moved[inside] += double[tuple(cells.T)] * (steps @ near) / (near.sum(axis=0) + 1)
    # Both points of a post of two by two cells would become one.
    post = (count == 2) & (moved[first] == moved[first + 1])
    points = np.where(post[number], points, moved)
    places = np.column_stack([points.real, points.imag])
    # The points of a straight wall at any angle lie within half a cell of a line, and so within one
    # of a piece through two of them.
    simple = shapely.simplify(shapely.linestrings(places, indices=number), 1.0)
    corners, owner = shapely.get_coordinates(simple, return_index=True)
    # A chain has no point twice, but the first of a ring, so the corners are found by their places.
    far = 1e3 * (places.max() + 1.0)
    kept = np.isin(points + far * number, corners @ [1.0, 1.0j] + far * owner)
    place = np.flatnonzero(kept)
    same = number[place[:-1]] == number[place[1:]]
    return _fitted(places, place[:-1][same], place[1:][same])


def _fitted(points: Float, first: Int, last: Int) -> Float:
    """Segments (n, 4) along points (k, 2) from each first to each last one, which still meet."""
    # Next to a corner a point may be of the other side.
    inner = (last - first >= 3).astype(np.int64)
    begin = first + inner
    end = last + 1 - inner
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
    matrix = np.zeros((len(joints), 2, 2))
    right = np.zeros((len(joints), 2))
    np.add.at(matrix, joint, outer)
    np.add.at(right, joint, np.einsum("kij,kj->ki", outer, np.tile(mean, (2, 1)) - ends))
    # Lines that meet may be parallel: the place of the joint itself has a little weight.
    matrix += 0.001 * np.trace(matrix, axis1=1, axis2=2)[:, None, None] * np.eye(2)
    step = np.linalg.solve(matrix, right[:, :, None])[:, :, 0]
    step[np.hypot(step[:, 0], step[:, 1]) > 1.0] = 0.0
    segments = np.hstack([*(joints + step)[joint].reshape(2, -1, 2)])
    return segments[lengths(segments) > ROUNDING]
