import numpy as np
import pytest

import lrf3d
from lrf3d.pose import Pose
from lrf3d.slam.key_map import EACH_SCAN, KeyMap

LASER = lrf3d.LaserRangeFinder(beams=91, range_max=8.0)
WALLS = [[0, 0, 40, 0], [40, 0, 40, 3], [40, 3, 0, 3], [0, 3, 0, 0]]
TRUE = np.array([[0.5 + 0.5 * k, 1.5 + 0.3 * (-1) ** k, 0.3 * (-1) ** k] for k in range(76)])


@pytest.fixture(scope="module")
def scans():
    caster = lrf3d.EmbreeCaster(lrf3d.World(WALLS))
    return [caster.cast(LASER, pose) for pose in TRUE]


def placing(scans, taken):
    """Places key scans, and notes which were."""

    def placed(number, pose):
        taken.append(number)
        return lrf3d.LaserScan(Pose(*pose), scans[number].angles, scans[number].ranges)

    return placed


def bent(true):
    """The same poses, bent to the side more and more."""
    drifted = true.copy()
    drifted[:, 1] += 0.02 * true[:, 0]
    return drifted


def farthest_off(line_map):
    """How far segments are off all walls at most [m]."""
    share = np.linspace(0.0, 1.0, 50)[:, None, None]
    ends = line_map.segments.reshape(-1, 2, 2)
    x, y = ((1.0 - share) * ends[:, 0] + share * ends[:, 1]).reshape(-1, 2).T
    return np.min([np.abs(x), np.abs(40 - x), np.abs(y), np.abs(3 - y)], axis=0).max()


def test_after_a_loop_the_map_is_drawn_again_but_not_too_often(scans):
    taken, drawn = [], KeyMap()
    placed = placing(scans, taken)
    for count in range(1, len(scans) + 1):
        drawn.update(bent(TRUE)[:count])
    assert taken == []
    assert farthest_off(drawn.map(placed)) > 0.5
    drawn.update(TRUE)
    assert farthest_off(drawn.map(placed)) < 0.05
    taken.clear()
    for _ in range(len(scans) // EACH_SCAN - 1):
        drawn.update(bent(TRUE))
        assert farthest_off(drawn.map(placed)) < 0.05 and taken == []
    drawn.update(bent(TRUE))
    assert farthest_off(drawn.map(placed)) > 0.5
    assert taken == list(range(len(scans)))


def test_the_map_does_not_depend_on_when_it_is_read(scans):
    often, seldom, placed = KeyMap(), KeyMap(), placing(scans, [])
    for drawn in (often, seldom):
        for poses in [bent(TRUE)[:count] for count in range(1, len(scans))] + [TRUE] * 50:
            drawn.update(poses)
            if drawn is often:
                drawn.map(placed)
    assert often.map(placed).segments.tolist() == seldom.map(placed).segments.tolist()
