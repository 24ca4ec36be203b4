"""Sealing: walls whose outlines join are moved until they meet, so that no beam passes between.

The input is points of outlines, in half cells; the output is walls within half a cell of them.
"""

from dataclasses import dataclass

import numpy as np

from lrf3d.geometry import Float, Int, fit_line
from lrf3d.world.straight_runs import hull_of, narrowest

STRIP_WIDTH = 2
"""Width [half cells] of the strip in which the points of a wall lie: half a cell on each side."""

FARTHEST_JOINT = 20.0
"""Largest distance [half cells] from the joint of two outlines to the crossing of their lines."""

ROUNDING = 1e-6
"""Tolerance [half cells] for rounding in the distance between a wall and its points."""


JOINT_OFFSETS = np.stack(np.meshgrid(*[np.linspace(-1.5, 1.5, 9)] * 2), axis=-1).reshape(-1, 2)
"""Offsets [half cells] from the middle between two ends, the nearest first, for joints of walls
whose lines meet too far away."""
JOINT_OFFSETS = JOINT_OFFSETS[np.argsort(np.hypot(*JOINT_OFFSETS.T), kind="stable")]


PARALLEL = 1e-6
"""Square of the sine of the angle below which two lines count as parallel: 0.06°."""

LONG_WALL = 8
"""Least number of points of walls for which these joints are tried: a step in a long wall shows."""


@dataclass
class FittedWall:
    """A wall along points of an outline.

    Args:
        points: (n, 2) the points [half cells].
        ends: (2, 2) its first and last point.
    """

    points: Float
    ends: Float

    @classmethod
    def through(cls, points: Int) -> "FittedWall":
        """The best fit to points (n, 2) that lies within half a cell of all of them."""
        located = points.astype(np.float64)
        if (points == points[0]).all():
            return cls(located, located[[0, 0]])
        middle, unit = fit_line(located)
        if np.abs((located - middle) @ [-unit[1], unit[0]]).max() > 0.5 * STRIP_WIDTH:
            # The middle of the narrowest strip fits worse, but no point is too far from it.
            corners = hull_of(points)
            edge, across = narrowest(corners)
            hull = corners.astype(np.float64)
            delta = hull[(edge + 1) % len(hull)] - hull[edge]
            unit = delta / np.hypot(*delta)
            normal = np.array([-unit[1], unit[0]])
            middle = hull[edge] + 0.5 * normal * (normal @ (hull[across] - hull[edge]))
        along = (located - middle) @ unit
        return cls(located, middle + np.outer([along.min(), along.max()], unit))

    @property
    def is_point(self) -> bool:
        """Whether it has no length."""
        return bool((self.ends[0] == self.ends[1]).all())

    def nearest(self, point: Float | Int) -> Float:
        """The point (2,) of the wall that is nearest to another."""
        delta = self.ends[1] - self.ends[0]
        square = float(delta @ delta)
        share = float((point - self.ends[0]) @ delta) / square if square else 0.0
        return np.asarray(self.ends[0] + min(max(share, 0.0), 1.0) * delta, dtype=np.float64)

    def end_by(self, point: Int) -> int | None:
        """Which end (0 or 1) lies at a point of the outline, or None for a point in between."""
        away = np.hypot(*(self.ends - point).T)
        end = int(np.argmin(away))
        return end if away[end] <= 1.5 * STRIP_WIDTH else None

    def with_end(self, end: int | None, joint: Float) -> Float | None:
        """The ends (2, 2) with one of them moved; None if a point is then too far away."""
        if end is None:
            return self.ends if np.hypot(*(self.nearest(joint) - joint)) <= ROUNDING else None
        ends = self.ends.copy()
        ends[end] = joint
        delta = ends[1] - ends[0]
        square = float(delta @ delta)
        if square < 1.0:
            return None
        share = np.clip((self.points - ends[0]) @ delta / square, 0.0, 1.0)
        gap = self.points - ends[0] - share[:, None] * delta
        near = (gap**2).sum(axis=1).max() <= (0.5 * STRIP_WIDTH + ROUNDING) ** 2
        return ends if near else None


def seal(one: FittedWall, other: FittedWall, point: Int, other_point: Int) -> list[Float]:
    """Make two walls meet where their outlines join, at a point of each.

    Returns:
        A bridge [(4,)] between them if neither can be moved to the other; else an empty list.
    """
    first, second = one.end_by(point), other.end_by(other_point)
    a, b = one.nearest(point), other.nearest(other_point)
    middle = 0.5 * (point + other_point)
    joints = [0.5 * (a + b), a, b]
    crossing = _crossing(one, other)
    if crossing is not None and np.hypot(*(crossing - middle)) <= FARTHEST_JOINT:
        joints.insert(0, crossing)
    if not (one.is_point or other.is_point):
        if min(len(one.points), len(other.points)) >= LONG_WALL:
            joints += list(0.5 * (a + b) + JOINT_OFFSETS)
        for joint in joints:
            ends, other_ends = one.with_end(first, joint), other.with_end(second, joint)
            if ends is not None and other_ends is not None:
                one.ends, other.ends = ends, other_ends
                return []
    gap = float(np.hypot(*(b - a)))
    return [np.concatenate([a, b])] if gap > ROUNDING else []


def _crossing(one: FittedWall, other: FittedWall) -> Float | None:
    """The crossing of the lines of two walls, or None if they are nearly parallel."""
    a, b = one.ends[1] - one.ends[0], other.ends[1] - other.ends[0]
    cross = float(a[0] * b[1] - a[1] * b[0])
    if cross**2 <= PARALLEL * float(a @ a) * float(b @ b):
        return None
    gap = other.ends[0] - one.ends[0]
    return np.asarray(one.ends[0] + (gap[0] * b[1] - gap[1] * b[0]) / cross * a, dtype=np.float64)
