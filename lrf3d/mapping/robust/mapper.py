"""RobustMapper: the default, made to get the number of walls right, each in its place and object.

An update judges each beam of the scan once, by the cells that it goes through, merges the walls of
the scan with those of the map, and refits the walls whose evidence has changed. What it costs does
not depend on the size of the map or on the number of scans.
"""

import numpy as np

from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserScan
from lrf3d.mapping.grid import Grid, filled
from lrf3d.mapping.line_map import LineMap, solid_map
from lrf3d.mapping.robust.beams import Beams, Frame, widen
from lrf3d.mapping.robust.cells import LEAST, Cells, NewEvidence, open_squares
from lrf3d.mapping.robust.extraction import LikelihoodExtractor, LocalWalls
from lrf3d.mapping.robust.judging import add_beams
from lrf3d.mapping.robust.noise_estimate import NoiseEstimate
from lrf3d.mapping.robust.objects import Links, close_corners, find_objects, link_walls
from lrf3d.mapping.robust.optics import Optics, with_surfaces
from lrf3d.mapping.robust.refinement import choose_walls, replace_walls
from lrf3d.mapping.robust.refitting import refit_walls
from lrf3d.mapping.robust.walls import Rule, Walls, merge_walls

Place = tuple[float, float]


class RobustMapper:
    """Likeliest walls, exact fits to all points, and the evidence of all beams.

    Walls with fewer hits than the least are kept back until they have more.
    """

    def __init__(self, extract: LikelihoodExtractor, rule: Rule, least: int) -> None:
        self._extract, self._rule, self._least = extract, rule, least
        self._noise, self._optics = NoiseEstimate(extract.floor), Optics()
        self._cells = Cells.of_size(LEAST)
        self._walls, self._grid = Walls.of_size(LEAST), Grid.of_size(4 * LEAST, LEAST)
        self._links = Links.of_size(LEAST)
        # Walls that are new in their places, and may fit others now.
        self._waiting = np.empty(0, np.int64)
        self._scans = 0
        self._frame: Frame | None = None
        self._map: LineMap | None = None

    def update(self, scan: LaserScan) -> None:
        """Unite the map with a scan."""
        self._map = None
        if self._frame is None:
            self._frame = Frame.of(scan)
        place, heading = self._frame.pose_of(scan)
        noise = self._noise.update(scan, self._extract.noise(scan))
        lit, scan = scan, self._optics.without_images(scan, place, heading)
        found = self._extract.walls(scan, heading, noise)
        widen(found.moments, scan)
        fresh = self._judge_beams(Beams.of(scan, heading, noise), place, len(found.ends))
        segments = self._walls.ends[self._rows()]
        pose = *place, heading
        self._optics.update(lit, pose, noise, found.ends, segments, self._cells, fresh)
        changed, gone = self._merge_walls(found, place)
        self._link_walls(self._refit_walls(changed, gone, fresh))

    def _judge_beams(self, beams: Beams, place: Place, count: int) -> NewEvidence:
        """Add what the beams show to the cells; returns what is new of which walls."""
        # Some walls will come; none may move to larger arrays before they are refit.
        self._make_room(count)
        self._scans += 1
        fresh = NewEvidence.of(self._walls.rows, len(beams.ranges), self._scans)
        while not open_squares(self._cells, place, beams):
            self._cells = self._cells.doubled()
        done = 0
        while (done := add_beams(self._cells, done, place, beams, fresh)) < len(beams.ranges):
            self._cells = self._cells.doubled()
        return fresh

    def _merge_walls(self, found: LocalWalls, place: Place) -> tuple[Int, Int]:
        """Merge the walls of a scan with those of the map; returns those that changed or went."""
        new = found.ends, found.moments, found.points
        waiting, self._waiting = self._waiting, self._waiting[:0]
        return merge_walls(self._walls, self._grid, new, place, waiting, self._cells, self._rule)

    def _refit_walls(self, changed: Int, gone: Int, fresh: NewEvidence) -> Int:
        """Put the real parts of changed walls in their places; returns which to link again."""
        near = self._rule.distance
        chosen = choose_walls(self._walls, self._grid, self._cells, fresh, changed, near)
        rows = np.flatnonzero(chosen & (self._walls.rows["points"] > 0))
        parts = refit_walls(rows, self._walls.ends, self._cells, fresh, near, self._least)
        self._make_room(len(parts[0]))
        self._waiting = replace_walls(self._walls, self._grid, self._cells, rows, gone, parts)
        return self._waiting

    def _link_walls(self, rows: Int) -> None:
        """Link walls with those around them."""
        self._links = self._links.with_rows(len(self._walls.rows))
        link_walls(self._links, self._walls, self._grid, self._cells, rows)

    def _make_room(self, count: int) -> None:
        """Have room for a number of new walls, and all walls in the grid."""
        self._walls = self._walls.with_room(count)
        if self._grid.is_full or len(self._grid.found) < len(self._walls.rows):
            entries = len(self._grid.rows) * (2 if self._grid.is_full else 1)
            self._grid = filled(self._walls.ends, self._walls.rows["points"], entries)

    def _rows(self) -> Int:
        """The rows of the walls that are shown."""
        rows = self._walls.rows
        return np.flatnonzero(rows["shown"] & (rows["points"] > 0))

    @property
    def map(self) -> LineMap:
        """The global map as it is now."""
        if self._frame is None:
            return LineMap.empty()
        if self._map is None:
            rows = self._rows()
            objects = find_objects(self._links, self._walls, rows)
            ends: Float = close_corners(self._walls.ends[rows], objects)
            shown = solid_map(self._frame.in_world(ends), objects, self._walls.rows["points"][rows])
            surfaces = self._optics.surfaces
            special = self._frame.in_world(surfaces[:, :4])
            self._map = with_surfaces(shown, special, surfaces[:, 4] > 0.0)
        return self._map
