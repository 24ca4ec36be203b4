"""The paper's mapper: section 3 of Teslić et al. (and its [4]) to the letter.

A scan enters. Runs of returns no farther apart than a fixed gap are clusters, split-and-merge makes
a polyline of each, and Eq. 9 decides which segments of scan and map are one: G_new = S ∪ G_old.
"""

from collections import deque
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from lrf3d.geometry.lines import Bool, Float, Int, cross, directions, fit_line, lengths
from lrf3d.laser import LaserScan, beam_directions
from lrf3d.mapping.line_map import LineMap, solid_map


class SegmentTable(NamedTuple):
    """Segments (m, 4) [m], seen from their left, their numbers of points (m,), and unions (m,)."""

    ends: Float
    points: Int
    unions: Int

    @classmethod
    def empty(cls) -> "SegmentTable":
        """A table of no rows."""
        return cls(np.zeros((0, 4)), *np.zeros((2, 0), np.int64))

    def take(self, rows: Int) -> "SegmentTable":
        """The table of some rows."""
        return SegmentTable._make(column[rows] for column in self)

    def join(self, other: "SegmentTable") -> "SegmentTable":
        """The rows of this table and then those of another."""
        return SegmentTable._make(np.concatenate(pair) for pair in zip(self, other, strict=True))

    def as_map(self, place: Float) -> LineMap:
        """The map of the segments around a place (2,) [m] in the world."""
        return solid_map(self.ends + np.tile(place, 2), self.unions, self.points)


def fit_segment(points: Float, along: Float) -> Float:
    """The segment (4,) on the best line of points (n, 2) that spans them, along a direction."""
    mean, unit = fit_line(points)
    if unit @ along < 0.0:
        unit = -unit
    places = (points - mean) @ unit
    return np.concatenate([mean + places.min() * unit, mean + places.max() * unit])


def split_and_merge(points: Float, split: float) -> SegmentTable:
    """Polyline of a cluster of points (n, 2), its lines fitted by total least squares.

    The cluster is split at the point farthest from the chord of its ends while that point is
    farther than ``split`` [m]; then neighbours are merged again where all their points lie
    within ``split`` of one common line. A piece of one point, or of points at one place, is no
    segment.
    """
    cuts = _merge(points, _split(points, split), split)
    ends = [
        fit_segment(points[first : last + 1], points[last] - points[first])
        for first, last in pairwise(cuts)
    ]
    table = SegmentTable(
        np.reshape(ends, (-1, 4)), 1 + np.diff(cuts), np.zeros(len(ends), np.int64)
    )
    # Length [m] that a segment is longer than: points nearer to each other have no direction.
    least_length = 1e-9
    return table.take(np.flatnonzero(lengths(table.ends) > least_length))


def _split(points: Float, split: float) -> list[int]:
    """Rising indices of the vertices of the polyline; neighbours share theirs."""
    cuts = [0]
    stack = [(0, len(points) - 1)]
    while stack:
        first, last = stack.pop()
        chord = points[last] - points[first]
        offset = points[first : last + 1] - points[first]
        length = np.hypot(*chord)
        away = np.abs(cross(chord, offset)) / length if length > 0.0 else np.hypot(*offset.T)
        farthest = int(np.argmax(away))
        if 0 < farthest < last - first and away[farthest] > split:
            stack += [(first + farthest, last), (first, first + farthest)]
        else:
            cuts.append(last)
    return cuts


def _merge(points: Float, cuts: list[int], split: float) -> list[int]:
    """The vertices that are left when neighbours on one line are merged, straightest first."""
    while len(cuts) > 2:
        spread = []
        for first, last in zip(cuts[:-2], cuts[2:], strict=True):
            mean, unit = fit_line(points[first : last + 1])
            spread.append(np.abs(cross(unit, points[first : last + 1] - mean)).max())
        straightest = int(np.argmin(spread))
        if spread[straightest] > split:
            break
        del cuts[straightest + 1]
    return cuts


def ordered_returns(scan: LaserScan) -> tuple[Int, bool]:
    """Beams (n,) of a scan by rising angle, each direction once, and whether they close a circle.

    A scan of 360° whose last beam points where its first does reports that beam once.
    """
    order = np.argsort(scan.angles, kind="stable")
    if len(order) < 3:
        return order, False
    angles = scan.angles[order]
    step = float(np.median(np.diff(angles)))
    left = 2.0 * np.pi - float(angles[-1] - angles[0])
    if left < 0.5 * step:
        return order[:-1], True
    return order, left < 1.5 * step


def clusters(scan: LaserScan, gap: float) -> Iterator[Int]:
    """Runs (n,) of beams whose returns lie within a gap [m] of the next; lone ones are dropped."""
    order, circle = ordered_returns(scan)
    hit = scan.hits[order]
    points = _returns(scan)[order]
    steps = np.roll(points, -1, axis=0) - points
    linked = (np.hypot(steps[:, 0], steps[:, 1]) <= gap) & hit & np.roll(hit, -1)
    if not circle:
        linked[-1:] = False
    elif linked.all():
        # One wall all round: any beam is as good to begin at.
        yield order
        return
    else:
        # Begin after a gap, so that no cluster wraps around the end of the list.
        begin = int(np.argmin(linked)) + 1
        order = np.roll(order, -begin)
        linked = np.roll(linked, -begin)
    first = 0
    for last in np.flatnonzero(~linked).tolist():
        if last > first:
            yield order[first : last + 1]
        first = last + 1


def _returns(scan: LaserScan) -> Float:
    """The returns (n, 2) [m] of all beams around the laser, in the world's directions."""
    ranges = np.where(scan.hits, scan.ranges, 0.0)
    return np.asarray(ranges[:, None] * beam_directions(scan.pose.theta, scan.angles))


class SplitMergeExtractor(NamedTuple):
    """The polylines of a scan: clusters by a fixed gap [m], split [m] and merged."""

    gap: float
    split: float

    def local_map(self, scan: LaserScan) -> LineMap:
        """The polylines of a scan in the world."""
        return self.polylines(scan).as_map(np.array(scan.pose[:2]))

    def polylines(self, scan: LaserScan) -> SegmentTable:
        """The polylines of a scan, in the world's directions around the laser."""
        points = _returns(scan)
        table = SegmentTable.empty()
        for number, beams in enumerate(clusters(scan, self.gap)):
            polyline = split_and_merge(points[beams], self.split)
            table = table.join(polyline._replace(unions=polyline.unions + number))
        return table


def merges(segment: Float, others: Float, length: float, distance: float) -> Bool:
    """Whether Eq. 9 merges a segment L1 (4,) with each of others L2 (m, 4).

    The thresholds are T [m], of the conditions c1 to c4, and R [m], of the distances.
    """
    a_end = segment[:2]
    b_end = segment[2:]
    c_ends = others[:, :2]
    d_ends = others[:, 2:]
    (a, b), (c, d) = (
        [np.hypot(*(ends - end).T) for end in (a_end, b_end)] for ends in (c_ends, d_ends)
    )
    own = np.hypot(*(b_end - a_end))
    other = lengths(others)
    c1 = a + b < own + length
    c2 = c + d < own + length
    c3 = a + c < other + length
    c4 = b + d < other + length
    unit = (b_end - a_end) / own
    units = directions(others)
    offsets = [cross(unit, c_ends - a_end), cross(unit, d_ends - a_end)]
    offsets += [cross(units, a_end - c_ends), cross(units, b_end - c_ends)]
    beside = np.abs(offsets).max(axis=0) < distance
    two = c1.astype(int) + c2 + c3 + c4 >= 2
    return np.asarray((two & beside) | (c1 & c2) | (c3 & c4))


def unite(table: SegmentTable, row: int, other: int) -> None:
    """Merge the second row into the first: the line through the four ends, which are projected."""
    ends = table.ends[[row, other]].reshape(-1, 2)
    table.ends[row] = fit_segment(ends, ends[1] - ends[0])
    table.points[row] += table.points[other]
    table.points[other] = 0
    table.unions[table.unions == table.unions[other]] = table.unions[row]


class PaperMapper:
    """The map of section 3.1, by T and R of Eq. 9 [m].

    Segments with fewer points than the least are kept back until they have more.
    """

    def __init__(
        self, extract: SplitMergeExtractor, length: float, distance: float, least: int
    ) -> None:
        self._extract = extract
        self._least = least
        self.local_map = extract.local_map
        self._length = length
        self._distance = distance
        self._origin = np.zeros(2)
        self._map: LineMap | None = None
        self.table = SegmentTable.empty()
        """All segments, around the map's origin."""

    def update(self, scan: LaserScan) -> None:
        """Unite the map with the local map of a scan."""
        place = np.array(scan.pose[:2])
        if not len(self.table.ends):
            # Whole metres, so that subtracting the origin and adding it again loses nothing.
            self._origin = np.round(place)
        local = self._extract.polylines(scan)
        self.add(local._replace(ends=local.ends + np.tile(place - self._origin, 2)))

    def add(self, local: SegmentTable) -> None:
        """Unite the map with segments around its origin."""
        unions = local.unions + 1 + self.table.unions.max(initial=-1)
        table = self.table.join(local._replace(unions=unions))
        # Only fresh and merged segments are compared: the others were compared before. The loop
        # ends, since each merge takes one segment away.
        waiting = deque(range(len(self.table.ends), len(table.ends)))
        while waiting:
            row = waiting.popleft()
            if not table.points[row]:
                continue
            fits = merges(table.ends[row], table.ends, self._length, self._distance)
            fits &= table.points > 0
            fits[row] = False
            if fits.any():
                unite(table, row, int(fits.argmax()))
                waiting.append(row)
        self.table = table.take(np.flatnonzero(table.points))
        self._map = None

    @property
    def map(self) -> LineMap:
        """The segments that have enough points, in the world."""
        if self._map is None:
            shown = np.flatnonzero(self.table.points >= self._least)
            self._map = self.table.take(shown).as_map(self._origin)
        return self._map
