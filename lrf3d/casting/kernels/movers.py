"""Beams among dynamic obstacles, compiled: where these are at a time, and which beams they stop.

Obstacles are outlines on paths. A scan of one moment finds them in a grid, for some neighbouring
beams at a time; beams that are sent one by one meet them where they are at the time of the beam.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from lrf3d.casting.kernels.beams import (
    UNDECIDED,
    Nearest,
    beam_of,
    bounds,
    length_of,
    settled,
    within,
)
from lrf3d.casting.kernels.fan import BATCH, BEARING_SLACK, TURN, Fan, bearing
from lrf3d.casting.kernels.grid import MoverGrid, cells_of, fill, members
from lrf3d.casting.kernels.predicates import FILTER, Beam, Wall, index_of, plain_length
from lrf3d.casting.kernels.scans import PADDING, Laser, aim, turn
from lrf3d.casting.kernels.tree import ROOM, Plain, column_at, whole
from lrf3d.compiling import borrower, compiled, inner, record
from lrf3d.geometry.lines import TINY, Float, Int, Records

# An obstacle.
MOVER = record(
    first=int, stop=int,  # its corners, from the first to before the last
    leg=int, last=int,  # the legs of its path, likewise
    reach=float,  # [m] the largest distance from its origin to a corner
    height=float,  # [m]
    period=float,  # [s] the time after which its path begins again, 0 for never, or HELD
    fastest=float, rim=float,  # [m/s] the largest speeds of its origin and of a corner
    disc=float,  # [m] its radius if it touches others as a disc, or 0
)  # fmt: skip

# A corner [m] in the frame of its obstacle.
CORNER = record(x=float, y=float)

# A pose of a path; where the period of the obstacle is HELD, it holds the speeds from then on.
LEG = record(
    time=float,  # [s]
    x=float, y=float, theta=float,  # [m], [m], [rad]
    ahead=float, left=float, turn=float,  # [m/s], [m/s], [rad/s]
)  # fmt: skip

# A pose x, y [m], theta [rad].
Pose = tuple[float, float, float]

# The period of an obstacle that holds its speeds.
HELD = -1.0

# The origin of an obstacle at a moment [m], and its reach.
PLACED = record(**dict.fromkeys(("x", "y", "reach"), float))

# [m] Largest length of a beam, so that its end has a place.
LONGEST = 1e9

# Where the columns of BATCH obstacles as a scan sees them begin: offsets [m], reach [m], distance
# of the nearest point [m], and the beams that may meet them, from the first to before the last.
EAST, NORTH, WIDE, NEAR, FIRST, STOP = (index_of(k * BATCH) for k in range(6))

# A side of an obstacle in the world [m].
SIDE = record(**dict.fromkeys(("px", "py", "qx", "qy"), float))


class Movers(NamedTuple):
    """Obstacles, with all their corners and legs, and where they are at a moment.

    The sides are in the order of the corners.
    """

    movers: Records
    corners: Records
    legs: Records
    placed: Records
    sides: Records


@inner
def wrapped(angle: float) -> float:
    """An angle in (−π, π], as by `wrap_angle`."""
    if -np.pi < angle <= np.pi:
        return angle
    turned = np.pi - (np.pi - angle) % (2.0 * np.pi)
    return turned if turned > -np.pi else np.pi


@borrower
def pose_at(legs: Records, first: int, last: int, period: float, time: float) -> Pose:
    """The pose at a time on a path, as by `Trajectory.at`."""
    if last - first == 1:
        rest = legs[first]
        return rest.x, rest.y, rest.theta
    shift = period * int(max(time, 0.0) / period) if period > 0.0 else 0.0
    low = first
    high = last
    while low < high:
        middle = (low + high) // 2
        if shift + legs[middle].time <= time:
            low = middle + 1
        else:
            high = middle
    after = min(max(low, first + 1), last - 1)
    begin = legs[after - 1]
    end = legs[after]
    start = shift + begin.time
    stop = shift + end.time
    share = min(max((time - start) / (stop - start), 0.0), 1.0)
    return (
        begin.x + share * (end.x - begin.x),
        begin.y + share * (end.y - begin.y),
        wrapped(begin.theta + share * wrapped(end.theta - begin.theta)),
    )


@inner
def moved(leg: Any, time: float) -> Pose:
    """The pose after the speeds of a leg were held for a time."""
    half = 0.5 * leg.turn * time
    chord = time * math.sin(half) / half if half != 0.0 else time
    cos = chord * math.cos(leg.theta + half)
    sin = chord * math.sin(leg.theta + half)
    return (
        leg.x + cos * leg.ahead - sin * leg.left,
        leg.y + cos * leg.left + sin * leg.ahead,
        leg.theta + leg.turn * time,
    )


@borrower
def mover_at(among: Movers, j: int, time: float) -> Pose:
    """The pose of an obstacle at a time."""
    mover = among.movers[j]
    legs = among.legs
    if mover.period != HELD:
        return pose_at(legs, mover.leg, mover.last, mover.period, time)
    return moved(legs[mover.leg], max(time - legs[mover.leg].time, 0.0))


@inner
def anywhere(plain: Plain) -> Movers:
    """Obstacles that a kernel places by itself; many may do so at once."""
    movers, corners, legs = plain
    placed = np.empty(len(movers), PLACED), np.empty(len(corners), SIDE)
    return Movers(movers, corners, legs, *placed)


@borrower
def locate(among: Movers, j: int, time: float) -> float:
    """Set where an obstacle is at a time; returns its heading [rad]."""
    at = among.placed[j]
    at.x, at.y, theta = mover_at(among, j, time)
    at.reach = among.movers[j].reach
    return theta


@borrower
def turn_sides(among: Movers, j: int, theta: float) -> None:
    """Set the sides of an obstacle where it is, with a heading [rad]."""
    mover = among.movers[j]
    corners = among.corners
    sides = among.sides
    x = among.placed[j].x
    y = among.placed[j].y
    cos = math.cos(theta)
    sin = math.sin(theta)
    before = mover.stop - 1
    for row in range(mover.first, mover.stop):
        side = sides[row]
        ahead, left = turn(corners[row].x, corners[row].y, cos, sin)
        side.px = ahead + x
        side.py = left + y
        sides[before].qx = side.px
        sides[before].qy = side.py
        before = row


@compiled
def place_all(plain: Plain, plain_grid: Plain, time: float) -> None:
    """Place all obstacles where they are at a time, and fill the grid over them."""
    among = Movers(*plain)
    for j in range(len(among.movers)):
        turn_sides(among, j, locate(among, j, time))
    fill(MoverGrid(*plain_grid), among.placed)


@borrower
def side_at(sides: Records, row: int) -> Wall:
    """The side in a row, as a wall."""
    side = sides[row]
    return Wall(side.px, side.py, side.qx, side.qy)


@borrower
def _meet_clearly(
    sides: Records, first: int, stop: int, beam: Beam, doubt: float, nearest: Nearest, some: Int
) -> tuple[int, float, float]:
    """The nearest of some sides and the nearest so far, as of `Nearest`; the row may be UNDECIDED.

    The sides go round an outline; how far a corner is beside the beam is known up to a doubt. It
    makes no arrays, and so counts no references.
    """
    q = beam.dx * (sides[first].py - beam.oy) - beam.dy * (sides[first].px - beam.ox)
    count = 0
    for row in range(first, stop):
        p = q
        q = beam.dx * (sides[row].qy - beam.oy) - beam.dy * (sides[row].qx - beam.ox)
        # Most sides lie beside the beam. A branch here would often be predicted wrongly.
        some[count] = row
        count += int(min(p, q) <= doubt) & int(max(p, q) >= -doubt)
    for place in range(count):
        row = some[place]
        meets, low, high = bounds(side_at(sides, row), beam, nearest.high)
        if meets and high < nearest.low:
            nearest = Nearest(row, low, high)
        elif meets:
            return UNDECIDED, 0.0, 0.0
    return nearest.row, nearest.low, nearest.high


@inner
def meet(among: Movers, j: int, beam: Beam, nearest: Nearest) -> Nearest:
    """The nearest side, of those of an obstacle and the nearest so far."""
    sides = among.sides
    mover = among.movers[j]
    for row in range(mover.first, mover.stop):
        side = side_at(sides, row)
        meets, low, high = bounds(side, beam, nearest.high)
        if meets and high < nearest.low:
            nearest = Nearest(row, low, high)
        elif meets:
            # Of sides met at equal t the first one stays.
            other = side_at(sides, max(nearest.row, 0))
            nearest = settled(beam, nearest, row, side, other, row < nearest.row)
    return nearest


@inner
def range_to(among: Movers, row: int, beam: Beam, limits: tuple[float, float]) -> float:
    """The range of a beam to a side that it meets, within limits."""
    side = side_at(among.sides, row)
    return within(length_of(beam, side), limits[0], limits[1], beam, side)


@compiled
def cast_among(
    plain: Plain, plain_laser: Plain, height: float, poses: Float, own: Int, ranges: Float,
    hits: Int,
) -> None:  # fmt: skip
    """Let obstacles of a height stop the beams of scans from poses (k, 3) at one moment.

    They are given with the grid over them. Own (k,) are the obstacles that the scans do not see, or
    −1.
    """
    plain_movers, plain_grid = plain
    among = Movers(*plain_movers)
    grid = MoverGrid(*plain_grid)
    laser = Laser(*plain_laser)
    limits = (laser.range_min, laser.range_max)
    reach = laser.range_max * ROOM
    beams = laser.fan.shape[1]
    dx = np.empty(beams + PADDING)
    dy = np.empty(beams + PADDING)
    met = np.empty(beams, np.int64), np.empty(beams), np.empty(beams)
    row, low, high = met
    view = np.zeros(6 * BATCH)
    # Room for the obstacles of a view, and for the sides of one, that beams may meet.
    room = np.empty(BATCH, np.int64), np.empty(len(among.corners), np.int64)
    walls = np.zeros((4, whole(beams)))
    lengths = np.empty(whole(beams))
    for k in range(len(poses)):
        fan = aim(laser, poses[k], dx, dy)
        # Taken from the pose: each access to the fan would count a reference.
        ox, oy, _ = poses[k]
        low_x = high_x = ox
        low_y = high_y = oy
        for i in range(beams):
            row[i] = -1
            low[i] = np.inf
            high[i] = min(ranges[k, i], reach) * ROOM
            length = min(max(high[i], 0.0), LONGEST)
            low_x = min(low_x, ox + length * dx[i])
            high_x = max(high_x, ox + length * dx[i])
            low_y = min(low_y, oy + length * dy[i])
            high_y = max(high_y, oy + length * dy[i])
        # More than rounding may be.
        beside = grid.frames[0].reach * ROOM + 1e-12 * (abs(ox) + abs(oy) + LONGEST)
        box = low_x - beside, low_y - beside, high_x + beside, high_y + beside
        seen = height, own[k]
        _stop_fan(among, grid, box, fan, (view, *room), met, seen)
        _lengths(fan, among.sides, row, walls, lengths)
        for i in range(beams):
            if row[i] == -1:
                continue
            beam = Beam(ox, oy, dx[i], dy[i])
            t = lengths[i]
            if row[i] == UNDECIDED:
                row[i] = _met_exactly(among, beam, min(ranges[k, i], reach) * ROOM, seen)
                t = np.nan
            if row[i] >= 0 and not limits[0] * ROOM < t < limits[1] / ROOM:
                t = range_to(among, row[i], beam, limits)
            # If both are below range_min, −inf, neither is nearer; the wall is −1 in any case.
            if t < ranges[k, i]:
                ranges[k, i] = t
                hits[k, i] = -1


@borrower
def _stop_fan(
    among: Movers, grid: MoverGrid, box: tuple[float, float, float, float], fan: Fan,
    room: tuple[Float, Int, Int], met: tuple[Int, Float, Float], seen: tuple[float, int],
) -> None:  # fmt: skip
    """Let obstacles in a box stop the beams of a fan, whose nearest sides are filled in.

    The room is for a view, its obstacles and the sides of one. ``seen`` holds the height of the
    laser, and the robot's own obstacle, which is left out; the row of a side may be UNDECIDED.
    """
    first, last, first_row, last_row = cells_of(grid, box)
    for away in range(last_row - first_row + 1):
        # From the near cells to the far ones, as near obstacles hide others.
        at = first_row + away if fan.ahead_y > 0.0 else last_row - away
        _stop_by(among, grid, members(grid, at, first, last), fan, room, met, seen)


@borrower
def _stop_by(
    among: Movers, grid: MoverGrid, part: tuple[int, int], fan: Fan,
    room: tuple[Float, Int, Int], met: tuple[Int, Float, Float], seen: tuple[float, int],
) -> None:  # fmt: skip
    """Let a part of the obstacles in the order of the grid stop beams: see `_stop_fan`."""
    row, low, high = met
    view, some, sides = room
    start, stop = part
    for base in range(start, stop, BATCH):
        for place in range(_view(grid.places, base, min(BATCH, stop - base), fan, view, some)):
            k = some[place]
            j = grid.order[base + k]
            mover = among.movers[j]
            for i in range(int(view[FIRST + k]), int(view[STOP + k])):
                if high[i] < view[NEAR + k] or row[i] == UNDECIDED:
                    continue
                beam = Beam(fan.x, fan.y, fan.dx[i], fan.dy[i])
                across = beam.dx * view[NORTH + k] - beam.dy * view[EAST + k]
                # The height comes last, as it is rarely in the cache.
                if abs(across) > view[WIDE + k] or j == seen[1] or mover.height < seen[0]:
                    continue
                doubt = 4.0 * FILTER * (view[NEAR + k] + 2.0 * view[WIDE + k])
                before = Nearest(row[i], low[i], high[i])
                row[i], low[i], high[i] = _meet_clearly(
                    among.sides, mover.first, mover.stop, beam, doubt, before, sides
                )


@borrower
def _view(places: Records, base: int, count: int, fan: Fan, view: Float, some: Int) -> int:
    """Fill in how a scan sees obstacles at some places from a base on, up to BATCH of them.

    It returns the number of those that beams may meet, and fills in which they are.
    """
    for k in range(index_of(count)):
        at = places[index_of(base) + k]
        view[EAST + k] = at.x - fan.x
        view[NORTH + k] = at.y - fan.y
        view[WIDE + k] = at.reach * ROOM + 1e-12 * (abs(at.x) + abs(at.y))
    half = fan.half if fan.per_step > 0.0 else TURN
    beams = float(len(fan.dx) - PADDING)
    for k in range(whole(count)):
        east = view[EAST + k]
        north = view[NORTH + k]
        away = math.sqrt(east * east + north * north)
        wide = view[WIDE + k] + 1e-12 * away
        middle = bearing(
            east * fan.ahead_x + north * fan.ahead_y, north * fan.ahead_x - east * fan.ahead_y
        )
        share = wide / away
        # Never below the arcsine.
        aside = share + (0.5 * np.pi - 1.0) * share * share * share + BEARING_SLACK
        # Where the fan closes to a circle, or the obstacle is around the laser, all beams count.
        plain = share < 1.0 and abs(middle) + aside < TURN - half
        first = min(max((middle - aside + half) * fan.per_step + 1.0, 0.0), beams)
        stop = min(max((middle + aside + half) * fan.per_step + 1.0, 0.0), beams)
        view[WIDE + k] = wide
        view[NEAR + k] = away * (2.0 - ROOM) - wide
        view[FIRST + k] = first if plain else 0.0
        view[STOP + k] = stop if plain else beams
    met = 0
    for k in range(count):
        # A branch would often be predicted wrongly.
        some[met] = k
        met += int(int(view[FIRST + k]) < int(view[STOP + k]))
    return met


@borrower
def _lengths(fan: Fan, sides: Records, row: Int, walls: Float, lengths: Float) -> None:
    """Fill the t of the sides that the beams of a fan meet, NaN where float64 falls short.

    The walls are room for columns of sides.
    """
    for i in range(len(row)):
        for axis, value in enumerate(side_at(sides, max(row[i], 0))):
            walls[axis, i] = value
    for i in range(len(lengths)):
        beam = Beam(fan.x, fan.y, fan.dx[i], fan.dy[i])
        t, good = plain_length(beam, column_at(walls, i))
        lengths[i] = t[0] if good else np.nan


@inner
def _met_exactly(among: Movers, beam: Beam, limit: float, seen: tuple[float, int]) -> int:
    """The row of the nearest side that a beam meets up to a limit [m], of all obstacles, or −1."""
    height, own = seen
    nearest = Nearest(-1, np.inf, limit)
    for j in range(len(among.movers)):
        if j != own and among.movers[j].height >= height:
            nearest = meet(among, j, beam, nearest)
    return nearest.row


@compiled
def rays_among(
    plain: Plain, limits: tuple[float, float], seen: tuple[int, float, int], rays: Records,
    ranges: Float, hits: Int,
) -> None:  # fmt: skip
    """Let obstacles stop rays (n,), at least one, each where they are at its time.

    What is seen are not the robot's own, nor those below a height; their sides are named as those
    of the walls that follow on a number of walls, or all −1 if that is negative.
    """
    among = anywhere(plain)
    own, height, walls = seen
    beams = len(rays)
    movers = among.movers
    circles = np.empty(len(among.movers), PLACED)
    # Around where an obstacle is half-way, it is somewhere in this circle all the time.
    begin = rays[0].time
    end = rays[beams - 1].time
    for j in range(len(movers)):
        mover = movers[j]
        circle = circles[j]
        half = 0.5 * (end + begin)
        circle.x, circle.y, _ = mover_at(among, j, half)
        reach = mover.reach + mover.fastest * 0.5 * (end - begin)
        circle.reach = (1.0 + 1e-6) * reach + 1e-12 * (abs(circle.x) + abs(circle.y))
    for i in range(beams):
        beam = beam_of(rays, i)
        limit = min(ranges[i], limits[1] * ROOM) * ROOM
        nearest = Nearest(-1, np.inf, limit)
        for j in range(len(movers)):
            east = circles[j].x - beam.ox
            north = circles[j].y - beam.oy
            reach = circles[j].reach + 1e-12 * (abs(east) + abs(north))
            across = beam.dx * north - beam.dy * east
            along = beam.dx * east + beam.dy * north
            beside = abs(across) > reach or along < -reach or along - reach > limit
            if j != own and not beside and movers[j].height >= height:
                turn_sides(among, j, locate(among, j, rays[i].time))
                nearest = meet(among, j, beam, nearest)
        if nearest.row >= 0:
            t = range_to(among, nearest.row, beam, limits)
            if t < ranges[i]:
                ranges[i] = t
                hits[i] = walls + nearest.row if walls >= 0 else -1


@compiled
def poses_along(legs: Records, times: Float, pose: Float) -> Float:
    """Poses (n, 3) at times (n,) [s] on a path that is moved and turned to begin at a pose (3,)."""
    poses = np.empty((len(times), 3))
    first_x, first_y, heading = pose
    x0, y0, theta0 = pose_at(legs, 0, len(legs), 0.0, times[0])
    for i in range(len(times)):
        x, y, theta = pose_at(legs, 0, len(legs), 0.0, times[i])
        # The turn is added to the given heading, which may lie beyond a full turn.
        turned = heading + wrapped(theta - theta0)
        for k, value in enumerate((x + (first_x - x0), y + (first_y - y0), turned)):
            poses[i, k] = value if abs(value) >= TINY else 0.0
    return poses
