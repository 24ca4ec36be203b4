"""RobustMapper: the default, made to get the number of walls right, each in its place and object.

An update extracts the walls of a scan and unites them with those of the map, at a cost that does
not depend on the size of the map. The beams are kept, and when a map is asked for, they are heard
as witnesses: which parts of the walls they met or passed, where walls bend, and which walls no
beam has parted.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserScan
from lrf3d.mapping.extraction import LikelihoodExtractor
from lrf3d.mapping.line_map import LineMap
from lrf3d.mapping.revision import Noise, revise
from lrf3d.mapping.scan_archive import ScanArchive
from lrf3d.mapping.sights import Sights
from lrf3d.mapping.wall_merging import Rule
from lrf3d.mapping.wall_store import Version, WallStore


class RobustMapper:
    """Likeliest walls, exact fits to all points, and the evidence of all beams.

    Args:
        extract: Finds the walls of a scan.
        rule: What one wall is.
        least: Walls on which fewer beams than this ended are kept back until more do.
    """

    def __init__(self, extract: LikelihoodExtractor, rule: Rule, least: int) -> None:
        self._extract, self._rule, self._least = extract, rule, least
        self._walls = WallStore(rule)
        self._scans = ScanArchive()
        self._sights = Sights()
        self._origin: Float | None = None
        self._noise = Noise(extract.floor, 0.0)

    def update(self, scan: LaserScan) -> LineMap:
        """Unite the map with the walls of a scan; the very same scan again is no news."""
        if not self._sights.add(scan):
            return self.map
        x, y = scan.pose.x, scan.pose.y
        if self._origin is None:
            # Whole metres, so that taking the origin off and adding it again loses nothing.
            self._origin = np.round(np.array([x, y]))
        place = (x - float(self._origin[0]), y - float(self._origin[1]))
        self._walls.add(*self._extract.walls(scan), place)
        self._scans.add(scan, place)
        self._noise = Noise(self._extract.floor, self._extract.growth(scan))
        return self.map

    @property
    def map(self) -> LineMap:
        """The global map as it is now; it is worked out when it is first looked at."""
        version, scans, noise = self._walls.version, len(self._scans), self._noise
        return LineMap.deferred(lambda: self._build(version, scans, noise))

    def state(self) -> dict[str, Any]:
        """All that the mapper has learnt, as plain arrays; `restore` takes them back."""
        origin = np.full(2, np.nan) if self._origin is None else self._origin
        return {
            **self._walls.state(),
            **self._scans.state(),
            "sights": self._sights.state(),
            "origin": origin,
            "noise": np.array(self._noise),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what a mapper of the same settings had learnt."""
        self._walls.restore(state)
        self._scans.restore(state)
        self._sights.restore(state["sights"])
        self._origin = None if np.isnan(state["origin"]).any() else state["origin"].copy()
        self._noise = Noise(*state["noise"].tolist())

    def _build(self, version: Version, scans: int, noise: Noise) -> tuple[Float, Int, Int]:
        table = self._walls.table(version)
        table = revise(table, self._scans.beams(scans), noise, self._rule, self._least)
        line_map = table.as_map(np.zeros(2) if self._origin is None else self._origin)
        return line_map.segments, line_map.objects, line_map.points
