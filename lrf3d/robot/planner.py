"""Planning a route: way-points through a world without a route, past most of its walls.

Viewpoints are chosen in the free space and joined to a tour by paths with clearance to the walls;
then the paths are straightened.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from lrf3d.errors import InputError, shown
from lrf3d.geometry import Float, Int, is_finite, numbers
from lrf3d.robot.collision import find_collision
from lrf3d.robot.following import CONTROL_STEP, LOOKAHEAD, follow_route
from lrf3d.robot.free_space import FreeSpace, Side, find_free_space
from lrf3d.robot.tour import Network, best_tour
from lrf3d.robot.trajectory import Trajectory
from lrf3d.robot.unicycle import RADIUS
from lrf3d.robot.viewpoints import look_around
from lrf3d.world import World
from lrf3d.world.model import LARGEST_COORDINATE
from lrf3d.world.size import check_size

SHORTEST_ROUTE = 20.0
"""Shortest route [m], some seconds of driving: if a few steps show all walls, as in a room, the
robot also drives to the ends of the free space and back."""

FEW_STEPS = 5.0
"""Length [m] up to which a route is only a fallback: wider margins are tried for a longer one."""

LONGEST_ROUTE = 800.0
"""Longest route [m]: about five minutes at 3 m/s."""

MARGINS = (0.3, 0.6, 0.9)
"""Margins [m] between the robot and walls, for the corners that a follower cuts: the smallest one
with which the route can be followed is used, because wider ones close doors."""

DOOR_MARGINS = (0.05, 0.12)
"""Margins [m] that are tried before `MARGINS`, for doors that are too narrow for those; elsewhere
the route still prefers the wider margin."""

DOOR_GAIN = 1.1
"""Least factor by which narrow doors must enlarge the free space, or the length of the walls along
it, for the robot to go through them."""

LONGEST_LEG = 30.0
"""Longest straight piece of a route [m]."""

NO_ROOM = "no room to drive between the walls; give a route or poses to stand at"


@dataclass(frozen=True, slots=True)
class PlannedRoute:
    """A route, and the side of the walls that it is on.

    Args:
        waypoints: (m, 2) way-points [m], two or more.
        side: The side of the walls that it starts on; from the outside it may lead inside.
    """

    waypoints: Float
    side: Side

    @property
    def length(self) -> float:
        """Length [m] of the route."""
        return float(np.hypot(*np.diff(self.waypoints, axis=0).T).sum())


def plan_route(
    world: World,
    *,
    radius: float = RADIUS,
    clearance: float = 2.0,
    range_max: float = 80.0,
    lookahead: float = LOOKAHEAD,
    where: Side | None = None,
    start: Sequence[float] | Float | None = None,
) -> Float:
    """Find way-points (m, 2) [m], two or more, from which most of the walls are seen.

    The same world gives the same route. In a world wider than 500 m the route is planned only in
    the part with the most walls. In a plan of rooms it stays inside, even if doors lead out; in a
    town it runs between the buildings; in a map with free cells it keeps to these. If no route can
    be followed without touching a wall, the preferred one is returned anyway, and
    `check_drive` reports where the robot would touch.

    Args:
        world: The walls.
        radius: Radius of the robot [m]; it keeps this and 0.3 m away from walls, except in
            narrower doors that lead to rooms.
        clearance: Distance to walls [m] that is kept where there is room.
        range_max: Largest range of the laser [m].
        lookahead: Look-ahead [m] of `follow_route` on the route; a shorter one fits through
            narrower doors.
        where: ``"inside"`` or ``"outside"``, the side of the walls to stay on; it depends on the
            world and the start if not given.
        start: Initial pose x, y [m], theta [rad], or only the position; the route begins there and
            stays in the space around it. Anywhere if not given.

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
    return find_route(
        world,
        radius=radius,
        clearance=clearance,
        range_max=range_max,
        lookahead=lookahead,
        where=where,
        start=start,
    ).waypoints


def find_route(
    world: World,
    *,
    radius: float = RADIUS,
    clearance: float = 2.0,
    range_max: float = 80.0,
    lookahead: float = LOOKAHEAD,
    where: Side | None = None,
    start: Sequence[float] | Float | None = None,
) -> PlannedRoute:
    """Find the route that `plan_route` returns, and the side of the walls that it is on.

    Raises:
        InputError: As of `plan_route`.
    """
    numbers = (radius, clearance, range_max, lookahead)
    if not (is_finite(*numbers) and min(numbers) > 0.0):
        raise InputError(
            f"radius {radius}, clearance {clearance}, range_max {range_max}, lookahead"
            f" {lookahead}: expected positive numbers of metres"
        )
    if where not in (None, "inside", "outside"):
        raise InputError(f"where {where!r}: expected 'inside', 'outside' or None")
    check_size(world)
    position = None if start is None else _checked_start(world, start, radius)
    few_steps: PlannedRoute | None = None
    not_followed: PlannedRoute | None = None
    refused = InputError(NO_ROOM)
    for space in _spaces(world, radius, clearance, where, position):
        # A longer route on the other side of the walls is no replacement for a short one.
        if few_steps is not None and space.side != few_steps.side:
            break
        try:
            routes = _routes(space, world, range_max, clearance, position)
            for route in routes:
                if not _can_be_followed(route.waypoints, world, radius, lookahead, start):
                    continue
                if route.length > FEW_STEPS:
                    return route
                few_steps = few_steps or route
        except InputError as error:
            refused = error
        else:
            not_followed = not_followed or routes[-1]
    if few_steps is not None:
        return few_steps
    if not_followed is None:
        raise refused
    # The check of the drive reports where the robot touches a wall.
    return not_followed


def _routes(
    space: FreeSpace, world: World, range_max: float, clearance: float, start: Float | None
) -> list[PlannedRoute]:
    """The routes to try in a free space, the preferred one first.

    Raises:
        InputError: The space has only one cell.
    """
    tour = _tour(space, world, range_max)
    # A tour that shows all walls in a few steps is extended, if that can be followed.
    longer = _lengthened(space, tour)
    tours = [longer, tour] if 0 < len(tour) < len(longer) else [longer]
    return [
        PlannedRoute(_waypoints(space, world, legs, clearance, start), space.side) for legs in tours
    ]


def _checked_start(world: World, start: Sequence[float] | Float, radius: float) -> Float:
    """The position (2,) of a start [m].

    Raises:
        InputError: It is invalid, or in a wall.
    """
    position = np.asarray(numbers(start, "start"), dtype=np.float64)
    if position.shape not in ((2,), (3,)) or not (np.abs(position) <= LARGEST_COORDINATE).all():
        raise InputError(f"start {shown(start)}: expected finite numbers x, y or x, y, theta")
    position = position[:2]
    at_rest = Trajectory([0.0], [[*position, 0.0]])
    if find_collision(at_rest, world, radius) is not None:
        raise InputError(
            f"start ({position[0]:g}, {position[1]:g}): nearer to a wall than the robot's radius of"
            f" {radius:g} m; move it"
        )
    return position


def _spaces(
    world: World, radius: float, clearance: float, where: Side | None, start: Float | None
) -> Iterator[FreeSpace]:
    """Free spaces to find a route in, the preferred one first.

    Those with narrow doors come first, if the doors lead to more room or more walls; then the usual
    one; then those with wider margins, in case the follower cuts too many corners.

    Raises:
        InputError: No margin leaves any room.
    """

    def space(least: float, comfortable: float = 0.0) -> FreeSpace:
        return find_free_space(
            world,
            least=least,
            clearance=max(clearance, least, comfortable),
            comfortable=comfortable,
            where=where,
            start=start,
        )

    wide = None
    comfortable = radius + MARGINS[0]
    try:
        wide = space(comfortable)
    except InputError as error:
        refused = error
    for margin in DOOR_MARGINS:
        try:
            tight = space(radius + margin, comfortable)
        except InputError:
            # A wider margin leaves no more room.
            break
        # Cells in the narrow places themselves are not roomy: only what lies behind them counts.
        if wide is not None and not (
            tight.worth > DOOR_GAIN * wide.worth or tight.roomy.sum() > DOOR_GAIN * len(wide.cells)
        ):
            break
        yield tight
    if wide is None:
        raise refused
    yield wide
    for margin in MARGINS[1:]:
        try:
            yield space(radius + margin)
        except InputError:
            return


def _tour(space: FreeSpace, world: World, range_max: float) -> list[Int]:
    """Consecutive paths over the cells of a free space that show most of the walls."""
    views = look_around(space, world, range_max=range_max)
    viewpoints = views.viewpoints[views.best_patches()]
    if space.start is not None:
        viewpoints = np.append(space.start, viewpoints[viewpoints != space.start])
    # With a short range_max no wall may be visible.
    if not len(viewpoints):
        return []
    network = Network.between(space, views, viewpoints)
    order = best_tour(network, longest=LONGEST_ROUTE, from_first=space.start is not None)
    return [network.path(*leg) for leg in pairwise(order)]


def _waypoints(
    space: FreeSpace, world: World, legs: list[Int], clearance: float, start: Float | None
) -> Float:
    """Way-points (m, 2) along the legs, the first at the start where there is one."""
    route = _straightened(space, legs, clearance) + world.origin
    if start is None or (route[0] == start).all():
        return route
    return np.vstack([start, route])


def _can_be_followed(
    route: Float,
    world: World,
    radius: float,
    lookahead: float,
    start: Sequence[float] | Float | None,
) -> bool:
    """Whether a robot that follows the route by pure pursuit keeps clear of all walls."""
    pose = start if start is not None and len(start) == 3 else None
    drive = follow_route(route, start=pose, lookahead=lookahead, dt=CONTROL_STEP)
    return find_collision(drive, world, radius) is None


def _lengthened(space: FreeSpace, legs: list[Int]) -> list[Int]:
    """The legs of a tour; if they are short, paths to the ends of the free space follow them."""
    legs = list(legs)
    if legs:
        end = int(legs[-1][-1])
    elif space.start is not None:
        end = space.start
    else:
        # Any cell would do; the lower left one makes the route repeatable.
        end = int(np.argmin(space.cells.sum(axis=1)))
    length = sum(space.length(leg) for leg in legs)
    while not legs or length < SHORTEST_ROUTE:
        legs.append(_path_to_farthest(space, end))
        end = int(legs[-1][-1])
        length += space.length(legs[-1])
    return legs


def _path_to_farthest(space: FreeSpace, start: int) -> Int:
    """The cheapest path from a cell to the cell that is the most expensive to reach.

    Raises:
        InputError: There is no other cell.
    """
    from scipy.sparse.csgraph import dijkstra

    costs, before = dijkstra(space.graph, indices=[start], return_predecessors=True)
    # The cost of cells without a path is infinite.
    cells = [int(np.argmax(np.where(np.isfinite(costs[0]), costs[0], -1.0)))]
    while cells[-1] != start:
        cells.append(int(before[0, cells[-1]]))
    if len(cells) < 2:
        raise InputError(NO_ROOM)
    return np.array(cells[::-1])


def _straightened(space: FreeSpace, legs: list[Int], clearance: float) -> Float:
    """Way-points (m, 2) along the legs, straight as long as the clearance is kept.

    From each way-point the straight line is drawn to cell after cell; the last cell before it is no
    longer clear is the next way-point. The ends of the legs, which are viewpoints, always stay.
    """
    waypoints = [space.cells[legs[0][0]]]
    for leg in legs:
        cells, room = space.cells[leg], np.minimum(space.clearances[leg], clearance)
        here = 0
        while here < len(leg) - 1:
            there = here + 1
            while there + 1 < len(leg) and _is_clear(space, cells, room, here, there + 1):
                there += 1
            waypoints.append(cells[there])
            here = there
    return np.array(waypoints)


def _is_clear(space: FreeSpace, cells: Float, room: Float, here: int, there: int) -> bool:
    """Whether a straight line between two cells of a path has about the clearance of the path."""
    length = float(np.hypot(*(cells[there] - cells[here])))
    if length > LONGEST_LEG:
        return False
    # Two samples a cell, so that the line does not step over a barred one.
    shares = np.linspace(0.0, 1.0, max(3, int(length / (0.5 * space.size)) + 2))
    line = cells[here] * (1.0 - shares[:, None]) + cells[there] * shares[:, None]
    if space.bars(line).any():
        return False
    # Compared with the path at the same share of its cells, with a quarter of a cell to spare.
    shares_of_path = np.linspace(0.0, 1.0, there + 1 - here)
    kept = np.interp(shares, shares_of_path, room[here : there + 1]) - 0.25 * space.size
    return bool((space.clearance(line) >= np.maximum(kept, space.least)).all())
