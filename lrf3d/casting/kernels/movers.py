"""Beams among dynamic obstacles, compiled: where these are at a time, and which beams they stop.

Obstacles are outlines on paths. A scan of one moment meets them by the bearings of circles around
them; beams that are sent one by one meet them where they are at the time of the beam.
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
from lrf3d.casting.kernels.fan import Fan, beams_between, bearing
from lrf3d.casting.kernels.predicates import Beam, Wall
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

# Obstacles close together: a circle around all of them [m], and their rows in an order.
GROUP = record(x=float, y=float, reach=float, first=int, stop=int)

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
    mover = among.movers[j]
    corners = among.corners
    sides = among.sides
    x, y, theta = mover_at(among, j, time)
    at = among.placed[j]
    at.x = x
    at.y = y
    at.reach = mover.reach
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
def place_all(plain: Plain, time: float) -> None:
    """Place all obstacles where they are at a time."""
    among = Movers(*plain)
    for j in range(len(among.movers)):
        place(among, j, time)


@borrower
def side_at(sides: Records, row: int) -> Wall:
    """The side in a row, as a wall."""
    side = sides[row]
    return Wall(side.px, side.py, side.qx, side.qy)


@borrower
def _meet_clearly(
    sides: Records, first: int, stop: int, beam: Beam, nearest: Nearest
) -> tuple[int, float, float]:
    """The nearest of some sides and the nearest so far, as of `Nearest`; the row may be UNDECIDED.

    It makes no arrays, and so counts no references.
    """
    for row in range(first, stop):
        verdict, low, high = judged(side_at(sides, row), beam, nearest)
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


@borrower
def facing(
    circle: tuple[float, float, float], fan: Fan, high: Float, farthest: float
) -> tuple[int, int, float]:
    """The beams that may meet something in a circle before they end, and how near it may be [m]."""
    x, y, radius = circle
    east = x - fan.x
    north = y - fan.y
    # Widened by more than rounding may be.
    reach = radius * ROOM + 1e-12 * (abs(x) + abs(y))
    distance = math.sqrt(east * east + north * north) / ROOM
    near = distance - reach
    beams = len(high)
    if near > farthest:
        return 0, 0, near
    if near <= 0.0:
        return 0, beams, near
    share = reach / distance
    # At least the arc sine of the share.
    half = share + (0.5 * np.pi - 1.0) * share * share * share
    ahead = east * fan.ahead_x + north * fan.ahead_y
    middle = bearing(ahead, north * fan.ahead_x - east * fan.ahead_y)
    start, stop = beams_between(middle - half, 2.0 * half, fan, beams)
    while start < stop and high[start] < near:
        start += 1
    return start, stop, near


@compiled
def cast_among(
    plain: Plain, plain_laser: Plain, height: float, poses: Float, own: Int, ranges: Float,
    hits: Int,
) -> None:  # fmt: skip
    """Let obstacles of a height stop the beams of scans from poses (k, 3) at one moment.

    They are given with their groups and the order of these. Own (k,) are the obstacles that the
    scans do not see, or −1.
    """
    plain_movers, groups, order = plain
    among = Movers(*plain_movers)
    laser = Laser(*plain_laser)
    movers = among.movers
    placed = among.placed
    limits = (laser.range_min, laser.range_max)
    beams = laser.fan.shape[1]
    dx = np.empty(beams + PADDING)
    dy = np.empty(beams + PADDING)
    row = np.empty(beams, np.int64)
    low = np.empty(beams)
    high = np.empty(beams)
    nears = np.empty(len(groups))
    nearest = np.empty(len(groups), np.int64)
    for k in range(len(poses)):
        fan = aim(laser, poses[k], dx, dy)
        farthest = 0.0
        for i in range(beams):
            row[i] = -1
            low[i] = np.inf
            high[i] = min(ranges[k, i], laser.range_max * ROOM) * ROOM
            farthest = max(farthest, high[i])
        waiting = 0
        for g in range(len(groups)):
            group = groups[g]
            start, stop, near = facing((group.x, group.y, group.reach), fan, high, farthest)
            if start >= stop:
                continue
            # The nearest first: beams that end there meet no more.
            place = waiting
            while place > 0 and nears[place - 1] > near:
                nears[place] = nears[place - 1]
                nearest[place] = nearest[place - 1]
                place -= 1
            nears[place] = near
            nearest[place] = g
            waiting += 1
        for w in range(waiting):
            group = groups[nearest[w]]
            for place in range(group.first, group.stop):
                j = order[place]
                if j == own[k] or movers[j].height < height:
                    continue
                at = placed[j]
                start, stop, _ = facing((at.x, at.y, at.reach), fan, high, farthest)
                if start < stop:
                    _stop_beams(among, j, fan, (row, low, high), (start, stop))
        for i in range(beams):
            if row[i] < 0:
                continue
            t = range_to(among, row[i], Beam(fan.x, fan.y, dx[i], dy[i]), limits)
            # If both are below range_min, −inf, neither is nearer; the wall is −1 in any case.
            if t < ranges[k, i]:
                ranges[k, i] = t
                hits[k, i] = -1


@inner
def _stop_beams(
    among: Movers, j: int, fan: Fan, nearest: tuple[Int, Float, Float], beams: tuple[int, int]
) -> None:
    """Let an obstacle stop some beams of a fan, of which the nearest sides so far are known."""
    row, low, high = nearest
    sides = among.sides
    mover = among.movers[j]
    at = among.placed[j]
    east = at.x - fan.x
    north = at.y - fan.y
    away = abs(at.x) + abs(at.y) + math.sqrt(east * east + north * north)
    wide = at.reach * ROOM + 1e-12 * away
    for i in range(beams[0], beams[1]):
        beam = Beam(fan.x, fan.y, fan.dx[i], fan.dy[i])
        if abs(beam.dx * north - beam.dy * east) > wide:
            continue
        before = Nearest(row[i], low[i], high[i])
        row[i], low[i], high[i] = _meet_clearly(sides, mover.first, mover.stop, beam, before)
        if row[i] == UNDECIDED:
            row[i], low[i], high[i] = meet(among, j, beam, before)


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
