"""Mazes: grids of cells with the fewest open passages that connect all of them."""

import numpy as np

from lrf3d.geometry import Bool
from lrf3d.world.floor_plan import FloorPlan
from lrf3d.world.model import World

PASSAGE = 2.6
"""From one wall of a maze to the next [m]."""


def maze(size: float, seed: int) -> World:
    """A maze: any two places are joined by just one way, a random spanning tree of its cells."""
    count = max(3, int(size / PASSAGE))
    plan = FloorPlan(f"maze {seed}")
    open_east, open_north = maze_passages(count, np.random.default_rng(seed))
    span = count * PASSAGE
    plan.outer_walls(span, span)
    for row in range(count):
        for column in range(count):
            x, y = (column + 1) * PASSAGE, (row + 1) * PASSAGE
            if column + 1 < count and not open_east[row, column]:
                plan.wall(x, y - PASSAGE, x, y)
            if row + 1 < count and not open_north[row, column]:
                plan.wall(x - PASSAGE, y, x, y)
    return plan.world()


def maze_passages(count: int, rng: np.random.Generator) -> tuple[Bool, Bool]:
    """Which cells (count, count) of a maze are open to the east and to the north of them.

    The passages are the smallest spanning tree of the grid under random weights (Kruskal 1956).
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import minimum_spanning_tree

    cell = np.arange(count * count).reshape(count, count)
    start = np.concatenate([cell[:, :-1].reshape(-1), cell[:-1].reshape(-1)])
    end = np.concatenate([cell[:, 1:].reshape(-1), cell[1:].reshape(-1)])
    weights = rng.uniform(1.0, 2.0, len(start))
    tree = minimum_spanning_tree(coo_array((weights, (start, end)), shape=(cell.size, cell.size)))
    here, there = tree.tocoo().coords
    east, north = np.zeros((2, count, count), dtype=bool)
    step = there - here
    east.reshape(-1)[here[step == 1]] = True
    north.reshape(-1)[here[step == count]] = True
    return east, north
