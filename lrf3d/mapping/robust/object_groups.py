"""ObjectGroups: which segments of a growing map are of one object, and their closed corners.

Enter the segments that an update changed; leave objects that are worked out anew only near to
them. What the beams have shown of a link between two walls is asked once.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from lrf3d.geometry import Int
from lrf3d.laser import RangeNoise
from lrf3d.mapping.robust.constants import LINK_DEVIATIONS, LONGEST_LINK
from lrf3d.mapping.robust.corners import close_corners
from lrf3d.mapping.robust.evidence_grid import Cells
from lrf3d.mapping.robust.links import Links, add_links, drop_links
from lrf3d.mapping.robust.object_association import Sight, associate_objects
from lrf3d.mapping.robust.segment_pool import LEAST_ROWS, SegmentPool
from lrf3d.mapping.robust.walls import longer

LEAST_LINKS = 1 << 12
"""Links that there is room for at first."""


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
        self._links = Links.of_size(LEAST_LINKS, LEAST_ROWS)

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
            heads = np.concatenate([self._links.heads, np.full_like(self._links.heads, -1)])
            self._links = self._links._replace(heads=heads)
        touched = set(self.labels[gone].tolist())
        self.labels[fresh] = -1
        for row in gone.tolist():
            drop_links(self._links, row)
        rows = set(fresh.tolist())
        linked: set[int] = set()
        for row in fresh.tolist():
            near = pool.near(pool.walls.ends[row], LONGEST_LINK)
            near = np.array([k for k in near.tolist() if k not in rows or k in linked], np.int64)
            linked.add(row)
            while not add_links(self._links, row, near, pool.walls.ends):
                drop_links(self._links, row)
                self._links = _doubled(self._links)
            touched.update(self.labels[near].tolist())
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
        deviation = float(np.sqrt(noise.variance(np.array(LONGEST_LINK))))
        sight = Sight(
            pool.walls.ends, pool.walls.points, pool.grid, cells, LINK_DEVIATIONS * deviation
        )
        objects = associate_objects(alive, self._links, sight)
        close_corners(ends, objects)
        self.closed[alive] = ends
        self.labels[alive] = alive[objects]
        for row, label in zip(alive.tolist(), alive[objects].tolist(), strict=True):
            self._members.setdefault(label, []).append(row)

    def state(self) -> dict[str, Any]:
        """All that is known, as plain arrays by their names; `restore` takes them back."""
        return {
            "group_closed": self.closed.copy(),
            "group_labels": self.labels.copy(),
            **{f"link_{name}": column.copy() for name, column in self._links._asdict().items()},
        }

    def restore(self, state: Mapping[str, Any], pool: SegmentPool) -> None:
        """Go on from what was known."""
        self.closed, self.labels = state["group_closed"].copy(), state["group_labels"].copy()
        self._links = Links(*(state[f"link_{name}"].copy() for name in Links._fields))
        self._members = {}
        for row in pool.rows().tolist():
            self._members.setdefault(int(self.labels[row]), []).append(row)


def _doubled(links: Links) -> Links:
    """The same links with room for twice as many."""
    grown = Links.of_size(2 * len(links.kinds), len(links.heads))
    for name in ("pairs", "lines", "kinds", "following"):
        getattr(grown, name)[: len(links.kinds)] = getattr(links, name)
    return grown._replace(heads=links.heads, used=links.used)
