"""Refusal: logs beyond repair raise an InputError that says what was expected."""

import numpy as np

from lrf3d.base.errors import InputError
from lrf3d.base.text import counted
from lrf3d.geometry.lines import LARGEST_TIME
from lrf3d.laser import doubtful_ranges, doubtful_unit
from lrf3d.recordings.formats.text.fans import WIDEST_FAN
from lrf3d.recordings.log import LaserLog

# Least number of beams of a scan that show a wall.
LEAST_BEAMS = 3


def refuse_useless(log: LaserLog) -> None:
    """Refuse a log without scans, with stamps in nanoseconds, or with ranges in millimetres."""
    if not log.scans:
        raise InputError("a log without scans; expected at least one")
    latest = np.abs(np.concatenate([log.odometry.times, log.times])).max()
    if latest > LARGEST_TIME:
        raise InputError(f"a stamp of {latest:g} s; expected seconds")
    # Ranges in millimetres, taken for metres, would make a map that fills the memory.
    if doubt := doubtful_unit(np.concatenate([scan.ranges[scan.hits] for scan in log.scans])):
        raise InputError(doubt)


def refuse_unplaced(log: LaserLog) -> None:
    """Refuse to map a log whose scans have no poses; a single scan needs none."""
    if not log.placed and len(log.scans) > 1:
        bad = [f"; {counted(log.bad_count, 'bad message')}, {line}" for line in log.bad_lines[:1]]
        raise InputError(f"no poses in it ({log.source}{''.join(bad)}); lrf3d slam finds them")


def refuse_unsolvable(log: LaserLog) -> None:
    """Refuse a log that no SLAM can solve: too few scans, lines or beams, other units."""
    scans = log.scans
    line = log.odometry
    if len(scans) < 2 or not len(line.poses):
        raise InputError(
            f"{counted(len(scans), 'scan')} and {counted(len(line.poses), 'odometry line')};"
            " expected at least two scans and one line"
        )
    first = scans[0].angles
    if len(first) < LEAST_BEAMS:
        raise InputError(f"scans of {len(first)} beams; expected at least {LEAST_BEAMS}")
    if np.abs(first).max() > WIDEST_FAN:
        largest = first[np.abs(first).argmax()]
        raise InputError(f"a beam at {largest:g} rad; expected angles of at most a turn")
    finite = np.isfinite(line.poses).all(axis=1) & np.isfinite(line.times)
    for number in np.flatnonzero(~finite).tolist():
        raise InputError(
            f"odometry line {number} at {line.times[number]} s has the pose"
            f" {line.poses[number].tolist()}; expected finite numbers"
        )
    if doubt := doubtful_ranges(scans):
        raise InputError(doubt)
