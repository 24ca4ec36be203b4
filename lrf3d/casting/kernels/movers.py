"""Beams among dynamic obstacles, compiled: where these are at a time, and which beams they stop.

Obstacles are outlines on paths. A scan of one moment finds them in a grid, for some neighbouring
beams at a time; beams that are sent one by one meet them where they are at the time of the beam.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from lrf3d.casting.kernels.beams import (
    OPEN,
    TAKEN,
    UNDECIDED,
    Nearest,
    beam_of,
    judged,
    length_of,
    settled,
    within,
)
from lrf3d.casting.kernels.fan import Fan
from lrf3d.casting.kernels.grid import MoverGrid, fill, rows_in
from lrf3d.casting.kernels.predicates import FILTER, Beam, Wall
from lrf3d.casting.kernels.scans import PADDING, Laser, aim, turn
from lrf3d.casting.kernels.tree import ROOM, Plain
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

# Parts of a scan; the obstacles near each part are looked up once. Looking costs as much as testing
# eight beams: of 4 to 16 parts eight were the fastest for 64 beams among 1,024 robots.
PARTS = 8

# [rad] Largest angle between the first beam of a part and the last.
MOST_SPAN = 3.0

# [m] Largest length of a beam, so that its end has a place.
LONGEST = 1e9

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


@inner
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


@inner
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


@inner
def place(among: Movers, j: int, time: float) -> None:
    """Place an obstacle's sides where they are at a time."""
    turn_sides(among, j, locate(among, j, time))


@inner
def locate(among: Movers, j: int, time: float) -> float:
    """Set where an obstacle is at a time; returns its heading [rad]."""
    at = among.placed[j]
    at.x, at.y, theta = mover_at(among, j, time)
    at.reach = among.movers[j].reach
    return theta


@inner
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
        place(among, j, time)
    fill(MoverGrid(*plain_grid), among.placed)


@borrower
def side_at(sides: Records, row: int) -> Wall:
    """The side in a row, as a wall."""
    side = sides[row]
    return Wall(side.px, side.py, side.qx, side.qy)


@borrower
def _meet_clearly(
    sides: Records, first: int, stop: int, beam: Beam, doubt: float, nearest: Nearest
) -> tuple[int, float, float]:
    """The nearest of some sides and the nearest so far, as of `Nearest`; the row may be UNDECIDED.

    The sides go round an outline; how far a corner is beside the beam is known up to a doubt. It
    makes no arrays, and so counts no references.
    """
    q = beam.dx * (sides[first].py - beam.oy) - beam.dy * (sides[first].px - beam.ox)
    for row in range(first, stop):
        side = side_at(sides, row)
        p = q
        q = beam.dx * (side.qy - beam.oy) - beam.dy * (side.qx - beam.ox)
        # Most sides lie beside the beam.
        if min(p, q) > doubt or max(p, q) < -doubt:
            continue
        verdict, low, high = judged(side, beam, nearest)
        if verdict == TAKEN:
            nearest = Nearest(row, low, high)
        elif verdict == OPEN:
            return UNDECIDED, 0.0, 0.0
    return nearest.row, nearest.low, nearest.high


@inner
def meet(among: Movers, j: int, beam: Beam, nearest: Nearest) -> Nearest:
    """The nearest side, of those of an obstacle and the nearest so far."""
    sides = among.sides
    mover = among.movers[j]
    for row in range(mover.first, mover.stop):
        side = side_at(sides, row)
        verdict, low, high = judged(side, beam, nearest)
        if verdict == TAKEN:
            nearest = Nearest(row, low, high)
        elif verdict == OPEN:
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
    beams = laser.fan.shape[1]
    dx = np.empty(beams + PADDING)
    dy = np.empty(beams + PADDING)
    row = np.empty(beams, np.int64)
    low = np.empty(beams)
    high = np.empty(beams)
    near = np.empty(len(among.movers) + 1, np.int64)
    # The first beam of a part and the last bound it up to half a turn.
    most = 1 + int(MOST_SPAN * (beams - 1) / (2.0 * max(laser.half, 1.0)))
    part = min((beams + PARTS - 1) // PARTS, most)
    for k in range(len(poses)):
        fan = aim(laser, poses[k], dx, dy)
        for i in range(beams):
            row[i] = -1
            low[i] = np.inf
            high[i] = min(ranges[k, i], laser.range_max * ROOM) * ROOM
        seen = height, own[k]
        for first in range(0, beams, part):
            stop = min(first + part, beams)
            _stop_beams(among, grid, fan, (row, low, high), (first, stop), near, seen)
        for i in range(beams):
            beam = Beam(fan.x, fan.y, dx[i], dy[i])
            if row[i] == UNDECIDED:
                limit = min(ranges[k, i], laser.range_max * ROOM) * ROOM
                row[i] = _met_exactly(among, beam, limit, seen)
            if row[i] < 0:
                continue
            t = range_to(among, row[i], beam, limits)
            # If both are below range_min, −inf, neither is nearer; the wall is −1 in any case.
            if t < ranges[k, i]:
                ranges[k, i] = t
                hits[k, i] = -1


@borrower
def _stop_beams(
    among: Movers, grid: MoverGrid, fan: Fan, met: tuple[Int, Float, Float],
    part: tuple[int, int], near: Int, seen: tuple[float, int],
) -> None:  # fmt: skip
    """Let obstacles stop a part of the beams of a fan, of which the nearest sides are filled in.

    ``seen`` holds the height of the laser, and the robot's own obstacle, which is left out; the row
    of a side may be UNDECIDED.
    """
    row, low, high = met
    placed = among.placed
    low_x = high_x = fan.x
    low_y = high_y = fan.y
    farthest = 0.0
    for i in range(part[0], part[1]):
        length = min(max(high[i], 0.0), LONGEST)
        farthest = max(farthest, high[i])
        low_x = min(low_x, fan.x + length * fan.dx[i])
        high_x = max(high_x, fan.x + length * fan.dx[i])
        low_y = min(low_y, fan.y + length * fan.dy[i])
        high_y = max(high_y, fan.y + length * fan.dy[i])
    # More than rounding may be.
    room = grid.frames[0].reach * ROOM + 1e-12 * (abs(fan.x) + abs(fan.y) + LONGEST)
    box = low_x - room, low_y - room, high_x + room, high_y + room
    for candidate in range(rows_in(grid, placed, box, near)):
        j = near[candidate]
        mover = among.movers[j]
        east = placed[j].x - fan.x
        north = placed[j].y - fan.y
        away = math.sqrt(east * east + north * north)
        wide = placed[j].reach * ROOM + 1e-12 * (abs(placed[j].x) + abs(placed[j].y) + away)
        nearest = away / ROOM - wide
        right = fan.dx[part[0]] * north - fan.dy[part[0]] * east
        left = fan.dx[part[1] - 1] * north - fan.dy[part[1] - 1] * east
        # The height comes last, as it is rarely in the cache.
        if (
            min(right, -left) < -wide
            or nearest > farthest
            or j == seen[1]
            or mover.height < seen[0]
        ):
            continue
        doubt = 4.0 * FILTER * (away + wide)
        for i in range(part[0], part[1]):
            beam = Beam(fan.x, fan.y, fan.dx[i], fan.dy[i])
            across = beam.dx * north - beam.dy * east
            if abs(across) > wide or high[i] < nearest or row[i] == UNDECIDED:
                continue
            before = Nearest(row[i], low[i], high[i])
            row[i], low[i], high[i] = _meet_clearly(
                among.sides, mover.first, mover.stop, beam, doubt, before
            )


@inner
def _met_exactly(among: Movers, beam: Beam, limit: float, seen: tuple[float, int]) -> int:
    """The row of the nearest side that a beam meets up to a limit [m], of all obstacles, or −1."""
    height, own = seen
    nearest = Nearest(-1, np.inf, limit)
    for j in range(len(among.movers)):
        at = among.placed[j]
        east = at.x - beam.ox
        north = at.y - beam.oy
        wide = at.reach * ROOM + 1e-12 * (abs(at.x) + abs(at.y) + abs(east) + abs(north))
        beside = abs(beam.dx * north - beam.dy * east) > wide
        if j != own and not beside and among.movers[j].height >= height:
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
                place(among, j, rays[i].time)
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
