"""Trajectory: the poses of a drive over time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.base.errors import InputError
from lrf3d.geometry.lines import (
    LARGEST_TIME,
    Float,
    Value,
    numbers,
    read_only,
    sealed,
    whole_number,
    wrap_angle,
)
from lrf3d.geometry.pose import as_poses


@dataclass(frozen=True, eq=False, init=False)
class Trajectory(Value):
    """Poses of a drive at increasing times.

    Args:
        times: (k,) times [s], ascending.
        poses: (k, 3) poses x, y [m], theta [rad]; theta is continuous over full turns.

    Examples:
        >>> import lrf3d
        >>> drive = lrf3d.Trajectory([0, 1, 2], [(0, 0, 0), (1, 0, 0), (2, 0, 0)])
        >>> drive.length, drive.duration
        (2.0, 2.0)
        >>> drive.at([0.5]).tolist()
        [[0.5, 0.0, 0.0]]
    """

    times: Float
    poses: Float

    def __init__(self, times: ArrayLike, poses: ArrayLike) -> None:
        instants: Float = read_only(times, "times")
        states: Float = read_only(as_poses(poses), "poses")
        if instants.shape != (len(states),) or len(states) == 0:
            raise InputError(
                f"trajectory of {len(states)} poses and times {instants.shape}: expected one time"
                " for each pose"
            )
        if not (np.abs(instants) <= LARGEST_TIME).all() or not (np.diff(instants) > 0.0).all():
            raise InputError("trajectory: expected increasing times of at most 1e12 s")
        self.__dict__.update(times=instants, poses=states)

    def __repr__(self) -> str:
        return f"Trajectory({len(self)} poses, {self.length:.1f} m in {self.duration:.1f} s)"

    def __len__(self) -> int:
        return len(self.times)

    @property
    def duration(self) -> float:
        """Time from the first pose to the last [s]."""
        return float(self.times[-1] - self.times[0])

    @property
    def length(self) -> float:
        """Length of the path through all poses [m]."""
        steps = np.diff(self.poses[:, :2], axis=0)
        return float(np.hypot(steps[:, 0], steps[:, 1]).sum())

    @cached_property
    def speeds(self) -> Float:
        """Speeds (k, 2) from each pose to the next: ahead [m/s], about itself [rad/s]."""
        if len(self) < 2:
            return sealed(np.zeros((1, 2)))
        steps = np.diff(self.poses, axis=0)
        turns = wrap_angle(steps[:, 2])
        middle = self.poses[:-1, 2] + 0.5 * turns
        ahead = steps[:, 0] * np.cos(middle) + steps[:, 1] * np.sin(middle)
        speeds = np.column_stack([ahead, turns]) / np.diff(self.times)[:, None]
        return sealed(np.vstack([speeds, speeds[-1:]]))

    def every(self, count: int) -> Trajectory:
        """The trajectory of the first pose, every ``count``-th one after it, and the last."""
        count = whole_number(count, "every")
        kept = np.append(np.arange(0, len(self) - 1, count), len(self) - 1)
        return Trajectory(self.times[kept], self.poses[kept])

    def at(self, times: ArrayLike) -> Float:
        """Poses (m, 3) at times (m,) [s]: straight between two poses, at rest before and after."""
        times = np.asarray(numbers(times, "times"), dtype=np.float64)
        if times.ndim != 1 or np.isnan(times).any():
            raise InputError(f"times of shape {times.shape}: expected (m,), without NaN")
        if len(self) == 1:
            return np.tile(self.poses, (len(times), 1))
        # Only the neighbouring poses are used, so that long drives take no longer.
        after = np.clip(np.searchsorted(self.times, times, side="right"), 1, len(self) - 1)
        start = self.times[after - 1]
        stop = self.times[after]
        share = np.clip((times - start) / (stop - start), 0.0, 1.0)
        before = self.poses[after - 1]
        steps = self.poses[after] - before
        steps[:, 2] = wrap_angle(steps[:, 2])
        poses: Float = before + share[:, None] * steps
        poses[:, 2] = wrap_angle(poses[:, 2])
        return poses
