"""Recorded drives as runs, and `map_log`, which takes the poses of a log as they are.

A log, or the path of one, enters. A `Run` leaves, whose world is the map of the drive; `slam_log`,
which finds the poses first, makes its run here, too.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from lrf3d.errors import InputError, Lrf3dWarning
from lrf3d.geometry import Float, lengths
from lrf3d.interrupts import check, stoppable
from lrf3d.io import LaserLog, load_log
from lrf3d.laser import LaserRangeFinder, LaserScan, doubtful_ranges
from lrf3d.mapping import LineMap, LineMapper
from lrf3d.progress import Progress, silent
from lrf3d.robot import EstimatedTrajectory, Trajectory
from lrf3d.run import Run
from lrf3d.world import World

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
        InputError: There is no such mode, the noise is invalid, the scans are of several lasers, or
            they show no wall.

    Warns:
        Lrf3dWarning: The ranges are hardly in metres.

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
    log = of_one_laser(log if isinstance(log, LaserLog) else load_log(log))
    every, mapper = slice(None, None, 1 if all_scans else 2), LineMapper(mode, sigma=sigma)
    scans = log.scans[every]
    for done, scan in enumerate(scans, 1):
        mapper.update(scan)
        progress(done, len(scans))
        check()
    run = run_of(log.name, scans, log.poses[every], {len(scans) - 1: mapper.map})
    if doubt := doubtful_ranges(log.scans):
        warnings.warn(f"map: {log.name}: {doubt}", Lrf3dWarning, stacklevel=2)
    return run


def of_one_laser(log: LaserLog) -> LaserLog:
    """A log with its scans at the angles of the first, refused if they are of several lasers."""
    first = log.scans[0].angles
    for number, scan in enumerate(log.scans):
        if scan.angles.shape != first.shape or np.abs(scan.angles - first).max() > JITTER:
            raise InputError(
                f"{log.name}: scan {number} has {len(scan.ranges)} beams at other angles than the"
                " first; expected scans of one laser range finder"
            )
    stamps = np.concatenate([log.odometry.times, log.times])
    if np.abs(stamps).max() > LATEST:
        latest = stamps[np.abs(stamps).argmax()]
        raise InputError(f"{log.name}: a stamp of {latest:g} s; expected seconds")
    even = [scan if scan.angles is first else replace(scan, angles=first) for scan in log.scans]
    return replace(log, scans=even)


def run_of(
    name: str,
    scans: Sequence[LaserScan],
    poses: Float,
    maps: Mapping[int, LineMap],
    estimate: EstimatedTrajectory | None = None,
) -> Run:
    """A recorded drive as a run: its world is its last map, its ranges are the measured ones.

    The scans (k,) are of one laser, at poses (k, 3); maps are named by the scans that they follow.
    """
    line_map = maps[len(scans) - 1]
    solid = lengths(line_map.segments) > 0.0
    if not solid.any():
        reason = doubtful_ranges(scans) or "expected walls within the laser's range"
        raise InputError(
            f"{name}: {len(scans)} scans show no wall, so that there is no map; {reason}"
        )
    lrf, ranges = range_finder_of(scans)
    # Stamps count from 1970; the clock of a run begins with it.
    times = rising(np.array([scan.time for scan in scans]))
    return Run(
        World(line_map.segments[solid], line_map.objects[solid], name=name),
        lrf,
        Trajectory(times - times[0], poses),
        ranges,
        ranges,
        np.full(ranges.shape, -1),
        tuple(maps),
        tuple(maps.values()),
        estimate=estimate,
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
