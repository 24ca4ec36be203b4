"""LiveMap: the map as a value after each update, at the cost of what the update changed.

Enter the segments that changed, in the map's own frame; leaves a `LineMap` in the world. A value
that somebody holds never changes: the arrays of one that nobody holds any more are brought up to
date for the next, row by row, and only where all are held is the whole map copied.

A segment keeps its place in the map, and an object its number, until another takes it: where one
goes, the last takes its place. So neither depends on when the map was looked at.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple
from weakref import ref

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Bool, Float, Int
from lrf3d.mapping.line_map import LineMap

LEAST_ROWS = 256
"""Segments that a new map has room for."""

MOST_COPIES = 2
"""Copies of the map that are kept up to date: one that is looked at, and one for the next map while
the last is still held."""

MOST_WAITING = 16
"""Updates that wait to be written into a copy. One that is held longer is left to its holder."""


class Placement(NamedTuple):
    """Where a map's own frame lies in the world.

    Args:
        x: A place [m] in the world.
        y: The same.
        theta: Heading [rad] of the frame.
        own_x: That place [m] in the frame.
        own_y: The same.
    """

    x: float
    y: float
    theta: float
    own_x: float = 0.0
    own_y: float = 0.0


class Placed(NamedTuple):
    """The segments of the map, each in its place.

    Args:
        segments: (rows, 4) x1 y1 x2 y2 [m] in the world, by place.
        objects: (rows,) the number of the object of each, by place.
        points: (rows,) number of its points, by place.
        rows: (rows,) the row of the pool that each is, by place.
        places: (rows,) the place of each row of the pool; −1 where it has none.
        labels: (rows,) the label of the object of each row of the pool that has a place.
        following: (rows,) the next row of the pool with the same label; −1 at the end.
        preceding: (rows,) the row before; −1 at the beginning.
        heads: (rows,) the first row of each label; −1 where none has it.
        numbers: (rows,) the number of the object of each label.
        known: (rows,) the label of each number.
        changed: (rows,) the places that the last update changed.
        marks: (rows,) whether a place is among them.
        used: (3,) how many segments, objects and changed places there are.
    """

    segments: Float
    objects: Int
    points: Int
    rows: Int
    places: Int
    labels: Int
    following: Int
    preceding: Int
    heads: Int
    numbers: Int
    known: Int
    changed: Int
    marks: Bool
    used: Int

    @classmethod
    def of_size(cls, rows: int) -> "Placed":
        """No segments yet."""
        none = [np.full(rows, -1) for _ in range(9)]
        return cls._make([
            np.zeros((rows, 4)), np.zeros(rows, np.int64), np.zeros(rows, np.int64), *none,
            np.zeros(rows, np.bool_), np.zeros(3, np.int64),
        ])  # fmt: skip

    def doubled(self) -> "Placed":
        """The same with room for twice as many."""
        grown = Placed.of_size(2 * len(self.places))
        for own, column in zip(self[:-1], grown[:-1], strict=True):
            column[: len(own)] = own
        return grown._replace(used=self.used)


class _Copy:
    """Arrays of the map that values are handed out from.

    Args:
        rows: Segments that it has room for.
    """

    __slots__ = ("_held", "_memory", "columns", "rows", "waiting")

    def __init__(self, rows: int) -> None:
        self.rows = rows
        self._memory = np.empty(48 * rows, np.uint8)
        self.columns = self._split(self._memory, rows)
        self.waiting: list[Int] = []
        self._held: ref[NDArray[np.uint8]] | None = None

    def _split(self, memory: NDArray[np.uint8], count: int) -> tuple[Float, Int, Int]:
        return (
            np.ndarray((count, 4), np.float64, memory),
            np.ndarray((count,), np.int64, memory, 32 * self.rows),
            np.ndarray((count,), np.int64, memory, 40 * self.rows),
        )

    @property
    def is_held(self) -> bool:
        """Whether somebody holds an array of the value that was handed out last."""
        return self._held is not None and self._held() is not None

    def value(self, count: int) -> LineMap:
        """The map of the first segments."""
        # NumPy keeps the first array over a foreign buffer alive for all views of it, and views of
        # those: so it is alive for as long as any of them.
        held = np.frombuffer(self._memory.data.toreadonly(), np.uint8)
        self._held = ref(held)
        return LineMap.unchecked(*self._split(held, count))


class LiveMap:
    """The map in the world, kept current segment by segment."""

    def __init__(self) -> None:
        self._placed = Placed.of_size(LEAST_ROWS)
        self._copies: list[_Copy] = []

    def update(
        self, rows: Int, ends: Float, points: Int, labels: Int, placement: Placement
    ) -> None:
        """Follow a change of the pool.

        Args:
            rows: The rows of segments that changed, came or went.
            ends: (all rows, 4) the segments [m] in the map's own frame.
            points: (all rows,) numbers of their points; 0 where there is none.
            labels: (all rows,) the label of the object of each.
            placement: Where that frame lies.
        """
        while len(self._placed.places) < len(points):
            self._placed = self._placed.doubled()
        place_rows(self._placed, rows, ends, points, labels, placement)
        changed = self._placed.changed[: self._placed.used[2]].copy()
        for copy in self._copies:
            copy.waiting.append(changed)
        if len(self._copies) and max(len(copy.waiting) for copy in self._copies) > MOST_WAITING:
            self._copies = [c for c in self._copies if len(c.waiting) <= MOST_WAITING]

    def value(self) -> LineMap:
        """The map as it is now."""
        count = int(self._placed.used[0])
        free = [c for c in self._copies if c.rows >= count and not c.is_held]
        if free:
            copy = free[0]
            self._copies.remove(copy)
            for changed in copy.waiting:
                copy_places(self._placed, changed, *copy.columns)
            copy.waiting.clear()
        else:
            copy = _Copy(len(self._placed.places))
            for own, column in zip(copy.columns, self._placed[:3], strict=True):
                own[:count] = column[:count]
        # The one that was looked at last is the last to be given up.
        self._copies = [*self._copies[-MOST_COPIES + 1 :], copy]
        return copy.value(count)

    def state(self) -> dict[str, Any]:
        """What was placed where, as plain arrays by their names; `restore` takes them back."""
        segments, objects, _ = self._placed.used.tolist()
        return {
            "map_rows": self._placed.rows[:segments].copy(),
            "map_labels": self._placed.known[:objects].copy(),
        }

    def restore(
        self, state: Mapping[str, Any], ends: Float, points: Int, labels: Int, placement: Placement
    ) -> None:
        """Go on from what was placed where."""
        self._placed = Placed.of_size(LEAST_ROWS)
        self._copies = []
        while len(self._placed.places) < len(points):
            self._placed = self._placed.doubled()
        known = state["map_labels"]
        self._placed.known[: len(known)] = known
        self._placed.numbers[known] = np.arange(len(known))
        self._placed.used[1] = len(known)
        place_rows(self._placed, state["map_rows"], ends, points, labels, placement)


@compiled
def place_rows(
    placed: Placed, rows: Int, ends: Float, points: Int, labels: Int, placement: Placement
) -> None:
    """Bring rows (n,) of the pool up to date in the map; see `LiveMap.update`."""
    cos, sin = np.cos(placement.theta), np.sin(placement.theta)
    segments, places, used = placed.segments, placed.places, placed.used
    used[2] = 0
    for k in range(len(rows)):
        row, place = rows[k], places[rows[k]]
        x, y = ends[row, 0] - placement.own_x, ends[row, 1] - placement.own_y
        x1, y1 = (x * cos - y * sin) + placement.x, (x * sin + y * cos) + placement.y
        x, y = ends[row, 2] - placement.own_x, ends[row, 3] - placement.own_y
        x2, y2 = (x * cos - y * sin) + placement.x, (x * sin + y * cos) + placement.y
        # Far from the world's origin the ends of a tiny segment may round to one place.
        if points[row] == 0 or (x1 == x2 and y1 == y2):
            if place >= 0:
                _take_out(placed, row)
            continue
        if place < 0:
            place = used[0]
            used[0] += 1
            places[row], placed.rows[place] = place, row
            _join(placed, row, labels[row])
        elif placed.labels[row] != labels[row]:
            before = placed.labels[row]
            _unlink(placed, row)
            # First: an object whose segments all have a new label is none for a moment.
            _join(placed, row, labels[row])
            _leave(placed, before)
        segments[place, 0], segments[place, 1] = x1, y1
        segments[place, 2], segments[place, 3] = x2, y2
        placed.points[place], placed.objects[place] = points[row], placed.numbers[labels[row]]
        _note(placed, place)
    for k in range(used[2]):
        placed.marks[placed.changed[k]] = False


@inner
def _note(placed: Placed, place: int) -> None:
    """Note that a place changed, once."""
    if not placed.marks[place]:
        placed.marks[place] = True
        placed.changed[placed.used[2]] = place
        placed.used[2] += 1


@inner
def _take_out(placed: Placed, row: int) -> None:
    """Take a row out; the last takes its place."""
    place, last = placed.places[row], placed.used[0] - 1
    moved = placed.rows[last]
    for k in range(4):
        placed.segments[place, k] = placed.segments[last, k]
    placed.objects[place], placed.points[place] = placed.objects[last], placed.points[last]
    placed.rows[place], placed.places[moved] = moved, place
    placed.places[row] = -1
    placed.used[0] = last
    _note(placed, place)
    _unlink(placed, row)
    _leave(placed, placed.labels[row])


@inner
def _unlink(placed: Placed, row: int) -> None:
    """Take a row out of the list of its label."""
    before, after = placed.preceding[row], placed.following[row]
    if before < 0:
        placed.heads[placed.labels[row]] = after
    else:
        placed.following[before] = after
    if after >= 0:
        placed.preceding[after] = before


@inner
def _join(placed: Placed, row: int, label: int) -> None:
    """Put a row into the list of a label, which has a number from then on."""
    head = placed.heads[label]
    if head >= 0:
        placed.preceding[head] = row
    elif placed.numbers[label] < 0:
        placed.numbers[label], placed.known[placed.used[1]] = placed.used[1], label
        placed.used[1] += 1
    placed.heads[label], placed.labels[row] = row, label
    placed.following[row], placed.preceding[row] = head, -1


@inner
def _leave(placed: Placed, label: int) -> None:
    """Give the number of a label that no row has any more to the last object."""
    if placed.heads[label] >= 0:
        return
    number, last = placed.numbers[label], placed.used[1] - 1
    placed.numbers[label], placed.used[1] = -1, last
    if number == last:
        return
    moved = placed.known[last]
    placed.known[number], placed.numbers[moved] = moved, number
    row = placed.heads[moved]
    while row >= 0:
        place = placed.places[row]
        placed.objects[place] = number
        _note(placed, place)
        row = placed.following[row]


@compiled
def copy_places(placed: Placed, changed: Int, segments: Float, objects: Int, points: Int) -> None:
    """Copy places (n,) of the map; those that are there no more have no meaning."""
    for k in range(len(changed)):
        place = changed[k]
        # The map was larger for a while than the copy has room for.
        if place >= len(objects):
            continue
        for side in range(4):
            segments[place, side] = placed.segments[place, side]
        objects[place], points[place] = placed.objects[place], placed.points[place]
