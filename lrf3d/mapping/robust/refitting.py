"""Refitting: the real parts of a wall, divided into straight segments.

The hits and free-space violations of each piece of the walls enter; new walls leave. A part is real
if the beams that hit it outweigh those that passed through it or hit a nearer wall; it is split
where its points bend by more than the accuracy of a map.
"""

from typing import Any

import numpy as np

from lrf3d.compiling import borrower, compiled, inner
from lrf3d.geometry.lines import TINY, Float, Int, Records
from lrf3d.mapping.robust.beams import CELL
from lrf3d.mapping.robust.cells import OPEN_WEIGHT, Cells
from lrf3d.mapping.robust.extraction import WALL_COST
from lrf3d.mapping.robust.pieces import FOLLOWED, PIECE, follow, gather_evidence
from lrf3d.mapping.robust.walls import FIT, Walls, end_of, length_of, put_line, unit_of

# [hits] Weight of a free-space violation where hits and violations alternate: poses and edges have
# small errors, and beams miss thin legs, so that a wall hit by one beam in a hundred is kept. At
# 0.04 maps of cluttered offices explain 0.5 % less of the returns.
VIOLATION_WEIGHT = 0.01

# [scans] An object that was hit over this many scans is permanent, like a door that closed: earlier
# violations no longer count. Less keeps the last views of slow walkers, more ignores doors for
# longer.
SETTLED_AFTER = 30

# [hits] Cost of each end of a gap: less cuts walls for stray beams.
CHANGE_COST = 5.0

# [m] Walls shorter than this need twice min_points hits, at twice the weight of violations: clutter
# and dynamic obstacles leave short segments.
SHORT_WALL = 0.5


# Where a piece may be: before the wall, on it, in a gap of it, and behind it.
BEFORE, REAL, GAP, BEHIND = range(4)

# [hits] What it costs to go on from each of these to each.
CHANGES = np.array([
    (0.0, 0.0, np.inf, np.inf), (np.inf, 0.0, CHANGE_COST, 0.0),
    (np.inf, CHANGE_COST, 0.0, np.inf), (np.inf, np.inf, np.inf, 0.0),
])  # fmt: skip

# Parts (n,) of walls, in their order: where they are (n, 4) [m], and the :data:`FIT` of each; and
# the clusters (c,) that hit any of the walls, with the part (c,) that each hit, or −1.
Parts = tuple[Float, Records, Int, Int]


@compiled
def refit_walls(rows: Int, walls: Walls, cells: Cells, near: float, least: int) -> Parts:
    """Fit some walls (n,) to the evidence of all beams again; returns their `Parts`.

    The cells, and the new evidence of all walls, are written. Returns within a distance [m] beside
    noise are hits; parts with fewer hits than the least are not shown.
    """
    lines = follow(rows, walls.ends, near, cells.counters[0].clusters)
    claimed = gather_evidence(lines, cells, walls)
    first = lines.first
    most = len(lines.pieces)
    total = np.zeros(1, PIECE)
    parts = np.empty((most, 4))
    fits = np.empty(most, FIT)
    breaks = np.empty(most + 1, np.int64)
    spare = int(FOLLOWED / CELL)
    found = 0
    for wall in range(len(rows)):
        pieces = lines.pieces[first[wall] : first[wall + 1]]
        states = real_pieces(pieces)
        stop = 0
        while stop < len(pieces):
            if not states[stop]:
                stop += 1
                continue
            begin = last = stop
            while stop < len(pieces) and states[stop]:
                stop += 1
            for part in range(split_pieces(pieces[begin:stop], breaks)):
                start = last
                last = begin + breaks[part]
                total[0] = pieces[start]
                for piece in range(start + 1, last):
                    _add(total[0], pieces[piece], 1.0)
                fit = fits[found]
                run = (begin, start, last, stop)
                place_part(lines.ends[wall], pieces, total[0], run, parts[found], fit)
                hits = _weigh(pieces[start:last], length_of(parts[found]), least, fit)
                # A part that only extends a wall needs enough hits of its own.
                own = hits >= 1.0 and last > spare and start < len(pieces) - spare
                kept = fit.shown or own
                found += kept
                for piece in range(start, last if kept else start):
                    pieces[piece].part = found
    owners = np.empty(claimed, np.int64)
    for k in range(claimed):
        cluster = cells.clusters[lines.claimed[k]]
        owners[k] = lines.pieces[cluster.piece - 1].part - 1
        cluster.piece = 0
    return parts[:found], fits[:found], lines.claimed[:claimed], owners


@borrower
def _weigh(pieces: Records, length: float, least: int, fit: Any) -> float:
    """Fill in the evidence of a part by its pieces (n,), and if it is shown; returns its hits."""
    hits = against = before = scans = spell = 0.0
    for k in range(len(pieces)):
        piece = pieces[k]
        hits += piece.hits
        before += piece.passes_before
        scans += piece.scans
        spell = max(spell, piece.spell)
        weight = violation_weight(piece) if piece.hits else VIOLATION_WEIGHT
        against += weight * piece.violations
    passed = before / max(hits, TINY)
    # [beams] A wall shorter than SHORT_WALL that was hit over fewer scans is transient if more
    # beams than this, and than scans with hits, passed before. At 20 more slow obstacles remain; at
    # 5 a map of an office explains 0.1 % less of its returns.
    came_beams = 8.0
    lately = spell < SETTLED_AFTER and passed > max(came_beams, scans / len(pieces))
    factor = 2 if length < SHORT_WALL else 1
    shown = hits >= factor * least and factor * against <= hits
    fit.points = int(hits)
    fit.evidence = hits
    fit.shown = shown and not (length < SHORT_WALL and lately)
    for k in range(len(pieces)):
        fit.evidence += OPEN_WEIGHT * pieces[k].violations
    return hits


@borrower
def violation_weight(count: Any) -> float:
    """The weight of a free-space violation at a piece, in hits."""
    hits = count.hits
    violations = count.violations
    scans = count.scans
    if hits == 0.0:
        return OPEN_WEIGHT
    # [share] Hits and violations alternate if this many beams for each scan with hits passed before
    # the next hit. More removes legs of furniture, less keeps more slow obstacles.
    taken_turns = 0.3
    # [share] They alternate only if at least this share of the violations lies between the first
    # and the last hit. Without it slow obstacles leave half as many false walls more; one in ten
    # short walls of furniture has less.
    turns_share = 0.1
    # A moving object is hit in a few consecutive scans, even if by many beams; a surface that beams
    # hit and miss in turns is permanent.
    if scans == 0.0 or count.passes_between >= max(taken_turns * scans, turns_share * violations):
        return VIOLATION_WEIGHT
    # Beams that passed before an object came do not contradict it after it has settled.
    both = hits * violations
    settled = min(count.passes_before, both) if count.spell >= SETTLED_AFTER else 0.0
    share = 1.0 - settled / max(both, TINY)
    # [scans] Weight of a violation against a scan with hits where they do not alternate, as at a
    # moving object, which few scans hit with many beams each. More removes what robots saw only in
    # passing from maps of offices, less leaves more trails of people.
    transient_weight = 0.16
    weight: float = max(transient_weight * share * hits / scans, VIOLATION_WEIGHT)
    return weight


@compiled
def real_pieces(counts: Records) -> Int:
    """Which pieces (n,) of a wall are real, by the cheapest sequence of states along it.

    A real piece costs its free-space violations, another one its hits, and each change of state
    costs something, too.
    """
    count = len(counts)
    # Where the wall begins and where it ends is free.
    costs = np.zeros(4)
    following = np.empty(4)
    costs[GAP] = costs[BEHIND] = np.inf
    came = np.zeros((count, 4), np.int64)
    # [hits] Weight of a beam that hit a nearer wall, against a second copy of a wall.
    duplicate_weight = 0.2
    unseen_cost = 0.1  # [hits] Cost of each piece of wall, so that walls end at their hits.
    for i in range(count):
        for state in range(4):
            following[state] = costs[state]
            came[i, state] = state
            for other in range(4):
                cost = costs[other] + CHANGES[other, state]
                if cost < following[state]:
                    following[state] = cost
                    came[i, state] = other
            following[state] += counts[i].hits
        piece = counts[i]
        against = violation_weight(piece) * piece.violations + duplicate_weight * piece.nearer
        following[REAL] += against + unseen_cost - piece.hits
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
def _add(total: Any, piece: Any, factor: float) -> None:
    """Add the weighted sums of a piece, times a factor, to a total."""
    total.weight += factor * piece.weight
    total.along += factor * piece.along
    total.aside += factor * piece.aside
    total.along_along += factor * piece.along_along
    total.along_aside += factor * piece.along_aside
    total.aside_aside += factor * piece.aside_aside


@inner
def split_pieces(pieces: Records, breaks: Int) -> int:
    """Split pieces (n,) of a wall into straight segments: fills in their ends, returns how many."""
    count = len(pieces)
    total = np.zeros(count + 1, PIECE)
    # [m] Least standard deviation of a piece of a map: errors of poses are shared by beams and do
    # not average out. Less divides straight walls, more straightens bent ones.
    map_deviation = 0.025
    for i in range(count):
        total[i + 1] = total[i]
        # Poses limit the accuracy of a piece, however many beams hit it.
        _add(total[i + 1], pieces[i], 1.0 / (1.0 + pieces[i].weight * map_deviation**2))
    if _misfit(total[0], total[count]) <= WALL_COST:
        # No split pays for a further segment.
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
        found = found + 1
        last = origin[last]
    last = count
    for part in range(found - 1, -1, -1):
        breaks[part] = last
        last = origin[last]
    return found


@borrower
def _end_of_hits(piece: Any, way: float) -> float:
    """Where along a wall [m] the hits of its last piece end, forwards (1) or backwards (−1).

    The length over which n hits are evenly spread has a variance of (n² − 1)/n² of a twelfth of its
    square.
    """
    middle = piece.along / piece.weight
    variance = max(piece.along_along / piece.weight - middle * middle, 0.0)
    # One hit shows no length; halved evidence may be less than one.
    hits = max(piece.hits, 1.5)
    place: float = middle + way * hits * np.sqrt(3.0 * variance / (hits * hits - 1.0))
    return place


@inner
def place_part(
    ends: Float, pieces: Records, total: Any, run: tuple[int, int, int, int], part: Float, fit: Any
) -> None:
    """Fill in the ends (4,) and the moments of a part of a wall with extended ends (4,) [m].

    The total is the sum over its pieces. The run is the first piece of a run of real ones, the
    first of the part, the first behind the part, and the first behind the run.
    """
    begin, start, stop, end = run
    ux, uy, length = unit_of(ends)
    count = len(pieces)
    a = start / count * length
    b = stop / count * length
    # [m] Extension of a wall beyond its last hit where no beam passed: half of the spacing of
    # beams. More explains more returns at corners, and hides more behind the ends.
    end_spare = 0.04
    # An end that is no bend lies at the outermost hit.
    if start == begin:
        seen = begin > 0 and pieces[begin - 1].violations > 0.0
        place = _end_of_hits(pieces[begin], -1.0)
        a = max(a - CELL, place if seen else place - end_spare)
    if stop == end:
        seen = end < count and pieces[end].violations > 0.0
        place = _end_of_hits(pieces[end - 1], 1.0)
        b = min(b + CELL, place if seen else place + end_spare)
    # A part without hits would have cost a wall more.
    w = total.weight
    s = total.along / w
    d = total.aside / w
    ss = max(total.along_along - w * s * s, 1e-12)
    sd = total.along_aside - w * s * d
    dd = max(total.aside_aside - w * d * d, 0.0)
    # [m²] Least mean square spread of points along a segment that determines its direction; shorter
    # segments keep that of the wall.
    least_spread = 0.01
    slope = sd / ss if ss > w * least_spread else 0.0
    da = d + slope * (a - s)
    db = d + slope * (b - s)
    x, y = end_of(ends, 0)
    put_line(
        part, x + a * ux - da * uy, y + a * uy + da * ux,
        x + b * ux - db * uy, y + b * uy + db * ux,
    )  # fmt: skip
    fit.weight = w
    fit.x = x + s * ux - d * uy
    fit.y = y + s * uy + d * ux
    fit.xx = ss * ux * ux - 2 * sd * ux * uy + dd * uy * uy
    fit.xy = (ss - dd) * ux * uy + sd * (ux * ux - uy * uy)
    fit.yy = ss * uy * uy + 2 * sd * ux * uy + dd * ux * ux
