"""From the walls that beams hit to ranges: within the limits of the range finder, exactly."""

import math

import numpy as np

from lrf3d.casting.kernels.buffer import ROOM
from lrf3d.casting.kernels.compiling import inner
from lrf3d.casting.kernels.double_double import LANES, lengths
from lrf3d.casting.kernels.predicates import compare_limit, length

PADDING = LANES - 1
"""How many numbers beyond the last beam `lengths` may read and write."""


@inner
def measure(walls, index, ox, oy, dx, dy, range_min, range_max, ranges, hit):
    """Turn the rows that the beams hit into ranges and indices of walls.

    The directions dx, dy have PADDING numbers more than there are beams, that may be anything.
    """
    beams = len(ranges)
    values = np.empty(beams + PADDING)
    stop = 0
    while stop < beams:
        # Neighbouring beams on one wall share its area, and the loop over them is vectorised.
        start, row = stop, hit[stop]
        while stop < beams and hit[stop] == row:
            stop += 1
        if row < 0:
            ranges[start:stop] = np.inf
            continue
        hit[start:stop] = index[row]
        px, py, qx, qy = walls[row, 0], walls[row, 1], walls[row, 2], walls[row, 3]
        lengths(ox, oy, dx, dy, px, py, qx, qy, start, stop, values)
        for i in range(start, stop):
            # Half an ulp is no reason to be out of range: near a limit t is compared exactly.
            t = values[i]
            ranges[i] = t
            if range_min * ROOM < t < range_max / ROOM:
                continue
            if not t >= 0.0:
                t = length(ox, oy, dx[i], dy[i], px, py, qx, qy)
            ranges[i] = _limited(t, range_min, range_max, ox, oy, dx[i], dy[i], px, py, qx, qy)
            if not math.isfinite(ranges[i]):
                hit[i] = -1


@inner
def _limited(t, range_min, range_max, ox, oy, dx, dy, px, py, qx, qy):
    """The rounded t within the limits, +inf above them and −inf below, decided exactly."""
    if t >= range_max / ROOM:
        if compare_limit(range_max, ox, oy, dx, dy, px, py, qx, qy) > 0:
            return np.inf
        return min(t, range_max)
    if t <= range_min * ROOM:
        if compare_limit(range_min, ox, oy, dx, dy, px, py, qx, qy) < 0:
            return -np.inf
        return max(t, range_min)
    return t
