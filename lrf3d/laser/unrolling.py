"""Unrolling: a scan that took some time, or those of several lasers, as one from one place at once.

A scan of a robot that moved meanwhile enters, with its motion; a scan from the pose of its first
beam leaves, in which each return is where it was measured. Only the paths of the beams differ from
the true ones, by as much as the laser moved.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lrf3d.geometry.lines import Float, wrap_angle
from lrf3d.geometry.pose import between, compose
from lrf3d.laser.range_finder import CENTRE
from lrf3d.laser.scan import LIGHT, LaserScan

# [s] Longest time between two scans from which the motion during one of them is interpolated.
LONGEST_GAP = 1.0

# Largest share of the time to the next scan that the beams of a scan may take: a larger one is an
# error of the driver.
TOO_LONG = 1.1


def unrolled(scan: LaserScan, motion: Float | None = None) -> LaserScan:
    """The scan as it would be if all beams had been sent where and when the first was.

    Without a motion (3,) it is the scan's own; a scan whose motion is unknown stays as it is.

    Examples:
        >>> import lrf3d
        >>> from lrf3d.laser.unrolling import unrolled
        >>> wall = lrf3d.World([[3, -9, 3, 9]])
        >>> lrf = lrf3d.LaserRangeFinder(-1, 1, 101, scan_duration=0.1)
        >>> drive = lrf3d.drive((0, 0, 0), 1.0, 1.0, duration=0.2)
        >>> run = lrf3d.simulate(wall, drive, lrf, rng=0)
        >>> scans = run.scan(0), unrolled(run.scan(0))
        >>> [float(abs(scan.points()[:, 0] - 3).max().round(2)) for scan in scans]
        [0.45, 0.0]
    """
    motion = scan.motion if motion is None else motion
    if motion is None or scan.time_increment == 0.0 or not np.any(motion):
        return scan
    share = np.linspace(0.0, 1.0, len(scan.ranges))[:, None]
    # Each laser as seen from where it was at its first beam.
    mount = np.array(scan.mount)
    values = _seen(scan, between(mount, compose(share * motion, mount)))
    # A near edge and what is behind it may have changed their order.
    angles = values["angles"]
    order = np.argsort(angles if scan.angles[-1] >= scan.angles[0] else -angles, kind="stable")
    values = {name: each[order] for name, each in values.items()}
    return replace(scan, **values, time_increment=0.0, motion=None)


def together(scans: Sequence[LaserScan]) -> LaserScan:
    """The scans of several lasers at one moment as one, from the middle of their robot.

    Each return is where it was measured, and beams without one keep their directions.
    """
    if len(scans) == 1:
        return scans[0]
    parts = [_seen(scan, np.array([scan.mount])) for scan in map(unrolled, scans)]
    known = set(parts[0]).intersection(*parts)
    arrays = {name: np.concatenate([part[name] for part in parts]) for name in known}
    arrays["angles"] = wrap_angle(arrays["angles"])
    order = np.argsort(arrays["angles"], kind="stable")
    values: dict[str, Any] = dict.fromkeys(LIGHT) | {n: each[order] for n, each in arrays.items()}
    return replace(
        scans[0],
        **values,
        pose=scans[0].robot,
        mount=CENTRE,
        range_min=min(each.range_min for each in scans),
        range_max=max(each.range_max for each in scans),
        laser="+".join(each.laser for each in scans),
        motion=None,
        time_increment=0.0,
    )


def _seen(scan: LaserScan, places: Float) -> dict[str, Any]:
    """The arrays of a scan as seen from one place, its beams sent from places (k, 3) or one."""
    headings = scan.angles + places[:, 2]
    away = np.where(scan.hits, scan.ranges, 0.0)
    x = places[:, 0] + away * np.cos(headings)
    y = places[:, 1] + away * np.sin(headings)
    turn = np.where(scan.hits, wrap_angle(np.arctan2(y, x) - headings), 0.0)
    # What was measured stays a return, though it may be a little farther from the first beam.
    most = math.nextafter(scan.range_max, 0.0)
    ranges = np.where(scan.hits, np.minimum(np.hypot(x, y), most), scan.ranges)
    values: dict[str, Any] = {"angles": headings + turn, "ranges": ranges, "walls": scan.walls}
    values |= {name: getattr(scan, name) for name in LIGHT if getattr(scan, name) is not None}
    if scan.echoes is not None:
        farther = np.where(scan.hits, ranges - away, 0.0)
        values["echoes"] = np.maximum(scan.echoes + farther[:, None], 0.0)
    return values


def motion_since(before: LaserScan | None, scan: LaserScan) -> Float | None:
    """The motion (3,) during a scan if the robot moves on as since the scan before, or its own."""
    if before is None or scan.motion is not None or not scan.time_increment:
        return scan.motion
    since = scan.time - before.time
    if not 0.0 < since <= LONGEST_GAP:
        return None
    return scan.duration / since * between(np.array(before.robot), np.array(scan.robot))


def with_motions(scans: Sequence[LaserScan]) -> list[LaserScan]:
    """Recorded scans with the motion of the robot during each, by the poses of its laser's scans.

    The scans are in the order of time. The last of a laser moves on as before it, and a scan whose
    beams would take longer than the time to the next keeps its motion unknown.
    """
    found = list(scans)
    if not any(scan.time_increment for scan in scans):
        return found
    lasers: dict[str, list[int]] = {}
    for number, scan in enumerate(scans):
        lasers.setdefault(scan.laser, []).append(number)
    for own in lasers.values():
        rate = np.zeros(3)
        for number, following in zip(own, [*own[1:], None], strict=True):
            scan = scans[number]
            gap = LONGEST_GAP
            if following is not None:
                gap = scans[following].time - scan.time
                step = between(np.array(scan.robot), np.array(scans[following].robot))
                rate = step / gap if 0.0 < gap <= LONGEST_GAP else np.zeros(3)
            if scan.motion is None and 0.0 < abs(scan.duration) <= TOO_LONG * gap:
                found[number] = replace(scan, motion=scan.duration * rate)
    return found
