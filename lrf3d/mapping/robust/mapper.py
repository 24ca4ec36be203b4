"""RobustMapper: the default, made to get the number of walls right, each in its place and object.

An update extracts the walls of a scan and merges them with those of the map, at a cost that does
not depend on the size of the map. The beams are kept, and when a map is asked for, its walls are
refined by them: by hits and free-space violations, where walls bend, and which walls belong to one
object.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from lrf3d.geometry import Float
from lrf3d.laser import LaserScan, RangeNoise
from lrf3d.mapping.line_map import LineMap
from lrf3d.mapping.robust.beams import DuplicateFilter, ScanArchive
from lrf3d.mapping.robust.extraction import LikelihoodExtractor
from lrf3d.mapping.robust.refinement import refine_map
from lrf3d.mapping.robust.wall_store import WallStore
from lrf3d.mapping.robust.walls import Rule


class RobustMapper:
    """Likeliest walls, exact fits to all points, and the evidence of all beams.

    Args:
        extract: Finds the walls of a scan.
        rule: What one wall is.
        least: Walls with fewer hits than this are kept back until they have more.
    """

    def __init__(self, extract: LikelihoodExtractor, rule: Rule, least: int) -> None:
        self._extract, self._rule, self._least = extract, rule, least
        self._walls = WallStore(rule)
        self._scans = ScanArchive()
        self._duplicates = DuplicateFilter()
        self._origin: Float | None = None
        self._map: LineMap | None = None
        self._noise = RangeNoise(extract.floor, 0.0)

    def update(self, scan: LaserScan) -> None:
        """Merge the walls of a scan with the map's; the very same scan again changes nothing."""
        if not self._duplicates.add(scan):
            return
        self._map = None
        x, y = scan.pose.x, scan.pose.y
        if self._origin is None:
            # Whole metres, so that taking the origin off and adding it again loses nothing.
            self._origin = np.round(np.array([x, y]))
        place = (x - float(self._origin[0]), y - float(self._origin[1]))
        ends, moments, labels = self._extract.walls(scan)
        self._walls.add(ends, moments, labels[:, 0], place)
        self._scans.add(scan, place)
        self._noise = self._extract.noise(scan)

    @property
    def map(self) -> LineMap:
        """The global map as it is now; it is computed once after an update, when it is read."""
        if self._map is None:
            beams = self._scans.beams(len(self._scans))
            table = refine_map(self._walls.table(), beams, self._noise, self._rule, self._least)
            self._map = table.as_map(np.zeros(2) if self._origin is None else self._origin)
        return self._map

    def state(self) -> dict[str, Any]:
        """All that the mapper has learnt, as plain arrays; `restore` takes them back."""
        origin = np.full(2, np.nan) if self._origin is None else self._origin
        return {
            **self._walls.state(),
            **self._scans.state(),
            "fingerprints": self._duplicates.state(),
            "origin": origin,
            "noise": np.array(self._noise),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what a mapper of the same settings had learnt."""
        self._walls.restore(state)
        self._scans.restore(state)
        self._duplicates.restore(state["fingerprints"])
        self._origin = None if np.isnan(state["origin"]).any() else state["origin"].copy()
        self._noise = RangeNoise(*state["noise"].tolist())
        self._map = None
