"""Recorded drives as runs: `map_log` believes the poses of a log, `slam_log` finds them.

A log, or the path of one, enters; a `Run` leaves, whose world is the map of the drive.
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.errors import InputError, Lrf3dWarning, expect
from lrf3d.geometry import Float, lengths
from lrf3d.interrupts import Progress, check, silent, stoppable
from lrf3d.io import LaserLog, load_log
from lrf3d.io.laser_log import on_one_fan
from lrf3d.io.reading import odometry_of
from lrf3d.laser import LaserRangeFinder, LaserScan, doubtful_ranges
from lrf3d.laser.range_finder import CENTRE
from lrf3d.laser.unrolling import unrolled
from lrf3d.mapping import LineMap, LineMapper
from lrf3d.pose import Pose, compose
from lrf3d.robot import EstimatedTrajectory, Trajectory
from lrf3d.run import Run, is_snapshot
from lrf3d.slam import Slam
from lrf3d.slam.front_end import KEY_DISTANCE
from lrf3d.slam.mounting import doubtful_mount
from lrf3d.slam.odometry import (
    Recording,
    Repairs,
    WheelPath,
    fitted_lag,
    in_order,
    is_mirrored,
    line_poses,
    turns_between,
)
from lrf3d.slam.violation import SelfCheck
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

LEAST_BEAMS = 3
"""Beams that a scan must have to show a wall."""

MOST_COVARIANCES = 128
"""Key scans whose covariances are kept, at most: each takes a step over the whole pose graph."""

JITTER = 1e-4
"""Angles of the beams may differ by this from scan to scan [rad]: some drivers round them."""

LATEST = 1e12
"""Largest stamp [s]: larger ones are nanoseconds, of which a float cannot tell two apart."""


@stoppable()
def map_log(
    log: LaserLog | str | Path,
    *,
    mode: str = "robust",
    sigma: float | None = None,
    all_scans: bool = False,
    progress: Progress = silent,
) -> Run:
    """Build a map from the even scans of a log, counted from 0: the odd ones are left to test it.

    Args:
        log: The log, or its path; its poses are taken as they are.
        mode: Mode of the mapper.
        sigma: Noise [m] at the largest range; learnt from the scans if not given.
        all_scans: Build it from all scans instead.
        progress: Called with the number of finished scans, and of all.

    Returns:
        The mapped scans as a run, in the walls that they show.

    Raises:
        InputError: There is no such mode, the noise is invalid, the poses are not known, or the
            scans show no wall.

    Warns:
        Lrf3dWarning: The ranges are hardly in metres, or the laser is mounted otherwise.

    Examples:
        >>> import lrf3d
        >>> from lrf3d.scoring import score_log
        >>> room = lrf3d.load_world("paper_room")
        >>> run = lrf3d.simulate(room, [(1 + 0.1 * k, 1, 0) for k in range(10)], rng=0)
        >>> lrf3d.export_run(run, "carmen", "drive.log")
        >>> mapped = lrf3d.map_log("drive.log")
        >>> odd = lrf3d.load_log("drive.log").scans[1::2]
        >>> len(mapped), score_log(mapped.map, odd).explained > 0.9
        (5, True)
    """
    expect(progress, Callable, "progress")
    log = readable(log if isinstance(log, LaserLog) else load_log(log))
    if not log.placed:
        raise InputError(f"{log.name}: no poses in it ({log.source}); lrf3d slam finds them")
    chosen, mapper = np.flatnonzero(~log.is_odd | all_scans), LineMapper(mode, sigma=sigma)
    scans, poses = [log.scans[k] for k in chosen], log.poses[chosen]
    keys = range(len(scans))
    run = _run_of(log.name, scans, poses, keys, mapper, snapshots=1, progress=progress)
    for doubt in (doubtful_ranges(log.scans), doubtful_mount(log.scans)):
        if doubt:
            warnings.warn(f"map: {log.name}: {doubt}", Lrf3dWarning, stacklevel=2)
    return run


@stoppable()
def slam_log(log: LaserLog | str | Path, *, key_distance: float = KEY_DISTANCE) -> Run:
    """Find the poses and the map of a recorded drive from its scans and its odometry.

    Args:
        log: The log, or its path.
        key_distance: Distance driven from one key scan to the next [m].

    Returns:
        The drive as a run, in the walls that it mapped.

    Raises:
        InputError: The log is no drive that SLAM can solve; the line says why.

    Warns:
        Lrf3dWarning: Scans contradict each other, so that the map or a part of it is wrong.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> run = lrf3d.simulate(room, [(1 + 0.1 * k, 1, 0) for k in range(10)], rng=0)
        >>> lrf3d.export_run(run, "carmen", "drive.log")
        >>> lrf3d.slam_log("drive.log").trajectory.poses[-1, :2].round(1).tolist()
        [1.9, 1.0]
    """
    solved = solve_log(log, key_distance=key_distance)
    for sentence in solved.warnings:
        warnings.warn(f"slam: {solved.log.name}: {sentence}", Lrf3dWarning, stacklevel=2)
    return solved.run


@dataclass(frozen=True, eq=False, repr=False)
class SolvedLog:
    """The solution of a log: poses of the robot x, y [m], theta [rad] by the clock of its laser.

    ``poses`` (k, 3) are those at the ``scans`` (k,), which are in the order in which they were
    taken, each once; ``line_poses`` (n, 3) are those at the odometry lines, as logged. The laser's
    clock is ``lag`` lines behind that of the odometry. The drive was solved ``passes`` times: again
    where its wheels' errors turned out to differ.
    """

    log: LaserLog
    slam: Slam
    scans: list[LaserScan]
    poses: Float
    line_poses: Float
    lag: float
    repairs: Repairs
    check: SelfCheck
    passes: int

    def __repr__(self) -> str:
        return f"SolvedLog({self.log.name}, {self.slam}, {len(self.line_poses)} odometry lines)"

    @property
    def warnings(self) -> list[str]:
        """What users should know of the solution, a sentence each."""
        mirrored = self.repairs.sentences()[:1] if self.repairs.mirrored else []
        mount = doubtful_mount(self.log.scans, mirrored=False)
        return [*mirrored, *([mount] if mount else []), *self.check.sentences()]

    @property
    def odometry(self) -> str:
        """Where the odometry comes from, in words."""
        if not self.log.placed:
            return "none: by the laser alone"
        return "the poses of the scans" if self.log.wheels is None else "ODOM lines"

    @cached_property
    def run(self) -> Run:
        """The drive as a run, in the walls that its key scans show."""
        slam, keys = self.slam, self.slam.key_scans
        mount = self.scans[0].mount
        if mount == CENTRE:
            mount = Pose(self.log.odometry.laser_offset, 0.0, 0.0)
        poses = compose(self.poses, np.array(mount))
        poses[:, 2] = np.unwrap(poses[:, 2])
        chosen = np.unique(np.linspace(0, len(keys) - 1, MOST_COVARIANCES).astype(np.int64))
        estimate = slam.estimate(poses, keys[chosen], slam.covariances(chosen))
        scans, keys = self.scans, keys.tolist()
        return _run_of(self.log.name, scans, poses, keys, LineMapper(), estimate=estimate)

    def summary(self) -> dict[str, Any]:
        """The figures, in JSON's types."""
        log, slam, line_map, tracked = self.log, self.slam, self.run.map, self.slam.tracked[1:]
        errors = "turn_share", "turn_rad_per_m", "distance_share"
        return {
            "name": log.name,
            "log": {
                **log.counts,
                "odometry_lines": len(self.line_poses),
                "odometry": self.odometry,
                **asdict(self.repairs),
            },
            "map": {"segments": len(line_map), "objects": line_map.object_count},
            "wheels": {
                "lag_lines": self.lag,
                **dict(zip(errors, slam.wheels.biases.tolist(), strict=True)),
                "solved_times": self.passes,
            },
            "slam": {
                "length_m": self.run.trajectory.length,
                "key_scans": len(slam.key_scans),
                "loop_closures": len(slam.closures),
                "loop_closures_dropped": len(slam.unconfirmed_closures),
                "scans_by_odometry_alone": sum(not scan.matched for scan in tracked),
                "scans_with_a_weak_direction": sum(scan.weak for scan in tracked),
            },
            "self_check": {"passed": self.check.passed, **self.check._asdict()},
        }


def solve_log(
    log: LaserLog | str | Path,
    *,
    key_distance: float = KEY_DISTANCE,
    progress: Progress = silent,
) -> SolvedLog:
    """Find the poses of a recorded drive; arguments are those of `slam_log`.

    Progress is called with the number of finished scans, and of all.
    """
    expect(progress, Callable, "progress")
    if not isinstance(log, LaserLog):
        log = load_log(log, poses=odometry_of(log))
    log = readable(log)
    log = log.of_laser(log.lasers[0])
    offset = log.odometry.laser_offset
    try:
        recording = _checked(log)
        path = WheelPath(recording.wheels)
        recording, turns = _right_handed(recording, path, offset)
    except InputError as error:
        raise InputError(f"{log.name}: {error}") from None
    scans, places = recording.scans, recording.places
    increments: Sequence[Float | None] = [None] * len(scans)
    if log.placed:
        increments = list(path.increments(places - fitted_lag(turns, path, places)))
    start = path.at(places[:1].astype(np.float64))[0]
    # The beginning is followed twice: at first the errors of the wheels are not known.
    slam = Slam(laser_offset=offset)
    for scan, increment in zip(scans[:CALIBRATED], increments, strict=False):
        slam.update(scan, increment)
    passes, learned = 0, True
    while learned and passes < MOST_PASSES:
        passes += 1
        known = slam.wheels
        slam = Slam(start=start, laser_offset=offset, key_distance=key_distance, wheels=known)
        for number, (scan, increment) in enumerate(zip(scans, increments, strict=True), 1):
            slam.update(scan, increment)
            progress(number, len(scans))
            check()
        change = np.abs((1.0 + slam.wheels.biases) / (1.0 + known.biases) - 1.0)
        learned = change[2] > LEARNED or change[0] > LEARNED_TURN
    slam.finish()
    poses = slam.refined(scans)
    # Now that the poses of all scans are known, all of them show the lag.
    lag = fitted_lag(np.diff(poses[:, 2]), path, places)
    lines = line_poses(path, places, lag, poses)[recording.rows]
    lines[:, 2] = np.unwrap(lines[:, 2])
    found = recording.repairs, slam.self_check()
    return SolvedLog(log, slam, scans, poses, lines, lag, *found, passes)


def readable(log: LaserLog) -> LaserLog:
    """A log whose scans share the angles where they hardly differ, refused if it is useless."""
    if not log.scans:
        raise InputError(f"{log.name}: a log without scans; expected at least one")
    stamps = np.concatenate([log.odometry.times, log.times])
    if (latest := np.abs(stamps).max()) > LATEST:
        raise InputError(f"{log.name}: a stamp of {latest:g} s; expected seconds")
    first = log.scans[0].angles
    even = [replace(scan, angles=first) if _alike(scan, first) else scan for scan in log.scans]
    return replace(log, scans=even)


def _alike(scan: LaserScan, angles: Float) -> bool:
    """Whether a scan has other angles, which differ from these by rounding."""
    own = scan.angles
    near = own.shape == angles.shape and np.abs(own - angles).max() <= JITTER
    return own is not angles and bool(near)


def _checked(log: LaserLog) -> Recording:
    """A log in order, which is refused where no SLAM can solve it."""
    scans, wheels, times = log.scans, log.odometry.poses, log.odometry.times
    if len(scans) < 2 or not len(wheels):
        count = f"{len(scans)} scans and {len(wheels)} odometry lines"
        raise InputError(f"{count}; expected at least two scans and one line")
    first = scans[0].angles
    if len(first) < LEAST_BEAMS:
        raise InputError(f"scans of {len(first)} beams; expected at least {LEAST_BEAMS}")
    if np.abs(first).max() > 2.0 * np.pi:
        angle = first[np.abs(first).argmax()]
        raise InputError(f"a beam at {angle:g} rad; expected angles of at most a turn")
    finite = np.isfinite(wheels).all(axis=1) & np.isfinite(times)
    if not finite.all():
        line = int(np.flatnonzero(~finite)[0])
        pose = f"odometry line {line} at {times[line]} s has the pose {wheels[line].tolist()}"
        raise InputError(f"{pose}; expected finite numbers")
    if doubt := doubtful_ranges(scans):
        raise InputError(doubt)
    return in_order(scans, wheels, times, np.maximum(log.odometry.places, 0))


def _right_handed(recording: Recording, path: WheelPath, offset: float) -> tuple[Recording, Float]:
    """A recording whose laser turns as the odometry does, and the turns that its scans show."""
    slam, scans = Slam(laser_offset=offset), recording.scans
    turns = turns_between(lambda number: slam.seen(scans[number]), path, recording.places)
    if not is_mirrored(turns, path, recording.places):
        return recording, turns
    # The order of the beams in time is lost with that of their angles.
    scans = [replace(scan, ranges=scan.ranges[::-1], time_increment=0.0) for scan in scans]
    repairs = replace(recording.repairs, mirrored=True)
    return replace(recording, scans=scans, repairs=repairs), -turns


def _run_of(
    name: str,
    scans: Sequence[LaserScan],
    poses: Float,
    keys: Sequence[int],
    mapper: LineMapper,
    *,
    snapshots: int | None = None,
    estimate: EstimatedTrajectory | None = None,
    progress: Progress = silent,
) -> Run:
    """The scans (k,) of one laser at poses (k, 3) as a run, whose world is the map of some of them.

    Maps of the scans before the last key scan are kept as in a simulated run.
    """
    scans = [unrolled(scan) for scan in scans]
    maps: dict[int, LineMap] = {}
    for done, number in enumerate(keys, 1):
        mapper.update(replace(scans[number], pose=Pose(*poses[number].tolist())))
        if is_snapshot(done - 1, len(keys), snapshots):
            maps[number] = mapper.map
        progress(done, len(keys))
        check()
    # The last map is that of all scans: those after the last key scan show nothing new.
    maps[len(scans) - 1] = line_map = maps.pop(keys[-1])
    solid = lengths(line_map.segments) > 0.0
    if not solid.any():
        reason = doubtful_ranges(scans) or "expected walls within the laser's range"
        raise InputError(
            f"{name}: {len(scans)} scans show no wall, so that there is no map; {reason}"
        )
    angles, ranges = on_one_fan(scans)
    begin, end = angles[[0, -1]].tolist()
    nearest, farthest = min(s.range_min for s in scans), max(s.range_max for s in scans)
    if farthest == np.inf:
        # Some drivers give no limit: it is the usual one, or what was measured beyond it.
        usual = LaserRangeFinder().range_max
        farthest = float(ranges.max(initial=usual, where=np.isfinite(ranges)))
    # Stamps count from 1970; the clock of a run begins with it.
    times = rising(np.array([scan.time for scan in scans]))
    return Run(
        World(line_map.segments[solid], line_map.objects[solid], name=name),
        LaserRangeFinder(begin, end, len(angles), nearest, farthest),
        Trajectory(times - times[0], poses),
        ranges,
        ranges,
        np.full(ranges.shape, -1),
        tuple(maps),
        tuple(maps.values()),
        estimate=estimate,
    )


def rising(stamps: Float) -> Float:
    """Stamps (k,) [s] as times that rise: one that does not lies evenly between those around it."""
    latest = np.maximum.accumulate(stamps)
    knots = np.flatnonzero(np.concatenate([[True], np.diff(latest) > 0.0]))
    steps = np.diff(stamps)
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 1.0
    number = np.arange(len(stamps), dtype=np.float64)
    times = np.interp(number, knots, latest[knots])
    times[knots[-1] :] = latest[knots[-1]] + usual * (number[knots[-1] :] - knots[-1])
    return np.asarray(times)
