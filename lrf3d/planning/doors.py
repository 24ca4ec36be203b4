"""Rooms that a route does not reach, and why: doors that are too narrow, or none."""

import numpy as np

from lrf3d.geometry import Float
from lrf3d.planning.free_space import MARGIN, THINNEST, FreeSpace, connected, find_free_space
from lrf3d.planning.rooms import separate_rooms
from lrf3d.planning.tour import path_to
from lrf3d.robot.unicycle import RADIUS

POSTS = 1.5
"""Distance [m] from a narrow place within which the posts of its door are looked for."""

USUAL_RADII = (RADIUS, 0.28, 0.22, 0.18, 0.15, THINNEST)
"""Radii of common robots [m], of which one is tried or proposed."""


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
    if not len(rooms):
        return []
    areas = np.bincount(parts.ravel())[rooms] * ground.size**2
    named = []
    for room in rooms[np.argsort(-areas)][:3]:
        inside = np.flatnonzero(parts == room)
        widest = inside[np.argmax(ground.gaps.ravel()[inside])]
        x, y = ground.places.reshape(-1, 2)[widest] + ground.world.origin
        named.append(f"{len(inside) * ground.size**2:.1f} m² at ({x:.1f}, {y:.1f})")
    more = f" and {len(rooms) - 3} more" if len(rooms) > 3 else ""
    what = "1 room is" if len(rooms) == 1 else f"{len(rooms)} rooms are"
    why = "no door leads there, or one that is drawn shut; `lrf3d world show` draws what was read"
    return [f"{what} not reached, {', '.join(named)}{more}: {why}"]


def _narrow_doors(space: FreeSpace, small: FreeSpace) -> list[str]:
    """A line that names the doors behind which rooms are not reached, or none.

    Only what is narrower than the robot needs is a reason; what is closed is no door.
    """
    from scipy.ndimage import maximum
    from scipy.sparse.csgraph import dijkstra

    ground, radius = space.ground, space.radius
    if small is space:
        return []
    # The land around the walls of a map is no room.
    other = small.allowed & ~space.allowed & ~ground.swept
    parts, count = connected(other & (ground.gaps >= radius + MARGIN))
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
    doors.sort(key=lambda door: -door[0])
    named = [f"{width:.2f} m at ({x:.1f}, {y:.1f})" for width, (x, y) in doors[:3]]
    more = f" and {len(doors) - 3} more" if len(doors) > 3 else ""
    fit = [
        f"; --set robot.radius={usual:g}"
        for width in (doors[-1][0], doors[0][0])
        for usual in USUAL_RADII
        if usual < radius and 2.0 * (usual + MARGIN) + ground.size <= width
    ]
    what, verb = ("door", "is") if len(doors) == 1 else ("doors", "are")
    narrow = f"{', '.join(named)}{more} {verb} too narrow for a robot of {2.0 * radius:.2f} m"
    missing = "1 room is" if rooms == 1 else f"{rooms} rooms are"
    return [f"{what} of {narrow}; {missing} not reached{''.join(fit[:1])}"]


def _door(space: FreeSpace, place: Float) -> tuple[float, Float]:
    """Width [m] and middle (2,) of a door at a place (2,) of the local frame."""
    ground = space.ground
    posts = ground.pieces[ground.tree.query_ball_point(place, POSTS)] - place
    one = posts[np.argmin(np.hypot(*posts.T))]
    others = posts[posts @ one < 0.0]
    # Alone, a post is as far from what is beyond reach as the robot is from it.
    other = others[np.argmin(np.hypot(*(others - one).T))] if len(others) else -one
    return float(np.hypot(*(other - one))), place + 0.5 * (one + other) + ground.world.origin
