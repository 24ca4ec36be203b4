"""RobustMapper: the default mapper, whose walls are right in number, place and object.

A scan enters. Its beams are added to the cells, its walls are merged with those of the map, and the
walls whose evidence has changed are refit and linked to objects. A refit wall that has hardly moved
keeps its row and links, so that one that is merged and cut repeatedly settles. The cost of an
update depends neither on the size of the map nor on the number of scans.
"""

import numpy as np

from lrf3d.compiling import borrower, compiled, inner
from lrf3d.geometry.lines import Bool, Float, Int
from lrf3d.geometry.pose import Pose
from lrf3d.laser import LaserScan
from lrf3d.mapping.glass.optics import Optics, with_surfaces
from lrf3d.mapping.line_map import LineMap, solid_map
from lrf3d.mapping.robust.beams import Beams, NoiseEstimate, in_world, pose_in, widen
from lrf3d.mapping.robust.cells import HIT_DEVIATIONS, LEAST, MOST_EXPLAINED, Cells, open_squares
from lrf3d.mapping.robust.extraction import LikelihoodExtractor
from lrf3d.mapping.robust.links import close_corners, find_objects, link_walls
from lrf3d.mapping.robust.merging import BEND, MergeRule, merge_walls
from lrf3d.mapping.robust.pieces import FOLLOWED
from lrf3d.mapping.robust.rays import add_beams
from lrf3d.mapping.robust.refitting import Parts, refit_walls
from lrf3d.mapping.robust.walls import (
    Walls,
    count_evidence,
    end_of,
    give_back,
    marked_rows,
    near,
    put_line,
    put_row,
    take_row,
    vector_of,
    widen_box,
)

Place = tuple[float, float]


class RobustMapper:
    """Maps with the most likely walls, fitted to all points, by the evidence of all beams.

    A wall is shown once it has the least number of hits.
    """

    def __init__(
        self, extract: LikelihoodExtractor, length: float, distance: float, least: int
    ) -> None:
        self._extract = extract
        self._least = least
        self.local_map = extract.local_map
        self._rule = MergeRule(length, distance, BEND * distance, MOST_EXPLAINED)
        self._noise = NoiseEstimate(extract.floor)
        self._optics = Optics()
        self._cells = Cells.of_size(LEAST)
        self._walls = Walls.of_size(LEAST)
        # Rows of walls that were added or moved by the last update, and may now merge with others.
        self._waiting = np.empty(0, np.int64)
        # Frame of the map, the pose of the first scan: the map moves with the world.
        self._frame: Pose | None = None
        self._map: LineMap | None = None

    def update(self, scan: LaserScan) -> None:
        """Update the map with a scan."""
        self._map = None
        if self._frame is None:
            self._frame = scan.pose
        place, heading = pose_in(self._frame, scan)
        noise = self._noise.update(scan, self._extract.noise(scan))
        # Images in mirrors are not walls. Optics gets the whole scan: they show where mirrors are.
        whole = scan
        scan = self._optics.without_images(scan, place, heading)
        found = self._extract.walls(scan, heading, noise)
        # An uncertain pose makes all walls of a scan uncertain.
        widen(found.fits, scan)
        # Reserve rows for new walls: their arrays must not move before the refit.
        self._walls = self._walls.with_room(len(found.ends))
        unowned = self._add_beams(Beams.of(scan, heading, noise), place)
        segments = self._walls.ends[self._shown_rows()]
        own = noise, found.ends, segments, self._cells, self._walls
        self._optics.update(whole, (*place, heading), *own)
        walls = self._walls
        cells = self._cells
        tolerance = self._rule.distance
        merged, gone = merge_walls(walls, found, place, self._waiting, cells, self._rule)
        rows = walls_to_refit(walls, cells, unowned, merged, tolerance)
        parts = refit_walls(rows, walls, cells, tolerance, self._least)
        ends, *_ = parts
        self._walls = walls.with_room(len(ends))
        self._waiting = replace_walls(self._walls, cells, rows, gone, parts)
        link_walls(self._walls, cells, self._waiting)

    def _add_beams(self, beams: Beams, place: Place) -> Int:
        """Add the beams to the cells.

        Returns the clusters (beams,) that beams hit but no wall owns. Only the first of them are
        filled in: as many as the counter `unowned` of the walls says.
        """
        counters = self._walls.counters
        count = len(beams.ranges)
        unowned = np.empty(count, np.int64)
        counters["scan"] += 1
        counters["changed"] = counters["unowned"] = 0
        while not open_squares(self._cells, place, beams):
            self._cells = self._cells.enlarged()
        done = 0
        while (done := add_beams(self._cells, done, place, beams, self._walls, unowned)) < count:
            self._cells = self._cells.enlarged()
        return unowned

    def _shown_rows(self) -> Int:
        """The rows of the walls that the map shows."""
        fits = self._walls.fits
        return np.flatnonzero(fits["shown"] & (fits["points"] > 0))

    @property
    def map(self) -> LineMap:
        """The global map as it is now."""
        if self._frame is None:
            return LineMap.empty()
        if self._map is None:
            rows = self._shown_rows()
            objects = find_objects(self._walls, rows)
            ends: Float = close_corners(self._walls.ends[rows], objects)
            shown = solid_map(
                in_world(self._frame, ends), objects, self._walls.fits["points"][rows]
            )
            surfaces = self._optics.surfaces
            special = in_world(self._frame, surfaces[:, :4])
            self._map = with_surfaces(shown, special, surfaces[:, 4] > 0.0)
        return self._map


@compiled
def walls_to_refit(walls: Walls, cells: Cells, unowned: Int, merged: Int, tolerance: float) -> Int:
    """The rows (n,) of the walls to refit, rising.

    Those that are new or merged (m,), those with much new evidence, and one more in turn: a wall
    does not notice what it lost to its neighbours.
    """
    _count_unowned_hits(walls, cells, unowned, tolerance)
    counters = walls.counters[0]
    marks = np.zeros(counters.taken, np.bool_)
    for k in range(len(merged)):
        marks[merged[k]] = True
    # [share] New evidence after which a wall is refit, relative to that of its last fit. Less takes
    # time, more leaves walls outdated.
    fresh_share = 0.1
    for k in range(counters.changed):
        wall = walls.changed[k]
        if walls.rows[wall].fresh >= fresh_share * walls.fits[wall].evidence:
            marks[wall] = True
    for _ in range(counters.taken):
        counters.refit = (counters.refit + 1) % counters.taken
        if walls.fits[counters.refit].points > 0:
            marks[counters.refit] = True
            break
    return marked_rows(walls, marks)


@inner
def _count_unowned_hits(walls: Walls, cells: Cells, unowned: Int, tolerance: float) -> None:
    """Count hits that no wall owns as new evidence of the walls that may reach them."""
    point = np.empty(4)
    for k in range(walls.counters[0].unowned):
        cluster = cells.clusters[unowned[k]]
        if cluster.hits == 0.0:
            # Its returns were images in a mirror, which have been deleted.
            continue
        x = cluster.x
        y = cluster.y
        put_line(point, x, y, x, y)
        off = tolerance + HIT_DEVIATIONS * np.sqrt(cluster.hits / cluster.weight)
        for i in range(near(walls, point, FOLLOWED + off)):
            ends = walls.ends[walls.found[i]]
            ux, uy = vector_of(ends)
            x1, y1 = end_of(ends, 0)
            size = np.hypot(ux, uy)
            along = ((x - x1) * ux + (y - y1) * uy) / size
            aside = ((y - y1) * ux - (x - x1) * uy) / size
            if abs(aside) <= off and -FOLLOWED <= along <= size + FOLLOWED:
                count_evidence(walls, walls.found[i], 1.0)


@compiled
def replace_walls(walls: Walls, cells: Cells, rows: Int, gone: Int, parts: Parts) -> Int:
    """Replace walls (n,), and those (m,) that were merged into them, by their parts.

    Returns the rows of the walls that are new or have moved: they are to be linked, and may now
    merge with others.
    """
    ends, fits, _, _ = parts
    old = np.concatenate((rows, gone))
    taken = np.zeros(len(old), np.bool_)
    places = np.full(len(ends), -1)
    for part in range(len(ends)):
        if fits[part].shown:
            place = _unmoved(walls, old, taken, ends[part])
            if place >= 0:
                taken[place] = True
                places[part] = old[place]
    for k in range(len(old)):
        if not taken[k]:
            give_back(walls, old[k])
    fresh = np.empty(len(ends), np.int64)
    added = 0
    for part in range(len(ends)):
        moved = places[part] < 0
        row = places[part] = take_row(walls) if moved else places[part]
        put_row(walls.ends, row, ends[part])
        walls.fits[row] = fits[part]
        walls.rows[row].fresh = 0.0
        widen_box(walls, row)
        if moved and fits[part].shown:
            fresh[added] = row
            added += 1
            put_row(walls.placed, row, ends[part])
    _assign_clusters(walls, cells, parts, places)
    return fresh[:added]


@borrower
def _assign_clusters(walls: Walls, cells: Cells, parts: Parts, rows: Int) -> None:
    """Give the clusters of parts to the rows (n,) of these; clusters of no part become free."""
    _, _, clusters, owners = parts
    for k in range(len(clusters)):
        cluster = cells.clusters[clusters[k]]
        part = owners[k]
        cluster.owner_version = 0
        if part >= 0:
            cluster.owner = rows[part]
            cluster.owner_version = walls.rows[rows[part]].version


@borrower
def _unmoved(walls: Walls, old: Int, taken: Bool, ends: Float) -> int:
    """The index of the nearest former wall whose row a part may keep; −1 if it has moved."""
    # [m] A part within this distance of a linked wall keeps its row and links. Ends move by pieces
    # of 0.1 m. Less takes time.
    unchanged = 0.15
    best = -1
    least = unchanged
    for place in range(len(old)):
        apart = 0.0
        for side in range(4):
            apart = max(apart, abs(ends[side] - walls.placed[old[place], side]))
        if apart < least and not taken[place]:
            best = place
            least = apart
    return best
