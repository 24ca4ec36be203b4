import numpy as np

from lrf3d.casting import PlanarCaster
from lrf3d.laser import LaserRangeFinder
from lrf3d.slam import Slam
from lrf3d.slam.front_end import FrontEnd
from lrf3d.slam.surface import thinned
from lrf3d.world import World

WORLD = World([[0, 0, 6, 0], [6, 0, 6, 4], [6, 4, 0, 4], [0, 4, 0, 0], [50, 0, 50, 9]])


def test_a_lost_scan_adds_what_it_saw_itself_to_the_local_map():
    """It is not where the map shows anything: the next scan can be matched with it alone."""
    front, slam = FrontEnd(), Slam()
    poses = (3.0, 2.0, 0.0), (3.2, 2.0, 0.0), (44.0, 4.0, 0.0)
    scans = [
        slam.sight.seen(PlanarCaster(WORLD).cast(LaserRangeFinder(range_max=10.0), pose))
        for pose in poses
    ]
    steps = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [40.8, 2.0, 0.0]])
    for scan, step in zip(scans, steps, strict=True):
        placed = front.track(scan, step)
        key = front.key(scan)
        if scan is scans[0]:
            front.add_key(key)
    assert not placed.matched
    assert np.array_equal(key.walls, thinned(scans[2].surface))
