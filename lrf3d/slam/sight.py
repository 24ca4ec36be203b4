"""Sight: what the lasers of a robot saw at one moment, as a key scan at the origin.

Scans enter; the surfaces, walls, hits and fans by which places are recognised leave. The noise of
the ranges is learnt on the way.
"""

from collections.abc import Sequence

import numpy as np

from lrf3d.geometry import Float
from lrf3d.laser import LaserScan
from lrf3d.laser.range_finder import CENTRE, beam_directions
from lrf3d.laser.unrolling import unrolled
from lrf3d.pose import Pose
from lrf3d.slam.surface import LEAST_NOISE, range_noise, surface_of_scan, thinned
from lrf3d.slam.views import Fan, Key

LEARNED_NOISE = 0.95
"""Weight of the scans before in the mean noise of the ranges, at each scan."""

Moment = tuple[LaserScan, ...]
"""The scans of all lasers at one moment."""


class Sight:
    """Converts scans of lasers to key scans; those without a mount stand ahead of the centre."""

    def __init__(self, laser_offset: float = 0.0) -> None:
        self._laser = Pose(float(laser_offset), 0.0, 0.0)
        self._noise = 0.0

    def seen(self, scan: LaserScan | Moment, number: int = 0) -> Key:
        """Convert the scans of a moment to a key-scan candidate at the origin."""
        scans = (scan,) if isinstance(scan, LaserScan) else scan
        for each in scans:
            kept = LEARNED_NOISE if self._noise else 0.0
            self._noise = kept * self._noise + (1.0 - kept) * range_noise(each)
        surface, fans, hits = self._surface(scans), list[Fan](), list[Float]()
        for each in scans:
            mount, met = self.mount(each), each.hits
            place, angles = np.array(mount[:2]), each.angles + mount.theta
            # A laser that is mounted upside down turns clockwise.
            order = -1 if angles[0] > angles[-1] else 1
            fans.append(Fan(place, angles[::order], each.ranges[::order]))
            hits.append(each.ranges[met, None] * beam_directions(0.0, angles[met]) + place)
        walls, points = thinned(surface), np.concatenate(hits)
        return Key(number, np.zeros(3), surface, walls, points, tuple(fans), self._noise)

    def mount(self, scan: LaserScan) -> Pose:
        """The pose of a scan's laser on the robot."""
        return self._laser if scan.mount == CENTRE else scan.mount

    def surfaces(self, scans: Sequence[LaserScan | Moment]) -> list[Float]:
        """The surfaces (m, 4) that scans show, each in the frame of the robot."""
        moments = [(scan,) if isinstance(scan, LaserScan) else scan for scan in scans]
        return [self._surface(tuple(map(unrolled, moment))) for moment in moments]

    def _surface(self, scans: Moment) -> Float:
        noise, parts = max(self._noise, LEAST_NOISE), []
        for each in scans:
            x, y, heading = self.mount(each)
            parts.append(surface_of_scan(each, np.array([x, y]), noise, heading))
        return parts[0] if len(parts) == 1 else np.concatenate(parts)
