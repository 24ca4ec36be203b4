"""Judging a repair: how well the scans of a whole drive explain each other with and without it.

A repair is proposed by local evidence, such as turns that are too small. It is then tested on pairs
of scans from the whole drive, and taken back if they explain each other clearly worse with it.
"""

from collections.abc import Callable

import numpy as np

from lrf3d.base.interrupts import check
from lrf3d.geometry.lines import Float, Int
from lrf3d.geometry.pose import between
from lrf3d.laser import LaserScan
from lrf3d.matching.key_scans import ScanConverter
from lrf3d.matching.search import Submap
from lrf3d.recordings.repair.turns import MOST_DISTANCE, PAIR

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
