"""Free space: the places where a robot can be between the walls, and the steps between them."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Bool, Float, Int
from lrf3d.planning.distances import BLOCK, connected
from lrf3d.planning.sides import Ground, Side

WALL_PENALTY, TIGHT_PENALTY = 6.0, 10.0
"""Factors by which a step at the least distance to a wall costs more than in the open, and
additionally one through a tight place, which is taken only to get behind it."""


@dataclass(frozen=True)
class FreeSpace:
    """The places where a robot can stand, all joined to each other.

    Args:
        ground: The land.
        allowed: (columns, rows) the cells that the robot's middle may be in.
        places: (k, 2) places in the local frame [m].
        gaps: (k,) distance of each to the nearest wall [m].
        graph: (k, k) sparse matrix of the costs of steps between neighbours.
        side: The side of the walls.
        start: The place where the drive starts, or None if it may start anywhere.
    """

    ground: Ground
    allowed: Bool
    places: Float
    gaps: Float
    graph: Any
    side: Side
    start: int | None = None

    @property
    def spacing(self) -> float:
        """Usual distance of neighbouring places [m]."""
        return BLOCK * self.ground.grid.size

    def room(self, points: Float) -> Float:
        """Distances (k,) to walls at points (k, 2) [m]; −1 where the robot may not be."""
        cells = self.ground.grid.cells(points)
        return np.where(self.allowed[cells], self.ground.grid.gaps[cells], -1.0)

    def length(self, path: Int) -> float:
        """Length [m] of a path of neighbouring places."""
        steps = np.diff(self.places[path], axis=0)
        return float(np.hypot(steps[:, 0], steps[:, 1]).sum())


def find_free_space(
    ground: Ground,
    needed: Float | float,
    *,
    comfortable: float = 0.0,
    clearance: float = 0.0,
    where: Side | None = None,
    start: Float | None = None,
) -> FreeSpace:
    """The free space of a robot.

    In a plan of rooms it is inside, in a town outside of the buildings. If walls divide it, the
    part along most of the walls is chosen. In a map with known free cells only those are used.

    Args:
        ground: The land.
        needed: Least distance to walls [m], everywhere or in each cell (columns, rows).
        comfortable: Distance to walls [m] below which a place is tight, such as a door.
        clearance: Distance to walls [m] that is kept where there is room.
        where: The side of the walls to stay on; it depends on the world and the start if not given.
        start: Position x, y [m] that the space must contain; any if not given.

    Raises:
        InputError: There is no room for the robot between the walls.
    """
    from scipy.sparse.csgraph import connected_components

    name, grid = ground.world.name or "world", ground.grid
    least = float(np.min(needed))
    free = ground.known & (grid.gaps >= needed)
    begin = None if start is None else _cell_near(ground, free, start, least)
    allowed = ground.permitted(free, where, begin) if free.any() else free
    if not allowed.any():
        what = "free cell" if ground.world.free is not None else "place"
        side = "" if where is None else f" {where} the walls"
        raise InputError(
            f"{name}: no {what}{side} that is {least:g} m away from all walls; give a route or a"
            " smaller radius"
        )
    if begin is not None and not allowed[begin]:
        raise InputError(f"{name}: the start does not lie {where} the walls")
    parts, count = connected(allowed)
    if begin is not None:
        best = int(parts[begin])
    else:
        worth = ground.walls_along(parts, count=count) * ground.weights(parts, count)
        best = int(np.argmax(worth[1:])) + 1
    allowed = parts == best
    cells = _places(grid.gaps, allowed, clearance)
    graph = _graph(ground, allowed, cells, least, comfortable, max(clearance, least))
    _, group = connected_components(graph, directed=False)
    here = None
    if begin is not None:
        here = int(np.argmin(np.hypot(cells[0] - begin[0], cells[1] - begin[1])))
    chosen = np.flatnonzero(group == (np.bincount(group).argmax() if here is None else group[here]))
    cells = (cells[0][chosen], cells[1][chosen])
    outside = ground.outside[cells]
    # In a map what is unknown may look like the outside.
    is_open = outside.mean() > 0.5 if ground.world.free is not None else outside.any()
    return FreeSpace(
        ground,
        allowed,
        grid.points(cells),
        grid.gaps[cells],
        graph[chosen][:, chosen],
        "outside" if is_open else "inside",
        None if here is None else int(np.searchsorted(chosen, here)),
    )


def _cell_near(ground: Ground, free: Bool, start: Float, least: float) -> tuple[int, int]:
    """The nearest free cell that a straight path from the start leads to.

    Raises:
        InputError: There is none.
    """
    grid, local = ground.grid, start - ground.world.origin
    points = grid.points(free)
    away = np.hypot(*(points - local).T)
    # The start itself may be nearer to a wall than the route.
    room = min(float(grid.gaps[grid.cells(local)]), least) - grid.size
    for nearest in np.argsort(away)[:64]:
        if away[nearest] > least + 2 * BLOCK * grid.size:
            break
        share = np.linspace(0.0, 1.0, int(4.0 * away[nearest] / grid.size) + 2)[:, None]
        if (grid.gaps[grid.cells(local + share * (points[nearest] - local))] >= room).all():
            column, row = grid.cells(points[nearest])
            return int(column), int(row)
    raise InputError(
        f"{ground.world.name or 'world'}: no room around the start ({start[0]:g}, {start[1]:g}) for"
        f" a robot that stays {least:g} m away from walls"
    )


def _places(gaps: Float, allowed: Bool, clearance: float) -> tuple[Int, Int]:
    """The cell of each block in which there is the most room, at its middle where there is enough.

    In a doorway places therefore lie on its middle line, wherever the blocks lie.
    """
    columns, rows = (side // BLOCK for side in gaps.shape)
    middle = np.zeros((BLOCK, BLOCK))
    middle[BLOCK // 2, BLOCK // 2] = 1e-6
    score = np.where(allowed, np.minimum(gaps, clearance), -1.0)
    blocks = score.reshape(columns, BLOCK, rows, BLOCK).swapaxes(1, 2) + middle
    blocks = blocks.reshape(columns, rows, BLOCK * BLOCK)
    best = blocks.argmax(axis=2)
    column, row = np.nonzero(np.take_along_axis(blocks, best[..., None], 2)[..., 0] > -0.5)
    of = best[column, row]
    return BLOCK * column + of // BLOCK, BLOCK * row + of % BLOCK


def _graph(
    ground: Ground,
    allowed: Bool,
    cells: tuple[Int, Int],
    least: float,
    comfortable: float,
    clearance: float,
) -> Any:
    """The costs of the steps between neighbouring places."""
    from scipy.sparse import coo_array

    grid, points = ground.grid, ground.grid.points(cells)
    columns, rows = (side // BLOCK for side in grid.gaps.shape)
    number = np.full((columns + 2, rows + 2), -1)
    block = (cells[0] // BLOCK + 1, cells[1] // BLOCK + 1)
    number[block] = np.arange(len(points))
    starts, ends, costs = [], [], []
    for dx, dy in ((1, 0), (0, 1), (1, 1), (1, -1)):
        other = number[block[0] + dx, block[1] + dy]
        here = np.flatnonzero(other >= 0)
        there = other[here]
        clear, nearest = np.ones(len(here), dtype=np.bool_), np.full(len(here), np.inf)
        for share in np.linspace(0.0, 1.0, 2 * BLOCK + 1)[:, None]:
            between = grid.cells(points[here] * (1.0 - share) + points[there] * share)
            clear &= allowed[between]
            nearest = np.minimum(nearest, grid.gaps[between])
        here, there, nearest = here[clear], there[clear], nearest[clear]
        length = np.hypot(*(points[there] - points[here]).T)
        nearness = np.clip((clearance - nearest) / max(clearance - least, 1e-9), 0.0, 1.0)
        tight = TIGHT_PENALTY * (nearest < comfortable)
        starts.append(here)
        ends.append(there)
        costs.append(length * (1.0 + WALL_PENALTY * nearness**2 + tight))
    start, end, cost = (np.concatenate(part) for part in (starts, ends, costs))
    graph = coo_array((cost, (start, end)), shape=(len(points), len(points))).tocsr()
    return graph + graph.T
