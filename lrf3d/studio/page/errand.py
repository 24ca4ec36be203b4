"""Errands: driving to a goal along a planned path, and turning to a heading there.

A path and poses enter; speeds and turn rates leave until the robot is there.
"""

import math
from dataclasses import dataclass

import numpy as np

from lrf3d.geometry.lines import Float
from lrf3d.planning.planner import INDOOR_SPEED

# Distance from a way-point [m] at which the robot steers at the next one; less than the distance
# that planned paths keep from walls.
_NEAR = 0.25

# Distance from the last way-point [m] at which it has arrived.
_THERE = 0.08

# Heading errors [rad]: above the first it turns on the spot, below the second it has turned.
_TURNS = 0.5
_TURNED = 0.03

# Share of the highest turn rate for each radian of heading error [1/rad].
_GAIN = 2.0

# Speed [m/s] for each metre to the last way-point [1/s], so that it stops smoothly.
_BRAKES = 1.5


@dataclass
class Errand:
    """A path (m, 2) [m] to drive, and the heading [rad] at its end; None for any."""

    way: Float
    heading: float | None = None
    done: bool = False

    def command(self, pose: Float) -> tuple[float, float]:
        """The speed [m/s] and the share of the highest turn rate at a pose (3,)."""
        while len(self.way) > 1 and np.hypot(*(self.way[0] - pose[:2])) < _NEAR:
            self.way = self.way[1:]
        ahead = self.way[0] - pose[:2]
        if len(self.way) == 1 and np.hypot(*ahead) < _THERE:
            off = 0.0 if self.heading is None else math.remainder(self.heading - pose[2], math.tau)
            self.done = abs(off) < _TURNED
            return 0.0, _turn(off)
        off = math.remainder(math.atan2(ahead[1], ahead[0]) - pose[2], math.tau)
        left = float(np.hypot(*(self.way[-1] - pose[:2])))
        speed = min(INDOOR_SPEED, _BRAKES * left) * float(np.cos(off))
        return speed if abs(off) < _TURNS else 0.0, _turn(off)


def _turn(off: float) -> float:
    return float(np.clip(_GAIN * off, -1.0, 1.0))
