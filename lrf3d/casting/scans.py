"""What all casters share: from distances along the beams to a scan."""

from collections.abc import Sequence

import numpy as np

from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserRangeFinder, LaserScan
from lrf3d.pose import as_pose


def limit_ranges(distances: Float, lrf: LaserRangeFinder) -> Float:
    """Ranges after REP 117: +inf beyond range_max, −inf nearer than range_min."""
    ranges = np.where(distances > lrf.range_max, np.inf, distances)
    return np.where(ranges < lrf.range_min, -np.inf, ranges)


def make_scan(
    lrf: LaserRangeFinder, pose: Sequence[float] | Float, distances: Float, walls: Int
) -> LaserScan:
    """The scan of distances (beams,) to walls (beams,); a beam without range has wall −1."""
    ranges = limit_ranges(distances, lrf)
    return LaserScan(
        as_pose(pose),
        lrf.angles,
        ranges,
        np.where(np.isfinite(ranges), walls, -1),
        range_min=lrf.range_min,
        range_max=lrf.range_max,
    )
