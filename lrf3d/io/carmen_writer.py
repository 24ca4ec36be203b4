"""Runs as CARMEN logs, for tools that read them; :mod:`lrf3d.io.carmen` reads them back.

A run is written as four messages for each scan: the true pose, the odometry (the same, unless the
run knows what its wheels measured), the scan with its angles and range_max, and, if its fan is that
of FLASER messages, the scan again for tools that read only those. Numbers have all their digits, so
a log that is read back is the same bit for bit, as far as the format can express it. A beam without
return is written as range_max, one below range_min as 0.
"""

import gzip
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lrf3d.files import replacing
from lrf3d.geometry import Float
from lrf3d.io.carmen import fan_angles, front
from lrf3d.laser import LaserScan
from lrf3d.run import Run

HOST = "lrf3d"
"""The host name in messages."""

SAME = 1e-9
"""Largest difference [rad] of angles that count as equal."""


def write_carmen(run: Run, path: Path) -> None:
    """Write a run to a CARMEN log, completely or not at all."""
    text = "\n".join(_lines(run)).encode("ascii") + b"\n"
    with replacing(path) as unfinished:
        # Without the time of day in it, the same run is the same file.
        packed = path.suffix.lower() == ".gz"
        unfinished.write_bytes(gzip.compress(text, mtime=0) if packed else text)


def _lines(run: Run) -> Iterator[str]:
    yield "# CARMEN log of a run of lrf3d; x, y and ranges in metres, angles in radians"
    yield "# TRUEPOS x y theta odom_x odom_y odom_theta time host logger_time"
    yield "# ODOM x y theta v w acceleration time host logger_time"
    yield "# ROBOTLASER1 type start fov step max_range accuracy mode n r1 ... rn m s1 ... sm"
    yield "#   x y theta robot_x robot_y robot_theta v w safety safety turn time host logger_time"
    speeds = run.trajectory.speeds.tolist()
    wheels = run.odometry.tolist()
    for scan, measured, (v, w) in zip(run.scans, wheels, speeds, strict=True):
        pose, odometry = (" ".join(map(repr, each)) for each in (scan.pose, measured))
        end = f"{scan.time!r} {HOST} {scan.time!r}"
        yield f"TRUEPOS {pose} {odometry} {end}"
        yield f"ODOM {odometry} {v!r} {w!r} 0.0 {end}"
        ranges = _readings(scan)
        start, stop, count = float(scan.angles[0]), float(scan.angles[-1]), len(scan.angles)
        step = (stop - start) / (count - 1) if count > 1 else 0.0
        yield (
            f"ROBOTLASER1 0 {start!r} {stop - start!r} {step!r} {scan.range_max!r} 0.0 0"
            f" {count} {ranges} 0 {pose} {pose} {v!r} {w!r} 0.0 0.0 0.0 {end}"
        )
        if _is_front(scan.angles):
            yield f"FLASER {count} {ranges} {pose} {odometry} {end}"


def _readings(scan: LaserScan) -> str:
    """The ranges as readings of CARMEN."""
    ranges = np.where(scan.ranges > scan.range_max, scan.range_max, scan.ranges)
    return " ".join(map(repr, np.where(ranges < 0.0, 0.0, ranges).tolist()))


def _is_front(angles: Float) -> bool:
    """Whether a fan is that of FLASER messages with the same number of beams."""
    if len(angles) < 2:
        return False
    expected = fan_angles(len(angles), *front(len(angles)))
    return bool((np.abs(angles - expected) <= SAME).all())
