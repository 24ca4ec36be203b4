"""Rays: the path of each beam through the cells, which supports or contradicts their clusters.

The beams of a scan enter; the cells count those that pass. The returns in one cell whose beams had
the same direction are a cluster: those that end enter its moments, those that continue where others
ended contradict it, until it is forgotten. Both are new evidence of the walls.
"""

from typing import Any

import numpy as np

from lrf3d.compiling import borrower, compiled, inner
from lrf3d.geometry.lines import Int
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
    block_at,
    cell_in,
    cell_of,
    take_block,
)
from lrf3d.mapping.robust.walls import Walls, add_point, count_evidence

# A packed cell is its row, shifted by these bits, and its column, counted from −2³¹.
ROW_BITS = 32

# Distances along a beam are integers in units of 2⁻⁵² of its range; and one that no beam reaches.
REACH_BITS = 52
FARTHEST = 1 << 54

# Bits of a packed cell that change when a step leaves a block.
LEAVES = ~((SIDE - 1) + ((SIDE - 1) << ROW_BITS))

# [beams] A cluster with fewer hits is deleted.
LEAST_HITS = 0.5


@inner
def _enter(
    place: tuple[float, float], dx: float, dy: float, scale: float
) -> tuple[int, int, int, int, int, int, int]:
    """Start the traversal of the cells by a ray from a place [m] in a direction (dx, dy).

    Returns its first cell, packed; the steps to the next column and row; the distances between
    columns and between rows; and those to the next column and row. Distances are integers, which
    processors compare and select several times faster than floats.
    """
    px = place[0] / CELL
    py = place[1] / CELL
    column = int(np.floor(px))
    row = int(np.floor(py))
    across = (column + 1.0 - px) if dx > 0.0 else (px - column)
    up = (row + 1.0 - py) if dy > 0.0 else (py - row)
    # A ray along an axis never gets to the next row or column.
    far = float(FARTHEST)
    wide = min(scale / abs(dx), far) if dx != 0.0 else far
    high = min(scale / abs(dy), far) if dy != 0.0 else far
    return (
        (row << ROW_BITS) + column + (1 << 31),
        1 if dx > 0.0 else -1, (1 if dy > 0.0 else -1) << ROW_BITS, int(wide), int(high),
        int(across * wide) if wide < far else FARTHEST, int(up * high) if high < far else FARTHEST,
    )  # fmt: skip


@borrower
def _steps_out(to_next: int, step: int, until: int) -> int:
    """The number of cell edges within a distance: one at `to_next`, the others a step apart."""
    return 0 if to_next > until else (until - to_next) // step + 1


@compiled
def add_beams(
    cells: Cells, begin: int, place: tuple[float, float], beams: Beams, walls: Walls, unowned: Int
) -> int:
    """Add the beams of a scan from a place [m], from one on; returns the first without room.

    The clusters that gained a return but that no wall owns are listed (n,).
    """
    ranges = beams.ranges
    counters = cells.counters[0]
    side = (1 << SQUARE_BITS) - 1
    for beam in range(begin, len(ranges)):
        reading = ranges[beam]
        if reading == 0.0:
            continue
        dx = beams.units[beam, 0]
        dy = beams.units[beam, 1]
        most = int(abs(reading) * (abs(dx) + abs(dy)) / (CELL * SIDE)) + 4
        if counters.blocks + most > len(cells.heads):
            return beam
        if counters.free_cluster == 0 and counters.clusters == len(cells.clusters):
            return beam
        turn = np.arctan2(dy, dx) / (2.0 * np.pi)
        free = (abs(reading) - FREE_DEPTH - HIT_DEVIATIONS * beams.deviations[beam]) / CELL
        way = int(np.floor(turn * PASS_DIRECTIONS + 0.5)) % PASS_DIRECTIONS
        scale = (1 << REACH_BITS) / (abs(reading) / CELL + 2.0)
        cell, right, ahead, wide, high, across, up = _enter(place, dx, dy, scale)
        enters = 0
        exits = min(across, up)
        last = int(2.0 * free * scale)
        # A beam passes a cell if it is free up to the middle of its path through the cell.
        while enters + exits <= last:
            column = (cell & ((1 << ROW_BITS) - 1)) - (1 << 31)
            row = cell >> ROW_BITS
            block = take_block(cells, column, row)
            if block < 0:
                # Nothing was hit around here: on to the next square.
                wide_out = side - (column & side) if right > 0 else column & side
                high_out = side - (row & side) if ahead > 0 else row & side
                enters = min(across + wide_out * wide, up + high_out * high)
                columns = _steps_out(across, wide, enters)
                rows = _steps_out(up, high, enters)
                cell += right * columns + ahead * rows
                across += wide * columns
                up += high * rows
                exits = min(across, up)
                continue
            passes = cells.passes[block, way]
            passed_ways = cells.passed[block]
            inside = cell
            while enters + exits <= last and not (cell ^ inside) & LEAVES:
                at = (((cell >> ROW_BITS) & (SIDE - 1)) << SIDE_BITS) | (cell & (SIDE - 1))
                count = passes[at]
                if count & MOST_PASSES == 0:
                    passed_ways[at] |= np.uint16(1 << way)
                passes[at] = count + (count < MOST_PASSES)
                if count & SOLID:
                    contradict(cells, block, way, at, dx, dy, walls)
                enters = exits
                # Choices instead of a branch, which no processor could predict.
                crosses = across < up
                cell += right if crosses else ahead
                across += wide if crosses else 0
                up += 0 if crosses else high
                exits = min(across, up)
        if reading > 0.0:
            add_hit(cells, place, beams, beam, turn, walls, unowned)
    return len(ranges)


@borrower
def contradict(
    cells: Cells, block: int, way: int, cell: int, dx: float, dy: float, walls: Walls
) -> None:
    """Count a beam that continues through a cell where others ended."""
    if cells.passes[block, way, cell] < SOLID + MOST_PASSES:
        cells.passes[block, way, cell] += 1
    else:
        _forget(cells, block, cell)
    place = cells.heads[block, cell]
    fell = False
    # [beams] A surface is gone when this many beams of a direction in a row have continued where
    # others ended. Less forgets panes and fences, which few beams hit.
    gone_after = 20
    while place > 0:
        weight = OPEN_WEIGHT
        cluster = cells.clusters[place]
        if cluster.last_scan != cells.counters[0].scans and goes_along(cluster, dx, dy):
            cluster.misses += 1
            if cluster.misses >= gone_after:
                # The surface is gone: every few further beams halve the hits that remain.
                cluster.misses -= gone_after // 4
                weight += 0.5 * cluster.hits
                _halve(cluster)
        if walls.rows[cluster.owner].version == cluster.owner_version:
            count_evidence(walls, cluster.owner, weight)
        fell |= cluster.hits < LEAST_HITS
        place = cluster.next
    if fell or cells.heads[block, cell] == 0:
        _delete_few(cells, block, cell)


@borrower
def _delete_few(cells: Cells, block: int, cell: int) -> None:
    """Delete the clusters of a cell with too few hits; without any, its marks go, passes stay."""
    before = 0
    place = cells.heads[block, cell]
    while place > 0:
        after = cells.clusters[place].next
        if cells.clusters[place].hits < LEAST_HITS:
            _give_back(cells, block, cell, before, place)
        else:
            before = place
        place = after
    if before == 0:
        for direction in range(PASS_DIRECTIONS):
            cells.passes[block, direction, cell] &= MOST_PASSES


@borrower
def forget_hits(
    cells: Cells, x: float, y: float, dx: float, dy: float, reach: float, walls: Walls
) -> None:
    """Delete the clusters of a direction around a place [m], within about a reach [m]."""
    first_x, first_y = cell_of(x - reach, y - reach)
    last_x, last_y = cell_of(x + reach, y + reach)
    for cx in range(first_x, last_x + 1):
        for cy in range(first_y, last_y + 1):
            block = block_at(cells, cx, cy)
            cell = cell_in(cx, cy)
            place = cells.heads[block, cell]
            while place > 0:
                cluster = cells.clusters[place]
                along = goes_along(cluster, dx, dy)
                if along and walls.rows[cluster.owner].version == cluster.owner_version:
                    count_evidence(walls, cluster.owner, cluster.hits)
                if along:
                    cluster.hits = 0.0
                place = cluster.next
            _delete_few(cells, block, cell)


@borrower
def goes_along(cluster: Any, dx: float, dy: float) -> bool:
    """Whether a beam has the direction of a cluster."""
    same_way = 0.7  # [cosine] Largest angle between beams of one direction.
    return bool(dx * cluster.toward_x + dy * cluster.toward_y > same_way)


@borrower
def _halve(cluster: Any) -> None:
    """Halve the weight of a cluster; its mean stays."""
    cluster.hits *= 0.5
    cluster.weight *= 0.5
    cluster.xx *= 0.5
    cluster.xy *= 0.5
    cluster.yy *= 0.5
    cluster.scans *= 0.5
    cluster.passes_between *= 0.5


@borrower
def _give_back(cells: Cells, block: int, cell: int, before: int, place: int) -> None:
    """Take a cluster out of the list of its cell; another may precede it."""
    cluster = cells.clusters[place]
    counters = cells.counters[0]
    if before == 0:
        cells.heads[block, cell] = cluster.next
    else:
        cells.clusters[before].next = cluster.next
    cells.clusters[place] = cells.clusters[0]
    cluster.next = counters.free_cluster
    counters.free_cluster = place


@borrower
def _forget(cells: Cells, block: int, cell: int) -> None:
    """Halve the hits and the passes of a cell that has clusters.

    Their ratio stays, and new beams count twice as much as earlier ones.
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
    """Make a cluster for the returns of a direction in a cell."""
    other = cells.heads[block, cell]
    passed = 0.0
    if other == 0:
        for passing in range(PASS_DIRECTIONS):
            passed += cells.passes[block, passing, cell]
            cells.passes[block, passing, cell] |= SOLID
    counters = cells.counters[0]
    first = cells.clusters[other]
    place: int = counters.free_cluster
    if place > 0:
        counters.free_cluster = cells.clusters[place].next
    else:
        place = counters.clusters
        counters.clusters += 1
    cluster = cells.clusters[place]
    cluster.way = way
    cluster.next = other
    cluster.passes_before = first.passes_before if other > 0 else passed
    cluster.first_scan = first.first_scan if other > 0 else counters.scans
    cells.heads[block, cell] = place
    return place


@borrower
def add_hit(
    cells: Cells, place: tuple[float, float], beams: Beams, beam: int, turn: float,
    walls: Walls, unowned: Int,
) -> None:  # fmt: skip
    """Add the return of a beam from a place [m], in a direction [turns], to its cluster."""
    reading = beams.ranges[beam]
    deviation = beams.deviations[beam]
    dx, dy = beams.units[beam]
    x = place[0] + reading * dx
    y = place[1] + reading * dy
    way = int(np.floor(turn * HIT_DIRECTIONS + 0.5)) % HIT_DIRECTIONS
    column, row = cell_of(x, y)
    block = take_block(cells, column, row)
    cell = cell_in(column, row)
    at = cells.heads[block, cell]
    counters = cells.counters[0]
    while at > 0 and cells.clusters[at].way != way:
        at = cells.clusters[at].next
    if at == 0:
        at = _new_cluster(cells, block, cell, way)
    cluster = cells.clusters[at]
    counters.widest = max(counters.widest, deviation)
    # [beams] Above this number of returns in a cluster all counts of its cell are halved.
    most_hits = 255.0
    if cluster.hits >= most_hits:
        _forget(cells, block, cell)
    if cluster.last_scan != counters.scans:
        if cluster.scans > 0.0:
            cluster.passes_between += cluster.misses
        cluster.last_scan = counters.scans
        cluster.scans += 1.0
    cluster.misses = 0
    cluster.hits += 1.0
    add_point(cluster, 1.0 / (deviation * deviation), x, y)
    cluster.toward_x += (dx - cluster.toward_x) / cluster.hits
    cluster.toward_y += (dy - cluster.toward_y) / cluster.hits
    if walls.rows[cluster.owner].version == cluster.owner_version:
        count_evidence(walls, cluster.owner, 1.0)
    else:
        unowned[walls.counters[0].unowned] = at
        walls.counters[0].unowned += 1
