"""A controller of your own: a robot that keeps the wall at its right hand.

    lrf3d run corridor --controller examples/wall_follower.py:WallFollower --scans 1500

A controller is anything with ``command(time, pose, scan) -> (v, w)``. This one looks at its scan
alone: it never asks where it is.
"""

import numpy as np


class WallFollower:
    """Drives along walls at a distance, the wall on the right.

    Args:
        distance: How far from the wall to drive [m].
        speed: Speed where all is free ahead [m/s].
    """

    def __init__(self, distance: float = 0.7, speed: float = 0.8) -> None:
        self.distance, self.speed = distance, speed
        self.lost = None

    def command(self, time, pose, scan):
        """Speed [m/s] and turn rate [rad/s] up to the next scan."""
        # No return is as good as far away, and what is too near to be measured is at the hull.
        ranges = np.where(scan.ranges == -np.inf, 0.0, np.minimum(scan.ranges, scan.range_max))
        # What is nearest, on the right and ahead: the wall to follow, or the next one.
        side = scan.angles < np.radians(45.0)
        nearest = int(np.argmin(np.where(side, ranges, np.inf)))
        away, bearing = ranges[nearest], scan.angles[nearest]
        if away > 1.7 * self.distance:
            return self.search(time)
        self.lost = None
        # Along the wall is a quarter turn left of it; lean towards it or off as the distance asks.
        lean = np.clip(1.2 * (away - self.distance), -0.8, 0.8)
        turn = np.clip(2.5 * (bearing + np.pi / 2 - lean), -1.5, 1.5)
        ahead = ranges[np.abs(scan.angles) < np.radians(30.0)].min()
        free = np.clip((ahead - 0.5 * self.distance) / self.distance, 0.0, 1.0)
        # It drives slowly where it turns, so that corners are rounded closely.
        return self.speed * free * (1.0 - 0.6 * abs(turn) / 1.5), turn

    def search(self, time):
        """Where a wall ends it goes on round its corner, at the right; if not, straight ahead."""
        self.lost = time if self.lost is None else self.lost
        v = 0.6 * self.speed
        once_round = 2.0 * np.pi * self.distance / v
        return v, (-v / self.distance if time - self.lost < once_round else 0.0)
