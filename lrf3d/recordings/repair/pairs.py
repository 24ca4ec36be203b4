"""Pairs of scans: how they turn and move from one to the other, and how well they agree.

Scans and the path of their robot enter. The turns between following scans show whether the laser
turns clockwise, how wide its fan is, and how late its stamps are. A repair that such evidence
proposes is tested on pairs from the whole drive, and taken back if they explain each other clearly
worse with it.
"""

from collections.abc import Callable, Sequence

import numpy as np

from lrf3d.base.interrupts import check
from lrf3d.geometry.lines import Float, Int
from lrf3d.geometry.pose import between
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

# Largest number of pairs that are compared; more take longer and decide no better.
MOST_PAIRS = 120

# Least number of pairs that decide: three quick turns of a drive have 14, and show a sweep clearly.
LEAST_COMPARED = 12

# Turn [rad] after which a scan forms a pair with the one before: large enough to show a wrong fan,
# since one that is a third too wide makes this turn wrong by a tenth of a radian.
PAIR_TURN = 0.3

# Largest turn from the first to the second of a pair [rad], so that both see the same walls.
WIDEST = 1.0

# Information of the window in which the second scan of a pair is matched.
INFORMATION = np.asarray(np.linalg.inv(PAIR), dtype=np.float64)

# Number of standard errors from which a difference is clear: correct sweeps reach 4 to 13, a wrong
# fan reached 18.
STANDARD_ERRORS = 3.0

# Minimum inlier ratio of a pair.
LEAST_EXPLAINED = 0.5


def motion_of(
    converter: ScanConverter, pair: Sequence[LaserScan], guess: Float, window: Float
) -> Float | None:
    """Motion (3,) from the first scan of a pair to the second, searched near a guess; or None.

    The covariance of the guess (3, 3) is the window that is searched.
    """
    before, after = (converter.candidate(scan) for scan in pair)
    places = Submap([before], np.zeros((1, 3))).places(after, guess, window)
    for match, _ in places[:1]:
        if match.explained > LEAST_EXPLAINED:
            return np.asarray(match.pose)
    return None


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
        guess = np.array([x[number], y[number], 0.0])
        motion = motion_of(converter, scans[number : number + 2], guess, PAIR)
        if motion is not None:
            turns[number] = motion[2]
    return turns


def pairs_along(poses: Float) -> list[list[int]]:
    """Pairs of scans, at poses (k, 3) all along a drive, between which the robot moved a little."""
    pairs = []
    first = 0
    for number in range(1, len(poses)):
        x, y, turn = np.abs(between(poses[first], poses[number])).tolist()
        if np.hypot(x, y) > MOST_DISTANCE or turn > PAIR_TURN:
            if turn < WIDEST and np.hypot(x, y) < 2.0 * MOST_DISTANCE:
                pairs.append([first, number])
            first = number
    return pairs[:: len(pairs) // MOST_PAIRS + 1]


def explained(
    converter: ScanConverter,
    scan_of: Callable[[int], LaserScan],
    poses: Float,
    pairs: list[list[int]] | Int,
) -> Float:
    """Share (p,) of each pair's second scan that the first explains, matched near poses (k, 3)."""
    shares = []
    for pair in pairs:
        check()
        before, after = (converter.candidate(scan_of(number)) for number in pair)
        step = between(*poses[pair])
        match = Submap([before], np.zeros((1, 3))).match(after, step, INFORMATION)
        shares.append(match.explained if match else 0.0)
    return np.array(shares)


def is_clear(gains: Float) -> bool:
    """Whether the mean of gains (p,) is significantly positive."""
    error = gains.std() / np.sqrt(len(gains) or 1)
    return len(gains) >= LEAST_COMPARED and bool(gains.mean() > STANDARD_ERRORS * error)
