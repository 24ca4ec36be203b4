import numpy as np
import pytest

from lrf3d.slam import key_map
from lrf3d.slam.key_map import EACH_SCAN, KeyMap

POSES = np.column_stack([np.arange(20.0), np.zeros(20), np.zeros(20)])
MOVED = np.add(POSES, [0.0, 0.5, 0.0])


class Drawn:
    """A mapper whose map is the list of what it took in."""

    def __init__(self):
        self.map = []

    def update(self, scan):
        self.map.append(scan)


@pytest.fixture(autouse=True)
def drawn(monkeypatch):
    monkeypatch.setattr(key_map, "LineMapper", Drawn)


def drawing(key_map):
    """The key scans in a map, by number and y."""
    return key_map.map(lambda number, pose: [(number, pose[1])])


def test_after_a_loop_the_map_is_drawn_again_but_not_too_often():
    keys = KeyMap()
    for count in range(1, len(POSES) + 1):
        keys.update(POSES[:count])
    assert drawing(keys) == [(number, 0.0) for number in range(20)]
    keys.update(MOVED)
    assert drawing(keys) == [(number, 0.5) for number in range(20)]
    for _ in range(len(POSES) // EACH_SCAN - 1):
        keys.update(POSES)
        assert drawing(keys)[0] == (0, 0.5)
    keys.update(POSES)
    assert drawing(keys) == [(number, 0.0) for number in range(20)]


def test_the_map_does_not_depend_on_when_it_is_read():
    often, seldom = KeyMap(), KeyMap()
    for keys in (often, seldom):
        for poses in [POSES[:count] for count in range(1, 20)] + [MOVED] * 20:
            keys.update(poses)
            if keys is often:
                drawing(keys)
    assert drawing(often) == drawing(seldom)
