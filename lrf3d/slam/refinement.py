"""Refinement: every scan is matched once more, with all key scans around it in their final places.

While the robot drove, a scan was matched with what lay just behind it. Now its surroundings are
known from all drives past it, which are better than any one of them.
"""

from collections.abc import Sequence

import numpy as np

from lrf3d.geometry import Float, Int
from lrf3d.slam.frames import between, compose, turned
from lrf3d.slam.scan_matching import match_scan
from lrf3d.slam.surface import wall_map
from lrf3d.slam.violation import Key

PRIOR = np.diag([2500.0, 2500.0, 10000.0])
"""Information of where a scan stood before: 0.02 m and 0.01 rad."""

ITERATIONS = 8
"""Most Gauss-Newton steps."""

AROUND = 8
"""Key scans that a scan is matched with. With twice as many it takes twice the time, and the mean
error moves by a hundredth."""

DOUBTFUL = 0.03
"""Where a scan is farther than this [m], [rad] from where its wheels have it, seen from the scan
before it or after it, that place is tried, too."""

LEAST_EXPLAINED = 0.3
"""A scan that explains less than this share of its points stays where it is."""


def refined(
    surfaces: Sequence[Float],
    poses: Float,
    motions: Float,
    keys: Sequence[Key],
    key_poses: Float,
    anchored: Int,
) -> Float:
    """Poses (n, 3) of all scans, matched with the key scans around them.

    Args:
        surfaces: (n,) what the scans saw, (m, 4) each.
        poses: (n, 3) where they are believed to be.
        motions: (n, 3) how the robot moved to each of them from the one before by its wheels.
        keys: The key scans (k,).
        key_poses: (k, 3) their poses.
        anchored: (m,) rising numbers of scans, from 0: key scans, and those in known places. Each
            scan is matched with what lies around the last of them.
    """
    refined_poses = poses.copy()
    if not len(surfaces):
        return refined_poses
    ends = np.append(anchored[1:], len(surfaces))
    for first, end in zip(anchored.tolist(), ends.tolist(), strict=True):
        apart = np.hypot(*(key_poses[:, :2] - poses[first, :2]).T)
        nearest = np.argsort(apart, kind="stable")[:AROUND]
        grid = wall_map((keys[k].walls, key_poses[k]) for k in nearest.tolist())
        if grid is None:
            continue
        for scan in range(first, end):
            guesses = [poses[scan]]
            # A scan may have been turned alone, or have followed a person; the wheels do not.
            if scan:
                guesses.append(compose(refined_poses[scan - 1], motions[scan]))
            if scan + 1 < len(poses):
                back = between(motions[scan + 1], np.zeros(3))
                guesses.append(compose(poses[scan + 1], back))
            prior = turned(PRIOR, float(poses[scan, 2]))
            matches = [
                match_scan(surfaces[scan], grid, guess, prior, ITERATIONS)
                for number, guess in enumerate(guesses)
                if not number or np.abs(between(guess, poses[scan])).max() > DOUBTFUL
            ]
            match = max(matches, key=lambda match: match.explained)
            if match.explained > LEAST_EXPLAINED:
                refined_poses[scan] = match.pose
    return refined_poses
