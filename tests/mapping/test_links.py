import numpy as np
import pytest
from map_objects import objects_of

from lrf3d import LaserRangeFinder, PlanarCaster, World
from lrf3d.laser import RangeNoise
from lrf3d.mapping.robust.beams import Beams
from lrf3d.mapping.robust.constants import MOST_LINKS
from lrf3d.mapping.robust.evidence_grid import EvidenceGrid
from lrf3d.mapping.robust.object_groups import ObjectGroups
from lrf3d.mapping.robust.segment_pool import Change, NewSegments, SegmentPool

CIRCLE = LaserRangeFinder(angle_min=-np.pi, angle_max=np.pi, beams=361, range_max=30.0)

WALL = [-5, 0, 5, 0.0]
"""A wall that is seen from above, as all that lie along x to the right are."""

FAR_OFF = ([[90.0, 50.0, 90.0, 51.0]], [(80.0, 50.0, 0.0)])
"""Walls and poses whose beams tell nothing of what lies near the origin."""


NOISE = RangeNoise(0.01, 0.0)


def look(grid, world, poses, lrf=CIRCLE):
    caster = PlanarCaster(World(np.array(world, dtype=np.float64)))
    for pose in poses:
        scan = caster.cast(lrf, pose)
        grid.add(Beams.of(scan, scan.pose.theta, NOISE), pose[:2])


def objects(walls, world, poses, lrf=CIRCLE):
    grid = EvidenceGrid()
    look(grid, world, poses, lrf)
    return len(set(objects_of(walls, grid.cells)))


@pytest.mark.parametrize("depth", [0.6, 1.0, 2.5])
def test_what_stands_before_a_wall_that_goes_on_behind_it_is_no_part_of_it(depth):
    assert objects([WALL, [-1, depth, 1, depth]], *FAR_OFF) == 2
    # Where the wall may end behind it, and was seen no farther, it may be a corner.
    assert objects([[-5, 0, -0.9, 0], [-1, depth, 1, depth]], *FAR_OFF) == 1


def test_what_abuts_on_a_wall_is_of_one_object_with_it():
    assert objects([WALL, [-1, 0.3, 1, 0.3]], *FAR_OFF) == 1
    # It may also go on to it unseen.
    assert objects([WALL, [0.2, 2, 0, 6]], *FAR_OFF) == 1


def test_no_link_leads_through_the_face_of_a_wall():
    thin = [WALL, [5, -0.2, -5, -0.2]]
    assert objects(thin, *FAR_OFF) == 1
    assert objects([*thin, [-1, 1, 1, 1]], *FAR_OFF) == 2


def test_walls_that_cross_are_of_one_object():
    assert objects([WALL, [1, -3, 0.5, 3]], *FAR_OFF) == 1


def test_faces_beside_a_niche_that_was_looked_into_need_what_was_seen_in_it():
    niche = [[-3, 0, -1, 0], [-1, 0, -1, -0.8], [-1, -0.8, 1, -0.8], [1, -0.8, 1, 0], [1, 0, 3, 0]]
    faces, poses = [niche[0], niche[4]], [(x, 2.0, 0.0) for x in (-1, 0, 1)]
    assert objects(faces, niche, poses) == 2
    assert objects(niche, niche, poses) == 1
    # Nobody looked, so that it may as well be a wall.
    assert objects(faces, niche, [(-6.0, 0.05, 0.0)]) == 1


@pytest.mark.parametrize("pose, number", [((-2, 0.6, -0.15), 2), ((8, 0.6, np.pi + 0.15), 2),
                                          ((-2, 0.06, 0), 1), ((8, 0.06, np.pi), 1)])  # fmt: skip
def test_beams_that_cross_a_link_at_a_small_angle_part_what_it_joins(pose, number):
    # Those that run before it go through its cells, too.
    walls = [[-5, 0, 0, 0], [6, 0, 12, 0]]
    fan = LaserRangeFinder(angle_min=-0.001, angle_max=0.001, beams=5, range_max=30.0)
    room = [[20, -9, 20, 9], [-20, -9, -20, 9]]
    assert objects(walls, room, [pose], fan) == number


def test_objects_come_apart_when_beams_cross_the_link_that_held_them_together():
    walls = np.array([[-5, 0, 0, 0], [6, 0, 12, 0.0]])
    pool, groups, grid = SegmentPool(), ObjectGroups(), EvidenceGrid()
    new = NewSegments(walls, np.ones((2, 6)), np.full(2, 9), np.arange(2))
    rows = pool.add(new, 2)
    none = rows[:0]
    groups.update(pool, Change(none, rows, none, none), grid.cells, NOISE)
    assert len(set(groups.labels[rows])) == 1
    look(grid, [[-9, -3, 15, -3]], [(3, 3, 0)])
    # Nothing is new of the walls themselves.
    groups.update(pool, Change(none, none, none, none), grid.cells, NOISE)
    assert len(set(groups.labels[rows])) == 2


def test_a_wall_among_many_is_linked_with_the_nearest_of_them():
    # Short walls in a row aslant: so many that the farthest of them get no link with the last one.
    place = 0.14 * np.arange(61.0)[:, None]
    walls = np.hstack([place, place, place + 0.07, place + 0.07])[::-1]
    pool, groups = SegmentPool(), ObjectGroups()
    rows = pool.add(NewSegments(walls, np.ones((61, 6)), np.full(61, 9), np.arange(61)), 61)
    none = rows[:0]
    groups.update(pool, Change(none, rows[:60], none, none), EvidenceGrid().cells, NOISE)
    links = groups._groups.links
    before = int(links.used[0])
    groups.update(pool, Change(none, rows[60:], none, none), EvidenceGrid().cells, NOISE)
    links = groups._groups.links
    linked = links.pairs[before : links.used[0]].min(axis=1)
    assert sorted(linked.tolist()) == rows[60 - MOST_LINKS : 60].tolist()
