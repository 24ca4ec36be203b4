"""A step of SLAM: a scan and the odometry to it, checked where they come from outside."""

from collections.abc import Sequence

import numpy as np

from lrf3d.errors import InputError, shown
from lrf3d.geometry import Float
from lrf3d.laser import LaserRangeFinder, LaserScan
from lrf3d.pose import as_pose

FARTHEST_STEP = 1000.0
"""Longest step of the odometry [m], and largest turn [rad]: no robot moves as far between scans."""


def checked_step(
    scan: object, odometry: Sequence[float] | Float, lrf: LaserRangeFinder | None
) -> Float:
    """The odometry increment (3,), once it and the scan are what they should be.

    Raises:
        InputError: They are not.
    """
    if not isinstance(scan, LaserScan):
        raise InputError(f"slam: {shown(scan)}: expected a LaserScan")
    if not len(scan.ranges):
        raise InputError("slam: scan of 0 beams; expected at least one")
    if lrf is not None and len(scan.ranges) != lrf.beams:
        raise InputError(
            f"slam: scan of {len(scan.ranges)} beams, the laser range finder has {lrf.beams}"
        )
    increment = np.array(as_pose(odometry))
    if np.abs(increment).max() > FARTHEST_STEP:
        raise InputError(
            f"slam: odometry {increment.tolist()}; expected the step from the last scan, at most"
            f" {FARTHEST_STEP:g} m and rad"
        )
    return increment
