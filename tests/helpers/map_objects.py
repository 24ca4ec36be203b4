"""The objects of walls, by what beams show of them."""

import numpy as np

from lrf3d.laser import RangeNoise
from lrf3d.mapping.robust.object_groups import ObjectGroups
from lrf3d.mapping.robust.segment_pool import Change, NewSegments, SegmentPool


def objects_of(walls, cells):
    """The object (n,) of each of some walls (n, 4)."""
    walls = np.array(walls, dtype=np.float64)
    count = len(walls)
    pool, groups = SegmentPool(), ObjectGroups()
    points = np.full(count, 9)
    new = NewSegments(walls, np.ones((count, 6)), points, np.arange(count))
    rows = pool.add(new, count)
    change = Change(rows[:0], rows, rows[:0], rows[:0])
    groups.update(pool, change, cells, RangeNoise(0.01, 0.0))
    return groups.labels[rows]
