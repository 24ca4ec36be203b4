"""Doors that are too narrow: what a route does not reach, and why."""

from itertools import pairwise

import numpy as np

from lrf3d.geometry import Float
from lrf3d.planning.distances import connected, samples
from lrf3d.planning.free_space import FreeSpace, find_free_space
from lrf3d.planning.tour import path_to

THINNEST = 0.12
"""Radius [m] of the robot for which rooms are looked for."""

ROOM_AREA, ROOM_GAP = 1.0, 0.7
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

    Args:
        space: The space that is reached.
        radius: Radius of the robot [m].
        least: Distance to walls [m] that it needs.
    """
    from scipy.sparse.csgraph import dijkstra

    ground, grid = space.ground, space.ground.grid
    origin = ground.world.origin
    small = find_free_space(
        ground, THINNEST, where=None if ground.world.free is not None else space.side,
        start=space.places[0] + origin,
    )  # fmt: skip
    rooms, count = connected(small.allowed & (grid.gaps >= least) & ~space.allowed)
    reached = np.flatnonzero(space.allowed[grid.cells(small.places)])
    steps = small.graph.tocoo()
    # So steep a cost makes the widest way the cheapest.
    steps.data = np.minimum(small.gaps[steps.row], small.gaps[steps.col]) ** -8.0
    costs, before, _ = dijkstra(
        steps.tocsr(), indices=reached, min_only=True, return_predecessors=True
    )
    room_of = rooms[grid.cells(small.places)]
    doors: dict[tuple[float, float], float] = {}
    missed = 0
    for room in range(1, count + 1):
        inside = np.flatnonzero(room_of == room)
        is_room = (rooms == room).sum() * grid.size**2 >= ROOM_AREA
        if not (is_room and len(inside) and small.gaps[inside].max() >= ROOM_GAP):
            continue
        path = path_to(before, int(inside[np.argmin(costs[inside])]))
        missed += 1
        at, width = _narrowest(space, small.places[path])
        known = [one for one in doors if np.hypot(one[0] - at[0], one[1] - at[1]) < POSTS]
        if not known:
            doors[float(at[0]), float(at[1])] = width
    if not missed:
        return []
    named = [
        f"{width:.2f} m at ({x + origin[0]:.1f}, {y + origin[1]:.1f})"
        for (x, y), width in sorted(doors.items(), key=lambda door: -door[1])
    ]
    more = f" and {len(named) - MOST_NAMED} more" if len(named) > MOST_NAMED else ""
    what = "door of" if len(named) == 1 else "doors of"
    verb = "is" if len(named) == 1 else "are"
    fit = [one for one in USUAL_RADII if one < radius]
    margin = 2.0 * (least - radius) + 2.0 * grid.size
    through_all = [one for one in fit if 2.0 * one + margin <= min(doors.values())]
    through_one = [one for one in fit if 2.0 * one + margin <= max(doors.values())]
    remedy = "".join(f"; --set robot.radius={one:g}" for one in (through_all or through_one)[:1])
    rooms_missed = "1 room is" if missed == 1 else f"{missed} rooms are"
    return [
        f"{what} {', '.join(named[:MOST_NAMED])}{more} {verb} too narrow for a robot of"
        f" {2.0 * radius:.2f} m; {rooms_missed} not reached{remedy}"
    ]


def _narrowest(space: FreeSpace, path: Float) -> tuple[Float, float]:
    """The middle (2,) of the narrowest place along a path (k, 2), and its width [m]."""
    ground, grid = space.ground, space.ground.grid
    points = np.vstack([np.linspace(*ends, 7) for ends in pairwise(path)])
    at = int(np.argmin(grid.gaps[grid.cells(points)]))
    middle = points[at]
    ahead = points[min(at + 12, len(points) - 1)] - points[max(at - 12, 0)]
    around = np.stack(np.meshgrid(*2 * [np.arange(-POSTS, POSTS, grid.size)]), axis=-1)
    walls = ground.segments[np.unique(grid.nearest[grid.cells(middle + around)])]
    posts, _ = samples(walls, 0.02)
    posts = posts[np.hypot(*(posts - middle).T) < POSTS]
    offset = posts - middle
    left = ahead[0] * offset[:, 1] - ahead[1] * offset[:, 0] > 0.0
    if left.all() or not left.any():
        return middle, 2.0 * float(grid.gaps[grid.cells(middle)])
    from scipy.spatial import cKDTree

    away, other = (np.asarray(each) for each in cKDTree(posts[left]).query(posts[~left]))
    nearest = int(np.argmin(away))
    return 0.5 * (posts[~left][nearest] + posts[left][other[nearest]]), float(away[nearest])
