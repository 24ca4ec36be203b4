import numpy as np

from lrf3d.casting import PlanarCaster
from lrf3d.laser import LaserRangeFinder
from lrf3d.pose import between
from lrf3d.slam import Slam
from lrf3d.slam.views import Fan, Key, evidence, views_of
from lrf3d.world import World


def test_what_the_other_saw_is_passed_hidden_out_of_view_or_hit():
    angles = np.linspace(-0.5, 0.5, 11)
    ranges = np.full(11, 4.0)
    points = np.array([[2.0, 0.0], [4.2, 0.0], [3.8, 0.3], [2.0, 30.0], [4.0, 0.1]])
    nothing = np.empty((0, 4))
    hits = nothing[:, :2]
    key = Key(0, np.zeros(3), nothing, nothing, hits, (Fan(np.zeros(2), angles, ranges),), 0.01)
    assert views_of(points, np.zeros((1, 3)), [key]).tolist() == [[2, 1, 1, 0, 3]]


def test_a_wall_that_beams_run_along_is_out_of_view():
    """Where the laser stands in the plane of a thin wall, its beams pass beside the wall."""
    beams = np.linspace(-0.5, 0.5, 11), np.full(11, 9.0)
    nothing = np.empty((0, 4))
    key = Key(0, np.zeros(3), nothing, nothing, nothing[:, :2], (Fan(np.zeros(2), *beams),), 0.01)
    along, across, post = [4.0, 0.1, 0.0, 1.0], [4.0, 0.1, -1.0, 0.0], [4.0, 0.1, 0.0, 0.0]
    assert views_of(np.array([along, across, post]), np.zeros((1, 3)), [key]).tolist() == [
        [0, 2, 2]
    ]


def test_most_speaks_for_the_right_place_even_where_little_is_explained():
    """Of trunks and bushes matching explains nothing."""
    rng = np.random.default_rng(0)
    trunks = rng.uniform([2.0, -6.0], [12.0, 6.0], (30, 2))
    world = World(np.hstack([trunks, trunks + np.array([0.0, 0.1])]))
    slam, lrf = Slam(), LaserRangeFinder(beams=721)
    poses = np.array([[0.0, 0.0, 0.0], [0.5, 0.2, 0.3]])
    old, new = (slam.sight.seen(PlanarCaster(world).cast(lrf, tuple(pose))) for pose in poses)
    true = between(poses[0], poses[1])
    right = evidence(new.hits, 0.0, true[None], [old])
    for off in ([0.4, 0.0, 0.0], [0.0, -0.4, 0.0], [0.0, 0.0, 0.15], [-1.0, 1.0, -0.3]):
        assert right > evidence(new.hits, 0.0, (true + off)[None], [old]) + 1.0
