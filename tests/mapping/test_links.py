import numpy as np
import pytest
from map_objects import objects_of

from lrf3d import LaserRangeFinder, PlanarCaster, World
from lrf3d.laser import RangeNoise
from lrf3d.mapping.robust.beams import Beams
from lrf3d.mapping.robust.evidence_grid import EvidenceGrid

CIRCLE = LaserRangeFinder(angle_min=-np.pi, angle_max=np.pi, beams=361, range_max=30.0)

WALL = [-5, 0, 5, 0.0]
"""A wall that is seen from above, as all that lie along x to the right are."""

FAR_OFF = ([[90.0, 50.0, 90.0, 51.0]], [(80.0, 50.0, 0.0)])
"""Walls and poses whose beams tell nothing of what lies near the origin."""


def objects(walls, world, poses):
    grid, noise = EvidenceGrid(), RangeNoise(0.01, 0.0)
    caster = PlanarCaster(World(np.array(world, dtype=np.float64)))
    for pose in poses:
        scan = caster.cast(CIRCLE, pose)
        grid.add(Beams.of(scan, scan.pose.theta, noise), pose[:2])
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
