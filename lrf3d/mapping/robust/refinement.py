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

from lrf3d.geometry import Float, Int
from lrf3d.laser import RangeNoise
from lrf3d.mapping.line_map import LineMap
from lrf3d.mapping.robust.beams import Frame
from lrf3d.mapping.robust.cells import Cells
from lrf3d.mapping.robust.constants import (
    FOLLOWED,
    FORSAKEN,
    OPEN_WEIGHT,
    PIECE,
    VIOLATION_WEIGHT,
)
from lrf3d.mapping.robust.joining import Joints, loosen_walls, rejoin_stretches, tie_rings
from lrf3d.mapping.robust.live_map import LiveMap
from lrf3d.mapping.robust.object_groups import ObjectGroups
from lrf3d.mapping.robust.refitting import Refit, refit_walls
from lrf3d.mapping.robust.segment_pool import SegmentPool
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
        self._changed: list[Int] = []
        self._live = LiveMap()

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
        stretches = self._stretches
        self.stamps[gone] += 1
        changed = np.concatenate([walls, gone])
        stretches.make_room(0, len(self.stamps))
        loose, broken = loosen_walls(changed, stretches.pool, stretches.grid, self._joints)
        if not len(walls) and not len(broken):
            return []
        refit = Refit(
            0, walls, ends, FOLLOWED, FOLLOWED, self._rule.distance, self._least,
            self.stamps, self.new_evidence,
        )  # fmt: skip
        found, totals = refit_walls(refit, cells)
        self.evidence[walls] = totals[:, 0] + OPEN_WEIGHT * totals[:, 1]
        contradicted = VIOLATION_WEIGHT * totals[:, 1] > FORSAKEN * totals[:, 0]
        contradicted &= totals[:, 2] == 0.0
        fresh = stretches.add(found, len(self.stamps))
        while len(self._joints.names) < stretches.size:
            self._joints = self._joints.doubled()
        self._rejoin(np.concatenate([loose, fresh]), broken, cells, noise)
        gone_through: list[int] = walls[contradicted].tolist()
        return gone_through

    def _rejoin(self, loose: Int, broken: Int, cells: Cells, noise: RangeNoise) -> None:
        """Join loose stretches with each other or with others, and find the segments they make."""
        stretches, joints = self._stretches, self._joints
        old, walls, ends = rejoin_stretches(
            *(loose, broken, stretches.pool, stretches.grid, stretches.search),
            *(joints, self._rule, cells),
        )
        refit = Refit(
            # They end at hits, which a little less would miss.
            1, walls, ends, 0.1 * PIECE, 0.0, self._rule.distance, self._least,
            joints.stamps, joints.lost,
        )  # fmt: skip
        found, _ = refit_walls(refit, cells)
        change = self.segments.exchange(old, found, stretches.size)
        self._changed.append(self.groups.update(self.segments, change, cells, noise))

    def publish(self, frame: Frame) -> None:
        """Bring the map in the world up to date."""
        if self._changed:
            self._live.update(np.concatenate(self._changed), *self._shown(), frame)
            self._changed.clear()

    def _shown(self) -> tuple[Float, Int, Int]:
        return self.groups.closed, self.segments.walls.points, self.groups.labels

    @property
    def ends(self) -> Float:
        """The segments (m, 4) of the map in its own frame [m]."""
        return self.groups.closed[self.segments.rows()]

    @property
    def map(self) -> LineMap:
        """The map in the world, as it was published last."""
        return self._live.value()

    def state(self) -> dict[str, Any]:
        """All that was worked out, as plain arrays by their names; `restore` takes them back."""
        return {
            **self._stretches.state("stretch"),
            **self.segments.state("segment"),
            **self.groups.state(),
            **self._live.state(),
            "refit_stamps": self.stamps.copy(),
            "new_evidence": self.new_evidence.copy(),
            "refit_evidence": self.evidence.copy(),
            "joint_stamps": self._joints.stamps.copy(),
            "joints": self._joints.names.copy(),
        }

    def restore(self, state: Mapping[str, Any], frame: Frame) -> None:
        """Go on from what was worked out."""
        self._stretches.restore(state, "stretch")
        self.segments.restore(state, "segment")
        self.groups.restore(state)
        self._live.restore(state, *self._shown(), frame)
        self._changed.clear()
        self.stamps, self.evidence = state["refit_stamps"].copy(), state["refit_evidence"].copy()
        self.new_evidence = state["new_evidence"].copy()
        names = state["joints"].copy()
        self._joints = Joints.of_size(len(names))._replace(
            names=names, stamps=state["joint_stamps"].copy()
        )
        tie_rings(self._stretches.rows(), names, self._joints.rings)
