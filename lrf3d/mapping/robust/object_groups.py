"""ObjectGroups: which segments of a growing map are of one object, and their closed corners.

Enter the segments that an update changed; leave objects that are worked out anew only near to
them. What the beams have shown of a link between two walls is asked once.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Bool, Float, Int
from lrf3d.laser import RangeNoise
from lrf3d.mapping.grid import order_of
from lrf3d.mapping.robust.cells import Cells
from lrf3d.mapping.robust.constants import LINK_DEVIATIONS, LINKS_A_TURN, LONGEST_LINK, MOST_LINKS
from lrf3d.mapping.robust.corners import close_corners
from lrf3d.mapping.robust.links import Links, add_links, drop_links, renew_links
from lrf3d.mapping.robust.object_association import Sight, associate_objects, recheck_links
from lrf3d.mapping.robust.segment_pool import LEAST_ROWS, Change, Pool, SegmentPool

LEAST_LINKS = 1 << 12
"""Links that there is room for at first."""


class Groups(NamedTuple):
    """The object of each segment of a pool, as compiled code takes them.

    Args:
        closed: (rows, 4) the segments with closed corners [m].
        labels: (rows,) the object of each, named by one of its segments; −1 where it has none.
        heads: (rows,) the first segment of each object; −1 where there is none.
        tails: (rows,) the last.
        following: (rows,) the next segment of the same object; −1 at the end.
        places: (rows,) −1; is written, and restored.
        marks: (rows,) False; is written, and restored.
        links: What may join the segments.
    """

    closed: Float
    labels: Int
    heads: Int
    tails: Int
    following: Int
    places: Int
    marks: Bool
    links: Links

    @classmethod
    def of_size(cls, rows: int, links: Links) -> "Groups":
        """No objects yet."""
        return cls(
            np.zeros((rows, 4)), np.full(rows, -1), np.full(rows, -1), np.full(rows, -1),
            np.full(rows, -1), np.full(rows, -1), np.zeros(rows, np.bool_), links,
        )  # fmt: skip


class ObjectGroups:
    """The object of each segment of a pool."""

    def __init__(self) -> None:
        self._groups = Groups.of_size(LEAST_ROWS, Links.of_size(LEAST_LINKS, LEAST_ROWS))

    @property
    def closed(self) -> Float:
        """(rows, 4) the segments with closed corners [m]."""
        return self._groups.closed

    @property
    def labels(self) -> Int:
        """(rows,) the object of each segment, by name."""
        return self._groups.labels

    def update(self, pool: SegmentPool, change: Change, cells: Cells, noise: RangeNoise) -> Int:
        """Follow a change of the pool.

        Args:
            pool: The segments.
            change: What changed.
            cells: What the beams have shown.
            noise: The noise of the ranges.

        Returns:
            The rows whose segments, objects or corners have changed, some of them more than once.
        """
        self._make_room(pool.size, len(change.fresh))
        deviation = float(np.sqrt(noise.variance(np.array(LONGEST_LINK))))
        sight = Sight(*pool.walls[::2], pool.grid, cells, LINK_DEVIATIONS * deviation, pool.search)
        return regroup(self._groups, pool.pool, change, sight)

    def _make_room(self, rows: int, fresh: int) -> None:
        """Have room for so many rows, and for all links that fresh ones may have."""
        groups = self._groups
        while len(groups.labels) < rows:
            count = len(groups.labels)
            heads = np.concatenate([groups.links.heads, np.full(count, -1)])
            grown = Groups.of_size(2 * count, groups.links._replace(heads=heads))
            for name in ("closed", "labels", "heads", "tails", "following"):
                getattr(grown, name)[:count] = getattr(groups, name)
            groups = grown
        while groups.links.used[0] + MOST_LINKS * fresh > len(groups.links.kinds):
            groups = groups._replace(links=_doubled(groups.links))
        self._groups = groups


@compiled
def regroup(groups: Groups, pool: Pool, change: Change, sight: Sight) -> Int:
    """See `ObjectGroups.update`."""
    labels, links, places, marks = groups.labels, groups.links, groups.places, groups.marks
    gone, fresh, renewed = change.gone, change.fresh, change.renewed
    broken, count = np.empty(len(gone) + len(renewed) + LINKS_A_TURN, np.int64), 0
    for k in range(len(gone)):
        count = _add(marks, broken, count, labels[gone[k]])
    drop_links(links, gone)
    for k in range(len(fresh)):
        labels[fresh[k]] = -1
        places[fresh[k]] = k
    add_links(links, fresh, places, pool.walls, sight.grid, sight.search)
    for k in range(len(fresh)):
        places[fresh[k]] = -1
    renew_links(links, renewed, pool.walls.ends)
    for k in range(len(renewed)):
        count = _add(marks, broken, count, labels[renewed[k]])
    parted = recheck_links(links, sight)
    for k in range(len(parted)):
        count = _add(marks, broken, count, labels[parted[k]])
    near = _linked_labels(groups, fresh, renewed)
    loose = _members(groups, broken[:count], fresh, pool.walls.points)
    for k in range(count):
        marks[broken[k]] = False
        groups.heads[broken[k]] = -1
    rows = _associate(groups, loose, near, sight) if len(loose) else loose[:0]
    changed = np.empty(len(gone) + len(change.moved) + len(rows), np.int64)
    count = 0
    for part in (gone, change.moved, rows):
        for k in range(len(part)):
            count = _add(marks, changed, count, part[k])
    for k in range(count):
        marks[changed[k]] = False
    changed = changed[:count]
    around = close_corners(
        changed, pool.walls, labels, sight.grid, sight.search, groups.closed, marks
    )
    rows = np.empty(count + len(around), np.int64)
    for k in range(len(rows)):
        rows[k] = changed[k] if k < count else around[k - count]
    return rows


@inner
def _add(marks: Bool, names: Int, count: int, name: int) -> int:
    """Add a name to a list, once, and mark it; returns the length of the list."""
    if name < 0 or marks[name]:
        return count
    marks[name] = True
    names[count] = name
    return count + 1


@inner
def _linked_labels(groups: Groups, fresh: Int, renewed: Int) -> Int:
    """The objects, rising, of what some segments are linked with, but for marked ones."""
    links, labels, marks = groups.links, groups.labels, groups.marks
    names, count = np.empty(len(labels), np.int64), 0
    for rows in (fresh, renewed):
        for k in range(len(rows)):
            entry = links.heads[rows[k]]
            while entry >= 0:
                across = links.pairs[entry >> 1, 1 - (entry & 1)]
                count = _add(marks, names, count, labels[across])
                entry = links.following[entry >> 1, entry & 1]
    for k in range(count):
        marks[names[k]] = False
    names = names[:count]
    return names[order_of(names)]


@inner
def _members(groups: Groups, names: Int, fresh: Int, points: Int) -> Int:
    """The rows, rising, of all segments of some objects, and of fresh ones."""
    places = groups.places
    rows, count = np.empty(len(places), np.int64), 0
    for k in range(len(fresh)):
        rows[count] = fresh[k]
        places[fresh[k]] = count
        count += 1
    for k in range(len(names)):
        row = groups.heads[names[k]]
        while row >= 0:
            if points[row] > 0 and places[row] < 0:
                rows[count] = row
                places[row] = count
                count += 1
            row = groups.following[row]
    rows = rows[:count]
    for k in range(count):
        places[rows[k]] = -1
    return rows[order_of(rows)]


@inner
def _associate(groups: Groups, loose: Int, near: Int, sight: Sight) -> Int:
    """Find the objects of loose rows, some of those near or new ones; returns what changed."""
    labels, heads, following = groups.labels, groups.heads, groups.following
    count = len(loose)
    for k in range(len(near)):
        row = heads[near[k]]
        while row >= 0:
            count += 1
            row = following[row]
    rows, before = np.empty(count, np.int64), np.empty(count, np.int64)
    count = len(loose)
    for k in range(count):
        rows[k] = loose[k]
    for k in range(len(near)):
        row = heads[near[k]]
        while row >= 0:
            rows[count] = row
            count += 1
            row = following[row]
    for k in range(count):
        before[k] = labels[rows[k]]
    roots = associate_objects(rows, len(loose), before, groups.links, groups.places, sight)
    # Objects that no loose row has become a part of stay as they are.
    grown = np.zeros(count, np.bool_)
    for k in range(len(loose)):
        grown[roots[k]] = True
    names = rows.copy()
    for k in range(len(loose), count):
        # An object that grows keeps its name.
        names[roots[k]] = before[k]
        if grown[roots[k]]:
            heads[before[k]] = -1
    renamed = 0
    for k in range(count):
        row, name = rows[k], names[roots[k]]
        if grown[roots[k]]:
            if heads[name] < 0:
                heads[name] = row
            else:
                following[groups.tails[name]] = row
            groups.tails[name], following[row] = row, -1
            labels[row] = name
    for k in range(count):
        if labels[rows[k]] != before[k]:
            rows[renamed] = rows[k]
            renamed += 1
    return rows[:renamed]


def _doubled(links: Links) -> Links:
    """The same links with room for twice as many."""
    grown = Links.of_size(2 * len(links.kinds), len(links.heads))
    for name in ("pairs", "lines", "kinds", "bearing", "following", "preceding"):
        getattr(grown, name)[: len(links.kinds)] = getattr(links, name)
    return grown._replace(heads=links.heads, used=links.used)
