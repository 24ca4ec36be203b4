"""Slam over a recorded drive: scans and odometry lines enter, the poses of both leave."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Float, Int, wrap_angle
from lrf3d.laser import LaserScan
from lrf3d.slam.closures import Closure
from lrf3d.slam.frames import between, compose
from lrf3d.slam.front_end import KEY_DISTANCE
from lrf3d.slam.lag import estimate_lag, wheel_poses_at
from lrf3d.slam.slam import Slam, bent, surface_of_scan

FASTEST, FASTEST_TURN = 3.0, 3.0
"""A robot that moves farther [m] or turns more [rad] between two lines of a log has jumped."""

Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class LogSolution:
    """What slam made of a recorded drive.

    Args:
        slam: The slam that ran over it, with all its key scans.
        lag: How far the laser's clock is behind that of the odometry, in lines.
        jumps: Numbers of the lines to which the odometry jumped, which is not believed.
        scan_poses: (k, 3) poses of the robot at the scans.
        line_poses: (n, 3) its poses at the odometry lines, by the clock of the laser.
        milliseconds: Mean time of an update [ms].
    """

    slam: Slam
    lag: float
    jumps: tuple[int, ...]
    scan_poses: Float
    line_poses: Float
    milliseconds: float

    @property
    def closures(self) -> list[Closure]:
        """The loops that were closed."""
        return self.slam.closures


def solve_log(
    scans: Sequence[LaserScan],
    wheels: Float,
    places: Int,
    *,
    laser_offset: float = 0.0,
    key_distance: float = KEY_DISTANCE,
    progress: Progress = lambda done, total: None,
) -> LogSolution:
    """Find the poses of a recorded drive.

    Args:
        scans: The scans (k,).
        wheels: (n, 3) poses by odometry, line by line.
        places: (k,) for each scan the index of the last odometry line before it.
        laser_offset: How far the laser stands ahead of the robot's centre [m].
        key_distance: Way from one key scan to the next [m].
        progress: Called with the scans that are done and all.

    Raises:
        InputError: There are fewer than two scans or no odometry.
    """
    if len(scans) < 2 or not len(wheels):
        raise InputError(
            f"slam: {len(scans)} scans and {len(wheels)} odometry lines; expected at least two"
            " scans and one line"
        )
    laser = np.array([laser_offset, 0.0])
    wheels, jumps = without_jumps(wheels)
    lag = estimate_lag(lambda number: surface_of_scan(scans[number], laser), wheels, places)
    at_scans = wheel_poses_at(wheels, places - lag)
    increments = np.vstack([np.zeros(3), between(at_scans[:-1], at_scans[1:])])
    slam = Slam(start=at_scans[0], laser_offset=laser_offset, key_distance=key_distance)
    begin = perf_counter()
    for number, (scan, increment) in enumerate(zip(scans, increments, strict=True), 1):
        slam.update(scan, increment)
        progress(number, len(scans))
    milliseconds = 1e3 * (perf_counter() - begin) / len(scans)
    slam.finish()
    poses = slam.trajectory()
    return LogSolution(
        slam, lag, jumps, poses, line_poses(wheels, places, lag, poses), milliseconds
    )


def without_jumps(wheels: Float) -> tuple[Float, tuple[int, ...]]:
    """Odometry poses (n, 3) without jumps, at which the robot is taken to stand still, and where."""
    steps = between(wheels[:-1], wheels[1:])
    jumped = (np.hypot(steps[:, 0], steps[:, 1]) > FASTEST) | (np.abs(steps[:, 2]) > FASTEST_TURN)
    if not jumped.any():
        return wheels, ()
    mended = wheels.copy()
    for line in np.flatnonzero(jumped):
        mended[line + 1 :] = compose(mended[line], between(wheels[line + 1], wheels[line + 1 :]))
    mended[:, 2] = wrap_angle(mended[:, 2])
    return mended, tuple((np.flatnonzero(jumped) + 1).tolist())


def line_poses(wheels: Float, places: Int, lag: float, scan_poses: Float) -> Float:
    """Poses (n, 3) at all odometry lines, which follow the odometry between scans.

    The pose of a line that a scan follows is that of the scan: the poses are by the clock of the
    laser, for it is the laser's measurements that they are compared with.
    """
    way = wheel_poses_at(wheels, np.arange(len(wheels)) - lag)
    known, last = np.unique(np.maximum(places, 0)[::-1], return_index=True)
    poses = bent(way, known, scan_poses[::-1][last])
    poses[:, 2] = np.unwrap(poses[:, 2])
    return poses
