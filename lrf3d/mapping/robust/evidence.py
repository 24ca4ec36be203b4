"""Evidence: which walls the beams hit, and where they violate them by going on behind, compiled.

Enter walls and the beams of scans; leave, for each piece of a wall, how many beams hit it and how
many are free-space violations, or whether any beam has crossed a line.
"""

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int
from lrf3d.laser import RangeNoise
from lrf3d.mapping.robust.beams import Beams, range_deviation
from lrf3d.mapping.robust.constants import (
    CONTINUATION_PENALTY,
    CONTINUATION_STRICTNESS,
    DEEPEST_HIT,
    FREE_DEPTH,
    HIT_DEVIATIONS,
    LEAST_INCIDENCE,
    LINK_END,
)


@inner
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


@compiled
def gather_evidence(
    ends: Float, first: Int, beams: Beams, near: float, noise: RangeNoise, margin: float
) -> tuple[Int, Float]:  # pragma: no cover
    """Count the hits and the free-space violations of each piece of each wall.

    A beam hits the wall that its return lies nearest to, and no other.

    Args:
        ends: (m, 4) walls [m].
        first: (m + 1,) the first piece of each wall.
        beams: The beams.
        near: How far from a wall [m] a return may lie, beside what noise explains.
        noise: The noise of their ranges.
        margin: How much of each wall [m], at either end, only continues what was seen.

    Returns:
        (pieces, 3) numbers of hits, of free-space violations, and of beams that would be hits had
        they not hit another wall more nearly; (pieces, 6) sums over the hits, of their weight,
        times place along the wall, offset from it, and the products of the two.
    """
    counts = np.zeros((first[-1], 3), np.int64)
    least = np.full(len(beams.ranges), np.inf)
    hit_piece = np.full(len(beams.ranges), -1)
    owner = np.full(len(beams.ranges), -1)
    weights = np.zeros(len(beams.ranges))
    for wall in range(len(ends)):
        x1, y1, x2, y2 = ends[wall, 0], ends[wall, 1], ends[wall, 2], ends[wall, 3]
        length = np.hypot(x2 - x1, y2 - y1)
        if length == 0.0:
            continue
        ux, uy = (x2 - x1) / length, (y2 - y1) / length
        pieces = first[wall + 1] - first[wall]
        for scan in range(len(beams.places)):
            ox, oy = beams.places[scan, 0], beams.places[scan, 1]
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
                    deviation = range_deviation(noise, reach)
                    slope = abs(incidence)
                    place = (reach * dx - ax) * ux + (reach * dy - ay) * uy
                    piece = int(place / length * pieces)
                    piece = first[wall] + min(max(piece, 0), pieces - 1)
                    off = near + HIT_DEVIATIONS * deviation * slope
                    away = abs(behind) * slope
                    # What continues a wall lies on its line, and takes what no wall has.
                    continues = place < margin or place > length - margin
                    allowed = CONTINUATION_STRICTNESS * off if continues else off
                    if reading > 0.0 and away <= allowed and abs(behind) < DEEPEST_HIT * allowed:
                        counts[piece, 2] += 1
                        if continues:
                            away += CONTINUATION_PENALTY * off
                        # A wall seen from its back does not end a beam.
                        if aside < 0.0:
                            away += off
                        if away < least[beam]:
                            least[beam] = away
                            hit_piece[beam] = piece
                            owner[beam] = wall
                            weights[beam] = 1.0 / (deviation * max(slope, LEAST_INCIDENCE)) ** 2
                    elif behind > FREE_DEPTH + HIT_DEVIATIONS * deviation:
                        counts[piece, 1] += 1
    sums = np.zeros((first[-1], 6))
    for scan in range(len(beams.places)):
        for beam in range(beams.first[scan], beams.first[scan + 1]):
            if hit_piece[beam] < 0:
                continue
            counts[hit_piece[beam], 0] += 1
            counts[hit_piece[beam], 2] -= 1
            wall = owner[beam]
            x1, y1, x2, y2 = ends[wall, 0], ends[wall, 1], ends[wall, 2], ends[wall, 3]
            length = np.hypot(x2 - x1, y2 - y1)
            ux, uy = (x2 - x1) / length, (y2 - y1) / length
            px = beams.places[scan, 0] + beams.units[beam, 0] * beams.ranges[beam] - x1
            py = beams.places[scan, 1] + beams.units[beam, 1] * beams.ranges[beam] - y1
            along, aside = px * ux + py * uy, py * ux - px * uy
            weight = weights[beam]
            total = sums[hit_piece[beam]]
            total[0] += weight
            total[1] += weight * along
            total[2] += weight * aside
            total[3] += weight * along * along
            total[4] += weight * along * aside
            total[5] += weight * aside * aside
    return counts, sums


@inner
def is_crossed(
    line: Float, beams: Beams, noise: RangeNoise, depth: float, spare: int
) -> bool:  # pragma: no cover
    """Whether more beams than are to spare have crossed a line (4,) by more than a depth [m]."""
    x1, y1, x2, y2 = line
    length = np.hypot(x2 - x1, y2 - y1)
    if length == 0.0:
        return False
    ux, uy = (x2 - x1) / length, (y2 - y1) / length
    end = min(LINK_END, 0.25 * length)
    x1, y1, x2, y2 = x1 + end * ux, y1 + end * uy, x2 - end * ux, y2 - end * uy
    length -= 2.0 * end
    for scan in range(len(beams.places)):
        ox, oy = beams.places[scan, 0], beams.places[scan, 1]
        ax, ay, bx, by = x1 - ox, y1 - oy, x2 - ox, y2 - oy
        aside = ax * uy - ay * ux
        if abs(aside) < 1e-9 or ax * ax + ay * ay > (beams.reaches[scan] + length) ** 2:
            continue
        one = np.arctan2(ay, ax)
        turned = np.arctan2(ax * by - ay * bx, ax * bx + ay * by)
        start = one if turned > 0.0 else one + turned
        for turn in range(2):
            low, high = beams_between(beams, scan, start, abs(turned), turn)
            for beam in range(low, high):
                incidence = beams.units[beam, 0] * uy - beams.units[beam, 1] * ux
                if incidence * aside <= 0.0:
                    continue
                reach = aside / incidence
                deviation = range_deviation(noise, reach)
                if abs(beams.ranges[beam]) - reach > depth + HIT_DEVIATIONS * deviation:
                    spare -= 1
                    if spare < 0:
                        return True
    return False
