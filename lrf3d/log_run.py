"""Runs of recorded drives: the scans of a log at poses, in the walls of the map that they make."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Float, lengths
from lrf3d.interrupts import Progress, check, silent
from lrf3d.io.laser_log import on_one_fan
from lrf3d.laser import LaserRangeFinder, LaserScan, doubtful_ranges
from lrf3d.laser.unrolling import unrolled
from lrf3d.localization.joining import Joined
from lrf3d.mapping import LineMap, LineMapper
from lrf3d.pose import Pose, compose
from lrf3d.robot import EstimatedTrajectory, Trajectory
from lrf3d.run import Run, is_snapshot
from lrf3d.slam import Slam
from lrf3d.world import World

PAUSE = 1.0
"""Time [s] between two drives in their joint run."""


def run_of(
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


def joint_run(both: Joined, slam: Slam, scans: Sequence[LaserScan], poses: Float, name: str) -> Run:
    """Two drives as one run: the first, and after it the scans (k,) of the second's laser.

    Its poses (k, 3) are those that joining has found.
    """
    first, count = both.run, len(both.run)
    before = compose(both.first_poses, np.array(first.lrf.mount))
    whole = np.vstack([before, poses])
    whole[:, 2] = np.unwrap(whole[:, 2])
    later = first.trajectory.times[-1] + PAUSE - scans[0].time
    shown = [first.scan(k) for k in range(count)]
    shown += [replace(scan, time=scan.time + later) for scan in scans]
    nothing = np.empty(0, np.int64), np.empty((0, 3, 3))
    own = slam.estimate(poses, *nothing)
    earlier = first.estimate or EstimatedTrajectory(before, *nothing)
    estimate = EstimatedTrajectory(
        whole, *nothing,
        np.vstack([earlier.closures, count + own.closures, both.ties + np.array([0, count])]),
        np.vstack([earlier.dropped_closures, count + own.dropped_closures]),
    )  # fmt: skip
    keys = [*both.keys.tolist(), *(count + slam.key_scans).tolist()]
    return run_of(name, shown, whole, keys, LineMapper(), estimate=estimate)


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
