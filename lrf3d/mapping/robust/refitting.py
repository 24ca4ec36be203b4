"""Refitting: the parts of a wall that are real, and the straight segments that they are made of.

Enter the hits and free-space violations at each piece of the walls; leave new walls. A part is
real where the beams that hit it outweigh those that went through it or hit a nearer wall; it is
split where its points bend by more than a map can be trusted.
"""

from typing import Any

import numpy as np

from lrf3d.compiling import borrower, compiled, inner
from lrf3d.geometry import Bool, Float, Int, Records
from lrf3d.mapping.robust.cells import OPEN_WEIGHT, Cells, NewEvidence
from lrf3d.mapping.robust.crossing import end_of, put_line, unit_of
from lrf3d.mapping.robust.evidence import FOLLOWED, PIECE, follow, gather_evidence
from lrf3d.mapping.robust.records import MOMENTS, PIECE_SUMS
from lrf3d.mapping.robust.segmentation import WALL_COST

VIOLATION_WEIGHT = 0.01
"""[hits] What a free-space violation weighs against a hit where both take turns: poses and edges
are a little wrong, and beams miss thin legs, so a wall that one beam in a hundred hit is still more
than nothing. At 0.04 maps of cluttered offices explain 0.5 % less of the returns."""

TRANSIENT_WEIGHT = 0.16
"""[scans] What it weighs against a scan that hit, where hits and violations do not take turns, as
what moves leaves them: it is hit in few scans, from near by many beams of each. More takes what
robots saw only in passing out of maps of offices, less leaves more of the trails of people …"""

TAKEN_TURNS = 0.3
"""[share] … and they take turns where for each scan that hit so many beams went through before the
next one did. More takes legs of furniture out, less keeps more of slow obstacles."""

TURNS_SHARE = 0.1
"""[share] They take turns only if at least this share of the violations came between two scans that
hit, and not before the first or after the last. Without it slow obstacles leave half as many false
walls more; of short walls of furniture one in ten has less."""

SETTLED_AFTER = 30
"""[scans] What was free before, and then was hit by scans so far apart, has come to stay, as a door
that closed: what went through before counts no more. Less keeps the last that was seen of who walks
slowly, more forgets doors for longer …"""

CAME_BEAMS, CAME_SCANS = 8.0, 1.0
"""[beams] … and what is shorter than SHORT_WALL, was hit for less than that, and was gone through
before by more beams than this, and than this for each scan that hit, has not. At 20 beams and 3
more of slow obstacles stays; at 5 and 0.5 a map of an office explains 0.1 % less of its returns."""

DUPLICATE_WEIGHT = 0.2
"""[hits] What a beam weighs that hit another wall more nearly: a second copy of a wall is not
kept."""

END_SPARE = 0.04
"""[m] How far a wall goes on beyond its last hit where no beam went through beyond: about half of
the distance between two beams. More explains more returns at corners, and hides more of what is
seen beside the ends."""

UNSEEN_COST = 0.1
"""[hits] Cost of each piece of wall, so that walls end where their hits do."""

CHANGE_COST = 5.0
"""[hits] Cost of a gap's begin and of its end: less would cut walls for stray beams."""

MAP_DEVIATION = 0.025
"""[m] No piece of a map is known better than this, however many beams hit it: what they share, the
errors of poses, does not average out. Less divides straight walls, more straightens bent ones."""

LEAST_SPREAD = 0.01
"""[m²] Mean square spread of its points along a wall below which a segment keeps the wall's
direction: shorter ones know none."""

SHORT_WALL = 0.5
"""[m] Walls shorter than this need twice min_points hits, and twice the violations' weight of them:
clutter, and what moves, makes short ones of any few returns."""


BEFORE, REAL, GAP, BEHIND = range(4)
"""Where a piece may be: before the wall, on it, in a gap of it, and behind it."""

Parts = tuple[Float, Records, Int, Bool, Float, Int]
"""Parts (n,) of walls, in their order: where they are (n, 4) [m], the moments and numbers of their
points, whether they are enough to be shown, and their hits and weighed violations; and the clusters
(c, 2) that hit any of the walls, with the part that each hit, or −1."""


@compiled
def refit_walls(
    rows: Int, ends: Float, cells: Cells, fresh: NewEvidence, near: float, least: int
) -> Parts:
    """The `Parts` of walls (rows, 4), those of some rows (n,).

    The cells, and the new evidence of all walls, are written. Returns may lie so near [m] to a wall
    beside what noise explains; parts with fewer hits than the least are not shown.
    """
    lines = follow(rows, ends)
    first, count = lines.first, len(rows)
    counts, sums, clusters = gather_evidence(lines, cells, fresh, near)
    parts_of = np.full(first[count], -1)
    most = first[count]
    parts, moments = np.empty((most, 4)), np.empty(most, MOMENTS)
    points, real, evidence = np.empty(most, np.int64), np.empty(most, np.bool_), np.empty(most)
    breaks, spare = np.empty(most + 1, np.int64), int(FOLLOWED / PIECE)
    totals = np.empty(most, PIECE_SUMS)
    found = 0
    for wall in range(count):
        low, high = first[wall], first[wall + 1]
        states = real_pieces(counts[low:high])
        stop = 0
        while stop < high - low:
            if not states[stop]:
                stop += 1
                continue
            begin = stop
            while stop < high - low and states[stop]:
                stop += 1
            number = split_pieces(sums[low + begin : low + stop], breaks)
            for part in range(number):
                start = begin + (breaks[part - 1] if part else 0)
                last = begin + breaks[part]
                totals[found] = sums[low + start]
                for piece in range(low + start + 1, low + last):
                    _add(totals[found], sums[piece], 1.0)
                place_part(
                    lines.ends[wall], counts[low:high], sums[low:high], totals[found],
                    (begin, start, last, stop), parts[found], moments[found],
                )  # fmt: skip
                hits, against, lately = _weigh(counts[low + start : low + last])
                _, _, length = unit_of(parts[found])
                factor = 2 if length < SHORT_WALL else 1
                shown = hits >= factor * least and factor * against <= hits
                real[found] = shown and not (length < SHORT_WALL and lately)
                points[found], evidence[found] = int(hits), hits
                for piece in range(low + start, low + last):
                    evidence[found] += OPEN_WEIGHT * counts[piece].violations
                    parts_of[piece] = found
                # What only continues a wall is a part of it when it is enough by itself.
                if real[found] or (hits >= 1.0 and last > spare and start < high - low - spare):
                    found += 1
                else:
                    for piece in range(low + start, low + last):
                        parts_of[piece] = -1
    for k in range(len(clusters)):
        clusters[k, 1] = parts_of[clusters[k, 1]]
    return (
        parts[:found], moments[:found], points[:found], real[:found], evidence[:found], clusters,
    )  # fmt: skip


@borrower
def _weigh(counts: Records) -> tuple[float, float, bool]:
    """The hits of a part's pieces (n,), what violations weigh, and whether it came lately."""
    hits = against = before = scans = spell = 0.0
    for k in range(len(counts)):
        count = counts[k]
        hits += count.hits
        before += count.passes_before
        scans += count.scans
        spell = max(spell, count.spell)
        weight = violation_weight(count) if count.hits else VIOLATION_WEIGHT
        against += weight * count.violations
    lately = came_lately(before / max(hits, 1e-9), scans / len(counts), spell)
    return hits, against, lately


@borrower
def violation_weight(count: Any) -> float:
    """What a free-space violation weighs against a hit, by the counts of a piece."""
    hits, violations, scans = count.hits, count.violations, count.scans
    if hits == 0.0:
        return OPEN_WEIGHT
    # What moves, or stood for a while, is hit in a few scans one after the other, be they ever so
    # many beams; what beams hit and miss in turns is there.
    if scans == 0.0 or count.passes_between >= max(TAKEN_TURNS * scans, TURNS_SHARE * violations):
        return VIOLATION_WEIGHT
    # What went through before it came says nothing of what has stood there ever since.
    both = hits * violations
    settled = min(count.passes_before, both) if count.spell >= SETTLED_AFTER else 0.0
    share = 1.0 - settled / max(both, 1e-9)
    weight: float = max(TRANSIENT_WEIGHT * share * hits / scans, VIOLATION_WEIGHT)
    return weight


@borrower
def came_lately(before: float, scans: float, spell: float) -> bool:
    """Whether a place that so many beams went through before was hit for a short spell [scans]."""
    return spell < SETTLED_AFTER and before > max(CAME_BEAMS, CAME_SCANS * scans)


@compiled
def real_pieces(counts: Records) -> Int:
    """Which pieces (n,) of a wall are real, by the cheapest run of states along it.

    A real piece is charged for each of its free-space violations, one that is not for each of its
    hits, and each change from one to the other costs something too.
    """
    count = len(counts)
    # Where the wall begins and where it ends is free.
    costs, following = np.zeros(4), np.empty(4)
    costs[GAP] = costs[BEHIND] = np.inf
    came = np.zeros((count, 4), np.int64)
    for i in range(count):
        for state in range(4):
            following[state], came[i, state] = costs[state], state
        if costs[BEFORE] < following[REAL]:
            following[REAL], came[i, REAL] = costs[BEFORE], BEFORE
        if costs[GAP] + CHANGE_COST < following[REAL]:
            following[REAL], came[i, REAL] = costs[GAP] + CHANGE_COST, GAP
        if costs[REAL] + CHANGE_COST < following[GAP]:
            following[GAP], came[i, GAP] = costs[REAL] + CHANGE_COST, REAL
        if costs[REAL] < following[BEHIND]:
            following[BEHIND], came[i, BEHIND] = costs[REAL], REAL
        hits, violations, nearer = counts[i].hits, counts[i].violations, counts[i].nearer
        weight = violation_weight(counts[i])
        for state in range(4):
            following[state] += hits
        following[REAL] += weight * violations + DUPLICATE_WEIGHT * nearer + UNSEEN_COST - hits
        costs, following = following, costs
    states = np.zeros(count, np.int64)
    state = 0
    for other in range(1, 4):
        if costs[other] < costs[state]:
            state = other
    for i in range(count - 1, -1, -1):
        states[i] = state == REAL
        state = came[i, state]
    return states


@borrower
def _misfit(before: Any, after: Any) -> float:
    """The misfit [χ²] of the best line through the pieces between two running sums."""
    w = after.weight - before.weight
    if w <= 0.0:
        return 0.0
    s = (after.along - before.along) / w
    d = (after.aside - before.aside) / w
    ss = (after.along_along - before.along_along) - w * s * s
    sd = (after.along_aside - before.along_aside) - w * s * d
    dd = (after.aside_aside - before.aside_aside) - w * d * d
    if ss > 0.0:
        dd -= sd * sd / ss
    misfit: float = max(dd, 0.0)
    return misfit


@borrower
def _add(total: Any, sums: Any, factor: float) -> None:
    """Add the sums of a piece, times a factor, to a total."""
    total.weight += factor * sums.weight
    total.along += factor * sums.along
    total.aside += factor * sums.aside
    total.along_along += factor * sums.along_along
    total.along_aside += factor * sums.along_aside
    total.aside_aside += factor * sums.aside_aside


@inner
def split_pieces(sums: Records, breaks: Int) -> int:
    """Split pieces (n,) of a wall into straight segments: fills in where each ends."""
    count = len(sums)
    total = np.zeros(count + 1, PIECE_SUMS)
    for i in range(count):
        total[i + 1] = total[i]
        # No piece of a map is known better than this, however many beams hit it.
        _add(total[i + 1], sums[i], 1.0 / (1.0 + sums[i].weight * MAP_DEVIATION * MAP_DEVIATION))
    if _misfit(total[0], total[count]) <= WALL_COST:
        # No division gains what a further segment costs.
        breaks[0] = count
        return 1
    best = np.full(count + 1, np.inf)
    best[0] = 0.0
    origin = np.zeros(count + 1, np.int64)
    for last in range(1, count + 1):
        for first in range(last):
            cost = best[first] + WALL_COST + _misfit(total[first], total[last])
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


@borrower
def _end_of_hits(count: Any, sums: Any, way: float) -> float:
    """Where along a wall [m] the hits of its last piece end, one way (1) or the other (−1).

    The length over which n hits are evenly spread, each in the middle of its part, has a variance
    of (n² − 1)/n² of a twelfth of its square.
    """
    middle = sums.along / sums.weight
    variance = max(sums.along_along / sums.weight - middle * middle, 0.0)
    # One hit shows no length; halved evidence may be less than one.
    hits = max(count.hits, 1.5)
    place: float = middle + way * hits * np.sqrt(3.0 * variance / (hits * hits - 1.0))
    return place


@inner
def place_part(
    ends: Float,
    counts: Records,
    sums: Records,
    total: Any,
    run: tuple[int, int, int, int],
    part: Float,
    moments: Any,
) -> None:
    """Fill in the ends (4,) and the moments of a part of a wall that is followed (4,) [m].

    Counts (n,) and sums (n,) are those of its pieces, and the total is the sum over the part; the
    run is the first piece of a run of real ones, the first of the part, the first behind it, and
    the first behind the run.
    """
    begin, start, stop, end = run
    ux, uy, length = unit_of(ends)
    pieces = len(counts)
    a, b = start / pieces * length, stop / pieces * length
    # Where a wall ends and does not bend, it ends with its hits.
    if start == begin:
        seen = begin > 0 and counts[begin - 1].violations > 0.0
        place = _end_of_hits(counts[begin], sums[begin], -1.0)
        a = max(a - PIECE, place if seen else place - END_SPARE)
    if stop == end:
        seen = end < pieces and counts[end].violations > 0.0
        place = _end_of_hits(counts[end - 1], sums[end - 1], 1.0)
        b = min(b + PIECE, place if seen else place + END_SPARE)
    # A part without hits would have cost a wall more.
    w = total.weight
    s, d = total.along / w, total.aside / w
    ss = max(total.along_along - w * s * s, 1e-12)
    sd = total.along_aside - w * s * d
    dd = max(total.aside_aside - w * d * d, 0.0)
    slope = sd / ss if ss > w * LEAST_SPREAD else 0.0
    da, db = d + slope * (a - s), d + slope * (b - s)
    x, y = end_of(ends, 0)
    put_line(
        part, x + a * ux - da * uy, y + a * uy + da * ux,
        x + b * ux - db * uy, y + b * uy + db * ux,
    )  # fmt: skip
    moments.weight = w
    moments.x = x + s * ux - d * uy
    moments.y = y + s * uy + d * ux
    moments.xx = ss * ux * ux - 2 * sd * ux * uy + dd * uy * uy
    moments.xy = (ss - dd) * ux * uy + sd * (ux * ux - uy * uy)
    moments.yy = ss * uy * uy + 2 * sd * ux * uy + dd * ux * ux
