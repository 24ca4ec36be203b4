"""Slam over a recorded drive: scans and odometry lines enter, the poses of both leave."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Float, Int, lengths
from lrf3d.interrupts import check, stoppable
from lrf3d.laser import LaserRangeFinder, LaserScan, doubtful_ranges
from lrf3d.mapping import LineMapper
from lrf3d.pose import Pose
from lrf3d.progress import Progress, silent
from lrf3d.robot import EstimatedTrajectory, Trajectory
from lrf3d.run import Run, is_snapshot
from lrf3d.slam.frames import bent, between, compose
from lrf3d.slam.front_end import KEY_DISTANCE
from lrf3d.slam.odometry import (
    Recording,
    Repairs,
    WheelPath,
    fitted_lag,
    in_order,
    is_mirrored,
    rising,
    turns_between,
)
from lrf3d.slam.self_check import SelfCheck
from lrf3d.slam.simulated import MOST_COVARIANCES, scans_of
from lrf3d.slam.slam import Slam
from lrf3d.world import World

CALIBRATED = 400
"""Scans at the beginning of a log that give the first estimate of its wheels' errors. With it a
loop of 460 m, driven with wheels 15 % off, closes with a tenth of the error."""

LEARNED, LEARNED_TURN = 0.012, 0.15
"""Where the scale of distances or of turns moves by more than this share from its first estimate,
the beginning is misplaced: the drive is solved again. Around blocks of 400 to 640 m of corridor
that takes half to three quarters of the error away. Scans show turns, but hardly the distance along
a corridor, so that only large errors of turns matter."""

MOST_PASSES = 3
"""Times that a drive is solved, at most."""

STILL = 1e-3
"""Length [m] that is added to the motion at each line, so that no line has none."""

LEAST_BEAMS = 3
"""Beams that a scan must have to show a wall."""

JITTER = 1e-4
"""Angles of the beams may differ by this from scan to scan [rad]: some drivers round them."""

LATEST = 1e12
"""Largest stamp [s]: larger ones are nanoseconds, of which a float cannot tell two apart."""


@dataclass(frozen=True, eq=False, repr=False)
class LogSolution:
    """The solution of a recorded drive, by the clock of the laser.

    Args:
        slam: The `Slam` that ran over it, with all its key scans.
        laser_offset: How far the laser stands ahead of the robot's centre [m].
        lag: How far the laser's clock is behind that of the odometry [lines].
        scans: The scans (k,), in the order in which they were taken, each once.
        scan_poses: (k, 3) poses x, y [m], theta [rad] of the robot at the scans.
        line_poses: (n, 3) its poses at the odometry lines as logged.
        milliseconds: Mean time of an update [ms].
        repairs: What was wrong with the log.
        check: How well the scans agree with each other.
        passes: How often the drive was solved: again where its wheels' errors turned out to differ.
    """

    slam: Slam
    laser_offset: float
    lag: float
    scans: list[LaserScan]
    scan_poses: Float
    line_poses: Float
    milliseconds: float
    repairs: Repairs
    check: SelfCheck
    passes: int

    def __repr__(self) -> str:
        return f"LogSolution({self.slam}, {len(self.line_poses)} odometry lines)"

    def sentences(self) -> list[str]:
        """What users should know of the solution, a sentence each."""
        mirrored = self.repairs.sentences()[:1] if self.repairs.mirrored else []
        return [*mirrored, *self.check.sentences()]


@stoppable()
def solve_log(
    scans: Sequence[LaserScan],
    wheels: Float,
    places: Int,
    *,
    times: Float | None = None,
    laser_offset: float = 0.0,
    key_distance: float = KEY_DISTANCE,
    progress: Progress = silent,
    name: str = "slam",
) -> LogSolution:
    """Find the poses of a recorded drive from its scans (k,) and its odometry (n, 3), line by line.

    Args:
        scans: The scans.
        wheels: Poses by odometry.
        places: (k,) for each scan the index of the last odometry line before it.
        times: (n,) stamps of the lines [s]; a second apart if not given.
        laser_offset: How far the laser stands ahead of the robot's centre [m].
        key_distance: Distance driven from one key scan to the next [m].
        progress: Called with the scans that are done and all.
        name: Name of the log, for messages.

    Raises:
        InputError: There are fewer than two scans or no odometry, the scans are of several laser
            range finders or show no wall, or a number is not what it should be.
    """
    stamps = np.arange(len(wheels), dtype=np.float64) if times is None else times
    try:
        recording = in_order(_checked(scans, wheels, stamps), wheels, stamps, places)
        path = WheelPath(recording.wheels)
        recording, turns = _right_handed(recording, path, laser_offset)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
    scans, places = recording.scans, recording.places
    increments = path.increments(places - fitted_lag(turns, path, places))
    start = path.at(places[:1].astype(np.float64))[0]
    # The beginning is followed twice: at first the errors of the wheels are not known.
    slam = Slam(laser_offset=laser_offset)
    for scan, increment in zip(scans[:CALIBRATED], increments, strict=False):
        slam.update(scan, increment)
    passes = 0
    while passes < MOST_PASSES:
        passes += 1
        known, begin = slam.wheels, perf_counter()
        slam = Slam(start=start, laser_offset=laser_offset, key_distance=key_distance, wheels=known)
        for number, (scan, increment) in enumerate(zip(scans, increments, strict=True), 1):
            slam.update(scan, increment)
            progress(number, len(scans))
            check()
        milliseconds = 1e3 * (perf_counter() - begin) / len(scans)
        change = (1.0 + slam.wheels.biases) / (1.0 + known.biases) - 1.0
        if abs(change[2]) <= LEARNED and abs(change[0]) <= LEARNED_TURN:
            break
    slam.finish()
    poses = slam.refined(scans)
    # Now that the poses of all scans are known, all of them show the lag.
    lag = fitted_lag(np.diff(poses[:, 2]), path, places)
    lines = line_poses(path, places, lag, poses)[recording.rows]
    return LogSolution(
        slam,
        laser_offset,
        lag,
        scans,
        poses,
        lines,
        milliseconds,
        recording.repairs,
        slam.self_check(),
        passes,
    )


def _right_handed(recording: Recording, path: WheelPath, offset: float) -> tuple[Recording, Float]:
    """A recording whose laser turns as the odometry does, and the turns that its scans show."""
    slam, scans = Slam(laser_offset=offset), recording.scans
    turns = turns_between(lambda number: slam.surface_of(scans[number]), path, recording.places)
    if not is_mirrored(turns, path, recording.places):
        return recording, turns
    scans = [replace(scan, ranges=scan.ranges[::-1]) for scan in scans]
    repairs = replace(recording.repairs, mirrored=True)
    return replace(recording, scans=scans, repairs=repairs), -turns


def _checked(scans: Sequence[LaserScan], wheels: Float, times: Float) -> list[LaserScan]:
    """The scans of a recording that can be solved, all at the angles of the first."""
    if len(scans) < 2 or not len(wheels):
        raise InputError(
            f"{len(scans)} scans and {len(wheels)} odometry lines; expected at least two scans and"
            " one line"
        )
    first = scans[0].angles
    if len(first) < LEAST_BEAMS:
        raise InputError(f"scans of {len(first)} beams; expected at least {LEAST_BEAMS}")
    if np.abs(first).max() > 2.0 * np.pi:
        angle = first[np.abs(first).argmax()]
        raise InputError(f"a beam at {angle:g} rad; expected angles of at most a turn")
    even = []
    for number, scan in enumerate(scans):
        off = scan.angles is not first and (
            scan.angles.shape != first.shape or np.abs(scan.angles - first).max() > JITTER
        )
        if off:
            raise InputError(
                f"scan {number} has {len(scan.ranges)} beams at other angles than the first;"
                " expected scans of one laser range finder"
            )
        even.append(scan if scan.angles is first else replace(scan, angles=first))
    finite = np.isfinite(wheels).all(axis=1) & np.isfinite(times)
    if not finite.all():
        line = int(np.flatnonzero(~finite)[0])
        raise InputError(
            f"odometry line {line} at {times[line]} s has the pose {wheels[line].tolist()};"
            " expected finite numbers"
        )
    stamps = np.concatenate([times, [scan.time for scan in scans]])
    if np.abs(stamps).max() > LATEST:
        raise InputError(f"a stamp of {stamps[np.abs(stamps).argmax()]:g} s; expected seconds")
    if doubt := doubtful_ranges(scans):
        raise InputError(doubt)
    return even


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


def run_of(solution: LogSolution, name: str) -> Run:
    """A recorded drive as a run: its world is the map of its key scans, its ranges the measured."""
    scans, mounted = solution.scans, np.array([solution.laser_offset, 0.0, 0.0])
    poses = compose(solution.scan_poses, mounted)
    poses[:, 2] = np.unwrap(poses[:, 2])
    mapper, keys = LineMapper(), solution.slam.key_scans.tolist()
    maps = {}
    for index, number in enumerate(keys):
        mapper.update(replace(scans[number], pose=Pose(*poses[number].tolist())))
        if is_snapshot(index, len(keys)):
            maps[number] = mapper.map
    # The last map is that of all scans: those after the last key scan show nothing new.
    maps[len(scans) - 1] = line_map = maps.pop(keys[-1])
    solid = lengths(line_map.segments) > 0.0
    if not solid.any():
        raise InputError(f"{name}: {len(scans)} scans show no wall, so that there is no map")
    lrf, ranges = range_finder_of(scans)
    times = rising(np.array([scan.time for scan in scans]))
    # Stamps count from 1970; the clock of a run begins with it.
    times -= times[0]
    return Run(
        World(line_map.segments[solid], line_map.objects[solid], name=name),
        lrf,
        Trajectory(times, poses),
        ranges,
        ranges,
        np.full(ranges.shape, -1),
        tuple(maps),
        tuple(maps.values()),
        estimate=_estimate_of(solution.slam, poses),
    )


def range_finder_of(scans: Sequence[LaserScan]) -> tuple[LaserRangeFinder, Float]:
    """The range finder that took scans (k,), and their ranges (k, beams) [m] in its order."""
    first, ranges = scans[0], np.array([scan.ranges for scan in scans])
    angles, farthest = first.angles, first.range_max
    if angles[0] > angles[-1]:
        # A laser that is mounted upside down turns clockwise; the range finder of a run does not.
        angles, ranges = angles[::-1], ranges[:, ::-1]
    if not np.isfinite(farthest):
        # Some drivers give no limit: it is the usual one, or what was measured beyond it.
        usual = LaserRangeFinder().range_max
        farthest = float(ranges.max(initial=usual, where=np.isfinite(ranges)))
    begin, end = float(angles[0]), float(angles[-1])
    return LaserRangeFinder(begin, end, len(angles), first.range_min, farthest), ranges


def _estimate_of(slam: Slam, poses: Float) -> EstimatedTrajectory:
    """The poses (k, 3) of a drive's scans with the covariances of some, and the closures."""
    keys = slam.key_scans
    chosen = np.unique(np.linspace(0, len(keys) - 1, MOST_COVARIANCES).astype(np.int64))
    return EstimatedTrajectory(
        poses,
        keys[chosen],
        slam.covariances(chosen),
        scans_of(slam.closures, keys),
        scans_of(slam.unconfirmed_closures, keys),
    )
