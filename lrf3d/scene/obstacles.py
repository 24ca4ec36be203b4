"""The dynamic obstacles of a run as they are drawn: bodies, shadows, and plans from above."""

from typing import TYPE_CHECKING

import numpy as np

from lrf3d.geometry import Float
from lrf3d.scene.bodies import (
    counter_clockwise,
    obstacle_body,
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

_SHADOW, _SHADOW_INDOOR = (0.08, 0.42), (0.35, 0.30)
"""Width of the soft edge of the shadow on the ground [m], in the sun narrow, in a lit room wide,
and its darkness."""

_LIFT = 0.01
"""Height of the shadow above the ground [m]."""

_LEAST = 2.5
"""Least half size of a body in the inset [pixels], so that it can be seen."""


class Obstacles:
    """The dynamic obstacles of a run, in a frame with an origin (2,) in the world [m].

    Indoors no sun shines on them.
    """

    def __init__(
        self, obstacles: "tuple[DynamicObstacle, ...]", origin: Float, *, indoor: bool
    ) -> None:
        self._obstacles, self._indoor = obstacles, indoor
        self._origin = np.array([*origin, 0.0])
        self._outlines = [counter_clockwise(obstacle.outline) for obstacle in obstacles]
        self._colours = obstacle_colours(len(obstacles))
        self._bodies = [
            obstacle_body(outline, obstacle.height, colour)
            for outline, obstacle, colour in zip(
                self._outlines, obstacles, self._colours, strict=True
            )
        ]

    def poses(self, time: float) -> Float:
        """Poses (m, 3) of all bodies at a time [s] in the film's frame."""
        poses = [obstacle.path.at(np.array([time]))[0] for obstacle in self._obstacles]
        return np.asarray(np.reshape(poses, (-1, 3)) - self._origin)

    def bodies(self, time: float) -> list[tuple[str, Body]]:
        """The bodies at a time [s]."""
        return [
            (f"obstacle {number}", Body(faces, world_from_robot(pose)))
            for number, (faces, pose) in enumerate(zip(self._bodies, self.poses(time), strict=True))
        ]

    def shadows(self, time: float) -> Soft | None:
        """The shadows of all bodies at a time [s]."""
        fringe, dark = _SHADOW_INDOOR if self._indoor else _SHADOW
        shadows = []
        for pose, outline, obstacle in zip(
            self.poses(time), self._outlines, self._obstacles, strict=True
        ):
            corners = placed(outline, pose)
            if not self._indoor:
                slide = -SUN[:2] / SUN[2] * obstacle.height
                corners = np.concatenate([corners, corners + slide])
            shadows.append(soft_shadow(corners, fringe, dark, _LIFT))
        return _joined(shadows)

    def plans(self, time: float, pixel: float) -> Soft | None:
        """The bodies from straight above, in a picture whose pixels have a size [m]."""
        plans = []
        for outline, colour, obstacle, pose in zip(
            self._outlines, self._colours, self._obstacles, self.poses(time), strict=True
        ):
            size = max(1.0, _LEAST * pixel / obstacle.reach)
            level = placed(size * outline_triangles(outline).reshape(-1, 2), pose)
            corners = np.column_stack([level, np.zeros(len(level))]).reshape(-1, 3, 3)
            colours = np.tile([*colour, 1.0], (len(corners), 3, 1))
            plans.append(Soft(single(corners), single(colours)))
        return _joined(plans)


def _joined(parts: list[Soft]) -> Soft | None:
    """All in one; None for nothing."""
    if not parts:
        return None
    return Soft(*(np.concatenate(column) for column in zip(*parts, strict=True)))
