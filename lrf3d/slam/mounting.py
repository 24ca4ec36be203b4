"""Whether the scans of a drive fit their poses, and how their laser is said to be mounted.

Scans with the poses of their robot enter; a sentence leaves if pairs of scans fit far better with a
laser that is turned or mirrored, or do not fit at all.
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from lrf3d.geometry import Float
from lrf3d.interrupts import check
from lrf3d.laser import LaserScan
from lrf3d.laser.range_finder import beam_directions
from lrf3d.pose import between, compose

PAIRS, LEAST_PAIRS = 60, 5
"""Pairs of scans that are compared, at most and at least."""

APART, TURNED = 0.4, 0.2
"""The robot moved by at least the first [m] or turned by the second [rad] between two of a pair."""

POINTS = 200
"""Points of a scan that are compared: they show its shape."""

TURNS = (0.0, 0.5 * np.pi, np.pi, -0.5 * np.pi)
"""Turns of a laser on its mount that are compared [rad]."""

CLEARLY, CLOSE = 3.0, 0.03
"""The points of pairs lie this factor nearer to each other if the laser is mounted otherwise, and
this [m]."""

SHARE = 0.8
"""Share of the points of a pair that lie nearer: walls along the drive fit in any case."""

CONTRADICTED = 0.5
"""Scans that lie this far apart [m] do not fit their poses, however the laser is mounted."""

JUMP, USUAL = 3.0, 10.0
"""A robot does not move farther [m] from scan to scan, and by this factor of nearly all steps."""


def doubtful_mount(scans: Sequence[LaserScan], *, mirrored: bool = True) -> str | None:
    """A sentence that says how the laser seems to be mounted; None if it is as declared."""
    own = [scan for scan in scans if scan.laser == scans[0].laser and scan.hits.any()]
    pairs = _pairs(np.array([scan.robot for scan in own]).reshape(-1, 3))
    if len(pairs) < LEAST_PAIRS:
        return None
    ways = [(turn, sense) for sense in ((1.0, -1.0) if mirrored else (1.0,)) for turn in TURNS]
    apart = np.array([[_distance(own[a], own[b], *way) for way in ways] for a, b in pairs])
    found = np.median(apart, axis=0)
    best = int(found.argmin())
    if best == 0 or found[0] < CLEARLY * found[best] + CLOSE:
        return None
    turn, sense = ways[best]
    seems = [f"turned by {np.degrees(turn):.0f}°"] * (turn != 0.0) + ["mirrored"] * (sense < 0.0)
    return (
        f"the poses contradict the laser's mount: scans fit each other to {found[best]:.2f} m"
        f" instead of {found[0]:.2f} m if it is {' and '.join(seems)}; check its transform"
    )


def doubtful_poses(scans: Sequence[LaserScan]) -> str | None:
    """A sentence that says why the poses of scans are hardly those of their robot, or None."""
    own = [scan for scan in scans if scan.laser == scans[0].laser and scan.hits.any()]
    robots = np.array([scan.robot for scan in own]).reshape(-1, 3)
    steps = np.hypot(*np.diff(robots[:, :2], axis=0).T)
    if len(own) > LEAST_PAIRS and steps.max() > max(JUMP, USUAL * float(np.quantile(steps, 0.95))):
        at = int(steps.argmax()) + 1
        return f"the poses jump by {steps.max():.3g} m at scan {at}; expected one drive, in metres"
    pairs = _pairs(robots)
    if not pairs and len(own) > LEAST_PAIRS:
        pairs = [(0, len(own) // 4), (0, len(own) // 2), (0, len(own) - 1)]
        far = max(_distance(own[a], own[b], 0.0, 1.0) for a, b in pairs)
        moved = f"scans of it lie {far:.2g} m apart: they are not those of a robot that moved"
        return f"the poses stay at one place, but {moved}" if far > CONTRADICTED else None
    far = float(np.median([_distance(own[a], own[b], 0.0, 1.0) for a, b in pairs] or [0.0]))
    if len(pairs) < LEAST_PAIRS or far < CONTRADICTED:
        return None
    apart = f"scans near each other lie {far:.2g} m apart"
    return f"the poses contradict the scans: {apart}; are they this robot's, in metres?"


def _pairs(robots: Float) -> list[tuple[int, int]]:
    """Pairs of scans of a robot at poses (k, 3) that moved between them, from all of its drive."""
    pairs, first = list[tuple[int, int]](), 0
    for number in range(1, len(robots)):
        step = between(robots[first], robots[number])
        if np.hypot(step[0], step[1]) > APART or abs(step[2]) > TURNED:
            pairs.append((first, number))
            first = number
    return pairs[:: max(len(pairs) // PAIRS, 1)]


def _distance(before: LaserScan, after: LaserScan, turn: float, sense: float) -> float:
    """Distance [m] of the points of a scan from those of another, mounted in some way."""
    check()
    mount = np.array(before.mount) + np.array([0.0, 0.0, turn])
    lasers = [compose(np.array(scan.robot), mount) for scan in (before, after)]
    x, y, theta = between(lasers[0], lasers[1])
    here, there = (_points(scan, sense) for scan in (before, after))
    moved = there @ np.array([[np.cos(theta), np.sin(theta)], [-np.sin(theta), np.cos(theta)]])
    return float(np.quantile(cKDTree(here).query(moved + np.array([x, y]))[0], SHARE))


def _points(scan: LaserScan, sense: float) -> Float:
    """Points (n, 2) of a scan in the frame of its laser."""
    hits = np.flatnonzero(scan.hits & (scan.ranges > 0.0))
    hits = hits[:: max(len(hits) // POINTS, 1)]
    return scan.ranges[hits, None] * beam_directions(0.0, sense * scan.angles[hits])
