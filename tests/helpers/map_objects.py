"""The map of some scans, and the objects of walls by what beams show of them."""

import numpy as np

from lrf3d import LineMapper, PlanarCaster
from lrf3d.laser import LaserRangeFinder, ProportionalNoise, RangeNoise
from lrf3d.mapping.robust.beams import Beams
from lrf3d.mapping.robust.cells import LEAST, Cells, open_squares
from lrf3d.mapping.robust.links import find_objects, link_walls
from lrf3d.mapping.robust.rays import add_beams
from lrf3d.mapping.robust.walls import Walls

CIRCLE = LaserRangeFinder(angle_min=-np.pi, angle_max=np.pi, beams=361, range_max=30.0)


def scans_of(world, poses, lrf=CIRCLE, sigma=0.0):
    """The scans from some poses, with noise in proportion to the range."""
    caster, rng = PlanarCaster(world), np.random.default_rng(0)
    return [ProportionalNoise(sigma)(caster.cast(lrf, pose), rng) for pose in poses]


def map_of(scans, mapper=None):
    """The map of some scans, of the default mapper if none is given."""
    mapper = LineMapper() if mapper is None else mapper
    for scan in scans:
        mapper.update(scan)
    return mapper.map


def objects_of(ends, cells):
    """The object (n,) of each of some walls (n, 4)."""
    walls, rows = Walls.of_size(LEAST), np.arange(len(ends))
    walls.ends[rows], walls.fits["points"][rows], walls.fits["shown"][rows] = ends, 9, True
    walls.counters["taken"] = len(ends)
    walls.boxes[0] = -1e9, -1e9, 1e9, 1e9
    link_walls(walls, cells, rows)
    return find_objects(walls, rows)


def cells_of(scans, floor=1e-4, cells=None):
    """The cells of some scans, with or after those of others."""
    cells = Cells.of_size(LEAST) if cells is None else cells
    for scan in scans:
        beams = Beams.of(scan, float(scan.pose.theta), RangeNoise(floor, 0.0))
        place, walls = (float(scan.pose.x), float(scan.pose.y)), Walls.of_size(LEAST)
        while not open_squares(cells, place, beams):
            cells = cells.enlarged()
        done, unowned = 0, np.empty(len(beams.ranges), np.int64)
        while (done := add_beams(cells, done, place, beams, walls, unowned)) < len(unowned):
            cells = cells.enlarged()
    return cells
