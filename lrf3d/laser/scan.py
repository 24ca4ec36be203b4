"""LaserScan: what one turn of the laser range finder measured, and from where."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Bool, Float, Int
from lrf3d.laser.range_finder import LaserRangeFinder, beam_directions
from lrf3d.pose import Pose, as_pose


@dataclass(frozen=True, eq=False)
class LaserScan:
    """The ranges of one scan, with the pose they were taken at.

    Args:
        pose: Pose x, y [m], theta [rad] of the laser in the world.
        angles: (beams,) angles of the beams [rad], 0 ahead, counter-clockwise.
        ranges: (beams,) distances [m]; +inf where nothing returned, −inf where the wall is
            nearer than range_min (REP 117).
        walls: (beams,) index of the segment that was hit, −1 where there is no range.
        range_min: Nearest distance that the range finder measures [m].
        range_max: Farthest distance that the range finder measures [m].
        time: When the scan was taken [s].
    """

    pose: Pose
    angles: Float
    ranges: Float
    walls: Int = None  # type: ignore[assignment]
    range_min: float = field(default=0.0, kw_only=True)
    range_max: float = field(default=np.inf, kw_only=True)
    time: float = field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        angles = np.asarray(self.angles, dtype=np.float64)
        ranges = np.asarray(self.ranges, dtype=np.float64)
        walls = np.full(len(ranges), -1) if self.walls is None else np.asarray(self.walls)
        if angles.ndim != 1 or ranges.shape != angles.shape or walls.shape != angles.shape:
            raise InputError(
                f"scan with angles {angles.shape}, ranges {ranges.shape} and walls {walls.shape}:"
                " expected one of each for every beam"
            )
        object.__setattr__(self, "pose", as_pose(self.pose))
        object.__setattr__(self, "angles", angles)
        object.__setattr__(self, "ranges", ranges)
        object.__setattr__(self, "walls", walls.astype(np.int64, copy=False))

    @classmethod
    def measured(cls, lrf: LaserRangeFinder, pose: Pose, ranges: Float, walls: Int) -> "LaserScan":
        """The scan that a caster hands on: what fits is neither checked nor converted."""
        scan = object.__new__(cls)
        scan.__dict__.update(
            pose=pose,
            angles=lrf.angles,
            ranges=ranges,
            walls=walls,
            range_min=lrf.range_min,
            range_max=lrf.range_max,
            time=0.0,
        )
        return scan

    @cached_property
    def hits(self) -> Bool:
        """Which beams (beams,) returned: a finite range up to range_max."""
        return np.isfinite(self.ranges) & (self.ranges <= self.range_max)

    def points(self) -> Float:
        """Reflection points (m, 2) in the world of the beams that returned (Eq. 8)."""
        return reflection_points(self.pose, self.angles[self.hits], self.ranges[self.hits])


def reflection_points(pose: Sequence[float], angles: Float, ranges: Float) -> Float:
    """Points (n, 2) in the world at ranges (n,) along beams at angles (n,) (Eq. 8)."""
    return np.array([pose[0], pose[1]]) + ranges[:, None] * beam_directions(pose[2], angles)
