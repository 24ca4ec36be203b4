"""PaperMapper: section 3 of Teslić et al. to the letter."""

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np

from lrf3d.geometry import Float
from lrf3d.laser import LaserScan
from lrf3d.mapping.extraction import SplitMergeExtractor
from lrf3d.mapping.line_map import LineMap
from lrf3d.mapping.merging import EndPointMerging, unite
from lrf3d.mapping.table import SegmentTable

COLUMNS = tuple(column.name for column in fields(SegmentTable))


class PaperMapper:
    """Polylines by split-and-merge, Eq. 9, and lines through four end points.

    Args:
        extract: Finds the polylines of a scan.
        merging: Eq. 9.
        least: Segments with fewer points than this are kept back until more of them are seen.
    """

    def __init__(self, extract: SplitMergeExtractor, merging: EndPointMerging, least: int) -> None:
        self._extract, self._merging, self._least = extract, merging, least
        self._table = SegmentTable.empty()
        self._origin: Float | None = None
        self._unions = 0

    def update(self, scan: LaserScan) -> LineMap:
        """Unite the map with the local map of a scan: G_new = S ∪ G_old."""
        place = np.array(scan.pose[:2])
        if self._origin is None:
            # Whole metres, so that taking the origin off and adding it again loses nothing.
            self._origin = np.round(place)
        local = self._extract(scan).shifted(place - self._origin)
        local = replace(local, unions=local.unions + self._unions)
        self._unions = int(local.unions.max(initial=self._unions - 1)) + 1
        known = len(self._table)
        fresh = range(known, known + len(local))
        self._table = unite(self._table.join(local), fresh, self._merging)
        return self.map

    def state(self) -> dict[str, Any]:
        """All that the mapper has learnt, as plain arrays; `restore` takes them back."""
        table = {f"table_{name}": getattr(self._table, name) for name in COLUMNS}
        origin = np.full(2, np.nan) if self._origin is None else self._origin
        return {**table, "origin": origin, "unions": np.array(self._unions)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what a mapper of the same settings had learnt."""
        self._table = SegmentTable(*(state[f"table_{name}"].copy() for name in COLUMNS))
        self._origin = None if np.isnan(state["origin"]).any() else state["origin"].copy()
        self._unions = int(state["unions"])

    @property
    def map(self) -> LineMap:
        """The global map."""
        table = self._table.take(np.flatnonzero(self._table.points >= self._least))
        return table.as_map(np.zeros(2) if self._origin is None else self._origin)
