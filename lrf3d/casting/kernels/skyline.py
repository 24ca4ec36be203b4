"""Skylines: which walls the layers of one azimuth meet, compiled; every decision exact.

The beams of one azimuth of a level sensor lie in an upright plane. A wall of height h that the
plane meets at t stops the beam of slope s where z + t·s ≤ h, which is s ≤ (h − z) / t, the slope of
its top. So one planar traversal serves all layers: each azimuth keeps its skyline, the walls in
order of t that rise above all nearer ones, and the layers are read from it from below.

The top of a closed object lower than the sensor is seen from above. A beam that passes over the
wall where it enters and is not above the one where it leaves meets the top between the two: the
wall seen from inside is an entry that `exits`, whose beams end where they come down to its height.
A low wall along the beam is such an interval, too.

Bounds are kept in 1 / t, as in the depth buffer of `fan`; where they overlap, expansions decide.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.casting.kernels.beams import (
    MISSED,
    OPEN,
    Nearest,
    beam_of,
    judged,
    length_of,
    sift,
    within,
)
from lrf3d.casting.kernels.fan import (
    BATCH,
    BEARING_SLACK,
    SKETCH,
    SLACK,
    START,
    TURN,
    WAITING,
    WIDTH,
    Fan,
    U,
    V,
    enter_boxes,
    hidden,
    outline,
    reached,
    turns_to_meet,
    view_boxes,
)
from lrf3d.casting.kernels.movers import anywhere, place, side_at
from lrf3d.casting.kernels.predicates import (
    Beam,
    Wall,
    area_sign,
    between,
    compare,
    compare_height,
    index_of,
    meets_in_line,
    meets_seen,
    side,
    wall_at,
)
from lrf3d.casting.kernels.scans import PADDING, Laser, aim
from lrf3d.casting.kernels.tree import (
    ROOM,
    SMALL,
    STACK,
    Plain,
    Tree,
    Way,
    enter,
    new_stack,
    next_leaf,
)
from lrf3d.compiling import borrower, compiled, inner, record
from lrf3d.geometry.lines import Float, Int, Records

# Bound on the relative rounding error of the slope of a wall's top, in addition to that of 1 / t.
TOP_SLACK = 8.0 * 2.0**-53

# Relative distance of a floor and a wall from which on float64 shows which is met first.
CLEAR_FLOOR = 1e-12

# Kinds of entries: a wall that beams meet, one that they come to over the top of an object, and the
# near end of a low wall along the beam.
MEETS = 0
EXITS = 1
BEGINS = 2

# In place of where an entry stands.
HIDDEN = -1
AMBIGUOUS = -2

# An entry of a skyline: a wall, or a place where beams leave the space over a low object.
ENTRY = record(
    low=float, high=float,  # Bounds on 1 / t [1/m].
    sure=float, most=float,  # Bounds on the slope of its top.
    height=float,  # [m]
    px=float, py=float, qx=float, qy=float,  # Its ends [m].
    row=int,  # Its number in the world, or −1.
    exits=int,  # What it is: MEETS, EXITS or BEGINS.
)  # fmt: skip


class Standing(NamedTuple):
    """Walls as they stand, in the order of the tree's rows."""

    tree: Tree
    heights: Float  # (n,) [m]
    # (n,) 1 where the inside of a closed object is on the left of the wall, −1 on the right, or 0.
    inner: NDArray[np.int8]
    corners: Float  # (n, 4) the neighbours of its ends p and q on the outline of the object.
    highest: float  # The height of the highest [m].


class Piece(NamedTuple):
    """One wall as it stands."""

    wall: Wall
    height: float  # [m]
    inner: int  # See Standing.
    corners: Wall  # The neighbours of its ends p and q on the outline of the object.
    name: int  # Its number in the world, or below −1 of an obstacle.


class Skylines(NamedTuple):
    """The skylines of azimuths."""

    entries: Records  # (room · azimuths,) of kind ENTRY, the first of all azimuths first.
    counts: Int  # (azimuths,) how many of its room each azimuth has.
    # (azimuths,) 1 where a low wall runs along the beam: entries then overlap.
    mixed: NDArray[np.int8]
    room: int  # For how many entries each azimuth has room.
    covered: Float  # (azimuths,) bound on 1 / t of the wall that hides all behind it [1/m].


class Eye(NamedTuple):
    """What a sensor sees of skylines."""

    z: float  # Its height [m].
    least: float  # The least slope of its layers,
    most: float  # and the largest.
    reach: float  # The largest t that it measures [m].


@compiled
def raise_fan(
    plain: Plain, plain_laser: Plain, pose: Float, rays: Records, eye: Plain, plain_skies: Plain
) -> bool:
    """Enter walls into the skylines of evenly spaced azimuths from one pose (3,), and fill rays.

    Returns whether the skylines had room for all of them.
    """
    walls = Standing(Tree(*plain[0]), *plain[1:])
    tree = walls.tree
    sight = Eye(*eye)
    skies = Skylines(*plain_skies)
    covered = skies.covered
    beams = len(covered)
    dx = np.empty(beams + PADDING)
    dy = np.empty(beams + PADDING)
    fan = aim(Laser(*plain_laser), pose, dx, dy)
    edge = 1.0 / (sight.reach * ROOM)
    for i in range(beams):
        covered[i] = max(covered[i], edge)
        ray = rays[i]
        ray.x = fan.x
        ray.y = fan.y
        ray.dx = dx[i]
        ray.dy = dy[i]
    sketch = np.empty(SKETCH)
    waiting = np.empty(STACK, WAITING)
    root = waiting[0]
    root.node = 0
    root.first = 0
    root.stop = beams
    root.near = np.inf
    top = 1 if len(tree.walls) > 0 else 0
    fits = True
    while top > 0 and fits:
        top -= 1
        box = waiting[top]
        if hidden(covered, box.first, box.stop, box.near):
            continue
        first = tree.links[box.node, 0]
        count = tree.links[box.node, 1]
        if count < 0:
            view_boxes(tree.boxes, first, -count, fan, sketch)
            top = enter_boxes((first, -count), fan, edge, covered, sketch, waiting, top)
            continue
        for base in range(first, first + count, BATCH):
            batch = min(BATCH, first + count - base)
            outline(tree.columns, base, batch, fan, sketch)
            for k in range(batch):
                fits = _raise_wall(walls, base + k, k, sketch, fan, sight, skies) and fits
    return fits


@inner
def _raise_wall(
    walls: Standing, row: int, k: int, sketch: Float, fan: Fan, eye: Eye, skies: Skylines
) -> bool:
    """Enter a wall, k of a sketch, at all azimuths that meet it."""
    place = index_of(k)
    wall = wall_at(walls.tree.walls, row)
    u = sketch[U + place]
    v = sketch[V + place]
    slack = sketch[SLACK + place]
    covered = skies.covered
    beams = len(covered)
    fits = True
    if not slack < np.inf or fan.per_step == 0.0:
        piece = _piece(walls, row)
        for i in range(beams):
            beam = Beam(fan.x, fan.y, fan.dx[i], fan.dy[i])
            fits = _raise_exactly(piece, i, beam, eye, walls.highest, skies) and fits
        return fits
    sense = 1 if u * (wall.qy - wall.py) + v * (wall.qx - wall.px) > 0.0 else -1
    height = walls.heights[row]
    exits = EXITS if sense * walls.inner[row] > 0 and height < eye.z else MEETS
    name = walls.tree.rows[row]
    # Taken out of their tuples once: each time counts a reference.
    x = fan.x
    y = fan.y
    dx = fan.dx
    dy = fan.dy
    per_step = fan.per_step
    z = eye.z
    highest = walls.highest
    before, after = turns_to_meet(sketch[START + place], sketch[WIDTH + place], fan.half)
    for turn in range(before, after + 1):
        a = sketch[START + place] + turn * TURN + fan.half
        b = a + sketch[WIDTH + place]
        first = reached((a - BEARING_SLACK) * per_step, beams)
        stop = reached((b + BEARING_SLACK) * per_step, beams)
        sure = reached((a + BEARING_SLACK) * per_step, beams)
        sure_stop = reached((b - BEARING_SLACK) * per_step, beams)
        for i in range(first, stop):
            depth = dx[i] * u - dy[i] * v
            if depth + slack < covered[i]:
                continue
            if i < sure or i >= sure_stop:
                beam = Beam(x, y, dx[i], dy[i])
                fits = _raise_exactly(_piece(walls, row), i, beam, eye, highest, skies) and fits
                continue
            new = _entry(depth - slack, depth + slack, height, wall, (name, exits), z)
            at = _place(new, i, eye, skies)
            if at == AMBIGUOUS:
                at = _place_exactly(new, i, Beam(x, y, dx[i], dy[i]), eye, skies)
            if at != HIDDEN:
                fits = _put(new, i, at, eye, highest, skies) and fits
    return fits


@compiled
def raise_rays(plain: Plain, rays: Records, eye: Plain, slopes: Float, plain_skies: Plain) -> bool:
    """Enter walls into the skylines of rays (n,), each from its own origin.

    Slopes (n, 2) are the least and the largest of the layers of each ray, or of (1, 2) of all.
    Returns whether the skylines had room for all of them.
    """
    walls = Standing(Tree(*plain[0]), *plain[1:])
    tree = walls.tree
    sight = Eye(*eye)
    skies = Skylines(*plain_skies)
    stack = new_stack()
    sifted = np.empty(SMALL + PADDING)
    fits = True
    for i in range(len(rays)):
        beam = beam_of(rays, i)
        way = Way(beam.ox, beam.oy, 0.0, 0.0, beam.dx, beam.dy)
        row = min(i, len(slopes) - 1)
        own = Eye(sight.z, slopes[row, 0], slopes[row, 1], sight.reach)
        limit = _farthest(own, walls.highest) * ROOM
        top = enter(tree, stack)
        while top > 0:
            limit = min(limit, ROOM / skies.covered[i]) if skies.covered[i] > 0.0 else limit
            first, stop, top = next_leaf(tree, way, limit, stack, top)
            sift(tree.columns, first, stop, beam, limit, sifted)
            for k in range(first, stop):
                if sifted[k - first] <= 0.0:
                    piece = _piece(walls, k)
                    fits = _raise_exactly(piece, i, beam, own, walls.highest, skies) and fits
    return fits


@compiled
def raise_obstacles(
    plain: Plain, own: int, rays: Records, eye: Plain, slopes: Float, plain_skies: Plain
) -> bool:
    """Enter dynamic obstacles into the skylines of rays (n,), where they are at the rays' times.

    All but the robot's own are seen; their walls are named by numbers below −1.
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
                place(among, j, placed)
                sense = _sense(sides, mover.first, mover.stop)
            at = among.placed[j]
            east = at.x - beam.ox
            north = at.y - beam.oy
            size = math.sqrt(beam.dx * beam.dx + beam.dy * beam.dy)
            wide = (at.reach * ROOM + 1e-12 * (abs(at.x) + abs(at.y))) * size
            ahead = beam.dx * east + beam.dy * north
            if j == own or abs(beam.dx * north - beam.dy * east) > wide or ahead < -wide:
                continue
            row = min(i, len(slopes) - 1)
            seen = Eye(sight.z, slopes[row, 0], slopes[row, 1], sight.reach)
            before = mover.stop - 1
            for k in range(mover.first, mover.stop):
                after = k + 1 if k + 1 < mover.stop else mover.first
                corners = Wall(sides[before].px, sides[before].py, sides[after].qx, sides[after].qy)
                piece = Piece(side_at(sides, k), mover.height, sense, corners, -2 - k)
                # A wall of the world may be higher: it covers by itself.
                fits = _raise_exactly(piece, i, beam, seen, np.inf, skies) and fits
                before = k
    return fits


@inner
def _sense(sides: Records, first: int, stop: int) -> int:
    """The sense in which an outline runs: 1 with its inside on the left, or −1."""
    area = 0.0
    for k in range(first, stop):
        side = sides[k]
        area += (side.px - sides[first].px) * (side.qy - sides[first].py)
        area -= (side.py - sides[first].py) * (side.qx - sides[first].px)
    return 1 if area > 0.0 else -1


@inner
def _piece(walls: Standing, row: int) -> Piece:
    """The wall in a row."""
    return Piece(
        wall_at(walls.tree.walls, row),
        walls.heights[row],
        int(walls.inner[row]),
        wall_at(walls.corners, row),
        int(walls.tree.rows[row]),
    )


@inner
def _farthest(eye: Eye, highest: float) -> float:
    """How far [m] the layers of a ray can meet a wall: up to the floor, or over the highest."""
    reach = eye.reach
    if eye.most < 0.0:
        reach = min(reach, -eye.z / eye.most)
    if eye.least > 0.0:
        reach = min(reach, max(highest - eye.z, 0.0) / eye.least)
    return reach * ROOM


@inner
def _raise_exactly(
    piece: Piece, i: int, beam: Beam, eye: Eye, highest: float, skies: Skylines
) -> bool:
    """Enter a wall at an azimuth if its beam meets it, exactly; whether there was room."""
    wall = piece.wall
    height = piece.height
    low = height < eye.z
    verdict, near, far = judged(wall, beam, Nearest(-1, np.inf, np.inf))
    if verdict == MISSED:
        return True
    sense = area_sign(beam.ox, beam.oy, wall)
    exits = sense * piece.inner > 0
    if verdict == OPEN:
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
    bounds = (1.0 / far, 1.0 / near) if near > 0.0 else (np.inf, np.inf)
    kind = EXITS if exits and low else MEETS
    new = _entry(bounds[0], bounds[1], height, wall, (piece.name, kind), eye.z)
    return _insert(new, i, beam, eye, highest, skies)


@inner
def _raise_along(
    piece: Piece, i: int, beam: Beam, eye: Eye, highest: float, skies: Skylines
) -> bool:
    """Enter a low wall whose line goes through the sensor: where it begins, and where it ends."""
    wall = piece.wall
    height = piece.height
    name = piece.name
    t = length_of(beam, wall)
    bounds = (1.0 / (t * ROOM), ROOM / t) if t > 0.0 else (np.inf, np.inf)
    px, py, qx, qy = wall
    along = side(beam, px, py) == 0 and side(beam, qx, qy) == 0
    skies.mixed[i] = max(skies.mixed[i], int(along))
    kind = BEGINS if along else MEETS
    new = _entry(bounds[0], bounds[1], height, wall, (name, kind), eye.z)
    fits = _insert(new, i, beam, eye, highest, skies)
    if not along:
        return fits
    # The far end, on a wall across the beam, which it meets just there.
    ahead = beam.dx * (qx - px) + beam.dy * (qy - py) > 0.0
    x, y = (qx, qy) if ahead else (px, py)
    across = Wall(x, y, x - beam.dy, y + beam.dx)
    t = length_of(beam, across)
    if not t > 0.0:
        return fits
    new = _entry(1.0 / (t * ROOM), ROOM / t, height, across, (name, EXITS), eye.z)
    return _insert(new, i, beam, eye, highest, skies) and fits


@inner
def _exits_at_end(piece: Piece, beam: Beam, exits: bool) -> bool:
    """Whether a beam comes to a wall of a closed object from inside, also through its ends."""
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
    """Whether a beam comes to a corner, on its line, through the inside of an outline.

    The outline runs from behind to the corner and ahead, with the inside on its left.
    """
    x, y = corner
    first = side(beam, ahead[0], ahead[1])
    last = side(beam, behind[0], behind[1])
    if first != 0 and first == last:
        # Both neighbours are on one side: the inside holds the beam where the corner is reflex.
        return area_sign(x, y, Wall(ahead[0], ahead[1], behind[0], behind[1])) < 0
    nearer = beam.dx * (ahead[0] - x) + beam.dy * (ahead[1] - y) < 0.0
    if first == 0 and nearer:
        return True
    nearer = beam.dx * (behind[0] - x) + beam.dy * (behind[1] - y) < 0.0
    if last == 0 and nearer:
        return True
    return first > 0 or last < 0


class Entry(NamedTuple):
    """An entry of a skyline before it is entered: see ENTRY."""

    low: float
    high: float
    sure: float
    most: float
    height: float
    wall: Wall
    row: int
    exits: int


@borrower
def _entry(
    low: float, high: float, height: float, wall: Wall, name: tuple[int, int], z: float
) -> Entry:
    """An entry with bounds on 1 / t, and its number and whether it exits."""
    rise = height - z
    sure = np.inf if rise >= 0.0 else -np.inf
    most = sure
    if high < np.inf:
        sure = rise * (low if rise >= 0.0 else high)
        most = rise * (high if rise >= 0.0 else low)
        sure -= TOP_SLACK * abs(sure)
        most += TOP_SLACK * abs(most)
    return Entry(low, high, sure, most, height, wall, name[0], name[1])


@inner
def _insert(new: Entry, i: int, beam: Beam, eye: Eye, highest: float, skies: Skylines) -> bool:
    """Enter into the skyline of an azimuth what no nearer wall hides; whether there was room."""
    place = _place(new, i, eye, skies)
    if place == AMBIGUOUS:
        place = _place_exactly(new, i, beam, eye, skies)
    return place == HIDDEN or _put(new, i, place, eye, highest, skies)


@borrower
def _place(new: Entry, i: int, eye: Eye, skies: Skylines) -> int:
    """Where an entry stands in a skyline; HIDDEN, or AMBIGUOUS where bounds do not show it."""
    if new.most < eye.least and new.exits != BEGINS:
        return HIDDEN
    entries = skies.entries
    columns = len(skies.counts)
    count = skies.counts[i]
    mixed = skies.mixed[i] != 0
    for k in range(count):
        entry = entries[k * columns + i]
        if new.low > entry.high:
            return k
        if not new.high < entry.low:
            return AMBIGUOUS
        if _hides(entry, new, eye, mixed):
            return HIDDEN
    return count


@inner
def _place_exactly(new: Entry, i: int, beam: Beam, eye: Eye, skies: Skylines) -> int:
    """Where an entry stands in a skyline, or HIDDEN."""
    entries = skies.entries
    columns = len(skies.counts)
    count = skies.counts[i]
    for k in range(count):
        entry = entries[k * columns + i]
        if _comes_first(new, entry, beam):
            return k
        if _hides(entry, new, eye, skies.mixed[i] != 0):
            return HIDDEN
    return count


@borrower
def _hides(near: Any, far: Any, eye: Eye, mixed: bool) -> bool:
    """Whether no layer that passes over an entry meets one behind it.

    The ends of a wall along the beam count whatever stands before them.
    """
    if mixed and far.exits != MEETS:
        return False
    if near.sure >= far.most or near.sure >= eye.most:
        return True
    return bool(near.height >= far.height and far.height >= eye.z)


@borrower
def _put(new: Entry, i: int, place: int, eye: Eye, highest: float, skies: Skylines) -> bool:
    """Enter an entry in its place, and take out what it hides; whether there was room."""
    entries = skies.entries
    columns = len(skies.counts)
    count = skies.counts[i]
    kept = place
    for k in range(place, count):
        if not _hides(new, entries[k * columns + i], eye, skies.mixed[i] != 0):
            if kept < k:
                entries[kept * columns + i] = entries[k * columns + i]
            kept += 1
    if kept == skies.room:
        return False
    for k in range(kept, place, -1):
        entries[k * columns + i] = entries[(k - 1) * columns + i]
    skies.counts[i] = kept + 1
    entry = entries[place * columns + i]
    entry.low = new.low
    entry.high = new.high
    entry.sure = new.sure
    entry.most = new.most
    entry.height = new.height
    entry.px, entry.py, entry.qx, entry.qy = new.wall
    entry.row = new.row
    entry.exits = new.exits
    if new.sure >= eye.most or (new.height >= highest and new.height >= eye.z):
        skies.covered[i] = max(skies.covered[i], new.low)
    return True


@inner
def _comes_first(new: Entry, entry: Any, beam: Beam) -> bool:
    """Whether a new entry stands before another one of a skyline, exactly."""
    if new.low > entry.high:
        return True
    if new.high < entry.low:
        return False
    order = compare(beam, new.wall, _wall_of(entry))
    if order != 0:
        return order < 0
    # What comes through the inside of an object has met its top before.
    if (new.exits == EXITS) != (entry.exits == EXITS):
        return new.exits == EXITS
    return new.row < entry.row


@inner
def _wall_of(entry: Any) -> Wall:
    return Wall(entry.px, entry.py, entry.qx, entry.qy)


class Layers(NamedTuple):
    """Layers by ascending slope, and what becomes of t."""

    slopes: Float  # (k, layers) for each azimuth, or of k = 1 for all.
    lengths: Float  # (layers,) how long a beam is at t = 1: its range is t times this.
    nears: Float  # (layers,) the least t that is measured [m],
    reaches: Float  # (layers,) and the largest.


@compiled
def read_layers(
    rays: Records, z: float, plain_layers: Plain, range_max: float, plain_skies: Plain,
    ranges: Float, hits: NDArray[np.int32],
) -> None:  # fmt: skip
    """Fill ranges and walls (azimuths, layers) from the skylines of rays, over a floor at z = 0.

    The skylines are empty then.
    """
    skies = Skylines(*plain_skies)
    layers = Layers(*plain_layers)
    slopes = layers.slopes
    entries = skies.entries
    columns = len(skies.counts)
    many = len(layers.lengths)
    floor = np.empty((1, many))
    ground = np.empty(many)
    # Between these all layers measure.
    near = 0.0
    far = np.inf
    for r in range(many):
        near = max(near, layers.nears[r] * ROOM)
        far = min(far, layers.reaches[r] / ROOM)
    for i in range(len(rays)):
        beam = beam_of(rays, i)
        own = min(i, len(slopes) - 1)
        if i < len(slopes):
            for r in range(many):
                slope = slopes[i, r]
                floor[0, r] = -z / slope if slope < 0.0 else np.inf
                ground[r] = _limited(floor[0, r], r, layers, range_max)
        count = skies.counts[i]
        mixed = skies.mixed[i] != 0
        skies.covered[i] = 0.0
        skies.mixed[i] = 0
        skies.counts[i] = 0
        if mixed:
            for r in range(many):
                ranges[i, r], hits[i, r] = _among_overlapping(
                    entries[i::columns][:count],
                    beam,
                    (z, slopes[own, r], r, range_max),
                    layers,
                    ground[r],
                )
            continue
        first = 0
        for j in range(count):
            entry = entries[j * columns + i]
            stop = _beyond(slopes, own, (first, many), entry.sure)
            most = entry.most
            while stop < many and slopes[own, stop] <= most:
                wall = _wall_of(entry)
                if compare_height(slopes[own, stop], z, entry.height, beam, wall) > 0:
                    break
                stop += 1
            if stop == first:
                continue
            if entry.exits == EXITS:
                for r in range(first, stop):
                    t = (entry.height - z) / slopes[own, r]
                    ranges[i, r] = _limited(t, r, layers, range_max)
                    hits[i, r] = max(entry.row, -1) if math.isfinite(ranges[i, r]) else -1
                first = stop
                continue
            wall = _wall_of(entry)
            t = length_of(beam, wall)
            begin = _beyond(floor, 0, (first, stop), t * (1.0 - CLEAR_FLOOR))
            while begin < stop and floor[0, begin] < t * (1.0 + CLEAR_FLOOR):
                if compare_height(slopes[own, begin], z, 0.0, beam, wall) >= 0:
                    break
                begin += 1
            _stand(ground, i, (first, begin), ranges, hits)
            if near < t < far:
                _measure(t, max(entry.row, -1), layers.lengths, i, (begin, stop), ranges, hits)
            else:
                for r in range(begin, stop):
                    ranges[i, r] = _within(t, r, beam, wall, layers, range_max)
                    hits[i, r] = max(entry.row, -1) if math.isfinite(ranges[i, r]) else -1
            first = stop
        _stand(ground, i, (first, many), ranges, hits)


@borrower
def _beyond(values: Float, row: int, part: tuple[int, int], limit: float) -> int:
    """The first of ascending values of a part of a row that is above a limit, or the part's end."""
    low, high = part
    while low < high:
        middle = (low + high) // 2
        if values[row, middle] <= limit:
            low = middle + 1
        else:
            high = middle
    return low


@borrower
def _stand(
    ground: Float, i: int, part: tuple[int, int], ranges: Float, hits: NDArray[np.int32]
) -> None:
    """Let a part of the layers of an azimuth end on the floor."""
    for r in range(index_of(part[0]), index_of(part[1])):
        ranges[i, r] = ground[r]
        hits[i, r] = -1


@borrower
def _measure(
    t: float, name: int, lengths: Float, i: int, part: tuple[int, int], ranges: Float,
    hits: NDArray[np.int32],
) -> None:  # fmt: skip
    """Let a part of the layers of an azimuth end at a wall."""
    for r in range(index_of(part[0]), index_of(part[1])):
        ranges[i, r] = t * lengths[r]
        hits[i, r] = name


@inner
def _within(t: float, r: int, beam: Beam, wall: Wall, layers: Layers, range_max: float) -> float:
    """The range of a layer at a wall that it meets at t, within its limits, exactly."""
    t = within(t, layers.nears[r], layers.reaches[r], beam, wall)
    return min(t * layers.lengths[r], range_max) if t < np.inf else np.inf


@inner
def _limited(t: float, r: int, layers: Layers, range_max: float) -> float:
    """The range of a layer at t within its limits: +inf above, −inf below."""
    if not t <= layers.reaches[r]:
        return np.inf
    return min(t * layers.lengths[r], range_max) if t >= layers.nears[r] else -np.inf


@inner
def _among_overlapping(
    row: Records, beam: Beam, place: tuple[float, float, int, float], layers: Layers,
    ground: float,
) -> tuple[float, int]:  # fmt: skip
    """The range and the wall of a layer of a skyline that has low walls along the beam."""
    z, slope, r, range_max = place
    for j in range(len(row)):
        entry = row[j]
        wall = _wall_of(entry)
        if compare_height(slope, z, entry.height, beam, wall) > 0:
            continue
        top = entry.height if entry.exits == EXITS else -np.inf
        name = entry.row
        for k in range(j):
            # What the beam has come down to before, on a wall that has begun and not ended.
            along = row[k]
            if (
                along.exits == BEGINS
                and along.height > top
                and _ends_after(row, j, along.row)
                and compare_height(slope, z, along.height, beam, wall) <= 0
            ):
                top = along.height
                name = along.row
        if top > -np.inf:
            found = _limited((top - z) / slope, r, layers, range_max)
        elif compare_height(slope, z, 0.0, beam, wall) >= 0:
            found = _within(length_of(beam, wall), r, beam, wall, layers, range_max)
        else:
            break
        return found, max(name, -1) if math.isfinite(found) else -1
    return ground, -1


@inner
def _ends_after(row: Records, first: int, name: int) -> bool:
    """Whether a wall along the beam ends at one of the entries from the first on."""
    for k in range(first, len(row)):
        if row[k].exits == EXITS and row[k].row == name:
            return True
    return False
