"""Refitting: the parts of a wall that are real, and the straight segments that they are made of.

Enter the hits and free-space violations at each piece of the walls; leave new walls. A part is
real where the beams that hit it outweigh those that went through it or hit a nearer wall; it is
split where its points bend by more than a map can be trusted.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int
from lrf3d.mapping.robust.cells import Cells
from lrf3d.mapping.robust.constants import (
    CAME_BEAMS,
    CAME_SCANS,
    CHANGE_COST,
    DUPLICATE_WEIGHT,
    END_SPARE,
    LEAST_SPREAD,
    MAP_DEVIATION,
    OPEN_WEIGHT,
    PIECE,
    SETTLED_AFTER,
    SHORT_WALL,
    TAKEN_TURNS,
    TRANSIENT_WEIGHT,
    TURNS_SHARE,
    UNSEEN_COST,
    VIOLATION_WEIGHT,
    WALL_COST,
)
from lrf3d.mapping.robust.evidence import Round, gather_evidence
from lrf3d.mapping.robust.segment_pool import NewSegments


class Refit(NamedTuple):
    """Walls that are refit in one round of the refinement; see `Round`.

    Args:
        number: Which of the two rounds it is.
        walls: (m,) the numbers of the walls.
        ends: (m, 4) where they are [m].
        farther: How much longer they are followed at both ends [m].
        margin: How much of that only continues what was seen [m].
        near: How far from a wall [m] a return may lie, beside what noise explains.
        least: Walls with fewer hits are left out.
        stamps: (≥ all walls,) the stamp of each wall by its number; is written.
        lost: (≥ all walls,) new evidence of each wall; is written.
    """

    number: int
    walls: Int
    ends: Float
    farther: float
    margin: float
    near: float
    least: int
    stamps: NDArray[np.int32]
    lost: Float


@compiled
def refit_walls(refit: Refit, cells: Cells) -> tuple[NewSegments, Float]:
    """The real parts of walls.

    Returns:
        These parts; and (m, 3) hits, free-space violations and number of parts of each wall.
    """
    count = len(refit.ends)
    ends, first = np.empty((count, 4)), np.zeros(count + 1, np.int64)
    for wall in range(count):
        before = refit.ends[wall]
        dx, dy = before[2] - before[0], before[3] - before[1]
        size = np.hypot(dx, dy)
        dx, dy = refit.farther * dx / size, refit.farther * dy / size
        ends[wall, 0], ends[wall, 1] = before[0] - dx, before[1] - dy
        ends[wall, 2], ends[wall, 3] = before[2] + dx, before[3] + dy
        length = np.hypot(ends[wall, 2] - ends[wall, 0], ends[wall, 3] - ends[wall, 1])
        first[wall + 1] = first[wall] + max(int(np.ceil(length / PIECE)), 1)
    turn = Round(refit.number, refit.walls, ends, first, refit.stamps, refit.lost)
    counts, sums = gather_evidence(turn, cells, refit.near, refit.margin)
    parts, moments, labels = refit_segments(ends, first, counts, sums)
    found, spare, totals = 0, int(refit.margin / PIECE), np.zeros((count, 3))
    hits, parents = np.empty(len(parts), np.int64), np.empty(len(parts), np.int64)
    for part in range(len(parts)):
        length = np.hypot(parts[part, 2] - parts[part, 0], parts[part, 3] - parts[part, 1])
        factor = 2 if length < SHORT_WALL else 1
        # The stretches of the first round may be parts of a long wall.
        if refit.number == 1 and length < SHORT_WALL and labels[part, 3]:
            continue
        if labels[part, 1] >= factor * refit.least and factor * labels[part, 2] <= labels[part, 1]:
            for k in range(4):
                parts[found, k] = parts[part, k]
            for k in range(6):
                moments[found, k] = moments[part, k]
            wall = int(labels[part, 0])
            hits[found], parents[found] = labels[part, 1], refit.walls[wall]
            totals[wall, 2] += 1.0
            found += 1
    for wall in range(count):
        for piece in range(first[wall] + spare, first[wall + 1] - spare):
            totals[wall, 0] += counts[piece, 0]
            totals[wall, 1] += counts[piece, 1]
    new = NewSegments(parts[:found], moments[:found], hits[:found], parents[:found])
    return new, totals


@inner
def violation_weight(counts: Float) -> float:
    """What a free-space violation of a piece weighs against a hit.

    Args:
        counts: (7,) the counts of the piece; see `gather_evidence`.
    """
    hits, violations, scans, between = counts[0], counts[1], counts[3], counts[4]
    if hits == 0.0:
        return OPEN_WEIGHT
    # What moves, or stood for a while, is hit in a few scans one after the other, be they ever so
    # many beams; what beams hit and miss in turns is there.
    if scans == 0.0 or between >= max(TAKEN_TURNS * scans, TURNS_SHARE * violations):
        return VIOLATION_WEIGHT
    # What went through before it came says nothing of what has stood there ever since.
    settled = min(counts[5], hits * violations) if counts[6] >= SETTLED_AFTER else 0.0
    share = 1.0 - settled / max(hits * violations, 1e-9)
    weight: float = max(TRANSIENT_WEIGHT * share * hits / scans, VIOLATION_WEIGHT)
    return weight


@inner
def came_lately(before: float, scans: float, spell: float) -> bool:
    """Whether a place that was free for long has been hit for a short spell only.

    Args:
        before: Beams that went through before the first one hit.
        scans: Scans that hit.
        spell: Scans from the first to the last of these.
    """
    return spell < SETTLED_AFTER and before > max(CAME_BEAMS, CAME_SCANS * scans)


@compiled
def real_pieces(counts: Float) -> Int:
    """Which pieces (n,) of a wall are real, by the cheapest run of states along it.

    A real piece is charged for each of its free-space violations, one that is not for each of its
    hits, and each change from one to the other costs something too.
    """
    count = len(counts)
    # Before the wall, on it, in a gap of it, behind it: where it begins and where it ends is free.
    costs, following = np.empty(4), np.empty(4)
    costs[0], costs[1], costs[2], costs[3] = 0.0, 0.0, np.inf, np.inf
    came = np.zeros((count, 4), np.int64)
    for i in range(count):
        for state in range(4):
            following[state], came[i, state] = costs[state], state
        if costs[0] < following[1]:
            following[1], came[i, 1] = costs[0], 0
        if costs[2] + CHANGE_COST < following[1]:
            following[1], came[i, 1] = costs[2] + CHANGE_COST, 2
        if costs[1] + CHANGE_COST < following[2]:
            following[2], came[i, 2] = costs[1] + CHANGE_COST, 1
        if costs[1] < following[3]:
            following[3], came[i, 3] = costs[1], 1
        hits, violations, nearer = counts[i, 0], counts[i, 1], counts[i, 2]
        weight = violation_weight(counts[i])
        for state in range(4):
            following[state] += hits
        following[1] += weight * violations + DUPLICATE_WEIGHT * nearer + UNSEEN_COST - hits
        costs, following = following, costs
    states = np.zeros(count, np.int64)
    state = 0
    for other in range(1, 4):
        if costs[other] < costs[state]:
            state = other
    for i in range(count - 1, -1, -1):
        states[i] = state == 1
        state = came[i, state]
    return states


@inner
def _misfit(total: Float, first: int, last: int) -> float:
    """The misfit [χ²] of the best line through the pieces between two of running sums (n, 6)."""
    w = total[last, 0] - total[first, 0]
    if w <= 0.0:
        return 0.0
    s = (total[last, 1] - total[first, 1]) / w
    d = (total[last, 2] - total[first, 2]) / w
    ss = (total[last, 3] - total[first, 3]) - w * s * s
    sd = (total[last, 4] - total[first, 4]) - w * s * d
    dd = (total[last, 5] - total[first, 5]) - w * d * d
    if ss > 0.0:
        dd -= sd * sd / ss
    misfit: float = max(dd, 0.0)
    return misfit


@inner
def split_pieces(sums: Float, breaks: Int) -> int:
    """Split pieces (n, 6) of a wall into straight segments: fills in where each ends."""
    count = len(sums)
    total = np.zeros((count + 1, 6))
    for i in range(count):
        w = sums[i, 0]
        # No piece of a map is known better than this, however many beams hit it.
        factor = 1.0 / (1.0 + w * MAP_DEVIATION * MAP_DEVIATION)
        for k in range(6):
            total[i + 1, k] = total[i, k] + factor * sums[i, k]
    if _misfit(total, 0, count) <= WALL_COST:
        # No division gains what a further segment costs.
        breaks[0] = count
        return 1
    best = np.full(count + 1, np.inf)
    best[0] = 0.0
    origin = np.zeros(count + 1, np.int64)
    for last in range(1, count + 1):
        for first in range(last):
            cost = best[first] + WALL_COST + _misfit(total, first, last)
            if cost < best[last]:
                best[last] = cost
                origin[last] = first
    found = 0
    last = count
    while last > 0:
        breaks[found] = last
        found += 1
        last = origin[last]
    for i in range(found // 2):
        breaks[i], breaks[found - 1 - i] = breaks[found - 1 - i], breaks[i]
    return found


@inner
def _end_of_hits(counts: Float, sums: Float, way: float) -> float:
    """Where along a wall [m] the hits of its last piece end, one way (1) or the other (−1).

    The length over which n hits are evenly spread, each in the middle of its part, has a variance
    of (n² − 1)/n² of a twelfth of its square.
    """
    middle = sums[1] / sums[0]
    variance = max(sums[3] / sums[0] - middle * middle, 0.0)
    # One hit shows no length; halved evidence may be less than one.
    hits = max(counts[0], 1.5)
    place: float = middle + way * hits * np.sqrt(3.0 * variance / (hits * hits - 1.0))
    return place


@compiled
def refit_segments(
    ends: Float,
    first: Int,
    counts: Float,
    sums: Float,
) -> tuple[Float, Float, Float]:
    """The real parts of walls (m, 4), refit to their hits.

    Returns:
        (k, 4) their ends [m], (k, 6) their moments, (k, 4) wall, hits, the free-space
        violations by what they weigh [hits], and whether they came lately (1) or not (0).
    """
    parts = np.empty((len(counts), 4))
    moments = np.empty((len(counts), 6))
    labels = np.empty((len(counts), 4))
    breaks = np.empty(len(counts) + 1, np.int64)
    found = 0
    for wall in range(len(ends)):
        low, high = first[wall], first[wall + 1]
        states = real_pieces(counts[low:high])
        pieces = high - low
        x1, y1, x2, y2 = ends[wall, 0], ends[wall, 1], ends[wall, 2], ends[wall, 3]
        length = np.hypot(x2 - x1, y2 - y1)
        ux, uy = (x2 - x1) / length, (y2 - y1) / length
        i = 0
        while i < pieces:
            if not states[i]:
                i += 1
                continue
            begin = i
            while i < pieces and states[i]:
                i += 1
            number = split_pieces(sums[low + begin : low + i], breaks)
            start = begin
            for part in range(number):
                stop = begin + breaks[part]
                hits = violations = before = scans = spell = 0.0
                total = np.zeros(6)
                for k in range(low + start, low + stop):
                    hits += counts[k, 0]
                    before += counts[k, 5]
                    scans += counts[k, 3]
                    spell = max(spell, counts[k, 6])
                    weight = violation_weight(counts[k]) if counts[k, 0] else VIOLATION_WEIGHT
                    violations += weight * counts[k, 1]
                    for column in range(6):
                        total[column] += sums[k, column]
                a, b = start / pieces * length, stop / pieces * length
                # Where a wall ends and does not bend, it ends with its hits.
                if start == begin:
                    seen = begin > 0 and counts[low + begin - 1, 1] > 0.0
                    place = _end_of_hits(counts[low + begin], sums[low + begin], -1.0)
                    a = max(a - PIECE, place if seen else place - END_SPARE)
                if stop == i:
                    seen = i < pieces and counts[low + i, 1] > 0.0
                    place = _end_of_hits(counts[low + i - 1], sums[low + i - 1], 1.0)
                    b = min(b + PIECE, place if seen else place + END_SPARE)
                pieces_of, start = stop - start, stop
                # A part without hits would have cost a wall more.
                w = total[0]
                s, d = total[1] / w, total[2] / w
                ss = max(total[3] - w * s * s, 1e-12)
                sd = total[4] - w * s * d
                dd = max(total[5] - w * d * d, 0.0)
                slope = 0.0
                if ss > w * LEAST_SPREAD:
                    slope = sd / ss
                da, db = d + slope * (a - s), d + slope * (b - s)
                parts[found, 0], parts[found, 1] = x1 + a * ux - da * uy, y1 + a * uy + da * ux
                parts[found, 2], parts[found, 3] = x1 + b * ux - db * uy, y1 + b * uy + db * ux
                moments[found, 0] = w
                moments[found, 1] = x1 + s * ux - d * uy
                moments[found, 2] = y1 + s * uy + d * ux
                moments[found, 3] = ss * ux * ux - 2 * sd * ux * uy + dd * uy * uy
                moments[found, 4] = (ss - dd) * ux * uy + sd * (ux * ux - uy * uy)
                moments[found, 5] = ss * uy * uy + 2 * sd * ux * uy + dd * ux * ux
                labels[found, 0], labels[found, 1], labels[found, 2] = wall, hits, violations
                labels[found, 3] = came_lately(before / max(hits, 1e-9), scans / pieces_of, spell)
                found += 1
    return parts[:found], moments[:found], labels[:found]
