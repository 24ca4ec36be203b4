"""Body: leave out readings of the robot itself, which stay the same while it drives.

Posts, wheels and cables in a laser's view are hit at the same bearing and range in all scans, while
everything else in view changes. In a map they would be walls along the whole path.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy

from lrf3d.base.text import counted
from lrf3d.geometry.lines import Float, Int
from lrf3d.laser import LaserScan
from lrf3d.recordings.log import LaserLog, on_one_fan
from lrf3d.recordings.repair import Repair

# Readings of one bearing that differ by less [m] are equal, for coarse lasers of small robots.
STILL = 0.05

# Two scans are compared with a tolerance that is larger by this share of the range.
STILL_SHARE = 0.05

# The robot has moved if at least this share of the beams reads another range than in the scan
# before; it is small because the robot itself may block much of a laser's view.
LEAST_CHANGED = 0.25

# Least number of scans from different places: in so many, only the robot keeps its range.
LEAST_PLACES = 20

# Least share of these scans in which a bearing of the robot's body returns.
LEAST_HITS = 0.5

# Least share of the readings of such a bearing that are equal.
LEAST_SAME = 0.95

# Largest distance of the robot's body from its laser [m]. A wall that the robot follows keeps its
# range, too, but is also seen farther away, at adjacent bearings.
FARTHEST = 1.5

# Number of beams on each side of the body that may graze it, and are left out with it.
GRAZING = 2

# Largest number of scans that are compared.
MOST_SCANS = 600


class OwnBody(NamedTuple):
    """Rising bearings (n,) [rad], and the range (n,) [m] up to which each sees the robot itself."""

    angles: Float
    near: Float


def find(log: LaserLog) -> dict[str, OwnBody] | None:
    """The robot's body as each laser sees it, by the laser's name; None if none sees it."""
    found = {name: _body([s for s in log.scans if s.laser == name]) for name in log.lasers}
    return {name: body for name, body in found.items() if body is not None} or None


def _body(scans: Sequence[LaserScan]) -> OwnBody | None:
    angles, ranges = on_one_fan(scans[:: len(scans) // MOST_SCANS + 1])
    ranges = ranges[_places(ranges)]
    if len(ranges) < LEAST_PLACES:
        return None
    hits = np.isfinite(ranges)
    # The median ignores missing returns, except of beams that never return.
    middle = np.nanmedian(np.where(hits | ~hits.any(axis=0), ranges, np.nan), axis=0)
    apart = np.where(hits, ranges, np.inf) - np.where(np.isfinite(middle), middle, 0.0)
    same = (np.abs(apart) < STILL).sum(axis=0)
    still = (hits.mean(axis=0) > LEAST_HITS) & (same > LEAST_SAME * hits.sum(axis=0))
    beams = np.flatnonzero(still)
    near = np.zeros(len(angles))
    for run in np.split(beams, np.flatnonzero(np.diff(beams) > 1) + 1):
        if len(run) and middle[run].max() < FARTHEST:
            near[run] = middle[run] + STILL
    return (
        OwnBody(angles, scipy.ndimage.maximum_filter1d(near, 2 * GRAZING + 1))
        if near.any()
        else None
    )


def _places(ranges: Float) -> Int:
    """Numbers (m,) of those scans (k, beams) before which the robot has moved."""
    kept = [0]
    for number in range(1, len(ranges)):
        before = ranges[kept[-1]]
        both = np.isfinite(before) & np.isfinite(ranges[number])
        apart = np.abs(ranges[number][both] - before[both])
        changed = apart > STILL + STILL_SHARE * before[both]
        if changed.sum() > LEAST_CHANGED * max(len(changed), 1):
            kept.append(number)
    return np.array(kept)


def apply(log: LaserLog, bodies: dict[str, OwnBody]) -> LaserLog:
    """The log without readings of the robot itself, which become −inf: not measured."""
    scans = [_without(scan, bodies.get(scan.laser)) for scan in log.scans]
    return replace(log, scans=scans, notes=(*log.notes, sentence(bodies)))


def _without(scan: LaserScan, body: OwnBody | None) -> LaserScan:
    if body is None:
        return scan
    at = np.clip(np.searchsorted(body.angles, scan.angles), 1, len(body.angles) - 1)
    at -= scan.angles - body.angles[at - 1] < body.angles[at] - scan.angles
    return replace(scan, ranges=np.where(scan.ranges <= body.near[at], -np.inf, scan.ranges))


def sentence(bodies: dict[str, OwnBody]) -> str:
    """Say at which bearings and ranges the robot sees itself."""
    beams = sum(int((body.near > 0.0).sum()) for body in bodies.values())
    where = [np.degrees(body.angles[body.near > 0.0]) for body in bodies.values()]
    ends = ", ".join(f"{each.min():.0f}° to {each.max():.0f}°" for each in where)
    farthest = max(body.near.max() for body in bodies.values())
    return (
        f"the robot itself is seen by {counted(beams, 'beam')} between {ends}, up to"
        f" {farthest:.2f} m: left out; --mask and --smallest-range leave out more"
    )


BODY = Repair("body", find, apply, sentence)
