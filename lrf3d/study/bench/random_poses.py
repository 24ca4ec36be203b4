"""Random poses in the open: where a laser may stand that no drive leads to."""

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Float
from lrf3d.robot.sides import inside_buildings
from lrf3d.world import World

CLEARANCE = 1.0
"""Least distance of a pose to any wall [m]."""

TRIES = 1000
"""Rounds of drawing after which a world is taken to have no room."""


def random_poses(world: World, count: int, rng: np.random.Generator) -> Float:
    """Poses (count, 3), evenly spread over the bounds of a world, in no building and off all walls.

    Raises:
        InputError: There is no such room in the world.
    """
    import shapely

    local = world.segments - np.tile(world.origin, 2)
    ends = local.reshape(-1, 2)
    low, high = ends.min(axis=0), ends.max(axis=0)
    tree = shapely.STRtree(shapely.linestrings(local.reshape(-1, 2, 2)))
    found: list[Float] = []
    for _ in range(TRIES):
        places = rng.uniform(low, high, (count, 2))
        close, _ = tree.query(shapely.points(places), predicate="dwithin", distance=CLEARANCE)
        free = ~inside_buildings(world, places)
        free[close] = False
        found.extend(places[free])
        if len(found) >= count:
            heading = rng.uniform(-np.pi, np.pi, count)
            return np.column_stack([np.array(found[:count]) + world.origin, heading])
    raise InputError(f"{world.name or 'world'}: no room {CLEARANCE:g} m off all walls")
