"""Drawing dynamic obstacles: their bodies, and their shadows on the ground.

Enters: a run and a time of it. Leaves: primitives in the film's frame. Bodies are drawn by the
robot's program, each at its own pose, so that both renderers can draw them.
"""

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import shapely

from lrf3d.geometry import Bool, Float, Single
from lrf3d.render.primitives import Draw, Primitive
from lrf3d.scene.beams import Carry
from lrf3d.scene.bodies import (
    counter_clockwise,
    ground_plan,
    in_body,
    obstacle_bodies,
    obstacle_colours,
    placed,
    soft_shadow,
    world_from_robot,
)
from lrf3d.scene.look import SUN

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


class MovingBodies:
    """Draws the dynamic obstacles of a run; nothing if there are none.

    Args:
        obstacles: The dynamic obstacles.
        origin: (2,) of the film's frame in the world [m].
        indoor: Whether this is the inside of a house, where no sun shines.
    """

    def __init__(
        self, obstacles: "tuple[DynamicObstacle, ...]", origin: Float, indoor: bool
    ) -> None:
        self._obstacles = obstacles
        self._origin = np.array([*origin, 0.0])
        self._indoor = indoor
        self._outlines = [counter_clockwise(obstacle.outline) for obstacle in obstacles]
        colours = obstacle_colours(obstacles)
        self._bodies = [
            Primitive("robot", (3, 3, 3), body, cull=True) for body in obstacle_bodies(obstacles)
        ]
        self._plans = [
            Primitive("flat", (2, 4), ground_plan(outline, colour), blend=True)
            for outline, colour in zip(self._outlines, colours, strict=True)
        ]
        empty = np.zeros((0, 6), np.float32)
        self._shadow = [
            Primitive("flat", (2, 4), empty, capacity=256, blend=True) for _ in obstacles[:1]
        ]
        self._shadowed: Float = np.full((len(obstacles), 3), np.nan)

    @property
    def all(self) -> tuple[Primitive, ...]:
        """All primitives."""
        return (*self._bodies, *self._shadow, *self._plans)

    def poses(self, time: float) -> Float:
        """Poses (m, 3) of all bodies at a time [s] in the film's frame."""
        poses = [obstacle.path.at(np.array([time]))[0] for obstacle in self._obstacles]
        return np.asarray(np.reshape(poses, (-1, 3)) - self._origin)

    def bodies(self, time: float) -> Iterator[Draw]:
        """The bodies at a time [s]."""
        for body, pose in zip(self._bodies, self.poses(time), strict=True):
            yield Draw(body, {"world_from_robot": world_from_robot(pose)})

    def shadows(self, time: float) -> Iterator[Draw]:
        """The shadows of all bodies at a time [s]."""
        poses = self.poses(time)
        if not np.array_equal(poses, self._shadowed):
            self._shadowed = poses
            self._shadow[0].update(self._cast_shadows(poses))
        lifted = np.eye(4)
        lifted[2, 3] = _LIFT
        for shadow in self._shadow:
            yield Draw(shadow, {"place": lifted})

    def plans(self, time: float, pixel: float) -> Iterator[Draw]:
        """The bodies from straight above, in a picture whose pixels have a size [m]."""
        for plan, obstacle, pose in zip(
            self._plans, self._obstacles, self.poses(time), strict=True
        ):
            matrix = world_from_robot(pose)
            matrix[:2, :2] *= max(1.0, _LEAST * pixel / obstacle.reach)
            yield Draw(plan, {"place": matrix})

    def carrying(self, now: float) -> Carry:
        """What moves the points of a scan on to a time [s]: see :meth:`carry`."""
        return partial(self.carry, now=now)

    def _cast_shadows(self, poses: Float) -> Single:
        """Triangles (v, 6) of the shadows of bodies at poses (m, 3)."""
        fringe = _FRINGE_INDOOR if self._indoor else _FRINGE
        dark = _SHADOW_INDOOR if self._indoor else _SHADOW
        shadows = []
        for pose, outline, obstacle in zip(poses, self._outlines, self._obstacles, strict=True):
            corners = placed(outline, pose)
            if not self._indoor:
                slide = -SUN[:2] / SUN[2] * obstacle.height
                corners = np.concatenate([corners, corners + slide])
            shadows.append(soft_shadow(corners, fringe, dark))
        return np.concatenate(shadows)

    def carry(self, points: Float, loose: Bool, since: float, *, now: float) -> Float:
        """Points (n, 2) of a scan, those on bodies moved to where these are at another time.

        A scan is held until the next one; without it, returns would lag behind what they are of.

        Args:
            points: Where the beams ended in the film's frame [m].
            loose: (n,) which of them are returns of no known wall.
            since: When the scan was taken [s].
            now: The other time [s].
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
