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
from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserRangeFinder
from lrf3d.robot import Trajectory
from lrf3d.robot.laps import Patrol


class Crowd:
    """The obstacles that reach up to the height of the beams [m], as kernels take them.

    Where they are at the last time is kept, as all robots of a fleet scan at the same times.
    """

    def __init__(self, obstacles: Sequence[DynamicObstacle], height: float) -> None:
        tall = [one for one in obstacles if one.height >= height]
        laps = [one.path.until(0.0) if isinstance(one.path, Patrol) else one.path for one in tall]
        outlines = [np.empty((0, 2)), *(one.outline for one in tall)]
        times = np.concatenate([np.empty(0), *(lap.times for lap in laps)])
        poses = np.concatenate([np.empty((0, 3)), *(lap.poses for lap in laps)])
        movers = np.zeros(len(tall), MOVER)
        movers["stop"], movers["last"] = (
            np.cumsum([len(one) for one in rows]) for rows in (outlines[1:], laps)
        )
        movers["first"][1:], movers["leg"][1:] = movers["stop"][:-1], movers["last"][:-1]
        movers["reach"] = [one.reach for one in tall]
        movers["fastest"] = [_fastest(lap) for lap in laps]
        paths = [one.path for one in tall]
        movers["period"] = [path.period if isinstance(path, Patrol) else 0.0 for path in paths]
        corners = records(CORNER, *np.concatenate(outlines).T)
        self._movers = movers, corners, legs_of(times, poses)
        self._placed = movers, np.empty(len(movers), PLACED), np.empty(len(corners), SIDE)
        self._time = math.nan

    def __len__(self) -> int:
        return len(self._movers[0])

    def stop_scans(
        self, lrf: LaserRangeFinder, poses: Float, time: float, own: Int, ranges: Float, walls: Int
    ) -> None:
        """Shorten ranges (k, beams) of scans from poses (k, 3) at a time [s]; walls become −1.

        Own (k,) are the obstacles that the scans do not see, or −1.
        """
        if time != self._time:
            self._time = time
            place_all(self._movers, time, *self._placed[1:])
        cast_among(self._placed, laser_of(lrf), poses, own, ranges, walls)

    def stop_rays(
        self, lrf: LaserRangeFinder, rays: Records, own: int, ranges: Float, walls: Int
    ) -> None:
        """Shorten the ranges (n,) of rays (n,), each among obstacles at its own time."""
        limits = float(lrf.range_min), float(lrf.range_max)
        rays_among(self._movers, limits, rays, own, ranges, walls)


def legs_of(times: Float, poses: Float) -> Records:
    """The legs (k,) of a path with poses (k, 3) at times (k,), as kernels take them."""
    return records(LEG, times, *poses.T)


def records(kind: "np.dtype[np.void]", *columns: Float) -> Records:
    """Records of one kind from their columns (n,)."""
    rows = np.empty(len(columns[0]), kind)
    for name, column in zip(kind.names or (), columns, strict=True):
        rows[name] = column
    return rows


def _fastest(path: Trajectory) -> float:
    """The largest speed on a path [m/s]."""
    steps = np.diff(path.poses[:, :2], axis=0)
    return float((np.hypot(*steps.T) / np.diff(path.times)).max(initial=0.0))
