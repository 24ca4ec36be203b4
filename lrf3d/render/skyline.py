"""Skyline: which buildings the nearer ones hide from an eye in the street.

For each of many narrow columns of the view the height of the skyline is kept, as a slope from
the eye. Buildings raise it as they are passed on the way out; what stays below it everywhere is
hidden. All of it is on the safe side: what may be seen by a hand's breadth is drawn.
"""

import numpy as np

from lrf3d.geometry import Float, Int

COLUMNS = 512
"""Columns of the view, over half a turn: a third of a degree each."""

FARTHEST = 100.0
"""Solids farther off [m] hide too little to be looked at."""

FIRST = 8
"""Parts that are looked at together at first; then twice as many each time."""


class Skyline:
    """Solids that hide what stands behind them.

    Args:
        corners: (n, 2) corners of all solids, one solid after the other [m].
        sizes: (k,) how many corners each solid has.
        heights: (k,) heights of their lowest walls [m], which stand on the ground.
    """

    def __init__(self, corners: Float, sizes: Int, heights: Float) -> None:
        self._corners = corners
        self._sizes = sizes
        self._starts = np.cumsum(sizes) - sizes
        self._heights = heights
        self._first = corners[self._starts] if len(sizes) else np.zeros((0, 2))

    def unhidden(
        self, parts: Int, away: Float, low: Float, high: Float, eye: Float, ahead: Float
    ) -> Int:
        """Those of the parts that nearer solids do not hide.

        Args:
            parts: Numbers of the parts, near ones first.
            away: How far off the nearest point of each is [m], rising.
            low: Least x, y, z of the boxes around all parts [m].
            high: Largest x, y, z of them [m].
            eye: (3,) where the eye is [m].
            ahead: Where the eye looks; only x and y matter.
        """
        turn = float(np.arctan2(ahead[1], ahead[0]))
        first, last, slopes, far = self._raised(eye, turn)
        left, right = _columns(parts, low, high, eye, turn)
        tops = high[parts, 2] - eye[2]
        steepest = tops / np.maximum(away, 1e-3)
        whole = (right - left < COLUMNS // 2) & (tops > 0.0)
        skyline = np.full(COLUMNS + 1, -np.inf)
        seen = np.ones(len(parts), dtype=bool)
        added, start, size = 0, 0, FIRST
        while start < len(parts):
            stop = min(start + size, len(parts))
            # Only what ends nearer than the parts begin stands before all of them.
            upto = int(np.searchsorted(far, away[start], side="right"))
            for solid in range(added, upto):
                place = slice(first[solid], last[solid])
                np.maximum(skyline[place], slopes[solid], out=skyline[place])
            added = max(added, upto)
            bounds = np.column_stack([left[start:stop], right[start:stop] + 1]).ravel()
            least = np.minimum.reduceat(skyline, bounds)[::2]
            seen[start:stop] = ~whole[start:stop] | (steepest[start:stop] >= least)
            start, size = stop, 2 * size
        return np.asarray(parts[seen])

    def _raised(self, eye: Float, turn: float) -> tuple[Int, Int, Float, Float]:
        """Near solids by their far end: the columns that each fills, its slope and that distance.

        A solid is of one piece, so that it fills all columns between its outermost corners.
        """
        near = np.abs(self._first - eye[:2]).max(axis=1, initial=0.0) < FARTHEST
        solids = np.flatnonzero(near & (self._heights > eye[2]))
        if not len(solids):
            none = np.zeros(0, dtype=np.int64)
            return none, none, np.zeros(0), np.zeros(0)
        sizes = self._sizes[solids]
        starts = np.cumsum(sizes) - sizes
        index = np.repeat(self._starts[solids] - starts, sizes) + np.arange(int(sizes.sum()))
        points = self._corners[index] - eye[:2]
        columns = _column(points, turn)
        left = np.ceil(np.minimum.reduceat(columns, starts)).astype(np.int64)
        right = np.floor(np.maximum.reduceat(columns, starts)).astype(np.int64)
        far = np.maximum.reduceat(np.hypot(points[:, 0], points[:, 1]), starts)
        # What reaches far behind the eye, or is seen over half a turn, may lie round it.
        good = (right > left) & (right - left < COLUMNS)
        good &= (left > -COLUMNS // 6) & (right < COLUMNS + COLUMNS // 6)
        good &= (right > 0) & (left < COLUMNS)
        order = np.flatnonzero(good)[np.argsort(far[good])]
        slopes = (self._heights[solids] - eye[2]) / far
        left, right = np.maximum(left, 0), np.minimum(right, COLUMNS)
        return left[order], right[order], slopes[order], far[order]


def _columns(parts: Int, low: Float, high: Float, eye: Float, turn: float) -> tuple[Int, Int]:
    """First and last column (n,) that the boxes of the parts reach into."""
    x = np.stack([low[parts, 0], high[parts, 0]], axis=1) - eye[0]
    y = np.stack([low[parts, 1], high[parts, 1]], axis=1) - eye[1]
    corners = np.stack([x[:, [0, 1, 1, 0]], y[:, [0, 0, 1, 1]]], axis=2)
    columns = np.clip(np.floor(_column(corners, turn)), 0, COLUMNS - 1).astype(np.int64)
    return columns.min(axis=1), columns.max(axis=1)


def _column(points: Float, turn: float) -> Float:
    """The column, as a fraction, in which points (…, 2) are seen by an eye at the origin."""
    angles = np.arctan2(points[..., 1], points[..., 0]) - turn
    angles = (angles + np.pi) % (2.0 * np.pi) - np.pi
    return np.asarray((angles / np.pi + 0.5) * COLUMNS)
