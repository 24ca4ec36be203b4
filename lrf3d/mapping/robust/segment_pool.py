"""SegmentPool: segments that come and go, in arrays that grow in place, found by where they are."""

from typing import NamedTuple

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Float, Int
from lrf3d.mapping.grid import Grid, Search, insert_rows, order_of, remove
from lrf3d.mapping.robust.constants import MERGE_CELL, NEW_POINTS, UNCHANGED
from lrf3d.mapping.robust.walls import Walls, longer

LEAST_ROWS = 256
"""Rows that a new pool has room for."""


class Pool(NamedTuple):
    """Segments, each of a wall that has a number, as compiled code takes them.

    Args:
        walls: The segments; rows without points are free.
        parents: (rows,) the number of the wall that each is of.
        known: (rows,) the points that each had when it was new, or renewed.
        placed: (rows, 4) where each was when it was new [m].
        heads: (walls,) the first segment of each wall by its number; −1 where it has none.
        following: (rows,) the next segment of the same wall; −1 at the end.
        free: (rows,) rows that were given back, the last of them first to be taken again.
        used: (2,) rows that were ever taken, and how many of them are free.
    """

    walls: Walls
    parents: Int
    known: Int
    placed: Float
    heads: Int
    following: Int
    free: Int
    used: Int

    @classmethod
    def of_size(cls, rows: int) -> "Pool":
        """No segments yet."""
        return cls(
            Walls.of_size(rows), np.zeros(rows, np.int64), np.zeros(rows, np.int64),
            np.zeros((rows, 4)), np.full(rows, -1), np.full(rows, -1), np.zeros(rows, np.int64),
            np.zeros(2, np.int64),
        )  # fmt: skip


class NewSegments(NamedTuple):
    """Segments that are not in a pool yet.

    Args:
        ends: (n, 4) where they are [m].
        moments: (n, 6) the moments of their points.
        points: (n,) numbers of their points.
        parents: (n,) the number of the wall that each is of.
    """

    ends: Float
    moments: Float
    points: Int
    parents: Int


class Change(NamedTuple):
    """Rows that an exchange of segments changed.

    Args:
        gone: The rows whose segments are gone.
        fresh: Those that have new ones.
        renewed: Those whose segments have many more points than when they were new.
        moved: Those whose segments may have changed a little, the others among them.
    """

    gone: Int
    fresh: Int
    renewed: Int
    moved: Int


class SegmentPool:
    """Segments, each of a wall that has a number.

    Attributes:
        pool: The segments.
        grid: Where they are, in cells of MERGE_CELL.
        search: Is written by searches of the grid.
    """

    def __init__(self) -> None:
        self.pool = Pool.of_size(LEAST_ROWS)
        self.grid = Grid.of_size(4 * LEAST_ROWS)
        self.search = Search.of_size(LEAST_ROWS)

    @property
    def walls(self) -> Walls:
        """The segments; rows without points are free."""
        return self.pool.walls

    @property
    def size(self) -> int:
        """How many rows there is room for."""
        return len(self.pool.parents)

    def rows(self) -> Int:
        """The rows of all segments."""
        return np.flatnonzero(self.walls.points[: self.pool.used[0]])

    def add(self, new: NewSegments, most: int) -> Int:
        """Add segments of walls whose numbers are less than the most; returns their rows (n,)."""
        self.make_room(len(new.ends), most)
        rows, done = add_rows(self.pool, self.grid, new)
        if done < len(rows):
            self._regrid()
        return rows

    def exchange(self, walls: Int, new: NewSegments, most: int) -> Change:
        """Put segments in the place of those of some walls.

        One that hardly differs from where another was when it was new keeps its row. When it has
        many more points it is renewed. Numbers of walls are less than the most.
        """
        self.make_room(len(new.ends), most)
        change, done = exchange_rows(self.pool, self.grid, walls, new)
        if done < len(new.ends):
            self._regrid()
        return change

    def make_room(self, count: int, most: int) -> None:
        """Have room for so many more segments, of walls whose numbers are less than the most."""
        pool = self.pool
        while pool.used[0] + count > len(pool.parents):
            pool = pool._replace(
                walls=pool.walls.doubled(),
                parents=longer(pool.parents),
                known=longer(pool.known),
                placed=longer(pool.placed),
                following=longer(pool.following),
                free=longer(pool.free),
            )
            self.search = Search.of_size(len(pool.parents))
        while len(pool.heads) < most:
            pool = pool._replace(heads=np.concatenate([pool.heads, np.full_like(pool.heads, -1)]))
        self.pool = pool

    def _regrid(self) -> None:
        """Put all segments into a larger grid."""
        rows, done = self.rows(), 0
        while done < len(rows):
            self.grid = Grid.of_size(2 * len(self.grid.rows))
            done = insert_rows(self.grid, rows, 0, self.walls.ends, MERGE_CELL)


@compiled
def add_rows(pool: Pool, grid: Grid, new: NewSegments) -> tuple[Int, int]:
    """See `SegmentPool.add`; returns the first that the grid had no room for as well."""
    rows = np.empty(len(new.ends), np.int64)
    for k in range(len(rows)):
        rows[k] = _take(pool)
    return rows, _put(pool, grid, rows, new)


@compiled
def drop_rows(pool: Pool, grid: Grid, walls: Int) -> None:
    """Drop all segments of some walls."""
    gone = _pop(pool, grid, walls)
    for k in range(len(gone)):
        _give_back(pool, gone[k])


@compiled
def exchange_rows(pool: Pool, grid: Grid, walls: Int, new: NewSegments) -> tuple[Change, int]:
    """See `SegmentPool.exchange`; returns the first that the grid had no room for as well."""
    ends, points, count = new.ends, new.points, len(new.ends)
    old = _pop(pool, grid, walls)
    places = match(pool.placed, old, ends)
    kept, rows = np.zeros(len(old), np.bool_), np.empty(count, np.int64)
    for k in range(count):
        if places[k] >= 0:
            kept[places[k]] = True
    gone, number = np.empty(len(old), np.int64), 0
    for k in range(len(old)):
        if not kept[k]:
            gone[number] = old[k]
            _give_back(pool, old[k])
            number += 1
    gone = gone[:number]
    fresh, renewed = np.empty(count, np.int64), np.empty(count, np.int64)
    added = grown = 0
    for k in range(count):
        if places[k] < 0:
            row = rows[k] = fresh[added] = _take(pool)
            added += 1
            for side in range(4):
                pool.placed[row, side] = ends[k, side]
            pool.known[row] = points[k]
        else:
            row = rows[k] = old[places[k]]
            if points[k] > NEW_POINTS * pool.known[row]:
                renewed[grown] = row
                grown += 1
                pool.known[row] = points[k]
    done = _put(pool, grid, rows, new)
    moved = rows_of(pool, new.parents)
    return Change(gone, fresh[:added], renewed[:grown], moved), done


@inner
def rows_of(pool: Pool, walls: Int) -> Int:
    """The rows of the segments of some walls; equal walls may come in a run."""
    rows = np.empty(0, np.int64)
    for turn in range(2):
        count = 0
        for k in range(len(walls)):
            if k == 0 or walls[k] != walls[k - 1]:
                row = pool.heads[walls[k]]
                while row >= 0:
                    if turn:
                        rows[count] = row
                    count += 1
                    row = pool.following[row]
        if not turn:
            rows = np.empty(count, np.int64)
    return rows


@inner
def _pop(pool: Pool, grid: Grid, walls: Int) -> Int:
    """Take all segments of some walls out of the grid; returns their rows, rising."""
    rows = rows_of(pool, walls)
    for k in range(len(walls)):
        pool.heads[walls[k]] = -1
    rows = rows[order_of(rows)]
    for k in range(len(rows)):
        remove(grid, rows[k], pool.walls.ends[rows[k]], MERGE_CELL)
    return rows


@inner
def _put(pool: Pool, grid: Grid, rows: Int, new: NewSegments) -> int:
    """Write segments into rows; returns the first that the grid had no room for."""
    walls = pool.walls
    # From the last on, so that the first of a wall is the head of its list.
    for k in range(len(rows) - 1, -1, -1):
        row, parent = rows[k], new.parents[k]
        for side in range(4):
            walls.ends[row, side] = new.ends[k, side]
        for place in range(6):
            walls.moments[row, place] = new.moments[k, place]
        walls.points[row], pool.parents[row] = new.points[k], parent
        pool.following[row] = pool.heads[parent]
        pool.heads[parent] = row
    done: int = insert_rows(grid, rows, 0, walls.ends, MERGE_CELL)
    return done


@inner
def _take(pool: Pool) -> int:
    """A free row."""
    if pool.used[1]:
        pool.used[1] -= 1
        row: int = pool.free[pool.used[1]]
        return row
    pool.used[0] += 1
    row = pool.used[0] - 1
    return row


@inner
def _give_back(pool: Pool, row: int) -> None:
    """Make a row free."""
    pool.walls.points[row] = 0
    pool.free[pool.used[1]] = row
    pool.used[1] += 1


@inner
def match(before: Float, old: Int, ends: Float) -> Int:
    """For each of some segments (n, 4) the place of the old row that it hardly differs from.

    Args:
        before: (rows, 4) where all segments were [m].
        old: (m,) rows of them.
        ends: (n, 4) the segments [m].

    Returns:
        (n,) places among the old rows, each once; −1 where there is none.
    """
    places, taken = np.full(len(ends), -1), np.zeros(len(old), np.bool_)
    for k in range(len(ends)):
        best, least = -1, UNCHANGED
        for place in range(len(old)):
            apart = 0.0
            for side in range(4):
                apart = max(apart, abs(ends[k, side] - before[old[place], side]))
            if apart < least:
                best, least = place, apart
        if best >= 0 and not taken[best]:
            places[k], taken[best] = best, True
    return places
