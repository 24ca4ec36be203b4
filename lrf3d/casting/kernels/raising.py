"""Inserting walls and dynamic obstacles into skylines, compiled; every decision is exact."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting.kernels.beams import (
    SIFTED,
    beam_of,
    bounds,
    length_of,
    sift,
)
from lrf3d.casting.kernels.fan import (
    BATCH,
    BEARING_SLACK,
    SKETCH,
    SLACK,
    START,
    TURN,
    UNCLEAR,
    WIDTH,
    Fan,
    U,
    V,
    leaf_in_view,
    outline,
    reached,
    root_waiting,
    turns_to_meet,
)
from lrf3d.casting.kernels.movers import anywhere, locate, side_at, turn_sides
from lrf3d.casting.kernels.predicates import (
    Beam,
    Wall,
    area_sign,
    between,
    index_of,
    meets_in_line,
    meets_seen,
    side,
    wall_at,
)
from lrf3d.casting.kernels.scans import Laser, aim
from lrf3d.casting.kernels.skyline import (
    AMBIGUOUS,
    BEGINS,
    EXITS,
    HIDDEN,
    MEETS,
    Eye,
    Skylines,
    entry_of,
    insert,
    place_of,
    put,
)
from lrf3d.casting.kernels.tree import (
    LOWEST,
    ONE,
    ROOM,
    Plain,
    Tree,
    enter,
    first_lanes,
    new_stack,
    next_leaf,
    way_of,
)
from lrf3d.compiling import LANES, borrower, compiled, inner
from lrf3d.geometry.lines import Float, Int, Records


class Standing(NamedTuple):
    """Walls with their heights and outlines, in the order of the tree's rows."""

    tree: Tree
    heights: Float  # (n,) [m]
    # (n,) 1 where the inside of a closed object is on the left of the wall, −1 on the right, or 0.
    inner: NDArray[np.int8]
    corners: Float  # (n, 4) the neighbours of its ends p and q on the outline of the object.
    highest: float  # The height of the highest [m].


class UprightWall(NamedTuple):
    """One wall with its height and outline."""

    wall: Wall
    height: float  # [m]
    inner: int  # See Standing.
    corners: Wall  # The neighbours of its ends p and q on the outline of the object.
    name: int  # Its number in the world, or below −1 of an obstacle.


class Sectors(NamedTuple):
    """Evenly spaced sectors of azimuths, as many as rays, and the rays that lie in them."""

    before: Int  # (rays + 1,) the number of rays in the sectors before each.
    half: float  # [rad] half of a sector's width; 0 where each ray is the middle of its sector.
    # The least and the largest slope of each ray's layers (rays, 2), or of all rays' (1, 2).
    slopes: Float


@compiled
def raise_fan(
    plain: Plain, beams_at: Plain, pose: Float, directions: Float, eye: Plain, plain_skies: Plain
) -> bool:
    """Insert walls into the skylines of rays from one pose (3,), sorted by sectors.

    The beams are a `Laser` and its `Sectors`. Fills the directions (2, rays), which are followed by
    PADDING numbers of any value. Returns whether the skylines had room for all walls.
    """
    plain_laser, plain_sectors = beams_at
    sectors = Sectors(*plain_sectors)
    walls = Standing(Tree(*plain[0]), *plain[1:])
    tree = walls.tree
    sight = Eye(*eye)
    skies = Skylines(*plain_skies)
    covered = skies.covered
    beams = len(covered)
    fan = aim(Laser(*plain_laser), pose, directions[0], directions[1])
    edge = 1.0 / (sight.reach * ROOM)
    half = sectors.half
    # The bound of a sector is the least one of its rays.
    shade = covered if half == 0.0 else np.full(beams, edge)
    for i in range(beams):
        covered[i] = max(covered[i], edge)
    view = (fan, sectors)
    left = np.empty(beams, np.int64)
    sketch = np.empty(SKETCH)
    waiting = root_waiting(beams)
    fits = True
    seen = tree, fan, half
    top = min(len(tree.walls), 1)
    first, stop, top = leaf_in_view(seen, edge, shade, sketch, waiting, top)
    while stop > 0 and fits:
        for base in range(first, stop, BATCH):
            batch = min(BATCH, stop - base)
            outline(tree.columns, base, batch, fan, sketch)
            for k in range(batch):
                row = base + k
                open_at, fit = _raise_clearly(walls, (row, k), sketch, view, sight, skies, left)
                fits &= fit
                if open_at != 0:
                    fits &= _raise_open(walls, row, view, sight, skies, left, open_at)
        if half > 0.0:
            _darken(shade, waiting[top].first, waiting[top].stop, sectors.before, covered)
        first, stop, top = leaf_in_view(seen, edge, shade, sketch, waiting, top)
    return fits


@borrower
def _darken(shade: Float, first: int, stop: int, before: Int, covered: Float) -> None:
    """Update the bounds of some sectors: each is the least one of its rays."""
    for sector in range(first, stop):
        shade[sector] = np.inf
        for i in range(before[sector], before[sector + 1]):
            shade[sector] = min(shade[sector], covered[i])


@inner
def _raise_open(
    walls: Standing, row: int, view: tuple[Fan, Sectors], eye: Eye, skies: Skylines, left: Int,
    count: int,
) -> bool:  # fmt: skip
    """Insert a wall at the azimuths that were left open, exactly; False if there is no room.

    Of those left the first ones count, or all azimuths if their number is UNCLEAR.
    """
    fan, sectors = view
    fits = True
    for k in range(len(left) if count == UNCLEAR else count):
        i = k if count == UNCLEAR else left[k]
        beam = Beam(fan.x, fan.y, fan.dx[i], fan.dy[i])
        own = _own_eye(eye, sectors.slopes, i)
        fits = _raise_exactly(_piece(walls, row), i, beam, own, walls.highest, skies) and fits
    return fits


@borrower
def _raise_clearly(
    walls: Standing, seen: tuple[int, int], sketch: Float, view: tuple[Fan, Sectors], eye: Eye,
    skies: Skylines, left: Int,
) -> tuple[int, bool]:  # fmt: skip
    """Insert a wall, by its row and its number in a sketch, at azimuths where that is clear.

    Returns how many azimuths are left open, or UNCLEAR for all, and whether there was room.
    """
    row, k = seen
    fan, sectors = view
    place = index_of(k)
    wall = wall_at(walls.tree.walls, row)
    u = sketch[U + place]
    v = sketch[V + place]
    slack = sketch[SLACK + place]
    if not slack < np.inf or fan.per_step == 0.0:
        return UNCLEAR, True
    covered = skies.covered
    beams = len(covered)
    sense = 1 if u * (wall.qy - wall.py) + v * (wall.qx - wall.px) > 0.0 else -1
    height = walls.heights[row]
    exits = EXITS if sense * walls.inner[row] > 0 and height < eye.z else MEETS
    name = walls.tree.rows[row]
    numbers = sectors.before
    half = sectors.half
    aside = BEARING_SLACK + half
    width = sketch[WIDTH + place]
    left_open = 0
    fits = True
    before, after = turns_to_meet(sketch[START + place] - half, width + 2.0 * half, fan.half)
    for turn in range(before, after + 1):
        a = sketch[START + place] + turn * TURN + fan.half
        b = a + width
        first = index_of(numbers[reached((a - aside) * fan.per_step, beams)])
        stop = index_of(numbers[reached((b + aside) * fan.per_step, beams)])
        sure = index_of(numbers[reached((a + aside) * fan.per_step, beams)])
        sure_stop = index_of(numbers[reached((b - aside) * fan.per_step, beams)])
        for i in range(first, stop):
            depth = fan.dx[i] * u - fan.dy[i] * v
            if depth + slack < covered[i]:
                continue
            at = AMBIGUOUS
            new = entry_of(depth - slack, depth + slack, height, wall, (name, exits), eye.z)
            own = _own_eye(eye, sectors.slopes, i)
            if sure <= i < sure_stop:
                at = place_of(new, i, own, skies)
            if at == AMBIGUOUS:
                left[left_open] = i
                left_open += 1
            elif at != HIDDEN:
                fits = put(new, i, at, own, walls.highest, skies) and fits
    return left_open, fits


@borrower
def _own_eye(eye: Eye, slopes: Float, i: int) -> Eye:
    """The eye of a ray, whose layers have slopes of their own, or those of all rays."""
    row = min(index_of(i), index_of(len(slopes) - 1))
    return Eye(eye.z, slopes[row, 0], slopes[row, 1], eye.reach)


@compiled
def raise_rays(plain: Plain, rays: Records, eye: Plain, slopes: Float, plain_skies: Plain) -> bool:
    """Insert walls into the skylines of rays (n,), each from its own origin.

    Slopes are the least and the largest of each ray's layers (n, 2), or of all rays' (1, 2).
    Returns whether the skylines had room for all walls.
    """
    walls = Standing(Tree(*plain[0]), *plain[1:])
    tree = walls.tree
    sight = Eye(*eye)
    skies = Skylines(*plain_skies)
    stack = new_stack()
    sifted = np.empty(SIFTED)
    fits = True
    for i in range(len(rays)):
        beam = beam_of(rays, i)
        way = way_of(beam.ox, beam.oy, 0.0, 0.0, beam.dx, beam.dy)
        own = _own_eye(sight, slopes, i)
        limit = _farthest(own, walls.highest) * ROOM
        top = enter(tree, stack)
        while top > 0:
            limit = min(limit, ROOM / skies.covered[i]) if skies.covered[i] > 0.0 else limit
            first, stop, top = next_leaf(tree, way, limit, stack, top)
            for base in range(first, stop, LANES):
                met = sift(tree.columns, base, beam, limit, sifted) & first_lanes(stop - base)
                while met != 0:
                    piece = _piece(walls, base + int(LOWEST[met]))
                    met &= met - ONE
                    fits = _raise_exactly(piece, i, beam, own, walls.highest, skies) and fits
    return fits


@compiled
def raise_obstacles(
    plain: Plain, own: int, rays: Records, eye: Plain, slopes: Float, plain_skies: Plain
) -> bool:
    """Insert dynamic obstacles into the skylines of rays (n,), where they are at the rays' times.

    The robot's own outline is left out; walls of obstacles have numbers below −1.
    """
    among = anywhere(plain)
    movers = among.movers
    sides = among.sides
    sight = Eye(*eye)
    skies = Skylines(*plain_skies)
    fits = True
    for j in range(len(movers)):
        mover = movers[j]
        placed = np.nan
        sense = 0
        for i in range(len(rays)):
            beam = beam_of(rays, i)
            if rays[i].time != placed:
                placed = rays[i].time
                turn_sides(among, j, locate(among, j, placed))
                sense = _sense(sides, mover.first, mover.stop)
            at = among.placed[j]
            east = at.x - beam.ox
            north = at.y - beam.oy
            size = math.sqrt(beam.dx * beam.dx + beam.dy * beam.dy)
            wide = (at.reach * ROOM + 1e-12 * (abs(at.x) + abs(at.y))) * size
            ahead = beam.dx * east + beam.dy * north
            if j == own or abs(beam.dx * north - beam.dy * east) > wide or ahead < -wide:
                continue
            seen = _own_eye(sight, slopes, i)
            before = mover.stop - 1
            for k in range(mover.first, mover.stop):
                after = k + 1 if k + 1 < mover.stop else mover.first
                corners = Wall(sides[before].px, sides[before].py, sides[after].qx, sides[after].qy)
                piece = UprightWall(side_at(sides, k), mover.height, sense, corners, -2 - k)
                # A wall of the world may be higher: it covers by itself.
                fits = _raise_exactly(piece, i, beam, seen, np.inf, skies) and fits
                before = k
    return fits


@inner
def _sense(sides: Records, first: int, stop: int) -> int:
    """The orientation of an outline: 1 with its inside on the left, or −1."""
    area = 0.0
    for k in range(first, stop):
        side = sides[k]
        area += (side.px - sides[first].px) * (side.qy - sides[first].py)
        area -= (side.py - sides[first].py) * (side.qx - sides[first].px)
    return 1 if area > 0.0 else -1


@inner
def _piece(walls: Standing, row: int) -> UprightWall:
    """The wall in a row."""
    return UprightWall(
        wall_at(walls.tree.walls, row),
        walls.heights[row],
        int(walls.inner[row]),
        wall_at(walls.corners, row),
        int(walls.tree.rows[row]),
    )


@inner
def _farthest(eye: Eye, highest: float) -> float:
    """Distance [m] from which all layers of a ray meet the floor or pass over the highest wall."""
    reach = eye.reach
    if eye.most < 0.0:
        reach = min(reach, -eye.z / eye.most)
    if eye.least > 0.0:
        reach = min(reach, max(highest - eye.z, 0.0) / eye.least)
    return reach * ROOM


@inner
def _raise_exactly(
    piece: UprightWall, i: int, beam: Beam, eye: Eye, highest: float, skies: Skylines
) -> bool:
    """Insert a wall at an azimuth if its beam meets it exactly; False if there is no room."""
    wall = piece.wall
    height = piece.height
    low = height < eye.z
    meets, near, far = bounds(wall, beam, np.inf)
    if not meets:
        return True
    sense = area_sign(beam.ox, beam.oy, wall)
    exits = sense * piece.inner > 0
    if far == np.inf:
        holds = sense == 0 and between(beam.ox, beam.oy, wall)
        if not holds and not (
            meets_seen(sense, beam, wall) if sense != 0 else meets_in_line(beam, wall)
        ):
            return True
        if sense == 0 and low:
            return _raise_along(piece, i, beam, eye, highest, skies)
        if piece.inner != 0 and low:
            exits = _exits_at_end(piece, beam, exits)
        t = length_of(beam, wall)
        near = t / ROOM
        far = t * ROOM
    depths = (1.0 / far, 1.0 / near) if near > 0.0 else (np.inf, np.inf)
    kind = EXITS if exits and low else MEETS
    new = entry_of(depths[0], depths[1], height, wall, (piece.name, kind), eye.z)
    return insert(new, i, beam, eye, highest, skies)


@inner
def _raise_along(
    piece: UprightWall, i: int, beam: Beam, eye: Eye, highest: float, skies: Skylines
) -> bool:
    """Insert a low wall whose line passes through the sensor: its near end, and its far end."""
    wall = piece.wall
    height = piece.height
    name = piece.name
    t = length_of(beam, wall)
    depths = (1.0 / (t * ROOM), ROOM / t) if t > 0.0 else (np.inf, np.inf)
    px, py, qx, qy = wall
    along = side(beam, px, py) == 0 and side(beam, qx, qy) == 0
    skies.mixed[i] = max(skies.mixed[i], int(along))
    kind = BEGINS if along else MEETS
    new = entry_of(depths[0], depths[1], height, wall, (name, kind), eye.z)
    fits = insert(new, i, beam, eye, highest, skies)
    if not along:
        return fits
    # The far end, as a wall across the beam that meets it just there.
    ahead = beam.dx * (qx - px) + beam.dy * (qy - py) > 0.0
    x, y = (qx, qy) if ahead else (px, py)
    across = Wall(x, y, x - beam.dy, y + beam.dx)
    t = length_of(beam, across)
    if not t > 0.0:
        return fits
    new = entry_of(1.0 / (t * ROOM), ROOM / t, height, across, (name, EXITS), eye.z)
    return insert(new, i, beam, eye, highest, skies) and fits


@inner
def _exits_at_end(piece: UprightWall, beam: Beam, exits: bool) -> bool:
    """Whether a beam reaches a wall of a closed object from inside, also at the wall's ends."""
    px, py, qx, qy = piece.wall
    ax, ay, bx, by = piece.corners
    left = piece.inner > 0
    if side(beam, px, py) == 0:
        ahead, behind = ((qx, qy), (ax, ay)) if left else ((ax, ay), (qx, qy))
        return _comes_through(beam, (px, py), ahead, behind)
    if side(beam, qx, qy) == 0:
        ahead, behind = ((bx, by), (px, py)) if left else ((px, py), (bx, by))
        return _comes_through(beam, (qx, qy), ahead, behind)
    return exits


@inner
def _comes_through(
    beam: Beam, corner: tuple[float, float], ahead: tuple[float, float], behind: tuple[float, float]
) -> bool:
    """Whether a beam through a corner of an outline reaches it from inside.

    The outline runs from the point behind to the corner and on, with its inside on the left.
    """
    x, y = corner
    first = side(beam, ahead[0], ahead[1])
    last = side(beam, behind[0], behind[1])
    if first != 0 and first == last:
        # Both neighbours are on one side of the beam: it is inside if the corner is reflex.
        return area_sign(x, y, Wall(ahead[0], ahead[1], behind[0], behind[1])) < 0
    nearer = beam.dx * (ahead[0] - x) + beam.dy * (ahead[1] - y) < 0.0
    if first == 0 and nearer:
        return True
    nearer = beam.dx * (behind[0] - x) + beam.dy * (behind[1] - y) < 0.0
    if last == 0 and nearer:
        return True
    return first > 0 or last < 0
