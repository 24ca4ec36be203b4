"""DynamicObstacle: another robot, a person or a car that moves among the walls."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from lrf3d.base.errors import InputError, shown
from lrf3d.geometry.lines import Float, Value, as_rows, number
from lrf3d.laser.range_finder import turn
from lrf3d.robot import Trajectory
from lrf3d.robot.following import Patrol
from lrf3d.world.model import DEFAULT_HEIGHT


@dataclass(frozen=True, eq=False, repr=False)
class DynamicObstacle(Value):
    """An obstacle that moves along a path: another robot, a person, a car.

    Args:
        outline: (n, 2) its corners [m] in its own frame, x ahead; the last one joins the first.
        path: Its poses over time: a Trajectory, before and after which it is at rest, or a Patrol,
            which runs there and back along a route forever.
        height: Its height [m].
        is_robot: Whether it is another robot, and drawn as one.

    Raises:
        InputError: The outline has fewer than three corners, or a number is not finite.

    Examples:
        >>> import lrf3d
        >>> from lrf3d.casting.dynamic_obstacle import round_outline
        >>> walk = lrf3d.Trajectory([0, 2], [(3, -1, 1.57), (3, 1, 1.57)])
        >>> person = lrf3d.DynamicObstacle(round_outline(0.3), walk, height=1.8)
        >>> person.path.at([1.0]).round(2).tolist()
        [[3.0, 0.0, 1.57]]
    """

    outline: Float
    path: Trajectory | Patrol
    height: float = DEFAULT_HEIGHT
    is_robot: bool = field(default=False, repr=False)

    def __post_init__(self) -> None:
        if not isinstance(self.path, Trajectory | Patrol):
            raise InputError(
                f"dynamic obstacle on the path {shown(self.path)}: expected a Trajectory or Patrol"
            )
        as_rows(self.outline, "dynamic obstacle: outline", 2, least=3, row="corner")
        number(self.height, "dynamic obstacle: height", "metres", positive=True)
        self._hold("outline")

    @cached_property
    def reach(self) -> float:
        """Largest distance of its corners from its origin [m]."""
        return float(np.hypot(self.outline[:, 0], self.outline[:, 1]).max())

    @property
    def poses(self) -> Trajectory:
        """The path as a Trajectory; raises for a Patrol, which has no end."""
        if isinstance(self.path, Patrol):
            raise InputError("dynamic obstacle on a patrol without an end; call its until(time)")
        return self.path

    def until(self, time: float) -> DynamicObstacle:
        """The obstacle on a Trajectory up to a time [s]."""
        return replace(self, path=self.path.until(time)) if isinstance(self.path, Patrol) else self

    def walls(self, time: float) -> Float:
        """Its sides (n, 4) in the world at a time [s]."""
        x, y, theta = self.path.at(np.array([time]))[0].tolist()
        # A product of matrices would have other last bits on other processors.
        ahead, left = turn(self.outline[:, 0], self.outline[:, 1], math.cos(theta), math.sin(theta))
        corners = np.column_stack([ahead + x, left + y])
        return np.hstack([corners, np.roll(corners, -1, axis=0)])


def round_outline(radius: float) -> Float:
    """A regular polygon (16, 2) around a circle of a radius [m], nowhere narrower than it."""
    number(radius, "radius", "metres", positive=True)
    turns = 2.0 * np.pi / 16 * (np.arange(16) + 0.5)
    reach = radius / np.cos(np.pi / 16)
    return np.asarray(reach * np.column_stack([np.cos(turns), np.sin(turns)]))
