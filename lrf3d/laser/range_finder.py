"""LaserRangeFinder: the fan of beams that a laser range finder sends out (section 2.3)."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Float


@dataclass(frozen=True)
class LaserRangeFinder:
    """A planar laser range finder that stands in the robot's middle and looks ahead.

    Args:
        angle_min: Angle of the first beam [rad], 0 ahead, counter-clockwise.
        angle_max: Angle of the last beam [rad].
        beams: Number of beams, evenly spread from the first angle to the last.
        range_min: Nearest distance that is measured [m].
        range_max: Farthest distance that is measured [m], d_max in the paper.
        height: Height of the beams above the ground [m].

    Raises:
        InputError: There are no beams, or a limit is not finite or out of order.
    """

    angle_min: float = -np.pi / 2
    angle_max: float = np.pi / 2
    beams: int = 181
    range_min: float = 0.0
    range_max: float = 80.0
    height: float = 0.5

    def __post_init__(self) -> None:
        if self.beams != int(self.beams) or self.beams < 1:
            raise InputError(f"range finder with {self.beams} beams: expected at least 1")
        limits = (self.angle_min, self.angle_max, self.range_min, self.range_max, self.height)
        if not np.isfinite(limits).all():
            raise InputError(f"range finder with limits {limits}: expected finite numbers")
        if self.angle_max < self.angle_min:
            raise InputError(
                f"range finder: angle_max {self.angle_max:g} lies below angle_min"
                f" {self.angle_min:g}; swap them"
            )
        if not 0.0 <= self.range_min < self.range_max:
            raise InputError(
                f"range finder: range_min {self.range_min:g} and range_max {self.range_max:g},"
                " expected 0 ≤ range_min < range_max"
            )

    @cached_property
    def angles(self) -> Float:
        """Angles of the beams (beams,) [rad], 0 ahead; θ_s of the paper is angles + π/2."""
        angles = np.linspace(self.angle_min, self.angle_max, self.beams)
        angles.flags.writeable = False
        return angles

    def directions(self, pose: Sequence[float] | Float) -> Float:
        """Unit vectors (beams, 2) of the beams in the world, for the laser at a pose."""
        return beam_directions(pose[2], self.angles)


def beam_directions(theta: float, angles: Float) -> Float:
    """Unit vectors (beams, 2) in the world of beams at angles (beams,) from the heading theta.

    Casters and scans use just these, so that both speak of the same beam to the last bit.
    """
    heading = theta + angles
    return np.column_stack([np.cos(heading), np.sin(heading)])
