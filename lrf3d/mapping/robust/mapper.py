"""RobustMapper: the default, made to get the number of walls right, each in its place and object.

An update extracts the walls of a scan and merges them with those of the map, judges each beam of
the scan once, by the cells that it goes through, and refines the walls whose evidence has changed.
What it costs does not depend on the size of the map or on the number of scans.
"""

import numpy as np

from lrf3d.laser import LaserScan, RangeNoise
from lrf3d.mapping.line_map import LineMap
from lrf3d.mapping.robust.beams import Beams, Frame, fingerprint, widen
from lrf3d.mapping.robust.cells import NewEvidence
from lrf3d.mapping.robust.evidence_grid import EvidenceGrid
from lrf3d.mapping.robust.extraction import LikelihoodExtractor
from lrf3d.mapping.robust.noise_estimate import NoiseEstimate
from lrf3d.mapping.robust.optics import Optics
from lrf3d.mapping.robust.refinement import LEAST_ROWS, MapRefinement
from lrf3d.mapping.robust.wall_choice import KnownWalls
from lrf3d.mapping.robust.wall_store import WallStore
from lrf3d.mapping.robust.walls import Rule, longer


class RobustMapper:
    """Likeliest walls, exact fits to all points, and the evidence of all beams.

    Args:
        extract: Finds the walls of a scan.
        rule: What one wall is.
        least: Walls with fewer hits than this are kept back until they have more.
    """

    def __init__(self, extract: LikelihoodExtractor, rule: Rule, least: int) -> None:
        self._extract, self._rule = extract, rule
        self._walls = WallStore(rule)
        self._grid = EvidenceGrid()
        self._noise = NoiseEstimate(extract.floor)
        self._refined = MapRefinement(rule, least)
        self._optics = Optics()
        self._last_scan: int | None = None
        self._frame: Frame | None = None
        self._map: LineMap | None = None
        # Of each wall of the store: the last scan that was evidence of it, and where it was refit.
        self._last_scans = np.zeros(LEAST_ROWS, np.int64)
        self._refit = np.full((LEAST_ROWS, 4), np.inf)
        self._scans = 0
        self._following = np.zeros(1, np.int64)

    def update(self, scan: LaserScan) -> None:
        """Unite the map with a scan; the same scan once more changes nothing."""
        number = fingerprint(scan)
        if number == self._last_scan:
            return
        self._map = None
        if self._frame is None:
            self._frame = Frame.of(scan)
        place, heading = self._frame.pose_of(scan)
        noise = self._noise.update(scan, self._extract.noise(scan))
        scan, lit = self._optics.look(scan, place, heading, noise)
        fresh = self._add_beams(Beams.of(scan, heading, noise), place)
        ends, moments, labels = self._extract.walls(scan, heading, noise)
        widen(moments, scan)
        self._walls.add(ends, moments, labels[:, 0], place)
        self._refine(fresh, noise)
        if lit is not None:
            self._optics.update(lit, ends, self._refined.ends)
        # Last: a scan whose update was interrupted may be given again.
        self._last_scan = number

    def _add_beams(self, beams: Beams, place: tuple[float, float]) -> NewEvidence:
        """Add what the beams of a scan show to the grid; returns what is new of which walls."""
        self._scans += 1
        fresh = NewEvidence(
            self._refined.stamps,
            self._refined.new_evidence,
            np.empty(len(self._last_scans), np.int64),
            self._last_scans,
            np.empty(len(beams.ranges), np.int64),
            np.array([0, 0, self._scans]),
        )
        self._grid.add(beams, place, fresh)
        return fresh

    def _refine(self, fresh: NewEvidence, noise: RangeNoise) -> None:
        """Refine the walls whose evidence has changed."""
        store, cells = self._walls, self._grid.cells
        rows = len(store.walls.points)
        if rows > len(self._last_scans):
            self._refined.grow(rows)
            while len(self._last_scans) < rows:
                self._last_scans = longer(self._last_scans)
                self._refit = np.concatenate([self._refit, np.full_like(self._refit, np.inf)])
            fresh = fresh._replace(
                stamps=self._refined.stamps,
                counts=self._refined.new_evidence,
                walls=np.concatenate([fresh.walls, np.empty(rows, np.int64)]),
                last_scans=self._last_scans,
            )
        known = KnownWalls(
            store.walls, store.touched, store.grid, self._refit, self._refined.evidence,
            self._following,
        )  # fmt: skip
        for row in self._refined.refine(fresh, known, cells, noise):
            # Beams went through it: if it comes back, it is found anew.
            store.drop(row)
            self._refined.stamps[row] += 1
            self._refit[row] = np.inf

    @property
    def map(self) -> LineMap:
        """The global map as it is now."""
        if self._frame is None:
            return LineMap.empty()
        if self._map is None:
            self._map = self._optics.show(self._refined.in_world(self._frame), self._frame)
        return self._map
