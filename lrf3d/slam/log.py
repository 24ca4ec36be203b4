"""Slam over a recorded drive: scans and odometry lines enter, the poses of both leave."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Protocol

import numpy as np

from lrf3d.errors import InputError, Lrf3dWarning
from lrf3d.geometry import Float, Int, lengths
from lrf3d.interrupts import check, stoppable
from lrf3d.laser import LaserRangeFinder, LaserScan
from lrf3d.mapping import LineMapper
from lrf3d.pose import Pose
from lrf3d.progress import Progress
from lrf3d.robot import EstimatedTrajectory, Trajectory
from lrf3d.run import Run, SnapshotSchedule
from lrf3d.slam.closures import Closure
from lrf3d.slam.frames import bent, between, compose
from lrf3d.slam.front_end import KEY_DISTANCE
from lrf3d.slam.lag import WheelPath, fitted_lag, followed, matched_lag, tracked_lag
from lrf3d.slam.repair import Repaired, Repairs, repaired, rising
from lrf3d.slam.resolution import Resolution
from lrf3d.slam.self_check import SelfCheck
from lrf3d.slam.simulated import MOST_COVARIANCES, scans_of
from lrf3d.slam.slam import Slam
from lrf3d.slam.surface import surface_of_scan
from lrf3d.slam.wheels import Wheels
from lrf3d.world import World

CALIBRATED = 400
"""Scans at the beginning of a log that give the first estimate of its wheels' errors. With it a
loop of 460 m, driven with wheels 15 % off, closes with a tenth of the error."""

LEARNED, LEARNED_TURN = 0.012, 0.15
"""Where the scale of the way or of turns moves by more than this share from its first estimate, the
beginning is misplaced: the drive is solved once more. Around blocks of 400 to 640 m of corridor
that takes half to three quarters of the error away. Scans show turns, but hardly the way along a
corridor, so that only large errors of turns matter."""

MOST_PASSES = 3
"""Times that a drive is solved, at most."""

STILL = 1e-3
"""Length [m] that is added to the motion at each line, so that no line has none."""


class OdometryLines(Protocol):
    """The raw odometry of a recording; lrf3d.io.laser_log.WheelRecord is one."""

    @property
    def times(self) -> Float:
        """(n,) their stamps [s]."""

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
        """Its name."""

    @property
    def scans(self) -> Sequence[LaserScan]:
        """The scans (k,)."""

    @property
    def poses(self) -> Float:
        """(k, 3) the poses of the scans, which serve as odometry where there are no lines of it."""

    @property
    def wheels(self) -> OdometryLines | None:
        """The raw odometry."""

    @property
    def mount(self) -> Pose:
        """Pose of the laser on the robot's base, where the poses of the scans are the laser's."""


@dataclass(frozen=True, eq=False)
class LogSolution:
    """The solution of a recorded drive.

    Args:
        slam: The `Slam` that ran over it, with all its key scans.
        laser_offset: How far the laser stands ahead of the robot's centre [m].
        lag: How far the laser's clock is behind that of the odometry, in lines.
        scan_poses: (k, 3) poses x, y [m], theta [rad] of the robot at the scans.
        line_poses: (n, 3) its poses at the odometry lines as logged, by the clock of the laser.
        milliseconds: Mean time of an update [ms].
        scans: The scans (k,), in the order in which they were taken, each once.
        repairs: What was wrong with the log.
        passes: How often the drive was solved: again where its wheels' errors turned out to differ.
        check: How well the scans agree with each other.
    """

    slam: Slam
    laser_offset: float
    lag: float
    scan_poses: Float
    line_poses: Float
    milliseconds: float
    scans: list[LaserScan]
    repairs: Repairs
    passes: int = 1
    check: SelfCheck = field(default_factory=SelfCheck)

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

    Warns:
        Lrf3dWarning: Scans contradict each other, so that the map or a part of it is wrong.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> run = lrf3d.simulate(room, [(1 + 0.1 * k, 1, 0) for k in range(10)], rng=0)
        >>> lrf3d.export_run(run, "carmen", "drive.log")
        >>> lrf3d.slam(lrf3d.load_log("drive.log")).trajectory.poses[-1, :2].round(1).tolist()
        [1.9, 1.0]
    """
    solution = solve_recording(recording, key_distance=key_distance)
    for sentence in solution.check.sentences():
        warnings.warn(f"slam: {recording.name}: {sentence}", Lrf3dWarning, stacklevel=2)
    return run_of(recording, solution)


def solve_recording(
    recording: Recording,
    *,
    key_distance: float = KEY_DISTANCE,
    progress: Progress = lambda done, total: None,
) -> LogSolution:
    """Find the poses of a recorded drive; arguments and errors are those of `solve_log`."""
    lines, scans = recording.wheels, recording.scans
    poses, places, offset = recording.poses, np.arange(len(scans)), 0.0
    times = np.array([scan.time for scan in scans])
    if lines is not None:
        poses, places, offset = lines.poses, np.maximum(lines.places, 0), lines.laser_offset
        times = lines.times
    solution = solve_log(
        scans,
        poses,
        places,
        times=times,
        laser_offset=offset,
        key_distance=key_distance,
        progress=progress,
    )
    if lines is not None:
        return solution
    # The poses of the scans are those of the laser; what is asked for are those of the base.
    base = compose(solution.line_poses, np.array(recording.mount.inverse()))
    base[:, 2] = np.unwrap(base[:, 2])
    return replace(solution, line_poses=base)


def run_of(recording: Recording, solution: LogSolution) -> Run:
    """A recorded drive as a run: its world is the map, and its true ranges are the measured ones.

    The map is that of the key scans, which show every wall that the robot came by.
    """
    scans, mounted = solution.scans, np.array([solution.laser_offset, 0.0, 0.0])
    poses = compose(solution.scan_poses, mounted)
    poses[:, 2] = np.unwrap(poses[:, 2])
    mapper, keys = LineMapper(), solution.slam.key_scans.tolist()
    schedule, maps = SnapshotSchedule(len(keys)), {}
    for index, number in enumerate(keys):
        mapper.update(replace(scans[number], pose=Pose(*poses[number].tolist())))
        if schedule.holds(index):
            maps[number] = mapper.map
    # The last map is that of all scans: those after the last key scan show nothing new.
    maps[len(scans) - 1] = line_map = maps.pop(keys[-1])
    solid = lengths(line_map.segments) > 0.0
    lrf, ranges = range_finder_of(scans)
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
        tuple(maps),
        tuple(maps.values()),
        estimate=estimate_of(solution, poses),
    )


def range_finder_of(scans: Sequence[LaserScan]) -> tuple[LaserRangeFinder, Float]:
    """The range finder that took scans (k,), and their ranges (k, beams) [m] in its order."""
    first, ranges = scans[0], np.array([scan.ranges for scan in scans])
    angles, farthest = first.angles, first.range_max
    if angles[0] > angles[-1]:
        # A laser that hangs upside down turns clockwise; the range finder of a run does not.
        angles, ranges = angles[::-1], ranges[:, ::-1]
    if not np.isfinite(farthest):
        # Some drivers give no limit: it is the usual one, or what was measured beyond it.
        usual = LaserRangeFinder().range_max
        farthest = float(ranges.max(initial=usual, where=np.isfinite(ranges)))
    begin, end = float(angles[0]), float(angles[-1])
    return LaserRangeFinder(begin, end, len(angles), first.range_min, farthest), ranges


def estimate_of(solution: LogSolution, poses: Float) -> EstimatedTrajectory:
    """The poses (k, 3) of a drive's scans with the covariances of some, and the closures."""
    slam, keys = solution.slam, solution.slam.key_scans
    chosen = np.unique(np.linspace(0, len(keys) - 1, MOST_COVARIANCES).astype(np.int64))
    return EstimatedTrajectory(
        poses,
        keys[chosen],
        slam.covariances(chosen),
        scans_of(slam.closures, keys),
        scans_of(slam.unconfirmed_closures, keys),
    )


@stoppable()
def solve_log(
    scans: Sequence[LaserScan],
    wheels: Float,
    places: Int,
    *,
    times: Float | None = None,
    laser_offset: float = 0.0,
    key_distance: float = KEY_DISTANCE,
    progress: Progress = lambda done, total: None,
) -> LogSolution:
    """Find the poses of a recorded drive.

    Args:
        scans: The scans (k,).
        wheels: (n, 3) poses by odometry, line by line.
        places: (k,) for each scan the index of the last odometry line before it.
        times: (n,) stamps of the lines [s]; a second apart if not given.
        laser_offset: How far the laser stands ahead of the robot's centre [m].
        key_distance: Way from one key scan to the next [m].
        progress: Called with the scans that are done and all.

    Raises:
        InputError: There are fewer than two scans or no odometry, the scans are of several laser
            range finders, a number of the odometry is not finite, or it jumps so often that it is
            invalid.
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
    stamps = np.arange(len(wheels), dtype=np.float64) if times is None else times
    if not (finite := np.isfinite(wheels).all(axis=1) & np.isfinite(stamps)).all():
        line = int(np.flatnonzero(~finite)[0])
        raise InputError(
            f"slam: odometry line {line} at {stamps[line]} s has the pose {wheels[line].tolist()};"
            " expected finite numbers"
        )
    log = repaired(scans, wheels, stamps, places)
    drive = _drive_of(log, laser_offset)
    known = drive.first_wheels
    passes = 0
    while True:
        before = known.biases
        solution = _solved(drive, known, key_distance=key_distance, progress=progress)
        passes += 1
        change = (1.0 + solution.slam.wheels.biases) / (1.0 + before) - 1.0
        as_known = abs(change[2]) <= LEARNED and abs(change[0]) <= LEARNED_TURN
        if as_known or passes == MOST_PASSES:
            return replace(solution, passes=passes, check=solution.slam.self_check())
        known = solution.slam.wheels


@dataclass(frozen=True, eq=False)
class _Drive:
    """A recording that is in order, its odometry by the laser's clock.

    Args:
        log: The recording.
        laser_offset: How far the laser stands ahead of the robot's centre [m].
        path: The way of the wheels.
        start: (3,) pose of the robot at the first scan by the wheels.
        increments: (k, 3) odometry increments to each scan: ahead, to the left [m], turn [rad].
        first_wheels: The wheels' errors, as the beginning of the drive shows them.
    """

    log: Repaired
    laser_offset: float
    path: WheelPath
    start: Float
    increments: Float
    first_wheels: Wheels


def _drive_of(log: Repaired, laser_offset: float) -> _Drive:
    """Find the lag of a recording and, from its beginning, the errors of its wheels."""
    laser, path = np.array([laser_offset, 0.0]), WheelPath(log.wheels)
    resolution = Resolution.of(log.scans[0].angles)

    def surface(number: int) -> Float:
        return surface_of_scan(log.scans[number], laser, sparse=resolution.sparse)

    find_lag = tracked_lag if resolution.sparse else matched_lag
    increments = path.increments(log.places - find_lag(surface, path, log.places, resolution))
    start = path.at(log.places[:1].astype(np.float64))[0]
    # The beginning is followed twice: at first the errors of the wheels are not known.
    known = followed(surface, increments[:CALIBRATED], resolution)[0].wheels
    return _Drive(log, laser_offset, path, start, increments, known)


def _solved(
    drive: _Drive, wheels: Wheels, *, key_distance: float, progress: Progress
) -> LogSolution:
    """Solve a drive, starting from known errors of its wheels."""
    log, path, offset = drive.log, drive.path, drive.laser_offset
    scans, places = log.scans, log.places
    slam = Slam(start=drive.start, laser_offset=offset, key_distance=key_distance, wheels=wheels)
    begin = perf_counter()
    for number, (scan, increment) in enumerate(zip(scans, drive.increments, strict=True), 1):
        slam.update(scan, increment)
        progress(number, len(scans))
        check()
    milliseconds = 1e3 * (perf_counter() - begin) / len(scans)
    slam.finish()
    poses = slam.refined(scans)
    # Now that the poses of all scans are known, all of them show the lag.
    lag = fitted_lag(np.diff(poses[:, 2]), path, places)
    lines = line_poses(path, places, lag, poses)[log.rows]
    return LogSolution(slam, offset, lag, poses, lines, milliseconds, scans, log.repairs)


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
