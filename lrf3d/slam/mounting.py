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
from lrf3d.pose import Pose, between, compose
from lrf3d.slam.motion import size_of

PAIRS, LEAST_PAIRS = 60, 5
"""Most and least pairs of scans that are compared."""

APART, TURNED = 0.4, 0.2
"""Least distance [m] or turn [rad] between the scans of a pair."""

POINTS = 200
"""Points of a scan that are compared: they show its shape."""

CLEARLY, CLOSE = 3.0, 0.03
"""Factor and distance [m] by which pairs must fit better with another mount to name it."""

SHARE = 0.8
"""Quantile of the distances between the points of a pair: walls along the drive fit in any case."""

CONTRADICTED = 0.5
"""Distance of scans [m] that do not fit their poses, however the laser is mounted."""

JUMP, USUAL = 3.0, 10.0
"""Least step of a jump [m], also as a multiple of nearly all steps."""


def doubtful_mount(scans: Sequence[LaserScan], *, mirrored: bool = True) -> str | None:
    """A sentence that says how the laser seems to be mounted; None if it is as declared."""
    own, _, pairs = _paired(scans)
    if len(pairs) < LEAST_PAIRS:
        return None
    mounts = [(turn, sense) for sense in (1, -1)[: 1 + mirrored] for turn in (0, 90, 180, -90)]
    apart = [[_distance(own[a], own[b], *mount) for mount in mounts] for a, b in pairs]
    found = np.median(apart, axis=0)
    best, (declared, *_) = int(found.argmin()), found.tolist()
    if best == 0 or declared < CLEARLY * found[best] + CLOSE:
        return None
    turn, sense = mounts[best]
    seems = [f"turned by {turn}°"] * (turn != 0) + ["mirrored"] * (sense < 0)
    return (
        f"the poses contradict the laser's mount: scans fit each other to {found[best]:.2f} m"
        f" instead of {declared:.2f} m if it is {' and '.join(seems)}; check its transform"
    )


def doubtful_poses(scans: Sequence[LaserScan]) -> str | None:
    """A sentence that says why the poses of scans are hardly those of their robot, or None."""
    own, robots, pairs = _paired(scans)
    steps, several = np.hypot(*np.diff(robots[:, :2], axis=0).T), len(own) > LEAST_PAIRS
    if several and steps.max() > max(JUMP, USUAL * float(np.quantile(steps, 0.95))):
        at = int(steps.argmax()) + 1
        return f"the poses jump by {steps.max():.3g} m at scan {at}; expected one drive, in metres"
    if not pairs and several:
        far = max(_distance(own[0], own[k]) for k in (len(own) // 4, len(own) // 2, -1))
        moved = f"scans of it lie {far:.2g} m apart: they are not those of a robot that moved"
        return f"the poses stay at one place, but {moved}" if far > CONTRADICTED else None
    far = float(np.median([_distance(own[a], own[b]) for a, b in pairs] or [0.0]))
    if len(pairs) < LEAST_PAIRS or far < CONTRADICTED:
        return None
    apart = f"scans near each other lie {far:.2g} m apart"
    return f"the poses contradict the scans: {apart}; are they this robot's, in metres?"


def _paired(scans: Sequence[LaserScan]) -> tuple[list[LaserScan], Float, list[tuple[int, int]]]:
    """Scans of the first laser, its robot's poses (k, 3), and pairs that it moved between."""
    own = [scan for scan in scans if scan.laser == scans[0].laser and scan.hits.any()]
    robots = np.array([scan.robot for scan in own]).reshape(-1, 3)
    pairs, first = list[tuple[int, int]](), 0
    for number in range(1, len(robots)):
        distance, turn = size_of(between(robots[first], robots[number]))
        if distance > APART or turn > TURNED:
            pairs.append((first, number))
            first = number
    return own, robots, pairs[:: max(len(pairs) // PAIRS, 1)]


def _distance(before: LaserScan, after: LaserScan, turn: float = 0.0, sense: int = 1) -> float:
    """Distance [m] of the points of a scan from those of another, with a mount turned by [°]."""
    check()
    mount = np.array(before.mount) + np.array([0.0, 0.0, np.radians(turn)])
    lasers = [compose(np.array(scan.robot), mount) for scan in (before, after)]
    here, there = (_points(scan, sense) for scan in (before, after))
    moved = Pose(*between(*lasers).tolist()).apply(there)
    return float(np.quantile(cKDTree(here).query(moved)[0], SHARE))


def _points(scan: LaserScan, sense: int) -> Float:
    """Points (n, 2) of a scan in the frame of its laser."""
    hits = np.flatnonzero(scan.hits & (scan.ranges > 0.0))
    hits = hits[:: max(len(hits) // POINTS, 1)]
    return scan.ranges[hits, None] * beam_directions(0.0, sense * scan.angles[hits])
