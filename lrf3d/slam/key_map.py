"""Key map: the map of key scans, which is drawn again where their poses have moved.

Key scans and their poses enter as the drive goes on; the map leaves whenever it is read. A mapper
cannot take a scan out of its map. So when closed loops move key scans, all are mapped again in
their new places behind the scenes, a few after each scan. The last complete drawing is shown until
then: on a long drive it is some seconds behind.
"""

from collections.abc import Callable

import numpy as np

from lrf3d.geometry import Float
from lrf3d.laser import LaserScan
from lrf3d.mapping import LineMap, LineMapper

REDRAWN = 0.02
"""The map is drawn again once a key scan has moved by more than this [m]."""

EACH_SCAN = 2
"""Key scans that are mapped again after each scan, as long as there are any: that takes as long as
following the robot does."""


class _Drawing:
    """A mapper, and the poses (k, 3) at which it takes in the key scans, by their numbers."""

    def __init__(self, poses: Float) -> None:
        self.mapper = LineMapper()
        self.poses = poses
        self.planned = 0
        self.done = 0


class KeyMap:
    """The map of key scans at poses that move; nothing is mapped before the map is read.

    ``placed(number, pose)`` is a key scan with the pose of its laser in the world, where the robot
    is at a pose (3,) since the start.
    """

    def __init__(self, placed: Callable[[int, Float], LaserScan]) -> None:
        self._placed = placed
        self._shown = _Drawing(np.empty((0, 3)))
        self._next: _Drawing | None = None

    def update(self, poses: Float) -> None:
        """Take in the current poses (k, 3) of all key scans since the start, after each scan."""
        for drawing in (self._shown, self._next):
            if drawing is not None:
                drawing.poses = np.concatenate([drawing.poses, poses[len(drawing.poses) :]])
        self._shown.planned = len(poses)
        if self._next is None and (np.abs(self._shown.poses - poses)[:, :2] > REDRAWN).any():
            self._next = _Drawing(poses.copy())
        if self._next is not None:
            self._next.planned += EACH_SCAN
            if self._next.planned >= len(poses):
                self._next.planned = len(poses)
                self._shown, self._next = self._next, None

    def redraw(self, poses: Float) -> None:
        """Draw everything again at poses (k, 3)."""
        self._shown, self._next = _Drawing(poses.copy()), None
        self._shown.planned = len(poses)

    def map(self) -> LineMap:
        """The map as it is now."""
        drawing = self._shown
        for number in range(drawing.done, drawing.planned):
            drawing.mapper.update(self._placed(number, drawing.poses[number]))
        drawing.done = drawing.planned
        return drawing.mapper.map
