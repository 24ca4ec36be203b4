"""Crowd: the dynamic obstacles around a laser, and the beams that they stop."""

import math
from collections.abc import Sequence, Sized
from copy import copy

import numpy as np

from lrf3d.base.cores import share
from lrf3d.casting.dynamic_obstacle import DynamicObstacle
from lrf3d.casting.kernels.grid import LATTICE
from lrf3d.casting.kernels.movers import (
    CORNER,
    HELD,
    LEG,
    MOVER,
    PLACED,
    SIDE,
    cast_among,
    place_all,
    rays_among,
)
from lrf3d.casting.kernels.scans import laser_of
from lrf3d.casting.kernels.tree import Plain
from lrf3d.geometry.lines import Float, Int, Records, wrap_angle
from lrf3d.laser import LaserRangeFinder
from lrf3d.robot import Trajectory
from lrf3d.robot.kinematics import Twist

# [m] Multiples of this are origins of the frame in which obstacles are placed. Less than half of it
# from the origin, float64 resolves 1e-13 m; worlds around (0, 0) keep their own coordinates.
FRAME = 1024.0


class Crowd:
    """Dynamic obstacles as kernels take them.

    Beams meet them in a frame near their paths: far from the origin of the world, as in UTM
    coordinates, where they are would be rounded to nanometres.

    Their places at the last time are kept, as all robots of a fleet scan at the same times. The
    discs are a radius [m] for each obstacle that touches others as a disc, and 0 for an outline.
    """

    own = -1
    """The obstacle that is the robot itself, which it neither sees nor touches."""

    def __init__(
        self, obstacles: Sequence[DynamicObstacle], discs: Sequence[float] | float = 0.0
    ) -> None:
        self.obstacles = tuple(obstacles)
        # A patrol counts with its first lap.
        laps = [one.until(0.0).poses for one in obstacles]
        outlines = [np.empty((0, 2)), *(one.outline for one in obstacles)]
        times = np.concatenate([np.empty(0), *(lap.times for lap in laps)])
        poses = np.concatenate([np.empty((0, 3)), *(lap.poses for lap in laps)])
        movers = np.zeros(len(obstacles), MOVER)
        movers["stop"] = _ends(outlines[1:])
        movers["last"] = _ends(laps)
        movers["first"][1:] = movers["stop"][:-1]
        movers["leg"][1:] = movers["last"][:-1]
        movers["disc"] = discs
        movers["reach"] = [one.reach for one in obstacles]
        movers["height"] = [one.height for one in obstacles]
        movers["period"] = [getattr(one.path, "period", 0.0) for one in obstacles]
        speeds, turns = np.array([_fastest(lap) for lap in laps]).reshape(-1, 2).T
        movers["fastest"] = speeds
        movers["rim"] = speeds + turns * movers["reach"]
        corners = records(CORNER, *np.concatenate(outlines).T)
        self.plain: Plain = movers, corners, moves_of(times, poses)
        """The obstacles as kernels take them: kinds MOVER, CORNER, LEG."""
        middle = poses[:, :2].mean(axis=0) if len(poses) else np.zeros(2)
        self.origin: Float = np.append(FRAME * np.round(middle / FRAME), 0.0)
        """Origin (3,) of the frame near the obstacles, as a pose."""
        self.near: Plain = movers, corners, moves_of(times, poses - self.origin)
        """The same obstacles in that frame."""
        self._placed = *self.near, np.empty(len(movers), PLACED), np.empty(len(corners), SIDE)
        # Crowds of the same obstacles share where these are.
        self._grid = grid_over(len(movers))
        self._moment = [math.nan]

    def __len__(self) -> int:
        return len(self.plain[0])

    def without(self, own: int) -> "Crowd":
        """The same crowd as one of its obstacles sees it."""
        other = copy(self)
        other.own = own
        return other

    def hold(self, moves: Records, first: int = 0) -> None:
        """Let obstacles (k,) from the first on hold moves (k,), whatever their paths were."""
        some = self.plain[0][first : first + len(moves)]
        speeds = np.hypot(moves["ahead"], moves["left"])
        some["period"] = HELD
        some["fastest"] = speeds
        some["rim"] = speeds + np.abs(moves["turn"]) * some["reach"]
        self.plain[2][some["leg"]] = moves
        self.near[2][some["leg"]] = self.as_seen(moves)
        self._moment[0] = math.nan

    def as_seen(self, rays: Records) -> Records:
        """Rays or moves (n,) in the frame near the obstacles."""
        if not self.origin.any():
            return rays
        seen = rays.copy()
        seen["x"] -= self.origin[0]
        seen["y"] -= self.origin[1]
        return seen

    def stop_scans(
        self, lrf: LaserRangeFinder, poses: Float, time: float, ranges: Float, walls: Int,
        own: Int | None = None,
    ) -> None:  # fmt: skip
        """Shorten ranges (k, beams) of scans from poses (k, 3) at a time [s]; walls become −1.

        Own (k,) are the obstacles that the scans do not see, if they differ.
        """
        if time != self._moment[0]:
            self._moment[0] = time
            place_all(self._placed, self._grid, time)
        own = np.full(len(poses), self.own) if own is None else own
        asked = (self._placed, self._grid), laser_of(lrf), float(lrf.height)
        poses = poses - self.origin

        def work(start: int, stop: int) -> None:
            part = slice(start, stop)
            cast_among(*asked, poses[part], own[part], ranges[part], walls[part])

        share(work, len(poses))

    def stop_rays(
        self, lrf: LaserRangeFinder, rays: Records, ranges: Float, walls: Int, *, named: int = -1
    ) -> None:
        """Shorten the ranges (n,) of rays (n,), each among obstacles at its own time.

        Walls become −1, or the row of the obstacles' side, counted on from a number of walls.
        """
        limits = (float(lrf.range_min), float(lrf.range_max))
        seen = self.own, float(lrf.height), named
        rays_among(self.near, limits, seen, self.as_seen(rays), ranges, walls)


def move_of(time: float, pose: Sequence[float], twist: Twist) -> Records:
    """The move (1,) that holds a twist from a pose at a time [s] on."""
    return np.array([(time, *pose, *twist)], LEG)


def moves_of(times: Float | float, poses: Float, twists: Float | None = None) -> Records:
    """Moves (k,) that hold twists (k, 3) from poses (k, 3) at times [s] on, or legs of a path."""
    held = np.zeros((len(poses), 3)) if twists is None else twists
    return records(LEG, times, *poses.T, *held.T)


def records(kind: "np.dtype[np.void]", *columns: Float | float) -> Records:
    """Records of one kind from their columns, or from what all have in common."""
    rows = np.empty(np.broadcast(*columns).shape, kind)
    for name, column in zip(kind.names or (), columns, strict=True):
        rows[name] = column
    return rows


def grid_over(count: int) -> Plain:
    """A grid over a number of obstacles, which kernels fill: a cell for every four of them."""
    frames = np.zeros(1, LATTICE)
    frames["cells"] = cells = 1 + math.isqrt(count // 4)
    firsts = np.empty(cells * cells + 1, np.int64)
    return frames, firsts, np.empty(count, np.int64), np.empty(count, PLACED)


def _ends(rows: Sequence[Sized]) -> Int:
    """Where each of rows (n,) that follow each other in one array ends there."""
    return np.cumsum([len(one) for one in rows], dtype=np.int64)


def _fastest(path: Trajectory) -> tuple[float, float]:
    """The largest speed on a path [m/s], and the largest turn rate [rad/s]."""
    steps = np.diff(path.poses, axis=0)
    seconds = np.diff(path.times)
    speeds = np.hypot(steps[:, 0], steps[:, 1]) / seconds
    turns = np.abs(wrap_angle(steps[:, 2])) / seconds
    return float(speeds.max(initial=0.0)), float(turns.max(initial=0.0))
