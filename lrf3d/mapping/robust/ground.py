"""Ground: of each cell of the ground how many beams ended there, and by way of a mirror or not.

Places where beams ended enter; leave how reflective the walls there are, and where only mirrors
ever showed any.
"""

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int

CELL = 0.2
"""[m] Size of a cell."""

LARGEST_SPREAD = 0.1
"""[share] Where the brightness of returns differs by more, nothing is compared with it: metal."""

NOTHING, UNSURE, DIRECT, TURNED = range(4)
"""What a beam shows where it ends: nothing, as it did not return; perhaps an image, perhaps not;
what is there; or an image."""

SAMPLE = 0.1
"""[m] Steps in which segments are searched for images."""

LEAST_LEFT, RIM = 5, 2
"""[samples] What is left of a segment beside its images stays from so many on that are seen; by so
many it is cut where an image begins."""


@inner
def cell_of(x: float, y: float) -> int:
    """The cell of a point [m], as a number of its own."""
    column, line = int(np.floor(x / CELL)), int(np.floor(y / CELL))
    return ((column & 0x7FFFFFFF) << 31) | (line & 0x7FFFFFFF)


@inner
def row_of(keys: Int, cell: int) -> int:
    """The row of a cell in a table by hashing, or that in which it would be."""
    mask = len(keys) - 1
    row = ((cell ^ (cell >> 29)) * 0x9E3779B1 >> 7) & mask
    while keys[row] != cell and keys[row] != -1:
        row = (row + 1) & mask
    return row


@compiled
def find_rows(keys: Int, points: Float, rows: Int, adding: bool) -> int:
    """Find the rows of the cells of points (n, 2) [m]; −1 for those that the table does not hold.

    Args:
        keys: (k,) the cell of each row, −1 where there is none; k is a power of two.
        points: The points.
        rows: (n,) is filled.
        adding: Whether cells that are missing are added.

    Returns:
        The number of rows that were added.
    """
    added = 0
    for place in range(len(points)):
        cell = cell_of(points[place, 0], points[place, 1])
        row = row_of(keys, cell)
        if keys[row] == -1 and adding:
            keys[row] = cell
            added += 1
        rows[place] = row if keys[row] == cell else -1
    return added


@inner
def shown_at(keys: Int, values: Float, x: float, y: float) -> int:
    """What beams show in the cell of a point [m] and around it: DIRECT, or TURNED, or NOTHING."""
    kind = NOTHING
    for around in range(9):
        cell = cell_of(x + CELL * (around // 3 - 1), y + CELL * (around % 3 - 1))
        row = row_of(keys, cell)
        if keys[row] != -1:
            if values[row, DIRECT] > 0.0:
                return DIRECT
            if values[row, TURNED] > 0.0:
                kind = TURNED
    return kind


@compiled
def find_real_parts(keys: Int, values: Float, segments: Float, parts: Float) -> int:
    """Find the parts of segments (m, 4) [m] that not only turned beams show.

    Args:
        keys: The cells of the ground.
        values: What is known of them.
        segments: The segments.
        parts: (k, 3) is filled: a segment's row, and the shares of it where a part begins and ends.

    Returns:
        The number of parts.
    """
    found = 0
    for row in range(len(segments)):
        x1, y1, x2, y2 = segments[row]
        count = max(int(np.ceil(np.hypot(x2 - x1, y2 - y1) / SAMPLE)), 1)
        begin, first, last, seen = 0, 0, 0, 0
        for sample in range(count + 1):
            if sample < count:
                share = (sample + 0.5) / count
                kind = shown_at(keys, values, x1 + share * (x2 - x1), y1 + share * (y2 - y1))
                if kind == DIRECT:
                    first = first if seen else sample
                    last = sample + 1
                    seen += 1
                if kind != TURNED:
                    continue
            whole = begin == 0 and sample == count
            if (whole or seen >= LEAST_LEFT) and found < len(parts):
                # A part reaches as far as it is seen, but the segment's own ends stay. The cells
                # around a sample reach farther than itself.
                parts[found, 0] = row
                parts[found, 1] = 0.0 if begin == 0 else (first + RIM) / count
                parts[found, 2] = 1.0 if sample == count else (last - RIM) / count
                found += 1
            begin, seen = sample + 1, 0
    return found


class Ground:
    """The cells in which beams ended."""

    def __init__(self) -> None:
        self._keys, self._count = np.full(1 << 12, -1), 0
        # The number of beams of each kind; that of known reflectances, their sum, their squares'.
        self._values = np.zeros((1 << 12, 7))

    def _rows(self, points: Float) -> Int:
        """The rows (n,) of the cells of points (n, 2) [m], which are added."""
        if 2 * (self._count + len(points)) > len(self._keys):
            known = np.flatnonzero(self._keys >= 0)
            keys, values = self._keys[known], self._values[known]
            size = 1 << (4 * (self._count + len(points))).bit_length()
            self._keys, self._values = np.full(size, -1), np.zeros((size, 7))
            cells = np.column_stack([keys >> 31, keys & 0x7FFFFFFF]) << 33 >> 33
            middles: Float = np.asarray(CELL * (cells + 0.5), dtype=np.float64)
            rows = np.empty(len(keys), np.int64)
            find_rows(self._keys, middles, rows, True)
            self._values[rows] = values
        rows = np.empty(len(points), np.int64)
        self._count += find_rows(self._keys, points, rows, True)
        return rows

    def add(self, points: Float, kinds: Int, by: float = 1.0) -> None:
        """Add beams of some kinds (n,) that ended at points (n, 2) [m], or take them back."""
        rows = self._rows(points)
        np.add.at(self._values, (rows, kinds), by)

    def add_light(self, points: Float, reflectances: Float) -> None:
        """Add reflectances (n,) of what is at points (n, 2) [m]."""
        rows = self._rows(points)
        columns = np.ones(len(points)), reflectances, reflectances * reflectances
        np.add.at(self._values[:, 4:], rows, np.column_stack(columns))

    def reflectance(self, points: Float) -> Float:
        """The reflectance (n,) at points (n, 2) [m], NaN where it is not known or not one."""
        rows = np.empty(len(points), np.int64)
        find_rows(self._keys, points, rows, False)
        count, total, squares = self._values[rows, 4:].T
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = total / count
            one = squares / count - mean * mean <= (LARGEST_SPREAD * mean) ** 2
        return np.where((rows >= 0) & one, mean, np.nan)

    def real_parts(self, segments: Float) -> tuple[Int, Float]:
        """The parts (n,) of segments (m, 4) [m] that not only turned beams show.

        Returns:
            The row of each, and the shares (n, 2) of the segment where it begins and ends.
        """
        parts = np.empty((2 * len(segments) + 100, 3))
        parts = parts[: find_real_parts(self._keys, self._values, segments, parts)]
        return parts[:, 0].astype(np.int64), parts[:, 1:]
