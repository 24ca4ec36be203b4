"""RobustMapper: the default mapper, whose walls are right in number, place and object.

A scan enters. Its beams are added to the cells, its walls are merged with those of the map, and the
walls whose evidence has changed are refit and linked to objects. The cost of an update depends
neither on the size of the map nor on the number of scans.
"""

import numpy as np

from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserScan
from lrf3d.mapping.line_map import LineMap, solid_map
from lrf3d.mapping.robust.beams import Beams, NoiseEstimate, in_world, pose_in, widen
from lrf3d.mapping.robust.cells import LEAST, MOST_EXPLAINED, Cells, open_squares
from lrf3d.mapping.robust.corners import close_corners
from lrf3d.mapping.robust.extraction import LikelihoodExtractor
from lrf3d.mapping.robust.glass.optics import Optics, with_surfaces
from lrf3d.mapping.robust.links import find_objects, link_walls
from lrf3d.mapping.robust.merging import BEND, Rule, merge_walls
from lrf3d.mapping.robust.rays import add_beams
from lrf3d.mapping.robust.refinement import choose_walls, replace_walls
from lrf3d.mapping.robust.refitting import refit_walls
from lrf3d.mapping.robust.walls import Walls
from lrf3d.pose import Pose

Place = tuple[float, float]


class RobustMapper:
    """Maps with the most likely walls, fitted to all points, by the evidence of all beams.

    Walls with fewer hits than the least are kept back until they have more.
    """

    def __init__(
        self, extract: LikelihoodExtractor, length: float, distance: float, least: int
    ) -> None:
        self._extract, self._least, self.local_map = extract, least, extract.local_map
        self._rule = Rule(length, distance, BEND * distance, MOST_EXPLAINED)
        self._noise, self._optics = NoiseEstimate(extract.floor), Optics()
        self._cells, self._walls = Cells.of_size(LEAST), Walls.of_size(LEAST)
        # Walls that are new in their places, and may fit others now.
        self._waiting = np.empty(0, np.int64)
        # The pose of the first scan: the map turns and moves with the world.
        self._frame: Pose | None = None
        self._map: LineMap | None = None

    def update(self, scan: LaserScan) -> None:
        """Unite the map with a scan."""
        self._map = None
        if self._frame is None:
            self._frame = scan.pose
        place, heading = pose_in(self._frame, scan)
        noise = self._noise.update(scan, self._extract.noise(scan))
        lit, scan = scan, self._optics.without_images(scan, place, heading)
        found = self._extract.walls(scan, heading, noise)
        widen(found.fits, scan)
        # Some walls will come; none may move to larger arrays before they are refit.
        self._walls = self._walls.with_room(len(found.ends))
        unowned = self._judge_beams(Beams.of(scan, heading, noise), place)
        segments, pose = self._walls.ends[self._rows()], (*place, heading)
        self._optics.update(lit, pose, noise, found.ends, segments, self._cells, self._walls)
        walls, cells, near = self._walls, self._cells, self._rule.distance
        changed, gone = merge_walls(walls, found, place, self._waiting, cells, self._rule)
        rows = choose_walls(walls, cells, unowned, changed, near)
        parts = refit_walls(rows, walls, cells, near, self._least)
        self._walls = walls.with_room(len(parts[0]))
        self._waiting = replace_walls(self._walls, cells, rows, gone, parts)
        link_walls(self._walls, cells, self._waiting)

    def _judge_beams(self, beams: Beams, place: Place) -> Int:
        """Add the beams to the cells; returns the clusters that are hits of no wall."""
        counters, unowned = self._walls.counters[0], np.empty(len(beams.ranges), np.int64)
        counters.scan += 1
        counters.changed = counters.unowned = 0
        while not open_squares(self._cells, place, beams):
            self._cells = self._cells.doubled()
        done = 0
        while done < len(beams.ranges):
            done = add_beams(self._cells, done, place, beams, self._walls, unowned)
            if done < len(beams.ranges):
                self._cells = self._cells.doubled()
        return unowned

    def _rows(self) -> Int:
        """The rows of the walls that are shown."""
        fits = self._walls.fits
        return np.flatnonzero(fits["shown"] & (fits["points"] > 0))

    @property
    def map(self) -> LineMap:
        """The global map as it is now."""
        if self._frame is None:
            return LineMap.empty()
        if self._map is None:
            rows = self._rows()
            objects = find_objects(self._walls, rows)
            ends: Float = close_corners(self._walls.ends[rows], objects)
            shown = solid_map(
                in_world(self._frame, ends), objects, self._walls.fits["points"][rows]
            )
            surfaces = self._optics.surfaces
            special = in_world(self._frame, surfaces[:, :4])
            self._map = with_surfaces(shown, special, surfaces[:, 4] > 0.0)
        return self._map
