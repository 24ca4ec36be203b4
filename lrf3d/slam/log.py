"""Slam over a recorded drive: scans and odometry lines enter, the poses of both leave."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Protocol

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Float, Int, lengths, wrap_angle
from lrf3d.laser import LaserRangeFinder, LaserScan
from lrf3d.mapping import LineMapper
from lrf3d.pose import Pose
from lrf3d.progress import Progress
from lrf3d.robot import Trajectory
from lrf3d.run import Run
from lrf3d.slam.closures import Closure
from lrf3d.slam.frames import between, compose
from lrf3d.slam.front_end import KEY_DISTANCE
from lrf3d.slam.lag import WheelPath, fitted_lag, followed, matched_lag, tracked_lag
from lrf3d.slam.resolution import Resolution
from lrf3d.slam.slam import Slam, bent
from lrf3d.slam.surface import surface_of_scan
from lrf3d.world import World

FASTEST, FASTEST_TURN, FASTER = 3.0, 3.0, 3.0
"""A robot that moves farther [m] or turns more [rad] between two lines of a log has jumped, unless
the first is less than so many times what it usually moves: some logs have few lines."""

CALIBRATED = 400
"""Scans at the beginning of a log that the errors of its wheels are first learned from. With them
a loop of 460 m, driven with wheels 15 % off, closes ten times as well."""

STILL = 1e-3
"""What a line without motion counts as between two scans [m], so that none counts nothing."""


class OdometryLines(Protocol):
    """The raw odometry of a recording; lrf3d.io.laser_log.WheelRecord is one."""

    @property
    def poses(self) -> Float:
        """(n, 3) poses by odometry, line by line."""

    @property
    def places(self) -> Int:
        """(k,) for each scan the index of the last line before it."""

    @property
    def laser_offset(self) -> float:
        """How far the laser stands ahead of the robot's centre [m]."""


class Recording(Protocol):
    """A recorded drive; lrf3d.io.LaserLog is one."""

    @property
    def name(self) -> str:
        """What it is called."""

    @property
    def scans(self) -> Sequence[LaserScan]:
        """The scans (k,)."""

    @property
    def poses(self) -> Float:
        """(k, 3) the poses of the scans, which serve as odometry where there are no lines of it."""

    @property
    def wheels(self) -> OdometryLines | None:
        """The raw odometry."""


@dataclass(frozen=True, eq=False)
class LogSolution:
    """What slam made of a recorded drive.

    Args:
        slam: The slam that ran over it, with all its key scans.
        laser_offset: How far the laser stands ahead of the robot's centre [m].
        lag: How far the laser's clock is behind that of the odometry, in lines.
        jumps: Numbers of the lines to which the odometry jumped, which is not believed.
        scan_poses: (k, 3) poses of the robot at the scans.
        line_poses: (n, 3) its poses at the odometry lines, by the clock of the laser.
        milliseconds: Mean time of an update [ms].
        stamps_not_rising: How many scans have a stamp that is no later than the one before.
    """

    slam: Slam
    laser_offset: float
    lag: float
    jumps: tuple[int, ...]
    scan_poses: Float
    line_poses: Float
    milliseconds: float
    stamps_not_rising: int = 0

    @property
    def closures(self) -> list[Closure]:
        """The loops that were closed."""
        return self.slam.closures


def slam(recording: Recording, *, key_distance: float = KEY_DISTANCE) -> Run:
    """Find poses and map of a recorded drive from its scans and its odometry.

    Args:
        recording: The log, as `load_log` reads it.
        key_distance: Way from one key scan to the next [m].

    Returns:
        The drive as a run, in the walls that it mapped.

    Raises:
        InputError: The log is too short, or its scans differ in their beams.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> run = lrf3d.simulate(room, [(1 + 0.1 * k, 1, 0) for k in range(10)], rng=0)
        >>> lrf3d.export_run(run, "carmen", "drive.log")
        >>> lrf3d.slam(lrf3d.load_log("drive.log")).trajectory.poses[-1, :2].round(1).tolist()
        [1.9, 1.0]
    """
    return run_of(recording, solve_recording(recording, key_distance=key_distance))


def solve_recording(
    recording: Recording,
    *,
    key_distance: float = KEY_DISTANCE,
    progress: Progress = lambda done, total: None,
) -> LogSolution:
    """Find the poses of a recorded drive; arguments and errors are those of `solve_log`."""
    lines, scans = recording.wheels, recording.scans
    poses, places, offset = recording.poses, np.arange(len(scans)), 0.0
    if lines is not None:
        poses, places, offset = lines.poses, np.maximum(lines.places, 0), lines.laser_offset
    return solve_log(
        scans, poses, places, laser_offset=offset, key_distance=key_distance, progress=progress
    )


def run_of(recording: Recording, solution: LogSolution) -> Run:
    """A recorded drive as a run: its world is the map, and its true ranges are the measured ones.

    The map is that of the key scans, which show every wall that the robot came by.
    """
    scans, mounted = recording.scans, np.array([solution.laser_offset, 0.0, 0.0])
    poses = compose(solution.scan_poses, mounted)
    poses[:, 2] = np.unwrap(poses[:, 2])
    mapper = LineMapper()
    for number in solution.slam.key_scans.tolist():
        mapper.update(replace(scans[number], pose=Pose(*poses[number].tolist())))
    line_map = mapper.map
    solid = lengths(line_map.segments) > 0.0
    first = scans[0]
    angles = first.angles
    lrf = LaserRangeFinder(
        float(angles[0]), float(angles[-1]), len(angles), first.range_min, first.range_max
    )
    ranges = np.array([scan.ranges for scan in scans])
    times, _ = rising(np.array([scan.time for scan in scans]))
    # Stamps count from 1970; the clock of a run begins with it.
    times -= times[0]
    return Run(
        World(line_map.segments[solid], line_map.objects[solid], name=recording.name),
        lrf,
        Trajectory(times, poses),
        ranges,
        ranges,
        np.full(ranges.shape, -1),
        (len(scans) - 1,),
        (line_map,),
    )


def rising(stamps: Float) -> tuple[Float, int]:
    """Stamps (k,) [s] as times that rise, and how many of them do not.

    A stamp that is no later than one before it is taken to lie evenly between those around it.
    """
    latest = np.maximum.accumulate(stamps)
    good = np.concatenate([[True], np.diff(latest) > 0.0])
    steps = np.diff(stamps)
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 1.0
    knots = np.flatnonzero(good)
    number = np.arange(len(stamps), dtype=np.float64)
    times = np.interp(number, knots, latest[knots])
    times[knots[-1] :] = latest[knots[-1]] + usual * (number[knots[-1] :] - knots[-1])
    return times, int((steps <= 0.0).sum())


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
    for number, scan in enumerate(scans):
        if scan.angles is not scans[0].angles and not np.array_equal(scan.angles, scans[0].angles):
            raise InputError(
                f"slam: scan {number} has {len(scan.ranges)} beams at other angles than the first;"
                " expected scans of one laser range finder"
            )
    laser = np.array([laser_offset, 0.0])
    wheels, jumps = without_jumps(wheels)
    path = WheelPath(wheels)
    resolution = Resolution.of(scans[0].angles)

    def surface(number: int) -> Float:
        return surface_of_scan(scans[number], laser, sparse=resolution.sparse)

    find_lag = tracked_lag if resolution.sparse else matched_lag
    increments = path.increments(places - find_lag(surface, path, places, resolution))
    start = path.at(places[:1].astype(np.float64))[0]
    # The beginning is followed twice: at first the errors of the wheels are not known.
    known = followed(surface, increments[:CALIBRATED], resolution)[0].wheels
    slam = Slam(start=start, laser_offset=laser_offset, key_distance=key_distance, wheels=known)
    begin = perf_counter()
    for number, (scan, increment) in enumerate(zip(scans, increments, strict=True), 1):
        slam.update(scan, increment)
        progress(number, len(scans))
    milliseconds = 1e3 * (perf_counter() - begin) / len(scans)
    slam.finish()
    poses = slam.refined(scans)
    # Now that the poses of all scans are known, all of them show the lag.
    lag = fitted_lag(np.diff(poses[:, 2]), path, places)
    return LogSolution(
        slam,
        laser_offset,
        lag,
        jumps,
        poses,
        line_poses(path, places, lag, poses),
        milliseconds,
        rising(np.array([scan.time for scan in scans]))[1],
    )


def without_jumps(wheels: Float) -> tuple[Float, tuple[int, ...]]:
    """Odometry poses (n, 3) without jumps, and where they were; there the robot stands still."""
    steps = between(wheels[:-1], wheels[1:])
    ways = np.hypot(steps[:, 0], steps[:, 1])
    usual = float(np.quantile(ways, 0.95)) if len(ways) else 0.0
    jumped = (ways > max(FASTEST, FASTER * usual)) | (np.abs(steps[:, 2]) > FASTEST_TURN)
    if not jumped.any():
        return wheels, ()
    mended = wheels.copy()
    for line in np.flatnonzero(jumped):
        mended[line + 1 :] = compose(mended[line], between(wheels[line + 1], wheels[line + 1 :]))
    mended[:, 2] = wrap_angle(mended[:, 2])
    return mended, tuple((np.flatnonzero(jumped) + 1).tolist())


def line_poses(path: WheelPath, places: Int, lag: float, scan_poses: Float) -> Float:
    """Poses (n, 3) at all odometry lines, which follow the odometry between scans.

    The pose of a line that a scan follows is that of the scan: the poses are by the clock of the
    laser, for it is the laser's measurements that they are compared with.
    """
    way = path.at(np.arange(float(len(path))) - lag)
    known, last = np.unique(np.maximum(places, 0)[::-1], return_index=True)
    # What is left between odometry and scans is spread by how far the robot moved and turned.
    steps = np.abs(between(way[:-1], way[1:])).sum(axis=1) + STILL
    poses = bent(way, known, scan_poses[::-1][last], np.concatenate([[0.0], np.cumsum(steps)]))
    poses[:, 2] = np.unwrap(poses[:, 2])
    return poses
