"""Search: the places in a window at which a scan fits a map, by correlative scan matching.

Key scans and their poses enter as a `Submap`. A cell that one of their beams hit is a wall, one
that beams passed is free, and the others are unknown. The poses in the window at which the hits of
another scan lie in most walls and few free cells (Olson 2009) are matched with the map, and leave.
"""

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lrf3d.compiling import compiled
from lrf3d.geometry.lines import Float, Int, Records
from lrf3d.geometry.pose import between
from lrf3d.matching.key_scans import BEHIND, Fans, Key, all_fans, evidence, same_place
from lrf3d.matching.scan_matching import Match, match_scan
from lrf3d.matching.surface import DEVIATIONS, SurfaceGrid, concatenated, grid_of, moved, placement

# Side of a cell [m]: matching converges from one and a half of them.
CELL = 0.15

# Score of a hit in the cell of a wall. It falls by one for each cell away from the wall, so that it
# is 0 at a distance of `WALL` cells.
WALL = 2

# Score of a hit in a free cell.
FREE = -2

# Least score of a peak that is matched, as a share of the best one.
CLOSE = 0.7

# Most peaks of a window that are matched.
MOST_MATCHED = 6

# Information of a peak that is refined: 0.5 m and 0.2 rad, which hardly constrain it.
LOOSE = np.diag([2.0, 2.0, 5.0]) ** 2

# Information of a peak from which matching would slide away: 1 mm and 0.3 mrad hold it in place.
HELD = 1e6 * np.diag([1.0, 1.0, 10.0])

# Margin of the evidence [log odds] by which a place must beat all others elsewhere.
CLEARLY = 0.8


class Field(NamedTuple):
    """Scores of the cells (rows, columns) of a map, and its lower left corner [m]."""

    cells: NDArray[np.int8]
    left: float
    low: float


def field_of(keys: Sequence[Key], poses: Float, fans: Fans) -> Field:
    """Draw the field of key scans at poses (k, 3), with their fans."""
    reach = max(float(np.abs([key.hits["x"], key.hits["y"]]).max(initial=0.0)) for key in keys)
    farthest = 50.0  # Range [m] up to which hits are drawn.
    # A hit lies up to √2 times as far away as its larger coordinate.
    around = 1.5 * min(reach, farthest) + WALL * CELL
    low = poses[:, :2].min(axis=0) - around
    high = poses[:, :2].max(axis=0) + around
    columns, rows = ((high - low) / CELL).astype(np.int64).tolist()
    field = Field(np.zeros((rows, columns), np.int8), *low.tolist())
    _clear(field, poses, fans)
    for key, pose in zip(keys, poses, strict=True):
        _mark(field, pose, key.hits)
    return field


@compiled
def _clear(field: Field, poses: Float, fans: Fans) -> None:
    """Mark the cells that beams of key scans at poses (k, 3) passed as free."""
    high, wide = field.cells.shape
    ranges = fans.ranges
    for number, key in enumerate(fans.keys):
        at = placement(poses[key])
        heading = poses[key, 2]
        behind = BEHIND + DEVIATIONS * fans.noise[number]
        x = fans.x[number]
        y = fans.y[number]
        column = (at.x + at.cos * x - at.sin * y - field.left) / CELL
        row = (at.y + at.sin * x + at.cos * y - field.low) / CELL
        for k in range(fans.first[number] + 1, fans.first[number + 1] - 1):
            least = min(ranges[k - 1], ranges[k], ranges[k + 1])
            if not (least > 0.0 and np.isfinite(least)):
                continue
            along = np.cos(heading + fans.angles[k])
            up = np.sin(heading + fans.angles[k])
            for step in range(int((least - behind) / CELL)):
                c = int(column + step * along)
                r = int(row + step * up)
                if c < 0 or c >= wide or r < 0 or r >= high:
                    break
                field.cells[r, c] = FREE


@compiled
def _mark(field: Field, pose: Float, hits: Records) -> None:
    """Mark the cells of the hits of a scan from a pose (3,) as walls, and the cells around them."""
    high, wide = field.cells.shape
    at = placement(pose)
    for i in range(len(hits)):
        x = at.x + at.cos * hits[i].x - at.sin * hits[i].y - field.left
        y = at.y + at.sin * hits[i].x + at.cos * hits[i].y - field.low
        column = int(x / CELL)
        row = int(y / CELL)
        if not (WALL <= column < wide - WALL and WALL <= row < high - WALL):
            continue
        for r in range(row - WALL + 1, row + WALL):
            for c in range(column - WALL + 1, column + WALL):
                here = WALL - max(abs(r - row), abs(c - column))
                field.cells[r, c] = max(field.cells[r, c], here)


@compiled
def shifts_within(guess: Float, spread: Float, near: float) -> Int:
    """The shifts (s, 2) [cells] of a guess in the ellipse of a window, near the map's origin."""
    # One cell more, so that the least window has neighbours to each side.
    wide = (CELL / DEVIATIONS) ** 2
    xx = spread[0, 0] + wide
    xy = spread[0, 1]
    yy = spread[1, 1] + wide
    right = int(np.ceil(DEVIATIONS * np.sqrt(xx) / CELL))
    up = int(np.ceil(DEVIATIONS * np.sqrt(yy) / CELL))
    shifts = np.empty(((2 * right + 1) * (2 * up + 1), 2), np.int64)
    count = 0
    for row in range(-up, up + 1):
        for column in range(-right, right + 1):
            x = CELL * column
            y = CELL * row
            square = (yy * x * x - 2.0 * xy * x * y + xx * y * y) / (xx * yy - xy * xy)
            if np.hypot(guess[0] + x, guess[1] + y) < near and square <= DEVIATIONS**2:
                shifts[count] = column, row
                count += 1
    return shifts[:count]


@compiled
def window_scores(
    points: Records, field: Field, centre: Float, shifts: Int, angles: Float
) -> Float:
    """The scores (a, s) of points in the field, for each heading and each shift [cells]."""
    high, wide = field.cells.shape
    scores = np.zeros((len(angles), len(shifts)))
    turned = centre.copy()
    for a in range(len(angles)):
        turned[2] = centre[2] + angles[a]
        at = placement(turned)
        for point in points:
            x = at.x + at.cos * point.x - at.sin * point.y
            y = at.y + at.sin * point.x + at.cos * point.y
            column = int(np.floor((x - field.left) / CELL))
            row = int(np.floor((y - field.low) / CELL))
            for s in range(len(shifts)):
                c = column + shifts[s, 0]
                r = row + shifts[s, 1]
                if c >= 0 and c < wide and r >= 0 and r < high:
                    scores[a, s] += field.cells[r, c]
    return scores


@compiled
def _peaks(scores: Float, shifts: Int) -> Int:
    """The heading and the shift (p, 2), by number, of the highest peaks of scores (a, s).

    Scores around a peak, which lead to the same place, are set to 0.
    """
    peaks = np.empty((MOST_MATCHED, 2), np.int64)
    least = max(CLOSE * scores.max(), 0.0)
    for number in range(MOST_MATCHED):
        a, s = divmod(scores.argmax(), len(shifts))
        if scores[a, s] <= least:
            return peaks[:number]
        peaks[number] = a, s
        for other in range(len(shifts)):
            dx = shifts[other, 0] - shifts[s, 0]
            dy = shifts[other, 1] - shifts[s, 1]
            if max(abs(dx), abs(dy)) <= 2:
                scores[max(a - 2, 0) : a + 3, other] = 0.0
    return peaks


class Place(NamedTuple):
    """A match of a scan with a map, and the evidence for it."""

    match: Match
    evidence: float


class Submap:
    """A local map that another scan is matched with: key scans at poses (k, 3)."""

    def __init__(self, keys: Sequence[Key], poses: Float) -> None:
        self.keys = keys
        self.poses = poses

    @cached_property
    def fans(self) -> Fans:
        """The beams of all key scans."""
        return all_fans(key.fans for key in self.keys)

    @cached_property
    def field(self) -> Field:
        """The walls and free cells that all key scans show."""
        return field_of(self.keys, self.poses, self.fans)

    @cached_property
    def grid(self) -> SurfaceGrid | None:
        """The walls of all key scans; None if there are none."""
        parts = zip(self.keys, self.poses, strict=True)
        return grid_of(concatenated(moved(key.walls, at) for key, at in parts))

    def match(self, scan: Key, guess: Float, prior: Float) -> Match | None:
        """Match a scan, starting from a guess (3,); None if scan or map show no walls."""
        if self.grid is None or not len(scan.surface):
            return None
        match = match_scan(scan.surface, self.grid, guess, prior)
        return match if np.isfinite(match.pose).all() else None

    def place(self, scan: Key, match: Match) -> Place:
        """Weigh a match by the evidence for it."""
        poses = between(self.poses, match.pose)
        return Place(match, evidence(scan.hits, match.explained, poses, self.fans))

    def places(self, scan: Key, guess: Float, spread: Float, near: float = np.inf) -> list[Place]:
        """The places in a window where a scan fits the map, those with the highest score first.

        The window has a covariance (3, 3), its spread, around a guess (3,); places farther than a
        distance [m] from the map's origin are left out.
        """
        shifts = shifts_within(guess, spread, near)
        if self.grid is None or not len(scan.surface) or not len(shifts):
            return []
        # A step moves points far away by a cell; these are 5 to 15 m away.
        step = CELL / min(max(scan.far, 5.0), 15.0)
        turns = max(1, int(np.ceil(DEVIATIONS * np.sqrt(spread[2, 2]) / step)))
        angles = step * np.arange(-turns, turns + 1, dtype=np.float64)
        scores = window_scores(thin(scan.hits), self.field, guess, shifts, angles)
        sample = thin(scan.surface)
        found: list[tuple[Float, Float]] = []
        for a, s in _peaks(scores, shifts).tolist():
            peak = guess + np.array([*(CELL * shifts[s]), angles[a]])
            place = match_scan(sample, self.grid, peak, LOOSE).pose
            prior = LOOSE
            if not (np.isfinite(place).all() and same_place(place, peak, 0.5)):
                # It slid away to another place, as along a corridor.
                place = peak
                prior = HELD
            if not any(same_place(place, other) for other, _ in found):
                found.append((place, prior))
        return [
            self.place(scan, match_scan(scan.surface, self.grid, place, prior))
            for place, prior in found
        ]


def thin(points: Records) -> Records:
    """A subsample of many points that is enough to find a place."""
    coarse_points = 80  # Points of a scan with which a window is searched.
    return np.ascontiguousarray(points[:: 1 + len(points) // coarse_points])


def clearest(places: Sequence[tuple[Float, float]]) -> int | None:
    """The index of the pose (3,) whose evidence clearly beats all others elsewhere, if any."""
    if not places:
        return None
    best = int(np.argmax([worth for _, worth in places]))
    pose, most = places[best]
    others = [worth for other, worth in places if not same_place(other, pose, tolerance=2.0)]
    return best if most - max(others, default=-np.inf) > CLEARLY else None
