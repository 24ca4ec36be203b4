"""EvidenceGrid: what all beams have shown of the ground, in cells, each beam judged once.

A return adds to the moments of the returns in its cell that came the same way; each cell that a
beam goes through counts it as a pass, by the beam's direction. What is kept grows with the ground
that was seen and not with the number of scans, and sums do not depend on the order of the scans.
The cells stand in blocks, which a hash table finds.
"""

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from lrf3d.mapping.robust.beams import Beams
from lrf3d.mapping.robust.blocks import SIDE, Blocks, rehashed
from lrf3d.mapping.robust.cells import Cells, NewEvidence, add_beams
from lrf3d.mapping.robust.constants import PASS_DIRECTIONS

Number = TypeVar("Number", bound=np.generic)

LEAST_BLOCKS, LEAST_PLANES, LEAST_CLUSTERS = 256, 1024, 4096
"""How much a new grid has room for."""


class EvidenceGrid:
    """Cells that grow in place with the ground that beams show."""

    def __init__(self) -> None:
        self.cells = Cells(
            Blocks.of_size(LEAST_BLOCKS),
            np.zeros((LEAST_BLOCKS, PASS_DIRECTIONS), np.int32),
            np.zeros((LEAST_PLANES, SIDE * SIDE), np.uint8),
            np.zeros((LEAST_BLOCKS, SIDE * SIDE), np.uint16),
            Blocks.of_size(LEAST_BLOCKS),
            np.full((LEAST_BLOCKS, SIDE * SIDE), -1, np.int32),
            np.full(LEAST_CLUSTERS, -1, np.int32),
            np.zeros(LEAST_CLUSTERS, np.int8),
            np.zeros((LEAST_CLUSTERS, 13)),
            np.zeros(LEAST_CLUSTERS, np.int32),
            np.full((LEAST_CLUSTERS, 2), -1, np.int32),
            np.zeros((LEAST_CLUSTERS, 2), np.int32),
            np.zeros((LEAST_CLUSTERS, 2)),
            np.zeros(LEAST_CLUSTERS, np.int32),
            np.array([0, -1, 0, 1]),
            np.zeros(1),
        )

    def add(
        self, beams: Beams, place: tuple[float, float], fresh: NewEvidence | None = None
    ) -> None:
        """Add the beams of a scan from a place [m], and count them for the walls they concern."""
        if fresh is None:
            fresh = NewEvidence.of_no_walls(len(beams.ranges))
        done, short = add_beams(self.cells, 0, place, beams, fresh)
        while done < len(beams.ranges):
            self._grow(short)
            done, short = add_beams(self.cells, done, place, beams, fresh)

    def _grow(self, short: int) -> None:
        """Have room for twice as many open blocks (0), solid blocks, clusters or planes (3)."""
        cells = self.cells
        if short == 0:
            cells = cells._replace(
                open=rehashed(cells.open),
                planes=_doubled(cells.planes, 0),
                passed=_doubled(cells.passed, 0),
            )
        elif short == 1:
            cells = cells._replace(solid=rehashed(cells.solid), heads=_doubled(cells.heads, -1))
        elif short == 3:
            cells = cells._replace(passes=_doubled(cells.passes, 0))
        else:
            cells = cells._replace(
                following=_doubled(cells.following, -1),
                ways=_doubled(cells.ways, 0),
                moments=_doubled(cells.moments, 0),
                seen=_doubled(cells.seen, 0),
                owners=_doubled(cells.owners, -1),
                owner_stamps=_doubled(cells.owner_stamps, 0),
                apart=_doubled(cells.apart, 0),
                misses=_doubled(cells.misses, 0),
            )
        self.cells = cells


COUNTERS = ("used", "widest")
"""Arrays of the cells whose length is fixed: they have no free rows."""


def _columns(cells: Cells) -> list[tuple[str, NDArray[Any], int]]:
    """The arrays of cells, with their names and how many of their rows are used."""
    columns: list[tuple[str, NDArray[Any], int]] = []
    for name, column in cells._asdict().items():
        if isinstance(column, Blocks):
            columns += [
                (f"{name}_{part}", array, len(array)) for part, array in column._asdict().items()
            ]
        elif name in COUNTERS:
            columns.append((name, column, len(column)))
        else:
            taken = {"planes": cells.open.used[0], "heads": cells.solid.used[0]}
            taken["passes"], taken["passed"] = cells.used[3], cells.open.used[0]
            columns.append((name, column, int(taken.get(name, cells.used[0]))))
    return columns


def _doubled(column: NDArray[Number], value: int) -> NDArray[Number]:
    """An array with as many rows of a value behind it."""
    # What is zero costs nothing until it is written.
    grown = np.zeros((2 * len(column), *column.shape[1:]), column.dtype)
    grown[: len(column)] = column
    if value:
        grown[len(column) :] = value
    return grown
