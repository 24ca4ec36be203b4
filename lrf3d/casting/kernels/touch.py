"""When a body that moves along an arc first touches walls or dynamic obstacles, compiled.

A body is a disc or an outline, and holds its speed ahead, to the left, and about itself. Each of
its points then turns about one centre, and so do the ends of walls as the body sees them. With
w = tan(ωt / 2) / (ω / 2), which is t for a straight way, the distance of such a point from a line,
and the square of that from another point, times 1 + (ωw / 2)², is a quadratic a w² + b w + c: its
roots are the times of contact. What only grazes, no deeper than GRAZE, does not touch.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from lrf3d.casting.kernels.grid import MoverGrid, fill, rows_in
from lrf3d.casting.kernels.movers import (
    PLACED,
    SIDE,
    Movers,
    anywhere,
    locate,
    moved,
    mover_at,
    side_at,
    turn_sides,
)
from lrf3d.casting.kernels.predicates import Wall, wall_at
from lrf3d.casting.kernels.tree import STACK, Plain, Tree, column_at
from lrf3d.compiling import borrower, compiled, inner, record
from lrf3d.geometry.lines import Float, Int, Records

# [m] Depth up to which a body that meets something does not touch it: more than rounding.
GRAZE = 1e-9

# [m] Depth at which it is decided on which side of a corner a point has passed.
DEEPER = 1e-6

# [rad] Longest turn that is decided at once: w is finite up to half a turn.
LONGEST_TURN = 1.5

# [m] Shortest step towards a dynamic obstacle: shorter cuts of corners may be missed.
STEP = 2e-5

# A side of a body.
EDGE = record(
    px=float, py=float, qx=float, qy=float,  # [m] the corners where it begins and ends
    inner_x=float, inner_y=float,  # at the first corner, the direction into the body
    notch=float, next_notch=float,  # whether the first, and the next corner, is a notch, 0 or 1
)  # fmt: skip


class Footprint(NamedTuple):
    """The body in plan: a counter-clockwise outline around the origin, or a disc."""

    edges: Records  # Of a disc: one point, at its middle.
    radius: float  # Of a disc [m]; 0 of an outline.
    reach: float  # Largest distance of a point of the body from the origin [m].


class ArcMotion(NamedTuple):
    """The motion of a point on an arc: place [m], velocity [m/s], and turn rate [rad/s]."""

    x: float
    y: float
    ux: float
    uy: float
    turn: float


class ClippedLine(NamedTuple):
    """A segment: start, unit vector, length [m], and from where to where on it contacts count."""

    x: float
    y: float
    ex: float
    ey: float
    length: float
    low: float
    high: float


@compiled
def touched(
    plain_tree: Plain, plain_body: Plain, moves: Records, seconds: Float, found: Plain
) -> None:
    """Fill the times [s] after which bodies first touch a wall, and the wall.

    They hold moves (k,), which are legs, for some seconds (k,). What is found are times (k,), walls
    (k,) and obstacles (k,), +inf and −1 for none.
    """
    times, walls, met = found
    tree = Tree(*plain_tree)
    body = Footprint(*plain_body)
    stack = np.empty(STACK, np.int64)
    wall = np.empty(1, SIDE)
    for k in range(len(moves)):
        times[k], walls[k] = _first_touch(tree, body, moves[k], seconds[k], stack, wall)
        met[k] = -1


@compiled
def touched_among(
    plain: Plain, plain_grid: Plain, plain_body: Plain, moves: Records, seconds: Float, own: Int,
    found: Plain,
) -> None:  # fmt: skip
    """Replace what `touched` has found where bodies touch an obstacle before.

    Own (k,) are the obstacles that are the bodies themselves, or −1. The grid is filled in.
    """
    times, walls, met = found
    among = anywhere(plain)
    grid = MoverGrid(*plain_grid)
    body = Footprint(*plain_body)
    movers = among.movers
    wall = np.empty(1, SIDE)
    begin = np.nan
    sides = np.empty(len(body.edges), SIDE)
    places = np.empty(len(movers), PLACED)
    near = np.empty(len(movers) + 1, np.int64)
    rim = 0.0
    for j in range(len(movers)):
        rim = max(rim, movers[j].rim)
        places[j].reach = max(movers[j].reach, movers[j].disc)
    for k in range(len(moves)):
        move = moves[k]
        if begin != move.time:
            begin = move.time
            for j in range(len(movers)):
                places[j].x, places[j].y, _ = mover_at(among, j, begin)
            fill(grid, places)
        fastest = math.hypot(move.ahead, move.left) + abs(move.turn) * body.reach
        room = (
            (fastest + rim) * min(times[k], seconds[k]) + grid.frames[0].reach + body.reach + 1e-6
        )
        box = move.x - room, move.y - room, move.x + room, move.y + room
        for candidate in range(rows_in(grid, box, near)):
            j = near[candidate]
            mover = movers[j]
            best = min(times[k], seconds[k])
            room = (fastest + mover.rim) * best + places[j].reach + body.reach + 1e-6
            away = math.hypot(places[j].x - move.x, places[j].y - move.y)
            if j == own[k] or away > room:
                continue
            time = _first_meeting(among, j, body, move, best, sides, wall)
            if time < np.inf:
                times[k] = time
                walls[k] = -1
                met[k] = j


@borrower
def _first_touch(
    tree: Tree, body: Footprint, move: Any, seconds: float, stack: Int, seen: Records
) -> tuple[float, int]:
    """The time at which a body first touches a wall, and the wall; +inf and −1 for none."""
    # After a whole turn it is where it was.
    turned = min(abs(move.turn) * seconds, 2.0 * np.pi)
    seconds = turned / abs(move.turn) if turned > 0.0 else seconds
    pieces = 1 + int(turned / LONGEST_TURN)
    step = seconds / pieces
    half = 0.5 * move.turn * step
    end = step * math.tan(half) / half if half != 0.0 else step
    sweep = math.hypot(move.ahead, move.left) * step
    wall = seen[0]
    room = body.reach + min(sweep, 0.125 * sweep * abs(move.turn) * step) + 1e-6
    for piece in range(pieces):
        x, y, theta = moved(move, piece * step)
        x1, y1, _ = moved(move, (piece + 1) * step)
        low_x = min(x, x1)
        high_x = max(x, x1)
        low_y = min(y, y1)
        high_y = max(y, y1)
        cos = math.cos(theta)
        sin = math.sin(theta)
        best = np.inf
        found = -1
        stack[0] = 0
        top = 1 if len(tree.walls) > 0 else 0
        while top > 0:
            top -= 1
            first = tree.links[stack[top], 0]
            count = tree.links[stack[top], 1]
            for row in range(first, first + count):
                px, py, qx, qy = wall_at(tree.walls, row)
                if max(min(px, qx) - high_x, low_x - max(px, qx)) > room:
                    continue
                if max(min(py, qy) - high_y, low_y - max(py, qy)) > room:
                    continue
                px = px - x
                py = py - y
                qx = qx - x
                qy = qy - y
                wall.px = cos * px + sin * py
                wall.py = cos * py - sin * px
                wall.qx = cos * qx + sin * qy
                wall.qy = cos * qy - sin * qx
                if piece == 0 and _gap(body.edges, seen, 0, 1) - body.radius < -GRAZE:
                    w = 0.0
                else:
                    w = _contact(body, move, end, side_at(seen, 0))
                if w < best or (w == best < np.inf and tree.rows[row] < found):
                    best = w
                    found = tree.rows[row]
            for child in range(first, first - count):
                x0, y0, x2, y2 = column_at(tree.boxes, child)
                if max(x0 - high_x, low_x - x2, y0 - high_y, low_y - y2) <= room:
                    stack[top] = child
                    top += 1
        if found >= 0:
            angle = 0.5 * move.turn * best
            time = best * math.atan(angle) / angle if angle != 0.0 else best
            return max(piece * step + time, 0.0), found
    return np.inf, -1


@borrower
def _contact(body: Footprint, move: Any, end: float, wall: Wall) -> float:
    """The w up to an end at which a body touches a wall, which it sees from its pose at w = 0."""
    edges = body.edges
    ahead = move.ahead
    left = move.left
    turn = move.turn
    best = np.inf
    line = _line(wall, 0.0, 0.0)
    start = ArcMotion(wall.px, wall.py, turn * wall.py - ahead, -turn * wall.px - left, -turn)
    stop = ArcMotion(wall.qx, wall.qy, turn * wall.qy - ahead, -turn * wall.qx - left, -turn)
    for k in range(len(edges)):
        tip = edges[k]
        motion = ArcMotion(tip.px, tip.py, ahead - turn * tip.py, left + turn * tip.px, turn)
        side = _beside(line, tip.px, tip.py)
        clear = abs(side) > GRAZE or len(edges) == 1
        if not clear:
            side = line.ex * tip.inner_y - line.ey * tip.inner_x
        side = 1.0 if side >= 0.0 else -1.0
        best = min(best, _crossing(motion, line, side, body.radius, end))
        # It may go round the end and come back from the other side.
        best = min(best, _crossing(motion, line, -side, body.radius, end)) if clear else best
        if body.radius > 0.0:
            best = min(best, _nearing(motion, wall.px, wall.py, body.radius, end))
            best = min(best, _nearing(motion, wall.qx, wall.qy, body.radius, end))
        elif len(edges) > 1:
            # What comes to an edge comes from the right of it.
            edge = _line(side_at(edges, k), tip.notch, tip.next_notch)
            best = min(best, _crossing(start, edge, -1.0, 0.0, end))
            best = min(best, _crossing(stop, edge, -1.0, 0.0, end))
    return best


@inner
def _line(wall: Wall, opened: float, open_after: float) -> ClippedLine:
    """The line of a wall; at ends that are open, points beyond them count, too."""
    ex = wall.qx - wall.px
    ey = wall.qy - wall.py
    length = math.sqrt(ex * ex + ey * ey)
    low = -np.inf if opened > 0.0 else GRAZE
    high = np.inf if open_after > 0.0 else length - GRAZE
    return ClippedLine(wall.px, wall.py, ex / length, ey / length, length, low, high)


@inner
def _beside(line: ClippedLine, x: float, y: float) -> float:
    """How far to the left of a line a point lies [m]."""
    return line.ex * (y - line.y) - line.ey * (x - line.x)


@inner
def _along(motion: ArcMotion, line: ClippedLine, w: float) -> float:
    """How far along a line a point is at w [m]."""
    half = 0.5 * motion.turn * w
    share = w / (1.0 + half * half)
    x = motion.x + share * (motion.ux - half * motion.uy) - line.x
    y = motion.y + share * (motion.uy + half * motion.ux) - line.y
    return x * line.ex + y * line.ey


@inner
def _crossing(
    motion: ArcMotion, line: ClippedLine, side: float, radius: float, end: float
) -> float:
    """The w at which a point comes from a side as near as a radius to a segment."""
    c = side * _beside(line, motion.x, motion.y) - radius
    b = side * (line.ex * motion.uy - line.ey * motion.ux)
    bend = side * (line.ex * motion.ux + line.ey * motion.uy)
    turn = motion.turn
    root, lowest, depth = _descent(0.25 * turn * turn * c + 0.5 * turn * bend, b, c, turn, end)
    if depth <= GRAZE:
        return np.inf
    place = _along(motion, line, root)
    if radius == 0.0 and not GRAZE < place < line.length - GRAZE:
        # At a corner it counts on which side of it the point goes on.
        if not -GRAZE <= place <= line.length + GRAZE:
            return np.inf
        later = root + (lowest - root) * min(1.0, math.sqrt(DEEPER / depth))
        return root if line.low < _along(motion, line, later) < line.high else np.inf
    return root if 0.0 <= place <= line.length else np.inf


@inner
def _nearing(motion: ArcMotion, x: float, y: float, radius: float, end: float) -> float:
    """The w at which a point comes as near as a radius to another one."""
    dx = motion.x - x
    dy = motion.y - y
    ux = motion.ux
    uy = motion.uy
    turn = motion.turn
    away = math.sqrt(dx * dx + dy * dy)
    scale = 0.5 / radius
    c = (away - radius) * (away + radius) * scale
    b = 2.0 * (dx * ux + dy * uy) * scale
    a = 0.25 * turn * turn * c + (turn * (dy * ux - dx * uy) + ux * ux + uy * uy) * scale
    root, _, depth = _descent(a, b, c, turn, end)
    return root if depth > GRAZE else np.inf


@inner
def _descent(a: float, b: float, c: float, turn: float, end: float) -> tuple[float, float, float]:
    """Where a w² + b w + c falls below zero, where it is lowest up to an end, and how low."""
    square = b * b - 4.0 * a * c
    if (b >= 0.0 and a >= 0.0) or (square < 0.0 and a >= 0.0):
        return np.inf, np.inf, 0.0
    # What starts below zero, no deeper than GRAZE, fell there just before.
    root = 0.0
    if square >= 0.0:
        size = math.sqrt(square)
        root = 2.0 * c / (size - b) if b < 0.0 else -(b + size) / (2.0 * a)
    if root > end or (root <= 0.0 and c < -GRAZE):
        return np.inf, np.inf, 0.0
    lowest = min(-0.5 * b / a, end) if a > 0.0 else end
    lowest = max(lowest, root, 0.0)
    half = 0.5 * turn * lowest
    return root, lowest, -((a * lowest + b) * lowest + c) / (1.0 + half * half)


@borrower
def _gap(mine: Records, theirs: Records, first: int, stop: int) -> float:
    """The distance [m] of a body's sides from others, negative where the two overlap.

    More than two others are around something, and a body inside it overlaps it.
    """
    gap = np.inf
    inside = False
    around = False
    for row in range(first, stop):
        there = side_at(theirs, row)
        inside = inside != _under(there, mine[0].px, mine[0].py)
        for k in range(len(mine)):
            here = side_at(mine, k)
            gap = min(gap, separation(here, there))
            if row == first:
                around = around != _under(here, there.px, there.py)
    return -abs(gap) if around or (inside and stop - first > 2) else gap


@inner
def _under(edge: Wall, x: float, y: float) -> bool:
    """Whether an edge is crossed by the ray from a point along the x axis."""
    px, py, qx, qy = edge
    return (py > y) != (qy > y) and x < px + (y - py) / (qy - py) * (qx - px)


@inner
def separation(one: Wall, other: Wall) -> float:
    """The distance of two segments [m]; where they cross, minus by how much."""
    p = _off(one, other.px, other.py)
    q = _off(one, other.qx, other.qy)
    a = _off(other, one.px, one.py)
    b = _off(other, one.qx, one.qy)
    if min(p[1], q[1]) < 0.0 < max(p[1], q[1]) and min(a[1], b[1]) < 0.0 < max(a[1], b[1]):
        return -min(min(abs(p[1]), abs(q[1])), min(abs(a[1]), abs(b[1])))
    return min(min(p[0], q[0]), min(a[0], b[0]))


@inner
def _off(wall: Wall, x: float, y: float) -> tuple[float, float]:
    """The distance of a point from a segment, and from its line, to the left positive [m]."""
    ex = wall.qx - wall.px
    ey = wall.qy - wall.py
    ax = x - wall.px
    ay = y - wall.py
    length = math.sqrt(ex * ex + ey * ey)
    if length == 0.0:
        return math.sqrt(ax * ax + ay * ay), 0.0
    along = (ax * ex + ay * ey) / length
    beside = (ex * ay - ey * ax) / length
    beyond = max(-along, along - length, 0.0)
    return math.sqrt(beyond * beyond + beside * beside), beside


@borrower
def _first_meeting(
    among: Movers, j: int, body: Footprint, move: Any, seconds: float, sides: Records, spot: Records
) -> float:
    """The seconds after which a body touches an obstacle, or infinity."""
    rate = math.hypot(move.ahead, move.left) + abs(move.turn) * body.reach + among.movers[j].rim
    time = 0.0
    gap = _gap_at(among, j, body, move, 0.0, sides, spot)
    if gap < -GRAZE:
        return 0.0
    while time < seconds and rate > 0.0:
        before = time
        free = gap > 0.0
        time = min(time + max(gap, STEP) / rate, seconds)
        gap = _gap_at(among, j, body, move, time, sides, spot)
        if gap >= -GRAZE:
            continue
        # Where it was in contact before, without a depth, it touched there.
        low = before
        high = time if free else before
        for _ in range(60):
            middle = 0.5 * (low + high)
            if _gap_at(among, j, body, move, middle, sides, spot) > 0.0:
                low = middle
            else:
                high = middle
        return high
    return np.inf


@borrower
def _gap_at(
    among: Movers, j: int, body: Footprint, move: Any, time: float, sides: Records, spot: Records
) -> float:
    """The distance [m] of a body that has held a move for a time from an obstacle.

    From far away it is that of the circles around them. It is negative where they overlap. The
    sides of the body and the middle of a disc are filled in.
    """
    heading = locate(among, j, move.time + time)
    x, y, theta = moved(move, time)
    at = among.placed[j]
    mover = among.movers[j]
    away = math.hypot(at.x - x, at.y - y)
    reach = max(at.reach, mover.disc) + body.reach
    if away > 2.0 * reach:
        return float(away - reach)
    cos = math.cos(theta)
    sin = math.sin(theta)
    for k in range(len(sides)):
        edge = body.edges[k]
        side = sides[k]
        side.px = x + cos * edge.px - sin * edge.py
        side.py = y + sin * edge.px + cos * edge.py
        side.qx = x + cos * edge.qx - sin * edge.qy
        side.qy = y + sin * edge.qx + cos * edge.qy
    if mover.disc == 0.0:
        turn_sides(among, j, heading)
        return _gap(sides, among.sides, mover.first, mover.stop) - body.radius
    spot[0].px = spot[0].qx = at.x
    spot[0].py = spot[0].qy = at.y
    return float(_gap(sides, spot, 0, 1) - body.radius - mover.disc)
