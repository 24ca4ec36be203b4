"""FreeCells: a grid of the free space of a map, through which routes are planned."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

import numpy as np

from lrf3d.errors import InputError, shown
from lrf3d.geometry import Bool, Float, is_finite, numbers, sealed
from lrf3d.pose import as_pose

MOST_SIDE, MOST_CELLS = 100_000, 1 << 26
"""Largest number of rows or columns, and of cells, of a grid in a file, as in a ROS map: 64 MB."""


@dataclass(frozen=True, eq=False)
class FreeCells:
    """A grid of cells that are known to be free, or not.

    Args:
        cells: (rows, columns) whether each cell is free; the first row is at the bottom.
        resolution: Side of a cell [m].
        origin: Position x, y [m] of the outer corner of the first cell, and yaw [rad] of the grid.

    Raises:
        InputError: There is no cell, or a number is invalid.
    """

    cells: Bool
    resolution: float
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        cells = np.array(numbers(self.cells, "free cells"), dtype=np.bool_)
        if cells.ndim != 2 or not cells.size:
            raise InputError(f"free cells of shape {cells.shape}: expected (rows, columns)")
        if not (is_finite(self.resolution) and self.resolution > 0.0):
            raise InputError(
                f"free cells of {shown(self.resolution)} m: expected a positive number of metres"
            )
        origin = as_pose(self.origin)
        object.__setattr__(self, "cells", sealed(cells))
        object.__setattr__(self, "resolution", float(self.resolution))
        object.__setattr__(self, "origin", tuple(origin))

    def __repr__(self) -> str:
        rows, columns = self.cells.shape
        return f"FreeCells({rows} x {columns} cells of {self.resolution:g} m)"

    def contain(self, points: Float) -> Bool:
        """Which of the points (k, 2) [m] lie in a free cell; points outside the grid do not."""
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

    def as_dict(self) -> dict[str, Any]:
        """The grid in JSON's types: each row as run lengths, alternating, occupied first."""
        runs = []
        for row in self.cells.tolist():
            lengths = [] if not row or not row[0] else [0]
            lengths += [len(list(same)) for _, same in groupby(row)]
            runs.append(lengths)
        return {
            "resolution": float(self.resolution),
            "origin": [float(value) for value in self.origin],
            "rows": runs,
        }

    @classmethod
    def from_dict(cls, values: object) -> "FreeCells":
        """The grid that :meth:`as_dict` wrote.

        Raises:
            InputError: The values are not such a grid.
        """
        expected = "expected resolution, origin and rows, each row a list of run lengths"
        if not isinstance(values, Mapping) or set(values) != {"resolution", "origin", "rows"}:
            raise InputError(expected)
        resolution, origin, rows = (values[key] for key in ("resolution", "origin", "rows"))
        numbers = [resolution, *origin] if isinstance(origin, list) else []
        if len(numbers) != 4 or not is_finite(*numbers) or not resolution > 0.0:
            raise InputError(expected)
        if not isinstance(rows, list) or not 0 < len(rows) <= MOST_SIDE:
            raise InputError(expected)
        for row in rows:
            if not isinstance(row, list) or not all(type(n) is int and n >= 0 for n in row):
                raise InputError(expected)
        columns = {sum(row) for row in rows}
        if len(columns) != 1 or max(columns) > MOST_SIDE or max(columns) * len(rows) > MOST_CELLS:
            raise InputError(
                f"{expected}; rows of equal length, at most {MOST_SIDE:,}, and {MOST_CELLS:,} cells"
            )
        cells = np.zeros((len(rows), columns.pop()), dtype=np.bool_)
        for row, lengths in zip(cells, rows, strict=True):
            ends = np.cumsum([0, *lengths])
            for begin, end in zip(ends[1::2], ends[2::2], strict=False):
                row[begin:end] = True
        return cls(cells, float(resolution), tuple(float(value) for value in origin))  # type: ignore[arg-type]
