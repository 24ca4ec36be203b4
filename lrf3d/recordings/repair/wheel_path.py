"""WheelPath: the path of a robot by its odometry, straight between the lines of the log."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.geometry.lines import Float
from lrf3d.geometry.pose import between


class WheelPath:
    """The path through poses (n, 3), straight between the lines of the log.

    The interval is the usual time between two lines [s], 0 if it is not known.
    """

    def __init__(self, poses: Float, interval: float = 0.0) -> None:
        self.interval = interval
        self._whole = poses.copy()
        self._whole[:, 2] = np.unwrap(poses[:, 2])

    @property
    def stands(self) -> bool:
        """Whether the odometry never moves."""
        return not np.ptp(self._whole, axis=0).any()

    def at(self, places: NDArray[Any]) -> Float:
        """Poses (k, 3) at fractional places (k,) between the lines; headings are not wrapped."""
        number = np.arange(len(self._whole), dtype=np.float64)
        last = max(len(self._whole) - 1, 0)
        poses = np.column_stack([np.interp(places, number, values) for values in self._whole.T])
        if last:
            # Beyond the first and the last line the motion next to it is extrapolated.
            beyond = np.array([np.minimum(places, 0.0), np.maximum(places - last, 0.0)])
            poses += beyond.T @ np.diff(self._whole, axis=0)[[0, -1]]
        return poses

    def increments(self, places: NDArray[Any]) -> Float:
        """How the robot moved (k, 3) to each of the places (k,) from the one before."""
        poses = self.at(places)
        return np.vstack([np.zeros(3), between(poses[:-1], poses[1:])])
