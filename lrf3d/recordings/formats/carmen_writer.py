"""Writing CARMEN logs, which `carmen` reads: runs, and the scans of logs.

A run is written as three messages for each scan: the true pose, the odometry (the same, unless the
run knows what its wheels measured), and the scan with its angles and range_max. Numbers have all
their digits, so a log that is read back is the same bit for bit, as far as the format can express
it. A beam without return is written as range_max, one below range_min as 0.
"""

import gzip
import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lrf3d.base.errors import InputError
from lrf3d.base.files import replacing
from lrf3d.geometry.pose import as_pose
from lrf3d.laser import LaserScan
from lrf3d.laser.range_finder import CENTRE
from lrf3d.recordings.log import LARGEST_RANGE, LaserLog, WheelRecord

if TYPE_CHECKING:
    from lrf3d.simulation.run import Run

# The comments that the log of a run begins with.
HEAD = """\
# CARMEN log of a run of lrf3d; x, y and ranges in metres, angles in radians
# TRUEPOS x y theta odom_x odom_y odom_theta time host logger_time
# ODOM x y theta v w acceleration time host logger_time
# ROBOTLASER1 type start fov step max_range accuracy mode n r1 ... rn m s1 ... sm
#   x y theta robot_x robot_y robot_theta v w safety safety turn time host logger_time"""

# The host name in messages.
HOST = "lrf3d"

# The numbers that messages of lasers may have.
MOST_LASERS = 9

# Share of a step by which the beams of a log may differ from an even fan: files round.
UNEVEN = 1e-3


def write_carmen(run: "Run", path: Path) -> None:
    """Write a run to a CARMEN log, completely or not at all."""
    _write(_messages(run), path)


def write_log(log: LaserLog, path: Path) -> None:
    """Write the scans of up to nine lasers with their poses, and the odometry of their log.

    A laser that does not stand in its robot's middle needs ODOM messages: if the log has none, they
    are the poses of the robot.

    Raises:
        InputError: The log holds what the format cannot express.
    """
    if not log.placed:
        raise InputError(f"{log.name}: its scans have no poses, which a CARMEN log needs")
    if (lasers := len(log.lasers)) > MOST_LASERS:
        raise InputError(f"{log.name}: {lasers} lasers; a CARMEN log has {MOST_LASERS} at most")
    for number, scan in enumerate(log.scans, 1):
        steps = np.diff(scan.angles)
        mean = float(steps.mean()) if len(steps) else 0.0
        if not mean > 0.0 or np.abs(steps - mean).max() > UNEVEN * mean:
            raise InputError(
                f"{log.name}: scan {number}: {len(scan.angles)} beams; a CARMEN log needs two or"
                " more, evenly spaced and counter-clockwise"
            )
    _write(_log_messages(log), path)


def _write(messages: Iterable[str], path: Path) -> None:
    text = "\n".join(messages).encode("ascii") + b"\n"
    with replacing(path) as unfinished:
        # Without the time of day in it, the same run is the same file.
        packed = path.suffix.lower() == ".gz"
        unfinished.write_bytes(gzip.compress(text, mtime=0) if packed else text)


def _log_messages(log: LaserLog) -> Iterator[str]:
    yield "# CARMEN log of lrf3d; x, y and ranges in metres, angles in radians"
    names = log.lasers
    central = len(names) == 1 and log.mount == CENTRE
    none = WheelRecord(np.empty(0), np.empty((0, 3)), np.full(len(log), -1))
    wheels = (log.wheels or none) if central else log.odometry
    end = f"{float(log.times[0])!r} {HOST} {float(log.times[0])!r}"
    if wheels.laser_offset:
        yield f"PARAM robot_frontlaser_offset {wheels.laser_offset!r} {end}"
    rows = list(zip(wheels.times.tolist(), wheels.poses.tolist(), strict=True))
    places = wheels.places.tolist()
    largest = max(float(scan.ranges[scan.hits].max(initial=0.0)) for scan in log.scans)
    unknown = max(LARGEST_RANGE, math.nextafter(largest, math.inf))
    written = 0
    odometry = "0.0 0.0 0.0"
    # A last place of no scan has the odometry after the last one.
    for scan, place in zip([*log.scans, None], [*places, len(rows) - 1], strict=True):
        for time, pose in rows[written : place + 1]:
            odometry = " ".join(map(repr, pose))
            yield f"ODOM {odometry} 0.0 0.0 0.0 {time!r} {HOST} {time!r}"
        written = max(written, place + 1)
        if scan is not None:
            robot = " ".join(map(repr, scan.robot))
            end = f"{scan.time!r} {HOST} {scan.time!r}"
            scan = replace(scan, range_max=min(scan.range_max, unknown))
            yield _scan_message(scan, names.index(scan.laser), robot, "0.0 0.0", end)


def _messages(run: "Run") -> Iterator[str]:
    yield HEAD
    speeds = run.trajectory.speeds.tolist()
    wheels = run.odometry.tolist()
    rows = zip(run.trajectory.times.tolist(), run.trajectory.poses, wheels, speeds, strict=True)
    for index, (time, true, measured, (v, w)) in enumerate(rows):
        robot = " ".join(map(repr, as_pose(true)))
        odometry = " ".join(map(repr, measured))
        end = f"{time!r} {HOST} {time!r}"
        yield f"TRUEPOS {robot} {odometry} {end}"
        yield f"ODOM {odometry} {v!r} {w!r} 0.0 {end}"
        for laser, scan in enumerate(run.scans_at(index)):
            yield _scan_message(scan, laser, robot, f"{v!r} {w!r}", end)


def _scan_message(scan: LaserScan, laser: int, robot: str, speeds: str, end: str) -> str:
    """The message of a scan; the first laser is the front one, the second the rear one."""
    pose = " ".join(map(repr, scan.pose))
    readings = np.clip(scan.ranges, 0.0, scan.range_max)
    ranges = " ".join(map(repr, readings.tolist()))
    start = float(scan.angles[0])
    stop = float(scan.angles[-1])
    count = len(scan.angles)
    step = (stop - start) / (count - 1) if count > 1 else 0.0
    return (
        f"ROBOTLASER{laser + 1} 0 {start!r} {stop - start!r} {step!r} {scan.range_max!r} 0.0 0"
        f" {count} {ranges} 0 {pose} {robot} {speeds} 0.0 0.0 0.0 {end}"
    )
