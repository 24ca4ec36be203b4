"""Violation: beams that pass through what another scan saw, which true poses do not explain.

Key scans and their poses enter; how many of the points that one saw lie in view of another, and
how many of these the beams of the other pass through, leave.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from lrf3d.compiling import compiled
from lrf3d.geometry import Float
from lrf3d.slam.frames import between
from lrf3d.slam.surface import moved

BEHIND = 0.3
"""A beam that passes this far behind what the other scan saw [m] contradicts a closure."""

MOST_THROUGH = 0.04
"""Share of points that beams may pass through: doors open and people walk."""


@dataclass(frozen=True, slots=True, eq=False)
class Key:
    """A key scan.

    Args:
        scan: Its number among all scans.
        pose: (3,) where the front end had it, in its own drifting frame.
        surface: (m, 4) what it is recognised by, in the frame of the robot.
        walls: (w, 4) what it adds to a map.
        angles: (beams,) directions of its beams [rad], rising.
        ranges: (beams,) their ranges [m].
        laser: (2,) where the laser stands on the robot [m].
    """

    scan: int
    pose: Float
    surface: Float
    walls: Float
    angles: Float
    ranges: Float
    laser: Float


@compiled
def seen_through(points: Float, laser: Float, angles: Float, ranges: Float) -> tuple[int, int]:
    """How many points (m, 2) in the frame of a robot its beams pass through, of how many in view.

    A beam counts with the shorter of its neighbours' ranges, so that one that slips past an edge
    contradicts nothing.
    """
    through = seen = 0
    step = (angles[-1] - angles[0]) / (len(angles) - 1)
    for i in range(len(points)):
        dx, dy = points[i, 0] - laser[0], points[i, 1] - laser[1]
        away = np.arctan2(dy, dx) - angles[0]
        away -= 2.0 * np.pi * np.floor(away / (2.0 * np.pi))
        beam = int(away / step + 0.5)
        if beam < 1 or beam > len(angles) - 2:
            continue
        least = min(ranges[beam - 1], ranges[beam], ranges[beam + 1])
        if not (least > 0.0 and np.isfinite(least)):
            continue
        seen += 1
        if least > np.sqrt(dx * dx + dy * dy) + BEHIND:
            through += 1
    return through, seen


def seen_through_both(olds: Iterable[Key], new: Key, poses: Float) -> tuple[int, int]:
    """How many points of a key scan and of others beams of the other pass through, of how many.

    Args:
        olds: The others (k,).
        new: The key scan.
        poses: (k, 3) its pose as seen from each of them.
    """
    through = seen = 0
    backs = between(poses, np.zeros(3))
    for old, relative, back in zip(olds, poses, backs, strict=True):
        there, here = moved(new.surface, relative), moved(old.surface, back)
        for points, key in ((there, old), (here, new)):
            count = seen_through(points, key.laser, key.angles, key.ranges)
            through += count[0]
            seen += count[1]
    return through, seen


def contradicted(olds: Iterable[Key], new: Key, poses: Float) -> bool:
    """Whether too many points are seen through; arguments are those of `seen_through_both`."""
    through, seen = seen_through_both(olds, new, poses)
    return through > MOST_THROUGH * max(seen, 1)
