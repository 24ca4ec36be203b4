"""Rooms: parts of the ground that a route does not reach, and why; what a drive shows of walls.

What counts is what faces the drive's side of the walls: not the outside of a house that it goes
through, nor what lies within walls, but rooms that it does not reach.
"""

import numpy as np
from scipy.ndimage import binary_dilation, maximum
from scipy.sparse.csgraph import dijkstra

from lrf3d.geometry import Bool, Float, Int, directions
from lrf3d.planning.free_space import (
    MARGIN,
    THINNEST,
    FreeSpace,
    Ground,
    find_free_space,
)
from lrf3d.planning.tour import path_to
from lrf3d.robot.kinematics import RADIUS
from lrf3d.world import World
from lrf3d.world.grid_walls import parts_of

LEAST_ROOM, LEAST_WIDTH = 4.0, 1.8
"""Least area [m²] and width [m] of a closed part that is a room; less is a shaft or furniture."""

POSTS = 1.5
"""Distance [m] from a narrow place within which the posts of its door are looked for."""

USUAL_RADII = (RADIUS, 0.28, 0.22, 0.18, 0.15, THINNEST)
"""Radii of common robots [m], of which one is tried or proposed."""

ENTRANCE = 1.4
"""Width [m] of an opening to the outside above which what lies behind is a niche, and no room."""


def separate_rooms(ground: Ground, inside: Bool, reached: Bool) -> tuple[Int, Int]:
    """The connected parts of some cells (columns, rows), from 1, and the unreached rooms of these.

    What is closed in by walls of less than half the usual height is furniture.
    """
    # Neighbouring places that are farther than this from walls have none between them.
    least = max(THINNEST + MARGIN, 1.25 * ground.size)
    parts, count = parts_of(inside & (ground.gaps >= least))
    number, heights = np.arange(count + 1), ground.world.heights
    areas = np.bincount(parts.ravel(), minlength=count + 1) * ground.size**2
    rooms = (areas >= LEAST_ROOM) & ~np.isin(number, parts[reached]) & (number > 0)
    rooms &= maximum(ground.gaps, parts, number) >= 0.5 * LEAST_WIDTH
    entrance = binary_dilation(ground.swept, np.ones((3, 3), dtype=np.bool_))
    rooms &= maximum(np.where(entrance, ground.gaps, 0.0), parts, number) < 0.5 * ENTRANCE
    highest = maximum(heights[ground.walls[ground.nearest]], parts, number)
    return parts, np.flatnonzero(rooms & (highest >= 0.5 * np.median(heights)))


def unreached_rooms(space: FreeSpace) -> list[str]:
    """Lines that name the rooms which a drive inside does not reach: at most two."""
    ground, small = space.ground, space
    where = space.side if ground.world.free is None else None
    if space.radius > THINNEST:
        start = space.places[0] + ground.world.origin
        small = find_free_space(ground, THINNEST, where=where, start=start)
    return _narrow_doors(space, small) + (_without_door(small) if where else [])


def _without_door(small: FreeSpace) -> list[str]:
    """A line that names the rooms into which not even a small robot gets, or none."""
    ground = small.ground
    parts, rooms = separate_rooms(ground, ground.on_side("inside", None), small.allowed)
    named = []
    for room in rooms:
        inside = np.flatnonzero(parts == room)
        widest = inside[np.argmax(ground.gaps.ravel()[inside])]
        x, y = ground.places.reshape(-1, 2)[widest] + ground.world.origin
        named.append((len(inside) * ground.size**2, f"m² at ({x:.1f}, {y:.1f})"))
    why = "no door leads there, or one that is drawn shut; `lrf3d world show` draws what was read"
    return [f"{_missed(len(rooms))}, {_largest(named, 1)}: {why}"] if named else []


def _missed(count: int) -> str:
    return f"{count} rooms are not reached" if count > 1 else "1 room is not reached"


def _largest(named: list[tuple[float, str]], digits: int) -> str:
    """The largest three of some values with their words, and how many more there are."""
    best = sorted(named, key=lambda each: -each[0])[:3]
    more = f" and {len(named) - 3} more" if len(named) > 3 else ""
    return ", ".join(f"{value:.{digits}f} {words}" for value, words in best) + more


def _narrow_doors(space: FreeSpace, small: FreeSpace) -> list[str]:
    """A line that names the doors behind which rooms are not reached, or none.

    Only what is narrower than the robot needs is a reason; what is closed is no door.
    """
    ground, radius = space.ground, space.radius
    if small is space:
        return []
    # The land around the walls of a map is no room.
    other = small.allowed & ~space.allowed & ~ground.swept
    parts, count = parts_of(other & (ground.gaps >= radius + MARGIN))
    areas = np.bincount(parts.ravel()) * ground.size**2
    gaps = maximum(ground.gaps, parts, np.arange(count + 1))
    # A robot's middle can be in at least a square metre of a room: a nook behind a desk is none.
    missed = np.flatnonzero((areas >= 1.0) & (gaps >= 0.7) & (np.arange(count + 1) > 0))
    if not len(missed):
        return []
    steps = small.graph.tocoo()
    # So steep a cost makes the widest path the cheapest.
    steps.data = np.minimum(small.gaps[steps.row], small.gaps[steps.col]) ** -8.0
    reached = np.flatnonzero(space.allowed[small.allowed])
    costs, before, _ = dijkstra(
        steps.tocsr(), indices=reached, min_only=True, return_predecessors=True
    )
    doors, rooms = list[tuple[float, Float]](), 0
    for room in missed:
        inside = np.flatnonzero(parts[small.allowed] == room)
        path = path_to(before, int(inside[np.argmin(costs[inside])]))
        width, middle = _door(space, small.places[path[np.argmin(small.gaps[path])]])
        # A cell lies between the robot and each of the posts.
        if width < 2.0 * (radius + MARGIN + ground.size):
            rooms += 1
            if all(np.hypot(*(middle - other)) > POSTS for _, other in doors):
                doors.append((width, middle))
    if not doors:
        return []
    named = _largest([(width, f"m at ({x:.1f}, {y:.1f})") for width, (x, y) in doors], 2)
    widths = [width for width, _ in doors]
    fit = [
        f"; --set robot.radius={usual:g}"
        for width in (min(widths), max(widths))
        for usual in USUAL_RADII
        if usual < radius and 2.0 * (usual + MARGIN) + ground.size <= width
    ]
    what, verb = ("door", "is") if len(doors) == 1 else ("doors", "are")
    narrow = f"{named} {verb} too narrow for a robot of {2.0 * radius:.2f} m"
    return [f"{what} of {narrow}; {_missed(rooms)}{''.join(fit[:1])}"]


def _door(space: FreeSpace, place: Float) -> tuple[float, Float]:
    """Width [m] and middle (2,) of a door at a place (2,) of the local frame."""
    ground = space.ground
    posts = ground.pieces[ground.tree.query_ball_point(place, POSTS)] - place
    one = posts[np.argmin(np.hypot(*posts.T))]
    others = posts[posts @ one < 0.0]
    # Alone, a post is as far from what is beyond reach as the robot is from it.
    other = others[np.argmin(np.hypot(*(others - one).T))] if len(others) else -one
    return float(np.hypot(*(other - one))), place + 0.5 * (one + other) + ground.world.origin


def shown_share(world: World, positions: Float, shown: Float, walls: Int) -> float | None:
    """The share of the walls on the drive's side of which the shown parts (k, 4) consist.

    The drive is at positions (m, 2) [m], the parts are of walls (k,). It is None if no wall faces
    the drive.
    """
    if not len(world.segments):
        return None
    ground = Ground(world, positions[0])
    reached = ground.cells_at(positions)
    outside = bool(ground.swept[reached].mean() > 0.5)
    side: Bool = ground.gaps > 0.0
    if world.free is None:
        side = ground.on_side("outside" if outside else "inside", None)
    parts, rooms = separate_rooms(ground, side, reached)
    if not outside:
        side = np.isin(parts, [*rooms, *np.unique(parts[reached])]) & (parts > 0)
    along = np.unique(ground.nearest[side])
    ends = np.full((len(world.segments), 2), np.nan)
    base, unit = world.segments[:, :2] - world.origin, directions(world.segments)
    for column in (0, 1):
        corner = shown[:, 2 * column : 2 * column + 2] - world.origin - base[walls]
        ends[walls, column] = (corner * unit[walls]).sum(axis=1)
    wall = ground.walls[along]
    station = ((ground.pieces[along] - base[wall]) * unit[wall]).sum(axis=1)
    seen = (station > ends[wall, 0] - 1e-3) & (station < ends[wall, 1] + 1e-3)
    return float(seen.mean()) if len(along) else None
