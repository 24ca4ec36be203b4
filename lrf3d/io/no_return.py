"""No return: the reading that a log writes for beams that met nothing.

Range finders write their largest range then, some 4, 8, 30 or 80 m, which a log does not say. The
scans of a whole log enter; they leave with such readings as +inf. Taken for walls, they are an arc
around the robot that goes along with it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lrf3d.laser import LaserScan

LEAST_READINGS, LEAST_SHARE = 50, 0.001
"""Readings of the largest range, and their share of all readings, from which on it means no
return."""

BELOW, CROWDED = 0.5, 5.0
"""It stands out if it is read more often, by the second, than all ranges down to this below it [m].
A wall at the end of a corridor is read at many ranges."""

BESIDE = 0.3
"""Share of these readings beside another one: what is open is open to more than one beam, and a
robot that stands still reads the corner of a room again and again."""

EQUAL = 0.011
"""Readings that differ by less are the same [m]: logs are written in centimetres."""


def without_no_returns(scans: Sequence[LaserScan]) -> list[LaserScan]:
    """Scans whose readings of the largest range of all are +inf, if that range means no return."""
    finite = [scan.ranges[np.isfinite(scan.ranges)] for scan in scans]
    largest = max((float(ranges.max()) for ranges in finite if len(ranges)), default=0.0)
    near = np.concatenate([np.empty(0), *(r[r > largest - BELOW] for r in finite)])
    most = int((near > largest - EQUAL).sum())
    least = max(LEAST_READINGS, LEAST_SHARE * sum(map(len, finite)))
    if most < least or most < CROWDED * (len(near) - most):
        return list(scans)
    without = [np.isfinite(scan.ranges) & (scan.ranges > largest - EQUAL) for scan in scans]
    if sum(int((beams[1:] & beams[:-1]).sum()) for beams in without) < BESIDE * most:
        return list(scans)
    return [
        replace(scan, ranges=np.where(beams, np.inf, scan.ranges))
        for scan, beams in zip(scans, without, strict=True)
    ]
