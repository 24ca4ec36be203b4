"""EvidenceGrid: what all beams have shown of the ground, in cells, each beam judged once.

A return adds to the moments of the returns in its cell that came the same way; each cell that a
beam goes through counts it as a pass, by the beam's direction. What is kept grows with the ground
that was seen and not with the number of scans, and sums do not depend on the order of the scans.
The cells stand in blocks, which a hash table finds.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int
from lrf3d.mapping.robust.beams import Beams
from lrf3d.mapping.robust.blocks import (
    SIDE,
    SIDE_BITS,
    Blocks,
    block_at,
    enter_cells,
    rehashed,
    take_open,
    take_solid,
)
from lrf3d.mapping.robust.constants import (
    CELL,
    FREE_DEPTH,
    GONE_AFTER,
    HIT_DEVIATIONS,
    HIT_DIRECTIONS,
    LEAST_HITS,
    MOST_HITS,
    MOST_PASSES,
    OPEN_WEIGHT,
    PASS_DIRECTIONS,
    SAME_WAY,
)

Number = TypeVar("Number", bound=np.generic)

SOLID = np.uint8(128)
"""Bit of the numbers of passes of a cell in which beams ended."""

LEAST_BLOCKS, LEAST_CLUSTERS = 256, 4096
"""How much a new grid has room for."""


class Cells(NamedTuple):
    """The cells, as compiled code takes them.

    Args:
        open: The blocks of cells that beams went through.
        passes: (blocks, directions × cells) numbers of beams that went through each.
        solid: The blocks of cells that beams ended in.
        heads: (blocks, cells) the first cluster of returns in each cell, −1 where there is none.
        following: (clusters,) the next of the same cell, or of those given back; −1 at the end.
        ways: (clusters,) which way its beams came.
        moments: (clusters, 10) number of returns, weight 1/variance [1/m²] of their ranges, mean
            x, y [m], scatter xx, xy, yy about it, mean direction x, y of the beams, and number of
            scans that they are from.
        seen: (clusters,) the last of these scans.
        owners: (clusters, 2) the wall that each hit, in the first round of the refinement and in
            the second; −1 where none.
        claims: (clusters, 2) the owner's stamp when it took the cluster, which is free where the
            owner has another stamp by now.
        apart: (clusters, 2) how far each lies off its owner [m].
        misses: (clusters,) beams that went on the way that its beams came, since the last hit.
        used: (3,) clusters that were taken, the first that was given back, and scans.
        widest: (1,) greatest deviation [m] of a return.
    """

    open: Blocks
    passes: NDArray[np.uint8]
    solid: Blocks
    heads: NDArray[np.int32]
    following: NDArray[np.int32]
    ways: NDArray[np.int8]
    moments: Float
    seen: NDArray[np.int32]
    owners: NDArray[np.int32]
    claims: NDArray[np.int32]
    apart: Float
    misses: NDArray[np.int32]
    used: Int
    widest: Float


class News(NamedTuple):
    """What the beams of a scan are news for.

    Args:
        stamps: (walls,) the stamp of each wall.
        counts: (walls,) what is new of each wall since it was refit [hits].
        walls: (walls,) the walls with news, each once.
        told: (walls,) the last scan that was news for each wall.
        loose: (≥ beams,) clusters that are hits of no wall and grew.
        numbers: (3,) how many walls and clusters, and the number of the scan.
    """

    stamps: NDArray[np.int32]
    counts: Float
    walls: Int
    told: Int
    loose: Int
    numbers: Int

    @classmethod
    def of_no_walls(cls, beams: int) -> "News":
        """The news of a scan where there are no walls."""
        none = np.zeros(0, np.int64)
        return cls(
            np.zeros(0, np.int32), np.zeros(0), none, none, np.empty(beams, np.int64),
            np.zeros(3, np.int64),
        )  # fmt: skip


@compiled
def add_beams(
    cells: Cells, x: float, y: float, units: Float, ranges: Float, deviations: Float, news: News
) -> None:  # pragma: no cover
    """Add the beams of a scan from a place [m]; there is room for all that they bring.

    Args:
        cells: The cells; are written.
        x: Where the laser is [m].
        y: Where the laser is [m].
        units: (n, 2) unit vectors of the beams.
        ranges: (n,) ranges [m]; where nothing returned, minus the range that is free.
        deviations: (n,) standard deviations of the places where they end [m].
        news: Is written.
    """
    mask = SIDE - 1
    blocks, passes = cells.open, cells.passes
    cells.used[2] += 1
    for beam in range(len(ranges)):
        reading = ranges[beam]
        if reading == 0.0:
            continue
        dx, dy = units[beam, 0], units[beam, 1]
        turn = np.arctan2(dy, dx) / (2.0 * np.pi)
        free = (abs(reading) - FREE_DEPTH - HIT_DEVIATIONS * deviations[beam]) / CELL
        way = int(np.floor(turn * PASS_DIRECTIONS + 0.5)) % PASS_DIRECTIONS
        # A beam stays in the plane of its direction, so that what it counts lies together.
        plane = way * SIDE * SIDE
        column, row, right, ahead, wide, high, across, up = enter_cells(x, y, dx, dy, CELL)
        entered = 0.0
        block, at_x, at_y = -1, 1 << 40, 0
        while True:
            left = min(across, up)
            # The middle of the beam's way through the cell decides.
            if 0.5 * (entered + left) > free:
                break
            if column >> SIDE_BITS != at_x or row >> SIDE_BITS != at_y:
                at_x, at_y = column >> SIDE_BITS, row >> SIDE_BITS
                block = block_at(blocks, at_x, at_y)
            if block >= 0:
                place = plane + ((row & mask) << SIDE_BITS) + (column & mask)
                passed = passes[block, place]
                if passed & SOLID:
                    _contradict(cells, block, place, column, row, dx, dy, news)
                elif passed < MOST_PASSES:
                    passes[block, place] = passed + 1
            entered = left
            if across < up:
                column += right
                across += wide
            else:
                row += ahead
                up += high
        if reading > 0.0:
            way = int(np.floor(turn * HIT_DIRECTIONS + 0.5)) % HIT_DIRECTIONS
            cells.widest[0] = max(cells.widest[0], deviations[beam])
            _add_hit(cells, x + reading * dx, y + reading * dy, dx, dy, deviations[beam], way, news)


@inner
def note(news: News, wall: int, weight: float) -> None:  # pragma: no cover
    """Note that a beam is news for a wall, of a weight [hits]."""
    news.counts[wall] += weight
    if news.told[wall] != news.numbers[2]:
        news.told[wall] = news.numbers[2]
        news.walls[news.numbers[0]] = wall
        news.numbers[0] += 1


@inner
def _contradict(
    cells: Cells,
    block: int,
    place: int,
    column: int,
    row: int,
    dx: float,
    dy: float,
    news: News,
) -> None:  # pragma: no cover
    """Count a beam that goes on through a cell where others ended."""
    if cells.passes[block, place] < SOLID + MOST_PASSES:
        cells.passes[block, place] += 1
    else:
        _forget(cells, column, row)
    solid = block_at(cells.solid, column >> SIDE_BITS, row >> SIDE_BITS)
    if solid < 0:
        return
    cell = ((row & (SIDE - 1)) << SIDE_BITS) + (column & (SIDE - 1))
    moments, misses = cells.moments, cells.misses
    before, cluster = -1, cells.heads[solid, cell]
    while cluster >= 0:
        weight = OPEN_WEIGHT
        if cells.seen[cluster] != cells.used[2] and (
            dx * moments[cluster, 7] + dy * moments[cluster, 8] > SAME_WAY
        ):
            misses[cluster] += 1
            if misses[cluster] >= GONE_AFTER:
                # What beams hit there is gone: each further few halve what is left of it.
                misses[cluster] -= GONE_AFTER // 4
                weight += 0.5 * moments[cluster, 0]
                for k in (0, 1, 4, 5, 6, 9, 10):
                    moments[cluster, k] *= 0.5
        owner = cells.owners[cluster, 0]
        if owner >= 0 and news.stamps[owner] == cells.claims[cluster, 0]:
            note(news, owner, weight)
        after = cells.following[cluster]
        if moments[cluster, 0] < LEAST_HITS:
            _give_back(cells, solid, cell, before, cluster)
        else:
            before = cluster
        cluster = after
    if before < 0:
        for way in range(PASS_DIRECTIONS):
            cells.passes[block, way * SIDE * SIDE + cell] &= MOST_PASSES


@inner
def _give_back(
    cells: Cells, solid: int, cell: int, before: int, cluster: int
) -> None:  # pragma: no cover
    """Take a cluster out of the list of its cell, where another may be before it."""
    after = cells.following[cluster]
    if before < 0:
        cells.heads[solid, cell] = after
    else:
        cells.following[before] = after
    cells.following[cluster] = cells.used[1]
    cells.used[1] = cluster
    cells.misses[cluster] = 0
    for k in range(2):
        cells.owners[cluster, k] = -1
    cells.seen[cluster] = 0
    for k in range(11):
        cells.moments[cluster, k] = 0.0


@inner
def _forget(cells: Cells, column: int, row: int) -> None:  # pragma: no cover
    """Halve the hits and the passes of a cell.

    Their proportion stays, and what comes counts twice as much as what was.
    """
    cell = ((row & (SIDE - 1)) << SIDE_BITS) + (column & (SIDE - 1))
    block = block_at(cells.open, column >> SIDE_BITS, row >> SIDE_BITS)
    if block >= 0:
        for place in range(cell, PASS_DIRECTIONS * SIDE * SIDE, SIDE * SIDE):
            passed = cells.passes[block, place]
            cells.passes[block, place] = (passed & SOLID) + ((passed & MOST_PASSES) >> 1)
    block = block_at(cells.solid, column >> SIDE_BITS, row >> SIDE_BITS)
    if block >= 0:
        cluster = cells.heads[block, cell]
        while cluster >= 0:
            for k in (0, 1, 4, 5, 6, 9, 10):
                cells.moments[cluster, k] *= 0.5
            cluster = cells.following[cluster]


@inner
def _add_hit(
    cells: Cells,
    x: float,
    y: float,
    dx: float,
    dy: float,
    deviation: float,
    way: int,
    news: News,
) -> None:  # pragma: no cover
    """Add a return at a place [m] to the moments of its cell."""
    column, row = int(np.floor(x / CELL)), int(np.floor(y / CELL))
    at_x, at_y = column >> SIDE_BITS, row >> SIDE_BITS
    block = block_at(cells.solid, at_x, at_y)
    cell = ((row & (SIDE - 1)) << SIDE_BITS) + (column & (SIDE - 1))
    if cells.heads[block, cell] < 0:
        open_block = block_at(cells.open, at_x, at_y)
        if open_block >= 0:
            for place in range(cell, PASS_DIRECTIONS * SIDE * SIDE, SIDE * SIDE):
                cells.passes[open_block, place] |= SOLID
    cluster = cells.heads[block, cell]
    while cluster >= 0 and cells.ways[cluster] != way:
        cluster = cells.following[cluster]
    if cluster < 0:
        cluster = cells.used[1]
        if cluster >= 0:
            cells.used[1] = cells.following[cluster]
        else:
            cluster = cells.used[0]
            cells.used[0] += 1
        cells.ways[cluster] = way
        cells.following[cluster] = cells.heads[block, cell]
        cells.heads[block, cell] = cluster
    total = cells.moments[cluster]
    if total[0] >= MOST_HITS:
        _forget(cells, column, row)
    if cells.seen[cluster] != cells.used[2]:
        if total[9] > 0.0:
            total[10] += cells.misses[cluster]
        cells.seen[cluster] = cells.used[2]
        total[9] += 1.0
    cells.misses[cluster] = 0
    weight = 1.0 / (deviation * deviation)
    total[0] += 1.0
    total[1] += weight
    share = weight / total[1]
    ox, oy = x - total[2], y - total[3]
    total[2] += share * ox
    total[3] += share * oy
    spread = weight * (1.0 - share)
    total[4] += spread * ox * ox
    total[5] += spread * ox * oy
    total[6] += spread * oy * oy
    total[7] += (dx - total[7]) / total[0]
    total[8] += (dy - total[8]) / total[0]
    owner = cells.owners[cluster, 0]
    if owner >= 0 and news.stamps[owner] == cells.claims[cluster, 0]:
        note(news, owner, 1.0)
    else:
        news.loose[news.numbers[1]] = cluster
        news.numbers[1] += 1


class EvidenceGrid:
    """Cells that grow in place with the ground that beams show."""

    def __init__(self) -> None:
        self.cells = Cells(
            Blocks.of_size(LEAST_BLOCKS),
            np.zeros((LEAST_BLOCKS, SIDE * SIDE * PASS_DIRECTIONS), np.uint8),
            Blocks.of_size(LEAST_BLOCKS),
            np.full((LEAST_BLOCKS, SIDE * SIDE), -1, np.int32),
            np.full(LEAST_CLUSTERS, -1, np.int32),
            np.zeros(LEAST_CLUSTERS, np.int8),
            np.zeros((LEAST_CLUSTERS, 11)),
            np.zeros(LEAST_CLUSTERS, np.int32),
            np.full((LEAST_CLUSTERS, 2), -1, np.int32),
            np.zeros((LEAST_CLUSTERS, 2), np.int32),
            np.zeros((LEAST_CLUSTERS, 2)),
            np.zeros(LEAST_CLUSTERS, np.int32),
            np.array([0, -1, 0]),
            np.zeros(1),
        )

    def add(self, beams: Beams, place: tuple[float, float], news: News | None = None) -> None:
        """Add the beams of a scan from a place [m], and note for which walls they are news."""
        units, ranges, deviations = beams
        if news is None:
            news = News.of_no_walls(len(ranges))
        x, y = place
        cells = self.cells
        while not take_open(cells.open, x, y, units, ranges):
            cells = cells._replace(open=rehashed(cells.open), passes=_doubled(cells.passes, 0))
        while not take_solid(cells.solid, x, y, units, ranges):
            cells = cells._replace(solid=rehashed(cells.solid), heads=_doubled(cells.heads, -1))
        while cells.used[0] + len(ranges) > len(cells.moments):
            cells = cells._replace(
                following=_doubled(cells.following, -1),
                ways=_doubled(cells.ways, 0),
                moments=_doubled(cells.moments, 0),
                seen=_doubled(cells.seen, 0),
                owners=_doubled(cells.owners, -1),
                claims=_doubled(cells.claims, 0),
                apart=_doubled(cells.apart, 0),
                misses=_doubled(cells.misses, 0),
            )
        self.cells = cells
        add_beams(cells, x, y, units, ranges, deviations, news)

    def state(self) -> dict[str, NDArray[Any]]:
        """All that the grid is, as plain arrays by their names; `restore` takes them back."""
        return {
            f"cell_{name}": column[:count].copy() for name, column, count in _columns(self.cells)
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Be the grid whose state is given."""
        columns: list[Any] = []
        for name, column, _ in _columns(EvidenceGrid().cells):
            kept = state[f"cell_{name}"]
            rows = max(len(column), 1 << (len(kept) - 1).bit_length()) if len(kept) else len(column)
            # Free rows are as those of a new grid.
            free = np.repeat(column[-1:], rows - len(kept), axis=0)
            columns.append(np.concatenate([kept, free]))
        self.cells = Cells(Blocks(*columns[:3]), columns[3], Blocks(*columns[4:7]), *columns[7:])
        # Blocks have room for half as many as their hash tables.
        while 2 * len(self.cells.passes) < len(self.cells.open.keys):
            self.cells = self.cells._replace(passes=_doubled(self.cells.passes, 0))
        while 2 * len(self.cells.heads) < len(self.cells.solid.keys):
            self.cells = self.cells._replace(heads=_doubled(self.cells.heads, -1))


def _columns(cells: Cells) -> list[tuple[str, NDArray[Any], int]]:
    """The arrays of cells, with their names and how many of their rows are used."""
    columns: list[tuple[str, NDArray[Any], int]] = []
    for name, column in cells._asdict().items():
        if isinstance(column, Blocks):
            columns += [
                (f"{name}_{part}", array, len(array)) for part, array in column._asdict().items()
            ]
        elif name in ("used", "widest"):
            columns.append((name, column, len(column)))
        else:
            used = {"passes": cells.open.used, "heads": cells.solid.used}.get(name, cells.used)
            columns.append((name, column, int(used[0])))
    return columns


def _doubled(column: NDArray[Number], value: int) -> NDArray[Number]:
    """An array with as many rows of a value behind it."""
    # What is zero costs nothing until it is written.
    grown = np.zeros((2 * len(column), *column.shape[1:]), column.dtype)
    grown[: len(column)] = column
    if value:
        grown[len(column) :] = value
    return grown
