"""Planning a route: way-points through a world without a route, past most of its walls.

Lookouts are chosen in the free space and joined to a tour by paths with clearance to the walls; the
paths are straightened, and the drive along them is checked.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from lrf3d.base.errors import InputError, expect, shown
from lrf3d.casting.collision import CollisionChecker
from lrf3d.geometry.lines import LARGEST_COORDINATE, Float, Int, is_finite, numbers
from lrf3d.geometry.pose import as_pose
from lrf3d.planning import Side
from lrf3d.planning.free_space import COMFORT, MARGIN, FreeSpace, Ground, find_free_space
from lrf3d.planning.rooms import USUAL_RADII, missed_rooms
from lrf3d.planning.tour import find_tour
from lrf3d.robot.following import CONTROL_STEP, LOOKAHEAD, SPEED, drive_laps
from lrf3d.robot.kinematics import MOST_POSES, RADIUS
from lrf3d.world import World
from lrf3d.world.model import check_size


@dataclass(frozen=True, slots=True)
class PlannedRoute:
    """Way-points (m, 2) [m], the side of the walls, and the robot's radius, speed and look-ahead.

    The notes are what the user should know: the rooms that are not reached, and why.
    """

    waypoints: Float
    side: Side
    radius: float
    speed: float
    lookahead: float
    notes: tuple[str, ...] = ()


def plan_route(
    world: World,
    *,
    radius: float = RADIUS,
    range_max: float = 80.0,
    lookahead: float = LOOKAHEAD,
    where: Side | None = None,
    start: Sequence[float] | Float | None = None,
) -> Float:
    """Find way-points (m, 2) [m], two or more, from which most of the walls are seen.

    The same world gives the same route. In a world wider than 500 m it is planned only in the part
    with the most walls. In a plan of rooms it stays inside, even if doors lead out; in a town it
    runs between the buildings; in a map with free cells it keeps to these.

    Args:
        world: The walls.
        radius: Radius of the robot [m].
        range_max: Largest range of the laser [m].
        lookahead: Look-ahead [m] of `follow_route`; a shorter one fits through narrower doors.
        where: ``"inside"`` or ``"outside"``, the side of the walls to stay on; it depends on the
            world and the start if not given.
        start: Initial pose x, y [m], theta [rad], or only the position, where the route begins.

    Raises:
        InputError: There are no walls, there is no room to drive, the start is in a wall or on
            the other side of it, or a number is invalid.

    Examples:
        >>> import lrf3d
        >>> world = lrf3d.World([[0, 0, 8, 0], [8, 0, 8, 6], [8, 6, 0, 6], [0, 6, 0, 0]])
        >>> route = lrf3d.plan_route(world, range_max=10.0)
        >>> route.shape[1], bool((route > 0).all())
        (2, True)
    """
    found = find_route(
        world, radius=radius, range_max=range_max, lookahead=lookahead, where=where, start=start
    )
    return found.waypoints


def find_route(
    world: World,
    *,
    radius: float | None = None,
    speed: float | None = None,
    range_max: float = 80.0,
    lookahead: float = LOOKAHEAD,
    dt: float = CONTROL_STEP,
    where: Side | None = None,
    start: Sequence[float] | Float | None = None,
) -> PlannedRoute:
    """Find a route as `plan_route` does.

    If no radius is given it is 0.35 m, or that of a smaller robot where doors are too narrow; if no
    speed is given it is 1 m/s inside and 3 m/s outside. ``dt`` is the time between the commands of
    the drive [s].

    Raises:
        InputError: As of `plan_route`.
    """
    sizes = (radius or RADIUS, speed or SPEED, range_max, lookahead, dt)
    if not (is_finite(*sizes) and min(sizes) > 0.0):
        found = f"radius {radius}, speed {speed}, range_max {range_max}, lookahead {lookahead}"
        raise InputError(f"{found}: expected positive numbers")
    if where not in (None, "inside", "outside"):
        raise InputError(f"where {shown(where)}: expected 'inside', 'outside' or None")
    expect(world, World, "world")
    check_size(world)
    checker = CollisionChecker(world)
    position = None if start is None else _checked_start(checker, start, radius or RADIUS)
    notes: list[str] = []
    if world.free is not None and not world.free.cells.any():
        world = replace(world, free=None)
        notes.append("the map knows no cell to be free, so the route is planned by its walls alone")
    ground = Ground(world, position)
    if radius is None:
        radius = _fitting_radius(ground, where, position)
        if radius < RADIUS:
            smaller = f"the robot's radius is {radius:g} m instead of {RADIUS:g} m"
            notes.append(f"{smaller}: doors are too narrow for a wider one")
    space = find_free_space(ground, radius, where=where, start=position)
    legs = find_tour(space, world, range_max)
    waypoints = _straightened(space, legs) + world.origin
    if position is not None and (waypoints[0] != position).any():
        waypoints = np.vstack([position, waypoints])
    # Indoors, a brisk walk.
    pace = speed or (1.0 if space.side == "inside" else SPEED)
    pose = None if start is None or len(start) < 3 else as_pose(start)
    touched = np.inf
    # Least look-ahead [m], with which the robot keeps within centimetres of the route; and about
    # the least speed [m/s] to which a robot that would still touch something is slowed down.
    least_lookahead = 0.1
    least_speed = 0.25
    while True:
        # A long run drives back along the route, and sets out again from where it arrives.
        laps = drive_laps(
            waypoints, start=pose, speed=pace, lookahead=lookahead, dt=dt, most=MOST_POSES
        )
        drive = np.vstack([lap.poses[:, :2] for lap in laps])
        moves = np.hypot(*np.diff(drive, axis=0).T)
        before = touched
        touched = moves[checker.hit(drive[:-1], drive[1:], radius) >= 0].sum()
        # Where driving with more care does not help, the route itself is too close to a wall.
        if not 0.0 < touched < 0.8 * before:
            break
        if lookahead > least_lookahead:
            lookahead = max(0.5 * lookahead, least_lookahead)
        elif speed is None and pace > least_speed:
            pace = 0.5 * pace
            lookahead = 0.5 * lookahead
        else:
            break
    if space.side == "inside":
        entered = np.zeros(space.allowed.shape, dtype=np.bool_)
        entered[tuple(np.argwhere(space.allowed)[np.concatenate(legs)].T)] = True
        notes += missed_rooms(space, entered)
    return PlannedRoute(waypoints, space.side, radius, pace, lookahead, tuple(notes))


def _checked_start(
    checker: CollisionChecker, start: Sequence[float] | Float, radius: float
) -> Float:
    """The position (2,) of a start [m], which must not be in a wall."""
    position = np.asarray(numbers(start, "start"), dtype=np.float64)
    if position.shape not in ((2,), (3,)) or not (np.abs(position) <= LARGEST_COORDINATE).all():
        raise InputError(f"start {shown(start)}: expected finite numbers x, y or x, y, theta")
    x, y = position = position[:2]
    if checker.hit(position[None], position[None], radius)[0] >= 0:
        near = f"nearer to a wall than the robot's radius of {radius:g} m"
        raise InputError(f"start ({x:g}, {y:g}): {near}; move it")
    return position


def _fitting_radius(ground: Ground, where: Side | None, start: Float | None) -> float:
    """The usual radius [m], or a smaller one where doors keep it from a third of the inside."""
    *wider, smallest = (radius for radius in USUAL_RADII if radius >= 0.18)
    small = find_free_space(ground, smallest, where=where, start=start)
    if small.side == "outside":
        return RADIUS
    for radius in wider:
        # The cells that the robot could be in if all doors were wide.
        roomy = int((small.gaps >= radius + MARGIN).sum())
        with suppress(InputError):
            # A wider one may be at home in another house.
            space = find_free_space(ground, radius, where=where, start=start)
            if roomy and (space.allowed & small.allowed).sum() >= 2 / 3 * roomy:
                return radius
    return smallest


def _straightened(space: FreeSpace, legs: list[Int]) -> Float:
    """Way-points (m, 2) along the legs, straight as far as that costs no more than the legs.

    The ends of the legs, which are lookouts, always stay.
    """
    waypoints = [space.places[legs[0][0]]]
    for leg in legs:
        places = space.places[leg]
        gaps = space.gaps[leg]
        steps = np.hypot(*np.diff(places, axis=0).T)
        prices = space.cost(gaps)
        costs = np.append(0.0, np.cumsum(steps * 0.5 * (prices[1:] + prices[:-1])))
        here = 0
        there = 2
        while here < len(leg) - 1:
            if there < len(leg):
                cost = costs[there] - costs[here]
                least = gaps[here : there + 1].min()
                if _is_better(space, places[[here, there]], cost, least):
                    there += 1
                    continue
            waypoints.append(places[there - 1])
            here = there - 1
            there = there + 1
    return np.array(waypoints)


def _is_better(space: FreeSpace, ends: Float, cost: float, least: float) -> bool:
    """Whether the line between two places (2, 2) costs at most as much, as far from walls."""
    length = float(np.hypot(*(ends[1] - ends[0])))
    shares = np.linspace(0.0, 1.0, int(2.0 * length / space.ground.size) + 2)[:, None]
    gaps = np.asarray(space.ground.tree.query(ends[0] + shares * (ends[1] - ends[0]))[0])
    enough = gaps.min() >= min(least, space.radius + COMFORT) - 0.01
    prices = space.cost(gaps)
    mean = 0.5 * (prices[1:] + prices[:-1]).mean()
    # A straight line is worth a tenth more.
    return bool(enough and length * mean <= 1.1 * cost)
