"""Crowd: the dynamic obstacles around a laser, and the beams that they stop."""

import math
from collections.abc import Sequence

import numpy as np

from lrf3d.casting.dynamic_obstacle import DynamicObstacle
from lrf3d.casting.kernels.beams import Records
from lrf3d.casting.kernels.movers import (
    CORNER,
    LEG,
    MOVER,
    PLACED,
    SIDE,
    cast_among,
    place_all,
    rays_among,
)
from lrf3d.casting.kernels.scans import laser_of
from lrf3d.casting.kernels.touch import touched_among
from lrf3d.casting.kernels.tree import Plain
from lrf3d.geometry import Float, Int, wrap_angle
from lrf3d.laser import LaserRangeFinder
from lrf3d.pose import Pose
from lrf3d.robot import Trajectory
from lrf3d.robot.laps import Patrol


class Crowd:
    """Dynamic obstacles as kernels take them.

    Where they are at the last time is kept, as all robots of a fleet scan at the same times. Those
    with a disc [m], a radius for each, touch others as one of this size.
    """

    def __init__(
        self, obstacles: Sequence[DynamicObstacle], discs: Sequence[float] | float = 0.0
    ) -> None:
        paths = [one.path for one in obstacles]
        laps = [path.until(0.0) if isinstance(path, Patrol) else path for path in paths]
        outlines = [np.empty((0, 2)), *(one.outline for one in obstacles)]
        times = np.concatenate([np.empty(0), *(lap.times for lap in laps)])
        poses = np.concatenate([np.empty((0, 3)), *(lap.poses for lap in laps)])
        movers = np.zeros(len(obstacles), MOVER)
        movers["stop"], movers["last"] = (
            np.cumsum([len(one) for one in rows]) for rows in (outlines[1:], laps)
        )
        movers["first"][1:], movers["leg"][1:] = movers["stop"][:-1], movers["last"][:-1]
        movers["reach"] = [one.reach for one in obstacles]
        movers["height"] = [one.height for one in obstacles]
        movers["disc"] = discs
        fastest = np.array([_fastest(lap) for lap in laps]).reshape(-1, 2)
        movers["fastest"], movers["rim"] = fastest[:, 0], fastest[:, 0]
        movers["rim"] += fastest[:, 1] * movers["reach"]
        movers["period"] = [path.period if isinstance(path, Patrol) else 0.0 for path in paths]
        corners = records(CORNER, *np.concatenate(outlines).T)
        self._movers = movers, corners, legs_of(times, poses)
        self._placed = movers, np.empty(len(movers), PLACED), np.empty(len(corners), SIDE)
        self._time = math.nan

    def __len__(self) -> int:
        return len(self._movers[0])

    def touch(
        self, body: Plain, pose: Pose, twist: tuple[float, float, float], begin: float,
        seconds: float, own: int,
    ) -> tuple[float, int]:  # fmt: skip
        """The seconds after which a body first touches an obstacle, and this; or +inf and −1."""
        found = touched_among(self._movers, body, pose[:], twist, begin, seconds, own)
        return float(found[0]), int(found[1])

    def stop_scans(
        self, lrf: LaserRangeFinder, poses: Float, time: float, own: Int, ranges: Float, walls: Int
    ) -> None:
        """Shorten ranges (k, beams) of scans from poses (k, 3) at a time [s]; walls become −1.

        Own (k,) are the obstacles that the scans do not see, or −1.
        """
        if time != self._time:
            self._time = time
            place_all(self._movers, time, *self._placed[1:])
        cast_among(self._placed, laser_of(lrf), float(lrf.height), poses, own, ranges, walls)

    def stop_rays(
        self, lrf: LaserRangeFinder, rays: Records, own: int, ranges: Float, walls: Int
    ) -> None:
        """Shorten the ranges (n,) of rays (n,), each among obstacles at its own time."""
        limits = float(lrf.range_min), float(lrf.range_max)
        rays_among(self._movers, limits, float(lrf.height), rays, own, ranges, walls)


def legs_of(times: Float, poses: Float) -> Records:
    """The legs (k,) of a path with poses (k, 3) at times (k,), as kernels take them."""
    return records(LEG, times, *poses.T)


def records(kind: "np.dtype[np.void]", *columns: Float) -> Records:
    """Records of one kind from their columns (n,)."""
    rows = np.empty(len(columns[0]), kind)
    for name, column in zip(kind.names or (), columns, strict=True):
        rows[name] = column
    return rows


def _fastest(path: Trajectory) -> tuple[float, float]:
    """The largest speed on a path [m/s], and the largest turn rate [rad/s]."""
    steps, seconds = np.diff(path.poses, axis=0), np.diff(path.times)
    speeds = np.hypot(steps[:, 0], steps[:, 1]) / seconds
    turns = np.abs(wrap_angle(steps[:, 2])) / seconds
    return float(speeds.max(initial=0.0)), float(turns.max(initial=0.0))
