"""Collisions of a drive with walls."""

from dataclasses import dataclass

import numpy as np

from lrf3d.errors import CollisionError
from lrf3d.geometry import Float, Int, number
from lrf3d.robot.trajectory import Trajectory
from lrf3d.world import World


@dataclass(frozen=True, slots=True)
class Collision:
    """The first collision of a drive with a wall: time [s], position [m], wall index."""

    time: float
    x: float
    y: float
    wall: int
    name: str

    def __str__(self) -> str:
        return (
            f"the robot runs into wall {self.wall}{self.name} at t = {self.time:.2f} s near"
            f" ({self.x:.2f}, {self.y:.2f})"
        )


class CollisionChecker:
    """Finds collisions with the walls of a world, by a search tree."""

    def __init__(self, world: World) -> None:
        import shapely

        self.world = world
        walls = world.segments.reshape(-1, 2, 2) - world.origin
        self._walls = shapely.linestrings(walls)
        self._tree = shapely.STRtree(self._walls)

    def hit(self, starts: Float, ends: Float, radius: float) -> tuple[Int, Int]:
        """Paths (k,) from starts (n, 2) to ends (n, 2) nearer to walls (k,) than a radius [m]."""
        import shapely

        paths = shapely.linestrings(np.stack([starts, ends], axis=1) - self.world.origin)
        # Shapely finds nothing near a line of zero length, so a robot at rest is a point.
        at_rest = (starts == ends).all(axis=1)
        paths[at_rest] = shapely.points(starts[at_rest] - self.world.origin)
        path, wall = self._tree.query(paths, predicate="dwithin", distance=radius)
        return path, wall

    def first(self, trajectory: Trajectory, radius: float) -> Collision | None:
        """The first collision of a round robot of a radius [m], or None."""
        import shapely

        world, positions = self.world, trajectory.poses[:, :2]
        ends = np.concatenate([positions[1:], positions[-1:]])
        step, wall = self.hit(positions, ends, radius)
        if not len(step):
            return None
        first = step.min()
        near = wall[step == first]
        path = shapely.linestrings(np.stack([positions[first], ends[first]]) - world.origin)
        hit = int(near[np.argmin(shapely.distance(self._walls[near], path))])
        owner = int(world.objects[hit])
        name = f" of {world.object_names[owner]}" if owner < len(world.object_names) else ""
        x, y = positions[first]
        return Collision(float(trajectory.times[first]), float(x), float(y), hit, name)


def find_collision(trajectory: Trajectory, world: World, radius: float) -> Collision | None:
    """The first collision of a round robot of a radius [m], or None.

    Raises:
        InputError: The radius is negative or not finite.
    """
    number(radius, "radius", "metres")
    return CollisionChecker(world).first(trajectory, radius) if len(world.segments) else None


def check_drive(trajectory: Trajectory, world: World, radius: float) -> None:
    """Check that a drive does not hit a wall.

    Raises:
        CollisionError: It does; the message gives the time, the position and the wall.

    Examples:
        >>> import lrf3d
        >>> wall = lrf3d.World([[2, -1, 2, 1]])
        >>> lrf3d.check_drive(lrf3d.follow_route([[0, 0], [1, 0]]), wall, radius=0.35)
    """
    collision = find_collision(trajectory, world, radius)
    if collision is not None:
        raise CollisionError(f"{collision}; move the route or pass --ignore-collisions")
