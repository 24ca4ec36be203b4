"""Whether the scans of a drive fit the way in which their laser is said to be mounted.

Scans with the poses of their robot enter; a sentence leaves if pairs of scans fit far better with a
laser that is turned or mirrored.
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

APART, TURNED = 0.15, 0.1
"""The robot moved by at least the first [m] or turned by the second [rad] between two of a pair."""

POINTS = 200
"""Points of a scan that are compared: they show its shape."""

TURNS = (0.0, 0.5 * np.pi, np.pi, -0.5 * np.pi)
"""Turns of a laser on its mount that are compared [rad]."""

CLEARLY, CLOSE = 3.0, 0.03
"""The points of pairs lie this factor nearer to each other if the laser is mounted otherwise, and
this [m]."""


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
    """Median distance [m] of the points of a scan from those of another, mounted in some way."""
    check()
    mount = np.array(before.mount) + np.array([0.0, 0.0, turn])
    lasers = [compose(np.array(scan.robot), mount) for scan in (before, after)]
    x, y, theta = between(lasers[0], lasers[1])
    here, there = (_points(scan, sense) for scan in (before, after))
    moved = there @ np.array([[np.cos(theta), np.sin(theta)], [-np.sin(theta), np.cos(theta)]])
    return float(np.median(cKDTree(here).query(moved + np.array([x, y]))[0]))


def _points(scan: LaserScan, sense: float) -> Float:
    """Points (n, 2) of a scan in the frame of its laser."""
    hits = np.flatnonzero(scan.hits & (scan.ranges > 0.0))
    hits = hits[:: max(len(hits) // POINTS, 1)]
    return scan.ranges[hits, None] * beam_directions(0.0, sense * scan.angles[hits])
