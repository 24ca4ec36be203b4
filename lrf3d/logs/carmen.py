"""CARMEN logs: scans and poses of a drive, as the CARMEN toolkit and its log archives write them.

A log enters, gzipped or not; its scans leave, with the logged poses, or those of the odometry or
the truth at their times. If a SLAM system has corrected the log, the logged poses are the corrected
ones. Lines that cannot be read are skipped and reported; `carmen_messages` documents the lines.
"""

from dataclasses import replace
from pathlib import Path

from lrf3d.errors import InputError
from lrf3d.laser import LaserScan
from lrf3d.logs.carmen_messages import LoggedPose, read_carmen
from lrf3d.logs.laser_log import MOST_READINGS, NAMED, BadLine, LaserLog, log_name
from lrf3d.logs.packed import lines_of
from lrf3d.pose import Pose
from lrf3d.robot import Trajectory


def load_carmen(
    path: str | Path, *, largest_range: float | None = None, poses: str = "auto"
) -> LaserLog:
    """Read the scans of a CARMEN log.

    Args:
        path: The log, packed with gzip or not.
        largest_range: Readings from here on are no return [m]; where not given the farthest that
            the message says its range finder sees, or 50 m.
        poses: ``auto`` for those of the scans, ``odom`` or ``truth`` for those that ODOM or
            TRUEPOS messages give for the times of the scans, taken as the laser's.

    Raises:
        InputError: The file cannot be read, holds no scan or not the poses that are asked for,
            or more than fit into memory.
    """
    path = Path(path)
    if largest_range is not None and not largest_range > 0.0:
        raise InputError(f"largest range {largest_range}: expected metres, more than 0")
    scans: list[LaserScan] = []
    tracks: dict[str, list[LoggedPose]] = {"odom": [], "truth": []}
    named: list[BadLine] = []
    bad = readings = 0
    for item in read_carmen(lines_of(path), largest_range=largest_range, source=str(path)):
        if isinstance(item, BadLine):
            bad += 1
            named += [item] if len(named) < NAMED else []
            continue
        if isinstance(item, LoggedPose):
            _append(tracks[item.track], item)
            continue
        readings += len(item.ranges)
        if readings > MOST_READINGS:
            raise InputError(
                f"{path}: more than {MOST_READINGS:,} readings; cut the log into parts"
            )
        scans.append(item)
    if not scans:
        why = f"; {bad} bad lines, first {named[0]}" if named else ""
        raise InputError(f"{path}: no laser scan in it, expected FLASER or ROBOTLASER1 lines{why}")
    known = {
        name: Trajectory([row.time for row in rows], [row.pose for row in rows])
        for name, rows in tracks.items()
        if rows
    }
    log = LaserLog(log_name(path), scans, bad, tuple(named), tracks=known)
    return log if poses == "auto" else _placed_by(log, poses, path)


def _append(rows: list[LoggedPose], row: LoggedPose) -> None:
    """Add a pose to a track, unless it is no later than the one before."""
    if not rows or row.time > rows[-1].time:
        rows.append(row)


def _placed_by(log: LaserLog, name: str, path: Path) -> LaserLog:
    """The log with the poses of one of its tracks; what lies before or after it is left out."""
    if name not in log.tracks:
        there = ", ".join(["auto", *log.tracks])
        raise InputError(f"{path}: no poses from {name} in it; there are {there}")
    track = log.tracks[name]
    inside = (log.times >= track.times[0]) & (log.times <= track.times[-1])
    placed = track.at(log.times)
    scans = [
        replace(scan, pose=Pose(*pose.tolist()))
        for scan, pose, known in zip(log.scans, placed, inside, strict=True)
        if known
    ]
    if not scans:
        raise InputError(f"{path}: no scan within the time of the poses from {name}")
    source = "ODOM messages" if name == "odom" else "TRUEPOS messages"
    return replace(log, scans=scans, source=source)
