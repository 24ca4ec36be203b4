"""The small runs of the tests are right themselves."""

import numpy as np

from lrf3d.laser import LaserRangeFinder
from lrf3d.world import World
from synthetic_run import cast


def test_the_brute_force_rays_of_these_tests_are_right():
    world = World(np.array([[2.0, -1.0, 2.0, 1.0], [1.0, 5.0, 1.0, 9.0]]))
    lrf = LaserRangeFinder(0.0, np.pi / 2, 2)
    ranges, walls = cast(world, lrf, np.array([0.0, 0.0, 0.0]))
    assert ranges.tolist() == [2.0, np.inf]
    assert walls.tolist() == [0, -1]
