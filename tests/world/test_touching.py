import numpy as np

from lrf3d.world import World
from lrf3d.world.touching import connected, joined_objects


def test_walls_that_touch_are_one_object_also_far_from_the_origin():
    segments = np.array([[0, 0, 4, 0], [2, 0, 2, 3], [2, 3.1, 2, 5], [9, 9, 8, 9]]) + 1e6
    assert connected(segments).tolist() == [0, 0, 1, 2]


def test_objects_that_touch_count_as_one_by_their_lowest_number():
    # 3 and 1 touch; 2 lies apart, in two pieces of which one touches nothing; 4 touches 2.
    segments = [[0, 0, 4, 0], [2, 0, 2, 3], [9, 9, 8, 9], [20, 0, 21, 0], [8, 9, 8, 5]]
    world = World(segments, objects=[3, 1, 2, 2, 4])
    assert joined_objects(world).tolist() == [1, 1, 2, 2, 2]
