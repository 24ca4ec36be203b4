"""Collisions of a robot's body with walls, dynamic obstacles and other robots."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.base.errors import CollisionError, InputError, each_of, expect
from lrf3d.casting.crowd import Crowd, grid_over, move_of, moves_of, records
from lrf3d.casting.dynamic_obstacle import DynamicObstacle, round_outline
from lrf3d.casting.kernels.touch import EDGE, touched, touched_among
from lrf3d.casting.kernels.tree import Plain, Tree, build_tree
from lrf3d.geometry.lines import Float, Int, Records, Value, as_rows, number
from lrf3d.geometry.pose import Pose, between
from lrf3d.robot.kinematics import RADIUS, Twist, hold
from lrf3d.robot.odometry import twist_of
from lrf3d.robot.trajectory import Trajectory
from lrf3d.world import World

# [m] Height of robots as other lasers see them.
ROBOT_HEIGHT = 1.0


@dataclass(frozen=True, eq=False)
class Body(Value):
    """The body of a robot: a disc of a radius [m], or an outline (n, 2) [m], x ahead.

    Raises:
        InputError: A number is invalid, or the outline crosses itself or is not around the origin.

    Examples:
        >>> from lrf3d.casting.collision import Body
        >>> Body(0.3).reach, Body(outline=[(-0.2, -0.2), (0.4, 0.0), (-0.2, 0.2)]).reach
        (0.3, 0.4)
    """

    radius: float = RADIUS
    outline: ArrayLike | None = None

    def __post_init__(self) -> None:
        largest = 50.0  # [m] Largest reach of a body: larger numbers are millimetres.
        number(self.radius, "radius", "metres", most=largest)
        if self.outline is None:
            return
        from shapely import Point, Polygon

        corners = as_rows(self.outline, "outline", 2, least=3, row="corner")
        shape = Polygon(corners)
        if not shape.is_valid or not shape.contains(Point(0.0, 0.0)):
            what = "contain the robot's centre (0, 0)" if shape.is_valid else "be free of crossings"
            raise InputError(f"outline: expected to {what}")
        if (reach := float(np.hypot(*corners.T).max())) > largest:
            raise InputError(
                f"outline: {reach:g} m from the centre; expected at most {largest:g} m"
            )
        if not shape.exterior.is_ccw:
            object.__setattr__(self, "outline", corners[::-1])
        self._hold("outline")

    @property
    def shape(self) -> Float:
        """The outline (n, 2) [m] as others see it."""
        return round_outline(self.radius) if self.outline is None else np.asarray(self.outline)

    @property
    def reach(self) -> float:
        """Largest distance of a point of the body from its origin [m]."""
        return self.plain[2]  # type: ignore[no-any-return]

    @cached_property
    def plain(self) -> Plain:
        """The body as kernels take it."""
        if self.outline is None:
            return np.zeros(1, EDGE), float(self.radius), float(self.radius)
        tips: Float = np.asarray(self.outline)
        after = np.roll(tips, -1, axis=0)
        edges = after - tips
        normals = np.column_stack([-edges[:, 1], edges[:, 0]])
        normals /= np.hypot(*edges.T)[:, None]
        before = np.roll(edges, 1, axis=0)
        notch = (before[:, 0] * edges[:, 1] - before[:, 1] * edges[:, 0] < 0.0).astype(np.float64)
        inner = normals + np.roll(normals, 1, axis=0)
        sides = records(EDGE, *tips.T, *after.T, *inner.T, notch, np.roll(notch, -1))
        return sides, 0.0, float(np.hypot(*tips.T).max())


def robots_among(
    body: Body,
    paths: Sequence[Trajectory],
    obstacles: Sequence[DynamicObstacle],
    height: float = ROBOT_HEIGHT,
) -> tuple[list[DynamicObstacle], Crowd]:
    """Robots of one body on paths, and the crowd of these and of other obstacles."""
    robots = [DynamicObstacle(body.shape, path, height, is_robot=True) for path in paths]
    # Round ones are seen as polygons, and touch as discs.
    disc = body.radius if body.outline is None else 0.0
    return robots, Crowd([*robots, *obstacles], [disc] * len(robots) + [0.0] * len(obstacles))


@dataclass(frozen=True, slots=True)
class Collision:
    """When [s] and where [m] a robot first touches something: a wall, or an obstacle or robot.

    The wall and the obstacle are indices, one of them −1; the name says what it is.
    """

    time: float
    x: float
    y: float
    wall: int
    name: str
    obstacle: int = -1

    def __str__(self) -> str:
        return (
            f"the robot runs into {self.name} at t = {self.time:.2f} s near"
            f" ({self.x:.2f}, {self.y:.2f})"
        )


class CollisionChecker:
    """Finds what bodies touch among the walls of a world and dynamic obstacles.

    The obstacles may be given as a crowd, with a name for each.
    """

    def __init__(
        self,
        world: World,
        obstacles: Sequence[DynamicObstacle] | Crowd = (),
        *,
        names: Sequence[str] | None = None,
    ) -> None:
        self.world = world
        self._crowd = obstacles if isinstance(obstacles, Crowd) else Crowd(obstacles)
        self._names = names

    @cached_property
    def _tree(self) -> Tree:
        return build_tree(self.world.segments)

    def without(self, own: int) -> "CollisionChecker":
        """The same checker for a robot that is one of the obstacles itself."""
        other = copy(self)
        other._crowd = self._crowd.without(own)
        return other

    def touch(
        self, body: Body, moves: Records, seconds: Float, own: Int | None = None
    ) -> tuple[Float, Int, Int]:
        """When bodies that hold moves (k,) first touch something: seconds, walls and obstacles.

        They are +inf, −1 and −1 (k,) where nothing is touched within the seconds (k,). Own (k,) are
        the obstacles that are the bodies themselves.
        """
        own = np.full(len(moves), self._crowd.own) if own is None else own
        walls, met = np.empty((2, len(moves)), np.int64)
        found = np.empty(len(moves)), walls, met
        touched(self._tree[:], body.plain, moves, seconds, found)
        if len(self._crowd):
            grid = grid_over(len(self._crowd))
            touched_among(self._crowd.plain, grid, body.plain, moves, seconds, own, found)
        return found

    def hit(self, starts: Float, ends: Float, radius: float) -> Int:
        """The walls (k,) that discs touch on straight paths from starts to ends (k, 2), or −1."""
        poses, ways = (np.column_stack([xy, np.zeros(len(xy))]) for xy in (starts, ends - starts))
        return self.touch(Body(radius), moves_of(0.0, poses, ways), np.ones(len(poses)))[1]

    def held(
        self, body: Body, pose: Pose, twist: Twist, begin: float, seconds: float
    ) -> Collision | None:
        """The first collision while a twist is held from a pose and a time [s] on, or None."""
        found = self.touch(body, move_of(begin, pose, twist), np.array([seconds]))
        after = float(found[0][0])
        wall = int(found[1][0])
        obstacle = int(found[2][0])
        if after == np.inf:
            return None
        x, y, _ = hold(pose, twist, after)
        if obstacle >= 0:
            name = self._names[obstacle] if self._names else f"dynamic obstacle {obstacle}"
        else:
            names = self.world.object_names
            owner = int(self.world.objects[wall])
            name = f"wall {wall}" + (f" of {names[owner]}" if owner < len(names) else "")
        return Collision(begin + after, x, y, wall, name, obstacle)

    def first(self, trajectory: Trajectory, body: Body) -> Collision | None:
        """The first collision of a body on a trajectory, or None.

        A disc drives straight from pose to pose, an outline on the arc that leads there.
        """
        poses = trajectory.poses
        times = trajectory.times
        if body.outline is None and not len(self._crowd) and self._is_clear(poses, body.radius):
            return None
        # At the last pose it rests.
        after = np.concatenate([poses[1:], poses[-1:]])
        seconds = np.append(np.diff(times), 1.0)
        if body.outline is None:
            poses = np.column_stack([poses[:, :2], np.zeros(len(poses))])
            twists = (after - trajectory.poses) / seconds[:, None]
            twists[:, 2] = 0.0
        else:
            twists = twist_of(between(poses, after)) / seconds[:, None]
        seconds[-1] = 0.0
        found = self.touch(body, moves_of(times, poses, twists), seconds)[0]
        if (found == np.inf).all():
            return None
        step = int(np.argmax(found < np.inf))
        return self.held(
            body,
            Pose(*poses[step].tolist()),
            tuple(twists[step].tolist()),
            float(times[step]),
            float(seconds[step]),
        )

    def _is_clear(self, poses: Float, radius: float) -> bool:
        """Whether a disc on the path plainly touches no wall: most do not, and need no kernel."""
        import shapely

        room = radius + 1e-6 + 1e-12 * float(np.abs(self.world.segments).max(initial=0.0))
        walls = shapely.STRtree(shapely.linestrings(self.world.segments.reshape(-1, 2, 2)))
        places = poses[:, :2]
        steps = shapely.linestrings(np.stack([places[:-1], places[1:]], axis=1))
        # A step without length is no line.
        path = np.append(shapely.points(places), steps)
        return not walls.query(path, "dwithin", room).size

    def checked(self, trajectory: Trajectory, body: Body, stops: bool) -> Trajectory:
        """A trajectory without a collision; one that ends where the body touches, if it stops.

        Raises:
            CollisionError: The body touches something, and does not stop.
        """
        collision = self.first(trajectory, body)
        if collision is None:
            return trajectory
        if not stops:
            raise CollisionError(str(collision))
        poses = trajectory.poses.copy()
        poses[trajectory.times > collision.time, :2] = collision.x, collision.y
        return Trajectory(trajectory.times, poses)


def find_collision(
    trajectory: Trajectory,
    world: World,
    radius: float | Body,
    obstacles: Sequence[DynamicObstacle] = (),
) -> Collision | None:
    """The first collision of a robot of a radius [m], or with a body, or None.

    Raises:
        InputError: The radius is negative or not finite.
    """
    body = radius if isinstance(radius, Body) else Body(radius)
    return CollisionChecker(world, obstacles).first(trajectory, body)


def check_drive(
    trajectory: Trajectory,
    world: World,
    radius: float | Body,
    obstacles: Sequence[DynamicObstacle] = (),
) -> None:
    """Check that a drive touches no wall, and no dynamic obstacle.

    Raises:
        CollisionError: It does; the message gives the time, the position and what is touched.

    Examples:
        >>> import lrf3d
        >>> wall = lrf3d.World([[2, -1, 2, 1]])
        >>> lrf3d.check_drive(lrf3d.follow_route([[0, 0], [1, 0]]), wall, radius=0.35)
    """
    expect(trajectory, Trajectory, "trajectory")
    expect(world, World, "world")
    obstacles = tuple(each_of(obstacles, DynamicObstacle, "obstacle"))
    collision = find_collision(trajectory, world, radius, obstacles)
    if collision is not None:
        raise CollisionError(f"{collision}; move the route or pass --ignore-collisions")
