import numpy as np
import pytest

import lrf3d
from lrf3d.pose import Pose
from lrf3d.slam.key_map import AT_ONCE, EACH_SCAN, KeyMap

LASER = lrf3d.LaserRangeFinder(beams=91, range_max=8.0)
WALLS = [[0, 0, 40, 0], [40, 0, 40, 3], [40, 3, 0, 3], [0, 3, 0, 0]]
TRUE = np.array([[0.5 + 0.5 * k, 1.5 + 0.3 * (-1) ** k, 0.3 * (-1) ** k] for k in range(76)])


@pytest.fixture(scope="module")
def scans():
    caster = lrf3d.EmbreeCaster(lrf3d.World(WALLS))
    return [caster.cast(LASER, pose) for pose in TRUE]


def key_map(scans, taken):
    def placed(number, pose):
        taken.append(number)
        return lrf3d.LaserScan(Pose(*pose), scans[number].angles, scans[number].ranges)

    return KeyMap(placed, np.zeros(3))


def bent(true):
    """The same poses, bent to the side more and more."""
    drifted = true.copy()
    drifted[:, 1] += 0.02 * true[:, 0]
    return drifted


def farthest_off(line_map, near=None):
    """How far segments are off all walls at most [m], around a place (x) or anywhere."""
    share = np.linspace(0.0, 1.0, 50)[:, None, None]
    ends = line_map.segments.reshape(-1, 2, 2)
    points = ((1.0 - share) * ends[:, 0] + share * ends[:, 1]).reshape(-1, 2)
    if near is not None:
        points = points[np.abs(points[:, 0] - near) < 3.0]
    x, y = points.T
    off = np.min([np.abs(x), np.abs(40 - x), np.abs(y), np.abs(3 - y)], axis=0)
    return off.max()


def test_after_a_loop_the_map_is_right_around_the_robot_at_once_and_everywhere_soon(scans):
    taken = []
    drawn = key_map(scans, taken)
    wrong = bent(TRUE)
    for count in range(1, len(scans) + 1):
        drawn.update(wrong[:count], wrong[count - 1])
        drawn.go_on()
    assert farthest_off(drawn.map()) > 0.5
    taken.clear()
    drawn.update(TRUE, TRUE[-1])
    drawn.go_on()
    line_map = drawn.map()
    assert len(taken) == AT_ONCE
    assert farthest_off(line_map, near=36.0) < 0.05
    # Elsewhere the old walls have moved with their key scans.
    assert farthest_off(line_map) < 0.3
    rest = 0
    while len(taken) < len(scans):
        before = len(taken)
        drawn.update(TRUE, TRUE[-1])
        drawn.go_on()
        drawn.map()
        assert 0 < len(taken) - before <= EACH_SCAN
        rest += 1
    assert rest < len(scans)
    assert sorted(taken) == list(range(len(scans)))
    assert farthest_off(drawn.map()) < 0.05


def test_the_map_does_not_depend_on_when_it_is_read(scans):
    often, seldom = key_map(scans, []), key_map(scans, [])
    wrong = bent(TRUE)
    for drawn in (often, seldom):
        for count in range(1, len(scans)):
            drawn.update(wrong[:count], wrong[count - 1])
            drawn.go_on()
            if drawn is often:
                drawn.map()
        for _ in range(5):
            drawn.update(TRUE, TRUE[-1])
            drawn.go_on()
            if drawn is often:
                drawn.map()
    assert often.map().segments.tolist() == seldom.map().segments.tolist()


def test_nothing_is_mapped_before_the_map_is_read(scans):
    taken = []
    drawn = key_map(scans, taken)
    drawn.update(TRUE[:5], TRUE[4])
    drawn.go_on()
    drawn.redraw(TRUE[:5])
    assert taken == []
    assert len(drawn.map()) > 0 and taken == [0, 1, 2, 3, 4]
