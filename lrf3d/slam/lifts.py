"""Lifts: where a robot was lifted and put down elsewhere, or a recording was cut.

The scans of a solved drive enter, with their poses. The numbers of scans leave that show nothing of
what the scans before them show, though all before agree with each other, as do all after.
"""

from collections.abc import Sequence

import numpy as np

from lrf3d.geometry.lines import Float
from lrf3d.geometry.pose import between
from lrf3d.laser import LaserScan
from lrf3d.matching.key_scans import MOST_THROUGH_PART, ScanConverter, seen_through_both
from lrf3d.recordings.repair.pairs import explained

# Share of points that adjacent scans explain on each side of a lift, and that no two scans explain
# across it: at lifts 0.7 and more, and at most 0.43, also in logs with a scan a metre. Scans of
# which the local map explains as much are not examined.
AGREEING = 0.6


def lifts(
    converter: ScanConverter, scans: Sequence[LaserScan], poses: Float, shares: Float
) -> list[int]:
    """Numbers of the scans (n,) at poses (n, 3) at which a robot was put down elsewhere.

    Shares (n,) are those of the points that were explained as each scan was tracked.
    """
    few = np.flatnonzero(shares[2:-1] < AGREEING) + 2
    return [k for k in few.tolist() if _is_lifted(converter, scans, poses, k)]


def _is_lifted(
    converter: ScanConverter, scans: Sequence[LaserScan], poses: Float, number: int
) -> bool:
    """Whether two scans before a number and two from it on agree, but not across it."""
    before, last, first, after = range(number - 2, number + 2)

    def share(*pair: int) -> float:
        return float(explained(converter, scans.__getitem__, poses, [[*pair]])[0])

    if any(share(*pair) > AGREEING for pair in ((last, first), (before, first), (last, after))):
        return False
    if min(share(before, last), share(first, after)) < AGREEING:
        return False
    one, other = (converter.candidate(scans[k]) for k in (last, first))
    passed, seen = seen_through_both([one], other, between(poses[[last]], poses[first]))
    # A quick turn shows as little of the scan before, but nothing that contradicts it.
    return passed > MOST_THROUGH_PART * seen
