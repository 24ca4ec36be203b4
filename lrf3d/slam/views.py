"""Views: how key scans saw points, and what that says for a place where a scan may have been taken.

Points and the poses of their frame, as seen from key scans, enter. For each of both leaves whether
the point was out of view, hidden, hit, or passed by beams. At the right place most of what a scan
hit was hit by others, or is new, and hardly any of it lies where their beams went through.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import compiled
from lrf3d.geometry import Float, wrap_angle
from lrf3d.slam.surface import CONNECTED, CONNECTED_GROWTH

BEHIND = 0.3
"""A beam that passes this far behind what the other scan saw [m] contradicts it."""

AT = 0.05
"""A point is hit if a beam ends at most as far before it or behind [m]."""

COUNTED = 120
"""Points of a scan that are counted at most."""

CHANCE, NEW, CORRELATED, CLEARLY = 0.05, 0.1, 2.0, 0.8
"""A place is believed if its evidence is positive, and larger by the last than that of any other:
the log odds of a point to speak for the place, and not against it. The first is the share of points
that do either by chance. Points that beams pass through are against it; others that were not hit
may be new, as most are where a robot enters a room, and the second share of them is. Points share
their errors: many count as the third number."""

APART, TURNED_APART = 0.3, 0.1
"""Two poses that differ by more [m], [rad] are different places."""


@dataclass(frozen=True, slots=True, eq=False)
class Key:
    """A key scan: its number among all scans, and its pose (3,) in the front end's drifting frame.

    It is recognised by its surface (m, 4), points and normals in the frame of the robot, and adds
    walls (w, 4) to a map; its hits (h, 2) are all that its beams met. These have rising angles
    [rad] and ranges [m] with a noise [m], from the laser's place (2,) on the robot.
    """

    scan: int
    pose: Float
    surface: Float
    walls: Float
    hits: Float
    angles: Float
    ranges: Float
    laser: Float
    noise: float


def views_of(points: Float, poses: Float, keys: Sequence[Key]) -> NDArray[np.uint8]:
    """How key scans (k,) saw points (m, …), whose frame is at poses (k, 3) as seen from them.

    Each of (k, m) is 0 for a point out of view, 1 in view, 2 where beams pass through, and 3 where
    they hit something.
    """
    views = np.empty((len(keys), len(points)), np.uint8)
    for row, key in enumerate(keys):
        limits = np.array([BEHIND, AT]) + 3.0 * key.noise
        _view(points, poses[row], key.laser, key.angles, key.ranges, limits, views[row])
    return views


@compiled
def _view(
    points: Float,
    pose: Float,
    laser: Float,
    angles: Float,
    ranges: Float,
    limits: Float,
    views: NDArray[np.uint8],
) -> int:
    """How a scan saw points, whose frame is at a pose (3,); returns how many it saw through.

    A beam counts with the least of its own and its neighbours' ranges, so that one that slips past
    an edge contradicts nothing. What lies between two beams that met one surface was hit, too.
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
        if not (least > 0.0 and np.isfinite(least)):
            continue
        distance = np.sqrt(dx * dx + dy * dy)
        views[i] = 2 if least > distance + limits[0] else 1
        through += views[i] == 2
        for side in range(-1, 2):
            one, other = ranges[beam], ranges[beam + side]
            joined = abs(one - other) < CONNECTED + CONNECTED_GROWTH * distance
            near, far = min(one, other) - limits[1], max(one, other) + limits[1]
            if joined and near < distance < far:
                views[i] = 3
    return through


def evidence(points: Float, poses: Float, keys: Sequence[Key]) -> float:
    """How much speaks for a place from which a scan hit points; arguments are those of `views_of`.

    It is the log odds of a point to speak for the place, and not against it.
    """
    if not len(points):
        return -np.inf
    views = views_of(points[:: 1 + len(points) // COUNTED], poses, keys)
    hit = (views == 3).any(axis=0)
    explained, passed = float(hit.mean()), float(((views == 2).any(axis=0) & ~hit).mean())
    against = passed + NEW * (1.0 - explained - passed)
    return CORRELATED * float(np.log((explained + CHANCE) / (against + CHANCE)))


def clearest(places: Sequence[Float], worth: Sequence[float]) -> int | None:
    """Which place (3,) is clearly worth more than all others elsewhere, if any is."""
    if not places:
        return None
    best = int(np.argmax(worth))
    others = [
        value
        for place, value in zip(places, worth, strict=True)
        if not same_place(place, places[best], tolerance=2.0)
    ]
    return best if worth[best] - max(others, default=-np.inf) > CLEARLY else None


def same_place(first: Float, second: Float, tolerance: float = 1.0) -> bool:
    """Whether two poses (3,) are the same place."""
    apart = np.hypot(first[0] - second[0], first[1] - second[1])
    turned = abs(wrap_angle(first[2] - second[2]))
    return bool(apart < tolerance * APART and turned < tolerance * TURNED_APART)
