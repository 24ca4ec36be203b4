"""FreeCells: a grid of the free space of a map, through which routes are planned."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lrf3d.base.errors import InputError
from lrf3d.geometry.lines import Bool, Float, number, numbers, sealed
from lrf3d.geometry.pose import as_pose

# Largest number of cells of a grid in a file: 400 m by 400 m at 5 cm.
MOST_CELLS = 1 << 26


@dataclass(frozen=True, eq=False)
class FreeCells:
    """A grid of cells that are known to be free, or not.

    Args:
        cells: (rows, columns) whether each cell is free; the first row is at the bottom.
        resolution: Side of a cell [m].
        origin: Position x, y [m] of the outer corner of the first cell, and yaw [rad] of the grid.
        occupied: (rows, columns) whether each cell is occupied, if known; it is not saved in files.
    """

    cells: Bool
    resolution: float
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    occupied: Bool | None = None

    def __post_init__(self) -> None:
        cells = np.array(numbers(self.cells, "free cells"), dtype=np.bool_)
        if cells.ndim != 2 or not cells.size:
            raise InputError(f"free cells of shape {cells.shape}: expected (rows, columns)")
        side = number(self.resolution, "free cells: resolution", "metres", positive=True)
        values = {"cells": sealed(cells), "resolution": side, "origin": (*as_pose(self.origin),)}
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        return f"FreeCells({' x '.join(map(str, self.cells.shape))} cells of {self.resolution:g} m)"

    def contain(self, points: Float) -> Bool:
        """Which of the points (k, 2) [m] lie in a free cell; points outside the grid do not."""
        x, y, yaw = self.origin
        cos = np.cos(yaw)
        sin = np.sin(yaw)
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

    def as_dict(self) -> dict[str, Any]:
        """The grid in JSON's types: each row as run lengths, alternating, occupied first."""
        changes = np.diff(self.cells.astype(np.int8), prepend=0, append=2)
        rows = [np.diff(np.flatnonzero(row), prepend=0).tolist() for row in changes]
        return {"resolution": self.resolution, "origin": [*self.origin], "rows": rows}

    @classmethod
    def from_dict(cls, values: Any, key: str = "free") -> "FreeCells":
        """The grid that :meth:`as_dict` wrote, at a key of a file."""
        try:
            rows = [np.array(row) for row in values["rows"]]
            # Each run is bounded before any sum: in 64 bits, sums of large ones wrap around.
            if not all(
                row.dtype.kind == "i" and 0 <= row.min() <= row.max() <= MOST_CELLS for row in rows
            ):
                raise ValueError
            (columns,) = {int(row.sum()) for row in rows}
            if len(values) != 3 or columns * len(rows) > MOST_CELLS:
                raise ValueError
            # Runs are not free and free in turn.
            cells = np.array([np.repeat(np.arange(len(row)) % 2 == 1, row) for row in rows])
            return cls(cells, values["resolution"], values["origin"])
        except (KeyError, TypeError, ValueError, OverflowError):
            expected = f"rows of run lengths, of equal sums, of at most {MOST_CELLS:,} cells"
            raise InputError(f"{key}: expected resolution, origin and {expected}") from None
