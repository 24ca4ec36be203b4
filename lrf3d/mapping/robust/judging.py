"""Judging: how each beam of a scan adds to the cells that it goes through, and to the one it hits.

The beams of a scan enter; the cells are written, and so is what is new of the evidence of walls.
"""

from typing import Any

import numpy as np

from lrf3d.compiling import borrower, compiled, inner
from lrf3d.mapping.robust.beams import CELL, Beams
from lrf3d.mapping.robust.cells import (
    FREE_DEPTH,
    HIT_DEVIATIONS,
    HIT_DIRECTIONS,
    MOST_PASSES,
    OPEN_WEIGHT,
    PASS_DIRECTIONS,
    SIDE,
    SIDE_BITS,
    SOLID,
    SQUARE_BITS,
    Cells,
    NewEvidence,
    block_at,
    cell_in,
    take_block,
)

MOST_HITS = 255.0
"""[beams] When more have ended in a cell from one direction, all that is kept of it is halved."""

GONE_AFTER = 20
"""[beams] When so many have gone on where others ended, the same way and without a hit between
them, what stood there is gone. Less forgets panes and fences that one beam in so many hits."""

LEAST_HITS = 0.5
"""[beams] What fewer hits than this are left of is forgotten altogether."""

SAME_WAY = 0.7
"""[cosine] Angle between beams that go the same way."""

ROW_BITS, FIRST_COLUMN = 32, 1 << 31
"""A packed cell is its row, and its column counted from the first below the row's bits."""

REACH_BITS, FARTHEST = 52, 1 << 54
"""A beam's way through the cells is measured in so small parts of its reach; a distance that it
does not get to."""

ROW_MASK = (SIDE - 1) << SIDE_BITS
LEAVES = ~((SIDE - 1) + ((SIDE - 1) << ROW_BITS))
"""The bits of a packed cell that change when a step leaves a block."""


@borrower
def _unpacked(cell: int) -> tuple[int, int]:
    """Column and row of a packed cell."""
    return (cell & ((1 << ROW_BITS) - 1)) - FIRST_COLUMN, cell >> ROW_BITS


@inner
def _enter(
    x: float, y: float, dx: float, dy: float, scale: float
) -> tuple[int, int, int, int, int, int, int]:
    """Where a ray from a place (x, y) [m] in a direction (dx, dy) begins its path through cells.

    Its first cell, packed; what a step to the next column, and row, adds to it; how far it is from
    column to column, and row to row; and how far to the next column, and row. Distances are whole
    numbers: processors compare them, and choose by them, several times faster than floats.
    """
    px, py = x / CELL, y / CELL
    column, row = int(np.floor(px)), int(np.floor(py))
    across = (column + 1.0 - px) if dx > 0.0 else (px - column)
    up = (row + 1.0 - py) if dy > 0.0 else (py - row)
    # A ray along an axis never gets to the next row or column.
    far = float(FARTHEST)
    wide = min(scale / abs(dx), far) if dx != 0.0 else far
    high = min(scale / abs(dy), far) if dy != 0.0 else far
    return (
        (row << ROW_BITS) + column + FIRST_COLUMN,
        1 if dx > 0.0 else -1, (1 if dy > 0.0 else -1) << ROW_BITS, int(wide), int(high),
        int(across * wide) if wide < far else FARTHEST, int(up * high) if high < far else FARTHEST,
    )  # fmt: skip


@borrower
def _steps_out(to_next: int, step: int, until: int) -> int:
    """How many edges lie no farther than a distance, the first so far away, the others a step."""
    return 0 if to_next > until else (until - to_next) // step + 1


@compiled
def add_beams(
    cells: Cells, begin: int, place: tuple[float, float], beams: Beams, fresh: NewEvidence
) -> int:
    """Add the beams of a scan from a place [m], from one on; returns the first without room."""
    x, y = place
    units, ranges, deviations = beams
    passes, passed_ways = cells.passes, cells.passed
    counters = cells.counters[0]
    if begin == 0:
        counters.scans += 1
    side = (1 << SQUARE_BITS) - 1
    for beam in range(begin, len(ranges)):
        reading = ranges[beam]
        if reading == 0.0:
            continue
        dx, dy = units[beam, 0], units[beam, 1]
        most = int(abs(reading) * (abs(dx) + abs(dy)) / (CELL * SIDE)) + 4
        if counters.blocks + most > len(cells.heads):
            return beam
        if counters.free_cluster == 0 and counters.clusters == len(cells.clusters):
            return beam
        turn = np.arctan2(dy, dx) / (2.0 * np.pi)
        free = (abs(reading) - FREE_DEPTH - HIT_DEVIATIONS * deviations[beam]) / CELL
        way = int(np.floor(turn * PASS_DIRECTIONS + 0.5)) % PASS_DIRECTIONS
        scale = (1 << REACH_BITS) / (abs(reading) / CELL + 2.0)
        cell, right, ahead, wide, high, across, up = _enter(x, y, dx, dy, scale)
        entered, left, last = 0, min(across, up), int(2.0 * free * scale)
        block, inside, bit = 0, cell ^ LEAVES, np.uint16(1 << way)
        # The middle of the beam's way through a cell decides.
        while entered + left <= last:
            if (cell ^ inside) & LEAVES:
                column, row = _unpacked(cell)
                block = take_block(cells, column, row)
                if block < 0:
                    # Nothing was hit around here: on to the next square.
                    wide_out = side - (column & side) if right > 0 else column & side
                    high_out = side - (row & side) if ahead > 0 else row & side
                    entered = min(across + wide_out * wide, up + high_out * high)
                    columns = _steps_out(across, wide, entered)
                    rows = _steps_out(up, high, entered)
                    cell += right * columns + ahead * rows
                    across += wide * columns
                    up += high * rows
                    left, inside = min(across, up), cell ^ LEAVES
                    continue
                inside = cell
            at = ((cell >> (ROW_BITS - SIDE_BITS)) & ROW_MASK) | (cell & (SIDE - 1))
            count = passes[block, way, at]
            if count & MOST_PASSES == 0:
                passed_ways[block, at] |= bit
            if count & SOLID:
                _contradict(cells, block, way, at, dx, dy, fresh)
            elif count < MOST_PASSES:
                passes[block, way, at] = count + 1
            entered = left
            # Choices instead of a branch, which no processor could predict.
            crosses = across < up
            cell += right if crosses else ahead
            across += wide if crosses else 0
            up += 0 if crosses else high
            left = min(across, up)
        if reading > 0.0:
            way = int(np.floor(turn * HIT_DIRECTIONS + 0.5)) % HIT_DIRECTIONS
            counters.widest = max(counters.widest, deviations[beam])
            _add_hit(
                cells, x + reading * dx, y + reading * dy, dx, dy, deviations[beam], way, fresh
            )
    return len(ranges)


@borrower
def count_evidence(fresh: NewEvidence, wall: int, weight: float) -> None:
    """Add a beam of a weight [hits] to the new evidence of a wall."""
    row, counters = fresh.walls[wall], fresh.counters[0]
    row.fresh += weight
    if row.last_scan != counters.scan:
        row.last_scan = counters.scan
        fresh.changed[counters.changed] = wall
        counters.changed += 1


@borrower
def _contradict(
    cells: Cells, block: int, way: int, cell: int, dx: float, dy: float, fresh: NewEvidence
) -> None:
    """Count a beam that goes on through a cell where others ended."""
    if cells.passes[block, way, cell] < SOLID + MOST_PASSES:
        cells.passes[block, way, cell] += 1
    else:
        _forget(cells, block, cell)
    before, place = 0, cells.heads[block, cell]
    while place > 0:
        weight, cluster = OPEN_WEIGHT, cells.clusters[place]
        if cluster.last_scan != cells.counters[0].scans and goes_along(cluster, dx, dy):
            cluster.misses += 1
            if cluster.misses >= GONE_AFTER:
                # What beams hit there is gone: each further few halve what is left of it.
                cluster.misses -= GONE_AFTER // 4
                weight += 0.5 * cluster.hits
                _halve(cluster)
        if fresh.walls[cluster.owner].version == cluster.owner_version:
            count_evidence(fresh, cluster.owner, weight)
        after = cluster.next
        if cluster.hits < LEAST_HITS:
            _give_back(cells, block, cell, before, place)
        else:
            before = place
        place = after
    if before == 0:
        _unmark_solid(cells, block, cell)


@borrower
def forget_hits(
    cells: Cells, x: float, y: float, dx: float, dy: float, reach: float, fresh: NewEvidence
) -> None:
    """Forget what beams of a direction hit around a place [m], about as near as a reach [m]."""
    first_x, last_x = int(np.floor((x - reach) / CELL)), int(np.floor((x + reach) / CELL))
    first_y, last_y = int(np.floor((y - reach) / CELL)), int(np.floor((y + reach) / CELL))
    for cx in range(first_x, last_x + 1):
        for cy in range(first_y, last_y + 1):
            block, cell = block_at(cells, cx, cy), cell_in(cx, cy)
            before, place = 0, cells.heads[block, cell]
            while place > 0:
                cluster = cells.clusters[place]
                after = cluster.next
                if goes_along(cluster, dx, dy):
                    if fresh.walls[cluster.owner].version == cluster.owner_version:
                        count_evidence(fresh, cluster.owner, cluster.hits)
                    _give_back(cells, block, cell, before, place)
                else:
                    before = place
                place = after
            if before == 0:
                _unmark_solid(cells, block, cell)


@borrower
def _unmark_solid(cells: Cells, block: int, cell: int) -> None:
    """Where nothing is hit any more no direction is solid; the beams that passed stay counted."""
    for direction in range(PASS_DIRECTIONS):
        cells.passes[block, direction, cell] &= MOST_PASSES


@borrower
def goes_along(cluster: Any, dx: float, dy: float) -> bool:
    """Whether a beam goes the way of those that a cluster is of."""
    return bool(dx * cluster.toward_x + dy * cluster.toward_y > SAME_WAY)


@borrower
def _halve(cluster: Any) -> None:
    """Let what is known of a cluster count half; where it lies stays."""
    cluster.hits *= 0.5
    cluster.weight *= 0.5
    cluster.xx *= 0.5
    cluster.xy *= 0.5
    cluster.yy *= 0.5
    cluster.scans *= 0.5
    cluster.passes_between *= 0.5


@borrower
def _give_back(cells: Cells, block: int, cell: int, before: int, place: int) -> None:
    """Take a cluster out of the list of its cell, where another may be before it."""
    cluster, counters = cells.clusters[place], cells.counters[0]
    if before == 0:
        cells.heads[block, cell] = cluster.next
    else:
        cells.clusters[before].next = cluster.next
    cells.clusters[place] = cells.clusters[0]
    cluster.next, counters.free_cluster = counters.free_cluster, place


@borrower
def _forget(cells: Cells, block: int, cell: int) -> None:
    """Halve the hits and the passes of a cell that has clusters.

    Their proportion stays, and what comes counts twice as much as what was.
    """
    for way in range(PASS_DIRECTIONS):
        passed = cells.passes[block, way, cell]
        cells.passes[block, way, cell] = (passed & SOLID) + ((passed & MOST_PASSES) >> 1)
        if passed & MOST_PASSES == 1:
            cells.passed[block, cell] ^= np.uint16(1 << way)
    place = cells.heads[block, cell]
    while place > 0:
        cluster = cells.clusters[place]
        _halve(cluster)
        cluster.passes_before *= 0.5
        place = cluster.next


@borrower
def _new_cluster(cells: Cells, block: int, cell: int, way: int) -> int:
    """A cluster for the returns that come one way in a cell."""
    other, passed = cells.heads[block, cell], 0.0
    if other == 0:
        for passing in range(PASS_DIRECTIONS):
            passed += cells.passes[block, passing, cell]
            cells.passes[block, passing, cell] |= SOLID
    counters, first = cells.counters[0], cells.clusters[other]
    place: int = counters.free_cluster
    if place > 0:
        counters.free_cluster = cells.clusters[place].next
    else:
        place = counters.clusters
        counters.clusters += 1
    cluster = cells.clusters[place]
    cluster.way, cluster.next = way, other
    cluster.passes_before = first.passes_before if other > 0 else passed
    cluster.first_scan = first.first_scan if other > 0 else counters.scans
    cells.heads[block, cell] = place
    return place


@borrower
def _add_hit(
    cells: Cells,
    x: float,
    y: float,
    dx: float,
    dy: float,
    deviation: float,
    way: int,
    fresh: NewEvidence,
) -> None:
    """Add a return at a place [m] to the moments of its cell."""
    column, row = int(np.floor(x / CELL)), int(np.floor(y / CELL))
    block, cell = take_block(cells, column, row), cell_in(column, row)
    place = cells.heads[block, cell]
    while place > 0 and cells.clusters[place].way != way:
        place = cells.clusters[place].next
    if place == 0:
        place = _new_cluster(cells, block, cell, way)
    cluster, scans = cells.clusters[place], cells.counters[0].scans
    if cluster.hits >= MOST_HITS:
        _forget(cells, block, cell)
    if cluster.last_scan != scans:
        if cluster.scans > 0.0:
            cluster.passes_between += cluster.misses
        cluster.last_scan = scans
        cluster.scans += 1.0
    cluster.misses = 0
    weight = 1.0 / (deviation * deviation)
    cluster.hits += 1.0
    cluster.weight += weight
    share = weight / cluster.weight
    ox, oy = x - cluster.x, y - cluster.y
    cluster.x += share * ox
    cluster.y += share * oy
    spread = weight * (1.0 - share)
    cluster.xx += spread * ox * ox
    cluster.xy += spread * ox * oy
    cluster.yy += spread * oy * oy
    cluster.toward_x += (dx - cluster.toward_x) / cluster.hits
    cluster.toward_y += (dy - cluster.toward_y) / cluster.hits
    if fresh.walls[cluster.owner].version == cluster.owner_version:
        count_evidence(fresh, cluster.owner, 1.0)
    else:
        news = fresh.counters[0]
        fresh.unowned[news.unowned] = place
        news.unowned += 1
