"""Refinement: every scan is matched once more, with all key scans around it in their final places.

While the robot drove, a scan was matched with what lay just behind it. Now its surroundings are
known from all drives past it, which are better than any one of them.
"""

from collections.abc import Sequence

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserScan
from lrf3d.slam.frames import between, compose, turned
from lrf3d.slam.resolution import Resolution
from lrf3d.slam.scan_matching import match_scan
from lrf3d.slam.surface import surface_of_scan, wall_map
from lrf3d.slam.violation import Key

PRIOR = np.diag([2500.0, 2500.0, 10000.0])
"""Information of where a scan stood before: 0.02 m and 0.01 rad."""

ITERATIONS, REACH = 8, 0.3
"""Most Gauss-Newton steps, and how far off walls are looked for [m]."""

DOUBTFUL = 0.03
"""Where a scan is farther than this [m], [rad] from where its wheels have it, both are tried."""

LEAST_EXPLAINED = 0.3
"""A scan that explains less than this share of its points stays where it is."""


def refined(
    scans: Sequence[LaserScan],
    poses: Float,
    motions: Float,
    keys: Sequence[Key],
    key_poses: Float,
    anchored: Int,
) -> Float:
    """Poses (n, 3) of all scans, matched with the key scans around them.

    Args:
        scans: The scans (n,).
        poses: (n, 3) where they are believed to be.
        motions: (n, 3) how the robot moved to each of them from the one before by its wheels.
        keys: The key scans (k,).
        key_poses: (k, 3) their poses.
        anchored: (m,) rising numbers of scans, from 0: key scans, and those in known places. Each
            scan is matched with what lies around the last of them.

    Raises:
        InputError: There are not as many scans as poses.
    """
    if len(scans) != len(poses):
        raise InputError(f"slam: {len(scans)} scans to refine; expected all {len(poses)}")
    refined_poses = poses.copy()
    if not len(scans):
        return refined_poses
    resolution = Resolution.of(scans[0].angles)
    ends = np.append(anchored[1:], len(scans))
    for first, end in zip(anchored.tolist(), ends.tolist(), strict=True):
        apart = np.hypot(*(key_poses[:, :2] - poses[first, :2]).T)
        nearest = np.argsort(apart, kind="stable")[: resolution.around]
        grid = wall_map(((keys[k].walls, key_poses[k]) for k in nearest.tolist()), resolution.along)
        if grid is None:
            continue
        for scan in range(first, end):
            guesses = [poses[scan]]
            if scan:
                # The front end may have followed a person; the wheels do not.
                driven = compose(refined_poses[scan - 1], motions[scan])
                off = np.abs(between(driven, poses[scan])).max()
                guesses += [driven] if off > DOUBTFUL else []
            surface = surface_of_scan(scans[scan], keys[0].laser, sparse=resolution.sparse)
            prior = turned(PRIOR, float(poses[scan, 2]))
            matches = [
                match_scan(surface, grid, guess, prior, ITERATIONS, REACH, resolution.sigma)
                for guess in guesses
            ]
            match = max(matches, key=lambda match: match.explained)
            if match.explained > LEAST_EXPLAINED:
                refined_poses[scan] = match.pose
    return refined_poses
