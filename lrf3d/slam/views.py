"""Views: how key scans saw points, and what that says for a place where a scan may have been taken.

Points and the poses of their frame, as seen from key scans, enter. For each of both leaves whether
the point was out of view, hidden, hit, or passed by beams. At the right place most of what a scan
hit was hit by others, or is new, and hardly any of it lies where their beams went through.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import compiled
from lrf3d.geometry import Float, wrap_angle
from lrf3d.slam.surface import CONNECTED, CONNECTED_GROWTH, FLATTEST

BEHIND = 0.3
"""A beam that passes this far behind what the other scan saw [m] contradicts it."""

AT = 0.05
"""A point is hit if a beam ends at most as far before it or behind [m]."""

COUNTED = 120
"""Points of a scan that are counted at most."""

CHANCE, NEW, CLEARLY = 0.05, 0.1, 0.8
"""A place is believed if its evidence is positive, and larger by the last than that of any other.
The first is the share of points that speak for or against a place by chance. Points that beams pass
through are against it; others may be new, as most are where a robot enters a room, and the second
share of them is."""

APART, TURNED_APART = 0.3, 0.1
"""Two poses that differ by more [m], [rad] are different places."""


class Fan(NamedTuple):
    """The beams of one laser, whose place on the robot is (2,): rising angles [rad], ranges [m]."""

    laser: Float
    angles: Float
    ranges: Float


@dataclass(frozen=True, slots=True, eq=False)
class Key:
    """A key scan: its number among all scans, and its pose (3,) in the front end's drifting frame.

    It is recognised by its surface (m, 4), points and normals in the frame of the robot, and adds
    walls (w, 4) to a map; its hits (h, 2) are all that its beams met. Each laser has a fan of them,
    whose ranges have a noise [m].
    """

    scan: int
    pose: Float
    surface: Float
    walls: Float
    hits: Float
    fans: tuple[Fan, ...]
    noise: float


def views_of(points: Float, poses: Float, keys: Sequence[Key]) -> NDArray[np.uint8]:
    """How key scans (k,) saw points (m, …), whose frame is at poses (k, 3) as seen from them.

    Points may have normals, as those of surfaces have: walls that beams run along are out of view.
    Each of (k, m) is 0 for a point out of view, 1 in view, 2 where beams pass through, and 3 where
    they hit something.
    """
    views = np.empty((len(keys), len(points)), np.uint8)
    for row, key in enumerate(keys):
        limits = np.array([BEHIND, AT]) + 3.0 * key.noise
        for number, fan in enumerate(key.fans):
            seen = np.empty(len(points), np.uint8) if number else views[row]
            _view(points, poses[row], *fan, limits, seen)
            # What one laser hit, another may have missed, and so on down to out of view.
            np.maximum(views[row], seen, out=views[row])
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
) -> None:
    """How a scan saw points, whose frame is at a pose (3,).

    A beam counts with the least of its own and its neighbours' ranges, so that one that slips past
    an edge contradicts nothing. What lies between two beams that met one surface was hit, too.
    """
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
        if points.shape[1] == 4:
            nx = cos * points[i, 2] - sin * points[i, 3]
            ny = sin * points[i, 2] + cos * points[i, 3]
            # A post has no normal.
            if 0.0 < abs(nx * dx + ny * dy) <= FLATTEST * distance:
                continue
        views[i] = 2 if least > distance + limits[0] else 1
        for side in range(-1, 2):
            one, other = ranges[beam], ranges[beam + side]
            joined = abs(one - other) < CONNECTED + CONNECTED_GROWTH * distance
            near, far = min(one, other) - limits[1], max(one, other) + limits[1]
            if joined and near < distance < far:
                views[i] = 3


def evidence(hits: Float, explained: float, poses: Float, keys: Sequence[Key]) -> float:
    """How much speaks for a place from which a scan hit points (m, 2).

    It is the log odds of two points to speak for the place, and not against it: of one of those
    that matching explains, by a share, and of one that other beams hit. The other arguments are
    those of `views_of`.
    """
    if not len(hits):
        return -np.inf
    views = views_of(hits[:: 1 + len(hits) // COUNTED], poses, keys)
    hit = (views == 3).any(axis=0)
    passed = float(((views == 2).any(axis=0) & ~hit).mean())
    shares = np.array([float(hit.mean()), explained])
    against = passed + NEW * np.maximum(1.0 - shares - passed, 0.0)
    return float(np.log((shares + CHANCE) / (against + CHANCE)).sum())


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
