"""Sweeps: recorded scans whose beams went out one after the other, which their log does not say.

Scans and the path by odometry enter; scans with the motion of the robot during each leave, if they
agree better so.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lrf3d.base.interrupts import check
from lrf3d.geometry.lines import Float, usual_step
from lrf3d.geometry.pose import between
from lrf3d.laser import LaserScan
from lrf3d.laser.unrolling import unrolled
from lrf3d.matching.key_scans import ScanConverter
from lrf3d.matching.search import Submap
from lrf3d.recordings.repair.odometry import LEAST_PAIRS, MOST_DISTANCE, PAIR, WheelPath


def swept(
    converter: ScanConverter, scans: Sequence[LaserScan], path: WheelPath, places: Float
) -> list[LaserScan]:
    """Scans (k,), at places along the path, with the motion during each; empty if none is shown.

    A laser whose mirror turns once for each scan shows bent walls while its robot turns. Of two
    scans at different rates of turn more agrees once both are unrolled, and less if they are
    unrolled the other way round.
    """
    interval = usual_step(np.array([scan.time for scan in scans]))
    longest = 0.25  # Turn of a mirror [s]: slower lasers are those that are turned as a whole.
    known = any(scan.time_increment or scan.motion is not None for scan in scans)
    pairs = _uneven_pairs(path.at(places))
    if known or not 0.0 < interval <= longest or len(pairs) < LEAST_PAIRS:
        return []
    lines = usual_step(places)

    def rolled(number: int, sense: int) -> LaserScan:
        scan = scans[number]
        share = float(abs(scan.angles[-1] - scan.angles[0])) / (2.0 * np.pi)
        step = np.array([0.0, sense * share * lines])
        increment = share * interval / max(len(scan.ranges) - 1, 1)
        motion = between(*path.at(places[number] + step))
        return replace(scan, motion=motion, time_increment=increment) if sense else scan

    def agreement(sense: int) -> Float:
        """How much of the second of each pair the first explains."""
        explained = []
        for pair in pairs:
            check()
            before, after = (converter.candidate(unrolled(rolled(k, sense))) for k in pair)
            step = between(*path.at(places[pair]))
            match = Submap([before], np.zeros((1, 3))).match(after, step, np.linalg.inv(PAIR))
            explained.append(match.explained if match else 0.0)
        return np.array(explained)

    still = agreement(0)
    gains = {sense: agreement(sense) - still for sense in (1, -1)}
    sense = max(gains, key=lambda sense: float(gains[sense].mean()))
    gain = gains[sense]
    loss = -gains[-sense]
    # Standard errors that gain and loss must reach: of lasers that turn 4 to 9 and 4 to 13.
    sure = 3.0 / np.sqrt(len(pairs))
    if gain.mean() < sure * gain.std() or loss.mean() < sure * loss.std():
        return []
    return [rolled(number, sense) for number in range(len(scans))]


def _uneven_pairs(poses: Float) -> list[list[int]]:
    """Pairs of scans, at poses (k, 3) near each other, of a robot that turned at other rates."""
    # Scans from one to the other, and least difference of their turns from scan to scan and largest
    # turn between them [rad].
    apart = 4
    least = 0.03
    widest = 1.0
    most_pairs = 120
    rates = np.gradient(poses[:, 2])
    x, y, turn = (poses[apart:] - poses[:-apart]).T
    change = np.abs(rates[apart:] - rates[:-apart])
    near = (np.hypot(x, y) < MOST_DISTANCE) & (np.abs(turn) < widest) & (change > least)
    first = np.flatnonzero(near)
    first = first[np.argsort(-change[first], kind="stable")[:most_pairs]]
    pairs: list[list[int]] = np.column_stack([first, first + apart]).tolist()
    return pairs
