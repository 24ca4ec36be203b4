"""Ground: of each cell of the ground how many beams ended there, and by way of a mirror or not.

Places where beams ended enter; leave how reflective the walls there are, and where only mirrors
ever showed any.
"""

import numpy as np

from lrf3d.compiling import compiled
from lrf3d.geometry import Bool, Float, Int

CELL = 0.2
"""[m] Size of a cell."""

LARGEST_SPREAD = 0.1
"""[share] Where the brightness of returns differs by more, nothing is compared with it: metal."""

NOTHING, UNSURE, DIRECT, TURNED = range(4)
"""What a beam shows where it ends: nothing, as it did not return; perhaps an image, perhaps not;
what is there; or an image."""

AROUND = CELL * np.array([[x, y] for x in (-1, 0, 1) for y in (-1, 0, 1)])
"""[m] A cell and those around it."""


@compiled
def find_rows(keys: Int, cells: Int, rows: Int, adding: bool) -> int:
    """Find the rows of cells (n,) in a table by hashing; −1 for those that it does not hold.

    Args:
        keys: (k,) the cell of each row, −1 where there is none; k is a power of two.
        cells: The cells.
        rows: (n,) is filled.
        adding: Whether cells that are missing are added.

    Returns:
        The number of rows that were added.
    """
    mask, added = len(keys) - 1, 0
    for place in range(len(cells)):
        mixed = cells[place] ^ (cells[place] >> 29)
        row = (mixed * 0x9E3779B1 >> 7) & mask
        while keys[row] != cells[place] and keys[row] != -1:
            row = (row + 1) & mask
        rows[place] = row
        if keys[row] == -1:
            if adding:
                keys[row] = cells[place]
                added += 1
            else:
                rows[place] = -1
    return added


class Ground:
    """The cells in which beams ended."""

    def __init__(self) -> None:
        self._keys, self._count = np.full(1 << 12, -1), 0
        # The number of beams of each kind; that of known reflectances, their sum, their squares'.
        self._values = np.zeros((1 << 12, 7))

    def _rows(self, points: Float, *, adding: bool = False) -> Int:
        """The rows (n,) of the cells of points (n, 2) [m]."""
        while adding and 2 * (self._count + len(points)) > len(self._keys):
            known = self._keys >= 0
            keys, values = self._keys[known], self._values[known]
            self._keys = np.full(2 * len(self._keys), -1)
            self._values = np.zeros((len(self._keys), 7))
            rows = np.empty(len(keys), np.int64)
            find_rows(self._keys, keys, rows, True)
            self._values[rows] = values
        columns, lines = np.floor(points / CELL).astype(np.int64).T & 0x7FFFFFFF
        rows = np.empty(len(points), np.int64)
        self._count += find_rows(self._keys, (columns << 31) | lines, rows, adding)
        return rows

    def add(self, points: Float, kinds: Int, by: float = 1.0) -> None:
        """Add beams of some kinds (n,) that ended at points (n, 2) [m], or take them back."""
        rows = self._rows(points, adding=True)
        np.add.at(self._values, (rows, kinds), by)

    def add_light(self, points: Float, reflectances: Float) -> None:
        """Add reflectances (n,) of what is at points (n, 2) [m]."""
        rows = self._rows(points, adding=True)
        columns = np.ones(len(points)), reflectances, reflectances * reflectances
        np.add.at(self._values[:, 4:], rows, np.column_stack(columns))

    def reflectance(self, points: Float) -> Float:
        """The reflectance (n,) at points (n, 2) [m], NaN where it is not known or not one."""
        rows = self._rows(points)
        count, total, squares = self._values[rows, 4:].T
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = total / count
            one = squares / count - mean * mean <= (LARGEST_SPREAD * mean) ** 2
        return np.where((rows >= 0) & one, mean, np.nan)

    def unreal(self, points: Float) -> Bool:
        """At which points (n, 2) [m] only beams ended that a mirror turned."""
        rows = self._rows((points[:, None] + AROUND).reshape(-1, 2)).reshape(-1, len(AROUND))
        direct, turned = (
            np.where(rows >= 0, self._values[rows, kind], 0.0).sum(axis=1)
            for kind in (DIRECT, TURNED)
        )
        unreal: Bool = (turned > 0.0) & (direct == 0.0)
        return unreal
