"""ObjectGroups: which segments of a growing map are of one object, and their closed corners.

Enter the segments that an update changed; leave objects that are worked out anew only near to
them. What the beams have shown of a link between two walls is asked once.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from lrf3d.geometry import Int
from lrf3d.laser import RangeNoise
from lrf3d.mapping.robust.cells import Cells
from lrf3d.mapping.robust.constants import LINK_DEVIATIONS, LONGEST_LINK
from lrf3d.mapping.robust.corners import close_corners
from lrf3d.mapping.robust.links import (
    Links,
    add_links,
    drop_links,
    linked_labels,
    renew_links,
)
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
        self._members: dict[int, Int] = {}
        self._places = np.full(LEAST_ROWS, -1)
        self._links = Links.of_size(LEAST_LINKS, LEAST_ROWS)

    def update(
        self,
        pool: SegmentPool,
        gone: Int,
        fresh: Int,
        renewed: Int,
        moved: Int,
        cells: Cells,
        noise: RangeNoise,
    ) -> None:
        """Follow a change of the pool.

        Args:
            pool: The segments.
            gone: The rows whose segments are gone.
            fresh: The rows with new segments.
            renewed: The rows with segments that the beams are asked about again.
            moved: The rows whose segments have changed a little, some of the others too.
            cells: What the beams have shown.
            noise: The noise of the ranges.
        """
        while len(self.labels) < len(pool.parents):
            self.closed, self.labels = longer(self.closed), longer(self.labels)
            heads = np.concatenate([self._links.heads, np.full_like(self._links.heads, -1)])
            self._links = self._links._replace(heads=heads)
            self._places = np.full(len(self.labels), -1)
        broken = set(self.labels[gone].tolist())
        drop_links(self._links, gone)
        self.labels[fresh] = -1
        self._add_links(pool, fresh)
        renew_links(self._links, renewed, pool.walls.ends)
        broken.update(self.labels[renewed].tolist())
        near: set[int] = set()
        for rows in (fresh, renewed):
            near.update(linked_labels(self._links, rows, self.labels).tolist())
        near -= broken | {-1}
        rows = np.concatenate([fresh, *(self._members.pop(label) for label in sorted(broken))])
        rows = np.unique(rows)
        rows = rows[pool.walls.points[rows] > 0]
        changed = [gone, moved]
        if len(rows):
            changed.append(self._regroup(pool, rows, sorted(near), cells, noise))
        ends, points = pool.walls.ends, pool.walls.points
        rows = np.unique(np.concatenate(changed))
        close_corners(rows, ends, points, self.labels, pool.grid, pool.search, self.closed)

    def _add_links(self, pool: SegmentPool, fresh: Int) -> None:
        """Link fresh rows with what is near them."""
        self._places[fresh] = np.arange(len(fresh))
        done = 0
        while done < len(fresh):
            done = add_links(
                self._links, fresh, done, self._places, pool.walls, pool.grid, pool.search
            )
            if done < len(fresh):
                drop_links(self._links, fresh[done : done + 1])
                self._links = _doubled(self._links)
        self._places[fresh] = -1

    def _regroup(
        self, pool: SegmentPool, loose: Int, near: list[int], cells: Cells, noise: RangeNoise
    ) -> Int:
        """Find the objects of loose rows, some of those near or new ones; returns what changed."""
        deviation = float(np.sqrt(noise.variance(np.array(LONGEST_LINK))))
        sight = Sight(*pool.walls[::2], pool.grid, cells, LINK_DEVIATIONS * deviation, pool.search)
        rows = np.concatenate([loose, *(self._members[label] for label in near)])
        before = self.labels[rows]
        roots = associate_objects(rows, len(loose), before, self._links, self._places, sight)
        # Objects that no loose row has become a part of stay as they are.
        grown = np.zeros(len(rows), np.bool_)
        grown[roots[: len(loose)]] = True
        changed = grown[roots]
        for label in set(before[len(loose) :][changed[len(loose) :]].tolist()):
            del self._members[label]
        names = rows.copy()
        # An object that grows keeps its name.
        names[roots[len(loose) :]] = before[len(loose) :]
        rows, labels, before = rows[changed], names[roots[changed]], before[changed]
        self.labels[rows] = labels
        self._gather(rows, labels)
        renamed: Int = rows[labels != before]
        return renamed

    def _gather(self, rows: Int, labels: Int) -> None:
        """Note which rows are of each object."""
        order = np.argsort(labels, kind="stable")
        rows, labels = rows[order], labels[order]
        begins = np.flatnonzero(np.diff(labels, prepend=-1))
        ends = [*begins[1:].tolist(), len(rows)]
        for label, begin, end in zip(labels[begins].tolist(), begins.tolist(), ends, strict=True):
            self._members[label] = rows[begin:end]

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
        self._places = np.full(len(self.labels), -1)
        self._members = {}
        rows = pool.rows()
        self._gather(rows, self.labels[rows])


def _doubled(links: Links) -> Links:
    """The same links with room for twice as many."""
    grown = Links.of_size(2 * len(links.kinds), len(links.heads))
    for name in ("pairs", "lines", "kinds", "following", "preceding"):
        getattr(grown, name)[: len(links.kinds)] = getattr(links, name)
    return grown._replace(heads=links.heads, used=links.used)
