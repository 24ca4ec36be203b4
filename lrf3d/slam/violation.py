"""Violation: beams of one scan that pass through what another scan saw.

Key scans and their relative poses enter. Of the points that one scan saw, the number that lies in
view of the other leaves, and the number of these that the other's beams pass through. With right
poses hardly any are.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import compiled
from lrf3d.geometry import Float
from lrf3d.slam.frames import between

BEHIND = 0.3
"""A beam that passes this far behind what the other scan saw [m] contradicts it."""

MOST_THROUGH = 0.04
"""Share of points that beams may pass through: doors open and people walk."""


@dataclass(frozen=True, slots=True, eq=False)
class Key:
    """A key scan: its number among all scans, and its pose (3,) in the front end's drifting frame.

    It is recognised by its surface (m, 4), points and normals in the frame of the robot, and adds
    walls (w, 4) to a map. Its beams have rising angles [rad] and ranges [m] with a noise [m], from
    the laser's place (2,) on the robot.
    """

    scan: int
    pose: Float
    surface: Float
    walls: Float
    angles: Float
    ranges: Float
    laser: Float
    noise: float


def views_of(points: Float, poses: Float, keys: Sequence[Key]) -> NDArray[np.uint8]:
    """How key scans (k,) saw points (m, …), whose frame is at poses (k, 3) as seen from them.

    Each of (k, m) is 0 for a point out of view, 1 in view, and 2 where beams pass through.
    """
    views = np.empty((len(keys), len(points)), np.uint8)
    for row, key in enumerate(keys):
        behind = BEHIND + 3.0 * key.noise
        _view(points, poses[row], key.laser, key.angles, key.ranges, behind, views[row])
    return views


@compiled
def _view(
    points: Float,
    pose: Float,
    laser: Float,
    angles: Float,
    ranges: Float,
    behind: float,
    views: NDArray[np.uint8],
) -> int:
    """How a scan saw points, whose frame is at a pose (3,); returns how many it saw through.

    A beam counts with the least of its own and its neighbours' ranges, so that one that slips past
    an edge contradicts nothing.
    """
    through = 0
    step = (angles[-1] - angles[0]) / (len(angles) - 1)
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    for i in range(len(points)):
        views[i] = 0
        dx = pose[0] + cos * points[i, 0] - sin * points[i, 1] - laser[0]
        dy = pose[1] + sin * points[i, 0] + cos * points[i, 1] - laser[1]
        away = np.arctan2(dy, dx) - angles[0]
        away -= 2.0 * np.pi * np.floor(away / (2.0 * np.pi))
        beam = int(away / step + 0.5)
        if beam < 1 or beam > len(angles) - 2:
            continue
        least = min(ranges[beam - 1], ranges[beam], ranges[beam + 1])
        if least > 0.0 and np.isfinite(least):
            views[i] = 2 if least > np.sqrt(dx * dx + dy * dy) + behind else 1
            through += views[i] == 2
    return through


def seen_through_both(olds: Sequence[Key], new: Key, poses: Float) -> tuple[int, int]:
    """How many points of a key scan and of others the other sees through, and has in view.

    The poses (k, 3) are those of the key scan as seen from the others.
    """
    views = [views_of(new.surface, poses, olds).ravel()]
    for old, back in zip(olds, between(poses, np.zeros(3)), strict=True):
        views.append(views_of(old.surface, back[None], [new])[0])
    counts = np.bincount(np.concatenate(views), minlength=3)
    return int(counts[2]), int(counts[1] + counts[2])


def contradicted(olds: Sequence[Key], new: Key, poses: Float) -> bool:
    """Whether beams pass through too many points; arguments are those of `seen_through_both`."""
    through, seen = seen_through_both(olds, new, poses)
    return through > MOST_THROUGH * max(seen, 1)
