"""Free space: the places where a robot can be between the walls, and the steps between them."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Bool, Float, Int
from lrf3d.planning.distances import BLOCK, connected
from lrf3d.planning.sides import Ground, Side


@dataclass(frozen=True)
class FreeSpace:
    """The places (k, 2) [m] where a robot can stand, all joined to each other, in the local frame.

    Cells (columns, rows) in which it may be are allowed. Gaps (k,) are the distances of the places
    to the nearest wall [m]; the sparse matrix (k, k) has the costs of steps between neighbours. The
    drive starts at one of the places, or anywhere.
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
    clearance: float = 0.0,
    where: Side | None = None,
    start: Float | None = None,
) -> FreeSpace:
    """The free space of a robot, or the part along most of the walls where they divide it.

    Args:
        ground: The land.
        needed: Least distance to walls [m], everywhere or in each cell (columns, rows).
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
    if begin is None:
        allowed = parts == np.argmax(ground.walls_along(parts, count)[1:]) + 1
    else:
        allowed = parts == parts[begin]
    cells = _places(grid.gaps, allowed, clearance)
    points = grid.points(cells)
    steps = _steps(ground, allowed, points, cells, max(clearance, least))
    _, group = connected_components(steps, directed=False)
    chosen = group == np.bincount(group).argmax()
    here = None
    if begin is not None:
        here = int(np.argmin(np.hypot(cells[0] - begin[0], cells[1] - begin[1])))
        chosen = group == group[here]
        here = int(chosen[:here].sum())
    outside = ground.outside[cells][chosen]
    # In a map what is unknown may look like the outside.
    is_open = outside.mean() > 0.5 if ground.world.free is not None else outside.any()
    return FreeSpace(
        ground,
        allowed,
        points[chosen],
        grid.gaps[cells][chosen],
        steps[chosen][:, chosen],
        "outside" if is_open else "inside",
        here,
    )


def _cell_near(ground: Ground, free: Bool, start: Float, least: float) -> tuple[int, int]:
    """The free cell nearest to a start, to which a straight path leads.

    Raises:
        InputError: There is none.
    """
    grid, local = ground.grid, start - ground.world.origin
    points = grid.points(free)
    if len(points):
        nearest = points[np.argmin(np.hypot(*(points - local).T))]
        line = local + np.linspace(0.0, 1.0, 50)[:, None] * (nearest - local)
        # The start itself may be nearer to a wall than the route.
        gaps = grid.gaps[grid.cells(line)]
        near = np.hypot(*(nearest - local)) < least + 2 * BLOCK * grid.size
        if near and (gaps >= min(gaps[0], least) - grid.size).all():
            column, row = grid.cells(nearest)
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


def _steps(
    ground: Ground, allowed: Bool, points: Float, cells: tuple[Int, Int], clearance: float
) -> Any:
    """The costs of the steps between neighbouring places."""
    from scipy.sparse import coo_array

    grid = ground.grid
    number = np.full([side // BLOCK + 2 for side in grid.gaps.shape], -1)
    block = (cells[0] // BLOCK + 1, cells[1] // BLOCK + 1)
    number[block] = np.arange(len(points))
    parts = []
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
        # Doors and narrow places are passed only to get behind them, and in their middle.
        parts.append((here, there, length * np.maximum(clearance / nearest, 1.0) ** 3))
    start, end, cost = (np.concatenate(part) for part in zip(*parts, strict=True))
    graph = coo_array((cost, (start, end)), shape=(len(points), len(points))).tocsr()
    return graph + graph.T
