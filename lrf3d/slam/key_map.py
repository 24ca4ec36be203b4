"""Key map: the map of key scans, drawn again where closed loops have moved them.

Poses of the key scans enter after each scan; the map leaves whenever it is read. A mapper cannot
take a scan out of its map: once key scans have moved, all are mapped again.
"""

from collections.abc import Callable, Iterable

import numpy as np

from lrf3d.geometry import Float
from lrf3d.laser import LaserScan
from lrf3d.mapping import LineMap, LineMapper

MOVED = 0.02
"""The map is drawn again once a key scan has moved by more than this [m]."""

EACH_SCAN = 2
"""Key scans that may be drawn again for each scan, on average: that takes as long as following the
robot does. On a long drive the map is some seconds behind the poses."""


class KeyMap:
    """The map of key scans at poses that move; nothing is mapped before the map is read."""

    def __init__(self) -> None:
        self.redraw(np.empty((0, 3)))

    def redraw(self, poses: Float) -> None:
        """Draw everything again at poses (k, 3)."""
        self._mapper, self._poses = LineMapper(), poses.copy()
        # Key scans that are in the map, and that could have been drawn again since.
        self._drawn = self._spare = 0

    def update(self, poses: Float) -> None:
        """Take in the poses (k, 3) of all key scans, after each scan."""
        known = len(self._poses)
        self._spare += EACH_SCAN
        moved = np.abs(poses[:known] - self._poses)[:, :2].max(initial=0.0) > MOVED
        if moved and self._spare >= known:
            self.redraw(poses)
        else:
            self._poses = np.concatenate([self._poses, poses[known:]])

    def map(self, placed: Callable[[int, Float], Iterable[LaserScan]]) -> LineMap:
        """The map now; ``placed(number, pose)`` are key scans as seen from a pose (3,)."""
        for number in range(self._drawn, len(self._poses)):
            for scan in placed(number, self._poses[number]):
                self._mapper.update(scan)
        self._drawn = len(self._poses)
        return self._mapper.map
