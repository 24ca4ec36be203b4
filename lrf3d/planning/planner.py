"""Planning a route: way-points through a world without a route, past most of its walls.

Lookouts in the free space are joined to a tour by paths with clearance to the walls. The paths are
straightened, and the drive along them is checked for collisions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from lrf3d.base.errors import InputError, expect, shown
from lrf3d.base.text import Note, counted
from lrf3d.casting.collision import CollisionChecker
from lrf3d.geometry.lines import LARGEST_COORDINATE, Float, Int, is_finite, numbers
from lrf3d.geometry.pose import Pose, as_pose
from lrf3d.laser import LaserRangeFinder
from lrf3d.planning import Side
from lrf3d.planning.free_space import COMFORT, MARGIN, FreeSpace, Ground, find_free_space
from lrf3d.planning.rooms import USUAL_RADII, missed_rooms
from lrf3d.planning.tour import find_tour, paths_from
from lrf3d.robot.following import CONTROL_STEP, LOOKAHEAD, SPEED, drive_laps
from lrf3d.robot.kinematics import MOST_POSES, RADIUS
from lrf3d.world.model import World, check_size

# Largest range [m] of a laser for which none is given.
RANGE_MAX = LaserRangeFinder().range_max

# Least look-ahead [m]: with it the robot keeps within centimetres of the route.
LEAST_LOOKAHEAD = 2.0 * MARGIN

# Speed [m/s] down to which a robot that would touch something is slowed.
LEAST_SPEED = 0.25

# Speed indoors [m/s]: a brisk walk.
INDOOR_SPEED = 1.0


@dataclass(frozen=True, slots=True)
class PlannedRoute:
    """Way-points (m, 2) [m], the side of the walls, and the robot's radius, speed and look-ahead.

    The notes report which rooms the route does not reach, and why; ``missed`` holds those on rooms
    and goals that are out of reach.
    """

    waypoints: Float
    side: Side
    radius: float
    speed: float
    lookahead: float
    notes: tuple[Note, ...] = ()
    missed: tuple[Note, ...] = ()


def plan_route(
    world: World,
    *,
    radius: float = RADIUS,
    range_max: float = RANGE_MAX,
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
    range_max: float = RANGE_MAX,
    lookahead: float = LOOKAHEAD,
    dt: float = CONTROL_STEP,
    where: Side | None = None,
    start: Sequence[float] | Float | None = None,
    goals: Float | None = None,
    keep_out: Sequence[Float] = (),
) -> PlannedRoute:
    """Find a route as `plan_route` does, or one through goals (m, 2) [m] in their order.

    Areas (k, 2) [m] may be excluded. The default radius is 0.35 m, or smaller if doors are too
    narrow; the default speed is 1 m/s inside and 3 m/s outside. ``dt`` is the time between the
    commands of the drive [s].

    Raises:
        InputError: As for `plan_route`.
    """
    _check(world, where, radius, speed, range_max, lookahead, dt)
    checker = CollisionChecker(world)
    first = goals[0] if goals is not None and start is None else start
    position, pose = _checked_start(checker, first, radius or RADIUS)
    notes = [] if position is None else _closed_in(world, position)
    if world.free is not None and not world.free.cells.any():
        world = replace(world, free=None)
        notes.append(Note("the map knows no free cell, so the route is planned by its walls alone"))
    ground = Ground(world, position, keep_out)
    fitting = radius or fitting_radius(ground, where, position)
    if radius is None and fitting < RADIUS:
        smaller = f"the robot's radius is {fitting:g} m instead of {RADIUS:g} m"
        notes.append(Note(f"{smaller}: doors are too narrow for a wider one"))
    space = find_free_space(ground, fitting, where=where, start=position)
    missed = list[Note]()
    legs = find_tour(space, world, range_max) if goals is None else _legs(space, goals, missed)
    waypoints = _straightened(space, legs, position)

    def touched(pace: float, ahead: float) -> float:
        """Metres of a drive at a speed and with a look-ahead that touch something."""
        # A long run drives back along the route, and sets out again from where it arrives.
        laps = drive_laps(
            waypoints, start=pose, speed=pace, lookahead=ahead, dt=dt, most=MOST_POSES
        )
        drive = np.vstack([lap.poses[:, :2] for lap in laps])
        moves = np.hypot(*np.diff(drive, axis=0).T)
        return float(moves[checker.hit(drive[:-1], drive[1:], fitting) >= 0].sum())

    usual = INDOOR_SPEED if space.side == "inside" else SPEED
    trials = _ever_more_careful(speed or usual, lookahead, slower=speed is None)
    pace, lookahead = _with_care(trials, touched)
    if goals is None:
        missed, long = missed_rooms(space, legs)
        notes += long
    said = tuple(notes + missed)
    return PlannedRoute(waypoints, space.side, fitting, pace, lookahead, said, tuple(missed))


def _legs(space: FreeSpace, goals: Float, missed: list[Note]) -> list[Int]:
    """The paths from the start through goals (m, 2) [m]; notes name those that are missed.

    Raises:
        InputError: None of the goals can be reached.
    """
    here = space.nearest(goals[0]) if space.start is None else int(space.number[space.start])
    legs = list[Int]()
    for goal in goals:
        there = space.nearest(goal)
        if there is None:
            place = "({:.2f}, {:.2f})".format(*goal)
            missed.append(Note(f"the goal {place} is not reached: {space.why_missed(goal)}"))
        elif here is not None and there != here:
            legs += paths_from(space, here, np.array([there]))
            here = there
    if not legs:
        raise InputError(str([*missed, "no goal is elsewhere than the start"][0]))
    return legs


def planned_way(world: World, start: Float, goal: Float, radius: float) -> Float | None:
    """Way-points (m, 2) [m] from a start to a goal (2,) [m]; None if walls block the path."""
    try:
        space = find_free_space(Ground(world, start), radius, start=start)
    except InputError:
        return None
    here, there = space.nearest(start), space.nearest(goal)
    if here is None or there is None:
        return None
    if here == there:
        return np.array([start, goal])
    return _straightened(space, paths_from(space, here, np.array([there])), start)


def _check(world: World, where: Side | None, *sizes: float | None) -> None:
    """Check a world, the side of its walls, and sizes of a robot, where these are given."""
    given = [size for size in sizes if size is not None]
    if not (is_finite(*given) and min(given) > 0.0):
        found = "radius {}, speed {}, range_max {}, lookahead {}".format(*sizes)
        raise InputError(f"{found}: expected positive numbers")
    if where not in (None, "inside", "outside"):
        raise InputError(f"where {shown(where)}: expected 'inside', 'outside' or None")
    expect(world, World, "world")
    check_size(world)


def _ever_more_careful(
    pace: float, lookahead: float, *, slower: bool
) -> Iterator[tuple[float, float]]:
    """Speeds [m/s] and look-aheads [m]: ever shorter ones keep the robot closer to the route.

    After these, the robot may also drive ever slower, with even shorter ones.
    """
    yield pace, lookahead
    while lookahead > LEAST_LOOKAHEAD:
        lookahead = max(0.5 * lookahead, LEAST_LOOKAHEAD)
        yield pace, lookahead
    while slower and pace > LEAST_SPEED:
        pace *= 0.5
        lookahead *= 0.5
        yield pace, lookahead


def _with_care(
    trials: Iterator[tuple[float, float]], touched: Callable[[float, float], float]
) -> tuple[float, float]:
    """The first speed and look-ahead with which nothing is touched, or the last that were tried.

    Where more care does not help, the route itself is too close to a wall.
    """
    before = np.inf
    for pace, lookahead in trials:
        now = touched(pace, lookahead)
        if not 0.0 < now < 0.8 * before:
            break
        before = now
    return pace, lookahead


def _checked_start(
    checker: CollisionChecker, start: Sequence[float] | Float | None, radius: float
) -> tuple[Float | None, Pose | None]:
    """The position (2,) [m] of a start, which must not be in a wall, and its pose if given."""
    if start is None:
        return None, None
    position = np.asarray(numbers(start, "start"), dtype=np.float64)
    if position.shape not in ((2,), (3,)) or not (np.abs(position) <= LARGEST_COORDINATE).all():
        raise InputError(f"start {shown(start)}: expected finite numbers x, y or x, y, theta")
    pose = as_pose(start) if len(position) == 3 else None
    x, y = position = position[:2]
    if checker.hit(position[None], position[None], radius)[0] >= 0:
        near = f"nearer to a wall than the robot's radius of {radius:g} m"
        raise InputError(f"start ({x:g}, {y:g}): {near}; move it")
    return position, pose


def _closed_in(world: World, start: Float) -> list[Note]:
    """A note if the start is inside a closed shape without inner walls, and other walls outside."""
    import shapely

    walls = shapely.linestrings(world.segments.reshape(-1, 2, 2))
    shapes = shapely.get_parts(shapely.polygonize([shapely.union_all(walls)]))
    for shape in shapes[shapely.contains(shapes, shapely.Point(start))]:
        # What is in the box around it may be another room of the same plan.
        others = int(np.count_nonzero(~shapely.intersects(walls, shape.envelope)))
        if not len(shape.interiors) and others:
            x1, y1, x2, y2 = shape.bounds
            size = f"{x2 - x1:.1f} m by {y2 - y1:.1f} m"
            where = f"the start ({start[0]:g}, {start[1]:g}) is inside a closed shape of {size}"
            found = f"{where}, such as a box, with {counted(others, 'wall')} outside"
            return [Note(found, "move it")]
    return []


def fitting_radius(ground: Ground, where: Side | None, start: Float | None) -> float:
    """The usual radius [m], or a smaller one where doors keep it from a third of the inside."""
    *wider, smallest = USUAL_RADII[:4]  # Those from 0.18 m.
    small = find_free_space(ground, smallest, where=where, start=start)
    if small.side == "outside":
        return RADIUS
    for radius in wider:
        # The cells where the robot could be if all doors were wide.
        roomy = int((small.gaps >= radius + MARGIN).sum())
        with suppress(InputError):
            # A wider one may end up in another part of the free space.
            space = find_free_space(ground, radius, where=where, start=start)
            if roomy and (space.allowed & small.allowed).sum() >= 2 / 3 * roomy:
                return radius
    return smallest


def _straightened(space: FreeSpace, legs: list[Int], start: Float | None) -> Float:
    """Way-points (m, 2) [m] from a start along the legs, straight where that costs no more.

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
            here = there - 1
            there += 1
            waypoints.append(places[here])
    route: Float = np.array(waypoints) + space.ground.world.origin
    return route if start is None or (route[0] == start).all() else np.vstack([start, route])


def _is_better(space: FreeSpace, ends: Float, cost: float, least: float) -> bool:
    """Whether the line between two places (2, 2) costs no more, and is as far from walls."""
    length = float(np.hypot(*(ends[1] - ends[0])))
    shares = np.linspace(0.0, 1.0, int(2.0 * length / space.ground.size) + 2)[:, None]
    gaps = space.ground.clearance(ends[0] + shares * (ends[1] - ends[0]))
    enough = gaps.min() >= min(least, space.radius + COMFORT) - 0.01
    prices = space.cost(gaps)
    mean = 0.5 * (prices[1:] + prices[:-1]).mean()
    # A straight line is worth a tenth more.
    return bool(enough and length * mean <= 1.1 * cost)
