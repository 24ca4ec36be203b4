"""Reflectance: how bright walls are where beams met them directly, in cells."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from lrf3d.geometry import Float, Int
from lrf3d.mapping.robust.optics_constants import LIGHT_CELL


class Reflectance:
    """The mean reflectance of the walls in each cell where returns came from.

    Attributes:
        cells: (c,) the cells, in ascending order.
        sums: (c, 2) of each the sum of what returns showed, and their number.
    """

    def __init__(self) -> None:
        self.cells, self.sums = np.empty(0, np.int64), np.empty((0, 2))

    def add(self, points: Float, values: Float) -> None:
        """Add reflectances (n,) at points (n, 2) [m]."""
        cells, rows = np.unique(_cells_of(points), return_inverse=True)
        fresh = np.setdiff1d(cells, self.cells, assume_unique=True)
        if len(fresh):
            places = np.searchsorted(self.cells, fresh)
            self.cells = np.insert(self.cells, places, fresh)
            self.sums = np.insert(self.sums, places, 0.0, axis=0)
        mine = np.searchsorted(self.cells, cells)
        self.sums[mine, 0] += np.bincount(rows, values, len(cells))
        self.sums[mine, 1] += np.bincount(rows, minlength=len(cells))

    def at(self, points: Float) -> Float:
        """The reflectance (n,) at points (n, 2) [m], NaN where it is not known."""
        if not len(self.cells):
            return np.full(len(points), np.nan)
        cells = _cells_of(points)
        places = np.minimum(np.searchsorted(self.cells, cells), len(self.cells) - 1)
        means = self.sums[places, 0] / self.sums[places, 1]
        return np.where(self.cells[places] == cells, means, np.nan)

    def state(self) -> dict[str, Any]:
        """All that is known, as plain arrays by their names; `restore` takes them back."""
        return {"light_cells": self.cells.copy(), "light_sums": self.sums.copy()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what was known."""
        self.cells, self.sums = state["light_cells"].copy(), state["light_sums"].copy()


def _cells_of(points: Float) -> Int:
    """The cells (n,) of points (n, 2) [m]."""
    columns, rows = np.floor(points / LIGHT_CELL).astype(np.int64).T
    cells: Int = (columns << 32) + rows
    return cells
