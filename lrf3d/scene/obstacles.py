"""The dynamic obstacles of a run as they are drawn: bodies, shadows, and plans from above."""

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import shapely

from lrf3d.geometry import Bool, Float
from lrf3d.scene.beams import Carry
from lrf3d.scene.bodies import (
    counter_clockwise,
    faces_of,
    in_body,
    obstacle_bodies,
    obstacle_colours,
    outline_triangles,
    placed,
    soft_shadow,
    world_from_robot,
)
from lrf3d.scene.look import SUN
from lrf3d.scene.shapes import Body, Soft, single

if TYPE_CHECKING:
    from lrf3d.casting.dynamic_obstacle import DynamicObstacle

_NEAR = 0.3
"""How far off a body [m] a return is still one of it: noise moves it by as much."""

_SHADOW, _SHADOW_INDOOR = 0.42, 0.30
"""Darkness of the shadow on the ground."""

_FRINGE, _FRINGE_INDOOR = 0.08, 0.35
"""Width of the soft edge of the shadow [m]: in the sun it is narrow, in a lit room wide."""

_LIFT = 0.01
"""Height of the shadow above the ground [m]."""

_LEAST = 2.5
"""Least half size of a body in the inset [pixels], so that it can be seen."""


class Obstacles:
    """The dynamic obstacles of a run; nothing if there are none.

    Args:
        obstacles: The dynamic obstacles.
        origin: (2,) of the film's frame in the world [m].
        indoor: Whether this is the inside of a house, where no sun shines.
    """

    def __init__(
        self, obstacles: "tuple[DynamicObstacle, ...]", origin: Float, *, indoor: bool
    ) -> None:
        self._obstacles = obstacles
        self._origin = np.array([*origin, 0.0])
        self._indoor = indoor
        self._outlines = [counter_clockwise(obstacle.outline) for obstacle in obstacles]
        self._colours = obstacle_colours(obstacles)
        self._bodies = [faces_of(rows) for rows in obstacle_bodies(obstacles)]
        self._triangles = [outline_triangles(outline) for outline in self._outlines]

    def poses(self, time: float) -> Float:
        """Poses (m, 3) of all bodies at a time [s] in the film's frame."""
        poses = [obstacle.path.at(np.array([time]))[0] for obstacle in self._obstacles]
        return np.asarray(np.reshape(poses, (-1, 3)) - self._origin)

    def bodies(self, time: float) -> list[tuple[str, Body]]:
        """The bodies at a time [s]."""
        poses = self.poses(time)
        return [
            (f"obstacle {number}", Body(faces, world_from_robot(pose)))
            for number, (faces, pose) in enumerate(zip(self._bodies, poses, strict=True))
        ]

    def shadows(self, time: float) -> Soft | None:
        """The shadows of all bodies at a time [s]."""
        if not self._obstacles:
            return None
        fringe = _FRINGE_INDOOR if self._indoor else _FRINGE
        dark = _SHADOW_INDOOR if self._indoor else _SHADOW
        shadows = []
        for pose, outline, obstacle in zip(
            self.poses(time), self._outlines, self._obstacles, strict=True
        ):
            corners = placed(outline, pose)
            if not self._indoor:
                slide = -SUN[:2] / SUN[2] * obstacle.height
                corners = np.concatenate([corners, corners + slide])
            shadows.append(soft_shadow(corners, fringe, dark, _LIFT))
        return Soft(*(np.concatenate(column) for column in zip(*shadows, strict=True)))

    def plans(self, time: float, pixel: float) -> Soft | None:
        """The bodies from straight above, in a picture whose pixels have a size [m]."""
        if not self._obstacles:
            return None
        corners, colours = [], []
        for shape, colour, obstacle, pose in zip(
            self._triangles, self._colours, self._obstacles, self.poses(time), strict=True
        ):
            size = max(1.0, _LEAST * pixel / obstacle.reach)
            level = placed(size * shape.reshape(-1, 2), pose).reshape(-1, 3, 2)
            corners.append(np.concatenate([level, np.zeros((len(level), 3, 1))], axis=2))
            colours.append(np.tile([*colour, 1.0], (len(level), 3, 1)))
        return Soft(single(np.concatenate(corners)), single(np.concatenate(colours)))

    def carrying(self, now: float) -> Carry:
        """What moves the points of a scan on to a time [s]: see :meth:`carry`."""
        return partial(self.carry, now=now)

    def carry(self, points: Float, loose: Bool, since: float, *, now: float) -> Float:
        """Points (n, 2) of a scan of a time [s], those on bodies moved to where these are now [s].

        A scan is held until the next one; without it, returns would lag behind what they are of.
        Only loose ones (n,), returns of no known wall, are moved.
        """
        if not loose.any() or not self._obstacles:
            return points
        points, left = points.copy(), loose.copy()
        moved = zip(self._outlines, self.poses(since), self.poses(now), strict=True)
        for outline, before, after in moved:
            chosen = np.flatnonzero(left)
            local = in_body(points[chosen], before)
            own = shapely.distance(shapely.Polygon(outline), shapely.points(local)) < _NEAR
            points[chosen[own]] = placed(local[own], after)
            left[chosen[own]] = False
        return points
