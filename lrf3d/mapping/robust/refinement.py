"""MapRefinement: walls are checked against what all beams have shown, and corrected by it.

Enter the walls that merging left, and the cells of the beams; leave walls cut where beams went
through them, split where the points bend, without second copies, continued across gaps that no
beam crossed, grouped into objects, with closed corners. An update refines just the walls
whose evidence it changes, and what is joined with them.

It goes in two rounds: of each wall the stretches that are real are found; stretches of one wall are
joined, and checked again: what the first round cut free, the second merges.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.compiling import compiled
from lrf3d.geometry import Float, Int
from lrf3d.laser import RangeNoise
from lrf3d.mapping.grid import Grid
from lrf3d.mapping.line_map import LineMap, solid_map
from lrf3d.mapping.robust.beams import Frame
from lrf3d.mapping.robust.cells import Cells, NewEvidence
from lrf3d.mapping.robust.constants import (
    FOLLOWED,
    FORSAKEN,
    OPEN_WEIGHT,
    VIOLATION_WEIGHT,
)
from lrf3d.mapping.robust.joining import Joints, loosen_walls, rejoin_stretches
from lrf3d.mapping.robust.object_groups import ObjectGroups
from lrf3d.mapping.robust.refitting import Refit, refit_walls
from lrf3d.mapping.robust.segment_pool import NewSegments, Pool, SegmentPool
from lrf3d.mapping.robust.wall_choice import KnownWalls, choose_walls
from lrf3d.mapping.robust.walls import Rule, longer

LEAST_ROWS = 256
"""Walls that a new refinement has room for."""


class MapRefinement:
    """The stretches of walls that are real, and the segments that they make.

    Args:
        rule: What one wall is.
        least: Walls with fewer hits than this are left out.

    Attributes:
        stamps: (rows,) the stamp of each wall of the store; see `Cells`.
        new_evidence: (rows,) beams that hit each wall, or went through its hits, since its refit.
        evidence: (rows,) hits and free-space violations that each wall had when it was refit.
        segments: The segments of the map.
        groups: Their objects.
    """

    def __init__(self, rule: Rule, least: int) -> None:
        self._rule, self._least = rule, least
        self.stamps = np.zeros(LEAST_ROWS, np.int32)
        self.new_evidence, self.evidence = np.zeros(LEAST_ROWS), np.zeros(LEAST_ROWS)
        self._stretches, self.segments = SegmentPool(), SegmentPool()
        self._joints = Joints.of_size(LEAST_ROWS)
        self.groups = ObjectGroups()

    def grow(self, rows: int) -> None:
        """Have room for so many walls."""
        while len(self.stamps) < rows:
            self.stamps = longer(self.stamps)
            self.new_evidence, self.evidence = longer(self.new_evidence), longer(self.evidence)

    def refine(
        self, fresh: NewEvidence, known: KnownWalls, cells: Cells, noise: RangeNoise
    ) -> list[int]:
        """Refine those walls anew whose evidence has changed.

        Args:
            fresh: What is new of the walls; is written.
            known: The walls; is written.
            cells: What the beams have shown.
            noise: The noise of the ranges.

        Returns:
            Those of them that the beams went through and that have nothing real.
        """
        stretches = self._stretches
        stretches.make_room(0, len(self.stamps))
        cut = cut_walls(
            *(fresh, known, cells, stretches.pool, stretches.grid),
            *(self._joints, self._rule, self._least),
        )
        if not len(cut.walls) and not len(cut.broken):
            return []
        rows = stretches.add(cut.found, len(self.stamps))
        while len(self._joints.names) < stretches.size:
            self._joints = self._joints.doubled()
        old, found = rejoin_stretches(
            np.concatenate([cut.loose, rows]), cut.broken,
            *(stretches.pool, stretches.grid, stretches.search, self._joints, self._rule),
            *(cells, self._least),
        )  # fmt: skip
        change = self.segments.exchange(old, found, stretches.size)
        self.groups.update(self.segments, change, cells, noise)
        forsaken: list[int] = cut.forsaken.tolist()
        return forsaken

    @property
    def ends(self) -> Float:
        """The segments (m, 4) of the map in its own frame [m]."""
        return self.groups.closed[self.segments.rows()]

    def in_world(self, frame: Frame) -> LineMap:
        """The map in the world."""
        rows = self.segments.rows()
        ends = frame.in_world(self.groups.closed[rows])
        return solid_map(ends, self.groups.labels[rows], self.segments.walls.points[rows])


class Cut(NamedTuple):
    """What the first round of the refinement leaves of some walls.

    Args:
        walls: The rows of the walls.
        found: Their real stretches.
        loose: The rows of the other stretches of what their old ones were joined to.
        broken: The names of that.
        forsaken: Those of the walls that beams went through and that have nothing real.
    """

    walls: Int
    found: NewSegments
    loose: Int
    broken: Int
    forsaken: Int


@compiled
def cut_walls(
    fresh: NewEvidence,
    known: KnownWalls,
    cells: Cells,
    pool: Pool,
    grid: Grid,
    joints: Joints,
    rule: Rule,
    least: int,
) -> Cut:
    """Find the real stretches of the walls whose evidence has changed; takes their old ones out."""
    walls, gone = choose_walls(fresh, cells, known, rule.distance)
    for k in range(len(gone)):
        fresh.stamps[gone[k]] += 1
    loose, broken = loosen_walls(np.concatenate((walls, gone)), pool, grid, joints)
    refit = Refit(
        0, walls, known.walls.ends[walls], FOLLOWED, FOLLOWED, rule.distance, least,
        fresh.stamps, fresh.counts,
    )  # fmt: skip
    found, totals = refit_walls(refit, cells)
    forsaken, count = np.empty(len(walls), np.int64), 0
    for k in range(len(walls)):
        hits, violations = totals[k, 0], totals[k, 1]
        known.evidence[walls[k]] = hits + OPEN_WEIGHT * violations
        if totals[k, 2] == 0.0 and VIOLATION_WEIGHT * violations > FORSAKEN * hits:
            forsaken[count] = walls[k]
            count += 1
    return Cut(walls, found, loose, broken, forsaken[:count])
