"""Doors that are too narrow: what a route does not reach, and why."""

from itertools import pairwise

import numpy as np

from lrf3d.geometry import Float
from lrf3d.planning.distances import connected, samples
from lrf3d.planning.free_space import FreeSpace, find_free_space
from lrf3d.planning.tour import path_to

THINNEST = 0.12
"""Radius [m] of the robot for which rooms are looked for."""

AREA, GAP = 1.0, 0.7
"""Least area [m²] in which a robot's middle can be, and distance to walls [m] somewhere in it, of
a room; a nook behind a desk is none."""

POSTS = 1.5
"""Distance [m] from a narrow place within which the posts of its door are looked for."""

USUAL_RADII = (0.35, 0.28, 0.22, 0.18, 0.15, 0.12)
"""Radii of common robots [m], of which one is proposed."""

MOST_NAMED = 3
"""Largest number of doors that are named."""


def closed_doors(space: FreeSpace, radius: float, least: float) -> list[str]:
    """One line that names the doors behind which rooms are not reached, or none.

    The robot of a radius [m] reached a space, in which it needs a least distance to walls [m].
    """
    from scipy.sparse.csgraph import dijkstra

    ground, grid, origin = space.ground, space.ground.grid, space.ground.world.origin
    where = space.side if ground.world.free is None else None
    small = find_free_space(ground, THINNEST, where=where, start=space.places[0] + origin)
    rooms, count = connected(small.allowed & (grid.gaps >= least) & ~space.allowed)
    room_of = rooms[grid.cells(small.places)]
    gaps = np.zeros(count + 1)
    np.maximum.at(gaps, room_of, small.gaps)
    areas = np.bincount(rooms.reshape(-1)) * grid.size**2
    missed = [room for room in range(1, count + 1) if areas[room] >= AREA and gaps[room] >= GAP]
    if not missed:
        return []
    steps = small.graph.tocoo()
    # So steep a cost makes the widest way the cheapest.
    steps.data = np.minimum(small.gaps[steps.row], small.gaps[steps.col]) ** -8.0
    reached = np.flatnonzero(space.allowed[grid.cells(small.places)])
    costs, before, _ = dijkstra(
        steps.tocsr(), indices=reached, min_only=True, return_predecessors=True
    )
    doors: list[tuple[float, Float]] = []
    for room in missed:
        inside = np.flatnonzero(room_of == room)
        path = path_to(before, int(inside[np.argmin(costs[inside])]))
        width, middle = _narrowest(space, small.places[path])
        if all(np.hypot(*(middle - other)) > POSTS for _, other in doors):
            doors.append((width, middle))
    doors.sort(key=lambda door: -door[0])
    named = [f"{width:.2f} m at ({x:.1f}, {y:.1f})" for width, (x, y) in doors[:MOST_NAMED]]
    more = f" and {len(doors) - MOST_NAMED} more" if len(doors) > MOST_NAMED else ""
    # A cell to either side lies between the robot and a post.
    margin = 2.0 * (least - radius + grid.size)
    fit = [
        f"; --set robot.radius={usual:g}"
        for width in (doors[-1][0], doors[0][0])
        for usual in USUAL_RADII
        if usual < radius and 2.0 * usual + margin <= width
    ]
    what, verb = ("door", "is") if len(doors) == 1 else ("doors", "are")
    rooms_missed = "1 room is" if len(missed) == 1 else f"{len(missed)} rooms are"
    return [
        f"{what} of {', '.join(named)}{more} {verb} too narrow for a robot of"
        f" {2.0 * radius:.2f} m; {rooms_missed} not reached{''.join(fit[:1])}"
    ]


def _narrowest(space: FreeSpace, path: Float) -> tuple[float, Float]:
    """Width [m] and middle (2,) of the narrowest place along a path (k, 2) of the local frame."""
    from scipy.spatial import cKDTree

    ground, grid = space.ground, space.ground.grid
    points = np.vstack([np.linspace(*ends, 7) for ends in pairwise(path)])
    at = int(np.argmin(grid.gaps[grid.cells(points)]))
    middle = points[at]
    ahead = points[min(at + 12, len(points) - 1)] - points[max(at - 12, 0)]
    around = np.stack(np.meshgrid(*2 * [np.arange(-POSTS, POSTS, grid.size)]), axis=-1)
    walls = ground.segments[np.unique(grid.nearest[grid.cells(middle + around)])]
    posts = samples(walls, 0.02)[0] - middle
    posts = posts[np.hypot(*posts.T) < POSTS]
    left = ahead[0] * posts[:, 1] - ahead[1] * posts[:, 0] > 0.0
    if left.all() or not left.any():
        return 2.0 * float(grid.gaps[grid.cells(middle)]), middle + ground.world.origin
    apart, other = (np.asarray(each) for each in cKDTree(posts[left]).query(posts[~left]))
    pair = int(np.argmin(apart))
    between = 0.5 * (posts[~left][pair] + posts[left][other[pair]])
    return float(apart[pair]), middle + between + ground.world.origin
