"""Walls that touch: no beam can separate them, so they count as one object."""

import numpy as np

from lrf3d.geometry import Float, Int
from lrf3d.world.model import World

TOUCHING = 0.001
"""Largest gap [m] between walls that touch."""


def connected(segments: Float, gap: float = TOUCHING) -> Int:
    """The object (n,) of each of the segments (n, 4): those that touch are one object.

    Args:
        segments: The walls.
        gap: Largest gap between walls that touch [m].
    """
    import shapely

    middle = segments.reshape(-1, 2).mean(axis=0)
    lines = shapely.linestrings(segments.reshape(-1, 2, 2) - middle)
    one, other = shapely.STRtree(lines).query(lines, predicate="dwithin", distance=gap)
    return groups(one, other, len(segments))


def groups(one: Int, other: Int, count: int) -> Int:
    """The group (count,) of each of some things, of which pairs (k,), (k,) belong together."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    links = coo_array((np.ones(len(one)), (one, other)), shape=(count, count))
    _, label = connected_components(links, directed=False)
    return np.asarray(label, dtype=np.int64)


def joined_objects(world: World) -> Int:
    """The object (n,) of each wall where objects that touch count as one, by their lowest number.

    Maps are scored and labelled by these: no beam can separate the rooms of a house.
    """
    if not len(world.segments):
        return world.objects
    # Objects and groups of touching walls are the nodes of a graph; each wall is an edge.
    group = connected(world.segments) + world.object_count
    nodes = int(group.max()) + 1
    label = groups(world.objects, group, nodes)
    lowest = np.full(nodes, nodes)
    np.minimum.at(lowest, label[world.objects], world.objects)
    return np.asarray(lowest[label[world.objects]], dtype=np.int64)
