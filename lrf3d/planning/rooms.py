"""Rooms: those that a route does not enter, and why; the share of the walls that a drive shows.

Walls count on the side of the drive: not the outside of a house that it goes through, nor what lies
within walls, but also rooms that it does not enter.
"""

import numpy as np
import scipy

from lrf3d.base.text import Note, counted
from lrf3d.geometry.lines import Bool, Float, Int, directions
from lrf3d.planning.free_space import MARGIN, THINNEST, FreeSpace, Ground, largest
from lrf3d.robot.kinematics import RADIUS
from lrf3d.world import World
from lrf3d.world.pieces import groups

# Radii of common robots [m], of which one is tried or proposed.
USUAL_RADII = (RADIUS, 0.28, 0.22, 0.18, 0.15, THINNEST)

# Share of the width of two spaces above which what is between them is no doorway.
EVEN = 0.8

# Distance from walls [m] that is exceeded in a room, but not in an opening to the outside: a space
# with a wider opening is a niche.
ROOMY = 0.7


def true_rooms(ground: Ground, inside: Bool) -> Int:
    """The numbers of the rooms among some cells (columns, rows), without niches and furniture.

    A space without a door to most of the others may be a shaft, so it must be larger to count.
    """
    rooms = np.where(inside, ground.rooms, 0)
    area = np.bincount(rooms.ravel()) * ground.size**2
    # The other cells are no room.
    area[0] = 0.0
    pairs = ground.doorways[0]
    one, other = pairs[np.isin(pairs, rooms).all(axis=1)].T
    reach = groups(one, other, len(area))
    closed = reach != np.argmax(np.bincount(reach, area))
    found = area >= np.where(closed, 4.0, 2.0)
    found &= largest(ground.gaps, rooms, len(area)) >= np.where(closed, 0.9, ROOMY)
    entrance = scipy.ndimage.binary_dilation(ground.swept, np.ones((3, 3), dtype=np.bool_))
    found &= largest(np.where(entrance, ground.gaps, 0.0), rooms, len(area)) < ROOMY
    # A space within walls of less than half the usual height is furniture.
    heights = ground.world.heights
    highest = largest(heights[ground.walls[ground.nearest]], rooms, len(area))
    return np.flatnonzero(found & (highest >= 0.5 * np.median(heights)))


def rooms_of(world: World) -> list[tuple[float, Float]]:
    """The areas [m²] of the rooms of a world, the largest first, and places (2,) [m] in them."""
    bare, rooms, numbers = bare_rooms(world)
    found = [measured(bare, rooms == room) for room in numbers]
    return sorted(found, key=lambda each: -each[0])


def bare_rooms(world: World) -> tuple[Ground, Int, Int]:
    """A ground without furniture, the space of each of its cells, and the spaces that are rooms."""
    bare = Ground(_unfurnished(world))
    return bare, *_numbered(bare)


def entered_rooms(space: FreeSpace, bare: Ground, rooms: Int) -> Int:
    """The numbers of the spaces of the cells of a bare ground that a free space extends into."""
    cells = bare.cells_at(space.places + space.ground.world.origin) & bare.wide
    return np.setdiff1d(rooms[cells], [0])


def _unfurnished(world: World) -> World:
    """Remove the furniture of a world: robots drive around it, but it does not divide rooms."""
    tall = world.heights >= 0.5 * world.heights.max(initial=0.0)
    if tall.all():
        return world
    return World(world.segments[tall], heights=world.heights[tall], free=world.free)


def _numbered(ground: Ground) -> tuple[Int, Int]:
    """The space (columns, rows) that each cell inside belongs to, and the numbers of the rooms.

    The pieces of a corridor, which is hardly narrower between them, are one space.
    """
    inside = ground.on_side("inside", None)
    rooms = np.where(inside, ground.rooms, 0)
    widest = largest(ground.gaps, rooms, int(ground.rooms.max()) + 1)
    pairs, cell = ground.doorways
    even = ground.gaps.ravel()[cell] > EVEN * widest[pairs].max(axis=1)
    one, other = pairs[even & np.isin(pairs, rooms).all(axis=1)].T
    joined = groups(one, other, len(widest))
    joined[0] = 0
    return joined[rooms], np.unique(joined[true_rooms(ground, inside)])


def measured(ground: Ground, cells: Bool) -> tuple[float, Float]:
    """The area [m²] of some cells, up to the faces of the walls around them, and a place in it.

    The place (2,) [m] is the one farthest from walls.
    """
    place = ground.places[cells][np.argmax(ground.gaps[cells])] + ground.world.origin
    # The strip along walls whose cells are not passable is about one cell wide.
    rim = cells & ~scipy.ndimage.binary_erosion(cells)
    return float(cells.sum() + rim.sum()) * ground.size**2, place


def missed_rooms(space: FreeSpace, legs: list[Int]) -> tuple[list[Note], list[Note]]:
    """Notes on the rooms that no way reaches, and on those that the legs of a drive do not enter.

    They name the rooms, by the reason.
    """
    if space.side == "outside":
        return [], []
    ground = space.ground
    entered = np.zeros(space.allowed.shape, dtype=np.bool_)
    entered[tuple(np.argwhere(space.allowed)[np.concatenate(legs)].T)] = True
    points = ground.places[entered] + ground.world.origin
    walls = _unfurnished(ground.world)
    bare = ground if walls is ground.world else Ground(walls, points[0])
    rooms, numbers = _numbered(bare)
    missed = np.setdiff1d(numbers, rooms[bare.cells_at(points) & bare.wide])
    if not len(missed):
        return [], []
    # In corners of the outside there are cells of the inside, which no way leads to.
    cells = ground.rooms.ravel()
    outside = np.bincount(cells, ground.swept.ravel()) > 0.5 * np.bincount(cells)
    own = np.where(ground.on_side("inside", None) & ~outside[ground.rooms], ground.rooms, 0)
    ways = _widest_ways(ground, own, space.allowed)
    narrow = list[int]()
    far = list[tuple[float, str]]()
    shut = list[tuple[float, str]]()
    for room in missed.tolist():
        area, (x, y) = measured(bare, rooms == room)
        named = area, f"m² at ({x:.1f}, {y:.1f})"
        # The widest place that furniture leaves in the room.
        within = ground.cells_at(bare.places[rooms == room] + bare.world.origin) & (own > 0)
        left = np.where(within, ground.gaps, 0.0)
        via = int(ways[own.flat[np.argmax(left)]]) if within.any() else SHUT
        if via == REACHED:
            far.append(named)
        elif via == SHUT or ground.gaps.flat[via] >= space.radius + MARGIN:
            # Where all doors are wide enough, something stands between two of them.
            shut.append(named)
        else:
            narrow.append(via)
    return _notes(space, narrow, shut, far, len(numbers))


def _notes(
    space: FreeSpace,
    narrow: list[int],
    shut: list[tuple[float, str]],
    far: list[tuple[float, str]],
    rooms: int,
) -> tuple[list[Note], list[Note]]:
    """What to say of rooms behind narrow cells or shut ones, and of those that are too far."""
    notes = []
    if narrow:
        doors = _doors(space.ground, narrow)
        sizes = _largest([(width, f"m at ({x:.1f}, {y:.1f})") for width, (x, y) in doors], 2)
        widths = [width for width, _ in doors]
        fit = [
            f"--set robot.radius={usual:g}"
            for width in (min(widths), max(widths))
            for usual in USUAL_RADII
            if usual < space.radius and 2.0 * (usual + MARGIN) + space.ground.size <= width
        ]
        what, verb = ("door", "is") if len(doors) == 1 else ("doors", "are")
        wide = f"too narrow for a robot of {2.0 * space.radius:.2f} m"
        found = f"{what} of {sizes} {verb} {wide}; {_count(len(narrow), rooms)} not reached"
        notes.append(Note(found, "".join(fit[:1])))
    if shut:
        why = "no door leads there from inside, or it is drawn shut, or blocked"
        found = f"{_count(len(shut), rooms)} not reached, {_largest(shut, 1)}: {why}"
        notes.append(Note(found, "`lrf3d edit` shows it, and opens doors"))
    if not far:
        return notes, []
    why = "the route would be too long, or shows little more"
    return notes, [Note(f"{_count(len(far), rooms)} not entered, {_largest(far, 1)}: {why}")]


# Marker of a room whose path has no narrow place.
REACHED = -1

# Marker of a room without a path.
SHUT = -2

# Distance [m] from a narrow place within which the posts of its door are looked for.
POSTS = 1.5


def _widest_ways(ground: Ground, rooms: Int, reached: Bool) -> Int:
    """The narrowest cell of the widest path from the reached cells to each of the rooms."""
    pairs, cell = ground.doorways
    order = np.argsort(ground.gaps, axis=None, kind="stable")
    # A room is reached where its widest place is; its nearest places may lie beyond its door.
    widest = np.zeros(int(ground.rooms.max()) + 1, dtype=np.int64)
    widest[rooms.ravel()[order]] = order
    known = reached.ravel()[widest]
    width = np.where(known, np.inf, 0.0)
    via = np.where(known, REACHED, SHUT)
    gaps = ground.gaps.ravel()[cell]
    known[0] = False
    inside = np.isin(pairs, rooms).all(axis=1)
    while (crossing := inside & (known[pairs].sum(axis=1) == 1)).any():
        wide = np.where(crossing, np.minimum(width[pairs].max(axis=1), gaps), -1.0)
        best = int(np.argmax(wide))
        old, new = pairs[best] if known[pairs[best, 0]] else pairs[best, ::-1]
        via[new] = cell[best] if gaps[best] <= width[old] else via[old]
        width[new] = wide[best]
        known[new] = True
    return via


def _count(number: int, of: int) -> str:
    return f"{number} of {counted(of, 'room')} {'is' if number == 1 else 'are'}"


def _largest(named: list[tuple[float, str]], digits: int) -> str:
    """The largest three of some values with their words, and how many more there are."""
    best = sorted(named, key=lambda each: -each[0])[:3]
    more = f" and {len(named) - 3} more" if len(named) > 3 else ""
    return ", ".join(f"{value:.{digits}f} {words}" for value, words in best) + more


def _doors(ground: Ground, cells: list[int]) -> list[tuple[float, Float]]:
    """Widths [m] and middles (2,) of the doors at some cells, each of them once."""
    doors = list[tuple[float, Float]]()
    for cell in cells:
        width, middle = _door(ground, ground.places.reshape(-1, 2)[cell])
        if all(np.hypot(*(middle - other)) > POSTS for _, other in doors):
            doors.append((width, middle))
    return doors


def _door(ground: Ground, place: Float) -> tuple[float, Float]:
    """Width [m] and middle (2,) of a door at a place (2,) of the local frame."""
    posts = ground.pieces[ground.tree.query_ball_point(place, POSTS)] - place
    one = posts[np.argmin(np.hypot(*posts.T))]
    others = posts[posts @ one < 0.0]
    # Alone, a post is as far from what is beyond reach as the robot is from it.
    other = others[np.argmin(np.hypot(*(others - one).T))] if len(others) else -one
    return float(np.hypot(*(other - one))), place + 0.5 * (one + other) + ground.world.origin


def shown_share(world: World, positions: Float, shown: Float, walls: Int) -> float | None:
    """The share of the walls on the drive's side that the shown parts (k, 4) of walls (k,) cover.

    The drive is at positions (m, 2) [m]. The share is None if no wall faces the drive.
    """
    if not len(world.segments):
        return None
    ground = Ground(world, positions[0])
    reached = ground.cells_at(positions)
    outside = bool(ground.swept[reached].mean() > 0.5)
    side: Bool = ground.gaps > 0.0
    if world.free is None:
        side = ground.on_side("outside" if outside else "inside", None)
    if not outside:
        # Walls that only the thinnest robot could see, as behind a cupboard, do not count.
        rooms = np.where(side & (ground.gaps >= THINNEST + MARGIN), ground.rooms, 0)
        pairs, cell = ground.doorways
        one, other = pairs[ground.gaps.ravel()[cell] >= THINNEST + MARGIN].T
        reach = groups(one, other, int(ground.rooms.max()) + 1)
        near = np.isin(reach[rooms], reach[rooms[reached & (rooms > 0)]])
        side = (near | np.isin(rooms, true_rooms(ground, side))) & (rooms > 0)
    along = np.unique(ground.nearest[side])
    ends = np.full((len(world.segments), 2), np.nan)
    base = world.segments[:, :2] - world.origin
    unit = directions(world.segments)
    corners = shown.reshape(-1, 2, 2) - world.origin - base[walls, None]
    ends[walls] = (corners * unit[walls, None]).sum(axis=2)
    wall = ground.walls[along]
    station = ((ground.pieces[along] - base[wall]) * unit[wall]).sum(axis=1)
    rounding = 1e-3  # Error of a station along its wall [m].
    seen = (station > ends[wall, 0] - rounding) & (station < ends[wall, 1] + rounding)
    return float(seen.mean()) if len(along) else None
