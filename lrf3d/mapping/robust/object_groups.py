"""ObjectGroups: which segments of a growing map are of one object, and their closed corners.

Enter the segments that an update changed; leave objects that are worked out anew only near to
them. What the beams have shown of a link between two walls is asked once.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from lrf3d.geometry import Int
from lrf3d.laser import RangeNoise
from lrf3d.mapping.robust.constants import LONGEST_LINK
from lrf3d.mapping.robust.corners import close_corners
from lrf3d.mapping.robust.evidence_grid import Cells
from lrf3d.mapping.robust.object_association import LinkCache, associate_objects
from lrf3d.mapping.robust.segment_pool import LEAST_ROWS, SegmentPool
from lrf3d.mapping.robust.walls import longer

LEAST_LINKS = 1 << 14
"""Links that a new cache has room for."""


class ObjectGroups:
    """The object of each segment of a pool.

    Attributes:
        closed: (rows, 4) the segments with closed corners [m].
        labels: (rows,) the object of each.
    """

    def __init__(self) -> None:
        self.closed = np.zeros((LEAST_ROWS, 4))
        self.labels = np.full(LEAST_ROWS, -1)
        self._members: dict[int, list[int]] = {}
        self._cache = LinkCache.of_size(LEAST_LINKS)

    def update(
        self,
        pool: SegmentPool,
        gone: Int,
        fresh: Int,
        moved: Iterable[int],
        cells: Cells,
        noise: RangeNoise,
    ) -> None:
        """Follow a change of the pool.

        Args:
            pool: The segments.
            gone: The rows whose segments are gone.
            fresh: The rows with new segments.
            moved: The rows whose segments have changed a little, some of the new ones too.
            cells: What the beams have shown.
            noise: The noise of the ranges.
        """
        while len(self.labels) < len(pool.parents):
            self.closed, self.labels = longer(self.closed), longer(self.labels)
        touched = set(self.labels[gone].tolist())
        self.labels[fresh] = -1
        rows = set(fresh.tolist())
        for row in fresh.tolist():
            near = pool.near(pool.walls.ends[row], LONGEST_LINK)
            touched.update(self.labels[near[pool.walls.points[near] > 0]].tolist())
        touched.discard(-1)
        for label in touched:
            rows.update(self._members.pop(label))
        if rows:
            self._regroup(pool, rows, cells, noise)
        for label in {int(self.labels[row]) for row in moved}:
            members = np.array(self._members[label], np.int64)
            ends = pool.walls.ends[members]
            close_corners(ends, self.labels[members])
            self.closed[members] = ends

    def _regroup(self, pool: SegmentPool, rows: set[int], cells: Cells, noise: RangeNoise) -> None:
        """Find the objects of some rows, which belong to no others."""
        alive = np.array(sorted(rows), np.int64)
        alive = alive[pool.walls.points[alive] > 0]
        ends = pool.walls.ends[alive]
        self._tidy(pool)
        objects = associate_objects(ends, pool.serials[alive], cells, noise, self._cache)
        close_corners(ends, objects)
        self.closed[alive] = ends
        self.labels[alive] = alive[objects]
        for row, label in zip(alive.tolist(), alive[objects].tolist(), strict=True):
            self._members.setdefault(label, []).append(row)

    def _tidy(self, pool: SegmentPool) -> None:
        """Begin a new cache where this one is full: most of its links are of segments long gone."""
        size = len(self._cache.keys)
        if 2 * self._cache.used[0] >= size:
            while size < 64 * len(pool.rows()):
                size *= 2
            self._cache = LinkCache.of_size(size)

    def state(self) -> dict[str, Any]:
        """All that is known, as plain arrays by their names; `restore` takes them back."""
        return {
            "group_closed": self.closed.copy(),
            "group_labels": self.labels.copy(),
            **{f"link_{name}": column.copy() for name, column in self._cache._asdict().items()},
        }

    def restore(self, state: Mapping[str, Any], pool: SegmentPool) -> None:
        """Go on from what was known."""
        self.closed, self.labels = state["group_closed"].copy(), state["group_labels"].copy()
        self._cache = LinkCache(*(state[f"link_{name}"].copy() for name in LinkCache._fields))
        self._members = {}
        for row in pool.rows().tolist():
            self._members.setdefault(int(self.labels[row]), []).append(row)
