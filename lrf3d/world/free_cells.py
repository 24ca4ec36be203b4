"""FreeCells: the part of a plan that a map reports as free, through which routes are planned."""

from dataclasses import dataclass, replace

import numpy as np

from lrf3d.geometry import Bool, Float


@dataclass(frozen=True, eq=False)
class FreeCells:
    """A grid of cells that are known to be free, or not.

    Args:
        cells: (rows, columns) whether each cell is free; the first row is at the bottom.
        resolution: Side of a cell [m].
        origin: Position x, y [m] of the outer corner of the first cell, and yaw [rad] of the grid.
    """

    cells: Bool
    resolution: float
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        cells = np.array(self.cells, dtype=np.bool_)
        cells.flags.writeable = False
        object.__setattr__(self, "cells", cells)

    def contain(self, points: Float) -> Bool:
        """Which of the points (k, 2) [m] lie in a free cell; none beyond the grid does."""
        x, y, yaw = self.origin
        cos, sin = np.cos(yaw), np.sin(yaw)
        local = (points - [x, y]) @ np.array([[cos, -sin], [sin, cos]]) / self.resolution
        rows, columns = self.cells.shape
        within = ((local >= 0.0) & (local < [columns, rows])).all(axis=1)
        column, row = local[within].astype(np.int64).T
        free = np.zeros(len(points), dtype=np.bool_)
        free[within] = self.cells[row, column]
        return free

    def scaled(self, factor: float) -> "FreeCells":
        """The grid scaled about (0, 0)."""
        x, y, yaw = self.origin
        return replace(
            self, resolution=factor * self.resolution, origin=(factor * x, factor * y, yaw)
        )
