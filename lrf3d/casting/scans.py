"""What all casters share: from distances along the beams to a scan."""

from collections.abc import Sequence

import numpy as np

from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserRangeFinder, LaserScan
from lrf3d.laser.range_finder import within_limits
from lrf3d.pose import as_pose


def make_scan(
    lrf: LaserRangeFinder, pose: Sequence[float] | Float, distances: Float, walls: Int
) -> LaserScan:
    """The scan of distances (beams,) to walls (beams,); a beam without range has wall −1."""
    ranges = within_limits(distances, lrf.range_min, lrf.range_max)
    return LaserScan(
        as_pose(pose),
        lrf.angles,
        ranges,
        np.where(np.isfinite(ranges), walls, -1),
        range_min=lrf.range_min,
        range_max=lrf.range_max,
    )
