"""Turns between following scans, as the scans show them.

Scans and the path of their robot enter; turns leave, which show whether the laser turns clockwise,
how wide its fan is, and how late its stamps are.
"""

from collections.abc import Sequence

import numpy as np

from lrf3d.geometry.lines import Float
from lrf3d.laser import LaserScan
from lrf3d.matching.key_scans import ScanConverter
from lrf3d.matching.search import Submap
from lrf3d.recordings.repair.wheel_path import WheelPath

# Largest number of pairs of scans whose turns are computed: those that turn most.
PAIRS = 200

# Least number of pairs from which anything is concluded.
ENOUGH_TURNS = 20

# Least turn of a pair [rad] by odometry; smaller ones drown in its noise.
SHOWN_TURN = 0.01

# Largest distance of a pair [m] by odometry, so that much of one scan shows in the other.
MOST_DISTANCE = 0.5

# Covariance of the window that is searched for the motion of a pair: 0.1 m and 0.2 rad.
PAIR: Float = 0.1**2 * np.diag([1.0, 1.0, 2.0**2])

# Factor by which turns must fit better for another sense of rotation, unit, fan or lag to be used.
CLEARLY = 3.0


def turns_between(
    converter: ScanConverter, scans: Sequence[LaserScan], path: WheelPath, places: Float
) -> Float:
    """Turn (k − 1,) from each of scans (k,) to the next [rad] as they show it; NaN where unknown.

    All headings are searched, not only those near the odometry, which may count headings clockwise
    or in degrees.
    """
    turns = np.full(max(len(places) - 1, 0), np.nan)
    x, y, turn = path.increments(places)[1:].T
    chosen = np.flatnonzero((np.abs(turn) > SHOWN_TURN) & (np.hypot(x, y) < MOST_DISTANCE))
    for number in chosen[np.argsort(-np.abs(turn[chosen]), kind="stable")][:PAIRS].tolist():
        pair = scans[number : number + 2]
        first, following = (converter.candidate(scan) for scan in pair)
        before = Submap([first], np.zeros((1, 3)))
        guess = np.array([x[number], y[number], 0.0])
        for match, _ in before.places(following, guess, PAIR)[:1]:
            if match.explained > 0.5:  # Minimum inlier ratio of a pair.
                *_, turns[number] = match.pose
    return turns
