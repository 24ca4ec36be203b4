"""Evidence: which parts of the walls the beams met, and which they passed through, compiled.

Enter walls and the beams of scans; leave, for each wall, how many beams ended on each piece of it
and how many went on behind it.
"""

import numpy as np
from numba import njit

from lrf3d.geometry import Float, Int
from lrf3d.mapping.scan_archive import Beams

PIECE = 0.1
"""Length of a piece of a wall [m]."""

PASSED = 0.2
"""A beam that ends no farther than this [m] behind a wall may have met it."""

STRICT = 0.5
"""How far off a return may lie that makes a wall longer, as a part of what is usual."""

SIGMAS = 3.0
"""How many deviations of its range a return may lie off a wall that it met."""


@njit(cache=True, nogil=True)
def beams_between(
    beams: Beams, scan: int, start: float, span: float, turn: int
) -> tuple[int, int]:  # pragma: no cover
    """The run of a scan's beams with directions in [start, start + span] [rad].

    A direction occurs once or twice in a list of beams that may begin anywhere: turn 0 and 1 give
    the two runs, of which either may be empty.
    """
    first, last = beams.first[scan], beams.first[scan + 1]
    base = beams.angles[first]
    start = base + (start - base) % (2.0 * np.pi) - turn * 2.0 * np.pi
    angles = beams.angles[first:last]
    low = first + np.searchsorted(angles, start)
    high = first + np.searchsorted(angles, start + span, side="right")
    return low, high


@njit(cache=True, nogil=True)
def weigh(
    ends: Float, first: Int, beams: Beams, near: float, floor: float, growth: float, margin: float
) -> tuple[Int, Float]:  # pragma: no cover
    """Count the beams that ended on each piece of each wall, and those that passed.

    A beam ends on the wall that its return lies nearest to, and on no other.

    Args:
        ends: (m, 4) walls [m].
        first: (m + 1,) the first piece of each wall.
        beams: The beams.
        near: How far from a wall [m] a return may lie, beside what noise explains.
        floor: Deviation of a range at no distance [m].
        growth: What a deviation grows by with the range.
        margin: How much of each wall [m], at either end, only continues what was seen.

    Returns:
        (pieces, 3) how many beams ended, how many passed, and how many ended nearer to other walls;
        (pieces, 6) sums over the points where beams ended, of their weight, times place along
        the wall, offset from it, and the products of the two.
    """
    counts = np.zeros((first[-1], 3), np.int64)
    least = np.full(len(beams.ranges), np.inf)
    met = np.full(len(beams.ranges), -1)
    owner = np.full(len(beams.ranges), -1)
    weights = np.zeros(len(beams.ranges))
    for wall in range(len(ends)):
        x1, y1, x2, y2 = ends[wall]
        length = np.hypot(x2 - x1, y2 - y1)
        if length == 0.0:
            continue
        ux, uy = (x2 - x1) / length, (y2 - y1) / length
        pieces = first[wall + 1] - first[wall]
        for scan in range(len(beams.places)):
            ox, oy = beams.places[scan]
            ax, ay, bx, by = x1 - ox, y1 - oy, x2 - ox, y2 - oy
            aside = ax * uy - ay * ux
            if abs(aside) < 1e-9 or abs(aside) > beams.reaches[scan]:
                continue
            one = np.arctan2(ay, ax)
            turned = np.arctan2(ax * by - ay * bx, ax * bx + ay * by)
            start = one if turned > 0.0 else one + turned
            for turn in range(2):
                low, high = beams_between(beams, scan, start, abs(turned), turn)
                for beam in range(low, high):
                    reading = beams.ranges[beam]
                    if reading == 0.0:
                        continue
                    dx, dy = beams.units[beam, 0], beams.units[beam, 1]
                    incidence = dx * uy - dy * ux
                    if incidence * aside <= 0.0:
                        continue
                    reach = aside / incidence
                    behind = abs(reading) - reach
                    deviation = np.sqrt(floor * floor + (growth * reach) ** 2)
                    slope = abs(incidence)
                    place = (reach * dx - ax) * ux + (reach * dy - ay) * uy
                    piece = int(place / length * pieces)
                    piece = first[wall] + min(max(piece, 0), pieces - 1)
                    off = near + SIGMAS * deviation * slope
                    away = abs(behind) * slope
                    # What continues a wall lies on its line, and takes what no wall has.
                    continues = place < margin or place > length - margin
                    allowed = STRICT * off if continues else off
                    if reading > 0.0 and away <= allowed and abs(behind) < 5.0 * allowed:
                        counts[piece, 2] += 1
                        if continues:
                            away += 2.0 * off
                        # A wall seen from its back does not end a beam.
                        if aside < 0.0:
                            away += off
                        if away < least[beam]:
                            least[beam] = away
                            met[beam] = piece
                            owner[beam] = wall
                            weights[beam] = 1.0 / (deviation * max(slope, 0.05)) ** 2
                    elif behind > PASSED + SIGMAS * deviation:
                        counts[piece, 1] += 1
    sums = np.zeros((first[-1], 6))
    for scan in range(len(beams.places)):
        for beam in range(beams.first[scan], beams.first[scan + 1]):
            if met[beam] < 0:
                continue
            counts[met[beam], 0] += 1
            counts[met[beam], 2] -= 1
            wall = owner[beam]
            x1, y1, x2, y2 = ends[wall]
            length = np.hypot(x2 - x1, y2 - y1)
            ux, uy = (x2 - x1) / length, (y2 - y1) / length
            px = beams.places[scan, 0] + beams.units[beam, 0] * beams.ranges[beam] - x1
            py = beams.places[scan, 1] + beams.units[beam, 1] * beams.ranges[beam] - y1
            along, aside = px * ux + py * uy, py * ux - px * uy
            weight = weights[beam]
            total = sums[met[beam]]
            total[0] += weight
            total[1] += weight * along
            total[2] += weight * aside
            total[3] += weight * along * along
            total[4] += weight * along * aside
            total[5] += weight * aside * aside
    return counts, sums
