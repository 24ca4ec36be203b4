"""MapRefinement: walls are checked against what all beams have shown, and corrected by it.

Enter the walls that merging left, and the cells of the beams; leave walls cut where beams went
through them, split where the points bend, without second copies, continued across gaps that no
beam crossed, grouped into objects, with closed corners. An update refines just the walls
whose evidence it changes, and what is joined with them.

It goes in two rounds: of each wall the stretches that are real are found; stretches of one wall are
joined, and checked again: what the first round cut free, the second merges.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from lrf3d.geometry import Float, Int, lengths
from lrf3d.laser import RangeNoise
from lrf3d.mapping.robust.cells import Cells
from lrf3d.mapping.robust.constants import (
    FOLLOWED,
    FORSAKEN,
    OPEN_WEIGHT,
    PIECE,
    SHORT_WALL,
    VIOLATION_WEIGHT,
)
from lrf3d.mapping.robust.evidence import Round, gather_evidence
from lrf3d.mapping.robust.joining import (
    join_stretches,
    neighbours_of,
    parts_of,
    tie_rings,
)
from lrf3d.mapping.robust.object_groups import ObjectGroups
from lrf3d.mapping.robust.refitting import refit_segments
from lrf3d.mapping.robust.segment_pool import SegmentPool
from lrf3d.mapping.robust.walls import Rule, longer
from lrf3d.mapping.segment_table import SegmentTable

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
        self._joint_stamps = np.zeros(LEAST_ROWS, np.int32)
        self._joint_new = np.zeros(LEAST_ROWS)
        self._stretches, self.segments = SegmentPool(), SegmentPool()
        # The joined wall that each stretch is a part of is named by one of them.
        self._joint = np.zeros(LEAST_ROWS, np.int64)
        self._rings, self._marks = np.arange(LEAST_ROWS), np.zeros(LEAST_ROWS, np.bool_)
        self.groups = ObjectGroups()

    def grow(self, rows: int) -> None:
        """Have room for so many walls."""
        while len(self.stamps) < rows:
            self.stamps = longer(self.stamps)
            self.new_evidence, self.evidence = longer(self.new_evidence), longer(self.evidence)

    def refine(
        self, walls: Int, ends: Float, gone: Int, cells: Cells, noise: RangeNoise
    ) -> list[int]:
        """Refine some walls anew.

        Args:
            walls: (m,) their rows.
            ends: (m, 4) where they are [m].
            gone: (k,) rows that are no walls any more.
            cells: What the beams have shown.
            noise: The noise of the ranges.

        Returns:
            Those of them that the beams went through and that have nothing real.
        """
        self.stamps[gone] += 1
        if not len(walls) and not self._stretches.rows_of(gone.tolist()):
            return []
        changed = [*walls.tolist(), *gone.tolist()]
        old = np.array(self._stretches.rows_of(changed), np.int64)
        parts = parts_of(old, self._rings, self._marks)
        affected = set(self._joint[parts].tolist())
        self._stretches.drop(changed)
        parts = parts[self._stretches.walls.points[parts] > 0]
        contradicted: list[int] = []
        if len(walls):
            found, moments, labels, totals = self._refit(
                0, walls, followed(ends, FOLLOWED), self.stamps, self.new_evidence, cells, FOLLOWED
            )
            self.evidence[walls] = totals @ (1.0, OPEN_WEIGHT)
            hits = labels[:, 1].astype(np.int64)
            parents = walls[labels[:, 0].astype(np.int64)]
            fresh = self._stretches.add(found, moments, hits, parents)
            while len(self._joint) < len(self._stretches.parents):
                self._joint = longer(self._joint)
                self._marks = np.zeros(len(self._joint), np.bool_)
                self._rings = np.concatenate([self._rings, np.empty_like(self._rings)])
                self._joint_stamps = longer(self._joint_stamps)
                self._joint_new = longer(self._joint_new)
            weak = VIOLATION_WEIGHT * totals[:, 1] > FORSAKEN * totals[:, 0]
            weak[np.isin(walls, parents)] = False
            contradicted = walls[weak].tolist()
            parts = np.concatenate([parts, fresh])
        stretches = self._stretches
        neighbours = neighbours_of(
            parts,
            stretches.walls,
            stretches.grid,
            stretches.search,
            self._rings,
            self._marks,
            self._rule,
        )
        self._rejoin(np.sort(parts), neighbours, affected, cells, noise)
        return contradicted

    def _rejoin(
        self, loose: Int, others: Int, affected: set[int], cells: Cells, noise: RangeNoise
    ) -> None:
        """Join loose stretches with each other or with others, and find the segments they make."""
        rows = np.concatenate([loose, others])
        walls = self._stretches.walls.take(rows)
        roots, changed = join_stretches(walls, len(loose), self._joint[rows], self._rule, cells)
        affected.update(self._joint[others[changed[len(loose) :]]].tolist())
        old = sorted(affected)
        self._joint_stamps[old] += 1
        found, moments = np.empty((0, 4)), np.empty((0, 6))
        hits = parents = np.zeros(0, np.int64)
        if len(rows):
            # Walls that stayed as they were keep their names.
            self._joint[rows[changed]] = rows[roots[changed]]
            tie_rings(rows[changed], self._joint, self._rings)
            kept = np.flatnonzero(changed & (walls.points > 0))
            found, moments, labels, _ = self._refit(
                # They end at hits, which a little less would miss.
                1, rows[kept], followed(walls.ends[kept], 0.1 * PIECE), self._joint_stamps,
                self._joint_new, cells, 0.0,
            )  # fmt: skip
            hits, parents = labels[:, 1].astype(np.int64), rows[kept][labels[:, 0].astype(np.int64)]
        gone, fresh, renewed = self.segments.exchange(old, found, moments, hits, parents)
        moved = np.array(self.segments.rows_of(set(parents.tolist())), np.int64)
        self.groups.update(self.segments, gone, fresh, renewed, moved, cells, noise)

    def _refit(
        self,
        number: int,
        walls: Int,
        ends: Float,
        stamps: Any,
        lost: Float,
        cells: Cells,
        margin: float,
    ) -> tuple[Float, Float, Float, Float]:
        """The real segments of walls: ends, moments, labels; and evidence (walls, 2) of each."""
        pieces = np.maximum(np.ceil(lengths(ends) / PIECE).astype(np.int64), 1)
        first = np.concatenate([[0], np.cumsum(pieces)])
        turn = Round(number, walls, ends, first, stamps, lost)
        counts, sums = gather_evidence(turn, cells, self._rule.distance, margin)
        found, moments, labels = refit_segments(ends, first, counts, sums)
        hits, violations = labels[:, 1], labels[:, 2]
        factor = np.where(lengths(found) < SHORT_WALL, 2, 1)
        real = (hits >= factor * self._least) & (factor * violations <= hits)
        spare = int(margin / PIECE)
        sums = np.concatenate([np.zeros((1, 2)), np.cumsum(counts[:, :2], axis=0)])
        totals: Float = sums[first[1:] - spare] - sums[first[:-1] + spare]
        return found[real], moments[real], labels[real], totals

    def table(self) -> SegmentTable:
        """The segments of the map as they are now."""
        rows = self.segments.rows()
        walls = self.segments.walls
        return SegmentTable(
            self.groups.closed[rows],
            walls.moments[rows],
            walls.points[rows],
            self.groups.labels[rows],
        )

    def state(self) -> dict[str, Any]:
        """All that was worked out, as plain arrays by their names; `restore` takes them back."""
        return {
            **self._stretches.state("stretch"),
            **self.segments.state("segment"),
            **self.groups.state(),
            "refit_stamps": self.stamps.copy(),
            "new_evidence": self.new_evidence.copy(),
            "refit_evidence": self.evidence.copy(),
            "joint_stamps": self._joint_stamps.copy(),
            "joints": self._joint.copy(),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what was worked out."""
        self._stretches.restore(state, "stretch")
        self.segments.restore(state, "segment")
        self.groups.restore(state, self.segments)
        self.stamps, self.evidence = state["refit_stamps"].copy(), state["refit_evidence"].copy()
        self.new_evidence = state["new_evidence"].copy()
        self._joint_new = np.zeros(len(state["joints"]))
        self._joint_stamps, self._joint = state["joint_stamps"].copy(), state["joints"].copy()
        self._marks = np.zeros(len(self._joint), np.bool_)
        self._rings = np.arange(len(self._joint))
        tie_rings(self._stretches.rows(), self._joint, self._rings)


def followed(ends: Float, farther: float) -> Float:
    """Walls (m, 4), longer by so much [m] at both ends."""
    units = ends[:, 2:] - ends[:, :2]
    units = farther * units / lengths(ends)[:, None]
    longer_ends: Float = ends + np.hstack([-units, units])
    return longer_ends
